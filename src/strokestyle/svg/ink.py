"""What the ink of a texture is like: its colour, whether it is one, and whether it is grain."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..drawing.strokes import Texture
from ..geometry.curves import blocks, owner
from ..geometry.threads import each

CACHED_TEXELS = 1 << 17  # of strips that are measured at a time, so that they stay in cache
ONE_INK = 0.02  # colours that differ less than this from their stroke's (rms, of 1) are one ink
GRAIN = (
    0.05  # of the opacity, from one texel to the next along a stroke: what changes more is grain
)
MUCH_THE_SAME = (
    0.08  # colours that differ less than this are one ink to the eye, at each depth of tone
)


@dataclass(frozen=True)
class Inks:
    """What the ink of each stroke is like, read off its strip.

    Parameters
    ----------
    color : (C, 3) float64 in [0, 1], the mean ink of each stroke
    spread : (C,) float64, how far colours lie from that ink (rms, of 1)
    grain : (C,) float64, change of the opacity from texel to texel, of the mean opacity
    amount : (C,) float64, sum of the opacity
    """

    color: np.ndarray
    spread: np.ndarray
    grain: np.ndarray
    amount: np.ndarray

    @property
    def plain(self) -> np.ndarray:
        """(C,) bool, strokes of exactly one ink: only its opacity varies."""
        return self.spread < ONE_INK

    @property
    def of_grain(self) -> bool:
        """Whether the drawing as a whole is grain in one ink, weighing strokes by their ink."""
        if not self.amount.sum() > 0:
            return False
        weight = self.amount / self.amount.sum()
        return bool(weight @ self.spread < MUCH_THE_SAME and weight @ self.grain > GRAIN)


def inks(texture: Texture) -> Inks:
    """Measure the ink of every stroke's strip."""
    offsets, even = np.asarray(texture.offsets), texture.opacities is not None  # frames are

    def measured(few: slice) -> Inks:
        rows = offsets[few.start : few.stop + 1]
        return _inks_of(texture.rgba[rows[0] : rows[-1]], rows - rows[0], even)

    few = blocks(offsets, CACHED_TEXELS // texture.rgba.shape[1])
    parts = [Inks(np.zeros((0, 3)), *[np.zeros(0)] * 3), *each(measured, few)]
    return Inks(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Inks)))


def _inks_of(rgba: np.ndarray, offsets: np.ndarray, even: bool) -> Inks:
    """The inks of a few strips; `even`: their rows may have one colour each throughout."""
    count, own = len(offsets) - 1, owner(offsets)
    alpha = rgba[..., 3].astype(np.float32) / 255.0
    dark = alpha.sum(axis=1)
    amount = np.bincount(own, dark, count)
    strength = np.square(alpha).sum(axis=1)
    total = np.maximum(np.bincount(own, strength, count), 1e-9)
    square = np.zeros(count)
    mean = np.zeros((count, 3))
    even = even and _is_even(rgba)
    for k in range(3):
        if even:
            row = rgba[:, 0, k] / 255.0
            mean[:, k] = np.bincount(own, dark * row, count)
            mean[:, k] /= np.maximum(amount, 1e-9)
            square += np.bincount(own, strength * np.square(row - mean[own, k]), count)
            continue
        channel = rgba[..., k].astype(np.float32) / 255.0
        mean[:, k] = np.bincount(own, (alpha * channel).sum(axis=1), count) / np.maximum(
            amount, 1e-9
        )
        off = alpha * (channel - mean[own, k].astype(np.float32)[:, None])
        square += np.bincount(own, np.square(off).sum(axis=1), count)
    change = np.abs(np.diff(alpha, axis=0)).sum(axis=1)
    change[offsets[1:-1] - 1] = 0.0
    grain = np.bincount(own[:-1], change, count) / np.maximum(amount, 1e-9)
    return Inks(mean, np.sqrt(square / total), grain, amount)


def _is_even(rgba: np.ndarray) -> bool:
    """Whether each row of texels (R, A, 4) uint8 has one colour throughout."""
    color = np.ascontiguousarray(rgba).view("<u4")[..., 0] & 0xFFFFFF
    return bool((color == color[:, :1]).all())
