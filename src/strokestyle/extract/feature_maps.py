"""Per-pixel geometry of the visible surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import Curves, counting, owner
from ..mesh.surface import Surface
from .camera import Camera
from .rays import Bvh
from .view_curvature import ViewFields

CLIP = 8.0  # of the 90th percentile
FLAT = 0.1  # the least scale of a curvature: on a box, where more than 90 % is flat, the rest must not become infinite

# The paper's eight geometry channels (its authors split the radial curvature by sign), then the screen-space normal.
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

NORMAL_MAPS = (
    "normal_x",
    "normal_y",
)  # x right, y down, components of the unit normal, not rescaled; background 0


@dataclass(frozen=True)
class FeatureMaps:
    """Per-pixel geometry of the visible surface.

    Parameters
    ----------
    names : K names: PAPER_MAPS, NORMAL_MAPS, "plain"
    values : (K, H, W) float32. PAPER_MAPS are scaled by their 90th percentile, background 1.
        "plain" is the raster of the curves, 1 px wide, 1 = line.
    covered : (H, W) bool, where the surface is seen
    scale : (K,) float32, what the values of each map were divided by; 1 where it was not scaled
    """

    names: tuple[str, ...]
    values: np.ndarray
    covered: np.ndarray
    scale: np.ndarray | None = None

    def __post_init__(self):
        values, covered = np.asarray(self.values, np.float32), np.asarray(self.covered, bool)
        scale = (
            np.ones(len(self.names), np.float32)
            if self.scale is None
            else np.asarray(self.scale, np.float32)
        )
        if values.ndim != 3 or len(values) != len(self.names) or covered.shape != values.shape[1:]:
            raise ValueError(
                f"FeatureMaps.values must have shape ({len(self.names)}, H, W) like covered (H, W), "
                f"got {values.shape} and {covered.shape}"
            )
        if scale.shape != (len(self.names),):
            raise ValueError(
                f"FeatureMaps.scale must have shape ({len(self.names)},), got {scale.shape}"
            )
        if not (np.isfinite(values).all() and np.isfinite(scale).all()):
            raise ValueError("FeatureMaps holds values that are not finite")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "covered", covered)
        object.__setattr__(self, "scale", scale)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[self.names.index(name)]


def feature_maps(surface: Surface, camera: Camera, curves: Curves, scene: Bvh) -> FeatureMaps:
    """The geometry seen at every pixel centre, by one ray each, per-vertex quantities interpolated.

    The paper's eight channels (sec. 3.2): depth along the view axis, radial curvature (DeCarlo 2003) in its positive
    and negative part, its derivative, the larger and the smaller principal curvature, the view-dependent curvature
    (Judd 2007), n.v. Each is divided by the 90th percentile of its size over the surface seen, and cut at +-CLIP;
    background 1. Then the normal on the screen (background 0) and the plain raster of the curves.
    """
    shape = (camera.height, camera.width)
    covered, face, bary = _first_faces(surface, camera, scene)
    view = ViewFields.of(surface, camera.eye)
    radial = view.radial_curvature(surface) / np.maximum(view.u**2 + view.v**2, 1e-6)
    right, down, _ = camera.axes
    k_high, k_low = np.maximum(surface.k1, surface.k2), np.minimum(surface.k1, surface.k2)
    fields = np.stack(
        [camera.project(surface.vertices)[1], radial, view.radial_derivative(surface), k_high, k_low,
         view.view_curvature(surface)[0], view.n_dot_v, surface.normals @ right, surface.normals @ down], axis=1
    ).astype(np.float32)  # fmt: skip
    corners = surface.faces[face]
    seen = sum(bary[:, i, None] * fields[corners[:, i]] for i in range(3)).T  # (9, pixels seen)
    depth, radial, derivative, k_high, k_low, bend, facing, normal_x, normal_y = seen
    # an open surface may be seen from behind: its normal is taken towards the eye
    turn = np.where(facing < 0, -1.0, 1.0).astype(np.float32)
    channels = [
        depth,
        np.maximum(radial, 0),
        np.maximum(-radial, 0),
        derivative,
        k_high,
        k_low,
        bend,
        turn * facing,
    ]
    names = (*NEURAL_STROKES_MAPS, *NORMAL_MAPS, "plain")
    scale = np.ones(len(names), np.float32)
    values = np.ones((len(names), *shape), np.float32)
    values[[names.index(name) for name in NORMAL_MAPS]] = 0.0
    for i, channel in enumerate(channels):
        scale[i] = max(
            _percentile(np.abs(channel), 0.9), 1e-6 if names[i] in ("depth", "n_dot_v") else FLAT
        )
        channels[i] = np.clip(channel / scale[i], -CLIP, CLIP)
    for row, channel in zip(values, [*channels, turn * normal_x, turn * normal_y], strict=False):
        row[covered] = _half(channel)
    values[-1] = _half(plain_raster(curves, camera.width, camera.height))
    return FeatureMaps(names, values, covered, scale)


def _first_faces(
    surface: Surface, camera: Camera, scene: Bvh
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the surface is seen (H, W), and there, row by row, its face (P,) and the place in it (P, 3) float32."""
    covered = np.zeros((camera.height, camera.width), bool)
    xy, depth = camera.project(surface.vertices)
    left, top, last_column, last_row = 0, 0, camera.width, camera.height
    if depth.min() > 1e-6:  # rays only where they can hit
        left, top = (
            int(v) for v in np.clip(np.floor(xy.min(axis=0)) - 1, 0, [camera.width, camera.height])
        )
        last_column, last_row = (
            int(v) for v in np.clip(np.ceil(xy.max(axis=0)) + 1, 0, [camera.width, camera.height])
        )
    right, down, forward = camera.axes
    x = (np.arange(left, last_column) + 0.5 - 0.5 * camera.width)[None, :, None] * right
    y = (np.arange(top, last_row) + 0.5 - 0.5 * camera.height)[:, None, None] * down
    rays = (x + (y + camera.focal * forward)).astype(np.float32).reshape(-1, 3)
    hits = scene.first_hit(camera.eye, rays)
    hit = hits.face >= 0
    covered[top:last_row, left:last_column] = hit.reshape(last_row - top, last_column - left)
    return covered, hits.face[hit], hits.bary[hit].astype(np.float32)


def _percentile(values: np.ndarray, q: float) -> float:
    """The value that a share q of them does not exceed; 1 where there are none."""
    if not len(values):
        return 1.0
    k = int(q * (len(values) - 1))
    return float(np.partition(values, k)[k])


def _half(values: np.ndarray) -> np.ndarray:
    """Rounded to half precision from the start, so that what is saved is what was used."""
    return values.astype(np.float16).astype(np.float32)


def _may_meet(a: np.ndarray, b: np.ndarray, width: int, height: int) -> np.ndarray:
    """Whether the box of each segment, grown by 1 px, meets the canvas."""
    return ((np.maximum(a, b) > -1.0) & (np.minimum(a, b) < np.array([width, height]) + 1.0)).all(
        axis=1
    )


def plain_raster(curves: Curves, width: int, height: int) -> np.ndarray:
    """Curves drawn 1 px wide, (H, W) float32: 1 on the line, falling to 0 at a pixel centre 1 px from it."""
    out = np.zeros((height, width), np.float32)
    if not len(curves):
        return out
    which = owner(curves.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    first = first[_may_meet(curves.xy[first], curves.xy[first + 1], width, height)]
    d = curves.xy[first + 1] - curves.xy[first]
    count = np.maximum(np.ceil(np.hypot(*d.T) / 4.0), 1).astype(
        np.int64
    )  # 8 x 8 pixels hold 4 px and their margin
    d = np.repeat(d / count[:, None], count, axis=0)
    k = counting(count)
    a = np.repeat(curves.xy[first], count, axis=0) + k[:, None] * d
    corner = np.floor(np.minimum(a, a + d) - 1.0).astype(np.int64)
    step = np.arange(8)
    x, y = (
        corner[:, 0, None, None] + step,
        corner[:, 1, None, None] + step[:, None],
    )  # (S, 1, 8), (S, 8, 1)
    rx, ry = x + 0.5 - a[:, 0, None, None], y + 0.5 - a[:, 1, None, None]
    dx, dy = d[:, 0, None, None], d[:, 1, None, None]
    t = np.clip((rx * dx + ry * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    ink = 1.0 - np.hypot(rx - t * dx, ry - t * dy)  # (S, 8, 8)
    good = (ink > 0.0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    np.maximum.at(out.ravel(), (y * width + x)[good], ink[good].astype(np.float32))
    return out
