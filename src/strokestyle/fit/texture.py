"""Learn the texture of a drawing: cut strips along its strokes, and what their ink follows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..drawing.ribbon import Ribbon, across, ribbon, strip_points, strip_stretch
from ..drawing.strip import straight
from ..drawing.strokes import Strokes
from ..geometry.curves import owner
from ..geometry.threads import each
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
    stroke_rows,
)
from .exemplar import Exemplar
from .flatness import evenness
from .own_ink import InkOwners, Texels, ink_margin, nearest_strokes

# Set by hand; no ablation is kept.
STRETCH = 0.4, 2.0  # length along the strip by length along the stroke: beyond, a bend folds it

GAP = 0.1  # opacity past an end: where no ink across is stronger the stroke is over

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
    owners = InkOwners.of(nearest, exemplar.mask)
    margin = ink_margin(nearest, exemplar.alpha, owners.foreign <= 0)
    rows = stroke_rows(strokes, features, margin)
    strips, free = cut_strips(strokes, rows, exemplar, owners, margin)
    occlusion = 1.0 - free.mean(axis=1)
    strips = end_at_gaps(fill_occluded(strips, free, rows, margin), rows)
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
    return replace(bank, flat=evenness(bank, rows, strips).flat)


# ---------------------------------------------------------------------------------------- strips


def cut_strips(
    strokes: Strokes, rows: Rows, exemplar: Exemplar, owners: InkOwners, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """Sample the ink along every stroke, as a hand pulls it.

    Returns premultiplied samples (R, A, 4), and (R, A) bool, False where they are not the stroke's
    own: where another stroke or unexplained ink lies, or a bend folds or tears the strip.
    """
    columns = bank_columns(rows, margin)
    planes = [exemplar.ink[..., k] * exemplar.alpha for k in range(3)] + [exemplar.alpha]
    planes = each(lambda one: ndimage.spline_filter(one, 3, output=np.float32), planes)

    def cut(i: int) -> tuple[np.ndarray, np.ndarray]:
        band = ribbon(strokes, i, margin)
        n = rows.offsets[i + 1] - rows.offsets[i]
        turn = slice(None, None, -1 if rows.turned[i] else 1)
        texels = _texels(band, rows, i, columns, margin, turn)
        samples = [
            ndimage.map_coordinates(plane, texels.at, order=3, mode="nearest", prefilter=False)
            for plane in planes
        ]
        stretch = strip_stretch(band, n, columns)
        own = owners.own(i, texels, margin)
        own &= (stretch > STRETCH[0]) & (stretch < STRETCH[1])
        return np.stack(samples, axis=-1)[turn, turn], own[turn, turn]

    strips, free = zip(*each(cut, range(len(strokes))), strict=True)
    return _valid_ink(np.concatenate(strips)), np.concatenate(free)


def _texels(band: Ribbon, rows: Rows, i: int, columns: int, margin: float, turn: slice) -> Texels:
    """Place the strip of stroke i on the image, in the direction of the stroke's points."""
    part = slice(rows.offsets[i], rows.offsets[i + 1])
    n = part.stop - part.start
    half = 0.5 * rows.width[part][turn] + margin
    return Texels(
        at=strip_points(band, n, columns)[..., ::-1].transpose(2, 0, 1) - 0.5,
        aside=across(columns)[None] * half[:, None],
        thickness=rows.thickness[part][turn],
        past=(rows.ends[part].min(axis=1) < 0)[turn],
    )


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


def end_at_gaps(strips: np.ndarray, rows: Rows) -> np.ndarray:
    """Take away what lies past an end of its stroke (R, A, 4) beyond a gap: it is no part of it."""
    past = rows.ends.min(axis=1) < 0
    blank = strips[..., 3].max(axis=1) < GAP
    out = strips.copy()
    for a, b in zip(rows.offsets[:-1], rows.offsets[1:], strict=True):
        for way in (slice(a, b), slice(b - 1, a - 1 if a else None, -1)):
            # from the middle of the stroke outwards
            half = slice((b - a) // 2, None)
            beyond = np.logical_or.accumulate((past & blank)[way][half])
            out[way][half][beyond] = 0.0
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
