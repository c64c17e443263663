"""The basis of displacements in closed form: circles, bumps and normals that are known."""

from dataclasses import replace

import numpy as np
import pytest
from known_law import planned

from strokestyle.geometry.curves import Curves
from strokestyle.render.displacement import (
    CUTS,
    DEFORMATIONS,
    SMOOTHINGS,
    Frame,
    deformations_of,
    displaced,
)
from strokestyle.render.features import SURFACE
from strokestyle.render.plan import plan_strokes

STEP = 3.0  # px between points


def straight(count, start=(20.0, 40.0), towards=(1.0, 0.0)):
    return np.array(start) + STEP * np.arange(count)[:, None] * np.array(towards)


def arc(radius, count, turn=1.0, centre=(300.0, 300.0)):
    angle = turn * STEP / radius * np.arange(count)
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def deformations(strokes, normals=None):
    """{name: (N, 2)} of strokes, by default where no surface is seen."""
    normals = np.zeros((len(strokes.xy), 2)) if normals is None else normals
    return dict(
        zip(DEFORMATIONS, deformations_of(strokes, normals, STEP).swapaxes(0, 1), strict=True)
    )


def frame_of(strokes):
    return Frame.of(strokes, np.zeros((len(strokes.xy), len(SURFACE))), STEP)


# ------------------------------------------------------------------------------------------ normals


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_normals_are_unit_and_at_right_angles_on_one_side(turn):
    line = arc(150.0, 100, turn)
    normals = frame_of(planned(line)).normals
    assert np.hypot(*normals.T) == pytest.approx(np.ones(100))
    outward = (line - 300.0) / 150.0
    # the tangent t = (cos a, sin a) turned by (-t_y, t_x) points to the middle where angles grow
    assert normals[8:-8] == pytest.approx(-turn * outward[8:-8], abs=1e-6)


def test_the_normal_of_a_line_to_the_right_points_down_the_picture():
    for towards, normal in (
        ((1.0, 0.0), (0.0, 1.0)),
        ((0.0, 1.0), (-1.0, 0.0)),
        ((0.6, 0.8), (-0.8, 0.6)),
    ):
        frame = frame_of(planned(straight(20, towards=towards)))
        assert frame.normals == pytest.approx(np.tile(normal, (20, 1)))


def test_a_frame_holds_the_strokes_and_where_they_lie_on_their_curves():
    strokes = planned(straight(20), straight(30, (20.0, 90.0)), past=3)
    frame = frame_of(strokes)
    assert np.array_equal(frame.xy, strokes.xy) and frame.offsets.tolist() == [0, 20, 50]
    assert frame.on_curve.sum() == 50 - 4 * 3 and not frame.on_curve[[0, 2, 17, 20, 49]].any()
    assert frame.deformations.shape == (50, len(DEFORMATIONS), 2)


# -------------------------------------------------------------------------------------- smooth, cut


@pytest.mark.parametrize("sigma", SMOOTHINGS)
def test_smoothing_draws_a_circle_in_by_a_known_factor(sigma):
    """A Gaussian of sigma along a circle of radius r leaves exp(-sigma^2 / 2 r^2) of it."""
    radius, count = 100.0, 200
    line = arc(radius, count)
    got = deformations(planned(line))[f"smooth_{sigma:.0f}"]
    inner = slice(int(4 * sigma / STEP) + 2, -int(4 * sigma / STEP) - 2)
    shrunk = np.exp(-0.5 * (sigma / radius) ** 2)
    assert got[inner] == pytest.approx((shrunk - 1) * (line[inner] - 300.0), rel=5e-3, abs=1e-4)
    assert got[[0, -1]] == pytest.approx(np.zeros((2, 2)), abs=1e-9)  # its ends stay


def bump(sagitta, radius=200.0):
    """An arc whose middle is `sagitta` px from the chord between its ends."""
    half = np.arccos(1 - sagitta / radius)
    count = int(2 * half * radius / STEP)
    angle = np.linspace(-half, half, count)
    return 300.0 + radius * np.stack([np.sin(angle), np.cos(angle)], axis=1)


def test_a_bump_is_cut_straight_by_tolerances_larger_than_it():
    line = bump(8.0)
    got = deformations(planned(line))
    chord = np.linspace(line[0], line[-1], len(line))
    assert line + got["cut_12"] == pytest.approx(chord, abs=1e-6)
    for tolerance in (3.0, 6.0):
        cut = line + got[f"cut_{tolerance:.0f}"]
        off = np.hypot(*(cut - line).T)
        assert 0.5 < off.max() < tolerance + 0.3 and off[len(off) // 2] < 0.3  # its middle stays
        kinks = np.hypot(*np.diff(cut, n=2, axis=0).T) > 1e-6
        assert 1 <= kinks.sum() <= 3  # straight between


def test_an_l_is_cut_to_its_chord_only_where_its_corner_is_near_it():
    """Legs of 15 px: the corner is 15 / sqrt(2) = 10.6 px from the chord, and rounded less far."""
    line = np.concatenate([straight(6), straight(5, (35.0, 43.0), (0.0, 1.0))])
    got = deformations(planned(line))
    chord = np.linspace(line[0], line[-1], len(line))
    assert line + got["cut_12"] == pytest.approx(chord, abs=1e-6)
    assert np.abs(line + got["cut_3"] - chord).max() > 5


def test_a_straight_line_has_nothing_to_smooth_or_cut():
    got = deformations(planned(straight(60, towards=(0.8, 0.6))))
    for name in DEFORMATIONS:
        assert got[name] == pytest.approx(np.zeros((60, 2)), abs=1e-9)
    assert len(got) == len(SMOOTHINGS) + len(CUTS) + 1


# ------------------------------------------------------------------------------------------ inflate


def test_inflating_moves_along_the_surfaces_normals():
    line = arc(150.0, 200)
    outward = (line - 300.0) / 150.0
    got = deformations(planned(line), outward)["inflate"]
    damped = np.exp(-0.5 * (12.0 / 150.0) ** 2)  # blurred along the stroke by 12 px
    assert got[20:-20] == pytest.approx(damped * outward[20:-20], rel=1e-3, abs=1e-4)
    frame = replace(frame_of(planned(line)), deformations=np.stack([got], axis=1))
    radius = np.hypot(*(displaced(frame, np.array([5.0])) - 300.0).T)
    assert radius[20:-20] == pytest.approx(np.full(160, 150 + 5 * damped), abs=1e-2)


# ------------------------------------------------------------------------------------ ends, strokes


def test_what_lies_past_an_end_lies_straight_on_from_where_the_curve_is_moved_to():
    """An arc that is cut straight is overshot along its chord, not along its tangents."""
    line = arc(100.0, 28)  # of a sagitta below 12 px
    strokes = plan_strokes(Curves.from_list([line], [0]), STEP, max_overshoot=30.0)
    moves = deformations_of(strokes, np.zeros((len(strokes.xy), 2)), STEP)
    moved = strokes.xy + moves[:, DEFORMATIONS.index("cut_12")]
    chord = (line[-1] - line[0]) / np.hypot(*(line[-1] - line[0]))
    off = (moved - line[0]) @ [-chord[1], chord[0]]
    assert np.abs(off).max() < 0.3
    along = np.sort((moved - line[0]) @ chord)
    assert along[0] == pytest.approx(-30, abs=1)
    assert along[-1] == pytest.approx(np.hypot(*(line[-1] - line[0])) + 30, abs=1)
    # what is rounded off is overshot in the direction that it has then
    eased = strokes.xy + moves[:, DEFORMATIONS.index("smooth_24")]
    heading = eased[-11] - eased[-15]
    across = np.array([-heading[1], heading[0]]) / np.hypot(*heading)
    assert abs((eased[-1] - eased[-11]) @ across) < 1


def test_what_lies_past_an_end_has_no_say_in_the_rest():
    line = np.concatenate([straight(30), straight(30, (107.0, 43.0), (0.0, 1.0))])
    got = deformations_of(planned(line, past=4), np.zeros((60, 2)), STEP)
    inner = deformations_of(planned(line[4:-4]), np.zeros((52, 2)), STEP)
    assert got[4:-4, :-1] == pytest.approx(inner[:, :-1])


def test_strokes_do_not_mix():
    one, two = arc(100.0, 60), bump(8.0)
    together = deformations_of(planned(one, two), np.ones((60 + len(two), 2)), STEP)
    alone = [deformations_of(planned(line), np.ones((len(line), 2)), STEP) for line in (one, two)]
    assert np.array_equal(together, np.concatenate(alone))


def test_weights_of_the_deformations_add_up():
    frame = frame_of(planned(arc(100.0, 60)))
    basis = np.random.default_rng(1).normal(size=(60, 3, 2))
    got = displaced(replace(frame, deformations=basis), np.array([2.0, -1.0, 0.5]))
    assert got == pytest.approx(
        frame.xy + 2 * basis[:, 0] - basis[:, 1] + 0.5 * basis[:, 2], abs=1e-9
    )


def test_model_files_hold_the_weights_in_this_order():
    smooth, cut = ("smooth_3", "smooth_6", "smooth_12", "smooth_24"), ("cut_3", "cut_6", "cut_12")
    assert DEFORMATIONS == (*smooth, *cut, "inflate")


@pytest.mark.parametrize("at", [0, 1, 2])
def test_a_stroke_that_lies_past_its_curve_altogether_stays_and_moves_no_other(at):
    lines = [arc(60.0, 30), arc(90.0, 40, centre=(200.0, 250.0))]
    apart = [planned(line) for line in lines]
    lines.insert(at, straight(2))
    together = planned(*lines)
    beyond, first = np.zeros(len(together.xy)), together.offsets[at]
    beyond[first : first + 2] = 2.0, 5.0
    moved = deformations_of(replace(together, overshoot=beyond), np.zeros_like(together.xy), STEP)
    others = np.delete(moved, [first, first + 1], axis=0)
    assert (moved[first : first + 2] == 0).all()
    alone = [deformations_of(one, np.zeros_like(one.xy), STEP) for one in apart]
    assert others == pytest.approx(np.concatenate(alone), abs=1e-9)
