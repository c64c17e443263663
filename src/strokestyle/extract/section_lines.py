"""Find the lines of a surface that was cut open: those of the whole that are left, and the cut.

Lines are found on the whole, so that the cut changes neither normals nor curvatures, and no line
near it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.curves import counting, owner, runs
from ..mesh.planes import Plane
from ..mesh.surface import Section, Surface
from ..mesh.triangles import pair_key, row_dot
from .chain import chain_segments
from .segments import edge_segments
from .surface_curves import SurfaceCurves

ROUNDING = 1e-12  # of weights
ON_SIDE = 1e-6  # weight of the corner opposite to a side that a point is on


def section_curves(surface: Surface) -> SurfaceCurves:
    """Chain the edges along which a surface was cut open."""
    assert surface.section is not None  # asked only of a surface that was
    segments = edge_segments(surface, surface.section.rim, "section")
    return chain_segments(surface, segments, np.array([0.0, 1.0, 0.0]))


def opened(surface: Surface) -> bool:
    """Tell whether a closed body of the whole is left open: a room, or one that no cap closes."""
    section = surface.section
    assert section is not None  # asked only of a surface that was cut
    piece = section.source >= 0
    was_closed = section.whole.closed_faces[section.source[piece]]
    return bool((was_closed & ~surface.closed_faces[piece]).any())


@dataclass(frozen=True, eq=False)
class _Rows:
    """Points of lines on the whole, row by row; the piece to the next row lies in a row's face.

    Parameters
    ----------
    points : (N, 3)
    face, line : (N,) int
    strength : (N,)
    """

    points: np.ndarray
    face: np.ndarray
    line: np.ndarray
    strength: np.ndarray

    @property
    def goes_on(self) -> np.ndarray:
        """Tell which rows are not the last of their line, (N,) bool."""
        return np.r_[self.line[1:] == self.line[:-1], np.zeros(min(1, len(self.line)), bool)]

    def with_crossings(self, plane: Plane) -> _Rows:
        """Add a row wherever a line crosses a plane."""
        height = plane.height(self.points)
        after = np.r_[height[1:], height[-1:]]
        row = np.flatnonzero(self.goes_on & (height * after < 0.0))
        t = height[row] / (height[row] - after[row])
        place = self.points[row] + t[:, None] * (self.points[row + 1] - self.points[row])
        place[:, plane.axis] = plane.offset
        strength = self.strength[row] + t * (self.strength[row + 1] - self.strength[row])
        return _Rows(
            np.insert(self.points, row + 1, place, axis=0),
            np.insert(self.face, row + 1, self.face[row]),
            np.insert(self.line, row + 1, self.line[row]),
            np.insert(self.strength, row + 1, strength),
        )


def cut_curves(surface: Surface, curves: SurfaceCurves) -> SurfaceCurves:
    """Take what a section leaves of lines on the whole, as lines on the surface that is left.

    Pieces that lie in a plane go with the edge that they run along: they are left where it is, and
    is no part of the cut.
    """
    section = surface.section
    assert section is not None  # asked only of a surface that was cut
    if not len(curves):
        return curves
    rows = _Rows(curves.points(section.whole), curves.face, owner(curves.offsets), curves.strength)
    for plane in section.planes:
        rows = rows.with_crossings(plane)
    good = rows.goes_on
    for plane in section.planes:
        height = plane.height(rows.points)
        after = np.r_[height[1:], height[-1:]]
        good &= (height <= 0.0) & (after <= 0.0)
        flat = np.flatnonzero(good & (height == 0.0) & (after == 0.0))
        face = _left_in_plane(surface, section, rows, flat)
        good[flat[face < 0]] = False
        rows = replace(rows, face=rows.face.copy())
        rows.face[flat] = np.where(face < 0, rows.face[flat], face)
    good &= np.isin(rows.face, section.source)
    return _on_pieces(surface, section, rows, good, curves)


def _left_in_plane(surface: Surface, section: Section, rows: _Rows, row: np.ndarray) -> np.ndarray:
    """Find for pieces that lie in a plane, from rows (M,), a face of the whole that is left there.

    (M,), -1 where the piece goes: where its faces do, or where its edge is part of the rim.
    """
    whole, face = section.whole, rows.face[row]
    left = np.zeros(len(whole.faces), bool)
    left[section.source[section.source >= 0]] = True
    corner = whole.vertices[whole.faces[face]]
    weight = np.maximum(_weights(corner, rows.points[row]), _weights(corner, rows.points[row + 1]))
    opposite = weight.argmin(axis=1)
    edge = whole.face_edges[face, (opposite + 1) % 3]
    along = weight[np.arange(len(row)), opposite] < ON_SIDE
    pair = whole.edge_faces[edge]
    beside = np.where(left[pair[:, 0]], pair[:, 0], np.where(left[pair[:, 1]], pair[:, 1], -1))
    beside = np.where((pair[:, 1] < 0) & ~left[pair[:, 0]], -1, beside)
    beside[np.isin(edge, _rim_of_whole(surface, section))] = -1
    return np.where(along, beside, np.where(left[face], face, -1))


def _rim_of_whole(surface: Surface, section: Section) -> np.ndarray:
    """Find the edges of the whole that the rim runs along, their indices."""
    whole = section.whole
    ends = section.origin[surface.edges[section.rim]]
    ends = np.sort(whole.weld[ends[(ends >= 0).all(axis=1)]], axis=1)
    count = len(whole.vertices)
    key = pair_key(count, *whole.edges.T)
    wanted = pair_key(count, *ends.T)
    at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
    return at[key[at] == wanted]


def _on_pieces(
    surface: Surface, section: Section, rows: _Rows, good: np.ndarray, curves: SurfaceCurves
) -> SurfaceCurves:
    """Make curves of the good pieces (N,) bool, each from its row to the next, of lines."""
    start = runs(good, rows.line)
    first, count = start[:-1], np.diff(start)
    wanted = good[first]
    first, count = first[wanted], count[wanted]
    if not len(first):
        return SurfaceCurves.empty()
    row = np.repeat(first, count + 1) + counting(count + 1)
    offsets = np.r_[0, np.cumsum(count + 1)]
    last = offsets[1:] - 1
    of_whole = rows.face[row]
    of_whole[last] = of_whole[last - 1]  # the face of the piece that ends there
    line = rows.line[first]
    pieces = np.bincount(rows.line[rows.goes_on], minlength=len(curves))[line]
    face, bary = _place(surface, section.source, of_whole, rows.points[row])
    return SurfaceCurves(
        face,
        bary,
        offsets,
        curves.kind[line],
        curves.closed[line] & (count == pieces),
        rows.strength[row],
    )


def _place(
    surface: Surface, source: np.ndarray, of_whole: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the face (N,) of what is left, and the weights of its corners (N, 3), at points (N, 3).

    Each point lies in a face of the whole `of_whole` (N,), of which there are pieces left.
    """
    order = np.argsort(source, kind="stable")
    first, end = (np.searchsorted(source[order], of_whole, side) for side in ("left", "right"))
    count = end - first
    point = np.repeat(np.arange(len(points)), count)
    piece = order[np.repeat(first, count) + counting(count)]
    corner = surface.vertices[surface.faces[piece]]
    bary = np.clip(_weights(corner, points[point]), 0.0, 1.0)
    bary[bary < ROUNDING] = 0.0  # a vertex stays a vertex
    bary /= bary.sum(axis=1, keepdims=True)
    off = np.einsum("ni,nik->nk", bary, corner) - points[point]
    best = np.lexsort((row_dot(off, off), point))[np.r_[0, np.cumsum(count)[:-1]]]
    return piece[best], bary[best]


def _weights(corner: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weigh the corners (N, 3, 3) of faces at points (N, 3) in their planes, (N, 3)."""
    a, b, rel = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0], points - corner[:, 0]
    normal = np.cross(a, b)
    square = np.maximum(row_dot(normal, normal), 1e-300)
    second = row_dot(rel, np.cross(b, normal)) / square
    third = row_dot(rel, np.cross(normal, a)) / square
    return np.stack([1.0 - second - third, second, third], axis=1)
