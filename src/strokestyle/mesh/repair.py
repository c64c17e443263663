"""Make a mesh fit to be measured: weld, stitch, part, turn, split at creases.

Lengths are of the longest side of the mesh.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..geometry.curves import runs
from .creases import creases
from .curvature import vertex_normals
from .messages import warn
from .sheets import part_sheets
from .stitch import stitch
from .triangles import Edges, bends, clashes, face_normals, polygon_normals, row_dot, scatter_sum
from .weld import (
    close_cracks,
    drop_flat_faces,
    drop_repeated_faces,
    drop_unused_vertices,
    first_at_place,
    has_area,
)

STRAY = 1e-3  # of the area: so few faces are not what the mesh is about
LONE = 2e-2  # of the area: nor are so few, if beside them all else would be a dot
LOST = 1e-3  # of the size of all: what is smaller would be a dot
# Squared length of a component's boundary over its area, up to which it is nearly closed, as a ball
# with a jagged hole of half its radius; volume over area to the power of 1.5, of a ball .094.
NEARLY_CLOSED, LEAST_FILL = 2.0, 0.01
LONG_EDGE = 0.03  # edges so long that normals must not run from a tip along them


def centre_and_scale(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Move and scale points (V, 3) to box centre 0 and longest side 1.

    Returns them, and the centre (3,) and the scale that undo it. Raises ValueError where they have
    no size, or none that can be handled.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centre = 0.5 * low + 0.5 * high  # halves first: coordinates may be near the largest float
    scale = float((0.5 * high - 0.5 * low).max())
    if not scale > 0.0:
        raise ValueError("all its points coincide: nothing to draw")
    if not 1e-150 < scale < 1e150:
        raise ValueError(f"its size ({2.0 * scale:g}) cannot be handled: rescale it")
    return (points - centre) / (2.0 * scale), centre, 2.0 * scale


def left_out(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Find faces (F,) bool that lie so far from the others that these would be less than a pixel.

    Warns of them, and of faces not so far, but beside which all else is small. Only few are meant:
    LONE of the area at most, or STRAY where nothing is left out.
    """
    corner = vertices[faces]
    size = float(np.ptp(vertices[np.unique(faces)], axis=0).max())
    if not 0.0 < size < np.inf:
        return np.zeros(len(faces), bool)
    side = (corner[:, 1:] - corner[:, :1]) / size
    cross = np.cross(side[:, 0], side[:, 1])
    area = np.sqrt(row_dot(cross, cross))
    for share, limit in ((LONE, LOST), (STRAY, 0.25)):
        far, rest = _far_from_most(corner, area, share)
        if far.any() and rest < limit * size:
            break
    else:
        return np.zeros(len(faces), bool)
    gone = rest < LOST * size
    what = "left out" if gone else "all else is drawn small; take them out if they are strays"
    warn(
        f"{far.sum()} of its {len(faces)} faces lie far from the others, which make but "
        f"{rest:.3g} of its size of {size:.3g}: {what}"
    )
    return far & gone


def _far_from_most(corner: np.ndarray, area: np.ndarray, share: float) -> tuple[np.ndarray, float]:
    """Find faces (F, 3, 3) of a `share` of the area at most, far from the others: (F,) bool.

    Far is further off than the others are large, which is returned too; none are, if they hold
    more than their share.
    """
    low, high = corner.min(axis=1), corner.max(axis=1)
    limit = 0.5 * share * area.sum()
    middle, box = 0.5 * low + 0.5 * high, []
    for axis in middle.T:
        order = np.argsort(axis)
        first, last = np.searchsorted(np.cumsum(area[order]), [limit, area.sum() - limit])
        box.append(axis[order[[first, min(last, len(order) - 1)]]])
    start, end = np.array(box).T
    core = ((middle >= start) & (middle <= end)).all(axis=1)
    if not core.any():
        return core, np.inf
    start, end = low[core].min(axis=0), high[core].max(axis=0)
    rest = float((end - start).max())
    far = ((low > end + rest) | (high < start - rest)).any(axis=1)
    return far & (area[far].sum() <= share * area.sum()), rest


class Mended(NamedTuple):
    """A mesh made fit to be measured.

    Parameters
    ----------
    points : (V, 3), the vertices that are used
    faces : (F, 3) int
    kept : (F,) int, the face given that each was, or was cut from
    """

    points: np.ndarray
    faces: np.ndarray
    kept: np.ndarray


def mend(points: np.ndarray, faces: np.ndarray, stitched: bool = True) -> Mended:
    """Merge vertices at one place, close cracks and T-junctions, drop faces that are none.

    Where more than two faces meet in an edge, the sheets there get vertices of their own. The order
    of vertices stays, and that of faces where none is cut.

    Parameters
    ----------
    points : (V, 3), longest side 1
    faces : (F, 3) int
    stitched : look for T-junctions, and part sheets

    Raises
    ------
    ValueError
        where no face has any area.
    """
    given, place = faces, first_at_place(points)
    faces, kept = drop_repeated_faces(place[faces], np.arange(len(faces)))
    if len(faces):
        closed = close_cracks(points, faces)
        place = closed[place]
        faces, kept = drop_repeated_faces(closed[faces], kept)
    if not (len(faces) and has_area(points, faces).any()):
        raise ValueError(f"none of its {len(given)} faces has any area: nothing to draw")
    if stitched:
        faces, kept = stitch(points, faces, kept)
    faces, kept = drop_flat_faces(points, faces, kept)
    if stitched:
        origin = _origins(given[kept], place, faces)
        points, faces = part_sheets(points, faces, origin)
    return Mended(*drop_unused_vertices(points, faces), kept)


def _origins(given: np.ndarray, place: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Name the corners of faces (F, 3) as the file did, (F, 3); those that are stitched on, apart.

    `given` : (F, 3), the corners in the file; `place` : (V,), which vertex each of the file is now
    """
    origin = len(place) + faces
    for own in given.T:
        origin = np.where(place[own][:, None] == faces, own[:, None], origin)
    return origin


def faces_to_flip(points: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """Find the faces (F,) bool to turn over so that the winding agrees within each component.

    Outward where it is closed, or open by NEARLY_CLOSED at most and encloses something all the
    same; else as most faces have it.
    """
    clash = clashes(faces, edges)
    turn = _majority_turn(edges, clash) if clash.any() else np.zeros(len(faces), bool)
    component, count = edges.component, edges.component.max() + 1
    corner = points[faces]
    middle = corner.mean(axis=1)
    of = np.maximum(np.bincount(component, minlength=count), 1)
    centre = np.stack([scatter_sum(component, axis, count) / of for axis in middle.T], axis=1)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    signed = np.where(turn, -1.0, 1.0) * row_dot(middle - centre[component], cross)
    volume = np.bincount(component, weights=signed) / 6.0
    area = 0.5 * np.bincount(component, weights=np.sqrt(row_dot(cross, cross)))
    rim = edges.uses == 1
    ends = points[edges.ends[rim]]
    length = np.sqrt(row_dot(ends[:, 1] - ends[:, 0], ends[:, 1] - ends[:, 0]))
    around = scatter_sum(component[edges.faces[rim, 0]], length, count)
    hollow = (around == 0.0) | (volume**2 > LEAST_FILL**2 * area**3)
    outward = (around**2 <= NEARLY_CLOSED * area) & hollow
    return turn ^ (outward & (volume < 0.0))[component]


def _majority_turn(edges: Edges, clash: np.ndarray) -> np.ndarray:
    """Find the faces (F,) bool to turn over so that neighbours agree and most faces stay.

    Two copies of each face, one per winding. Copies that must go together are connected; a
    component is orientable when its two windings stay apart.
    """
    inner = edges.uses == 2
    f, g = edges.faces[inner].T
    swap, n = clash[inner], len(edges.of_side)
    rows, columns = np.r_[f, f + n], np.r_[np.where(swap, g + n, g), np.where(swap, g, g + n)]
    links = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(2 * n, 2 * n))
    label = connected_components(links, directed=False)[1]
    kept, turned = label[:n], label[n:]
    # of the two windings of a component, the one that more faces have; the lower label at a tie
    votes = np.bincount(kept, minlength=label.max() + 1)
    return (votes[turned] > votes[kept]) | ((votes[turned] == votes[kept]) & (turned < kept))


def split_at_creases(
    points: np.ndarray,
    faces: np.ndarray,
    edges: Edges,
    crease: float,
    polygon: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Give each side of a sharp edge vertices of its own.

    Sharp are the `creases`, edges that meet in a tip, those that no winding can agree about, and
    those of more than two faces. A vertex is repeated once for each group of its faces that is
    joined through other edges, so that one sharp edge alone changes nothing.

    Parameters
    ----------
    points : (V, 3), longest side 1
    faces : (F, 3) int
    edges : those of the faces
    crease : degrees; 180 for no creases and tips
    polygon : (F,) int, which polygon each face was cut from; by default each is one

    Returns
    -------
    faces (F, 3) over the new vertices, and the old vertex (V',) of each of these
    """
    inner = np.flatnonzero(edges.uses == 2)
    clash = clashes(faces, edges)
    sharp = _sharp_edges(points, faces, edges, clash, crease, polygon)[inner]
    if not (sharp.any() or clash[inner].any() or (edges.uses > 2).any()):
        return faces, np.arange(len(points))
    group = _joined_corners(faces, edges, inner[~(sharp | clash[inner])])
    old = np.empty(group.max() + 1, np.int64)
    old[group] = faces.ravel()
    # the first group of each vertex keeps its number, the others get new ones
    order = np.argsort(old, kind="stable")
    first = np.zeros(len(old), bool)
    first[runs(old[order])[:-1]] = True
    number = np.empty(len(old), np.int64)
    number[order[first]] = old[order[first]]
    number[order[~first]] = len(points) + np.arange((~first).sum())
    return number[group].reshape(faces.shape), np.r_[np.arange(len(points)), old[order[~first]]]


def _sharp_edges(
    points: np.ndarray,
    faces: np.ndarray,
    edges: Edges,
    clash: np.ndarray,
    crease: float,
    polygon: np.ndarray | None,
) -> np.ndarray:
    """Find creases, and edges that meet in a tip, (E,) bool; none but edges of two faces."""
    sharp = np.zeros(len(edges), bool)
    if crease >= 180.0:
        return sharp
    inner = edges.uses == 2
    normal = face_normals(points, faces, edges)
    if polygon is not None:
        normal = polygon_normals(points, faces, normal, polygon)
    bend = bends(normal, edges, clash, polygon)
    found = creases(points, edges, bend, np.radians(crease))
    sharp = found & ~clash & inner
    tip = cone_apices(points, faces, edges.ends, normal, np.cos(np.radians(crease)))
    tip[edges.ends[inner & (sharp | clash)]] = False  # cut as it is
    return sharp | (inner & tip[edges.ends].any(axis=1))


def _joined_corners(faces: np.ndarray, edges: Edges, joined: np.ndarray) -> np.ndarray:
    """Group the corners (3 F,) of faces that belong together: at the ends of edges `joined`."""
    links = []
    for side in edges.sides[joined].T:
        after = side - side % 3 + (side + 1) % 3
        forward = faces.ravel()[side] == edges.ends[joined, 0]
        links.append(np.r_[np.where(forward, side, after), np.where(forward, after, side)])
    graph = coo_matrix((np.ones(len(links[0]), np.int8), links), shape=(faces.size, faces.size))
    return connected_components(graph, directed=False)[1]


def cone_apices(
    points: np.ndarray, faces: np.ndarray, edges: np.ndarray, normal: np.ndarray, cosine: float
) -> np.ndarray:
    """Find vertices such as a cone's, that no normal fits, (V,) bool.

    Some face turns from theirs by more than the crease angle. Only where edges are long: between
    long thin faces, normals that run from a tip would bend the outline.

    Parameters
    ----------
    points : (V, 3), longest side 1
    faces : (F, 3) int
    edges : (E, 2) int, the vertices of each edge
    normal : (F, 3), of the faces
    cosine : of the crease angle
    """
    vectors = points[edges[:, 0]] - points[edges[:, 1]]
    length = np.sqrt(row_dot(vectors, vectors))
    tip = np.zeros(len(points), bool)
    if length.max() < LONG_EDGE:
        return tip
    uses = np.maximum(np.bincount(edges.ravel(), minlength=len(points)), 1)
    mean = np.bincount(edges.ravel(), weights=np.repeat(length, 2), minlength=len(points)) / uses
    vertex = vertex_normals(points, faces)
    for i in range(3):
        tip[faces[row_dot(normal, vertex[faces[:, i]]) < cosine, i]] = True
    return tip & (mean >= LONG_EDGE)
