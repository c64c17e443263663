"""Write animated PNGs: PNG, third edition (W3C 2025), its chunks acTL, fcTL and fdAT."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from PIL import Image

from ..svg.png import SIGNATURE
from .changes import changed_box
from .pictures import Pictures

MOST = 65535  # of the two numbers that tell a time


def write_apng(path: str, pictures: Pictures, rate: Fraction, transparent: bool = False) -> None:
    """Write pictures as an animated PNG that begins anew at its end, for ever; nothing is lost.

    Programs that know only PNG show the first picture.

    Parameters
    ----------
    rate : frames a second
    transparent : keep the pictures' transparency; else they are opaque
    """
    mode, number = ("RGBA" if transparent else "RGB"), 0
    before: np.ndarray | None = None
    with open(path, "wb") as file:
        file.write(SIGNATURE)
        for picture, held in zip(pictures.arrays(mode), pictures.held, strict=True):
            first = before is None
            box = (0, 0, *pictures.size) if before is None else changed_box(before, picture)
            header, data = _packed(picture[box[1] : box[3], box[0] : box[2]])
            if first:
                file.write(header)
                file.write(_chunk(b"acTL", struct.pack(">II", len(pictures), 0)))
            time = (held / rate).limit_denominator(MOST)
            file.write(_chunk(b"fcTL", struct.pack(">I", number) + _place(box, time)))
            number += 1
            for body in data:
                if first:
                    file.write(_chunk(b"IDAT", body))
                    continue
                file.write(_chunk(b"fdAT", struct.pack(">I", number) + body))
                number += 1
            before = picture
        file.write(_chunk(b"IEND", b""))


def _place(box: tuple[int, int, int, int], time: Fraction) -> bytes:
    """Where a picture is laid over the one before and for how long it is shown, seconds."""
    left, top, right, bottom = box
    size = struct.pack(">IIII", right - left, bottom - top, left, top)
    return size + struct.pack(">HHBB", time.numerator, time.denominator, 0, 0)


def _packed(pixels: np.ndarray) -> tuple[bytes, list[bytes]]:
    """The header's chunk of pixels (h, w, 3 or 4) as a PNG, and the bodies of its data's."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=9)
    chunks = list(_chunks(file.getvalue()))
    header = next(_chunk(name, body) for name, body in chunks if name == b"IHDR")
    return header, [body for name, body in chunks if name == b"IDAT"]


def _chunks(png: bytes) -> Iterator[tuple[bytes, bytes]]:
    place = len(SIGNATURE)
    while place < len(png):
        (length,) = struct.unpack(">I", png[place : place + 4])
        yield png[place + 4 : place + 8], png[place + 8 : place + 8 + length]
        place += length + 12


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
