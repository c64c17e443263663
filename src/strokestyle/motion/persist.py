"""Decide when each part of each line is drawn: as long as there is reason to, without flicker.

What a style draws of a frame taken by itself depends on thresholds, and near those a line comes and
goes from frame to frame. Seen over time, a part of a line has a sequence of reasons to be drawn or
not: strokes were planned for it, or the line is there but no stroke was made of it, or not even
that. What is drawn is the sequence of states that goes against the least of those, where a change
of state costs as much as CHANGE frames, and little where it cannot be seen (a two-state Markov
chain, solved by Viterbi's algorithm for each piece of PIECE px of a line).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import counting, runs
from .sheets import BARE, PLANNED, TRACED, Points

PIECE = 6.0  # px of a line that are decided on together
REASON = {PLANNED: 1.0, TRACED: -0.6, BARE: -1.0}  # in frames, to draw it
COVERED = -1.3  # where a stroke of another line runs
CHANGE, UNSEEN_CHANGE = 6.0, 0.8  # frames
ABSENT, HIDDEN, SHOWN = 0, 1, 2
BLUR = np.array([1.0, 2.0, 3.0, 2.0, 1.0])  # of reasons, over pieces
CELLS = 4_000_000  # pieces times frames that are decided on at once: bounds memory


@dataclass(frozen=True)
class Fate:
    """What becomes of the points of one frame, (P,) bool each.

    Parameters
    ----------
    drawn : it is drawn
    appears : it was not drawn in the frame before, though one saw that part of the surface then
    vanishes : it is not drawn in the next frame, though one sees that part of the surface there
    """

    drawn: np.ndarray
    appears: np.ndarray
    vanishes: np.ndarray


def decide(frames: list[Points], cuts: set[int] | None = None) -> list[Fate]:
    """Decide what is drawn of all frames' points; nothing grows or tapers off over `cuts`.

    Those are the frames at which another scene begins.
    """
    sheets, pieces = _pieces(frames)
    fates = [Fate(*np.zeros((3, len(points)), bool)) for points in frames]
    size = max(1, CELLS // max(len(frames), 1))
    for group in _groups(pieces, size):
        rows = [np.flatnonzero(np.isin(points.sheet, sheets[group])) for points in frames]
        some = [points.take(row) for points, row in zip(frames, rows, strict=True)]
        for fate, row, now in zip(fates, rows, _decide_some(some), strict=True):
            for name in ("drawn", "appears", "vanishes"):
                getattr(fate, name)[row] = getattr(now, name)
    for t in cuts or ():
        fates[t].appears[:] = False
        if t:
            fates[t - 1].vanishes[:] = False
    return fates


def _groups(pieces: np.ndarray, size: int) -> list[np.ndarray]:
    """Part sheets of some `pieces` (S,) each into groups of about `size` pieces."""
    if not len(pieces):
        return []
    group = np.cumsum(pieces) // size
    start = runs(group)
    return [np.arange(a, b) for a, b in zip(start[:-1], start[1:], strict=True)]


def _pieces(frames: list[Points]) -> tuple[np.ndarray, np.ndarray]:
    """Count the pieces of all sheets: their names (S,), ascending, and pieces (S,)."""
    grid = _Grid.of(frames)
    return grid.sheets, grid.count


@dataclass(frozen=True)
class _Grid:
    """Pieces of sheets, numbered one sheet after the other with room between them.

    Parameters
    ----------
    sheets : (S,) int, ascending
    low : (S,), where they begin
    size : (S,), how much of their coordinate is PIECE px
    first : (S,) int, the number of the first piece of each
    count : (S,) int
    """

    sheets: np.ndarray
    low: np.ndarray
    size: np.ndarray
    first: np.ndarray
    count: np.ndarray

    @classmethod
    def of(cls, frames: list[Points]) -> _Grid:
        sheet = np.concatenate([points.sheet for points in frames])
        along = np.concatenate([points.along for points in frames])
        order = np.argsort(sheet, kind="stable")
        start = runs(sheet[order])[:-1] if len(sheet) else np.zeros(0, np.int64)
        sheets, sorted_along = sheet[order][start], along[order]
        low = np.minimum.reduceat(sorted_along, start) if len(start) else np.zeros(0)
        high = np.maximum.reduceat(sorted_along, start) if len(start) else np.zeros(0)
        size = PIECE * _rise(frames, sheets)
        count = np.floor((high - low) / size).astype(np.int64) + 1 + len(BLUR)
        return cls(sheets, low, size, np.cumsum(count) - count + len(BLUR) // 2, count)

    def number(self, points: Points) -> np.ndarray:
        """Number the pieces that points lie in, (P,)."""
        at = np.searchsorted(self.sheets, points.sheet)
        return self.first[at] + ((points.along - self.low[at]) / self.size[at]).astype(np.int64)


def _rise(frames: list[Points], sheets: np.ndarray) -> np.ndarray:
    """Measure by how much the coordinate of each sheet rises a px, on average, (S,)."""
    rise, length = np.zeros((2, len(sheets)))
    for points in frames:
        follows = np.flatnonzero(points.follows)
        at = np.searchsorted(sheets, points.sheet[follows])
        step = np.hypot(*(points.xy[follows] - points.xy[follows - 1]).T)
        rise += np.bincount(at, points.along[follows] - points.along[follows - 1], len(sheets))
        length += np.bincount(at, step, len(sheets))
    return np.clip(rise / np.maximum(length, 1e-9), 0.02, 50.0)


def _decide_some(frames: list[Points]) -> list[Fate]:
    """Decide what is drawn of the points of some sheets."""
    grid = _Grid.of(frames)
    number = [grid.number(points) for points in frames]
    total = int(grid.count.sum())
    reason = np.zeros((len(frames), total), np.float32)
    state = np.full((len(frames), total), ABSENT, np.int8)
    for t, points in enumerate(frames):
        _fill(points, number[t], reason[t], state[t])
    drawn = _viterbi(_blurred(reason, state), state)
    drawn = _whole(drawn, state)
    return [_fate(points, number[t], drawn, state, t) for t, points in enumerate(frames)]


def _fill(points: Points, number: np.ndarray, reason: np.ndarray, state: np.ndarray) -> None:
    """Enter one frame's points, and what lies between those that follow each other."""
    if not len(points):
        return
    why = np.choose(points.support, [REASON[BARE], REASON[TRACED], REASON[PLANNED]])
    why = np.where(points.covered, np.minimum(why, COVERED), why)
    why = np.where(points.seen, why, 0.0)
    after = np.minimum(np.arange(len(points)) + 1, len(points) - 1)
    last = np.where(np.r_[points.follows[1:], False], number[after], number)
    span = np.maximum(last - number, 0) + 1
    cell = np.repeat(number, span) + counting(span)
    status = np.where(points.seen, SHOWN, HIDDEN)
    np.maximum.at(state, cell, np.repeat(status, span).astype(np.int8))
    reason[cell] = -9.0
    np.maximum.at(reason, cell, np.repeat(why, span).astype(np.float32))


def _blurred(reason: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Average reasons over neighbouring pieces that are shown."""
    shown = (state == SHOWN).astype(np.float32)
    total, weight = np.zeros_like(reason), np.zeros_like(reason)
    reach = len(BLUR) // 2
    for k, w in enumerate(BLUR):
        shift = k - reach
        total += w * np.roll(reason * shown, shift, axis=1)
        weight += w * np.roll(shown, shift, axis=1)
    return np.where(shown > 0, total / np.maximum(weight, 1e-9), 0.0)


def _viterbi(reason: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Find the states (T, B) bool of least cost; what is drawn against a reason costs as much."""
    shown = state == SHOWN
    off, on = np.maximum(reason, 0.0), np.maximum(-reason, 0.0)
    from_on = np.zeros((2, *reason.shape), bool)  # whether off, on is reached from on
    least_off, least_on = off[0].copy(), on[0].copy()
    for t in range(1, len(reason)):
        change = np.where(shown[t] & shown[t - 1], CHANGE, UNSEEN_CHANGE)
        from_on[0, t] = least_on + change < least_off
        from_on[1, t] = least_on <= least_off + change
        least_off, least_on = (
            np.minimum(least_off, least_on + change) + off[t],
            np.minimum(least_on, least_off + change) + on[t],
        )
    out = np.zeros(reason.shape, bool)
    if len(reason):
        out[-1] = least_on < least_off
    for t in range(len(reason) - 1, 0, -1):
        out[t - 1] = np.where(out[t], from_on[1, t], from_on[0, t])
    return out & shown


def _whole(drawn: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Close holes of one or two pieces in what is drawn, where the line is shown."""
    left = drawn.copy()
    for k in (1, 2):
        near = np.roll(drawn, 1, axis=1) & np.roll(drawn, -k, axis=1)
        for j in range(k):
            left |= np.roll(near, j, axis=1)
    return left & (state == SHOWN)


def _fate(points: Points, number: np.ndarray, drawn: np.ndarray, state: np.ndarray, t: int) -> Fate:
    """Tell what becomes of the points of frame t."""
    count = len(drawn)
    here = drawn[t, number] & points.seen
    before, after = t - 1, t + 1
    appears = vanishes = np.zeros(len(points), bool)
    if before >= 0:
        was = state[before, number]
        hidden = (was == HIDDEN) | ((was == ABSENT) & ~points.new)
        appears = here & ~drawn[before, number] & ~hidden
    if after < count:
        vanishes = here & ~drawn[after, number] & (state[after, number] != HIDDEN)
    return Fate(here, appears, vanishes)
