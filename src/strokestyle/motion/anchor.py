"""Give the points of strokes places along their tracks, to which chance and texture are anchored.

A place moves with the surface, as the parameter of a stroke does in Kalnins et al. 2003 and Benard
et al. 2012. But a texture that sticks to the surface would be pressed together where a line turns
away, and a medium has a grain of one size. So places rise by about 1 a px (STRAIN); the average of
what the points bring along is kept, so that a texture moves with its line on the whole and slides
towards its ends only; and what strain there is relaxes over the frames (RELAX).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import arc
from .fit import fitted
from .sheets import Points
from .strokes import Stroke

STRAIN, RELAX = (0.87, 1.15), 0.85


@dataclass(frozen=True)
class _Anchor:
    """Where on its sheet a track last had which places; `along` (n,) rises, as `place` (n,)."""

    sheet: int
    along: np.ndarray
    place: np.ndarray

    def brought(self, sheet: int, along: np.ndarray) -> np.ndarray:
        """Read the places at coordinates of a sheet, (n,), NaN where there were none."""
        inside = (along >= self.along[0]) & (along <= self.along[-1]) & (sheet == self.sheet)
        return np.where(inside, np.interp(along, self.along, self.place), np.nan)


def anchor(
    strokes: list[list[Stroke]], lines: list[list[np.ndarray]], seam: Points | None = None
) -> list[list[np.ndarray]]:
    """Find the places of the points of all strokes, frame by frame.

    Parameters
    ----------
    strokes : of each frame
    lines : of each of them the pixels of its points (n, 2)
    seam : where the last frame goes over into the first, the points of the first as `name_strokes`
        takes them; then places go round: what a track that lives all the turn gains in it is
        taken off it bit by bit
    """
    if seam is None:
        return _lap(strokes, lines, {}, {}, None)
    begins = _begins(strokes)
    anchors: dict[int, _Anchor] = {}
    _lap(strokes, lines, anchors, begins, None)
    out = _lap(strokes, lines, anchors, begins, seam)
    again = _lap(strokes[:1], lines[:1], anchors, begins, seam)
    drift = {
        stroke.track: float(np.mean(after - before))
        for stroke, before, after in zip(strokes[0], out[0], again[0], strict=True)
        if stroke.track not in begins
    }
    for t, (some, places) in enumerate(zip(strokes, out, strict=True)):
        for k, stroke in enumerate(some):
            places[k] = places[k] - drift.get(stroke.track, 0.0) * t / len(strokes)
    return out


def _lap(
    strokes: list[list[Stroke]],
    lines: list[list[np.ndarray]],
    anchors: dict[int, _Anchor],
    begins: dict[int, int],
    seam: Points | None,
) -> list[list[np.ndarray]]:
    """Go through the frames once; `anchors` are those of the tracks so far, and are kept up.

    `seam` names the first frame's points on the sheets of the last.
    """
    out = []
    for t, (some, pixels) in enumerate(zip(strokes, lines, strict=True)):
        placed = []
        for stroke, xy in zip(some, pixels, strict=True):
            if begins.get(stroke.track) == t:
                anchors.pop(stroke.track, None)
            brought = _brought(stroke, anchors.get(stroke.track), seam if t == 0 else None)
            s = arc(xy)
            known = np.isfinite(brought).sum() > 1
            place = fitted(s, brought, 1.0, STRAIN, RELAX) if known else s
            anchors[stroke.track] = _Anchor(stroke.sheet, stroke.along, place)
            placed.append(place)
        out.append(placed)
    return out


def _brought(stroke: Stroke, last: _Anchor | None, seam: Points | None) -> np.ndarray:
    """Find the places that a stroke's points bring from where they were last, (n,), or NaN."""
    if last is None:
        return np.full(len(stroke.rows), np.nan)
    if seam is None:
        return last.brought(stroke.sheet, stroke.along)
    there = seam.sheet[stroke.rows] == last.sheet
    return np.where(there, last.brought(last.sheet, seam.along[stroke.rows]), np.nan)


def _begins(strokes: list[list[Stroke]]) -> dict[int, int]:
    """Find the frame at which each track begins that is not in all frames of a loop.

    It is the one after the longest time for which it is not drawn.
    """
    count = len(strokes)
    times: dict[int, list[int]] = {}
    for t, some in enumerate(strokes):
        for stroke in some:
            times.setdefault(stroke.track, []).append(t)
    out = {}
    for track, shown in times.items():
        if len(shown) < count:
            gaps = np.diff([shown[-1] - count, *shown])
            out[track] = shown[int(gaps.argmax())]
    return out
