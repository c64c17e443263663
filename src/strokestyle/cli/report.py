"""`strokestyle report`: a page of what became of a batch."""

from __future__ import annotations

import os
from pathlib import Path

import click

from .messages import say
from .options import common_options, page_options
from .outputs import STANDARD_OUTPUT, check_outputs


@click.command(
    epilog="""\b
Examples:
  strokestyle report drawings/ -o report.html
  strokestyle report drawings/ -o drawings/index.html --open
  strokestyle report drawings/ -o sheet.html --title 'Twelve teapots'"""
)
@click.argument("folder", type=click.Path())
@page_options
@click.option("--title", metavar="TEXT", help="Title of the page.  [default: the folder's name]")
@common_options
def report(folder: str, output: str, title: str | None, show: bool) -> None:
    """Write a page on what became of a batch: pictures, times, failures, links.

    FOLDER is one that render wrote drawings to, with others in it or not; its batch.jsonl says what
    became of each shape, and without one the page is a contact sheet of its SVG files. The page is
    one HTML file that works without a network: it is searched, sorted and printed. Links go to the
    files from where the page lies.
    """
    if show and output == STANDARD_OUTPUT:
        raise click.UsageError("--open needs a file to open: give -o report.html")
    from ..batch.journal import NAME
    from ..batch.report import find_entries, report_html
    from .progress import FrameDisplay

    entries = find_entries(folder)
    inputs = [name for entry in entries for name in entry.files]
    check_outputs([output], [*inputs, *map(str, Path(folder).rglob(NAME))])
    base = "" if output == STANDARD_OUTPUT else os.path.dirname(os.path.abspath(output))
    name = title or os.path.basename(os.path.abspath(folder))
    with FrameDisplay() as display:
        page = report_html(
            entries, name, base, lambda all: display.stage("thumbnails", all, len(entries))
        )
    if output == STANDARD_OUTPUT:
        click.echo(page, nl=False)
    else:
        from ..files import write_bytes

        write_bytes(output, page.encode("utf-8"))
    failed = sum(entry.failed for entry in entries)
    say(f"{folder}: {len(entries) - failed} drawn, {failed} failed -> {output}")
    if show:
        import webbrowser

        webbrowser.open(Path(output).resolve().as_uri())
