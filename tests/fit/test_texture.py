"""Learning a texture, stage by stage, on strips whose ink is known."""

from dataclasses import replace

import numpy as np
import pytest
from small_drawings import strokes_of

from strokestyle.drawing.strokes import Strokes
from strokestyle.fit.exemplar import Exemplar
from strokestyle.fit.own_ink import MIN_MARGIN, InkOwners, nearest_strokes
from strokestyle.fit.texture import (
    cut_strips,
    end_at_gaps,
    fill_occluded,
    learn_texture,
    regress_ink,
)
from strokestyle.render.texture_bank import ROWS, Rows, stroke_rows

WIDTH, HEIGHT = 200, 100


def exemplar_of(alpha, ink=None):
    ink = np.zeros((HEIGHT, WIDTH, 3)) if ink is None else ink
    rgb = alpha[..., None] * ink + 1 - alpha[..., None]
    return Exemplar(rgb, alpha, ink, alpha > 0.5, np.ones(3))


def owners_of(strokes, mask=None):
    """Whose ink is whose, where strokes are all that was drawn if no mask says otherwise."""
    near = nearest_strokes(strokes, (WIDTH, HEIGHT))
    return InkOwners.of(near, np.clip(0.5 - near.distance, 0, 1) if mask is None else mask)


def features_of(strokes):
    return np.zeros((len(strokes.xy), 1))


# ---------------------------------------------------------------------------------------- strips


def test_strips_hold_the_ink_along_and_across_a_stroke():
    one = strokes_of([[20, 50], [180, 50]])
    rows = stroke_rows(one, features_of(one), 2.0)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    alpha = np.clip(0.2 + 0.004 * x, 0, 1)  # stronger to the right
    ink = np.stack([np.clip((y - 40) / 20, 0, 1), 0 * x, 0 * x], axis=2)  # redder below
    near = owners_of(one)
    strips, free = cut_strips(one, rows, exemplar_of(alpha, ink), near, 2.0)
    assert free.all() and (strips[..., :3] <= strips[..., 3:]).all()
    middle = strips.shape[1] // 2
    along = 20 + rows.ends[:, 0]
    inner = (rows.ends.min(axis=1) > 0) & (rows.ends[:, 0] < 39)
    assert strips[inner, middle, 3] == pytest.approx(0.2 + 0.004 * along[inner], abs=0.01)
    red = strips[..., 0] / strips[..., 3]
    assert red[len(red) // 2, 0] < 0.3 < 0.7 < red[len(red) // 2, -1]


def test_a_stroke_against_the_pull_is_cut_from_its_other_end():
    lines = [[20, 50], [180, 50]]
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    drawing = exemplar_of(np.clip(0.2 + 0.004 * x, 0, 1), np.dstack([y / HEIGHT, 0 * x, 0 * x]))
    made = []
    for line in (lines, lines[::-1]):
        one = strokes_of(line, thickness=7.5)
        rows = stroke_rows(one, features_of(one), 2.0)
        near = owners_of(one)
        made.append(cut_strips(one, rows, drawing, near, 2.0)[0])
    assert made[0] == pytest.approx(made[1], abs=1e-3)


def test_texels_that_another_stroke_may_hide_are_not_free():
    cross = strokes_of([[20, 50], [180, 50]], [[100, 10], [100, 90]])
    rows = stroke_rows(cross, features_of(cross), 2.0)
    near = owners_of(cross)
    alpha = np.where(near.nearest.distance < 0, 1.0, 0.0)
    _, free = cut_strips(cross, rows, exemplar_of(alpha), near, 2.0)
    level = free[: rows.offsets[1]]
    n, columns = level.shape
    share = np.arange(n) / n
    crossed = np.abs(share - 0.5) * (n / ROWS) < 4
    away = np.abs(share - 0.5) * (n / ROWS) > 9
    middle = level[:, columns // 2]
    assert crossed.any() and not middle[crossed].any() and level[away].all()


def test_in_the_margin_another_stroke_must_be_farther_away():
    """5 px lie between two strokes; a margin of 4 px ends 1 px from the other one."""
    two = strokes_of([[20, 40], [180, 40]], [[20, 53], [180, 53]])
    rows = stroke_rows(two, features_of(two), 4.0)
    near = owners_of(two)
    alpha = np.where(near.nearest.distance < 0, 1.0, 0.0)
    _, free = cut_strips(two, rows, exemplar_of(alpha), near, 4.0)
    middle = free[: rows.offsets[1]][rows.offsets[1] // 2]
    assert middle[0] and middle[len(middle) // 2] and not middle[-1]


def test_samples_are_ink_though_splines_overshoot():
    one = strokes_of([[20, 50], [180, 50]])
    rows = stroke_rows(one, features_of(one), 2.0)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    ink = np.dstack([y < 50, y > 50, 0 * x])  # red and green meet sharply
    near = owners_of(one)
    strips, _ = cut_strips(one, rows, exemplar_of(np.full((HEIGHT, WIDTH), 0.7), ink), near, 2.0)
    assert strips.min() >= 0 and (strips[..., :3] <= strips[..., 3:]).all()


def rows_of(n, start=40.0, end=40.0, width=8.0):
    ends = np.stack([np.full(n, start), np.full(n, end)], axis=1)
    return Rows(
        np.array([0, n]), np.full(n, width), np.full(n, width), ends, np.zeros((n, 1)),
        np.zeros(1, bool), np.zeros(1, bool),
    )  # fmt: skip


def test_what_is_hidden_is_filled_from_the_nearest_free_row_of_the_same_column():
    n, columns = 10, 4
    strips = np.arange(n * columns * 4, dtype=float).reshape(n, columns, 4)
    free = np.ones((n, columns), bool)
    free[3:7, 1] = False  # between rows 2 and 7
    free[:4, 2] = False  # from the beginning
    free[8:, 3] = False  # to the end
    out = fill_occluded(strips, free, rows_of(n), 2.0)
    source = np.tile(np.arange(n)[:, None], (1, columns))
    source[3:7, 1] = [2, 2, 7, 7]
    source[:4, 2] = 4
    source[8:, 3] = 7
    assert np.array_equal(out, strips[source, np.arange(columns)])
    # half-way between two of them, the one before
    free[:] = True
    free[4:7, 0] = False
    assert fill_occluded(strips, free, rows_of(n), 2.0)[5, 0, 0] == strips[3, 0, 0]


def test_a_column_with_nothing_free_stays_as_it_is():
    strips = np.random.default_rng(0).random((6, 3, 4))
    free = np.ones((6, 3), bool)
    free[:, 1] = False
    assert np.array_equal(fill_occluded(strips, free, rows_of(6), 2.0), strips)


def test_strips_are_filled_from_their_own_stroke():
    rows = replace(rows_of(8), offsets=np.array([0, 4, 8]))
    strips = np.arange(8.0)[:, None, None] * np.ones((8, 3, 4))
    free = np.ones((8, 3), bool)
    free[4:6] = False
    out = fill_occluded(strips, free, rows, 2.0)
    assert out[:, 0, 0].tolist() == [0, 1, 2, 3, 6, 6, 6, 7]


def test_past_an_end_what_is_filled_is_rounded_off():
    n, columns = 12, 9
    past = np.linspace(-7.0, 4.0, n)
    rows = replace(rows_of(n), ends=np.stack([past, np.full(n, 40.0)], axis=1))
    strips, free = np.ones((n, columns, 4)), np.ones((n, columns), bool)
    free[:8] = False
    out = fill_occluded(strips, free, rows, 2.0)[..., 3]
    assert out[past < -5.5].max() == 0  # beyond half the width, and one soft pixel
    assert out[past >= 0].min() == 1
    cap = (past < -1) & (past > -4)
    assert (out[cap, columns // 2] > out[cap, 1]).all() and out[cap, columns // 2].min() > 0.9


def test_past_an_end_ink_beyond_a_gap_is_not_the_strokes():
    n = 20
    ends = np.stack([np.arange(n) - 6.5, np.arange(n)[::-1] - 6.5], axis=1)
    rows = replace(rows_of(2 * n), offsets=np.array([0, n, 2 * n]), ends=np.tile(ends, (2, 1)))
    strips = np.ones((2 * n, 3, 4))
    strips[[3, 9, 10, n + 15]] = 0.0  # two gaps past an end, and one within a stroke
    out = end_at_gaps(strips, rows)[:, 0, 3]
    gone = np.flatnonzero(out == 0).tolist()
    assert gone == [0, 1, 2, 3, 9, 10, n + 15, n + 16, n + 17, n + 18, n + 19]


# -------------------------------------------------------------------------------------- regression

STROKES, LENGTH = 20, 40


def regression(noise, law, seed=0, strokes=STROKES):
    """Design of one feature, constant on each stroke, and ink that follows it by `law` (4,)."""
    rng = np.random.default_rng(seed)
    count = strokes * LENGTH * ROWS
    stroke = np.repeat(np.arange(strokes), LENGTH * ROWS)
    feature = rng.normal(size=strokes)[stroke]
    design = np.stack([np.ones(count), feature, feature**2 - 1], axis=1)
    luck = rng.normal(0, noise, (strokes, 4))[stroke]
    return design, 0.5 + np.asarray(law) * feature[:, None] + luck, stroke, np.ones(count)


def test_where_ink_follows_the_features_the_regression_does():
    law = [0.2, -0.1, 0.05, 0.3]
    weights, noise = regress_ink(*regression(0.01, law))
    assert weights[0] == pytest.approx(0.5, abs=0.02)
    assert weights[1] == pytest.approx(law, abs=0.02)
    assert np.abs(weights[2]).max() < 0.02 and noise.max() < 0.03
    exact, _ = regress_ink(*regression(0.0, law))
    assert exact[0] == pytest.approx(0.5, abs=0.003)  # there is no ridge on the constant


@pytest.mark.parametrize("seed", range(4))
def test_where_it_does_not_the_mean_is_predicted(seed):
    """The strokes' luck fits some slope, on these strokes; held-out strokes do not confirm it."""
    design, ink, stroke, weight = regression(0.1, [0, 0, 0, 0.4], seed, strokes=15)
    weights, noise = regress_ink(design, ink, stroke, weight)
    assert weights[1, 3] == pytest.approx(0.4, abs=0.12)
    free = np.linalg.lstsq(design, ink, rcond=None)[0]
    held = np.abs(weights[1:, :3]).sum()
    assert held <= 0.6 * np.abs(free[1:, :3]).sum()
    assert weights[0, :3][(weights[1:, :3] == 0).all(axis=0)] == pytest.approx(
        ink[:, :3].mean(axis=0)[(weights[1:, :3] == 0).all(axis=0)], abs=1e-6
    )
    assert 0.05 < noise[0] < 0.2


def test_mostly_no_signal_is_no_slope_at_all():
    none = [
        (regress_ink(*regression(0.1, [0, 0, 0, 0], seed))[0][1:] == 0).all(axis=0)
        for seed in range(20)
    ]
    assert np.mean(none) > 0.6


def test_the_noise_is_that_of_held_out_strokes():
    """Of 10 strokes with 6 columns, those that were fitted err less than those that were not."""
    rng = np.random.default_rng(1)
    stroke = np.repeat(np.arange(10), 20 * ROWS)
    columns = rng.normal(size=(10, 5))
    ink = (columns[:, :1] + rng.normal(0, 0.5, (10, 1))) * np.ones(4)
    design = np.concatenate([np.ones((10, 1)), columns], axis=1)[stroke]
    weights, noise = regress_ink(design, ink[stroke], stroke, np.ones(len(stroke)))
    assert weights[1, 0] > 0.3  # there is a signal
    fitted = (design @ weights - ink[stroke]).std()
    assert noise[0] > 1.15 * fitted


def test_rows_count_by_their_weight():
    design, ink, stroke, weight = regression(0.0, [0.2] * 4)
    spoilt = stroke % 4 == 3
    ink[spoilt] = 5.0
    weights, _ = regress_ink(design, ink, stroke, np.where(spoilt, 0.0, weight))
    assert weights[0] == pytest.approx(0.5, abs=0.05)
    assert weights[1] == pytest.approx(0.2, abs=0.05)
    without = design[:, :1]  # the mean alone
    mean, noise = regress_ink(without, ink, stroke, np.where(spoilt, 0.0, weight))
    assert mean[0] == pytest.approx(ink[~spoilt].mean(axis=0), abs=0.01) and noise.max() < 0.4


def test_one_stroke_tells_nothing_about_another():
    design, ink, stroke, weight = regression(0.0, [0.2] * 4, strokes=1)
    weights, _ = regress_ink(design, ink, stroke, weight)
    assert not weights[1:].any()
    assert weights[0] == pytest.approx(ink.mean(axis=0))
    spoilt = np.arange(len(ink)) % 4 < 2
    ink = np.where(spoilt[:, None], 5.0, ink)
    weights, noise = regress_ink(design, ink, stroke, 1.0 - spoilt)
    assert weights[0] == pytest.approx(ink[~spoilt].mean(axis=0), abs=1e-3)
    assert noise.max() < 0.1


# ------------------------------------------------------------------------------------------- all


def test_a_bank_of_even_ink_says_flat_and_how_much_is_hidden():
    cross = strokes_of([[20, 30], [180, 30]], [[20, 70], [180, 70]], [[100, 10], [100, 90]])
    near = nearest_strokes(cross, (WIDTH, HEIGHT))
    alpha = np.clip(0.5 - near.distance, 0, 1)
    bank = learn_texture(cross, features_of(cross), exemplar_of(alpha))
    assert bank.flat and bank.margin == MIN_MARGIN
    level = slice(bank.offsets[0], bank.offsets[1])
    hidden = bank.occlusion[level]
    assert hidden.max() > 0.9 and np.mean(hidden > 0.1) < 0.15
    body = bank.ends[level].min(axis=1) > 8
    assert bank.local_ink[level][body, 0].min() > 0.85  # what is hidden is filled
    with pytest.raises(ValueError, match="no strokes"):
        learn_texture(
            Strokes(np.zeros((0, 2)), [], [0], [], []), np.zeros((0, 1)), exemplar_of(alpha)
        )
