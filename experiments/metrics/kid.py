"""KID, the kernel distance of two sets of features: unbiased, however few they are.

Source: Binkowski, Sutherland, Arbel & Gretton, Demystifying MMD GANs, ICLR 2018, sec. 4; Gretton et
al., A kernel two-sample test, JMLR 13 (2012), lemma 6 and eq. 4."""

from collections.abc import Sequence

import numpy as np


def kid(a: np.ndarray, b: np.ndarray) -> float:
    """Estimate the squared maximum mean discrepancy of the rows of a and b, without bias.

    a : (n, d); b : (m, d). The kernel is (x.y / d + 1)^3, of all pairs but a row with itself.
    Raises ValueError for fewer than two rows on either side."""
    if min(len(a), len(b)) < 2:
        raise ValueError("a spread needs at least two rows on either side")
    return _mean_apart(kernel(a, a)) + _mean_apart(kernel(b, b)) - 2 * float(kernel(a, b).mean())


def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The kernel of all pairs of rows: (n, m)."""
    return (a.astype(np.float64) @ b.T.astype(np.float64) / a.shape[1] + 1) ** 3


def _mean_apart(square: np.ndarray) -> float:
    """The mean beside the diagonal."""
    n = len(square)
    return float((square.sum() - np.trace(square)) / (n * (n - 1)))


class PairedKid:
    """KID of two sets of drawings that go in pairs: drawing i of either set shows the same thing.

    The two of a pair are not independent, nor are the rows of one drawing; so only rows of
    different pairs are compared, and the estimate stays unbiased (Gretton et al., eq. 4, with pairs
    of drawings for pairs of points).

    a, b : for each drawing, its rows (n, d); one, or many that were seen in its patches, or none
    """

    def __init__(self, a: Sequence[np.ndarray], b: Sequence[np.ndarray]):
        if len(a) != len(b):
            raise ValueError(f"pairs are asked for, of {len(a)} and {len(b)} drawings")
        self._counts = [np.array([len(rows) for rows in side], float) for side in (a, b)]
        first, second = (np.concatenate([*side]) for side in (a, b))
        ends = [np.concatenate([[0], np.cumsum(counts)]).astype(int) for counts in self._counts]
        self._sums = {
            (0, 0): _block_sums(kernel(first, first), ends[0], ends[0]),
            (1, 1): _block_sums(kernel(second, second), ends[1], ends[1]),
            (0, 1): _block_sums(kernel(first, second), ends[0], ends[1]),
        }

    def distance(self, weights: np.ndarray | None = None) -> float:
        """Estimate the distance; nan where there are fewer than two pairs with rows.

        weights : how often each pair counts, for the bootstrap. A pair is never compared with its
            own copy, so that copies do not raise the estimate"""
        weights = np.ones(len(self._counts[0])) if weights is None else np.asarray(weights, float)
        within = self._mean(0, 0, weights) + self._mean(1, 1, weights)
        return within - 2 * self._mean(0, 1, weights)

    def _mean(self, i: int, j: int, weights: np.ndarray) -> float:
        """The mean kernel of set i and set j."""
        both = np.outer(weights, weights)
        np.fill_diagonal(both, 0)
        count = (both * np.outer(self._counts[i], self._counts[j])).sum()
        return float((both * self._sums[i, j]).sum() / count) if count else float("nan")


def _block_sums(values: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Sum a matrix over blocks that begin and end there: (len(rows) - 1, len(columns) - 1)."""
    table = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    table[1:, 1:] = values.cumsum(0).cumsum(1)
    return np.diff(np.diff(table[np.ix_(rows, columns)], axis=0), axis=1)
