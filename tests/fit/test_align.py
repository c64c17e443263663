"""Strokes brought to where a drawing has them: warps come back, and manner stays apart."""

import numpy as np
import pytest
from known_law import (
    SIZE,
    SPACING,
    Law,
    blobs,
    compare,
    exemplar_of,
    level,
    planned,
    taper,
    without_residuals,
)

from strokestyle.drawing.strokes import Strokes
from strokestyle.extract.view import View
from strokestyle.fit.align import FAMILIES, align, own_columns, warp_columns
from strokestyle.fit.learn import fit_quick
from strokestyle.fit.train import PRESETS
from strokestyle.render.config import StyleConfig
from strokestyle.render.displacement import DEFORMATIONS, Frame
from strokestyle.render.features import plan, surface_at

DRAWN, UNSEEN = blobs(1), blobs(2)
SMOOTH, CUT, INFLATE = FAMILIES


def frame_of(view: View):
    strokes = plan(view, StyleConfig(size=SIZE))
    return strokes, Frame.of(strokes, strokes.carry(surface_at(view, SPACING)), SPACING)


def moved(strokes, by):
    """Strokes whose points (N, 2) are moved by a function of them."""
    xy = strokes.xy + by(strokes.xy)
    return Strokes(xy, strokes.thickness, strokes.offsets, strokes.kind, strokes.closed)


def waves(xy):
    """A smooth field of 4 px at most, that no shift, turn or scale explains."""
    x, y = 2 * np.pi * xy.T / SIZE
    return np.stack([4 * np.sin(y + 0.3), 3 * np.cos(x - 0.4)], axis=1)


def sheared(xy):
    return (xy - SIZE / 2) @ np.array([[0.0, 0.0], [0.03, 0.0]])


def each_by_itself(strokes, rms=3.0):
    """Every stroke shifted its own way."""
    shift = np.random.default_rng(5).normal(0, rms, (len(strokes), 2)).clip(-5, 5)
    return np.repeat(shift, np.diff(strokes.offsets), axis=0)


def aligned(strokes, view=DRAWN):
    planned_strokes, frame = frame_of(view)
    mask = exemplar_of(strokes).mask
    return planned_strokes, frame, align(mask, planned_strokes, frame.deformations, SPACING)


def across(frame, vectors, planned_strokes):
    """Vectors along the normals, on the curves but for their last 9 px."""
    inner = planned_strokes.on_curve.copy()
    for k in (1, 2, 3):
        inner &= np.roll(planned_strokes.on_curve, 8 + k) & np.roll(planned_strokes.on_curve, -k)
    return (vectors * frame.normals).sum(axis=1)[inner]


@pytest.mark.parametrize("field", [waves, sheared], ids=["waves", "sheared"])
def test_a_smooth_warp_of_the_picture_comes_back(field):
    strokes, frame, found = aligned(moved(Law().strokes(DRAWN), field))
    off = across(frame, found.shift - field(strokes.xy), strokes)
    assert np.sqrt((off**2).mean()) < 0.3
    assert np.sqrt((across(frame, field(strokes.xy), strokes) ** 2).mean()) > 1.2
    assert found.explained[strokes.on_curve].mean() > 0.97
    assert not found.free.any()  # a warp is no manner


def test_strokes_that_are_each_shifted_come_back():
    law = Law().strokes(DRAWN)
    own = each_by_itself(law)
    strokes, frame, found = aligned(moved(law, lambda _: own))
    there = np.zeros_like(strokes.xy)
    there[strokes.on_curve] = own
    off = across(frame, found.shift - there, strokes)
    assert np.median(np.abs(off)) < 0.2 and np.quantile(np.abs(off), 0.9) < 0.6


@pytest.mark.parametrize(
    "law, family",
    [(Law(inflate=3.0), INFLATE), (Law(cut=6.0), CUT), (Law(smooth=12.0), SMOOTH)],
    ids=["inflate", "cut", "smooth"],
)
@pytest.mark.parametrize("field", [np.zeros_like, waves], ids=["as it was", "warped"])
def test_a_manner_is_told_from_a_warp(law, family, field):
    strokes, frame, found = aligned(moved(law.strokes(DRAWN), field))
    assert found.free[family].all()
    off = across(frame, found.shift - field(strokes.xy), strokes)
    assert np.sqrt((off**2).mean()) < 0.6  # the manner is not taken for a warp
    if law.inflate:
        contour = np.repeat(strokes.kind == 0, np.diff(strokes.offsets))
        assert contour.any()
        assert found.manner[-1] == pytest.approx(3.0, abs=0.3)
        assert found.deviation[-1] < 0.5


def test_what_lies_right_is_left_there():
    strokes, frame, found = aligned(Law(thickness=taper).strokes(DRAWN))
    assert np.abs(across(frame, found.shift, strokes)).max() < 0.25
    assert not found.free.any() and not found.manner[np.abs(found.manner) > 1e-3].any()
    assert found.noise < 0.5


def test_a_drawing_without_ink_moves_nothing():
    strokes, frame = frame_of(DRAWN)
    found = align(np.zeros((SIZE, SIZE)), strokes, frame.deformations, SPACING)
    assert not found.shift.any() and not found.explained.any() and not found.free.any()


def test_lines_that_were_not_drawn_stay_and_are_not_explained():
    law = Law().strokes(DRAWN)
    drawn = np.flatnonzero(np.arange(len(law)) % 3 != 1)
    lines = [slice(law.offsets[i], law.offsets[i + 1]) for i in drawn]
    some = Strokes(
        np.concatenate([law.xy[one] for one in lines]),
        np.concatenate([law.thickness[one] for one in lines]),
        np.r_[0, np.cumsum([one.stop - one.start for one in lines])],
        law.kind[drawn],
        np.zeros(len(drawn), bool),
    )
    strokes, _, found = aligned(moved(some, waves))
    share = np.array(
        [
            found.explained[a:b][strokes.on_curve[a:b]].mean()
            for a, b in zip(strokes.offsets[:-1], strokes.offsets[1:], strict=True)
        ]
    )
    was = np.isin(np.arange(len(strokes)), drawn)
    assert share[was].min() > 0.8 and np.median(share[~was]) < 0.1


def test_the_law_of_thickness_comes_back_from_a_warped_drawing_and_circles_stay_round():
    law = Law(thickness=taper)
    config = without_residuals(PRESETS["quick"], steps=100, trace_steps=30)
    learned = fit_quick(DRAWN, exemplar_of(moved(law.strokes(DRAWN), waves)), config)
    style, traced = learned.style, learned.strokes
    assert np.abs(style.displacement).max() < 1e-3
    drawn = compare(style.draw(UNSEEN).strokes, law.strokes(UNSEEN))
    assert np.corrcoef(drawn.thickness, drawn.wanted)[0, 1] > 0.95
    assert turns(traced).max() < turns(Law().strokes(DRAWN)).max() + np.radians(6)


def turns(strokes):
    """The angle, radians, by which strokes turn over 12 px."""
    out = []
    for a, b in zip(strokes.offsets[:-1], strokes.offsets[1:], strict=True):
        line = strokes.xy[a:b][3:-3]
        before, after = line[4:-4] - line[:-8], line[8:] - line[4:-4]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        out.append(np.abs(np.arctan2(cross, (before * after).sum(axis=1))))
    return np.concatenate(out)


# --------------------------------------------------------------------------------- its columns


def test_the_columns_have_the_variance_of_their_priors():
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, 700, (400, 2))
    columns = warp_columns(xy, 768.0)[:, 3:]
    variance = (columns**2).sum(axis=1)
    assert variance == pytest.approx(1.0, abs=0.06)
    near = warp_columns(xy + [20.0, 0.0], 768.0)[:, 3:]
    # the covariance of points 20 px apart, of a squared exponential; grids differ by as much
    assert (columns * near).sum(axis=1).mean() > 0.9
    strokes = planned(level(40, 20, 620), level(80, 20, 80), past=2)
    own = own_columns(strokes, 60.0)
    first = slice(0, strokes.offsets[1])
    assert (own[first] ** 2).sum(axis=1).mean() == pytest.approx(1.0, abs=0.1)
    # a stroke shorter than the length is moved as one
    short = own[strokes.offsets[1] :]
    assert short == pytest.approx(short[:1].repeat(len(short), axis=0), abs=0.35)
    assert own[0] == pytest.approx(own[2], abs=1e-9)  # past an end, as the end


def test_every_deformation_is_of_one_family():
    assert FAMILIES.sum(axis=0).tolist() == [1] * len(DEFORMATIONS)
