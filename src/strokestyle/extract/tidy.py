"""From visible fragments of lines to the fewest, longest natural strokes.

Lengths are in pixels of a canvas 768 px on its longer side and grow with the canvas. A line is *hard* where it must be
drawn to understand the shape (contour, boundary, crease, intersection, other) and *soft* where it describes the form
between those (suggestive contour, ridge, valley, apparent ridge).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.curves import KINDS, Curves, arc_length, owner, resample, take_ragged
from ..geometry.kinds import KIND_TABLE

REFERENCE = 768.0  # px, the longer side of the canvas on which all lengths here are stated
STEP = 1.0  # px between points while at work, and in the result
HAIRPIN = 110.0  # degrees: a line that turns back on itself is two lines
_SOFT = np.array([kind.soft for kind in KIND_TABLE])
_WEIGHT = np.array([kind.weight for kind in KIND_TABLE])
_CREASE, _SUGGESTIVE = KINDS.index("crease"), KINDS.index("suggestive")


@dataclass(frozen=True)
class TidyOptions:
    """The numbers of `tidy`, which says what they do. Lengths are pixels on a 768 px canvas, angles degrees.

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
    crowd: float = 150.0
    long_crease: float = 30.0
    gap: float = 10.0
    contour_gap: float = 14.0
    angle: float = 30.0
    corner: float = 70.0
    smooth: float = 0.5
    smooth_soft: float = 1.5

    def __post_init__(self):
        for item in fields(self):
            value = getattr(self, item.name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"tidy option {item.name} must be a number from 0 on, got {value}")


@dataclass(frozen=True)
class _Lines:
    """Polylines with a point every STEP px: xy (N, 2), strength and source (N,), offsets (C+1,), kind, closed (C,).

    The source of a point is the row of the given points that it comes from, or the nearest to it.
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

    def lengths(self) -> np.ndarray:
        return arc_length(self.xy, self.offsets)[self.last]

    def mean_strength(self) -> np.ndarray:
        return (
            np.add.reduceat(self.strength, self.first) / np.diff(self.offsets)
            if len(self)
            else np.zeros(0)
        )

    def take(self, index) -> _Lines:
        index = np.arange(len(self))[np.asarray(index)]
        rows, offsets = take_ragged(self.offsets, index)
        return _Lines(
            self.xy[rows],
            self.strength[rows],
            self.source[rows],
            offsets,
            self.kind[index],
            self.closed[index],
        )

    def runs(self, keep: np.ndarray) -> _Lines:
        """The stretches of kept points (N,), as curves; single points are lost. Closed curves open where cut."""
        run, start, count, value = _runs(keep, self.offsets)
        good = value & (count >= 2)
        of = owner(self.offsets)[start]
        rows = good[run]
        whole = count == np.diff(self.offsets)[of]
        offsets = np.r_[0, np.cumsum(count[good])]
        return _Lines(
            self.xy[rows],
            self.strength[rows],
            self.source[rows],
            offsets,
            self.kind[of[good]],
            (self.closed[of] & whole)[good],
        )


def tidy(
    fragments: Curves,
    strength: np.ndarray,
    size: tuple[int, int] = (768, 768),
    options: TidyOptions | None = None,
) -> Curves:
    """The strokes that an illustrator would start from, out of visible pieces of feature lines.

    1. **Cut** where a line turns back on itself (110 degrees within 6 px), as contours do at cusps.
    2. **Merged**: the part of a curve that runs beside a better one goes: within `merge` px and `merge_angle` degrees,
       if it is soft within `merge_soft` px, or beside a contour `merge_contour` px and 0.4 `merge_angle`; and since
       suggestive contours and lines of other kinds tell of the same form from two sides, of these two within
       `merge_suggestive` px and 0.7 `merge_angle`. Better is,
       among hard lines of 8 px and more, the earlier kind in KINDS, then the longer; a hard line before a soft one;
       among soft ones the greater length x strength. A crease shorter than `long_crease` px is more often noise than
       form and competes as a soft line, with twice its length. Of what is left, stretches shorter than 6 px go too;
       what would go over less than 4 px stays. Lines that cross are not parallel, so they stay.
    3. **Joined**, before and after steps 2 and 4: ends at most 4 px apart at first, then `gap` px (`contour_gap`
       between contours), but not farther than the shorter piece is long. Both must head for each other within `angle`
       degrees (1.4 times that for contours), or overlap side by side by at most 6 px; ends within 2 px may bend by 60
       degrees, and two free ends of contours by 90. Straightest and nearest pairs first, the same kind before others,
       never across a third hard line. A joined stroke has the kind of its longest part, of the hard ones where these
       make up a third of it. Ends of one curve that meet close it.
    4. **Dropped**: hard lines shorter than `isolated` px; 1.4 `attached` px with one end, `attached` px with both
       within 6 px of another line. Soft lines, and short creases with an end more than 2.5 px from any line, of less
       length x strength than `soft` px, and once more as much for every `crowd` px of other lines shorter than 30 px
       within 24 px: noise comes in swarms. Anything shorter than `speck` px.
    5. **Split** at corners of more than `corner` degrees within 6 px either side that are no zig-zag (0.75 times that
       over 12 px), 11 px or more from the ends and from each other. What turns as much within the last 8 px is a hook,
       and goes. A closed curve with no corner starts at its topmost
       point (the leftmost of these); one with corners starts and ends at one and is open.
    6. **Smoothed** along the stroke, by no more than `smooth` px, soft lines `smooth_soft` px; ends stay.

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
    """Tidy as `tidy` does, and say of each point (M,) of the result which of the given ones it comes from.

    A point of a bridge comes from the end that is nearest, a smoothed one from where it was.
    """
    options = options or TidyOptions()
    strength = np.asarray(strength, np.float64)
    if strength.shape != (len(fragments.xy),) or not np.isfinite(strength).all():
        raise ValueError(
            f"strength must be {len(fragments.xy)} finite numbers, one per point, got {strength.shape}"
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
    lines = _unhook(lines, options.corner)
    lines = _smooth(lines, options)
    order = np.lexsort((-lines.lengths(), lines.kind))
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
        cosine = np.abs(np.einsum("ij,ij->i", _chords(lines, 4), _chords(drawn, 4)[nearest]))
        covered = near & (cosine > np.cos(np.radians(options.merge_angle)))
        for value in (False, True):
            covered = _flip_short(covered, lines.offsets, value, 6.0 / STEP)
        lines = lines.runs(~covered)
    return Curves(lines.xy * scale, lines.offsets, lines.kind, lines.closed), lines.source


def _even(xy, strength, source, offsets, kind, closed) -> _Lines:
    """Points every STEP px; curves of no length are left out."""
    row = np.arange(len(xy), dtype=np.float64)
    xy, offsets, (strength, row) = resample(xy, offsets, STEP, strength, row)
    strength, source = np.clip(strength, 0.0, 1.0), source[np.rint(row).astype(np.int64)]
    lines = _Lines(xy, strength, source, offsets, np.asarray(kind), np.asarray(closed, bool))
    return lines.take(lines.lengths() > 1e-6) if len(lines) else lines


def _evenly(curves: Curves, scale: float, strength: np.ndarray) -> _Lines:
    """Curves in units of a canvas of REFERENCE px, whose points are their own source."""
    source = np.arange(len(curves.xy))
    xy = curves.xy / scale
    return _even(xy, strength, source, curves.offsets, curves.kind, curves.closed)


def _runs(
    flag: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Stretches of equal `flag` (N,) that stay within one curve: run of each point (N,), then start, count and flag
    of each run (R,)."""
    if not len(flag):
        return np.zeros(0, int), np.zeros(0, int), np.zeros(0, int), np.zeros(0, bool)
    new = np.r_[True, flag[1:] != flag[:-1]]
    new[offsets[:-1]] = True
    start = np.flatnonzero(new)
    return np.cumsum(new) - 1, start, np.diff(np.r_[start, len(flag)]), flag[start]


def _flip_short(flag: np.ndarray, offsets: np.ndarray, value: bool, shorter: float) -> np.ndarray:
    """Turn runs of `value` that are shorter than `shorter` points and not a whole curve."""
    run, start, count, is_on = _runs(flag, offsets)
    whole = count == np.diff(offsets)[owner(offsets)[start]]
    turn = (is_on == value) & (count < shorter) & ~whole
    return flag ^ turn[run]


def _chords(lines: _Lines, reach: int) -> np.ndarray:
    """Direction (N, 2) of the chord from `reach` points before to `reach` points after, less near the ends."""
    at = np.arange(len(lines.xy))
    of = owner(lines.offsets)
    d = (
        lines.xy[np.minimum(at + reach, lines.last[of])]
        - lines.xy[np.maximum(at - reach, lines.first[of])]
    )
    return d / np.maximum(np.linalg.norm(d, axis=1), 1e-9)[:, None]


# ---------------------------------------------------------------------------------------------------------- merging


def _merge(lines: _Lines, options: TidyOptions) -> _Lines:
    """Without the parts that run beside a better curve."""
    if len(lines) < 2:
        return lines
    of = owner(lines.offsets)
    soft = _SOFT[lines.kind]
    length = lines.lengths()
    soft |= (lines.kind == _CREASE) & (length < options.long_crease)
    score = length * np.where(soft, lines.mean_strength(), 1.0) * _WEIGHT[lines.kind]
    group = np.where(soft, len(KINDS) + 1, np.where(length >= 8.0, lines.kind, len(KINDS)))
    rank = np.empty(len(lines), np.int64)
    rank[np.lexsort((np.arange(len(lines)), -score, group))] = np.arange(len(lines))

    contour = lines.kind == 0
    suggestive = lines.kind == _SUGGESTIVE
    radius = max(options.merge, options.merge_soft, options.merge_contour, options.merge_suggestive)
    along = np.arange(len(lines.xy)) - lines.first[of]
    every = np.flatnonzero(along % 2 == 0)  # every second point is asked, and answers for the next
    pairs = every[cKDTree(lines.xy[every]).query_pairs(radius, output_type="ndarray")]
    pairs = pairs[of[pairs[:, 0]] != of[pairs[:, 1]]]
    swap = rank[of[pairs[:, 0]]] > rank[of[pairs[:, 1]]]
    winner, loser = np.where(swap[:, None], pairs[:, ::-1], pairs).T
    direction = _chords(lines, 4)
    cosine = np.abs(np.einsum("ij,ij->i", direction[winner], direction[loser]))
    between = lines.xy[winner] - lines.xy[loser]
    distance = np.linalg.norm(between, axis=1)
    abreast = (
        np.abs(np.einsum("ij,ij->i", between, direction[winner])) < 1.5 * STEP
    )  # not ahead of a tip
    limit = np.where(contour[of[winner]], options.merge_contour, options.merge_soft)
    same_form = (suggestive[of[winner]] != suggestive[of[loser]]) & ~contour[of[winner]]
    limit = np.where(same_form, np.maximum(limit, options.merge_suggestive), limit)
    near = distance <= np.where(soft[of[loser]], limit, options.merge)
    angle = (
        np.where(distance > options.merge_soft, np.where(same_form, 0.7, 0.4), 1.0)
        * options.merge_angle
    )
    beside = near & abreast & (cosine > np.cos(np.radians(angle)))
    winner, loser = winner[beside], loser[beside]

    # A part that is gone removes nothing itself. Each round settles the curves one rank further down the chains of
    # curves that compete, so a few rounds do.
    gone = np.zeros(len(lines.xy), bool)
    for _ in range(12):
        before = gone
        gone = np.zeros(len(lines.xy), bool)
        gone[loser[~before[winner]]] = True
        gone[1:] |= gone[:-1] & (along[1:] % 2 == 1)
        for value, shorter in ((False, 3.0), (True, 4.0), (False, 6.0)):
            part = _flip_short(gone, lines.offsets, value, shorter / STEP)
            gone = part
        if np.array_equal(gone, before):
            break
    return lines.runs(~gone)


# ---------------------------------------------------------------------------------------------------------- joining


def _ends(lines: _Lines, reach: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of every curve, start then end, (2C, 2), and their headings outward, (2C, 2)."""
    count = np.diff(lines.offsets) - 1
    back = np.minimum(count, reach)
    tip = np.stack([lines.first, lines.last], axis=1).ravel()
    root = np.stack([lines.first + back, lines.last - back], axis=1).ravel()
    heading = lines.xy[tip] - lines.xy[root]
    return lines.xy[tip], heading / np.maximum(np.linalg.norm(heading, axis=1), 1e-9)[:, None]


def _join(lines: _Lines, options: TidyOptions, near: bool) -> _Lines:
    """Curves joined end to end. `near`: only ends that almost meet."""
    open_ = np.flatnonzero(~lines.closed)
    if not len(open_):
        return lines
    tip, heading = _ends(lines)
    curve = np.arange(len(tip)) // 2
    candidates = np.flatnonzero(~lines.closed[curve])
    reach = 4.0 if near else max(options.gap, options.contour_gap)
    pairs = candidates[cKDTree(tip[candidates]).query_pairs(reach, output_type="ndarray")]
    if not len(pairs):
        return lines
    a, b = pairs.T
    length, kind = lines.lengths(), lines.kind
    soft = _SOFT[kind]
    ca, cb = curve[a], curve[b]
    bridge = tip[b] - tip[a]
    gap = np.linalg.norm(bridge, axis=1)
    along_a, along_b = (
        np.einsum("ij,ij->i", bridge, heading[a]),
        -np.einsum("ij,ij->i", bridge, heading[b]),
    )
    side_a = np.sqrt(np.maximum(gap**2 - along_a**2, 0.0))
    side_b = np.sqrt(np.maximum(gap**2 - along_b**2, 0.0))
    bend = np.degrees(np.arccos(np.clip(-np.einsum("ij,ij->i", heading[a], heading[b]), -1.0, 1.0)))
    contours = (kind[ca] == 0) & (kind[cb] == 0)
    angle = np.where(contours, 1.4, 1.0) * options.angle
    free = ~_near_others(lines, 3.0)
    corner = contours & free[a] & free[b] & (along_a > 0.0) & (along_b > 0.0) & (bend < 90.0)
    slope = np.tan(np.radians(angle))
    ahead = (along_a > -0.5) & (along_b > -0.5)
    aside = np.maximum(side_a, side_b)
    straight = ahead & (
        aside <= np.where(contours, 2.5, 1.5) + slope * np.minimum(np.abs(along_a), np.abs(along_b))
    )
    touching = gap < 2.0
    overlap = ~ahead & (np.minimum(along_a, along_b) > -6.0) & (aside < 2.0)
    good = np.where(
        touching, bend < 60.0, (bend < angle * np.where(gap < 4.0, 1.2, 1.0)) & (straight | overlap)
    )
    good |= corner & (gap <= options.gap)
    limit = np.where(contours, options.contour_gap, options.gap)
    # a short piece does not bridge more than its own length
    limit = np.minimum(limit, np.maximum(np.minimum(length[ca], length[cb]), 3.0))
    good &= gap <= np.where(near, 4.0, limit)
    own = ca == cb
    good &= ~own | ((a != b) & (length[ca] > 4.0 * np.maximum(gap, 3.0)))
    mixed = kind[ca] != kind[cb]
    cost = (
        gap / options.gap + bend / 30.0 + aside / 4.0 + 0.5 * mixed + 0.5 * (soft[ca] != soft[cb])
    )
    a, b, gap, cost = a[good], b[good], gap[good], cost[good]
    if len(a):
        clear = _clear(lines, tip[a], tip[b], curve[a], curve[b], gap)
        a, b, cost = a[clear], b[clear], cost[clear]
    mate = np.full(len(tip), -1)
    for i in np.lexsort((b, a, cost)):
        if mate[a[i]] < 0 and mate[b[i]] < 0:
            mate[a[i]], mate[b[i]] = b[i], a[i]
    return _link(lines, mate)


def _clear(lines: _Lines, start, stop, ca, cb, gap) -> np.ndarray:
    """Whether the bridge of each pair meets no third hard curve, (P,). Bridges of less than 3 px always do."""
    hard = ~_SOFT[lines.kind][owner(lines.offsets)]
    clear = np.ones(len(start), bool)
    long = np.flatnonzero(gap >= 3.0)
    if not len(long) or not hard.any():
        return clear
    tree, of = cKDTree(lines.xy[hard]), owner(lines.offsets)[hard]
    t = np.linspace(0.0, 1.0, 14)[1:-1]
    probe = start[long, None] + t[:, None] * (stop - start)[long, None]
    _, nearest = tree.query(probe.reshape(-1, 2), k=1, distance_upper_bound=0.8)
    found = nearest < len(of)
    other = np.where(found, of[np.minimum(nearest, len(of) - 1)], -1).reshape(len(long), -1)
    third = (other >= 0) & (other != ca[long, None]) & (other != cb[long, None])
    clear[long] = ~third.any(axis=1)
    return clear


def _link(lines: _Lines, mate: np.ndarray) -> _Lines:
    """Chains of curves whose ends are paired, (2C,) with -1 for none; each is resampled as one curve."""
    linked = (mate >= 0).reshape(-1, 2).any(axis=1)
    if not linked.any():
        return lines
    single = lines.take(~linked)
    length, used = lines.lengths(), np.zeros(len(lines), bool)
    made, kind, closed = [], list(single.kind), list(single.closed)
    # open chains from an end that has no mate, then rings from anywhere
    curves = np.flatnonzero(linked)
    starts = [end for c in curves for end in (2 * c, 2 * c + 1) if mate[end] < 0] + [
        2 * c for c in curves
    ]
    count = []
    for end in starts:
        if used[end // 2]:
            continue
        parts, at, weight = [], end, np.zeros(len(KINDS))
        while at >= 0 and not used[at // 2]:
            c = at // 2
            used[c] = True
            rows = np.arange(lines.offsets[c], lines.offsets[c + 1])
            parts.append(rows[::-1] if at % 2 else rows)
            weight[lines.kind[c]] += length[c]
            at = mate[at ^ 1]
        ring = at >= 0
        rows = np.concatenate(_trimmed(lines.xy, parts, ring)) if len(parts) > 1 else parts[0]
        if ring:
            rows = np.r_[rows, rows[0]]
        made.append(rows)
        count.append(len(rows))
        hard = np.where(_SOFT, 0.0, weight)
        kind.append(int((hard if 3.0 * hard.sum() > weight.sum() else weight).argmax()))
        closed.append(ring)
    offsets = np.r_[single.offsets, single.offsets[-1] + np.cumsum(count)]
    rows = np.concatenate(made)
    columns = (
        np.concatenate([getattr(single, name), getattr(lines, name)[rows]])
        for name in ("xy", "strength", "source")
    )
    return _even(*columns, offsets, np.array(kind), np.array(closed))


def _trimmed(xy: np.ndarray, parts: list[np.ndarray], ring: bool) -> list[np.ndarray]:
    """Rows of successive parts, without the points at a part's start that lie behind the end of the one before."""
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


# --------------------------------------------------------------------------------------------------------- dropping


def _drop(lines: _Lines, options: TidyOptions) -> _Lines:
    """Without specks and noise."""
    if not len(lines):
        return lines
    length = lines.lengths()
    attached = _near_others(lines, 6.0).reshape(-1, 2).sum(axis=1) * ~lines.closed
    crease = (lines.kind == _CREASE) & (length < options.long_crease)
    loose = crease & ~_near_others(lines, 2.5).reshape(-1, 2).all(
        axis=1
    )  # the edges of a true solid meet
    soft = _SOFT[lines.kind] | loose
    crowd = _crowd(lines, (length < 30.0) & (_SOFT[lines.kind] | crease), soft)
    need = options.soft * (1.0 + crowd / max(options.crowd, 1e-9))
    least = np.array([options.isolated, options.attached * 1.4, options.attached])[attached]
    enough = np.where(soft, length * lines.mean_strength() >= need, length >= least)
    return lines.take(enough & (length >= options.speck))


def _crowd(lines: _Lines, short: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Length of other `short` lines (C,) within 24 px of a point of each `asked` line (C,), on average; (C,), px."""
    of = owner(lines.offsets)
    rows, probe = np.flatnonzero(short[of]), np.flatnonzero(asked[of])[::3]
    if not len(rows) or not len(probe):
        return np.zeros(len(lines))
    count = (
        cKDTree(lines.xy[rows]).query_ball_point(lines.xy[probe], 24.0, return_length=True) * STEP
    )
    hits = np.bincount(of[probe], minlength=len(lines))
    mean = np.bincount(of[probe], count, len(lines)) / np.maximum(hits, 1)
    return np.maximum(mean - np.where(short, np.minimum(lines.lengths(), 24.0), 0.0), 0.0)


def _near_others(lines: _Lines, radius: float) -> np.ndarray:
    """Whether each end, start then end of every curve, lies within `radius` px of another curve, (2C,)."""
    tip, _ = _ends(lines)
    tree, of = cKDTree(lines.xy), owner(lines.offsets)
    # a curve has hardly more than 2 radius points of its own so near to its tip; the next nearest are others
    k = min(int(2.0 * radius / STEP) + 4, len(lines.xy))
    distance, nearest = tree.query(tip, k=k, distance_upper_bound=radius)
    distance, nearest = distance.reshape(len(tip), -1), nearest.reshape(len(tip), -1)
    other = of[np.minimum(nearest, len(of) - 1)] != (np.arange(len(tip)) // 2)[:, None]
    return ((distance < np.inf) & other).any(axis=1)


# -------------------------------------------------------------------------------------------- splitting, smoothing


def _split(lines: _Lines, corner: float, reach: int, apart: int, steady: bool) -> _Lines:
    """Cut at corners of more than `corner` degrees within `reach` points either side, at least `apart` points from each
    other and from the ends. `steady`: not where the stroke turns back soon after.

    Closed curves without a corner start at their topmost point, the leftmost of them; others are cut at the corners.
    """
    if not len(lines):
        return lines
    of = owner(lines.offsets)
    turn = _turns(lines, reach)
    if steady:
        turn = np.where(_turns(lines, 2 * reach) > 0.75 * corner, turn, 0.0)
    along = np.arange(len(lines.xy)) - lines.first[of]
    count = np.diff(lines.offsets)[of] - 1
    turn[~lines.closed[of] & (np.minimum(along, count - along) < apart)] = 0.0
    turn[lines.last[lines.closed]] = 0.0  # the same point as the first
    cut = np.zeros(len(lines.xy), bool)
    sharp = np.flatnonzero(turn > corner)
    for i in sharp[np.lexsort((sharp, -turn[sharp]))]:  # the sharpest of each corner's points
        lo, hi = i - apart + 1, i + apart
        if lines.closed[of[i]]:
            rows = lines.first[of[i]] + np.arange(along[i] - apart + 1, along[i] + apart) % count[i]
            cut[i] = not cut[rows].any()
        else:
            cut[i] = not cut[max(lo, 0) : hi].any()

    order = np.arange(len(lines.xy))
    open_again = np.zeros(len(lines), bool)
    for c in np.flatnonzero(lines.closed):
        rows = order[lines.offsets[c] : lines.offsets[c + 1] - 1]
        corners = np.flatnonzero(cut[rows])
        p = lines.xy[rows]
        start = corners[0] if len(corners) else np.lexsort((p[:, 0], p[:, 1]))[0]
        rows = np.roll(rows, -start)
        order[lines.offsets[c] : lines.offsets[c + 1]] = np.r_[rows, rows[0]]
        open_again[c] = len(corners) > 0
    cut = cut[order]
    cut[lines.first] = cut[lines.last] = False
    rows = np.repeat(np.arange(len(order)), 1 + cut)  # a corner belongs to both strokes
    starts = np.flatnonzero(np.r_[True, rows[1:] == rows[:-1]] | np.isin(rows, lines.first))
    parent = of[rows[starts]]
    rows = order[rows]
    closed = (lines.closed & ~open_again)[parent]
    return _Lines(
        lines.xy[rows],
        lines.strength[rows],
        lines.source[rows],
        np.r_[starts, len(rows)],
        lines.kind[parent],
        closed,
    )


def _unhook(lines: _Lines, corner: float) -> _Lines:
    """Open curves of 24 px and more without a last bit of up to 8 px that turns by more than `corner` degrees."""
    count = np.diff(lines.offsets)
    long = np.flatnonzero(~lines.closed & (count >= 24.0 / STEP))
    keep = np.ones(len(lines.xy), bool)
    for tip, inward in ((lines.first[long], 1), (lines.last[long], -1)):
        sharpest, cut = np.full(len(long), corner), np.zeros(len(long), np.int64)
        for k in range(2, int(8.0 / STEP) + 1):
            at = tip + inward * k
            u, v = lines.xy[at] - lines.xy[at + inward * 6], lines.xy[tip] - lines.xy[at]
            turn = np.degrees(
                np.abs(
                    np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.einsum("ij,ij->i", u, v))
                )
            )
            cut, sharpest = np.where(turn > sharpest, k, cut), np.maximum(turn, sharpest)
        for k in range(int(cut.max(initial=0))):
            keep[tip[cut > k] + inward * k] = False
    return lines if keep.all() else lines.runs(keep)


def _turns(lines: _Lines, reach: int) -> np.ndarray:
    """Angle between the chords to `reach` points before and after each point, degrees, (N,); 0 where there are none."""
    of = owner(lines.offsets)
    first, last, at = lines.first[of], lines.last[of], np.arange(len(lines.xy))
    before, after = np.maximum(at - reach, first), np.minimum(at + reach, last)
    ring = np.flatnonzero(lines.closed[of])
    size = np.maximum(last - first, 1)[ring]
    before[ring] = first[ring] + (at[ring] - first[ring] - reach) % size
    after[ring] = first[ring] + (at[ring] - first[ring] + reach) % size
    u, v = lines.xy - lines.xy[before], lines.xy[after] - lines.xy
    cross, dot = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.einsum("ij,ij->i", u, v)
    return np.degrees(np.abs(np.arctan2(cross, dot)))


def _smooth(lines: _Lines, options: TidyOptions) -> _Lines:
    """Mesh zig-zag averaged away along the curve by a Gaussian, moves limited; ends of open curves stay."""
    if not len(lines):
        return lines
    of = owner(lines.offsets)
    soft = _SOFT[lines.kind][of]
    before, after = np.arange(len(lines.xy)) - 1, np.arange(len(lines.xy)) + 1
    fixed = np.zeros(len(lines.xy), bool)
    fixed[lines.first[~lines.closed]] = fixed[lines.last[~lines.closed]] = True
    before[lines.first], after[lines.last] = lines.first, lines.last
    ring = lines.closed
    before[lines.first[ring]], after[lines.last[ring]] = lines.last[ring] - 1, lines.first[ring] + 1
    limit = np.where(soft, options.smooth_soft, options.smooth)
    xy = lines.xy
    for i in range(24):
        moves = ~fixed & (soft | (i < 6))
        xy = np.where(moves[:, None], 0.5 * xy + 0.25 * (xy[before] + xy[after]), xy)
    shift = xy - lines.xy
    size = np.linalg.norm(shift, axis=1)
    shift *= np.minimum(1.0, limit / np.maximum(size, 1e-9))[:, None]
    return replace(lines, xy=lines.xy + shift)
