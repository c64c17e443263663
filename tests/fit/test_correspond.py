"""Whose ink is whose, where lines are near, cross, or were not drawn."""

import numpy as np
import pytest
from known_law import level

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.fit.correspond import RUNS, InkField, match, runs_across

WIDTH, HEIGHT = 300, 160


def ink_of(*lines, thickness=4.0):
    offsets = np.r_[0, np.cumsum([len(line) for line in lines])]
    flags = np.zeros(len(lines), bool)
    strokes = Strokes(np.concatenate(lines), np.full(offsets[-1], thickness), offsets, flags, flags)
    drawing = Drawing(strokes, (WIDTH, HEIGHT), np.tile([0.0, 0, 0, 1], (len(lines), 1)))
    return InkField.of(rasterise(drawing)[..., 3].astype(np.float64) / 255)


def steep(x, first=20, last=140):
    return level(x, first, last)[:, ::-1]


def matched(ink, *lines, reach=20.0, exclusive=True):
    offsets = np.r_[0, np.cumsum([len(line) for line in lines])]
    xy = np.concatenate(lines)
    normals = np.concatenate([np.tile(_normal(line), (len(line), 1)) for line in lines])
    found = match(ink, xy, normals, offsets, 3.0, reach, exclusive)
    return [found.offset[a:b] for a, b in zip(offsets[:-1], offsets[1:], strict=True)], found


def _normal(line):
    t = (line[-1] - line[0]) / np.hypot(*(line[-1] - line[0]))
    return [-t[1], t[0]]


def test_runs_are_found_nearest_first_with_their_middle_thickness_and_direction():
    ink = ink_of(level(60), level(72), level(40), steep(150), thickness=5.0)
    at = np.array([[90.0, 58.0], [148.0, 100.0]])
    runs = runs_across(ink, at, np.array([[0.0, 1.0], [1.0, 0.0]]), 20.0)
    assert runs.offset[0, :3] == pytest.approx([2.0, 14.0, -18.0], abs=0.1)
    assert np.isinf(runs.offset[0, 3:]).all() and runs.offset.shape == (2, RUNS)
    assert runs.thickness[0, :3] == pytest.approx(5.0, abs=0.4)
    assert runs.agreement[0, :3].min() > 0.9
    # the steep line runs as a stroke whose normal is level does
    assert runs.offset[1, 0] == pytest.approx(2.0, abs=0.1) and runs.agreement[1, 0] > 0.9


@pytest.mark.parametrize("angle", [0, 30, 60, 90, 120, 150])
def test_ink_runs_the_way_it_was_drawn(angle):
    t = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    line = np.array([150.0, 80.0]) + np.linspace(-60, 60, 41)[:, None] * t
    ink = ink_of(line)
    own = runs_across(ink, line[15:25], np.tile([-t[1], t[0]], (10, 1)), 10.0)
    assert own.agreement[:, 0].min() > 0.95
    cross = runs_across(ink, line[15:25], np.tile([-t[0], -t[1]], (10, 1)), 100.0)
    assert cross.agreement[np.isfinite(cross.offset)].max(initial=-1.0) < -0.9


def test_a_line_that_crosses_is_not_taken():
    ink = ink_of(level(70), steep(150))
    (offset,), _ = matched(ink, level(64))
    assert np.isfinite(offset).mean() > 0.97
    assert offset[np.isfinite(offset)] == pytest.approx(6.0, abs=0.8)
    (offset,), _ = matched(ink_of(steep(150)), level(64))
    assert np.isfinite(offset).mean() < 0.06


def test_hatching_is_not_taken_for_a_line():
    t = np.linspace(-8, 8, 9)[:, None] * [np.cos(1.0), np.sin(1.0)]
    (offset,), _ = matched(ink_of(*(t + [x, 64.0] for x in range(30, 270, 12))), level(64))
    assert np.isfinite(offset).mean() < 0.3


def test_a_stroke_keeps_to_its_line_though_another_comes_near():
    """The nearest run changes in the middle: a slanted line comes between."""
    x = np.arange(20, 280, 3.0)
    slanted = np.stack([x, 62 + 0.12 * (x - 150)], axis=1)
    ink = ink_of(level(71), slanted, thickness=3.0)
    (offset,), _ = matched(ink, level(64))
    # one of the two, and not both in turn
    step = np.abs(np.diff(offset[np.isfinite(offset)]))
    assert step.max() < 2.5  # where the two are one run, its middle lies between


def test_of_two_strokes_one_has_the_ink_and_the_better_one():
    ink = ink_of(level(60))
    (near, far), found = matched(ink, level(63), level(50))
    assert np.isfinite(near).mean() > 0.97 and not np.isfinite(far).any()
    assert near[5:-5] == pytest.approx(-3.0, abs=0.1)
    assert found.thickness[found.found].mean() == pytest.approx(4.0, abs=0.4)
    (_, far), _ = matched(ink, level(63), level(50), exclusive=False)
    assert np.isfinite(far).mean() > 0.9


def test_two_strokes_take_a_line_each_though_one_is_nearest_to_both():
    (upper, lower), _ = matched(ink_of(level(66), level(76)), level(58), level(64))
    assert np.isfinite(upper).mean() > 0.9 and np.isfinite(lower).mean() > 0.9
    assert np.nanmedian(upper) == pytest.approx(8.0, abs=0.2)
    assert np.nanmedian(lower) == pytest.approx(12.0, abs=0.2)


def test_where_the_ink_ends_the_match_ends():
    (offset,), found = matched(ink_of(level(60, 80, 200)), level(63))
    x = level(63)[:, 0]
    assert np.isfinite(offset[(x > 84) & (x < 194)]).all()
    assert not np.isfinite(offset[(x < 76) | (x > 204)]).any()
    assert found.found.sum() == np.isfinite(offset).sum()


@pytest.mark.parametrize("mask", [np.zeros((HEIGHT, WIDTH)), np.ones((HEIGHT, WIDTH))])
def test_no_ink_and_nothing_but_ink_match_nothing(mask):
    (offset,), found = matched(InkField.of(mask), level(60))
    assert not np.isfinite(offset).any() and not found.thickness.any()
