"""Drawing -> SVG that illustrators keep working in. docs/svg-format.md says what its attributes mean."""

from __future__ import annotations

import base64
import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import resvg_py

from .curves import KINDS, Curves, arc_length, simplify
from .files import write_bytes
from .outlines import outlines
from .painting import stroke_pixels
from .palette import palette_png
from .ribbons import ribbon_outlines
from .strokes import Drawing, paint_order
from .svg_page import SvgOptions, document, layer
from .svg_text import element, hex_color, number, numbers, polyline_path, rings_path, units

PATH_SLACK = 0.04  # px a centre line may be off where data-ss-path leaves points out
CLIP_SLACK = 0.5  # px, the least tolerance of a clip: its edge lies where the texture is clear
WIDTH_SLACK = 0.004  # px a width may be off where data-ss-width leaves points out


def write_svg(drawing: Drawing, options: SvgOptions | None = None, **changes) -> str:
    """The drawing as SVG text; the same drawing gives the same text.

    `changes` are fields of SvgOptions, in place of those of `options`. Raises ValueError on options that do not hold.
    """
    options = replace(options or SvgOptions(), **changes)
    if options.texture == "auto" or drawing.texture is None:
        options = replace(options, texture="none" if drawing.texture is None else "image")
    order = paint_order(drawing.strokes)
    make = {"none": _flat, "image": _images}[options.texture]
    layers, digits = {}, max(3, len(str(max(len(order) - 1, 0))))
    for place, (i, (tag, attributes, content)) in enumerate(
        zip(order.tolist(), make(drawing, options, order), strict=True)
    ):
        name = f"s{place:0{digits}d}"
        stroke = {"id": name, "class": "stroke", **_data(drawing, i, options.decimals), **attributes}
        kind = KINDS[drawing.strokes.kind[i]] if options.layers == "kind" else ""
        layers.setdefault(kind, []).append(element(tag, stroke, content))
    content = "".join(layer(kind, "".join(inside)) if kind else "".join(inside) for kind, inside in layers.items())
    return document(content, drawing.size, options, {})


def save_svg(path: str | Path, drawing: Drawing, options: SvgOptions | None = None, **changes) -> None:
    """`write_svg` to a file, whole or not at all; compressed where its suffix is .svgz. Raises OSError, naming it."""
    write_text(path, write_svg(drawing, options, **changes))


def write_text(path: str | Path, text: str) -> None:
    """SVG text to an .svg or .svgz file, whole or not at all."""
    data = text.encode("utf-8")
    if str(path).lower().endswith(".svgz"):
        data = gzip.compress(data, 9, mtime=0)
    write_bytes(path, data)


def plain_svg(
    curves: Curves,
    size: tuple[int, int],
    *,
    decimals: int = 2,
    title: str = "",
    description: str = "",
    background: str | None = None,
    hidden: Curves | None = None,
) -> str:
    """Plain curves as SVG text: black lines 1 px wide, one path a curve, one Inkscape layer per line kind.

    Those that are `hidden` are thin and dashed, on layers of their own beneath: hidden-contour and so on.
    """
    options = SvgOptions(decimals=decimals, title=title, description=description, background=background)
    pen = {"fill": "none", "stroke": "#000000", "stroke-width": "1", "stroke-linecap": "round"}
    pen["stroke-linejoin"] = "round"
    content = ""
    if hidden is not None and len(hidden):
        dashes = pen | {"stroke-width": "0.5", "stroke-linecap": "butt", "stroke-dasharray": "4 2.5"}
        for kind, paths in _plain_paths(hidden, "h", decimals).items():
            content += layer(f"hidden-{kind}", paths, dashes | {"data-ss-hidden": "1"})
    for kind, paths in _plain_paths(curves, "k", decimals).items():
        content += layer(kind, paths, pen)
    return document(content, size, options)


def _plain_paths(curves: Curves, letter: str, decimals: int) -> dict[str, str]:
    """Kind -> its curves as path elements, the most important kind last, so that it lies on top."""
    layers, digits = {}, max(3, len(str(max(len(curves) - 1, 0))))
    for place, i in enumerate(np.argsort(-curves.kind.astype(np.int64), kind="stable").tolist()):
        d = polyline_path(curves[i], decimals, bool(curves.closed[i]))
        path = element("path", {"id": f"{letter}{place:0{digits}d}", "d": d, "class": "curve"})
        layers[KINDS[curves.kind[i]]] = layers.get(KINDS[curves.kind[i]], "") + path
    return layers


def png_from_svg(text: str, scale: float = 1.0, background: str | None = "#ffffff") -> bytes:
    """SVG text -> PNG bytes at `scale` px a px, by resvg. Raises ValueError where resvg cannot read the text."""
    return bytes(resvg_py.svg_to_bytes(svg_string=text, background=background, zoom=scale, dpi=96.0))


# ------------------------------------------------------------------------------- what fills a stroke, by encoding


def _flat(drawing, options, order):
    """(tag, attributes, content) of each stroke: its outline."""
    for rings in outlines(drawing.strokes, options.tolerance, order):
        yield "path", {"d": rings_path(rings, options.decimals), "fill-rule": "nonzero"}, ""


def _images(drawing, options, order):
    """(tag, attributes, content) of each stroke: its pixels, clipped by the outline of its ribbon."""
    rings = ribbon_outlines(drawing, max(options.tolerance, CLIP_SLACK), order)
    for place, (i, ring) in enumerate(zip(order.tolist(), rings, strict=True)):
        picture = _stroke_image(drawing, i, options.texture_res)
        if picture is None:
            yield "g", {}, ""
            continue
        x, y, width, height, png = picture
        clip = element("path", {"d": rings_path(ring, min(options.decimals, 1)), "clip-rule": "nonzero"})
        box = {"x": x, "y": y, "width": width, "height": height}
        box = {key: number(value, max(options.decimals, 3)) for key, value in box.items()}
        href = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
        image = element("image", {**box, "preserveAspectRatio": "none", "xlink:href": href})
        yield "g", {"clip-path": f"url(#c{place})"}, element("clipPath", {"id": f"c{place}"}, clip) + image


def _stroke_image(drawing, i, resolution):
    """The stroke's raster: (x, y, width, height) in the drawing's pixels and PNG bytes; None where nothing shows."""
    crop, layer = stroke_pixels(drawing, i, resolution)
    seen = layer[..., 3] > 0.5 / 255
    if not seen.any():
        return None
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    layer = layer[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    box = np.array([crop.x0 + columns[0], crop.y0 + rows[0], layer.shape[1], layer.shape[0]]) / resolution
    return (*box.tolist(), palette_png(layer))


# ------------------------------------------------------------------------------------------- a stroke, to be read back


def _data(drawing: Drawing, i: int, decimals: int) -> dict[str, str]:
    """The stroke as data: its centre line and widths, without the points that lie between their neighbours anyway."""
    strokes = drawing.strokes
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, width = strokes.xy[rows], strokes.thickness[rows]
    path = xy[simplify(xy, PATH_SLACK)]
    along = arc_length(xy, np.array([0, len(xy)]))
    keep = simplify(np.stack([along, width], axis=1), WIDTH_SLACK) if along[-1] > 0 else np.array([0, len(xy) - 1])
    t = along[keep] / max(along[-1], 1e-12)
    pairs = zip(numbers(units(t, 5), 5), numbers(units(width[keep], decimals), decimals), strict=True)
    data = {
        "data-ss-class": KINDS[strokes.kind[i]],
        # the centre line is data, not a shape, so it is an open path even where the stroke is closed
        "data-ss-path": polyline_path(path, decimals),
        "data-ss-width": " ".join(f"{a},{b}" for a, b in pairs),
    }
    if strokes.closed[i]:
        data["data-ss-closed"] = "1"
    data["fill"] = hex_color(drawing.color[i, :3])
    if drawing.color[i, 3] < 0.9995:
        data["fill-opacity"] = number(drawing.color[i, 3], 3)
    return data
