"""View = camera + visible curves + feature maps: one shape from one camera, and all that the networks ever see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .camera import Camera
from .curves import Curves

# The paper's eight geometry channels (its authors split the radial curvature by sign), then the screen-space normal.
PAPER_MAPS = (
    "depth",
    "radial_curvature_positive",
    "radial_curvature_negative",
    "radial_curvature_derivative",
    "max_curvature",
    "min_curvature",
    "view_curvature",
    "n_dot_v",
)
NORMAL_MAPS = ("normal_x", "normal_y")  # x right, y down, components of the unit normal, not rescaled; background 0


@dataclass(frozen=True)
class FeatureMaps:
    """Per-pixel geometry of the visible surface.

    Parameters
    ----------
    names : K names: PAPER_MAPS, NORMAL_MAPS, "plain"
    values : (K, H, W) float32. PAPER_MAPS are scaled by their 90th percentile, background 1.
        "plain" is the raster of the curves, 1 px wide, 1 = line.
    covered : (H, W) bool, where the surface is seen
    """

    names: tuple[str, ...]
    values: np.ndarray
    covered: np.ndarray

    def __post_init__(self):
        values, covered = np.asarray(self.values, np.float32), np.asarray(self.covered, bool)
        if values.ndim != 3 or len(values) != len(self.names) or covered.shape != values.shape[1:]:
            raise ValueError(
                f"FeatureMaps.values must have shape ({len(self.names)}, H, W) like covered (H, W), "
                f"got {values.shape} and {covered.shape}"
            )
        if not np.isfinite(values).all():
            raise ValueError("FeatureMaps.values holds values that are not finite")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "covered", covered)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[self.names.index(name)]


@dataclass(frozen=True)
class View:
    camera: Camera
    curves: Curves
    maps: FeatureMaps
