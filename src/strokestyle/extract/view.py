"""View = camera + visible curves + feature maps.

One shape from one camera, and all that the networks ever see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..geometry.curves import Curves, arc_length, owner, stretches
from ..geometry.parts import Parts
from .camera import Camera
from .feature_maps import FeatureMaps
from .seen_surface import background_of

DEPTH_STEP = 0.01  # of the depth: a jump, not a slope
FRONT_REACH = 2  # px, how far from a line the part in front is looked for
RIM_REACH = 6  # px, how far from a line that missed the shape its rim is looked for at once


@dataclass(frozen=True)
class View:
    """One shape from one camera.

    Parameters
    ----------
    camera : Camera
    curves : Curves, visible, evenly spaced, within the canvas
    maps : FeatureMaps of the camera's size
    hidden : Curves behind the surface, where they were asked for
    parts, hidden_parts : the named part of the shape that each point of the curves, and of the
        hidden ones, lies on; None where the shape has but one
    strength : (N,) float64 in 0..1, how far above its threshold a line is at each point of the
        curves, 1 for hard lines; None where nothing is known of it, as of curves from elsewhere
    optional : (C,) bool, the curves that are weaker than those of the detail asked for: an artist
        may draw them, and nobody else does; None where there are none

    Raises
    ------
    ValueError
        where the maps are not of the camera's size, or parts, strength or optional do not fit the
        curves.
    """

    camera: Camera
    curves: Curves
    maps: FeatureMaps
    hidden: Curves = field(default_factory=Curves.empty)
    parts: Parts | None = None
    hidden_parts: Parts | None = None
    strength: np.ndarray | None = None
    optional: np.ndarray | None = None

    def __post_init__(self):
        height, width = self.maps.size
        if (height, width) != (self.camera.height, self.camera.width):
            raise ValueError(
                f"View.maps are {width} x {height} px, "
                f"its camera {self.camera.width} x {self.camera.height}"
            )
        for parts, curves in ((self.parts, self.curves), (self.hidden_parts, self.hidden)):
            if parts is not None and len(parts) != len(curves.xy):
                raise ValueError(
                    f"View.parts must name the part of {len(curves.xy)} points, not of {len(parts)}"
                )
        self._keep("strength", np.float64, (len(self.curves.xy),))
        self._keep("optional", bool, (len(self.curves),))

    def _keep(self, name: str, kind: type, shape: tuple[int]) -> None:
        """Make an array of a field that may be None; ValueError unless it is finite, of a shape."""
        if getattr(self, name) is None:
            return
        value: np.ndarray = np.asarray(getattr(self, name), kind)
        if value.shape != shape or not np.isfinite(value).all():
            raise ValueError(f"View.{name} must be finite, of shape {shape}, got {value.shape}")
        object.__setattr__(self, name, value)

    @property
    def required(self) -> np.ndarray:
        """Tell which points of the curves are of lines that are not optional, (N,) bool."""
        if self.optional is None:
            return np.ones(len(self.curves.xy), bool)
        return ~self.optional[owner(self.curves.offsets)]

    def only(self, keep: np.ndarray) -> View:
        """Cut the curves down to stretches of two or more points that are kept, (N,) bool.

        Strength and parts go with them; a closed curve that is cut is open. The raster of the
        curves among the maps is drawn anew where it is there; hidden curves stay.
        """
        keep = np.asarray(keep, bool)
        if keep.all():
            return self
        left, rows, of = stretches(self.curves, keep)
        return replace(
            self,
            curves=left,
            maps=self.maps.with_curves(left),
            parts=None if self.parts is None else self.parts.take(rows),
            strength=None if self.strength is None else self.strength[rows],
            optional=None if self.optional is None else self.optional[of],
        )

    @property
    def curve_parts(self) -> Parts | None:
        """Name the part of each curve, that of most of its points."""
        return None if self.parts is None else self.parts.vote(self.curves.offsets)

    @property
    def hidden_curve_parts(self) -> Parts | None:
        """Name the part of each hidden curve, that of most of its points."""
        return None if self.hidden_parts is None else self.hidden_parts.vote(self.hidden.offsets)

    def pieces_by_part(self, hidden: bool = False) -> tuple[Curves, Parts | None]:
        """Cut the curves, or the hidden ones, where they run from one part into another.

        Returns
        -------
        the pieces, and the part of each; the curves as they are and None where all is one part
        """
        curves, parts = (self.hidden, self.hidden_parts) if hidden else (self.curves, self.parts)
        if parts is None:
            return curves, None
        made = parts.cut(curves.offsets, arc_length(curves.xy, curves.offsets))
        kind, closed = curves.kind[made.line], curves.closed[made.line] & made.whole
        return Curves(curves.xy[made.rows], made.offsets, kind, closed), made.parts

    def at_curves(self, names: Sequence[str], xy: np.ndarray | None = None) -> np.ndarray:
        """Read maps at the curves' points, or at pixels `xy` (N, 2): (N, len(names)) float32.

        A line often lies where one part of the surface hides another, or on the rim of the shape,
        half a pixel off. It belongs to the part in front: where some pixel within FRONT_REACH px
        shows a surface clearly nearer to the eye than the pixel under the point does, or that one
        shows none, the nearest pixel of the nearer surface is read instead. Where no surface is
        seen at all, the maps' background is read.
        """
        xy = self.curves.xy if xy is None else np.asarray(xy, np.float64)
        if not len(xy) or not self.maps.covered.any():
            background = np.array([background_of(name) for name in names], np.float32)
            return np.broadcast_to(background, (len(xy), len(names))).copy()
        row, column = self._front_pixels(xy)
        lost = ~self.maps.covered[row, column]
        row[lost], column[lost] = _nearest_covered(self.maps.covered, row[lost], column[lost])
        return self.maps.read(names, row, column)

    def _front_pixels(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Choose for points (N, 2) the row and column (N,) of the pixel that shows the front.

        That is the pixel under the point unless a surface clearly nearer to the eye is seen within
        FRONT_REACH px; then the pixel of that surface nearest to the point.
        """
        height, width = self.maps.size
        depth = np.where(self.maps.covered, self.maps["depth"], np.inf)
        column, row = (
            np.clip(np.floor(xy[:, i]).astype(np.int64), 0, n - 1)
            for i, n in enumerate((width, height))
        )
        dy, dx = _disc(FRONT_REACH)
        near_row = np.clip(row[:, None] + dy, 0, height - 1)
        near_column = np.clip(column[:, None] + dx, 0, width - 1)
        around = depth[near_row, near_column]  # (N, pixels of the disc)
        front = around.min(axis=1)
        moved = front < depth[row, column] * (1.0 - DEPTH_STEP)
        away = (near_column + 0.5 - xy[:, :1]) ** 2 + (near_row + 0.5 - xy[:, 1:]) ** 2
        away[around > front[:, None] * (1.0 + DEPTH_STEP)] = np.inf
        best = away.argmin(axis=1)[:, None]
        row = np.where(moved, np.take_along_axis(near_row, best, 1)[:, 0], row)
        column = np.where(moved, np.take_along_axis(near_column, best, 1)[:, 0], column)
        return row, column


def _nearest_covered(
    covered: np.ndarray, row: np.ndarray, column: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find for pixels (N,) the nearest one that is covered; of equals the first by column, row.

    `covered` (H, W) bool holds at least one. Most lie by the rim: only where none is found within
    RIM_REACH px, the distance to every pixel is worked out.
    """
    dy, dx = _disc(RIM_REACH)
    order = np.lexsort((dy, dx, dx * dx + dy * dy))
    dy, dx = dy[order], dx[order]
    around = np.pad(covered, RIM_REACH)[
        row[:, None] + (RIM_REACH + dy), column[:, None] + (RIM_REACH + dx)
    ]
    first = around.argmax(axis=1)
    to_row, to_column = row + dy[first], column + dx[first]
    far = ~around.any(axis=1)
    if far.any():
        from scipy.ndimage import distance_transform_edt

        _, every = distance_transform_edt(~covered, return_indices=True)
        to_row[far], to_column[far] = every[:, row[far], column[far]]
    return to_row, to_column


def _disc(radius: int) -> tuple[np.ndarray, np.ndarray]:
    """List the pixels within `radius` px of one: rows and columns relative to it, row by row."""
    reach = np.arange(-radius, radius + 1)
    dy, dx = (d.ravel() for d in np.meshgrid(reach, reach, indexing="ij"))
    inside = dx * dx + dy * dy <= radius**2
    return dy[inside], dx[inside]
