"""Lines that were gone over are found, with how many passes and how far apart they are."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import find_peaks
from scipy.spatial import cKDTree

from strokestyle.fit.exemplar import separate
from strokestyle.fit.restate import find_passes, peaks_of
from strokestyle.geometry.curves import KINDS, Curves
from strokestyle.render.displacement import across_strokes
from strokestyle.render.plan import plan_strokes
from strokestyle.render.restating import Restating, repeated_strokes

STEP, SIZE, WIDTH = 3.0, 480, 2.6
CONTOUR, VALLEY = KINDS.index("contour"), KINDS.index("valley")


def waves(kind=CONTOUR, count=8):
    """Slow waves across the sheet, far from each other."""
    x = np.linspace(30, SIZE - 30, 400)
    lines = [np.stack([x, 40 + 56 * i + 9 * np.sin(x / 45 + i)], axis=1) for i in range(count)]
    return plan_strokes(Curves.from_list(lines, [kind] * count), STEP, 0.0, 180.0, 0.0)


def drawn(strokes, xy, width=WIDTH):
    """The opacity of strokes through xy (N, 2), one pixel soft."""
    fine = [
        np.stack([np.interp(np.linspace(0, b - a - 1, 12 * (b - a)), np.arange(b - a), xy[a:b, k])
                  for k in (0, 1)], axis=1)
        for a, b in pairwise(strokes.offsets)
    ]  # fmt: skip
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    away, _ = cKDTree(np.concatenate(fine)).query(
        np.stack([x.ravel(), y.ravel()], axis=1), distance_upper_bound=width
    )
    return np.clip(0.5 + 0.5 * width - away, 0, 1).reshape(SIZE, SIZE)


def gone_over(passes, spread, wavelength, seed=0, planned=None):
    """Lines gone over: as planned, their opacity, and where the passes went."""
    planned = planned or waves()
    rng = np.random.default_rng(seed)
    law = Restating(np.array([CONTOUR, VALLEY], np.int8), passes, 1.0, spread, wavelength)
    strokes, over = law.repeat(planned, rng)
    off = law.deviation(strokes, over, STEP, rng)
    return planned, drawn(strokes, strokes.xy + off), off


def find(planned, alpha):
    normals = across_strokes(planned.xy, planned.offsets, STEP)
    return find_passes(alpha, planned, normals, STEP)


@pytest.mark.parametrize(
    "passes, spread, seed", [(2, 2.0, 0), (2, 3.2, 1), (3, 2.5, 2), (3, 3.5, 3)]
)
def test_the_passes_and_their_spread_are_found(passes, spread, seed):
    planned, alpha, off = gone_over(passes, spread, 120.0, seed)
    found = find(planned, alpha).restating
    each = off[:, 1].reshape(len(planned), passes, -1)  # lines run along x: across is nearly y
    spread = np.sqrt(each.var(axis=1, ddof=1).mean())
    assert found.passes == passes and found.share == 1.0
    assert found.spread == pytest.approx(spread, rel=0.25)
    assert 50 < found.wavelength < 300


def test_passes_are_laid_where_they_were_drawn():
    planned, alpha, off = gone_over(2, 3.0, 120.0)
    found = find(planned, alpha)
    drawn_at = np.sort(off[:, 1].reshape(len(planned), 2, -1), axis=1).ravel()
    _, rows = repeated_strokes(planned, np.full(len(planned), 2))
    laid_at = (found.planned.xy - planned.xy[rows])[:, 1]
    sure = found.confidence == 1
    assert sure.mean() > 0.3
    assert np.median(np.abs(laid_at - drawn_at)[sure]) < 0.4
    assert np.median(found.thickness[sure]) == pytest.approx(WIDTH, abs=0.6)


def test_one_pass_is_one_however_it_wanders():
    planned = waves()
    law = Restating(np.array([CONTOUR], np.int8), 2, 1.0, 2.5, 90.0)
    off = law.deviation(planned, np.ones(len(planned), bool), STEP, np.random.default_rng(4))
    assert find(planned, drawn(planned, planned.xy + off)) is None


def test_a_stroke_that_splits_is_not_gone_over():
    """The bristles of a dry brush part within its width."""
    planned = waves()
    broad, hole = drawn(planned, planned.xy, 9.0), drawn(planned, planned.xy, 2.5)
    whole = np.sin((np.arange(SIZE) + 0.5) / 17.0) < 0
    assert find(planned, np.clip(broad - np.where(whole, 0.0, hole), 0, 1)) is None


def test_one_line_with_another_beside_it_is_no_habit():
    planned, alpha, _ = gone_over(2, 3.0, 120.0)
    single = drawn(planned, planned.xy)
    single[:110] = alpha[:110]  # the first two lines are doubled
    assert find(planned, single) is None


def test_ink_of_lines_that_crowd_tells_nothing():
    """Of thirteen lines three stand alone: what they do may be what other lines do."""
    planned, alpha, _ = gone_over(2, 3.0, 120.0)
    assert find(planned, alpha) is not None
    lines = [planned.xy[a:b] for a, b in pairwise(planned.offsets)]
    lines += [line + [0, 12] for line in lines[3:]]
    crowded = plan_strokes(Curves.from_list(lines, [CONTOUR] * 13), STEP, 0.0, 180.0, 0.0)
    assert find(crowded, alpha) is None


def test_outlines_are_gone_over_and_what_is_within_is_not():
    planned, alpha, _ = gone_over(2, 3.0, 120.0)
    kind = planned.kind.copy()
    kind[4:] = VALLEY
    half = 40 + 56 * 4 - 28
    alpha[half:] = drawn(planned, planned.xy)[half:]
    object.__setattr__(planned, "kind", kind)
    found = find(planned, alpha)
    assert found.restating.kinds.tolist() == [CONTOUR]
    assert np.bincount(found.planned.kind, minlength=6)[[CONTOUR, VALLEY]].tolist() == [8, 4]


def test_what_tells_nothing_is_taken_for_one_pass():
    planned = waves(count=1)
    assert find(planned, np.zeros((SIZE, SIZE))) is None
    empty = plan_strokes(Curves.from_list([], []), STEP)
    assert find_passes(np.zeros((9, 9)), empty, np.zeros((0, 2)), STEP) is None


def test_gaps_between_passes_are_not_closed_as_grain_is():
    planned, alpha, _ = gone_over(3, 3.0, 60.0, 5)
    found = find(planned, alpha)
    grainy = alpha * (np.random.default_rng(0).random(alpha.shape) < 0.7)
    scan = np.dstack([1 - grainy] * 3 + [np.ones_like(alpha)])
    exemplar = separate(scan)
    opened = found.lines(exemplar).mask
    assert opened.sum() < 1.1 * alpha.sum() < 0.95 * exemplar.mask.sum()


def test_peaks_are_those_of_scipy():
    rng = np.random.default_rng(0)
    for _ in range(300):  # few levels: plateaus, and peaks of one height
        row = rng.integers(0, 6, rng.integers(1, 30)).astype(float)
        height, prominence = rng.integers(0, 5), rng.integers(0, 4)
        found, _ = find_peaks(row, height=height, prominence=prominence)
        assert peaks_of(row, height, prominence).tolist() == found.tolist()
