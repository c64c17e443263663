"""Remove hidden lines: ask the rays along each line, and keep the stretches that are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import Curves, counting, is_kind, kept_stretches, owner, runs, take_ragged
from ..geometry.kinds import SHARP_KINDS
from ..mesh.surface import Surface
from ..mesh.triangles import row_dot
from .camera import Camera
from .eye import towards
from .rays import Bvh
from .surface_curves import SurfaceCurves
from .view_curvature import closed_from

SAMPLE = 1.0  # px between the points at which a line is asked whether it is seen
FLICKER = 2.5  # px
CHUNK = 1 << 18  # points that are asked in one go: bounds memory
ON_EDGE = 1e-9  # a barycentric coordinate of a point that is on the side opposite
CANVAS_SLACK = 1e-6  # px that a point on the very edge of the canvas may lie outside


@dataclass(frozen=True)
class Fragments:
    """Stretches of lines on the canvas.

    Parameters
    ----------
    curves : N points, in pixels
    strength : (N,) in 0..1
    face : (N,) int, the face that each point lies on
    point : (N, 3), where in space each point lies; None where nobody knows
    """

    curves: Curves
    strength: np.ndarray
    face: np.ndarray
    point: np.ndarray | None = None

    def take(self, index: np.ndarray) -> Fragments:
        """Select the stretches of an index or mask over them, in that order."""
        rows, _ = take_ragged(self.curves.offsets, np.arange(len(self.curves))[index])
        point = None if self.point is None else self.point[rows]
        return Fragments(self.curves.take(index), self.strength[rows], self.face[rows], point)

    @classmethod
    def concatenate(cls, *parts: Fragments) -> Fragments:
        """Put fragments one after the other."""
        points = [part.point for part in parts if part.point is not None]
        return cls(
            Curves.concatenate([part.curves for part in parts]),
            np.concatenate([part.strength for part in parts]),
            np.concatenate([part.face for part in parts]),
            np.concatenate(points) if len(points) == len(parts) else None,
        )


@dataclass(frozen=True)
class SampledLines:
    """What a camera sees of lines, at M points along them.

    Parameters
    ----------
    lines : C lines on the surface
    points : (N, 3), where in space their own points lie
    row, share : (M,), a point lies this share of the way from point `row` of the lines to the next
    xy : (M, 2) pixels, on the canvas
    strength : (M,)
    face : (M,) int, the face that each point lies on
    line : (M,) int, the line that each point is on
    inside, seen : (M,) bool, on the canvas; and not behind the surface
    """

    lines: SurfaceCurves
    points: np.ndarray
    row: np.ndarray
    share: np.ndarray
    xy: np.ndarray
    strength: np.ndarray
    face: np.ndarray
    line: np.ndarray
    inside: np.ndarray
    seen: np.ndarray

    @property
    def hidden(self) -> np.ndarray:
        """Tell which points are on the canvas and behind the surface, (M,) bool."""
        return self.inside & ~self.seen

    def fragments(self, wanted: np.ndarray | None = None) -> Fragments:
        """Cut out stretches of two or more points `wanted`, (M,) bool; by default those seen."""
        wanted = self.seen if wanted is None else wanted
        if not len(self.line):
            none = np.zeros(0)
            return Fragments(Curves.empty(), none, none.astype(np.int64), np.zeros((0, 3)))
        rows, offsets, of, whole = kept_stretches(self.line, wanted)
        curves = Curves(self.xy[rows], offsets, self.lines.kind[of], self.lines.closed[of] & whole)
        place = _between(self.lines, self.points, self.row[rows], self.share[rows])
        return Fragments(curves, self.strength[rows], self.face[rows], place)


def _between(
    lines: SurfaceCurves, points: np.ndarray, row: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Place points (M, 3) in space, at a share (M,) of the way from rows (M,) of lines to the next.

    `points` (N, 3) are those of the lines.
    """
    after = _next_rows(lines.offsets)[row]
    return points[row] + share[:, None] * (points[after] - points[row])


def _next_rows(offsets: np.ndarray) -> np.ndarray:
    """Find for each row of lines the next on its line, (N,) int; the last is its own next."""
    rows = np.arange(offsets[-1])
    return np.minimum(rows + 1, (offsets[1:] - 1)[owner(offsets)])


def look_along(
    surface: Surface, camera: Camera, lines: SurfaceCurves, bvh: Bvh | None
) -> SampledLines:
    """Sample lines every SAMPLE px and ask at each point whether the camera sees it.

    What is seen or hidden over less than FLICKER px takes after its surroundings. Without a `bvh`
    nothing is asked, and nothing is seen.
    """
    if not len(lines):
        none, no = np.zeros(0, np.int64), np.zeros(0, bool)
        flat, empty = np.zeros((0, 2)), np.zeros(0)
        return SampledLines(lines, np.zeros((0, 3)), none, empty, flat, empty, none, none, no, no)
    points = lines.points(surface)
    row, t = _sample_places(points, lines.offsets, camera)
    line = owner(lines.offsets)[row]
    xy, strength = np.empty((len(row), 2)), np.empty(len(row))
    inside, seen = np.zeros((2, len(row)), bool)
    sharp, side = np.zeros(len(points), bool), np.zeros(0)
    if bvh is not None:
        sharp = is_kind(lines.kind, SHARP_KINDS)[owner(lines.offsets)]
        sharp |= _on_silhouette(surface, camera, lines)
        side = _sides(surface, camera, lines, points)
    for first in range(0, len(row), CHUNK):
        some = slice(first, first + CHUNK)
        here, share = row[some], t[some]
        after = np.minimum(here + 1, lines.offsets[1:][line[some]] - 1)
        place = points[here] + share[:, None] * (points[after] - points[here])
        change = lines.strength[after] - lines.strength[here]
        strength[some] = lines.strength[here] + share * change
        xy[some], inside[some] = _on_canvas(place, camera)
        if bvh is not None:
            ask = np.flatnonzero(inside[some])
            at = here[ask]
            seen[first + ask] = bvh.seen(
                camera.viewpoint, lines.face[at], place[ask], sharp[at], side[at]
            )
    if bvh is not None:
        seen = _without_flicker(seen, line, xy)
    return SampledLines(lines, points, row, t, xy, strength, lines.face[row], line, inside, seen)


def _on_silhouette(surface: Surface, camera: Camera, lines: SurfaceCurves) -> np.ndarray:
    """Tell at which rows contours run on along the silhouette of the triangles, (N,) bool.

    That is along an edge of just one face that faces the camera: there the mesh itself has the
    contour. Folds are such edges where both of their sides are flat.
    """
    contour = np.flatnonzero(is_kind(lines.kind, ("contour",)))
    out = np.zeros(len(lines.face), bool)
    # a fold ends at a vertex, unless normals turn on both of its sides
    if not len(contour) or not len(surface.cut_edges) and not (lines.bary > 1.0 - ON_EDGE).any():
        return out
    row, _ = take_ragged(lines.offsets, contour)
    step = np.setdiff1d(row, lines.offsets[1:] - 1, assume_unique=True)
    step, edge = _edges_along(surface, lines, step)
    one, two = surface.edge_faces[edge].T
    view = towards(camera.viewpoint, surface.vertices[surface.edges[edge, 0]])
    faces_eye = [row_dot(surface.face_normals[face], view) > 0.0 for face in (one, two)]
    out[step[(two < 0) | (faces_eye[0] != faces_eye[1])]] = True
    last = lines.offsets[1:][contour] - 1
    out[last] = out[last - 1]
    return out


def _edges_along(
    surface: Surface, lines: SurfaceCurves, row: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find from which rows (M,) lines run to the next along one mesh edge: those, and the edges."""
    corner = surface.faces[lines.face[row]]
    end = surface.weld[surface.faces[lines.face[row + 1]]]
    weight = lines.bary[row + 1]
    sides, along = surface.face_edges[lines.face[row]], np.full(len(row), -1)
    for i, j, opposite in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        a, b = surface.weld[corner[:, i]], surface.weld[corner[:, j]]
        at = np.logical_and.reduce(
            [(weight[:, k] < ON_EDGE) | (end[:, k] == a) | (end[:, k] == b) for k in range(3)]
        )
        at &= lines.bary[row, opposite] < ON_EDGE
        along[at] = sides[at, i]
    return row[along >= 0], along[along >= 0]


def _sides(
    surface: Surface, camera: Camera, lines: SurfaceCurves, points: np.ndarray
) -> np.ndarray:
    """Tell on which side of the surface lines are to be looked for, (N,) 1. or -1.

    Where only its outside can be seen, that is where the normals point. An open surface may be the
    wrong way round: there it is the side that faces the eye, and of a contour the side towards
    which the surface bulges along the view, as the radial curvature of DeCarlo et al. 2003 tells.
    `points` (N, 3) are those of the lines.
    """
    side = np.ones(len(points))
    open_ = np.flatnonzero(~closed_from(surface, camera.viewpoint)[lines.face])
    if not len(open_):
        return side
    corner, weight = surface.faces[lines.face[open_]], lines.bary[open_]
    view = towards(camera.viewpoint, points[open_])

    bulge = np.einsum("nik,nk->ni", surface.normals[corner], view)
    contour = is_kind(lines.kind, ("contour",))[owner(lines.offsets)[open_]]
    k1, k2, *axes = surface.curvature_at(corner[contour].ravel())
    along = [np.einsum("nik,nk->ni", axis.reshape(-1, 3, 3), view[contour]) ** 2 for axis in axes]
    bulge[contour] = k1.reshape(-1, 3) * along[0] + k2.reshape(-1, 3) * along[1]
    side[open_[row_dot(bulge, weight) < 0.0]] = -1.0
    return side


def _on_canvas(points: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Project points (M, 3) to pixels (M, 2) on the canvas, and tell which lie there, (M,) bool."""
    xy, depth = camera.project(points)
    size = np.array([camera.width, camera.height])
    within = (xy >= -CANVAS_SLACK) & (xy <= size + CANVAS_SLACK)
    return np.clip(xy, 0.0, size), camera.shows(depth) & within.all(axis=1)


def _sample_places(
    points: np.ndarray, offsets: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    """Choose where along polylines in space (N, 3) to look: at every row, and SAMPLE px apart.

    Returns rows (M,) int and t (M,): the points row + t of the way to row + 1. They reach as far as
    the canvas does, its very edge included.
    """
    here = np.arange(len(points))
    after = np.minimum(here + 1, (offsets[1:] - 1)[owner(offsets)])
    t0, t1 = _stretch_on_canvas(points, after, camera)
    meets = (t1 > t0) & (after != here)
    t0, t1 = np.where(meets, t0, 0.0), np.where(meets, t1, 0.0)
    span = points[after] - points
    ends = [camera.project(points + t[:, None] * span)[0] for t in (t0, t1)]
    length = np.where(meets, np.hypot(*(ends[1] - ends[0]).T), 0.0)
    pieces = np.maximum(np.ceil(length / SAMPLE), 1).astype(np.int64)
    lead, tail = t0 > 0.0, meets & (t1 < 1.0)  # a row outside the canvas; an end on its edge
    count = lead + pieces + tail
    row = np.repeat(here, count)
    k = counting(count) - lead[row]
    t = t0[row] + (t1 - t0)[row] * np.maximum(k, 0) / pieces[row]
    return row, np.where(k < 0, 0.0, t)


def _stretch_on_canvas(
    points: np.ndarray, after: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    """Clip the segments from points (N, 3) to the rows `after` (N,) to what the canvas shows.

    Returns from where to where along each, t0 and t1 (N,) in 0..1, and t0 above t1 where none of it
    is shown. Each side of the canvas, and the eye's own plane, is a linear function in space that
    is positive inside, so segments are clipped before they are projected.
    """
    x, y, z = camera.homogeneous(points)
    w, h = 0.5 * camera.width, 0.5 * camera.height
    a = np.stack([w * z + x, w * z - x, h * z + y, h * z - y, z - 1e-6], axis=1)
    b = a[after]
    crossing = a / np.where(a == b, 1.0, a - b)
    t0 = np.where((a < 0) & (b > a), crossing, np.where(a < 0, 2.0, 0.0)).max(axis=1)
    t1 = np.where((b < 0) & (a > b), crossing, np.where(b < 0, -1.0, 1.0)).min(axis=1)
    return t0, t1


def _without_flicker(seen: np.ndarray, line: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Mend short gaps in what is seen (M,) of lines, then drop short sightings."""
    along = np.cumsum(np.r_[0.0, np.hypot(*np.diff(xy, axis=0).T)])
    for state in (False, True):
        seen = _without_short_runs(seen, line, along, state)
    return seen


def _without_short_runs(
    seen: np.ndarray, line: np.ndarray, along: np.ndarray, state: bool
) -> np.ndarray:
    """Turn over the runs of `state` in `seen` (M,) that are shorter than FLICKER px.

    Those at a line's ends stay. `along` (M,) px counts on from point to point, over all lines.
    """
    start = runs(seen, line)
    new, end = start[:-1], start[1:]
    extent = along[end - 1] - along[new]
    inner = (line[np.maximum(new - 1, 0)] == line[new]) & (
        line[np.minimum(end, len(line) - 1)] == line[new]
    )
    inner &= (new > 0) & (end < len(seen))
    turn = (seen[new] == state) & (extent < FLICKER) & inner
    return seen ^ np.repeat(turn, end - new)
