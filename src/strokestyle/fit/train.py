"""Fit a style: check, choose the preset, time it, go on from a checkpoint."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from .. import __version__
from ..extract.view import View
from ..render.style import Style
from .checkpoint import Checkpoint, digest
from .choice import DrawnLines, learn_lines
from .config import FitConfig, NeuralStrokesConfig
from .exemplar import Exemplar
from .learn import Learned, fit_quick
from .progress import Progress, Reporter

if TYPE_CHECKING:
    from ..render.neural_strokes import NeuralStrokesStyle

STANDARD = FitConfig("standard", steps=300, trace_steps=300)
PRESETS: dict[str, FitConfig | NeuralStrokesConfig] = {
    "quick": FitConfig("quick", trace_steps=100),
    "standard": STANDARD,
    "paper": NeuralStrokesConfig(),
}


@dataclass(frozen=True)
class Fitted:
    """What a fit ends with.

    Parameters
    ----------
    style : what was learned
    lines : which of the view's lines the artist drew
    learned : what of the drawing it was learned from; None for the paper's networks
    """

    style: Style | NeuralStrokesStyle
    lines: DrawnLines
    learned: Learned | None


def fit_style(
    view: View,
    exemplar: Exemplar,
    config: FitConfig | NeuralStrokesConfig = STANDARD,
    *,
    seed: int = 0,
    device: str = "auto",
    progress: Callable[[Progress], None] | None = None,
    source: str = "",
    checkpoint: Checkpoint | None = None,
    minutes: float | None = None,
) -> Style | NeuralStrokesStyle:
    """Learn the style of one drawing.

    Parameters
    ----------
    view : the shape as it was drawn
    exemplar : the drawing, at the view's size
    config : one of PRESETS, or a change of it
    seed : same seed, same style, bit for bit on one machine (the paper's networks on a GPU: but for
        rounding)
    device : "auto", "cpu" or "cuda", for the paper's networks; the fast presets have nothing to
        gain from one
    progress : called a few times a second
    source : the drawing's name, kept in the model
    checkpoint : where to keep the state of the fit, and whether to go on from it; the caller
        removes it afterwards
    minutes : choose as many steps as this machine can do in that time, so that the result depends
        on its speed; where a checkpoint is gone on from, what was chosen then holds

    Raises
    ------
    ValueError
        where drawing and view differ in size, or there are no strokes to learn from, or the
        checkpoint is damaged or that of another fit.
    KeyboardInterrupt
        on Ctrl-C, after the checkpoint is written.
    """
    return fit_drawing(
        view,
        exemplar,
        config,
        seed=seed,
        device=device,
        progress=progress,
        source=source,
        checkpoint=checkpoint,
        minutes=minutes,
    ).style


def fit_drawing(
    view: View,
    exemplar: Exemplar,
    config: FitConfig | NeuralStrokesConfig = STANDARD,
    *,
    seed: int = 0,
    device: str = "auto",
    progress: Callable[[Progress], None] | None = None,
    source: str = "",
    checkpoint: Checkpoint | None = None,
    minutes: float | None = None,
) -> Fitted:
    """Learn the style of one drawing, and say from what. Arguments and errors as of `fit_style`."""
    until = None if minutes is None else time.monotonic() + 60.0 * minutes
    size = (view.camera.height, view.camera.width)
    if exemplar.mask.shape != size:
        raise ValueError(
            f"the drawing is {exemplar.mask.shape[::-1]} px, the view {size[::-1]}: "
            "resample the drawing"
        )
    if exemplar.mask.max() < 0.5:
        raise ValueError("no strokes in this drawing: nothing to learn from")
    about = {"strokestyle": __version__, "preset": config.preset, "seed": seed, "exemplar": source}
    # else there is no need of torch, whose import takes longer than all steps of a fast preset
    if isinstance(config, NeuralStrokesConfig) or device not in ("auto", "cpu"):
        from ..render.devices import pick_device

        where = pick_device(device)
    checkpoint = checkpoint or Checkpoint()
    checkpoint.begin(_key(view, exemplar, config, seed))
    lines = learn_lines(view, exemplar.mask)
    view, about = lines.view, about | lines.about
    if isinstance(config, NeuralStrokesConfig):
        from .neural_strokes import fit_neural_strokes

        report = Reporter(progress, config.geometry_steps + config.texture_steps)
        fitted = fit_neural_strokes(
            view, exemplar, config, seed, where, report, about, checkpoint, until
        )
        return Fitted(replace(fitted, choice=lines.choice), lines, None)
    report = Reporter(progress, 2 * config.steps + config.trace_steps)
    learned = fit_quick(view, exemplar, config, seed, report, checkpoint, until)
    style = replace(learned.style, choice=lines.choice, about=about)
    return Fitted(style, lines, learned)


def _key(
    view: View, exemplar: Exemplar, config: FitConfig | NeuralStrokesConfig, seed: int
) -> dict[str, str]:
    """What a checkpoint must have in common with a fit that is to go on from it."""
    curves, maps = view.curves, view.maps
    shape = (curves.xy, curves.offsets, curves.kind, curves.closed, maps.covered)
    # where these two are the same, so are the other maps, which may not have been worked out
    seen = [maps[name] for name in ("depth", "n_dot_v")]
    return {
        "strokestyle": __version__,
        "preset": config.preset,
        "seed": str(seed),
        "drawing": digest(exemplar.rgb, exemplar.alpha, exemplar.ink, exemplar.mask),
        "shape, view or lines": digest(*shape, *seen),
        "setting of the preset": repr(config),
    }
