"""Files of drawings: the pixels of every kind, or one line that names the file."""

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
