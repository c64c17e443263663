"""Find which run of ink belongs to which point of a stroke, where many lie near.

Across every point all runs of ink are looked at, not only the nearest. The runs of a stroke are
chosen together, so that they follow each other smoothly (dynamic programming: Viterbi 1967), lie
near and run as the stroke does; what two strokes choose goes to the one that would miss it more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.curves import arc_length, owner
from ..geometry.threads import each
from .observe import INK_LEVEL, PROBE_STEP, sample_image

# Costs are logarithms of probabilities, up to a constant. Set by hand; no ablation is kept.
RUNS = 4  # nearest runs of ink that are looked at across a point
WHOLE = 2.0  # times the mean thickness that is looked at beyond the reach
NOTHING = 2.0  # cost of a point that has no ink
FROM_NOTHING = 1.5  # cost of a stroke's ink to begin, or to end
ACROSS = 3.0  # cost of ink that runs at right angles to the stroke
SLOPE, STEEP = 0.3, 6.0  # px aside for a px along that cost 1/2; the cost that steps never exceed
WIDE = 2.5  # times the 90 % quantile of thickness: a wider run is a stroke seen lengthwise
SAME_INK = 0.35, 1.5  # of the thickness, and px: points of two strokes nearer than this share ink
PARALLEL = 0.8  # cosine of the angle between strokes that may be one line of ink
FAR_ALONG = 40.0  # px along a stroke, from which it may contend with itself for ink
CONTEST_SIGMA = 8.0  # points over which is averaged what decides whose ink it is
CONTESTS = 2  # rounds of giving contended ink to one stroke
LOST = 6.0  # cost of ink that another stroke would miss more


@dataclass(frozen=True)
class InkField:
    """A drawing's ink, and the way that it runs.

    Parameters
    ----------
    mask : (H, W) float, 1 = ink
    heading : (2, H, W) float, cosine and sine of twice the ink's angle, as long as it is sure
    thickness : px, of its strokes in the mean
    """

    mask: np.ndarray
    heading: np.ndarray
    thickness: float

    @classmethod
    def of(cls, mask: np.ndarray) -> InkField:
        """Measure the structure tensor of a mask (Bigun and Granlund 1987)."""
        inside = mask > INK_LEVEL
        edge = inside & ~ndimage.binary_erosion(inside)
        half = float(inside.sum()) / max(int(edge.sum()), 1)  # px of area a px of outline
        smooth = ndimage.gaussian_filter(np.asarray(mask, np.float64), 1.0)
        dy, dx = np.gradient(smooth)
        sigma = max(2.0, half)
        xx, yy, xy = each(
            lambda part: ndimage.gaussian_filter(part, sigma, truncate=3.0),
            (dx * dx, dy * dy, dx * dy),
        )
        # ink runs at right angles to its gradient
        total = np.maximum(xx + yy, 1e-9)
        return cls(mask, np.stack([(yy - xx) / total, -2 * xy / total]), 2.0 * half)


@dataclass(frozen=True)
class Runs:
    """The runs of ink across points, nearest first.

    Parameters
    ----------
    offset : (N, K) px from the point to a run's middle, along the point's normal; inf where there
        is none
    thickness : (N, K) px, of the ink across its own direction
    agreement : (N, K) in [-1, 1], 1 where the ink runs as the stroke does, -1 across it
    """

    offset: np.ndarray
    thickness: np.ndarray
    agreement: np.ndarray


@dataclass(frozen=True)
class Matches:
    """The ink of every point.

    Parameters
    ----------
    offset : (N,) px along the point's normal to the middle of its ink; nan where it has none
    thickness : (N,) px, of this ink
    agreement : (N,) in [-1, 1], how much it runs as the stroke does
    """

    offset: np.ndarray
    thickness: np.ndarray
    agreement: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """(N,) bool, where there is ink."""
        return np.isfinite(self.offset)


def runs_across(ink: InkField, xy: np.ndarray, normals: np.ndarray, reach: float) -> Runs:
    """Find the runs of ink across points (N, 2), whose middles lie within `reach` px."""
    far = reach + WHOLE * ink.thickness  # so that runs whose middle is within reach end in sight
    q = np.arange(-far, far + 0.5 * PROBE_STEP, PROBE_STEP)
    profile = sample_image(ink.mask, xy[:, None] + q[None, :, None] * normals[:, None])
    inside = np.zeros((len(xy), len(q) + 2), np.int8)
    inside[:, 1:-1] = profile > INK_LEVEL
    step = np.diff(inside, axis=1)
    row, first = np.nonzero(step > 0)
    last = np.nonzero(step < 0)[1]
    before = np.pad(np.cumsum(profile, axis=1), ((0, 0), (1, 0)))
    moment = np.pad(np.cumsum(profile * q, axis=1), ((0, 0), (1, 0)))
    a, b = np.maximum(first - 1, 0), np.minimum(last + 1, len(q))  # with the soft edges
    amount = before[row, b] - before[row, a]
    middle = (moment[row, b] - moment[row, a]) / np.maximum(amount, 1e-9)
    good = (first > 0) & (last < len(q)) & (np.abs(middle) < reach)
    row, middle, amount = row[good], middle[good], amount[good]
    order = np.lexsort((np.abs(middle), row))
    row, middle, amount = row[order], middle[order], amount[order]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    near = place < RUNS
    row, middle, amount, place = row[near], middle[near], amount[near], place[near]
    at = xy[row] + middle[:, None] * normals[row]
    agreement = _agreement(ink.heading, at, normals[row])
    # what is crossed at an angle looks wider than it is
    cosine = np.sqrt(np.clip(0.5 + 0.5 * agreement, 0.1, 1.0))
    columns = (np.inf, middle), (0.0, PROBE_STEP * amount * cosine), (0.0, agreement)
    out = []
    for empty, values in columns:
        table = np.full((len(xy), RUNS), empty)
        table[row, place] = values
        out.append(table)
    return Runs(*out)


def _agreement(heading: np.ndarray, at: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """How much ink at points (n, 2) runs as strokes of these normals do, (n,) in [-1, 1]."""
    tx, ty = normals[:, 1], -normals[:, 0]
    twice = np.stack([tx * tx - ty * ty, 2 * tx * ty])
    return (np.stack([sample_image(part, at) for part in heading]) * twice).sum(axis=0)


def match(
    ink: InkField,
    xy: np.ndarray,
    normals: np.ndarray,
    offsets: np.ndarray,
    spacing: float,
    reach: float,
    exclusive: bool = True,
) -> Matches:
    """Choose the ink of strokes' points.

    Parameters
    ----------
    ink : the drawing
    xy, normals : (N, 2) px, and unit vectors across
    offsets : (C+1,), stroke i is rows offsets[i]:offsets[i+1]
    spacing : px between points
    reach : px within which ink is looked for
    exclusive : whether ink may belong to one stroke only
    """
    runs = runs_across(ink, xy, normals, reach)
    seen = np.isfinite(runs.offset)
    if not seen.any():
        none = np.full(len(xy), np.nan)
        return Matches(none, 0 * xy[:, 0], 0 * xy[:, 0])
    limit = WIDE * np.quantile(runs.thickness[:, 0][seen[:, 0]], 0.9)
    offset = np.where(seen, runs.offset, 0.0)
    cost = 0.5 * (offset / (0.6 * reach)) ** 2 + 0.5 * ACROSS * (1.0 - runs.agreement)
    cost[~seen | (runs.thickness > limit)] = np.inf
    chosen = _chosen(cost, offset, offsets, spacing)
    for _ in range(CONTESTS if exclusive else 0):
        matches = _picked(runs, chosen)
        lost = _losers(matches, _regret(cost, chosen), xy, normals, offsets)
        if not lost.any():
            break
        cost[lost, chosen[lost]] += LOST
        chosen = _chosen(cost, offset, offsets, spacing)
    return _picked(runs, chosen)


def _picked(runs: Runs, chosen: np.ndarray) -> Matches:
    """The runs that were chosen (N,), -1 for none."""
    row, none = np.arange(len(chosen)), chosen < 0
    offset = np.where(none, np.nan, runs.offset[row, chosen])
    thickness = np.where(none, 0.0, runs.thickness[row, chosen])
    return Matches(offset, thickness, np.where(none, 0.0, runs.agreement[row, chosen]))


def _regret(cost: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """What giving up the runs that were chosen (N,) would cost, at the next best of them."""
    here = chosen >= 0
    row, column = np.flatnonzero(here), chosen[here]
    other = cost.copy()
    other[row, column] = np.inf
    out = np.zeros(len(cost))
    out[row] = np.minimum(other[row].min(axis=1), NOTHING) - cost[row, column]
    return out


def _chosen(
    cost: np.ndarray, offset: np.ndarray, offsets: np.ndarray, spacing: float
) -> np.ndarray:
    """The cheapest sequence of runs along every stroke: (N,) column of `cost` (N, K), -1 = none."""
    # all strokes in step, so that a step is one operation; the longest first, so that those that
    # go on are the first rows of a step
    stroke = owner(offsets)
    step = np.arange(len(cost)) - offsets[stroke]
    rows = np.lexsort((-np.diff(offsets)[stroke], step))
    begin = np.r_[0, np.cumsum(np.bincount(step))]
    k = cost.shape[1]
    unary = np.column_stack([cost, np.full(len(cost), NOTHING)])[rows]
    change = _changes(np.column_stack([offset, np.zeros(len(cost))])[rows], begin, spacing)
    sums = unary[: begin[1]]
    back = np.zeros(unary.shape, np.int64)
    ends = [sums.argmin(axis=1)]
    for a, b in pairwise(begin[1:]):
        through = sums[: b - a, :, None] + change[a - begin[1] : b - begin[1]]
        back[a:b] = through.argmin(axis=1)
        sums = through.min(axis=1) + unary[a:b]
        ends.append(sums.argmin(axis=1))
    best = np.concatenate(ends)  # where a stroke ends; where one goes on, what its next came from
    for before, a, b in reversed([*zip(begin, begin[1:], begin[2:], strict=False)]):
        best[before : before + b - a] = back[np.arange(a, b), best[a:b]]
    found = np.empty_like(best)
    found[rows] = best
    return np.where(found == k, -1, found)


def _changes(place: np.ndarray, begin: np.ndarray, spacing: float) -> np.ndarray:
    """What going on costs, (M, from, to), for every row but those of the first step.

    `place` (N, K + 1) px is where the runs lie, and step i is rows begin[i]:begin[i+1], of which
    each follows the row in its place of the step before.
    """
    now = np.arange(begin[1], len(place))
    before = now - np.repeat(np.diff(begin)[:-1], np.diff(begin)[1:])
    slope = (place[now, None, :] - place[before, :, None]) / (spacing * SLOPE)
    change = np.minimum(0.5 * slope**2, STEEP)
    change[:, -1, :], change[:, :, -1] = FROM_NOTHING, FROM_NOTHING
    change[:, -1, -1] = 0.0
    return change


def _losers(
    matches: Matches, regret: np.ndarray, xy: np.ndarray, normals: np.ndarray, offsets: np.ndarray
) -> np.ndarray:
    """Which points (N,) bool hold ink that another stroke's point would miss more."""
    found = np.flatnonzero(matches.found)
    lost = np.zeros(len(xy), bool)
    if not len(found):
        return lost
    at = xy[found] + matches.offset[found, None] * normals[found]
    missed = _averaged(regret, offsets)[found]
    near = SAME_INK[0] * matches.thickness[found] + SAME_INK[1]
    a, b = cKDTree(at).query_pairs(float(near.max()), output_type="ndarray").T
    stroke, along = owner(offsets)[found], arc_length(xy, offsets)[found]
    shared = np.hypot(*(at[a] - at[b]).T) < np.minimum(near[a], near[b])
    shared &= (stroke[a] != stroke[b]) | (np.abs(along[a] - along[b]) > FAR_ALONG)
    shared &= np.abs((normals[found[a]] * normals[found[b]]).sum(axis=1)) > PARALLEL
    a, b = a[shared], b[shared]
    less = (missed[a] < missed[b]) | ((missed[a] == missed[b]) & (a > b))
    lost[found[np.where(less, a, b)]] = True
    return lost


def _averaged(values: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Average values (N,) along the strokes."""
    out = np.empty_like(values)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        out[a:b] = ndimage.gaussian_filter1d(values[a:b], CONTEST_SIGMA, mode="nearest")
    return out
