"""Adam on a one-cycle schedule, for the few tensors of the fast presets.

That of torch.optim, whose first use imports torch's compiler: longer than all these steps take.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

BETA, EPSILON = 0.999, 1e-8  # of the mean square, as Kingma and Ba 2015 have it
# Smith and Topin 2018: the rate rises to its top and falls to almost nothing, along cosines, while
# the momentum does the reverse
FIRST, LAST = 1 / 25, 1 / 25e4  # of the rate at the top
MOMENTUM = 0.95, 0.85  # at ends and top of the cycle


class OneCycleAdam:
    """Adam (Kingma and Ba 2015) on a one-cycle schedule (Smith and Topin 2018).

    Parameters
    ----------
    parameters : what is learned, with gradients
    rates : for each of them the learning rate at the cycle's top
    steps : of the whole cycle
    warm_up : share of the steps until it is at its top
    """

    def __init__(
        self, parameters: Sequence[Tensor], rates: Sequence[float], steps: int, warm_up: float
    ):
        self.parameters, self.rates = list(parameters), list(rates)
        self.steps, self.warm_up = steps, warm_up
        self.done = 0
        self.mean = [torch.zeros_like(p) for p in self.parameters]
        self.square = [torch.zeros_like(p) for p in self.parameters]

    def step(self) -> None:
        """Move by the gradients, and forget them."""
        share, momentum = self._schedule()
        self.done += 1
        unbiased, settled = 1 - momentum**self.done, (1 - BETA**self.done) ** 0.5
        with torch.no_grad():
            for p, rate, mean, square in zip(
                self.parameters, self.rates, self.mean, self.square, strict=True
            ):
                if p.grad is None:
                    continue
                mean.lerp_(p.grad, 1 - momentum)
                square.mul_(BETA).addcmul_(p.grad, p.grad, value=1 - BETA)
                size = square.sqrt().div_(settled).add_(EPSILON)
                p.addcdiv_(mean, size, value=-rate * share / unbiased)
                p.grad = None

    def _schedule(self) -> tuple[float, float]:
        """The learning rate of the next step, of that at the top, and the momentum."""
        top = self.warm_up * self.steps - 1
        rising = self.done <= top
        place = self.done / max(top, 1e-9) if rising else (self.done - top) / (self.steps - 1 - top)
        weight = 0.5 * (1 - np.cos(np.pi * place))  # of the top, while it rises
        weight, end = (weight, FIRST) if rising else (1 - weight, LAST)
        low, high = MOMENTUM
        return float(end + (1 - end) * weight), float(low + (high - low) * weight)

    def state_dict(self) -> dict[str, Any]:
        return {"done": self.done, "mean": list(self.mean), "square": list(self.square)}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.done = state["done"]
        for name in ("mean", "square"):
            for mine, kept in zip(getattr(self, name), state[name], strict=True):
                mine.copy_(kept)
