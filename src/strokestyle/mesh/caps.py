"""Close what a plane has cut open: the rim, its loops, and flat faces between them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import manifold3d
import numpy as np

from .cut_mesh import CutMesh, Rim
from .planes import Plane
from .triangles import pair_key


class RimEdges(NamedTuple):
    """What bounds the cut of closed bodies, each edge as often as it bounds it.

    Parameters
    ----------
    tail, head : (R,) int, places; the solid is on the left, seen from beyond the plane
    body, part : (R,) int, those of a face there
    """

    tail: np.ndarray
    head: np.ndarray
    body: np.ndarray
    part: np.ndarray

    def take(self, rows: np.ndarray) -> RimEdges:
        """Select the edges of an index or mask."""
        return RimEdges(*(column[rows] for column in self))


def cap_faces(mesh: CutMesh, sides: Rim, plane: Plane) -> CutMesh:
    """Mark the rim among the sides in a plane, and close solid bodies there.

    Where two faces of one body share a side, it is none of the rim: what is left of a closed body's
    sides are loops, the boundary of what is left of its skin. A body whose faces agree about no
    winding may have others, and gets no cap.
    """
    axes = (plane.axis + np.array([1, 2])[:: plane.side]) % 3  # right-handed, seen from beyond
    places = mesh.at["vertices"][:, axes]
    edges = _marked_rim(mesh, sides)
    edges = edges.take(~np.isin(edges.body, _unbalanced(edges, len(places))))
    if not len(edges.tail):
        return mesh
    part = _main_part(edges, places)
    rings, of_ring = _loops(edges, places)
    order = np.argsort(of_ring, kind="stable")
    start = np.searchsorted(of_ring[order], np.unique(of_ring))
    nodes, faces, bodies = [np.zeros(0, np.int64)], [], []
    for group in np.split(order, start[1:]):
        mine = [rings[i] for i in group]
        first = sum(map(len, nodes))
        found = np.asarray(manifold3d.triangulate([places[ring] for ring in mine]), np.int64)
        nodes += mine
        faces.append(found.reshape(-1, 3) + first)
        bodies.append(np.full(len(faces[-1]), of_ring[group[0]]))
    return _with_caps(
        mesh, plane, np.concatenate(nodes), np.concatenate(faces), np.concatenate(bodies), part
    )


def _marked_rim(mesh: CutMesh, sides: Rim) -> RimEdges:
    """Mark the sides of faces that something was cut off at; collect the edges to be closed."""
    corner = mesh.faces[sides.face[:, None], (sides.side[:, None] + [0, 1]) % 3]
    ends = mesh.weld[corner]
    up = ends[:, 0] < ends[:, 1]
    names = np.column_stack([mesh.body[sides.face], np.sort(ends, axis=1)])
    edge, first, inverse = np.unique(names, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.ravel()
    net = np.bincount(inverse, np.where(up, 1, -1), len(edge)).astype(np.int64)
    alone = (net[inverse] != 0) & ((net[inverse] > 0) == up)
    fresh = alone & sides.fresh
    mesh.rim[sides.face[fresh], sides.side[fresh]] = True
    rows = np.repeat(np.arange(len(edge)), np.abs(net))
    rows = rows[mesh.closed[sides.face[first[rows]]]]
    back = net[rows] > 0  # a cap runs along its edges the other way than the faces there
    tail, head = np.where(back, edge[rows, 2], edge[rows, 1]), edge[rows, 1]
    head = np.where(back, head, edge[rows, 2])
    return RimEdges(tail, head, edge[rows, 0], mesh.part[sides.face[first[rows]]])


def _unbalanced(edges: RimEdges, count: int) -> np.ndarray:
    """Find the bodies whose edges do not lead out of each place as often as into it."""
    at = np.concatenate([pair_key(count, edges.body, at) for at in (edges.tail, edges.head)])
    place, inverse = np.unique(at, return_inverse=True)
    net = np.bincount(inverse, np.repeat([1, -1], len(edges.tail)), len(place))
    return np.unique(place[net != 0] // count)


def _main_part(edges: RimEdges, places: np.ndarray) -> dict[int, int]:
    """Find the part that most of the length of each body's edges is of."""
    length = np.hypot(*(places[edges.head] - places[edges.tail]).T)
    pairs, inverse = np.unique(
        np.stack([edges.body, edges.part], axis=1), axis=0, return_inverse=True
    )
    total = np.bincount(inverse.ravel(), length)
    return {int(pairs[i, 0]): int(pairs[i, 1]) for i in np.argsort(total, kind="stable")}


def _loops(edges: RimEdges, places: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Follow edges round: the places of each loop, and the body (L,) of each."""
    follow = _following(edges, places).tolist()
    seen, rings, first = [False] * len(follow), [], []
    for begin in range(len(follow)):
        if seen[begin]:
            continue
        ring, i = [], begin
        while not seen[i]:
            seen[i] = True
            ring.append(i)
            i = follow[i]
        rings.append(edges.tail[ring])
        first.append(begin)
    return rings, edges.body[first]


def _following(edges: RimEdges, places: np.ndarray) -> np.ndarray:
    """Find the edge that follows each, (R,), so that loops may touch but do not cross."""
    count = len(places)
    tail, head = (pair_key(count, edges.body, at) for at in (edges.tail, edges.head))
    order = np.argsort(tail, kind="stable")
    first = np.searchsorted(tail[order], head)
    degree = np.searchsorted(tail[order], head, side="right") - first
    follow = order[first]
    for place in np.unique(head[degree > 1]):  # few: where a body touches itself
        into, out = np.flatnonzero(head == place), np.flatnonzero(tail == place)
        back = _heading(places[edges.tail[into]] - places[edges.head[into]])
        ahead = _heading(places[edges.head[out]] - places[edges.tail[out]])
        # the solid lies to the left of both: it is what is between them, clockwise from the first
        turn = (back[:, None] - ahead) % (2.0 * np.pi)
        turn[turn < 1e-9] = 2.0 * np.pi
        for _ in range(len(into)):
            i, j = np.unravel_index(turn.argmin(), turn.shape)
            follow[into[i]] = out[j]
            turn[i], turn[:, j] = np.inf, np.inf
    return follow


def _heading(way: np.ndarray) -> np.ndarray:
    """Measure the angle of vectors (N, 2), (N,)."""
    return np.arctan2(way[:, 1], way[:, 0])


def _with_caps(
    mesh: CutMesh,
    plane: Plane,
    nodes: np.ndarray,
    faces: np.ndarray,
    body: np.ndarray,
    part: dict[int, int],
) -> CutMesh:
    """Add flat faces (M, 3) of bodies (M,) over `nodes` (N,), places of the mesh; see `cap_faces`.

    `part` : of each body
    """
    count, normal, one = len(mesh.weld), plane.normal, np.ones((len(nodes), 1))
    along = np.eye(3)[(plane.axis + 1) % 3]
    flat = {
        "vertices": mesh.at["vertices"][nodes],
        "normals": one * normal,
        "pdir1": one * along,
        "pdir2": one * np.cross(normal, along),
        "dcurv": np.zeros((len(nodes), 4)),
        "k1": np.zeros(len(nodes)),
        "k2": np.zeros(len(nodes)),
    }
    of_body = np.unique(body, return_inverse=True)[1].ravel()
    return replace(
        mesh,
        at={name: np.concatenate([old, flat[name]]) for name, old in mesh.at.items()},
        weld=np.r_[mesh.weld, nodes],
        origin=np.r_[mesh.origin, np.full(len(nodes), -1)],
        faces=np.concatenate([mesh.faces, faces + count]),
        source=np.r_[mesh.source, np.full(len(faces), -1)],
        part=np.r_[mesh.part, [part[int(b)] for b in body]].astype(np.int64),
        polygon=np.r_[mesh.polygon, mesh.polygon.max() + 1 + of_body],
        body=np.r_[mesh.body, body],
        closed=np.r_[mesh.closed, np.ones(len(faces), bool)],
        rim=np.concatenate([mesh.rim, np.zeros((len(faces), 3), bool)]),
    )
