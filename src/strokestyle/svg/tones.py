"""The texture of strokes as true paths: regions of even tone, contoured in u and v and laid along the stroke.

Tones are nested, the lightest first: each is painted over the one before, and what shows through adds up to the opacity
and colour that the texture has there on average. A region's edge is a closed uniform quadratic B-spline: its pieces
meet in the middles of the sides of a polygon, so that path data needs one point a piece (`q`, then `t`). Its numbers
are whole ones, of TONE_UNIT px: a third less text than decimals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, identity
from scipy.sparse.linalg import spsolve

from ..drawing.ribbon import Ribbon, ribbon
from ..drawing.strokes import Drawing
from ..geometry.curves import arc, counting, owner, simplify_all, take_ragged
from ..geometry.polygons import isolines
from .format import TONE_UNIT
from .ink import inks

SLACK = 3.0  # times the tolerance of an outline: how far the edge of a tone may be off
POINTS = 85_000  # of all polygons: beyond it the slack grows, so that a dense drawing stays a file to work with
COARSEST = 0.6  # px, the most that it grows to
HELD = 0.05  # weight of the spline through the points kept, beside 1 for each point of a contour
SPECK = 3.0  # times the slack squared: regions and holes of less area are left out
FOLD = 0.97  # of the radius of a bend, from its inside: texels beyond it would be laid upside down
LONGEST = 1.5  # px, the longest step of a contour that is laid along a bend
COARSE = 64  # bins of opacity for a first look
CLEAR = 3 / 255  # opacity that nobody sees


@dataclass(frozen=True)
class Tones:
    """Regions of even tone.

    Parameters
    ----------
    opacity : (C, K) float64, that each tone is painted with, the lightest first
    color : (C, K, 3) float64 in [0, 1]
    points : (M, 2) int64, polygon points in units of 2 TONE_UNIT
    offsets : (R+1,) of the polygons
    stroke, tone : (R,) whose they are
    """

    opacity: np.ndarray
    color: np.ndarray
    points: np.ndarray
    offsets: np.ndarray
    stroke: np.ndarray
    tone: np.ndarray


def tones(drawing: Drawing, index, count: int = 3, tolerance: float = 0.1) -> Tones:
    """The texture of the strokes of `index` in `count` tones, their edges within SLACK times the tolerance, px."""
    index, texture = np.asarray(index, np.int64), drawing.texture
    bands = [ribbon(drawing.strokes, i, texture.margin[i]) for i in index]
    wraps = np.array([band.closed for band in bands], bool)
    rows, strips = take_ragged(texture.offsets, index)
    rgba = texture.rgba[rows]
    alpha = rgba[..., 3].astype(np.float32) / 255.0
    levels, thresholds, color = _levels(alpha, rgba, strips, count, inks(texture).color[index])
    field, grids = _rimmed(alpha, strips, wraps)
    frames = np.concatenate(
        [_frames(*pair) for pair in zip(bands, np.diff(strips), strict=True)] or [np.zeros((0, 5))]
    )
    rings = []
    for k in range(count):
        at, ends, stroke = isolines(field, grids, wraps, thresholds[:, k])
        xy, ends = _laid(at, ends, frames, texture.rgba.shape[1])
        rings.append((xy, ends, stroke, np.full(len(stroke), k)))
    xy = np.concatenate([ring[0] for ring in rings])
    shift = np.cumsum([0] + [len(ring[0]) for ring in rings])
    ends = np.concatenate(
        [ring[1][:-1] + a for ring, a in zip(rings, shift, strict=False)] + [shift[-1:]]
    )
    stroke, tone = (np.concatenate([ring[k] for ring in rings]) for k in (2, 3))
    points, ends, kept = _splines(xy, ends, SLACK * tolerance)
    order = _largest_first(np.abs(_areas(points, ends)), stroke[kept] * count + tone[kept])
    rows, ends = take_ragged(ends, order)
    points, kept = points[rows], kept[order]
    clear = 1.0 - np.concatenate([np.zeros((len(index), 1)), levels], axis=1)
    opacity = 1.0 - clear[:, 1:] / np.maximum(clear[:, :-1], 1e-6)
    return Tones(np.clip(opacity, 0, 1), color, points, ends, stroke[kept], tone[kept])


# ------------------------------------------------------------------------------------------------------------- tone


def _levels(alpha, rgba, offsets, count, ink):
    """The opacity (C, K) that each stroke's tones add up to, the thresholds (C, K) between them, and colours (C, K, 3).

    Least squares on each stroke's histogram of opacity, the lowest level none: the best of coarse partitions, then made
    finer (Lloyd 1982). So the few opacities of a texture that was told in tones before are found again. Then all are
    raised until the stroke is as dark as its texture. Where there are fewer opacities than levels, the last thresholds
    are out of reach.
    """
    strokes, own = len(offsets) - 1, owner(offsets)
    bins = np.rint(alpha * 255).astype(np.int64)
    flat = (own[:, None] * 256 + bins).reshape(-1)
    histogram = np.bincount(flat, minlength=strokes * 256).reshape(strokes, 256).astype(np.float64)
    value = np.arange(256) / 255.0
    below = np.concatenate([np.zeros((strokes, 1)), np.cumsum(histogram, axis=1)], axis=1)
    mass = np.concatenate([np.zeros((strokes, 1)), np.cumsum(histogram * value, axis=1)], axis=1)
    level = _partitioned(histogram, count)
    row = np.arange(strokes)[:, None]
    for _ in range(4):
        threshold = 0.5 * (level + np.concatenate([np.zeros((strokes, 1)), level[:, :-1]], axis=1))
        cut = np.concatenate(
            [np.ceil(threshold * 255).astype(np.int64), np.full((strokes, 1), 256)], axis=1
        )
        number = below[row, cut[:, 1:]] - below[row, cut[:, :-1]]
        level = np.where(
            number > 0,
            (mass[row, cut[:, 1:]] - mass[row, cut[:, :-1]]) / np.maximum(number, 1e-9),
            level,
        )
    shown = (number * level).sum(axis=1)
    level = np.minimum(
        level * (mass[:, -1] / np.maximum(shown, 1e-9)).clip(1.0, 1.25)[:, None], 1.0
    )
    same = np.diff(level, axis=1, prepend=0.0) < 1.0 / 255.0
    last = np.argsort(same, axis=1, kind="stable")
    level, threshold = level[row, last], np.where(same, 2.0, threshold)[row, last]
    level = np.maximum.accumulate(level, axis=1)  # what is the same again adds nothing
    # the mean colour of what lies between two thresholds, and of what makes it so over the tone below
    place = (value[None, :, None] >= threshold[:, None]).sum(axis=2)
    tone = place.reshape(-1)[flat]
    key = np.repeat(own * (count + 1), alpha.shape[1]) + tone
    weight = rgba[..., 3].reshape(-1).astype(np.float64)
    total = np.bincount(key, weight, strokes * (count + 1))
    mean = np.stack(
        [
            np.bincount(key, weight * rgba[..., c].reshape(-1), strokes * (count + 1))
            for c in range(3)
        ],
        axis=1,
    )
    mean = np.where(
        total[:, None] > 0,
        mean / np.maximum(total, 1e-9)[:, None] / 255.0,
        np.repeat(ink, count + 1, axis=0),
    )
    wanted = mean.reshape(strokes, count + 1, 3)[:, 1:] * level[..., None]
    color, under, clear = np.empty((strokes, count, 3)), np.zeros((strokes, 3)), np.ones(strokes)
    for k in range(count):
        left = (1.0 - level[:, k]) / np.maximum(clear, 1e-6)  # of what is beneath
        color[:, k] = np.clip(
            (wanted[:, k] - left[:, None] * under) / np.maximum(1.0 - left, 1e-3)[:, None], 0, 1
        )
        under, clear = wanted[:, k], 1.0 - level[:, k]
    return level, np.maximum(threshold, CLEAR), color


def _partitioned(histogram, count):
    """Mean opacities (C, K) of the K parts, above one of no opacity, in which histograms (C, 256) spread least.

    By dynamic programming (Wang and Song 2011) over COARSE bins.
    """
    value = np.arange(256) / 255.0
    sums = np.stack([histogram, histogram * value, histogram * value * value]).reshape(
        3, -1, COARSE, 256 // COARSE
    )
    number, mass, square = np.pad(np.cumsum(sums.sum(axis=3), axis=2), ((0, 0), (0, 0), (1, 0)))
    n, m, q = (total[:, None, :] - total[:, :, None] for total in (number, mass, square))
    cost = np.where(
        np.tri(COARSE + 1, k=-1, dtype=bool), np.inf, q - m * m / np.maximum(n, 1e-9)
    )  # of bins i to j - 1
    best, cuts = square, []
    for _ in range(count):
        total = best[:, :, None] + cost
        cuts.append(total.argmin(axis=1))
        best = np.take_along_axis(total, cuts[-1][:, None], axis=1)[:, 0]
    end, level = np.full((len(histogram), 1), COARSE), np.zeros((len(histogram), count))
    for k in reversed(range(count)):
        begin = np.take_along_axis(cuts[k], end, axis=1)
        part, share = (
            np.take_along_axis(s, end, 1) - np.take_along_axis(s, begin, 1) for s in (mass, number)
        )
        level[:, k] = (part / np.maximum(share, 1e-9))[:, 0]
        end = begin
    return np.maximum.accumulate(level, axis=1)


def _rimmed(alpha, offsets, wraps):
    """Strips with a rim of nothing, stacked: (H, A + 2), offsets. Where u wraps the first row ends it again."""
    count = np.diff(offsets) + np.where(wraps, 1, 2)
    grids = np.r_[0, np.cumsum(count)]
    field = np.zeros((grids[-1], alpha.shape[1] + 2), np.float32)
    field[
        np.arange(len(alpha)) + np.repeat(grids[:-1] + ~wraps - offsets[:-1], np.diff(offsets)),
        1:-1,
    ] = alpha
    ends = grids[1:][wraps] - 1
    field[ends] = field[grids[:-1][wraps]]
    return field, grids


# ------------------------------------------------------------------------------------------------------------ place


def _frames(band: Ribbon, rows: int) -> np.ndarray:
    """What is needed to lay the rows of a rimmed strip: centre x and y, heading, half width, curvature, (H, 5)."""
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
        u = np.r_[0.0, (np.arange(rows) + 0.5) / rows, 1.0] * length
    bend = np.diff(heading) / np.maximum(np.diff(middle), 1e-9)
    piece = np.searchsorted(middle, u)
    curvature = np.r_[0.0, bend, 0.0][np.clip(piece, 0, len(bend) + 1)]
    columns = [
        np.interp(u, along, xy[:, 0]),
        np.interp(u, along, xy[:, 1]),
        np.interp(u, middle, heading),
    ]
    return np.stack([*columns, np.interp(u, along, half), curvature], axis=1)


def _laid(at, offsets, frames, columns):
    """Contours (M, 2) as (row, column) of the stacked strips -> pixels (M', 2), with points added round bends."""
    if not len(at):
        return np.zeros((0, 2)), offsets
    xy = _place(at, frames, columns)
    after = np.arange(1, len(at) + 1)
    after[offsets[1:] - 1] = offsets[:-1]
    step = np.hypot(*(xy[after] - xy).T)
    pieces = np.clip(np.ceil(step / LONGEST), 1, 16).astype(np.int64)
    pieces[np.abs(at[after, 0] - at[:, 0]) > 1.0] = 1  # across the seam of a closed stroke
    if (pieces == 1).all():
        return xy, offsets
    k = np.repeat(np.arange(len(at)), pieces)
    j = counting(pieces)
    fine = at[k] + (j / pieces[k])[:, None] * (at[after] - at)[k]
    return _place(fine, frames, columns), np.r_[0, np.cumsum(pieces)][offsets]


def _place(at, frames, columns):
    row = np.minimum(at[:, 0].astype(np.int64), len(frames) - 2)
    part = (at[:, 0] - row)[:, None]
    frame = frames[row] * (1.0 - part) + np.where(part > 0, frames[row + 1], 0.0) * part
    v = np.r_[-1.0, (2.0 * np.arange(columns) + 1.0) / columns - 1.0, 1.0]
    column = np.minimum(at[:, 1].astype(np.int64), columns)
    across = (v[column] + (at[:, 1] - column) * (v[column + 1] - v[column])) * frame[:, 3]
    bend = (
        across * frame[:, 4]
    )  # above 1, the inside of the bend is folded: there all lie on the bend's own centre
    across = np.where(bend > FOLD, across * FOLD / np.where(bend > FOLD, bend, 1.0), across)
    return frame[:, :2] + across[:, None] * np.stack(
        [-np.sin(frame[:, 2]), np.cos(frame[:, 2])], axis=1
    )


# ------------------------------------------------------------------------------------------------------------ paths


def _splines(xy, offsets, slack):
    """The polygons (M, 2) int64, their offsets, and which (R,) of the contours they are, of B-splines near contours."""
    if not len(xy):
        return np.zeros((0, 2), np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64)
    kept = np.flatnonzero(np.abs(_areas(xy, offsets)) > SPECK * slack * slack)
    rows, offsets = take_ragged(offsets, kept)
    closed, ends = _repeated(xy[rows], offsets)
    keep = np.ones(len(closed), bool)
    while True:
        keep[keep] = simplify_all(closed[keep], _counted(keep, ends), slack)
        count = keep.sum() - len(kept)  # the first points are there twice
        if count <= POINTS or slack >= COARSEST:
            break
        slack = min(COARSEST, slack * max(1.1, (count / POINTS) ** 0.6))
        big = np.flatnonzero(np.abs(_areas(closed, ends)) > SPECK * slack * slack)
        rows, ends = take_ragged(ends, big)
        closed, keep, kept = closed[rows], keep[rows], kept[big]
    keep[ends[1:] - 1] = False
    offsets = _counted(keep, ends)
    polygon = np.rint(_fitted(closed, ends, keep, offsets) / (2 * TONE_UNIT)).astype(np.int64)
    before, _ = _neighbours(offsets)
    keep = (polygon != polygon[before]).any(axis=1)
    polygon, offsets = polygon[keep], _counted(keep, offsets)
    real = np.flatnonzero(np.diff(offsets) > 2)
    rows, offsets = take_ragged(offsets, real)
    return polygon[rows], offsets, kept[real]


def _largest_first(area, group):
    """An order (R,) by group, the largest of each first: from it a reader tells how a stroke was moved."""
    by_area = np.lexsort((-area, group))
    rank = np.ones(len(group))
    rank[by_area[np.diff(group[by_area], prepend=-1) > 0]] = 0
    return np.lexsort((rank, group))


def _fitted(xy, ends, keep, offsets):
    """The control points (n, 2) of the B-splines nearest to contours (M, 2) that repeat their first points, px.

    One for each point of `keep`, near which the middle of its piece lies: least squares over all points, each at its
    share of the arc between the two that are kept (Piegl and Tiller 1997, 9.4.1). A contour of few points is held to
    the spline that passes through what is kept.
    """
    before, after = _neighbours(offsets)
    kept = xy[keep]
    through = 1.25 * kept - 0.125 * (
        kept[before] + kept[after]
    )  # the middle is at (before + 6 here + after) / 8
    free = np.ones(len(xy), bool)
    free[ends[1:] - 1] = False
    begin = np.flatnonzero(keep)
    end = begin[after]
    last = offsets[1:][np.diff(offsets) > 0] - 1
    end[last] = ends[1:][np.diff(offsets) > 0] - 1
    run = arc(xy)
    piece = (np.cumsum(keep) - 1)[free]
    share = (run[free] - run[begin][piece]) / np.maximum(run[end] - run[begin], 1e-9)[piece]
    middle = np.where(share < 0.5, piece, after[piece])
    t = share + np.where(share < 0.5, 0.5, -0.5)
    basis = np.stack([0.5 * (1 - t) ** 2, 0.5 + t * (1 - t), 0.5 * t * t], axis=1)
    columns = np.stack([before[middle], middle, after[middle]], axis=1)
    shape = (len(t), len(kept))
    matrix = csr_array(
        (basis.reshape(-1), columns.reshape(-1), np.arange(0, 3 * len(t) + 1, 3)), shape
    )
    normal = (matrix.T @ matrix + HELD * identity(len(kept))).tocsc()
    return spsolve(normal, matrix.T @ xy[free] + HELD * through)


def _counted(keep, offsets):
    """Offsets once only the rows of `keep` are left."""
    return np.r_[0, np.cumsum(keep)][offsets]


def _neighbours(offsets):
    """The rows before and after each of closed polygons."""
    some = np.flatnonzero(np.diff(offsets))
    rows = np.arange(offsets[-1])
    before, after = rows - 1, rows + 1
    before[offsets[:-1][some]], after[offsets[1:][some] - 1] = (
        offsets[1:][some] - 1,
        offsets[:-1][some],
    )
    return before, after


def _repeated(xy, offsets):
    """Closed polygons with their first points again at their ends."""
    count = np.diff(offsets)
    ring = np.repeat(np.arange(len(count)), count + 1)
    ends = np.r_[0, np.cumsum(count + 1)]
    rows = np.arange(ends[-1]) - ring
    rows[ends[1:] - 1] = offsets[:-1]
    return xy[rows], ends


def _areas(xy, offsets):
    _, after = _neighbours(offsets)
    cross = np.r_[0.0, np.cumsum(xy[:, 0] * xy[after, 1] - xy[:, 1] * xy[after, 0])]
    return 0.5 * np.diff(cross[offsets])


def tone_paths(regions: Tones) -> list[list[tuple[np.ndarray, float, str]]]:
    """For each stroke, colour (3,), opacity and path data of its tones, the lightest first.

    In units of TONE_UNIT px, to be filled by the nonzero rule.
    """
    points, offsets = regions.points, regions.offsets
    paths = [[[] for _ in range(regions.opacity.shape[1])] for _ in range(len(regions.opacity))]
    if len(points):
        before, after = _neighbours(offsets)
        middle = points + points[after]  # of the sides
        begin = middle[offsets[1:] - 1]  # each ring from the middle of its last side to its first
        group = regions.stroke * regions.opacity.shape[1] + regions.tone
        same = np.r_[False, group[1:] == group[:-1]]
        jump = begin - np.where(same[:, None], np.roll(begin, 1, axis=0), 0)
        jumps, controls, steps = (
            [str(value) for value in values.reshape(-1).tolist()]
            for values in (jump, 2 * points[offsets[:-1]] - begin, middle - middle[before])
        )
        ends = offsets.tolist()
        rings = zip(
            regions.stroke.tolist(), regions.tone.tolist(), ends[:-1], ends[1:], strict=True
        )
        for k, (stroke, tone, a, b) in enumerate(rings):
            first = " ".join((*controls[2 * k : 2 * k + 2], *steps[2 * a : 2 * a + 2]))
            paths[stroke][tone].append(
                f"m{jumps[2 * k]} {jumps[2 * k + 1]}q{first}t{' '.join(steps[2 * a + 2 : 2 * b])}z"
            )
    made = []
    for stroke, layers in enumerate(paths):
        shown = [
            (k, "M" + "".join(rings)[1:].replace(" -", "-"))
            for k, rings in enumerate(layers)
            if rings
        ]
        made.append([(regions.color[stroke, k], regions.opacity[stroke, k], d) for k, d in shown])
    return made
