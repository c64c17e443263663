"""Centre lines as SVG: for plotters, and as the skeletons of Inkscape's PowerStroke."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..drawing.strokes import Drawing, Strokes, paint_order
from ..geometry.bezier import fit_lines
from ..geometry.curves import KINDS, arc, simplify
from .document import LayerItem, Page, document, layered
from .format import SvgOptions
from .landmarks import fine_line
from .markup import Element, hex_color, number, numbers, units

PEN = 0.3  # mm, how thick a plotter's lines are shown
LINE_SLACK = 0.1  # px between a centre line and its curves
POWER_STROKE_SLACK = (
    0.1  # px between a width and PowerStroke's, which interpolates between few of them
)
EFFECT = "lpe-"  # and the stroke's id: the id of its path effect


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


class PowerStroke(NamedTuple):
    """A stroke as Inkscape's PowerStroke has it.

    Parameters
    ----------
    d : path data of its skeleton
    line : (n, 2), that skeleton as a fine polyline, px
    offset_points : "t,w | ...": t counts the skeleton's curves, w is half the width, px
    """

    d: str
    line: np.ndarray
    offset_points: str


def power_strokes(drawing: Drawing, options: SvgOptions, index: list[int]) -> list[PowerStroke]:
    """Give strokes `index` as PowerStrokes.

    Other programs show the outline that we wrote; Inkscape makes its own of these once the stroke
    is touched.
    """
    strokes = drawing.strokes
    lines = fit_lines(strokes.xy, strokes.offsets, LINE_SLACK)
    made = []
    for i in index:
        cubics, rows = lines[i]
        d = line_path(cubics, options.decimals, bool(strokes.closed[i]))
        told = units(cubics, options.decimals) / 10**options.decimals
        made.append(PowerStroke(d, fine_line(told), _offset_points(strokes, i, rows)))
    return made


def _offset_points(strokes: Strokes, i: int, rows: np.ndarray) -> str:
    """Half widths along a skeleton whose curves begin and end at the stroke's points `rows`."""
    part = strokes.rows(i)
    along, half = arc(strokes.xy[part]), 0.5 * strokes.thickness[part]
    if along[-1] > 0:
        knots = simplify(np.stack([along, half], axis=1), 0.5 * POWER_STROKE_SLACK)
        t = np.interp(along[knots], along[rows], np.arange(len(rows)))
    else:
        knots, t = np.array([0]), np.zeros(1)
    if strokes.closed[i]:  # the last is the first
        t, knots = t[:-1], knots[:-1]
    pairs = zip(numbers(units(t, 4), 4), numbers(units(half[knots], 3), 3), strict=True)
    return " | ".join(f"{a},{w}" for a, w in pairs)


def effect(name: str, offset_points: str) -> Element:
    """Give Inkscape's path effect of the stroke of an id."""
    return Element(
        "inkscape:path-effect",
        {
            "effect": "powerstroke", "id": EFFECT + name, "is_visible": "true", "lpeversion": "1.3",
            "scale_width": "1", "interpolator_type": "CubicBezierJohan", "interpolator_beta": "0.2",
            "start_linecap_type": "round", "end_linecap_type": "round", "linejoin_type": "round",
            "miter_limit": "4", "sort_points": "true", "not_jump": "false",
            "offset_points": offset_points,
        },
    )  # fmt: skip


def line_path(cubics: np.ndarray, decimals: int, closed: bool) -> str:
    """Cubics (K, 4, 2) end to end as path data with relative coordinates."""
    points = units(cubics, decimals)
    head = numbers(points[0, 0], decimals)
    steps = numbers(points[:, 1:] - points[:, :1], decimals)
    return f"M{head[0]} {head[1]}c{' '.join(steps)}{'z' if closed else ''}".replace(" -", "-")
