"""The drawing that a command is given as an SVG file."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from .messages import say

if TYPE_CHECKING:
    from ..svg.read import SvgFile


def read_drawing(file: str, data: bytes | None = None) -> SvgFile:
    """Read an SVG of ours; - is standard input. Errors say which option reads other SVGs.

    `data` : what to read in place of what the file holds

    Raises ValueError, too, where no stroke in it is shown.
    """
    from ..svg.read import NoStrokesError, read_svg_file
    from ..svg.style_sheet import name_rules

    try:
        if file == "-" and data is None:
            data = sys.stdin.buffer.read()
        found = read_svg_file(file if data is None else data)
    except NoStrokesError as error:
        raise ValueError(f"{error}: see render --curves") from None
    if found.unread_rules:
        say(
            f"{file}: rules of style sheets that are not understood, so that strokes may look "
            f"otherwise: {name_rules(found.unread_rules)}"
        )
    if not len(found.drawing.strokes):
        hidden = f"all its strokes, {found.hidden}, are hidden: show them first"
        raise ValueError(f"{file}: {hidden if found.hidden else 'an empty drawing: no strokes'}")
    return found


def left_out(found: SvgFile) -> str:
    """What of a file is not edited, nor shown on a page, for the user: "shapes 2", or nothing."""
    counts = {
        "hidden strokes": found.hidden,
        "shapes": found.foreign_shapes - found.lost_tones,
        "tones without their stroke's first": found.lost_tones,
        "clips, gradients, filters": found.effects,
        "outlines of strokes": found.outlines,
    }
    return ", ".join(f"{what} {n}" for what, n in counts.items() if n)
