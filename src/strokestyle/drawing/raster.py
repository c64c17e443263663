"""The direct raster of a drawing: the pixels that every file we write is measured against."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..geometry.curves import counting
from .ribbon import Ribbon, ribbon, sample_strips
from .strokes import (
    Drawing,
    Strokes,
    merge_coincident_points,
    paint_order,
    round_cone_distance,
    stroke_segments,
)

BATCH = 5e5  # pixels looked at together: what fits into a cache


@dataclass(frozen=True)
class Crop:
    """The pixels of a canvas round a stroke: columns x0 .. x0 + w, rows y0 .. y0 + h."""

    x0: int
    y0: int
    w: int
    h: int

    @property
    def index(self) -> tuple[slice, slice]:
        return slice(self.y0, self.y0 + self.h), slice(self.x0, self.x0 + self.w)


def crop_of(xy: np.ndarray, reach: np.ndarray, size: tuple[int, int]) -> Crop:
    """The pixels within `reach` (n,) of the points (n, 2), cut to the canvas."""
    low, high = (
        np.floor((xy - reach[:, None]).min(axis=0)),
        np.ceil((xy + reach[:, None]).max(axis=0)),
    )
    x0, y0 = np.clip(low, 0, size).astype(int)
    x1, y1 = np.clip(high, 0, size).astype(int)
    return Crop(int(x0), int(y0), int(max(x1 - x0, 0)), int(max(y1 - y0, 0)))


def _near_pairs(xy, reach, crop):
    """Every (segment, pixel) that may touch: segment (P,), pixel's index in the crop (P,), its centre (P, 2)."""
    a, b = xy[:-1], xy[1:]
    far = np.maximum(reach[:-1], reach[1:])[:, None]
    low = np.floor(np.minimum(a, b) - far - [crop.x0, crop.y0])
    high = np.ceil(np.maximum(a, b) + far - [crop.x0, crop.y0])
    low = np.clip(low, 0, [crop.w, crop.h]).astype(np.int64)
    size = np.maximum(np.clip(high, 0, [crop.w, crop.h]).astype(np.int64) - low, 0)
    count = size[:, 0] * size[:, 1]
    segment = np.repeat(np.arange(len(a)), count)
    k = counting(count)
    width = np.repeat(size[:, 0], count)
    row = k // np.maximum(width, 1)
    x = np.repeat(low[:, 0], count) + k - row * width
    y = np.repeat(low[:, 1], count) + row
    return segment, y * crop.w + x, np.stack([x + crop.x0 + 0.5, y + crop.y0 + 0.5], axis=1)


def _short_steps(xy, *fields):
    """The polyline with points added so that a segment's box is not much larger than the segment's surroundings."""
    step = np.hypot(*np.diff(xy, axis=0).T)
    pieces = np.maximum(np.ceil(step / np.maximum(4.0, fields[0].max())), 1).astype(np.int64)
    if (pieces == 1).all():
        return (xy, *fields)
    at = np.repeat(np.arange(len(step)), pieces)
    at = at + counting(pieces) / pieces[at]
    at, k = np.r_[at, len(step)], np.arange(len(xy))
    return (
        np.stack([np.interp(at, k, c) for c in xy.T], axis=1),
        *(np.interp(at, k, f) for f in fields),
    )


def coverage(
    strokes: Strokes, i: int, size: tuple[int, int], scale: float = 1.0
) -> tuple[Crop, np.ndarray]:
    """How much of each pixel stroke i covers, in [0, 1]: (crop, (h, w) float64)."""
    crop, pixel, distance, width = _pixel_distances(strokes, i, size, scale, 1.0)
    # the pixel's part within a band: what the near edge lets in less what the far edge shuts out
    part = np.clip(0.5 - distance, 0.0, 1.0) - np.clip(0.5 - distance - width, 0.0, 1.0)
    cover = np.zeros(crop.w * crop.h)
    np.maximum.at(cover, pixel, part)
    return crop, cover.reshape(crop.h, crop.w)


def distance_map(
    strokes: Strokes, i: int, size: tuple[int, int], reach: float
) -> tuple[Crop, np.ndarray]:
    """Signed distance of each pixel's centre to stroke i, px, negative inside: (crop, (h, w)); inf beyond `reach`."""
    crop, pixel, distance, _ = _pixel_distances(strokes, i, size, 1.0, reach)
    nearest = np.full(crop.w * crop.h, np.inf)
    np.minimum.at(nearest, pixel, distance)
    return crop, np.where(nearest <= reach, nearest, np.inf).reshape(crop.h, crop.w)


def _pixel_distances(strokes, i, size, scale, reach):
    """Crop, and for every (segment, pixel) within reach: the pixel, its signed distance, the segment's width."""
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, radius = merge_coincident_points(
        strokes.xy[rows] * scale, 0.5 * strokes.thickness[rows] * scale
    )
    if len(xy) == 1:
        xy, radius = np.concatenate([xy, xy + [[1e-6, 0.0]]]), np.r_[radius, radius]
    crop = crop_of(xy, radius + reach, size)
    xy, radius = _short_steps(xy, radius)
    k, pixel, at = _near_pairs(xy, radius + reach, crop)
    length, direction, r0, slope = (
        value[k] for value in stroke_segments(xy, radius, np.arange(len(xy) - 1))
    )
    distance = round_cone_distance(at - xy[k], length, direction, r0, slope)
    return crop, pixel, distance, 2.0 * np.maximum(r0, radius[k + 1])


def _arms(xy):
    """Cut a centre line where it has turned by more than 150 degrees: no arm overlaps itself. [(first, last), ...]"""
    d = np.diff(xy, axis=0)
    heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    cuts, first, low, high = [0], 0, heading[0], heading[0]
    if np.ptp(heading) > np.radians(150.0):
        for k, angle in enumerate(heading.tolist()):
            low, high = min(low, angle), max(high, angle)
            if high - low > np.radians(150.0) and k > first:
                cuts.append(k)
                first, low, high = k, angle, angle
    cuts.append(len(xy) - 1)
    return list(zip(cuts[:-1], cuts[1:], strict=True))


@dataclass(frozen=True)
class RibbonPixels:
    """The pixels of some ribbons: `ribbon` (M,) whose it is, `pixel` (M,) its index in that ribbon's crop, flattened,
    `u` (M,) in [0, 1] along the ribbon, `v` (M,) in [-1, 1] across it, and `arm` (M,): a pixel is listed once for every
    arm of its ribbon that covers it, and an arm does not overlap itself."""

    ribbon: np.ndarray
    pixel: np.ndarray
    u: np.ndarray
    v: np.ndarray
    arm: np.ndarray


def ribbon_coordinates(bands: list[Ribbon], crops: list[Crop]) -> RibbonPixels:
    """u and v of the pixels of ribbons.

    A pixel takes the closest point of the arm. Where arms meet, a pixel that only reaches an arm's cut end goes to the
    other.
    """
    pieces, arms = [], []  # segments of all arms; ribbon, number within it and crop of each arm
    for number, (band, crop) in enumerate(zip(bands, crops, strict=True)):
        xy, half, along = _short_steps(band.xy, band.half, band.along)
        d = np.diff(xy, axis=0)
        heading = np.arctan2(d[:, 1], d[:, 0])
        # round a point's outer side pixels lie behind the segment before it or ahead of the one after it
        bend = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
        overhang = np.where(bend < 0.5 * np.pi, np.sin(bend), 1.0)
        for k, (a, b) in enumerate(_arms(xy)):
            cut = np.array([band.closed or a > 0, band.closed or b < len(xy) - 1], float)
            table = np.empty((b - a, 12))
            table[:, 0:2], table[:, 2:4] = xy[a:b], d[a:b]
            table[:, 4], table[:, 5], table[:, 6] = (
                half[a:b],
                half[a + 1 : b + 1],
                along[a:b] / band.length,
            )
            table[:, 7] = along[a + 1 : b + 1] / band.length - table[:, 6]
            table[:, 8], table[:, 9] = (
                np.r_[cut[0], overhang[a : b - 1]],
                np.r_[overhang[a : b - 1], cut[1]],
            )
            table[:, 10], table[:, 11] = np.arange(b - a) == 0, np.arange(b - a) == b - a - 1
            pieces.append(table)
            arms.append(
                (
                    number,
                    k,
                    cut,
                    crop_of(xy[a : b + 1], half[a : b + 1], (crop.x0 + crop.w, crop.y0 + crop.h)),
                )
            )
    table = np.concatenate(pieces) if pieces else np.zeros((0, 12))
    arm = np.repeat(np.arange(len(arms)), [len(piece) for piece in pieces])
    boxes = np.array([[c.x0, c.y0, c.w, c.h] for _, _, _, c in arms], np.int64).reshape(-1, 4)
    cuts = np.array([cut for _, _, cut, _ in arms], bool).reshape(-1, 2)
    length = np.hypot(table[:, 2], table[:, 3])
    direction = table[:, 2:4] / length[:, None]
    h0, h1 = table[:, 4], table[:, 5]
    wide = np.maximum(h0, h1)
    k, x, y = _slabs(
        table[:, :2], direction, length, wide, table[:, 8:10] * wide[:, None], boxes[arm]
    )
    px, py = x + 0.5 - table[k, 0], y + 0.5 - table[k, 1]
    ahead, aside = (
        px * direction[k, 0] + py * direction[k, 1],
        py * direction[k, 0] - px * direction[k, 1],
    )
    foot = np.clip(ahead, 0.0, length[k])
    distance = np.hypot(ahead - foot, aside)
    near = distance <= h0[k] + ((h1 - h0) / length)[k] * foot
    before, past = (ahead < 0) & (table[k, 10] > 0), (ahead > length[k]) & (table[k, 11] > 0)
    owner = arm[k]
    near &= ~(before & ~cuts[owner, 0]) & ~(past & ~cuts[owner, 1])
    near = np.flatnonzero(near)
    k, x, y, foot, distance, owner = (
        k[near],
        x[near],
        y[near],
        foot[near],
        distance[near],
        owner[near],
    )
    spare = (before | past)[near]
    # the closest point of each arm
    base = np.r_[0, np.cumsum(boxes[:, 2] * boxes[:, 3])]
    cell = base[owner] + (y - boxes[owner, 1]) * boxes[owner, 2] + x - boxes[owner, 0]
    best = np.full(base[-1], np.inf, np.float32)
    distance = distance.astype(np.float32)
    np.minimum.at(best, cell, distance)
    first = np.flatnonzero(distance == best[cell])
    pick = np.full(base[-1], -1, np.int32)
    pick[cell[first]] = first
    pick = pick[pick >= 0]
    # a pixel that only reaches a cut end is spare: it counts where no other arm has it
    number = np.array([a for a, _, _, _ in arms], np.int64)
    owner, spare = owner[pick], spare[pick]
    mine = number[owner]
    frames = np.array([[c.x0, c.y0, c.w, c.h] for c in crops], np.int64).reshape(-1, 4)
    pixel = (y[pick] - frames[mine, 1]) * frames[mine, 2] + x[pick] - frames[mine, 0]
    base = np.r_[0, np.cumsum(frames[:, 2] * frames[:, 3])]
    taken = np.zeros(base[-1], bool)
    taken[(base[mine] + pixel)[~spare]] = True
    keep = np.flatnonzero(~spare | ~taken[base[mine] + pixel])
    pick, owner, mine, pixel = pick[keep], owner[keep], mine[keep], pixel[keep]
    k, foot = k[pick], foot[pick]
    part = foot / length[k]
    side = (y[pick] + 0.5 - table[k, 1]) * direction[k, 0] - (
        x[pick] + 0.5 - table[k, 0]
    ) * direction[k, 1]
    v = np.where(side < 0, -distance[pick], distance[pick]) / np.maximum(
        h0[k] + (h1 - h0)[k] * part, 1e-9
    )
    place = np.array([a for _, a, _, _ in arms], np.int64)
    return RibbonPixels(mine, pixel, table[k, 6] + table[k, 7] * part, v, place[owner])


def _slabs(start, direction, length, half, overhang, box):
    """Every pixel whose centre lies in an oriented rectangle: rectangle (P,), x (P,), y (P,).

    Rectangles begin at `start` (K, 2), run `length` (K,) along `direction` (K, 2) and reach `half` (K,) to both sides
    and `overhang` (K, 2) beyond both ends; pixels are cut to `box` (K, 4): x0, y0, w, h.
    """
    reach = 0.5 * (length + overhang.sum(axis=1)) + 1e-6
    middle = start + (0.5 * (length + overhang[:, 1] - overhang[:, 0]))[:, None] * direction
    dx, dy = direction.T
    tall = reach * np.abs(dy) + half * np.abs(dx)
    top = np.clip(np.ceil(middle[:, 1] - tall - 0.5), box[:, 1], box[:, 1] + box[:, 3]).astype(
        np.int64
    )
    end = np.clip(np.floor(middle[:, 1] + tall - 0.5) + 1, box[:, 1], box[:, 1] + box[:, 3]).astype(
        np.int64
    )
    count = np.maximum(end - top, 0)
    k = np.repeat(np.arange(len(count)), count)
    y = counting(count) + top[k]
    rise = y + 0.5 - middle[k, 1]
    # |x dx + rise dy| <= reach and |rise dx - x dy| <= half, for x from the middle
    safe_x, safe_y = (np.where(np.abs(c) > 1e-9, c, 1e-9)[k] for c in (dx, dy))
    a, b = -rise * dy[k] / safe_x, reach[k] / np.abs(safe_x)
    c, e = rise * dx[k] / safe_y, half[k] / np.abs(safe_y)
    left = np.maximum(a - b, c - e) + middle[k, 0] - 0.5
    right = np.minimum(a + b, c + e) + middle[k, 0] - 0.5
    left = np.clip(np.ceil(left), box[k, 0], box[k, 0] + box[k, 2]).astype(np.int64)
    right = np.clip(np.floor(right) + 1, box[k, 0], box[k, 0] + box[k, 2]).astype(np.int64)
    count = np.maximum(right - left, 0)
    row = np.repeat(np.arange(len(count)), count)
    x = counting(count) + left[row]
    return k[row], x, y[row]


def flat_pixels(
    drawing: Drawing, index: np.ndarray, scale: float = 1.0
) -> Iterator[tuple[Crop, np.ndarray, np.ndarray]]:
    """As `textured_pixels`, in flat ink."""
    size = canvas_size(drawing, scale)
    for i in index:
        crop, cover = coverage(drawing.strokes, i, size, scale)
        pixel = np.flatnonzero(cover)
        ink = np.r_[drawing.color[i, :3], 1.0] * drawing.color[i, 3]
        yield crop, pixel, (cover.reshape(-1)[pixel, None] * ink).astype(np.float32)


def textured_pixels(
    drawing: Drawing, index: np.ndarray, scale: float = 1.0
) -> Iterator[tuple[Crop, np.ndarray, np.ndarray]]:
    """The strokes of `index` alone, each on a canvas of `scale` times the drawing's size, one after the other.

    Yields
    ------
    crop, pixel (M,) in the flattened crop, each once, and its premultiplied colour (M, 4) float32
    """
    strips, size = drawing.texture, canvas_size(drawing, scale)
    texels = strips.rgba.astype(np.float32) / 255.0
    texels[..., :3] *= texels[..., 3:]
    bands = [ribbon(drawing.strokes, i, strips.margin[i], scale) for i in index]
    crops = [crop_of(band.xy, band.half, size) for band in bands]
    work = np.array(
        [
            crop.w * crop.h + 8 * band.length * band.half.max()
            for crop, band in zip(crops, bands, strict=True)
        ]
        + [0.0]
    )
    batch = (np.cumsum(work) // BATCH)[:-1]
    for number in np.unique(batch):
        own = np.flatnonzero(batch == number)
        found = ribbon_coordinates([bands[j] for j in own], [crops[j] for j in own])
        stroke = np.asarray(index)[own][found.ribbon]
        wraps = np.array([bands[j].closed for j in own], bool)[found.ribbon]
        color = sample_strips(texels, strips.offsets, stroke, found.u, found.v, wraps)
        base = np.r_[0, np.cumsum([crops[j].w * crops[j].h for j in own])]
        key = base[found.ribbon] + found.pixel
        # where a stroke crosses itself the stronger mark shows
        crossing = np.bincount(found.ribbon, found.arm, len(own))[found.ribbon] > 0
        again = np.flatnonzero(crossing)
        again = again[np.lexsort((found.arm[again], -color[again, 3], key[again]))]
        again = again[np.r_[True, key[again][1:] != key[again][:-1]]] if len(again) else again
        order = np.r_[np.flatnonzero(~crossing), again]
        order = order[np.argsort(found.ribbon[order].astype(np.int16), kind="stable")]
        key, color = key[order], color[order]
        cut = np.searchsorted(found.ribbon[order], np.arange(len(own) + 1))
        for j, a, b, first in zip(own, cut[:-1], cut[1:], base, strict=False):
            yield crops[j], key[a:b] - first, color[a:b]


def canvas_size(drawing: Drawing, scale: float) -> tuple[int, int]:
    """(width, height) of the drawing's raster at `scale` pixels a pixel."""
    return max(1, round(drawing.size[0] * scale)), max(1, round(drawing.size[1] * scale))


def rasterise(
    drawing: Drawing,
    scale: float = 1.0,
    background: tuple[float, float, float] | None = None,
    texture: bool = True,
    layers: str = "kind",
) -> np.ndarray:
    """The drawing as pixels: (H, W, 3) uint8 on a background (r, g, b) in [0, 1], else (H, W, 4) with straight alpha.

    Strokes are laid over each other in `paint_order`, which has `layers` too. Without a texture, or with `texture`
    False, a stroke is its flat ink with an analytic edge; with one it is the strip, looked up bilinearly, whose alpha
    makes the edge.
    """
    if not scale > 0:
        raise ValueError(f"the scale of a raster must be above 0, got {scale}")
    width, height = canvas_size(drawing, scale)
    canvas = np.zeros((height * width, 4), np.float32)
    order = paint_order(drawing, layers)
    painted = textured_pixels if texture and drawing.texture is not None else flat_pixels
    for crop, pixel, color in painted(drawing, order, scale):
        at = (
            pixel + crop.x0
            if crop.w == width
            else pixel // max(crop.w, 1) * (width - crop.w) + pixel + crop.x0
        )
        at = at + crop.y0 * width
        canvas[at] = color + canvas[at] * (1.0 - color[:, 3:])
    canvas = canvas.reshape(height, width, 4)
    alpha = canvas[..., 3:]
    if background is not None:
        rgb = canvas[..., :3] + (1.0 - alpha) * np.float32(background)
        return np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8)
    rgb = canvas[..., :3] / np.maximum(alpha, 1e-6)
    return np.rint(np.clip(np.concatenate([rgb, alpha], axis=-1), 0, 1) * 255).astype(np.uint8)
