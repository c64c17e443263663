"""Strokes are chained of stretches of sheets, named and directed: sheets on a plate."""

import numpy as np

from strokestyle.motion.persist import Fate
from strokestyle.motion.sheets import BARE, Points
from strokestyle.motion.strokes import name_strokes
from tests.motion.plates import line, loose, sheet

LEFT, RIGHT = line([20, 60], [80, 60]), line([80, 60], [180, 60])


def strokes_of(*frames):
    """The strokes of frames of sheets that are drawn whole: of each frame, track -> points."""
    points = [Points.concatenate(list(sheets)) for sheets in frames]
    fates = [
        Fate(np.ones(len(p), bool), np.zeros(len(p), bool), np.zeros(len(p), bool)) for p in points
    ]
    named = name_strokes(points, fates)
    return [
        {stroke.track: p.xy[stroke.rows] for stroke in some}
        for p, some in zip(points, named, strict=True)
    ]


def one_plan(a, b):
    """Two sheets of which one planned stroke runs from the end of the first to the second."""
    return a, Points(**{**vars(b), "row": b.row - b.row[0] + a.row.max() + 1})


def test_ends_that_a_plan_runs_through_are_one_stroke_and_others_are_not():
    together = one_plan(sheet(1, LEFT), sheet(2, RIGHT))
    (frame,) = strokes_of(together)
    assert len(frame) == 1 and len(frame[0]) == len(LEFT) + len(RIGHT) - 1
    (frame,) = strokes_of((sheet(1, LEFT), sheet(2, RIGHT)))
    assert len(frame) == 2


def test_what_two_plans_say_of_one_meeting_holds_for_all_the_time():
    apart, together = (sheet(1, LEFT), sheet(2, RIGHT)), one_plan(sheet(1, LEFT), sheet(2, RIGHT))
    for plans, count in (([1, 1, 0, 1], 1), ([0, 1, 0, 0], 2)):
        frames = strokes_of(*(together if yes else apart for yes in plans))
        assert [len(frame) for frame in frames] == [count] * 4
        assert all(set(frame) == set(frames[0]) for frame in frames)


def test_a_stroke_keeps_its_direction_though_a_longer_piece_runs_the_other_way():
    # the right one's sheet runs to the left: chained, it would be drawn from right to left
    against = sheet(2, RIGHT, np.arange(len(RIGHT))[::-1] * 3.0)
    both = one_plan(sheet(1, LEFT), against)
    frames = strokes_of((sheet(1, LEFT),), both, both)
    assert all(set(frame) == {0} for frame in frames)
    for frame in frames:
        assert frame[0][-1, 0] > frame[0][0, 0]
    (new,) = strokes_of(both)
    assert new[0][-1, 0] < new[0][0, 0]  # what begins so is drawn as its longest piece


def test_a_stroke_does_not_turn_back_where_its_pieces_meet():
    over = np.concatenate([LEFT, LEFT[-1] + [[4, 2], [1, 3]]])  # an end past the meeting, and back
    first = loose(sheet(1, over), [-2, -1], BARE)
    (frame,) = strokes_of(one_plan(first, sheet(1, RIGHT, 70.0 + RIGHT[:, 0])))
    (xy,) = frame.values()
    step = np.diff(xy, axis=0)
    assert ((step[1:] * step[:-1]).sum(axis=1) > 0).all()
    assert xy[0, 0] == 20 and xy[-1, 0] == 180
