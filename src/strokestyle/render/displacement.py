"""How a stroke is moved off its curve: the basis of displacements along the stroke, and their sum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import simplify, tangents
from .features import along_strokes
from .plan import Planned

SMOOTHINGS = (3.0, 6.0, 12.0, 24.0)  # px, Gaussian scales by which the hand may round a curve off
CUTS = (3.0, 6.0, 12.0)  # px, tolerances with which it may cut a curve straight
DEFORMATIONS = (
    *(f"smooth_{n:.0f}" for n in SMOOTHINGS),
    *(f"cut_{n:.0f}" for n in CUTS),
    "inflate",
)


@dataclass(frozen=True)
class Frame:
    """Planned strokes: where they lie, which way is along and across, and the moves open to the hand.

    xy (N, 2), along (N, 2), across (N, 2), moves (N, M, 2) px, offsets (C+1,), within (N,) bool; in `fit` as tensors
    """

    xy: np.ndarray
    along: np.ndarray
    across: np.ndarray
    moves: np.ndarray
    offsets: np.ndarray
    within: np.ndarray

    @classmethod
    def of(cls, planned: Planned, surface: np.ndarray, spacing: float) -> Frame:
        """`surface` is SURFACE at the strokes' points, (N, 5)."""
        smooth = along_strokes(planned.xy, planned.offsets, 4.0, spacing, pin=True)
        t = tangents(smooth, planned.offsets)
        across = np.stack([-t[:, 1], t[:, 0]], axis=1)
        moves = deformations_of(planned, surface[:, 3:], spacing)
        return cls(planned.xy, t, across, moves, planned.offsets, planned.beyond == 0)


def deformations_of(planned: Planned, normals: np.ndarray, spacing: float) -> np.ndarray:
    """The displacement (N, M, 2), px, of each of MOVES at full strength. Points past an end go with it."""
    out = np.zeros((len(planned.xy), len(DEFORMATIONS), 2))
    within = planned.beyond == 0
    for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
        inner = np.flatnonzero(within[a:b]) + a
        a_in, b_in = inner[0], inner[-1] + 1
        p, ends = planned.xy[a_in:b_in], np.array([0, b_in - a_in])
        for k, sigma in enumerate(SMOOTHINGS):
            out[a_in:b_in, k] = along_strokes(p, ends, sigma, spacing, pin=True) - p
        q = along_strokes(p, ends, 4.0, spacing, pin=True)
        s = np.arange(len(p), dtype=np.float64)
        for k, tolerance in enumerate(CUTS, len(SMOOTHINGS)):
            keep = simplify(q, tolerance)
            out[a_in:b_in, k] = (
                np.stack([np.interp(s, keep, q[keep, i]) for i in (0, 1)], axis=1) - p
            )
        out[a_in:b_in, -1] = along_strokes(normals[a_in:b_in], ends, 12.0, spacing)
        out[a:a_in], out[b_in:b] = out[a_in], out[b_in - 1]
    return out


def displaced(frame: Frame, moves):
    """Where the hand means to draw, (N, 2) px; arrays or tensors."""
    return frame.xy + (frame.moves * moves[:, None]).sum(1)
