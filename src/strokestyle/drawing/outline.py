"""Draw strokes as outlines: rings of cubic Beziers that do not cross."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..geometry.bezier import fit_cubics
from ..geometry.curves import counting
from ..geometry.polygons import united, winding_number
from .strokes import SAME_POINT, Strokes, merge_coincident_points, signed_distance

FIT_STEP = 1.5  # px between the points of an outline that its cubics are fitted to
LOOP_REACH = 6.0  # radii along an outline, before and after a tight bend, in which it may loop
MAX_PROBES = 6000  # of a stroke
PROBE_STEP = 0.6  # px between the points at which a loop that was cut from an outline is looked at
BESIDE = 0.02  # px beside the corners of an outline that was cut at which it is looked at too


def outlines(
    strokes: Strokes, tolerance: float = 0.1, index: Iterable[int] | None = None
) -> list[list[np.ndarray]]:
    """Draw the outlines of strokes: all, or those of `index`, in that order.

    Parameters
    ----------
    strokes : Strokes
    tolerance : px, above 0
    index : which strokes; None: all

    Returns
    -------
    for each stroke its rings, (K, 4, 2) float64 px: cubics, the last of a ring ending where its
    first begins. They fill a region within `tolerance` of the union of the discs along the centre
    line, and do not cross: programs that fill by the even-odd rule, or cut areas into triangles,
    show it too. The largest outer ring is the first; holes turn the other way.

    Raises
    ------
    ValueError
        where the tolerance is not above 0.
    """
    if not tolerance > 0:
        raise ValueError(f"the tolerance of an outline must be above 0 px, got {tolerance}")
    rings, corners, ends = [], [], [0]
    for i in range(len(strokes)) if index is None else index:
        rows = strokes.rows(i)
        radius = 0.5 * strokes.thickness[rows]
        made = exact_rings(strokes.xy[rows], radius, bool(strokes.closed[i]), 0.2 * tolerance)
        made = _uncrossed(made)
        rings += [ring for ring, _ in made]
        corners += [corner for _, corner in made]
        ends.append(len(rings))
    fitted = fit_cubics(rings, corners, 0.8 * tolerance)
    return [fitted[a:b] for a, b in zip(ends[:-1], ends[1:], strict=True)]


def _uncrossed(rings: list[tuple[np.ndarray, np.ndarray]]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Unite rings as `exact_rings` gives them where they cross; where they do not, they stay.

    Where they crossed there is a corner.
    """
    made = united([ring for ring, _ in rings])
    if not made:
        return rings
    old = np.concatenate([ring for ring, _ in rings])
    corner = np.r_[np.concatenate([corner for _, corner in rings]), True]  # of what is new
    return [(ring, corner[_same_points(ring, old)]) for ring in made]


def _same_points(points: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Which of some points (n, 2) is the same as each point (m, 2); n where none is."""
    way = np.array([0.8, 0.6])  # along which few have the same place
    order = np.argsort(among @ way, kind="stable")
    place, at = (among @ way)[order], points @ way
    first = np.searchsorted(place, at - SAME_POINT)
    count = np.searchsorted(place, at + SAME_POINT, side="right") - first
    one, other = np.repeat(np.arange(len(at)), count), counting(count)
    other = order[other + np.repeat(first, count)]
    same = np.hypot(*(points[one] - among[other]).T) < SAME_POINT
    found = np.full(len(at), len(among))
    found[one[same]] = other[same]
    return found


def exact_rings(
    xy: np.ndarray, radius: np.ndarray, closed: bool, tolerance: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Draw one outline as closed polygons, exact but for arcs.

    An open stroke is walked there and back, always along the same side: the caps are then joins
    like any other. A closed one is walked once each way and has two rings. Every ring is a sum of
    quads and sectors of one orientation, so under nonzero fill it is their union whatever the
    stroke does to itself.

    Parameters
    ----------
    xy : (n, 2) centre line, px
    radius : (n,) px
    closed : bool
    tolerance : px within which arcs are cut into chords

    Returns
    -------
    list of (points (m, 2), corner (m,) bool), the last point joined to the first
    """
    xy, radius = merge_coincident_points(np.asarray(xy, np.float64), np.asarray(radius, np.float64))
    if len(xy) == 1:
        return [_disc(xy[0], radius[0], tolerance)]
    closed = closed and len(xy) > 3
    if closed and np.linalg.norm(xy[0] - xy[-1]) < SAME_POINT:
        radius[0] = max(radius[0], radius[-1])
        xy, radius = xy[:-1], radius[:-1]
    there = np.arange(len(xy))
    walks = [there, there[::-1]] if closed else [np.r_[there, there[-2:0:-1]]]
    turn = 0 if closed else len(xy) - 1
    offsets = [_offset_ring(xy[walk], radius[walk], turn, tolerance) for walk in walks]
    rings = _without_loops(offsets, xy, radius, tolerance)
    if any(ring.pivot.any() for ring in offsets):
        rings = [_straight_within(ring, xy, radius, 5.0 * tolerance) for ring in rings]
    return [_densified(ring) for ring in rings]


@dataclass(frozen=True)
class _Ring:
    """A closed polygon that is to become smooth.

    Parameters
    ----------
    points : (n, 2) px, the last joined to the first
    hard : (n,) bool, whether a point stays a corner
    pivot : (n,) bool, whether a point belongs to a `Join.PIVOT`
    """

    points: np.ndarray
    hard: np.ndarray
    pivot: np.ndarray


def _disc(
    centre: np.ndarray, radius: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The ring of a stroke that is but a point, and its corners: none."""
    count = max(8, int(2 * np.pi / _chord_angle(radius, tolerance))) if radius >= 1e-6 else 1
    angle = np.linspace(0, -2 * np.pi, count, endpoint=False)
    ring = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return ring, np.zeros(count, bool)


def _chord_angle(radius: np.ndarray, tolerance: float) -> np.ndarray:
    """The angle whose chord stays within `tolerance` of a circle."""
    return 2.0 * np.arccos(np.clip(1.0 - tolerance / np.maximum(radius, 1e-9), 0.5, 1.0 - 1e-6))


def _straight_within(ring: _Ring, xy: np.ndarray, radius: np.ndarray, depth: float) -> _Ring:
    """The ring with corners at both ends of every edge that runs deeper than `depth` in the stroke.

    Edges that go back and forth there overlap by a hair at times, and must stay straight so as not
    to leave a slit.
    """
    middle = 0.5 * (ring.points + np.roll(ring.points, -1, axis=0))
    deep = signed_distance(xy, radius, middle) < -depth
    return _Ring(ring.points, ring.hard | deep | np.roll(deep, 1), ring.pivot)


def _densified(ring: _Ring) -> tuple[np.ndarray, np.ndarray]:
    """Points without those that coincide, and with more on long edges, so that a fit is held there.

    Returns
    -------
    points (n, 2) and corners (n,) bool
    """
    step = np.linalg.norm(ring.points - np.roll(ring.points, 1, axis=0), axis=1)
    keep = step > SAME_POINT
    if not keep.any():
        return ring.points[:1], np.zeros(1, bool)
    cluster = np.cumsum(keep) - 1  # -1, the last: the points before the first that is kept
    hard = np.zeros(cluster[-1] + 1, bool)
    hard[cluster[ring.hard]] = True
    points = ring.points[keep]
    d = np.roll(points, -1, axis=0) - points
    pieces = np.maximum(np.ceil(np.hypot(d[:, 0], d[:, 1]) / FIT_STEP).astype(np.int64), 1)
    k = np.repeat(np.arange(len(points)), pieces)
    j = counting(pieces)
    return points[k] + (j / pieces[k])[:, None] * d[k], hard[k] & (j == 0)


# ----------------------------------------------------------------------------- joins of an offset


class Join(IntEnum):
    """How the offsets of two segments are joined at the vertex between them."""

    PLAIN = 0  # they touch, but for the turn of a disc that is too small to be seen
    ARC = 1  # outside of a bend: by the disc
    MEET = 2  # inside of a bend: both are cut where they meet
    PIVOT = 3  # inside of a bend tighter than the stroke is wide: by way of the vertex


@dataclass(frozen=True)
class _Offset:
    """The left offset, along the normal (-t_y, t_x), of a closed walk, segment by segment.

    Segment k goes from vertex k to the next; its offset touches the discs at both.

    Parameters
    ----------
    xy : (n, 2) vertices, px
    radius : (n,) px
    start, end : (n, 2) px, of the offset of segment k
    normal : (n,) radians, the direction in which that offset lies
    swing : (n,) radians in which the normal turns at vertex k; below 0 the vertex is on the outside
        of a bend
    held : (n,) bool, whether of the two discs of segment k one holds the other
    """

    xy: np.ndarray
    radius: np.ndarray
    start: np.ndarray
    end: np.ndarray
    normal: np.ndarray
    swing: np.ndarray
    held: np.ndarray

    @classmethod
    def of(cls, xy: np.ndarray, radius: np.ndarray, turn: int) -> _Offset:
        """An open stroke is turned back at vertices 0 and `turn`; that is 0 for a closed one."""
        after = np.r_[1 : len(xy), 0]
        d = xy[after] - xy
        length = np.hypot(d[:, 0], d[:, 1])
        heading = np.arctan2(d[:, 1], d[:, 0])
        grows = radius[after] - radius
        # the envelope of the discs leans away from the normal by the slope of the radius
        lean = np.arcsin(np.clip(grows / length, -1.0, 1.0))
        normal = heading + 0.5 * np.pi + lean
        m = np.stack([np.cos(normal), np.sin(normal)], axis=1)
        return cls(
            xy,
            radius,
            start=xy + radius[:, None] * m,
            end=xy[after] + radius[after, None] * m,
            normal=normal,
            swing=_bends(heading, turn) + lean - np.roll(lean, 1),
            held=np.abs(grows) >= length,
        )


def _bends(heading: np.ndarray, turn: int) -> np.ndarray:
    """The turn (n,) at each vertex of a walk, radians in [-pi, pi)."""
    bend = (heading - np.roll(heading, 1) + np.pi) % (2 * np.pi) - np.pi
    if turn:
        # there and back: what is a left turn one way is a right turn the other, to the last bit
        bend[[0, turn]] = -np.pi
        bend[turn + 1 :] = -bend[1:turn][::-1]
    return bend


def _offset_ring(xy: np.ndarray, radius: np.ndarray, turn: int, tolerance: float) -> _Ring:
    """The left offset of a closed walk as a polygon; `turn` as `_Offset.of` has it."""
    offset = _Offset.of(xy, radius, turn)
    join, meeting = _joins(offset, tolerance)
    steps = np.ones(len(xy), np.int64)  # points at each vertex
    arc = join == Join.ARC
    angles = np.abs(offset.swing[arc]) / _chord_angle(radius[arc], tolerance)
    steps[arc] = np.ceil(angles).astype(np.int64) + 1
    steps[join == Join.PIVOT] = 3
    vertex, j = np.repeat(np.arange(len(xy)), steps), counting(steps)
    turned = offset.swing[vertex] * j / np.maximum(steps[vertex] - 1, 1)
    return _Ring(
        _join_points(offset, join, meeting, vertex, turned),
        _hard_points(offset, join, vertex, j == 0, j == steps[vertex] - 1),
        join[vertex] == Join.PIVOT,
    )


def _joins(offset: _Offset, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """The `Join` at each vertex (n,), and where the offsets meet that are joined by MEET (m, 2)."""
    start, along = np.roll(offset.start, 1, axis=0), offset.end - offset.start
    arriving = np.roll(along, 1, axis=0)
    s, t, cross = _crossing(start, arriving, offset.start, along)
    inside = offset.swing > 1e-9
    meet = inside & (np.abs(cross) > 1e-12) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    while True:  # an offset that is cut at both ends must keep something
        lost = meet & np.roll(meet, -1) & (t > np.roll(s, -1))
        if not lost.any():
            break
        meet &= ~(lost | np.roll(lost, 1))
    round_join = ~inside & (np.abs(offset.swing) > 1e-9) & (offset.radius > tolerance)
    cases = [meet, inside, round_join]
    join = np.select(cases, [Join.MEET, Join.PIVOT, Join.ARC], Join.PLAIN)
    return join, start[meet] + s[meet, None] * arriving[meet]


def _crossing(
    a: np.ndarray, u: np.ndarray, b: np.ndarray, w: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the lines from a along u and from b along w cross, all (..., 2).

    Returns
    -------
    the share of u, the share of w, and the cross product of both, (...); where that is 0 the shares
    are not finite
    """
    cross = u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0]
    gap = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (gap[..., 0] * w[..., 1] - gap[..., 1] * w[..., 0]) / cross
        t = (gap[..., 0] * u[..., 1] - gap[..., 1] * u[..., 0]) / cross
    return s, t, cross


def _join_points(
    offset: _Offset, join: np.ndarray, meeting: np.ndarray, vertex: np.ndarray, turned: np.ndarray
) -> np.ndarray:
    """The points (m, 2) of joins: each at its vertex, where the normal has `turned` so far."""
    angle = np.roll(offset.normal, 1)[vertex] + turned
    away = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = offset.xy[vertex] + offset.radius[vertex, None] * away
    points[join[vertex] == Join.MEET] = meeting
    pivot = join == Join.PIVOT
    way = np.stack([np.roll(offset.end, 1, axis=0), offset.xy, offset.start], axis=1)
    points[pivot[vertex]] = way[pivot].reshape(-1, 2)
    return points


def _hard_points(
    offset: _Offset, join: np.ndarray, vertex: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Which points (m,) of joins stay corners; `first` and `last` (m,) are the ends of a join."""
    kinked = (join == Join.MEET) | (join == Join.PLAIN)
    corner = (join == Join.PIVOT) | (kinked & (np.abs(offset.swing) > 0.5))
    # where one disc holds the next one the offset runs along the centre line, at right angles to
    # both circles; rounded corners there would part ways that must cancel each other within the
    # stroke, and leave a slit
    held = np.roll(offset.held, 1)[vertex] & first | offset.held[vertex] & last
    return corner[vertex] | held


# ------------------------------------------------------------------- loops inside of tight bends


def _without_loops(
    rings: list[_Ring], xy: np.ndarray, radius: np.ndarray, tolerance: float
) -> list[_Ring]:
    """The rings without the loops that the inside of a tight bend makes.

    Every loop that is cut away must leave the filled region as it was: where it does not, by the
    signed distance of points in the loops and beside corners, the rings stay as they are.
    """
    cut, found = zip(*(_cut_loops(ring, LOOP_REACH * radius.max()) for ring in rings), strict=True)
    probes = np.concatenate(found)
    if not len(probes):
        return list(cut)
    probes = probes[:: -(-len(probes) // MAX_PROBES)]
    probes = np.concatenate([probes, *(_beside_corners(ring) for ring in cut)])
    depth = signed_distance(xy, radius, probes)
    filled = np.sum([winding_number(ring.points, probes) for ring in cut], axis=0) != 0
    wrong = (filled != (depth < 0)) & (np.abs(depth) > min(0.05, 2.5 * tolerance))
    return rings if wrong.any() else list(cut)


def _beside_corners(ring: _Ring) -> np.ndarray:
    """Points (2 c, 2) a little within and without each of a ring's c corners.

    What a cut loses is at the tip of a notch.
    """
    corner = ring.points[ring.hard]
    ahead = np.roll(ring.points, -1, axis=0)[ring.hard] - corner
    behind = np.roll(ring.points, 1, axis=0)[ring.hard] - corner
    between = _unit(ahead) + _unit(behind)
    between *= BESIDE / np.maximum(np.hypot(between[:, 0], between[:, 1]), 1e-12)[:, None]
    return np.concatenate([corner + between, corner - between])


def _unit(d: np.ndarray) -> np.ndarray:
    return d / np.maximum(np.hypot(d[:, 0], d[:, 1]), 1e-12)[:, None]


def _cut_loops(ring: _Ring, reach: float) -> tuple[_Ring, np.ndarray]:
    """Cut a ring where it crosses itself within `reach` px before and after a tight bend.

    Returns
    -------
    the ring, and points (M, 2) from within the loops
    """
    if not ring.pivot.any() or ring.pivot.all():
        return ring, np.zeros((0, 2))
    ring = _begun_far_from_bends(ring)
    points, hard, keep = ring.points.copy(), ring.hard.copy(), np.ones(len(ring.hard), bool)
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T))]
    edge = np.flatnonzero(np.diff(np.r_[False, ring.pivot, False]))
    probes = [np.zeros((0, 2))]
    done = 0  # nothing before it may be cut any more
    for first, last in zip(edge[::2], edge[1::2] - 1, strict=True):
        if first <= done:
            continue
        low = max(done, int(np.searchsorted(along, along[first] - reach)))
        high = min(len(along) - 1, int(np.searchsorted(along, along[last] + reach)))
        found = _nearest_crossing(points, along, (low, first), (last, high))
        if found is None:
            continue
        a, b, meeting = found
        probes.append(_points_within(np.concatenate([meeting[None], points[a + 1 : b + 1]])))
        keep[a + 1 : b] = False
        points[b], hard[b] = meeting, True  # it takes the place of the loop's last vertex
        done = b
    return _Ring(points[keep], hard[keep], ring.pivot[keep]), np.concatenate(probes)


def _begun_far_from_bends(ring: _Ring) -> _Ring:
    """The ring from the middle of its longest stretch without a pivot on."""
    at = np.flatnonzero(ring.pivot)
    gap = np.diff(np.r_[at, at[0] + len(ring.pivot)])
    k = int(gap.argmax())
    shift = -((at[k] + gap[k] // 2) % len(ring.pivot))
    points = np.roll(ring.points, shift, axis=0)
    return _Ring(points, np.roll(ring.hard, shift), np.roll(ring.pivot, shift))


def _nearest_crossing(
    points: np.ndarray, along: np.ndarray, before: tuple[int, int], after: tuple[int, int]
) -> tuple[int, int, np.ndarray] | None:
    """Where segments before:first of a ring cross segments last:after of it, nearest to the bend.

    Parameters
    ----------
    points : (n, 2), and `along` (n,) px of arc length
    before, after : ranges of segments before and after a bend

    Returns
    -------
    the two segments, and their crossing (2,); None: there is none
    """
    i, j = np.arange(*before), np.arange(*after)
    u, w = points[i + 1] - points[i], points[j + 1] - points[j]
    s, t, _ = _crossing(points[i, None], u[:, None], points[None, j], w[None])
    hit = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    if not hit.any():
        return None
    way = (along[before[1]] - along[i])[:, None] + (along[j] - along[after[0]])[None]
    a, b = np.unravel_index(np.where(hit, way, np.inf).argmin(), way.shape)
    return int(i[a]), int(j[b]), points[i[a]] + s[a, b] * u[a]


def _points_within(loop: np.ndarray) -> np.ndarray:
    """Points (M, 2) in the box of a loop (n, 2): the loop, shrunk in steps, and a grid."""
    middle, low, high = loop.mean(axis=0), loop.min(axis=0), loop.max(axis=0)
    shrunk = [middle + f * (loop - middle) for f in (0.1, 0.35, 0.6, 0.8, 0.95)]
    counts = np.clip(np.ceil((high - low) / PROBE_STEP), 5, 40)
    x, y = np.meshgrid(*(np.arange(count) + 0.5 for count in counts))
    grid = np.stack([x, y], axis=-1).reshape(-1, 2)
    return np.concatenate([*shrunk, low + grid / (grid.max(axis=0) + 0.5) * (high - low)])
