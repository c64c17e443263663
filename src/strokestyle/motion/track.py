"""Strokes that persist: from shots to frames whose strokes have names, and places along them.

1. The strokes that a style would draw of each shot by itself (`candidates`) are cut into stretches
   of lines that were there before, or begin (`labels`, `sheets`, `follow`).
2. Of each stretch of each line it is decided when it is drawn, over all frames (`persist`).
3. What is drawn is cut into strokes, whose names last (`strokes`), which grow in and taper off
   (`growth`), whose points have places along them (`anchor`), and which are laid evenly
   (`compose`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..extract.line_options import LineOptions
from ..geometry.curves import DEFAULT_SPACING
from ..geometry.kinds import KINDS
from ..render.style import Style
from .anchor import anchor
from .candidates import candidates
from .compose import Composed, make_frame, smoothed
from .follow import Follower
from .frames import Frame, Shot
from .growth import Grown, grow
from .persist import decide
from .sheets import Points
from .strokes import Stroke, name_strokes

SAME = 3.0  # px between points that are the same


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
    follower = Follower()
    if loop:  # so that the first frame knows what was there in the last
        for here in found:
            follower.step(here)
    frames = [follower.step(here) for here in found]
    seam = _as_on_sheets_of(follower.step(found[0]), frames[0]) if loop and found else None
    fates = decide(frames, loop)
    strokes = name_strokes(frames, fates, seam)
    kinds = _kinds(frames, strokes)
    lines = [
        [smoothed(points, stroke.rows) for stroke in some]
        for points, some in zip(frames, strokes, strict=True)
    ]
    places = anchor(strokes, lines, seam)
    out = []
    for t, some in enumerate(grow(strokes, fates, loop)):
        number = {stroke.track: k for k, stroke in enumerate(strokes[t])}
        laid = [_laid(one, strokes[t], lines[t], places[t], number, kinds, style) for one in some]
        out.append(make_frame(found[t], style, frames[t], laid))
    return out


def _laid(
    one: Grown,
    strokes: list[Stroke],
    lines: list[np.ndarray],
    places: list[np.ndarray],
    number: dict[int, int],
    kinds: dict[int, int],
    style: Style,
) -> Composed:
    """Lay a stroke as far as it has grown, of the whole strokes of its frame."""
    k = number[one.stroke.track]
    kept = np.isin(strokes[k].rows, one.stroke.rows)
    kind = kinds[one.stroke.track]
    return Composed.of(one, lines[k][kept], places[k][kept], kind, style.config.spacing)


def _kinds(frames: list[Points], strokes: list[list[Stroke]]) -> dict[int, int]:
    """Choose the kind of each track: that of most of its points in all frames."""
    count: dict[int, np.ndarray] = {}
    for points, some in zip(frames, strokes, strict=True):
        for stroke in some:
            votes = np.bincount(points.kind[stroke.rows], minlength=len(KINDS))
            count[stroke.track] = count.get(stroke.track, 0) + votes
    return {track: int(votes.argmax()) for track, votes in count.items()}


def _as_on_sheets_of(other: Points, points: Points) -> Points:
    """Name points as on the sheets of the same frame's `other` points; -1 where there is none."""
    if not len(other) or not len(points):
        return replace(points, sheet=np.full(len(points), -1))
    away, row = cKDTree(other.xy).query(points.xy, distance_upper_bound=SAME)
    near = away < np.inf
    row = np.where(near, row, 0)
    sheet, along = np.where(near, other.sheet[row], -1), other.along[row]
    return replace(points, sheet=sheet, along=along)
