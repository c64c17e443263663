"""Extract a view: lines, hidden parts cut away, tidied, evenly spaced, and the feature maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.curves import (
    DEFAULT_SPACING,
    Curves,
    arc_length,
    clip,
    clip_with_source,
    is_kind,
    owner,
    resample_curves,
    resample_with_source,
    runs,
)
from ..geometry.kinds import HARD_KINDS
from ..geometry.parts import Parts, part_name
from ..mesh.surface import Surface
from .camera import Camera
from .feature_maps import NEURAL_STROKES_MAPS, NORMAL_MAPS, FeatureMaps, feature_maps, plain_raster
from .line_options import LineOptions
from .lines import SurfaceLines
from .rays import Bvh
from .tidy import subtract_parallel, tidy_with_source
from .view import View
from .visible import look_along

LOOSE = 50.0  # px, an intersection that is shorter may go with the lines that it is chained to
RIM = (
    1.5,
    5.0,
)  # px round a point of a line from elsewhere, in which the shape is sought that it was drawn for


def extract_view(
    surface: Surface,
    camera: Camera,
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    hidden: bool = False,
    lines: SurfaceLines | None = None,
) -> View:
    """Draw a surface plainly: feature curves, hidden parts cut away, tidied, evenly spaced; and the feature maps.

    Parameters
    ----------
    options : which lines
    spacing : px between the points of the curves
    hidden : also the hidden parts, of the kinds in HARD_KINDS: those describe the shape, the others
        only how its front looks
    lines : the lines of this surface and these options, where several views are drawn of them

    Raises
    ------
    ValueError
        where `lines` are those of another surface, or other lines than `options` ask for.
    """
    lines = _lines_of(surface, options, lines)
    size = (camera.width, camera.height)
    found, unseen = lines.split_from(camera, hidden)
    sight = look_along(surface, camera, found, lines.bvh)
    fragments, strength, face = sight.fragments(found, sight.seen)
    strokes, of_fragment = tidy_with_source(fragments, strength, size)
    curves, of_stroke = resample_with_source(strokes, spacing)
    faces = faces_of(surface, curves, fragments, face, of_fragment[of_stroke])
    behind, hidden_faces = Curves.empty(), None
    if hidden:
        hard = is_kind(found.kind, HARD_KINDS)[sight.line]
        away = look_along(surface, camera, unseen, None)
        parts = sight.fragments(found, sight.hidden & hard), away.fragments(unseen, away.hidden)
        whole = Curves.concatenate([curves for curves, _, _ in parts])
        face = np.concatenate([face for _, _, face in parts])
        apart, of_whole = subtract_parallel(whole, strokes, size)
        strokes, of_apart = tidy_with_source(apart, np.ones(len(apart.xy)), size)
        behind, of_stroke = resample_with_source(strokes, spacing)
        hidden_faces = faces_of(surface, behind, whole, face, of_whole[of_apart[of_stroke]])
    view = View(camera, curves, feature_maps(surface, camera, curves, lines.bvh), behind)
    return _with_parts(view, surface, faces, hidden_faces)


def _lines_of(
    surface: Surface, options: LineOptions | None, lines: SurfaceLines | None
) -> SurfaceLines:
    """The lines given, where they are those that are asked for; else new ones."""
    if lines is None:
        return SurfaceLines(surface, options or LineOptions())
    if lines.surface is not surface or options not in (None, lines.options):
        raise ValueError("lines must be SurfaceLines of the same surface and options")
    return lines


def view_of_curves(
    surface: Surface,
    camera: Camera,
    curves: Curves,
    spacing: float = DEFAULT_SPACING,
    bvh: Bvh | None = None,
) -> View:
    """See a surface behind curves from elsewhere, clipped to the canvas and evenly spaced.

    The surface gives maps and parts. `bvh` is its own, where several views are drawn.
    """
    curves = resample_curves(clip(curves, camera.width, camera.height), spacing)
    bvh = bvh or Bvh(surface)
    view = View(camera, curves, feature_maps(surface, camera, curves, bvh))
    return _with_parts(view, surface, _faces_in_front(surface, camera, curves.xy, bvh))


def view_of_lines(
    curves: Curves,
    width: int,
    height: int,
    spacing: float = DEFAULT_SPACING,
    parts: Parts | None = None,
) -> View:
    """Lines without a shape: no surface is seen anywhere, and the maps are those of the background.

    `parts` : the named part that each of the curves (C,) belongs to
    """
    curves, source = clip_with_source(curves, width, height)
    curves = resample_curves(curves, spacing)
    names = (*NEURAL_STROKES_MAPS, *NORMAL_MAPS, "plain")
    values = np.ones((len(names), height, width), np.float32)
    values[len(NEURAL_STROKES_MAPS) : -1] = 0.0
    values[-1] = plain_raster(curves, width, height)
    camera = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0, width, height)
    of_points = None if parts is None else parts.take(source[owner(curves.offsets)])
    return View(
        camera, curves, FeatureMaps(names, values, np.zeros((height, width), bool)), parts=of_points
    )


def _with_parts(
    view: View, surface: Surface, faces: np.ndarray | None, hidden_faces: np.ndarray | None = None
) -> View:
    """The view with the parts of its curves' points, which lie on `faces` (N,), -1 where they lie on none.

    Parts are put in order by the mean depth of their visible lines, so that of two that meet the nearer is painted
    last.
    """
    if faces is None:
        return view
    name = [part_name(text) for text in surface.part_names]
    names = [text for text in dict.fromkeys(name) if text]
    number = {text: i for i, text in enumerate(names)} | {"": -1}
    of_part = np.array([number[text] for text in name])
    hidden_faces = np.zeros(0, np.int64) if hidden_faces is None else hidden_faces
    index, hidden = (np.where(f < 0, -1, of_part[surface.part[f]]) for f in (faces, hidden_faces))
    depth = view.at_curves(["depth"])[:, 0]
    count, total = (np.bincount(index + 1, weight, len(names) + 1)[1:] for weight in (None, depth))
    order = np.argsort(-np.where(count > 0, total / np.maximum(count, 1), np.inf), kind="stable")
    place = np.r_[np.argsort(order), -1]  # of -1 it is -1
    parts, behind = (Parts(tuple(names[i] for i in order), place[rows]) for rows in (index, hidden))
    return replace(view, parts=parts, hidden_parts=behind if len(view.hidden) else None)


def _has_parts(surface: Surface) -> bool:
    return len(surface.part_names) > 1 and len({part_name(text) for text in surface.part_names}) > 1


def faces_of(
    surface: Surface, curves: Curves, fragments: Curves, face: np.ndarray, source: np.ndarray
) -> np.ndarray | None:
    """Tell the face (N,) that each point of curves belongs to, which comes from row `source` of fragments.

    The points of fragments lie on `face` (M,). An intersection is of two parts, so that a stretch
    of it shorter than LOOSE goes with the rest of a curve that it is chained to. None where faces
    tell nothing.
    """
    if not _has_parts(surface):
        return None
    if not len(curves):
        return np.full(0, -1)
    crossing = is_kind(fragments.kind, ("intersection",))[owner(fragments.offsets)]
    loose, curve = crossing[source], owner(curves.offsets)
    start, along = runs(loose, curve), arc_length(curves.xy, curves.offsets)
    short = along[start[1:] - 1] - along[start[:-1]] < LOOSE
    loose = loose & np.repeat(short, np.diff(start))
    here, firm = np.arange(len(source)), np.flatnonzero(~loose)
    if not len(firm):
        return face[source]
    after = np.searchsorted(firm, here)
    # the firm points before and after each point
    sides = firm[np.clip([after - 1, after], 0, len(firm) - 1)]
    away = np.where(curve[sides] == curve, np.abs(sides - here), len(source))
    nearest = np.where(away[0] <= away[1], *sides)
    return face[source[np.where(away.min(axis=0) < len(source), nearest, here)]]


def _faces_in_front(
    surface: Surface, camera: Camera, xy: np.ndarray, scene: Bvh
) -> np.ndarray | None:
    """The face (N,) nearest to the eye round each of some pixels (N, 2), -1 where there is none; None as above.

    A line may lie on the rim of what is in front, and a little off it.
    """
    if not _has_parts(surface):
        return None
    found = np.full(len(xy), -1)
    angle = np.arange(8) * (np.pi / 4)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    right, down, forward = camera.axes
    for radius in RIM:
        lost = np.flatnonzero(found < 0)
        at = xy[lost, None] + radius * np.concatenate([[[0.0, 0.0]], ring])  # (n, 9, 2)
        x, y = np.moveaxis(at - [0.5 * camera.width, 0.5 * camera.height], -1, 0)
        rays = x[..., None] * right + y[..., None] * down + camera.focal * forward
        hits = scene.first_hit(camera.eye, rays.astype(np.float32).reshape(-1, 3))
        nearest = hits.distance.reshape(-1, 9).argmin(axis=1)[:, None]
        found[lost] = np.take_along_axis(hits.face.reshape(len(lost), 9), nearest, 1)[:, 0]
    return found
