"""How far a fit, a batch or an animation is, on stderr: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, TypeVar

from .messages import is_aloud, say, verbosity

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

    from ..fit.progress import Progress


Item = TypeVar("Item")


class ProgressDisplay:
    """Shows a fit's progress while it stands in a `with`; give it to `fit_style` as `progress`.

    On a terminal a bar for each stage, with the latest losses and the time left; where another
    program reads, a line for each stage that is done. Nothing with -q.
    """

    def __init__(self) -> None:
        self.bars: Bars | None = None
        self.task: TaskID | None = None
        self.stage: str | None = None

    def __enter__(self) -> ProgressDisplay:
        if verbosity() >= 0 and sys.stderr.isatty():
            self.bars = _bars("losses", "left")
            self.bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self.bars:
            self.bars.stop()

    def __call__(self, event: Progress) -> None:
        losses = " ".join(f"{name} {value:.4f}" for name, value in event.losses.items())
        if self.bars:
            if self.task is None or event.stage != self.stage:
                self.task = self.bars.add_task(event.stage, total=event.steps, losses="", left="")
            left = "" if event.seconds_left is None else f"{event.seconds_left:.0f} s left"
            self.bars.update(self.task, completed=event.step, losses=losses, left=left)
        elif event.step >= event.steps:
            say(f"  {event.stage}: {event.steps} steps {losses}")
        self.stage = event.stage


class BatchDisplay:
    """Shows how far a batch is while it stands in a `with`: a bar with the time left.

    Only on a terminal; elsewhere the shapes' own lines tell. Nothing with -q.

    Parameters
    ----------
    sizes : what each shape weighs against the others, by its name; the time left goes by it
    total, done : how many shapes there are, and how many of them were drawn before
    """

    def __init__(self, sizes: Mapping[str, float], total: int, done: int = 0):
        self.sizes, self.total, self.done, self.failed = sizes, total, done, 0
        self.ahead = sum(sizes.values())
        self.behind = 0.0
        self.bars: Bars | None = None

    def __enter__(self) -> BatchDisplay:
        if self.total > 1 and verbosity() >= 0 and sys.stderr.isatty():
            self.bars = _bars("failed", "left")
            self.task = self.bars.add_task(
                "drawing", total=self.total, completed=self.done, failed="", left=""
            )
            self.start = time.monotonic()
            self.bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self.bars:
            self.bars.stop()

    def step(self, shape: str, drawn: bool) -> None:
        """Count a shape that is done."""
        size = self.sizes.get(shape, 0.0)
        self.ahead, self.behind = self.ahead - size, self.behind + size
        self.done, self.failed = self.done + 1, self.failed + (not drawn)
        if self.bars:
            seconds = (time.monotonic() - self.start) * self.ahead / max(self.behind, 1e-9)
            failed = f"{self.failed} failed" if self.failed else ""
            self.bars.update(self.task, completed=self.done, failed=failed, left=_left(seconds))


class FrameDisplay:
    """Shows on a terminal how far an animation is while it stands in a `with`; nothing with -q."""

    def __init__(self) -> None:
        self.bars: Bars | None = None

    def __enter__(self) -> FrameDisplay:
        if is_aloud() and verbosity() >= 0 and sys.stderr.isatty():
            self.bars = _bars("note", "left")
            self.bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self.bars:
            self.bars.stop()

    def stage(self, name: str, items: Iterable[Item], total: int) -> Iterator[Item]:
        """Pass on the items of a stage, and count them."""
        if not self.bars:
            yield from items
            return
        task, start = self.bars.add_task(name, total=total, note="", left=""), time.monotonic()
        for done, item in enumerate(items, 1):
            yield item
            left = _left((time.monotonic() - start) * (total - done) / done)
            self.bars.update(task, completed=done, left=left)


def _left(seconds: float) -> str:
    """Time left, as a person says it: "40 s left", "12 min left", "3.5 h left"."""
    if seconds < 100:
        return f"{max(0.0, seconds):.0f} s left"
    return f"{seconds / 60:.0f} min left" if seconds < 5400 else f"{seconds / 3600:.1f} h left"


def _bars(*fields: str) -> Bars:
    """A bar with texts: the first of `fields` before the time gone by, the others after it."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    texts = [TextColumn(f"{{task.fields[{field}]}}") for field in fields]
    columns = (
        TextColumn("{task.description}"),
        BarColumn(24),
        TextColumn("{task.completed}/{task.total}"),
        texts[0],
        TimeElapsedColumn(),
        *texts[1:],
    )
    return Progress(*columns, console=Console(stderr=True), refresh_per_second=4)
