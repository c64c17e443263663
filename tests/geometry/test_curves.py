"""Ragged polylines: resampling and friends in closed form, and the zoo of degenerate lines."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from strokestyle.geometry import curves as curves_module
from strokestyle.geometry.curves import (  # fmt: skip
    KINDS,
    Curves,
    arc_length,
    blocks,
    blurred,
    counting,
    gaussian,
    is_kind,
    owner,
    resample,
    resample_curves,
    resample_with_source,
    runs,
    simplify,
    simplify_all,
    take_ragged,
    tangents,
)

ZOO = {
    "empty": [],
    "two equal points": [[[5, 5], [5, 5]]],
    "one segment": [[[0, 0], [10, 0]]],
    "repeated points": [[[0, 0], [0, 0], [1, 0], [1, 0], [9, 0]]],
    "hairpin": [[[0, 0], [10, 0], [0, 0]]],
    "many": [[[0, 0], [1, 1]], [[3, 3], [3, 3], [3, 3]], [[0, 0], [50, 0], [50, 50], [0, 0]]],
}


@pytest.mark.parametrize("lines", ZOO.values(), ids=ZOO)
def test_the_zoo_stays_finite(lines):
    curves = Curves.from_list(lines)
    even = resample_curves(curves, 3.0)
    assert len(even) == len(curves)
    assert np.isfinite(even.xy).all()
    assert np.isfinite(tangents(even.xy, even.offsets, even.closed)).all()
    assert np.allclose(even.xy[even.offsets[:-1]], curves.xy[curves.offsets[:-1]])
    assert np.allclose(even.xy[even.offsets[1:] - 1], curves.xy[curves.offsets[1:] - 1])


def test_resample_is_even_and_keeps_the_ends():
    angle = np.linspace(0, 1.5 * np.pi, 1000)
    circle = 100 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    xy, offsets, (carried,) = resample(circle, np.array([0, 1000]), 3.0, angle)
    step = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    assert np.ptp(step) < 0.01 and abs(step.mean() - 3) < 0.02
    assert np.array_equal(xy[[0, -1]], circle[[0, -1]])
    assert np.allclose(np.linalg.norm(xy, axis=1), 100, atol=0.01)
    assert np.allclose(carried, np.arctan2(xy[:, 1], xy[:, 0]) % (2 * np.pi), atol=1e-3)


def test_curves_do_not_leak_into_each_other():
    apart = [np.array([[0.0, 0], [30, 0]]), np.array([[1000.0, 0], [1000, 60]])]
    both = resample_curves(Curves.from_list(apart), 3.0)
    for i, line in enumerate(apart):
        assert np.allclose(both[i], resample_curves(Curves.from_list([line]), 3.0).xy)


def test_arc_length_and_owner():
    curves = Curves.from_list([[[0, 0], [3, 4], [3, 5]], [[0, 0], [0, 2]]])
    assert np.allclose(arc_length(curves.xy, curves.offsets), [0, 5, 6, 0, 2])
    assert owner(curves.offsets).tolist() == [0, 0, 0, 1, 1]
    assert curves.lengths().tolist() == [6, 2]


def test_closed_tangents_wrap():
    square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    t = tangents(square, np.array([0, 5]), np.array([True]))
    assert np.allclose(t[0], t[-1]) and np.allclose(t[0], np.array([1, -1]) / np.sqrt(2))


def test_take():
    curves = Curves.from_list(
        [[[0, 0], [1, 0]], [[2, 0], [3, 0], [4, 0]], [[5, 0], [6, 0]]], kind=[0, 1, 2]
    )
    got = curves.take([2, 1])
    assert got.xy[:, 0].tolist() == [5, 6, 2, 3, 4] and got.kind.tolist() == [2, 1]
    assert got.offsets.tolist() == [0, 2, 5]
    assert curves.take(curves.kind == 9).xy.shape == (0, 2)
    assert take_ragged(curves.offsets, np.array([], int))[1].tolist() == [0]


def test_simplify_keeps_corners():
    line = np.array([[0, 0], [1, 0.01], [2, 0], [3, 5], [4, 10]], float)
    assert simplify(line, 0.1).tolist() == [0, 2, 4]
    assert simplify(line, 100).tolist() == [0, 4]


@pytest.mark.parametrize(
    "parts, word",
    [
        ((np.zeros((2, 3)), [0, 2], [0], [False]), r"shape \(N, 2\), got \(2, 3\)"),
        ((np.full((2, 2), np.nan), [0, 2], [0], [False]), "finite"),
        ((np.zeros((2, 2)), [0, 1, 2], [0, 0], [False, False]), "at least 2"),
        ((np.zeros((2, 2)), [0, 3], [0], [False]), "from 0 to 2"),
        ((np.zeros((2, 2)), [0, 2], [0, 1], [False]), r"shape \(1,\)"),
        ((np.zeros((2, 2)), [0, 2], [99], [False]), "kind"),
    ],
)
def test_what_is_no_curves_is_refused(parts, word):
    with pytest.raises(ValueError, match=word):
        Curves(*parts)


def test_simplify_all_keeps_of_each_what_simplify_keeps(monkeypatch):
    rng = np.random.default_rng(0)
    lines = [np.cumsum(rng.normal(size=(n, 2)), axis=0) for n in (2, 3, 40, 200)] + [
        np.zeros((5, 2))
    ]
    lines.append(np.concatenate([lines[2], lines[2][:1]]))  # closed: the chord is a point
    offsets = np.cumsum([0] + [len(line) for line in lines])
    keep = simplify_all(np.concatenate(lines), offsets, 0.8)
    for line, a, b in zip(lines, offsets[:-1], offsets[1:], strict=True):
        assert np.flatnonzero(keep[a:b]).tolist() == simplify(line, 0.8).tolist()
    apart = simplify_all(np.concatenate(lines), offsets, np.r_[0.8, 0.8, 5.0, 0.8, 0.8, 0.8])
    assert apart[offsets[2] : offsets[3]].sum() < keep[offsets[2] : offsets[3]].sum()
    assert simplify_all(np.zeros((0, 2)), np.zeros(1, int), 1.0).shape == (0,)
    monkeypatch.setattr(curves_module, "CACHED", 5)  # a block for nearly every line
    in_blocks = simplify_all(np.concatenate(lines), offsets, np.r_[0.8, 0.8, 5.0, 0.8, 0.8, 0.8])
    np.testing.assert_array_equal(in_blocks, apart)


@pytest.mark.parametrize("shape", [(0,), (1,), (5,), (200,), (0, 2), (1, 2), (40, 3), (7, 1)])
@pytest.mark.parametrize("sigma", [0.05, 0.8, 6.0])
def test_a_gaussian_is_that_of_scipy(shape, sigma):
    values = np.random.default_rng(2).normal(size=shape)
    found = gaussian(values, sigma)
    expected = gaussian_filter1d(values, sigma, axis=0, mode="nearest") if len(values) else values
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("size", [1, 3, 4, 7, 100])
def test_blocks_hold_every_piece_once_and_about_as_many_rows(size):
    offsets = np.cumsum([0, 2, 0, 3, 1, 9, 1, 1, 0, 4])
    few = blocks(offsets, size)
    assert [i for part in few for i in range(9)[part]] == list(range(9))
    rows = [offsets[part.stop] - offsets[part.start] for part in few]
    assert max(rows) < 1.5 * size + 9
    assert blocks(np.zeros(1, int), size) == []


def test_a_blur_keeps_straight_lines_and_ends_and_shrinks_a_circle_as_the_formula_says():
    line = np.stack([np.arange(30.0), 3 - 2 * np.arange(30.0)], axis=1)
    assert blurred(line, 2.5) == pytest.approx(line)
    wave = np.stack([np.arange(60.0), np.sin(np.arange(60.0))], axis=1)
    soft = blurred(wave, 4.0)
    assert soft[[0, -1]] == pytest.approx(wave[[0, -1]])
    assert (
        np.abs(soft[15:45, 1]).max() < 0.01
    )  # a wave of 1 radian a point, times exp(-sigma^2 / 2)
    angle = np.linspace(0, 2 * np.pi, 101)
    circle = 10 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    round_it = blurred(circle, 5.0, closed=True)
    assert np.hypot(*round_it.T) == pytest.approx(
        10 * np.exp(-0.5 * (2 * np.pi * 5 / 100) ** 2), rel=1e-3
    )
    assert blurred(line[:1], 9.0) == pytest.approx(line[:1])
    assert blurred(line[:2], 9.0).mean(axis=0) == pytest.approx(
        line[:2].mean(axis=0)
    )  # shrinks, but about its middle


def test_counting_starts_anew_with_each_number():
    assert counting(np.array([3, 0, 1, 2])).tolist() == [0, 1, 2, 0, 0, 1]
    assert counting(np.zeros(0, int)).tolist() == []


def test_runs_end_where_any_value_changes():
    flag = np.array([True, True, False, False, False, True])
    curve = np.array([0, 0, 0, 0, 1, 1])
    assert runs(flag).tolist() == [0, 2, 5, 6]
    assert runs(flag, curve).tolist() == [0, 2, 4, 5, 6]
    assert runs(curve, flag).tolist() == [0, 2, 4, 5, 6]
    assert runs(np.zeros(3)).tolist() == [0, 3] and runs(np.array([7])).tolist() == [0, 1]
    assert runs(np.zeros(0, bool)).tolist() == [0]


def test_is_kind_knows_kinds_by_their_names():
    kind = np.array([KINDS.index(name) for name in ("ridge", "contour", "other")], np.int8)
    assert is_kind(kind, ("ridge", "other")).tolist() == [True, False, True]
    assert not is_kind(kind, ()).any()


def test_resampled_points_know_the_nearest_given_one():
    rng = np.random.default_rng(3)
    curves = Curves.from_list([np.cumsum(rng.uniform(0.2, 5, (n, 2)), axis=0) for n in (2, 9, 40)])
    made, source = resample_with_source(curves, 1.5)
    assert np.array_equal(made.xy, resample_curves(curves, 1.5).xy)
    # the same curve, and no row of it is nearer along it
    assert np.array_equal(owner(curves.offsets)[source], owner(made.offsets))
    ends = np.r_[made.offsets[:-1], made.offsets[1:] - 1]
    assert np.array_equal(source[ends], np.r_[curves.offsets[:-1], curves.offsets[1:] - 1])
    place = arc_length(curves.xy, curves.offsets)
    for curve in range(len(curves)):
        rows = slice(*curves.offsets[curve : curve + 2])
        own = source[slice(*made.offsets[curve : curve + 2])]
        at = np.linspace(0.0, place[rows][-1], len(own))
        between = np.interp(at, place[rows], np.arange(len(place[rows])))
        assert np.abs(own - curves.offsets[curve] - between).max() <= 0.5
