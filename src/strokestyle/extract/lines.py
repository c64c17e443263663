"""Choose the lines of a surface that a camera draws: found, trusted, chained, without echoes."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from ..geometry.curves import is_kind, take_ragged
from ..geometry.kinds import SOFT_KINDS
from ..mesh.surface import Surface
from ..mesh.triangles import any_corner
from .camera import Camera
from .chain import chain_segments
from .line_options import LineOptions
from .segments import (
    NEXT_CORNER,
    Segments,
    apparent_segments,
    boundary_segments,
    contour_segments,
    crease_edges,
    crease_segments,
    edge_segments,
    intersection_segments,
    ridge_segments,
    rowdot,
    suggestive_segments,
    valley_segments,
    values_at_ends,
)
from .surface_curves import SurfaceCurves
from .view_curvature import ViewFields

MOST_SMOOTH = 3.0  # mean edges: a denser mesh is smoothed over less than LineOptions.smooth, or it would take long
SLIVERS = (0.1, 0.25)  # see _trust
ECHO_FACES, ECHO_EDGES = 3, 14  # see _without_echoes


def feature_curves(
    surface: Surface, camera: Camera, options: LineOptions | None = None
) -> SurfaceCurves:
    """All lines of `options.kinds` as seen by `camera`, hidden ones included, kind by kind in KINDS order.

    Ridges, valleys, boundaries and intersections do not depend on the camera and are found once per surface and
    options. Parts of closed surfaces that face away are left out where a kind cannot be seen there.
    """
    options = options or LineOptions()
    parts = []
    for kind, find in _VIEW_KINDS.items():
        if kind in options.kinds:
            shown = smoothed(surface, options.smooth) if kind in SOFT_KINDS else surface
            view = ViewFields.of(shown, camera.eye)
            parts.append(_lines(surface, kind, partial(find, shown, view), camera.up, options))
    parts.append(_facing(surface, ViewFields.of(surface, camera.eye), options))
    curves = _without_echoes(surface, SurfaceCurves.concatenate(parts), options)
    return curves.take(np.argsort(curves.kind, kind="stable"))


def _lines(
    surface: Surface, kind: str, find, up: np.ndarray, options: LineOptions
) -> SurfaceCurves:
    """The lines of one kind, chained from the segments that `find` gives for some options.

    A soft line must reach `options.hysteresis` somewhere. To follow it on, it is found a second time by weaker
    thresholds; of those lines the ones are kept that pass through a face of the first.
    """
    if kind not in SOFT_KINDS:
        return chain_segments(surface, find(options), up, 0.0)
    curves = chain_segments(surface, _trusted(surface, find(options)), up, options.hysteresis)
    if not (options.follow > 1.0 and len(curves)):
        return curves
    followed = chain_segments(surface, _trusted(surface, find(options.followed())), up, 0.0)
    start = np.zeros(len(surface.faces), bool)
    start[curves.face] = True
    return followed.take(np.logical_or.reduceat(start[followed.face], followed.offsets[:-1]))


def _trusted(surface: Surface, segments: Segments) -> Segments:
    """Segments of soft lines, weaker between slivers: curvature is read off differences along all sides of a face, and
    means little where some are many times shorter than others, as on the flanks of a machine part."""
    strength = segments.strength * values_at_ends(surface, segments, _trust(surface))
    return Segments(segments.kind, segments.face, segments.bary, segments.node, strength)


@lru_cache(maxsize=2)
def _trust(surface: Surface) -> np.ndarray:
    """(V,) from 0 where the faces around a vertex are SLIVERS[0] times as high as long to 1 where SLIVERS[1] times."""
    corner = surface.vertices[surface.faces]
    side = corner - corner[:, NEXT_CORNER]
    longest = np.einsum("fij,fij->fi", side, side).max(axis=1)
    area = np.cross(side[:, 0], side[:, 1])
    shape = np.sqrt(rowdot(area, area)) / np.maximum(longest, 1e-30)
    index, count = surface.faces.ravel(), len(surface.vertices)
    mean = np.bincount(index, np.repeat(shape, 3), count) / np.maximum(
        np.bincount(index, minlength=count), 1
    )
    return np.clip((mean - SLIVERS[0]) / (SLIVERS[1] - SLIVERS[0]), 0.0, 1.0)


@lru_cache(maxsize=2)
def smoothed(surface: Surface, length: float) -> Surface:
    """The surface with normals and curvatures smoothed over `length`, in longest sides; its vertices stay."""
    if not length > 0.0:
        return surface
    surface.closed_faces, surface.cut_edges, surface.face_normals  # noqa: B018  worked out here once for both
    return surface.smoothed(min(length / surface.mean_edge, MOST_SMOOTH))


@lru_cache(maxsize=4)
def surface_lines(surface: Surface, options: LineOptions) -> SurfaceCurves:
    """The lines that do not depend on the camera: boundaries, ridges, valleys, intersections."""
    parts = []
    for kind, find in _SURFACE_KINDS.items():
        if kind in options.kinds:
            shown = smoothed(surface, options.smooth) if kind in SOFT_KINDS else surface
            parts.append(
                _lines(surface, kind, partial(find, shown), np.array([0.0, 1.0, 0.0]), options)
            )
    return SurfaceCurves.concatenate(parts)


def _facing(surface: Surface, view: ViewFields, options: LineOptions) -> SurfaceCurves:
    """surface_lines less the ridges and valleys that face away all along, on closed surfaces."""
    curves = surface_lines(surface, options)
    if not len(curves):
        return curves
    front = (view.n_dot_v > 0.0) | ~surface.closed_vertices
    seen = front[surface.faces[curves.face]].any(axis=1)
    soft = is_kind(curves.kind, SOFT_KINDS)
    return curves.take(~soft | (np.add.reduceat(seen, curves.offsets[:-1]) > 0))


def _without_echoes(surface: Surface, curves: SurfaceCurves, options: LineOptions) -> SurfaceCurves:
    """Soft lines less their parts within ECHO_FACES faces of a crease over which normals run.

    There normals and curvatures mix both sides of the crease, and would draw it a second time beside itself. Creases
    of fewer than ECHO_EDGES edges are as often the noise of a scan, and do not count.
    """
    near = _near_creases(surface, options)
    soft = is_kind(curves.kind, SOFT_KINDS)
    which = np.repeat(np.arange(len(curves)), np.diff(curves.offsets))
    keep = ~(soft[which] & near[curves.face])
    if keep.all():
        return curves
    start = np.flatnonzero(np.r_[True, (keep[1:] != keep[:-1]) | (which[1:] != which[:-1])])
    count = np.diff(np.r_[start, len(keep)])
    good = np.flatnonzero(keep[start] & (count >= 2))
    rows, offsets = take_ragged(np.r_[start, len(keep)], good)
    of = which[start[good]]
    closed = curves.closed[of] & (count[good] == np.diff(curves.offsets)[of])
    return SurfaceCurves(
        curves.face[rows],
        curves.bary[rows],
        offsets,
        curves.kind[of],
        closed,
        curves.strength[rows],
    )


@lru_cache(maxsize=4)
def _near_creases(surface: Surface, options: LineOptions) -> np.ndarray:
    """(F,) bool, within ECHO_FACES faces of a crease of ECHO_EDGES edges or more that is not cut."""
    uncut = np.setdiff1d(
        crease_edges(surface, options.crease), surface.cut_edges, assume_unique=True
    )
    curves = chain_segments(
        surface, edge_segments(surface, uncut, "crease"), np.array([0.0, 1.0, 0.0]), 0.0
    )
    count = np.diff(curves.offsets)
    rows = np.repeat(count > ECHO_EDGES, count)
    touched = np.zeros(len(surface.vertices), bool)
    touched[surface.faces[curves.face[rows], curves.bary[rows].argmax(axis=1)]] = (
        True  # creases run through vertices
    )
    near = np.zeros(len(surface.faces), bool)
    for _ in range(ECHO_FACES):
        near = any_corner(surface.faces, touched)
        touched[surface.faces[near]] = True
    return near


_VIEW_KINDS = {
    "contour": contour_segments,
    "crease": crease_segments,
    "suggestive": suggestive_segments,
    "apparent": apparent_segments,
}

_SURFACE_KINDS = {
    "boundary": boundary_segments,
    "ridge": ridge_segments,
    "valley": valley_segments,
    "intersection": intersection_segments,
}
