"""Ragged image polylines: the plain curves that an artist, or a style, draws over."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .kinds import KINDS
from .threads import each

DEFAULT_SPACING = 3.0  # px between curve points, as in the code of Liu et al. 2021
SAME_POINT = 1e-6  # px; nearer points are one
MIN_EXTENT = 1e-6  # px; a clipped curve of less width and height is but a point
CACHED = 1 << 16  # points whose numbers stay in a core's cache while they are worked on


@dataclass(frozen=True)
class Curves:
    """Visible polylines on the image.

    Parameters
    ----------
    xy : (N, 2) float64, pixels
    offsets : (C+1,) int64, curve i is rows offsets[i]:offsets[i+1]; every curve has
        at least two points
    kind : (C,) int8, index into KINDS
    closed : (C,) bool; a closed curve repeats its first point as its last

    Raises
    ------
    ValueError
        on a wrong shape, a value that is not finite, or offsets that do not rise by at least two.
    """

    xy: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    closed: np.ndarray

    def __post_init__(self) -> None:
        xy = np.asarray(self.xy, np.float64)
        offsets = np.asarray(self.offsets, np.int64)
        kind = np.asarray(self.kind, np.int8)
        closed = np.asarray(self.closed, bool)
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise ValueError(f"Curves.xy must have shape (N, 2), got {xy.shape}")
        if not np.isfinite(xy).all():
            raise ValueError("Curves.xy holds values that are not finite")
        check_offsets(offsets, len(xy), 2, "Curves")
        count = len(offsets) - 1
        if kind.shape != (count,) or closed.shape != (count,):
            raise ValueError(
                f"Curves.kind and .closed must have shape ({count},), got {kind.shape} and "
                f"{closed.shape}"
            )
        if count and not (0 <= kind.min() and kind.max() < len(KINDS)):
            raise ValueError(f"Curves.kind must lie in 0..{len(KINDS) - 1}")
        for name, value in (("xy", xy), ("offsets", offsets), ("kind", kind), ("closed", closed)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> np.ndarray:
        """Points of curve i, (n, 2)."""
        return self.xy[self.offsets[i] : self.offsets[i + 1]]

    @classmethod
    def empty(cls) -> Curves:
        """No curves at all."""
        return cls(np.zeros((0, 2)), np.zeros(1, np.int64), np.zeros(0, np.int8), np.zeros(0, bool))

    @classmethod
    def concatenate(cls, parts: list[Curves]) -> Curves:
        """Put curves after one another."""
        if not parts:
            return cls.empty()
        counts = np.concatenate([np.diff(part.offsets) for part in parts])
        xy, kind, closed = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("xy", "kind", "closed")
        )
        return cls(xy, np.r_[0, np.cumsum(counts)], kind, closed)

    @classmethod
    def from_list(
        cls,
        polylines: Sequence[np.ndarray],
        kind: ArrayLike | None = None,
        closed: ArrayLike | None = None,
    ) -> Curves:
        """Lay polylines [(n, 2), ...] one after the other.

        Parameters
        ----------
        kind : (C,) int, index into KINDS; None: all "other"
        closed : (C,) bool; None: those whose first point is their last
        """
        if not polylines:
            return cls.empty()
        polylines = [np.asarray(line, np.float64).reshape(-1, 2) for line in polylines]
        if kind is None:
            kind = np.full(len(polylines), KINDS.index("other"))
        if closed is None:
            closed = [len(line) > 3 and np.array_equal(line[0], line[-1]) for line in polylines]
        return cls(
            np.concatenate(polylines),
            np.r_[0, np.cumsum([len(p) for p in polylines])],
            np.asarray(kind),
            np.asarray(closed),
        )

    def take(self, index: np.ndarray) -> Curves:
        """Select the curves of an index or mask over C, in that order."""
        index = np.arange(len(self))[np.asarray(index)]
        rows, offsets = take_ragged(self.offsets, index)
        return Curves(self.xy[rows], offsets, self.kind[index], self.closed[index])

    def lengths(self) -> np.ndarray:
        """Measure the arc length of each curve, (C,), pixels."""
        total = arc_length(self.xy, self.offsets)
        return total[self.offsets[1:] - 1] if len(self) else np.zeros(0)


def check_offsets(offsets: np.ndarray, rows: int, least: int, what: str) -> None:
    """Raise ValueError unless `offsets` cuts `rows` rows into pieces of at least `least`."""
    good = offsets.ndim == 1 and len(offsets) >= 1 and offsets[0] == 0 and offsets[-1] == rows
    if not (good and (np.diff(offsets) >= least).all()):
        raise ValueError(f"{what}.offsets must run from 0 to {rows} in steps of at least {least}")


def take_ragged(offsets: np.ndarray, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gather the rows (M,) of the pieces `index` (P,), one after the other, and their offsets."""
    count = np.diff(offsets)[index]
    new = np.r_[0, np.cumsum(count)]
    rows = np.arange(new[-1]) + np.repeat(offsets[index] - new[:-1], count)
    return rows, new


def counting(count: np.ndarray) -> np.ndarray:
    """Count 0, 1 ... n - 1 for each n of `count`, one after the other."""
    return np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)


def owner(offsets: np.ndarray) -> np.ndarray:
    """Tell which curve each row belongs to, (N,)."""
    return np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))


def runs(*values: np.ndarray) -> np.ndarray:
    """Find the runs of rows over which each of `values`, all (N,), stays the same: offsets (R+1,).

    To find where a flag changes along curves, give the flag and the curve of each row:
    `runs(flag, owner(offsets))`.
    """
    count = len(values[0])
    starts = np.zeros(count + 1, bool)
    starts[[0, -1]] = True
    for value in values:
        starts[1:-1] |= value[1:] != value[:-1]
    return np.flatnonzero(starts)


def kept_stretches(
    line: np.ndarray, keep: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Find the stretches of two or more points in a row, of one line each, that are kept.

    Parameters
    ----------
    line : (N,) int, ascending, the line that each point is on
    keep : (N,) bool

    Returns
    -------
    the rows (M,) of the stretches, their offsets (S+1,), the line (S,) that each is of, and whether
    it is all of that line, (S,) bool
    """
    start = runs(keep, line)
    count = np.diff(start)
    good = np.flatnonzero(keep[start[:-1]] & (count >= 2))
    rows, offsets = take_ragged(start, good)
    of = line[start[good]]
    return rows, offsets, of, count[good] == np.bincount(line)[of]


def stretches(curves: Curves, keep: np.ndarray) -> tuple[Curves, np.ndarray, np.ndarray]:
    """Cut curves down to stretches of two or more points that are kept, (N,) bool.

    A closed curve that is cut is open.

    Returns
    -------
    the stretches, the rows (M,) of `curves` that they are made of, and the curve that each is of
    """
    rows, offsets, of, whole = kept_stretches(owner(curves.offsets), keep)
    return Curves(curves.xy[rows], offsets, curves.kind[of], curves.closed[of] & whole), rows, of


def is_kind(kind: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Tell which of `kind` (C,), indices into KINDS, are one of the named kinds, (C,) bool."""
    return np.isin(kind, [KINDS.index(name) for name in names])


def arc_length(xy: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Measure each point's distance along its own curve, (N,), in units of `xy` (N, d)."""
    if not len(xy):
        return np.zeros(0)
    step = np.r_[0.0, np.linalg.norm(np.diff(xy, axis=0), axis=1)]
    step[offsets[:-1]] = 0.0
    total = np.cumsum(step)
    return total - np.repeat(total[offsets[:-1]], np.diff(offsets))


def arc(xy: np.ndarray) -> np.ndarray:
    """Measure each point's distance along one polyline, (n,), in units of `xy` (n, 2)."""
    step = np.diff(xy, axis=0)
    return np.concatenate([np.zeros(1), np.hypot(step[:, 0], step[:, 1]).cumsum()])


def blurred(values: np.ndarray, sigma: float, closed: bool = False) -> np.ndarray:
    """Blur values (n, d) at evenly spaced points of one curve by a Gaussian of `sigma` points.

    An open curve is turned about its end points, so that these stay where it is longer than 4
    sigma; a closed one, whose last point is its first, goes round.
    """
    reach = min(int(4 * sigma) + 1, len(values) - 1)
    if closed:
        padded = np.concatenate([values[-1 - reach : -1], values, values[1 : 1 + reach]])
    else:
        before, after = values[reach:0:-1], values[-2 : -2 - reach : -1]
        padded = np.concatenate([2 * values[:1] - before, values, 2 * values[-1:] - after])
    return gaussian(padded, sigma)[reach : reach + len(values)]


def gaussian(values: np.ndarray, sigma: float) -> np.ndarray:
    """Blur values (n,) or (n, d) along rows by a Gaussian of `sigma` rows, cut off at 4 sigma.

    Beyond the first and the last row these are repeated. As scipy.ndimage.gaussian_filter1d does,
    but to import that takes longer than most drawings are blurred.
    """
    values = np.asarray(values, np.float64)
    if not values.size:
        return values.copy()
    radius = int(4 * sigma + 0.5)
    kernel = np.exp(-0.5 / (sigma * sigma) * np.square(np.arange(-radius, radius + 1)))
    kernel /= kernel.sum()
    before, after = (np.repeat(end, radius, axis=0) for end in (values[:1], values[-1:]))
    longer, count = np.concatenate([before, values, after]), len(values)
    made = values * kernel[radius]
    for k in range(radius):  # the same sum at every row, whichever rows are blurred with it
        other = 2 * radius - k
        made += (longer[k : k + count] + longer[other : other + count]) * kernel[k]
    return made


def tangents(xy: np.ndarray, offsets: np.ndarray, closed: np.ndarray | None = None) -> np.ndarray:
    """Measure unit tangents (N, 2) by central differences, one-sided at ends, round closed curves.

    Where neighbours coincide the tangent is (1, 0): finite, and of no consequence for a stroke of
    no length.
    """
    if not len(xy):
        return np.zeros((0, 2))
    first, last = offsets[:-1], offsets[1:] - 1
    before, after = np.arange(len(xy)) - 1, np.arange(len(xy)) + 1
    before[first], after[last] = first, last
    if closed is not None:
        before[first[closed]] = last[closed] - 1
        after[last[closed]] = first[closed] + 1
    d = xy[after] - xy[before]
    norm = np.linalg.norm(d, axis=1)
    return np.where(norm[:, None] > 1e-12, d / np.maximum(norm, 1e-12)[:, None], [1.0, 0.0])


def resample(
    xy: np.ndarray,
    offsets: np.ndarray,
    spacing: float,
    *fields: np.ndarray,
    keep: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Space points evenly on every polyline; both end points are kept.

    The step of each curve is the one nearest `spacing` that divides its length, or the length
    between points that are kept.

    Parameters
    ----------
    xy : (N, d) float
    offsets : (C+1,) int
    spacing : float, in units of xy
    *fields : (N,) or (N, k) float, carried along linearly
    keep : (N,) bool, points that are kept besides the ends; none of them repeats its neighbour

    Returns
    -------
    xy (M, d), offsets (C+1,), [fields (M,) or (M, k)]
    """
    if not len(xy):
        return xy, offsets, list(fields)
    if keep is not None and keep.any():
        rows, pieces, first_of = _pieces(keep, offsets)
        xy, pieces, carried = resample(xy[rows], pieces, spacing, *[f[rows] for f in fields])
        once = np.ones(len(xy), bool)  # a kept point ends one piece and starts the next
        once[np.delete(pieces[:-1], first_of)] = False
        offsets = np.r_[0, np.cumsum(np.add.reduceat(once, pieces[:-1][first_of], dtype=int))]
        return xy[once], offsets, [field[once] for field in carried]
    along = arc_length(xy, offsets)
    length = along[offsets[1:] - 1]
    count = np.maximum(np.rint(length / spacing).astype(np.int64), 1) + 1
    new = np.r_[0, np.cumsum(count)]
    t = (np.arange(new[-1]) - np.repeat(new[:-1], count)) / np.repeat(count - 1, count)
    # one np.interp over all curves: lay them end to end, with a gap between them
    shift = np.r_[0.0, np.cumsum(length + 1.0)[:-1]]
    place = along + np.repeat(shift, np.diff(offsets))
    at = t * np.repeat(length, count) + np.repeat(shift, count)

    def carry(values: np.ndarray) -> np.ndarray:
        flat = np.asarray(values, np.float64).reshape(len(xy), -1)
        out = np.stack([np.interp(at, place, column) for column in flat.T], axis=1)
        return out.reshape((len(at),) + np.shape(values)[1:])

    out = carry(xy)
    out[new[:-1]], out[new[1:] - 1] = xy[offsets[:-1]], xy[offsets[1:] - 1]
    return out, new, [carry(field) for field in fields]


def _pieces(keep: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut polylines at the points to keep (N,), which belong to both sides.

    Returns rows (M,) int of the points, offsets of the pieces, and the first piece of each curve.
    """
    inner = keep.copy()
    inner[offsets[:-1]] = inner[offsets[1:] - 1] = False
    rows = np.repeat(np.arange(len(keep)), 1 + inner)
    starts = np.r_[True, rows[1:] == rows[:-1]]
    of_curve = offsets[:-1] + np.cumsum(np.r_[0, inner])[offsets[:-1]]
    starts[of_curve] = True
    pieces = np.flatnonzero(np.r_[starts, True])
    return rows, pieces, np.searchsorted(pieces, of_curve)


def resample_curves(curves: Curves, spacing: float) -> Curves:
    """Space points evenly on curves, about `spacing` px apart; both end points are kept."""
    return resample_with_source(curves, spacing)[0]


def resample_with_source(
    curves: Curves, spacing: float, keep: np.ndarray | None = None
) -> tuple[Curves, np.ndarray]:
    """Resample as `resample_curves` does, and say which row of `curves` is nearest to each point
    (M,).

    `keep` : (N,) bool, points that are kept besides the ends.
    """
    row = np.arange(len(curves.xy), dtype=np.float64)
    xy, offsets, (row,) = resample(curves.xy, curves.offsets, spacing, row, keep=keep)
    return Curves(xy, offsets, curves.kind, curves.closed), np.rint(row).astype(np.int64)


def simplify(xy: np.ndarray, tolerance: float) -> np.ndarray:
    """Choose the points of one polyline (n, d) that Ramer-Douglas-Peucker keeps: sorted indices."""
    keep = np.zeros(len(xy), bool)
    keep[[0, -1]] = True
    stack = [(0, len(xy) - 1)]
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        chord = xy[b] - xy[a]
        rel = xy[a + 1 : b] - xy[a]
        t = np.clip(rel @ chord / max(chord @ chord, 1e-18), 0.0, 1.0)
        distance = np.linalg.norm(rel - t[:, None] * chord, axis=1)
        k = int(distance.argmax())
        if distance[k] > tolerance:
            keep[a + 1 + k] = True
            stack += [(a, a + 1 + k), (a + 1 + k, b)]
    return np.flatnonzero(keep)


def simplify_all(xy: np.ndarray, offsets: np.ndarray, tolerance: float | np.ndarray) -> np.ndarray:
    """Tell which points (N,) bool Ramer-Douglas-Peucker keeps of each polyline, all cut in step.

    Parameters
    ----------
    xy : (N, 2) float
    offsets : (C+1,) int
    tolerance : in units of xy; one, or one a polyline (C,)
    """
    slack = np.broadcast_to(np.asarray(tolerance, np.float64), (len(offsets) - 1,))
    keep = np.zeros(len(xy), bool)

    def thin(few: slice) -> None:
        begin, end = offsets[few.start], offsets[few.stop]
        own = np.asarray(offsets[few.start : few.stop + 1]) - begin
        keep[begin:end] = _simplified(xy[begin:end], own, slack[few])

    each(thin, blocks(offsets, CACHED))
    return keep


def blocks(offsets: np.ndarray, size: int) -> list[slice]:
    """Divide pieces offsets[i]:offsets[i+1] into runs of them that have about `size` rows each.

    What is worked out of so few rows stays in a core's cache: of many it is written to memory and
    read again at each step.
    """
    cuts = np.searchsorted(offsets, np.arange(size, offsets[-1] - size // 2, size))
    ends = np.unique(np.r_[0, cuts, len(offsets) - 1])
    return [slice(a, b) for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)]


def _simplified(xy: np.ndarray, offsets: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """What `simplify_all` keeps (N,) bool of a block of polylines, each with its slack (C,)."""
    keep = np.zeros(len(xy), bool)
    keep[offsets[:-1]] = keep[offsets[1:] - 1] = True
    a, b = offsets[:-1], offsets[1:] - 1
    points = np.ascontiguousarray(xy, np.float64).view(np.complex128)[:, 0]
    while True:
        wide = b - a > 1
        a, b, slack = a[wide], b[wide], slack[wide]
        if not len(a):
            return keep
        worst, at = _farthest_from_chords(points, a, b)
        cut = worst > np.square(slack)
        keep[at[cut]] = True
        a, b, slack = np.r_[a[cut], at[cut]], np.r_[at[cut], b[cut]], np.r_[slack[cut], slack[cut]]


def _farthest_from_chords(
    points: np.ndarray, a: np.ndarray, b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the point between rows a and b (S,) farthest from their chord, the first of equals.

    `points` : (N,) complex
    Returns the square of its distance (S,), and its row (S,) int.
    """
    count = b - a - 1  # points between the ends
    head = np.cumsum(count) - count
    span = np.repeat(np.arange(len(a)), count)
    row = (a + 1 - head).take(span)
    row += np.arange(len(span))
    chord = points[b] - points[a]
    length = np.abs(chord)
    turn = np.where(length > 0, chord.conj(), 1.0) / np.where(length > 0, length, 1.0)
    rel = points.take(row)  # turned so that the chord lies along the real numbers
    rel -= points[a].take(span)
    rel *= turn.take(span)
    nearest = length.take(span)  # of the chord
    np.minimum(rel.real, nearest, out=nearest)
    np.maximum(nearest, 0.0, out=nearest)
    square = np.square(np.subtract(nearest, rel.real, out=nearest), out=nearest)
    square += np.square(rel.imag)
    return peaks(square, head, span, row)


def peaks(
    values: np.ndarray, head: np.ndarray, span: np.ndarray, row: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the largest of each span's values (P,), and the row of the first of equals, both (S,).

    Parameters
    ----------
    head : (S,) int, where the values of each span begin
    span : (P,) int, the span that each value is of
    row : (P,) int, the row that each value is at
    """
    largest = np.maximum.reduceat(values, head)
    pick = np.flatnonzero(values == largest[span])
    at = np.zeros(len(head), np.int64)
    at[span[pick[::-1]]] = row[pick[::-1]]
    return largest, at


def kind_named(name: str) -> int | None:
    """Find the kind that a name holds as a word of its own ("layer-contour", "Creases").

    Returns its index into KINDS, or None.

    "suggestive contours" are suggestive: the words that qualify another kind are sought first.
    """
    words = [word.lower() for word in re.findall("[A-Z]?[a-z]+|[A-Z]+", name[:200])]
    singular = {re.sub("s$", "", re.sub("ies$", "y", word)) for word in words}
    for kind in ("suggestive", "apparent", *KINDS):
        if kind in singular:
            return KINDS.index(kind)
    return None


def clean_curves(
    xy: np.ndarray, offsets: np.ndarray, kind: np.ndarray, closed: np.ndarray | None = None
) -> Curves:
    """Make curves of polylines: without repeated points, and without lines that are but a point.

    Parameters
    ----------
    xy : (N, 2) px
    offsets : (C+1,) int
    kind : (C,) int
    closed : (C,) bool, which lines may be closed; None: all whose ends meet

    Raises
    ------
    ValueError
        where none is left.
    """
    which = owner(offsets)
    keep = np.ones(len(xy), bool)
    keep[1:] = (np.abs(np.diff(xy, axis=0)) > SAME_POINT).any(axis=1) | (which[1:] != which[:-1])
    count = np.bincount(which[keep], minlength=len(offsets) - 1)
    keep &= (count >= 2)[which]
    usable = np.flatnonzero(count >= 2)
    if not len(usable):
        raise ValueError(f"no usable curve in it: none of {len(count)} has two distinct points")
    xy, offsets = xy[keep], np.r_[0, np.cumsum(count[usable])]
    start, end = offsets[:-1], offsets[1:] - 1
    meet = (np.abs(xy[start] - xy[end]) <= SAME_POINT).all(axis=1) & (end - start >= 3)
    if closed is not None:
        meet &= closed[usable]
    xy[end[meet]] = xy[start[meet]]
    return Curves(xy, offsets, kind[usable], meet)


def clip(curves: Curves, width: int, height: int) -> Curves:
    """Cut curves at the canvas' edge and keep what is inside; curves of no length are dropped."""
    return clip_with_source(curves, width, height)[0]


def clip_with_source(curves: Curves, width: int, height: int) -> tuple[Curves, np.ndarray]:
    """Clip, and tell the curve that each piece is of, (C,) int."""
    pieces: list[np.ndarray] = []
    source: list[int] = []
    closed: list[bool] = []
    for i in range(len(curves)):
        points = curves[i]
        inside = points.min() >= 0 and points[:, 0].max() <= width and points[:, 1].max() <= height
        for piece in [points] if inside else _clip_line(points, width, height):
            if np.ptp(piece, axis=0).max() > MIN_EXTENT:
                pieces.append(piece)
                source.append(i)
                closed.append(bool(curves.closed[i]) and piece is points)
    of = np.array(source, np.int64)
    return (Curves.from_list(pieces, curves.kind[of], closed) if pieces else Curves.empty()), of


def _clip_line(points: np.ndarray, width: int, height: int) -> list[np.ndarray]:
    """Clip every segment of one polyline (n, 2), after Liang and Barsky."""
    a, d = points[:-1], np.diff(points, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = -a / d, (np.array([width, height]) - a) / d
    flat = np.abs(d) < 1e-12
    outside = flat & ((a < 0) | (a > [width, height]))
    t0 = np.where(flat, 0.0, np.minimum(low, high)).max(axis=1).clip(0, 1)
    t1 = np.where(flat, 1.0, np.maximum(low, high)).min(axis=1).clip(0, 1)
    pieces: list[list[np.ndarray]] = []
    for i in np.flatnonzero((t1 > t0) & ~outside.any(axis=1)):
        begin, end = a[i] + t0[i] * d[i], a[i] + t1[i] * d[i]
        if not pieces or t0[i] > 0 or np.abs(pieces[-1][-1] - begin).max() > 1e-9:
            pieces.append([begin])
        pieces[-1].append(end)
    return [np.array(piece) for piece in pieces]
