"""Where the parts of a mesh pass through one another: exact segments, face against face."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..geometry.near import linked_groups

TOUCH = 1e-6  # of the longest side: corners nearer than this to a face's plane lie in it
# Sine of the angle between two faces; below it they lie on each other, and cross anywhere.
MIN_SINE = 0.02
MAX_CROSSINGS = 4  # per face
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
    """Find the crossings of faces of different groups.

    Faces at almost no angle (coplanar, repeated) do not cross, nor do those that only touch. Where
    there are more than MAX_CROSSINGS per face, the mesh is a heap of faces and no shape made of
    parts: none is returned.

    Parameters
    ----------
    vertices : (V, 3) float64, longest side about 1
    faces : (F, 3) int
    group : (F,) int, faces of one group are not asked about each other
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
        if count > MAX_CROSSINGS * len(faces):
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
    """Number points (N, 3) so that those nearer than TOUCH to each other share a number, (N,)."""
    from scipy.spatial import cKDTree  # takes .1 s to import

    near = cKDTree(points).query_pairs(TOUCH, output_type="ndarray")
    return linked_groups(near.T, len(points))


class BoxLevel(NamedTuple):
    """One level of a balanced binary tree of boxes; the children of node i are 2i and 2i + 1.

    Parameters
    ----------
    low, high : (n, 3), the corners of each node's box
    first, last : (n, k) int, the least and the greatest group in it, in each of k ways to group
    """

    low: np.ndarray
    high: np.ndarray
    first: np.ndarray
    last: np.ndarray

    def parents(self) -> BoxLevel:
        """Join neighbours two by two into the level above."""
        return BoxLevel(
            np.minimum(self.low[::2], self.low[1::2]),
            np.maximum(self.high[::2], self.high[1::2]),
            np.minimum(self.first[::2], self.first[1::2]),
            np.maximum(self.last[::2], self.last[1::2]),
        )

    def meet(self, pairs: np.ndarray) -> np.ndarray:
        """Find the pairs of nodes (P, 2) that overlap and hold several groups each way: indices."""
        good = np.arange(len(pairs))
        for first, last in zip(self.first.T, self.last.T, strict=True):
            a, b = pairs[good].T
            good = good[np.minimum(first[a], first[b]) < np.maximum(last[a], last[b])]
        for low, high in zip(self.low.T, self.high.T, strict=True):  # each leaves fewer
            a, b = pairs[good].T
            good = good[(low[a] <= high[b]) & (low[b] <= high[a])]
        return good


def overlapping_boxes(low: np.ndarray, high: np.ndarray, group: np.ndarray) -> Iterator[np.ndarray]:
    """Yield pairs (P, 2) of boxes of different groups that meet, lower index first.

    Boxes (N, 3) to (N, 3) are put in a balanced binary tree along a space-filling curve; the tree
    is descended from pairs of nodes whose boxes overlap to pairs of their children. Nodes within
    one group (N,) are left at once, so that the effort grows with what lies near other groups.
    Where there are several ways to group, (N, k), both boxes differ in all of them.
    """
    count = len(low)
    group = group.reshape(count, -1)
    if count < 2 or (group.min(axis=0) == group.max(axis=0)).any():
        return
    order = np.argsort(_morton(0.5 * (low + high)), kind="stable")
    levels = _box_tree(low[order], high[order], group[order])
    stack = [(len(levels) - 1, np.zeros((1, 2), np.int64))]
    while stack:
        level, pairs = stack.pop()
        pairs = pairs[levels[level].meet(pairs)]
        if not len(pairs):
            continue
        if level == 0:
            yield np.sort(order[pairs], axis=1)
            continue
        below = _child_pairs(pairs, leaves=level == 1)
        stack += [(level - 1, below[i : i + CHUNK]) for i in range(0, len(below), CHUNK)]


def _box_tree(low: np.ndarray, high: np.ndarray, group: np.ndarray) -> list[BoxLevel]:
    """Build the levels of a tree over boxes in their order, from the leaves to the root."""
    depth = int(len(low) - 1).bit_length()
    pad = (0, (1 << depth) - len(low))  # by boxes of nothing, which overlap nothing
    levels = [
        BoxLevel(
            np.pad(low, (pad, (0, 0)), constant_values=np.inf),
            np.pad(high, (pad, (0, 0)), constant_values=-np.inf),
            np.concatenate([group, np.tile(group.max(axis=0), (pad[1], 1))]),
            np.concatenate([group, np.tile(group.min(axis=0), (pad[1], 1))]),
        )
    ]
    for _ in range(depth):
        levels.append(levels[-1].parents())
    return levels


def _child_pairs(pairs: np.ndarray, leaves: bool) -> np.ndarray:
    """Pair the children of pairs of nodes (P, 2), each pair once; leaves not with themselves."""
    a, b = pairs.T
    parts = [np.stack([2 * a + i, 2 * b + j], axis=1) for i in range(2) for j in range(2)]
    parts[2] = parts[2][a != b]  # (2a + 1, 2a) is (2a, 2a + 1) again
    below = np.concatenate(parts)
    return below[below[:, 0] != below[:, 1]] if leaves else below


def _morton(points: np.ndarray) -> np.ndarray:
    """Number points (N, 3) along Morton's space-filling curve, on a grid of 1024 cells a side."""
    start = points.min(axis=0)
    size = max(float((points - start).max()), 1e-300)
    cell = ((points - start) / size * 1023.0).astype(np.int64)
    # put two zeros between the bits of each coordinate, to hold those of the two others
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cell = (cell | (cell << shift)) & mask
    return cell[:, 0] | cell[:, 1] << 1 | cell[:, 2] << 2


def _cross(corner: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cross pairs of faces (P, 2) with corners (F, 3, 3): those that cross, and segments (C, 2, 3).

    Each face cuts the line that both planes share in an interval; the faces cross where the
    intervals overlap (Moeller 1997). Corners in the other's plane count as above it, everywhere
    alike.
    """
    pairs, heights = _straddling(corner, pairs)
    line = np.cross(_plane(corner[pairs[:, 0]])[0], _plane(corner[pairs[:, 1]])[0])
    steep = np.einsum("pi,pi->p", line, line) > MIN_SINE**2
    pairs, heights, line = pairs[steep], [h[steep] for h in heights], line[steep]
    ends = [_plane_cut(corner[pairs[:, i]], heights[i]) for i in range(2)]
    points = np.stack(ends, axis=1)  # (P, 2 faces, 2 ends, 3)
    overlap, segments = _common_interval(points, line)
    return pairs[overlap], segments[overlap]


def _straddling(corner: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Keep the pairs (P, 2) each of whose faces has corners on both sides of the other's plane.

    With them go the heights (P, 3) of either face's corners above the other's plane.
    """
    heights: list[np.ndarray] = []
    for this, other in ((0, 1), (1, 0)):  # one after the other, since the first test leaves few
        normal, origin = _plane(corner[pairs[:, other]])
        above = np.einsum("pik,pk->pi", corner[pairs[:, this]] - origin[:, None], normal)
        above[np.abs(above) < TOUCH] = 0.0
        up = (above >= 0.0).sum(axis=1)
        good = (up > 0) & (up < 3)
        pairs, heights = pairs[good], [h[good] for h in (*heights, above)]
    return pairs, heights


def _plane_cut(corner: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Find where faces (P, 3, 3) meet the plane above which their corners have a height (P, 3).

    That is on the two sides at the corner that lies alone on its side of the plane: (P, 2, 3).
    """
    row = np.arange(len(corner))[:, None]
    up = height >= 0.0
    odd = np.argmax(up == (up.sum(axis=1) == 1)[:, None], axis=1)[:, None]
    far = (odd + [1, 2]) % 3
    t = height[row, odd] / (height[row, odd] - height[row, far])
    return corner[row, odd] + t[..., None] * (corner[row, far] - corner[row, odd])


def _common_interval(points: np.ndarray, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find what two intervals of a line, points (P, 2 faces, 2 ends, 3), have in common.

    Returns
    -------
    whether they overlap, (P,) bool, and from where to where, (P, 2, 3)
    """
    along = np.einsum("pfek,pk->pfe", points, line)
    first, last = along.argmin(axis=2), along.argmax(axis=2)
    later = along.min(axis=2).argmax(axis=1)  # the face whose interval begins later
    sooner = along.max(axis=2).argmin(axis=1)  # and the one whose ends sooner
    row = np.arange(len(points))
    begin, end = first[row, later], last[row, sooner]
    overlap = along[row, later, begin] < along[row, sooner, end]
    return overlap, np.stack([points[row, later, begin], points[row, sooner, end]], axis=1)


def _plane(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find unit normals and a point of the planes of faces (P, 3, 3)."""
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300), corner[:, 0]
