"""Measure the normals of a mesh at its vertices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..geometry.curves import owner, runs, take_ragged
from .triangles import (
    TINY,
    any_corner,
    column_cross,
    column_dot,
    columns,
    in_order,
    row_dot,
    scatter_sum,
    side_vectors,
    sum_at_corners,
    tangent_frame,
    unit_rows,
)

HUB = 64  # faces round a vertex, more than which are a fan rather than a surface round a point
RING_PAIRS = 1 << 20  # pairs of a vertex and a face near it that are looked at in one go
MAX_EXTRAPOLATED = 30.0  # degrees that an extrapolated normal may turn from the averaged one


def surface_normals(
    vertices: np.ndarray, faces: np.ndarray, rim: np.ndarray, rtsc: bool = False
) -> np.ndarray:
    """Measure the normals at the vertices, unit (V, 3): averaged, on a rim extrapolated.

    `rim` (R,) are the vertices on boundaries and creases; `rtsc` : as rtsc has them, averaged all
    """
    normals = vertex_normals(vertices, faces)
    return normals if rtsc else _extrapolate_boundary_normals(vertices, faces, normals, rim)


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Average face normals at the vertices, unit (V, 3).

    They are weighted as in Max 1999, which is exact for points on a sphere.
    """
    points = columns(vertices)

    def weighted(corner: np.ndarray) -> list[np.ndarray]:
        side = side_vectors(points, corner.T)
        cross = column_cross(side[0], side[1])
        square = [np.maximum(column_dot(s, s), TINY) for s in side]
        weight = np.stack([1.0 / (square[i - 2] * square[i - 1]) for i in range(3)])
        return [weight * axis for axis in cross]

    normals = sum_at_corners(faces, len(vertices), 3, weighted).T.copy()
    length = np.sqrt(row_dot(normals, normals))
    lost = np.flatnonzero(~(length > 1e-12))
    if len(lost):  # faces that cancel, folded onto each other: any one of their normals will do
        face = np.zeros(len(vertices), np.int64)
        face[faces.ravel()] = np.repeat(np.arange(len(faces)), 3)
        side = side_vectors(points, faces[face[lost]])
        normals[lost] = column_cross(side[0], side[1]).T
    return unit_rows(normals)


def _extrapolate_boundary_normals(
    vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, rim: np.ndarray
) -> np.ndarray:
    """Extrapolate the normals on boundaries and creases instead of averaging: all of them (V, 3).

    `rim` (R,) are the vertices on them.

    A vertex with faces on one side only has the normal of a place half an edge away, which spoils
    the curvature for two rings of vertices. There the face normals of two rings, each true at its
    centroid, are fitted by a linear field.
    """
    if not len(rim):
        return normals
    normals, near = normals.copy(), np.zeros(len(vertices), bool)
    near[rim] = True
    near[faces[any_corner(faces, near)]] = True
    faces = faces[any_corner(faces, near)]
    for some, vertex, face in _two_rings(faces, rim, len(vertices)):
        fitted = _fitted_normals(vertices, faces[face], vertex, normals[some], vertices[some])
        good = row_dot(fitted, normals[some]) > np.cos(np.radians(MAX_EXTRAPOLATED))
        normals[some[good]] = fitted[good]
    return normals


def _fitted_normals(
    vertices: np.ndarray, corners: np.ndarray, vertex: np.ndarray, axis: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Fit linear fields of normals round places `at` (M, 3): the unit normals there, (M, 3).

    Parameters
    ----------
    corners : (P, 3) int, faces
    vertex : (P,) int, the place that each of them tells of
    axis : (M, 3) unit normals, across which the fields change
    """
    corner = columns(corners)
    place = [axis.take(corner) for axis in vertices.T]
    first, second = (np.stack([p[i] - p[j] for p in place]) for i, j in ((2, 1), (0, 2)))
    cross = column_cross(first, second)
    area = np.sqrt(column_dot(cross, cross))
    cross /= np.maximum(area, TINY)
    away = [
        (p[0] + p[1] + p[2]) / 3.0 - own.take(vertex) for p, own in zip(place, at.T, strict=True)
    ]
    x, y = (
        column_dot(away, [one.take(vertex) for one in tangent])
        for tangent in tangent_frame(columns(axis))
    )
    return _fit_linear(vertex, x, y, area, cross, len(at))


def _two_rings(
    faces: np.ndarray, chosen: np.ndarray, vertices: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pair `chosen` vertices (M,) with the faces within two rings, some vertices at a time.

    The second ring is not sought beyond a vertex of more than HUB faces, such as the middle of a
    fan: each of its neighbours would be paired with all of the fan.

    Yields
    ------
    the vertices (m,), and pairs of an index into them and a face, (P,) each: about RING_PAIRS
    """
    vertex, corner = in_order(faces.ravel())
    face_at, offsets = corner // 3, np.searchsorted(vertex, np.arange(vertices + 1))
    valence = np.diff(offsets)
    passed = np.where(valence <= HUB, valence, 0)
    within = 1 + passed[faces].sum(axis=1)  # faces that are found through each
    rows, ends = take_ragged(offsets, chosen)
    pairs = np.bincount(owner(ends), within[face_at[rows]], len(chosen))
    part = np.cumsum(pairs) // RING_PAIRS
    for some in np.split(chosen, np.flatnonzero(np.diff(part)) + 1):
        rows, ends = take_ragged(offsets, some)
        first, own = owner(ends), face_at[rows]
        ring = np.repeat(first, 3) * vertices + faces[own].ravel()
        ring = _different(ring[passed[faces[own].ravel()] > 0])
        through, beside = np.divmod(ring, vertices)
        rows, ends = take_ragged(offsets, beside)
        found = through[owner(ends)] * len(faces) + face_at[rows]
        found = _different(np.concatenate([first * len(faces) + own, found]))
        yield some, *np.divmod(found, len(faces))


def _different(values: np.ndarray) -> np.ndarray:
    """Sort values (N,), and leave out all but one of those that are equal."""
    values = np.sort(values)
    return values[runs(values)[:-1]]


def _fit_linear(
    vertex: np.ndarray, x: np.ndarray, y: np.ndarray, area: np.ndarray, unit: np.ndarray, count: int
) -> np.ndarray:
    """Fit unit normals by linear fields in the tangent planes of `count` vertices: values there.

    Parameters
    ----------
    vertex : (P,) int, the vertex that a pair of it and a face belongs to
    x, y : (P,), the face's centroid in the vertex's tangent plane
    area : (P,) weight of the face
    unit : (3, P) its normal
    """
    left, right = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    weights = area, area * x, area * y
    for i, weight in enumerate(weights):
        for j, field in enumerate((None, x, y)[: i + 1]):
            total = scatter_sum(vertex, weight if field is None else weight * field, count)
            left[:, i, j] = left[:, j, i] = total
        for j, axis in enumerate(unit):
            right[:, i, j] = scatter_sum(vertex, weight * axis, count)
    # faces in a row tell nothing across it: no slope then
    spread = 1e-6 * (left[:, 1, 1] + left[:, 2, 2]) + TINY
    left[:, 1, 1] += spread
    left[:, 2, 2] += spread
    return unit_rows(np.linalg.solve(left + np.diag([TINY, 0, 0]), right)[:, 0])
