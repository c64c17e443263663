"""Ink sorted into lines on curves, hatching and blots, where each is known."""

import numpy as np
import pytest
from scipy import ndimage

from strokestyle.drawing.strokes import Strokes
from strokestyle.fit.hatching import ink_directions, sort_ink
from strokestyle.fit.observe import Observation, measure_across
from strokestyle.fit.own_ink import nearest_strokes
from strokestyle.render.plan import Planned

SIZE = 256
STEP = 3.0


def even(points):
    """A polyline as points (n, 2) STEP px apart."""
    points = np.asarray(points, float)
    along = np.r_[0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    at = np.arange(0.0, along[-1], STEP)
    return np.stack([np.interp(at, along, column) for column in points.T], axis=1)


def arc_of(centre, radius, start, stop, count=60):
    angle = np.radians(np.linspace(start, stop, count))
    return np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def inked(lines, thickness=3.0):
    """Coverage (H, W) of polylines."""
    if not lines:
        return np.zeros((SIZE, SIZE))
    fine = [even(line) for line in lines]
    count = np.cumsum([0] + [len(line) for line in fine])
    xy = np.concatenate(fine)
    strokes = Strokes(
        xy, np.full(len(xy), thickness), count, np.zeros(len(fine)), np.zeros(len(fine), bool)
    )
    return np.clip(0.5 - nearest_strokes(strokes, (SIZE, SIZE)).distance, 0, 1)


def sorted_of(mask, curves):
    """`sort_ink` of a mask, with strokes on these curves."""
    fine = [even(line) for line in curves]
    offsets = np.cumsum([0] + [len(line) for line in fine])
    xy = np.concatenate(fine)
    rows = np.arange(len(xy))
    planned = Planned(
        xy, offsets, np.zeros(len(fine), np.int8), np.stack([rows, rows], axis=1), 0.0 * rows,
        0.0 * rows,
    )  # fmt: skip
    tangent = np.concatenate([np.gradient(line, axis=0) for line in fine])
    tangent /= np.hypot(*tangent.T)[:, None]
    normals = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return sort_ink(mask, planned, normals, measure_across(mask, planned, normals))


def f1(found, truth):
    both = (found & truth).sum()
    return 2 * both / (found.sum() + truth.sum())


BODY = arc_of((128, 128), 100, 0, 360, 200)
FOLD = [[60, 90], [120, 128], [190, 120]]


def slanted(x, y, dx, dy, count, gap, axis=0):
    move = np.array([gap, 0]) if axis == 0 else np.array([0, gap])
    return [np.array([[x, y], [x + dx, y + dy]]) + k * move for k in range(count)]


HATCHING = {
    "inside": slanted(90, 150, 25, -20, 9, 7.0),
    "wide apart": slanted(80, 160, 18, -24, 6, 11.0),
    "over a fold": slanted(90, 140, 25, -40, 10, 7.0),
    "touching the contour": [np.array([[128, 40 + k], [128 + 40, 20 + 1.2 * k]]) * 1.0
                             for k in np.arange(20, 80, 7)],
    "crossed": slanted(90, 170, 30, -24, 9, 7.0) + slanted(88, 146, 30, 24, 9, 7.0),
    "curved": [arc_of((70, 170), r, -70, -10) for r in range(20, 70, 7)],
    "by a trembling hand": [line + np.random.default_rng(k).normal(0, 1.2, line.shape)
                            for k, line in enumerate(slanted(90, 150, 25, -20, 9, 7.0))],
}  # fmt: skip


@pytest.mark.parametrize("name", HATCHING)
def test_hatching_is_found_and_taken_off(name):
    lines, hatched = inked([BODY, FOLD]), inked(HATCHING[name], 2.0)
    mask = np.maximum(lines, hatched)
    found = sorted_of(mask, [BODY, FOLD])
    truth = (hatched > 0.5) & ~ndimage.binary_dilation(lines > 0.25, iterations=2)
    judged = found.hatching & ~ndimage.binary_dilation(lines > 0.25, iterations=2)
    assert f1(judged, truth) > 0.9
    assert (found.lines - mask)[lines > 0.5].mean() > -0.02  # contour and fold stay whole
    assert found.lines[truth].mean() < 0.15 and not found.blots.any()


RINGS = [arc_of((60, 60 + 10 * k), 50, 10, 70) for k in range(9)]
NOT_HATCHING = {
    "parallel folds": ([BODY, *RINGS], [BODY, *RINGS]),
    "parallel folds, drawn 3 px beside": ([BODY, *RINGS], [BODY, *(r + [0, 3] for r in RINGS)]),
    "folds across": ([BODY, FOLD], [BODY, FOLD, *slanted(90, 150, 25, -20, 3, 9.0)]),
    "ruled paper": ([BODY], [BODY, *([[0, y], [SIZE, y]] for y in range(5, 250, 9))]),
    "three strokes beside each other": ([BODY], [BODY, *slanted(90, 150, 25, -20, 3, 7.0)]),
    "a star": ([BODY], [BODY, *([[128, 128], arc_of((128, 128), 40, a, a + 1, 2)[0]]
                                for a in range(0, 360, 40))]),
    "a lattice of curves": ([BODY, *slanted(80, 90, 60, 60, 6, 9.0)],
                            [BODY, *slanted(80, 90, 60, 60, 6, 9.0)]),
}  # fmt: skip


@pytest.mark.parametrize("name", NOT_HATCHING)
def test_what_is_no_hatching(name):
    curves, drawn = NOT_HATCHING[name]
    mask = inked(drawn)
    found = sorted_of(mask, curves)
    assert (mask * found.hatching).sum() < 0.01 * mask.sum()
    assert found.blots.sum() < 0.05 * mask.sum()


def test_a_broad_stump_is_no_hatching():
    """The end of a broad line goes straight on in some directions, beside itself."""
    lines = [BODY, [[128, 150], [128, 170]], [[120, 190], [136, 200]]]
    assert not sorted_of(inked(lines, 14.0), [BODY]).hatching.any()


def test_grain_and_dust_are_no_hatching():
    noise = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(SIZE, SIZE)), 1.0)
    grain = noise / noise.std()
    broad = inked([BODY, FOLD], 9.0) * (grain > -0.8)
    dust = (grain > 2.6) * ndimage.gaussian_filter(inked([BODY], 9.0), 6.0)
    found = sorted_of(np.maximum(broad, dust > 0.05), [BODY, FOLD])
    assert not found.hatching.any() and not found.blots.any()


def test_ink_far_wider_than_the_lines_is_a_blot_and_a_line_through_it_is_kept():
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    filled = (np.hypot(x - 128, y - 40) < 22).astype(float)
    found = sorted_of(np.maximum(inked([BODY, FOLD], 5.0), filled), [BODY, FOLD])
    beside = (filled > 0) & (np.abs(np.hypot(x - 128, y - 128) - 100) > 7)
    assert f1(found.blots & beside, beside) > 0.95
    assert found.lines[beside].max() == 0
    near_the_middle = np.abs(np.hypot(x - 128, y - 128) - 100) < 2
    assert found.lines[near_the_middle].min() > 0.9
    swelling = np.maximum(inked([BODY], 4.0), inked([BODY[40:90]], 9.0))
    assert not sorted_of(swelling, [BODY]).blots.any()


@pytest.mark.parametrize("angle", [0, 30, 90, 135])
def test_ink_has_the_direction_of_its_lines(angle):
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    field = ink_directions(inked([[128 - 90 * way, 128 + 90 * way]]))
    assert field.coherence[128, 128] > 0.8
    assert field.agree((np.array([128]), np.array([128])), way)[0] > 0.999


def test_a_blank_sheet_and_curves_without_ink_have_none():
    found = sorted_of(np.zeros((SIZE, SIZE)), [BODY])
    assert not (found.hatching.any() or found.blots.any() or found.lines.any())


def test_what_is_seen_beside_ink_taken_off_is_not_believed():
    hatched = HATCHING["over a fold"]
    mask = np.maximum(inked([BODY, FOLD]), inked(hatched, 2.0))
    found, xy = sorted_of(mask, [BODY, FOLD]), even(FOLD)
    seen = Observation(np.zeros(len(xy)), np.full(len(xy), 3.0), np.ones(len(xy)))
    believed = found.believed(seen, xy).confidence > 0
    crossed = (xy[:, 0] > 95) & (xy[:, 0] < 175)
    assert believed[crossed].mean() < 0.15 and believed[xy[:, 0] < 80].all()
