"""Planes across an axis, as they are asked for and as they lie in a surface's frame."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

ON = 1e-6  # of the longest side: vertices nearer than this to the plane lie in it
AXES = "xyz"
FORM = re.compile(r"([+-]?)([xyz])\s*:\s*([^%\s]+)\s*(%?)")


class SectionPlane(NamedTuple):
    """A plane across an axis, as it is asked for.

    Parameters
    ----------
    axis : 0, 1, 2 for x, y, z of the file
    offset : where it crosses the axis, in the file's own units, or percent of the shape's extent
    percent : bool
    side : 1 where the side towards the axis' tip is taken away, -1 where the other is; 0: that
        which is nearer to the eye
    """

    axis: int
    offset: float
    percent: bool = False
    side: int = 0

    def __str__(self) -> str:
        sign = {1: "+", -1: "-", 0: ""}[self.side]
        return f"{sign}{AXES[self.axis]}:{self.offset:g}{'%' * self.percent}"


class Plane(NamedTuple):
    """A plane in a surface's own frame; beyond it is the `side` (1 or -1) of the axis' tip or foot.

    Parameters
    ----------
    axis : 0, 1 or 2
    offset : float
    side : 1 or -1
    """

    axis: int
    offset: float
    side: int

    def height(self, points: np.ndarray) -> np.ndarray:
        """Measure how far points (N, 3) lie beyond it, (N,); exactly 0 where that is below ON."""
        height = self.side * (points[:, self.axis] - self.offset)
        return np.where(np.abs(height) < ON, 0.0, height)

    @property
    def normal(self) -> np.ndarray:
        """The unit vector to the side beyond, (3,)."""
        return self.side * np.eye(3)[self.axis]


def parse_section(text: str) -> SectionPlane:
    """Read "x:0.5", "y:50%", "-z:12" (which takes away what is below). Raises ValueError."""
    found = FORM.fullmatch(text.strip().lower())
    try:
        sign, axis, offset, percent = found.groups() if found else ("", "", "", "")
        value = float(offset)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(
            f"section {text!r} is no AXIS:OFFSET: give one such as x:12.5, y:50% or -z:0, "
            "where the sign says which side is taken away"
        )
    return SectionPlane(AXES.index(axis), value, bool(percent), {"+": 1, "-": -1, "": 0}[sign])
