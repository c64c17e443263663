"""Differentiable coverage of strokes with varying thickness: analytic, at the pixels near a stroke.

A stroke is the union of its segments' trapezoids (width linear along the segment, measured across
it) and a disc at every point. The plane around a polyline falls into the slabs of its segments and
the normal cones of its points, so every pixel asks only the few elements it could be nearest to.
The cover of an element is that of the band between its two edges, each taken as a straight line
through the pixel, whose exact area is known. Where two elements cover parts of one pixel (a
crossing, a sharp turn, two strokes side by side) their union is estimated from the angle between
edges.

Which elements count at which pixel is found without gradients; only those are then evaluated with
them.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

REACH = 0.75  # px: an edge farther than sqrt(1/2) from a pixel's centre does not touch the pixel
SLACK = 1e-3  # px by which slabs and cones overlap, so that rounding leaves no pixel between them
FAR = 1e9  # px: no edge at all
SEEN_RADIUS = 0.01  # px by which strokes are looked for as if thicker: one of no thickness can grow
MIN_EXTRA = 1e-3  # of a pixel: the least that a second element must add to a first to count


class _Canvas(NamedTuple):
    """A batch of images, whose pixels are numbered row by row, image after image."""

    height: int
    width: int
    images: int

    @property
    def pixels(self) -> int:
        return self.images * self.height * self.width

    def centre(self, pixel: Tensor) -> tuple[Tensor, Tensor]:
        """x and y of the centres of pixels (P,) in their images."""
        row = pixel // self.width
        return pixel - row * self.width + 0.5, row % self.height + 0.5


class _Elements(NamedTuple):
    """What strokes are made of: the slabs of all segments first, then a disc at every point.

    start (2, E) and vector (2, E) from one end to the other, radius (E,) at the start and taper
    (E,), its change along the vector, are the rows of `table` (6, E); of a disc vector and taper
    are 0. `stroke` (E,) says whose the element is, `slab` (E,) bool whether it is a slab.
    """

    table: Tensor
    stroke: Tensor
    slab: Tensor

    @classmethod
    def of(cls, xy: Tensor, radius: Tensor, offsets: Tensor) -> _Elements:
        owner = torch.repeat_interleave(
            torch.arange(len(offsets) - 1, device=xy.device), offsets.diff()
        )
        begin = torch.nonzero(owner[:-1] == owner[1:]).squeeze(1)
        point = torch.cat([xy.T, radius[None]])  # (3, N)
        at = point.index_select(1, begin)
        step = point.index_select(1, begin + 1) - at
        slabs = torch.cat([at[:2], step[:2], at[2:], step[2:]])
        zero = torch.zeros_like(point)
        discs = torch.cat([point[:2], zero[:2], point[2:], zero[2:]])
        slab = torch.arange(len(begin) + len(xy), device=xy.device) < len(begin)
        return cls(torch.cat([slabs, discs], dim=1), torch.cat([owner[begin], owner]), slab)

    @property
    def start(self) -> Tensor:
        return self.table[:2]

    @property
    def vector(self) -> Tensor:
        return self.table[2:4]

    @property
    def reach(self) -> Tensor:
        """How far from the centre line a pixel's centre may lie to be touched, (E,) px."""
        return self.table[4] + self.table[5].clamp(min=0) + REACH

    def thicker(self, by: float) -> _Elements:
        """The same elements, their radius larger by so many px."""
        added = by * (torch.arange(6, device=self.table.device) == 4)[:, None]
        return self._replace(table=self.table + added)


def coverage(
    xy: Tensor,
    thickness: Tensor,
    offsets: Tensor,
    height: int,
    width: int,
    image: Tensor | None = None,
    images: int = 1,
) -> Tensor:
    """Measure how much of every pixel lies under strokes.

    Parameters
    ----------
    xy : (N, 2) float, pixels, x right, y down, pixel centres at + 1/2
    thickness : (N,) float, full width in pixels, round caps and joins; below 0 counts as 0, with
        its gradient
    offsets : (C+1,) int, stroke i is rows offsets[i]:offsets[i+1]; a stroke of one point is a dot
    height, width : canvas in pixels; strokes may lie partly or wholly outside
    image : (C,) int, the image of a batch that each stroke belongs to; None = one image
    images : how many images the batch has

    Returns
    -------
    (H, W), or (B, H, W) where `image` is given: coverage in [0, 1], differentiable in xy and
    thickness

    Raises
    ------
    ValueError
        on a wrong shape or values that are not finite.
    """
    offsets = torch.as_tensor(offsets, dtype=torch.int64, device=xy.device)
    _check(xy, thickness)
    canvas = _Canvas(height, width, 1 if image is None else images)
    shape = (height, width) if image is None else (images, height, width)
    if image is None:
        image = torch.zeros(len(offsets) - 1, dtype=torch.int64, device=xy.device)
    image = torch.as_tensor(image, dtype=torch.int64, device=xy.device)
    blank = xy.new_zeros(canvas.pixels)
    if not len(xy):
        return (blank + 0.0 * (xy.sum() + thickness.sum())).view(shape)
    radius = 0.5 * (thickness + (-thickness.detach()).clamp(min=0))
    elements = _Elements.of(xy, radius, offsets)
    with torch.no_grad():
        decisive = _decisive(_touching(elements, offsets, image, canvas), elements, canvas)
    value = _covered(elements, decisive, canvas)
    return blank.index_copy(0, decisive.inked, value).view(shape)


def _check(xy: Tensor, thickness: Tensor) -> None:
    if xy.ndim != 2 or xy.shape[1] != 2 or thickness.shape != xy.shape[:1]:
        raise ValueError(
            f"coverage needs xy (N, 2) and thickness (N,), "
            f"got {tuple(xy.shape)} and {tuple(thickness.shape)}"
        )
    if not bool(torch.isfinite(xy.detach()).all() & torch.isfinite(thickness.detach()).all()):
        raise ValueError("coverage: a point or a thickness is not finite")


# -------------------------------------------------------------------- which elements count where


class _Touching(NamedTuple):
    """Pixels P and the elements that touch them.

    element (P,), pixel (P,), cover (P,) of the pixel by the element alone, and the unit normal
    (2, P) of the element's edge there.
    """

    element: Tensor
    pixel: Tensor
    cover: Tensor
    normal: Tensor


class _Decisive(NamedTuple):
    """The one or two elements that make the cover of each pixel with ink.

    inked (Q,) pixels; element (Q + R,) and pixel (Q + R,): first the element that covers each of
    them most, then the second ones of those that have two; crossed (R,), which of Q these are, and
    the cosine (R,) of the angle between the normals of both.
    """

    inked: Tensor
    element: Tensor
    pixel: Tensor
    crossed: Tensor
    cosine: Tensor


def _touching(elements: _Elements, offsets: Tensor, image: Tensor, canvas: _Canvas) -> _Touching:
    element, pixel = _near(elements, offsets, image, canvas)
    cover, normal = _cover(elements.thicker(SEEN_RADIUS), element, canvas.centre(pixel))
    touched = torch.nonzero(cover > 0).squeeze(1)
    element, pixel, cover = (a.index_select(0, touched) for a in (element, pixel, cover))
    return _Touching(element, pixel, cover, normal.index_select(1, touched))


def _decisive(touching: _Touching, elements: _Elements, canvas: _Canvas) -> _Decisive:
    """Choose, for each pixel, the element that covers it most and the one that adds most to it."""
    element, pixel, cover, normal = touching
    first = _best(cover, pixel, canvas.pixels)
    mine = first.index_select(0, pixel)  # the first of the pixel that each pair is of
    extra = _extra(touching, mine)
    keep = torch.nonzero((extra > MIN_EXTRA) & ~_idle(element, mine, elements)).squeeze(1)
    second = _best(extra.index_select(0, keep), pixel.index_select(0, keep), canvas.pixels)
    inked = torch.nonzero(first >= 0).squeeze(1)
    first, second = first.index_select(0, inked), second.index_select(0, inked)
    crossed = torch.nonzero(second >= 0).squeeze(1)
    second = keep.index_select(0, second.index_select(0, crossed))
    between = normal.index_select(1, first.index_select(0, crossed)) * normal.index_select(
        1, second
    )
    both = torch.cat([first, second])
    element, pixel = element.index_select(0, both), pixel.index_select(0, both)
    return _Decisive(inked, element, pixel, crossed, between.sum(0))


def _extra(touching: _Touching, mine: Tensor) -> Tensor:
    """What each pair would add to pair `mine` (P,) of its pixel, (P,)."""
    most = touching.cover.index_select(0, mine)
    cosine = (touching.normal * touching.normal.index_select(1, mine)).sum(0)
    return _union(most, touching.cover, cosine) - most


def _idle(element: Tensor, mine: Tensor, elements: _Elements) -> Tensor:
    """Which pairs (P,) add nothing to pair `mine` of their pixel.

    Within one stroke a point's disc only rounds a turn; what it adds to its neighbours' slabs is
    theirs already.
    """
    stroke, slab = elements.stroke.index_select(0, element), elements.slab.index_select(0, element)
    idle = (stroke == stroke.index_select(0, mine)) & ~(slab & slab.index_select(0, mine))
    return idle | (mine == torch.arange(len(mine), device=mine.device))


def _covered(elements: _Elements, decisive: _Decisive, canvas: _Canvas) -> Tensor:
    """The cover (Q,) of the pixels with ink, with gradients."""
    value = _cover(elements, decisive.element, canvas.centre(decisive.pixel))[0]
    first, second = value[: len(decisive.inked)], value[len(decisive.inked) :]
    if not len(second):
        return first
    union = _union(first.index_select(0, decisive.crossed), second, decisive.cosine)
    return first.index_copy(0, decisive.crossed, union)


def _directions(vector: Tensor, stroke: Tensor) -> tuple[Tensor, Tensor]:
    """Unit tangent (S, 2) and length (S,) of segments.

    One of no length takes its neighbour's tangent, a stroke of no length (1, 0).
    """
    length = torch.linalg.vector_norm(vector, dim=1)
    good = length > 1e-6
    tangent = vector / length.clamp(min=1e-6)[:, None]
    if not bool(good.all()):
        index, last = torch.arange(len(vector), device=vector.device), len(vector) - 1
        before = torch.cummax(torch.where(good, index, -1), dim=0)[0].clamp(min=0)
        after = (
            torch.cummin(torch.where(good, index, last + 1).flip(0), dim=0)[0]
            .flip(0)
            .clamp(max=last)
        )
        source = torch.where(good[before] & (stroke[before] == stroke), before, after)
        known = good[source] & (stroke[source] == stroke)
        tangent = torch.where(known[:, None], tangent[source], tangent.new_tensor([1.0, 0.0]))
    return tangent, torch.where(good, length, 0.0)


class _Strip(NamedTuple):
    """The points p, from an element's start, for which low <= (gx, gy) . p <= high; all (E,)."""

    low: Tensor
    high: Tensor
    gx: Tensor
    gy: Tensor

    def interval(self, dy: Tensor) -> tuple[Tensor, Tensor]:
        """The x at which rows `dy` below the start enter and leave it."""
        gx = torch.where(self.gx.abs() < 1e-7, 1e-7, self.gx)
        rest = self.gy * dy
        a, b = (self.low - rest) / gx, (self.high - rest) / gx
        return torch.minimum(a, b).clamp(-FAR, FAR), torch.maximum(a, b).clamp(-FAR, FAR)


def _near(
    elements: _Elements, offsets: Tensor, image: Tensor, canvas: _Canvas
) -> tuple[Tensor, Tensor]:
    """(element, pixel) for every pixel within an element's slab or cone and in reach of its edge.

    An element is an intersection of two strips, and of a disc where it is no slab, so in one row
    of pixels it is an interval.
    """
    count = int(elements.slab.sum())
    tangent, length = _directions(
        elements.vector[:, :count].T.contiguous(), elements.stroke[:count]
    )
    strips = _strips(elements, offsets, tangent, length)
    rows, top = _rows(elements, tangent * length[:, None], strips[1].gy, canvas.height)
    rows[:count][length == 0] = 0
    element, row = _expand(rows)
    row = row + top.index_select(0, element)
    disc = torch.where(elements.slab, FAR, elements.reach)  # a slab has none
    table = torch.stack([*elements.start, disc, *strips[0], *strips[1]]).index_select(1, element)
    x, y, disc, *fields = table.unbind(0)
    left, right = _row_interval(disc, _Strip(*fields[:4]), _Strip(*fields[4:]), row + 0.5 - y)
    left = torch.ceil(left + x - 0.5 - SLACK).clamp(0, canvas.width).long()
    right = torch.floor(right + x - 0.5 + SLACK).clamp(-1, canvas.width - 1).long()
    pick, column = _expand((right - left + 1).clamp(min=0))
    row = image.index_select(0, elements.stroke.index_select(0, element)) * canvas.height + row
    begin = row * canvas.width + left
    return element.index_select(0, pick), begin.index_select(0, pick) + column


def _strips(
    elements: _Elements, offsets: Tensor, tangent: Tensor, length: Tensor
) -> tuple[_Strip, _Strip]:
    """The two strips of each element.

    A slab lies along and across its segment; a point's cone lies ahead of the segment that arrives
    and behind the one that leaves.

    Parameters
    ----------
    tangent : (S, 2) of the segments
    length : (S,) px
    """
    count = len(tangent)
    across = torch.stack([-tangent[:, 1], tangent[:, 0]], dim=1)
    leaves = torch.ones(len(elements.slab) - count, dtype=torch.bool, device=tangent.device)
    arrives = leaves.clone()
    some = offsets.diff() > 0
    leaves[offsets[1:][some] - 1] = False
    arrives[offsets[:-1][some]] = False
    outward, inward = tangent.new_zeros(len(leaves), 2), tangent.new_zeros(len(leaves), 2)
    outward[leaves], inward[arrives] = tangent, tangent
    reach, far = elements.reach[:count], tangent.new_full((len(leaves),), FAR)
    low = tangent.new_full((len(elements.slab),), -SLACK)
    return (
        _Strip(low, torch.cat([length + SLACK, far]), *torch.cat([tangent, inward]).T),
        _Strip(
            torch.cat([-reach, -far]),
            torch.cat([reach, torch.full_like(far, SLACK)]),
            *torch.cat([across, outward]).T,
        ),
    )


def _rows(
    elements: _Elements, step: Tensor, across_y: Tensor, height: int
) -> tuple[Tensor, Tensor]:
    """How many rows of pixels each element reaches (E,), and the first of them (E,).

    Parameters
    ----------
    step : (S, 2) px, the segments
    across_y : (E,), of a slab the y of its normal
    """
    lift = torch.where(elements.slab, elements.reach * across_y.abs(), elements.reach)
    start = elements.start[1]
    end = torch.cat([start[: len(step)] + step[:, 1], start[len(step) :]])
    top = torch.ceil(torch.minimum(start, end) - lift - 0.5).clamp(0, height).long()
    bottom = torch.floor(torch.maximum(start, end) + lift - 0.5).clamp(-1, height - 1).long()
    return (bottom - top + 1).clamp(min=0), top


def _row_interval(disc: Tensor, first: _Strip, second: _Strip, dy: Tensor) -> tuple[Tensor, Tensor]:
    """Where rows `dy` below starts enter and leave elements, x from the start: left, right (R,)."""
    (left1, right1), (left2, right2) = first.interval(dy), second.interval(dy)
    chord = (disc * disc - dy * dy).clamp(min=0).sqrt()
    left = torch.maximum(torch.maximum(left1, left2), -chord)
    return left, torch.minimum(torch.minimum(right1, right2), chord)


def _expand(count: Tensor) -> tuple[Tensor, Tensor]:
    """Ragged ranges: (which range, place in it) of every item."""
    which = torch.repeat_interleave(torch.arange(len(count), device=count.device), count)
    first = (count.cumsum(0) - count).index_select(0, which)
    return which, torch.arange(len(which), device=count.device) - first


# ------------------------------------------------------------------------ areas within a pixel


class _Edge(NamedTuple):
    """The edge of an element as a straight line near a pixel, all (P,) but the normal.

    normal : (2, P), unit, away from the centre line
    major, minor : the larger and the smaller of the normal's parts, by size
    tilt : cosine of the edge's angle to the centre line
    sag : px by which a round edge falls away from its tangent, on average over a pixel
    """

    normal: Tensor
    major: Tensor
    minor: Tensor
    tilt: Tensor
    sag: Tensor


def _cover(
    elements: _Elements, element: Tensor, centre: tuple[Tensor, Tensor]
) -> tuple[Tensor, Tensor]:
    """Cover (P,) of pixels by one element each, and the unit normals (2, P) of the edges used.

    Normals are constants here: to first order an edge moves the area by its own shift alone.
    """
    x, y, ex, ey, radius, taper = elements.table.index_select(1, element).unbind(0)
    dx, dy = centre[0].to(x.dtype) - x, centre[1].to(x.dtype) - y
    square = (ex * ex + ey * ey).clamp(min=1e-12)
    t = ((dx * ex + dy * ey) / square).clamp(0, 1)
    with torch.no_grad():
        edge = _edge(
            (dx, dy), (ex, ey), square.sqrt(), radius, taper, elements.slab.index_select(0, element)
        )
        fixed = t.detach()
    nx, ny = edge.normal
    distance = (dx - fixed * ex) * nx + (dy - fixed * ey) * ny
    radius = radius + t * taper
    outer = _half_plane((radius - distance) * edge.tilt - edge.sag, edge.major, edge.minor)
    inner = _half_plane(-(radius + distance) * edge.tilt - edge.sag, edge.major, edge.minor)
    return outer - inner, edge.normal


def _edge(
    d: tuple[Tensor, Tensor],
    vector: tuple[Tensor, Tensor],
    length: Tensor,
    radius: Tensor,
    taper: Tensor,
    slab: Tensor,
) -> _Edge:
    """The edge near pixels that lie at d from the elements' starts."""
    (dx, dy), (ex, ey) = d, vector
    side = torch.where(dx * ey - dy * ex > 0, -1.0, 1.0) / length
    away = torch.sqrt(dx * dx + dy * dy).clamp(min=1e-9)
    nx = torch.where(slab, -ey * side, dx / away)
    ny = torch.where(slab, ex * side, dy / away)
    slope = taper / length * slab
    # the mean of x^2 / 2 r over a pixel's width is 1 / 24 r
    sag = (24 * radius.clamp(min=0.5)).reciprocal() * ~slab
    wide, high = nx.abs(), ny.abs()
    major, minor = torch.maximum(wide, high), torch.minimum(wide, high).clamp(min=1e-4)
    return _Edge(torch.stack([nx, ny]), major, minor, (1 + slope * slope).rsqrt(), sag)


def _half_plane(inside: Tensor, major: Tensor, minor: Tensor) -> Tensor:
    """Area (P,) of the unit pixel in a half plane whose edge lies `inside` px beyond its centre.

    It is the integral of the chord that the edge cuts from the square: by its distance from the
    centre a trapezoid, 1 / major high, level to (major - minor) / 2 and 0 from (major + minor) / 2
    on, where major and minor are the parts of the edge's normal as `_Edge` has them.
    """
    half, flat = 0.5 * (major + minor), 0.5 * (major - minor)
    s = torch.minimum(torch.maximum(inside, -half), half)
    tail = (s.abs() - flat).clamp(min=0)
    return 0.5 + s / major - s.sign() * tail * tail / (2 * major * minor)


def _union(a: Tensor, b: Tensor, cosine: Tensor) -> Tensor:
    """Area (P,) of the union of two covers of a pixel, by the cosine between their edges' normals.

    Where the edges face alike one cover holds the other, and the larger counts; where they face
    away from each other the covers lie apart, and their sum counts; at right angles they overlap
    as by chance, a + b - a b, as in the compositing of Porter and Duff 1984. Between these the
    cosine blends: a rule of our own.
    """
    chance = a + b - a * b
    alike, apart = cosine.clamp(min=0), (-cosine).clamp(min=0)
    return alike * torch.maximum(a, b) + apart * (a + b).clamp(max=1) + (1 - alike - apart) * chance


def _best(value: Tensor, place: Tensor, places: int) -> Tensor:
    """Index of the largest value at every place (places,), the first of equals; -1: it has none."""
    top = value.new_full((places,), -1.0).scatter_reduce_(0, place, value, "amax")
    index = torch.arange(len(value), device=value.device)
    index = torch.where(value == top.index_select(0, place), index, len(value))
    best = torch.full((places,), len(value), device=value.device).scatter_reduce_(
        0, place, index, "amin"
    )
    return torch.where(best == len(value), -1, best)
