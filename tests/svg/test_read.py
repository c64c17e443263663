"""Our files read back: as written, as other programs leave them, and damaged.

The programs are Inkscape, scour and svgo: tests/svg_programs.py.
"""

import gzip
import importlib.util
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage
from svg_programs import GOLDEN, NAMES, SAVES, UNGROUP, by_hand, run, small, with_parts

from strokestyle.drawing.edit import keep
from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.curves import KINDS
from strokestyle.geometry.parts import Parts
from strokestyle.svg.format import SvgOptions
from strokestyle.svg.landmarks import landmarks, recover_transform
from strokestyle.svg.path_data import parse_path
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.write import png_from_svg, write_svg

SMALL = {
    "none": None, "vector": "grain", "image": "grain", "format2": "grain", "format3": "grain"
}  # fmt: skip
ENCODINGS = [("none", None), ("vector", "grain"), ("image", "grain"), ("image", "colours")]


def rendered(text, scale=2.0):
    return np.asarray(Image.open(io.BytesIO(png_from_svg(text, scale))).convert("RGB")).astype(
        float
    )


def seen(drawing, scale=2.0):
    return rasterise(drawing, scale, (1, 1, 1)).astype(float)


def stroke(drawing, i):
    rows = slice(drawing.strokes.offsets[i], drawing.strokes.offsets[i + 1])
    return drawing.strokes.xy[rows], drawing.strokes.thickness[rows]


def in_paint_order(drawing):
    return np.argsort(-drawing.strokes.kind, kind="stable")


# --------------------------------------------------------------------------------------- round trip


@pytest.mark.parametrize("layers", ["kind", "none"])
@pytest.mark.parametrize("encoding, texture", ENCODINGS)
def test_write_read_write_gives_the_same_bytes(encoding, texture, layers):
    options = SvgOptions(
        texture=encoding, layers=layers, title='a "b" & <c>', description="é", author="A & B",
        license="CC-BY-SA-4.0",
        background="#fffaf0", page_size="A5", decimals=3, texture_res=1.5,
    )  # fmt: skip
    first = write_svg(small(texture), options)
    file = read_svg_file(first)
    assert file.options == options and len(file.kept) == 5
    assert write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids) == first
    assert write_svg(file.drawing, file.options, kept=file.kept) == first
    again = read_svg_file(
        write_svg(file.drawing, file.options, kept=file.kept)
    ).drawing  # all drawn anew
    for name in ("xy", "thickness"):
        assert getattr(again.strokes, name) == pytest.approx(
            getattr(file.drawing.strokes, name), abs=0.001
        )


@pytest.mark.parametrize("encoding, texture", ENCODINGS)
def test_what_is_read_is_what_was_written(encoding, texture):
    drawing = small(texture)
    got = read_svg(write_svg(drawing, texture=encoding))
    assert got.size == drawing.size and (got.texture is None) == (texture is None)
    for k, i in enumerate(in_paint_order(drawing)):
        (xy, width), (want_xy, want_width) = stroke(got, k), stroke(drawing, i)
        assert xy[[0, -1]] == pytest.approx(want_xy[[0, -1]], abs=0.0051)
        along = [np.r_[0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))] for line in (xy, want_xy)]
        there = np.interp(along[1] / along[1][-1], along[0] / along[0][-1], width)
        assert there == pytest.approx(want_width, abs=0.01)
        assert (
            got.strokes.closed[k] == drawing.strokes.closed[i]
            and got.strokes.kind[k] == drawing.strokes.kind[i]
        )
        assert got.color[k] == pytest.approx(drawing.color[i], abs=0.001)
    # texture is read off what is drawn: blocky noise in three tones, or in images of 1.5 pixels a
    # pixel
    shown = rendered(write_svg(drawing, texture=encoding)) if texture else seen(drawing)
    blank = np.abs(255 - seen(drawing)).mean()
    assert (
        np.abs(seen(got) - shown).mean()
        < {"none": 0.002, "vector": 0.12, "image": 0.12}[encoding] * blank
    )


def test_a_file_a_text_bytes_and_svgz_are_the_same(tmp_path):
    text = write_svg(small("grain"), title="t")
    (tmp_path / "a.svg").write_text(text)
    (tmp_path / "a.svgz").write_bytes(gzip.compress(text.encode()))
    names = [
        str(tmp_path / "a.svg"),
        tmp_path / "a.svgz",
        text.encode(),
        gzip.compress(text.encode()),
    ]
    for source in (*names, "\ufeff" + text):
        got = read_svg(source)
        assert np.array_equal(got.strokes.xy, read_svg(text).strokes.xy)
        assert np.array_equal(got.texture.rgba, read_svg(text).texture.rgba)
    with pytest.raises(FileNotFoundError):
        read_svg(tmp_path / "b.svg")
    (tmp_path / "c.svg").write_text("<svg/>")
    with pytest.raises(ValueError, match=r"c\.svg: no strokes"):
        read_svg(tmp_path / "c.svg")


def test_an_empty_drawing_stays_one():
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (40, 30), np.zeros((0, 4)))
    text = write_svg(nothing, title="none")
    assert read_svg(text).size == (40, 30) and not len(read_svg(text).strokes)
    assert write_svg(read_svg(text), title="none") == text


def test_a_changed_stroke_is_drawn_anew_and_the_others_are_not():
    file = read_svg_file(write_svg(small("grain")))
    drawing = file.drawing
    thickness = drawing.strokes.thickness.copy()
    thickness[: drawing.strokes.offsets[1]] *= 1.5
    changed = replace(drawing, strokes=replace(drawing.strokes, thickness=thickness))
    lines = [
        write_svg(d, file.options, ids=file.ids, kept=file.kept).split("\n<g id=")[1:]
        for d in (drawing, changed)
    ]
    assert [a == b for a, b in zip(*lines, strict=True) if 'class="stroke"' in a] == [False] + 4 * [
        True
    ]


def test_ids_are_kept_unless_they_are_none_or_taken():
    drawing = small(None)
    text = write_svg(drawing, ids=["a", "", "a", "paper", "b<c"])
    found = re.findall(r'<path id="([^"]*)"', text)
    assert (
        len(set(found)) == 5 and "a" in found and "paper" not in found and "<" not in "".join(found)
    )
    assert read_svg_file(text).ids == tuple(found)


# ----------------------------------------------------------------------------------- other programs


@pytest.mark.parametrize("encoding", SMALL)
@pytest.mark.parametrize("program", SAVES)
def test_a_save_loses_no_stroke_and_no_width(encoding, program):
    ours, theirs = (
        read_svg_file(GOLDEN / f"{encoding}.svg"),
        read_svg_file(GOLDEN / f"{encoding}-{program}.svg"),
    )
    same_as(theirs.drawing, ours.drawing)
    assert theirs.options.title == "Small & plain"
    assert (
        theirs.options.texture
        == ours.options.texture
        == {"format2": "vector", "format3": "vector"}.get(encoding, encoding)
    )
    assert theirs.foreign_shapes == theirs.hidden == 0
    if program != "svgo":  # which takes metadata out
        assert theirs.options.author == "Ann" and theirs.options.license == "CC-BY-4.0"


@pytest.mark.parametrize("encoding", ("none", "vector", "image", "parts"))
@pytest.mark.parametrize("program", ("inkscape", "inkscape-plain", "scour", "svgo"))
def test_a_save_by_another_program_wears_nothing(encoding, program):
    files = [read_svg_file(GOLDEN / f"{name}.svg") for name in (encoding, f"{encoding}-{program}")]
    ours, theirs = (write_svg(file.drawing, file.options, kept=file.kept) for file in files)
    body = ours.index('<g id="layer-')
    if program == "svgo" and encoding in ("none", "parts"):  # its outlines stay as it rounded them
        saved = (GOLDEN / f"{encoding}-svgo.svg").read_text()
        told = [re.findall(r' d="([^"]*)"', text) for text in (theirs, saved)]
        assert len(files[1].kept) == 5 and told[0] == told[1]
    else:
        assert theirs[theirs.index('<g id="layer-') :] == ours[body:]


def test_the_look_of_a_stroke_may_be_told_in_other_words():
    """A fill is the layer's, an opacity in a style, and path data begin with a small letter."""
    text = write_svg(small("grain"), texture="vector")
    other = text.replace('class="stroke" fill="#1a284d"', 'class="stroke"')
    other = other.replace('inkscape:groupmode="layer"', 'style="fill:rgb(26,40,77)"')
    other = re.sub('fill-opacity="([^"]*)" style="opacity:1"', r'style="fill-opacity:\1"', other)
    other = other.replace(' d="M', ' stroke="none" d="m')
    file = read_svg_file(other)
    made = write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids)
    assert made == text != other and len(file.kept) == 5


@pytest.mark.parametrize(
    "change", [("scale(.15)", "scale(.15)skewX(9)"), ("opacity:1", "opacity:.9")]
)
def test_a_tone_that_our_words_cannot_say_is_drawn_anew(change):
    text = write_svg(small("grain"), texture="vector")
    at = text.index('class="tone"')
    made = text[:at] + text[at:].replace(*change, 1)
    assert made != text and len(read_svg_file(made).kept) == 4


@pytest.mark.parametrize("texture", [None, "grain"])
def test_a_page_that_was_cut_keeps_no_stroke_where_it_was(texture):
    text = write_svg(small(texture)).replace('viewBox="0 0 120 100"', 'viewBox="18 12 61 50"')
    file = read_svg_file(text)
    assert file.drawing.size == (61, 50) and len(file.kept) == (5 if texture else 0)
    made = read_svg(write_svg(file.drawing, file.options, kept=file.kept))
    assert made.strokes.xy == pytest.approx(file.drawing.strokes.xy, abs=0.01)
    if texture is not None:  # by whole steps of the grid of tones: other numbers stay
        again = write_svg(file.drawing, file.options, kept=file.kept)
        tones = [re.findall(' d="M[^q]*(q[^"]*)"', each) for each in (text, again)]
        same = [a == b for a, b in zip(*tones, strict=True)]
        assert sum(same) >= len(same) - 1  # one has a ring that encloses nothing


@pytest.mark.parametrize(
    "transform",
    ["translate(4.4 -2.3)", "rotate(9 60 50)", "scale(.8)", "scale(-1 1) translate(-120 0)"],
)
def test_tones_that_a_hand_moved_are_moved_once_and_not_drawn_anew(transform):
    text = write_svg(small("grain"), texture="vector")
    text = text.replace('<g id="layer-', f'<g transform="{transform}" id="layer-')
    file = read_svg_file(text)
    made = write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids)
    ink = 255 - rendered(text).min(axis=2)
    far = np.abs(rendered(made) - rendered(text)).mean(axis=2)
    anew = np.abs(rendered(write_svg(file.drawing, file.options)) - rendered(text)).mean(axis=2)
    assert len(file.kept) == 5 and (ink * far).sum() < 0.75 * (ink * anew).sum()
    again = read_svg_file(made)
    assert write_svg(again.drawing, again.options, kept=again.kept, ids=again.ids) == made
    for got, want in zip(again.drawing.strokes.xy, file.drawing.strokes.xy, strict=True):
        assert got == pytest.approx(want, abs=0.006)


def same_as(got, want):
    assert len(got.strokes) == len(want.strokes) and got.size == want.size
    assert got.strokes.xy == pytest.approx(want.strokes.xy, abs=0.002)
    assert got.strokes.thickness == pytest.approx(want.strokes.thickness, abs=0.0005)
    assert np.array_equal(got.strokes.kind, want.strokes.kind)
    assert np.array_equal(got.strokes.closed, want.strokes.closed)
    assert got.color == pytest.approx(want.color, abs=0.001)
    if want.texture is not None:
        assert (
            got.texture.rgba.shape == want.texture.rgba.shape
        )  # numbers were rounded: an edge is a texel off
        assert (np.abs(got.texture.rgba - want.texture.rgba.astype(int)) > 3).any(
            axis=2
        ).mean() < 0.06


def check_by_hand(ours, theirs, text):
    """What tests/svg_programs.BY_HAND does to the file."""
    assert theirs.strokes.kind.tolist() == [
        KINDS.index(k) for k in ("valley", "suggestive", "crease", "crease", "contour")
    ]
    for i, offset in ((0, (8, -1)), (2, (0, 0)), (3, (0, 15))):
        (xy, width), (was, was_width) = stroke(theirs, i), stroke(ours, min(i, 2))
        assert xy == pytest.approx(was + offset, abs=0.03) and width == pytest.approx(
            was_width, abs=0.005
        )
    (xy, width), (was, was_width) = stroke(theirs, 1), stroke(ours, 1)
    turn = np.linalg.lstsq(was - was.mean(axis=0), xy - xy.mean(axis=0), rcond=None)[0]
    assert turn == pytest.approx(np.array([[np.sqrt(3), 1], [-1, np.sqrt(3)]]) / 2, abs=0.01)
    assert width == pytest.approx(was_width, abs=0.01) and theirs.strokes.closed[1]
    (xy, width), (was, was_width) = stroke(theirs, 4), stroke(ours, 4)
    assert width == pytest.approx(1.5 * was_width, abs=0.01)
    assert np.ptp(xy, axis=0) == pytest.approx(1.5 * np.ptp(was, axis=0), abs=0.05)
    blank = np.abs(255 - seen(theirs)).mean()  # three tones tell this blocky noise by halves only
    assert (
        np.abs(rendered(text) - seen(theirs)).mean()
        < (0.3 if theirs.texture is not None else 0.03) * blank
    )


@pytest.mark.parametrize("encoding", SMALL)
@pytest.mark.parametrize("after", ["", "-svgo"])
def test_strokes_moved_turned_scaled_doubled_and_grouped_by_hand(encoding, after):
    path = GOLDEN / f"{encoding}-moved{after}.svg"
    check_by_hand(read_svg(GOLDEN / f"{encoding}.svg"), read_svg(path), path.read_text())


@pytest.mark.parametrize("program", ["inkscape", "scour", "svgo"])
def test_a_save_by_the_program_itself(program, tmp_path):
    (tmp_path / "a.svg").write_text(write_svg(small("grain")))
    if not run(SAVES[program], tmp_path / "a.svg", tmp_path / "b.svg"):
        pytest.skip(f"no program: {SAVES[program].split()[0]} is not installed, or does not run")
    same_as(read_svg(tmp_path / "b.svg"), read_svg(tmp_path / "a.svg"))


def test_a_hand_in_inkscape_itself(tmp_path):
    (tmp_path / "a.svg").write_text(write_svg(small(None)))
    if not by_hand(tmp_path / "a.svg", tmp_path / "b.svg"):
        pytest.skip("no program: inkscape is not installed, or does not run")
    check_by_hand(
        read_svg(tmp_path / "a.svg"), read_svg(tmp_path / "b.svg"), (tmp_path / "b.svg").read_text()
    )


# ------------------------------------------------------------------------------- what a hand may do


def edited(encoding="image", texture="grain", **changes):
    """A file with a piece of its text replaced, and what is read of it."""
    text = write_svg(small(texture), texture=encoding)
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new, 1)
    return text, read_svg_file(text)


@pytest.mark.parametrize("encoding, texture", ENCODINGS)
@pytest.mark.parametrize(
    "transform", ["translate(5 3) rotate(20)", "scale(.5)", "scale(-1 1) translate(-120 0)"]
)
def test_layer_transforms_are_composed(encoding, texture, transform):
    text, file = edited(
        encoding,
        texture,
        a=('<g id="layer-contour"', f'<g id="layer-contour" transform="{transform}"'),
    )
    limit = {"none": 0.5, "image": 3.0, "vector": 5.0}[encoding]
    assert np.abs(rendered(text) - seen(file.drawing)).mean() < limit
    assert len(file.kept) == (5 if encoding == "vector" and "(.5" not in transform else 3)
    again = rendered(write_svg(file.drawing, file.options, kept=file.kept))
    assert np.abs(again - rendered(text)).mean() < limit + (texture is not None)


@pytest.mark.parametrize(
    "written, box, same",
    [
        ("0 -159.0303 768 1086.0606", "0 -159.03 768 1086.1", True),  # scour
        ("0 -159.0303 768 1086.0606", "0 -159 768 1090", True),  # to three digits
        ("0 -159.0303 768 1086.0606", "0 -159 768 1086", True),  # svgo to none
        ("0 -159.0303 768 1086.0606", "0 -159.2 768 1086.1", False),
        ("0 0 768 768", "0 0 800 800", False),
        ("0 0 768 768", "0 0 770 770", False),
        ("0 0 768 768", "0 0 700 768", False),
    ],
)
def test_a_page_that_was_rounded_is_the_page_that_was_written(written, box, same):
    root = f'<svg data-ss-size="768 768" data-ss-page="{written}" viewBox="{box}">'
    drawing = read_svg(root + '<path data-ss-path="M0 0l9 9"/></svg>')
    assert (drawing.size == (768, 768)) is same


def test_transforms_nest_and_scale_widths_by_the_root_of_their_determinant():
    body = (
        '<g transform="scale(2 8)"><g transform="translate(1 1)">'
        '<path transform="rotate(90)" {}/></g></g>'
    )
    text = (
        '<svg viewBox="0 0 100 100">'
        + body.format('data-ss-path="M1 0l2 0" data-ss-width="1 3"')
        + "</svg>"
    )
    drawing = read_svg(text)
    assert drawing.strokes.xy == pytest.approx(np.array([[2.0, 16.0], [2.0, 32.0]]))
    assert drawing.strokes.thickness == pytest.approx(np.array([4.0, 12.0]))
    assert drawing.strokes.kind[0] == KINDS.index("other") and drawing.size == (100, 100)


def test_recoloured_faded_and_hidden_strokes():
    text, file = edited("vector", a=('fill="#1a284d"', 'style="fill:rgb(255,0,0);opacity:.5"'))
    assert file.drawing.color[0] == pytest.approx([1, 0, 0, 0.4], abs=0.003)
    strip = file.drawing.texture.rgba[: file.drawing.texture.offsets[1]]
    assert (strip[strip[..., 3] > 0][:, :3] == [255, 0, 0]).all() and 100 <= strip[
        ..., 3
    ].max() <= 128
    assert not np.array_equal(strip[..., 3], strip[..., 3] * 0)
    _, file = edited(
        a=('<g id="layer-contour"', '<g id="layer-contour" opacity=".5" style="display:inline"')
    )
    assert file.drawing.color[:, 3] == pytest.approx([0.8, 0.8, 0.8, 0.4, 0.4])
    _, file = edited(a=('<g id="layer-contour"', '<g id="layer-contour" style="display:none"'))
    assert len(file.drawing.strokes) == 3 and file.hidden == 2
    _, file = edited(
        a=('<g id="layer-contour"', '<g id="layer-contour" fill="navy" visibility="hidden"')
    )
    assert len(file.drawing.strokes) == 3 and file.hidden == 2


@pytest.mark.parametrize("encoding", ["none", "vector", "image"])
@pytest.mark.parametrize(
    "rules, attributes",
    [  # s004 is a contour
        ("#s004{fill:#f00}", 'fill="#f00"'),
        (".hot{opacity:50%}", 'opacity=".5"'),
        ("#layer-contour > .stroke{transform:rotate(20deg)}", 'transform="rotate(20)"'),
        ("#s004{transform-origin:0 20%}", 'transform="translate(0 20)rotate(9)translate(0 -20)"'),
        ("#s004{visibility:hidden}", 'visibility="hidden"'),
        (".contour .hot,.x{display:none}", 'display="none"'),
    ],
)  # fmt: skip
def test_style_sheets_are_obeyed(encoding, rules, attributes):
    text = write_svg(
        keep(small(SMALL[encoding]), [True, True, False, True, True]), texture=encoding
    )
    text = text.replace('id="s003"', 'id="s004"')
    text = re.sub('(id="s004"[^>]*)class="stroke"', r'\1class="stroke hot"', text)
    plain = re.sub('id="s004"', f'id="s004" {attributes}', text)
    if "fill" in rules:
        plain = re.sub('( fill="#f00"[^>]*?) fill="[^"]*"', r"\1", plain)
    if "origin" in rules:
        text = text.replace('id="s004"', 'id="s004" transform="rotate(9)"')
    sheet = f"<style><![CDATA[/* ours */ {rules}]]></style>"
    got, want = (
        read_svg_file(each) for each in (re.sub("(?=<title|<g )", sheet, text, count=1), plain)
    )
    same_as(got.drawing, want.drawing)
    assert got.drawing.color == pytest.approx(want.drawing.color)
    assert (got.hidden, got.foreign_shapes) == (want.hidden, 0)
    assert len(got.kept) == len(want.kept)
    assert (
        got.hidden
        or np.abs(
            rendered(write_svg(got.drawing, got.options, kept=got.kept)) - seen(got.drawing)
        ).mean()
        < 6
    )


def test_a_sheet_of_other_things_changes_nothing():
    text = write_svg(small("grain"))
    sheet = "<style>.stroke{cursor:pointer}.tone:hover{fill:red}</style>"
    sheet += "<style media='print'>*{fill:red}</style>"
    file = read_svg_file(text.replace("<g ", sheet + "<g ", 1))
    assert write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids) == text


def test_shapes_of_others_are_counted_and_definitions_are_not():
    _, file = edited(
        a=(
            "</svg>",
            '<rect width="9" height="9"/><text>x</text><defs><path d="M0 0h9"/></defs></svg>',
        )
    )
    assert file.foreign_shapes == 2 and len(file.drawing.strokes) == 5
    line = '<path data-ss-path="M0 0l1 1"/>'
    pattern = f"<defs>{line}</defs><clipPath>{line}</clipPath>"
    assert len(edited(a=("</svg>", pattern + "</svg>"))[1].drawing.strokes) == 5


def test_effects_on_strokes_are_counted():
    assert edited()[1].effects == 0
    _, file = edited(
        a=(
            '<g id="layer-contour"',
            '<g id="layer-contour" clip-path="url(#c)" style="mask : url(#m);fill:url(#g)"',
        ),
        b=(
            "</svg>",
            '<rect width="9" height="9" fill="url(#g)"/></svg>',
        ),  # a shape that is left out as a whole
    )
    assert file.effects == 3 and file.foreign_shapes == 1 and len(file.drawing.strokes) == 5


@pytest.mark.parametrize("encoding, texture", ENCODINGS)
def test_a_stroke_may_be_made_very_large(encoding, texture):
    text, file = edited(
        encoding,
        texture,
        a=('<g id="layer-contour"', '<g id="layer-contour" transform="scale(900)"'),
    )
    before = read_svg(text.replace(' transform="scale(900)"', ""))
    assert file.drawing.strokes.thickness.max() == pytest.approx(
        900 * before.strokes.thickness.max(), rel=0.2
    )
    assert write_svg(file.drawing, texture="none").count('class="stroke"') == 5


def test_a_page_that_was_cut_moves_the_strokes():
    _, file = edited("none", None, a=('viewBox="0 0 120 100"', 'viewBox="20 10 60.5 50"'))
    assert file.drawing.size == (61, 50)
    xy, _ = stroke(file.drawing, 0)
    assert xy == pytest.approx(stroke(read_svg(GOLDEN / "none.svg"), 0)[0] - [20, 10])
    larger = {"a": ('width="31.75mm"', 'width="10cm"'), "b": ('height="26.4583mm"', 'height="8cm"')}
    _, file = edited("none", None, **larger)
    assert file.drawing.size == (120, 100)  # another size on paper is the same drawing


def test_a_flat_stroke_pasted_among_textured_ones_looks_as_it_did():
    flat = re.search(r"<path id=.*?/>", write_svg(small(None)))[0]
    text, file = edited(a=("</svg>", flat + "</svg>"))
    assert len(file.drawing.strokes) == 6 and len(file.drawing.texture.offsets) == 7
    only = Drawing(
        *(
            getattr(read_svg(f'<svg viewBox="0 0 120 100">{flat}</svg>'), n)
            for n in ("strokes", "size", "color")
        )
    )
    both = seen(file.drawing)
    ink = seen(only).mean(axis=2) < 128
    assert both[ink].mean() < seen(read_svg(write_svg(small("grain"))))[ink].mean() - 20


def test_an_outline_edited_by_hand_is_kept_while_the_stroke_is_not_changed():
    text = write_svg(small(None))
    d = re.search(r' d="([^"]*)"', text)[1]
    bent = text.replace(d, "M5 5c1 2 3 4 9 9z", 1)
    file = read_svg_file(bent)
    assert write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids) == bent
    assert np.array_equal(file.drawing.strokes.xy, read_svg(text).strokes.xy)


@pytest.mark.parametrize(
    "matrix",
    [
        (1, 0, 0, 1, 30, -4),
        (0.8, 0.6, -0.6, 0.8, 5, 1),
        (-1, 0, 0, 1, 90, 0),
        (2, 0.3, 0, 0.7, 1, 2),
    ],
)
def test_a_transform_written_into_the_coordinates_is_found(matrix):
    t = np.linspace(0, 2 * np.pi, 400)
    line = np.stack([30 + 20 * np.cos(t), 40 + 8 * np.sin(t) + 3 * np.cos(2 * t)], axis=1)
    a, b, c, d, e, f = matrix
    moved = np.stack(
        [a * line[:, 0] + c * line[:, 1] + e, b * line[:, 0] + d * line[:, 1] + f], axis=1
    )
    found = recover_transform(landmarks(line), landmarks(moved), moved)
    assert found == pytest.approx(matrix, abs=0.02)
    bent = moved + np.stack([np.zeros(400), 9 * np.sin(3 * t) ** 2], axis=1) * (t[:, None] > 3)
    assert recover_transform(landmarks(line), landmarks(bent), bent) is None


def test_width_by_arc_length_and_curved_centre_lines():
    head = (
        '<svg viewBox="0 0 50 50">'
        '<path data-ss-closed="{}" data-ss-path="{}" data-ss-width="{}"/></svg>'
    )
    drawing = read_svg(head.format(0, "M0 0L10 0", "0,1 .25,3 1,3"))
    assert drawing.strokes.xy[:, 0].tolist() == [
        0,
        2.5,
        10,
    ] and drawing.strokes.thickness.tolist() == [1, 3, 3]
    drawing = read_svg(head.format(0, "M10 25A15 15 0 0 1 40 25", "2"))
    assert np.hypot(*(drawing.strokes.xy - 25).T) == pytest.approx(15, abs=0.06)
    drawing = read_svg(head.format(1, "M0 0L10 0 10 10", "1 2 3"))
    assert drawing.strokes.closed[0] and np.array_equal(
        drawing.strokes.xy[0], drawing.strokes.xy[-1]
    )


def test_version_1_is_read_as_flat_ink():
    text = re.sub(
        r' data-ss-(texture|margin|at|size|page|options)="[^"]*"', "", write_svg(small("grain"))
    )
    drawing = read_svg(text.replace('data-ss-format="3"', 'data-ss-format="1"'))
    assert drawing.texture is None and len(drawing.strokes) == 5 and drawing.size == (120, 100)


@pytest.mark.parametrize("encoding", ["none", "vector", "image"])
def test_what_is_pressed_flat_is_not_drawn(encoding):
    text, file = edited(
        encoding, None if encoding == "none" else "grain",
        a=('<g id="layer-contour"', '<g id="layer-contour" transform="scale(1 0)"'),
    )  # fmt: skip
    assert len(file.drawing.strokes) == 3 and file.hidden == 2


def test_a_deleted_tone_moves_no_stroke():
    text = write_svg(small("grain"), texture="vector")
    tones = re.findall(r'\n<path class="tone" [^>]*/>', text)
    assert len(tones) == 10
    for tone in tones:
        got = read_svg(text.replace(tone, ""))
        assert got.strokes.xy == pytest.approx(read_svg(text).strokes.xy, abs=0.001)


def test_a_stroke_of_format_3_may_lose_its_lightest_tone():
    text = (GOLDEN / "format3.svg").read_text()
    for lightest in re.findall(r'class="stroke".*\n(<path [^>]*/>)', text):
        got = read_svg(text.replace(lightest, ""))
        assert got.strokes.xy == pytest.approx(read_svg(text).strokes.xy, abs=0.001)


def test_tones_of_a_stroke_whose_data_were_deleted_are_told():
    text = write_svg(small("grain"), texture="vector")
    first = re.search(r"<path [^>]*data-ss-path[^>]*/>", text)[0]
    file = read_svg_file(text.replace(first, ""))
    assert len(file.drawing.strokes) == 4 and file.lost_tones == file.foreign_shapes == 2


@pytest.mark.parametrize("encoding", ["vector", "image"])
def test_strokes_outlast_ungroup_in_inkscape(encoding):
    ours, file = (read_svg_file(GOLDEN / f"{encoding}{end}.svg") for end in ("", "-ungrouped"))
    assert "<g id" not in re.sub(
        "<g id=.layer", "", (GOLDEN / f"{encoding}-ungrouped.svg").read_text()
    )
    same = ours.drawing.strokes.kind != KINDS.index("valley")  # a layer that was moved then
    got, want = keep(file.drawing, same), keep(ours.drawing, same)
    same_as(got, want)
    moved, was = keep(file.drawing, ~same), keep(ours.drawing, ~same)
    assert moved.strokes.xy == pytest.approx(was.strokes.xy + [1, 2], abs=0.03)
    assert file.foreign_shapes == file.lost_tones == 0
    assert np.abs(seen(moved) - rendered(write_svg(moved))).mean() < 6


def test_strokes_outlast_ungroup_by_inkscape_itself(tmp_path):
    (tmp_path / "a.svg").write_text(write_svg(small("grain"), texture="image"))
    if not by_hand(tmp_path / "a.svg", tmp_path / "b.svg", UNGROUP):
        pytest.skip("no program: inkscape is not installed, or does not run")
    assert len(read_svg(tmp_path / "b.svg").strokes) == 5


@pytest.mark.parametrize(
    "fill, wanted",
    [
        ("rgb(300,0,0)", [1, 0, 0, 1]),  # beyond what there is: the last there is
        ("rgb(999999999999999999999999999,0,0)", [1, 0, 0, 1]),
        ("rgba(255, 51, 0, .5)", [1, 0.2, 0, 0.5]),
        ("rgb(100% 20% 0% / 50%)", [1, 0.2, 0, 0.5]),
        ("rgb(127.5 0 .0)", [0.5, 0, 0, 1]),
        ("hsl(120deg 100% 25%)", [0, 0.5, 0, 1]),
        ("hsla(480, 100%, 25%, 1)", [0, 0.5, 0, 1]),
        ("#f308", [1, 0.2, 0, 8 / 15]),
        (" REBECCAPURPLE ", [0.4, 0.2, 0.6, 1]),
        ("#ff3300 icc-color(Press, 0, .8, 1, 0)", [1, 0.2, 0, 1]),  # as Inkscape and Scribus do
        ("url(#gone) #f30", [1, 0.2, 0, 1]),
        ("url(#gone) none", [0, 0, 0, 1]),  # a gradient was there, so that ink was
        ("transparent", [0, 0, 0, 0]),
        ("rgb(1 2)", [0, 0, 0, 1]),  # none that we know
        ("color(srgb 1 0 0)", [0, 0, 0, 1]),
    ],
)
def test_a_fill_is_read_as_css_says_it(fill, wanted):
    _, file = edited("vector", a=('fill="#1a284d"', f'fill="{fill}"'))
    opacity = small("grain").color[0, 3]
    assert file.drawing.color[0] == pytest.approx([*wanted[:3], wanted[3] * opacity], abs=1e-6)


# ------------------------------------------------------------------------------ damaged and hostile


@pytest.mark.parametrize(
    "old, new, found",
    [
        ('data-ss-format="4"', 'data-ss-format="7"', "newer"),
        ('data-ss-path="M', 'data-ss-path="q', "data-ss-path"),
        ('data-ss-path="M', 'data-ss-path="M1e9 ', "data-ss-path"),
        ('data-ss-width="', 'data-ss-width="nan ', "data-ss-width"),
        ('data-ss-width="', 'data-ss-width="-1,', "data-ss-width"),
        (" data-ss-class", ' data-ss-texture="AAAA" data-x', "no PNG"),
        (" data-ss-class", ' data-ss-texture="?" data-x', "base64"),
        (' d="M', ' d="M1 1q1 2', "expected"),
        ('data-ss-margin="', 'data-ss-margin="1000', "margin"),
        ('data-ss-size="120', 'data-ss-size="9999999', "canvas"),
        ('data-ss-size="120', 'data-ss-size="1 120', "no width and height"),
        ('data-ss-size="120 ', 'data-ss-size="', 'data-ss-size="100" is no width and height'),
        ('<g id="layer-contour"', '<g id="layer-contour" transform="scale(1e9)"', "far"),
        ("</svg>", "", "XML"),
        ('<?xml version="1.0" encoding="utf-8" ?>', '<!DOCTYPE svg [<!ENTITY a "b">]>', "DOCTYPE"),
    ],
)
def test_damage_is_named_in_one_line(old, new, found):
    text = write_svg(small("grain"))
    assert old in text
    with pytest.raises(ValueError, match=found) as caught:
        read_svg(text.replace(old, new, 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "evil", ['onload="alert(1)"', 'style="fill:url(http://x)"', 'xml:base="http://x"']
)
def test_foreign_attributes_of_a_stroke_are_not_passed_on(evil):
    text = write_svg(small("grain"), texture="image")
    for old in (' class="stroke"', "<image "):
        made = text.replace(old, old.rstrip() + " " + evil + " ", 1)
        again = write_svg(read_svg(made))
        assert evil in made and evil not in again and len(read_svg(again).strokes) == 5


def test_foreign_elements_in_a_stroke_are_not_passed_on():
    text = write_svg(small("grain"), texture="image")
    made = text.replace("<image ", "<script>alert(1)</script><image ").replace(
        "data:image/png", "data:image/svg+xml"
    )
    again = write_svg(read_svg(made))
    assert "script" not in again and "svg+xml" not in again and len(read_svg(again).strokes) == 5


def fuzz():
    path = Path(__file__).parent.parent.parent / "benchmarks" / "fuzz_svg.py"
    spec = importlib.util.spec_from_file_location("fuzz_svg", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_random_damage_is_read_or_refused():
    module = fuzz()
    outcomes = [
        module.attempt(data)[0].startswith("read") for _, data in module.cases(100, 1, module.HEAVY)
    ]
    assert len(outcomes) == 100 and 10 < sum(outcomes) < 90


def test_textures_of_a_margin_of_their_own_are_kept():
    drawing = small("grain")
    texture = Texture(drawing.texture.rgba, drawing.texture.offsets, [0.5, 1, 1.5, 2, 2.5])
    got = read_svg(write_svg(replace(drawing, texture=texture)))
    assert got.texture.margin.tolist() == texture.margin[in_paint_order(drawing)].tolist()


# -------------------------------------------------------------------------------------------- parts


def part_names(drawing):
    return [drawing.parts.name(i) for i in range(len(drawing.parts))]


@pytest.mark.parametrize("layers", ["kind", "part", "none"])
@pytest.mark.parametrize("encoding, texture", ENCODINGS)
def test_parts_are_written_read_and_written_the_same(encoding, texture, layers):
    first = write_svg(with_parts(small(texture)), texture=encoding, layers=layers)
    file = read_svg_file(first)
    assert file.options.layers == layers and len(file.kept) == 5
    assert file.drawing.parts.names == NAMES and sorted(part_names(file.drawing)) == sorted(
        ["", *NAMES]
    )
    assert (
        write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids)
        == first
        == write_svg(file.drawing, file.options, kept=file.kept)
    )
    for other in ("kind", "part", "none"):  # which strokes lie how, and back
        again = read_svg_file(
            write_svg(file.drawing, file.options, kept=file.kept, ids=file.ids, layers=other)
        )
        assert write_svg(again.drawing, file.options, ids=again.ids, kept=again.kept) == first


@pytest.mark.parametrize("program", SAVES)
def test_a_save_loses_no_part(program):
    ours, theirs = read_svg(GOLDEN / "parts.svg"), read_svg(GOLDEN / f"parts-{program}.svg")
    same_as(theirs, ours)
    assert theirs.parts.names == ours.parts.names == NAMES and part_names(theirs) == part_names(
        ours
    )


@pytest.mark.parametrize("after", ["", "-svgo"])
def test_strokes_keep_their_part_wherever_a_hand_puts_them(after):
    theirs = read_svg(GOLDEN / f"parts-moved{after}.svg")
    assert part_names(theirs) == [NAMES[0], NAMES[2], "", "", NAMES[3]] and theirs.parts.names == (
        *NAMES[:1],
        *NAMES[2:],
    )


def test_a_stroke_from_another_file_brings_its_part():
    text = write_svg(with_parts(small(None)))
    stranger = (
        '<path data-ss-path="M0 0l1 1" data-ss-class="valley" data-ss-part=" left\n ridge&#10;"/>'
    )
    new = '<path data-ss-path="M0 0l1 1" data-ss-part="0 new"/>'
    drawing = read_svg(text.replace("</svg>", stranger + new + "</svg>"))
    assert part_names(drawing)[-2:] == ["left ridge", "0 new"] and drawing.parts.names == (
        *NAMES,
        "0 new",
    )
    gone = text.replace(
        f' data-ss-parts="{re.search("data-ss-parts=.([^ ]*)", text)[1]}', ' data-x="', 1
    )
    assert set(read_svg(gone).parts.names) == set(NAMES)
    assert read_svg(re.sub(' data-ss-part="[^"]*"', "", text)).parts is None


@pytest.mark.parametrize(
    "name, found",
    [
        ("x" * 2_000_000, None),
        ("&#x202e;&#9;a", "\u202e a"),
        ("&lt;/g&gt;", "</g>"),
        ("%00%20", "%00%20"),
        (" ", ""),
    ],
)
def test_hostile_names_of_parts_do_no_harm(name, found):
    text = write_svg(small(None)).replace(
        ' data-ss-class="', f' data-ss-part="{name}" data-ss-class="', 1
    )
    text = text.replace(
        ' data-ss-size="', f' data-ss-parts="%00 {"%ff " * 100_000} {name}" data-ss-size="', 1
    )
    drawing = read_svg(text)
    got = "" if drawing.parts is None else drawing.parts.name(0)
    assert got == found if found is not None else 0 < len(got) <= 100
    again = write_svg(drawing)
    assert len(again) < 20_000 and write_svg(read_svg(again)) == again


def test_a_change_of_part_draws_nothing_anew():
    file = read_svg_file(write_svg(small("grain")))
    moved = replace(file.drawing, parts=Parts(("a",), [0] * 5))
    text = write_svg(moved, file.options, ids=file.ids, kept=file.kept)
    assert len(read_svg_file(text).kept) == 5
    assert text.count('class="stroke"') == text.count('data-ss-part="a"') == 5
    assert re.findall("<path.*?/>", text.replace(' data-ss-part="a"', "")) == [
        m for m in re.findall("<path.*?/>", write_svg(file.drawing, kept=file.kept))
    ]


def test_a_long_stroke_of_grain_that_was_turned_and_rounded():
    rng = np.random.default_rng(0)
    line = Strokes([[50.0, 60.0], [250, 90], [420, 60]], [12.0] * 3, [0, 3], [0], [False])
    strip = np.zeros((600, 16, 4), np.uint8)
    strip[..., 3] = 255 * np.clip(ndimage.gaussian_filter(rng.normal(0.5, 1, (600, 16)), 1.0), 0, 1)
    strip[:20, :, 3] = 0
    strip[8:11, 7:9, 3] = 255  # a speck comes first
    made = Drawing(line, (480, 160), [[0, 0, 0, 1]], Texture(strip, [0, 600], 2.0))
    turn = np.array([[np.cos(0.2), np.sin(0.2)], [-np.sin(0.2), np.cos(0.2)]])

    def turned(match):
        rings = [
            np.array(ring).reshape(-1, 4, 2) * 0.15 @ turn + [15, -9]
            for ring in parse_path(match[1])
        ]
        text = [
            "M{:.2f} {:.2f}".format(*ring[0, 0])
            + "".join("C" + " ".join(f"{p:.2f}" for p in c.ravel()[2:]) for c in ring)
            for ring in rings
        ]
        return f' d="{"z".join(text)}z"'

    text = write_svg(made, texture="vector")
    got = read_svg(
        re.sub(' transform="scale[^"]*"', "", re.sub(' d="([^"]*)"', turned, text))
    ).strokes
    assert np.abs(got.xy[[0, -1]] - (line.xy[[0, -1]] @ turn + [15, -9])).max() < 0.2
    assert np.abs(got.thickness - 12).max() < 0.01


def test_the_holes_of_an_outline_are_no_copies_of_its_stroke():
    # an open loop whose hole is its outer edge made smaller
    t = np.linspace(0, 2 * np.pi + 0.4, 60)
    loop = np.stack([40 + 25 * np.cos(t), 40 + 25 * np.sin(t)], axis=1)
    line = Strokes(loop, np.full(60, 6.0), [0, 60], [0], [False])
    text = write_svg(Drawing(line, (160, 80), [[0, 0, 0, 1]]))
    assert 'data-ss-rings="2"' in text and len(read_svg(text).strokes) == 1
    d = re.search(r' d="(M[^"]*)"', text)[1]
    moved = re.sub(r"M([0-9.]+)", lambda at: f"M{float(at[1]) + 70:g}", d)
    merged = text.replace(d, d + moved)
    copies = read_svg(merged).strokes
    assert len(copies) == 2
    assert np.abs(copies.xy[60:] - copies.xy[:60] - [70, 0]).max() < 0.01
