"""Strokes in another ink as they are drawn: there and back is what there was."""

import base64
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from svg_programs import GOLDEN, small

from strokestyle.drawing.edit import recolor
from strokestyle.svg.kept import carried, kept_strokes
from strokestyle.svg.markup import Element
from strokestyle.svg.read import read_svg_file
from strokestyle.svg.recolor import recolored_strokes
from strokestyle.svg.write import png_from_svg, write_svg

INK, RED = (26 / 255, 40 / 255, 77 / 255), (0.8, 0.2, 0.2)
KINDS = [("none", None), ("vector", "grain"), ("image", "grain"), ("image", "colours")]


def recolored(text, color, only=range(5)):
    """The text of a drawing, some strokes of which are given another ink."""
    file = read_svg_file(text)
    index = list(only)
    after = recolor(file.drawing, color, np.isin(np.arange(5), index))
    kept = carried(
        file.kept,
        file.drawing,
        after,
        lambda drawn: recolored_strokes(drawn, file.drawing, color, index),
    )
    assert len(kept_strokes(after, file.options, kept)) == 5
    return write_svg(after, file.options, ids=file.ids, kept=kept)


def pixels(text):
    picture = Image.open(io.BytesIO(png_from_svg(text, 2.0)))
    return np.asarray(picture.convert("RGB"), np.float64)


@pytest.mark.parametrize("encoding, texture", KINDS)
def test_there_and_back_is_the_same_look_however_often(encoding, texture):
    first = text = recolored(write_svg(small(texture), texture=encoding), INK)
    for _ in range(8):
        red = recolored(text, RED)
        text = recolored(red, INK)
    assert red != first
    if texture == "colours":  # some are as blue as can be, and lose what lies beyond
        assert np.abs(pixels(text) - pixels(first)).mean() < 1.0
        assert recolored(recolored(text, RED), INK) == text
    else:
        assert text == first


@pytest.mark.parametrize("encoding, texture", KINDS)
def test_it_looks_like_the_edit_of_the_drawing(encoding, texture):
    text = write_svg(small(texture), texture=encoding)
    file = read_svg_file(text)
    ours, theirs, before = map(
        pixels,
        (recolored(text, RED), write_svg(recolor(file.drawing, RED), texture=encoding), text),
    )
    ink = 255 - before.min(axis=2, keepdims=True)
    ours, theirs = ((ink * each).sum(axis=(0, 1)) / ink.sum() for each in (ours, theirs))
    assert ours == pytest.approx(theirs, abs=6)
    assert ours[0] > ours[2] + 20


def test_only_those_that_are_meant_change_a_letter():
    text = write_svg(small("grain"), texture="image")
    made = recolored(text, RED, only=[1, 4])
    lines = zip(*(each.split('\n<g id="s') for each in (text, made)), strict=True)
    assert [a == b for a, b in lines] == [True, True, False, True, True, False]
    told = re.findall('base64,([^"]*)"', made)
    seen = [np.asarray(Image.open(io.BytesIO(base64.b64decode(t))).convert("RGBA")) for t in told]
    inks = [tuple(image[image[..., 3] > 0][0, :3].tolist()) for image in seen]
    assert inks == [(26, 40, 77), (204, 51, 51), (26, 40, 77), (26, 40, 77), (204, 51, 51)]


def test_a_strip_that_is_told_changes_with_what_is_drawn():
    """Of a stroke that lies on itself, there and back."""
    drawing, turn = small("colours"), np.arange(12)
    xy = drawing.strokes.xy.copy()
    xy[:12] = np.stack([60 + 20 * np.cos(turn), 40 + 20 * np.sin(turn)], axis=1)
    drawing = replace(drawing, strokes=replace(drawing.strokes, xy=xy))
    text = recolored(write_svg(drawing, texture="image"), (0.5, 0.5, 0.5))
    red = recolored(text, RED)
    for made, color in ((text, (0.5, 0.5, 0.5)), (red, RED)):
        (told,) = re.findall('data-ss-texture="([^"]*)"', made)
        strip = np.asarray(Image.open(io.BytesIO(base64.b64decode(told))).convert("RGBA"), float)
        mean = (strip[..., :3] * strip[..., 3:]).sum(axis=(0, 1)) / strip[..., 3].sum()
        assert mean == pytest.approx(255 * np.array(color), abs=12)  # some red is cut off


def test_an_image_of_too_many_colours_is_drawn_anew():
    file = read_svg_file(write_svg(small("colours"), texture="image"))
    noise = np.random.default_rng(0).integers(0, 256, (20, 20, 4)).astype(np.uint8)
    packed = io.BytesIO()
    Image.fromarray(noise).save(packed, "PNG")
    href = "data:image/png;base64," + base64.b64encode(packed.getvalue()).decode()
    drawn = kept_strokes(file.drawing, file.options, file.kept)
    element = drawn[0].element
    image = Element("image", element.children[0].attributes | {"xlink:href": href})
    many = type(drawn[0])(Element("g", element.attributes, (image,)))
    made = recolored_strokes({0: many, 1: drawn[1]}, file.drawing, RED, [0, 1, 2])
    assert list(made) == [1]


@pytest.mark.parametrize("program", ["svgo", "scour", "inkscape-plain"])
@pytest.mark.parametrize("encoding", ["none", "vector", "image"])
def test_what_another_program_saved_keeps_its_shapes(encoding, program):
    text = (GOLDEN / f"{encoding}-{program}.svg").read_text()
    made = recolored(recolored(text, RED), INK)
    assert np.abs(pixels(made) - pixels(text)).mean() < 0.5  # scour rounds the page
