"""Learn the texture of a drawing: cut strips along its strokes, and what their ink follows."""

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

MIN_MARGIN = 2.0  # px that strips reach beyond the half thickness, where the ink ends sharply there
NEIGHBOURHOOD = 10.0  # px around a stroke that are looked at to tell whose ink lies there
TRACE_OF_INK = 0.02  # of the mean opacity inside: less ink than that is none

# Where a pixel of a strip is the stroke's own. Set by hand; no ablation is kept.
INSIDE, FREE_INSIDE = 1.0, 0.5  # px deep in the stroke, where another need be only this far away
FREE_OUTSIDE = 1.0  # px that another stroke may reach into the margin elsewhere
STRETCH = 0.4, 2.0  # length along the strip by length along the stroke: beyond, a bend folds it

# Flat ink against strips. Set by hand; no ablation is kept.
FLAT_TAX = 1.1  # flat ink may err this many times as much as strips: it is crisp at any size, and
# easy to edit
CLEAN = 0.12  # and where it errs less than this, nobody misses a texture
SIGHT = 1.2  # px, blur under which flat ink and strips are compared
CELL, BANDS = 12, 4  # px along a strip, and parts across it, over which traits are averaged
MAX_OCCLUSION = 0.2  # of rows that are compared

FOLDS = 5  # strokes are held out by their number modulo this
STRENGTHS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # of the ridge, per row, that are tried
APPEARANCE_BANDS, APPEARANCE_SIGMA = 10, 1.0  # parts across, and px along


def learn_texture(
    strokes: Strokes, features: np.ndarray, exemplar: Exemplar, seed: int = 0
) -> TextureBank:
    """Cut the exemplar into strips along the strokes that were fitted to it.

    Parameters
    ----------
    strokes : fitted training strokes, in the exemplar's pixels
    features : (N, P) float, one row per stroke point, of any scale; `synthesise` needs the same
        features of the new strokes
    exemplar : the drawing
    seed : decides the joints where flat ink and strips compete

    Raises
    ------
    ValueError
        without strokes, or on features that do not fit them.
    """
    features = check_strokes(strokes, features)
    if not len(strokes):
        raise ValueError("learn_texture: no strokes to learn from")
    nearest = nearest_strokes(strokes, exemplar.alpha.shape[::-1])
    margin = ink_margin(nearest, exemplar.alpha)
    rows = stroke_rows(strokes, features, margin)
    strips, free = cut_strips(strokes, rows, exemplar, nearest, margin)
    occlusion = 1.0 - free.mean(axis=1)
    strips = fill_occluded(strips, free, rows, margin)
    core = _core(rows.width, margin, strips.shape[1])
    local_ink = _local_ink(strips, core, rows.offsets, 1.0 - occlusion)
    plain = plain_regressors(rows)
    scale = np.stack([plain.mean(axis=0), np.maximum(plain.std(axis=0), 1e-6)])
    design = regressors_of(rows, scale)
    known = (1.0 - occlusion) * (core * strips[..., 3]).sum(axis=1)
    weights, noise = regress_ink(design, local_ink, owner(rows.offsets), known)
    bank = TextureBank(
        rgba=np.rint(np.clip(straight(strips, least=1e-4), 0, 1) * 255).astype(np.uint8),
        offsets=rows.offsets,
        width=rows.width.astype(np.float32),
        ends=rows.ends.astype(np.float32),
        occlusion=occlusion.astype(np.float32),
        appearance=_appearance(strips, rows.offsets).astype(np.float32),
        local_ink=local_ink.astype(np.float32),
        predicted_ink=(design @ weights).astype(np.float32),
        weights=weights.astype(np.float32),
        scale=scale.astype(np.float32),
        noise=noise.astype(np.float32),
        margin=float(np.float32(margin)),
        flat=False,
    )
    return replace(bank, flat=_flat_does(bank, rows, strips, occlusion, seed))


# ------------------------------------------------------------------------------------- whose ink


@dataclass(frozen=True)
class NearestStrokes:
    """Whose pixels are whose.

    Parameters
    ----------
    stroke : (H, W) int64, the stroke that each pixel lies deepest in, -1 where none is near
    distance : (H, W) px by which it lies outside that stroke, negative inside, inf where none is
        near
    second : (H, W) px by which it lies outside the next one, inf where there is none
    """

    stroke: np.ndarray
    distance: np.ndarray
    second: np.ndarray


def nearest_strokes(strokes: Strokes, size: tuple[int, int]) -> NearestStrokes:
    """Find the two nearest strokes of every pixel of a canvas of `size` (width, height) px.

    Strokes farther away than NEIGHBOURHOOD are not near.
    """
    width, height = size
    stroke = np.full((height, width), -1)
    distance, second = np.full((height, width), np.inf), np.full((height, width), np.inf)
    for i in range(len(strokes)):
        crop, own = distance_map(strokes, i, size, NEIGHBOURHOOD)
        box = crop.index
        old = distance[box]
        better = own < old
        second[box] = np.where(better, old, np.minimum(second[box], own))
        stroke[box] = np.where(better, i, stroke[box])
        distance[box] = np.where(better, own, old)
    return NearestStrokes(stroke, distance, second)


def ink_margin(nearest: NearestStrokes, alpha: np.ndarray) -> float:
    """The px beyond the strokes' edges within which all but a trace of their ink (H, W) lies."""
    alone = nearest.second > NEIGHBOURHOOD
    inside = alone & (nearest.distance < 0)
    if not inside.any():
        return MIN_MARGIN
    level = TRACE_OF_INK * alpha[inside].mean()
    reach = NEIGHBOURHOOD
    for k in range(int(NEIGHBOURHOOD)):
        ring = alone & (nearest.distance > k) & (nearest.distance <= k + 1)
        if not ring.any() or alpha[ring].mean() < level:
            reach = k
            break
    return float(np.clip(reach + 1, MIN_MARGIN, NEIGHBOURHOOD - 2))


# ---------------------------------------------------------------------------------------- strips


def cut_strips(
    strokes: Strokes, rows: Rows, exemplar: Exemplar, nearest: NearestStrokes, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """Sample the ink along every stroke, as a hand pulls it.

    Returns premultiplied samples (R, A, 4), and (R, A) bool, False where they are not the stroke's
    own: where another stroke lies, or a bend folds or tears the strip.
    """
    columns = bank_columns(rows, margin)
    planes = [exemplar.ink[..., k] * exemplar.alpha for k in range(3)] + [exemplar.alpha]
    planes = [ndimage.spline_filter(plane, 3, output=np.float32) for plane in planes]
    strips, free = [], []
    for i in range(len(strokes)):
        band = ribbon(strokes, i, margin)
        n = rows.offsets[i + 1] - rows.offsets[i]
        at = strip_points(band, n, columns)[..., ::-1].transpose(2, 0, 1) - 0.5  # (2, n, A) y, x
        samples = [
            ndimage.map_coordinates(plane, at, order=3, mode="nearest", prefilter=False)
            for plane in planes
        ]
        stretch = strip_stretch(band, n, columns)
        own = _own_pixels(nearest, i, at, margin)
        own &= (stretch > STRETCH[0]) & (stretch < STRETCH[1])
        turn = slice(None, None, -1 if rows.turned[i] else 1)
        strips.append(np.stack(samples, axis=-1)[turn, turn])
        free.append(own[turn, turn])
    return _valid_ink(np.concatenate(strips)), np.concatenate(free)


def _own_pixels(nearest: NearestStrokes, i: int, at: np.ndarray, margin: float) -> np.ndarray:
    """Whether no other stroke than i shows at points (2, n, A), y, x in rows and columns."""
    height, width = nearest.stroke.shape
    row, column = np.rint(at).astype(np.int64)
    y, x = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    mine = nearest.stroke[y, x] == i
    own = np.where(mine, nearest.distance[y, x], nearest.second[y, x])
    other = np.where(mine, nearest.second[y, x], nearest.distance[y, x])
    # another stroke's soft edge does no harm well inside this one
    return other > np.where(own < -INSIDE, FREE_INSIDE, margin - FREE_OUTSIDE)


def _valid_ink(samples: np.ndarray) -> np.ndarray:
    """Clip premultiplied samples (R, A, 4), which splines overshoot, to what ink can be."""
    alpha = np.clip(samples[..., 3:], 0, 1)
    return np.concatenate([np.clip(samples[..., :3], 0, alpha), alpha], axis=-1)


def _core(thickness: np.ndarray, margin: float, columns: int) -> np.ndarray:
    """(R, A) weight of the texels within the thickness (R,) of a row."""
    v = np.abs(across(columns))
    distance = v[None] * (0.5 * thickness + margin)[:, None]
    return np.clip(0.5 * thickness[:, None] - distance + 0.5, 0.02, 1.0)


def fill_occluded(strips: np.ndarray, free: np.ndarray, rows: Rows, margin: float) -> np.ndarray:
    """Fill what other strokes hide from the nearest free rows, at the same distance across.

    Parameters
    ----------
    strips : (R, A, 4) premultiplied
    free : (R, A) bool, False where another stroke hides the stroke
    rows : of the strips
    margin : px
    """
    out = strips.copy()
    v, columns = across(strips.shape[1]), np.arange(strips.shape[1])
    for a, b in zip(rows.offsets[:-1], rows.offsets[1:], strict=True):
        if free[a:b].all():
            continue
        source = _nearest_free(free[a:b])
        known = source < b - a
        filled = strips[a + np.minimum(source, b - a - 1), columns]
        out[a:b] = np.where(known[..., None], filled, strips[a:b])
        # past an end there is nothing to copy but the body of the stroke: round it off
        aside = v[None] * (0.5 * rows.width[a:b] + margin)[:, None]
        past = np.maximum(0.0, -rows.ends[a:b].min(axis=1))[:, None]
        inside = np.clip(0.5 * rows.width[a:b, None] - np.hypot(aside, past) + 1.0, 0.0, 1.0)
        out[a:b] *= np.where(free[a:b] | (past <= 0), 1.0, inside)[..., None]
    return out


def _nearest_free(free: np.ndarray) -> np.ndarray:
    """The nearest row that is free, in each column of (n, A): (n, A), n where there is none.

    Of two as near, the one before.
    """
    n = len(free)
    row = np.arange(n)[:, None]
    before = np.maximum.accumulate(np.where(free, row, -1), axis=0)
    after = np.minimum.accumulate(np.where(free, row, n)[::-1], axis=0)[::-1]
    first = (before >= 0) & ((row - before <= after - row) | (after >= n))
    return np.where(first, before, after)


# ------------------------------------------------------------------------------------- local ink


def _local_ink(
    strips: np.ndarray, core: np.ndarray, offsets: np.ndarray, confidence: np.ndarray
) -> np.ndarray:
    """Opacity of the core and colour of the ink, slowly varying along the strips: (R, 4)."""
    ink = (strips * core[..., None]).sum(axis=1)  # (R, 4) premultiplied
    sums = np.concatenate([ink, core.sum(axis=1)[:, None]], axis=1)
    smooth = smooth_rows(sums, offsets, INK_SIGMA * ROWS, confidence + 1e-3)
    opacity = smooth[:, 3] / np.maximum(smooth[:, 4], 1e-9)
    return np.concatenate(
        [opacity[:, None], smooth[:, :3] / np.maximum(smooth[:, 3:4], 1e-6)], axis=1
    )


def regress_ink(
    design: np.ndarray, local_ink: np.ndarray, stroke: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Regress the local ink on the design, by a ridge whose strength is chosen on held-out strokes.

    A column of the ink that the held-out strokes do not confirm is predicted by its mean.

    Parameters
    ----------
    design : (R, Q), a column of ones first
    local_ink : (R, 4)
    stroke : (R,) int, the stroke of each row
    weight : (R,) of each row

    Returns
    -------
    weights (Q, 4), and the standard deviation (4,) of the ink about its prediction
    """
    keep = slice(None, None, ROWS)  # rows are far from independent
    root = np.sqrt(weight[keep] / max(weight.mean(), 1e-9) + 1e-6)[:, None]
    x, y = design[keep] * root, local_ink[keep]
    mean = (y * root * root).sum(axis=0) / (root * root).sum()
    best, error = np.zeros((x.shape[1], y.shape[1])), (root * root * (y - mean) ** 2).mean(axis=0)
    best[0] = mean
    ridge = _Ridge.of(x, y * root, stroke[keep] % FOLDS)
    for strength in STRENGTHS:
        off = np.square(ridge.misfit(strength)).mean(axis=0)
        better = (off < error) & bool(ridge.folds)
        if better.any():
            best[:, better] = ridge.solved(strength)[:, better]
            error = np.where(better, off, error)
    return best, np.sqrt(error)


@dataclass(frozen=True)
class _Fold:
    """Rows that are held out (n,) bool, and the normal equations of all others."""

    rows: np.ndarray
    gram: np.ndarray
    moment: np.ndarray


@dataclass(frozen=True)
class _Ridge:
    """Ridge regression of y (n, k) on x (n, Q), with the normal equations made once."""

    x: np.ndarray
    y: np.ndarray
    gram: np.ndarray
    moment: np.ndarray
    folds: list[_Fold]

    @classmethod
    def of(cls, x: np.ndarray, y: np.ndarray, fold: np.ndarray) -> _Ridge:
        """`fold` (n,) int, which rows are held out together; one that holds all or none is none."""
        gram, moment = x.T @ x, x.T @ y
        held = [rows for rows in (fold == k for k in range(FOLDS)) if rows.any() and not rows.all()]
        folds = [
            _Fold(rows, gram - x[rows].T @ x[rows], moment - x[rows].T @ y[rows]) for rows in held
        ]
        return cls(x, y, gram, moment, folds)

    def solved(self, strength: float) -> np.ndarray:
        """Weights (Q, k) of all rows."""
        return _solve(self.gram, self.moment, len(self.x), strength)

    def misfit(self, strength: float) -> np.ndarray:
        """How far the rows (n, k) are from what the other folds predict for them."""
        off = self.y.copy()
        for fold in self.folds:
            others = (~fold.rows).sum()
            off[fold.rows] -= self.x[fold.rows] @ _solve(fold.gram, fold.moment, others, strength)
        return off


def _solve(gram: np.ndarray, moment: np.ndarray, rows: int, strength: float) -> np.ndarray:
    """Solve normal equations of so many rows with a ridge on all columns but the first."""
    penalty = np.full(len(gram), strength * rows)
    penalty[0] = 1e-6 * rows
    return np.linalg.solve(gram + np.diag(penalty), moment)


def _appearance(strips: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """What a cut between two rows would show: the strip, coarse across and slightly blurred along.

    (R, 4 APPEARANCE_BANDS); the squared distance of two rows is a mean over the bands.
    """
    columns = strips.shape[1]
    groups = np.array_split(np.arange(columns), min(APPEARANCE_BANDS, columns))
    coarse = np.stack([strips[:, g].mean(axis=1) for g in groups], axis=1)  # (R, bands, 4)
    colors = [(coarse[..., k] - coarse[..., 3]) / np.sqrt(3.0) for k in range(3)]
    seen = np.concatenate([coarse[..., 3], *colors], axis=1)
    return smooth_rows(seen, offsets, APPEARANCE_SIGMA * ROWS) / np.sqrt(len(groups))


# ---------------------------------------------------------------------------- flat ink, or strips


def _flat_does(
    bank: TextureBank, rows: Rows, strips: np.ndarray, occlusion: np.ndarray, seed: int
) -> bool:
    """Whether flat ink renders the training strokes as well as strips of the other strokes do.

    Compared are not pixels, which would favour a blur, but what the eye takes from a mark: darkness
    and its unevenness, edges across and grain along, each averaged over cells of some px.
    """
    body = rows.ends.min(axis=1) > -1.0
    weight = ((occlusion < MAX_OCCLUSION) & body).astype(float)
    truth = _traits(strips, rows, weight)
    scale = np.abs(truth).mean(axis=0) + 0.01
    flat, laid = (
        float((np.abs(_traits(made, rows, weight) - truth) / scale).mean())
        for made in (_in_flat_ink(bank, rows, strips.shape[1]), _in_strips(bank, rows, seed))
    )
    return flat <= max(FLAT_TAX * laid, CLEAN)


def _in_strips(bank: TextureBank, rows: Rows, seed: int) -> np.ndarray:
    """The training strokes (R, A, 4), premultiplied, laid with strips of the other strokes."""
    itself = np.eye(len(rows.offsets) - 1, dtype=bool) if len(rows.offsets) > 2 else None
    predicted = bank.predicted_ink.astype(np.float64)
    chosen = choose_runs(bank, rows, predicted, np.random.default_rng(seed), itself)
    laid = lay_runs(bank, rows, chosen, predicted).astype(np.float32) / 255.0
    laid[..., :3] *= laid[..., 3:]
    return laid


def _in_flat_ink(bank: TextureBank, rows: Rows, columns: int) -> np.ndarray:
    """The training strokes (R, columns, 4), premultiplied, each filled with one ink."""
    v = across(columns)
    distance = np.abs(v)[None] * (0.5 * rows.width + bank.margin)[:, None]
    cover = np.clip(0.5 * rows.thickness[:, None] - distance + 0.5, 0, 1)
    cover *= (rows.ends.min(axis=1) > -0.5 * rows.thickness)[:, None]
    predicted = bank.predicted_ink.astype(np.float64)
    ink = stroke_ink(rows, solid_ink(predicted, bank))[owner(rows.offsets)]
    solid = np.concatenate([ink[:, :3], np.ones((len(ink), 1))], axis=1)
    return (cover * ink[:, 3:])[..., None] * solid[:, None]


def _traits(strips: np.ndarray, rows: Rows, weight: np.ndarray) -> np.ndarray:
    """What marks look like, per cell: (cells, traits).

    Cells are CELL px long and one of BANDS across; traits are opacity and darkness, their change
    across and along, and their square. Rows count by `weight` (R,); half of a cell's must.
    """
    darkness = strips[..., 3] - strips[..., :3].mean(axis=2)
    tone = np.stack([strips[..., 3], darkness], axis=2)
    tone = ndimage.gaussian_filter(tone, (SIGHT * ROWS, SIGHT * ROWS, 0))
    per_px = ROWS * 1.0
    edges = np.abs(np.diff(tone, axis=1, append=0)) * per_px
    grain = np.abs(np.diff(tone, axis=0, append=0)) * per_px
    grain[rows.offsets[1:] - 1] = 0.0
    maps = np.concatenate([tone, edges, grain, np.square(tone)], axis=2)
    cell = np.arange(len(tone)) // (CELL * ROWS)
    count = np.bincount(cell, weight, minlength=cell[-1] + 1)
    bands = [band.mean(axis=1) for band in np.array_split(maps, BANDS, axis=1)]
    table = np.concatenate(bands, axis=1) * weight[:, None]
    sums = np.stack(
        [np.bincount(cell, column, minlength=cell[-1] + 1) for column in table.T], axis=1
    )
    return (sums / np.maximum(count, 1)[:, None])[count > CELL // 2 * ROWS]
