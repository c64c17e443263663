"""Report how far a fit is, and guess the time it still takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import SupportsFloat

REPORT_INTERVAL = 0.2  # s between two calls of the user's callback

# What a training loop calls after each step: stage, step, steps of that stage, losses by name
Report = Callable[[str, int, int, Mapping[str, "SupportsFloat"]], None]


@dataclass(frozen=True)
class Progress:
    """Where a fit stands.

    Parameters
    ----------
    stage, step, steps : `step` of `steps` of the stage are done
    losses : the latest, by name
    seconds_left : a guess for all that is left of the fit; None before the first step
    """

    stage: str
    step: int
    steps: int
    losses: dict[str, float]
    seconds_left: float | None


class Reporter:
    """Calls the user's callback a few times a second, with a guess of the time left.

    Parameters
    ----------
    callback : called with a Progress; None = nobody listens
    total : steps of all stages together; may be set again once it is known better
    """

    def __init__(self, callback: Callable[[Progress], None] | None, total: int):
        self.callback, self.total = callback, total
        self.start = self.last = time.monotonic()
        self.passed, self.stage = 0, ""

    def __call__(
        self, stage: str, step: int, steps: int, losses: Mapping[str, SupportsFloat]
    ) -> None:
        if self.callback is None:
            return
        if stage != self.stage and step > 1:  # the first steps were done before an interruption
            self.passed, self.total = self.passed - (step - 1), self.total - (step - 1)
        self.stage = stage
        now = time.monotonic()
        if step < steps and now - self.last < REPORT_INTERVAL:
            return
        self.last = now
        if step >= steps:
            self.passed += steps
        done = self.passed + (step if step < steps else 0)
        left = (now - self.start) / done * max(self.total - done, 0) if done else None
        values = {name: float(value) for name, value in losses.items()}
        self.callback(Progress(stage, step, steps, values, left))
