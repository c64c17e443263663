"""Draw many shapes, on this machine: what became of each is said, and written down, as it is done.

A batch is several shapes, a folder of them or a list, drawn into a folder: it has a journal there.
"""

from __future__ import annotations

import functools
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import FrameType
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from .messages import describe, listening, say
from .outputs import STANDARD_OUTPUT
from .progress import BatchDisplay

if TYPE_CHECKING:
    from ..batch.journal import Journal
    from ..batch.outcome import Drawn, Outcome
    from ..batch.plan import Job
    from ..batch.pool import Limits

STANDARD_INPUT = "-"

# A shape's size that costs as much as what every shape costs, bytes.
SMALL = 100_000


class Recipe(NamedTuple):
    """How every shape of a batch is drawn; sent to the workers.

    Parameters
    ----------
    load : reads the model; what it raises would be raised by every shape
    draw : draws a shape and writes it
    model : file of the style, as errors name it
    key : `settings_key` of all that decides how shapes are drawn
    inputs : all files that are read besides the shapes
    folders : where files are written besides the folders of the drawings
    moved : gives the recipe for a machine on which `inputs` and `folders` lie elsewhere: where, by
        their names here
    """

    load: Callable[[], object]
    draw: Callable[[Job], Drawn]
    model: str
    key: str
    inputs: tuple[str, ...]
    folders: tuple[str, ...]
    moved: Callable[[Mapping[str, str]], Recipe]


@dataclass(frozen=True)
class Running:
    """How a batch is run: none of it changes a drawing.

    Parameters
    ----------
    jobs : shapes drawn at the same time; None for as many as suit them and the machine
    limits : what each may cost, or None
    folder : of the journal; None where what is drawn is no batch
    folders : where files are written besides
    resume : whether what is drawn and whole stays
    tell : whether outcomes are printed on standard output, a line of JSON each
    scheduler : address of the Dask scheduler at whose workers shapes are drawn; None for this
        machine
    """

    jobs: int | None = None
    limits: Limits | None = None
    folder: str | None = None
    folders: Sequence[str] = ()
    resume: bool = False
    tell: bool = False
    scheduler: str | None = None


def read_list(shapes: Sequence[str]) -> list[str]:
    """Put the files that are listed on standard input in the place of "-".

    Raises ValueError where there are none.
    """
    from ..batch.plan import split_list

    read: list[str] = []
    for shape in shapes:
        if shape != STANDARD_INPUT:
            read.append(shape)
            continue
        listed = split_list(click.open_file(STANDARD_INPUT, "rb").read())
        if not listed:
            raise ValueError(
                "standard input: no shapes in this list; give one file a line, or with NULs in "
                "between"
            )
        read += listed
    return read


def how_to_run(
    output: str, several: bool, stages: str | None, values: Mapping[str, Any]
) -> Running:
    """How the options want a batch to be run.

    `several` : whether what is drawn is meant as a batch, into the folder `output` if it is one
    `values` : those of `batch_options`
    """
    from ..batch.plan import is_folder

    folder = output if several and is_folder(output) else None
    if values["resume"] and folder is None:
        raise click.UsageError("--resume goes on with a batch: give -o a folder")
    scheduler = values["scheduler"]
    if scheduler and (values["jobs"] or 1) > 1:
        raise click.UsageError(
            "--jobs is for this machine: with --scheduler as many are drawn at the same time as "
            "the workers there have threads"
        )
    return Running(
        values["jobs"],
        _limits(values["timeout"], values["memory"], bool(scheduler)),
        folder,
        [stages] if stages else [],
        values["resume"],
        values["tell"],
        scheduler,
    )


def _limits(seconds: float | None, memory: int | None, elsewhere: bool) -> Limits | None:
    """What each shape may cost, if anything is said of it."""
    if seconds is None and memory is None:
        return None
    from ..batch.memory import can_be_watched
    from ..batch.pool import Limits

    if memory and not elsewhere and not can_be_watched():
        raise click.UsageError("--memory: this system does not tell how much a process takes")
    return Limits(seconds, memory)


def draw_batch(recipe: Recipe, batch: Sequence[Job], running: Running) -> int:
    """Draw all shapes, and say what became of each; the number that failed.

    Raises
    ------
    KeyboardInterrupt
        saying how to go on, where the person stops it.
    ValueError, OSError, MemoryError
        where none can be drawn: the model cannot be read, the journal not be written.
    """
    if running.folder is None:
        return _follow(_outcomes(recipe, batch, running), batch, (), None, running)
    from ..batch.journal import Journal
    from ..files import clear_parts

    for folder in {*running.folders, *(os.path.dirname(job.output) or "." for job in batch)}:
        clear_parts(folder)
    done = drawn_before(recipe, batch, running.folder) if running.resume else []
    outputs = {os.path.abspath(one.output) for one in done}
    todo = [job for job in batch if os.path.abspath(job.output) not in outputs]
    anew = {os.path.abspath(job.output) for job in todo}
    journal = Journal(running.folder, lambda one: os.path.abspath(one.output) not in anew)
    try:
        return _follow(_outcomes(recipe, todo, running), todo, done, journal, running)
    finally:
        journal.close()


def drawn_before(recipe: Recipe, batch: Iterable[Job], folder: str) -> list[Outcome]:
    """What an earlier run drew, and this one would draw alike: it is there, and it is whole.

    By the digests of the journal: of version, model, options and shape, and of what was written.
    """
    from ..batch.journal import is_whole, read_journal
    from ..batch.keys import shape_key

    try:
        lines = {os.path.abspath(one.output): one for one in read_journal(folder)}
    except FileNotFoundError:
        return []
    found = []
    for job in batch:
        line = lines.get(os.path.abspath(job.output))
        try:
            if line and line.key and line.key == shape_key(recipe.key, job.shape):
                if is_whole(line):
                    found.append(replace(line, shape=job.shape, output=job.output))
        except OSError:  # it is gone, and drawing it will say so
            pass
    return found


# ------------------------------------------------------------------------------------- who draws it


def _outcomes(recipe: Recipe, jobs: Sequence[Job], running: Running) -> Iterator[Outcome]:
    """Draw shapes: one by itself in this process, else in workers, the largest first.

    So no large one is left for the end, when the other workers have nothing to do.
    """
    if not jobs:
        return iter(())
    if running.folder is None and running.limits is None and running.scheduler is None:
        return map(functools.partial(draw_here, recipe), jobs)
    from ..batch.pool import draw_in_workers, fitting_workers

    sizes = [_size(job.shape) for job in jobs]
    workers = min(running.jobs or fitting_workers(sizes), len(jobs))
    if running.scheduler or workers > 1:
        largest_first = sorted(range(len(jobs)), key=sizes.__getitem__, reverse=True)
        jobs = [jobs[i] for i in largest_first]
    if running.scheduler:
        return _outcomes_elsewhere(recipe, jobs, running.scheduler, running)
    prepare = functools.partial(prepare_worker, recipe)
    return draw_in_workers(prepare, jobs, workers, running.limits, running.folders)


def _outcomes_elsewhere(
    recipe: Recipe, jobs: Sequence[Job], scheduler: str, running: Running
) -> Iterator[Outcome]:
    """Draw shapes at the workers of a scheduler."""
    try:
        from ..batch.cluster import draw_on_cluster
    except ImportError as error:
        raise ValueError(
            f"--scheduler needs {error.name or 'Dask'}: pip install 'strokestyle[cluster]'"
        ) from None
    from ..batch.pool import Limits
    from ..batch.station import Errand

    prepare = functools.partial(prepare_elsewhere, recipe.moved)
    errand = Errand(prepare, recipe.inputs, recipe.folders, running.limits or Limits())
    return draw_on_cluster(errand, jobs, scheduler, say)


def prepare_elsewhere(
    moved: Callable[[Mapping[str, str]], Recipe], places: Mapping[str, str]
) -> Callable[[], Callable[[Job], Outcome]]:
    """What a worker process of another machine does first, as `prepare_worker` does here."""
    return functools.partial(prepare_worker, moved(places))


def prepare_worker(recipe: Recipe) -> Callable[[Job], Outcome]:
    """Load in a worker, once, what all shapes need; gives what draws one of them."""
    with listening(aloud=False):
        recipe.load()
    return functools.partial(draw_in_worker, recipe)


def draw_in_worker(recipe: Recipe, job: Job) -> Outcome:
    """Draw one shape of a batch: whatever goes wrong is its outcome; what is said is told in it."""
    with listening(aloud=False) as told:
        try:
            outcome = draw_here(recipe, job)
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            line = f"{job.shape}: unexpected {what} (a fault of strokestyle)"
            outcome = _failed(job, line, "error")
    return replace(outcome, told=(*told, *outcome.told))


def draw_here(recipe: Recipe, job: Job) -> Outcome:
    """Draw one shape; errors of its file, the model's or the disk's are its outcome."""
    start, cpu_start = time.perf_counter(), time.process_time()
    key = _key_of(recipe, job)
    try:
        with listening() as said:
            outcome = _drawn(job, recipe.draw(job), [text for _, text in said])
    except BrokenPipeError:
        raise
    except (ValueError, OSError, MemoryError, click.UsageError) as error:
        line = describe(error)
        named = any(name in line for name in (job.shape, recipe.model, job.output))
        failure = "memory" if isinstance(error, MemoryError) else "error"
        outcome = _failed(job, line if named else f"{job.shape}: {line}", failure)
    seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
    return replace(outcome, key=key, seconds=seconds, cpu_seconds=cpu_seconds)


def _drawn(job: Job, drawn: Drawn, said: Iterable[str]) -> Outcome:
    from ..batch.keys import content_digest
    from ..batch.outcome import Outcome

    warning = "warning: "
    return Outcome(
        job.shape,
        job.output,
        files=tuple(drawn.files),
        lines=drawn.lines,
        strokes=drawn.strokes,
        warnings=tuple(text.removeprefix(warning) for text in said if text.startswith(warning)),
        digest=content_digest(drawn.files) if STANDARD_OUTPUT not in drawn.files else "",
        told=((0, drawn.told),),
    )


def _failed(job: Job, error: str, failure: str) -> Outcome:
    from ..batch.outcome import Outcome

    return Outcome(job.shape, job.output, error=error, failure=failure)


def _key_of(recipe: Recipe, job: Job) -> str:
    from ..batch.keys import shape_key

    try:
        return shape_key(recipe.key, job.shape) if recipe.key else ""
    except OSError:  # drawing it will say more
        return ""


def _size(shape: str) -> int:
    """What a shape costs, about, by its file."""
    try:
        return SMALL + os.path.getsize(shape)
    except OSError:
        return SMALL


# ------------------------------------------------------------------------------ what is said of it


def _follow(
    outcomes: Iterator[Outcome],
    jobs: Sequence[Job],
    done: Sequence[Outcome],
    journal: Journal | None,
    running: Running,
) -> int:
    """Say what became of each shape as it is done, and write it down; the number that failed."""
    total = len(jobs) + len(done)
    display = BatchDisplay({job.shape: _size(job.shape) for job in jobs}, total, len(done))
    if done:
        say(f"{len(done)} of {total} shapes are drawn already")
    for outcome in done:
        _print(outcome, running.tell)
    try:
        with _terminated_like_interrupted(), display:
            for outcome in outcomes:
                if journal:
                    journal.add(outcome)
                display.step(outcome.shape, outcome.drawn)
                _say(outcome)
                _print(outcome, running.tell)
    except KeyboardInterrupt:
        if journal is None:
            raise
        raise KeyboardInterrupt(
            f"stopped: {display.done - display.failed} of {total} shapes are drawn; the same "
            "command with --resume goes on"
        ) from None
    finally:
        if close := getattr(outcomes, "close", None):
            close()
    if display.failed and total > 1:
        say(f"{total - display.failed} of {total} shapes drawn", level=-1)
    return display.failed


def _say(outcome: Outcome) -> None:
    for level, text in outcome.told:
        say(_one_line(text), level)
    if outcome.error:
        say(f"strokestyle: {outcome.error}", level=-1)


def _one_line(text: str) -> str:
    """What is said of a shape, on one line also where its name has several."""
    return text.replace("\n", "\\n").replace("\r", "\\r")


def _print(outcome: Outcome, tell: bool) -> None:
    if tell:
        try:
            click.echo(outcome.to_json())
        except BrokenPipeError:
            raise
        except OSError as error:
            error.filename = "standard output"
            raise


class _terminated_like_interrupted:
    """Within, SIGTERM stops a run as Ctrl-C does: what a batch system sends when time is up."""

    def __enter__(self) -> None:
        self.before: Any = None
        try:
            self.before = signal.signal(signal.SIGTERM, _interrupt)
        except ValueError:  # not the main thread
            pass

    def __exit__(self, *error: object) -> None:
        if self.before is not None:
            signal.signal(signal.SIGTERM, self.before)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
