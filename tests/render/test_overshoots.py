"""Strokes begin and end where the pen is set down and lifted, at lengths drawn by chance."""

import numpy as np
import pytest
from known_law import level, planned

from strokestyle.geometry.curves import KINDS, Curves
from strokestyle.render.config import StyleConfig
from strokestyle.render.features import FEATURES, point_features
from strokestyle.render.overshoots import Overshoots
from strokestyle.render.plan import lift, plan_strokes

STEP = 3.0


def lines(*lengths, past=30.0):
    """Level strokes of these lengths, that may run on by `past` px."""
    at = [
        np.array([100.0, 40.0 * (i + 1)]) + np.outer(np.linspace(0, n, round(n / STEP) + 1), [1, 0])
        for i, n in enumerate(lengths)
    ]
    return plan_strokes(
        Curves.from_list(at, [KINDS.index("crease")] * len(at)), STEP, 0.0, 180.0, past
    )


def ends(strokes):
    return [
        (strokes.xy[a, 0] - 100, strokes.xy[b - 1, 0] - 100)
        for a, b in zip(strokes.offsets[:-1], strokes.offsets[1:], strict=True)
    ]


@pytest.mark.parametrize("first, last", [(10.0, 5.0), (0.0, 0.0), (-7.0, 20.5), (30.0, -1.6)])
def test_strokes_begin_and_end_to_a_fraction_of_a_pixel(first, last):
    strokes, rows = lift(lines(150, 60), np.array([[first, last], [0.0, 0.0]]), STEP)
    assert np.allclose(ends(strokes), [(-first, 150 + last), (0, 60)])
    assert strokes.lifted and len(strokes) == 2 and len(rows) == len(strokes.xy)
    step = np.diff(strokes.xy[: strokes.offsets[1], 0])
    assert step.min() > 0.4 * STEP and step.max() < 1.6 * STEP
    s = strokes.xy[: strokes.offsets[1], 0] - 100
    over = np.maximum(np.maximum(-s, s - 150), 0)
    assert strokes.overshoot[: strokes.offsets[1]] == pytest.approx(over)
    # what is read at the curves' points is that of the kept rows
    whole = lines(150, 60)
    assert np.array_equal(strokes.source, whole.source[rows])


def test_features_of_lifted_strokes_are_felt_from_the_pens_own_ends():
    whole = lines(150)
    strokes, _ = lift(whole, np.array([[12.0, -9.0]]), STEP)
    surface = np.zeros((len(strokes.xy), 5))
    got = dict(zip(FEATURES, point_features(strokes, surface, StyleConfig()).T, strict=True))
    s = strokes.xy[:, 0] - 100 + 12
    assert got["along"] == pytest.approx(s / (150 + 12 - 9))
    assert got["start_10"] == pytest.approx(np.exp(-s / 10))
    assert not got["before"].any() and not got["past_end"].any()


def test_no_strokes_are_lifted_to_none():
    none = planned(level(20))
    strokes, rows = lift(plan_strokes(Curves.from_list([], [])), np.zeros((0, 2)), STEP)
    assert len(strokes) == 0 and len(rows) == 0 and len(none) == 1


def test_every_end_is_given_that_of_a_training_stroke():
    known = Overshoots.of(
        np.array([[5.0, 20.0], [6.0, 21.0], [7.0, 22.0], [8.0, np.nan], [np.nan, 23.0]])
    )
    strokes = lines(*[200.0] * 400)
    past = known.sample(strokes, np.random.default_rng(0))
    for k, lengths in enumerate(([5, 6, 7, 8], [20, 21, 22, 23])):
        assert sorted(set(past[:, k])) == lengths
        assert past[:, k].mean() == pytest.approx(np.mean(lengths), abs=0.2)
    assert abs(np.corrcoef(past.T)[0, 1]) < 0.15  # one end does not tell of the other
    assert np.array_equal(past, known.sample(strokes, np.random.default_rng(0)))
    assert not np.array_equal(past, known.sample(strokes, np.random.default_rng(1)))


def test_short_lines_are_overshot_by_less_and_where_nothing_is_known_by_nothing():
    strokes, rng = lines(30.0, 300.0), np.random.default_rng(0)
    far = Overshoots.of(np.full((5, 2), 60.0)).sample(strokes, rng)
    assert far == pytest.approx(np.array([[18.0, 18.0], [60.0, 60.0]]))
    short = Overshoots.of(np.full((5, 2), -20.0)).sample(strokes, rng)
    assert short == pytest.approx(np.array([[-9.0, -9.0], [-20.0, -20.0]]))
    assert not Overshoots.of(np.full((5, 2), np.nan)).sample(strokes, rng).any()
    few = np.full((5, 2), np.nan)
    few[:, 0], few[0, 1] = 9.0, 40.0  # of the last end too little: the first's count as well
    got = Overshoots.of(few).sample(lines(*[300.0] * 200), rng)
    assert set(got[:, 0]) == {9.0} and set(got[:, 1]) == {9.0, 40.0}


def test_what_one_end_does_is_no_habit():
    past = np.zeros((20, 2))
    past[3, 0] = past[4, 1] = 21.0
    assert Overshoots.of(past).first.max() == 0 and len(Overshoots.of(past).first) == 19
    past[5:9, 0] = 18.0
    assert Overshoots.of(past).first.max() == 21


def test_a_pen_lifted_short_of_most_ends_does_not_overshoot_the_others():
    past = np.full((20, 2), -14.0)
    past[3] = 0.0, 21.0
    known = Overshoots.of(past)
    assert known.last.max() == -14 and len(known.last) == 19 and len(known.first) == 20
