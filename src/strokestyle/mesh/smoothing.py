"""Smooth values at the vertices of a mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

Blur = Callable[[np.ndarray], np.ndarray]

# Vertices and steps, from which on it pays to put neighbours near each other in memory: what the
# file strews then no longer fits the processor's cache.
MIN_SORTED, MIN_STEPS = 100_000, 8


def smoothing(ends: np.ndarray, count: int, smooth: float) -> Blur | None:
    """Make the function that smooths values (V, k) by `smooth` mean edges; None for nothing to do.

    Repeated half-way averaging with the edge neighbours: each step adds a quarter of a squared edge
    of variance. Values are smoothed in their own precision.

    Parameters
    ----------
    ends : (E, 2) int, of the edges
    count : V
    """
    if smooth <= 0.0:
        return None
    steps = int(np.ceil(4.0 * smooth**2))
    # a little less than half, so that whole steps end where they should
    part = 0.5 * (4.0 * smooth**2 / steps)
    one, two = ends.T.astype(np.int32, copy=False)
    step, order = _averaging(one, two, count, part), None
    if count >= MIN_SORTED and steps >= MIN_STEPS:
        order = _neighbours_together(step)
        place = np.empty(count, np.int32)
        place[order] = np.arange(count, dtype=np.int32)
        step = step[order]
        step.indices = place[step.indices]

    def blur(values: np.ndarray) -> np.ndarray:
        step.data = step.data.astype(values.dtype, copy=False)
        values = values if order is None else values[order]
        for _ in range(steps):
            values = step @ values
        return values if order is None else values[place]

    return blur


def _averaging(one: np.ndarray, two: np.ndarray, count: int, part: float) -> csr_matrix:
    """Make the matrix that takes `part` of a value from its neighbours, the rest from itself.

    `one`, `two` : (E,) int32, the ends of the edges
    """
    own = np.arange(count, dtype=np.int32)
    rows, columns = np.concatenate([own, one, two]), np.concatenate([own, two, one])
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    links.has_canonical_format = True  # no edge is given twice
    step = links.tocsr()
    size = np.diff(step.indptr)
    step.data = np.repeat(part / np.maximum(size - 1, 1), size)
    step.data[step.indptr[:-1]] = 1.0 - part  # rows keep their order: each one's own came first
    return step


def _neighbours_together(links: csr_matrix) -> np.ndarray:
    """Order vertices so that neighbours lie near each other: in rings round the first, (V,) int.

    What those do not reach comes after them, as it is.
    """
    from scipy.sparse.csgraph import breadth_first_order  # takes .05 s to import

    rings = breadth_first_order(links, 0, return_predecessors=False)
    if len(rings) == links.shape[0]:
        return rings
    rest = np.ones(links.shape[0], bool)
    rest[rings] = False
    return np.concatenate([rings, np.flatnonzero(rest).astype(np.int32)])
