"""Centre lines as SVG, for plotters."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from ..drawing.strokes import Drawing, paint_order
from ..geometry.bezier import fit_lines
from ..geometry.curves import KINDS
from ..geometry.travel import short_route
from .document import LayerItem, Page, document, layered, outer_layer
from .format import Data, SvgOptions
from .markup import Element, hex_color, number, numbers, units

PEN = 0.3  # mm, how thick a plotter's lines are shown
LINE_SLACK = 0.1  # px between a centre line and its curves
ROUNDING, SEEN = 1.0, 10.0  # units of rounding that a handle of a straight cubic may be off it
BEND = 0.004  # of its length, likewise


def plotter_svg(drawing: Drawing, options: SvgOptions) -> str:
    """Write centre lines only, in mm: no fill, image or clip.

    Layers are numbered as plotter software wants them, hold no layers, and lie in the order of
    painting. Within each, lines lie, are turned round, and begin if they are closed, so that the
    lifted pen travels little.
    """
    page = Page.in_mm(drawing.size, options)
    style = {
        "fill": "none",
        "stroke-width": number(PEN, 2),
        "stroke-linecap": "round",
        "stroke-linejoin": "round",
    }
    items = _pen_lines(drawing, options, page)
    if options.layers != "none":
        content = layered(items, options.layers, style, numbered=True)
    else:
        content = [Element("g", style, tuple(item.element for item in items))] if items else []
    return document(content, page, options)


def _pen_lines(drawing: Drawing, options: SvgOptions, page: Page) -> list[LayerItem]:
    """Centre lines on a page in mm, the canvas fitted into it and centred, as they are drawn."""
    sides, size = np.array([page.width, page.height]), drawing.size
    scale = (sides / size).min()  # mm a pixel
    corner = 0.5 * (sides - scale * np.array(size))
    layer = _layers(drawing, options.layers)
    order, xy, offsets = _as_drawn(drawing, options, layer)
    lines = fit_lines(xy, offsets, min(options.tolerance, LINE_SLACK))
    items, digits = [], max(3, len(str(max(len(order) - 1, 0))))
    for place, (i, (line, _)) in enumerate(zip(order, lines, strict=True)):
        part, kind = layer[i]
        closed = bool(drawing.strokes.closed[i])
        pen = {
            "id": f"s{place:0{digits}d}",
            "stroke": hex_color(drawing.color[i, :3]),
            "d": line_path(line * scale + corner, max(options.decimals, 2), closed),
        }
        items.append(LayerItem(Element("path", pen | _told(drawing, i, kind)), kind, part))
    return items


def _layers(drawing: Drawing, layers: str) -> list[tuple[str, str]]:
    """The (part, kind) of each stroke's layer; one for all where there are none."""
    each = range(len(drawing.strokes))
    if layers == "none":
        return [("", "") for _ in each]
    return [outer_layer(*_kind_and_part(drawing, i), layers) for i in each]


def _as_drawn(
    drawing: Drawing, options: SvgOptions, layer: list[tuple[str, str]]
) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Strokes in the order in which a pen draws them.

    Returns
    -------
    their order, and their centre lines in it, as they are drawn: xy (N, 2) px, offsets (C+1,)
    """
    strokes, group = drawing.strokes, np.zeros(len(layer), np.int64)
    painted = paint_order(drawing, options.layers).tolist()
    for n, (_, members) in enumerate(groupby(painted, lambda i: layer[i])):
        group[list(members)] = n
    route = short_route(strokes.xy, strokes.offsets, strokes.closed, group)
    return route.order.tolist(), *route.drawn(strokes.xy, strokes.offsets)


def _kind_and_part(drawing: Drawing, i: int) -> tuple[str, str]:
    kind = KINDS[drawing.strokes.kind[i]]
    return kind, "" if drawing.parts is None else drawing.parts.name(i)


def _told(drawing: Drawing, i: int, layer: str) -> dict[str, str]:
    """What a line's element says of it that its layer, of a kind, does not."""
    kind, part = _kind_and_part(drawing, i)
    told = {} if kind == layer and not part else {Data.CLASS: kind}
    return told | ({"inkscape:label": part} if part else {})


def line_path(cubics: np.ndarray, decimals: int, closed: bool) -> str:
    """Cubics (K, 4, 2) end to end as path data with relative coordinates; straight ones as lines.

    Programs cut a cubic into many moves however straight it is, and Inkscape's PowerStroke fits
    cubics to its sides, which may lead far off where a skeleton is bent by rounding alone.
    """
    points = units(cubics, decimals)
    head = numbers(points[0, 0], decimals)
    made: list[str] = []
    last, steps = "", points[:, 1:] - points[:, :1]
    for step, straight in zip(steps, _straight(steps).tolist(), strict=True):
        letter = "l" if straight else "c"
        text = " ".join(numbers(step[2] if straight else step, decimals))
        made.append(f" {text}" if letter == last else letter + text)
        last = letter
    d = f"M{head[0]} {head[1]}{''.join(made)}{'z' if closed else ''}"
    return d.replace(" -", "-")


def _straight(steps: np.ndarray) -> np.ndarray:
    """Which cubics (K,) are lines but for rounding, or a bend that is not seen.

    A dot is none: vpype leaves out lines without a length, and draws such a cubic.

    `steps` (K, 3, 2) : from where they begin to their handles and their end, in units of rounding
    """
    chord = steps[:, 2].astype(np.float64)
    size = np.hypot(chord[:, 0], chord[:, 1])
    along = chord / np.maximum(size, 1e-9)[:, None]
    ahead = (steps[:, :2] * along[:, None]).sum(axis=2)
    off = np.abs(steps[:, :2, 0] * along[:, None, 1] - steps[:, :2, 1] * along[:, None, 0])
    onward = (0 <= ahead[:, 0]) & (ahead[:, 0] <= ahead[:, 1]) & (ahead[:, 1] <= size)
    return (size > 0) & onward & (off.max(axis=1) <= np.clip(BEND * size, ROUNDING, SEEN))
