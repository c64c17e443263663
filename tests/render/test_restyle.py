"""A drawing's lines in another style: what is kept of it, and what is not."""

import numpy as np
from small_styles import plain_style

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.geometry.curves import KINDS
from strokestyle.geometry.parts import Parts
from strokestyle.render.restyle import restyle


def ink(lines, kinds, parts=None):
    xy = np.concatenate(lines)
    offsets = np.cumsum([0] + [len(line) for line in lines])
    strokes = Strokes(xy, np.full(len(xy), 20.0), offsets, kinds, np.zeros(len(lines), bool))
    return Drawing(strokes, (200, 160), np.tile([1.0, 0.0, 0.0, 1.0], (len(lines), 1)), None, parts)


def test_lines_kinds_and_parts_stay_and_ink_and_width_are_the_styles():
    t = np.linspace(0, 1, 50)[:, None]
    valley, crease = KINDS.index("valley"), KINDS.index("crease")
    lines = [[20, 30] + t * [120, 0], [20, 90] + t * [120, 40]]
    drawing = ink(lines, [valley, crease], Parts(("lid", "body"), [1, 0]))
    style = plain_style(200)
    drawn = restyle(drawing, style)
    assert drawn.size == (200, 160) and len(drawn.strokes) == 2
    order = np.argsort(
        [line[0, 1] for line in np.split(drawn.strokes.xy, drawn.strokes.offsets[1:-1])]
    )
    assert drawn.strokes.kind[order].tolist() == [valley, crease]
    assert [drawn.parts.name(i) for i in order] == ["body", "lid"]
    for i, line in zip(order, lines, strict=True):
        a, b = drawn.strokes.offsets[i : i + 2]
        along = line[-1] - line[0]
        off = (drawn.strokes.xy[a:b] - line[0]) @ [-along[1], along[0]] / np.hypot(*along)
        assert np.abs(off).max() < 0.05  # on the old centre line
    assert np.allclose(drawn.strokes.thickness, np.exp(1.5) - 0.5, atol=1e-4)
    assert np.allclose(drawn.color, [0, 0, 0, 1])


def test_nothing_gives_nothing():
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (100, 80), np.zeros((0, 4)))
    drawn = restyle(nothing, plain_style(100))
    assert len(drawn.strokes) == 0 and drawn.size == (100, 80)
