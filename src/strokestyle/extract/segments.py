"""Lines on the surface: contours, suggestive contours, apparent ridges, ridges, valleys, creases, boundaries,
intersections.

Segments are found face by face, below the resolution of the mesh, where a linearly interpolated per-vertex field
crosses zero; they are then chained across faces into the longest polylines. Conventions and thresholds are rtsc's.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial

import numpy as np

from ..geometry.curves import KINDS, check_offsets, take_ragged
from ..mesh.creases import bends, creases
from ..mesh.surface import DEFAULT_CREASE, Surface
from ..mesh.triangles import all_corners, any_corner
from .camera import Camera
from .intersections import crossings

SOFT_KINDS = ("suggestive", "ridge", "valley", "apparent")  # read off curvature, so that noise of the mesh tells
SURFACE_KINDS = ("contour", "boundary", "crease", "suggestive", "ridge", "valley", "apparent", "intersection")
MOST_SMOOTH = 3.0  # mean edges: a denser mesh is smoothed over less than LineOptions.smooth, or it would take long
SLIVERS = (0.1, 0.25)  # see _trust
LEAST_CROSSING = 10.0  # degrees, see intersection_segments
LEAST_DETAIL, MOST_DETAIL = 0.1, 10.0  # see LineOptions.detailed
ECHO_FACES, ECHO_EDGES = 3, 14  # see _without_echoes
_NEXT, _BEFORE = np.array([1, 2, 0]), np.array([2, 0, 1])  # the corners after and before corner 0, 1, 2


@dataclass(frozen=True)
class LineOptions:
    """Which lines to draw, and from what strength on. Thresholds are in units of the feature size F.

    Parameters
    ----------
    kinds : names out of SURFACE_KINDS
    suggestive : least derivative of radial curvature along the view over n.v, times F^2 (DeCarlo 2003)
    ridge, valley : least principal curvature, times F (Ohtake 2004)
    apparent : least view-dependent curvature (Judd 2007), times F^2
    sharpness : least -k'' / k^3 across a ridge or valley: how fast its curvature falls off to either side. At the tip
        of a conic it is 3 times the squared eccentricity: less than 3 on a limb, whose section is an ellipse, more on
        a rounded edge between two flanks, a hyperbola. Lines fade from the given value to half of it.
    crease : least angle between the faces at a crease, degrees
    smooth : length, in longest sides of the shape, over which normals and curvatures are smoothed for the soft kinds
        (suggestive, ridge, valley, apparent); contours need the mesh's own normals, or they leave its silhouette
    hysteresis : strength (0..1) that a suggestive contour, ridge, valley or apparent ridge must reach somewhere;
        the rest of it may be as weak as its threshold. 0 keeps all.
    follow : such a line is followed on to where it falls below its threshold and sharpness divided by this; 1 or more
    trim : leave out contours and apparent ridges that cannot be seen because of how a closed surface faces there

    Raises
    ------
    ValueError
        on an unknown kind or a threshold out of range.
    """

    kinds: tuple[str, ...] = ("contour", "boundary", "crease", "suggestive", "ridge", "valley", "intersection")
    suggestive: float = 0.01
    ridge: float = 0.4
    valley: float = 0.1
    apparent: float = 0.1
    sharpness: float = 3.0
    crease: float = DEFAULT_CREASE
    smooth: float = 0.007
    hysteresis: float = 0.5
    follow: float = 1.0
    trim: bool = True

    def __post_init__(self):
        kinds = tuple(self.kinds)
        for kind in kinds:
            if kind not in SURFACE_KINDS:
                raise ValueError(f"line kind {kind!r} is none of {', '.join(SURFACE_KINDS)}")
        object.__setattr__(self, "kinds", tuple(kind for kind in SURFACE_KINDS if kind in kinds))
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(item.default, float) and not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"line option {item.name} must be a number from 0 on, got {value}")
        if self.hysteresis > 1.0:
            raise ValueError(f"line option hysteresis must lie between 0 and 1, got {self.hysteresis}")
        if self.follow < 1.0:
            raise ValueError(f"line option follow must be a number from 1 on, got {self.follow}")
        if self.crease > 180.0:
            raise ValueError(f"line option crease must lie between 0 and 180 degrees, got {self.crease}")

    def detailed(self, low: float, high: float | None = None) -> LineOptions:
        """These options for more (above 1) or fewer (below 1) soft lines: the lines of detail `low`, each followed as
        far as it would be drawn at detail `high`, by default the same.

        A detail divides all thresholds of soft lines and the smoothing.
        """
        high = low if high is None else high
        for detail in (low, high):
            if not (np.isfinite(detail) and LEAST_DETAIL <= detail <= MOST_DETAIL):
                raise ValueError(
                    f"detail must lie between {LEAST_DETAIL:g} and {MOST_DETAIL:g} "
                    f"(1 for the thresholds as they are), got {detail}"
                )
        if high < low:
            raise ValueError(f"a range of detail runs from LOW to HIGH, got {low:g}..{high:g}")
        scaled = {name: getattr(self, name) / low for name in (*SOFT_KINDS, "sharpness", "smooth")}
        hysteresis = self.hysteresis**low  # 0 and 1 stay what they are
        return replace(self, **scaled, hysteresis=hysteresis, follow=self.follow * high / low)

    def followed(self) -> LineOptions:
        """What the weakest part of a soft line must still be, with `follow` worked into the thresholds."""
        weaker = {name: getattr(self, name) / self.follow for name in (*SOFT_KINDS, "sharpness")}
        return replace(self, **weaker, follow=1.0, hysteresis=0.0)


@dataclass(frozen=True)
class SurfaceCurves:
    """Polylines that know where on the mesh they lie.

    Parameters
    ----------
    face : (N,) int64; the segment from row i to row i + 1 of a curve lies in (or along) face[i]
    bary : (N, 3) float64, weights of the corners of that face
    offsets : (C+1,) int64, curve i is rows offsets[i]:offsets[i+1], at least two
    kind : (C,) int8, index into curves.KINDS
    closed : (C,) bool; a closed curve repeats its first point as its last
    strength : (N,) float64 in 0..1, how far above its threshold the line is there; 1 for contours, creases, boundaries

    Raises
    ------
    ValueError
        on a wrong shape or a value that is not finite.
    """

    face: np.ndarray
    bary: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    closed: np.ndarray
    strength: np.ndarray

    def __post_init__(self):
        face, bary = np.asarray(self.face, np.int64), np.asarray(self.bary, np.float64)
        offsets, kind = np.asarray(self.offsets, np.int64), np.asarray(self.kind, np.int8)
        closed, strength = np.asarray(self.closed, bool), np.asarray(self.strength, np.float64)
        if face.ndim != 1 or bary.shape != (len(face), 3) or strength.shape != (len(face),):
            raise ValueError(
                f"SurfaceCurves.face, .bary and .strength must have shapes (N,), (N, 3) and (N,), "
                f"got {face.shape}, {bary.shape} and {strength.shape}"
            )
        if not (np.isfinite(bary).all() and np.isfinite(strength).all()):
            raise ValueError("SurfaceCurves holds values that are not finite")
        check_offsets(offsets, len(face), 2, "SurfaceCurves")
        count = len(offsets) - 1
        if kind.shape != (count,) or closed.shape != (count,):
            raise ValueError(
                f"SurfaceCurves.kind and .closed must have shape ({count},), got {kind.shape} and {closed.shape}"
            )
        if count and not (0 <= kind.min() and kind.max() < len(KINDS)):
            raise ValueError(f"SurfaceCurves.kind must lie in 0..{len(KINDS) - 1}")
        for name, value in zip(
            ("face", "bary", "offsets", "kind", "closed", "strength"),
            (face, bary, offsets, kind, closed, strength),
            strict=True,
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @classmethod
    def empty(cls) -> SurfaceCurves:
        return cls(np.zeros(0), np.zeros((0, 3)), [0], np.zeros(0), np.zeros(0), np.zeros(0))

    @classmethod
    def concatenate(cls, parts: list[SurfaceCurves]) -> SurfaceCurves:
        if not parts:
            return cls.empty()
        counts = np.concatenate([np.diff(part.offsets) for part in parts])
        columns = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("face", "bary", "kind", "closed", "strength")
        )
        face, bary, kind, closed, strength = columns
        return cls(face, bary, np.r_[0, np.cumsum(counts)], kind, closed, strength)

    def take(self, index) -> SurfaceCurves:
        """The curves of an index or mask over C, in that order."""
        index = np.arange(len(self))[np.asarray(index)]
        rows, offsets = take_ragged(self.offsets, index)
        return SurfaceCurves(
            self.face[rows], self.bary[rows], offsets, self.kind[index], self.closed[index], self.strength[rows]
        )

    def points(self, surface: Surface) -> np.ndarray:
        """Points in space, (N, 3)."""
        return self.interpolate(surface, surface.vertices)

    def interpolate(self, surface: Surface, values: np.ndarray) -> np.ndarray:
        """Per-vertex values (V,) or (V, k) -> the same at every point, (N,) or (N, k)."""
        return _interpolate(surface, self.face, self.bary, values)


def _interpolate(surface: Surface, face: np.ndarray, bary: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...ik->...k", bary, values.reshape(len(values), -1)[surface.faces[face]]).reshape(
        bary.shape[:-1] + values.shape[1:]
    )


def feature_curves(surface: Surface, camera: Camera, options: LineOptions | None = None) -> SurfaceCurves:
    """All lines of `options.kinds` as seen by `camera`, hidden ones included, kind by kind in KINDS order.

    Ridges, valleys, boundaries and intersections do not depend on the camera and are found once per surface and
    options. Parts of closed surfaces that face away are left out where a kind cannot be seen there.
    """
    options = options or LineOptions()
    parts = []
    for kind, find in _VIEW_KINDS.items():
        if kind in options.kinds:
            shown = smoothed(surface, options.smooth) if kind in SOFT_KINDS else surface
            view = ViewFields.of(shown, camera.eye)
            parts.append(_lines(surface, kind, partial(find, shown, view), camera.up, options))
    parts.append(_facing(surface, ViewFields.of(surface, camera.eye), options))
    curves = _without_echoes(surface, SurfaceCurves.concatenate(parts), options)
    return curves.take(np.argsort(curves.kind, kind="stable"))


def _lines(surface: Surface, kind: str, find, up: np.ndarray, options: LineOptions) -> SurfaceCurves:
    """The lines of one kind, chained from the segments that `find` gives for some options.

    A soft line must reach `options.hysteresis` somewhere. To follow it on, it is found a second time by weaker
    thresholds; of those lines the ones are kept that pass through a face of the first.
    """
    if kind not in SOFT_KINDS:
        return _chain(surface, find(options), up, 0.0)
    curves = _chain(surface, _trusted(surface, find(options)), up, options.hysteresis)
    if not (options.follow > 1.0 and len(curves)):
        return curves
    followed = _chain(surface, _trusted(surface, find(options.followed())), up, 0.0)
    start = np.zeros(len(surface.faces), bool)
    start[curves.face] = True
    return followed.take(np.logical_or.reduceat(start[followed.face], followed.offsets[:-1]))


def _trusted(surface: Surface, segments: Segments) -> Segments:
    """Segments of soft lines, weaker between slivers: curvature is read off differences along all sides of a face, and
    means little where some are many times shorter than others, as on the flanks of a machine part."""
    strength = segments.strength * _at_ends(surface, segments, _trust(surface))
    return Segments(segments.kind, segments.face, segments.bary, segments.node, strength)


@lru_cache(maxsize=2)
def _trust(surface: Surface) -> np.ndarray:
    """(V,) from 0 where the faces around a vertex are SLIVERS[0] times as high as long to 1 where SLIVERS[1] times."""
    corner = surface.vertices[surface.faces]
    side = corner - corner[:, _NEXT]
    longest = np.einsum("fij,fij->fi", side, side).max(axis=1)
    area = np.cross(side[:, 0], side[:, 1])
    shape = np.sqrt(_rowdot(area, area)) / np.maximum(longest, 1e-30)
    index, count = surface.faces.ravel(), len(surface.vertices)
    mean = np.bincount(index, np.repeat(shape, 3), count) / np.maximum(np.bincount(index, minlength=count), 1)
    return np.clip((mean - SLIVERS[0]) / (SLIVERS[1] - SLIVERS[0]), 0.0, 1.0)


@lru_cache(maxsize=2)
def smoothed(surface: Surface, length: float) -> Surface:
    """The surface with normals and curvatures smoothed over `length`, in longest sides; its vertices stay."""
    if not length > 0.0:
        return surface
    surface.closed_faces, surface.cut_edges, surface.face_normals  # noqa: B018  worked out here once for both
    return surface.smoothed(min(length / surface.mean_edge, MOST_SMOOTH))


@lru_cache(maxsize=4)
def surface_lines(surface: Surface, options: LineOptions) -> SurfaceCurves:
    """The lines that do not depend on the camera: boundaries, ridges, valleys, intersections."""
    parts = []
    for kind, find in _SURFACE_KINDS.items():
        if kind in options.kinds:
            shown = smoothed(surface, options.smooth) if kind in SOFT_KINDS else surface
            parts.append(_lines(surface, kind, partial(find, shown), np.array([0.0, 1.0, 0.0]), options))
    return SurfaceCurves.concatenate(parts)


def _facing(surface: Surface, view: ViewFields, options: LineOptions) -> SurfaceCurves:
    """surface_lines less the ridges and valleys that face away all along, on closed surfaces."""
    curves = surface_lines(surface, options)
    if not len(curves):
        return curves
    front = (view.n_dot_v > 0.0) | ~surface.closed_vertices
    seen = front[surface.faces[curves.face]].any(axis=1)
    soft = np.isin(curves.kind, [KINDS.index(kind) for kind in SOFT_KINDS])
    return curves.take(~soft | (np.add.reduceat(seen, curves.offsets[:-1]) > 0))


def _without_echoes(surface: Surface, curves: SurfaceCurves, options: LineOptions) -> SurfaceCurves:
    """Soft lines less their parts within ECHO_FACES faces of a crease over which normals run.

    There normals and curvatures mix both sides of the crease, and would draw it a second time beside itself. Creases
    of fewer than ECHO_EDGES edges are as often the noise of a scan, and do not count.
    """
    near = _near_creases(surface, options)
    soft = np.isin(curves.kind, [KINDS.index(kind) for kind in SOFT_KINDS])
    which = np.repeat(np.arange(len(curves)), np.diff(curves.offsets))
    keep = ~(soft[which] & near[curves.face])
    if keep.all():
        return curves
    start = np.flatnonzero(np.r_[True, (keep[1:] != keep[:-1]) | (which[1:] != which[:-1])])
    count = np.diff(np.r_[start, len(keep)])
    good = np.flatnonzero(keep[start] & (count >= 2))
    rows, offsets = take_ragged(np.r_[start, len(keep)], good)
    of = which[start[good]]
    closed = curves.closed[of] & (count[good] == np.diff(curves.offsets)[of])
    return SurfaceCurves(curves.face[rows], curves.bary[rows], offsets, curves.kind[of], closed, curves.strength[rows])


@lru_cache(maxsize=4)
def _near_creases(surface: Surface, options: LineOptions) -> np.ndarray:
    """(F,) bool, within ECHO_FACES faces of a crease of ECHO_EDGES edges or more that is not cut."""
    uncut = np.setdiff1d(crease_edges(surface, options.crease), surface.cut_edges, assume_unique=True)
    curves = _chain(surface, _edge_segments(surface, uncut, "crease"), np.array([0.0, 1.0, 0.0]), 0.0)
    count = np.diff(curves.offsets)
    rows = np.repeat(count > ECHO_EDGES, count)
    touched = np.zeros(len(surface.vertices), bool)
    touched[surface.faces[curves.face[rows], curves.bary[rows].argmax(axis=1)]] = True  # creases run through vertices
    near = np.zeros(len(surface.faces), bool)
    for _ in range(ECHO_FACES):
        near = any_corner(surface.faces, touched)
        touched[surface.faces[near]] = True
    return near


# ------------------------------------------------------------------------------------------------- fields of a view


@dataclass(frozen=True)
class ViewFields:
    """What a surface looks like from an eye, per vertex.

    Parameters
    ----------
    n_dot_v : (V,), cosine between the normal and the direction v to the eye
    u, v : (V,), components of that direction along pdir1 and pdir2
    """

    n_dot_v: np.ndarray
    u: np.ndarray
    v: np.ndarray

    @classmethod
    def of(cls, surface: Surface, eye: np.ndarray) -> ViewFields:
        to_eye = eye - surface.vertices
        to_eye /= np.maximum(np.sqrt(np.einsum("ij,ij->i", to_eye, to_eye)), 1e-30)[:, None]
        return cls(*(np.einsum("ij,ij->i", to_eye, axis) for axis in (surface.normals, surface.pdir1, surface.pdir2)))

    def radial_curvature(self, surface: Surface) -> np.ndarray:
        """Normal curvature along the projected view direction, times the square of that projection's length, (V,).

        The factor keeps it finite and smooth where the view is along the normal; its zeros are those of kr.
        """
        return surface.k1 * self.u**2 + surface.k2 * self.v**2

    def radial_derivative(self, surface: Surface) -> np.ndarray:
        """Derivative of the radial curvature along the projected view direction, times that projection's length, (V,).

        DeCarlo 2003, with the derivative tensor of Rusinkiewicz 2004: C(w, w, w) + 2 n.v tau^2 in rtsc's signs.
        """
        u, v = self.u, self.v
        square = np.maximum(u * u + v * v, 1e-12)
        p, q, r, s = surface.dcurv.T
        cubic = (u * u * (u * p + 3.0 * v * q) + v * v * (3.0 * u * r + v * s)) / square
        torsion = (surface.k2 - surface.k1) * u * v / square
        return cubic - 2.0 * self.n_dot_v * torsion**2

    def view_curvature(self, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
        """Judd 2007: largest squared singular value (V,) of the curvature seen in the image, and its direction in
        the tangent plane, world coordinates (V, 3)."""
        square = self.u**2 + self.v**2
        stretch = (1.0 / np.maximum(np.abs(self.n_dot_v), 1e-6) - 1.0) / np.maximum(square, 1e-12)
        stretch = np.where(square > 1e-12, stretch, 0.0)
        uu, uv, vv = stretch * self.u**2, stretch * self.u * self.v, stretch * self.v**2
        # Q = S P^-1: P^-1 stretches by 1 / n.v along the projected view direction
        q11, q12, q21, q22 = surface.k1 * (1.0 + uu), surface.k1 * uv, surface.k2 * uv, surface.k2 * (1.0 + vv)
        a, b, c = q11**2 + q21**2, q11 * q12 + q21 * q22, q12**2 + q22**2  # Q'Q
        largest = 0.5 * (a + c) + np.sqrt(b**2 + 0.25 * (a - c) ** 2)
        angle = 0.5 * np.arctan2(2.0 * b, a - c)
        direction = np.cos(angle)[:, None] * surface.pdir1 + np.sin(angle)[:, None] * surface.pdir2
        return largest, direction


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

    def take(self, index) -> Segments:
        return Segments(self.kind, self.face[index], self.bary[index], self.node[index], self.strength[index])

    def points(self, surface: Surface) -> np.ndarray:
        """(S, 2, 3)."""
        return np.einsum("sei,sik->sek", self.bary, surface.vertices[surface.faces[self.face]])


def _zero_lines(surface: Surface, value: np.ndarray, kind: str, among=None, rims: bool = True) -> Segments:
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
    after, before = _NEXT[odd], _BEFORE[odd]
    row = np.arange(len(mixed))
    corner_value = value[surface.faces[face]]
    own, a, b = corner_value[row, odd], corner_value[row, after], corner_value[row, before]
    bary = np.zeros((len(mixed), 2, 3))
    for end, (other, corner) in enumerate(((a, after), (b, before))):
        t = own / (own - other)  # signs differ, so this is never 0 / 0
        bary[row, end, odd], bary[row, end, corner] = 1.0 - t, t
    corner = surface.faces[face]
    node = np.stack([_edge_name(surface, corner[row, odd], corner[row, other]) for other in (after, before)], axis=1)
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


def _keep_positive(segments: Segments, numerator: np.ndarray, denominator: np.ndarray, names: np.ndarray) -> Segments:
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


def _at_ends(surface: Surface, segments: Segments, value: np.ndarray) -> np.ndarray:
    """Per-vertex values (V,) at both ends of each segment, (S, 2)."""
    return np.einsum("sei,si->se", segments.bary, value[surface.faces[segments.face]])


def contour_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Occluding contours: n.v = 0, and creases between a side that faces the eye and one that does not.

    On closed surfaces trimmed to what can be seen: positive radial curvature, convex creases. The rest lies inside a
    hollow and is always hidden. On open surfaces one may look at the inside, where the signs are reversed.
    """
    segments = _zero_lines(surface, view.n_dot_v, "contour")
    if options.trim:
        radial = _at_ends(surface, segments, view.radial_curvature(surface))
        radial[~surface.closed_faces[segments.face]] = 1.0
        segments = _keep_positive(segments, radial, np.ones_like(radial), _new_names(surface, segments))
    return _joined(segments, _folds(surface, view, options))


def _folds(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Parts of cut edges at which one side faces the eye and the other does not; their face is the one that does.

    Normals run along the edge on either side. Where those of one side turn away, the smooth contour of that side ends
    at the same point and under the same name.
    """
    edge = surface.cut_edges
    if options.trim:
        edge = edge[_convex(surface, edge) | ~surface.closed_faces[surface.edge_faces[edge, 0]]]
    parts = []
    for side in range(2):
        segments, own, other, names = _along_cut(surface, view, edge, "contour", side)
        segments = _keep_positive(segments, own, -other, names)
        parts.append(segments.take(_at_ends(surface, segments, view.n_dot_v).mean(axis=1) > 0.0))
    return _joined(*parts)


def _convex(surface: Surface, edge: np.ndarray) -> np.ndarray:
    """Does the surface bulge at edges (M,) between two faces? (M,) bool."""
    (face, corner), (other, other_corner) = surface.edge_corners(edge)
    apex = surface.faces[other, 3 - other_corner.sum(axis=1)]
    rise = surface.vertices[apex] - surface.vertices[surface.faces[face, corner[:, 0]]]
    return _rowdot(rise, surface.face_normals[face]) <= 0.0


def _along_cut(surface: Surface, view: ViewFields, edge: np.ndarray, kind: str, side: int):
    """Cut edges (M,) as segments in the face on one side; n.v at their ends on that and on the other side, (M, 2) each;
    and the names (M, 2) of the points where the one and the other is 0."""
    segments = _edge_segments(surface, edge, kind, side)
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
    columns = (np.concatenate([getattr(part, name) for part in parts]) for name in ("face", "bary", "node", "strength"))
    return Segments(parts[0].kind, *columns)


def _may_be_seen(surface: Surface, view: ViewFields) -> np.ndarray:
    """(F,) bool: faces that do not turn away all over, and all faces of open surfaces."""
    return any_corner(surface.faces, view.n_dot_v > 0.0) | ~surface.closed_faces


def suggestive_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Suggestive contours (DeCarlo 2003): the radial curvature is 0 and rises towards the eye, fast enough."""
    limit = options.suggestive / surface.feature_size**2
    front = np.flatnonzero(_may_be_seen(surface, view))
    segments = _zero_lines(surface, view.radial_curvature(surface), "suggestive", front, rims=False)
    derivative = _at_ends(surface, segments, view.radial_derivative(surface))
    facing = _at_ends(surface, segments, view.n_dot_v)
    # Neural Contours' soft filter, with q = F^2 Dw kr - T n.v; on the inside of open surfaces all signs are reversed
    q = surface.feature_size**2 * derivative - options.suggestive * facing
    q = np.maximum(np.where(facing < 0.0, -q, q), 0.0)
    strength = q / np.maximum(q + 0.03 * np.abs(facing), 1e-12)
    segments = Segments(segments.kind, segments.face, segments.bary, segments.node, strength)
    return _keep_positive(segments, derivative - limit * facing, facing, _new_names(surface, segments))


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
        own, a, b = faces[:, i], faces[:, _NEXT[i]], faces[:, _BEFORE[i]]
        to_a, to_b = (surface.vertices[other] - surface.vertices[own] for other in (a, b))
        across_a, across_b = (np.einsum("ij,ij->i", edge, side[own]) for edge in (to_a, to_b))
        gap = across_b - across_a
        t = across_b / np.where(gap == 0.0, 1.0, gap)  # weight of a where the line meets the side a b
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


def _ridge_or_valley(surface: Surface, threshold: float, sharpness: float, kind: str, sign: float) -> Segments:
    limit = threshold / surface.feature_size
    curved = all_corners(surface.faces, sign * surface.k1 > 0.0)
    among = np.flatnonzero(curved & any_corner(surface.faces, np.abs(surface.k1) > limit))
    slope = sign * surface.dcurv[:, 0]
    segments = _extremal_lines(surface, slope, surface.pdir1, np.abs(surface.k1), limit, kind, among)
    if not (sharpness > 0.0 and len(segments)):
        return segments
    clear = np.clip(2.0 * _sharpness(surface, slope, segments.face) / sharpness - 1.0, 0.0, 1.0)
    strength = segments.strength * _at_ends(surface, segments, clear)
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
    sign = np.where(_rowdot(direction, direction[:, :1]) < 0.0, -1.0, 1.0)
    rise = sign * slope[corner]
    along = (sign[:, :, None] * direction).mean(axis=1)
    point = surface.vertices[corner]
    a, b = point[:, 1] - point[:, 0], point[:, 2] - point[:, 0]
    normal = np.cross(a, b)
    square = np.maximum(_rowdot(normal, normal), 1e-30)
    gradient = (rise[:, 1] - rise[:, 0])[:, None] * np.cross(b, normal)
    gradient += (rise[:, 2] - rise[:, 0])[:, None] * np.cross(normal, a)
    bend = _rowdot(gradient, along) / square / np.maximum(np.sqrt(_rowdot(along, along)), 1e-12)
    count = np.bincount(corner.ravel(), minlength=len(wanted))
    mean = np.bincount(corner.ravel(), weights=np.repeat(bend, 3), minlength=len(wanted)) / np.maximum(count, 1)
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
    arrow_next, along = arrow[:, _NEXT], point[:, _NEXT] - point
    crossed = _rowdot(arrow, arrow_next) <= 0.0  # (A, 3): side i runs from corner i to i + 1
    if kind != "apparent":
        crossed &= (_rowdot(arrow, along) >= 0.0) | (_rowdot(arrow_next, along) <= 0.0)
    sides = crossed.sum(axis=1)
    two, three = np.flatnonzero(sides == 2), np.flatnonzero(sides == 3)

    size = np.abs(slope)[surface.faces[among]]
    total = size + size[:, _NEXT]
    weight = np.where(total > 0.0, size / np.where(total > 0.0, total, 1.0), 0.5)  # of corner i + 1 at the crossing
    on_side = np.zeros((len(among), 3, 3))  # barycentric coordinates of the crossing of side i
    for i in range(3):
        on_side[:, i, i], on_side[:, i, _NEXT[i]] = 1.0 - weight[:, i], weight[:, i]

    absent = np.argmin(crossed[two], axis=1)
    ends = np.stack([_NEXT[absent], _BEFORE[absent]], axis=1)  # the two crossed sides; they meet in corner ends[1]
    if kind == "apparent":
        good = _leads(point[two], arrow[two], *(on_side[two, ends[:, i]] for i in range(2))).all(axis=1)
        two, ends = two[good], ends[good]
    corner = surface.faces[among]
    edges = _edge_name(surface, corner, corner[:, _NEXT])
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
    height = _at_ends(surface, segments, value)
    strength = np.maximum(1.0 - limit / np.maximum(height, 1e-30), 0.0)
    segments = Segments(segments.kind, face, bary, node, strength)
    return segments.take(np.flatnonzero((strength > 0.0).any(axis=1)))


def _leads(point, arrow, start, end) -> np.ndarray:
    """Does the arrow at each corner lead towards the line from `start` to `end` (barycentric, (A, 3))? (A, 3)."""
    start, end = (np.einsum("ai,aik->ak", at, point) for at in (start, end))
    across = np.cross(np.cross(point[:, 1] - point[:, 0], point[:, 2] - point[:, 0]), end - start)[:, None]
    return _rowdot(arrow, across) * np.sign(_rowdot(point - start[:, None], across)) < 0.0


def _rowdot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def crease_segments(surface: Surface, view: ViewFields, options: LineOptions) -> Segments:
    """Mesh edges at which two faces meet at more than the crease angle, or more than two faces meet.

    Where contours are drawn too, less what is part of one, and what faces away on a closed surface.
    """
    edge = crease_edges(surface, options.crease)
    if "contour" not in options.kinds:
        return _edge_segments(surface, edge, "crease")
    cut = np.isin(edge, surface.cut_edges, assume_unique=True)
    segments, own, other, names = _along_cut(surface, view, edge[cut], "crease", 0)
    both = _keep_positive(segments, own, other, names)
    seen = (_at_ends(surface, both, view.n_dot_v).mean(axis=1) > 0.0) | ~surface.closed_faces[both.face]
    return _joined(both.take(seen) if options.trim else both, _edge_segments(surface, edge[~cut], "crease"))


@lru_cache(maxsize=4)
def crease_edges(surface: Surface, angle: float) -> np.ndarray:
    """Indices of the edges that are creases of more than `angle` degrees, or at which more than two faces meet."""
    count, pair = surface.edge_face_count, surface.edge_faces
    bend = bends(surface.face_normals, pair, count, surface.clashing_edges)
    sharp = creases(surface.vertices, surface.edges, surface.face_edges, pair, bend, np.radians(angle))
    return np.flatnonzero(sharp | (count > 2))


def boundary_segments(surface: Surface, options: LineOptions) -> Segments:
    """Mesh edges with one face."""
    return _edge_segments(surface, np.flatnonzero(surface.edge_face_count == 1), "boundary")


def _edge_segments(surface: Surface, edge: np.ndarray, kind: str, side: int = 0) -> Segments:
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
    bary = [_barycentric(surface.vertices[surface.faces[face]], found.points) for face in found.face.T]
    normals = [
        _interpolate(surface, face, at.mean(axis=1), surface.normals)
        for face, at in zip(found.face.T, bary, strict=True)
    ]
    across = np.cross(*normals)
    sine = np.sqrt(_rowdot(across, across) / np.maximum(np.prod([_rowdot(n, n) for n in normals], axis=0), 1e-30))
    segments = Segments(KINDS.index("intersection"), found.face[:, 0], bary[0], found.node, np.ones((len(found), 2)))
    return segments.take(np.flatnonzero(sine > np.sin(np.radians(LEAST_CROSSING))))


def _barycentric(corner: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights (S, 2, 3) of the corners (S, 3, 3) of faces at points (S, 2, 3) in them."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(a, b)
    across = np.stack([np.cross(b, normal), np.cross(normal, a)], axis=1)  # each at right angles to the other side
    rel = points - corner[:, :1]
    weight = np.einsum("sek,sik->sei", rel, across) / _rowdot(normal, normal)[:, None, None]
    bary = np.clip(np.concatenate([1.0 - weight.sum(axis=2, keepdims=True), weight], axis=2), 0.0, 1.0)
    return bary / bary.sum(axis=2, keepdims=True)


_VIEW_KINDS = {
    "contour": contour_segments,
    "crease": crease_segments,
    "suggestive": suggestive_segments,
    "apparent": apparent_segments,
}
_SURFACE_KINDS = {
    "boundary": boundary_segments,
    "ridge": ridge_segments,
    "valley": valley_segments,
    "intersection": intersection_segments,
}


# -------------------------------------------------------------------------------------------------------- chaining


def _chain(surface: Surface, segments: Segments, up: np.ndarray, hysteresis: float) -> SurfaceCurves:
    """Join segments end to end into the longest polylines.

    At a junction of three or more ends, the straightest pair goes on and the others end there. Open curves keep the
    direction of most of their segments; closed ones start at their highest point along `up`.

    Every segment is two one-way walks, 2 s from its first end to its second and 2 s + 1 back; walk w starts at end w
    and stops at end w ^ 1. The next walk is the one that starts at the end joined to that.
    """
    count = len(segments)
    if not count:
        return SurfaceCurves.empty()
    points = segments.points(surface)
    mate = _join(segments.node.ravel(), points)
    walks = np.arange(2 * count)

    def following(mate):
        return mate[walks ^ 1]

    # break closed chains at their highest point, in the direction in which most of their segments run
    ring = _last(following(mate)) < 0
    closed_start = np.zeros(0, np.int64)
    if ring.any():
        height = points.reshape(-1, 3) @ up
        rank = np.empty(2 * count, np.int64)
        rank[np.lexsort((walks, -height))] = walks  # 0 = highest
        order = np.argsort(rank)
        top = order[_least(following(mate), rank)]  # for each walk of a ring, its highest start
        starts = np.unique(top[ring])
        forward = np.bincount(top[ring], weights=1.0 - 2.0 * (walks[ring] % 2), minlength=2 * count)[starts]
        # the two walks round a ring mirror each other: keep the one that runs forward, or at a tie starts lower
        opposite = top[starts ^ 1]
        keep = (forward > 0) | ((forward == 0) & (starts < opposite))
        closed_start = starts[keep]
        other = mate[closed_start]
        mate[closed_start], mate[other] = -1, -1

    last, steps = _rank(following(mate))
    # walks of one chain share their last walk; of a chain and its mirror image keep one
    forward = np.bincount(last, weights=1.0 - 2.0 * (walks % 2), minlength=2 * count)
    first_of = np.full(2 * count, -1)
    begins = mate < 0  # nothing joined to the end that walk w starts from
    first_of[last[begins]] = walks[begins]
    tails = np.flatnonzero(first_of >= 0)
    heads = first_of[tails]
    mirror = heads ^ 1  # the mirrored chain ends with the head's segment walked back
    chosen = (forward[tails] > forward[mirror]) | ((forward[tails] == forward[mirror]) & (tails < mirror))
    is_closed = np.zeros(2 * count, bool)
    is_closed[closed_start] = True
    chosen = np.where(is_closed[heads], True, np.where(is_closed[first_of[mirror]], False, chosen))
    tails, heads = tails[chosen], heads[chosen]

    label = np.full(2 * count, -1)
    label[tails] = np.argsort(np.argsort(heads))
    of_walk = label[last]
    used = np.flatnonzero(of_walk >= 0)
    used = used[np.lexsort((-steps[used], of_walk[used]))]
    curve = of_walk[used]
    lengths = np.bincount(curve, minlength=len(tails))
    closed = np.zeros(len(tails), bool)
    closed[label[tails]] = is_closed[heads]

    # rows: the start of every walk, then the end of the curve's last walk
    offsets = np.r_[0, np.cumsum(lengths + 1)]
    start_row = np.arange(len(used)) + curve
    final = used[np.cumsum(lengths) - 1]
    face = np.empty(offsets[-1], np.int64)
    bary, strength = np.empty((offsets[-1], 3)), np.empty(offsets[-1])
    flat_bary, flat_strength = segments.bary.reshape(-1, 3), segments.strength.ravel()
    for rows, end in ((start_row, used), (offsets[1:] - 1, final ^ 1)):
        face[rows], bary[rows], strength[rows] = segments.face[end // 2], flat_bary[end], flat_strength[end]
    face[offsets[1:][closed] - 1] = face[offsets[:-1][closed]]
    bary[offsets[1:][closed] - 1] = bary[offsets[:-1][closed]]
    curves = SurfaceCurves(face, bary, offsets, np.full(len(tails), segments.kind), closed, strength)
    curves = _drop_repeats(surface, curves)
    if hysteresis > 0.0 and len(curves):
        curves = curves.take(np.maximum.reduceat(curves.strength, curves.offsets[:-1]) >= hysteresis)
    return curves


def _join(node: np.ndarray, points: np.ndarray) -> np.ndarray:
    """For each end (2S,), the end of another segment that goes on from it, or -1."""
    order = np.argsort(node, kind="stable")
    name = node[order]
    first = np.flatnonzero(np.r_[True, name[1:] != name[:-1]])
    degree = np.diff(np.r_[first, len(name)])
    mate = np.full(len(node), -1)
    pair = first[degree == 2]
    a, b = order[pair], order[pair + 1]
    mate[a], mate[b] = b, a
    direction = points[:, 1] - points[:, 0]
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-30)[:, None]
    outward = np.stack([direction, -direction], axis=1).reshape(-1, 3)  # away from each end into its segment
    for start, size in zip(first[degree > 2], degree[degree > 2], strict=True):  # few: forks and corners
        ends = order[start : start + size]
        cosine = outward[ends] @ outward[ends].T
        np.fill_diagonal(cosine, 1.0)
        while True:
            i, j = np.unravel_index(cosine.argmin(), cosine.shape)
            if cosine[i, j] > -0.5:  # a bend of more than 60 degrees is a corner
                break
            mate[ends[i]], mate[ends[j]] = ends[j], ends[i]
            cosine[[i, j]] = cosine[:, [i, j]] = 1.0
    return mate


def _last(following: np.ndarray) -> np.ndarray:
    """The last walk of each walk's chain, -1 on rings: pointer doubling."""
    return _rank(following)[0]


def _rank(following: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each walk the last walk of its chain (-1 on rings) and the number of steps to it."""
    walks = np.arange(len(following))
    jump = np.where(following < 0, walks, following)
    steps = (following >= 0).astype(np.int64)
    for _ in range(int(len(following)).bit_length()):
        steps = steps + steps[jump]
        jump = jump[jump]
    return np.where(following[jump] < 0, jump, -1), steps


def _least(following: np.ndarray, value: np.ndarray) -> np.ndarray:
    """The least value on each walk's ring."""
    walks = np.arange(len(following))
    jump = np.where(following < 0, walks, following)
    for _ in range(int(len(following)).bit_length()):
        value = np.minimum(value, value[jump])
        jump = jump[jump]
    return value


def _drop_repeats(surface: Surface, curves: SurfaceCurves) -> SurfaceCurves:
    """Leave out points that coincide with the one before, and curves of which nothing remains.

    Lines through a vertex cross several edges in one point.
    """
    points = curves.points(surface)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    keep = np.r_[step > 1e-9, True]  # drop the earlier of two equal points: its segment has no length
    last = curves.offsets[1:] - 1
    keep[last] = True
    curve = np.repeat(np.arange(len(curves)), np.diff(curves.offsets))
    left = np.bincount(curve[keep], minlength=len(curves))
    good = left >= 2
    keep &= good[curve]
    return SurfaceCurves(
        curves.face[keep],
        curves.bary[keep],
        np.r_[0, np.cumsum(left[good])],
        curves.kind[good],
        curves.closed[good],
        curves.strength[keep],
    )
