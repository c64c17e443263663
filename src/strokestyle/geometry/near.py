"""Points of the plane near each other, and groups of what is linked.

For jobs of milliseconds: to import `scipy.spatial`, or `scipy.sparse.csgraph`, takes longer than
all else that is sought in drawing a mesh. Points are sorted by the cells of a grid, whose sides are
the reach (Bentley, Stanat and Williams 1977); where they crowd, a k-d tree is worth its import.
"""

from __future__ import annotations

import numpy as np

MANY = 1 << 19  # pairs to be looked at from which on a tree is made
FEW = 4  # times as many points as queries, from which on those that may be near are taken first
BUCKETS = 1 << 16  # that cells are put in for that
CELLS = 1 << 30  # at most along a side, so that two numbers of cells are one of 64 bits


def near_pairs(points: np.ndarray, reach: float) -> np.ndarray:
    """Find the pairs (P, 2) of points (N, 2) within `reach` of each other, `reach` itself included.

    The lower number comes first in each; pairs are by the first and then by the second.
    """
    if len(points) < 2:
        return np.zeros((0, 2), np.int64)
    grid = _Grid(points, reach)
    below = grid.keys + grid.width
    first = [np.arange(1, len(points) + 1), np.searchsorted(grid.keys, below - 1)]
    after = [np.searchsorted(grid.keys, key + 1, "right") for key in (grid.keys, below)]
    begin, count = np.stack(first, axis=1), np.stack(after, axis=1) - np.stack(first, axis=1)
    if count.sum() > MANY:
        from scipy.spatial import cKDTree

        low, high = cKDTree(points).query_pairs(reach, output_type="ndarray").T
    else:
        one, place = _listed(begin, count)
        one, two = grid.order[one], grid.order[place]
        near = _square(points[one] - points[two]) <= reach * reach
        low, high = np.minimum(one[near], two[near]), np.maximum(one[near], two[near])
    return np.stack(np.divmod(np.sort(low * len(points) + high), len(points)), axis=1)


def count_near(points: np.ndarray, queries: np.ndarray, reach: float) -> np.ndarray:
    """Count the points (N, 2) within `reach` of queries (Q, 2), `reach` itself included, (Q,)."""
    if not len(points) or not len(queries):
        return np.zeros(len(queries), np.int64)
    grid = _Grid(points, reach)
    begin, count = grid.around(queries)
    if count.sum() > MANY:
        from scipy.spatial import cKDTree

        return cKDTree(points).query_ball_point(queries, reach, return_length=True)
    query, place = _listed(begin, count)
    near = _square(queries[query] - points[grid.order[place]]) <= reach * reach
    return np.bincount(query[near], minlength=len(queries))


def nearest_points(
    points: np.ndarray, queries: np.ndarray, reach: float, most: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Find the points (N, 2) nearer than `reach` to queries (Q, 2), for each at `most` the nearest.

    Returns
    -------
    the query and the point of each pair, (P,) int, by query and then by how near they are
    """
    if not len(points) or not len(queries):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    if FEW * len(queries) < len(points) and reach > 0.0:
        some = np.flatnonzero(_may_be_near(points, queries, reach))
        query, point = _nearest(points[some], queries, reach, most)
        return query, some[point]
    return _nearest(points, queries, reach, most)


def _may_be_near(points: np.ndarray, queries: np.ndarray, reach: float) -> np.ndarray:
    """Tell which points (N, 2) may be within `reach` of queries (Q, 2), (N,) bool.

    All that are, and a few others: cells share BUCKETS. That takes less than to sort all points.
    """
    side = reach * (1.0 + 1e-6)  # cells apart are farther than rounding may be
    marked = np.zeros(BUCKETS, bool)
    cell = np.floor(queries / side)
    for step in np.ndindex(3, 3):
        marked[_bucket(cell + step - 1.0)] = True
    return marked[_bucket(np.floor(points / side))]


def _bucket(cell: np.ndarray) -> np.ndarray:
    """Choose one of BUCKETS for cells (N, 2) of whole numbers, (N,) int."""
    column, row = cell.T
    return (column + 251.0 * row).astype(np.int64) % BUCKETS


def _nearest(
    points: np.ndarray, queries: np.ndarray, reach: float, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Find what `nearest_points` does, by a grid of all points."""
    if not len(points):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    grid = _Grid(points, reach)
    begin, count = grid.around(queries)
    if count.sum() > MANY:
        from scipy.spatial import cKDTree

        nearest = np.arange(1, min(most, len(points)) + 1)
        _, found = cKDTree(points).query(queries, nearest, distance_upper_bound=reach)
        query, rank = np.nonzero(found < len(points))
        return query, found[query, rank]
    query, place = _listed(begin, count)
    point = grid.order[place]
    square = _square(queries[query] - points[point])
    near = np.flatnonzero(square < reach * reach)
    near = near[np.lexsort((point[near], square[near], query[near]))]
    query, point = query[near], point[near]
    kept = np.arange(len(query)) - np.searchsorted(query, query) < most
    return query[kept], point[kept]


class _Grid:
    """Points sorted by the cell of a grid that each lies in, row by row.

    Parameters
    ----------
    order : (N,) int, the points by cell
    keys : (N,) int64 ascending, their cells
    width : of a row; the cells beside one are one less and one more
    """

    def __init__(self, points: np.ndarray, reach: float):
        self._low = points.min(axis=0)
        size = np.ptp(points, axis=0)
        self._side = max(reach, float(size.max()) / CELLS) or 1.0
        self._last = np.floor(size / self._side) + 2.0  # a cell to spare at every side
        self.width = int(self._last[0]) + 1
        keys = self.key(points)
        self.order = np.argsort(keys, kind="stable")
        self.keys = keys[self.order]

    def key(self, xy: np.ndarray) -> np.ndarray:
        """Number the cells of places (N, 2), int64; what is outside is in the nearest to spare."""
        cell = np.floor((xy - self._low) / self._side) + 1.0
        column, row = np.clip(cell, 0.0, self._last).astype(np.int64).T
        return row * self.width + column

    def around(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tell where in `order` the points about places (Q, 2) begin, and how many, (Q, 3) each."""
        middle = self.key(xy)[:, None] + np.array([-self.width, 0, self.width])
        begin = np.searchsorted(self.keys, middle - 1)
        return begin, np.searchsorted(self.keys, middle + 1, "right") - begin


def _listed(begin: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List `count` numbers from `begin` on (K, m), and the row that each comes from, (P,) both."""
    each = count.ravel()
    before = np.cumsum(each) - each
    listed = np.repeat(begin.ravel() - before, each) + np.arange(each.sum())
    return np.repeat(np.arange(len(count)), count.sum(axis=1)), listed


def _square(apart: np.ndarray) -> np.ndarray:
    """Square the length of vectors (P, 2)."""
    return apart[:, 0] * apart[:, 0] + apart[:, 1] * apart[:, 1]


def linked_groups(links: np.ndarray, count: int) -> np.ndarray:
    """Number the groups that `links` (2, K) join `count` things to, (count,) int32 from 0.

    Groups are in the order of the first thing of each. All that is linked takes the lowest root at
    either end, then the roots are linked, and so on (Shiloach and Vishkin 1982).
    """
    root = np.arange(count, dtype=np.int32)
    one, two = links.astype(np.int32, copy=False)
    while len(one):
        low, high = np.minimum(one, two), np.maximum(one, two)
        np.minimum.at(root, high, low)
        while True:
            above = root[root]
            if np.array_equal(above, root):
                break
            root = above
        one, two = root[one], root[two]
        apart = one != two
        one, two = one[apart], two[apart]
    first = root == np.arange(count, dtype=np.int32)
    return (np.cumsum(first, dtype=np.int32) - 1)[root]
