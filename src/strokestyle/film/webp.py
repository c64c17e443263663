"""Write animated WebP without loss: RFC 9649, its chunks VP8X, ANIM and ANMF."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from PIL import Image

from .changes import Box, changed_box
from .pictures import Pictures
from .timing import durations

UNIT = 1000  # WebP tells times in 1/1000 s
MOST = 16383  # pixels of a side
ANIMATED, ALPHA = 0x02, 0x10  # what a file holds
REPLACE = 0x02  # a picture takes the place of what was there, transparent pixels too


def write_webp(path: str, pictures: Pictures, rate: Fraction, transparent: bool = False) -> None:
    """Write pictures as an animated WebP that begins anew at its end, for ever; nothing is lost.

    Each picture has its own time, also where it is the same as the one before: libwebp's own
    writer of animations makes a still of pictures that are all alike.

    Parameters
    ----------
    rate : frames a second
    transparent : keep the pictures' transparency; else they are opaque

    Raises
    ------
    ValueError
        where a side is too long.
    """
    width, height = pictures.size
    if max(pictures.size) > MOST:
        raise ValueError(f"a WebP has sides of up to {MOST} pixels, not {max(pictures.size)}")
    flags = ANIMATED | (ALPHA if transparent else 0)
    times = durations(pictures.held, rate, UNIT)
    with open(path, "wb") as file:
        file.write(b"RIFF\0\0\0\0WEBP")
        file.write(_chunk(b"VP8X", struct.pack("<I", flags) + _three(width - 1, height - 1)))
        file.write(_chunk(b"ANIM", struct.pack("<IH", 0, 0)))
        for (box, pixels), time in zip(_changes(pictures, transparent), times, strict=True):
            left, top, right, bottom = box
            place = _three(left // 2, top // 2, right - left - 1, bottom - top - 1, time)
            file.write(_chunk(b"ANMF", place + bytes([REPLACE]) + _packed(pixels)))
        size = file.tell() - 8
        file.seek(4)
        file.write(struct.pack("<I", size))


def _changes(pictures: Pictures, transparent: bool) -> Iterator[tuple[Box, np.ndarray]]:
    """What changes from picture to picture: boxes whose corner has even coordinates, pixels."""
    before: np.ndarray | None = None
    for picture in pictures.arrays("RGBA" if transparent else "RGB"):
        box = (0, 0, *pictures.size)
        if before is not None:
            left, top, right, bottom = changed_box(before, picture)
            box = (left & ~1, top & ~1, right, bottom)
        yield box, picture[box[1] : box[3], box[0] : box[2]]
        before = picture


def _packed(pixels: np.ndarray) -> bytes:
    """The chunk VP8L of pixels (h, w, 3 or 4)."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "WEBP", lossless=True, quality=80, method=4, exact=True)
    data = file.getvalue()
    start = data.index(b"VP8L", 12)  # behind the file's head, and a VP8X where there is one
    (size,) = struct.unpack("<I", data[start + 4 : start + 8])
    return data[start : start + 8 + size + size % 2]


def _chunk(name: bytes, body: bytes) -> bytes:
    return name + struct.pack("<I", len(body)) + body + bytes(len(body) % 2)


def _three(*numbers: int) -> bytes:
    """Numbers of three bytes each."""
    return b"".join(number.to_bytes(3, "little") for number in numbers)
