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
from strokestyle.render.style import Style, scaled

from .paper import CANVAS, PAPER, Variant, reduced
from .raster import rastered

SOURCE = "ours"
QUICK, STANDARD = PRESETS["quick"], PRESETS["standard"]
FLAT = replace(QUICK, texture=False)


@dataclass(frozen=True)
class Ours:
    """The settings of a fit.

    config : as of `strokestyle fit`
    canvas : px, the longer side of the canvas that strokes are learned and drawn on, whatever the
        drawing's size, as `fit` has it; None = that of the data set
    whole : whether the drawing is read as its file has it, not at the size of the data set
    """

    config: FitConfig
    canvas: int | None = CANVAS
    whole: bool = False


def learn(lesson: Lesson, settings: Ours, seed: int, device: str) -> Painter:
    """Learn one drawing as `strokestyle fit` does, on the CPU whatever the device."""
    sheet = _large(lesson.sheet, settings.canvas)
    if settings.whole:
        lesson = lesson.at(max(sheet.size))
    exemplar = lesson.exemplar(sheet)
    style = fit_style(sheet.view, exemplar, settings.config, seed=seed, device="cpu")
    return partial(paint, style, settings.canvas)


def paint(style: Style, canvas: int | None, sheet: Sheet, seed: int) -> np.ndarray:
    """Draw a sheet as `strokestyle render` does, on a canvas of its own: (H, W, 3) uint8."""
    return rastered(style.draw(_large(sheet, canvas).view, seed), sheet.size)


@dataclass(frozen=True)
class NetworkTexture:
    """Settings of our strokes and of the paper's texture network upon them.

    strokes : of a fit
    texture : of the network's training
    canvas : px, as of `Ours`
    """

    strokes: FitConfig
    texture: Variant
    canvas: int | None = CANVAS


def learn_network_texture(
    lesson: Lesson, settings: NetworkTexture, seed: int, device: str
) -> Painter:
    """Train the paper's g on our geometry: on the strokes that a fit traced in the drawing.

    That is what texture by example is learned from as well. Strokes are learned as by `learn`, and
    g sees them at the size of the data set.
    """
    where, sheet = pick_device(device), _large(lesson.sheet, settings.canvas)
    drawing = lesson.exemplar(sheet)
    fitted = fit_drawing(sheet.view, drawing, settings.strokes, seed=seed, device="cpu")
    networks = Networks.untrained(settings.texture.networks, seed, where)
    exercise = Exercise.of(lesson.sheet.view, lesson.exemplar(lesson.sheet), where)
    strokes = _on_sheet(fitted.learned.strokes, lesson.sheet, sheet)
    mask = mask_of(strokes, lesson.sheet.size).to(where)
    config, rng = settings.texture.on(max(lesson.sheet.size)), np.random.default_rng(seed)
    train_texture(networks, exercise, mask, config, rng, Reporter(None, 1), Checkpoint())
    return partial(paint_by_network, fitted.style, networks.texture.eval(), settings.canvas)


def paint_by_network(
    style: Style, texture: torch.nn.Module, canvas: int | None, sheet: Sheet, seed: int
) -> np.ndarray:
    """Draw a sheet: our strokes, whose texture is looked up in what the network makes of them."""
    device, large = next(texture.parameters()).device, _large(sheet, canvas)
    strokes = _on_sheet(style.draw(large.view, seed).strokes, sheet, large)
    mask = mask_of(strokes, sheet.size).to(device)
    image = painted(texture, view_maps(sheet.view, device), mask)
    looked_up, color = look_up(strokes, image)
    return rastered(Drawing(strokes, sheet.size, color, looked_up), sheet.size)


def _large(sheet: Sheet, canvas: int | None) -> Sheet:
    """The sheet at the size that strokes are learned and drawn at."""
    return sheet if canvas is None else sheet.at(canvas)


def _on_sheet(strokes: Strokes, sheet: Sheet, large: Sheet) -> Strokes:
    """Strokes of the large sheet, in px of the other."""
    return scaled(strokes, None, max(sheet.size) / max(large.size))[0]


def mask_of(strokes: Strokes, size: tuple[int, int]) -> torch.Tensor:
    """The strokes (H, W), white 1, on a canvas of `size` (width, height), px."""
    xy, thickness = torch.tensor(strokes.xy), torch.tensor(strokes.thickness)
    cover = coverage(xy, thickness, torch.tensor(strokes.offsets), size[1], size[0])
    return 1.0 - cover.float()


def method(label: str, config: FitConfig, **more) -> Method:
    """A fit; it has no need of a GPU, so that both its settings are the same."""
    return Method(label, SOURCE, learn, Ours(config, **more), Ours(config, **more))


METHODS = {
    "ours_quick": method("ours, quick", QUICK),
    "ours_standard": method("ours, standard", STANDARD),
    "ours_768": method("ours, quick, learned from the drawing at 768 px", QUICK, whole=True),
    "ours_small_canvas": method("canvas no larger than the drawing", QUICK, canvas=None),
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
