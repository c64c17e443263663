"""Places on the surface: what a point of a line keeps while camera and shape move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..extract.surface_curves import barycentric, interpolate_on_faces
from .frames import Shot


@dataclass(frozen=True)
class Places:
    """Where on a surface N points of lines lie, and how far off it they are drawn.

    Parameters
    ----------
    face : (N,) int
    bary : (N, 3), weights of its corners
    offset : (N, 2) px of the canvas from where the place is seen to where the line is drawn:
        tidied, lines are smoothed and bridge gaps
    """

    face: np.ndarray
    bary: np.ndarray
    offset: np.ndarray

    @classmethod
    def of(cls, shot: Shot, face: np.ndarray, point: np.ndarray, xy: np.ndarray) -> Places:
        """Find the places of points in space (N, 3) in faces (N,), drawn at pixels `xy` (N, 2)."""
        surface = shot.surface
        with np.errstate(divide="ignore", invalid="ignore"):
            bary = barycentric(surface.vertices[surface.faces[face]], point[:, None])[:, 0]
        lost = ~np.isfinite(bary).all(axis=1)  # in a face without area
        bary[lost] = (1.0, 0.0, 0.0)
        places = cls(face, bary, np.zeros((len(face), 2)))
        return cls(face, bary, xy - places.seen(shot)[0])

    def __len__(self) -> int:
        return len(self.face)

    def take(self, rows: np.ndarray) -> Places:
        """Select the points of an index or mask, in that order."""
        return Places(self.face[rows], self.bary[rows], self.offset[rows])

    @classmethod
    def concatenate(cls, parts: list[Places]) -> Places:
        """Put places one after the other."""
        if not parts:
            return cls(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 2)))
        face, bary, offset = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("face", "bary", "offset")
        )
        return cls(face, bary, offset)

    def points(self, shot: Shot) -> np.ndarray:
        """Place them in space, on the surface of a shot, (N, 3)."""
        return interpolate_on_faces(shot.surface, self.face, self.bary, shot.surface.vertices)

    def normals(self, shot: Shot) -> np.ndarray:
        """Interpolate the normals of a shot's surface, (N, 3), of no set length."""
        return interpolate_on_faces(shot.surface, self.face, self.bary, shot.surface.normals)

    def seen(self, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
        """Project them by a shot: pixels (N, 2), with their offsets, and depth (N,)."""
        xy, depth = shot.camera.project(self.points(shot))
        return xy + self.offset, depth
