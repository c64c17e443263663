"""Files of painting programs, with layers: Krita's .kra and OpenRaster's .ora.

Both are zips that hold the merged picture as PNG. Layers of OpenRaster (specification 0.0.6) are
PNG too; those of Krita are tiles packed by LZF, planes of bytes one after the other.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from PIL import Image

from ..files import MAX_DEPTH, MAX_ELEMENTS, MAX_TEXT, quoted
from .raster import Raster, of_pillow

MAX_ENTRY = 2**29  # bytes of a picture within a zip
MAX_TILE = 2**22  # bytes of a tile
LISTED = 12  # layers that an error names


@dataclass(frozen=True)
class Layered:
    """A file with layers.

    Parameters
    ----------
    width, height : px, of the canvas
    merged : reads the picture of all layers
    layers : (name, what reads it on the canvas), the topmost first
    """

    width: int
    height: int
    merged: Callable[[], Raster]
    layers: tuple[tuple[str, Callable[[], Raster]], ...]

    def raster(self, layer: str | None) -> Raster:
        """Read a layer, or the merged picture where `layer` is None.

        Raises ValueError, with the names that there are, where there is no such layer, or more
        than one.
        """
        if layer is None:
            return self.merged()
        named = [read for name, read in self.layers if name == layer]
        if len(named) == 1:
            return named[0]()
        names = list(dict.fromkeys(name for name, _ in self.layers))
        text = ", ".join(repr(quoted(name)) for name in names[:LISTED])
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        what = f"{len(named)} layers are" if named else "no layer is"
        raise ValueError(f"{what} named {quoted(layer)!r}; it has {text or 'none'}{more}")


def open_zip(path: Path) -> Layered:
    """Open a .kra or .ora.

    Raises ValueError, with what was found, where it is neither, or damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            if "maindoc.xml" in names:
                return _krita(path, _xml(archive, "maindoc.xml"), names)
            if "stack.xml" in names:
                return _open_raster(path, _xml(archive, "stack.xml"))
    except (zipfile.BadZipFile, zlib.error, ElementTree.ParseError, NotImplementedError) as error:
        raise ValueError(f"a damaged zip of a painting program ({error}); save it again") from None
    raise ValueError("a zip that is neither Krita's nor OpenRaster; export the drawing as PNG")


def _xml(archive: zipfile.ZipFile, name: str) -> ElementTree.Element:
    """Parse an entry, within limits; names without their namespaces."""
    text = _entry(archive, name, MAX_TEXT)
    if b"<!ENTITY" in text:
        raise ValueError(f"its {name} defines entities; save it again")
    root = ElementTree.fromstring(text)
    todo, count = [(root, 0)], 0
    while todo:
        element, depth = todo.pop()
        count += 1
        element.tag = element.tag.rpartition("}")[2]
        if depth > MAX_DEPTH or count > MAX_ELEMENTS:
            raise ValueError(f"its {name} has too many layers; export the drawing as PNG")
        todo += [(child, depth + 1) for child in element]
    return root


def _entry(archive: zipfile.ZipFile, name: str, limit: int = 0) -> bytes:
    """The bytes of an entry, no more than `limit` (or MAX_ENTRY), whatever the zip says of it."""
    limit = limit or MAX_ENTRY
    try:
        with archive.open(name) as stream:
            data = stream.read(limit + 1)
    except KeyError:
        raise ValueError(f"its {quoted(name)!r} is missing; save it again") from None
    except RuntimeError:  # encrypted
        raise ValueError("a zip with a password; save it without one") from None
    if len(data) > limit:
        raise ValueError(f"its {quoted(name)!r} is larger than {limit // 2**20} MB")
    return data


def _read(path: Path, name: str) -> bytes:
    try:
        with zipfile.ZipFile(path) as archive:
            return _entry(archive, name)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise ValueError(f"its {quoted(name)!r} is damaged ({error}); save it again") from None


def _png(path: Path, name: str) -> Image.Image:
    image = Image.open(io.BytesIO(_read(path, name)), formats=["PNG"])
    image.load()
    return image


def _canvas(element: ElementTree.Element, width: str, height: str) -> tuple[int, int]:
    return _whole(element, width), _whole(element, height)


def _whole(element: ElementTree.Element, name: str, default: str = "0") -> int:
    """An attribute that is a whole number."""
    try:
        value = int(float(element.get(name, default)))
    except (ValueError, OverflowError):
        raise ValueError(f"its {name} is {quoted(element.get(name, ''))!r}, no number") from None
    if abs(value) > 2**31:
        raise ValueError(f"its {name} is {value}: damaged")
    return value


def _open_raster(path: Path, root: ElementTree.Element) -> Layered:
    """The layers of an OpenRaster stack; offsets of stacks add up (baseline, "stack")."""
    size = _canvas(root, "w", "h")
    layers: list[tuple[str, Callable[[], Raster]]] = []

    def walk(stack: ElementTree.Element, x: int, y: int) -> None:
        for child in stack:
            at = x + _whole(child, "x"), y + _whole(child, "y")
            if child.tag == "stack":
                walk(child, *at)
            elif child.tag == "layer":
                source = child.get("src", "")
                layers.append((child.get("name", ""), partial(placed, source, at)))

    def placed(source: str, at: tuple[int, int]) -> Raster:
        image = _png(path, source)
        whole = Image.new("RGBA", size)
        whole.paste(image.convert("RGBA"), at)
        return replace(of_pillow(whole), profile=of_pillow(image).profile)

    walk(root, 0, 0)
    return Layered(*size, lambda: of_pillow(_png(path, "mergedimage.png")), tuple(layers))


def _krita(path: Path, root: ElementTree.Element, names: set[str]) -> Layered:
    """The paint layers of a Krita document."""
    image = root.find("IMAGE")
    if image is None:
        raise ValueError("its maindoc.xml has no image; save it again")
    size = _canvas(image, "width", "height")
    folder = image.get("name", "")
    layers = tuple(
        (layer.get("name", ""), partial(_krita_layer, path, folder, layer, size))
        for layer in image.iter("layer")
        if layer.get("nodetype", "paintlayer") == "paintlayer"
    )

    def merged() -> Raster:
        if "mergedimage.png" not in names:
            raise ValueError(
                "has no merged picture (a .krz?); name one of its layers, or save it as .kra"
            )
        return of_pillow(_png(path, "mergedimage.png"))

    return Layered(*size, merged, layers)


class _Pixel(NamedTuple):
    """How a pixel of Krita lies in memory: numbers, their type, colours, and their order."""

    samples: int
    dtype: str
    space: str
    order: list[int]


BGRA, RGBA, GREY = [2, 1, 0, 3], [0, 1, 2, 3], [0, 1]
KRITA_PIXELS = {
    "RGBA": _Pixel(4, "u1", "RGB", BGRA), "RGBA16": _Pixel(4, "<u2", "RGB", BGRA),
    "RGBAF16": _Pixel(4, "<f2", "RGB", RGBA), "RGBAF32": _Pixel(4, "<f4", "RGB", RGBA),
    "GRAYA": _Pixel(2, "u1", "L", GREY), "GRAYA16": _Pixel(2, "<u2", "L", GREY),
    "GRAYAF16": _Pixel(2, "<f2", "L", GREY), "GRAYAF32": _Pixel(2, "<f4", "L", GREY),
}  # fmt: skip


def _krita_layer(
    path: Path, folder: str, layer: ElementTree.Element, size: tuple[int, int]
) -> Raster:
    """A paint layer of Krita on its canvas."""
    space = layer.get("colorspacename", "RGBA")
    pixel = KRITA_PIXELS.get(space)
    if pixel is None:
        raise ValueError(f"its layer has colours of kind {quoted(space)}; convert it to RGB")
    name = f"{folder}/layers/{layer.get('filename', '')}"
    width, height = size
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
    dtype = np.dtype(pixel.dtype)
    canvas = np.zeros((height, width, pixel.samples), dtype)
    if name + ".defaultpixel" in names:
        default = _read(path, name + ".defaultpixel")[: pixel.samples * dtype.itemsize]
        if len(default) == pixel.samples * dtype.itemsize:
            canvas[:] = np.frombuffer(default, dtype)
    lay_tiles(canvas, _read(path, name), _whole(layer, "x"), _whole(layer, "y"))
    return Raster(
        width,
        height,
        lambda first, last: canvas[first:last][..., pixel.order],
        pixel.space,
        "straight",
        1.0 if dtype.kind == "f" else float(np.iinfo(dtype).max),
        profile=_read(path, name + ".icc") if name + ".icc" in names else b"",
    )


def lay_tiles(canvas: np.ndarray, data: bytes, x: int, y: int) -> None:
    """Lay the tiles of a Krita layer on a canvas (h, w, n), shifted by (x, y).

    Raises ValueError where they are damaged, or of other pixels.
    """
    head: dict[str, int] = {}
    at = 0
    while "DATA" not in head:
        end = data.find(b"\n", at)
        key, _, value = data[at:end].partition(b" ")
        if end < 0 or len(head) > 8 or not value.isdigit() or len(value) > 9:
            raise ValueError("its layer's tiles are damaged; save it again")
        head[key.decode("ascii", "replace")] = int(value)
        at = end + 1
    width, height = head.get("TILEWIDTH", 0), head.get("TILEHEIGHT", 0)
    size = canvas.shape[2] * canvas.dtype.itemsize
    if head.get("PIXELSIZE") != size or not 0 < width * height * size <= MAX_TILE:
        raise ValueError("its layer's tiles are not of its colours; save it again")
    for _ in range(head["DATA"]):
        end = data.find(b"\n", at)
        try:
            left, top, kind, length = data[at:end].decode("ascii").split(",")
            x0, y0, count = int(left) + x, int(top) + y, int(length)
        except ValueError:
            raise ValueError("its layer's tiles are damaged; save it again") from None
        packed = data[end + 1 : end + 1 + count]
        at = end + 1 + count
        if kind != "LZF" or end < 0 or count < 1 or len(packed) != count:
            raise ValueError("its layer's tiles are damaged; save it again")
        tile = _tile(packed, width * height, size).view(canvas.dtype)
        _put(canvas, tile.reshape(height, width, -1), x0, y0)


def _tile(packed: bytes, pixels: int, size: int) -> np.ndarray:
    """The pixels (pixels, size) uint8 of a tile: a flag, and its bytes plane by plane or as is."""
    if packed[0] == 0:
        plain = packed[1:]
        if len(plain) != pixels * size:
            raise ValueError("its layer's tiles are damaged; save it again")
        return np.frombuffer(plain, np.uint8).reshape(pixels, size)
    planes = np.frombuffer(unpack_lzf(packed[1:], pixels * size), np.uint8).reshape(size, pixels)
    return np.ascontiguousarray(planes.T)


def unpack_lzf(packed: bytes, length: int) -> bytes:
    """Unpack LZF data (liblzf's format) of `length` bytes.

    Raises ValueError where they do not come to that.
    """
    out = bytearray()
    at, end = 0, len(packed)
    while at < end and len(out) <= length:
        control = packed[at]
        at += 1
        if control < 32:  # so many bytes and one as they are
            out += packed[at : at + control + 1]
            at += control + 1
            continue
        run = control >> 5
        if run == 7 and at < end:
            run += packed[at]
            at += 1
        back = ((control & 31) << 8 | (packed[at] if at < end else 0)) + 1
        at += 1
        run += 2
        start = len(out) - back
        if start < 0:
            break
        if back >= run:
            out += out[start : start + run]
        else:
            out += (out[start:] * (run // back + 1))[:run]
    if len(out) != length or at != end:
        raise ValueError("its layer's tiles are damaged; save it again")
    return bytes(out)


def _put(canvas: np.ndarray, tile: np.ndarray, x: int, y: int) -> None:
    """Lay a tile (h, w, n) on a canvas, what lies outside cut off."""
    x0, y0 = max(x, 0), max(y, 0)
    x1, y1 = min(x + tile.shape[1], canvas.shape[1]), min(y + tile.shape[0], canvas.shape[0])
    if x0 < x1 and y0 < y1:
        canvas[y0:y1, x0:x1] = tile[y0 - y : y1 - y, x0 - x : x1 - x]
