"""From curves to the strokes that a hand would draw: joined, cut, directed, run on past their
ends."""

import numpy as np
import pytest

from strokestyle.geometry.curves import Curves
from strokestyle.render.plan import corners, heading, plan_strokes


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


# ------------------------------------------------------------------------------------------ corners


def bent(turn, base=0.0, steps=12):
    """Two straight legs of `steps` steps of 3 px; the second is turned by `turn` degrees."""
    angle = np.radians([base, base + turn])
    legs = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 3
    steps = np.concatenate([np.tile(legs[0], (steps, 1)), np.tile(legs[1], (steps, 1))])
    return np.concatenate([[[200.0, 200.0]], 200 + np.cumsum(steps, axis=0)])


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("base", range(0, 360, 30))
def test_a_corner_is_found_where_it_is_whichever_way_it_turns(side, base):
    assert corners(bent(side * 70, base), 65, 4).tolist() == [12]
    assert corners(bent(side * 60, base), 65, 4).tolist() == []
    assert corners(bent(side * 150, base), 145, 4).tolist() == [12]
    assert corners(bent(side * 140, base), 145, 4).tolist() == []


def test_corners_are_more_than_a_span_apart_and_not_at_the_ends():
    square = np.concatenate([bent(90), bent(90, 180)[1:] - 200 + bent(90)[-1]])
    assert corners(square, 65, 4).tolist() == [12, 24, 36]
    assert corners(bent(90, steps=4), 65, 4).tolist() == [4]
    assert corners(bent(90, steps=3), 65, 4).tolist() == []  # too short to tell
    tight = np.concatenate([bent(90), bent(90, 90)[13:16] - bent(90, 90)[12] + bent(90)[-1]])
    assert np.diff(corners(tight, 30, 4)).min(initial=9) > 4


def test_of_two_points_that_turn_alike_the_first_is_the_corner():
    """A chamfered corner is symmetric: its two points turn by the same angle exactly."""
    chamfer = [[x, 0] for x in range(7)] + [[7, y] for y in range(1, 8)]
    assert corners(np.array(chamfer, float), 65, 4).tolist() == [6]


def test_pieces_share_the_corner_between_them():
    planned = plan_strokes(Curves.from_list([bent(80)], [0]))
    assert len(planned) == 2 and planned.offsets.tolist() == [0, 13, 26]
    corner = bent(80)[12]
    ends = planned.xy[[0, 12, 13, 25]]
    assert sum(np.allclose(end, corner) for end in ends) == 2


# ------------------------------------------------------------------------------- direction and ends


def test_strokes_are_pulled_down_and_to_the_right():
    for a, b in (((60, 50), (10, 50)), ((50, 90), (50, 10)), ((10, 10), (80, 80))):
        planned = plan_strokes(Curves.from_list([line(a, b)], [0]))
        assert (planned.xy[-1] - planned.xy[0]) @ [0.6, 1.0] > 0


def test_down_counts_for_more_than_to_the_right():
    for rise, turned in ((55, True), (65, False)):  # 100 to the left outweighs 55 down, not 65
        planned = plan_strokes(Curves.from_list([line((200, 50), (100, 50 + rise))], [0]))
        assert (planned.xy[0, 0] < planned.xy[-1, 0]) == turned


def test_the_heading_of_an_end_is_that_of_its_last_span():
    path = bent(90)
    assert heading(path, 4) == pytest.approx([0, 1])
    assert heading(path[::-1], 4) == pytest.approx([-1, 0])
    assert heading(path[:5], 99) == pytest.approx([1, 0])
    assert heading(path[:15], 4) == pytest.approx([2**-0.5, 2**-0.5])  # half of it round the corner
    assert heading(np.zeros((3, 2)), 4).tolist() == [0, 0]


@pytest.mark.parametrize("length, count", [(12.0, 4), (11.9, 3), (2.9, 0), (24.0, 8)])
def test_strokes_overshoot_straight_by_whole_steps(length, count):
    planned = plan_strokes(Curves.from_list([bent(40)], [0]), max_overshoot=length)
    n = len(planned.xy)
    assert n == 25 + 2 * count
    past = 3.0 * np.arange(1, count + 1)
    assert planned.overshoot == pytest.approx(np.r_[past[::-1], np.zeros(25), past])
    assert planned.on_curve.sum() == 25
    first, last = bent(40)[[0, -1]]
    out = np.array([np.cos(np.radians(40)), np.sin(np.radians(40))])
    assert planned.xy[:count] == pytest.approx(first - past[::-1, None] * [1, 0], abs=1e-6)
    assert planned.xy[n - count :] == pytest.approx(last + past[:, None] * out, abs=1e-6)
    assert (planned.source[:count, 0] == 0).all()  # it takes its values from the end
    assert planned.carry(bent(40))[n - count :] == pytest.approx(np.tile(last, (count, 1)))


def test_short_strokes_are_left_out():
    curves = Curves.from_list([line((20, 20), (25.9, 20)), line((20, 60), (26.1, 60))], [0, 0])
    assert plan_strokes(curves).xy[:, 1].tolist() == [60, 60, 60]
    assert len(plan_strokes(curves, min_length=5)) == 2


# --------------------------------------------------------------------------------------------- join


def joined(*lines, kinds=None, **options):
    return plan_strokes(Curves.from_list(list(lines), kinds or [0] * len(lines)), **options)


def test_it_is_the_ends_that_must_head_for_each_other():
    """Hooks whose near ends agree are joined; those whose far ends agree are not."""
    t = np.linspace(0, np.pi / 2, 30)[:, None]
    rising = [60, 50] + 40 * np.concatenate([-np.sin(t), 1 - np.cos(t)], axis=1)[::-1]  # ends level
    level = line((64, 50), (110, 50))
    assert len(joined(rising, level, corner_angle=180)) == 1
    falling = [60, 50] + 40 * np.concatenate([np.cos(t) - 1, -np.sin(t)], axis=1)[::-1]
    upright = falling  # ends heading down, where the level one begins
    assert len(joined(upright, level, corner_angle=180)) == 2
    assert len(joined(level[::-1], rising[::-1], corner_angle=180)) == 1  # either way round


@pytest.mark.parametrize("angle, count", [(25, 1), (35, 2), (-25, 1), (-35, 2)])
def test_headings_may_differ_by_thirty_degrees(angle, count):
    turn = np.radians(angle)
    start = np.array([60 + 4 * np.cos(turn / 2), 50 + 4 * np.sin(turn / 2)])
    second = start + np.linspace(0, 50, 40)[:, None] * [np.cos(turn), np.sin(turn)]
    assert len(joined(line((10, 50), (60, 50)), second, corner_angle=180)) == count


@pytest.mark.parametrize(
    "gap, aside, count", [(8, 40, 1), (8, 70, 2), (8, 0, 1), (4, 85, 1), (4.6, 85, 2)]
)
def test_across_a_wide_gap_the_bridge_must_head_the_same_way(gap, aside, count):
    """Wide is 1.5 times the spacing, 4.5 px; a bridge may lie up to 60 degrees aside."""
    a = np.radians(aside)
    start = np.array([60 + gap * np.cos(a), 50 + gap * np.sin(a)])
    second = line(start, start + [50, 0])
    assert len(joined(line((10, 50), (60, 50)), second, corner_angle=180)) == count


def test_a_bridge_is_straight_and_takes_its_values_from_the_nearer_side():
    first, second = line((10, 50), (61, 50), 18), line((70, 50), (121, 50), 18)
    planned = joined(first, second, kinds=[0, 0])
    assert planned.xy == pytest.approx(np.stack([np.arange(10, 122, 3.0), np.full(38, 50)], axis=1))
    assert planned.carry(np.arange(36.0)[:, None])[:, 0] == pytest.approx(
        np.r_[np.arange(18), [17, 18], np.arange(18, 36)]
    )
    assert planned.on_curve.all()


def test_ends_that_touch_share_a_point():
    planned = joined(line((10, 50), (61, 50), 18), line((61, 50), (112, 50), 18))
    assert planned.xy[:, 0] == pytest.approx(np.arange(10, 113, 3.0))


def test_a_joined_stroke_is_of_the_kind_that_most_of_it_is():
    short, long = line((10, 50), (40, 50)), line((43, 50), (120, 50))
    assert joined(short, long, kinds=[2, 5]).kind.tolist() == [5]
    assert joined(short, long, kinds=[5, 2]).kind.tolist() == [2]
    third = line((123, 50), (153, 50))
    longer = line((43, 50), (93, 50))
    again = line((96, 50), (126, 50))
    assert joined(short, longer, again, kinds=[2, 5, 2]).kind.tolist() == [2]  # 60 px of 110
    assert len(joined(short, long, third)) == 1


def test_chains_are_walked_through_pieces_that_lie_either_way():
    pieces = [line((10 + 40 * i, 50), (46 + 40 * i, 50)) for i in range(5)]
    pieces = [piece[::-1] if i % 2 else piece for i, piece in enumerate(pieces)]
    for order in ([0, 1, 2, 3, 4], [3, 0, 4, 1, 2]):
        planned = joined(*[pieces[i] for i in order])
        assert len(planned) == 1 and (np.diff(planned.xy[:, 0]) > 2).all()
        assert planned.xy[[0, -1], 0].tolist() == [10, 206]


def test_of_several_ends_the_one_that_agrees_best_is_taken():
    """20 degrees and 3 px are dearer than 3 degrees and 6 px: 26 against 15."""
    first = line((10, 50), (60, 50))
    turn = np.radians(20)
    near = [63, 50] + np.linspace(0, 60, 40)[:, None] * [np.cos(turn), np.sin(turn)]
    straight_on = [66, 50] + np.linspace(0, 60, 40)[:, None] * [1, -0.05]
    planned = joined(first, near, straight_on, kinds=[0, 2, 5], corner_angle=180)
    ends = {planned.xy[b - 1].round().tolist()[1] for b in planned.offsets[1:]}
    lengths = np.diff(planned.offsets)
    assert len(planned) == 2 and ends == {47, 71}
    assert planned.kind[lengths.argmax()] == 5


def test_no_stroke_is_joined_to_itself():
    t = np.linspace(0.02, 2 * np.pi - 0.02, 200)
    ring = 100 + 60 * np.stack([np.cos(t), np.sin(t)], axis=1)
    planned = joined(ring, line((300, 300), (350, 300)))
    assert len(planned) == 2
    half = len(ring) // 2
    planned = joined(ring[:half], ring[half:], corner_angle=180)  # two halves: one of two joints
    assert len(planned) == 1 and np.hypot(*(planned.xy[0] - planned.xy[-1])) < 8


# --------------------------------------------------------------------------------- what they carry


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


def test_a_curve_is_cut_where_the_polyline_that_stays_near_it_has_corners():
    angle = np.linspace(0.0, 4.0, 134)
    ring = 200 + 100 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    whole = plan_strokes(Curves.from_list([ring], [0]), join_gap=0.0)
    assert len(whole) == 1
    for tolerance in (2.0, 6.0, 12.0):
        cut = plan_strokes(Curves.from_list([ring], [0]), join_gap=0.0, cut_tolerance=tolerance)
        ends = set()
        for a, b in zip(cut.offsets[:-1], cut.offsets[1:], strict=True):
            line = cut.xy[a:b]
            chord = (line[-1] - line[0]) / np.hypot(*(line[-1] - line[0]))
            assert np.abs((line - line[0]) @ [-chord[1], chord[0]]).max() < tolerance + 0.5
            ends |= {tuple(line[0].round(6)), tuple(line[-1].round(6))}
        assert len(ends) == len(cut) + 1  # each ends where the next begins
        assert len(cut) >= 400 / np.sqrt(8 * 100 * (tolerance + 0.5))  # chords of such a sagitta
