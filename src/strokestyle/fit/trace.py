"""Trace the strokes of a drawing through the rasteriser, point by point."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ..drawing.strokes import Strokes
from ..render.config import HAIR
from ..render.coverage import coverage
from ..render.displacement import Frame
from ..render.plan import Planned
from ..render.style import trim_invisible_ends
from .adam import OneCycleAdam
from .checkpoint import Checkpoint
from .config import FitConfig
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


@dataclass(frozen=True)
class StrokeTensors:
    """Planned strokes as tensors on one device, real numbers in float32.

    Parameters
    ----------
    xy : (N, 2) px, on the curves
    normals : (N, 2) unit vectors across the strokes
    deformations : (N, M, 2) px, the displacement by each of DEFORMATIONS at full strength
    offsets : (C+1,) int64
    on_curve : (N,) bool, False where a point lies past a stroke's end
    """

    xy: Tensor
    normals: Tensor
    deformations: Tensor
    offsets: Tensor
    on_curve: Tensor

    @classmethod
    def of(cls, frame: Frame, device: torch.device) -> StrokeTensors:
        """Copy a frame's arrays to a device."""
        arrays = (frame.xy, frame.normals, frame.deformations, frame.offsets, frame.on_curve)
        tensors = [torch.as_tensor(array, device=device) for array in arrays]
        return cls(*(a.float() if a.is_floating_point() else a for a in tensors))

    def part(self, rows: np.ndarray, offsets: np.ndarray, on_curve: np.ndarray) -> StrokeTensors:
        """Keep some rows (n,), which `offsets` cut into strokes, `on_curve` (n,) where they are."""
        index = torch.as_tensor(rows, device=self.offsets.device)
        cut, on = (torch.as_tensor(a, device=index.device) for a in (offsets, on_curve))
        return StrokeTensors(self.xy[index], self.normals[index], self.deformations[index], cut, on)

    def displaced(self, weights: Tensor) -> Tensor:
        """Move the points by `weights` (M,) of the deformations: (N, 2) px."""
        return self.xy + (self.deformations * weights[:, None]).sum(1)

    def across(self, vectors: Tensor) -> Tensor:
        """Measure vectors (N, 2) along the normals: (N,)."""
        return (vectors * self.normals).sum(1)

    def deformations_across(self) -> np.ndarray:
        """Measure the deformations along the normals: (N, M) float64, px."""
        return (self.deformations * self.normals[:, None]).sum(2).double().cpu().numpy()

    def interior(self) -> Tensor:
        """(N-2,) bool: rows i, i + 1 and i + 2 lie on one stroke."""
        joined = torch.ones(int(self.offsets[-1]) - 1, dtype=torch.bool, device=self.offsets.device)
        joined[self.offsets[1:-1] - 1] = False
        return joined[1:] & joined[:-1]


def thickness_of(log_width: Tensor) -> Tensor:
    """Turn log(thickness + HAIR) into px.

    It may fall below 0, which `coverage` takes for 0 with a gradient.
    """
    return torch.exp(log_width) - HAIR


@dataclass(frozen=True)
class MaskPyramid:
    """The mask that strokes are to fill, cropped to where strokes can be, at several sizes.

    Parameters
    ----------
    corner : (2,) px, x and y of the crop in the mask
    masks : per level, (1, 1, h, w)
    weights : per level, (1, 1, h, w), of a pixel's error; their mean over the ink is 1
    levels : how many
    """

    corner: Tensor
    masks: tuple[Tensor, ...]
    weights: tuple[Tensor, ...]
    levels: int

    @classmethod
    def of(cls, mask: np.ndarray, xy: np.ndarray, levels: int, device: torch.device) -> MaskPyramid:
        """Crop a mask (H, W) around points (N, 2) px and blur it in steps."""
        height, width = mask.shape
        x0, y0 = np.maximum(np.floor(xy.min(axis=0)).astype(int) - CROP_MARGIN, 0)
        x1, y1 = np.ceil(xy.max(axis=0)).astype(int) + CROP_MARGIN
        crop = torch.tensor(
            mask[y0 : min(y1, height), x0 : min(x1, width)], dtype=torch.float32, device=device
        )[None, None]
        corner = torch.tensor([x0, y0], dtype=torch.float32, device=device)
        return cls(corner, pyramid(crop, levels), pyramid(_ink_weight(crop), levels), levels)

    def loss(self, xy: Tensor, thickness: Tensor, offsets: Tensor) -> Tensor:
        """Mean over levels of |drawn - mask|, per pixel of stroke in the mask."""
        height, width = self.masks[0].shape[2:]
        drawn = coverage(xy - self.corner, thickness, offsets, height, width)[None, None]
        total = sum(
            ((image - mask).abs() * weight).sum() * 4**level
            for level, (image, mask, weight) in enumerate(
                zip(pyramid(drawn, self.levels), self.masks, self.weights, strict=True)
            )
        )
        return total / (self.levels * self.masks[0].sum().clamp(min=1.0))


def _ink_weight(crop: Tensor) -> Tensor:
    """Weigh pixels so that a line counts by its length rather than its area.

    Otherwise hairlines would be given up for the sake of outlines.
    """
    around = F.interpolate(pyramid(crop, 4)[-1], size=crop.shape[2:], mode="bilinear")
    weight = 1.0 / (CROWD_FLOOR + around)
    return weight * crop.sum() / (weight * crop).sum().clamp(min=1e-6)


def pyramid(image: Tensor, levels: int) -> tuple[Tensor, ...]:
    """The image (1, 1, H, W), then box blurs of 6, 12, ... px of it on grids of 2, 4, ... px."""
    out, small = [image], image
    for _ in range(levels - 1):
        small = F.avg_pool2d(small, 2, ceil_mode=True)
        out.append(F.avg_pool2d(small, 3, 1, 1))
    return tuple(out)


@dataclass(frozen=True)
class Traced:
    """The strokes of the drawing: xy (N, 2) px, log_width (N,) = log(thickness + HAIR)."""

    xy: Tensor
    log_width: Tensor

    @property
    def thickness(self) -> Tensor:
        """(N,) px, full width, 0 at least."""
        return thickness_of(self.log_width).clamp(min=0.0)

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Thickness (N,) and xy (N, 2), px, float64."""
        return self.thickness.double().cpu().numpy(), self.xy.double().cpu().numpy()

    def part(self, rows: np.ndarray) -> Traced:
        """Keep some rows (n,)."""
        index = torch.as_tensor(rows, device=self.xy.device)
        return Traced(self.xy[index], self.log_width[index])

    def strokes(self, planned: Planned) -> tuple[Strokes, np.ndarray]:
        """These strokes without the ends that are too thin to see.

        Returns them, and the rows (n,) of `planned` that they keep.
        """
        thickness, xy = self.arrays()
        rows, offsets, kept = trim_invisible_ends(thickness, planned.offsets)
        return Strokes(
            xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool)
        ), rows

    def observed(
        self, strokes: StrokeTensors, measured: Observation, ink: np.ndarray
    ) -> tuple[Observation, np.ndarray]:
        """Take these strokes for an observation, believed as far as another one agrees.

        Parameters
        ----------
        strokes : the planned strokes that were moved
        measured : what was measured across them
        ink : (N,) the mask at the planned points

        Returns the observation, and where (N,) bool the two agree.
        """
        offset = strokes.across(self.xy - strokes.xy).double().cpu().numpy()
        thickness = self.thickness.double().cpu().numpy()
        ratio = np.log((thickness + HAIR) / (np.maximum(measured.thickness, 0) + HAIR))
        agrees = (measured.confidence > 0) & (np.abs(ratio) < AGREEING_RATIO)
        agrees &= np.abs(offset - measured.offset) < AGREEING_OFFSET
        past = ~strokes.on_curve.cpu().numpy()
        # past an end nothing is measured, and ink there may be another stroke's
        shown = past & ((ink < 0.5) | (thickness > 1.0))
        confidence = np.where(
            past,
            np.where(shown, PAST_END, PAST_END_HIDDEN),
            np.where(agrees, AGREES, DISAGREES),
        )
        return Observation(offset, thickness, confidence), agrees


def roughness(values: Tensor, interior: Tensor) -> Tensor:
    """Mean squared second difference of values (N,) over the rows `interior` (N-2,)."""
    return (values[2:] - 2 * values[1:-1] + values[:-2])[interior].square().mean()


@dataclass(frozen=True)
class TraceLoss:
    """What tracing makes small: misfit to the mask, roughness, change, and ink past the ends.

    Parameters
    ----------
    target : the mask
    strokes : the planned strokes
    roughness : weight of the mean squared second differences of the changes
    """

    target: MaskPyramid
    strokes: StrokeTensors
    roughness: float

    def __call__(self, traced: Traced, across: Tensor, widening: Tensor) -> tuple[Tensor, Tensor]:
        """The loss, and the misfit to the mask within it.

        `across` (N,) px and `widening` (N,), of log width, are the changes that made `traced`.
        """
        thickness = thickness_of(traced.log_width)
        interior = self.strokes.interior()
        misfit = self.target.loss(traced.xy, thickness, self.strokes.offsets)
        rough = roughness(across, interior) + THICKNESS_ROUGHNESS * roughness(widening, interior)
        change = across.square().mean() + widening.square().mean()
        # a stroke runs on past its end only where the mask asks for it
        past = thickness[~self.strokes.on_curve].clamp(min=0).sum() / len(thickness)
        loss = misfit + self.roughness * rough + PULL_WEIGHT * change + OVERSHOOT_WEIGHT * past
        return loss, misfit


def optimise_strokes(
    strokes: StrokeTensors,
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
    across = torch.zeros_like(start.log_width, requires_grad=True)
    widening = torch.zeros_like(start.log_width, requires_grad=True)
    adam = OneCycleAdam(
        [across, widening], [OFFSET_RATE, LOG_WIDTH_RATE], config.trace_steps, WARM_UP
    )
    trace_loss = TraceLoss(target, strokes, config.roughness)

    def moved() -> Traced:
        return Traced(start.xy + across[:, None] * strokes.normals, start.log_width + widening)

    learned = {"across": across, "widening": widening}
    with checkpoint.watch("trace", config.trace_steps, learned, {"adam": adam}) as (
        remaining,
        passed,
    ):
        for step in remaining:
            loss, misfit = trace_loss(moved(), across, widening)
            loss.backward()
            adam.step()
            passed()
            report("trace", step, config.trace_steps, {"mask": misfit})
    with torch.no_grad():
        return moved()


def affordable_steps(
    strokes: StrokeTensors, start: Traced, target: MaskPyramid, config: FitConfig, until: float
) -> int:
    """Count the steps of `optimise_strokes` that fit in the time left, with what follows.

    `until` is on the clock of time.monotonic(), seconds. Six steps are run to time them.
    """
    clock: list[float] = []

    def tick(*_: object) -> None:
        if start.log_width.device.type == "cuda":
            torch.cuda.synchronize(start.log_width.device)
        clock.append(time.monotonic())

    optimise_strokes(strokes, start, target, replace(config, trace_steps=6), tick, Checkpoint())
    each = (clock[-1] - clock[0]) / (len(clock) - 1)  # the first step also warms up
    return int(np.clip(TRACE_SHARE * (until - clock[-1]) / each, *TRACE_STEPS))
