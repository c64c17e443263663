"""Visible fragments into natural strokes."""

from __future__ import annotations

import numpy as np

from .curves import Curves


def tidy(fragments: Curves, strength: np.ndarray, size: tuple[int, int] = (768, 768)) -> Curves:
    return fragments.take(fragments.lengths() > 8)
