"""The edges of a triangle mesh, and which faces meet there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of faces (F, 3). Side i of a face runs from its corner i to corner i + 1.

    Parameters
    ----------
    ends : (E, 2) int64, the vertices of each edge, the lower index first; edges are sorted
    of_side : (F, 3) int64, the edge of each side of each face
    uses : (E,) int64, how many sides are this edge: 1 on a boundary, 2 inside, more where the mesh is not a manifold
    sides : (E, 2) int64, the first two of them, side i of face f as 3 f + i; -1 where there is no second
    """

    ends: np.ndarray
    of_side: np.ndarray
    uses: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, faces: np.ndarray, count: int) -> Edges:
        """Of faces (F, 3) over `count` vertices."""
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        key = np.minimum(start, end) * count + np.maximum(start, end)
        order = np.argsort(key)
        ordered = key[order]
        new = np.r_[True, ordered[1:] != ordered[:-1]]
        first = np.flatnonzero(new)
        uses = np.diff(np.r_[first, len(key)])
        if (uses > 2).any():  # rare, and the first two of many must be found: equal keys in the order of the faces
            order = np.argsort(key, kind="stable")
        one = order[first]
        two = np.where(uses > 1, order[np.minimum(first + 1, len(key) - 1)], -1)
        swap = (two >= 0) & (two < one)
        sides = np.stack([np.where(swap, two, one), np.where(swap, one, two)], axis=1)
        of_side = np.empty(len(key), np.int64)
        of_side[order] = np.cumsum(new) - 1
        return cls(np.stack(np.divmod(ordered[first], count), axis=1), of_side.reshape(faces.shape), uses, sides)

    def __len__(self) -> int:
        return len(self.ends)

    @property
    def faces(self) -> np.ndarray:
        """(E, 2), the first two faces at each edge; -1 where there is no second."""
        return self.sides // 3

    def turned(self, turn: np.ndarray) -> Edges:
        """Of the same faces, with the corners of those in `turn` (F,) in reverse order."""
        if not turn.any():
            return self
        face, side = np.divmod(self.sides, 3)
        swapped = (self.sides >= 0) & turn[face] & (side < 2)
        of_side = np.where(turn[:, None], self.of_side[:, [1, 0, 2]], self.of_side)
        return replace(self, of_side=of_side, sides=np.where(swapped, 3 * face + 1 - side, self.sides))

    def at_face(self, flag: np.ndarray) -> np.ndarray:
        """(F,) bool: faces with an edge of which `flag` (E,) is true."""
        return any_corner(self.of_side, flag)

    def components(self) -> np.ndarray:
        """(F,) the connected component of each face, through shared edges, numbered by their first faces."""
        count = len(self.of_side)
        pair = self.faces[self.uses == 2]
        if (self.uses > 2).any():
            many = np.flatnonzero((self.uses > 2)[self.of_side.ravel()])
            edge = self.of_side.ravel()[many]
            pair = np.concatenate([pair, np.stack([many // 3, self.faces[edge, 0]], axis=1)])
        links = coo_matrix((np.ones(len(pair), np.int8), pair.T), shape=(count, count))
        return connected_components(links, directed=False)[1].astype(np.int64)


def any_corner(faces: np.ndarray, flag: np.ndarray) -> np.ndarray:
    """(F,) bool: is `flag` true at any of the three? Ten times faster than to reduce short rows."""
    return flag[faces[:, 0]] | flag[faces[:, 1]] | flag[faces[:, 2]]


def all_corners(faces: np.ndarray, flag: np.ndarray) -> np.ndarray:
    """(F,) bool: is `flag` true at all three?"""
    return flag[faces[:, 0]] & flag[faces[:, 1]] & flag[faces[:, 2]]
