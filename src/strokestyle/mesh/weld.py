"""Make vertices at one place one, close cracks, and drop faces that are none."""

from __future__ import annotations

import numpy as np

from ..geometry.near import linked_groups
from .soup import Soup
from .triangles import Edges, all_corners, pair_key, row_dot

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
    key = _hashes(points)
    ordered = np.sort(key)
    if (ordered[1:] != ordered[:-1]).all():
        return np.arange(len(points))
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    found = first[inverse.ravel()]
    if (points[found] != points).any():  # two places of one hash: once in 1e5 of the largest meshes
        _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
        found = first[inverse.ravel()]
    return found


def _hashes(points: np.ndarray) -> np.ndarray:
    """Hash the bits of points (V, 3), (V,) uint64: many times faster than to sort them by rows."""
    key = np.zeros(len(points), np.uint64)
    for axis in points.T:
        key ^= (axis + 0.0).view(np.uint64)  # + 0.0 makes 0.0 of -0.0
        key *= MIX
        key ^= key >> np.uint64(29)
    return key


def close_cracks(soup: Soup) -> np.ndarray | None:
    """Find for each vertex (V,) the one that it is merged with, where rounding moved boundaries.

    Bodies without a boundary have no cracks: where two of them touch they stay two. None where
    nothing is to be merged.
    """
    points, edges = soup.points, soup.edges
    rim = np.unique(edges.ends[edges.uses == 1])
    if not len(rim):
        return None
    from scipy.spatial import cKDTree  # takes .1 s to import

    pairs = cKDTree(points[rim]).query_pairs(CRACK, output_type="ndarray")
    if not len(pairs):
        return None
    limit = DETAIL * shortest_sides(points, edges.ends)[rim]
    gap = points[rim[pairs[:, 0]]] - points[rim[pairs[:, 1]]]
    near = row_dot(gap, gap) <= np.minimum(limit[pairs[:, 0]], limit[pairs[:, 1]]) ** 2
    if not near.any():
        return None
    group = linked_groups(pairs[near].T, len(rim))
    _, first = np.unique(group, return_index=True)
    target = np.arange(len(points))
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


def drop_repeated_faces(soup: Soup) -> Soup:
    """Drop faces that name a vertex twice, and faces given twice.

    Of two faces of the same corners one goes, as of a card given from both sides. Where two bodies
    have them in common, as a wall between two boxes, both stay.
    """
    a, b, c = soup.faces.T
    soup = soup.take((a != b) & (b != c) & (c != a))
    few = _maybe_repeated(soup.edges)
    if not len(few):
        return soup
    first = few[_first_of_each(_sorted_corners(soup.faces[few]), len(soup.points))]
    again = few[first != few]
    if not len(again):
        return soup
    first = first[first != few]
    stays = np.ones(len(soup.faces), bool)
    stays[again] = False
    once = np.unique(first, return_index=True)[1]  # two at most stay
    again, first = again[once], first[once]
    among = np.r_[np.flatnonzero(stays), again]
    stays[again[_of_two_bodies(soup.faces, first, among)]] = True
    return soup.take(stays)


def _maybe_repeated(edges: Edges) -> np.ndarray:
    """Find the faces (N,) int that may have the corners of others: these lie beyond all sides."""
    beyond = (edges.beyond // 3).T  # -1 where none is beyond a side, or many are
    low = np.minimum(np.minimum(beyond[0], beyond[1]), beyond[2])
    high = np.maximum(np.maximum(beyond[0], beyond[1]), beyond[2])
    found = np.flatnonzero((low == high) | (low < 0))
    others = beyond[:, found].T
    same = (others == high[found, None]) | (edges.uses[edges.of_side[found]] > 2)
    return found[same.all(axis=1) & (edges.uses[edges.of_side[found]] > 1).all(axis=1)]


def _of_two_bodies(faces: np.ndarray, twins: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Tell which faces `twins` (T,), that others have the corners of, two bodies share, (T,) bool.

    Those of sheets that end where two other faces go on from either side. All faces are `among`.
    """
    count = int(faces.max()) + 1
    edges, sheets = Edges.of(faces[among], count), Edges.of(faces[twins], count)
    end = np.flatnonzero(sheets.uses == 1)
    keys, wanted = (pair_key(count, *ends.T) for ends in (edges.ends, sheets.ends[end]))
    uses = edges.uses[np.searchsorted(keys, wanted)]
    sheet = sheets.component[sheets.faces[end, 0]]
    shared = np.zeros(sheets.component.max() + 1, bool)
    shared[sheet] = True
    shared[sheet[uses < 4]] = False
    return shared[sheets.component]


def drop_flat_faces(soup: Soup) -> Soup:
    """Drop faces without area.

    A face of three points in a row may close the gap between one long side and two short ones: then
    it stays.
    """
    good = soup.shape.has_area
    if not good.all():
        good |= all_corners(soup.edges.of_side, soup.edges.uses == 2)
    return soup.take(good)


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
