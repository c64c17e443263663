"""See strokes as ribbons, which is how their texture sees them: u along and v across."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import arc, blurred
from ..geometry.near import near_pairs
from .strokes import SAME_POINT, Strokes, merge_coincident_points

STIFFNESS = 0.35  # of a ribbon's half width: sigma of its centre line's smoothing
MAX_SPACING = 3.0  # px between the points of a centre line that was smoothed
NARROWING = 0.25  # px a px: the most by which a ribbon's half width falls along it


@dataclass(frozen=True)
class Ribbon:
    """A stroke's centre line as its texture sees it: run on past the ends of an open stroke.

    Parameters
    ----------
    xy : (n, 2) float64, pixels; no two neighbours coincide
    half : (n,) float64, pixels from the centre line to v = 1
    along : (n,) float64, pixels of arc length from the ribbon's beginning
    closed : bool, its end is its beginning
    """

    xy: np.ndarray
    half: np.ndarray
    along: np.ndarray
    closed: bool

    @property
    def length(self) -> float:
        """Arc length of the whole, px."""
        return float(self.along[-1])


def slope_limited_half_widths(strokes: Strokes, i: int, margin: float) -> np.ndarray:
    """Measure from the centre line to the edge of the ribbon at each point of stroke i, (n,) px.

    Half the thickness plus `margin`; but where a stroke narrows faster than NARROWING, as at a
    blunt end, the ribbon does not: there the texture's alpha is the shape, and its grain is not
    squeezed to a point. It is the least function that is nowhere below half the thickness and
    whose slope is nowhere above NARROWING (the upper Lipschitz, or Pasch-Hausdorff, envelope), by
    a running maximum each way along the stroke.
    """
    rows = strokes.rows(i)
    half, s = 0.5 * strokes.thickness[rows], NARROWING * arc(strokes.xy[rows])
    count = len(half)
    if strokes.closed[i]:
        half, s = np.tile(half, 3), np.concatenate([s - s[-1], s, s + s[-1]])
    ahead = np.maximum.accumulate(half + s) - s
    half = np.maximum(ahead, np.maximum.accumulate((half - s)[::-1])[::-1] + s)
    return half[count : 2 * count] + margin if strokes.closed[i] else half + margin


def ribbon(strokes: Strokes, i: int, margin: float, scale: float = 1.0) -> Ribbon:
    """Make the ribbon of stroke i.

    A broad ribbon cannot follow every tremor of its centre line without folding: it is smoothed by
    STIFFNESS of its half width. An open stroke runs straight on past both ends, by the half width
    there. It is made once: a stroke's texture and its tones ask for the same one.

    Parameters
    ----------
    strokes, i : the stroke
    margin : px beyond the half thickness that the ribbon reaches
    scale : all lengths are multiplied by it, `margin` too
    """
    key = int(i), float(margin)
    band: Ribbon | None = strokes.ribbons.get(key)
    if band is None:
        band = strokes.ribbons[key] = _ribbon(strokes, i, margin)
    if scale == 1.0:
        return band
    return Ribbon(band.xy * scale, band.half * scale, band.along * scale, band.closed)


def _ribbon(strokes: Strokes, i: int, margin: float) -> Ribbon:
    xy, half = merge_coincident_points(
        strokes.xy[strokes.rows(i)], slope_limited_half_widths(strokes, i, margin)
    )
    closed = bool(strokes.closed[i]) and len(xy) > 3
    if len(xy) > 2:
        xy, half = _stiffened(xy, half, closed)
    if not closed:
        out = xy[[0, -1]] - xy[[1, -2]] if len(xy) > 1 else np.array([[-1.0, 0.0], [1.0, 0.0]])
        out = out / np.hypot(out[:, 0], out[:, 1])[:, None]
        reach = np.maximum(half[[0, -1]], 1e-3)
        xy = np.concatenate([xy[:1] + reach[0] * out[:1], xy, xy[-1:] + reach[1] * out[1:]])
        half = np.concatenate([half[:1], half, half[-1:]])
    return Ribbon(xy, half, arc(xy), closed)


def _stiffened(xy: np.ndarray, half: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Even points (m, 2) on a smoothed centre line, and its half widths (m,).

    Sigma is STIFFNESS times the median half width.
    """
    along = arc(xy)
    sigma = STIFFNESS * float(np.median(half))
    count = max(3, int(np.ceil(along[-1] / max(1.0, min(sigma, MAX_SPACING)))))
    at = np.linspace(0.0, along[-1], count + 1)
    even = np.stack([np.interp(at, along, column) for column in xy.T], axis=1)
    half = np.interp(at, along, half)
    smooth = blurred(even, sigma * count / along[-1], closed)
    if closed:
        smooth[-1] = smooth[0]
    apart = np.hypot(*np.diff(smooth, axis=0).T) > SAME_POINT
    keep = np.concatenate([[True], apart])
    return smooth[keep], half[keep]


def overlaps(band: Ribbon, margin: float) -> bool:
    """Tell whether a ribbon lies on ink of its own: it crosses itself, or turns back close by.

    Parameters
    ----------
    band : Ribbon
    margin : px of its half width that hold no ink
    """
    step = max(1.0, 0.4 * float(band.half.min()))
    s = np.linspace(0.0, band.length, max(3, int(np.ceil(band.length / step)) + 1))
    xy = np.stack([np.interp(s, band.along, column) for column in band.xy.T], axis=1)
    half = np.interp(s, band.along, band.half)
    if band.length * half.mean() > 4.0 * np.prod(np.ptp(xy, axis=0) + 2.0 * half.max()):
        return True  # its area is larger than its box allows without overlap
    i, j = near_pairs(xy, 2.0 * half.max()).T
    apart = s[j] - s[i]
    if band.closed:
        apart = np.minimum(apart, band.length - apart)
    both = half[i] + half[j]
    near = np.hypot(*(xy[i] - xy[j]).T) < both - margin
    return bool((near & (apart > 0.6 * np.pi * both)).any())


def across(columns: int) -> np.ndarray:
    """Give v of the middles of the texels across a strip, (columns,): its edges are -1 and 1."""
    return (2.0 * np.arange(columns) + 1.0) / columns - 1.0


def strip_points(band: Ribbon, rows: int, columns: int) -> np.ndarray:
    """Place the texels of a strip (rows, columns) on the image, (rows, columns, 2) pixels."""
    u = (np.arange(rows) + 0.5) / rows * band.length
    # tangents are blended along each segment, so that rows fan out evenly round a bend instead of
    # jumping at its points
    d = np.diff(band.xy, axis=0)
    d = d / np.hypot(d[:, 0], d[:, 1])[:, None]
    middle = 0.5 * (band.along[1:] + band.along[:-1])
    tangent = np.stack([np.interp(u, middle, d[:, k]) for k in (0, 1)], axis=1)
    tangent = tangent / np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    centre = np.stack([np.interp(u, band.along, band.xy[:, k]) for k in (0, 1)], axis=1)
    away = across(columns)[None] * np.interp(u, band.along, band.half)[:, None]
    return (
        centre[:, None]
        + away[..., None] * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)[:, None]
    )


def strip_stretch(band: Ribbon, rows: int, columns: int) -> np.ndarray:
    """Measure how far texels lie apart along the ribbon, relative to the centre line's.

    Returns
    -------
    (rows, columns): 1 where the ribbon is straight, above 1 outside a bend, below 0 where the
    inside of a bend is folded
    """
    at = strip_points(band, rows, columns)
    ahead = np.diff(at, axis=0, append=2 * at[-1:] - at[-2:-1])
    middle = ahead[:, [(columns - 1) // 2, columns // 2]].mean(axis=1)
    size = np.maximum(np.square(middle).sum(axis=1), 1e-12)
    return np.einsum("rck,rk->rc", ahead, middle) / size[:, None]


def sample_strips(
    texels: np.ndarray,
    offsets: np.ndarray,
    strip: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    wraps: np.ndarray,
) -> np.ndarray:
    """Look strips up bilinearly.

    Parameters
    ----------
    texels : (T, A, L) float, colours premultiplied; strip i is rows offsets[i]:offsets[i+1]
    offsets : (C+1,) int
    strip : (M,) int, which strip is looked up
    u, v : (M,) in [0, 1] and in [-1, 1]
    wraps : (M,) bool, whether the strip's end is its beginning

    Returns
    -------
    (M, L)
    """
    first, rows, columns = offsets[strip], np.diff(offsets)[strip], texels.shape[1]
    row, column = u * rows - 0.5, np.clip((v + 1.0) * (0.5 * columns) - 0.5, 0, columns - 1)
    above, left = np.floor(row).astype(np.int64), column.astype(np.int64)
    left = np.minimum(left, max(columns - 2, 0))
    down = (row - above).astype(np.float32)[:, None]
    right = (column - left).astype(np.float32)[:, None]
    below = np.where(above + 1 < rows, above + 1, np.where(wraps, 0, rows - 1))
    above = np.where(above >= 0, above, np.where(wraps, rows - 1, 0))
    flat, step = texels.reshape(-1, texels.shape[2]), min(1, columns - 1)

    def between(row: np.ndarray) -> np.ndarray:
        at = (first + row) * columns + left
        left_of, right_of = flat.take(at, axis=0), flat.take(at + step, axis=0)
        left_of *= 1 - right
        right_of *= right
        return np.add(left_of, right_of, out=left_of)

    upper, lower = between(above), between(below)
    upper *= 1 - down
    lower *= down
    return np.add(upper, lower, out=upper)
