"""Keep the edges of a tone from crossing each other, and themselves.

Programs that fill by the nonzero rule show such a tone all the same. Others leave out what lies
within two edges, or cut the area into triangles and lose half of it to one crossing of a hundredth
of a pixel. A group is the polygons of one tone of one stroke.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..geometry.curves import owner, take_ragged
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
    cusps = polygons.group[owner(polygons.offsets)[_meets_next(polygons)]]
    crossed = sorted({*cusps.tolist(), *(name for name, area in found if area is not None)})
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


def _meets_next(polygons: Groups) -> np.ndarray:
    """Find the pieces (M,) bool of B-splines that cross the one after them, or lie on it.

    Behind a cusp, and too near it, often, for a polyline to show. From where both pieces meet, in
    the middle of the side e of the control polygon between d and f, one leads to
    -u e + u^2 (e - d) / 2 and the other to v e + v^2 (f - e) / 2: across e they are as far from it
    for v = k u, and along it for one u.
    """
    after = following(len(polygons.points), polygons.offsets)
    here = polygons.points.astype(np.float64)
    e = here[after] - here
    d, f = np.empty_like(e), e[after]
    d[after] = e
    before, behind = e[:, 0] * d[:, 1] - e[:, 1] * d[:, 0], e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    turns_back = (before == 0.0) & ((e * d).sum(axis=1) < 0.0)
    some = np.flatnonzero(before * behind < 0.0)  # both bend to the same side of e
    e, d, f = e[some], d[some], f[some]
    k = np.sqrt(-before[some] / behind[some])
    long = (e * e).sum(axis=1)
    back = (long - (e * d).sum(axis=1)) + k * k * (long - (e * f).sum(axis=1))
    meets = turns_back
    meets[some] = 2.0 * (1.0 + k) * long * np.maximum(k, 1.0) <= back
    return meets


def _splines(polygons: Groups) -> np.ndarray:
    """The closed uniform quadratic B-splines of polygons (M, 2) as polylines (FINE M, 2)."""
    after = following(len(polygons.points), polygons.offsets)
    here = polygons.points.astype(np.float64)
    before, there = np.empty_like(here), here.take(after, axis=0)
    before[after] = here
    t = np.arange(FINE)[:, None] / FINE
    w = 0.5 * (1 - t) ** 2, 0.5 + t * (1 - t), 0.5 * t * t
    return (w[0] * before[:, None] + w[1] * here[:, None] + w[2] * there[:, None]).reshape(-1, 2)
