"""A stroke's texture strip, resampled and carried along when the stroke is edited."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..geometry.curves import arc_length
from .ribbon import slope_limited_half_widths
from .strokes import Drawing, Strokes

OVERLAP = 0.25  # px by which the pieces of a stroke that was cut lie over each other
MAX_COLUMNS = 256  # texels across a strip
STRETCH = 1.3  # the most by which grain is stretched
GRAIN = 15.0  # px along a stroke, blur that tells tone from grain
TONES = 24  # levels of tone


def strip_of_piece(
    drawing: Drawing, i: int, new: Strokes, k: int, first: int, last: int
) -> np.ndarray:
    """The strip of stroke k of `new`, points `first` to `last` of stroke i: what lay there, nothing past the cuts."""
    texture, margin, closed = (
        drawing.texture,
        float(drawing.texture.margin[i]),
        bool(drawing.strokes.closed[i]),
    )
    strip = texture.rgba[texture.offsets[i] : texture.offsets[i + 1]]
    s, half, _ = _profile(drawing.strokes, i, margin)
    before, after = (0.0, 0.0) if closed else half[[0, -1]]
    rate = len(strip) / max(s[-1] + before + after, 1e-6)  # rows a px
    caps = np.rint((_profile(new, k, margin)[1][[0, -1]] - OVERLAP) * rate).astype(np.int64)
    begin, end = np.rint((before + s[[first, last]] + [-OVERLAP, OVERLAP]) * rate).astype(np.int64)
    if first == 0 and not closed:
        begin, caps[0] = 0, 0
    if last == len(s) - 1 and not closed:
        end, caps[1] = len(strip), 0
    kept = strip[max(begin, 0) : max(end, begin + 2)]
    blank = kept * np.array([1, 1, 1, 0], np.uint8)
    return np.concatenate(
        [blank[:1].repeat(max(caps[0], 0), 0), kept, blank[-1:].repeat(max(caps[1], 0), 0)]
    )


def strip_columns(drawing: Drawing, new: Strokes, changed) -> int:
    """How many texels lie across the new strips: more, where strokes became so much thicker that theirs would show."""
    columns, most = drawing.texture.rgba.shape[1], 1.0
    for i in changed:
        old_half, new_half = (
            _profile(strokes, i, float(drawing.texture.margin[i]))[1]
            for strokes in (drawing.strokes, new)
        )
        most = max(most, new_half.max() / max(old_half.max(), 1e-9))
    return columns if most < 1.3 else min(int(np.ceil(columns * most)), MAX_COLUMNS)


def carried_strip(
    drawing: Drawing, new: Strokes, i: int, was: np.ndarray, columns: int
) -> np.ndarray:
    """The strip of stroke i on the stroke that was made of it.

    Along, tone and ink lie by the point where they lay; across, they are stretched with the thickness, but for the soft
    edge beyond it. Grain keeps its own scale: where it would be stretched by more than STRETCH, it is laid anew.
    """
    old, texture = drawing.strokes, drawing.texture
    margin = float(texture.margin[i])
    strip = texture.rgba[texture.offsets[i] : texture.offsets[i + 1]].astype(np.float64) / 255.0
    n, a = strip.shape[:2]
    old_s, old_half, old_width = _profile(old, i, margin)
    new_s, new_half, new_width = _profile(new, i, margin)
    closed = bool(old.closed[i])
    old_caps, new_caps = (
        ((0.0, 0.0), (0.0, 0.0)) if closed else (old_half[[0, -1]], new_half[[0, -1]])
    )
    old_length, new_length = (
        max(old_s[-1] + sum(old_caps), 1e-6),
        max(new_s[-1] + sum(new_caps), 1e-6),
    )
    rows = max(2, round(n * new_length / old_length))
    u = (np.arange(rows) + 0.5) / rows * new_length - new_caps[
        0
    ]  # px from the new stroke's beginning
    # along: the same point; in a cap, the same share of it
    before = np.interp(np.interp(u, new_s, was), np.arange(len(old_s)), old_s)
    before = np.where(u < 0, u / max(new_caps[0], 1e-9) * old_caps[0], before)
    past = (u - new_s[-1]) / max(new_caps[1], 1e-9) * old_caps[1]
    before = np.where(u > new_s[-1], old_s[-1] + past, before)
    row = (before + old_caps[0]) / old_length * n - 0.5
    # across: ink stretched by how much thicker the stroke became, its soft edge as wide as it was
    w_old, w_new = np.interp(before, old_s, old_width), np.interp(u, new_s, new_width)
    ratio = np.where(w_old > 1e-6, w_new / np.maximum(w_old, 1e-6), 1.0)[:, None]
    h_old, h_new = (
        np.interp(before, old_s, old_half)[:, None],
        np.interp(u, new_s, new_half)[:, None],
    )
    v = (2.0 * np.arange(columns) + 1.0) / columns - 1.0
    away = np.abs(v) * h_new
    core = np.maximum(h_old - margin, 0.0)
    source = np.where(
        away <= core * ratio, away / np.maximum(ratio, 1e-9), core + away - core * ratio
    )
    seen = np.clip(h_old - source + h_old / a, 0, 1)  # past the old ribbon's edge there is nothing
    seen = seen * np.clip(w_new / np.maximum(np.minimum(w_old, 1.0), 1e-6), 0, 1)[:, None]
    column = (np.sign(v) * source / np.maximum(h_old, 1e-9) + 1) * 0.5 * a - 0.5
    row = np.broadcast_to(row[:, None], column.shape)
    strip[..., :3] *= strip[..., 3:]
    mode = "grid-wrap" if closed else "nearest"

    def look(layer, at_row=row, at_column=column, order=1):
        places = [np.clip(at_row, 0, n - 1) if not closed else at_row, np.clip(at_column, 0, a - 1)]
        return ndimage.map_coordinates(layer, places, order=order, mode=mode)

    made = np.stack([look(strip[..., k]) for k in range(4)], axis=-1)
    rate = (
        np.gradient(row[:, 0]) * (new_length / rows) ** -1 * (old_length / n)
        if rows > 2
        else np.ones(rows)
    )
    stretched = np.array(
        [rate.min(), rate.max(), *(1 / np.clip(ratio[w_old > 0.5], 0.05, 20)).T.ravel(), 1.0]
    )
    if stretched.min() < 1 / STRETCH or stretched.max() > STRETCH:
        along = (
            np.cumsum(np.clip(rate, 1 / STRETCH, STRETCH)) * (new_length / rows) / (old_length / n)
        )
        across = np.sign(v) * away / np.clip(ratio, 1 / STRETCH, STRETCH)
        across = (across / np.maximum(h_old, 1e-9) + 1) * 0.5 * a - 0.5
        sigma = (
            GRAIN * n / old_length,
            1.0,
        )  # across, opacity has a shape: what is uneven there is no grain
        made[..., 3] = _regrained(strip[..., 3], sigma, mode, look, along[:, None], across)
        # grain may come to lie where there was no ink: its colour is that of the ink around
        near = ndimage.gaussian_filter(strip, (2.0 * n / old_length, 1.0, 0)) + 1e-4 * strip.mean(
            axis=(0, 1)
        )
        ink = np.stack(
            [look(near[..., k] / np.maximum(near[..., 3], 1e-9)) for k in range(3)], axis=-1
        )
        made[..., :3] = ink * made[..., 3:]
    made *= seen[..., None]
    made[..., :3] /= np.maximum(made[..., 3:], 1e-6)
    return np.rint(np.clip(made, 0, 1) * 255).astype(np.uint8)


def _regrained(
    alpha: np.ndarray, sigma, mode: str, look, along: np.ndarray, across: np.ndarray
) -> np.ndarray:
    """Opacity of stretched tone with grain that is not stretched.

    A texel's grain is its rank among the texels of about its tone, tone the mean opacity along the stroke around it.
    Where the tone goes to, the grain of another place is given the opacity that its rank has there.
    """
    tone = ndimage.gaussian_filter(
        alpha, sigma, mode=("wrap" if mode == "grid-wrap" else "nearest", "constant")
    )
    level = np.minimum((tone * TONES).astype(np.int64), TONES - 1).ravel()
    order = np.lexsort((alpha.ravel(), level))
    count = np.bincount(level, minlength=TONES)
    first = np.cumsum(count) - count
    rank = np.empty(len(order))
    rank[order] = (np.arange(len(order)) - first[level[order]] + 0.5) / count[level[order]]
    ranked = alpha.ravel()[order]
    n, a = alpha.shape
    # mirrored at the strip's edges, as often as it takes
    rows = (n - 1) - np.abs((along + 0 * across) % (2 * (n - 1)) - (n - 1)) if n > 1 else 0 * across
    columns = (a - 1) - np.abs(across % (2 * (a - 1)) - (a - 1)) if a > 1 else 0 * across
    grain = look(rank.reshape(n, a), rows, columns, 0)
    # between two levels of tone, texels take one or the other: a blend of two grains is grey
    place = np.clip(look(tone) * TONES - 0.5, 0, TONES - 1)
    which = np.minimum(place + (grain * 7919.0) % 1.0, TONES - 1).astype(np.int64)
    filled = np.flatnonzero(count)
    which = filled[np.abs(filled[None] - np.arange(TONES)[:, None]).argmin(axis=1)][which]
    return ranked[
        first[which] + np.minimum((grain * count[which]).astype(np.int64), count[which] - 1)
    ]


def _profile(strokes: Strokes, i: int, margin: float):
    """Arc length, half width of the ribbon and thickness at the points of stroke i, each (n,)."""
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy = strokes.xy[rows]
    return (
        arc_length(xy, np.array([0, len(xy)])),
        slope_limited_half_widths(strokes, i, margin),
        strokes.thickness[rows],
    )


def wider(strip: np.ndarray, columns: int) -> np.ndarray:
    """A strip (n, A, 4) uint8 on more columns, bilinearly; `strips_png` finds the few again."""
    if strip.shape[1] == columns:
        return strip
    flat = strip.astype(np.float64)
    flat[..., :3] *= flat[..., 3:] / 255.0
    if strip.shape[1] > 1:
        low, fraction = texel_places(columns, strip.shape[1])
        flat = flat[:, low] * (1 - fraction)[:, None] + flat[:, low + 1] * fraction[:, None]
    flat[..., :3] /= np.maximum(flat[..., 3:] / 255.0, 1e-6)
    return np.rint(np.clip(flat, 0, 255)).astype(np.uint8)


def texel_places(fine: int, coarse: int):
    """For each of `fine` texels, the lower of the two `coarse` ones it lies between and how far it is to the upper."""
    at = np.clip((np.arange(fine) + 0.5) / fine * coarse - 0.5, 0, coarse - 1)
    low = np.minimum(at.astype(np.int64), coarse - 2)
    return low, at - low
