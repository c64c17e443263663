"""Learn the texture of a drawing: cut strips along its strokes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..drawing.raster import distance_map
from ..drawing.ribbon import across, ribbon, strip_points, strip_stretch
from ..drawing.strip import straight
from ..drawing.strokes import Strokes
from ..geometry.curves import owner
from ..render.quilt import choose_runs, lay_runs
from ..render.texture_bank import (
    INK_SIGMA,
    ROWS,
    Rows,
    TextureBank,
    bank_columns,
    check_strokes,
    plain_regressors,
    regressors_of,
    smooth_rows,
    solid_ink,
    stroke_ink,
    stroke_rows,
)
from .exemplar import Exemplar

LEAST_MARGIN = (
    2.0  # px that strips reach beyond the half thickness, where the ink ends sharply there
)
CLAIM = 10.0  # px round a stroke that are looked at to tell whose ink lies there
TRACE = 0.02  # of the mean opacity inside: less ink than that is none
FLAT_TAX = 1.1  # flat ink may err this many times as much as strips: it is crisp at any size, and easy to edit
CLEAN = 0.12  # and where it errs less than this, nobody misses a texture
SIGHT = 1.2  # px, blur under which flat ink and strips are compared


def learn_texture(
    strokes: Strokes, features: np.ndarray, exemplar: Exemplar, seed: int = 0
) -> TextureBank:
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
    features = check_strokes(strokes, features)
    if not len(strokes):
        raise ValueError("learn_texture: no strokes to learn from")
    claims = _claims(strokes, exemplar.alpha.shape[::-1])
    margin = _margin(claims, exemplar.alpha)
    rows = stroke_rows(strokes, features, margin)
    strips, valid = _cut_strips(strokes, rows, exemplar, claims, margin)
    flaw = 1.0 - valid.mean(axis=1)
    strips = _mend(strips, valid, rows, margin)
    core = _core(rows.width, margin, strips.shape[1])
    tone = _tone(strips, core, rows.offsets, 1.0 - flaw)
    plain = plain_regressors(rows)
    scale = np.stack([plain.mean(axis=0), np.maximum(plain.std(axis=0), 1e-6)])
    design = regressors_of(rows, scale)
    weights, noise = _regress(
        design, tone, owner(rows.offsets), (1.0 - flaw) * (core * strips[..., 3]).sum(axis=1)
    )
    bank = TextureBank(
        rgba=np.rint(np.clip(straight(strips, least=1e-4), 0, 1) * 255).astype(np.uint8),
        offsets=rows.offsets,
        width=rows.width.astype(np.float32),
        ends=rows.ends.astype(np.float32),
        occlusion=flaw.astype(np.float32),
        appearance=_look(strips, rows.offsets).astype(np.float32),
        local_ink=tone.astype(np.float32),
        predicted_ink=(design @ weights).astype(np.float32),
        weights=weights.astype(np.float32),
        scale=scale.astype(np.float32),
        noise=noise.astype(np.float32),
        margin=float(np.float32(margin)),
        flat=False,
    )
    flat = _flat_does(bank, rows, strips, flaw, seed)
    return replace(bank, flat=flat)


def _flat_does(
    bank: TextureBank, rows: Rows, strips: np.ndarray, flaw: np.ndarray, seed: int
) -> bool:
    """Whether flat ink renders the training strokes as well as strips of the other strokes do.

    Compared are not pixels, which would favour a blur, but what the eye takes from a mark: darkness and its unevenness,
    edges across and grain along, each averaged over cells of some px.
    """
    itself = np.eye(len(rows.offsets) - 1, dtype=bool) if len(rows.offsets) > 2 else None
    fitted = bank.predicted_ink.astype(np.float64)
    chosen = choose_runs(bank, rows, fitted, np.random.default_rng(seed), itself)
    laid = lay_runs(bank, rows, chosen, fitted).astype(np.float32) / 255.0
    laid[..., :3] *= laid[..., 3:]
    columns, margin = strips.shape[1], bank.margin
    v = across(columns)
    distance = np.abs(v)[None] * (0.5 * rows.width + margin)[:, None]
    cover = np.clip(0.5 * rows.thickness[:, None] - distance + 0.5, 0, 1)
    cover *= (rows.ends.min(axis=1) > -0.5 * rows.thickness)[:, None]
    ink = stroke_ink(rows, solid_ink(fitted, bank))[owner(rows.offsets)]
    plain = (cover * ink[:, 3:])[..., None] * np.concatenate(
        [ink[:, :3], np.ones((len(ink), 1))], axis=1
    )[:, None]
    body = rows.ends.min(axis=1) > -1.0
    weight = (flaw < 0.2) & body
    truth = _traits(strips, rows, weight)
    scale = np.abs(truth).mean(axis=0) + 0.01
    errors = [
        float((np.abs(_traits(made, rows, weight) - truth) / scale).mean())
        for made in (plain, laid)
    ]
    return errors[0] <= max(FLAT_TAX * errors[1], CLEAN)


def _traits(strips, rows, weight):
    """What marks look like, per cell: (cells, traits). Cells are 12 px long and a quarter of the strip across."""
    tone = np.stack([strips[..., 3], strips[..., 3] - strips[..., :3].mean(axis=2)], axis=2)
    tone = ndimage.gaussian_filter(tone, (SIGHT * ROWS, SIGHT * ROWS, 0))
    per_px = ROWS * 1.0
    edges = np.abs(np.diff(tone, axis=1, append=0)) * per_px
    along = np.abs(np.diff(tone, axis=0, append=0)) * per_px
    along[rows.offsets[1:] - 1] = 0.0
    maps = np.concatenate([tone, edges, along, np.square(tone)], axis=2)
    cell = np.arange(len(tone)) // (12 * ROWS)
    count = np.bincount(cell, weight, minlength=cell[-1] + 1)
    bands = [part.mean(axis=1) for part in np.array_split(maps, 4, axis=1)]
    table = np.concatenate(bands, axis=1) * weight[:, None]
    sums = np.stack(
        [np.bincount(cell, column, minlength=cell[-1] + 1) for column in table.T], axis=1
    )
    return (sums / np.maximum(count, 1)[:, None])[count > 6 * ROWS]


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
    columns = bank_columns(rows, margin)
    planes = [exemplar.ink[..., k] * exemplar.alpha for k in range(3)] + [exemplar.alpha]
    planes = [ndimage.spline_filter(plane, 3, output=np.float32) for plane in planes]
    strips, valid = [], []
    for i in range(len(strokes)):
        band = ribbon(strokes, i, margin)
        n = rows.offsets[i + 1] - rows.offsets[i]
        at = strip_points(band, n, columns)[..., ::-1].transpose(2, 0, 1) - 0.5
        strip = [
            ndimage.map_coordinates(plane, at, order=3, mode="nearest", prefilter=False)
            for plane in planes
        ]
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
    return np.concatenate([np.clip(strips[..., :3], 0, alpha), alpha], axis=-1), np.concatenate(
        valid
    )


def _core(thickness, margin, columns):
    """(R, A) weight of the texels within the thickness of a row."""
    v = np.abs(across(columns))
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
        source = np.where(
            (before >= 0) & ((r - before <= after - r) | (after >= b - a)), before, after
        )
        known = source < b - a
        filled = strips[a + np.minimum(source, b - a - 1), columns]
        out[a:b] = np.where(known[..., None], filled, strips[a:b])
        # past an end there is nothing to copy but the body of the stroke: round it off
        v = across(strips.shape[1])
        aside = v[None] * (0.5 * rows.width[a:b] + margin)[:, None]
        past = np.maximum(0.0, -rows.ends[a:b].min(axis=1))[:, None]
        inside = np.clip(0.5 * rows.width[a:b, None] - np.hypot(aside, past) + 1.0, 0.0, 1.0)
        out[a:b] *= np.where(free | (past <= 0), 1.0, inside)[..., None]
    return out


def _tone(strips, core, offsets, trust):
    """Opacity of the core and colour of the ink, slowly varying along the strips: (R, 4) opacity, r, g, b."""
    ink = (strips * core[..., None]).sum(axis=1)  # (R, 4) premultiplied
    area = core.sum(axis=1)
    smooth = smooth_rows(
        np.concatenate([ink, area[:, None]], axis=1), offsets, INK_SIGMA * ROWS, trust + 1e-3
    )
    opacity = smooth[:, 3] / np.maximum(smooth[:, 4], 1e-9)
    return np.concatenate(
        [opacity[:, None], smooth[:, :3] / np.maximum(smooth[:, 3:4], 1e-6)], axis=1
    )


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

    held_out = [
        (fold, gram - x[fold].T @ x[fold], moment - x[fold].T @ (y * w)[fold]) for fold in folds
    ]
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
    return smooth_rows(seen, offsets, 1.0 * ROWS) / np.sqrt(len(groups))
