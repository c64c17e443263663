"""Clones of strokes are strokes of their own, where and as `use` draws them."""

import re

import numpy as np
import pytest
from svg_programs import small

from strokestyle import files
from strokestyle.svg.clones import write_out_clones
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.read_curves import read_curves_svg
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
        '<defs><use xlink:href="#s003"/></defs>',
        '<clipPath id="c"><use xlink:href="#s003"/></clipPath><use xlink:href="#c"/>',
        '<symbol id="d" width="0"><use xlink:href="#s003"/></symbol><use xlink:href="#d"/>',
    ],
)
def test_what_else_is_drawn_again_is_left_as_it_is(use):
    text = with_use(use).encode()
    assert write_out_clones(text) == text
    assert len(read_svg(text).strokes) == 5


SYMBOL = '<symbol id="y" overflow="visible" viewBox="0 10 60 50" {}>'
SYMBOL += '<g transform="scale(.5)">{}</g></symbol>'
SHOWN = "<g id='q'><use id='n' href='#s003' x='10%' y='3'/></g>"
CLONES = {  # what is drawn again, and how many strokes of five that makes
    "of a clone": ('<use id="b" href="#s003" x="5"/><use href="#b" y="2in"/>', 7),
    "of a group of clones": (SHOWN + '<use href="#q" transform="rotate(20)"/>', 7),
    "of a layer with a clone": ('<use id="b" href="#layer-contour"/><use href="#b" x="1"/>', 9),
    "before what it draws": ('<use href="#q" transform="scale(.5)"/>' + SHOWN, 7),
    "in definitions": (f"<defs>{SHOWN}</defs><use href='#q'/>", 6),
    "of a symbol": (SYMBOL.format("", SHOWN) + '<use href="#y"/>', 6),
    "of a symbol with sides": (
        SYMBOL.format('width="9" height="8"', SHOWN) + '<use href="#y" x="9" height="50%"/>',
        6,
    ),
    "of a symbol in a symbol": (
        SYMBOL.format('preserveAspectRatio="xMinYMax slice"', SHOWN)
        + '<symbol id="z" overflow="visible" viewBox="0 0 50 50">'
        '<use href="#y" width="25%" height="20"/></symbol>'
        '<use href="#z" width="80" height="40" transform="scale(-1 1)"/>',
        6,
    ),
    "of a symbol without a box": (
        '<symbol id="y" style="overflow:visible" transform="scale(2)">'
        + SHOWN
        + '</symbol><use href="#y" x="3"/><use href="#y"/>',
        7,
    ),
    "of more than strokes": (f'<g id="a"><text/>{SHOWN}<use href="#t"/></g><use href="#a"/>', 7),
}


@pytest.mark.parametrize("name", CLONES)
@pytest.mark.parametrize("texture", ["grain", None])
def test_clones_of_clones_groups_and_symbols_are_where_another_reader_has_them(name, texture):
    use, count = CLONES[name]
    # one size in pixels: the page is 1:1, and curves keep their order
    text = re.sub(r' (width|height)="[0-9.]+mm"', "", write_svg(small(texture)))
    text = with_use(use, text)
    strokes = read_svg(text).strokes
    assert len(strokes) == count
    curves = read_curves_svg(text.encode(), (120, 100), 0.1)
    assert sorted_points(strokes) == pytest.approx(sorted_points(curves), abs=0.02)


def sorted_points(lines):
    parts = np.split(lines.xy, lines.offsets[1:-1])
    return np.array(sorted(part.mean(axis=0).tolist() for part in parts))


def test_a_clone_in_a_file_with_a_prefix_and_a_look_of_its_own_sheet():
    sheet = "<style>use.pale{opacity:.5} #mine{display:inline} g.pale{display:none}</style>"
    use = '<use class="pale" id="mine" xlink:href="#s003" style="fill:red"/>'
    text = with_use(sheet + use)
    prefixed = text.replace("<svg ", '<svg xmlns:v="http://www.w3.org/2000/svg" ')
    for given in (text, prefixed.replace("<use", "<v:use")):
        got = read_svg(given)
        assert len(got.strokes) == 6
        assert got.color[5, 3] == pytest.approx(0.5 * got.color[3, 3], abs=0.01)


@pytest.mark.parametrize(
    "use",
    [
        '<g id="a"><path data-ss-path="M0 0h9" d="M0 0h9"/><use xlink:href="#a"/></g>',
        '<g id="a"><use href="#b"/></g><g id="b"><use href="#c"/></g><use id="c" href="#a"/>',
        '<use id="a" href="#a"/>',
    ],
)
def test_clones_of_themselves_are_refused(use):
    with pytest.raises(ValueError, match=r'line \d+, <use.*"#[abc]" draws itself: take it out$'):
        read_svg(with_use(use))


def test_a_bomb_of_clones_is_refused():
    bomb = '<g id="k0"><use href="#s003"/></g>'
    for k in range(40):
        bomb += f'<g id="k{k + 1}"><use href="#k{k}"/><use href="#k{k}"/></g>'
    with pytest.raises(ValueError, match="larger than 64 MB|more than 100000 elements"):
        read_svg(with_use(f"<defs>{bomb}</defs><use href='#k40'/>"))
    chain = "".join(f'<use id="k{k}" href="#k{k + 1}"/>' for k in range(400))
    with pytest.raises(ValueError, match="more than 60 clones of clones"):
        read_svg(with_use(chain + '<use id="k400" href="#s003"/>'))


def test_quotes_and_brackets_in_values_stay_values():
    use = '<use data-x="a > b" xlink:href="#s003" transform="translate(1 2)" class=\'a"b\'/>'
    assert len(read_svg(with_use(use)).strokes) == 6
    with pytest.raises(ValueError, match="bad transform"):
        read_svg(with_use(use.replace("translate(1 2)", "&quot;&gt;")))


def test_errors_name_the_lines_of_the_file():
    use = '<use\n xlink:href="#s003"\n id="u"/><use href="#u"/>\n<g class="stroke" id="bad">'
    use += '<path data-ss-path="M0 0" d="M0 0h9" data-ss-margin="1"/></g>'
    text = with_use(use)
    line = text[: text.index('<path data-ss-path="M0 0"')].count("\n") + 1
    with pytest.raises(ValueError, match=f'line {line}, stroke id="bad"'):
        read_svg(text)


def test_a_file_that_clones_make_too_large_is_refused(monkeypatch):
    text = with_use('<use xlink:href="#layer-contour"/>' * 9).encode()
    monkeypatch.setattr(files, "MAX_BYTES", 3 * len(text))
    with pytest.raises(ValueError, match="with what <use> draws again"):
        read_svg(text)
