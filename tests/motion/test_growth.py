"""How strokes grow in and taper off: told where they appear and vanish, what of them is drawn."""

import numpy as np
import pytest

from strokestyle.motion.growth import grow
from strokestyle.motion.persist import Fate
from strokestyle.motion.strokes import Stroke

POINTS, STEP = 40, 4.0  # of one line, px


def drawn(tracks, appears, vanishes):
    """How many points of the line are drawn in each frame: its one stroke has the names `tracks`,
    and appears or vanishes in those frames."""
    rows, place = np.arange(POINTS), STEP * np.arange(POINTS)
    frames = [[Stroke(track, rows, np.zeros(POINTS, int), place)] for track in tracks]
    fates = [
        Fate(np.ones(POINTS, bool), np.full(POINTS, t in appears), np.full(POINTS, t in vanishes))
        for t in range(len(tracks))
    ]
    grown = grow(frames, [[place] for _ in tracks], fates)
    return [sum(len(one.rows) for one in some) for some in grown]


def test_a_line_that_has_another_name_for_one_frame_is_drawn_in_that_frame():
    assert drawn([3, 3, 8, 3, 3], appears=[], vanishes=[]) == [POINTS] * 5


@pytest.mark.parametrize("appears, vanishes", [([2], [2]), ([2], []), ([], [2])])
def test_a_line_that_flashes_for_one_frame_is_not_drawn_in_that_frame(appears, vanishes):
    assert drawn([3, 3, 8, 3, 3], appears, vanishes) == [POINTS, POINTS, 0, POINTS, POINTS]


def test_what_appears_grows_in_and_what_vanishes_tapers_off():
    counts = drawn([3] * 24, appears=[0], vanishes=[23])
    assert counts[0] < 0.2 * POINTS and counts[-1] < 0.2 * POINTS
    assert max(counts) == POINTS
    assert np.abs(np.diff(counts)).max() < 0.5 * POINTS
