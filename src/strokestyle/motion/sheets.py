"""Follow lines through all frames: what each point of a frame's lines was in the frame before.

A line that moves sweeps a sheet in space and time (Buchholz et al. 2011, "Spatio-temporal analysis
for parameterizing animated lines"). A sheet has a coordinate along the line, and one frame after
the other shows it anew. Places on the surface carry it over: a point of the last frame's line is
projected by the next camera from where the surface then is. For lines fixed on the surface that is
where the line is. A contour slides along the view rays, so that its image moves as that of the
surface does, up to r (1 - cos a) where the surface has a radius r and turns by a: near enough to
find it by, and soft lines that depend on the view move alike (Kalnins et al. 2003, sec. 4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..extract.eye import towards
from ..extract.rays import Bvh
from ..extract.view_curvature import closed_from
from ..geometry.curves import owner, runs, tangents
from ..geometry.kinds import KINDS, SOFT_KINDS
from ..mesh.triangles import row_dot
from .candidates import Candidates
from .frames import Shot
from .places import Places

FIXED_KINDS = ("boundary", "crease", "ridge", "valley", "intersection", "section")
FIXED = np.isin(KINDS, FIXED_KINDS)  # of each kind, whether its lines are fixed on the surface
SOFT = np.isin(KINDS, SOFT_KINDS)
PLANNED, TRACED, BARE = 2, 1, 0  # what there is of a line: a stroke, a line no stroke was made of
GAP = 12.0  # px between points of a sheet that follow each other, at most
BESIDE = 2.5  # px of its coordinate by which what was found of a sheet replaces more
STALE = 3  # frames for which a line that depends on the view is carried without being seen anew
COVERED = 6.0  # px from a stroke, within which another line would double it
TRACED_REACH = 8.0  # px between a line and where it was carried
AWAY = 0.35  # n.v below -AWAY, smoothed normals and all, a closed surface cannot be seen
DEPTHS = (14.0, 90.0)  # px in depth between a line and where it was carried: fixed, and sliding
PARALLEL = np.cos(np.radians(35.0))


@dataclass(frozen=True)
class Points:
    """P points of all sheets in one frame, sheet by sheet, along each.

    Parameters
    ----------
    sheet : (P,) int
    along : (P,) the coordinate along the sheet, of about a px of the style's canvas
    places : of the points
    xy : (P, 2) px of the style's canvas
    kind : (P,) int8, of their lines
    support : (P,) int8, one of PLANNED, TRACED, BARE
    seen : (P,) bool, on the canvas and not hidden
    covered : (P,) bool, a stroke of another sheet is drawn there
    new : (P,) bool, the sheet was not there in the frame before, though one saw the surface
    age : (P,) int, frames since a line was found there
    part_face : (P,) int, the face whose part a point belongs to
    row : (P,) int, the point of the planned strokes that it is, counted with one left out between
        two strokes; -1 for none
    """

    sheet: np.ndarray
    along: np.ndarray
    places: Places
    xy: np.ndarray
    kind: np.ndarray
    support: np.ndarray
    seen: np.ndarray
    covered: np.ndarray
    new: np.ndarray
    age: np.ndarray
    part_face: np.ndarray
    row: np.ndarray

    def __len__(self) -> int:
        return len(self.sheet)

    def take(self, rows: np.ndarray) -> Points:
        """Select the points of an index or mask, in that order."""
        values = {name: getattr(self, name)[rows] for name in _ARRAYS}
        return Points(places=self.places.take(rows), **values)

    @classmethod
    def concatenate(cls, parts: list[Points]) -> Points:
        """Put points together, sheet by sheet and along each."""
        values = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS}
        both = cls(places=Places.concatenate([part.places for part in parts]), **values)
        return both.take(np.lexsort((both.along, both.sheet)))

    @classmethod
    def none(cls) -> Points:
        """Make no points."""
        no, flag, flat = np.zeros(0, np.int64), np.zeros(0, bool), np.zeros((0, 2))
        nowhere = Places(no, np.zeros((0, 3)), flat)
        return cls(no, np.zeros(0), nowhere, flat, no, no, flag, flag, flag, no, no, no)

    @property
    def follows(self) -> np.ndarray:
        """Tell which points follow the one before them on their sheet, without a gap, (P,) bool."""
        out = np.zeros(len(self), bool)
        if len(self):
            step = np.hypot(*np.diff(self.xy, axis=0).T)
            out[1:] = (self.sheet[1:] == self.sheet[:-1]) & (step <= GAP)
        return out

    @property
    def tangents(self) -> np.ndarray:
        """Measure unit tangents (P, 2), on the picture, the way in which `along` rises."""
        return tangents(self.xy, np.r_[np.flatnonzero(~self.follows), len(self)])


_ARRAYS = (
    "sheet", "along", "xy", "kind", "support", "seen", "covered", "new", "age", "part_face", "row"
)  # fmt: skip


@dataclass(frozen=True)
class Run:
    """A stretch of a frame's planned strokes that belongs to one sheet.

    Parameters
    ----------
    rows : (n,) int, the planned points, in the order of the sheet
    sheet : int
    along : (n,), their coordinates, rising
    known : (n,) bool, where the sheet was there in the frame before
    """

    rows: np.ndarray
    sheet: int
    along: np.ndarray
    known: np.ndarray


def extents(points: Points) -> dict[int, tuple[float, float]]:
    """Find from where to where along each sheet its points reach."""
    if not len(points):
        return {}
    start = runs(points.sheet)
    low = np.minimum.reduceat(points.along, start[:-1])
    high = np.maximum.reduceat(points.along, start[:-1])
    sheets = points.sheet[start[:-1]].tolist()
    return dict(zip(sheets, zip(low.tolist(), high.tolist(), strict=True), strict=True))


def carried(old: Points, shot: Shot, scale: float) -> Points:
    """Move points on to another shot, with the surface; whether they are seen is left as it is."""
    xy, depth = old.places.seen(shot)
    ahead = shot.camera.shows(depth)
    return replace(old.take(ahead), xy=xy[ahead] / scale)


def found_points(here: Candidates, runs: list[Run], before: Candidates | None) -> Points:
    """Make points of the stretches that strokes were planned for."""
    if not runs:
        return Points.none()
    rows = np.concatenate([run.rows for run in runs])
    sheet = np.repeat([run.sheet for run in runs], [len(run.rows) for run in runs])
    known = np.concatenate([run.known for run in runs])
    places, count = here.places.take(rows), len(rows)
    new = np.zeros(count, bool)
    if before is not None:  # what turns out to be there where one saw nothing before
        fresh = np.flatnonzero(~known)
        new[fresh] = are_seen(before.shot, before.bvh, places.take(fresh))
    part = np.zeros(count, np.int64) if here.part_face is None else here.part_face[rows]
    no = np.zeros(count, bool)
    along = np.concatenate([run.along for run in runs])
    xy, kind, yes = here.planned.xy[rows], here.kind[rows], ~no
    return Points(
        sheet, along, places, xy, kind, np.full(count, PLANNED), yes, no, new,
        np.zeros(count, np.int64), part, rows + owner(here.planned.offsets)[rows],
    )  # fmt: skip


def left_over(here: Candidates, old: Points, found: Points, moves: bool) -> Points:
    """Keep what no stroke was planned for of sheets that were there, carried to this shot.

    Where it is seen, a line that a stroke is not made of may be there: then it lies on that. A line
    fixed on the surface is kept wherever it lies; others are forgotten when nothing was seen of
    them for STALE frames.

    Parameters
    ----------
    old : all points of the frame before, carried here
    found : the points of strokes
    moves : whether the surface is another than in the frame before, so that its lines may be others
    """
    old = old.take(~_replaced(old, found))
    if not len(old):
        return old
    seen = are_seen(here.shot, here.bvh, old.places)
    near, row = _beside(found, old, COVERED)
    traced, place = _traced(here, old)
    fixed = FIXED[old.kind]
    seen |= traced & ~fixed  # a line that slides may be seen where the surface has turned away
    own = near & seen & (found.sheet[row] == old.sheet if len(found) else near)
    support = np.where(traced & seen, TRACED, BARE)
    age = np.where(traced & seen, 0, old.age + 1)
    kept = ~own & ((fixed & ~(moves & seen)) | (age <= STALE))
    slid = traced & seen & (~fixed | moves)
    places = old.places
    face, bary, offset = places.face.copy(), places.bary.copy(), places.offset.copy()
    face[slid], bary[slid], offset[slid] = place.face[slid], place.bary[slid], place.offset[slid]
    places = Places(face, bary, offset)
    xy = places.seen(here.shot)[0] / here.scale
    no = np.zeros(len(old), bool)
    nowhere = np.full(len(old), -1)
    left = replace(
        old, places=places, xy=xy, support=support, seen=seen, covered=near & seen, new=no, age=age,
        row=nowhere,
    )  # fmt: skip
    return left.take(kept)


def without_strays(points: Points) -> Points:
    """Leave out what is left of sliding lines beside what was found of them, but off its ends.

    Where the line itself was found to go another way, what the surface carried along is no more
    than an echo.
    """
    if not len(points):
        return points
    loose = (points.support != PLANNED) & ~FIXED[points.kind]
    start = runs(loose, points.sheet)
    first, last = start[:-1], start[1:] - 1
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, len(points) - 1)
    joins = np.zeros(len(first), bool)
    found = np.zeros(int(points.sheet.max()) + 1, bool)
    found[points.sheet[points.support == PLANNED]] = True
    for one, two in ((before, first), (after, last)):
        beside = (one != two) & (points.sheet[one] == points.sheet[two])
        joins |= beside & (np.hypot(*(points.xy[one] - points.xy[two]).T) <= GAP)
    keep = joins | ~loose[first] | ~found[points.sheet[first]]
    points = points.take(np.repeat(keep, np.diff(start)))
    return points.take(~_turned_back(points))


def _turned_back(points: Points) -> np.ndarray:
    """Tell which points no stroke was planned for lie beside or behind those before them."""
    follows = points.follows
    step = np.zeros((len(points) + 1, 2))
    step[1:-1] = np.diff(points.xy, axis=0) * follows[1:, None]
    size = np.maximum(np.hypot(*step.T), 1e-9)
    cosine = row_dot(step[:-1], step[1:]) / (size[:-1] * size[1:])
    sharp = follows & np.r_[follows[1:], False] & (cosine < 0.0)
    beside = sharp.copy()  # which of a pair is off the line is told by neither
    beside[1:] |= sharp[:-1]
    beside[:-1] |= sharp[1:]
    return beside & (points.support != PLANNED)


def _replaced(old: Points, found: Points) -> np.ndarray:
    """Tell which old points lie on stretches of their sheets that have been found, (P,) bool."""
    out = np.zeros(len(old), bool)
    if not len(found):
        return out
    found = found.take(np.lexsort((found.along, found.sheet)))
    starts = np.flatnonzero(~found.follows)
    ends = np.r_[starts[1:], len(found)] - 1
    reach = BESIDE
    order = np.argsort(old.sheet, kind="stable")
    first = np.searchsorted(old.sheet[order], found.sheet[starts], "left")
    last = np.searchsorted(old.sheet[order], found.sheet[starts], "right")
    for a, b, i, j in zip(starts, ends, first, last, strict=True):
        rows = order[i:j]
        along = old.along[rows]
        out[rows] |= (along >= found.along[a] - reach) & (along <= found.along[b] + reach)
    return out


def _beside(found: Points, points: Points, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Tell which points run beside a stroke that is drawn, (P,) bool, and beside which point."""
    if not len(found) or not len(points):
        return np.zeros(len(points), bool), np.zeros(len(points), np.int64)
    away, row = cKDTree(found.xy).query(points.xy, distance_upper_bound=reach)
    near = away < np.inf
    row = np.where(near, row, 0)
    cosine = np.abs(row_dot(found.tangents[row], points.tangents))
    return near & (cosine > PARALLEL), row


def _traced(here: Candidates, points: Points) -> tuple[np.ndarray, Places]:
    """Find lines under points that no stroke is made of: (P,) bool, and the places on them."""
    traces = here.traces
    if not len(traces.xy) or not len(points):
        return np.zeros(len(points), bool), points.places
    tree, reach = cKDTree(traces.xy), TRACED_REACH * here.scale
    away, row = tree.query(points.xy * here.scale, distance_upper_bound=reach)
    near = away < np.inf
    row = np.where(near, row, 0)
    near &= np.abs(row_dot(traces.along[row], points.tangents)) > PARALLEL
    place = Places.of(here.shot, traces.face[row], traces.point[row], traces.xy[row])
    depth, was = (p.seen(here.shot)[1] for p in (place, points.places))
    near &= alike_in_depth(here, depth, was, FIXED[points.kind])
    return near, place


def alike_in_depth(
    here: Candidates, depth: np.ndarray, carried: np.ndarray, fixed: np.ndarray
) -> np.ndarray:
    """Tell whether lines lie about as deep as where they were carried, (n,) bool.

    Those fixed on the surface may be DEPTHS[0] px apart, others, which slide, DEPTHS[1].
    """
    camera = here.shot.camera
    per_px = camera.focal / here.scale
    if camera.extent is None:
        per_px = per_px / np.maximum(carried, 1e-6)
    return np.abs(depth - carried) * per_px <= np.where(fixed, *DEPTHS)


def are_seen(shot: Shot, bvh: Bvh, places: Places) -> np.ndarray:
    """Tell which places a shot shows, (N,) bool: on the canvas, before the eye, and not hidden."""
    camera, surface = shot.camera, shot.surface
    out = np.zeros(len(places), bool)
    if not len(places):
        return out
    point = places.points(shot)
    xy, depth = camera.project(point)
    inside = camera.shows(depth) & (xy >= 0.0).all(axis=1)
    inside &= (xy <= [camera.width, camera.height]).all(axis=1)
    facing = row_dot(places.normals(shot), towards(camera.viewpoint, point))
    closed = closed_from(surface, camera.viewpoint)[places.face]
    size = np.linalg.norm(towards(camera.viewpoint, point), axis=1)
    inside &= ~closed | (facing > -AWAY * size)
    ask = np.flatnonzero(inside)
    side = np.where(closed | (facing >= 0.0), 1.0, -1.0)[ask]
    sharp = np.zeros(len(ask), bool)
    out[ask] = bvh.seen(camera.viewpoint, places.face[ask], point[ask], sharp, side)
    return out
