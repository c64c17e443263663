"""Measure a mesh: principal curvatures and their derivative, feature size."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from .normals import surface_normals
from .smoothing import Blur, smoothing
from .triangles import (
    TINY,
    Edges,
    any_corner,
    blocks,
    column_dot,
    columns,
    distances,
    row_dot,
    sum_at_corners,
    tangent_frame,
    unit_rows,
)

MOST = 0.6  # share of the vertices, of more anything is worked out at all
MANY = 50_000  # faces, from which on single precision will do
SLIVER = 1e-8  # height of a face by its length, of less it says nothing across it
ROUNDINGS = 30.0  # or so many roundings of the numbers that it is measured in
LEAST_PIVOT = 1e-12  # in single precision, of systems of size 1: keeps what is solved finite

Columns = list[np.ndarray]  # x, y, z of vectors: (N,) or (3, N) each, of three corners


class Measures(NamedTuple):
    """What is measured on a mesh; see Surface."""

    normals: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    pdir1: np.ndarray
    pdir2: np.ndarray
    dcurv: np.ndarray
    feature_size: float


class Forms(NamedTuple):
    """Second fundamental forms at V vertices, each in the vertex's tangent frame.

    Parameters
    ----------
    mean : (V,)
    deviator : (V,) complex
    area : (V,), over which they were averaged
    """

    mean: np.ndarray
    deviator: np.ndarray
    area: np.ndarray


class Curvature:
    """Curvatures at the vertices and their derivative, worked out when they are asked for.

    They are as `differential_geometry` says. What is asked of some vertices is worked out there
    alone, to the last digit as for all, and kept; of MOST of them, of all.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int
    normals : (V, 3) float64, unit
    blur : smooths the form, which is then worked out at all vertices
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
        self.normals, self.blur = normals, blur
        self._mesh = _PlacedFaces(vertices, faces, normals, rtsc)

    def form_at(self, wanted: np.ndarray) -> Forms:
        """Work out the form at the vertices `wanted`, (V,) bool, at least."""
        known, form = self._formed
        if self.blur is not None:
            wanted = np.ones_like(known)
        new = _missing(wanted, known)
        if new is None:
            return form
        known |= new
        if not known.all():
            found = _vertex_forms(self._mesh, self._mesh.round(new))
            for column, part in zip(form, found, strict=True):
                column[new] = part[new]
            return form
        del form
        vars(self).pop("_formed")
        form = _vertex_forms(self._mesh)
        if self.blur is not None:
            blur, self.blur = self.blur, None
            form = _blurred(blur, form, columns(self.normals), self._mesh.precision)
        self._formed = known, form
        return form

    @cached_property
    def _formed(self) -> tuple[np.ndarray, Forms]:
        """Where the form is known, (V,) bool, and what it is there."""
        count = len(self.normals)
        form = Forms(np.zeros(count), np.zeros(count, complex), np.zeros(count))
        return np.zeros(count, bool), form

    @cached_property
    def principal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The principal curvatures (V,), and the first's direction (V,) complex."""
        return _principal_curvatures(*self.form_at(np.ones(len(self.normals), bool))[:2])

    @cached_property
    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """The principal directions, (V, 3) each."""
        return _directions(self.normals, self.principal[2])

    def at(self, vertex: np.ndarray) -> tuple[np.ndarray, ...]:
        """Work out k1, k2 (n,), pdir1 and pdir2 (n, 3) at some vertices, an index (n,)."""
        wanted = np.zeros(len(self.normals), bool)
        wanted[vertex] = True
        form = self.form_at(wanted)
        k1, k2, axis = _principal_curvatures(form.mean[vertex], form.deviator[vertex])
        return k1, k2, *_directions(self.normals[vertex], axis)

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
        return self._derivative_at(np.ones(len(self.normals), bool))

    def dcurv_at(self, vertex: np.ndarray) -> np.ndarray:
        """Differentiate the form at some vertices, an index (n,): (n, 4)."""
        wanted = np.zeros(len(self.normals), bool)
        wanted[vertex] = True
        return self._derivative_at(wanted)[vertex]

    def _derivative_at(self, wanted: np.ndarray) -> np.ndarray:
        """Differentiate the form at the vertices `wanted`, (V,) bool, at least: (V, 4)."""
        known, found = self._derived
        new = _missing(wanted, known)
        if new is None:
            return found
        some = self._mesh.round(new)
        near = np.zeros_like(known)
        near[self._mesh.faces[some]] = True
        form, vertex = self.form_at(near), np.flatnonzero(new)
        axis = _principal_curvatures(form.mean[vertex], form.deviator[vertex])[2]
        found[vertex] = _along(axis, _vertex_derivatives(self._mesh, form, some, vertex))
        known |= new
        return found

    @cached_property
    def _derived(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the derivative is known, (V,) bool, and what it is there, (V, 4)."""
        return np.zeros(len(self.normals), bool), np.zeros((len(self.normals), 4))

    @cached_property
    def feature_size(self) -> float:
        return feature_size(self._mesh.vertices, self.k1, self.k2, self._mesh.rtsc)


def _missing(wanted: np.ndarray, known: np.ndarray) -> np.ndarray | None:
    """Tell of which vertices (V,) bool something is yet to be worked out; None of none."""
    new = wanted & ~known
    count = np.count_nonzero(new)
    if not count:
        return None
    return new if count + np.count_nonzero(known) <= MOST * len(known) else ~known


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


def curvature_of(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    ends: np.ndarray,
    smooth: float = 0.0,
    rtsc: bool = False,
) -> Curvature:
    """Smooth normals (V, 3), and prepare to measure curvatures: see `differential_geometry`.

    `ends` : (E, 2) int, of the edges
    """
    blur = smoothing(ends, len(vertices), smooth)
    if blur is not None:
        normals = unit_rows(blur(normals))
    return Curvature(vertices, faces, normals, blur, rtsc)


class _PlacedFaces:
    """The faces of a mesh, from which forms and their derivatives are read block by block.

    From MANY faces on in single precision, in half of the time: what is measured of a face is told
    in lengths of its own, and differences of places and normals are taken before they are rounded.
    rtsc's numbers always take double.

    Parameters
    ----------
    vertices, normals : (V, 3)
    faces : (F, 3) int
    rtsc : as `differential_geometry` has it
    """

    def __init__(
        self, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, rtsc: bool
    ) -> None:
        self.vertices, self.faces, self.normals, self.rtsc = vertices, faces, normals, rtsc
        self.precision = np.dtype(np.float32 if len(faces) >= MANY and not rtsc else np.float64)

    def round(self, vertices: np.ndarray) -> np.ndarray:
        """Find the faces round vertices of a mask (V,): indices."""
        return np.flatnonzero(any_corner(self.faces, vertices))

    def placing(self) -> Callable[[np.ndarray], tuple[_FlatFaces, Columns]]:
        """Make the function that lays faces (3, N) flat, and gives the normals at their corners,
        (3, N) by axis."""
        points, axes = columns(self.vertices), columns(self.normals)

        def placed(corner: np.ndarray) -> tuple[_FlatFaces, Columns]:
            flat = _FlatFaces.of([axis.take(corner) for axis in points], self.precision)
            return flat, [axis.take(corner) for axis in axes]

        return placed


class _FlatFaces(NamedTuple):
    """N faces in their own planes, in lengths of about their longest side.

    Side i is opposite corner i. Side 0 is (along, 0), side 1 (u, v), side 2 what closes the face.

    Parameters
    ----------
    along, u, v : (N,)
    per_length : (N,), one over the length that they are told in
    axes : t, b and n, an orthonormal frame of each, with t along side 0, by axis (N,)
    """

    along: np.ndarray
    u: np.ndarray
    v: np.ndarray
    per_length: np.ndarray
    axes: tuple[Columns, Columns, Columns]

    @classmethod
    def of(cls, place: Columns, precision: np.dtype) -> _FlatFaces:
        """Lay faces flat whose corners lie at `place`, (3, N) by axis, float64."""
        first, second = [p[2] - p[1] for p in place], [p[0] - p[2] for p in place]
        square = column_dot(first, first)
        per_length = 1.0 / np.maximum(np.sqrt(square + column_dot(second, second)), TINY)
        along = np.sqrt(square)
        t = _rounded(first, 1.0 / np.maximum(along, TINY), precision)
        second = _rounded(second, per_length, precision)
        cross = _cross(t, second)
        v = np.sqrt(column_dot(cross, cross))
        over = 1.0 / np.maximum(v, TINY)
        n = [axis * over for axis in cross]
        along, per_length = (x.astype(precision) for x in (along * per_length, per_length))
        return cls(along, column_dot(t, second), v, per_length, (t, _cross(n, t), n))

    def sums(self, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sum values, given at the first two sides, times the sides along t, and along b, (N,).

        Of differences along the sides: those of the third close the sum of all.
        """
        last = first + second
        along = self.along * first + self.u * second + (self.along + self.u) * last
        return along, self.v * (second + last)

    @property
    def squares(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sums over the sides of their squares along t, of the products, and of those along b."""
        last = self.along + self.u
        square = self.along * self.along + self.u * self.u + last * last
        return square, self.v * (self.u + last), 2.0 * self.v * self.v

    def areas(self) -> np.ndarray:
        """Measure the Voronoi areas of the corners, (3, N), in squares of the faces' lengths."""
        last = self.along + self.u
        one = self.u * self.u + self.v * self.v
        square = self.along * self.along, one, last * last + self.v * self.v
        dots = -(one + self.along * self.u), -self.along * last, self.along * self.u  # of others
        # barycentric weights of the circumcentre, which is outside the face where one of them is
        # negative
        weight = [square[i] * (square[i - 2] + square[i - 1] - square[i]) for i in range(3)]
        area = 0.5 * self.along * self.v
        scale = 0.5 * area / np.maximum(weight[0] + weight[1] + weight[2], TINY)
        areas = np.stack([scale * (weight[i - 2] + weight[i - 1]) for i in range(3)])
        quarter = 0.25 * area
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            obtuse = weight[i] <= 0.0
            if not obtuse.any():
                continue
            # a side seen along the longest is no longer than itself, but for rounding in slivers
            at_j = quarter * square[k] / np.maximum(np.maximum(-dots[j], square[k]), TINY)
            at_k = quarter * square[j] / np.maximum(np.maximum(-dots[k], square[j]), TINY)
            areas[j] = np.where(obtuse, at_j, areas[j])
            areas[k] = np.where(obtuse, at_k, areas[k])
            areas[i] = np.where(obtuse, area - at_j - at_k, areas[i])
        return areas


def corner_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Measure the Voronoi area of each corner (F, 3): what of the face is nearest to it.

    An obtuse face is cut by the bisectors of its two shorter sides (Rusinkiewicz 2004), so that no
    share is negative.
    """
    points, areas = columns(vertices), np.empty(faces.shape)
    for block in blocks(len(faces)):
        corner = columns(faces[block])
        flat = _FlatFaces.of([axis.take(corner) for axis in points], np.dtype(np.float64))
        areas[block] = (flat.areas() / flat.per_length**2).T
    return areas


def _rounded(vectors: Columns, by: np.ndarray, precision: np.dtype) -> Columns:
    """Multiply vectors by numbers (N,), and round what comes out."""
    out = [np.empty(axis.shape, precision) for axis in vectors]
    for axis, one in zip(vectors, out, strict=True):
        np.multiply(axis, by, out=one, casting="same_kind")
    return out


def _difference(a: np.ndarray, b: np.ndarray, precision: np.dtype) -> np.ndarray:
    """Take the difference of arrays, and round it."""
    return np.subtract(a, b, out=np.empty(a.shape, precision), casting="same_kind")


def _cross(a: Columns, b: Columns) -> Columns:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def _turns(axes: tuple[Columns, Columns, Columns], normal: Columns) -> np.ndarray:
    """Turn the axes of faces into the frames of their corners: (3, N) complex, e^(i phi).

    That is t, seen in the tangent frame of a corner's `normal` after the shortest rotation of n
    onto it.
    """
    t, _, n = axes
    tilt = column_dot(t, normal) / np.maximum(1.0 + column_dot(n, normal), 1e-6)
    # less a part along the normal, which no tangent sees
    x, y, z = (one - tilt * other for one, other in zip(t, n, strict=True))
    nx, ny, nz = normal
    sign = np.copysign(1.0, nz).astype(nz.dtype, copy=False)
    both = (x * nx + y * ny) / -(sign + nz) - z  # of `tangent_frame`
    x, y = x + sign * nx * both, sign * y + ny * both
    size = np.sqrt(x * x + y * y)
    known, size = size > 1e-9, 1.0 / np.maximum(size, 1e-9)
    turn = np.empty(x.shape, np.result_type(x, np.complex64))
    turn.real, turn.imag = np.where(known, x * size, 1.0), np.where(known, y * size, 0.0)
    return turn


class _Frames(NamedTuple):
    """What turns tensors of N faces into the frames of their corners, and what they count there.

    Parameters
    ----------
    turn : (3, N) complex, as `_turns` has it
    area : (3, N), what of the face is nearest to each corner
    weight : (3, N), the same, by which the face counts there: 0 for slivers
    """

    turn: np.ndarray
    area: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, flat: _FlatFaces, normal: Columns) -> _Frames:
        """Set up those of flat faces with a `normal` at their corners, (3, N) by axis."""
        area = flat.areas() / (flat.per_length * flat.per_length)
        uu, _, vv = flat.squares
        # a sliver says nothing across its length: give it no vote
        least = max(SLIVER, ROUNDINGS * float(np.finfo(uu.dtype).eps)) ** 2
        weight = area * (vv * uu > least * (uu + vv) ** 2)
        return cls(_turns(flat.axes, [axis.astype(uu.dtype) for axis in normal]), area, weight)


def _vertex_forms(mesh: _PlacedFaces, some: np.ndarray | None = None) -> Forms:
    """Average the second fundamental forms of the faces.

    `some` : those faces alone, an index; by default all
    """
    placed = mesh.placing()

    def measure(corner: np.ndarray) -> list[np.ndarray]:
        flat, normal = placed(corner)
        frame = _Frames.of(flat, normal)
        mean, deviator = _forms(flat, normal, mesh.rtsc)
        turned = deviator * (frame.turn * frame.turn * frame.weight)
        return [mean * frame.weight, turned.real, turned.imag, frame.area]

    found = sum_at_corners(mesh.faces, len(mesh.vertices), 4, measure, some)
    area = np.maximum(found[3], TINY)
    return Forms(found[0] / area, (found[1] + 1j * found[2]) / area, area)


def _forms(flat: _FlatFaces, normal: Columns, rtsc: bool) -> tuple[np.ndarray, np.ndarray]:
    """Fit the second fundamental form of each face: II . side = dn, the difference of normals.

    Returns its mean and deviator, (N,). `normal` : (3, N) by axis, at the corners
    """
    precision, (t, b, _) = flat.u.dtype, flat.axes
    first = [_difference(axis[2], axis[1], precision) for axis in normal]
    second = [_difference(axis[0], axis[2], precision) for axis in normal]
    right, more = flat.sums(column_dot(first, t), column_dot(second, t))
    other, last = flat.sums(column_dot(first, b), column_dot(second, b))
    uu, uv, vv = flat.squares
    e, f, g = _solve_tridiagonal([uu, uu + vv, vv], [uv, uv], [right, more + other, last], rtsc)
    return 0.5 * (e + g) * flat.per_length, (0.5 * (e - g) + 1j * f) * flat.per_length


def _blurred(blur: Blur, form: Forms, normals: np.ndarray, precision: np.dtype) -> Forms:
    """Smooth forms in world coordinates, in which the frames of neighbours agree.

    `normals` : (3, V), of the frames; `precision` : of what is smoothed
    """
    entries = [(i, j) for i in range(3) for j in range(i, 3)]
    tensor = np.empty((len(form.mean), len(entries)), precision)
    for block in blocks(len(tensor)):
        x, y = tangent_frame(normals[:, block])
        mean, deviator = form.mean[block], form.deviator[block]
        a, b, c = mean + deviator.real, deviator.imag, mean - deviator.real
        for column, (i, j) in zip(tensor[block].T, entries, strict=True):
            column[:] = a * x[i] * x[j] + b * (x[i] * y[j] + y[i] * x[j]) + c * y[i] * y[j]
    tensor = blur(tensor)
    for block in blocks(len(tensor)):
        x, y = tangent_frame(normals[:, block])
        xx, xy, xz, yy, yz, zz = columns(tensor[block]).astype(np.float64)
        rows = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
        of_x, of_y = ([column_dot(row, axis) for row in rows] for axis in (x, y))
        a, b, c = column_dot(x, of_x), column_dot(x, of_y), column_dot(y, of_y)
        form.mean[block], form.deviator[block] = 0.5 * (a + c), 0.5 * (a - c) + 1j * b
    return form


def _principal_curvatures(
    mean: np.ndarray, deviator: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the principal curvatures off a form: mean +- |deviator|, the larger first.

    Returns k1 and k2 (V,), and the first's direction (V,) complex, along half the deviator's angle.
    """
    spread = np.abs(deviator)
    convex = mean >= 0.0
    signed = np.where(convex, spread, -spread)
    return mean + signed, mean - signed, _half_angle(np.where(convex, deviator, -deviator))


def _half_angle(number: np.ndarray) -> np.ndarray:
    """Halve the angles of complex numbers (V,): unit ones, with real parts of 0 at least."""
    x, y = number.real, number.imag
    longer = np.abs(number) + np.abs(x)
    half = np.empty(number.shape, complex)
    # the number, made as much longer, lies half way between; mirrored where that would cancel
    half.real = np.where(x >= 0.0, longer, np.abs(y))
    half.imag = np.where(x >= 0.0, y, np.copysign(longer, y))
    half[longer == 0.0] = 1.0
    return half / np.abs(half)


def _directions(normals: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place directions (n,) complex in the tangent frames of normals (n, 3), and those across."""
    x, y = tangent_frame(columns(normals))
    one, two = axis.real * x + axis.imag * y, axis.real * y - axis.imag * x
    return np.ascontiguousarray(one.T), np.ascontiguousarray(two.T)


def _vertex_derivatives(
    mesh: _PlacedFaces, form: Forms, some: np.ndarray, vertex: np.ndarray
) -> np.ndarray:
    """Average the derivatives of the form at some vertices, an index (n,), by their areas: (n, 4).

    Of the faces round them, an index `some`. They are seen in the vertices' own frames: `_along`
    turns them.
    """
    placed = mesh.placing()

    def measure(corner: np.ndarray) -> list[np.ndarray]:
        flat, normal = placed(corner)
        frame = _Frames.of(flat, normal)
        one, three = _derivatives(flat, frame, form.mean.take(corner), form.deviator.take(corner))
        return [one.real, one.imag, three.real, three.imag]

    total = sum_at_corners(mesh.faces, len(mesh.vertices), 4, measure, some)
    return (total[:, vertex] / form.area[vertex]).T


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


def _derivatives(
    flat: _FlatFaces, frame: _Frames, mean: np.ndarray, deviator: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the derivative of the form on each face, given the form at the corners (3, N).

    Returns what each corner (3, N) adds to its vertex's tensor: its two parts.
    """
    precision, turn_twice = flat.u.dtype, frame.turn * frame.turn
    # seen in the face's frame
    seen = deviator.astype(turn_twice.dtype) * np.conj(turn_twice)
    d_mean = [_difference(mean[i - 1], mean[i - 2], precision) for i in (0, 1)]
    d_dev = [seen[i - 1] - seen[i - 2] for i in (0, 1)]
    of_uu = flat.sums(*(m + d.real for m, d in zip(d_mean, d_dev, strict=True)))
    of_uv = flat.sums(*(2.0 * d.imag for d in d_dev))
    of_vv = flat.sums(*(m - d.real for m, d in zip(d_mean, d_dev, strict=True)))
    right = [of_uu[0], of_uu[1] + of_uv[0], of_uv[1] + of_vv[0], of_vv[1]]
    uu, uv, vv = flat.squares
    p, q, r, s = _solve_tridiagonal(
        [uu, 2.0 * uu + vv, uu + 2.0 * vv, vv], [uv, 2.0 * uv, uv], right
    )
    weight = frame.turn * (frame.weight * flat.per_length)
    one = (0.75 * (p + r) + 0.75j * (q + s)) * weight
    three = (0.25 * (p - 3.0 * r) + 0.25j * (3.0 * q - s)) * (turn_twice * weight)
    return one, three


def _solve_tridiagonal(diagonal: list, off: list, right: list, rtsc: bool = False) -> list:
    """Solve many small symmetric positive tridiagonal systems; each entry is a row of all.

    `rtsc` : leave the last pivot of 3 x 3 systems as it is, the slip of trimesh2's solver.
    """
    diagonal, right = list(diagonal), list(right)
    least = TINY if right[0].dtype == np.float64 else LEAST_PIVOT
    last = diagonal[-1]
    for i in range(1, len(diagonal)):
        ratio = off[i - 1] / np.maximum(diagonal[i - 1], least)
        diagonal[i] = diagonal[i] - ratio * off[i - 1]
        right[i] = right[i] - ratio * right[i - 1]
    if rtsc and len(diagonal) == 3:
        diagonal[-1] = last
    out = [right[-1] / np.maximum(diagonal[-1], least)]
    for i in range(len(diagonal) - 2, -1, -1):
        out.insert(0, (right[i] - off[i] * out[0]) / np.maximum(diagonal[i], least))
    return out


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
        distance = distances(points, centre)
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
            radius = distances(points, centre).max()
            if radius < best[1] * (1.0 - 1e-9):
                best = centre, radius, carrier
    return best
