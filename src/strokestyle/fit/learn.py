"""Learn displacement, thickness and residuals from one drawing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor
from torch.nn import functional as F

from ..drawing.strokes import Strokes
from ..extract.view import View
from ..render.config import HAIR, StyleConfig
from ..render.devices import pick_device
from ..render.displacement import Frame, displaced
from ..render.features import plan, point_features, surface_at
from ..render.networks import AdditiveNet
from ..render.plan import Planned
from ..render.residuals import Residuals
from ..render.style import Style, SumOfCurves
from .checkpoint import Checkpoint
from .config import FitConfig
from .exemplar import Exemplar
from .observe import Observation, measure_across, sample_image
from .progress import Reporter
from .texture import learn_texture
from .trace import MaskPyramid, Traced, affordable_steps, optimise_strokes, tensors

STRAY_SIGMAS = (
    7.0,
    14.0,
)  # px; straying across and in thickness is kept where it is faster than these Gaussians


def fit_quick(
    view: View,
    exemplar: Exemplar,
    config: FitConfig,
    seed: int = 0,
    device: torch.device | None = None,
    report: Reporter | None = None,
    checkpoint: Checkpoint | None = None,
    until: float | None = None,
) -> tuple[Style, Strokes]:
    """The style of a drawing, and the drawing's own strokes as they were traced; `fit` says what the arguments mean."""
    device, report, checkpoint = (
        device or pick_device("cpu"),
        report or Reporter(None, 1),
        checkpoint or Checkpoint(),
    )
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
    guess = measure_across(exemplar.mask, planned, frame)
    moves = learn_displacement(frame, guess)
    network = learn_thickness(features, guess, config, style_config, seed, report)
    target = MaskPyramid.of(exemplar.mask, planned.xy, config.levels, device)
    with torch.no_grad():
        meant, swell = displaced(frame, moves), network(features)
        swell[~frame.within] = float(
            np.log(HAIR)
        )  # strokes may grow past their ends, where the drawing has it

    def affordable() -> int:
        return (
            config.trace_steps
            if until is None
            else affordable_steps(frame, meant, swell, target, config, until)
        )

    config = replace(config, trace_steps=checkpoint.chosen("trace_steps", affordable))
    report.total = 2 * config.steps + config.trace_steps
    traced = optimise_strokes(frame, meant, swell, target, config, report, checkpoint)
    found, sure = traced.guess(frame, guess, sample_image(exemplar.mask, planned.xy))
    moves = learn_displacement(frame, found)
    network = learn_thickness(features, found, config, style_config, seed, report)
    with torch.no_grad():
        hand = _residuals(
            frame,
            planned,
            traced,
            sure,
            displaced(frame, moves),
            network(features),
            config.stray,
            style_config.spacing,
        )
    style = Style(
        config=style_config,
        network=SumOfCurves(
            **{name: value.cpu().numpy() for name, value in network.state_dict().items()}
        ),
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


def learn_displacement(frame: Frame, guess: Observation, ridge: float = 1e-2) -> Tensor:
    """How much of each of MOVES explains the offsets best: least squares, what strays far counting less."""
    moved = (frame.moves * frame.across[:, None]).sum(2).double().cpu().numpy()  # (N, M)
    scale = np.maximum(np.sqrt((moved**2).mean(axis=0)), 0.3)
    design, weight, answer = moved / scale, guess.trust, np.zeros(moved.shape[1])
    for _ in range(20):
        w = guess.trust / np.maximum(np.abs(design @ answer - guess.offset), 0.5)
        normal = (design * w[:, None]).T @ design + ridge * max(weight.sum(), 1.0) * np.eye(
            len(answer)
        )
        answer = np.linalg.solve(normal, (design * w[:, None]).T @ guess.offset)
    return torch.tensor(answer / scale, dtype=torch.float32, device=frame.xy.device)


def learn_thickness(
    features: Tensor,
    guess: Observation,
    config: FitConfig,
    style: StyleConfig,
    seed: int,
    report: Reporter,
) -> AdditiveNet:
    """The sparse sum of curves that explains the thickness best."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = AdditiveNet(features.shape[1], style.hidden)
    trust = features.new_tensor(guess.trust)
    swell = features.new_tensor(np.log(np.maximum(guess.thickness, 0.0) + HAIR))
    known = float(trust.sum())
    network = network.to(features.device)
    network.base.data = (
        (trust * swell).sum() / known if known > 0 else features.new_tensor(np.log(3.0))
    )
    optimiser = torch.optim.Adam(network.parameters(), lr=config.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, config.rate, total_steps=config.steps, pct_start=0.2
    )
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


def _residuals(
    frame: Frame,
    planned: Planned,
    traced: Traced,
    sure: np.ndarray,
    meant: Tensor,
    swell: Tensor,
    amount: float,
    spacing: float,
) -> Residuals | None:
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
                piece[:, k] -= ndimage.gaussian_filter1d(
                    piece[:, k], sigma / spacing, mode="nearest"
                )
            pieces.append(piece)
    if amount == 0 or not pieces:
        return None
    return Residuals(
        np.concatenate(pieces).astype(np.float32), np.r_[0, np.cumsum([len(p) for p in pieces])]
    )


def _flat_ink(exemplar: Exemplar) -> np.ndarray:
    """The ink of a flat drawing: mean colour and opacity where the mask holds ink."""
    weight = exemplar.mask * exemplar.alpha
    total = max(float(weight.sum()), 1e-6)
    rgb = (exemplar.ink * weight[..., None]).sum(axis=(0, 1)) / total
    alpha = float((exemplar.alpha * exemplar.mask).sum() / max(float(exemplar.mask.sum()), 1e-6))
    return np.clip(np.r_[rgb, alpha], 0, 1).astype(np.float64)
