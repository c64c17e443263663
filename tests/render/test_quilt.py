"""Quilting against brute force: the cheapest sequence, the cut of least error; and rows by rule."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from strokestyle.render.quilt import (
    FEATHER,
    JUMP_COST,
    SEEN_COST,
    STEP,
    STRIP_OVER_COST,
    Runs,
    caps,
    cheapest_sequence,
    choose_runs,
    cost_factors,
    cut_together,
    lay_runs,
    least_error_cut,
    resampled,
)
from strokestyle.render.texture_bank import END, Rows, TextureBank, solid_ink, stroke_ink

INK = np.array([0.8, 0.3, 0.2, 0.1])  # opacity, colour


def a_bank(lengths=(64, 48), columns=24, width=10.0, margin=2.0, ink=None):
    """Strips of even ink, far from both ends, whose rows all look different."""
    total = sum(lengths)
    ink = np.tile(INK, (total, 1)) if ink is None else np.asarray(ink, float)
    rgba = np.zeros((total, columns, 4))
    rgba[...] = ink[:, None, [1, 2, 3, 0]]
    return TextureBank(
        rgba=np.rint(255 * rgba).astype(np.uint8),
        offsets=np.r_[0, np.cumsum(lengths)],
        width=np.full(total, width, np.float32),
        ends=np.full((total, 2), END, np.float32),
        occlusion=np.zeros(total, np.float32),
        appearance=np.random.default_rng(0).normal(size=(total, 3)).astype(np.float32),
        local_ink=ink.astype(np.float32),
        predicted_ink=ink.astype(np.float32),
        weights=np.zeros((9, 4), np.float32),
        scale=np.ones((2, 4), np.float32),
        noise=np.full(4, 0.1, np.float32),
        margin=margin,
        flat=False,
    )


def some_rows(*lengths, width=10.0, closed=False):
    total = sum(lengths)
    return Rows(
        offsets=np.r_[0, np.cumsum(lengths)],
        width=np.full(total, width),
        thickness=np.full(total, width),
        ends=np.full((total, 2), END),
        features=np.zeros((total, 0)),
        turned=np.zeros(len(lengths), bool),
        closed=np.full(len(lengths), closed),
    )


# ------------------------------------------------------------------------------------ what it costs


def test_the_factors_multiply_to_the_cost_that_is_written_down():
    rng = np.random.default_rng(1)
    bank, rows = a_bank(), some_rows(40)
    bank = replace(
        bank,
        width=rng.uniform(2, 20, 112).astype(np.float32),
        ends=rng.uniform(-12, 50, (112, 2)).astype(np.float32),
        occlusion=rng.uniform(0, 0.6, 112).astype(np.float32),
        predicted_ink=rng.random((112, 4)).astype(np.float32),
        noise=np.array([0.01, 0.2, 0.01, 0.1], np.float32),
    )
    rows = replace(rows, width=rng.uniform(2, 20, 40), ends=rng.uniform(-12, 50, (40, 2)))
    predicted, node = rng.random((40, 4)), np.array([0, 7, 39])
    target, source = cost_factors(bank, rows, predicted, node)
    noise = np.array([0.03, 0.2, 0.02, 0.1])  # that of opacity is 0.03 at least, of colour 0.02
    ink = np.square(0.7 * (predicted[node][:, None] - bank.predicted_ink) / noise).sum(axis=2)
    width = np.square(5.8 * (np.log(rows.width[node] + 1)[:, None] - np.log(bank.width + 1)))
    mine, theirs = np.clip(rows.ends[node], -8, 40)[:, None], np.clip(bank.ends, -8, 40)
    ends = np.square((mine - theirs) / (4 + 0.25 * np.maximum(mine, 0))).sum(axis=2)
    hidden = 12 * bank.occlusion + 100 * (bank.occlusion > 0.4)
    assert target @ source.T == pytest.approx(ink + width + ends + hidden, rel=1e-3, abs=0.05)


# -------------------------------------------------------------------------------- cheapest sequence


def sequence_cost(rows, first_node, appearance, target, source, follows):
    """The cost of laying source rows on successive nodes."""
    total = sum(float(source[r] @ target[first_node + k]) for k, r in enumerate(rows))
    for a, b in itertools.pairwise(rows):
        if follows[a] != b:
            seen = np.square(appearance[a if follows[a] < 0 else follows[a]] - appearance[b]).sum()
            total += JUMP_COST + SEEN_COST * seen + STRIP_OVER_COST * (follows[a] < 0)
    return total


@pytest.mark.parametrize("seed", range(12))
def test_the_cheapest_sequence_is_that_of_brute_force(seed):
    """Strokes of 3, 1 and 2 nodes, 4 candidates each, among 12 sources in strips of two rows."""
    rng = np.random.default_rng(seed)
    first, sources, few = np.array([0, 3, 4, 6]), 12, 4
    near = np.stack([rng.permutation(sources)[:few] for _ in range(6)])
    appearance = 0.15 * rng.normal(size=(sources, 3))
    source, target = rng.uniform(0, 3, (sources, 2)), rng.uniform(0, 1, (6, 2))
    follows = np.where(np.arange(sources) % 2 == 0, np.arange(sources) + 1, -1)
    got = cheapest_sequence(appearance, near, first, target, source, follows)
    for a, b in itertools.pairwise(first):
        options = [list(near[a])]
        for node in range(a + 1, b):
            ahead = [follows[r] for r in options[-1] if follows[r] >= 0]
            options.append(list(dict.fromkeys([*near[node], *ahead])))
        costs = {
            rows: sequence_cost(rows, a, appearance, target, source, follows)
            for rows in itertools.product(*options)
        }
        best = min(costs.values())
        assert costs[tuple(got[a:b])] == pytest.approx(best, rel=1e-9)
    assert len(got) == 6


def test_of_many_rows_that_follow_the_cheapest_are_kept():
    """One candidate a node: at the third, one of two rows that follow, and it is the free one."""
    source = np.array([[0.0], [0.0], [0.0], [9.0], [9.0], [9.0]])
    near, follows = np.array([[0], [3], [3]]), np.array([1, 2, -1, 4, 5, -1])
    got = cheapest_sequence(
        np.arange(6.0)[:, None], near, np.array([0, 3]), np.ones((3, 1)), source, follows
    )
    assert got.tolist() == [0, 1, 2]


def test_going_on_is_free_and_the_last_node_has_its_say():
    source = np.array([[0.0], [0.0], [0.0], [5.0]])
    near = np.array([[0, 2], [2, 3]])
    follows = np.array([1, -1, -1, -1])
    appearance = np.arange(4.0)[:, None]
    for last, wanted in ((0.0, [0, 1]), (1.0, [0, 1])):
        target = np.array([[1.0], [last]])
        got = cheapest_sequence(appearance, near, np.array([0, 2]), target, source, follows)
        assert got.tolist() == wanted
    source[1] = 1e4  # what follows is dear: jump, from where it is seen least
    got = cheapest_sequence(appearance, near, np.array([0, 2]), np.ones((2, 1)), source, follows)
    assert got[1] == 2


# --------------------------------------------------------------------------------------- which rows


def test_sources_are_chosen_by_ink_and_an_excluded_strip_is_not():
    ink = np.repeat([[0.9, 0.1, 0.1, 0.1], [0.9, 0.9, 0.1, 0.1], [0.9, 0.9, 0.9, 0.9]], 48, axis=0)
    bank, rows = a_bank((48, 48, 48), ink=ink), some_rows(40, 20)
    predicted = np.repeat(ink[[0, 100]], [40, 20], axis=0)
    runs = choose_runs(bank, rows, predicted, np.random.default_rng(0))
    assert runs.first.tolist() == [0, 5, 8] and STEP == 8
    assert runs.begin.tolist() == [0, 8, 16, 24, 32, 40, 48, 56]
    assert runs.low.tolist() == [0] * 5 + [96] * 3 and runs.high.tolist() == [47] * 5 + [143] * 3
    middle = np.minimum(runs.begin + STEP // 2, [39] * 5 + [59] * 3)
    source = runs.source(np.arange(8), middle)
    assert (source >= runs.low).all() and (source <= runs.high).all()
    excluded = np.array([[True, False, False], [False, False, True]])
    barred = choose_runs(bank, rows, predicted, np.random.default_rng(0), excluded)
    assert barred.low.tolist() == [48] * 8


def test_rows_that_are_those_of_a_strip_are_copied_in_one_run():
    """Ink that differs from row to row says where in the strip each node lies."""
    ink = np.tile(INK, (80, 1))
    ink[:, 1:] = np.linspace(0.1, 0.9, 80)[:, None]
    bank = replace(a_bank((80,), ink=ink), noise=np.zeros(4, np.float32))
    rows = some_rows(80)
    runs = choose_runs(bank, rows, ink, np.random.default_rng(0))
    assert not runs.shift.any() and runs.begin.tolist() == list(range(0, 80, 8))
    strips = lay_runs(bank, rows, runs, ink)
    assert np.abs(strips[:, 12, 0] / 255 - ink[:, 1]).max() < 0.02


def test_a_run_does_not_leave_its_strip():
    runs = Runs(*np.array([[0, 2], [0, 8], [5, -3], [5, 0], [20, 9]]))
    got = runs.source(np.array([0, 0, 0, 1, 1]), np.array([0, 10, 40, 1, 40]))
    assert got.tolist() == [5, 15, 20, 0, 9]


# ------------------------------------------------------------------------------------------ the cut


@pytest.mark.parametrize("seed", range(6))
def test_the_cut_of_least_error_is_that_of_brute_force(seed):
    error = np.random.default_rng(seed).random((2, 5, 4))
    cut = least_error_cut(error)
    paths = [
        path
        for path in itertools.product(range(5), repeat=4)
        if all(abs(a - b) <= 1 for a, b in itertools.pairwise(path))
    ]
    for patch, found in zip(error, cut, strict=True):
        costs = {path: sum(patch[row, c] for c, row in enumerate(path)) for path in paths}
        assert costs[tuple(found)] == pytest.approx(min(costs.values()))


def test_patches_begin_as_one_and_end_as_the_other():
    """They agree in rows 8 to 11 only: there they are cut."""
    old, new = np.zeros((1, 20, 6, 4)), np.ones((1, 20, 6, 4))
    new[:, 8:12] = old[:, 8:12] = 0.5
    got = cut_together(old, new)
    assert not got[:, :8].any() and (got[:, 12:] == 1).all()
    assert got[:, 8:12] == pytest.approx(np.full((1, 4, 6, 4), 0.5))


def test_patches_are_faded_over_a_few_rows_about_the_cut():
    """The cut minds the error of three rows; the fade is 1/6, 1/2, 5/6 of the other patch."""
    rng = np.random.default_rng(0)
    old, new = rng.random((3, 16, 5, 4)), 2 + rng.random((3, 16, 5, 4))
    weight = ((cut_together(old, new) - old) / (new - old))[..., 0]
    error = np.square(old - new).sum(axis=3)
    padded = np.concatenate([error[:, :1], error, error[:, -1:]], axis=1)
    cut = least_error_cut((padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]) / 3)
    rows = np.arange(16)[:, None]
    wanted = np.select([rows < cut[:, None] - 1, rows > cut[:, None] + 1], [0.0, 1.0], 0.5)
    wanted[rows == cut[:, None] - 1], wanted[rows == cut[:, None] + 1] = 1 / 6, 5 / 6
    assert FEATHER == 3 and weight == pytest.approx(wanted, abs=1e-6)


# --------------------------------------------------------------------------------------- one row


def ramp_bank():
    """Opacity 0.5 + 0.5 v across a strip of 24 texels, 10 px wide with margins of 2 px."""
    bank = a_bank((4,))
    rgba = bank.rgba.copy()
    v = (2 * np.arange(24) + 1.0) / 24 - 1
    rgba[..., 3] = np.rint(255 * (0.5 + 0.5 * v))
    return replace(bank, rgba=rgba)


def test_a_row_of_the_same_width_is_copied_texel_by_texel():
    bank = ramp_bank()
    got = resampled(bank, np.array([1, 3]), np.array([10.0, 10.0]), 24)
    straight = bank.rgba[[1, 3]] / 255.0
    straight[..., :3] *= straight[..., 3:]
    assert got == pytest.approx(straight, abs=1e-6)


@pytest.mark.parametrize("width, columns", [(20.0, 60), (10.0, 37), (4.0, 24)])
def test_the_core_is_stretched_and_the_margin_is_not(width, columns):
    got = resampled(ramp_bank(), np.array([2]), np.array([width]), columns)[0, :, 3]
    distance = ((2 * np.arange(columns) + 1.0) / columns - 1) * (0.5 * width + 2.0)
    core = np.abs(distance) < 0.5 * width
    own = np.where(
        core,
        distance * 10.0 / width,
        np.sign(distance) * (np.abs(distance) - 0.5 * width + 5.0),
    )
    wanted = 0.5 + 0.5 * np.clip(own / 7.0, -23 / 24, 23 / 24)
    assert got == pytest.approx(wanted, abs=1 / 255)


def test_rows_past_an_end_that_come_from_a_body_are_rounded_off():
    rows = some_rows(4, width=10.0)
    rows = replace(rows, ends=np.array([[3.0, 40], [-3.0, 40], [40, -4.0], [-3.0, 40]]))
    source = np.array([[40.0, 40], [40, 40], [40, 40], [-3.0, 40]])
    got = caps(rows, source, 2.0, 28)[..., 0]
    aside = np.abs((2 * np.arange(28) + 1.0) / 28 - 1) * 7.0
    assert (got[0] == 1).all() and (got[3] == 1).all()  # a body's row, and an end's own cap
    assert got[1] == pytest.approx(np.clip(5.5 - np.hypot(aside, 3.0), 0, 1), abs=1e-6)
    assert got[2] == pytest.approx(np.clip(5.5 - np.hypot(aside, 4.0), 0, 1), abs=1e-6)


def test_a_new_row_gets_the_ink_it_is_asked_for():
    """Twice the opacity at most, half of it at least, and any colour."""
    bank, rows = a_bank((64,)), some_rows(32)
    runs = choose_runs(bank, rows, np.tile(INK, (32, 1)), np.random.default_rng(0))
    for opacity, color in ((0.8, 0.3), (0.4, 0.7)):
        wanted = np.tile([opacity, color, 0.2, 0.1], (32, 1))
        got = lay_runs(bank, rows, runs, wanted)[:, 12] / 255
        gain = (opacity + 0.1) / 0.9
        assert got[:, 3] == pytest.approx(np.full(32, 0.8 * gain), abs=0.01)
        assert got[:, :3] == pytest.approx(np.tile([color, 0.2, 0.1], (32, 1)), abs=0.01)


def test_a_strokes_own_ink_comes_along_with_its_strip():
    """What the source strip as a whole has beside its prediction: 0.2 of red."""
    ink = np.tile(INK, (64, 1))
    bank = replace(a_bank((64,), ink=ink), predicted_ink=(ink - [0, 0.2, 0, 0]).astype(np.float32))
    rows, asked = some_rows(32), np.tile([0.8, 0.5, 0.2, 0.1], (32, 1))
    runs = choose_runs(bank, rows, asked, np.random.default_rng(0))
    got = lay_runs(bank, rows, runs, asked)[:, 12] / 255
    assert got[:, 0] == pytest.approx(np.full(32, 0.7), abs=0.01)


# ----------------------------------------------------------------------------------------- flat ink


def test_solid_ink_has_the_opacity_of_the_middle_of_unhidden_rows():
    bank = a_bank((40,))
    rgba = bank.rgba.copy()
    middle = 7 * np.abs((2 * np.arange(24) + 1.0) / 24 - 1) < 2.5  # a quarter of 10 px, both sides
    rgba[..., 3] = np.where(middle, 100 + 5 * np.arange(40)[:, None], 10)
    occlusion = np.r_[np.zeros(20), np.full(20, 0.2)].astype(np.float32)
    got = solid_ink(np.tile(INK, (5, 1)), replace(bank, rgba=rgba, occlusion=occlusion))
    shown = np.repeat(100 + 5 * np.arange(20), middle.sum())
    opacity = np.quantile(shown, 0.75) / 255
    assert got == pytest.approx(np.tile(np.r_[opacity, INK[1:]], (5, 1)))
    hidden = solid_ink(np.tile(INK, (2, 1)), replace(bank, occlusion=np.ones(40, np.float32)))
    assert hidden[:, 0].tolist() == [1, 1]  # nothing is known


def test_a_strokes_ink_is_the_mean_of_its_rows_by_width():
    rows = replace(some_rows(2, 1), width=np.array([0.9, 2.9, 5.0]))
    ink = np.array([[0.2, 0.0, 0.5, 1.0], [0.6, 0.4, 0.5, 0.0], [0.5, 0.1, 0.2, 1.7]])
    got = stroke_ink(rows, ink)
    assert got == pytest.approx(np.array([[0.3, 0.5, 0.25, 0.5], [0.1, 0.2, 1.0, 0.5]]))
