"""Texture by example: lay strips of the bank along new strokes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..drawing.ribbon import across
from ..drawing.strip import straight
from ..drawing.strokes import Strokes, Texture
from ..geometry.curves import owner
from .texture_bank import (
    END,
    INK_SIGMA,
    OWN_REGRESSORS,
    ROWS,
    TextureBank,
    bank_columns,
    check_strokes,
    regressors_of,
    smooth_rows,
    solid_ink,
    stroke_ink,
    stroke_rows,
)

NODE = 4  # px between the choices along a new stroke
CANDIDATES = 24  # source positions weighed at every choice
LUCK = 0.3  # how far chance decides between sources that cost about the same
FLAW, JUMP, SEEN, OVER = (
    12.0,
    3.0,
    60.0,
    4.0,
)  # costs: of hidden rows, of a joint, of what it shows, past a strip's end
LEAST_NOISE = np.array([0.03, 0.02, 0.02, 0.02])
TONE_COST, WIDTH_COST = 0.7, 5.8  # weights of a standard deviation of tone, of a factor e in width
FEATHER = 3.0  # rows over which two runs fade into each other at a cut
HALF_CUT = 4  # px to either side of a joint within which the least-error cut is sought


def synthesise(
    bank: TextureBank, strokes: Strokes, features: np.ndarray, seed: int = 0
) -> tuple[Texture | None, np.ndarray]:
    """Texture for new strokes, and the flat ink of each: (Texture or None, (C, 4) straight RGBA in [0, 1]).

    The same bank, strokes, features and seed give the same texture. Raises ValueError on features that do not fit.
    """
    features = check_strokes(strokes, features)
    known = bank.scale.shape[1] - OWN_REGRESSORS
    if features.shape[1] != known:
        raise ValueError(
            f"the texture was learned with {known} feature(s) a point, got {features.shape[1]}"
        )
    if not len(strokes):
        return None, np.zeros((0, 4))
    margin = bank.margin
    rows = stroke_rows(strokes, features, margin)
    predicted = regressors_of(rows, bank.scale.astype(np.float64)) @ bank.weights
    low, high = bank.local_ink.min(axis=0), bank.local_ink.max(axis=0)
    predicted = np.clip(predicted, low, high)
    if bank.flat:
        return None, stroke_ink(rows, solid_ink(predicted, bank))
    rng = np.random.default_rng(seed)
    strips = lay_runs(bank, rows, choose_runs(bank, rows, predicted, rng), predicted)
    return Texture(_turn(strips, rows), rows.offsets, margin), stroke_ink(rows, predicted)


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


def choose_runs(bank, rows, predicted, rng, barred=None) -> Runs:
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
    every = np.arange(0, len(bank.width), ROWS)  # source rows on offer
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
    follows = np.full(len(bank.width), -1)
    r = np.arange(len(bank.width) - step)
    follows[r] = np.where(strip[r] == strip[r + step], r + step, -1)
    chosen = _viterbi(bank.appearance, near, first, target, source, follows)
    home = strip[chosen]
    return Runs(
        first, begin, chosen - begin - step // 2, bank.offsets[home], bank.offsets[home + 1] - 1
    )


def _cost_factors(bank, rows, predicted, node):
    """(K, D) and (T, D) float32, whose inner product is the cost of laying a source row on a node's row."""
    noise = np.maximum(bank.noise, LEAST_NOISE)

    def plain(tone, width):
        return np.concatenate(
            [TONE_COST * tone / noise, WIDTH_COST * np.log(width[:, None] + 1.0)], axis=1
        )

    ends = np.clip(rows.ends[node], -8.0, END)
    weight = 1.0 / np.square(4.0 + 0.25 * np.maximum(ends, 0.0))
    mine = plain(predicted[node], rows.width[node])
    constant = np.square(mine).sum(axis=1, keepdims=True) + (weight * ends * ends).sum(
        axis=1, keepdims=True
    )
    target = [constant, np.ones((len(node), 1)), -2.0 * mine, weight, -2.0 * weight * ends]
    width, flaw = bank.width, bank.occlusion[:, None]
    theirs, at = plain(bank.predicted_ink, width), np.clip(bank.ends, -8.0, END)
    constant = (
        np.square(theirs).sum(axis=1, keepdims=True)
        + FLAW * flaw
        + np.where(flaw > 0.4, 100.0, 0.0)
    )
    source = [np.ones((len(width), 1)), constant, theirs, at * at, at]
    return np.concatenate(target, axis=1).astype(np.float32), np.concatenate(source, axis=1).astype(
        np.float32
    )


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
        seam = (
            np.square(x).sum(axis=2)[:, :, None]
            + np.square(y).sum(axis=2)[:, None]
            - 2.0 * x @ y.swapaxes(1, 2)
        )
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


def lay_runs(bank, rows, runs: Runs, predicted) -> np.ndarray:
    """Copy the chosen runs into strips (R, A, 4) uint8 for the new strokes, and hide their joints."""
    columns, step = bank_columns(rows, bank.margin), NODE * ROWS
    stroke = owner(rows.offsets)
    every = np.arange(len(stroke))
    node = np.minimum(
        runs.first[stroke] + (every - rows.offsets[stroke]) // step, runs.first[stroke + 1] - 1
    )
    copied = runs.source(node, every)
    # tone: what the features ask for here, and beyond that what the source had, carried smoothly over the joints
    wanted = predicted + smooth_rows(_luck(bank, copied, stroke), rows.offsets, INK_SIGMA * ROWS)

    def copy(source, row):
        return _toned(
            _resampled(bank, source, rows.width[row], columns), bank.local_ink[source], wanted[row]
        )

    layer = np.concatenate(
        [copy(copied[a : a + 8192], every[a : a + 8192]) for a in range(0, len(every), 8192)]
    )
    for before, after, ahead in _joints(rows, runs):
        _join(layer, copy, rows, runs, before, after, ahead)
    layer *= _caps(rows, bank.ends[copied], bank.margin, columns)
    return np.rint(np.clip(straight(layer, least=1e-4), 0, 1) * 255).astype(np.uint8)


def _luck(bank, copied, stroke):
    """Tone (R, 4) beyond what the features ask for, of rows of new strokes that copy the rows `copied`.

    What sets a whole stroke apart, its pressure or its colour, is one for all of a new stroke: that of the strip which
    most of it is copied from.
    """
    strips = len(bank.offsets) - 1
    trust = 1.001 - bank.occlusion
    beyond, home = bank.local_ink - bank.predicted_ink, owner(bank.offsets)
    total = np.bincount(home, trust, minlength=strips)
    own = np.stack(
        [np.bincount(home, trust * column, minlength=strips) for column in beyond.T], axis=1
    )
    own /= total[:, None]
    used = np.bincount(stroke * strips + home[copied], minlength=(stroke[-1] + 1) * strips).reshape(
        -1, strips
    )
    return beyond[copied] - own[home[copied]] + own[used.argmax(axis=1)][stroke]


def _joints(rows, runs):
    """Groups of joints that do not touch each other: (node before, node after, rows by which the way wraps)."""
    count = np.diff(runs.first)
    stroke = owner(runs.first)
    after = np.setdiff1d(np.arange(runs.first[-1]), runs.first[:-1])
    after = after[
        (runs.shift[after] != runs.shift[after - 1]) | (runs.low[after] != runs.low[after - 1])
    ]
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
    row = np.where(
        rows.closed[stroke][:, None], low + (at - low) % (high - low), np.clip(at, low, high - 1)
    )
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
    weight = np.clip((np.arange(n)[:, None] - cut[:, None]) / FEATHER + 0.5, 0.0, 1.0)[
        ..., None
    ].astype(np.float32)
    return old * (1 - weight) + new * weight


def _caps(rows, source, margin, columns):
    """(R, columns, 1) in [0, 1]: rounds off the rows past an end that were copied from the body of a stroke."""
    ends = rows.ends
    past = np.maximum(0.0, -ends)
    body = past * np.clip(
        (source - ends - 1.0) / 2.0, 0.0, 1.0
    )  # as far past as the source was not
    body = body.max(axis=1)[:, None]
    v = across(columns)
    aside = v[None] * (0.5 * rows.width + margin)[:, None]
    inside = np.clip(0.5 * rows.width[:, None] + 0.5 - np.hypot(aside, body), 0.0, 1.0)
    return np.where(body > 0, inside, 1.0)[..., None].astype(np.float32)


def _toned(patch, tone, wanted):
    """Premultiplied rows (n, A, 4) whose opacity and ink are moved from `tone` (n, 4) to `wanted` (n, 4)."""
    gain = np.clip((wanted[:, 0] + 0.1) / (tone[:, 0] + 0.1), 0.5, 2.0)
    alpha = np.minimum(patch[..., 3] * gain[:, None], 1.0)
    ink = patch[..., :3] / np.maximum(patch[..., 3:], 1e-4) + (wanted[:, 1:] - tone[:, 1:])[:, None]
    return np.concatenate(
        [np.clip(ink, 0, 1) * alpha[..., None], alpha[..., None]], axis=-1
    ).astype(np.float32)


def _resampled(bank, s, width, columns):
    """Rows s of the bank, stretched across from their own width to `width` (n,), premultiplied float32.

    The core is stretched; beyond the edge distances stay what they are, so that a soft edge keeps its softness.
    """
    a, margin = bank.rgba.shape[1], bank.margin
    v = across(columns)
    half, own = 0.5 * width[:, None], 0.5 * bank.width[s][:, None].astype(np.float64)
    distance = np.abs(v)[None] * (half + margin)
    inner = distance * (own / np.maximum(half, 1e-6))
    place = np.sign(v)[None] * np.where(distance < half, inner, own + distance - half)
    column = np.clip((place / (own + margin) + 1.0) * 0.5 * a - 0.5, 0, a - 1)
    c0 = np.minimum(column.astype(np.int64), a - 2)
    f = (column - c0)[..., None].astype(np.float32)
    strip = bank.rgba[s].astype(np.float32) / 255.0
    strip[..., :3] *= strip[..., 3:]
    r = np.arange(len(s))[:, None]
    return strip[r, c0] * (1 - f) + strip[r, c0 + 1] * f
