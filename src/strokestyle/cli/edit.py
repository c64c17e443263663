"""`strokestyle edit`: change a drawing by commands."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from .animation import NOTHING
from .drawing import left_out, read_drawing
from .messages import say, timed
from .options import (
    TEXTURES,
    check_look,
    common_options,
    file_options,
    picture_options,
    picture_scale,
    seed_option,
)
from .outputs import (
    STANDARD_OUTPUT,
    PngLook,
    check_drawings,
    check_outputs,
    preview_of,
    write_drawing,
)

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from .edit_text import Edit, NamedDrawing, Thickness


class GivenEdit(NamedTuple):
    """One edit that the command line asks for: the option's name, and what it does."""

    name: str
    apply: Edit


class EditText(click.ParamType):
    """An edit as text, such as "contour=1.5" -> what makes it."""

    def __init__(self, edit: str, name: str):
        self.edit, self.name = edit, name

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Edit:
        from .edit_text import parse_edit

        try:
            return parse_edit(self.edit, value)
        except ValueError as error:  # a sentence that names the option
            raise click.UsageError(str(error), ctx) from None

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        if self.edit == "restyle":
            return click.Path().shell_complete(ctx, param, incomplete)
        return super().shell_complete(ctx, param, incomplete)


class EditOption(click.Option):
    """An option that is an edit: its place among the others of its class tells."""


class EditCommand(click.Command):
    """Hands over the values of all edit options as `edits`, in the order of the command line.

    click gives each option's values apart, so its parser is asked for the order of the options.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        _, _, order = self.make_parser(ctx).parse_args(list(args))
        rest = super().parse_args(ctx, args)
        options = [option for option in self.params if isinstance(option, EditOption)]
        values = {option.name: iter(ctx.params.pop(option.name) or ()) for option in options}
        ctx.params["edits"] = [
            GivenEdit(option.name, edit)
            for option in order
            if isinstance(option, EditOption)
            for edit in islice(values[option.name], 1)
        ]
        return rest


def edit_option(
    name: str, metavar: str, text: str
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a command with an edit that may be given several times."""
    edit_type = EditText(name, metavar)
    return click.option(
        f"--{name}", cls=EditOption, type=edit_type, multiple=True, metavar=metavar, help=text
    )


@click.command(
    cls=EditCommand,
    epilog="""Any edit but --move, --restyle and --drop can be for certain lines only, by kind or by
part of the mesh: --thickness contour=1.5, --recolor wheel,hub=#a33. --drop names them likewise.

\b
Examples:
  strokestyle edit out.svg -o thick.svg --thickness 2
  strokestyle edit out.svg -o alive.svg --wiggle 3,40 --taper 30 --seed 5
  strokestyle edit out.svg -o moved.svg --move s004:0.5:20,-10
  strokestyle edit out.svg -o calm.svg --drop 'valley<40' --smooth 6 --recolor valley=#a33
  strokestyle edit out.svg -o brush.svg --restyle brush.pt
  strokestyle render model.pt mesh.obj -o - | strokestyle edit - -o - --wiggle 2,30 > out.svg""",
)
@click.argument("drawing", metavar="IN.svg", type=click.Path())
@click.option(
    "-o",
    "--output",
    "outputs",
    type=click.Path(),
    required=True,
    multiple=True,
    help="OUT.svg, .svgz, .pdf or .png; may be given several times. - is SVG to standard output.",
)
@edit_option("thickness", "K", "Every thickness times K.")
@edit_option(
    "wiggle",
    "AMPLITUDE,WAVELENGTH",
    "Make lines tremble by up to AMPLITUDE px; their ends stay.",
)
@edit_option("smooth", "PX", "Smooth lines over PX; their ends stay.")
@edit_option(
    "simplify",
    "PX",
    "Draw lines through as few points as keep them within PX, curved between.",
)
@edit_option(
    "move",
    "STROKE:POINT:DX,DY",
    "Move the point at POINT (0 to 1) of a stroke by DX,DY px; others follow.",
)
@edit_option("taper", "PX", "Bring strokes to a point over PX at either end.")
@edit_option("recolor", "COLOR", "Change the ink's colour, the texture's too.")
@edit_option("restyle", "MODEL", "Draw the lines in another hand.")
@edit_option(
    "drop", "WHAT", "Take strokes out: '<20' the shorter ones, 'valley,ridge', or 'valley<20'."
)
@click.option(
    "--texture",
    type=click.Choice(TEXTURES),
    help="As in render.  [default: as it is]",
)
@picture_options
@file_options
@seed_option
@common_options
def edit(
    drawing: str,
    outputs: tuple[str, ...],
    edits: list[GivenEdit],
    texture: str | None,
    png: bool,
    png_scale: float | None,
    dpi: float | None,
    seed: int,
    **options: Any,
) -> None:
    """Change an SVG that render wrote, and perhaps others worked on; edits are made in the order in
    which they stand.

    The texture follows the strokes. Strokes that are not edited stay as they are; what is no stroke
    (text, shapes of your own), and clips, gradients and filters on strokes are not kept. IN.svg may
    be - for standard input. Points and sizes are pixels of the drawing.
    """
    if png and STANDARD_OUTPUT in outputs:
        raise click.UsageError("standard output takes one SVG: no --png with -o -")
    check_drawings(outputs)
    scale = picture_scale(png_scale, dpi)
    if png:
        outputs = tuple(dict.fromkeys((*outputs, preview_of(outputs[0]))))
    look = file_options.given(options)
    if texture is None and look.get("inkscape_lpe"):
        texture = "none"
    if texture is not None:
        look["texture"] = texture
    clear = look.get("background") == NOTHING
    if clear:
        look["background"] = None
    check_look(look)
    check_outputs(outputs, [drawing] if drawing != "-" else [])
    changes = thicknesses(edits)
    if look or changes is None:
        text, count, lost = edited_text(drawing, edits, look, seed)
    else:
        text, count, lost = thickened(drawing, changes)
    write_drawing(outputs, text, PngLook(scale, None if clear else "#ffffff"))
    told = f"; left out: {lost}" if lost else ""
    say(f"{drawing}: {count} strokes -> {', '.join(outputs)}{told}")


def thickened(drawing: str, changes: Sequence[Thickness]) -> tuple[str, int, str]:
    """What `edited_text` gives, where thicknesses are multiplied and nothing else is asked for.

    Tones are scaled in the file itself. Any other texture is drawn anew, from the file as it was
    before its thickness was changed for the first time, which goes along in the new one; where all
    factors since then make 1, that file it is.
    """
    import numpy as np

    from ..svg.kept import kept_strokes
    from ..svg.original import Original, keep_original, original_of
    from ..svg.rescale import thickened_svg
    from ..svg.write import write_svg
    from .edit_text import NamedDrawing, factors_of, thicker

    piped = drawing == STANDARD_OUTPUT
    data = sys.stdin.buffer.read() if piped else Path(drawing).read_bytes()
    before = quickly = None
    try:
        with timed("thickness"):
            before = original_of(data)
            if before is None:
                quickly = thickened_svg(data, functools.partial(factors_of, changes))
    except ValueError:  # it is said where the file is read as a drawing
        pass
    if quickly is not None:
        return (*quickly, "")
    found, factor = None, None
    if before is not None:
        with timed("read the drawing"):
            found = read_drawing(drawing, before.data)
        factor = before.times(factors_of(changes, found.drawing.strokes.kind, found.drawing.parts))
        if factor is not None and (factor == 1.0).all():
            return before.data.decode("utf-8"), len(found.ids), ""
    if before is None or found is None or factor is None:
        with timed("read the drawing"):
            found = read_drawing(drawing, data if piped else None)
        before = Original(data, np.ones(1))
        factor = factors_of(changes, found.drawing.strokes.kind, found.drawing.parts)
    named = NamedDrawing(found.drawing, found.ids, found.kept)
    with timed("thickness"):
        edited = thicker(named, factor)
    with timed("write the SVG"):
        text = write_svg(edited.drawing, found.options, ids=found.ids, kept=edited.kept)
    as_drawn = len(kept_strokes(edited.drawing, found.options, edited.kept)) == len(found.ids)
    if edited.drawing.texture is not None and (factor != 1.0).any() and not as_drawn:
        text = keep_original(text, Original(before.data, factor))
    return text, len(found.ids), left_out(found)


def thicknesses(edits: Sequence[GivenEdit]) -> list[Thickness] | None:
    """The edits, where all are of thickness and there is one at least; else None."""
    from .edit_text import Thickness

    changes = [edit.apply for edit in edits if isinstance(edit.apply, Thickness)]
    return changes if 0 < len(changes) == len(edits) else None


def edited_text(
    drawing: str, edits: Sequence[GivenEdit], look: dict[str, Any], seed: int
) -> tuple[str, int, str]:
    """The SVG of an edited drawing, its number of strokes, and what was left out."""
    from ..svg.write import write_svg
    from .edit_text import NamedDrawing, factors_of, thicker

    with timed("read the drawing"):
        found = read_drawing(drawing)
    named = NamedDrawing(found.drawing, found.ids, found.kept)
    changes = thicknesses(edits)
    if changes is None:
        edited = make_edits(edits, named, seed)
    else:
        factor = factors_of(changes, named.drawing.strokes.kind, named.drawing.parts)
        edited = thicker(named, factor)
    if not edited.ids:
        raise ValueError(f"{drawing}: --drop takes out all {len(found.ids)} strokes: drop fewer")
    with timed("write the SVG"):
        text = write_svg(edited.drawing, found.options, ids=edited.ids, kept=edited.kept, **look)
    return text, len(edited.ids), left_out(found)


def make_edits(edits: Iterable[GivenEdit], drawing: NamedDrawing, seed: int) -> NamedDrawing:
    """The drawing after one edit after the other."""
    for change in edits:
        with timed(change.name):
            drawing = change.apply(drawing, seed)
    return drawing
