"""Write and read small PNG images."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
from PIL import Image

from .palette import MODES


def encode_png(index: np.ndarray, palette: np.ndarray) -> bytes:
    """Palette indices (h, w) uint8 and straight RGBA colours (n, 4) uint8 -> PNG.

    4 bits where they do, and then run lengths only: smaller for grain than what pillow writes, and ten times faster.
    """
    if len(palette) <= 16:
        return png(index, palette, 4, {0: zlib.Z_RLE})
    # many levels are soft tone: a line is much like the one above it
    return png(index, palette, 8, {0: zlib.Z_RLE, 2: zlib.Z_FILTERED})


def png(index: np.ndarray, palette: np.ndarray | None, bits: int, ways: dict[int, int]) -> bytes:
    """Values (h, w) uint8 of 4 or 8 bits as a PNG, grey or with a palette of straight RGBA (n, 4) uint8.

    `ways` has a strategy of zlib for each PNG filter to try: 0, or 2, the difference to the line above. The one that
    leaves the fewest run lengths is taken.
    """
    height, width = index.shape
    lines = index
    if bits == 4:
        even = np.pad(index, ((0, 0), (0, width % 2)))
        lines = (even[:, ::2] << 4) | even[:, 1::2]
    header = struct.pack(">IIBBBBB", width, height, bits, 0 if palette is None else 3, 0, 0, 0)
    parts = [(b"IHDR", header)]
    if palette is not None:
        parts += [(b"PLTE", palette[:, :3].tobytes()), (b"tRNS", palette[:, 3].tobytes())]
    runs = {filtering: _deflated(lines, filtering, zlib.Z_RLE) for filtering in ways}
    best = min(runs, key=lambda filtering: len(runs[filtering]))
    packed = runs[best] if ways[best] == zlib.Z_RLE else _deflated(lines, best, ways[best])
    parts += [(b"IDAT", packed), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in parts
    )


def _deflated(lines: np.ndarray, filtering: int, strategy: int) -> bytes:
    if filtering == 2:
        lines = lines - np.concatenate([np.zeros_like(lines[:1]), lines[:-1]])
    lines = np.concatenate([np.full((len(lines), 1), filtering, np.uint8), lines], axis=1)
    # level 9 takes twice as long for half a hundredth less
    packer = zlib.compressobj(8, zlib.DEFLATED, 15, 9, strategy)
    return packer.compress(lines.tobytes()) + packer.flush()


def read_png(data: bytes, most: int, what: str) -> Image.Image:
    """A PNG of at most `most` pixels, none of which is unpacked before its size is known. Raises ValueError."""
    if len(data) < 33 or not data.startswith(b"\x89PNG\r\n\x1a\n") or data[12:16] != b"IHDR":
        raise ValueError(f"its {what} is no PNG")
    width, height = struct.unpack(">II", data[16:24])
    if not 0 < width * height <= most:
        raise ValueError(f"its {what} of {width} x {height} pixels is too large")
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            if image.mode not in MODES:
                raise ValueError(
                    f"its {what} is a PNG of mode {image.mode}, which strokes' are not"
                )
            image.load()
            return image
    except (OSError, SyntaxError, zlib.error, struct.error, IndexError, EOFError) as error:
        raise ValueError(f"its {what} is a damaged PNG ({error})") from None
