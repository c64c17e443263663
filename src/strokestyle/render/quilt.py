"""Texture by example: lay strips of the bank along new strokes, as image quilting does.

A new strip is copied in runs, each from consecutive rows of a strip of the bank. A run is chosen
for every NODE px by the cheapest sequence (`choose_runs`), and runs are joined along least-error
cuts (`lay_runs`). After Efros and Freeman 2001, along one dimension.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ..drawing.ribbon import across
from ..drawing.strip import straight
from ..drawing.strokes import Strokes, Texture
from ..geometry.curves import owner
from ..geometry.threads import each, in_turn
from .texture_bank import (
    END,
    INK_SIGMA,
    OWN_REGRESSORS,
    ROWS,
    Rows,
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
STEP = NODE * ROWS  # the same in rows
CANDIDATES = 24  # source rows weighed at every choice
GROUPS = 64  # of source rows, whose lowest costs bound those of the candidates
RANDOMNESS = 0.3  # mean of what chance adds to a source's cost

# Costs of laying a source row on a new one
INK_COST, WIDTH_COST = 0.7, 5.8  # of a standard deviation of ink, of a factor e in width
OCCLUSION_COST = 12.0  # of a row that other strokes hide
MAX_OCCLUSION = 0.4  # above this a row is as good as never laid
FORBIDDEN = 100.0  # the cost of that
MIN_NOISE = np.array([0.03, 0.02, 0.02, 0.02])  # of opacity and colour, for media without any
MIN_END = -8.0  # px past an end; what lies farther is alike
# px of error in an end's distance that cost 1, and how many more for each px away from the end
END_ERROR, END_ERROR_SLOPE = 4.0, 0.25

# Costs of a joint between two runs
JUMP_COST = 3.0  # of any
SEEN_COST = 60.0  # of the squared difference in appearance
STRIP_OVER_COST = 4.0  # where the strip ended

FEATHER = 3.0  # rows over which two runs fade into each other at a cut
HALF_CUT = 4  # px to either side of a joint within which the least-error cut is sought
# what is worked out at a time, so that it stays in cache: nodes whose sources are weighed, rows
# that are copied
BLOCK, CHUNK = 128, 1024


def synthesise(
    bank: TextureBank, strokes: Strokes, features: np.ndarray, seed: int = 0
) -> tuple[Texture | None, np.ndarray]:
    """Make texture for new strokes.

    Parameters
    ----------
    bank : of the medium
    strokes : C of them, in px of the style's canvas
    features : (N, P), at their points, as `learn_texture` was given
    seed : same arguments and seed, same texture

    Returns
    -------
    The texture, or None where the medium is flat ink; and the flat ink of each stroke, (C, 4)
    straight RGBA in [0, 1].

    Raises ValueError on features that do not fit the strokes or the bank.
    """
    features = check_strokes(strokes, features)
    known = bank.scale.shape[1] - OWN_REGRESSORS
    if features.shape[1] != known:
        raise ValueError(
            f"the texture was learned with {known} feature(s) a point, got {features.shape[1]}"
        )
    if not len(strokes):
        return None, np.zeros((0, 4))
    rows = stroke_rows(strokes, features, bank.margin)
    predicted = predicted_ink(bank, rows)
    if bank.flat:
        return None, stroke_ink(rows, solid_ink(predicted, bank))
    runs = choose_runs(bank, rows, predicted, np.random.default_rng(seed))
    strips = _turned(lay_runs(bank, rows, runs, predicted), rows)
    margin = np.full(len(strokes), bank.margin)
    return Texture(strips, rows.offsets, margin), stroke_ink(rows, predicted)


def predicted_ink(bank: TextureBank, rows: Rows) -> np.ndarray:
    """The local ink (R, 4) that the features of rows ask for."""
    predicted = regressors_of(rows, bank.scale.astype(np.float64)) @ bank.weights
    return np.clip(predicted, bank.local_ink.min(axis=0), bank.local_ink.max(axis=0))


def _turned(strips: np.ndarray, rows: Rows) -> np.ndarray:
    """Strips in the direction of their strokes' points."""
    out = strips.copy()
    for i in np.flatnonzero(rows.turned):
        part = slice(rows.offsets[i], rows.offsets[i + 1])
        out[part] = strips[part][::-1, ::-1]
    return out


# ------------------------------------------------------------------------------------- which rows


@dataclass(frozen=True)
class Runs:
    """Which source row each row of the new strips copies: row r copies r + shift, within a strip.

    Parameters
    ----------
    first : (C+1,) int64, the nodes of stroke i are first[i]:first[i+1], one every NODE px
    begin : (K,) int64, first row of each node's stretch
    shift : (K,) int64, from new row to source row
    low, high : (K,) int64, first and last row of the strip that a node copies from
    """

    first: np.ndarray
    begin: np.ndarray
    shift: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def source(self, node: np.ndarray, row: np.ndarray) -> np.ndarray:
        """The source of new rows, if the runs of these nodes were followed so far."""
        return np.clip(row + self.shift[node], self.low[node], self.high[node])


def choose_runs(
    bank: TextureBank,
    rows: Rows,
    predicted: np.ndarray,
    chance: Chance,
    excluded: np.ndarray | None = None,
    every: int = ROWS,
) -> Runs:
    """Choose the cheapest sequence of source rows along every stroke.

    Parameters
    ----------
    bank : T source rows in S strips
    rows : of the new strips, R in all
    predicted : (R, 4), the ink that they should have
    chance : decides between sources that cost about the same
    excluded : (C, S) bool, strips that a stroke may not copy from
    every : of the source rows, each so-manieth is on offer where a run begins
    """
    count = -(-np.diff(rows.offsets) // STEP)
    first = np.r_[0, np.cumsum(count)]
    stroke = owner(first)
    begin = rows.offsets[stroke] + (np.arange(first[-1]) - first[stroke]) * STEP
    middle = np.minimum(begin + STEP // 2, rows.offsets[stroke + 1] - 1)
    target, source = cost_factors(bank, rows, predicted, middle)
    strip = owner(bank.offsets)
    barred = None if excluded is None else excluded[stroke][:, strip[::every]]
    offered = np.ascontiguousarray(source[::every])
    near = _cheapest_sources(target, offered, chance, barred) * every
    chosen = cheapest_sequence(bank.appearance, near, first, target, source, _followers(strip))
    home = strip[chosen]
    return Runs(
        first, begin, chosen - begin - STEP // 2, bank.offsets[home], bank.offsets[home + 1] - 1
    )


class Chance(Protocol):
    """What decides between sources: a random generator, or what draws as one does."""

    def standard_exponential(self, size: tuple[int, int], dtype: type) -> np.ndarray:
        """Numbers of mean 1 for so many nodes, the next ones, and sources."""
        ...


def _cheapest_sources(
    target: np.ndarray, source: np.ndarray, chance: Chance, barred: np.ndarray | None
) -> np.ndarray:
    """The CANDIDATES of the sources on offer (K, W) that are cheapest to lay on each node.

    `barred` (K, T) bool says which of them may not be taken.
    """
    few = min(CANDIDATES, len(source))
    near = np.empty((len(target), few), np.int64)

    def choose(drawn: tuple[slice, np.ndarray]) -> None:
        part, noise = drawn
        cost = target[part] @ source.T
        cost += np.multiply(noise, RANDOMNESS, out=noise)
        if barred is not None:
            cost[barred[part]] += 1e6
        near[part] = _lowest(cost, few)

    parts = (slice(a, min(a + BLOCK, len(target))) for a in range(0, len(target), BLOCK))
    numbers = chance.standard_exponential
    for _ in in_turn(
        choose, ((p, numbers((p.stop - p.start, len(source)), np.float32)) for p in parts)
    ):
        pass
    return near


def _lowest(cost: np.ndarray, few: int) -> np.ndarray:
    """The columns (K, few) where each row of costs (K, T) is lowest, in any order.

    No more than the lowest of the lowest of GROUPS groups has to be sorted out.
    """
    each = cost.shape[1] // GROUPS
    if few > GROUPS or each < 2:
        return np.argpartition(cost, few - 1, axis=1)[:, :few]
    least = cost[:, : GROUPS * each].reshape(len(cost), GROUPS, each).min(axis=2)
    enough = np.partition(least, few - 1, axis=1)[:, few - 1 : few]
    row, column = np.divmod(np.flatnonzero(cost <= enough), cost.shape[1])
    begin = np.searchsorted(row, np.arange(len(cost) + 1))
    left = np.full((len(cost), np.diff(begin).max()), np.inf, cost.dtype)
    place = np.arange(len(row)) - begin[row]
    left[row, place] = cost[row, column]
    return column[begin[:-1, None] + np.argpartition(left, few - 1, axis=1)[:, :few]]


def _followers(strip: np.ndarray) -> np.ndarray:
    """The source row (T,) that lies a node's stretch after each; -1 where the strip is over."""
    follows = np.full(len(strip), -1)
    r = np.arange(len(strip) - STEP)
    follows[r] = np.where(strip[r] == strip[r + STEP], r + STEP, -1)
    return follows


def cost_factors(
    bank: TextureBank, rows: Rows, predicted: np.ndarray, node: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Factor the cost of laying source rows on new ones into an inner product.

    The cost is the sum of squared differences, in ink by its noise, in the logarithm of width, and
    in the distance to both ends by END_ERROR and END_ERROR_SLOPE; and what an occluded row costs.

    Parameters
    ----------
    predicted : (R, 4), the ink that new rows should have
    node : (K,), the new rows that are asked for

    Returns
    -------
    (K, D) and (T, D) float32: the cost of source row t on node k is the product of their rows.
    """
    noise = np.maximum(bank.noise, MIN_NOISE)

    def plain(ink: np.ndarray, width: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [INK_COST * ink / noise, WIDTH_COST * np.log(width[:, None] + 1.0)], axis=1
        )

    ends = np.clip(rows.ends[node], MIN_END, END)
    weight = 1.0 / np.square(END_ERROR + END_ERROR_SLOPE * np.maximum(ends, 0.0))
    mine = plain(predicted[node], rows.width[node])
    constant = np.square(mine).sum(axis=1, keepdims=True)
    constant = constant + (weight * ends * ends).sum(axis=1, keepdims=True)
    target = [constant, np.ones((len(node), 1)), -2.0 * mine, weight, -2.0 * weight * ends]

    theirs, at = plain(bank.predicted_ink, bank.width), np.clip(bank.ends, MIN_END, END)
    occlusion = bank.occlusion[:, None]
    constant = (
        np.square(theirs).sum(axis=1, keepdims=True)
        + OCCLUSION_COST * occlusion
        + np.where(occlusion > MAX_OCCLUSION, FORBIDDEN, 0.0)
    )
    source = [np.ones((len(bank.width), 1)), constant, theirs, at * at, at]
    factors = np.concatenate(target, axis=1), np.concatenate(source, axis=1)
    return factors[0].astype(np.float32), factors[1].astype(np.float32)


def cheapest_sequence(
    appearance: np.ndarray,
    near: np.ndarray,
    first: np.ndarray,
    target: np.ndarray,
    source: np.ndarray,
    follows: np.ndarray,
) -> np.ndarray:
    """Choose a source row (K,) for every node by dynamic programming (Viterbi).

    A node may take one of its own W candidates, or one of the W cheapest rows that follow what the
    node before may take. The cost of a sequence is that of laying its rows, and of its joints:
    none where a row follows the one before; otherwise JUMP_COST, what is seen of it, and
    STRIP_OVER_COST where the strip of the one before ends there.

    Parameters
    ----------
    appearance : (T, D)
    near : (K, W), candidates of each node
    first : (C+1,), the nodes of stroke i are first[i]:first[i+1]
    target, source : (K, E), (T, E), of `cost_factors`
    follows : (T,), the row that follows each, -1 where none does
    """
    count = np.diff(first)
    order = np.argsort(-count, kind="stable")  # all strokes in step, the longest first
    head = first[order]
    lattice = _Lattice(appearance, near, target, source, follows)
    layers = [lattice.begin(head)]
    for k in range(1, int(count.max(initial=0))):
        live = int((count > k).sum())
        layers.append(lattice.extend(layers[-1], head[:live] + k))
    chosen = np.empty(first[-1], np.int64)
    at = np.zeros(len(count), np.int64)
    for k, layer in reversed(list(enumerate(layers))):
        live = len(layer.rows)
        ends = np.flatnonzero(count[order[:live]] == k + 1)
        at[ends] = layer.total[ends].argmin(axis=1)
        stroke = np.arange(live)
        chosen[head[:live] + k] = layer.rows[stroke, at[:live]]
        if layer.back is not None:
            at[:live] = layer.back[stroke, at[:live]]
    return chosen


@dataclass(frozen=True)
class _Layer:
    """What the k-th nodes of B strokes may take.

    Parameters
    ----------
    rows : (B, W'), source rows
    total : (B, W'), the cost of the cheapest sequence that ends with each
    back : (B, W'), which of the layer before that sequence comes from; None in the first
    """

    rows: np.ndarray
    total: np.ndarray
    back: np.ndarray | None


@dataclass(frozen=True)
class _Lattice:
    """What `cheapest_sequence` searches; fields are its arguments."""

    appearance: np.ndarray
    near: np.ndarray
    target: np.ndarray
    source: np.ndarray
    follows: np.ndarray

    @functools.cached_property
    def _laid_near(self) -> np.ndarray:
        """The cost (K, W) of laying the candidates of each node on it."""
        return self._laid(self.near, np.arange(len(self.near)))

    @functools.cached_property
    def _size(self) -> np.ndarray:
        """The squared norm (T,) of the appearance of each source row."""
        return np.square(self.appearance).sum(axis=1)

    def _laid(self, rows: np.ndarray, node: np.ndarray) -> np.ndarray:
        """The cost (B, W) of laying source rows (B, W) on nodes (B,)."""
        return np.einsum("bwd,bd->bw", self.source[rows], self.target[node])

    def begin(self, node: np.ndarray) -> _Layer:
        """The layer of the strokes' first nodes (B,)."""
        return _Layer(self.near[node], self._laid_near[node].astype(np.float64), None)

    def extend(self, before: _Layer, node: np.ndarray) -> _Layer:
        """The layer of the next nodes (B,); strokes beyond these are over."""
        last, total = before.rows[: len(node)], before.total[: len(node)]
        following = self.follows[last]
        onward, laid = self._cheapest_following(following, total, node)
        rows = np.concatenate([self.near[node], onward], axis=1)
        reach = self._joint_costs(last, following, rows) + total[:, :, None]
        back = reach.argmin(axis=1)
        reached = np.take_along_axis(reach, back[:, None], axis=1)[:, 0]
        reached += np.concatenate([self._laid_near[node], laid], axis=1)
        return _Layer(rows, reached, back)

    def _cheapest_following(
        self, following: np.ndarray, total: np.ndarray, node: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The W rows (B, W) that are reached most cheaply by going on; candidates for want.

        Then the cost (B, W) of laying them.
        """
        few = self.near.shape[1]
        laid = self._laid(following, node)
        cost = np.where(following < 0, np.inf, laid + total)
        best = np.argpartition(cost, few - 1, axis=1)[:, :few]
        rows = np.take_along_axis(following, best, axis=1)
        over = rows < 0
        rows = np.where(over, self.near[node], rows)
        return rows, np.where(over, self._laid_near[node], np.take_along_axis(laid, best, axis=1))

    def _joint_costs(self, last: np.ndarray, following: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """The cost (B, V, W) of a joint between each of `last` (B, V) and each of `rows` (B, W)."""
        over = following < 0
        x = np.where(over, last, following)
        seen = self.appearance[x] @ self.appearance[rows].swapaxes(1, 2)
        seen *= -2.0
        seen += self._size[x][:, :, None] + self._size[rows][:, None]
        cost = np.maximum(seen, 0.0, out=seen)
        cost *= SEEN_COST
        cost += (JUMP_COST + STRIP_OVER_COST * over)[:, :, None]
        cost[following[:, :, None] == rows[:, None]] = 0.0
        return cost


# --------------------------------------------------------------------------------------- copying


@dataclass(frozen=True)
class LaidRows:
    """Strips for new strokes.

    Parameters
    ----------
    layer : (R, A, 4) float32 in [0, 1], premultiplied; or (R, A, 1), their opacity alone
    ink : (R, 4), the local ink that they have
    """

    layer: np.ndarray
    ink: np.ndarray


def lay_runs(bank: TextureBank, rows: Rows, runs: Runs, predicted: np.ndarray) -> np.ndarray:
    """Copy the chosen runs into strips (R, A, 4) uint8 for new strokes, and hide their joints."""
    columns = bank_columns(rows, bank.margin)
    every = np.arange(len(rows.closed))
    return texels(lay_rows(bank, rows, runs, predicted, columns, every).layer)


def lay_rows(
    bank: TextureBank,
    rows: Rows,
    runs: Runs,
    predicted: np.ndarray,
    columns: int,
    whole: np.ndarray,
    opacity: bool = False,
) -> LaidRows:
    """Copy the chosen runs into strips as `lay_runs` does, and tell their ink.

    Parameters
    ----------
    columns : texels across
    whole : (C,) int, which stroke each strip is of: strips may be pieces of one
    opacity : lay nothing else, for media of one ink
    """
    stroke = owner(rows.offsets)
    every = np.arange(len(stroke))
    node = runs.first[stroke] + (every - rows.offsets[stroke]) // STEP
    copied = runs.source(np.minimum(node, runs.first[stroke + 1] - 1), every)
    # The ink is what the features ask for here, and beyond that what the source had, carried
    # smoothly over the joints.
    beside = _ink_residual(bank, copied, whole[stroke])
    beside = smooth_rows(beside, rows.offsets, INK_SIGMA * ROWS)
    wanted = predicted + beside

    def copy(source: np.ndarray, row: np.ndarray) -> np.ndarray:
        laid = resampled(bank, source, rows.width[row], columns, opacity)
        return with_ink(laid, bank.local_ink[source], wanted[row])

    starts = range(0, len(every), CHUNK)
    layer = np.concatenate(
        each(lambda a: copy(copied[a : a + CHUNK], every[a : a + CHUNK]), starts)
    )
    for joints in _joints(rows, runs):
        _join(layer, copy, rows, runs, joints)
    past = np.flatnonzero((rows.ends < 0).any(axis=1))
    beyond = replace(rows, ends=rows.ends[past], width=rows.width[past])
    layer[past] *= caps(beyond, bank.ends[copied[past]], bank.margin, columns)
    return LaidRows(layer, wanted)


def texels(layer: np.ndarray) -> np.ndarray:
    """Premultiplied colours (..., 4) in [0, 1] as straight ones, uint8."""
    return np.rint(np.clip(straight(layer, least=1e-4), 0, 1) * 255).astype(np.uint8)


def _ink_residual(bank: TextureBank, copied: np.ndarray, stroke: np.ndarray) -> np.ndarray:
    """What local ink (R, 4) new rows have beside the prediction, if they copy the rows `copied`.

    What sets a whole stroke apart, its pressure or its colour, is one for all of a new stroke:
    that of the strip which most of it is copied from. `stroke` (R,) is that of the new rows.
    """
    strips, home = len(bank.offsets) - 1, owner(bank.offsets)
    trust = 1.001 - bank.occlusion
    beside = bank.local_ink - bank.predicted_ink
    total = np.bincount(home, trust, minlength=strips)
    sums = [np.bincount(home, trust * column, minlength=strips) for column in beside.T]
    of_strip = np.stack(sums, axis=1) / total[:, None]
    used = np.bincount(stroke * strips + home[copied], minlength=(stroke.max() + 1) * strips)
    most = used.reshape(-1, strips).argmax(axis=1)
    return beside[copied] - of_strip[home[copied]] + of_strip[most][stroke]


@dataclass(frozen=True)
class _Joints:
    """Joints that do not touch each other: where the run of one node gives way to another's.

    Parameters
    ----------
    before, after : (J,) nodes
    wrap : (J,), rows by which the way from `before` to `after` goes round a closed stroke
    """

    before: np.ndarray
    after: np.ndarray
    wrap: np.ndarray


def _joints(rows: Rows, runs: Runs) -> Iterator[_Joints]:
    """Every other joint of each stroke, the rest of them, and where closed strokes close."""
    count = np.diff(runs.first)
    stroke = owner(runs.first)
    after = np.setdiff1d(np.arange(runs.first[-1]), runs.first[:-1])
    changes = runs.shift[after] != runs.shift[after - 1]
    after = after[changes | (runs.low[after] != runs.low[after - 1])]
    ordinal = np.arange(len(after)) - np.searchsorted(after, runs.first[stroke[after]])
    for parity in (0, 1):
        group = after[ordinal % 2 == parity]
        yield _Joints(group - 1, group, np.zeros(len(group), np.int64))
    loop = np.flatnonzero(rows.closed & (count > 1))
    yield _Joints(runs.first[loop + 1] - 1, runs.first[loop], np.diff(rows.offsets)[loop])


def _join(
    layer: np.ndarray,
    copy: Callable[[np.ndarray, np.ndarray], np.ndarray],
    rows: Rows,
    runs: Runs,
    joints: _Joints,
) -> None:
    """Join runs in `layer` (R, A, 4) along least-error cuts, HALF_CUT px to either side of a joint.

    `copy` (source rows, new rows) gives what these rows look like there.
    """
    before, after = joints.before, joints.after
    if not len(after):
        return
    reach = HALF_CUT * ROWS
    stroke = owner(runs.first)[after]
    low, high = rows.offsets[stroke][:, None], rows.offsets[stroke + 1][:, None]
    closed = rows.closed[stroke][:, None]
    at = runs.begin[after][:, None] + np.arange(-reach, reach)
    row = np.where(closed, low + (at - low) % (high - low), np.clip(at, low, high - 1))
    past = np.arange(2 * reach) >= reach
    patch = (-1, reach, *layer.shape[1:])
    old, new = layer[row], layer[row]
    going_on = runs.source(before[:, None], (at + joints.wrap[:, None])[:, past])
    coming = runs.source(after[:, None], at[:, ~past])
    old[:, past] = copy(going_on.ravel(), row[:, past].ravel()).reshape(patch)
    new[:, ~past] = copy(coming.ravel(), row[:, ~past].ravel()).reshape(patch)
    joined = cut_together(old, new)
    within = (at >= low) & (at < high) | closed
    layer[row[within]] = joined[within]


def cut_together(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Patches (S, n, A, 4) that begin as `old` and end as `new`, along their least-error cuts."""
    error = np.square(old - new).sum(axis=3)
    longer = np.pad(error.astype(np.float64), ((0, 0), (1, 1), (0, 0)), mode="edge")
    smooth = (longer[:, :-2] + longer[:, 1:-1] + longer[:, 2:]) / 3.0
    cut = least_error_cut(smooth.astype(np.float32) + 1e-4)
    rows = np.arange(old.shape[1])[:, None]
    weight = np.clip((rows - cut[:, None]) / FEATHER + 0.5, 0.0, 1.0)[..., None].astype(np.float32)
    return old * (1 - weight) + new * weight


def least_error_cut(error: np.ndarray) -> np.ndarray:
    """The row (S, A) at which a cut crosses each column of `error` (S, n, A), with least in sum.

    From column to column it moves by one row at most.
    """
    count, n, columns = error.shape
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
    return cut


def caps(rows: Rows, source_ends: np.ndarray, margin: float, columns: int) -> np.ndarray:
    """Round off rows past an end that were copied from the body of a stroke: (R, columns, 1).

    In [0, 1], to be multiplied with. A row copied from as far past an end has its own rounding.

    Parameters
    ----------
    source_ends : (R, 2), px from the ends of the strips that the rows were copied from
    """
    past = np.maximum(0.0, -rows.ends)
    # as far past as the source was not
    body = past * np.clip((source_ends - rows.ends - 1.0) / 2.0, 0.0, 1.0)
    body = body.max(axis=1)[:, None]
    half = 0.5 * rows.width[:, None]
    aside = across(columns)[None] * (0.5 * rows.width + margin)[:, None]
    inside = np.clip(half + 0.5 - np.hypot(aside, body), 0.0, 1.0)
    return np.where(body > 0, inside, 1.0)[..., None].astype(np.float32)


def with_ink(patch: np.ndarray, ink: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Move the local ink of premultiplied rows (n, A, 4) from `ink` (n, 4) to `wanted` (n, 4).

    Of rows (n, A, 1) there is but the opacity to be moved.
    """
    gain = np.clip((wanted[:, 0] + 0.1) / (ink[:, 0] + 0.1), 0.5, 2.0)
    if patch.shape[2] == 1:
        return np.minimum(patch * gain.astype(np.float32)[:, None, None], 1.0)
    alpha = np.minimum(patch[..., 3] * gain[:, None], 1.0)
    change = (wanted[:, 1:] - ink[:, 1:])[:, None]
    color = patch[..., :3] / np.maximum(patch[..., 3:], 1e-4) + change
    return np.concatenate(
        [np.clip(color, 0, 1) * alpha[..., None], alpha[..., None]], axis=-1
    ).astype(np.float32)


def resampled(
    bank: TextureBank,
    source: np.ndarray,
    width: np.ndarray,
    columns: int,
    opacity: bool = False,
) -> np.ndarray:
    """Stretch rows of the bank from their own width to another: (n, columns, 4) float32.

    Or (n, columns, 1), their `opacity` alone.

    The core is stretched; beyond the edge distances stay what they are, so that a soft edge keeps
    its softness. Colours are premultiplied.

    Parameters
    ----------
    source : (n,), rows of the bank
    width : (n,) px, without margins
    """
    if opacity:
        strip = bank.rgba[..., 3:][source].astype(np.float32) / 255.0
    else:
        strip = bank.rgba[source].astype(np.float32) / 255.0
        strip[..., :3] *= strip[..., 3:]
    return stretched(strip, bank.width[source], width, bank.margin, columns)


def stretched(
    strip: np.ndarray, own: np.ndarray, width: np.ndarray, margin: float, columns: int
) -> np.ndarray:
    """Stretch rows (n, A, K), premultiplied, from their `own` width (n,) px to another (n,).

    It computes in the precision of `width`.

    Parameters
    ----------
    margin : px beyond half the width that rows reach before and after
    """
    texels, margin, kind = strip.shape[1], float(margin), width.dtype
    v = across(columns)[None].astype(kind)
    half, own = 0.5 * width[:, None], 0.5 * own[:, None].astype(kind)
    distance = np.abs(v) * (half + margin)
    core = distance * (own / np.maximum(half, 1e-6))
    place = np.sign(v) * np.where(distance < half, core, own + distance - half)
    column = np.clip((place / (own + margin) + 1.0) * 0.5 * texels - 0.5, 0, texels - 1)
    left = np.minimum(column.astype(np.int64), texels - 2)
    mix = (column - left)[..., None].astype(np.float32)
    at = left + np.arange(len(strip))[:, None] * texels
    flat = strip.reshape(-1, strip.shape[2])
    return flat.take(at, axis=0) * (1 - mix) + flat.take(at + 1, axis=0) * mix
