"""Per-pixel geometry of the visible surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..geometry.curves import Curves, counting, owner
from ..mesh.surface import Surface
from .camera import Camera
from .rays import Bvh
from .view_curvature import SomeVertices, VertexFields

CLIP = 8.0  # of the 90th percentile
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
SIDE = 4  # px, the square of pixels whose rays are traced together
TILE = 8  # px, the square that a piece of a segment is drawn in
TILE_PIECE = 4.0  # px, the longest piece that a tile holds with 1 px around it


@dataclass(frozen=True)
class FeatureMaps:
    """Per-pixel geometry of the visible surface.

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

    def __getitem__(self, name: str) -> np.ndarray:
        """Give the map of that name, (H, W)."""
        return self.values[self.names.index(name)]

    def with_curves(self, curves: Curves) -> FeatureMaps:
        """Draw the plain raster anew, of these curves; the maps as they are where they lack one."""
        if "plain" not in self.names:
            return self
        values, (height, width) = self.values.copy(), self.covered.shape
        values[self.names.index("plain")] = plain_raster(curves, width, height)
        return replace(self, values=values)


def feature_maps(surface: Surface, camera: Camera, curves: Curves, bvh: Bvh) -> FeatureMaps:
    """Measure the geometry seen at every pixel centre, by one ray each.

    The eight channels of Liu et al. 2021 (sec. 3.2): depth along the view axis from the plane of
    the eye (of one in parallel projection that stands before all), radial curvature
    (DeCarlo 2003) in its positive and negative part, its derivative, the larger and the smaller
    principal curvature, the view-dependent curvature (Judd 2007), n.v. They are interpolated
    between vertices. Each is divided by the 90th percentile of its size over the surface seen, and
    cut at +-CLIP; background 1. Then the normal on the screen (background 0) and the plain raster
    of the curves.
    """
    camera = camera.clear_of(surface.vertices)
    hits = _first_faces(surface, camera, bvh)

    def measure(vertex: np.ndarray) -> list[np.ndarray]:
        return _vertex_fields(SomeVertices.of(surface, vertex), camera)

    return _spread(_channels(_fields_at(surface, hits, measure)), camera, hits, curves)


def depth_map(surface: Surface, camera: Camera, bvh: Bvh) -> FeatureMaps:
    """Measure the depth alone, as `feature_maps` does: no curvature is worked out for it."""
    camera = camera.clear_of(surface.vertices)
    hits = _first_faces(surface, camera, bvh)

    def measure(vertex: np.ndarray) -> list[np.ndarray]:
        return [_depth(surface.vertices[vertex], camera)]

    return _spread({"depth": _fields_at(surface, hits, measure)[0]}, camera, hits)


def _spread(
    channels: dict[str, np.ndarray], camera: Camera, hits: _PixelHits, curves: Curves | None = None
) -> FeatureMaps:
    """Scale channels (P,), and spread them over the canvas; draw the raster of curves, if any."""
    names = (*channels, "plain") if curves is not None else tuple(channels)
    scale = np.ones(len(names), np.float32)
    size = camera.height, camera.width
    values = np.empty((len(names), camera.height * camera.width), np.float32)
    for i, (name, channel) in enumerate(channels.items()):
        if name not in NORMAL_MAPS:
            least = MIN_SCALE if name in ("depth", "n_dot_v") else FLAT
            scale[i] = max(_percentile(np.abs(channel), 0.9), least)
            channel = np.clip(channel / scale[i], -CLIP, CLIP)
        values[i] = 0.0 if name in NORMAL_MAPS else 1.0
        values[i, hits.pixel] = _half(channel)
    if curves is not None:
        values[-1] = plain_raster(curves, camera.width, camera.height).ravel()
    covered = np.zeros(camera.height * camera.width, bool)
    covered[hits.pixel] = True
    return FeatureMaps(names, values.reshape(-1, *size), covered.reshape(size), scale)


class _PixelHits(NamedTuple):
    """Where the surface is seen, at P pixels, row by row.

    Parameters
    ----------
    pixel : (P,) int, the number of each pixel of the canvas
    face : (P,) int, the face seen
    bary : three (P,) float32, weights of its corners
    """

    pixel: np.ndarray
    face: np.ndarray
    bary: tuple[np.ndarray, np.ndarray, np.ndarray]


def _fields_at(
    surface: Surface, hits: _PixelHits, measure: Callable[[np.ndarray], list[np.ndarray]]
) -> list[np.ndarray]:
    """Interpolate the fields that `measure` gives at vertices at the pixels that see them, (P,)."""
    corners = [surface.faces[:, i][hits.face] for i in range(3)]
    seen = np.zeros(len(surface.vertices), bool)
    for corner in corners:
        seen[corner] = True
    vertex = np.flatnonzero(seen)
    number = np.empty(len(seen), np.int64)
    number[vertex] = np.arange(len(vertex))
    corners = [number[corner] for corner in corners]
    fields = measure(vertex)
    # field by field, which stays in the processor's cache
    return [
        sum(weight * field[corner] for weight, corner in zip(hits.bary, corners, strict=True))
        for field in fields
    ]


def _vertex_fields(vertices: SomeVertices, camera: Camera) -> list[np.ndarray]:
    """Measure at some vertices what `_channels` makes the maps of, nine of (n,) float32."""
    view = VertexFields.at(vertices, camera.viewpoint)
    radial = view.radial_curvature(vertices) / np.maximum(view.u**2 + view.v**2, 1e-6)
    right, down, _ = camera.axes
    fields = (
        _depth(vertices.vertices, camera),
        radial,
        view.radial_derivative(vertices),
        np.maximum(vertices.k1, vertices.k2),
        np.minimum(vertices.k1, vertices.k2),
        view.view_curvature(vertices)[0],
        view.n_dot_v,
        vertices.normals @ right,
        vertices.normals @ down,
    )
    return [field.astype(np.float32) for field in fields]


def _depth(points: np.ndarray, camera: Camera) -> np.ndarray:
    return camera.project(points)[1].astype(np.float32)


def _channels(seen: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Make the maps' channels (P,), not yet scaled, of vertex fields at the pixels, nine (P,)."""
    depth, radial, derivative, k_high, k_low, bend, facing, normal_x, normal_y = seen
    # an open surface may be seen from behind: its normal is taken towards the eye
    turn = np.where(facing < 0, -1.0, 1.0).astype(np.float32)
    channels = (
        depth,
        np.maximum(radial, 0),
        np.maximum(-radial, 0),
        derivative,
        k_high,
        k_low,
        bend,
        turn * facing,
        turn * normal_x,
        turn * normal_y,
    )
    return dict(zip((*NEURAL_STROKES_MAPS, *NORMAL_MAPS), channels, strict=True))


def _first_faces(surface: Surface, camera: Camera, bvh: Bvh) -> _PixelHits:
    """Find where the surface is seen, by one ray through the centre of each pixel."""
    columns, rows = _window(surface, camera)
    wide, high = columns[1] - columns[0], rows[1] - rows[0]
    across, down = -(-wide // SIDE), -(-high // SIDE)
    origins, rays = _pixel_rays(camera, columns[0], rows[0], across, down)
    found = bvh.first_faces(origins.reshape(-1, 3), rays.reshape(-1, 3))

    def by_rows(values: np.ndarray) -> np.ndarray:
        tiles = values.reshape(down, across, SIDE, SIDE).swapaxes(1, 2)
        return tiles.reshape(down * SIDE, across * SIDE)[:high, :wide]

    face = by_rows(found.face)
    row, column = np.nonzero(face >= 0)
    u, v = (by_rows(values)[row, column] for values in (found.u, found.v))
    pixel = (row + rows[0]) * camera.width + (column + columns[0])
    return _PixelHits(pixel, face[row, column], (1.0 - u - v, u, v))


def _pixel_rays(
    camera: Camera, column: int, row: int, across: int, down: int
) -> tuple[np.ndarray, np.ndarray]:
    """Cast rays through the centres of pixels, in squares of SIDE pixels from `column`, `row` on.

    Rays are traced several at a time, and squares of them hit the same. Origins, and directions
    (down, across, SIDE, SIDE, 3) float32 of no set length, `across` and `down` squares. Origins are
    one for each, or in perspective one in all, the eye.
    """
    right, downwards, forward = camera.axes
    x = np.arange(across * SIDE).reshape(1, across, 1, SIDE, 1) + (column + 0.5)
    y = np.arange(down * SIDE).reshape(down, 1, SIDE, 1, 1) + (row + 0.5)
    x, y = (x - 0.5 * camera.width) * right, (y - 0.5 * camera.height) * downwards
    if camera.extent is None:
        return camera.eye, (x + (y + camera.focal * forward)).astype(np.float32)
    origins = x / camera.focal + (y / camera.focal + camera.eye)
    return origins, np.broadcast_to(forward.astype(np.float32), origins.shape)


def _window(surface: Surface, camera: Camera) -> tuple[tuple[int, int], tuple[int, int]]:
    """Bound the pixels whose rays can hit: first column and behind the last, rows alike."""
    size = np.array([camera.width, camera.height])
    xy, depth = camera.project(surface.vertices)
    if (
        camera.extent is None and depth.min() <= 1e-6
    ):  # some of it beside or behind the eye: its pixels mean nothing
        return (0, camera.width), (0, camera.height)
    left, top = (int(v) for v in np.clip(np.floor(xy.min(axis=0)) - 1, 0, size))
    right, bottom = (int(v) for v in np.clip(np.ceil(xy.max(axis=0)) + 1, 0, size))
    return (left, right), (top, bottom)


def _percentile(values: np.ndarray, q: float) -> float:
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


def _half(values: np.ndarray) -> np.ndarray:
    """Round to half precision from the start, so that what is saved is what was used."""
    return values.astype(np.float16).astype(np.float32)


def _may_meet(a: np.ndarray, b: np.ndarray, width: int, height: int) -> np.ndarray:
    """Tell whether the box of each segment (S, 2) to (S, 2), grown by 1 px, meets the canvas."""
    return ((np.maximum(a, b) > -1.0) & (np.minimum(a, b) < np.array([width, height]) + 1.0)).all(
        axis=1
    )


def plain_raster(curves: Curves, width: int, height: int) -> np.ndarray:
    """Draw curves 1 px wide, (H, W) float32: 1 on the line, 0 at a pixel centre 1 px from it.

    In half precision, as all maps are.
    """
    out = np.zeros((height, width), np.float32)
    if not len(curves):
        return out
    which = owner(curves.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    first = first[_may_meet(curves.xy[first], curves.xy[first + 1], width, height)]
    start, step = _short_pieces(curves.xy[first], curves.xy[first + 1])
    corner = np.floor(np.minimum(start, start + step) - 1.0).astype(np.int64)
    x = corner[:, 0, None, None] + np.arange(TILE)  # (S, 1, TILE)
    y = corner[:, 1, None, None] + np.arange(TILE)[:, None]  # (S, TILE, 1)
    ink = _tile_ink(x, y, start, step)
    good = (ink > 0.0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    np.maximum.at(out.ravel(), (y * width + x)[good], _half(ink[good].astype(np.float32)))
    return out


def _short_pieces(start: np.ndarray, stop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut segments into pieces of at most TILE_PIECE px: starts and steps to their ends, (S, 2)."""
    step = stop - start
    count = np.maximum(np.ceil(np.hypot(*step.T) / TILE_PIECE), 1).astype(np.int64)
    step = np.repeat(step / count[:, None], count, axis=0)
    start = np.repeat(start, count, axis=0) + counting(count)[:, None] * step
    return start, step


def _tile_ink(x: np.ndarray, y: np.ndarray, start: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Measure the ink of pieces (S, 2) in their tiles (S, TILE, TILE): 1 less the distance in px.

    `x` (S, 1, TILE) and `y` (S, TILE, 1) are the columns and rows of the tiles' pixels.
    """
    from_x, from_y = x + 0.5 - start[:, 0, None, None], y + 0.5 - start[:, 1, None, None]
    dx, dy = step[:, 0, None, None], step[:, 1, None, None]
    t = (from_x * dx + from_y * dy) / np.maximum(dx * dx + dy * dy, 1e-12)
    t = np.clip(t, 0.0, 1.0)
    return 1.0 - np.hypot(from_x - t * dx, from_y - t * dy)
