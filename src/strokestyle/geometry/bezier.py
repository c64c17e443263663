"""Fit smooth cubic Beziers through polygons and polylines, and flatten them again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .. import files as limits
from .curves import counting, peaks


def fit_cubics(
    rings: list[np.ndarray], corners: list[np.ndarray], tolerance: float
) -> list[np.ndarray]:
    """Fit smooth cubic Beziers through closed polygons, within `tolerance` of them.

    Schneider 1990 ("An algorithm for automatically fitting digitized curves"), all pieces of all
    rings in step: fit by least squares with the end tangents held, reparameterise, cut where the
    error is worst.

    Parameters
    ----------
    rings : polygons (n, 2), the last point joined to the first
    corners : (n,) bool, where the outline may have a kink
    tolerance : in units of the points

    Returns
    -------
    list of (K, 4, 2), one a ring
    """
    if not rings:
        return []
    opened = [_open_ring(ring, corner) for ring, corner in zip(rings, corners, strict=True)]
    xy, leave, arrive = (
        np.concatenate([getattr(ring, name) for ring in opened])
        for name in ("xy", "leave", "arrive")
    )
    first = np.cumsum([0] + [len(ring.xy) for ring in opened[:-1]])
    begin, end = (
        np.concatenate([ring.stops[which] + at for ring, at in zip(opened, first, strict=True)])
        for which in (slice(None, -1), slice(1, None))
    )
    home = np.repeat(np.arange(len(rings)), [len(ring.stops) - 1 for ring in opened])
    cubic, _, home = _fit(xy, leave, arrive, begin, end, home, tolerance)
    return np.split(cubic, np.searchsorted(home, np.arange(1, len(rings))))


class _OpenRing(NamedTuple):
    """A closed polygon as a polyline from a corner back to it.

    xy : (n + 1, 2)
    leave, arrive : (n + 1, 2), unit tangents behind and before each point
    stops : (K + 1,) int, the points where its pieces begin and end
    """

    xy: np.ndarray
    leave: np.ndarray
    arrive: np.ndarray
    stops: np.ndarray


def _open_ring(ring: np.ndarray, corner: np.ndarray) -> _OpenRing:
    """Open a polygon (n, 2) at its first corner (n,), or at its first point where it has none."""
    if len(ring) < 3:
        ring, corner = np.concatenate([ring] * 3)[:3], np.ones(3, bool)
    cut = np.flatnonzero(corner)
    if not len(cut):
        cut = np.array([0])
    stops = np.unique(np.r_[0, (cut - cut[0]), len(ring)])
    ring = np.concatenate([ring[cut[0] :], ring[: cut[0] + 1]])
    corner = np.r_[corner[cut[0] :], corner[: cut[0] + 1]]
    step = np.diff(ring, axis=0)
    step = step / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-12)[:, None]
    ahead, behind = np.concatenate([step, step[:1]]), np.concatenate([step[-1:], step])
    middle = ahead + behind
    size = np.hypot(middle[:, 0], middle[:, 1])
    middle = np.where(size[:, None] > 0.2, middle / np.maximum(size, 1e-12)[:, None], ahead)
    sharp = corner[:, None]
    return _OpenRing(ring, np.where(sharp, ahead, middle), np.where(sharp, behind, middle), stops)


def fit_lines(
    xy: np.ndarray, offsets: np.ndarray, tolerance: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Fit smooth cubic Beziers through open polylines, as `fit_cubics` does.

    The curves have corners where a line turns sharply.

    Parameters
    ----------
    xy : (N, 2)
    offsets : (C+1,) int, line i is rows offsets[i]:offsets[i+1]
    tolerance : in units of xy

    Returns
    -------
    list of (curves (K, 4, 2), rows (K+1,)), one a line; curve k goes from the line's point rows[k]
    to rows[k+1]
    """
    count = np.diff(offsets)
    if not len(count):
        return []
    first, last = offsets[:-1], offsets[1:] - 1
    leave, arrive, cut = _line_tangents(xy, first, last)
    cut[first] = cut[last] = True
    row = np.flatnonzero(cut)
    line = np.repeat(np.arange(len(count)), count)[row]
    inside = line[1:] == line[:-1]
    begin, end, home = row[:-1][inside], row[1:][inside], line[:-1][inside]
    cubic, begin, home = _fit(xy, leave, arrive, begin, end, home, tolerance)
    at = np.searchsorted(home, np.arange(1, len(count)))
    pairs = zip(np.split(cubic, at), np.split(begin, at), first, last, strict=True)
    return [(c, np.r_[b, z] - a) for c, b, a, z in pairs]


def _line_tangents(
    xy: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the unit tangents (N, 2) behind and before each point, and where lines turn sharply.

    `first`, `last` : (C,) int, rows of the lines' ends
    """
    leave = np.diff(xy, axis=0, append=xy[-1:])
    size = np.hypot(leave[:, 0], leave[:, 1])
    leave = np.where(size[:, None] > 1e-9, leave / np.maximum(size, 1e-12)[:, None], [1.0, 0.0])
    leave[last] = leave[last - 1]
    arrive = np.roll(leave, 1, axis=0)
    arrive[first] = leave[first]
    sharp = (leave * arrive).sum(axis=1) < 0.5
    middle = leave + arrive
    middle = middle / np.maximum(np.hypot(middle[:, 0], middle[:, 1]), 1e-12)[:, None]
    kink = sharp[:, None]
    return np.where(kink, leave, middle), np.where(kink, arrive, middle), sharp


def _fit(
    xy: np.ndarray,
    leave: np.ndarray,
    arrive: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    home: np.ndarray,
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit cubics to spans of rows begin..end (S,), cut where they must be.

    Parameters
    ----------
    xy : (N, 2)
    leave, arrive : (N, 2), unit tangents behind and before each point
    home : (S,) int, the ring or line of each span

    Returns
    -------
    control points (K, 4, 2), first rows (K,) and `home` (K,) of the cubics, by their first rows
    """
    # points of the plane as complex numbers: half the calls, and no axis of two
    xy, leave, arrive = (
        np.ascontiguousarray(v, np.float64).view(np.complex128)[:, 0] for v in (xy, leave, arrive)
    )
    done = []
    while len(begin):
        cubic, error, worst = _fit_spans(xy, leave, arrive, begin, end, tolerance)
        good = (error <= tolerance) | (end - begin < 2)
        done.append((begin[good], home[good], cubic[good]))
        b, e, h, w = begin[~good], end[~good], home[~good], worst[~good]
        begin, end, home = np.r_[b, w], np.r_[w, e], np.r_[h, h]
    begin, home, cubic = (np.concatenate(column) for column in zip(*done, strict=True))
    order = np.argsort(begin, kind="stable")
    cubic = np.ascontiguousarray(cubic[order]).view(np.float64).reshape(-1, 4, 2)
    return cubic, begin[order], home[order]


_Points = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # p0, p1, p2, p3 of cubics, (S,)


@dataclass(frozen=True)
class _Spans:
    """Stretches of polylines, each to be fitted by one cubic; their points lie one after the other.

    Parameters
    ----------
    begin, end : (S,) int, first and last row of each span in the polylines
    count : (S,) int, how many points each has
    head : (S,) int, the first of its points
    span : (P,) int, the span of each point
    row : (P,) int, the row of each point in the polylines
    points : (P,) complex
    start, stop : (S,) complex, first and last point
    leave, arrive : (S,) complex, unit tangents there, both into the span
    """

    begin: np.ndarray
    end: np.ndarray
    count: np.ndarray
    head: np.ndarray
    span: np.ndarray
    row: np.ndarray
    points: np.ndarray
    start: np.ndarray
    stop: np.ndarray
    leave: np.ndarray
    arrive: np.ndarray

    @classmethod
    def of(
        cls,
        xy: np.ndarray,
        first_tangent: np.ndarray,
        last_tangent: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
    ) -> _Spans:
        count = end - begin + 1
        head = np.cumsum(count) - count
        span = np.repeat(np.arange(len(begin)), count)
        row = np.arange(count.sum()) - np.repeat(head - begin, count)
        ends = xy[begin], xy[end], first_tangent[begin], -last_tangent[end]
        return cls(begin, end, count, head, span, row, xy[row], *ends)

    @property
    def last(self) -> np.ndarray:
        """(S,) int, the last point of each span."""
        return self.head + self.count - 1

    def total(self, values: np.ndarray) -> np.ndarray:
        """Sum the values (P,) of the points of each span."""
        return np.add.reduceat(values, self.head, axis=0)

    def largest(self, values: np.ndarray) -> np.ndarray:
        """Find the largest of the values (P,) of the points of each span."""
        return np.maximum.reduceat(values, self.head)


def _fit_spans(
    xy: np.ndarray,
    first_tangent: np.ndarray,
    last_tangent: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit one cubic to each span of rows begin..end, both included.

    Returns control points (S, 4) complex, the worst error of each (S,), and the row to cut it at
    (S,).
    """
    spans = _Spans.of(xy, first_tangent, last_tangent, begin, end)
    t, length = _chord_length_parameters(spans)
    chord = np.abs(spans.stop - spans.start)
    thirds = _third_handles(spans, length, chord, tolerance)
    for attempt in range(3):
        weights = _bernstein(t)
        points = _fit_handles(spans, weights, length, chord, thirds)
        off = _at_points(spans, points, weights) - spans.points
        if attempt < 2:
            t = _newton(spans, points, off, t)
    error = _errors(spans, points, off, t, tolerance)
    return np.stack(points, axis=1), spans.largest(error), _worst_rows(spans, error)


def _chord_length_parameters(spans: _Spans) -> tuple[np.ndarray, np.ndarray]:
    """Give each point its share (P,) in [0, 1] of the way along its span; and the lengths (S,)."""
    step = np.r_[0.0, np.abs(np.diff(spans.points))]
    step[spans.head] = 0.0
    along = np.cumsum(step)
    along = along - along[spans.head][spans.span]
    length = along[spans.last]
    return along / np.maximum(length, 1e-12)[spans.span], length


def _third_handles(
    spans: _Spans, length: np.ndarray, chord: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the lengths (S,) of both handles where least squares have none: a third of the way.

    The tangents of a span without points between are held to nothing: they must not carry its curve
    off the chord.
    """
    along = (spans.stop - spans.start) / np.maximum(chord, 1e-12)
    lean = _lean(spans.leave, along), _lean(spans.arrive, -along)
    short = [np.minimum(length / 3, tolerance / np.maximum(sine, 1e-12)) for sine in lean]
    first, second = (np.where(spans.count > 2, length / 3, handle) for handle in short)
    return first, second


def _bernstein(t: np.ndarray) -> _Points:
    """The four weights (P,) of a cubic's points at parameters t (P,)."""
    s = 1 - t
    return s * s * s, 3 * t * s * s, 3 * t * t * s, t * t * t


def _fit_handles(
    spans: _Spans,
    weights: _Points,
    length: np.ndarray,
    chord: np.ndarray,
    thirds: tuple[np.ndarray, np.ndarray],
) -> _Points:
    """Find the handles along the end tangents by least squares, after Schneider 1990."""
    b0, b1, b2, b3 = weights
    p0, p3, t1, t2, span = spans.start, spans.stop, spans.leave, spans.arrive, spans.span
    rest = spans.points - (b0 + b1) * p0.take(span) - (b2 + b3) * p3.take(span)
    c11, c22 = spans.total(b1 * b1), spans.total(b2 * b2)
    c12 = spans.total(b1 * b2) * _dot(t1, t2)
    x1 = spans.total(b1 * _dot(rest, t1.take(span)))
    x2 = spans.total(b2 * _dot(rest, t2.take(span)))
    det = c11 * c22 - c12 * c12
    solvable = (spans.count > 2) & (det > 1e-9 * np.maximum(c11 * c22, 1e-12))
    safe = np.where(solvable, det, 1.0)
    h1, h2 = (x1 * c22 - x2 * c12) / safe, (c11 * x2 - c12 * x1) / safe
    # handles that point backwards or overtake each other make loops: then a third of the way
    solvable &= (h1 > 0.01 * chord) & (h2 > 0.01 * chord) & (h1 + h2 < 1.5 * length)
    h1, h2 = np.where(solvable, h1, thirds[0]), np.where(solvable, h2, thirds[1])
    return p0, p0 + h1 * t1, p3 + h2 * t2, p3


def _at_points(spans: _Spans, points: _Points, weights: _Points) -> np.ndarray:
    """Evaluate the cubics at the parameter of each point, (P,) complex."""
    at = np.zeros(len(spans.span), np.complex128)
    for weight, point in zip(weights, points, strict=True):
        at += weight * point.take(spans.span)
    return at


def _newton(spans: _Spans, points: _Points, off: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Move each parameter t (P,) one step of Newton's towards the nearest place on its cubic.

    `off` : (P,) complex, from the point to the cubic at its parameter
    """
    (p0, p1, p2, p3), span, s = points, spans.span, 1 - t
    d1 = (s * s) * (3 * (p1 - p0)).take(span)
    d1 += (2 * t * s) * (3 * (p2 - p1)).take(span)
    d1 += (t * t) * (3 * (p3 - p2)).take(span)
    d2 = s * (6 * (p2 - 2 * p1 + p0)).take(span) + t * (6 * (p3 - 2 * p2 + p1)).take(span)
    slope = _dot(d1, d1) + _dot(off, d2)
    move = _dot(off, d1) / np.where(slope > 1e-12, slope, np.inf)
    t = np.clip(t - move, 0.0, 1.0)
    t[spans.head], t[spans.last] = 0.0, 1.0
    return t


def _errors(
    spans: _Spans, points: _Points, off: np.ndarray, t: np.ndarray, tolerance: float
) -> np.ndarray:
    """How far the cubics are from the points (P,), and half-way between two from the edge there.

    A curve that keeps to the points must keep to the polygon's edges between them too. Rounded, so
    that ties fall alike whatever else is fitted beside.
    """
    error = np.round(np.abs(off), 9)
    close = (spans.largest(error) <= tolerance) & (spans.count > 2)
    k = np.flatnonzero((spans.span[1:] == spans.span[:-1]) & close[spans.span[1:]])
    p0, p1, p2, p3 = (p[spans.span[k]] for p in points)
    w = 0.5 * (t[k] + t[k + 1])
    middle = (1 - w) ** 2 * ((1 - w) * p0 + 3 * w * p1) + w * w * (3 * (1 - w) * p2 + w * p3)
    between = np.round(_from_edges(middle, spans.points[k], spans.points[k + 1]), 9)
    error[k], error[k + 1] = np.maximum(error[k], between), np.maximum(error[k + 1], between)
    return error


def _worst_rows(spans: _Spans, error: np.ndarray) -> np.ndarray:
    """Find the row (S,) of each span's inner point with the largest error, the first of equals."""
    inside = (spans.row > spans.begin[spans.span]) & (spans.row < spans.end[spans.span])
    return peaks(np.where(inside, error, -1.0), spans.head, spans.span, spans.row)[1]


def _lean(tangent: np.ndarray, chord: np.ndarray) -> np.ndarray:
    """Find the sine (n,) of the angle between unit vectors (n,) complex, 1 beyond a right angle."""
    return np.where(_dot(tangent, chord) > 0, np.abs((tangent.conj() * chord).imag), 1.0)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The scalar products (n,) of vectors (n,) complex."""
    return a.real * b.real + a.imag * b.imag


def _from_edges(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Measure the distance (n,) of points (n,) complex from the edges a..b."""
    d, off = b - a, points - a
    at = np.clip(_dot(off, d) / np.maximum(_dot(d, d), 1e-18), 0.0, 1.0)
    return np.abs(off - at * d)


# A cubic's four points, x and y in turn.
Segment = tuple[float, float, float, float, float, float, float, float]


def flatten(
    cubics: np.ndarray, offsets: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Flatten chains of cubics to polylines whose chords keep within `tolerance` of the curve.

    n chords of one cubic are off by at most max |B''| / 8 n^2.

    Parameters
    ----------
    cubics : (S, 4, 2)
    offsets : (C+1,) int, chain i is rows offsets[i]:offsets[i+1]
    tolerance : in units of the points

    Returns
    -------
    xy (N, 2), offsets (C+1,) of the polylines

    Raises
    ------
    ValueError
        where that takes more than MAX_POINTS points.
    """
    bend = np.linalg.norm(cubics[:, :-2] - 2 * cubics[:, 1:-1] + cubics[:, 2:], axis=2).max(axis=1)
    wanted = np.maximum(np.ceil(np.sqrt(6 * bend / (8 * tolerance))), 1.0)
    if wanted.sum() > limits.MAX_POINTS:
        raise ValueError(
            f"its curves need more than {limits.MAX_POINTS} points on this canvas: simplify the "
            "drawing first"
        )
    count = wanted.astype(np.int64)
    which = np.repeat(np.arange(len(cubics)), count)
    t = ((counting(count) + 1) / count[which])[:, None]
    s, p = 1 - t, cubics[which]
    along = s**3 * p[:, 0] + 3 * s**2 * t * p[:, 1] + 3 * s * t**2 * p[:, 2] + t**3 * p[:, 3]
    # every chain has its start besides
    new = np.r_[0, np.cumsum(count)][offsets] + np.arange(len(offsets))
    xy = np.empty((new[-1], 2))
    start = np.zeros(len(xy), bool)
    start[new[:-1]] = True
    xy[start], xy[~start] = cubics[offsets[:-1], 0], along
    return xy, new
