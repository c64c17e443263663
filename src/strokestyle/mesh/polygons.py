"""Polygons of a file become triangles: convex ones as fans, the others by cutting off ears."""

from __future__ import annotations

import numpy as np

from .messages import warn
from .triangles import TINY, column_cross, column_dot, row_dot, unit_rows

FLAT = 1e-4  # sine of the turn at a corner: less is rounding, and a fan may have faces of no area
SOUND = 1e-3  # of a quad's area: a diagonal that cuts off less, or something outside, is no good
NO_AREA = 1e-12  # of a polygon's size, squared: its plane is none
SHORTER = 0.99  # of two diagonals: nearly equal ones must not be chosen by their rounding


def cut_polygons(
    vertices: np.ndarray, corner: np.ndarray, count: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cut polygons into triangles that cover them once, each turned as its polygon.

    Each polygon is cut in the plane of its vector area, as its corners project there. All its
    corners are used, so that no edge of a neighbour is left without a partner; a seam to a hole may
    be passed twice, and corners may lie at one place. What has no area or no finite coordinates is
    a fan about its first corner; of what crosses itself, triangles overlap, which is warned of.

    Convex polygons are fans. A quad is cut along its shorter diagonal, unless that one lies outside
    it or folds it: the sine of the fold is 3/2 times the volume of the quad's corners, times the
    diagonal, over the product of the two areas, so of a warped quad the shorter diagonal is the
    flatter one; of equal ones, the first corner's. All others go to the ear cutting of manifold3d.

    Parameters
    ----------
    vertices : (V, 3) float
    corner : (C,) int, the vertices of all polygons, one after the other
    count : (P,) int, the corners of each; those of fewer than three are left out, and warned of

    Returns
    -------
    faces (F, 3) int64 in the order of the polygons, and the polygon (F,) int64 of each
    """
    if (count == 3).all():
        return corner.reshape(-1, 3).astype(np.int64), np.arange(len(count))
    short = int((count < 3).sum())
    if short:
        warn(f"left out: {short} of its {len(count)} faces, which have fewer than three corners")
    corner, crossing = _with_good_diagonals(vertices, corner, count)
    faces, polygon = _fans(corner, count)
    if count.size and count.max() > 4:
        crossing += _cut_concave(vertices, corner, count, faces)
    if crossing:
        warn(f"{crossing} of its faces cross themselves: their triangles overlap")
    return faces, polygon


def checked_corners(
    values: np.ndarray, count: np.ndarray, vertices: int, what: str = "face"
) -> np.ndarray:
    """Take numbers (C,) that a file gives as the corners of polygons as int64.

    `count` : (P,) int, the corners of each. Raises ValueError where one is none of so many
    vertices.
    """
    with np.errstate(invalid="ignore"):
        corner = values.astype(np.int64)
    lost = (corner != values) | (corner < 0) | (corner >= vertices)
    if lost.any():
        at = int(np.argmax(lost))
        polygon = int(np.searchsorted(np.cumsum(count), at, side="right"))
        name = f"{what} {polygon + 1} of {len(count)} names vertex {_whole(values[at])}"
        raise ValueError(f"{name}, which does not exist: there are {vertices}, from 0")
    return corner


def _whole(number: np.integer | np.floating) -> str:
    """Write a number of a file: a whole one with all its digits."""
    return f"{number:.0f}" if number % 1 == 0 else f"{number:g}"


def _fans(corner: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut polygons into fans about their first corners: what `cut_polygons` returns."""
    size = np.maximum(count - 2, 0)  # triangles of each fan
    polygon = np.repeat(np.arange(len(count)), size)
    k = np.arange(len(polygon)) - np.repeat(np.cumsum(size) - size, size)
    begin = (np.cumsum(count) - count)[polygon]
    return corner[np.stack([begin, begin + k + 1, begin + k + 2], axis=1)], polygon


def _with_good_diagonals(
    vertices: np.ndarray, corner: np.ndarray, count: np.ndarray
) -> tuple[np.ndarray, int]:
    """Let each quad begin at an end of the diagonal to cut it along.

    Returns corners (C,), and how many of the quads cross themselves.
    """
    first = (np.cumsum(count) - count)[count == 4]
    if not len(first):
        return corner, 0
    at = first[:, None] + np.arange(4)
    with np.errstate(all="ignore"):  # what is not finite compares false
        other, crossing = _second_diagonal(*vertices.T[:, corner[at].T].swapaxes(0, 1))
    corner = corner.copy()
    corner[at[other]] = np.roll(corner[at[other]], -1, axis=1)
    return corner, int(crossing.sum())


def _second_diagonal(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Tell which quads to cut from the second corner to the last one, (Q,) bool.

    Returns which (Q,) bool of them cross themselves, too.

    `a`, `b`, `c`, `d` : (3, Q), the corners
    """
    ab, ac, ad = b - a, c - a, d - a
    size = np.maximum(np.maximum(np.abs(ab), np.abs(ac)), np.abs(ad)).max(axis=0)
    ab, ac, ad = (v / np.where(size > 0.0, size, 1.0) for v in (ab, ac, ad))
    bc, bd = ac - ab, ad - ab
    normal = column_cross(ac, bd)
    whole = np.maximum(column_dot(normal, normal), TINY)
    # the smaller of the two areas that each diagonal leaves, seen along the normal
    abc, acd, abd, bcd = (
        column_cross(ab, ac),
        column_cross(ac, ad),
        column_cross(ab, ad),
        column_cross(bc, bd),
    )
    least_one = np.minimum(column_dot(normal, abc), column_dot(normal, acd)) / whole
    least_two = np.minimum(column_dot(normal, abd), column_dot(normal, bcd)) / whole
    both = (least_one > SOUND) & (least_two > SOUND)
    shorter = column_dot(bd, bd) < SHORTER**2 * column_dot(ac, ac)
    other = np.where(both, shorter, least_two > least_one + SOUND**2)
    return other, ~both & _are_crossing(abc, acd, abd, bcd, ad)


def _are_crossing(
    abc: np.ndarray, acd: np.ndarray, abd: np.ndarray, bcd: np.ndarray, ad: np.ndarray
) -> np.ndarray:
    """Tell which flat quads abcd cross themselves, (Q,) bool, by the turns of their triangles.

    Where sides cross, the ends of each are on either side of the other: of the four triangles two
    turn one way and two the other. (In a convex quad none differ, in one with a notch one does.)

    `abc`, `acd`, `abd`, `bcd` : (3, Q), twice the vector areas of these triangles
    """
    turns = np.stack([column_dot(abc, one) for one in (abc, acd, abd, bcd)])
    size = np.abs(turns).max(axis=0)
    left, right = (turns > SOUND * size).sum(axis=0), (turns < -SOUND * size).sum(axis=0)
    flat = np.abs(column_dot(abc, ad)) < SOUND * np.sqrt(column_dot(abc, abc))
    return (left == 2) & (right == 2) & flat


def _cut_concave(
    vertices: np.ndarray, corner: np.ndarray, count: np.ndarray, faces: np.ndarray
) -> int:
    """Cut the polygons of five corners and more that are not convex anew: their rows of `faces`.

    Returns how many of them cross themselves.
    """
    many = np.flatnonzero(count > 4)
    size = count[many]
    start = np.cumsum(size) - size
    owner = np.repeat(np.arange(len(many)), size)
    from_first = np.arange(len(owner)) - start[owner]
    corner = corner[(np.cumsum(count) - count)[many][owner] + from_first]
    with np.errstate(all="ignore"):
        plane, has_area = _in_their_planes(vertices[corner], start, owner)
    cut = np.flatnonzero(has_area & ~_are_convex(plane, start, owner))
    if not len(cut):
        return 0
    from manifold3d import triangulate

    row = (np.cumsum(np.maximum(count - 2, 0)) - np.maximum(count - 2, 0))[many]
    cuts = [np.zeros((0, 3), np.int64)]
    for at, begin, n in zip(
        row[cut].tolist(), start[cut].tolist(), size[cut].tolist(), strict=True
    ):
        ears = triangulate([plane[begin : begin + n]], -1)
        if len(ears) == n - 2:
            cuts.append(begin + np.asarray(ears, np.int64))
            faces[at : at + n - 2] = corner[cuts[-1]]
    return _count_crossing(plane, np.concatenate(cuts), owner)


def _count_crossing(plane: np.ndarray, cuts: np.ndarray, owner: np.ndarray) -> int:
    """Count polygons some of whose triangles `cuts` (T, 3) turn the other way in the plane."""
    a, b, c = (plane[cuts[:, i]] for i in range(3))
    (x, y), (u, v) = (b - a).T, (c - a).T
    return len(np.unique(owner[cuts[x * v - y * u < -SOUND, 0]]))


def _in_their_planes(
    points: np.ndarray, start: np.ndarray, owner: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Project polygons to the planes of their vector areas.

    Parameters
    ----------
    points : (C, 3) float, the corners of all polygons
    start : (P,) int, where each polygon begins
    owner : (C,) int, which polygon each corner is of

    Returns
    -------
    (C, 2) float, polygons of about size 1 that turn counter-clockwise, and which (P,) bool of them
    have an area and finite coordinates; the others lie at 0
    """
    local = points - points[start][owner]
    size = np.maximum.reduceat(np.abs(local).max(axis=1), start)
    local = local / np.where(size > 0.0, size, 1.0)[owner, None]
    area = np.add.reduceat(np.cross(local, local[_following(start, len(owner))]), start)
    length = np.sqrt(row_dot(area, area))
    has_area = np.isfinite(size) & (length > NO_AREA)
    local[~has_area[owner]] = 0.0
    normal = unit_rows(np.where(has_area[:, None], area, [0.0, 0.0, 1.0]))
    side = np.eye(3)[np.abs(normal).argmin(axis=1)]  # the axis that is least along the normal
    right = unit_rows(np.cross(side, normal))
    up = np.cross(normal, right)
    return np.stack([row_dot(local, axis[owner]) for axis in (right, up)], axis=1), has_area


def _following(start: np.ndarray, corners: int) -> np.ndarray:
    """Find the next corner of each corner (C,), round each polygon that begins at `start` (P,)."""
    after = np.arange(1, corners + 1)
    after[np.r_[start[1:], corners] - 1] = start
    return after


def _are_convex(plane: np.ndarray, start: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Tell which polygons (P,) of the plane (C, 2) turn left at every corner, and once in all."""
    after = _following(start, len(owner))
    way = plane[after] - plane
    x, y = way.T
    next_x, next_y = way[after].T
    cross, dot = x * next_y - y * next_x, x * next_x + y * next_y
    turn = np.arctan2(cross, dot)
    left = np.logical_and.reduceat(cross > FLAT * np.hypot(x, y) * np.hypot(next_x, next_y), start)
    return left & (np.add.reduceat(turn, start) < 3.0 * np.pi)
