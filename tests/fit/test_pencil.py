"""Pencil under ink is left out; a drawing in pencil, and faint strokes of its own, stay."""

import numpy as np
from scipy import ndimage

from strokestyle.fit.exemplar import separate, stroke_mask
from strokestyle.fit.pencil import pencil_lines

SIZE = 320
Y, X = np.mgrid[:SIZE, :SIZE] + 0.5


def ring(cx, cy, r, half):
    turn = np.linspace(0, 2 * np.pi, 200)
    points = np.stack([cx + r * np.cos(turn), cy + r * np.sin(turn)], axis=1)
    return np.clip(half + 0.5 - abs(np.hypot(X - cx, Y - cy) - r), 0, 1), points


RINGS = [ring(120, 120, 70, 2.5), ring(200, 180, 80, 2.5), ring(150, 220, 40, 2.5)]
INK, POINTS = np.maximum.reduce([r for r, _ in RINGS]), np.concatenate([p for _, p in RINGS])
CONSTRUCTION = np.maximum.reduce(
    [np.clip(1.3 - abs(X - 160), 0, 1), np.clip(1.3 - abs(Y - 0.5 * X - 60), 0, 1)]
)


def alpha(pencil=0.3):
    return np.maximum(INK, pencil * CONSTRUCTION).astype(np.float32)


def test_pencil_is_left_out_and_ink_is_whole():
    drawn = alpha()
    found = pencil_lines(drawn, stroke_mask(drawn), POINTS)
    assert not (found & (INK > 0)).any()
    away = (INK == 0) & (CONSTRUCTION > 0.5)
    left = away & ~found & (ndimage.maximum_filter(INK, 9) == 0)
    assert left.sum() < 0.02 * away.sum()  # but for what touches the ink


def test_what_is_all_there_is_stays():
    faint = (0.3 * INK).astype(np.float32)
    assert pencil_lines(faint, stroke_mask(faint), POINTS) is None
    # one ring of three drawn faintly: no other line draws its curve
    own = np.maximum(RINGS[0][0], 0.3 * np.maximum(RINGS[1][0], RINGS[2][0])).astype(np.float32)
    assert pencil_lines(own, stroke_mask(own), POINTS) is None
    # pressure that changes along the stroke
    pressed = (INK * (0.25 + 0.75 * X / SIZE)).astype(np.float32)
    assert pencil_lines(pressed, stroke_mask(pressed), POINTS) is None
    blank = np.zeros((SIZE, SIZE), np.float32)
    assert pencil_lines(blank, blank, POINTS) is None
    assert pencil_lines(alpha(), stroke_mask(alpha()), np.zeros((0, 2))) is None


def test_white_ink_on_black_and_grey_construction():
    rgb = np.repeat(alpha(0.35)[..., None], 3, axis=2)
    found = separate(np.dstack([rgb, np.ones((SIZE, SIZE))]).astype(np.float32))
    assert pencil_lines(found.alpha, found.mask, POINTS) is not None
