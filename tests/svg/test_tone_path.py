"""Tones' path data as svgo spells them, read back to ours."""

import numpy as np
import pytest

from strokestyle.svg.tone_path import moved_tone, tone_path
from strokestyle.svg.tones import Tones, tone_shapes

LEAF = [(5, 10), (5, 12), (5, 16), (9, 21), (14, 15), (11, 8)]  # its left side goes straight down
DOT = [(8, 12), (10, 12), (9, 15)]


def ours(*polygons):
    """Path data of polygons as we write it."""
    one, shown = np.zeros(len(polygons), int), np.zeros((1, 1))
    offsets = np.cumsum([0, *map(len, polygons)])
    points = np.concatenate(polygons)
    return tone_shapes(Tones(shown, np.zeros((1, 1, 3)), points, offsets, one, one))[0][0].d


def spelled(polygon, straight=False, home=""):
    """A ring with the control point of each piece told, or as a line where that is straight."""
    control = 2 * np.array(polygon)
    end = (control + np.roll(control, -1, axis=0)) // 2
    begin = np.roll(end, 1, axis=0)
    words = ["M{} {}".format(*begin[0])]
    for a, b, c in zip(begin, control, end, strict=True):
        line = straight and np.linalg.det([b - a, c - a]) == 0
        words.append("L{} {}".format(*c) if line else "Q{} {} {} {}".format(*b, *c))
    return "".join(words) + home


TONE = ours(LEAF, DOT)


def test_ours_stays():
    assert tone_path(TONE) == tone_path("m" + TONE[1:]) == TONE


@pytest.mark.parametrize("home", ["", "z"])
@pytest.mark.parametrize("straight", [False, True])
def test_other_words_for_the_same_spline(straight, home):
    d = spelled(LEAF, straight, home) + spelled(DOT, straight, home)
    assert ("L" in d) == straight and tone_path(d) == TONE
    assert tone_path(TONE.replace("zm", "m")) == TONE


def test_a_ring_of_no_area_is_left_out():
    assert tone_path(spelled(LEAF) + "m-8 13-2 2 1-1 1-1" + spelled(DOT)) == TONE


@pytest.mark.parametrize(
    "d",
    [
        spelled(LEAF).replace("M", "M0 0L", 1),  # not closed
        spelled(LEAF).replace("Q18 42", "Q18 44"),  # no uniform spline
        spelled([(x + 0.5, y) for x, y in DOT]),
        "M0 0h9v9h-9z",
        "M0 0c1 1 2 2 3 0s2-5-3 0z",
        "M0 0h9z",
        "",
        "no path",
    ],
)
def test_what_is_no_such_spline_is_not_told_as_one(d):
    assert tone_path(d) is None


def test_a_tone_is_moved_by_steps_of_its_grid():
    there = moved_tone(TONE, (0.15, 0, 0, 0.15, 3.0, -1.5))  # .15 px a unit: 10 and -5 steps of .3
    assert there.d == ours(np.add(LEAF, (10, -5)), np.add(DOT, (10, -5)))
    turned = moved_tone(TONE, (0, 0.15, -0.15, 0, 0, 0))
    assert turned.d == ours(*(np.array([(-y, x) for x, y in ring]) for ring in (LEAF, DOT)))
    assert turned.edge[0] == pytest.approx(np.array([-9, 8]) * 0.3 + np.array([-0.9, -0.9]), abs=2)


def test_what_is_too_small_for_the_grid_is_left_out():
    assert moved_tone(TONE, (0.03, 0, 0, 0.03, 0, 0)).d.count("m") == 0
    assert moved_tone(TONE, (0.001, 0, 0, 0.001, 0, 0)) is None
    assert moved_tone("M0 0h9v9z", (0.15, 0, 0, 0.15, 0, 0)) is None
