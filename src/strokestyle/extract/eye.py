"""Where an eye stands: at a point, or at infinity, where all look at it in one direction."""

from __future__ import annotations

import numpy as np


def at_infinity(eye: np.ndarray) -> bool:
    """Tell whether an eye, (3,) or homogeneous (4,), is at infinity."""
    return len(eye) == 4 and eye[3] == 0.0


def towards(eye: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Find the vectors (N, 3) from points (N, 3) to an eye, (3,) or homogeneous (4,).

    To an eye at infinity that is its direction, from everywhere.
    """
    return eye[:3] - (eye[3] if len(eye) == 4 else 1.0) * points
