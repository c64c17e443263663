"""Part a mesh into sheets at edges of more than two faces: each edge has one or two then."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..geometry.curves import counting, runs
from ..geometry.near import linked_groups
from .soup import Soup
from .triangles import Edges, any_corner, row_dot, unit_rows

MAX_PAGES = 64  # faces at an edge; of more, as at a book's spine, none goes on as another
PAIRS = 4  # of what is left at an edge, at most, that are joined though nothing tells them
PLANE = np.radians(1.0)  # faces that bend less at an edge are of one plane
SAME = 1e-4  # radians: faces that leave an edge so much alike lie on each other


def tangled_vertices(soup: Soup) -> np.ndarray:
    """Find the vertices (V,) bool where sheets meet: at edges of more than two faces, and where
    more than one boundary passes."""
    edges, count = soup.edges, len(soup.points)
    tangled = np.bincount(edges.ends[edges.uses == 1].ravel(), minlength=count) > 2
    tangled[edges.ends[edges.uses > 2]] = True
    return tangled


def part_sheets(soup: Soup, tangled: np.ndarray, origin: np.ndarray) -> Soup:
    """Give the sheets that meet at edges of more than two faces vertices of their own.

    At such an edge two faces go on as each other that the file joins by vertices of its own; else
    two that hang together elsewhere; else two of one plane, unless bodies touch there; else those
    that have solid between them, where the others do too; else the two that are flattest.
    So two bodies that touch are two, and a fin has an edge of its own where it stands on a sheet.
    After Gueziec et al. 2001, "Cutting and Stitching: Converting Sets of Polygons to Manifold
    Surfaces". The new vertices come last.

    Parameters
    ----------
    tangled : (V,) bool, where sheets meet
    origin : (F, 3) int, the vertices by which the file names the corners
    """
    points, faces, edges = soup.points, soup.faces, soup.edges
    many = edges.uses > 2
    near = np.flatnonzero(any_corner(faces, tangled))
    pairs = _joined_sides(points, faces, origin, edges, many)
    inner = (edges.uses == 2) & tangled[edges.ends].any(axis=1)
    pairs = np.concatenate([edges.sides[inner], pairs])
    group = _corner_groups(faces, pairs, near)
    corner = (3 * near[:, None] + np.arange(3)).ravel()
    at = faces.ravel()[corner]
    corner, group, at = corner[tangled[at]], group[tangled[at]], at[tangled[at]]
    # the first group of each vertex keeps it, the others get new ones
    first, inverse = np.unique(group, return_index=True, return_inverse=True)[1:]
    order = np.argsort(at[first], kind="stable")
    again = np.r_[False, at[first][order][1:] == at[first][order][:-1]]
    number = at[first].copy()
    number[order[again]] = len(points) + np.arange(again.sum())
    out = faces.ravel().copy()
    out[corner] = number[inverse.ravel()]
    points = np.concatenate([points, points[at[first][order[again]]]])
    return Soup(points, out.reshape(-1, 3), soup.kept)


def _corner_groups(faces: np.ndarray, pairs: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Group the corners (3 N,) of faces `near` (N,) that sides joined in pairs (P, 2) link."""
    local = np.full(len(faces), -1)
    local[near] = np.arange(len(near))
    pairs = pairs[(local[pairs // 3] >= 0).all(axis=1)]
    corner = faces.ravel()
    begin, end = pairs, pairs - pairs % 3 + (pairs + 1) % 3
    against = corner[begin[:, 0]] == corner[end[:, 1]]
    links = [
        np.stack([begin[:, 0], np.where(against, end[:, 1], begin[:, 1])]),
        np.stack([end[:, 0], np.where(against, begin[:, 1], end[:, 1])]),
    ]
    link = np.concatenate(links, axis=1)
    link = 3 * local[link // 3] + link % 3
    return linked_groups(link, 3 * len(near))


def _joined_sides(
    points: np.ndarray, faces: np.ndarray, origin: np.ndarray, edges: Edges, many: np.ndarray
) -> np.ndarray:
    """Pair the sides (P, 2) of edges of `many` (E,) faces that go on as each other."""
    side = np.flatnonzero(many[edges.of_side.ravel()])
    side = side[np.argsort(edges.of_side.ravel()[side], kind="stable")]
    fan = _Fan.of(points, faces, edges, side)
    pairs = [np.zeros((0, 2), np.int64)]
    by_file, by_patch = partial(_by_file, origin=origin), partial(_by_patch, edges=edges)
    steps: list[Callable[[_Fan], np.ndarray]] = [by_file, by_patch, _touching, _flat, _flat]
    for find in [*steps, _by_solid, *[_flattest] * PAIRS]:
        if not len(fan.side):
            break
        found = find(fan)
        pairs.append(fan.side[found])
        fan = fan.without(found.ravel())
    return np.concatenate(pairs)


class _Fan:
    """Sides of faces round the edges that they meet at, edge by edge.

    Parameters
    ----------
    side, edge : (S,) int, side i of face f as 3 f + i, and its edge
    forward : (S,) bool, does the side run from the edge's lower end to its higher
    angle : (S,) radians in 0..2 pi, in which direction about the edge its face lies
    """

    def __init__(
        self, side: np.ndarray, edge: np.ndarray, forward: np.ndarray, angle: np.ndarray
    ) -> None:
        self.side, self.edge, self.forward, self.angle = side, edge, forward, angle

    @classmethod
    def of(cls, points: np.ndarray, faces: np.ndarray, edges: Edges, side: np.ndarray) -> _Fan:
        """Measure sides (S,), which come edge by edge."""
        edge = edges.of_side.ravel()[side]
        face, i = np.divmod(side, 3)
        low, high = edges.ends[edge].T
        along = unit_rows(points[high] - points[low])
        apex = points[faces[face, (i + 2) % 3]] - points[low]
        out = unit_rows(apex - row_dot(apex, along)[:, None] * along)
        first = np.repeat(runs(edge)[:-1], np.diff(runs(edge)))
        zero = out[first]
        angle = np.arctan2(row_dot(np.cross(along, zero), out), row_dot(zero, out))
        angle = np.where(angle < -SAME, angle + 2.0 * np.pi, np.maximum(angle, 0.0))
        return cls(side, edge, faces.ravel()[side] == low, angle)

    def without(self, index: np.ndarray) -> _Fan:
        """Take the sides but those of an index."""
        left = np.ones(len(self.side), bool)
        left[index] = False
        return _Fan(self.side[left], self.edge[left], self.forward[left], self.angle[left])


def _by_file(fan: _Fan, origin: np.ndarray) -> np.ndarray:
    """Pair the sides (P, 2) that alone name the same vertices of the file."""
    after = fan.side - fan.side % 3 + (fan.side + 1) % 3
    ends = np.stack([origin.ravel()[fan.side], origin.ravel()[after]])
    return _just_two(fan, ends.min(axis=0), ends.max(axis=0))


def _by_patch(fan: _Fan, edges: Edges) -> np.ndarray:
    """Pair the sides (P, 2) that alone are of one patch, joined by edges of two faces."""
    patch = linked_groups(edges.faces[edges.uses == 2].T, len(edges.of_side))
    return _just_two(fan, patch[fan.side // 3])


def _just_two(fan: _Fan, *names: np.ndarray) -> np.ndarray:
    """Pair the sides (P, 2) of an edge that share their `names` (S,) with no other, wound alike."""
    order = np.lexsort((*names, fan.edge))
    start = runs(fan.edge[order], *(name[order] for name in names))
    two = start[:-1][np.diff(start) == 2]
    pairs = np.stack([order[two], order[two + 1]], axis=1)
    return pairs[fan.forward[pairs[:, 0]] != fan.forward[pairs[:, 1]]]


def _touching(fan: _Fan) -> np.ndarray:
    """Pair sides (P, 2) as `_by_solid` does, at edges where two faces lie back to back."""
    order = np.lexsort((fan.angle, fan.edge))
    one, two = order[:-1], order[1:]
    same = (fan.edge[one] == fan.edge[two]) & (fan.angle[two] - fan.angle[one] < SAME)
    touch = np.unique(fan.edge[one[same & (fan.forward[one] != fan.forward[two])]])
    pairs = _by_solid(fan)
    return pairs[np.isin(fan.edge[pairs[:, 0]], touch)]


def _by_solid(fan: _Fan) -> np.ndarray:
    """Pair the sides (P, 2) with solid between them, at edges where that leaves none.

    A face has air before it and solid behind. Round an edge of closed bodies the faces open and
    close the solid as brackets do.
    """
    # forward faces have air ahead, in the sense of the angle, the others solid
    step = np.where(fan.forward, -1, 1)
    coarse = np.round(fan.angle / SAME)
    # of faces on each other the one that closes comes first: bodies that touch do not overlap
    order = np.lexsort((step, coarse, fan.edge))
    start = runs(fan.edge[order])
    depth = np.cumsum(step[order])
    before = np.repeat(np.r_[0, depth][start[:-1]], np.diff(start))
    depth = depth - before
    even = np.repeat(np.add.reduceat(step[order], start[:-1]) == 0, np.diff(start))
    # a bracket's level, the same at both ends, round the edge from wherever
    level = depth - (step[order] > 0)
    rows = np.flatnonzero(even)
    rows = rows[np.lexsort((rows, level[rows], fan.edge[order[rows]]))]
    begin = runs(fan.edge[order[rows]], level[rows])
    count = np.diff(begin)
    opens = step[order[rows]] > 0
    k = counting(count)
    mate = np.repeat(begin[:-1], count) + (k + 1) % np.repeat(count, count)  # the next closes it
    return order[np.stack([rows, rows[mate]], axis=1)[opens]]


def _flat(fan: _Fan) -> np.ndarray:
    """Pair two sides (P, 2) of each edge that are of one plane, and wound alike."""
    pairs, bend = _least_bent(fan)
    return pairs[bend < PLANE]


def _flattest(fan: _Fan) -> np.ndarray:
    """Pair two sides (P, 2) of each edge where two are left, those that bend least."""
    return _least_bent(fan)[0]


def _least_bent(fan: _Fan) -> tuple[np.ndarray, np.ndarray]:
    """Find for each edge the two sides (P, 2) that bend least, and by how much, radians (P,).

    Two that are not wound alike bend by a full turn more.
    """
    start = runs(fan.edge)
    count = np.diff(start)
    size = np.repeat(np.where(count > MAX_PAGES, 0, count), count)
    one = np.repeat(np.arange(len(fan.edge)), size)
    two = np.repeat(np.repeat(start[:-1], count), size) + counting(size)
    one, two = one[two > one], two[two > one]
    bend = np.abs(np.pi - np.abs(fan.angle[one] - fan.angle[two]))
    bend += np.where(fan.forward[one] == fan.forward[two], 2.0 * np.pi, 0.0)
    order = np.lexsort((bend, fan.edge[one]))
    best = order[runs(fan.edge[one[order]])[:-1]] if len(order) else order
    return np.stack([one[best], two[best]], axis=1), bend[best]
