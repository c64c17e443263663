"""How far a fit is, on stderr: a bar on a terminal, a line per stage elsewhere."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from .messages import say, verbosity

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

    from ..fit.progress import Progress


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
            self.bars = _bars()
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


def _bars() -> Bars:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(24),
        TextColumn("{task.completed}/{task.total}"),
        TextColumn("{task.fields[losses]}"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
    )
    return Progress(*columns, console=Console(stderr=True), refresh_per_second=4)
