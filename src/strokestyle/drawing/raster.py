"""Paint a drawing as pixels, directly: what every file that we write is measured against.

Flat ink covers a pixel by its distance to the stroke's edge; a texture is looked up at the pixel's
u and v, its place in the stroke's ribbon.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from ..geometry.curves import counting
from ..geometry.threads import in_turn
from .ribbon import Ribbon, ribbon, sample_strips
from .strip import premultiplied, straight
from .strokes import (
    Drawing,
    Strokes,
    merge_coincident_points,
    paint_order,
    round_cone_distance,
    stroke_segments,
)

BATCH = 5e5  # pixels looked at together: what fits into a cache
ARM_TURN = np.radians(150.0)  # a line that turns by no more does not overlap itself


@dataclass(frozen=True)
class Crop:
    """The pixels of a canvas round a stroke: columns x0 .. x0 + w, rows y0 .. y0 + h."""

    x0: int
    y0: int
    w: int
    h: int

    @property
    def index(self) -> tuple[slice, slice]:
        """The crop's rows and columns, to index a canvas (H, W, ...)."""
        return slice(self.y0, self.y0 + self.h), slice(self.x0, self.x0 + self.w)


def crop_of(xy: np.ndarray, reach: np.ndarray, size: tuple[int, int]) -> Crop:
    """Crop a canvas of `size` (width, height) to what is within `reach` (n,) of points (n, 2)."""
    low = np.floor((xy - reach[:, None]).min(axis=0))
    high = np.ceil((xy + reach[:, None]).max(axis=0))
    x0, y0 = np.clip(low, 0, size).astype(int)
    x1, y1 = np.clip(high, 0, size).astype(int)
    return Crop(int(x0), int(y0), int(max(x1 - x0, 0)), int(max(y1 - y0, 0)))


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
    """Paint a drawing: strokes laid over each other in `paint_order`.

    Parameters
    ----------
    scale : pixels of the raster per pixel of the drawing, above 0
    background : (r, g, b) in [0, 1], or None: clear
    texture : False, or a drawing without texture: each stroke is its flat ink with an analytic
        edge. Otherwise it is its strip, looked up bilinearly, whose alpha makes the edge.
    layers : as `paint_order` has it

    Returns
    -------
    (H, W, 3) uint8 on a background, else (H, W, 4) uint8 with straight alpha

    Raises
    ------
    ValueError
        where the scale is not above 0.
    """
    if not scale > 0:
        raise ValueError(f"the scale of a raster must be above 0, got {scale}")
    width, height = canvas_size(drawing, scale)
    canvas = np.zeros((height * width, 4), np.float32)
    order = paint_order(drawing, layers)
    painted = textured_pixels if texture and drawing.texture is not None else flat_pixels
    for crop, pixel, color in painted(drawing, order, scale):
        at = pixel + crop.x0
        if crop.w != width:
            at += pixel // max(crop.w, 1) * (width - crop.w)
        at += crop.y0 * width
        canvas[at] = color + canvas[at] * (1.0 - color[:, 3:])
    image = canvas.reshape(height, width, 4)
    if background is None:
        image = straight(image)
    else:
        image = image[..., :3] + (1.0 - image[..., 3:]) * np.array(background, np.float32)
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def flat_pixels(
    drawing: Drawing, index: np.ndarray, scale: float = 1.0
) -> Iterator[tuple[Crop, np.ndarray, np.ndarray]]:
    """Paint strokes as `textured_pixels` does, in flat ink."""
    size = canvas_size(drawing, scale)
    for i in index:
        crop, cover = stroke_coverage(drawing.strokes, i, size, scale)
        pixel = np.flatnonzero(cover)
        ink = np.r_[drawing.color[i, :3], 1.0] * drawing.color[i, 3]
        yield crop, pixel, (cover.reshape(-1)[pixel, None] * ink).astype(np.float32)


def textured_pixels(
    drawing: Drawing, index: np.ndarray, scale: float = 1.0
) -> Iterator[tuple[Crop, np.ndarray, np.ndarray]]:
    """Paint the strokes of `index` alone, one after the other, each on a canvas of its own.

    The canvas is `scale` times the drawing's size.

    Yields
    ------
    crop, pixel (M,) in the flattened crop, each once, and its premultiplied colour (M, 4) float32

    Raises
    ------
    ValueError
        where the drawing has no texture.
    """
    if drawing.texture is None:
        raise ValueError("a drawing without texture has no textured pixels")
    strips, size, index = drawing.texture, canvas_size(drawing, scale), np.asarray(index)
    texels = premultiplied(strips.rgba.astype(np.float32) / 255.0)
    bands = [ribbon(drawing.strokes, i, strips.margin[i], scale) for i in index]
    crops = [crop_of(band.xy, band.half, size) for band in bands]

    def painted(batch: np.ndarray) -> list[tuple[Crop, np.ndarray, np.ndarray]]:
        found = ribbon_coordinates([bands[j] for j in batch], [crops[j] for j in batch])
        wraps = np.array([bands[j].closed for j in batch], bool)[found.ribbon]
        stroke = index[batch][found.ribbon]
        color = sample_strips(texels, strips.offsets, stroke, found.u, found.v, wraps)
        shown = _strongest_marks(found, color[:, 3], _Boxes.of([crops[j] for j in batch]))
        pixel, color = found.pixel[shown], color[shown]
        ends = np.searchsorted(found.ribbon[shown], np.arange(len(batch) + 1))
        cut = zip(batch, ends[:-1], ends[1:], strict=True)
        return [(crops[j], pixel[a:b], color[a:b]) for j, a, b in cut]

    for several in in_turn(painted, _batches(bands, crops)):
        yield from several


def _batches(bands: list[Ribbon], crops: list[Crop]) -> Iterator[np.ndarray]:
    """Consecutive numbers of ribbons that together have about BATCH pixels to be looked at."""
    work = np.array(
        [
            crop.w * crop.h + 8 * band.length * band.half.max()
            for crop, band in zip(crops, bands, strict=True)
        ]
    )
    batch = np.cumsum(work) // BATCH
    for number in np.unique(batch):
        yield np.flatnonzero(batch == number)


def _strongest_marks(found: RibbonPixels, alpha: np.ndarray, frames: _Boxes) -> np.ndarray:
    """Which pixels show, each of a ribbon once, sorted by ribbon.

    Where a stroke crosses itself the stronger mark shows.
    """
    crossing = np.bincount(found.ribbon, found.arm, len(frames.w))[found.ribbon] > 0
    again = np.flatnonzero(crossing)
    if len(again):
        cell = frames.first[found.ribbon[again]] + found.pixel[again]
        order = np.lexsort((found.arm[again], -alpha[again], cell))
        again, cell = again[order], cell[order]
        again = again[np.r_[True, cell[1:] != cell[:-1]]]
    shown = np.r_[np.flatnonzero(~crossing), again]
    return shown[np.argsort(found.ribbon[shown].astype(np.int16), kind="stable")]


# ------------------------------------------------------------------- distance to a stroke's edge


def stroke_coverage(
    strokes: Strokes, i: int, size: tuple[int, int], scale: float = 1.0
) -> tuple[Crop, np.ndarray]:
    """Measure how much of each pixel stroke i covers.

    The edge is taken as level with the pixel's grid: the cover falls from 1 to 0 over the pixel
    that it passes through.

    Parameters
    ----------
    strokes, i : the stroke
    size : (width, height) of the canvas
    scale : pixels of the canvas per pixel of the drawing

    Returns
    -------
    crop, (h, w) float64 in [0, 1]
    """
    crop, pixel, distance, width = _pixel_distances(strokes, i, size, scale, 1.0)
    # the pixel's part within a band: what the near edge lets in less what the far edge shuts out
    part = np.clip(0.5 - distance, 0.0, 1.0) - np.clip(0.5 - distance - width, 0.0, 1.0)
    cover = np.zeros(crop.w * crop.h)
    np.maximum.at(cover, pixel, part)
    return crop, cover.reshape(crop.h, crop.w)


def distance_map(
    strokes: Strokes, i: int, size: tuple[int, int], reach: float
) -> tuple[Crop, np.ndarray]:
    """Measure the signed distance of each pixel's centre to stroke i.

    Parameters
    ----------
    strokes, i : the stroke
    size : (width, height) of the canvas, px
    reach : px, how far from the stroke distances are wanted

    Returns
    -------
    crop, (h, w) px, negative inside; inf beyond `reach`
    """
    crop, pixel, distance, _ = _pixel_distances(strokes, i, size, 1.0, reach)
    nearest = np.full(crop.w * crop.h, np.inf)
    np.minimum.at(nearest, pixel, distance)
    return crop, np.where(nearest <= reach, nearest, np.inf).reshape(crop.h, crop.w)


def _pixel_distances(
    strokes: Strokes, i: int, size: tuple[int, int], scale: float, reach: float
) -> tuple[Crop, np.ndarray, np.ndarray, np.ndarray]:
    """Crop, and of every (segment, pixel) within reach: pixel, signed distance, segment's width."""
    rows = strokes.rows(i)
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


def _near_pairs(
    xy: np.ndarray, reach: np.ndarray, crop: Crop
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every (segment, pixel) that may touch.

    Returns
    -------
    segment (P,), the pixel's index in the flattened crop (P,), its centre (P, 2)
    """
    a, b = xy[:-1], xy[1:]
    far = np.maximum(reach[:-1], reach[1:])[:, None]
    corner, size = [crop.x0, crop.y0], [crop.w, crop.h]
    low = np.clip(np.floor(np.minimum(a, b) - far - corner), 0, size).astype(np.int64)
    high = np.clip(np.ceil(np.maximum(a, b) + far - corner), 0, size).astype(np.int64)
    columns, rows = np.maximum(high - low, 0).T
    segment, k = _ranges(0 * columns, columns * rows)
    width = columns[segment]
    row = k // np.maximum(width, 1)
    x, y = low[segment, 0] + k - row * width, low[segment, 1] + row
    return segment, y * crop.w + x, np.stack([x + crop.x0 + 0.5, y + crop.y0 + 0.5], axis=1)


def _ranges(begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All whole numbers of ranges begin:end (K,): which range (P,), and the number (P,)."""
    count = np.maximum(end - begin, 0)
    which = np.repeat(np.arange(len(count)), count)
    return which, counting(count) + begin[which]


def _short_steps(xy: np.ndarray, *on_it: np.ndarray) -> tuple[np.ndarray, ...]:
    """A polyline (n, 2) and what lies on it, each (n,), with points added.

    After it a segment's box is not much larger than the segment's surroundings: its half width,
    which is the first of `on_it`.
    """
    step = np.hypot(*np.diff(xy, axis=0).T)
    pieces = np.maximum(np.ceil(step / np.maximum(4.0, on_it[0].max())), 1).astype(np.int64)
    if (pieces == 1).all():
        return (xy, *on_it)
    at = np.repeat(np.arange(len(step)), pieces)
    at = np.r_[at + counting(pieces) / pieces[at], len(step)]
    x, y, *rest = (np.interp(at, np.arange(len(xy)), values) for values in (*xy.T, *on_it))
    return np.stack([x, y], axis=1), *rest


# ------------------------------------------------------------------------------ u and v of pixels


@dataclass(frozen=True)
class RibbonPixels:
    """The pixels of some ribbons, each once for every arm of its ribbon that covers it.

    An arm is a piece of a ribbon that does not overlap itself.

    Parameters
    ----------
    ribbon : (M,) int, whose pixel it is
    pixel : (M,) int, its index in that ribbon's crop, flattened
    u : (M,) in [0, 1], along the ribbon
    v : (M,) in [-1, 1], across it
    arm : (M,) int, the arm's number in its ribbon
    """

    ribbon: np.ndarray
    pixel: np.ndarray
    u: np.ndarray
    v: np.ndarray
    arm: np.ndarray


def ribbon_coordinates(bands: list[Ribbon], crops: list[Crop]) -> RibbonPixels:
    """Find u and v of the pixels of ribbons, of which there is at least one, each in its crop.

    A pixel takes the closest point of the arm. Where arms meet, a pixel that only reaches an arm's
    cut end goes to the other.
    """
    segments, arms = _segments_and_arms(bands, crops)
    found = _pixels_beside(segments, arms)
    found = found.take(_closest_of_each_arm(segments, arms, found))
    frames = _Boxes.of(crops)
    arm = segments.arm[found.segment]
    owner = arms.ribbon[arm]
    pixel = frames.pixel(owner, found.x, found.y)
    # a pixel that only reaches a cut end is spare: it counts where no other arm has it
    cell = frames.first[owner] + pixel
    taken = np.zeros(frames.first[-1], bool)
    taken[cell[~found.spare]] = True
    kept = np.flatnonzero(~found.spare | ~taken[cell])
    u, v = _coordinates(segments, found.take(kept))
    return RibbonPixels(owner[kept], pixel[kept], u, v, arms.number[arm[kept]])


@dataclass(frozen=True)
class _Boxes:
    """Boxes of pixels.

    Parameters
    ----------
    x0, y0, w, h : (B,) int, as `Crop` has them
    first : (B+1,) int, where each one's pixels begin when all boxes are laid one after the other
    """

    x0: np.ndarray
    y0: np.ndarray
    w: np.ndarray
    h: np.ndarray
    first: np.ndarray

    @classmethod
    def of(cls, crops: list[Crop]) -> _Boxes:
        x0, y0, w, h = np.array([[c.x0, c.y0, c.w, c.h] for c in crops], np.int64).reshape(-1, 4).T
        return cls(x0, y0, w, h, np.r_[0, np.cumsum(w * h)])

    def pixel(self, box: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The index of pixels (x, y) (P,) in their boxes, flattened."""
        return (y - self.y0[box]) * self.w[box] + x - self.x0[box]


@dataclass(frozen=True)
class _Arms:
    """The arms of some ribbons.

    Parameters
    ----------
    ribbon : (A,) int, whose arm it is
    number : (A,) int, which of that ribbon's arms
    cut : (A, 2) bool, whether the ribbon goes on before its first and after its last point
    boxes : the pixels that each may reach
    """

    ribbon: np.ndarray
    number: np.ndarray
    cut: np.ndarray
    boxes: _Boxes


@dataclass(frozen=True)
class _Segments:
    """The segments of the centre lines of arms, in order.

    Parameters
    ----------
    start : (K, 2) px
    length : (K,) px
    direction : (K, 2), unit
    half : (K, 2) px, half width of the ribbon at both ends
    u : (K, 2), at both ends
    overhang : (K, 2), in half widths: how far behind its beginning and ahead of its end pixels may
        lie that are nearest to it
    first, last : (K,) bool, of its arm
    arm : (K,) int
    """

    start: np.ndarray
    length: np.ndarray
    direction: np.ndarray
    half: np.ndarray
    u: np.ndarray
    overhang: np.ndarray
    first: np.ndarray
    last: np.ndarray
    arm: np.ndarray

    @classmethod
    def of(cls, band: Ribbon, ends: np.ndarray, first_arm: int) -> _Segments:
        """Those of one ribbon, cut at the points `ends` (A+1,); its arms count from `first_arm`."""
        d = np.diff(band.xy, axis=0)
        length = np.hypot(d[:, 0], d[:, 1])
        u = band.along / band.length
        first, last = np.zeros(len(d), bool), np.zeros(len(d), bool)
        first[ends[:-1]] = last[ends[1:] - 1] = True
        return cls(
            start=band.xy[:-1],
            length=length,
            direction=d / length[:, None],
            half=np.stack([band.half[:-1], band.half[1:]], axis=1),
            u=np.stack([u[:-1], u[1:]], axis=1),
            overhang=_overhang(d, ends, band.closed),
            first=first,
            last=last,
            arm=first_arm + np.repeat(np.arange(len(ends) - 1), np.diff(ends)),
        )

    @classmethod
    def concatenate(cls, pieces: list[_Segments]) -> _Segments:
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in names))


def _segments_and_arms(bands: list[Ribbon], crops: list[Crop]) -> tuple[_Segments, _Arms]:
    """Cut ribbons into arms, and these into segments."""
    segments, owners, numbers, cuts = [], [], [], []
    boxes: list[Crop] = []
    for number, (band, crop) in enumerate(zip(bands, crops, strict=True)):
        band = _shortened(band)
        ends, edge = _arm_ends(band.xy), (crop.x0 + crop.w, crop.y0 + crop.h)
        segments.append(_Segments.of(band, ends, len(boxes)))
        for k, (a, b) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
            owners.append(number)
            numbers.append(k)
            cuts.append((band.closed or a > 0, band.closed or b < len(band.xy) - 1))
            boxes.append(crop_of(band.xy[a : b + 1], band.half[a : b + 1], edge))
    arms = _Arms(np.array(owners), np.array(numbers), np.array(cuts), _Boxes.of(boxes))
    return _Segments.concatenate(segments), arms


def _shortened(band: Ribbon) -> Ribbon:
    """A ribbon whose segments are not much longer than it is wide."""
    xy, half, along = _short_steps(band.xy, band.half, band.along)
    return Ribbon(xy, half, along, band.closed)


def _arm_ends(xy: np.ndarray) -> np.ndarray:
    """The points (A+1,) at which arms of a centre line begin and end: after turns by ARM_TURN."""
    d = np.diff(xy, axis=0)
    heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    cuts = [0]
    if np.ptp(heading) > ARM_TURN:
        low = high = float(heading[0])
        for k, angle in enumerate(heading.tolist()):
            low, high = min(low, angle), max(high, angle)
            if high - low > ARM_TURN and k > cuts[-1]:
                cuts.append(k)
                low = high = angle
    return np.array([*cuts, len(xy) - 1])


def _overhang(d: np.ndarray, ends: np.ndarray, closed: bool) -> np.ndarray:
    """`_Segments.overhang` of one ribbon's segments d (K, 2), px.

    Round a point's outer side pixels lie behind the segment that leaves it, or ahead of the one
    that arrives; at a cut end, anywhere up to the half width.
    """
    heading = np.arctan2(d[:, 1], d[:, 0])
    bend = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
    at_point = np.r_[float(closed), np.where(bend < 0.5 * np.pi, np.sin(bend), 1.0), float(closed)]
    at_point[ends[1:-1]] = 1.0
    return np.stack([at_point[:-1], at_point[1:]], axis=1)


@dataclass(frozen=True)
class _Found:
    """Pixels within ribbons, each once for every segment that it lies beside.

    Parameters
    ----------
    segment : (P,) int
    x, y : (P,) int
    foot : (P,) px along the segment to the point nearest to the pixel's centre
    distance : (P,) float32, px to that point
    spare : (P,) bool, whether it lies past a cut end of the segment's arm
    """

    segment: np.ndarray
    x: np.ndarray
    y: np.ndarray
    foot: np.ndarray
    distance: np.ndarray
    spare: np.ndarray

    def take(self, index: np.ndarray) -> _Found:
        return _Found(*(getattr(self, field.name).take(index) for field in fields(self)))


def _pixels_beside(segments: _Segments, arms: _Arms) -> _Found:
    """The pixels that lie beside segments, within the half width there."""
    h0, h1 = segments.half.T
    wide = np.maximum(h0, h1)
    slabs = _Slabs.along(segments, wide, segments.overhang * wide[:, None])
    boxes, arm = arms.boxes, segments.arm
    low = np.stack([boxes.x0, boxes.y0], axis=1)[arm]
    k, x, y = slabs.pixels(low, low + np.stack([boxes.w, boxes.h], axis=1)[arm])
    ahead, aside = _ahead_and_aside(segments, k, x, y)
    foot = np.clip(ahead, 0.0, segments.length[k])
    distance = np.hypot(ahead - foot, aside)
    near = distance <= h0.take(k) + ((h1 - h0) / segments.length).take(k) * foot
    before = (ahead < 0) & segments.first[k]
    past = (ahead > segments.length[k]) & segments.last[k]
    cut = arms.cut[arm[k]]
    near &= ~(before & ~cut[:, 0]) & ~(past & ~cut[:, 1])
    kept = np.flatnonzero(near)
    return _Found(
        k[kept],
        x[kept],
        y[kept],
        foot[kept],
        distance[kept].astype(np.float32),
        (before | past)[kept],
    )


def _ahead_and_aside(
    segments: _Segments, k: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the centres of pixels (x, y) (P,) lie from the beginning of segments k, px.

    Returns
    -------
    along the segment (P,), and to its left, along the normal (-t_y, t_x), (P,)
    """
    begin_x, begin_y, tx, ty = (
        np.ascontiguousarray(column).take(k)
        for column in (*segments.start.T, *segments.direction.T)
    )
    px, py = x + 0.5 - begin_x, y + 0.5 - begin_y
    return px * tx + py * ty, py * tx - px * ty


def _closest_of_each_arm(segments: _Segments, arms: _Arms, found: _Found) -> np.ndarray:
    """For every pixel of an arm, the one of its segments that is closest: an index into `found`."""
    arm = segments.arm[found.segment]
    cell = arms.boxes.first[arm] + arms.boxes.pixel(arm, found.x, found.y)
    best = np.full(arms.boxes.first[-1], np.inf, np.float32)
    np.minimum.at(best, cell, found.distance)
    closest = np.flatnonzero(found.distance == best[cell])
    pick = np.full(len(best), -1, np.int32)
    pick[cell[closest]] = closest
    return pick[pick >= 0]


def _coordinates(segments: _Segments, found: _Found) -> tuple[np.ndarray, np.ndarray]:
    """u and v (P,) of pixels at their segments."""
    k = found.segment
    h0, h1 = segments.half.T
    part = found.foot / segments.length[k]
    _, aside = _ahead_and_aside(segments, k, found.x, found.y)
    signed = np.where(aside < 0, -found.distance, found.distance)
    v = signed / np.maximum(h0[k] + (h1 - h0)[k] * part, 1e-9)
    u0, u1 = segments.u.T
    return u0[k] + (u1 - u0)[k] * part, v


@dataclass(frozen=True)
class _Slabs:
    """Rectangles that lie along directions.

    Parameters
    ----------
    middle : (K, 2) px
    direction : (K, 2), unit
    reach : (K,) px from the middle to both ends
    half : (K,) px from the middle to both sides
    """

    middle: np.ndarray
    direction: np.ndarray
    reach: np.ndarray
    half: np.ndarray

    @classmethod
    def along(cls, segments: _Segments, half: np.ndarray, overhang: np.ndarray) -> _Slabs:
        """About segments, `half` (K,) px to both sides, `overhang` (K, 2) px beyond both ends."""
        length = segments.length
        reach = 0.5 * (length + overhang.sum(axis=1)) + 1e-6
        to_middle = 0.5 * (length + overhang[:, 1] - overhang[:, 0])
        middle = segments.start + to_middle[:, None] * segments.direction
        return cls(middle, segments.direction, reach, half)

    def pixels(
        self, low: np.ndarray, high: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Every pixel whose centre lies within, from `low` (K, 2) up to `high` (K, 2) alone.

        Returns
        -------
        rectangle (P,), x (P,), y (P,)
        """
        dx, dy = self.direction.T
        tall = self.reach * np.abs(dy) + self.half * np.abs(dx)
        top, bottom = self.middle[:, 1] - tall, self.middle[:, 1] + tall
        k, y = _ranges(*_pixels_between(top, bottom, low[:, 1], high[:, 1]))
        left, right = self._chord(k, y)
        row, x = _ranges(*_pixels_between(left, right, low[k, 0], high[k, 0]))
        return k[row], x, y[row]

    def _chord(self, k: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where rows y (R,) of pixels enter and leave rectangles k."""
        rise = y + 0.5 - self.middle[k, 1]
        # |x dx + rise dy| <= reach and |rise dx - x dy| <= half, for x from the middle
        dx, dy = self.direction.T
        safe_x, safe_y = (np.where(np.abs(d) > 1e-9, d, 1e-9)[k] for d in (dx, dy))
        a, b = -rise * dy[k] / safe_x, self.reach[k] / np.abs(safe_x)
        c, e = rise * dx[k] / safe_y, self.half[k] / np.abs(safe_y)
        x = self.middle[k, 0]
        return np.maximum(a - b, c - e) + x, np.minimum(a + b, c + e) + x


def _pixels_between(
    start: np.ndarray, end: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Begin and end of the pixels low:high (K,) whose middles lie from `start` to `end` (K,) px."""
    begin = np.clip(np.ceil(start - 0.5), low, high).astype(np.int64)
    return begin, np.clip(np.floor(end - 0.5) + 1, low, high).astype(np.int64)
