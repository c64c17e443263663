"""Fit a coordinate along a stroke to what its points brought with them from elsewhere."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

SIGMA = 2.0  # points over which its rise is averaged


def fitted(
    along: np.ndarray,
    brought: np.ndarray,
    mean: float,
    strain: tuple[float, float],
    relax: float = 1.0,
) -> np.ndarray:
    """Fit a coordinate that rises to values brought along, (n,).

    Its rise is that of the values, but no less than strain[0] times `mean` and no more than
    strain[1] times; its average is theirs, so that what strains does not wander off.

    Parameters
    ----------
    along : (n,) px along the stroke, rising
    brought : (n,), NaN where nothing was; somewhere there is something
    mean : its rise a px where nothing else tells
    relax : how much of the difference to `mean` is kept, 0..1
    """
    known = np.isfinite(brought)
    at, value = along[known], brought[known]
    step = np.maximum(np.diff(along), 1e-9)
    rise = np.diff(np.interp(along, at, np.maximum.accumulate(value))) / step
    rise[(along[1:] <= at[0]) | (along[:-1] >= at[-1])] = mean
    if len(rise):
        rise = ndimage.gaussian_filter1d(rise, SIGMA, mode="nearest")
    rise = mean + relax * (np.clip(rise, strain[0] * mean, strain[1] * mean) - mean)
    out = np.zeros(len(along))
    np.cumsum(rise * step, out=out[1:])
    return np.asarray(out + (value.sum() - out[known].sum()) / len(value))
