"""Tell creases of the shape from sharp edges that are only the noise of a scan or a coarse mesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..geometry.curves import runs
from .triangles import row_dot

# Lengths are of the longest side.
LONG = 0.06  # so far must a crease reach whose sides bend ROUND times as much beside it
ROUND = 0.3
SHORT = 0.01  # and so far one between flat sides
STRAIGHT = 50.0  # degrees: a crease turns less from edge to edge, or ends
WEAK = 0.7  # of the crease angle: where a crease is followed to
FOLDED = 150.0  # degrees: at an edge that bends more, a face is folded over
MAX_FAN = 64  # sharp edges at one vertex; of more, as in a fan, none is the continuation of another


def creases(
    points: np.ndarray,
    ends: np.ndarray,
    of_side: np.ndarray,
    faces: np.ndarray,
    bend: np.ndarray,
    angle: float,
) -> np.ndarray:
    """Find the creases (E,) bool: edges of more than `angle` that hold together as a line would.

    A true crease goes on from edge to edge without turning much, and lies between sides that are
    flat next to it; the sharp edges of noise and of details too fine for the mesh zigzag, between
    sides that bend as much. So edges of more than WEAK `angle` are chained to the straightest ones
    that follow them. Of a chain those that exceed `angle` are kept where they reach far enough: the
    farther, the rounder its sides are. Where they make up half of it, all of it is kept, and so is
    an edge that fills a gap between two such. Those that are FOLDED over are faults of the mesh, or
    the edge of a blade: they must reach LONG.

    Parameters
    ----------
    points : (V, 3), longest side 1
    ends : (E, 2) int, the vertices of each edge
    of_side : (F, 3) int, the edge of each side of each face
    faces : (E, 2) int, the faces at each edge
    bend : (E,) radians, as `bends` has it
    angle : radians
    """
    edge = np.flatnonzero(bend > WEAK * angle)
    out = np.zeros(len(ends), bool)
    if not len(edge):
        return out
    along = points[ends[edge, 1]] - points[ends[edge, 0]]
    length = np.linalg.norm(along, axis=1)
    along /= np.maximum(length, 1e-30)[:, None]
    chain = chains(ends[edge], along)
    strong, folded = bend[edge] > angle, bend[edge] > np.radians(FOLDED)
    reach = np.bincount(chain, length * strong)
    share = reach / np.maximum(np.bincount(chain, length), 1e-30)
    beside = _bend_beside(points, ends, of_side, faces, bend, edge, along)
    beside = np.where(folded, ROUND * bend[edge], beside)
    own = np.bincount(chain, length * bend[edge])
    roundness = np.bincount(chain, length * beside) / np.maximum(own, 1e-30)
    good = reach >= np.maximum(LONG * (roundness / ROUND) ** 2, SHORT)
    kept = good[chain] & (strong | (share >= 0.5)[chain])
    met = np.zeros(len(points), bool)
    met[ends[edge[kept]]] = True
    out[edge[kept | (met[ends[edge]].all(axis=1) & ~folded)]] = True
    return out


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
    pairs = one[both] // 2, two[both] // 2
    links = coo_matrix((np.ones(both.sum(), np.int8), pairs), shape=(count, count))
    return connected_components(links, directed=False)[1]


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
    points: np.ndarray,
    ends: np.ndarray,
    of_side: np.ndarray,
    faces: np.ndarray,
    bend: np.ndarray,
    edge: np.ndarray,
    along: np.ndarray,
) -> np.ndarray:
    """Measure how much the surface bends right beside some edges about the same axis, (M,) radians.

    That is the most at the other sides of an edge's two faces.

    `edge` : (M,) int; `along` : (M, 3), its direction; the others as `creases` has them
    """
    most = np.zeros(len(edge))
    for face in faces[edge].T:
        for other in of_side[face].T:
            direction = points[ends[other, 1]] - points[ends[other, 0]]
            direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-30)[:, None]
            about = bend[other] * np.abs(row_dot(direction, along))
            nothing = (other == edge) | (face < 0) | (bend[other] > np.radians(FOLDED))
            most = np.maximum(most, np.where(nothing, 0.0, about))
    return most
