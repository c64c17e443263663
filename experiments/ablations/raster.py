"""Drawings as pixels, by way of the SVG that `strokestyle render` writes."""

import io

import numpy as np
from PIL import Image

from strokestyle.drawing.strokes import Drawing
from strokestyle.svg.write import png_from_svg, write_svg


def rastered(drawing: Drawing) -> np.ndarray:
    """Draw on white: (H, W, 3) uint8."""
    with Image.open(io.BytesIO(png_from_svg(write_svg(drawing)))) as image:
        return np.asarray(image.convert("RGB"))
