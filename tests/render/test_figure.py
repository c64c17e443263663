"""The steps of a figure: each adds one thing to the one before."""

import io
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from small_drawings import drawing

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.extract.camera import Camera
from strokestyle.extract.feature_maps import FeatureMaps
from strokestyle.extract.view import View
from strokestyle.geometry.curves import Curves
from strokestyle.render.figure import STEP_NAMES, figure_files, figure_steps


def view_of(drawn):
    """A view whose curves are the drawing's centre lines, moved 3 px to the right."""
    width, height = drawn.size
    camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 30.0, width, height)
    s = drawn.strokes
    maps = FeatureMaps(
        (), np.zeros((0, height, width), np.float32), np.zeros((height, width), bool)
    )
    return View(camera, Curves(s.xy + [3.0, 0.0], s.offsets, s.kind, s.closed), maps)


def pixels(png):
    return 255.0 - np.asarray(Image.open(io.BytesIO(png)).convert("L"), float)


@pytest.mark.parametrize("texture", [None, "grain"])
def test_each_step_adds_one_thing(texture):
    drawn = drawing(12, texture)
    made = figure_steps(
        view_of(drawn), drawn, title="a & b", page_size="A4", plotter=True
    )  # neither fits a figure
    assert [step.name for step in made] == list(STEP_NAMES)
    for step in made:
        assert "a &amp; b" in step.svg
        ET.fromstring(step.svg)
    assert len({step.svg for step in made}) == 4
    files = figure_files(made, 2.0)
    curves, displaced, strokes, textured = (pixels(files[f"{name}.png"]) for name in STEP_NAMES)
    assert curves.shape == (240, 320)
    inner = np.s_[10:-10, 10:-10]
    assert (
        np.abs(np.roll(curves, -6, axis=1) - displaced)[inner].mean() < 1
    )  # 3 px at twice the size
    assert (strokes > 40).sum() > 1.5 * (displaced > 40).sum()
    if texture is None:
        assert np.abs(strokes - textured).max() == 0
    else:
        assert "data-ss-margin" in made[3].svg and "data-ss-margin" not in made[2].svg
        assert np.abs(strokes - textured).mean() > 5
    sheet = pixels(files["sheet.png"])
    assert sheet.shape == (240, 4 * 320 + 3 * 6)
    assert np.array_equal(sheet[:, :320], curves) and np.array_equal(sheet[:, -320:], textured)


def test_no_strokes_make_four_empty_steps():
    drawn = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (160, 120), np.zeros((0, 4)))
    made = figure_steps(view_of(drawn), drawn, background="#ffeedd")
    assert all("#ffeedd" in step.svg for step in made)
    assert len(figure_files(made)) == 9


def test_a_drawing_of_another_size_is_refused():
    drawn = drawing(2)
    with pytest.raises(ValueError, match="160 x 120 px, its drawing 80 x 60"):
        figure_steps(view_of(drawn), replace(drawn, size=(80, 60)))
