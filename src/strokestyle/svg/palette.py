"""Colours of an image: one ink or a few, quantised."""

from __future__ import annotations

import numpy as np

from .format import IMAGE_COLORS

CELLS = 24  # a channel, of the table from colours to their place in a palette


def ink_palette(ink: np.ndarray, count: int) -> np.ndarray:
    """One ink (3,) in [0, 1] at `count` opacities from none to full, (count, 4) straight."""
    return np.concatenate(
        [np.tile(ink, (count, 1)), np.arange(count)[:, None] / (count - 1)], axis=1
    )


class Quantiser:
    """At most `count` colours for many: premultiplied RGBA in [0, 1], the first of them clear.

    Parameters
    ----------
    color : (M, 4) float, a sample of what is to be shown
    """

    def __init__(self, color: np.ndarray, count: int = IMAGE_COLORS):
        palette = quantise(color, count)[1]
        self.centres = np.concatenate([palette[:, :3] * palette[:, 3:], palette[:, 3:]], axis=1)
        self.table = np.full(CELLS**4, -1, np.int16)

    @property
    def palette(self) -> np.ndarray:
        """(K, 4) straight."""
        alpha = self.centres[:, 3:]
        return np.concatenate([self.centres[:, :3] / np.maximum(alpha, 1e-6), alpha], axis=1)

    def index(self, color: np.ndarray) -> np.ndarray:
        """The place in the palette (M,) uint8 of the colour nearest to each (M, 4)."""
        cell = np.rint(color * (CELLS - 1)).astype(np.int64) @ CELLS ** np.arange(3, -1, -1)
        unknown = np.unique(cell[self.table[cell] < 0])
        if len(unknown):
            value = np.stack(np.unravel_index(unknown, (CELLS,) * 4), axis=1) / (CELLS - 1)
            self.table[unknown] = nearest(value, self.centres)
        return self.table[cell].astype(np.uint8)


def used(index: np.ndarray, palette: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop the colours of a palette that an image of places in it does not use."""
    kept, compact = np.zeros(len(palette), bool), np.zeros(len(palette), np.uint8)
    kept[np.unique(index)] = True
    compact[kept] = np.arange(kept.sum())
    return compact[index], palette[kept]


def quantise(color: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Choose at most `count` colours for premultiplied pixels (M, 4), by weighted k-means.

    Returns each pixel's place (M,) uint8 among them, and the colours (K, 4), straight RGBA
    in [0, 1].
    """
    grid = np.rint(color * 63).astype(np.int64)
    code = ((grid[:, 0] * 64 + grid[:, 1]) * 64 + grid[:, 2]) * 64 + grid[:, 3]
    _, where, number = np.unique(code, return_inverse=True, return_counts=True)
    where = where.ravel()
    cells = np.stack([np.bincount(where, color[:, k]) for k in range(4)], axis=1) / number[:, None]
    weight = np.where(cells[:, 3] < 1 / 255, 0, number).astype(np.float64)
    if not weight.any():  # a breath of ink, less than a level of alpha everywhere
        return np.zeros(len(color), np.uint8), np.zeros((1, 4))
    centres = _first_centres(cells, weight, count)
    for _ in range(6):
        near = nearest(cells, centres)
        total = np.bincount(near, weight, len(centres))
        sums = [np.bincount(near, weight * cells[:, k], len(centres)) for k in range(4)]
        mean = np.stack(sums, axis=1) / np.maximum(total, 1e-9)[:, None]
        centres = np.where(total[:, None] > 0, mean, centres)
    near, alpha = nearest(cells, centres), centres[:, 3:]
    straight = np.concatenate([centres[:, :3] / np.maximum(alpha, 1e-6), alpha], axis=1)
    return near[where].astype(np.uint8), straight


def _first_centres(color: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """No colour, and some evenly spread along the axis on which those given differ most."""
    mean = (weight[:, None] * color).sum(axis=0) / weight.sum()
    spread = (color - mean) * np.sqrt(weight)[:, None]
    axis = np.linalg.eigh(spread.T @ spread)[1][:, -1]
    order = np.argsort(color @ axis, kind="stable")
    heap = np.cumsum(np.sqrt(weight[order]))
    place = np.searchsorted(heap, (np.arange(count - 1) + 0.5) / (count - 1) * heap[-1])
    chosen = np.unique(color[order[np.minimum(place, len(order) - 1)]], axis=0)
    return np.concatenate([np.zeros((1, 4)), chosen])


def nearest(colors: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Find the centre (K, d) nearest to each colour (M, d), (M,).

    It is the least of |c|^2 - 2 x.c, which one matrix product gives.
    """
    return (np.square(centres).sum(axis=1) - 2.0 * colors @ centres.T).argmin(axis=1)
