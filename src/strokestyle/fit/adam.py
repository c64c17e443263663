"""Adam on a one-cycle schedule, for the few arrays that the fast presets learn.

To rounding it is that of torch.optim, which takes longer to import than all these steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

BETA, EPSILON = 0.999, 1e-8  # of the mean square, as Kingma and Ba 2015 have it
# Smith and Topin 2018: the rate rises to its top and falls to almost nothing, along cosines, while
# the momentum does the reverse
FIRST, LAST = 1 / 25, 1 / 25e4  # of the rate at the top
MOMENTUM = 0.95, 0.85  # at ends and top of the cycle


class OneCycleAdam:
    """Adam (Kingma and Ba 2015) on a one-cycle schedule (Smith and Topin 2018).

    Parameters
    ----------
    parameters : arrays that are learned, in place
    rates : for each of them the learning rate at the cycle's top
    steps : of the whole cycle
    warm_up : share of the steps until it is at its top
    """

    def __init__(
        self, parameters: Sequence[np.ndarray], rates: Sequence[float], steps: int, warm_up: float
    ):
        self.parameters, self.rates = list(parameters), list(rates)
        self.steps, self.warm_up = steps, warm_up
        self.done = 0
        self.mean = [np.zeros_like(p) for p in self.parameters]
        self.square = [np.zeros_like(p) for p in self.parameters]

    def step(self, gradients: Sequence[np.ndarray]) -> None:
        """Move against the gradients, one for each of the parameters."""
        share, momentum = self._schedule()
        self.done += 1
        unbiased, settled = 1 - momentum**self.done, (1 - BETA**self.done) ** 0.5
        for p, rate, mean, square, gradient in zip(
            self.parameters, self.rates, self.mean, self.square, gradients, strict=True
        ):
            mean += (1 - momentum) * (gradient - mean)
            square += (1 - BETA) * (gradient * gradient - square)
            p -= rate * share / unbiased * mean / (np.sqrt(square) / settled + EPSILON)

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
        """What `load_state_dict` goes on from: arrays by name, and how many steps are done."""
        kept: dict[str, Any] = {"done": self.done}
        for name in ("mean", "square"):
            kept[name] = {str(i): a.copy() for i, a in enumerate(getattr(self, name))}
        return kept

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from a state. Raises KeyError or ValueError where it is of other parameters."""
        self.done = state["done"]
        for name in ("mean", "square"):
            for i, mine in enumerate(getattr(self, name)):
                mine[...] = state[name][str(i)]
