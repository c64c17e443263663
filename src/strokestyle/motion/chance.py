"""Chance that belongs to a track: the same at the same place of it in all frames.

What a hand does at random along a stroke is a sequence without end in both directions, of which a
frame shows the part that its stroke covers; so it is the same whichever frame is drawn first, and a
stroke that grows keeps what was drawn of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..render.overshoots import Overshoots, within_limits
from ..render.residuals import CROSS_FADE, Residuals, cross_faded, random_piece
from ..render.restating import WAVES, Restating

BLOCK = 64  # points of white noise that are drawn at a time


class Stage(IntEnum):
    """What is left to chance; each has a chance of its own."""

    RESIDUALS = 0
    TEXTURE = 1
    OVERSHOOTS = 2
    PASSES = 3
    DEVIATION = 4


@dataclass(frozen=True)
class Luck:
    """The chance of a whole animation, and how much of it is drawn anew for each drawing.

    Parameters
    ----------
    seed : same seed, same chance
    boil : in [0, 1], the part of what differs that a drawing has of its own
    """

    seed: int
    boil: float = 0.0

    def of_track(self, stage: Stage, track: int, *more: int) -> np.random.Generator:
        """The chance of a track, whichever frame asks."""
        return np.random.default_rng(self._entropy(0, stage, track, *more))

    def of_drawing(self, stage: Stage, frame: int, track: int, *more: int) -> np.random.Generator:
        """The chance that a track has in one drawing only."""
        return np.random.default_rng(self._entropy(1 + frame, stage, track, *more))

    def _entropy(self, *numbers: int) -> list[int]:
        return [self.seed, *(int(n) & 0xFFFFFFFFFFFFFFFF for n in numbers)]

    def mixed(self, lasting: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Mix what a track has and what a drawing has, so that their spread stays what it is.

        The squares of the weights add to 1: both are independent, so that their variances add.
        """
        return np.sqrt(1.0 - self.boil**2) * lasting + self.boil * own


# -------------------------------------------------------------------------------------- sequences


class Endless:
    """A random sequence (n, k) that goes on for as long as anybody asks.

    Parameters
    ----------
    more : gives the sequence up to now (n, k), the longer one of which it is the beginning, but for
        its last `loose` values, which what follows may still change
    """

    def __init__(self, more: Callable[[np.ndarray], np.ndarray], loose: int = 0):
        self.more, self.loose = more, loose
        self.values = more(np.zeros((0, 2)))

    def first(self, count: int) -> np.ndarray:
        """The first `count` values (count, k), the same however often and in parts asked for."""
        while len(self.values) < count + self.loose:
            self.values = self.more(self.values)
        return self.values[:count]


class BothWays:
    """A random sequence without beginning and end: two that set out from 0 in opposite directions.

    Parameters
    ----------
    ahead, back : the sequences
    fade : rows over which one gives way to the other about 0, an even number
    """

    def __init__(self, ahead: Endless, back: Endless, fade: int = 0):
        self.ahead, self.back, self.half = ahead, back, fade // 2

    def rows(self, low: int, high: int) -> np.ndarray:
        """The values (high - low, k) at rows low .. high - 1."""
        low_, high_ = min(low, -self.half), max(high, self.half)
        back = self.back.first(self.half - low_)[::-1]
        ahead = self.ahead.first(high_ + self.half)
        shared = 2 * self.half
        end = len(back) - shared
        whole = np.concatenate(
            [back[:end], cross_faded(back[end:], ahead[:shared]), ahead[shared:]]
        )
        return whole[low - low_ : high - low_]

    def at(self, place: np.ndarray) -> np.ndarray:
        """The values (N, k) at places (N,) between rows, by a Catmull-Rom spline."""
        row = np.floor(place).astype(np.int64)
        low = int(row.min()) - 1
        values = self.rows(low, int(row.max()) + 3)
        weights = spline_weights(place - row)
        first = row - 1 - low
        return sum(weights[:, k, None] * values[first + k] for k in range(4))


def spline_weights(part: np.ndarray) -> np.ndarray:
    """The weights (N, 4) of four neighbours at `part` (N,) in [0, 1] from the second to the third.

    Catmull and Rom 1974. It passes through the values, and keeps more of what is fine than a
    straight line does, whose contrast comes and goes as places slide over the rows.
    """
    t = part
    return 0.5 * np.stack(
        [
            t * (-1 + t * (2 - t)),
            2 + t * t * (-5 + 3 * t),
            t * (1 + t * (4 - 3 * t)),
            t * t * (t - 1),
        ],
        axis=1,
    )


def endless_residuals(residuals: Residuals, rng: np.random.Generator) -> BothWays:
    """Residuals without end, (., 2), put together from whole sequences of the training strokes."""

    def more(rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
        def grown(values: np.ndarray) -> np.ndarray:
            piece = random_piece(residuals, None, rng)
            shared = min(CROSS_FADE, len(values), len(piece) // 2)
            end = len(values) - shared
            joint = cross_faded(values[end:], piece[:shared])
            return np.concatenate([values[:end], joint, piece[shared:]])

        return grown

    ahead, back = rng.spawn(2)
    return BothWays(Endless(more(ahead), CROSS_FADE), Endless(more(back), CROSS_FADE), CROSS_FADE)


def white_noise(rng: np.random.Generator) -> BothWays:
    """White noise without end, (., 2) of variance 1."""

    def more(rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
        return lambda values: np.concatenate([values, rng.standard_normal((BLOCK, 2))])

    ahead, back = rng.spawn(2)
    return BothWays(Endless(more(ahead)), Endless(more(back)))


# ---------------------------------------------------------------------------------- what they do


class TrackChance:
    """What is left to chance of the strokes of an animation, remembered by track.

    Parameters
    ----------
    luck : Luck
    spacing : px between two rows of a sequence: that of the points of a style's strokes
    """

    def __init__(self, luck: Luck, spacing: float):
        self.luck, self.spacing = luck, spacing
        self._residuals: dict[tuple[int, int], BothWays] = {}
        self._noise: dict[tuple[int, int], BothWays] = {}

    def residuals(
        self, residuals: Residuals, name: tuple[int, int], place: np.ndarray, frame: int
    ) -> np.ndarray:
        """Residuals (N, 2) of a pass of a track, `name`, at places (N,) px along it."""
        if len(residuals.offsets) < 2:
            return np.zeros((len(place), 2))
        if name not in self._residuals:
            rng = self.luck.of_track(Stage.RESIDUALS, *name)
            self._residuals[name] = endless_residuals(residuals, rng)
        at = place / self.spacing
        lasting = self._residuals[name].at(at)
        if not self.luck.boil:
            return lasting
        rng = self.luck.of_drawing(Stage.RESIDUALS, frame, *name)
        return self.luck.mixed(lasting, endless_residuals(residuals, rng).at(at))

    def overshoots(
        self, overshoots: Overshoots, name: tuple[int, int], length: float, frame: int
    ) -> np.ndarray:
        """How far a stroke of a line of `length` px runs past both its ends, (2,) px."""
        lasting = _past(overshoots, self.luck.of_track(Stage.OVERSHOOTS, *name))
        if self.luck.boil:
            own = _past(overshoots, self.luck.of_drawing(Stage.OVERSHOOTS, frame, *name))
            mean = np.array([end.mean() if len(end) else 0.0 for end in overshoots.ends])
            lasting = mean + self.luck.mixed(lasting - mean, own - mean)
        return within_limits(lasting[None], np.array([length]))[0]

    def passes(self, restating: Restating, track: int, kind: int) -> int:
        """In how many strokes the line of a track, of a kind, is drawn."""
        over = self.luck.of_track(Stage.PASSES, track).random() < restating.share
        return restating.passes if over and kind in restating.kinds else 1

    def deviation(
        self, restating: Restating, track: int, number: int, place: np.ndarray, frame: int
    ) -> np.ndarray:
        """How far pass `number` of a track lies off its line at places (N,) px along it: (N, 2)."""
        return restating.spread * self._apart(restating, track, place, frame)[number]

    def _apart(self, restating: Restating, track: int, place: np.ndarray, frame: int) -> np.ndarray:
        """Slow noise (P, N, 2) of each pass, of variance 1 before their mean is taken off."""
        at = place / self.spacing
        sigma = restating.wavelength / WAVES / self.spacing
        noise = []
        for number in range(restating.passes):
            name = (track, number)
            if name not in self._noise:
                self._noise[name] = white_noise(self.luck.of_track(Stage.DEVIATION, *name))
            one = _slow(self._noise[name], sigma, at)
            if self.luck.boil:
                own = white_noise(self.luck.of_drawing(Stage.DEVIATION, frame, *name))
                one = self.luck.mixed(one, _slow(own, sigma, at))
            noise.append(one)
        return np.stack(noise) - np.mean(noise, axis=0)


def _past(overshoots: Overshoots, rng: np.random.Generator) -> np.ndarray:
    """Draw at random how far a stroke runs past both its ends, (2,) px; 0 where none is known."""
    return np.array([rng.choice(end) if len(end) else 0.0 for end in overshoots.ends])


def _slow(white: BothWays, sigma: float, at: np.ndarray) -> np.ndarray:
    """White noise under a Gaussian of `sigma` rows, of variance 1, at places (N,) in rows."""
    margin = int(np.ceil(4 * sigma)) + 2
    low, high = int(np.floor(at.min())) - margin, int(np.ceil(at.max())) + margin + 1
    smooth = gaussian_filter1d(white.rows(low, high), sigma, axis=0, mode="nearest")
    kernel = gaussian_filter1d(np.eye(1, 2 * margin + 1, margin)[0], sigma, mode="constant")
    smooth = smooth / np.sqrt((kernel**2).sum())
    row = np.arange(low, high)
    return np.stack([np.interp(at, row, column) for column in smooth.T], axis=1)
