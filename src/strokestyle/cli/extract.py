"""`strokestyle extract`: find the feature curves of a shape."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .messages import count_curves, say
from .options import (
    common_options,
    curve_options,
    line_options,
    one_json_option,
    shape_options,
    view_options,
)
from .outputs import STANDARD_OUTPUT, check_outputs, print_json, write_drawing
from .shape import Shape

if TYPE_CHECKING:
    from ..extract.view import View

SUFFIXES = (".png", ".svg", ".svgz", ".pdf", ".npz", ".json")
PAPER = "#ffffff"  # of the PNG that an artist draws over


@click.command(
    epilog="""\b
Examples:
  strokestyle extract teapot.obj -o template.png
  strokestyle extract teapot.obj -o curves.svg -o view.npz --view 40,20
  strokestyle extract scan.ply -o lines.svg --lines contour,valley --valley 0.2
  strokestyle extract scan.ply -o lines.svg --detail 0.5..2
  strokestyle extract part.stl -o lines.svg --hidden --lines contour,crease
  strokestyle extract part.stl -o half.svg --view isometric --section x:50%
  strokestyle extract bike.obj -o frame.svg --hide saddle,'front wheel'
  strokestyle extract part.stl --up z -o - | inkscape --pipe --export-filename=part.pdf"""
)
@click.argument("shape", type=click.Path())
@click.option(
    "-o",
    "--output",
    "outputs",
    type=click.Path(),
    multiple=True,
    required=True,
    help="File to write, by suffix; may be given several times. - is SVG to standard output.",
)
@click.option(
    "--hidden",
    is_flag=True,
    help="Also the hidden parts of contours, boundaries, creases, intersections and sections, "
    "dashed, on layers of their own.",
)
@view_options
@shape_options
@line_options
@curve_options
@one_json_option
@common_options
def extract(shape: str, outputs: tuple[str, ...], tell: bool, **options: Any) -> None:
    """Find the feature curves of SHAPE and write them.

    \b
    OUT.png   the template that an artist draws over
    OUT.svg   the curves, one layer per kind of line
    OUT.npz   the whole view, for fit and render: camera, curves, feature maps
    OUT.json  camera and curves for other programs
    """
    for output in outputs:
        if output != STANDARD_OUTPUT and Path(output).suffix.lower() not in SUFFIXES:
            raise click.UsageError(
                f"{output}: cannot tell what to write; name it .png, .svg, .pdf, .npz or .json"
            )
    if tell and STANDARD_OUTPUT in outputs:
        raise click.UsageError("standard output takes one of both: the SVG, or --json")
    check_outputs(outputs, [shape])
    view = Shape(shape, options).view()
    for output in outputs:
        write_view(view, output, Path(shape).stem)
    behind = f"; hidden: {count_curves(view.hidden)}" if options["hidden"] else ""
    say(f"{shape}: {count_curves(view.curves)}{behind} -> {', '.join(outputs)}")
    if tell:
        length = round(float(view.curves.lengths().sum()), 1)
        told = {"shape": shape, "files": outputs, "lines": len(view.curves), "length_px": length}
        print_json(told)


def write_view(view: View, output: str, title: str) -> None:
    """Write a view in the format that the output's name asks for."""
    from ..extract.view_file import save_view, view_to_json
    from ..files import write_bytes

    suffix = Path(output).suffix.lower()
    if suffix == ".npz":
        save_view(output, view)
    elif suffix == ".json":
        import json

        write_bytes(output, json.dumps(view_to_json(view), separators=(",", ":")).encode())
    elif suffix == ".png":
        from ..svg.write import png_from_svg

        write_bytes(output, png_from_svg(view_svg(view, title, PAPER)))
    else:
        write_drawing([output], view_svg(view, title))


def view_svg(view: View, title: str, background: str | None = None) -> str:
    """The curves of a view as SVG, the hidden ones dashed."""
    from ..svg.write import plain_svg

    curves, parts = view.pieces_by_part()
    hidden, hidden_parts = view.pieces_by_part(hidden=True)
    return plain_svg(
        curves,
        (view.camera.width, view.camera.height),
        hidden=hidden,
        parts=parts,
        hidden_parts=hidden_parts,
        title=title,
        background=background,
    )
