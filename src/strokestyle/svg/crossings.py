"""Keep the edges of a tone from crossing each other, and themselves.

Programs that fill by the nonzero rule show such a tone all the same. Others leave out what lies
within two edges, or cut the area into triangles and lose half of it to one crossing of a hundredth
of a pixel. A group is the polygons of one tone of one stroke.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..geometry.curves import take_ragged
from ..geometry.polygons import following, overlap, united

FINE = 4  # pieces of a polyline for each of a spline
MUCH = 10.0  # of area, in square units of the polygons


class Groups(NamedTuple):
    """Closed polygons in groups.

    `points` (M, 2), polygon r is rows offsets[r]:offsets[r+1]; `group` (R,) int names its group.
    """

    points: np.ndarray
    offsets: np.ndarray
    group: np.ndarray

    def those(self, keep: np.ndarray) -> Groups:
        """The polygons that are kept, (R,) bool."""
        rows, offsets = take_ragged(self.offsets, np.flatnonzero(keep))
        return Groups(self.points[rows], offsets, self.group[keep])

    def joined(self, more: Groups) -> Groups:
        """These polygons and more."""
        offsets = np.r_[self.offsets, self.offsets[-1] + more.offsets[1:]]
        points = np.concatenate([self.points, more.points])
        return Groups(points, offsets, np.r_[self.group, more.group])

    def members(self) -> list[tuple[int, list[np.ndarray]]]:
        """The name of each group, and its polygons (n, 2)."""
        if not len(self.group):
            return []
        rings = np.split(self.points, self.offsets[1:-1])
        order = np.argsort(self.group, kind="stable")
        own = np.split(order, np.flatnonzero(np.diff(self.group[order])) + 1)
        return [(int(self.group[mine[0]]), [rings[k] for k in mine]) for mine in own]


def crossing_groups(polygons: Groups) -> tuple[np.ndarray, np.ndarray]:
    """Find the groups of control polygons whose B-splines cross, and those that do so by much.

    Both (G,) int.
    """
    edges = Groups(_splines(polygons), FINE * polygons.offsets, polygons.group)
    found = [(name, overlap(own)) for name, own in edges.members()]
    crossed = [name for name, area in found if area is not None]
    much = [name for name, area in found if area is not None and area > MUCH]
    return np.array(crossed, np.int64), np.array(much, np.int64)


def united_groups(contours: Groups) -> Groups:
    """Unite the contours of each group, px, where they cross by more than a speck."""
    return _replaced(contours, united)


def separated_groups(polygons: Groups) -> Groups:
    """Unite the control polygons of each group, int64, which may cross ever so little.

    Thinning and rounding do that to contours that lie close.
    """
    return _replaced(polygons, _separated)


def _replaced(
    polygons: Groups, instead: Callable[[list[np.ndarray]], list[np.ndarray] | None]
) -> Groups:
    """The polygons of each group, or what there is `instead`."""
    made: list[np.ndarray] = [polygons.points[:0]]
    group: list[int] = []
    for name, own in polygons.members():
        new = instead(own) or own
        made += new
        group += [name] * len(new)
    return Groups(
        np.concatenate(made), np.cumsum([0, *map(len, made[1:])]), np.array(group, np.int64)
    )


def _separated(polygons: list[np.ndarray]) -> list[np.ndarray]:
    """Control polygons, united; in whole numbers again, no point the one before."""
    new = united([polygon.astype(np.float64) for polygon in polygons], 0.0) or polygons
    points, offsets = np.rint(np.concatenate(new)), np.cumsum([0, *map(len, new)])
    keep = (points != points[following(len(points), offsets)]).any(axis=1)
    ends = np.r_[0, np.cumsum(keep)][offsets]
    rounded = np.split(points[keep].astype(np.int64), ends[1:-1])
    return [polygon for polygon in rounded if len(polygon) > 2]


def _splines(polygons: Groups) -> np.ndarray:
    """The closed uniform quadratic B-splines of polygons (M, 2) as polylines (FINE M, 2)."""
    after = following(len(polygons.points), polygons.offsets)
    here = polygons.points.astype(np.float64)
    before, there = np.empty_like(here), here.take(after, axis=0)
    before[after] = here
    t = np.arange(FINE)[:, None] / FINE
    w = 0.5 * (1 - t) ** 2, 0.5 + t * (1 - t), 0.5 * t * t
    return (w[0] * before[:, None] + w[1] * here[:, None] + w[2] * there[:, None]).reshape(-1, 2)
