"""The drawing that a command is given as an SVG file."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..svg.read import SvgFile


def read_drawing(file: str) -> SvgFile:
    """Read an SVG of ours; - is standard input. Errors say which option reads other SVGs."""
    from ..svg.read import NoStrokesError, read_svg_file

    try:
        return read_svg_file(sys.stdin.buffer.read() if file == "-" else file)
    except NoStrokesError as error:
        raise ValueError(f"{error}: see render --curves") from None
