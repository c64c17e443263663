"""What a ray hits, and whether a point of the surface is seen.

This module alone knows what embree's float32 does to it, and its self-hits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..mesh.surface import Surface
from ..mesh.triangles import bounds, row_dot, unit_rows
from .embree import FirstHits, scene
from .eye import at_infinity
from .face_shapes import FaceShapes, mean_around

NEAR_BY = 4.0  # longest sides of the shape from its middle: an eye that is not far away
MAX_ROUNDS = 12  # re-traces past ignored hits; what is still open then counts as hidden

# In widths of the face that a point lies on: its mean edge, or less where it is long and thin. On
# contours of 8 scans and bodies, against the same meshes made smooth (curved point-normal
# triangles): lift 0.05 loses 3 % of what is seen, 0.1 with NEAR 0.4 %; 0.15 shows 2 % too much.
LIFT = 0.1  # along the normal, of the points of smooth lines
NEAR = 0.75  # how far a smooth line's own neighbourhood may stand in front of it

# In longest sides of all that there is to hit.
COPLANAR = 3e-6  # what files of six digits leave of a plane
FLOAT32 = 1e-6  # rounding of where embree hits something

# Told rays k (N,) that hit faces (N,) with a gap (N,) still to go, in embree's units: which of them
# go on all the same, (N,) bool.
Ignore = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Hits:
    """What N rays hit first.

    Parameters
    ----------
    face : (N,) int64, -1 where a ray hits nothing
    bary : (N, 3) float64, barycentric coordinates in that face, 0 where it hits nothing
    distance : (N,) float64 from the origin, infinite where it hits nothing
    """

    face: np.ndarray
    bary: np.ndarray
    distance: np.ndarray


class Bvh:
    """One bounding volume hierarchy over a surface, and the two questions it answers.

    Parameters
    ----------
    surface : Surface, or anything with vertices (V, 3), faces (F, 3) and unit normals (V, 3);
        where it has `component` (F,), its connected bodies are told apart
    shapes : of its faces, where they are known
    """

    def __init__(self, surface: Surface, shapes: FaceShapes | None = None) -> None:
        self._shapes = shapes
        self.vertices = np.asarray(surface.vertices, np.float64)
        self.faces = np.asarray(surface.faces, np.int64)
        self.normals = np.asarray(surface.normals, np.float64)
        # embree works in float32: bring every mesh to the same place and size
        low, high = bounds(self.vertices) if len(self.vertices) else (0.0, 1.0)
        self._centre, self._scale = 0.5 * (low + high), 1.0 / max(float(np.max(high - low)), 1e-300)
        component = getattr(surface, "component", None)
        self.component = component if component is not None and np.ptp(component) else None
        empty = not len(self.faces)
        self._scene = None if empty else scene(self._local(self.vertices), self.faces)

    def _local(self, points: np.ndarray) -> np.ndarray:
        """Move points (..., 3) from the world into embree's units, float32."""
        return np.ascontiguousarray((points - self._centre) * self._scale, dtype=np.float32)

    @cached_property
    def _known_shapes(self) -> FaceShapes:
        return self._shapes or FaceShapes.of(self.vertices, self.faces)

    @cached_property
    def _heights(self) -> np.ndarray:
        """The mean height of the faces round each vertex, (V,)."""
        height = self._known_shapes.area / np.maximum(self._known_shapes.longest, 1e-300)
        return mean_around(self.faces, height, len(self.vertices))

    def _widths(self, face: np.ndarray) -> np.ndarray:
        """Measure the widths of faces (N,): the mean edge, at most three times the height there.

        The height is the mean of the faces at a corner, of the corner where it is most: slivers
        among better faces count as these.
        """
        one, two, three = (self._heights[corner] for corner in self.faces[face].T)
        most = np.maximum(np.maximum(one, two), three)
        return np.minimum(self._known_shapes.mean_side[face], 3.0 * most)

    def _run(self, origins: np.ndarray, directions: np.ndarray) -> FirstHits:
        """Trace rays (N, 3) in embree's own units; distances are in lengths of the directions."""
        if self._scene is None:
            nothing = np.zeros(origins.size // 3, np.float32)
            return FirstHits(np.full(len(nothing), -1, np.int32), nothing, nothing, nothing)
        return self._scene.first_hits(origins, directions.astype(np.float32, copy=False))

    def first_faces(self, origins: np.ndarray, directions: np.ndarray) -> FirstHits:
        """Trace rays to what they hit first; distances are in lengths of their directions.

        Parameters
        ----------
        origins : (3,) or as directions, world units
        directions : (N, 3) of any length, or (N / RAYS, RAYS, 3) of rays alongside each other
        """
        directions = directions.astype(np.float32, copy=False)
        origins = np.broadcast_to(self._local(np.asarray(origins, np.float64)), directions.shape)
        return self._run(origins, directions)

    def first_hit(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """Trace rays to what they hit first, and tell where that is; arguments are the same."""
        directions = np.ascontiguousarray(directions, dtype=np.float32)
        found = self.first_faces(origins, directions)
        miss = found.face < 0
        bary = np.stack([1.0 - found.u - found.v, found.u, found.v], axis=1).astype(np.float64)
        bary[miss] = 0.0
        length = np.sqrt(np.einsum("ij,ij->i", directions, directions))
        distance = np.where(miss, np.inf, found.distance) * (length / self._scale)
        return Hits(found.face.astype(np.int64), bary, distance)

    def seen(
        self,
        eye: np.ndarray,
        face: np.ndarray,
        position: np.ndarray,
        sharp: np.ndarray,
        side: np.ndarray | None = None,
    ) -> np.ndarray:
        """Tell which points of lines on the surface are seen from the eye.

        A contour lies where the mesh folds away from the eye, so that about half of it is hidden,
        by a hair, by its own neighbourhood. Hence a smooth line (not `sharp`) is looked for LIFT
        above the surface, and a face that touches its own and stands at most NEAR before it does
        not hide it; but the lift does not show it through another body. A crease or a boundary
        (`sharp`) is a true edge of the mesh, hidden by whatever stands before it. Rays start at the
        eye, so that what hides a point comes first and its doubtful neighbourhood last.

        Parameters
        ----------
        eye : (3,), or (4,) in homogeneous coordinates: at infinity where the last is 0
        face : (N,) int, the face that each point lies on
        position : (N, 3)
        sharp : (N,) bool, the point lies on an edge of the mesh that is a line by itself
        side : (N,) 1 or -1, on which side of the surface smooth lines are looked for; by default
            where its normals point

        Returns
        -------
        (N,) bool
        """
        face, sharp = np.asarray(face, np.int64), np.asarray(sharp, bool)
        position = np.asarray(position, np.float64)
        eye = np.asarray(eye, np.float64)
        smooth = np.flatnonzero(~sharp)
        width, above = np.zeros(len(face)), np.zeros((len(face), 3))
        width[smooth] = self._widths(face[smooth])
        # of the whole face: enough for a lift
        one, two, three = (self.normals.take(c, axis=0) for c in self.faces[face[smooth]].T)
        above[smooth] = unit_rows(one + two + three)
        if side is not None:
            above *= np.asarray(side, np.float64)[:, None]

        def near_itself(k: np.ndarray, hit: np.ndarray, gap: np.ndarray) -> np.ndarray:
            own, touches = self.faces[face[k]].T, np.zeros(len(k), bool)
            for corner in self.faces[hit].T:
                touches |= (corner == own[0]) | (corner == own[1]) | (corner == own[2])
            near = gap < NEAR * width[k] * self._scale
            return ~sharp[k] & touches & near

        result = self._reached(eye, position + above * (LIFT * width)[:, None], near_itself)
        if self.component is not None:
            lifted = np.flatnonzero(result & ~sharp)
            result[lifted] = self._clear_of_other_bodies(
                eye, face[lifted], position[lifted], above[lifted], width[lifted]
            )
        return result

    def _clear_of_other_bodies(
        self,
        eye: np.ndarray,
        face: np.ndarray,
        position: np.ndarray,
        above: np.ndarray,
        width: np.ndarray,
    ) -> np.ndarray:
        """Tell which points (N, 3) on faces (N,) no other body of the surface hides, (N,) bool.

        Another body's skin may lie within the lift: cloth over skin, a coin sunk in its rim. Facets
        lie below the smooth surface by their sag, width^2 / 8 radius: from there, even a body of
        the same shape would hide it. `above` (N, 3) and `width` (N,) are those of the faces.
        """
        corner = self.normals[self.faces[face]]
        spread = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
        sag = np.minimum(spread / 8.0, LIFT) * width
        body = self.component
        assert body is not None  # asked only where bodies are told apart
        own = body[face]
        target = position + above * sag[:, None]
        return self._reached(eye, target, lambda k, hit, gap: body[hit] == own[k])

    def _reached(self, eye: np.ndarray, target: np.ndarray, ignore: Ignore) -> np.ndarray:
        """Tell which of the targets (N, 3) a ray from the eye reaches, (N,) bool.

        Hits that `ignore` tells to ignore are passed, and the ray goes on behind them. So are faces
        in whose plane the target lies: seen at a grazing angle, they may seem to stand before it.
        """
        if not len(target):
            return np.zeros(0, bool)
        start, ray, reach = self._sight_lines(eye, target)
        slack = FLOAT32 * (reach + np.maximum.reduce(np.abs(start.T)) + 1.0)
        passed = np.zeros(len(ray))  # how far along each ray everything has been looked at
        result = np.zeros(len(ray), bool)
        open_ = np.arange(len(ray))
        for _ in range(MAX_ROUNDS):
            if not len(open_):
                break
            hit, distance = self._next_hit(start[open_], ray[open_], passed[open_])
            gap = reach[open_] - distance
            free = (hit < 0) | (gap <= slack[open_])
            result[open_[free]] = True
            hit, gap, distance, open_ = hit[~free], gap[~free], distance[~free], open_[~free]
            passed[open_] = distance + slack[open_]
            open_ = open_[self._in_plane(hit, target[open_]) | ignore(open_, hit, gap)]
        return result

    def _sight_lines(
        self, eye: np.ndarray, target: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Draw lines from the eye to targets (N, 3): starts and unit rays (N, 3), lengths (N,).

        In embree's units. From an eye at infinity they are parallel, and start outside all that is
        in it: on a plane across them, at twice the radius of a ball round its box.
        """
        if not at_infinity(eye):
            ray = target - eye[:3]
            length = np.linalg.norm(ray, axis=1)
            ray /= np.maximum(length, 1e-300)[:, None]
            start, length = self._into_box(eye[:3], ray, length)
            return start, ray, length * self._scale
        ray = np.broadcast_to(-eye[:3] / np.linalg.norm(eye[:3]), target.shape)
        local = (target - self._centre) * self._scale  # its box has a longest side of 1
        reach = np.sqrt(3.0) + local @ ray[0]
        return (local - ray * reach[:, None]).astype(np.float32), ray, reach

    def _into_box(
        self, eye: np.ndarray, ray: np.ndarray, length: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Move on along unit rays (N, 3) of some `length` (N,) to where they meet the shape's box.

        Returns where that is in embree's units (N, 3), and what is left of the length. A distant
        eye's own coordinates would cost embree all its digits; near by they do no harm.
        """
        start = self._local(eye)
        if np.abs(start).max() < NEAR_BY:
            return np.broadcast_to(start, ray.shape), length
        half = 0.5 / self._scale
        towards = np.where(np.abs(ray) < 1e-300, 1e-300, ray)
        enters = ((self._centre - eye) - np.sign(towards) * half) / towards
        on = np.clip(np.maximum.reduce(enters.T), 0.0, length)
        return self._local(eye + ray * on[:, None]), length - on

    def _in_plane(self, face: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Tell which points (N, 3) lie in the planes of faces (N,), up to COPLANAR, (N,) bool."""
        first, second, third = (self.vertices[self.faces[face, i]] for i in range(3))
        across = np.cross(second - first, third - first)
        off = row_dot(across, point - first) * self._scale
        return np.abs(off) <= COPLANAR * np.sqrt(row_dot(across, across))

    def _next_hit(
        self, start: np.ndarray, ray: np.ndarray, passed: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find the next face that each ray (N, 3) from its start hits after `passed`, and how far.

        Distances are from the starts (N, 3).
        """
        origin = start + (ray * passed[:, None]).astype(np.float32)
        found = self._run(origin.astype(np.float32, copy=False), ray)
        return found.face.astype(np.int64), passed + found.distance
