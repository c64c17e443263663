"""Whose ink is whose, on strokes and lines that are known."""

import numpy as np
import pytest
from small_drawings import strokes_of

from strokestyle.fit.exemplar import Exemplar
from strokestyle.fit.own_ink import (
    ASTRAY,
    MIN_MARGIN,
    NEIGHBOURHOOD,
    InkOwners,
    ink_margin,
    nearest_strokes,
    unexplained_ink,
)
from strokestyle.fit.texture import cut_strips, learn_texture
from strokestyle.render.texture_bank import ROWS, stroke_rows

WIDTH, HEIGHT = 200, 100


def inked(*lines, thickness=8.0):
    """The coverage (H, W) of lines."""
    near = nearest_strokes(strokes_of(*lines, thickness=thickness), (WIDTH, HEIGHT))
    return np.clip(0.5 - near.distance, 0, 1)


def strips_of(strokes, alpha, ink):
    """Strips, which of their texels are free, and their rows."""
    drawing = Exemplar(alpha[..., None] * ink + 1 - alpha[..., None], alpha, ink, alpha, np.ones(3))
    near = nearest_strokes(strokes, (WIDTH, HEIGHT))
    rows = stroke_rows(strokes, np.zeros((len(strokes.xy), 1)), 2.0)
    strips, free = cut_strips(strokes, rows, drawing, InkOwners.of(near, alpha), 2.0)
    return strips, free, rows, drawing


def test_every_pixel_knows_its_nearest_stroke_and_how_far_the_next_one_is():
    two = strokes_of([[20, 40], [180, 40]], [[20, 56], [180, 56]])
    near = nearest_strokes(two, (WIDTH, HEIGHT))
    assert near.stroke.shape == (HEIGHT, WIDTH)
    for y, stroke, distance, second in (
        (40, 0, -3.5, 11.5),  # inside of the upper one; the lower one is not near
        (45, 0, 1.5, 6.5),
        (50, 1, 1.5, 6.5),
        (56, 1, -3.5, 11.5),
        (30, 0, 5.5, np.inf),
    ):
        assert near.stroke[y, 100] == stroke
        assert near.distance[y, 100] == pytest.approx(distance, abs=0.01)
        want = second if second <= NEIGHBOURHOOD else np.inf
        assert near.second[y, 100] == pytest.approx(want, abs=0.01)
    assert near.stroke[5, 100] == -1 and np.isinf(near.distance[5, 100])
    # whichever of them comes first
    other = nearest_strokes(
        strokes_of([[20, 56], [180, 56]], [[20, 40], [180, 40]]), (WIDTH, HEIGHT)
    )
    assert np.array_equal(other.distance, near.distance)
    assert np.array_equal(other.second, near.second)


@pytest.mark.parametrize("reach, margin", [(0, MIN_MARGIN), (3, 4.0), (5, 6.0), (20, 8.0)])
def test_the_margin_holds_all_but_a_trace_of_the_ink(reach, margin):
    """Ink of half the opacity reaches this far beyond the edges of the strokes."""
    one = strokes_of([[20, 50], [180, 50]])
    near = nearest_strokes(one, (WIDTH, HEIGHT))
    alpha = np.where(near.distance < 0, 1.0, np.where(near.distance <= reach, 0.5, 0.0))
    assert ink_margin(near, alpha) == margin


def test_the_margin_looks_only_where_a_stroke_is_alone():
    two = strokes_of([[20, 40], [180, 40]], [[20, 54], [180, 54]])
    near = nearest_strokes(two, (WIDTH, HEIGHT))
    alpha = np.where(near.distance < 0, 1.0, 0.0)
    alpha[45:50] = 1.0  # between the two, whoever's
    assert ink_margin(near, alpha) == MIN_MARGIN


# ------------------------------------------------------------------------------ ink without stroke

LEVEL = [[20, 50], [180, 50]]
JOINING = {
    "from above": [[100, 5], [100, 47]],
    "from below, slanting": [[70, 95], [103, 53]],
    "across": [[90, 5], [110, 95]],
    "across at a flat angle": [[60, 30], [140, 70]],
    "at the end": [[180, 50], [185, 95]],
    "going on past the end": [[183, 50], [198, 52]],
}


@pytest.mark.parametrize("name", JOINING)
def test_a_strip_holds_nothing_of_a_line_that_was_not_traced(name):
    """The stroke is blue and the line red: no texel that counts as the stroke's own is reddish."""
    one, other = strokes_of(LEVEL), inked(JOINING[name], thickness=5.0)
    both = np.maximum(inked(LEVEL), other)
    red = np.array([1.0, 0.0, 0.0]) * other[..., None]
    ink = np.clip(red + np.array([0.0, 0.0, 1.0]) * (1 - other[..., None]), 0, 1)
    strips, free, rows, drawing = strips_of(one, both, ink)
    within = rows.ends.min(axis=1) > 1.0
    assert strips[within][..., 0][free[within]].max(initial=0.0) < 0.08
    assert free[within].mean() > 0.35
    bank = learn_texture(one, np.zeros((30, 1)), drawing)
    laid = bank.rgba[within][bank.occlusion[within] < 0.4] / 255.0
    assert (laid[..., 0] * laid[..., 3]).max() < 0.1


def test_ink_near_a_stroke_is_taken_for_a_trace_that_errs():
    near = nearest_strokes(strokes_of(LEVEL), (WIDTH, HEIGHT))
    for beside in (0.0, 0.5 * ASTRAY, 0.9 * ASTRAY):
        assert not unexplained_ink(near, inked([[20, 50 + beside], [180, 50 + beside]])).any()
    whole = inked([[20, 64], [180, 64]])
    assert np.array_equal(unexplained_ink(near, whole), whole > 0.25)
    dust = np.zeros((HEIGHT, WIDTH))
    dust[20:80:6, 20:180:6] = 1.0
    assert not unexplained_ink(near, dust).any()


def test_unexplained_ink_ends_at_the_stroke():
    near = nearest_strokes(strokes_of(LEVEL), (WIDTH, HEIGHT))
    found = unexplained_ink(near, np.maximum(inked(LEVEL), inked([[100, 5], [100, 95]])))
    assert found[10:45, 98:102].all() and found[55:90, 98:102].all()
    assert not found[near.distance < 0].any()
    assert not found[:, :90].any() and not found[:, 110:].any()


def test_a_stroke_where_the_drawing_has_none_owns_nothing():
    two = strokes_of(LEVEL, [[20, 20], [180, 20]])
    _, free, rows, _ = strips_of(two, inked(LEVEL), np.zeros((HEIGHT, WIDTH, 3)))
    within = rows.ends.min(axis=1) > 1.0
    first = np.arange(len(within)) < rows.offsets[1]
    assert free[within & first].all() and not free[within & ~first].any()


def test_a_short_piece_beyond_bare_rows_is_anothers_ink():
    mask = np.maximum(inked([[20, 50], [26, 50]]), inked([[70, 50], [180, 50]]))
    _, free, rows, _ = strips_of(strokes_of(LEVEL), mask, np.zeros((HEIGHT, WIDTH, 3)))
    along = np.arange(len(free)) / ROWS + rows.ends[0, 0]
    assert not free[along < 45].any() and free[(along > 60) & (along < 150)].all()


def test_foreign_ink_does_not_widen_the_margin():
    near = nearest_strokes(strokes_of(LEVEL), (WIDTH, HEIGHT))
    lines = [[[x, 5], [x, 95]] for x in range(25, 180, 16)]
    mask = np.maximum(inked(LEVEL), inked(*lines, thickness=5.0))
    assert ink_margin(near, mask) > MIN_MARGIN
    assert ink_margin(near, mask, unexplained_ink(near, mask)) == MIN_MARGIN
