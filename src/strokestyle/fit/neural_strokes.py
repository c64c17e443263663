"""Training as the paper has it (sec. 4), with what its authors' code adds: multi-scale patches, two stages, a GAN."""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ..extract.view import View
from ..geometry.curves import owner
from ..render.coverage import coverage
from ..render.networks import PatchDiscriminator, PathNet, SurfaceNet, TextureNet
from ..render.neural_strokes import (
    NeuralStrokesStyle,
    curve_features,
    padded,
    stroke_geometry,
    view_maps,
)
from .checkpoint import Checkpoint
from .exemplar import Exemplar
from .progress import Reporter

SPENT = 0.95  # of a budget goes into steps; the rest is for what they are not: checkpoints, writing
CENTRE = 30 / 64  # of a patch's side: where it must hold a stroke pixel (the code)
JUDGED = 36  # px: patches with no stroke in this centre do not count in the adversarial losses (the code)


@dataclass(frozen=True)
class NeuralStrokesConfig:
    """The paper's schedule; what its text leaves open is from its authors' code.

    Parameters
    ----------
    patches : px, one size a batch (paper, sec. 4)
    batch : patches (paper)
    rate : Adam's learning rate (paper)
    geometry_steps, geometry_decay : iterations, and how many of them, the last, let the rate fall to 0 (code)
    texture_steps, texture_decay : the same for the texture (code)
    smoothness, color, blurred, adversarial : weights of L_s, L_t (paper), of L_t after a blur (code), and L_a (paper)
    schedule : share of all the steps that is run, so that it can be tried on a small machine
    """

    preset: str = "paper"
    patches: tuple[int, ...] = (64, 128, 192, 256)
    batch: int = 16
    rate: float = 2e-4
    geometry_steps: int = 90 * 500
    geometry_decay: int = 30 * 500
    texture_steps: int = 20 * 3125
    texture_decay: int = 10 * 3125
    smoothness: float = 0.02
    color: float = 1.0
    blurred: float = 1.0
    adversarial: float = 1.0
    schedule: float = 1.0


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

    `until`, on the clock of time.monotonic(), shortens both stages alike, the fall of their rates with them.
    Raises ValueError where no patch of the view holds a stroke.
    """
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(seed)
        surface, path, texture = (
            SurfaceNet().to(device),
            PathNet().to(device),
            TextureNet().to(device),
        )
        judge = PatchDiscriminator().to(device)
        for network in (surface, path, texture, judge):
            _initialise(network)
    rng = np.random.default_rng(seed)
    maps, points = view_maps(view, device), curve_features(view, device)
    offsets = torch.tensor(view.curves.offsets, device=device)
    mask = torch.tensor(1.0 - exemplar.mask, device=device)
    rgb = torch.tensor(exemplar.rgb, device=device).permute(2, 0, 1)[None]

    def geometry(surface, path, config, rng, report, checkpoint) -> None:
        _train_geometry(surface, path, maps, points, view, mask, config, rng, report, checkpoint)

    def textured(texture, judge, drawn, config, rng, report, checkpoint) -> None:
        # the texture stage sees the geometry stage's own strokes, not the artist's mask (code)
        shown = torch.cat([maps[:, :-1], drawn[None, None]], dim=1)
        _train_texture(texture, judge, shown, rgb, view, config, rng, report, checkpoint)

    def affordable() -> float:
        if until is None:
            return config.schedule
        trials = (
            (
                config.geometry_steps,
                lambda *rest: geometry(copy.deepcopy(surface), copy.deepcopy(path), *rest),
            ),
            (
                config.texture_steps,
                lambda *rest: textured(copy.deepcopy(texture), copy.deepcopy(judge), mask, *rest),
            ),
        )
        start = time.monotonic()
        needed = sum(
            steps * _seconds_a_step(train, view, config, device, 0.05 * (until - start))
            for steps, train in trials
        )
        return min(config.schedule, max(0.0, SPENT * (until - time.monotonic()) / needed))

    config = replace(config, schedule=checkpoint.chosen("schedule", affordable))
    stages = {"geometry": config.geometry_steps, "texture": config.texture_steps}
    known = {name: (checkpoint.load(name) or {"step": 0})["step"] for name in stages}
    every = {name: max(1, round(steps * config.schedule)) for name, steps in stages.items()}
    report.total = sum(
        steps for name, steps in every.items() if known[name] < steps
    )  # those over are not called
    geometry(surface, path, config, rng, report, checkpoint)
    with torch.no_grad():
        xy, thickness = stroke_geometry(path, padded(surface, maps), points, offsets)
        drawn = 1.0 - coverage(xy, thickness, offsets, *maps.shape[2:])
    textured(texture, judge, drawn, config, rng, report, checkpoint)
    for network in (surface, path, texture):
        network.eval()
    return NeuralStrokesStyle(surface, path, texture, about)


def _seconds_a_step(
    train, view: View, config: NeuralStrokesConfig, device: torch.device, most: float
) -> float:
    """Mean over the patch sizes of one step's time, on copies. After `most` seconds larger patches are guessed."""
    start, each, sizes = time.monotonic(), [], _sizes(view, config)
    for i, size in enumerate(sizes):
        if each and time.monotonic() - start > most:
            each.append(each[-1] * (size / sizes[i - 1]) ** 2)
            continue
        clock = []

        def tick(*_, clock=clock) -> None:
            if device.type == "cuda":
                torch.cuda.synchronize(device)
            clock.append(time.monotonic())

        few = replace(config, patches=(size,), geometry_steps=3, texture_steps=3, schedule=1.0)
        train(few, np.random.default_rng(0), tick, Checkpoint())
        each.append((clock[-1] - clock[0]) / (len(clock) - 1))  # the first step also warms up
    return float(np.mean(each))


def _train_geometry(
    surface, path, maps, points, view, mask, config, rng, report, checkpoint
) -> None:
    """L_b + lambda_s L_s (eqs. 2 and 3)."""
    parameters = [*surface.parameters(), *path.parameters()]
    optimiser = torch.optim.Adam(parameters, config.rate, betas=(0.0, 0.99))
    steps, schedule = _schedule(
        optimiser, config.geometry_steps, config.geometry_decay, config.schedule
    )
    corners = {size: _corners(view, size) for size in _sizes(view, config)}
    xy, curve = view.curves.xy, owner(view.curves.offsets)
    learned = {"surface": surface, "path": path}
    training = {"optimiser": optimiser, "schedule": schedule}
    with checkpoint.watch("geometry", steps, learned, training, rng) as (remaining, passed):
        for step in remaining:
            size = int(rng.choice(list(corners)))
            at = corners[size][rng.integers(len(corners[size]), size=config.batch)]  # (B, 2) x, y
            patch = _crop(maps[0], at, size)
            rows, cuts, image = cut_curves(xy, curve, at, size)
            local = points[rows] - F.pad(
                torch.tensor(at, dtype=points.dtype, device=points.device)[image], (0, 5)
            )
            cuts = torch.tensor(cuts, device=points.device)
            image = torch.tensor(image, device=points.device)
            moved, thickness = stroke_geometry(path, surface(patch), local, cuts, image)
            drawn = 1.0 - coverage(
                moved, thickness, cuts, size, size, image[cuts[:-1]], config.batch
            )
            fidelity = F.l1_loss(drawn, _crop(mask[None], at, size)[:, 0])
            smooth = _smoothness(moved - local[:, :2], cuts)
            loss = fidelity + config.smoothness * smooth
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            schedule.step()
            passed()
            report("geometry", step, steps, {"mask": fidelity, "smooth": smooth})


def _train_texture(texture, judge, shown, rgb, view, config, rng, report, checkpoint) -> None:
    """L_t + lambda_a L_a (eqs. 4 and 5) with LSGAN, on patches turned by a random angle."""
    draw = torch.optim.Adam(texture.parameters(), config.rate, betas=(0.5, 0.999))
    tell = torch.optim.Adam(judge.parameters(), config.rate, betas=(0.5, 0.999))
    steps, draw_schedule = _schedule(
        draw, config.texture_steps, config.texture_decay, config.schedule
    )
    _, tell_schedule = _schedule(tell, config.texture_steps, config.texture_decay, config.schedule)
    corners = {size: _corners(view, size) for size in _sizes(view, config)}
    both = torch.cat([shown, rgb], dim=1)
    learned = {"texture": texture, "judge": judge}
    training = {
        "draw": draw,
        "tell": tell,
        "draw_schedule": draw_schedule,
        "tell_schedule": tell_schedule,
    }
    with checkpoint.watch("texture", steps, learned, training, rng) as (remaining, passed):
        for step in remaining:
            size = int(rng.choice(list(corners)))
            pick = corners[size][rng.integers(len(corners[size]), size=2 * config.batch)]
            turned = _turned(both, pick, size, rng.uniform(0, 2 * np.pi, len(pick)))
            seen, real = turned[: config.batch], turned[config.batch :, shown.shape[1] :]
            seen, wanted = seen[:, : shown.shape[1]], seen[:, shown.shape[1] :]
            fake = texture(seen)
            mine, theirs = _held(seen[:, -1]), _held(real.min(dim=1).values)
            told = 0.5 * (
                _lsgan(judge(fake.detach()), 0.0, mine) + _lsgan(judge(real), 1.0, theirs)
            )
            tell.zero_grad(set_to_none=True)
            told.backward()
            tell.step()
            color = F.l1_loss(fake, wanted)
            blurred = F.l1_loss(_blur(fake), _blur(wanted))
            fooled = _lsgan(judge(fake), 1.0, mine)
            loss = config.color * color + config.blurred * blurred + config.adversarial * fooled
            draw.zero_grad(set_to_none=True)
            loss.backward()
            draw.step()
            draw_schedule.step()
            tell_schedule.step()
            passed()
            report("texture", step, steps, {"color": color, "fooled": fooled, "told": told})


# --------------------------------------------------------------------------------------------------------- patches


def _sizes(view: View, config: NeuralStrokesConfig) -> list[int]:
    """Patch sizes that fit the canvas, or the largest one that does."""
    most = min(view.camera.width, view.camera.height) // 4 * 4
    return sorted({min(size, most) for size in config.patches})


def _corners(view: View, size: int) -> np.ndarray:
    """(P, 2) x, y of all patches with a pixel of the plain curves in their centre. Raises ValueError where none has."""
    line = (view.maps["plain"] > 0.5).astype(np.int64)
    total = np.pad(line.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    inner = max(1, round(size * CENTRE))
    near = (size - inner) // 2
    height, width = line.shape
    y, x = np.mgrid[: height - size + 1, : width - size + 1]
    a, b, c, d = y + near, y + near + inner, x + near, x + near + inner
    held = total[b, d] - total[a, d] - total[b, c] + total[a, c] > 0
    if not held.any():
        raise ValueError(
            f"no {size} px patch of this view holds a curve in its centre: nothing to learn from"
        )
    return np.stack([x[held], y[held]], axis=1)


def _crop(image: Tensor, at: np.ndarray, size: int) -> Tensor:
    """Patches (B, K, size, size) of an image (K, H, W) with their corners at (B, 2)."""
    return torch.stack([image[:, y : y + size, x : x + size] for x, y in at.tolist()])


def cut_curves(
    xy: np.ndarray, curve: np.ndarray, at: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The runs of curve points inside patches: rows (R,) of the points, offsets of the runs, the patch of each row.

    Runs of a single point are left out: a path has at least two.
    """
    inside = ((xy[None] >= at[:, None]) & (xy[None] < at[:, None] + size)).all(axis=2)  # (B, N)
    image, rows = np.nonzero(inside)
    new = np.r_[True, (np.diff(rows) != 1) | (np.diff(image) != 0) | (np.diff(curve[rows]) != 0)][
        : len(rows)
    ]
    run = np.cumsum(new) - 1
    keep = np.bincount(run)[run] >= 2 if len(run) else np.zeros(0, bool)
    image, rows, run = image[keep], rows[keep], run[keep]
    count = np.unique(run, return_counts=True)[1]
    return rows, np.r_[0, np.cumsum(count)], image


def _turned(image: Tensor, at: np.ndarray, size: int, angle: np.ndarray) -> Tensor:
    """Patches (B, K, size, size) of (1, K, H, W), turned about their centres; beyond the canvas all is 1."""
    height, width = image.shape[2:]
    place = (torch.arange(size, device=image.device) + 0.5) - size / 2
    y, x = torch.meshgrid(place, place, indexing="ij")
    c = torch.tensor(np.cos(angle), dtype=image.dtype, device=image.device)[:, None, None]
    s = torch.tensor(np.sin(angle), dtype=image.dtype, device=image.device)[:, None, None]
    centre = torch.tensor(at + size / 2, dtype=image.dtype, device=image.device)[:, :, None, None]
    px, py = centre[:, 0] + c * x - s * y, centre[:, 1] + s * x + c * y
    grid = torch.stack([2 * px / width - 1, 2 * py / height - 1], dim=-1)
    return 1.0 + F.grid_sample((image - 1.0).expand(len(at), -1, -1, -1), grid, align_corners=False)


# ---------------------------------------------------------------------------------------------------------- losses


def _smoothness(displacement: Tensor, offsets: Tensor) -> Tensor:
    """Eq. 3: squared difference of neighbouring displacements (N, 2), averaged over each path, then over the paths."""
    which = torch.repeat_interleave(
        torch.arange(len(offsets) - 1, device=offsets.device), offsets.diff()
    )
    within = which[1:] == which[:-1]
    change = displacement.diff(dim=0).square().sum(1)[within]
    weight = 1.0 / (offsets.diff() - 1).to(change.dtype)[which[1:][within]]
    return (change * weight).sum() / (len(offsets) - 1)


def _held(white: Tensor) -> Tensor:
    """(B,) 1 for patches (B, H, W), stroke dark on white, with stroke in their centre JUDGED px."""
    near = max(0, (white.shape[-1] - JUDGED) // 2)
    middle = white[:, near : white.shape[1] - near, near : white.shape[2] - near]
    return (middle.amin(dim=(1, 2)) < 0.9).to(white.dtype)


def _lsgan(verdict: Tensor, wanted: float, held: Tensor) -> Tensor:
    """Mean squared distance of the verdicts (B, 1, h, w) from `wanted` over the patches that hold stroke."""
    each = (verdict - wanted).square().mean(dim=(1, 2, 3))
    return (each * held).sum() / held.sum().clamp(min=1.0)


def _blur(image: Tensor, sigma: float = 2.0) -> Tensor:
    """Gaussian blur of (B, 3, H, W)."""
    reach = int(3 * sigma)
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1, device=image.device) / sigma) ** 2)
    kernel = (kernel / kernel.sum()).expand(3, 1, 1, -1)
    image = F.conv2d(F.pad(image, (reach, reach, 0, 0), mode="replicate"), kernel, groups=3)
    return F.conv2d(
        F.pad(image, (0, 0, reach, reach), mode="replicate"), kernel.transpose(2, 3), groups=3
    )


def _schedule(optimiser, steps: int, decay: int, share: float):
    """All steps to run, and a rate that is constant but for the last `decay` of them, where it falls to 0."""
    steps, decay = max(1, round(steps * share)), max(1, round(decay * share))
    return steps, torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda step: min(1.0, (steps - step) / decay)
    )


def _initialise(network: torch.nn.Module) -> None:
    """Normal weights of deviation 0.02, no bias: what the image-translation networks it builds on start from."""
    for layer in network.modules():
        if isinstance(layer, (torch.nn.Conv2d, torch.nn.ConvTranspose2d)):
            torch.nn.init.normal_(layer.weight, 0.0, 0.02)
            torch.nn.init.zeros_(layer.bias)
