"""`strokestyle view`: a page on which to look at drawings and play with them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .drawing import left_out, read_drawing
from .messages import say, timed
from .options import common_options, page_options
from .outputs import STANDARD_OUTPUT, check_outputs

if TYPE_CHECKING:
    from ..svg.read import SvgFile


@click.command(
    epilog="""\b
Examples:
  strokestyle view out.svg -o page.html
  strokestyle view drawings/*.svg -o page.html --open
  strokestyle render model.pt mesh.obj -o - | strokestyle view - -o page.html"""
)
@click.argument("files", nargs=-1, required=True, type=click.Path())
@page_options
@common_options
def view(files: tuple[str, ...], output: str, show: bool) -> None:
    """Write a page on which to look at FILES and play with them.

    FILES are SVGs that render or edit wrote, and - is standard input. The page is one HTML file
    that works without a network: zoom, layers, sliders for thickness and wiggle, strokes bent by
    dragging their points, before and after, undo, and a button that saves the edited SVG.
    """
    check_outputs([output], [file for file in files if file != "-"])
    if show and output == STANDARD_OUTPUT:
        raise click.UsageError("--open needs a file to open: give -o page.html")
    from ..viewer.page import page_html

    names, sheets, lost = short_names(files), [], ""
    for name, file in zip(names, files, strict=True):
        found = read_drawing(file)
        sheets.append((name, page_svg(name, found)))
        if parts := left_out(found):
            lost += f"; left out of {name}: {parts}"
    page = page_html(sheets)
    if output == STANDARD_OUTPUT:
        click.echo(page, nl=False)
    else:
        from ..files import write_bytes

        write_bytes(output, page.encode("utf-8"))
    say(f"{', '.join(files)} -> {output}{lost}")
    if show:
        import webbrowser

        webbrowser.open(Path(output).resolve().as_uri())


def page_svg(name: str, found: SvgFile) -> str:
    """A drawing as the page wants it: written anew, with every stroke's strip of texture."""
    from ..svg.write import write_svg

    with timed(f"write {name} anew"):
        # without Inkscape's live effect: the page could not keep it in step with the outline
        return write_svg(
            found.drawing,
            found.options,
            ids=found.ids,
            kept=found.kept,
            strips=True,
            inkscape_lpe=False,
        )


def short_names(files: Sequence[str]) -> list[str]:
    """The names of files without their folders, where that tells them apart."""
    names = ["drawing.svg" if file == "-" else Path(file).name for file in files]
    return names if len(set(names)) == len(names) else list(files)
