"""Draw curves one pixel wide, as a map of the canvas."""

from __future__ import annotations

import numpy as np

from ..geometry.curves import Curves, counting, owner

TILE = 8  # px, the square that a piece of a segment is drawn in
TILE_PIECE = 4.0  # px, the longest piece that a tile holds with 1 px around it


def _may_meet(a: np.ndarray, b: np.ndarray, width: int, height: int) -> np.ndarray:
    """Tell whether the box of each segment (S, 2) to (S, 2), grown by 1 px, meets the canvas."""
    return ((np.maximum(a, b) > -1.0) & (np.minimum(a, b) < np.array([width, height]) + 1.0)).all(
        axis=1
    )


def plain_raster(curves: Curves, width: int, height: int) -> np.ndarray:
    """Draw curves 1 px wide, (H, W) float32: 1 on the line, 0 at a pixel centre 1 px from it.

    In half precision, as all maps are.
    """
    out = np.zeros((height, width), np.float32)
    if not len(curves):
        return out
    which = owner(curves.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    first = first[_may_meet(curves.xy[first], curves.xy[first + 1], width, height)]
    start, step = _short_pieces(curves.xy[first], curves.xy[first + 1])
    corner = np.floor(np.minimum(start, start + step) - 1.0).astype(np.int64)
    x = corner[:, 0, None, None] + np.arange(TILE)  # (S, 1, TILE)
    y = corner[:, 1, None, None] + np.arange(TILE)[:, None]  # (S, TILE, 1)
    ink = _tile_ink(x, y, start, step)
    good = (ink > 0.0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    shade = ink[good].astype(np.float32).astype(np.float16).astype(np.float32)
    np.maximum.at(out.ravel(), (y * width + x)[good], shade)
    return out


def _short_pieces(start: np.ndarray, stop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut segments into pieces of at most TILE_PIECE px: starts and steps to their ends, (S, 2)."""
    step = stop - start
    count = np.maximum(np.ceil(np.hypot(*step.T) / TILE_PIECE), 1).astype(np.int64)
    step = np.repeat(step / count[:, None], count, axis=0)
    start = np.repeat(start, count, axis=0) + counting(count)[:, None] * step
    return start, step


def _tile_ink(x: np.ndarray, y: np.ndarray, start: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Measure the ink of pieces (S, 2) in their tiles (S, TILE, TILE): 1 less the distance in px.

    `x` (S, 1, TILE) and `y` (S, TILE, 1) are the columns and rows of the tiles' pixels.
    """
    from_x, from_y = x + 0.5 - start[:, 0, None, None], y + 0.5 - start[:, 1, None, None]
    dx, dy = step[:, 0, None, None], step[:, 1, None, None]
    t = (from_x * dx + from_y * dy) / np.maximum(dx * dx + dy * dy, 1e-12)
    t = np.clip(t, 0.0, 1.0)
    return 1.0 - np.hypot(from_x - t * dx, from_y - t * dy)
