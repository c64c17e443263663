"""What a camera sees of a surface at its pixels: measured channel by channel, when asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..mesh.surface import Surface
from .camera import Camera
from .pixel_hits import PixelHits, first_faces
from .rays import Bvh
from .view_curvature import SomeVertices, VertexFields

CLIP = 8.0  # of the 90th percentile
SHARE = 0.9  # of the surface seen, whose values lie below the scale
# The least scale of a curvature: on a box, where more than 90 % is flat, the rest must not become
# infinite.
FLAT = 0.1
MIN_SCALE = 1e-6  # of depth and n.v

# The eight geometry channels of Liu et al. 2021 (its authors split the radial curvature by sign).
NEURAL_STROKES_MAPS = (
    "depth",
    "radial_curvature_positive",
    "radial_curvature_negative",
    "radial_curvature_derivative",
    "max_curvature",
    "min_curvature",
    "view_curvature",
    "n_dot_v",
)

# x right, y down, components of the unit normal on the screen, not rescaled; background 0
NORMAL_MAPS = ("normal_x", "normal_y")
CHANNELS = (*NEURAL_STROKES_MAPS, *NORMAL_MAPS)


def background_of(name: str) -> float:
    """Give the value of a channel where no surface is seen."""
    return 0.0 if name in NORMAL_MAPS else 1.0


class SeenSurface:
    """What a camera sees of a surface at its P pixels that see any, in CHANNELS.

    Nothing is worked out before it is asked for: rays are traced once, and each channel is measured
    once, of the vertices seen.
    """

    def __init__(self, surface: Surface, camera: Camera, bvh: Bvh) -> None:
        self._surface, self._given, self._bvh = surface, camera, bvh
        self._channels: dict[str, tuple[np.ndarray, float]] = {}
        self._maps: dict[str, np.ndarray] = {}

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the canvas, px."""
        return self._given.height, self._given.width

    @cached_property
    def covered(self) -> np.ndarray:
        """Where the surface is seen, (H, W) bool."""
        covered = np.zeros(self.size, bool)
        covered.ravel()[self._hits.pixel] = True
        return covered

    def scale(self, name: str) -> float:
        """Tell what the values of a channel were divided by; 1 where it was not scaled."""
        return self._channel(name)[1]

    def map(self, name: str) -> np.ndarray:
        """Spread a channel over the canvas, (H, W) float32."""
        if name not in self._maps:
            self._maps[name] = np.empty(self.size, np.float32)
            self.spread(name, self._maps[name])
        return self._maps[name]

    def spread(self, name: str, out: np.ndarray) -> None:
        """Spread a channel over the canvas `out`, (H, W) float32 in one piece."""
        out.fill(background_of(name))
        out.ravel()[self._hits.pixel] = self._channel(name)[0]

    def read(self, name: str, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Read a channel at N pixels that see the surface: (N,) float32."""
        return self._channel(name)[0][self._place[row, column]].astype(np.float32)

    def _channel(self, name: str) -> tuple[np.ndarray, float]:
        """Give a channel at the pixels, (P,) float16, and what its values were divided by."""
        if name not in CHANNELS:
            raise ValueError(f"no feature map is named {name!r}: there are {', '.join(CHANNELS)}")
        if name not in self._channels:
            names = next(names for names in _MEASURES if name in names)
            for one, values in zip(names, _MEASURES[names](self), strict=True):
                self._channels[one] = _scaled(one, values)
        return self._channels[name]

    @cached_property
    def _camera(self) -> Camera:
        """The camera, its eye before all of the surface."""
        return self._given.clear_of(self._surface.vertices)

    @cached_property
    def _hits(self) -> PixelHits:
        return first_faces(self._surface, self._camera, self._bvh)

    @cached_property
    def _place(self) -> np.ndarray:
        """The place of each pixel among those that see the surface, (H, W) int32; any elsewhere."""
        place = np.zeros(self.size, np.int32)
        place.ravel()[self._hits.pixel] = np.arange(len(self._hits.pixel), dtype=np.int32)
        return place

    @cached_property
    def _view(self) -> VertexFields:
        """The vertices seen, (n,), as the eye sees them."""
        seen = SomeVertices(self._surface, self._hits.vertex)
        return VertexFields.at(seen, self._camera.viewpoint)

    def _at_pixels(self, field: np.ndarray) -> np.ndarray:
        """Interpolate a field at the vertices seen, (n,), at the pixels, (P,) float32."""
        field = field.astype(np.float32)
        total: np.ndarray = np.zeros(1, np.float32)
        for weight, corner in zip(self._hits.bary, self._hits.corner, strict=True):
            total = total + weight * field.take(corner)
        return total

    # -------------------------------- channels, not yet scaled, some of which go together

    def _depth(self) -> list[np.ndarray]:
        return [self._at_pixels(self._camera.depth(self._view.seen.vertices))]

    def _radial_curvature(self) -> list[np.ndarray]:
        view = self._view
        along = np.maximum(view.u**2 + view.v**2, 1e-6)
        radial = self._at_pixels(view.radial_curvature(view.seen) / along)
        return [np.maximum(radial, 0), np.maximum(-radial, 0)]

    def _radial_derivative(self) -> list[np.ndarray]:
        return [self._at_pixels(self._view.radial_derivative(self._view.seen))]

    def _principal_curvatures(self) -> list[np.ndarray]:
        k1, k2 = self._view.seen.k1, self._view.seen.k2
        return [self._at_pixels(k) for k in (np.maximum(k1, k2), np.minimum(k1, k2))]

    def _view_curvature(self) -> list[np.ndarray]:
        return [self._at_pixels(self._view.largest_view_curvature(self._view.seen))]

    def _normal(self) -> list[np.ndarray]:
        right, down, _ = self._camera.axes
        normals, facing = self._view.seen.normals, self._at_pixels(self._view.n_dot_v)
        # an open surface may be seen from behind: its normal is taken towards the eye
        turn = np.where(facing < 0, np.float32(-1.0), np.float32(1.0))
        fields = (self._at_pixels(normals @ axis) for axis in (right, down))
        return [turn * field for field in (facing, *fields)]


_MEASURES: dict[tuple[str, ...], Callable[[SeenSurface], list[np.ndarray]]] = {
    ("depth",): SeenSurface._depth,
    CHANNELS[1:3]: SeenSurface._radial_curvature,
    ("radial_curvature_derivative",): SeenSurface._radial_derivative,
    ("max_curvature", "min_curvature"): SeenSurface._principal_curvatures,
    ("view_curvature",): SeenSurface._view_curvature,
    ("n_dot_v", *NORMAL_MAPS): SeenSurface._normal,
}


def _scaled(name: str, values: np.ndarray) -> tuple[np.ndarray, float]:
    """Scale a channel's values (P,), and round them: (P,) float16, and what they were divided by.

    They have half precision from the start, so that what is saved is what was used.
    """
    scale = np.float32(1.0)
    if name not in NORMAL_MAPS:
        least = MIN_SCALE if name in ("depth", "n_dot_v") else FLAT
        scale = np.float32(max(percentile(np.abs(values), SHARE), least))
        values = np.clip(values / scale, -CLIP, CLIP)
    if not np.isfinite(values.sum()):
        raise ValueError(f"the surface's {name} is not finite")
    return values.astype(np.float16), float(scale)


def percentile(values: np.ndarray, q: float) -> float:
    """Find the value that a share q of them does not exceed; 1 where there are none.

    `values` : (N,) float32, from 0 on
    """
    if not len(values):
        return 1.0
    k = int(q * (len(values) - 1))
    # numbers that are not negative are in the order of their bits: of the first 16, then of all
    first = values.view(np.int32) >> 16
    up_to = np.cumsum(np.bincount(first))
    at = int(np.searchsorted(up_to, k, "right"))
    alike = values[first == at]
    k -= int(up_to[at]) - len(alike)
    return float(np.partition(alike, k)[k])
