"""Smooth values at the vertices of a mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..geometry.threads import each
from .triangles import in_order

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

Blur = Callable[[np.ndarray], np.ndarray]

# Vertices and steps, from which on it pays to put neighbours near each other in memory: what the
# file strews then no longer fits the processor's cache; and to import products of matrices for it.
MIN_SORTED, MIN_STEPS = 100_000, 8
NEGLIGIBLE = 1e-5  # share of a value that many steps may leave out: no line moves by .01 px
BLOCK = 1 << 14  # vertices whose neighbours are summed up in one go, so that the sums stay in cache
HUB = 64  # neighbours, more than which are summed up on their own
ROW = 32  # bytes that numpy gathers at the price of one number


def smoothing(ends: np.ndarray, count: int, smooth: float) -> Blur | None:
    """Make the function that smooths values (V, k) by `smooth` mean edges; None for nothing to do.

    Repeated half-way averaging with the edge neighbours: each step adds a quarter of a squared edge
    of variance. Many steps at many vertices are taken together, as `_series` says. Values are
    smoothed in their own precision; those of vertices without neighbours stay what they are.

    Parameters
    ----------
    ends : (E, 2) int, of the edges, each given once
    count : V
    """
    if smooth <= 0.0:
        return None
    steps = int(np.ceil(4.0 * smooth**2))
    # a little less than half, so that whole steps end where they should
    part = 0.5 * (4.0 * smooth**2 / steps)
    if count >= MIN_SORTED and steps >= MIN_STEPS:
        one, two = ends.T.astype(np.int32, copy=False)
        return _in_rings(_averaging(one, two, count), part, steps)
    return _in_steps(_Neighbours.of(ends, count), part, steps)


def _in_steps(neighbours: _Neighbours, part: float, steps: int) -> Blur:
    """Make the function that takes `part` of values from the mean of their neighbours `steps`
    times."""
    order = neighbours.order

    def blur(values: np.ndarray) -> np.ndarray:
        out = np.empty_like(values)
        most = ROW // values.itemsize
        for first in range(0, values.shape[1], most):
            some = values[:, first : first + most]
            width = some.shape[1]
            # rows of a power of two bytes, which numpy copies several times as fast as others
            rows = np.zeros((len(values), 1 << (width - 1).bit_length()), values.dtype)
            rows[:, :width] = some[order]
            for _ in range(steps):
                means = neighbours.means(rows, part)
                rows *= 1.0 - part
                rows += means
            out[order, first : first + width] = rows[:, :width]
        return out

    return blur


class _Block(NamedTuple):
    """Vertices in a row, those of most neighbours first.

    rows : which vertices
    level : the first neighbours of those that have one, the second of those that have two, ...:
        HUB of them at most
    more, starts : the further neighbours of those that have more, one vertex after the other, and
        where each vertex's begin
    share : (n,) one over how many neighbours each has, or 1
    """

    rows: slice
    level: list[np.ndarray]
    more: np.ndarray
    starts: np.ndarray
    share: np.ndarray


class _Neighbours(NamedTuple):
    """Who is next to whom among vertices.

    order : (V,) int, the vertices in the order in which values are given: row i is order[i]'s. They
        stay BLOCK by BLOCK, so that what the file has near each other stays near
    blocks : rows and their neighbours' rows
    """

    order: np.ndarray
    blocks: list[_Block]

    @classmethod
    def of(cls, ends: np.ndarray, count: int) -> _Neighbours:
        """Find the neighbours of `count` vertices by edges (E, 2), given once each."""
        valence = np.bincount(ends.ravel(), minlength=count)
        block = np.arange(count) // BLOCK
        _, order = in_order((block + 1) * (valence.max(initial=0) + 1) - valence)
        place = np.empty(count, np.int64)
        place[order] = np.arange(count)
        one, two = (place[end] for end in ends.T)
        _, end = in_order(np.concatenate([one, two]))
        neighbour = np.concatenate([two, one])[end]
        size = valence[order]
        first = np.cumsum(size) - size
        return cls(order, [_block(neighbour, first, size, i) for i in range(0, count, BLOCK)])

    def means(self, values: np.ndarray, times: float = 1.0) -> np.ndarray:
        """Average values (V, k) over the neighbours of each, or take its own; `times` a number."""
        out = np.empty_like(values)

        def average(block: _Block) -> None:
            sums = out[block.rows]
            own = len(block.level[0]) if block.level else 0
            sums[own:] = values[block.rows][own:]
            gathered = np.empty_like(sums)
            for i, row in enumerate(block.level):
                # every row is there; "clip" has numpy write in place, without a copy
                into = gathered[: len(row)] if i else sums[:own]
                np.take(values, row, axis=0, out=into, mode="clip")
                if i:
                    sums[: len(row)] += into
            if len(block.more):
                more = values.take(block.more, axis=0)
                sums[: len(block.starts)] += np.add.reduceat(more, block.starts, axis=0)
            sums *= (times * block.share).astype(values.dtype)[:, None]

        if len(values) < MIN_SORTED:
            for block in self.blocks:
                average(block)
        else:
            each(average, self.blocks)
        return out


def _block(neighbour: np.ndarray, first: np.ndarray, size: np.ndarray, start: int) -> _Block:
    """Sort out the neighbours of the rows from `start` on: see `_Block`.

    Parameters
    ----------
    neighbour : (2E,) rows, one row's neighbours after the other's
    first, size : (V,), where each row's begin in it, and how many they are
    """
    rows = slice(start, min(start + BLOCK, len(size)))
    first, size = first[rows], size[rows]
    # how many rows have more neighbours than 0, 1, 2, ...
    having = np.cumsum(np.bincount(np.minimum(size, HUB))[:0:-1])[::-1]
    level = [neighbour[first[:n] + i] for i, n in enumerate(having.tolist())]
    further = size[size > HUB] - HUB
    begin = first[: len(further)] + HUB
    more = np.concatenate(
        [
            np.zeros(0, np.int64),
            *(neighbour[b : b + n] for b, n in zip(begin, further, strict=True)),
        ]
    )
    starts = np.cumsum(further) - further
    return _Block(rows, level, more, starts, 1.0 / np.maximum(size, 1))


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


def _averaging(one: np.ndarray, two: np.ndarray, count: int) -> csr_matrix:
    """Make the matrix that takes values to the mean of their neighbours, or to themselves.

    `one`, `two` : (E,) int32, the ends of the edges
    """
    from scipy.sparse import coo_matrix  # takes .1 s to import

    alone = np.ones(count, bool)
    alone[one] = alone[two] = False
    own = np.flatnonzero(alone).astype(np.int32)
    rows, columns = np.concatenate([one, two, own]), np.concatenate([two, one, own])
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    links.has_canonical_format = True  # no edge is given twice
    mean = links.tocsr()
    size = np.diff(mean.indptr)
    mean.data = np.repeat(1.0 / size, size)
    return mean


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
