"""Draw many shapes: what became of each is said as it is done."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

from .messages import describe, say

if TYPE_CHECKING:
    from ..batch.outcome import Drawn
    from ..batch.plan import Job


class Result(NamedTuple):
    """What became of one shape: what was written, or else the error."""

    done: str = ""
    error: str = ""


def draw_batch(draw: Callable[[Job], Drawn], model: str, batch: list[Job], jobs: int) -> int:
    """Draw all shapes, `jobs` at a time, and say what became of each; the number that failed."""
    draw_one = functools.partial(try_to_draw, draw, model)
    workers = min(jobs, len(batch))
    if workers == 1:
        return report(map(draw_one, batch), len(batch))
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(workers, get_context("spawn"), share_cores, (workers,)) as pool:
        return report(pool.map(draw_one, batch), len(batch))


def share_cores(workers: int) -> None:
    """In a new process, before the libraries that read this are imported."""
    os.environ["OMP_NUM_THREADS"] = str(max(1, (os.cpu_count() or 1) // workers))


def report(outcomes: Iterable[Result], total: int) -> int:
    """Say what became of each shape as it is done; the number that failed."""
    failed = 0
    for outcome in outcomes:
        if outcome.error:
            say(f"strokestyle: {outcome.error}", level=-1)
            failed += 1
        else:
            say(outcome.done)
    if failed and total > 1:
        say(f"{total - failed} of {total} shapes drawn", level=-1)
    return failed


def try_to_draw(draw: Callable[[Job], Drawn], model: str, job: Job) -> Result:
    """Draw one shape; its errors are part of the outcome, so that they do not stop the batch."""
    try:
        return Result(done=draw(job).told)
    except (ValueError, OSError, MemoryError) as error:
        line = describe(error)
        named = any(name in line for name in (job.shape, model, job.output))
        return Result(error=line if named else f"{job.shape}: {line}")
