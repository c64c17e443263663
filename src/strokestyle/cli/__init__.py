"""The command line: each command reads files, calls the library, and says what it wrote."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
from typing import Any

import click

from .. import __version__
from . import edit, extract, fit, render, report, view
from .messages import describe, say


class Group(click.Group):
    """The one place that turns errors for the person into one line and exit code 1."""

    def main(self, *args: Any, **options: Any) -> Any:
        open_standard_streams()
        use_one_blas_thread()
        look_for_cycles_rarely()
        return super().main(*args, **options)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.exceptions.Exit, click.ClickException, click.Abort):
            raise
        except BrokenPipeError:
            sys.stderr.close()  # the reader of a pipe went away: not an error of ours
            ctx.exit(1)
        except KeyboardInterrupt as error:
            say(f"strokestyle: {error or 'interrupted'}", level=-1)
            ctx.exit(130)
        except (ValueError, OSError, MemoryError) as error:
            say(f"strokestyle: {describe(error)}", level=-1)
            ctx.exit(1)


def use_one_blas_thread() -> None:
    """Let numpy, once it is imported, multiply matrices in one thread, unless the person says.

    They are small here. A second thread gains nothing, waits for work at the full cost of a core,
    and on a machine that has other things to do a product takes twenty times as long.
    """
    if "OMP_NUM_THREADS" not in os.environ:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def look_for_cycles_rarely() -> None:
    """Have Python look for garbage in cycles after as many new objects as a drawing takes.

    By default it looks after every 700 and walks over all modules time and again while they are
    imported, a twentieth of the time of one drawing. What we make is let go without it.
    """
    gc.set_threshold(200_000)


def open_standard_streams() -> None:
    """Open what of standard input, output and error is closed: to nothing.

    A daemon may close them. Else the next file that is opened takes their numbers, so that what is
    for people is written into it, and Python has None in the streams' place.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free is this one
            with contextlib.suppress(OSError):
                os.set_inheritable(number, True)  # workers have it as well
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w" if number else "r"))


@click.group(
    cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(__version__, prog_name="strokestyle")
def main() -> None:
    """Learn how an artist draws lines from ONE drawing of a 3D shape, and draw any other shape in
    that hand.

    \b
    strokestyle extract shape.obj -o template.png     the curves, to draw over
    strokestyle fit drawing.png shape.obj             learn the hand
    strokestyle render model.pt other.obj -o out.svg  draw with it
    strokestyle edit out.svg -o new.svg --wiggle 3,40 change the drawing
    strokestyle view out.svg -o page.html             look at it and play with it
    strokestyle report drawings/ -o report.html       see what became of many

    A shape is a mesh (obj, ply, stl, off, glb, 3mf, dae, step, ...), or a view saved by
    extract (.npz).
    """


for command in (extract.extract, fit.fit, render.render, edit.edit, view.view, report.report):
    main.add_command(command)


if __name__ == "__main__":
    main()
