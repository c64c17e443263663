"""Let strokes grow in and taper off, as a hand draws them, instead of popping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .persist import Fate
from .strokes import Stroke

BIRTH = 20.0  # px of a stroke when it is first seen
LEAST, FASTER = 10.0, 0.4  # px that its end moves in a frame, at least, and share of its length
START = 8.0  # px that its beginning moves in a frame
SLACK = 2.0  # px
LEAST_LIFE = 2  # frames
TAPER = 26.0  # px before a moving end over which its thickness falls
THIN = 0.3  # to this, of its thickness


@dataclass(frozen=True)
class Grown:
    """A stroke as far as it is drawn.

    Parameters
    ----------
    stroke : int, which of its frame's strokes
    rows : (n,) int, those of its points that are drawn
    presence : (n,) of these
    """

    stroke: int
    rows: np.ndarray
    presence: np.ndarray


class _Moment(NamedTuple):
    """One frame in a track's life: the frame, which of its strokes, and the places of its points.

    Flags (n,) tell where it must not be there at once, and where it must not go at once.
    """

    frame: int
    stroke: int
    place: np.ndarray
    appears: np.ndarray
    vanishes: np.ndarray


def grow(
    frames: list[list[Stroke]],
    places: list[list[np.ndarray]],
    fates: list[Fate],
    cuts: set[int] | None = None,
) -> list[list[Grown]]:
    """Limit how far ends of strokes move a frame where no occlusion moves them.

    A stroke that appears where one saw the bare surface before is drawn from its start, over some
    frames; one that vanishes leaves from its end. An end that jumps does alike. Where an
    end moves because something is revealed or hidden, it moves at once. What lives for less than
    LEAST_LIFE frames is not drawn, unless it is because another scene begins, as at `cuts`.
    """
    ends = {0, len(frames), *(cuts or ())}
    out: list[list[Grown]] = [[] for _ in frames]
    for life in _lives(frames, places, fates):
        t = life[0].frame
        if len(life) < LEAST_LIFE and not {t, t + len(life)} & ends and _flashes(life):
            continue
        for moment, low, high in zip(life, *_limits(life), strict=True):
            grown = _limited(moment, low, high)
            if grown is not None:
                out[moment.frame].append(grown)
    return out


def _flashes(life: list[_Moment]) -> bool:
    """Tell whether most of a short life comes from nothing or goes to nothing.

    What was drawn before by other strokes, and will be again, is there all the time.
    """
    return max(life[0].appears.mean(), life[-1].vanishes.mean()) > 0.5


def _lives(
    frames: list[list[Stroke]], places: list[list[np.ndarray]], fates: list[Fate]
) -> Iterator[list[_Moment]]:
    """List the successive frames in which each track is drawn without a break."""
    of_track: dict[int, list[_Moment]] = {}
    for t, (strokes, placed, fate) in enumerate(zip(frames, places, fates, strict=True)):
        for k, stroke in enumerate(strokes):
            life = of_track.setdefault(stroke.track, [])
            if life and life[-1].frame != t - 1:
                yield life
                life = of_track[stroke.track] = []
            rows = stroke.rows
            life.append(_Moment(t, k, placed[k], fate.appears[rows], fate.vanishes[rows]))
    yield from of_track.values()


def _limits(life: list[_Moment]) -> tuple[np.ndarray, np.ndarray]:
    """Find from which place to which the strokes of a life are drawn, (T,) each."""
    low, high = np.full(len(life), -np.inf), np.full(len(life), np.inf)
    for order, flag in ((1, "appears"), (-1, "vanishes")):
        ends: _Ends | None = None
        for k in range(len(life))[::order]:
            ends = _step(life[k].place, getattr(life[k], flag), ends)
            low[k], high[k] = max(low[k], ends.low), min(high[k], ends.high)
    return low, high


class _Ends(NamedTuple):
    """From which place to which a stroke is drawn, and would be if it did not grow."""

    low: float
    high: float
    first: float
    last: float


def _step(place: np.ndarray, flags: np.ndarray, before: _Ends | None) -> _Ends:
    """Limit a stroke by how far it was drawn in the frame before; None where it was not.

    `flags` (n,) tells the points at which it must not be there at once. What the stroke has behind
    those, or behind where it has not yet grown to, was drawn before, by another, and stays.
    """
    first, last = float(place[0]), float(place[-1])
    if before is None:
        high = last if flags.mean() <= 0.5 else first + BIRTH
        return _Ends(first, min(high, last), first, last)
    pace = max(LEAST, FASTER * (before.high - before.low))
    pending = (place > before.high + SLACK) & (place <= before.last + SLACK)
    behind = _trailing((flags & (place > before.high)) | pending)
    high = last if not behind else max(float(place[-1 - behind]), before.high + pace)
    pending = (place < before.low - SLACK) & (place >= before.first - SLACK)
    ahead = _trailing(((flags & (place < before.low)) | pending)[::-1])
    low = first if not ahead else min(float(place[ahead]), before.low - START)
    return _Ends(max(low, first), min(high, last), first, last)


def _trailing(flags: np.ndarray) -> int:
    """Count the flags up that stand at the end of (n,) flags, less than n."""
    down = np.flatnonzero(~flags)
    return len(flags) - 1 - int(down[-1]) if len(down) else len(flags) - 1


def _limited(moment: _Moment, low: float, high: float) -> Grown | None:
    """Cut a stroke down to its limits, thinner towards those; None where nothing is left."""
    place = moment.place
    rows = np.flatnonzero((place >= low) & (place <= high))
    if len(rows) < 2:
        return None
    presence = np.ones(len(rows))
    for limited, away in (
        (rows[0] > 0, place[rows] - place[rows[0]]),
        (rows[-1] < len(place) - 1, place[rows[-1]] - place[rows]),
    ):
        if limited:
            presence = np.minimum(presence, THIN + (1.0 - THIN) * np.clip(away / TAPER, 0.0, 1.0))
    return Grown(moment.stroke, rows, presence)
