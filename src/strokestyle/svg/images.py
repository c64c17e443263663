"""The texture of strokes as pixels: one palette PNG a stroke, whose opacity is the stroke's shape."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..drawing.raster import textured_pixels
from ..drawing.strokes import Drawing
from .format import IMAGE_LEVELS_GRAIN, IMAGE_LEVELS_SOFT
from .ink import GRAIN, inks
from .palette import Quantiser, ink_palette, used
from .png import encode_png

SAMPLE = 40_000  # texels that a drawing's colours are chosen from
SEEN = 0.5 / 255  # opacity


def stroke_images(
    drawing: Drawing, index: np.ndarray, resolution: float = 2.0
) -> Iterator[tuple[float, float, float, float, bytes] | None]:
    """The strokes of `index` one by one: (x, y, width, height) in the drawing's pixels and a PNG of `resolution` pixels
    a pixel; None where nothing shows."""
    texture = drawing.texture
    ink = inks(texture)
    colors = None
    for i, (crop, pixel, color) in zip(
        index, textured_pixels(drawing, index, resolution), strict=True
    ):
        seen = color[:, 3] > SEEN
        pixel, color = pixel[seen], color[seen]
        if not len(pixel):
            yield None
            continue
        if ink.plain[i]:
            levels = IMAGE_LEVELS_GRAIN if ink.grain[i] > GRAIN else IMAGE_LEVELS_SOFT
            most = float(color[:, 3].max())
            palette = ink_palette(ink.color[i], levels) * [
                1.0,
                1.0,
                1.0,
                most,
            ]  # a faint stroke has as many
            place = np.rint(color[:, 3] / most * (levels - 1)).astype(np.uint8)
        else:
            colors = colors or Quantiser(_sample(texture.rgba))
            palette, place = colors.palette, colors.index(color)
        y, x = np.divmod(pixel, crop.w)
        x0, y0, width, height = x.min(), y.min(), np.ptp(x) + 1, np.ptp(y) + 1
        picture = np.zeros((height, width), np.uint8)
        picture[y - y0, x - x0] = place
        if not ink.plain[i]:
            picture, palette = used(picture, palette)
        box = np.array([crop.x0 + x0, crop.y0 + y0, width, height]) / resolution
        yield (
            *box.tolist(),
            encode_png(picture, np.rint(np.clip(palette, 0, 1) * 255).astype(np.uint8)),
        )


def _sample(rgba: np.ndarray) -> np.ndarray:
    """Some of a texture's texels, premultiplied (M, 4) in [0, 1], evenly spread."""
    flat = rgba.reshape(-1, 4)
    flat = flat[flat[:, 3] > 0]
    flat = flat[:: max(1, len(flat) // SAMPLE)].astype(np.float64) / 255.0
    if not len(flat):
        return np.zeros((1, 4))
    return np.concatenate([flat[:, :3] * flat[:, 3:], flat[:, 3:]], axis=1)
