"""From feature curves to strokes: joined across small gaps, cut at corners, given a direction.

A curve extractor breaks lines where visibility or a threshold says so; a draughtsman begins and
ends strokes elsewhere, and most habits along a stroke (tapering, swelling, running past the end)
are tied to those ends. Strokes are laid in the direction in which a right hand pulls, down and to
the right, so that a stroke's beginning differs from its end.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..geometry.curves import Curves, arc, blurred, resample, simplify
from ..geometry.near import near_pairs

PULL = np.array([0.6, 1.0])  # the direction of easy strokes, x right, y down
HEADING_SPAN = 12.0  # px over which the heading of an end, or the turn at a corner, is measured
JOIN_ANGLE = 30.0  # degrees between the headings of two ends that one stroke may draw through
BRIDGE_ANGLE = 60.0  # degrees between a bridge across a wide gap and the heading of its end
WIDE_GAP = 1.5  # of the spacing: across a narrower gap a bridge has no direction worth asking for
CUT_SIGMA = 4.0  # px, Gaussian before a curve is cut straight, so that its noise is not followed
GAP_COST = 2.0  # degrees that a px of gap counts as, where several ends compete


@dataclass(frozen=True)
class Planned:
    """Strokes that still lie on the curves, and where on the curves their points come from.

    Parameters
    ----------
    xy : (N, 2) float64, px, evenly spaced
    offsets : (C+1,) int64, stroke i is rows offsets[i]:offsets[i+1]
    kind : (C,) int8, index into KINDS
    source : (N, 2) int64, two rows of the curves between which a point lies
    mix : (N,) float64, 0 at the first of the two rows, 1 at the second
    overshoot : (N,) float64, px by which a point lies past the end of its curve, 0 on it
    lifted : whether the pen is set down and lifted where the strokes begin and end; otherwise they
        hold all the points to which they may run on, and their curves' ends are taken for theirs
    """

    xy: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    source: np.ndarray
    mix: np.ndarray
    overshoot: np.ndarray
    lifted: bool = False

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def on_curve(self) -> np.ndarray:
        """(N,) bool, False where a point lies past the end of its curve."""
        return self.overshoot == 0

    def carry(self, values: np.ndarray) -> np.ndarray:
        """Interpolate values at the curves' points (M, k) at the strokes' points, (N, k)."""
        a, b = values[self.source[:, 0]], values[self.source[:, 1]]
        return a + self.mix[:, None] * (b - a)


class _Path(NamedTuple):
    """One stroke on its way: points (n, 2), px, and their places (n,) in the rows of the curves.

    A place is a fraction where a point lies between two rows.
    """

    xy: np.ndarray
    place: np.ndarray
    kind: int

    def part(self, rows: slice) -> _Path:
        return _Path(self.xy[rows], self.place[rows], self.kind)

    def turned(self) -> _Path:
        return self.part(slice(None, None, -1))


def plan_strokes(
    curves: Curves,
    spacing: float = 3.0,
    join_gap: float = 10.0,
    corner_angle: float = 65.0,
    max_overshoot: float = 0.0,
    min_length: float = 6.0,
    cut_tolerance: float = 0.0,
) -> Planned:
    """Join, cut, direct and resample curves.

    Parameters
    ----------
    curves : in px
    spacing : px between points
    join_gap : px, ends nearer than this that head the same way are drawn through; 0 = never
    corner_angle : degrees, a sharper turn within 12 px to either side ends a stroke; 180 = never
    max_overshoot : px by which every stroke runs on past both ends, straight
    min_length : px, shorter strokes are left out
    cut_tolerance : px, strokes also end at the corners of the polyline that stays within this of
        the curve (Ramer-Douglas-Peucker), each straight piece a stroke; 0 = never
    """
    span = max(1, round(HEADING_SPAN / spacing))
    paths = _evenly(curves, spacing)
    if join_gap > 0 and len(paths) > 1:
        paths = _join(paths, join_gap, span, spacing)
    if corner_angle < 180:
        paths = [piece for path in paths for piece in _cut_at_corners(path, corner_angle, span)]
    if cut_tolerance > 0:
        sigma = CUT_SIGMA / spacing
        paths = [piece for path in paths for piece in _cut_straight(path, cut_tolerance, sigma)]
    paths = [_pulled(path) for path in paths if arc(path.xy)[-1] >= min_length]
    steps = np.arange(1, int(max_overshoot / spacing) + 1) * spacing
    return _planned([_overshot(path, steps, span) for path in paths], steps, len(curves.xy))


def _evenly(curves: Curves, spacing: float) -> list[_Path]:
    """Every curve in evenly spaced points."""
    row = np.arange(len(curves.xy), dtype=np.float64)
    xy, offsets, (place,) = resample(curves.xy, curves.offsets, spacing, row)
    return [
        _Path(xy[a:b], place[a:b], kind)
        for a, b, kind in zip(offsets[:-1], offsets[1:], curves.kind, strict=True)
    ]


def _planned(paths: list[_Path], steps: np.ndarray, rows: int) -> Planned:
    """Put together paths that run on at both ends by `steps` px (k,); the curves have `rows`."""
    counts = [len(path.xy) for path in paths]
    xy = np.concatenate([path.xy for path in paths]) if paths else np.zeros((0, 2))
    place = np.concatenate([path.place for path in paths]) if paths else np.zeros(0)
    past = [np.r_[steps[::-1], np.zeros(n - 2 * len(steps)), steps] for n in counts]
    row = np.floor(
        place + 1e-9
    )  # a place may lie a rounding error below the row that it stands for
    following = np.minimum(row + 1, rows - 1)
    return Planned(
        xy,
        np.r_[0, np.cumsum(counts)].astype(np.int64),
        np.array([path.kind for path in paths], np.int8),
        np.stack([row, following], axis=1).astype(np.int64),
        np.maximum(place - row, 0.0),
        np.concatenate(past) if past else np.zeros(0),
    )


# ------------------------------------------------------------------------------------------ corners


def corners(xy: np.ndarray, degrees: float, span: int) -> np.ndarray:
    """Find the points of a polyline (n, 2) where it turns most, and by more than `degrees`.

    A turn is the angle between the steps from `span` points before and to `span` points after.
    Returns their indices in order; two of them are more than `span` points apart.
    """
    if len(xy) < 2 * span + 1:
        return np.zeros(0, np.int64)
    turn = turns(xy, span)[span:-span]
    padded = np.pad(turn, span, constant_values=-np.inf)
    sharpest = sliding_window_view(padded, 2 * span + 1).max(axis=1)
    found = np.flatnonzero((turn > degrees) & (turn == sharpest)) + span
    return found[np.r_[True, np.diff(found) > span]] if len(found) else found


def turns(xy: np.ndarray, span: int) -> np.ndarray:
    """Degrees (n,) that a polyline (n, 2) turns from `span` points before to after; 0 at ends."""
    before, after = xy[span:-span] - xy[: -2 * span], xy[2 * span :] - xy[span:-span]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn = np.degrees(np.abs(np.arctan2(cross, (before * after).sum(axis=1))))
    return np.pad(turn, (span, len(xy) - span - len(turn)))


def _cut_at_corners(path: _Path, degrees: float, span: int) -> list[_Path]:
    """Cut a path in pieces, which share the corners between them."""
    return _cut(path, np.r_[0, corners(path.xy, degrees, span), len(path.xy) - 1].astype(int))


def _cut_straight(path: _Path, tolerance: float, sigma: float) -> list[_Path]:
    """Cut a path in pieces that chords come within `tolerance` px of; `sigma` is in points."""
    return _cut(path, simplify(blurred(path.xy, sigma), tolerance))


def _cut(path: _Path, marks: np.ndarray) -> list[_Path]:
    return [path.part(slice(a, b + 1)) for a, b in zip(marks[:-1], marks[1:], strict=True) if b > a]


# ------------------------------------------------------------------------------- direction and ends


def _pulled(path: _Path) -> _Path:
    """The path in the direction in which it is easily drawn."""
    return path.turned() if (path.xy[-1] - path.xy[0]) @ PULL < 0 else path


def heading(xy: np.ndarray, span: int) -> np.ndarray:
    """Unit direction (2,) in which a polyline (n, 2) leaves its last point, over `span` steps."""
    d = xy[-1] - xy[-1 - min(span, len(xy) - 1)]
    return d / max(np.hypot(*d), 1e-9)


def _overshot(path: _Path, steps: np.ndarray, span: int) -> _Path:
    """Run both ends on, straight, in points `steps` px (k,) away from them."""
    before = path.xy[0] + steps[::-1, None] * heading(path.xy[::-1], span)
    after = path.xy[-1] + steps[:, None] * heading(path.xy, span)
    place = np.pad(path.place, len(steps), mode="edge")
    return _Path(np.concatenate([before, path.xy, after]), place, path.kind)


def lift(planned: Planned, past: np.ndarray, spacing: float) -> tuple[Planned, np.ndarray]:
    """Let strokes begin and end where the pen is set down and lifted.

    Parameters
    ----------
    planned : C strokes that run on past the ends of their curves, as far as they may
    past : (C, 2) px from the ends of their curves to where they begin and end; below 0 where the
        pen is lifted short of them
    spacing : px between points

    Returns the strokes, and the rows (n,) of `planned` that they keep; their first and last points
    are moved to where they begin and end.
    """
    kept, moved, beyond = [], [], []
    for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
        xy, inner = planned.xy[a:b], np.flatnonzero(planned.on_curve[a:b])
        along = arc(xy)
        begin, end = along[inner[0]], along[inner[-1]]
        at = np.clip([begin - past[i, 0], end + past[i, 1]], along[0], along[-1])
        first, last = (int(np.abs(along - s).argmin()) for s in at)
        rows = np.arange(first, max(last, first + 1) + 1) if first + 1 < b - a else inner[-2:]
        line, over = xy[rows], planned.overshoot[a:b][rows]
        for k, s in ((0, at[0]), (-1, at[1])):
            line[k] = [np.interp(s, along, xy[:, axis]) for axis in (0, 1)]
            over[k] = max(begin - s, s - end, 0.0)
        kept.append(rows + a)
        moved.append(line)
        beyond.append(over)
    if not kept:
        return replace(planned, lifted=True), np.zeros(0, np.int64)
    rows = np.concatenate(kept)
    offsets = np.r_[0, np.cumsum([len(part) for part in kept])]
    strokes = Planned(
        np.concatenate(moved), offsets, planned.kind, planned.source[rows], planned.mix[rows],
        np.concatenate(beyond), lifted=True,
    )  # fmt: skip
    return strokes, rows


# --------------------------------------------------------------------------------------------- join


def _join(paths: list[_Path], gap: float, span: int, spacing: float) -> list[_Path]:
    """Draw through gaps between ends that head for each other; no path closes on itself.

    Ends are numbered: 2 i is the first point of path i, 2 i + 1 its last.
    """
    partner = _match(_rival_pairs(paths, gap, span, spacing), len(paths))
    return [_connected(chain, paths, spacing) for chain in _chains(partner, len(paths))]


def _rival_pairs(paths: list[_Path], gap: float, span: int, spacing: float) -> np.ndarray:
    """Pairs of ends (K, 2) that may be drawn through, those that agree best first."""
    sides = [side for path in paths for side in (path.xy[::-1], path.xy)]
    at = np.array([xy[-1] for xy in sides])
    towards = np.array([heading(xy, span) for xy in sides])
    pairs = near_pairs(at, gap)
    a, b = pairs.T
    distance = np.linalg.norm(at[b] - at[a], axis=1)
    angle = _degrees(-(towards[a] * towards[b]).sum(axis=1))
    # across a wide gap the bridge itself must head the same way
    bridge = (at[b] - at[a]) / np.maximum(distance, 1e-9)[:, None]
    aside = _degrees((bridge * towards[a]).sum(axis=1))
    good = (angle < JOIN_ANGLE) & ((distance < WIDE_GAP * spacing) | (aside < BRIDGE_ANGLE))
    cost = (angle + GAP_COST * distance)[good]
    return np.stack([a[good], b[good]], axis=1)[np.argsort(cost, kind="stable")]


def _degrees(cosine: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def _match(pairs: np.ndarray, count: int) -> dict[int, int]:
    """Give each end one partner at most, first come first served, so that no ring closes."""
    partner: dict[int, int] = {}
    chain = np.arange(count)
    for a, b in pairs.tolist():
        if a in partner or b in partner or chain[a // 2] == chain[b // 2]:
            continue
        partner[a], partner[b] = b, a
        chain[chain == chain[b // 2]] = chain[a // 2]
    return partner


def _chains(partner: dict[int, int], count: int) -> list[list[int]]:
    """The ends by which the paths of each chain are entered, one after the other."""
    chains: list[list[int]] = []
    done: set[int] = set()
    for i in range(count):
        if i in done:
            continue
        end = 2 * i
        while end in partner:  # to the beginning of the chain
            end = _other_end(partner[end])
        chain = [end]
        while _other_end(end) in partner:
            end = partner[_other_end(end)]
            chain.append(end)
        done.update(end // 2 for end in chain)
        chains.append(chain)
    return chains


def _other_end(end: int) -> int:
    return end ^ 1


def _connected(chain: list[int], paths: list[_Path], spacing: float) -> _Path:
    """Join the paths of a chain with bridges; the kind is that of most of its points."""
    pieces: list[_Path] = []
    points: Counter[int] = Counter()
    for end in chain:
        path = paths[end // 2] if end % 2 == 0 else paths[end // 2].turned()
        if pieces:
            last = pieces[-1]
            pieces.append(_bridge(last, path, spacing))
            if np.hypot(*(path.xy[0] - last.xy[-1])) < 0.5 * spacing:
                path = path.part(slice(1, None))
        pieces.append(path)
        points[path.kind] += len(path.xy)
    return _Path(
        np.concatenate([piece.xy for piece in pieces]),
        np.concatenate([piece.place for piece in pieces]),
        points.most_common(1)[0][0],
    )


def _bridge(before: _Path, after: _Path, spacing: float) -> _Path:
    """Points on the straight line from the end of one path to the beginning of the next.

    Each has the place of the nearer of the two.
    """
    a, b = before.xy[-1], after.xy[0]
    n = max(0, round(np.hypot(*(b - a)) / spacing) - 1)
    t = (np.arange(n) + 1)[:, None] / (n + 1)
    place = np.where(t[:, 0] < 0.5, before.place[-1], after.place[0])
    return _Path(a + t * (b - a), place, before.kind)
