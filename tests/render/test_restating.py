"""Lines that are gone over are drawn in several strokes."""

from dataclasses import replace

import numpy as np
import pytest
from small_styles import plain_style

from strokestyle.extract.pipeline import view_of_lines
from strokestyle.geometry.curves import KINDS, Curves
from strokestyle.geometry.parts import Parts
from strokestyle.render.plan import plan_strokes
from strokestyle.render.restating import Restating
from strokestyle.render.style_file import load_style, save_style

CONTOUR, CREASE = KINDS.index("contour"), KINDS.index("crease")


def law(passes=2, share=1.0, spread=2.0, wavelength=90.0):
    return Restating(np.array([CONTOUR], np.int8), passes, share, spread, wavelength)


def lines(kinds, length=300.0):
    x = np.linspace(0, length, 100)
    return Curves.from_list(
        [np.stack([20 + x, np.full(100, 30.0 * (i + 1))], axis=1) for i in range(len(kinds))], kinds
    )


def test_passes_follow_their_line_one_by_one():
    planned = plan_strokes(lines([CONTOUR, CREASE, CONTOUR]), 3.0)
    repeated, over = law(3).repeat(planned, np.random.default_rng(0))
    assert over.tolist() == [True] * 3 + [False] + [True] * 3
    assert repeated.kind.tolist() == [CONTOUR] * 3 + [CREASE] + [CONTOUR] * 3
    assert np.array_equal(repeated.xy[: repeated.offsets[1]], planned.xy[: planned.offsets[1]])
    assert repeated.source.max() == planned.source.max()


def test_some_of_the_lines_are_gone_over():
    planned = plan_strokes(lines([CONTOUR] * 400, 30.0), 3.0)
    _, over = law(2, share=0.3).repeat(planned, np.random.default_rng(0))
    assert over.sum() / 2 == pytest.approx(120, abs=30)


@pytest.mark.parametrize("wavelength", [40.0, 160.0, 900.0])
def test_passes_deviate_by_their_spread_and_slowly(wavelength):
    planned = plan_strokes(lines([CONTOUR] * 300), 3.0)
    over = np.ones(300, bool)
    off = law(spread=2.5, wavelength=wavelength).deviation(
        planned, over, 3.0, np.random.default_rng(1)
    )
    pairs = off.reshape(150, 2, -1, 2)
    assert np.allclose(pairs.mean(axis=1), 0)
    pieces = (pairs[:, 0] - pairs[:, 1]) / np.sqrt(2)
    assert pieces.std() == pytest.approx(2.5, rel=0.1)
    k = round(wavelength / 4 / 3)  # a standard deviation of the Gaussian: exp(-1/4) is left
    if k < pieces.shape[1]:
        agreement = (pieces[:, k:] * pieces[:, : pieces.shape[1] - k]).mean() / 2.5**2
        assert agreement == pytest.approx(np.exp(-0.25), abs=0.12)
    assert not law().deviation(planned, ~over, 3.0, np.random.default_rng(1)).any()


def test_a_style_with_two_passes_draws_two_strokes_a_contour(tmp_path):
    view = view_of_lines(
        lines([CONTOUR, CREASE, CONTOUR]), 400, 200, parts=Parts(("a", "b"), [0, 1, 1])
    )
    one, two = plain_style(400), replace(plain_style(400), restating=law(2, spread=3.0))
    drawing = two.draw(view, seed=3)
    assert len(one.draw(view).strokes) == 3
    assert np.bincount(drawing.strokes.kind, minlength=3)[[CONTOUR, CREASE]].tolist() == [4, 1]
    assert [drawing.parts.name(i) for i in range(5)] == ["a", "a", "b", "b", "b"]
    first, second = (drawing.strokes.xy[drawing.strokes.rows(i)] for i in (0, 1))
    assert not np.allclose(first[:5], second[:5])
    save_style(tmp_path / "model", two)
    again = load_style(tmp_path / "model").draw(view, seed=3)
    assert np.array_equal(again.strokes.xy, drawing.strokes.xy)
    other = two.draw(view, seed=4)
    assert not np.array_equal(other.strokes.xy, drawing.strokes.xy)
