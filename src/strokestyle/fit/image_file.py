"""Read the file of a drawing: its pixels, upright and in sRGB, at a size to work at."""

from __future__ import annotations

import importlib
import struct
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from ..files import quoted
from .colours import to_srgb
from .layered_file import Layered, open_zip
from .psd_file import open_psd
from .raster import SPACES, Raster, of_pillow, shrunk, upright
from .tiff_file import pillow_reads, quiet_libtiff, read_pages, tiff_raster

MAX_PIXELS = 200_000_000
MIN_SIDE = 16  # px, of an image that something can be learned from
MIN_CLEAR = 0.4  # share of clear pixels; a clear margin round an opaque sheet is not its paper
WORKING = 2.0  # pixels of a reduced drawing for one of the view, at least
KINDS = "PNG, JPEG or TIFF"


@dataclass(frozen=True)
class Scan:
    """The pixels of a drawing's file.

    Parameters
    ----------
    rgba : (h, w, 4) float32 in [0, 1], straight, sRGB, upright
    transparent : whether its ground is what is clear in it
    width, height : px of the file, upright; h and w are these, or a whole number of times smaller
    notes : what of the file was not honoured, a line each
    """

    rgba: np.ndarray
    transparent: bool
    width: int
    height: int
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        if self.rgba.ndim != 3 or self.rgba.shape[2] != 4:
            raise ValueError(f"Scan.rgba must have shape (h, w, 4), got {self.rgba.shape}")


def read_image(
    path: str | Path, view: tuple[int, int] | None = None, layer: str | None = None
) -> Scan:
    """Read an image file.

    PNG, JPEG, TIFF and whatever else pillow reads, 8 or 16 bits, grey, palette, RGB, CMYK, with or
    without alpha; and files with layers: .kra, .ora, .psd and .psb. Colours are brought to sRGB by
    the file's profile. Warns, in a line each, of what of the file is not honoured.

    Parameters
    ----------
    path : of the file
    view : width and height of the view that it is for, px: a file of many times its pixels is
        reduced to no less than WORKING times its size; None leaves it as large as it is
    layer : name of the layer to read, whether it is shown or not; None for the merged picture

    Raises
    ------
    ValueError
        naming the file, where it is not an image, is cut short, too large or too small; or has no
        such layer.
    OSError
        where it cannot be read.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: a folder; expected an image of the drawing ({KINDS})")
    if path.stat().st_size == 0:
        raise ValueError(f"{path}: the file is empty; expected an image of the drawing ({KINDS})")
    try:
        with warnings.catch_warnings(), quiet_libtiff():
            warnings.simplefilter("ignore")
            scan = _scanned(path, view, layer)
        if min(scan.width, scan.height) < MIN_SIDE:
            raise ValueError(f"{scan.width} x {scan.height} pixels is too small to learn from")
    except Image.DecompressionBombError:
        raise ValueError(f"{path}: too many pixels for a drawing; scale it down") from None
    except (OSError, SyntaxError, EOFError, struct.error) as error:
        if isinstance(error, (FileNotFoundError, PermissionError)):
            raise
        raise ValueError(
            f"{path}: not a readable image ({_short(error)}); expected {KINDS}"
        ) from None
    except ValueError as error:
        raise ValueError(f"{path}: {_short(error)}") from None
    for note in scan.notes:
        warnings.warn(f"{path}: {note}", stacklevel=2)
    return scan


def _scanned(path: Path, view: tuple[int, int] | None, layer: str | None) -> Scan:
    """The pixels of an image file, reduced for a view."""
    with open(path, "rb") as stream:
        head = stream.read(64)
    refuse_other_kinds(head)
    layered = _layered(path, head)
    if layered is not None:
        check_size(layered.width, layered.height)
        raster = layered.raster(layer)
        check_size(raster.width, raster.height)
        return _laid_open(raster, (raster.width, raster.height), view)
    if layer is not None:
        raise ValueError(
            f"has no layers, so none named {quoted(layer)!r}; those of .kra, .ora, .psd and .psb "
            "are read"
        )
    if head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _scanned_tiff(path, view)
    return _scanned_by_pillow(path, view)


def _layered(path: Path, head: bytes) -> Layered | None:
    """A file with layers, by its head."""
    if head[:4] == b"PK\3\4":
        return open_zip(path)
    return open_psd(path) if head[:4] == b"8BPS" else None


def _scanned_tiff(path: Path, view: tuple[int, int] | None) -> Scan:
    """The first page of a TIFF that is no preview."""
    pages = read_pages(path)
    notes = (f"the first of its {len(pages)} pages is read",) if len(pages) > 1 else ()
    if pillow_reads(pages[0]):
        return _scanned_by_pillow(path, view, pages[0].number, notes)
    check_size(*pages[0].size)
    raster = tiff_raster(path, pages[0])
    raster = replace(raster, notes=(*notes, *raster.notes))
    return _laid_open(raster, (raster.width, raster.height), view)


def _scanned_by_pillow(
    path: Path, view: tuple[int, int] | None, page: int = 0, notes: tuple[str, ...] = ()
) -> Scan:
    with Image.open(path) as image:
        if page:
            image.seek(page)
        pictures = getattr(image, "n_frames", 1)
        if image.format not in ("TIFF", "MPO") and pictures > 1:
            notes = (f"the first of its {pictures} pictures is read",)
        size = image.size
        check_size(*size)
        halved = _factor(size, view) & -_factor(size, view)  # the power of 2 in it
        if image.format == "JPEG" and halved > 1:
            image.draft(image.mode, (size[0] // halved, size[1] // halved))
        image.load()
        return _laid_open(replace(of_pillow(image), notes=notes), size, view)


OTHER_KINDS = (
    (b"%PDF", "a PDF document"), (b"%!PS", "a PostScript document"), (b"<svg", "an SVG document"),
    (b"<?xml", "an XML document"), (b"gimp xcf", "GIMP's own file"), (b"CSFCHUNK", "a CLIP file"),
    (b"\xff\x0a", "a JPEG XL image"), (b"\0\0\0\x0cJXL ", "a JPEG XL image"),
)  # fmt: skip
HEIF_BRANDS = (b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1")


def refuse_other_kinds(head: bytes) -> None:
    """Raise ValueError, with what would do, on a file's head of a kind that is not read."""
    head = head.removeprefix(b"\xef\xbb\xbf").lstrip(b" \r\n\t") or head
    for start, name in OTHER_KINDS:
        if head.startswith(start):
            raise ValueError(f"{name}; export the drawing as {KINDS}")
    if head[4:8] == b"ftyp" and head[8:12] in HEIF_BRANDS and b"avif" not in head:
        try:
            importlib.import_module("pillow_heif").register_heif_opener()
        except ImportError:
            raise ValueError(
                f"a HEIC photograph; export it as {KINDS}, or `pip install pillow-heif`"
            ) from None


def check_size(width: int, height: int) -> None:
    """Raise ValueError where an image has more pixels than are read, or none."""
    if width * height > MAX_PIXELS:
        raise ValueError(
            f"{width} x {height} pixels is too large; scale it below "
            f"{MAX_PIXELS // 1_000_000} megapixels"
        )
    if min(width, height) < 1:
        raise ValueError(f"an image of {width} x {height} pixels")


def _factor(size: tuple[int, int], view: tuple[int, int] | None) -> int:
    """How many times smaller an image may be made for a view that may be turned against it."""
    if view is None:
        return 1
    return max(1, int(min(size) / (WORKING * max(view))))


def _laid_open(raster: Raster, size: tuple[int, int], view: tuple[int, int] | None) -> Scan:
    """Reduce a raster, bring its colours to sRGB, and stand it upright.

    `size` : of the file, which a decoder may have reduced already
    """
    image = shrunk(raster, _factor((raster.width, raster.height), view))
    alpha = image[..., -1:] if raster.alpha else np.ones_like(image[..., :1])
    rgb, note = to_srgb(image[..., : SPACES[raster.space]], raster)
    rgba = upright(np.concatenate([rgb, alpha], axis=-1), raster.orientation)
    width, height = size if raster.orientation < 5 else size[::-1]
    return Scan(
        np.ascontiguousarray(rgba),
        bool((alpha < 0.5).mean() > MIN_CLEAR),
        width,
        height,
        (*raster.notes, *([note] if note else [])),
    )


def _short(error: Exception) -> str:
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    if text.startswith("decoder error"):
        text = "its data are damaged or cut short"
    return text if len(text) < 160 else text[:157] + "..."
