"""Extract a view: lines, hidden parts cut away, tidied, evenly spaced, and the feature maps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

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
from .feature_maps import MAPS, PLAIN, FeatureMaps, feature_maps
from .line_options import LineOptions
from .lines import SurfaceLines
from .optional import OptionalLines, optional_lines
from .plain_raster import plain_raster
from .rays import Bvh
from .seen_surface import background_of
from .tidy import subtract_parallel, tidy_with_source
from .view import View
from .visible import Fragments, SampledLines, look_along

LOOSE = 50.0  # px, an intersection that is shorter may go with the lines that it is chained to
# px round a point of a line from elsewhere, in which the shape is sought that it was drawn for
RIM = (1.5, 5.0)


def extract_view(
    surface: Surface,
    camera: Camera,
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    hidden: bool = False,
    lines: SurfaceLines | None = None,
    optional: bool = False,
) -> View:
    """Draw a surface plainly: find its feature curves, look, tidy, resample, and tell their parts.

    Feature maps are worked out when they are asked for.

    Parameters
    ----------
    options : which lines
    spacing : px between the points of the curves
    hidden : also the hidden parts, of the kinds in HARD_KINDS: those describe the shape, the others
        only how its front looks
    lines : the lines of this surface and these options, where several views are drawn of them; by
        default the surface keeps what the last view of it found, for one by the same options
    optional : also the lines that an artist may draw besides, as `View.optional`; the others are
        the same with and without

    Raises
    ------
    ValueError
        where `lines` are those of another surface, or other lines than `options` ask for.
    """
    given, lines = lines, _lines_of(surface, options, lines)
    found, unseen = lines.split_from(camera, hidden)
    sight = look_along(surface, camera, found, lines.bvh)
    fragments = sight.fragments()
    seen = _tidied(surface, camera, fragments, spacing)
    maps_of, more = seen.curves, np.zeros(len(seen.curves), bool)
    if optional:
        seen, more = _with_optional(lines, camera, fragments, seen, spacing)
    none = np.zeros(0)
    behind = _Tidied(Curves.empty(), Curves.empty(), None, none, none)
    if hidden:
        away = _hidden_fragments(sight, look_along(surface, camera, unseen, None))
        apart = _apart_from(seen.strokes, away, camera)
        behind = _tidied(surface, camera, apart, spacing)
    del found, unseen, sight, fragments  # of millions of points, where lines lie behind one another
    maps = feature_maps(surface, camera, maps_of, lines.bvh)
    if given is None:
        lines.remember()
    view = View(camera, seen.curves, maps, behind.curves, strength=seen.strength)
    view = replace(view, optional=more) if optional else view
    return _with_parts(view, surface, seen.faces, behind.faces)


def _with_optional(
    lines: SurfaceLines,
    camera: Camera,
    fragments: Fragments,
    seen: _Tidied,
    spacing: float,
) -> tuple[_Tidied, np.ndarray]:
    """Put optional lines behind those seen, and tell which curves are optional, (C,) bool."""
    more = optional_lines(lines, camera, fragments, seen.strokes, spacing)
    curves = Curves.concatenate([seen.curves, more.curves])
    faces = None if seen.faces is None else np.r_[seen.faces, more.face]
    strength = np.r_[seen.strength, more.strength]
    both = _Tidied(seen.strokes, curves, faces, strength, seen.source)
    return both, np.arange(len(curves)) >= len(seen.curves)


@dataclass(frozen=True)
class SeenLines:
    """What a camera sees of lines, tidied and evenly spaced, and where on the surface that lies.

    Parameters
    ----------
    curves : N points, as those of the view
    optional : (C,) bool, as that of the view
    strength : (N,), as that of the view
    kind : (N,) int8, index into KINDS, of the line that each point comes from; the lines of several
        kinds may be joined in one curve
    face : (N,) int, the face that each point comes from
    point : (N, 3), where in space that is; tidied, a point lies a little off it
    part_face : (N,) int, the face whose part a point belongs to, or None where all is one part
    fragments : what is seen of the lines before it is tidied
    """

    curves: Curves
    optional: np.ndarray
    strength: np.ndarray
    kind: np.ndarray
    face: np.ndarray
    point: np.ndarray
    part_face: np.ndarray | None
    fragments: Fragments

    def view(self, lines: SurfaceLines, camera: Camera) -> View:
        """Make the view of them: maps, parts and all."""
        maps = feature_maps(lines.surface, camera, self.curves, lines.bvh)
        view = View(camera, self.curves, maps, strength=self.strength, optional=self.optional)
        return _with_parts(view, lines.surface, self.part_face)


def see_lines(
    lines: SurfaceLines,
    camera: Camera,
    spacing: float = DEFAULT_SPACING,
    optional: bool = False,
) -> SeenLines:
    """Draw a surface plainly as `extract_view` does, and keep where on it the lines lie."""
    fragments = look_along(lines.surface, camera, lines.seen_from(camera), lines.bvh).fragments()
    assert fragments.point is not None  # `look_along` tells it
    seen = _tidied(lines.surface, camera, fragments, spacing)
    face, point = fragments.face[seen.source], fragments.point[seen.source]
    kind = fragments.curves.kind[owner(fragments.curves.offsets)][seen.source]
    more = OptionalLines.none()
    if optional:
        more = optional_lines(lines, camera, fragments, seen.strokes, spacing)
    curves = Curves.concatenate([seen.curves, more.curves])
    return SeenLines(
        curves,
        np.arange(len(curves)) >= len(seen.curves),
        np.r_[seen.strength, more.strength],
        np.r_[kind, np.repeat(more.curves.kind, np.diff(more.curves.offsets))],
        np.r_[face, more.face],
        np.concatenate([point, more.point]),
        None if seen.faces is None else np.r_[seen.faces, more.face],
        fragments,
    )


class _Tidied(NamedTuple):
    """Curves of a view: tidied; the same evenly spaced; face and strength of their N points.

    `source` (N,) is the row of the fragments that each point comes from.
    """

    strokes: Curves
    curves: Curves
    faces: np.ndarray | None
    strength: np.ndarray
    source: np.ndarray


def _tidied(surface: Surface, camera: Camera, fragments: Fragments, spacing: float) -> _Tidied:
    """Tidy fragments, space their points evenly between corners, and tell their faces."""
    size = (camera.width, camera.height)
    strokes = tidy_with_source(fragments.curves, fragments.strength, size)
    curves, of_stroke = resample_with_source(strokes.curves, spacing, strokes.corner)
    source = strokes.source[of_stroke]
    faces = faces_of(surface, curves, fragments, source)
    strength = np.clip(fragments.strength[source], 0.0, 1.0) if len(source) else np.zeros(0)
    return _Tidied(strokes.curves, curves, faces, strength, source)


def _hidden_fragments(found: SampledLines, unseen: SampledLines) -> Fragments:
    """Cut out what is hidden of the hard lines found, and of those that are never seen."""
    hard = is_kind(found.lines.kind, HARD_KINDS)[found.line]
    return Fragments.concatenate(
        found.fragments(found.hidden & hard), unseen.fragments(unseen.hidden)
    )


def _apart_from(strokes: Curves, fragments: Fragments, camera: Camera) -> Fragments:
    """Leave out of hidden fragments what runs along strokes that are drawn; all are strong."""
    size = (camera.width, camera.height)
    apart, source = subtract_parallel(fragments.curves, strokes, size)
    return Fragments(apart, np.ones(len(apart.xy)), fragments.face[source])


def _lines_of(
    surface: Surface, options: LineOptions | None, lines: SurfaceLines | None
) -> SurfaceLines:
    """Choose the lines given, where they are those that are asked for; else new ones."""
    if lines is None:
        return SurfaceLines.again(surface, options or LineOptions())
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
    values = np.empty((len(MAPS), height, width), np.float32)
    for one, name in zip(values, MAPS, strict=True):
        one[:] = plain_raster(curves, width, height) if name == PLAIN else background_of(name)
    maps = FeatureMaps(MAPS, values, np.zeros((height, width), bool))
    eye, target, up = np.array([0.0, 0.0, 2.0]), np.zeros(3), np.array([0.0, 1.0, 0.0])
    camera = Camera(eye, target, up, 30.0, width, height)
    of_points = None if parts is None else parts.take(source[owner(curves.offsets)])
    return View(camera, curves, maps, parts=of_points)


def _with_parts(
    view: View, surface: Surface, faces: np.ndarray | None, hidden_faces: np.ndarray | None = None
) -> View:
    """Give a view the parts of its curves' points, which lie on `faces` (N,), or on none at -1.

    Parts are put in order by the mean depth of their visible lines, so that of two that meet the
    nearer is painted last.
    """
    if faces is None:
        return view
    seen = parts_of_faces(surface, faces, view.at_curves(["depth"])[:, 0])
    behind = None
    if len(view.hidden) and hidden_faces is not None:
        behind = Parts(seen.names, _part_numbers(surface, seen.names)[hidden_faces])
    return replace(view, parts=seen, hidden_parts=behind)


def parts_of_faces(surface: Surface, faces: np.ndarray, depth: np.ndarray) -> Parts:
    """Name the part of each of points on `faces` (N,), -1 for none, that are seen at `depth` (N,).

    Parts are put in order by the mean depth of their points, the farthest first.
    """
    names, _ = _named_parts(surface)
    index = _part_numbers(surface, tuple(names))[faces]
    order = _far_to_near(index, depth, len(names))
    ordered = tuple(names[i] for i in order)
    return Parts(ordered, _part_numbers(surface, ordered)[faces])


def _part_numbers(surface: Surface, order: tuple[str, ...]) -> np.ndarray:
    """Number the part of each face in an order of names, (F + 1,); -1 for none, as of face -1."""
    names, of_part = _named_parts(surface)
    number = np.array([*(order.index(name) for name in names), -1])
    return np.r_[number[of_part][surface.part], -1]


def _named_parts(surface: Surface) -> tuple[list[str], np.ndarray]:
    """Collect the names of a surface's parts, and which of them each part has; -1 for none."""
    name = [part_name(text) for text in surface.part_names]
    names = [text for text in dict.fromkeys(name) if text]
    number = {text: i for i, text in enumerate(names)} | {"": -1}
    return names, np.array([number[text] for text in name])


def _far_to_near(index: np.ndarray, depth: np.ndarray, count: int) -> np.ndarray:
    """Order `count` parts by the mean depth of the points of each, the farthest first.

    `index` (N,) is the part of each point, -1 for none. Parts without points come before others.
    """
    points, total = (np.bincount(index + 1, weight, count + 1)[1:] for weight in (None, depth))
    mean = np.where(points > 0, total / np.maximum(points, 1), np.inf)
    return np.argsort(-mean, kind="stable")


def _has_parts(surface: Surface) -> bool:
    """Tell whether a surface has parts of different names."""
    return len(surface.part_names) > 1 and len({part_name(text) for text in surface.part_names}) > 1


def faces_of(
    surface: Surface, curves: Curves, fragments: Fragments, source: np.ndarray
) -> np.ndarray | None:
    """Tell the face (N,) that each point of curves belongs to, which comes from row `source` (N,).

    Rows are those of fragments. An intersection is of two parts, so that a stretch of it shorter
    than LOOSE goes with the rest of a curve that it is chained to. None where faces tell nothing.
    """
    if not _has_parts(surface):
        return None
    if not len(curves):
        return np.full(0, -1)
    of_fragment = owner(fragments.curves.offsets)
    crossing = is_kind(fragments.curves.kind, ("intersection",))[of_fragment]
    loose, curve = crossing[source], owner(curves.offsets)
    start, along = runs(loose, curve), arc_length(curves.xy, curves.offsets)
    short = along[start[1:] - 1] - along[start[:-1]] < LOOSE
    loose = loose & np.repeat(short, np.diff(start))
    return fragments.face[source[_nearest_firm(loose, curve)]]


def _nearest_firm(loose: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Find for each point the nearest on its curve that is not loose, (N,); itself if none is.

    `loose` : (N,) bool; `curve` : (N,) int, the curve that each point is on
    """
    here, firm = np.arange(len(loose)), np.flatnonzero(~loose)
    if not len(firm):
        return here
    after = np.searchsorted(firm, here)
    # the firm points before and after each point
    sides = firm[np.clip([after - 1, after], 0, len(firm) - 1)]
    away = np.where(curve[sides] == curve, np.abs(sides - here), len(here))
    nearest = np.where(away[0] <= away[1], *sides)
    return np.where(away.min(axis=0) < len(here), nearest, here)


def _faces_in_front(
    surface: Surface, camera: Camera, xy: np.ndarray, bvh: Bvh
) -> np.ndarray | None:
    """Find the face (N,) nearest to the eye round each of some pixels (N, 2), -1 if none is.

    A line may lie on the rim of what is in front, and a little off it. None where faces tell
    nothing.
    """
    if not _has_parts(surface):
        return None
    camera = camera.clear_of(surface.vertices)
    found = np.full(len(xy), -1)
    angle = np.arange(8) * (np.pi / 4)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    spots = np.concatenate([[[0.0, 0.0]], ring])  # the middle and 8 round it
    for radius in RIM:
        lost = np.flatnonzero(found < 0)
        places = xy[lost, None] + radius * spots  # (n, 9, 2)
        rays, origins = camera.rays(places), camera.origins(places)
        hits = bvh.first_hit(origins.reshape(-1, 3), rays.astype(np.float32).reshape(-1, 3))
        nearest = hits.distance.reshape(-1, 9).argmin(axis=1)[:, None]
        found[lost] = np.take_along_axis(hits.face.reshape(len(lost), 9), nearest, 1)[:, 0]
    return found
