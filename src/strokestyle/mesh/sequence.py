"""Read the frames of one mesh that deforms, as surfaces of the same faces in one frame of space."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from .messages import naming
from .read import read_mesh
from .surface import Cleaned, Surface, clean, measured
from .triangles import Triangles


def load_sequence(paths: Sequence[str | Path]) -> list[Surface]:
    """Read the frames of a mesh that deforms: files of one mesh's faces with other vertices.

    The first frame says how all are centred, scaled, mended, cut into triangles and split at
    creases, and what the thresholds of lines are measured in: faces and vertices are the same in
    all frames, in the same order, and what keeps still keeps still.

    Parameters
    ----------
    paths : the files, in the order in which they are shown

    Raises
    ------
    OSError
        where a file cannot be opened
    ValueError
        where there are none, where one holds no surface, or has other faces than the first; it
        names the file.
    """
    return list(read_sequence(paths))


def read_sequence(paths: Sequence[str | Path]) -> Iterator[Surface]:
    """Read the frames of a mesh that deforms one by one, as `load_sequence` does."""
    if not paths:
        raise ValueError("a sequence has 1 frame or more")
    first = read_mesh(paths[0])
    with _errors_name(paths[0]), naming(paths[0]):
        cleaned = clean(first.vertices, first.faces, part=first.part, polygon=first.polygon)
        surface = measured(cleaned, cleaned.vertices, part_names=first.part_names)
    origin = origins(first, cleaned)
    yield surface
    for path in paths[1:]:
        found = read_mesh(path)
        check_same_faces(path, found, paths[0], first)
        with _errors_name(path), naming(path):
            vertices = _moved(found.vertices[origin], cleaned)
            later = measured(cleaned, vertices, part_names=first.part_names)
        yield replace(later, feature_size=surface.feature_size)


class _errors_name:
    """Name a file in the ValueErrors of what is done within."""

    def __init__(self, path: str | Path):
        self.path = path

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, ValueError):
            raise ValueError(f"{self.path}: {error}") from None


def _moved(vertices: np.ndarray, cleaned: Cleaned) -> np.ndarray:
    """Bring vertices of a file into the frame of a cleaned mesh."""
    if not np.isfinite(vertices).all():
        bad = int((~np.isfinite(vertices).all(axis=1)).sum())
        raise ValueError(f"{bad} of its vertices have coordinates that are not finite numbers")
    return (vertices - cleaned.centre) / cleaned.scale


def origins(given: Triangles, cleaned: Cleaned) -> np.ndarray:
    """Find which vertex of a file each of its cleaned mesh was, (V,) int.

    Where several lay at one place, one that the vertex's own face had: bodies that touch in the
    first frame may part later on.
    """
    place = (given.vertices - cleaned.centre) / cleaned.scale
    own = given.faces[cleaned.kept]
    origin = np.full(len(cleaned.vertices), -1)
    nearest = np.full(len(cleaned.vertices), np.inf)
    for corner in cleaned.faces.T:
        for candidate in own.T:
            away = np.abs(place[candidate] - cleaned.vertices[corner]).max(axis=1)
            better = away < nearest[corner]
            np.minimum.at(nearest, corner, away)
            best = better & (away == nearest[corner])
            origin[corner[best]] = candidate[best]
    return origin


def check_same_faces(path: str | Path, found: Triangles, first_path: str | Path, first: Triangles):
    """Raise ValueError, naming both files, unless their faces join the same vertices.

    A polygon may be cut into other triangles: that goes by its shape, which changes.
    """
    other = f"the first frame, {first_path}"
    if len(found.vertices) != len(first.vertices):
        raise ValueError(
            f"{path}: has {len(found.vertices)} vertices, {other}, has {len(first.vertices)}: "
            "the frames of a sequence are one mesh that deforms, with the same faces"
        )
    if len(found.faces) != len(first.faces):
        raise ValueError(
            f"{path}: has {len(found.faces)} faces, {other}, has {len(first.faces)}: "
            "the frames of a sequence are one mesh that deforms, with the same faces"
        )
    if np.array_equal(found.faces, first.faces):
        return
    if not np.array_equal(_corners(found), _corners(first)):
        raise ValueError(
            f"{path}: its faces join other vertices than those of {other}: the frames of a "
            "sequence are one mesh that deforms, with the same faces in the same order"
        )


def _corners(mesh: Triangles) -> np.ndarray:
    """List the vertices of each polygon, (M, 2): polygon and vertex, sorted."""
    polygon = np.arange(len(mesh.faces)) if mesh.polygon is None else mesh.polygon
    return np.unique(np.stack([np.repeat(polygon, 3), mesh.faces.ravel()], axis=1), axis=0)
