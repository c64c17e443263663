"""View = camera + visible curves + feature maps: one shape from one camera, and all that the networks ever see."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..geometry.curves import Curves, arc_length
from ..geometry.parts import Parts
from .camera import Camera
from .feature_maps import NORMAL_MAPS, FeatureMaps

DEPTH_STEP = 0.01  # of the depth: a jump, not a slope


@dataclass(frozen=True)
class View:
    """One shape from one camera.

    Parameters
    ----------
    camera : Camera
    curves : Curves, visible, evenly spaced, within the canvas
    maps : FeatureMaps of the camera's size
    hidden : Curves behind the surface, where they were asked for
    parts, hidden_parts : the named part of the shape that each point of the curves, and of the hidden ones, lies on;
        None where the shape has but one
    """

    camera: Camera
    curves: Curves
    maps: FeatureMaps
    hidden: Curves = field(default_factory=Curves.empty)
    parts: Parts | None = None
    hidden_parts: Parts | None = None

    def __post_init__(self):
        if self.maps.covered.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"View.maps are {self.maps.covered.shape[1]} x {self.maps.covered.shape[0]} px, "
                f"its camera {self.camera.width} x {self.camera.height}"
            )
        for parts, curves in ((self.parts, self.curves), (self.hidden_parts, self.hidden)):
            if parts is not None and len(parts) != len(curves.xy):
                raise ValueError(
                    f"View.parts must name the part of {len(curves.xy)} points, not of {len(parts)}"
                )

    @property
    def curve_parts(self) -> Parts | None:
        """The part of each curve, that of most of its points."""
        return None if self.parts is None else self.parts.vote(self.curves.offsets)

    @property
    def hidden_curve_parts(self) -> Parts | None:
        """The part of each hidden curve."""
        return None if self.hidden_parts is None else self.hidden_parts.vote(self.hidden.offsets)

    def pieces_by_part(self, hidden: bool = False) -> tuple[Curves, Parts | None]:
        """The curves, or the hidden ones, cut where they run from one part into another; and the part of each piece."""
        curves, parts = (self.hidden, self.hidden_parts) if hidden else (self.curves, self.parts)
        if parts is None:
            return curves, None
        made = parts.cut(curves.offsets, arc_length(curves.xy, curves.offsets))
        kind, closed = curves.kind[made.line], curves.closed[made.line] & made.whole
        return Curves(curves.xy[made.rows], made.offsets, kind, closed), made.parts

    def at_curves(self, names, xy: np.ndarray | None = None) -> np.ndarray:
        """Maps read at the curves' points, or at pixels `xy` (N, 2): (N, len(names)) float32.

        A line often lies where one part of the surface hides another, or on the rim of the shape, half a pixel off. It
        belongs to the part in front: where some pixel within 2 px shows a surface clearly nearer to the eye than the
        pixel under the point does, or that one shows none, the nearest pixel of the nearer surface is read instead.
        """
        xy = self.curves.xy if xy is None else np.asarray(xy, np.float64)
        rows = [self.maps.names.index(name) for name in names]
        height, width = self.maps.covered.shape
        if not len(xy) or not self.maps.covered.any():
            return np.broadcast_to(
                np.float32([name not in NORMAL_MAPS for name in names]), (len(xy), len(rows))
            ).copy()
        depth = np.where(self.maps.covered, self.maps["depth"], np.inf)
        column, row = (
            np.clip(np.floor(xy[:, i]).astype(np.int64), 0, n - 1)
            for i, n in enumerate((width, height))
        )
        r = np.arange(-2, 3)
        dy, dx = (d.ravel() for d in np.meshgrid(r, r, indexing="ij"))
        disc = dx * dx + dy * dy <= 4
        near_row = np.clip(row[:, None] + dy[disc], 0, height - 1)
        near_column = np.clip(column[:, None] + dx[disc], 0, width - 1)
        around = depth[near_row, near_column]  # (N, 13)
        front = around.min(axis=1)
        moved = front < depth[row, column] * (1.0 - DEPTH_STEP)
        # of the pixels of the part in front, the nearest to the point
        away = (near_column + 0.5 - xy[:, :1]) ** 2 + (near_row + 0.5 - xy[:, 1:]) ** 2
        away[around > front[:, None] * (1.0 + DEPTH_STEP)] = np.inf
        best = away.argmin(axis=1)[:, None]
        row = np.where(moved, np.take_along_axis(near_row, best, 1)[:, 0], row)
        column = np.where(moved, np.take_along_axis(near_column, best, 1)[:, 0], column)
        lost = ~self.maps.covered[row, column]
        if lost.any():
            _, (to_row, to_column) = distance_transform_edt(~self.maps.covered, return_indices=True)
            row, column = (
                np.where(lost, to_row[row, column], row),
                np.where(lost, to_column[row, column], column),
            )
        return self.maps.values[np.array(rows)[:, None], row, column].T
