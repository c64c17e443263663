"""What follows from the triangles of a mesh alone: which faces meet where, and at what angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .triangles import Edges, bends, clashes, face_normals, polygon_normals, row_dot


@dataclass(frozen=True, eq=False)
class Connectivity:
    """Which faces of a mesh meet at which edges.

    Each answer is worked out once, when it is asked for.
    Surfaces of the same triangles share one, whatever normals and curvatures they have.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64
    weld : (V,) int64, the first vertex at each vertex's place
    known_edges : the edges of weld[faces], where they are known already
    polygon : (F,) int64, which polygon each face was cut from; by default each is one
    """

    vertices: np.ndarray
    faces: np.ndarray
    weld: np.ndarray
    known_edges: Edges | None = None
    polygon: np.ndarray | None = None

    def is_of(self, vertices: np.ndarray, faces: np.ndarray, weld: np.ndarray) -> bool:
        """Tell whether it is of these very arrays."""
        return self.vertices is vertices and self.faces is faces and self.weld is weld

    @cached_property
    def edges(self) -> Edges:
        """The edges of the welded mesh."""
        if self.known_edges is not None:
            return self.known_edges
        return Edges.of(self.weld[self.faces], len(self.vertices))

    @property
    def is_uncut(self) -> bool:
        """No two vertices lie at one place."""
        return np.array_equal(self.weld, np.arange(len(self.weld)))

    @cached_property
    def edge_faces(self) -> np.ndarray:
        return self.edges.faces

    @cached_property
    def cut_edges(self) -> np.ndarray:
        ends = self.edges.ends
        repeated = np.bincount(self.weld, minlength=len(self.vertices)) > 1
        inner = np.flatnonzero(
            (self.edges.uses == 2) & (repeated[ends[:, 0]] | repeated[ends[:, 1]])
        )
        near, far = (self.faces[face[:, None], corner] for face, corner in self.edge_corners(inner))
        return inner[(near != far).any(axis=1)]

    def edge_corners(self, edge: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for at in self.edges.sides[edge].T:
            face, side = np.divmod(at, 3)
            after = (side + 1) % 3
            forward = self.weld[self.faces[face, side]] == self.edges.ends[edge, 0]
            begin, end = np.where(forward, side, after), np.where(forward, after, side)
            yield face, np.stack([begin, end], axis=1)

    @cached_property
    def clashing_edges(self) -> np.ndarray:
        return clashes(self.weld[self.faces], self.edges)

    @cached_property
    def face_normals(self) -> np.ndarray:
        return face_normals(self.vertices, self.faces, self.edges)

    @cached_property
    def bends(self) -> np.ndarray:
        normal = self.face_normals
        if self.polygon is not None:
            normal = polygon_normals(self.vertices, self.faces, normal, self.polygon)
        return bends(normal, self.edges, self.clashing_edges, self.polygon)

    @cached_property
    def mean_edge(self) -> float:
        a, b = self.edges.ends.T
        along = self.vertices[a] - self.vertices[b]
        return float(np.sqrt(row_dot(along, along)).mean())

    @cached_property
    def component(self) -> np.ndarray:
        return self.edges.component

    @cached_property
    def closed_faces(self) -> np.ndarray:
        open_component = np.zeros(self.component.max() + 1, bool)
        open_component[self.component[self.edges.at_face(self.edges.uses == 1)]] = True
        return ~open_component[self.component]

    @cached_property
    def closed_vertices(self) -> np.ndarray:
        closed = np.ones(len(self.vertices), bool)
        closed[self.faces[~self.closed_faces]] = False
        return closed
