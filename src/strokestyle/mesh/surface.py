"""Surface: a shape's triangles and all that is measured on them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from .curvature import differential_geometry
from .read import read_mesh
from .repair import (
    centre_and_scale,
    drop_unused_vertices,
    faces_to_flip,
    split_at_creases,
    weld_vertices,
)
from .triangles import Edges, clashes, face_normals, row_dot

DEFAULT_CREASE = 40.0  # degrees between two faces


@dataclass(frozen=True, eq=False)
class Surface:
    """A clean triangle mesh, box centred at the origin, longest side 1, with rtsc's conventions of sign.

    Normals point outward on closed parts, curvature is positive where the surface is convex, and |k1| >= |k2|.
    Along creases each side has vertices, normals and curvatures of its own; `weld` tells which lie at one place. Edges
    and what follows from them (boundaries, components) are those of the welded mesh.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64, counter-clockwise seen from outside
    normals, pdir1, pdir2 : (V, 3) float64, an orthonormal right-handed frame (pdir1, pdir2, normal)
    k1, k2 : (V,) float64, principal curvatures along pdir1 and pdir2
    dcurv : (V, 4) float64, derivative of the second fundamental form: its uuu, uuv, uvv, vvv entries in (pdir1, pdir2)
    feature_size : float, the length in which line thresholds are measured
    centre, scale : the file's coordinates are vertices * scale + centre
    part, part_names : (F,) int, index into the names of a scene's parts
    weld : (V,) int, the first vertex at each vertex's place

    Raises
    ------
    ValueError
        on a wrong shape, a value that is not finite, or a face that names no vertex.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    pdir1: np.ndarray
    pdir2: np.ndarray
    dcurv: np.ndarray
    feature_size: float
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0
    part: np.ndarray | None = None
    part_names: tuple[str, ...] = ("",)
    weld: np.ndarray | None = None

    def __post_init__(self):
        faces = np.asarray(self.faces, np.int64)
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise ValueError(
                f"Surface.faces must have shape (F, 3) with at least one face, got {faces.shape}"
            )
        count = len(self.vertices)
        if faces.min() < 0 or faces.max() >= count:
            raise ValueError(
                f"Surface.faces must lie in 0..{count - 1}, got {faces.min()}..{faces.max()}"
            )
        part = (
            np.zeros(len(faces), np.int64) if self.part is None else np.asarray(self.part, np.int64)
        )
        if part.shape != (len(faces),) or part.min() < 0 or part.max() >= len(self.part_names):
            raise ValueError(
                f"Surface.part must have shape ({len(faces)},) and lie in 0..{len(self.part_names) - 1}"
            )
        weld = np.arange(count) if self.weld is None else np.asarray(self.weld, np.int64)
        if weld.shape != (count,) or (weld > np.arange(count)).any() or weld.min() < 0:
            raise ValueError(f"Surface.weld must have shape ({count},) and name no later vertex")
        values = {"faces": faces, "part": part, "weld": weld}
        shapes = {"vertices": 3, "normals": 3, "k1": 0, "k2": 0, "pdir1": 3, "pdir2": 3, "dcurv": 4}
        for name, width in shapes.items():
            value = np.asarray(getattr(self, name), np.float64)
            expected = (count, width) if width else (count,)
            if value.shape != expected:
                raise ValueError(f"Surface.{name} must have shape {expected}, got {value.shape}")
            values[name] = value
        values["centre"] = np.array(self.centre, np.float64)
        for name, value in values.items():
            if not np.isfinite(value).all():
                raise ValueError(f"Surface.{name} holds values that are not finite")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        for name in ("feature_size", "scale"):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"Surface.{name} must be a positive number, got {value}")
            object.__setattr__(self, name, value)
        object.__setattr__(self, "part_names", tuple(self.part_names))

    @cached_property
    def _edges(self) -> Edges:
        return Edges.of(self.weld[self.faces], len(self.vertices))

    @property
    def edges(self) -> np.ndarray:
        """(E, 2) int, the welded vertices of each edge, the lower index first."""
        return self._edges.ends

    @property
    def face_edges(self) -> np.ndarray:
        """(F, 3) int, face_edges[f, i] is the edge from corner i to corner i + 1 of face f."""
        return self._edges.of_side

    @property
    def edge_face_count(self) -> np.ndarray:
        """(E,) int, faces at each edge: 1 on a boundary, 2 inside, more where the mesh is not a manifold."""
        return self._edges.uses

    @cached_property
    def edge_faces(self) -> np.ndarray:
        """(E, 2) int, the first two faces of each edge; -1 where there is no second."""
        return self._edges.faces

    @cached_property
    def cut_edges(self) -> np.ndarray:
        """Indices of the edges between two faces, each of which has vertices of its own there."""
        repeated = np.bincount(self.weld, minlength=len(self.vertices)) > 1
        inner = np.flatnonzero(
            (self.edge_face_count == 2) & (repeated[self.edges[:, 0]] | repeated[self.edges[:, 1]])
        )
        near, far = (self.faces[face[:, None], corner] for face, corner in self.edge_corners(inner))
        return inner[(near != far).any(axis=1)]

    def edge_corners(self, edge: np.ndarray):
        """For the first, then the second face at edges (M,): the face (M,), its corners (M, 2) at the edge's ends."""
        for at in self._edges.sides[edge].T:
            face, side = np.divmod(at, 3)
            after = (side + 1) % 3
            forward = self.weld[self.faces[face, side]] == self.edges[edge, 0]
            yield (
                face,
                np.stack([np.where(forward, side, after), np.where(forward, after, side)], axis=1),
            )

    @cached_property
    def clashing_edges(self) -> np.ndarray:
        """(E,) bool, edges of two faces that both run the same way along it: no winding agrees there."""
        return clashes(self.weld[self.faces], self._edges)

    @cached_property
    def face_normals(self) -> np.ndarray:
        """(F, 3) float64, unit; faces too thin to have a normal have that of the face at their longest side."""
        return face_normals(self.vertices, self.faces, self._edges)

    @cached_property
    def mean_edge(self) -> float:
        """Mean edge length."""
        a, b = self.edges.T
        along = self.vertices[a] - self.vertices[b]
        return float(np.sqrt(row_dot(along, along)).mean())

    @cached_property
    def component(self) -> np.ndarray:
        """(F,) int, the connected component (through shared edges) of each face."""
        return self._edges.components()

    @cached_property
    def closed_faces(self) -> np.ndarray:
        """(F,) bool, faces of components without boundary: only their outside can be seen."""
        open_edge = self.edge_face_count == 1
        open_component = np.zeros(self.component.max() + 1, bool)
        open_component[self.component[self._edges.at_face(open_edge)]] = True
        return ~open_component[self.component]

    @cached_property
    def closed_vertices(self) -> np.ndarray:
        """(V,) bool, vertices all of whose faces belong to components without boundary."""
        closed = np.ones(len(self.vertices), bool)
        closed[self.faces[~self.closed_faces]] = False
        return closed

    def smoothed(self, edges: float) -> Surface:
        """The same mesh with normals and curvatures smoothed over `edges` mean edge lengths; its vertices stay."""
        names = ("normals", "k1", "k2", "pdir1", "pdir2", "dcurv", "feature_size")
        known = self._edges if np.array_equal(self.weld, np.arange(len(self.weld))) else None
        values = differential_geometry(self.vertices, self.faces, edges, edges=known)
        other = replace(self, **dict(zip(names, values, strict=True)))
        shape_only = {
            name for name, value in vars(type(self)).items() if isinstance(value, cached_property)
        }
        other.__dict__.update(
            {name: value for name, value in self.__dict__.items() if name in shape_only}
        )
        return other

    def original(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 3) of this surface -> the coordinates of the file it came from."""
        return np.asarray(points, np.float64) * self.scale + self.centre


def load_surface(path: str | Path, smooth: float = 0.0, crease: float = DEFAULT_CREASE) -> Surface:
    """Read a mesh file of any format that `read_mesh` knows; scenes become one surface with named parts.

    `smooth` : standard deviation, in mean edge lengths, of the smoothing of normals and curvatures.
    `crease` : angle in degrees between two faces from which on normals and curvatures do not run over their edge.

    Raises OSError where the file cannot be opened, ValueError where it holds no surface; either names the file.
    """
    found = read_mesh(path)
    try:
        return make_surface(
            found.vertices, found.faces, smooth, crease, found.part, found.part_names
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def make_surface(
    vertices: np.ndarray,
    faces: np.ndarray,
    smooth: float = 0.0,
    crease: float = DEFAULT_CREASE,
    part: np.ndarray | None = None,
    part_names: tuple[str, ...] = ("",),
    rtsc: bool = False,
) -> Surface:
    """Clean a triangle soup and measure it.

    Parameters
    ----------
    vertices : (V, 3) float, any unit and position
    faces : (F, 3) int
    smooth : float, standard deviation in mean edge lengths of the smoothing of normals and curvatures
    crease : float, degrees between two faces from which on nothing runs over their edge; 180 for never
    part, part_names : the named part that each face belongs to
    rtsc : reproduce rtsc 1.6 to the last digit, its faults included (see differential_geometry)

    Vertices at one place become one; faces without area and repeated faces go; winding is made to agree within each
    component, outward where it is closed; vertices along creases are repeated. Vertex order is kept, repeated vertices
    come last. Raises ValueError where no surface is left.
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"vertices must have shape (V, 3), got {vertices.shape}")
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise ValueError(f"faces must have shape (F, 3) with at least one face, got {faces.shape}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(
            f"faces name vertex {faces.min() if faces.min() < 0 else faces.max()} of {len(vertices)}"
        )
    if not (np.isfinite(smooth) and 0.0 <= smooth <= 100.0):
        raise ValueError(f"smooth must lie between 0 and 100 mean edges, got {smooth}")
    if not 0.0 < crease <= 180.0:
        raise ValueError(f"crease must be an angle of up to 180 degrees, got {crease}")
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    bad = used & ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise ValueError(
            f"{bad.sum()} of {used.sum()} vertices have coordinates that are not finite numbers"
        )
    part = np.zeros(len(faces), np.int64) if part is None else np.asarray(part, np.int64)
    points, faces = drop_unused_vertices(vertices, faces)
    points, centre, scale = centre_and_scale(points)
    points, faces, part = weld_vertices(points, faces, part)
    edges = Edges.of(faces, len(points))
    turn = faces_to_flip(points, faces, edges)
    faces, edges = np.where(turn[:, None], faces[:, ::-1], faces), edges.turned(turn)
    points, moved_centre, moved_scale = centre_and_scale(
        points
    )  # dropped faces may have held the box open
    faces, weld = split_at_creases(points, faces, edges, crease)
    vertices = points[weld]
    whole = edges if len(weld) == len(points) else None
    surface = Surface(
        vertices,
        faces,
        *differential_geometry(vertices, faces, smooth, rtsc, whole),
        centre=centre + scale * moved_centre,
        scale=scale * moved_scale,
        part=part,
        part_names=part_names,
        weld=weld,
    )
    surface.__dict__["_edges"] = edges  # as worked out already
    return surface
