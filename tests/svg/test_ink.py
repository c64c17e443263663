"""What the ink of strips is like, on strips whose ink is known."""

import numpy as np
import pytest

from strokestyle.drawing.strokes import Texture
from strokestyle.svg.ink import inks

RED, BLUE = np.array([204, 26, 26]), np.array([26, 26, 204])


def texture(*strips):
    """Strips (n, A, 4), one after the other."""
    counts = np.cumsum([len(strip) for strip in strips])
    return Texture(np.concatenate(strips).astype(np.uint8), np.r_[0, counts], 1.0)


def strip(color, alpha):
    """A strip of one colour (3,), or of one for each texel, with opacity (n, A), of 255."""
    alpha = np.asarray(alpha, float)
    return np.concatenate([np.broadcast_to(color, (*alpha.shape, 3)), alpha[..., None]], axis=2)


def grainy(n=40, columns=8, low=60, high=250):
    return np.random.default_rng(0).choice([low, high], (n, columns))


def test_the_ink_of_a_strip_is_its_mean_colour_weighed_by_opacity():
    half = np.where(np.arange(8) < 4, 200, 50) * np.ones((20, 1))
    both = np.where(np.arange(8)[:, None] < 4, RED, BLUE)
    found = inks(texture(strip(both, half), strip(BLUE, np.full((10, 8), 128))))
    assert found.color[0] == pytest.approx((200 * RED + 50 * BLUE) / 250 / 255, abs=1e-4)
    assert found.color[1] == pytest.approx(BLUE / 255, abs=1e-4)
    assert found.amount == pytest.approx([half.sum() / 255, 80 * 128 / 255], rel=1e-5)
    assert found.plain.tolist() == [False, True]


def test_the_spread_is_of_colours_weighed_by_the_square_of_their_opacity():
    """A texel that is hardly there may have any colour."""
    alpha = np.full((20, 8), 255.0)
    alpha[:, 4:] = 51.0
    both = np.where(np.arange(8)[:, None] < 4, [100, 100, 100], [220, 100, 100])
    found = inks(texture(strip(both, alpha)))
    a, red = np.array([1.0, 0.2]), np.array([100.0, 220.0]) / 255
    off = red - (a * red).sum() / a.sum()
    assert found.spread[0] == pytest.approx(np.sqrt((a**2 * off**2).sum() / (a**2).sum()), rel=1e-3)
    assert not found.plain[0]
    faint = np.where(alpha == 51, 2.0, alpha)
    assert inks(texture(strip(both, faint))).plain[0]


def test_grain_is_the_change_of_opacity_along_a_strip_and_not_from_strip_to_strip():
    steps = np.repeat([[100.0], [200.0], [100.0], [200.0]], 8, axis=1)
    even = np.full((4, 8), 250.0)
    found = inks(texture(strip(RED, even), strip(RED, steps), strip(RED, even)))
    # three changes of 100 in a sum of four rows that is 600
    assert found.grain == pytest.approx([0.0, 0.5, 0.0], abs=1e-6)
    across = np.where(np.arange(8) % 2, 100.0, 200.0) * np.ones((4, 1))
    assert inks(texture(strip(RED, across))).grain[0] == 0


def test_a_drawing_is_grain_where_its_ink_is_one_and_its_opacity_is_not():
    even = np.full((40, 8), 250.0)
    assert inks(texture(strip(RED, grainy()))).of_grain
    assert not inks(texture(strip(RED, even))).of_grain
    colored = strip(np.where(np.arange(8)[:, None] < 4, RED, BLUE), grainy())
    assert not inks(texture(colored)).of_grain
    # every stroke counts by its ink: a short even one changes nothing, a long one does
    assert inks(texture(strip(RED, grainy(200)), strip(BLUE, even[:4]))).of_grain
    assert not inks(texture(strip(RED, grainy(4)), strip(BLUE, np.full((400, 8), 250.0)))).of_grain


def test_no_ink_at_all_is_not_grain():
    found = inks(texture(strip(RED, np.zeros((5, 8)))))
    assert not found.of_grain and found.amount[0] == 0
    assert np.isfinite(np.r_[found.color.ravel(), found.spread, found.grain]).all()
