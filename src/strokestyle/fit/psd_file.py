"""Photoshop's files, .psd and .psb: the merged picture, or one layer.

Adobe Photoshop File Formats Specification, 2019. Pillow reads merged pictures of 8 bits only, and
of layers those without groups.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .layered_file import Layered
from .raster import SPACES, Raster
from .tiff_file import unpack_strip

MAX_LAYERS, MAX_CHANNELS, MAX_PLANE = 8000, 56, 2**30  # plane: bytes of one, unpacked
GREY, INDEXED, RGB, CMYK, DUOTONE, LAB = 1, 2, 3, 4, 8, 9
COLOURS = {GREY: "L", INDEXED: "RGB", RGB: "RGB", CMYK: "CMYK", DUOTONE: "L", LAB: "LAB"}
ICC_PROFILE, VERSION_INFO = 1039, 1057
LONG_KEYS = (
    b"LMsk", b"Lr16", b"Lr32", b"Layr", b"Mt16", b"Mt32", b"Mtrn", b"Alph", b"FMsk", b"lnk2",
    b"FEid", b"FXid", b"PxSD",
)  # fmt: skip
MATTE = 2.5 / 255  # how far colours may lie under their white matte, and still be matted


class _Mask(NamedTuple):
    """Where a layer's mask lies (top, left, bottom, right), and what it is outside, of 255."""

    box: tuple[int, ...]
    outside: int


class _Record(NamedTuple):
    """A layer: its name and box, and for each channel id where it lies and how long it is."""

    name: str
    box: tuple[int, ...]
    channels: dict[int, tuple[int, int]]
    group: bool
    mask: _Mask | None


@dataclass(frozen=True)
class _Document:
    path: Path
    wide: bool  # .psb
    channels: int
    width: int
    height: int
    depth: int
    mode: int
    palette: bytes
    resources: dict[int, bytes]
    records: tuple[_Record, ...]
    transparent: bool  # the first extra channel of the merged picture is its opacity
    merged: int  # offset of the merged picture

    @property
    def space(self) -> str:
        return COLOURS[self.mode]

    def colours(self) -> int:
        """How many channels the colours have."""
        return 1 if self.mode == INDEXED else SPACES[self.space]


class _Reader:
    """Numbers of a file, big endian; ValueError where it ends."""

    def __init__(self, path: Path, wide: bool = False):
        self.file = open(path, "rb")
        self.wide = wide

    def __enter__(self) -> _Reader:
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()

    def bytes(self, count: int) -> bytes:
        """The next `count` bytes."""
        data = self.file.read(count)
        if len(data) != count:
            raise ValueError("a Photoshop file that is cut short; save it again")
        return data

    def numbers(self, code: str) -> tuple:
        """The next numbers, as struct has them."""
        return struct.unpack(">" + code, self.bytes(struct.calcsize(">" + code)))

    def length(self, wide: bool | None = None) -> int:
        """A length: of 8 bytes in a .psb."""
        return int(self.numbers("Q" if (self.wide if wide is None else wide) else "I")[0])

    def end(self, wide: bool | None = None) -> int:
        """Where a block ends that begins with its length."""
        size = self.length(wide)
        return self.file.tell() + size


def open_psd(path: Path) -> Layered | None:
    """Open a .psd or .psb; None for a bitmap of 1 bit, which pillow reads.

    Raises ValueError, with what was found, where it is damaged or of no kind that is read.
    """
    document = _document(path)
    if document is None:
        return None
    layers = tuple(
        (one.name, partial(_layer, document, one))
        for one in reversed(document.records)
        if not one.group
    )
    return Layered(document.width, document.height, partial(_merged, document), layers)


def _document(path: Path) -> _Document | None:
    with _Reader(path) as file:
        _, version, _, channels, height, width, depth, mode = file.numbers("4sH6sHIIHH")
        file.wide = version == 2
        if depth == 1:
            return None
        if mode not in COLOURS or depth not in (8, 16, 32) or version not in (1, 2):
            raise ValueError(
                f"a Photoshop file of mode {mode} and {depth} bits; save it as RGB of 8 or 16 bits"
            )
        if not 1 <= channels <= MAX_CHANNELS:
            raise ValueError(f"a Photoshop file of {channels} channels: damaged")
        palette = file.bytes(file.length(False)) if mode == INDEXED else b""
        if mode != INDEXED:
            file.file.seek(file.end(False))
        resources = _resources(file)
        end = file.end()
        records, transparent = _layer_info(file, end)
        return _Document(
            path, file.wide, channels, width, height, depth, mode, palette, resources,
            tuple(records), transparent, end,
        )  # fmt: skip


def _resources(file: _Reader) -> dict[int, bytes]:
    """The image resources that are used here."""
    end, found = file.end(False), {}
    while file.file.tell() + 12 <= end:
        _, number = file.numbers("4sH")
        name = file.numbers("B")[0]
        file.bytes(name + (name + 1) % 2)
        size = file.length(False)
        if number in (ICC_PROFILE, VERSION_INFO):
            found[number] = file.bytes(size)
        else:
            file.file.seek(size, 1)
        file.file.seek(size % 2, 1)
    file.file.seek(end)
    return found


def _layer_info(file: _Reader, end: int) -> tuple[list[_Record], bool]:
    """The layers, from the bottom up, and whether the merged picture has opacity."""
    if file.file.tell() >= end:
        return [], False
    size = file.length()
    if size:
        return _records(file)
    if file.file.tell() + 4 > end:
        return [], False
    file.file.seek(file.end(False))  # the global mask
    while file.file.tell() + 12 <= end:  # 16 and 32 bits have their layers in a block
        _, key = file.numbers("4s4s")
        after = file.end(file.wide and key in LONG_KEYS)
        if key in (b"Lr16", b"Lr32", b"Layr"):
            return _records(file)
        file.file.seek(after + -after % 4)
    return [], False


def _records(file: _Reader) -> tuple[list[_Record], bool]:
    count = file.numbers("h")[0]
    if abs(count) > MAX_LAYERS:
        raise ValueError(f"a Photoshop file of {abs(count)} layers: damaged")
    heads = [_record(file) for _ in range(abs(count))]
    at, records = file.file.tell(), []
    for record, sizes in heads:
        for number, size in sizes:
            record.channels[number] = (at, size)
            at += size
        records.append(record)
    return records, count < 0


def _record(file: _Reader) -> tuple[_Record, list[tuple[int, int]]]:
    """A layer without its channels, and their ids and sizes."""
    box = file.numbers("4i")
    count = file.numbers("H")[0]
    if count > MAX_CHANNELS:
        raise ValueError(f"a Photoshop layer of {count} channels: damaged")
    sizes = [(file.numbers("h")[0], file.length()) for _ in range(count)]
    file.bytes(12)
    end = file.end(False)
    mask = _mask(file)
    file.file.seek(file.end(False))  # blending ranges
    length = file.numbers("B")[0]
    name = file.bytes(length).decode("latin-1").rstrip("\0")
    file.bytes(-(length + 1) % 4)
    group = False
    while file.file.tell() + 12 <= end:
        _, key = file.numbers("4s4s")
        after = file.end(file.wide and key in LONG_KEYS)
        if key == b"luni":
            letters = min(file.length(False), 1000)
            name = file.bytes(2 * letters).decode("utf-16-be", "replace").rstrip("\0")
        elif key == b"lsct":
            group = file.numbers("I")[0] in (1, 2, 3)
        file.file.seek(after)
    file.file.seek(end)
    return _Record(name, box, {}, group, mask), sizes


def _mask(file: _Reader) -> _Mask | None:
    """A layer's mask, where it has one that is not switched off."""
    end, mask = file.end(False), None
    if end - file.file.tell() >= 18:
        *box, outside, flags = file.numbers("4iBB")
        mask = None if flags & 2 else _Mask(tuple(box), outside)
    file.file.seek(end)
    return mask


def _merged(document: _Document) -> Raster:
    """The picture of all layers, as the program that saved it composed it."""
    real = document.resources.get(VERSION_INFO, b"")[4:5] != b"\0"
    if not real and document.records:
        raise ValueError(
            "has no merged picture; save it with Maximize Compatibility, or name one of its layers"
        )
    count = document.colours()
    used = min(document.channels, count + document.transparent)
    if used < count:
        raise ValueError("a Photoshop file without all of its colours: damaged")
    with _Reader(document.path, document.wide) as file:
        file.file.seek(document.merged)
        packed = file.numbers("H")[0]
        rows, run = document.height, document.width * document.depth // 8
        sizes = [rows * run] * document.channels
        if packed == 1:
            code = f"{rows}{'I' if document.wide else 'H'}"
            sizes = [sum(file.numbers(code)) for _ in range(document.channels)]
        elif packed != 0:
            raise ValueError(f"a merged picture packed by method {packed}; save it again")
        planes = [
            _plane(file.bytes(size), packed, document.width, rows, document.depth)
            for size in sizes[:used]
        ]
    raster = _raster(document, planes, used > count)
    return _unmatted(raster) if used > count and raster.space in ("L", "RGB") else raster


def _layer(document: _Document, record: _Record) -> Raster:
    """A layer on its canvas, clear where it is not, its mask its opacity too."""
    count, top = document.colours(), _top(document.depth)
    box = record.box
    if min(_size(box)) < 1 or any(k not in record.channels for k in range(count)):
        raise ValueError("its layer has no pixels of its own (a group, text or shape?)")
    with _Reader(document.path, document.wide) as file:
        planes = [_channel(file, document, record, k, box, 0) for k in range(count)]
        if -1 in record.channels:
            alpha = _channel(file, document, record, -1, box, 0)
        else:
            plane = np.full(_size(box), top, _dtype(document.depth))
            alpha = _laid(plane, box, document, 0)
        mask = record.mask
        if mask and -2 in record.channels and min(_size(mask.box)) > 0:
            outside = mask.outside / 255.0 * top
            cover = _channel(file, document, record, -2, mask.box, outside)
            alpha = (alpha * (cover / np.float32(top))).astype(alpha.dtype)
    return _raster(document, [*planes, alpha], True)


def _size(box: tuple[int, ...]) -> tuple[int, int]:
    """Height and width of (top, left, bottom, right)."""
    return box[2] - box[0], box[3] - box[1]


def _laid(
    plane: np.ndarray, box: tuple[int, ...], document: _Document, outside: float
) -> np.ndarray:
    """A plane of this box on the canvas (height, width), what lies outside cut off."""
    whole = np.full((document.height, document.width), outside, _dtype(document.depth))
    top, left = max(box[0], 0), max(box[1], 0)
    bottom, right = min(box[2], document.height), min(box[3], document.width)
    if top < bottom and left < right:
        part = plane[top - box[0] : bottom - box[0], left - box[1] : right - box[1]]
        whole[top:bottom, left:right] = part
    return whole


def _channel(
    file: _Reader,
    document: _Document,
    record: _Record,
    number: int,
    box: tuple[int, ...],
    outside: float,
) -> np.ndarray:
    """A channel of a layer on the canvas (height, width)."""
    height, width = _size(box)
    if width * height * document.depth // 8 > MAX_PLANE:
        raise ValueError(f"its layer is {width} x {height} pixels: too large")
    at, size = record.channels[number]
    file.file.seek(at)
    packed = file.numbers("H")[0]
    left = size - 2
    if packed == 1:
        counts = height * (4 if document.wide else 2)
        file.bytes(counts)
        left -= counts
    plane = _plane(file.bytes(max(left, 0)), packed, width, height, document.depth)
    return _laid(plane, box, document, outside)


def _dtype(depth: int) -> str:
    return {8: ">u1", 16: ">u2", 32: ">f4"}[depth]


def _top(depth: int) -> float:
    return 1.0 if depth == 32 else float(2**depth - 1)


def _plane(data: bytes, packed: int, width: int, height: int, depth: int) -> np.ndarray:
    """Unpack a channel (height, width): plain, PackBits, or deflate with or without prediction."""
    run = width * depth // 8
    if packed == 1:
        rows = unpack_strip(data, 32773, run, height)
    elif packed in (2, 3):
        unpack = zlib.decompressobj()
        try:
            plain = unpack.decompress(data, run * height)
        except zlib.error as error:
            raise ValueError(f"a damaged Photoshop file ({error}); save it again") from None
        rows = _shaped(plain, height, run)
    else:
        rows = _shaped(data, height, run)
    if packed != 3:
        return np.ascontiguousarray(rows).view(_dtype(depth))
    if depth == 32:
        turned = rows.cumsum(axis=1, dtype=np.uint8).reshape(height, 4, width)
        return np.ascontiguousarray(turned.swapaxes(1, 2)).view(">f4")[..., 0]
    whole = np.ascontiguousarray(rows).view(_dtype(depth)).astype(f"=u{depth // 8}")
    return whole.cumsum(axis=1, dtype=whole.dtype)


def _shaped(data: bytes, height: int, run: int) -> np.ndarray:
    if len(data) < height * run:
        raise ValueError("a Photoshop file that is cut short; save it again")
    return np.frombuffer(data, np.uint8, height * run).reshape(height, run)


def _raster(document: _Document, planes: list[np.ndarray], alpha: bool) -> Raster:
    """A raster of planes (height, width): colours, and alpha where there is some."""
    if document.mode == INDEXED:
        table = np.frombuffer(document.palette[:768].ljust(768, b"\0"), np.uint8).reshape(3, 256)
        planes = [*(colours[planes[0]] for colours in table), *planes[1:]]

    def rows(first: int, last: int) -> np.ndarray:
        return np.stack([plane[first:last] for plane in planes], axis=-1)

    return Raster(
        document.width, document.height, rows, document.space, "straight" if alpha else "",
        _top(document.depth), document.mode == CMYK,
        document.resources.get(ICC_PROFILE, b""),
    )  # fmt: skip


def _unmatted(raster: Raster) -> Raster:
    """Take the white out of a merged picture that was laid on white, as Photoshop does it.

    Others save it straight; those have colours that no ink on white could give.
    """
    read: Callable[[int, int], np.ndarray] = raster.rows
    top = raster.top
    for first in range(0, raster.height, 256):
        band = read(first, min(first + 256, raster.height)).astype(np.float32) / top
        if (band[..., :-1] < 1 - band[..., -1:] - MATTE).any():
            return raster

    def rows(first: int, last: int) -> np.ndarray:
        band = read(first, last).astype(np.float32) / top
        alpha = np.maximum(band[..., -1:], 1e-4)
        band[..., :-1] = ((band[..., :-1] - 1) / alpha + 1).clip(0, 1)
        return band

    return Raster(
        raster.width, raster.height, rows, raster.space, "straight", 1.0, profile=raster.profile
    )
