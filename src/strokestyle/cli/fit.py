"""`strokestyle fit`: learn a style from one drawing of a shape."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .messages import say, timed, told_warnings
from .options import (
    PRESET_NAMES,
    Number,
    common_options,
    curve_options,
    device_option,
    line_options,
    one_json_option,
    seed_option,
    shape_options,
    view_options,
)
from .outputs import check_outputs, print_json
from .progress import ProgressDisplay
from .shape import Shape

if TYPE_CHECKING:
    import numpy as np

UNEXPLAINED = 0.9  # share of the lines' length drawn, below which one is told that no law was found


@click.command(
    epilog="""\b
Examples:
  strokestyle fit drawing.png shape.obj
  strokestyle fit drawing.png shape.obj -o charcoal.pt --preset quick
  strokestyle fit drawing.kra shape.obj --layer Ink
  strokestyle fit scan.jpg shape.obj --camera camera.json --curves curves.json
  strokestyle fit drawing.png view.npz --preset paper --device cuda
  strokestyle fit drawing.png view.npz --preset paper --minutes 30 --resume"""
)
@click.argument("drawing", type=click.Path())
@click.argument("shape", type=click.Path())
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    default="model.pt",
    show_default=True,
    help="The model to write; a picture of the fit is written beside it.",
)
@click.option(
    "--layer",
    metavar="NAME",
    help="Learn from this layer of a .kra, .ora, .psd or .psb alone; else from what all of them "
    "show.",
)
@click.option(
    "--preset",
    type=click.Choice(PRESET_NAMES),
    default="standard",
    show_default=True,
    help="quick: half a minute; standard: a few minutes; paper: the paper's networks and "
    "schedule, for a GPU.",
)
@click.option(
    "--minutes",
    type=Number(0.1, 60 * 24 * 30),
    metavar="M",
    help="Take as many steps as this machine does in M minutes, learning rate brought down within "
    "them; never more than help (paper: than its schedule). How many differs from run to run, and "
    "so does the model.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Go on from OUT.pt.checkpoint, which an interrupted fit leaves; without one, start from "
    "the beginning. Ends with the model of a fit that was not interrupted.",
)
@seed_option
@device_option
@view_options
@shape_options
@line_options
@curve_options
@one_json_option
@common_options
def fit(
    drawing: str,
    shape: str,
    output: str,
    layer: str | None,
    preset: str,
    minutes: float | None,
    resume: bool,
    seed: int,
    device: str,
    tell: bool,
    **options: Any,
) -> None:
    """Learn a style from DRAWING, an artist's drawing of SHAPE.

    The drawing (PNG, JPEG, TIFF; .kra, .ora, .psd) is one made over the template of `strokestyle
    extract`, with the same view and line options. Beside the model OUT.pt a picture OUT.fit.png
    shows the drawing, what of it was not learned from, and what was learned.
    """
    picture = str(Path(output).with_suffix(".fit.png"))
    check_outputs([output, picture], [drawing, shape])
    view = Shape(shape, options).view(optional=True)
    if not len(view.curves):
        raise ValueError(
            f"{shape}: no visible curves from this view: there is nothing to learn from; "
            "try another --view"
        )
    from ..fit.exemplar import load_exemplar
    from ..geometry.threads import at_once

    with timed("read the drawing"), told_warnings():
        size = view.camera.width, view.camera.height
        required = view.curves.xy[view.required]
        read, _ = at_once(lambda: load_exemplar(drawing, *size, required, layer), import_ahead)
        exemplar, note = read
    if note:
        say(f"{drawing}: {note}")
    from ..fit.checkpoint import Checkpoint
    from ..fit.report import account, fit_report
    from ..fit.train import PRESETS, fit_drawing
    from ..render.style_file import save_style

    kept = Path(f"{output}.checkpoint")
    say_how_it_begins(kept, resume, minutes)
    checkpoint = Checkpoint(kept, resume=resume)
    started = time.perf_counter()
    try:
        with ProgressDisplay() as progress:
            fitted = fit_drawing(
                view,
                exemplar,
                PRESETS[preset],
                seed=seed,
                device=device,
                progress=progress,
                source=Path(drawing).name,
                checkpoint=checkpoint,
                minutes=minutes,
            )
    except KeyboardInterrupt:
        text = "go on with --resume" if kept.exists() else "there was nothing to keep yet"
        raise KeyboardInterrupt(f"interrupted; {text}") from None

    def keep() -> list[str]:
        save_style(output, fitted.style)
        checkpoint.remove()
        learned = fitted.learned
        return [] if learned is None else account(exemplar, learned).words(max(size))

    shown, words = at_once(lambda: fit_report(view, exemplar, fitted), keep)
    write_picture(picture, shown)
    say(f"{drawing}: {drawn_lines(fitted.style.about, fitted.style.choice is not None)}")
    if words:
        say(f"{drawing}: {'; '.join(words)} (marked in {picture})")
    seconds = time.perf_counter() - started
    say(f"{drawing}: learned in {seconds:.0f} s -> {output}, {picture}")
    if tell:
        about = fitted.style.about
        told = {"drawing": drawing, "shape": shape, "preset": preset, "files": [output, picture]}
        told |= {"lines": about["lines"], "lines_drawn": about["lines_drawn"]}
        print_json({**told, "seconds": round(seconds, 3)})


def import_ahead() -> None:
    """Import what a fit needs once its drawing is read."""
    from ..fit import report, train  # noqa: F401
    from ..render import style_file  # noqa: F401


def drawn_lines(about: dict[str, Any], chose: bool = True) -> str:
    """Tell how many of the lines the artist drew: "drew 31 of 54 lines (62 % of their length)".

    Where many were left out and it was not learned how the artist `chose`, it tells that too.
    """
    count, total = about["lines_drawn"], about["lines"]
    if count == total:
        return f"drew all {total} lines" if total > 1 else "drew the one line"
    share = min(100.0 * about["share_drawn"], 99.0)
    told = f"drew {count} of {total} lines ({share:.0f} % of their length)"
    if chose or about["share_drawn"] > UNEXPLAINED:
        return told
    return f"{told}, too few or too unlike to learn which; all lines will be drawn"


def say_how_it_begins(checkpoint: Path, resume: bool, minutes: float | None) -> None:
    """Tell what becomes of a checkpoint that an earlier fit left, or did not leave."""
    if resume and not checkpoint.exists():
        say(f"{checkpoint}: no checkpoint there; starting from the beginning")
    elif resume and minutes:
        say(f"{checkpoint}: going on with the steps chosen then, not with --minutes {minutes:g}")
    elif not resume and checkpoint.exists():
        say(
            f"{checkpoint}: left by an interrupted fit, to be replaced; "
            "--resume would go on from it"
        )


def write_picture(path: str, image: np.ndarray) -> None:
    """Write (H, W, 3) in [0, 1] as PNG."""
    from PIL import Image

    from ..files import replace_file

    picture = Image.fromarray((image * 255.0 + 0.5).astype("uint8"))
    replace_file(path, lambda name: picture.save(name, format="PNG"))
