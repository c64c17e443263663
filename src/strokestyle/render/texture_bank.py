"""The texture bank: strips of the exemplar's strokes, and what they are chosen by.

Three words for one ink: the local ink of a row is what the drawing has there, averaged over
INK_SIGMA; the predicted ink is what a regression makes of the stroke's features there; a stroke's
ink is the mean over its rows, for where it is drawn flat. The first two are (R, 4): opacity, and
the ink's colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..drawing.ribbon import across, ribbon
from ..drawing.strokes import Strokes
from ..geometry.curves import arc, gaussian, owner
from .plan import PULL

ROWS = 2  # texels a px along a strip, and about as many across
END = 40.0  # px from an end of a stroke within which its distance matters
# px along the stroke; what varies more slowly is local ink, what varies faster is grain
INK_SIGMA = 5.0
# on which ink depends beside the features: width, its logarithm, distances to both ends
OWN_REGRESSORS = 4
MIN_COLUMNS, MAX_COLUMNS = 12, 128  # texels across a strip


@dataclass(frozen=True)
class TextureBank:
    """What a style remembers of its medium.

    Parameters
    ----------
    rgba : (T, A, 4) uint8 straight, strips of the training strokes, laid as a hand pulls them
    offsets : (S+1,) int64, strip i is rows offsets[i]:offsets[i+1]
    width : (T,) float32, px, of the ribbon without its margins
    ends : (T, 2) float32, px from the stroke's start and end: negative in the caps, END at most
    occlusion : (T,) float32 in [0, 1], share of the row that other strokes hide
    appearance : (T, D) float32, what is seen around a row: its distance is small where one row can
        follow another unseen
    local_ink : (T, 4) float32
    predicted_ink : (T, 4) float32, from the training strokes' features
    weights : (Q, 4) float32, the regression from `regressors_of` to local ink
    scale : (2, P + OWN_REGRESSORS) float32, mean and standard deviation of the regressors
    noise : (4,) float32, standard deviation of the local ink about its prediction
    margin : px that strips reach beyond half the width
    flat : whether flat ink renders the drawing as well as strips do
    """

    rgba: np.ndarray
    offsets: np.ndarray
    width: np.ndarray
    ends: np.ndarray
    occlusion: np.ndarray
    appearance: np.ndarray
    local_ink: np.ndarray
    predicted_ink: np.ndarray
    weights: np.ndarray
    scale: np.ndarray
    noise: np.ndarray
    margin: float
    flat: bool


@dataclass(frozen=True)
class Rows:
    """The rows of all strips of some strokes, as a hand pulls them.

    Parameters
    ----------
    offsets : (C+1,) int64, the strip of stroke i is rows offsets[i]:offsets[i+1]
    width : (R,) px, of the ribbon without its margins, at least the thickness
    thickness : (R,) px
    ends : (R, 2) px from the stroke's start and end: negative in the caps, END at most
    features : (R, P)
    turned : (C,) bool, the strip runs against the stroke's own direction
    closed : (C,) bool
    """

    offsets: np.ndarray
    width: np.ndarray
    thickness: np.ndarray
    ends: np.ndarray
    features: np.ndarray
    turned: np.ndarray
    closed: np.ndarray


def _against_the_pull(strokes: Strokes) -> np.ndarray:
    """(C,) bool: strokes whose points run up or to the left, where a hand would pull the other way.

    Curves have no direction of their own; strips need one, so that a stroke's beginning is laid on
    a beginning.
    """
    chord = strokes.xy[strokes.offsets[1:] - 1] - strokes.xy[strokes.offsets[:-1]]
    return (chord @ PULL < 0) & ~strokes.closed


def stroke_rows(strokes: Strokes, features: np.ndarray, margin: float) -> Rows:
    """Divide strokes into rows of texture, ROWS a px along.

    Parameters
    ----------
    strokes : C of them
    features : (N, P), at their points
    margin : px that strips reach beyond half the thickness
    """
    turned = _against_the_pull(strokes)
    rows = [_rows_of_stroke(strokes, i, features, margin) for i in range(len(strokes))]
    rows = [part.reversed() if turned[i] else part for i, part in enumerate(rows)]
    return Rows(
        offsets=np.r_[0, np.cumsum([len(part.width) for part in rows])],
        width=np.concatenate([part.width for part in rows]),
        thickness=np.concatenate([part.thickness for part in rows]),
        ends=np.concatenate([part.ends for part in rows]),
        features=np.concatenate([part.features for part in rows]),
        turned=turned,
        closed=strokes.closed,
    )


@dataclass(frozen=True)
class _StrokeRows:
    """The rows of one stroke: fields as those of Rows."""

    width: np.ndarray
    thickness: np.ndarray
    ends: np.ndarray
    features: np.ndarray

    def reversed(self) -> _StrokeRows:
        """The same rows from the other end."""
        back = slice(None, None, -1)
        return _StrokeRows(
            self.width[back], self.thickness[back], self.ends[back, back], self.features[back]
        )


def _rows_of_stroke(strokes: Strokes, i: int, features: np.ndarray, margin: float) -> _StrokeRows:
    """Rows at equal steps along the ribbon of stroke i, in the direction of its points."""
    points = slice(strokes.offsets[i], strokes.offsets[i + 1])
    band = ribbon(strokes, i, margin)
    n = max(2, round(ROWS * band.length))
    u = (np.arange(n) + 0.5) / n * band.length
    if band.closed:
        first, last = 0.0, band.length
        ends = np.full((n, 2), END)
    else:
        first, last = band.half[0], band.length - band.half[-1]
        ends = np.minimum(np.stack([u - first, last - u], axis=1), END)
    # The ribbon's centre line is smoother than the stroke's: its points are found by their share.
    along = arc(strokes.xy[points])
    along = first + along * (last - first) / max(along[-1], 1e-9)
    return _StrokeRows(
        width=2.0 * (np.interp(u, band.along, band.half) - margin),
        thickness=np.interp(u, along, strokes.thickness[points]),
        ends=ends,
        features=_interpolated(u, along, features[points]),
    )


def _interpolated(at: np.ndarray, along: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate values (n, k) that are known at `along` (n,): (m, k)."""
    out = np.empty((len(at), values.shape[1]))
    for k, column in enumerate(values.T):
        out[:, k] = np.interp(at, along, column)
    return out


def solid_ink(ink: np.ndarray, bank: TextureBank) -> np.ndarray:
    """Give local ink (R, 4) the one opacity that the medium has away from its edges.

    A thin stroke is all edge, so its own opacity says little of the medium's.
    """
    distance = np.abs(across(bank.rgba.shape[1]))[None] * (0.5 * bank.width[:, None] + bank.margin)
    middle = (distance < 0.25 * bank.width[:, None]) & (bank.occlusion[:, None] < 0.1)
    alpha = bank.rgba[..., 3][middle]
    opacity = np.quantile(alpha, 0.75) / 255.0 if len(alpha) else 1.0
    return np.concatenate([np.full((len(ink), 1), opacity), ink[:, 1:]], axis=1)


def stroke_ink(rows: Rows, ink: np.ndarray) -> np.ndarray:
    """Average local ink (R, 4) over each stroke: the flat ink (C, 4), straight RGBA in [0, 1]."""
    stroke = owner(rows.offsets)
    weight = rows.width + 0.1
    total = np.bincount(stroke, weight)
    mean = np.stack([np.bincount(stroke, weight * column) / total for column in ink.T], axis=1)
    return np.clip(mean[:, [1, 2, 3, 0]], 0, 1)


def check_strokes(strokes: Strokes, features: np.ndarray) -> np.ndarray:
    """Return features (N, P) as float64. Raises ValueError where they do not fit the strokes."""
    features = np.asarray(features, np.float64)
    if features.ndim != 2 or len(features) != len(strokes.xy):
        raise ValueError(f"features must have shape ({len(strokes.xy)}, P), got {features.shape}")
    if not np.isfinite(features).all():
        raise ValueError("the features of the strokes hold values that are not finite")
    return features


def bank_columns(rows: Rows, margin: float) -> int:
    """How many texels across are enough for the widest row."""
    widest = 0.5 * rows.width.max(initial=0.0) + margin
    return int(np.clip(2 * np.ceil(ROWS * widest), MIN_COLUMNS, MAX_COLUMNS))


def smooth_rows(
    values: np.ndarray, offsets: np.ndarray, sigma: float, weight: np.ndarray | None = None
) -> np.ndarray:
    """Blur values (R, k) along every strip by a Gaussian of `sigma` rows; weighted by (R,)."""
    weight = np.ones(len(values)) if weight is None else weight
    out = np.empty_like(values, dtype=np.float64)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        w = gaussian(weight[a:b], sigma)
        total = gaussian(values[a:b] * weight[a:b, None], sigma)
        out[a:b] = total / np.maximum(w, 1e-9)[:, None]
    return out


def plain_regressors(rows: Rows) -> np.ndarray:
    """What ink depends on, (R, P + OWN_REGRESSORS): features, width, its logarithm, both ends."""
    width = rows.width[:, None]
    ends = np.clip(rows.ends, -3.0, END)
    return np.concatenate([rows.features, width, np.log(width + 1.0), ends], axis=1)


def regressors_of(rows: Rows, scale: np.ndarray) -> np.ndarray:
    """The regressors of local ink, (R, Q): 1, the standardised `plain_regressors`, their squares.

    `scale` (2, P + OWN_REGRESSORS) is the mean and the standard deviation to standardise by.
    """
    x = np.clip((plain_regressors(rows) - scale[0]) / scale[1], -3.0, 3.0)
    return np.concatenate([np.ones((len(x), 1)), x, x * x - 1.0], axis=1)
