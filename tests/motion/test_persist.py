"""When lines are drawn: reasons to draw one line on a plate, frame by frame, and what is drawn."""

from dataclasses import replace

import numpy as np
import pytest

from strokestyle.motion.persist import decide
from strokestyle.motion.sheets import TRACED
from tests.motion.plates import line, loose, sheet

LINE = line([20, 60], [180, 60])


def fates(letters, cuts=()):
    """A line that is in each frame planned (p), without a stroke (t), or hidden (h)."""
    whole, frames = sheet(1, LINE), []
    for letter in letters:
        points = whole if letter == "p" else loose(whole, slice(None), TRACED)
        frames.append(replace(points, seen=np.full(len(points), letter != "h")))
    return decide(frames, set(cuts))


def drawn(letters):
    out = []
    for fate in fates(letters):
        assert fate.drawn.all() or not fate.drawn.any()
        out.append("x" if fate.drawn[0] else ".")
    return "".join(out)


@pytest.mark.parametrize(
    "letters, expected",
    [
        ("pppppppp", "xxxxxxxx"),
        ("pppptpppptppp", "xxxxxxxxxxxxx"),  # no flicker
        ("tttpttttptttt", "............."),  # nor noise
        ("p" * 20 + "t" * 40, "x" * 20 + "." * 40),
        ("ppphhhppp", "xxx...xxx"),
        ("ttthhhppp", "......xxx"),  # behind what hides it, it is decided anew
    ],
)
def test_what_is_drawn_goes_against_the_least_of_the_plans(letters, expected):
    assert drawn(letters) == expected


def test_a_line_appears_and_vanishes_where_one_sees_that_it_does_and_not_over_cuts():
    letters = "t" * 40 + "p" * 20 + "t" * 40
    told = fates(letters)
    assert [t for t, fate in enumerate(told) if fate.appears.any()] == [40]
    assert [t for t, fate in enumerate(told) if fate.vanishes.any()] == [59]
    told = fates(letters, cuts=(40, 60))
    assert not any(fate.appears.any() or fate.vanishes.any() for fate in told)
    assert not any(fate.appears.any() or fate.vanishes.any() for fate in fates("hhhppphhh"))
