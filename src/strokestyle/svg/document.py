"""An SVG document: page, layers, metadata."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from itertools import groupby
from urllib.parse import quote

from .. import __version__
from .format import FORMAT, LICENSES, MM_PER_PX, NAMESPACES, RDF, Data, SvgOptions, page_size_mm
from .markup import element, number, words


def document(
    content: str,
    size: tuple[int, int],
    options: SvgOptions,
    ours: bool = False,
    mm: bool = False,
    parts: tuple[str, ...] = (),
) -> str:
    """The whole file.

    Parameters
    ----------
    content : the markup of layers and strokes
    ours : the file is to be read back
    mm : that is its user unit
    parts : the names of the shape's parts, in painting order
    """
    width, height = size
    page = page_size_mm(options.page_size, size)
    if page is None:
        page, box = (width * MM_PER_PX, height * MM_PER_PX), f"0 0 {width} {height}"
    else:
        scale = min(page[0] / width, page[1] / height)  # mm a pixel
        across, down = page[0] / scale, page[1] / scale
        box = " ".join(
            number(v, 4) for v in (-0.5 * (across - width), -0.5 * (down - height), across, down)
        )
    if mm:
        box = f"0 0 {number(page[0], 4)} {number(page[1], 4)}"
    root = {
        **NAMESPACES,
        "version": "1.1",
        "width": number(page[0], 4) + "mm",
        "height": number(page[1], 4) + "mm",
        "viewBox": box,
        Data.FORMAT: str(FORMAT),
        Data.GENERATOR: f"strokestyle {__version__}",
    }
    if ours and options.texture == "image":
        root["style"] = (
            "image-rendering:smooth"  # the default of other programs; resvg takes three times as long for its own
        )
    if ours:
        root |= {
            Data.SIZE: f"{width} {height}",
            Data.PAGE: box,
            Data.OPTIONS: options.to_text(),
        }
    if parts:
        root[Data.PARTS] = " ".join(quote(name, safe="") for name in parts)
    head = ""
    if options.title:
        head += element("title", {}, words(options.title))
    if options.description:
        head += element("desc", {}, words(options.description))
    if options.license or options.author:
        head += _metadata(options)
    if options.background is not None:
        x, y, across, down = box.split()
        sides = {"x": x, "y": y} if (x, y) != ("0", "0") else {}
        head += element(
            "rect",
            {"id": "paper", **sides, "width": across, "height": down, "fill": options.background},
        )
    return (
        '<?xml version="1.0" encoding="utf-8"?>'
        + element("svg", root, head + content + "\n")
        + "\n"
    )


@dataclass(frozen=True)
class LayerItem:
    """The markup of a stroke or a curve, its kind, and the part of the shape that it belongs to, "" for none."""

    markup: str
    kind: str
    part: str = ""


def layered(
    marks: list[LayerItem],
    layers: str,
    style: dict[str, str] | None = None,
    prefix: str = "",
    numbered: bool = False,
) -> str:
    """Marks, which lie in painting order, in Inkscape layers.

    Parameters
    ----------
    layers : "kind" or "part", as in SvgOptions; where there are parts, what is of none lies in a layer of its kind
    style : attributes of the outer layers
    prefix : of the names of kinds
    numbered : labels of the outer layers begin with 1, 2 ...
    """
    slugs, content = _slugs({mark.part for mark in marks}), []

    def outer(mark):
        return (mark.part, "" if mark.part else mark.kind) if layers == "part" else ("", mark.kind)

    for n, (place, members) in enumerate(groupby(marks, outer), 1):
        inside = []
        for (part, kind), mine in groupby(members, lambda mark: (mark.part, mark.kind)):
            markup = "".join(mark.markup for mark in mine)
            name = f"layer-{prefix}{kind}-{slugs[part]}"
            if (part, kind) == place:
                inside.append(markup)
            elif layers == "part":
                inside.append(_layer(name, kind, kind, {}, markup))
            else:  # its label may hold the name of another kind
                inside.append(_layer(name, "part", part, {Data.CLASS: kind}, markup))
        part, kind = place
        name, of, label = f"part-{slugs[part]}", "part", part
        if not part:
            name, of, label = f"layer-{prefix}{kind}", prefix + kind, prefix + kind
        content.append(
            _layer(name, of, f"{n} {label}" if numbered else label, style or {}, "".join(inside))
        )
    return "".join(content)


def _layer(name: str, of: str, label: str, more: dict[str, str], content: str) -> str:
    given = {"id": name, "class": of, "inkscape:groupmode": "layer", "inkscape:label": label}
    return element("g", given | more, content)


def _slugs(parts: set[str]) -> dict[str, str]:
    """What ids are made of for the names of parts: each another, but for "" which has none."""
    slugs, used, last = {"": ""}, set(), {}
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


def _metadata(options: SvgOptions) -> str:
    """Author and licence as Creative Commons has them in RDF, where Inkscape looks for them."""
    work = element("dc:format", {}, "image/svg+xml")
    if options.title:
        work += element("dc:title", {}, words(options.title))
    if options.author:
        work += element(
            "dc:creator",
            {},
            element("cc:Agent", {}, element("dc:title", {}, words(options.author))),
        )
    url = LICENSES.get(options.license.upper(), options.license)
    if re.fullmatch(r"https?://\S+", url):
        work += element("cc:license", {"rdf:resource": url})
    elif options.license:
        work += element(
            "dc:rights",
            {},
            element("cc:Agent", {}, element("dc:title", {}, words(options.license))),
        )
    return element(
        "metadata", {}, element("rdf:RDF", RDF, element("cc:Work", {"rdf:about": ""}, work))
    )
