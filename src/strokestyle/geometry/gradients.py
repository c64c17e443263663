"""Conjugate gradients, for equations between neighbours: to import a library's takes longer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

MOST = 200  # steps; where neighbours tell of each other as much as of themselves, some 20 are taken


def conjugate_gradients(
    product: Callable[[np.ndarray], np.ndarray],
    diagonal: np.ndarray,
    right: np.ndarray,
    start: np.ndarray,
    tolerance: float,
) -> np.ndarray:
    """Solve equations A x = b, of a symmetric, positive definite A, for all columns of b at once.

    Hestenes and Stiefel 1952, preconditioned by A's diagonal. Ends where a step of Jacobi's would
    not move any number by more than the tolerance, or after MOST steps.

    Parameters
    ----------
    product : takes x to A x
    diagonal : (n, 1), of A
    right : (n, k), b
    start : (n, k), about the solution
    tolerance : in the units of x
    """
    found = start.copy()
    rest = right - product(found)
    turned = rest / diagonal
    step, size = turned, (rest * turned).sum()
    for _ in range(MOST):
        if not np.abs(turned).max(initial=0.0) > tolerance:
            break
        moved = product(step)
        length = size / (step * moved).sum()
        found += length * step
        rest -= length * moved
        turned = rest / diagonal
        last, size = size, (rest * turned).sum()
        step = turned + (size / last) * step
    return found
