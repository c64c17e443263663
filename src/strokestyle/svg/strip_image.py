"""A stroke's strip as a PNG in a file, and back."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ..drawing.strip import texel_places
from ..drawing.strokes import Drawing, Strokes, Texture
from ..geometry.gradients import conjugate_gradients
from .format import LIMITS, STRIP_COLORS, STRIP_LEVELS
from .palette import quantise
from .png import encode_png, read_png

ONE_INK = (
    1.5 / 255
)  # rms; colours nearer than this to the stroke's ink need no palette: the PNG is its opacity
PRECISE = 1e-5  # of opacity or colour, to which a smaller strip is solved for
SPARE = 1.25  # texels a px beyond which a strip is made smaller, to one a px


def strips_png(
    drawing: Drawing, index: Sequence[int] | np.ndarray, levels: int = STRIP_LEVELS
) -> list[bytes]:
    """Encode the strips of the strokes of `index` as PNGs.

    x runs along the stroke, one texel a px; grey is opacity in the stroke's ink, in so many
    `levels`. Raises ValueError where the drawing has no texture.
    """
    texture = drawing.texture
    if texture is None:
        raise ValueError("the drawing has no texture whose strips could be told")
    made = []
    for i in np.asarray(index, np.int64).tolist():
        size = _size(drawing.strokes, texture, i)
        strip = texture.strip(i).astype(np.float64) / 255.0
        alpha = strip[..., 3]
        stray = np.square((strip[..., :3] - drawing.color[i, :3]) * alpha[..., None]).sum()
        plain = stray <= 3 * ONE_INK**2 * max(np.square(alpha).sum(), 1e-9)
        made.append(_grey_png(alpha, size, levels) if plain else _color_png(strip, size))
    return made


def _grey_png(alpha: np.ndarray, size: tuple[int, int], levels: int) -> bytes:
    """Opacities (n, A) in [0, 1] as a grey PNG of (rows, columns) texels in so many levels."""
    level = np.rint(np.clip(_smaller(alpha, *size), 0, 1) * (levels - 1)) / (levels - 1)
    return encode_png(np.rint(15 * level).astype(np.uint8).T, None, 4)


def _color_png(strip: np.ndarray, size: tuple[int, int]) -> bytes:
    """A strip (n, A, 4), straight RGBA in [0, 1], as a palette PNG of (rows, columns) texels."""
    flat = np.concatenate([strip[..., :3] * strip[..., 3:], strip[..., 3:]], axis=2)
    small = np.stack([_smaller(flat[..., k], *size) for k in range(4)], axis=-1)
    small = np.clip(small, 0, 1)
    small[..., :3] = np.minimum(small[..., :3], small[..., 3:])
    place, palette = quantise(small.reshape(-1, 4), STRIP_COLORS - 1)
    palette = np.rint(np.clip(palette, 0, 1) * 255).astype(np.uint8)
    return encode_png(place.reshape(size).T, palette)


def read_strip(
    data: bytes, ink: np.ndarray, most: int = LIMITS["strip_texels"].value
) -> np.ndarray:
    """A strip (n, A, 4) uint8 from its PNG; `ink` (3,) in [0, 1] is the colour of a grey one.

    Raises ValueError on what is no PNG, is damaged, or has more than `most` texels.
    """
    image = read_png(data, most, "texture")
    if image.mode in ("1", "L") and "transparency" not in image.info:
        alpha = np.asarray(image.convert("L"))
        rgb = np.rint(np.asarray(ink) * 255).astype(np.uint8)
        pixels = np.concatenate([np.broadcast_to(rgb, (*alpha.shape, 3)), alpha[..., None]], axis=2)
    else:
        pixels = np.asarray(image.convert("RGBA"))
    return np.ascontiguousarray(pixels.swapaxes(0, 1))


def _size(strokes: Strokes, texture: Texture, i: int) -> tuple[int, int]:
    """(rows, columns) of the strip to keep: one texel a px, or as it is if not much finer."""
    part, (rows, columns) = strokes.rows(i), texture.strip(i).shape[:2]
    half = 0.5 * strokes.thickness[part] + texture.margin[i]
    length = np.hypot(*np.diff(strokes.xy[part], axis=0).T).sum()
    if not strokes.closed[i]:
        length += half[0] + half[-1]
    return _fewer(rows, length), _fewer(columns, 2.0 * half.max())


def _fewer(texels: int, length: float) -> int:
    return max(2, int(np.ceil(length))) if texels > SPARE * length + 1 else texels


def _smaller(values: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """The (rows, columns) texels whose bilinear enlargement is nearest to `values` (n, A).

    By least squares.
    """
    n, a = values.shape
    if columns < a:
        values = values @ _squeeze(a, columns)
    if rows < n:
        low, fraction = texel_places(n, rows)
        own = (
            np.bincount(low, (1 - fraction) ** 2, rows)
            + np.bincount(low + 1, fraction**2, rows)
            + 1e-6
        )[:, None]
        beside = np.bincount(low, fraction * (1 - fraction), rows)[:-1, None]

        def product(values: np.ndarray) -> np.ndarray:
            out = own * values
            out[:-1] += beside * values[1:]
            out[1:] += beside * values[:-1]
            return out

        weighted = np.stack([(1 - fraction)[:, None] * values, fraction[:, None] * values], axis=1)
        right = np.zeros((rows, values.shape[1]))
        np.add.at(right, low, weighted[:, 0])
        np.add.at(right, low + 1, weighted[:, 1])
        values = conjugate_gradients(product, own, right, right / own, PRECISE)
    return values


@functools.lru_cache(maxsize=256)
def _stretch(fine: int, coarse: int) -> np.ndarray:
    """Linear interpolation from `coarse` texels to `fine` ones, (fine, coarse)."""
    if coarse == 1:
        return np.ones((fine, 1))
    low, fraction = texel_places(fine, coarse)
    matrix = np.zeros((fine, coarse))
    matrix[np.arange(fine), low] = 1 - fraction
    matrix[np.arange(fine), low + 1] += fraction
    return matrix


@functools.lru_cache(maxsize=256)
def _squeeze(fine: int, coarse: int) -> np.ndarray:
    """The least-squares inverse of `_stretch`, (fine, coarse), to be applied from the right."""
    return np.linalg.pinv(_stretch(fine, coarse)).T
