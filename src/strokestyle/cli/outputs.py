"""What a command writes: checked before any work, whole or not at all; - is standard output."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

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


class PngLook(NamedTuple):
    """How PNGs are drawn: pixels per pixel of the SVG, and what lies behind, None for nothing."""

    scale: float = 1.0
    background: str | None = "#ffffff"


def check_drawings(outputs: Sequence[str]) -> None:
    """Raise a usage error where one drawing cannot be written to all of these files."""
    from ..batch.plan import DRAWING_SUFFIXES

    for output in outputs:
        if output == STANDARD_OUTPUT and len(outputs) > 1:
            raise click.UsageError("standard output takes one SVG by itself: no other -o")
        if output != STANDARD_OUTPUT and Path(output).suffix.lower() not in DRAWING_SUFFIXES:
            raise click.UsageError(f"{output}: drawings are {', '.join(DRAWING_SUFFIXES)}")
    real = [Path(output).resolve() for output in outputs]
    twice = [output for i, output in enumerate(outputs) if real[i] in real[:i]]
    if twice:
        raise click.UsageError(f"-o {twice[0]} is given twice")


def write_drawing(outputs: Iterable[str], svg: str, png: PngLook | None = None) -> None:
    """Write a drawing's SVG text to files, as what each is by its name, or to standard output.

    All is made before any is written. .svgz is SVG, gzipped.
    """
    from ..files import write_bytes

    made = {output: drawing_bytes(output, svg, png or PngLook()) for output in outputs}
    for output, data in made.items():
        if output == STANDARD_OUTPUT:
            click.echo(data, nl=False)
        else:
            write_bytes(output, data)


def drawing_bytes(output: str, svg: str, png: PngLook) -> bytes:
    """What a file of a drawing holds: .pdf and .png by its name, else SVG."""
    from ..svg.write import png_from_svg, svg_bytes

    suffix = Path(output).suffix.lower()
    if suffix == ".pdf":
        from ..svg.pdf import pdf_from_svg

        return pdf_from_svg(svg)
    if suffix == ".png":
        return png_from_svg(svg, *png)
    return svg_bytes(svg, suffix == ".svgz")


def preview_of(output: str) -> str:
    """Name the PNG beside a drawing."""
    return str(Path(output).with_suffix(".png"))
