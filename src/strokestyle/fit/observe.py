"""Measure across the strokes of a drawing: where the ink lies, and how wide it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..render.displacement import Frame
from ..render.plan import Planned


@dataclass(frozen=True)
class Observation:
    """Where the drawing has each point of the strokes.

    offset (N,) px along the normal, thickness (N,) px, trust (N,) in [0, 1], 0 = not known
    """

    offset: np.ndarray
    thickness: np.ndarray
    trust: np.ndarray


def measure_across(
    mask: np.ndarray, planned: Planned, frame: Frame, reach: float = 16.0
) -> Observation:
    """Look across every point, along the normal, for the nearest run of stroke: right but where lines crowd."""
    q = np.arange(-2 * reach, 2 * reach + 0.25, 0.5)
    normal = frame.across.double().cpu().numpy()
    at = planned.xy[:, None] + q[None, :, None] * normal[:, None]
    profile = sample_image(mask, at)
    inside, index = profile > 0.4, np.arange(len(q))
    distance = np.where(inside, np.abs(q), np.inf)
    k = distance.argmin(axis=1)
    nearest = distance[np.arange(len(k)), k]
    # the run of ink around sample k: from the last blank before it to the first after
    blank_before = np.where(~inside & (index < k[:, None]), index, -1).max(axis=1)
    blank_after = np.where(~inside & (index > k[:, None]), index, len(q)).min(axis=1)
    run = (index >= blank_before[:, None]) & (index <= blank_after[:, None])
    weight = profile * run
    total = np.maximum(weight.sum(axis=1), 1e-6)
    offset, thickness = (weight * q).sum(axis=1) / total, 0.5 * total
    ends_seen = (blank_before >= 0) & (blank_after < len(q))
    trust = ends_seen & (nearest < reach) & (np.abs(offset) < reach) & (planned.beyond == 0)
    found = thickness[trust]
    if len(found):  # a run far wider than its like is another stroke seen lengthwise
        trust &= thickness < 2.5 * np.quantile(found, 0.9)
    return Observation(offset, thickness, trust / (1.0 + (offset / 6.0) ** 2))


def sample_image(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Bilinear values of an image (H, W) at pixels (..., 2); 0 outside."""
    return ndimage.map_coordinates(
        image, [xy[..., 1] - 0.5, xy[..., 0] - 0.5], order=1, mode="constant"
    )
