"""Make a mesh fit to be measured: weld, drop what has no area, turn, split at creases."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .creases import creases
from .curvature import vertex_normals
from .triangles import Edges, all_corners, bends, clashes, face_normals, row_dot

LONG_EDGE = (
    0.03  # of the longest side: edges so long that normals must not run from a tip along them
)
WELD = 1e-6  # of the longest side: boundary vertices nearer than this are one vertex
_CELLS = 2**21  # per axis: the grid on which equal positions are found; 3 x 21 bits fit an int64


def drop_unused_vertices(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop vertices that no face uses; the others keep their order."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    if used.all():
        return vertices, faces
    return vertices[used], (np.cumsum(used) - 1)[faces]


def centre_and_scale(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Points -> the same with box centre 0 and longest side 1, and the centre and scale that undo it."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre = 0.5 * low + 0.5 * high  # halves first: coordinates may be near the largest float
    scale = float((0.5 * high - 0.5 * low).max())
    if not scale > 0.0:
        raise ValueError("all its points coincide: nothing to draw")
    if not 1e-150 < scale < 1e150:
        raise ValueError(f"its size ({2.0 * scale:g}) cannot be handled: rescale it")
    return (points - centre) / (2.0 * scale), centre, 2.0 * scale


def weld_vertices(
    points: np.ndarray, faces: np.ndarray, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge vertices at one place, then drop faces without area and repeated faces. Longest side must be 1."""
    cell = np.clip(((points + 0.5) * (_CELLS - 1) + 0.5).astype(np.int64), 0, _CELLS - 1)
    key = (cell[:, 0] * _CELLS + cell[:, 1]) * _CELLS + cell[:, 2]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    faces = first[inverse.ravel()][faces]
    points, faces = drop_unused_vertices(points, faces)
    faces, part = drop_degenerate_faces(points, faces, part)
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
            faces, part = drop_degenerate_faces(points, target[faces], part)
    return *drop_unused_vertices(points, faces), part


def drop_degenerate_faces(
    points: np.ndarray, faces: np.ndarray, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    p0, p1, p2 = (points[faces[:, i]] for i in range(3))
    longest = np.maximum(
        row_dot(p1 - p0, p1 - p0), np.maximum(row_dot(p2 - p1, p2 - p1), row_dot(p0 - p2, p0 - p2))
    )
    cross = np.cross(p1 - p0, p2 - p0)
    good = (
        np.sqrt(row_dot(cross, cross)) > 1e-10 * longest
    )  # height over base; repeated indices give 0 > 0
    a, b, c = faces.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    sorted_faces = np.stack([low, a + b + c - low - high, high], axis=1)
    count = len(points)
    if (
        count < 2_000_000
    ):  # three indices fit one int64: a plain sort, many times faster than by rows
        key = (sorted_faces[:, 0] * count + sorted_faces[:, 1]) * count + sorted_faces[:, 2]
        first = np.unique(key, return_index=True)[1]
    else:
        first = np.unique(sorted_faces, axis=0, return_index=True)[1]
    once = np.zeros(len(faces), bool)
    once[first] = True
    good &= once
    if good.any() and not good.all():
        # A face of three points in a row may close the gap between one long side and two short ones: then it stays.
        filler = (
            once
            & ~good
            & (sorted_faces[:, 0] < sorted_faces[:, 1])
            & (sorted_faces[:, 1] < sorted_faces[:, 2])
        )
        left = np.flatnonzero(good | filler)
        edges = Edges.of(faces[left], count)
        tight = all_corners(edges.of_side, edges.uses == 2)
        good[left] |= filler[left] & tight
    if not good.any():
        raise ValueError(f"none of its {len(faces)} faces has any area: nothing to draw")
    return faces[good], part[good]


def faces_to_flip(points: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
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
    volume = np.bincount(
        component, weights=np.where(turn, -1.0, 1.0) * row_dot(p0, np.cross(p1, p2))
    )
    return turn ^ (closed & (volume < 0.0))[component]


def split_at_creases(
    points: np.ndarray, faces: np.ndarray, edges: Edges, crease: float
) -> tuple[np.ndarray, np.ndarray]:
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
        sharp = (
            creases(points, edges.ends, edges.of_side, edges.faces, bend, np.radians(crease))[inner]
            & ~clash
        )
    if crease < 180.0:
        tip = cone_apices(points, faces, edges.ends, normal, np.cos(np.radians(crease)))
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


def cone_apices(
    points: np.ndarray, faces: np.ndarray, edges: np.ndarray, normal: np.ndarray, cosine: float
) -> np.ndarray:
    """(V,) bool: vertices such as a cone's, that no normal fits: some face turns from theirs by more than the crease
    angle. Only where edges are long: between long thin faces, normals that run from a tip would bend the outline."""
    vectors = points[edges[:, 0]] - points[edges[:, 1]]
    length = np.sqrt(row_dot(vectors, vectors))
    tip = np.zeros(len(points), bool)
    if length.max() < LONG_EDGE:
        return tip
    uses = np.maximum(np.bincount(edges.ravel(), minlength=len(points)), 1)
    mean = np.bincount(edges.ravel(), weights=np.repeat(length, 2), minlength=len(points)) / uses
    vertex = vertex_normals(points, faces)
    for i in range(3):
        tip[faces[row_dot(normal, vertex[faces[:, i]]) < cosine, i]] = True
    return tip & (mean >= LONG_EDGE)
