"""Make frames of strokes: evenly spaced points, as far as they are drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..extract.pipeline import parts_of_faces
from ..geometry.curves import arc
from ..render.plan import Planned
from ..render.style import Style
from .candidates import Candidates
from .frames import Frame
from .growth import Grown
from .places import Places
from .reading import read_surface, surface_scale
from .run_on import run_on
from .sheets import PLANNED, Points
from .strokes import Stroke

SMOOTH = 2.0  # points, where a line is not that of a planned stroke
SEAM = 4  # points from there


def smoothed(points: Points, rows: np.ndarray) -> np.ndarray:
    """Lay a stroke through its points, (n, 2): smoothed where no stroke was planned for them."""
    xy = points.xy[rows]
    planned = points.support[rows] == PLANNED
    if planned.all() or len(rows) < 3:
        return xy
    loose = ndimage.binary_dilation(~planned, iterations=SEAM).astype(float)
    weight = ndimage.gaussian_filter1d(loose, SMOOTH, mode="nearest")[:, None]
    reach = min(6, len(xy) - 1)
    before, after = xy[reach:0:-1], xy[-2 : -2 - reach : -1]
    padded = np.concatenate([2 * xy[:1] - before, xy, 2 * xy[-1:] - after])
    soft = ndimage.gaussian_filter1d(padded, SMOOTH, axis=0, mode="nearest")[reach:-reach]
    return np.asarray(xy + weight * (soft - xy))


@dataclass(frozen=True)
class Composed:
    """One stroke of a frame: where it is drawn, and what is known of its n points.

    Parameters
    ----------
    track, kind : int
    xy : (n, 2) px of the style's canvas, evenly spaced
    places : of its points on the surface
    part_face : (n,) int, the face whose part a point belongs to
    place, presence : (n,)
    """

    track: int
    kind: int
    xy: np.ndarray
    places: Places
    part_face: np.ndarray
    place: np.ndarray
    presence: np.ndarray

    @classmethod
    def of(
        cls,
        points: Points,
        scale: float,
        stroke: Stroke,
        grown: Grown,
        xy: np.ndarray,
        place: np.ndarray,
        kind: int,
        spacing: float,
    ) -> Composed:
        """Space the points of a stroke evenly; xy (n, 2) and place (n,) are those of its points.

        `points` are the frame's, and `scale` how many px of the canvas one of the style's is.
        """
        kept = grown.rows
        xy, place = xy[kept], place[kept]
        s = arc(xy)
        at = np.linspace(0.0, s[-1], max(round(s[-1] / spacing), 1) + 1)
        nearest = np.rint(np.interp(at, s, np.arange(len(s)))).astype(np.int64)
        even = np.stack([np.interp(at, s, xy[:, k]) for k in (0, 1)], axis=1)
        values = (np.interp(at, s, value) for value in (place, grown.presence))
        rows = stroke.rows[kept][nearest]
        places = points.places.take(rows)
        places = replace(places, offset=places.offset + (even - points.xy[rows]) * scale)
        return cls(stroke.track, kind, even, places, points.part_face[rows], *values)


def make_frame(here: Candidates, style: Style, strokes: list[Composed]) -> Frame:
    """Make a frame of its strokes, which run on past their ends as far as the style may draw."""

    def each(name: str, nothing: np.ndarray) -> np.ndarray:
        return np.concatenate([nothing, *(getattr(stroke, name) for stroke in strokes)])

    xy = each("xy", np.zeros((0, 2)))
    offsets = np.cumsum([0, *(len(stroke.xy) for stroke in strokes)])
    kind = np.array([stroke.kind for stroke in strokes], np.int8)
    none = np.zeros(len(xy))
    planned = Planned(xy, offsets, kind, np.zeros((len(xy), 2), np.int64), none, none)
    places = Places.concatenate([Points.none().places, *(stroke.places for stroke in strokes)])
    bvh, spacing = here.bvh, style.config.spacing
    scale = surface_scale(here.shot, bvh)
    surface = read_surface(here.shot, bvh, planned, places, scale, spacing)
    longer, row, past = run_on(planned, style.config.max_overshoot, spacing)
    parts = None
    if here.part_face is not None:
        depth = places.seen(here.shot)[1]
        faces = each("part_face", np.zeros(0, np.int64))
        parts = parts_of_faces(here.shot.surface, faces, depth).take(row)
    return Frame(
        here.shot.camera,
        longer,
        surface[row],
        np.array([stroke.track for stroke in strokes], np.int64),
        each("place", none[:0])[row] + past,
        each("presence", none[:0])[row],
        parts,
    )
