"""The outlines of strokes: rings of cubic Beziers, to be filled by the nonzero rule."""

from __future__ import annotations

import numpy as np

from ..geometry.bezier import fit_cubics
from ..geometry.curves import counting
from ..geometry.polygons import winding_number
from .strokes import Strokes, merge_coincident_points, signed_distance

FIT_STEP = 1.5  # px between the points of an outline that its cubics are fitted to
MOST_PROBES = 6000  # of a stroke
PROBE_STEP = 0.6  # px between the points at which a loop that was cut from an outline is looked at
BESIDE = 0.02  # px beside the corners of an outline that was cut at which it is looked at too


def outline(strokes: Strokes, i: int, tolerance: float = 0.1) -> list[np.ndarray]:
    """The outline of stroke i as rings of cubic Beziers, to be filled by the nonzero rule.

    Returns
    -------
    list of (K, 4, 2) float64: each ring's curves, the last ending where the first begins. The filled region is within
    `tolerance` pixels of the union of the discs along the centre line. Where the stroke crosses itself so do the rings.
    """
    return outlines(strokes, tolerance, [i])[0]


def outlines(strokes: Strokes, tolerance: float = 0.1, index=None) -> list[list[np.ndarray]]:
    """`outline` of many strokes at once: all, or those of `index`, in that order."""
    if not tolerance > 0:
        raise ValueError(f"the tolerance of an outline must be above 0 px, got {tolerance}")
    index = range(len(strokes)) if index is None else index
    rings, corners, count = [], [], []
    for i in index:
        rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
        radius = 0.5 * strokes.thickness[rows]
        made = exact_rings(strokes.xy[rows], radius, bool(strokes.closed[i]), 0.2 * tolerance)
        rings += [ring for ring, _ in made]
        corners += [corner for _, corner in made]
        count.append(len(made))
    fitted = fit_cubics(rings, corners, 0.8 * tolerance)
    ends = np.cumsum([0] + count)
    return [fitted[a:b] for a, b in zip(ends[:-1], ends[1:], strict=True)]


def exact_rings(xy, radius, closed: bool, tolerance: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """The outline as closed polygons, exact but for arcs, which are cut into chords within `tolerance`.

    An open stroke is walked there and back, always along the same side: the caps are then joins like any other. A
    closed one is walked once each way and has two rings. Every ring is a sum of quads and sectors of one orientation,
    so under nonzero fill it is their union whatever the stroke does to itself.

    Returns
    -------
    list of (points (n, 2), corner (n,) bool), the last point joined to the first
    """
    xy, radius = merge_coincident_points(np.asarray(xy, np.float64), np.asarray(radius, np.float64))
    if closed and len(xy) > 3:
        if np.linalg.norm(xy[0] - xy[-1]) < 1e-6:
            radius[0] = max(radius[0], radius[-1])
            xy, radius = xy[:-1], radius[:-1]
        walks = [np.arange(len(xy)), np.arange(len(xy))[::-1]]
    else:
        closed = False
        walks = [np.r_[np.arange(len(xy)), np.arange(len(xy) - 2, 0, -1)]]
    if len(xy) == 1:
        return [_disc(xy[0], radius[0], tolerance)]
    turn = 0 if closed else len(xy) - 1
    made = [_offset_ring(xy[walk], radius[walk], turn, tolerance) for walk in walks]
    neat = [_cut_loops(ring, hard, pivot, 6.0 * radius.max()) for ring, hard, pivot in made]
    probes = np.concatenate([probe for _, _, probe in neat])
    if len(probes):  # every loop that was cut away must leave the filled region as it was
        probes = probes[:: -(-len(probes) // MOST_PROBES)]
        probes = np.concatenate([probes, *(_beside_corners(ring, hard) for ring, hard, _ in neat)])
        depth = signed_distance(xy, radius, probes)
        filled = sum(winding_number(ring, probes) for ring, _, _ in neat) != 0
        if (filled != (depth < 0))[np.abs(depth) > min(0.05, 2.5 * tolerance)].any():
            neat = made
    rings = [(ring, hard) for ring, hard, _ in neat]
    if any(pivot.any() for _, _, pivot in made):
        rings = [
            (ring, _hard_within(xy, radius, ring, hard, 5.0 * tolerance)) for ring, hard in rings
        ]
    return [_evenly(*ring) for ring in rings]


def _beside_corners(ring, hard):
    """Points (2 c, 2) a little within and without each corner of a ring: what is lost is at the tip of a notch."""
    ahead, behind = (
        np.roll(ring, -1, axis=0)[hard] - ring[hard],
        np.roll(ring, 1, axis=0)[hard] - ring[hard],
    )
    between = sum(
        d / np.maximum(np.hypot(d[:, 0], d[:, 1]), 1e-12)[:, None] for d in (ahead, behind)
    )
    between *= BESIDE / np.maximum(np.hypot(between[:, 0], between[:, 1]), 1e-12)[:, None]
    return np.concatenate([ring[hard] + between, ring[hard] - between])


def _hard_within(xy, radius, ring, hard, depth):
    """`hard`, and both ends of every edge that runs deeper than `depth` in the stroke: edges that go back and forth
    there overlap by a hair at times, and must stay straight so as not to leave a slit."""
    deep = signed_distance(xy, radius, 0.5 * (ring + np.roll(ring, -1, axis=0))) < -depth
    return hard | deep | np.roll(deep, 1)


def _evenly(ring, hard):
    """A ring without points that coincide, and with points added on its long edges, so that a fit is held there too."""
    step = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
    keep = step > 1e-6
    if not keep.any():
        return ring[:1], np.zeros(1, bool)
    heap = np.cumsum(keep) - 1  # -1, the last: the points before the first that is kept
    corner = np.zeros(heap[-1] + 1, bool)
    corner[heap[hard]] = True
    ring, hard = ring[keep], corner
    d = np.roll(ring, -1, axis=0) - ring
    pieces = np.maximum(np.ceil(np.hypot(d[:, 0], d[:, 1]) / FIT_STEP).astype(np.int64), 1)
    k = np.repeat(np.arange(len(ring)), pieces)
    j = counting(pieces)
    return ring[k] + (j / pieces[k])[:, None] * d[k], hard[k] & (j == 0)


def _disc(centre, radius, tolerance):
    angle = np.linspace(
        0, -2 * np.pi, max(8, int(2 * np.pi / _chord_angle(radius, tolerance))), endpoint=False
    )
    ring = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if radius < 1e-6:
        ring = ring[:1]
    return ring, np.zeros(len(ring), bool)


def _chord_angle(radius, tolerance):
    """The angle whose chord stays within `tolerance` of a circle."""
    return 2.0 * np.arccos(np.clip(1.0 - tolerance / np.maximum(radius, 1e-9), 0.5, 1.0 - 1e-6))


def _offset_ring(p, r, turn, tolerance):
    """The left offset (normal (-t_y, t_x)) of a closed walk p (n, 2) with radii r (n,), as polygon and corners.

    `turn` is the vertex at which an open stroke is turned back, 0 for a closed stroke; vertex 0 is the other end.
    """
    n = len(p)
    after = np.r_[1:n, 0]
    d = p[after] - p
    length = np.hypot(d[:, 0], d[:, 1])
    heading = np.arctan2(d[:, 1], d[:, 0])
    # the envelope of the discs leans away from the normal by the slope of the radius
    lean = np.arcsin(np.clip((r[after] - r) / length, -1.0, 1.0))
    normal = heading + 0.5 * np.pi + lean
    m = np.stack([np.cos(normal), np.sin(normal)], axis=1)
    start, end = (
        p + r[:, None] * m,
        p[after] + r[after, None] * m,
    )  # of the offset of segment k, from vertex k on
    before = np.r_[n - 1, 0 : n - 1]
    bend = (heading - heading[before] + np.pi) % (2 * np.pi) - np.pi
    if (
        turn
    ):  # there and back: what is a left turn one way is a right turn the other way, to the last bit
        bend[[0, turn]] = -np.pi
        bend[turn + 1 :] = -bend[1:turn][::-1]
    swing = (
        bend + lean - lean[before]
    )  # of the envelope's normal at vertex k; to the right = a join on the outside
    # inside of a bend: the two offset segments are cut where they meet; where they do not, by way of the centre
    a, b = end[before], start
    u, w = a - start[before], end - b
    cross = u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
    safe = np.where(np.abs(cross) > 1e-12, cross, 1.0)
    gap = b - start[before]
    s = (gap[:, 0] * w[:, 1] - gap[:, 1] * w[:, 0]) / safe  # of segment k - 1
    t = (gap[:, 0] * u[:, 1] - gap[:, 1] * u[:, 0]) / safe  # of segment k
    inside = swing > 1e-9
    meet = inside & (np.abs(cross) > 1e-12) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    while True:  # a segment cut at both ends must keep something: else the bend is tighter than the stroke is wide
        lost = meet & meet[after] & (t > s[after])
        if not lost.any():
            break
        meet[lost] = False
        meet[after[lost]] = False
    pivot = inside & ~meet
    arc = ~inside & (np.abs(swing) > 1e-9) & (r > tolerance)
    steps = np.where(
        arc, np.ceil(np.abs(swing) / _chord_angle(r, tolerance)).astype(np.int64) + 1, 1
    )
    steps = np.where(pivot, 3, steps)
    steps = np.where(~inside & ~arc, 1, steps)
    vertex = np.repeat(np.arange(n), steps)
    j = counting(steps)
    angle = normal[before][vertex] + swing[vertex] * j / np.maximum(steps[vertex] - 1, 1)
    ring = p[vertex] + r[vertex, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring[meet[vertex]] = (start[before] + s[:, None] * u)[vertex[meet[vertex]]]
    at_pivot = pivot[vertex]
    ring[at_pivot & (j == 0)], ring[at_pivot & (j == 1)], ring[at_pivot & (j == 2)] = (
        a[pivot],
        p[pivot],
        b[pivot],
    )
    hard = at_pivot | ((meet | (~inside & ~arc)) & (np.abs(swing) > 0.5))[vertex]
    # where one disc holds the next one the offset runs along the centre line, at right angles to both circles; rounded
    # corners there would part ways that must cancel each other within the stroke, and leave a slit
    held = np.abs(r[after] - r) >= length
    hard |= held[before][vertex] & (j == 0) | held[vertex] & (j == steps[vertex] - 1)
    return ring, hard, at_pivot


def _cut_loops(ring, hard, pivot, reach):
    """Cut the loops off that the inside of a tight bend makes: (ring, hard, probes (M, 2) from within the loops)."""
    n = len(ring)
    keep, probes = np.ones(n, bool), [np.zeros((0, 2))]
    if not pivot.any() or pivot.all():
        return ring, hard, probes[0]
    # begin in the middle of the longest stretch without a bend
    at = np.flatnonzero(pivot)
    gap = np.diff(np.r_[at, at[0] + n])
    k = int(gap.argmax())
    shift = (at[k] + gap[k] // 2) % n
    ring, hard, pivot = np.roll(ring, -shift, axis=0), np.roll(hard, -shift), np.roll(pivot, -shift)
    step = np.hypot(*np.diff(ring, axis=0).T)
    along = np.r_[0.0, np.cumsum(step)]
    edge = np.flatnonzero(np.diff(np.r_[False, pivot, False]))
    floor = 0  # nothing before it may be cut any more
    ring, hard = ring.copy(), hard.copy()
    for first, last in zip(edge[::2], edge[1::2] - 1, strict=True):
        if first <= floor:
            continue
        low = max(floor, int(np.searchsorted(along, along[first] - reach)))
        high = min(n - 1, int(np.searchsorted(along, along[last] + reach)))
        i, j = np.arange(low, first), np.arange(last, high)
        u, w = ring[i + 1] - ring[i], ring[j + 1] - ring[j]
        cross = u[:, None, 0] * w[None, :, 1] - u[:, None, 1] * w[None, :, 0]
        gap = ring[j][None] - ring[i][:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            s = (gap[..., 0] * w[None, :, 1] - gap[..., 1] * w[None, :, 0]) / cross
            t = (gap[..., 0] * u[:, None, 1] - gap[..., 1] * u[:, None, 0]) / cross
            hit = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
        if not hit.any():
            continue
        far = np.where(
            hit, (along[first] - along[i])[:, None] + (along[j] - along[last])[None], np.inf
        )
        a, b = np.unravel_index(far.argmin(), far.shape)
        meeting = ring[i[a]] + s[a, b] * u[a]
        loop = np.concatenate([meeting[None], ring[i[a] + 1 : j[b] + 1]])
        middle, low, high = loop.mean(axis=0), loop.min(axis=0), loop.max(axis=0)
        probes += [middle + f * (loop - middle) for f in (0.1, 0.35, 0.6, 0.8, 0.95)]
        grid = [np.arange(n) + 0.5 for n in np.clip(np.ceil((high - low) / PROBE_STEP), 5, 40)]
        grid = np.stack(np.meshgrid(*grid), axis=-1).reshape(-1, 2)
        probes.append(low + grid / (grid.max(axis=0) + 0.5) * (high - low))
        keep[i[a] + 1 : j[b] + 1] = False
        floor = j[b]  # the meeting point takes this vertex's place
        ring[floor], hard[floor], keep[floor] = meeting, True, True
    return ring[keep], hard[keep], np.concatenate(probes)
