"""Let strokes grow in and taper off, as a hand draws them, instead of popping."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .persist import Fate
from .strokes import Stroke

FRAMES = 3.5  # in which a stroke grows to its length
LEAST = 18.0  # px that it grows in a frame, at least
POINT = 3.0  # px between points
TAPER = 26.0  # px before a moving end over which its thickness falls
THIN = 0.3  # to this, of its thickness


@dataclass(frozen=True)
class Grown:
    """A stroke as far as it is drawn.

    Parameters
    ----------
    stroke : Stroke
    presence : (n,) of its points
    """

    stroke: Stroke
    presence: np.ndarray


def grow(frames: list[list[Stroke]], fates: list[Fate], loop: bool) -> list[list[Grown]]:
    """Limit how far ends of strokes move a frame where no occlusion moves them.

    A stroke that appears where one saw the bare surface before is drawn from its start, over about
    FRAMES frames; one that vanishes leaves from its end. An end that jumps does alike. Where an
    end moves because something is revealed or hidden, it moves at once.
    """
    out: list[list[Grown]] = [[] for _ in frames]
    for life in lives(frames, loop):
        for (t, stroke), low, high in zip(life, *_limits(life, fates), strict=True):
            grown = _limited(stroke, low, high)
            if grown is not None:
                out[t].append(grown)
    return out


def lives(frames: list[list[Stroke]], loop: bool) -> Iterable[list[tuple[int, Stroke]]]:
    """List the successive frames in which each track is drawn without a break, with its strokes."""
    count = len(frames)
    of_track: dict[int, dict[int, Stroke]] = {}
    for t, strokes in enumerate(frames):
        for stroke in strokes:
            of_track.setdefault(stroke.track, {})[t] = stroke
    for shown in of_track.values():
        times = sorted(shown)
        first = [t for t in times if t - 1 not in shown]
        if loop and count - 1 in shown and 0 in shown and len(times) < count:
            first.remove(0)
        if not first or len(times) == count:
            first = [times[0]]
        for t in first:
            life: list[tuple[int, Stroke]] = []
            while t % count in shown and len(life) < count and (loop or t < count):
                life.append((t % count, shown[t % count]))
                t += 1
            yield life


def _limits(life: list[tuple[int, Stroke]], fates: list[Fate]) -> tuple[np.ndarray, np.ndarray]:
    """Find from where to where the strokes of a life are drawn, of their coordinates, (T,) each."""
    low, high = np.full(len(life), -np.inf), np.full(len(life), np.inf)
    for order, flag in ((1, "appears"), (-1, "vanishes")):
        a = b = None
        for k in range(len(life))[::order]:
            t, stroke = life[k]
            flags = getattr(fates[t], flag)[stroke.rows]
            a, b = _step(stroke, flags, a, b)
            low[k], high[k] = max(low[k], a), min(high[k], b)
    return low, high


def _step(
    stroke: Stroke, flags: np.ndarray, a: float | None, b: float | None
) -> tuple[float, float]:
    """Limit a stroke by where it was drawn in the frame before, from a to b; None where not.

    `flags` (n,) tells the points at which it must not be there at once.
    """
    along = stroke.along
    rise = (stroke.high - stroke.low) / max(len(along) - 1, 1)  # a point, of one spacing
    pace = max(LEAST / POINT * rise, (stroke.high - stroke.low) / FRAMES)
    if a is None or b is None:
        whole = flags.mean() <= 0.5
        return stroke.low, stroke.high if whole else stroke.low + pace
    low, high = stroke.low, stroke.high
    over, under = flags & (along > b), flags & (along < a)
    if over.any():
        high = min(high, max(along[max(int(over.argmax()) - 1, 0)], b + pace))
    if under.any():
        last = len(under) - 1 - int(under[::-1].argmax())
        low = max(low, min(along[min(last + 1, len(along) - 1)], a - pace))
    return float(low), float(high)


def _limited(stroke: Stroke, low: float, high: float) -> Grown | None:
    """Cut a stroke down to its limits, thinner towards those; None where nothing is left."""
    left = stroke.within(low, high)
    if len(left.rows) < 2:
        return None
    presence = np.ones(len(left.rows))
    for limited, away in (
        (left.low > stroke.low, left.along - left.low),
        (left.high < stroke.high, left.high - left.along),
    ):
        if limited:
            presence = np.minimum(presence, THIN + (1.0 - THIN) * np.clip(away / TAPER, 0.0, 1.0))
    return Grown(left, presence)
