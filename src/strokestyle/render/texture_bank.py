"""The texture bank: strips of the exemplar's strokes, and what they are chosen by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..drawing.ribbon import ribbon
from ..drawing.strokes import Strokes
from ..geometry.curves import arc, owner

ROWS = 2  # texels a px along a strip, and about as many across
END = 40.0  # px from an end of a stroke within which its distance matters
TONE_SIGMA = (
    5.0  # px along the stroke; what varies more slowly is tone, what varies faster is grain
)
OWN_REGRESSORS = (
    4  # that tone depends on beside the features: width, its logarithm, distances to both ends
)


@dataclass(frozen=True)
class TextureBank:
    """What a style remembers of its medium. Arrays only, so that it can be stored beside the networks' weights.

    Parameters
    ----------
    rgba : (T, A, 4) uint8 straight, strips of the training strokes in drawing direction (see `_against_the_hand`)
    offsets : (C+1,) int64 rows of each strip
    row : (T, 4) float32: width of the ribbon without its margins; px from the stroke's start and end, negative in the
        caps, END at most; flaw in [0, 1], the part of the row that other strokes hide
    look : (T, D) float32, appearance round a row, small where two rows can follow each other unseen
    tone : (T, 4) float32, opacity and ink colour round a row
    fitted : (T, 4) float32, that tone as predicted from the features
    weights : (Q, 4) float32, the regression from `_regressors` to tone
    scale : (2, P + OWN_REGRESSORS) float32, mean and standard deviation of the regressors
    noise : (4,) float32, standard deviation of the tone about its prediction
    margin : (1,) float32 px
    flat : (1,) float32, 1 where flat ink tells the drawing better than its strips
    """

    rgba: np.ndarray
    offsets: np.ndarray
    row: np.ndarray
    look: np.ndarray
    tone: np.ndarray
    fitted: np.ndarray
    weights: np.ndarray
    scale: np.ndarray
    noise: np.ndarray
    margin: np.ndarray
    flat: np.ndarray


@dataclass(frozen=True)
class Rows:
    """The rows of all strips of some strokes, in drawing direction.

    offsets (C+1,); width (R,) px of the ribbon without its margins, at least the thickness (R,) px; start, end (R,) px
    from the stroke's ends; features (R, P); turned (C,) bool, against the strokes' own direction; closed (C,) bool
    """

    offsets: np.ndarray
    width: np.ndarray
    thickness: np.ndarray
    start: np.ndarray
    end: np.ndarray
    features: np.ndarray
    turned: np.ndarray
    closed: np.ndarray


def _against_the_hand(strokes: Strokes) -> np.ndarray:
    """(C,) bool: strokes whose points run up or to the left, where a hand would pull the other way.

    Curves have no direction of their own; strips need one, so that a stroke's beginning is laid on a beginning.
    """
    chord = strokes.xy[strokes.offsets[1:] - 1] - strokes.xy[strokes.offsets[:-1]]
    return (chord @ [0.6, 1.0] < 0) & ~strokes.closed


def stroke_rows(strokes: Strokes, features: np.ndarray, margin: float) -> Rows:
    turned = _against_the_hand(strokes)
    count, columns = [], []
    for i in range(len(strokes)):
        part = slice(strokes.offsets[i], strokes.offsets[i + 1])
        band = ribbon(strokes, i, margin)
        n = max(2, round(ROWS * band.length))
        u = (np.arange(n) + 0.5) / n * band.length
        first, last = (
            (0.0, band.length) if band.closed else (band.half[0], band.length - band.half[-1])
        )
        ends = (
            np.full((n, 2), END)
            if band.closed
            else np.minimum(np.stack([u - first, last - u], axis=1), END)
        )
        along = arc(strokes.xy[part])
        along = first + along * (last - first) / max(along[-1], 1e-9)
        carried = np.concatenate([strokes.thickness[part, None], features[part]], axis=1)
        carried = np.stack([np.interp(u, along, column) for column in carried.T], axis=1)
        width = 2.0 * (np.interp(u, band.along, band.half) - margin)
        table = np.concatenate([width[:, None], ends, carried], axis=1)
        if turned[i]:
            table = table[::-1]
            table[:, [1, 2]] = table[:, [2, 1]]
        columns.append(table)
        count.append(n)
    table = np.concatenate(columns)
    offsets = np.r_[0, np.cumsum(count)]
    return Rows(
        offsets,
        table[:, 0],
        table[:, 3],
        table[:, 1],
        table[:, 2],
        table[:, 4:],
        turned,
        strokes.closed,
    )


def solid_ink(tone, bank):
    """Tone (R, 4) with the one opacity that the medium has away from its edges; thin strokes are not all edge."""
    v = np.abs((2.0 * np.arange(bank.rgba.shape[1]) + 1.0) / bank.rgba.shape[1] - 1.0)
    distance = v[None] * (0.5 * bank.row[:, :1] + bank.margin[0])
    middle = (distance < 0.25 * bank.row[:, :1]) & (bank.row[:, 3:] < 0.1)
    alpha = bank.rgba[..., 3][middle]
    opacity = np.quantile(alpha, 0.75) / 255.0 if len(alpha) else 1.0
    return np.concatenate([np.full((len(tone), 1), opacity), tone[:, 1:]], axis=1)


def stroke_ink(rows, tone):
    """The flat ink (C, 4), straight RGBA, of strokes whose rows have `tone` (R, 4)."""
    stroke = owner(rows.offsets)
    weight = rows.width + 0.1
    total = np.bincount(stroke, weight)
    ink = np.stack([np.bincount(stroke, weight * column) / total for column in tone.T], axis=1)
    return np.clip(ink[:, [1, 2, 3, 0]], 0, 1)


def check_strokes(strokes, features):
    features = np.asarray(features, np.float64)
    if features.ndim != 2 or len(features) != len(strokes.xy):
        raise ValueError(f"features must have shape ({len(strokes.xy)}, P), got {features.shape}")
    if not np.isfinite(features).all():
        raise ValueError("the features of the strokes hold values that are not finite")
    return features


def bank_columns(rows, margin):
    """Texels across, enough for the widest row."""
    return int(np.clip(2 * np.ceil(ROWS * (0.5 * rows.width.max(initial=0.0) + margin)), 12, 128))


def smooth_rows(values, offsets, sigma, weight=None):
    """Gaussian along every strip, (R, k); with weights (R,) a weighted mean."""
    weight = np.ones(len(values)) if weight is None else weight
    out = np.empty_like(values, dtype=np.float64)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        w = ndimage.gaussian_filter1d(weight[a:b], sigma, axis=0, mode="nearest")
        flat = ndimage.gaussian_filter1d(
            values[a:b] * weight[a:b, None], sigma, axis=0, mode="nearest"
        )
        out[a:b] = flat / np.maximum(w, 1e-9)[:, None]
    return out


def plain_regressors(rows: Rows) -> np.ndarray:
    ends = np.clip(np.stack([rows.start, rows.end], axis=1), -3.0, END)
    width = rows.width[:, None]
    return np.concatenate([rows.features, width, np.log(width + 1.0), ends], axis=1)


def regressors_of(rows: Rows, scale: np.ndarray) -> np.ndarray:
    """(R, Q): a constant, the standardised features, thickness and end distances, and their squares."""
    x = np.clip((plain_regressors(rows) - scale[0]) / scale[1], -3.0, 3.0)
    return np.concatenate([np.ones((len(x), 1)), x, x * x - 1.0], axis=1)


def straight_alpha(premultiplied):
    alpha = premultiplied[..., 3:]
    return np.concatenate([premultiplied[..., :3] / np.maximum(alpha, 1e-4), alpha], axis=-1)
