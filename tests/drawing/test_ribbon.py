"""Ribbons: where the texels of a strip lie."""

import numpy as np
import pytest
from stroke_zoo import stroke, together, uv_texture, zoo

from strokestyle.drawing.raster import crop_of, rasterise, ribbon_coordinates
from strokestyle.drawing.ribbon import ribbon, strip_points, strip_stretch
from strokestyle.drawing.strokes import Drawing


def test_strip_points_and_pixels_are_inverse():
    t = np.linspace(0, 1, 60)
    line = stroke(np.stack([30 + 150 * t, 100 + 30 * np.sin(5 * t)], 1), 6 + 4 * t)
    band = ribbon(line, 0, 3.0)
    at = strip_points(band, 50, 9)
    crop = crop_of(band.xy, band.half, (220, 160))
    u, v = np.full(crop.w * crop.h, np.nan), np.full(crop.w * crop.h, np.nan)
    found = ribbon_coordinates([band], [crop])
    u[found.pixel], v[found.pixel] = found.u, found.v
    pixel = np.floor(at).astype(int) - [crop.x0, crop.y0]
    index = (pixel[..., 1] * crop.w + pixel[..., 0])[2:-2, 1:-1]
    rows, columns = np.meshgrid(
        (np.arange(50) + 0.5) / 50, (2 * np.arange(9) + 1.0) / 9 - 1, indexing="ij"
    )
    assert (
        np.abs(u[index] - rows[2:-2, 1:-1]).max() * band.length < 2.0
    )  # within a pixel's diagonal and the bend
    assert (np.abs(v[index] - columns[2:-2, 1:-1]) * 8.0).max() < 1.6


def test_blunt_ends_keep_a_wide_ribbon():
    xy = np.stack([np.linspace(0, 60, 31), np.zeros(31)], 1)
    thickness = np.full(31, 12.0)
    thickness[[0, 30]] = 0.0
    band = ribbon(stroke(xy, thickness), 0, 2.0)
    assert band.half.min() > 7.0
    assert band.length == pytest.approx(60 + band.half[0] + band.half[-1])
    slim = ribbon(
        stroke(xy, 6 - np.abs(xy[:, 0] - 30) / 5), 0, 2.0
    )  # narrows by a tenth a px: as drawn
    assert slim.half[-1] == pytest.approx(2.0)


def test_strips_stretch_outside_a_bend_and_fold_inside_a_tight_one():
    t = np.linspace(0, np.pi, 200)
    gentle = stroke(100 + 50 * np.stack([np.cos(t), np.sin(t)], axis=1), 20)
    rows, columns = 120, 10
    band = ribbon(gentle, 0, 0.0)
    stretch = strip_stretch(band, rows, columns)[40:80]
    inward = (
        (2 * np.arange(columns) + 1) / columns - 1
    ) * 10  # the normal (-t_y, t_x) points to the centre here
    assert stretch == pytest.approx(np.broadcast_to((50 - inward) / 50, stretch.shape), abs=0.02)
    tight = stroke(100 + 6 * np.stack([np.cos(t), np.sin(t)], axis=1), 20)
    assert strip_stretch(ribbon(tight, 0, 0.0), rows, columns).min() < 0


def test_texture_of_a_zoo_is_finite_and_stays_on_the_ribbon():
    line = together(*zoo().values())
    drawing = Drawing(line, (140, 140), np.tile([0, 0, 0, 1.0], (len(line), 1)), uv_texture(line))
    image = rasterise(drawing)
    assert (image[..., 3] > 0).mean() > 0.3
