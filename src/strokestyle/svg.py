"""Drawing -> SVG that illustrators keep working in. The only file that knows SVG.

What an element carries so that the tool can read its own file back: `data-ss-class` the line kind, `data-ss-path` the
centre line as path data, `data-ss-width` the full width as "t,w ..." with t the normalised arc length of that path.
"""

from __future__ import annotations

import base64
import gzip
import io
from pathlib import Path

import numpy as np
import resvg_py
import svgwrite

from . import __version__
from .curves import KINDS, Curves, arc_length, simplify
from .files import write_bytes
from .outlines import outlines
from .painting import stroke_pixels
from .palette import palette_png
from .ribbons import ribbon_outlines
from .strokes import Drawing, paint_order

MM_PER_PX = 25.4 / 96.0  # CSS pixels
TEXTURES = ("auto", "image", "none")
PATH_SLACK = 0.04  # px a centre line may be off where data-ss-path leaves points out
CLIP_SLACK = 0.5  # px, the least tolerance of a clip: its edge lies where the texture is clear
WIDTH_SLACK = 0.004  # px a width may be off where data-ss-width leaves points out


def write_svg(
    drawing: Drawing,
    *,
    texture: str = "auto",
    texture_res: float = 2.0,
    decimals: int = 2,
    tolerance: float = 0.1,
    layers: bool = True,
    title: str = "",
    description: str = "",
    background: str | None = None,
) -> str:
    """The drawing as SVG text; the same drawing gives the same text.

    Parameters
    ----------
    texture : "none": a filled outline per stroke in its flat ink. "image": the outline clips a raster of the stroke.
        "auto": image where the drawing has a texture, else none.
    texture_res : pixels of those rasters per pixel of the drawing
    decimals : of every coordinate
    tolerance : pixels between an outline and the exact one
    layers : one group (an Inkscape layer) per line kind; else the strokes lie in the root, in painting order
    background : a CSS colour for a rectangle behind everything; None leaves the page clear

    Raises
    ------
    ValueError
        on an unknown texture, or a resolution, tolerance or number of decimals that makes no picture.
    """
    if texture not in TEXTURES:
        raise ValueError(f"texture must be one of {', '.join(TEXTURES)}, got {texture!r}")
    if not 0.1 <= texture_res <= 16:
        raise ValueError(f"the texture's resolution must lie between 0.1 and 16 px per px, got {texture_res}")
    if not 0 <= decimals <= 6:
        raise ValueError(f"decimals must lie between 0 and 6, got {decimals}")
    image = drawing.texture is not None and texture in ("auto", "image")
    page = _page(drawing.size, title, description, background)
    strokes = drawing.strokes
    order = paint_order(strokes)
    if image:
        rings = ribbon_outlines(drawing, max(tolerance, CLIP_SLACK), order)
    else:
        rings = outlines(strokes, tolerance, order)
    digits = max(3, len(str(max(len(order) - 1, 0))))
    parents = {}
    for number, (i, stroke_rings) in enumerate(zip(order.tolist(), rings, strict=True)):
        kind = KINDS[strokes.kind[i]]
        if kind not in parents:
            parents[kind] = page.add(_layer(page, kind)) if layers else page
        name = f"s{number:0{digits}d}"
        d = rings_path(stroke_rings, min(decimals, 1) if image else decimals)
        color = drawing.color[i]
        data = {"id": name, "class": "stroke", "data-ss-class": kind, **_centre_data(drawing, i, decimals)}
        if strokes.closed[i]:
            data["data-ss-closed"] = "1"
        data["fill"] = _hex(color[:3])
        if color[3] < 0.9995:
            data["fill-opacity"] = _number(color[3], 3)
        if not image:
            parents[kind].add(_element(page, "path", d=d, **{"fill-rule": "nonzero"}, **data))
            continue
        picture = _stroke_image(drawing, i, texture_res)
        group = _element(page, "g", **data)
        parents[kind].add(group)
        if picture is None:
            continue
        x, y, width, height, png = picture
        clip = page.defs.add(page.clipPath(id=f"c-{name}"))
        clip.add(_element(page, "path", d=d, **{"clip-rule": "nonzero"}))
        group.attribs["clip-path"] = f"url(#c-{name})"
        box = {"x": x, "y": y, "width": width, "height": height}
        box = {key: _number(value, max(decimals, 3)) for key, value in box.items()}
        href = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
        group.add(_element(page, "image", **box, preserveAspectRatio="none", **{"xlink:href": href}))
    return _text(page)


def save_svg(path: str | Path, drawing: Drawing, **options) -> None:
    """`write_svg` to a file, whole or not at all; compressed where its suffix is .svgz. Raises OSError, naming it."""
    write_text(path, write_svg(drawing, **options))


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
) -> str:
    """Plain curves as SVG text: black lines 1 px wide, one path a curve, one Inkscape layer per line kind."""
    page = _page(size, title, description, background)
    layers = {}
    digits = max(3, len(str(max(len(curves) - 1, 0))))
    for number, i in enumerate(np.argsort(-curves.kind.astype(np.int64), kind="stable").tolist()):
        kind = KINDS[curves.kind[i]]
        if kind not in layers:
            layers[kind] = page.add(_layer(page, kind))
            layers[kind].attribs.update({"fill": "none", "stroke": "#000000", "stroke-width": "1"})
            layers[kind].attribs.update({"stroke-linecap": "round", "stroke-linejoin": "round"})
        d = polyline_path(curves[i], decimals, bool(curves.closed[i]))
        layers[kind].add(_element(page, "path", id=f"k{number:0{digits}d}", d=d, **{"class": "curve"}))
    return _text(page)


def png_from_svg(text: str, scale: float = 1.0, background: str | None = "#ffffff") -> bytes:
    """SVG text -> PNG bytes at `scale` px a px, by resvg. Raises ValueError where resvg cannot read the text."""
    return bytes(resvg_py.svg_to_bytes(svg_string=text, background=background, zoom=scale, dpi=96.0))


# ---------------------------------------------------------------------------------------------------- the page


def _page(size, title, description, background):
    width, height = size
    page = svgwrite.Drawing(
        debug=False,
        size=(_number(width * MM_PER_PX, 4) + "mm", _number(height * MM_PER_PX, 4) + "mm"),
        viewBox=f"0 0 {width} {height}",
    )
    page.attribs["xmlns:inkscape"] = "http://www.inkscape.org/namespaces/inkscape"
    page.attribs["data-ss-format"] = "1"
    page.attribs["data-ss-generator"] = f"strokestyle {__version__}"
    if title or description:
        page.set_desc(title=printable(title) or None, desc=printable(description) or None)
    if background is not None:
        page.add(_element(page, "rect", id="paper", width=str(width), height=str(height), fill=printable(background)))
    return page


def _text(page) -> str:
    if not page.defs.elements:
        page.elements.remove(page.defs)
    out = io.StringIO()
    page.write(out, pretty=False)
    text = out.getvalue()
    for needless in (' baseProfile="full"', ' xmlns:ev="http://www.w3.org/2001/xml-events"'):
        text = text.replace(needless, "", 1)
    # one element a line: files go under version control, and text editors open them
    for tag in ("<g ", "<path ", "<clipPath ", "<image ", "<rect ", "<title", "<desc", "<defs", "</svg>"):
        text = text.replace(tag, "\n" + tag)
    return text + "\n"


def _layer(page, kind):
    return _element(
        page,
        "g",
        id=f"layer-{kind}",
        **{"class": kind, "inkscape:groupmode": "layer", "inkscape:label": kind},
    )


def _element(page, name, d=None, **attributes):
    """An svgwrite element with finished attributes only."""
    make = {"path": lambda: page.path(d=d), "g": page.g, "rect": page.rect, "image": lambda: page.image("")}[name]
    element = make()
    element.attribs.clear()
    element.attribs.update(attributes)
    return element


def printable(text: str) -> str:
    """Text without what XML 1.0 cannot hold; markup characters are escaped by the writer."""
    return "".join(c for c in text if c in "\t\n" or " " <= c < "\ud800" or "\ue000" <= c <= "\ufffd" or c > "\uffff")


# ---------------------------------------------------------------------------------------------- numbers and paths


def _number(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if text.startswith("0."):
        return text[1:]
    return "-" + text[2:] if text.startswith("-0.") else "0" if text == "-0" else text


def _numbers(units: np.ndarray, decimals: int) -> list[str]:
    """Whole numbers of 10^-decimals -> text; every value is formatted once."""
    values, index = np.unique(units, return_inverse=True)
    text = np.array([_number(v / 10**decimals, decimals) for v in values.tolist()], dtype=object)
    return text[index.ravel()].tolist()


def _units(values: np.ndarray, decimals: int) -> np.ndarray:
    return np.rint(np.asarray(values) * 10**decimals).astype(np.int64)


def rings_path(rings: list[np.ndarray], decimals: int = 2) -> str:
    """Rings of cubics [(K, 4, 2), ...] as path data with relative coordinates."""
    parts = []
    for ring in rings:
        points = _units(ring, decimals)
        begin = points[:, :1]
        steps = _numbers(points[:, 1:] - begin, decimals)
        head = _numbers(points[0, 0], decimals)
        parts.append(f"M{head[0]} {head[1]}c{' '.join(steps)}z")
    return "".join(parts).replace(" -", "-")


def polyline_path(xy: np.ndarray, decimals: int = 2, closed: bool = False) -> str:
    """A polyline (n, 2) as path data with relative coordinates; a closed one repeats its first point, which z draws."""
    points = _units(xy[:-1] if closed and len(xy) > 2 else xy, decimals)
    head, steps = _numbers(points[0], decimals), _numbers(np.diff(points, axis=0), decimals)
    return f"M{head[0]} {head[1]}l{' '.join(steps)}{'z' if closed else ''}".replace(" -", "-")


def _centre_data(drawing: Drawing, i: int, decimals: int) -> dict[str, str]:
    """The stroke as data: its centre line and widths, without the points that lie between their neighbours anyway."""
    strokes = drawing.strokes
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, width = strokes.xy[rows], strokes.thickness[rows]
    path = xy[simplify(xy, PATH_SLACK)]
    along = arc_length(xy, np.array([0, len(xy)]))
    keep = simplify(np.stack([along, width], axis=1), WIDTH_SLACK) if along[-1] > 0 else np.array([0, len(xy) - 1])
    t = along[keep] / max(along[-1], 1e-12)
    pairs = zip(_numbers(_units(t, 5), 5), _numbers(_units(width[keep], decimals), decimals), strict=True)
    # the centre line is data, not a shape, so it is an open path even where the stroke is closed
    return {
        "data-ss-path": polyline_path(path, decimals),
        "data-ss-width": " ".join(f"{a},{b}" for a, b in pairs),
    }


def _hex(color) -> str:
    return "#" + np.rint(np.clip(color, 0, 1) * 255).astype(np.uint8).tobytes().hex()


# ------------------------------------------------------------------------------------------------------ rasters


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
