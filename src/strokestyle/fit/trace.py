"""Trace the strokes of a drawing through the rasteriser, point by point."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..drawing.strokes import Strokes
from ..render.config import HAIR
from ..render.displacement import Frame
from ..render.plan import Planned
from ..render.style import trim_invisible_ends
from .adam import OneCycleAdam
from .checkpoint import Checkpoint
from .config import FitConfig
from .cover import cover_strokes
from .observe import Observation
from .progress import Report

# The fewest and the most steps that a budget of time buys. More are of no use: 100, 300 and 1000
# steps drew other shapes alike (90.8, 90.7 and 90.6 % of an artist's repeatability), as did more
# steps, seeds or bootstraps of the thickness curves.
TRACE_STEPS = 40, 600
TRACE_SHARE = 0.8  # of what is left of a budget; thickness and texture are still to come

# Weights and rates below were set by hand on the example drawings; no ablation of them is kept.
THICKNESS_ROUGHNESS = 4.0  # a squared second difference of log width against one of px across
PULL_WEIGHT = 0.005  # of the mean squared change from the start, px across and log width
OVERSHOOT_WEIGHT = 0.02  # of the thickness, px, that stands past the strokes' ends
OFFSET_RATE, LOG_WIDTH_RATE = 0.3, 0.06  # px, and log width, a step of Adam at the cycle's top
WARM_UP = 0.1  # of the steps, until the one-cycle schedule is at its top

# A point agrees with what was measured across it if it lies this near, and is about as thick
AGREEING_OFFSET, AGREEING_RATIO = 1.5, 0.2  # px; of the thickness, as a natural logarithm
# How far a traced point is believed: one that agrees with what was measured or does not; past an
# end one whose thickness the drawing shows, or one that another stroke's ink may hide
AGREES, DISAGREES, PAST_END, PAST_END_HIDDEN = 1.0, 0.2, 0.7, 0.05

CROP_MARGIN = 32  # px around the strokes' points that are compared with the mask
CROWD_FLOOR = 0.06  # of ink around a pixel: more weight than its inverse no pixel gets


def thickness_of(log_width: np.ndarray) -> np.ndarray:
    """Turn log(thickness + HAIR) into px.

    It may fall below 0, which `cover_strokes` takes for 0 with a derivative.
    """
    return np.exp(log_width) - HAIR


@dataclass(frozen=True)
class MaskPyramid:
    """The mask that strokes are to fill, cropped to where strokes can be, at several sizes.

    Parameters
    ----------
    corner : (2,) px, x and y of the crop in the mask
    masks : per level, (h, w) float32
    weights : per level, (h, w) float32, of a pixel's error; their mean over the ink is 1
    missing : the weighed errors of the first level where nothing is drawn, summed
    """

    corner: np.ndarray
    masks: tuple[np.ndarray, ...]
    weights: tuple[np.ndarray, ...]
    missing: float

    @classmethod
    def of(cls, mask: np.ndarray, xy: np.ndarray, levels: int) -> MaskPyramid:
        """Crop a mask (H, W) around points (N, 2) px and blur it in steps."""
        height, width = mask.shape
        x0, y0 = np.maximum(np.floor(xy.min(axis=0)).astype(int) - CROP_MARGIN, 0)
        x1, y1 = np.ceil(xy.max(axis=0)).astype(int) + CROP_MARGIN
        crop = mask[y0 : min(y1, height), x0 : min(x1, width)].astype(np.float32)
        weight = _ink_weight(crop)
        missing = float((crop * weight).sum(dtype=np.float64))
        masks, weights = pyramid(crop, levels), pyramid(weight, levels)
        return cls(np.array([x0, y0], float), masks, weights, missing)

    def loss(
        self, xy: np.ndarray, thickness: np.ndarray, offsets: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Mean over levels of |drawn - mask|, per pixel of stroke in the mask.

        Returns it, and its derivatives by xy (N, 2) and by thickness (N,).
        """
        height, width = self.masks[0].shape
        cover = cover_strokes(xy - self.corner, thickness, offsets, height, width)
        drawn = np.zeros((height, width), np.float32)
        drawn.ravel()[cover.full] = 1
        drawn.ravel()[cover.pixel] = cover.value
        scale = 1 / (len(self.masks) * max(float(self.masks[0].sum()), 1.0))
        # at full size only pixels with ink are looked at: what the others miss does not change
        inked = np.concatenate([cover.pixel, cover.full])
        mask, weight = self.masks[0].ravel()[inked], self.weights[0].ravel()[inked]
        error = drawn.ravel()[inked] - mask
        gain = ((np.abs(error) - mask) * weight).sum(dtype=np.float64)
        total = scale * (self.missing + float(gain))
        pull = (np.sign(error) * weight * np.float32(scale))[: len(cover.pixel)]
        pulls = []
        images = pyramid(drawn, len(self.masks))
        for level in range(1, len(self.masks)):
            error = images[level] - self.masks[level]
            weight = self.weights[level] * np.float32(4**level * scale)
            total += float((np.abs(error) * weight).sum(dtype=np.float64))
            pulls.append(np.sign(error) * weight)
        if pulls:
            row = cover.pixel // width
            coarse = _back(pulls)
            pull = (
                pull
                + _share(row >> 1, height)
                * _share((column := cover.pixel - row * width) >> 1, width)
                * coarse[row >> 1, column >> 1]
            )
        return total, *cover.pull(pull)


def _share(half: np.ndarray, size: int) -> np.ndarray:
    """Of what a row or column on the halved grid is the mean: 1 / 2, or 1 / 1 at an odd end."""
    return np.where(2 * half + 1 < size, np.float32(0.5), np.float32(1.0))


def _back(pulls: list[np.ndarray]) -> np.ndarray:
    """Derivatives by each level of a pyramid below the first -> by the first that is halved."""
    total = np.zeros_like(pulls[-1])
    for pull in reversed(pulls):
        if total.shape != pull.shape:
            height, width = pull.shape
            row, column = np.arange(height) >> 1, np.arange(width) >> 1
            total = _share(row, height)[:, None] * total[row].repeat(2, axis=1)[:, :width]
            total *= _share(column, width)
        total = total + _blurred(pull)  # it is its own transpose
    return total


def _ink_weight(crop: np.ndarray) -> np.ndarray:
    """Weigh pixels so that a line counts by its length rather than its area.

    Otherwise hairlines would be given up for the sake of outlines.
    """
    small = pyramid(crop, 4)[-1]
    around = small
    for axis, size in enumerate(crop.shape):
        # the pixels' centres on the small grid, which is laid over the same area
        at = (np.arange(size) + 0.5) * (small.shape[axis] / size) - 0.5
        at = np.clip(at, 0, small.shape[axis] - 1)
        first = np.minimum(at.astype(int), max(small.shape[axis] - 2, 0))
        second = np.minimum(first + 1, small.shape[axis] - 1)
        part = (at - first).astype(np.float32)
        part = part[:, None] if axis == 0 else part
        around = (1 - part) * around.take(first, axis) + part * around.take(second, axis)
    weight = 1.0 / (CROWD_FLOOR + around)
    return weight * crop.sum() / np.maximum((weight * crop).sum(), 1e-6)


def pyramid(image: np.ndarray, levels: int) -> tuple[np.ndarray, ...]:
    """The image (H, W), then box blurs of 6, 12, ... px of it on grids of 2, 4, ... px."""
    out, small = [image], image
    for _ in range(levels - 1):
        small = _halved(small)
        out.append(_blurred(small))
    return tuple(out)


def _halved(image: np.ndarray) -> np.ndarray:
    """Means of 2 x 2 pixels; at an odd end, of those that are there."""
    for axis in (0, 1):
        if image.shape[axis] % 2:
            last = image.take([-1], axis)
            image = np.concatenate([image, last], axis)
    rows = image[::2] + image[1::2]
    return (rows[:, ::2] + rows[:, 1::2]) * np.float32(0.25)


def _blurred(image: np.ndarray) -> np.ndarray:
    """Means of 3 x 3 pixels, of which those outside are 0."""
    padded = np.zeros(np.add(image.shape, 2), image.dtype)
    padded[1:-1, 1:-1] = image
    rows = padded[:-2] + padded[1:-1]
    rows += padded[2:]
    out = rows[:, :-2] + rows[:, 1:-1]
    out += rows[:, 2:]
    out *= np.float32(1 / 9)
    return out


@dataclass(frozen=True)
class Traced:
    """The strokes of the drawing: xy (N, 2) px, log_width (N,) = log(thickness + HAIR)."""

    xy: np.ndarray
    log_width: np.ndarray

    @property
    def thickness(self) -> np.ndarray:
        """(N,) px, full width, 0 at least."""
        return np.maximum(thickness_of(self.log_width), 0.0)

    def part(self, rows: np.ndarray) -> Traced:
        """Keep some rows (n,)."""
        return Traced(self.xy[rows], self.log_width[rows])

    def strokes(self, planned: Planned) -> tuple[Strokes, np.ndarray]:
        """These strokes without the ends that are too thin to see.

        Returns them, and the rows (n,) of `planned` that they keep.
        """
        thickness = self.thickness
        rows, offsets, kept = trim_invisible_ends(thickness, planned.offsets)
        return Strokes(
            self.xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool)
        ), rows

    def observed(
        self, strokes: Frame, measured: Observation, ink: np.ndarray
    ) -> tuple[Observation, np.ndarray]:
        """Take these strokes for an observation, believed as far as another one agrees.

        Parameters
        ----------
        strokes : the planned strokes that were moved
        measured : what was measured across them
        ink : (N,) the mask at the planned points

        Returns the observation, and where (N,) bool the two agree.
        """
        offset, thickness = strokes.across(self.xy - strokes.xy), self.thickness
        ratio = np.log((thickness + HAIR) / (np.maximum(measured.thickness, 0) + HAIR))
        agrees = (measured.confidence > 0) & (np.abs(ratio) < AGREEING_RATIO)
        agrees &= np.abs(offset - measured.offset) < AGREEING_OFFSET
        past = ~strokes.on_curve
        # past an end nothing is measured, and ink there may be another stroke's
        shown = past & ((ink < 0.5) | (thickness > 1.0))
        confidence = np.where(
            past,
            np.where(shown, PAST_END, PAST_END_HIDDEN),
            np.where(agrees, AGREES, DISAGREES),
        )
        return Observation(offset, thickness, confidence), agrees


def interior(offsets: np.ndarray) -> np.ndarray:
    """(N-2,) bool: rows i, i + 1 and i + 2 lie on one stroke."""
    joined = np.ones(max(int(offsets[-1]) - 1, 0), bool)
    joined[offsets[1:-1] - 1] = False
    return joined[1:] & joined[:-1]


def roughness(values: np.ndarray, inner: np.ndarray) -> tuple[float, np.ndarray]:
    """Mean squared second difference of values (N,) over the rows `inner` (N-2,).

    Returns it, and its derivative by the values (N,).
    """
    bend = np.where(inner, values[2:] - 2 * values[1:-1] + values[:-2], 0.0)
    count = max(int(inner.sum()), 1)
    pull = np.zeros_like(values)
    pull[2:] += bend
    pull[1:-1] -= 2 * bend
    pull[:-2] += bend
    return float((bend**2).sum()) / count, pull * (2 / count)


class Misfit(NamedTuple):
    """What tracing makes small, and its derivatives.

    Parameters
    ----------
    loss : all of it
    mask : the misfit to the mask within it
    by_across, by_widening : derivatives (N,)
    """

    loss: float
    mask: float
    by_across: np.ndarray
    by_widening: np.ndarray


@dataclass(frozen=True)
class TraceLoss:
    """What tracing makes small: misfit to the mask, roughness, change, and ink past the ends.

    Parameters
    ----------
    target : the mask
    strokes : the planned strokes
    start : where their points begin, and how wide
    roughness : weight of the mean squared second differences of the changes
    """

    target: MaskPyramid
    strokes: Frame
    start: Traced
    roughness: float

    def moved(self, across: np.ndarray, widening: np.ndarray) -> Traced:
        """The strokes, changed by `across` (N,) px and `widening` (N,), of log width."""
        xy = self.start.xy + across[:, None] * self.strokes.normals
        return Traced(xy, self.start.log_width + widening)

    def __call__(self, across: np.ndarray, widening: np.ndarray) -> Misfit:
        """Measure strokes that are `moved`."""
        traced, count = self.moved(across, widening), len(across)
        thickness = thickness_of(traced.log_width)
        misfit, by_xy, by_thickness = self.target.loss(traced.xy, thickness, self.strokes.offsets)
        inner = interior(self.strokes.offsets)
        bent, by_bend = roughness(across, inner)
        uneven, by_uneven = roughness(widening, inner)
        rough = bent + THICKNESS_ROUGHNESS * uneven
        change = float((across**2).mean() + (widening**2).mean())
        # a stroke runs on past its end only where the mask asks for it
        past = np.where(self.strokes.on_curve, 0.0, np.maximum(thickness, 0.0))
        loss = misfit + self.roughness * rough + PULL_WEIGHT * change
        loss += OVERSHOOT_WEIGHT * float(past.sum()) / count
        by_thickness = by_thickness + OVERSHOOT_WEIGHT / count * (past > 0)
        pull = 2 * PULL_WEIGHT / count
        return Misfit(
            loss,
            misfit,
            self.strokes.across(by_xy) + self.roughness * by_bend + pull * across,
            by_thickness * np.exp(traced.log_width)
            + self.roughness * THICKNESS_ROUGHNESS * by_uneven
            + pull * widening,
        )


def optimise_strokes(
    strokes: Frame,
    start: Traced,
    target: MaskPyramid,
    config: FitConfig,
    report: Report,
    checkpoint: Checkpoint,
) -> Traced:
    """Move every point to where the drawing has it, along its normal, and give it its width there.

    Parameters
    ----------
    strokes : the planned strokes
    start : where their points are to begin, and how wide
    target : the mask that they are to fill
    config : its `trace_steps` and `roughness` are used
    report : told of every step
    checkpoint : where the state is kept, under "trace"
    """
    across, widening = np.zeros(len(start.log_width)), np.zeros(len(start.log_width))
    trace_loss = TraceLoss(target, strokes, start, config.roughness)
    adam = OneCycleAdam(
        [across, widening], [OFFSET_RATE, LOG_WIDTH_RATE], config.trace_steps, WARM_UP
    )
    learned = {"across": across, "widening": widening}
    watched = checkpoint.watch("trace", config.trace_steps, learned, {"adam": adam})
    with watched as (remaining, passed):
        for step in remaining:
            misfit = trace_loss(across, widening)
            adam.step([misfit.by_across, misfit.by_widening])
            passed()
            report("trace", step, config.trace_steps, {"mask": misfit.mask})
    return trace_loss.moved(across, widening)


def affordable_steps(
    strokes: Frame, start: Traced, target: MaskPyramid, config: FitConfig, until: float
) -> int:
    """Count the steps of `optimise_strokes` that fit in the time left, with what follows.

    `until` is on the clock of time.monotonic(), seconds. Six steps are run to time them.
    """
    clock: list[float] = []

    def tick(*_: object) -> None:
        clock.append(time.monotonic())

    optimise_strokes(strokes, start, target, replace(config, trace_steps=6), tick, Checkpoint())
    each = (clock[-1] - clock[0]) / (len(clock) - 1)  # the first step also warms up
    return int(np.clip(TRACE_SHARE * (until - clock[-1]) / each, *TRACE_STEPS))
