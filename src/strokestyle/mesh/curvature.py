"""Measure a mesh: normals, principal curvatures and their derivative, feature size."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix, identity
from scipy.sparse.csgraph import reverse_cuthill_mckee

from .triangles import (
    BLOCK,
    TINY,
    Edges,
    any_corner,
    blocks,
    column_cross,
    column_dot,
    columns,
    row_dot,
    scatter_sum,
    side_vectors,
    unit_rows,
)

Blur = Callable[[np.ndarray], np.ndarray]

CHUNK = 32 * BLOCK  # faces whose corners are summed up in one go: bounds memory
MAX_KEPT = 1 << 19  # faces, of more the frames are set up twice rather than kept: they are large
MIN_SORTED = 8  # steps of smoothing, from which on it pays to put vertices in order
MOST = 0.6  # share of the vertices, of more the derivative is worked out at all
FEW = 0.1  # share of the vertices, of less the curvature is worked out there alone
HUB = 64  # faces round a vertex, more than which are a fan rather than a surface round a point
RING_PAIRS = 1 << 20  # pairs of a vertex and a face near it that are looked at in one go
MAX_EXTRAPOLATED = 30.0  # degrees that an extrapolated normal may turn from the averaged one


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Average face normals at the vertices, unit (V, 3).

    They are weighted as in Max 1999, which is exact for points on a sphere.
    """
    points = columns(vertices)

    def weighted(block: slice) -> np.ndarray:
        side = side_vectors(points, faces[block])
        cross = column_cross(side[0], side[1])
        square = [np.maximum(column_dot(s, s), TINY) for s in side]
        return np.stack([1.0 / (square[i - 2] * square[i - 1]) * cross for i in range(3)], axis=1)

    normals = _sum_at_corners(faces, len(vertices), 3, weighted).T.copy()
    length = np.sqrt(row_dot(normals, normals))
    lost = np.flatnonzero(~(length > 1e-12))
    if len(lost):  # faces that cancel, folded onto each other: any one of their normals will do
        face = np.zeros(len(vertices), np.int64)
        face[faces.ravel()] = np.repeat(np.arange(len(faces)), 3)
        side = side_vectors(points, faces[face[lost]])
        normals[lost] = column_cross(side[0], side[1]).T
    return unit_rows(normals)


def _sum_at_corners(
    faces: np.ndarray,
    vertices: int,
    width: int,
    measure: Callable[[slice], Sequence[np.ndarray] | np.ndarray],
) -> np.ndarray:
    """Sum at the vertices what their faces say of their corners: (width, V).

    `measure` says it of a block of faces: `width` times (3, N), at the three corners of each.
    """
    total = np.zeros((width, vertices))
    for start in range(0, len(faces), CHUNK):
        corner = columns(faces[start : start + CHUNK])
        parts = np.empty((width, *corner.shape))
        for block in blocks(corner.shape[1]):
            found = measure(slice(start + block.start, start + block.stop))
            for part, one in zip(parts, found, strict=True):
                part[:, block] = one
        for one, part in zip(total, parts, strict=True):
            one += scatter_sum(corner.ravel(), part.ravel(), vertices)
    return total


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
    side = side_vectors(columns(vertices), corners)
    cross = column_cross(side[0], side[1])
    area = np.sqrt(column_dot(cross, cross))
    x, y = (columns(tangent) for tangent in _tangent_frame(columns(axis)))
    away = vertices[corners].mean(axis=1) - at[vertex]
    along = row_dot(away, x[vertex]), row_dot(away, y[vertex])
    where = np.stack([np.ones(len(vertex)), *along], axis=1)
    return _fit_linear(vertex, where, area, (cross / np.maximum(area, TINY)).T, len(at))


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
    corner_face = np.repeat(np.arange(len(faces)), 3)
    touches = csr_matrix(
        (np.ones(faces.size, np.float32), (faces.ravel(), corner_face)),
        shape=(vertices, len(faces)),
    )
    valence = np.diff(touches.indptr)
    passed = np.where(valence <= HUB, valence, 0)
    onward = touches.multiply((valence <= HUB)[:, None]).tocsr()
    pairs = touches[chosen] @ (1 + passed[faces].sum(axis=1))
    part = np.cumsum(pairs) // RING_PAIRS
    for some in np.split(chosen, np.flatnonzero(np.diff(part)) + 1):
        own = touches[some]
        found = (own @ onward.T @ onward + own).tocoo()
        yield some, found.row, found.col


def _fit_linear(
    vertex: np.ndarray, at: np.ndarray, area: np.ndarray, unit: np.ndarray, count: int
) -> np.ndarray:
    """Fit unit normals by linear fields in the tangent planes of `count` vertices: values there.

    Parameters
    ----------
    vertex : (P,) int, the vertex that a pair of it and a face belongs to
    at : (P, 3) one, and the face's centroid in the vertex's tangent plane
    area : (P,) weight of the face
    unit : (P, 3) its normal
    """
    left, right = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            left[:, i, j] = scatter_sum(vertex, area * at[:, i] * at[:, j], count)
            right[:, i, j] = scatter_sum(vertex, area * at[:, i] * unit[:, j], count)
    # faces in a row tell nothing across it: no slope then
    spread = 1e-6 * (left[:, 1, 1] + left[:, 2, 2]) + TINY
    left[:, 1, 1] += spread
    left[:, 2, 2] += spread
    return unit_rows(np.linalg.solve(left + np.diag([TINY, 0, 0]), right)[:, 0])


def corner_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Measure the Voronoi area of each corner (F, 3): what of the face is nearest to it.

    An obtuse face is cut by the bisectors of its two shorter sides (Rusinkiewicz 2004), so that no
    share is negative.
    """
    points, areas = columns(vertices), np.empty(faces.shape)
    for block in blocks(len(faces)):
        areas[block] = np.transpose(_block_areas(side_vectors(points, faces[block])))
    return areas


def _block_areas(side: list[np.ndarray]) -> list[np.ndarray]:
    """Measure the Voronoi areas of the three corners, (N,) each, of faces of sides (3, N)."""
    cross = column_cross(side[0], side[1])
    area = 0.5 * np.sqrt(column_dot(cross, cross))
    square = [column_dot(s, s) for s in side]
    # barycentric weights of the circumcentre, which is outside the face where one of them is
    # negative
    weight = [square[i] * (square[i - 2] + square[i - 1] - square[i]) for i in range(3)]
    scale = 0.5 * area / np.maximum(weight[0] + weight[1] + weight[2], TINY)
    areas = [scale * (weight[i - 2] + weight[i - 1]) for i in range(3)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        obtuse = np.flatnonzero(weight[i] <= 0.0)
        s, a = [part[:, obtuse] for part in side], area[obtuse]
        at_j = -0.25 * square[k][obtuse] * a / np.minimum(column_dot(s[i], s[k]), -TINY)
        at_k = -0.25 * square[j][obtuse] * a / np.minimum(column_dot(s[i], s[j]), -TINY)
        areas[j][obtuse], areas[k][obtuse], areas[i][obtuse] = at_j, at_k, a - at_j - at_k
    return areas


def _tangent_frame(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make two unit tangents (3, V) with x cross y = normal, after Duff et al. 2017.

    Without square roots or special cases.
    """
    nx, ny, nz = normals
    sign = np.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (
        np.stack([1.0 + sign * nx * nx * a, sign * b, -sign * nx]),
        np.stack([b, sign + ny * ny * a, -ny]),
    )


def _solve_tridiagonal(diagonal: list, off: list, right: list, rtsc: bool = False) -> list:
    """Solve many small symmetric positive tridiagonal systems; each entry is a row of all.

    `rtsc` : leave the last pivot of 3 x 3 systems as it is, the slip of trimesh2's solver.
    """
    diagonal, right = list(diagonal), list(right)
    last = diagonal[-1]
    for i in range(1, len(diagonal)):
        ratio = off[i - 1] / np.maximum(diagonal[i - 1], TINY)
        diagonal[i] = diagonal[i] - ratio * off[i - 1]
        right[i] = right[i] - ratio * right[i - 1]
    if rtsc and len(diagonal) == 3:
        diagonal[-1] = last
    out = [right[-1] / np.maximum(diagonal[-1], TINY)]
    for i in range(len(diagonal) - 2, -1, -1):
        out.insert(0, (right[i] - off[i] * out[0]) / np.maximum(diagonal[i], TINY))
    return out


class Measures(NamedTuple):
    """What is measured on a mesh; see Surface."""

    normals: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    pdir1: np.ndarray
    pdir2: np.ndarray
    dcurv: np.ndarray
    feature_size: float


class Curvature:
    """Curvatures at the vertices and their derivative, worked out when they are asked for.

    They are as `differential_geometry` says.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int
    normals : (V, 3) float64, unit
    blur : smooths the form
    rtsc : as `differential_geometry` has it
    """

    def __init__(
        self,
        vertices: np.ndarray,
        faces: np.ndarray,
        normals: np.ndarray,
        blur: Blur | None = None,
        rtsc: bool = False,
    ) -> None:
        self.vertices, self.faces, self.normals = vertices, faces, normals
        self.blur, self.rtsc = blur, rtsc
        self.faces_in_place = _PlacedFaces(vertices, faces, normals)

    @cached_property
    def form(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The second fundamental form: its mean (V,) and deviator (V,) complex; and areas (V,)."""
        mean, deviator, area = _vertex_forms(self.faces_in_place, self.rtsc)
        if self.blur is None:
            return mean, deviator, area
        self.faces_in_place.put_away()  # smoothing takes the most memory, and none of that
        x, y = _tangent_frame(columns(self.normals))
        blur, self.blur = self.blur, None
        return *_blur_tensor(blur, mean, deviator, x, y), area

    @cached_property
    def principal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The principal curvatures (V,), and the first's direction (V,) complex."""
        return _principal_curvatures(*self.form[:2])

    @cached_property
    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """The principal directions, (V, 3) each."""
        (x, y), axis = _tangent_frame(columns(self.normals)), self.principal[2]
        one = axis.real * x + axis.imag * y
        two = axis.real * y - axis.imag * x
        return np.ascontiguousarray(one.T), np.ascontiguousarray(two.T)

    def is_local(self, count: int) -> bool:
        """Tell whether curvatures at `count` vertices are sooner worked out there than at all."""
        return self.blur is None and "form" not in vars(self) and count < FEW * len(self.vertices)

    def around(self, vertex: np.ndarray) -> tuple[np.ndarray, ...]:
        """Work out k1, k2 (n,), pdir1 and pdir2 (n, 3) at some vertices, an index (n,).

        Of the faces round them alone, to the last digit as for all. Only where `is_local`.
        """
        chosen = np.zeros(len(self.vertices), bool)
        chosen[vertex] = True
        old, corner = np.unique(self.faces[any_corner(self.faces, chosen)], return_inverse=True)
        some = Curvature(
            self.vertices[old], corner.reshape(-1, 3), self.normals[old], rtsc=self.rtsc
        )
        own = np.searchsorted(old, vertex)
        return some.k1[own], some.k2[own], some.pdir1[own], some.pdir2[own]

    @property
    def k1(self) -> np.ndarray:
        return self.principal[0]

    @property
    def k2(self) -> np.ndarray:
        return self.principal[1]

    @property
    def pdir1(self) -> np.ndarray:
        return self.directions[0]

    @property
    def pdir2(self) -> np.ndarray:
        return self.directions[1]

    @property
    def dcurv(self) -> np.ndarray:
        self._derive(np.ones(len(self.vertices), bool))
        return self._derived[1]

    def dcurv_at(self, vertex: np.ndarray) -> np.ndarray:
        """Differentiate the form at some vertices, an index (n,): (n, 4).

        What is not known there yet is worked out, of the faces round it alone; where that makes
        MOST of the vertices, of all of them.
        """
        wanted = np.zeros(len(self.vertices), bool)
        wanted[vertex] = True
        self._derive(wanted)
        return self._derived[1][vertex]

    def _derive(self, wanted: np.ndarray) -> None:
        """Differentiate the form at the vertices `wanted`, (V,) bool, where it is not known yet."""
        known, found = self._derived
        if known[wanted].all():
            return
        if np.count_nonzero(wanted | known) > MOST * len(known):
            wanted = np.ones(len(known), bool)
        new = np.flatnonzero(wanted & ~known)
        parts = _vertex_derivatives(self.faces_in_place, self.form, new)
        found[new], known[new] = _along(self.principal[2][new], parts), True
        if known.all():
            self.faces_in_place.frames.clear()

    @cached_property
    def _derived(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the derivative is known, (V,) bool, and what it is there, (V, 4)."""
        return np.zeros(len(self.vertices), bool), np.zeros((len(self.vertices), 4))

    @cached_property
    def feature_size(self) -> float:
        return feature_size(self.vertices, self.k1, self.k2, self.rtsc)


def differential_geometry(
    vertices: np.ndarray,
    faces: np.ndarray,
    smooth: float = 0.0,
    rtsc: bool = False,
    edges: Edges | None = None,
) -> Measures:
    """Measure normals, curvatures and their derivative at the vertices, after Rusinkiewicz 2004.

    Least squares on each face fits the second fundamental form to differences of vertex normals,
    and its derivative to differences of vertex curvatures; vertices average their faces by Voronoi
    area after turning each face's plane into their own.

    Tensors turn as complex numbers. Write the angle of a frame as e^(i phi); the form
    [[a, b], [b, c]] is the mean (a + c) / 2, which does not turn, and the deviator
    (a - c) / 2 + i b, which turns by e^(2 i phi). A symmetric derivative tensor
    (p, q, r, s) = uuu, uuv, uvv, vvv is one part turning by e^(i phi) and one by e^(3 i phi).

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int
    smooth : standard deviation, in mean edge lengths, of the smoothing of normals and curvatures
    rtsc : the numbers of rtsc 1.6 to the last digit instead, for comparison with it. It differs
        from the paper in that its 3 x 3 solver skips the last elimination step, which makes
        curvature depend on the order of a face's corners, and in that it estimates the feature size
        from 500 vertices.
    edges : those of the faces, where they are known
    """
    edges = Edges.of(faces, len(vertices)) if edges is None else edges
    normals = surface_normals(vertices, faces, edges.rim, rtsc)
    found = curvature_of(vertices, faces, normals, edges.ends, smooth, rtsc)
    return Measures(found.normals, *(getattr(found, name) for name in Measures._fields[1:]))


def surface_normals(
    vertices: np.ndarray, faces: np.ndarray, rim: np.ndarray, rtsc: bool = False
) -> np.ndarray:
    """Measure the normals at the vertices, unit (V, 3), as `differential_geometry` has them.

    `rim` (R,) are the vertices on boundaries and creases.
    """
    normals = vertex_normals(vertices, faces)
    return normals if rtsc else _extrapolate_boundary_normals(vertices, faces, normals, rim)


def curvature_of(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    ends: np.ndarray,
    smooth: float = 0.0,
    rtsc: bool = False,
) -> Curvature:
    """Smooth normals (V, 3), and prepare to measure curvatures: see `differential_geometry`.

    `ends` : (E, 2) int, of the edges, sorted
    """
    blur = _blur(ends, len(vertices), smooth)
    if blur is not None:
        normals = unit_rows(blur(normals))
    return Curvature(vertices, faces, normals, blur, rtsc)


class _PlacedFaces:
    """The faces of a mesh, from which forms and their derivatives are read block by block.

    Parameters
    ----------
    vertices, normals : (V, 3)
    faces : (F, 3) int
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> None:
        self.vertices, self.faces, self.normals = vertices, faces, normals
        self.frames: dict[int, _FaceFrames] = {}  # by the first face, where there is room for all

    @cached_property
    def points(self) -> np.ndarray:
        """(3, V), the vertices by columns."""
        return columns(self.vertices)

    @cached_property
    def axes(self) -> np.ndarray:
        """(3, V), the normals by columns."""
        return columns(self.normals)

    def put_away(self) -> None:
        """Forget the columns, which are soon laid out again."""
        for name in ("points", "axes"):
            vars(self).pop(name, None)

    def basis(self, faces: np.ndarray) -> tuple[_FaceBasis, list[np.ndarray], _FaceFrames]:
        """Set up bases of faces (3, N), the normals (3, N) at their corners, and their frames."""
        side = side_vectors(self.points, faces.T)
        corner = [self.axes.take(one, axis=1) for one in faces]
        basis = _FaceBasis.of(side)
        return basis, corner, _face_frames(basis, corner, np.stack(_block_areas(side)))

    def frame(self, block: slice, some: np.ndarray, faces: np.ndarray) -> _FaceFrames:
        """Set up the frames of faces (3, N), rows `some` of a block, or take those kept of it."""
        kept = self.frames.get(block.start)
        if kept is None:
            return self.basis(faces)[2]
        if len(some) == kept.u.shape[1]:
            return kept
        return _FaceFrames(*(column.take(some, axis=1) for column in kept))


def _vertex_forms(mesh: _PlacedFaces, rtsc: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Average the second fundamental forms of the faces: mean (V,) and deviator (V,) complex.

    Also returns the area (V,) nearest to each vertex, over which they are averaged.
    """

    def measure(block: slice) -> list[np.ndarray]:
        basis, corner, frame = mesh.basis(columns(mesh.faces[block]))
        if len(mesh.faces) <= MAX_KEPT:
            mesh.frames[block.start] = frame
        mean, deviator = _forms(basis, frame, corner, rtsc)
        return [mean, deviator.real, deviator.imag, frame.area]

    found = _sum_at_corners(mesh.faces, len(mesh.vertices), 4, measure)
    area = np.maximum(found[3], TINY)
    return found[0] / area, (found[1] + 1j * found[2]) / area, area


def _principal_curvatures(
    mean: np.ndarray, deviator: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the principal curvatures off a form: mean +- |deviator|, the larger first.

    Returns k1 and k2 (V,), and the first's direction (V,) complex, along half the deviator's angle.
    """
    spread = np.abs(deviator)
    angle = 0.5 * np.angle(deviator)
    convex = mean >= 0.0
    k1 = np.where(convex, mean + spread, mean - spread)
    k2 = np.where(convex, mean - spread, mean + spread)
    angle = np.where(convex, angle, angle + 0.5 * np.pi)
    return k1, k2, np.exp(1j * angle)


def _vertex_derivatives(
    mesh: _PlacedFaces, form: tuple[np.ndarray, np.ndarray, np.ndarray], vertex: np.ndarray
) -> np.ndarray:
    """Average the derivatives of the form at some vertices, an index (n,), by their areas: (n, 4).

    Of the faces round them alone. They are seen in the vertices' own frames: `_along` turns them.
    `form` : mean (V,), deviator (V,) and area (V,)
    """
    mean, deviator, area = form
    chosen = np.zeros(len(mean), bool)
    chosen[vertex] = True
    total = np.zeros((4, len(mean)))
    for start in range(0, len(mesh.faces), CHUNK):
        corners, parts = [], []
        for block in blocks(min(CHUNK, len(mesh.faces) - start)):
            block = slice(start + block.start, start + block.stop)
            some = np.flatnonzero(any_corner(mesh.faces[block], chosen))
            corner = columns(mesh.faces[block][some])
            frame = mesh.frame(block, some, corner)
            one, three = _derivatives(frame, mean.take(corner), deviator.take(corner))
            corners.append(corner)
            parts.append([one.real, one.imag, three.real, three.imag])
        at = np.concatenate(corners, axis=1).ravel()
        for all_, part in zip(total, zip(*parts, strict=True), strict=True):
            all_ += scatter_sum(at, np.concatenate(part, axis=1).ravel(), len(mean))
    return (total[:, vertex] / area[vertex]).T


def _along(axis: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Turn derivatives (n, 4), two complex parts each, to the principal directions (n,)."""
    one = (parts[:, 0] + 1j * parts[:, 1]) / axis
    three = (parts[:, 2] + 1j * parts[:, 3]) / (axis * axis * axis)
    return np.stack(
        [
            one.real + three.real,
            one.imag / 3.0 + three.imag,
            one.real / 3.0 - three.real,
            one.imag - three.imag,
        ],
        axis=1,
    )


class _FaceBasis(NamedTuple):
    """Orthonormal bases (t, b, n) of some faces, (3, N) each, and their sides in them.

    Parameters
    ----------
    u, v : (3, N), the sides along t and b, side i opposite corner i
    """

    t: np.ndarray
    b: np.ndarray
    n: np.ndarray
    u: np.ndarray
    v: np.ndarray

    @classmethod
    def of(cls, side: list[np.ndarray]) -> _FaceBasis:
        """Set up the bases of faces of sides (3, N)."""
        t, n = _unit(side[0]), _unit(column_cross(side[0], side[1]))
        b = column_cross(n, t)
        u, v = (np.stack([column_dot(s, axis) for s in side]) for axis in (t, b))
        return cls(t, b, n, u, v)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Scale vectors (3, N) to length 1; those of no length stay."""
    return vectors / np.maximum(np.sqrt(column_dot(vectors, vectors)), TINY)


class _FaceFrames(NamedTuple):
    """Some faces in their own planes, and what turns tensors there into those of their corners.

    Parameters
    ----------
    u, v : (3, N), the sides, as in `_FaceBasis`
    turn : (3, N) complex, e^(i phi): t, seen in each corner's frame after the shortest rotation of
        n onto its normal
    area : (3, N), what of the face is nearest to each corner
    weight : (3, N), the same, by which the face counts there: 0 for slivers
    """

    u: np.ndarray
    v: np.ndarray
    turn: np.ndarray
    area: np.ndarray
    weight: np.ndarray


def _face_frames(basis: _FaceBasis, corner: list[np.ndarray], area: np.ndarray) -> _FaceFrames:
    """Turn the bases of faces into the frames of their corners.

    `corner` : the normals (3, N) there; `area` : (3, N), what is nearest to each corner
    """
    t, n, u, v = basis.t, basis.n, basis.u, basis.v
    uu, vv = (u * u).sum(axis=0), (v * v).sum(axis=0)
    # a sliver says nothing across its length: give it no vote
    weight = area * (vv * uu > 1e-16 * (uu + vv) ** 2)
    turn = np.empty(u.shape, complex)
    for i, normal in enumerate(corner):
        tilt = column_dot(t, normal) / np.maximum(1.0 + column_dot(n, normal), 1e-6)
        rotated = t - tilt * n  # less a part along the vertex normal, which x and y do not see
        x, y = _tangent_frame(normal)  # sooner made than fetched
        turn[i].real, turn[i].imag = column_dot(rotated, x), column_dot(rotated, y)
    size = np.abs(turn)
    turn = np.where(size > 1e-9, turn / np.maximum(size, 1e-9), 1.0)
    return _FaceFrames(u, v, turn, area, weight)


def _forms(
    basis: _FaceBasis, frame: _FaceFrames, corner: list[np.ndarray], rtsc: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the second fundamental form of each face: II . side = dn.

    Returns what each corner (3, N) adds to its vertex's form: mean and deviator. `corner` are the
    normals (3, N) there.
    """
    u, v = basis.u, basis.v
    uu, uv, vv = (u * u).sum(axis=0), (u * v).sum(axis=0), (v * v).sum(axis=0)
    dn = [corner[i - 1] - corner[i - 2] for i in range(3)]
    du = np.stack([column_dot(d, basis.t) for d in dn])
    dv = np.stack([column_dot(d, basis.b) for d in dn])
    right = [(du * u).sum(axis=0), (du * v + dv * u).sum(axis=0), (dv * v).sum(axis=0)]
    e, f, g = _solve_tridiagonal([uu, uu + vv, vv], [uv, uv], right, rtsc)
    mean = 0.5 * (e + g) * frame.weight
    deviator = (0.5 * (e - g) + 1j * f) * (frame.turn * frame.turn) * frame.weight
    return mean, deviator


def _derivatives(
    frame: _FaceFrames, mean: np.ndarray, deviator: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the derivative of the form on each face, given the form at the corners (3, N).

    Returns what each corner (3, N) adds to its vertex's tensor: its two parts.
    """
    u, v = frame.u, frame.v
    uu, uv, vv = (u * u).sum(axis=0), (u * v).sum(axis=0), (v * v).sum(axis=0)
    turn_twice = frame.turn * frame.turn
    # differences of the form, seen in the face's frame, along the sides
    seen = deviator * np.conj(turn_twice)
    d_mean = np.stack([mean[i - 1] - mean[i - 2] for i in range(3)])
    d_dev = np.stack([seen[i - 1] - seen[i - 2] for i in range(3)])
    d_uu, d_uv, d_vv = d_mean + d_dev.real, d_dev.imag, d_mean - d_dev.real
    right = [
        (u * d_uu).sum(axis=0),
        (v * d_uu + 2.0 * u * d_uv).sum(axis=0),
        (2.0 * v * d_uv + u * d_vv).sum(axis=0),
        (v * d_vv).sum(axis=0),
    ]
    p, q, r, s = _solve_tridiagonal(
        [uu, 2.0 * uu + vv, uu + 2.0 * vv, vv], [uv, 2.0 * uv, uv], right
    )
    one = (0.75 * ((p + r) + 1j * (q + s))) * frame.turn * frame.weight
    three = (0.25 * ((p - 3.0 * r) + 1j * (3.0 * q - s))) * (turn_twice * frame.turn) * frame.weight
    return one, three


def feature_size(vertices: np.ndarray, k1: np.ndarray, k2: np.ndarray, rtsc: bool = False) -> float:
    """Measure rtsc's unit of length for line thresholds.

    0.01 / (10th percentile of |k1| and |k2|), at most 0.05 of the bounding sphere's radius.
    `rtsc` : over the 500 vertices that its random numbers pick
    """
    if rtsc:
        picked, state = [], 0
        for _ in range(min(len(k1), 500)):
            state = (1664525 * state + 1013904223) % 2**32
            picked.append(state % len(k1))
        k1, k2 = k1[picked], k2[picked]
        low = float(np.sort(np.abs(np.r_[k1, k2]))[2 * len(picked) // 10])
    else:
        low = float(np.percentile(np.abs(np.r_[k1, k2]), 10.0))
    largest = 0.05 * bounding_radius(vertices)
    return min(0.01 / low, largest) if low > 0.01 / largest else largest


def bounding_radius(points: np.ndarray) -> float:
    """Measure the radius of the smallest sphere around points (N, 3), to 1e-6.

    Grows a set of at most four support points by the point farthest outside their smallest sphere.
    """
    support = np.unique(points[[points[:, 0].argmin(), points[:, 0].argmax()]], axis=0)
    for _ in range(100):
        centre, radius, support = _smallest_sphere(support)
        distance = np.linalg.norm(points - centre, axis=1)
        far = int(distance.argmax())
        if distance[far] <= radius * (1.0 + 1e-6) + 1e-12:
            break
        support = np.vstack([support, points[far]])
    return float(distance[far])


def _smallest_sphere(points: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Find the smallest sphere around at most five points, by trying every set that could carry it.

    Returns centre (3,), radius, and the points that carry it.
    """
    best = points[0], np.inf, points[:1]
    for size in range(1, min(len(points), 4) + 1):
        for chosen in combinations(range(len(points)), size):
            carrier = points[list(chosen)]
            rel = carrier[1:] - carrier[0]
            offset = (
                np.linalg.lstsq(2.0 * rel, row_dot(rel, rel), rcond=None)[0]
                if len(rel)
                else np.zeros(3)
            )
            centre = carrier[0] + offset
            radius = np.linalg.norm(points - centre, axis=1).max()
            if radius < best[1] * (1.0 - 1e-9):
                best = centre, radius, carrier
    return best


def _blur(ends: np.ndarray, count: int, smooth: float) -> Blur | None:
    """Make the function that smooths values (V, k) by `smooth` mean edges; None for nothing to do.

    Repeated half-way averaging with the edge neighbours: each step adds a quarter of a squared edge
    of variance.
    """
    if smooth <= 0.0:
        return None
    steps = int(np.ceil(4.0 * smooth**2))
    part = 0.5 * (
        4.0 * smooth**2 / steps
    )  # a little less than half, so that whole steps end where they should
    one = csr_matrix(
        (np.ones(len(ends)), ends[:, 1], np.searchsorted(ends[:, 0], np.arange(count + 1))),
        shape=(count, count),
    )
    step = one + one.T.tocsr()
    degree = np.diff(step.indptr)
    step.data = np.repeat(part / np.maximum(degree, 1), degree)
    step = step + identity(count, format="csr") * (1.0 - part)
    everyone = np.arange(count)
    if steps < MIN_SORTED:
        order = everyone
    else:  # neighbours near each other in memory: twice as fast where the file strews them
        order = reverse_cuthill_mckee(step, symmetric_mode=True)
        step = step[order][:, order]

    def blur(values: np.ndarray) -> np.ndarray:
        values = values[order]
        for _ in range(steps):
            values = step @ values
        out = np.empty_like(values)
        out[order] = values
        return out

    return blur


def _blur_tensor(
    blur: Blur, mean: np.ndarray, deviator: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Smooth the curvature tensor in world coordinates, and read it back in (x, y), (3, V) each.

    There neighbours' frames agree.
    """
    xx, xy, xz = _blur_entries(blur, mean, deviator, x, y, ((0, 0), (0, 1), (0, 2)))
    yy, yz, zz = _blur_entries(blur, mean, deviator, x, y, ((1, 1), (1, 2), (2, 2)))
    rows = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    of_x, of_y = (np.stack([column_dot(row, axis) for row in rows]) for axis in (x, y))
    a, b, c = column_dot(x, of_x), column_dot(x, of_y), column_dot(y, of_y)
    return 0.5 * (a + c), 0.5 * (a - c) + 1j * b


def _blur_entries(
    blur: Blur,
    mean: np.ndarray,
    deviator: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    entries: tuple[tuple[int, int], ...],
) -> np.ndarray:
    """Smooth some entries (i, j) of the tensor in world coordinates, (k, V).

    All six in one go would be the most memory that a large mesh takes.
    """
    a, b, c = mean + deviator.real, deviator.imag, mean - deviator.real
    tensor = np.empty((len(mean), len(entries)))
    for column, (i, j) in zip(tensor.T, entries, strict=True):
        column[:] = a * x[i] * x[j] + b * (x[i] * y[j] + y[i] * x[j]) + c * y[i] * y[j]
    del a, b, c
    return blur(tensor).T
