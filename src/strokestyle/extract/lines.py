"""Choose the lines of a surface that a camera draws: found, trusted, chained, none drawn twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial

import numpy as np

from ..geometry.curves import is_kind, owner
from ..geometry.kinds import SOFT_KINDS
from ..mesh.sheets import PLANE
from ..mesh.surface import Surface
from ..mesh.triangles import any_corner
from .camera import Camera
from .chain import chain_segments
from .face_shapes import FaceShapes, mean_around
from .line_options import LineOptions
from .rays import Bvh
from .seams import Seams
from .section_lines import cut_curves, opened, section_curves
from .segments import (
    Facets,
    Segments,
    Trimmed,
    apparent_segments,
    boundary_segments,
    contour_segments,
    crease_edges,
    crease_segments,
    edge_segments,
    intersection_segments,
    ridge_segments,
    suggestive_segments,
    valley_segments,
    values_at_ends,
)
from .surface_curves import SurfaceCurves
from .view_curvature import ViewFields

# Mean edges: a denser mesh is smoothed over less than LineOptions.smooth, or it would take long.
MAX_SMOOTH = 3.0
REMEMBERED = "_lines"  # where a surface has what is known of its lines
SLIVERS = (0.1, 0.25)  # height of a face by its longest side; see trust_in_shape
DUPLICATE_FACES, DUPLICATE_EDGES = 3, 14  # see SurfaceLines.near_creases
FOLD_FACES, FOLD_EDGES = 6, 3
FLAT_FOLD, FLAT_BESIDE = 8.0, 0.02  # degrees, and a share of them; see flat_folds


@dataclass(frozen=True, eq=False)
class SurfaceLines:
    """Finds the lines of a surface from any side; what no camera changes is found once and kept.

    Give one to `extract_view` to draw several views of a shape. Nothing is worked out before it is
    asked for, and all of it goes with this object.

    Parameters
    ----------
    surface : the shape
    options : which lines, and from what strength on
    left : (F,) bool, the faces that a cut leaves, where lines of the whole are asked for
    """

    surface: Surface
    options: LineOptions = LineOptions()
    left: np.ndarray | None = None

    @classmethod
    def again(cls, surface: Surface, options: LineOptions) -> SurfaceLines:
        """Make lines that know what those last remembered knew, where the options are the same."""
        lines = cls(surface, options)
        of, known = vars(surface).get(REMEMBERED, (None, {}))
        if of == options:
            vars(lines).update(known)
        return lines

    def remember(self) -> None:
        """Leave what was worked out with the surface, as long as that lives, for `again`."""
        own = {each.name for each in fields(self)}
        known = {
            name: value
            for name, value in vars(self).items()
            if name not in own and value is not self.surface  # which must not know itself
        }
        vars(self.surface)[REMEMBERED] = self.options, known

    def alike(self, options: LineOptions) -> SurfaceLines:
        """Make the lines of the same surface by other thresholds, without working out all anew."""
        lines = replace(self, options=options)
        kept = {
            "bvh": True,
            "shapes": True,
            "trust": True,
            "smoothed": options.smooth == self.options.smooth,
        }
        kept |= dict.fromkeys(
            ("crease_edges", "near_creases"), options.crease == self.options.crease
        )
        lines.__dict__.update({name: getattr(self, name) for name, same in kept.items() if same})
        return lines

    def seen_from(self, camera: Camera) -> SurfaceCurves:
        """Find all lines of `options.kinds` as a camera sees them, kind by kind in KINDS order.

        What the surface hides is among them; parts of closed surfaces that face away are left out
        where a kind cannot be seen there.
        """
        return self.split_from(camera)[0]

    def split_from(
        self, camera: Camera, unseen: bool = False
    ) -> tuple[SurfaceCurves, SurfaceCurves]:
        """Find the lines of `seen_from`, and apart from them the contours and creases left out.

        The second are chained where `unseen` is set; the shape hides them however one looks.
        """
        if self.surface.section is not None:
            return self._cut_from(camera, unseen)
        surface, view = self.surface, ViewFields.of(self.surface, camera.viewpoint)
        hard = self._hard(view, camera)
        parts = [chain_segments(surface, found.shown, camera.up) for found in hard]
        for kind, find in _SOFT_VIEW_KINDS.items():
            if self._wants(kind):
                shown = ViewFields.of(self.smoothed, camera.viewpoint)
                parts.append(self._chained(kind, partial(find, self.smoothed, shown), camera.up))
        parts.append(self._facing(view))
        curves = self._without_duplicates(SurfaceCurves.concatenate(parts))
        behind = [chain_segments(surface, found.unseen, camera.up) for found in hard if unseen]
        order = np.argsort(curves.kind, kind="stable")
        return curves.take(order), SurfaceCurves.concatenate(behind)

    def _cut_from(self, camera: Camera, unseen: bool) -> tuple[SurfaceCurves, SurfaceCurves]:
        """Take what the cut leaves of the lines of the whole, and the cut itself."""
        inside = opened(self.surface)  # one looks at the inside: rays tell what is seen of it
        shown, behind = self._whole.split_from(camera, unseen or inside)
        if inside:
            shown, behind = SurfaceCurves.concatenate([shown, behind]), SurfaceCurves.empty()
        left = [cut_curves(self.surface, shown), self._section]
        return SurfaceCurves.concatenate(left), cut_curves(self.surface, behind)

    def _hard(self, view: ViewFields, camera: Camera) -> list[Trimmed]:
        """Find the contours and creases, and boundaries where seams are among them."""
        surface, options, hard = self.surface, self.options, []
        if self._wants("contour"):
            hard.append(contour_segments(surface, view, options, self.facets))
        if self._wants("crease"):
            edge = self.crease_edges
            hard.append(crease_segments(surface, view, options, edge, self.facets))
        if not len(self.seams):
            return hard
        if self._wants("boundary"):
            found = boundary_segments(surface, options)
            hard.append(Trimmed(found, found.none()))
        crease = np.radians(options.crease)
        closed = view.closed_faces & (self.left is None)  # a cut lets one look at the inside
        drawn = self.seams.drawn(camera.viewpoint, crease, closed)
        return [
            Trimmed(*(self.seams.without(surface, part, drawn) for part in found)) for found in hard
        ]

    @cached_property
    def bvh(self) -> Bvh:
        """What finds the faces of the surface that rays hit."""
        return Bvh(self.surface, self.shapes)

    @cached_property
    def shapes(self) -> FaceShapes:
        """How large the faces of the surface are."""
        return FaceShapes.of(self.surface.vertices, self.surface.faces)

    @cached_property
    def _whole(self) -> SurfaceLines:
        """The lines of the surface before it was cut open."""
        assert self.surface.section is not None  # asked only where it was
        section = self.surface.section
        left = np.zeros(len(section.whole.faces), bool)
        left[section.source[section.source >= 0]] = True
        return SurfaceLines(section.whole, self.options, left)

    @cached_property
    def _section(self) -> SurfaceCurves:
        """The lines along which the surface was cut open."""
        return section_curves(self.surface) if self._wants("section") else SurfaceCurves.empty()

    @cached_property
    def smoothed(self) -> Surface:
        """The surface that soft lines are read off: smoothed in all but its vertices."""
        length = self.options.smooth
        if not length > 0.0:
            return self.surface
        return self.surface.smoothed(min(length / self.surface.mean_edge, MAX_SMOOTH))

    @cached_property
    def crease_edges(self) -> np.ndarray:
        """Indices of the mesh edges that are creases."""
        return crease_edges(self.surface, self.options.crease)

    @cached_property
    def facets(self) -> Facets | None:
        """Faces so large that contours run round them instead of through them."""
        return Facets.of(self.surface, self.shapes)

    @cached_property
    def seams(self) -> Seams:
        """What touches the edges that may be drawn: creases, cuts, boundaries, those of facets."""
        surface = self.surface
        may = np.zeros(len(surface.edges), bool)
        if self.facets is not None:
            may[self.facets.edge] = surface.edge_bends[self.facets.edge] > PLANE
        may |= surface.edge_face_count != 2
        may[surface.cut_edges] = may[self.crease_edges] = True
        seams = Seams.of(surface, np.flatnonzero(may))
        return seams if self.left is None else seams.among(self.left)

    @cached_property
    def fixed(self) -> SurfaceCurves:
        """The lines that no camera changes: ridges, valleys, intersections, free boundaries."""
        up = np.array([0.0, 1.0, 0.0])
        parts = []
        for kind, find in _SURFACE_KINDS.items():
            if self._wants(kind) and not (kind == "boundary" and len(self.seams)):
                parts.append(self._chained(kind, partial(find, self._shown(kind)), up))
        return SurfaceCurves.concatenate(parts)

    @cached_property
    def trust(self) -> np.ndarray:
        """How far curvature may be believed at each vertex, (V,) in 0..1; see `trust_in_shape`."""
        return trust_in_shape(self.surface, self.shapes)

    @cached_property
    def near_creases(self) -> np.ndarray:
        """Faces near a crease or flat fold that is not cut, (F,) bool.

        Near a crease is within DUPLICATE_FACES; those of up to DUPLICATE_EDGES edges are as often
        the noise of a scan, and do not count. Smoothing spreads what bends at once on flat folds:
        near these is within FOLD_FACES, of more than FOLD_EDGES edges.
        """
        folds = self._around(flat_folds(self.surface), FOLD_EDGES, FOLD_FACES)
        return folds | self._around(self.crease_edges, DUPLICATE_EDGES, DUPLICATE_FACES)

    def _around(self, edge: np.ndarray, least: int, faces: int) -> np.ndarray:
        """Find the faces within some `faces` of uncut edges, in rows of over `least`, (F,) bool."""
        surface = self.surface
        uncut = np.setdiff1d(edge, surface.cut_edges, assume_unique=True)
        segments = edge_segments(surface, uncut, "crease")
        curves = chain_segments(surface, segments, np.array([0.0, 1.0, 0.0]))
        count = np.diff(curves.offsets)
        rows = np.repeat(count > least, count)
        touched = np.zeros(len(surface.vertices), bool)
        at = curves.bary[rows].argmax(axis=1)  # they run through vertices
        touched[surface.faces[curves.face[rows], at]] = True
        near = np.zeros(len(surface.faces), bool)
        for _ in range(faces if touched.any() else 0):
            near = any_corner(surface.faces, touched)
            touched[surface.faces[near]] = True
        return near

    def _wants(self, kind: str) -> bool:
        return kind in self.options.kinds

    def _shown(self, kind: str) -> Surface:
        return self.smoothed if kind in SOFT_KINDS else self.surface

    def _chained(
        self, kind: str, find: Callable[[LineOptions], Segments], up: np.ndarray
    ) -> SurfaceCurves:
        """Chain the lines of one kind from the segments that `find` gives for some options.

        A soft line must reach `options.hysteresis` somewhere. To follow it on, it is found a second
        time by weaker thresholds; of those lines the ones are kept that pass through a face of the
        first.
        """
        surface, options = self.surface, self.options
        if kind not in SOFT_KINDS:
            return chain_segments(surface, find(options), up)
        curves = chain_segments(surface, self._trusted(find(options)), up, options.hysteresis)
        if not (options.follow > 1.0 and len(curves)):
            return curves
        followed = chain_segments(surface, self._trusted(find(options.followed())), up)
        start = np.zeros(len(surface.faces), bool)
        start[curves.face] = True
        return followed.take(np.logical_or.reduceat(start[followed.face], followed.offsets[:-1]))

    def _trusted(self, segments: Segments) -> Segments:
        """Weaken segments of soft lines where the mesh's triangles are slivers."""
        trust = values_at_ends(self.surface, segments, self.trust)
        return replace(segments, strength=segments.strength * trust)

    def _facing(self, view: ViewFields) -> SurfaceCurves:
        """Take the fixed lines less the ridges and valleys of closed surfaces that face away."""
        curves = self.fixed
        if not len(curves):
            return curves
        front = (view.n_dot_v > 0.0) | ~view.closed_vertices(self.surface)
        seen = front[self.surface.faces[curves.face]].any(axis=1)
        soft = is_kind(curves.kind, SOFT_KINDS)
        return curves.take(~soft | (np.add.reduceat(seen, curves.offsets[:-1]) > 0))

    def _without_duplicates(self, curves: SurfaceCurves) -> SurfaceCurves:
        """Leave out the parts of soft lines near a crease over which normals run.

        There normals and curvatures mix both sides of the crease, and would draw it a second time
        beside itself.
        """
        soft = is_kind(curves.kind, SOFT_KINDS)[owner(curves.offsets)]
        return curves.where(~(soft & self.near_creases[curves.face]))


def feature_curves(
    surface: Surface, camera: Camera, options: LineOptions | None = None
) -> SurfaceCurves:
    """Find the lines of a surface as one camera sees them; see `SurfaceLines.seen_from`."""
    return SurfaceLines(surface, options or LineOptions()).seen_from(camera)


def flat_folds(surface: Surface) -> np.ndarray:
    """Find the edges between flat sides at which a mesh bends all at once: indices, ascending.

    All that it bends near such an edge, it bends there: more than FLAT_FOLD, and beside it, at the
    other sides of both faces, less than FLAT_BESIDE of that. Cut finely, the facets of a can have
    such edges. Their curvature is that of the mesh, not of the shape, and a fold of less than the
    crease angle is none of its lines.
    """
    bend = surface.edge_bends
    edge = np.flatnonzero(bend > np.radians(FLAT_FOLD))
    beside = np.zeros(len(edge))
    for face in surface.edge_faces[edge].T:
        for side in surface.face_edges[face].T:
            beside = np.maximum(beside, np.where(side == edge, 0.0, bend[side]))
    return edge[beside < FLAT_BESIDE * bend[edge]]


def trust_in_shape(surface: Surface, shapes: FaceShapes | None = None) -> np.ndarray:
    """Measure how far curvature may be believed at each vertex, (V,) in 0..1.

    Curvature is read off differences along all sides of a face, and means little where some are
    many times shorter than others, as on the flanks of a machine part: 0 where the faces around a
    vertex are SLIVERS[0] times as high as long, 1 where they are SLIVERS[1] times.
    `shapes` : those of its faces, where they are known
    """
    area, longest, _ = shapes or FaceShapes.of(surface.vertices, surface.faces)
    shape = area / np.maximum(longest * longest, 1e-30)
    mean = mean_around(surface.faces, shape, len(surface.vertices))
    return np.clip((mean - SLIVERS[0]) / (SLIVERS[1] - SLIVERS[0]), 0.0, 1.0)


_SOFT_VIEW_KINDS = {
    "suggestive": suggestive_segments,
    "apparent": apparent_segments,
}

_SURFACE_KINDS = {
    "boundary": boundary_segments,
    "ridge": ridge_segments,
    "valley": valley_segments,
    "intersection": intersection_segments,
}
