"""How to learn: the settings of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..render.config import StyleConfig


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
