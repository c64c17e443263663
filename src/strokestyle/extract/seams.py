"""Where faces of other bodies touch an edge: what the eye sees there is no line if it is a seam."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.curves import counting, runs
from ..mesh.messages import warn
from ..mesh.sheets import SAME
from ..mesh.surface import Surface
from ..mesh.triangles import row_dot, unit_rows
from ..mesh.weld import first_at_place
from .eye import towards
from .intersections import overlapping_boxes
from .segments import Segments

TOUCH = 1e-5  # of the longest side: a face nearer than this to an edge touches it
SHORT = 1e-3  # of an edge's length: what touches it over less does not
LEVEL = 0.02  # sine of the angle between an edge and the plane of a face that may touch it
ROUNDING = 1e-9
ALIKE = 0.01  # radians
MAX_NEAR, NEAR_FLOOR = 96, 1 << 22  # pairs of an edge and a face, for each; and in any case
MAX_SAME = 64  # edges of one place; where there are more they are not told of each other


@dataclass(frozen=True, eq=False)
class Seams:
    """Stretches of edges, and the faces that touch them: their own and those of others.

    Round a stretch its faces are half planes. The eye looks into the wedge between two of them, and
    sees a line where these are folded, or one of them turns away.

    Parameters
    ----------
    edge : (S,) int, the mesh edge that each stretch is of; ascending, stretches in their order
    start, end : (S,) in 0..1, from where to where, from the edge's lower vertex on
    middle : (S, 3)
    zero, quarter : (S, 3) unit, the directions at right angles to the edge of angles 0 and pi / 2
    first : (S + 1,) int, where the angles of each stretch begin
    angle : (A,) radians in 0..2 pi, the directions of its half planes, ascending
    front : (A,) int8, to which side each face has its front: 1 to larger angles, -1 to smaller
    face : (A,) int
    again : (S,) bool, stretches that an edge before has just so: coincident bodies draw one line
    """

    edge: np.ndarray
    start: np.ndarray
    end: np.ndarray
    middle: np.ndarray
    zero: np.ndarray
    quarter: np.ndarray
    first: np.ndarray
    angle: np.ndarray
    front: np.ndarray
    face: np.ndarray
    again: np.ndarray

    @classmethod
    def of(cls, surface: Surface, edge: np.ndarray) -> Seams:
        """Find what touches mesh edges `edge` (M,), ascending; where nothing does is no stretch."""
        contacts, frame = _contacts(surface, edge), _Frames.of(surface, edge)
        several = np.flatnonzero(surface.edge_face_count[edge] > 2)
        touch = np.union1d(contacts.row, several)
        if not len(touch):
            return cls.nowhere()
        row, start, end, at = _stretches(contacts, touch)
        middle = frame.low[row] + (0.5 * (start + end))[:, None] * frame.along[row]
        own = _FacesAt.of(surface, edge)
        which, mine = own.of_rows(row)
        stretch = np.r_[which, at[0]]
        own_angle = frame.angle(row[which], own.apex[mine] - frame.low[row[which]])
        angle = np.r_[own_angle, contacts.angle[at[1]]] % (2.0 * np.pi)
        front = np.r_[own.front[mine], contacts.front[at[1]]]
        face = np.r_[own.face[mine], contacts.face[at[1]]]
        order = np.lexsort((angle, stretch))
        first = np.searchsorted(stretch[order], np.arange(len(row) + 1))
        zero, quarter = frame.zero[row], frame.quarter[row]
        planes = angle[order], front[order], face[order]
        again = _repeated(surface, edge)[row]
        return cls(edge[row], start, end, middle, zero, quarter, first, *planes, again)

    @classmethod
    def nowhere(cls) -> Seams:
        """Make no stretches."""
        nothing, none = np.zeros(0), np.zeros((0, 3))
        no, first = np.zeros(0, np.int64), np.zeros(1, np.int64)
        return cls(no, nothing, nothing, none, none, none, first, nothing, no, no, no == 1)

    def __len__(self) -> int:
        return len(self.edge)

    def among(self, left: np.ndarray) -> Seams:
        """Take the seams that remain where some faces alone are left, (F,) bool."""
        kept = left[self.face]
        of = np.repeat(np.arange(len(self)), np.diff(self.first))[kept]
        stretch, of = np.unique(of, return_inverse=True)
        first = np.searchsorted(of, np.arange(len(stretch) + 1))
        angle, front, face = self.angle[kept], self.front[kept], self.face[kept]
        columns = ("edge", "start", "end", "middle", "zero", "quarter", "again")
        taken = {name: getattr(self, name)[stretch] for name in columns}
        return Seams(**taken, first=first, angle=angle, front=front, face=face)

    def drawn(self, eye: np.ndarray, crease: float, closed: np.ndarray) -> np.ndarray:
        """Tell at which stretches an eye sees a line, (S,) bool, or would through what hides it.

        Parameters
        ----------
        eye : (3,) or homogeneous (4,)
        crease : radians
        closed : (F,) bool, faces of which only the outside can be seen
        """
        to_eye = towards(eye, self.middle)
        at = np.arctan2(row_dot(to_eye, self.quarter), row_dot(to_eye, self.zero)) % (2.0 * np.pi)
        # the half planes next to the eye on either side, round the turn where need be
        first, count = self.first[:-1], np.diff(self.first)
        of = np.repeat(np.arange(len(self)), count)
        up_to = np.bincount(of[self.angle <= at[of]], minlength=len(self))
        below, above = first + (up_to - 1) % count, first + up_to % count
        before = (at - self.angle[below]) % (2.0 * np.pi)
        after = (self.angle[above] - at) % (2.0 * np.pi)
        turned_away = np.maximum(before, after) > np.pi
        folded = np.abs(np.pi - before - after) > crease
        front = np.where(closed[self.face], self.front, 0)
        in_solid = (front[below] < 0) | (front[above] > 0)
        line = np.where(in_solid, self._folded_anywhere(crease, front), turned_away | folded)
        return line & ~self.again

    def _folded_anywhere(self, crease: float, front: np.ndarray) -> np.ndarray:
        """Tell round which stretches there is air between two half planes with a fold, (S,) bool.

        That is asked where the eye looks through solid, at what it cannot see. `front` is 0 where
        both sides of a face are in the air.
        """
        first, count = self.first[:-1], np.diff(self.first)
        of = np.repeat(np.arange(len(self)), count)
        here = np.arange(len(self.angle))
        after = first[of] + (here - first[of] + 1) % count[of]
        wide = (self.angle[after] - self.angle) % (2.0 * np.pi)
        wide = np.where(after == here, 2.0 * np.pi, wide)
        air = (front >= 0) & (front[after] <= 0) & (wide > SAME)
        folded = air & (np.abs(np.pi - wide) > crease)
        return np.bincount(of[folded], minlength=len(self)) > 0

    def without(self, surface: Surface, segments: Segments, drawn: np.ndarray) -> Segments:
        """Cut out of segments what runs along stretches that are not `drawn`, (S,) bool."""
        if drawn.all() or not len(segments):
            return segments
        edge, t = _along_edges(surface, segments)
        first, last = np.searchsorted(self.edge, edge), np.searchsorted(self.edge, edge, "right")
        whole = (edge < 0) | (first == last)
        count = np.where(whole, 0, last - first)
        row = np.repeat(np.arange(len(segments)), count)
        stretch = np.repeat(first, count) + counting(count)
        row, stretch = row[drawn[stretch]], stretch[drawn[stretch]]
        low, high = t[row].min(axis=1), t[row].max(axis=1)
        start = np.maximum(self.start[stretch], low)
        end = np.minimum(self.end[stretch], high)
        some = end > start
        pieces = self._pieces(segments, row[some], stretch[some], t, start[some], end[some])
        return _joined(segments.take(np.flatnonzero(whole)), pieces)

    def _pieces(
        self,
        segments: Segments,
        row: np.ndarray,
        stretch: np.ndarray,
        t: np.ndarray,
        start: np.ndarray,
        end: np.ndarray,
    ) -> Segments:
        """Take of segments `row` (n,) what lies between `start` and `end` (n,) along their edge.

        New ends are named by the stretch that begins there, so that pieces are chained on.
        """
        found, t = segments.take(row), t[row]
        back = t[:, 0] > t[:, 1]
        cut = np.stack([np.where(back, end, start), np.where(back, start, end)], axis=1)
        share = (cut - t[:, :1]) / (t[:, 1:] - t[:, :1])
        names = np.stack(
            [np.where(back, stretch + 1, stretch), np.where(back, stretch, stretch + 1)]
        )
        keeps = np.stack([share[:, 0] < ROUNDING, share[:, 1] > 1.0 - ROUNDING], axis=1)
        node = np.where(keeps, found.node, -1 - names.T)
        weight = np.stack([1.0 - share, share], axis=2)  # (n, 2 new ends, 2 old ends)
        bary = np.einsum("nij,njk->nik", weight, found.bary)
        strength = np.einsum("nij,nj->ni", weight, found.strength)
        return replace(found, bary=bary, node=node, strength=strength)


def _joined(*parts: Segments) -> Segments:
    columns = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("face", "bary", "node", "strength")
    )
    return Segments(parts[0].kind, *columns)


def _along_edges(surface: Surface, segments: Segments) -> tuple[np.ndarray, np.ndarray]:
    """Find the mesh edge that each segment runs along, (S,), -1 for none, and from where to where.

    That is t (S, 2) in 0..1, from the edge's lower vertex on.
    """
    off = (segments.bary == 0.0).all(axis=1)
    on = off.any(axis=1)
    side = (off.argmax(axis=1) + 1) % 3  # from the corner after the one that is off
    edge = np.where(on, surface.face_edges[segments.face, side], -1)
    row = np.arange(len(segments))
    begin = surface.weld[surface.faces[segments.face, side]]
    t = segments.bary[row[:, None], [0, 1], ((side + 1) % 3)[:, None]]
    forward = begin == surface.edges[np.maximum(edge, 0), 0]
    return edge, np.where(forward[:, None], t, 1.0 - t)


@dataclass(frozen=True)
class _Frames:
    """Edges with the directions about them: low (M, 3), along, zero and quarter (M, 3)."""

    low: np.ndarray
    along: np.ndarray
    zero: np.ndarray
    quarter: np.ndarray

    @classmethod
    def of(cls, surface: Surface, edge: np.ndarray) -> _Frames:
        """Lay them out; angle 0 is some direction."""
        low, high = (surface.vertices[end] for end in surface.edges[edge].T)
        along = high - low
        unit = unit_rows(along)
        aside = np.eye(3)[np.abs(unit).argmin(axis=1)]
        zero = unit_rows(np.cross(unit, aside))
        return cls(low, along, zero, np.cross(unit, zero))

    def angle(self, row: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Measure the angles of directions (n, 3) about the edges `row` (n,)."""
        return np.arctan2(row_dot(out, self.quarter[row]), row_dot(out, self.zero[row]))


@dataclass(frozen=True)
class _FacesAt:
    """The faces at edges: first (M + 1,), where each edge's begin; their apexes (n, 3), fronts."""

    first: np.ndarray
    apex: np.ndarray
    front: np.ndarray
    face: np.ndarray

    @classmethod
    def of(cls, surface: Surface, edge: np.ndarray) -> _FacesAt:
        """Find those of edges (M,)."""
        wanted = np.full(len(surface.edges), -1)
        wanted[edge] = np.arange(len(edge))
        row = wanted[surface.face_edges]
        face, side = np.nonzero(row >= 0)
        order = np.argsort(row[face, side], kind="stable")
        face, side = face[order], side[order]
        row = row[face, side]
        apex = surface.vertices[surface.faces[face, (side + 2) % 3]]
        forward = surface.weld[surface.faces[face, side]] == surface.edges[edge[row], 0]
        front = np.where(forward, 1, -1).astype(np.int8)
        return cls(np.searchsorted(row, np.arange(len(edge) + 1)), apex, front, face)

    def of_rows(self, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the faces of edges `row` (n,): which of these, and which of the faces, (m,) each."""
        count = np.diff(self.first)[row]
        return np.repeat(np.arange(len(row)), count), np.repeat(self.first[row], count) + counting(
            count
        )


@dataclass(frozen=True)
class _Contacts:
    """Half planes of faces that touch edges: row (n,) of the edge, from where to where, fronts."""

    row: np.ndarray
    start: np.ndarray
    end: np.ndarray
    angle: np.ndarray
    front: np.ndarray
    face: np.ndarray


def _contacts(surface: Surface, edge: np.ndarray) -> _Contacts:
    """Find what touches edges (M,): faces of other bodies, and those at edges of the same place.

    Where boxes of more than MAX_NEAR faces meet that of an edge, on average, the mesh is a heap of
    faces and no shape made of parts: there those at edges of the same place alone are found, and a
    MeshWarning says so.
    """
    parts = [_same_place(surface, edge)]
    body = surface.component
    if len(edge) and np.ptp(body):
        corner = surface.vertices[surface.faces]
        ends = surface.vertices[surface.edges[edge]]
        # less the ends: what touches no more than these is no contact
        ends = ends + SHORT * (ends[:, ::-1] - ends)
        low = np.concatenate([ends.min(axis=1) - TOUCH, corner.min(axis=1)])
        high = np.concatenate([ends.max(axis=1) + TOUCH, corner.max(axis=1)])
        of_edge = body[surface.edge_faces[edge, 0]]
        is_face = np.repeat([0, 1], [len(edge), len(corner)])
        group = np.stack([np.r_[of_edge, body], is_face], axis=1)
        frame, normal = _Frames.of(surface, edge), surface.face_normals
        same, left = len(parts), max(MAX_NEAR * len(low), NEAR_FLOOR)
        for pairs in overlapping_boxes(low, high, group):
            left -= len(pairs)
            if left < 0:
                del parts[same:]
                warn(
                    "so many of its faces lie across each other that seams of bodies that touch "
                    "are drawn as edges"
                )
                break
            row, face = pairs[:, 0], pairs[:, 1] - len(edge)
            near = _near_plane(frame, row, corner[face, 0], normal[face])
            row, face = row[near], face[near]
            parts.append(_touching(frame, row, corner[face], normal[face], face))
    columns = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("row", "start", "end", "angle", "front", "face")
    )
    return _Contacts(*columns)


def _near_plane(
    frame: _Frames, row: np.ndarray, point: np.ndarray, normal: np.ndarray
) -> np.ndarray:
    """Find the edges `row` (P,) that may touch faces in planes with a point and normal (P, 3).

    They come as near as TOUCH to it, and run along it to a degree: normals of small faces are not
    known better.
    """
    along = frame.along[row]
    rise = row_dot(along, normal)
    height = row_dot(frame.low[row] - point, normal)
    level = rise * rise < LEVEL**2 * row_dot(along, along)
    return np.flatnonzero(
        level
        & (np.minimum(height, height + rise) <= TOUCH)
        & (np.maximum(height, height + rise) >= -TOUCH)
    )


def _touching(
    frame: _Frames, row: np.ndarray, corner: np.ndarray, normal: np.ndarray, face: np.ndarray
) -> _Contacts:
    """Find which faces (P,) with their corners (P, 3, 3) and normals touch edges `row` (P,), how.

    In the plane at right angles to the edge such a face is a line through it.
    """
    low, along = frame.low[row], frame.along[row]
    length = np.sqrt(row_dot(along, along))
    unit = along / length[:, None]
    near = np.minimum(TOUCH, SHORT * length)[:, None]
    rel = corner - low[:, None]
    s = row_dot(rel, unit[:, None])
    aside = rel - s[..., None] * unit[:, None]
    far = row_dot(aside, aside).argmax(axis=1)
    out = unit_rows(aside[np.arange(len(row)), far])
    height = row_dot(aside, out[:, None])
    off = aside - height[..., None] * out[:, None]
    flat = (row_dot(off, off) <= near**2).all(axis=1) & (height.max(axis=1) > near[:, 0])
    start, end = _cut_at_zero(s, np.where(np.abs(height) <= near, 0.0, height))
    start, end = np.maximum(start / length, 0.0), np.minimum(end / length, 1.0)
    good = np.flatnonzero(flat & (end - start > SHORT))
    angle = frame.angle(row, out)
    both = good[(height < -near)[good].any(axis=1)]  # the edge runs through the face
    index = np.r_[good, both]
    turned = np.r_[np.zeros(len(good)), np.full(len(both), np.pi)]
    front = np.where(row_dot(np.cross(unit, out), normal) > 0.0, 1, -1).astype(np.int8)[index]
    front[len(good) :] *= -1
    angle = angle[index] + turned
    return _Contacts(row[index], start[index], end[index], angle, front, face[index])


def _cut_at_zero(s: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find from where to where along s triangles (P, 3) have height 0; from +inf to -inf if not."""
    start, end = np.full(len(s), np.inf), np.full(len(s), -np.inf)
    for i in range(3):
        j = (i + 1) % 3
        crosses = height[:, i] * height[:, j] < 0.0
        t = height[:, i] / np.where(crosses, height[:, i] - height[:, j], 1.0)
        cut = s[:, i] + t * (s[:, j] - s[:, i])
        for at, here in ((cut, crosses), (s[:, i], height[:, i] == 0.0)):
            start = np.where(here, np.minimum(start, at), start)
            end = np.where(here, np.maximum(end, at), end)
    return start, end


def _places(surface: Surface, edge: np.ndarray) -> np.ndarray:
    """Name the ends of edges (M,) by their places, the lower first, (M, 2)."""
    used = np.unique(surface.edges[edge])
    place = np.arange(len(surface.vertices))
    place[used] = used[first_at_place(surface.vertices[used])]
    return np.sort(place[surface.edges[edge]], axis=1)


def _repeated(surface: Surface, edge: np.ndarray) -> np.ndarray:
    """Tell at which edges (M,) of two faces these lie as those of the first at that place do."""
    ends, frame = _places(surface, edge), _Frames.of(surface, edge)
    order = np.lexsort(ends.T)
    start = runs(*ends[order].T)
    first = order[np.repeat(start[:-1], np.diff(start))]
    again, first = order[order != first], first[order != first]
    both = (surface.edge_face_count[edge[again]] == 2) & (surface.edge_face_count[edge[first]] == 2)
    again, first = again[both], first[both]
    pair = [surface.edge_faces[edge[at]] for at in (again, first)]
    out = []
    for faces in pair:
        apex = surface.weld[surface.faces[faces]].sum(axis=2)
        at = again if faces is pair[0] else first
        apex -= surface.edges[edge[at]].sum(axis=1)[:, None]
        rel = surface.vertices[apex] - frame.low[again][:, None]
        out.append(np.stack([frame.angle(again, rel[:, i]) for i in (0, 1)], axis=1))
    apart = [np.abs(out[0] - turned) for turned in (out[1], out[1][:, ::-1])]
    apart = [np.minimum(gap, 2.0 * np.pi - gap).max(axis=1, initial=0.0) for gap in apart]
    repeated = np.zeros(len(edge), bool)
    repeated[again[np.minimum(*apart) < ALIKE]] = True
    return repeated


def _same_place(surface: Surface, edge: np.ndarray) -> _Contacts:
    """Find the half planes at edges (M,) of the faces of others that have the same ends."""
    ends = _places(surface, edge)
    order = np.lexsort(ends.T)
    start = runs(*ends[order].T)
    size = np.repeat(np.diff(start), np.diff(start))
    size[(size == 1) | (size > MAX_SAME)] = 0
    row = np.repeat(order, size)
    other = order[np.repeat(np.repeat(start[:-1], np.diff(start)), size) + counting(size)]
    row, other = row[row != other], other[row != other]
    own, frame = _FacesAt.of(surface, edge), _Frames.of(surface, edge)
    which, at = own.of_rows(other)
    same_way = row_dot(frame.along[row], frame.along[other])[which] > 0.0
    row = row[which]
    front = np.where(same_way, own.front[at], -own.front[at])
    angle = frame.angle(row, own.apex[at] - frame.low[row])
    return _Contacts(row, np.zeros(len(row)), np.ones(len(row)), angle, front, own.face[at])


def _stretches(
    contacts: _Contacts, touch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cut the edges `touch` (K,) that something touches where contacts begin and end.

    Returns the row of each stretch and from where to where it reaches, (S,) each; and which
    contacts are at which, (2, n), stretches first.
    """
    row = np.r_[touch, touch, contacts.row, contacts.row]
    cut = np.r_[np.zeros(len(touch)), np.ones(len(touch)), contacts.start, contacts.end]
    order = np.lexsort((cut, row))
    row, cut = row[order], cut[order]
    # cuts nearer than SHORT to the one before are one with it; the ends stay
    new = np.r_[True, (row[1:] != row[:-1]) | (np.diff(cut) > SHORT)]
    number = np.empty(len(order), np.int64)
    number[order] = np.cumsum(new) - 1
    row, cut = row[new], np.maximum.reduceat(cut, np.flatnonzero(new))
    cut = np.where(np.r_[True, row[1:] != row[:-1]], 0.0, cut)
    last = np.r_[row[1:] != row[:-1], True]
    stretch = np.cumsum(~last) - ~last  # of the one that begins at each cut
    begins, ends = (number[2 * len(touch) :][i * len(contacts.row) :] for i in (0, 1))
    begins, ends = begins[: len(contacts.row)], ends[: len(contacts.row)]
    count = ends - begins
    which = np.repeat(np.arange(len(count)), count)
    at = stretch[np.repeat(begins, count) + counting(count)]
    start, end = cut[~last], cut[1:][~last[:-1]]
    return row[~last], start, end, np.stack([at, which])
