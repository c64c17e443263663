"""Drawings as PDF (ISO 32000-1): paths stay paths, and images stay as fine as they are.

A PDF is made of the text of an SVG of ours, so that everything that writes one can have it as PDF.
"""

from __future__ import annotations

import io
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pydyf

from ..geometry.affine import IDENTITY, Affine, compose, determinant
from .format import INKSCAPE_NAMESPACE, MM_PER_PX
from .markup import numbers, units
from .path_data import length, page_length, parse_numbers, parse_path, parse_transform
from .read_elements import parse_share
from .read_texture import Budget, decoded, image_box, rgba
from .xml import SaxReader, css_property

POINT = 25.4 / 72  # mm
SLACK = 0.004  # points that a number may be off
LAYER = INKSCAPE_NAMESPACE + "}groupmode"
LABEL = INKSCAPE_NAMESPACE + "}label"
WORDS = {  # what a document says of itself, by the elements in which it stands
    "svg/title": "Title",
    "svg/desc": "Subject",
    "svg/metadata/RDF/Work/creator/Agent/title": "Author",
    "svg/metadata/RDF/Work/rights/Agent/title": "License",
}
CAPS = {"butt": 0, "round": 1, "square": 2}
JOINS = {"miter": 0, "round": 1, "bevel": 2}


def pdf_from_svg(text: str) -> bytes:
    """Draw SVG text of ours as a PDF of one page; the same text gives the same bytes.

    The page is as large as the SVG's, in whole or broken points; tones, outlines and lines are
    paths, images are images, layers are layers. Title, description, author and licence go with it.

    Raises
    ------
    ValueError
        where the text is no SVG, or holds shapes that no drawing of ours has.
    """
    page = _Page()
    page.walk(text.encode("utf-8"))
    return page.finished()


@dataclass(frozen=True)
class _Look:
    """What an element inherits: properties, by the names that CSS has for them."""

    fill: str = "#000000"
    stroke: str = "none"
    opacity: float = 1.0
    properties: Mapping[str, str] = field(default_factory=dict)
    scale: float = 1.0  # points a unit


INHERITED = (
    "fill-opacity", "fill-rule", "stroke-opacity", "stroke-width", "stroke-linecap",
    "stroke-linejoin", "stroke-miterlimit", "stroke-dasharray", "stroke-dashoffset",
)  # fmt: skip


class _Page:
    """A page in the making, as the elements of its SVG come by."""

    def __init__(self) -> None:
        self._xml = SaxReader(self._start, self._end, self._text)
        self._open: list[str] = []  # names of the elements that are open
        self._ends: list[list[str]] = []  # operators that end each of them
        self._looks = [_Look()]
        self._content: list[str] = []
        self._words: dict[str, str] = {}
        self._box = [0.0, 0.0, 0.0, 0.0]
        self._pdf = pydyf.PDF()
        self._states: dict[tuple[float, float], str] = {}
        self._images: list[pydyf.Stream] = []
        self._layers: list[pydyf.Dictionary] = []
        self._order: list[pydyf.Array] = [pydyf.Array()]  # of layers, one inside another
        self._budget = Budget(pixels=1 << 31)

    def walk(self, data: bytes) -> None:
        """Read an SVG. Raises ValueError."""
        self._xml.walk(data)

    # ------------------------------------------------------------------------------- the elements

    def _start(self, _: str, tag: str, attributes: dict[str, str]) -> None:
        self._open.append(tag)
        self._ends.append([])
        self._looks.append(self._inherited(attributes))
        if "metadata" in self._open or "defs" in self._open:
            if tag == "license":
                self._words["License"] = next(iter(attributes.values()), "")
            return
        if tag == "svg":
            self._begin_page(attributes)
        elif tag == "g":
            self._begin_group(attributes)
        elif tag == "path":
            self._draw_path(attributes)
        elif tag == "rect":
            x, y, width, height = image_box(attributes)
            self._draw_path(attributes | {"d": f"M{x} {y}h{width}v{height}h{-width}z"})
        elif tag == "image":
            self._draw_image(attributes)
        elif tag not in ("title", "desc"):
            raise ValueError("a PDF is made of drawings as strokestyle writes them: without this")

    def _end(self) -> None:
        ends = self._ends.pop()
        self._content += ends
        self._looks.pop()
        self._open.pop()
        if "EMC" in ends:
            self._order.pop()

    def _text(self, text: str) -> None:
        name = WORDS.get("/".join(self._open))
        if name:
            self._words[name] = self._words.get(name, "") + text

    def _inherited(self, attributes: dict[str, str]) -> _Look:
        above, style = self._looks[-1], attributes.get("style", "")

        def given(name: str) -> str:
            return css_property(name, style, attributes)

        transform = parse_transform(attributes.get("transform", ""))
        return replace(
            above,
            fill=given("fill") or above.fill,
            stroke=given("stroke") or above.stroke,
            opacity=above.opacity * parse_share(given("opacity"), 1.0),
            properties={**above.properties, **{k: v for k in INHERITED if (v := given(k))}},
            scale=above.scale * math.sqrt(abs(determinant(transform))),
        )

    def _begin_page(self, attributes: dict[str, str]) -> None:
        sides = [(page_length(attributes, name) or 0.0) for name in ("width", "height")]
        box = parse_numbers(attributes.get("viewBox", ""), "viewBox") or [0.0, 0.0, *sides]
        if len(box) != 4 or min(*sides, *box[2:]) <= 0:
            raise ValueError("a page without a size")
        across, down = (side * MM_PER_PX / POINT for side in sides)
        self._box = [0.0, 0.0, across, down]
        x, y = across / box[2], down / box[3]
        self._looks[-1] = replace(self._looks[-1], scale=math.sqrt(x * y))
        self._content.append(_matrix((x, 0.0, 0.0, -y, -x * box[0], down + y * box[1])))

    def _begin_group(self, attributes: dict[str, str]) -> None:
        if attributes.get(LAYER) == "layer":
            layer = pydyf.Dictionary(
                {"Type": "/OCG", "Name": pydyf.String(attributes.get(LABEL, "layer"))}
            )
            self._pdf.add_object(layer)
            inside = pydyf.Array()
            self._order[-1] += [layer.reference, inside]
            self._order.append(inside)
            self._content.append(f"/OC /L{len(self._layers)} BDC")
            self._ends[-1].append("EMC")
            self._layers.append(layer)
        self._begin_transform(attributes)

    def _begin_transform(self, attributes: dict[str, str]) -> None:
        transform = parse_transform(attributes.get("transform", ""))
        if transform != IDENTITY:
            self._content += ["q", _matrix(transform)]
            self._ends[-1].insert(0, "Q")

    # --------------------------------------------------------------------------- what is painted

    def _draw_path(self, attributes: dict[str, str]) -> None:
        look = self._looks[-1]
        paint = {(True, False): "f", (False, True): "S", (True, True): "B"}.get(
            (rgba(look.fill)[3] > 0, rgba(look.stroke)[3] > 0)
        )
        outline = path_operators(attributes.get("d", ""), _decimals(look.scale))
        if paint is None or not outline:
            return
        self._begin_transform(attributes)
        if look.properties.get("fill-rule") == "evenodd" and paint != "S":
            paint += "*"
        self._content += [*self._ink(look), outline, paint]

    def _ink(self, look: _Look) -> list[str]:
        """The operators that choose the colours, opacities and pen of a path."""
        given, made = look.properties, []
        fill, stroke = rgba(look.fill), rgba(look.stroke)
        opacity = [
            round(look.opacity * share * parse_share(given.get(f"{of}-opacity", ""), 1.0), 4)
            for of, share in (("fill", float(fill[3])), ("stroke", float(stroke[3])))
        ]
        if fill[3] > 0:
            made.append(f"{_color(fill)} rg")
        if stroke[3] > 0:
            made += [f"{_color(stroke)} RG", *_pen(given)]
        return [self._state(opacity[0], opacity[1]), *made]

    def _state(self, fill: float, stroke: float) -> str:
        """The operator that chooses opacities."""
        name = self._states.setdefault((fill, stroke), f"A{len(self._states)}")
        return f"/{name} gs"

    def _draw_image(self, attributes: dict[str, str]) -> None:
        look, picture = self._looks[-1], decoded(attributes, self._budget).convert("RGBA")
        x, y, width, height = image_box(attributes)
        at = compose(
            parse_transform(attributes.get("transform", "")),
            (width, 0.0, 0.0, -height, x, y + height),
        )
        self._content += ["q", self._state(round(look.opacity, 4), 1.0), _matrix(at)]
        self._content += [f"/I{len(self._images)} Do", "Q"]
        pixels = np.asarray(picture)
        mask, shown = _image(pixels[..., 3], "/DeviceGray"), _colored_image(pixels)
        self._pdf.add_object(mask)
        shown.extra["SMask"] = mask.reference
        self._pdf.add_object(shown)
        self._images.append(shown)

    # ------------------------------------------------------------------------------- the document

    def finished(self) -> bytes:
        """The PDF's bytes, once all is read."""
        pdf, content = self._pdf, pydyf.Stream([" ".join(self._content)], compress=True)
        pdf.add_object(content)
        states = {
            name: pydyf.Dictionary({"ca": fill, "CA": stroke})
            for (fill, stroke), name in self._states.items()
        }
        resources = {
            "ExtGState": pydyf.Dictionary(states),
            "XObject": _named("I", self._images),
            "Properties": _named("L", self._layers),
        }
        page = {
            "Type": "/Page",
            "Parent": pdf.pages.reference,
            "MediaBox": pydyf.Array(self._box),
            "Contents": content.reference,
            "Resources": pydyf.Dictionary({k: v for k, v in resources.items() if v}),
        }
        pdf.add_page(pydyf.Dictionary(page))
        if self._layers:
            every = pydyf.Array([layer.reference for layer in self._layers])
            order = pydyf.Dictionary({"Order": _without_empty(self._order[0])})
            pdf.catalog["OCProperties"] = pydyf.Dictionary({"OCGs": every, "D": order})
        for name, words in self._words.items():
            pdf.info[name] = pydyf.String(words)
        file = io.BytesIO()
        pdf.write(file)
        return file.getvalue()


# ----------------------------------------------------------------------------------- as PDF has it


def path_operators(d: str, decimals: int) -> str:
    """Path data as the operators that make the same path, its numbers with so many decimals."""
    made = []
    for subpath in parse_path(d):
        points = np.array(subpath, np.float64)
        thirds = (points[:, 6:] - points[:, :2]) / 3
        straight = (points[:, 2:4] == points[:, :2] + thirds).all(axis=1)
        straight &= (points[:, 4:6] == points[:, 6:] - thirds).all(axis=1)
        text = iter(numbers(units(np.r_[points[0, :2], points[:, 2:].ravel()], decimals), decimals))
        made.append(f"{next(text)} {next(text)} m")
        for is_line, (a, b, c, e, x, y) in zip(
            straight.tolist(), zip(*[text] * 6, strict=True), strict=True
        ):
            made.append(f"{x} {y} l" if is_line else f"{a} {b} {c} {e} {x} {y} c")
        if (points[-1, 6:] == points[0, :2]).all():
            made.append("h")
    return " ".join(made)


def _decimals(scale: float) -> int:
    """How many decimals of a unit, which is `scale` points, tell a place exactly enough."""
    return min(6, max(0, math.ceil(math.log10(max(scale, 1e-9) / (2 * SLACK)))))


def _matrix(matrix: Affine) -> str:
    return " ".join(f"{value:.6f}".rstrip("0").rstrip(".") for value in matrix) + " cm"


def _color(color: np.ndarray) -> str:
    return " ".join(f"{value:.4f}".rstrip("0").rstrip(".") for value in color[:3])


def _pen(given: Mapping[str, str]) -> list[str]:
    """The operators that choose a pen."""
    dashes = given.get("stroke-dasharray", "none").replace("none", "")
    return [
        f"{length(given.get('stroke-width', '1'), 'stroke-width', 0.0):g} w",
        f"{CAPS.get(given.get('stroke-linecap', ''), 0)} J",
        f"{JOINS.get(given.get('stroke-linejoin', ''), 0)} j",
        f"{length(given.get('stroke-miterlimit', '4'), 'stroke-miterlimit', 0.0):g} M",
        f"[{' '.join(f'{dash:g}' for dash in parse_numbers(dashes, 'stroke-dasharray'))}] "
        f"{length(given.get('stroke-dashoffset', '0'), 'stroke-dashoffset', 0.0):g} d",
    ]


def _image(samples: np.ndarray, space: str | pydyf.Array) -> pydyf.Stream:
    """An image (h, w) uint8 of a sample a pixel."""
    kind = {
        "Type": "/XObject", "Subtype": "/Image", "Width": samples.shape[1],
        "Height": samples.shape[0], "ColorSpace": space, "BitsPerComponent": 8,
        "Interpolate": "true", "Filter": "/FlateDecode",
    }  # fmt: skip
    return pydyf.Stream([zlib.compress(samples.tobytes(), 9)], kind)


def _colored_image(pixels: np.ndarray) -> pydyf.Stream:
    """The colours of pixels (h, w, 4) uint8 without their opacity: of one ink, one pixel.

    Where they are clear they have the mean colour: programs interpolate colour and opacity apart.
    """
    opacity = pixels[..., 3].astype(np.float64)
    mean = (pixels[..., :3] * opacity[..., None]).sum(axis=(0, 1)) / max(opacity.sum(), 1e-9)
    color = np.where(opacity[..., None] > 0, pixels[..., :3], np.rint(mean)).astype(np.int64)
    palette, place = np.unique(color @ [65536, 256, 1], return_inverse=True)
    if len(palette) > 256:
        raise ValueError("an image of more than 256 colours, which strokes' are not")
    table = "".join(f"{value:06x}" for value in palette.tolist())
    space = pydyf.Array(["/Indexed", "/DeviceRGB", len(palette) - 1, f"<{table}>"])
    shape = opacity.shape if len(palette) > 1 else (1, 1)
    return _image(place.reshape(-1)[: math.prod(shape)].reshape(shape).astype(np.uint8), space)


def _named(letter: str, objects: list) -> pydyf.Dictionary:
    """Objects by their names in the page's content."""
    return pydyf.Dictionary({f"{letter}{i}": one.reference for i, one in enumerate(objects)})


def _without_empty(order: pydyf.Array) -> pydyf.Array:
    """Layers, each followed by those in it where there are any."""
    kept = pydyf.Array()
    for one in order:
        if not isinstance(one, pydyf.Array):
            kept.append(one)
        elif one:
            kept.append(_without_empty(one))
    return kept
