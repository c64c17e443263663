"""The paper's model, and its five reduced variants.

Liu, Fisher, Hertzmann, Kalogerakis: Neural Strokes: Stylized Line Drawing of 3D Shapes, ICCV 2021;
the variants are those of its section 5, "Ablation study". All are trained by the package's own
loops, with the paper's losses. What has strokes is drawn as the paper has it: the translated image
is looked up along the strokes, and these are written as SVG."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import torch
from dataset import Lesson, Sheet
from methods import Method, Painter
from torch import Tensor, nn

from strokestyle.fit.checkpoint import Checkpoint
from strokestyle.fit.choice import learn_lines
from strokestyle.fit.config import NeuralStrokesConfig
from strokestyle.fit.neural_strokes import Exercise, Networks, train
from strokestyle.fit.progress import Reporter
from strokestyle.fit.train import PRESETS
from strokestyle.render.devices import pick_device
from strokestyle.render.networks import PatchDiscriminator, PathNet, SurfaceNet, TextureNet
from strokestyle.render.neural_strokes import (
    NeuralStrokesStyle,
    Paths,
    StrokeGeometry,
    moved,
    nearest,
    padded,
    painted,
    view_maps,
)

from .raster import rastered

SOURCE = "Liu et al., Neural Strokes, ICCV 2021"
CANVAS = 768  # px, the paper's
ONE_CROP = 128  # px on it
LEAST_PATCH = 24  # px, which the discriminator makes one value of
REDUCED = dict(
    batch=4,
    rate=1e-3,
    geometry_steps=600,
    geometry_decay=200,
    texture_steps=900,
    texture_decay=450,
)
VARIED = "geometry", "surface_features"  # of a variant's settings, those that are no config's
PAPER = PRESETS["paper"]


class SurfaceMap(nn.Module):
    """f, whose last layer makes `channels` maps of any sign."""

    def __init__(self, channels: int):
        super().__init__()
        layers = list(SurfaceNet().body)[:-3]  # without the last convolution, and what follows it
        self.body = nn.Sequential(*layers, nn.Conv2d(40, channels, 1))

    def forward(self, maps: Tensor) -> Tensor:
        return self.body(maps)


class LastMap(nn.Module):
    """A network of one map that is shown several, and sees the last."""

    def __init__(self, network: nn.Module):
        super().__init__()
        self.network = network

    def forward(self, maps: Tensor) -> Tensor:
        return self.network(maps[:, -1:])


class NoStrokes(nn.Module):
    """Make the raster I_b of the maps V: no curves, so nothing that could be displaced."""

    def __init__(self) -> None:
        super().__init__()
        self.surface = SurfaceMap(1)

    def draw(self, maps: Tensor, paths: Paths) -> tuple[Tensor, Tensor]:
        """Draw (B, H, W), white 1, as StrokeGeometry does; the displacement (N, 2) is nothing."""
        raster = torch.sigmoid(padded(self.surface, maps))[:, 0]
        return raster, torch.zeros_like(paths.points[:, :2])


class NoCurveFeatures(StrokeGeometry):
    """Look up displacement and thickness along the curves in a map of three channels."""

    def __init__(self) -> None:
        super().__init__(SurfaceMap(3), nn.Identity())

    def forward(self, maps: Tensor, paths: Paths) -> tuple[Tensor, Tensor]:
        return moved(paths, nearest(padded(self.surface, maps), paths))


def no_surface_features() -> StrokeGeometry:
    """The paper's geometry, which sees the plain curves alone of all maps."""
    return StrokeGeometry(LastMap(SurfaceNet(1)), PathNet())


def papers_geometry() -> StrokeGeometry:
    """f and h."""
    return StrokeGeometry(SurfaceNet(), PathNet())


@dataclass(frozen=True)
class Variant:
    """The settings of a run of the paper's model.

    config : schedule and weights of the losses, its patches for the paper's canvas
    width : channels of the first layers of g and of the discriminator
    geometry : makes what takes the place of f and h
    surface_features : whether g sees the geometry maps
    """

    config: NeuralStrokesConfig
    width: int = 64
    geometry: Callable[[], nn.Module] = field(default=papers_geometry, repr=False)
    surface_features: bool = True

    def networks(self) -> Networks:
        """Make the networks, in the order in which the paper's are: weights are drawn in turn."""
        geometry = self.geometry()
        if self.surface_features:
            texture: nn.Module = TextureNet(width=self.width)
        else:
            texture = LastMap(TextureNet(1, self.width))
        return Networks(geometry, texture, PatchDiscriminator(self.width))

    def on(self, size: int) -> NeuralStrokesConfig:
        """The schedule for a canvas of `size` px, of which patches are the same share."""
        shares = [patch / CANVAS for patch in self.config.patches]
        patches = (max(4 * round(share * size / 4), LEAST_PATCH) for share in shares)
        return replace(self.config, patches=tuple(patches))


def learn(lesson: Lesson, variant: Variant, seed: int, device: str) -> Painter:
    """Train a variant on one drawing, as `strokestyle fit --preset paper` trains the paper's."""
    where, exemplar = pick_device(device), lesson.exemplar()
    lines = learn_lines(lesson.sheet.view, exemplar.mask)
    networks = Networks.untrained(variant.networks, seed, where)
    config = variant.on(max(lesson.sheet.size))
    exercise = Exercise.of(lines.view, exemplar, where)
    train(networks, exercise, config, seed, Reporter(None, 1), Checkpoint())
    return partial(
        paint, NeuralStrokesStyle(networks.geometry, networks.texture, choice=lines.choice)
    )


def paint(style: NeuralStrokesStyle, sheet: Sheet, seed: int) -> np.ndarray:
    """Draw a sheet, (H, W, 3) uint8; there is no chance in it, so that `seed` changes nothing."""
    if not isinstance(style.geometry, NoStrokes):
        return rastered(style.draw(sheet.view, seed), sheet.size)
    view = style.choose(sheet.view)
    device = next(style.geometry.parameters()).device
    maps = view_maps(view, device)
    with torch.no_grad():
        mask = style.geometry.draw(maps, Paths.of(view, device))[0][0]
    return np.uint8(255 * painted(style.texture, maps, mask) + 0.5)


def reduced(variant: Variant) -> Variant:
    """The same with what this CPU is given: all variants have the same steps."""
    return replace(variant, width=16, config=replace(variant.config, **REDUCED))


def method(label: str, **changed) -> Method:
    """A variant of the paper's model, whose settings are its own but for those `changed`."""
    of_variant = {name: changed.pop(name) for name in VARIED if name in changed}
    full = Variant(replace(PAPER, **changed), **of_variant)
    return Method(label, SOURCE, learn, reduced(full), full)


METHODS = {
    "paper": method("Neural Strokes"),
    "paper_no_strokes": method("no strokes", geometry=NoStrokes),
    "paper_no_curve_features": method("no curve features", geometry=NoCurveFeatures),
    "paper_no_surface_features": method(
        "no surface features", geometry=no_surface_features, surface_features=False
    ),
    "paper_one_crop": method("no multi-scale crops", patches=(ONE_CROP,)),
    "paper_no_regularisation": method("no regularisation", smoothness=0.0),
    "paper_20th": Method(
        "Neural Strokes, 1/20 of its schedule",
        SOURCE,
        learn,
        Variant(replace(PAPER, batch=4, schedule=0.05)),
        Variant(PAPER),
    ),
}
