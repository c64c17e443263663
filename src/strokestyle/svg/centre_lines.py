"""Centre lines as SVG, for plotters."""

from __future__ import annotations

import numpy as np

from ..drawing.strokes import Drawing, paint_order
from ..geometry.bezier import fit_lines
from ..geometry.curves import KINDS
from .document import LayerItem, Page, document, layered
from .format import SvgOptions
from .markup import Element, hex_color, number, numbers, units

PEN = 0.3  # mm, how thick a plotter's lines are shown
LINE_SLACK = 0.1  # px between a centre line and its curves


def plotter_svg(drawing: Drawing, options: SvgOptions) -> str:
    """Write centre lines only, in mm: no fill, image or clip.

    Layers are numbered as plotter software wants them.
    """
    page = Page.in_mm(drawing.size, options)
    order = paint_order(drawing, options.layers).tolist()
    style = {
        "fill": "none",
        "stroke-width": number(PEN, 2),
        "stroke-linecap": "round",
        "stroke-linejoin": "round",
    }
    items = _pen_lines(drawing, options, page, order)
    if options.layers != "none":
        content = layered(items, options.layers, style, numbered=True)
    else:
        content = [Element("g", style, tuple(item.element for item in items))] if items else []
    return document(content, page, options)


def _pen_lines(
    drawing: Drawing, options: SvgOptions, page: Page, order: list[int]
) -> list[LayerItem]:
    """Centre lines on a page in mm, the canvas fitted into it and centred."""
    strokes, sides, size = drawing.strokes, np.array([page.width, page.height]), drawing.size
    scale = (sides / size).min()  # mm a pixel
    corner = 0.5 * (sides - scale * np.array(size))
    lines = fit_lines(strokes.xy, strokes.offsets, min(options.tolerance, LINE_SLACK))
    items, digits = [], max(3, len(str(max(len(order) - 1, 0))))
    for place, i in enumerate(order):
        line, closed = lines[i][0] * scale + corner, bool(strokes.closed[i])
        d = line_path(line, max(options.decimals, 2), closed)
        pen = {"id": f"s{place:0{digits}d}", "stroke": hex_color(drawing.color[i, :3]), "d": d}
        part = "" if drawing.parts is None else drawing.parts.name(i)
        items.append(LayerItem(Element("path", pen), KINDS[strokes.kind[i]], part))
    return items


def line_path(cubics: np.ndarray, decimals: int, closed: bool) -> str:
    """Cubics (K, 4, 2) end to end as path data with relative coordinates."""
    points = units(cubics, decimals)
    head = numbers(points[0, 0], decimals)
    steps = numbers(points[:, 1:] - points[:, :1], decimals)
    return f"M{head[0]} {head[1]}c{' '.join(steps)}{'z' if closed else ''}".replace(" -", "-")
