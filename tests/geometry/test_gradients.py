"""Conjugate gradients solve what elimination solves."""

import numpy as np
import pytest

from strokestyle.geometry.gradients import conjugate_gradients


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_they_solve_what_elimination_does(count):
    rng = np.random.default_rng(count)
    half = rng.normal(size=(count, count)) / max(count, 1) ** 0.5
    matrix = half @ half.T + np.diag(10.0 ** rng.uniform(-2, 3, count))
    right = rng.normal(size=(count, 3))
    found = conjugate_gradients(
        lambda x: matrix @ x, np.diag(matrix)[:, None], right, np.zeros((count, 3)), 1e-10
    )
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-6, atol=1e-8)


def test_what_is_solved_stays():
    start = np.array([[1.0, 2.0]])
    found = conjugate_gradients(lambda x: 2 * x, np.array([[2.0]]), 2 * start, start, 1e-9)
    np.testing.assert_array_equal(found, start)
    assert found is not start


def test_it_ends_where_no_number_is_so_precise():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(30, 30))
    matrix, right = half @ half.T, rng.normal(size=(30, 1))
    diagonal = np.diag(matrix)[:, None]
    found = conjugate_gradients(lambda x: matrix @ x, diagonal, right, 0 * right, 1e-30)
    np.testing.assert_allclose(matrix @ found, right, atol=1e-6)
