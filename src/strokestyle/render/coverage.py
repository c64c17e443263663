"""Differentiable coverage of strokes with varying thickness: analytic, and only at the pixels near a stroke.

A stroke is the union of its segments' trapezoids (width linear along the segment, measured across it) and a disc at
every point. The plane around a polyline falls into the slabs of its segments and the normal cones of its points, so
every pixel asks only the few elements it could be nearest to. The cover of an element is that of the band between its
two edges, each taken as a straight line through the pixel, whose exact area is known. Where two elements cover parts of
one pixel (a crossing, a sharp turn, two strokes side by side) their union is estimated from the angle between edges.

Which elements count at which pixel is found without gradients; only those are then evaluated with them.
"""

from __future__ import annotations

import torch
from torch import Tensor

REACH = 0.75  # px: an edge farther than sqrt(1/2) from a pixel's centre does not touch the pixel
SLACK = 1e-3  # px by which slabs and cones overlap, so that rounding leaves no pixel between them
FAR = 1e9
HAIR = (
    0.01  # px: a stroke of no thickness is looked for as if it had this radius, so that it can grow
)


def coverage(
    xy: Tensor,
    thickness: Tensor,
    offsets: Tensor,
    height: int,
    width: int,
    image: Tensor | None = None,
    images: int = 1,
) -> Tensor:
    """How much of every pixel lies under strokes.

    Parameters
    ----------
    xy : (N, 2) float, pixels, x right, y down, pixel centres at + 1/2
    thickness : (N,) float, full width in pixels, round caps and joins; below 0 counts as 0, with its gradient
    offsets : (C+1,) int, stroke i is rows offsets[i]:offsets[i+1]; a stroke of one point is a dot
    height, width : canvas in pixels; strokes may lie partly or wholly outside
    image : (C,) int, the image of a batch that each stroke belongs to; None = one image
    images : how many images the batch has

    Returns
    -------
    (H, W), or (B, H, W) where `image` is given: coverage in [0, 1], differentiable in xy and thickness

    Raises
    ------
    ValueError
        on a wrong shape or values that are not finite.
    """
    offsets = torch.as_tensor(offsets, dtype=torch.int64, device=xy.device)
    if xy.ndim != 2 or xy.shape[1] != 2 or thickness.shape != xy.shape[:1]:
        raise ValueError(
            f"coverage needs xy (N, 2) and thickness (N,), got {tuple(xy.shape)} and {tuple(thickness.shape)}"
        )
    if not bool(torch.isfinite(xy.detach()).all() & torch.isfinite(thickness.detach()).all()):
        raise ValueError("coverage: a point or a thickness is not finite")
    if image is None:
        image, images, shape = (
            torch.zeros(len(offsets) - 1, dtype=torch.int64, device=xy.device),
            1,
            (height, width),
        )
    else:
        image, shape = (
            torch.as_tensor(image, dtype=torch.int64, device=xy.device),
            (images, height, width),
        )
    blank = xy.new_zeros(images * height * width)
    if not len(xy):
        return (blank + 0.0 * (xy.sum() + thickness.sum())).view(shape)
    radius = 0.5 * (thickness + (-thickness.detach()).clamp(min=0))
    elements, stroke, slab = _elements(xy, radius, offsets)
    with torch.no_grad():
        element, pixel = _near(elements, stroke, slab, offsets, image, height, width)
        wide = elements + HAIR * (torch.arange(6, device=xy.device) == 4)[:, None]
        cover, normal = _cover(wide, slab, element, _centre(pixel, height, width))
        touched = torch.nonzero(cover > 0).squeeze(1)
        element, pixel, cover = (a.index_select(0, touched) for a in (element, pixel, cover))
        normal = normal.index_select(1, touched)  # (2, P)
        first = _best(
            cover, pixel, len(blank)
        )  # (image pixels,) the pair that covers a pixel most, -1 = none
        mine = first.index_select(0, pixel)
        most = cover.index_select(0, mine)
        extra = _union(most, cover, (normal * normal.index_select(1, mine)).sum(0)) - most
        # within one stroke a point's disc only rounds a turn; what it adds to its neighbours' slabs is theirs already
        line, flank = stroke.index_select(0, element), slab.index_select(0, element)
        idle = (line == line.index_select(0, mine)) & ~(flank & flank.index_select(0, mine))
        idle |= mine == torch.arange(len(mine), device=mine.device)
        keep = torch.nonzero((extra > 1e-3) & ~idle).squeeze(1)
        second = _best(extra.index_select(0, keep), pixel.index_select(0, keep), len(blank))
        inked = torch.nonzero(first >= 0).squeeze(1)  # pixels with ink
        first, second = first.index_select(0, inked), second.index_select(0, inked)
        crossed = torch.nonzero(second >= 0).squeeze(1)
        second = keep.index_select(0, second.index_select(0, crossed))
        angle = (
            normal.index_select(1, first.index_select(0, crossed)) * normal.index_select(1, second)
        ).sum(0)
        both = torch.cat([first, second])
        both, both_pixel = element.index_select(0, both), pixel.index_select(0, both)
    value = _cover(elements, slab, both, _centre(both_pixel, height, width))[0]
    value, other = value[: len(first)], value[len(first) :]
    if len(other):
        union = _union(value.index_select(0, crossed), other, angle)
        value = value.index_copy(0, crossed, union)
    return blank.index_copy(0, inked, value).view(shape)


def _elements(xy: Tensor, radius: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Segments, then points: (start x, y, vector x, y, radius, its change) (6, E); their stroke; whether a slab."""
    owner = torch.repeat_interleave(
        torch.arange(len(offsets) - 1, device=xy.device), offsets.diff()
    )
    begin = torch.nonzero(owner[:-1] == owner[1:]).squeeze(1)
    point = torch.cat([xy.T, radius[None]])  # (3, N)
    at = point.index_select(1, begin)
    step = point.index_select(1, begin + 1) - at
    slabs = torch.cat([at[:2], step[:2], at[2:], step[2:]])
    zero = torch.zeros_like(point)
    points = torch.cat([point[:2], zero[:2], point[2:], zero[2:]])
    slab = torch.arange(len(begin) + len(xy), device=xy.device) < len(begin)
    return torch.cat([slabs, points], dim=1), torch.cat([owner[begin], owner]), slab


def _directions(vector: Tensor, stroke: Tensor) -> tuple[Tensor, Tensor]:
    """Unit tangent (S, 2) and length (S,) of segments; one of no length takes its neighbour's tangent, a dot (1, 0)."""
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


def _near(elements, stroke, slab, offsets, image, height, width) -> tuple[Tensor, Tensor]:
    """(element, pixel) for every pixel within an element's slab or cone and within reach of its edge.

    An element is an intersection of strips lo <= g . p <= hi, so in one row of pixels it is an interval.
    """
    count = int(slab.sum())
    tangent, length = _directions(elements[2:4, :count].T.contiguous(), stroke[:count])
    across = torch.stack([-tangent[:, 1], tangent[:, 0]], dim=1)
    radius = elements[4] + elements[5].clamp(min=0) + REACH
    start = elements[:2].T
    points = elements.shape[1] - count
    # a point's cone: ahead of the segment that arrives, behind the one that leaves
    zero = tangent.new_zeros(points, 2)
    inward, outward = zero.clone(), zero.clone()
    leaving = torch.ones(points, dtype=torch.bool, device=slab.device)
    leaving[offsets[1:][offsets.diff() > 0] - 1] = False
    arriving = torch.ones_like(leaving)
    arriving[offsets[:-1][offsets.diff() > 0]] = False
    outward[leaving], inward[arriving] = tangent, tangent
    # strip 1 and 2 of each element, relative to its start
    g1, g2 = torch.cat([tangent, inward]), torch.cat([across, outward])
    far = start.new_full((points,), FAR)
    low1 = torch.cat([torch.zeros_like(length), torch.zeros_like(far)]) - SLACK
    high1 = torch.cat([length + SLACK, far])
    low2 = torch.cat([-radius[:count], -far])
    high2 = torch.cat([radius[:count], torch.full_like(far, SLACK)])
    # rows that the element reaches
    lift = torch.where(slab, radius * g2[:, 1].abs(), radius)
    end = torch.cat([start[:count] + tangent * length[:, None], start[count:]])
    top = torch.minimum(start[:, 1], end[:, 1]) - lift
    bottom = torch.maximum(start[:, 1], end[:, 1]) + lift
    top = torch.ceil(top - 0.5).clamp(0, height).long()
    bottom = torch.floor(bottom - 0.5).clamp(-1, height - 1).long()
    rows = (bottom - top + 1).clamp(min=0)
    rows[:count][length == 0] = 0
    element, row = _expand(rows)
    row = row + top.index_select(0, element)
    # the row's interval of x; a slab has no chord
    size = torch.where(slab, FAR, radius)
    table = torch.stack([*start.T, size, low1, high1, *g1.T, low2, high2, *g2.T]).index_select(
        1, element
    )
    x, y, size, low1, high1, x1, y1, low2, high2, x2, y2 = table.unbind(0)
    dy = row + 0.5 - y
    left1, right1 = _interval(x1, y1, low1, high1, dy)
    left2, right2 = _interval(x2, y2, low2, high2, dy)
    chord = (size * size - dy * dy).clamp(min=0).sqrt()
    left = torch.maximum(torch.maximum(left1, left2), -chord) + x
    right = torch.minimum(torch.minimum(right1, right2), chord) + x
    left = torch.ceil(left - 0.5 - SLACK).clamp(0, width).long()
    right = torch.floor(right - 0.5 + SLACK).clamp(-1, width - 1).long()
    pick, column = _expand((right - left + 1).clamp(min=0))
    place = (image.index_select(0, stroke.index_select(0, element)) * height + row) * width + left
    return element.index_select(0, pick), place.index_select(0, pick) + column


def _expand(count: Tensor) -> tuple[Tensor, Tensor]:
    """Ragged ranges: (which range, place in it) of every item."""
    which = torch.repeat_interleave(torch.arange(len(count), device=count.device), count)
    return which, torch.arange(len(which), device=count.device) - (
        count.cumsum(0) - count
    ).index_select(0, which)


def _interval(
    gx: Tensor, gy: Tensor, low: Tensor, high: Tensor, dy: Tensor
) -> tuple[Tensor, Tensor]:
    """The x for which low <= (gx, gy) . (x, dy) <= high."""
    gx = torch.where(gx.abs() < 1e-7, 1e-7, gx)
    rest = gy * dy
    a, b = (low - rest) / gx, (high - rest) / gx
    return torch.minimum(a, b).clamp(-FAR, FAR), torch.maximum(a, b).clamp(-FAR, FAR)


def _centre(pixel: Tensor, height: int, width: int) -> tuple[Tensor, Tensor]:
    row = pixel // width
    return pixel - row * width + 0.5, row % height + 0.5


def _cover(
    elements: Tensor, slab: Tensor, element: Tensor, p: tuple[Tensor, Tensor]
) -> tuple[Tensor, Tensor]:
    """Cover (P,) of pixels centred at p (x, y) by one element each, and the unit normals (2, P) of the edges used.

    Normals are constants here: to first order an edge moves the area by its own shift alone.
    """
    x, y, ex, ey, radius, swell = elements.index_select(1, element).unbind(0)
    dx, dy = p[0].to(elements.dtype) - x, p[1].to(elements.dtype) - y
    long2 = (ex * ex + ey * ey).clamp(min=1e-12)
    t = ((dx * ex + dy * ey) / long2).clamp(0, 1)
    with torch.no_grad():
        length = long2.sqrt()
        side = torch.where(dx * ey - dy * ex > 0, -1.0, 1.0) / length
        away = torch.sqrt(dx * dx + dy * dy).clamp(min=1e-9)
        is_slab = slab.index_select(0, element)
        nx = torch.where(is_slab, -ey * side, dx / away)
        ny = torch.where(is_slab, ex * side, dy / away)
        slope = swell / length * is_slab
        # the edge of a trapezoid is tilted against its axis
        tilt = (1 + slope * slope).rsqrt()
        major, minor = (
            torch.maximum(nx.abs(), ny.abs()),
            torch.minimum(nx.abs(), ny.abs()).clamp(min=1e-4),
        )
        fixed = t.detach()
        # a disc's edge falls away from its tangent: by 1 / (24 r) px on average over a pixel
        sag = (24 * radius.clamp(min=0.5)).reciprocal() * ~is_slab
    distance = (dx - fixed * ex) * nx + (dy - fixed * ey) * ny
    radius = radius + t * swell
    outer = _half_plane((radius - distance) * tilt - sag, major, minor)
    inner = _half_plane(-(radius + distance) * tilt - sag, major, minor)
    return outer - inner, torch.stack([nx, ny])


def _half_plane(inside: Tensor, major: Tensor, minor: Tensor) -> Tensor:
    """Area of the unit pixel in a half plane whose edge lies `inside` px beyond its centre.

    `major` and `minor` are the larger and the smaller part of the edge's unit normal, by size.
    """
    half, flat = 0.5 * (major + minor), 0.5 * (major - minor)
    s = torch.minimum(torch.maximum(inside, -half), half)
    tail = (s.abs() - flat).clamp(min=0)
    return 0.5 + s / major - s.sign() * tail * tail / (2 * major * minor)


def _union(a: Tensor, b: Tensor, cosine: Tensor) -> Tensor:
    """Area of the union of two covers: the larger if their edges face alike, the sum if apart, else as by chance."""
    chance = a + b - a * b
    alike, apart = cosine.clamp(min=0), (-cosine).clamp(min=0)
    return alike * torch.maximum(a, b) + apart * (a + b).clamp(max=1) + (1 - alike - apart) * chance


def _best(value: Tensor, place: Tensor, places: int) -> Tensor:
    """For every place the index of its largest value, the first of equals; -1 where there is none. (places,)"""
    top = value.new_full((places,), -1.0).scatter_reduce_(0, place, value, "amax")
    index = torch.arange(len(value), device=value.device)
    index = torch.where(value == top.index_select(0, place), index, len(value))
    best = torch.full((places,), len(value), device=value.device).scatter_reduce_(
        0, place, index, "amin"
    )
    return torch.where(best == len(value), -1, best)
