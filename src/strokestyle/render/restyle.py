"""Draw the lines of a drawing anew, in another style."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..drawing.strokes import Drawing
from ..extract.pipeline import view_of_lines
from ..geometry.curves import Curves
from .style import Style

if TYPE_CHECKING:
    from .neural_strokes import NeuralStrokesStyle


def restyle(drawing: Drawing, style: Style | NeuralStrokesStyle, seed: int = 0) -> Drawing:
    """Draw the centre lines of a drawing's strokes in a style.

    The style sees lines only: no surface is known behind them, so that what it has learned to do by
    depth, normals or curvature does not show. Strokes may be joined, cut and directed anew, so the
    strokes of the result are not those of `drawing` one by one; kinds and named parts are kept.

    Parameters
    ----------
    drawing : its strokes, size and parts are used; thickness, ink and texture are not
    style : as `load_style` or `fit_style` return it
    seed : same drawing, style and seed, same result

    Returns
    -------
    Drawing of the same size, in the same pixels.
    """
    strokes, (width, height) = drawing.strokes, drawing.size
    curves = Curves(strokes.xy, strokes.offsets, strokes.kind, strokes.closed)
    lines = view_of_lines(curves, width, height, parts=drawing.parts)
    return style.draw(lines, seed=seed)
