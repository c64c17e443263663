"""What the commands' options take, and the groups of options that several commands share."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click

from ..geometry.kinds import SURFACE_KINDS
from .messages import VERBOSITY

Function = TypeVar("Function", bound=Callable[..., Any])

# Text for --help, so that it needs no import of numpy; tests compare it with the library.
VIEWS = "front, three-quarter, side, back, left, right, top, bottom, isometric, dimetric"
PROJECTIONS = ("perspective", "parallel")
PRESET_NAMES = ("quick", "standard", "paper")
TEXTURES = ("auto", "vector", "image", "none")
CHOICES = ("learned", "all")
SIZES = (64, 8192)  # px, the least and the most of a canvas's side


# ------------------------------------------------------------------------------- what options take


class Number(click.FloatRange):
    """A number in a range; nan, which is neither below nor above any, is in none."""

    def convert(
        self, value: Any, param: click.Parameter | None, context: click.Context | None
    ) -> Any:
        """Read a number."""
        number = super().convert(value, param, context)
        if math.isnan(number):
            self.fail(f"{value} is not a number.", param, context)
        return number


class Size(click.ParamType):
    """The canvas: "768" or "1024x768" -> (width, height) in pixels."""

    name = "PX|WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        parts = str(value).lower().split("x")
        if len(parts) in (1, 2) and all(part.isdigit() for part in parts):
            size = int(parts[0]), int(parts[-1])
            if SIZES[0] <= min(size) and max(size) <= SIZES[1]:
                return size
        self.fail(
            f"{value!r} is no canvas size: give pixels from {SIZES[0]} to {SIZES[1]}, "
            "such as 768 or 1024x768",
            param,
            ctx,
        )


class ViewName(click.ParamType):
    """Where the eye stands: a name or "azimuth,elevation", kept as text and checked."""

    name = "NAME|AZ,EL"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from ..extract.camera import parse_view

        try:
            parse_view(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)
        return value


class SectionAt(click.ParamType):
    """Where the shape is cut open: "x:12.5", "-y:50%", kept as text and checked."""

    name = "AXIS:OFFSET"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from ..mesh.planes import parse_section

        try:
            parse_section(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)
        return value


class Kinds(click.ParamType):
    """Kinds of line: "contour,valley" or "all" -> their names."""

    name = "KIND,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        if isinstance(value, tuple):
            return value
        names = tuple(part.strip() for part in value.split(",") if part.strip())
        if names == ("all",):
            return SURFACE_KINDS
        wrong = [name for name in names if name not in SURFACE_KINDS]
        if wrong or not names:
            self.fail(
                f"{', '.join(wrong) or 'nothing'}: no such kind of line; "
                f"there are {', '.join(SURFACE_KINDS)}, all",
                param,
                ctx,
            )
        return names


class Detail(click.ParamType):
    """Detail of the soft lines: "2" or "0.5..2" -> (low, high)."""

    name = "N|LOW..HIGH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        from ..extract.line_options import MAX_DETAIL, MIN_DETAIL

        if isinstance(value, tuple):
            return value
        first, dots, last = str(value).partition("..")
        try:
            low = float(first)
            high = float(last) if dots else low
        except ValueError:
            self.fail(
                f"{value!r} is neither a number nor a range: give one such as 2, or 0.5..2",
                param,
                ctx,
            )
        if not all(MIN_DETAIL <= detail <= MAX_DETAIL for detail in (low, high)):
            self.fail(f"{value}: detail lies between {MIN_DETAIL:g} and {MAX_DETAIL:g}", param, ctx)
        if high < low:
            self.fail(
                f"{value}: a range of detail runs from LOW to HIGH: {high:g}..{low:g}", param, ctx
            )
        return low, high


class MemorySize(click.ParamType):
    """Memory: "2G", "1.5G" or "800M" -> bytes."""

    name = "SIZE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        match = re.fullmatch(r"(\d+(?:\.\d*)?)\s*([KMGT])(?:I?B)?", str(value).strip().upper())
        if not match or float(match[1]) <= 0:
            self.fail(f"{value!r} is no size of memory: give one such as 800M or 2G", param, ctx)
        return int(float(match[1]) * 1024 ** (1 + "KMGT".index(match[2])))


# ----------------------------------------------------------------------------------- option groups


class OptionGroup:
    """Options that several commands share: a decorator that knows the names of its options.

    Parameters
    ----------
    options : what `click.option` gives, in the order of the help text

    Attributes
    ----------
    flags : of each option, by the name of the parameter that its value is passed as:
        {"page_size": "--page-size"}
    """

    def __init__(self, *options: Callable[[Function], Function]):
        self.options = options
        command = click.command("group")(self(lambda: None))
        self.flags = {param.name: param.opts[-1] for param in command.params}

    def __call__(self, function: Function) -> Function:
        return functools.reduce(lambda f, option: option(f), reversed(self.options), function)

    def given(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Those of `values` that are of this group and not None, by the parameters' names."""
        return {name: values[name] for name in self.flags if values.get(name) is not None}

    def given_flags(self, values: Mapping[str, Any]) -> list[str]:
        """The options of this group whose values are not None, as the command line has them."""
        return [self.flags[name] for name in self.given(values)]


def _set_verbosity(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value:
        ctx.meta[VERBOSITY] = -1 if param.name == "quiet" else 1


def _none_if_empty(
    ctx: click.Context, param: click.Parameter, value: tuple[str, ...]
) -> tuple[str, ...] | None:
    """What was given of an option that may be given several times; None where it was not."""
    return value or None


common_options = OptionGroup(
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

# Where a page goes.
page_options = OptionGroup(
    click.option(
        "-o",
        "--output",
        type=click.Path(),
        required=True,
        help="The page to write; - is standard output.",
    ),
    click.option("--open", "show", is_flag=True, help="Show it in the browser."),
)

view_options = OptionGroup(
    click.option(
        "--view",
        type=ViewName(),
        help=f"Where the eye stands: {VIEWS}, or azimuth,elevation in degrees."
        "  [default: three-quarter]",
    ),
    click.option(
        "--camera",
        type=click.Path(),
        help="A camera.json (projection, eye, target, up, fov_y_deg or extent, size), in place of "
        "the view options.",
    ),
    click.option(
        "--projection",
        type=click.Choice(PROJECTIONS),
        help="parallel: the eye is infinitely far off, and parallel lines stay parallel."
        "  [default: parallel for isometric and dimetric, else perspective]",
    ),
    click.option(
        "--fov",
        type=Number(1, 150),
        help="Vertical field of view of a perspective, degrees.  [default: 30]",
    ),
    click.option(
        "--up",
        type=click.Choice(["y", "z"]),
        help="Which axis of the mesh points up.  [default: y]",
    ),
    click.option("--size", type=Size(), help="Canvas, pixels.  [default: 768]"),
)

# Which of the shape is drawn.
shape_options = OptionGroup(
    click.option(
        "--hide",
        metavar="PART,...",
        multiple=True,
        callback=_none_if_empty,
        help="Leave out named parts of the mesh, so that what lies behind them is seen; may be "
        "given several times. A name with commas goes in double quotes. The camera stays as it is "
        "without.",
    ),
    click.option(
        "--section",
        type=SectionAt(),
        multiple=True,
        callback=_none_if_empty,
        help="Cut the shape open across x, y or z of the mesh and draw the cut: x:12.5 in its own "
        "units, x:50% of its extent. The side nearer to the eye is taken away; +x:50% takes what "
        "lies towards the axis' tip, -x:50% the other. Closed bodies are solid. May be given "
        "several times. The camera stays as it is without.",
    ),
)

# What LineOptions takes, under its names.
line_options = OptionGroup(
    click.option(
        "--lines",
        "kinds",
        type=Kinds(),
        help="Kinds of line to draw: "
        + ", ".join(SURFACE_KINDS)
        + ", or all.  [default: all but apparent]",
    ),
    click.option(
        "--crease",
        type=Number(1, 180),
        help="Dihedral angle of a crease, degrees.  [default: 40]",
    ),
    click.option(
        "--suggestive",
        type=Number(0),
        help="Threshold of suggestive contours, in units of the feature size.  [default: 0.01]",
    ),
    click.option(
        "--ridge",
        type=Number(0),
        help="Threshold of ridges, in units of the feature size.  [default: 0.4]",
    ),
    click.option(
        "--valley",
        type=Number(0),
        help="Threshold of valleys, in units of the feature size.  [default: 0.1]",
    ),
    click.option(
        "--apparent",
        type=Number(0),
        help="Threshold of apparent ridges, in units of the feature size.  [default: 0.1]",
    ),
)

# What is done with the lines besides, or what is drawn in their place.
curve_options = OptionGroup(
    click.option(
        "--detail",
        type=Detail(),
        help="More (2) or fewer (0.5) soft lines: all thresholds but the crease's at once. "
        "LOW..HIGH: the lines of LOW, each followed as far as it would be drawn at HIGH."
        "  [default: 1; 0.1<=x<=10]",
    ),
    click.option(
        "--spacing",
        type=Number(0.5, 50),
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
    help="Where the networks of --preset paper compute; auto takes CUDA where there is one.",
)

json_option = click.option(
    "--json",
    "tell",
    is_flag=True,
    help="Print what became of each shape on standard output as it is done, a line of JSON each.",
)

one_json_option = click.option(
    "--json",
    "tell",
    is_flag=True,
    help="Print what became of it on standard output, as a line of JSON.",
)

DPI = 96.0  # pixels an inch of an SVG

# How PNGs of drawings are written.
picture_options = OptionGroup(
    click.option("--png", is_flag=True, help="Write a PNG beside each drawing."),
    click.option(
        "--png-scale",
        type=Number(0.1, 16),
        help="Pixels of PNGs and films per SVG pixel.  [default: 1]",
    ),
    click.option(
        "--dpi",
        type=Number(9.6, 2400),
        help="Resolution of PNGs on the page, in place of --png-scale, which is in 96ths of it: "
        "--page-size A3 --dpi 300 is 3508 x 4961 pixels, lying for wide drawings.",
    ),
)


def picture_scale(png_scale: float | None, dpi: float | None) -> float:
    """Pixels of PNGs per pixel of the SVG; a usage error where both options tell."""
    if png_scale is not None and dpi is not None:
        raise click.UsageError("--dpi and --png-scale both say how fine PNGs are: give one")
    if dpi is not None:
        return dpi / DPI
    return 1.0 if png_scale is None else png_scale


# How many shapes are drawn: none of it changes a drawing.
batch_options = OptionGroup(
    click.option(
        "--jobs",
        type=click.IntRange(1, 256),
        help="Shapes drawn at the same time.  [default: one a core, up to 8, where memory holds "
        "them]",
    ),
    click.option(
        "--mirror",
        is_flag=True,
        help="Look for shapes in the folders of a folder too, and keep their folders: "
        "-o out/ draws meshes/a/x.obj into out/a/x.svg.",
    ),
    click.option(
        "--resume",
        is_flag=True,
        help="Go on with a batch that was stopped: draw only what OUT/batch.jsonl does not know as "
        "drawn with this model, options and shape, or what is not whole.",
    ),
    click.option(
        "--timeout",
        type=Number(0, min_open=True),
        metavar="SECONDS",
        help="Give up a shape that takes longer, and go on with the others.",
    ),
    click.option(
        "--memory",
        type=MemorySize(),
        help="Give up a shape for which a worker needs more, such as 2G, and go on with the "
        "others. On Linux and macOS.",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Draw at the workers of a Dask scheduler, such as tcp://host:8786 or "
        "tls://host:8786: shapes and model are sent there and the drawings brought back; no folder "
        "is shared. Or the scheduler's file, NAME.json.",
    ),
    json_option,
)


def check_look(look: Mapping[str, Any]) -> None:
    """Raise a usage error where values of `file_options`, or a texture, make no SVG."""
    from ..svg.format import SvgOptions

    try:
        SvgOptions(**look)
    except ValueError as error:
        raise click.UsageError(str(error)) from None


# How an SVG is written: fields of SvgOptions, under their names.
file_options = OptionGroup(
    click.option(
        "--tones",
        type=click.IntRange(1, 8),
        metavar="N",
        help="Tones of a vector texture, 1 to 8.  [default: 3]",
    ),
    click.option(
        "--texture-res",
        type=Number(0.1, 16),
        metavar="R",
        help="Pixels of an image texture per pixel.  [default: 1.75]",
    ),
    click.option(
        "--tolerance",
        type=Number(0, 100, min_open=True),
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
        help="A layer for each kind of line, in it one for each named part of the mesh; "
        "part: the other way round; none: strokes in painting order.  [default: kind]",
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
        "--background",
        metavar="COLOR",
        help="A paper rectangle under the strokes, as #rrggbb. PNGs and films are white without; "
        "none leaves them transparent.",
    ),
    click.option(
        "--plotter", is_flag=True, default=None, help="Centre lines only, in mm, for pen plotters."
    ),
    click.option(
        "--inkscape-lpe",
        is_flag=True,
        default=None,
        help="Flat strokes as Inkscape's PowerStrokes, whose width it edits; "
        "other programs show the same outlines.",
    ),
)
