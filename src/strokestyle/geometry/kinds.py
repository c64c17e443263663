"""The kinds of line, and all that differs between them, in one table."""

from __future__ import annotations

from typing import NamedTuple


class Kind(NamedTuple):
    """One kind of line.

    Parameters
    ----------
    name : as options, files and layers have it
    soft : describes the form between the lines that the shape cannot be understood without. Soft
        lines are read off curvature, so that noise of the mesh tells; all other lines are hard.
    sharp : an edge of the mesh
    follows_camera : found anew for each camera; the others lie still on the surface, and are found
        once. A crease follows it as far as it gives way to a contour.
    weight : by how much its length counts where two kinds compete for one place
    prominence : how much it matters to the shape, as a style's features have it: one number, so
        that a kind that the exemplar lacks lies between its neighbours
    """

    name: str
    soft: bool = False
    sharp: bool = False
    follows_camera: bool = False
    weight: float = 1.0
    prominence: float = 0.0


# Files hold indices into this table: new kinds come last.
KIND_TABLE = (
    Kind("contour", follows_camera=True, prominence=1.0),
    Kind("boundary", sharp=True, prominence=1.0),
    Kind("crease", sharp=True, follows_camera=True, weight=2.0, prominence=0.5),
    Kind("suggestive", soft=True, follows_camera=True, weight=1.3),
    Kind("ridge", soft=True),
    Kind("valley", soft=True),
    Kind("apparent", soft=True, follows_camera=True, weight=0.7),
    Kind("intersection", sharp=True, prominence=0.5),
    Kind("other"),
    Kind("section", sharp=True, weight=2.0, prominence=1.0),
)
KINDS = tuple(kind.name for kind in KIND_TABLE)
# Where two hard lines run together, the earlier kind stays; it is painted over the later ones.
PRIORITY = ("section", *(name for name in KINDS if name != "section"))
SURFACE_KINDS = tuple(name for name in KINDS if name != "other")  # those found on a surface
SOFT_KINDS = tuple(kind.name for kind in KIND_TABLE if kind.soft)
SHARP_KINDS = tuple(kind.name for kind in KIND_TABLE if kind.sharp)
HARD_KINDS = tuple(name for name in SURFACE_KINDS if name not in SOFT_KINDS)  # drawn hidden too
