"""Let strokes grow in and taper off, as a hand draws them, instead of popping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .persist import Fate
from .strokes import Stroke

FRAMES = 3.5  # in which a stroke grows to its length
LEAST = 18.0  # px that it grows in a frame, at least
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
    frames: list[list[Stroke]], places: list[list[np.ndarray]], fates: list[Fate]
) -> list[list[Grown]]:
    """Limit how far ends of strokes move a frame where no occlusion moves them.

    A stroke that appears where one saw the bare surface before is drawn from its start, over about
    FRAMES frames; one that vanishes leaves from its end. An end that jumps does alike. Where an
    end moves because something is revealed or hidden, it moves at once. What lives for less than
    LEAST_LIFE frames is not drawn.
    """
    out: list[list[Grown]] = [[] for _ in frames]
    for life in _lives(frames, places, fates):
        if len(life) < min(LEAST_LIFE, len(frames)):
            continue
        for moment, low, high in zip(life, *_limits(life), strict=True):
            grown = _limited(moment, low, high)
            if grown is not None:
                out[moment.frame].append(grown)
    return out


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
        ends: tuple[float, float] | None = None
        for k in range(len(life))[::order]:
            ends = _step(life[k].place, getattr(life[k], flag), ends)
            low[k], high[k] = max(low[k], ends[0]), min(high[k], ends[1])
    return low, high


def _step(
    place: np.ndarray, flags: np.ndarray, ends: tuple[float, float] | None
) -> tuple[float, float]:
    """Limit a stroke by the places between which it was drawn in the frame before.

    `flags` (n,) tells the points at which it must not be there at once; `ends` is None where the
    stroke was not there before.
    """
    first, last = float(place[0]), float(place[-1])
    pace = max(LEAST, (last - first) / FRAMES)
    if ends is None:
        return first, last if flags.mean() <= 0.5 else first + pace
    low, high = first, last
    over, under = flags & (place > ends[1] + SLACK), flags & (place < ends[0] - SLACK)
    if over.any():
        high = min(high, max(place[max(int(over.argmax()) - 1, 0)], ends[1] + pace))
    if under.any():
        behind = len(under) - int(under[::-1].argmax())
        low = max(low, min(place[min(behind, len(place) - 1)], ends[0] - pace))
    return float(low), float(high)


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
