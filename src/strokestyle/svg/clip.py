"""Regions that clip paths leave, and lines cut at their outlines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .. import files as limits
from ..geometry.curves import counting
from ..geometry.polygons import following, winding_number

NEAR = 0.02  # px beyond an outline, where a line still lies on it
ROUNDING = 1e-9  # of a piece of a line or an outline, beyond its ends, where it still crosses
MAX_PAIRS = (
    100_000_000  # of a piece of a line, or a point, and a piece of an outline that are as high
)
AT_ONCE = 4_000_000  # of these pairs

Spend = Callable[[int], None]  # told how many pairs will be looked at; may refuse


@dataclass(frozen=True)
class Region:
    """What lies in one shape of a clip path at least, and in another region.

    Parameters
    ----------
    shapes : of the clip path
    within : the region that the clip path itself is clipped to; None: all
    """

    shapes: tuple[ClipShape, ...]
    within: Region | None = None

    def holds(self, points: np.ndarray, spend: Spend) -> np.ndarray:
        """Tell which of the points (n, 2) lie in it, (n,) bool."""
        inside = np.zeros(len(points), bool)
        for shape in self.shapes:
            inside |= shape.holds(points, spend)
        return inside if self.within is None else inside & self.within.holds(points, spend)

    def outlines(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Closed polygons (m, 2), and their offsets, that all its outline is on."""
        for shape in self.shapes:
            yield shape.rings, shape.offsets
            if shape.within is not None:
                yield from shape.within.outlines()
        if self.within is not None:
            yield from self.within.outlines()


@dataclass(frozen=True)
class ClipShape:
    """A shape of a clip path.

    Parameters
    ----------
    rings, offsets : closed polygons, (m, 2) px and (R+1,)
    odd : it is filled by the rule evenodd rather than nonzero
    within : the region that it is clipped to itself; None: all
    """

    rings: np.ndarray
    offsets: np.ndarray
    odd: bool = False
    within: Region | None = None

    def holds(self, points: np.ndarray, spend: Spend) -> np.ndarray:
        """Tell which of the points (n, 2) lie in it, (n,) bool."""
        spend(len(self.rings))
        turns = winding_number(self.rings, points, self.offsets, spend)
        inside = turns % 2 != 0 if self.odd else turns != 0
        return inside if self.within is None else inside & self.within.holds(points, spend)


def cut_lines(
    xy: np.ndarray, offsets: np.ndarray, regions: Sequence[tuple[Region, ...]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut lines to regions. What lies on an outline stays.

    Parameters
    ----------
    xy, offsets : polylines, (n, 2) px and (C+1,)
    regions : of each line, those in all of which it is seen

    Returns
    -------
    The pieces that are left, likewise, and the line (P,) that each is of. A line of which all is
    left is as it was; a closed one is cut where it leaves a region, not where it begins.

    Raises
    ------
    ValueError
        where that takes too long, or too many pieces are left.
    """
    lines = np.split(xy, offsets[1:-1]) if len(regions) else []
    left: list[list[np.ndarray]] = [[line] for line in lines]
    groups: dict[tuple[int, ...], list[int]] = {}
    for i, each in enumerate(regions):
        if each:
            groups.setdefault(tuple(map(id, each)), []).append(i)
    spend = _budget()
    for members in groups.values():
        pieces = _cut([lines[i] for i in members], regions[members[0]], spend)
        for i, own in zip(members, pieces, strict=True):
            left[i] = own
    made = [piece for own in left for piece in own]
    if len(made) > limits.MAX_CURVES or sum(map(len, made)) > limits.MAX_POINTS:
        raise ValueError(
            f"more than {limits.MAX_POINTS} points or {limits.MAX_CURVES} curves, once cut at clip "
            "paths: simplify the drawing first"
        )
    whose = np.repeat(np.arange(len(left)), [len(own) for own in left])
    points = np.concatenate([np.zeros((0, 2)), *made])
    return points, np.cumsum([0, *map(len, made)]), whose


def _budget() -> Spend:
    left = MAX_PAIRS

    def spend(pairs: int) -> None:
        nonlocal left
        left -= pairs
        if left < 0:
            raise ValueError("its clip paths are too intricate: simplify the drawing first")

    return spend


def _cut(
    lines: list[np.ndarray], regions: Sequence[Region], spend: Spend
) -> list[list[np.ndarray]]:
    """Cut lines [(n, 2), ...] to the same regions: the pieces of each."""
    xy, offsets = np.concatenate(lines), np.cumsum([0, *map(len, lines)])
    begins = np.delete(np.arange(len(xy)), offsets[1:] - 1)  # of pieces of lines
    piece, share = _crossings(xy[begins], xy[begins + 1], _edges(regions), spend)
    at = begins[piece] + share  # places: rows, and shares of the way to the next
    at = np.unique(np.r_[at, offsets[:-1], offsets[1:] - 1])
    ahead = np.searchsorted(at, offsets[:-1])
    behind = np.searchsorted(at, offsets[1:] - 1, "right")
    runs = [at[a:b] for a, b in zip(ahead, behind, strict=True)]
    first, last = (np.concatenate([run[k : len(run) - 1 + k] for run in runs]) for k in (0, 1))
    shown = _are_shown(xy, first, last, regions, spend)
    made, done = [], 0
    for line, run, begin in zip(lines, runs, offsets, strict=False):
        made.append(_pieces(line, run - begin, shown[done : done + len(run) - 1]))
        done += len(run) - 1
    return made


def _edges(regions: Sequence[Region]) -> tuple[np.ndarray, np.ndarray]:
    """Where the pieces of the regions' outlines begin and end, (E, 2) each."""
    rings = [outline for region in regions for outline in region.outlines()]
    begin = np.concatenate([np.zeros((0, 2)), *(points for points, _ in rings)])
    end = [points[following(len(points), offsets)] for points, offsets in rings]
    return begin, np.concatenate([np.zeros((0, 2)), *end])


def _crossings(
    begin: np.ndarray, end: np.ndarray, edges: tuple[np.ndarray, np.ndarray], spend: Spend
) -> tuple[np.ndarray, np.ndarray]:
    """Find where pieces of lines cross edges: which piece (K,), and how far along (K,) in [0, 1].

    Those that lie along each other do not cross.
    """
    low, high = np.minimum(begin[:, 1], end[:, 1]), np.maximum(begin[:, 1], end[:, 1])
    edge_low, edge_high = (pick(*(e[:, 1] for e in edges)) for pick in (np.minimum, np.maximum))
    # pieces of about the same height at a time: of those, the ones that reach an edge's height
    # begin but little above it
    sort = np.frexp(np.maximum(high - low, 1e-3))[1]
    found: list[tuple[np.ndarray, np.ndarray]] = []
    spend(len(edges[0]))
    for each in np.unique(sort):
        mine = np.flatnonzero(sort == each)
        mine = mine[np.argsort(low[mine], kind="stable")]
        tallest = (high - low)[mine].max()
        first = np.searchsorted(low[mine], edge_low - tallest - NEAR)
        count = np.searchsorted(low[mine], edge_high + NEAR, "right") - first
        spend(int(count.sum()))
        for a, b in _spans(count):
            edge = np.repeat(np.arange(a, b), count[a:b])
            piece = mine[np.repeat(first[a:b], count[a:b]) + counting(count[a:b])]
            found.append(_meeting(begin, end, piece, edges, edge))
    pieces, shares = zip(*found, strict=True) if found else ((), ())
    none = np.zeros(0, np.int64)
    return np.concatenate([none, *pieces]), np.concatenate([np.zeros(0), *shares])


def _spans(count: np.ndarray) -> Iterator[tuple[int, int]]:
    """Cut rows into spans with counts of about AT_ONCE in all."""
    total = np.cumsum(count) // AT_ONCE
    ends = np.flatnonzero(np.diff(total)) + 1
    yield from zip([0, *ends.tolist()], [*ends.tolist(), len(count)], strict=True)


def _meeting(
    begin: np.ndarray,
    end: np.ndarray,
    piece: np.ndarray,
    edges: tuple[np.ndarray, np.ndarray],
    edge: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Of pairs of a piece and an edge, those that cross, and how far along the piece."""
    p, a = begin[piece], edges[0][edge]
    d, e = end[piece] - p, edges[1][edge] - a
    turn, away = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0], a - p
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (away[:, 0] * e[:, 1] - away[:, 1] * e[:, 0]) / turn
        across = (away[:, 0] * d[:, 1] - away[:, 1] * d[:, 0]) / turn
    low, high = -ROUNDING, 1.0 + ROUNDING
    meets = (along >= low) & (along <= high) & (across >= low) & (across <= high)
    return piece[meets], np.clip(along[meets], 0.0, 1.0)


def _are_shown(
    xy: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    regions: Sequence[Region],
    spend: Spend,
) -> np.ndarray:
    """Tell which parts of lines, from place to place (K,) each, lie in all regions.

    No outline crosses such a part. What lies on one is in.
    """
    # a step in their middle tells: their ends are on an outline
    row = np.minimum(np.floor(0.5 * (first + last)).astype(np.int64), len(xy) - 2)
    begin, end = np.maximum(first - row, 0.0), np.minimum(last - row, 1.0)
    step = xy[row + 1] - xy[row]
    middle = xy[row] + (0.5 * (begin + end))[:, None] * step
    long = np.maximum(np.hypot(*step.T), 1e-12)
    side = NEAR * np.stack([-step[:, 1], step[:, 0]], axis=1) / long[:, None]
    shown = np.ones(len(first), bool)
    for region in regions:
        shown &= region.holds(middle + side, spend) | region.holds(middle - side, spend)
    return shown


def _pieces(line: np.ndarray, at: np.ndarray, shown: np.ndarray) -> list[np.ndarray]:
    """The parts of a line (n, 2) that are shown, those that follow each other as one.

    `at` : (k+1,) places where the parts begin and end; `shown` (k,)
    """
    if shown.all():
        return [line]
    begins = np.flatnonzero(shown & ~np.r_[False, shown[:-1]])
    ends = np.flatnonzero(shown & ~np.r_[shown[1:], False]) + 1
    pieces = [_part(line, at[a], at[b]) for a, b in zip(begins, ends, strict=True)]
    closed = (line[0] == line[-1]).all()
    if closed and len(pieces) > 1 and shown[0] and shown[-1]:
        pieces = [np.concatenate([pieces[-1], pieces[0][1:]]), *pieces[1:-1]]
    return [piece for piece in pieces if np.ptp(piece, axis=0).max() > 2 * NEAR]


def _part(line: np.ndarray, begin: float, end: float) -> np.ndarray:
    """A line (n, 2) from one place to another: rows, and shares of the way to the next."""
    between = np.arange(np.floor(begin) + 1, np.ceil(end))
    rows = np.r_[begin, between, end]
    low = np.minimum(rows.astype(np.int64), len(line) - 2)
    share = (rows - low)[:, None]
    return (1.0 - share) * line[low] + share * line[low + 1]
