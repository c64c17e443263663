"""Pieces of a scene, each with a name, laid one after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..files import quoted
from .triangles import Triangles


class Piece(NamedTuple):
    """Triangles in the frame of the scene.

    vertices : (V, 3) float64
    faces : (F, 3) int64
    name, material : "" where the file gives none
    polygon : (F,) int64, which of the piece's polygons each face was cut from; None: each is one
    """

    vertices: np.ndarray
    faces: np.ndarray
    name: str
    material: str = ""
    polygon: np.ndarray | None = None


def together(pieces: list[Piece]) -> Triangles:
    """Lay pieces one after the other; those of one name are a part.

    Where fewer than two have names, materials are parts, if there are several.
    """
    names = [piece.name for piece in pieces]
    materials = [piece.material for piece in pieces]
    if len({*names} - {""}) < 2 and len({*materials}) > 1:
        names = materials
    part_names = tuple(dict.fromkeys(names))
    number = {name: i for i, name in enumerate(part_names)}
    sizes = [len(piece.faces) for piece in pieces]
    polygon = None
    if any(piece.polygon is not None for piece in pieces):
        own = [np.arange(len(p.faces)) if p.polygon is None else p.polygon for p in pieces]
        polygon = _one_after_the_other(own, [rows.max(initial=-1) + 1 for rows in own])
    return Triangles(
        np.concatenate([piece.vertices for piece in pieces]),
        _one_after_the_other([p.faces for p in pieces], [len(p.vertices) for p in pieces]),
        np.repeat([number[name] for name in names], sizes),
        part_names,
        polygon,
    )


def _one_after_the_other(numbers: list[np.ndarray], counts: list[int]) -> np.ndarray:
    """Join numbers below `counts` so that no two pieces share one."""
    offset = np.cumsum([0, *counts[:-1]])
    return np.concatenate([rows + at for rows, at in zip(numbers, offset, strict=True)])


def moved(
    vertices: np.ndarray, faces: np.ndarray, matrix: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Apply a matrix (4, 4) to vertices (V, 3); faces (F, 3) are turned about by a mirror."""
    turn = -1 if np.linalg.det(matrix[:3, :3]) < 0 else 1
    return vertices @ matrix[:3, :3].T + matrix[:3, 3], faces[:, ::turn]


def check_corners(faces: np.ndarray, count: int, name: str) -> None:
    """Raise ValueError, naming the part, where faces name none of `count` vertices."""
    if faces.size and not 0 <= faces.min() <= faces.max() < count:
        bad = faces.max() if faces.max() >= count else faces.min()
        raise ValueError(
            f"a triangle of {label(name)} names a vertex that does not exist: {bad}, and they are "
            f"0 to {count - 1}"
        )


def label(name: str) -> str:
    """Write the name of a part as an error quotes it."""
    return repr(quoted(name)) if name else "a mesh"
