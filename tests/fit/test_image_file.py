"""Files of drawings: the pixels of every kind, or one line that names the file."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from strokestyle.fit.image_file import read_image


@pytest.mark.parametrize("content", [b"", b"not an image", b"\x89PNG\r\n\x1a\n" + b"0" * 40])
def test_files_that_are_no_image(tmp_path, content):
    path = tmp_path / "d.png"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="d.png"):
        read_image(path)


def test_truncated_image(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    Image.fromarray(noise).save(tmp_path / "d.png")
    whole = (tmp_path / "d.png").read_bytes()
    (tmp_path / "d.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="not a readable image"):
        read_image(tmp_path / "d.png")


ORIENTED = {2: Image.Transpose.FLIP_LEFT_RIGHT, 3: Image.Transpose.ROTATE_180,
            5: Image.Transpose.TRANSPOSE, 6: Image.Transpose.ROTATE_90,
            7: Image.Transpose.TRANSVERSE, 8: Image.Transpose.ROTATE_270}  # fmt: skip


@pytest.mark.parametrize("suffix", ["png", "tif", "webp", "jpg"])
def test_a_camera_held_upright(tmp_path, suffix):
    right = np.random.default_rng(1).integers(0, 256, (4, 6, 3), np.uint8)
    right = right.repeat(16, 0).repeat(16, 1)
    for orientation, turn in ORIENTED.items():
        exif = Image.Exif()
        exif[0x0112] = orientation
        path = tmp_path / f"d{orientation}.{suffix}"
        options = {"jpg": {"quality": 98, "subsampling": 0}, "webp": {"lossless": True}}
        Image.fromarray(right).transpose(turn).save(path, exif=exif, **options.get(suffix, {}))
        found = read_image(path)
        assert (found.width, found.height) == (96, 64)
        assert np.abs(found.rgba[..., :3] - right / 255.0).mean() < 0.01


def sheet(width, height):
    """RGBA of some strokes of ink on clear ground, smooth and of many thicknesses."""
    y, x = np.mgrid[:height, :width] + 0.5
    wave = 0.5 * height + 0.3 * height * np.sin(6.3 * x / width) - y
    cover = np.clip(3 + 12 * x / width - np.abs(wave), 0, 1)
    cover = np.maximum(cover, np.clip(4 - np.abs(np.hypot(x - width / 2, wave) - 50), 0, 0.6))
    rgb = np.stack([0.8 * x / width, 0.3 * y / height, 0.2 + 0 * x], axis=-1)
    return (np.dstack([rgb, cover]) * 255 + 0.5).astype(np.uint8)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA"])
@pytest.mark.parametrize("size", [(600, 400), (601, 403)])
def test_a_large_file_is_reduced_to_what_a_resampling_of_all_of_it_gives(tmp_path, mode, size):
    from strokestyle.fit.layout import lay, whole_placings

    image = Image.fromarray(sheet(*size))
    paper = Image.new("RGBA", size, (240, 235, 225, 255))
    image = image if mode.endswith("A") else Image.alpha_composite(paper, image)
    image.convert(mode).save(tmp_path / "d.png")
    view = (60, 60)
    whole, small = read_image(tmp_path / "d.png"), read_image(tmp_path / "d.png", view)
    assert whole.rgba.shape[:2] == size[::-1] and small.rgba.shape[1] == round(size[0] / 3)
    assert (small.width, small.height) == (whole.width, whole.height) == size
    for k in (1, 2):  # cropped, stretched
        a, b = (lay(scan, whole_placings(scan, *view)[k]) for scan in (whole, small))
        over = [scan[..., :3] * scan[..., 3:] + 1 - scan[..., 3:] for scan in (a, b)]
        assert np.abs(a[..., 3] - b[..., 3]).mean() < 0.5 / 255
        assert np.abs(over[0] - over[1]).mean() < 0.5 / 255


A4 = """
import sys
from strokestyle.fit.image_file import read_image
scan = read_image(sys.argv[1], (768, 768))
assert scan.rgba.shape == (2339, 1653, 4) and (scan.width, scan.height) == (4960, 7016)
peak = [line for line in open("/proc/self/status") if line.startswith("VmHWM")]
print(int(peak[0].split()[1]) / 1024)  # getrusage counts the parent's in
"""


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
def test_a4_at_600_dpi_is_never_held_as_floats(tmp_path):
    Image.new("L", (4960, 7016), 255).save(tmp_path / "a4.tif")
    done = subprocess.run(
        [sys.executable, "-c", A4, str(tmp_path / "a4.tif")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 400  # MB; more than 1200 with float32 of all of it
