"""View = camera + visible curves + feature maps: one shape from one camera, and all that the networks ever see."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import distance_transform_edt

from .camera import Camera
from .chaining import tidy
from .curves import DEFAULT_SPACING, KINDS, Curves, owner, resample_curves, take_ragged
from .feature_curves import LineOptions, SurfaceCurves, ViewFields, feature_curves
from .files import replace_file
from .surface import Surface
from .visibility import Scene

FORMAT = 1
SAMPLE = 1.0  # px between the points at which a line is asked whether it is seen
FLICKER = 2.5  # px
DEPTH_STEP = 0.01  # of the depth: a jump, not a slope
CLIP = 8.0  # of the 90th percentile

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
    """One shape from one camera.

    Parameters
    ----------
    camera : Camera
    curves : Curves, visible, evenly spaced, within the canvas
    maps : FeatureMaps of the camera's size
    """

    camera: Camera
    curves: Curves
    maps: FeatureMaps

    def __post_init__(self):
        if self.maps.covered.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"View.maps are {self.maps.covered.shape[1]} x {self.maps.covered.shape[0]} px, "
                f"its camera {self.camera.width} x {self.camera.height}"
            )

    def at_curves(self, names, xy: np.ndarray | None = None) -> np.ndarray:
        """Maps read at the curves' points, or at pixels `xy` (N, 2): (N, len(names)) float32.

        A line often lies where one part of the surface hides another, or on the rim of the shape, half a pixel off. It
        belongs to the part in front, so the pixel under a point is left for the front-most one within 2 px where that
        one is clearly nearer to the eye, or where the point's own pixel shows no surface.
        """
        xy = self.curves.xy if xy is None else np.asarray(xy, np.float64)
        rows = [self.maps.names.index(name) for name in names]
        height, width = self.maps.covered.shape
        if not len(xy) or not self.maps.covered.any():
            return np.broadcast_to(np.float32([name not in NORMAL_MAPS for name in names]), (len(xy), len(rows))).copy()
        depth = np.where(self.maps.covered, self.maps["depth"], np.inf)
        column, row = (np.clip(np.floor(xy[:, i]).astype(np.int64), 0, n - 1) for i, n in enumerate((width, height)))
        r = np.arange(-2, 3)
        dy, dx = (d.ravel() for d in np.meshgrid(r, r, indexing="ij"))
        disc = dx * dx + dy * dy <= 4
        near_row = np.clip(row[:, None] + dy[disc], 0, height - 1)
        near_column = np.clip(column[:, None] + dx[disc], 0, width - 1)
        around = depth[near_row, near_column]  # (N, 13)
        front = around.argmin(axis=1)[:, None]
        own, best = depth[row, column], np.take_along_axis(around, front, 1)[:, 0]
        moved = best < own * (1.0 - DEPTH_STEP)
        row = np.where(moved, np.take_along_axis(near_row, front, 1)[:, 0], row)
        column = np.where(moved, np.take_along_axis(near_column, front, 1)[:, 0], column)
        lost = ~self.maps.covered[row, column]
        if lost.any():
            _, (to_row, to_column) = distance_transform_edt(~self.maps.covered, return_indices=True)
            row, column = np.where(lost, to_row[row, column], row), np.where(lost, to_column[row, column], column)
        return self.maps.values[np.array(rows)[:, None], row, column].T


# --------------------------------------------------------------------------------------------------------- making


def extract(
    surface: Surface,
    camera: Camera,
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    scene: Scene | None = None,
) -> View:
    """Draw a surface plainly: feature curves, hidden parts cut away, tidied, evenly spaced; and the feature maps.

    `scene` is the surface's own; give it to draw several views without building it again.
    """
    scene = scene or Scene(surface)
    fragments, strength = visible_fragments(surface, camera, feature_curves(surface, camera, options), scene)
    curves = resample_curves(tidy(fragments, strength, size=(camera.width, camera.height)), spacing)
    return View(camera, curves, feature_maps(surface, camera, curves, scene))


def view_of(
    surface: Surface, camera: Camera, curves: Curves, spacing: float = DEFAULT_SPACING, scene: Scene | None = None
) -> View:
    """A view with curves from elsewhere, clipped to the canvas and evenly spaced; the feature maps are the surface's."""
    curves = resample_curves(clip(curves, camera.width, camera.height), spacing)
    return View(camera, curves, feature_maps(surface, camera, curves, scene or Scene(surface)))


def visible_fragments(
    surface: Surface, camera: Camera, lines: SurfaceCurves, scene: Scene
) -> tuple[Curves, np.ndarray]:
    """The parts of lines on a surface that the camera sees, and the strength of each of their points (N,).

    Lines are sampled every SAMPLE px. What is seen or hidden over less than FLICKER px takes after its surroundings.
    """
    if not len(lines):
        return Curves.empty(), np.zeros(0)
    points = lines.points(surface)
    xy, depth = camera.project(points)
    which = owner(lines.offsets)
    inner = np.flatnonzero(which[:-1] == which[1:])  # segments, by their first row
    length = np.hypot(*(xy[inner + 1] - xy[inner]).T)
    ahead = (depth[inner] > 1e-6) & (depth[inner + 1] > 1e-6)
    pieces = np.where(ahead, np.clip(np.ceil(length / SAMPLE), 1, 10_000), 1).astype(np.int64)
    # nodes: every segment's start and inner samples, then each line's last point
    last = lines.offsets[1:] - 1
    count = np.ones(len(xy), np.int64)
    count[inner] = pieces
    start = np.repeat(np.arange(len(xy)), count)
    t = (np.arange(len(start)) - np.repeat(np.cumsum(count) - count, count)) / count[start]
    after = np.minimum(start + 1, last[which[start]])
    node = points[start] + t[:, None] * (points[after] - points[start])
    strength = lines.strength[start] + t * (lines.strength[after] - lines.strength[start])
    line = which[start]
    sharp = np.isin(lines.kind, [KINDS.index("crease"), KINDS.index("boundary")])[line]
    node_xy, node_depth = camera.project(node)
    size = np.array([camera.width, camera.height])
    seen = (node_depth > 1e-6) & ((node_xy >= 0) & (node_xy <= size)).all(axis=1)
    ask = np.flatnonzero(seen)
    seen[ask] = scene.seen(camera.eye, lines.face[start[ask]], node[ask], sharp[ask])
    step = np.r_[0.0, np.hypot(*np.diff(node_xy, axis=0).T)]
    for state in (False, True):  # first mend short gaps, then drop short sightings
        seen = _without_short_runs(seen, line, step, state)
    new = np.flatnonzero(np.r_[True, (seen[1:] != seen[:-1]) | (line[1:] != line[:-1])])
    end = np.r_[new[1:], len(seen)]
    good = seen[new] & (end - new >= 2)
    rows, offsets = take_ragged(np.r_[new, len(seen)], np.flatnonzero(good))
    kept = line[new[good]]
    whole = (end - new)[good] == np.bincount(line, minlength=len(lines))[kept]
    return Curves(node_xy[rows], offsets, lines.kind[kept], lines.closed[kept] & whole), strength[rows]


def _without_short_runs(seen: np.ndarray, line: np.ndarray, step: np.ndarray, state: bool) -> np.ndarray:
    """`seen` (N,) with runs of `state` that are shorter than FLICKER px turned over, but for those at a line's ends."""
    new = np.flatnonzero(np.r_[True, (seen[1:] != seen[:-1]) | (line[1:] != line[:-1])])
    end = np.r_[new[1:], len(seen)]
    along = np.cumsum(step)
    extent = along[end - 1] - along[new]
    inner = (line[np.maximum(new - 1, 0)] == line[new]) & (line[np.minimum(end, len(line) - 1)] == line[new])
    inner &= (new > 0) & (end < len(seen))
    turn = (seen[new] == state) & (extent < FLICKER) & inner
    return seen ^ np.repeat(turn, end - new)


def clip(curves: Curves, width: int, height: int) -> Curves:
    """The parts of curves inside the canvas, cut at its edge; curves of no length are dropped."""
    out, kind, closed = [], [], []
    for i in range(len(curves)):
        points = curves[i]
        if points.min() >= 0 and points[:, 0].max() <= width and points[:, 1].max() <= height:
            pieces = [points]
        else:
            pieces = _clip_line(points, width, height)
        for piece in pieces:
            if np.ptp(piece, axis=0).max() > 1e-6:
                out.append(piece)
                kind.append(curves.kind[i])
                closed.append(bool(curves.closed[i]) and piece is points)
    return Curves.from_list(out, kind, closed) if out else Curves.empty()


def _clip_line(points: np.ndarray, width: int, height: int) -> list[np.ndarray]:
    """Liang-Barsky on every segment of one polyline (n, 2)."""
    a, d = points[:-1], np.diff(points, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = -a / d, (np.array([width, height]) - a) / d
    flat = np.abs(d) < 1e-12
    outside = flat & ((a < 0) | (a > [width, height]))
    t0 = np.where(flat, 0.0, np.minimum(low, high)).max(axis=1).clip(0, 1)
    t1 = np.where(flat, 1.0, np.maximum(low, high)).min(axis=1).clip(0, 1)
    keep = (t1 > t0) & ~outside.any(axis=1)
    pieces, current = [], []
    for i in np.flatnonzero(keep):
        begin, end = a[i] + t0[i] * d[i], a[i] + t1[i] * d[i]
        if not current or t0[i] > 0 or np.abs(current[-1] - begin).max() > 1e-9:
            current = [begin]
            pieces.append(current)
        current.append(end)
    return [np.array(piece) for piece in pieces]


def feature_maps(surface: Surface, camera: Camera, curves: Curves, scene: Scene) -> FeatureMaps:
    """The geometry seen at every pixel centre, by one ray each, per-vertex quantities interpolated.

    The paper's eight channels (sec. 3.2): depth along the view axis, radial curvature (DeCarlo 2003) in its positive
    and negative part, its derivative, the larger and the smaller principal curvature, the view-dependent curvature
    (Judd 2007), n.v. Each is divided by the 90th percentile of its size over the surface seen, and cut at +-CLIP;
    background 1. Then the normal on the screen (background 0) and the plain raster of the curves.
    """
    eye = camera.eye
    hits = scene.first_hit(eye, camera.rays(camera.pixel_centres()))
    covered = hits.face >= 0
    face, bary = hits.face[covered], hits.bary[covered].astype(np.float32)
    view = ViewFields.of(surface, eye)
    square = np.maximum(view.u**2 + view.v**2, 1e-6)
    radial = view.radial_curvature(surface) / square
    right, down, _ = camera.axes
    k_high, k_low = np.maximum(surface.k1, surface.k2), np.minimum(surface.k1, surface.k2)
    fields = np.stack(
        [camera.project(surface.vertices)[1], radial, view.radial_derivative(surface), k_high, k_low,
         view.view_curvature(surface)[0], view.n_dot_v, surface.normals @ right, surface.normals @ down], axis=1
    ).astype(np.float32)  # fmt: skip
    seen = np.einsum("pi,pik->kp", bary, fields[surface.faces[face]])
    depth, radial, derivative, k_high, k_low, bend, facing, normal_x, normal_y = seen
    # an open surface may be seen from behind: its normal is taken towards the eye
    turn = np.where(facing < 0, -1.0, 1.0).astype(np.float32)
    channels = [depth, np.maximum(radial, 0), np.maximum(-radial, 0), derivative, k_high, k_low, bend, turn * facing]
    names = (*PAPER_MAPS, *NORMAL_MAPS, "plain")
    values = np.ones((len(names), len(covered)), np.float32)
    for row, channel in zip(values, channels, strict=False):
        scale = np.percentile(np.abs(channel), 90) if len(channel) else 1.0
        row[covered] = np.clip(channel / max(scale, 1e-6), -CLIP, CLIP)
    values[-3:-1] = 0.0
    values[-3, covered], values[-2, covered] = turn * normal_x, turn * normal_y
    values[-1] = plain_raster(curves, camera.width, camera.height).ravel()
    shape = (camera.height, camera.width)
    # half precision from the start: what is saved is what was used
    return FeatureMaps(names, values.astype(np.float16).reshape(-1, *shape), covered.reshape(shape))


def plain_raster(curves: Curves, width: int, height: int) -> np.ndarray:
    """Curves drawn 1 px wide, anti-aliased by 4 x 4 samples: (H, W) float32, 1 = line."""
    over = 4
    image = Image.new("L", (width * over, height * over))
    pen = ImageDraw.Draw(image)
    for i in range(len(curves)):
        pen.line((curves[i] * over).ravel().tolist(), fill=255, width=over, joint="curve")
    return np.asarray(image.reduce(over), np.float32) / 255.0


# ---------------------------------------------------------------------------------------------------------- files


def save_view(path: str | Path, view: View) -> None:
    """Write a view as .npz, whole or not at all."""
    curves, maps = view.curves, view.maps
    arrays = {
        "strokestyle_view": np.array(FORMAT),
        "camera": np.array(json.dumps(view.camera.to_dict())),
        "xy": curves.xy, "offsets": curves.offsets, "kind": curves.kind, "closed": curves.closed,
        "names": np.array(maps.names), "values": maps.values.astype(np.float16), "covered": np.packbits(maps.covered),
    }  # fmt: skip

    def write(name):
        with open(name, "wb") as file:
            np.savez_compressed(file, **arrays)

    replace_file(path, write)


def load_view(path: str | Path) -> View:
    """Read what `save_view` wrote. Raises ValueError, naming the file, on anything else; OSError where unreadable."""
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            if not hasattr(file, "files") or "strokestyle_view" not in file.files:
                raise ValueError("not a view saved by `strokestyle extract`")
            if int(file["strokestyle_view"]) > FORMAT:
                raise ValueError("written by a newer strokestyle; update, or extract it again")
            camera = Camera.from_dict(json.loads(str(file["camera"])))
            curves = Curves(file["xy"], file["offsets"], file["kind"], file["closed"])
            count, shape = camera.width * camera.height, (camera.height, camera.width)
            covered = np.unpackbits(file["covered"], count=count).astype(bool).reshape(shape)
            return View(camera, curves, FeatureMaps(tuple(map(str, file["names"])), file["values"], covered))
    except (zipfile.BadZipFile, EOFError, KeyError, zlib.error, TypeError) as error:
        raise ValueError(f"{path}: a damaged view ({error}); extract it again") from None
    except ValueError as error:
        if "pickled" in str(error):
            raise ValueError(f"{path}: not a view saved by `strokestyle extract`") from None
        raise ValueError(f"{path}: {error}") from None


def view_to_json(view: View) -> dict:
    """Camera, curves and what the surface is like along them, for other programs. Points in pixels, two decimals."""
    curves = view.curves
    fields = view.at_curves(("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y"))

    def ragged(values, digits):
        flat = np.round(np.asarray(values, np.float64), digits).tolist()
        return [flat[a:b] for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True)]

    return {
        "format": "strokestyle-curves-1",
        "camera": view.camera.to_dict(),
        "size": [view.camera.width, view.camera.height],
        "step": float(np.round(np.median(np.hypot(*np.diff(curves.xy, axis=0).T)), 2)) if len(curves) else 0.0,
        "curves": ragged(curves.xy, 2),
        "kinds": [KINDS[k] for k in curves.kind],
        "closed": curves.closed.tolist(),
        "fields": {
            name: ragged(column, 4)
            for name, column in zip(("depth", "ndotv", "curvature", "nx", "ny"), fields.T, strict=True)
        },
    }
