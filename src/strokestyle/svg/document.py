"""An SVG document: page and layers."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from urllib.parse import quote

from .. import __version__
from .format import FORMAT, MM_PER_PX, PART_CLASS, Data, SvgOptions, page_size_mm
from .markup import Element, number, printable


@dataclass(frozen=True)
class Page:
    """A page: its sides in mm, and the box of user units that it shows, "x y width height"."""

    width: float
    height: float
    box: str

    @classmethod
    def of_canvas(cls, size: tuple[int, int], options: SvgOptions) -> Page:
        """The page for a canvas (width, height), whose pixels are user units.

        The canvas itself, or the canvas fitted into a page of another size and centred.
        """
        width, height = size
        sides = page_size_mm(options.page_size, size)
        if sides is None:
            return cls(width * MM_PER_PX, height * MM_PER_PX, f"0 0 {width} {height}")
        scale = min(sides[0] / width, sides[1] / height)  # mm a pixel
        across, down = sides[0] / scale, sides[1] / scale
        box = (-0.5 * (across - width), -0.5 * (down - height), across, down)
        return cls(*sides, " ".join(number(v, 4) for v in box))

    @classmethod
    def in_mm(cls, size: tuple[int, int], options: SvgOptions) -> Page:
        """The page for a canvas (width, height), with millimetres as user units."""
        page = cls.of_canvas(size, options)
        box = f"0 0 {number(page.width, 4)} {number(page.height, 4)}"
        return cls(page.width, page.height, box)


def document(
    content: Sequence[Element],
    page: Page,
    options: SvgOptions,
    data: dict[str, str] | None = None,
    effects: Sequence[Element] = (),
) -> str:
    """Give the text of a whole file.

    Parameters
    ----------
    content : layers or strokes, in painting order
    data : attributes of the root besides, as `drawing_data` gives them for a file that is to be
        read back
    effects : Inkscape's path effects, which paths in `content` name
    """
    from .tree import Document  # svgwrite takes 50 ms to import

    root = {
        "width": number(page.width, 4) + "mm",
        "height": number(page.height, 4) + "mm",
        "viewBox": page.box,
        Data.FORMAT: str(FORMAT),
        Data.GENERATOR: f"strokestyle {__version__}",
    }
    made = Document(root | (data or {}))
    made.describe(options)
    if options.background is not None:
        made.add_paper(page.box, options.background)
    made.add_effects(effects)
    for element in content:
        made.add_element(element)
    return made.text()


def drawing_data(
    size: tuple[int, int], page: Page, options: SvgOptions, parts: Sequence[str]
) -> dict[str, str]:
    """What the root says of a drawing, so that it can be read back.

    `parts` are the shape's, in painting order.
    """
    data = {
        Data.SIZE: f"{size[0]} {size[1]}",
        Data.PAGE: page.box,
        Data.OPTIONS: options.to_text(),
    }
    if options.texture == "image":
        # the default of other programs; resvg takes three times as long for its own
        data["style"] = "image-rendering:smooth"
    if parts:
        data[Data.PARTS] = " ".join(quote(name, safe="") for name in parts)
    return data


@dataclass(frozen=True)
class LayerItem:
    """The element of a stroke or a curve, its kind, and the part that it is of, "" for none."""

    element: Element
    kind: str
    part: str = ""

    def place(self, layers: str) -> tuple[str, str]:
        """The (part, kind) of its outer layer."""
        return outer_layer(self.kind, self.part, layers)


def outer_layer(kind: str, part: str, layers: str) -> tuple[str, str]:
    """Give the (part, kind), one of them "", of the outer layer of a line."""
    return (part, "" if part else kind) if layers == "part" else ("", kind)


def layered(
    items: Sequence[LayerItem],
    layers: str,
    style: dict[str, str] | None = None,
    prefix: str = "",
    numbered: bool = False,
) -> list[Element]:
    """Put items, which lie in painting order, in Inkscape layers.

    Parameters
    ----------
    layers : "kind" or "part", as in SvgOptions; where there are parts, what is of none lies in a
        layer of its kind
    style : attributes of the outer layers
    prefix : of the names of kinds
    numbered : labels of the outer layers begin with 1, 2 ...
    """
    slugs, outer = _slugs({item.part for item in items}), []
    for n, (place, members) in enumerate(groupby(items, lambda item: item.place(layers)), 1):
        part, kind = place
        if part:
            name, of, label = f"part-{slugs[part]}", PART_CLASS, part
        else:
            name, of, label = f"layer-{prefix}{kind}", prefix + kind, prefix + kind
        label = f"{n} {label}" if numbered else label
        inside = _inner_layers(members, place, f"layer-{prefix}", slugs)
        outer.append(_layer(name, of, label, style or {}, inside))
    return outer


def _inner_layers(
    members: Iterable[LayerItem], place: tuple[str, str], prefix: str, slugs: dict[str, str]
) -> list[Element]:
    """What lies in an outer layer: items of its (part, kind), and layers of those of another."""
    inside: list[Element] = []
    for (part, kind), mine in groupby(members, lambda item: (item.part, item.kind)):
        elements = [item.element for item in mine]
        name = f"{prefix}{kind}-{slugs[part]}"
        if (part, kind) == place:
            inside += elements
        elif place[0]:
            inside.append(_layer(name, kind, kind, {}, elements))
        else:  # its label may hold the name of another kind
            inside.append(_layer(name, PART_CLASS, part, {Data.CLASS: kind}, elements))
    return inside


def _layer(
    name: str, of: str, label: str, more: dict[str, str], content: Sequence[Element]
) -> Element:
    given = {"id": name, "class": of, "inkscape:groupmode": "layer"}
    return Element("g", given | {"inkscape:label": printable(label)} | more, tuple(content))


def _slugs(parts: set[str]) -> dict[str, str]:
    """What ids are made of for the names of parts: each another, but for "" which has none."""
    slugs, used = {"": ""}, set()
    last: dict[str, int] = {}
    for part in sorted(parts - {""}):
        letters = unicodedata.normalize("NFKD", part).encode("ascii", "ignore").decode()
        short = re.sub(r"[^A-Za-z0-9_.]+", "-", letters)[:40].strip("-") or "unnamed"
        slug = short
        while slug in used:
            last[short] = last.get(short, 1) + 1
            slug = f"{short}-{last[short]}"
        slugs[part] = slug
        used.add(slug)
    return slugs
