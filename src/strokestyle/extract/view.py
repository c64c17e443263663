"""View = camera + visible curves + feature maps: one shape from one camera, and all that the networks ever see."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from ..files import replace_file
from ..geometry.curves import DEFAULT_SPACING, KINDS, Curves, arc_length, counting, owner, resample_curves, take_ragged
from ..geometry.parts import Parts, part_name
from ..mesh.surface import Surface
from .camera import Camera
from .rays import Scene
from .segments import LineOptions, SurfaceCurves, ViewFields, feature_curves
from .tidy import beside_none, tidy

FORMAT = 1
CURVE_ARRAYS = ("xy", "offsets", "kind", "closed")
SAMPLE = 1.0  # px between the points at which a line is asked whether it is seen
FLICKER = 2.5  # px
DEPTH_STEP = 0.01  # of the depth: a jump, not a slope
CLIP = 8.0  # of the 90th percentile
FLAT = 0.1  # the least scale of a curvature: on a box, where more than 90 % is flat, the rest must not become infinite
SHARP_KINDS = ("boundary", "crease", "intersection")  # lines that are edges of the mesh
HARD_KINDS = ("contour", *SHARP_KINDS)  # lines that are drawn hidden too
OTHER_KIND = (
    1.5  # px that a line of another kind counts as farther away, where the line that a point came from is sought
)
LOOSE = 50.0  # px, an intersection that is shorter may go with the lines that it is chained to
RIM = (1.5, 5.0)  # px round a point of a line from elsewhere, in which the shape is sought that it was drawn for

# The paper's eight geometry channels (its authors split the radial curvature by sign), then the screen-space normal.
PAPER_MAPS = (
    "depth",
    "radial_curvature_positive",
    "radial_curvature_negative",
    "radial_curvature_derivative",
    "max_curvature",
    "min_curvature",
    "view_curvature",
    "n_dot_v",
)
NORMAL_MAPS = ("normal_x", "normal_y")  # x right, y down, components of the unit normal, not rescaled; background 0


@dataclass(frozen=True)
class FeatureMaps:
    """Per-pixel geometry of the visible surface.

    Parameters
    ----------
    names : K names: PAPER_MAPS, NORMAL_MAPS, "plain"
    values : (K, H, W) float32. PAPER_MAPS are scaled by their 90th percentile, background 1.
        "plain" is the raster of the curves, 1 px wide, 1 = line.
    covered : (H, W) bool, where the surface is seen
    scale : (K,) float32, what the values of each map were divided by; 1 where it was not scaled
    """

    names: tuple[str, ...]
    values: np.ndarray
    covered: np.ndarray
    scale: np.ndarray | None = None

    def __post_init__(self):
        values, covered = np.asarray(self.values, np.float32), np.asarray(self.covered, bool)
        scale = np.ones(len(self.names), np.float32) if self.scale is None else np.asarray(self.scale, np.float32)
        if values.ndim != 3 or len(values) != len(self.names) or covered.shape != values.shape[1:]:
            raise ValueError(
                f"FeatureMaps.values must have shape ({len(self.names)}, H, W) like covered (H, W), "
                f"got {values.shape} and {covered.shape}"
            )
        if scale.shape != (len(self.names),):
            raise ValueError(f"FeatureMaps.scale must have shape ({len(self.names)},), got {scale.shape}")
        if not (np.isfinite(values).all() and np.isfinite(scale).all()):
            raise ValueError("FeatureMaps holds values that are not finite")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "covered", covered)
        object.__setattr__(self, "scale", scale)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[self.names.index(name)]


@dataclass(frozen=True)
class View:
    """One shape from one camera.

    Parameters
    ----------
    camera : Camera
    curves : Curves, visible, evenly spaced, within the canvas
    maps : FeatureMaps of the camera's size
    hidden : Curves behind the surface, where they were asked for
    parts, hidden_parts : the named part of the shape that each point of the curves, and of the hidden ones, lies on;
        None where the shape has but one
    """

    camera: Camera
    curves: Curves
    maps: FeatureMaps
    hidden: Curves = field(default_factory=Curves.empty)
    parts: Parts | None = None
    hidden_parts: Parts | None = None

    def __post_init__(self):
        if self.maps.covered.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"View.maps are {self.maps.covered.shape[1]} x {self.maps.covered.shape[0]} px, "
                f"its camera {self.camera.width} x {self.camera.height}"
            )
        for parts, curves in ((self.parts, self.curves), (self.hidden_parts, self.hidden)):
            if parts is not None and len(parts) != len(curves.xy):
                raise ValueError(f"View.parts must name the part of {len(curves.xy)} points, not of {len(parts)}")

    @property
    def curve_parts(self) -> Parts | None:
        """The part of each curve, that of most of its points."""
        return None if self.parts is None else self.parts.vote(self.curves.offsets)

    @property
    def hidden_curve_parts(self) -> Parts | None:
        """The part of each hidden curve."""
        return None if self.hidden_parts is None else self.hidden_parts.vote(self.hidden.offsets)

    def pieces_by_part(self, hidden: bool = False) -> tuple[Curves, Parts | None]:
        """The curves, or the hidden ones, cut where they run from one part into another; and the part of each piece."""
        curves, parts = (self.hidden, self.hidden_parts) if hidden else (self.curves, self.parts)
        if parts is None:
            return curves, None
        made = parts.cut(curves.offsets, arc_length(curves.xy, curves.offsets))
        kind, closed = curves.kind[made.line], curves.closed[made.line] & made.whole
        return Curves(curves.xy[made.rows], made.offsets, kind, closed), made.parts

    def at_curves(self, names, xy: np.ndarray | None = None) -> np.ndarray:
        """Maps read at the curves' points, or at pixels `xy` (N, 2): (N, len(names)) float32.

        A line often lies where one part of the surface hides another, or on the rim of the shape, half a pixel off. It
        belongs to the part in front: where some pixel within 2 px shows a surface clearly nearer to the eye than the
        pixel under the point does, or that one shows none, the nearest pixel of the nearer surface is read instead.
        """
        xy = self.curves.xy if xy is None else np.asarray(xy, np.float64)
        rows = [self.maps.names.index(name) for name in names]
        height, width = self.maps.covered.shape
        if not len(xy) or not self.maps.covered.any():
            return np.broadcast_to(np.float32([name not in NORMAL_MAPS for name in names]), (len(xy), len(rows))).copy()
        depth = np.where(self.maps.covered, self.maps["depth"], np.inf)
        column, row = (np.clip(np.floor(xy[:, i]).astype(np.int64), 0, n - 1) for i, n in enumerate((width, height)))
        r = np.arange(-2, 3)
        dy, dx = (d.ravel() for d in np.meshgrid(r, r, indexing="ij"))
        disc = dx * dx + dy * dy <= 4
        near_row = np.clip(row[:, None] + dy[disc], 0, height - 1)
        near_column = np.clip(column[:, None] + dx[disc], 0, width - 1)
        around = depth[near_row, near_column]  # (N, 13)
        front = around.min(axis=1)
        moved = front < depth[row, column] * (1.0 - DEPTH_STEP)
        # of the pixels of the part in front, the nearest to the point
        away = (near_column + 0.5 - xy[:, :1]) ** 2 + (near_row + 0.5 - xy[:, 1:]) ** 2
        away[around > front[:, None] * (1.0 + DEPTH_STEP)] = np.inf
        best = away.argmin(axis=1)[:, None]
        row = np.where(moved, np.take_along_axis(near_row, best, 1)[:, 0], row)
        column = np.where(moved, np.take_along_axis(near_column, best, 1)[:, 0], column)
        lost = ~self.maps.covered[row, column]
        if lost.any():
            _, (to_row, to_column) = distance_transform_edt(~self.maps.covered, return_indices=True)
            row, column = np.where(lost, to_row[row, column], row), np.where(lost, to_column[row, column], column)
        return self.maps.values[np.array(rows)[:, None], row, column].T


# --------------------------------------------------------------------------------------------------------- making


def extract(
    surface: Surface,
    camera: Camera,
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    scene: Scene | None = None,
    hidden: bool = False,
) -> View:
    """Draw a surface plainly: feature curves, hidden parts cut away, tidied, evenly spaced; and the feature maps.

    `scene` is the surface's own; give it to draw several views without building it again. `hidden` asks for the hidden
    parts too, of the kinds in HARD_KINDS: those describe the shape, the others only how its front looks.
    """
    options, size = options or LineOptions(), (camera.width, camera.height)
    scene = scene or Scene(surface)
    lines = feature_curves(surface, camera, options)
    sight = _sight(surface, camera, lines, scene)
    fragments, strength, face = sight.fragments(lines, sight.seen)
    strokes = tidy(fragments, strength, size)
    curves = resample_curves(strokes, spacing)
    faces, behind, hidden_faces = _faces_at(surface, curves, fragments, face), Curves.empty(), None
    if hidden:
        kinds = tuple(kind for kind in options.kinds if kind in HARD_KINDS)
        every = feature_curves(surface, camera, replace(options, kinds=kinds, trim=False))
        sight = _sight(surface, camera, every, scene)
        whole, _, face = sight.fragments(every, sight.hidden)
        fragments = beside_none(whole, strokes, size)
        behind = resample_curves(tidy(fragments, np.ones(len(fragments.xy)), size), spacing)
        hidden_faces = _faces_at(surface, behind, whole, face)
    view = View(camera, curves, feature_maps(surface, camera, curves, scene), behind)
    return _with_parts(view, surface, faces, hidden_faces)


def view_of(
    surface: Surface, camera: Camera, curves: Curves, spacing: float = DEFAULT_SPACING, scene: Scene | None = None
) -> View:
    """A view with curves from elsewhere, clipped to the canvas and evenly spaced; the surface gives maps and parts."""
    curves, scene = resample_curves(clip(curves, camera.width, camera.height), spacing), scene or Scene(surface)
    view = View(camera, curves, feature_maps(surface, camera, curves, scene))
    return _with_parts(view, surface, _faces_in_front(surface, camera, curves.xy, scene))


def view_of_lines(
    curves: Curves, width: int, height: int, spacing: float = DEFAULT_SPACING, parts: Parts | None = None
) -> View:
    """Lines without a shape: no surface is seen anywhere, and the maps are those of the background.

    `parts` : the named part that each of the curves (C,) belongs to
    """
    curves, source = _clip(curves, width, height)
    curves = resample_curves(curves, spacing)
    names = (*PAPER_MAPS, *NORMAL_MAPS, "plain")
    values = np.ones((len(names), height, width), np.float32)
    values[len(PAPER_MAPS) : -1] = 0.0
    values[-1] = plain_raster(curves, width, height)
    camera = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0, width, height)
    of_points = None if parts is None else parts.take(source[owner(curves.offsets)])
    return View(camera, curves, FeatureMaps(names, values, np.zeros((height, width), bool)), parts=of_points)


def visible_fragments(
    surface: Surface, camera: Camera, lines: SurfaceCurves, scene: Scene
) -> tuple[Curves, np.ndarray]:
    """The parts of lines on a surface that the camera sees, and the strength of each of their points (N,).

    Lines are sampled every SAMPLE px. What is seen or hidden over less than FLICKER px takes after its surroundings.
    """
    sight = _sight(surface, camera, lines, scene)
    return sight.fragments(lines, sight.seen)[:2]


@dataclass(frozen=True)
class _Sight:
    """What a camera sees of lines, at M points along them.

    Parameters
    ----------
    xy : (M, 2) pixels, on the canvas
    strength : (M,)
    face : (M,) int, the face that each point lies on
    line : (M,) int, the line that each point is on
    inside, seen : (M,) bool, on the canvas; and not behind the surface
    """

    xy: np.ndarray
    strength: np.ndarray
    face: np.ndarray
    line: np.ndarray
    inside: np.ndarray
    seen: np.ndarray

    @property
    def hidden(self) -> np.ndarray:
        """(M,) bool, on the canvas and behind the surface."""
        return self.inside & ~self.seen

    def fragments(self, lines: SurfaceCurves, wanted: np.ndarray) -> tuple[Curves, np.ndarray, np.ndarray]:
        """The stretches of `wanted` (M,) points as curves, and the strength and the face of their points."""
        if not len(self.line):
            return Curves.empty(), np.zeros(0), np.zeros(0, np.int64)
        new = np.flatnonzero(np.r_[True, (wanted[1:] != wanted[:-1]) | (self.line[1:] != self.line[:-1])])
        end = np.r_[new[1:], len(wanted)]
        good = wanted[new] & (end - new >= 2)
        rows, offsets = take_ragged(np.r_[new, len(wanted)], np.flatnonzero(good))
        kept = self.line[new[good]]
        whole = (end - new)[good] == np.bincount(self.line, minlength=len(lines))[kept]
        curves = Curves(self.xy[rows], offsets, lines.kind[kept], lines.closed[kept] & whole)
        return curves, self.strength[rows], self.face[rows]


def _sight(surface: Surface, camera: Camera, lines: SurfaceCurves, scene: Scene) -> _Sight:
    if not len(lines):
        none, no = np.zeros(0, np.int64), np.zeros(0, bool)
        return _Sight(np.zeros((0, 2)), np.zeros(0), none, none, no, no)
    points = lines.points(surface)
    start, t = _nodes(points, lines.offsets, camera)
    line = owner(lines.offsets)[start]
    after = np.minimum(start + 1, lines.offsets[1:][line] - 1)
    node = points[start] + t[:, None] * (points[after] - points[start])
    strength = lines.strength[start] + t * (lines.strength[after] - lines.strength[start])
    sharp = np.isin(lines.kind, [KINDS.index(kind) for kind in SHARP_KINDS])[line]
    xy, depth = camera.project(node)
    low, high = -1e-6, np.array([camera.width, camera.height]) + 1e-6
    inside = (depth > 0.0) & ((xy >= low) & (xy <= high)).all(axis=1)
    ask, seen = np.flatnonzero(inside), inside.copy()
    seen[ask] = scene.seen(camera.eye, lines.face[start[ask]], node[ask], sharp[ask])
    xy = np.clip(xy, 0.0, [camera.width, camera.height])
    step = np.r_[0.0, np.hypot(*np.diff(xy, axis=0).T)]
    for state in (False, True):  # first mend short gaps, then drop short sightings
        seen = _without_short_runs(seen, line, step, state)
    return _Sight(xy, strength, lines.face[start], line, inside, seen)


def _nodes(points: np.ndarray, offsets: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Where along polylines in space (N, 3) to look: row (M,) and t (M,), the point row + t of the way to row + 1.

    Every row, then points SAMPLE px apart as far as the canvas reaches, its very edge included.
    """
    here = np.arange(len(points))
    after = np.minimum(here + 1, (offsets[1:] - 1)[owner(offsets)])
    right, down, forward = camera.axes
    rel = points - camera.eye
    x, y, z = rel @ right * camera.focal, rel @ down * camera.focal, rel @ forward
    # each side of the canvas, and the eye's own plane, is a linear function in space, positive inside
    w, h = 0.5 * camera.width, 0.5 * camera.height
    inside = np.stack([w * z + x, w * z - x, h * z + y, h * z - y, z - 1e-6], axis=1)
    a, b = inside, inside[after]
    crossing = a / np.where(a == b, 1.0, a - b)
    t0 = np.where((a < 0) & (b > a), crossing, np.where(a < 0, 2.0, 0.0)).max(axis=1)
    t1 = np.where((b < 0) & (a > b), crossing, np.where(b < 0, -1.0, 1.0)).min(axis=1)
    meets = (t1 > t0) & (after != here)
    t0, t1 = np.where(meets, t0, 0.0), np.where(meets, t1, 0.0)
    span = points[after] - points
    ends = [camera.project(points + np.where(meets, t, 0.0)[:, None] * span)[0] for t in (t0, t1)]
    length = np.where(meets, np.hypot(*(ends[1] - ends[0]).T), 0.0)
    pieces = np.maximum(np.ceil(length / SAMPLE), 1).astype(np.int64)
    lead, tail = t0 > 0.0, meets & (t1 < 1.0)  # a row outside the canvas; an end on its edge
    count = lead + pieces + tail
    row = np.repeat(here, count)
    k = counting(count) - lead[row]
    t = t0[row] + (t1 - t0)[row] * np.maximum(k, 0) / pieces[row]
    return row, np.where(k < 0, 0.0, t)


def _without_short_runs(seen: np.ndarray, line: np.ndarray, step: np.ndarray, state: bool) -> np.ndarray:
    """`seen` (N,) with runs of `state` that are shorter than FLICKER px turned over, but for those at a line's ends."""
    new = np.flatnonzero(np.r_[True, (seen[1:] != seen[:-1]) | (line[1:] != line[:-1])])
    end = np.r_[new[1:], len(seen)]
    along = np.cumsum(step)
    extent = along[end - 1] - along[new]
    inner = (line[np.maximum(new - 1, 0)] == line[new]) & (line[np.minimum(end, len(line) - 1)] == line[new])
    inner &= (new > 0) & (end < len(seen))
    turn = (seen[new] == state) & (extent < FLICKER) & inner
    return seen ^ np.repeat(turn, end - new)


def clip(curves: Curves, width: int, height: int) -> Curves:
    """The parts of curves inside the canvas, cut at its edge; curves of no length are dropped."""
    return _clip(curves, width, height)[0]


def _clip(curves: Curves, width: int, height: int) -> tuple[Curves, np.ndarray]:
    """What `clip` gives, and the curve that each piece is of (C,)."""
    out, source, closed = [], [], []
    for i in range(len(curves)):
        points = curves[i]
        if points.min() >= 0 and points[:, 0].max() <= width and points[:, 1].max() <= height:
            pieces = [points]
        else:
            pieces = _clip_line(points, width, height)
        for piece in pieces:
            if np.ptp(piece, axis=0).max() > 1e-6:
                out.append(piece)
                source.append(i)
                closed.append(bool(curves.closed[i]) and piece is points)
    source = np.array(source, np.int64)
    return (Curves.from_list(out, curves.kind[source], closed) if out else Curves.empty()), source


def _clip_line(points: np.ndarray, width: int, height: int) -> list[np.ndarray]:
    """Liang-Barsky on every segment of one polyline (n, 2)."""
    a, d = points[:-1], np.diff(points, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = -a / d, (np.array([width, height]) - a) / d
    flat = np.abs(d) < 1e-12
    outside = flat & ((a < 0) | (a > [width, height]))
    t0 = np.where(flat, 0.0, np.minimum(low, high)).max(axis=1).clip(0, 1)
    t1 = np.where(flat, 1.0, np.maximum(low, high)).min(axis=1).clip(0, 1)
    keep = (t1 > t0) & ~outside.any(axis=1)
    pieces, current = [], []
    for i in np.flatnonzero(keep):
        begin, end = a[i] + t0[i] * d[i], a[i] + t1[i] * d[i]
        if not current or t0[i] > 0 or np.abs(current[-1] - begin).max() > 1e-9:
            current = [begin]
            pieces.append(current)
        current.append(end)
    return [np.array(piece) for piece in pieces]


# ---------------------------------------------------------------------------------------------------------- parts


def _with_parts(view: View, surface: Surface, faces: np.ndarray | None, hidden_faces: np.ndarray | None = None) -> View:
    """The view with the parts of its curves' points, which lie on `faces` (N,), -1 where they lie on none.

    Parts are put in order by the mean depth of their visible lines, so that of two that meet the nearer is painted
    last.
    """
    if faces is None:
        return view
    name = [part_name(text) for text in surface.part_names]
    names = [text for text in dict.fromkeys(name) if text]
    number = {text: i for i, text in enumerate(names)} | {"": -1}
    of_part = np.array([number[text] for text in name])
    hidden_faces = np.zeros(0, np.int64) if hidden_faces is None else hidden_faces
    index, hidden = (np.where(f < 0, -1, of_part[surface.part[f]]) for f in (faces, hidden_faces))
    depth = view.at_curves(["depth"])[:, 0]
    count, total = (np.bincount(index + 1, weight, len(names) + 1)[1:] for weight in (None, depth))
    order = np.argsort(-np.where(count > 0, total / np.maximum(count, 1), np.inf), kind="stable")
    place = np.r_[np.argsort(order), -1]  # of -1 it is -1
    parts, behind = (Parts(tuple(names[i] for i in order), place[rows]) for rows in (index, hidden))
    return replace(view, parts=parts, hidden_parts=behind if len(view.hidden) else None)


def _has_parts(surface: Surface) -> bool:
    return len(surface.part_names) > 1 and len({part_name(text) for text in surface.part_names}) > 1


def _faces_at(surface: Surface, curves: Curves, fragments: Curves, face: np.ndarray) -> np.ndarray | None:
    """The face (N,) that each point of curves lies on, which were made of fragments whose points lie on `face` (M,).

    That is the face of the nearest point, rather of a line of the same kind: a curve may be chained of several. An
    intersection is of two parts, so that a short stretch of it goes with what it is chained to. None where faces tell
    nothing.
    """
    if not _has_parts(surface):
        return None
    if not (len(fragments) and len(curves)):
        return np.full(len(curves.xy), -1)
    away, near = cKDTree(fragments.xy).query(curves.xy, k=min(8, len(fragments.xy)))
    away, near = away.reshape(len(curves.xy), -1), near.reshape(len(curves.xy), -1)
    kind, curve = fragments.kind[owner(fragments.offsets)[near]], owner(curves.offsets)
    best = (away + OTHER_KIND * (kind != curves.kind[curve][:, None])).argmin(axis=1)[:, None]
    found, kind = (np.take_along_axis(rows, best, 1)[:, 0] for rows in (face[near], kind))
    loose, along = kind == KINDS.index("intersection"), arc_length(curves.xy, curves.offsets)
    start = np.flatnonzero(np.r_[True, (loose[1:] != loose[:-1]) | (curve[1:] != curve[:-1])])
    stop = np.r_[start[1:], len(loose)]
    loose &= np.repeat(along[stop - 1] - along[start] < LOOSE, stop - start)
    here, firm = np.arange(len(found)), np.flatnonzero(~loose)
    if not len(firm):
        return found
    after = np.searchsorted(firm, here)
    sides = firm[np.clip([after - 1, after], 0, len(firm) - 1)]  # the firm points before and after each point
    away = np.where(curve[sides] == curve, np.abs(sides - here), len(found))
    nearest = np.where(away[0] <= away[1], *sides)
    return found[np.where(away.min(axis=0) < len(found), nearest, here)]


def _faces_in_front(surface: Surface, camera: Camera, xy: np.ndarray, scene: Scene) -> np.ndarray | None:
    """The face (N,) nearest to the eye round each of some pixels (N, 2), -1 where there is none; None as above.

    A line may lie on the rim of what is in front, and a little off it.
    """
    if not _has_parts(surface):
        return None
    found = np.full(len(xy), -1)
    angle = np.arange(8) * (np.pi / 4)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    right, down, forward = camera.axes
    for radius in RIM:
        lost = np.flatnonzero(found < 0)
        at = xy[lost, None] + radius * np.concatenate([[[0.0, 0.0]], ring])  # (n, 9, 2)
        x, y = np.moveaxis(at - [0.5 * camera.width, 0.5 * camera.height], -1, 0)
        rays = x[..., None] * right + y[..., None] * down + camera.focal * forward
        hits = scene.first_hit(camera.eye, rays.astype(np.float32).reshape(-1, 3))
        nearest = hits.distance.reshape(-1, 9).argmin(axis=1)[:, None]
        found[lost] = np.take_along_axis(hits.face.reshape(len(lost), 9), nearest, 1)[:, 0]
    return found


# ----------------------------------------------------------------------------------------------------------- maps


def feature_maps(surface: Surface, camera: Camera, curves: Curves, scene: Scene) -> FeatureMaps:
    """The geometry seen at every pixel centre, by one ray each, per-vertex quantities interpolated.

    The paper's eight channels (sec. 3.2): depth along the view axis, radial curvature (DeCarlo 2003) in its positive
    and negative part, its derivative, the larger and the smaller principal curvature, the view-dependent curvature
    (Judd 2007), n.v. Each is divided by the 90th percentile of its size over the surface seen, and cut at +-CLIP;
    background 1. Then the normal on the screen (background 0) and the plain raster of the curves.
    """
    shape = (camera.height, camera.width)
    covered, face, bary = _first_faces(surface, camera, scene)
    view = ViewFields.of(surface, camera.eye)
    radial = view.radial_curvature(surface) / np.maximum(view.u**2 + view.v**2, 1e-6)
    right, down, _ = camera.axes
    k_high, k_low = np.maximum(surface.k1, surface.k2), np.minimum(surface.k1, surface.k2)
    fields = np.stack(
        [camera.project(surface.vertices)[1], radial, view.radial_derivative(surface), k_high, k_low,
         view.view_curvature(surface)[0], view.n_dot_v, surface.normals @ right, surface.normals @ down], axis=1
    ).astype(np.float32)  # fmt: skip
    corners = surface.faces[face]
    seen = sum(bary[:, i, None] * fields[corners[:, i]] for i in range(3)).T  # (9, pixels seen)
    depth, radial, derivative, k_high, k_low, bend, facing, normal_x, normal_y = seen
    # an open surface may be seen from behind: its normal is taken towards the eye
    turn = np.where(facing < 0, -1.0, 1.0).astype(np.float32)
    channels = [depth, np.maximum(radial, 0), np.maximum(-radial, 0), derivative, k_high, k_low, bend, turn * facing]
    names = (*PAPER_MAPS, *NORMAL_MAPS, "plain")
    scale = np.ones(len(names), np.float32)
    values = np.ones((len(names), *shape), np.float32)
    values[[names.index(name) for name in NORMAL_MAPS]] = 0.0
    for i, channel in enumerate(channels):
        scale[i] = max(_percentile(np.abs(channel), 0.9), 1e-6 if names[i] in ("depth", "n_dot_v") else FLAT)
        channels[i] = np.clip(channel / scale[i], -CLIP, CLIP)
    for row, channel in zip(values, [*channels, turn * normal_x, turn * normal_y], strict=False):
        row[covered] = _half(channel)
    values[-1] = _half(plain_raster(curves, camera.width, camera.height))
    return FeatureMaps(names, values, covered, scale)


def _first_faces(surface: Surface, camera: Camera, scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the surface is seen (H, W), and there, row by row, its face (P,) and the place in it (P, 3) float32."""
    covered = np.zeros((camera.height, camera.width), bool)
    xy, depth = camera.project(surface.vertices)
    left, top, last_column, last_row = 0, 0, camera.width, camera.height
    if depth.min() > 1e-6:  # rays only where they can hit
        left, top = (int(v) for v in np.clip(np.floor(xy.min(axis=0)) - 1, 0, [camera.width, camera.height]))
        last_column, last_row = (int(v) for v in np.clip(np.ceil(xy.max(axis=0)) + 1, 0, [camera.width, camera.height]))
    right, down, forward = camera.axes
    x = (np.arange(left, last_column) + 0.5 - 0.5 * camera.width)[None, :, None] * right
    y = (np.arange(top, last_row) + 0.5 - 0.5 * camera.height)[:, None, None] * down
    rays = (x + (y + camera.focal * forward)).astype(np.float32).reshape(-1, 3)
    hits = scene.first_hit(camera.eye, rays)
    hit = hits.face >= 0
    covered[top:last_row, left:last_column] = hit.reshape(last_row - top, last_column - left)
    return covered, hits.face[hit], hits.bary[hit].astype(np.float32)


def _percentile(values: np.ndarray, q: float) -> float:
    """The value that a share q of them does not exceed; 1 where there are none."""
    if not len(values):
        return 1.0
    k = int(q * (len(values) - 1))
    return float(np.partition(values, k)[k])


def _half(values: np.ndarray) -> np.ndarray:
    """Rounded to half precision from the start, so that what is saved is what was used."""
    return values.astype(np.float16).astype(np.float32)


def _may_meet(a: np.ndarray, b: np.ndarray, width: int, height: int) -> np.ndarray:
    """Whether the box of each segment, grown by 1 px, meets the canvas."""
    return ((np.maximum(a, b) > -1.0) & (np.minimum(a, b) < np.array([width, height]) + 1.0)).all(axis=1)


def plain_raster(curves: Curves, width: int, height: int) -> np.ndarray:
    """Curves drawn 1 px wide, (H, W) float32: 1 on the line, falling to 0 at a pixel centre 1 px from it."""
    out = np.zeros((height, width), np.float32)
    if not len(curves):
        return out
    which = owner(curves.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    first = first[_may_meet(curves.xy[first], curves.xy[first + 1], width, height)]
    d = curves.xy[first + 1] - curves.xy[first]
    count = np.maximum(np.ceil(np.hypot(*d.T) / 4.0), 1).astype(np.int64)  # 8 x 8 pixels hold 4 px and their margin
    d = np.repeat(d / count[:, None], count, axis=0)
    k = counting(count)
    a = np.repeat(curves.xy[first], count, axis=0) + k[:, None] * d
    corner = np.floor(np.minimum(a, a + d) - 1.0).astype(np.int64)
    step = np.arange(8)
    x, y = corner[:, 0, None, None] + step, corner[:, 1, None, None] + step[:, None]  # (S, 1, 8), (S, 8, 1)
    rx, ry = x + 0.5 - a[:, 0, None, None], y + 0.5 - a[:, 1, None, None]
    dx, dy = d[:, 0, None, None], d[:, 1, None, None]
    t = np.clip((rx * dx + ry * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    ink = 1.0 - np.hypot(rx - t * dx, ry - t * dy)  # (S, 8, 8)
    good = (ink > 0.0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    np.maximum.at(out.ravel(), (y * width + x)[good], ink[good].astype(np.float32))
    return out


# ---------------------------------------------------------------------------------------------------------- files


def save_view(path: str | Path, view: View) -> None:
    """Write a view as .npz, whole or not at all."""
    curves, maps = view.curves, view.maps
    arrays = {
        "strokestyle_view": np.array(FORMAT),
        "camera": np.array(json.dumps(view.camera.to_dict())),
        **{name: getattr(curves, name) for name in CURVE_ARRAYS},
        "names": np.array(maps.names), "values": maps.values.astype(np.float16), "covered": np.packbits(maps.covered),
        "scale": maps.scale,
    }  # fmt: skip
    if len(view.hidden):
        arrays |= {f"hidden_{name}": getattr(view.hidden, name) for name in CURVE_ARRAYS}
    if view.parts is not None:
        arrays |= {"part_names": np.array(view.parts.names, str), "part": view.parts.index}
    if view.hidden_parts is not None:
        arrays |= {"part_names": np.array(view.hidden_parts.names, str), "hidden_part": view.hidden_parts.index}

    def write(name):
        # np.savez_compressed takes four times as long, and writes the time of day
        with zipfile.ZipFile(name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
            for key, value in arrays.items():
                entry = zipfile.ZipInfo(key + ".npy")
                entry.compress_type = zipfile.ZIP_DEFLATED
                with file.open(entry, "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, np.asarray(value, order="C"), allow_pickle=False)

    replace_file(path, write)


def load_view(path: str | Path) -> View:
    """Read what `save_view` wrote. Raises ValueError, naming the file, on anything else; OSError where unreadable."""
    path = Path(path)
    try:
        with open(path, "rb") as handle, np.lib.npyio.NpzFile(handle) as file:
            if "strokestyle_view" not in file.files:
                raise ValueError("not a view saved by `strokestyle extract`")
            if int(file["strokestyle_view"]) > FORMAT:
                raise ValueError("written by a newer strokestyle; update, or extract it again")
            camera = Camera.from_dict(json.loads(str(file["camera"])))
            curves = Curves(*(file[name] for name in CURVE_ARRAYS))
            shape, bits = (camera.height, camera.width), np.unpackbits(file["covered"])
            covered = bits[: shape[0] * shape[1]].astype(bool).reshape(shape)
            scale = file["scale"] if "scale" in file.files else None
            hidden = Curves.empty()
            if "hidden_xy" in file.files:
                hidden = Curves(*(file[f"hidden_{name}"] for name in CURVE_ARRAYS))
            maps = FeatureMaps(tuple(map(str, file["names"])), file["values"], covered, scale)
            parts = {
                f"{name}s": Parts(tuple(map(str, file["part_names"])), file[name])
                for name in ("part", "hidden_part")
                if name in file.files
            }
            return View(camera, curves, maps, hidden, **parts)
    except (zipfile.BadZipFile, EOFError, KeyError, zlib.error, TypeError) as error:
        raise ValueError(f"{path}: not a view, or a damaged one ({error}); extract it again") from None
    except ValueError as error:
        if "pickled" in str(error):
            raise ValueError(f"{path}: not a view saved by `strokestyle extract`") from None
        raise ValueError(f"{path}: {error}") from None


def view_to_json(view: View) -> dict:
    """Camera, curves and what the surface is like along them, for other programs. Points in pixels, two decimals."""
    curves = view.curves
    names = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y")
    scale = np.array([view.maps.scale[view.maps.names.index(name)] for name in names])
    fields = view.at_curves(names) * scale

    def ragged(curves, values, digits):
        flat = np.round(np.asarray(values, np.float64), digits).tolist()
        return [flat[a:b] for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True)]

    content = {
        "format": "strokestyle-curves-1",
        "camera": view.camera.to_dict(),
        "size": [view.camera.width, view.camera.height],
        "step": float(np.round(np.median(np.hypot(*np.diff(curves.xy, axis=0).T)), 2)) if len(curves) else 0.0,
        "curves": ragged(curves, curves.xy, 2),
        "kinds": [KINDS[k] for k in curves.kind],
        "closed": curves.closed.tolist(),
        "fields": {
            name: ragged(curves, column, 4)
            for name, column in zip(("depth", "ndotv", "curvature", "nx", "ny"), fields.T, strict=True)
        },
    }
    if len(view.hidden):
        content["hidden"] = {
            "curves": ragged(view.hidden, view.hidden.xy, 2),
            "kinds": [KINDS[k] for k in view.hidden.kind],
            "closed": view.hidden.closed.tolist(),
        }
    for target, parts in ((content, view.curve_parts), (content.get("hidden"), view.hidden_curve_parts)):
        if parts is not None:
            target["parts"] = [parts.name(i) for i in range(len(parts))]
    return content
