"""Every feature in closed form: on a line, an arc, an L, and under surfaces that are known."""

import numpy as np
import pytest
from known_law import planned
from scipy.ndimage import gaussian_filter1d
from scipy.special import ndtr

from strokestyle.extract.camera import Camera
from strokestyle.extract.feature_maps import FeatureMaps
from strokestyle.extract.view import View
from strokestyle.geometry.curves import KINDS, Curves, blurred
from strokestyle.render.config import StyleConfig
from strokestyle.render.features import (
    FEATURES,
    NIB_ANGLES,
    SURFACE,
    FeatureScaling,
    along_strokes,
    curvature,
    plan,
    point_features,
    surface_at,
)

CONFIG = StyleConfig()
STEP = 3.0  # px between points, CONFIG.spacing


def straight(count, start=(20.0, 40.0), towards=(1.0, 0.0)):
    return np.array(start) + STEP * np.arange(count)[:, None] * np.array(towards)


def arc(radius, count, turn=1.0, centre=(200.0, 200.0)):
    angle = turn * STEP / radius * np.arange(count)
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def features(strokes, surface=None):
    """{name: (N,)} of strokes over a surface (N, 5), by default one that is nothing."""
    surface = np.zeros((len(strokes.xy), len(SURFACE))) if surface is None else surface
    return dict(zip(FEATURES, point_features(strokes, surface, CONFIG).T, strict=True))


# --------------------------------------------------------------------------------- between the ends


def test_along_a_straight_line_that_runs_past_its_ends():
    strokes = planned(straight(109), past=4)  # 300 px between its ends
    got, s = features(strokes), STEP * (np.arange(109) - 4.0)
    assert got["before"] == pytest.approx(np.maximum(-s, 0) / 24)
    assert got["after"] == pytest.approx(np.maximum(s - 300, 0) / 24)
    assert got["past_start"].tolist() == (s < 0).tolist()
    assert got["past_end"].tolist() == (s > 300).tolist()
    assert got["along"] == pytest.approx(np.clip(s / 300, 0, 1))
    assert got["log_length"] == pytest.approx(np.full(109, np.log(3.0)))
    for scale, decay in ((10, 10.0), (40, 40.0), (120, 90.0)):  # 120 px is more than 0.3 of it
        assert got[f"start_{scale}"] == pytest.approx(np.exp(-np.maximum(s, 0) / decay))
        assert got[f"end_{scale}"] == pytest.approx(np.exp(-np.maximum(300 - s, 0) / decay))
    for name in ("bend_6", "bend_14", "turn_6", "turn_14", "height"):
        assert got[name] == pytest.approx(np.zeros(109), abs=1e-9)


def test_each_stroke_has_its_own_ends_and_length():
    strokes = planned(straight(31), straight(11, (20.0, 90.0)))  # 90 px and 30 px
    got, s = features(strokes), np.r_[STEP * np.arange(31), STEP * np.arange(11)]
    length = np.repeat([90.0, 30.0], [31, 11])
    assert got["log_length"] == pytest.approx(np.log(length / 100))
    assert got["along"] == pytest.approx(s / length)
    for scale in (10, 40, 120):
        decay = np.minimum(scale, 0.3 * length)
        assert got[f"start_{scale}"] == pytest.approx(np.exp(-s / decay))
        assert got[f"end_{scale}"] == pytest.approx(np.exp(-(length - s) / decay))


# -------------------------------------------------------------------------------------------- bends


@pytest.mark.parametrize("turn, sign", [(1.0, 1.0), (-1.0, -1.0)])
def test_the_curvature_of_a_circle_is_one_over_its_radius(turn, sign):
    """With y down, angles that grow turn clockwise, which is towards (-t_y, t_x)."""
    for radius in (60.0, 150.0):
        strokes = planned(arc(radius, 80, turn))
        for sigma in (6.0, 14.0):
            k = curvature(strokes, sigma, STEP)
            assert k[25:-25] == pytest.approx(np.full(30, sign / radius), rel=1e-6)


def test_bends_of_an_arc():
    """A radius of 60 px: 20 / 60 and 45 / 60 of the radii at which a bend counts half."""
    for turn in (1.0, -1.0):
        got = features(planned(arc(60.0, 80, turn)))
        inner = slice(25, -25)
        assert got["bend_6"][inner] == pytest.approx(np.full(30, 0.1), rel=1e-6)
        assert got["turn_6"][inner] == pytest.approx(np.full(30, turn / np.sqrt(10)), rel=1e-6)
        assert got["bend_14"][inner] == pytest.approx(np.full(30, 0.36), rel=1e-6)
        assert got["turn_14"][inner] == pytest.approx(np.full(30, turn * 0.6), rel=1e-6)


def test_an_l_turns_by_a_right_angle_at_its_corner():
    there = straight(60, (20.0, 20.0))
    for down in (1.0, -1.0):
        back = straight(60, there[-1] + [0.0, down * STEP], (0.0, down))
        strokes = planned(np.concatenate([there, back]))
        for sigma in (6.0, 14.0):
            k = curvature(strokes, sigma, STEP)
            assert abs(int(np.abs(k).argmax()) - 59.5) <= 1
            assert k.sum() * STEP == pytest.approx(down * np.pi / 2, rel=1e-3)
        got = features(strokes)
        assert got["bend_6"].argmax() in (59, 60) and got["bend_6"].max() > 0.5
        assert (np.sign(got["turn_6"][55:65]) == down).all()
        assert got["bend_6"][:30].max() < 1e-9 and got["bend_6"][-30:].max() < 1e-9


def test_at_its_ends_a_curve_is_measured_over_one_step():
    """There the heading is that of a chord, half a step further than the tangent."""
    k = curvature(planned(arc(60.0, 30)), 1e-3, STEP)
    assert k[[0, -1]] == pytest.approx([0.5 / 60, 0.5 / 60], rel=1e-3)
    assert k[2:-2] == pytest.approx(np.full(26, 1 / 60), rel=1e-6)


# ------------------------------------------------------------------------------------------ surface


def test_depth_is_told_within_the_middle_of_its_range_on_the_curves():
    """101 strokes of 3 points, at depths 0, 1 ... 100: the 3rd and 97th percentile are 3 and 97."""
    lines = [straight(3, (20.0, 5.0 * i)) for i in range(101)]
    lines[0] = straight(203, (20.0, 0.0))
    strokes = planned(*lines)
    overshoot = strokes.overshoot.copy()
    overshoot[3:203] = 3.0 * np.arange(1, 201)  # points past an end do not count
    strokes = type(strokes)(
        strokes.xy, strokes.offsets, strokes.kind, strokes.source, strokes.mix, overshoot
    )
    depth = np.repeat(np.arange(101.0), np.diff(strokes.offsets))
    surface = np.zeros((len(depth), 5))
    surface[:, 0] = 7.0 + 2.0 * depth
    got = features(strokes, surface)
    assert got["depth"] == pytest.approx(np.clip((depth - 3) / 94, 0, 1))


def test_the_surface_is_blurred_along_the_stroke():
    strokes = planned(straight(60))
    surface = np.zeros((60, 5))
    surface[30:, 1], surface[30:, 2] = 0.5, -8.0
    step = ndtr((np.arange(60) - 29.5) / (6.0 / STEP))
    got = features(strokes, surface)
    assert got["n_dot_v"] == pytest.approx(0.5 * step, abs=2e-3)
    assert got["view_curvature"] == pytest.approx(-8.0 * step, abs=0.04)


def test_facing_is_the_normals_direction_where_it_has_one():
    normals = np.array([[0.6, 0.8], [0.0, 0.0], [0.1, 0.0], [0.0, -0.2]])
    strokes = planned(*[straight(5, (20.0, 30.0 * i)) for i in range(4)])
    surface = np.zeros((20, 5))
    surface[:, 3:] = np.repeat(normals, 5, axis=0)
    got = features(strokes, surface)
    wanted = normals / np.sqrt([[1.04], [0.04], [0.05], [0.08]])
    assert got["facing_x"] == pytest.approx(np.repeat(wanted[:, 0], 5))
    assert got["facing_y"] == pytest.approx(np.repeat(wanted[:, 1], 5))


# -------------------------------------------------------------------------------------------- place


def test_a_nib_is_felt_alike_forth_and_back():
    degrees = np.array([0.0, 30.0, 45.0, 90.0, 120.0])
    for turn in (0.0, 180.0):
        for heading in degrees:
            a = np.radians(heading + turn)
            got = features(planned(straight(30, (200.0, 200.0), (np.cos(a), np.sin(a)))))
            for nib in NIB_ANGLES:
                wanted = np.cos(np.radians(2 * (heading - nib)))
                assert got[f"nib_{nib:.0f}"] == pytest.approx(np.full(30, wanted))


def test_height_runs_from_the_highest_curve_to_the_lowest():
    low, high = straight(20, (20.0, 300.0)), straight(41, (20.0, 100.0), (0.0, 1.0))
    strokes = planned(low, high, past=3)  # the upright one is 111 to 211 but for its ends
    got = features(strokes)
    assert got["height"] == pytest.approx(
        np.r_[np.ones(20), np.clip((100 + STEP * np.arange(41) - 109) / (300 - 109), 0, 1)]
    )


def test_tangents_point_along_the_stroke():
    strokes = planned(straight(30, towards=(0.6, -0.8)), arc(150.0, 60))
    got = features(strokes)
    tangent = np.stack([got["tangent_x"], got["tangent_y"]], axis=1)
    assert tangent[:30] == pytest.approx(np.tile([0.6, -0.8], (30, 1)))
    angle = STEP / 150 * np.arange(60)
    around = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    assert tangent[40:80] == pytest.approx(around[10:50], abs=1e-6)


def test_prominence_is_that_of_the_kind():
    kinds = ["contour", "boundary", "crease", "valley", "intersection", "other"]
    strokes = planned(*[straight(4, (20.0, 20.0 * i)) for i in range(6)])
    numbers = np.array([KINDS.index(kind) for kind in kinds], np.int8)
    strokes = type(strokes)(
        strokes.xy, strokes.offsets, numbers, strokes.source, strokes.mix, strokes.overshoot
    )
    got = features(strokes)
    assert got["prominence"] == pytest.approx(np.repeat([1, 1, 0.5, 0, 0.5, 0], 4))


def test_no_strokes_have_no_features():
    none = plan(a_view([], []), CONFIG)
    assert point_features(none, np.zeros((0, 5)), CONFIG).shape == (0, len(FEATURES))


def test_scaling_cuts_centres_and_spreads():
    scaling = FeatureScaling(*np.array([[-1.0, 0.0], [2.0, 5.0], [0.5, 2.0], [0.5, 4.0]]))
    got = scaling(np.array([[-9.0, -9.0], [1.0, 4.0], [9.0, 9.0]]))
    assert got.tolist() == [[-3.0, -0.5], [1.0, 0.5], [3.0, 0.75]]


# ------------------------------------------------------------------------------------ from the view

SIZE = 200


def a_view(lines, kinds, **maps):
    """A view of lines over maps (H, W) by name; those that are not given are 0, and depth 1."""
    zero = np.zeros((SIZE, SIZE))
    values = [maps.get(name, zero + (name == "depth")) for name in SURFACE]
    camera = Camera([0, 0, 3], [0, 0, 0], [0, 1, 0], 30, SIZE, SIZE)
    curves = Curves.from_list(lines, [KINDS.index(kind) for kind in kinds])
    return View(camera, curves, FeatureMaps(SURFACE, np.stack(values), zero == 0))


def test_the_surface_is_read_on_both_sides_of_a_line_and_on_it():
    row, column = np.mgrid[:SIZE, :SIZE] / SIZE
    level, upright = straight(30, (50.25, 80.5)), straight(30, (150.5, 50.0), (0.0, 1.0))
    view = a_view([level, upright], ["crease", "crease"], n_dot_v=row**2, normal_x=column**2)
    got = surface_at(view, STEP)
    assert got.shape == (60, 5) and got[:, 0] == pytest.approx(np.ones(60))
    rows = np.array([79, 80, 82]) / SIZE  # 80.5 - 1.5, 80.5, 80.5 + 1.5
    assert got[:30, 1] == pytest.approx(np.full(30, (rows**2).mean()), rel=1e-5)
    columns = np.array([149, 150, 152]) / SIZE
    assert got[30:, 3] == pytest.approx(np.full(30, (columns**2).mean()), rel=1e-5)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_contours_normal_lies_across_it_out_of_the_shape(turn):
    """Even where the maps' normals are oblique, and wrong in places: the side is voted on."""
    middle, radius = np.array([100.0, 100.0]), 60.0
    line = arc(radius, 100, turn, middle)
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    away = np.stack([x - middle[0], y - middle[1]])
    away /= np.maximum(np.hypot(*away), 1.0)
    oblique = np.array([[0.8, -0.6], [0.6, 0.8]])
    nx, ny = np.einsum("ij,jhw->ihw", oblique, away)
    wrong = np.hypot(x - line[50, 0], y - line[50, 1]) < 4
    nx, ny = np.where(wrong, -nx, nx), np.where(wrong, -ny, ny)
    flat = np.full((SIZE, SIZE), 0.7)
    maps = {"n_dot_v": flat, "normal_x": nx, "normal_y": ny, "view_curvature": flat}
    got = surface_at(a_view([line], ["contour"], **maps), STEP)
    outward = (line - middle) / radius
    assert got[1:-1, 3:] == pytest.approx(outward[1:-1], abs=1e-6)
    assert not got[:, 1].any() and got[:, 2] == pytest.approx(np.full(100, 0.7))
    crease = surface_at(a_view([line], ["crease"], **maps), STEP)
    assert crease[:, 1] == pytest.approx(np.full(100, 0.7))
    assert np.abs(crease[5:40, 3:] - outward[5:40] @ oblique.T).max() < 0.05


def test_a_plan_is_made_in_pixels_of_the_styles_canvas():
    view = a_view([straight(40)], ["ridge"])
    once, half = plan(view, CONFIG), plan(view, CONFIG, 2.0)
    assert np.ptp(once.xy[once.on_curve, 0]) == pytest.approx(117)
    assert np.ptp(half.xy[half.on_curve, 0]) == pytest.approx(58.5)
    assert half.xy[half.on_curve, 1] == pytest.approx(20.0)
    assert half.overshoot.max() == pytest.approx(24) == once.overshoot.max()


# ------------------------------------------------------------------------------------ along strokes


def test_a_gaussian_along_strokes_mixes_no_two_and_keeps_pinned_ends():
    offsets = np.array([0, 30, 60])
    values = np.repeat([1.0, 5.0], 30)
    assert np.array_equal(along_strokes(values, offsets, 9.0, STEP), values)
    wave = np.exp(1j * 0.2 * np.arange(60)).view(float).reshape(-1, 2)
    got = along_strokes(wave, np.array([0, 60]), 6.0, STEP)  # a Gaussian of 2 points
    damped = np.exp(-0.5 * (0.2 * 2.0) ** 2)
    assert got[10:-10] == pytest.approx(damped * wave[10:-10], rel=1e-3)
    pinned = along_strokes(wave, np.array([0, 60]), 6.0, STEP, pin=True)
    assert pinned[[0, -1]] == pytest.approx(wave[[0, -1]])
    assert pinned[10:-10] == pytest.approx(damped * wave[10:-10], rel=1e-3)
    assert np.abs(got[0] - wave[0]).max() > 0.05  # not pinned, it does move


@pytest.mark.parametrize("pin", [False, True])
@pytest.mark.parametrize("sigma", [1.5, 12.0, 90.0])
def test_strokes_are_blurred_all_at_once_as_one_by_one(pin, sigma):
    rng = np.random.default_rng(3)
    offsets = np.r_[0, np.cumsum([2, 30, 1, 7, 120, 3])]
    values = rng.normal(size=(offsets[-1], 2))
    one_by_one = [
        blurred(values[a:b], sigma / 3.0)
        if pin
        else gaussian_filter1d(values[a:b], sigma / 3.0, axis=0, mode="nearest")
        for a, b in zip(offsets[:-1], offsets[1:], strict=True)
    ]
    at_once = along_strokes(values, offsets, sigma, 3.0, pin)
    assert np.array_equal(at_once, np.concatenate(one_by_one))
