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
    alignment : whether strokes are laid where the drawing has them before anything is learned of
        them; without it they are taken to lie on their curves
    trace_steps : Adam steps of the strokes' own points, through the rasteriser; 0 = strokes are
        taken to be as they were measured
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
    alignment: bool = True
    trace_steps: int = 120
    levels: int = 3
    roughness: float = 0.1
    residuals: float = 1.0
    texture: bool = True
    style: StyleConfig = field(default_factory=StyleConfig)


@dataclass(frozen=True)
class NeuralStrokesConfig:
    """The paper's schedule; what its text leaves open is from its authors' code.

    Parameters
    ----------
    preset : its name, kept in the model
    patches : px, one size a batch (paper, sec. 4)
    batch : patches (paper)
    rate : Adam's learning rate (paper)
    geometry_steps, geometry_decay : iterations, and how many of them, the last, let the rate fall
        to 0 (code)
    texture_steps, texture_decay : the same for the texture (code)
    smoothness, color, blurred, adversarial : weights of L_s, L_t (paper), of L_t after a blur
        (code), and L_a (paper)
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
