"""Palette PNGs, decoded by pillow."""

import io
import zlib

import numpy as np
import pytest
from PIL import Image

from strokestyle.svg.palette import Quantiser, ink_palette, used
from strokestyle.svg.png import encode_png, read_png


def decoded(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA")).astype(float) / 255


@pytest.mark.parametrize("levels", [10, 64])
def test_one_ink_keeps_its_colour_and_its_opacities(levels):
    alpha = np.linspace(0, 1, 17 * 16).reshape(16, 17)  # odd width, for 4 bits a pixel
    palette = np.rint(255 * ink_palette(np.array([0.8, 0.4, 0.2]), levels)).astype(np.uint8)
    got = decoded(encode_png(np.rint(alpha * (levels - 1)).astype(np.uint8), palette))
    assert len(np.unique(got[..., 3])) == levels
    assert got[..., :3][alpha > 0.1] == pytest.approx(
        np.tile([0.8, 0.4, 0.2], ((alpha > 0.1).sum(), 1)), abs=0.01
    )
    assert np.abs(got[..., 3] - alpha).max() <= 0.5 / (levels - 1) + 0.5 / 255


def test_many_colours_are_shown_closely():
    y, x = np.mgrid[0:40, 0:60] / 60
    layer = np.stack([x * 0.9, 0.5 * y, 0.3 + 0 * x, np.ones_like(x)], axis=-1) * (
        0.3 + 0.7 * x[..., None]
    )
    colors = Quantiser(layer.reshape(-1, 4))
    index, palette = used(colors.index(layer.reshape(-1, 4)).reshape(40, 60), colors.palette)
    assert len(palette) <= 128 and index.max() < len(palette)
    got = decoded(encode_png(index, np.rint(255 * np.clip(palette, 0, 1)).astype(np.uint8)))
    assert np.abs(got[..., :3] * got[..., 3:] - layer[..., :3]).mean() < 0.02
    assert np.abs(got[..., 3] - layer[..., 3]).mean() < 0.03


def test_colours_that_are_not_used_are_not_written():
    index, palette = used(np.array([[3, 1], [1, 3]]), np.arange(20).reshape(5, 4))
    assert index.tolist() == [[1, 0], [0, 1]] and palette.tolist() == [
        [4, 5, 6, 7],
        [12, 13, 14, 15],
    ]


@pytest.mark.parametrize("bits, levels", [(4, 16), (8, 256)])
@pytest.mark.parametrize("width", [1, 6, 7])
def test_every_value_comes_back_grey_or_by_a_palette(bits, levels, width):
    rng = np.random.default_rng(0)
    index = rng.integers(0, levels, (9, width)).astype(np.uint8)
    palette = rng.integers(0, 256, (levels, 4)).astype(np.uint8)
    colours = Image.open(io.BytesIO(encode_png(index, palette))).convert("RGBA")
    assert np.array_equal(np.asarray(colours), palette[index])
    grey = read_png(encode_png(index, None, bits), 100, "image")
    assert np.array_equal(np.asarray(grey.convert("L")), index * (17 if bits == 4 else 1))


def test_soft_tone_is_smaller_than_its_run_lengths():
    y, x = np.mgrid[0:80, 0:120]
    index = np.rint(31 * (0.5 + 0.5 * np.sin(x / 9.0) * np.cos(y / 7.0))).astype(np.uint8)
    palette = np.rint(255 * ink_palette(np.zeros(3), 32)).astype(np.uint8)
    runs = zlib.compressobj(8, zlib.DEFLATED, 15, 9, zlib.Z_RLE)
    lines = np.pad(index, ((0, 0), (1, 0))).tobytes()
    assert len(encode_png(index, palette)) < 0.8 * len(runs.compress(lines) + runs.flush())
