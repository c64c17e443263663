"""Triangles as arrays: what a file holds, edges and their faces, sums over corners."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..geometry.curves import runs


class Triangles(NamedTuple):
    """What a mesh file holds: polygons cut into triangles, of several named parts.

    vertices : (V, 3) float64
    faces : (F, 3) int64, naming vertices that exist
    part, part_names : (F,) int64, index into the names; "" where the file gives a part no name
    polygon : (F,) int64, which of the file's polygons each face was cut from; None: each is one
    """

    vertices: np.ndarray
    faces: np.ndarray
    part: np.ndarray
    part_names: tuple[str, ...]
    polygon: np.ndarray | None = None


def bends(
    normals: np.ndarray, edges: Edges, clash: np.ndarray, polygon: np.ndarray | None = None
) -> np.ndarray:
    """Measure the angle between the two faces at each edge, radians (E,); else 0.

    Also 0 within one polygon, however warped: where it was cut says nothing about the shape.

    Parameters
    ----------
    normals : (F, 3) unit
    edges : E edges
    clash : (E,) bool, edges about which no winding agrees: one of the normals is the wrong way
        round there
    polygon : (F,) int, which polygon each face was cut from; by default each is one
    """
    inner = np.flatnonzero(edges.uses == 2)
    f, g = edges.faces[inner].T
    cosine = row_dot(normals[f], normals[g])
    cosine[clash[inner]] *= -1.0
    if polygon is not None:
        cosine[polygon[f] == polygon[g]] = 1.0
    bend = np.zeros(len(edges))
    bend[inner] = np.arccos(np.clip(cosine, -1.0, 1.0))
    return bend


THIN = 1e-4  # of the longest side: the normal of a lower face is mostly the rounding of its corners
TINY = 1e-30  # keeps divisions finite; far below any product of lengths on a mesh of size 1


def face_normals(points: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """Measure unit normals (F, 3) of faces.

    Faces lower than THIN have that of the face at their longest side: their own is noise.
    """
    side = side_vectors(points, faces)
    cross = np.cross(side[0], side[1])
    length = np.sqrt(np.stack([row_dot(s, s) for s in side]))
    normal = unit_rows(cross)
    thin = np.flatnonzero(np.sqrt(row_dot(cross, cross)) < THIN * length.max(axis=0))
    for _ in range(4):  # thin faces may lie in a row
        longest = edges.of_side[thin, (length[:, thin].argmax(axis=0) + 1) % 3]
        pair = edges.sides[longest] // 3
        other = pair.sum(axis=1) - thin
        normal[thin] = np.where((pair >= 0).all(axis=1)[:, None], normal[other], normal[thin])
    return normal


COHERENT = 0.7  # a polygon whose triangles' areas, as vectors, sum to less of their sum is no sheet


def polygon_normals(
    points: np.ndarray, faces: np.ndarray, normal: np.ndarray, polygon: np.ndarray
) -> np.ndarray:
    """Give faces the unit normal (F, 3) of the polygon that they were cut from.

    That is the direction of the polygon's area as a vector (Newell 1972), so that a warped quad has
    one normal, however it was cut. Where a polygon is folded on itself, faces keep `normal` (F, 3).

    `polygon` : (F,) int, which polygon each face was cut from
    """
    number = np.unique(polygon, return_inverse=True)[1]
    count = len(number) and number.max() + 1
    if count == len(faces):
        return normal
    side = side_vectors(points, faces)
    cross = np.cross(side[0], side[1])
    size = np.sqrt(row_dot(cross, cross))
    area = normal * size[:, None]  # thin faces may borrow their normal
    total = np.stack([scatter_sum(number, axis, count) for axis in area.T], axis=1)
    one = np.sqrt(row_dot(total, total)) > COHERENT * scatter_sum(number, size, count)
    several = np.bincount(number, minlength=count) > 1
    return np.where((one & several)[number, None], unit_rows(total)[number], normal)


def clashes(faces: np.ndarray, edges: Edges) -> np.ndarray:
    """Find the edges of two faces that both run the same way along it, (E,) bool."""
    # does the side run from its edge's lower to its higher vertex?
    forward = faces < np.roll(faces, -1, axis=1)
    runs = np.bincount(edges.of_side.ravel(), weights=forward.ravel(), minlength=len(edges))
    return (edges.uses == 2) & (runs != 1)


def row_dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Multiply vectors (..., n) row by row: dot products (...)."""
    return np.einsum("...i,...i->...", a, b)


def unit_rows(v: np.ndarray) -> np.ndarray:
    """Scale vectors (..., n) to length 1; those of no length stay."""
    return v / np.maximum(np.sqrt(row_dot(v, v)), TINY)[..., None]


def scatter_sum(index: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Sum real or complex values (N,) by index (N,) into (count,)."""
    if np.iscomplexobj(values):
        return scatter_sum(index, values.real, count) + 1j * scatter_sum(index, values.imag, count)
    return np.bincount(index, weights=values, minlength=count)


def side_vectors(vertices: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
    """Take the three sides (F, 3) of each face, side i opposite corner i."""
    p0, p1, p2 = (vertices[faces[:, i]] for i in range(3))
    return [p2 - p1, p0 - p2, p1 - p0]


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of faces (F, 3). Side i of a face runs from its corner i to corner i + 1.

    Parameters
    ----------
    ends : (E, 2) int64, the vertices of each edge, the lower index first; edges are sorted
    of_side : (F, 3) int64, the edge of each side of each face
    uses : (E,) int64, how many sides are this edge: 1 on a boundary, 2 inside, more where the mesh
        is not a manifold
    sides : (E, 2) int64, the first two of them, side i of face f as 3 f + i; -1 where there is no
        second
    """

    ends: np.ndarray
    of_side: np.ndarray
    uses: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, faces: np.ndarray, count: int) -> Edges:
        """Find the edges of faces (F, 3) over `count` vertices."""
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        key = np.minimum(start, end) * count + np.maximum(start, end)
        order = np.argsort(key)
        ordered = key[order]
        starts = runs(ordered)
        first, uses = starts[:-1], np.diff(starts)
        if (uses > 2).any():
            # rare, and the first two of many must be found: equal keys in the order of the faces
            order = np.argsort(key, kind="stable")
        one = order[first]
        two = np.where(uses > 1, order[np.minimum(first + 1, len(key) - 1)], -1)
        swap = (two >= 0) & (two < one)
        sides = np.stack([np.where(swap, two, one), np.where(swap, one, two)], axis=1)
        of_side = np.empty(len(key), np.int64)
        of_side[order] = np.repeat(np.arange(len(first)), uses)
        ends = np.stack(np.divmod(ordered[first], count), axis=1)
        return cls(ends, of_side.reshape(faces.shape), uses, sides)

    def __len__(self) -> int:
        return len(self.ends)

    @property
    def faces(self) -> np.ndarray:
        """(E, 2), the first two faces at each edge; -1 where there is no second."""
        return self.sides // 3

    def turned(self, turn: np.ndarray) -> Edges:
        """Give the edges of the same faces, with the corners of those in `turn` (F,) reversed."""
        if not turn.any():
            return self
        face, side = np.divmod(self.sides, 3)
        swapped = (self.sides >= 0) & turn[face] & (side < 2)
        of_side = np.where(turn[:, None], self.of_side[:, [1, 0, 2]], self.of_side)
        turned = replace(
            self, of_side=of_side, sides=np.where(swapped, 3 * face + 1 - side, self.sides)
        )
        object.__setattr__(turned, "component", self.component)
        return turned

    def at_face(self, flag: np.ndarray) -> np.ndarray:
        """Find the faces with an edge of which `flag` (E,) is true, (F,) bool."""
        return any_corner(self.of_side, flag)

    @cached_property
    def component(self) -> np.ndarray:
        """The connected component, through shared edges, of each face, (F,) int."""
        count = len(self.of_side)
        pair = self.faces[self.uses == 2]
        if (self.uses > 2).any():
            many = np.flatnonzero((self.uses > 2)[self.of_side.ravel()])
            edge = self.of_side.ravel()[many]
            pair = np.concatenate([pair, np.stack([many // 3, self.faces[edge, 0]], axis=1)])
        links = coo_matrix((np.ones(len(pair), np.int8), pair.T), shape=(count, count))
        return connected_components(links, directed=False)[1].astype(np.int64)


def any_corner(faces: np.ndarray, flag: np.ndarray) -> np.ndarray:
    """Tell where `flag` is true at any of the three corners, (F,) bool.

    Ten times faster than to reduce short rows.
    """
    return flag[faces[:, 0]] | flag[faces[:, 1]] | flag[faces[:, 2]]


def all_corners(faces: np.ndarray, flag: np.ndarray) -> np.ndarray:
    """Tell where `flag` is true at all three corners, (F,) bool."""
    return flag[faces[:, 0]] & flag[faces[:, 1]] & flag[faces[:, 2]]
