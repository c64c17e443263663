"""Strokes and Drawing: centre lines with thickness, their outlines, and the u-v texture that fills them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .curves import KINDS, check_offsets

FIT_STEP = 1.5  # px between the points of an outline that its cubics are fitted to
PROBE_STEP = 0.6  # px between the points at which a loop that was cut from an outline is looked at
STIFFNESS = 0.35  # of a ribbon's half width: sigma of its centre line's smoothing
NARROWING = 0.25  # px a px: the most by which a ribbon's half width falls along it


@dataclass(frozen=True)
class Strokes:
    """Centre lines with a thickness at every point.

    Parameters
    ----------
    xy : (N, 2) float64, pixels
    thickness : (N,) float64, full width in pixels, >= 0
    offsets : (C+1,) int64, stroke i is rows offsets[i]:offsets[i+1], at least two
    kind : (C,) int8, index into curves.KINDS
    closed : (C,) bool; a closed stroke repeats its first point as its last

    Raises
    ------
    ValueError
        on a wrong shape, a value that is not finite, or a negative thickness.
    """

    xy: np.ndarray
    thickness: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    closed: np.ndarray

    def __post_init__(self):
        xy = np.asarray(self.xy, np.float64)
        thickness = np.asarray(self.thickness, np.float64)
        offsets = np.asarray(self.offsets, np.int64)
        kind, closed = np.asarray(self.kind, np.int8), np.asarray(self.closed, bool)
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise ValueError(f"Strokes.xy must have shape (N, 2), got {xy.shape}")
        if thickness.shape != (len(xy),):
            raise ValueError(f"Strokes.thickness must have shape ({len(xy)},), got {thickness.shape}")
        if not (np.isfinite(xy).all() and np.isfinite(thickness).all()):
            raise ValueError("Strokes holds values that are not finite")
        if len(thickness) and thickness.min() < 0:
            raise ValueError(f"Strokes.thickness must not be negative, got {thickness.min():g}")
        check_offsets(offsets, len(xy), 2, "Strokes")
        count = len(offsets) - 1
        if kind.shape != (count,) or closed.shape != (count,):
            raise ValueError(
                f"Strokes.kind and .closed must have shape ({count},), got {kind.shape} and {closed.shape}"
            )
        if count and not (0 <= kind.min() and kind.max() < len(KINDS)):
            raise ValueError(f"Strokes.kind must lie in 0..{len(KINDS) - 1}")
        for name, value in zip(
            ("xy", "thickness", "offsets", "kind", "closed"), (xy, thickness, offsets, kind, closed), strict=True
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.offsets) - 1


@dataclass(frozen=True)
class Texture:
    """One strip of colours per stroke, in the stroke's own u-v space.

    Parameters
    ----------
    rgba : (T, A, 4) uint8, straight alpha. Strip i is rows offsets[i]:offsets[i+1]; its row r of n lies at the
        normalised arc length u = (r + 1/2) / n of the ribbon: the centre line, run straight on past both ends of an
        open stroke by its half width there, so that its caps are texture like the rest. Column a of A lies across it at
        v = (2 a + 1) / A - 1, that is v times the ribbon's half width along the normal (-t_y, t_x) of the tangent t.
        That half width is `half_widths`: half the thickness, kept from narrowing abruptly, plus margin.
    offsets : (C+1,) int64
    margin : float, pixels beyond the half thickness that the strips reach, so that soft edges are not cut
    """

    rgba: np.ndarray
    offsets: np.ndarray
    margin: float

    def __post_init__(self):
        rgba, offsets = np.asarray(self.rgba), np.asarray(self.offsets, np.int64)
        if rgba.ndim != 3 or rgba.shape[2] != 4 or rgba.dtype != np.uint8 or rgba.shape[1] < 1:
            raise ValueError(f"Texture.rgba must be uint8 of shape (T, A, 4), got {rgba.dtype} {rgba.shape}")
        check_offsets(offsets, len(rgba), 1, "Texture")
        if not 0 <= self.margin <= 100:
            raise ValueError(f"Texture.margin must lie between 0 and 100 px, got {self.margin}")
        object.__setattr__(self, "rgba", rgba)
        object.__setattr__(self, "offsets", offsets)


@dataclass(frozen=True)
class Drawing:
    """What `render` writes: strokes in painting order, the flat ink of each, and perhaps a texture.

    Parameters
    ----------
    strokes : Strokes
    size : (width, height), pixels
    color : (C, 4) float64 in [0, 1], straight RGBA: what a stroke looks like where no texture is wanted
    texture : Texture with one strip per stroke, or None
    """

    strokes: Strokes
    size: tuple[int, int]
    color: np.ndarray
    texture: Texture | None = None

    def __post_init__(self):
        color = np.asarray(self.color, np.float64)
        if color.shape != (len(self.strokes), 4):
            raise ValueError(f"Drawing.color must have shape ({len(self.strokes)}, 4), got {color.shape}")
        if color.size and not (np.isfinite(color).all() and color.min() >= 0 and color.max() <= 1):
            raise ValueError("Drawing.color must lie between 0 and 1")
        if self.texture is not None and len(self.texture.offsets) != len(self.strokes) + 1:
            raise ValueError(
                f"Drawing.texture has {len(self.texture.offsets) - 1} strips for {len(self.strokes)} strokes"
            )
        object.__setattr__(self, "color", color)
        object.__setattr__(self, "size", (int(self.size[0]), int(self.size[1])))


def paint_order(strokes: Strokes) -> np.ndarray:
    """Indices (C,) from the first stroke painted to the last: kinds from the least to the most important, so that
    contours lie on top; within a kind as given. The SVG's layers and `rasterise` both follow it."""
    return np.argsort(-strokes.kind.astype(np.int64), kind="stable")


# ---------------------------------------------------------------------------------------------------- distance


def distinct(xy: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A centre line (n, 2) and its radii (n,) without points that coincide; the widest of each heap stays."""
    step = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    heap = np.r_[0, np.cumsum(step > 1e-6)]
    widest = np.zeros(heap[-1] + 1)
    np.maximum.at(widest, heap, radius)
    return xy[np.r_[True, step > 1e-6]], widest


def signed_distance(xy: np.ndarray, radius: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distance (M,) from points (M, 2) to a stroke of centre line xy (n, 2) and radii (n,): negative inside.

    A stroke is the union of the discs along its centre line, radius linear along each segment; a segment is then a
    round cone, the convex hull of its two end discs. The reference: all points against all segments.
    """
    xy, radius = distinct(np.asarray(xy, np.float64), np.asarray(radius, np.float64))
    if len(xy) == 1:
        return np.linalg.norm(points - xy[0], axis=1) - radius[0]
    nearest = np.full(len(points), np.inf)
    block = max(1, 2_000_000 // len(xy))
    index = np.arange(len(xy) - 1)
    for a in range(0, len(points), block):
        rel = points[a : a + block, None] - xy[None, :-1]
        nearest[a : a + block] = _cone_distance(rel, *_segments(xy, radius, index)).min(axis=1)
    return nearest


def _segments(xy, radius, k):
    """Length, direction, first radius and slope of the radius of the segments k."""
    d = xy[k + 1] - xy[k]
    length = np.hypot(d[..., 0], d[..., 1])
    return length, d / length[..., None], radius[k], (radius[k] - radius[k + 1]) / length


def _cone_distance(rel, length, direction, radius, slope):
    """Signed distance to round cones from points `rel` (..., 2) relative to the cones' first centres.

    The distance to the disc at s along the axis, sqrt((x - s)^2 + y^2) - radius + slope s, is convex in s and
    smallest at x - s = y slope / sqrt(1 - slope^2); a slope beyond 1 means that one end disc holds the other.
    """
    x = rel[..., 0] * direction[..., 0] + rel[..., 1] * direction[..., 1]
    y = np.abs(rel[..., 1] * direction[..., 0] - rel[..., 0] * direction[..., 1])
    tilt = np.clip(slope, -1 + 1e-12, 1 - 1e-12)
    s = np.clip(x - y * (tilt / np.sqrt(1 - tilt * tilt)), 0.0, length)
    return np.hypot(x - s, y) - radius + slope * s


# ---------------------------------------------------------------------------------------------------- outlines


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
    xy, radius = distinct(np.asarray(xy, np.float64), np.asarray(radius, np.float64))
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
        depth = signed_distance(xy, radius, probes)
        filled = sum(winding_number(ring, probes) for ring, _, _ in neat) != 0
        if (filled != (depth < 0))[np.abs(depth) > 0.05].any():
            neat = made
    return [_evenly(ring, hard) for ring, hard, _ in neat]


def winding_number(ring: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How often a closed polygon (n, 2) goes round each of the points (M, 2), (M,) int."""
    a, b = ring, np.roll(ring, -1, axis=0)
    above_a, above_b = a[None, :, 1] > points[:, None, 1], b[None, :, 1] > points[:, None, 1]
    side = (b[:, 0] - a[:, 0]) * (points[:, None, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (points[:, None, 0] - a[:, 0])
    return (above_b & ~above_a & (side > 0)).sum(axis=1) - (above_a & ~above_b & (side < 0)).sum(axis=1)


def _evenly(ring, hard):
    """A ring without points that coincide, and with points added on its long edges, so that a fit is held there too."""
    step = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
    keep = step > 1e-6
    if not keep.any():
        return ring[:1], np.zeros(1, bool)
    ring, hard = ring[keep], hard[keep]
    d = np.roll(ring, -1, axis=0) - ring
    pieces = np.maximum(np.ceil(np.hypot(d[:, 0], d[:, 1]) / FIT_STEP).astype(np.int64), 1)
    k = np.repeat(np.arange(len(ring)), pieces)
    j = np.arange(len(k)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return ring[k] + (j / pieces[k])[:, None] * d[k], hard[k] & (j == 0)


def _disc(centre, radius, tolerance):
    angle = np.linspace(0, -2 * np.pi, max(8, int(2 * np.pi / _chord_angle(radius, tolerance))), endpoint=False)
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
    start, end = p + r[:, None] * m, p[after] + r[after, None] * m  # of the offset of segment k, from vertex k on
    before = np.r_[n - 1, 0 : n - 1]
    bend = (heading - heading[before] + np.pi) % (2 * np.pi) - np.pi
    if turn:  # there and back: what is a left turn one way is a right turn the other way, to the last bit
        bend[[0, turn]] = -np.pi
        bend[turn + 1 :] = -bend[1:turn][::-1]
    swing = bend + lean - lean[before]  # of the envelope's normal at vertex k; to the right = a join on the outside
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
    arc = ~inside & (np.abs(swing) > 1e-9) & (r > 1e-3)
    steps = np.where(arc, np.ceil(np.abs(swing) / _chord_angle(r, tolerance)).astype(np.int64) + 1, 1)
    steps = np.where(pivot, 3, steps)
    steps = np.where(~inside & ~arc, 1, steps)
    vertex = np.repeat(np.arange(n), steps)
    j = np.arange(len(vertex)) - np.repeat(np.cumsum(steps) - steps, steps)
    angle = normal[before][vertex] + swing[vertex] * j / np.maximum(steps[vertex] - 1, 1)
    ring = p[vertex] + r[vertex, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring[meet[vertex]] = (start[before] + s[:, None] * u)[vertex[meet[vertex]]]
    at_pivot = pivot[vertex]
    ring[at_pivot & (j == 0)], ring[at_pivot & (j == 1)], ring[at_pivot & (j == 2)] = a[pivot], p[pivot], b[pivot]
    hard = at_pivot | ((meet | (~inside & ~arc)) & (np.abs(swing) > 0.5))[vertex]
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
        far = np.where(hit, (along[first] - along[i])[:, None] + (along[j] - along[last])[None], np.inf)
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


# ------------------------------------------------------------------------------------------- u-v and pixels


@dataclass(frozen=True)
class Ribbon:
    """A stroke's centre line as its texture sees it: run on past the ends of an open stroke.

    Parameters
    ----------
    xy : (n, 2) float64, pixels; no two neighbours coincide
    half : (n,) float64, pixels from the centre line to v = 1
    along : (n,) float64, pixels of arc length from the ribbon's beginning
    closed : bool, its end is its beginning
    """

    xy: np.ndarray
    half: np.ndarray
    along: np.ndarray
    closed: bool

    @property
    def length(self) -> float:
        return float(self.along[-1])


def half_widths(strokes: Strokes, i: int, margin: float) -> np.ndarray:
    """Pixels from the centre line to the edge of the ribbon at each point of stroke i, (n,).

    Half the thickness plus `margin`; but where a stroke narrows faster than NARROWING, as at a blunt end, the ribbon
    does not: there the texture's alpha is the shape, and its grain is not squeezed to a point.
    """
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, half = strokes.xy[rows], 0.5 * strokes.thickness[rows]
    s = NARROWING * np.r_[0.0, np.cumsum(np.hypot(*np.diff(xy, axis=0).T))]
    if strokes.closed[i]:
        half, s = np.tile(half, 3), np.concatenate([s - s[-1], s, s + s[-1]])
    half = np.maximum(np.maximum.accumulate(half + s) - s, np.maximum.accumulate((half - s)[::-1])[::-1] + s)
    return half[len(xy) : 2 * len(xy)] + margin if strokes.closed[i] else half + margin


def ribbon_outlines(drawing: Drawing, tolerance: float = 0.1, index=None) -> list[list[np.ndarray]]:
    """Outlines of the ribbons that the texture fills, as `outlines` has them of the strokes."""
    strokes = drawing.strokes
    half = [half_widths(strokes, i, drawing.texture.margin) for i in range(len(strokes))]
    wide = 2.0 * np.concatenate(half) if half else strokes.thickness
    return outlines(Strokes(strokes.xy, wide, strokes.offsets, strokes.kind, strokes.closed), tolerance, index)


def ribbon(strokes: Strokes, i: int, margin: float, scale: float = 1.0) -> Ribbon:
    """The ribbon of stroke i, all lengths multiplied by `scale`.

    A broad ribbon cannot follow every tremor of its centre line without folding: it is smoothed by STIFFNESS of its
    half width.
    """
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, half = distinct(strokes.xy[rows], half_widths(strokes, i, margin))
    closed = bool(strokes.closed[i]) and len(xy) > 3
    if len(xy) > 2:
        xy, half = _stiffened(xy, half, closed)
    if not closed:
        out = xy[[0, -1]] - xy[[1, -2]] if len(xy) > 1 else np.array([[-1.0, 0.0], [1.0, 0.0]])
        out = out / np.hypot(out[:, 0], out[:, 1])[:, None]
        reach = np.maximum(half[[0, -1]], 1e-3)
        xy = np.concatenate([xy[:1] + reach[0] * out[:1], xy, xy[-1:] + reach[1] * out[1:]])
        half = np.r_[half[0], half, half[-1]]
    step = np.hypot(*np.diff(xy, axis=0).T)
    return Ribbon(xy * scale, half * scale, np.r_[0.0, np.cumsum(step)] * scale, closed)


def _stiffened(xy, half, closed):
    """Points evenly spaced along a centre line that is smoothed by STIFFNESS times its median half width."""
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(xy, axis=0).T))]
    sigma = STIFFNESS * float(np.median(half))
    count = max(3, int(np.ceil(along[-1] / max(1.0, min(sigma, 3.0)))))
    at = np.linspace(0.0, along[-1], count + 1)
    even = np.stack([np.interp(at, along, column) for column in xy.T], axis=1)
    half = np.interp(at, along, half)
    sigma = sigma * count / along[-1]
    reach = min(int(4 * sigma) + 1, count)
    if closed:
        padded = np.concatenate([even[-1 - reach : -1], even, even[1 : 1 + reach]])
    else:  # turned about the ends, so that these stay where they are
        padded = np.concatenate([2 * even[:1] - even[reach:0:-1], even, 2 * even[-1:] - even[-2 : -2 - reach : -1]])
    smooth = ndimage.gaussian_filter1d(padded, sigma, axis=0, mode="nearest")[reach : reach + count + 1]
    if closed:
        smooth[-1] = smooth[0]
    moved = np.hypot(*np.diff(smooth, axis=0).T) > 1e-6
    keep = np.r_[True, moved]
    return smooth[keep], half[keep]


def strip_points(band: Ribbon, rows: int, columns: int) -> np.ndarray:
    """Where the texels of a strip (rows, columns) lie on the image, (rows, columns, 2) pixels."""
    u = (np.arange(rows) + 0.5) / rows * band.length
    # tangents are blended along each segment, so that rows fan out evenly round a bend instead of jumping at its points
    d = np.diff(band.xy, axis=0)
    d = d / np.hypot(d[:, 0], d[:, 1])[:, None]
    middle = 0.5 * (band.along[1:] + band.along[:-1])
    tangent = np.stack([np.interp(u, middle, d[:, k]) for k in (0, 1)], axis=1)
    tangent = tangent / np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    centre = np.stack([np.interp(u, band.along, band.xy[:, k]) for k in (0, 1)], axis=1)
    v = (2.0 * np.arange(columns) + 1.0) / columns - 1.0
    across = v[None] * np.interp(u, band.along, band.half)[:, None]
    return centre[:, None] + across[..., None] * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)[:, None]


def strip_stretch(band: Ribbon, rows: int, columns: int) -> np.ndarray:
    """How far the texels of a strip lie apart along the ribbon, relative to the centre line's, (rows, columns).

    1 where the ribbon is straight, above 1 outside a bend, below 0 where the inside of a bend is folded.
    """
    at = strip_points(band, rows, columns)
    ahead = np.diff(at, axis=0, append=2 * at[-1:] - at[-2:-1])
    middle = ahead[:, [(columns - 1) // 2, columns // 2]].mean(axis=1)
    size = np.maximum(np.square(middle).sum(axis=1), 1e-12)
    return np.einsum("rck,rk->rc", ahead, middle) / size[:, None]


@dataclass(frozen=True)
class Crop:
    """The pixels of a canvas round a stroke: columns x0 .. x0 + w, rows y0 .. y0 + h."""

    x0: int
    y0: int
    w: int
    h: int

    @property
    def index(self) -> tuple[slice, slice]:
        return slice(self.y0, self.y0 + self.h), slice(self.x0, self.x0 + self.w)


def crop_of(xy: np.ndarray, reach: np.ndarray, size: tuple[int, int]) -> Crop:
    """The pixels within `reach` (n,) of the points (n, 2), cut to the canvas."""
    low, high = np.floor((xy - reach[:, None]).min(axis=0)), np.ceil((xy + reach[:, None]).max(axis=0))
    x0, y0 = np.clip(low, 0, size).astype(int)
    x1, y1 = np.clip(high, 0, size).astype(int)
    return Crop(int(x0), int(y0), int(max(x1 - x0, 0)), int(max(y1 - y0, 0)))


def _near_pairs(xy, reach, crop):
    """Every (segment, pixel) that may touch: segment (P,), pixel's index in the crop (P,), its centre (P, 2)."""
    a, b = xy[:-1], xy[1:]
    far = np.maximum(reach[:-1], reach[1:])[:, None]
    low = np.floor(np.minimum(a, b) - far - [crop.x0, crop.y0])
    high = np.ceil(np.maximum(a, b) + far - [crop.x0, crop.y0])
    low = np.clip(low, 0, [crop.w, crop.h]).astype(np.int64)
    size = np.maximum(np.clip(high, 0, [crop.w, crop.h]).astype(np.int64) - low, 0)
    count = size[:, 0] * size[:, 1]
    segment = np.repeat(np.arange(len(a)), count)
    k = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    width = np.repeat(size[:, 0], count)
    row = k // np.maximum(width, 1)
    x = np.repeat(low[:, 0], count) + k - row * width
    y = np.repeat(low[:, 1], count) + row
    return segment, y * crop.w + x, np.stack([x + crop.x0 + 0.5, y + crop.y0 + 0.5], axis=1)


def _short_steps(xy, *fields):
    """The polyline with points added so that a segment's box is not much larger than the segment's surroundings."""
    step = np.hypot(*np.diff(xy, axis=0).T)
    pieces = np.maximum(np.ceil(step / np.maximum(4.0, fields[0].max())), 1).astype(np.int64)
    if (pieces == 1).all():
        return (xy, *fields)
    at = np.repeat(np.arange(len(step)), pieces)
    at = at + (np.arange(len(at)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[at]
    at, k = np.r_[at, len(step)], np.arange(len(xy))
    return (np.stack([np.interp(at, k, c) for c in xy.T], axis=1), *(np.interp(at, k, f) for f in fields))


def coverage(strokes: Strokes, i: int, size: tuple[int, int], scale: float = 1.0) -> tuple[Crop, np.ndarray]:
    """How much of each pixel stroke i covers, in [0, 1]: (crop, (h, w) float64)."""
    crop, pixel, distance, width = _pixel_distances(strokes, i, size, scale, 1.0)
    # the pixel's part within a band: what the near edge lets in less what the far edge shuts out
    part = np.clip(0.5 - distance, 0.0, 1.0) - np.clip(0.5 - distance - width, 0.0, 1.0)
    cover = np.zeros(crop.w * crop.h)
    np.maximum.at(cover, pixel, part)
    return crop, cover.reshape(crop.h, crop.w)


def distance_map(strokes: Strokes, i: int, size: tuple[int, int], reach: float) -> tuple[Crop, np.ndarray]:
    """Signed distance of each pixel's centre to stroke i, px, negative inside: (crop, (h, w)); inf beyond `reach`."""
    crop, pixel, distance, _ = _pixel_distances(strokes, i, size, 1.0, reach)
    nearest = np.full(crop.w * crop.h, np.inf)
    np.minimum.at(nearest, pixel, distance)
    return crop, np.where(nearest <= reach, nearest, np.inf).reshape(crop.h, crop.w)


def _pixel_distances(strokes, i, size, scale, reach):
    """Crop, and for every (segment, pixel) within reach: the pixel, its signed distance, the segment's width."""
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, radius = distinct(strokes.xy[rows] * scale, 0.5 * strokes.thickness[rows] * scale)
    if len(xy) == 1:
        xy, radius = np.concatenate([xy, xy + [[1e-6, 0.0]]]), np.r_[radius, radius]
    crop = crop_of(xy, radius + reach, size)
    xy, radius = _short_steps(xy, radius)
    k, pixel, at = _near_pairs(xy, radius + reach, crop)
    length, direction, r0, slope = (value[k] for value in _segments(xy, radius, np.arange(len(xy) - 1)))
    distance = _cone_distance(at - xy[k], length, direction, r0, slope)
    return crop, pixel, distance, 2.0 * np.maximum(r0, radius[k + 1])


def _arms(xy):
    """Cut a centre line where it has turned by more than 150 degrees: no arm overlaps itself. [(first, last), ...]"""
    d = np.diff(xy, axis=0)
    heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    cuts, first, low, high = [0], 0, heading[0], heading[0]
    if np.ptp(heading) > np.radians(150.0):
        for k, angle in enumerate(heading.tolist()):
            low, high = min(low, angle), max(high, angle)
            if high - low > np.radians(150.0) and k > first:
                cuts.append(k)
                first, low, high = k, angle, angle
    cuts.append(len(xy) - 1)
    return list(zip(cuts[:-1], cuts[1:], strict=True))


def ribbon_coordinates(band: Ribbon, crop: Crop) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(pixel, u, v) of a ribbon's pixels, one entry for every arm of the ribbon that does not overlap itself.

    `pixel` (M,) indexes the flattened crop, u (M,) in [0, 1] runs along the ribbon, v (M,) in [-1, 1] across it. A
    pixel takes the closest point of the arm. Where arms meet, a pixel that only reaches an arm's cut end goes to the
    other.
    """
    xy, half, along = _short_steps(band.xy, band.half, band.along)
    entries, spare, taken = [], [], np.zeros(crop.w * crop.h, bool)
    for a, b in _arms(xy):
        p, h, s = xy[a : b + 1], half[a : b + 1], along[a : b + 1]
        k, pixel, at = _near_pairs(p, h, crop)
        length, direction, h0, slope = (value[k] for value in _segments(p, h, np.arange(len(p) - 1)))
        rel = at - p[k]
        x = rel[:, 0] * direction[:, 0] + rel[:, 1] * direction[:, 1]
        y = rel[:, 1] * direction[:, 0] - rel[:, 0] * direction[:, 1]
        foot = np.clip(x, 0.0, length)
        distance = np.hypot(x - foot, y)
        v = np.where(y < 0, -distance, distance) / np.maximum(h0 - slope * foot, 1e-9)
        before, past = (x < 0) & (k == 0), (x > length) & (k == len(p) - 2)
        near = np.abs(v) <= 1.0
        if not band.closed:
            near &= ~(before & (a == 0)) & ~(past & (b == len(xy) - 1))
        past |= before
        k, pixel, v, distance, past = k[near], pixel[near], v[near], distance[near], past[near]
        u = (s[k] + foot[near]) / band.length
        best = np.full(crop.w * crop.h, np.inf)
        np.minimum.at(best, pixel, distance)
        first = np.flatnonzero(distance == best[pixel])
        pick = np.full(crop.w * crop.h, -1)
        pick[pixel[first]] = first
        pick = pick[pick >= 0]
        inner, rest = pick[~past[pick]], pick[past[pick]]
        taken[pixel[inner]] = True
        entries.append((pixel[inner], u[inner], v[inner]))
        spare.append((pixel[rest], u[rest], v[rest]))
    return entries + [tuple(value[~taken[pixel]] for value in (pixel, u, v)) for pixel, u, v in spare if len(pixel)]


def sample_strip(strip: np.ndarray, u: np.ndarray, v: np.ndarray, wrap: bool) -> np.ndarray:
    """Bilinear look-up in a strip (n, A, 4) float, premultiplied, at u in [0, 1] and v in [-1, 1]: (M, 4)."""
    n, a, _ = strip.shape
    row, column = u * n - 0.5, np.clip((v + 1.0) * 0.5 * a - 0.5, 0, a - 1)
    r0, c0 = np.floor(row).astype(np.int64), np.minimum(column.astype(np.int64), max(a - 2, 0))
    fr, fc = (row - r0)[:, None], (column - c0)[:, None]
    r1 = r0 + 1
    r0, r1 = (r0 % n, r1 % n) if wrap else (np.clip(r0, 0, n - 1), np.clip(r1, 0, n - 1))
    flat, c1 = strip.reshape(n * a, 4), np.minimum(c0 + 1, a - 1)
    top = flat[r0 * a + c0] * (1 - fc) + flat[r0 * a + c1] * fc
    return top * (1 - fr) + (flat[r1 * a + c0] * (1 - fc) + flat[r1 * a + c1] * fc) * fr


def stroke_pixels(drawing: Drawing, i: int, scale: float = 1.0, texture: bool = True) -> tuple[Crop, np.ndarray]:
    """Stroke i alone on a canvas of `scale` times the drawing's size: (crop, (h, w, 4) float32 premultiplied)."""
    size = canvas_size(drawing, scale)
    if drawing.texture is None or not texture:
        crop, cover = coverage(drawing.strokes, i, size, scale)
        red, green, blue, alpha = drawing.color[i]
        return crop, (cover * alpha)[..., None].astype(np.float32) * np.float32([red, green, blue, 1.0])
    strips = drawing.texture
    strip = strips.rgba[strips.offsets[i] : strips.offsets[i + 1]].astype(np.float32) / 255.0
    strip[..., :3] *= strip[..., 3:]
    band = ribbon(drawing.strokes, i, strips.margin, scale)
    crop = crop_of(band.xy, band.half, size)
    layer = np.zeros((crop.h * crop.w, 4), np.float32)
    for pixel, u, v in ribbon_coordinates(band, crop):
        color = sample_strip(strip, u, v, band.closed)
        stronger = color[:, 3] > layer[pixel, 3]  # where a stroke crosses itself
        layer[pixel[stronger]] = color[stronger]
    return crop, layer.reshape(crop.h, crop.w, 4)


def canvas_size(drawing: Drawing, scale: float) -> tuple[int, int]:
    """(width, height) of the drawing's raster at `scale` pixels a pixel."""
    return max(1, round(drawing.size[0] * scale)), max(1, round(drawing.size[1] * scale))


def rasterise(
    drawing: Drawing, scale: float = 1.0, background: tuple[float, float, float] | None = None, texture: bool = True
) -> np.ndarray:
    """The drawing as pixels: (H, W, 3) uint8 on a background (r, g, b) in [0, 1], else (H, W, 4) with straight alpha.

    Strokes are laid over each other in `paint_order`. Without a texture, or with `texture` False, a stroke is its flat
    ink with an analytic edge; with one it is the strip, looked up bilinearly, whose alpha makes the edge.
    """
    if not scale > 0:
        raise ValueError(f"the scale of a raster must be above 0, got {scale}")
    width, height = canvas_size(drawing, scale)
    canvas = np.zeros((height, width, 4), np.float32)
    for i in paint_order(drawing.strokes):
        crop, layer = stroke_pixels(drawing, int(i), scale, texture)
        canvas[crop.index] = layer + canvas[crop.index] * (1.0 - layer[..., 3:])
    alpha = canvas[..., 3:]
    if background is not None:
        rgb = canvas[..., :3] + (1.0 - alpha) * np.float32(background)
        return np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8)
    rgb = canvas[..., :3] / np.maximum(alpha, 1e-6)
    return np.rint(np.clip(np.concatenate([rgb, alpha], axis=-1), 0, 1) * 255).astype(np.uint8)


# ------------------------------------------------------------------------------------------------- cubic fitting


def fit_cubics(rings: list[np.ndarray], corners: list[np.ndarray], tolerance: float) -> list[np.ndarray]:
    """Smooth cubic Beziers through closed polygons, within `tolerance` of their vertices.

    Schneider 1990 ("An algorithm for automatically fitting digitized curves"), all pieces of all rings in step:
    fit by least squares with the end tangents held, reparameterise, cut where the error is worst.

    Parameters
    ----------
    rings : polygons (n, 2), the last point joined to the first
    corners : (n,) bool, where the outline may have a kink

    Returns
    -------
    list of (K, 4, 2), one a ring
    """
    if not rings:
        return []
    xy, first_tangent, last_tangent, begin, end, home = [], [], [], [], [], []
    at = 0
    for k, (ring, corner) in enumerate(zip(rings, corners, strict=True)):
        n = len(ring)
        if n < 3:
            ring, corner, n = np.concatenate([ring] * 3)[:3], np.ones(3, bool), 3
        cut = np.flatnonzero(corner)
        if not len(cut):
            cut = np.array([0])
        ring = np.concatenate([ring[cut[0] :], ring[: cut[0] + 1]])
        corner = np.r_[corner[cut[0] :], corner[: cut[0] + 1]]
        leave = np.diff(ring, axis=0)
        leave = leave / np.maximum(np.hypot(leave[:, 0], leave[:, 1]), 1e-12)[:, None]
        ahead, behind = np.concatenate([leave, leave[:1]]), np.concatenate([leave[-1:], leave])
        middle = ahead + behind
        size = np.hypot(middle[:, 0], middle[:, 1])
        middle = np.where(size[:, None] > 0.2, middle / np.maximum(size, 1e-12)[:, None], ahead)
        first_tangent.append(np.where(corner[:, None], ahead, middle))
        last_tangent.append(np.where(corner[:, None], behind, middle))
        stop = np.unique(np.r_[0, (cut - cut[0]), n])
        begin.append(at + stop[:-1])
        end.append(at + stop[1:])
        home.append(np.full(len(stop) - 1, k))
        xy.append(ring)
        at += n + 1
    xy, first_tangent, last_tangent = np.concatenate(xy), np.concatenate(first_tangent), np.concatenate(last_tangent)
    begin, end, home = np.concatenate(begin), np.concatenate(end), np.concatenate(home)
    done = []
    while len(begin):
        cubic, error, worst = _fit_spans(xy, first_tangent, last_tangent, begin, end)
        good = (error <= tolerance) | (end - begin < 2)
        done.append((begin[good], home[good], cubic[good]))
        b, e, h, w = begin[~good], end[~good], home[~good], worst[~good]
        begin, end, home = np.r_[b, w], np.r_[w, e], np.r_[h, h]
    order = np.argsort(np.concatenate([b for b, _, _ in done]), kind="stable")
    cubic = np.concatenate([c for _, _, c in done])[order]
    home = np.concatenate([h for _, h, _ in done])[order]
    return np.split(cubic, np.searchsorted(home, np.arange(1, len(rings))))


def _fit_spans(xy, first_tangent, last_tangent, begin, end):
    """One cubic for each span of rows begin..end (inclusive): control points, worst error, and the row to cut at."""
    count = end - begin + 1
    head = np.cumsum(count) - count
    span = np.repeat(np.arange(len(begin)), count)
    row = np.arange(count.sum()) - np.repeat(head - begin, count)
    q = xy[row]
    step = np.r_[0.0, np.hypot(*np.diff(q, axis=0).T)]
    step[head] = 0.0
    along = np.cumsum(step)
    along = along - along[head][span]
    length = along[head + count - 1]
    t = along / np.maximum(length, 1e-12)[span]
    p0, p3, t1, t2 = xy[begin], xy[end], first_tangent[begin], -last_tangent[end]
    chord = np.hypot(*(p3 - p0).T)

    def total(values):
        return np.add.reduceat(values, head, axis=0)

    for attempt in range(3):
        b0, b1, b2, b3 = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
        rest = q - (b0 + b1)[:, None] * p0[span] - (b2 + b3)[:, None] * p3[span]
        c11, c22 = total(b1 * b1), total(b2 * b2)
        c12 = total(b1 * b2) * (t1 * t2).sum(axis=1)
        x1, x2 = total(b1 * (rest * t1[span]).sum(axis=1)), total(b2 * (rest * t2[span]).sum(axis=1))
        det = c11 * c22 - c12 * c12
        solvable = (count > 2) & (det > 1e-9 * np.maximum(c11 * c22, 1e-12))
        safe = np.where(solvable, det, 1.0)
        h1, h2 = (x1 * c22 - x2 * c12) / safe, (c11 * x2 - c12 * x1) / safe
        # handles that point backwards or overtake each other make loops: then a third of the way
        solvable &= (h1 > 0.01 * chord) & (h2 > 0.01 * chord) & (h1 + h2 < 1.5 * length)
        h1, h2 = np.where(solvable, h1, length / 3), np.where(solvable, h2, length / 3)
        p1, p2 = p0 + h1[:, None] * t1, p3 + h2[:, None] * t2
        curve = b0[:, None] * p0[span] + b1[:, None] * p1[span] + b2[:, None] * p2[span] + b3[:, None] * p3[span]
        off = curve - q
        if attempt < 2:  # one Newton step towards the nearest parameter
            d1 = 3 * (
                ((1 - t) ** 2)[:, None] * (p1 - p0)[span]
                + (2 * t * (1 - t))[:, None] * (p2 - p1)[span]
                + (t * t)[:, None] * (p3 - p2)[span]
            )
            d2 = 6 * ((1 - t)[:, None] * (p2 - 2 * p1 + p0)[span] + t[:, None] * (p3 - 2 * p2 + p1)[span])
            slope = (d1 * d1 + off * d2).sum(axis=1)
            move = (off * d1).sum(axis=1) / np.where(slope > 1e-12, slope, np.inf)
            t = np.clip(t - move, 0.0, 1.0)
            t[head], t[head + count - 1] = 0.0, 1.0
    error = np.round(np.hypot(off[:, 0], off[:, 1]), 9)  # so that ties fall alike whatever else is fitted beside
    worst = np.maximum.reduceat(error, head)
    inner = np.where((row > begin[span]) & (row < end[span]), error, -1.0)
    top = np.maximum.reduceat(inner, head)
    pick = np.flatnonzero(inner == top[span])
    at = np.full(len(begin), 0)
    at[span[pick[::-1]]] = row[pick[::-1]]
    return np.stack([p0, p1, p2, p3], axis=1), worst, at
