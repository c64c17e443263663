"""Tell how far a fit is."""

from __future__ import annotations

import time
from dataclasses import dataclass

import torch

BETWEEN = 0.2  # s, two calls of the progress callback


@dataclass(frozen=True)
class Progress:
    """Where a fit stands: `step` of `steps` of a stage, its latest losses, and a guess of the seconds left in all."""

    stage: str
    step: int
    steps: int
    losses: dict[str, float]
    seconds_left: float | None


class Reporter:
    """Calls the user's callback a few times a second, with a guess of the time left."""

    def __init__(self, callback, total: int):
        self.callback, self.total = callback, total
        self.start = self.last = time.monotonic()
        self.passed, self.stage = 0, ""

    def __call__(self, stage: str, step: int, steps: int, losses: dict) -> None:
        if self.callback is None:
            return
        if stage != self.stage and step > 1:  # the first steps were done before an interruption
            self.passed, self.total = self.passed - (step - 1), self.total - (step - 1)
        self.stage = stage
        now = time.monotonic()
        if step < steps and now - self.last < BETWEEN:
            return
        self.last = now
        if step >= steps:
            self.passed += steps
        done = self.passed + (step if step < steps else 0)
        left = (now - self.start) / done * max(self.total - done, 0) if done else None
        values = {name: float(torch.as_tensor(value).detach()) for name, value in losses.items()}
        self.callback(Progress(stage, step, steps, values, left))
