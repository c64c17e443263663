"""The direct raster, flat and textured, against the union of discs that a stroke is."""

import numpy as np
import pytest
from stroke_zoo import VALLEY, stroke, together, uv_texture, zoo

from strokestyle.drawing.raster import distance_map, rasterise, stroke_coverage
from strokestyle.drawing.strokes import Drawing, Strokes, Texture, paint_order, signed_distance


def supersampled(line, size, factor=5):
    x = (np.arange(size * factor) + 0.5) / factor
    grid = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    inside = signed_distance(line.xy, 0.5 * line.thickness, grid) < 0
    return inside.reshape(size, factor, size, factor).mean(axis=(1, 3))


@pytest.mark.parametrize(
    "name", ["tapered line", "sharp bend", "closed", "nervous and uneven", "one disc in another"]
)
def test_flat_raster_is_the_covered_area(name):
    line = zoo()[name]
    image = rasterise(Drawing(line, (140, 140), [[0, 0, 0, 1]]), background=(1, 1, 1))
    exact = 255 * (1 - supersampled(line, 140))
    assert np.abs(image[..., 0] - exact).mean() < 0.25
    assert (
        np.abs(image[..., 0] - exact).max() < 110
    )  # joins: the largest of two parts is less than their union


def test_thin_strokes_fade_instead_of_vanishing():
    line = stroke([[10.0, 20.3], [60.0, 20.3]], 0.4)
    _, cover = stroke_coverage(line, 0, (70, 40))
    assert cover[:, 20].sum() == pytest.approx(0.4, abs=0.02)


def test_distance_map_agrees_with_the_reference():
    line = zoo()["nervous and uneven"]
    crop, near = distance_map(line, 0, (140, 140), 6.0)
    y, x = np.nonzero(np.isfinite(near))
    points = np.stack([x + crop.x0 + 0.5, y + crop.y0 + 0.5], axis=1)
    assert near[y, x] == pytest.approx(
        signed_distance(line.xy, 0.5 * line.thickness, points), abs=1e-9
    )
    assert np.isfinite(near).sum() > 2000


def test_strokes_over_the_edge_of_the_canvas_are_cut():
    line = stroke([[-30, 20], [30, 20], [90, 200]], 9)
    image = rasterise(Drawing(line, (64, 48), [[1, 0, 0, 1]]))
    assert image.shape == (48, 64, 4) and image[20, 10].tolist() == [255, 0, 0, 255]
    far = stroke([[-300, 20], [-200, 20]], 9)
    assert not rasterise(Drawing(far, (64, 48), [[1, 0, 0, 1]])).any()


def test_contours_are_painted_last_and_strokes_of_a_kind_as_given():
    line = together(
        stroke([[10, 20], [50, 20]], 6),
        stroke([[30, 5], [30, 40]], 6, kind=VALLEY),
        stroke([[20, 5], [20, 40]], 6),
    )
    drawing = Drawing(line, (60, 45), [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]])
    assert paint_order(drawing).tolist() == [1, 0, 2]
    image = rasterise(drawing)
    assert image[20, 30, :3].tolist() == [255, 0, 0] and image[20, 20, :3].tolist() == [0, 0, 255]


def test_half_opaque_ink_builds_up_where_strokes_cross():
    line = together(stroke([[10, 20], [50, 20]], 6), stroke([[30, 5], [30, 40]], 6))
    image = rasterise(Drawing(line, (60, 45), [[0, 0, 0, 0.5]] * 2))
    assert image[20, 15, 3] == 128 and image[20, 30, 3] == 191


def test_raster_scales():
    drawing = Drawing(zoo()["sharp bend"], (120, 120), [[0, 0, 0, 1]])
    large = rasterise(drawing, 4.0, (1, 1, 1)).astype(float)
    assert large.shape == (480, 480, 3)
    small = large.reshape(120, 4, 120, 4, 3).mean(axis=(1, 3))
    assert np.abs(small - rasterise(drawing, 1.0, (1, 1, 1))).mean() < 0.3
    with pytest.raises(ValueError, match="scale"):
        rasterise(drawing, 0.0)


def test_texture_lies_along_and_across_the_stroke():
    line = stroke(np.stack([np.linspace(20, 100, 30), np.full(30, 30.0)], 1), 10)
    image = rasterise(Drawing(line, (120, 60), [[0, 0, 0, 1]], uv_texture(line)))
    # the ribbon runs from 12 to 108 and 22 to 38; v grows along (-t_y, t_x), which is down here
    x, y = np.meshgrid(np.arange(14, 106), np.arange(24, 36))
    assert image[y, x, 0] == pytest.approx(255 * (x + 0.5 - 12) / 96, abs=3)
    assert image[y, x, 1] == pytest.approx(255 * (y + 0.5 - 22) / 16, abs=9)
    assert image[..., 3].sum() == pytest.approx(255 * 96 * 16, rel=0.02)


def test_a_closed_ribbon_wraps():
    line = zoo()["closed"]
    strip = np.zeros(
        (6, 4, 4), np.uint8
    )  # rows of some 42 px: between two of them colours are interpolated
    strip[..., 3] = 255
    strip[3:, :, 0] = 255
    image = rasterise(Drawing(line, (120, 120), [[0, 0, 0, 1]], Texture(strip, [0, 6], 2.0)))
    seam = image[58:62, 98:102, 0].astype(int)  # on both sides of the stroke's beginning
    assert abs(seam - 127).max() < 20 and (image[58:62, 98:102, 3] == 255).all()


def test_where_a_stroke_crosses_itself_the_stronger_mark_shows():
    t = np.linspace(
        -0.25, 0.75, 100
    )  # through the crossing at (60, 60) a quarter and three quarters of the way
    line = stroke(
        np.stack([60 + 40 * np.sin(2 * np.pi * t), 60 + 30 * np.sin(4 * np.pi * t)], 1), 8
    )
    strip = np.zeros((100, 8, 4), np.uint8)
    strip[:50, :, 3] = 255  # the first half of the way is ink, the second is clear
    image = rasterise(Drawing(line, (120, 120), [[0, 0, 0, 1]], Texture(strip, [0, 100], 1.0)))
    x, y = np.floor(line.xy[20:30]).astype(int).T
    assert (np.hypot(x - 60, y - 60) < 5).any() and image[
        y, x, 3
    ].min() == 255  # no notch in the ink's way


def test_without_strokes_the_canvas_stays_clear():
    nothing = Strokes(np.zeros((0, 2)), [], [0], [], [])
    assert not rasterise(Drawing(nothing, (20, 16), np.zeros((0, 4)))).any()
