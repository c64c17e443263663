"""What an animation is made of: shots, which are seen, and frames, which are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..extract.camera import Camera
from ..geometry.parts import Parts
from ..mesh.surface import Surface
from ..render.plan import Planned


@dataclass(frozen=True)
class Shot:
    """What one frame of an animation shows.

    Parameters
    ----------
    surface : the shape; that of all shots of an animation has the same faces, in the same order,
        and where the shape keeps still it is one and the same object
    camera : Camera; of one size in all shots
    """

    surface: Surface
    camera: Camera


@dataclass(frozen=True)
class Frame:
    """The planned strokes of one frame, and what they are in the animation.

    Parameters
    ----------
    camera : Camera
    planned : C strokes of N points, px of the style's canvas, along their tracks; its `source` and
        `mix` mean nothing
    surface : (N, 5), `features.SURFACE` at the points
    track : (C,) int64, what a stroke is called in all frames in which it is drawn; none twice
    place : (N,) float64, px along its track, of a style's canvas: ascending along a stroke, the
        same at the same part of a line in all frames, as far as its length lets it be
    presence : (N,) float64 in [0, 1], by which thickness is multiplied: below 1 where a stroke is
        growing in or tapering off
    parts : the named part that each point lies on, or None where the shape has but one

    Raises
    ------
    ValueError
        where the shapes do not agree.
    """

    camera: Camera
    planned: Planned
    surface: np.ndarray
    track: np.ndarray
    place: np.ndarray
    presence: np.ndarray
    parts: Parts | None = None

    def __post_init__(self) -> None:
        strokes, points = len(self.planned), len(self.planned.xy)
        shapes = {"surface": (points, 5), "place": (points,), "presence": (points,)}
        for name, shape in (shapes | {"track": (strokes,)}).items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise ValueError(f"Frame.{name} must have shape {shape}, got {found}")
        if len(np.unique(self.track)) != strokes:
            raise ValueError("Frame.track must not name two strokes alike")
