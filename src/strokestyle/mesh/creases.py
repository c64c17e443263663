"""Tell creases of the shape from sharp edges that are only the noise of a scan or a coarse mesh."""

from __future__ import annotations

import numpy as np

from ..geometry.curves import runs
from ..geometry.near import linked_groups
from .triangles import Edges, columns, row_dot

# So far must a crease reach whose sides bend ROUND times as much beside it: of the longest side of
# its body, or, where that is less, in edges as long as the longest of its faces.
LONG, LONG_EDGES = 0.06, 12.0
ROUND = 0.3
STRAIGHT = 50.0  # degrees: a crease turns less from edge to edge, or ends
WEAK = 0.7  # of the crease angle: two stretches of a crease hold together over such edges
EQUAL = 0.01  # degrees: a fold that exceeds the crease angle by less is one of that angle
FLAT = 0.05  # degrees: faces that bend less lie in one plane, as rounded coordinates have it
MIDDLING = 0.1  # share of edges neither flat nor sharp from which on a place is no low-poly shape
FOLDED = 150.0  # degrees: at an edge that bends more, a face is folded over
MAX_FAN = 64  # sharp edges at one vertex; of more, as in a fan, none is the continuation of another


def creases(points: np.ndarray, edges: Edges, bend: np.ndarray, angle: float) -> np.ndarray:
    """Find the creases (E,) bool: edges of more than `angle` that hold together as a line would.

    A true crease goes on from edge to edge without turning much, and lies between sides that are
    flat next to it; the sharp edges of noise and of details too fine for the mesh zigzag, between
    sides that bend as much. So edges of more than WEAK `angle` are chained to the straightest ones
    that follow them. Of a chain those that exceed `angle` are creases where they reach far enough:
    the farther, the rounder its sides are (`_bend_beside`). Between flat sides, as of all that is
    designed, any length will do. How far is far is judged by the body that the chain is on, or by
    its own faces where these are small, as of a thread on a long rod: what else the mesh holds does
    not matter. Those that are FOLDED over are faults of the mesh, or the edge of a blade: they must
    reach LONG.

    Parameters
    ----------
    points : (V, 3)
    edges : E edges
    bend : (E,) radians, as `bends` has it
    angle : radians
    """
    edge = np.flatnonzero(bend > WEAK * angle)
    out = np.zeros(len(edges), bool)
    if not len(edge):
        return out
    along = points[edges.ends[edge, 1]] - points[edges.ends[edge, 0]]
    length = np.linalg.norm(along, axis=1)
    along /= np.maximum(length, 1e-30)[:, None]
    chain = chains(edges.ends[edge], along)
    strong, folded = bend[edge] > angle + np.radians(EQUAL), bend[edge] > np.radians(FOLDED)
    beside = _bend_beside(points, edges, bend, edge, along)
    beside[_in_low_poly(edges, bend, edge, angle)] = 0.0
    beside = np.where(folded, ROUND * bend[edge], beside)
    own, round_by = (np.bincount(chain, length * what) for what in (bend[edge], beside))
    roundness = round_by / np.maximum(own, 1e-30)
    far = _far(points, edges, edge, folded)
    total = np.maximum(np.bincount(chain, length), 1e-30)
    needed = np.bincount(chain, length * far) / total * (roundness / ROUND) ** 2
    reach = np.bincount(chain, length * strong)
    out[edge[strong & (reach >= needed)[chain]]] = True
    return out


def _far(points: np.ndarray, edges: Edges, edge: np.ndarray, folded: np.ndarray) -> np.ndarray:
    """Tell how far is far at some edges (M,): LONG of their body, or LONG_EDGES long, (M,).

    Where `folded` (M,) it is LONG in any case.
    """
    longest = np.zeros(len(edge))
    for other in edges.faces[edge].T:  # -1 is a boundary's, at which nothing bends
        ends = points[edges.ends[edges.of_side[other]]]  # (M, 3, 2, 3)
        along = ends[:, :, 1] - ends[:, :, 0]
        longest = np.maximum(longest, np.sqrt(row_dot(along, along)).max(axis=1))
    body = edges.component[edges.faces[edge, 0]]
    size = LONG * _body_sizes(points, edges, np.unique(body))[body]
    return np.where(folded, size, np.minimum(size, LONG_EDGES * longest))


def _body_sizes(points: np.ndarray, edges: Edges, some: np.ndarray) -> np.ndarray:
    """Measure the longest side of `some` (n,) of C connected components; of the others 0, (C,)."""
    size = np.zeros(edges.component.max() + 1)
    wanted = np.zeros(len(size), bool)
    wanted[some] = True
    body = edges.component[edges.faces[:, 0]]
    ends = edges.ends.T
    if not wanted.all():
        among = np.flatnonzero(wanted[body])
        body, ends = body[among], ends[:, among]
    if len(some) > 1:
        order = np.argsort(body, kind="stable")
        body, ends = body[order], ends[:, order]
    start = runs(body)[:-1]
    for axis in columns(points):
        one, two = axis.take(ends)
        extent = np.maximum.reduceat(np.maximum(one, two), start)
        extent -= np.minimum.reduceat(np.minimum(one, two), start)
        size[some] = np.maximum(size[some], extent)
    return size


def chains(ends: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Number the chains of edges with ends (M, 2) and directions (M, 3), (M,) int.

    At a vertex two edges go on as each other where each is the other's straightest continuation.
    """
    count = len(ends)
    one, two = _pairs_at_vertices(ends)
    outward = np.stack([along, -along], axis=1).reshape(-1, 3)
    cosine = -row_dot(outward[one], outward[two])
    straight = cosine > np.cos(np.radians(STRAIGHT))
    one, two, cosine = one[straight], two[straight], cosine[straight]
    best = np.full(2 * count, -2.0)
    np.maximum.at(best, one, cosine)
    np.maximum.at(best, two, cosine)
    both = (cosine == best[one]) & (cosine == best[two])
    return linked_groups(np.stack([one[both], two[both]]) // 2, count)


def _pairs_at_vertices(ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair the ends of edges (M, 2) that are at one vertex.

    Returns the numbers (P,) of both; end j of edge i is 2 i + j.
    """
    order = np.argsort(ends.ravel(), kind="stable")
    start = runs(ends.ravel()[order])
    degree = np.diff(start)
    # ends of the same vertex yet to come
    left = np.repeat(start[1:], degree) - np.arange(len(order)) - 1
    left[np.repeat(degree, degree) > MAX_FAN] = 0
    at = [np.flatnonzero(left >= k) for k in range(1, int(left.max(initial=0)) + 1)]
    nothing = np.zeros(0, np.int64)
    one = [nothing, *(order[rows] for rows in at)]
    two = [nothing, *(order[rows + k] for k, rows in enumerate(at, 1))]
    return np.concatenate(one), np.concatenate(two)


def _bend_beside(
    points: np.ndarray, edges: Edges, bend: np.ndarray, edge: np.ndarray, along: np.ndarray
) -> np.ndarray:
    """Measure how much the surface bends right beside some edges about the same axis, (M,) radians.

    That is the most at the other sides of an edge's two faces. Nothing bends beside a face that
    lies in one plane with another: that is part of a flat side, whatever bends at its far sides.

    `edge` : (M,) int; `along` : (M, 3), its direction; the others as `creases` has them
    """
    ends, most = edges.ends, np.zeros(len(edge))
    in_plane = edges.at_face((edges.uses == 2) & (bend < np.radians(FLAT)))
    for face in edges.faces[edge].T:
        for other in edges.of_side[face].T:
            direction = points[ends[other, 1]] - points[ends[other, 0]]
            direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-30)[:, None]
            about = bend[other] * np.abs(row_dot(direction, along))
            nothing = (other == edge) | (face < 0) | (bend[other] > np.radians(FOLDED))
            most = np.maximum(most, np.where(nothing, 0.0, about))
    return np.where(in_plane[edges.faces[edge]].any(axis=1), 0.0, most)


def _in_low_poly(edges: Edges, bend: np.ndarray, edge: np.ndarray, angle: float) -> np.ndarray:
    """Tell which edges (M,) lie where nearly all are flat or sharp, as on a pyramid, (M,) bool.

    Bends of all sizes are a scan's. Asked is at the corners of both faces.
    """
    middling = ((bend > np.radians(FLAT)) & (bend <= angle)).astype(float)
    count = edges.ends.max() + 1
    one, two = edges.ends.T
    of_vertex = np.bincount(one, middling, count) + np.bincount(two, middling, count)
    degree = np.bincount(one, minlength=count) + np.bincount(two, minlength=count)
    corner = edges.ends[edges.of_side[edges.faces[edge]]].reshape(len(edge), -1)  # each twice
    share = of_vertex[corner].sum(axis=1) / degree[corner].sum(axis=1)
    return share < MIDDLING
