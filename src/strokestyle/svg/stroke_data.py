"""A stroke as data, to be read back: its centre line, widths, colour, and where its shape is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..drawing.strokes import Drawing, Strokes
from ..geometry.curves import KINDS, arc_length, simplify_all
from .format import (
    LANDMARK_DECIMALS,
    MARGIN_DECIMALS,
    PATH_SLACK,
    SHARE_DECIMALS,
    WIDTH_DECIMALS,
    WIDTH_SLACK,
    Data,
)
from .landmarks import enclosed, landmarks
from .markup import hex_color, number, numbers, polyline_path, units


class Knots(NamedTuple):
    """Arc length (N,) px of points, and which of them (N,) bool centre lines and widths need."""

    along: np.ndarray
    bends: np.ndarray
    widths: np.ndarray

    def of(self, rows: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the points of one stroke: its arc length, and the places of those points."""
        bends, widths = (np.flatnonzero(v[rows]) for v in (self.bends, self.widths))
        return self.along[rows], bends, widths


def knots_of(strokes: Strokes) -> Knots:
    """Find which points of strokes their data need."""
    along = arc_length(strokes.xy, strokes.offsets)
    widths = np.stack([along, strokes.thickness], axis=1)
    bends = simplify_all(strokes.xy, strokes.offsets, PATH_SLACK)
    return Knots(along, bends, simplify_all(widths, strokes.offsets, WIDTH_SLACK))


def stroke_data(
    drawing: Drawing, i: int, decimals: int, knots: Knots, textured: bool
) -> dict[str, str]:
    """Tell stroke i as data: its centre line, widths and colour, and its texture's margin."""
    strokes, color = drawing.strokes, drawing.color[i]
    path, widths = _line_data(strokes, i, decimals, knots)
    # the centre line is data, not a shape, so it is an open path even where the stroke is closed
    data = {Data.CLASS: KINDS[strokes.kind[i]], Data.PATH: path, Data.WIDTH: widths}
    if strokes.closed[i]:
        data[Data.CLOSED] = "1"
    data["fill"] = hex_color(color[:3])
    if color[3] < 0.9995:
        # what is inside has its own: scour would drop the group's, Scribus fades images by it
        data[Data.OPACITY if textured else "fill-opacity"] = number(color[3], 3)
    if textured and drawing.texture is not None:
        data[Data.MARGIN] = number(drawing.texture.margin[i], MARGIN_DECIMALS)
    return data


def _line_data(strokes: Strokes, i: int, decimals: int, knots: Knots) -> tuple[str, str]:
    """A centre line and its widths without the points that lie between their neighbours anyway.

    Widths by arc length where they are few, else one for each point: what is shorter.
    """
    rows = strokes.rows(i)
    xy, width = strokes.xy[rows], strokes.thickness[rows]
    along, bends, places = knots.of(rows)
    share = numbers(units(along[places] / max(along[-1], 1e-12), SHARE_DECIMALS), SHARE_DECIMALS)
    both = np.union1d(bends, places)
    every = _widths(width[both])
    there = [every[k] for k in np.searchsorted(both, places).tolist()]
    pairs = " ".join(f"{a},{b}" for a, b in zip(share, there, strict=True))
    path, path_of_both = (polyline_path(xy[some], decimals) for some in (bends, both))
    each = " ".join(every)
    if len(path_of_both) + len(each) <= len(path) + len(pairs):
        return path_of_both, each
    return path, pairs


def _widths(width: np.ndarray) -> list[str]:
    return numbers(units(width, WIDTH_DECIMALS), WIDTH_DECIMALS)


def edge_at(line: np.ndarray) -> str:
    """Tell where a stroke's first shape is: landmarks of its edge (n, 2), and the area within."""
    return f"{places_at(landmarks(line))} {number(enclosed(line), 2)}"


def places_at(places: np.ndarray) -> str:
    """Landmarks or the corners of an image, (4, 2), as text."""
    x, y = (numbers(units(column, LANDMARK_DECIMALS), LANDMARK_DECIMALS) for column in places.T)
    return " ".join(f"{a},{b}" for a, b in zip(x, y, strict=True))
