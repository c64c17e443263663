"""What a style knows beside its weights."""

from __future__ import annotations

from dataclasses import dataclass

# px; thickness is learned as log(thickness + HAIR): a habit is a factor there, and a thickness of
# nothing is not infinitely far from a thin one.
HAIR = 0.5


@dataclass(frozen=True)
class StyleConfig:
    """What a style needs to know beside its weights.

    Lengths are px of a canvas whose longer side is `size`. The spacing is that of the authors'
    code; the other defaults were chosen on drawings simulated by known laws.

    Parameters
    ----------
    size : px, longer side of the canvas that the style was learned on
    spacing : px between two points of a stroke
    join_gap : px, ends of curves nearer than this that head the same way are drawn through
    corner_angle : degrees, a curve that turns more sharply is drawn as two strokes
    max_overshoot : px by which strokes are planned past both ends of their curves
    cut_tolerance : px, strokes also end at the corners of the polyline that stays within this of
        their curve; 0 = never
    hidden_units : of the curve of thickness over each feature
    """

    size: int = 768
    spacing: float = 3.0
    join_gap: float = 10.0
    corner_angle: float = 65.0
    max_overshoot: float = 24.0
    hidden_units: int = 8
    cut_tolerance: float = 0.0
