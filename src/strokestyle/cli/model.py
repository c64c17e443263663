"""The MODEL argument: a style, read once however many shapes are drawn with it."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from .messages import timed

if TYPE_CHECKING:
    from ..render.neural_strokes import NeuralStrokesStyle
    from ..render.style import Style


@functools.lru_cache(maxsize=1)
def read_style(path: str, device: str = "auto") -> Style | NeuralStrokesStyle:
    """Read the style of a model file. Raises ValueError or OSError, naming it, where it is none."""
    from ..render.style_file import load_style

    with timed("load the model"):
        return load_style(path, device=device)
