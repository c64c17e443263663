"""Bring the planned strokes to where the drawing has them, and tell that from the artist's manner.

A line that was traced loosely, or over a camera solved by hand, lies some px beside its curve. That
is no manner: it is smooth over the picture, or along the stroke, and has nothing to do with the
stroke's shape. What a point lies off across its stroke is therefore taken for a sum,

    offset = normal . (warp(x, y) + own(stroke, s) + deformations . manner) + noise,

of a warp of the picture, a displacement of each stroke, and the deformations that a style knows of.
The first two have Gaussian priors: a warp that is affine but for what a squared exponential of some
hundred px allows, and cosines along each stroke whose strength falls with their number. How wide
the priors are is learned from the drawing (evidence approximation: MacKay 1992); the manner, which
all strokes share, is free. Ink and displacement are found in turn, from afar to near, as iterative
closest points do (Besl and McKay 1992); errors are Student's, so that wrong matches count little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..extract.view import View
from ..geometry.curves import Curves, arc_length, owner
from ..render.config import StyleConfig
from ..render.displacement import DEFORMATIONS, across_strokes, deformations_of
from ..render.features import plan, surface_at
from ..render.plan import Planned
from .correspond import InkField, Matches, match, runs_across
from .ends import slide_ends

REACHES = (24.0, 20.0, 16.0, 12.0)  # px at 768, within which ink is looked for, in turn
LAST_REACHES = (12.0, 12.0)  # and once it is known which manner there is
MIN_SCALE = 0.4  # px for one at 768 at least: on a small canvas pens are not made as small
FITS = 4  # of the model for every matching

# The warp of the picture, and the strokes' own. Set by hand; no ablation is kept.
WARP_SCALE = 0.22  # of the longer side: the length over which the warp is alike
WARP_STEP = 0.8  # of that length: between the points by which the warp is told
AFFINE = 2.0  # times the prior of the warp: that of its affine part, at the picture's edge
OWN_SCALE = 60.0  # px at 768 along a stroke over which its own displacement is alike
HELD = 1.0  # precision, of that of its prior, with which a stroke is held from moving lengthwise
LEAST_OWN = 0.03  # of the strongest cosine: a weaker one is left out
MANNER = 1.0, 4.0  # prior deviation of the manner: of full strength, and of inflation, px
NEVER = 1e-4  # the same, of a deformation that may not be used

DEGREES = 3.0  # of freedom of Student's distribution of errors
ALIKE = 5.0  # points of a stroke err alike, so that so many count as one
LEAST_NOISE = 0.3  # px of deviation about the model
PRIORS = 0.02, 40.0  # px, deviations that the warp and the strokes' own may have
FIRST = 4.0  # px, of both and of the noise, to begin with

# A manner is one that foretells the strokes that are held out
INFLATES = np.array([name == "inflate" for name in DEFORMATIONS])
FAMILIES = np.array(
    [
        [name.split("_")[0] == family for name in DEFORMATIONS]
        for family in dict.fromkeys(name.split("_")[0] for name in DEFORMATIONS)
    ]
)
FOLDS = 5  # strokes are held out by their number modulo this
SURE = 2.0  # standard errors that the strokes' gains must be above nothing
MIN_GAIN = 3.0  # of log likelihood, of all strokes together
NEAR = 2.5  # px at 768 that a point of a stroke may lie beside its ink
BARE = 3.0  # px at 768 to either side of a point without ink, for a stroke to end there
MIN_MATCHES = 30  # points with ink, below which nothing is moved


@dataclass(frozen=True)
class Alignment:
    """Where a drawing has its strokes.

    Parameters
    ----------
    warp : (N, 2) px, from the planned points by the warp of the picture
    own : (N, 2) px, by the strokes' own displacement
    explained : (N,) bool, where a point so moved, and moved by the manner, lies on ink of its own;
        also past the end of its curve
    manner : (M,) of DEFORMATIONS, as estimated with them
    deviation : (M,) its standard deviation: large where the drawing cannot tell it from the others
    free : (M,) bool, the deformations that the drawing shows
    noise : px, standard deviation of what is left across the strokes
    """

    warp: np.ndarray
    own: np.ndarray
    explained: np.ndarray
    manner: np.ndarray
    deviation: np.ndarray
    free: np.ndarray
    noise: float

    @classmethod
    def on_curves(cls, points: int, deformations: int) -> Alignment:
        """Take strokes to lie on their curves, on ink of their own, in any manner."""
        flat, none = np.zeros((points, 2)), np.zeros(deformations)
        return cls(flat, flat, np.ones(points, bool), none, none, none == 0, 0.0)

    @property
    def shift(self) -> np.ndarray:
        """(N, 2) px, from the planned points to where the drawing has them, but for its manner."""
        return self.warp + self.own

    def part(self, rows: np.ndarray, off: np.ndarray) -> Alignment:
        """Keep some rows (n,), moved by `off` (n, 2) px more."""
        return replace(
            self, warp=self.warp[rows], own=self.own[rows] + off, explained=self.explained[rows]
        )


def align(
    mask: np.ndarray, planned: Planned, deformations: np.ndarray, spacing: float
) -> Alignment:
    """Find where a drawing has its strokes.

    Parameters
    ----------
    mask : (H, W) float, 1 = ink
    planned : strokes on the curves, N points
    deformations : (N, M, 2) px, what each of DEFORMATIONS does to a point
    spacing : px between points
    """
    scale = max(max(mask.shape) / 768.0, MIN_SCALE)
    model, ink = _Model.of(planned, deformations, scale), InkField.of(mask)
    state = _State.first(model)
    for k, reach in enumerate((*REACHES, *LAST_REACHES)):
        moved = planned.xy + model.moved(state)
        normals = across_strokes(moved, planned.offsets, spacing)
        matches = _match(ink, moved, normals, planned, spacing, reach * scale)
        if matches.found.sum() < MIN_MATCHES:
            state = replace(_State.first(model), free=np.zeros(len(DEFORMATIONS), bool))
            break
        away = ((moved - planned.xy) * normals).sum(axis=1) + np.nan_to_num(matches.offset)
        seen = np.flatnonzero(matches.found)
        columns = _Columns.of(model, seen, normals[seen])
        for _ in range(FITS):
            state = columns.fitted(away[seen], state)
        if k == len(REACHES) - 1:
            state = replace(state, free=columns.choose_manner(away[seen], state))
    return _alignment(model, state, ink, planned, spacing, scale)


def aligned_curves(view: View, mask: np.ndarray, config: StyleConfig) -> Curves:
    """Lay the curves of a view where a drawing has them, (H, W) mask, 1 = ink.

    `config` says how strokes are planned; curves that are in no stroke stay where they are.
    """
    curves, planned = view.curves, plan(view, config)
    if not len(planned):
        return curves
    surface = planned.carry(surface_at(view, config.spacing))
    found = align(
        mask, planned, deformations_of(planned, surface[:, 3:], config.spacing), config.spacing
    )
    total, count = np.zeros((len(curves.xy), 2)), np.zeros(len(curves.xy))
    for side in (0, 1):  # of the two rows that a point lies between, each takes its share
        weight = np.where(planned.on_curve, np.abs(1.0 - side - planned.mix), 0.0)
        rows = planned.source[:, side]
        np.add.at(count, rows, weight)
        np.add.at(total, rows, weight[:, None] * found.shift)
    known = count > 1e-6
    for_all = np.arange(len(curves.xy), dtype=np.float64)
    shift = np.zeros_like(total)
    for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True):
        near = np.flatnonzero(known[a:b]) + a
        if len(near):
            mean = total[near] / count[near, None]
            shift[a:b] = np.stack([np.interp(for_all[a:b], near, c) for c in mean.T], axis=1)
    return replace(curves, xy=curves.xy + shift)


def _match(
    ink: InkField,
    xy: np.ndarray,
    normals: np.ndarray,
    planned: Planned,
    spacing: float,
    reach: float,
) -> Matches:
    """Match the points that lie on their curves; those past its ends have no ink."""
    on_curve = planned.on_curve
    offsets = np.r_[0, np.cumsum(np.add.reduceat(on_curve.astype(np.int64), planned.offsets[:-1]))]
    found = match(ink, xy[on_curve], normals[on_curve], offsets, spacing, reach)
    columns = []
    for value, empty in ((found.offset, np.nan), (found.thickness, 0.0), (found.agreement, 0.0)):
        column = np.full(len(xy), empty)
        column[on_curve] = value
        columns.append(column)
    return Matches(*columns)


def _alignment(
    model: _Model, state: _State, ink: InkField, planned: Planned, spacing: float, scale: float
) -> Alignment:
    """What was found, with the strokes' ends slid to where their ink ends."""
    warp, own = model.warp @ state.warp, model.own_moved(state.own)
    manner = (model.manner * state.manner[:, None]).sum(axis=1)
    xy = planned.xy + warp + own

    def explained() -> np.ndarray:
        normals = across_strokes(xy + manner, planned.offsets, spacing)
        reach = REACHES[-1] * scale
        matches = match(ink, xy + manner, normals, planned.offsets, spacing, reach)
        near = 0.5 * matches.thickness + max(2.0 * state.noise, NEAR * scale)
        return matches.found & (np.abs(np.nan_to_num(matches.offset)) < near)

    found = explained()
    if found.any():
        normals = across_strokes(planned.xy, planned.offsets, spacing)
        off = ((warp + own) * normals).sum(axis=1)[found & planned.on_curve]
        rms = float(np.sqrt(np.mean(off**2))) if len(off) else 0.0
        runs = runs_across(ink, xy + manner, normals, REACHES[-1] * scale)
        bare = np.abs(runs.offset[:, 0]) - 0.5 * runs.thickness[:, 0] > BARE * scale
        slid = slide_ends(xy, found, bare, planned, rms, spacing, scale)
        own, xy = own + slid - xy, slid
        found = explained()
    return Alignment(warp, own, found, state.manner, state.deviation, state.free, state.noise)


# ------------------------------------------------------------------------------------- the model


@dataclass(frozen=True)
class _Model:
    """The columns by which points are moved; those of warp and own have a prior deviation of 1.

    Parameters
    ----------
    manner : (N, M, 2) px
    warp : (N, Q), for x and y alike
    own : (N, K), likewise, of the point's stroke; one that its stroke is too short for is 0
    offsets : (C+1,)
    """

    manner: np.ndarray
    warp: np.ndarray
    own: np.ndarray
    offsets: np.ndarray

    @classmethod
    def of(cls, planned: Planned, deformations: np.ndarray, scale: float) -> _Model:
        """`scale` is px of the canvas for one at 768."""
        warp = warp_columns(planned.xy, 768.0 * scale)
        return cls(deformations, warp, own_columns(planned, OWN_SCALE * scale), planned.offsets)

    def moved(self, state: _State) -> np.ndarray:
        """The displacement (N, 2), px, of the points by all three."""
        manner = (self.manner * state.manner[:, None]).sum(axis=1)
        return self.warp @ state.warp + self.own_moved(state.own) + manner

    def own_moved(self, own: np.ndarray) -> np.ndarray:
        """The displacement (N, 2), px, of the points by what is their stroke's own (C, K, 2)."""
        return (self.own[:, :, None] * own[owner(self.offsets)]).sum(axis=1)


def warp_columns(xy: np.ndarray, size: float) -> np.ndarray:
    """The columns (N, Q) of which a warp of the picture is made at points (N, 2), px.

    An affine one, and a Gaussian process of a squared exponential over WARP_SCALE of `size` px,
    told by its values at a grid of points.
    """
    length = WARP_SCALE * size
    low, high = xy.min(axis=0), xy.max(axis=0)
    sides = [
        np.linspace(a, b, int(np.ceil((b - a) / (WARP_STEP * length))) + 1)
        for a, b in zip(low - 0.25 * length, high + 0.25 * length, strict=True)
    ]
    grid = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)

    def alike(a: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * ((a[:, None] - grid) ** 2).sum(axis=2) / length**2)

    root = np.linalg.cholesky(alike(grid) + 1e-6 * np.eye(len(grid)))
    field = np.linalg.solve(root, alike(xy).T).T
    affine = np.c_[np.ones(len(xy)), (xy - 0.5 * (low + high)) / (0.5 * size)]
    return np.concatenate([AFFINE * affine, field], axis=1)


def own_columns(planned: Planned, length: float) -> np.ndarray:
    """The columns (N, K) of which a stroke's own displacement is made: cosines along it.

    They are those of a squared exponential over `length` px, with a variance of 1 on the whole.
    Past the ends of the curve they stay what they are there.
    """
    stroke, along = owner(planned.offsets), arc_length(planned.xy, planned.offsets)
    on_curve = planned.on_curve
    begin, end = np.full(len(planned), np.inf), np.zeros(len(planned))
    np.minimum.at(begin, stroke[on_curve], along[on_curve])
    np.maximum.at(end, stroke[on_curve], along[on_curve])
    total = np.maximum(end - begin, 1e-6)
    along = np.clip(along, begin[stroke], end[stroke]) - begin[stroke]
    most = int(2.0 * np.sqrt(-np.log(LEAST_OWN)) * total.max() / (np.pi * length)) + 1
    number = np.arange(most)
    strength = np.exp(-0.25 * (np.pi * number * length / total[:, None]) ** 2)
    strength[strength < LEAST_OWN] = 0.0
    power = strength[:, :1] ** 2 + 0.5 * (strength[:, 1:] ** 2).sum(axis=1, keepdims=True)
    strength /= np.sqrt(power)
    return strength[stroke] * np.cos(np.pi * number * (along / total[stroke])[:, None])


# ---------------------------------------------------------------------------------- the estimate


@dataclass(frozen=True)
class _State:
    """What is known of the columns, and of their priors.

    Parameters
    ----------
    manner, deviation : (M,), and its standard deviation
    warp : (Q, 2) px
    own : (C, K, 2) px
    free : (M,) bool, the deformations that may be used
    warp_prior, own_prior, noise : px, standard deviations
    """

    manner: np.ndarray
    deviation: np.ndarray
    warp: np.ndarray
    own: np.ndarray
    free: np.ndarray
    warp_prior: float = FIRST
    own_prior: float = FIRST
    noise: float = FIRST

    @classmethod
    def first(cls, model: _Model) -> _State:
        """Nothing moved, nothing known."""
        none = np.zeros(model.manner.shape[1])
        strokes = len(model.offsets) - 1
        return cls(
            none,
            _manner_prior(none == 0),
            np.zeros((model.warp.shape[1], 2)),
            np.zeros((strokes, model.own.shape[1], 2)),
            none == 0,
        )

    def shared_prior(self, count: int) -> np.ndarray:
        """The prior deviations (count,) of the manner, and then of the warp."""
        manner = _manner_prior(self.free)
        return np.r_[manner, np.full(count - len(manner), self.warp_prior)]


@dataclass(frozen=True)
class _Columns:
    """The columns across the strokes, at the points where something was observed.

    Parameters
    ----------
    shared : (n, M + 2 Q), manner, and the warp in x and in y
    own, along : (n, 2 K), in x and in y, across the strokes and along them
    manner : M
    pieces : (C + 1,), the observed points of stroke i are rows pieces[i]:pieces[i+1]
    """

    shared: np.ndarray
    own: np.ndarray
    along: np.ndarray
    manner: int
    pieces: np.ndarray

    @classmethod
    def of(cls, model: _Model, rows: np.ndarray, normals: np.ndarray) -> _Columns:
        """`rows` (n,) of the points that are seen, and their normals (n, 2)."""
        manner = (model.manner[rows] * normals[:, None]).sum(axis=2)
        x, y = normals.T[:, :, None]
        warp, own = model.warp[rows], model.own[rows]
        return cls(
            np.concatenate([manner, x * warp, y * warp], axis=1),
            np.concatenate([x * own, y * own], axis=1),
            np.concatenate([y * own, -x * own], axis=1),
            manner.shape[1],
            np.searchsorted(rows, model.offsets),
        )

    def fitted(self, away: np.ndarray, state: _State) -> _State:
        """Fit the columns to the offsets (n,) px, and the priors and the noise to the columns."""
        weight, strokes = self._strokes(away, state)
        prior = state.shared_prior(self.shared.shape[1])
        covariance = np.linalg.inv(sum(one.gram for one in strokes) + np.diag(prior**-2.0))
        shared = covariance @ sum(one.moment for one in strokes)
        own = np.zeros((len(self.pieces) - 1, self.own.shape[1]))
        spread, power = 0.0, 0.0
        for one in strokes:
            own[one.stroke, one.used] = one.mean - one.solved @ shared
            spread += one.spread(covariance)
            power += own[one.stroke, one.used] @ one.prior @ own[one.stroke, one.used]
        manner, warp = slice(None, self.manner), slice(self.manner, None)
        misfit = away - self.shared @ shared - self._own_at(own)
        noise = np.sqrt((weight * misfit**2).mean())
        return replace(
            state,
            manner=shared[manner],
            deviation=np.sqrt(np.diag(covariance)[manner]),
            warp=shared[warp].reshape(2, -1).T,
            own=own.reshape(len(own), 2, -1).transpose(0, 2, 1),
            warp_prior=_prior(
                (shared[warp] ** 2).sum(),
                np.trace(covariance[warp, warp]),
                state.warp_prior,
                len(shared) - self.manner,
            ),
            own_prior=_prior(power, spread, state.own_prior, sum(len(one.used) for one in strokes)),
            noise=float(max(noise, LEAST_NOISE)),
        )

    def choose_manner(self, away: np.ndarray, state: _State) -> np.ndarray:
        """Choose the deformations (M,) bool that foretell the offsets of strokes held out.

        Families of them are added one by one, the best first, as long as what the strokes that are
        held out become more likely by is sure.
        """
        _, strokes = self._strokes(away, state)
        chosen = np.zeros(self.manner, bool)
        score = self._held_out(strokes, state, chosen)
        while True:
            tried = [chosen | family for family in FAMILIES if not chosen[family].any()]
            scores = [self._held_out(strokes, state, columns) for columns in tried]
            if not scores:
                return chosen
            best = int(np.argmax([one.sum() for one in scores]))
            gain = scores[best] - score
            root = np.sign(gain) * np.sqrt(np.abs(gain))  # so that one stroke decides nothing
            if root.sum() < SURE * np.sqrt(np.abs(gain).sum()) or gain.sum() < MIN_GAIN:
                return chosen
            chosen, score = tried[best], scores[best]

    def _held_out(self, strokes: list[_Stroke], state: _State, columns: np.ndarray) -> np.ndarray:
        """Log likelihoods (strokes,) of strokes held out, where so much manner (M,) bool is free.

        What is a stroke's own is integrated out.
        """
        prior = replace(state, free=columns).shared_prior(self.shared.shape[1])
        gram, moment = sum(one.gram for one in strokes), sum(one.moment for one in strokes)
        out = np.zeros(len(strokes))
        for k in range(FOLDS):
            held = [i for i in range(len(strokes)) if i % FOLDS == k]
            others = gram - sum(strokes[i].gram for i in held) + np.diag(prior**-2.0)
            answer = np.linalg.solve(others, moment - sum(strokes[i].moment for i in held))
            for i in held:
                out[i] = strokes[i].likelihood(answer)
        return out

    def _own_at(self, own: np.ndarray) -> np.ndarray:
        """What the strokes' own (C, 2 K) does across the strokes, (n,)."""
        return (self.own * own[owner(self.pieces)]).sum(axis=1)

    def _strokes(self, away: np.ndarray, state: _State) -> tuple[np.ndarray, list[_Stroke]]:
        """Weigh the offsets (n,), and solve for every stroke's own as a function of what is shared.

        Returns the weights (n,) and the strokes.
        """
        shared, own = _flat(state)
        misfit = away - self.shared @ shared - self._own_at(own)
        weight = (DEGREES + 1.0) / (DEGREES + (misfit / state.noise) ** 2)
        precision = weight / (ALIKE * state.noise**2)
        out = []
        for stroke, (a, b) in enumerate(zip(self.pieces[:-1], self.pieces[1:], strict=True)):
            if a < b:
                columns = self.own[a:b], self.along[a:b], self.shared[a:b]
                rows = *columns, away[a:b], precision[a:b]
                out.append(_Stroke.of(stroke, *rows, state.own_prior))
        return weight, out


@dataclass(frozen=True)
class _Stroke:
    """One stroke's part of the normal equations, its own eliminated (Schur's complement).

    Parameters
    ----------
    stroke : its number
    used : (u,) its columns
    prior : (u, u) precision of their prior, for a deviation of 1
    inverse : (u, u) of their normal equations
    solved : (u, P) inverse @ what they share with the columns that are shared
    mean : (u,) its own where nothing is shared
    gram, moment : (P, P) and (P,) of what is shared
    square : of the offsets
    """

    stroke: int
    used: np.ndarray
    prior: np.ndarray
    inverse: np.ndarray
    solved: np.ndarray
    mean: np.ndarray
    gram: np.ndarray
    moment: np.ndarray
    square: float

    @classmethod
    def of(
        cls,
        stroke: int,
        own: np.ndarray,
        along: np.ndarray,
        shared: np.ndarray,
        away: np.ndarray,
        precision: np.ndarray,
        prior: float,
    ) -> _Stroke:
        """From the rows of one stroke, and the prior of its own."""
        used = np.flatnonzero(np.abs(own).max(axis=0) > 0)
        own, along = own[:, used], along[:, used]
        weighted, sharing = own * precision[:, None], shared * precision[:, None]
        # nothing is seen of what moves along the stroke: it is held back
        shape = np.eye(len(used)) + HELD / ALIKE * along.T @ along
        inverse = np.linalg.inv(weighted.T @ own + shape / prior**2)
        cross, at = weighted.T @ shared, weighted.T @ away
        solved, mean = inverse @ cross, inverse @ at
        return cls(
            stroke,
            used,
            shape,
            inverse,
            solved,
            mean,
            sharing.T @ shared - cross.T @ solved,
            sharing.T @ away - cross.T @ mean,
            float((precision * away**2).sum() - at @ mean),
        )

    def spread(self, covariance: np.ndarray) -> float:
        """The posterior variance of its own, in units of its prior's precision, (P, P) given."""
        own = self.inverse + self.solved @ covariance @ self.solved.T
        return float((own * self.prior).sum())

    def likelihood(self, shared: np.ndarray) -> float:
        """The logarithm of how likely its offsets are, but for a constant."""
        return float(-0.5 * (self.square - 2 * shared @ self.moment + shared @ self.gram @ shared))


def _manner_prior(free: np.ndarray) -> np.ndarray:
    """The prior deviations (M,) of the deformations, of which some are `free` (M,) bool."""
    return np.where(free, np.where(INFLATES, MANNER[1], MANNER[0]), NEVER)


def _flat(state: _State) -> tuple[np.ndarray, np.ndarray]:
    """What is shared (M + 2 Q,) and own (C, 2 K), as the columns have it."""
    own = state.own.transpose(0, 2, 1)
    return np.r_[state.manner, state.warp.T.ravel()], own.reshape(len(own), -1)


def _prior(power: float, spread: float, prior: float, count: int) -> float:
    """MacKay's estimate of a prior deviation, px, of so many columns.

    `power` is the sum of their squares and `spread` that of their posterior variances.
    """
    known = max(count - spread / prior**2, 1e-6 * count)
    return float(np.clip(np.sqrt(power / known), *PRIORS))
