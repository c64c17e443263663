"""Drawings as pixels, by way of the SVG that `strokestyle render` writes."""

import io

import numpy as np
from PIL import Image

from strokestyle.drawing.strokes import Drawing
from strokestyle.svg.write import png_from_svg, write_svg


def rastered(drawing: Drawing, size: tuple[int, int]) -> np.ndarray:
    """Draw on white: (H, W, 3) uint8, of `size` (width, height), px.

    A drawing of another size is resampled as the artist's are (dataset.read_image).
    """
    with Image.open(io.BytesIO(png_from_svg(write_svg(drawing)))) as image:
        rgb = image.convert("RGB")
    return np.asarray(rgb if rgb.size == size else rgb.resize(size, Image.Resampling.LANCZOS))
