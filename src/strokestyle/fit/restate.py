"""Find lines that were gone over: in how many passes, and how far these lie apart.

Where passes part, the ink across a line has several ridges. So has the ink of a grainy or a split
stroke; but that is no wider where it parts than where it does not, and passes are. Where they lie
on each other they cannot be told apart: how many there are, and how far they lie apart, is what
makes as many ridges, as far apart, as are seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.curves import arc_length, owner
from ..geometry.kinds import KIND_TABLE
from ..render.plan import Planned
from ..render.restating import WAVES, Restating, repeated_strokes
from .exemplar import Exemplar, stroke_mask
from .observe import PROBE_STEP, Observation, sample_image

# Set by hand on drawings in one, two and three passes of pens, pencils and markers.
ACROSS = 14.0  # px to either side of a line, within which its passes lie
ALONE, SAME_LINE = 16.0, 45.0  # px: no other line is this near; nor the same, so far along it
STEP = 0.5 * PROBE_STEP
BLUR_ALONG, BLUR_ACROSS = 3.0, 0.3  # px, Gaussian against the grain
RIDGE, PROMINENCE = 0.25, 0.15  # of the highest: a ridge is so high, and stands out so far
EDGE = 0.4  # of the highest: where the ink across a line begins
FAINT = 0.1  # opacity below which there is no line
WIDER = 1.3  # a line gone over is so many times as wide where its passes part, as a median
LEAST_PARTED = 0.06  # of the points, below which passes cannot be told from chance
LEAST_POINTS, LEAST_ALONE = 80, 0.3  # points that stand alone, and that share of all of them
LONG, LEAST_LINES, LINES_SHARE = 5, 3, 0.25  # points: lines that part for so long; of all lines

MOST_RIDGES = 5  # across a line; where there are more, it is not one
PASSES = (2, 3, 4)
SHARES = (1.0, 0.7, 0.45)  # of the lines
SPREADS = np.geomspace(0.4, 8.0, 40)  # px
DRAWS, FEWEST_DRAWS = 2000, 10  # of the passes' places; in so many of them they must part
CHANCE = 0.01  # of any number of ridges, whatever the passes do
POINTS_APART = 15  # points of which one tells something of its own
DOUBT = 1.0  # of evidence, for each pass more, and for lines that are not gone over
LAGS = (30.0, 60.0, 90.0, 120.0)  # px along lines, at which widths are compared
SETTLING = 2.0  # points, Gaussian along a pass from ridge to ridge
TOGETHER = 0.5  # how far it is known how wide passes are where they lie together
DOUBTED = 0.25  # of a trace's confidence, that is left there
SIGMAS = 8.0, 120.0  # px, within which those of the Gaussians are that passes wander by


@dataclass(frozen=True)
class Passes:
    """The strokes of a drawing in which lines are gone over.

    Parameters
    ----------
    restating : what was learned of them
    planned : strokes where the drawing has their passes, N points
    rows : (N,) of the planned strokes that they repeat
    offset : (N,) px across from these
    over : (N,) bool, what is a pass of several
    thickness : (N,) px, of passes
    confidence : (N,) in [0, 1], of passes: how far it is known where they lie
    """

    restating: Restating
    planned: Planned
    rows: np.ndarray
    offset: np.ndarray
    over: np.ndarray
    thickness: np.ndarray
    confidence: np.ndarray

    def lines(self, exemplar: Exemplar) -> Exemplar:
        """The drawing with a mask that is closed over its grain, but not between passes.

        How far that is, single lines show.
        """
        near = np.zeros(exemplar.mask.shape, bool)
        xy = self.planned.xy[self.over]
        rows, columns = (
            np.clip(np.floor(xy[:, k]), 0, near.shape[1 - k] - 1).astype(int) for k in (1, 0)
        )
        near[rows, columns] = True
        single = ndimage.distance_transform_edt(~near) > ALONE
        return replace(exemplar, mask=stroke_mask(exemplar.alpha, single))

    def doubted(self, found: Observation) -> Observation:
        """What was traced, of which little is believed where passes lie together."""
        doubt = np.where(self.over & (self.confidence < 1) & self.planned.on_curve, DOUBTED, 1.0)
        return replace(found, confidence=found.confidence * doubt)

    def observed(self, other: Observation) -> Observation:
        """What is known of the passes, and of all else what `other` (N,) knows."""
        return Observation(
            np.where(self.over, 0.0, other.offset),
            np.where(self.over, self.thickness, other.thickness),
            np.where(self.over, self.confidence, other.confidence),
        )


class _Across(NamedTuple):
    """The ink across lines: (N,) each, but for ridges.

    Parameters
    ----------
    known : bool, where a line stands alone and has ink
    ridges : (N, R) px, NaN beyond their number
    widths : (N, R) px of the ridges
    begin, end : px, of all the ink
    """

    known: np.ndarray
    ridges: np.ndarray
    widths: np.ndarray
    begin: np.ndarray
    end: np.ndarray

    @property
    def number(self) -> np.ndarray:
        return np.isfinite(self.ridges).sum(axis=1)

    @property
    def extent(self) -> np.ndarray:
        return self.end - self.begin

    @property
    def range(self) -> np.ndarray:
        """Px from the first ridge to the last, 0 where there is one."""
        steps = np.diff(self.ridges, axis=1)
        return np.nansum(steps, axis=1)


def find_passes(
    alpha: np.ndarray, planned: Planned, normals: np.ndarray, spacing: float
) -> Passes | None:
    """Find the passes of lines that are gone over.

    None where lines are drawn in one stroke, or passes cannot be told apart.

    Parameters
    ----------
    alpha : (H, W) opacity of the drawing
    planned : strokes where the drawing has them, N points
    normals : (N, 2) unit vectors across them
    spacing : px between points
    """
    if not len(planned):
        return None
    across = _look_across(alpha, planned, normals, spacing)
    hard = ~np.array([kind.soft for kind in KIND_TABLE])[planned.kind]
    group = np.zeros(len(planned), bool)
    for one in (hard, ~hard):
        if _learned(across, planned, one, spacing) is not None:
            group |= one
    restating = _learned(across, planned, group, spacing)
    if restating is None:
        return None
    return _placed(across, planned, normals, group, restating)


def _learned(
    across: _Across, planned: Planned, group: np.ndarray, spacing: float
) -> Restating | None:
    """How the lines of a group (C,) bool are gone over; None where it is not told."""
    stroke = owner(planned.offsets)
    told = across.known & group[stroke]
    parted = told & (across.number > 1)
    every = planned.on_curve & group[stroke]
    if told.sum() < max(LEAST_POINTS, LEAST_ALONE * every.sum()):
        return None
    seen, apart = (np.bincount(stroke[rows]) >= LONG for rows in (told, parted))
    if apart.sum() < max(LEAST_LINES, LINES_SHARE * seen.sum()):
        return None
    if parted.sum() < LEAST_PARTED * told.sum():
        return None
    together = told & ~parted
    if np.median(across.extent[parted]) < WIDER * np.median(across.extent[together]):
        return None
    passes, spread, share = _most_likely(across, told, parted)
    sigma = _wander(across, told, planned.offsets, spacing)
    kinds = np.unique(planned.kind[group]).astype(np.int8)
    return Restating(kinds, passes, share, spread, WAVES * sigma)


def _placed(
    across: _Across, planned: Planned, normals: np.ndarray, group: np.ndarray, restating: Restating
) -> Passes:
    """Lay the passes of the lines of a group (C,) bool where the drawing has them."""
    passes, stroke = restating.passes, owner(planned.offsets)
    parted = across.known & (across.number > 1)
    if restating.share < 1:
        group = group & (np.bincount(stroke[parted], minlength=len(planned)) > 0)
    usual = float(np.nanmedian(across.widths[parted & group[stroke]]))
    repeated, rows = repeated_strokes(planned, np.where(group, passes, 1))
    number = np.zeros(len(repeated), int)
    number[np.repeat(group, np.where(group, passes, 1))] = np.tile(
        np.arange(passes), int(group.sum())
    )
    at, width = _ridge_of(across, rows, number[owner(repeated.offsets)] / (passes - 1), usual)
    over = group[stroke[rows]]
    known = across.known[rows] & over
    offset = np.zeros(len(rows))
    for a, b in pairwise(repeated.offsets):
        seen = np.flatnonzero(known[a:b])
        if len(seen):
            offset[a:b] = np.interp(np.arange(b - a), seen, at[a:b][seen])
            offset[a:b] = ndimage.gaussian_filter1d(offset[a:b], SETTLING, mode="nearest")
    confidence = np.where(known, np.where(parted[rows], 1.0, TOGETHER), 0.0)
    moved = replace(repeated, xy=repeated.xy + offset[:, None] * normals[rows])
    return Passes(restating, moved, rows, offset, over, width, confidence)


def _ridge_of(
    across: _Across, rows: np.ndarray, place: np.ndarray, usual: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where a pass lies at points `rows` (n,), px across, and how wide it is there, px.

    `place` (n,) is 0 for the first pass and 1 for the last; `usual` px is the width of one. A pass
    between ridges lies on the nearer; where all lie together, they fill what ink there is.
    """
    count, one = across.number[rows], np.minimum(usual, across.extent[rows])
    inner = np.clip(np.rint(place * (count - 1)), 0, None).astype(int)
    take = np.arange(len(rows)), inner
    begin, end = across.begin[rows] + 0.5 * one, across.end[rows] - 0.5 * one
    together = count < 2
    at = np.where(together, begin + place * (end - begin), across.ridges[rows][take])
    return at, np.where(together, one, np.nan_to_num(across.widths[rows][take]))


def _look_across(
    alpha: np.ndarray, planned: Planned, normals: np.ndarray, spacing: float
) -> _Across:
    """Look across every point along its normal, on opacity that is not closed over the grain."""
    q = np.arange(-ACROSS, ACROSS + 0.5 * STEP, STEP)
    profile = sample_image(alpha, planned.xy[:, None] + q[None, :, None] * normals[:, None])
    for a, b in pairwise(planned.offsets):
        sigma = BLUR_ALONG / spacing, BLUR_ACROSS / STEP
        profile[a:b] = ndimage.gaussian_filter(profile[a:b], sigma, mode="nearest")
    highest = profile.max(axis=1)
    known = _alone(planned) & (highest > FAINT)
    ridges, widths = (np.full((len(profile), MOST_RIDGES), np.nan) for _ in range(2))
    begin, end = np.zeros(len(profile)), np.zeros(len(profile))
    for i in np.flatnonzero(known):
        row, top = profile[i], highest[i]
        peaks = peaks_of(row, RIDGE * top, PROMINENCE * top)
        if not 0 < len(peaks) <= MOST_RIDGES:
            known[i] = False
            continue
        ridges[i, : len(peaks)] = q[peaks]
        inside = row > EDGE * top
        valleys = [m + int(row[m:n].argmin()) for m, n in pairwise(peaks)]
        marks = pairwise([0, *valleys, len(q)])
        widths[i, : len(peaks)] = [STEP * inside[m:n].sum() for m, n in marks]
        where = np.flatnonzero(inside)
        begin[i], end[i] = q[where[0]] - 0.5 * STEP, q[where[-1]] + 0.5 * STEP
    return _Across(known, ridges, widths, begin, end)


def peaks_of(row: np.ndarray, height: float, prominence: float) -> np.ndarray:
    """Find the places in a row (N,) that are higher than what is beside them.

    Of a plateau it is the middle. A peak's prominence is its height over the higher of the two
    lowest places between it and a higher one, or the row's end, to either side. What
    scipy.signal.find_peaks finds, whose import takes as long as looking across a whole drawing.
    """
    begins = np.flatnonzero(np.diff(row, prepend=np.nan))
    ends = np.append(begins[1:], len(row)) - 1
    level = row[begins]
    inner = (level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]) & (level[1:-1] >= height)
    found = []
    for k in (np.flatnonzero(inner) + 1).tolist():
        higher = np.flatnonzero(level > level[k])
        at = np.searchsorted(higher, k)
        left = higher[at - 1] if at else 0
        right = higher[at] if at < len(higher) else len(level) - 1
        base = max(level[left : k + 1].min(), level[k : right + 1].min())
        if level[k] - base >= prominence:
            found.append((begins[k] + ends[k]) // 2)
    return np.array(found, int)


def _alone(planned: Planned) -> np.ndarray:
    """Where (N,) bool no other line comes near, nor the same one back."""
    stroke, along = owner(planned.offsets), arc_length(planned.xy, planned.offsets)
    pairs = cKDTree(planned.xy).query_pairs(ALONE, output_type="ndarray")
    a, b = pairs.T
    met = (stroke[a] != stroke[b]) | (np.abs(along[a] - along[b]) > SAME_LINE)
    alone = planned.on_curve.copy()
    alone[pairs[met].ravel()] = False
    return alone


def _most_likely(across: _Across, told: np.ndarray, parted: np.ndarray) -> tuple[int, float, float]:
    """The number of passes, their spread, px, and the share of lines, that explain the ridges.

    Passes lie about their line as normal numbers do. Told apart are those that are farther from
    each other than the nearest ridges that are seen.
    """
    seen = np.bincount(np.minimum(across.number[told], 4), minlength=5)[1:] / POINTS_APART
    least = float(np.nanpercentile(np.diff(across.ridges[parted], axis=1), 5.0))
    ranges, weight = np.log(across.range[parted]), parted.sum() / POINTS_APART
    rng = np.random.default_rng(0)
    best, found = -np.inf, (PASSES[0], 1.0, 1.0)
    for passes in PASSES:
        at = np.sort(rng.standard_normal((DRAWS, passes)), axis=1)
        steps, whole = np.diff(at, axis=1), at[:, -1] - at[:, 0]
        for spread, share in product(SPREADS, SHARES):
            ridges = 1 + (spread * steps > least).sum(axis=1)
            if (ridges > 1).sum() < FEWEST_DRAWS:
                continue
            chance = share * np.bincount(ridges, minlength=5)[1:] / DRAWS
            chance[0] += 1 - share
            drawn = np.log(spread * whole[ridges > 1])
            off = (ranges.mean() - drawn.mean()) / max(drawn.std(), ranges.std())
            evidence = (seen * np.log(chance + CHANCE)).sum() - 0.5 * weight * off**2
            evidence -= DOUBT * (passes - PASSES[0] + (share < 1))
            if evidence > best:
                best, found = evidence, (passes, float(spread), share)
    return found


def _wander(across: _Across, told: np.ndarray, offsets: np.ndarray, spacing: float) -> float:
    """The Gaussian, px, by which the passes wander, from how widths at some distance agree."""
    stroke, width = owner(offsets), across.extent
    middle = width[told].mean()
    found = []
    for lag in LAGS:
        k = round(lag / spacing)
        both = told[:-k] & told[k:] & (stroke[:-k] == stroke[k:])
        if both.sum() < LEAST_POINTS:
            continue
        here, there = width[:-k][both] - middle, width[k:][both] - middle
        size = np.sqrt((here**2).mean() * (there**2).mean())
        agreement = (here * there).mean() / max(size, 1e-9)
        # widths are about as the squares of what they come from: their correlation is its square
        agreement = np.clip(agreement, 0.01, 0.99)
        found.append(lag / np.sqrt(-2.0 * np.log(agreement)))
    return float(np.clip(np.median(found) if found else 25.0, *SIGMAS))
