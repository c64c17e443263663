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
    Number,
    batch_options,
    check_look,
    common_options,
    curve_options,
    device_option,
    file_options,
    line_options,
    seed_option,
    shape_options,
    view_options,
)
from .outputs import STANDARD_OUTPUT, write_preview, write_svg_text
from .shape import Shape

if TYPE_CHECKING:
    from ..batch.outcome import Drawn
    from ..batch.plan import Job
    from ..drawing.strokes import Drawing
    from ..extract.view import View

# options of a shape that name files
FILE_OPTIONS = ("camera", "cameras", "curves")
ENCODINGS = {"vector": "grain as paths", "image": "texture as images", "none": "flat ink"}


class RenderSettings(NamedTuple):
    """How every shape of a batch is drawn, and what is written of it.

    Parameters
    ----------
    model : file of the style
    device, seed : as `load_style` and `Style.draw` take them
    shape : the options of `Shape`, turntable included
    look : fields of SvgOptions
    write_svg : whether the drawing itself is written
    preview : pixels of its PNG per pixel of the SVG, or None for no PNG
    stages : folder for the steps of the drawing, or None
    stages_scale : pixels of their PNGs per pixel of the drawing
    choice : "learned" or "all" lines
    animation : what moves, or None for drawings one by one
    """

    model: str
    device: str
    seed: int
    shape: dict[str, Any]
    look: dict[str, Any]
    write_svg: bool
    preview: float | None
    stages: str | None
    stages_scale: float
    choice: str
    animation: Animation | None = None


@click.command(
    epilog="""\b
Examples:
  strokestyle render model.pt mesh.obj -o out.svg --png
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
    help="OUT.svg, OUT.svgz, a folder for several drawings, or - for standard output. An animation "
    "also goes to OUT.html, .gif, .apng, .webp, .mp4 or .webm, and to several at once: -o may be "
    "given several times.",
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
@click.option("--png", is_flag=True, help="Write a PNG preview beside each SVG.")
@click.option(
    "--png-scale",
    type=Number(0.1, 16),
    default=1.0,
    show_default=True,
    help="Pixels of previews and films per SVG pixel.",
)
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
    texture: str,
    choice: str,
    png: bool,
    png_scale: float,
    stages: str | None,
    mirror: bool,
    seed: int,
    device: str,
    **options: Any,
) -> None:
    """Draw SHAPES in the hand of MODEL, one SVG each.

    A folder stands for all the meshes and views in it, and - for a list on standard input, one file
    a line or with NULs in between. Where one of several shapes cannot be drawn, the others are, and
    the exit code is 1. OUT/batch.jsonl tells what became of each.
    """
    if not (outputs or stages):
        raise click.UsageError("nothing to write: give -o OUT.svg, or --stages DIR")
    running = {name: options.pop(name) for name in batch_options.flags if name in options}
    look = {"texture": texture, **file_options.given(options)}
    animated = is_animation(options, stages)
    output, films = sorted_outputs(outputs, animated)
    if output == STANDARD_OUTPUT:
        refuse_beside_standard_output(png, running)
    if stages:
        Path(stages).mkdir(parents=True, exist_ok=True)
        if animated and not options["still"]:
            say("--stages: each frame is drawn on its own, as with --still")
    if look.get("background") == NOTHING and not (animated and not stages):
        del look["background"]
    check_look({k: v for k, v in look.items() if (k, v) != ("background", NOTHING)})
    listed, animation = read_list(shapes), None
    target = output or (str(films[0]) if films else os.path.join(str(stages), ""))
    if animated and not stages:
        batch, sequence = plan_animation(listed, output, films, mirror, options)
        refuse_one_place(batch, films, png, frame_count(options, sequence))
        written = output is not None, films
        animation = Animation(model, options, *written, look, seed, png, png_scale, sequence)
    else:
        batch = plan(listed, target, mirror)
    settings = RenderSettings(
        model,
        device,
        seed,
        shape=options,
        look=look,
        write_svg=output is not None,
        preview=png_scale if png else None,
        stages=stages,
        stages_scale=png_scale,
        choice=choice,
        animation=animation,
    )
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


def plan(shapes: Sequence[str], output: str, mirror: bool) -> list[Job]:
    """Which file each shape goes to; where that is not clear, the command line is wrong."""
    from ..batch.plan import UnclearOutput, plan_outputs

    try:
        return plan_outputs(shapes, output, mirror)
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
    folders = [settings.stages]
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
    if settings.write_svg:
        output = numbered_output(job.output, side, count) if count else job.output
        written.append(write_drawing(settings, drawing, output, title))
    if settings.stages:
        suffix = picture_suffix(side, count) if count else ""
        name = os.path.join(settings.stages, title + suffix)
        written.append(write_stages(settings, view, drawing, name, title))
    return written


def write_drawing(settings: RenderSettings, drawing: Drawing, output: str, title: str) -> Written:
    """Write one drawing, and its preview."""
    from ..svg.format import SvgOptions
    from ..svg.write import resolve_texture, write_svg

    made_by = {"title": title, "description": f"Drawn by strokestyle {__version__}"}
    with timed("write the SVG"):
        look = resolve_texture(drawing, SvgOptions(**{**made_by, **settings.look}))
        text = write_svg(drawing, look)
        write_svg_text(output, text)
    files = [output]
    if settings.preview:
        with timed("preview"):
            files.append(write_preview(output, text, settings.preview))
    told = ", ".join(files)
    return Written(told if look.plotter else f"{told} ({ENCODINGS[look.texture]})", files)


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
        files = figure_files(steps, settings.stages_scale)
        for part, data in files.items():
            write_bytes(f"{name}-{part}", data)
    return Written(f"{name}-sheet.png and its parts", [f"{name}-{part}" for part in files])
