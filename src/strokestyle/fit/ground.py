"""The ground of a drawing: the paper's colour in its light, its shadows, and what is printed on it.

A smooth field of block medians is the start. Where a soft shadow makes it wrong, it follows the
paper between the strokes, of which a closing (Serra 1982) says where it is. Lines of ruled and
squared paper run through the whole sheet, like each other and at like distances.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..geometry.threads import each

# The numbers below were set by hand; no ablation of them is kept.

# ground
BLOCK = 48  # px, side of the blocks whose medians are the ground's colour
BLOCK_OFF, BLOCK_OFF_SPREADS = 0.005, 6.0  # of 1, and medians of all: a block this far off is ink
GROUND_SIGMA = 0.7  # blocks, Gaussian over their colours

LIGHT = 0.3  # mean of a ground that shadows are seen on

# shadows; lengths in px at 768
STROKE_WIDTH = 27.0  # strokes are narrower
CALM_SIGMA, FOLLOW_SIGMA = 1.5, 5.0  # of the grain, and of the paper between strokes
SHADE = 0.015  # of the light, that a shadow takes away at least
EDGE_SIGMA, SOFT = 6.0, 0.022  # px; of the light, per px, where a shadow ends; ink does abruptly
TINT = 0.06  # of the light, that a shadow's colours differ by
SOFT_EDGE = 0.5  # px of abrupt edge, by the root of the area, that a shadow may show
MIN_SHADE_AREA = 2500.0  # px, of one shadow
MIN_SHADE_SHARE = 0.002  # of the sheet
NOT_INK = 0.04  # of the light, below the brightest nearby, that is still paper

# printed lines; lengths in px at 768
STRIP = 24.0  # width of the strips that lines are sought in
MAX_SLOPE, SLOPE_STEP = 0.08, 0.0025  # of lines against the sheet's sides
PRESENT = 0.3  # quantile, over all strips, of a line's opacity: it runs through the others
MIN_PRINT, MAX_PRINT = 0.02, 0.7  # opacity of a printed line
MIN_PITCH, MIN_LINES = 9.0, 5  # between lines
EVEN, MIN_EVEN = 0.15, 0.7  # off the usual pitch, and share of the lines that are as even
PRINT_REACH = 4.0  # of a line's ink from its middle
SAME_SLOPE = 0.012  # from one line to all


def ground_field(rgb: np.ndarray) -> np.ndarray:
    """Estimate the ground's colour under every pixel of (H, W, 3).

    Medians of blocks, those of ink mended from their neighbours, smoothed and interpolated; in
    soft shadows the paper itself.
    """
    height, width = rgb.shape[:2]
    rows = np.linspace(0, height, max(1, round(height / BLOCK)) + 1).astype(int)
    cols = np.linspace(0, width, max(1, round(width / BLOCK)) + 1).astype(int)

    def medians(row: int) -> list[np.ndarray]:
        strip = rgb[rows[row] : rows[row + 1]]
        return [
            np.median(strip[:, a:b].reshape(-1, 3), axis=0)
            for a, b in zip(cols[:-1], cols[1:], strict=True)
        ]

    blocks = np.array(each(medians, range(len(rows) - 1)))
    blocks = _without_ink(blocks)
    blocks = ndimage.gaussian_filter(blocks, (GROUND_SIGMA, GROUND_SIGMA, 0), mode="nearest")
    grid = np.meshgrid(_in_blocks(rows, height), _in_blocks(cols, width), indexing="ij")
    planes = [
        ndimage.map_coordinates(blocks[..., k], grid, order=1, mode="nearest") for k in range(3)
    ]
    field = np.stack(planes, axis=-1).astype(np.float32)
    return _with_shadows(rgb, field) if field.mean() >= LIGHT else field


def _without_ink(blocks: np.ndarray) -> np.ndarray:
    """Block medians (m, n, 3); those that hold ink take the colour of the nearest that do not."""
    overall = np.median(blocks.reshape(-1, 3), axis=0)
    steady = ndimage.median_filter(blocks, size=(5, 5, 1), mode="nearest")
    off = np.abs(blocks - steady).max(axis=-1)
    ink = off > BLOCK_OFF + BLOCK_OFF_SPREADS * np.median(off)
    if ink.all():
        return np.broadcast_to(overall, blocks.shape).copy()
    if ink.any():
        nearest = ndimage.distance_transform_edt(ink, return_distances=False, return_indices=True)
        blocks = blocks[tuple(nearest)]
    return blocks


def _in_blocks(edges: np.ndarray, size: int) -> np.ndarray:
    """Where the `size` pixels of a side lie among blocks with these edges (k+1,): (size,)."""
    middle = 0.5 * (edges[:-1] + edges[1:])
    return np.interp(np.arange(size) + 0.5, middle, np.arange(len(middle)))


def _with_shadows(rgb: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Correct a field (H, W, 3) where a soft shadow, or light, makes the paper differ from it."""
    scale = max(rgb.shape[:2]) / 768.0
    usual = np.maximum(field.mean(axis=-1), 1e-3)
    # closed before it is compared: beside the field a shadow's edge is a dark line
    calm = ndimage.gaussian_filter(rgb.mean(axis=-1), CALM_SIGMA * scale)
    closed = ndimage.grey_closing(calm, size=2 * (int(STROKE_WIDTH * scale) // 2 * 2 + 1,)) / usual
    calm = calm / usual
    shaded = np.abs(closed - 1.0) > SHADE
    if shaded.mean() < MIN_SHADE_SHARE:
        return field
    # a blot has edges; the closing's corners are none
    smooth = ndimage.gaussian_filter(closed, EDGE_SIGMA * scale)
    steep = np.hypot(*np.gradient(smooth)) * scale > SOFT
    label, count = ndimage.label(shaded)
    area = np.bincount(label.ravel(), minlength=count + 1)
    hard = np.bincount(label.ravel(), weights=steep.ravel(), minlength=count + 1)
    soft = hard < SOFT_EDGE * np.sqrt(area)
    tint = rgb / np.maximum(field, 1e-3)
    tint = np.abs(tint - tint.mean(axis=-1, keepdims=True)).max(axis=-1)
    tint = np.bincount(label.ravel(), weights=tint.ravel(), minlength=count + 1)
    soft &= (tint < TINT * area) & (area > MIN_SHADE_AREA * scale**2)
    soft[0] = False
    shaded = soft[label]
    if shaded.mean() < MIN_SHADE_SHARE:
        return field
    weight = (calm > closed - NOT_INK).astype(np.float32)
    sigma = FOLLOW_SIGMA * scale
    total = np.maximum(ndimage.gaussian_filter(weight, sigma), 1e-3)
    mixed = ndimage.gaussian_filter(shaded.astype(np.float32), sigma)[..., None]
    factor = np.stack(
        [
            ndimage.gaussian_filter(weight * rgb[..., k] / np.maximum(field[..., k], 1e-3), sigma)
            / total
            for k in range(3)
        ],
        axis=-1,
    )
    return (field * (1.0 + np.minimum(2 * mixed, 1) * (factor - 1.0))).astype(np.float32)


def printed_lines(rgb: np.ndarray, ground: np.ndarray) -> np.ndarray | None:
    """Find the lines of ruled or squared paper in an image (H, W, 3) on its ground.

    Returns (H, W, 3), what is left of the light where they are; None where there are none.
    """
    through = (rgb / np.maximum(ground, 1e-3)).astype(np.float32)
    across, along = each(_printed_across, (through, through.swapaxes(0, 1)))
    if across is None and along is None:
        return None
    out = np.ones_like(through)
    if across is not None:
        out = np.minimum(out, across)
    return out if along is None else np.minimum(out, along.swapaxes(0, 1))


def _printed_across(through: np.ndarray) -> np.ndarray | None:
    """The printed lines that run from left to right, as `printed_lines` gives all."""
    height, width = through.shape[:2]
    scale = max(height, width) / 768.0
    opacity = np.clip(1.0 - through.min(axis=-1), 0, MAX_PRINT)
    edges = np.linspace(0, width, max(8, round(width / (STRIP * scale))) + 1).astype(int)
    strips = np.stack(
        [np.median(opacity[:, a:b], axis=1) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    )
    strips = strips - ndimage.median_filter(strips, size=(1, 2 * int(4 * scale) + 3))
    at = 0.5 * (edges[:-1] + edges[1:]) - 0.5 * width
    slopes = np.arange(-MAX_SLOPE, MAX_SLOPE + 1e-9, SLOPE_STEP)
    rows = np.arange(height)
    present = np.empty((len(slopes), height), np.float32)
    for k, slope in enumerate(slopes):
        y = np.clip(rows + np.rint(slope * at)[:, None].astype(int), 0, height - 1)
        near = np.take_along_axis(strips, y, axis=1)
        present[k] = np.quantile(near, PRESENT, axis=0)
    middles = _even_peaks(present.max(axis=0), slopes[present.argmax(axis=0)], scale)
    if middles is None:
        return None
    lines = _traced(strips, at, *middles)
    return _print_of(through, lines, scale)


def _even_peaks(
    present: np.ndarray, slope: np.ndarray, scale: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Rows (n,) where lines of like distances and slopes (n,) are; None where there are none."""
    peak = present == ndimage.maximum_filter1d(present, 2 * int(MIN_PITCH * scale / 2) + 1)
    rows = np.flatnonzero(peak & (present > MIN_PRINT))
    # a line that is as strong in rows side by side is one line
    rows = rows[np.diff(rows, prepend=-len(present)) > 0.5 * MIN_PITCH * scale]
    if len(rows) < MIN_LINES:
        return None
    rows = rows[present[rows] > 0.4 * np.median(present[rows])]
    rows = rows[np.abs(slope[rows] - ndimage.median_filter(slope[rows], 5)) < SAME_SLOPE]
    if len(rows) < MIN_LINES:
        return None
    gaps = np.diff(rows)
    pitch = np.median(gaps)
    times = np.maximum(np.rint(gaps / pitch), 1)
    even = np.abs(gaps / times / pitch - 1) < EVEN
    if even.mean() < MIN_EVEN or times.sum() * pitch < 0.4 * len(present):
        return None
    # those that strokes hide lie evenly between their neighbours
    index = np.r_[0, np.cumsum(times)]
    every = np.arange(index[-1] + 1)
    middle, fall = np.interp(every, index, rows), np.interp(every, index, slope[rows])
    before, after = (middle[0] - pitch, middle[-1] + pitch)
    if before > 0:
        middle, fall = np.r_[before, middle], np.r_[fall[0], fall]
    if after < len(present) - 1:
        middle, fall = np.r_[middle, after], np.r_[fall, fall[-1]]
    return middle, fall


def _traced(
    strips: np.ndarray, at: np.ndarray, middles: np.ndarray, slopes: np.ndarray
) -> np.ndarray:
    """Lines (n, 3), as y = a + b x + c x x of x from the middle, from where strips have them."""
    lines, reach = [], np.arange(-2, 3)
    for middle, slope in zip(middles, slopes, strict=True):
        y = np.rint(middle + slope * at).astype(int)
        rows = np.clip(y[:, None] + reach, 0, strips.shape[1] - 1)
        value = np.maximum(np.take_along_axis(strips, rows, axis=1), 0) ** 2 + 1e-9
        found = (value * rows).sum(axis=1) / value.sum(axis=1) + 0.5
        weight = np.sqrt(value.max(axis=1))
        weight = np.minimum(weight, np.median(weight))
        off = found - (middle + 0.5 + slope * at)
        for _ in range(4):
            fit = np.polyfit(at, off, 2, w=weight + 1e-6)
            weight = weight / (1 + (off - np.polyval(fit, at)) ** 2)
        lines.append([middle + 0.5 + fit[2], slope + fit[1], fit[0]])
    return np.array(lines)


def _print_of(through: np.ndarray, lines: np.ndarray, scale: float) -> np.ndarray:
    """What lines (n, 3) leave of the light: the median of what is seen at each distance."""
    height, width = through.shape[:2]
    x = np.arange(width) + 0.5 - 0.5 * width
    reach = int(np.ceil(PRINT_REACH * max(scale, 0.5)))
    middle = lines[:, :1] + lines[:, 1:2] * x + lines[:, 2:] * x * x
    rows = np.floor(middle)[:, None, :].astype(int) + np.arange(-reach, reach + 1)[:, None]
    off = rows + 0.5 - middle[:, None, :]
    inside = (rows >= 0) & (rows < height)
    columns = np.broadcast_to(np.arange(width), rows.shape)
    seen = through[rows.clip(0, height - 1), columns]
    bins = np.rint(2 * off).astype(int) + 2 * reach + 2
    profile = np.ones((4 * reach + 5, 3), np.float32)
    for k in range(2, len(profile) - 2):
        here = inside & (bins == k)
        if here.sum() > width // 4:
            profile[k] = np.minimum(np.median(seen[here], axis=0), 1.0)
    profile = np.where(1.0 - profile < 0.25 * MIN_PRINT, 1.0, profile)
    out = np.ones_like(through)
    at = 2 * off + 2 * reach + 2
    strength = _strengths(seen, at, profile)
    for k in range(3):
        value = 1.0 - strength * (1.0 - np.interp(at, np.arange(len(profile)), profile[:, k]))
        np.minimum.at(
            out[..., k], (rows[inside], columns[inside]), value[inside].astype(np.float32)
        )
    return out


def _strengths(seen: np.ndarray, at: np.ndarray, profile: np.ndarray) -> np.ndarray:
    """How much stronger than all each line is, (n, 1, 1)."""
    channel = int(profile.min(axis=0).argmin())
    usual = 1.0 - np.interp(at, np.arange(len(profile)), profile[:, channel])
    strong = usual > 0.6 * usual.max(initial=0.0)
    ratio = np.where(strong, (1.0 - seen[..., channel]) / np.maximum(usual, 1e-3), np.nan)
    with np.errstate(all="ignore"):
        middle = np.array(
            [np.median(one[~np.isnan(one)]) if (~np.isnan(one)).any() else 1 for one in ratio]
        )
    return np.clip(middle, 0.0, 1.6)[:, None, None]
