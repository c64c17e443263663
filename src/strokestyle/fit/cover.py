"""How much of every pixel lies under strokes, and how that changes with them, without torch.

What `render.coverage` computes for the paper's networks, which says how; here for one image on the
CPU, with the derivatives written out. A test holds both to the same numbers. Importing torch takes
longer than tracing a drawing does. A pixel that lies wholly under one segment, as most do, is only
noted: whatever else touches it, it is full, and no small move changes that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

REACH = 0.75  # px: an edge farther than sqrt(1/2) from a pixel's centre does not touch the pixel
FULL = 0.708  # px, just beyond sqrt(1/2): nor does one this far outside it, which leaves it full
SLACK = 1e-3  # px by which slabs and cones overlap, so that rounding leaves no pixel between them
FAR = 1e9  # px: no edge at all
SEEN_RADIUS = 0.01  # px by which strokes are looked for as if thicker: one of no thickness can grow
MIN_EXTRA = 1e-3  # of a pixel: the least that a second element must add to a first to count
TINY = 1e-6  # px: a segment this short has no direction of its own


class _Elements(NamedTuple):
    """What strokes are made of: the slabs of all segments first, then a disc at every point.

    table (6, E): start x and y, vector x and y to the end, radius at the start, and its change
    along the vector, the taper; of a disc vector and taper are 0. stroke (E,) says whose an element
    is, begin (S,) the points where segments begin.
    """

    table: np.ndarray
    stroke: np.ndarray
    begin: np.ndarray

    @classmethod
    def of(cls, xy: np.ndarray, radius: np.ndarray, offsets: np.ndarray) -> _Elements:
        stroke = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
        begin = np.flatnonzero(stroke[:-1] == stroke[1:])
        point = np.concatenate([xy.T, radius[None]]).astype(np.float32)
        slabs, discs = point[:, begin], np.zeros((6, len(xy)), np.float32)
        step = point[:, begin + 1] - slabs
        discs[[0, 1, 4]] = point
        table = np.concatenate([slabs[:2], step[:2], slabs[2:], step[2:]])
        return cls(
            np.concatenate([table, discs], axis=1), np.concatenate([stroke[begin], stroke]), begin
        )

    @property
    def reach(self) -> np.ndarray:
        """How far from the centre line a pixel's centre may lie to be touched, (E,) px."""
        return self.table[4] + np.maximum(self.table[5], 0) + np.float32(REACH)

    def core(self, length: np.ndarray) -> np.ndarray:
        """How far from a slab's centre line all pixels are full, (S,) px; below 0, none is.

        `length` (S,) px is the segments'.
        """
        _, _, _, _, radius, taper = self.table[:, : len(length)]
        incline = taper / np.maximum(length, np.float32(TINY))
        return radius + np.minimum(taper, 0) - FULL * np.sqrt(1 + incline * incline)

    def pulled(self, gradient: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
        """Turn derivatives by the table (6, E) into such by xy (N, 2) and radius (N,)."""
        slabs, discs = gradient[:, : len(self.begin)], gradient[:, len(self.begin) :]
        out = discs[[0, 1, 4]].copy()
        along = slabs[[2, 3, 5]]
        out[:, self.begin] += slabs[[0, 1, 4]] - along  # no point begins or ends two segments
        out[:, self.begin + 1] += along
        return out[:2].T, out[2]


class _Pairs(NamedTuple):
    """Pixels P and elements near them, and the element's edge there as a straight line; all (P,).

    dx, dy : px, from the element's start to the pixel's centre
    along : of the vector, where the pixel lies beside it; `free`, whether between its ends
    nx, ny : the edge's normal, unit, away from the centre line
    distance : px, from the centre line
    radius : px, there
    tilt : cosine of the edge's angle to the centre line
    sag : px by which a round edge falls away from its tangent, on average over a pixel
    major, minor : the larger and the smaller of the normal's parts, by size
    """

    element: np.ndarray
    pixel: np.ndarray
    dx: np.ndarray
    dy: np.ndarray
    along: np.ndarray
    free: np.ndarray
    nx: np.ndarray
    ny: np.ndarray
    distance: np.ndarray
    radius: np.ndarray
    tilt: np.ndarray
    sag: np.ndarray
    major: np.ndarray
    minor: np.ndarray

    def cover(self, extra: float = 0.0) -> np.ndarray:
        """Cover of the pixels by the elements (P,), their radius larger by `extra` px."""
        outer, inner = self._inside(extra)
        return self._area(outer) - self._area(inner)

    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """The derivatives of the cover by the radius and by the distance (P,)."""
        outer, inner = (self._slope(inside) * self.tilt for inside in self._inside(0.0))
        return outer + inner, inner - outer

    def _inside(self, extra: float) -> tuple[np.ndarray, np.ndarray]:
        """How far beyond the pixel's centre the near and the far edge lie, px."""
        radius = self.radius + np.float32(extra)
        sag = self.sag
        return (
            (radius - self.distance) * self.tilt - sag,
            -(radius + self.distance) * self.tilt - sag,
        )

    def _area(self, inside: np.ndarray) -> np.ndarray:
        """Area of the unit pixel in a half plane; `coverage._half_plane` has the formula."""
        half, flat = 0.5 * (self.major + self.minor), 0.5 * (self.major - self.minor)
        s = np.clip(inside, -half, half)
        tail = np.maximum(np.abs(s) - flat, 0)
        return 0.5 + s / self.major - np.copysign(tail * tail, s) / (2 * self.major * self.minor)

    def _slope(self, inside: np.ndarray) -> np.ndarray:
        """The derivative of `_area`: the length of the edge in the pixel."""
        away = np.abs(inside)
        half, flat = 0.5 * (self.major + self.minor), 0.5 * (self.major - self.minor)
        tail = np.maximum(away - flat, 0)
        return np.where(away <= half, (1 - tail / self.minor) / self.major, 0)


@dataclass(frozen=True)
class Cover:
    """How much of the pixels lies under strokes; of those not named, nothing.

    Parameters
    ----------
    full : (R,) numbers, row by row, of pixels that lie wholly under a segment
    pixel : (Q,) those of others near strokes
    value : (Q,) float32, in [0, 1]
    """

    full: np.ndarray
    pixel: np.ndarray
    value: np.ndarray
    _elements: _Elements
    _pairs: _Pairs
    _place: np.ndarray
    _slope: np.ndarray

    def pull(self, gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives by xy (N, 2) and thickness (N,), of what changes by `gradient` (Q,).

        Normals are constants: to first order an edge moves the area by its own shift alone.
        """
        pairs, elements = self._pairs, self._elements
        pull = gradient[self._place] * self._slope
        by_radius, by_distance = (pull * slope for slope in pairs.slopes())
        ex, ey, taper = elements.table[[2, 3, 5]][:, pairs.element]
        square = np.maximum(ex * ex + ey * ey, 1e-12)
        by_along = np.where(pairs.free, by_radius * taper / square, 0)
        back = 2 * pairs.along
        columns = (
            -by_distance * pairs.nx - by_along * ex,
            -by_distance * pairs.ny - by_along * ey,
            -by_distance * pairs.along * pairs.nx + by_along * (pairs.dx - back * ex),
            -by_distance * pairs.along * pairs.ny + by_along * (pairs.dy - back * ey),
            by_radius,
            by_radius * pairs.along,
        )
        count = elements.table.shape[1]
        table = np.stack([np.bincount(pairs.element, column, count) for column in columns])
        xy, radius = elements.pulled(table, count - len(elements.begin))
        return xy, 0.5 * radius


def cover_strokes(
    xy: np.ndarray, thickness: np.ndarray, offsets: np.ndarray, height: int, width: int
) -> Cover:
    """Measure how much of every pixel lies under strokes, in float32.

    Parameters
    ----------
    xy : (N, 2) px, pixel centres at + 1/2
    thickness : (N,) px, full width, round caps and joins; below 0 counts as 0, with its derivative
    offsets : (C+1,) int, stroke i is rows offsets[i]:offsets[i+1]; a stroke of one point is a dot
    height, width : canvas in pixels; strokes may lie partly or wholly outside
    """
    elements = _Elements.of(xy, 0.5 * np.maximum(thickness, 0), offsets)
    near = _near(elements, offsets, height, width)
    full = np.zeros(height * width, bool)
    full[near.full] = True
    open_ = np.flatnonzero(~full[near.pixel])
    pairs = _look(elements, near.element[open_], near.pixel[open_], width)
    pixel, place = _places(pairs.pixel, height * width)
    first, second, cosine = _decisive(pairs, place, len(pixel), elements)
    covers = pairs.cover()
    value, slope = covers[first], np.zeros_like(covers)
    slope[first] = 1
    crossed = np.flatnonzero(second >= 0)
    one, other = first[crossed], second[crossed]
    value[crossed], slope[one], slope[other] = _union(covers[one], covers[other], cosine[crossed])
    return Cover(np.flatnonzero(full), pixel, value, elements, pairs, place, slope)


def _places(pixel: np.ndarray, pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """Number the pixels (P,) that there are: these, ordered (Q,), and where each is (P,)."""
    there = np.zeros(pixels, bool)
    there[pixel] = True
    every = np.flatnonzero(there)
    place = np.empty(pixels, np.int32)
    place[every] = np.arange(len(every))
    return every, place[pixel]


def _look(elements: _Elements, element: np.ndarray, pixel: np.ndarray, width: int) -> _Pairs:
    """Measure pairs of elements and pixels (P,)."""
    x, y, ex, ey, radius, taper = elements.table.take(element, axis=1)
    row = pixel // width
    dx = (pixel - row * width).astype(np.float32) + np.float32(0.5) - x
    dy = row.astype(np.float32) + np.float32(0.5) - y
    square = np.maximum(ex * ex + ey * ey, np.float32(1e-12))
    length = np.sqrt(square)
    raw = (dx * ex + dy * ey) / square
    along = np.clip(raw, 0, 1)
    slab = element < len(elements.begin)
    side = np.where(dx * ey - dy * ex > 0, np.float32(-1), np.float32(1)) / length
    away = np.maximum(np.sqrt(dx * dx + dy * dy), np.float32(1e-9))
    nx, ny = np.where(slab, -ey * side, dx / away), np.where(slab, ex * side, dy / away)
    incline = taper / length * slab
    sag = np.where(slab, 0, 1 / (24 * np.maximum(radius, np.float32(0.5))))
    wide, high = np.abs(nx), np.abs(ny)
    return _Pairs(
        element,
        pixel,
        dx,
        dy,
        along,
        raw == along,
        nx,
        ny,
        (dx - along * ex) * nx + (dy - along * ey) * ny,
        radius + along * taper,
        1 / np.sqrt(1 + incline * incline),
        sag.astype(np.float32),
        np.maximum(wide, high),
        np.maximum(np.minimum(wide, high), np.float32(1e-4)),
    )


def _decisive(
    pairs: _Pairs, place: np.ndarray, places: int, elements: _Elements
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Choose, for each of the pixels (Q,), the pair that covers it most and the one that adds most.

    `place` (P,) says which pixel is a pair's, of so many `places`. Returns the pairs (Q,), the
    second ones (Q,), -1 where there is none, and the cosine (Q,) of the angle between the normals
    of both.
    """
    cover = pairs.cover(SEEN_RADIUS)
    first = _best(cover, place, places)
    mine = first[place]
    # what is alone in its pixel, as most are, has no rival
    rivals = np.flatnonzero(mine != np.arange(len(mine)))
    mine = mine[rivals]
    cosine = pairs.nx[rivals] * pairs.nx[mine] + pairs.ny[rivals] * pairs.ny[mine]
    extra = _union(cover[mine], cover[rivals], cosine)[0] - cover[mine]
    # within one stroke a point's disc only rounds a turn; what it adds to its neighbours' slabs is
    # theirs already
    slabs = len(elements.begin)
    one, other = pairs.element[rivals], pairs.element[mine]
    rounding = (elements.stroke[one] == elements.stroke[other]) & ~((one < slabs) & (other < slabs))
    keep = np.flatnonzero((extra > MIN_EXTRA) & ~rounding)
    best = _best(extra[keep], place[rivals[keep]], places)
    crossed = np.flatnonzero(best >= 0)
    second, between = np.full(places, -1), np.zeros(places, np.float32)
    chosen = keep[best[crossed]]
    second[crossed], between[crossed] = rivals[chosen], cosine[chosen]
    return first, second, between


def _best(value: np.ndarray, place: np.ndarray, places: int) -> np.ndarray:
    """Index of the largest value at every place (places,), the first of equals; -1: it has none."""
    top = np.full(places, -1, value.dtype)
    np.maximum.at(top, place, value)
    index = np.flatnonzero(value == top[place])[::-1]
    best = np.full(places, -1)
    best[place[index]] = index  # the last that is written stays: the first of equals
    return best


def _union(
    a: np.ndarray, b: np.ndarray, cosine: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Area of the union of two covers (P,), and its derivatives by both; see `coverage._union`."""
    alike, apart = np.maximum(cosine, 0), np.maximum(-cosine, 0)
    chance, free = 1 - alike - apart, a + b <= 1
    area = alike * np.maximum(a, b) + apart * np.minimum(a + b, 1) + chance * (a + b - a * b)
    both = apart * free
    by_a = alike * (0.5 * (a >= b) + 0.5 * (a > b)) + both + chance * (1 - b)
    by_b = alike * (0.5 * (b >= a) + 0.5 * (b > a)) + both + chance * (1 - a)
    return area, by_a, by_b


# --------------------------------------------------------------------------- which pixels are near


class _Strip(NamedTuple):
    """The points p, from an element's start, for which low <= (gx, gy) . p <= high; all (E,)."""

    low: np.ndarray
    high: np.ndarray
    gx: np.ndarray
    gy: np.ndarray

    def interval(self, dy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The x at which rows `dy` below the start enter and leave it."""
        gx = np.where(np.abs(self.gx) < 1e-7, np.float32(1e-7), self.gx)
        rest = self.gy * dy
        a, b = (self.low - rest) / gx, (self.high - rest) / gx
        return np.clip(np.minimum(a, b), -FAR, FAR), np.clip(np.maximum(a, b), -FAR, FAR)


class _Near(NamedTuple):
    """Pairs of elements (P,) and pixels (P,) in reach of their edges, and full pixels (R,)."""

    element: np.ndarray
    pixel: np.ndarray
    full: np.ndarray


def _near(elements: _Elements, offsets: np.ndarray, height: int, width: int) -> _Near:
    """Find the pixels within the slab or cone of an element, and in reach of it.

    An element is an intersection of two strips, and of a disc where it is no slab, so in one row
    of pixels it is an interval. In the middle of a slab's are those that are full.
    """
    count = len(elements.begin)
    tangent, length = _directions(elements.table[2:4, :count].T, elements.stroke[:count])
    strips = _strips(elements, offsets, tangent, length)
    rows, top = _rows(elements, tangent * length[:, None], strips[1].gy, height)
    rows[:count][length == 0] = 0
    element, row = _expand(rows)
    row += top[element]
    x, y = elements.table[:2].take(element, axis=1)
    disc = elements.reach.copy()
    disc[:count] = FAR  # a slab has none
    fields = [_Strip(*(a.take(element) for a in strip)) for strip in strips]
    dy = row.astype(np.float32) + np.float32(0.5) - y
    (left1, right1), (left2, right2) = (strip.interval(dy) for strip in fields)
    disc = disc.take(element)
    chord = np.sqrt(np.maximum(disc * disc - dy * dy, 0))
    left, right = np.maximum(left1, -chord), np.minimum(right1, chord)
    begin, end = _columns(np.maximum(left, left2) + x, np.minimum(right, right2) + x, width)
    core = np.full(len(elements.stroke), -FAR, np.float32)  # a cone has none
    core[:count] = elements.core(length)
    core = core.take(element)
    left2, right2 = fields[1]._replace(low=-core, high=core).interval(dy)
    left, right = np.maximum(left, left2) + x, np.minimum(right, right2) + x
    first, last = _columns(np.where(core > 0, left, FAR), right, width)
    inner = np.maximum(last - first, 0)
    before = np.where(inner > 0, first, end) - begin
    pick, column = _expand(end - begin - inner)
    column += np.where(column >= before[pick], inner[pick], 0)
    start = row * width + begin
    within, place = _expand(inner)
    return _Near(element[pick], start[pick] + column, (row * width + first)[within] + place)


def _columns(left: np.ndarray, right: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The pixels of a row whose centres lie from x to x: the first, and that after the last."""
    first = np.clip(np.ceil(left - np.float32(0.5 + SLACK)), 0, width).astype(np.int64)
    last = np.clip(np.floor(right - np.float32(0.5 - SLACK)), -1, width - 1).astype(np.int64)
    return first, np.maximum(last + 1, first)


def _directions(vector: np.ndarray, stroke: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit tangent (S, 2) and length (S,) of segments.

    One of no length takes its neighbour's tangent, a stroke of no length (1, 0).
    """
    length = np.hypot(vector[:, 0], vector[:, 1])
    good = length > TINY
    tangent = vector / np.maximum(length, np.float32(TINY))[:, None]
    if not good.all():
        index, last = np.arange(len(vector)), len(vector) - 1
        before = np.maximum(np.maximum.accumulate(np.where(good, index, -1)), 0)
        after = np.where(good, index, last + 1)[::-1]
        after = np.minimum(np.minimum.accumulate(after)[::-1], last)
        source = np.where(good[before] & (stroke[before] == stroke), before, after)
        known = good[source] & (stroke[source] == stroke)
        tangent = np.where(known[:, None], tangent[source], np.array([1.0, 0.0], np.float32))
    return tangent, np.where(good, length, np.float32(0))


def _strips(
    elements: _Elements, offsets: np.ndarray, tangent: np.ndarray, length: np.ndarray
) -> tuple[_Strip, _Strip]:
    """The two strips of each element.

    A slab lies along and across its segment; a point's cone lies ahead of the segment that arrives
    and behind the one that leaves.
    """
    count = len(tangent)
    points = len(elements.stroke) - count
    inward, outward = (np.zeros((points, 2), np.float32) for _ in range(2))
    outward[elements.begin], inward[elements.begin + 1] = tangent, tangent
    across = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    reach, far = elements.reach[:count], np.full(points, FAR, np.float32)
    low = np.full(count + points, -SLACK, np.float32)
    return (
        _Strip(
            low,
            np.concatenate([length + np.float32(SLACK), far]),
            *np.concatenate([tangent, inward]).T,
        ),
        _Strip(
            np.concatenate([-reach, -far]),
            np.concatenate([reach, np.full_like(far, SLACK)]),
            *np.concatenate([across, outward]).T,
        ),
    )


def _rows(
    elements: _Elements, step: np.ndarray, across_y: np.ndarray, height: int
) -> tuple[np.ndarray, np.ndarray]:
    """How many rows of pixels each element reaches (E,), and the first of them (E,).

    Parameters
    ----------
    step : (S, 2) px, the segments
    across_y : (E,), of a slab the y of its normal
    """
    count = len(step)
    lift, start = elements.reach.copy(), elements.table[1]
    lift[:count] *= np.abs(across_y[:count])
    end = start.copy()
    end[:count] += step[:, 1]
    half = np.float32(0.5)
    top = np.clip(np.ceil(np.minimum(start, end) - lift - half), 0, height).astype(np.int64)
    bottom = np.clip(np.floor(np.maximum(start, end) + lift - half), -1, height - 1)
    return np.maximum(bottom.astype(np.int64) - top + 1, 0), top


def _expand(count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ragged ranges: (which range, place in it) of every item."""
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
