"""Show what a fit has learned: exemplar and drawing, and the masks of both, side by side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..drawing.raster import rasterise
from ..drawing.strokes import Drawing
from ..extract.view import View
from ..render.neural_strokes import NeuralStrokesStyle
from ..render.style import Style
from .exemplar import Exemplar


def fit_report(view: View, exemplar: Exemplar, style: Style | NeuralStrokesStyle) -> np.ndarray:
    """Show exemplar, its mask, the drawn mask and the drawing side by side.

    (H, 4 W, 3) float32 in [0, 1], on white.
    """
    drawing = style.draw(view, seed=0)
    flat = replace(
        drawing, color=np.tile([0.0, 0.0, 0.0, 1.0], (len(drawing.strokes), 1)), texture=None
    )
    panels = [
        exemplar.rgb,
        np.repeat(1 - exemplar.mask[..., None], 3, axis=2),
        _on_white(flat),
        _on_white(drawing),
    ]
    return np.concatenate(panels, axis=1).astype(np.float32)


def _on_white(drawing: Drawing) -> np.ndarray:
    return rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255.0
