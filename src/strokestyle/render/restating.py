"""Lines gone over: in how many passes a hand draws a line, and how far these lie apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import gaussian
from .plan import Planned

WAVES = 4.0  # wavelengths of slow noise are this many of the Gaussians that make it


@dataclass(frozen=True)
class Restating:
    """How lines of some kinds are gone over.

    Parameters
    ----------
    kinds : (K,) int8, of the lines, index into KINDS
    passes : how many strokes are laid over a line that is gone over, at least 2
    share : of the lines, how many are gone over, in [0, 1]
    spread : px, standard deviation of each pass, of its own, along x as along y: two passes are
        sqrt(2) times as far apart
    wavelength : px along a line, of that deviation
    """

    kinds: np.ndarray
    passes: int
    share: float
    spread: float
    wavelength: float

    def repeat(self, planned: Planned, rng: np.random.Generator) -> tuple[Planned, np.ndarray]:
        """Repeat the strokes that are gone over, one pass after the other.

        Returns the strokes, and which of them (C,) bool are one of several passes.
        """
        over = np.isin(planned.kind, self.kinds) & (rng.random(len(planned)) < self.share)
        counts = np.where(over, self.passes, 1)
        repeated, _ = repeated_strokes(planned, counts)
        return repeated, np.repeat(over, counts)

    def deviation(
        self, planned: Planned, over: np.ndarray, spacing: float, rng: np.random.Generator
    ) -> np.ndarray:
        """Draw at random how far every point lies off its line: (N, 2) px.

        Passes are as far from each other as they were in the drawing, and lie about their line:
        as a line drawn once does, all of them together stay where it is meant.

        Parameters
        ----------
        planned, over : as `repeat` returns them; it is 0 on strokes that are not one of several
        spacing : px between points
        rng : same state, same deviations
        """
        out = np.zeros((planned.offsets[-1], 2))
        sigma = self.wavelength / WAVES / spacing
        for i in np.flatnonzero(over)[:: self.passes]:
            a, b = planned.offsets[i], planned.offsets[i + self.passes]
            length = (b - a) // self.passes
            off = np.stack([_slow_noise(length, sigma, rng) for _ in range(self.passes)])
            out[a:b] = self.spread * (off - off.mean(axis=0)).reshape(-1, 2)
        return out


def repeated_strokes(planned: Planned, counts: np.ndarray) -> tuple[Planned, np.ndarray]:
    """Repeat each stroke `counts` (C,) times in a row.

    Returns the strokes, and the rows (n,) of `planned` that they are.
    """
    lengths = np.repeat(np.diff(planned.offsets), counts)
    offsets = np.r_[0, np.cumsum(lengths)].astype(np.int64)
    first = np.repeat(planned.offsets[:-1], counts)
    rows = np.arange(offsets[-1]) + np.repeat(first - offsets[:-1], lengths)
    strokes = Planned(
        planned.xy[rows], offsets, np.repeat(planned.kind, counts), planned.source[rows],
        planned.mix[rows], planned.overshoot[rows], planned.lifted,
    )  # fmt: skip
    return strokes, rows


def _slow_noise(count: int, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Gaussian noise (count, 2) of variance 1, white noise under a Gaussian of `sigma` points."""
    margin = int(np.ceil(4 * sigma))
    white = rng.standard_normal((count + 2 * margin, 2))
    smooth = gaussian(white, sigma)[margin : margin + count]
    kernel = gaussian(np.eye(1, 2 * margin + 1, margin)[0], sigma)
    return smooth / np.sqrt((kernel**2).sum())
