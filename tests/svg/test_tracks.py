"""What a stroke is called in all frames of an animation, through files, edits and cuts."""

from dataclasses import replace

import numpy as np
import pytest

from strokestyle.drawing.edit import cut_at_parts, keep, recolor, simplify, thicken
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.geometry.parts import Parts
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.write import write_svg

TRACKS = ("12", "7-2.1", "", "x")


def a_drawing(track=TRACKS):
    x = np.linspace(10.0, 90.0, 9)
    xy = np.concatenate([np.stack([x, np.full(9, 20.0 + 15 * k)], axis=1) for k in range(4)])
    kind, closed = np.array([0, 0, 2, 1]), np.zeros(4, bool)
    strokes = Strokes(xy, np.full(36, 4.0), np.arange(0, 37, 9), kind, closed)
    return Drawing(strokes, (100, 100), np.tile([0.2, 0.2, 0.2, 1.0], (4, 1)), track=track)


def by_track(drawing):
    """Where the stroke of each track begins."""
    begins = drawing.strokes.xy[drawing.strokes.offsets[:-1]]
    return {name: tuple(at) for name, at in zip(drawing.track, begins.tolist(), strict=True)}


def test_a_file_keeps_the_tracks_and_ids_follow_from_them():
    drawing = a_drawing()
    text = write_svg(drawing)
    found = read_svg_file(text)
    assert by_track(found.drawing) == by_track(drawing)
    ids = dict(zip(found.drawing.track, found.ids, strict=True))
    assert ids == {"12": "s012", "7-2.1": "s007-2.1", "": ids[""], "x": "sx"}
    assert write_svg(found.drawing, found.options, ids=found.ids, kept=found.kept) == text
    assert text.count("data-ss-track") == 3


def test_a_drawing_of_no_animation_has_none():
    assert read_svg(write_svg(a_drawing(None))).track is None
    assert "data-ss-track" not in write_svg(a_drawing(None))
    bad = write_svg(a_drawing()).replace('data-ss-track="12"', 'data-ss-track="a b"')
    assert "a b" not in by_track(read_svg(bad))


def test_edits_keep_it_where_a_stroke_stays_that_stroke():
    drawing = a_drawing()
    for edited in (thicken(drawing, 2), simplify(drawing, 2), recolor(drawing, (1, 0, 0))):
        assert edited.track == TRACKS
    assert keep(drawing, np.array([3, 0])).track == ("x", "12")
    assert keep(drawing, np.array([False, True, True, False])).track == ("7-2.1", "")


def test_pieces_of_a_stroke_have_names_of_their_own():
    drawing = a_drawing()
    half = np.repeat(np.tile([0, 1], 4), [5, 4] * 4)
    pieces = Parts(("a", "b"), half).cut(drawing.strokes.offsets, np.arange(36) * 10.0)
    track = cut_at_parts(drawing, pieces).track
    assert track == ("12", "12.1", "7-2.1", "7-2.1.1", "", "", "x", "x.1")


def test_as_many_are_named_as_there_are_strokes():
    with pytest.raises(ValueError, match="Drawing.track must name the track of 4 strokes, not 1"):
        replace(a_drawing(), track=("1",))
