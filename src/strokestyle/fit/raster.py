"""The pixels of a file as they lie in it, and how they become an array of a working size.

A drawing of an A4 sheet at 600 dpi has 35 million pixels: as float32 RGBA more than half a
gigabyte. So it is read in bands of rows, premultiplied, and averaged over squares of pixels before
anything else is done with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image

BAND = 1 << 21  # samples of a band of rows, which lie in a processor's cache
TOP = 1.5  # of float samples: what a sharpening adds at its edges, and no other scale
CLEAR = 1e-4  # alpha below which there is no colour
SPACES = {"L": 1, "RGB": 3, "CMYK": 4, "LAB": 3}  # and how many samples a colour has


@dataclass(frozen=True)
class Raster:
    """The samples of an image, a band of rows at a time.

    Parameters
    ----------
    width, height : px
    rows : (first, last) -> (last - first, width, n), numbers of any type from 0 to `top`
    space : of the colours, a key of SPACES: n is its number of samples, and one more with alpha
    alpha : "" where there is none, "straight", or "premultiplied" where colours are times alpha
    top : the number that means full
    inverted : whether 0 is white
    profile : an ICC profile of the colours, or b""
    gamma : exponent of PNG's gAMA chunk, 0 where there is none
    primaries : CIE xy of white, red, green and blue, or () where there are none
    orientation : as EXIF has it, 1 to 8
    notes : what the user is to know, a line each
    """

    width: int
    height: int
    rows: Callable[[int, int], np.ndarray]
    space: str = "RGB"
    alpha: str = ""
    top: float = 255.0
    inverted: bool = False
    profile: bytes = b""
    gamma: float = 0.0
    primaries: tuple[float, ...] = ()
    orientation: int = 1
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        if self.space not in SPACES or self.alpha not in ("", "straight", "premultiplied"):
            raise ValueError(f"no raster of {self.space!r} with {self.alpha!r} alpha")


def shrunk(raster: Raster, factor: int) -> np.ndarray:
    """Average a raster over squares of `factor` x `factor` px.

    Returns (h, w, n) float32 in [0, 1], straight; w is the rounded width / factor. A file that is
    not made smaller keeps its numbers.
    """
    width, height = raster.width, raster.height
    channels = SPACES[raster.space] + bool(raster.alpha)
    out = np.empty((-(-height // factor), -(-width // factor), channels), np.float32)
    step = max(1, BAND // (width * channels * factor)) * factor
    for first in range(0, height, step):
        last = min(first + step, height)
        band = _band(raster, first, last)
        if raster.alpha == "straight" and factor > 1:
            band[..., :-1] *= band[..., -1:]
        out[first // factor : -(-last // factor)] = _averaged(band, factor)
    highest = float(out.max(initial=0.0))
    if not np.isfinite(highest) or highest > TOP:
        raise ValueError(
            f"its numbers go up to {highest:.4g}, where 1 is white; save it with 8 or 16 bits"
        )
    out = _fitted(out, width / factor, height / factor).clip(0, 1)
    return _straight(out) if raster.alpha and (raster.alpha != "straight" or factor > 1) else out


def _band(raster: Raster, first: int, last: int) -> np.ndarray:
    """Rows of a raster (last - first, width, n) float32 in [0, 1], 0 black."""
    band = raster.rows(first, last).astype(np.float32)
    if raster.top != 1.0:
        band /= np.float32(raster.top)
    if raster.inverted:
        n = SPACES[raster.space]
        white = band[..., n:] if raster.alpha == "premultiplied" else 1.0
        band[..., :n] = white - band[..., :n]
    return band


def _straight(image: np.ndarray) -> np.ndarray:
    """Divide the colours of a premultiplied image (h, w, n + 1) by its alpha; white where clear."""
    alpha = image[..., -1:]
    colours = np.where(alpha > CLEAR, image[..., :-1] / np.maximum(alpha, CLEAR), 1.0)
    return np.concatenate([colours.clip(0, 1), alpha], axis=-1)


def _averaged(band: np.ndarray, factor: int) -> np.ndarray:
    """Means of a band (n, w, c) over squares, the last ones filled up with their last pixels."""
    if factor == 1:
        return band
    n, w, c = band.shape
    if n % factor or w % factor:
        band = np.pad(band, ((0, -n % factor), (0, -w % factor), (0, 0)), mode="edge")
    rows = band[0::factor].copy()
    for k in range(1, factor):
        rows += band[k::factor]
    total = rows[:, 0::factor].copy()
    for k in range(1, factor):
        total += rows[:, k::factor]
    return total * np.float32(1.0 / factor**2)


def _fitted(image: np.ndarray, width: float, height: float) -> np.ndarray:
    """Resample an image (h, w, c) whose last squares are cut off, to whole pixels."""
    h, w, c = image.shape
    if (w, h) == (width, height):
        return image
    size, box = (max(1, round(width)), max(1, round(height))), (0, 0, width, height)
    planes = [
        np.asarray(
            Image.fromarray(np.ascontiguousarray(image[..., k])).resize(
                size, Image.Resampling.BICUBIC, box=box
            )
        )
        for k in range(c)
    ]
    return np.stack(planes, axis=-1)


def upright(image: np.ndarray, orientation: int) -> np.ndarray:
    """Turn and mirror an image (h, w, c) as EXIF's `orientation` (1 to 8) says."""
    if orientation in (5, 6, 7, 8):
        image = image.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    return image


DIRECT = {
    "L": ("L", ""), "LA": ("L", "straight"), "La": ("L", "premultiplied"), "RGB": ("RGB", ""),
    "RGBA": ("RGB", "straight"), "RGBa": ("RGB", "premultiplied"), "CMYK": ("CMYK", ""),
    "LAB": ("LAB", ""),
}  # fmt: skip
WITH_KEY = {"1": "LA", "L": "LA", "RGB": "RGBA", "P": "RGBA", "PA": "RGBA"}
WITHOUT_KEY = {"1": "L", "P": "RGB", "PA": "RGBA"}


def of_pillow(image: Image.Image) -> Raster:
    """The raster of an image that pillow has read."""
    mode = image.mode
    common = Raster(
        *image.size,
        rows=lambda first, last: _cropped(image, mode, first, last),
        profile=image.info.get("icc_profile") or b"",
        gamma=0.0 if "srgb" in image.info else float(image.info.get("gamma", 0)),
        primaries=tuple(image.info.get("chromaticity", ())),
        orientation=_orientation(image),
    )
    if mode.startswith("I") or mode == "F":
        if mode == "F":
            top = 1.0
        else:
            top = 65535.0 if _highest(image) > 255 else 255.0
        return replace(common, space="L", top=top)
    keyed = "transparency" in image.info and mode in WITH_KEY
    mode = (WITH_KEY if keyed else WITHOUT_KEY).get(mode, mode)
    mode = mode if mode in DIRECT else "RGB"
    space, alpha = DIRECT[mode]
    return replace(common, space=space, alpha=alpha)


def _cropped(image: Image.Image, mode: str, first: int, last: int) -> np.ndarray:
    """Rows of an image in another mode: (last - first, width, n)."""
    band = image.crop((0, first, image.width, last))
    rows = np.asarray(band if band.mode == mode else band.convert(mode))
    if mode == "LAB":
        rows = rows ^ np.array([0, 128, 128], np.uint8)  # signed to shifted, which can be averaged
    return rows if rows.ndim == 3 else rows[..., None]


def _highest(image: Image.Image) -> float:
    return float(np.max([np.max(np.asarray(image))]))


def _orientation(image: Image.Image) -> int:
    value = image.getexif().get(0x0112, 1)
    return value if value in range(1, 9) else 1
