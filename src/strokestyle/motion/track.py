"""Strokes that persist: from shots to frames whose strokes have names, and places along them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from ..extract.line_options import LineOptions
from ..extract.pipeline import parts_of_faces
from ..geometry.curves import DEFAULT_SPACING, arc_length, owner
from ..render.style import Style
from .candidates import Candidates, candidates
from .frames import Frame, Shot
from .reading import read_surface, surface_scale
from .run_on import run_on

REACH = 10.0  # px of the style's canvas within which a stroke is looked for in the next frame


def track_frames(
    shots: Iterable[Shot],
    style: Style,
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    optional: bool = False,
    loop: bool = False,
) -> list[Frame]:
    """Plan the strokes of an animation, which persist and move from frame to frame.

    Parameters
    ----------
    shots : what each frame shows; all cameras of one size, all surfaces of the same faces
    style : whose strokes they are
    options : which lines; those of `extract_view`
    spacing : px of the canvas between the points of curves
    optional : find also the lines that an artist may draw besides, as `extract_view` takes it
    loop : the last frame goes over into the first, as on a turntable
    """
    found = list(candidates(shots, style, options, spacing, optional))
    frames: list[Frame] = []
    track, place = np.zeros(0, np.int64), np.zeros(0)
    fresh = 0
    for i, here in enumerate(found):
        count = len(here.planned)
        before = (found[i - 1], track, place) if i else None
        track, place = _named(here, before, fresh)
        fresh = max(fresh, int(track.max(initial=-1)) + 1) if count else fresh
        frames.append(_frame(here, style, track, place))
    return frames


def _named(
    here: Candidates, before: tuple[Candidates, np.ndarray, np.ndarray] | None, fresh: int
) -> tuple[np.ndarray, np.ndarray]:
    """Give strokes the names of those that they continue, and places along them."""
    offsets = here.planned.offsets
    place, stroke = arc_length(here.planned.xy, offsets), owner(offsets)
    count = len(here.planned)
    track = np.full(count, -1)
    if before is not None and count and len(before[0].planned):
        old, names, old_place = before
        xy = old.places.seen(here.shot)[0] / here.scale
        away, row = cKDTree(xy).query(here.planned.xy, distance_upper_bound=REACH)
        near = np.flatnonzero(away < np.inf)
        of_old = owner(old.planned.offsets)[row[near]]
        pair, votes = np.unique(stroke[near] * len(names) + of_old, return_counts=True)
        for k in np.argsort(-votes, kind="stable"):
            new, was = divmod(int(pair[k]), len(names))
            if track[new] < 0 and names[was] not in track:
                track[new] = names[was]
                rows = near[(stroke[near] == new) & (of_old == was)]
                shift = np.median(old_place[row[np.isin(np.arange(len(row)), rows)]] - place[rows])
                place[stroke == new] += shift
    free = track < 0
    track[free] = fresh + np.arange(free.sum())
    return track, place


def _frame(here: Candidates, style: Style, track: np.ndarray, place: np.ndarray) -> Frame:
    """Let strokes run on past their ends, and read off what the style asks of their points."""
    spacing = style.config.spacing
    planned, rows, past = run_on(here.planned, style.config.max_overshoot, spacing)
    scale = surface_scale(here.shot, here.lines.bvh)
    surface = read_surface(here.shot, here.lines.bvh, here.planned, here.places, scale, spacing)
    parts = None
    if here.part_face is not None:
        depth = here.places.seen(here.shot)[1]
        parts = parts_of_faces(here.shot.surface, here.part_face, depth).take(rows)
    return Frame(
        here.shot.camera,
        planned,
        surface[rows],
        track,
        place[rows] + past,
        np.ones(len(rows)),
        parts,
    )
