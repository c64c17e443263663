"""Carry triangles, and what is measured on them, through the planes of a section."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .surface import Surface

FIELDS = ("normals", "k1", "k2", "pdir1", "pdir2", "dcurv")


@dataclass(frozen=True, eq=False)
class CutMesh:
    """Triangles on their way through the planes.

    Parameters
    ----------
    at : of each vertex its place, and the fields of FIELDS
    weld, origin : (V,), as Surface and Section have them
    faces : (F, 3)
    source, part, polygon : (F,), as Section and Surface have them
    body : (F,) int, the connected body of each face; hollows are of the body that they lie in
    closed : (F,) bool, of a solid body
    rim : (F, 3) bool, sides along which it was cut
    """

    at: dict[str, np.ndarray]
    weld: np.ndarray
    origin: np.ndarray
    faces: np.ndarray
    source: np.ndarray
    part: np.ndarray
    polygon: np.ndarray
    body: np.ndarray
    closed: np.ndarray
    rim: np.ndarray

    @classmethod
    def of(cls, surface: Surface, body: np.ndarray, closed: np.ndarray) -> CutMesh:
        """Take all of a surface whose faces are of bodies (F,), closed ones (F,) bool or not."""
        count = len(surface.faces)
        return cls(
            {name: getattr(surface, name) for name in ("vertices", *FIELDS)},
            surface.weld,
            np.arange(len(surface.vertices)),
            surface.faces,
            np.arange(count),
            surface.part,
            surface.polygon,
            body,
            closed,
            np.zeros((count, 3), bool),
        )

    def of_faces(self, index: np.ndarray, faces: np.ndarray, rim: np.ndarray) -> CutMesh:
        """Put other corners and rims in the place of those of faces `index` (M,)."""
        names = ("source", "part", "polygon", "body", "closed")
        return replace(
            self, faces=faces, rim=rim, **{name: getattr(self, name)[index] for name in names}
        )


class Rim(NamedTuple):
    """Sides of faces that lie in a plane after the cut.

    Parameters
    ----------
    face, side : (R,) int
    fresh : (R,) bool, something lay beyond that was cut off there
    """

    face: np.ndarray
    side: np.ndarray
    fresh: np.ndarray
