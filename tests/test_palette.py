"""Palette PNGs, decoded by pillow."""

import io

import numpy as np
import pytest
from PIL import Image

from strokestyle.palette import palette_png


def decoded(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA")).astype(float) / 255


@pytest.mark.parametrize("alphas", [10, 64])
def test_palette_png_of_one_ink_keeps_the_ink_and_its_alphas(alphas):
    alpha = np.linspace(0, 1, 17 * 16).reshape(16, 17)  # soft tone; odd width, for 4 bits a pixel
    if alphas == 10:  # grain
        alpha = np.random.default_rng(0).permutation(alpha.ravel()).reshape(16, 17)
    got = decoded(palette_png(alpha[..., None] * [0.8, 0.4, 0.2, 1.0]))
    assert len(np.unique(got[..., 3])) == alphas
    assert got[..., :3][alpha > 0.1] == pytest.approx(np.tile([0.8, 0.4, 0.2], ((alpha > 0.1).sum(), 1)), abs=0.01)
    assert np.abs(got[..., 3] - alpha).max() <= 0.5 / (alphas - 1) + 0.5 / 255


def test_palette_png_of_many_colours_is_close():
    y, x = np.mgrid[0:40, 0:60] / 60
    layer = np.stack([x * 0.9, 0.5 * y, 0.3 + 0 * x, np.ones_like(x)], axis=-1) * (0.3 + 0.7 * x[..., None])
    got = decoded(palette_png(layer))
    assert np.abs(got[..., :3] * got[..., 3:] - layer[..., :3]).mean() < 0.02
    assert np.abs(got[..., 3] - layer[..., 3]).mean() < 0.03
