"""Merge lines: of lines that run side by side, the best stays.

Curves are settled from the best down, in batches: each point is asked whether it runs beside a
curve that is better, of those settled (`_Kept`) and of those of its batch. Since what loses is
never kept, and lines that are kept do not run side by side, so many points at most lie around any
other; and batches are small where lines lie dense. So time grows as the number of points, whatever
their density.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..geometry.curves import counting, take_ragged
from ..geometry.kinds import KIND_TABLE, KINDS, PRIORITY
from .tidy_lines import (
    CHORD_REACH,
    CONTOUR,
    SOFT,
    STEP,
    SUGGESTIVE,
    Lines,
    Numbers,
    chords,
    flip_short,
    loose_creases,
    short_creases,
)

ABREAST = 1.5  # px along the better curve: farther on, a point lies ahead of a tip, not beside
STRIDE = 2  # every second point answers for the next
MIN_HARD = 8.0  # px; shorter hard lines do not compete by their kind
FAR_ANGLE, SAME_FORM_ANGLE = 0.4, 0.7  # x merge_angle, beyond merge_soft px
MAX_HOLE, MAX_NICK, MIN_REMAIN = 3.0, 4.0, 6.0  # px; shorter gaps, cuts and remains are undone
MERGE_ROUNDS = 32
# Where a line comes up to a better one: how far it may go on beside it, px, where it ends there,
# and where it does not; nearer than so many px the two touch; and where it ends there, x merge that
# they are apart on the way, on average
MAX_REACH, MAX_PASSING, TOUCH, WEDGE = 30, 12, 0.75, 0.2

CELL = 4.0  # px, of the grids in which points are sought
CHUNK = 1 << 18  # pairs of points that are looked at in one go
# A batch has about so many pairs of points at most: for each point, and besides
BATCH_PAIRS, BATCH_FLOOR = 64, 1 << 21
ROW = 1 << 31  # cells in a row of a grid
SORT = 1 << 61  # cells of one sort of points in a grid

_WEIGHT = np.array([kind.weight for kind in KIND_TABLE])
_RANK = np.array([PRIORITY.index(name) for name in KINDS])


def merge(lines: Lines, options: Numbers) -> Lines:
    """Take away the parts that run beside a better curve."""
    if len(lines) < 2:
        return lines
    crease = short_creases(lines, options)
    soft = SOFT[lines.kind] | crease
    grows = SOFT[lines.kind] | loose_creases(lines, options, crease)
    order = np.argsort(_ranks(lines, soft))
    rows, _ = take_ragged(lines.offsets, order)
    gone = np.empty(len(rows), bool)
    gone[rows] = _settle(_Contest.of(lines.take(order), soft[order], grows[order], options))
    return lines.stretches(~gone)


def _ranks(lines: Lines, soft: np.ndarray) -> np.ndarray:
    """Rank the curves (C,), the best 0: long hard ones by kind, short hard ones, then soft ones."""
    length = lines.length
    score = length * np.where(soft, lines.mean_strength(), 1.0) * _WEIGHT[lines.kind]
    group = np.where(length >= MIN_HARD, _RANK[lines.kind], len(KINDS))
    group = np.where(soft, len(KINDS) + 1, group)
    rank = np.empty(len(lines), np.int64)
    rank[np.lexsort((np.arange(len(lines)), -score, group))] = np.arange(len(lines))
    return rank


@dataclass(frozen=True)
class _Contest:
    """Curves in the order of their rank, and what decides between two.

    Parameters
    ----------
    lines : C curves of N points
    options : the numbers
    asks, as_better : (C,) int, what each is as the worse of two and as the better: row and column
        of `reach`
    reach : (4, 3) px, how near the better of two goes to the worse: to one that is hard,
        suggestive, soft of another kind, or a short crease that holds; contours, suggestive
        contours, others
    grows : (C,) bool, whose lengths grow: those of soft lines and loose creases
    direction, broad : (N, 2), unit vectors, over as many points as suit hard and soft lines
    answering : (N,) int, the row that answers for each
    """

    lines: Lines
    options: Numbers
    asks: np.ndarray
    as_better: np.ndarray
    reach: np.ndarray
    grows: np.ndarray
    direction: np.ndarray
    broad: np.ndarray
    answering: np.ndarray

    @classmethod
    def of(cls, lines: Lines, soft: np.ndarray, grows: np.ndarray, options: Numbers) -> _Contest:
        """Prepare ranked curves, of which some compete as soft ones, (C,) bool."""
        suggestive = lines.kind == SUGGESTIVE
        asks = np.where(soft, np.where(suggestive, 1, np.where(grows, 2, 3)), 0)
        as_better = np.where(lines.kind == CONTOUR, 0, np.where(suggestive, 1, 2))
        same_form = max(options.merge_soft, options.merge_suggestive)
        reach = np.array(
            [
                [options.merge] * 3,
                [options.merge_contour, options.merge_soft, same_form],
                [options.merge_contour, same_form, options.merge_soft],
                [options.merge_contour, same_form, options.merge_soft],
            ]
        )
        reach[1:3] *= options.growth
        direction = chords(lines)
        broad = direction if options.steps == 1 else chords(lines, CHORD_REACH * options.steps)
        stride = options.in_points(grows, STRIDE)[lines.of]
        answering = np.arange(len(lines.xy)) - lines.along() % stride
        return cls(lines, options, asks, as_better, reach, grows, direction, broad, answering)

    @property
    def shown(self) -> np.ndarray:
        """Tell which points stand for their curves as the better ones, (N,) bool."""
        return self.lines.along() % STRIDE == 0

    def beside(self, better: np.ndarray, worse: np.ndarray) -> np.ndarray:
        """Tell of which pairs of rows (P,) the worse curve's runs beside the better one's."""
        options, lines = self.options, self.lines
        asks, other = self.asks[lines.of[worse]], self.as_better[lines.of[better]]
        grows, between = self.grows[lines.of[worse]], lines.xy[better] - lines.xy[worse]
        unit = np.where(grows, options.growth, 1.0)
        here, there = (self._directions(rows, grows) for rows in (better, worse))
        distance = np.hypot(between[:, 0], between[:, 1])
        same_form = (other > 0) & (((asks == 1) & (other == 2)) | ((asks > 1) & (other == 1)))
        narrow = np.where(same_form, SAME_FORM_ANGLE, FAR_ANGLE)
        angle = np.where(distance > options.merge_soft * unit, narrow, 1.0) * options.merge_angle
        return (
            (distance <= self.reach[asks, other])
            & (np.abs(_row_dot(between, here)) < ABREAST * STEP * unit)
            & (np.abs(_row_dot(here, there)) > np.cos(np.radians(angle)))
        )

    def _directions(self, rows: np.ndarray, grows: np.ndarray) -> np.ndarray:
        """Take directions at rows (P,), the broad ones where lengths grow, (P,) bool; (P, 2)."""
        if self.broad is self.direction:
            return self.direction[rows]
        return np.where(grows[:, None], self.broad[rows], self.direction[rows])


def _row_dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]


class _Grid:
    """Points in square cells, of three sorts, sorted by sort and cell."""

    def __init__(self, xy: np.ndarray, rows: np.ndarray, sort: np.ndarray) -> None:
        key = _cells(xy[rows]) @ [1, ROW] + SORT * sort[rows]
        order = np.argsort(key, kind="stable")
        self.rows, self.key = rows[order], key[order]

    def near(self, xy: np.ndarray, rows: np.ndarray, reach: np.ndarray) -> Iterator[np.ndarray]:
        """Pair points of the grid with others: rows (2, P) of one and of the other, some at a time.

        All within `reach` (3,) px, one of each sort, are among them, and others.
        """
        if not (len(self.rows) and len(rows)):
            return
        cell, of = np.unique(_cells(xy[rows]) @ [1, ROW], return_inverse=True)
        left, width = _cell_rows(np.ceil(reach / CELL).astype(np.int64))
        left = left[:, None] + cell  # ascending, which are found faster
        start = np.searchsorted(self.key, left)
        count = np.searchsorted(self.key, left + width[:, None], "right") - start
        total = np.cumsum(count.sum(axis=0)[of])
        cuts = np.unique(np.searchsorted(total, np.arange(CHUNK, total[-1], CHUNK)))
        for some in map(slice, (0, *cuts), (*cuts, len(rows))):
            first, many = start[:, of[some]].ravel(), count[:, of[some]].ravel()
            found = np.repeat(first, many) + counting(many)
            asked = np.repeat(np.tile(rows[some], len(left)), many)
            yield np.stack([self.rows[found], asked])


def _cell_rows(beyond: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the rows of cells around a cell, as far `beyond` it as (3,) of each sort says, (R,).

    Each is told by what its first cell's key in a `_Grid` is more than that of the cell, and how
    much more that of its last is.
    """
    sort = np.repeat(np.arange(len(beyond)), 2 * beyond + 1)
    across = counting(2 * beyond + 1) - beyond[sort]
    return SORT * sort + ROW * across - beyond[sort], 2 * beyond[sort]


def _in_one(pairs: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
    """Put pairs (2, P) one after the other, up to about CHUNK in one."""
    held: list[np.ndarray] = []
    for some in pairs:
        held.append(some)
        if sum(one.shape[1] for one in held) >= CHUNK:
            yield np.concatenate(held, axis=1)
            held = []
    if held:
        yield np.concatenate(held, axis=1)


def _cells(xy: np.ndarray) -> np.ndarray:
    """Find the cells of points (N, 2), (N, 2) int."""
    return np.clip(np.floor(xy / CELL), -ROW / 4, ROW / 4).astype(np.int64)


class _Kept:
    """Points of curves that are settled, in grids, where their sort is what they are as better.

    Each grid holds at least twice as many points as the next, so that few are made and few asked.
    """

    def __init__(self, contest: _Contest) -> None:
        self.contest = contest
        self.xy = np.ascontiguousarray(contest.lines.xy.T)
        self.sort = contest.as_better[contest.lines.of]
        self.grids: list[_Grid] = []

    def add(self, rows: np.ndarray) -> None:
        """Keep rows of the contest, and let them beat what is worse from now on."""
        while self.grids and len(self.grids[-1].rows) < 2 * len(rows):
            rows = np.concatenate([self.grids.pop().rows, rows])
        if len(rows):
            self.grids.append(_Grid(self.contest.lines.xy, rows, self.sort))

    def beside(
        self, rows: np.ndarray, gone: np.ndarray | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Pair rows of kept and of asked points: the first better, and the second beside it.

        Points that are `gone` (N,) by the time that they would be asked again are not.
        """
        contest = self.contest
        asks, before = contest.asks[contest.lines.of], contest.lines.first[contest.lines.of]
        limit = contest.reach**2 * (1.0 + 1e-9)
        x, y = self.xy
        for grid in self.grids:
            asked = rows if gone is None else rows[~gone[rows]]
            for better, worse in _in_one(self._near(grid, asked)):
                ahead = better < before[worse]  # rows are in the order of their curves' ranks
                better, worse = better[ahead], worse[ahead]
                apart = np.square(x[better] - x[worse]) + np.square(y[better] - y[worse])
                near = apart <= limit[asks[worse], self.sort[better]]
                better, worse = better[near], worse[near]
                beside = contest.beside(better, worse)
                yield better[beside], worse[beside]

    def _near(self, grid: _Grid, rows: np.ndarray) -> Iterator[np.ndarray]:
        """Pair points of a grid with others that ask, as `_Grid.near` does."""
        asks = self.contest.asks[self.contest.lines.of[rows]]
        for who, reach in enumerate(self.contest.reach):
            yield from grid.near(self.contest.lines.xy, rows[asks == who], reach)

    def gap(self, rows: np.ndarray) -> np.ndarray:
        """Measure how far points (M,) are from better curves, (M,) px; inf beyond `merge` px."""
        contest, lines = self.contest, self.contest.lines
        reach = contest.options.merge
        gap = np.full(len(lines.xy), np.inf)
        for grid in self.grids:
            for better, worse in grid.near(lines.xy, rows, np.full(3, reach + STEP)):
                good = lines.of[better] < lines.of[worse]
                better, worse = better[good], worse[good]
                for side in (-1, 1):
                    other = np.clip(better + side, lines.first[lines.of[better]], None)
                    other = np.minimum(other, lines.last[lines.of[better]])
                    away = _to_segment(lines.xy[worse], lines.xy[better], lines.xy[other])
                    np.minimum.at(gap, worse, away)
        gap = gap[rows]
        return np.where(gap <= reach, gap, np.inf)


def _to_segment(xy: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Measure how far points (P, 2) are from segments a to b (P, 2), (P,)."""
    along, off = b - a, xy - a
    t = _row_dot(off, along) / np.maximum(_row_dot(along, along), 1e-12)
    off = off - np.clip(t, 0.0, 1.0)[:, None] * along
    return np.hypot(off[:, 0], off[:, 1])


def _settle(contest: _Contest) -> np.ndarray:
    """Tell which points go, (N,) bool."""
    lines, kept = contest.lines, _Kept(contest)
    answers = contest.answering == np.arange(len(lines.xy))
    shown = contest.shown
    gone = np.zeros(len(lines.xy), bool)
    first, most = 0, len(lines)
    while first < len(lines):
        last = min(first + most, len(lines))
        rows = lines.offsets[first] + np.flatnonzero(
            (answers & ~gone)[lines.offsets[first] : lines.offsets[last]]
        )
        for _, worse in kept.beside(rows, gone):
            gone[worse] = True
        last = _batch(contest, first, last, rows[~gone[rows]])
        batch = slice(lines.offsets[first], lines.offsets[last])
        gone[batch] = _beaten(contest, first, last, gone[batch], shown[batch])
        kept.add(batch.start + np.flatnonzero(shown[batch] & ~gone[batch]))
        first, most = last, 2 * (last - first)
    gone[_reaching(kept, gone)] = False
    return gone


def _batch(contest: _Contest, first: int, last: int, rows: np.ndarray) -> int:
    """Choose where a batch of curves ends that begins at curve `first`, at `last` the latest.

    `rows` are the points that may beat or be beaten. Where many lie close together, few curves go
    in.
    """
    lines = contest.lines
    of, soft = lines.of[rows], contest.asks[lines.of[rows]] > 0
    reach = (float(contest.reach[0].max()), float(contest.reach.max()))
    small, large = (
        np.unique(_cells(lines.xy[rows] / max(side / CELL, 1.0)) @ [1, ROW], return_inverse=True)[1]
        for side in reach
    )
    while last - first > 1:
        count = int(np.searchsorted(of, last))
        hard, every = (np.bincount(cell[:count], minlength=1) for cell in (small, large))
        asking = np.bincount(large[:count], soft[:count], len(every))
        if 9 * (hard @ hard + asking @ every) <= BATCH_FLOOR + BATCH_PAIRS * count:
            break
        last = first + (last - first) // 2
    return last


def _beaten(
    contest: _Contest, first: int, last: int, gone: np.ndarray, shown: np.ndarray
) -> np.ndarray:
    """Settle a batch of curves: which of its points go, (n,), where some are `gone` (n,) already.

    A part that is gone removes nothing itself, so that who loses depends on who lost before. Each
    round settles the curves one rank further down, and few curves compete in a row.
    """
    lines, start = contest.lines, contest.lines.offsets[first]
    offsets = lines.offsets[first : last + 1] - start
    answering = contest.answering[start : start + len(gone)] - start
    answers = answering == np.arange(len(gone))
    rivals = _Kept(contest)
    point = contest.options.in_points(contest.grows[first:last], 1) / STEP
    for_good = gone[answering]
    for_good &= flip_short(for_good, offsets, True, MAX_NICK * point)
    rivals.add(start + np.flatnonzero(shown & ~for_good))
    asked = start + np.flatnonzero(answers & ~gone)
    pairs = [np.stack(pair) for pair in rivals.beside(asked)]
    better, worse = np.concatenate([np.zeros((2, 0), np.int64), *pairs], axis=1) - start
    before = np.ones(len(gone), bool)
    given = gone
    for _ in range(MERGE_ROUNDS):
        gone = given.copy()
        gone[worse[~before[better]]] = True
        gone = gone[answering]
        for value, shorter in ((False, MAX_HOLE), (True, MAX_NICK), (False, MIN_REMAIN)):
            gone = flip_short(gone, offsets, value, shorter * point)
        if np.array_equal(gone, before):
            break
        before = gone
    return gone


def _reaching(kept: _Kept, gone: np.ndarray) -> np.ndarray:
    """Find the rows (R,) that are `gone` (N,), and by which hard curves reach what is better.

    A curve that comes up to a better one at a small angle would end MERGE px short of it. It goes
    on until the two touch, or where it ends there, until its end: that is where edges of a solid
    meet, and where one goes out of sight behind the other.
    """
    contest, lines = kept.contest, kept.contest.lines
    here, stop = np.arange(len(gone)), len(gone) - 1
    hard = contest.asks[lines.of] == 0
    back = []
    for step in (-1, 1):
        ahead = np.clip(here + step, 0, stop)
        leaves = hard & ~gone & gone[ahead] & (lines.of[ahead] == lines.of)
        way = here[leaves][:, None] + step * np.arange(1, MAX_REACH + 2)
        inside = (way >= 0) & (way <= stop)
        way = np.clip(way, 0, stop)
        inside &= lines.of[way] == lines.of[leaves][:, None]
        beside = np.logical_and.accumulate(inside & gone[way], axis=1)
        gap = np.full(len(gone), np.inf)
        rows = np.unique(way[beside])
        gap[rows] = kept.gap(rows)
        ends_there = lines.node[way] & beside
        back.append(way[_on_the_way(gap[way], beside, inside, ends_there, contest.options.merge)])
    return np.unique(np.concatenate(back))


def _on_the_way(
    gap: np.ndarray, beside: np.ndarray, inside: np.ndarray, node: np.ndarray, merge: float
) -> np.ndarray:
    """Tell which points on the way to a better curve stay, (B, n) bool.

    Parameters
    ----------
    gap : (B, n) px from each point to the better curve
    beside : (B, n) bool, those that go: the first of each row
    inside : (B, n) bool, those that are points of the curve at all
    node : (B, n) bool, those at which lines end on each other
    """
    rows, count = np.arange(len(gap)), beside.sum(axis=1)
    at_end = (count < gap.shape[1]) & ~inside[rows, np.minimum(count, gap.shape[1] - 1)]
    mean = np.where(beside, np.minimum(gap, merge), 0.0).sum(axis=1) / np.maximum(count, 1)
    closes = (
        at_end & node[rows, count - 1] & (gap[rows, count - 1] <= TOUCH) & (mean >= WEDGE * merge)
    )
    touching = (beside & (gap <= TOUCH))[:, :MAX_PASSING]
    until = np.where(touching.any(axis=1), touching.argmax(axis=1) + 1, 0)
    until = np.where(closes, count, until)
    return np.arange(gap.shape[1]) < until[:, None]
