"""At which corners the pen was lifted is found in drawings where it is known."""

from dataclasses import replace

import numpy as np
import pytest
from known_law import SIZE, exemplar_of

from strokestyle.drawing.strokes import Strokes
from strokestyle.extract.pipeline import view_of_lines
from strokestyle.fit.manner import learn_manner
from strokestyle.geometry.curves import KINDS, Curves, simplify
from strokestyle.render.config import StyleConfig
from strokestyle.render.plan import corners

STEP = 3.0
CONFIG = StyleConfig(size=SIZE)


def zigzag(y, turn, sides=4, length=70.0):
    """A line of straight sides, each of which turns by `turn` degrees against the last."""
    heading = np.radians(turn) * np.array([0.5, -0.5] * sides)[:sides]
    corner = np.array([30.0, y]) + np.concatenate(
        [[[0, 0]], np.cumsum(length * np.stack([np.cos(heading), np.sin(heading)], 1), axis=0)]
    )
    along = np.arange(0, sides * length + 1e-6, STEP)
    knots = length * np.arange(sides + 1)
    return np.stack([np.interp(along, knots, corner[:, k]) for k in (0, 1)], axis=1)


LINES = [
    zigzag(y, turn) for y, turn in ((10, 30), (50, 48), (95, 48), (140, 80), (210, 80), (280, 90))
]
VIEW = view_of_lines(Curves.from_list(LINES, [KINDS.index("crease")] * len(LINES)), SIZE, SIZE)


def drawing(lift_above, past=0.0, taper=False):
    """The mask of LINES by a hand that lifts the pen at corners of more than so many degrees."""
    drawn, widths = [], []
    for line in LINES:
        marks = np.r_[0, corners(line, lift_above, 4), len(line) - 1].astype(int)
        for a, b in zip(marks[:-1], marks[1:], strict=True):
            part = line[a : b + 1]
            first, last = part[0] - part[2], part[-1] - part[-3]
            ends = (
                [part[:1] + past * first / np.hypot(*first)],
                [part[-1:] + past * last / np.hypot(*last)],
            )
            part = np.concatenate([*ends[0], part, *ends[1]]) if past else part
            s = np.r_[0, np.cumsum(np.hypot(*np.diff(part, axis=0).T))]
            drawn.append(part)
            edge = np.minimum(s, s[-1] - s)
            widths.append(1.5 + 4.5 * np.clip(edge / 15, 0, 1) if taper else np.full(len(s), 4.0))
    offsets = np.r_[0, np.cumsum([len(part) for part in drawn])]
    none = np.zeros(len(drawn))
    return exemplar_of(
        Strokes(np.concatenate(drawn), np.concatenate(widths), offsets, none, none)
    ).mask


@pytest.mark.parametrize("how", [{"past": 20.0}, {"taper": True}, {"past": 14.0, "taper": True}])
@pytest.mark.parametrize("lift_above, between", [(40, (30, 48)), (65, (48, 80)), (120, (90, 181))])
def test_corners_are_drawn_through_or_not_as_the_drawing_shows(how, lift_above, between):
    found = learn_manner(VIEW, drawing(lift_above, **how), CONFIG)
    assert between[0] <= found.corner_angle <= between[1]
    assert found.cut_tolerance == 0


def test_where_the_drawing_tells_nothing_the_setting_stays():
    for lift_above in (40, 65, 120):
        even = drawing(lift_above)
        for setting in (50.0, 65.0):
            found = learn_manner(VIEW, even, replace(CONFIG, corner_angle=setting))
            assert found == replace(CONFIG, corner_angle=setting)
    blank = view_of_lines(Curves.from_list([], []), SIZE, SIZE)
    assert learn_manner(blank, even, CONFIG) == CONFIG
    assert learn_manner(VIEW, np.zeros((SIZE, SIZE)), CONFIG).cut_tolerance == 0


def test_strokes_are_planned_to_run_as_far_as_the_longest_of_the_drawing():
    found = learn_manner(VIEW, drawing(40, past=45.0), CONFIG)
    assert 45 <= found.max_overshoot <= 75


RINGS = [
    np.array(middle) + radius * np.stack([np.cos(a), np.sin(a)], axis=1)
    for middle, radius in (((110, 110), 70), ((250, 120), 60), ((120, 260), 65), ((260, 260), 75))
    for a in [np.linspace(0.3, 5.5, round(5.2 * radius / STEP))]
]
ROUND = view_of_lines(Curves.from_list(RINGS, [KINDS.index("contour")] * 4), SIZE, SIZE)


def straightened(tolerance, past):
    drawn = []
    for ring in RINGS:
        keep = ring[simplify(ring, tolerance)]
        way = np.diff(keep, axis=0) / np.hypot(*np.diff(keep, axis=0).T)[:, None]
        drawn += [
            np.array([a - past * t, b + past * t])
            for a, b, t in zip(keep[:-1], keep[1:], way, strict=True)
        ]
    if not past:
        drawn = [ring[simplify(ring, tolerance)] for ring in RINGS]
    offsets = np.r_[0, np.cumsum([len(part) for part in drawn])]
    none = np.zeros(len(drawn))
    xy = np.concatenate(drawn)
    return exemplar_of(Strokes(xy, np.full(len(xy), 3.0), offsets, none, none)).mask


@pytest.mark.parametrize("tolerance", [3.0, 6.0])
def test_curves_laid_out_in_construction_lines_are_cut_where_these_cross(tolerance):
    assert learn_manner(ROUND, straightened(tolerance, 25.0), CONFIG).cut_tolerance == tolerance


def test_a_polygon_in_one_go_and_a_curve_are_no_construction_lines():
    assert learn_manner(ROUND, straightened(6.0, 0.0), CONFIG).cut_tolerance == 0
    assert learn_manner(ROUND, straightened(0.01, 0.0), CONFIG).cut_tolerance == 0
