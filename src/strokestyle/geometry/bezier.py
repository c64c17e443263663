"""Smooth cubic Beziers through polygons."""

from __future__ import annotations

import numpy as np

from .. import files as limits


def fit_cubics(
    rings: list[np.ndarray], corners: list[np.ndarray], tolerance: float
) -> list[np.ndarray]:
    """Smooth cubic Beziers through closed polygons, within `tolerance` of them.

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
    tangents = np.concatenate(first_tangent), np.concatenate(last_tangent)
    spans = np.concatenate(begin), np.concatenate(end), np.concatenate(home)
    cubic, _, home = _fit(np.concatenate(xy), *tangents, *spans, tolerance)
    return np.split(cubic, np.searchsorted(home, np.arange(1, len(rings))))


def fit_lines(
    xy: np.ndarray, offsets: np.ndarray, tolerance: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Smooth cubic Beziers through open polylines xy (N, 2), as `fit_cubics` has them; corners where they turn sharply.

    Returns
    -------
    list of (curves (K, 4, 2), rows (K+1,)), one a line; curve k goes from the line's point rows[k] to rows[k+1]
    """
    count = np.diff(offsets)
    if not len(count):
        return []
    leave = np.diff(xy, axis=0, append=xy[-1:])
    size = np.hypot(leave[:, 0], leave[:, 1])
    leave = np.where(size[:, None] > 1e-9, leave / np.maximum(size, 1e-12)[:, None], [1.0, 0.0])
    first, last = offsets[:-1], offsets[1:] - 1
    leave[last] = leave[last - 1]
    arrive = np.roll(leave, 1, axis=0)
    arrive[first] = leave[first]
    sharp = (leave * arrive).sum(axis=1) < 0.5
    middle = leave + arrive
    middle = middle / np.maximum(np.hypot(middle[:, 0], middle[:, 1]), 1e-12)[:, None]
    leave, arrive = (
        np.where(sharp[:, None], leave, middle),
        np.where(sharp[:, None], arrive, middle),
    )
    cut = sharp.copy()
    cut[first] = cut[last] = True
    row = np.flatnonzero(cut)
    line = np.repeat(np.arange(len(count)), count)[row]
    inside = line[1:] == line[:-1]
    cubic, begin, home = _fit(
        xy, leave, arrive, row[:-1][inside], row[1:][inside], line[:-1][inside], tolerance
    )
    cubics, begins = (
        np.split(part, np.searchsorted(home, np.arange(1, len(count)))) for part in (cubic, begin)
    )
    return [(c, np.r_[b, z] - a) for c, b, a, z in zip(cubics, begins, first, last, strict=True)]


def _fit(xy, first_tangent, last_tangent, begin, end, home, tolerance):
    """Cubics for spans of rows begin..end, cut where they must be: control points, first rows, and `home` of each."""
    done = []
    while len(begin):
        cubic, error, worst = _fit_spans(xy, first_tangent, last_tangent, begin, end, tolerance)
        good = (error <= tolerance) | (end - begin < 2)
        done.append((begin[good], home[good], cubic[good]))
        b, e, h, w = begin[~good], end[~good], home[~good], worst[~good]
        begin, end, home = np.r_[b, w], np.r_[w, e], np.r_[h, h]
    begin = np.concatenate([b for b, _, _ in done])
    order = np.argsort(begin, kind="stable")
    cubic, home = np.concatenate([c for _, _, c in done]), np.concatenate([h for _, h, _ in done])
    return cubic[order], begin[order], home[order]


def _fit_spans(xy, first_tangent, last_tangent, begin, end, tolerance):
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

    # the tangents of a span without points between are held to nothing: they must not carry its curve off the chord
    along_chord = (p3 - p0) / np.maximum(chord, 1e-12)[:, None]
    third1, third2 = (
        np.where(
            count > 2,
            length / 3,
            np.minimum(length / 3, tolerance / np.maximum(_lean(tangent, way), 1e-12)),
        )
        for tangent, way in ((t1, along_chord), (t2, -along_chord))
    )

    def total(values):
        return np.add.reduceat(values, head, axis=0)

    for attempt in range(3):
        b0, b1, b2, b3 = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
        rest = q - (b0 + b1)[:, None] * p0[span] - (b2 + b3)[:, None] * p3[span]
        c11, c22 = total(b1 * b1), total(b2 * b2)
        c12 = total(b1 * b2) * (t1 * t2).sum(axis=1)
        x1, x2 = (
            total(b1 * (rest * t1[span]).sum(axis=1)),
            total(b2 * (rest * t2[span]).sum(axis=1)),
        )
        det = c11 * c22 - c12 * c12
        solvable = (count > 2) & (det > 1e-9 * np.maximum(c11 * c22, 1e-12))
        safe = np.where(solvable, det, 1.0)
        h1, h2 = (x1 * c22 - x2 * c12) / safe, (c11 * x2 - c12 * x1) / safe
        # handles that point backwards or overtake each other make loops: then a third of the way
        solvable &= (h1 > 0.01 * chord) & (h2 > 0.01 * chord) & (h1 + h2 < 1.5 * length)
        h1, h2 = np.where(solvable, h1, third1), np.where(solvable, h2, third2)
        p1, p2 = p0 + h1[:, None] * t1, p3 + h2[:, None] * t2
        curve = (
            b0[:, None] * p0[span]
            + b1[:, None] * p1[span]
            + b2[:, None] * p2[span]
            + b3[:, None] * p3[span]
        )
        off = curve - q
        if attempt < 2:  # one Newton step towards the nearest parameter
            d1 = 3 * (
                ((1 - t) ** 2)[:, None] * (p1 - p0)[span]
                + (2 * t * (1 - t))[:, None] * (p2 - p1)[span]
                + (t * t)[:, None] * (p3 - p2)[span]
            )
            d2 = 6 * (
                (1 - t)[:, None] * (p2 - 2 * p1 + p0)[span] + t[:, None] * (p3 - 2 * p2 + p1)[span]
            )
            slope = (d1 * d1 + off * d2).sum(axis=1)
            move = (off * d1).sum(axis=1) / np.where(slope > 1e-12, slope, np.inf)
            t = np.clip(t - move, 0.0, 1.0)
            t[head], t[head + count - 1] = 0.0, 1.0
    error = np.round(
        np.hypot(off[:, 0], off[:, 1]), 9
    )  # so that ties fall alike whatever else is fitted beside
    # a curve that keeps to the points must keep to the polygon's edges between them too
    close = (np.maximum.reduceat(error, head) <= tolerance) & (count > 2)
    k = np.flatnonzero((span[1:] == span[:-1]) & close[span[1:]])
    s = span[k]
    w = (0.5 * (t[k] + t[k + 1]))[:, None]
    middle = (1 - w) ** 2 * ((1 - w) * p0[s] + 3 * w * p1[s]) + w * w * (
        3 * (1 - w) * p2[s] + w * p3[s]
    )
    between = np.round(_from_edges(middle, q[k], q[k + 1]), 9)
    error[k], error[k + 1] = np.maximum(error[k], between), np.maximum(error[k + 1], between)
    worst = np.maximum.reduceat(error, head)
    inner = np.where((row > begin[span]) & (row < end[span]), error, -1.0)
    top = np.maximum.reduceat(inner, head)
    pick = np.flatnonzero(inner == top[span])
    at = np.full(len(begin), 0)
    at[span[pick[::-1]]] = row[pick[::-1]]
    return np.stack([p0, p1, p2, p3], axis=1), worst, at


def _lean(tangent, chord):
    """The sine (n,) of the angle between unit vectors, 1 where it is beyond a right one."""
    sine = np.abs(tangent[:, 0] * chord[:, 1] - tangent[:, 1] * chord[:, 0])
    return np.where((tangent * chord).sum(axis=1) > 0, sine, 1.0)


def _from_edges(points, a, b):
    """Distance (n,) of points (n, 2) from the edges a..b."""
    d, off = b - a, points - a
    at = np.clip((off * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-18), 0.0, 1.0)
    off = off - at[:, None] * d
    return np.hypot(off[:, 0], off[:, 1])


Segment = tuple[
    float, float, float, float, float, float, float, float
]  # a cubic's four points, x and y in turn


def flatten(
    cubics: np.ndarray, offsets: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Chains of cubics (S, 4, 2), the i-th in rows offsets[i]:offsets[i+1], as polylines xy (N, 2) and their offsets.

    Chords keep within `tolerance` of the curve: n of them are off by at most max |B''| / 8 n^2.
    """
    bend = np.linalg.norm(cubics[:, :-2] - 2 * cubics[:, 1:-1] + cubics[:, 2:], axis=2).max(axis=1)
    wanted = np.maximum(np.ceil(np.sqrt(6 * bend / (8 * tolerance))), 1.0)
    if wanted.sum() > limits.MAX_POINTS:
        raise ValueError(
            f"its curves need more than {limits.MAX_POINTS} points on this canvas: simplify the drawing first"
        )
    count = wanted.astype(np.int64)
    which = np.repeat(np.arange(len(cubics)), count)
    before = np.cumsum(count) - count
    t = ((np.arange(len(which)) - before[which] + 1) / count[which])[:, None]
    s = 1 - t
    p = cubics[which]
    along = s**3 * p[:, 0] + 3 * s**2 * t * p[:, 1] + 3 * s * t**2 * p[:, 2] + t**3 * p[:, 3]
    new = np.r_[0, np.cumsum(count)][offsets] + np.arange(
        len(offsets)
    )  # every chain has its start besides
    xy = np.empty((new[-1], 2))
    start = np.zeros(len(xy), bool)
    start[new[:-1]] = True
    xy[start], xy[~start] = cubics[offsets[:-1], 0], along
    return xy, new
