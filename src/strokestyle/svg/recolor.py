"""Give strokes another ink as they are drawn in a file, so that their shapes do not wear.

A texture that is read off what is drawn and drawn anew is a little softer each time.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from ..drawing.edit import recoloring
from ..drawing.strokes import Drawing
from .format import LIMITS, Data
from .kept import DrawnStroke
from .markup import Element, hex_color
from .png import encode_png, read_png
from .read_texture import from_base64, rgb

MAX_COLORS = 256  # of an image with a palette
_PNG = "data:image/png;base64,"

Recoloring = Callable[[np.ndarray], np.ndarray]  # (..., 3) uint8 -> (..., 3) uint8


def recolored_strokes(
    drawn: Mapping[int, DrawnStroke],
    before: Drawing,
    color: tuple[float, float, float],
    only: Iterable[int],
) -> dict[int, DrawnStroke]:
    """Recolour strokes as they are drawn, as `recolor` does their textures.

    Those of an image of too many colours are left out.

    Parameters
    ----------
    drawn : by the index of the stroke
    before : the drawing that they are of
    color : (r, g, b) in [0, 1]
    only : indices of the strokes that are given it
    """
    made = {}
    for i in only:
        if i not in drawn:
            continue
        element = drawn[i].element
        given = element.attributes | {"fill": hex_color(color)}
        children: list[Element | None] = []
        if element.children and before.texture is not None:
            new = recoloring(before, i, color)
            children = [
                _recolored(child, element, given["fill"], new) for child in element.children
            ]
            if Data.TEXTURE in given:
                strip = _recolored_png(given[Data.TEXTURE].split(",", 1)[-1], new)
                given[Data.TEXTURE] = strip or ""
        kept = tuple(child for child in children if child is not None)
        if len(kept) == len(element.children) and given.get(Data.TEXTURE) != "":
            element = replace(element, attributes=given, children=kept)
            made[i] = replace(drawn[i], element=element)
    return made


def _recolored(child: Element, stroke: Element, ink: str, new: Recoloring) -> Element | None:
    """A tone or an image of a stroke that is given an `ink`; None where that cannot be."""
    given = dict(child.attributes)
    if child.tag == "path":
        was = rgb(given.pop("fill", stroke.attributes["fill"]))
        fill = hex_color(new(np.rint(255 * was)) / 255.0)
        return replace(child, attributes=given if fill == ink else {"fill": fill} | given)
    png = _recolored_png(given["xlink:href"].removeprefix(_PNG), new)
    return None if png is None else replace(child, attributes=given | {"xlink:href": _PNG + png})


def _recolored_png(text: str, new: Recoloring) -> str | None:
    """A PNG in base64 in other colours; None where these are too many for a palette.

    One of grey is opacity alone.
    """
    image = read_png(from_base64(text, "image"), LIMITS["image_pixels"].value, "image")
    if image.mode in ("1", "L") and "transparency" not in image.info:
        return text
    pixels = np.ascontiguousarray(image.convert("RGBA"))
    values, place = np.unique(pixels.view("<u4")[..., 0], return_inverse=True)
    if len(values) > MAX_COLORS:
        return None
    palette = values[:, None].view(np.uint8).copy()
    palette[:, :3] = new(palette[:, :3])
    png = encode_png(place.reshape(pixels.shape[:2]).astype(np.uint8), palette)
    return base64.b64encode(png).decode("ascii")
