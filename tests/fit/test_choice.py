"""Which lines of a view a drawing has: told by its ink, and the law by which they were chosen."""

from dataclasses import replace

import numpy as np
import pytest
from known_law import SIZE, Law, blobs, exemplar_of
from scipy import ndimage

from strokestyle.cli.fit import drawn_lines
from strokestyle.drawing.strokes import Strokes
from strokestyle.fit.choice import find_drawn, learn_lines
from strokestyle.geometry.curves import KINDS, Curves, owner
from strokestyle.render.choice import choose_lines

VIEW, OTHER = blobs(3), blobs(8)
CONTOUR = KINDS.index("contour")


def kinds(view):
    return view.curves.kind[owner(view.curves.offsets)]


def facing(view, light):
    """Outward normals of the blobs against a light, at the curves' points."""
    column, row = (np.clip(view.curves.xy, 0, SIZE - 1).astype(int)).T
    return view.maps.values[3][row, column] * light[0] + view.maps.values[4][row, column] * light[1]


LAWS = {
    "all": lambda view: np.ones(len(view.curves.xy), bool),
    "contours": lambda view: kinds(view) == CONTOUR,
    "upper half": lambda view: view.curves.xy[:, 1] < 0.5 * SIZE,
    "in the light": lambda view: (kinds(view) != CONTOUR) | (facing(view, (-0.6, -0.8)) > 0),
    "long": lambda view: (view.curves.lengths() > 60)[owner(view.curves.offsets)],
    "lower contours": lambda view: (kinds(view) == CONTOUR) & (view.curves.xy[:, 1] > 0.5 * SIZE),
}


def f1(one, other):
    return 2 * (one & other).sum() / (one.sum() + other.sum())


def length(view):
    return view.curves.lengths().sum()


def drawn_by(view, keep, law=Law()):  # noqa: B008
    return law.exemplar(view.only(keep))


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_learned_and_holds_on_another_view(name):
    law = LAWS[name]
    found = learn_lines(VIEW, drawn_by(VIEW, law(VIEW)).mask)
    assert length(found.view) == pytest.approx(length(VIEW.only(law(VIEW))), rel=0.07)
    assert (found.choice is None) == (name == "all")
    wanted, drawn = OTHER.only(law(OTHER)), choose_lines(OTHER, found.choice)
    # of points that are the same ones
    rows = {tuple(xy) for xy in wanted.curves.xy}
    same = sum(tuple(xy) in rows for xy in drawn.curves.xy)
    assert 2 * same / (len(rows) + len(drawn.curves.xy)) > 0.88
    if name == "all":
        assert drawn.curves is OTHER.curves


def test_counts_are_told():
    found = learn_lines(VIEW, drawn_by(VIEW, LAWS["contours"](VIEW)).mask)
    assert found.about["lines_drawn"] == 9 and found.about["lines"] == 18
    share = length(VIEW.only(LAWS["contours"](VIEW))) / length(VIEW)
    assert found.about["share_drawn"] == pytest.approx(share, abs=0.02)


def test_of_hardly_any_lines_no_choice_is_learned_and_none_is_said_to_be_drawn():
    line = owner(VIEW.curves.offsets)
    one = line == VIEW.curves.lengths().argmin()
    assert one.mean() < 0.05
    found = learn_lines(VIEW, drawn_by(VIEW, one).mask)
    assert found.choice is None and length(found.view) == length(VIEW)
    assert found.about["lines_drawn"] <= 1 and found.about["share_drawn"] < 0.05
    assert drawn_lines(found.about, chose=False).endswith("all lines will be drawn")
    assert drawn_lines(found.about).startswith(f"drew {found.about['lines_drawn']} of 18 lines (")


@pytest.mark.parametrize(
    "law",
    [
        Law(inflate=4.0),
        Law(jitter=1.0),
        Law(smooth=6.0),
        Law(past=15.0),
        Law(thickness=1.2),
        Law(thickness=12.0),
        Law(thickness=lambda s, total, xy: 5 * np.sin(np.pi * s / max(total, 1e-9)) ** 0.5),
    ],
)
def test_a_hand_that_strays_has_drawn_all_the_same(law):
    keep = LAWS["contours"](VIEW)
    assert find_drawn(VIEW.curves, law.exemplar(VIEW).mask).mean() > 0.97
    assert f1(find_drawn(VIEW.curves, drawn_by(VIEW, keep, law).mask), keep) > 0.97


def line(first, last, bend=0.0):
    t = np.linspace(0, 1, int(np.hypot(*np.subtract(last, first)) / 3) + 1)[:, None]
    return np.asarray(first) + t * np.subtract(last, first) + bend * np.sin(np.pi * t) * [[0, 1]]


def ink(*lines, thickness=4.0):
    offsets = np.r_[0, np.cumsum([len(one) for one in lines])]
    xy, none = np.concatenate(lines), np.zeros(len(lines), int)
    return exemplar_of(Strokes(xy, np.full(len(xy), thickness), offsets, none, none)).mask


def whole(curves, mask):
    """How much of each curve was drawn."""
    drawn = find_drawn(curves, mask)
    return np.add.reduceat(drawn, curves.offsets[:-1]) / np.diff(curves.offsets)


def test_strokes_that_cross_a_line_do_not_draw_it():
    along, ladder = (
        line((40, 180), (320, 180)),
        [line((x, 150), (x, 210)) for x in range(60, 320, 24)],
    )
    curves = Curves.from_list([along, *ladder])
    assert (whole(curves, ink(*ladder)) == [0.0, *[1.0] * len(ladder)]).all()
    assert whole(curves, ink(along))[0] == 1.0
    # nor where they cross it aslant, as hatching does
    aslant = [line((x, 150), (x + 60, 210)) for x in range(40, 300, 12)]
    assert whole(Curves.from_list([along]), ink(*aslant, thickness=2.0))[0] < 0.1


@pytest.mark.parametrize("apart", [6, 8, 11])
def test_of_two_lines_side_by_side_the_stroke_is_the_nearer_one_s(apart):
    one = line((40, 150), (320, 150), 20)
    two = one[5:-5] + [1, apart]
    curves = Curves.from_list([one, two])
    assert whole(curves, ink(one)) == pytest.approx([1.0, 0.0], abs=0.06)
    assert whole(curves, ink(two)) == pytest.approx([0.0, 1.0], abs=0.06)
    assert whole(curves, ink(one, two)).min() > 0.95
    astray = ink(one + [0, 1.5])
    assert whole(curves, astray) == pytest.approx([1.0, 0.0], abs=0.06)


def test_how_far_a_line_was_drawn():
    curves = Curves.from_list([line((40, 100), (320, 100)), line((40, 250), (320, 250), 30)])
    half = [curves[0][:50], curves[1][30:70]]
    drawn = find_drawn(curves, ink(*half))
    assert np.flatnonzero(drawn[:94])[-1] == pytest.approx(49, abs=2)
    second = np.flatnonzero(drawn[curves.offsets[1] :])
    assert second[[0, -1]] == pytest.approx([30, 69], abs=2)
    # the pen that skips has drawn on
    mask = ink(curves[0])
    mask[:, 150:168] = 0.0
    assert find_drawn(curves, mask)[:94].all()


def test_a_larger_canvas_is_read_alike():
    mask = drawn_by(VIEW, LAWS["in the light"](VIEW)).mask
    twice = replace(VIEW.curves, xy=2 * VIEW.curves.xy)
    there = find_drawn(twice, np.clip(ndimage.zoom(mask, 2, order=1), 0, 1))
    assert f1(there, find_drawn(VIEW.curves, mask)) > 0.98


def test_what_lies_on_no_line_is_no_choice():
    found = learn_lines(VIEW, np.zeros((SIZE, SIZE), np.float32))
    assert found.choice is None and found.view is not None
    assert length(found.view) == length(VIEW)
    assert find_drawn(Curves.empty(), np.ones((SIZE, SIZE))).shape == (0,)


def test_optional_lines_that_were_not_drawn_are_no_loss():
    crease = VIEW.curves.kind != CONTOUR
    view = replace(VIEW, optional=crease)
    found = learn_lines(view, drawn_by(VIEW, ~crease[owner(VIEW.curves.offsets)]).mask)
    drawn = choose_lines(replace(OTHER, optional=OTHER.curves.kind != CONTOUR), found.choice)
    assert (drawn.curves.kind == CONTOUR).all() and len(drawn.curves) == 9
    assert drawn.optional is None
    # and where they were drawn, they are drawn
    found = learn_lines(view, drawn_by(VIEW, LAWS["all"](VIEW)).mask)
    drawn = choose_lines(replace(OTHER, optional=OTHER.curves.kind != CONTOUR), found.choice)
    assert len(drawn.curves) == 18


def test_faint_ink_is_no_gap_in_a_line():
    mask = drawn_by(VIEW, LAWS["all"](VIEW)).mask.copy()
    starts = VIEW.curves.offsets[:-1][VIEW.curves.kind == CONTOUR]
    for x, y in VIEW.curves.xy[starts]:  # where contours begin, the pen gave no ink
        row, column = np.mgrid[:SIZE, :SIZE]
        mask[np.hypot(column - x, row - y) < 10] = 0.0
    found = learn_lines(VIEW, mask)
    assert found.choice is None and length(found.view) > 0.99 * length(VIEW)
