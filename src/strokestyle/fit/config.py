"""How to learn: the settings of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..render.config import StyleConfig


@dataclass(frozen=True)
class FitConfig:
    """The settings of the fast presets.

    Where no source is named, a value was chosen by comparing drawings of the project's own shapes.

    Parameters
    ----------
    preset : its name, kept in the model
    steps : Adam steps of the thickness curves, in each of the two times that they are learned
    rate : their learning rate at the top of its one-cycle schedule, log width a step
    sparsity : weight of their group lasso, against a mean error of log width
    trace_steps : Adam steps of the strokes' own points, through the rasteriser
    levels : sizes at which mask and strokes are compared by L1: 1, 6, 12 ... px
    roughness : weight of the traced strokes' mean squared second differences (px of offset, and
        log width), against the mask's L1 per pixel of stroke
    residuals : how much of the traced strokes' residuals to draw with, 0 = none, 1 = all
    texture : whether to learn the medium; without it, ink is flat
    style : the settings that the style itself keeps
    """

    preset: str
    steps: int = 150
    rate: float = 0.02
    sparsity: float = 0.04
    trace_steps: int = 120
    levels: int = 3
    roughness: float = 0.1
    residuals: float = 1.0
    texture: bool = True
    style: StyleConfig = field(default_factory=StyleConfig)
