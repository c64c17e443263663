"""Learning a style: (view, exemplar) -> Style.

quick and standard: a small network along the strokes, trained on the whole view through the rasteriser; then the
strokes of the drawing itself are traced from there, point by point, which shows how the hand strays and gives the
texture strokes that lie where the ink does. paper: the paper's own training, in paper_fit.py.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor
from torch.nn import functional as F

from .. import __version__
from ..drawing.raster import rasterise
from ..drawing.strokes import Drawing, Strokes
from ..extract.view import View
from ..render.coverage import coverage
from ..render.devices import pick_device, repeatable
from ..render.networks import AdditiveNet
from ..render.neural_strokes import PaperStyle
from ..render.plan import Planned
from ..render.style import (
    HAIR,
    Frame,
    Hand,
    Style,
    StyleConfig,
    SumOfCurves,
    lifted,
    place,
    plan,
    point_features,
    surface_at,
)
from ..render.texture_bank import learn_texture
from .checkpoint import Checkpoint, digest
from .exemplar import Exemplar
from .neural_strokes import PaperConfig, fit_paper

STRAY_SIGMAS = (7.0, 14.0)  # px; straying across and in thickness is kept where it is faster than these Gaussians


@dataclass(frozen=True)
class FitConfig:
    """How to learn. Where no source is named, a value was measured on drawings of shapes of the project's own.

    Parameters
    ----------
    preset : its name, kept in the model
    steps : Adam steps of the thickness curves
    rate, sparsity : their learning rate, one-cycle, and the weight of their group lasso
    trace_steps : Adam steps of the strokes' own points, through the rasteriser
    levels : sizes at which mask and strokes are compared by L1: 1, 6, 12 ... px (DESIGN.md: 1, 5, 11)
    roughness : weight of the traced strokes' squared second differences
    stray : how much of the hand's straying to draw with, 0 = none
    """

    preset: str
    steps: int = 150
    rate: float = 0.02
    sparsity: float = 0.04
    trace_steps: int = 120
    levels: int = 3
    roughness: float = 0.1
    stray: float = 1.0
    texture: bool = True
    style: StyleConfig = field(default_factory=StyleConfig)


# The fewest and the most that a budget of time buys. More are of no use: 100, 300 and 1000 steps drew other shapes
# alike (90.8, 90.7 and 90.6 % of an artist's repeatability), as did more steps, seeds or bootstraps of the
# thickness curves.
TRACE_STEPS = 40, 600
TRACED = 0.8  # of what is left of a budget goes into them; thickness and texture are still to come
BETWEEN = 0.2  # s, two calls of the progress callback


PRESETS = {
    "quick": FitConfig("quick", trace_steps=100),
    "standard": FitConfig("standard", steps=300, trace_steps=300),
    "paper": PaperConfig(),
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
    config: FitConfig | PaperConfig = PRESETS["standard"],
    *,
    seed: int = 0,
    device: str = "auto",
    progress: Callable[[Progress], None] | None = None,
    source: str = "",
    checkpoint: Checkpoint | None = None,
    minutes: float | None = None,
) -> Style | PaperStyle:
    """Learn the style of one drawing.

    Parameters
    ----------
    view : the shape as it was drawn
    exemplar : the drawing, at the view's size
    config : one of PRESETS, or a change of it
    seed : same seed, same style, bit for bit on one machine (the paper's networks on a GPU: but for rounding)
    device : "auto", "cpu" or "cuda"
    progress : called now and then
    source : the drawing's name, kept in the model
    checkpoint : where to keep the state of the fit, and whether to go on from it; the caller removes it afterwards
    minutes : choose as many steps as this machine can do in that time, so that the result depends on its speed; where
        a checkpoint is gone on from, what was chosen then holds

    Raises
    ------
    ValueError
        where drawing and view differ in size, or there are no strokes to learn from, or the checkpoint is damaged or
        that of another fit.
    KeyboardInterrupt
        on Ctrl-C, after the checkpoint is written.
    """
    until = None if minutes is None else time.monotonic() + 60.0 * minutes
    size = (view.camera.height, view.camera.width)
    if exemplar.mask.shape != size:
        raise ValueError(f"the drawing is {exemplar.mask.shape[::-1]} px, the view {size[::-1]}: resample the drawing")
    if exemplar.mask.max() < 0.5:
        raise ValueError("no strokes in this drawing: nothing to learn from")
    about = {"strokestyle": __version__, "preset": config.preset, "seed": seed, "exemplar": source}
    device = pick_device(device)
    checkpoint = checkpoint or Checkpoint()
    checkpoint.begin(_key(view, exemplar, config, seed))
    if isinstance(config, PaperConfig):
        report = _Reporter(progress, config.geometry_steps + config.texture_steps)
        return fit_paper(view, exemplar, config, seed, device, report, about, checkpoint, until)
    report = _Reporter(progress, 2 * config.steps + config.trace_steps)
    with repeatable(device):
        style, _ = learn(view, exemplar, config, seed, device, report, checkpoint, until)
    return replace(style, about=about)


def learn(
    view: View,
    exemplar: Exemplar,
    config: FitConfig,
    seed: int = 0,
    device: torch.device | None = None,
    report: _Reporter | None = None,
    checkpoint: Checkpoint | None = None,
    until: float | None = None,
) -> tuple[Style, Strokes]:
    """The style of a drawing, and the drawing's own strokes as they were traced; `fit` says what the arguments mean."""
    device, report, checkpoint = device or pick_device("cpu"), report or _Reporter(None, 1), checkpoint or Checkpoint()
    style_config = replace(config.style, size=max(exemplar.mask.shape))
    planned = plan(view, style_config)
    if not len(planned):
        raise ValueError("no curves in this view are long enough to draw: nothing to learn from")
    surface = planned.carry(surface_at(view, style_config.spacing))
    raw = point_features(planned, surface, style_config)
    low, high = np.percentile(raw, [0.5, 99.5], axis=0)
    clipped = np.clip(raw, low, high)
    centre, spread = clipped.mean(axis=0), np.maximum(clipped.std(axis=0), 1e-3)
    features = torch.tensor((clipped - centre) / spread, dtype=torch.float32, device=device)
    frame = tensors(Frame.of(planned, surface, style_config.spacing), device)
    guess = measure(exemplar.mask, planned, frame)
    moves = learn_moves(frame, guess)
    network = learn_thickness(features, guess, config, style_config, seed, report)
    target = Target.of(exemplar.mask, planned.xy, config.levels, device)
    with torch.no_grad():
        meant, swell = place(frame, moves), network(features)
        swell[~frame.within] = float(np.log(HAIR))  # strokes may grow past their ends, where the drawing has it

    def affordable() -> int:
        return config.trace_steps if until is None else trace_steps(frame, meant, swell, target, config, until)

    config = replace(config, trace_steps=checkpoint.chosen("trace_steps", affordable))
    report.total = 2 * config.steps + config.trace_steps
    traced = trace(frame, meant, swell, target, config, report, checkpoint)
    found, sure = traced.guess(frame, guess, sample(exemplar.mask, planned.xy))
    moves = learn_moves(frame, found)
    network = learn_thickness(features, found, config, style_config, seed, report)
    with torch.no_grad():
        hand = _hand(
            frame, planned, traced, sure, place(frame, moves), network(features), config.stray, style_config.spacing
        )
    style = Style(
        config=style_config,
        network=SumOfCurves(**{name: value.cpu().numpy() for name, value in network.state_dict().items()}),
        moves=moves.cpu().numpy(),
        centre=centre,
        spread=spread,
        low=low,
        high=high,
        hand=hand,
        color=_flat_ink(exemplar),
    )
    strokes, rows = traced.strokes(planned)
    if config.texture and len(strokes):
        report("texture", 0, 1, {})
        bank = learn_texture(strokes, features.double().cpu().numpy()[rows], exemplar, seed)
        report("texture", 1, 1, {})
        style = replace(style, bank=bank)
    return style, strokes


def tensors(frame: Frame, device: torch.device) -> Frame:
    """The same frame as tensors, real numbers in float32."""
    arrays = {f.name: torch.as_tensor(getattr(frame, f.name), device=device) for f in fields(frame)}
    return Frame(**{name: a.float() if a.is_floating_point() else a for name, a in arrays.items()})


def thickness_of(swell: Tensor) -> Tensor:
    """log(thickness + HAIR) -> px. It may fall below 0, which `coverage` takes for 0 with a gradient."""
    return torch.exp(swell) - HAIR


@dataclass(frozen=True)
class Guess:
    """Where the drawing has each point of the strokes.

    offset (N,) px along the normal, thickness (N,) px, trust (N,) in [0, 1], 0 = not known
    """

    offset: np.ndarray
    thickness: np.ndarray
    trust: np.ndarray


def measure(mask: np.ndarray, planned: Planned, frame: Frame, reach: float = 16.0) -> Guess:
    """Look across every point, along the normal, for the nearest run of stroke: right but where lines crowd."""
    q = np.arange(-2 * reach, 2 * reach + 0.25, 0.5)
    normal = frame.across.double().cpu().numpy()
    at = planned.xy[:, None] + q[None, :, None] * normal[:, None]
    profile = sample(mask, at)
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
    trust = ends_seen & (nearest < reach) & (np.abs(offset) < reach) & (planned.beyond == 0)
    found = thickness[trust]
    if len(found):  # a run far wider than its like is another stroke seen lengthwise
        trust &= thickness < 2.5 * np.quantile(found, 0.9)
    return Guess(offset, thickness, trust / (1.0 + (offset / 6.0) ** 2))


def sample(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Bilinear values of an image (H, W) at pixels (..., 2); 0 outside."""
    return ndimage.map_coordinates(image, [xy[..., 1] - 0.5, xy[..., 0] - 0.5], order=1, mode="constant")


def learn_moves(frame: Frame, guess: Guess, ridge: float = 1e-2) -> Tensor:
    """How much of each of MOVES explains the offsets best: least squares, what strays far counting less."""
    moved = (frame.moves * frame.across[:, None]).sum(2).double().cpu().numpy()  # (N, M)
    scale = np.maximum(np.sqrt((moved**2).mean(axis=0)), 0.3)
    design, weight, answer = moved / scale, guess.trust, np.zeros(moved.shape[1])
    for _ in range(20):
        w = guess.trust / np.maximum(np.abs(design @ answer - guess.offset), 0.5)
        normal = (design * w[:, None]).T @ design + ridge * max(weight.sum(), 1.0) * np.eye(len(answer))
        answer = np.linalg.solve(normal, (design * w[:, None]).T @ guess.offset)
    return torch.tensor(answer / scale, dtype=torch.float32, device=frame.xy.device)


def learn_thickness(
    features: Tensor, guess: Guess, config: FitConfig, style: StyleConfig, seed: int, report: _Reporter
) -> AdditiveNet:
    """The sparse sum of curves that explains the thickness best."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = AdditiveNet(features.shape[1], style.hidden)
    trust = features.new_tensor(guess.trust)
    swell = features.new_tensor(np.log(np.maximum(guess.thickness, 0.0) + HAIR))
    known = float(trust.sum())
    network = network.to(features.device)
    network.base.data = (trust * swell).sum() / known if known > 0 else features.new_tensor(np.log(3.0))
    optimiser = torch.optim.Adam(network.parameters(), lr=config.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, config.rate, total_steps=config.steps, pct_start=0.2)
    for step in range(config.steps):
        optimiser.zero_grad(set_to_none=True)
        error = F.smooth_l1_loss(network(features), swell, reduction="none", beta=0.2)
        error = (trust * error).sum() / max(known, 1.0)
        loss = error + config.sparsity * network.penalty() + 1e-3 * network.weight.square().sum()
        loss.backward()
        optimiser.step()
        schedule.step()
        report("thickness", step + 1, config.steps, {"error": error})
    return network


@dataclass(frozen=True)
class Target:
    """The mask that strokes are to fill, cropped to where strokes can be, as a pyramid.

    corner (2,) x, y of the crop; masks and weights, per level, (1, 1, h, w); weights have mean 1 over the mask
    """

    corner: Tensor
    masks: tuple[Tensor, ...]
    weights: tuple[Tensor, ...]
    levels: int

    @classmethod
    def of(cls, mask: np.ndarray, xy: np.ndarray, levels: int, device) -> Target:
        height, width = mask.shape
        room = 32
        x0, y0 = np.maximum(np.floor(xy.min(axis=0)).astype(int) - room, 0)
        x1, y1 = np.ceil(xy.max(axis=0)).astype(int) + room
        crop = torch.tensor(mask[y0 : min(y1, height), x0 : min(x1, width)], dtype=torch.float32, device=device)
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
        rows, offsets, kept = lifted(thickness, planned.offsets)
        return Strokes(xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool)), rows

    def guess(self, frame: Frame, measured: Guess, mask_here: np.ndarray) -> tuple[Guess, np.ndarray]:
        """These strokes as a guess, and where (N,) they are sure: seen alike from across and through the rasteriser."""
        offset = ((self.xy - frame.xy) * frame.across).sum(1).double().cpu().numpy()
        thickness = self.thickness.double().cpu().numpy()
        ratio = np.log((thickness + HAIR) / (np.maximum(measured.thickness, 0) + HAIR))
        # past an end: not sure only where another stroke's ink may hide it
        past = ~frame.within.cpu().numpy()
        told = past & ((mask_here < 0.5) | (thickness > 1.0))
        sure = (measured.trust > 0) & (np.abs(ratio) < 0.2) & (np.abs(offset - measured.offset) < 1.5)
        return Guess(offset, thickness, np.where(past, np.where(told, 0.7, 0.05), np.where(sure, 1.0, 0.2))), sure


def trace(
    frame: Frame,
    meant: Tensor,
    swell: Tensor,
    target: Target,
    config: FitConfig,
    report: _Reporter,
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

    learned, training = {"across": across, "change": change}, {"optimiser": optimiser, "schedule": schedule}
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


def trace_steps(frame: Frame, meant: Tensor, swell: Tensor, target: Target, config: FitConfig, until: float) -> int:
    """How many steps of `trace` fit in the time until then, on the clock of time.monotonic(), with what follows."""
    clock = []

    def tick(*_) -> None:
        if swell.device.type == "cuda":
            torch.cuda.synchronize(swell.device)
        clock.append(time.monotonic())

    trace(frame, meant, swell, target, replace(config, trace_steps=6), tick, Checkpoint())
    each = (clock[-1] - clock[0]) / (len(clock) - 1)  # the first step also warms up
    return int(np.clip(TRACED * (until - clock[-1]) / each, *TRACE_STEPS))


def _neighbours(offsets: Tensor) -> Tensor:
    """(N-1,) bool: rows i and i + 1 lie on the same stroke."""
    same = torch.ones(int(offsets[-1]) - 1, dtype=torch.bool, device=offsets.device)
    same[offsets[1:-1] - 1] = False
    return same


def _hand(
    frame: Frame,
    planned: Planned,
    traced: Traced,
    sure: np.ndarray,
    meant: Tensor,
    swell: Tensor,
    amount: float,
    spacing: float,
) -> Hand | None:
    """What the traced strokes do that the style did not mean, within the curves; bridged where they are not sure."""
    across = ((traced.xy - meant) * frame.across).sum(1)
    stray = amount * torch.stack([across, traced.swell - swell], dim=1).double().cpu().numpy()
    pieces = []
    for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
        inner = np.flatnonzero(planned.beyond[a:b] == 0) + a
        known = inner[sure[inner]]
        if len(known) >= max(4, 0.4 * len(inner)):
            inner = inner[(inner >= known[0]) & (inner <= known[-1])]
            piece = np.stack([np.interp(inner, known, stray[known, k]) for k in (0, 1)], axis=1)
            # slow straying cannot be told from what this style failed to learn, and would only spoil the shape
            for k, sigma in enumerate(STRAY_SIGMAS):
                piece[:, k] -= ndimage.gaussian_filter1d(piece[:, k], sigma / spacing, mode="nearest")
            pieces.append(piece)
    if amount == 0 or not pieces:
        return None
    return Hand(np.concatenate(pieces).astype(np.float32), np.r_[0, np.cumsum([len(p) for p in pieces])])


def _flat_ink(exemplar: Exemplar) -> np.ndarray:
    """The ink of a flat drawing: mean colour and opacity where the mask holds ink."""
    weight = exemplar.mask * exemplar.alpha
    total = max(float(weight.sum()), 1e-6)
    rgb = (exemplar.ink * weight[..., None]).sum(axis=(0, 1)) / total
    alpha = float((exemplar.alpha * exemplar.mask).sum() / max(float(exemplar.mask.sum()), 1e-6))
    return np.clip(np.r_[rgb, alpha], 0, 1).astype(np.float64)


def fit_sheet(view: View, exemplar: Exemplar, style: Style | PaperStyle) -> np.ndarray:
    """Exemplar, its mask, the drawn mask and the drawing, side by side: (H, 4 W, 3) float32 in [0, 1]."""
    drawing = style.draw(view, seed=0)
    flat = replace(drawing, color=np.tile([0.0, 0.0, 0.0, 1.0], (len(drawing.strokes), 1)), texture=None)
    panels = [exemplar.rgb, np.repeat(1 - exemplar.mask[..., None], 3, axis=2), _on_white(flat), _on_white(drawing)]
    return np.concatenate(panels, axis=1).astype(np.float32)


def _on_white(drawing: Drawing) -> np.ndarray:
    return rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255.0


def _key(view: View, exemplar: Exemplar, config: FitConfig | PaperConfig, seed: int) -> dict[str, str]:
    """What a checkpoint must have in common with a fit that is to go on from it."""
    curves, maps = view.curves, view.maps
    return {
        "strokestyle": __version__,
        "preset": config.preset,
        "seed": str(seed),
        "drawing": digest(exemplar.rgb, exemplar.alpha, exemplar.ink, exemplar.mask),
        "shape, view or lines": digest(
            *(curves.xy, curves.offsets, curves.kind, curves.closed, maps.values, maps.covered, maps.scale)
        ),
        "setting of the preset": repr(config),
    }


class _Reporter:
    """Calls the user's callback a few times a second, with a guess of the time left."""

    def __init__(self, callback, total: int):
        self.callback, self.total = callback, total
        self.start = self.last = time.monotonic()
        self.passed, self.stage = 0, ""

    def __call__(self, stage: str, step: int, steps: int, losses: dict) -> None:
        if self.callback is None:
            return
        if stage != self.stage and step > 1:  # the first steps were done before an interruption
            self.passed, self.total = self.passed - (step - 1), self.total - (step - 1)
        self.stage = stage
        now = time.monotonic()
        if step < steps and now - self.last < BETWEEN:
            return
        self.last = now
        if step >= steps:
            self.passed += steps
        done = self.passed + (step if step < steps else 0)
        left = (now - self.start) / done * max(self.total - done, 0) if done else None
        values = {name: float(torch.as_tensor(value).detach()) for name, value in losses.items()}
        self.callback(Progress(stage, step, steps, values, left))
