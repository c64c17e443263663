"""Make vertices at one place one, close cracks, and drop faces that are none."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .triangles import Edges, all_corners, row_dot

# Of the longest side: boundary vertices nearer than this are one, where the mesh is not finer
# still. A place rounded twice, each coordinate by up to 1e-5, is 3.5e-5 from itself.
CRACK = 4e-5
DETAIL = 0.2  # of the shortest side at a vertex: what is farther from it is another vertex
MIX = np.uint64(0x9E3779B97F4A7C15)  # odd, as Fibonacci hashing has it (Knuth, vol. 3, 6.4)
MAX_KEYED = 2_000_000  # vertices: three indices of so many fit one int64


def drop_unused_vertices(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop vertices that no face uses; the others keep their order."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    if used.all():
        return vertices, faces
    return vertices[used], (np.cumsum(used) - 1)[faces]


def first_at_place(points: np.ndarray) -> np.ndarray:
    """Find the first of the points (V, 3) at each one's very place, (V,) int."""
    # by a hash of the bits, many times faster than by rows; + 0.0 makes 0.0 of -0.0
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)
    key = np.zeros(len(points), np.uint64)
    for column in bits.T:
        key = (key ^ column) * MIX
        key ^= key >> np.uint64(29)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    found = first[inverse.ravel()]
    if (points[found] != points).any():  # two places of one hash: once in 1e5 of the largest meshes
        _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
        found = first[inverse.ravel()]
    return found


def close_cracks(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Find for each vertex (V,) the one that it is merged with, where rounding moved boundaries.

    Points (V, 3) have longest side 1. Bodies without a boundary have no cracks: where two of them
    touch they stay two.
    """
    edges = Edges.of(faces, len(points))
    on_rim = edges.uses == 1
    rim = np.unique(edges.ends[on_rim])
    target = np.arange(len(points))
    if not len(rim):
        return target
    pairs = cKDTree(points[rim]).query_pairs(CRACK, output_type="ndarray")
    if not len(pairs):
        return target
    limit = DETAIL * shortest_sides(points, edges.ends)[rim]
    gap = points[rim[pairs[:, 0]]] - points[rim[pairs[:, 1]]]
    near = row_dot(gap, gap) <= np.minimum(limit[pairs[:, 0]], limit[pairs[:, 1]]) ** 2
    pairs = pairs[near].T
    links = coo_matrix((np.ones(len(pairs[0]), np.int8), pairs), shape=(len(rim), len(rim)))
    group = connected_components(links, directed=False)[1]
    _, first = np.unique(group, return_index=True)
    target[rim] = rim[first[group]]
    return target


def shortest_sides(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Measure the shortest edge at each vertex, (V,); infinite where there is none."""
    along = points[ends[:, 0]] - points[ends[:, 1]]
    length = np.sqrt(row_dot(along, along))
    shortest = np.full(len(points), np.inf)
    order = np.argsort(-length, kind="stable")  # the last that is written is the shortest
    shortest[ends[order, 0]] = length[order]
    other = np.full(len(points), np.inf)
    other[ends[order, 1]] = length[order]
    return np.minimum(shortest, other)


def drop_repeated_faces(faces: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop faces (F, 3) that name a vertex twice and faces given twice, and their `kept` (F,).

    Of two faces of the same corners one goes, as of a card given from both sides. Where two bodies
    have them in common, as a wall between two boxes, both stay.
    """
    corners = _sorted_corners(faces)
    good = (np.diff(corners, axis=1) > 0).all(axis=1)
    faces, kept, corners = faces[good], kept[good], corners[good]
    count = int(faces.max(initial=0)) + 1
    first = _first_of_each(corners, count)
    row = np.arange(len(faces))
    stays = first == row
    again = np.flatnonzero(~stays)
    if not len(again):
        return faces, kept
    again = again[np.unique(first[again], return_index=True)[1]]  # two at most stay
    stays[again[_of_two_bodies(faces, first[again], np.r_[np.flatnonzero(stays), again])]] = True
    return faces[stays], kept[stays]


def _of_two_bodies(faces: np.ndarray, twins: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Tell which faces `twins` (T,), that others have the corners of, two bodies share, (T,) bool.

    Those of sheets that end where two other faces go on from either side. All faces are `among`.
    """
    count = int(faces.max()) + 1
    edges, sheets = Edges.of(faces[among], count), Edges.of(faces[twins], count)
    end = np.flatnonzero(sheets.uses == 1)
    keys = (ends[:, 0] * count + ends[:, 1] for ends in (edges.ends, sheets.ends[end]))
    uses = edges.uses[np.searchsorted(*keys)]
    sheet = sheets.component[sheets.faces[end, 0]]
    shared = np.zeros(sheets.component.max() + 1, bool)
    shared[sheet] = True
    shared[sheet[uses < 4]] = False
    return shared[sheets.component]


def has_area(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Tell which faces have an area, (F,) bool: a height over their base that is no rounding."""
    p0, p1, p2 = (points[faces[:, i]] for i in range(3))
    sides = p1 - p0, p2 - p1, p0 - p2
    one, two, three = (row_dot(side, side) for side in sides)
    longest = np.maximum(one, np.maximum(two, three))
    cross = np.cross(p1 - p0, p2 - p0)
    return np.sqrt(row_dot(cross, cross)) > 1e-10 * longest  # repeated indices give 0 > 0


def drop_flat_faces(
    points: np.ndarray, faces: np.ndarray, kept: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Drop faces (F, 3) without area, and their `kept` (F,).

    A face of three points in a row may close the gap between one long side and two short ones: then
    it stays.
    """
    good = has_area(points, faces)
    if not good.all():
        edges = Edges.of(faces, len(points))
        good |= all_corners(edges.of_side, edges.uses == 2)
    return faces[good], kept[good]


def _sorted_corners(faces: np.ndarray) -> np.ndarray:
    """Sort the corners of each face (F, 3): many times faster than to sort short rows."""
    a, b, c = faces.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    return np.stack([low, a + b + c - low - high, high], axis=1)


def _first_of_each(corners: np.ndarray, count: int) -> np.ndarray:
    """Find the first of faces with the same sorted corners (F, 3), (F,) int.

    `count` : how many vertices there are
    """
    if count < MAX_KEYED:  # a plain sort, many times faster than by rows
        key = (corners[:, 0] * count + corners[:, 1]) * count + corners[:, 2]
        first, inverse = np.unique(key, return_index=True, return_inverse=True)[1:]
    else:
        first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)[1:]
    return first[inverse.ravel()]
