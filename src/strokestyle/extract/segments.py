"""Find feature lines on a surface: contours, suggestive contours, apparent ridges, and the others.

The others are ridges, valleys, creases, boundaries and intersections. Segments are found face by
face, below the resolution of the mesh, where a field that is given at the vertices and linear
between them crosses zero; `chain` joins them across faces. Conventions and thresholds are those of
rtsc (Rusinkiewicz, DeCarlo).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..geometry.curves import KINDS
from ..geometry.near import linked_groups
from ..mesh.surface import Surface
from ..mesh.triangles import all_corners, any_corner, bounds, pair_key, row_dot
from .face_shapes import FaceShapes
from .intersections import TOUCH, crossings
from .line_options import LineOptions
from .surface_curves import barycentric, interpolate_on_faces
from .view_curvature import ViewFields

MIN_CROSSING, GRAZING = 10.0, 3.0  # degrees, see intersection_segments
ON_EDGE = 1e-6  # barycentric: what weighs a corner less lies on the side opposite
SOFTNESS = 0.03  # of n.v against the derivative, in the strength of suggestive contours
SAG, LONG = 3e-3, 0.02  # of the longest side of a body; see coarse_faces
ROUNDING = 1e-9
FLAT = 1e-6  # longest sides by which a point lies off a plane that it is in
EDGE_ON = 1e-9  # n.v of a facet that is seen from the side
# The corners after and before corner 0, 1, 2 of a face.
NEXT_CORNER, CORNER_BEFORE = np.array([1, 2, 0]), np.array([2, 0, 1])


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
        """Take no segments, of the same kind."""
        return self.take(slice(0, 0))

    def take(self, index: np.ndarray | slice) -> Segments:
        """Take the segments of an index, mask or slice over S, in that order."""
        return Segments(
            self.kind, self.face[index], self.bary[index], self.node[index], self.strength[index]
        )

    def points(self, surface: Surface) -> np.ndarray:
        """Place the ends in space, (S, 2, 3)."""
        return np.einsum("sei,sik->sek", self.bary, surface.vertices[surface.faces[self.face]])


def _zero_lines(
    surface: Surface,
    value: np.ndarray,
    kind: str,
    among: np.ndarray | None = None,
    rims: bool = True,
) -> Segments:
    """Find where `value` (V,), linear on each face, is zero; the higher side lies to the left.

    That is seen from outside. Zero counts as positive, everywhere alike, so that lines never end
    inside the mesh. Ends are named by mesh edge.

    Parameters
    ----------
    among : (A,) int, the faces to look at, all by default
    rims : also along edges whose both ends are exactly 0, such as around flat
        parts where all of it is 0
    """
    high = value >= 0.0
    face = _crossed_faces(surface, value, high, among, rims)
    corner = surface.faces[face]
    high_corner = high[corner]
    high_count = high_corner.sum(axis=1)
    # the corner that is alone on its side
    odd = np.argmax(high_corner == (high_count == 1)[:, None], axis=1)
    # walking from side (odd, after) to side (odd, before) has the odd corner on the left
    ends = np.stack([NEXT_CORNER[odd], CORNER_BEFORE[odd]], axis=1)
    flip = high_count == 2
    ends[flip] = ends[flip, ::-1]
    row = np.arange(len(face))
    own, bary = value[corner[row, odd]], np.zeros((len(face), 2, 3))
    for end, other in enumerate(ends.T):
        t = own / (own - value[corner[row, other]])  # signs differ, so this is never 0 / 0
        bary[row, end, odd], bary[row, end, other] = 1.0 - t, t
    node = _edge_name(surface, corner[row, odd][:, None], corner[row[:, None], ends])
    return Segments(KINDS.index(kind), face, bary, node, np.ones((len(face), 2)))


def _crossed_faces(
    surface: Surface, value: np.ndarray, high: np.ndarray, among: np.ndarray | None, rims: bool
) -> np.ndarray:
    """Find the faces (S,) with corners both high and not; see `_zero_lines`. `high` : (V,) bool."""
    faces = surface.faces if among is None else surface.faces[among]
    crossed = any_corner(faces, high) & ~all_corners(faces, high)
    if not rims:
        a, b, c = ((value == 0.0)[faces[:, i]] for i in range(3))
        crossed &= ~(a & b | b & c | c & a)
    mixed = np.flatnonzero(crossed)
    return mixed if among is None else among[mixed]


def _edge_name(surface: Surface, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Name the point of a line on the edge between vertices a and b, one side of it where cut."""
    return pair_key(len(surface.vertices), np.minimum(a, b), np.maximum(a, b))


def _first_free_name(surface: Surface) -> int:
    """Tell the name from which on none is an edge's or a vertex's."""
    return len(surface.vertices) ** 2 + len(surface.vertices)


def _vertex_name(surface: Surface, vertex: np.ndarray) -> np.ndarray:
    """Name the end of a line at a vertex's place."""
    return len(surface.vertices) ** 2 + surface.weld[vertex]


def _keep_positive(
    segments: Segments, numerator: np.ndarray, denominator: np.ndarray, names: np.ndarray
) -> Segments:
    """Cut segments to where numerator / denominator is not negative.

    Parameters
    ----------
    numerator, denominator : (S, 2), values at the ends, linear along a segment
    names : (S, 2) int, of the ends made where the numerator is 0, and where the denominator is 0
    """
    good = (numerator[:, 0] >= 0.0) == (denominator[:, 0] >= 0.0)
    cuts = np.stack([_zero_along(numerator), _zero_along(denominator)], axis=1)
    order = np.argsort(cuts, axis=1)
    cuts, names = np.take_along_axis(cuts, order, axis=1), np.take_along_axis(names, order, axis=1)
    count = len(segments)
    stops = np.column_stack([np.zeros(count), cuts, np.ones(count)])
    stop_names = np.column_stack([segments.node[:, 0], names, segments.node[:, 1]])
    stop_names = np.where(stops >= 1.0, segments.node[:, 1:], stop_names)
    # between stops i and i + 1; whether a stretch is good alternates at each cut
    alternating = good[:, None] ^ np.array([False, True, False])
    row, i = np.nonzero(alternating & (stops[:, 1:] > stops[:, :-1]))
    between = row[:, None], np.stack([i, i + 1], axis=1)
    return _stretch(segments.take(row), stops[between], stop_names[between])


def _zero_along(value: np.ndarray) -> np.ndarray:
    """Find where linear functions, given at 0 and 1 (S, 2), are zero, (S,); 1 if not between."""
    a, b = value.T
    crosses = (a >= 0.0) != (b >= 0.0)
    return np.where(crosses, a / np.where(crosses, a - b, 1.0), 1.0)


def _stretch(segments: Segments, t: np.ndarray, node: np.ndarray) -> Segments:
    """Cut each segment to its stretch from one to the other `t` (S, 2) in 0..1, named `node`."""
    bary, strength = segments.bary, segments.strength
    bary = bary[:, :1] * (1.0 - t)[:, :, None] + bary[:, 1:] * t[:, :, None]
    strength = strength[:, :1] * (1.0 - t) + strength[:, 1:] * t
    return replace(segments, bary=bary, node=node, strength=strength)


def _new_names(surface: Surface, segments: Segments) -> np.ndarray:
    """Name ends inside of faces, (S, 2), all differently."""
    return _first_free_name(surface) + np.arange(2 * len(segments)).reshape(-1, 2)


def values_at_ends(surface: Surface, segments: Segments, value: np.ndarray) -> np.ndarray:
    """Interpolate per-vertex values (V,) at both ends of each segment, (S, 2)."""
    return np.einsum("sei,si->se", segments.bary, value[surface.faces[segments.face]])


def vertices_of(surface: Surface, face: np.ndarray) -> np.ndarray:
    """Find the vertices of some faces, an index or mask over F: indices, ascending."""
    mask = np.zeros(len(surface.vertices), bool)
    mask[surface.faces[face]] = True
    return np.flatnonzero(mask)


class Trimmed(NamedTuple):
    """Lines of one kind: what may be seen, and what the shape hides however one looks."""

    shown: Segments
    unseen: Segments


def contour_segments(
    surface: Surface,
    view: ViewFields,
    options: LineOptions,
    facets: Facets | None = None,
) -> Trimmed:
    """Find occluding contours: n.v = 0, and folds, edges of which just one side faces the eye.

    On closed surfaces those with positive radial curvature, and convex folds, may be seen. The
    rest lies inside a hollow and is always hidden. On open surfaces one may look at the inside,
    where the signs are reversed. Without `options.trim` nothing is said to be unseen.

    Parameters
    ----------
    facets : those of the surface; by default none, whatever it is
    """
    folds = Folds(surface, view, facets)
    smooth = None if facets is None else facets.smooth
    segments = _zero_lines(surface, view.n_dot_v, "contour", smooth)
    if not options.trim:
        return Trimmed(_joined(segments, _fold_contours(folds, folds.edge)), segments.none())
    passed = vertices_of(surface, segments.face)
    radial = values_at_ends(surface, segments, view.radial_curvature_at(surface, passed))
    radial[~view.closed_faces[segments.face]] = 1.0
    names = _new_names(surface, segments)
    parts = (
        _keep_positive(segments, sign * radial, np.ones_like(radial), names) for sign in (1, -1)
    )
    edge = folds.edge
    bulges = _convex(surface, edge) | ~view.closed_faces[surface.edge_faces[edge, 0]]
    found = (_fold_contours(folds, edge[mask]) for mask in (bulges, ~bulges))
    return Trimmed(*(_joined(part, fold) for part, fold in zip(parts, found, strict=True)))


class Facets(NamedTuple):
    """Faces that no smooth contour may cross: a mesh is so coarse there that they show.

    Parameters
    ----------
    mask : (F,) bool
    edge : int, the edges at which facing the eye may change at once: those of facets between two
        faces, and those that are cut
    smooth : int, the other faces
    """

    mask: np.ndarray
    edge: np.ndarray
    smooth: np.ndarray

    @classmethod
    def of(cls, surface: Surface, shapes: FaceShapes | None = None) -> Facets | None:
        """Find the facets of a surface, None where it has none."""
        mask = coarse_faces(surface, shapes)
        if not mask.any():
            return None
        one, two = surface.edge_faces.T
        folding = (surface.edge_face_count == 2) & (mask[one] | mask[two])
        folding[surface.cut_edges] = True
        return cls(mask, np.flatnonzero(folding), np.flatnonzero(~mask))


def coarse_faces(surface: Surface, shapes: FaceShapes | None = None) -> np.ndarray:
    """Find the faces that no smooth contour may cross, (F,) bool.

    Where a mesh is so coarse that its facets show, n.v = 0 on interpolated normals leaves the
    outline that is seen, which runs along edges. That is so where a smooth surface would rise over
    its facets by more than SAG of the body's size: between two ends of a chord by |chord . dn| / 8,
    for a circular arc (Boubekeur and Alexa 2008 have four times that, at the middle of an edge).
    And it is so on a strip of faces between creases, as around a can, if they are LONG: it is
    ruled, and its rims are polygons. Faces that touch such ones go with them: half of what turns at
    a vertex would look otherwise than the other half.
    `shapes` : those of its faces, where they are known
    """
    longest = (shapes or FaceShapes.of(surface.vertices, surface.faces)).longest
    size = _body_sizes(surface)
    # normals differ by 2 at most: no face with shorter sides is one of these
    may = np.flatnonzero(longest > min(4.0 * SAG, LONG) * (1.0 - ROUNDING) * size)
    if not len(may):
        return np.zeros(len(surface.faces), bool)
    corner, size = surface.faces[may].T, size[may]
    rise, square = np.zeros(corner.shape), np.zeros(corner.shape)  # of each side
    for place, normal in zip(surface.vertices.T, surface.normals.T, strict=True):
        place, normal = place[corner], normal[corner]  # axis by axis: many times faster
        chord = place[NEXT_CORNER] - place
        rise += chord * (normal[NEXT_CORNER] - normal)
        square += chord * chord
    rise, square = np.maximum.reduce(np.abs(rise)), np.maximum.reduce(square)
    repeated = np.bincount(surface.weld, minlength=len(surface.vertices)) > 1
    strip = all_corners(corner.T, repeated[surface.weld]) & (square > (LONG * size) ** 2)
    coarse = np.zeros(len(surface.vertices), bool)
    coarse[corner[:, strip | (rise > 8.0 * SAG * size)]] = True
    return any_corner(surface.faces, coarse)


def _body_sizes(surface: Surface) -> np.ndarray:
    """Measure the longest side of the body that each face belongs to, (F,)."""
    count = surface.component.max() + 1
    if count == 1:
        used = np.zeros(len(surface.vertices), bool)
        used[surface.faces.ravel()] = True
        low, high = bounds(surface.vertices if used.all() else surface.vertices[used])
        return np.broadcast_to((high - low).max(), len(surface.faces))
    body = np.zeros(len(surface.vertices), np.int64)
    for corner in surface.faces.T:
        body[corner] = surface.component
    low, high = np.full((3, count), np.inf), np.full((3, count), -np.inf)
    for axis, least, most in zip(surface.vertices.T, low, high, strict=True):
        np.minimum.at(least, body, axis)
        np.maximum.at(most, body, axis)
    return (high - low).max(axis=0)[surface.component]


class Folds(NamedTuple):
    """Edges at which facing the eye may change at once, and how their sides do.

    Parameters
    ----------
    surface, view : what is seen, and how
    facets : faces that face the eye as a whole or not at all; None for no such
    """

    surface: Surface
    view: ViewFields
    facets: Facets | None

    @property
    def edge(self) -> np.ndarray:
        """Indices of the edges, (M,): those of facets between two faces, and those that are cut."""
        return self.surface.cut_edges if self.facets is None else self.facets.edge

    def facing(self, face: np.ndarray, smooth: np.ndarray) -> np.ndarray:
        """Tell how faces (S,) face the eye, given n.v there on interpolated normals, (S, ...).

        That is 1 or -1 on facets. One that is seen edge-on does not face the eye.
        """
        if self.facets is None:
            return smooth
        vertex, view = self.surface.faces[face, 0], self.view
        surface, normal = self.surface, self.surface.face_normals[face]
        towards = sum(
            along[vertex] * row_dot(normal, axis[vertex])
            for along, axis in (
                (view.n_dot_v, surface.normals),
                (view.u, surface.pdir1),
                (view.v, surface.pdir2),
            )
        )
        plane = np.where(towards > EDGE_ON, 1.0, -1.0)
        shape = (len(face),) + (1,) * (smooth.ndim - 1)
        return np.where(self.facets.mask[face].reshape(shape), plane.reshape(shape), smooth)


def _fold_contours(folds: Folds, edge: np.ndarray) -> Segments:
    """Find the parts of folding edges (M,) at which one side faces the eye and the other does not.

    Their face is the one that does. Normals run along the edge on either side. Where those of one
    side turn away, the smooth contour of that side ends at the same point and under the same name.
    """
    parts = []
    for side in range(2):
        segments, own, other, names = _along_fold(folds, edge, "contour", side)
        segments = _keep_positive(segments, own, -other, names)
        parts.append(segments.take(_faces_eye(folds, segments)))
    return _joined(*parts)


def _faces_eye(folds: Folds, segments: Segments) -> np.ndarray:
    """Tell of which segments the middle faces the eye, (S,) bool."""
    smooth = values_at_ends(folds.surface, segments, folds.view.n_dot_v).mean(axis=1)
    return folds.facing(segments.face, smooth) > 0.0


def _convex(surface: Surface, edge: np.ndarray) -> np.ndarray:
    """Tell whether the surface bulges at edges (M,) between two faces, or is flat, (M,) bool."""
    (face, corner), (other, other_corner) = surface.edge_corners(edge)
    apex = surface.faces[other, 3 - other_corner.sum(axis=1)]
    rise = surface.vertices[apex] - surface.vertices[surface.faces[face, corner[:, 0]]]
    return row_dot(rise, surface.face_normals[face]) <= FLAT


class FoldSides(NamedTuple):
    """Folding edges, along which normals run on either side, as segments in the face on one side.

    Parameters
    ----------
    segments : the M edges
    own, other : (M, 2), n.v at their ends on that side and on the other, or how a facet faces
    names : (M, 2) int, of the points where `own` is 0, and where `other` is 0
    """

    segments: Segments
    own: np.ndarray
    other: np.ndarray
    names: np.ndarray


def _along_fold(folds: Folds, edge: np.ndarray, kind: str, side: int) -> FoldSides:
    """Take folding edges `edge` (M,) as segments of a kind in the face on one `side`, 0 or 1."""
    surface = folds.surface
    segments = edge_segments(surface, edge, kind, side)
    facing, names = [], []
    sides = list(surface.edge_corners(edge))
    for face, corner in (sides[side], sides[1 - side]):
        vertex = surface.faces[face[:, None], corner]
        backwards = _vertex_name(surface, vertex[:, 0]) != segments.node[:, 0]
        vertex[backwards] = vertex[backwards, ::-1]
        facing.append(folds.facing(face, folds.view.n_dot_v[vertex]))
        names.append(_edge_name(surface, vertex[:, 0], vertex[:, 1]))
    return FoldSides(segments, facing[0], facing[1], np.stack(names, axis=1))


def _joined(*parts: Segments) -> Segments:
    """Put segments of one kind one after the other."""
    return Segments(
        parts[0].kind,
        np.concatenate([part.face for part in parts]),
        np.concatenate([part.bary for part in parts]),
        np.concatenate([part.node for part in parts]),
        np.concatenate([part.strength for part in parts]),
    )


def _may_be_seen(surface: Surface, view: ViewFields) -> np.ndarray:
    """Tell which faces do not turn away all over, (F,) bool; all faces of open surfaces do not."""
    return any_corner(surface.faces, view.n_dot_v > 0.0) | ~view.closed_faces


def suggestive_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Find suggestive contours: the radial curvature is 0, and rises towards the eye fast enough.

    DeCarlo et al. 2003, "Suggestive Contours for Conveying Shape". Strength is the soft filter of
    Neural Contours (Liu et al. 2020), with q = F^2 Dw kr - T n.v; on the inside of open surfaces
    all signs are reversed.
    """
    limit = options.suggestive / surface.feature_size**2
    front = np.flatnonzero(_may_be_seen(surface, view))
    segments = _zero_lines(surface, view.radial_curvature(surface), "suggestive", front, rims=False)
    passed = vertices_of(surface, segments.face)
    derivative = values_at_ends(surface, segments, view.radial_derivative_at(surface, passed))
    facing = values_at_ends(surface, segments, view.n_dot_v)
    q = surface.feature_size**2 * derivative - options.suggestive * facing
    q = np.maximum(np.where(facing < 0.0, -q, q), 0.0)
    strength = q / np.maximum(q + SOFTNESS * np.abs(facing), 1e-12)
    segments = replace(segments, strength=strength)
    return _keep_positive(
        segments, derivative - limit * facing, facing, _new_names(surface, segments)
    )


def apparent_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Find apparent ridges: maxima of the view-dependent curvature along its own direction.

    Judd et al. 2007, "Apparent Ridges for Line Drawing".
    """
    curvature, direction = view.view_curvature(surface)
    limit = options.apparent / surface.feature_size**2
    strong = any_corner(surface.faces, curvature > limit)
    among = np.flatnonzero(strong & _may_be_seen(surface, view) if options.trim else strong)
    slope = foreshortened_slope(surface, curvature, direction, view.n_dot_v, among)
    piece = _apparent_pieces(surface, among, slope[:, None] * direction, slope)
    return _graded(surface, "apparent", piece, curvature, limit)


def foreshortened_slope(
    surface: Surface,
    value: np.ndarray,
    direction: np.ndarray,
    n_dot_v: np.ndarray,
    among: np.ndarray,
) -> np.ndarray:
    """Differentiate `value` (V,) along `direction` (V, 3) as seen in the image, (V,).

    In each face around a vertex that the line through it meets, it is the difference to the
    opposite side, over the distance along `direction` shortened by n.v; then the mean over these
    faces. Worked out at the vertices of faces `among` (A,), 0 elsewhere.
    """
    count = len(value)
    wanted = np.zeros(count, bool)
    wanted[surface.faces[among]] = True
    near = np.flatnonzero(any_corner(surface.faces, wanted))
    total, hits = np.zeros(count), np.zeros(count)
    side = np.cross(surface.normals, direction)
    for i in range(3):
        faces = surface.faces[near[wanted[surface.faces[near, i]]]]
        met = _opposite(surface, faces[:, [i, NEXT_CORNER[i], CORNER_BEFORE[i]]], side)
        own, a, b = met.corner.T
        distance = row_dot(met.reach, direction[own]) * np.abs(n_dot_v[own])
        rise = met.t * value[a] + (1.0 - met.t) * value[b] - value[own]
        slope = rise / np.where(np.abs(distance) < 1e-12, np.inf, distance)
        total += np.bincount(own, weights=slope, minlength=count)
        hits += np.bincount(own, minlength=count)
    return total / np.maximum(hits, 1.0)


class Opposite(NamedTuple):
    """Where lines through the first corners of faces meet the sides opposite.

    Parameters
    ----------
    corner : (n, 3) int, vertices; the line goes through the first
    t : (n,) in 0..1, weight of the second corner where the line meets; the third has the rest
    reach : (n, 3), from the first corner to there
    """

    corner: np.ndarray
    t: np.ndarray
    reach: np.ndarray


def _opposite(surface: Surface, corner: np.ndarray, side: np.ndarray) -> Opposite:
    """Meet the side opposite the first corner of faces (n, 3), where the line through that does.

    The line lies in the face, at right angles to `side` (V, 3) of that corner.
    """
    own, a, b = corner.T
    to_a, to_b = (surface.vertices[other] - surface.vertices[own] for other in (a, b))
    across_a, across_b = (row_dot(edge, side[own]) for edge in (to_a, to_b))
    gap = across_b - across_a
    t = across_b / np.where(gap == 0.0, 1.0, gap)
    meets = (gap != 0.0) & (t >= 0.0) & (t <= 1.0)
    t = t[meets]
    reach = t[:, None] * to_a[meets] + (1.0 - t)[:, None] * to_b[meets]
    return Opposite(corner[meets], t, reach)


def ridge_segments(surface: Surface, options: LineOptions) -> Segments:
    """Find ridges: maxima of the largest principal curvature along its direction, where convex.

    Ohtake et al. 2004, "Ridge-Valley Lines on Meshes via Implicit Surface Fitting".
    """
    return _ridge_or_valley(surface, options.ridge, options.sharpness, "ridge", 1.0)


def valley_segments(surface: Surface, options: LineOptions) -> Segments:
    """Find valleys: minima of the principal curvature along its direction, where concave."""
    return _ridge_or_valley(surface, options.valley, options.sharpness, "valley", -1.0)


def _ridge_or_valley(
    surface: Surface, threshold: float, least_sharpness: float, kind: str, sign: float
) -> Segments:
    """Find extrema of the principal curvature where `sign` times it is positive."""
    limit = threshold / surface.feature_size
    curved = all_corners(surface.faces, sign * surface.k1 > 0.0)
    among = np.flatnonzero(curved & any_corner(surface.faces, np.abs(surface.k1) > limit))
    slope = _slope(surface, _around(surface, among), sign)  # `sharpness` needs those around
    pieces = _ridge_pieces(surface, among, slope[:, None] * surface.pdir1, slope)
    segments = _graded(surface, kind, pieces, np.abs(surface.k1), limit)
    if not (least_sharpness > 0.0 and len(segments)):
        return segments
    share = sharpness(surface, slope, segments.face) / least_sharpness
    clear = np.clip(2.0 * share - 1.0, 0.0, 1.0)
    return _strong(segments, segments.strength * values_at_ends(surface, segments, clear))


def _slope(surface: Surface, vertex: np.ndarray, sign: float) -> np.ndarray:
    """Differentiate `sign` k1 along pdir1 at some vertices, an index (n,): 0 at others, (V,)."""
    slope = np.zeros(len(surface.vertices))
    slope[vertex] = sign * surface.dcurv_at(vertex)[:, 0]
    return slope


def _around(surface: Surface, face: np.ndarray) -> np.ndarray:
    """Find the vertices of some faces, an index, and of those that touch them: indices."""
    own = np.zeros(len(surface.vertices), bool)
    own[surface.faces[face]] = True
    return vertices_of(surface, any_corner(surface.faces, own))


def sharpness(surface: Surface, slope: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Measure -k'' / k^3 along the first principal direction at the vertices of some faces, (V,).

    `slope` (V,) is the derivative of |k1| along pdir1. Its own derivative is taken on each face
    about these vertices, after pointing the directions at its corners the same way, and averaged.
    """
    wanted = np.zeros(len(surface.vertices), bool)
    wanted[surface.faces[face]] = True
    corner = surface.faces[any_corner(surface.faces, wanted)]
    direction = surface.pdir1[corner]
    sign = np.where(row_dot(direction, direction[:, :1]) < 0.0, -1.0, 1.0)
    along = (sign[:, :, None] * direction).mean(axis=1)
    bend = _derivative_on_faces(surface.vertices[corner], sign * slope[corner], along)
    at, size = corner.ravel(), len(wanted)
    count = np.bincount(at, minlength=size)
    mean = np.bincount(at, weights=np.repeat(bend, 3), minlength=size) / np.maximum(count, 1)
    return np.where(wanted, -mean / np.maximum(np.abs(surface.k1) ** 3, 1e-12), 0.0)


def _derivative_on_faces(point: np.ndarray, value: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Differentiate linear functions on faces along directions (n, 3) of any length, (n,).

    `point` (n, 3, 3) and `value` (n, 3) are those of the corners.
    """
    a, b = point[:, 1] - point[:, 0], point[:, 2] - point[:, 0]
    normal = np.cross(a, b)
    square = np.maximum(row_dot(normal, normal), 1e-30)
    gradient = (value[:, 1] - value[:, 0])[:, None] * np.cross(b, normal)
    gradient += (value[:, 2] - value[:, 0])[:, None] * np.cross(normal, a)
    return row_dot(gradient, along) / square / np.maximum(np.sqrt(row_dot(along, along)), 1e-12)


class Pieces(NamedTuple):
    """Pieces of lines in faces, before their kind and strength are known; columns of `Segments`."""

    face: np.ndarray
    bary: np.ndarray
    node: np.ndarray


class UphillFaces(NamedTuple):
    """Faces that a line of maxima may pass through.

    A direction of curvature has no sign of its own: it is pointed uphill. A side may carry an
    extremum where the uphill arrows at its ends oppose each other. Side i runs from corner i to the
    next.

    Parameters
    ----------
    face : (A,) int
    point : (A, 3, 3), the corners
    arrow : (A, 3, 3), the direction at each corner, uphill, as long as the slope
    on_side : (A, 3, 3), barycentric, where a line would cross each side
    edge_name : (A, 3) int, names of the crossings
    """

    face: np.ndarray
    point: np.ndarray
    arrow: np.ndarray
    on_side: np.ndarray
    edge_name: np.ndarray

    def lead_to(self, row: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Tell in which rows (n,) all arrows lead to the line from start to end, (n,) bool."""
        leads = _leads(self.point[row], self.arrow[row], start, end)
        return np.logical_and.reduce(leads, axis=1)


def _uphill_faces(
    surface: Surface, among: np.ndarray, uphill: np.ndarray, slope: np.ndarray
) -> UphillFaces:
    """Lay out faces `among` (A,), from the arrows `uphill` (V, 3) and their lengths' sizes `slope`.

    The crossing of a side lies where the slope, linear along it, is 0.
    """
    corner = surface.faces[among]
    size = np.abs(slope)[corner]
    total = size + size[:, NEXT_CORNER]
    weight = np.where(total > 0.0, size / np.where(total > 0.0, total, 1.0), 0.5)  # of corner i + 1
    on_side = np.zeros((len(among), 3, 3))
    for i in range(3):
        on_side[:, i, i], on_side[:, i, NEXT_CORNER[i]] = 1.0 - weight[:, i], weight[:, i]
    names = _edge_name(surface, corner, corner[:, NEXT_CORNER])
    return UphillFaces(among, surface.vertices[corner], uphill[corner], on_side, names)


def _ridge_pieces(
    surface: Surface, among: np.ndarray, uphill: np.ndarray, slope: np.ndarray
) -> Pieces:
    """Find maxima as rtsc does for ridges and valleys, along the arrows `uphill` (V, 3).

    A side counts if at least one of its arrows leads along it towards the other end.
    """
    faces = _uphill_faces(surface, _turning(surface, among, uphill), uphill, slope)
    opposed, ahead = _opposed(faces), faces.point[:, NEXT_CORNER] - faces.point
    leads = row_dot(faces.arrow, ahead) >= 0.0
    leads |= row_dot(faces.arrow[:, NEXT_CORNER], ahead) <= 0.0
    return _pieces(surface, faces, opposed & leads, led_to=False)


def _apparent_pieces(
    surface: Surface, among: np.ndarray, uphill: np.ndarray, slope: np.ndarray
) -> Pieces:
    """Find maxima as rtsc does for apparent ridges: all arrows of a face lead towards the line."""
    faces = _uphill_faces(surface, _turning(surface, among, uphill), uphill, slope)
    return _pieces(surface, faces, _opposed(faces), led_to=True)


def _turning(surface: Surface, among: np.ndarray, uphill: np.ndarray) -> np.ndarray:
    """Take of faces (A,) those with two sides at whose ends arrows (V, 3) oppose each other.

    Few have, and all that is laid out of a face is for these. One that hardly does not is taken.
    """
    corner = [surface.faces[among, i] for i in range(3)]
    along = np.zeros((3, len(among)))
    for axis in uphill.T:
        a, b, c = (axis[i] for i in corner)
        along += [a * b, b * c, c * a]
    size = np.sqrt(row_dot(uphill, uphill))
    least = ROUNDING * np.stack([size[corner[i]] * size[corner[i - 2]] for i in range(3)])
    return among[(along <= least).sum(axis=0) >= 2]


def _opposed(faces: UphillFaces) -> np.ndarray:
    """Tell at which sides the arrows at both ends oppose each other, (A, 3) bool."""
    return row_dot(faces.arrow, faces.arrow[:, NEXT_CORNER]) <= 0.0


def _pieces(surface: Surface, faces: UphillFaces, crossed: np.ndarray, led_to: bool) -> Pieces:
    """Draw lines through faces by the sides that they cross, (A, 3) bool.

    Two make a piece of line, three make a fork at the centre. With `led_to` only pieces stay
    to which all arrows of the face lead.
    """
    sides = crossed.sum(axis=1)
    two, three = np.flatnonzero(sides == 2), np.flatnonzero(sides == 3)
    absent = np.argmin(crossed[two], axis=1)
    ends = np.stack([NEXT_CORNER[absent], CORNER_BEFORE[absent]], axis=1)
    bary = faces.on_side[two[:, None], ends]
    if led_to:
        good = faces.lead_to(two, bary[:, 0], bary[:, 1])
        two, ends, bary = two[good], ends[good], bary[good]
    whole = Pieces(faces.face[two], bary, faces.edge_name[two[:, None], ends])
    arms = (_fork_arm(surface, faces, three, side, led_to) for side in range(3))
    face, bary, node = zip(whole, *arms, strict=True)
    return Pieces(np.concatenate(face), np.concatenate(bary), np.concatenate(node))


def _fork_arm(
    surface: Surface, faces: UphillFaces, row: np.ndarray, side: int, led_to: bool
) -> Pieces:
    """Draw the arms of forks in some rows of faces, from the crossing of one side to the centre."""
    start, centre = faces.on_side[row, side], np.full((len(row), 3), 1.0 / 3.0)
    if led_to:
        good = faces.lead_to(row, start, centre)
        row, start, centre = row[good], start[good], centre[good]
    face = faces.face[row]
    names = [faces.edge_name[row, side], _first_free_name(surface) + face]
    return Pieces(face, np.stack([start, centre], axis=1), np.stack(names, axis=1))


def _graded(
    surface: Surface, kind: str, pieces: Pieces, value: np.ndarray, limit: float
) -> Segments:
    """Make segments of pieces where `value` (V,) is above a limit; strength 1 - limit / value."""
    none = np.zeros((len(pieces.face), 2))
    segments = Segments(KINDS.index(kind), pieces.face, pieces.bary, pieces.node, none)
    height = values_at_ends(surface, segments, value)
    return _strong(segments, np.maximum(1.0 - limit / np.maximum(height, 1e-30), 0.0))


def _strong(segments: Segments, strength: np.ndarray) -> Segments:
    """Give segments a strength (S, 2), and keep those that have some."""
    segments = replace(segments, strength=strength)
    return segments.take(np.flatnonzero((strength > 0.0).any(axis=1)))


def _leads(point: np.ndarray, arrow: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Tell which arrows (n, 3, 3) at the corners of faces lead towards a line, (n, 3) bool.

    `point` : (n, 3, 3), the corners; `start`, `end` : (n, 3), barycentric
    """
    start, end = (np.einsum("ai,aik->ak", at, point) for at in (start, end))
    normal = np.cross(point[:, 1] - point[:, 0], point[:, 2] - point[:, 0])
    across = np.cross(normal, end - start)[:, None]
    return row_dot(arrow, across) * np.sign(row_dot(point - start[:, None], across)) < 0.0


def crease_segments(
    surface: Surface,
    view: ViewFields,
    options: LineOptions,
    edge: np.ndarray | None = None,
    facets: Facets | None = None,
) -> Trimmed:
    """Find creases: mesh edges where faces meet at more than the crease angle, or over two meet.

    Where contours are drawn too, less what is part of one; what faces away on a closed surface is
    never seen.
    `edge` : the surface's `crease_edges`, where they are known; `facets` : as `contour_segments`
    """
    edge = crease_edges(surface, options.crease) if edge is None else edge
    if "contour" not in options.kinds:
        segments = edge_segments(surface, edge, "crease")
        return Trimmed(segments, segments.none())
    folds = Folds(surface, view, facets)
    folding = np.isin(edge, folds.edge, assume_unique=True)
    segments, own, other, names = _along_fold(folds, edge[folding], "crease", 0)
    both = _keep_positive(segments, own, other, names)
    others = edge_segments(surface, edge[~folding], "crease")
    if not options.trim:
        return Trimmed(_joined(both, others), both.none())
    seen = _faces_eye(folds, both) | ~view.closed_faces[both.face]
    return Trimmed(_joined(both.take(seen), others), both.take(~seen))


def crease_edges(surface: Surface, angle: float) -> np.ndarray:
    """Find the edges that are creases of more than `angle` degrees, or where over two faces meet.

    Returns their indices, ascending.
    """
    sharp = surface.connectivity.creases(angle)
    return np.flatnonzero(sharp | (surface.edge_face_count > 2))


def boundary_segments(surface: Surface, options: LineOptions) -> Segments:
    """Find boundaries: mesh edges with one face."""
    return edge_segments(surface, np.flatnonzero(surface.edge_face_count == 1), "boundary")


def edge_segments(surface: Surface, edge: np.ndarray, kind: str, side: int = 0) -> Segments:
    """Make segments of whole mesh edges `edge` (M,), named by place.

    The first face at each (or the second, with `side` 1) lies to their left.
    """
    face, corner = list(surface.edge_corners(edge))[side]
    turn = (corner[:, 0] + 1) % 3 != corner[:, 1]
    corner[turn] = corner[turn, ::-1]
    bary = np.zeros((len(edge), 2, 3))
    bary[np.arange(len(edge))[:, None], [0, 1], corner] = 1.0
    node = _vertex_name(surface, surface.faces[face[:, None], corner])
    return Segments(KINDS.index(kind), face, bary, node, np.ones((len(edge), 2)))


def intersection_segments(surface: Surface, options: LineOptions) -> Segments:
    """Find where connected components pass through each other, in the faces of one.

    Ends are named by place. Where both run along each other, at less than MIN_CROSSING, there is
    none: two skins of one shape cross wherever their faces happen to, and no line is to be seen.
    From steeper places a line goes on through shallow ones, down to GRAZING, as where two pipes of
    one radius cross: at the middle of that X they touch (hysteresis, as Canny 1986 follows edges).
    """
    found = crossings(surface.vertices, surface.faces, surface.component)
    face, other = found.face.T
    bary, other_bary = (
        barycentric(surface.vertices[surface.faces[f]], found.points) for f in (face, other)
    )
    strength = np.ones((len(found), 2))
    segments = Segments(KINDS.index("intersection"), face, bary, found.node, strength)
    ends = [_crossing_angle(surface, found.face, bary[:, i], other_bary[:, i]) for i in (0, 1)]
    middle = _crossing_angle(surface, found.face, bary.mean(axis=1), other_bary.mean(axis=1))
    through = np.maximum(middle, np.maximum(*ends)) > GRAZING
    for own, at, beyond in ((face, bary, other), (other, other_bary, face)):
        through &= ~_only_touches(surface, own, at, beyond)
    through = np.flatnonzero(through)
    steep = middle[through] > MIN_CROSSING
    return segments.take(through[_linked_to(found.node[through], steep)])


def _crossing_angle(
    surface: Surface, pairs: np.ndarray, bary: np.ndarray, other_bary: np.ndarray
) -> np.ndarray:
    """Measure the angles between the lines along both normals where faces (P, 2) meet, degrees."""
    normal, other = (
        interpolate_on_faces(surface, face, at, surface.normals)
        for face, at in zip(pairs.T, (bary, other_bary), strict=True)
    )
    across = np.cross(normal, other)
    square = row_dot(normal, normal) * row_dot(other, other)
    sine = np.sqrt(row_dot(across, across) / np.maximum(square, 1e-30))
    return np.degrees(np.arcsin(np.minimum(sine, 1.0)))


def _linked_to(node: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Tell which segments, from node to node (P, 2), are linked to one `wanted`, (P,) bool."""
    if not len(node):
        return wanted
    count = int(node.max()) + 1
    label = linked_groups(node.T, count)[node[:, 0]]
    return np.isin(label, label[wanted])


def _only_touches(
    surface: Surface, face: np.ndarray, bary: np.ndarray, other: np.ndarray
) -> np.ndarray:
    """Tell which faces (P,) end, where they meet others (P,), in an edge that is not gone beyond.

    They meet at `bary` (P, 2, 3). The other face at that edge lies on the same side of the plane,
    or in it: it is the edge that may be a line.
    """
    off = bary.max(axis=1) < ON_EDGE
    at = np.flatnonzero(off.any(axis=1))
    corner = off[at].argmax(axis=1)
    edge = surface.face_edges[face[at], (corner + 1) % 3]
    pair = surface.edge_faces[edge]
    next_ = np.where(pair[:, 0] == face[at], pair[:, 1], pair[:, 0])
    apex = surface.weld[surface.faces[next_]]
    ends = surface.edges[edge]
    third = apex.sum(axis=1) - ends.sum(axis=1)
    own = surface.faces[face[at], corner]
    normal, origin = surface.face_normals[other[at]], surface.vertices[ends[:, 0]]
    rise = [row_dot(surface.vertices[v] - origin, normal) for v in (own, third)]
    beyond = (rise[0] * rise[1] < 0.0) & (np.abs(rise[1]) > TOUCH)
    touches = np.zeros(len(face), bool)
    touches[at] = (surface.edge_face_count[edge] == 1) | ~beyond
    return touches
