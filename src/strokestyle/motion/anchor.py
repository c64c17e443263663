"""Give the points of strokes places along their tracks, to which chance and texture are anchored.

A place moves with the surface, as the parameter of a stroke does in Kalnins et al. 2003 and Benard
et al. 2012. But a texture that sticks to the surface would be pressed together where a line turns
away, and a medium has a grain of one size. So places rise by about 1 a px (STRAIN); the average of
what the points bring along is kept, so that a texture moves with its line on the whole and slides
towards its ends only; and what strain there is relaxes over the frames (RELAX).
"""

from __future__ import annotations

import numpy as np

from ..geometry.curves import arc
from .fit import fitted
from .strokes import Stroke

STRAIN, RELAX = (0.87, 1.15), 0.85

# Where on the sheets of a track which places were last: for each sheet, `along` that rises, places
_Anchor = dict[int, tuple[np.ndarray, np.ndarray]]


def anchor(strokes: list[list[Stroke]], lines: list[list[np.ndarray]]) -> list[list[np.ndarray]]:
    """Find the places of the points of all strokes, frame by frame; they rise along each.

    Parameters
    ----------
    strokes : of each frame
    lines : of each of them the pixels of its points (n, 2)
    """
    anchors: dict[int, _Anchor] = {}
    out = []
    for some, pixels in zip(strokes, lines, strict=True):
        placed = []
        for stroke, xy in zip(some, pixels, strict=True):
            place, last = arc(xy), anchors.get(stroke.track)
            if last is not None:
                brought = _brought(stroke, last)
                if np.isfinite(brought).sum() > 1:
                    place = fitted(place, brought, 1.0, STRAIN, RELAX)
            anchors[stroke.track] = _anchor(stroke, place)
            placed.append(place)
        out.append(placed)
    return out


def _anchor(stroke: Stroke, place: np.ndarray) -> _Anchor:
    out = {}
    for sheet in np.unique(stroke.sheet).tolist():
        rows = np.flatnonzero(stroke.sheet == sheet)
        rows = rows[np.argsort(stroke.along[rows], kind="stable")]
        out[sheet] = (stroke.along[rows], place[rows])
    return out


def _brought(stroke: Stroke, last: _Anchor) -> np.ndarray:
    """Read the places where a stroke has its points now, (n,), NaN where there were none."""
    out = np.full(len(stroke.rows), np.nan)
    for sheet, (along, place) in last.items():
        here = stroke.sheet == sheet
        here &= (stroke.along >= along[0]) & (stroke.along <= along[-1])
        out[here] = np.interp(stroke.along[here], along, place)
    return out
