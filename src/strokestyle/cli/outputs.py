"""What a command writes: checked before any work, whole or not at all; - is standard output."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import click

STANDARD_OUTPUT = "-"


def check_outputs(outputs: Iterable[str], inputs: Sequence[str]) -> None:
    """Check, before any work, that every output can be written and that none is an input.

    Raises OSError where one cannot be written, ValueError where one is an input; either names it.
    """
    from ..files import check_output

    for output in outputs:
        if output != STANDARD_OUTPUT:
            check_output(output, inputs)


def print_json(values: dict[str, Any]) -> None:
    """Print one line of JSON on standard output, for scripts."""
    click.echo(json.dumps(values, allow_nan=False))


def write_svg_text(output: str, text: str) -> None:
    """Write SVG text to a file, gzipped where its name ends in .svgz, or to standard output."""
    from ..svg.write import write_text

    if output == STANDARD_OUTPUT:
        click.echo(text, nl=False)
    else:
        write_text(output, text)


def write_preview(output: str, svg: str, scale: float = 1.0) -> str:
    """Write the PNG of an SVG beside it and return its name.

    `scale` : pixels of the PNG per pixel of the SVG
    """
    from ..files import write_bytes
    from ..svg.write import png_from_svg

    preview = str(Path(output).with_suffix(".png"))
    write_bytes(preview, png_from_svg(svg, scale))
    return preview
