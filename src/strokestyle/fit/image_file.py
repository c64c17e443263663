"""Read the file of a drawing: its pixels, upright, and whether its ground is transparent."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

MAX_PIXELS = 200_000_000
MIN_SIDE = 16  # px, of an image that something can be learned from
MIN_CLEAR = 0.4  # share of clear pixels; a clear margin round an opaque sheet is not its paper


def read_image(path: str | Path) -> tuple[np.ndarray, bool]:
    """Read an image file.

    PNG, JPEG, TIFF and whatever else pillow reads; 8 or 16 bits, grey, palette, RGB, CMYK, with or
    without alpha.

    Returns
    -------
    (H, W, 4) float32 straight RGBA in [0, 1], and whether its ground is transparent

    Raises
    ------
    ValueError
        naming the file, where it is not an image, is cut short, too large or too small.
    OSError
        where it cannot be read.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: a folder; expected an image of the drawing (PNG, JPEG or TIFF)")
    if path.stat().st_size == 0:
        raise ValueError(
            f"{path}: the file is empty; expected an image of the drawing (PNG, JPEG or TIFF)"
        )
    try:
        rgba = _decoded(path)
    except Image.DecompressionBombError:
        raise ValueError(f"{path}: too many pixels for a drawing; scale it down") from None
    except (OSError, SyntaxError, EOFError) as error:
        if isinstance(error, (FileNotFoundError, PermissionError)):
            raise
        raise ValueError(
            f"{path}: not a readable image ({_short(error)}); expected PNG, JPEG or TIFF"
        ) from None
    if min(rgba.shape[:2]) < MIN_SIDE:
        raise ValueError(
            f"{path}: {rgba.shape[1]} x {rgba.shape[0]} pixels is too small to learn from"
        )
    clear = rgba[..., 3] < 0.5
    return rgba, bool(clear.mean() > MIN_CLEAR)


def _decoded(path: Path) -> np.ndarray:
    """The pixels of an image file, upright: (H, W, 4) float32 straight RGBA."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with Image.open(path) as file:
            if file.width * file.height > MAX_PIXELS:
                raise ValueError(
                    f"{path}: {file.width} x {file.height} pixels is too large; scale it below "
                    f"{MAX_PIXELS // 1_000_000} megapixels"
                )
            file.load()
            image = ImageOps.exif_transpose(file)
            if image.mode.startswith("I") or image.mode == "F":
                return _of_grey(np.asarray(image, np.float32), image.mode)
            return np.asarray(image.convert("RGBA"), np.float32) / 255.0


def _of_grey(grey: np.ndarray, mode: str) -> np.ndarray:
    """RGBA of 16-bit and float greys (H, W), which pillow would clip to 8 bits."""
    top = 65535.0 if mode.startswith("I") else 1.0
    grey = np.clip(grey / (255.0 if grey.max(initial=0) <= 255 and top > 1 else top), 0, 1)
    return np.stack([grey] * 3 + [np.ones_like(grey)], axis=-1)


def _short(error: Exception) -> str:
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    return text if len(text) < 100 else text[:97] + "..."
