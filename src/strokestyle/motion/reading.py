"""Read off the surface what a style asks of the points of strokes, without feature maps."""

from __future__ import annotations

import numpy as np

from ..extract.rays import Bvh
from ..extract.seen_surface import CLIP, FLAT, MIN_SCALE, SHARE
from ..extract.surface_curves import interpolate_on_faces
from ..extract.view import DEPTH_STEP
from ..extract.view_curvature import SomeVertices, VertexFields
from ..geometry.curves import is_kind, owner, tangents
from ..render.features import BOTH_SIDES, OUTWARD_SIGMA, along_strokes
from ..render.plan import Planned
from .frames import Shot
from .places import Places

GRID = 8  # px of a canvas of 768 between the rays that tell the scale of quantities


def surface_scale(shot: Shot, bvh: Bvh) -> np.ndarray:
    """Measure what depth, n.v and view-dependent curvature are divided by, (3,).

    That is the 90th percentile over the surface seen, as in feature maps, of a coarse grid of rays.
    """
    camera = shot.camera
    step = GRID * max(camera.width, camera.height) / 768.0
    x, y = np.meshgrid(
        np.arange(step / 2, camera.width, step), np.arange(step / 2, camera.height, step)
    )
    values, hit = _look(shot, bvh, np.stack([x.ravel(), y.ravel()], axis=1))
    least = np.array([MIN_SCALE, MIN_SCALE, FLAT])
    if not hit.any():
        return np.ones(3)
    return np.maximum(np.quantile(np.abs(values[hit, :3]), SHARE, axis=0), least)


def read_surface(
    shot: Shot, bvh: Bvh, planned: Planned, places: Places, scale: np.ndarray, spacing: float
) -> np.ndarray:
    """Read SURFACE at points of strokes, (N, 5) float64, as `surface_at` reads it off maps.

    It is the mean of a line's two sides, of rays that meet the surface that the line belongs to;
    where none does, it is that of the place itself. On an occluding contour n.v is 0, and the
    normal in the image lies at right angles to the line, out of the shape.

    Parameters
    ----------
    planned : strokes of N points, px of the style's canvas
    places : of their points
    scale : (3,), of `surface_scale`
    spacing : px between the points
    """
    if not len(planned):
        return np.zeros((0, 5))
    along = tangents(planned.xy, planned.offsets)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    xy, depth = places.seen(shot)
    own = _values(shot, places.face, places.bary, depth)
    total, count = np.zeros_like(own), np.zeros(len(own))
    for k in BOTH_SIDES:
        values, hit = _look(shot, bvh, xy + k * across)
        hit &= np.abs(values[:, 0] - own[:, 0]) <= DEPTH_STEP * np.abs(own[:, 0])
        total += np.where(hit[:, None], _scaled(values, scale), 0.0)
        count += hit
    out = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], _scaled(own, scale))
    outward = (out[:, 3:] * across).sum(axis=1)
    side = np.where(along_strokes(outward, planned.offsets, OUTWARD_SIGMA, spacing) < 0, -1.0, 1.0)
    contour = is_kind(planned.kind, ("contour",))[owner(planned.offsets)]
    out[contour, 1] = 0.0
    out[contour, 3:] = (side[:, None] * across)[contour]
    return out


def _look(shot: Shot, bvh: Bvh, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read the surface seen at pixels (N, 2): values (N, 5), and whether there is one, (N,)."""
    camera = shot.camera.clear_of(shot.surface.vertices)
    rays, origins = camera.rays(xy), camera.origins(xy)
    found = bvh.first_hit(origins, rays.astype(np.float32))
    hit = found.face >= 0
    values = np.zeros((len(xy), 5))
    face, bary = found.face[hit], found.bary[hit]
    point = interpolate_on_faces(shot.surface, face, bary, shot.surface.vertices)
    values[hit] = _values(shot, face, bary, camera.project(point)[1])
    return values, hit


def _values(shot: Shot, face: np.ndarray, bary: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Measure depth, n.v, view-dependent curvature and the normal on the screen, (N, 5)."""
    corner = shot.surface.faces[face]
    used, index = np.unique(corner, return_inverse=True)
    fields = _vertex_fields(shot, used)
    read = np.einsum("ni,nik->nk", bary, fields[index.reshape(corner.shape)])
    read[read[:, 0] < 0.0, :] *= np.array([-1.0, 1.0, -1.0, -1.0])  # seen from behind
    return np.column_stack([depth, read])


def _vertex_fields(shot: Shot, vertex: np.ndarray) -> np.ndarray:
    """Measure n.v, view-dependent curvature and the normal on the screen of vertices, (n, 4)."""
    part = SomeVertices(shot.surface, vertex)
    view = VertexFields.at(part, shot.camera.viewpoint)
    right, down, _ = shot.camera.axes
    bend = view.largest_view_curvature(part)
    return np.stack([view.n_dot_v, bend, part.normals @ right, part.normals @ down], axis=1)


def _scaled(values: np.ndarray, scale: np.ndarray) -> np.ndarray:
    values = values.copy()
    values[:, :3] = np.clip(values[:, :3] / scale, -CLIP, CLIP)
    return values
