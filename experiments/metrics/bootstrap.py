"""Intervals: how far a figure would move with other drawings of the same kind.

Source: Efron & Tibshirani, An introduction to the bootstrap, 1993, ch. 13."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Interval:
    """A figure with the 95 % interval around it."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half its width: the +- of a table."""
        return (self.high - self.low) / 2


def resampled(count: int, times: int, seed: int) -> np.ndarray:
    """Draw `count` drawings with replacement, many times: (times, count) how often each came.

    The same for every method that is asked with the same numbers, so that methods are paired."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(count, np.full(count, 1 / count), size=times)


def interval(
    measure: Callable[[np.ndarray], float], count: int, times: int, seed: int, shifted: bool = False
) -> Interval:
    """Measure all `count` drawings, and the spread over resampled ones.

    measure : (count,) how often each drawing counts -> the figure
    shifted : place the spread of the resampled around the figure itself. For distances of sets,
        such as FID, which copies of the same drawing raise: their spread tells something, their
        place does not. Else the interval is that of percentiles.
    """
    value = measure(np.ones(count, int))
    found = np.array([measure(weights) for weights in resampled(count, times, seed)])
    found = found[np.isfinite(found)]
    if not len(found):
        return Interval(value, float("nan"), float("nan"))
    low, high = np.percentile(found, [2.5, 97.5]) + (value - found.mean() if shifted else 0)
    return Interval(value, float(low), float(high))
