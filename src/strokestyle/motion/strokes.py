"""Cut strokes out of what is drawn of sheets, and give them names that last."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.curves import arc
from .persist import Fate
from .sheets import Points

SHORTEST = 8.0  # px of a stroke
BOTH = 24.0  # px of each of two strokes that stay two where the gap between them closes


@dataclass(frozen=True)
class Stroke:
    """One stroke of one frame.

    Parameters
    ----------
    track : int, its name
    rows : (n,) int, its points among those of the frame, along its sheet
    sheet : int
    along : (n,), their coordinates on the sheet
    """

    track: int
    rows: np.ndarray
    sheet: int
    along: np.ndarray

    @property
    def low(self) -> float:
        return float(self.along[0])

    @property
    def high(self) -> float:
        return float(self.along[-1])

    def within(self, low: float, high: float) -> Stroke:
        """Cut it down to where its coordinate lies between two."""
        keep = (self.along >= low) & (self.along <= high)
        return replace(self, rows=self.rows[keep], along=self.along[keep])


def name_strokes(
    frames: list[Points], fates: list[Fate], seam: Points | None = None
) -> list[list[Stroke]]:
    """Cut the strokes of all frames, and name each as what it continues.

    A stroke continues the one with which it has most of its sheet in common, of the frame before or
    else of the last in which there was one. Two that meet stay two, unless one is short.

    Parameters
    ----------
    seam : the points of the first frame, named as on the sheets of the last, where the last frame
        goes over into it
    """
    names = _Names()
    out: list[list[Stroke]] = []
    before: list[Stroke] = []
    for points, fate in zip(frames, fates, strict=True):
        before = names.named(list(_cut(points, fate.drawn)), before)
        out.append(before)
    if seam is not None and out:
        _close(out, seam)
    return out


def _cut(points: Points, drawn: np.ndarray) -> Iterator[Stroke]:
    """Cut out what is drawn and hangs together, where it is long enough."""
    follows = points.follows.copy()
    follows[1:] &= drawn[1:] & drawn[:-1]
    start = np.flatnonzero(~follows)
    for a, b in zip(start, np.r_[start[1:], len(points)], strict=True):
        if drawn[a] and b - a >= 2 and arc(points.xy[a:b])[-1] >= SHORTEST:
            yield Stroke(-1, np.arange(a, b), int(points.sheet[a]), points.along[a:b])


class _Names:
    """Hands out names, and remembers where on its sheet each was last."""

    def __init__(self) -> None:
        self.count = 0
        self.last: dict[int, dict[int, tuple[float, float]]] = {}

    def named(self, strokes: list[Stroke], before: list[Stroke]) -> list[Stroke]:
        """Name the strokes of a frame after those of the frame before."""
        was: dict[int, list[Stroke]] = {}
        for stroke in before:
            was.setdefault(stroke.sheet, []).append(stroke)
        apart = [part for s in strokes for part in _parted(s, was.get(s.sheet, []))]
        named = continued(apart, before)
        used = {stroke.track for stroke in named if stroke.track >= 0}
        out = []
        for stroke in named:
            if stroke.track < 0:
                stroke = replace(stroke, track=self._old_name(stroke, used))
                used.add(stroke.track)
            self.last.setdefault(stroke.sheet, {})[stroke.track] = (stroke.low, stroke.high)
            out.append(stroke)
        return out

    def _old_name(self, stroke: Stroke, used: set[int]) -> int:
        """Choose a name that nobody uses and that was there before, or else a new one."""
        best, track = 0.0, -1
        for name, (low, high) in self.last.get(stroke.sheet, {}).items():
            common = min(high, stroke.high) - max(low, stroke.low)
            if name not in used and common > best:
                best, track = common, name
        if track < 0:
            track, self.count = self.count, self.count + 1
        return track


def continued(strokes: list[Stroke], before: list[Stroke]) -> list[Stroke]:
    """Name strokes after those of the frame before with which they share most of a sheet."""
    pairs = []
    for i, stroke in enumerate(strokes):
        for other in before:
            if other.sheet == stroke.sheet:
                common = min(other.high, stroke.high) - max(other.low, stroke.low)
                if common > 0.0:
                    pairs.append((common, i, other.track))
    out, used = list(strokes), set()
    for _, i, track in sorted(pairs, reverse=True):
        if out[i].track < 0 and track not in used:
            out[i] = replace(out[i], track=track)
            used.add(track)
    return out


def _parted(stroke: Stroke, before: list[Stroke]) -> list[Stroke]:
    """Cut a stroke where two that were apart meet in it."""
    inside = [
        other
        for other in before
        if min(other.high, stroke.high) - max(other.low, stroke.low) >= BOTH
    ]
    inside.sort(key=lambda other: other.low)
    marks = [0.5 * (a.high + b.low) for a, b in zip(inside[:-1], inside[1:], strict=True)]
    if not marks:
        return [stroke]
    at = np.searchsorted(stroke.along, marks)
    cuts = [0, *(int(k) for k in at if 1 < k < len(stroke.rows) - 1), len(stroke.rows) - 1]
    parts = []
    for a, b in zip(cuts[:-1], cuts[1:], strict=True):
        if b - a >= 1:
            rows = slice(a, b + 1)
            parts.append(replace(stroke, rows=stroke.rows[rows], along=stroke.along[rows]))
    return parts


def _close(frames: list[list[Stroke]], seam: Points) -> None:
    """Name the strokes of the first frame, and what continues them, as those of the last."""
    first = []
    for stroke in frames[0]:
        sheet, along = seam.sheet[stroke.rows], seam.along[stroke.rows]
        known = sheet >= 0
        if not known.any():
            continue
        most = np.bincount(sheet[known]).argmax()
        some = np.sort(along[known & (sheet == most)])
        first.append((stroke.track, Stroke(-1, stroke.rows[: len(some)], int(most), some)))
    linked = continued([stroke for _, stroke in first], frames[-1])
    for (own, _), stroke in zip(first, linked, strict=True):
        if stroke.track >= 0 and stroke.track != own:
            _rename(frames, own, stroke.track)


def _rename(frames: list[list[Stroke]], old: int, new: int) -> None:
    """Call a track by the name of another, unless a frame has both."""
    if any({old, new} <= {stroke.track for stroke in strokes} for strokes in frames):
        return
    for t, strokes in enumerate(frames):
        frames[t] = [replace(s, track=new) if s.track == old else s for s in strokes]
