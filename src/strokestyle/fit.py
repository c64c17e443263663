"""Learning a style: (view, exemplar) -> Style.

quick and standard: a small network along the strokes, trained on the whole view through the rasteriser; then the
strokes of the drawing itself are traced from there, point by point, which shows how the hand strays and gives the
texture strokes that lie where the ink does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor
from torch.nn import functional as F

from . import __version__
from .exemplar import Exemplar
from .model import StrokeNet
from .planning import Planned
from .raster import coverage
from .strokes import Drawing, Strokes, rasterise
from .style import (
    MOVES,
    Frame,
    Hand,
    Style,
    StyleConfig,
    lay,
    lifted,
    pick_device,
    plan,
    point_features,
)
from .texture import learn_texture
from .view import View


@dataclass(frozen=True)
class FitConfig:
    """How to learn. Where no source is named, a value was measured on drawings of shapes of the project's own.

    Parameters
    ----------
    preset : its name, kept in the model
    start_steps : steps towards what `measure` reads off the mask
    steps : Adam steps of the network through the rasteriser (prototype: 300)
    trace_steps : Adam steps of the strokes' own points
    rate : peak learning rate, one-cycle (prototype)
    decay : weight decay of the network
    blurs : px, box blurs at which mask and strokes are compared by L1 (prototype)
    smoothness : weight of the squared change of displacement from point to point (paper, sec. 4: 0.02)
    style : StyleConfig
    """

    preset: str
    start_steps: int = 200
    steps: int = 300
    trace_steps: int = 120
    rate: float = 6e-3
    decay: float = 0.05
    blurs: tuple[int, ...] = (1, 5, 11)
    smoothness: float = 0.02
    stray: float = 1.0
    texture: bool = True
    style: StyleConfig = field(default_factory=StyleConfig)


PRESETS = {
    "quick": FitConfig("quick", steps=200, trace_steps=80),
    "standard": FitConfig("standard", steps=600, trace_steps=200),
}


@dataclass(frozen=True)
class Progress:
    """Where a fit stands: `step` of `steps` of a stage, its latest losses, and a guess of the seconds left in all."""

    stage: str
    step: int
    steps: int
    losses: dict[str, float]
    seconds_left: float | None


def fit(
    view: View,
    exemplar: Exemplar,
    config: FitConfig = PRESETS["standard"],
    *,
    seed: int = 0,
    device: str = "auto",
    progress: Callable[[Progress], None] | None = None,
    source: str = "",
) -> Style:
    """Learn the style of one drawing.

    Parameters
    ----------
    view : the shape as it was drawn
    exemplar : the drawing, at the view's size
    config : one of PRESETS, or a change of it
    seed : same seed, same style, bit for bit on one machine
    device : "auto", "cpu" or "cuda"
    progress : called now and then
    source : the drawing's name, kept in the model

    Raises
    ------
    ValueError
        where drawing and view differ in size, or there are no strokes to learn from.
    """
    size = (view.camera.height, view.camera.width)
    if exemplar.mask.shape != size:
        raise ValueError(f"the drawing is {exemplar.mask.shape[::-1]} px, the view {size[::-1]}: resample the drawing")
    style_config = replace(config.style, size=max(size))
    planned = plan(view, style_config)
    if not len(planned):
        raise ValueError("no curves in this view are long enough to draw: nothing to learn from")
    if exemplar.mask.max() < 0.5:
        raise ValueError("no strokes in this drawing: nothing to learn from")
    report = _Reporter(progress, config)
    device = pick_device(device)
    raw = point_features(view, planned, style_config)
    low, high = np.percentile(raw, [0.5, 99.5], axis=0)
    clipped = np.clip(raw, low, high)
    centre, spread = clipped.mean(axis=0), np.maximum(clipped.std(axis=0), 1e-3)
    features = torch.tensor((clipped - centre) / spread, dtype=torch.float32, device=device)
    frame = Frame.of(planned, view, style_config.spacing).to(device)
    target = Target.of(exemplar.mask, planned.xy, config.blurs, device)
    guess = measure(exemplar.mask, planned, frame)
    base = float(np.clip(np.median(guess.thickness[guess.trust > 0]), 0.8, 40.0)) if guess.trust.any() else 3.0
    network, moves = train_network(frame, features, target, guess, base, style_config, config, seed, report)
    with torch.no_grad():
        mean_xy, mean_thickness = lay(network, moves, base, frame, features)
    xy, thickness = trace(frame, mean_xy, mean_thickness, target, config, report)
    hand = _hand(frame, planned, mean_xy, mean_thickness, xy, thickness, config.stray)
    style = Style(
        config=style_config,
        network=network.eval(),
        moves=moves,
        base=base,
        centre=centre,
        spread=spread,
        low=low,
        high=high,
        hand=hand,
        color=_flat_ink(exemplar),
        about={"strokestyle": __version__, "preset": config.preset, "seed": seed, "exemplar": source},
    )
    if config.texture:
        style = _learn_texture(style, planned, features, xy, thickness, exemplar, seed, report)
    return style


@dataclass(frozen=True)
class Guess:
    """What lies across each point of the strokes in the drawing, read off the mask: a start, wrong where lines crowd.

    offset (N,) px along the normal, thickness (N,) px, trust (N,) in [0, 1], 0 = nothing found
    """

    offset: np.ndarray
    thickness: np.ndarray
    trust: np.ndarray


def measure(mask: np.ndarray, planned: Planned, frame: Frame, reach: float = 16.0) -> Guess:
    """Look across every point, along the normal, for the nearest run of stroke."""
    q = np.arange(-2 * reach, 2 * reach + 0.25, 0.5)
    normal = frame.across.double().cpu().numpy()
    at = planned.xy[:, None] + q[None, :, None] * normal[:, None]
    profile = ndimage.map_coordinates(mask, [at[..., 1] - 0.5, at[..., 0] - 0.5], order=1, mode="constant")
    inside, index = profile > 0.4, np.arange(len(q))
    distance = np.where(inside, np.abs(q), np.inf)
    k = distance.argmin(axis=1)
    nearest = distance[np.arange(len(k)), k]
    # the run of ink around sample k: from the last blank before it to the first after
    blank_before = np.where(~inside & (index < k[:, None]), index, -1).max(axis=1)
    blank_after = np.where(~inside & (index > k[:, None]), index, len(q)).min(axis=1)
    run = (index >= blank_before[:, None]) & (index <= blank_after[:, None])
    weight = profile * run
    total = np.maximum(weight.sum(axis=1), 1e-6)
    offset, thickness = (weight * q).sum(axis=1) / total, 0.5 * total
    ends_seen = (blank_before >= 0) & (blank_after < len(q))
    trust = ends_seen & (nearest < reach) & (np.abs(offset) < reach)
    found = thickness[trust]
    if len(found):  # a run far wider than its like is another stroke seen lengthwise
        trust &= thickness < 2.5 * np.quantile(found, 0.9)
    return Guess(offset, thickness, trust / (1.0 + (offset / 6.0) ** 2))


def _start(network, moves, base, frame: Frame, features: Tensor, guess: Guess, config: FitConfig) -> None:
    """Teach the network the first guess, without the rasteriser: it then starts near the drawing."""
    offset = torch.tensor(guess.offset, dtype=torch.float32, device=features.device)
    thickness = torch.tensor(guess.thickness, dtype=torch.float32, device=features.device)
    trust = torch.tensor(guess.trust, dtype=torch.float32, device=features.device) * frame.within
    parameters = [*network.parameters(), moves]
    optimiser = torch.optim.AdamW(parameters, lr=config.rate, weight_decay=0.01)
    for step in range(config.start_steps):
        for group in optimiser.param_groups:
            group["lr"] = config.rate * min(1.0, 2 - 2 * step / config.start_steps)
        optimiser.zero_grad(set_to_none=True)
        xy, drawn = lay(network, moves, base, frame, features)
        shift = xy - frame.xy
        aside = F.smooth_l1_loss((shift * frame.across).sum(1), offset, reduction="none", beta=1.0)
        width = F.smooth_l1_loss((drawn + 0.5).log(), (thickness + 0.5).log(), reduction="none", beta=0.2)
        idle = drawn[~frame.within].sum() / len(xy)
        loss = (trust * (aside + 4 * width)).sum() / trust.sum().clamp(min=1) + 0.05 * idle
        loss = loss + 0.05 * (shift * frame.along).sum(1).square().mean()
        loss.backward()
        optimiser.step()


@dataclass(frozen=True)
class Target:
    """The mask that strokes are to fill, cropped to where strokes can be, and its blurs."""

    corner: Tensor  # (2,) x, y of the crop
    masks: tuple[Tensor, ...]  # per blur, (1, 1, h, w)
    weights: tuple[Tensor, ...]  # per blur, (1, 1, h, w), mean 1 over the mask
    blurs: tuple[int, ...]

    @classmethod
    def of(cls, mask: np.ndarray, xy: np.ndarray, blurs: tuple[int, ...], device) -> Target:
        height, width = mask.shape
        room = 32
        x0, y0 = np.maximum(np.floor(xy.min(axis=0)).astype(int) - room, 0)
        x1, y1 = np.ceil(xy.max(axis=0)).astype(int) + room
        crop = torch.tensor(mask[y0 : min(y1, height), x0 : min(x1, width)], dtype=torch.float32, device=device)
        crop = crop[None, None]
        corner = torch.tensor([x0, y0], dtype=torch.float32, device=device)
        # a line counts by its length rather than by its area, so that hairlines are not given up for outlines
        weight = 1.0 / (0.06 + F.avg_pool2d(crop, 25, 1, 12, count_include_pad=False))
        weight = weight * crop.sum() / (weight * crop).sum().clamp(min=1e-6)
        weights = tuple(weight if b == 1 else F.avg_pool2d(weight, b, stride_of(b), b // 2) for b in blurs)
        return cls(corner, tuple(blur(crop, b) for b in blurs), weights, blurs)

    def loss(self, xy: Tensor, thickness: Tensor, offsets: Tensor) -> Tensor:
        """Mean over blurs of |drawn - mask|, per pixel of stroke in the mask."""
        height, width = self.masks[0].shape[2:]
        drawn = coverage(xy - self.corner, thickness, offsets, height, width)[None, None]
        total = sum(
            ((blur(drawn, b) - mask).abs() * weight).sum() * stride_of(b) ** 2
            for b, mask, weight in zip(self.blurs, self.masks, self.weights, strict=True)
        )
        return total / (len(self.blurs) * self.masks[0].sum().clamp(min=1.0))


def stride_of(size: int) -> int:
    return max(1, size // 3)


def blur(image: Tensor, size: int) -> Tensor:
    """Box blur of `size` px (odd), taken every third of it."""
    return image if size == 1 else F.avg_pool2d(image, size, stride_of(size), size // 2)


def train_network(
    frame: Frame,
    features: Tensor,
    target: Target,
    guess: Guess,
    base: float,
    style: StyleConfig,
    config: FitConfig,
    seed: int,
    report: _Reporter,
) -> tuple[StrokeNet, Tensor]:
    """The network and the moves that fill the mask best, as functions of the features."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = StrokeNet(features.shape[1], 3, style.width, style.dilations)
    network = network.to(features.device)
    moves = torch.zeros(len(MOVES), device=features.device, requires_grad=True)
    groups = [{"params": network.parameters(), "weight_decay": config.decay}, {"params": [moves], "weight_decay": 0.0}]
    optimiser = torch.optim.AdamW(groups, lr=config.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, [config.rate, 4 * config.rate], total_steps=config.steps, pct_start=0.2
    )
    same = _neighbours(frame.offsets)
    beyond = ~frame.within
    _start(network, moves, base, frame, features, guess, config)
    for step in range(config.steps):
        optimiser.zero_grad(set_to_none=True)
        xy, thickness = lay(network, moves, base, frame, features)
        mask = target.loss(xy, thickness, frame.offsets)
        shift = xy - frame.xy
        smooth = (shift[1:] - shift[:-1])[same].square().sum(1).mean()
        # a stroke runs on past its end only where the mask asks for it
        idle = thickness[beyond].sum() / len(xy)
        loss = mask + config.smoothness * smooth + 0.02 * idle
        loss.backward()
        optimiser.step()
        schedule.step()
        report("strokes", step + 1, config.steps, {"mask": mask, "smooth": smooth})
    return network, moves.detach()


def trace(
    frame: Frame, mean_xy: Tensor, mean_thickness: Tensor, target: Target, config: FitConfig, report: _Reporter
) -> tuple[Tensor, Tensor]:
    """Move every point of the strokes to where the drawing has them, starting from what the network says."""
    across = torch.zeros_like(mean_thickness, requires_grad=True)
    swell = torch.zeros_like(mean_thickness, requires_grad=True)
    optimiser = torch.optim.Adam([{"params": [across]}, {"params": [swell]}], lr=0.1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, [0.2, 0.1], total_steps=max(config.trace_steps, 2), pct_start=0.1
    )
    same = _neighbours(frame.offsets)
    bend = same[1:] & same[:-1]

    def place():
        xy = mean_xy + across[:, None] * frame.across
        return xy, mean_thickness * torch.exp(swell.clamp(-1.5, 1.5))

    for step in range(config.trace_steps):
        optimiser.zero_grad(set_to_none=True)
        xy, thickness = place()
        mask = target.loss(xy, thickness, frame.offsets)
        curl = across[2:] - 2 * across[1:-1] + across[:-2]
        ripple = swell[2:] - 2 * swell[1:-1] + swell[:-2]
        rough = curl[bend].square().mean() + 4 * ripple[bend].square().mean()
        far = across.square().mean() + swell.square().mean()
        loss = mask + 0.1 * rough + 0.005 * far
        loss.backward()
        optimiser.step()
        schedule.step()
        report("trace", step + 1, config.trace_steps, {"mask": mask})
    with torch.no_grad():
        return place()


def _neighbours(offsets: Tensor) -> Tensor:
    """(N-1,) bool: rows i and i + 1 lie on the same stroke."""
    same = torch.ones(int(offsets[-1]) - 1, dtype=torch.bool, device=offsets.device)
    same[offsets[1:-1] - 1] = False
    return same


def _hand(frame, planned, mean_xy, mean_thickness, xy, thickness, amount) -> Hand | None:
    """Residuals of the traced strokes against the network's, in the strokes' own frame; only within the curves."""
    if amount == 0:
        return None
    moved = xy - mean_xy
    stray = torch.stack(
        [
            (moved * frame.across).sum(1),
            (moved * frame.along).sum(1),
            (thickness - mean_thickness) / (mean_thickness + 0.5),
        ],
        dim=1,
    )
    stray = (amount * stray).cpu().numpy().astype(np.float32)
    within = (planned.beyond == 0) & (mean_thickness.cpu().numpy() > 0.5)
    which = np.repeat(np.arange(len(planned)), np.diff(planned.offsets))
    counts = np.bincount(which[within], minlength=len(planned))
    counts = counts[counts > 0]
    if not len(counts):
        return None
    return Hand(stray[within], np.r_[0, np.cumsum(counts)].astype(np.int64))


def _flat_ink(exemplar: Exemplar) -> np.ndarray:
    """The ink of a flat drawing: mean colour and opacity where the mask holds ink."""
    weight = exemplar.mask * exemplar.alpha
    total = max(float(weight.sum()), 1e-6)
    rgb = (exemplar.ink * weight[..., None]).sum(axis=(0, 1)) / total
    alpha = float((exemplar.alpha * exemplar.mask).sum() / max(float(exemplar.mask.sum()), 1e-6))
    return np.clip(np.r_[rgb, alpha], 0, 1).astype(np.float64)


def _learn_texture(style, planned, features, xy, thickness, exemplar, seed, report) -> Style:
    xy, thickness = xy.double().cpu().numpy(), thickness.double().cpu().numpy()
    rows, offsets, kept = lifted(thickness, planned.offsets)
    if not len(kept):
        return style
    strokes = Strokes(xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool))
    report("texture", 0, 1, {})
    bank = learn_texture(strokes, features.double().cpu().numpy()[rows], exemplar, seed)
    report("texture", 1, 1, {})
    return replace(style, bank=bank)


def fit_sheet(view: View, exemplar: Exemplar, style: Style) -> np.ndarray:
    """Exemplar, its mask, the drawn mask and the drawing, side by side: (H, 4 W, 3) float32 in [0, 1]."""
    drawing = style.draw(view, seed=0)
    flat = replace(drawing, color=np.tile([0.0, 0.0, 0.0, 1.0], (len(drawing.strokes), 1)), texture=None)
    panels = [exemplar.rgb, np.repeat(1 - exemplar.mask[..., None], 3, axis=2), _on_white(flat), _on_white(drawing)]
    return np.concatenate(panels, axis=1).astype(np.float32)


def _on_white(drawing: Drawing) -> np.ndarray:
    return rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255.0


class _Reporter:
    """Calls the user's callback a few times a second, with a guess of the time left."""

    def __init__(self, callback, config: FitConfig):
        self.callback, self.config = callback, config
        self.start = self.last = time.monotonic()

    def __call__(self, stage: str, step: int, steps: int, losses: dict) -> None:
        if self.callback is None:
            return
        now = time.monotonic()
        if step < steps and now - self.last < 0.2:
            return
        self.last = now
        total = self.config.steps + self.config.trace_steps
        done = (
            step if stage == "strokes" else self.config.steps + (step if stage == "trace" else self.config.trace_steps)
        )
        left = (now - self.start) / done * (total - done) if done else None
        values = {name: float(torch.as_tensor(value).detach()) for name, value in losses.items()}
        self.callback(Progress(stage, step, steps, values, left))
