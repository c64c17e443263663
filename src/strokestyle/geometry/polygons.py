"""Closed polygons: how often they go round a point, and where fields on grids reach a level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .curves import counting

if TYPE_CHECKING:
    from manifold3d import CrossSection

SPECK = 0.01  # square px that nobody sees


def winding_number(
    rings: np.ndarray,
    points: np.ndarray,
    offsets: np.ndarray | None = None,
    spend: Callable[[int], None] = lambda pairs: None,
) -> np.ndarray:
    """Count how often closed polygons go round each of some points, (M,) int.

    Parameters
    ----------
    rings : (n, 2)
    points : (M, 2)
    offsets : (R+1,) int, polygon i is rows offsets[i]:offsets[i+1] of `rings`; None: all are of one
    spend : told beforehand how many pairs of an edge and a point will be looked at, and may refuse
    """
    offsets = np.array([0, len(rings)]) if offsets is None else offsets
    (ax, ay), (bx, by) = rings.T, rings[following(len(rings), offsets)].T
    order = np.argsort(points[:, 1], kind="stable")
    x, y = points[order].T
    # an edge is crossed by points as high as its lower end, but not its upper
    first = np.searchsorted(y, np.minimum(ay, by))
    count = np.searchsorted(y, np.maximum(ay, by)) - first
    spend(int(count.sum()))
    crossed = np.flatnonzero(count)
    first, count = first[crossed], count[crossed]
    dx, dy = (bx - ax)[crossed], (by - ay)[crossed]
    at = counting(count) + np.repeat(first, count)
    # where a point's level meets the edge: round a point that lies to the left, the edge turns
    height = y[at] - np.repeat(ay[crossed], count)
    meets = np.repeat(ax[crossed], count) + height * np.repeat(dx / dy, count)
    turn = np.where(x[at] < meets, np.repeat(np.sign(dy), count), 0.0)
    winding = np.empty(len(points), np.int64)
    winding[order] = np.rint(np.bincount(at, turn, len(points))).astype(np.int64)
    return winding


def following(rows: int, offsets: np.ndarray) -> np.ndarray:
    """Find the row (n,) that follows each row of closed polygons: the first follows the last."""
    after, some = np.arange(1, rows + 1), np.flatnonzero(np.diff(offsets))
    after[offsets[1:][some] - 1] = offsets[:-1][some]
    return after


def united(rings: list[np.ndarray], speck: float = SPECK) -> list[np.ndarray] | None:
    """Unite what closed polygons fill by the nonzero rule, where they cross or overlap.

    By Clipper2 (Vatti 1992, "A generic solution to polygon clipping"), on a grid of 1e-8.

    Parameters
    ----------
    rings : polygons (n, 2), that together turn the way of their outer edges
    speck : of area, in square units

    Returns
    -------
    None where they overlap by less than a speck; else polygons that do not, and fill the same by
    any rule: outer edges turn as they did, holes the other way, the largest first. Smaller holes
    and islands are left out.
    """
    union = _union(rings)
    if _is_same(union, rings):
        return None
    around = _areas_of(rings).sum()
    if abs(union.area() - abs(around)) < speck:
        return None
    made = union.to_polygons()
    size = np.abs(_areas_of(made))
    turn = 1 if around > 0 else -1
    return [made[k][::turn] for k in np.argsort(-size, kind="stable") if size[k] > speck]


def overlap(rings: list[np.ndarray]) -> float | None:
    """Measure the area by which closed polygons (n, 2) overlap; None where none cross or touch."""
    union = _union(rings)
    if _is_same(union, rings):
        return None
    return float(abs(abs(_areas_of(rings).sum()) - union.area()))


def _union(rings: list[np.ndarray]) -> CrossSection:
    from manifold3d import CrossSection, FillRule

    return CrossSection(rings, FillRule.NonZero)


def _is_same(union: CrossSection, rings: list[np.ndarray]) -> bool:
    return union.num_contour() == len(rings) and union.num_vert() == sum(map(len, rings))


def _areas_of(rings: list[np.ndarray]) -> np.ndarray:
    return areas(np.concatenate([np.zeros((0, 2)), *rings]), np.cumsum([0, *map(len, rings)]))


def areas(xy: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Measure closed polygons: their areas (R,), above 0 where they turn from x to y.

    Polygon i is rows offsets[i]:offsets[i+1] of `xy` (M, 2).
    """
    (x, y), some = xy.T, np.flatnonzero(np.diff(offsets))
    after_x, after_y = np.roll(x, -1), np.roll(y, -1)
    first, last = offsets[:-1][some], offsets[1:][some] - 1
    after_x[last], after_y[last] = x[first], y[first]
    cross = np.r_[0.0, np.cumsum(x * after_y - y * after_x)]
    return 0.5 * np.diff(cross[offsets])


LEFT, TOP, RIGHT, BOTTOM = range(4)  # sides of a cell


def _cases() -> np.ndarray:
    """Make the table of marching squares.

    (18, 4): by which side a walk with the inside on its left comes into a cell and leaves it,
    twice; -1: not at all. The case is the sum of 1, 2, 4, 8 for the corners inside, clockwise from
    the top left; 16 and 17 are the cases 5 and 10, opposite corners, where the middle joins what
    case 5 and 10 keep apart.
    """
    table = np.full((18, 4), -1)
    single = {1: (LEFT, TOP), 2: (TOP, RIGHT), 4: (RIGHT, BOTTOM), 8: (BOTTOM, LEFT)}
    single |= {15 - case: (leave, enter) for case, (enter, leave) in single.items()}
    single |= {3: (LEFT, RIGHT), 6: (TOP, BOTTOM), 12: (RIGHT, LEFT), 9: (BOTTOM, TOP)}
    for case, sides in single.items():
        table[case, :2] = sides
    table[5], table[10] = (*single[1], *single[4]), (*single[2], *single[8])
    table[16], table[17] = (*single[13], *single[7]), (*single[14], *single[11])
    return table


CASES = _cases()


@dataclass(frozen=True)
class _Grids:
    """Fields on grids of one width, stacked; see `isolines`.

    The edges of all cells are numbered: first those along a row, from (row, column) to
    (row, column + 1), then those along a column.
    """

    field: np.ndarray
    offsets: np.ndarray
    wraps: np.ndarray
    level: np.ndarray

    def cells(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find the cells that the level passes through: row (n,), column (n,), and case (n,)."""
        level = self.by_row(self.level).astype(self.field.dtype)
        above = (self.field > level[:, None]).view(np.uint8)
        case = above[:-1, :-1] + 2 * above[:-1, 1:] + 4 * above[1:, 1:] + 8 * above[1:, :-1]
        case[self.offsets[1:-1] - 1] = 0  # between two grids
        cell = np.flatnonzero((case > 0) & (case < 15))
        row, column = np.divmod(cell, self.field.shape[1] - 1)
        return row, column, self._resolve(row, column, case.reshape(-1)[cell].astype(np.int64))

    def by_row(self, values: np.ndarray) -> np.ndarray:
        """Values (C,) of the grids, for each row (H,)."""
        return np.repeat(values, np.diff(self.offsets))

    def _resolve(self, row: np.ndarray, column: np.ndarray, case: np.ndarray) -> np.ndarray:
        """Join opposite corners where the middle of their cell lies above the level."""
        saddle = np.flatnonzero((case == 5) | (case == 10))
        r, c, field = row[saddle], column[saddle], self.field
        middle = 0.25 * (field[r, c] + field[r, c + 1] + field[r + 1, c] + field[r + 1, c + 1])
        joined = saddle[middle > self.by_row(self.level)[r]]
        case[joined] = np.where(case[joined] == 5, 16, 17)
        return case

    def walks(self) -> tuple[np.ndarray, np.ndarray]:
        """Find the edges (M,) by which lines come into cells, and those by which they leave."""
        row, column, case = self.cells()
        twice = np.flatnonzero(CASES[case, 2] >= 0)
        enter, leave = (
            np.r_[
                self.edges(row, column, CASES[:, way][case]),
                self.edges(row[twice], column[twice], CASES[case[twice], way + 2]),
            ]
            for way in (0, 1)
        )
        return enter, leave

    def edges(self, row: np.ndarray, column: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Number the edges (n,) at a side of each cell."""
        height, width = self.field.shape
        upright = height * width
        from_corner = np.zeros(4, np.int64)
        from_corner[[LEFT, TOP, RIGHT, BOTTOM]] = upright, 0, upright + 1, width
        edge = row * width + column + from_corner[side]
        if self.wraps.any():  # beneath the last cells lies the first row
            ends = self.offsets[1:][self.wraps] - 2
            back = np.zeros(height, np.int64)
            back[ends] = (ends + 1 - self.offsets[:-1][self.wraps]) * width
            edge -= np.where(side == BOTTOM, back[row], 0)
        return edge

    def crossings(self, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find where the level crosses edges (M,): (row, column) of each (M, 2), and its row."""
        height, width = self.field.shape
        lies, values = edge < height * width, self.field.reshape(-1)
        corner = np.where(lies, edge, edge - height * width)
        row, column = np.divmod(corner, width)
        begin = values.take(corner)
        other = values.take(corner + np.where(lies, 1, width))
        t = (self.by_row(self.level)[row] - begin) / (other - begin)
        points = [row + np.where(lies, 0.0, t), column + np.where(lies, t, 0.0)]
        return np.stack(points, axis=1), row


def isolines(
    field: np.ndarray, offsets: np.ndarray, wraps: np.ndarray, level: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw the polygons round what lies above a level, by marching squares, on all grids at once.

    The region is on one side of all of them, holes turn the other way.

    Parameters
    ----------
    field : (H, W) float, grids of one width stacked: grid i is rows offsets[i]:offsets[i+1].
        Outermost columns, and the first and last rows of a grid that does not wrap, must not lie
        above the level: nothing leaves the grid.
    offsets : (C+1,) int
    wraps : (C,) bool: the last row of such a grid is its first one again
    level : (C,) float

    Returns
    -------
    points (M, 2) float64 as (row, column), offsets (R+1,) of the closed polygons, and the grid (R,)
    of each. On a grid that wraps, a polygon may step from the last rows to the first.
    """
    grids = _Grids(field, offsets, wraps, level)
    enter, leave = grids.walks()
    entered = np.zeros(2 * field.size, bool)
    entered[enter] = True
    edge = np.flatnonzero(entered)
    place = np.empty(len(entered), np.int64)  # of each edge among those; it is entered once
    place[edge] = np.arange(len(edge))
    after = np.empty(len(edge), np.int64)
    after[place[enter]] = place[leave]
    walked, rings = cycles(after)
    points, row = grids.crossings(edge[walked])
    return points, rings, grids.by_row(np.arange(len(level)))[row[rings[:-1]]]


def cycles(after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Walk the cycles of a permutation: its elements as walked (n,), and offsets of the cycles.

    Each cycle begins at its lowest element, and they are sorted by it. By pointer jumping: log n
    rounds, no loop.

    `after` : (n,) int, the element that follows each
    """
    n, here = len(after), np.arange(len(after))
    # the lowest of the next so many elements, and the steps to it
    lowest, steps, jump, many = here, np.zeros(n, np.int64), after, 1
    while True:
        ahead = lowest.take(jump)
        lower = ahead < lowest
        if not lower.any():
            break
        steps = np.where(lower, steps.take(jump) + many, steps)
        lowest = np.where(lower, ahead, lowest)
        jump, many = jump.take(jump), 2 * many
    first = lowest == here
    count = np.bincount(lowest, minlength=n)[first] if n else np.zeros(0, np.int64)
    offsets = np.r_[0, np.cumsum(count)]
    own = (np.cumsum(first) - 1)[lowest]
    walked = np.empty(n, np.int64)
    walked[offsets[own] + np.where(first, 0, count[own] - steps)] = here
    return walked, offsets
