"""From curves to the strokes that a hand would draw: joined, cut, directed, run on past their
ends."""

import numpy as np
import pytest

from strokestyle.geometry.curves import Curves
from strokestyle.render.plan import plan_strokes


def line(a, b, n=40):
    return np.linspace(a, b, n)


def test_two_ends_that_head_the_same_way_become_one_stroke():
    curves = Curves.from_list([line((10, 50), (60, 50)), line((66, 50), (120, 50))], [0, 0])
    assert len(plan_strokes(curves)) == 1
    assert len(plan_strokes(curves, join_gap=0)) == 2
    apart = Curves.from_list([line((10, 50), (60, 50)), line((90, 50), (120, 50))], [0, 0])
    assert len(plan_strokes(apart)) == 2
    turned = Curves.from_list([line((10, 50), (60, 50)), line((62, 56), (62, 120))], [0, 0])
    assert len(plan_strokes(turned)) == 2


def test_a_corner_ends_a_stroke_and_a_bend_does_not():
    corner = Curves.from_list(
        [np.concatenate([line((10, 50), (60, 50)), line((60, 51), (60, 100))])], [0]
    )
    assert len(plan_strokes(corner)) == 2
    assert len(plan_strokes(corner, corner_angle=180)) == 1
    angle = np.linspace(0, np.pi / 2, 60)
    bend = Curves.from_list([60 * np.stack([np.cos(angle), np.sin(angle)], 1) + 100], [0])
    assert len(plan_strokes(bend)) == 1


def test_strokes_are_pulled_down_and_to_the_right():
    for a, b in (((60, 50), (10, 50)), ((50, 90), (50, 10)), ((10, 10), (80, 80))):
        planned = plan_strokes(Curves.from_list([line(a, b)], [0]))
        assert (planned.xy[-1] - planned.xy[0]) @ [0.6, 1.0] > 0


def test_strokes_run_on_straight_past_their_ends():
    planned = plan_strokes(Curves.from_list([line((20, 50), (80, 50))], [0]), max_overshoot=12)
    assert np.allclose(planned.xy[:, 1], 50)
    assert np.isclose(planned.xy[0, 0], 8, atol=3.1) and np.isclose(planned.xy[-1, 0], 92, atol=3.1)
    assert planned.on_curve[(planned.xy[:, 0] > 21) & (planned.xy[:, 0] < 79)].all()
    assert planned.overshoot.max() <= 12.1


def test_values_are_carried_from_the_curves():
    curves = Curves.from_list([line((10, 30), (90, 30)), line((20, 70), (80, 75))], [0, 4])
    planned = plan_strokes(curves)
    within = planned.on_curve
    assert np.allclose(planned.carry(curves.xy)[within], planned.xy[within], atol=0.2)
    assert sorted(planned.kind) == [0, 4]


@pytest.mark.parametrize(
    "lines",
    [[], [[[5, 5], [5, 5]]], [[[0, 0], [2, 0]]], [[[0, 0], [40, 0], [0, 0]]]],
    ids=["none", "dot", "speck", "hairpin"],
)
def test_the_zoo_stays_finite(lines):
    planned = plan_strokes(Curves.from_list(lines), max_overshoot=10)
    assert np.isfinite(planned.xy).all() and len(planned.offsets) == len(planned.kind) + 1
