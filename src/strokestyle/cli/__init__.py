"""The command line: each command reads files, calls one library function, writes one file, and says so on stderr."""

from __future__ import annotations

import functools
import os
import sys
import time
from pathlib import Path

import click

from .. import __version__
from ..geometry.kinds import SURFACE_KINDS

# torch makes its threads wait by spinning unless told otherwise before it is imported. On two cores shared with
# other work that made a fit 5 times slower (138 s for 25 s); sleeping at once made it a quarter slower on idle ones
# (17.3 s for 13.7 s). So they spin for some 30 microseconds, and then sleep.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


os.environ.setdefault("GOMP_SPINCOUNT", "30000")

# Text for --help, so that it needs no import; tests/test_cli.py checks it against the library.
VIEWS = "front, three-quarter, side, back, top"
VIEW_SUFFIXES = (".npz",)
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".3mf", ".dae", ".xyz", ".wrl")
PRESET_NAMES = ("quick", "standard", "paper")
LEAST_DETAIL, MOST_DETAIL = 0.1, 10.0


def say(text: str = "", level: int = 0) -> None:
    """Tell the user on stderr; `level` 1 only with -v, and nothing with -q."""
    if _verbosity() >= level:
        click.echo(text, err=True)


def _verbosity() -> int:
    context = click.get_current_context(silent=True)
    return context.meta.get("strokestyle.verbosity", 0) if context else 0


class timed:
    """`with stage("lines"):` says with -v how long that took."""

    def __init__(self, name: str):
        self.name = name

    def __enter__(self):
        self.start = time.perf_counter()

    def __exit__(self, *error):
        if error[0] is None:
            say(f"  {self.name}: {time.perf_counter() - self.start:.2f} s", level=1)


# ---------------------------------------------------------------------------------------------------- option types


class Size(click.ParamType):
    name = "PX|WxH"

    def convert(self, value, param, ctx):
        if isinstance(value, tuple):
            return value
        parts = str(value).lower().split("x")
        if len(parts) in (1, 2) and all(part.isdigit() for part in parts):
            width, height = int(parts[0]), int(parts[-1])
            if 64 <= width <= 8192 and 64 <= height <= 8192:
                return width, height
        self.fail(
            f"{value!r} is no canvas size: give pixels from 64 to 8192, such as 768 or 1024x768",
            param,
            ctx,
        )


class ViewName(click.ParamType):
    name = "NAME|AZ,EL"

    def convert(self, value, param, ctx):
        from ..extract.camera import parse_view

        try:
            parse_view(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)
        return value


class Kinds(click.ParamType):
    name = "KIND,..."

    def convert(self, value, param, ctx):
        if isinstance(value, tuple):
            return value
        names = tuple(part.strip() for part in value.split(",") if part.strip())
        if names == ("all",):
            return SURFACE_KINDS
        wrong = [name for name in names if name not in SURFACE_KINDS]
        if wrong or not names:
            self.fail(
                f"{', '.join(wrong) or 'nothing'}: no such kind of line; there are {', '.join(SURFACE_KINDS)}, all"
            )
        return names


class Detail(click.ParamType):
    name = "N|LOW..HIGH"

    def convert(self, value, param, ctx):
        if isinstance(value, tuple):
            return value
        low, dots, high = str(value).partition("..")
        try:
            low = float(low)
            high = float(high) if dots else low
        except ValueError:
            self.fail(
                f"{value!r} is neither a number nor a range: give one such as 2, or 0.5..2",
                param,
                ctx,
            )
        if not (LEAST_DETAIL <= low <= MOST_DETAIL and LEAST_DETAIL <= high <= MOST_DETAIL):
            self.fail(
                f"{value}: detail lies between {LEAST_DETAIL:g} and {MOST_DETAIL:g}", param, ctx
            )
        if high < low:
            self.fail(
                f"{value}: a range of detail runs from LOW to HIGH: {high:g}..{low:g}", param, ctx
            )
        return low, high


def _options(*options):
    def decorate(function):
        return functools.reduce(lambda f, option: option(f), reversed(options), function)

    return decorate


def _set_verbosity(ctx, param, value):
    if value:
        ctx.meta["strokestyle.verbosity"] = -1 if param.name == "quiet" else 1


common_options = _options(
    click.option(
        "-q",
        "--quiet",
        is_flag=True,
        expose_value=False,
        callback=_set_verbosity,
        help="Say nothing but errors.",
    ),
    click.option(
        "-v",
        "--verbose",
        is_flag=True,
        expose_value=False,
        callback=_set_verbosity,
        help="Say how long each stage takes.",
    ),
)

view_options = _options(
    click.option(
        "--view",
        type=ViewName(),
        help=f"Where the eye stands: {VIEWS}, or azimuth,elevation in degrees.  [default: three-quarter]",
    ),
    click.option(
        "--camera",
        type=click.Path(),
        help="A camera.json (eye, target, up, fov_y_deg, size), in place of the view options.",
    ),
    click.option(
        "--fov",
        type=click.FloatRange(1, 150),
        help="Vertical field of view, degrees.  [default: 30]",
    ),
    click.option(
        "--up",
        type=click.Choice(["y", "z"]),
        help="Which axis of the mesh points up.  [default: y]",
    ),
    click.option("--size", type=Size(), help="Canvas, pixels.  [default: 768]"),
)

line_options = _options(
    click.option(
        "--lines",
        type=Kinds(),
        help="Kinds of line to draw: "
        + ", ".join(SURFACE_KINDS)
        + ", or all.  [default: all but apparent]",
    ),
    click.option(
        "--crease",
        type=click.FloatRange(1, 180),
        help="Dihedral angle of a crease, degrees.  [default: 40]",
    ),
    click.option(
        "--suggestive",
        type=click.FloatRange(0),
        help="Threshold of suggestive contours, in units of the feature size.  [default: 0.01]",
    ),
    click.option(
        "--ridge",
        type=click.FloatRange(0),
        help="Threshold of ridges, in units of the feature size.  [default: 0.4]",
    ),
    click.option(
        "--valley",
        type=click.FloatRange(0),
        help="Threshold of valleys, in units of the feature size.  [default: 0.1]",
    ),
    click.option(
        "--apparent",
        type=click.FloatRange(0),
        help="Threshold of apparent ridges, in units of the feature size.  [default: 0.1]",
    ),
    click.option(
        "--detail",
        type=Detail(),
        help="More (2) or fewer (0.5) soft lines: all thresholds but the crease's at once. LOW..HIGH: the lines of "
        "LOW, each followed as far as it would be drawn at HIGH.  [default: 1; 0.1<=x<=10]",
    ),
    click.option(
        "--spacing",
        type=click.FloatRange(0.5, 50),
        help="Distance of the curves' points, pixels.  [default: 3]",
    ),
    click.option(
        "--curves", type=click.Path(), help="Draw these curves (.json or .svg) instead of our own."
    ),
)

seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**31 - 1),
    default=0,
    show_default=True,
    help="Same seed, same machine, same bytes.",
)

device_option = click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="Where to compute; auto takes CUDA where there is one.",
)

file_options = _options(
    click.option(
        "--tones",
        type=click.IntRange(1, 8),
        metavar="N",
        help="Tones of a vector texture, 1 to 8.  [default: 3]",
    ),
    click.option(
        "--texture-res",
        type=click.FloatRange(0.1, 16),
        metavar="R",
        help="Pixels of an image texture per pixel.  [default: 1.75]",
    ),
    click.option(
        "--tolerance",
        type=click.FloatRange(0, 100, min_open=True),
        metavar="PX",
        help="How far an outline may be off; a tone's edge, twice that.  [default: 0.1]",
    ),
    click.option(
        "--page-size",
        metavar="A4|WxHmm",
        help="Paper: A0 to A6, letter, legal, or for instance 210x297mm.",
    ),
    click.option(
        "--layers",
        type=click.Choice(["kind", "part", "none"]),
        help="A layer for each kind of line, in it one for each named part of the mesh; part: the other way round; "
        "none: strokes in painting order.  [default: kind]",
    ),
    click.option(
        "--decimals", type=click.IntRange(0, 6), help="Decimals of the coordinates.  [default: 2]"
    ),
    click.option(
        "--title", metavar="TEXT", help="Title of the drawing.  [default: the shape's name]"
    ),
    click.option("--author", metavar="NAME", help="Author, told in the file's metadata."),
    click.option(
        "--license",
        metavar="NAME|URL",
        help="Licence, likewise: CC-BY-4.0, CC0-1.0 ..., a URL, or other words.",
    ),
    click.option(
        "--background", metavar="COLOR", help="A paper rectangle under the strokes, as #rrggbb."
    ),
    click.option(
        "--plotter", is_flag=True, default=None, help="Centre lines only, in mm, for pen plotters."
    ),
    click.option(
        "--inkscape-lpe",
        is_flag=True,
        default=None,
        help="Flat strokes as Inkscape's PowerStrokes, whose width it edits; other programs show the same outlines.",
    ),
)


# -------------------------------------------------------------------------------------------------------- commands


class Group(click.Group):
    """One place that turns errors for the person into one line and exit code 1."""

    def invoke(self, ctx):
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


def describe(error: BaseException) -> str:
    """One line for the person."""
    if isinstance(error, MemoryError):
        return "out of memory: try a smaller --size or a simplified mesh"
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        text = f"{error.filename}: {error.strerror[0].lower()}{error.strerror[1:]}"
    else:
        text = str(error) or type(error).__name__
    return " ".join(text.split())


@click.group(
    cls=Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(__version__, prog_name="strokestyle")
def main():
    """Learn how an artist draws lines from ONE drawing of a 3D shape, and draw any other shape in that hand.

    \b
    strokestyle extract shape.obj -o sheet.png        the curves, to draw over
    strokestyle fit drawing.png shape.obj             learn the hand
    strokestyle render model.pt other.obj -o out.svg  draw with it
    strokestyle edit out.svg -o new.svg --wiggle 3,40 change the drawing
    strokestyle view out.svg -o page.html             look at it and play with it

    A shape is any mesh that trimesh reads (obj, ply, stl, off, glb, ...), or a view saved by extract (.npz).
    """


@main.command(
    epilog="""\b
Examples:
  strokestyle extract teapot.obj -o sheet.png
  strokestyle extract teapot.obj -o curves.svg -o view.npz --view 40,20
  strokestyle extract scan.ply -o lines.svg --lines contour,valley --valley 0.2
  strokestyle extract scan.ply -o lines.svg --detail 0.5..2
  strokestyle extract part.stl -o lines.svg --hidden --lines contour,crease
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
    help="Also the hidden parts of contours, boundaries, creases and intersections, dashed, on layers of their own.",
)
@view_options
@line_options
@common_options
def extract(shape, outputs, **options):
    """Find the feature curves of SHAPE and write them.

    \b
    OUT.png   the sheet that an artist draws over
    OUT.svg   the curves, one layer per kind of line
    OUT.npz   the whole view, for fit and render: camera, curves, feature maps
    OUT.json  camera and curves for other programs
    """
    for output in outputs:
        if output != "-" and Path(output).suffix.lower() not in (
            ".png",
            ".svg",
            ".svgz",
            ".npz",
            ".json",
        ):
            raise click.UsageError(
                f"{output}: cannot tell what to write; name it .png, .svg, .npz or .json"
            )
    _check_outputs(outputs, [shape])
    view = Views(shape, options).view()
    for output in outputs:
        _write_view(view, output, Path(shape).stem)
    behind = f"; hidden: {_count(view.hidden)}" if options["hidden"] else ""
    say(f"{shape}: {_count(view.curves)}{behind} -> {', '.join(outputs)}")


@main.command(
    epilog="""\b
Examples:
  strokestyle fit drawing.png shape.obj
  strokestyle fit drawing.png shape.obj -o charcoal.pt --preset quick
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
    "--preset",
    type=click.Choice(PRESET_NAMES),
    default="standard",
    show_default=True,
    help="quick: half a minute; standard: a few minutes; paper: the paper's networks and schedule, for a GPU.",
)
@click.option(
    "--minutes",
    type=click.FloatRange(0.1, 60 * 24 * 30),
    metavar="M",
    help="Take as many steps as this machine does in M minutes, learning rate brought down within them; never more "
    "than help (paper: than its schedule). How many differs from run to run, and so does the model.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Go on from OUT.pt.checkpoint, which an interrupted fit leaves; without one, start from the beginning. Ends "
    "with the model of a fit that was not interrupted.",
)
@seed_option
@device_option
@view_options
@line_options
@common_options
def fit(drawing, shape, output, preset, minutes, resume, seed, device, **options):
    """Learn a style from DRAWING, an artist's drawing of SHAPE.

    The drawing (PNG, JPEG, TIFF) is one made over the sheet of `strokestyle extract`, with the same view and line
    options. Beside the model OUT.pt a sheet OUT.png shows drawing, mask, and what was learned of both.
    """
    sheet = str(Path(output).with_suffix(".png"))
    _check_outputs([output, sheet], [drawing, shape])
    view = Views(shape, options).view()
    if not len(view.curves):
        raise ValueError(
            f"{shape}: no visible curves from this view: there is nothing to learn from; try another --view"
        )
    from ..fit.exemplar import load_exemplar

    with timed("read the drawing"):
        exemplar, note = load_exemplar(
            drawing, view.camera.width, view.camera.height, view.curves.xy
        )
    if note:
        say(f"{drawing}: {note}")
    from ..fit.checkpoint import Checkpoint
    from ..fit.report import fit_report
    from ..fit.train import PRESETS, fit_style
    from ..render.style_file import save_style

    checkpoint = Checkpoint(f"{output}.checkpoint", resume=resume)
    if resume and not checkpoint.path.exists():
        say(f"{checkpoint.path}: no checkpoint there; starting from the beginning")
    elif resume and minutes:
        say(
            f"{checkpoint.path}: going on with the steps chosen then, not with --minutes {minutes:g}"
        )
    elif not resume and checkpoint.path.exists():
        say(
            f"{checkpoint.path}: left by an interrupted fit, to be replaced; --resume would go on from it"
        )
    started = time.perf_counter()
    try:
        with Progress() as progress:
            style = fit_style(
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
        kept = checkpoint.path.exists()
        text = "go on with --resume" if kept else "there was nothing to keep yet"
        raise KeyboardInterrupt(f"interrupted; {text}") from None
    save_style(output, style)
    checkpoint.remove()
    _write_png(sheet, fit_report(view, exemplar, style))
    say(f"{drawing}: learned in {time.perf_counter() - started:.0f} s -> {output}, {sheet}")


@main.command(
    epilog="""\b
Examples:
  strokestyle render model.pt mesh.obj -o out.svg --png
  strokestyle render model.pt *.ply -o drawings/
  strokestyle render model.pt meshes/ -o drawings/ --jobs 2 --view side
  strokestyle render model.pt mesh.obj -o spin/ --turntable 24 --png
  strokestyle render model.pt mesh.obj --stages figure/
  strokestyle render model.pt mesh.obj -o - | gzip > out.svgz"""
)
@click.argument("model", type=click.Path())
@click.argument("shapes", nargs=-1, required=True, type=click.Path())
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    help="OUT.svg, OUT.svgz, a folder for several drawings, or - for standard output.",
)
@click.option(
    "--texture",
    type=click.Choice(["auto", "vector", "image", "none"]),
    default="auto",
    show_default=True,
    help="vector: grain as paths, crisp at any size; image: a picture for each stroke; none: flat ink; auto: vector "
    "for grain in one ink, image for soft or coloured texture.",
)
@click.option("--png", is_flag=True, help="Write a PNG preview beside each SVG.")
@click.option(
    "--png-scale",
    type=click.FloatRange(0.1, 16),
    default=1.0,
    show_default=True,
    help="Preview pixels per SVG pixel.",
)
@file_options
@click.option(
    "--turntable",
    type=click.IntRange(1, 3600),
    metavar="N",
    help="N drawings round the upright axis, OUT-000.svg ...",
)
@click.option(
    "--stages",
    type=click.Path(),
    metavar="DIR",
    help="Write how the drawing comes about, as SVG and PNG: DIR/SHAPE-1-curves, -2-displaced, -3-strokes, "
    "-4-textured, and all four on one -sheet.png. Takes the place of -o, or goes beside it.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1, 256),
    default=1,
    show_default=True,
    help="Shapes drawn at the same time.",
)
@seed_option
@device_option
@view_options
@line_options
@common_options
def render(model, shapes, output, jobs, **options):
    """Draw SHAPES in the hand of MODEL, one SVG each.

    A folder stands for all the meshes and views in it. Where one of several shapes cannot be drawn, the others are,
    and the exit code is 1.
    """
    if output is None and not options["stages"]:
        raise click.UsageError("nothing to write: give -o OUT.svg, or --stages DIR")
    if options["stages"]:
        Path(options["stages"]).mkdir(parents=True, exist_ok=True)
    plan = _plan(shapes, output or os.path.join(options["stages"], ""), options)
    options["drawings"] = output is not None
    if jobs > 1 and len(plan) > 1:
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import get_context

        workers = min(jobs, len(plan))
        with ProcessPoolExecutor(workers, get_context("spawn"), _share_cores, (workers,)) as pool:
            work = functools.partial(_render_one, model, options)
            failed = _report(pool.map(work, *zip(*plan, strict=True)), len(plan))
    else:
        failed = _report(
            (_render_one(model, options, shape, out) for shape, out in plan), len(plan)
        )
    if failed:
        sys.exit(1)


def _share_cores(workers: int) -> None:
    """In a new process, before the libraries that read this are imported."""
    os.environ["OMP_NUM_THREADS"] = str(max(1, (os.cpu_count() or 1) // workers))


class EditCommand(click.Command):
    """Remembers in which order the edits stand on the command line; click hands over each option's values apart."""

    def parse_args(self, ctx, args):
        options = {name: p for p in self.params if isinstance(p, click.Option) for name in p.opts}
        order, rest = [], iter(args)
        for word in rest:
            name, equals, _ = word.partition("=")
            option = options.get(name if word.startswith("--") else word[:2])
            if option is None:
                continue
            if option.name in EDITS:
                order.append(option.name)
            if not (option.is_flag or equals or (not word.startswith("--") and len(word) > 2)):
                next(rest, None)
        ctx.meta["strokestyle.order"] = order
        return super().parse_args(ctx, args)


class EditText(click.ParamType):
    """An edit: (sheet, seed) -> sheet."""

    def __init__(self, edit: str, name: str):
        self.edit, self.name = edit, name

    def convert(self, value, param, ctx):
        from .edit_text import parse_edit

        try:
            return parse_edit(self.edit, value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


def _edit_option(name, metavar, text):
    return click.option(
        f"--{name}", type=EditText(name, metavar), multiple=True, metavar=metavar, help=text
    )


EDITS = ("thickness", "wiggle", "smooth", "simplify", "move", "taper", "recolor", "restyle", "drop")


@main.command(
    cls=EditCommand,
    epilog="""\b
Any edit but --move, --restyle and --drop can be for certain lines only, by kind or by part of the mesh:
--thickness contour=1.5, --recolor wheel,hub=#a33. --drop names them likewise.

\b
Examples:
  strokestyle edit out.svg -o thick.svg --thickness 2
  strokestyle edit out.svg -o alive.svg --wiggle 3,40 --taper 30 --seed 5
  strokestyle edit out.svg -o moved.svg --move s004:0.5:20,-10
  strokestyle edit out.svg -o calm.svg --drop 'valley<40' --smooth 6 --recolor valley=#a33
  strokestyle edit out.svg -o brush.svg --restyle brush.pt
  strokestyle render model.pt mesh.obj -o - | strokestyle edit - -o - --wiggle 2,30 | inkscape --pipe ...""",
)
@click.argument("drawing", metavar="IN.svg", type=click.Path())
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    required=True,
    help="OUT.svg, OUT.svgz, or - for standard output.",
)
@_edit_option("thickness", "K", "Every thickness times K.")
@_edit_option(
    "wiggle", "AMPLITUDE,WAVELENGTH", "Make lines tremble by up to AMPLITUDE px; their ends stay."
)
@_edit_option("smooth", "PX", "Smooth lines over PX; their ends stay.")
@_edit_option(
    "simplify", "PX", "Draw lines through as few points as keep them within PX, curved between."
)
@_edit_option(
    "move",
    "STROKE:POINT:DX,DY",
    "Move the point at POINT (0 to 1) of a stroke by DX,DY px; others follow.",
)
@_edit_option("taper", "PX", "Bring strokes to a point over PX at either end.")
@_edit_option("recolor", "COLOR", "Change the ink's colour, the texture's too.")
@click.option(
    "--restyle",
    type=click.Path(),
    multiple=True,
    metavar="MODEL",
    help="Draw the lines in another hand.",
)
@_edit_option(
    "drop", "WHAT", "Take strokes out: '<20' the shorter ones, 'valley,ridge', or 'valley<20'."
)
@click.option(
    "--texture",
    type=click.Choice(["auto", "vector", "image", "none"]),
    help="As in render.  [default: as it is]",
)
@click.option("--png", is_flag=True, help="Write a PNG preview beside the SVG.")
@file_options
@seed_option
@common_options
def edit(drawing, output, png, seed, restyle, **options):
    """Change an SVG that render wrote, and perhaps others worked on; edits are made in the order in which they stand.

    The texture follows the strokes. Strokes that are not edited stay as they are; what is no stroke (text, shapes of
    your own), and clips, gradients and filters on strokes are not kept. IN.svg may be - for standard input. Points and
    sizes are pixels of the drawing.
    """
    if output != "-" and Path(output).suffix.lower() not in (".svg", ".svgz"):
        raise click.UsageError(f"{output}: edit writes .svg or .svgz")
    if png and output == "-":
        raise click.UsageError("standard output takes one SVG: no --png with -o -")
    _check_outputs([output], [drawing] if drawing != "-" else [])
    from ..svg.read import read_svg_file
    from ..svg.write import png_from_svg, write_svg, write_text
    from .edit_text import NamedDrawing

    with timed("read the drawing"):
        found = read_svg_file(sys.stdin.buffer.read() if drawing == "-" else drawing)
    sheet = NamedDrawing(found.drawing, found.ids)
    waiting = {name: list(options.pop(name)) for name in EDITS if name != "restyle"} | {
        "restyle": list(restyle)
    }
    for name in click.get_current_context().meta["strokestyle.order"]:
        change = waiting[name].pop(0)
        with timed(name):
            sheet = _restyled(change, sheet, seed) if name == "restyle" else change(sheet, seed)
    given = {name: value for name, value in options.items() if value is not None}
    if given.get("inkscape_lpe"):
        given.setdefault("texture", "none")
    with timed("write the SVG"):
        text = write_svg(sheet.drawing, found.options, ids=sheet.ids, kept=found.kept, **given)
    written = output
    if output == "-":
        click.echo(text, nl=False)
    else:
        write_text(output, text)
        if png:
            from ..files import write_bytes

            preview = str(Path(output).with_suffix(".png"))
            write_bytes(preview, png_from_svg(text))
            written += f", {preview}"
    lost = {
        "hidden strokes": found.hidden,
        "shapes": found.others,
        "clips, gradients, filters": found.effects,
    }
    lost = ", ".join(f"{what} {n}" for what, n in lost.items() if n)
    say(
        f"{drawing}: {len(sheet.ids)} strokes -> {written}"
        + (f"; left out: {lost}" if lost else "")
    )


def _restyled(model: str, sheet, seed: int):
    """The sheet's centre lines in the hand of a model, which knows nothing of the shape."""
    from ..extract.pipeline import view_of_lines
    from ..geometry.curves import Curves
    from .edit_text import NamedDrawing

    strokes, (width, height) = sheet.drawing.strokes, sheet.drawing.size
    style = _style(model, "auto")
    curves = Curves(strokes.xy, strokes.offsets, strokes.kind, strokes.closed)
    lines = view_of_lines(curves, width, height, parts=sheet.drawing.parts)
    drawing = style.draw(lines, seed=seed)
    return NamedDrawing(drawing, ("",) * len(drawing.strokes))


@main.command(
    epilog="""\b
Examples:
  strokestyle view out.svg -o page.html
  strokestyle view drawings/*.svg -o page.html --open
  strokestyle render model.pt mesh.obj -o - | strokestyle view - -o page.html"""
)
@click.argument("files", nargs=-1, required=True, type=click.Path())
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    required=True,
    help="The page to write; - is standard output.",
)
@click.option("--open", "show", is_flag=True, help="Show it in the browser.")
@common_options
def view(files, output, show):
    """Write a page on which to look at FILES and play with them.

    FILES are SVGs that render or edit wrote, and - is standard input. The page is one HTML file that works without a
    network: zoom, layers, sliders for thickness and wiggle, strokes bent by dragging their points, before and after,
    undo, and a button that saves the edited SVG.
    """
    _check_outputs([output], [file for file in files if file != "-"])
    if show and output == "-":
        raise click.UsageError("--open needs a file to open: give -o page.html")
    from ..svg.read import read_svg_file
    from ..svg.write import write_svg
    from ..viewer.page import page_html

    drawings = []
    for name, file in zip(_short_names(files), files, strict=True):
        found = read_svg_file(sys.stdin.buffer.read() if file == "-" else file)
        with timed(f"write {name} anew"):
            # Inkscape's live effect is left out: the page could not keep it in step with the outline
            text = write_svg(
                found.drawing,
                found.options,
                ids=found.ids,
                kept=found.kept,
                strips=True,
                inkscape_lpe=False,
            )
            drawings.append((name, text))
    page = page_html(drawings)
    if output == "-":
        click.echo(page, nl=False)
    else:
        from ..files import write_bytes

        write_bytes(output, page.encode("utf-8"))
    say(f"{', '.join(files)} -> {output}")
    if show:
        import webbrowser

        webbrowser.open(Path(output).resolve().as_uri())


def _short_names(files) -> list[str]:
    """The names of files without their folders, where that tells them apart."""
    names = ["drawing.svg" if file == "-" else Path(file).name for file in files]
    return names if len(set(names)) == len(names) else [str(file) for file in files]


def _report(results, total: int) -> int:
    """Say what became of each shape as it is done; the number that failed."""
    failed = 0
    for done, error in results:
        if error:
            say(f"strokestyle: {error}", level=-1)
            failed += 1
        else:
            say(done)
    if failed and total > 1:
        say(f"{total - failed} of {total} shapes drawn", level=-1)
    return failed


def _plan(shapes, output: str, options: dict) -> list[tuple[str, str]]:
    """(shape, output file) for every drawing wanted. Refuses what would overwrite an input or another output."""
    found = []
    for shape in shapes:
        if Path(shape).is_dir():
            inside = sorted(
                p
                for p in Path(shape).iterdir()
                if p.suffix.lower() in MESH_SUFFIXES + VIEW_SUFFIXES
            )
            if not inside:
                raise ValueError(
                    f"{shape}: no mesh and no view in this folder ({', '.join(MESH_SUFFIXES)}, .npz)"
                )
            found += [str(path) for path in inside]
        else:
            found.append(shape)
    folder = Path(output)
    to_folder = output != "-" and (
        output.endswith(("/", os.sep)) or folder.is_dir() or folder.suffix == ""
    )
    if len(found) > 1 and not to_folder:
        raise click.UsageError(
            f"{len(found)} shapes need a folder to go to, such as -o drawings/, not {output}"
        )
    if output == "-":
        if options["png"] or options["turntable"]:
            raise click.UsageError(
                "standard output takes one SVG: no --png and no --turntable with -o -"
            )
        return [(found[0], "-")]
    if to_folder:
        folder.mkdir(parents=True, exist_ok=True)
        plan = [(shape, str(folder / (Path(shape).stem + ".svg"))) for shape in found]
    else:
        if folder.suffix.lower() not in (".svg", ".svgz"):
            raise click.UsageError(f"{output}: render writes .svg or .svgz, or a folder of them")
        plan = [(found[0], output)]
    taken = {}
    for shape, out in plan:
        if out in taken:
            raise click.UsageError(
                f"{taken[out]} and {shape} would both be written to {out}: draw them into two folders"
            )
        taken[out] = shape
    _check_outputs(list(taken), found)
    return plan


def _render_one(model: str, options: dict, shape: str, output: str) -> tuple[str, str]:
    """Draw one shape. Returns (what was written, "") or ("", error), so that one bad mesh does not stop a batch."""
    try:
        return _draw(model, options, shape, output), ""
    except (ValueError, OSError, MemoryError) as error:
        line = describe(error)
        return "", line if any(
            str(name) in line for name in (shape, model, output)
        ) else f"{shape}: {line}"


@functools.lru_cache(maxsize=1)
def _style(model: str, device: str):
    from ..render.style_file import load_style

    with timed("load the model"):
        return load_style(model, device=device)


def _draw(model: str, options: dict, shape: str, output: str) -> str:
    style = _style(model, options["device"])
    from ..svg.format import SvgOptions
    from ..svg.write import png_from_svg, resolve_texture, write_svg, write_text

    views, written = Views(shape, options), []
    for suffix, view in views.turntable(options["turntable"]):
        target = (
            output
            if not suffix
            else str(Path(output).with_name(Path(output).stem + suffix + Path(output).suffix))
        )
        with timed("draw"):
            drawing = style.draw(view, seed=options["seed"])
        look = {
            "texture": options["texture"],
            "title": Path(shape).stem,
            "background": options["background"],
        }
        if options["drawings"]:
            with timed("write the SVG"):
                file = {name: options[name] for name in FILE_OPTIONS if options[name] is not None}
                made = SvgOptions(
                    **{"description": f"Drawn by strokestyle {__version__}", **look, **file}
                )
                made = resolve_texture(drawing, made)
                text = write_svg(drawing, made)
                if target == "-":
                    click.echo(text, nl=False)
                else:
                    write_text(target, text)
            if options["png"]:
                from ..files import write_bytes

                with timed("preview"):
                    preview = str(Path(target).with_suffix(".png"))
                    write_bytes(preview, png_from_svg(text, options["png_scale"]))
                    target += f", {preview}"
            written.append(target if made.plotter else f"{target} ({ENCODINGS[made.texture]})")
        if options["stages"]:
            with timed("stages"):
                name = os.path.join(options["stages"], Path(shape).stem + suffix)
                written.append(_write_stages(name, view, drawing, options["png_scale"], look))
    many = "" if len(written) < 4 else f" ... {written[-1]}"
    note = "" if len(view.curves) else " (no visible curves from this view: an empty drawing)"
    return f"{shape}: {_count(view.curves)} -> {', '.join(written[:3]) if not many else written[0]}{many}{note}"


def _write_stages(name: str, view, drawing, scale: float, look: dict) -> str:
    """Write `name`-1-curves.svg and the rest; returns what to call them."""
    from ..files import write_bytes
    from ..render.figure import figure_files, figure_steps

    for part, data in figure_files(figure_steps(view, drawing, **look), scale).items():
        write_bytes(f"{name}-{part}", data)
    return f"{name}-sheet.png and its parts"


# --------------------------------------------------------------------------------------------------------- helpers


class Views:
    """A SHAPE argument and its view and line options: loads what is needed once, and gives views of it."""

    def __init__(self, shape: str, options: dict):
        self.shape, self.options = shape, options
        given = [name for name in ("view", "fov", "up", "size") if options.get(name) is not None]
        if options.get("camera") and given:
            raise click.UsageError(
                f"--camera already says where the eye stands: leave out --{', --'.join(given)}"
            )
        self.saved = Path(shape).suffix.lower() in VIEW_SUFFIXES
        if options.get("hidden") and (self.saved or options.get("curves")):
            raise click.UsageError(
                "--hidden needs a mesh and its own curves, not a saved view or --curves"
            )
        if self.saved:
            named = [name for name in LINE_OPTIONS + VIEW_OPTIONS if options.get(name) is not None]
            if named:
                raise click.UsageError(
                    f"{shape} is a saved view, with camera and curves: leave out --{', --'.join(named)}"
                )
        elif not Path(shape).exists():
            raise FileNotFoundError(f"{shape}: no such file")

    @functools.cached_property
    def surface(self):
        from ..mesh.surface import load_surface

        with timed("read the mesh"):
            return load_surface(self.shape)

    @functools.cached_property
    def scene(self):
        from ..extract.rays import Bvh

        return Bvh(self.surface)

    def camera(self, turn: float = 0.0):
        from ..extract.camera import (
            DEFAULT_FOV,
            DEFAULT_SIZE,
            Camera,
            fit_camera,
            parse_view,
            swept,
        )

        if self.options.get("camera"):
            return Camera.load(self.options["camera"]).turned(turn)
        azimuth, elevation = parse_view(self.options.get("view") or "three-quarter")
        width, height = self.options.get("size") or (DEFAULT_SIZE, DEFAULT_SIZE)
        fov, up = self.options.get("fov") or DEFAULT_FOV, self.options.get("up") or "y"
        vertices = self.surface.vertices
        if self.options.get(
            "turntable"
        ):  # what fits however it is turned: the picture does not breathe
            vertices = swept(vertices, up)
        return fit_camera(vertices, f"{azimuth},{elevation}", fov, width, height, up).turned(turn)

    def view(self, turn: float = 0.0):
        from ..extract.pipeline import extract_view, view_of_curves
        from ..extract.view_file import load_view
        from ..geometry.curves import DEFAULT_SPACING

        if self.saved:
            return load_view(self.shape)
        camera = self.camera(turn)
        spacing = self.options.get("spacing") or DEFAULT_SPACING
        if self.options.get("curves"):
            from ..render.curve_file import load_curves

            curves = load_curves(self.options["curves"], (camera.width, camera.height))
            with timed("feature maps"):
                return view_of_curves(self.surface, camera, curves, spacing, scene=self.scene)
        surface, scene = self.surface, self.scene
        with timed("curves and feature maps"):
            hidden = self.options.get("hidden", False)
            return extract_view(
                surface, camera, self.line_options(), spacing, scene=scene, hidden=hidden
            )

    def line_options(self):
        from ..extract.line_options import LineOptions

        given = {
            name: self.options[name]
            for name in LINE_OPTIONS[:-3]
            if self.options.get(name) is not None
        }
        if "lines" in given:
            given["kinds"] = given.pop("lines")
        options = LineOptions(**given)
        return options.detailed(*self.options["detail"]) if self.options.get("detail") else options

    def turntable(self, count: int | None):
        """("", view), or count times ("-000", view), once round the upright axis."""
        if not count:
            yield "", self.view()
            return
        if self.saved or self.options.get("curves"):
            raise click.UsageError(
                "--turntable needs a mesh and its own curves: a saved view and --curves have one side"
            )
        digits = max(3, len(str(count - 1)))
        for i in range(count):
            yield f"-{i:0{digits}d}", self.view(360.0 * i / count)


VIEW_OPTIONS = ("view", "camera", "fov", "up", "size")
FILE_OPTIONS = (
    "tones",
    "texture_res",
    "tolerance",
    "page_size",
    "layers",
    "decimals",
    "title",
    "author",
    "license",
    "background",
    "plotter",
    "inkscape_lpe",
)

ENCODINGS = {"vector": "grain as paths", "image": "texture as images", "none": "flat ink"}
LINE_OPTIONS = (
    "lines",
    "crease",
    "suggestive",
    "ridge",
    "valley",
    "apparent",
    "detail",
    "spacing",
    "curves",
)


def _check_outputs(outputs, inputs) -> None:
    """Before any work: every output can be written, and none is an input."""
    from ..files import check_writable

    for output in outputs:
        if output == "-":
            continue
        check_writable(output)
        for source in inputs:
            if Path(output).exists() and Path(source).exists() and os.path.samefile(output, source):
                raise ValueError(f"{output}: is the input; give the output another name")


def _write_view(view, output: str, title: str) -> None:
    from ..extract.view_file import save_view, view_to_json
    from ..files import write_bytes
    from ..svg.write import plain_svg, png_from_svg, write_text

    suffix = ".svg" if output == "-" else Path(output).suffix.lower()
    if suffix == ".npz":
        save_view(output, view)
    elif suffix == ".json":
        import json

        write_bytes(output, json.dumps(view_to_json(view), separators=(",", ":")).encode())
    else:
        size = (view.camera.width, view.camera.height)
        paper = "#ffffff" if suffix == ".png" else None
        (curves, parts), (hidden, hidden_parts) = (
            view.pieces_by_part(),
            view.pieces_by_part(hidden=True),
        )
        page = {"title": title, "background": paper}
        text = plain_svg(
            curves, size, hidden=hidden, parts=parts, hidden_parts=hidden_parts, **page
        )
        if output == "-":
            click.echo(text, nl=False)
        elif suffix == ".png":
            write_bytes(output, png_from_svg(text))
        else:
            write_text(output, text)


def _write_png(path: str, image) -> None:
    """Write (H, W, 3) in [0, 1]."""
    from PIL import Image

    from ..files import replace_file

    picture = Image.fromarray((image * 255.0 + 0.5).astype("uint8"))
    replace_file(path, lambda name: picture.save(name, format="PNG", optimize=True))


def _count(curves) -> str:
    """ "41 curves, 5312 px (contour 20, valley 21)"."""
    import numpy as np

    from ..geometry.curves import KINDS

    if not len(curves):
        return "no curves"
    kinds = ", ".join(
        f"{name} {n}"
        for name, n in zip(KINDS, np.bincount(curves.kind, minlength=len(KINDS)), strict=True)
        if n
    )
    return (
        f"{len(curves)} curve{'s' * (len(curves) > 1)}, {curves.lengths().sum():.0f} px ({kinds})"
    )


class Progress:
    """The fit's progress on stderr: a bar with losses and time left on a terminal, a line per stage elsewhere."""

    def __init__(self):
        self.bar = self.task = self.stage = None

    def __enter__(self):
        if _verbosity() >= 0 and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
            from rich.progress import Progress as Bar

            columns = (
                TextColumn("{task.description}"),
                BarColumn(24),
                TextColumn("{task.completed}/{task.total}"),
                TextColumn("{task.fields[losses]}"),
                TimeElapsedColumn(),
                TextColumn("{task.fields[left]}"),
            )
            self.bar = Bar(*columns, console=Console(stderr=True), refresh_per_second=4)
            self.bar.start()
        return self

    def __exit__(self, *error):
        if self.bar:
            self.bar.stop()

    def __call__(self, event) -> None:
        losses = " ".join(f"{name} {value:.4f}" for name, value in event.losses.items())
        if self.bar:
            if event.stage != self.stage:
                self.task = self.bar.add_task(event.stage, total=event.steps, losses="", left="")
            left = "" if event.seconds_left is None else f"{event.seconds_left:.0f} s left"
            self.bar.update(self.task, completed=event.step, losses=losses, left=left)
        elif event.step >= event.steps:
            say(f"  {event.stage}: {event.steps} steps {losses}")
        self.stage = event.stage


if __name__ == "__main__":
    main()
