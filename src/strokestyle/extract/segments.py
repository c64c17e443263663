"""Lines on the surface: contours, suggestive contours, apparent ridges, ridges, valleys, creases, boundaries,
intersections.

Segments are found face by face, below the resolution of the mesh, where a linearly interpolated per-vertex field
crosses zero; they are then chained across faces into the longest polylines. Conventions and thresholds are rtsc's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..geometry.curves import KINDS
from ..mesh.creases import creases
from ..mesh.surface import Surface
from ..mesh.triangles import all_corners, any_corner, bends, row_dot
from .intersections import crossings
from .line_options import LineOptions
from .surface_curves import interpolate_on_faces
from .view_curvature import ViewFields

LEAST_CROSSING = 10.0  # degrees, see intersection_segments
NEXT_CORNER, CORNER_BEFORE = (
    np.array([1, 2, 0]),
    np.array([2, 0, 1]),
)  # the corners after and before corner 0, 1, 2


# -------------------------------------------------------------------------------------------------------- segments


@dataclass(frozen=True)
class Segments:
    """Straight pieces of one kind of line, each within one face.

    Parameters
    ----------
    kind : index into curves.KINDS
    face : (S,) int64
    bary : (S, 2, 3) float64, both ends
    node : (S, 2) int64, names of the ends: pieces that share a name are joined there
    strength : (S, 2) float64
    """

    kind: int
    face: np.ndarray
    bary: np.ndarray
    node: np.ndarray
    strength: np.ndarray

    def __len__(self) -> int:
        return len(self.face)

    def none(self) -> Segments:
        """No segments of the same kind."""
        return self.take(slice(0, 0))

    def take(self, index) -> Segments:
        return Segments(
            self.kind, self.face[index], self.bary[index], self.node[index], self.strength[index]
        )

    def points(self, surface: Surface) -> np.ndarray:
        """(S, 2, 3)."""
        return np.einsum("sei,sik->sek", self.bary, surface.vertices[surface.faces[self.face]])


def _zero_lines(
    surface: Surface, value: np.ndarray, kind: str, among=None, rims: bool = True
) -> Segments:
    """Where `value` (V,), linear on each face, is zero; the higher side lies to the left, seen from outside.

    Zero counts as positive, everywhere alike, so that lines never end inside the mesh. Ends are named by mesh edge.
    `rims` : also along edges whose both ends are exactly 0, such as around flat parts where all of it is 0.
    `among` : indices of the faces to look at, all by default.
    """
    faces = surface.faces if among is None else surface.faces[among]
    high = value >= 0.0
    crossed = any_corner(faces, high) & ~all_corners(faces, high)
    if not rims:
        a, b, c = ((value == 0.0)[faces[:, i]] for i in range(3))
        crossed &= ~(a & b | b & c | c & a)
    mixed = np.flatnonzero(crossed)
    face = mixed if among is None else among[mixed]
    high = high[surface.faces[face]]
    ups = high.sum(axis=1)
    # the corner that is alone on its side
    odd = np.argmax(high == (ups == 1)[:, None], axis=1)
    after, before = NEXT_CORNER[odd], CORNER_BEFORE[odd]
    row = np.arange(len(mixed))
    corner_value = value[surface.faces[face]]
    own, a, b = corner_value[row, odd], corner_value[row, after], corner_value[row, before]
    bary = np.zeros((len(mixed), 2, 3))
    for end, (other, corner) in enumerate(((a, after), (b, before))):
        t = own / (own - other)  # signs differ, so this is never 0 / 0
        bary[row, end, odd], bary[row, end, corner] = 1.0 - t, t
    corner = surface.faces[face]
    node = np.stack(
        [_edge_name(surface, corner[row, odd], corner[row, other]) for other in (after, before)],
        axis=1,
    )
    # walking from side (odd, after) to side (odd, before) has the odd corner on the left
    flip = ups == 2
    bary[flip], node[flip] = bary[flip, ::-1], node[flip, ::-1]
    return Segments(KINDS.index(kind), face, bary, node, np.ones((len(mixed), 2)))


def _edge_name(surface: Surface, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The name of the point of a line on the edge between vertices a and b, one side of it where it is cut."""
    return np.minimum(a, b) * len(surface.vertices) + np.maximum(a, b)


def _first_free_name(surface: Surface) -> int:
    """Names from here on are no edge's and no vertex's."""
    return len(surface.vertices) ** 2 + len(surface.vertices)


def _vertex_name(surface: Surface, vertex: np.ndarray) -> np.ndarray:
    """The name of the end of a line at a vertex's place."""
    return len(surface.vertices) ** 2 + surface.weld[vertex]


def _keep_positive(
    segments: Segments, numerator: np.ndarray, denominator: np.ndarray, names: np.ndarray
) -> Segments:
    """Cut segments to where numerator / denominator, (S, 2) each and linear along a segment, is not negative.

    names (S, 2) : of the ends made where the numerator is 0 and where the denominator is 0
    """
    n0, n1 = numerator.T
    d0, d1 = denominator.T

    def zero(a, b):  # of a linear function from a to b; 1 where it has none inside
        crosses = (a >= 0.0) != (b >= 0.0)
        return np.where(crosses, a / np.where(crosses, a - b, 1.0), 1.0)

    good = (n0 >= 0.0) == (d0 >= 0.0)
    cuts = np.stack([zero(n0, n1), zero(d0, d1)], axis=1)
    order = np.argsort(cuts, axis=1)
    cuts, names = np.take_along_axis(cuts, order, axis=1), np.take_along_axis(names, order, axis=1)
    count = len(segments)
    stops = np.column_stack([np.zeros(count), cuts, np.ones(count)])
    stop_names = np.column_stack([segments.node[:, 0], names, segments.node[:, 1]])
    stop_names = np.where(stops >= 1.0, segments.node[:, 1:], stop_names)
    index, low, high, node = [], [], [], []
    for i in range(3):  # validity alternates at each cut
        rows = np.flatnonzero((good ^ bool(i % 2)) & (stops[:, i + 1] > stops[:, i]))
        index.append(rows)
        low.append(stops[rows, i])
        high.append(stops[rows, i + 1])
        node.append(stop_names[rows, i : i + 2])
    index, node = np.concatenate(index), np.concatenate(node)
    t = np.stack([np.concatenate(low), np.concatenate(high)], axis=1)
    part = segments.take(index)
    bary = part.bary[:, :1] * (1.0 - t)[:, :, None] + part.bary[:, 1:] * t[:, :, None]
    strength = part.strength[:, :1] * (1.0 - t) + part.strength[:, 1:] * t
    order = np.argsort(index, kind="stable")
    return Segments(part.kind, part.face[order], bary[order], node[order], strength[order])


def _new_names(surface: Surface, segments: Segments) -> np.ndarray:
    """(S, 2) names of ends inside of faces, all different."""
    return _first_free_name(surface) + np.arange(2 * len(segments)).reshape(-1, 2)


def values_at_ends(surface: Surface, segments: Segments, value: np.ndarray) -> np.ndarray:
    """Per-vertex values (V,) at both ends of each segment, (S, 2)."""
    return np.einsum("sei,si->se", segments.bary, value[surface.faces[segments.face]])


class Trimmed(NamedTuple):
    """Lines of one kind: those that may be seen, and those that the shape hides however one looks."""

    shown: Segments
    unseen: Segments


def contour_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Trimmed:
    """Find occluding contours: n.v = 0, and creases of which one side faces the eye and one does not.

    On closed surfaces those with positive radial curvature, and convex creases, may be seen. The
    rest lies inside a hollow and is always hidden. On open surfaces one may look at the inside,
    where the signs are reversed. Without `options.trim` nothing is said to be unseen.
    """
    segments = _zero_lines(surface, view.n_dot_v, "contour")
    if not options.trim:
        return Trimmed(_joined(segments, _folds(surface, view, surface.cut_edges)), segments.none())
    radial = values_at_ends(surface, segments, view.radial_curvature(surface))
    radial[~surface.closed_faces[segments.face]] = 1.0
    names = _new_names(surface, segments)
    parts = (
        _keep_positive(segments, sign * radial, np.ones_like(radial), names) for sign in (1, -1)
    )
    edge = surface.cut_edges
    bulges = _convex(surface, edge) | ~surface.closed_faces[surface.edge_faces[edge, 0]]
    folds = (_folds(surface, view, edge[mask]) for mask in (bulges, ~bulges))
    return Trimmed(*(_joined(part, fold) for part, fold in zip(parts, folds, strict=True)))


def _folds(surface: Surface, view: ViewFields, edge: np.ndarray) -> Segments:
    """Parts of cut edges (M,) at which one side faces the eye and the other does not.

    Their face is the one that does. Normals run along the edge on either side. Where those of one
    side turn away, the smooth contour of that side ends at the same point and under the same name.
    """
    parts = []
    for side in range(2):
        segments, own, other, names = _along_cut(surface, view, edge, "contour", side)
        segments = _keep_positive(segments, own, -other, names)
        facing = values_at_ends(surface, segments, view.n_dot_v).mean(axis=1)
        parts.append(segments.take(facing > 0.0))
    return _joined(*parts)


def _convex(surface: Surface, edge: np.ndarray) -> np.ndarray:
    """Does the surface bulge at edges (M,) between two faces? (M,) bool."""
    (face, corner), (other, other_corner) = surface.edge_corners(edge)
    apex = surface.faces[other, 3 - other_corner.sum(axis=1)]
    rise = surface.vertices[apex] - surface.vertices[surface.faces[face, corner[:, 0]]]
    return row_dot(rise, surface.face_normals[face]) <= 0.0


def _along_cut(surface: Surface, view: ViewFields, edge: np.ndarray, kind: str, side: int):
    """Cut edges (M,) as segments in the face on one side; n.v at their ends on that and on the other side, (M, 2) each;
    and the names (M, 2) of the points where the one and the other is 0."""
    segments = edge_segments(surface, edge, kind, side)
    facing, names = [], []
    sides = list(surface.edge_corners(edge))
    for face, corner in (sides[side], sides[1 - side]):
        vertex = surface.faces[face[:, None], corner]
        backwards = _vertex_name(surface, vertex[:, 0]) != segments.node[:, 0]
        vertex[backwards] = vertex[backwards, ::-1]
        facing.append(view.n_dot_v[vertex])
        names.append(_edge_name(surface, vertex[:, 0], vertex[:, 1]))
    return segments, *facing, np.stack(names, axis=1)


def _joined(*parts: Segments) -> Segments:
    """Segments of one kind, one after the other."""
    columns = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("face", "bary", "node", "strength")
    )
    return Segments(parts[0].kind, *columns)


def _may_be_seen(surface: Surface, view: ViewFields) -> np.ndarray:
    """(F,) bool: faces that do not turn away all over, and all faces of open surfaces."""
    return any_corner(surface.faces, view.n_dot_v > 0.0) | ~surface.closed_faces


def suggestive_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Suggestive contours (DeCarlo 2003): the radial curvature is 0 and rises towards the eye, fast enough."""
    limit = options.suggestive / surface.feature_size**2
    front = np.flatnonzero(_may_be_seen(surface, view))
    segments = _zero_lines(surface, view.radial_curvature(surface), "suggestive", front, rims=False)
    derivative = values_at_ends(surface, segments, view.radial_derivative(surface))
    facing = values_at_ends(surface, segments, view.n_dot_v)
    # Neural Contours' soft filter, with q = F^2 Dw kr - T n.v; on the inside of open surfaces all signs are reversed
    q = surface.feature_size**2 * derivative - options.suggestive * facing
    q = np.maximum(np.where(facing < 0.0, -q, q), 0.0)
    strength = q / np.maximum(q + 0.03 * np.abs(facing), 1e-12)
    segments = Segments(segments.kind, segments.face, segments.bary, segments.node, strength)
    return _keep_positive(
        segments, derivative - limit * facing, facing, _new_names(surface, segments)
    )


def apparent_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Apparent ridges (Judd 2007): maxima of the view-dependent curvature along its own direction."""
    curvature, direction = view.view_curvature(surface)
    limit = options.apparent / surface.feature_size**2
    strong = any_corner(surface.faces, curvature > limit)
    among = np.flatnonzero(strong & _may_be_seen(surface, view) if options.trim else strong)
    slope = _slope(surface, curvature, direction, view.n_dot_v, among)
    return _extremal_lines(surface, slope, direction, curvature, limit, "apparent", among)


def _slope(surface, value, direction, n_dot_v, among) -> np.ndarray:
    """Derivative of `value` along `direction`, as seen in the image, at the vertices of faces `among`, (V,).

    In each face around a vertex that the line through it meets, the difference to the opposite side, over the distance
    along `direction` shortened by n.v; the mean over these faces.
    """
    count = len(value)
    wanted = np.zeros(count, bool)
    wanted[surface.faces[among]] = True
    near = np.flatnonzero(any_corner(surface.faces, wanted))
    total, hits = np.zeros(count), np.zeros(count)
    side = np.cross(surface.normals, direction)
    for i in range(3):
        faces = surface.faces[near[wanted[surface.faces[near, i]]]]
        own, a, b = faces[:, i], faces[:, NEXT_CORNER[i]], faces[:, CORNER_BEFORE[i]]
        to_a, to_b = (surface.vertices[other] - surface.vertices[own] for other in (a, b))
        across_a, across_b = (np.einsum("ij,ij->i", edge, side[own]) for edge in (to_a, to_b))
        gap = across_b - across_a
        t = across_b / np.where(
            gap == 0.0, 1.0, gap
        )  # weight of a where the line meets the side a b
        meets = (gap != 0.0) & (t >= 0.0) & (t <= 1.0)
        own, a, b, t = own[meets], a[meets], b[meets], t[meets]
        reach = t[:, None] * to_a[meets] + (1.0 - t)[:, None] * to_b[meets]
        distance = np.einsum("ij,ij->i", reach, direction[own]) * np.abs(n_dot_v[own])
        rise = t * value[a] + (1.0 - t) * value[b] - value[own]
        slope = rise / np.where(np.abs(distance) < 1e-12, np.inf, distance)
        total += np.bincount(own, weights=slope, minlength=count)
        hits += np.bincount(own, minlength=count)
    return total / np.maximum(hits, 1.0)


def ridge_segments(surface: Surface, options: LineOptions) -> Segments:
    """Ridges (Ohtake 2004): maxima of the largest principal curvature along its direction, where convex."""
    return _ridge_or_valley(surface, options.ridge, options.sharpness, "ridge", 1.0)


def valley_segments(surface: Surface, options: LineOptions) -> Segments:
    """Valleys: minima of the principal curvature along its direction, where concave."""
    return _ridge_or_valley(surface, options.valley, options.sharpness, "valley", -1.0)


def _ridge_or_valley(
    surface: Surface, threshold: float, sharpness: float, kind: str, sign: float
) -> Segments:
    limit = threshold / surface.feature_size
    curved = all_corners(surface.faces, sign * surface.k1 > 0.0)
    among = np.flatnonzero(curved & any_corner(surface.faces, np.abs(surface.k1) > limit))
    slope = sign * surface.dcurv[:, 0]
    segments = _extremal_lines(
        surface, slope, surface.pdir1, np.abs(surface.k1), limit, kind, among
    )
    if not (sharpness > 0.0 and len(segments)):
        return segments
    clear = np.clip(2.0 * _sharpness(surface, slope, segments.face) / sharpness - 1.0, 0.0, 1.0)
    strength = segments.strength * values_at_ends(surface, segments, clear)
    segments = Segments(segments.kind, segments.face, segments.bary, segments.node, strength)
    return segments.take(np.flatnonzero((strength > 0.0).any(axis=1)))


def _sharpness(surface: Surface, slope: np.ndarray, face: np.ndarray) -> np.ndarray:
    """-k'' / k^3 along the first principal direction, (V,), at the vertices of some faces.

    `slope` (V,) is the derivative of |k1| along pdir1. Its own derivative is taken on each face about these vertices,
    after pointing the directions at its corners the same way, and averaged.
    """
    wanted = np.zeros(len(surface.vertices), bool)
    wanted[surface.faces[face]] = True
    corner = surface.faces[any_corner(surface.faces, wanted)]
    direction = surface.pdir1[corner]
    sign = np.where(row_dot(direction, direction[:, :1]) < 0.0, -1.0, 1.0)
    rise = sign * slope[corner]
    along = (sign[:, :, None] * direction).mean(axis=1)
    point = surface.vertices[corner]
    a, b = point[:, 1] - point[:, 0], point[:, 2] - point[:, 0]
    normal = np.cross(a, b)
    square = np.maximum(row_dot(normal, normal), 1e-30)
    gradient = (rise[:, 1] - rise[:, 0])[:, None] * np.cross(b, normal)
    gradient += (rise[:, 2] - rise[:, 0])[:, None] * np.cross(normal, a)
    bend = row_dot(gradient, along) / square / np.maximum(np.sqrt(row_dot(along, along)), 1e-12)
    count = np.bincount(corner.ravel(), minlength=len(wanted))
    mean = np.bincount(
        corner.ravel(), weights=np.repeat(bend, 3), minlength=len(wanted)
    ) / np.maximum(count, 1)
    return np.where(wanted, -mean / np.maximum(np.abs(surface.k1) ** 3, 1e-12), 0.0)


def _extremal_lines(surface, slope, direction, value, limit, kind, among) -> Segments:
    """Maxima of `value` (V,) along `direction` (V, 3), whose derivative there is `slope` (V,), in faces `among`.

    The direction has no sign of its own: point it uphill. An edge may carry an extremum where the uphill arrows at its
    ends oppose each other. A face with two such edges carries a piece of line; with three, a fork at its centre.
    What tells maxima from minima is rtsc's, and differs: for ridges and valleys, an edge counts if at least one of its
    arrows leads along it towards the other end; for apparent ridges, all three arrows must lead towards the line.
    """
    uphill = slope[:, None] * direction
    arrow, point = uphill[surface.faces[among]], surface.vertices[surface.faces[among]]  # (A, 3, 3)
    arrow_next, along = arrow[:, NEXT_CORNER], point[:, NEXT_CORNER] - point
    crossed = row_dot(arrow, arrow_next) <= 0.0  # (A, 3): side i runs from corner i to i + 1
    if kind != "apparent":
        crossed &= (row_dot(arrow, along) >= 0.0) | (row_dot(arrow_next, along) <= 0.0)
    sides = crossed.sum(axis=1)
    two, three = np.flatnonzero(sides == 2), np.flatnonzero(sides == 3)

    size = np.abs(slope)[surface.faces[among]]
    total = size + size[:, NEXT_CORNER]
    weight = np.where(
        total > 0.0, size / np.where(total > 0.0, total, 1.0), 0.5
    )  # of corner i + 1 at the crossing
    on_side = np.zeros((len(among), 3, 3))  # barycentric coordinates of the crossing of side i
    for i in range(3):
        on_side[:, i, i], on_side[:, i, NEXT_CORNER[i]] = 1.0 - weight[:, i], weight[:, i]

    absent = np.argmin(crossed[two], axis=1)
    ends = np.stack(
        [NEXT_CORNER[absent], CORNER_BEFORE[absent]], axis=1
    )  # the two crossed sides; they meet in corner ends[1]
    if kind == "apparent":
        good = _leads(point[two], arrow[two], *(on_side[two, ends[:, i]] for i in range(2))).all(
            axis=1
        )
        two, ends = two[good], ends[good]
    corner = surface.faces[among]
    edges = _edge_name(surface, corner, corner[:, NEXT_CORNER])
    face, bary, node = [among[two]], [on_side[two[:, None], ends]], [edges[two[:, None], ends]]
    for i in range(3):  # the arms of forks
        arm, centre = three, np.full((len(three), 3), 1.0 / 3.0)
        if kind == "apparent":
            good = _leads(point[arm], arrow[arm], on_side[arm, i], centre).all(axis=1)
            arm, centre = arm[good], centre[good]
        face.append(among[arm])
        bary.append(np.stack([on_side[arm, i], centre], axis=1))
        node.append(np.stack([edges[arm, i], _first_free_name(surface) + among[arm]], axis=1))
    face, bary, node = np.concatenate(face), np.concatenate(bary), np.concatenate(node)
    segments = Segments(KINDS.index(kind), face, bary, node, np.zeros((len(face), 2)))
    height = values_at_ends(surface, segments, value)
    strength = np.maximum(1.0 - limit / np.maximum(height, 1e-30), 0.0)
    segments = Segments(segments.kind, face, bary, node, strength)
    return segments.take(np.flatnonzero((strength > 0.0).any(axis=1)))


def _leads(point, arrow, start, end) -> np.ndarray:
    """Does the arrow at each corner lead towards the line from `start` to `end` (barycentric, (A, 3))? (A, 3)."""
    start, end = (np.einsum("ai,aik->ak", at, point) for at in (start, end))
    across = np.cross(np.cross(point[:, 1] - point[:, 0], point[:, 2] - point[:, 0]), end - start)[
        :, None
    ]
    return row_dot(arrow, across) * np.sign(row_dot(point - start[:, None], across)) < 0.0


def crease_segments(
    surface: Surface, view: ViewFields, options: LineOptions, edge: np.ndarray | None = None
) -> Trimmed:
    """Find creases: mesh edges at which faces meet at more than the crease angle, or more than two do.

    Where contours are drawn too, less what is part of one; what faces away on a closed surface is
    never seen.
    `edge` : the surface's `crease_edges`, where they are known.
    """
    edge = crease_edges(surface, options.crease) if edge is None else edge
    if "contour" not in options.kinds:
        segments = edge_segments(surface, edge, "crease")
        return Trimmed(segments, segments.none())
    cut = np.isin(edge, surface.cut_edges, assume_unique=True)
    segments, own, other, names = _along_cut(surface, view, edge[cut], "crease", 0)
    both = _keep_positive(segments, own, other, names)
    uncut = edge_segments(surface, edge[~cut], "crease")
    if not options.trim:
        return Trimmed(_joined(both, uncut), both.none())
    faces_eye = values_at_ends(surface, both, view.n_dot_v).mean(axis=1) > 0.0
    seen = faces_eye | ~surface.closed_faces[both.face]
    return Trimmed(_joined(both.take(seen), uncut), both.take(~seen))


def crease_edges(surface: Surface, angle: float) -> np.ndarray:
    """Indices of the edges that are creases of more than `angle` degrees, or at which more than two faces meet."""
    count, pair = surface.edge_face_count, surface.edge_faces
    bend = bends(surface.face_normals, pair, count, surface.clashing_edges)
    sharp = creases(
        surface.vertices, surface.edges, surface.face_edges, pair, bend, np.radians(angle)
    )
    return np.flatnonzero(sharp | (count > 2))


def boundary_segments(surface: Surface, options: LineOptions) -> Segments:
    """Mesh edges with one face."""
    return edge_segments(surface, np.flatnonzero(surface.edge_face_count == 1), "boundary")


def edge_segments(surface: Surface, edge: np.ndarray, kind: str, side: int = 0) -> Segments:
    """Whole mesh edges as segments, the first (or second) face at each to their left. Ends are named by place."""
    face, corner = list(surface.edge_corners(edge))[side]
    turn = (corner[:, 0] + 1) % 3 != corner[:, 1]
    corner[turn] = corner[turn, ::-1]
    bary = np.zeros((len(edge), 2, 3))
    bary[np.arange(len(edge))[:, None], [0, 1], corner] = 1.0
    node = _vertex_name(surface, surface.faces[face[:, None], corner])
    return Segments(KINDS.index(kind), face, bary, node, np.ones((len(edge), 2)))


def intersection_segments(surface: Surface, options: LineOptions) -> Segments:
    """Where connected components pass through each other, in the faces of one. Ends are named by place.

    Not where both run along each other, at less than LEAST_CROSSING: two skins of one shape cross wherever their faces
    happen to, and there is no line to be seen.
    """
    found = crossings(surface.vertices, surface.faces, surface.component)
    bary = [
        _barycentric(surface.vertices[surface.faces[face]], found.points) for face in found.face.T
    ]
    normals = [
        interpolate_on_faces(surface, face, at.mean(axis=1), surface.normals)
        for face, at in zip(found.face.T, bary, strict=True)
    ]
    across = np.cross(*normals)
    sine = np.sqrt(
        row_dot(across, across)
        / np.maximum(np.prod([row_dot(n, n) for n in normals], axis=0), 1e-30)
    )
    segments = Segments(
        KINDS.index("intersection"), found.face[:, 0], bary[0], found.node, np.ones((len(found), 2))
    )
    return segments.take(np.flatnonzero(sine > np.sin(np.radians(LEAST_CROSSING))))


def _barycentric(corner: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights (S, 2, 3) of the corners (S, 3, 3) of faces at points (S, 2, 3) in them."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(a, b)
    across = np.stack(
        [np.cross(b, normal), np.cross(normal, a)], axis=1
    )  # each at right angles to the other side
    rel = points - corner[:, :1]
    weight = np.einsum("sek,sik->sei", rel, across) / row_dot(normal, normal)[:, None, None]
    bary = np.clip(
        np.concatenate([1.0 - weight.sum(axis=2, keepdims=True), weight], axis=2), 0.0, 1.0
    )
    return bary / bary.sum(axis=2, keepdims=True)
