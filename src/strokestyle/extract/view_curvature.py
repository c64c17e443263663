"""Measure the curvature of a surface as an eye sees it, per vertex."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..mesh.surface import Surface
from ..mesh.triangles import row_dot
from .eye import at_infinity, towards

EDGE_ON = 1e-12  # n.v, up to rounding, of a face that is seen along itself


class SomeVertices:
    """What is measured at some vertices of a surface, (n, ...) each, as `Surface` has it.

    It is taken, and where nothing asked for it yet worked out, when it is asked for.
    """

    vertices: np.ndarray
    normals: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    pdir1: np.ndarray
    pdir2: np.ndarray
    dcurv: np.ndarray

    def __init__(self, surface: Surface, vertex: np.ndarray) -> None:
        self._surface, self._vertex = surface, vertex

    def __getattr__(self, name: str) -> np.ndarray:
        if name not in SomeVertices.__annotations__:
            raise AttributeError(f"'SomeVertices' object has no attribute {name!r}")
        surface, vertex = self._surface, self._vertex
        if name == "dcurv":
            self.dcurv = surface.dcurv_at(vertex)
        elif name in ("vertices", "normals"):
            vars(self)[name] = getattr(surface, name)[vertex]
        else:
            self.k1, self.k2, self.pdir1, self.pdir2 = surface.curvature_at(vertex)
        return vars(self)[name]


@dataclass(frozen=True)
class VertexFields:
    """What V vertices look like from an eye.

    Parameters
    ----------
    seen : what they are vertices of
    to_eye : (V, 3), the direction to the eye, unit
    n_dot_v : (V,), cosine between the normal and that direction
    """

    seen: Surface | SomeVertices
    to_eye: np.ndarray
    n_dot_v: np.ndarray

    @cached_property
    def u(self) -> np.ndarray:
        """(V,), the component of the direction to the eye along pdir1."""
        return row_dot(self.to_eye, self.seen.pdir1)

    @cached_property
    def v(self) -> np.ndarray:
        """(V,), that along pdir2."""
        return row_dot(self.to_eye, self.seen.pdir2)

    @classmethod
    def at(cls, surface: Surface | SomeVertices, eye: np.ndarray) -> VertexFields:
        """Look at vertices from an eye, in the surface's own frame.

        `eye` : (3,), or (4,) in homogeneous coordinates, as `Camera.viewpoint` has it. Where that
        is at infinity, what is seen exactly edge-on counts as turned away: walls seen along
        themselves are common there.
        """
        to_eye = towards(eye, surface.vertices)
        to_eye /= np.maximum(np.sqrt(row_dot(to_eye, to_eye)), 1e-30)[:, None]
        n_dot_v = row_dot(to_eye, surface.normals)
        if at_infinity(eye):
            n_dot_v = np.where(np.abs(n_dot_v) < EDGE_ON, -EDGE_ON, n_dot_v)
        return cls(surface, to_eye, n_dot_v)

    def radial_curvature(self, surface: Surface | SomeVertices) -> np.ndarray:
        """Measure the radial curvature, times the squared length of the projected view, (V,).

        The radial curvature kr of DeCarlo et al. 2003 is the normal curvature along the projected
        view direction. The factor keeps it finite and smooth where the view is along the normal,
        and leaves its zeros where they are.
        """
        return surface.k1 * self.u**2 + surface.k2 * self.v**2

    def radial_curvature_at(self, surface: Surface, vertex: np.ndarray) -> np.ndarray:
        """Measure the same at some vertices of a surface, (n,) int, alone: 0 at others, (V,)."""
        k1, k2, *axes = surface.curvature_at(vertex)
        u, v = (row_dot(self.to_eye[vertex], axis) for axis in axes)
        radial = np.zeros(len(self.n_dot_v))
        radial[vertex] = k1 * u**2 + k2 * v**2
        return radial

    def radial_derivative_at(self, surface: Surface, vertex: np.ndarray) -> np.ndarray:
        """Measure `radial_derivative` at some vertices, (n,) int, alone: 0 at others, (V,)."""
        some = SomeVertices(surface, vertex)
        view = VertexFields(some, self.to_eye[vertex], self.n_dot_v[vertex])
        derivative = np.zeros(len(self.n_dot_v))
        derivative[vertex] = view.radial_derivative(some)
        return derivative

    def radial_derivative(self, surface: Surface | SomeVertices) -> np.ndarray:
        """Differentiate the radial curvature along the projected view direction, (V,).

        It is taken times that projection's length. DeCarlo et al. 2003, with the derivative tensor
        C of Rusinkiewicz 2004: C(w, w, w) + 2 n.v tau^2 in rtsc's signs.
        """
        u, v = self.u, self.v
        square = np.maximum(u * u + v * v, 1e-12)
        p, q, r, s = surface.dcurv.T
        cubic = (u * u * (u * p + 3.0 * v * q) + v * v * (3.0 * u * r + v * s)) / square
        torsion = (surface.k2 - surface.k1) * u * v / square
        return cubic - 2.0 * self.n_dot_v * torsion**2

    def view_curvature(self, surface: Surface | SomeVertices) -> tuple[np.ndarray, np.ndarray]:
        """Measure the largest squared curvature seen in the image, (V,), and its direction, (V, 3).

        It is the largest squared singular value of Judd et al. 2007's view-dependent curvature
        Q = S P^-1, where S is the shape operator and P projects to the image: P^-1 stretches by
        1 / n.v along the projected view direction. The direction lies in the tangent plane, in
        world coordinates.
        """
        a, b, c = self._squared_curvature(surface)
        angle = 0.5 * np.arctan2(2.0 * b, a - c)
        direction = np.cos(angle)[:, None] * surface.pdir1 + np.sin(angle)[:, None] * surface.pdir2
        return _largest(a, b, c), direction

    def largest_view_curvature(self, surface: Surface | SomeVertices) -> np.ndarray:
        """Measure that curvature without its direction, (V,)."""
        return _largest(*self._squared_curvature(surface))

    def _squared_curvature(
        self, surface: Surface | SomeVertices
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Work out Q'Q of `view_curvature` in the principal directions: its uu, uv, vv, (V,)."""
        square = self.u**2 + self.v**2
        stretch = (1.0 / np.maximum(np.abs(self.n_dot_v), 1e-6) - 1.0) / np.maximum(square, 1e-12)
        stretch = np.where(square > 1e-12, stretch, 0.0)
        uu, uv, vv = stretch * self.u**2, stretch * self.u * self.v, stretch * self.v**2
        k1, k2 = surface.k1, surface.k2
        q11, q12, q21, q22 = k1 * (1.0 + uu), k1 * uv, k2 * uv, k2 * (1.0 + vv)
        return q11**2 + q21**2, q11 * q12 + q21 * q22, q12**2 + q22**2


def _largest(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Find the larger eigenvalue of symmetric matrices (a, b; b, c), (V,)."""
    return 0.5 * (a + c) + np.sqrt(b**2 + 0.25 * (a - c) ** 2)


@dataclass(frozen=True)
class ViewFields(VertexFields):
    """What a surface looks like from an eye, per vertex.

    Parameters
    ----------
    closed_faces : (F,) bool, faces of which only the outside can be seen: those of components
        without boundary, unless the eye is inside
    """

    closed_faces: np.ndarray

    @classmethod
    def of(cls, surface: Surface, eye: np.ndarray) -> ViewFields:
        """Look at all of a surface as `at` does at some of its vertices."""
        seen = VertexFields.at(surface, eye)
        return cls(surface, seen.to_eye, seen.n_dot_v, closed_from(surface, eye))

    def closed_vertices(self, surface: Surface) -> np.ndarray:
        """Tell which vertices of the surface have nothing but `closed_faces`, (V,) bool."""
        closed = np.ones(len(surface.vertices), bool)
        closed[surface.faces[~self.closed_faces]] = False
        return closed


def closed_from(surface: Surface, eye: np.ndarray) -> np.ndarray:
    """Find the faces of which an eye, (3,) or (4,), can see only the outside, (F,) bool.

    They are those of components without boundary that do not wind round the eye: one inside a room
    sees its walls from within. Solid angles after Van Oosterom and Strackee 1983.
    """
    closed = surface.closed_faces
    if at_infinity(eye) or np.abs(eye[:3]).max() > 0.5 or not closed.any():  # outside its box
        return closed
    face = np.flatnonzero(closed)
    a, b, c = (surface.vertices[corner] - eye[:3] for corner in surface.faces[face].T)
    x, y, z = (np.sqrt(row_dot(p, p)) for p in (a, b, c))
    volume = row_dot(a, np.cross(b, c))
    rest = x * y * z + row_dot(a, b) * z + row_dot(b, c) * x + row_dot(c, a) * y
    turns = np.bincount(surface.component[face], np.arctan2(volume, rest)) / (2.0 * np.pi)
    around = np.zeros(surface.component.max() + 1, bool)
    around[: len(turns)] = np.abs(turns) > 0.5
    return closed & ~around[surface.component]
