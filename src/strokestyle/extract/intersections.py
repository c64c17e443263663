"""Where the parts of a mesh pass through one another: exact segments, face against face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

TOUCH = 1e-6  # of the longest side: corners nearer than this to a face's plane lie in it
LEAST_ANGLE = (
    0.02  # sine of the angle between two faces; below it they lie on each other, and cross anywhere
)
MOST = 4  # crossings per face
CHUNK = 1 << 18  # pairs looked at together: bounds memory however many boxes overlap


@dataclass(frozen=True)
class Crossings:
    """Pairs of faces that pass through each other, and the segment that both share.

    Parameters
    ----------
    face : (P, 2) int64, the two faces, the lower index first
    points : (P, 2, 3) float64, the ends of the segment
    node : (P, 2) int64, names of the ends: those at one place, to TOUCH, share a name
    """

    face: np.ndarray
    points: np.ndarray
    node: np.ndarray

    def __len__(self) -> int:
        return len(self.face)


def crossings(vertices: np.ndarray, faces: np.ndarray, group: np.ndarray) -> Crossings:
    """The crossings of faces of different groups.

    Parameters
    ----------
    vertices : (V, 3) float64, longest side about 1
    faces : (F, 3) int
    group : (F,) int, faces of one group are not asked about each other

    Faces at almost no angle (coplanar, repeated) do not cross, nor do those that only touch. Where there are more than
    MOST crossings per face, the mesh is a heap of faces and no shape made of parts: none is returned.
    """
    if not np.ptp(group):
        return Crossings(
            np.zeros((0, 2), np.int64), np.zeros((0, 2, 3)), np.zeros((0, 2), np.int64)
        )
    corner = vertices[faces]
    found, count = [], 0
    for pairs in overlapping_boxes(corner.min(axis=1), corner.max(axis=1), group):
        found.append(_cross(corner, pairs))
        count += len(found[-1][0])
        if count > MOST * len(faces):
            found = []
            break
    face = np.concatenate([np.zeros((0, 2), np.int64), *(face for face, _ in found)])
    points = np.concatenate([np.zeros((0, 2, 3)), *(points for _, points in found)])
    order = np.lexsort(face.T[::-1])
    face, points = face[order], points[order]
    node = _places(points.reshape(-1, 3)).reshape(-1, 2)
    long = node[:, 0] != node[:, 1]
    return Crossings(face[long], points[long], node[long])


def _places(points: np.ndarray) -> np.ndarray:
    """A number for each point (N, 3), the same for those nearer than TOUCH to each other."""
    near = cKDTree(points).query_pairs(TOUCH, output_type="ndarray")
    links = coo_matrix((np.ones(len(near), np.int8), near.T), shape=(len(points), len(points)))
    return connected_components(links, directed=False)[1]


def overlapping_boxes(low: np.ndarray, high: np.ndarray, group: np.ndarray):
    """Yield all pairs of boxes (P, 2), lower index first, of different groups and with a point in common.

    Boxes (N, 3) to (N, 3) are put in a balanced binary tree along a space-filling curve; the tree is descended from
    pairs of nodes whose boxes overlap to pairs of their children. Nodes within one group are left at once, so that
    the effort grows with what lies near other groups.
    """
    count = len(low)
    if count < 2 or group.min() == group.max():
        return
    order = np.argsort(_morton(0.5 * (low + high)), kind="stable")
    depth = int(count - 1).bit_length()
    pad = (0, (1 << depth) - count)
    levels = [
        (
            np.pad(
                low[order], (pad, (0, 0)), constant_values=np.inf
            ),  # a box of nothing overlaps nothing
            np.pad(high[order], (pad, (0, 0)), constant_values=-np.inf),
            np.pad(group[order], pad, constant_values=group.max()),
            np.pad(group[order], pad, constant_values=group.min()),
        )
    ]
    for _ in range(depth):
        a, b, c, d = levels[-1]
        levels.append(
            (np.minimum(a[::2], a[1::2]), np.maximum(b[::2], b[1::2]), np.minimum(c[::2], c[1::2]),
             np.maximum(d[::2], d[1::2]))
        )  # fmt: skip
    stack = [(depth, np.zeros((1, 2), np.int64))]
    while stack:
        level, pairs = stack.pop()
        a, b = pairs.T
        lows, highs, first, last = levels[level]
        meet = (np.maximum(lows[a], lows[b]) <= np.minimum(highs[a], highs[b])).all(axis=1)
        meet &= np.minimum(first[a], first[b]) < np.maximum(last[a], last[b])
        a, b = a[meet], b[meet]
        if not len(a):
            continue
        if level == 0:
            yield np.sort(order[np.stack([a, b], axis=1)], axis=1)
            continue
        below = [np.stack([2 * a + i, 2 * b + j], axis=1) for i in range(2) for j in range(2)]
        below[2] = below[2][a != b]  # (2a + 1, 2a) is (2a, 2a + 1) again
        below = np.concatenate(below)
        below = below[(below[:, 0] != below[:, 1]) | (level > 1)]  # a face and itself
        stack += [(level - 1, below[i : i + CHUNK]) for i in range(0, len(below), CHUNK)]


def _morton(points: np.ndarray) -> np.ndarray:
    """Places along a space-filling curve (Morton's) on a grid of 1024 cells a side, (N,) int64."""
    start = points.min(axis=0)
    size = max(float((points - start).max()), 1e-300)
    cell = ((points - start) / size * 1023.0).astype(np.int64)
    for shift, mask in (
        (16, 0x30000FF),
        (8, 0x300F00F),
        (4, 0x30C30C3),
        (2, 0x9249249),
    ):  # two zeros between bits
        cell = (cell | (cell << shift)) & mask
    return cell[:, 0] | cell[:, 1] << 1 | cell[:, 2] << 2


def _cross(corner: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The crossings among pairs of faces (P, 2) with corners (F, 3, 3): those pairs, and their segments (C, 2, 3).

    Each face cuts the line that both planes share in an interval; the faces cross where the intervals overlap (Moeller
    1997). Corners in the other's plane count as above it, everywhere alike.
    """
    height = []
    for this, other in (
        (0, 1),
        (1, 0),
    ):  # of each face's corners above the other's plane; few pairs pass
        normal, origin = _plane(corner[pairs[:, other]])
        above = np.einsum("pik,pk->pi", corner[pairs[:, this]] - origin[:, None], normal)
        above[np.abs(above) < TOUCH] = 0.0
        up = (above >= 0.0).sum(axis=1)
        good = (up > 0) & (up < 3)
        pairs, height = pairs[good], [h[good] for h in (*height, above)]
    line = np.cross(*(_plane(corner[pairs[:, i]])[0] for i in range(2)))
    steep = np.einsum("pi,pi->p", line, line) > LEAST_ANGLE**2
    pairs, height, line = pairs[steep], [h[steep] for h in height], line[steep]

    row = np.arange(len(pairs))[:, None]
    ends = []
    for i in range(
        2
    ):  # where each face meets the other's plane: on the two sides at the corner that is alone
        p, h = corner[pairs[:, i]], height[i]
        up = h >= 0.0
        odd = np.argmax(up == (up.sum(axis=1) == 1)[:, None], axis=1)[:, None]
        far = (odd + [1, 2]) % 3
        t = h[row, odd] / (h[row, odd] - h[row, far])
        ends.append(p[row, odd] + t[..., None] * (p[row, far] - p[row, odd]))
    points = np.stack(ends, axis=1)  # (P, 2 faces, 2 ends, 3)
    along = np.einsum("pfek,pk->pfe", points, line)
    first, last = along.argmin(axis=2), along.argmax(axis=2)
    start = along.min(axis=2).argmax(
        axis=1
    )  # the face whose interval begins later, and the one whose ends earlier
    stop = along.max(axis=2).argmin(axis=1)
    row = row[:, 0]
    begin, end = first[row, start], last[row, stop]
    overlap = along[row, start, begin] < along[row, stop, end]
    segments = np.stack([points[row, start, begin], points[row, stop, end]], axis=1)
    return pairs[overlap], segments[overlap]


def _plane(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals and a point of the planes of faces (P, 3, 3)."""
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300), corner[:, 0]
