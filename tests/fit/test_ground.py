"""Light, shadows and printed lines are the ground's; strokes that cross them stay whole."""

import numpy as np
import pytest
from scipy import ndimage

from strokestyle.fit.exemplar import separate
from strokestyle.fit.ground import ground_field, printed_lines

SIZE = 320
Y, X = np.mgrid[:SIZE, :SIZE] + 0.5
PAPER = np.array([0.95, 0.93, 0.88])


def ink():
    """Coverage (H, W) of rings, of a straight line along the ruling, and of one across it."""
    out = np.zeros((SIZE, SIZE))
    for cx, cy, r in ((130, 120, 70), (200, 190, 60)):
        out = np.maximum(out, np.clip(2.5 - abs(np.hypot(X - cx, Y - cy) - r), 0, 1))
    out = np.maximum(out, np.clip(2.0 - abs(Y - 250.3), 0, 1) * (X > 60) * (X < 250))
    return np.maximum(out, np.clip(2.0 - abs(X - 260), 0, 1) * (Y > 60) * (Y < 250))


INK = ink()


def drawn(light=1.0, printed=1.0, grain=0.006):
    rng = np.random.default_rng(4)
    sheet = PAPER * np.broadcast_to(printed, (SIZE, SIZE, 3)) * (1 - 0.92 * INK[..., None])
    sheet = sheet * np.broadcast_to(light, (SIZE, SIZE))[..., None]
    return np.clip(sheet + rng.normal(0, grain, (SIZE, SIZE, 1)), 0, 1)


def rgba(rgb):
    return np.dstack([rgb, np.ones((SIZE, SIZE))]).astype(np.float32)


def rules(pitch, slope=0.0, fan=0.0, strength=0.4, colour=(1.0, 0.8, 0.4)):
    """Light (H, W, 3) that lines leave: `slope` against the sheet, more of it below by `fan`."""
    at = Y - (slope + fan * (Y / SIZE - 0.5)) * (X - SIZE / 2)
    off = np.abs((at + 0.37 * pitch) % pitch - pitch / 2)
    return 1 - strength * np.clip(1.2 - off, 0, 1)[..., None] * np.array(colour)


SHADOWS = {
    "hand": 1 - 0.45 / (1 + np.exp(-(0.8 * X + 0.5 * Y - 230) / 5)),
    "phone": 1 - 0.3 / (1 + np.exp(-np.minimum.reduce([X - 90, Y - 60, 230 - X]) / 4)),
    "falling off": 1 - 0.6 * ((X / SIZE + Y / SIZE) / 2) ** 1.5,
    "flash": 0.7 + 0.3 * np.exp(-((X - 200) ** 2 + (Y - 100) ** 2) / 5000),
}


@pytest.mark.parametrize("name", SHADOWS)
def test_light_and_soft_shadows_are_not_ink(name):
    found = separate(rgba(drawn(SHADOWS[name])))
    assert np.abs(found.mask - INK).mean() < 0.012
    away = ndimage.maximum_filter(INK, 9) == 0
    assert (found.alpha[away] > 0.1).mean() < 0.001
    assert found.alpha[INK > 0.99].min() > 0.7


RULINGS = {
    "ruled": [rules(14.3, 0.012)],
    "squared": [rules(9.7), rules(9.7).swapaxes(0, 1)],
    "fanned": [rules(16.1, -0.03, 0.03)],
    "grey": [rules(12.0, 0.0, strength=0.25, colour=(1, 1, 1))],
}


@pytest.mark.parametrize("name", RULINGS)
def test_printed_lines_are_taken_off_and_leave_no_holes(name):
    printed = np.minimum.reduce(RULINGS[name])
    found = separate(rgba(drawn(printed=printed)))
    assert found.notes == ("its ruling was taken off",)
    assert np.abs(found.mask - INK).mean() < 0.015
    away = ndimage.maximum_filter(INK, 9) == 0
    assert (found.mask[away] > 0.3).mean() < 0.004
    assert found.mask[INK > 0.99].min() > 0.8  # whole where lines cross it
    assert np.abs(found.ink[INK > 0.99] - 0.08).max() < 0.15


def test_lines_that_somebody_drew_are_not_printed():
    even = np.minimum.reduce(
        [1 - np.clip(2 - abs(Y - y), 0, 1) * (X > 130) for y in range(40, 300, 20)]
    )
    few = np.minimum.reduce([1 - np.clip(2 - abs(Y - y), 0, 1) for y in (80, 130, 260)])
    uneven = np.minimum.reduce(
        [1 - np.clip(2 - abs(Y - y), 0, 1) for y in (20, 50, 64, 130, 149, 260)]
    )
    for sheet in (even, few, uneven, drawn()[..., 0] / PAPER[0]):
        rgb = np.repeat(sheet[..., None], 3, axis=2) * PAPER
        assert printed_lines(rgb, np.broadcast_to(PAPER, rgb.shape)) is None


def test_what_needs_nothing_gets_nothing():
    """A blot wider than any stroke has edges, and stays ink; so does a coloured wash."""
    for colour in ((0.2, 0.2, 0.2), (0.95, 0.8, 0.6)):
        blot = np.clip(26 - np.hypot(X - 150, Y - 150), 0, 1)[..., None]
        rgb = PAPER * (1 - blot * (1 - np.array(colour)))
        assert np.abs(ground_field(rgb) - PAPER).max() < 0.01
    assert np.allclose(ground_field(np.broadcast_to(PAPER, (40, 50, 3))), PAPER, atol=1e-6)
    dark = ground_field(np.full((64, 64, 3), 0.04))
    assert np.allclose(dark, 0.04, atol=1e-6)
