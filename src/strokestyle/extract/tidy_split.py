"""Split lines at corners, trim hooks, and smooth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .tidy_lines import SOFT, STEP, Lines, Numbers

STEADY = 0.75  # x corner, over twice the reach
MIN_HOOKED, MAX_HOOK = 24.0, 8.0  # px, the curve and its hook
SMOOTH_ROUNDS, SMOOTH_ROUNDS_SOFT = 6, 24  # steps of the Gaussian


def split(
    lines: Lines, corner: float, reach: int, apart: int, steady: bool, options: Numbers
) -> Lines:
    """Cut curves at corners of more than `corner` degrees within `reach` points either side.

    Corners are at least `apart` points from each other and from the ends. `steady`: not where the
    stroke turns back soon after. Closed curves without a corner start at their topmost point, the
    leftmost of them; others are cut at the corners.
    """
    if not len(lines):
        return lines
    soft = SOFT[lines.kind][lines.of]
    arm = options.in_points(soft, reach)
    turn = _turns(lines, arm)
    if steady:
        turn = np.where(_turns(lines, 2 * arm) > STEADY * corner, turn, 0.0)
    cut = _corners(lines, turn, corner, options.in_points(soft, apart))
    order = _restart_rings(lines, cut)
    cut = cut[order]
    opened = lines.closed & cut[lines.first]
    cut[lines.first] = cut[lines.last] = False
    rows = np.repeat(np.arange(len(order)), 1 + cut)  # a corner belongs to both strokes
    starts = np.flatnonzero(np.r_[True, rows[1:] == rows[:-1]] | np.isin(rows, lines.first))
    parent = lines.of[rows[starts]]
    closed = (lines.closed & ~opened)[parent]
    return lines.made_of(order[rows], np.r_[starts, len(rows)], lines.kind[parent], closed)


def _corners(lines: Lines, turn: np.ndarray, corner: float, apart: np.ndarray) -> np.ndarray:
    """Choose the points where curves turn most, (N,) bool, `apart` points from each other and ends.

    `turn` (N,) is the angle at each point, degrees; those of more than `corner` count. `apart` is
    (N,) int.
    """
    of, along = lines.of, lines.along()
    count = np.diff(lines.offsets)[of] - 1
    near_end = np.minimum(along, count - along) < apart
    turn = np.where(near_end & ~lines.closed[of], 0.0, turn)
    turn[lines.last[lines.closed]] = 0.0  # the same point as the first
    cut = np.zeros(len(lines.xy), bool)
    sharp = np.flatnonzero(turn > corner)
    # the node of each corner, or the sharpest of its points
    for i in sharp[np.lexsort((sharp, -turn[sharp], ~lines.node[sharp]))]:
        if lines.closed[of[i]]:
            around = np.arange(along[i] - apart[i] + 1, along[i] + apart[i]) % count[i]
            cut[i] = not cut[lines.first[of[i]] + around].any()
        else:
            cut[i] = not cut[max(i - apart[i] + 1, 0) : i + apart[i]].any()
    return cut


def _restart_rings(lines: Lines, cut: np.ndarray) -> np.ndarray:
    """Order the rows (N,) so that closed curves start at a corner, or else at their topmost point.

    `cut` (N,) bool tells the corners.
    """
    order = np.arange(len(lines.xy))
    for c in np.flatnonzero(lines.closed):
        rows = np.arange(lines.offsets[c], lines.offsets[c + 1] - 1)
        corners = np.flatnonzero(cut[rows])
        x, y = lines.xy[rows].T
        start = corners[0] if len(corners) else np.lexsort((x, y))[0]
        rows = np.roll(rows, -start)
        order[lines.offsets[c] : lines.offsets[c + 1]] = np.r_[rows, rows[0]]
    return order


def trim_hooks(lines: Lines, options: Numbers) -> Lines:
    """Trim the last bit of open curves where it turns by more than `corner` degrees.

    That is up to MAX_HOOK px, of curves of MIN_HOOKED px and more.
    """
    count, point = np.diff(lines.offsets), options.in_points(SOFT[lines.kind], 1)
    long = np.flatnonzero(~lines.closed & (count >= MIN_HOOKED / STEP * point))
    keep = np.ones(len(lines.xy), bool)
    for tip, inward in ((lines.first[long], 1), (lines.last[long], -1)):
        cut = _hook_lengths(lines.xy, tip, inward * point[long], options.corner)
        cut[lines.node[tip]] = 0  # it ends where others do
        for k in range(int(cut.max(initial=0))):
            keep[tip[cut > k] + inward * k] = False
    return lines if keep.all() else lines.stretches(keep)


def _hook_lengths(xy: np.ndarray, tip: np.ndarray, inward: np.ndarray, corner: float) -> np.ndarray:
    """Count the points of the hook at each tip (T,): up to its sharpest turn, 0 for no hook.

    `inward` (T,) is the step away from each tip, in rows.
    """
    sharpest, cut = np.full(len(tip), corner), np.zeros(len(tip), np.int64)
    for k in range(2, int(MAX_HOOK / STEP) + 1):
        at = tip + inward * k
        turn = _angle(xy[at] - xy[at + inward * 6], xy[tip] - xy[at])
        cut, sharpest = (
            np.where(turn > sharpest, k * np.abs(inward), cut),
            np.maximum(turn, sharpest),
        )
    return cut


def _angle(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Measure the angle between vectors (N, 2), degrees, (N,)."""
    cross, dot = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.einsum("ij,ij->i", u, v)
    return np.degrees(np.abs(np.arctan2(cross, dot)))


def _turns(lines: Lines, reach: np.ndarray) -> np.ndarray:
    """Measure the angle between the chords to `reach` points before and after each point, (N,).

    In degrees, 0 where there are no such points. `reach` is (N,) int.
    """
    of = lines.of
    first, last, at = lines.first[of], lines.last[of], np.arange(len(lines.xy))
    before, after = np.maximum(at - reach, first), np.minimum(at + reach, last)
    ring = np.flatnonzero(lines.closed[of])
    size = np.maximum(last - first, 1)[ring]
    before[ring] = first[ring] + (at[ring] - first[ring] - reach[ring]) % size
    after[ring] = first[ring] + (at[ring] - first[ring] + reach[ring]) % size
    return _angle(lines.xy - lines.xy[before], lines.xy[after] - lines.xy)


def smooth(lines: Lines, options: Numbers) -> Lines:
    """Average mesh zig-zag away along curves by a Gaussian of limited moves; ends, nodes stay."""
    if not len(lines):
        return lines
    soft = SOFT[lines.kind][lines.of]
    xy = _blurred(lines, lines.xy, ~soft & ~lines.node, SMOOTH_ROUNDS, 1)
    # a Gaussian that grows takes longer steps, and shorter ones between them
    rounds, stride = SMOOTH_ROUNDS_SOFT, options.steps
    while stride >= 1 and soft.any():
        xy = _blurred(lines, xy, soft, rounds, stride)
        rounds, stride = 2, stride // 2
    limit = np.where(soft, options.smooth_soft * options.growth, options.smooth)
    shift = xy - lines.xy
    size = np.linalg.norm(shift, axis=1)
    shift *= np.minimum(1.0, limit / np.maximum(size, 1e-9))[:, None]
    return replace(lines, xy=lines.xy + shift)


def _blurred(
    lines: Lines, xy: np.ndarray, moves: np.ndarray, rounds: int, stride: int
) -> np.ndarray:
    """Average points (N, 2) that move (N,) bool with those `stride` before and behind them.

    Nearer to the end of an open curve the stride is shorter, so that ends stay.
    """
    rows, of = np.arange(len(xy)), lines.of
    first, last = lines.first[of], lines.last[of]
    step = np.minimum(stride, np.minimum(rows - first, last - rows))
    before, after = rows - step, rows + step
    ring, size = lines.closed[of], np.maximum(last - first, 1)
    before = np.where(ring, first + (rows - first - stride) % size, before)[moves]
    after = np.where(ring, first + (rows - first + stride) % size, after)[moves]
    z, at = xy[:, 0] + 1j * xy[:, 1], np.flatnonzero(moves)  # one column: twice as fast
    for _ in range(rounds):
        z[at] = 0.5 * z[at] + 0.25 * (z[before] + z[after])
    return np.stack([z.real, z.imag], axis=1)
