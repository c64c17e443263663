"""A triangle soup while it is mended: what several steps ask of it is worked out once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .triangles import Edges, FaceShapes, clashes


@dataclass(frozen=True, eq=False)
class Soup:
    """Triangles that are being mended.

    Parameters
    ----------
    points : (V, 3), longest side 1
    faces : (F, 3) int
    kept : (F,) int, the face given that each is, or was cut from
    """

    points: np.ndarray
    faces: np.ndarray
    kept: np.ndarray

    @cached_property
    def edges(self) -> Edges:
        """The edges of the faces."""
        return Edges.of(self.faces, len(self.points))

    @cached_property
    def shape(self) -> FaceShapes:
        """How large the faces are."""
        return FaceShapes.of(self.points, self.faces)

    @cached_property
    def clashing_edges(self) -> np.ndarray:
        """(E,) bool, edges along which both faces run the same way."""
        return clashes(self.faces, self.edges)

    def take(self, which: np.ndarray) -> Soup:
        """Take the faces of a mask (F,)."""
        return self if which.all() else self.with_faces(self.faces[which], self.kept[which])

    def with_faces(self, faces: np.ndarray, kept: np.ndarray) -> Soup:
        """Make a soup of other faces over the same points."""
        return Soup(self.points, faces, kept)

    def compact(self) -> Soup:
        """Drop the points that no face uses; the others keep their order."""
        used = np.zeros(len(self.points), bool)
        used[self.faces] = True
        if used.all():
            return self
        number = np.cumsum(used) - 1
        after = Soup(self.points[used], number[self.faces], self.kept)
        after.__dict__["edges"] = replace(self.edges, ends=number[self.edges.ends])
        return after
