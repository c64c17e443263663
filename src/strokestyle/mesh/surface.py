"""Surface: a shape's triangles and all that is measured on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .connectivity import Connectivity
from .curvature import Curvature, curvature_of
from .messages import naming
from .normals import vertex_normals
from .planes import Plane
from .read import read_mesh
from .repair import (
    centre_and_scale,
    faces_to_flip,
    left_out,
    mend,
    split_at_creases,
)
from .weld import drop_unused_vertices

DEFAULT_CREASE = 40.0  # degrees between two faces
MAX_SMOOTH = 100.0  # mean edges


_WIDTHS = {"vertices": 3, "normals": 3, "k1": 0, "k2": 0, "pdir1": 3, "pdir2": 3, "dcurv": 4}
_MEASURED = ("k1", "k2", "pdir1", "pdir2", "dcurv", "feature_size")  # from normals and faces


def _nothing() -> np.ndarray:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Surface:
    """A clean triangle mesh, box centred at the origin, longest side 1.

    Signs are those of rtsc: normals point outward on closed parts, curvature is positive where the
    surface is convex, and |k1| >= |k2|. Along creases each side has vertices, normals and
    curvatures of its own; `weld` tells which lie at one place. Edges and what follows from them
    (boundaries, components) are those of the welded mesh.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64, counter-clockwise seen from outside
    normals, pdir1, pdir2 : (V, 3) float64, an orthonormal right-handed frame (pdir1, pdir2, normal)
    k1, k2 : (V,) float64, principal curvatures along pdir1 and pdir2
    dcurv : (V, 4) float64, derivative of the second fundamental form: its uuu, uuv, uvv, vvv
        entries in (pdir1, pdir2)
    feature_size : float, the length in which line thresholds are measured
    centre, scale : the file's coordinates are vertices * scale + centre
    part, part_names : (F,) int, index into the names of a scene's parts; by default all faces are
        of the first
    polygon : (F,) int, which polygon of the file each face was cut from; by default each is one
    weld : (V,) int, the first vertex at each vertex's place; by default no two lie at one
    turned : (F,) bool, faces that the file winds the other way round; by default none
    section : where a surface comes from that was cut open, its box no longer the frame's
    connectivity : what follows from vertices, faces and weld, where it is known already

    In place of each of k1, k2, pdir1, pdir2, dcurv and feature_size, a `Curvature` may be given,
    the same for all: they are worked out when they are asked for.

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
    part: np.ndarray = field(default_factory=_nothing)
    part_names: tuple[str, ...] = ("",)
    polygon: np.ndarray = field(default_factory=_nothing)
    weld: np.ndarray = field(default_factory=_nothing)
    turned: np.ndarray = field(default_factory=_nothing)
    section: Section | None = field(default=None, compare=False, repr=False)
    # None only until __post_init__ has made one
    connectivity: Connectivity = field(  # type: ignore[assignment]
        default=None, compare=False, repr=False
    )

    def __post_init__(self) -> None:
        count = len(self.vertices)
        faces = _checked_faces(self.faces, count)
        integers = {
            "faces": faces,
            "part": _checked_part(self.part, len(faces), len(self.part_names)),
            "polygon": _checked_polygon(self.polygon, len(faces)),
            "weld": _checked_weld(self.weld, count),
            "turned": _checked_turned(self.turned, len(faces)),
        }
        centre = np.array(self.centre, np.float64)
        for name, value in {**integers, "centre": _finite("centre", centre)}.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        known = self.k1
        if isinstance(known, Curvature):
            object.__setattr__(self, "_curvature", known)
            for name in _MEASURED:
                object.__delattr__(self, name)
        for name in ("vertices", "normals", "scale", *_MEASURED):
            if name in self.__dict__:
                self._keep(name, self.__dict__[name])
        object.__setattr__(self, "part_names", tuple(self.part_names))
        shape = self.vertices, self.faces, self.weld
        if self.connectivity is None or not self.connectivity.is_of(*shape):
            object.__setattr__(
                self, "connectivity", Connectivity(*shape, polygon=integers["polygon"])
            )

    def _keep(self, name: str, value: np.ndarray | float) -> None:
        """Keep a field at the vertices, or a positive number, once it is checked."""
        if name in ("feature_size", "scale"):
            value = float(value)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"Surface.{name} must be a positive number, got {value}")
        else:
            value, width = np.asarray(value, np.float64), _WIDTHS[name]
            expected = (len(self.vertices), width) if width else (len(self.vertices),)
            if value.shape != expected:
                raise ValueError(f"Surface.{name} must have shape {expected}, got {value.shape}")
            _finite(name, value).setflags(write=False)
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> np.ndarray | float:
        """Work out what is measured, where it is asked for the first time."""
        if name not in _MEASURED or "_curvature" not in self.__dict__:
            raise AttributeError(f"'Surface' object has no attribute {name!r}")
        self._keep(name, getattr(self.__dict__["_curvature"], name))
        if all(known in self.__dict__ for known in _MEASURED):
            object.__delattr__(self, "_curvature")
        return self.__dict__[name]

    def curvature_at(self, vertex: np.ndarray) -> tuple[np.ndarray, ...]:
        """Take k1, k2 (n,), pdir1 and pdir2 (n, 3) at some vertices, an index (n,).

        They are worked out there alone, where nothing asked for all of them yet.
        """
        pending, names = self.__dict__.get("_curvature"), ("k1", "k2", "pdir1", "pdir2")
        if pending is None or all(name in self.__dict__ for name in names):
            return tuple(getattr(self, name)[vertex] for name in names)
        return pending.at(vertex)

    def dcurv_at(self, vertex: np.ndarray) -> np.ndarray:
        """Take dcurv (n, 4) at some vertices, an index (n,): worked out there alone, as above."""
        pending = self.__dict__.get("_curvature")
        if "dcurv" in self.__dict__ or pending is None:
            return self.dcurv[vertex]
        return pending.dcurv_at(vertex)

    @property
    def edges(self) -> np.ndarray:
        """(E, 2) int, the welded vertices of each edge, the lower index first."""
        return self.connectivity.edges.ends

    @property
    def face_edges(self) -> np.ndarray:
        """(F, 3) int, face_edges[f, i] is the edge from corner i to corner i + 1 of face f."""
        return self.connectivity.edges.of_side

    @property
    def edge_face_count(self) -> np.ndarray:
        """(E,) int, faces at each edge: 1 on a boundary, 2 inside, more where it is no manifold."""
        return self.connectivity.edges.uses

    @property
    def edge_faces(self) -> np.ndarray:
        """(E, 2) int, the first two faces of each edge; -1 where there is no second."""
        return self.connectivity.edge_faces

    @property
    def cut_edges(self) -> np.ndarray:
        """Indices of the edges between two faces, each of which has vertices of its own there."""
        return self.connectivity.cut_edges

    def edge_corners(self, edge: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield for the first, then the second face at edges (M,): the face (M,), and its corners
        (M, 2) at the edge's ends."""
        return self.connectivity.edge_corners(edge)

    @property
    def clashing_edges(self) -> np.ndarray:
        """(E,) bool, edges along which both faces run the same way: no winding agrees there."""
        return self.connectivity.clashing_edges

    @property
    def face_normals(self) -> np.ndarray:
        """(F, 3) float64, unit; faces too thin to have a normal have that of the face at their
        longest side."""
        return self.connectivity.face_normals

    @property
    def edge_bends(self) -> np.ndarray:
        """(E,) float64, the angle between the two faces at each edge, radians; 0 on a boundary,
        where more faces meet, and within one polygon of the file."""
        return self.connectivity.bends

    @property
    def mean_edge(self) -> float:
        """Mean edge length."""
        return self.connectivity.mean_edge

    @property
    def component(self) -> np.ndarray:
        """(F,) int, the connected component (through shared edges) of each face."""
        return self.connectivity.component

    @property
    def closed_faces(self) -> np.ndarray:
        """(F,) bool, faces of components without boundary: only their outside can be seen."""
        return self.connectivity.closed_faces

    @property
    def closed_vertices(self) -> np.ndarray:
        """(V,) bool, vertices all of whose faces belong to components without boundary."""
        return self.connectivity.closed_vertices

    def smoothed(self, edges: float) -> Surface:
        """Smooth normals and curvatures over `edges` mean edge lengths; the vertices stay."""
        mesh = self.connectivity
        found = curvature_of(
            self.vertices, self.faces, mesh.vertex_normals, mesh.own_ends[0], edges
        )
        return replace(self, normals=found.normals, **_later(found))

    def with_faces(self, keep: np.ndarray) -> Surface:
        """Take the faces of a mask (F,) alone, with all that was measured on them, in their place.

        The frame stays that of the whole: the box is no longer that of the surface. Raises
        ValueError where no face is left.
        """
        old, corner = np.unique(self.faces[keep], return_inverse=True)
        _, first, place = np.unique(self.weld[old], return_index=True, return_inverse=True)
        fields = ("vertices", "normals", "k1", "k2", "pdir1", "pdir2", "dcurv")
        return replace(
            self,
            **{name: getattr(self, name)[old] for name in fields},
            faces=corner.reshape(-1, 3),
            part=self.part[keep],
            polygon=self.polygon[keep],
            weld=first[place],
            turned=self.turned[keep],
            connectivity=None,  # type: ignore[arg-type]
        )

    def turned_over(self, faces: np.ndarray) -> Surface:
        """Turn over whole components, faces of a mask (F,): inside out, with all that is measured.

        Vertices stay; those of `faces` must be used by no others.
        """
        vertex = np.zeros(len(self.vertices), bool)
        vertex[self.faces[faces]] = True
        sign = np.where(vertex, -1.0, 1.0)
        return replace(
            self,
            faces=np.where(faces[:, None], self.faces[:, ::-1], self.faces),
            normals=sign[:, None] * self.normals,
            k1=sign * self.k1,
            k2=sign * self.k2,
            pdir2=sign[:, None] * self.pdir2,
            # v is turned as well, so that entries with an odd number of it stay
            dcurv=np.where(vertex[:, None], [-1.0, 1.0, -1.0, 1.0], 1.0) * self.dcurv,
            turned=self.turned ^ faces,
            connectivity=None,  # type: ignore[arg-type]
        )

    def original(self, points: np.ndarray) -> np.ndarray:
        """Bring points (N, 3) of this surface into the coordinates of the file it came from."""
        return np.asarray(points, np.float64) * self.scale + self.centre


@dataclass(frozen=True, eq=False)
class Section:
    """Where a surface that is left of a whole one comes from.

    Parameters
    ----------
    whole : the surface before the cut
    planes : that cut it
    source : (F,) int, the face of the whole that each face is a piece of; -1 on caps
    origin : (V,) int, the vertex of the whole that each vertex is; -1 for new ones
    rim : (M,) int, the edges of what is left along which it was cut
    """

    whole: Surface
    planes: tuple[Plane, ...]
    source: np.ndarray
    origin: np.ndarray
    rim: np.ndarray


def _later(found: Curvature) -> dict[str, Any]:
    """Give a surface's fields that are worked out when they are asked for."""
    return dict.fromkeys(_MEASURED, found)


def _finite(name: str, value: np.ndarray) -> np.ndarray:
    if not np.isfinite(value).all():
        raise ValueError(f"Surface.{name} holds values that are not finite")
    return value


def _checked_faces(faces: np.ndarray, vertices: int) -> np.ndarray:
    faces = np.asarray(faces, np.int64)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise ValueError(
            f"Surface.faces must have shape (F, 3) with at least one face, got {faces.shape}"
        )
    low, high = faces.min(), faces.max()
    if low < 0 or high >= vertices:
        raise ValueError(f"Surface.faces must lie in 0..{vertices - 1}, got {low}..{high}")
    return faces


def _checked_part(part: np.ndarray, faces: int, names: int) -> np.ndarray:
    part = np.asarray(part, np.int64) if np.size(part) else np.zeros(faces, np.int64)
    if part.shape != (faces,) or part.min() < 0 or part.max() >= names:
        raise ValueError(f"Surface.part must have shape ({faces},) and lie in 0..{names - 1}")
    return part


def _checked_polygon(polygon: np.ndarray, faces: int) -> np.ndarray:
    polygon = polygon if np.size(polygon) else np.arange(faces)
    return _one_per_face("Surface.polygon", polygon, faces)


def _checked_turned(turned: np.ndarray, faces: int) -> np.ndarray:
    turned = turned if np.size(turned) else np.zeros(faces, bool)
    return _one_per_face("Surface.turned", turned, faces).astype(bool)


def _checked_weld(weld: np.ndarray, vertices: int) -> np.ndarray:
    own = np.arange(vertices)
    weld = np.asarray(weld, np.int64) if np.size(weld) else own
    if weld.shape != (vertices,) or (weld > own).any() or weld.min() < 0:
        raise ValueError(f"Surface.weld must have shape ({vertices},) and name no later vertex")
    return weld


def load_surface(path: str | Path, smooth: float = 0.0, crease: float = DEFAULT_CREASE) -> Surface:
    """Read a mesh file of any format; scenes become one surface with named parts.

    Parameters
    ----------
    smooth : standard deviation, in mean edge lengths, of the smoothing of normals and curvatures
    crease : angle in degrees between two faces from which on normals and curvatures do not run over
        their edge

    Raises
    ------
    OSError
        where the file cannot be opened
    ValueError
        where it holds no surface; either names the file.
    """
    found = read_mesh(path)
    try:
        with naming(path):
            return make_surface(
                found.vertices,
                found.faces,
                smooth,
                crease,
                found.part,
                found.part_names,
                polygon=found.polygon,
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
    polygon: np.ndarray | None = None,
) -> Surface:
    """Clean a triangle soup and measure it.

    Vertices at one place become one; faces without area and repeated faces go; winding is made to
    agree within each component, outward where it is closed; vertices along creases are repeated.
    Vertex order is kept, repeated vertices come last.

    Parameters
    ----------
    vertices : (V, 3) float, any unit and position
    faces : (F, 3) int
    smooth : float, standard deviation in mean edge lengths of the smoothing of normals and
        curvatures
    crease : float, degrees between two faces from which on nothing runs over their edge; 180 for
        never
    part, part_names : the named part that each face belongs to
    rtsc : reproduce rtsc 1.6 to the last digit, its faults included (see differential_geometry)
    polygon : (F,) int, which polygon each face was cut from: an edge within one is no edge of the
        shape; by default each face is one

    Raises
    ------
    ValueError
        on a wrong shape or number, or where no surface is left.
    """
    if not (np.isfinite(smooth) and 0.0 <= smooth <= MAX_SMOOTH):
        raise ValueError(f"smooth must lie between 0 and {MAX_SMOOTH:g} mean edges, got {smooth}")
    cleaned = clean(vertices, faces, crease, part, polygon, stitched=not rtsc)
    return measured(cleaned, cleaned.vertices, smooth, part_names, rtsc)


class Cleaned(NamedTuple):
    """A triangle soup made fit to be measured.

    Parameters
    ----------
    vertices : (V, 3) float64, box centre 0 and longest side 1
    faces, part, polygon, weld, turned, centre, scale : as `Surface` has them
    kept : (F,) int, the face given that each was, or was cut from
    connectivity : of these vertices
    """

    vertices: np.ndarray
    faces: np.ndarray
    part: np.ndarray
    polygon: np.ndarray
    weld: np.ndarray
    turned: np.ndarray
    centre: np.ndarray
    scale: float
    kept: np.ndarray
    connectivity: Connectivity


def clean(
    vertices: np.ndarray,
    faces: np.ndarray,
    crease: float = DEFAULT_CREASE,
    part: np.ndarray | None = None,
    polygon: np.ndarray | None = None,
    stitched: bool = True,
) -> Cleaned:
    """Clean a triangle soup, without measuring it; arguments and errors as of `make_surface`.

    `stitched` : look for T-junctions, and part sheets
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    _check_soup(vertices, faces)
    if not 0.0 < crease <= 180.0:
        raise ValueError(f"crease must be an angle of up to 180 degrees, got {crease}")
    part = _one_per_face("part", np.zeros(len(faces)) if part is None else part, len(faces))
    polygon = np.arange(len(faces)) if polygon is None else polygon
    polygon = _one_per_face("polygon", polygon, len(faces))
    far = left_out(vertices, faces)
    given = np.arange(len(faces)) if far is None else np.flatnonzero(~far)
    points, faces = drop_unused_vertices(vertices, faces if far is None else faces[given])
    points, centre, scale = centre_and_scale(points)
    soup = mend(points, faces, stitched)
    kept, faces, edges = given[soup.kept], soup.faces, soup.edges
    polygon = polygon[kept]
    turn = faces_to_flip(soup)
    if turn.any():
        faces, edges = np.where(turn[:, None], faces[:, ::-1], faces), edges.turned(turn)
    # once more: faces that were dropped may have held the box open
    points, moved_centre, moved_scale = centre_and_scale(soup.points)
    whole = Connectivity(points, faces, np.arange(len(points)), edges, polygon)
    if not turn.any():  # then it is known from before
        vars(whole)["clashing_edges"] = soup.clashing_edges
        whole.keep_normals(soup.shape)
    del soup
    mesh = split_at_creases(whole, crease)
    vars(edges).pop("beyond", None)  # large, and of use for mending alone
    return Cleaned(
        mesh.vertices,
        mesh.faces,
        part[kept],
        polygon,
        mesh.weld,
        turn,
        centre + scale * moved_centre,
        scale * moved_scale,
        kept,
        mesh,
    )


def measured(
    cleaned: Cleaned,
    vertices: np.ndarray,
    smooth: float = 0.0,
    part_names: tuple[str, ...] = ("",),
    rtsc: bool = False,
) -> Surface:
    """Measure a cleaned mesh whose vertices lie at `vertices` (V, 3), in the cleaned one's frame.

    Arguments and errors are those of `make_surface`.
    """
    faces, weld, mesh = cleaned.faces, cleaned.weld, cleaned.connectivity
    if vertices is not mesh.vertices:
        mesh = Connectivity(vertices, faces, weld, mesh.edges, cleaned.polygon)
    normals = mesh.vertex_normals if not rtsc else vertex_normals(vertices, faces)
    found = curvature_of(vertices, faces, normals, mesh.own_ends[0], smooth, rtsc)
    return Surface(
        vertices,
        faces,
        found.normals,
        **_later(found),
        centre=cleaned.centre,
        scale=cleaned.scale,
        part=cleaned.part,
        part_names=part_names,
        polygon=cleaned.polygon,
        weld=weld,
        turned=cleaned.turned,
        connectivity=mesh,
    )


def _one_per_face(name: str, value: np.ndarray, faces: int) -> np.ndarray:
    value = np.asarray(value).astype(np.int64)
    if value.shape != (faces,):
        raise ValueError(f"{name} must have shape ({faces},), got {value.shape}")
    return value


def _check_soup(vertices: np.ndarray, faces: np.ndarray) -> None:
    """Raise ValueError unless faces (F, 3) name vertices (V, 3) whose coordinates are finite."""
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"vertices must have shape (V, 3), got {vertices.shape}")
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise ValueError(f"faces must have shape (F, 3) with at least one face, got {faces.shape}")
    low, high = faces.min(), faces.max()
    if low < 0 or high >= len(vertices):
        raise ValueError(f"faces name vertex {low if low < 0 else high} of {len(vertices)}")
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    bad = used & ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise ValueError(
            f"{bad.sum()} of {used.sum()} vertices have coordinates that are not finite numbers"
        )
