"""Read the frames of one mesh that deforms, as surfaces of the same faces in one frame of space."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .messages import naming
from .read import read_mesh
from .repair import centre_and_scale
from .surface import Cleaned, Surface, clean, measured
from .triangles import Triangles, row_dot, unit_rows
from .weld import first_at_place

APART = 1e-3  # of the first frame's size: so far apart in a frame, vertices are not one
NUDGE = 2e-4  # likewise, what keeps them apart in the first; above what is taken for a crack
ONE_MESH = "the frames of a sequence are one mesh that deforms, with the same faces"


def load_sequence(paths: Sequence[str | Path]) -> list[Surface]:
    """Read the frames of a mesh that deforms: files of one mesh's faces with other vertices.

    The first frame says how all are centred and scaled, mended, cut into triangles and split at
    creases: faces and vertices are the same in all frames, in the same order, and what keeps still
    keeps still. What touches in the first frame and parts in a later one is not joined.

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
    if not paths:
        raise ValueError("a sequence has 1 frame or more")
    first = read_mesh(paths[0])
    shapes = [first.vertices]
    for path in paths[1:]:
        found = read_mesh(path)
        check_same_faces(path, found, paths[0], first)
        check_finite(path, found)
        shapes.append(found.vertices)
    with _blaming(paths[0]):
        cleaned, origin = clean_sequence(first, shapes)
    surfaces = []
    for path, vertices in zip(paths, shapes, strict=True):
        with _blaming(path):
            moved = (vertices[origin] - cleaned.centre) / cleaned.scale
            centre_and_scale(moved)  # which refuses what has no size
            surfaces.append(measured(cleaned, moved, part_names=first.part_names))
    return surfaces


@contextlib.contextmanager
def _blaming(path: str | Path) -> Iterator[None]:
    """Name a file in the warnings and the ValueErrors of what is done within."""
    try:
        with naming(path):
            yield
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def clean_sequence(first: Triangles, shapes: Sequence[np.ndarray]) -> tuple[Cleaned, np.ndarray]:
    """Clean the first frame of a sequence, so that what it joins stays together in all.

    Parameters
    ----------
    shapes : vertices (V, 3) of each frame, the first one's first

    Returns
    -------
    It, and which vertex of the file each of its vertices was, (V',) int.

    Raises ValueError as `make_surface` does.
    """
    vertices = first.vertices
    for _ in range(3):  # what is kept apart at one vertex may show what another joins
        cleaned = clean(vertices, first.faces, part=first.part, polygon=first.polygon)
        joined = Joined.of(vertices, first.faces, cleaned)
        # faces that lie on each other are dropped, and so not among what was joined
        same = np.stack([np.arange(len(vertices)), first_at_place(vertices)])
        pairs = np.concatenate([joined.pairs, same[:, np.unique(first.faces)]], axis=1)
        parting = parted(pairs, shapes, APART * cleaned.scale)
        if not parting.any():
            break
        vertices = nudged(first, parting)
    return cleaned, joined.origin


class Joined(NamedTuple):
    """Which vertices of a file became which of the cleaned mesh.

    Parameters
    ----------
    origin : (V',) int, the vertex that each of the cleaned mesh was: where several lie at one
        place, one that a face of its own has
    pairs : (2, M) int, vertices of the file, and the `origin` of what they were joined to
    """

    origin: np.ndarray
    pairs: np.ndarray

    @classmethod
    def of(cls, vertices: np.ndarray, faces: np.ndarray, cleaned: Cleaned) -> Joined:
        """Find them by where the corners of the cleaned faces were in the faces of the file."""
        place = (vertices - cleaned.centre) / cleaned.scale
        own = faces[cleaned.kept]
        away = np.stack(
            [
                [np.abs(place[c] - cleaned.vertices[corner]).max(axis=1) for c in own.T]
                for corner in cleaned.faces.T
            ],
            axis=1,
        )  # corner of the file's face, corner of the cleaned one, face
        old = np.take_along_axis(own.T, away.argmin(axis=0), axis=0).ravel()
        new, gap = cleaned.faces.T.ravel(), away.min(axis=0).ravel()
        order = np.lexsort((old, gap, new))
        _, first = np.unique(new[order], return_index=True)
        origin = np.zeros(len(cleaned.vertices), np.int64)
        origin[new[order][first]] = old[order][first]
        near = gap <= NUDGE  # others were stitched on, or lie where another face has its corner
        return cls(origin, np.unique(np.stack([old, origin[new]])[:, near], axis=1))


def parted(pairs: np.ndarray, shapes: Sequence[np.ndarray], limit: float) -> np.ndarray:
    """Find the vertices (V,) bool of pairs (2, M) that some frame shows further apart."""
    found = np.zeros(len(shapes[0]), bool)
    one, other = pairs[:, pairs[0] != pairs[1]]
    for vertices in shapes[1:]:
        apart = np.abs(vertices[one] - vertices[other]).max(axis=1, initial=0.0) > limit
        found[one[apart]] = found[other[apart]] = True
    return found


def nudged(mesh: Triangles, which: np.ndarray) -> np.ndarray:
    """Move vertices (V,) bool of a mesh a little into their own faces, and to their front."""
    _, _, size = centre_and_scale(mesh.vertices[np.unique(mesh.faces)])
    corners = mesh.vertices[mesh.faces]
    normal = unit_rows(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    inwards, front = np.zeros_like(mesh.vertices), np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(inwards, mesh.faces[:, corner], corners.mean(axis=1) - corners[:, corner])
        np.add.at(front, mesh.faces[:, corner], normal)
    step = unit_rows(inwards) + 0.5 * unit_rows(front)
    step[row_dot(step, step) == 0.0] = 1.0
    return mesh.vertices + np.where(which[:, None], NUDGE * size * step, 0.0)


def check_finite(path: str | Path, mesh: Triangles) -> None:
    """Raise ValueError, naming the file, unless the vertices of all faces are numbers."""
    bad = ~np.isfinite(mesh.vertices[np.unique(mesh.faces)]).all(axis=1)
    if bad.any():
        raise ValueError(
            f"{path}: {bad.sum()} of its vertices have coordinates that are not finite numbers"
        )


def check_same_faces(
    path: str | Path, found: Triangles, first_path: str | Path, first: Triangles
) -> None:
    """Raise ValueError, naming both files, unless their faces join the same vertices.

    A polygon may be cut into other triangles: that goes by its shape, which changes.
    """
    for name, here, there in (
        ("faces", _count(found), _count(first)),
        ("vertices", len(found.vertices), len(first.vertices)),
    ):
        if here != there:
            raise ValueError(
                f"{path}: has {here} {name}, the first frame {first_path} has {there}: {ONE_MESH}"
            )
    if np.array_equal(found.faces, first.faces):
        return
    if not np.array_equal(_corners(found), _corners(first)):
        raise ValueError(
            f"{path}: its faces join other vertices than those of the first frame {first_path}: "
            f"{ONE_MESH} in the same order"
        )


def _count(mesh: Triangles) -> int:
    """How many faces the file has, cut into triangles or not."""
    return len(mesh.faces) if mesh.polygon is None else len(np.unique(mesh.polygon))


def _corners(mesh: Triangles) -> np.ndarray:
    """List the vertices of each polygon, (M, 2): polygon and vertex, sorted."""
    polygon = np.arange(len(mesh.faces))
    if mesh.polygon is not None:
        polygon = np.unique(mesh.polygon, return_inverse=True)[1]
    return np.unique(np.stack([np.repeat(polygon, 3), mesh.faces.ravel()], axis=1), axis=0)
