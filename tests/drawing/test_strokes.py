"""The nouns refuse what they cannot be; the distance function."""

import numpy as np
import pytest
from stroke_zoo import stroke

from strokestyle.drawing.strokes import (
    Drawing,
    Strokes,
    Texture,
    round_cone_distance,
    signed_distance,
    stroke_segments,
)


def test_signed_distance_of_a_round_cone():
    # discs of radius 3 at 0 and 1 at 10: a common tangent leans by asin(2 / 10)
    xy, radius = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([3.0, 1.0])
    lean = np.arcsin(0.2)
    foot = np.array([5.0, 0.0]) + 2.0 * np.array([np.sin(lean), np.cos(lean)])
    points = np.array([[0.0, 5.0], [14.0, 0.0], foot, foot * [1, -1], [-4.0, 0.0], [0.0, 0.0]])
    expected = [np.hypot(0, 5) - 3, 3.0, 0.0, 0.0, 1.0]
    got = signed_distance(xy, radius, points)
    assert got[1:5] == pytest.approx(expected[1:], abs=1e-9)
    assert got[0] <= expected[0] and got[5] < -2.9


@pytest.mark.parametrize("turned", [False, True])
def test_a_disc_that_holds_the_next_is_all_there_is(turned):
    xy, radius = np.array([[0.0, 0.0], [0.5, 0.0]]), np.array([6.0, 1.0])
    points = np.array([[3.0, 0.0], [3.0, 1e-7], [3.0, 2.0], [-2.0, 0.0], [8.0, 0.0]])
    order = slice(None, None, -1) if turned else slice(None)
    got = signed_distance(xy[order], radius[order], points)
    assert got == pytest.approx(np.hypot(*points.T) - 6, abs=1e-9)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"xy": np.zeros((2, 3))}, "xy must have shape"),
        ({"thickness": [1.0, -1.0]}, "must not be negative"),
        ({"thickness": [1.0]}, "thickness must have shape"),
        ({"xy": [[0, np.nan], [1, 1]]}, "not finite"),
        ({"offsets": [0, 1, 2]}, "offsets"),
        ({"kind": [99]}, "kind must lie"),
    ],
)
def test_strokes_refuse_bad_arrays(change, message):
    good = {
        "xy": np.zeros((2, 2)),
        "thickness": [1.0, 1.0],
        "offsets": [0, 2],
        "kind": [0],
        "closed": [False],
    }
    with pytest.raises(ValueError, match=message):
        Strokes(**(good | change))


def test_drawing_refuses_what_does_not_belong_together():
    line = stroke([[0, 0], [9, 0]], 2)
    with pytest.raises(ValueError, match="color must have shape"):
        Drawing(line, (10, 10), np.zeros((2, 4)))
    with pytest.raises(ValueError, match="between 0 and 1"):
        Drawing(line, (10, 10), [[0, 0, 0, 2]])
    with pytest.raises(ValueError, match="strips"):
        Drawing(
            line, (10, 10), [[0, 0, 0, 1]], Texture(np.zeros((4, 3, 4), np.uint8), [0, 2, 4], 1.0)
        )
    with pytest.raises(ValueError, match="uint8"):
        Texture(np.zeros((4, 3, 4)), [0, 4], 1.0)


def test_a_texture_has_a_margin_for_each_strip():
    assert Texture(np.zeros((4, 6, 4), np.uint8), [0, 1, 4], 2.0).margin.tolist() == [2.0, 2.0]
    assert Texture(np.zeros((4, 6, 4), np.uint8), [0, 1, 4], [1.0, 3.0]).margin.tolist() == [
        1.0,
        3.0,
    ]
    for margin, message in (
        ([1.0, 2.0, 3.0], "shape"),
        ([1.0, -1.0], "got -1"),
        (np.nan, "got nan"),
    ):
        with pytest.raises(ValueError, match=message):
            Texture(np.zeros((4, 6, 4), np.uint8), [0, 1, 4], margin)


@pytest.mark.parametrize("step", [0.01, 1.0, 5.0])
def test_the_distance_to_a_stroke_is_that_to_the_nearest_of_all_its_segments(step):
    random = np.random.default_rng(int(step))
    for growth in (0.1, 2.0, 20.0):
        xy = 1e4 + np.cumsum(random.normal(0, step, (40, 2)), axis=0)
        radius = np.abs(random.normal(2, growth, 40))
        points = 1e4 + random.uniform(-30, 30, (300, 2))
        cones = stroke_segments(xy, radius, np.arange(39))
        every = round_cone_distance(points[:, None] - xy[None, :-1], *cones).min(axis=1)
        assert np.array_equal(signed_distance(xy, radius, points), every)
    assert signed_distance(xy, radius, points[:0]).shape == (0,)
