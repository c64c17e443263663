"""Stitch T-junctions: where vertices lie on the side of another face, that side gets them too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..geometry.curves import counting, runs
from .soup import Soup
from .triangles import TINY, Edges, all_corners, dots_at, pair_key, row_dot, unit_rows
from .weld import CRACK, DETAIL, shortest_sides

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

ROUNDS = 8  # of stitching: each splits one side of a face
ON_SIDE = 2e-5  # of the longest side: a vertex nearer than this to a side lies on it
ALONG = 20.0  # degrees that a boundary edge at such a vertex turns from the side at most
FOLDED_BACK = 0.7  # least cosine between a face turned over and each of its neighbours, negated
LESS = 0.9  # of a face that is folded back, at most so much may still be so once it is mended
CAP = 1e-3  # of its longest side: a face so low has a corner on that side
# A side may be spanned by finer ones: their ends lie up to so far from it, of its length (the
# chord of an arc of 60 degrees), and none of them turns from it by more than the angle.
BULGE = 0.15
SPAN_TURN = 45.0  # degrees
SPAN_SIDES = 64  # at most
MAX_WAYS = 32  # boundary edges at a vertex; where there are more nothing is followed
# Cosine between the way into the face and that to a spanning vertex, or into a spanning face: where
# it is more, these lie on the face's own side, and there is no gap beyond its edge.
INWARD = 0.5
PIECES = 2  # per boundary edge, on average, that long ones are looked along in
SIZES = 3  # of pieces to an octave, that are looked round from alike
MAX_CROWD = 24.0  # vertices round a piece, on average; where there are more, pieces are halved
HALVINGS = 7  # at most, by way of trying
PROBES = 128  # pieces, by which that is told
CHUNK = 1 << 17  # pieces looked at together: bounds memory


class Stitches(NamedTuple):
    """Vertices to put on sides of faces.

    Parameters
    ----------
    side : (T,) int, side i of face f as 3 f + i
    vertex : (T,) int
    t : (T,) in 0..1, where along the side, from corner i to the next
    """

    side: np.ndarray
    vertex: np.ndarray
    t: np.ndarray

    def take(self, index: np.ndarray) -> Stitches:
        """Take those of an index or mask over T."""
        return Stitches(self.side[index], self.vertex[index], self.t[index])


def stitch(soup: Soup) -> Soup:
    """Split the faces on whose boundary sides vertices of others lie.

    A face with a corner on its own longest side, as put there to close a T-junction, goes, and the
    face beyond that side gets the corner.
    """
    for _ in range(ROUNDS):
        caps, found = _caps(soup)
        if not len(caps):
            break
        soup = _split(soup, found, caps)
    for find in (_on_sides, _spanned):
        new = np.ones(len(soup.faces), bool)
        for _ in range(ROUNDS):
            edges = soup.edges
            rim = np.flatnonzero(edges.uses == 1)
            rim = rim[new[edges.sides[rim, 0] // 3]]
            found = find(soup.points, soup.faces, edges, rim)
            if not len(found.side):
                break
            before, touched = len(soup.faces), found.side // 3
            soup = _split(soup, found)
            new = np.arange(len(soup.faces)) >= before
            new[touched] = True
    return soup


def _split(soup: Soup, found: Stitches, drop: np.ndarray | None = None) -> Soup:
    """Split faces at one of their sides each, in a fan from the corner opposite.

    The first triangle of each takes its face's place, the others come last; those of the index
    `drop` go.
    """
    faces, kept = soup.faces, soup.kept
    face = found.side // 3
    chosen = np.zeros(len(faces), np.int64)
    chosen[face] = found.side  # one side of each, the others another time
    found = found.take(found.side == chosen[face])
    found = found.take(np.lexsort((found.t, found.side)))
    face, side = np.divmod(found.side, 3)
    apex, end = faces[face, (side + 2) % 3], faces[face, (side + 1) % 3]
    last = np.r_[found.side[1:] != found.side[:-1], True][: len(face)]
    after = np.where(last, end, np.roll(found.vertex, -1))
    fan = np.stack([found.vertex, after, apex], axis=1)
    faces = faces.copy()
    first = np.r_[True, found.side[1:] != found.side[:-1]][: len(face)]
    faces[face[first], (side[first] + 1) % 3] = found.vertex[first]
    stays = np.ones(len(faces), bool)
    stays[drop if drop is not None else []] = False
    kept = np.concatenate([kept[stays], kept[face]])
    return soup.with_faces(np.concatenate([faces[stays], fan]), kept)


def _caps(soup: Soup) -> tuple[np.ndarray, Stitches]:
    """Find faces (C,) with a corner on their longest side, and where it is on the face beyond.

    So are those that are folded back onto the face beyond one of their sides. Only those are found
    at once that have nothing to do with each other.
    """
    faces, edges, shape = soup.faces, soup.edges, soup.shape
    square = shape.longest
    height = shape.size**2 / np.maximum(square, 1e-300)  # squared
    low = height < np.minimum(CAP**2 * square, CRACK**2)
    few = np.flatnonzero(low)
    sides = shape.square[[[2], [0], [1]], few]  # from corner i to the next
    longest = np.zeros(len(faces), np.int64)
    longest[few] = sides.argmax(axis=0)
    low[few] = height[few] < DETAIL**2 * sides.min(axis=0)
    low[few] &= edges.uses[edges.of_side[few, longest[few]]] <= 2
    flap, under = _flaps(soup)
    longest[flap], low[flap] = under, True
    cap = np.flatnonzero(low)
    if not len(cap) or len(cap) == len(faces):
        return cap[:0], _none()
    side = 3 * cap + longest[cap]
    pair = edges.sides[edges.of_side.ravel()[side]]
    beyond = np.where(pair[:, 0] == side, pair[:, 1], pair[:, 0])
    rim = pair[:, 1] < 0
    other = np.where(rim, len(faces) + cap, beyond // 3)
    # a face beyond gets one corner at a time, and does not go itself
    first = np.zeros(len(cap), bool)
    first[np.unique(other, return_index=True)[1]] = True
    first &= ~np.isin(other, cap[first])
    cap, side, beyond, rim = cap[first], side[first], beyond[first], rim[first]
    vertex = faces[cap, (side % 3 + 2) % 3][~rim]
    return cap, Stitches(beyond[~rim], vertex, np.full(len(vertex), 0.5))


def _none() -> Stitches:
    nothing = np.zeros(0, np.int64)
    return Stitches(nothing, nothing, np.zeros(0))


def _flaps(soup: Soup) -> tuple[np.ndarray, np.ndarray]:
    """Find faces (C,) that are folded back onto a neighbour, and the side (C,) between the two.

    Programs that thin out a mesh leave such: a face that looks the other way than all three of its
    neighbours, and lies on one of them. With its corner on that one's side the fold is gone, or it
    is smaller, and goes in the next round.
    """
    edges, size = soup.edges, soup.shape.size
    unit = soup.shape.cross / np.maximum(size, TINY)
    against = dots_at(unit, *edges.faces.T)
    np.negative(against, out=against, where=soup.clashing_edges)
    folded = (edges.uses == 2) & (against < -FOLDED_BACK)
    face = np.flatnonzero(all_corners(edges.of_side, folded))
    if not len(face):
        return face, face
    beside = edges.beyond[face] // 3  # (n, 3)
    wrong = np.stack([_still_turned(soup, unit, face, beside[:, i], i) for i in range(3)], axis=1)
    # the floor of a flat tent looks the other way than its three walls too, and is larger than each
    wrong[size[beside] <= size[face][:, None]] = np.inf
    side = wrong.argmin(axis=1)
    less = wrong[np.arange(len(face)), side] < LESS * size[face]
    return face[less], side[less]


def _still_turned(
    soup: Soup, unit: np.ndarray, face: np.ndarray, under: np.ndarray, side: int
) -> np.ndarray:
    """Measure what is turned over where the corner of faces (n,) opposite a side goes on it.

    That is of the faces `under` (n,) beyond that side: twice the area, (n,). `unit` (3, F) are
    normals.
    """
    corner, normal = soup.points[soup.faces[under]], unit[:, under].T
    tip, wrong = soup.points[soup.faces[face, (side + 2) % 3]], np.zeros(len(face))
    for k in range(3):
        a, b = corner[:, k], corner[:, (k + 1) % 3]
        # the side itself is one of the three, run the other way: there the tip lies inside
        wrong -= np.minimum(row_dot(np.cross(b - a, tip - a), normal), 0.0)
    return wrong


def _on_sides(points: np.ndarray, faces: np.ndarray, edges: Edges, rim: np.ndarray) -> Stitches:
    """Find the boundary vertices that lie on boundary edges `rim` (R,) of other faces.

    The boundary must go on along the side from there, or the two only touch.
    """
    if not len(rim):
        return _none()
    shortest, ways = shortest_sides(points, edges.ends), _Ways.of(points, edges)
    ends = edges.ends[rim]
    found = [_none()]
    for row, vertex in _near(points, ends, np.unique(edges.ends[edges.uses == 1])):
        own, start, end = edges.sides[rim[row], 0], points[ends[row, 0]], points[ends[row, 1]]
        along, rel = end - start, points[vertex] - start
        t = row_dot(rel, along) / np.maximum(row_dot(along, along), 1e-300)
        off, beyond = rel - t[:, None] * along, points[vertex] - end
        away = np.sqrt(row_dot(off, off))
        room = np.sqrt(np.minimum(row_dot(rel, rel), row_dot(beyond, beyond)))
        room = np.minimum(room, shortest[vertex])
        good = (away <= np.minimum(ON_SIDE, DETAIL * room)) & (t > 0.0) & (t < 1.0)
        good &= (faces[own // 3] != vertex[:, None]).all(axis=1)
        good[good] = ways.lead_along(vertex[good], along[good])
        found.append(_stitches(faces, edges, rim[row[good]], vertex[good], t[good]))
    side, vertex, t = (np.concatenate(column) for column in zip(*found, strict=True))
    once = np.unique(pair_key(len(points), side, vertex), return_index=True)[1]
    return Stitches(side[once], vertex[once], t[once])


def _stitches(
    faces: np.ndarray, edges: Edges, edge: np.ndarray, vertex: np.ndarray, t: np.ndarray
) -> Stitches:
    """Put vertices at `t` along edges of one face each, from the lower end on, on its sides."""
    side = edges.sides[edge, 0]
    forward = faces.ravel()[side] == edges.ends[edge, 0]
    return Stitches(side, vertex, np.where(forward, t, 1.0 - t))


def _near(
    points: np.ndarray, ends: np.ndarray, vertex: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield edges, rows of `ends` (R, 2), and vertices, of `vertex` (n,), that may lie on them.

    Edges are looked round from their middles, those of like length together; long ones piece by
    piece, the shorter the more vertices there are about, so that the effort grows with what lies
    near.
    """
    from scipy.spatial import cKDTree  # takes .1 s to import

    tree = cKDTree(points[vertex])
    along = points[ends[:, 1]] - points[ends[:, 0]]
    length = np.sqrt(row_dot(along, along))
    step = max(4.0 * float(np.median(length)), float(length.mean()) / PIECES)
    for _ in range(HALVINGS):
        count = np.ceil(np.maximum(length / step, 1.0)).astype(np.int64)
        row = np.repeat(np.arange(len(ends)), count)
        middle = (counting(count) + 0.5) / count[row]
        middle = points[ends[row, 0]] + middle[:, None] * along[row]
        size = np.floor(SIZES * np.log2(np.maximum(length / count, CRACK)))[row]
        reach = 0.5 * 2.0 ** ((size + 1.0) / SIZES) + CRACK
        order = np.argsort(size, kind="stable")
        crowd = _crowd(tree, middle[order], reach[order])
        if crowd <= MAX_CROWD:
            break
        step *= 0.5
    many = int(np.clip(CHUNK * MAX_CROWD / max(crowd, 1.0), 1, CHUNK))
    start = runs(size[order])
    for first, last in zip(start[:-1], start[1:], strict=True):
        for i in range(first, last, many):
            piece = order[i : min(i + many, last)]
            found = cKDTree(middle[piece]).sparse_distance_matrix(
                tree, reach[piece[0]], output_type="ndarray"
            )
            at, other = row[piece[found["i"]]], vertex[found["j"]]
            apart = (ends[at] != other[:, None]).all(axis=1)
            yield at[apart], other[apart]


def _crowd(tree: cKDTree, places: np.ndarray, reach: np.ndarray) -> float:
    """Estimate how many points of a tree lie within `reach` (n,) of places (n, 3), on average."""
    some = np.linspace(0, len(places) - 1, min(len(places), PROBES)).astype(np.int64)
    return float(tree.query_ball_point(places[some], reach[some], return_length=True).mean())


class _Ways(NamedTuple):
    """The ways from vertices along boundary edges.

    Parameters
    ----------
    points : (V, 3)
    first : (V + 1,) int, where the ways from each vertex begin
    to, edge : (W,) int, the vertex that each leads to, and which of the boundary edges along
    """

    points: np.ndarray
    first: np.ndarray
    to: np.ndarray
    edge: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, edges: Edges) -> _Ways:
        """Lay out the ways along all boundary edges, which are numbered in their order."""
        ends = edges.ends[edges.uses == 1]
        leaves, to = ends.T.ravel(), ends.T[::-1].ravel()
        order = np.argsort(leaves, kind="stable")
        first = np.searchsorted(leaves[order], np.arange(len(points) + 1))
        return cls(points, first, to[order], order % max(len(ends), 1))

    def at(self, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the ways at vertices (n,): rows of those, and ways; none of very many."""
        degree = self.first[vertex + 1] - self.first[vertex]
        degree[degree > MAX_WAYS] = 0
        row = np.repeat(np.arange(len(vertex)), degree)
        return row, self.first[vertex[row]] + counting(degree)

    def lead_along(self, vertex: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Tell at which vertices (n,) a way leads along a direction (n, 3), or back, (n,) bool."""
        row, way = self.at(vertex)
        leads = unit_rows(self.points[self.to[way]] - self.points[vertex[row]])
        straight = np.abs(row_dot(leads, unit_rows(along)[row])) > np.cos(np.radians(ALONG))
        return np.bincount(row[straight], minlength=len(vertex)) > 0


def _spanned(points: np.ndarray, faces: np.ndarray, edges: Edges, rim: np.ndarray) -> Stitches:
    """Find boundary edges of `rim` (R,) that finer ones lead along, from one end to the other.

    So meet meshes of two resolutions. From the lower end of each the boundary edges are followed
    that lead on to the other, as long as they stay near.
    """
    spans = _Spans.of(points, faces, edges)
    edge = np.searchsorted(spans.edge, rim)
    here = spans.start[edge]
    passed = [np.zeros((2, 0), np.int64)]
    whole = np.zeros(len(spans.edge), bool)
    for _ in range(SPAN_SIDES):
        edge, here = spans.step(edge, here)
        last = here == spans.end[edge]
        whole[edge[last]] = True
        edge, here = edge[~last], here[~last]
        if not len(edge):
            break
        passed.append(np.stack([edge, here]))
    edge, vertex = np.concatenate(passed, axis=1)
    edge, vertex = edge[whole[edge]], vertex[whole[edge]]
    return _stitches(faces, edges, spans.edge[edge], vertex, spans.place(edge, vertex)[0])


class _Spans(NamedTuple):
    """Boundary edges, and the ways between their ends along the others.

    Parameters
    ----------
    ways : along all of them
    edge : (R,) int, which of the mesh's edges they are
    start, end : (R,) int, the ends of each
    face : (R,) int, the face at it
    inward : (R, 3) unit, in that face, at right angles to the edge, away from it
    """

    ways: _Ways
    edge: np.ndarray
    start: np.ndarray
    end: np.ndarray
    face: np.ndarray
    inward: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, faces: np.ndarray, edges: Edges) -> _Spans:
        """Lay out all boundary edges."""
        rim = np.flatnonzero(edges.uses == 1)
        (start, end), face = edges.ends[rim].T, edges.sides[rim, 0] // 3
        along = unit_rows(points[end] - points[start])
        apex = points[faces[face].sum(axis=1) - start - end] - points[start]
        inward = unit_rows(apex - row_dot(apex, along)[:, None] * along)
        return cls(_Ways.of(points, edges), rim, start, end, face, inward)

    def place(self, edge: np.ndarray, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tell where along edges (n,) vertices lie, in 0..1, and the way from the edge (n, 3)."""
        points = self.ways.points
        rel = points[vertex] - points[self.start[edge]]
        along = points[self.end[edge]] - points[self.start[edge]]
        t = row_dot(rel, along) / np.maximum(row_dot(along, along), 1e-300)
        return t, rel - t[:, None] * along

    def step(self, edge: np.ndarray, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Go on along edges (n,) from vertices (n,): those with a way on, and where to it leads."""
        row, way = self.ways.at(here)
        by, to = self.ways.edge[way], self.ways.to[way]
        good, straight = self._leads_on(edge[row], here[row], to)
        good &= (by != edge[row]) & (self.face[by] != self.face[edge[row]])
        good &= row_dot(self.inward[by], self.inward[edge[row]]) <= INWARD
        row, to, straight = row[good], to[good], straight[good]
        order = np.lexsort((-straight, row))
        best = order[runs(row[order])[:-1]] if len(row) else order
        return edge[row[best]], to[best]

    def _leads_on(
        self, edge: np.ndarray, here: np.ndarray, to: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tell whether ways (n,) lead on along an edge near it, and how straight, as a cosine."""
        points = self.ways.points
        along = points[self.end[edge]] - points[self.start[edge]]
        length = np.sqrt(row_dot(along, along))
        stretch = unit_rows(points[to] - points[here])
        straight = row_dot(stretch, along) / np.maximum(length, 1e-300)
        t, off = self.place(edge, to)
        away = np.sqrt(row_dot(off, off))
        beside = (away <= BULGE * length) & (t > 0.0) & (t < 1.0)
        beside &= row_dot(off, self.inward[edge]) <= INWARD * away
        last = to == self.end[edge]
        return (straight > np.cos(np.radians(SPAN_TURN))) & (beside | last), straight
