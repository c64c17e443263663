"""Our own model, by its presets, and what is left of it without one of its parts."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from dataset import Lesson, Sheet
from methods import Method, Painter

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.fit.checkpoint import Checkpoint
from strokestyle.fit.config import FitConfig
from strokestyle.fit.neural_strokes import Exercise, Networks, train_texture
from strokestyle.fit.progress import Reporter
from strokestyle.fit.train import PRESETS, fit_drawing, fit_style
from strokestyle.render.coverage import coverage
from strokestyle.render.devices import pick_device
from strokestyle.render.neural_strokes import look_up, painted, view_maps
from strokestyle.render.style import Style

from .paper import CANVAS, PAPER, Variant, reduced
from .raster import rastered

SOURCE = "ours"
QUICK, STANDARD = PRESETS["quick"], PRESETS["standard"]
FLAT = replace(QUICK, texture=False)


@dataclass(frozen=True)
class Ours:
    """The settings of a fit.

    config : as of `strokestyle fit`
    size : px, the longer side that the drawing is learned at; None = that of the data set
    """

    config: FitConfig
    size: int | None = None


def learn(lesson: Lesson, settings: Ours, seed: int, device: str) -> Painter:
    """Learn one drawing as `strokestyle fit` does, on the CPU whatever the device."""
    if settings.size is not None:
        lesson = lesson.at(settings.size)
    view, exemplar = lesson.sheet.view, lesson.exemplar()
    return partial(paint, fit_style(view, exemplar, settings.config, seed=seed, device="cpu"))


def paint(style: Style, sheet: Sheet, seed: int) -> np.ndarray:
    """Draw a sheet as `strokestyle render` does: (H, W, 3) uint8."""
    return rastered(style.draw(sheet.view, seed))


@dataclass(frozen=True)
class NetworkTexture:
    """Settings of our strokes and of the paper's texture network upon them.

    strokes : of a fit
    texture : of the network's training
    """

    strokes: FitConfig
    texture: Variant


def learn_network_texture(
    lesson: Lesson, settings: NetworkTexture, seed: int, device: str
) -> Painter:
    """Train the paper's g on our geometry: on the strokes that a fit traced in the drawing.

    That is what texture by example is learned from as well.
    """
    where, exemplar = pick_device(device), lesson.exemplar()
    fitted = fit_drawing(lesson.sheet.view, exemplar, settings.strokes, seed=seed, device="cpu")
    networks = Networks.untrained(settings.texture.networks, seed, where)
    exercise = Exercise.of(fitted.lines.view, exemplar, where)
    mask = mask_of(fitted.learned.strokes, lesson.sheet.size).to(where)
    config, rng = settings.texture.on(max(lesson.sheet.size)), np.random.default_rng(seed)
    train_texture(networks, exercise, mask, config, rng, Reporter(None, 1), Checkpoint())
    return partial(paint_by_network, fitted.style, networks.texture.eval())


def paint_by_network(style: Style, texture: torch.nn.Module, sheet: Sheet, seed: int) -> np.ndarray:
    """Draw a sheet: our strokes, whose texture is looked up in what the network makes of them."""
    device = next(texture.parameters()).device
    strokes = style.draw(sheet.view, seed).strokes
    mask = mask_of(strokes, sheet.size).to(device)
    image = painted(texture, view_maps(sheet.view, device), mask)
    looked_up, color = look_up(strokes, image)
    return rastered(Drawing(strokes, sheet.size, color, looked_up))


def mask_of(strokes: Strokes, size: tuple[int, int]) -> torch.Tensor:
    """The strokes (H, W), white 1, on a canvas of `size` (width, height), px."""
    xy, thickness = torch.tensor(strokes.xy), torch.tensor(strokes.thickness)
    cover = coverage(xy, thickness, torch.tensor(strokes.offsets), size[1], size[0])
    return 1.0 - cover.float()


def method(label: str, config: FitConfig, size: int | None = None) -> Method:
    """A fit; it has no need of a GPU, so that both its settings are the same."""
    return Method(label, SOURCE, learn, Ours(config, size), Ours(config, size))


METHODS = {
    "ours_quick": method("ours, quick", QUICK),
    "ours_standard": method("ours, standard", STANDARD),
    "ours_768": method("ours, standard, learned from the drawing at 768 px", STANDARD, CANVAS),
    "ours_no_alignment": method("no alignment", replace(QUICK, alignment=False)),
    "ours_no_correspondence": method(
        "no correspondence", replace(QUICK, alignment=False, trace_steps=0)
    ),
    "ours_no_residuals": method("no residual sampling", replace(QUICK, residuals=0.0)),
    "ours_flat_ink": method("flat ink", FLAT),
    "ours_network_texture": Method(
        "the paper's texture network in place of texture by example",
        SOURCE,
        learn_network_texture,
        NetworkTexture(FLAT, reduced(Variant(PAPER))),
        NetworkTexture(FLAT, Variant(PAPER)),
    ),
}
