"""How drawn strokes differ from what a style predicts: residuals, and sampling them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CROSS_FADE = 8  # points over which one piece of residuals gives way to the next


@dataclass(frozen=True)
class Residuals:
    """What the training strokes do beside what the style predicts for them.

    Parameters
    ----------
    values : (R, 2) float32, px across the stroke, along its normal, and of log(thickness + HAIR)
    offsets : (S+1,) int64, sequence i is rows offsets[i]:offsets[i+1]: points of one training
        stroke, the style's spacing apart
    """

    values: np.ndarray
    offsets: np.ndarray


def sample_residuals(
    residuals: Residuals, offsets: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Draw a random sequence of residuals for every new stroke, (N, 2).

    Each is put together from pieces of the training sequences, so that it has their spread and
    wavelengths. The offset of a piece may change its side, for no stroke prefers one for long; its
    thickness keeps its sign.

    Parameters
    ----------
    residuals : of the training strokes
    offsets : (C+1,), the new strokes' points are rows offsets[i]:offsets[i+1]
    rng : same state, same sequences

    Returns zeros where there are no training sequences.
    """
    out = np.zeros((offsets[-1], 2))
    if len(residuals.offsets) > 1:
        for a, b in zip(offsets[:-1], offsets[1:], strict=True):
            _fill(out[a:b], residuals, rng)
    return out


def _fill(out: np.ndarray, residuals: Residuals, rng: np.random.Generator) -> None:
    """Write the residuals of one stroke into `out` (n, 2), piece by piece."""
    filled = 0
    while filled < len(out):
        piece = random_piece(residuals, len(out) - filled, rng)
        shared = min(CROSS_FADE, filled, len(piece))
        start = filled - shared
        out[start:filled] = cross_faded(out[start:filled], piece[:shared])
        out[filled : start + len(piece)] = piece[shared:]
        filled += len(piece) - shared
        if len(piece) <= shared:  # what is left is no longer than a cross-fade: it stays zero
            break


def cross_faded(ending: np.ndarray, beginning: np.ndarray) -> np.ndarray:
    """Let what ends (n, k) give way to what begins (n, k).

    The weights' squares add to 1: pieces are independent, so their variances add, and the spread
    stays what it is.
    """
    fade_in = (np.arange(len(ending)) + 0.5)[:, None] / max(len(ending), 1)
    return np.sqrt(1 - fade_in) * ending + np.sqrt(fade_in) * beginning


def random_piece(residuals: Residuals, count: int | None, rng: np.random.Generator) -> np.ndarray:
    """Cut (at most `count`, 2) successive residuals out of one training sequence, or a whole one.

    A sequence is taken the more often the more of it can be used.
    """
    lengths = np.diff(residuals.offsets)
    count = int(lengths.max()) if count is None else count
    usable = np.minimum(lengths, count).astype(float)
    i = rng.choice(len(lengths), p=usable / usable.sum())
    length = int(min(lengths[i], count))
    first = int(residuals.offsets[i] + rng.integers(lengths[i] - length + 1))
    piece = residuals.values[first : first + length]
    return piece * [-1, 1] if rng.random() < 0.5 else piece
