"""Chance of tracks: sequences without end that do not depend on who asks when, and their spread."""

import numpy as np
import pytest

from strokestyle.motion.chance import (
    Luck,
    Stage,
    TrackChance,
    endless_residuals,
    spline_weights,
    white_noise,
)
from strokestyle.render.overshoots import Overshoots
from strokestyle.render.residuals import Residuals
from strokestyle.render.restating import Restating
from tests.motion.moving import some_residuals


@pytest.mark.parametrize(
    "make", [lambda rng: endless_residuals(some_residuals(), rng), white_noise]
)
def test_a_sequence_is_the_same_however_it_is_asked_for(make):
    one, other = make(np.random.default_rng(3)), make(np.random.default_rng(3))
    whole = one.rows(-300, 400)
    assert whole.shape == (700, 2)
    for low, high in ((0, 3), (-2, 5), (100, 180), (-250, -240), (-300, 400), (7, 8)):
        assert np.array_equal(other.rows(low, high), whole[low + 300 : high + 300])
    assert not np.array_equal(make(np.random.default_rng(4)).rows(0, 9), whole[300:309])


def test_between_rows_a_sequence_runs_through_its_values():
    noise = white_noise(np.random.default_rng(0))
    assert np.allclose(noise.at(np.arange(-20.0, 20.0)), noise.rows(-20, 20))
    t = np.linspace(0, 1, 5)
    assert np.allclose(spline_weights(t).sum(axis=1), 1)
    assert np.allclose(spline_weights(t) @ np.array([-1.0, 0.0, 1.0, 2.0]), t)  # of a straight line


def test_residuals_have_the_spread_of_the_training_strokes_also_where_two_pieces_meet():
    rng = np.random.default_rng(0)
    noise = Residuals(rng.standard_normal((4000, 2)), np.arange(0, 4001, 40))
    near, far = (
        np.concatenate(
            [endless_residuals(noise, np.random.default_rng(k)).rows(a, a + 8) for k in range(300)]
        )
        for a in (-4, 133)
    )
    assert near.std(axis=0) == pytest.approx(1.0, abs=0.05)
    assert far.std(axis=0) == pytest.approx(1.0, abs=0.05)


def test_sequences_of_one_point_make_one_without_end():
    short = Residuals(np.ones((3, 2)), np.arange(4))
    assert np.abs(endless_residuals(short, np.random.default_rng(0)).rows(-5, 50)).max() <= 1.5
    none = Residuals(np.zeros((0, 2)), np.zeros(1, np.int64))
    chance = TrackChance(Luck(0), 3.0)
    assert not chance.residuals(none, (1, 0), np.arange(4.0), 0).any()


@pytest.mark.parametrize("boil", [0.0, 0.4, 1.0])
def test_boil_keeps_the_spread_and_parts_what_is_shared(boil):
    noise = np.random.default_rng(0).standard_normal((900, 2))
    residuals = Residuals(noise, np.arange(0, 901, 30))
    chance = TrackChance(Luck(5, boil), 3.0)
    place = np.arange(0.0, 900.0, 3.0)
    one, other = (
        np.concatenate([chance.residuals(residuals, (t, 0), place, frame) for t in range(12)])
        for frame in (0, 1)
    )
    assert one.std() == pytest.approx(1.0, abs=0.05)
    shared = np.corrcoef(one[:, 0], other[:, 0])[0, 1]
    assert shared == pytest.approx(1 - boil**2, abs=0.06)


def test_overshoots_are_drawn_once_a_track_and_do_not_jump_as_its_line_grows():
    past = np.array([2.0, 6.0, 11.0, 17.0], np.float32)
    known, chance = Overshoots(past, past), TrackChance(Luck(1), 3.0)
    far = np.stack([chance.overshoots(known, (t, 0), 500.0, t % 3) for t in range(60)])
    assert set(far.ravel().tolist()) == {2.0, 6.0, 11.0, 17.0}
    lengths = np.linspace(1.0, 60.0, 200)
    grown = np.stack([chance.overshoots(known, (4, 0), length, 0) for length in lengths])
    assert np.abs(np.diff(grown, axis=0)).max() < 0.2
    assert np.array_equal(grown[-1], far[4])


def test_boil_keeps_mean_and_spread_of_overshoots():
    past = np.random.default_rng(0).normal(8.0, 3.0, 50).astype(np.float32)
    known, chance = Overshoots(past, past), TrackChance(Luck(1, 0.6), 3.0)
    drawn = [chance.overshoots(known, (t, 0), 900.0, f) for t in range(150) for f in range(4)]
    assert np.mean(drawn) == pytest.approx(past.mean(), abs=0.5)
    assert np.std(drawn) == pytest.approx(past.std(), rel=0.1)


def test_passes_of_a_track_are_gone_over_in_all_frames_and_lie_about_their_line():
    restating = Restating(np.array([0], np.int8), 3, 0.5, 2.0, 60.0)
    chance = TrackChance(Luck(7), 3.0)
    counts = [chance.passes(restating, track, 0) for track in range(200)]
    assert set(counts) == {1, 3} and 80 < counts.count(3) < 120
    assert chance.passes(restating, counts.index(3), 2) == 1  # a line of another kind
    place = np.arange(0.0, 3000.0, 3.0)
    off = np.stack([chance.deviation(restating, 9, k, place, 0) for k in range(3)])
    assert np.abs(off.sum(axis=0)).max() < 1e-9
    assert off.std() == pytest.approx(2.0 * np.sqrt(2 / 3), rel=0.25)
    later = chance.deviation(restating, 9, 1, place[40:80], 5)
    assert np.allclose(later, off[1, 40:80])


def test_a_drawing_has_another_chance_than_its_track_and_the_next_drawing():
    luck = Luck(3, 1.0)
    drawn = [
        luck.of_track(Stage.RESIDUALS, 4).random(),
        luck.of_track(Stage.TEXTURE, 4).random(),
        luck.of_track(Stage.RESIDUALS, 5).random(),
        *(luck.of_drawing(Stage.RESIDUALS, frame, 4).random() for frame in range(3)),
    ]
    assert len(set(drawn)) == len(drawn)
