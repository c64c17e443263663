"""Rasters of few colours: a palette for an image, and the PNG that holds it, written and read."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
from PIL import Image

FEW, MANY = 10, 32  # levels of opacity of one ink: grain hides coarse steps and costs many bytes, soft tone shows them
COLORS = 128  # of a drawing in more than one ink; a stroke holds those that it uses
MODES = {"1", "L", "LA", "P", "RGB", "RGBA"}  # of PNGs that are read, as pillow names them
CELLS = 24  # a channel, of the table from colours to their place in a palette


def ink_palette(ink: np.ndarray, count: int) -> np.ndarray:
    """One ink (3,) in [0, 1] at `count` opacities from none to full, (count, 4) straight."""
    return np.concatenate([np.tile(ink, (count, 1)), np.arange(count)[:, None] / (count - 1)], axis=1)


class Quantiser:
    """At most `count` colours for many: premultiplied RGBA in [0, 1], the first of them clear.

    Parameters
    ----------
    color : (M, 4) float, a sample of what is to be shown
    """

    def __init__(self, color: np.ndarray, count: int = COLORS):
        palette = quantise(color, count)[1]
        self.centres = np.concatenate([palette[:, :3] * palette[:, 3:], palette[:, 3:]], axis=1)
        self.table = np.full(CELLS**4, -1, np.int16)

    @property
    def palette(self) -> np.ndarray:
        """(K, 4) straight."""
        alpha = self.centres[:, 3:]
        return np.concatenate([self.centres[:, :3] / np.maximum(alpha, 1e-6), alpha], axis=1)

    def index(self, color: np.ndarray) -> np.ndarray:
        """The place in the palette (M,) uint8 of the colour nearest to each (M, 4)."""
        cell = np.rint(color * (CELLS - 1)).astype(np.int64) @ CELLS ** np.arange(3, -1, -1)
        unknown = np.unique(cell[self.table[cell] < 0])
        if len(unknown):
            value = np.stack(np.unravel_index(unknown, (CELLS,) * 4), axis=1) / (CELLS - 1)
            self.table[unknown] = nearest(value, self.centres)
        return self.table[cell].astype(np.uint8)


def used(index: np.ndarray, palette: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An image of places in a palette and that palette, without the colours that it does not use."""
    kept, compact = np.zeros(len(palette), bool), np.zeros(len(palette), np.uint8)
    kept[np.unique(index)] = True
    compact[kept] = np.arange(kept.sum())
    return compact[index], palette[kept]


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
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
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
                raise ValueError(f"its {what} is a PNG of mode {image.mode}, which strokes' are not")
            image.load()
            return image
    except (OSError, SyntaxError, zlib.error, struct.error, IndexError, EOFError) as error:
        raise ValueError(f"its {what} is a damaged PNG ({error})") from None


def quantise(flat, count):
    """At most `count` straight RGBA colours for premultiplied pixels (M, 4), and each pixel's: weighted k-means."""
    grid = np.rint(flat * 63).astype(np.int64)
    code = ((grid[:, 0] * 64 + grid[:, 1]) * 64 + grid[:, 2]) * 64 + grid[:, 3]
    cell, where, weight = np.unique(code, return_inverse=True, return_counts=True)
    where = where.ravel()
    sums = np.stack([np.bincount(where, flat[:, k]) for k in range(4)], axis=1)
    colors = sums / weight[:, None]
    clear = colors[:, 3] < 1 / 255
    weight = np.where(clear, 0, weight).astype(np.float64)
    if not weight.any():  # a breath of ink, less than a level of alpha everywhere
        return np.zeros(len(flat), np.uint8), np.zeros((1, 4))
    # the first centres: evenly spread over the cells, along the axis on which they differ most
    mean = (weight[:, None] * colors).sum(axis=0) / weight.sum()
    spread = (colors - mean) * np.sqrt(weight)[:, None]
    axis = np.linalg.eigh(spread.T @ spread)[1][:, -1]
    order = np.argsort(colors @ axis, kind="stable")
    heap = np.cumsum(np.sqrt(weight[order]))
    first = np.searchsorted(heap, (np.arange(count - 1) + 0.5) / (count - 1) * heap[-1])
    centres = np.concatenate([np.zeros((1, 4)), np.unique(colors[order[np.minimum(first, len(order) - 1)]], axis=0)])
    for _ in range(6):
        near = nearest(colors, centres)
        total = np.bincount(near, weight, len(centres))
        moved = np.stack([np.bincount(near, weight * colors[:, k], len(centres)) for k in range(4)], axis=1)
        centres = np.where(total[:, None] > 0, moved / np.maximum(total, 1e-9)[:, None], centres)
    near = nearest(colors, centres)
    straight = np.concatenate([centres[:, :3] / np.maximum(centres[:, 3:], 1e-6), centres[:, 3:]], axis=1)
    return near[where].astype(np.uint8), straight


def nearest(colors: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """The centre (K, d) nearest to each colour (M, d), (M,): least of |c|^2 - 2 x.c, which one matrix product gives."""
    return (np.square(centres).sum(axis=1) - 2.0 * colors @ centres.T).argmin(axis=1)
