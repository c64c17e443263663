"""What follows from the triangles of a mesh alone: which faces meet where, and at what angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .creases import creases
from .normals import surface_normals
from .triangles import Edges, FaceShapes, bends, clashes, face_normals, polygon_normals


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
    known_creases: dict[float, np.ndarray] = field(default_factory=dict)

    def is_of(self, vertices: np.ndarray, faces: np.ndarray, weld: np.ndarray) -> bool:
        """Tell whether it is of these very arrays."""
        return self.vertices is vertices and self.faces is faces and self.weld is weld

    @cached_property
    def edges(self) -> Edges:
        """The edges of the welded mesh."""
        if self.known_edges is not None:
            return self.known_edges
        return Edges.of(self.weld[self.faces], len(self.vertices))

    def split(self, faces: np.ndarray, weld: np.ndarray) -> Connectivity:
        """Make that of the same faces, vertices repeated along some edges: `weld` as a surface's.

        Vertices had none of their place before. What depends on places alone stays known.
        """
        after = replace(
            self, vertices=self.vertices[weld], faces=faces, weld=weld, known_edges=self.edges
        )
        for name in ("clashing_edges", "normals", "bends"):
            if name in self.__dict__:
                after.__dict__[name] = self.__dict__[name]
        return after

    @property
    def is_uncut(self) -> bool:
        """No two vertices lie at one place."""
        return np.array_equal(self.weld, np.arange(len(self.weld)))

    @cached_property
    def own_ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The edges of the mesh as it is cut open, vertices at one place being several: the ends
        (E', 2) of all, and the vertices (R,) on boundaries, ascending."""
        if self.is_uncut:
            return self.edges.ends, self.edges.rim
        if (self.edges.uses > 2).any():
            own = Edges.of(self.faces, len(self.vertices))
            return own.ends, own.rim
        return self._ends_of_sides()

    def _ends_of_sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Give `own_ends` where no more than two faces meet in an edge.

        An edge that is cut is two, one of either face, and no other is cut: a fraction of the time
        that it takes to sort all sides.
        """
        one, two = self.edges.sides.T
        cut, boundary = self.cut_edges, self.edges.uses == 1
        side = np.concatenate([one, two[cut]])
        corner, after = self.faces.ravel(), side + 1
        after[side % 3 == 2] -= 3
        ends = np.stack([corner.take(at) for at in (side, after)]).astype(np.int32)
        boundary[cut] = True
        on_rim = np.zeros(len(self.vertices), bool)
        on_rim[ends[:, : len(one)][:, boundary]] = on_rim[ends[:, len(one) :]] = True
        return ends.T, np.flatnonzero(on_rim)

    @cached_property
    def vertex_normals(self) -> np.ndarray:
        """(V, 3), unit: see `surface_normals`."""
        return surface_normals(self.vertices, self.faces, self.own_ends[1])

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
    def normals(self) -> tuple[np.ndarray, np.ndarray]:
        """(3, F), unit: of the faces, and of the polygons that they were cut from."""
        return self._normals_of(FaceShapes.of(self.vertices, self.faces))

    def keep_normals(self, shape: FaceShapes) -> None:
        """Take the normals from shapes that the faces had before they were moved or scaled."""
        vars(self)["normals"] = self._normals_of(shape)

    def _normals_of(self, shape: FaceShapes) -> tuple[np.ndarray, np.ndarray]:
        normal = face_normals(shape, self.edges)
        if self.polygon is None:
            return normal, normal
        return normal, polygon_normals(shape, normal, self.polygon)

    @cached_property
    def face_normals(self) -> np.ndarray:
        rows = np.ascontiguousarray(self.normals[0].T)
        if "bends" in self.__dict__:
            vars(self).pop("normals")  # large, and both that follow from it are known
        return rows

    @cached_property
    def bends(self) -> np.ndarray:
        found = bends(self.normals[1], self.edges, self.clashing_edges, self.polygon)
        if "face_normals" in self.__dict__:
            vars(self).pop("normals")  # large, and both that follow from it are known
        return found

    def creases(self, angle: float) -> np.ndarray:
        """Find the creases of more than `angle` degrees, (E,) bool: see `creases.creases`."""
        if angle not in self.known_creases:
            found = creases(self.vertices, self.edges, self.bends, np.radians(angle))
            self.known_creases[angle] = found
        return self.known_creases[angle]

    @cached_property
    def mean_edge(self) -> float:
        total, (a, b) = np.zeros(len(self.edges)), self.edges.ends.T
        for axis in (0, 2, 1):  # in the order of row_dot
            along = self.vertices[:, axis].take(a)
            along -= self.vertices[:, axis].take(b)
            along *= along
            total += along
        return float(np.sqrt(total, out=total).mean())

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
