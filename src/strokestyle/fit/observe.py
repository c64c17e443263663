"""Measure across the strokes of a drawing: where the ink lies, and how wide it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..render.plan import Planned

REACH = 16.0  # px to either side of a point within which its ink is looked for
PROBE_STEP = 0.5  # px between two samples of the mask across a stroke
INK_LEVEL = 0.4  # of the mask: a sample above this is ink
# Set by hand, with no ablation kept:
MAX_THICKNESS = 2.5  # of the 90 % quantile: a run wider than this is a stroke seen lengthwise
HALF_CONFIDENCE = 6.0  # px of offset at which an observation counts half


@dataclass(frozen=True)
class Observation:
    """Where a drawing has each point of the planned strokes.

    Parameters
    ----------
    offset : (N,) float64, px from the point to the ink's middle, along the point's normal
    thickness : (N,) float64, px, full width of the ink
    confidence : (N,) float64 in [0, 1], 0 where nothing is known
    """

    offset: np.ndarray
    thickness: np.ndarray
    confidence: np.ndarray

    def part(self, rows: np.ndarray) -> Observation:
        """Keep some rows (n,)."""
        return Observation(self.offset[rows], self.thickness[rows], self.confidence[rows])


def measure_across(
    mask: np.ndarray, planned: Planned, normals: np.ndarray, reach: float = REACH
) -> Observation:
    """Look across every point, along its normal, for the nearest run of ink.

    This is right where lines stand alone. Where they crowd, the nearest run may be another line's.

    Parameters
    ----------
    mask : (H, W) float, 1 = ink
    planned : strokes on the curves, N points; what runs past their ends is not measured
    normals : (N, 2) float64, unit; offsets are positive along them
    reach : px to either side within which ink counts
    """
    q = np.arange(-2 * reach, 2 * reach + 0.5 * PROBE_STEP, PROBE_STEP)  # (Q,) px across
    profile = sample_image(mask, planned.xy[:, None] + q[None, :, None] * normals[:, None])
    run, nearest, whole = _nearest_run(profile > INK_LEVEL, q)
    weight = profile * run
    total = np.maximum(weight.sum(axis=1), 1e-6)
    offset, thickness = (weight * q).sum(axis=1) / total, PROBE_STEP * total
    seen = whole & (nearest < reach) & (np.abs(offset) < reach) & planned.on_curve
    if seen.any():
        seen &= thickness < MAX_THICKNESS * np.quantile(thickness[seen], 0.9)
    return Observation(offset, thickness, seen / (1.0 + (offset / HALF_CONFIDENCE) ** 2))


def _nearest_run(inside: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the run of ink nearest to q = 0 in each row of `inside` (N, Q).

    Returns the samples of the run with one blank to either side (N, Q) bool, its distance (N,) px
    (inf where there is no ink), and whether it ends within the row at both sides (N,).
    """
    index = np.arange(len(q))
    distance = np.where(inside, np.abs(q), np.inf)
    k = distance.argmin(axis=1)
    nearest = distance[np.arange(len(k)), k]
    blank_before = np.where(~inside & (index < k[:, None]), index, -1).max(axis=1)
    blank_after = np.where(~inside & (index > k[:, None]), index, len(q)).min(axis=1)
    run = (index >= blank_before[:, None]) & (index <= blank_after[:, None])
    return run, nearest, (blank_before >= 0) & (blank_after < len(q))


def sample_image(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Interpolate an image (H, W) bilinearly at points (..., 2) px; 0 outside.

    Pixel centres lie at +1/2.
    """
    return ndimage.map_coordinates(
        image, [xy[..., 1] - 0.5, xy[..., 0] - 0.5], order=1, mode="constant"
    )
