"""Where strokes begin and end on lines that lie beside them."""

import numpy as np
import pytest
from known_law import level, planned

from strokestyle.fit.ends import MIN_ENDS, MOST_SLIDE, slide_ends

PAST = 8  # points of overshoot at either end, 24 px
X = np.arange(20, 320, 3.0)  # 74 points between the overshoots: 249 px
FIRST, LAST = X[PAST], X[-1 - PAST]


def slid(spans, off=5.0, hidden=(), scale=1.0):
    """How far the ends of level lines move outwards, whose ink is spans (from, to) of x: (C, 2)."""
    strokes = planned(*(level(20.0 * k, 20, 320) for k in range(len(spans))), past=PAST)
    x = strokes.xy[:, 0].reshape(len(spans), -1)
    found = np.array([(row > a) & (row < b) for row, (a, b) in zip(x, spans, strict=True)])
    bare = ~found
    for k in hidden:
        bare[k] = False
    out = slide_ends(strokes.xy, found.ravel(), bare.ravel(), strokes, off, 3.0, scale)
    assert (out[:, 1] == strokes.xy[:, 1]).all()  # along the line only
    assert (np.diff(out[:, 0].reshape(len(spans), -1), axis=1) > 0).all()  # and none overtakes
    moved = out[:, 0].reshape(len(spans), -1) - x
    middle = moved[:, len(X) // 2]
    assert np.abs(middle).max() < 1e-9
    assert np.ptp(moved[:, : PAST + 1], axis=1).max() < 1e-9  # what is past an end goes with it
    return np.stack([-moved[:, PAST], moved[:, -1 - PAST]], axis=1)


def test_ends_slide_to_where_the_ink_ends():
    ink = (FIRST - 7.5, LAST - 4.5)
    assert slid([ink], off=20.0) == pytest.approx(np.array([[7.5, -4.5]]), abs=1.6)


def test_what_all_ends_do_is_manner():
    count = MIN_ENDS // 2 + 1
    every = [(FIRST - 7.5, LAST + 7.5)] * count
    assert np.abs(slid(every)).max() < 1e-9
    one = slid([*every, (FIRST - 1.5, LAST + 7.5)])
    assert one[-1] == pytest.approx([-6.0, 0.0], abs=1e-6) and np.abs(one[:-1]).max() < 1e-9


def test_strokes_that_lie_right_end_as_the_artist_meant():
    """Ends that vary by more than the strokes lie off are the manner, but for that much."""
    assert np.abs(slid([(FIRST - 9, LAST + 9), (FIRST + 9, LAST - 9)], off=0.0)).max() < 1e-9
    part = slid([(FIRST - 9.1, LAST + 9.1), (FIRST + 9.1, LAST - 9.1)], off=4.0)
    assert part == pytest.approx(np.array([[1, 1], [-1, -1]]) * 16 / 9.0, rel=0.2)


def test_far_ends_are_how_far_the_artist_drew():
    far = MOST_SLIDE[0] + 4.0
    assert np.abs(slid([(FIRST + far, LAST + far)], off=20.0)).max() < 1e-9
    grown = slid([(FIRST + far, LAST + far)], off=20.0, scale=2.0)
    assert grown == pytest.approx(np.array([[-far, far]]), abs=1.6)


def test_what_another_stroke_hides_and_what_goes_on_does_not_slide():
    assert np.abs(slid([(FIRST - 7.5, LAST - 4.5)], hidden=[0])).max() < 1e-9
    assert np.abs(slid([(0, 400)])).max() < 1e-9
    assert np.abs(slid([(900, 901)])).max() < 1e-9  # no ink at all
