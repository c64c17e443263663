"""`strokestyle render`: draw shapes in a learned style."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from .. import __version__
from .animation import (
    NOTHING,
    Animation,
    animation_options,
    draw_animation,
    frame_count,
    is_animation,
    is_film,
    plan_animation,
    refuse_one_place,
    sorted_outputs,
    warn_of_all_lines,
    warn_of_kinds,
)
from .batch import Recipe, draw_batch, how_to_run, read_list
from .messages import count_curves, say, timed
from .model import read_style
from .options import (
    CHOICES,
    TEXTURES,
    batch_options,
    check_look,
    common_options,
    curve_options,
    device_option,
    file_options,
    line_options,
    picture_options,
    picture_scale,
    seed_option,
    shape_options,
    view_options,
)
from .outputs import STANDARD_OUTPUT, PngLook, check_drawings, check_outputs, write_drawing
from .shape import Shape

if TYPE_CHECKING:
    from ..batch.outcome import Drawn
    from ..batch.plan import Job
    from ..drawing.strokes import Drawing
    from ..extract.view import View

# options of a shape that name files
FILE_OPTIONS = ("camera", "cameras", "curves")
FORMATS = ("svg", "svgz", "pdf", "png")
ENCODINGS = {"vector": "grain as paths", "image": "texture as images", "none": "flat ink"}


class RenderSettings(NamedTuple):
    """How every shape of a batch is drawn, and what is written of it.

    Parameters
    ----------
    model : file of the style
    device, seed : as `load_style` and `Style.draw` take them
    shape : the options of `Shape`, turntable included
    look : fields of SvgOptions
    write_drawing : whether the drawing itself is written
    also : files that it is written to besides, or suffixes of files beside it
    png : how its PNGs are drawn, and those of the stages
    stages : folder for the steps of the drawing, or None
    choice : "learned" or "all" lines
    animation : what moves, or None for drawings one by one
    """

    model: str
    device: str
    seed: int
    shape: dict[str, Any]
    look: dict[str, Any]
    write_drawing: bool
    also: tuple[str, ...]
    png: PngLook
    stages: str | None
    choice: str
    animation: Animation | None = None

    @property
    def also_files(self) -> list[str]:
        """Those of `also` that are files of their own."""
        from ..batch.plan import DRAWING_SUFFIXES

        return [place for place in self.also if place not in DRAWING_SUFFIXES]


@click.command(
    epilog="""\b
Examples:
  strokestyle render model.pt mesh.obj -o out.svg --png
  strokestyle render model.pt mesh.obj -o out.pdf -o out.png --page-size A3 --dpi 300
  strokestyle render model.pt *.ply -o drawings/
  strokestyle render model.pt meshes/ -o drawings/ --jobs 2 --timeout 60 --resume
  find meshes -name '*.stl' -print0 | strokestyle render model.pt - -o drawings/ --mirror
  strokestyle render model.pt mesh.obj -o spin.html -o spin.gif --turntable 24
  strokestyle render model.pt frames/*.obj --sequence -o walk.mp4
  strokestyle render model.pt mesh.obj --stages figure/
  strokestyle render model.pt mesh.obj -o - | gzip > out.svgz"""
)
@click.argument("model", type=click.Path())
@click.argument("shapes", nargs=-1, required=True, type=click.Path())
@click.option(
    "-o",
    "--output",
    "outputs",
    type=click.Path(),
    multiple=True,
    help="OUT.svg, .svgz, .pdf or .png, a folder for several drawings, or - for standard output. "
    "An animation also goes to OUT.html, .gif, .apng, .webp, .mp4 or .webm. May be given several "
    "times.",
)
@click.option(
    "--format",
    "formats",
    type=click.Choice(FORMATS),
    multiple=True,
    help="What drawings in a folder are written as; may be given several times.  [default: svg]",
)
@click.option(
    "--texture",
    type=click.Choice(TEXTURES),
    default="auto",
    show_default=True,
    help="vector: grain as paths, crisp at any size; image: a picture for each stroke; none: flat "
    "ink; auto: vector for grain in one ink, image for soft or coloured texture.",
)
@click.option(
    "--choice",
    type=click.Choice(CHOICES),
    default="learned",
    show_default=True,
    help="learned: the lines that the artist would draw, going by those left out of the exemplar; "
    "all: all of them.",
)
@picture_options
@file_options
@click.option(
    "--stages",
    type=click.Path(),
    metavar="DIR",
    help="Write how the drawing comes about, as SVG and PNG: DIR/SHAPE-1-curves, -2-displaced, "
    "-3-strokes, -4-textured, and all four on one -sheet.png. Takes the place of -o, or goes "
    "beside it.",
)
@animation_options
@batch_options
@seed_option
@device_option
@view_options
@shape_options
@line_options
@curve_options
@common_options
def render(
    model: str,
    shapes: tuple[str, ...],
    outputs: tuple[str, ...],
    formats: tuple[str, ...],
    texture: str,
    choice: str,
    png: bool,
    png_scale: float | None,
    dpi: float | None,
    stages: str | None,
    mirror: bool,
    seed: int,
    device: str,
    **options: Any,
) -> None:
    """Draw SHAPES in the hand of MODEL, one SVG each; or PDF, or PNG.

    A folder stands for all the meshes and views in it, and - for a list on standard input, one file
    a line or with NULs in between. Where one of several shapes cannot be drawn, the others are, and
    the exit code is 1. OUT/batch.jsonl tells what became of each.
    """
    if not (outputs or stages):
        raise click.UsageError("nothing to write: give -o OUT.svg, or --stages DIR")
    running = {name: options.pop(name) for name in batch_options.flags if name in options}
    look = {"texture": texture, **file_options.given(options)}
    animated = is_animation(options, stages)
    scale, films = picture_scale(png_scale, dpi), tuple[Path, ...]()
    output, also = (outputs[0] if outputs else None), outputs[1:]
    if animated and not stages:
        (output, films), also = sorted_outputs(outputs), ()
    else:
        refuse_films(outputs)
    suffix, *others = suffixes_of(formats, output, bool(films or also), animated and not stages)
    also += tuple(others)
    if output == STANDARD_OUTPUT:
        refuse_beside_standard_output(png, running)
    if stages:
        Path(stages).mkdir(parents=True, exist_ok=True)
        if animated and not options["still"]:
            say("--stages: each frame is drawn on its own, as with --still")
    clear = look.get("background") == NOTHING
    if clear and not (animated and not stages):
        del look["background"]
    check_look({k: v for k, v in look.items() if (k, v) != ("background", NOTHING)})
    listed, animation = read_list(shapes), None
    target = output or (str(films[0]) if films else os.path.join(str(stages), ""))
    if animated and not stages:
        batch, sequence = plan_animation(listed, output, films, mirror, options, suffix)
        refuse_one_place(batch, films, png, frame_count(options, sequence))
        written = output is not None, films
        animation = Animation(model, options, *written, look, seed, png, scale, sequence)
    else:
        batch = plan(listed, target, mirror, suffix)
        also += (".png",) if png else ()
    settings = RenderSettings(
        model,
        device,
        seed,
        shape=options,
        look=look,
        write_drawing=output is not None,
        also=also,
        png=PngLook(scale, None if clear else "#ffffff"),
        stages=stages,
        choice=choice,
        animation=animation,
    )
    check_outputs(settings.also_files, listed)
    check_options(batch, options)
    alone = shapes == (batch[0].shape,) or (animation is not None and animation.sequence)
    several = len(batch) > 1 or running["resume"] or not alone
    if draw_batch(recipe_of(settings), batch, how_to_run(target, several, stages, running)):
        sys.exit(1)


def refuse_beside_standard_output(png: bool, running: Mapping[str, Any]) -> None:
    """Raise a usage error where more than one SVG would go to standard output, or less."""
    if png:
        raise click.UsageError("standard output takes one SVG: no --png with -o -")
    flags = [flag for name, flag in batch_options.flags.items() if running.get(name)]
    flags = [flag for flag in flags if flag != "--jobs"]
    if flags:
        raise click.UsageError(f"-o - takes one SVG by itself: leave out {', '.join(flags)}")


def refuse_films(outputs: Sequence[str]) -> None:
    """Raise a usage error where drawings would go to films, or to several places."""
    from ..batch.plan import is_folder

    films = [o for o in outputs if is_film(o) and Path(o).suffix.lower() != ".png"]
    if films:
        raise click.UsageError(
            f"{films[0]}: a film has several frames: give --turntable N, --path CAMERAS.json or "
            "--sequence; a drawing is .svg, .svgz, .pdf or .png"
        )
    folders = [o for o in outputs if is_folder(o)]
    if folders and len(outputs) > 1:
        raise click.UsageError(
            f"{folders[0]}: several -o are files of one drawing; what is written in a folder, "
            f"--format tells ({', '.join(FORMATS)})"
        )
    if len(outputs) > 1:
        check_drawings(outputs)


def suffixes_of(
    formats: Sequence[str], output: str | None, several: bool, animated: bool
) -> list[str]:
    """Suffixes of the files that a folder is filled with; a usage error where it is no folder."""
    from ..batch.plan import is_folder

    if not formats:
        return [".svg"]
    if output is None or several or not is_folder(output):
        raise click.UsageError(
            "--format tells what is written in a folder, -o FOLDER/; a file's name tells by itself"
        )
    if animated and (len(formats) > 1 or formats[0] == "png"):
        raise click.UsageError(
            "frames are written as one of svg, svgz and pdf; --png writes PNGs beside them"
        )
    return [f".{form}" for form in dict.fromkeys(formats)]


def plan(shapes: Sequence[str], output: str, mirror: bool, suffix: str) -> list[Job]:
    """Which file each shape goes to; where that is not clear, the command line is wrong."""
    from ..batch.plan import UnclearOutput, plan_outputs

    try:
        return plan_outputs(shapes, output, mirror, suffix)
    except UnclearOutput as error:
        raise click.UsageError(str(error)) from None


def check_options(batch: Sequence[Job], options: Mapping[str, Any]) -> None:
    """Raise a usage error where options contradict each other or all shapes, before any is drawn.

    Where they contradict some of them only, those are not drawn.
    """
    wrong: list[click.UsageError] = []
    for job in batch:
        try:
            Shape(job.shape, options)
        except click.UsageError as error:
            wrong.append(error)
        except OSError:  # it is not there: that one is not drawn
            pass
    if wrong and len(wrong) == len(batch):
        raise wrong[0]


def recipe_of(settings: RenderSettings) -> Recipe:
    """How all shapes are drawn, and the key of all that this depends on."""
    from ..batch.keys import settings_key

    key = settings_key({"version": __version__, **settings._asdict()})
    return recipe_with(settings, key)


def recipe_with(settings: RenderSettings, key: str) -> Recipe:
    """How all shapes are drawn, where their key is known."""
    animation = settings.animation
    inputs = [settings.model, *(settings.shape.get(name) for name in FILE_OPTIONS)]
    folders = [settings.stages, *(str(Path(file).parent) for file in settings.also_files)]
    if animation:
        inputs += animation.sequence
        folders += [str(film.parent) for film in animation.films]
    return Recipe(
        functools.partial(read_style, settings.model, settings.device),
        functools.partial(draw_shape, settings),
        settings.model,
        key,
        tuple(dict.fromkeys(filter(None, inputs))),
        tuple(dict.fromkeys(filter(None, folders))),
        functools.partial(moved_recipe, settings, key),
    )


def moved_recipe(settings: RenderSettings, key: str, places: Mapping[str, str]) -> Recipe:
    """How all shapes are drawn where files and folders lie elsewhere: by their names here."""
    files = {name: value for name in FILE_OPTIONS if (value := settings.shape.get(name))}
    shape = {**settings.shape, **{name: places[value] for name, value in files.items()}}
    animation = settings.animation
    if animation:
        animation = animation._replace(
            options=shape,
            films=tuple(Path(places[str(film.parent)], film.name) for film in animation.films),
            sequence=tuple(places[name] for name in animation.sequence),
        )
    moved = settings._replace(
        model=places[settings.model],
        shape=shape,
        also=tuple(
            str(Path(places[str(Path(place).parent)], Path(place).name))
            if place in settings.also_files
            else place
            for place in settings.also
        ),
        stages=settings.stages and places[settings.stages],
        animation=animation,
    )
    return recipe_with(moved, key)


# --------------------------------------------------------------------------------------- one shape


def draw_shape(settings: RenderSettings, job: Job) -> Drawn:
    """Draw one shape from all sides that are asked for, and write that."""
    from ..batch.outcome import Drawn
    from ..render.choice import unknown_kinds

    style = read_style(settings.model, settings.device)
    if settings.choice == "all":
        style = replace(style, choice=None)
    if settings.animation:
        return draw_animation(settings.animation, style, job)
    optional = style.choice is not None and style.choice.optional is not None
    told, files, left_out, kept = [], [], set(), False
    drawn_lines, strokes = 0, 0
    for side, view in enumerate(Shape(job.shape, settings.shape).views(optional)):
        with timed("draw"):
            lines = style.choose(view)
            drawing = style.draw(lines, seed=settings.seed, choice="all")
        left_out.update(unknown_kinds(view, lines, style.choice))
        # to ask takes as long as to choose, and it cannot be where lines were left out
        if len(lines.curves.xy) == view.required.sum():
            kept |= style.leaves_nothing(view)
        drawn_lines, strokes = drawn_lines + len(lines.curves), strokes + len(drawing.strokes)
        for written in write_side(settings, job, side, lines, drawing):
            told.append(written.told)
            files += written.files
    warn_of_kinds(job.shape, left_out)
    if kept:
        warn_of_all_lines(job.shape)
    where = ", ".join(told) if len(told) < 4 else f"{told[0]} ... {told[-1]}"
    empty = not len(view.curves)
    note = " (no visible curves from this view: an empty drawing)" if empty else ""
    summary = f"{job.shape}: {count_curves(lines.curves, len(view.curves))} -> {where}{note}"
    return Drawn(summary, files, drawn_lines, strokes)


class Written(NamedTuple):
    """Files of one kind, and what to say of them."""

    told: str
    files: list[str]


def write_side(
    settings: RenderSettings, job: Job, side: int, view: View, drawing: Drawing
) -> list[Written]:
    """Write what is asked for of one side of a shape."""
    from ..batch.plan import numbered_output, picture_suffix

    title, count = Path(job.shape).stem, settings.shape["turntable"]
    written = []
    if settings.write_drawing:
        places = [
            numbered_output(place, side, count) if count else place
            for place in (job.output, *settings.also_files)
        ]
        beside = [place for place in settings.also if place not in settings.also_files]
        places += [str(Path(places[0]).with_suffix(suffix)) for suffix in beside]
        written.append(write_files(settings, drawing, list(dict.fromkeys(places)), title))
    if settings.stages:
        suffix = picture_suffix(side, count) if count else ""
        name = os.path.join(settings.stages, title + suffix)
        written.append(write_stages(settings, view, drawing, name, title))
    return written


def write_files(
    settings: RenderSettings, drawing: Drawing, places: list[str], title: str
) -> Written:
    """Write one drawing to files, as what each is by its name."""
    from ..svg.format import SvgOptions
    from ..svg.write import resolve_texture, write_svg

    made_by = {"title": title, "description": f"Drawn by strokestyle {__version__}"}
    with timed("write the SVG"):
        look = resolve_texture(drawing, SvgOptions(**{**made_by, **settings.look}))
        text = write_svg(drawing, look)
    with timed("write the files"):
        write_drawing(places, text, settings.png)
    told = ", ".join(places)
    return Written(told if look.plotter else f"{told} ({ENCODINGS[look.texture]})", places)


def write_stages(
    settings: RenderSettings, view: View, drawing: Drawing, name: str, title: str
) -> Written:
    """Write the steps of one drawing as `name`-1-curves.svg and so on."""
    from ..files import write_bytes
    from ..render.figure import figure_files, figure_steps

    background = settings.look.get("background")
    texture = settings.look["texture"]
    with timed("stages"):
        steps = figure_steps(view, drawing, title=title, background=background, texture=texture)
        files = figure_files(steps, settings.png.scale)
        for part, data in files.items():
            write_bytes(f"{name}-{part}", data)
    return Written(f"{name}-sheet.png and its parts", [f"{name}-{part}" for part in files])
