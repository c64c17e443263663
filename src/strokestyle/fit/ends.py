"""Find where the strokes of a drawing begin and end on lines that lie some px beside them.

A stroke that lies beside its curve begins and ends beside it too, and so early or late by as much:
that is no manner either. Where a stroke's ink is seen to end near the end of its curve, the stroke
is stretched so that the two coincide, by the share of the difference that is likely to be
misregistration; the rest is overshoot, or stopping short, and is learned.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.curves import arc
from ..render.plan import Planned, heading

MOST_SLIDE = 12.0, 0.15  # px at 768, and of a stroke's length: beyond, the artist meant it
STRETCHED = 60.0, 0.5  # px at 768, and of a stroke's length, over which an end's slide is spread
SOON = 3  # points after the last with ink, of which one has none near, for a stroke to end there
MIN_ENDS = 8  # seen ends, below which their typical place is the end of the curve


class _End(NamedTuple):
    """One end of a stroke: its rows from the end of the curve inwards, and outwards, and length."""

    inwards: np.ndarray
    outwards: np.ndarray
    length: float


def slide_ends(
    xy: np.ndarray,
    found: np.ndarray,
    bare: np.ndarray,
    planned: Planned,
    off: float,
    spacing: float,
    scale: float,
) -> np.ndarray:
    """Move points along their strokes, so that curves end where the ink does: (N, 2) px, moved.

    Parameters
    ----------
    xy : (N, 2) px, where the strokes lie
    found : (N,) bool, where a point, also past the curve's end, has ink of its own
    bare : (N,) bool, where there is no ink at all near a point
    planned : the strokes
    off : px rms, by which the strokes lie off their curves
    spacing : px between points
    scale : px of the canvas for one at 768
    """
    ends = [pair for i in range(len(planned)) for pair in _ends(planned, i, spacing)]
    late = np.array([_late(end, found, bare, spacing, scale) for end in ends])
    slide = _likely(late, off).reshape(-1, 2)
    out = xy.copy()
    for i, (before, after) in enumerate(slide):
        if before or after:
            a, b = planned.offsets[i : i + 2]
            length = ends[2 * i].length
            out[a:b] = _stretched(xy[a:b], planned.on_curve[a:b], before, after, length, scale)
    return out


def _ends(planned: Planned, i: int, spacing: float) -> tuple[_End, _End]:
    """Both ends of stroke i."""
    a, b = planned.offsets[i : i + 2]
    inner = np.flatnonzero(planned.on_curve[a:b]) + a
    first, last = inner[0], inner[-1]
    length = spacing * (len(inner) - 1)
    before, after = np.arange(a, first)[::-1], np.arange(last + 1, b)
    return _End(inner, before, length), _End(inner[::-1], after, length)


def _late(end: _End, found: np.ndarray, bare: np.ndarray, spacing: float, scale: float) -> float:
    """How many px beyond the end of the curve the ink ends; nan where no end of it is seen near.

    A stroke ends where its ink is followed by none: another's ink may hide how far it goes.
    """
    most = min(MOST_SLIDE[0] * scale, MOST_SLIDE[1] * end.length)
    rows = np.r_[end.inwards[::-1], end.outwards]
    seen = np.flatnonzero(found[rows])
    if not len(seen):
        return np.nan
    # the run of ink that reaches farthest out from the curve's end, or ends just before it
    inner = seen[seen < len(end.inwards)]
    last = inner[-1] if len(inner) else seen[0]
    while last + 1 < len(rows) and found[rows[last + 1]]:
        last += 1
    if not bare[rows[last + 1 : last + 1 + SOON]].any():
        return np.nan
    late = spacing * (last + 0.5 - (len(end.inwards) - 1))
    return late if abs(late) <= most else np.nan


def _likely(late: np.ndarray, off: float) -> np.ndarray:
    """The part of what the ends are late by (E,) px that is misregistration, 0 where none is seen.

    Ends vary by the manner and by misregistration, which is as large along strokes as across.
    """
    seen = late[np.isfinite(late)]
    typical = float(np.median(seen)) if len(seen) >= MIN_ENDS else 0.0
    spread = float(np.mean((seen - typical) ** 2)) if len(seen) else 0.0
    share = min(1.0, off**2 / max(spread, 1e-6))
    return np.where(np.isfinite(late), share * (np.nan_to_num(late) - typical), 0.0)


def _stretched(
    xy: np.ndarray,
    on_curve: np.ndarray,
    before: float,
    after: float,
    length: float,
    scale: float,
) -> np.ndarray:
    """A stroke (n, 2) whose curve's ends are moved outwards by `before` and `after` px."""
    along = arc(xy)
    inner = along[on_curve]
    reach = min(STRETCHED[0] * scale, STRETCHED[1] * length)
    from_start = np.clip((along - inner[0]) / reach, 0.0, 1.0)
    to_end = np.clip((inner[-1] - along) / reach, 0.0, 1.0)
    at = along - before * (1.0 - from_start) ** 2 + after * (1.0 - to_end) ** 2
    # beyond what is planned a stroke goes straight on
    far = 2.0 * MOST_SLIDE[0] * scale
    ends = xy[:1] + far * heading(xy[::-1], 3), xy, xy[-1:] + far * heading(xy, 3)
    whole, place = np.concatenate(ends), np.r_[-far, along, along[-1] + far]
    return np.stack([np.interp(at, place, column) for column in whole.T], axis=1)
