"""How an SVG file is written, as data: its options; and what stands round the strokes: page, layers, licence."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass, fields
from itertools import groupby
from urllib.parse import quote, unquote

from .. import __version__
from .markup import element, number, words

FORMAT = 3
MM_PER_PX = 25.4 / 96.0  # CSS pixels
TEXTURES = ("auto", "vector", "image", "none")
MOST_TONES = 8
LAYERS = ("kind", "part", "none")
PAPERS = {  # mm, upright
    "A0": (841, 1189), "A1": (594, 841), "A2": (420, 594), "A3": (297, 420), "A4": (210, 297), "A5": (148, 210),
    "A6": (105, 148), "LETTER": (215.9, 279.4), "LEGAL": (215.9, 355.6), "TABLOID": (279.4, 431.8),
}  # fmt: skip
UNITS = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "px": MM_PER_PX}
LICENSES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    **{
        f"CC-{terms.upper()}-4.0": f"https://creativecommons.org/licenses/{terms}/4.0/"
        for terms in ("by", "by-sa", "by-nd", "by-nc", "by-nc-sa", "by-nc-nd")
    },
}
NAMESPACES = {
    "xmlns": "http://www.w3.org/2000/svg",
    "xmlns:xlink": "http://www.w3.org/1999/xlink",
    "xmlns:inkscape": "http://www.inkscape.org/namespaces/inkscape",
}
RDF = {
    "xmlns:rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "xmlns:cc": "http://creativecommons.org/ns#",
    "xmlns:dc": "http://purl.org/dc/elements/1.1/",
}


@dataclass(frozen=True)
class SvgOptions:
    """How a drawing is written as SVG.

    Parameters
    ----------
    texture : "none": a filled outline per stroke in its flat ink. "vector": the texture in a few tones, as paths.
        "image": a raster of each stroke. "auto": vector for grain in one ink, image for soft or coloured texture, else
        none.
    tones : how many, 1 to 8, of "vector"
    texture_res : pixels of those rasters per pixel of the drawing
    decimals : of every coordinate
    tolerance : pixels between an outline and the exact one
    layers : "kind", one group (an Inkscape layer) per line kind, and in it one for each named part of the shape;
        "part", one per part, and in it one for each kind; "none", the strokes lie in the root, in painting order
    title, description, author : words about the drawing
    license : the name of a Creative Commons licence (LICENSES), a URL, or other words
    background : "#rrggbb" or a CSS colour's name for a rectangle behind everything; None leaves the page clear
    page_size : a name of PAPERS, turned as the canvas lies, or "WxHmm" (cm, in, pt, px); the canvas is fitted into it
        and centred. None: the canvas, at 96 pixels an inch
    inkscape_lpe : flat strokes are PowerStrokes besides: other programs show our outline, Inkscape edits the widths
    plotter : centre lines only, in mm; nothing can be read back from such a file

    Raises
    ------
    ValueError
        on a name that is not known, or a number that makes no picture.
    """

    texture: str = "auto"
    tones: int = 3
    texture_res: float = 1.75
    decimals: int = 2
    tolerance: float = 0.1
    layers: str = "kind"
    title: str = ""
    description: str = ""
    author: str = ""
    license: str = ""
    background: str | None = None
    page_size: str | None = None
    inkscape_lpe: bool = False
    plotter: bool = False

    def __post_init__(self):
        if self.texture not in TEXTURES:
            raise ValueError(f"texture must be one of {', '.join(TEXTURES)}, got {self.texture!r}")
        if not 1 <= self.tones <= MOST_TONES:
            raise ValueError(f"tones must lie between 1 and {MOST_TONES}, got {self.tones}")
        if not 0.1 <= self.texture_res <= 16:
            raise ValueError(f"the texture's resolution must lie between 0.1 and 16 px per px, got {self.texture_res}")
        if not 0 <= self.decimals <= 6:
            raise ValueError(f"decimals must lie between 0 and 6, got {self.decimals}")
        if not 0 < self.tolerance <= 100:
            raise ValueError(f"the tolerance of an outline must lie above 0 and below 100 px, got {self.tolerance}")
        if self.layers not in LAYERS:
            raise ValueError(f"layers must be one of {', '.join(LAYERS)}, got {self.layers!r}")
        if self.background is not None:
            check_color(self.background)
        if self.inkscape_lpe and self.texture not in ("none", "auto"):
            raise ValueError("PowerStrokes are flat: write them with texture none")
        paper(self.page_size, (1, 1))

    def to_text(self) -> str:
        """What no element tells, as `data-ss-options`."""
        return " ".join(f"{name}={quote(str(getattr(self, name)), safe='#')}" for name in WRITTEN if self._given(name))

    def _given(self, name: str) -> bool:
        return getattr(self, name) != DEFAULTS[name] or name == "texture"

    @classmethod
    def from_text(cls, text: str, **known) -> SvgOptions:
        """The options that `to_text` wrote; names and values that this version does not know are left out."""
        types = {
            "texture_res": float,
            "tolerance": float,
            "decimals": int,
            "tones": int,
            "inkscape_lpe": _flag,
            "plotter": _flag,
        }
        for name, _, value in (part.partition("=") for part in text[:4000].split()):
            if name in WRITTEN:
                try:
                    cls(**{name: types.get(name, str)(unquote(value))})
                except ValueError:
                    continue
                known[name] = types.get(name, str)(unquote(value))
        return cls(**known)


def _flag(text: str) -> bool:
    return text == "True"


ELSEWHERE = ("title", "description", "author", "license")  # told by elements of their own
WRITTEN = tuple(field.name for field in fields(SvgOptions) if field.name not in ELSEWHERE)
DEFAULTS = {field.name: field.default for field in fields(SvgOptions)}


def check_color(text: str) -> None:
    """Raise ValueError unless `text` is #rgb, #rrggbb or a word, as the names of CSS colours are."""
    if not re.fullmatch(r"#[0-9a-fA-F]{3}|#[0-9a-fA-F]{6}|[a-zA-Z]{1,30}", text):
        raise ValueError(f"a colour is #rrggbb or a name such as ivory, got {text!r}")


def paper(name: str | None, size: tuple[int, int]) -> tuple[float, float] | None:
    """A page size as (width, height) in mm, for a canvas of `size`; None stays None. Raises ValueError."""
    if name is None:
        return None
    if name.upper() in PAPERS:
        short, long = PAPERS[name.upper()]
        return (long, short) if size[0] > size[1] else (short, long)
    match = re.fullmatch(r"([0-9]+\.?[0-9]*)x([0-9]+\.?[0-9]*)(mm|cm|in|pt|px)", name.strip().lower())
    page = tuple(float(value) * UNITS[match[3]] for value in match.groups()[:2]) if match else (0.0, 0.0)
    if not all(1.0 <= side <= 100_000 for side in page):
        names = ", ".join(key.title() for key in PAPERS)
        raise ValueError(f"a page size is one of {names}, or for instance 210x297mm; got {name!r}")
    return page


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
    page = paper(options.page_size, size)
    if page is None:
        page, box = (width * MM_PER_PX, height * MM_PER_PX), f"0 0 {width} {height}"
    else:
        scale = min(page[0] / width, page[1] / height)  # mm a pixel
        across, down = page[0] / scale, page[1] / scale
        box = " ".join(number(v, 4) for v in (-0.5 * (across - width), -0.5 * (down - height), across, down))
    if mm:
        box = f"0 0 {number(page[0], 4)} {number(page[1], 4)}"
    root = {
        **NAMESPACES,
        "version": "1.1",
        "width": number(page[0], 4) + "mm",
        "height": number(page[1], 4) + "mm",
        "viewBox": box,
        "data-ss-format": str(FORMAT),
        "data-ss-generator": f"strokestyle {__version__}",
    }
    if ours and options.texture == "image":
        root["style"] = (
            "image-rendering:smooth"  # the default of other programs; resvg takes three times as long for its own
        )
    if ours:
        root |= {"data-ss-size": f"{width} {height}", "data-ss-page": box, "data-ss-options": options.to_text()}
    if parts:
        root["data-ss-parts"] = " ".join(quote(name, safe="") for name in parts)
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
        head += element("rect", {"id": "paper", **sides, "width": across, "height": down, "fill": options.background})
    return '<?xml version="1.0" encoding="utf-8"?>' + element("svg", root, head + content + "\n") + "\n"


@dataclass(frozen=True)
class Mark:
    """The markup of a stroke or a curve, its kind, and the part of the shape that it belongs to, "" for none."""

    markup: str
    kind: str
    part: str = ""


def layered(
    marks: list[Mark], layers: str, style: dict[str, str] | None = None, prefix: str = "", numbered: bool = False
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
                inside.append(_layer(name, "part", part, {"data-ss-class": kind}, markup))
        part, kind = place
        name, of, label = f"part-{slugs[part]}", "part", part
        if not part:
            name, of, label = f"layer-{prefix}{kind}", prefix + kind, prefix + kind
        content.append(_layer(name, of, f"{n} {label}" if numbered else label, style or {}, "".join(inside)))
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
        work += element("dc:creator", {}, element("cc:Agent", {}, element("dc:title", {}, words(options.author))))
    url = LICENSES.get(options.license.upper(), options.license)
    if re.fullmatch(r"https?://\S+", url):
        work += element("cc:license", {"rdf:resource": url})
    elif options.license:
        work += element("dc:rights", {}, element("cc:Agent", {}, element("dc:title", {}, words(options.license))))
    return element("metadata", {}, element("rdf:RDF", RDF, element("cc:Work", {"rdf:about": ""}, work)))
