"""How a drawn stroke differs from what was meant: residuals, and sampling them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Residuals:
    """How a hand strays from what it means to draw: residuals of the training strokes, to be drawn from.

    Parameters
    ----------
    stray : (R, 2) float32, residual across the stroke, px, and of log(thickness + HAIR)
    offsets : (S+1,) int64, one sequence per training stroke, points `spacing` apart
    """

    stray: np.ndarray
    offsets: np.ndarray


def sample_residuals(hand: Residuals, offsets: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A sequence of residuals (N, 2) for every stroke, cut from the training strokes' and faded into one another."""
    lengths = np.diff(hand.offsets)
    out = np.zeros((offsets[-1], 2))
    if not len(lengths):
        return out
    fade = 8
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        n, at = b - a, 0
        while at < n:
            want = n - at
            weight = np.minimum(lengths, want).astype(float)
            i = rng.choice(len(lengths), p=weight / weight.sum())
            take = int(min(lengths[i], want))
            first = int(hand.offsets[i] + rng.integers(lengths[i] - take + 1))
            piece = hand.stray[first : first + take]
            if rng.random() < 0.5:
                piece = piece * [-1, 1]
            over = min(fade, at, take) if at else 0
            ramp = (np.arange(over) + 0.5)[:, None] / max(over, 1)
            start = a + at - over
            # faded by square roots, so that the spread stays
            out[start : start + over] = (
                np.sqrt(1 - ramp) * out[start : start + over] + np.sqrt(ramp) * piece[:over]
            )
            out[start + over : start + take] = piece[over:]
            at += take - over
            if take <= over:
                break
    return out
