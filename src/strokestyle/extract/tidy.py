"""From visible fragments of lines to the fewest, longest natural strokes.

Lengths are in pixels of a canvas 768 px on its longer side and grow with the canvas. A line is
*hard* where it must be drawn to understand the shape (contour, boundary, crease, intersection,
other) and *soft* where it describes the form between those (suggestive contour, ridge, valley,
apparent ridge).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.curves import KINDS, Curves, arc_length, owner, resample, runs, take_ragged
from ..geometry.kinds import KIND_TABLE

REFERENCE = 768.0  # px, the longer side of the canvas on which all lengths here are stated
STEP = 1.0  # px between points while at work, and in the result
HAIRPIN = 110.0  # degrees: a line that turns back on itself is two lines

# Merging; see `tidy`, step 2.
CHORD_REACH = 4  # points before and behind, over which a direction is measured
ABREAST = 1.5  # px along the better curve: farther on, a point lies ahead of a tip, not beside
MIN_HARD = 8.0  # px; shorter hard lines do not compete by their kind
FAR_ANGLE, SAME_FORM_ANGLE = 0.4, 0.7  # x merge_angle, beyond merge_soft px
MAX_HOLE, MAX_NICK, MIN_REMAIN = 3.0, 4.0, 6.0  # px; shorter gaps, cuts and remains are undone
MERGE_ROUNDS = 12

# Joining; see `tidy`, step 3. Lengths in px, angles in degrees.
MEETING = 4.0  # ends this near almost meet
MEETING_ANGLE = 1.2  # x angle, for those
TOUCHING, TOUCHING_BEND = 2.0, 60.0  # ends this near may bend by so much
CONTOUR_ANGLE = 1.4  # x angle, between contours
CORNER_BEND = 90.0  # of two free ends of contours
FREE = 3.0  # an end this far from all other curves is free
BEHIND = 0.5  # how far behind an end the other may lie and still count as ahead
ASIDE, CONTOUR_ASIDE = 1.5, 2.5  # beside the heading, before the angle tells
OVERLAP, OVERLAP_ASIDE = 6.0, 2.0  # how far two ends may run past each other, and how far apart
MIN_BRIDGE = 3.0  # what the shortest piece may bridge; shorter bridges cross nothing
MIN_RING = 4.0  # a curve closes where it is so many times as long as the gap
CROSSING = 0.8  # a bridge this near to a curve crosses it
COST_BEND, COST_ASIDE = 30.0, 4.0  # degrees, px that cost as much as a bridge of `gap` px
COST_KIND = 0.5  # for another kind, and again for soft to hard

# Dropping; see `tidy`, step 4. px
ATTACHED = 6.0  # an end this near to another line is attached
LOOSE = 2.5  # a short crease's end farther from any line is loose: the edges of a true solid meet
ONE_END = 1.4  # x attached, of a line with one end attached
CLUTTER_LENGTH, CLUTTER_RADIUS = 30.0, 24.0  # lines shorter than this count, this near

# Splitting; see `tidy`, step 5.
STEADY = 0.75  # x corner, over twice the reach
MIN_HOOKED, MAX_HOOK = 24.0, 8.0  # px, the curve and its hook
SMOOTH_ROUNDS, SMOOTH_ROUNDS_SOFT = 6, 24  # steps of the Gaussian

_SOFT = np.array([kind.soft for kind in KIND_TABLE])
_WEIGHT = np.array([kind.weight for kind in KIND_TABLE])
_CONTOUR, _CREASE = KINDS.index("contour"), KINDS.index("crease")
_SUGGESTIVE = KINDS.index("suggestive")


@dataclass(frozen=True)
class TidyOptions:
    """The numbers of `tidy`, whose steps say what they do.

    Parameters
    ----------
    merge, merge_soft, merge_contour, merge_suggestive : px on a 768 px canvas, how near to a better
        curve a part of another goes: in general, if it is soft, if it is soft and the better one a
        contour, and where one of the two is a suggestive contour
    merge_angle : degrees, how parallel it must be
    speck : px; everything shorter goes
    isolated, attached : px; hard lines shorter than that go, on their own, and with both ends at
        other lines
    soft : px of length x strength, which a soft line must have
    clutter : px of other short lines around it for which it must have as much once more
    long_crease : px; shorter creases compete as soft lines
    gap, contour_gap : px, the longest bridge, and that between contours
    angle : degrees by which an end may miss the other's heading
    corner : degrees; a stroke is split where it turns by more
    smooth, smooth_soft : px, how far smoothing may move a point, and one of a soft line

    Raises
    ------
    ValueError
        on a number that is negative or not finite.
    """

    merge: float = 2.5
    merge_soft: float = 4.0
    merge_contour: float = 7.0
    merge_suggestive: float = 12.0
    merge_angle: float = 25.0
    speck: float = 5.0
    isolated: float = 15.0
    attached: float = 8.0
    soft: float = 18.0
    clutter: float = 150.0
    long_crease: float = 30.0
    gap: float = 10.0
    contour_gap: float = 14.0
    angle: float = 30.0
    corner: float = 70.0
    smooth: float = 0.5
    smooth_soft: float = 1.5

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"tidy option {item.name} must be a number from 0 on, got {value}")


@dataclass(frozen=True)
class _Lines:
    """Polylines with a point every STEP px.

    Parameters
    ----------
    xy : (N, 2), px on a canvas of REFERENCE px
    strength : (N,) in 0..1
    source : (N,) int, the row of the given points that a point comes from, or the nearest to it
    offsets : (C+1,) int
    kind, closed : (C,)
    """

    xy: np.ndarray
    strength: np.ndarray
    source: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    closed: np.ndarray

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def first(self) -> np.ndarray:
        return self.offsets[:-1]

    @property
    def last(self) -> np.ndarray:
        return self.offsets[1:] - 1

    @cached_property
    def of(self) -> np.ndarray:
        """Tell which curve each point belongs to, (N,)."""
        return owner(self.offsets)

    @cached_property
    def length(self) -> np.ndarray:
        """Measure the arc length of each curve, (C,), px."""
        return arc_length(self.xy, self.offsets)[self.last]

    def mean_strength(self) -> np.ndarray:
        """Average the strength of each curve's points, (C,)."""
        if not len(self):
            return np.zeros(0)
        return np.add.reduceat(self.strength, self.first) / np.diff(self.offsets)

    def along(self) -> np.ndarray:
        """Count the points of its curve before each point, (N,)."""
        return np.arange(len(self.xy)) - self.first[self.of]

    def made_of(
        self, rows: np.ndarray, offsets: np.ndarray, kind: np.ndarray, closed: np.ndarray
    ) -> _Lines:
        """Make curves of the points at `rows` (M,)."""
        return _Lines(self.xy[rows], self.strength[rows], self.source[rows], offsets, kind, closed)

    def take(self, index: np.ndarray) -> _Lines:
        """Select the curves of an index or mask over C, in that order."""
        index = np.arange(len(self))[np.asarray(index)]
        rows, offsets = take_ragged(self.offsets, index)
        return self.made_of(rows, offsets, self.kind[index], self.closed[index])

    def stretches(self, keep: np.ndarray) -> _Lines:
        """Cut out the stretches of kept points (N,); closed curves open where cut.

        Single points are lost.
        """
        run, start, count, value = _runs(keep, self.offsets)
        good = value & (count >= 2)
        of = self.of[start]
        whole = count == np.diff(self.offsets)[of]
        offsets = np.r_[0, np.cumsum(count[good])]
        closed = (self.closed[of] & whole)[good]
        return self.made_of(np.flatnonzero(good[run]), offsets, self.kind[of[good]], closed)


def tidy(
    fragments: Curves,
    strength: np.ndarray,
    size: tuple[int, int] = (768, 768),
    options: TidyOptions | None = None,
) -> Curves:
    """Make the strokes that an illustrator would start from, of visible pieces of feature lines.

    1. **Cut** where a line turns back on itself (110 degrees within 6 px), as contours do at cusps.
    2. **Merged**: the part of a curve that runs beside a better one goes: within `merge` px and
       `merge_angle` degrees, if it is soft within `merge_soft` px, or beside a contour
       `merge_contour` px and 0.4 `merge_angle`; and since suggestive contours and lines of other
       kinds tell of the same form from two sides, of these two within `merge_suggestive` px and 0.7
       `merge_angle`. Better is, among hard lines of 8 px and more, the earlier kind in KINDS, then
       the longer; a hard line before a soft one; among soft ones the greater length x strength. A
       crease shorter than `long_crease` px is more often noise than form and competes as a soft
       line, with twice its length. Of what is left, stretches shorter than 6 px go too; what would
       go over less than 4 px stays. Lines that cross are not parallel, so they stay.
    3. **Joined**, before and after steps 2 and 4: ends at most 4 px apart at first, then `gap` px
       (`contour_gap` between contours), but not farther than the shorter piece is long. Both must
       head for each other within `angle` degrees (1.4 times that for contours), or overlap side by
       side by at most 6 px; ends within 2 px may bend by 60 degrees, and two free ends of contours
       by 90. Straightest and nearest pairs first, the same kind before others, never across a third
       hard line. A joined stroke has the kind of its longest part, of the hard ones where these
       make up a third of it. Ends of one curve that meet close it.
    4. **Dropped**: hard lines shorter than `isolated` px; 1.4 `attached` px with one end,
       `attached` px with both within 6 px of another line. Soft lines, and short creases with an
       end more than 2.5 px from any line, of less length x strength than `soft` px, and once more
       as much for every `clutter` px of other lines shorter than 30 px within 24 px: noise comes in
       swarms. Anything shorter than `speck` px.
    5. **Split** at corners of more than `corner` degrees within 6 px either side that are no
       zig-zag (0.75 times that over 12 px), 11 px or more from the ends and from each other. What
       turns as much within the last 8 px is a hook, and goes. A closed curve with no corner starts
       at its topmost point (the leftmost of these); one with corners starts and ends at one and is
       open.
    6. **Smoothed** along the stroke, by no more than `smooth` px, soft lines `smooth_soft` px; ends
       stay.

    Parameters
    ----------
    fragments : visible polylines, in pixels, points at any spacing
    strength : (N,) in 0..1, per point; only that of soft lines counts
    size : (width, height) of the canvas, pixels; all lengths grow with the longer side
    options : the numbers above

    Returns
    -------
    Curves with a point about every pixel, in KINDS order, the longest of a kind first

    Raises
    ------
    ValueError
        where `strength` does not fit the fragments, or the canvas has no size.
    """
    return tidy_with_source(fragments, strength, size, options)[0]


def tidy_with_source(
    fragments: Curves,
    strength: np.ndarray,
    size: tuple[int, int] = (768, 768),
    options: TidyOptions | None = None,
) -> tuple[Curves, np.ndarray]:
    """Tidy as `tidy` does, and say which given point each point (M,) of the result comes from.

    A point of a bridge comes from the end that is nearest, a smoothed one from where it was.
    """
    options = options or TidyOptions()
    strength = np.asarray(strength, np.float64)
    if strength.shape != (len(fragments.xy),) or not np.isfinite(strength).all():
        raise ValueError(
            f"strength must be {len(fragments.xy)} finite numbers, one per point, "
            f"got {strength.shape}"
        )
    if min(size) <= 0:
        raise ValueError(f"the canvas must have a size, got {size[0]} x {size[1]}")
    scale = max(size) / REFERENCE
    lines = _evenly(fragments, scale, strength)
    lines = _split(lines, HAIRPIN, reach=3, apart=2, steady=False)
    lines = _join(lines, options, near=True)
    lines = _merge(lines, options)
    lines = _join(lines, options, near=True)
    lines = _drop(lines, options)
    lines = _join(lines, options, near=False)
    lines = _merge(lines, options)
    lines = _drop(lines, options)
    lines = _join(lines, options, near=False)
    lines = _split(lines, options.corner, reach=6, apart=11, steady=True)
    lines = _trim_hooks(lines, options.corner)
    lines = _smooth(lines, options)
    order = np.lexsort((-lines.length, lines.kind))
    lines = lines.take(order)
    return Curves(lines.xy * scale, lines.offsets, lines.kind, lines.closed), lines.source


def subtract_parallel(
    curves: Curves, others: Curves, size: tuple[int, int] = (768, 768)
) -> tuple[Curves, np.ndarray]:
    """Take from curves the parts that run along one of `others`.

    That is within 2.5 px of it and 25 degrees of its direction. Gaps and remains of less than 6 px
    are closed and dropped. Lengths are those of a 768 px canvas.

    Returns
    -------
    what is left, and of each of its points (M,) the row of `curves` that it comes from
    """
    scale, options = max(size) / REFERENCE, TidyOptions()
    if not len(curves) or not len(others):
        return curves, np.arange(len(curves.xy))
    lines, drawn = (_evenly(c, scale, np.ones(len(c.xy))) for c in (curves, others))
    if len(lines) and len(drawn):
        distance, nearest = cKDTree(drawn.xy).query(lines.xy, distance_upper_bound=options.merge)
        near = distance < np.inf
        nearest = np.where(near, nearest, 0)
        cosine = np.abs(np.einsum("ij,ij->i", _chords(lines), _chords(drawn)[nearest]))
        covered = near & (cosine > np.cos(np.radians(options.merge_angle)))
        for value in (False, True):
            covered = _flip_short(covered, lines.offsets, value, MIN_REMAIN / STEP)
        lines = lines.stretches(~covered)
    return Curves(lines.xy * scale, lines.offsets, lines.kind, lines.closed), lines.source


def _even(
    xy: np.ndarray,
    strength: np.ndarray,
    source: np.ndarray,
    offsets: np.ndarray,
    kind: np.ndarray,
    closed: np.ndarray,
) -> _Lines:
    """Space points every STEP px; curves of no length are left out."""
    row = np.arange(len(xy), dtype=np.float64)
    xy, offsets, (strength, row) = resample(xy, offsets, STEP, strength, row)
    strength, source = np.clip(strength, 0.0, 1.0), source[np.rint(row).astype(np.int64)]
    lines = _Lines(xy, strength, source, offsets, np.asarray(kind), np.asarray(closed, bool))
    return lines.take(lines.length > 1e-6) if len(lines) else lines


def _evenly(curves: Curves, scale: float, strength: np.ndarray) -> _Lines:
    """Bring curves to a canvas of REFERENCE px; their points are their own source."""
    source = np.arange(len(curves.xy))
    xy = curves.xy / scale
    return _even(xy, strength, source, curves.offsets, curves.kind, curves.closed)


def _runs(
    flag: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Find stretches of equal `flag` (N,) that stay within one curve.

    Returns
    -------
    the run of each point (N,); start, count and flag of each run (R,)
    """
    bounds = np.union1d(runs(flag), offsets)
    start, count = bounds[:-1], np.diff(bounds)
    return np.repeat(np.arange(len(start)), count), start, count, flag[start]


def _flip_short(flag: np.ndarray, offsets: np.ndarray, value: bool, shorter: float) -> np.ndarray:
    """Flip runs of `value` that are shorter than `shorter` points and not a whole curve."""
    run, start, count, is_on = _runs(flag, offsets)
    whole = np.isin(start, offsets) & np.isin(start + count, offsets)
    turn = (is_on == value) & (count < shorter) & ~whole
    return flag ^ turn[run]


def _chords(lines: _Lines, reach: int = CHORD_REACH) -> np.ndarray:
    """Measure the direction (N, 2) from `reach` points before to `reach` behind, less at ends."""
    at = np.arange(len(lines.xy))
    of = lines.of
    d = (
        lines.xy[np.minimum(at + reach, lines.last[of])]
        - lines.xy[np.maximum(at - reach, lines.first[of])]
    )
    return d / np.maximum(np.linalg.norm(d, axis=1), 1e-9)[:, None]


# ------------------------------------------------------------------------------------------ merging


def _merge(lines: _Lines, options: TidyOptions) -> _Lines:
    """Take away the parts that run beside a better curve."""
    if len(lines) < 2:
        return lines
    soft = _SOFT[lines.kind] | _short_creases(lines, options)
    radius = max(options.merge, options.merge_soft, options.merge_contour, options.merge_suggestive)
    winner, loser = _rivals(lines, _ranks(lines, soft), radius)
    beside = _beside(lines, winner, loser, soft, options)
    return lines.stretches(~_beaten(lines, winner[beside], loser[beside]))


def _short_creases(lines: _Lines, options: TidyOptions) -> np.ndarray:
    """Tell which curves are creases too short to be trusted, (C,) bool."""
    return (lines.kind == _CREASE) & (lines.length < options.long_crease)


def _ranks(lines: _Lines, soft: np.ndarray) -> np.ndarray:
    """Rank the curves (C,), the best 0: long hard ones by kind, short hard ones, then soft ones."""
    length = lines.length
    score = length * np.where(soft, lines.mean_strength(), 1.0) * _WEIGHT[lines.kind]
    group = np.where(length >= MIN_HARD, lines.kind, len(KINDS))
    group = np.where(soft, len(KINDS) + 1, group)
    rank = np.empty(len(lines), np.int64)
    rank[np.lexsort((np.arange(len(lines)), -score, group))] = np.arange(len(lines))
    return rank


def _rivals(lines: _Lines, rank: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Pair points of different curves within `radius` px: rows of the better and of the worse."""
    of = lines.of
    every = np.flatnonzero(lines.along() % 2 == 0)  # every second point answers for the next
    pairs = every[cKDTree(lines.xy[every]).query_pairs(radius, output_type="ndarray")]
    pairs = pairs[of[pairs[:, 0]] != of[pairs[:, 1]]]
    swap = rank[of[pairs[:, 0]]] > rank[of[pairs[:, 1]]]
    winner, loser = np.where(swap[:, None], pairs[:, ::-1], pairs).T
    return winner, loser


def _beside(
    lines: _Lines, winner: np.ndarray, loser: np.ndarray, soft: np.ndarray, options: TidyOptions
) -> np.ndarray:
    """Tell of which pairs of points (P,) the loser runs beside the winner, (P,) bool.

    `soft` (C,) tells the curves that compete as soft ones.
    """
    of = lines.of
    direction = _chords(lines)
    cosine = np.abs(np.einsum("ij,ij->i", direction[winner], direction[loser]))
    between = lines.xy[winner] - lines.xy[loser]
    distance = np.linalg.norm(between, axis=1)
    abreast = np.abs(np.einsum("ij,ij->i", between, direction[winner])) < ABREAST * STEP
    winner, loser = of[winner], of[loser]
    contour, suggestive = lines.kind == _CONTOUR, lines.kind == _SUGGESTIVE
    same_form = (suggestive[winner] != suggestive[loser]) & ~contour[winner]
    limit = np.where(contour[winner], options.merge_contour, options.merge_soft)
    limit = np.where(same_form, np.maximum(limit, options.merge_suggestive), limit)
    near = distance <= np.where(soft[loser], limit, options.merge)
    narrow = np.where(same_form, SAME_FORM_ANGLE, FAR_ANGLE)
    angle = np.where(distance > options.merge_soft, narrow, 1.0) * options.merge_angle
    return near & abreast & (cosine > np.cos(np.radians(angle)))


def _beaten(lines: _Lines, winner: np.ndarray, loser: np.ndarray) -> np.ndarray:
    """Settle which points go, (N,) bool, where of each pair (P,) the loser yields to the winner.

    A part that is gone removes nothing itself, so that who loses depends on who lost before. Each
    round settles the curves one rank further down, and few curves compete in a row.
    """
    odd = lines.along()[1:] % 2 == 1
    gone = np.zeros(len(lines.xy), bool)
    for _ in range(MERGE_ROUNDS):
        before = gone
        gone = np.zeros(len(lines.xy), bool)
        gone[loser[~before[winner]]] = True
        gone[1:] |= gone[:-1] & odd
        for value, shorter in ((False, MAX_HOLE), (True, MAX_NICK), (False, MIN_REMAIN)):
            gone = _flip_short(gone, lines.offsets, value, shorter / STEP)
        if np.array_equal(gone, before):
            break
    return gone


# ------------------------------------------------------------------------------------------ joining


def _ends(lines: _Lines, reach: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Find both ends of every curve, start then end, (2C, 2), and their headings out, (2C, 2)."""
    count = np.diff(lines.offsets) - 1
    back = np.minimum(count, reach)
    tip = np.stack([lines.first, lines.last], axis=1).ravel()
    root = np.stack([lines.first + back, lines.last - back], axis=1).ravel()
    heading = lines.xy[tip] - lines.xy[root]
    return lines.xy[tip], heading / np.maximum(np.linalg.norm(heading, axis=1), 1e-9)[:, None]


class _EndPairs(NamedTuple):
    """Pairs of ends of curves that might be joined; end 2c is the start of curve c, 2c + 1 its end.

    Parameters
    ----------
    a, b : (P,) int, the ends
    gap : (P,) px from one to the other
    ahead_a, ahead_b : (P,) px, how far along the heading of each the other lies
    aside : (P,) px, how far beside the heading of either, the greater of both
    bend : (P,) degrees by which a joined curve would turn
    """

    a: np.ndarray
    b: np.ndarray
    gap: np.ndarray
    ahead_a: np.ndarray
    ahead_b: np.ndarray
    aside: np.ndarray
    bend: np.ndarray

    @property
    def curve_a(self) -> np.ndarray:
        return self.a // 2

    @property
    def curve_b(self) -> np.ndarray:
        return self.b // 2

    def both(self, flag: np.ndarray) -> np.ndarray:
        """Tell of which pairs both curves have a flag (C,), (P,) bool."""
        return flag[self.curve_a] & flag[self.curve_b]

    def take(self, index: np.ndarray) -> _EndPairs:
        """Select the pairs of a mask over P."""
        return _EndPairs(*(column[index] for column in self))


def _join(lines: _Lines, options: TidyOptions, near: bool) -> _Lines:
    """Join curves end to end. `near`: only ends that almost meet."""
    if lines.closed.all():
        return lines
    reach = MEETING if near else max(options.gap, options.contour_gap)
    pairs = _end_pairs(lines, reach)
    if not len(pairs.a):
        return lines
    good = _head_on(lines, pairs, options)
    good &= pairs.gap <= (MEETING if near else _longest_bridge(lines, pairs, options))
    good &= ~_too_short_to_close(lines, pairs)
    pairs = pairs.take(good)
    pairs = pairs.take(_clear(lines, pairs))
    return _link(lines, _mates(pairs, _cost(lines, pairs, options), 2 * len(lines)))


def _end_pairs(lines: _Lines, reach: float) -> _EndPairs:
    """Pair the ends of open curves within `reach` px, and measure how they lie to each other."""
    tip, heading = _ends(lines)
    ends = np.flatnonzero(~np.repeat(lines.closed, 2))
    a, b = ends[cKDTree(tip[ends]).query_pairs(reach, output_type="ndarray")].T
    bridge = tip[b] - tip[a]
    gap = np.linalg.norm(bridge, axis=1)
    ahead_a = np.einsum("ij,ij->i", bridge, heading[a])
    ahead_b = -np.einsum("ij,ij->i", bridge, heading[b])
    side_a = np.sqrt(np.maximum(gap**2 - ahead_a**2, 0.0))
    side_b = np.sqrt(np.maximum(gap**2 - ahead_b**2, 0.0))
    bend = np.degrees(np.arccos(np.clip(-np.einsum("ij,ij->i", heading[a], heading[b]), -1.0, 1.0)))
    return _EndPairs(a, b, gap, ahead_a, ahead_b, np.maximum(side_a, side_b), bend)


def _head_on(lines: _Lines, pairs: _EndPairs, options: TidyOptions) -> np.ndarray:
    """Tell which pairs of ends go on as one line, by their directions, (P,) bool."""
    gap, bend, aside = pairs.gap, pairs.bend, pairs.aside
    contours = pairs.both(lines.kind == _CONTOUR)
    angle = np.where(contours, CONTOUR_ANGLE, 1.0) * options.angle
    ahead = (pairs.ahead_a > -BEHIND) & (pairs.ahead_b > -BEHIND)
    nearer = np.minimum(np.abs(pairs.ahead_a), np.abs(pairs.ahead_b))
    width = np.where(contours, CONTOUR_ASIDE, ASIDE) + np.tan(np.radians(angle)) * nearer
    straight = ahead & (aside <= width)
    past = np.minimum(pairs.ahead_a, pairs.ahead_b)
    overlap = ~ahead & (past > -OVERLAP) & (aside < OVERLAP_ASIDE)
    slight = bend < angle * np.where(gap < MEETING, MEETING_ANGLE, 1.0)
    good = np.where(gap < TOUCHING, bend < TOUCHING_BEND, slight & (straight | overlap))
    free = ~_near_others(lines, FREE)
    corner = contours & free[pairs.a] & free[pairs.b] & (past > 0.0) & (bend < CORNER_BEND)
    return good | (corner & (gap <= options.gap))


def _longest_bridge(lines: _Lines, pairs: _EndPairs, options: TidyOptions) -> np.ndarray:
    """Bound the gap that each pair may bridge, (P,) px: a short piece no more than its length."""
    contours = pairs.both(lines.kind == _CONTOUR)
    limit = np.where(contours, options.contour_gap, options.gap)
    return np.minimum(limit, np.maximum(_shorter(lines, pairs), MIN_BRIDGE))


def _shorter(lines: _Lines, pairs: _EndPairs) -> np.ndarray:
    """Measure the shorter curve of each pair, (P,) px."""
    length = lines.length
    return np.minimum(length[pairs.curve_a], length[pairs.curve_b])


def _too_short_to_close(lines: _Lines, pairs: _EndPairs) -> np.ndarray:
    """Tell which pairs are both ends of one curve too short to be a ring, (P,) bool."""
    least = MIN_RING * np.maximum(pairs.gap, MIN_BRIDGE)
    return (pairs.curve_a == pairs.curve_b) & (_shorter(lines, pairs) <= least)


def _cost(lines: _Lines, pairs: _EndPairs, options: TidyOptions) -> np.ndarray:
    """Weigh how unlikely each pair of ends is one line, (P,)."""
    a, b = lines.kind[pairs.curve_a], lines.kind[pairs.curve_b]
    return (
        pairs.gap / options.gap
        + pairs.bend / COST_BEND
        + pairs.aside / COST_ASIDE
        + COST_KIND * (a != b)
        + COST_KIND * (_SOFT[a] != _SOFT[b])
    )


def _mates(pairs: _EndPairs, cost: np.ndarray, count: int) -> np.ndarray:
    """Choose the end that each of `count` ends is joined to, cheapest first; -1 for none."""
    mate = np.full(count, -1)
    for i in np.lexsort((pairs.b, pairs.a, cost)):
        a, b = pairs.a[i], pairs.b[i]
        if mate[a] < 0 and mate[b] < 0:
            mate[a], mate[b] = b, a
    return mate


def _clear(lines: _Lines, pairs: _EndPairs) -> np.ndarray:
    """Tell which bridges cross no third hard curve, (P,) bool; short ones never do."""
    hard = ~_SOFT[lines.kind][lines.of]
    clear = np.ones(len(pairs.a), bool)
    long = np.flatnonzero(pairs.gap >= MIN_BRIDGE)
    if not len(long) or not hard.any():
        return clear
    tip, _ = _ends(lines)
    start, stop = tip[pairs.a[long]], tip[pairs.b[long]]
    tree, of = cKDTree(lines.xy[hard]), lines.of[hard]
    t = np.linspace(0.0, 1.0, 14)[1:-1]
    probe = start[:, None] + t[:, None] * (stop - start)[:, None]
    _, nearest = tree.query(probe.reshape(-1, 2), k=1, distance_upper_bound=CROSSING)
    found = nearest < len(of)
    other = np.where(found, of[np.minimum(nearest, len(of) - 1)], -1).reshape(len(long), -1)
    own = (other == pairs.curve_a[long, None]) | (other == pairs.curve_b[long, None])
    clear[long] = ~((other >= 0) & ~own).any(axis=1)
    return clear


def _link(lines: _Lines, mate: np.ndarray) -> _Lines:
    """Join chains of curves whose ends are paired; each is resampled as one curve.

    `mate` (2C,) is the end that each end is joined to, -1 for none.
    """
    linked = (mate[::2] >= 0) | (mate[1::2] >= 0)
    if not linked.any():
        return lines
    single, length = lines.take(~linked), lines.length
    rows, kind, closed = [], list(single.kind), list(single.closed)
    for ends, ring in _chains(mate, linked):
        parts = [np.arange(lines.offsets[e // 2], lines.offsets[e // 2 + 1]) for e in ends]
        parts = [part[::-1] if e % 2 else part for part, e in zip(parts, ends, strict=True)]
        joined = np.concatenate(_trimmed(lines.xy, parts, ring)) if len(parts) > 1 else parts[0]
        rows.append(np.r_[joined, joined[0]] if ring else joined)
        curves = np.array(ends) // 2
        kind.append(_joined_kind(lines.kind[curves], length[curves]))
        closed.append(ring)
    offsets = np.r_[single.offsets, single.offsets[-1] + np.cumsum([len(row) for row in rows])]
    row = np.concatenate(rows)
    return _even(
        np.concatenate([single.xy, lines.xy[row]]),
        np.concatenate([single.strength, lines.strength[row]]),
        np.concatenate([single.source, lines.source[row]]),
        offsets,
        np.array(kind),
        np.array(closed),
    )


def _chains(mate: np.ndarray, linked: np.ndarray) -> Iterator[tuple[list[int], bool]]:
    """Follow ends from mate to mate; yield the ends where curves are entered, and if it is a ring.

    Open chains begin at an end that has no mate, then rings anywhere.
    """
    used = np.zeros(len(linked), bool)
    starts = np.repeat(2 * np.flatnonzero(linked), 2)
    starts[1::2] += 1
    for start in (*starts[mate[starts] < 0], *starts[::2]):
        ends, end = [], int(start)
        if used[end // 2]:
            continue
        while end >= 0 and not used[end // 2]:
            used[end // 2] = True
            ends.append(end)
            end = int(mate[end ^ 1])
        yield ends, end >= 0


def _joined_kind(kind: np.ndarray, length: np.ndarray) -> int:
    """Choose the kind with the most length, of the hard ones where these make up a third of it."""
    weight = np.bincount(kind, length, len(KINDS))
    hard = np.where(_SOFT, 0.0, weight)
    return int((hard if 3.0 * hard.sum() > weight.sum() else weight).argmax())


def _trimmed(xy: np.ndarray, parts: list[np.ndarray], ring: bool) -> list[np.ndarray]:
    """Trim successive parts, rows each, of points at their start that lie behind the one before."""
    out = list(parts)
    for i in range(0 if ring else 1, len(out)):
        before, part = out[i - 1], out[i]
        if len(part) < 4:
            continue
        tip, head = xy[before[-1]], xy[before[-1]] - xy[before[max(len(before) - 6, 0)]]
        behind = (xy[part[:8]] - tip) @ head <= 0.3 * np.linalg.norm(head)
        skip = int(behind.argmin()) if not behind.all() else 0
        out[i] = part[min(skip, len(part) - 2) :]
    return out


# ----------------------------------------------------------------------------------------- dropping


def _drop(lines: _Lines, options: TidyOptions) -> _Lines:
    """Drop specks and noise."""
    if not len(lines):
        return lines
    length = lines.length
    attached = _near_others(lines, ATTACHED).reshape(-1, 2).sum(axis=1) * ~lines.closed
    crease = _short_creases(lines, options)
    loose = crease & ~_near_others(lines, LOOSE).reshape(-1, 2).all(axis=1)
    soft = _SOFT[lines.kind] | loose
    noise = (length < CLUTTER_LENGTH) & (_SOFT[lines.kind] | crease)
    need = options.soft * (1.0 + _clutter(lines, noise, soft) / max(options.clutter, 1e-9))
    least = np.array([options.isolated, options.attached * ONE_END, options.attached])[attached]
    enough = np.where(soft, length * lines.mean_strength() >= need, length >= least)
    return lines.take(enough & (length >= options.speck))


def _clutter(lines: _Lines, short: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Measure the length of other `short` lines around each `asked` line, (C,) px.

    That is the length within CLUTTER_RADIUS of a point of the line, on average over its points.
    `short` and `asked` are (C,) bool.
    """
    of = lines.of
    rows, probe = np.flatnonzero(short[of]), np.flatnonzero(asked[of])[::3]
    if not len(rows) or not len(probe):
        return np.zeros(len(lines))
    tree = cKDTree(lines.xy[rows])
    count = tree.query_ball_point(lines.xy[probe], CLUTTER_RADIUS, return_length=True) * STEP
    hits = np.bincount(of[probe], minlength=len(lines))
    mean = np.bincount(of[probe], count, len(lines)) / np.maximum(hits, 1)
    own = np.where(short, np.minimum(lines.length, CLUTTER_RADIUS), 0.0)
    return np.maximum(mean - own, 0.0)


def _near_others(lines: _Lines, radius: float) -> np.ndarray:
    """Tell which ends, start then end of every curve, lie within `radius` px of another, (2C,)."""
    tip, _ = _ends(lines)
    tree, of = cKDTree(lines.xy), lines.of
    # a curve has hardly more than 2 radius points of its own so near to its tip; the next nearest
    # are others
    k = min(int(2.0 * radius / STEP) + 4, len(lines.xy))
    distance, nearest = tree.query(tip, k=k, distance_upper_bound=radius)
    distance, nearest = distance.reshape(len(tip), -1), nearest.reshape(len(tip), -1)
    other = of[np.minimum(nearest, len(of) - 1)] != (np.arange(len(tip)) // 2)[:, None]
    return ((distance < np.inf) & other).any(axis=1)


# ----------------------------------------------------------------------------- splitting, smoothing


def _split(lines: _Lines, corner: float, reach: int, apart: int, steady: bool) -> _Lines:
    """Cut curves at corners of more than `corner` degrees within `reach` points either side.

    Corners are at least `apart` points from each other and from the ends. `steady`: not where the
    stroke turns back soon after. Closed curves without a corner start at their topmost point, the
    leftmost of them; others are cut at the corners.
    """
    if not len(lines):
        return lines
    turn = _turns(lines, reach)
    if steady:
        turn = np.where(_turns(lines, 2 * reach) > STEADY * corner, turn, 0.0)
    cut = _corners(lines, turn, corner, apart)
    order = _restart_rings(lines, cut)
    cut = cut[order]
    opened = lines.closed & cut[lines.first]
    cut[lines.first] = cut[lines.last] = False
    rows = np.repeat(np.arange(len(order)), 1 + cut)  # a corner belongs to both strokes
    starts = np.flatnonzero(np.r_[True, rows[1:] == rows[:-1]] | np.isin(rows, lines.first))
    parent = lines.of[rows[starts]]
    closed = (lines.closed & ~opened)[parent]
    return lines.made_of(order[rows], np.r_[starts, len(rows)], lines.kind[parent], closed)


def _corners(lines: _Lines, turn: np.ndarray, corner: float, apart: int) -> np.ndarray:
    """Choose the points where curves turn most, (N,) bool, `apart` points from each other and ends.

    `turn` (N,) is the angle at each point, degrees; those of more than `corner` count.
    """
    of, along = lines.of, lines.along()
    count = np.diff(lines.offsets)[of] - 1
    near_end = np.minimum(along, count - along) < apart
    turn = np.where(near_end & ~lines.closed[of], 0.0, turn)
    turn[lines.last[lines.closed]] = 0.0  # the same point as the first
    cut = np.zeros(len(lines.xy), bool)
    sharp = np.flatnonzero(turn > corner)
    for i in sharp[np.lexsort((sharp, -turn[sharp]))]:  # the sharpest of each corner's points
        if lines.closed[of[i]]:
            around = np.arange(along[i] - apart + 1, along[i] + apart) % count[i]
            cut[i] = not cut[lines.first[of[i]] + around].any()
        else:
            cut[i] = not cut[max(i - apart + 1, 0) : i + apart].any()
    return cut


def _restart_rings(lines: _Lines, cut: np.ndarray) -> np.ndarray:
    """Order the rows (N,) so that closed curves start at a corner, or else at their topmost point.

    `cut` (N,) bool tells the corners.
    """
    order = np.arange(len(lines.xy))
    for c in np.flatnonzero(lines.closed):
        rows = np.arange(lines.offsets[c], lines.offsets[c + 1] - 1)
        corners = np.flatnonzero(cut[rows])
        x, y = lines.xy[rows].T
        start = corners[0] if len(corners) else np.lexsort((x, y))[0]
        rows = np.roll(rows, -start)
        order[lines.offsets[c] : lines.offsets[c + 1]] = np.r_[rows, rows[0]]
    return order


def _trim_hooks(lines: _Lines, corner: float) -> _Lines:
    """Trim the last bit of open curves where it turns by more than `corner` degrees.

    That is up to MAX_HOOK px, of curves of MIN_HOOKED px and more.
    """
    count = np.diff(lines.offsets)
    long = np.flatnonzero(~lines.closed & (count >= MIN_HOOKED / STEP))
    keep = np.ones(len(lines.xy), bool)
    for tip, inward in ((lines.first[long], 1), (lines.last[long], -1)):
        cut = _hook_lengths(lines.xy, tip, inward, corner)
        for k in range(int(cut.max(initial=0))):
            keep[tip[cut > k] + inward * k] = False
    return lines if keep.all() else lines.stretches(keep)


def _hook_lengths(xy: np.ndarray, tip: np.ndarray, inward: int, corner: float) -> np.ndarray:
    """Count the points of the hook at each tip (T,): up to its sharpest turn, 0 for no hook.

    `inward` is the step from row to row away from the tips: 1 or -1.
    """
    sharpest, cut = np.full(len(tip), corner), np.zeros(len(tip), np.int64)
    for k in range(2, int(MAX_HOOK / STEP) + 1):
        at = tip + inward * k
        turn = _angle(xy[at] - xy[at + inward * 6], xy[tip] - xy[at])
        cut, sharpest = np.where(turn > sharpest, k, cut), np.maximum(turn, sharpest)
    return cut


def _angle(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Measure the angle between vectors (N, 2), degrees, (N,)."""
    cross, dot = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.einsum("ij,ij->i", u, v)
    return np.degrees(np.abs(np.arctan2(cross, dot)))


def _turns(lines: _Lines, reach: int) -> np.ndarray:
    """Measure the angle between the chords to `reach` points before and after each point, (N,).

    In degrees, 0 where there are no such points.
    """
    of = lines.of
    first, last, at = lines.first[of], lines.last[of], np.arange(len(lines.xy))
    before, after = np.maximum(at - reach, first), np.minimum(at + reach, last)
    ring = np.flatnonzero(lines.closed[of])
    size = np.maximum(last - first, 1)[ring]
    before[ring] = first[ring] + (at[ring] - first[ring] - reach) % size
    after[ring] = first[ring] + (at[ring] - first[ring] + reach) % size
    return _angle(lines.xy - lines.xy[before], lines.xy[after] - lines.xy)


def _smooth(lines: _Lines, options: TidyOptions) -> _Lines:
    """Average mesh zig-zag away along curves by a Gaussian; moves are limited, ends stay."""
    if not len(lines):
        return lines
    soft = _SOFT[lines.kind][lines.of]
    before, after, fixed = _neighbours(lines)
    xy = lines.xy
    for i in range(SMOOTH_ROUNDS_SOFT):
        moves = ~fixed & (soft | (i < SMOOTH_ROUNDS))
        xy = np.where(moves[:, None], 0.5 * xy + 0.25 * (xy[before] + xy[after]), xy)
    limit = np.where(soft, options.smooth_soft, options.smooth)
    shift = xy - lines.xy
    size = np.linalg.norm(shift, axis=1)
    shift *= np.minimum(1.0, limit / np.maximum(size, 1e-9))[:, None]
    return replace(lines, xy=lines.xy + shift)


def _neighbours(lines: _Lines) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the rows before and after each point, round closed curves; and which are open ends."""
    rows, ring = np.arange(len(lines.xy)), lines.closed
    before, after, fixed = rows - 1, rows + 1, np.zeros(len(rows), bool)
    fixed[lines.first[~ring]] = fixed[lines.last[~ring]] = True
    before[lines.first], after[lines.last] = lines.first, lines.last
    before[lines.first[ring]], after[lines.last[ring]] = lines.last[ring] - 1, lines.first[ring] + 1
    return before, after, fixed
