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

import numpy as np

from ..extract.line_options import LineOptions
from ..geometry.curves import DEFAULT_SPACING, arc
from ..geometry.kinds import KINDS
from ..render.style import Style
from .anchor import anchor
from .candidates import candidates
from .close import close
from .compose import Composed, make_frame, smoothed
from .follow import Follower
from .frames import Frame, Shot
from .growth import grow
from .persist import decide
from .sheets import SOFT, Points
from .strokes import Stroke, name_strokes

SHORT, SHORT_LIFE = 36.0, 4  # px, and frames, of a soft line that is worth a stroke
AHEAD = 10  # frames of a loop before its first and behind its last that are looked at


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
    if not found:
        return []
    count = len(found)
    # of a loop, what comes before the first frame, and behind the last
    ahead = min(AHEAD, count) if loop and count > 1 else 0
    follower = Follower()
    frames = [follower.step(found[i % count]) for i in range(-ahead, count + ahead)]
    composed = _composed(frames, follower.cuts, style, found[0].scale)
    if ahead:
        composed = close(composed, ahead, count)
    return [make_frame(here, style, strokes) for here, strokes in zip(found, composed, strict=True)]


def _composed(
    frames: list[Points], cuts: set[int], style: Style, scale: float
) -> list[list[Composed]]:
    """Compose the strokes of frames one after the other; `scale` as `Candidates` has it."""
    fates = decide(frames, cuts)
    strokes = name_strokes(frames, fates)
    kinds = _kinds(frames, strokes)
    strokes = _without_scraps(frames, strokes, kinds)
    lines = [
        [smoothed(points, stroke.rows) for stroke in some]
        for points, some in zip(frames, strokes, strict=True)
    ]
    places = anchor(strokes, lines)
    out = []
    for t, some in enumerate(grow(strokes, places, fates, cuts)):
        composed = []
        for one in some:
            stroke, place = strokes[t][one.stroke], places[t][one.stroke]
            composed.append(
                Composed.of(
                    frames[t], scale, stroke, one, lines[t][one.stroke], place,
                    kinds[stroke.track], style.config.spacing,
                )
            )  # fmt: skip
        out.append(composed)
    return out


def _without_scraps(
    frames: list[Points], strokes: list[list[Stroke]], kinds: dict[int, int]
) -> list[list[Stroke]]:
    """Leave out tracks of soft lines that are never long, or not for long: noise of many frames.

    Of a short animation they are those that a still of it would have, and stay.
    """
    if len(frames) < SHORT_LIFE:
        return strokes
    longest: dict[int, float] = {}
    life: dict[int, int] = {}
    for points, some in zip(frames, strokes, strict=True):
        for stroke in some:
            length = float(arc(points.xy[stroke.rows])[-1])
            longest[stroke.track] = max(longest.get(stroke.track, 0.0), length)
            life[stroke.track] = life.get(stroke.track, 0) + 1
    scraps = {
        track
        for track, length in longest.items()
        if SOFT[kinds[track]] and (length < SHORT or life[track] < SHORT_LIFE)
    }
    return [[stroke for stroke in some if stroke.track not in scraps] for some in strokes]


def _kinds(frames: list[Points], strokes: list[list[Stroke]]) -> dict[int, int]:
    """Choose the kind of each track: that of most of its points in all frames."""
    count: dict[int, np.ndarray] = {}
    for points, some in zip(frames, strokes, strict=True):
        for stroke in some:
            votes = np.bincount(points.kind[stroke.rows], minlength=len(KINDS))
            count[stroke.track] = count.get(stroke.track, 0) + votes
    return {track: int(votes.argmax()) for track, votes in count.items()}
