"""Measure how large faces are, and how far from slivers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

BLOCK = 8192  # faces measured at a time: what is in between stays in the processor's cache


class FaceShapes(NamedTuple):
    """Sizes of F faces.

    Parameters
    ----------
    area : (F,), twice their area
    longest, mean_side : (F,), lengths
    """

    area: np.ndarray
    longest: np.ndarray
    mean_side: np.ndarray

    @classmethod
    def of(cls, vertices: np.ndarray, faces: np.ndarray) -> FaceShapes:
        """Measure faces (F, 3) of vertices (V, 3)."""
        shapes = cls(*np.empty((3, len(faces))))
        columns = [np.ascontiguousarray(axis) for axis in vertices.T]
        for first in range(0, len(faces), BLOCK):
            some = slice(first, first + BLOCK)
            corner = np.ascontiguousarray(faces[some].T)
            a, b, c = ([axis[i] for axis in columns] for i in corner)
            (x, y, z), (u, v, w), third = (
                [end - begin for begin, end in zip(*ends, strict=True)]
                for ends in ((a, b), (a, c), (b, c))
            )
            lengths = [np.sqrt(p * p + q * q + r * r) for p, q, r in ((x, y, z), (u, v, w), third)]
            across = (y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2
            shapes.area[some] = np.sqrt(across)
            shapes.longest[some] = np.maximum.reduce(lengths)
            shapes.mean_side[some] = sum(lengths) / 3.0
        return shapes


def mean_around(faces: np.ndarray, value: np.ndarray, count: int) -> np.ndarray:
    """Average a value (F,) over the faces (F, 3) at each of `count` vertices, 0 where none is."""
    number, total = np.zeros((2, count))
    for corner in faces.T:
        number += np.bincount(corner, minlength=count)
        total += np.bincount(corner, value, count)
    return total / np.maximum(number, 1.0)
