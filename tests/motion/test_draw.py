"""Frames of lines that move: what a track's hand did at a place, it did in all frames."""

import numpy as np
import pytest

from strokestyle.motion.draw import draw_frames
from tests.motion.moving import a_frame, a_hand, a_line, straight


def test_a_line_that_is_moved_is_the_same_stroke_elsewhere():
    style = a_hand()
    moves = [(0, 0), (7, 3.5), (12, -4.25)]
    frames = [a_frame(style, a_line(4, straight(30, 150, 90) + by)) for by in moves]
    drawings = list(draw_frames(style, frames, 3))
    for by, drawing in zip(moves, drawings, strict=True):
        assert drawing.track == ("4",)
        assert np.allclose(drawing.strokes.xy - by, drawings[0].strokes.xy, atol=1e-9)
        assert np.allclose(drawing.strokes.thickness, drawings[0].strokes.thickness)
        off = drawing.texture.rgba.astype(int) - drawings[0].texture.rgba
        assert np.abs(off).max() <= 1


def test_boil_lies_between_0_and_1():
    with pytest.raises(ValueError, match="boil must lie between 0 and 1, got 1.5"):
        draw_frames(a_hand(), [], boil=1.5)
    assert list(draw_frames(a_hand(), [])) == []
