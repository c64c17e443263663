"""What a fit says of the drawing that it learned from, and the marks in its picture."""

from dataclasses import replace

import numpy as np
import pytest
from small_views import a_view

from strokestyle.drawing.strokes import Strokes
from strokestyle.fit.align import Alignment
from strokestyle.fit.choice import DrawnLines
from strokestyle.fit.exemplar import Exemplar
from strokestyle.fit.hatching import SortedInk
from strokestyle.fit.learn import Learned, long_runs
from strokestyle.fit.report import MARKS, Account, account, marked_drawing
from strokestyle.fit.train import Fitted

SIZE = 96
LINE = np.stack([np.linspace(10, 86, 30), np.full(30, 30.0)], axis=1)


def a_fit(shift=0.0, free=False):
    """A line that was traced, ink beside it that was not, a hatched patch and a blot."""
    mask = np.zeros((SIZE, SIZE), np.float32)
    mask[27:33, 10:86] = 1.0
    mask[60:64, 10:40] = 1.0  # on no line
    hatching, blots = np.zeros((2, SIZE, SIZE), bool)
    hatching[70:90, 50:90:4] = True
    blots[70:90, 10:30] = True
    mask[hatching | blots] = 1.0
    strokes = Strokes(LINE, np.full(30, 6.0), [0, 30], [0], [False])
    moved = np.tile([0.0, shift], (30, 1))
    alignment = Alignment(
        moved, 0 * moved, np.ones(30, bool), np.zeros(2), np.zeros(2), np.array([free, False]), 0.1
    )
    lines = np.where(hatching | blots, 0, mask)
    ink = SortedInk(lines, hatching, blots, mask > 2)
    rgb = np.repeat(1 - mask[..., None], 3, axis=2)
    exemplar = Exemplar(rgb, mask, 0 * rgb, mask, np.ones(3))
    return exemplar, Learned(None, strokes, ink, alignment, np.array([[40.0, 30.0]]))


def test_every_share_of_the_ink_is_accounted_for():
    exemplar, learned = a_fit()
    told, total = account(exemplar, learned), exemplar.mask.sum()
    assert told.on_lines == pytest.approx(6 * 76 / total, abs=1e-6)
    assert told.elsewhere == pytest.approx(4 * 30 / total, abs=1e-6)
    assert told.hatching == pytest.approx(20 * 10 / total, abs=1e-6)
    assert told.blots == pytest.approx(20 * 20 / total, abs=1e-6)
    assert told.on_lines + told.elsewhere + told.hatching + told.blots == pytest.approx(1.0)
    assert account(*a_fit(shift=3.5)).off == pytest.approx(3.5)


def test_only_what_is_much_is_told():
    clean = Account(0.97, 0.01, 0.0, 0.02, 1.0, True)
    assert clean.words(768) == []
    assert "16 % hatching" in replace(clean, hatching=0.16).words(768)[0]
    both = replace(clean, hatching=0.16, blots=0.04).words(768)
    assert len(both) == 1 and "16 % hatching and 4 % filled in" in both[0]
    assert "9 % of its ink lies on no line" in replace(clean, elsewhere=0.09).words(768)[0]
    far = replace(clean, off=4.2).words(768)
    assert far == ["its lines lie 4.2 px beside the curves"]
    assert "too far to tell" in replace(clean, off=4.2, manner=False).words(768)[0]
    assert replace(clean, off=4.2).words(3000) == []  # 1 px of 768


def test_the_picture_marks_each_in_its_colour():
    exemplar, learned = a_fit()
    view = a_view()
    drawn = view.only(np.arange(len(view.curves.xy)) < 0.5 * len(view.curves.xy))
    picture = marked_drawing(
        view, exemplar, Fitted(None, DrawnLines(drawn, None, {}), learned), learned
    )
    assert picture.shape == (SIZE, SIZE, 3)

    def has(y, x, name):
        return np.abs(picture[y, x] - MARKS[name]).max() < 0.01

    assert has(30, 40, "not believed") and has(62, 20, "on no line")
    blue = (np.abs(picture - MARKS["line not drawn"]).max(axis=2) < 0.01).sum()
    assert blue > 10
    unmarked = np.abs(np.ptp(picture, axis=2)) < 0.01
    assert unmarked[29, 60] and 0.3 < picture[29, 60, 0] < 0.6
    whole = Fitted(None, DrawnLines(view, None, {}), learned)
    picture = marked_drawing(view, exemplar, whole, learned)
    assert has(80, 54, "hatching") and has(80, 20, "blot")
    assert (np.abs(picture - MARKS["line not drawn"]).max(axis=2) > 0.01).all()


def test_short_runs_of_flags_are_dropped_on_each_stroke():
    flags = np.array([1, 1, 1, 0, 1, 1, 0, 1, 1, 1], bool)
    kept = long_runs(flags, np.array([0, 5, 10]), 3)
    assert kept.tolist() == [True] * 3 + [False] * 4 + [True] * 3
    # a run that two strokes share is none
    assert not long_runs(np.ones(4, bool), np.array([0, 2, 4]), 3).any()
