"""Make a mesh fit to be measured: weld, stitch, part, turn, split at creases.

Lengths are of the longest side of the mesh.
"""

from __future__ import annotations

import numpy as np

from ..geometry.curves import runs
from ..geometry.near import linked_groups
from .connectivity import Connectivity
from .messages import warn
from .normals import vertex_normals
from .sheets import part_sheets, tangled_vertices
from .soup import Soup
from .stitch import stitch
from .triangles import (
    TINY,
    Edges,
    any_corner,
    blocks,
    bounds,
    column_cross,
    column_dot,
    columns,
    row_dot,
    scatter_sum,
)
from .weld import close_cracks, drop_flat_faces, drop_repeated_faces, first_at_place

STRAY = 1e-3  # of the area: so few faces are not what the mesh is about
LONE = 2e-2  # of the area: nor are so few, if beside them all else would be a dot
LOST = 1e-3  # of the size of all: what is smaller would be a dot
SMALL = 0.25  # of the size of all: what is smaller is drawn small
BINS = 64  # along the longest axis, in which areas are summed up
# Squared length of a component's boundary over its area, up to which it is nearly closed, as a ball
# with a jagged hole of half its radius; volume over area to the power of 1.5, of a ball .094.
NEARLY_CLOSED, LEAST_FILL = 2.0, 0.01
FAN_STEPS = 32  # faces round a vertex, that are gone round
LONG_EDGE = 0.03  # edges so long that normals must not run from a tip along them


def centre_and_scale(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Move and scale points (V, 3) to box centre 0 and longest side 1.

    Returns them, and the centre (3,) and the scale that undo it. Raises ValueError where they have
    no size, or none that can be handled.
    """
    low, high = bounds(points)
    centre = 0.5 * low + 0.5 * high  # halves first: coordinates may be near the largest float
    scale = float((0.5 * high - 0.5 * low).max())
    if not scale > 0.0:
        raise ValueError("all its points coincide: nothing to draw")
    if not 1e-150 < scale < 1e150:
        raise ValueError(f"its size ({2.0 * scale:g}) cannot be handled: rescale it")
    return (points - centre) / (2.0 * scale), centre, 2.0 * scale


def left_out(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """Find faces (F,) bool that lie so far from the others that these would be less than a pixel.

    Warns of them, and of faces not so far, but beside which all else is small. Only few are meant:
    LONE of the area at most, or STRAY where nothing is left out. None where there are none.
    """
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    there = vertices if used.all() else vertices[used]
    low, high = bounds(there)
    size = float((high - low).max())
    if not 0.0 < size < np.inf or _fills_its_box(vertices, faces, low, high):
        return None
    corner = vertices[faces]
    side = (corner[:, 1:] - corner[:, :1]) / size
    cross = np.cross(side[:, 0], side[:, 1])
    area = np.sqrt(row_dot(cross, cross))
    for share, limit in ((LONE, LOST), (STRAY, SMALL)):
        far, rest = _far_from_most(corner, area, share)
        if far.any() and rest < limit * size:
            break
    else:
        return None
    gone = rest < LOST * size
    what = "left out" if gone else "all else is drawn small; take them out if they are strays"
    warn(
        f"{far.sum()} of its {len(faces)} faces lie far from the others, which make but "
        f"{rest:.3g} of its size of {size:.3g}: {what}"
    )
    return far if gone else None


def _fills_its_box(
    vertices: np.ndarray, faces: np.ndarray, low: np.ndarray, high: np.ndarray
) -> bool:
    """Tell quickly, and roughly, of most meshes that none of their faces lie far from the others.

    What `_far_from_most` takes for the others has all but three shares of the area. So it reaches
    from the place along an axis before which four shares lie to that beyond which four do. Places
    are told to one of BINS of the longest axis, and areas in single precision.

    `low`, `high` : (3,), the least and the greatest coordinate of each axis
    """
    axis = int((high - low).argmax())
    size = high[axis] - low[axis]
    with np.errstate(all="ignore"):  # what no face uses may be anything
        points = columns(((vertices - low) / size).astype(np.float32))
    area = np.zeros(BINS)
    for block in blocks(len(faces)):
        corner = [points.take(faces[block, i], axis=1) for i in range(3)]
        cross = column_cross(corner[1] - corner[0], corner[2] - corner[0])
        middle = (corner[0][axis] + corner[1][axis] + corner[2][axis]) * (BINS / 3)
        middle = np.minimum(middle, BINS - 1).astype(np.int64)
        area += np.bincount(middle, np.sqrt(column_dot(cross, cross)), BINS)
    before = np.cumsum(area) / max(area.sum(), TINY)
    for share, limit in ((LONE, LOST), (STRAY, SMALL)):
        first, last = np.searchsorted(before, [4.0 * share, 1.0 - 4.0 * share])
        if not last - first - 1 > limit * BINS:
            return False
    return True


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


def mend(points: np.ndarray, faces: np.ndarray, stitched: bool = True) -> Soup:
    """Merge vertices at one place, close cracks and T-junctions, drop faces that are none.

    Where more than two faces meet in an edge, the sheets there get vertices of their own. The order
    of vertices stays, and that of faces where none is cut. Vertices that no face uses go.

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
    place = first_at_place(points)
    soup = drop_repeated_faces(Soup(points, place[faces], np.arange(len(faces))))
    closed = close_cracks(soup)
    if closed is not None:
        place = closed[place]
        soup = drop_repeated_faces(soup.with_faces(closed[soup.faces], soup.kept))
    if not soup.shape.has_area.any():
        raise ValueError(f"none of its {len(faces)} faces has any area: nothing to draw")
    if stitched:
        soup = stitch(soup)
    soup = drop_flat_faces(soup)
    if stitched:
        tangled = tangled_vertices(soup)
        if tangled.any():
            origin = _origins(faces[soup.kept], place, soup.faces)
            soup = part_sheets(soup, tangled, origin)
    return soup.compact()


def _origins(given: np.ndarray, place: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Name the corners of faces (F, 3) as the file did, (F, 3); those that are stitched on, apart.

    `given` : (F, 3), the corners in the file; `place` : (V,), which vertex each of the file is now
    """
    origin = len(place) + faces
    for own in given.T:
        origin = np.where(place[own][:, None] == faces, own[:, None], origin)
    return origin


def faces_to_flip(soup: Soup) -> np.ndarray:
    """Find the faces (F,) bool to turn over so that the winding agrees within each component.

    Outward where it is closed, or open by NEARLY_CLOSED at most and encloses something all the
    same; else as most faces have it.
    """
    edges, faces = soup.edges, soup.faces
    clash = soup.clashing_edges
    turn = _majority_turn(edges, clash) if clash.any() else np.zeros(len(faces), bool)
    component, count = edges.component, edges.component.max() + 1
    of = np.maximum(np.bincount(component, minlength=count), 1)
    signed = np.zeros(len(faces))
    for axis, across in zip(columns(soup.points), soup.shape.cross, strict=True):
        middle = sum(axis.take(faces[:, i]) for i in range(3)) / 3.0
        middle -= (scatter_sum(component, middle, count) / of)[component]
        signed += middle * across
    np.negative(signed, out=signed, where=turn)
    volume = np.bincount(component, weights=signed) / 6.0
    area = 0.5 * np.bincount(component, weights=soup.shape.size)
    rim = np.flatnonzero(edges.uses == 1)
    ends = soup.points[edges.ends[rim]]
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
    label = linked_groups(np.stack([rows, columns]), 2 * n)
    kept, turned = label[:n], label[n:]
    # of the two windings of a component, the one that more faces have; the lower label at a tie
    votes = np.bincount(kept, minlength=label.max() + 1)
    return (votes[turned] > votes[kept]) | ((votes[turned] == votes[kept]) & (turned < kept))


def split_at_creases(mesh: Connectivity, crease: float) -> Connectivity:
    """Give each side of a sharp edge vertices of its own.

    Sharp are the `creases`, edges that meet in a tip, those that no winding can agree about, and
    those of more than two faces. A vertex is repeated once for each group of its faces that is
    joined through other edges, so that one sharp edge alone changes nothing.

    Parameters
    ----------
    mesh : longest side 1, no two vertices at one place
    crease : degrees; 180 for no creases and tips
    """
    faces, edges, count = mesh.faces, mesh.edges, len(mesh.vertices)
    cut = _sharp_edges(mesh, crease) | mesh.clashing_edges | (edges.uses != 2)
    if not (cut & (edges.uses > 1)).any():
        return mesh
    near = np.zeros(count, bool)
    near[edges.ends[cut]] = True
    near |= _pinched(faces, edges, near)
    corner, group = _joined_corners(faces, edges, cut, near)
    old = np.empty(group.max() + 1, np.int64)
    old[group] = faces.ravel()[corner]
    # the first group of each vertex keeps its number, the others get new ones
    order = np.argsort(old, kind="stable")
    first = np.zeros(len(old), bool)
    first[runs(old[order])[:-1]] = True
    number = np.empty(len(old), np.int64)
    number[order[first]] = old[order[first]]
    number[order[~first]] = count + np.arange((~first).sum())
    split = faces.ravel().copy()
    split[corner] = number[group]
    return mesh.split(split.reshape(-1, 3), np.r_[np.arange(count), old[order[~first]]])


def _sharp_edges(mesh: Connectivity, crease: float) -> np.ndarray:
    """Find creases, and edges that meet in a tip, (E,) bool; none but edges of two faces."""
    edges, clash = mesh.edges, mesh.clashing_edges
    if crease >= 180.0:
        return np.zeros(len(edges), bool)
    inner = edges.uses == 2
    sharp = mesh.creases(crease) & ~clash & inner
    tip = cone_apices(mesh, np.cos(np.radians(crease)))
    if not tip.any():
        return sharp
    tip[edges.ends[inner & (sharp | clash)]] = False  # cut as it is
    return sharp | (inner & tip[edges.ends].any(axis=1))


def _pinched(faces: np.ndarray, edges: Edges, known: np.ndarray) -> np.ndarray:
    """Find vertices (V,) bool that several closed fans of faces have in common, but those `known`.

    Round each vertex one goes from face to face, until back at the first: after fewer steps than
    there are faces, others are left. Of more than FAN_STEPS it may be so.
    """
    corner, ends = faces.ravel(), edges.beyond.ravel()
    degree = np.bincount(corner, minlength=len(known))
    start = np.empty(len(known), np.int64)
    start[corner] = np.arange(len(corner))
    vertex = np.flatnonzero(~known & (degree > 0))
    at, pinched = start[vertex], np.zeros(len(known), bool)
    for step in range(1, FAN_STEPS):
        at = ends.take(at)
        at += np.where(at % 3 == 2, -2, 1)  # the end of that side
        back = at == start.take(vertex)
        pinched[vertex[back]] = degree[vertex[back]] != step
        vertex, at = vertex[~back], at[~back]
        if not len(vertex):
            break
    pinched[vertex] = True
    return pinched


def _joined_corners(
    faces: np.ndarray, edges: Edges, cut: np.ndarray, near: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Group the corners of faces at vertices `near` (V,) that edges join which are not `cut` (E,).

    Returns the corners (N,), corner i of face f as 3 f + i, and the group (N,) of each.
    """
    corner = np.flatnonzero(near[faces.ravel()])
    local = np.full(faces.size, -1)
    local[corner] = np.arange(len(corner))
    joined = np.flatnonzero(~cut & near[edges.ends].any(axis=1))
    links = []
    for side in edges.sides[joined].T:
        after = side - side % 3 + (side + 1) % 3
        forward = faces.ravel()[side] == edges.ends[joined, 0]
        links.append(np.r_[np.where(forward, side, after), np.where(forward, after, side)])
    link = local[np.stack(links)]
    return corner, linked_groups(link[:, link[0] >= 0], len(corner))


def cone_apices(mesh: Connectivity, cosine: float) -> np.ndarray:
    """Find vertices such as a cone's, that no normal fits, (V,) bool.

    Some face turns from theirs by more than the crease angle, whose `cosine` is given. Only where
    edges are long: between long thin faces, normals that run from a tip would bend the outline.
    """
    points, faces, ends = mesh.vertices, mesh.faces, mesh.edges.ends
    vectors = points[ends[:, 0]] - points[ends[:, 1]]
    length = np.sqrt(row_dot(vectors, vectors))
    tip = np.zeros(len(points), bool)
    if length.max() < LONG_EDGE:
        return tip
    uses = np.maximum(np.bincount(ends.ravel(), minlength=len(points)), 1)
    mean = np.bincount(ends.ravel(), weights=np.repeat(length, 2), minlength=len(points)) / uses
    far = mean >= LONG_EDGE
    if not far.any():
        return tip
    face = np.flatnonzero(any_corner(faces, far))
    vertex, normal = vertex_normals(points, faces[face]), mesh.normals[1][:, face].T
    for i in range(3):
        corner = faces[face, i]
        tip[corner[row_dot(normal, vertex[corner]) < cosine]] = True
    return tip & far
