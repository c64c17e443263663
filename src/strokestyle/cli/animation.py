"""Draw an animation: what moves, how, and which frames and films are written of it."""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from .. import __version__
from .messages import say, timed, told_warnings
from .options import Number, OptionGroup, view_options
from .outputs import STANDARD_OUTPUT, PngLook, preview_of, write_drawing
from .progress import FrameDisplay
from .shape import Shape

if TYPE_CHECKING:
    import numpy as np

    from ..batch.outcome import Drawn
    from ..batch.plan import Job
    from ..drawing.strokes import Drawing
    from ..extract.camera import Camera
    from ..film.page import FilmPage
    from ..film.pictures import Pictures
    from ..mesh.surface import Surface
    from ..motion.frames import Frame, Shot
    from ..render.neural_strokes import NeuralStrokesStyle
    from ..render.style import Style
    from ..svg.format import SvgOptions

FILMS = (".html", ".gif", ".apng", ".png", ".webp", ".mp4", ".webm")
DEFAULT_RATE = 12.0  # frames a second
BOIL_ON_TWOS = 0.5
SLOWED = 100  # pictures a second from which browsers show images of several more slowly
NOTHING = "none"  # as a background: transparent

animation_options = OptionGroup(
    click.option(
        "--turntable",
        type=click.IntRange(1, 3600),
        metavar="N",
        help="An animation of N frames once round the upright axis, OUT-000.svg ... With "
        "--sequence, which has as many frames, the shape moves while it turns.",
    ),
    click.option(
        "--path",
        "cameras",
        type=click.Path(),
        metavar="CAMERAS.json",
        help="An animation seen by a camera that moves: a JSON list of what camera.json files "
        "hold, one for each frame.",
    ),
    click.option(
        "--sequence",
        is_flag=True,
        default=None,
        help="SHAPES are the frames of one mesh that deforms, with the same faces.",
    ),
    click.option(
        "--still",
        is_flag=True,
        default=None,
        help="Draw each frame of an animation on its own: strokes do not persist from one to the "
        "next.",
    ),
    click.option(
        "--fps",
        type=Number(0.1, 240),
        help=f"Frames a second of a film.  [default: {DEFAULT_RATE:g}]",
    ),
    click.option(
        "--on-twos",
        is_flag=True,
        default=None,
        help="Draw every other frame and hold it for two, as films drawn by hand do.",
    ),
    click.option(
        "--boil",
        type=Number(0, 1),
        metavar="B",
        help="How much of a hand's chance is new in every drawing: 0 none, 1 all of it."
        f"  [default: 0; {BOIL_ON_TWOS:g} with --on-twos]",
    ),
)
MOVES = {"turntable": "--turntable", "cameras": "--path", "sequence": "--sequence"}


class Animation(NamedTuple):
    """How an animation is drawn, and what is written of it.

    Parameters
    ----------
    model : file of the style
    options : values of the shape's options and of `animation_options`, by their parameters' names
    frames : whether its frames are written as SVG
    films : the films that are written
    look : fields of SvgOptions; a background NOTHING leaves films transparent
    seed : as `Style.draw` takes it
    preview : whether a PNG is written beside each frame
    scale : pixels of it, and of films, per pixel of a frame
    sequence : the files of the frames of a mesh that deforms; none where it keeps still
    """

    model: str
    options: dict[str, Any]
    frames: bool
    films: tuple[Path, ...]
    look: dict[str, Any]
    seed: int
    preview: bool
    scale: float
    sequence: tuple[str, ...] = ()

    @property
    def rate(self) -> Fraction:
        """Frames a second."""
        from ..film.timing import rate_of

        return rate_of(self.options.get("fps") or DEFAULT_RATE)

    @property
    def exposure(self) -> int:
        """For how many frames each drawing is held."""
        return 2 if self.options.get("on_twos") else 1

    @property
    def loops(self) -> bool:
        """Whether the first frame follows the last."""
        return bool(self.options.get("turntable")) and not self.sequence

    @property
    def transparent(self) -> bool:
        """Whether films have no background."""
        return self.look.get("background") == NOTHING

    @property
    def boil(self) -> float:
        """How much of the chance is new in every drawing."""
        given = self.options.get("boil")
        if given is None:
            return BOIL_ON_TWOS if self.exposure > 1 else 0.0
        return given


# ------------------------------------------------------------------------------- what is asked for


def is_animation(options: Mapping[str, Any], stages: str | None) -> bool:
    """Whether the options ask for an animation; a usage error where they contradict each other.

    `stages` : the folder for the steps of a drawing
    """
    if any(options.get(name) for name in MOVES):
        _refuse_contradictions(options, stages)
        return True
    given = animation_options.given_flags({**options, "turntable": None, "cameras": None})
    if given:
        raise click.UsageError(
            f"{', '.join(given)}: of an animation: give --turntable N, --path CAMERAS.json or "
            "--sequence too"
        )
    return False


def _refuse_contradictions(options: Mapping[str, Any], stages: str | None) -> None:
    if stages and (options.get("cameras") or options.get("sequence")):
        raise click.UsageError("--stages goes with --turntable alone, not with --path, --sequence")
    if options.get("cameras"):
        flags = view_options.given_flags(options)
        flags += ["--turntable"] if options.get("turntable") else []
        if flags:
            raise click.UsageError(
                f"--path already says where the eye stands: leave out {', '.join(flags)}"
            )
    if options.get("still") and options.get("boil") is not None:
        raise click.UsageError(
            "--boil is what is new from drawing to drawing, and --still draws each on its own: "
            "leave out one of them"
        )
    if options.get("sequence") and options.get("section") and not options.get("still"):
        raise click.UsageError(
            "--section cuts each frame of a sequence into other faces, so that no line is known "
            "again: give --still, or leave out --section"
        )
    if options.get("curves"):
        moves = next(flag for name, flag in MOVES.items() if options.get(name))
        raise click.UsageError(f"{moves} needs the mesh's own curves: leave out --curves")


class Outputs(NamedTuple):
    """What -o asks for: where frames go, or None, and the films."""

    frames: str | None
    films: tuple[Path, ...]


def sorted_outputs(outputs: Sequence[str]) -> Outputs:
    """Tell frames from films among the outputs; a usage error where they do not go together."""
    films = tuple(Path(o) for o in outputs if is_film(o))
    others = [o for o in outputs if not is_film(o)]
    if STANDARD_OUTPUT in others:
        raise click.UsageError("standard output takes one SVG: give -o FOLDER/, or -o OUT.gif ...")
    if len(others) > 1:
        raise click.UsageError(
            f"frames go to one place, not to {' and '.join(others)}; films are {', '.join(FILMS)}"
        )
    real = [film.resolve() for film in films]
    twice = [film for i, film in enumerate(films) if real[i] in real[:i]]
    if twice:
        raise click.UsageError(f"-o {twice[0]} is given twice")
    return Outputs(others[0] if others else None, films)


def is_film(output: str) -> bool:
    """Whether an output of an animation is a film."""
    return Path(output).suffix.lower() in FILMS and not Path(output).is_dir()


def plan_animation(
    shapes: Sequence[str],
    output: str | None,
    films: Sequence[Path],
    mirror: bool,
    options: Mapping[str, Any],
    suffix: str = ".svg",
) -> Plan:
    """Which animations are drawn, and where to; what cannot be written is said before any work.

    `output` : where frames go, or None; `mirror` and `suffix` as `plan_outputs` takes them

    Raises click.UsageError, ValueError or OSError.
    """
    from ..batch.plan import Job, UnclearOutput, find_shapes, plan_outputs
    from ..files import check_output

    found = find_shapes(shapes)
    name, sequence = found[0], tuple[str, ...]()
    if options.get("sequence"):
        sequence = in_order(shapes, found)
        name = sequence[0]
    elif films and len(found) > 1:
        raise click.UsageError(
            f"{films[0]}: a film is of one shape, not of {len(found)}; frames of one mesh "
            "that deforms are a --sequence"
        )
    frame_count(options, sequence)
    inputs = [*found, *filter(None, [options.get("cameras")])]
    _check_films(films, options)
    for film in films:
        if output is None or film.parent.resolve() != Path(output).resolve():
            check_output(film, inputs)
    if not films and options.get("fps"):
        say("--fps is of films, and none is written: SVGs have no time")
    if output is None:
        return Plan([Job(name, str(films[0]))], sequence)
    if sequence and mirror:
        raise click.UsageError("--mirror is for drawings of several shapes, not for a --sequence")
    shown = [str(Path(name).with_name(common_name(sequence)))] if sequence else shapes
    try:
        jobs = plan_outputs(shown, output, mirror, suffix)
    except UnclearOutput as error:
        raise click.UsageError(str(error)) from None
    for place in map(str, (*films, jobs[0].output)):  # the folder is made now
        check_output(place, inputs)
    return Plan([Job(name, jobs[0].output)] if sequence else jobs, sequence)


def frame_count(options: Mapping[str, Any], sequence: Sequence[str]) -> int:
    """How many frames an animation has; a usage error where what moves has several numbers of them.

    Raises ValueError or OSError where the cameras cannot be read.
    """
    count, path = options.get("turntable"), options.get("cameras")
    what = f"--turntable {count} has {count} frames"
    if path:
        from ..motion.shots import load_cameras

        count = len(load_cameras(path))
        what = f"{path}: has {count} cameras"
    if count and sequence and len(sequence) != count:
        raise click.UsageError(
            f"{what}, the sequence {len(sequence)} ({sequence[0]} ...): give as many of both"
        )
    return count or len(sequence)


def refuse_one_place(jobs: Sequence[Job], films: Sequence[Path], preview: bool, count: int) -> None:
    """Raise a usage error where a film would be written to the file of a frame, or its preview."""
    from ..batch.plan import numbered_output

    places = {film.resolve(): film for film in films}
    for job in jobs if films else ():
        for frame in range(count):
            output = Path(numbered_output(job.output, frame, count))
            for file in (output, output.with_suffix(".png")) if preview else (output,):
                if film := places.get(file.resolve()):
                    raise click.UsageError(
                        f"-o {film} is also where a frame goes: give the film another name"
                    )


class Plan(NamedTuple):
    """What is drawn: a job for each animation, and the files of the frames of a sequence."""

    jobs: list[Job]
    sequence: tuple[str, ...]


def _check_films(films: Sequence[Path], options: Mapping[str, Any]) -> None:
    """Say before any work what film cannot be written, wherever it is."""
    from ..film.films import PAGE, check_film
    from ..film.timing import NoSuchRate, rate_of
    from ..film.video import CODECS

    rate = rate_of(options.get("fps") or DEFAULT_RATE)
    for film in films:
        pictures = rate / (2 if options.get("on_twos") else 1)
        try:
            check_film(film, pictures)
        except NoSuchRate as error:
            raise click.UsageError(str(error)) from None
        if pictures >= SLOWED and film.suffix.lower() not in (*CODECS, PAGE):
            say(
                f"{film}: browsers show pictures of 1/100 s or less for 1/10 s: .mp4 is shown right"
            )
        if options.get("background") == NOTHING and film.suffix.lower() in CODECS:
            say(f"{film}: a video has no transparency: its background is white")


def in_order(given: Sequence[str], found: Sequence[str]) -> tuple[str, ...]:
    """Put the frames of a sequence in order: by the numbers in their names, 2 before 10.

    Only where a folder or the shell has ordered them, letter by letter; another order is the
    user's. Raises click.UsageError on what holds no mesh.
    """
    from ..batch.plan import VIEW_SUFFIXES

    views = [file for file in found if Path(file).suffix.lower() in VIEW_SUFFIXES]
    if views:
        raise click.UsageError(f"{views[0]} is a saved view: the frames of a sequence are meshes")
    natural = sorted(found, key=natural_key)
    if list(found) == natural or len(set(found)) < len(found):
        return tuple(found)
    by_letter = list(found) in (sorted(found), sorted(found, key=str.lower))
    return tuple(natural if by_letter else found)


def natural_key(text: str) -> list[tuple[int, int, str]]:
    """A key by which "frame2" stands before "frame10"."""
    groups = itertools.groupby(text.lower(), lambda letter: letter in "0123456789")
    parts = ("".join(letters) for _, letters in groups)
    return [(0, int(p), p) if p.isdecimal() else (1, 0, p) for p in parts]


def common_name(files: Sequence[str]) -> str:
    """What the frames of a sequence are called together: "walk" of walk-000.obj, walk-001.obj."""
    first = Path(files[0])
    letters = first.stem.rstrip("0123456789").rstrip("-_. ")
    return letters or first.resolve().parent.name or "frame"


# -------------------------------------------------------------------------------- what is animated


class Moving:
    """A shape, or the frames of one, and the cameras that look at it."""

    def __init__(self, path: str, animation: Animation):
        self.animation, self.options = animation, animation.options
        self.shape = Shape(path, {**self.options, "turntable": self.options.get("turntable")})

    @functools.cached_property
    def surfaces(self) -> list[Surface]:
        """The shape, or its frames, less the parts that are hidden."""
        from ..mesh.hide import hide_parts
        from ..mesh.sequence import load_sequence

        sequence = self.animation.sequence
        if not sequence:
            return [self.shape.shown]
        with timed("read the meshes"), told_warnings():
            surfaces = load_sequence(sequence)
        hide = self.options.get("hide")
        try:
            return [hide_parts(s, hide) for s in surfaces] if hide else surfaces
        except ValueError as error:
            raise ValueError(f"{sequence[0]}: {error}") from None

    def camera(self) -> Camera:
        """The camera of the options, fitted to all frames together."""
        import numpy as np

        if not self.animation.sequence or self.options.get("camera"):
            return self.shape.camera()
        return self.shape.fitted(np.concatenate([s.vertices for s in self.surfaces]))

    def shots(self) -> list[Shot]:
        """What each frame shows."""
        from ..motion.shots import load_cameras, path_shots, turntable_shots

        count, path = self.options.get("turntable"), self.options.get("cameras")
        cameras = load_cameras(path) if path else []
        surfaces: Any = self.surfaces if self.animation.sequence else self.surfaces[0]
        if path:
            return path_shots(surfaces, cameras)
        if count:
            return turntable_shots(surfaces, self.camera(), count, self._axis())
        return path_shots(surfaces, [self.camera()] * len(surfaces))

    def close_shots(self, shots: list[Shot]) -> tuple[list[Shot], int]:
        """Shots so close that lines are known again from one to the next, and which are frames.

        Every so manieth is one. A turntable has shots between its frames where those are few; what
        else moves is taken as it is.
        """
        from ..motion.shots import shots_between, turntable_shots

        count = self.options.get("turntable")
        if not count or self.animation.sequence or shots_between(count) == 1:
            return shots, 1
        every = shots_between(count)
        axis = self._axis()
        return turntable_shots(shots[0].surface, shots[0].camera, every * count, axis), every

    def _axis(self) -> np.ndarray | None:
        """The upright axis of a turntable; None for the camera's own."""
        from ..extract.camera import up_axis

        return None if self.options.get("camera") else up_axis(self.options.get("up") or "y")


# --------------------------------------------------------------------------------- how it is drawn


def draw_animation(animation: Animation, style: Style | NeuralStrokesStyle, job: Job) -> Drawn:
    """Draw an animation frame by frame, and write its frames and films."""
    from ..batch.outcome import Drawn

    moving = Moving(job.shape, animation)
    shots = moving.shots()
    written = Written(animation, job, len(shots), shots[0].camera)
    strokes: list[int] = []
    with FrameDisplay() as display, written:
        drawn = counted(drawings(animation, style, moving, shots, display), strokes)
        for text in texts(animation, drawn, written.look):
            written.add(text)
        written.finish()
    frames = f"{len(shots)} frame{'s' * (len(shots) > 1)}"
    each = f"{sum(strokes) / len(strokes):.0f} strokes each"
    told = f"{job.shape}: {frames}, {each} -> {written.told()}"
    if not any(strokes):
        told += " (no visible curves in any frame: an empty animation)"
    return Drawn(told, written.files, sum(strokes), sum(strokes))


def counted(drawn: Iterable[Drawing], strokes: list[int]) -> Iterator[Drawing]:
    """Pass on drawings, and note how many strokes each has."""
    for drawing in drawn:
        strokes.append(len(drawing.strokes))
        yield drawing


def texts(animation: Animation, drawn: Iterable[Drawing], look: SvgOptions) -> Iterator[str]:
    """Write drawings as SVG texts: those of a coherent animation all in one encoding."""
    from ..svg.write import write_frames, write_svg

    if not animation.options.get("still"):
        yield from write_frames(drawn, look)
        return
    for drawing in drawn:
        yield write_svg(drawing, look)


def drawings(
    animation: Animation,
    style: Style | NeuralStrokesStyle,
    moving: Moving,
    shots: list[Shot],
    display: FrameDisplay,
) -> Iterator[Drawing]:
    """Draw what shots show, one by one: coherent, unless each is to be drawn on its own."""
    from ..motion.draw import draw_frames
    from ..motion.track import track_frames
    from ..render.style import Style

    options, shape = animation.options, moving.shape
    if isinstance(style, Style) and not options.get("still"):
        optional = style.choice is not None and style.choice.optional is not None
        close, every = moving.close_shots(shots)
        with timed("strokes from frame to frame"), told_warnings():
            frames = track_frames(
                display.stage("lines", close, len(close)),
                style,
                shape.line_options(),
                shape.spacing(),
                optional and shape.has_optional_lines,
                loop=animation.loops,
            )
        warn_of_kinds(shape.path, unknown_in_shot(shots[0], frames, style, shape))
        # those between two drawings are followed too: so lines are known again over smaller steps
        frames = frames[:: every * animation.exposure]
        drawn = draw_frames(style, frames, animation.seed, animation.boil, animation.loops)
        yield from display.stage("drawing", drawn, len(frames))
        return
    if not options.get("still"):
        say(
            f"{shape.path}: the networks of {animation.model} draw each frame on its own, as with "
            "--still: strokes do not persist"
        )
    shots = shots[:: animation.exposure]
    yield from display.stage("drawing", stills(animation, style, moving, shots), len(shots))


def stills(
    animation: Animation, style: Style | NeuralStrokesStyle, moving: Moving, shots: list[Shot]
) -> Iterator[Drawing]:
    """Draw what shots show, each on its own."""
    from ..motion.shots import views_of_shots
    from ..render.choice import unknown_kinds

    shape, choice = moving.shape, style.choice
    optional = choice is not None and choice.optional is not None and shape.has_optional_lines
    views = views_of_shots(shots, shape.line_options(), shape.spacing(), optional)
    left_out, kept = set[str](), False
    for view in views:
        lines = style.choose(view)
        left_out.update(unknown_kinds(view, lines, choice))
        kept |= style.leaves_nothing(view)
        yield style.draw(lines, seed=animation.seed, choice="all")
    warn_of_kinds(shape.path, left_out)
    if kept:
        warn_of_all_lines(shape.path)


def unknown_in_shot(shot: Shot, frames: list[Frame], style: Style, shape: Shape) -> set[str]:
    """The kinds of line that a shot shows and no frame does, because the exemplar had none."""
    from ..extract.lines import SurfaceLines
    from ..extract.pipeline import see_lines
    from ..geometry.kinds import KINDS
    from ..render.choice import never_drawn

    never = set(never_drawn(style.choice))
    if not never:
        return set()
    lines = SurfaceLines(shot.surface, shape.line_options())
    seen = set(see_lines(lines, shot.camera, shape.spacing()).curves.kind.tolist())
    for frame in frames:
        seen -= set(frame.planned.kind.tolist())
    return {KINDS[kind] for kind in seen & never}


def warn_of_kinds(shape: str, left_out: Iterable[str]) -> None:
    """Say which kinds of line a shape was drawn without, because the exemplar had none."""
    if left_out:
        say(
            f"warning: {shape}: drawn without lines of kind {', '.join(sorted(left_out))}, "
            "which the exemplar did not have; --choice all draws them"
        )


def warn_of_all_lines(shape: str) -> None:
    """Say that a shape is drawn with all lines, because the artist would draw hardly any."""
    say(
        f"warning: {shape}: hardly one of its lines is one that the artist would draw; all are "
        "drawn"
    )


class Written:
    """The frames and films of an animation as they are written; used as a context.

    Attributes
    ----------
    files : all that is written already
    look : how its drawings are written
    """

    def __init__(self, animation: Animation, job: Job, count: int, camera: Camera):
        from ..svg.format import SvgOptions

        self.animation, self.job, self.count = animation, job, count
        self.size = camera.width, camera.height
        self.files: list[str] = []
        self.frame = 0
        look = {"title": Path(job.shape).stem, **animation.look}
        if animation.transparent:
            del look["background"]
        self.look = SvgOptions(**{"description": f"Drawn by strokestyle {__version__}", **look})
        self.resources = contextlib.ExitStack()
        self.pages: dict[Path, FilmPage] = {}
        self.pictures: Pictures | None = None

    def __enter__(self) -> Written:
        from ..film.page import FilmPage
        from ..film.pictures import Pictures

        animation, resources = self.animation, self.resources
        for film in animation.films:
            if film.suffix.lower() == ".html":
                ground = "" if animation.transparent else self.look.background
                page = FilmPage(self.look.title, animation.rate, animation.loops, ground)
                self.pages[film] = resources.enter_context(page)
            elif self.pictures is None:
                self.pictures = resources.enter_context(Pictures())
        return self

    def __exit__(self, *error: object) -> None:
        self.resources.close()

    def add(self, text: str) -> None:
        """Write a drawing's SVG as all the frames that it is held for, and keep it for films."""
        from ..batch.plan import numbered_output
        from ..svg.write import png_from_svg

        animation = self.animation
        png = PngLook(animation.scale, None if animation.transparent else "#ffffff")
        held = min(animation.exposure, self.count - self.frame)
        for frame in range(self.frame, self.frame + held):
            if animation.frames:
                output = numbered_output(self.job.output, frame, self.count)
                files = [output, preview_of(output)] if animation.preview else [output]
                write_drawing(files, text, png)
                self.files += files
        self.frame += held
        for page in self.pages.values():
            page.add(text, self.size, held)
        if self.pictures is not None:
            with timed("picture"):
                self.pictures.add(png_from_svg(text, *png), held)

    def finish(self) -> None:
        """Write the films."""
        from ..film.films import write_film

        animation = self.animation
        for film in animation.films:
            with timed(f"write {film}"):
                if film in self.pages:
                    self.pages[film].write(film)
                elif self.pictures is not None:
                    with told_warnings():
                        write_film(film, self.pictures, animation.rate, animation.transparent)
            self.files.append(str(film))

    def told(self) -> str:
        """What to say of the files."""
        films = list(map(str, self.animation.films))
        frames = self.files[: len(self.files) - len(films)]
        few = ", ".join(frames) if len(frames) < 4 else f"{frames[0]} ... {frames[-1]}"
        return ", ".join(filter(None, [few, *films]))
