"""The texture of strokes as pixels: a palette PNG a stroke, whose opacity is its shape."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..drawing.raster import Crop, textured_pixels
from ..drawing.strokes import Drawing
from ..geometry.threads import in_turn
from .format import IMAGE_LEVELS_GRAIN, IMAGE_LEVELS_SOFT
from .ink import GRAIN, Inks
from .palette import Quantiser, ink_palette, used
from .png import encode_png

SAMPLE = 40_000  # texels that a drawing's colours are chosen from
SEEN = 0.5 / 255  # opacity


@dataclass(frozen=True)
class StrokeImage:
    """The pixels of a stroke: where they lie, in px of the drawing, and a PNG of them."""

    x: float
    y: float
    width: float
    height: float
    png: bytes

    @property
    def corners(self) -> np.ndarray:
        """(4, 2), px, clockwise from the upper left."""
        right, lower = self.x + self.width, self.y + self.height
        return np.array([[self.x, self.y], [right, self.y], [right, lower], [self.x, lower]])


def stroke_images(
    drawing: Drawing, index: np.ndarray, resolution: float, ink: Inks
) -> Iterator[StrokeImage | None]:
    """Paint the strokes of `index` one by one; None where nothing shows.

    `resolution` is in pixels of the image a px of the drawing, `ink` are the inks of all strokes.
    """
    texture = drawing.texture
    assert texture is not None  # as there are inks
    places = _places(texture.rgba, index, textured_pixels(drawing, index, resolution), ink)
    yield from in_turn(functools.partial(_image, resolution=resolution), places)


class _Places(NamedTuple):
    """Places (M,) uint8 in a palette (n, 4), at pixels (M,) of a crop.

    `every`: the palette is this stroke's own, and all of it is kept.
    """

    crop: Crop
    pixel: np.ndarray
    place: np.ndarray
    palette: np.ndarray
    every: bool


def _places(
    rgba: np.ndarray,
    index: np.ndarray,
    painted: Iterator[tuple[Crop, np.ndarray, np.ndarray]],
    ink: Inks,
) -> Iterator[_Places | None]:
    """The colours of painted strokes as places in palettes; None where nothing shows."""
    few: Quantiser | None = None
    plain = ink.plain
    for i, (crop, pixel, color) in zip(index, painted, strict=True):
        seen = color[:, 3] > SEEN
        pixel, color = pixel[seen], color[seen]
        if not len(pixel):
            yield None
        elif plain[i]:
            own = _in_one_ink(color[:, 3], ink.color[i], ink.grain[i])
            yield _Places(crop, pixel, *own, every=True)
        else:
            few = few or Quantiser(_sample(rgba))
            yield _Places(crop, pixel, few.index(color), few.palette, every=False)


def _image(places: _Places | None, resolution: float) -> StrokeImage | None:
    """The image of a stroke, with `resolution` pixels a px."""
    if places is None:
        return None
    crop, palette = places.crop, places.palette
    picture, x, y = _cropped(places.place, places.pixel, crop.w)
    if not places.every:
        picture, palette = used(picture, palette)
    box = np.array([crop.x0 + x, crop.y0 + y, picture.shape[1], picture.shape[0]]) / resolution
    left, upper, width, height = box.tolist()
    png = encode_png(picture, np.rint(np.clip(palette, 0, 1) * 255).astype(np.uint8))
    return StrokeImage(left, upper, width, height, png)


def _in_one_ink(
    opacity: np.ndarray, ink: np.ndarray, grain: float
) -> tuple[np.ndarray, np.ndarray]:
    """Opacities (M,) as places (M,) uint8 in a palette (n, 4) of an ink.

    A faint stroke has as many levels.
    """
    levels = IMAGE_LEVELS_GRAIN if grain > GRAIN else IMAGE_LEVELS_SOFT
    most = float(opacity.max())
    place = np.rint(opacity / most * (levels - 1)).astype(np.uint8)
    return place, ink_palette(ink, levels) * [1.0, 1.0, 1.0, most]


def _cropped(place: np.ndarray, pixel: np.ndarray, width: int) -> tuple[np.ndarray, int, int]:
    """The smallest picture (h, w) of values at pixels of one `width` px wide, and where it lies."""
    y, x = np.divmod(pixel, width)
    left, upper = x.min(), y.min()
    picture = np.zeros((np.ptp(y) + 1, np.ptp(x) + 1), np.uint8)
    picture[y - upper, x - left] = place
    return picture, left, upper


def _sample(rgba: np.ndarray) -> np.ndarray:
    """Some of a texture's texels, premultiplied (M, 4) in [0, 1], evenly spread."""
    flat = rgba.reshape(-1, 4)
    flat = flat[flat[:, 3] > 0]
    flat = flat[:: max(1, len(flat) // SAMPLE)].astype(np.float64) / 255.0
    if not len(flat):
        return np.zeros((1, 4))
    return np.concatenate([flat[:, :3] * flat[:, 3:], flat[:, 3:]], axis=1)
