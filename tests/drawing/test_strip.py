"""Strips: straight and premultiplied colours, resampling, pieces, and what edits carry along."""

import numpy as np
import pytest
from small_drawings import drawing as small

from strokestyle.drawing.ribbon import across
from strokestyle.drawing.strip import (
    MAX_COLUMNS,
    OVERLAP,
    carried_strip,
    premultiplied,
    straight,
    strip_columns,
    strip_of_piece,
    texel_places,
    wider,
)
from strokestyle.drawing.strokes import Strokes, Texture

ROWS_A_PX = 2


def level(length=100.0, width=8.0, points=26, closed=False):
    """A stroke that runs to the right."""
    x = np.linspace(0, length, points)
    xy = np.stack([x, 0 * x + 40], axis=1)
    return Strokes(xy, np.full(points, width), [0, points], [0], [closed])


def striped(length=100.0, width=8.0, columns=10):
    """A strip of `level`: red is the place along the stroke in px, opaque where there is ink."""
    margin = 1.0
    rows = round(ROWS_A_PX * (length + width + 2 * margin))
    rgba = np.zeros((rows, columns, 4), np.uint8)
    place = (np.arange(rows) + 0.5) / ROWS_A_PX - (0.5 * width + margin)
    rgba[..., 0] = np.clip(np.rint(place), 0, 255)[:, None]
    rgba[..., 3] = 255 * (np.abs(across(columns)) * (0.5 * width + margin) < 0.5 * width)
    return Texture(rgba, [0, rows], margin)


def test_columns_lie_in_the_middles_of_equal_parts():
    assert across(4) == pytest.approx([-0.75, -0.25, 0.25, 0.75])
    assert across(1) == pytest.approx([0])


@pytest.mark.parametrize("full", [1.0, 255.0])
def test_straight_undoes_premultiplied(full):
    rgba = full * np.random.default_rng(0).random((5, 7, 4))
    product = premultiplied(rgba, full)
    assert product[..., :3] == pytest.approx(rgba[..., :3] * rgba[..., 3:] / full)
    assert np.array_equal(product[..., 3], rgba[..., 3])
    assert straight(product, full) == pytest.approx(rgba)
    clear = straight(np.zeros((2, 4)), full)
    assert np.array_equal(clear, np.zeros((2, 4)))
    faint = straight(np.array([2e-4, 0, 0, 1e-4]) * full, full, least=1e-3)
    assert faint[0] == pytest.approx(0.2 * full)


def test_texels_lie_between_coarser_ones():
    low, fraction = texel_places(4, 2)
    assert low.tolist() == [0, 0, 0, 0] and fraction == pytest.approx([0, 0.25, 0.75, 1])


def test_a_strip_with_more_columns_has_the_same_colours():
    x = np.arange(8)
    strip = np.stack([10 * x, 200 - 10 * x, 0 * x + 7, 0 * x + 255], axis=-1)
    strip = np.tile(strip.astype(np.uint8), (3, 1, 1))
    assert wider(strip, 8) is strip
    fine = wider(strip, 24)
    assert fine.shape == (3, 24, 4) and fine.dtype == np.uint8
    inner = (np.arange(24) + 0.5) / 3 - 0.5  # in columns of the old strip
    inside = (inner > 0) & (inner < 7)
    assert np.abs(fine[0, inside, 0] - 10 * inner[inside]).max() <= 0.5
    assert (fine[..., 2] == 7).all() and (fine[..., 3] == 255).all()
    one = wider(strip[:, :1], 5)
    assert np.array_equal(one, np.repeat(strip[:, :1], 5, axis=1))


def test_clear_texels_lend_no_colour_to_their_neighbours():
    strip = np.array([[[255, 0, 0, 255], [0, 0, 255, 0]]], np.uint8)
    assert (wider(strip, 9)[..., 2] == 0).all()


def test_a_piece_has_the_strip_that_lay_there():
    old, texture = level(), striped()
    first, last = 5, 15  # 20 and 60 px along
    piece = level(40.0, points=11)
    strip = strip_of_piece(old, texture, 0, piece, 0, first, last)
    seen = strip[strip[..., 3].any(axis=1)][:, 5, 0].astype(int)
    assert abs(seen.min() - 20) <= 1 and abs(seen.max() - 60) <= 1
    # what is beyond the cuts is clear, and as long as the piece's own caps are
    clear = np.flatnonzero(~strip[..., 3].any(axis=1))
    cap = ROWS_A_PX * (0.5 * 8 + 1.0 - OVERLAP)
    assert len(clear) == pytest.approx(2 * cap, abs=2)
    assert len(strip) == pytest.approx(ROWS_A_PX * (40 + 10), abs=2)


def test_a_piece_at_the_end_of_its_stroke_keeps_the_cap():
    strip = strip_of_piece(level(), striped(), 0, level(20.0, points=6), 0, 0, 5)
    assert np.array_equal(strip[:40], striped().rgba[:40])
    assert not strip[-8:, :, 3].any()


def carried(new, was=None, columns=10):
    was = np.arange(len(new.xy), dtype=float) if was is None else was
    return carried_strip(level(), striped(), new, 0, was, columns)


def test_what_is_not_changed_is_carried_as_it_is():
    strip, before = carried(level()), striped().rgba
    assert np.array_equal(strip[..., 3], before[..., 3])
    inked = before[..., 3] > 0  # what is clear has no colour of its own
    assert np.array_equal(strip[inked], before[inked])


def test_colour_goes_where_its_point_goes():
    # the first half of the stroke takes three quarters of the new one
    old, x = level(), np.linspace(0, 100, 26)
    new = Strokes(old.xy, old.thickness, old.offsets, old.kind, old.closed)
    was = np.interp(x, [0, 75, 100], [0, 12.5, 25])
    red = carried(new, was)[:, 5, 0].astype(float)
    place = (np.arange(len(red)) + 0.5) / ROWS_A_PX - 5
    within = (place > 1) & (place < 99)
    expected = np.interp(place, [0, 75, 100], [0, 50, 100])
    assert np.abs(red - expected)[within].max() <= 1.5


@pytest.mark.parametrize("factor", [0.5, 1.2, 3.0])
def test_the_soft_edge_stays_as_wide(factor):
    strip = carried(level(width=8.0 * factor), columns=120)
    half = 4.0 * factor + 1.0
    inked = (strip[100, :, 3] > 127).sum() * 2 * half / 120  # px
    assert inked == pytest.approx(8.0 * factor, abs=0.7)
    assert not strip[100, np.abs(across(120)) * half > 4.0 * factor + 0.9, 3].any()


def test_past_the_edge_of_the_old_strip_there_is_nothing():
    """A stroke narrows to nothing faster than its ribbon does; its old strip is opaque all over."""
    old, texture = level(), striped()
    solid = Texture(np.maximum(texture.rgba, [0, 0, 0, 255]).astype(np.uint8), [0, 220], 1.0)
    width = 8.0 * np.clip((100 - old.xy[:, 0]) / 8, 0, 1)  # over the last 8 px
    new = Strokes(old.xy, width, old.offsets, old.kind, old.closed)
    alpha = carried_strip(old, solid, new, 0, np.arange(26.0), 40)[..., 3]
    at = (np.arange(len(alpha)) + 0.5) / ROWS_A_PX - 5
    narrow = np.abs(at - 98).argmin()  # 2 px thick, in a ribbon of about 7
    assert alpha[narrow, 20] > 200 and not alpha[narrow, [0, 39]].any()
    assert alpha[at > 100].max() == 0 and alpha[np.abs(at - 99.7).argmin()].max() < 100


def test_grain_that_is_laid_anew_is_the_old_grain_from_elsewhere_on_the_stroke():
    old, texture = level(), striped(columns=21)
    rgba = texture.rgba.copy()
    rgba[..., 3] = np.random.default_rng(0).integers(0, 256, rgba.shape[:2])
    grain = Texture(rgba, texture.offsets, texture.margin)
    made = carried_strip(old, grain, level(width=24.0), 0, np.arange(26.0), 63)
    before, after = rgba[:, 10, 3], made[:, 31, 3]  # along the middle
    some = before[100:160]
    found = [
        np.corrcoef(some, after[row : row + 60])[0, 1] for row in range(len(after) - len(some))
    ]
    assert max(found) > 0.9
    assert after.std() == pytest.approx(before.std(), rel=0.15)  # and no greyer


def test_strips_get_more_columns_where_strokes_become_thicker():
    old, texture = level(), striped()
    assert strip_columns(old, texture, level(), [0]) == 10
    assert strip_columns(old, texture, level(width=9.0), [0]) == 10  # it would not be seen
    assert strip_columns(old, texture, level(width=28.0), [0]) == 30  # 15 px for 5
    assert strip_columns(old, texture, level(width=28.0), []) == 10  # that stroke was not edited
    assert strip_columns(old, texture, level(width=8000.0), [0]) == MAX_COLUMNS


def test_a_stroke_of_a_texture_is_its_strip():
    texture = small(5, "grain").texture
    for i in range(5):
        rows = slice(texture.offsets[i], texture.offsets[i + 1])
        assert np.shares_memory(texture.strip(i), texture.rgba)
        assert np.array_equal(texture.strip(i), texture.rgba[rows])
