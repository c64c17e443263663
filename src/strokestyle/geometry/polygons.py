"""Where fields on stacks of grids reach a level: closed polygons by marching squares, all grids at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .curves import counting


def winding_number(
    rings: np.ndarray,
    points: np.ndarray,
    offsets: np.ndarray | None = None,
    spend: Callable[[int], None] = lambda pairs: None,
) -> np.ndarray:
    """How often closed polygons go round each of the points (M, 2), (M,) int.

    Polygon i is rows offsets[i]:offsets[i+1] of `rings` (n, 2); without offsets, all rows are one polygon. `spend` is
    told beforehand how many pairs of an edge and a point will be looked at, and may refuse.
    """
    offsets = np.array([0, len(rings)]) if offsets is None else offsets
    after, some = np.arange(1, len(rings) + 1), np.flatnonzero(np.diff(offsets))
    after[offsets[1:][some] - 1] = offsets[:-1][some]
    (ax, ay), (bx, by) = rings.T, rings[after].T
    order = np.argsort(points[:, 1], kind="stable")
    x, y = points[order].T
    low, high = np.minimum(ay, by), np.maximum(ay, by)
    first = np.searchsorted(
        y, low
    )  # an edge is crossed by points as high as its lower end, but not its upper
    count = np.searchsorted(y, high) - first
    spend(int(count.sum()))
    crossed = np.flatnonzero(count)
    first, count = first[crossed], count[crossed]
    dx, dy = (bx - ax)[crossed], (by - ay)[crossed]
    at = counting(count) + np.repeat(first, count)
    # where a point's level meets the edge: round a point that lies to the left of it, the edge turns
    meets = np.repeat(ax[crossed], count) + (y[at] - np.repeat(ay[crossed], count)) * np.repeat(
        dx / dy, count
    )
    turns = np.bincount(
        at, np.where(x[at] < meets, np.repeat(np.sign(dy), count), 0.0), len(points)
    )
    winding = np.empty(len(points), np.int64)
    winding[order] = np.rint(turns).astype(np.int64)
    return winding


LEFT, TOP, RIGHT, BOTTOM = range(4)  # sides of a cell


def _cases() -> np.ndarray:
    """(18, 4): by which side a walk with the inside on its left comes into a cell and leaves it, twice; -1: not at all.

    The case is the sum of 1, 2, 4, 8 for the corners inside, clockwise from the top left; 16 and 17 are the cases 5
    and 10, opposite corners, where the middle joins what case 5 and 10 keep apart.
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


def isolines(
    field: np.ndarray, offsets: np.ndarray, wraps: np.ndarray, level: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The polygons round what lies above a level; the region is on one side of all of them, holes turn the other way.

    Parameters
    ----------
    field : (H, W) float, grids of one width stacked: grid i is rows offsets[i]:offsets[i+1]. Outermost columns, and
        the first and last rows of a grid that does not wrap, must not lie above the level: nothing leaves the grid.
    offsets : (C+1,) int
    wraps : (C,) bool: the last row of such a grid is its first one again
    level : (C,) float

    Returns
    -------
    points (M, 2) float64 as (row, column), offsets (R+1,) of the closed polygons, grid (R,) of each. On a grid that
    wraps, a polygon may step from the last rows to the first.
    """
    height, width = field.shape
    above = (field > np.repeat(level, np.diff(offsets)).astype(field.dtype)[:, None]).view(np.uint8)
    case = above[:-1, :-1] + 2 * above[:-1, 1:] + 4 * above[1:, 1:] + 8 * above[1:, :-1]
    case[offsets[1:-1] - 1] = 0  # between two grids
    cell = np.flatnonzero((case > 0) & (case < 15))
    row, column = np.divmod(cell, width - 1)
    case = case.reshape(-1)[cell].astype(np.int64)
    grid = np.searchsorted(offsets, row, side="right") - 1
    saddle = np.flatnonzero((case == 5) | (case == 10))
    r, c = row[saddle], column[saddle]
    middle = 0.25 * (field[r, c] + field[r, c + 1] + field[r + 1, c] + field[r + 1, c + 1])
    joined = saddle[middle > level[grid[saddle]]]
    case[joined] = np.where(case[joined] == 5, 16, 17)
    # edges by number: those along a row (row, column..column + 1) first, then those along a column
    below = np.where(wraps[grid] & (row == offsets[grid + 1] - 2), offsets[grid], row + 1)
    upright = height * width
    here = row * width + column
    sides = np.stack([upright + here, here, upright + here + 1, below * width + column], axis=1)
    walk = CASES[case]
    twice = np.flatnonzero(walk[:, 2] >= 0)
    one = np.arange(len(walk))
    enter = np.r_[sides[one, walk[:, 0]], sides[twice, walk[twice, 2]]]
    leave = np.r_[sides[one, walk[:, 1]], sides[twice, walk[twice, 3]]]
    order = np.argsort(enter)
    edge = enter[order]
    walked, rings = cycles(np.searchsorted(edge, leave[order]))
    edge = edge[walked]
    lies = edge < upright
    row, column = np.divmod(np.where(lies, edge, edge - upright), width)
    grid = np.searchsorted(offsets, row, side="right") - 1
    begin = field[row, column]
    end = field[np.minimum(row + ~lies, height - 1), np.minimum(column + lies, width - 1)]
    t = (level[grid] - begin) / (end - begin)
    points = np.stack([row + np.where(lies, 0.0, t), column + np.where(lies, t, 0.0)], axis=1)
    return points, rings, grid[rings[:-1]]


def cycles(after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The cycles of a permutation (n,): its elements in walking order (n,), and offsets (R+1,) of the cycles.

    Each cycle begins at its lowest element, and they are sorted by it. By pointer jumping: log n rounds, no loop.
    """
    n = len(after)
    lowest, jump = np.arange(n), after
    while True:
        lower = np.minimum(lowest, lowest[jump])
        if np.array_equal(lower, lowest):
            break
        lowest, jump = lower, jump[jump]
    first = lowest == np.arange(n)
    # steps still to be taken to the cycle's first element
    steps, jump = np.where(first, 0, 1), np.where(first, np.arange(n), after)
    while True:
        more = steps[jump]
        if not more.any():
            break
        steps, jump = steps + more, jump[jump]
    count = np.bincount(lowest, minlength=n)[first] if n else np.zeros(0, np.int64)
    offsets = np.r_[0, np.cumsum(count)]
    number = np.cumsum(first) - 1
    own = number[lowest]
    walked = np.empty(n, np.int64)
    walked[offsets[own] + np.where(first, 0, count[own] - steps)] = np.arange(n)
    return walked, offsets
