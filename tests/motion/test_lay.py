"""Strokes of a frame: what is thin, far or of two kinds must not make others spring."""

from dataclasses import replace

import numpy as np
import pytest

from strokestyle.motion.chance import Luck, TrackChance
from strokestyle.motion.lay import (
    between,
    kinds_of_tracks,
    lift_frame,
    steady_cuts,
    steady_ranges,
    visible_stretches,
)
from strokestyle.render.displacement import DEFORMATIONS
from strokestyle.render.overshoots import Overshoots
from strokestyle.render.style import MIN_VISIBLE, trim_invisible_ends
from tests.motion.moving import SIZE, a_frame, a_hand, a_line, laid_alone, straight


def test_an_end_that_fades_moves_little_by_little():
    row = np.arange(40.0)
    first = []
    for shift in np.linspace(0, 3, 31):
        thickness = np.clip(0.2 * (row - 10 - shift), 0, 2)
        at, offsets, kept = visible_stretches(thickness, np.array([0, 40]))
        assert offsets.tolist() == [0, len(at)] and kept.tolist() == [0]
        assert (np.diff(at) > 0).all() and at[-1] == 39
        first.append(at[0])
    # the crossing lies at 10 + shift + MIN_VISIBLE / .2, and a step before it is kept
    wanted = 9 + np.linspace(0, 3, 31) + MIN_VISIBLE / 0.2
    assert first == pytest.approx(wanted, abs=1e-9)


def test_what_is_seen_from_end_to_end_is_kept_as_it_is():
    thickness = np.array([1.0, 2, 1, 0.1, 0.1, 3, 0.1, 0, 0.6, 0.1, 1, 1])
    offsets = np.array([0, 3, 6, 10, 12])
    at, new, kept = visible_stretches(thickness, offsets)
    _, _, same = trim_invisible_ends(thickness, offsets)
    assert kept.tolist() == same.tolist() == [0, 3]
    assert at.tolist() == [0, 1, 2, 10, 11] and new.tolist() == [0, 3, 5]


def test_values_between_rows():
    values = np.array([[0.0, 1], [2, 3], [4, 9]])
    assert between(values, np.array([0, 0.5, 2])).tolist() == [[0, 1], [1, 2], [4, 9]]
    assert between(values[:, 0], np.array([1.25])).tolist() == [2.5]


def test_a_line_that_appears_does_not_move_what_height_is_measured_by():
    style = a_hand()
    low = a_line(1, straight(20, 170, 150))
    frames = [
        a_frame(style, low, *[a_line(2, straight(20, 170, 10))] * (i >= 6)) for i in range(12)
    ]
    tops = np.array([within.top for within in steady_ranges(frames, style.config.spacing)])
    assert tops[0] > 120 and tops[-1] < 40
    assert 0 < -np.diff(tops).min() < 0.15 * 140
    loop = np.array([within.top for within in steady_ranges(frames, style.config.spacing, True)])
    assert abs(loop[-1] - loop[0]) < 0.15 * 140  # nor from the last frame to the first
    empty = [a_frame(style), a_frame(style)]
    assert steady_ranges(empty, 3.0) == [None, None]
    assert steady_ranges([*empty, frames[0]], 3.0)[0] == pytest.approx(
        steady_ranges(frames[:1], 3.0)[0]
    )


def test_a_track_is_of_the_kind_of_most_of_its_points():
    style = a_hand()
    frames = [
        a_frame(
            style,
            a_line(3, straight(20, 20 + length, 50), kind=kind),
            a_line(4, straight(0, 60, 9)),
        )
        for length, kind in ((60, 2), (50, 5), (100, 5))
    ]
    assert kinds_of_tracks(frames) == {3: 5, 4: 0}
    assert kinds_of_tracks([a_frame(style)]) == {}


def test_a_frame_says_which_of_its_arrays_does_not_fit():
    frame = a_frame(a_hand(), a_line(1, straight(0, SIZE, 9)))
    with pytest.raises(ValueError, match="Frame.place must have shape"):
        replace(frame, place=frame.place[1:])


def test_places_of_ends_that_were_moved_are_those_of_where_they_are():
    past = np.array([4.4, 7.7, -5.2, 10.1], np.float32)
    style = a_hand(overshoots=Overshoots(past, past), residuals=None)
    lines = [a_line(track, straight(30, 150, 20 + 20 * track), 17.0) for track in range(6)]
    chance = TrackChance(Luck(2), style.config.spacing)
    laid = laid_alone(style, a_frame(style, *lines), chance)
    assert np.allclose(laid.place, laid.strokes.xy[:, 0] - 30 + 17)
    begins = laid.strokes.xy[laid.strokes.offsets[:-1], 0]
    assert len(set(np.round(30 - begins, 1))) > 1
    assert set(np.round(30 - begins, 1)) <= set(np.round(past.astype(float), 1))


def test_corners_of_lines_that_are_cut_straight_do_not_spring():
    style = a_hand(residuals=None, overshoots=None)
    style = replace(style, displacement=np.where(np.array(DEFORMATIONS) == "cut_6", 1.0, 0.0))
    x, frames = np.linspace(0, 1, 200), []
    for i in range(24):
        bow = np.sin(np.pi * x) * (22 + 0.25 * i) * (1 + 0.2 * np.sin(5 * x + 0.08 * i))
        frames.append(a_frame(style, a_line(0, np.stack([20 + 150 * x, 60 + bow], axis=1))))
    chance = TrackChance(Luck(0), style.config.spacing)
    lifted = [lift_frame(style, frame, i, {0: 0}, chance) for i, frame in enumerate(frames)]
    alone = [steady_cuts(style, [one])[0] for one in lifted]
    together = steady_cuts(style, lifted)

    def springs(cuts):
        count = min(map(len, cuts))
        return np.abs(np.diff([cut[:count] for cut in cuts], axis=0)).max()

    assert springs(alone) > 2.0 and springs(together) < 0.6 * springs(alone)
    mean = [np.abs(cuts[12]).mean() for cuts in (alone, together)]
    assert mean[1] == pytest.approx(mean[0], rel=0.3)  # it is still cut straight
