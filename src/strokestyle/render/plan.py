"""From feature curves to the strokes a hand would draw them with: drawn through small gaps, lifted at corners.

A curve extractor breaks lines where visibility or a threshold says so; a draughtsman begins and ends strokes elsewhere,
and most habits along a stroke (tapering, swelling, running past the end) are tied to those ends. Strokes are laid in
the direction in which a right hand pulls, down and to the right, so that a stroke's beginning differs from its end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.curves import Curves, arc_length, resample

PULL = np.array([0.6, 1.0])  # the direction of easy strokes, x right, y down
HEADING_SPAN = 12.0  # px over which the heading of an end, or the turn at a corner, is measured
JOIN_ANGLE = 30.0  # degrees between the headings of two ends that one stroke may draw through


@dataclass(frozen=True)
class Planned:
    """Strokes that still lie on the curves, and where on the curves each of their points comes from.

    Parameters
    ----------
    xy : (N, 2) float64, pixels, evenly spaced
    offsets : (C+1,) int64
    kind : (C,) int8
    source : (N, 2) int64, two rows of the curves between which a point lies
    mix : (N,) float64, 0 at the first of the two rows, 1 at the second
    beyond : (N,) float64, pixels by which a point lies past the end of what it draws, 0 within
    """

    xy: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    source: np.ndarray
    mix: np.ndarray
    beyond: np.ndarray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def carry(self, values: np.ndarray) -> np.ndarray:
        """Values at the curves' points (M, k) -> at the strokes' points (N, k)."""
        a, b = values[self.source[:, 0]], values[self.source[:, 1]]
        return a + self.mix[:, None] * (b - a)


def plan_strokes(
    curves: Curves,
    spacing: float = 3.0,
    join: float = 10.0,
    corner: float = 65.0,
    extend: float = 0.0,
    shortest: float = 6.0,
) -> Planned:
    """Join, cut, direct and resample curves.

    Parameters
    ----------
    spacing : px between points
    join : px, ends nearer than this that head the same way are drawn through; 0 = never
    corner : degrees, a sharper turn within 12 px ends a stroke; 180 = never
    extend : px by which every stroke runs on past both ends, straight
    shortest : px, shorter strokes are left out
    """
    span = max(1, round(HEADING_SPAN / spacing))
    xy, offsets, (row,) = resample(
        curves.xy, curves.offsets, spacing, np.arange(len(curves.xy), dtype=np.float64)
    )
    table = np.concatenate(
        [xy, np.zeros((len(xy), 4))], axis=1
    )  # x, y, source, source, mix, beyond
    if len(table):
        table[:, 2] = np.floor(row + 1e-9)
        table[:, 3] = np.minimum(table[:, 2] + 1, len(curves.xy) - 1)
        table[:, 4] = np.maximum(row - table[:, 2], 0.0)
    strokes = [
        (table[a:b], kind)
        for a, b, kind in zip(offsets[:-1], offsets[1:], curves.kind, strict=True)
    ]
    if join > 0 and len(strokes) > 1:
        strokes = _join(strokes, join, span, spacing)
    if corner < 180:
        strokes = [
            (stroke[a : b + 1], kind)
            for stroke, kind in strokes
            for a, b in _between(corners(stroke[:, :2], corner, span), len(stroke) - 1)
        ]
    laid = []
    for stroke, kind in strokes:
        if arc_length(stroke[:, :2], np.array([0, len(stroke)]))[-1] < shortest:
            continue
        if (stroke[-1, :2] - stroke[0, :2]) @ PULL < 0:
            stroke = stroke[::-1]
        laid.append((_extend(stroke, extend, span, spacing) if extend > 0 else stroke, kind))
    table = np.concatenate([stroke for stroke, _ in laid]) if laid else np.zeros((0, 6))
    return Planned(
        table[:, :2],
        np.r_[0, np.cumsum([len(stroke) for stroke, _ in laid])].astype(np.int64),
        np.array([kind for _, kind in laid], np.int8),
        table[:, 2:4].astype(np.int64),
        table[:, 4],
        table[:, 5],
    )


def corners(xy: np.ndarray, degrees: float, span: int) -> np.ndarray:
    """Points of one polyline (n, 2) where it turns most, and by more than `degrees` in 2 `span` steps: indices."""
    if len(xy) < 2 * span + 1:
        return np.zeros(0, np.int64)
    before, after = xy[span:-span] - xy[: -2 * span], xy[2 * span :] - xy[span:-span]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn = np.degrees(np.abs(np.arctan2(cross, (before * after).sum(axis=1))))
    most = ndimage.maximum_filter1d(turn, 2 * span + 1)
    found = np.flatnonzero((turn > degrees) & (turn == most)) + span
    return found[np.r_[True, np.diff(found) > span]] if len(found) else found


def _between(cuts, last):
    marks = np.r_[0, cuts, last].astype(int)
    return [(a, b) for a, b in zip(marks[:-1], marks[1:], strict=True) if b > a]


def _heading(xy: np.ndarray, span: int) -> np.ndarray:
    """Unit direction in which a polyline (n, 2) leaves its last point."""
    d = xy[-1] - xy[-1 - min(span, len(xy) - 1)]
    return d / max(np.hypot(*d), 1e-9)


def _join(strokes, gap, span, spacing):
    """Draw through gaps between ends that head for each other, best agreement first; no stroke closes on itself."""
    count = len(strokes)
    ends = np.array(
        [end for s, _ in strokes for end in (s[0, :2], s[-1, :2])]
    )  # end e of stroke e // 2; odd = last
    heading = np.array(
        [h for s, _ in strokes for h in (_heading(s[::-1, :2], span), _heading(s[:, :2], span))]
    )
    pairs = cKDTree(ends).query_pairs(gap, output_type="ndarray")
    pairs = pairs[pairs[:, 0] // 2 != pairs[:, 1] // 2]
    a, b = pairs.T if len(pairs) else (np.zeros(0, int),) * 2
    distance = np.linalg.norm(ends[b] - ends[a], axis=1)
    angle = np.degrees(np.arccos(np.clip(-(heading[a] * heading[b]).sum(axis=1), -1, 1)))
    # across a wide gap the bridge itself must head the same way
    bridge = (ends[b] - ends[a]) / np.maximum(distance, 1e-9)[:, None]
    aside = np.degrees(np.arccos(np.clip((bridge * heading[a]).sum(axis=1), -1, 1)))
    good = (angle < JOIN_ANGLE) & ((distance < 1.5 * spacing) | (aside < 60.0))
    a, b, cost = a[good], b[good], (angle + 2 * distance)[good]
    partner, chain = {}, np.arange(count)
    for k in np.argsort(cost, kind="stable"):
        p, q = int(a[k]), int(b[k])
        if p in partner or q in partner or chain[p // 2] == chain[q // 2]:
            continue
        partner[p], partner[q] = q, p
        chain[chain == chain[q // 2]] = chain[p // 2]
    joined, done = [], set()
    for i in range(count):
        if i in done:
            continue
        end = 2 * i  # walk to the chain's beginning, then through it
        while end in partner:
            end = partner[end] ^ 1
        parts, lengths = [], {}
        while True:
            stroke, kind = strokes[end // 2]
            done.add(end // 2)
            stroke = stroke if end % 2 == 0 else stroke[::-1]
            if parts:
                parts.append(_bridge(parts[-1][-1], stroke[0], spacing))
                if np.hypot(*(stroke[0, :2] - parts[-2][-1, :2])) < 0.5 * spacing:
                    stroke = stroke[1:]
            parts.append(stroke)
            lengths[kind] = lengths.get(kind, 0) + len(stroke)
            end ^= 1
            if end not in partner:
                break
            end = partner[end]
        joined.append((np.concatenate(parts), max(lengths, key=lengths.get)))
    return joined


def _bridge(a, b, spacing):
    """Points between two rows of the table; each takes its values from the nearer side."""
    n = max(0, round(np.hypot(*(b[:2] - a[:2])) / spacing) - 1)
    t = (np.arange(n) + 1)[:, None] / (n + 1)
    rows = np.where(t < 0.5, a, b)
    rows[:, :2] = a[:2] + t * (b[:2] - a[:2])
    return rows


def _extend(stroke, extend, span, spacing):
    """Run both ends on, straight, by at most `extend` px."""
    steps = np.arange(1, int(extend / spacing) + 1)[:, None] * spacing
    out = [stroke]
    for side in (0, 1):
        xy = stroke[:, :2] if side else stroke[::-1, :2]
        rows = np.repeat(stroke[-1:] if side else stroke[:1], len(steps), axis=0)
        rows[:, :2] = xy[-1] + steps * _heading(xy, span)
        rows[:, 5:] = steps
        out.insert(len(out) if side else 0, rows if side else rows[::-1])
    return np.concatenate(out)
