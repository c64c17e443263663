"""A turn whose end goes over into its beginning: strokes go over where both have the same."""

import numpy as np
import pytest

from strokestyle.motion.close import close
from strokestyle.motion.compose import Composed
from strokestyle.motion.places import Places

AHEAD, COUNT = 6, 12


def stroke(track, low, high, y=0.0, shift=0.0):
    """A stroke of a track from x = low to high."""
    xy = np.stack([np.arange(low, high + 1.0, 3.0), np.full((high - low) // 3 + 1, y)], axis=1)
    flat = np.zeros(len(xy))
    places = Places(flat.astype(int), np.zeros((len(xy), 3)), np.zeros((len(xy), 2)))
    return Composed(track, 0, xy, places, flat.astype(int), xy[:, 0] + shift, flat + 1)


def frames(of):
    """What `of` gives for each frame, before the turn, in it and after."""
    return [of(t) for t in range(-AHEAD, COUNT + AHEAD)]


def beginnings(turn):
    return [[float(s.xy[0, 0]) for s in sorted(some, key=lambda s: s.xy[0, 1])] for some in turn]


def test_a_stroke_goes_over_where_it_begins_at_one_place():
    # the same line, drawn from 0 on at first and from 60 on in the end; at frame 2 both from 30 on
    def of(t):
        late = t > COUNT // 2
        k = t - COUNT if late else t
        return [
            stroke(5 if late else 1, 30 if k == 2 else (60 if late else 0), 150, shift=9 * late)
        ]

    turn = close(frames(of), AHEAD, COUNT)
    assert beginnings(turn) == [[60.0]] * 2 + [[30.0]] + [[0.0]] * 4 + [[60.0]] * 5
    # by one name, and at the same places on both sides
    assert turn[1][0].track == turn[2][0].track == 5
    assert turn[1][0].place[0] == 69 and turn[2][0].place[0] == pytest.approx(39)


def test_strokes_go_over_each_in_its_own_frame():
    def of(t):
        late = t > COUNT // 2
        k = t - COUNT if late else t
        lows = [30 if k == at else (60 if late else 0) for at in (-2, 1)]
        return [stroke(10 * late + i, low, 150, y=50.0 * i) for i, low in enumerate(lows)]

    low, high = zip(*beginnings(close(frames(of), AHEAD, COUNT)), strict=True)
    assert low == (0,) * 7 + (60,) * 3 + (30,) + (0,)
    assert high == (60,) + (30,) + (0,) * 5 + (60,) * 5


def test_what_covers_one_another_goes_over_together():
    # one stroke in the end, two in the beginning: never both, and never none
    def of(t):
        if t > COUNT // 2:
            return [stroke(7, 0, 150)]
        return [stroke(1, 0, 72), stroke(2, 78, 150)]

    turn = close(frames(of), AHEAD, COUNT)
    for some in turn:
        drawn = np.concatenate([s.xy[:, 0] for s in some])
        assert len(np.unique(drawn)) == len(drawn) >= 50
    assert [len(some) for some in turn] == [2] * 7 + [1] * 5


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_turn_of_few_frames_closes(count):
    some = [[stroke(1, 0, 60), stroke(100 + t, 0, 60, y=40.0)] for t in range(3 * count)]
    turn = close(some, count, count)
    assert len(turn) == count and all({s.track for s in one} >= {1} for one in turn)
    assert all(len({s.track for s in one}) == len(one) == 2 for one in turn)
    assert len(close(some[:count], 0, count)) == count
