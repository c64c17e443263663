"""Texture by example: the artist's marks, cut into strips along the training strokes and laid along new ones.

Image quilting (Efros and Freeman 2001) in the strokes' own u-v space: a new stroke is a sequence of runs copied from
the training strips, chosen jointly by dynamic programming so that features, thickness, tone and ends agree and runs are
long, joined along least-error cuts. What varies slowly (tone) follows a regression on the features; grain is copied.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..drawing.raster import distance_map
from ..drawing.ribbon import ribbon, strip_points, strip_stretch
from ..drawing.strokes import Strokes, Texture
from ..fit.exemplar import Exemplar
from ..geometry.curves import arc, owner

ROWS = 2  # texels a px along a strip, and about as many across
LEAST_MARGIN = 2.0  # px that strips reach beyond the half thickness, where the ink ends sharply there
CLAIM = 10.0  # px round a stroke that are looked at to tell whose ink lies there
TRACE = 0.02  # of the mean opacity inside: less ink than that is none
NODE = 4  # px between the choices along a new stroke
END = 40.0  # px from an end of a stroke within which its distance matters
TONE_SIGMA = 5.0  # px along the stroke; what varies more slowly is tone, what varies faster is grain
CANDIDATES = 24  # source positions weighed at every choice
LUCK = 0.3  # how far chance decides between sources that cost about the same
FLAW, JUMP, SEEN, OVER = 12.0, 3.0, 60.0, 4.0  # costs: of hidden rows, of a joint, of what it shows, past a strip's end
FLAT_TAX = 1.1  # flat ink may err this many times as much as strips: it is crisp at any size, and easy to edit
CLEAN = 0.12  # and where it errs less than this, nobody misses a texture
SIGHT = 1.2  # px, blur under which flat ink and strips are compared
OWN_REGRESSORS = 4  # that tone depends on beside the features: width, its logarithm, distances to both ends
LEAST_NOISE = np.array([0.03, 0.02, 0.02, 0.02])
TONE_COST, WIDTH_COST = 0.7, 5.8  # weights of a standard deviation of tone, of a factor e in width
FEATHER = 3.0  # rows over which two runs fade into each other at a cut
HALF_CUT = 4  # px to either side of a joint within which the least-error cut is sought


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


def _rows(strokes: Strokes, features: np.ndarray, margin: float) -> Rows:
    turned = _against_the_hand(strokes)
    count, columns = [], []
    for i in range(len(strokes)):
        part = slice(strokes.offsets[i], strokes.offsets[i + 1])
        band = ribbon(strokes, i, margin)
        n = max(2, round(ROWS * band.length))
        u = (np.arange(n) + 0.5) / n * band.length
        first, last = (0.0, band.length) if band.closed else (band.half[0], band.length - band.half[-1])
        ends = np.full((n, 2), END) if band.closed else np.minimum(np.stack([u - first, last - u], axis=1), END)
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
    return Rows(offsets, table[:, 0], table[:, 3], table[:, 1], table[:, 2], table[:, 4:], turned, strokes.closed)


# ------------------------------------------------------------------------------------------------------ learning


def learn_texture(strokes: Strokes, features: np.ndarray, exemplar: Exemplar, seed: int = 0) -> TextureBank:
    """Cut the exemplar into strips along the strokes that were fitted to it.

    Parameters
    ----------
    strokes : fitted training strokes, in the exemplar's pixels
    features : (N, P) float, one row per stroke point; `synthesise` needs the same features of the new strokes
    seed : decides the joints where flat ink and strips compete

    Raises
    ------
    ValueError
        without strokes, or on features that do not fit them.
    """
    features = _checked(strokes, features)
    if not len(strokes):
        raise ValueError("learn_texture: no strokes to learn from")
    claims = _claims(strokes, exemplar.alpha.shape[::-1])
    margin = _margin(claims, exemplar.alpha)
    rows = _rows(strokes, features, margin)
    strips, valid = _cut_strips(strokes, rows, exemplar, claims, margin)
    flaw = 1.0 - valid.mean(axis=1)
    strips = _mend(strips, valid, rows, margin)
    core = _core(rows.width, margin, strips.shape[1])
    tone = _tone(strips, core, rows.offsets, 1.0 - flaw)
    plain = _plain_regressors(rows)
    scale = np.stack([plain.mean(axis=0), np.maximum(plain.std(axis=0), 1e-6)])
    design = _regressors(rows, scale)
    weights, noise = _regress(design, tone, owner(rows.offsets), (1.0 - flaw) * (core * strips[..., 3]).sum(axis=1))
    bank = TextureBank(
        rgba=np.rint(np.clip(_straight(strips), 0, 1) * 255).astype(np.uint8),
        offsets=rows.offsets,
        row=np.stack([rows.width, rows.start, rows.end, flaw], axis=1).astype(np.float32),
        look=_look(strips, rows.offsets).astype(np.float32),
        tone=tone.astype(np.float32),
        fitted=(design @ weights).astype(np.float32),
        weights=weights.astype(np.float32),
        scale=scale.astype(np.float32),
        noise=noise.astype(np.float32),
        margin=np.array([margin], np.float32),
        flat=np.zeros(1, np.float32),
    )
    flat = _flat_does(bank, rows, strips, flaw, seed)
    return replace(bank, flat=np.array([flat], np.float32))


def _flat_does(bank: TextureBank, rows: Rows, strips: np.ndarray, flaw: np.ndarray, seed: int) -> bool:
    """Whether flat ink renders the training strokes as well as strips of the other strokes do.

    Compared are not pixels, which would favour a blur, but what the eye takes from a mark: darkness and its unevenness,
    edges across and grain along, each averaged over cells of some px.
    """
    itself = np.eye(len(rows.offsets) - 1, dtype=bool) if len(rows.offsets) > 2 else None
    fitted = bank.fitted.astype(np.float64)
    chosen = _choose(bank, rows, fitted, np.random.default_rng(seed), itself)
    laid = _lay(bank, rows, chosen, fitted).astype(np.float32) / 255.0
    laid[..., :3] *= laid[..., 3:]
    columns, margin = strips.shape[1], float(bank.margin[0])
    v = (2.0 * np.arange(columns) + 1.0) / columns - 1.0
    distance = np.abs(v)[None] * (0.5 * rows.width + margin)[:, None]
    cover = np.clip(0.5 * rows.thickness[:, None] - distance + 0.5, 0, 1)
    cover *= (np.minimum(rows.start, rows.end) > -0.5 * rows.thickness)[:, None]
    ink = _stroke_ink(rows, _solid(fitted, bank))[owner(rows.offsets)]
    plain = (cover * ink[:, 3:])[..., None] * np.concatenate([ink[:, :3], np.ones((len(ink), 1))], axis=1)[:, None]
    body = np.minimum(rows.start, rows.end) > -1.0
    weight = (flaw < 0.2) & body
    truth = _traits(strips, rows, weight)
    scale = np.abs(truth).mean(axis=0) + 0.01
    errors = [float((np.abs(_traits(made, rows, weight) - truth) / scale).mean()) for made in (plain, laid)]
    return errors[0] <= max(FLAT_TAX * errors[1], CLEAN)


def _traits(strips, rows, weight):
    """What marks look like, per cell: (cells, traits). Cells are 12 px long and a quarter of the strip across."""
    tone = np.stack([strips[..., 3], strips[..., 3] - strips[..., :3].mean(axis=2)], axis=2)
    tone = ndimage.gaussian_filter(tone, (SIGHT * ROWS, SIGHT * ROWS, 0))
    per_px = ROWS * 1.0
    across = np.abs(np.diff(tone, axis=1, append=0)) * per_px
    along = np.abs(np.diff(tone, axis=0, append=0)) * per_px
    along[rows.offsets[1:] - 1] = 0.0
    maps = np.concatenate([tone, across, along, np.square(tone)], axis=2)
    cell = np.arange(len(tone)) // (12 * ROWS)
    count = np.bincount(cell, weight, minlength=cell[-1] + 1)
    bands = [part.mean(axis=1) for part in np.array_split(maps, 4, axis=1)]
    table = np.concatenate(bands, axis=1) * weight[:, None]
    sums = np.stack([np.bincount(cell, column, minlength=cell[-1] + 1) for column in table.T], axis=1)
    return (sums / np.maximum(count, 1)[:, None])[count > 6 * ROWS]


def _solid(tone, bank):
    """Tone (R, 4) with the one opacity that the medium has away from its edges; thin strokes are not all edge."""
    v = np.abs((2.0 * np.arange(bank.rgba.shape[1]) + 1.0) / bank.rgba.shape[1] - 1.0)
    distance = v[None] * (0.5 * bank.row[:, :1] + bank.margin[0])
    middle = (distance < 0.25 * bank.row[:, :1]) & (bank.row[:, 3:] < 0.1)
    alpha = bank.rgba[..., 3][middle]
    opacity = np.quantile(alpha, 0.75) / 255.0 if len(alpha) else 1.0
    return np.concatenate([np.full((len(tone), 1), opacity), tone[:, 1:]], axis=1)


def _stroke_ink(rows, tone):
    """The flat ink (C, 4), straight RGBA, of strokes whose rows have `tone` (R, 4)."""
    stroke = owner(rows.offsets)
    weight = rows.width + 0.1
    total = np.bincount(stroke, weight)
    ink = np.stack([np.bincount(stroke, weight * column) / total for column in tone.T], axis=1)
    return np.clip(ink[:, [1, 2, 3, 0]], 0, 1)


def _checked(strokes, features):
    features = np.asarray(features, np.float64)
    if features.ndim != 2 or len(features) != len(strokes.xy):
        raise ValueError(f"features must have shape ({len(strokes.xy)}, P), got {features.shape}")
    if not np.isfinite(features).all():
        raise ValueError("the features of the strokes hold values that are not finite")
    return features


@dataclass(frozen=True)
class Claims:
    """Whose pixels are whose: stroke (H, W) that each lies deepest in, -1 where none is near; px by which it lies
    outside that stroke (negative inside), and outside the next one, inf where there is none."""

    stroke: np.ndarray
    distance: np.ndarray
    rival: np.ndarray


def _claims(strokes, size):
    width, height = size
    stroke = np.full((height, width), -1)
    distance, rival = np.full((height, width), np.inf), np.full((height, width), np.inf)
    for i in range(len(strokes)):
        crop, own = distance_map(strokes, i, size, CLAIM)
        box = crop.index
        old = distance[box]
        better = own < old
        rival[box] = np.where(better, old, np.minimum(rival[box], own))
        stroke[box] = np.where(better, i, stroke[box])
        distance[box] = np.where(better, own, old)
    return Claims(stroke, distance, rival)


def _margin(claims, alpha):
    """Pixels beyond the strokes' edges within which all but a trace of their ink lies."""
    alone = claims.rival > CLAIM
    ring = [alone & (claims.distance > k) & (claims.distance <= k + 1) for k in range(int(CLAIM))]
    inside = alone & (claims.distance < 0)
    if not inside.any():
        return LEAST_MARGIN
    level = TRACE * alpha[inside].mean()
    faint = [k for k, cells in enumerate(ring) if not cells.any() or alpha[cells].mean() < level]
    return float(np.clip((faint[0] if faint else CLAIM) + 1, LEAST_MARGIN, CLAIM - 2))


def _cut_strips(strokes, rows, exemplar, claims, margin):
    """Premultiplied samples along every stroke (R, A, 4), and (R, A) bool, False where they are not the stroke's own:
    where another stroke lies, or a bend folds or tears the strip."""
    height, width = exemplar.alpha.shape
    columns = _columns(rows, margin)
    planes = [exemplar.ink[..., k] * exemplar.alpha for k in range(3)] + [exemplar.alpha]
    planes = [ndimage.spline_filter(plane, 3, output=np.float32) for plane in planes]
    strips, valid = [], []
    for i in range(len(strokes)):
        band = ribbon(strokes, i, margin)
        n = rows.offsets[i + 1] - rows.offsets[i]
        at = strip_points(band, n, columns)[..., ::-1].transpose(2, 0, 1) - 0.5
        strip = [ndimage.map_coordinates(plane, at, order=3, mode="nearest", prefilter=False) for plane in planes]
        strip = np.stack(strip, axis=-1)
        inside = np.rint(at).astype(np.int64)
        y, x = np.clip(inside[0], 0, height - 1), np.clip(inside[1], 0, width - 1)
        mine = claims.stroke[y, x] == i
        own = np.where(mine, claims.distance[y, x], claims.rival[y, x])
        other = np.where(mine, claims.rival[y, x], claims.distance[y, x])
        # another stroke's soft edge does no harm well inside this one
        free = other > np.where(own < -1.0, 0.5, margin - 1.0)
        stretch = strip_stretch(band, n, columns)
        free &= (stretch > 0.4) & (stretch < 2.0)
        if rows.turned[i]:
            strip, free = strip[::-1, ::-1], free[::-1, ::-1]
        strips.append(strip)
        valid.append(free)
    strips = np.concatenate(strips)
    alpha = np.clip(strips[..., 3:], 0, 1)
    return np.concatenate([np.clip(strips[..., :3], 0, alpha), alpha], axis=-1), np.concatenate(valid)


def _columns(rows, margin):
    """Texels across, enough for the widest row."""
    return int(np.clip(2 * np.ceil(ROWS * (0.5 * rows.width.max(initial=0.0) + margin)), 12, 128))


def _core(thickness, margin, columns):
    """(R, A) weight of the texels within the thickness of a row."""
    v = np.abs((2.0 * np.arange(columns) + 1.0) / columns - 1.0)
    distance = v[None] * (0.5 * thickness + margin)[:, None]
    return np.clip(0.5 * thickness[:, None] - distance + 0.5, 0.02, 1.0)


def _mend(strips, valid, rows, margin):
    """Fill what other strokes hide from the nearest rows of the strip that are free at the same distance across."""
    out = strips.copy()
    columns = np.broadcast_to(np.arange(strips.shape[1]), valid.shape[1:])
    for a, b in zip(rows.offsets[:-1], rows.offsets[1:], strict=True):
        free = valid[a:b]
        if free.all():
            continue
        # along the strip only: each column is its own one-dimensional problem
        at = np.where(free, np.arange(b - a)[:, None], -1)
        before = np.maximum.accumulate(at, axis=0)
        after = np.where(free, np.arange(b - a)[:, None], b - a)
        after = np.minimum.accumulate(after[::-1], axis=0)[::-1]
        r = np.arange(b - a)[:, None]
        source = np.where((before >= 0) & ((r - before <= after - r) | (after >= b - a)), before, after)
        known = source < b - a
        filled = strips[a + np.minimum(source, b - a - 1), columns]
        out[a:b] = np.where(known[..., None], filled, strips[a:b])
        # past an end there is nothing to copy but the body of the stroke: round it off
        v = (2.0 * np.arange(strips.shape[1]) + 1.0) / strips.shape[1] - 1.0
        across = v[None] * (0.5 * rows.width[a:b] + margin)[:, None]
        past = np.maximum(0.0, -np.minimum(rows.start[a:b], rows.end[a:b]))[:, None]
        inside = np.clip(0.5 * rows.width[a:b, None] - np.hypot(across, past) + 1.0, 0.0, 1.0)
        out[a:b] *= np.where(free | (past <= 0), 1.0, inside)[..., None]
    return out


def _smooth_rows(values, offsets, sigma, weight=None):
    """Gaussian along every strip, (R, k); with weights (R,) a weighted mean."""
    weight = np.ones(len(values)) if weight is None else weight
    out = np.empty_like(values, dtype=np.float64)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        w = ndimage.gaussian_filter1d(weight[a:b], sigma, axis=0, mode="nearest")
        flat = ndimage.gaussian_filter1d(values[a:b] * weight[a:b, None], sigma, axis=0, mode="nearest")
        out[a:b] = flat / np.maximum(w, 1e-9)[:, None]
    return out


def _tone(strips, core, offsets, trust):
    """Opacity of the core and colour of the ink, slowly varying along the strips: (R, 4) opacity, r, g, b."""
    ink = (strips * core[..., None]).sum(axis=1)  # (R, 4) premultiplied
    area = core.sum(axis=1)
    smooth = _smooth_rows(np.concatenate([ink, area[:, None]], axis=1), offsets, TONE_SIGMA * ROWS, trust + 1e-3)
    opacity = smooth[:, 3] / np.maximum(smooth[:, 4], 1e-9)
    return np.concatenate([opacity[:, None], smooth[:, :3] / np.maximum(smooth[:, 3:4], 1e-6)], axis=1)


def _plain_regressors(rows: Rows) -> np.ndarray:
    ends = np.clip(np.stack([rows.start, rows.end], axis=1), -3.0, END)
    width = rows.width[:, None]
    return np.concatenate([rows.features, width, np.log(width + 1.0), ends], axis=1)


def _regressors(rows: Rows, scale: np.ndarray) -> np.ndarray:
    """(R, Q): a constant, the standardised features, thickness and end distances, and their squares."""
    x = np.clip((_plain_regressors(rows) - scale[0]) / scale[1], -3.0, 3.0)
    return np.concatenate([np.ones((len(x), 1)), x, x * x - 1.0], axis=1)


def _regress(design, tone, stroke, weight):
    """Ridge regression of the tone, its strength chosen by holding strokes out: weights (Q, 4), noise (4,).

    A part of the tone that the held-out strokes do not confirm is predicted by its mean.
    """
    keep = slice(None, None, ROWS)  # rows are far from independent
    s, w = stroke[keep], np.sqrt(weight[keep] / max(weight.mean(), 1e-9) + 1e-6)[:, None]
    x, y = design[keep] * w, tone[keep]
    folds = [fold for fold in (s % 5 == k for k in range(5)) if fold.any() and not fold.all()]
    mean = (y * w * w).sum(axis=0) / (w * w).sum()
    gram, moment = x.T @ x, x.T @ (y * w)

    def solve(gram, moment, rows, strength):
        penalty = np.full(len(gram), strength * rows)
        penalty[0] = 1e-6 * rows
        return np.linalg.solve(gram + np.diag(penalty), moment)

    held_out = [(fold, gram - x[fold].T @ x[fold], moment - x[fold].T @ (y * w)[fold]) for fold in folds]
    best, error = np.zeros(moment.shape), (w * w * (y - mean) ** 2).mean(axis=0)
    best[0] = mean
    for strength in (0.01, 0.03, 0.1, 0.3, 1.0, 3.0):
        off = y * w
        for fold, rest, rest_moment in held_out:
            off[fold] -= x[fold] @ solve(rest, rest_moment, (~fold).sum(), strength)
        off = np.square(off).mean(axis=0)
        better = (off < error) & bool(folds)
        if better.any():
            best[:, better] = solve(gram, moment, len(x), strength)[:, better]
            error = np.where(better, off, error)
    return best, np.sqrt(error)


def _look(strips, offsets):
    """What a cut between two rows would show: the strip, coarse across and slightly blurred along."""
    r, a, _ = strips.shape
    groups = np.array_split(np.arange(a), min(10, a))
    coarse = np.stack([strips[:, g].mean(axis=1) for g in groups], axis=1)  # (R, 10, 4)
    colors = [(coarse[..., k] - coarse[..., 3]) / np.sqrt(3.0) for k in range(3)]
    seen = np.concatenate([coarse[..., 3], *colors], axis=1)
    return _smooth_rows(seen, offsets, 1.0 * ROWS) / np.sqrt(len(groups))


# ----------------------------------------------------------------------------------------------------- synthesis


def synthesise(
    bank: TextureBank, strokes: Strokes, features: np.ndarray, seed: int = 0
) -> tuple[Texture | None, np.ndarray]:
    """Texture for new strokes, and the flat ink of each: (Texture or None, (C, 4) straight RGBA in [0, 1]).

    The same bank, strokes, features and seed give the same texture. Raises ValueError on features that do not fit.
    """
    features = _checked(strokes, features)
    known = bank.scale.shape[1] - OWN_REGRESSORS
    if features.shape[1] != known:
        raise ValueError(f"the texture was learned with {known} feature(s) a point, got {features.shape[1]}")
    if not len(strokes):
        return None, np.zeros((0, 4))
    margin = float(bank.margin[0])
    rows = _rows(strokes, features, margin)
    predicted = _regressors(rows, bank.scale.astype(np.float64)) @ bank.weights
    low, high = bank.tone.min(axis=0), bank.tone.max(axis=0)
    predicted = np.clip(predicted, low, high)
    if bank.flat[0] > 0.5:
        return None, _stroke_ink(rows, _solid(predicted, bank))
    rng = np.random.default_rng(seed)
    strips = _lay(bank, rows, _choose(bank, rows, predicted, rng), predicted)
    return Texture(_turn(strips, rows), rows.offsets, margin), _stroke_ink(rows, predicted)


def _turn(strips, rows):
    out = strips.copy()
    for i in np.flatnonzero(rows.turned):
        part = slice(rows.offsets[i], rows.offsets[i + 1])
        out[part] = strips[part][::-1, ::-1]
    return out


@dataclass(frozen=True)
class Runs:
    """Which source row every row of the new strips copies: row r copies r + shift, within its source's strip.

    first : (C+1,) int64, nodes of stroke i are first[i]:first[i+1], one every NODE px
    begin : (K,) int64, first row of each node's stretch
    shift, low, high : (K,) int64
    """

    first: np.ndarray
    begin: np.ndarray
    shift: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def source(self, node, row):
        return np.clip(row + self.shift[node], self.low[node], self.high[node])


def _choose(bank, rows, predicted, rng, barred=None) -> Runs:
    """The cheapest sequence of source rows along every stroke: Viterbi over candidates.

    `barred` (C, S) bool: strips that a stroke may not copy from.
    """
    step = NODE * ROWS
    offsets = rows.offsets
    count = -(-np.diff(offsets) // step)
    first = np.r_[0, np.cumsum(count)]
    stroke = owner(first)
    begin = offsets[stroke] + (np.arange(first[-1]) - first[stroke]) * step
    middle = np.minimum(begin + step // 2, offsets[stroke + 1] - 1)
    target, source = _cost_factors(bank, rows, predicted, middle)
    strip = owner(bank.offsets)
    every = np.arange(0, len(bank.row), ROWS)  # source rows on offer
    few = min(CANDIDATES, len(every))
    near = np.empty((len(middle), few), np.int64)
    for a in range(0, len(middle), 1024):
        part = slice(a, a + 1024)
        grid = target[part] @ source[every].T
        grid += LUCK * rng.standard_exponential(grid.shape, np.float32)
        if barred is not None:
            grid[barred[stroke[part]][:, strip[every]]] += 1e6
        near[part] = every[np.argpartition(grid, few - 1, axis=1)[:, :few]]
    # the row that follows a node's, and none where the strip is over
    follows = np.full(len(bank.row), -1)
    r = np.arange(len(bank.row) - step)
    follows[r] = np.where(strip[r] == strip[r + step], r + step, -1)
    chosen = _viterbi(bank.look, near, first, target, source, follows)
    home = strip[chosen]
    return Runs(first, begin, chosen - begin - step // 2, bank.offsets[home], bank.offsets[home + 1] - 1)


def _cost_factors(bank, rows, predicted, node):
    """(K, D) and (T, D) float32, whose inner product is the cost of laying a source row on a node's row."""
    noise = np.maximum(bank.noise, LEAST_NOISE)

    def plain(tone, width):
        return np.concatenate([TONE_COST * tone / noise, WIDTH_COST * np.log(width[:, None] + 1.0)], axis=1)

    ends = np.clip(np.stack([rows.start[node], rows.end[node]], axis=1), -8.0, END)
    weight = 1.0 / np.square(4.0 + 0.25 * np.maximum(ends, 0.0))
    mine = plain(predicted[node], rows.width[node])
    constant = np.square(mine).sum(axis=1, keepdims=True) + (weight * ends * ends).sum(axis=1, keepdims=True)
    target = [constant, np.ones((len(node), 1)), -2.0 * mine, weight, -2.0 * weight * ends]
    width, flaw = bank.row[:, 0], bank.row[:, 3:]
    theirs, at = plain(bank.fitted, width), np.clip(bank.row[:, 1:3], -8.0, END)
    constant = np.square(theirs).sum(axis=1, keepdims=True) + FLAW * flaw + np.where(flaw > 0.4, 100.0, 0.0)
    source = [np.ones((len(width), 1)), constant, theirs, at * at, at]
    return np.concatenate(target, axis=1).astype(np.float32), np.concatenate(source, axis=1).astype(np.float32)


def _viterbi(look, near, first, target, source, follows):
    """The source row (K,) of every node; all strokes in step, the longest first."""
    count = np.diff(first)
    order = np.argsort(-count, kind="stable")
    few = near.shape[1]
    head = first[order]
    candidates = [near[head]]
    total = np.einsum("bwd,bd->bw", source[near[head]], target[head])
    back = []
    totals = [total]
    for k in range(1, int(count.max(initial=0))):
        live = int((count > k).sum())
        node = head[:live] + k
        last, total = candidates[-1][:live], totals[-1][:live]
        on = follows[last]
        over = on < 0
        cost = np.einsum("bwd,bd->bw", source[on], target[node]) + total
        cost[over] = np.inf
        best = np.argpartition(cost, few - 1, axis=1)[:, :few]
        ahead = np.take_along_axis(on, best, axis=1)
        ahead = np.where(ahead < 0, near[node], ahead)
        here = np.concatenate([near[node], ahead], axis=1)
        x, y = look[np.where(over, last, on)], look[here]
        seam = np.square(x).sum(axis=2)[:, :, None] + np.square(y).sum(axis=2)[:, None] - 2.0 * x @ y.swapaxes(1, 2)
        move = JUMP + SEEN * np.maximum(seam, 0.0) + OVER * over[:, :, None]
        move[on[:, :, None] == here[:, None]] = 0.0
        move += total[:, :, None]
        best = move.argmin(axis=1)
        back.append(best)
        candidates.append(here)
        reached = np.take_along_axis(move, best[:, None], axis=1)[:, 0]
        totals.append(reached + np.einsum("bwd,bd->bw", source[here], target[node]))
    chosen = np.empty(first[-1], np.int64)
    at = np.zeros(len(count), np.int64)
    for k in range(len(candidates) - 1, -1, -1):
        live = int((count > k).sum())
        ends = np.flatnonzero(count[order[:live]] == k + 1)
        at[ends] = totals[k][ends].argmin(axis=1)
        b = np.arange(live)
        chosen[head[:live] + k] = candidates[k][b, at[:live]]
        if k:
            at[:live] = back[k - 1][b, at[:live]]
    return chosen


def _lay(bank, rows, runs: Runs, predicted) -> np.ndarray:
    """Copy the chosen runs into strips (R, A, 4) uint8 for the new strokes, and hide their joints."""
    columns, step = _columns(rows, float(bank.margin[0])), NODE * ROWS
    stroke = owner(rows.offsets)
    every = np.arange(len(stroke))
    node = np.minimum(runs.first[stroke] + (every - rows.offsets[stroke]) // step, runs.first[stroke + 1] - 1)
    copied = runs.source(node, every)
    # tone: what the features ask for here, and beyond that what the source had, carried smoothly over the joints
    wanted = predicted + _smooth_rows(_luck(bank, copied, stroke), rows.offsets, TONE_SIGMA * ROWS)

    def copy(source, row):
        return _toned(_resampled(bank, source, rows.width[row], columns), bank.tone[source], wanted[row])

    layer = np.concatenate([copy(copied[a : a + 8192], every[a : a + 8192]) for a in range(0, len(every), 8192)])
    for before, after, ahead in _joints(rows, runs):
        _join(layer, copy, rows, runs, before, after, ahead)
    layer *= _caps(rows, bank.row[copied], float(bank.margin[0]), columns)
    return np.rint(np.clip(_straight(layer), 0, 1) * 255).astype(np.uint8)


def _luck(bank, copied, stroke):
    """Tone (R, 4) beyond what the features ask for, of rows of new strokes that copy the rows `copied`.

    What sets a whole stroke apart, its pressure or its colour, is one for all of a new stroke: that of the strip which
    most of it is copied from.
    """
    strips = len(bank.offsets) - 1
    trust = 1.001 - bank.row[:, 3]
    beyond, home = bank.tone - bank.fitted, owner(bank.offsets)
    total = np.bincount(home, trust, minlength=strips)
    own = np.stack([np.bincount(home, trust * column, minlength=strips) for column in beyond.T], axis=1)
    own /= total[:, None]
    used = np.bincount(stroke * strips + home[copied], minlength=(stroke[-1] + 1) * strips).reshape(-1, strips)
    return beyond[copied] - own[home[copied]] + own[used.argmax(axis=1)][stroke]


def _joints(rows, runs):
    """Groups of joints that do not touch each other: (node before, node after, rows by which the way wraps)."""
    count = np.diff(runs.first)
    stroke = owner(runs.first)
    after = np.setdiff1d(np.arange(runs.first[-1]), runs.first[:-1])
    after = after[(runs.shift[after] != runs.shift[after - 1]) | (runs.low[after] != runs.low[after - 1])]
    ordinal = np.arange(len(after)) - np.searchsorted(after, runs.first[stroke[after]])
    for parity in (0, 1):
        group = after[ordinal % 2 == parity]
        yield group - 1, group, np.zeros(len(group), np.int64)
    loop = np.flatnonzero(rows.closed & (count > 1))
    yield runs.first[loop + 1] - 1, runs.first[loop], np.diff(rows.offsets)[loop]


def _join(layer, copy, rows, runs, before, after, ahead):
    """Join runs in `layer` (R, A, 4) along least-error cuts between HALF_CUT px before and after where they meet."""
    if not len(after):
        return
    reach = HALF_CUT * ROWS
    stroke = owner(runs.first)[after]
    low, high = rows.offsets[stroke][:, None], rows.offsets[stroke + 1][:, None]
    at = runs.begin[after][:, None] + np.arange(-reach, reach)
    row = np.where(rows.closed[stroke][:, None], low + (at - low) % (high - low), np.clip(at, low, high - 1))
    past = np.arange(2 * reach) >= reach
    shape = row.shape + layer.shape[1:]
    old, new = layer[row], layer[row]
    going_on = runs.source(before[:, None], (at + ahead[:, None])[:, past])
    coming = runs.source(after[:, None], at[:, ~past])
    old[:, past] = copy(going_on.ravel(), row[:, past].ravel()).reshape(-1, reach, *shape[2:])
    new[:, ~past] = copy(coming.ravel(), row[:, ~past].ravel()).reshape(-1, reach, *shape[2:])
    joined = _cut(old, new)
    within = (at >= low) & (at < high) | rows.closed[stroke][:, None]
    layer[row[within]] = joined[within]


def _cut(old, new):
    """Patches (S, n, A, 4) of the same rows -> ones that begin as `old` and end as `new`, along least-error cuts."""
    count, n, columns, _ = old.shape
    error = np.square(old - new).sum(axis=3)
    error = ndimage.uniform_filter1d(error, 3, axis=1) + 1e-4
    total = error[:, :, 0].copy()
    back = np.zeros((columns, count, n), np.int64)
    wall = np.full((count, 1), np.inf, np.float32)
    for c in range(1, columns):
        padded = np.concatenate([wall, total, wall], axis=1)
        three = np.stack([padded[:, :-2], padded[:, 1:-1], padded[:, 2:]])
        pick = three.argmin(axis=0)
        back[c] = np.arange(n) + pick - 1
        total = np.take_along_axis(three, pick[None], axis=0)[0] + error[:, :, c]
    cut = np.empty((count, columns), np.int64)
    cut[:, -1] = total.argmin(axis=1)
    each = np.arange(count)
    for c in range(columns - 1, 0, -1):
        cut[:, c - 1] = back[c][each, cut[:, c]]
    weight = np.clip((np.arange(n)[:, None] - cut[:, None]) / FEATHER + 0.5, 0.0, 1.0)[..., None].astype(np.float32)
    return old * (1 - weight) + new * weight


def _caps(rows, source, margin, columns):
    """(R, columns, 1) in [0, 1]: rounds off the rows past an end that were copied from the body of a stroke."""
    ends = np.stack([rows.start, rows.end], axis=1)
    past = np.maximum(0.0, -ends)
    body = past * np.clip((source[:, 1:3] - ends - 1.0) / 2.0, 0.0, 1.0)  # as far past as the source was not
    body = body.max(axis=1)[:, None]
    v = (2.0 * np.arange(columns) + 1.0) / columns - 1.0
    across = v[None] * (0.5 * rows.width + margin)[:, None]
    inside = np.clip(0.5 * rows.width[:, None] + 0.5 - np.hypot(across, body), 0.0, 1.0)
    return np.where(body > 0, inside, 1.0)[..., None].astype(np.float32)


def _toned(patch, tone, wanted):
    """Premultiplied rows (n, A, 4) whose opacity and ink are moved from `tone` (n, 4) to `wanted` (n, 4)."""
    gain = np.clip((wanted[:, 0] + 0.1) / (tone[:, 0] + 0.1), 0.5, 2.0)
    alpha = np.minimum(patch[..., 3] * gain[:, None], 1.0)
    ink = patch[..., :3] / np.maximum(patch[..., 3:], 1e-4) + (wanted[:, 1:] - tone[:, 1:])[:, None]
    return np.concatenate([np.clip(ink, 0, 1) * alpha[..., None], alpha[..., None]], axis=-1).astype(np.float32)


def _resampled(bank, s, width, columns):
    """Rows s of the bank, stretched across from their own width to `width` (n,), premultiplied float32.

    The core is stretched; beyond the edge distances stay what they are, so that a soft edge keeps its softness.
    """
    a, margin = bank.rgba.shape[1], float(bank.margin[0])
    v = (2.0 * np.arange(columns) + 1.0) / columns - 1.0
    half, own = 0.5 * width[:, None], 0.5 * bank.row[s, 0][:, None].astype(np.float64)
    distance = np.abs(v)[None] * (half + margin)
    inner = distance * (own / np.maximum(half, 1e-6))
    across = np.sign(v)[None] * np.where(distance < half, inner, own + distance - half)
    column = np.clip((across / (own + margin) + 1.0) * 0.5 * a - 0.5, 0, a - 1)
    c0 = np.minimum(column.astype(np.int64), a - 2)
    f = (column - c0)[..., None].astype(np.float32)
    strip = bank.rgba[s].astype(np.float32) / 255.0
    strip[..., :3] *= strip[..., 3:]
    r = np.arange(len(s))[:, None]
    return strip[r, c0] * (1 - f) + strip[r, c0 + 1] * f


def _straight(premultiplied):
    alpha = premultiplied[..., 3:]
    return np.concatenate([premultiplied[..., :3] / np.maximum(alpha, 1e-4), alpha], axis=-1)
