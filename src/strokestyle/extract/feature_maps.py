"""Per-pixel geometry of the visible surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..geometry.curves import Curves
from ..mesh.surface import Surface
from .camera import Camera
from .plain_raster import plain_raster
from .rays import Bvh
from .seen_surface import CHANNELS, CLIP, NEURAL_STROKES_MAPS, NORMAL_MAPS, SeenSurface

__all__ = [
    "CLIP",
    "MAPS",
    "NEURAL_STROKES_MAPS",
    "NORMAL_MAPS",
    "FeatureMaps",
    "feature_maps",
    "plain_raster",
]

PLAIN = "plain"
MAPS = (*CHANNELS, PLAIN)  # of a surface and its curves


@dataclass(frozen=True)
class FeatureMaps:
    """Per-pixel geometry of the visible surface.

    Those of `feature_maps` are worked out when they are asked for: one by its name, all by
    `values`.

    Parameters
    ----------
    names : K names: NEURAL_STROKES_MAPS, NORMAL_MAPS, "plain"
    values : (K, H, W) float32. NEURAL_STROKES_MAPS are scaled by their 90th percentile, background
        1. "plain" is the raster of the curves, 1 px wide, 1 = line.
    covered : (H, W) bool, where the surface is seen
    scale : (K,) float32, what the values of each map were divided by; 1 where it was not scaled

    Raises
    ------
    ValueError
        on a wrong shape, or a value that is not finite.
    """

    names: tuple[str, ...]
    values: np.ndarray
    covered: np.ndarray
    # None only until __post_init__ has made one; of no default that would be found before `_later`
    scale: np.ndarray | None = field(default_factory=lambda: None)

    def __post_init__(self):
        values, covered = np.asarray(self.values, np.float32), np.asarray(self.covered, bool)
        scale = (
            np.ones(len(self.names), np.float32)
            if self.scale is None
            else np.asarray(self.scale, np.float32)
        )
        if values.ndim != 3 or len(values) != len(self.names) or covered.shape != values.shape[1:]:
            raise ValueError(
                f"FeatureMaps.values must have shape ({len(self.names)}, H, W) like covered "
                f"(H, W), got {values.shape} and {covered.shape}"
            )
        if scale.shape != (len(self.names),):
            raise ValueError(
                f"FeatureMaps.scale must have shape ({len(self.names)},), got {scale.shape}"
            )
        # a sum tells in one go, unless finite numbers overflow it
        finite = np.isfinite(values.sum()) or np.isfinite(values).all()
        if not (finite and np.isfinite(scale).all()):
            raise ValueError("FeatureMaps holds values that are not finite")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "covered", covered)
        object.__setattr__(self, "scale", scale)

    @classmethod
    def later(cls, seen: SeenSurface, curves: Curves) -> FeatureMaps:
        """Make the maps MAPS of a surface and its curves, each worked out when it is asked for."""
        maps = object.__new__(cls)
        vars(maps).update(names=MAPS, _later=_Later(seen, curves))
        return maps

    def __getattr__(self, name: str) -> np.ndarray:
        """Work out all of the maps, or their scale, or what they cover, where that is asked for."""
        later: _Later | None = vars(self).get("_later")
        if later is None and name in vars(self):  # another thread has just worked them out
            return vars(self)[name]
        if later is None or name not in ("values", "covered", "scale"):
            raise AttributeError(f"'FeatureMaps' object has no attribute {name!r}")
        if name == "covered":
            return later.seen.covered
        if name == "scale":
            return later.scales()
        vars(self).update(covered=later.seen.covered, scale=later.scales(), values=later.values())
        vars(self).pop("_later", None)
        return self.values

    def __reduce__(self) -> tuple:
        """Copy the maps, not what they would be worked out of."""
        return FeatureMaps, (self.names, self.values, self.covered, self.scale)

    @property
    def _pending(self) -> _Later | None:
        """What is to work the maps out, until all of them are."""
        return vars(self).get("_later")

    @property
    def size(self) -> tuple[int, int]:
        """Height and width, px."""
        pending = self._pending
        return pending.seen.size if pending else self.covered.shape

    def __getitem__(self, name: str) -> np.ndarray:
        """Give the map of that name, (H, W)."""
        pending = self._pending
        return pending.map(name) if pending else self.values[self.names.index(name)]

    def scale_of(self, name: str) -> float:
        """Tell what the values of the map of that name were divided by; 1 where not scaled."""
        pending = self._pending
        if pending:
            return pending.scale(name)
        assert self.scale is not None  # __post_init__ sees to it
        return float(self.scale[self.names.index(name)])

    def read(self, names: Sequence[str], row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Read maps at N pixels that see the surface: (N, len(names)) float32."""
        pending = self._pending
        if pending:
            return np.stack([pending.read(name, row, column) for name in names], axis=1)
        index = np.array([self.names.index(name) for name in names])
        return self.values[index[:, None], row, column].T

    def with_curves(self, curves: Curves) -> FeatureMaps:
        """Draw the plain raster anew, of these curves; the maps as they are where they lack one."""
        if PLAIN not in self.names:
            return self
        pending = self._pending
        if pending:
            return FeatureMaps.later(pending.seen, curves)
        values, (height, width) = self.values.copy(), self.size
        values[self.names.index(PLAIN)] = plain_raster(curves, width, height)
        return replace(self, values=values)


class _Later(NamedTuple):
    """Works out maps of a surface and its curves."""

    seen: SeenSurface
    curves: Curves

    def map(self, name: str) -> np.ndarray:
        if name == PLAIN:
            return plain_raster(self.curves, *self.seen.size[::-1])
        return self.seen.map(name)

    def scale(self, name: str) -> float:
        return 1.0 if name == PLAIN else self.seen.scale(name)

    def read(self, name: str, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        if name == PLAIN:
            return self.map(name)[row, column]
        return self.seen.read(name, row, column)

    def scales(self) -> np.ndarray:
        return np.array([self.scale(name) for name in MAPS], np.float32)

    def values(self) -> np.ndarray:
        values = np.empty((len(MAPS), *self.seen.size), np.float32)
        for name, one in zip(CHANNELS, values, strict=False):
            self.seen.spread(name, one)
        values[-1] = self.map(PLAIN)
        return values


def feature_maps(surface: Surface, camera: Camera, curves: Curves, bvh: Bvh) -> FeatureMaps:
    """Measure the geometry seen at every pixel centre, by one ray each.

    The eight channels of Liu et al. 2021 (sec. 3.2): depth along the view axis from the plane of
    the eye (of one in parallel projection that stands before all), radial curvature
    (DeCarlo 2003) in its positive and negative part, its derivative, the larger and the smaller
    principal curvature, the view-dependent curvature (Judd 2007), n.v. They are interpolated
    between vertices. Each is divided by the 90th percentile of its size over the surface seen, and
    cut at +-CLIP; background 1. Then the normal on the screen (background 0) and the plain raster
    of the curves. Rays are traced, and each map is worked out, when it is first asked for.
    """
    return FeatureMaps.later(SeenSurface(surface, camera, bvh), curves)
