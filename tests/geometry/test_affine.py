"""Affine maps: closed form."""

import numpy as np
import pytest

from strokestyle.geometry.affine import (
    IDENTITY,
    compose,
    determinant,
    inverse,
    is_flat,
    transformed,
)

MAPS = [IDENTITY, (1, 0, 0, 1, 30, -4), (0.8, 0.6, -0.6, 0.8, 5, 1), (-2, 0.3, 0.5, 0.7, 1, 2)]


@pytest.mark.parametrize("matrix", MAPS)
def test_an_inverse_takes_points_back(matrix):
    points = np.array([[0.0, 0.0], [3.0, -1.0], [100.0, 7.0]])
    assert transformed(inverse(matrix), transformed(matrix, points)) == pytest.approx(points)
    assert compose(matrix, inverse(matrix)) == pytest.approx(IDENTITY)


def test_a_determinant_is_the_area_of_what_the_unit_square_becomes():
    assert [determinant(matrix) for matrix in MAPS] == pytest.approx([1, 1, 1, -1.55])
    assert determinant(compose(MAPS[3], MAPS[3])) == pytest.approx(1.55**2)
    assert not any(map(is_flat, MAPS))
    assert is_flat((2.0, 1.0, 4.0, 2.0, 5.0, 6.0)) and is_flat((1.0, 0.0, 0.0, 0.0, 9.0, 9.0))
