"""Write animated WebP without loss."""

from __future__ import annotations

from fractions import Fraction

from PIL import Image

from .pictures import Pictures
from .timing import durations

UNIT = 1000  # WebP tells times in 1/1000 s
MOST = 16383  # pixels of a side


def write_webp(path: str, pictures: Pictures, rate: Fraction, transparent: bool = False) -> None:
    """Write pictures as an animated WebP that begins anew at its end, for ever; nothing is lost.

    Parameters
    ----------
    rate : frames a second
    transparent : keep the pictures' transparency; else they are opaque

    Raises
    ------
    ValueError
        where a side is too long.
    """
    if max(pictures.size) > MOST:
        raise ValueError(f"a WebP has sides of up to {MOST} pixels, not {max(pictures.size)}")
    images = (Image.fromarray(a) for a in pictures.arrays("RGBA" if transparent else "RGB"))
    next(images).save(
        path,
        "WEBP",
        save_all=True,
        append_images=images,
        duration=durations(pictures.held, rate, UNIT),
        loop=0,
        lossless=True,
        quality=80,  # how hard it is packed
        method=4,
        exact=True,
    )
