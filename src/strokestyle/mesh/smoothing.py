"""Smooth values at the vertices of a mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

Blur = Callable[[np.ndarray], np.ndarray]

# Vertices and steps, from which on it pays to put neighbours near each other in memory: what the
# file strews then no longer fits the processor's cache.
MIN_SORTED, MIN_STEPS = 100_000, 8
NEGLIGIBLE = 1e-6  # share of a value that many steps of smoothing may leave out


def smoothing(ends: np.ndarray, count: int, smooth: float) -> Blur | None:
    """Make the function that smooths values (V, k) by `smooth` mean edges; None for nothing to do.

    Repeated half-way averaging with the edge neighbours: each step adds a quarter of a squared edge
    of variance. Many steps at many vertices are taken together, as `_series` says. Values are
    smoothed in their own precision.

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
    if count >= MIN_SORTED and steps >= MIN_STEPS:
        return _in_rings(_averaging(one, two, count, None), part, steps)
    step = _averaging(one, two, count, part)

    def blur(values: np.ndarray) -> np.ndarray:
        step.data = step.data.astype(values.dtype, copy=False)
        for _ in range(steps):
            values = step @ values
        return values

    return blur


def _in_rings(mean: csr_matrix, part: float, steps: int) -> Blur:
    """Make the function that takes `part` of values from the `mean` of their neighbours `steps`
    times, with vertices that are neighbours near each other in memory."""
    weights = _series(part, steps)
    order = _neighbours_together(mean)
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    twice = mean[order]
    twice.indices = place[twice.indices]
    twice.data *= 2.0

    def blur(values: np.ndarray) -> np.ndarray:
        twice.data = twice.data.astype(values.dtype, copy=False)
        last = values[order]
        this = twice @ last
        this *= 0.5
        total = weights[0] * last + weights[1] * this
        for weight in weights[2:]:
            following = twice @ this
            following -= last
            total += np.multiply(following, weight, out=last)  # into memory that is done with
            last, this = this, following
        return total[place]

    return blur


def _series(part: float, steps: int) -> list[float]:
    """Write `steps` steps of averaging as a sum of Chebyshev polynomials of a mean of neighbours.

    The steps are the polynomial (1 - part + part x)^steps of the mean x, whose values are within
    -1 and 1. Its weights fall off like a binomial distribution's, so that those of high degree
    are left out: together NEGLIGIBLE at most. Values that are all alike stay what they are.
    """
    from numpy.polynomial import Chebyshev  # takes 3 ms to import

    weights = Chebyshev.interpolate(lambda x: (1.0 - part + part * x) ** steps, steps).coef
    left_out = np.cumsum(np.abs(weights[::-1]))[::-1]
    weights = weights[: max(np.count_nonzero(left_out > NEGLIGIBLE), 2)]
    return (weights / weights.sum()).tolist()


def _averaging(one: np.ndarray, two: np.ndarray, count: int, part: float | None) -> csr_matrix:
    """Make the matrix that takes `part` of a value from its neighbours, the rest from itself.

    With None, that of the neighbours' mean alone. `one`, `two` : (E,) int32, the ends of the edges
    """
    rows, columns = np.concatenate([one, two]), np.concatenate([two, one])
    if part is not None:
        own = np.arange(count, dtype=np.int32)
        rows, columns = np.concatenate([own, rows]), np.concatenate([own, columns])
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    links.has_canonical_format = True  # no edge is given twice
    step = links.tocsr()
    size = np.diff(step.indptr)
    if part is None:
        step.data = np.repeat(1.0 / np.maximum(size, 1), size)
        return step
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
