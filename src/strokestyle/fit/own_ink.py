"""Whose ink is whose: what lies under the traced strokes, and what no stroke explains.

A drawing holds ink that was not traced: hatching, lines that the view does not have, scribbles, a
neighbour whose trace lies beside it. Where such ink touches a stroke, nothing there is known to be
the stroke's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..drawing.raster import distance_map
from ..drawing.strokes import Strokes
from ..render.texture_bank import ROWS

MIN_MARGIN = 2.0  # px that strips reach beyond the half thickness, where the ink ends sharply there
NEIGHBOURHOOD = 10.0  # px around a stroke that are looked at to tell whose ink lies there
TRACE_OF_INK = 0.02  # of the mean opacity inside: less ink than that is none

# Ink that no stroke explains. Set by hand; no ablation is kept.
INK, FAINT = 0.5, 0.25  # of the mask: what is ink, and what may be the edge of some
ASTRAY = 2.0  # px outside of all strokes, so far a trace may err; ink beyond it is another's
SMALLEST_STRAY = 12.0  # px of area beyond it: less is a trace that errs a little more
TOUCHING = 1.5  # px from a stroke's edge within which foreign ink has mingled with its own
REACH = 1.0  # px to which the soft edge of foreign ink reaches

# Where a pixel of a strip is the stroke's own. Set by hand; no ablation is kept.
INSIDE, FREE_INSIDE = 1.0, 0.5  # px deep in the stroke, where another need be only this far away
FREE_OUTSIDE = 1.0  # px that another stroke may reach into the margin elsewhere
CROSSING = 3.0  # thicknesses along a stroke, between two sides that a slanting line crosses
ASLANT = 0.5  # thicknesses along it, to either side of where ink met it, that are not sure
PIECE = 2.5  # thicknesses: a shorter piece of a stroke between bare ones is another's ink
SUPPORT, SUPPORT_SIGMA = 0.5, 2.0  # ink by thickness, averaged over px: less bears no stroke out


@dataclass(frozen=True)
class NearestStrokes:
    """Whose pixels are whose.

    Parameters
    ----------
    stroke : (H, W) int64, the stroke that each pixel lies deepest in, -1 where none is near
    distance : (H, W) px by which it lies outside that stroke, negative inside, inf where none is
        near
    second : (H, W) px by which it lies outside the next one, inf where there is none
    """

    stroke: np.ndarray
    distance: np.ndarray
    second: np.ndarray


def nearest_strokes(
    strokes: Strokes, size: tuple[int, int], reach: float = NEIGHBOURHOOD
) -> NearestStrokes:
    """Find the two nearest strokes of every pixel of a canvas of `size` (width, height) px.

    Strokes farther away than `reach`, px, are not near.
    """
    width, height = size
    stroke = np.full((height, width), -1)
    distance, second = np.full((height, width), np.inf), np.full((height, width), np.inf)
    for i in range(len(strokes)):
        crop, own = distance_map(strokes, i, size, reach)
        box = crop.index
        old = distance[box]
        better = own < old
        second[box] = np.where(better, old, np.minimum(second[box], own))
        stroke[box] = np.where(better, i, stroke[box])
        distance[box] = np.where(better, own, old)
    return NearestStrokes(stroke, distance, second)


def unexplained_ink(nearest: NearestStrokes, mask: np.ndarray) -> np.ndarray:
    """Find the ink of a mask (H, W) that no stroke explains, up to the strokes' edges: bool (H, W).

    It begins where ink lies farther outside of every stroke than a trace may err, and goes on
    through ink towards the strokes as far as that.
    """
    stray = (mask > INK) & (nearest.distance > ASTRAY)
    label, count = ndimage.label(stray, np.ones((3, 3)))
    if not count:
        return stray
    area = np.bincount(label.ravel(), weights=mask.ravel())
    area[0] = 0.0
    stray = (area >= SMALLEST_STRAY)[label]
    between = (mask > FAINT) & (nearest.distance > 0.0)
    steps = int(np.ceil(ASTRAY)) + 1
    return ndimage.binary_dilation(stray, np.ones((3, 3)), iterations=steps, mask=between | stray)


def ink_margin(
    nearest: NearestStrokes, alpha: np.ndarray, foreign: np.ndarray | None = None
) -> float:
    """The px beyond the strokes' edges within which all but a trace of their ink (H, W) lies.

    Where ink is `foreign` (H, W) bool, it is not looked at.
    """
    alone = nearest.second > NEIGHBOURHOOD
    if foreign is not None:
        alone &= ~ndimage.binary_dilation(foreign, iterations=int(np.ceil(REACH)))
    inside = alone & (nearest.distance < 0)
    if not inside.any():
        return MIN_MARGIN
    level = TRACE_OF_INK * alpha[inside].mean()
    reach = NEIGHBOURHOOD
    for k in range(int(NEIGHBOURHOOD)):
        ring = alone & (nearest.distance > k) & (nearest.distance <= k + 1)
        if not ring.any() or alpha[ring].mean() < level:
            reach = k
            break
    return float(np.clip(reach + 1, MIN_MARGIN, NEIGHBOURHOOD - 2))


@dataclass(frozen=True)
class Texels:
    """Where the texels of one strip lie: n rows along a stroke, A columns across.

    Parameters
    ----------
    at : (2, n, A) y, x, in rows and columns of the image
    aside : (n, A) px from the centre line
    thickness : (n,) px
    past : (n,) bool, rows past the stroke's ends
    """

    at: np.ndarray
    aside: np.ndarray
    thickness: np.ndarray
    past: np.ndarray

    def sample(self, image: np.ndarray) -> np.ndarray:
        """The nearest pixel of an image (H, W) at every texel: (n, A)."""
        row, column = np.rint(self.at).astype(np.int64)
        y, x = np.clip(row, 0, image.shape[0] - 1), np.clip(column, 0, image.shape[1] - 1)
        return image[y, x]


@dataclass(frozen=True)
class InkOwners:
    """What is known of whose ink a drawing holds.

    Parameters
    ----------
    nearest : the strokes about every pixel
    mask : (H, W) the drawing's ink
    foreign : (H, W) px from the nearest ink that no stroke explains
    """

    nearest: NearestStrokes
    mask: np.ndarray
    foreign: np.ndarray

    @classmethod
    def of(cls, nearest: NearestStrokes, mask: np.ndarray) -> InkOwners:
        """Measure a mask (H, W) against the strokes."""
        foreign = unexplained_ink(nearest, mask)
        if not foreign.any():
            return cls(nearest, mask, np.full(mask.shape, np.inf))
        return cls(nearest, mask, ndimage.distance_transform_edt(~foreign))

    def own(self, i: int, texels: Texels, margin: float) -> np.ndarray:
        """Whether ink at the texels of stroke i can be but its own: (n, A) bool."""
        own = own_pixels(self.nearest, i, texels, margin)
        strange = texels.sample(self.foreign)
        own &= strange > REACH
        half = 0.5 * texels.thickness[:, None]
        met = (np.abs(texels.aside) < half + TOUCHING) & (strange <= 0)
        rows = _widened(met.any(axis=1), float(np.median(texels.thickness)))
        rows |= self._unsupported(texels, own)
        return own & ~rows[:, None]

    def _unsupported(self, texels: Texels, own: np.ndarray) -> np.ndarray:
        """Rows (n,) in which the drawing has not half the ink of a stroke so thick."""
        # what another stroke's pixels hold says nothing
        step = np.abs(np.diff(texels.aside, axis=1)).mean(axis=1)
        core = np.abs(texels.aside) < 0.5 * texels.thickness[:, None]
        core |= np.abs(texels.aside) <= 0.6 * step[:, None]
        sums = np.stack([(texels.sample(self.mask) * core).sum(axis=1), core.sum(axis=1)])
        ink, full = ndimage.gaussian_filter1d(sums, SUPPORT_SIGMA * ROWS, axis=1, mode="nearest")
        bare = (ink < SUPPORT * full) & ~texels.past
        return bare | _cut_off(bare, ROWS * PIECE * float(np.median(texels.thickness)))


def own_pixels(nearest: NearestStrokes, i: int, texels: Texels, margin: float) -> np.ndarray:
    """Whether no other stroke than i shows at the texels: (n, A) bool."""
    distance, second = texels.sample(nearest.distance), texels.sample(nearest.second)
    mine = texels.sample(nearest.stroke) == i
    own, other = np.where(mine, distance, second), np.where(mine, second, distance)
    # another stroke's soft edge does no harm well inside this one
    return other > np.where(own < -INSIDE, FREE_INSIDE, margin - FREE_OUTSIDE)


def _cut_off(bare: np.ndarray, rows: float) -> np.ndarray:
    """Rows (n,) bool in pieces that are shorter than `rows` and end where rows are `bare`."""
    label, count = ndimage.label(~bare)
    if count < 2:
        return np.zeros(len(bare), bool)
    return (np.bincount(label) < rows)[label] & ~bare


def _widened(met: np.ndarray, thickness: float) -> np.ndarray:
    """Rows (n,) bool where a line that was `met` at the edge may lie, slanting as it may."""
    at = np.flatnonzero(met)
    out = met.copy()
    for a, b in zip(at[:-1], at[1:], strict=True):
        if b - a <= CROSSING * thickness * ROWS:
            out[a:b] = True
    return ndimage.binary_dilation(
        out, iterations=int(np.ceil(max(1.0, ASLANT * thickness) * ROWS))
    )
