"""Remove hidden lines: ask the rays along each line, and keep the stretches that are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import Curves, counting, is_kind, owner, take_ragged
from ..geometry.kinds import SHARP_KINDS
from ..mesh.surface import Surface
from .camera import Camera
from .rays import Bvh
from .surface_curves import SurfaceCurves

SAMPLE = 1.0  # px between the points at which a line is asked whether it is seen
FLICKER = 2.5  # px


def visible_fragments(
    surface: Surface, camera: Camera, lines: SurfaceCurves, scene: Bvh
) -> tuple[Curves, np.ndarray]:
    """The parts of lines on a surface that the camera sees, and the strength of each of their points (N,).

    Lines are sampled every SAMPLE px. What is seen or hidden over less than FLICKER px takes after its surroundings.
    """
    sight = look_along(surface, camera, lines, scene)
    return sight.fragments(lines, sight.seen)[:2]


@dataclass(frozen=True)
class SampledLines:
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

    def fragments(
        self, lines: SurfaceCurves, wanted: np.ndarray
    ) -> tuple[Curves, np.ndarray, np.ndarray]:
        """The stretches of `wanted` (M,) points as curves, and the strength and the face of their points."""
        if not len(self.line):
            return Curves.empty(), np.zeros(0), np.zeros(0, np.int64)
        new = np.flatnonzero(
            np.r_[True, (wanted[1:] != wanted[:-1]) | (self.line[1:] != self.line[:-1])]
        )
        end = np.r_[new[1:], len(wanted)]
        good = wanted[new] & (end - new >= 2)
        rows, offsets = take_ragged(np.r_[new, len(wanted)], np.flatnonzero(good))
        kept = self.line[new[good]]
        whole = (end - new)[good] == np.bincount(self.line, minlength=len(lines))[kept]
        curves = Curves(self.xy[rows], offsets, lines.kind[kept], lines.closed[kept] & whole)
        return curves, self.strength[rows], self.face[rows]


def look_along(
    surface: Surface, camera: Camera, lines: SurfaceCurves, bvh: Bvh | None
) -> SampledLines:
    """Sample lines every SAMPLE px and ask at each point whether the camera sees it.

    What is seen or hidden over less than FLICKER px takes after its surroundings. Without a `bvh`
    nothing is asked, and nothing is seen.
    """
    if not len(lines):
        none, no = np.zeros(0, np.int64), np.zeros(0, bool)
        return SampledLines(np.zeros((0, 2)), np.zeros(0), none, none, no, no)
    points = lines.points(surface)
    start, t = _nodes(points, lines.offsets, camera)
    line = owner(lines.offsets)[start]
    after = np.minimum(start + 1, lines.offsets[1:][line] - 1)
    node = points[start] + t[:, None] * (points[after] - points[start])
    strength = lines.strength[start] + t * (lines.strength[after] - lines.strength[start])
    xy, depth = camera.project(node)
    low, high = -1e-6, np.array([camera.width, camera.height]) + 1e-6
    inside = (depth > 0.0) & ((xy >= low) & (xy <= high)).all(axis=1)
    xy, face = np.clip(xy, 0.0, [camera.width, camera.height]), lines.face[start]
    seen = np.zeros(len(line), bool)
    if bvh is not None:
        ask, sharp = np.flatnonzero(inside), is_kind(lines.kind, SHARP_KINDS)[line]
        seen[ask] = bvh.seen(camera.eye, face[ask], node[ask], sharp[ask])
        step = np.r_[0.0, np.hypot(*np.diff(xy, axis=0).T)]
        for state in (False, True):  # first mend short gaps, then drop short sightings
            seen = _without_short_runs(seen, line, step, state)
    return SampledLines(xy, strength, face, line, inside, seen)


def _nodes(
    points: np.ndarray, offsets: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
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


def _without_short_runs(
    seen: np.ndarray, line: np.ndarray, step: np.ndarray, state: bool
) -> np.ndarray:
    """`seen` (N,) with runs of `state` that are shorter than FLICKER px turned over, but for those at a line's ends."""
    new = np.flatnonzero(np.r_[True, (seen[1:] != seen[:-1]) | (line[1:] != line[:-1])])
    end = np.r_[new[1:], len(seen)]
    along = np.cumsum(step)
    extent = along[end - 1] - along[new]
    inner = (line[np.maximum(new - 1, 0)] == line[new]) & (
        line[np.minimum(end, len(line) - 1)] == line[new]
    )
    inner &= (new > 0) & (end < len(seen))
    turn = (seen[new] == state) & (extent < FLICKER) & inner
    return seen ^ np.repeat(turn, end - new)
