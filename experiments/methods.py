"""What is compared: the methods of the paper's tables, and ours, all behind one signature."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from dataset import Lesson, Sheet

# draws a sheet: (H, W, 3) uint8 on white; the same seed, the same image
Painter = Callable[[Sheet, int], np.ndarray]


@dataclass(frozen=True)
class Method:
    """A way to learn a style from one drawing.

    label : its name in tables
    source : the paper that it is from
    learn : (lesson, settings, seed, device) -> Painter
    reduced : its settings for a CPU, which tables state
    full : its settings as published, for a GPU
    """

    label: str
    source: str
    learn: Callable[[Lesson, Any, int, str], Painter]
    reduced: Any
    full: Any
