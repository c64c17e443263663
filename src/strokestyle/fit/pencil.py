"""Tell the pencil of a construction from the ink that was laid over it.

Of two kinds of line, one fainter and no thicker, the fainter is no ink unless it is all that there
is: unless it draws curves that the other leaves bare.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

# The numbers below were set by hand; no ablation of them is kept. Lengths are px at 768.
AROUND = 5  # px, side of the square whose strongest opacity is a line's
INK, PENCIL = 0.75, 0.55  # opacity of ink at least, of pencil at most, as means of each
APART = 0.85  # share of the variance of opacity that lies between the two kinds
BETWEEN = 0.1  # share of the lines' length that is neither
MIN_PENCIL = 0.04  # share of the lines' length, to be a kind
NEAR = 7.0  # of a curve, to draw it
ALONE = 0.04  # share of the drawn curves that pencil alone draws, at most
MIN_LENGTH = 20.0  # of a line of pencil: what is shorter may be the end of a stroke
EDGE = 3.0  # around ink that is its own edge


def pencil_lines(
    alpha: np.ndarray, mask: np.ndarray, curve_points: np.ndarray
) -> np.ndarray | None:
    """Find what is pencil in a drawing in ink; None where there are no two kinds of line.

    Parameters
    ----------
    alpha, mask : (H, W), opacity of the ink, and of what its strokes cover
    curve_points : (N, 2) px

    Returns
    -------
    (H, W) bool
    """
    scale = max(alpha.shape) / 768.0
    inside = mask > 0.5
    depth = ndimage.distance_transform_edt(inside)
    ridge = inside & (depth >= ndimage.maximum_filter(depth, 3) - 0.5)
    strongest = ndimage.maximum_filter(alpha, AROUND)
    strength = strongest[ridge]
    if len(strength) < 200:
        return None
    cut = _otsu(strength)
    weak, strong = strength[strength < cut], strength[strength >= cut]
    if not len(weak) or len(weak) < MIN_PENCIL * len(strength):
        return None
    low, high = float(weak.mean()), float(strong.mean())
    within = (weak.var() * len(weak) + strong.var() * len(strong)) / len(strength)
    middle = low + 0.35 * (high - low), high - 0.35 * (high - low)
    between = ((strength > middle[0]) & (strength < middle[1])).mean()
    if high < INK or low > PENCIL or between > BETWEEN or within > (1 - APART) * strength.var():
        return None
    faint = ridge & (strongest < cut)
    if np.median(depth[faint]) > np.median(depth[ridge & ~faint]):
        return None
    sure = ridge & ~faint
    if not sure.any() or _alone(faint, sure, curve_points, NEAR * scale) > ALONE:
        return None
    ink = sure | (alpha > 0.5 * (low + high))
    from_ink = ndimage.distance_transform_edt(~ink)
    edge = EDGE * max(scale, 0.5)
    region = (alpha > 0) & (from_ink > edge)
    label, count = ndimage.label(region, np.ones((3, 3)))
    nearest = ndimage.minimum(from_ink, label, np.arange(count + 1))
    area = np.bincount(label.ravel(), minlength=count + 1)
    # the faint end of a stroke begins at its ink, and is short
    pencil = (nearest > edge + 2.0) | (area >= MIN_LENGTH * scale)
    pencil[0] = False
    return pencil[label]


def _otsu(values: np.ndarray) -> float:
    """The value that parts the values into two kinds best (Otsu 1979)."""
    count, edges = np.histogram(values, bins=64)
    middle = 0.5 * (edges[:-1] + edges[1:])
    below = np.cumsum(count)[:-1]
    above = below[-1] + count[-1] - below
    total = np.cumsum(count * middle)
    mean_below = total[:-1] / np.maximum(below, 1)
    mean_above = (total[-1] - total[:-1]) / np.maximum(above, 1)
    return float(edges[1:-1][np.argmax(below * above * (mean_above - mean_below) ** 2)])


def _alone(faint: np.ndarray, sure: np.ndarray, curve_points: np.ndarray, near: float) -> float:
    """Share of the drawn curve points (N, 2) that have faint lines near, and no sure ones."""
    drawn = []
    for lines in (faint, sure):
        y, x = np.nonzero(lines)
        xy = np.stack([x, y], axis=1) + 0.5
        if not len(xy) or not len(curve_points):
            return 1.0
        drawn.append(np.isfinite(cKDTree(xy).query(curve_points, distance_upper_bound=near)[0]))
    return float((drawn[0] & ~drawn[1]).sum() / max((drawn[0] | drawn[1]).sum(), 1))
