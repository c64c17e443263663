"""Colours by profile: every kind to the sRGB of its closed form, or left out with a word."""

import struct
import zlib

import icc
import numpy as np
import pytest
from PIL import Image, ImageCms

from strokestyle.fit.image_file import read_image

PATCHES = np.array(
    [[[188, 62, 64], [30, 30, 30], [250, 240, 230],
      [90, 140, 120], [60, 80, 160], [128, 128, 128]]],
    np.uint8,
).repeat(4, axis=1).repeat(16, axis=0)  # fmt: skip


def saved(path, array, mode=None, **options):
    Image.fromarray(array, mode).save(path, **options)
    return path


@pytest.mark.parametrize("suffix", ["png", "tif", "webp"])
@pytest.mark.parametrize(
    "law, colorants",
    [(icc.srgb_curve, icc.P3), (2.2, icc.ADOBE), (1.0, icc.P3), (1.8, icc.SRGB)],
    ids=["Display P3", "Adobe RGB", "linear P3", "gamma 1.8"],
)
def test_colours_of_a_profile_are_brought_to_srgb(tmp_path, suffix, law, colorants):
    options = {"lossless": True} if suffix == "webp" else {}
    path = tmp_path / f"d.{suffix}"
    saved(path, PATCHES, icc_profile=icc.profile(law, colorants), **options)
    found = read_image(path)
    assert found.notes == ()
    right = icc.as_srgb(PATCHES / 255.0, law, colorants)
    assert np.abs(found.rgba[..., :3] - right).max() < 2.5 / 255


def test_srgb_itself_changes_no_number(tmp_path):
    whole = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for profile in (whole, icc.profile(icc.srgb_curve, icc.SRGB)):
        path = saved(tmp_path / "d.png", PATCHES, icc_profile=profile)
        assert np.array_equal(read_image(path).rgba[..., :3], PATCHES / np.float32(255))


def test_transparency_is_no_colour(tmp_path):
    rgba = np.dstack([PATCHES, np.arange(16, dtype=np.uint8)[:, None].repeat(24, 1) * 17])
    path = saved(tmp_path / "d.png", rgba, icc_profile=icc.profile(icc.srgb_curve, icc.P3))
    found = read_image(path).rgba
    assert np.array_equal(found[..., 3], rgba[..., 3] / np.float32(255))
    right = icc.as_srgb(PATCHES / 255.0, icc.srgb_curve, icc.P3)
    assert np.abs(found[..., :3] - right)[1:].max() < 2.5 / 255


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("law", [1.0, 1.8, 2.2])
def test_greys_of_a_profile_at_8_and_16_bits(tmp_path, dtype, law):
    top = np.iinfo(dtype).max
    grey = np.linspace(0.02 * top, top, 32 * 32).astype(dtype).reshape(32, 32)
    path = saved(tmp_path / "d.png", grey, icc_profile=icc.profile(law))
    right = icc.as_srgb(np.repeat((grey / top)[..., None], 3, -1), law, icc.SRGB)
    assert np.abs(read_image(path).rgba[..., :3] - right).max() < 3 / 255


def test_a_grey_drawing_with_a_profile_of_colours(tmp_path):
    grey = np.linspace(0, 255, 1024).astype(np.uint8).reshape(32, 32)
    path = saved(tmp_path / "d.png", grey, icc_profile=icc.profile(1.8, icc.SRGB))
    right = icc.as_srgb(np.repeat(grey[..., None] / 255.0, 3, -1), 1.8, icc.SRGB)
    assert np.abs(read_image(path).rgba[..., :3] - right).max() < 3 / 255


@pytest.mark.parametrize(
    "profile, words",
    [
        (icc.profile(2.2), "its colour profile is one of GRAY colours"),
        (icc.profile(2.2, icc.P3)[:150], "its colour profile is damaged"),
        (b"no profile at all", "its colour profile is damaged"),
        (icc.profile(2.2, icc.P3).replace(b"curv", b"crv?"), "its colour profile is damaged"),
    ],
)
def test_a_profile_that_says_nothing_is_left_out_with_a_word(tmp_path, profile, words):
    path = saved(tmp_path / "d.png", PATCHES, icc_profile=profile)
    with pytest.warns(UserWarning, match=words) as found:
        assert np.array_equal(read_image(path).rgba[..., :3], PATCHES / np.float32(255))
    assert len(found) == 1 and str(path) in str(found[0].message)


def test_cmyk_without_a_profile_is_said_to_be_plain(tmp_path):
    inks = np.zeros((24, 24, 4), np.uint8)
    inks[:, :12] = [0, 255, 255, 51]
    for suffix in ("tif", "jpg"):
        path = saved(tmp_path / f"d.{suffix}", inks, "CMYK")
        with pytest.warns(UserWarning, match="CMYK without a colour profile"):
            found = read_image(path).rgba
        assert np.abs(found[12, 4, :3] - [0.8, 0, 0]).max() < 0.02
        assert np.abs(found[12, 20, :3] - 1).max() < 0.02


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def with_chunks(path, *chunks):
    """Put chunks behind a PNG's header."""
    data = path.read_bytes()
    path.write_bytes(data[:33] + b"".join(chunk(*one) for one in chunks) + data[33:])
    return path


GAMMA_1 = (b"gAMA", struct.pack(">I", 100000))
GAMMA_SRGB = (b"gAMA", struct.pack(">I", 45455))
CHRM_SRGB = (b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000))
CHRM_P3 = (b"cHRM", struct.pack(">8I", 31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000))


@pytest.mark.parametrize(
    "chunks, law, colorants",
    [
        ([GAMMA_1], 1.0, icc.SRGB),
        ([GAMMA_1, CHRM_P3], 1.0, icc.P3),
        ([GAMMA_SRGB, CHRM_P3], 2.2, icc.P3),
    ],
)
def test_a_pngs_gamma_and_chromaticities_without_a_profile(tmp_path, chunks, law, colorants):
    path = with_chunks(saved(tmp_path / "d.png", PATCHES), *chunks)
    right = icc.as_srgb(PATCHES / 255.0, law, colorants)
    assert np.abs(read_image(path).rgba[..., :3] - right).max() < 2.5 / 255


@pytest.mark.parametrize(
    "chunks",
    [[GAMMA_SRGB], [GAMMA_SRGB, CHRM_SRGB], [CHRM_P3], [(b"sRGB", b"\0"), GAMMA_1, CHRM_P3]],
)
def test_a_pngs_chunks_that_change_nothing(tmp_path, chunks):
    path = with_chunks(saved(tmp_path / "d.png", PATCHES), *chunks)
    assert np.array_equal(read_image(path).rgba[..., :3], PATCHES / np.float32(255))


def test_a_profile_goes_before_a_pngs_gamma(tmp_path):
    path = saved(tmp_path / "d.png", PATCHES, icc_profile=icc.profile(icc.srgb_curve, icc.P3))
    right = icc.as_srgb(PATCHES / 255.0, icc.srgb_curve, icc.P3)
    assert np.abs(read_image(with_chunks(path, GAMMA_1)).rgba[..., :3] - right).max() < 2.5 / 255
