"""How far the ink runs on past the ends of lines, in drawings where that is known."""

import numpy as np
import pytest
from known_law import SIZE, exemplar_of, level

from strokestyle.drawing.strokes import Strokes
from strokestyle.fit.pen_ends import pen_ends, probe_ends
from strokestyle.geometry.curves import Curves
from strokestyle.render.plan import plan_strokes

STEP, WIDTH, REACH = 3.0, 4.0, 60.0


def inked(*lines, width=WIDTH):
    """The mask of polylines drawn in one width."""
    offsets = np.r_[0, np.cumsum([len(line) for line in lines])]
    none = np.zeros(len(lines))
    return exemplar_of(
        Strokes(np.concatenate(lines), np.full(offsets[-1], width), offsets, none, none)
    ).mask


def line(a, b):
    n = max(2, round(np.hypot(*np.subtract(b, a)) / STEP) + 1)
    return np.asarray(a, float) + np.linspace(0, 1, n)[:, None] * np.subtract(b, a)


def crossing(turn, before, after):
    """Two lines that meet at (180, 180), the second `turn` degrees off the first, and the same as
    drawn: by `before` px past the meeting, and from `after` px before it."""
    meet, t = np.array([180.0, 180.0]), np.radians(turn)
    one, two = np.array([1.0, 0.0]), np.array([np.cos(t), np.sin(t)])
    lines = [line(meet - 90 * one, meet), line(meet, meet + 90 * two)]
    drawn = [line(meet - 90 * one, meet + before * one), line(meet - after * two, meet + 90 * two)]
    return lines, drawn


@pytest.mark.parametrize("turn", [35.0, 60.0, 90.0, 130.0])
def test_ink_is_followed_past_a_corner_to_where_it_ends(turn):
    lines, drawn = crossing(turn, 30.0, 18.0)
    probes = probe_ends(lines, inked(*drawn), WIDTH, REACH, STEP)
    assert probes.clear.all()
    assert probes.past == pytest.approx(np.array([[0, 30], [18, 0]]), abs=3.0)
    assert probes.direction[0, 1] == pytest.approx([1, 0], abs=0.08)


@pytest.mark.parametrize("turn", [15.0, 35.0, 60.0, 90.0, 130.0, 180.0])
def test_a_corner_without_overshoot_has_none(turn):
    lines, drawn = crossing(turn, 0.0, 0.0)
    assert not probe_ends(lines, inked(*drawn), WIDTH, REACH, STEP).past.any()


def test_the_ink_of_another_line_is_not_an_overshoot():
    """At a T, and where one line goes on in the other."""
    bar, stem = line((60, 180), (300, 180)), line((180, 60), (180, 180))
    probes = probe_ends([bar, stem], inked(bar, stem), WIDTH, REACH, STEP)
    assert not probes.past.any()
    halves = [line((60, 180), (180, 180)), line((180, 180), (300, 180))]
    probes = probe_ends(halves, inked(*halves), WIDTH, REACH, STEP)
    assert not probes.past.any()
    assert probes.clear.tolist() == [[True, False], [False, True]]


def test_overshoots_lie_where_the_ink_has_them():
    """Of a line that was drawn 2 px aside, and bends off by 6 degrees."""
    curve = level(180, 60, 240)
    away = np.array([curve[-1, 0], 182.0])
    bent = away + np.outer([0, 40], [np.cos(np.radians(6)), np.sin(np.radians(6))])
    mask = inked(np.concatenate([curve + [0, 2], bent[1:]]))
    planned = plan_strokes(Curves.from_list([curve], [0]), STEP, max_overshoot=REACH)
    probes = probe_ends([curve], mask, WIDTH, REACH, STEP)
    laid, drawn = probes.laid(planned, planned.xy), probes.drawn(planned)
    assert probes.past[0] == pytest.approx([0, 40], abs=3)
    past = drawn & (planned.overshoot > 0)
    assert (planned.overshoot[past] <= 43).all() and past.sum() >= 12
    expected = away[1] + np.tan(np.radians(6)) * (laid[past, 0] - away[0])
    assert np.abs(laid[past, 1] - expected).max() < 2.5
    assert np.array_equal(laid[planned.on_curve], planned.xy[planned.on_curve])


def test_nothing_to_follow():
    none = probe_ends([], np.zeros((SIZE, SIZE)), WIDTH, REACH, STEP)
    assert none.past.shape == (0, 2)
    blank = probe_ends([level(180)], np.zeros((SIZE, SIZE)), 0.0, REACH, STEP)
    assert not blank.past.any()
    rim = probe_ends([line((10, 180), (350, 180))], np.ones((SIZE, SIZE)), WIDTH, REACH, STEP)
    assert rim.past.max() < 15  # the canvas ends


def along_pen(thickness):
    """pen_ends of one level stroke of 150 px whose thickness is a function of px from its start."""
    curve = level(180, 60, 213)
    planned = plan_strokes(Curves.from_list([curve], [0]), STEP, max_overshoot=REACH)
    s = planned.xy[:, 0] - 60
    past, shown = pen_ends(planned, thickness(s), planned.xy, np.zeros((SIZE, SIZE)), STEP)
    assert shown.all()
    return past[0]


@pytest.mark.parametrize("first, last", [(-20.0, 170.0), (-3.7, 151.9), (9.0, 141.0)])
def test_a_traced_stroke_ends_where_it_is_half_as_thick(first, last):
    """Between two points its thickness falls evenly."""

    def thickness(s):
        return 5 * np.clip(np.minimum(s - first, last - s) / STEP + 0.5, 0, 1)

    got, cap = along_pen(thickness), 0.4 * 5
    wanted = [end - cap if end < 0 else max(end - cap, 0) for end in (-first, last - 150)]
    assert got == pytest.approx(wanted, abs=1.0)


def test_a_faint_end_is_no_early_one_and_a_taper_ends_where_it_is_seen():
    assert not along_pen(lambda s: np.where(s < 100, 5.0, 0.0) * (s > -1))[1]
    first, last = along_pen(lambda s: np.clip((190 - s) / 20, 0, 5) * (s > -1))
    assert abs(first) < 2 and 24 < last < 34  # 0.5 px thick at 30 px past the end


def test_an_end_under_other_ink_is_not_known():
    curve = level(180, 60, 213)
    planned = plan_strokes(Curves.from_list([curve], [0]), STEP, max_overshoot=REACH)
    mask = inked(line((215, 100), (215, 260)), width=16.0)
    thickness = np.where(planned.on_curve, 5.0, 0.0)
    _, shown = pen_ends(planned, thickness, planned.xy, mask, STEP)
    assert shown.tolist() == [[True, False]]
