"""TIFF of every layout: the picture that its tags say, or one line that says why not."""

import icc
import numpy as np
import pytest
from PIL import Image
from tiff_files import tiff

from strokestyle.fit.image_file import read_image
from strokestyle.fit.raster import shrunk
from strokestyle.fit.tiff_file import read_pages, tiff_raster

H, W = 61, 70
Y, X = np.mgrid[:H, :W] / 70.0
RGB = np.stack([0.2 + 0.7 * X, 0.9 - 0.6 * Y, 0.5 + 0.4 * np.sin(9 * X * Y)], axis=-1)
GREY = RGB[..., 1:2]
ALPHA = np.clip(1.3 * X, 0.1, 1)[..., None]
TYPES = [np.uint8, np.uint16, np.uint32, np.float16, np.float32, np.float64]


def number(values, dtype):
    if np.dtype(dtype).kind == "f":
        return values.astype(dtype)
    return (values * np.iinfo(dtype).max).astype(dtype)


def read(tmp_path, data):
    (tmp_path / "d.tif").write_bytes(data)
    return read_image(tmp_path / "d.tif")


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("layout", [{}, {"tile": 32}, {"deflate": True}, {"rows": 500}], ids=str)
@pytest.mark.parametrize("separate", [False, True])
def test_colours_in_planes_or_side_by_side(tmp_path, dtype, order, layout, separate):
    data = tiff(number(RGB, dtype), 2, order=order, separate=separate, **layout)
    found = read(tmp_path, data)
    assert found.notes == () and (found.width, found.height) == (W, H)
    assert np.abs(found.rgba[..., :3] - RGB).max() < 1.1 / 255 and found.rgba[..., 3].min() == 1


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("deflate", [False, True])
def test_white_is_zero(tmp_path, dtype, order, deflate):
    found = read(tmp_path, tiff(number(1 - GREY, dtype), 0, order=order, deflate=deflate))
    assert np.abs(found.rgba[..., :3] - GREY).max() < 1.1 / 255


@pytest.mark.parametrize("photometric", [0, 1])
@pytest.mark.parametrize("bits", [1, 2, 4, 10, 12, 14, 24])
def test_bits_packed_closely(tmp_path, photometric, bits):
    levels = np.round((1 - GREY if photometric == 0 else GREY) * (2**bits - 1))
    found = read(tmp_path, tiff(levels.astype(np.uint32), photometric, bits=bits))
    right = levels / (2**bits - 1)
    assert np.abs(found.rgba[..., :1] - (1 - right if photometric == 0 else right)).max() < 1 / 255


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("separate", [False, True])
@pytest.mark.parametrize("kind", [1, 2])
@pytest.mark.parametrize("photometric", [0, 1, 2])
def test_opacity_associated_or_not(tmp_path, dtype, separate, kind, photometric):
    right = RGB if photometric == 2 else GREY
    colours = 1 - right if photometric == 0 else right
    samples = np.dstack([colours * ALPHA if kind == 1 else colours, ALPHA])
    data = tiff(number(samples, dtype), photometric, extra=[kind], separate=separate)
    rgba = read(tmp_path, data).rgba
    assert np.abs(rgba[..., 3:] - ALPHA).max() < 1.1 / 255
    assert (np.abs(rgba[..., :3] - right) * ALPHA).max() < 2.1 / 255


@pytest.mark.parametrize("dtype, predictor", [(np.uint8, 2), (np.uint16, 2), (np.uint32, 2),
                                              (np.float32, 3), (np.float16, 3)])  # fmt: skip
@pytest.mark.parametrize("layout", [{}, {"tile": 16}, {"separate": True}], ids=str)
@pytest.mark.parametrize("order", "<>")
def test_predictors(tmp_path, dtype, predictor, layout, order):
    options = {"deflate": True, "predictor": predictor, "order": order}
    found = read(tmp_path, tiff(number(RGB, dtype), 2, **options, **layout))
    assert np.abs(found.rgba[..., :3] - RGB).max() < 1.1 / 255


@pytest.mark.parametrize("dtype", TYPES)
def test_inks(tmp_path, dtype):
    inks = number(np.dstack([1 - RGB, 0 * GREY]), dtype)
    with pytest.warns(UserWarning, match="CMYK without a colour profile"):
        found = read(tmp_path, tiff(inks, 5))
    assert np.abs(found.rgba[..., :3] - RGB).max() < 2.1 / 255


def test_our_reading_of_8_bits_is_pillows(tmp_path):
    """Two roads to one picture, where both are right."""
    for samples, kind in ((RGB, 2), (GREY, 1), (GREY, 0)):
        (tmp_path / "d.tif").write_bytes(tiff(number(samples, np.uint8), kind))
        page = read_pages(tmp_path / "d.tif")[0]
        ours = shrunk(tiff_raster(tmp_path / "d.tif", page), 1)
        with Image.open(tmp_path / "d.tif") as image:
            theirs = np.asarray(image, np.float32).reshape(ours.shape) / 255
        assert np.abs(ours - theirs).max() < 1e-6


def test_a_large_one_is_reduced_as_it_is_read(tmp_path):
    samples = number(np.dstack([RGB * ALPHA, ALPHA]), np.uint16).repeat(6, 0).repeat(6, 1)
    (tmp_path / "d.tif").write_bytes(tiff(samples, 2, extra=[1], deflate=True))
    small = read_image(tmp_path / "d.tif", (30, 30))
    assert small.rgba.shape == (61, 70, 4) and (small.width, small.height) == (420, 366)
    assert (np.abs(small.rgba[..., :3] - RGB) * ALPHA).max() < 0.001


def test_a_profile_and_the_way_up(tmp_path):
    profile = icc.profile(icc.srgb_curve, icc.P3)
    data = tiff(number(RGB, np.uint16), 2, tags={34675: profile, 274: [6]})
    found = read(tmp_path, data)
    right = np.rot90(icc.as_srgb(RGB, icc.srgb_curve, icc.P3), -1)
    assert (found.width, found.height) == (H, W)
    # 8 bits tell reds at the edge of the gamut from one another by 12 levels
    assert np.abs(found.rgba[..., :3] - right).mean() < 0.5 / 255


def test_samples_of_no_meaning_are_left_out_with_a_word(tmp_path):
    with pytest.warns(UserWarning, match="2 more samples a pixel are not said to be opacity"):
        found = read(tmp_path, tiff(number(np.dstack([RGB, ALPHA, ALPHA]), np.uint8), 2))
    assert np.abs(found.rgba[..., :3] - RGB).max() < 1.1 / 255 and found.rgba[..., 3].min() == 1


def test_pages_previews_and_masks(tmp_path):
    pages = [Image.fromarray(number(RGB, np.uint8)[: H - k]) for k in range(3)]
    pages[0].save(tmp_path / "d.tif", save_all=True, append_images=pages[1:])
    with pytest.warns(UserWarning, match="the first of its 3 pages is read"):
        assert read_image(tmp_path / "d.tif").height == H
    pages[0].info["tiffinfo"] = {254: 1}
    pages[0].encoderinfo = {"tiffinfo": {254: 1}}
    pages[0].save(tmp_path / "d.tif", save_all=True, append_images=pages[1:2])
    assert read_image(tmp_path / "d.tif").height == H - 1


def refused():
    grey = number(GREY, np.uint16)
    yield tiff((GREY * 127).astype(np.int8), 1), "signed samples"
    yield tiff(GREY.astype(np.float32) * 255, 1), "its numbers go up to"
    yield tiff(GREY.astype(np.float32) * np.nan, 1), "its numbers go up to nan"
    yield tiff(grey, 32803), "colours of kind 32803"
    yield tiff(grey, 1, tags={259: [50001]}), "packed by method 50001"
    yield tiff(grey, 2), "1 samples a pixel for colours of 3"
    yield tiff(grey, 1, tags={254: [1]}), "holds a preview only"
    yield tiff(grey, 1, deflate=True, tags={279: []}), "without all of its strips"
    yield tiff(grey, 1, tags={278: [0]}), "strips or tiles of no size"
    yield tiff(grey, 1, tags={256: [0]}), "d.tif"
    yield tiff(grey, 1, tags={257: [2**31]}), "pixels is too large"
    yield tiff(grey, 1, tags={277: [900], 258: [16]}), "900 samples a pixel"
    yield tiff(grey, 1, tags={273: [2**31, 2**31]}), "cut short"
    yield tiff(grey, 1, deflate=True, tags={273: [4, 4]}), "damaged or cut short"
    yield tiff(grey, 1)[:-40], "d.tif"
    yield b"II*\0" + bytes(40), "without an image"
    yield b"MM\0+" + b"\xff" * 40, "d.tif"


@pytest.mark.parametrize("data, words", list(refused()), ids=lambda v: str(v)[:24])
def test_what_is_refused(tmp_path, data, words, capfd):
    with pytest.raises(ValueError, match=words) as error:
        read(tmp_path, data)
    assert str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)
    assert capfd.readouterr().err == ""
