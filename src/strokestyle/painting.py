"""The direct raster of a drawing: the pixels that every file we write is measured against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .ribbons import Ribbon, ribbon, sample_strip
from .strokes import Drawing, Strokes, cone_distance, distinct, paint_order, segments


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
    low, high = np.floor((xy - reach[:, None]).min(axis=0)), np.ceil((xy + reach[:, None]).max(axis=0))
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
    k = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
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
    at = at + (np.arange(len(at)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[at]
    at, k = np.r_[at, len(step)], np.arange(len(xy))
    return (np.stack([np.interp(at, k, c) for c in xy.T], axis=1), *(np.interp(at, k, f) for f in fields))


def coverage(strokes: Strokes, i: int, size: tuple[int, int], scale: float = 1.0) -> tuple[Crop, np.ndarray]:
    """How much of each pixel stroke i covers, in [0, 1]: (crop, (h, w) float64)."""
    crop, pixel, distance, width = _pixel_distances(strokes, i, size, scale, 1.0)
    # the pixel's part within a band: what the near edge lets in less what the far edge shuts out
    part = np.clip(0.5 - distance, 0.0, 1.0) - np.clip(0.5 - distance - width, 0.0, 1.0)
    cover = np.zeros(crop.w * crop.h)
    np.maximum.at(cover, pixel, part)
    return crop, cover.reshape(crop.h, crop.w)


def distance_map(strokes: Strokes, i: int, size: tuple[int, int], reach: float) -> tuple[Crop, np.ndarray]:
    """Signed distance of each pixel's centre to stroke i, px, negative inside: (crop, (h, w)); inf beyond `reach`."""
    crop, pixel, distance, _ = _pixel_distances(strokes, i, size, 1.0, reach)
    nearest = np.full(crop.w * crop.h, np.inf)
    np.minimum.at(nearest, pixel, distance)
    return crop, np.where(nearest <= reach, nearest, np.inf).reshape(crop.h, crop.w)


def _pixel_distances(strokes, i, size, scale, reach):
    """Crop, and for every (segment, pixel) within reach: the pixel, its signed distance, the segment's width."""
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy, radius = distinct(strokes.xy[rows] * scale, 0.5 * strokes.thickness[rows] * scale)
    if len(xy) == 1:
        xy, radius = np.concatenate([xy, xy + [[1e-6, 0.0]]]), np.r_[radius, radius]
    crop = crop_of(xy, radius + reach, size)
    xy, radius = _short_steps(xy, radius)
    k, pixel, at = _near_pairs(xy, radius + reach, crop)
    length, direction, r0, slope = (value[k] for value in segments(xy, radius, np.arange(len(xy) - 1)))
    distance = cone_distance(at - xy[k], length, direction, r0, slope)
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


def ribbon_coordinates(band: Ribbon, crop: Crop) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(pixel, u, v) of a ribbon's pixels, one entry for every arm of the ribbon that does not overlap itself.

    `pixel` (M,) indexes the flattened crop, u (M,) in [0, 1] runs along the ribbon, v (M,) in [-1, 1] across it. A
    pixel takes the closest point of the arm. Where arms meet, a pixel that only reaches an arm's cut end goes to the
    other.
    """
    xy, half, along = _short_steps(band.xy, band.half, band.along)
    entries, spare, taken = [], [], np.zeros(crop.w * crop.h, bool)
    for a, b in _arms(xy):
        p, h, s = xy[a : b + 1], half[a : b + 1], along[a : b + 1]
        k, pixel, at = _near_pairs(p, h, crop)
        length, direction, h0, slope = (value[k] for value in segments(p, h, np.arange(len(p) - 1)))
        rel = at - p[k]
        x = rel[:, 0] * direction[:, 0] + rel[:, 1] * direction[:, 1]
        y = rel[:, 1] * direction[:, 0] - rel[:, 0] * direction[:, 1]
        foot = np.clip(x, 0.0, length)
        distance = np.hypot(x - foot, y)
        v = np.where(y < 0, -distance, distance) / np.maximum(h0 - slope * foot, 1e-9)
        before, past = (x < 0) & (k == 0), (x > length) & (k == len(p) - 2)
        near = np.abs(v) <= 1.0
        if not band.closed:
            near &= ~(before & (a == 0)) & ~(past & (b == len(xy) - 1))
        past |= before
        k, pixel, v, distance, past = k[near], pixel[near], v[near], distance[near], past[near]
        u = (s[k] + foot[near]) / band.length
        best = np.full(crop.w * crop.h, np.inf)
        np.minimum.at(best, pixel, distance)
        first = np.flatnonzero(distance == best[pixel])
        pick = np.full(crop.w * crop.h, -1)
        pick[pixel[first]] = first
        pick = pick[pick >= 0]
        inner, rest = pick[~past[pick]], pick[past[pick]]
        taken[pixel[inner]] = True
        entries.append((pixel[inner], u[inner], v[inner]))
        spare.append((pixel[rest], u[rest], v[rest]))
    return entries + [tuple(value[~taken[pixel]] for value in (pixel, u, v)) for pixel, u, v in spare if len(pixel)]


def stroke_pixels(drawing: Drawing, i: int, scale: float = 1.0, texture: bool = True) -> tuple[Crop, np.ndarray]:
    """Stroke i alone on a canvas of `scale` times the drawing's size: (crop, (h, w, 4) float32 premultiplied)."""
    size = canvas_size(drawing, scale)
    if drawing.texture is None or not texture:
        crop, cover = coverage(drawing.strokes, i, size, scale)
        red, green, blue, alpha = drawing.color[i]
        return crop, (cover * alpha)[..., None].astype(np.float32) * np.float32([red, green, blue, 1.0])
    strips = drawing.texture
    strip = strips.rgba[strips.offsets[i] : strips.offsets[i + 1]].astype(np.float32) / 255.0
    strip[..., :3] *= strip[..., 3:]
    band = ribbon(drawing.strokes, i, strips.margin[i], scale)
    crop = crop_of(band.xy, band.half, size)
    layer = np.zeros((crop.h * crop.w, 4), np.float32)
    for pixel, u, v in ribbon_coordinates(band, crop):
        color = sample_strip(strip, u, v, band.closed)
        stronger = color[:, 3] > layer[pixel, 3]  # where a stroke crosses itself
        layer[pixel[stronger]] = color[stronger]
    return crop, layer.reshape(crop.h, crop.w, 4)


def canvas_size(drawing: Drawing, scale: float) -> tuple[int, int]:
    """(width, height) of the drawing's raster at `scale` pixels a pixel."""
    return max(1, round(drawing.size[0] * scale)), max(1, round(drawing.size[1] * scale))


def rasterise(
    drawing: Drawing, scale: float = 1.0, background: tuple[float, float, float] | None = None, texture: bool = True
) -> np.ndarray:
    """The drawing as pixels: (H, W, 3) uint8 on a background (r, g, b) in [0, 1], else (H, W, 4) with straight alpha.

    Strokes are laid over each other in `paint_order`. Without a texture, or with `texture` False, a stroke is its flat
    ink with an analytic edge; with one it is the strip, looked up bilinearly, whose alpha makes the edge.
    """
    if not scale > 0:
        raise ValueError(f"the scale of a raster must be above 0, got {scale}")
    width, height = canvas_size(drawing, scale)
    canvas = np.zeros((height, width, 4), np.float32)
    for i in paint_order(drawing.strokes):
        crop, layer = stroke_pixels(drawing, int(i), scale, texture)
        canvas[crop.index] = layer + canvas[crop.index] * (1.0 - layer[..., 3:])
    alpha = canvas[..., 3:]
    if background is not None:
        rgb = canvas[..., :3] + (1.0 - alpha) * np.float32(background)
        return np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8)
    rgb = canvas[..., :3] / np.maximum(alpha, 1e-6)
    return np.rint(np.clip(np.concatenate([rgb, alpha], axis=-1), 0, 1) * 255).astype(np.uint8)
