"""Join lines: those whose ends head for each other become one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.curves import KINDS, counting
from ..geometry.near import nearest_points
from .tidy_lines import CONTOUR, SOFT, Lines, Numbers, ends_of, even, near_others

# Lengths in px, angles in degrees.
MAX_NEAR = 24  # ends around an end that it may be joined to: the nearest
HEADING = 6  # points over which an end's heading is measured
MEETING = 4.0  # ends this near almost meet
MEETING_ANGLE = 1.2  # x angle, for those
TOUCHING, TOUCHING_BEND = 2.0, 60.0  # ends this near may bend by so much
CONTOUR_ANGLE = 1.4  # x angle, between contours
CORNER_BEND = 90.0  # of two free ends of contours
FREE = 3.0  # an end this far from all other curves is free
MIN_TRIMMED, BEHIND_TIP = 4, 0.3  # points of a part that is trimmed; of those up to here, px
BEHIND = 0.5  # how far behind an end the other may lie and still count as ahead
ASIDE, CONTOUR_ASIDE = 1.5, 2.5  # beside the heading, before the angle tells
OVERLAP, OVERLAP_ASIDE = 6.0, 2.0  # how far two ends may run past each other, and how far apart
MIN_BRIDGE = 3.0  # what the shortest piece may bridge; shorter bridges cross nothing
MIN_RING = 4.0  # a curve closes where it is so many times as long as the gap
CROSSING = 0.8  # a bridge this near to a curve crosses it
COST_BEND, COST_ASIDE = 30.0, 4.0  # degrees, px that cost as much as a bridge of `gap` px
COST_KIND = 0.5  # for another kind, and again for soft to hard


class _EndPairs(NamedTuple):
    """Pairs of ends of curves that might be joined; end 2c is the start of curve c, 2c + 1 its end.

    Parameters
    ----------
    a, b : (P,) int, the ends
    gap : (P,) px from one to the other
    ahead_a, ahead_b : (P,) px, how far along the heading of each the other lies
    aside : (P,) px, how far beside the heading of either, the greater of both
    bend : (P,) degrees by which a joined curve would turn
    unit : (P,) px, in which lengths are given
    """

    a: np.ndarray
    b: np.ndarray
    gap: np.ndarray
    ahead_a: np.ndarray
    ahead_b: np.ndarray
    aside: np.ndarray
    bend: np.ndarray
    unit: np.ndarray

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


def join(lines: Lines, options: Numbers, near: bool) -> Lines:
    """Join curves end to end. `near`: only ends that almost meet."""
    if lines.closed.all():
        return lines
    reach = MEETING if near else max(options.gap, options.contour_gap)
    pairs = _end_pairs(lines, reach * options.growth, options)
    if not len(pairs.a):
        return lines
    free = _free_ends(lines, pairs)
    pairs = _in_own_lengths(lines, pairs, free, options)
    good = _head_on(lines, pairs, free, options)
    good &= pairs.gap <= (MEETING if near else _longest_bridge(lines, pairs, options))
    good &= ~_too_short_to_close(lines, pairs)
    section = lines.kind == KINDS.index("section")  # a cut is told apart from all other lines
    good &= section[pairs.curve_a] == section[pairs.curve_b]
    pairs = pairs.take(good)
    pairs = pairs.take(_clear(lines, pairs, options))
    mate = _mates(pairs, _cost(lines, pairs, options), 2 * len(lines))
    return _link(lines, mate, options)


def _free_ends(lines: Lines, pairs: _EndPairs) -> np.ndarray:
    """Tell which ends of contours that may be joined to one another are free, (2C,) bool."""
    contours = pairs.take(pairs.both(lines.kind == CONTOUR))
    asked = np.zeros(2 * len(lines), bool)
    asked[contours.a] = asked[contours.b] = True
    return asked & ~near_others(lines, FREE, asked)


def _end_pairs(lines: Lines, reach: float, options: Numbers) -> _EndPairs:
    """Pair the ends of open curves within `reach` px, and measure how they lie to each other."""
    curved = SOFT[lines.kind] | (lines.kind == CONTOUR)
    tip, heading = ends_of(lines, options.in_points(curved, HEADING))
    ends = np.flatnonzero(~np.repeat(lines.closed, 2))
    a, b = ends[_pairs_within(tip[ends], reach)]
    bridge = tip[b] - tip[a]
    gap = np.linalg.norm(bridge, axis=1)
    ahead_a = np.einsum("ij,ij->i", bridge, heading[a])
    ahead_b = -np.einsum("ij,ij->i", bridge, heading[b])
    side_a = np.sqrt(np.maximum(gap**2 - ahead_a**2, 0.0))
    side_b = np.sqrt(np.maximum(gap**2 - ahead_b**2, 0.0))
    bend = np.degrees(np.arccos(np.clip(-np.einsum("ij,ij->i", heading[a], heading[b]), -1.0, 1.0)))
    aside, unit = np.maximum(side_a, side_b), np.ones(len(a))
    return _EndPairs(a, b, gap, ahead_a, ahead_b, aside, bend, unit)


def _in_own_lengths(
    lines: Lines, pairs: _EndPairs, free: np.ndarray, options: Numbers
) -> _EndPairs:
    """Measure pairs with a soft line, and of free ends of contours, in lengths that grow.

    Gaps there are noise of the form; those of other hard lines are gaps of the shape. `free` (2C,)
    tells the free ends.
    """
    contours = pairs.both(lines.kind == CONTOUR) & free[pairs.a] & free[pairs.b]
    soft = ~pairs.both(~SOFT[lines.kind])
    unit = np.where(soft | contours, options.growth, 1.0)
    ahead_a, ahead_b = pairs.ahead_a / unit, pairs.ahead_b / unit
    return pairs._replace(
        gap=pairs.gap / unit, ahead_a=ahead_a, ahead_b=ahead_b, aside=pairs.aside / unit, unit=unit
    )


def _pairs_within(xy: np.ndarray, reach: float) -> np.ndarray:
    """Pair points (N, 2) within `reach` of each other, each with at most MAX_NEAR, (2, P) rows."""
    here, there = nearest_points(xy, xy, reach, MAX_NEAR + 1)
    other = here != there
    pair = np.minimum(here, there)[other] * len(xy) + np.maximum(here, there)[other]
    return np.stack(np.divmod(np.unique(pair), len(xy)))


def _head_on(lines: Lines, pairs: _EndPairs, free: np.ndarray, options: Numbers) -> np.ndarray:
    """Tell which pairs of ends go on as one line, by their directions, (P,) bool."""
    gap, bend, aside = pairs.gap, pairs.bend, pairs.aside
    contours = pairs.both(lines.kind == CONTOUR)
    angle = np.where(contours, CONTOUR_ANGLE, 1.0) * options.angle
    ahead = (pairs.ahead_a > -BEHIND) & (pairs.ahead_b > -BEHIND)
    nearer = np.minimum(np.abs(pairs.ahead_a), np.abs(pairs.ahead_b))
    width = np.where(contours, CONTOUR_ASIDE, ASIDE) + np.tan(np.radians(angle)) * nearer
    straight = ahead & (aside <= width)
    past = np.minimum(pairs.ahead_a, pairs.ahead_b)
    overlap = ~ahead & (past > -OVERLAP) & (aside < OVERLAP_ASIDE)
    slight = bend < angle * np.where(gap < MEETING, MEETING_ANGLE, 1.0)
    good = np.where(gap < TOUCHING, bend < TOUCHING_BEND, slight & (straight | overlap))
    corner = contours & free[pairs.a] & free[pairs.b] & (past > 0.0) & (bend < CORNER_BEND)
    return good | (corner & (gap <= options.gap))


def _longest_bridge(lines: Lines, pairs: _EndPairs, options: Numbers) -> np.ndarray:
    """Bound the gap that each pair may bridge, (P,) px: a short piece no more than its length."""
    contours = pairs.both(lines.kind == CONTOUR)
    limit = np.where(contours, options.contour_gap, options.gap)
    return np.minimum(limit, np.maximum(_shorter(lines, pairs), MIN_BRIDGE))


def _shorter(lines: Lines, pairs: _EndPairs) -> np.ndarray:
    """Measure the shorter curve of each pair, (P,), in its unit."""
    length = lines.length
    return np.minimum(length[pairs.curve_a], length[pairs.curve_b]) / pairs.unit


def _too_short_to_close(lines: Lines, pairs: _EndPairs) -> np.ndarray:
    """Tell which pairs are both ends of one curve too short to be a ring, (P,) bool."""
    least = MIN_RING * np.maximum(pairs.gap, MIN_BRIDGE)
    return (pairs.curve_a == pairs.curve_b) & (_shorter(lines, pairs) <= least)


def _cost(lines: Lines, pairs: _EndPairs, options: Numbers) -> np.ndarray:
    """Weigh how unlikely each pair of ends is one line, (P,)."""
    a, b = lines.kind[pairs.curve_a], lines.kind[pairs.curve_b]
    return (
        pairs.gap / options.gap
        + pairs.bend / COST_BEND
        + pairs.aside / COST_ASIDE
        + COST_KIND * (a != b)
        + COST_KIND * (SOFT[a] != SOFT[b])
    )


def _mates(pairs: _EndPairs, cost: np.ndarray, count: int) -> np.ndarray:
    """Choose the end that each of `count` ends is joined to, cheapest first; -1 for none."""
    mate = np.full(count, -1)
    for i in np.lexsort((pairs.b, pairs.a, cost)):
        a, b = pairs.a[i], pairs.b[i]
        if mate[a] < 0 and mate[b] < 0:
            mate[a], mate[b] = b, a
    return mate


def _clear(lines: Lines, pairs: _EndPairs, options: Numbers) -> np.ndarray:
    """Tell which bridges cross no third hard curve, (P,) bool; short ones never do."""
    hard = ~SOFT[lines.kind][lines.of]
    clear = np.ones(len(pairs.a), bool)
    long = np.flatnonzero(pairs.gap >= MIN_BRIDGE)
    if not len(long) or not hard.any():
        return clear
    tip, _ = ends_of(lines)
    start, stop = tip[pairs.a[long]], tip[pairs.b[long]]
    of = lines.of[hard]
    t = np.linspace(0.0, 1.0, 13 * options.steps + 1)[1:-1]
    probe = start[:, None] + t[:, None] * (stop - start)[:, None]
    asking, nearest = nearest_points(lines.xy[hard], probe.reshape(-1, 2), CROSSING)
    bridge, other = long[asking // len(t)], of[nearest]
    own = (other == pairs.curve_a[bridge]) | (other == pairs.curve_b[bridge])
    clear[bridge[~own]] = False
    return clear


def _link(lines: Lines, mate: np.ndarray, options: Numbers) -> Lines:
    """Join chains of curves whose ends are paired; each is resampled as one curve.

    `mate` (2C,) is the end that each end is joined to, -1 for none.
    """
    linked = (mate[::2] >= 0) | (mate[1::2] >= 0)
    if not linked.any():
        return lines
    chains = _Chains.of(mate, linked)
    rows, offsets = chains.rows(lines, _skipped(lines, chains, options))
    kind = _joined_kinds(lines, chains)
    linked_up = lines.made_of(rows, offsets, kind, chains.ring)
    return even(Lines.concatenate(lines.take(~linked), linked_up))


class _Chains(NamedTuple):
    """Chains of curves that are joined: P parts, chain by chain.

    Parameters
    ----------
    end : (P,) int, the end where each curve is entered
    chain : (P,) int, which chain each part is of, ascending
    ring : (C,) bool, whether the last part of a chain leads to its first
    """

    end: np.ndarray
    chain: np.ndarray
    ring: np.ndarray

    @classmethod
    def of(cls, mate: np.ndarray, linked: np.ndarray) -> _Chains:
        """Follow ends from mate to mate, through curves that are `linked`, (C,) bool.

        Open chains begin at an end that has no mate, then rings anywhere.
        """
        mates, used = mate.tolist(), (~linked).tolist()
        ends: list[int] = []
        count: list[int] = []
        ring: list[bool] = []
        starts = np.repeat(2 * np.flatnonzero(linked), 2)
        starts[1::2] += 1
        for end in (*starts[mate[starts] < 0].tolist(), *starts[::2].tolist()):
            before = len(ends)
            while end >= 0 and not used[end // 2]:
                used[end // 2] = True
                ends.append(end)
                end = mates[end ^ 1]
            if len(ends) > before:
                count.append(len(ends) - before)
                ring.append(end >= 0)
        chain = np.repeat(np.arange(len(count)), count)
        return cls(np.array(ends), chain, np.array(ring))

    @property
    def curve(self) -> np.ndarray:
        """The curve that each part is, (P,)."""
        return self.end // 2

    @property
    def before(self) -> np.ndarray:
        """The part before each part, (P,); -1 before the first of an open chain."""
        first = np.flatnonzero(np.diff(self.chain, prepend=-1))
        before = np.arange(len(self.end)) - 1
        last = np.r_[first[1:], len(self.end)] - 1
        before[first] = np.where(self.ring, last, -1)
        return before

    def rows(self, lines: Lines, skip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """List the points of chains, of parts less the first `skip` (P,): rows, and offsets."""
        start, step = self.ways(lines)
        count = np.diff(lines.offsets)[self.curve] - skip
        of = np.repeat(np.arange(len(count)), count)
        rows = start[of] + step[of] * (skip[of] + counting(count))
        offsets = np.r_[0, np.cumsum(np.bincount(self.chain, count).astype(np.int64))]
        closing = np.flatnonzero(self.ring)  # a ring ends with its first point
        rows = np.insert(rows, offsets[closing + 1], rows[offsets[closing]])
        return rows, offsets + np.r_[0, np.cumsum(self.ring)]

    def ways(self, lines: Lines) -> tuple[np.ndarray, np.ndarray]:
        """Tell the row where each part begins, and 1 or -1, the step to the next, (P,) each."""
        back = self.end % 2 == 1
        return np.where(back, lines.last[self.curve], lines.first[self.curve]), 1 - 2 * back


def _joined_kinds(lines: Lines, chains: _Chains) -> np.ndarray:
    """Choose kinds of the most length, of the hard ones where these make up a third of it, (C,)."""
    kind, length = lines.kind[chains.curve], lines.length[chains.curve]
    shape = (len(chains.ring), len(KINDS))
    weight = np.bincount(chains.chain * len(KINDS) + kind, length, shape[0] * shape[1])
    weight = weight.reshape(shape)
    hard = np.where(SOFT, 0.0, weight)
    mostly = 3.0 * hard.sum(axis=1) > weight.sum(axis=1)
    return np.where(mostly[:, None], hard, weight).argmax(axis=1)


def _skipped(lines: Lines, chains: _Chains, options: Numbers) -> np.ndarray:
    """Count the points at the start of each part that lie behind the one before, (P,) int."""
    before, (start, step) = chains.before, chains.ways(lines)
    count = np.diff(lines.offsets)[chains.curve]
    part = np.flatnonzero(
        (before >= 0) & (before != np.arange(len(before))) & (count >= MIN_TRIMMED)
    )
    before, first = before[part], before[part] > part  # a ring's first comes before its last
    place = np.minimum(np.arange(8 * options.steps), count[part, None] - 1)
    reach = lines.xy[start[part, None] + step[part, None] * place]
    tip = lines.xy[start[before] + step[before] * (count[before] - 1)]
    skip, known = np.zeros(len(count), np.int64), None
    while known is None or (skip != known).any():  # what is left of a part tells its heading
        known = skip.copy()
        root = np.maximum(count[before] - HEADING, np.where(first, 0, skip[before]))
        heading = tip - lines.xy[start[before] + step[before] * root]
        along = ((reach - tip[:, None]) * heading[:, None]).sum(axis=2)
        ahead = along > BEHIND_TIP * np.hypot(*heading.T)[:, None]
        skip[part] = np.minimum(ahead.argmax(axis=1), count[part] - 2)
    return skip
