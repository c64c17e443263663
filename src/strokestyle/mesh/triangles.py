"""Triangles as arrays: what a file holds, edges and their faces, sums over corners."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..geometry.curves import runs
from ..geometry.near import linked_groups


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
    normals : (3, F) unit
    edges : E edges
    clash : (E,) bool, edges about which no winding agrees: one of the normals is the wrong way
        round there
    polygon : (F,) int, which polygon each face was cut from; by default each is one
    """
    one, two = edges.faces.T
    cosine = dots_at(normals, one, two)
    np.negative(cosine, out=cosine, where=clash)
    if polygon is not None:
        cosine[polygon[one] == polygon[two]] = 1.0
    bend = np.arccos(np.clip(cosine, -1.0, 1.0, out=cosine), out=cosine)
    bend[edges.uses != 2] = 0.0
    return bend


Columns = np.ndarray | Sequence[np.ndarray]  # vectors (3, N)
THIN = 1e-4  # of the longest side: the normal of a lower face is mostly the rounding of its corners
TINY = 1e-30  # keeps divisions finite; far below any product of lengths on a mesh of size 1
WORD = 63  # bits of a number that is not negative
BLOCK = 8192  # faces measured at a time: what is in between then stays in the processor's cache
CHUNK = 32 * BLOCK  # faces whose corners are summed up in one go: bounds memory


def face_normals(shape: FaceShapes, edges: Edges) -> np.ndarray:
    """Measure unit normals (3, F) of faces.

    Faces lower than THIN have that of the face at their longest side: their own is noise.
    """
    normal = shape.cross / np.maximum(shape.size, TINY)
    thin = np.flatnonzero(shape.size < THIN * np.sqrt(shape.longest))
    at_longest = edges.of_side[thin, (shape.square[:, thin].argmax(axis=0) + 1) % 3]
    pair = edges.sides[at_longest] // 3
    other, inner = pair.sum(axis=1) - thin, (pair >= 0).all(axis=1)
    for _ in range(4):  # thin faces may lie in a row
        normal[:, thin] = np.where(inner, normal[:, other], normal[:, thin])
    return normal


COHERENT = 0.7  # a polygon whose triangles' areas, as vectors, sum to less of their sum is no sheet


def polygon_normals(shape: FaceShapes, normal: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Give faces the unit normal (3, F) of the polygon that they were cut from.

    That is the direction of the polygon's area as a vector (Newell 1972), so that a warped quad has
    one normal, however it was cut. Where a polygon is folded on itself, faces keep `normal` (3, F).

    `polygon` : (F,) int, which polygon each face was cut from
    """
    if (polygon[1:] > polygon[:-1]).all():
        return normal
    number = np.unique(polygon, return_inverse=True)[1]
    count = len(number) and number.max() + 1
    if count == len(polygon):
        return normal
    # thin faces may borrow their normal
    total = np.stack([scatter_sum(number, axis * shape.size, count) for axis in normal])
    length = np.sqrt(column_dot(total, total))
    several = np.bincount(number, minlength=count) > 1
    one = several & (length > COHERENT * scatter_sum(number, shape.size, count))
    total /= np.maximum(length, TINY)
    return np.where(one[number], total[:, number], normal)


def clashes(faces: np.ndarray, edges: Edges) -> np.ndarray:
    """Find the edges of two faces that both run the same way along it, (E,) bool."""
    # does the side run from its edge's lower to its higher vertex?
    forward = (faces < faces[:, [1, 2, 0]]).ravel()
    one, two = edges.sides.T
    return (edges.uses == 2) & (forward[one] == forward[two])


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


def sum_at_corners(
    faces: np.ndarray,
    vertices: int,
    width: int,
    measure: Callable[[np.ndarray], Sequence[np.ndarray]],
    some: np.ndarray | None = None,
) -> np.ndarray:
    """Sum at the vertices what their faces (F, 3) say of their corners: (width, V).

    Parameters
    ----------
    measure : says it of faces (3, N) by corner: `width` times (3, N), at the three corners of each
    some : the faces that are asked, an index; by default all
    """
    total = np.zeros((width, vertices))
    for start in range(0, len(faces if some is None else some), CHUNK):
        chunk = slice(start, start + CHUNK)
        corner = columns(faces[chunk] if some is None else faces[some[chunk]])
        parts = np.empty((width, *corner.shape))
        for block in blocks(corner.shape[1]):
            for part, one in zip(parts, measure(corner[:, block]), strict=True):
                part[:, block] = one
        for one, part in zip(total, parts, strict=True):
            one += scatter_sum(corner.ravel(), part.ravel(), vertices)
    return total


def tangent_frame(normals: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Make two unit tangents (3, V) with x cross y = normal (3, V), after Duff et al. 2017.

    Without square roots or special cases.
    """
    nx, ny, nz = normals
    sign = np.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (
        np.stack([1.0 + sign * nx * nx * a, sign * b, -sign * nx]),
        np.stack([b, sign + ny * ny * a, -ny]),
    )


def side_vectors(points: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
    """Take the three sides (3, F) of faces (F, 3) over points (3, V), side i opposite corner i."""
    p0, p1, p2 = (points.take(faces[:, i], axis=1) for i in range(3))
    return [p2 - p1, p0 - p2, p1 - p0]


def columns(rows: np.ndarray) -> np.ndarray:
    """Lay out the columns of rows (N, k) one after the other, (k, N).

    Many rows are worked on several times faster by columns: rows of three are too short for the
    processor's vectors, and for numpy's loops.
    """
    return np.ascontiguousarray(rows.T)


def pair_key(count: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Number pairs of indices (N,), `b` below `count`, each pair differently: (N,) int64.

    Indices may be of 32 bits, as those of edges are; products of them are not.
    """
    return a.astype(np.int64, copy=False) * count + b


def bounds(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the least and the greatest of each coordinate of points (N, k), (k,) each.

    Column by column: many times faster than numpy reduces short rows.
    """
    return np.array([axis.min() for axis in points.T]), np.array([axis.max() for axis in points.T])


def distances(points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Measure how far points (N, k) lie from one (k,), (N,); column by column, as `bounds`."""
    square = np.zeros(len(points))
    for axis, middle in zip(points.T, centre, strict=True):
        away = axis - middle
        away *= away
        square += away
    return np.sqrt(square, out=square)


def column_dot(u: Columns, v: Columns) -> np.ndarray:
    """Multiply vectors (3, N) column by column: dot products (N,), to the last digit as row_dot."""
    out = u[0] * v[0]
    out += u[2] * v[2]
    out += u[1] * v[1]
    return out


def column_cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Multiply vectors (3, N) column by column: cross products (3, N)."""
    out = np.empty_like(u)
    for i in range(3):
        np.multiply(u[i - 2], v[i - 1], out=out[i])
        out[i] -= u[i - 1] * v[i - 2]
    return out


def dots_at(vectors: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Multiply pairs of vectors (3, N), those of the indices `one` and `two` (M,): (M,)."""
    out = vectors[0].take(one) * vectors[0].take(two)
    for axis in (2, 1):  # in the order of column_dot
        out += vectors[axis].take(one) * vectors[axis].take(two)
    return out


def blocks(count: int) -> Iterator[slice]:
    """Go through `count` rows BLOCK at a time."""
    for start in range(0, count, BLOCK):
        yield slice(start, min(start + BLOCK, count))


class FaceShapes(NamedTuple):
    """How large faces are, and which way they look.

    Parameters
    ----------
    cross : (3, F), twice their areas, as vectors
    size : (F,), twice their areas
    square : (3, F), the squared lengths of their sides, side i opposite corner i
    """

    cross: np.ndarray
    size: np.ndarray
    square: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, faces: np.ndarray) -> FaceShapes:
        """Measure faces (F, 3) over points (V, 3)."""
        count, points = len(faces), columns(points)
        found = cls(np.empty((3, count)), np.empty(count), np.empty((3, count)))
        for block in blocks(count):
            side = side_vectors(points, faces[block])
            cross = column_cross(side[0], side[1])
            found.cross[:, block] = cross
            found.size[block] = np.sqrt(column_dot(cross, cross))
            for i in range(3):
                found.square[i, block] = column_dot(side[i], side[i])
        return found

    @property
    def longest(self) -> np.ndarray:
        """(F,), the squared length of the longest side."""
        return np.maximum(np.maximum(self.square[0], self.square[1]), self.square[2])

    @property
    def has_area(self) -> np.ndarray:
        """(F,) bool, faces with an area: a height over their base that is no rounding."""
        return self.size > 1e-10 * self.longest  # repeated indices give 0 > 0


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of faces (F, 3). Side i of a face runs from its corner i to corner i + 1.

    Parameters
    ----------
    ends : (E, 2) int32, the vertices of each edge, the lower index first; edges are sorted
    of_side : (F, 3) int32, the edge of each side of each face
    uses : (E,) int32, how many sides are this edge: 1 on a boundary, 2 inside, more where the mesh
        is not a manifold
    sides : (E, 2) int32, the first two of them, side i of face f as 3 f + i; -1 where there is no
        second
    """

    ends: np.ndarray
    of_side: np.ndarray
    uses: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, faces: np.ndarray, count: int) -> Edges:
        """Find the edges of faces (F, 3) over `count` vertices."""
        start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
        low, high, order = _sorted_sides(np.minimum(start, end), np.maximum(start, end), count)
        starts = runs(low, high)
        first, uses = starts[:-1], np.diff(starts).astype(np.int32)
        one, two = order[first], order[np.minimum(first + 1, len(order) - 1)]
        two[uses == 1] = -1
        of_side = np.empty(len(order), np.int32)
        of_side[order] = np.repeat(np.arange(len(first), dtype=np.int32), uses)
        # columns lie one after the other in memory: most is done by columns
        ends = np.stack([low[first], high[first]]).T
        return cls(ends, of_side.reshape(faces.shape), uses, np.stack([one, two]).T)

    def __len__(self) -> int:
        return len(self.ends)

    @cached_property
    def faces(self) -> np.ndarray:
        """(E, 2), the first two faces at each edge; -1 where there is no second."""
        return (self.sides.T // 3).T

    @property
    def rim(self) -> np.ndarray:
        """(R,), the vertices on boundaries, ascending."""
        on_rim = np.zeros(self.ends.max(initial=0) + 1, bool)
        on_rim[self.ends[self.uses == 1]] = True
        return np.flatnonzero(on_rim)

    @cached_property
    def beyond(self) -> np.ndarray:
        """(F, 3), the side of another face that each side is shared with; -1 but where two meet."""
        beyond = np.full(self.of_side.size, -1, np.int32)
        one, two = self.sides[self.uses == 2].T
        beyond[one], beyond[two] = two, one
        return beyond.reshape(-1, 3)

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
        return linked_groups(pair.T, count)


def _sorted_sides(
    low: np.ndarray, high: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sort sides by their ends (N,), the lower first: both, and which side each is, (N,) int32."""
    bits = count.bit_length()
    key, side = in_order(low.astype(np.int64) << bits | high)
    high = (key & (1 << bits) - 1).astype(np.int32)
    key >>= bits
    return key.astype(np.int32), high, side.astype(np.int32)


def in_order(key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sort keys (N,) int64, which are not negative: the keys, and where each was, (N,) int64.

    Equal ones keep their order. What is sorted are keys and places in one number where both fit in:
    several times as fast as to sort places by their keys.
    """
    bits = max(len(key) - 1, 1).bit_length()
    if int(key.max(initial=0)).bit_length() + bits > WORD:
        order = np.argsort(key, kind="stable")
        return key[order], order
    both = key << bits
    both |= np.arange(len(key))
    both.sort()
    order = both & (1 << bits) - 1
    both >>= bits
    return both, order


def any_corner(faces: np.ndarray, flag: np.ndarray) -> np.ndarray:
    """Tell where `flag` is true at any of the three corners, (F,) bool.

    Ten times faster than to reduce short rows.
    """
    return flag[faces[:, 0]] | flag[faces[:, 1]] | flag[faces[:, 2]]


def all_corners(faces: np.ndarray, flag: np.ndarray) -> np.ndarray:
    """Tell where `flag` is true at all three corners, (F,) bool."""
    return flag[faces[:, 0]] & flag[faces[:, 1]] & flag[faces[:, 2]]
