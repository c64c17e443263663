"""Clones of strokes are strokes of their own, where and as `use` draws them."""

import numpy as np
import pytest
from svg_programs import small

from strokestyle import files
from strokestyle.svg.clones import write_out_clones
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.write import write_svg

TEXT = write_svg(small("grain"), texture="vector")


def with_use(use, text=TEXT):
    return text.replace("</svg>", use + "</svg>")


@pytest.mark.parametrize("name", ["href", "xlink:href"])
@pytest.mark.parametrize("texture", ["grain", "colours", None])
def test_a_clone_is_a_stroke_where_it_is_drawn(name, texture):
    text = write_svg(small(texture))
    use = f'<use {name}="#s003" x="5" y="-2px" transform="scale(2) rotate(90)" id="mine"/>'
    was, got = read_svg_file(text), read_svg_file(with_use(use, text))
    assert got.ids == (*was.ids, "s003") and got.foreign_shapes == 0
    i = was.ids.index("s003")
    rows, clone = was.drawing.strokes.rows(i), got.drawing.strokes.rows(5)
    x, y = (was.drawing.strokes.xy[rows] + [5, -2]).T
    assert got.drawing.strokes.xy[clone] == pytest.approx(2 * np.stack([-y, x], axis=1), abs=1e-6)
    wide = 2 * was.drawing.strokes.thickness[rows]
    assert got.drawing.strokes.thickness[clone] == pytest.approx(wide)
    assert read_svg(write_svg(got.drawing)).strokes.xy.shape == got.drawing.strokes.xy.shape


def test_a_clone_of_a_layer_has_its_strokes_and_the_look_that_it_is_given():
    use = "<use xlink:href='#layer-contour' opacity='.5' style='display:inline' x='1'></use>"
    got = read_svg(with_use(use))
    assert len(got.strokes) == 7
    assert got.color[5:, 3] == pytest.approx(0.5 * got.color[3:5, 3], abs=0.01)
    assert len(read_svg(with_use(use.replace("inline", "none"))).strokes) == 5


@pytest.mark.parametrize(
    "use",
    [
        '<use xlink:href="#nobody"/>',
        '<use xlink:href="other.svg#s003"/>',
        '<text id="t">a</text><use xlink:href="#t"/>',
        "<use/>",
        '<g id="a"><path data-ss-path="M0 0h9" d="M0 0h9"/><use xlink:href="#a"/></g>',  # itself
        '<use id="b" xlink:href="#s003"/><use xlink:href="#b"/>',
        '<defs><use xlink:href="#s003"/></defs>',
    ],
)
def test_what_else_is_drawn_again_is_left_as_it_is(use):
    text = with_use(use).encode()
    made = write_out_clones(text)
    assert made.count(b"<use") == (
        1 if "clone's" in use or 'id="b"' in use else text.count(b"<use")
    )
    read_svg(made)


def test_quotes_and_brackets_in_values_stay_values():
    use = '<use data-x="a > b" xlink:href="#s003" transform="translate(1 2)" class=\'a"b\'/>'
    assert len(read_svg(with_use(use)).strokes) == 6
    with pytest.raises(ValueError, match="bad transform"):
        read_svg(with_use(use.replace("translate(1 2)", "&quot;&gt;")))


def test_a_file_that_clones_make_too_large_is_refused(monkeypatch):
    text = with_use('<use xlink:href="#layer-contour"/>' * 9).encode()
    monkeypatch.setattr(files, "MAX_BYTES", 3 * len(text))
    with pytest.raises(ValueError, match="with what <use> draws again"):
        read_svg(text)
