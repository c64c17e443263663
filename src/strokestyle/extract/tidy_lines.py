"""Hold the polylines at work in `tidy`: a point every px, numbers of its steps, what they ask."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from ..geometry.curves import KINDS, Curves, arc_length, owner, resample, take_ragged
from ..geometry.kinds import KIND_TABLE
from ..geometry.near import nearest_points

STEP = 1.0  # px between points while at work, and in the result
LOOSE = 2.5  # px; an end farther from any line is loose
REPEATED = 1e-6  # px; nearer points are one
CHORD_REACH = 4  # points before and behind, over which a direction is measured

SOFT = np.array([kind.soft for kind in KIND_TABLE])
CONTOUR, CREASE, SUGGESTIVE = (KINDS.index(k) for k in ("contour", "crease", "suggestive"))


@dataclass(frozen=True)
class TidyOptions:
    """The numbers of `tidy`, whose steps say what they do.

    Parameters
    ----------
    merge, merge_soft, merge_contour, merge_suggestive : px, how near to a better curve a part of
        another goes: in general, if it is soft, if it is soft and the better one a
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
class Numbers(TidyOptions):
    """The numbers at work, on a canvas whose px are those of a print.

    Parameters
    ----------
    growth : how many times longer than given lengths are that tell noise from form: of soft lines,
        and of swarms
    """

    growth: float = 1.0

    @cached_property
    def steps(self) -> int:
        """`growth` in whole points."""
        return max(round(self.growth), 1)

    def in_points(self, soft: np.ndarray, count: int) -> np.ndarray:
        """Give a number of points for curves (C,): those that are `soft` so many times more."""
        return count * np.where(soft, self.steps, 1)


@dataclass(frozen=True)
class Lines:
    """Polylines with a point every STEP px.

    Parameters
    ----------
    xy : (N, 2), px on a canvas of REFERENCE px
    strength : (N,) in 0..1
    source : (N,) int, the row of the given points that a point comes from, or the nearest to it
    node : (N,) bool, points that stay where they are, as `find_nodes` has it
    offsets : (C+1,) int
    kind, closed : (C,)
    """

    xy: np.ndarray
    strength: np.ndarray
    source: np.ndarray
    node: np.ndarray
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
    ) -> Lines:
        """Make curves of the points at `rows` (M,)."""
        xy, strength = self.xy[rows], self.strength[rows]
        return Lines(xy, strength, self.source[rows], self.node[rows], offsets, kind, closed)

    @classmethod
    def concatenate(cls, *parts: Lines) -> Lines:
        """Put lines one after the other."""
        joined = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("xy", "strength", "source", "node", "kind", "closed")
        }
        count = np.concatenate([np.diff(part.offsets) for part in parts])
        return cls(offsets=np.r_[0, np.cumsum(count)], **joined)

    def take(self, index: np.ndarray) -> Lines:
        """Select the curves of an index or mask over C, in that order."""
        index = np.arange(len(self))[np.asarray(index)]
        rows, offsets = take_ragged(self.offsets, index)
        return self.made_of(rows, offsets, self.kind[index], self.closed[index])

    def stretches(self, keep: np.ndarray) -> Lines:
        """Cut out the stretches of kept points (N,); closed curves open where cut.

        Single points are lost.
        """
        run, start, count, value = flag_runs(keep, self.offsets)
        good = value & (count >= 2)
        of = self.of[start]
        whole = count == np.diff(self.offsets)[of]
        offsets = np.r_[0, np.cumsum(count[good])]
        closed = (self.closed[of] & whole)[good]
        return self.made_of(np.flatnonzero(good[run]), offsets, self.kind[of[good]], closed)


def even(lines: Lines) -> Lines:
    """Space points every STEP px between nodes; curves of no length are left out."""
    lines = _without_repeats(lines)
    row = np.arange(len(lines.xy), dtype=np.float64)
    xy, offsets, (strength, row) = resample(
        lines.xy, lines.offsets, STEP, lines.strength, row, keep=lines.node
    )
    nearest = np.rint(row).astype(np.int64)
    node = lines.node[nearest] & (np.abs(row - nearest) < 1e-6)
    strength = np.clip(strength, 0.0, 1.0)
    return Lines(xy, strength, lines.source[nearest], node, offsets, lines.kind, lines.closed)


def _without_repeats(lines: Lines) -> Lines:
    """Leave out points that repeat the one before, and curves of which but one is left."""
    new = np.ones(len(lines.xy), bool)
    new[1:] = np.linalg.norm(np.diff(lines.xy, axis=0), axis=1) > REPEATED
    new[lines.first] = True
    kept = np.flatnonzero(new)
    node = np.bincount(np.cumsum(new) - 1, lines.node, len(kept)) > 0
    of, count = lines.of[kept], np.bincount(lines.of[kept], minlength=len(lines))
    long = count >= 2
    kept, node = kept[long[of]], node[long[of]]
    offsets = np.r_[0, np.cumsum(count[long])]
    return replace(lines.made_of(kept, offsets, lines.kind[long], lines.closed[long]), node=node)


def evenly(curves: Curves, scale: float, strength: np.ndarray, node: np.ndarray) -> Lines:
    """Bring curves to a canvas `scale` times smaller; their points are their own source."""
    source = np.arange(len(curves.xy))
    strength = np.asarray(strength, np.float64)
    return even(
        Lines(curves.xy / scale, strength, source, node, curves.offsets, curves.kind, curves.closed)
    )


def flag_runs(
    flag: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Find stretches of equal `flag` (N,) that stay within one curve.

    Returns
    -------
    the run of each point (N,); start, count and flag of each run (R,)
    """
    begins = np.ones(len(flag) + 1, bool)
    begins[1:-1] = flag[1:] != flag[:-1]
    begins[offsets] = True
    bounds = np.flatnonzero(begins)
    start, count = bounds[:-1], np.diff(bounds)
    return np.repeat(np.arange(len(start)), count), start, count, flag[start]


def flip_short(
    flag: np.ndarray, offsets: np.ndarray, value: bool, shorter: float | np.ndarray
) -> np.ndarray:
    """Flip runs of `value` that are shorter than `shorter` points and not a whole curve.

    `shorter` is one number, or one a curve (C,).
    """
    run, start, count, is_on = flag_runs(flag, offsets)
    if np.ndim(shorter):
        shorter = np.asarray(shorter)[np.searchsorted(offsets, start, "right") - 1]
    ends = np.zeros(len(flag) + 1, bool)
    ends[offsets] = True
    whole = ends[start] & ends[start + count]
    turn = (is_on == value) & (count < shorter) & ~whole
    return flag ^ turn[run]


def chords(lines: Lines, reach: int | np.ndarray = CHORD_REACH) -> np.ndarray:
    """Measure the direction (N, 2) from `reach` points before to `reach` behind, less at ends.

    `reach` is one number, or one a curve (C,).
    """
    at = np.arange(len(lines.xy))
    of = lines.of
    reach = np.broadcast_to(reach, len(lines))[of]
    d = (
        lines.xy[np.minimum(at + reach, lines.last[of])]
        - lines.xy[np.maximum(at - reach, lines.first[of])]
    )
    return d / np.maximum(np.linalg.norm(d, axis=1), 1e-9)[:, None]


def short_creases(lines: Lines, options: Numbers) -> np.ndarray:
    """Tell which curves are creases too short to be trusted, (C,) bool."""
    return (lines.kind == CREASE) & (lines.length < options.long_crease * options.growth)


def loose_creases(lines: Lines, options: Numbers, crease: np.ndarray) -> np.ndarray:
    """Tell which `crease` curves (C,) bool have an end that no other is near, (C,) bool.

    The edges of a true solid meet, so that a short crease with a loose end is noise.
    """
    near = near_others(lines, LOOSE * options.growth, np.repeat(crease, 2))
    return crease & ~(near[::2] & near[1::2])


def ends_of(lines: Lines, reach: int | np.ndarray = 6) -> tuple[np.ndarray, np.ndarray]:
    """Find both ends of every curve, start then end, (2C, 2), and their headings out, (2C, 2).

    Headings are over `reach` points, of all curves or of each (C,).
    """
    count = np.diff(lines.offsets) - 1
    back = np.minimum(count, reach)
    tip = np.stack([lines.first, lines.last], axis=1).ravel()
    root = np.stack([lines.first + back, lines.last - back], axis=1).ravel()
    heading = lines.xy[tip] - lines.xy[root]
    return lines.xy[tip], heading / np.maximum(np.linalg.norm(heading, axis=1), 1e-9)[:, None]


def near_others(lines: Lines, radius: float, asked: np.ndarray | None = None) -> np.ndarray:
    """Tell which ends, start then end of every curve, lie within `radius` px of another, (2C,).

    `asked` : (2C,) bool, the ends that are looked at; the others count as far. By default all.
    """
    ends = np.flatnonzero(np.ones(2 * len(lines), bool) if asked is None else asked)
    near = np.zeros(2 * len(lines), bool)
    # a curve has hardly more than 2 radius points of its own so near to its tip; the next nearest
    # are others
    tips, most = ends_of(lines)[0][ends], int(2.0 * radius / STEP) + 4
    asking, found = nearest_points(lines.xy, tips, radius, most)
    end = ends[asking]
    near[end[lines.of[found] != end // 2]] = True
    return near
