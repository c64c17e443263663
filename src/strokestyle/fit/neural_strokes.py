"""Train the paper's networks as it has them (Liu et al. 2021, sec. 4).

What its authors' code adds is in here too: multi-scale patches, two stages, and the way in which
the adversarial losses are counted.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ..extract.view import View
from ..geometry.curves import owner
from ..render.networks import PatchDiscriminator, PathNet, SurfaceNet, TextureNet
from ..render.neural_strokes import NeuralStrokesStyle, Paths, StrokeGeometry, view_maps
from .checkpoint import Checkpoint
from .config import NeuralStrokesConfig
from .exemplar import Exemplar
from .losses import blur, holds_stroke, lsgan_loss, smoothness_loss
from .patches import crop, cut_curves, patch_corners, patch_sizes, turned_patches
from .progress import Report, Reporter

if TYPE_CHECKING:
    from .checkpoint import Training

STEPS_SHARE = 0.95  # of a budget of time; the rest is for checkpoints and writing
TRIAL_SHARE = 0.05  # of a budget, after which larger patches are no longer timed but guessed
TRIAL_STEPS = 3  # that are timed, the first of which only warms up


@dataclass(frozen=True)
class Networks:
    """The networks of geometry and texture, and the discriminator that trains the texture."""

    geometry: StrokeGeometry
    texture: torch.nn.Module
    discriminator: PatchDiscriminator

    @classmethod
    def papers(cls) -> Networks:
        """Make the networks that the paper has."""
        return cls(StrokeGeometry(SurfaceNet(), PathNet()), TextureNet(), PatchDiscriminator())

    @classmethod
    def untrained(cls, make: Callable[[], Networks], seed: int, device: torch.device) -> Networks:
        """Make networks with the weights that training begins with.

        The same seed gives the same weights, whatever was drawn before.
        """
        with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
            torch.manual_seed(seed)
            made = make()
            for network in (made.geometry, made.texture, made.discriminator):
                initialise(network.to(device))
        return made


@dataclass(frozen=True)
class Exercise:
    """What the networks learn from, as tensors on one device. Images are white 1, stroke 0.

    Parameters
    ----------
    view : the shape as it was drawn
    maps : (1, 9, H, W), the surface network's input
    paths : the view's curves
    mask : (H, W), the artist's strokes
    rgb : (1, 3, H, W), the artist's drawing
    """

    view: View
    maps: Tensor
    paths: Paths
    mask: Tensor
    rgb: Tensor

    @classmethod
    def of(cls, view: View, exemplar: Exemplar, device: torch.device) -> Exercise:
        """Copy a view and its drawing to a device."""
        return cls(
            view,
            view_maps(view, device),
            Paths.of(view, device),
            torch.tensor(1.0 - exemplar.mask, device=device),
            torch.tensor(exemplar.rgb, device=device).permute(2, 0, 1)[None],
        )

    def drawn(self, networks: Networks) -> Tensor:
        """The strokes (H, W) that the geometry networks draw on the whole canvas."""
        with torch.no_grad():
            return networks.geometry.draw(self.maps, self.paths)[0][0]

    def cut(self, curve: np.ndarray, corners: np.ndarray, size: int) -> tuple[Tensor, Paths]:
        """Cut maps (B, 9, size, size) and curves at patches with corners (B, 2).

        `curve` (N,) says which curve each point belongs to.
        """
        runs = cut_curves(self.view.curves.xy, curve, corners, size)
        points = self.paths.points
        corner = torch.tensor(corners, dtype=points.dtype, device=points.device)
        pieces = Paths(
            points[runs.rows] - F.pad(corner[runs.patch], (0, 5)),
            torch.tensor(runs.offsets, device=points.device),
            torch.tensor(runs.patch, device=points.device),
        )
        return crop(self.maps[0], corners, size), pieces


def fit_neural_strokes(
    view: View,
    exemplar: Exemplar,
    config: NeuralStrokesConfig,
    seed: int,
    device: torch.device,
    report: Reporter,
    about: dict,
    checkpoint: Checkpoint,
    until: float | None = None,
) -> NeuralStrokesStyle:
    """Train the three networks on one drawing. Same seed, same machine, same weights.

    `until`, on the clock of time.monotonic(), shortens both stages alike, the fall of their rates
    with them. Raises ValueError where no patch of the view holds a stroke.
    """
    networks = Networks.untrained(Networks.papers, seed, device)
    train(networks, Exercise.of(view, exemplar, device), config, seed, report, checkpoint, until)
    return NeuralStrokesStyle(networks.geometry, networks.texture, about)


def train(
    networks: Networks,
    exercise: Exercise,
    config: NeuralStrokesConfig,
    seed: int,
    report: Reporter,
    checkpoint: Checkpoint,
    until: float | None = None,
) -> None:
    """Train networks in both stages. Arguments and errors as of `fit_neural_strokes`."""
    rng = np.random.default_rng(seed)

    def affordable() -> float:
        return config.schedule if until is None else _affordable(networks, exercise, config, until)

    config = replace(config, schedule=checkpoint.chosen("schedule", affordable))
    report.total = _steps_to_come(config, checkpoint)
    train_geometry(networks, exercise, config, rng, report, checkpoint)
    # the texture stage sees the geometry stage's own strokes, not the artist's mask (code)
    drawn = exercise.drawn(networks)
    train_texture(networks, exercise, drawn, config, rng, report, checkpoint)
    for network in (networks.geometry, networks.texture):
        network.eval()


# ------------------------------------------------------------------------------------------ budget


def _affordable(
    networks: Networks, exercise: Exercise, config: NeuralStrokesConfig, until: float
) -> float:
    """The share of the schedule that fits in the time until then, timed on copies."""

    def geometry(few: NeuralStrokesConfig, tick: Report) -> None:
        trial, rng = copy.deepcopy(networks), np.random.default_rng(0)
        train_geometry(trial, exercise, few, rng, tick, Checkpoint())

    def texture(few: NeuralStrokesConfig, tick: Report) -> None:
        trial, rng = copy.deepcopy(networks), np.random.default_rng(0)
        train_texture(trial, exercise, exercise.mask, few, rng, tick, Checkpoint())

    allowed = TRIAL_SHARE * (until - time.monotonic())
    sizes = patch_sizes(exercise.view, config.patches)
    needed = sum(
        steps * _seconds_a_step(train, sizes, config, exercise.maps.device, allowed)
        for steps, train in ((config.geometry_steps, geometry), (config.texture_steps, texture))
    )
    return min(config.schedule, max(0.0, STEPS_SHARE * (until - time.monotonic()) / needed))


def _seconds_a_step(
    train: Callable[[NeuralStrokesConfig, Report], None],
    sizes: list[int],
    config: NeuralStrokesConfig,
    device: torch.device,
    allowed: float,
) -> float:
    """Mean over the patch sizes of one step's time; after `allowed` seconds it is guessed."""
    start = time.monotonic()
    each: list[float] = []
    for i, size in enumerate(sizes):
        if each and time.monotonic() - start > allowed:
            each.append(each[-1] * (size / sizes[i - 1]) ** 2)
            continue
        clock: list[float] = []

        def tick(*_: object, clock: list[float] = clock) -> None:
            if device.type == "cuda":
                torch.cuda.synchronize(device)
            clock.append(time.monotonic())

        few = replace(config, patches=(size,), schedule=1.0)
        train(replace(few, geometry_steps=TRIAL_STEPS, texture_steps=TRIAL_STEPS), tick)
        each.append((clock[-1] - clock[0]) / (len(clock) - 1))
    return float(np.mean(each))


def _steps_to_come(config: NeuralStrokesConfig, checkpoint: Checkpoint) -> int:
    """The steps of the stages that are not over: those that are report nothing."""
    total = 0
    for stage, steps in (("geometry", config.geometry_steps), ("texture", config.texture_steps)):
        done = (checkpoint.load(stage) or {"step": 0})["step"]
        shortened = max(1, round(steps * config.schedule))
        total += shortened if done < shortened else 0
    return total


# ---------------------------------------------------------------------------------------- geometry


def train_geometry(
    networks: Networks,
    exercise: Exercise,
    config: NeuralStrokesConfig,
    rng: np.random.Generator,
    report: Report,
    checkpoint: Checkpoint,
) -> None:
    """Train the networks of geometry by L_b + lambda_s L_s (eqs. 2 and 3)."""
    geometry = networks.geometry
    optimiser = torch.optim.Adam(geometry.parameters(), config.rate, betas=(0.0, 0.99))
    steps, schedule = falling_rate(
        optimiser, config.geometry_steps, config.geometry_decay, config.schedule
    )
    places = PatchSampler.of(exercise.view, config)
    curve = owner(exercise.view.curves.offsets)
    learned = dict(geometry.named_children())
    training: dict[str, Training] = {"optimiser": optimiser, "schedule": schedule}
    with checkpoint.watch("geometry", steps, learned, training, rng) as (remaining, passed):
        for step in remaining:
            size, corners = places.draw(rng, config.batch)
            maps, pieces = exercise.cut(curve, corners, size)
            drawn, displacement = geometry.draw(maps, pieces)
            loss_mask = F.l1_loss(drawn, crop(exercise.mask[None], corners, size)[:, 0])
            loss_smooth = smoothness_loss(displacement, pieces.offsets)
            loss = loss_mask + config.smoothness * loss_smooth
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            schedule.step()
            passed()
            losses = {"mask": loss_mask.detach(), "smooth": loss_smooth.detach()}
            report("geometry", step, steps, losses)


# ----------------------------------------------------------------------------------------- texture


class TexturePatches(NamedTuple):
    """Patches of a batch, turned by random angles; two lots, from different places.

    shown : (B, 9, size, size), what the texture network sees
    wanted : (B, 3, size, size), the artist's drawing there
    real : (B, 3, size, size), the artist's drawing elsewhere, for the discriminator
    """

    shown: Tensor
    wanted: Tensor
    real: Tensor


def _texture_patches(
    images: Tensor, places: PatchSampler, batch: int, rng: np.random.Generator
) -> TexturePatches:
    """Draw patches of `images` (1, 9 + 3, H, W): the texture network's input, and the drawing."""
    size, corners = places.draw(rng, 2 * batch)
    turned = turned_patches(images, corners, size, rng.uniform(0, 2 * np.pi, len(corners)))
    inputs = images.shape[1] - 3
    return TexturePatches(turned[:batch, :inputs], turned[:batch, inputs:], turned[batch:, inputs:])


def train_texture(
    networks: Networks,
    exercise: Exercise,
    drawn: Tensor,
    config: NeuralStrokesConfig,
    rng: np.random.Generator,
    report: Report,
    checkpoint: Checkpoint,
) -> None:
    """Train the texture network by L_t + lambda_a L_a (eqs. 4 and 5), an LSGAN.

    `drawn` (H, W) are the strokes that it is to paint.
    """
    texture, discriminator = networks.texture, networks.discriminator
    opt_g = torch.optim.Adam(texture.parameters(), config.rate, betas=(0.5, 0.999))
    opt_d = torch.optim.Adam(discriminator.parameters(), config.rate, betas=(0.5, 0.999))
    decay = config.texture_steps, config.texture_decay, config.schedule
    steps, schedule_g = falling_rate(opt_g, *decay)
    _, schedule_d = falling_rate(opt_d, *decay)
    places = PatchSampler.of(exercise.view, config)
    images = torch.cat([exercise.maps[:, :-1], drawn[None, None], exercise.rgb], dim=1)
    learned = {"texture": texture, "discriminator": discriminator}
    training: dict[str, Training] = {
        "opt_g": opt_g,
        "opt_d": opt_d,
        "schedule_g": schedule_g,
        "schedule_d": schedule_d,
    }
    with checkpoint.watch("texture", steps, learned, training, rng) as (remaining, passed):
        for step in remaining:
            patches = _texture_patches(images, places, config.batch, rng)
            fake = texture(patches.shown)
            judged = holds_stroke(patches.shown[:, -1])
            loss_d = _discriminator_loss(discriminator, fake, patches.real, judged)
            opt_d.zero_grad(set_to_none=True)
            loss_d.backward()
            opt_d.step()
            loss_color = F.l1_loss(fake, patches.wanted)
            loss_blurred = F.l1_loss(blur(fake), blur(patches.wanted))
            loss_g_adv = lsgan_loss(discriminator(fake), 1.0, judged)
            loss_g = config.color * loss_color + config.blurred * loss_blurred
            loss_g = loss_g + config.adversarial * loss_g_adv
            opt_g.zero_grad(set_to_none=True)
            loss_g.backward()
            opt_g.step()
            schedule_g.step()
            schedule_d.step()
            passed()
            losses = {
                "color": loss_color.detach(),
                "loss_g_adv": loss_g_adv.detach(),
                "loss_d": loss_d.detach(),
            }
            report("texture", step, steps, losses)


def _discriminator_loss(
    discriminator: PatchDiscriminator, fake: Tensor, real: Tensor, judged: Tensor
) -> Tensor:
    """Half of what LSGAN asks of the discriminator: 0 for what is made, 1 for what is drawn."""
    judged_real = holds_stroke(real.min(dim=1).values)
    loss_fake = lsgan_loss(discriminator(fake.detach()), 0.0, judged)
    return 0.5 * (loss_fake + lsgan_loss(discriminator(real), 1.0, judged_real))


# ------------------------------------------------------------------------------------------- parts


@dataclass(frozen=True)
class PatchSampler:
    """Draws a size, and corners of that size; corners (P, 2) by size, px."""

    corners: dict[int, np.ndarray]

    @classmethod
    def of(cls, view: View, config: NeuralStrokesConfig) -> PatchSampler:
        """Find all places of a view. Raises ValueError where there are none of some size."""
        sizes = patch_sizes(view, config.patches)
        return cls({size: patch_corners(view, size) for size in sizes})

    def draw(self, rng: np.random.Generator, count: int) -> tuple[int, np.ndarray]:
        """Draw a size, px, and `count` corners (count, 2)."""
        size = int(rng.choice(list(self.corners)))
        places = self.corners[size]
        return size, places[rng.integers(len(places), size=count)]


def falling_rate(
    optimiser: torch.optim.Optimizer, steps: int, decay: int, share: float
) -> tuple[int, torch.optim.lr_scheduler.LambdaLR]:
    """All steps to run, and a rate that is constant but for the last `decay`, where it falls to 0.

    Both are shortened to a `share`.
    """
    steps, decay = max(1, round(steps * share)), max(1, round(decay * share))
    return steps, torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda step: min(1.0, (steps - step) / decay)
    )


def initialise(network: torch.nn.Module) -> None:
    """Set normal weights of deviation 0.02 and no bias.

    The image-translation networks that the paper builds on start so (Isola et al. 2017).
    """
    for layer in network.modules():
        if isinstance(layer, (torch.nn.Conv2d, torch.nn.ConvTranspose2d)):
            torch.nn.init.normal_(layer.weight, 0.0, 0.02)
            if layer.bias is not None:
                torch.nn.init.zeros_(layer.bias)
