"""TIFF files of the kinds that pillow refuses, or reads wrong without a word.

Its decoders are asked for bytes only: strips and tiles go to it as a grey image whose rows are the
bytes of the file's rows, so that libtiff unpacks them; what the bytes mean is told here (TIFF 6.0;
technical note 3 for the predictor of floats). 8-bit samples side by side it reads right itself.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import TiffImagePlugin

from .raster import SPACES, Raster

MAX_ENTRIES, MAX_PAGES, MAX_TAG = 4096, 1000, 2**26  # of a directory, of a file, bytes of a value
MAX_SAMPLES = 16  # of a pixel
GROUP = 1 << 23  # bytes of the strips that are unpacked at once
UNPACKED = {1: 1, 5: 5, 8: 8, 32946: 8, 32773: 32773, 34925: 34925, 50000: 50000}  # byte by byte
PILLOWS = (2, 3, 4, 6, 7)  # coded otherwise: CCITT's and JPEG
CODES = {1: "B", 3: "H", 4: "I", 7: "B", 11: "f", 12: "d", 13: "I", 16: "Q", 18: "Q"}
GREYS, RGB, PALETTE, CMYK, YCBCR, CIELAB = (0, 1), 2, 3, 5, 6, 8
(SUBFILE, WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC, FILL, OFFSETS, ORIENTATION, SAMPLES,
 ROWS_PER_STRIP, COUNTS, PLANAR, PREDICTOR, TILE_WIDTH, TILE_HEIGHT, TILE_OFFSETS, TILE_COUNTS,
 EXTRA, FORMAT, ICC) = (254, 256, 257, 258, 259, 262, 266, 273, 274, 277, 278, 279, 284, 317, 322,
                        323, 324, 325, 338, 339, 34675)  # fmt: skip
KNOWN = {
    SUBFILE, WIDTH, HEIGHT, BITS, COMPRESSION, PHOTOMETRIC, FILL, OFFSETS, ORIENTATION, SAMPLES,
    ROWS_PER_STRIP, COUNTS, PLANAR, PREDICTOR, TILE_WIDTH, TILE_HEIGHT, TILE_OFFSETS, TILE_COUNTS,
    EXTRA, FORMAT, ICC,
}  # fmt: skip


@dataclass(frozen=True)
class Page:
    """One image of a TIFF.

    Parameters
    ----------
    number : of the page in its file, from 0
    order : "<" or ">", the byte order
    tags : values of those KNOWN
    """

    number: int
    order: str
    tags: dict[int, tuple]

    def one(self, tag: int, default: int) -> int:
        """A tag's first value."""
        return int((self.tags.get(tag) or (default,))[0])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.one(WIDTH, 0), self.one(HEIGHT, 0)

    @property
    def samples(self) -> int:
        """How many samples a pixel has."""
        return self.one(SAMPLES, 1)


def read_pages(path: Path) -> list[Page]:
    """Read the directories of a TIFF, previews and masks left out.

    Raises ValueError where one is damaged.
    """
    with open(path, "rb") as file:
        head = file.read(16)
        order = "<" if head[:2] == b"II" else ">"
        big = struct.unpack(order + "H", head[2:4])[0] == 43
        offset = struct.unpack(order + ("Q" if big else "I"), head[8:16] if big else head[4:8])[0]
        pages: list[Page] = []
        seen: set[int] = set()
        while offset and offset not in seen and len(seen) < MAX_PAGES:
            seen.add(offset)
            try:
                tags, offset = _directory(file, offset, order, big)
            except struct.error:
                if pages:
                    break
                raise ValueError("the file is cut short: its directory is not there") from None
            pages.append(Page(len(seen) - 1, order, tags))
    whole = [page for page in pages if not page.one(SUBFILE, 0) & 0b101]
    if not pages:
        raise ValueError("TIFF without an image in it: cut short?")
    if not whole:
        raise ValueError("holds a preview only (a camera's raw file?); save it as PNG or JPEG")
    return whole


def _directory(file: BinaryIO, offset: int, order: str, big: bool) -> tuple[dict, int]:
    """The known tags of a directory, and where the next one lies."""
    file.seek(offset)
    count = struct.unpack(order + ("Q" if big else "H"), file.read(8 if big else 2))[0]
    size, inline = (20, 8) if big else (12, 4)
    if count > MAX_ENTRIES:
        raise struct.error
    table = file.read(count * size)
    following = file.read(inline)
    tags = {}
    for k in range(count):
        entry = table[k * size : (k + 1) * size]
        tag, kind = struct.unpack(order + "HH", entry[:4])
        number = struct.unpack(order + ("Q" if big else "I"), entry[4:-inline])[0]
        if tag in KNOWN and kind in CODES:
            tags[tag] = _value(file, entry[-inline:], number, order + CODES[kind], big)
    return tags, struct.unpack(order + ("Q" if big else "I"), following)[0] if following else 0


def _value(file: BinaryIO, inline: bytes, number: int, code: str, big: bool) -> tuple:
    """A tag's values: in the entry itself where they fit, or where it points to."""
    length = number * struct.calcsize(code)
    if length > MAX_TAG:
        raise struct.error
    if length > len(inline):
        file.seek(struct.unpack(code[0] + ("Q" if big else "I"), inline)[0])
        inline = file.read(length)
    if code[1] == "B":
        return tuple(inline[:length])
    return struct.unpack(f"{code[0]}{number}{code[1]}", inline[:length])


@contextlib.contextmanager
def quiet_libtiff() -> Iterator[None]:
    """Keep what libtiff prints of a damaged file off the terminal; errors are raised as well."""
    try:
        kept = os.dup(2)
    except OSError:  # closed
        yield
        return
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def pillow_reads(page: Page) -> bool:
    """Tell whether pillow reads a page right: 8 bits side by side, or coded otherwise than bytes.

    Raises ValueError, with what was found, where neither it nor `tiff_raster` reads it.

    Checked with pillow 13.0 against tifffile: it inverts no white-is-zero of 16 bits or floats,
    mixes the planes of 16-bit images, and takes 32-bit and signed samples for 16-bit ones.
    """
    packed, kind, samples = page.one(COMPRESSION, 1), page.one(PHOTOMETRIC, 1), page.samples
    if packed not in (*UNPACKED, *PILLOWS):
        raise ValueError(
            f"TIFF packed by method {packed}; save it without compression, or with LZW or ZIP"
        )
    bits = set(page.tags.get(BITS, (1,)))
    if kind not in (*GREYS, RGB, PALETTE, CMYK, YCBCR) and (kind != CIELAB or bits != {8}):
        raise ValueError(f"TIFF with colours of kind {kind}; save it as RGB or grey")
    if packed in PILLOWS or page.one(FILL, 1) != 1 or kind in (PALETTE, YCBCR, CIELAB):
        return True
    if samples == 1:
        return bits in ({1}, {8}) and page.one(FORMAT, 1) == 1
    plain = bits == {8} and set(page.tags.get(FORMAT, (1,))) == {1} and page.one(PLANAR, 1) == 1
    extra = page.tags.get(EXTRA, ())
    return plain and (
        (kind == RGB and (samples == 3 or (samples == 4 and extra in ((1,), (2,)))))
        or (kind == CMYK and samples == 4)
    )


def tiff_raster(path: Path, page: Page) -> Raster:
    """Give the raster of a page that is not one that `pillow_reads`.

    Raises ValueError, with what was found, where its samples are of no kind that a drawing has.
    """
    width, height = page.size
    bits, form = _number(page)
    kind = page.one(PHOTOMETRIC, 1)
    space = {RGB: "RGB", CMYK: "CMYK"}.get(kind, "L")
    if page.samples < SPACES[space]:
        raise ValueError(f"{page.samples} samples a pixel for colours of {SPACES[space]}: damaged")
    chosen, alpha, note = _channels(page, SPACES[space])
    separate = page.one(PLANAR, 1) == 2 and page.samples > 1
    planes = [
        _plane(path, page, k, 1 if separate else page.samples, bits)
        for k in (chosen if separate else [0])
    ]
    read = [_reader(page, plane, bits, form) for plane in planes]

    def rows(first: int, last: int) -> np.ndarray:
        if separate:
            return np.concatenate([one(first, last) for one in read], axis=-1)
        return read[0](first, last)[..., chosen]

    return Raster(
        width,
        height,
        rows,
        space,
        alpha,
        1.0 if form == 3 else float(2**bits - 1),
        kind == 0,
        bytes(page.tags.get(ICC, ())),
        orientation=page.one(ORIENTATION, 1),
        notes=(note,) if note else (),
    )


def _number(page: Page) -> tuple[int, int]:
    """Bits of a sample, and its format: 1 unsigned, 3 float."""
    bits, forms = set(page.tags.get(BITS, (1,))), set(page.tags.get(FORMAT, (1,)))
    if len(bits) > 1 or len(forms) > 1:
        raise ValueError("TIFF with samples of several sizes; save it with 8 or 16 bits a sample")
    size, form = int(bits.pop()), int(forms.pop())
    form = 1 if form == 4 else form
    if form not in (1, 3):
        what = "signed" if form == 2 else "complex"
        raise ValueError(f"TIFF with {what} samples; save it with 8 or 16 bits, unsigned")
    if not 1 <= size <= 64 or (form == 3 and size not in (16, 32, 64)):
        raise ValueError(f"TIFF with samples of {size} bits; save it with 8 or 16")
    if not 1 <= page.samples <= MAX_SAMPLES:
        raise ValueError(f"TIFF with {page.samples} samples a pixel; save it as RGB or grey")
    return size, form


def _channels(page: Page, colours: int) -> tuple[list[int], str, str]:
    """Which samples are read, what alpha is, and a note on those that are left out."""
    extra = page.tags.get(EXTRA, ()) + (0,) * page.samples
    for k in range(page.samples - colours):
        if extra[k] in (1, 2):
            alpha = "premultiplied" if extra[k] == 1 else "straight"
            return [*range(colours), colours + k], alpha, ""
    left = page.samples - colours
    note = f"{left} more samples a pixel are not said to be opacity, and left out" if left else ""
    return list(range(colours)), "", note


@dataclass(frozen=True)
class _Plane:
    """Where the bytes of an image lie, or of one of its planes.

    Parameters
    ----------
    compression : as in the file
    height : rows
    across : tiles beside one another; 1 of strips
    run : bytes of a row of one of them
    rows : of one of them
    offsets, counts : bytes, of each
    """

    path: Path
    compression: int
    height: int
    across: int
    run: int
    rows: int
    offsets: tuple[int, ...]
    counts: tuple[int, ...]

    def unpacked(self, first: int, last: int) -> np.ndarray:
        """The bytes of rows of strips or tiles, `first` to before `last`: (n, across * run)."""
        blocks = range(first * self.across, last * self.across)
        rows = min(last * self.rows, self.height) - first * self.rows
        with open(self.path, "rb") as file:
            data = []
            for k in blocks:
                file.seek(self.offsets[k])
                data.append(file.read(self.counts[k]))
        parcel = _parcel(data, self, rows)
        image = TiffImagePlugin.TiffImageFile(io.BytesIO(parcel))
        return np.asarray(image)

    def read(self, first: int, last: int) -> np.ndarray:
        """The bytes of whole rows of unpacked strips, straight from the file: (n, run)."""
        out = np.empty((last - first, self.run), np.uint8)
        with open(self.path, "rb") as file:
            row = first
            while row < last:
                strip, within = divmod(row, self.rows)
                n = min(self.rows - within, last - row)
                file.seek(self.offsets[strip] + within * self.run)
                data = file.read(n * self.run)
                if len(data) < n * self.run:
                    raise ValueError("the file is cut short: its last rows are not there")
                out[row - first : row - first + n] = np.frombuffer(data, np.uint8).reshape(n, -1)
                row += n
        return out


def _plane(path: Path, page: Page, plane: int, samples: int, bits: int) -> _Plane:
    """Find the strips or tiles of one plane of a page; of the only one with its samples in it."""
    width, height = page.size
    tiled = TILE_WIDTH in page.tags
    across = -(-width // page.one(TILE_WIDTH, 0)) if tiled and page.one(TILE_WIDTH, 0) else 1
    run = -(-(page.one(TILE_WIDTH, 0) if tiled else width) * samples * bits // 8)
    rows = page.one(TILE_HEIGHT, 0) if tiled else min(page.one(ROWS_PER_STRIP, height), height)
    offsets = page.tags.get(TILE_OFFSETS if tiled else OFFSETS, ())
    counts = page.tags.get(TILE_COUNTS if tiled else COUNTS, ())
    if rows < 1 or run < 1:
        raise ValueError("TIFF with strips or tiles of no size: damaged")
    blocks = -(-height // rows) * across
    start = plane * blocks
    compression = page.one(COMPRESSION, 1)
    if not counts and compression == 1:
        counts = (rows * run,) * len(offsets)
    if min(len(offsets), len(counts)) < start + blocks:
        raise ValueError("TIFF without all of its strips or tiles: damaged or cut short")
    part = slice(start, start + blocks)
    return _Plane(path, compression, height, across, run, rows, offsets[part], counts[part])


def _parcel(data: list[bytes], plane: _Plane, rows: int) -> bytes:
    """A grey TIFF of 8 bits whose pixels are the bytes of these strips or tiles."""
    tiled = plane.across > 1
    starts = np.cumsum([8, *map(len, data)])[:-1].tolist()
    sizes = [len(one) for one in data]
    entries = {
        WIDTH: [plane.across * plane.run], HEIGHT: [rows], BITS: [8],
        COMPRESSION: [UNPACKED[plane.compression]], PHOTOMETRIC: [1], SAMPLES: [1],
    }  # fmt: skip
    if tiled:
        entries |= {TILE_WIDTH: [plane.run], TILE_HEIGHT: [plane.rows]}
        entries |= {TILE_OFFSETS: starts, TILE_COUNTS: sizes}
    else:
        entries |= {OFFSETS: starts, ROWS_PER_STRIP: [plane.rows], COUNTS: sizes}
    body = b"".join(data)
    body += bytes(len(body) % 2)
    table, tail = b"", b""
    after = 8 + len(body) + 2 + 12 * len(entries) + 4
    for tag, values in sorted(entries.items()):
        packed = struct.pack(f"<{len(values)}I", *values)
        if len(values) > 1:
            tail += packed
            packed = struct.pack("<I", after + len(tail) - len(packed))
        table += struct.pack("<HHI", tag, 4, len(values)) + packed
    head = struct.pack("<2sHI", b"II", 42, 8 + len(body))
    return head + body + struct.pack("<H", len(entries)) + table + bytes(4) + tail


def unpack_strip(data: bytes, compression: int, run: int, rows: int) -> np.ndarray:
    """Unpack the bytes of rows, `run` each, by a method of TIFF, of those UNPACKED: (rows, run)."""
    plane = _Plane(Path(), compression, rows, 1, run, rows, (), ())
    return np.asarray(TiffImagePlugin.TiffImageFile(io.BytesIO(_parcel([data], plane, rows))))


def _reader(page: Page, plane: _Plane, bits: int, form: int) -> Callable[[int, int], np.ndarray]:
    """A function (first, last) -> samples (last - first, width, n) of a plane."""
    samples = page.samples if page.one(PLANAR, 1) != 2 else 1
    predictor = page.one(PREDICTOR, 1) if plane.compression != 1 else 1
    group = max(1, GROUP // (plane.rows * plane.run * plane.across))  # rows of strips
    kept: list = [-1, np.empty((0, 0), np.uint8)]

    def bytes_of(first: int, last: int) -> np.ndarray:
        if plane.compression == 1 and plane.across == 1 and TILE_WIDTH not in page.tags:
            return plane.read(first, last)
        step, parts = group * plane.rows, []
        for k in range(first // step, (last - 1) // step + 1):
            if kept[0] != k:
                end = min((k + 1) * group, -(-plane.height // plane.rows))
                kept[:] = k, plane.unpacked(k * group, end)
            parts.append(kept[1][max(0, first - k * step) : last - k * step])
        return np.concatenate(parts)

    def rows(first: int, last: int) -> np.ndarray:
        runs = bytes_of(first, last).reshape(-1, plane.run)
        numbers = _numbers(runs, page.order, bits, form, samples, predictor)
        return numbers.reshape(last - first, -1, samples)[:, : page.one(WIDTH, 0)]

    return rows


def _numbers(
    runs: np.ndarray, order: str, bits: int, form: int, samples: int, predictor: int
) -> np.ndarray:
    """Samples (n, w, samples) of the bytes (n, k) of rows of strips or tiles."""
    n = len(runs)
    if bits not in (8, 16, 32, 64):
        places = np.unpackbits(runs, axis=1)[:, : runs.shape[1] * 8 // bits * bits]
        powers = 2.0 ** np.arange(bits - 1, -1, -1)
        numbers = places.reshape(n, -1, bits) @ powers
        return numbers[:, : numbers.shape[1] // samples * samples].reshape(n, -1, samples)
    dtype = np.dtype(f"{order}{'f' if form == 3 else 'u'}{bits // 8}")
    if predictor == 3:
        turned = runs.reshape(n, -1, samples).cumsum(axis=1, dtype=np.uint8)
        significant = turned.reshape(n, bits // 8, -1).swapaxes(1, 2)
        dtype = dtype.newbyteorder(">")
        return np.ascontiguousarray(significant).view(dtype).reshape(n, -1, samples)
    numbers = np.ascontiguousarray(runs).view(dtype).reshape(n, -1, samples)
    if predictor == 2:
        whole = numbers.view(dtype.str.replace("f", "u")).astype(f"=u{bits // 8}")
        numbers = whole.cumsum(axis=1, dtype=whole.dtype).view(dtype.newbyteorder("="))
    return numbers
