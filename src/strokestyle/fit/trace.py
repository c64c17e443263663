"""Trace the strokes of a drawing through the rasteriser, point by point."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields, replace

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
from .checkpoint import Checkpoint
from .config import FitConfig
from .observe import Observation
from .progress import Reporter

# The fewest and the most that a budget of time buys. More are of no use: 100, 300 and 1000 steps drew other shapes
# alike (90.8, 90.7 and 90.6 % of an artist's repeatability), as did more steps, seeds or bootstraps of the
# thickness curves.
TRACE_STEPS = 40, 600
TRACED = 0.8  # of what is left of a budget goes into them; thickness and texture are still to come


def tensors(frame: Frame, device: torch.device) -> Frame:
    """The same frame as tensors, real numbers in float32."""
    arrays = {f.name: torch.as_tensor(getattr(frame, f.name), device=device) for f in fields(frame)}
    return Frame(**{name: a.float() if a.is_floating_point() else a for name, a in arrays.items()})


def thickness_of(swell: Tensor) -> Tensor:
    """log(thickness + HAIR) -> px. It may fall below 0, which `coverage` takes for 0 with a gradient."""
    return torch.exp(swell) - HAIR


@dataclass(frozen=True)
class MaskPyramid:
    """The mask that strokes are to fill, cropped to where strokes can be, as a pyramid.

    corner (2,) x, y of the crop; masks and weights, per level, (1, 1, h, w); weights have mean 1 over the mask
    """

    corner: Tensor
    masks: tuple[Tensor, ...]
    weights: tuple[Tensor, ...]
    levels: int

    @classmethod
    def of(cls, mask: np.ndarray, xy: np.ndarray, levels: int, device) -> MaskPyramid:
        height, width = mask.shape
        room = 32
        x0, y0 = np.maximum(np.floor(xy.min(axis=0)).astype(int) - room, 0)
        x1, y1 = np.ceil(xy.max(axis=0)).astype(int) + room
        crop = torch.tensor(
            mask[y0 : min(y1, height), x0 : min(x1, width)], dtype=torch.float32, device=device
        )
        crop = crop[None, None]
        # a line counts by its length rather than by its area, so that hairlines are not given up for outlines
        around = F.interpolate(pyramid(crop, 4)[-1], size=crop.shape[2:], mode="bilinear")
        weight = 1.0 / (0.06 + around)
        weight = weight * crop.sum() / (weight * crop).sum().clamp(min=1e-6)
        corner = torch.tensor([x0, y0], dtype=torch.float32, device=device)
        return cls(corner, pyramid(crop, levels), pyramid(weight, levels), levels)

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


def pyramid(image: Tensor, levels: int) -> tuple[Tensor, ...]:
    """The image (1, 1, H, W), then box blurs of 6, 12, ... px of it on grids of 2, 4, ... px."""
    out, small = [image], image
    for _ in range(levels - 1):
        small = F.avg_pool2d(small, 2, ceil_mode=True)
        out.append(F.avg_pool2d(small, 3, 1, 1))
    return tuple(out)


@dataclass(frozen=True)
class Traced:
    """The strokes of the drawing: xy (N, 2) px, swell (N,) = log(thickness + HAIR)."""

    xy: Tensor
    swell: Tensor

    @property
    def thickness(self) -> Tensor:
        return thickness_of(self.swell).clamp(min=0.0)

    def strokes(self, planned: Planned) -> tuple[Strokes, np.ndarray]:
        """These strokes without the ends that are too thin to see, and the rows (n,) of `planned` that they keep."""
        xy, thickness = self.xy.double().cpu().numpy(), self.thickness.double().cpu().numpy()
        rows, offsets, kept = trim_invisible_ends(thickness, planned.offsets)
        return Strokes(
            xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool)
        ), rows

    def guess(
        self, frame: Frame, measured: Observation, mask_here: np.ndarray
    ) -> tuple[Observation, np.ndarray]:
        """These strokes as a guess, and where (N,) they are sure: seen alike from across and through the rasteriser."""
        offset = ((self.xy - frame.xy) * frame.across).sum(1).double().cpu().numpy()
        thickness = self.thickness.double().cpu().numpy()
        ratio = np.log((thickness + HAIR) / (np.maximum(measured.thickness, 0) + HAIR))
        # past an end: not sure only where another stroke's ink may hide it
        past = ~frame.within.cpu().numpy()
        told = past & ((mask_here < 0.5) | (thickness > 1.0))
        sure = (
            (measured.trust > 0) & (np.abs(ratio) < 0.2) & (np.abs(offset - measured.offset) < 1.5)
        )
        return Observation(
            offset, thickness, np.where(past, np.where(told, 0.7, 0.05), np.where(sure, 1.0, 0.2))
        ), sure


def optimise_strokes(
    frame: Frame,
    meant: Tensor,
    swell: Tensor,
    target: MaskPyramid,
    config: FitConfig,
    report: Reporter,
    checkpoint: Checkpoint,
) -> Traced:
    """Move every point of the strokes to where the drawing has them, through the rasteriser, and swell them there."""
    across = torch.zeros_like(swell, requires_grad=True)
    change = torch.zeros_like(swell, requires_grad=True)
    optimiser = torch.optim.Adam([{"params": [across]}, {"params": [change]}], lr=0.1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, [0.3, 0.06], total_steps=config.trace_steps, pct_start=0.1
    )
    same = _neighbours(frame.offsets)
    bend = same[1:] & same[:-1]
    beyond = ~frame.within

    def strokes() -> Traced:
        return Traced(meant + across[:, None] * frame.across, swell + change)

    learned, training = (
        {"across": across, "change": change},
        {"optimiser": optimiser, "schedule": schedule},
    )
    with checkpoint.watch("trace", config.trace_steps, learned, training) as (remaining, passed):
        for step in remaining:
            optimiser.zero_grad(set_to_none=True)
            drawn = strokes()
            thickness = thickness_of(drawn.swell)
            mask = target.loss(drawn.xy, thickness, frame.offsets)
            curl = across[2:] - 2 * across[1:-1] + across[:-2]
            ripple = change[2:] - 2 * change[1:-1] + change[:-2]
            rough = curl[bend].square().mean() + 4 * ripple[bend].square().mean()
            far = across.square().mean() + change.square().mean()
            # a stroke runs on past its end only where the mask asks for it
            idle = thickness[beyond].clamp(min=0).sum() / len(thickness)
            loss = mask + config.roughness * rough + 0.005 * far + 0.02 * idle
            loss.backward()
            optimiser.step()
            schedule.step()
            passed()
            report("trace", step, config.trace_steps, {"mask": mask})
    with torch.no_grad():
        return strokes()


def affordable_steps(
    frame: Frame, meant: Tensor, swell: Tensor, target: MaskPyramid, config: FitConfig, until: float
) -> int:
    """How many steps of `optimise_strokes` fit in the time until then, with what follows (time.monotonic)."""
    clock = []

    def tick(*_) -> None:
        if swell.device.type == "cuda":
            torch.cuda.synchronize(swell.device)
        clock.append(time.monotonic())

    optimise_strokes(
        frame, meant, swell, target, replace(config, trace_steps=6), tick, Checkpoint()
    )
    each = (clock[-1] - clock[0]) / (len(clock) - 1)  # the first step also warms up
    return int(np.clip(TRACED * (until - clock[-1]) / each, *TRACE_STEPS))


def _neighbours(offsets: Tensor) -> Tensor:
    """(N-1,) bool: rows i and i + 1 lie on the same stroke."""
    same = torch.ones(int(offsets[-1]) - 1, dtype=torch.bool, device=offsets.device)
    same[offsets[1:-1] - 1] = False
    return same
