"""What changes from one picture to the next: a smaller file says no more than that."""

from __future__ import annotations

import numpy as np

Box = tuple[int, int, int, int]


def changed_box(before: np.ndarray, after: np.ndarray) -> Box:
    """Find the smallest box (left, top, right, bottom) outside of which two pictures are alike.

    Pictures (h, w, ...); where nothing changes, the box of the first pixel.
    """
    other = before != after
    if other.ndim == 3:
        other = other.any(axis=2)
    rows, columns = np.flatnonzero(other.any(axis=1)), np.flatnonzero(other.any(axis=0))
    if not len(rows):
        return (0, 0, 1, 1)
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
