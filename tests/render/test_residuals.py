"""Sampled residuals are like those they are sampled from, and a style adds just them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from small_styles import plain_style

from strokestyle.extract.pipeline import view_of_lines
from strokestyle.geometry.curves import Curves
from strokestyle.render.config import HAIR
from strokestyle.render.residuals import CROSS_FADE, Residuals, sample_residuals


def sequences(*parts):
    offsets = np.r_[0, np.cumsum([len(part) for part in parts])]
    return Residuals(np.concatenate(parts).astype(np.float32), offsets)


def constant(count, across=1.0, log_width=0.5):
    return np.tile([across, log_width], (count, 1))


def sample(residuals, *lengths, seed=0):
    return sample_residuals(residuals, np.r_[0, np.cumsum(lengths)], np.random.default_rng(seed))


def strokes_of(sampled, count):
    return np.split(sampled, count)


def test_spread_and_wavelengths_stay():
    """Noise of which each point keeps 0.8 of the one before, across, and 0.5, in thickness."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(40, 120, 2))
    keep, spread = np.array([0.8, 0.5]), np.array([1.5, 0.2])
    parts = np.stack(
        [lfilter([1], [1, -k], noise[..., i], axis=1) for i, k in enumerate(keep)], axis=2
    )
    parts *= spread * np.sqrt(1 - keep**2)
    got = np.stack(strokes_of(sample(sequences(*parts), *[100] * 600), 600))
    for k in (0, 1):
        values = got[:, : 100 - CROSS_FADE, k]  # at most a cross-fade's length stays bare
        assert values.std() == pytest.approx(parts[..., k].std(), rel=0.05)
        assert values.mean() == pytest.approx(0, abs=0.1 * spread[k])
        for lag in (1, 3):
            wanted = (parts[:, lag:, k] * parts[:, :-lag, k]).mean() / parts[..., k].var()
            found = (values[:, lag:] * values[:, :-lag]).mean() / values.var()
            assert found == pytest.approx(wanted, abs=0.06)


def test_a_piece_may_change_its_side_but_not_its_thickness():
    got = sample(sequences(constant(30)), *[30] * 200)
    assert got[:, 1] == pytest.approx(np.full(6000, 0.5))
    sides = np.array([stroke[:, 0] for stroke in strokes_of(got, 200)])
    assert np.abs(sides) == pytest.approx(np.ones((200, 30)))
    assert (sides == sides[:, :1]).all()  # as one
    assert 60 < (sides[:, 0] < 0).sum() < 140


def test_pieces_fade_into_each_other_by_square_roots():
    got = sample(sequences(constant(40)), 60)
    share = (np.arange(CROSS_FADE) + 0.5) / CROSS_FADE
    fade = 0.5 * (np.sqrt(share) + np.sqrt(1 - share))
    assert got[:32, 1] == pytest.approx(np.full(32, 0.5))
    assert got[32:40, 1] == pytest.approx(fade)  # the second piece begins a cross-fade early
    assert got[40:44, 1] == pytest.approx(np.full(4, 0.5))


def test_pieces_follow_one_after_the_other():
    """Each of 40 points begins a cross-fade before the last one ends: at 32, 64 and 96."""
    got = sample(sequences(constant(40)), 130)[:112, 1]
    fading = np.isin(np.arange(112) // CROSS_FADE, [4, 8, 12])
    assert got[~fading] == pytest.approx(np.full((~fading).sum(), 0.5))
    assert (got[fading] > 0.55).all()


def test_a_cross_fade_goes_from_the_old_piece_to_the_new_one():
    """Sequences of which only the beginning, or only the end, is not nothing."""
    ramp = np.stack([np.zeros(40), np.linspace(1.0, 2.0, 40)], axis=1)
    got = sample(sequences(ramp), 60)[:, 1]
    share = (np.arange(CROSS_FADE) + 0.5) / CROSS_FADE
    first = np.linspace(1.0, 2.0, 40)
    assert got[:32] == pytest.approx(first[:32])
    second = (got[32:40] - np.sqrt(1 - share) * first[32:]) / np.sqrt(share)
    assert np.diff(second) == pytest.approx(np.full(7, 1 / 39), abs=1e-5)  # a piece of the ramp


def test_pieces_lie_within_one_sequence():
    """Each a constant of its own: within a stroke of one piece there is no other."""
    parts = [constant(25, 0.0, float(value)) for value in range(1, 9)]
    for stroke in strokes_of(sample(sequences(*parts), *[20] * 100), 100):
        assert len(set(stroke[:, 1])) == 1 and stroke[0, 1] in range(1, 9)


def test_long_sequences_are_taken_more_often():
    got = sample(sequences(constant(90, 0, 1.0), constant(30, 0, 2.0)), *[100] * 400)
    first = got[::100, 1]
    assert (first == 1.0).mean() == pytest.approx(0.75, abs=0.07)


def test_the_seed_decides_and_nothing_gives_nothing():
    residuals = sequences(np.random.default_rng(3).normal(size=(50, 2)))
    assert np.array_equal(sample(residuals, 70, 9, seed=4), sample(residuals, 70, 9, seed=4))
    assert not np.array_equal(sample(residuals, 70, 9, seed=4), sample(residuals, 70, 9, seed=5))
    empty = Residuals(np.zeros((0, 2), np.float32), np.zeros(1, np.int64))
    assert not sample(empty, 10, 20).any() and sample(empty, 10, 20).shape == (30, 2)


@pytest.mark.parametrize("lengths", [(1,), (2, 1, 3), (8, 9), (500,)])
def test_strokes_of_every_length_are_filled(lengths):
    for part in (constant(1), constant(3), constant(20)):
        got = sample(sequences(part), *lengths)
        assert got.shape == (sum(lengths), 2) and np.isfinite(got).all()
        assert 0.5 <= got[0, 1] < 1


# ------------------------------------------------------------------------------------ in a drawing


def test_a_style_adds_its_residuals_across_the_stroke_and_to_its_log_width():
    t = np.linspace(0, 1, 100)[:, None]
    curves = Curves.from_list([[50, 100] + t * [300, 0], [50, 300] + t * [180, 240]], [0, 2])
    view = view_of_lines(curves, 768, 768)
    plain = plain_style()
    residuals = sequences(np.random.default_rng(0).normal(size=(60, 2)) * [2.0, 0.1])
    strayed = replace(plain, residuals=residuals)
    for seed in (0, 7):
        meant, drawn = (style.lay_strokes(view, seed).strokes for style in (plain, strayed))
        rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
        wanted = sample_residuals(residuals, meant.offsets, rng)
        assert np.abs(wanted[:, 0]).max() > 2
        normals = np.repeat([[0.0, 1.0], [-0.8, 0.6]], np.diff(meant.offsets), axis=0)
        assert drawn.xy - meant.xy == pytest.approx(wanted[:, :1] * normals, abs=1e-6)
        change = np.log(drawn.thickness + HAIR) - np.log(meant.thickness + HAIR)
        assert change == pytest.approx(wanted[:, 1], abs=1e-6)
    one, two = (strayed.draw(view, seed).strokes.xy for seed in (1, 2))
    assert not np.array_equal(one, two)
