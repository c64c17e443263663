"""The texture of strokes as true paths: regions of even tone, laid along the stroke.

They are contoured in u and v. Tones are nested, the lightest first: each is painted over the one
before, and what shows through adds up to the opacity and colour that the texture has there on
average. A region's edge is a closed uniform quadratic B-spline: its pieces meet in the middles of
the sides of a polygon, so that path data needs one point a piece (`q`, then `t`). Its numbers are
whole ones, of TONE_UNIT px: a third less text than decimals.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..drawing.ribbon import Ribbon, ribbon
from ..drawing.strokes import Drawing
from ..geometry.curves import CACHED, arc, blocks, counting, owner, simplify_all, take_ragged
from ..geometry.gradients import conjugate_gradients
from ..geometry.polygons import areas, following, isolines
from ..geometry.threads import each
from .crossings import Groups, crossing_groups, separated_groups, united_groups
from .format import TONE_UNIT
from .ink import Inks, inks
from .landmarks import fine_line

SLACK = 3.0  # times the tolerance of an outline: how far the edge of a tone may be off
MAX_POINTS = (
    85_000  # of all polygons: beyond it the slack grows, so that the file can be worked with
)
MAX_SLACK = 0.6  # px, the most that it grows to
PRECISE = 1e-4  # px, to which control points are solved for: they lie on a grid of .3
HELD = 0.05  # weight of the spline through the points kept, beside 1 for each point of a contour
SPECK = 3.0  # times the slack squared: regions and holes of less area are left out
FOLD = 0.97  # of the radius of a bend, from its inside: texels beyond would be laid upside down
MAX_STEP = 1.5  # px, the longest step of a contour that is laid along a bend
COARSE_BINS = 64  # of opacity, for a first look
CLEAR = 3 / 255  # opacity that nobody sees
CACHED_TEXELS = 1 << 18  # of strips that are contoured at a time
CACHED_HISTOGRAMS = 8  # that are divided into levels at a time
NOBODY = np.zeros(0, np.int64)
OUT_OF_REACH = 2.0  # a threshold that no opacity reaches


@dataclass(frozen=True)
class Tones:
    """Regions of even tone.

    Parameters
    ----------
    opacity : (C, K) float64, that each tone is painted with, the lightest first
    color : (C, K, 3) float64 in [0, 1]
    points : (M, 2) int64, polygon points in units of 2 TONE_UNIT
    offsets : (R+1,) of the polygons
    stroke, tone : (R,) whose they are; polygons lie by stroke, then tone, the largest of each first
    """

    opacity: np.ndarray
    color: np.ndarray
    points: np.ndarray
    offsets: np.ndarray
    stroke: np.ndarray
    tone: np.ndarray


class Contours(NamedTuple):
    """Closed contours of tones.

    `xy` (M, 2) are points in px, contour r is rows offsets[r]:offsets[r+1]; `stroke` and `tone`
    (R,) say whose it is.
    """

    xy: np.ndarray
    offsets: np.ndarray
    stroke: np.ndarray
    tone: np.ndarray


def tones(
    drawing: Drawing,
    index: np.ndarray | Sequence[int],
    count: int = 3,
    tolerance: float = 0.1,
    ink: Inks | None = None,
) -> Tones:
    """Divide the texture of the strokes of `index` into `count` tones.

    Their edges lie within SLACK times the `tolerance`, px. `ink` are the inks of all strokes, where
    they are known. Raises ValueError where the drawing has no texture.
    """
    texture = drawing.texture
    if texture is None:
        raise ValueError("only a texture has tones: the drawing has none")
    index = np.asarray(index, np.int64)
    bands = [ribbon(drawing.strokes, i, texture.margin[i]) for i in index]
    rows, strips = take_ragged(texture.offsets, index)
    rgba = texture.rgba[rows]
    alpha = rgba[..., 3].astype(np.float32) / 255.0
    known = None if texture.opacities is None else texture.opacities[index].astype(np.float64)
    ink = ink or inks(texture)
    levels = _levels(alpha, rgba, strips, count, ink.color[index], ink.plain[index], known)
    contours = _contours(alpha, strips, bands, levels.threshold)
    group = contours.stroke * count + contours.tone
    made = _uncrossed(Groups(contours.xy, contours.offsets, group), SLACK * tolerance)
    points, offsets = without_spikes(made.points, made.offsets)
    points, offsets, group = Groups(points, offsets, made.group).those(np.diff(offsets) > 2)
    stroke, tone = np.divmod(group, count)
    order = _largest_first(np.abs(areas(points, offsets)), group)
    rows, offsets = take_ragged(offsets, order)
    opacity = _painted_opacity(levels.level)
    return Tones(opacity, levels.color, points[rows], offsets, stroke[order], tone[order])


def _painted_opacity(level: np.ndarray) -> np.ndarray:
    """The opacities (C, K) of tones, each over those before, that add up to `level` (C, K)."""
    clear = 1.0 - np.concatenate([np.zeros((len(level), 1)), level], axis=1)
    return np.clip(1.0 - clear[:, 1:] / np.maximum(clear[:, :-1], 1e-6), 0, 1)


def _contours(
    alpha: np.ndarray, strips: np.ndarray, bands: list[Ribbon], threshold: np.ndarray
) -> Contours:
    """The contours of strips at thresholds (C, K) of their opacity, laid along their ribbons.

    Strokes are taken some at a time, so that what is worked out of them stays in cache.
    """

    def contoured(few: slice) -> list[Contours]:
        rows = strips[few.start : few.stop + 1]
        own = alpha[rows[0] : rows[-1]], rows - rows[0], bands[few], threshold[few]
        return [part._replace(stroke=part.stroke + few.start) for part in _contours_of(*own)]

    made = each(contoured, blocks(strips, CACHED_TEXELS // alpha.shape[1]))
    parts = [part for some in made for part in some]
    shift = np.cumsum([0] + [len(part.xy) for part in parts])
    begins = [part.offsets[:-1] + a for part, a in zip(parts, shift, strict=False)]
    return Contours(
        np.concatenate([np.zeros((0, 2)), *(part.xy for part in parts)]),
        np.concatenate([*begins, shift[-1:]]),
        np.concatenate([NOBODY, *(part.stroke for part in parts)]),
        np.concatenate([NOBODY, *(part.tone for part in parts)]),
    )


def _contours_of(
    alpha: np.ndarray, strips: np.ndarray, bands: list[Ribbon], threshold: np.ndarray
) -> Iterator[Contours]:
    """The contours of a few strips, tone by tone."""
    wraps = np.array([band.closed for band in bands], bool)
    field, grids = _rimmed(alpha, strips, wraps)
    frames = _joined(
        [_frames(band, rows) for band, rows in zip(bands, np.diff(strips), strict=True)]
    )
    for k in range(threshold.shape[1]):
        at, ends, stroke = isolines(field, grids, wraps, threshold[:, k])
        xy, ends = _laid(at, ends, frames, alpha.shape[1])
        yield Contours(xy, ends, stroke, np.full(len(stroke), k))


# --------------------------------------------------------------------------------------------- tone


class _Levels(NamedTuple):
    """What the tones of each stroke are.

    `level` (C, K) is the opacity that they add up to, `threshold` (C, K) that above which a texel
    is of a tone, and `color` (C, K, 3) what each is painted with.
    """

    level: np.ndarray
    threshold: np.ndarray
    color: np.ndarray


def _levels(
    alpha: np.ndarray,
    rgba: np.ndarray,
    offsets: np.ndarray,
    count: int,
    ink: np.ndarray,
    plain: np.ndarray,
    histogram: np.ndarray | None,
) -> _Levels:
    """Choose the levels of tone of each stroke, and their colours.

    Least squares on the histogram of each stroke's opacity, the lowest level none: the best of
    coarse partitions, then made finer (Lloyd 1982). So the few opacities of a texture that was told
    in tones before are found again. Where there are fewer opacities than levels, the last
    thresholds are out of reach. A `histogram` (C, 256) is one of more than the strip: where strokes
    are of one ink, it says all.
    """
    if histogram is not None and len(histogram) and plain.all():
        told = [_levels_of(one.tobytes(), count) for one in histogram]
        level, threshold = (np.concatenate(some) for some in zip(*told, strict=True))
        wanted = ink[:, None] * level[..., None]
        return _Levels(level, np.maximum(threshold, CLEAR), _painted_color(level, wanted))
    strokes, own = len(offsets) - 1, owner(offsets)
    bins = own[:, None] * 256 + rgba[..., 3]
    if histogram is None:
        histogram = np.bincount(bins.reshape(-1), minlength=strokes * 256)
        histogram = histogram.reshape(strokes, 256).astype(float)
    level, threshold = _distinct(*_refined(histogram, _partitioned(histogram, count)))
    if plain.all():
        wanted = ink[:, None] * level[..., None]
        return _Levels(level, np.maximum(threshold, CLEAR), _painted_color(level, wanted))
    value = np.arange(256) / 255.0
    tone_of_bin = (value[None, :, None] >= threshold[:, None]).sum(axis=2)
    key = np.repeat(own * (count + 1), alpha.shape[1]) + tone_of_bin.reshape(-1)[bins.reshape(-1)]
    mean = _mean_colors(rgba, key, np.repeat(ink, count + 1, axis=0))
    wanted = mean.reshape(strokes, count + 1, 3)[:, 1:] * level[..., None]
    return _Levels(level, np.maximum(threshold, CLEAR), _painted_color(level, wanted))


@functools.lru_cache(maxsize=1 << 12)  # the strokes of a track have one in all frames
def _levels_of(histogram: bytes, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The levels and thresholds (1, K) of one histogram (256,) float64."""
    one = np.frombuffer(histogram)[None]
    return _distinct(*_refined(one, _partitioned(one, count)))


def _refined(histogram: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move levels (C, K) to the means of what is nearest to them; the thresholds between.

    Four times. Then raise all until the stroke is as dark as its texture, by a quarter at most.
    """
    value = np.arange(256) / 255.0
    nothing, row = np.zeros((len(histogram), 1)), np.arange(len(histogram))[:, None]
    below = np.concatenate([nothing, np.cumsum(histogram, axis=1)], axis=1)
    mass = np.concatenate([nothing, np.cumsum(histogram * value, axis=1)], axis=1)
    for _ in range(4):
        threshold = 0.5 * (level + np.concatenate([nothing, level[:, :-1]], axis=1))
        cut = np.ceil(threshold * 255).astype(np.int64)
        cut = np.concatenate([cut, np.full((len(cut), 1), 256)], axis=1)
        number = below[row, cut[:, 1:]] - below[row, cut[:, :-1]]
        level = np.where(
            number > 0,
            (mass[row, cut[:, 1:]] - mass[row, cut[:, :-1]]) / np.maximum(number, 1e-9),
            level,
        )
    shown = (number * level).sum(axis=1)
    darker = (mass[:, -1] / np.maximum(shown, 1e-9)).clip(1.0, 1.25)
    return np.minimum(level * darker[:, None], 1.0), threshold


def _distinct(level: np.ndarray, threshold: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Levels and thresholds (C, K), those that repeat the one before last and out of reach."""
    same = np.diff(level, axis=1, prepend=0.0) < 1.0 / 255.0
    row, last = np.arange(len(level))[:, None], np.argsort(same, axis=1, kind="stable")
    level, threshold = level[row, last], np.where(same, OUT_OF_REACH, threshold)[row, last]
    return np.maximum.accumulate(level, axis=1), threshold  # what is the same again adds nothing


def _mean_colors(rgba: np.ndarray, key: np.ndarray, default: np.ndarray) -> np.ndarray:
    """The mean colour (G, 3) in [0, 1] of groups of texels, `default` (G, 3) where none shows."""
    weight = rgba[..., 3].reshape(-1).astype(np.float64)
    total = np.bincount(key, weight, len(default))
    sums = [np.bincount(key, weight * rgba[..., c].reshape(-1), len(default)) for c in range(3)]
    mean = np.stack(sums, axis=1) / np.maximum(total, 1e-9)[:, None] / 255.0
    return np.where(total[:, None] > 0, mean, default)


def _painted_color(level: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The colours (C, K, 3) of tones that look as `wanted` over those beneath.

    `wanted` (C, K, 3) is premultiplied by `level` (C, K).
    """
    color = np.empty_like(wanted)
    under, clear = np.zeros(wanted[:, 0].shape), np.ones(len(level))
    for k in range(level.shape[1]):
        left = (1.0 - level[:, k]) / np.maximum(clear, 1e-6)  # of what is beneath
        above = wanted[:, k] - left[:, None] * under
        color[:, k] = np.clip(above / np.maximum(1.0 - left, 1e-3)[:, None], 0, 1)
        under, clear = wanted[:, k], 1.0 - level[:, k]
    return color


class _Sums(NamedTuple):
    """Sums (C, COARSE_BINS + 1) over the texels below each bin: of one, opacity, its square."""

    number: np.ndarray
    mass: np.ndarray
    square: np.ndarray


def _partitioned(histogram: np.ndarray, count: int) -> np.ndarray:
    """The mean opacities (C, K) of the parts in which histograms (C, 256) spread least.

    There are K, above one of no opacity. By dynamic programming (Wang and Song 2011) over
    COARSE_BINS.
    """
    few = range(0, len(histogram), CACHED_HISTOGRAMS)
    parts = each(lambda i: _partitioned_few(histogram[i : i + CACHED_HISTOGRAMS], count), few)
    return np.concatenate([np.zeros((0, count)), *parts])


def _partitioned_few(histogram: np.ndarray, count: int) -> np.ndarray:
    """What `_partitioned` gives, of histograms few enough to stay in cache."""
    value = np.arange(256) / 255.0
    moments = np.stack([histogram, histogram * value, histogram * value * value])
    coarse = moments.reshape(3, -1, COARSE_BINS, 256 // COARSE_BINS).sum(axis=3)
    sums = _Sums(*np.pad(np.cumsum(coarse, axis=2), ((0, 0), (0, 0), (1, 0))))
    cuts = _best_cuts(sums, count)
    end, level = np.full((len(histogram), 1), COARSE_BINS), np.zeros((len(histogram), count))
    for k in reversed(range(count)):
        begin = np.take_along_axis(cuts[k], end, axis=1)
        mass, number = (
            np.take_along_axis(s, end, 1) - np.take_along_axis(s, begin, 1)
            for s in (sums.mass, sums.number)
        )
        level[:, k] = (mass / np.maximum(number, 1e-9))[:, 0]
        end = begin
    return np.maximum.accumulate(level, axis=1)


def _best_cuts(sums: _Sums, count: int) -> list[np.ndarray]:
    """For each part, the bin (C, COARSE_BINS + 1) where it best begins by the bin where it ends."""
    # by the bin where a part ends, then where it begins
    n, m, q = (total[:, :, None] - total[:, None, :] for total in sums)
    nothing = ~np.tri(COARSE_BINS + 1, dtype=bool)
    cost = np.where(nothing, np.inf, q - m * m / np.maximum(n, 1e-9))
    best, cuts = sums.square, []
    for _ in range(count):
        total = best[:, None, :] + cost
        cuts.append(total.argmin(axis=2))
        best = np.take_along_axis(total, cuts[-1][..., None], axis=2)[..., 0]
    return cuts


def _rimmed(
    alpha: np.ndarray, offsets: np.ndarray, wraps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Strips with a rim of nothing, stacked: (H, A + 2), offsets.

    Where u wraps, the first row ends it again.
    """
    count = np.diff(offsets) + np.where(wraps, 1, 2)
    grids = np.r_[0, np.cumsum(count)]
    field = np.zeros((grids[-1], alpha.shape[1] + 2), np.float32)
    shift = np.repeat(grids[:-1] + ~wraps - offsets[:-1], np.diff(offsets))
    field[np.arange(len(alpha)) + shift, 1:-1] = alpha
    ends = grids[1:][wraps] - 1
    field[ends] = field[grids[:-1][wraps]]
    return field, grids


# -------------------------------------------------------------------------------------------- place


class _Frames(NamedTuple):
    """Where the rows of rimmed strips lie.

    `xy` (H, 2) are their centres, px; `heading` (H,) is in radians, `half` (H,) the half width in
    px, `curvature` (H,) in 1/px.
    """

    xy: np.ndarray
    heading: np.ndarray
    half: np.ndarray
    curvature: np.ndarray

    def at(self, place: np.ndarray) -> _Frames:
        """Frames (M,) between rows, at rows `place` (M,) float."""
        row = np.minimum(place.astype(np.int64), len(self.half) - 2)
        part = place - row
        before = 1.0 - part

        def between(values: np.ndarray) -> np.ndarray:
            # the next row may be another strip's; of that, no part is taken
            return values.take(row) * before + values[1:].take(row) * part

        xy = np.stack([between(np.ascontiguousarray(column)) for column in self.xy.T], axis=1)
        return _Frames(xy, *map(between, self[1:]))


def _joined(frames: list[_Frames]) -> _Frames:
    none = _Frames(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))
    return _Frames(*(np.concatenate(values) for values in zip(none, *frames, strict=True)))


def _frames(band: Ribbon, rows: int) -> _Frames:
    """What is needed to lay the rows of a rimmed strip along its ribbon."""
    d = np.diff(band.xy, axis=0)
    heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    middle = 0.5 * (band.along[1:] + band.along[:-1])
    along, xy, half, length = band.along, band.xy, band.half, band.length
    if band.closed:
        u = (np.arange(rows + 1) + 0.5) / rows * length
        turn = heading[-1] - heading[0] + (heading[0] - heading[-1] + np.pi) % (2 * np.pi) - np.pi
        middle = np.r_[middle - length, middle, middle + length]
        heading = np.r_[heading - turn, heading, heading + turn]
        along = np.r_[along[:-1], along + length]
        xy, half = np.concatenate([xy[:-1], xy]), np.r_[half[:-1], half]
    else:
        u = np.concatenate([[0.0], (np.arange(rows) + 0.5) / rows, [1.0]]) * length
    bend = np.diff(heading) / np.maximum(np.diff(middle), 1e-9)
    curvature = np.concatenate([[0.0], bend, [0.0]])[
        np.clip(np.searchsorted(middle, u), 0, len(bend) + 1)
    ]
    centre = np.stack([np.interp(u, along, column) for column in xy.T], axis=1)
    return _Frames(centre, np.interp(u, middle, heading), np.interp(u, along, half), curvature)


def _laid(
    at: np.ndarray, offsets: np.ndarray, frames: _Frames, columns: int
) -> tuple[np.ndarray, np.ndarray]:
    """Contours (M, 2) as (row, column) of the stacked strips -> px (M', 2), finer round bends."""
    if not len(at):
        return np.zeros((0, 2)), offsets
    xy = _place(at, frames, columns)
    after = following(len(at), offsets)
    way = xy.take(after, axis=0) - xy
    step = way[:, 0] ** 2 + way[:, 1] ** 2
    far = np.flatnonzero(step > MAX_STEP**2)
    far = far[np.abs(at[after[far], 0] - at[far, 0]) <= 1.0]  # not across a closed stroke's seam
    if not len(far):
        return xy, offsets
    pieces = np.ones(len(at), np.int64)
    pieces[far] = np.clip(np.ceil(np.sqrt(step[far]) / MAX_STEP), 1, 16)
    new, k = counting(pieces), np.repeat(np.arange(len(at)), pieces)
    laid, between = xy.take(k, axis=0), np.flatnonzero(new)
    k = k[between]
    share = (new[between] / pieces[k])[:, None]
    laid[between] = _place(at[k] + share * (at[after[k]] - at[k]), frames, columns)
    return laid, np.r_[0, np.cumsum(pieces)][offsets]


def _place(at: np.ndarray, frames: _Frames, columns: int) -> np.ndarray:
    """Pixels (M, 2) of places (M, 2) as (row, column) of the stacked strips."""
    frame = frames.at(at[:, 0])
    v = np.r_[-1.0, (2.0 * np.arange(columns) + 1.0) / columns - 1.0, 1.0]
    column = np.minimum(at[:, 1].astype(np.int64), columns)
    across = (v[column] + (at[:, 1] - column) * (v[column + 1] - v[column])) * frame.half
    # above 1, the inside of the bend is folded: there all lie on the bend's own centre
    bend = across * frame.curvature
    across = np.where(bend > FOLD, across * FOLD / np.where(bend > FOLD, bend, 1.0), across)
    normal = np.stack([-np.sin(frame.heading), np.cos(frame.heading)], axis=1)
    normal *= across[:, None]
    normal += frame.xy
    return normal


# ------------------------------------------------------------------------------------------ splines


def _uncrossed(contours: Groups, slack: float) -> Groups:
    """The control polygons that `_splines` makes of contours, px, united where splines cross."""
    points, ends, kept = _splines(contours.points, contours.offsets, slack)
    made = Groups(points, ends, contours.group[kept])
    crossed, much = crossing_groups(made)
    if len(much):  # their corners must lie where the contours cross
        whole = united_groups(contours.those(np.isin(contours.group, much)))
        points, ends, kept = _splines(whole.points, whole.offsets, slack)
        others = made.those(~np.isin(made.group, much))
        made = others.joined(Groups(points, ends, whole.group[kept]))
    some = np.isin(made.group, crossed)
    return made.those(~some).joined(separated_groups(made.those(some))) if some.any() else made


def _splines(
    xy: np.ndarray, offsets: np.ndarray, slack: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The control polygons (M, 2) int64 of B-splines near contours (M', 2), px.

    Then their offsets, and which (R,) of the contours they are: specks are left out.
    """
    if not len(xy):
        return np.zeros((0, 2), np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64)
    closed, ends, keep, kept = _thinned(xy, offsets, slack)
    keep[ends[1:] - 1] = False
    offsets = _counted(keep, ends)
    control = _fitted(closed, ends, keep, offsets)
    polygon = np.rint(control / (2 * TONE_UNIT)).astype(np.int64)
    before, _ = _neighbours(offsets)
    keep = (polygon != polygon[before]).any(axis=1)
    polygon, offsets = polygon[keep], _counted(keep, offsets)
    real = np.flatnonzero(np.diff(offsets) > 2)
    rows, offsets = take_ragged(offsets, real)
    return polygon[rows], offsets, kept[real]


def without_spikes(polygon: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leave out of closed polygons (M, 2) what encloses nothing: ways to the same point, or back.

    A spline's piece that ends where it begins would be left out by svgo 4.1.0, and all pieces after
    it would bend the other way: each is told as the reflection of the one before. Returns what is
    left and its offsets; of a polygon that encloses nothing that may be a point or two.
    """
    while True:
        before, after = _neighbours(offsets)
        x, y = (np.ascontiguousarray(axis) for axis in polygon.T)
        keep = (x != x[before]) | (y != y[before])
        if keep.all():
            keep = (x[before] != x[after]) | (y[before] != y[after])
            keep |= (np.diff(offsets) < 3).repeat(np.diff(offsets))
        if keep.all():
            return polygon, offsets
        polygon, offsets = polygon[keep], _counted(keep, offsets)


def _thinned(
    xy: np.ndarray, offsets: np.ndarray, slack: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Contours (M', 2), px, without specks, each with its first point again at its end (M, 2).

    Then their offsets, which (M,) bool of their points are enough, and which (R,) contours they
    are. The slack grows until the points that are enough are MAX_POINTS at most.
    """
    area = np.abs(areas(xy, offsets))
    kept = np.flatnonzero(area > SPECK * slack * slack)
    rows, offsets = take_ragged(offsets, kept)
    closed, ends = _repeated(xy.take(rows, axis=0), offsets)
    enough = np.flatnonzero(simplify_all(closed, ends, slack))
    cuts, left = np.searchsorted(enough, ends), np.arange(len(kept))
    while len(enough) - len(left) > MAX_POINTS and slack < MAX_SLACK:  # the first is there twice
        slack = min(MAX_SLACK, slack * max(1.1, ((len(enough) - len(left)) / MAX_POINTS) ** 0.6))
        big = np.flatnonzero(area[kept[left]] > SPECK * slack * slack)
        rows, cuts = take_ragged(cuts, big)
        enough, left = enough[rows], left[big]
        keep = simplify_all(closed[enough], cuts, slack)
        enough, cuts = enough[keep], _counted(keep, cuts)
    keep = np.zeros(len(closed), bool)
    keep[enough] = True
    rows, ends = take_ragged(ends, left)
    return closed.take(rows, axis=0), ends, keep.take(rows), kept[left]


def _largest_first(area: np.ndarray, group: np.ndarray) -> np.ndarray:
    """An order (R,) by group, the largest of each first: it tells how a stroke was moved."""
    by_area = np.lexsort((-area, group))
    rank = np.ones(len(group))
    rank[by_area[np.diff(group[by_area], prepend=-1) > 0]] = 0
    return np.lexsort((rank, group))


def _fitted(xy: np.ndarray, ends: np.ndarray, keep: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """What `fit_bsplines` gives, some contours at a time, so that they stay in cache."""

    def fit(few: slice) -> np.ndarray:
        own, kept = (every[few.start : few.stop + 1] for every in (ends, offsets))
        rows = slice(own[0], own[-1])
        return fit_bsplines(xy[rows], own - own[0], keep[rows], kept - kept[0])

    return np.concatenate([np.zeros((0, 2)), *each(fit, blocks(ends, CACHED))])


def fit_bsplines(
    xy: np.ndarray, ends: np.ndarray, keep: np.ndarray, offsets: np.ndarray
) -> np.ndarray:
    """Fit closed uniform quadratic B-splines to contours by least squares.

    Each point of a contour counts, at its share of the arc between the two that are kept (Piegl and
    Tiller 1997, 9.4.1). A contour of few points is held to the spline that passes through what is
    kept.

    Parameters
    ----------
    xy : (M, 2), px; contour r is rows ends[r]:ends[r+1] and repeats its first point as its last
    keep : (M,) bool, points near which the middle of a piece shall lie; no last one of a contour
    offsets : (R+1,) of the kept points

    Returns
    -------
    The control points (n, 2), px, one for each point of `keep`.
    """
    before, after = _neighbours(offsets)
    kept = xy[keep]
    # the middle of a piece is at (before + 6 here + after) / 8
    through = 1.25 * kept - 0.125 * (kept[before] + kept[after])
    free = np.ones(len(xy), bool)
    free[ends[1:] - 1] = False
    piece, share = _places(xy, ends, keep, offsets)
    middle, weight = _basis(piece[free], share[free], after)
    # what places say of the control point before the middle one, of that itself and the one after
    columns = [np.ascontiguousarray(axis) for axis in xy[free].T]
    said = [
        np.stack([np.bincount(middle, one * axis, len(kept)) for axis in columns], axis=1)
        for one in weight
    ]
    right = HELD * through + said[0][after] + said[1] + said[2][before]
    product, diagonal = _normal_equations(middle, weight, before, after)
    return conjugate_gradients(product, diagonal, right, through, PRECISE)


def _places(
    xy: np.ndarray, ends: np.ndarray, keep: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where points (M, 2) lie: after which kept one, and at what share of the arc to the next."""
    begin = np.flatnonzero(keep)
    end = begin[_neighbours(offsets)[1]]
    some = np.diff(offsets) > 0
    end[offsets[1:][some] - 1] = ends[1:][some] - 1
    run = arc(xy)
    piece = np.cumsum(keep) - 1
    return piece, (run - run[begin][piece]) / np.maximum(run[end] - run[begin], 1e-9)[piece]


def _basis(
    piece: np.ndarray, share: np.ndarray, after: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The control point (M,) nearest to each place (M,), and weights (3, M).

    They are those of the point before it, of itself and of that after it; no others count there.
    """
    near = share < 0.5
    t = np.where(near, share + 0.5, share - 0.5)
    weight = np.empty((3, len(t)))
    np.multiply(np.square(1 - t), 0.5, out=weight[0])
    np.add(t * (1 - t), 0.5, out=weight[1])
    np.multiply(np.square(t), 0.5, out=weight[2])
    return np.where(near, piece, after[piece]), weight


def _normal_equations(
    middle: np.ndarray, weight: np.ndarray, before: np.ndarray, after: np.ndarray
) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """Make the matrix of the normal equations of splines, HELD: its product, its diagonal (n, 1).

    Places are summed up by control point first: there are several times as many.

    Parameters
    ----------
    middle, weight : (M,) and (3, M), as `_basis` gives them
    before, after : (n,), the control points beside each
    """
    count = len(before)

    def both(a: int, b: int) -> np.ndarray:
        return np.bincount(middle, weight[a] * weight[b], count)

    own = HELD + both(0, 0)[after] + both(1, 1) + both(2, 2)[before]
    one = both(0, 1)[after] + both(1, 2)  # between each and the next
    two = both(0, 2)[after]  # between each and the next but one
    second, first = after[after], before[before]

    def product(xy: np.ndarray) -> np.ndarray:
        at = xy.view(complex)[:, 0]  # a number for each point, which numpy gathers faster
        out = own * at
        out += one * at[after]
        out += (one * at)[before]
        out += two * at[second]
        out += (two * at)[first]
        return out[:, None].view(float)

    return product, own[:, None]


def _counted(keep: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Offsets once only the rows of `keep` are left."""
    return np.r_[0, np.cumsum(keep)][offsets]


def _neighbours(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows before and after each of closed polygons."""
    some = np.flatnonzero(np.diff(offsets))
    first, last = offsets[:-1][some], offsets[1:][some] - 1
    rows = np.arange(offsets[-1])
    before, after = rows - 1, rows + 1
    before[first], after[last] = last, first
    return before, after


def _repeated(xy: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closed polygons with their first points again at their ends."""
    count = np.diff(offsets)
    ring = np.repeat(np.arange(len(count)), count + 1)
    ends = np.r_[0, np.cumsum(count + 1)]
    rows = np.arange(ends[-1]) - ring
    rows[ends[1:] - 1] = offsets[:-1]
    return xy.take(rows, axis=0), ends


# -------------------------------------------------------------------------------------------- paths


class ToneShape(NamedTuple):
    """A tone of a stroke.

    `color` (3,) lies in [0, 1]; `d` is path data in units of TONE_UNIT px, to be filled by the
    nonzero rule; `first` (n, 2) is the polygon of its first ring, in units of 2 TONE_UNIT.
    """

    color: np.ndarray
    opacity: float
    d: str
    first: np.ndarray

    @property
    def edge(self) -> np.ndarray:
        """Its first ring as a fine polyline (n, 2), px."""
        return edge_of(self.first)


def tone_shapes(regions: Tones) -> list[list[ToneShape]]:
    """The tones of each stroke that show, the lightest first."""
    made: list[list[ToneShape]] = [[] for _ in regions.opacity]
    group = regions.stroke * regions.opacity.shape[1] + regions.tone
    begins = np.diff(group, prepend=-1) != 0
    texts = _ring_texts(regions.points, regions.offsets, ~begins)
    bounds = [*np.flatnonzero(begins).tolist(), len(group)]
    for first, end in zip(bounds[:-1], bounds[1:], strict=True):
        stroke, tone = regions.stroke[first], regions.tone[first]
        d = "M" + "".join(texts[first:end])[1:].replace(" -", "-")
        ring = regions.points[slice(*regions.offsets[first : first + 2])]
        shape = ToneShape(regions.color[stroke, tone], regions.opacity[stroke, tone], d, ring)
        made[stroke].append(shape)
    return made


def _ring_texts(points: np.ndarray, offsets: np.ndarray, follows: np.ndarray) -> list[str]:
    """Path data of each polygon's spline.

    One that `follows` (R,) bool another in its path begins relative to that one.
    """
    if not len(points):
        return []
    before, after = _neighbours(offsets)
    middle = points + points[after]  # of the sides
    begin = middle[offsets[1:] - 1]  # each ring from the middle of its last side to its first
    jump = begin - np.where(follows[:, None], np.roll(begin, 1, axis=0), 0)
    jumps, controls, steps = (
        _number_texts(values.reshape(-1))
        for values in (jump, 2 * points[offsets[:-1]] - begin, middle - middle[before])
    )
    texts, ends = [], (2 * offsets).tolist()
    for k, (a, b) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
        k *= 2
        first = " ".join((*controls[k : k + 2], *steps[a : a + 2]))
        texts.append(f"m{jumps[k]} {jumps[k + 1]}q{first}t{' '.join(steps[a + 2 : b])}z")
    return texts


def _number_texts(values: np.ndarray) -> list[str]:
    """Whole numbers (n,) as text.

    Steps along an edge are many and short: where that is so, each number is told once.
    """
    low, high = int(values.min()), int(values.max())
    if high - low >= len(values):
        return [str(value) for value in values.tolist()]
    texts = [str(value) for value in range(low, high + 1)]
    return [texts[value] for value in (values - low).tolist()]


def edge_of(polygon: np.ndarray) -> np.ndarray:
    """Give the spline of a polygon (n, 2), units of 2 TONE_UNIT, as a line (8 n + 1, 2), px."""
    control = 2.0 * polygon
    end = (polygon + np.roll(polygon, -1, axis=0)).astype(np.float64)
    begin = np.roll(end, 1, axis=0)
    near = begin + (control - begin) * 2 / 3, end + (control - end) * 2 / 3
    return TONE_UNIT * fine_line(np.stack([begin, *near, end], axis=1))
