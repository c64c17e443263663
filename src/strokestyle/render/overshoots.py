"""Where pens are set down and lifted: how far past the ends of lines, or short of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import arc
from .plan import Planned

MAX_OVERSHOOT_SHARE = 0.6  # of a curve's length: a short line is not overshot by more than this
MAX_SHORT_SHARE = 0.3  # of it: nor is the pen lifted shorter of its end
NOTABLE = 6.0  # px past an end, or short of it, that can be told from the width of its line
LEAST_HABIT, LEAST_SHARE = 3, 0.15  # ends, and of all ends that are known, that make a habit
FEW = 4  # lengths of one end: where fewer are known, those of the other end count as well


@dataclass(frozen=True)
class Overshoots:
    """How far the training strokes ran past the ends of their curves.

    Parameters
    ----------
    first, last : (S,), (T,) float32 px, at the ends where strokes begin and where they end, of as
        many as are known; below 0 where the pen was lifted short of the end
    """

    first: np.ndarray
    last: np.ndarray

    @classmethod
    def of(cls, past: np.ndarray) -> Overshoots:
        """Keep what is known of lengths (C, 2), where NaN is not.

        What only an end or two do is no habit: it is as likely another line's ink, and left out.
        Who lifts the pen short of most ends has not the habit of overshooting others.
        """
        least = max(LEAST_HABIT, LEAST_SHARE * np.isfinite(past).sum())
        for far in (past > NOTABLE, past < -NOTABLE):
            if far.sum() < least:
                past = np.where(far, np.nan, past)
        return cls(*(end[np.isfinite(end)].astype(np.float32) for end in past.T))

    def sample(self, planned: Planned, rng: np.random.Generator) -> np.ndarray:
        """Draw at random how far every stroke runs past both its ends: (C, 2) px.

        Lengths differ from end to end with nothing in the shape to tell why, so each end is given
        that of a training stroke. Where none is known, strokes end with their curves.
        """
        past = np.zeros((len(planned), 2))
        for k, known in enumerate(self.ends):
            if len(known):
                past[:, k] = rng.choice(known, len(planned))
        return within_limits(past, curve_lengths(planned))

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The lengths that either end is given one of; where few are known, those of both."""
        every = np.concatenate([self.first, self.last])
        first, last = (end if len(end) >= FEW else every for end in (self.first, self.last))
        return first, last


def curve_lengths(planned: Planned) -> np.ndarray:
    """Measure the curves of strokes, (C,) px, without what runs past their ends."""
    lengths = np.zeros(len(planned))
    for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
        lengths[i] = arc(planned.xy[a:b][planned.on_curve[a:b]])[-1]
    return lengths


def within_limits(past: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Keep px past the ends of lines (C, 2) within shares of their lengths (C,)."""
    limits = np.outer(lengths, [-MAX_SHORT_SHARE, MAX_OVERSHOOT_SHARE])
    return np.clip(past, limits[:, :1], limits[:, 1:])
