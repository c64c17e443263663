"""Read a stroke's u-v strip off what its file draws: tones as paths, or an image.

docs/svg-format.md says how they are written.
"""

from __future__ import annotations

import base64
import binascii
import colorsys
import re
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageColor

from .. import files as limits
from ..drawing.ribbon import Ribbon, strip_points
from ..drawing.strip import straight
from ..geometry.affine import Affine, determinant, inverse, is_flat, transformed
from ..geometry.bezier import flatten
from ..geometry.polygons import winding_number
from .format import LIMITS
from .path_data import length, parse_path, parse_share
from .png import read_png

DENSITY = 1.5  # texels a px, of what is drawn in tones
MAX_PIXELS = LIMITS["image_pixels"].value
MAX_RINGS = LIMITS["rings"].value
CHORD = 0.05  # px between a curve and its chords
TONES = re.compile(r"(?:[Mm][-0-9 ]*q[-0-9 ]*t[-0-9 ]*z)+")  # path data as tones.py writes it
MAX_COLOR = 200  # characters of a colour that are looked at
_BESIDE_COLOR = re.compile(r"url\([^)]*\)(?!\s*(?:none)?$)|icc-color\([^)]*\)|\s*!\s*important")
_CALLED_COLOR = re.compile(r"(rgb|hsl)a?\(([^()]*)\)")
_COLOR_NUMBER = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]{1,3})?)(?:%|deg)?")
_PNG = re.compile(r"\s*data:image/png;base64,")  # other images, and elsewhere, are not looked at


@dataclass
class Budget:
    """What the textures of a file may take to read, of which LIMITS in format.py tells.

    Parameters
    ----------
    texels : of strips that are told or read off what is drawn
    pixels : of images
    looks : at a texel for a tone, and at a tone's edge at its height
    """

    texels: int = LIMITS["texels_read"].value
    pixels: int = LIMITS["pixels_read"].value
    looks: int = LIMITS["looks"].value

    def spend(self, what: str, amount: int) -> None:
        """Take an amount of `what`. Raises ValueError where less is left."""
        left = getattr(self, what) - amount
        if left < 0:
            raise ValueError(
                "the drawing's textures are too large or too intricate: simplify it first"
            )
        setattr(self, what, left)


@dataclass(frozen=True)
class Shape:
    """A path or an image inside a stroke.

    Parameters
    ----------
    tag : "path" or "image"
    attributes : of its element
    matrix : from its own coordinates to the stroke's
    fill, fill_opacity : of a path: CSS colour, and share in [0, 1]
    opacity : of all of it, share in [0, 1]
    """

    tag: str
    attributes: dict[str, str]
    matrix: Affine
    fill: str
    opacity: float
    fill_opacity: float = 1.0


def drawn_strip(shapes: list[Shape], band: Ribbon, move: Affine, budget: Budget) -> np.ndarray:
    """Look up what shapes show along a ribbon.

    Parameters
    ----------
    shapes : from the lowest to the uppermost
    band : the stroke's ribbon, before it was moved
    move : from there to the stroke's coordinates in the file
    budget : what is left of it

    Returns
    -------
    (n, A, 4) uint8, texels as `Texture` has them

    Raises
    ------
    ValueError
        on an image or a path that cannot be read, or where the budget is spent.
    """
    shapes = [shape for shape in shapes if _is_drawn(shape)]
    images = [
        decoded(shape.attributes, budget) if shape.tag == "image" else None for shape in shapes
    ]
    density = max(
        (_density(shape, image, move) for shape, image in zip(shapes, images, strict=True)),
        default=DENSITY,
    )
    rows, columns = (
        max(2, int(np.ceil(density * side))) for side in (band.length, 2.0 * band.half.max())
    )
    budget.spend("texels", rows * columns)
    color = np.zeros((rows, columns, 4))  # premultiplied
    points = transformed(move, strip_points(band, rows, columns))
    for shape, image in zip(shapes, images, strict=True):
        at = transformed(inverse(shape.matrix), points)
        if image is not None:
            over = shape.opacity * _sampled(np.asarray(image.convert("RGBA")), shape.attributes, at)
            color = over + (1.0 - over[..., 3:]) * color
        else:
            # in or out: half-tones at the edges would wear a region away each time that it is read
            # and contoured
            inside = covered(shape.attributes.get("d", ""), at.reshape(-1, 2), budget)
            inside = inside.reshape(rows, columns)
            share = shape.opacity * shape.fill_opacity
            color[inside] = share * np.r_[rgb(shape.fill), 1.0] + (1.0 - share) * color[inside]
    return np.rint(255 * np.clip(straight(color), 0, 1)).astype(np.uint8)


def covered(d: str, points: np.ndarray, budget: Budget) -> np.ndarray:
    """Tell which of the points (M, 2) path data fills by the nonzero rule, (M,) bool.

    Raises ValueError on bad path data, and where the budget is spent.
    """
    budget.spend("looks", len(points))
    is_tone = len(d) <= limits.MAX_TEXT and TONES.fullmatch(d)
    rings, offsets = _tone_rings(d) if is_tone else _rings(d)
    return winding_number(rings, points, offsets, lambda pairs: budget.spend("looks", pairs)) != 0


def _tone_rings(d: str) -> tuple[np.ndarray, np.ndarray]:
    """Polygons (n, 2) and their offsets of path data as tones.py writes it; two chords a curve."""
    if d.count("z") > MAX_RINGS or re.search("[0-9]{7}", d):
        return _rings(d)  # not ours: what is wrong with it is said there
    rings = [np.array(re.findall("-?[0-9]+", ring), np.float64) for ring in d.split("z")[:-1]]
    if any(len(ring) < 8 or len(ring) % 2 for ring in rings):
        return _rings(d)
    rings = [ring.reshape(-1, 2) for ring in rings]
    # pieces: less the jump and the first control point
    count = np.array([len(ring) for ring in rings]) - 2
    begin = np.cumsum([ring[0] for ring in rings], axis=0)  # a ring ends where it begins
    made, offsets = [], np.r_[0, np.cumsum(2 * count)]
    for ring, start in zip(rings, begin, strict=True):
        ends = start + np.cumsum(ring[2:], axis=0)
        sign = np.where(np.arange(len(ends)) % 2, -1.0, 1.0)[:, None]
        turned = np.concatenate([ring[1:2] + start, -2.0 * sign[:-1] * ends[:-1]]).cumsum(axis=0)
        control = sign * turned  # each is the one before it, reflected about the piece's end
        before = np.concatenate([start[None], ends[:-1]])
        made.append(np.stack([0.25 * (before + 2.0 * control + ends), ends], axis=1).reshape(-1, 2))
    return np.concatenate(made), offsets


def _rings(d: str) -> tuple[np.ndarray, np.ndarray]:
    """Polygons (n, 2) and their offsets of any path data. Raises ValueError where it is bad."""
    subpaths = parse_path(d)
    if not subpaths:
        return np.zeros((0, 2)), np.zeros(1, np.int64)
    cubics = np.concatenate([np.array(subpath).reshape(-1, 4, 2) for subpath in subpaths])
    return flatten(cubics, np.cumsum([0] + [len(subpath) for subpath in subpaths]), CHORD)


def decoded(attributes: dict[str, str], budget: Budget) -> Image.Image:
    """Decode the PNG in an image element.

    Raises ValueError where it is damaged or too large, or the budget is spent.
    """
    image = read_png(
        from_base64(_PNG.sub("", image_link(attributes)), "image"), MAX_PIXELS, "image"
    )
    budget.spend("pixels", image.width * image.height)
    return image


def from_base64(text: str, what: str) -> bytes:
    """Decode base64 with spaces in it. Raises ValueError, naming `what` it is, where it is none."""
    try:
        return base64.b64decode(re.sub(r"\s+", "", text), validate=True)
    except (binascii.Error, ValueError):
        raise ValueError(f"its {what} is no base64") from None


def image_link(attributes: dict[str, str]) -> str:
    """Give the link of an image, "" where it has none."""
    return attributes.get("http://www.w3.org/1999/xlink}href", attributes.get("href", ""))


def image_box(attributes: dict[str, str]) -> list[float]:
    """Read x, y, width and height of an image. Raises ValueError where one is no length."""
    return [length(attributes.get(name, "0"), name, 0.0) for name in ("x", "y", "width", "height")]


def has_external_image(shapes: list[Shape]) -> bool:
    """Tell whether the look of a stroke is in images only that are not looked at.

    Those are of another sort than PNG, or not in the file itself.
    """
    images = [shape for shape in shapes if shape.tag == "image"]
    return len(images) == len(shapes) > 0 and not any(
        _PNG.match(image_link(shape.attributes)) for shape in images
    )


def _is_drawn(shape: Shape) -> bool:
    """Whether anything of a shape is drawn that is in the file itself."""
    if is_flat(shape.matrix):
        return False
    if shape.tag == "path":
        return True
    in_file = _PNG.match(image_link(shape.attributes)) is not None
    return in_file and min(image_box(shape.attributes)[2:]) > 0


def _density(shape: Shape, image: Image.Image | None, move: Affine) -> float:
    """Texels a px of the ribbon that a shape is worth; `move` takes the ribbon to the file."""
    if image is None:
        return DENSITY
    pixels = np.sqrt(image.width * image.height / np.prod(image_box(shape.attributes)[2:]))
    scale = np.sqrt(abs(determinant(shape.matrix) / determinant(move)))
    return float(np.clip(pixels / max(scale, 1e-6), 0.5, 4.0))


def _sampled(image: np.ndarray, attributes: dict[str, str], at: np.ndarray) -> np.ndarray:
    """Look an image up at points (..., 2), bicubically; outside it is nothing.

    Keys 1981 ("Cubic convolution interpolation for digital image processing").

    Parameters
    ----------
    image : (h, w, 4) uint8, straight RGBA
    attributes : of its element, which place it
    at : (..., 2) in the element's coordinates

    Returns
    -------
    (..., 4) in [0, 1], premultiplied
    """
    x, y, width, height = image_box(attributes)
    row, vertical = _cubic((at[..., 1] - y) / height * image.shape[0] - 0.5, image.shape[0])
    column, across = _cubic((at[..., 0] - x) / width * image.shape[1] - 0.5, image.shape[1])
    places = row[..., :, None], column[..., None, :]
    weight = vertical[..., :, None] * across[..., None, :]
    ink = _one_ink(image.reshape(-1, 4))
    if ink is None:
        texel = image[places]
        ink = _one_ink(texel.reshape(-1, 4))
    if ink is not None:  # its opacity tells all
        alpha = image[..., 3].astype(np.float32) / np.float32(255)
        shown = np.einsum("...ij,...ij->...", alpha[places], weight)
        return np.clip(shown, 0.0, 1.0)[..., None] * np.r_[ink, 1.0]
    texel = texel.astype(np.float32) / np.float32(255)
    texel[..., :3] *= texel[..., 3:]
    color = np.clip((texel * weight[..., None]).sum(axis=(-3, -2)), 0.0, 1.0)
    return np.minimum(color, color[..., 3:])


def _cubic(at: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The four pixels (..., 4) that a place (...) between pixels is told from, and their weights.

    The weights (..., 4) float32 are 0 for pixels outside.
    """
    first = np.floor(np.clip(at, -3.0, size + 2.0))
    t = np.clip(at - first, 0.0, 1.0).astype(np.float32)
    weight = np.stack([
        ((2.0 - t) * t - 1.0) * t,
        (3.0 * t - 5.0) * t * t + 2.0,
        ((4.0 - 3.0 * t) * t + 1.0) * t,
        (t - 1.0) * t * t,
    ], axis=-1)  # fmt: skip
    place = first.astype(np.int64)[..., None] + np.arange(-1, 3)
    inside = (place >= 0) & (place < size)
    return np.where(inside, place, 0), np.where(inside, 0.5 * weight, 0.0)


def _one_ink(texels: np.ndarray) -> np.ndarray | None:
    """The one colour (3,) in [0, 1] of straight RGBA texels (n, 4) uint8.

    None where they have more, or none.
    """
    ink = texels[texels[:, 3] > 0, :3]
    return ink[0] / 255.0 if len(ink) and (ink == ink[0]).all() else None


def rgb(fill: str) -> np.ndarray:
    """Read a CSS colour as (r, g, b) in [0, 1]; black where it is none that we know."""
    return rgba(fill)[:3]


def rgba(fill: str) -> np.ndarray:
    """Read a CSS colour as (r, g, b, opacity) in [0, 1]; black where it is none that we know.

    Of `url(#gradient) red`, or `red icc-color(name, 0, 1)`, that is red; `none` is clear.
    """
    name = _BESIDE_COLOR.sub("", fill[:MAX_COLOR].lower()).strip()
    if name in ("none", "transparent"):
        return np.zeros(4)
    called = _CALLED_COLOR.fullmatch(name)
    try:
        if called:
            return np.clip(_called_color(called[1], called[2]), 0.0, 1.0)
        return np.array(ImageColor.getcolor(name, "RGBA"), np.float64) / 255.0
    except ValueError:
        return np.array([0.0, 0.0, 0.0, 1.0])


def _called_color(function: str, arguments: str) -> tuple[float, ...]:
    """(r, g, b, opacity) of `rgb` or `hsl`, perhaps beyond [0, 1]. Raises ValueError.

    Old and new notation: `rgb(255, 0, 0)`, `rgb(100% 0% 0% / 50%)`, `hsl(120deg 100% 50%)`.
    """
    words = re.split(r"\s*[\s,/]\s*", arguments.strip())
    values = [_COLOR_NUMBER.fullmatch(word) for word in words[:3]]
    if len(words) not in (3, 4) or not all(values):
        raise ValueError("no colour")
    opacity = parse_share(words[3], 1.0) if len(words) == 4 else 1.0
    numbers = [float(value[1]) for value in values if value]
    if function == "rgb":
        whole = [100.0 if word.endswith("%") else 255.0 for word in words]
        return *(v / of for v, of in zip(numbers, whole, strict=False)), opacity
    hue, saturation, lightness = numbers
    shares = (min(max(share / 100.0, 0.0), 1.0) for share in (lightness, saturation))
    return *colorsys.hls_to_rgb(hue / 360.0 % 1.0, *shares), opacity
