"""PDFs: what is on the page, against resvg's picture of the SVG and by the file's own words."""

import io
import re
import zlib

import numpy as np
import pytest
from PIL import Image
from small_drawings import drawing

from strokestyle.svg.pdf import path_operators, pdf_from_svg
from strokestyle.svg.write import png_from_svg, write_svg


def content(pdf):
    """The operators of the page."""
    streams = re.findall(
        rb"<<[^>]*?/Filter /FlateDecode[^>]*>>\nstream\n(.*?)\nendstream", pdf, re.S
    )
    return max((zlib.decompress(s) for s in streams), key=lambda s: s.count(b" gs")).decode()


@pytest.mark.parametrize("texture", ["none", "vector", "image"])
def test_paths_stay_paths_and_images_images(texture):
    svg = write_svg(drawing(texture="grain"), texture=texture, background="ivory")
    pdf = pdf_from_svg(svg)
    assert pdf == pdf_from_svg(svg) and pdf.startswith(b"%PDF-1") and b"Date" not in pdf
    assert pdf.count(b"/Subtype /Image") == 2 * svg.count("<image")  # colours, and opacity
    fills = re.findall(r"(?:^| )f(?: |$)", content(pdf))
    assert len(fills) == svg.count("<path") + 1  # the background
    labels = re.findall('inkscape:label="([^"]*)"', svg)
    assert re.findall(rb"/OCG\s*/Name \((\w+)\)", pdf) == [label.encode() for label in labels]


@pytest.mark.parametrize("size, box", [("A3", (1190.55118, 841.88976)), (None, (120, 90))])
def test_the_page_is_as_large_as_the_svg_s(size, box):
    pdf = pdf_from_svg(write_svg(drawing(), page_size=size, title="Tiß (1)"))
    found = re.search(rb"/MediaBox \[([^\]]*)\]", pdf)[1].split()
    assert [float(v) for v in found] == pytest.approx([0, 0, *box], abs=2e-4)
    assert f"/Title <feff{'Tiß (1)'.encode('utf-16-be').hex()}>".encode() in pdf


def test_a_path_is_the_path_that_it_was():
    assert path_operators("M1 2q3 0 3 3l1 1z", 2).startswith("1 2 m 3 2 4 3 4 5 c 5 6 l 1 2 l h")


@pytest.mark.parametrize("texture", ["none", "vector", "image"])
def test_another_program_draws_it_as_the_svg_is_drawn(texture):
    pymupdf = pytest.importorskip("pymupdf", reason="no program: pymupdf is not installed")
    svg = write_svg(drawing(texture="grain"), texture=texture)
    page = pymupdf.open(stream=pdf_from_svg(svg), filetype="pdf")[0]
    pixels = page.get_pixmap(matrix=pymupdf.Matrix(8 / 3, 8 / 3))
    seen = np.frombuffer(pixels.samples, np.uint8).reshape(pixels.height, pixels.width, 3)

    want = np.asarray(Image.open(io.BytesIO(png_from_svg(svg, 2.0))).convert("RGB"), float)
    assert np.abs(seen - want).mean() < 2.5


@pytest.mark.parametrize(
    "fill, same",
    [
        ("rgba(255, 51, 0, .5)", '#ff3300" fill-opacity=".5'),
        ("#ff3300 icc-color(Press, 0, .8, 1, 0)", "#ff3300"),
        ("transparent", "none"),
    ],
)
def test_a_fill_of_css_is_the_ink_that_it_says(fill, same):
    svg = '<svg width="9" height="9" viewBox="0 0 9 9"><path fill="{}" d="M0 0h9v9z"/></svg>'
    assert pdf_from_svg(svg.format(fill)) == pdf_from_svg(svg.format(same))


def test_what_is_no_drawing_of_ours_is_refused():
    with pytest.raises(ValueError, match="circle"):
        pdf_from_svg('<svg width="9" height="9" viewBox="0 0 9 9"><circle r="4"/></svg>')
