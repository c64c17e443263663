"""A triangle mesh and its differential geometry: normals, curvatures, their directions and derivatives, per vertex."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee
from scipy.spatial import cKDTree

from .creases import bends, creases
from .read import read_mesh
from .triangles import Edges, all_corners

DEFAULT_CREASE = 40.0  # degrees between two faces
LONG_EDGE = 0.03  # of the longest side: edges so long that normals must not run from a tip along them
WELD = 1e-6  # of the longest side: boundary vertices nearer than this are one vertex
THIN = 1e-4  # of the longest side: the normal of a lower face is mostly the rounding of its corners
_CELLS = 2**21  # per axis: the grid on which equal positions are found; 3 x 21 bits fit an int64
BLOCK = 8192  # faces measured at a time: what is in between then stays in the processor's cache
MANY_STEPS = 8  # of smoothing, before it pays to put vertices in order
_TINY = 1e-30  # keeps divisions finite; far below any product of lengths on a mesh of size 1


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
            raise ValueError(f"Surface.faces must have shape (F, 3) with at least one face, got {faces.shape}")
        count = len(self.vertices)
        if faces.min() < 0 or faces.max() >= count:
            raise ValueError(f"Surface.faces must lie in 0..{count - 1}, got {faces.min()}..{faces.max()}")
        part = np.zeros(len(faces), np.int64) if self.part is None else np.asarray(self.part, np.int64)
        if part.shape != (len(faces),) or part.min() < 0 or part.max() >= len(self.part_names):
            raise ValueError(f"Surface.part must have shape ({len(faces)},) and lie in 0..{len(self.part_names) - 1}")
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
        inner = np.flatnonzero((self.edge_face_count == 2) & (repeated[self.edges[:, 0]] | repeated[self.edges[:, 1]]))
        near, far = (self.faces[face[:, None], corner] for face, corner in self.edge_corners(inner))
        return inner[(near != far).any(axis=1)]

    def edge_corners(self, edge: np.ndarray):
        """For the first, then the second face at edges (M,): the face (M,), its corners (M, 2) at the edge's ends."""
        for at in self._edges.sides[edge].T:
            face, side = np.divmod(at, 3)
            after = (side + 1) % 3
            forward = self.weld[self.faces[face, side]] == self.edges[edge, 0]
            yield face, np.stack([np.where(forward, side, after), np.where(forward, after, side)], axis=1)

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
        return float(np.sqrt(_dot(along, along)).mean())

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
        shape_only = {name for name, value in vars(type(self)).items() if isinstance(value, cached_property)}
        other.__dict__.update({name: value for name, value in self.__dict__.items() if name in shape_only})
        return other

    def original(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 3) of this surface -> the coordinates of the file it came from."""
        return np.asarray(points, np.float64) * self.scale + self.centre


# ---------------------------------------------------------------------------------------------------- reading


def load_surface(path: str | Path, smooth: float = 0.0, crease: float = DEFAULT_CREASE) -> Surface:
    """Read a mesh file of any format that `mesh_files` knows; scenes become one surface with named parts.

    `smooth` : standard deviation, in mean edge lengths, of the smoothing of normals and curvatures.
    `crease` : angle in degrees between two faces from which on normals and curvatures do not run over their edge.

    Raises OSError where the file cannot be opened, ValueError where it holds no surface; either names the file.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path}: a folder, not a mesh file")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.stat().st_size:
        raise ValueError(f"{path}: the file is empty")
    vertices, faces, part, names = read_mesh(path)
    try:
        return make_surface(vertices, faces, smooth, crease, part, names)
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
        raise ValueError(f"faces name vertex {faces.min() if faces.min() < 0 else faces.max()} of {len(vertices)}")
    if not (np.isfinite(smooth) and 0.0 <= smooth <= 100.0):
        raise ValueError(f"smooth must lie between 0 and 100 mean edges, got {smooth}")
    if not 0.0 < crease <= 180.0:
        raise ValueError(f"crease must be an angle of up to 180 degrees, got {crease}")
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    bad = used & ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise ValueError(f"{bad.sum()} of {used.sum()} vertices have coordinates that are not finite numbers")
    part = np.zeros(len(faces), np.int64) if part is None else np.asarray(part, np.int64)
    points, faces = _compact(vertices, faces)
    points, centre, scale = _normalise(points)
    points, faces, part = _weld(points, faces, part)
    edges = Edges.of(faces, len(points))
    turn = _turn(points, faces, edges)
    faces, edges = np.where(turn[:, None], faces[:, ::-1], faces), edges.turned(turn)
    points, moved_centre, moved_scale = _normalise(points)  # dropped faces may have held the box open
    faces, weld = _cut(points, faces, edges, crease)
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


# ---------------------------------------------------------------------------------------------------- cleaning


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop vertices that no face uses; the others keep their order."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    if used.all():
        return vertices, faces
    return vertices[used], (np.cumsum(used) - 1)[faces]


def _normalise(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Points -> the same with box centre 0 and longest side 1, and the centre and scale that undo it."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre = 0.5 * low + 0.5 * high  # halves first: coordinates may be near the largest float
    scale = float((0.5 * high - 0.5 * low).max())
    if not scale > 0.0:
        raise ValueError("all its points coincide: nothing to draw")
    if not 1e-150 < scale < 1e150:
        raise ValueError(f"its size ({2.0 * scale:g}) cannot be handled: rescale it")
    return (points - centre) / (2.0 * scale), centre, 2.0 * scale


def _weld(points: np.ndarray, faces: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge vertices at one place, then drop faces without area and repeated faces. Longest side must be 1."""
    cell = np.clip(((points + 0.5) * (_CELLS - 1) + 0.5).astype(np.int64), 0, _CELLS - 1)
    key = (cell[:, 0] * _CELLS + cell[:, 1]) * _CELLS + cell[:, 2]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    faces = first[inverse.ravel()][faces]
    points, faces = _compact(points, faces)
    faces, part = _drop_degenerate(points, faces, part)
    # Two nearly equal positions can fall into two cells. Where that tore the mesh, both lie on a boundary.
    edges = Edges.of(faces, len(points))
    open_edges = edges.ends[edges.uses == 1]
    if len(open_edges):
        rim = np.unique(open_edges)
        pairs = cKDTree(points[rim]).query_pairs(WELD, output_type="ndarray")
        if len(pairs):
            links = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(rim), len(rim)))
            group = connected_components(links, directed=False)[1]
            _, first = np.unique(group, return_index=True)
            target = np.arange(len(points))
            target[rim] = rim[first[group]]
            faces, part = _drop_degenerate(points, target[faces], part)
    return *_compact(points, faces), part


def _drop_degenerate(points: np.ndarray, faces: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    p0, p1, p2 = (points[faces[:, i]] for i in range(3))
    longest = np.maximum(_dot(p1 - p0, p1 - p0), np.maximum(_dot(p2 - p1, p2 - p1), _dot(p0 - p2, p0 - p2)))
    cross = np.cross(p1 - p0, p2 - p0)
    good = np.sqrt(_dot(cross, cross)) > 1e-10 * longest  # height over base; repeated indices give 0 > 0
    a, b, c = faces.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    sorted_faces = np.stack([low, a + b + c - low - high, high], axis=1)
    count = len(points)
    if count < 2_000_000:  # three indices fit one int64: a plain sort, many times faster than by rows
        key = (sorted_faces[:, 0] * count + sorted_faces[:, 1]) * count + sorted_faces[:, 2]
        first = np.unique(key, return_index=True)[1]
    else:
        first = np.unique(sorted_faces, axis=0, return_index=True)[1]
    once = np.zeros(len(faces), bool)
    once[first] = True
    good &= once
    if good.any() and not good.all():
        # A face of three points in a row may close the gap between one long side and two short ones: then it stays.
        filler = once & ~good & (sorted_faces[:, 0] < sorted_faces[:, 1]) & (sorted_faces[:, 1] < sorted_faces[:, 2])
        left = np.flatnonzero(good | filler)
        edges = Edges.of(faces[left], count)
        tight = all_corners(edges.of_side, edges.uses == 2)
        good[left] |= filler[left] & tight
    if not good.any():
        raise ValueError(f"none of its {len(faces)} faces has any area: nothing to draw")
    return faces[good], part[good]


def face_normals(points: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """Unit normals (F, 3). Faces lower than THIN have that of the face at their longest side: their own is noise."""
    side = _sides(points, faces)
    cross = np.cross(side[0], side[1])
    length = np.sqrt(np.stack([_dot(s, s) for s in side]))
    normal = _unit(cross)
    thin = np.flatnonzero(np.sqrt(_dot(cross, cross)) < THIN * length.max(axis=0))
    for _ in range(4):  # thin faces may lie in a row
        longest = edges.of_side[thin, (length[:, thin].argmax(axis=0) + 1) % 3]
        pair = edges.sides[longest] // 3
        other = pair.sum(axis=1) - thin
        normal[thin] = np.where((pair >= 0).all(axis=1)[:, None], normal[other], normal[thin])
    return normal


def clashes(faces: np.ndarray, edges: Edges) -> np.ndarray:
    """(E,) bool, edges of two faces that both run the same way along it."""
    forward = faces < np.roll(faces, -1, axis=1)  # side runs from its edge's lower to its higher vertex
    runs = np.bincount(edges.of_side.ravel(), weights=forward.ravel(), minlength=len(edges))
    return (edges.uses == 2) & (runs != 1)


def _turn(points: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """(F,) bool, the faces to turn over so that the winding agrees within each component: outward where it is closed,
    as most faces have it where it is open."""
    turn = np.zeros(len(faces), bool)
    clash = clashes(faces, edges)
    component = edges.components()
    if clash.any():
        # Two copies of each face, one per winding. Copies that must go together are connected; a component is
        # orientable when its two windings stay apart.
        inner = edges.uses == 2
        f, g = edges.faces[inner].T
        swap = clash[inner]
        n = len(faces)
        rows, columns = np.r_[f, f + n], np.r_[np.where(swap, g + n, g), np.where(swap, g, g + n)]
        links = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(2 * n, 2 * n))
        label = connected_components(links, directed=False)[1]
        kept, turned = label[:n], label[n:]
        # of the two windings of a component, take the one that more faces have as given; the lower label at a tie
        votes = np.bincount(kept, minlength=label.max() + 1)
        turn = (votes[turned] > votes[kept]) | ((votes[turned] == votes[kept]) & (turned < kept))
    closed = np.ones(component.max() + 1, bool)
    closed[component[edges.at_face(edges.uses == 1)]] = False
    p0, p1, p2 = (points[faces[:, i]] for i in range(3))
    volume = np.bincount(component, weights=np.where(turn, -1.0, 1.0) * _dot(p0, np.cross(p1, p2)))
    return turn ^ (closed & (volume < 0.0))[component]


def _cut(points: np.ndarray, faces: np.ndarray, edges: Edges, crease: float) -> tuple[np.ndarray, np.ndarray]:
    """Give each side of a sharp edge vertices of its own: faces (F, 3) over the new vertices, and their old ones (V,).

    Sharp are the `creases`, edges that meet in a tip, those that no winding can agree about, and those of more than two
    faces. A vertex is repeated once for each group of its faces that is joined through other edges, so that one sharp
    edge alone changes nothing.
    """
    count = len(points)
    inner = np.flatnonzero(edges.uses == 2)
    normal = face_normals(points, faces, edges)
    clash = clashes(faces, edges)
    bend = bends(normal, edges.faces, edges.uses, clash)
    clash = clash[inner]
    sharp = np.zeros(len(inner), bool)
    if crease < 180.0:
        sharp = creases(points, edges.ends, edges.of_side, edges.faces, bend, np.radians(crease))[inner] & ~clash
    if crease < 180.0:
        tip = _tips(points, faces, edges.ends, normal, np.cos(np.radians(crease)))
        tip[edges.ends[inner[sharp | clash]]] = False  # cut as it is
        sharp |= tip[edges.ends[inner]].any(axis=1)
    if not (sharp.any() or clash.any() or (edges.uses > 2).any()):
        return faces, np.arange(count)
    # corners of two faces belong together at both ends of an edge that is not cut
    joined = inner[~(sharp | clash)]
    links = []
    for side in edges.sides[joined].T:
        after = side - side % 3 + (side + 1) % 3
        forward = faces.ravel()[side] == edges.ends[joined, 0]
        links.append(np.r_[np.where(forward, side, after), np.where(forward, after, side)])
    graph = coo_matrix((np.ones(len(links[0]), np.int8), links), shape=(faces.size, faces.size))
    groups, group = connected_components(graph, directed=False)
    old = np.empty(groups, np.int64)
    old[group] = faces.ravel()
    # the first group of each vertex keeps its number, the others get new ones
    order = np.argsort(old, kind="stable")
    first = np.r_[True, old[order][1:] != old[order][:-1]]
    number = np.empty(groups, np.int64)
    number[order[first]] = old[order[first]]
    number[order[~first]] = count + np.arange((~first).sum())
    return number[group].reshape(faces.shape), np.r_[np.arange(count), old[order[~first]]]


def _tips(points: np.ndarray, faces: np.ndarray, edges: np.ndarray, normal: np.ndarray, cosine: float) -> np.ndarray:
    """(V,) bool: vertices such as a cone's, that no normal fits: some face turns from theirs by more than the crease
    angle. Only where edges are long: between long thin faces, normals that run from a tip would bend the outline."""
    vectors = points[edges[:, 0]] - points[edges[:, 1]]
    length = np.sqrt(_dot(vectors, vectors))
    tip = np.zeros(len(points), bool)
    if length.max() < LONG_EDGE:
        return tip
    uses = np.maximum(np.bincount(edges.ravel(), minlength=len(points)), 1)
    mean = np.bincount(edges.ravel(), weights=np.repeat(length, 2), minlength=len(points)) / uses
    vertex = vertex_normals(points, faces)
    for i in range(3):
        tip[faces[_dot(normal, vertex[faces[:, i]]) < cosine, i]] = True
    return tip & (mean >= LONG_EDGE)


# ---------------------------------------------------------------------------------------------------- measuring


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.sqrt(_dot(v, v)), _TINY)[..., None]


def _scatter(index: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Sum real or complex values (N,) by index (N,) into (count,)."""
    if np.iscomplexobj(values):
        return _scatter(index, values.real, count) + 1j * _scatter(index, values.imag, count)
    return np.bincount(index, weights=values, minlength=count)


def _sides(vertices: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
    """The three sides (F, 3) of each face, side i opposite corner i."""
    p0, p1, p2 = (vertices[faces[:, i]] for i in range(3))
    return [p2 - p1, p0 - p2, p1 - p0]


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals (V, 3): face normals weighted as in Max 1999, exact for points on a sphere."""
    side = _sides(vertices, faces)
    cross = np.cross(side[0], side[1])
    square = [np.maximum(_dot(s, s), _TINY) for s in side]
    weight = np.stack([1.0 / (square[1] * square[2]), 1.0 / (square[2] * square[0]), 1.0 / (square[0] * square[1])], 1)
    index = faces.ravel()
    total = [_scatter(index, (weight * cross[:, i, None]).ravel(), len(vertices)) for i in range(3)]
    normals = np.stack(total, axis=1)
    length = np.sqrt(_dot(normals, normals))
    lost = ~(length > 1e-12)  # faces that cancel, folded onto each other: any one of their normals will do
    if lost.any():
        face = np.zeros(len(vertices), np.int64)
        face[index] = np.repeat(np.arange(len(faces)), 3)
        normals[lost] = cross[face[lost]]
    return _unit(normals)


def _mend_rim_normals(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, edges: Edges) -> np.ndarray:
    """Normals (V, 3) with those on boundaries and creases extrapolated instead of averaged.

    A vertex with faces on one side only has the normal of a place half an edge away, which spoils the curvature for two
    rings of vertices. There the face normals of two rings, each true at its centroid, are fitted by a linear field.
    """
    rim = np.unique(edges.ends[edges.uses == 1])
    if not len(rim):
        return normals
    number = np.full(len(vertices), -1)
    number[rim] = np.arange(len(rim))
    # pairs of a rim vertex and a face within two rings of it
    corner_face = np.repeat(np.arange(len(faces)), 3)
    touches = csr_matrix((np.ones(faces.size), (faces.ravel(), corner_face)), shape=(len(vertices), len(faces)))
    pairs = (touches[rim] @ touches.T @ touches).tocoo()
    vertex, face = pairs.row, pairs.col
    side = _sides(vertices, faces[face])
    cross = np.cross(side[0], side[1])
    area = np.sqrt(_dot(cross, cross))
    x, y = _tangent_frame(normals[rim])
    away = vertices[faces[face]].mean(axis=1) - vertices[rim[vertex]]
    at = np.stack([np.ones(len(vertex)), _dot(away, x[vertex]), _dot(away, y[vertex])], axis=1)
    unit = cross / np.maximum(area, _TINY)[:, None]
    left, right = np.empty((len(rim), 3, 3)), np.empty((len(rim), 3, 3))
    for i in range(3):
        for j in range(3):
            left[:, i, j] = _scatter(vertex, area * at[:, i] * at[:, j], len(rim))
            right[:, i, j] = _scatter(vertex, area * at[:, i] * unit[:, j], len(rim))
    spread = 1e-6 * (left[:, 1, 1] + left[:, 2, 2]) + _TINY  # faces in a row tell nothing across it: no slope then
    left[:, 1, 1] += spread
    left[:, 2, 2] += spread
    fitted = _unit(np.linalg.solve(left + np.diag([_TINY, 0, 0]), right)[:, 0])
    good = _dot(fitted, normals[rim]) > np.cos(np.radians(30.0))
    normals = normals.copy()
    normals[rim[good]] = fitted[good]
    return normals


def corner_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Voronoi area of each corner (F, 3): the part of the face nearer to it than to the other two.

    An obtuse face is cut by the bisectors of its two shorter sides (Rusinkiewicz 2004), so that no share is negative.
    """
    side = _sides(vertices, faces)
    cross = np.cross(side[0], side[1])
    area = 0.5 * np.sqrt(_dot(cross, cross))
    square = [_dot(s, s) for s in side]
    # barycentric weights of the circumcentre, which is outside the face where one of them is negative
    weight = [square[i] * (square[i - 2] + square[i - 1] - square[i]) for i in range(3)]
    scale = 0.5 * area / np.maximum(weight[0] + weight[1] + weight[2], _TINY)
    areas = [scale * (weight[i - 2] + weight[i - 1]) for i in range(3)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        obtuse = np.flatnonzero(weight[i] <= 0.0)
        s, a = [part[obtuse] for part in side], area[obtuse]
        at_j = -0.25 * square[k][obtuse] * a / np.minimum(_dot(s[i], s[k]), -_TINY)
        at_k = -0.25 * square[j][obtuse] * a / np.minimum(_dot(s[i], s[j]), -_TINY)
        areas[j][obtuse], areas[k][obtuse], areas[i][obtuse] = at_j, at_k, a - at_j - at_k
    return np.stack(areas, axis=1)


def _tangent_frame(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit tangents (V, 3) with x cross y = normal, without square roots or special cases (Duff et al. 2017)."""
    nx, ny, nz = normals.T
    sign = np.where(nz >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (
        np.stack([1.0 + sign * nx * nx * a, sign * b, -sign * nx], axis=1),
        np.stack([b, sign + ny * ny * a, -ny], axis=1),
    )


def _solve_tridiagonal(diagonal: list, off: list, right: list, rtsc: bool = False) -> list:
    """Solve many small symmetric positive tridiagonal systems at once; each entry is a row of all of them.

    `rtsc` : leave the last pivot of 3 x 3 systems as it is, the slip of trimesh2's solver.
    """
    diagonal, right = list(diagonal), list(right)
    last = diagonal[-1]
    for i in range(1, len(diagonal)):
        ratio = off[i - 1] / np.maximum(diagonal[i - 1], _TINY)
        diagonal[i] = diagonal[i] - ratio * off[i - 1]
        right[i] = right[i] - ratio * right[i - 1]
    if rtsc and len(diagonal) == 3:
        diagonal[-1] = last
    out = [right[-1] / np.maximum(diagonal[-1], _TINY)]
    for i in range(len(diagonal) - 2, -1, -1):
        out.insert(0, (right[i] - off[i] * out[0]) / np.maximum(diagonal[i], _TINY))
    return out


def differential_geometry(
    vertices: np.ndarray, faces: np.ndarray, smooth: float = 0.0, rtsc: bool = False, edges: Edges | None = None
) -> tuple:
    """Normals, k1, k2, pdir1, pdir2, dcurv, feature size, after Rusinkiewicz 2004.

    `rtsc` : the numbers of rtsc 1.6 to the last digit instead, for comparison with it. It differs from the paper in
    that its 3 x 3 solver skips the last elimination step, which makes curvature depend on the order of a face's
    corners, and in that it estimates the feature size from 500 vertices.
    `edges` : those of the faces, where they are known.

    Least squares on each face fits the second fundamental form to differences of vertex normals, and its derivative to
    differences of vertex curvatures; vertices average their faces by Voronoi area after turning each face's plane
    into their own.

    Tensors turn as complex numbers. Write the angle of a frame as e^(i phi); the form [[a, b], [b, c]] is the mean
    (a + c) / 2, which does not turn, and the deviator (a - c) / 2 + i b, which turns by e^(2 i phi). A symmetric
    derivative tensor (p, q, r, s) = uuu, uuv, uvv, vvv is one part turning by e^(i phi) and one by e^(3 i phi).
    """
    count, index = len(vertices), faces.ravel()
    normals = vertex_normals(vertices, faces)
    edges = edges or Edges.of(faces, count)
    if not rtsc:
        normals = _mend_rim_normals(vertices, faces, normals, edges)
    blur = _blur(edges, count, smooth)
    if blur is not None:
        normals = _unit(blur(normals))
    x, y = _tangent_frame(normals)
    areas = corner_areas(vertices, faces)
    share = (areas.ravel() / np.maximum(_scatter(index, areas.ravel(), count), _TINY)[index]).reshape(-1, 3)

    blocks = [slice(i, i + BLOCK) for i in range(0, len(faces), BLOCK)]
    frames = [_face_frames(vertices, faces[block], share[block], normals) for block in blocks]
    mean, deviator = np.empty(faces.shape), np.empty(faces.shape, complex)
    for block, frame in zip(blocks, frames, strict=True):
        mean[block], deviator[block] = _forms(frame, normals[faces[block]], rtsc)
    mean, deviator = _scatter(index, mean.ravel(), count), _scatter(index, deviator.ravel(), count)
    if blur is not None:
        mean, deviator = _blur_tensor(blur, mean, deviator, x, y)

    # principal curvatures: mean +- |deviator|, the first along half the deviator's angle
    spread = np.abs(deviator)
    angle = 0.5 * np.angle(deviator)
    convex = mean >= 0.0
    k1, k2 = np.where(convex, mean + spread, mean - spread), np.where(convex, mean - spread, mean + spread)
    angle = np.where(convex, angle, angle + 0.5 * np.pi)
    axis = np.exp(1j * angle)
    pdir1 = axis.real[:, None] * x + axis.imag[:, None] * y
    pdir2 = axis.real[:, None] * y - axis.imag[:, None] * x

    one, three = np.empty(faces.shape, complex), np.empty(faces.shape, complex)
    for block, frame in zip(blocks, frames, strict=True):
        one[block], three[block] = _derivatives(frame, mean[faces[block]], deviator[faces[block]])
    one = _scatter(index, one.ravel(), count) / axis
    three = _scatter(index, three.ravel(), count) / (axis * axis * axis)
    dcurv = np.stack(
        [one.real + three.real, one.imag / 3.0 + three.imag, one.real / 3.0 - three.real, one.imag - three.imag], axis=1
    )
    return normals, k1, k2, pdir1, pdir2, dcurv, feature_size(vertices, k1, k2, rtsc)


@dataclass(frozen=True)
class _FaceFrames:
    """Frames (t, b, n) of some faces (F,), and what turns them into the frames (x, y) of their corners.

    t, b : (F, 3)
    u, v : (3, F), the sides in the frame, side i opposite corner i
    turn : (F, 3) complex, e^(i phi): t, seen in each corner's frame after the shortest rotation of n onto its normal
    share : (F, 3), of each corner's average
    """

    t: np.ndarray
    b: np.ndarray
    u: np.ndarray
    v: np.ndarray
    turn: np.ndarray
    share: np.ndarray


def _face_frames(vertices, faces, share, normals) -> _FaceFrames:
    side = _sides(vertices, faces)
    t = _unit(side[0])
    n = _unit(np.cross(side[0], side[1]))
    b = np.cross(n, t)
    u = np.stack([_dot(s, t) for s in side])
    v = np.stack([_dot(s, b) for s in side])
    uu, vv = (u * u).sum(axis=0), (v * v).sum(axis=0)
    flat = vv * uu > 1e-16 * (uu + vv) ** 2  # a sliver says nothing across its length: give it no vote
    turn = np.empty(faces.shape, complex)
    for i in range(3):
        corner_normal = normals[faces[:, i]]
        tilt = _dot(t, corner_normal) / np.maximum(1.0 + _dot(n, corner_normal), 1e-6)
        rotated = t - tilt[:, None] * n  # less a part along the vertex normal, which x and y do not see
        x, y = _tangent_frame(corner_normal)  # sooner made than fetched
        turn[:, i].real, turn[:, i].imag = _dot(rotated, x), _dot(rotated, y)
    size = np.abs(turn)
    turn = np.where(size > 1e-9, turn / np.maximum(size, 1e-9), 1.0)
    return _FaceFrames(t, b, u, v, turn, share * flat[:, None])


def _forms(frame: _FaceFrames, normals: np.ndarray, rtsc: bool) -> tuple[np.ndarray, np.ndarray]:
    """What each corner (F, 3) adds to its vertex's second fundamental form, II . side = dn: mean and deviator."""
    u, v = frame.u, frame.v
    uu, uv, vv = (u * u).sum(axis=0), (u * v).sum(axis=0), (v * v).sum(axis=0)
    dn = [normals[:, i - 1] - normals[:, i - 2] for i in range(3)]
    du = np.stack([_dot(d, frame.t) for d in dn])
    dv = np.stack([_dot(d, frame.b) for d in dn])
    right = [(du * u).sum(axis=0), (du * v + dv * u).sum(axis=0), (dv * v).sum(axis=0)]
    e, f, g = _solve_tridiagonal([uu, uu + vv, vv], [uv, uv], right, rtsc)
    mean = (0.5 * (e + g))[:, None] * frame.share
    deviator = (0.5 * (e - g) + 1j * f)[:, None] * (frame.turn * frame.turn) * frame.share
    return mean, deviator


def _derivatives(frame: _FaceFrames, mean: np.ndarray, deviator: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What each corner (F, 3) adds to its vertex's derivative tensor, given the form at the corners: its two parts."""
    u, v = frame.u, frame.v
    uu, uv, vv = (u * u).sum(axis=0), (u * v).sum(axis=0), (v * v).sum(axis=0)
    turn_twice = frame.turn * frame.turn
    # differences of the form, seen in the face's frame, along the sides
    seen = (deviator * np.conj(turn_twice)).T
    h = mean.T
    d_mean = np.stack([h[i - 1] - h[i - 2] for i in range(3)])
    d_dev = np.stack([seen[i - 1] - seen[i - 2] for i in range(3)])
    d_uu, d_uv, d_vv = d_mean + d_dev.real, d_dev.imag, d_mean - d_dev.real
    right = [
        (u * d_uu).sum(axis=0),
        (v * d_uu + 2.0 * u * d_uv).sum(axis=0),
        (2.0 * v * d_uv + u * d_vv).sum(axis=0),
        (v * d_vv).sum(axis=0),
    ]
    p, q, r, s = _solve_tridiagonal([uu, 2.0 * uu + vv, uu + 2.0 * vv, vv], [uv, 2.0 * uv, uv], right)
    one = (0.75 * ((p + r) + 1j * (q + s)))[:, None] * frame.turn * frame.share
    three = (0.25 * ((p - 3.0 * r) + 1j * (3.0 * q - s)))[:, None] * (turn_twice * frame.turn) * frame.share
    return one, three


def feature_size(vertices: np.ndarray, k1: np.ndarray, k2: np.ndarray, rtsc: bool = False) -> float:
    """rtsc's unit of length for line thresholds: 0.01 / (10th percentile of |k1| and |k2|), at most
    0.05 of the bounding sphere's radius. `rtsc` : over the 500 vertices that its random numbers pick."""
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
    """Radius of the smallest sphere around points (N, 3), to 1e-6.

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
    """Smallest sphere around at most five points, by trying every set that could carry it."""
    best = None
    for size in range(1, min(len(points), 4) + 1):
        for chosen in combinations(range(len(points)), size):
            carrier = points[list(chosen)]
            rel = carrier[1:] - carrier[0]
            offset = np.linalg.lstsq(2.0 * rel, _dot(rel, rel), rcond=None)[0] if len(rel) else np.zeros(3)
            centre = carrier[0] + offset
            radius = np.linalg.norm(points - centre, axis=1).max()
            if best is None or radius < best[1] * (1.0 - 1e-9):
                best = centre, radius, carrier
    return best


def _blur(edges: Edges, count: int, smooth: float):
    """A function that smooths per-vertex values (V, k) by `smooth` mean edges; None where there is nothing to do.

    Repeated half-way averaging with the edge neighbours: each step adds a quarter of a squared edge of variance.
    """
    if smooth <= 0.0:
        return None
    low, high = edges.ends.T
    rows, columns = np.r_[low, high], np.r_[high, low]
    steps = int(np.ceil(4.0 * smooth**2))
    part = 0.5 * (4.0 * smooth**2 / steps)  # a little less than half, so that whole steps end where they should
    weight = part / np.bincount(rows, minlength=count)[rows]
    everyone = np.arange(count)
    step = csr_matrix(
        (np.r_[weight, np.full(count, 1.0 - part)], (np.r_[rows, everyone], np.r_[columns, everyone])),
        shape=(count, count),
    )

    if steps < MANY_STEPS:
        order = everyone
    else:  # neighbours near each other in memory: twice as fast where the file strews them
        order = reverse_cuthill_mckee(step, symmetric_mode=True)
        step = step[order][:, order]

    def blur(values):
        values = values[order]
        for _ in range(steps):
            values = step @ values
        out = np.empty_like(values)
        out[order] = values
        return out

    return blur


def _blur_tensor(blur, mean, deviator, x, y):
    """Smooth the curvature tensor in world coordinates, where neighbours' frames agree, and read it back in (x, y)."""
    row, column = np.triu_indices(3)  # of the six entries of a symmetric tensor
    entry = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    a, b, c = mean + deviator.real, deviator.imag, mean - deviator.real
    tensor = a[:, None] * x[:, row] * x[:, column] + c[:, None] * y[:, row] * y[:, column]
    tensor = blur(tensor + b[:, None] * (x[:, row] * y[:, column] + y[:, row] * x[:, column]))[:, entry]
    a, b, c = (np.einsum("vi,vij,vj->v", p, tensor, q) for p, q in ((x, x), (x, y), (y, y)))
    return 0.5 * (a + c), 0.5 * (a - c) + 1j * b
