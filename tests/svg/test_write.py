"""SVG text: its structure by ElementTree, and its picture by resvg against our own raster."""

import base64
import gzip
import io
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from small_drawings import drawing, rendered

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes, Texture, signed_distance
from strokestyle.geometry.curves import KINDS, Curves
from strokestyle.geometry.parts import Parts
from strokestyle.render.curve_file import load_curves
from strokestyle.svg import markup
from strokestyle.svg.format import SvgOptions
from strokestyle.svg.markup import polyline_path, printable, rings_path
from strokestyle.svg.read import read_svg
from strokestyle.svg.write import plain_svg, resolve_texture, save_svg, write_svg

SVG = "{http://www.w3.org/2000/svg}"
XLINK = "{http://www.w3.org/1999/xlink}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"


@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_flat_svg_shows_what_the_raster_shows(scale):
    flat = drawing()
    error = np.abs(rendered(write_svg(flat), scale) - rasterise(flat, scale, (1, 1, 1)))
    assert error.mean() < 0.35  # an outline off by .2 px gives more


@pytest.mark.parametrize("texture", ["grain", "colours"])
@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_image_svg_shows_what_the_raster_shows(texture, scale):
    textured = drawing(texture=texture)
    picture = rendered(write_svg(textured, texture="image"), scale)
    error = np.abs(picture - rasterise(textured, scale, (1, 1, 1)))
    assert (
        error.mean() < 3.0
    )  # 18 % of this small page is stroke, of a real one 4 %: there it is 0.6
    assert (
        np.abs(picture - rasterise(textured, scale, (1, 1, 1), texture=False)).mean()
        > 3 * error.mean()
    )


def test_layers_lie_in_painting_order_and_hold_every_stroke():
    flat = drawing()
    root = ET.fromstring(write_svg(flat))
    layers = [g for g in root.findall(f"{SVG}g") if g.get(f"{INKSCAPE}groupmode") == "layer"]
    assert [g.get(f"{INKSCAPE}label") for g in layers] == ["valley", "crease", "contour"]
    assert [len(g) for g in layers] == [
        int((flat.strokes.kind == KINDS.index(g.get("class"))).sum()) for g in layers
    ]
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    flat_order = ET.fromstring(write_svg(flat, layers="none"))
    assert [e.get("id") for e in flat_order if e.get("class") == "stroke"] == [
        f"s{n:03d}" for n in range(12)
    ]


def test_page_has_physical_size_title_and_nothing_to_load():
    text = write_svg(drawing(texture="grain"), title='Cup <1> & "2"', description="a\x00b")
    root = ET.fromstring(text)
    assert (
        root.get("viewBox") == "0 0 160 120"
        and root.get("width") == "42.3333mm"
        and root.get("height") == "31.75mm"
    )
    assert root.find(f"{SVG}title").text == 'Cup <1> & "2"' and root.find(f"{SVG}desc").text == "ab"
    assert "<!DOCTYPE" not in text and "<script" not in text and root.find(f"{SVG}rect") is None
    for element in root.iter():
        href = element.get(f"{XLINK}href")
        assert href is None or href.startswith("data:image/png;base64,")
    paper = ET.fromstring(write_svg(drawing(), background="#fffaf0")).find(f"{SVG}rect")
    assert paper.get("fill") == "#fffaf0"


def test_the_same_drawing_gives_the_same_text():
    for texture in (None, "grain", "colours"):
        assert write_svg(drawing(texture=texture)) == write_svg(drawing(texture=texture))


def numbers(text):
    return np.array([float(n) for n in re.findall(r"-?\d*\.?\d+", text)])


def test_strokes_carry_their_centre_line_and_widths():
    flat = drawing()
    root = ET.fromstring(write_svg(flat))
    order = np.argsort(-flat.strokes.kind, kind="stable")
    for element, i in zip(root.iter(f"{SVG}path"), order, strict=True):
        rows = slice(flat.strokes.offsets[i], flat.strokes.offsets[i + 1])
        steps = numbers(element.get("data-ss-path")).reshape(-1, 2)
        xy = np.cumsum(steps, axis=0)
        assert (
            signed_distance(xy, np.zeros(len(xy)), flat.strokes.xy[rows]).max() < 0.068
        )  # slack and rounding
        assert xy[[0, -1]] == pytest.approx(flat.strokes.xy[rows][[0, -1]], abs=0.0051)
        width = numbers(element.get("data-ss-width"))
        along = np.r_[0, np.cumsum(np.hypot(*np.diff(flat.strokes.xy[rows], axis=0).T))]
        if "," in element.get("data-ss-width"):
            t, width = width.reshape(-1, 2).T
        else:
            t = np.r_[0, np.cumsum(np.hypot(*np.diff(xy, axis=0).T))]
        assert np.interp(along / along[-1], t / t[-1], width) == pytest.approx(
            flat.strokes.thickness[rows], abs=0.01
        )
        assert (
            element.get("data-ss-class") == KINDS[flat.strokes.kind[i]]
            and element.get("fill-rule") == "nonzero"
        )


def test_auto_takes_paths_for_grain_in_one_ink_and_images_for_the_rest():
    flat, grain, colours = (
        write_svg(drawing(texture=texture)) for texture in (None, "grain", "colours")
    )
    assert "<image" not in flat and flat.count("<path") == 12
    assert "<image" not in grain and grain.count("<path") > 24 and "texture=vector" in grain
    assert colours.count("<image") == 12 and "texture=image" in colours
    assert resolve_texture(drawing(texture="grain"), SvgOptions()).texture == "vector"
    assert resolve_texture(drawing(), SvgOptions(texture="image")).texture == "none"
    plain = write_svg(drawing(texture="grain"), texture="none")
    assert plain == write_svg(replace(drawing(texture="grain"), texture=None))


@pytest.mark.parametrize("texture, most", [("grain", 4.5), ("colours", 4.5)])
@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_vector_svg_shows_what_the_raster_shows(texture, most, scale):
    textured = drawing(texture=texture)
    want = rasterise(textured, scale, (1, 1, 1))
    errors = [
        np.abs(rendered(write_svg(textured, texture="vector", tones=tones), scale) - want).mean()
        for tones in (1, 3, 8)
    ]
    assert errors[2] < errors[1] < errors[0] and errors[1] < most
    assert (
        np.abs(rasterise(textured, scale, (1, 1, 1), texture=False) - want.astype(float)).mean()
        > 2 * errors[1]
    )


def test_tones_are_nested_in_one_group_and_have_their_own_opacity():
    root = ET.fromstring(write_svg(drawing(texture="grain"), tones=2))
    strokes = [g for g in root.iter(f"{SVG}g") if g.get("class") == "stroke"]
    assert len(strokes) == 12
    for kind, *tones in strokes:
        assert kind.tag == f"{SVG}desc" and kind.text in KINDS
        assert {child.tag for child in tones} == {f"{SVG}path"} and 1 <= len(tones) <= 2
        for child in tones:
            assert 0 < float(child.get("fill-opacity")) <= 1
    inked = replace(drawing(texture="grain"), color=np.tile([0.1, 0.1, 0.3, 0.5], (12, 1)))
    for stroke in (
        g for g in ET.fromstring(write_svg(inked)).iter(f"{SVG}g") if g.get("class") == "stroke"
    ):
        assert stroke.get("fill") == "#1a1a4c" and all(
            child.get("fill") is None for child in stroke
        )


@pytest.mark.parametrize("texture", ["none", "vector", "image"])
def test_nothing_above_a_path_or_an_image_makes_it_fainter(texture):
    faint = replace(drawing(texture="grain"), color=np.tile([0.1, 0.1, 0.3, 0.5], (12, 1)))
    text = write_svg(faint, texture=texture, title="a", author="b", background="ivory")
    for group in ET.fromstring(text).iter(f"{SVG}g"):  # Scribus applies it to images in the group
        assert not {"opacity", "fill-opacity", "stroke-opacity", "style"} & group.attrib.keys()
    assert read_svg(text).color == pytest.approx(faint.color, abs=0.005)


def test_fewer_decimals_and_looser_outlines_make_smaller_files():
    fine, coarse = write_svg(drawing(), decimals=3), write_svg(drawing(), decimals=1)
    assert len(coarse) < 0.8 * len(fine) and len(write_svg(drawing(), tolerance=0.5)) < len(
        write_svg(drawing())
    )
    outline = re.findall(r' d="([^"]*)"', coarse)
    assert outline and not any(re.search(r"\.\d\d", d) for d in outline)


def test_textures_of_higher_resolution_are_larger():
    def pixels(resolution):
        text = write_svg(drawing(texture="grain"), texture="image", texture_res=resolution)
        pngs = re.findall(r"base64,([^\"]+)", text)
        return sum(np.prod(Image.open(io.BytesIO(base64.b64decode(png))).size) for png in pngs)

    assert pixels(4.0) == pytest.approx(16 * pixels(1.0), rel=0.2)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"texture": "vector9"}, "texture must be one of"),
        ({"texture_res": 0}, "resolution"),
        ({"decimals": 9}, "decimals"),
        ({"tolerance": 0}, "tolerance"),
        ({"tones": 9}, "tones"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        write_svg(drawing(), **options)


def test_save_svg_compresses_by_suffix(tmp_path):
    save_svg(tmp_path / "a.svg", drawing())
    save_svg(tmp_path / "a.svgz", drawing())
    save_svg(tmp_path / "b.SVGZ", drawing())
    packed, upper = (tmp_path / "a.svgz").read_bytes(), (tmp_path / "b.SVGZ").read_bytes()
    assert packed[4:8] == b"\0\0\0\0" and upper == packed  # no time of writing, no name
    assert gzip.decompress(packed) == (tmp_path / "a.svg").read_bytes()
    with pytest.raises(OSError, match="nowhere"):
        save_svg(tmp_path / "nowhere" / "a.svg", drawing())


def test_an_empty_drawing_is_an_empty_page():
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (40, 30), np.zeros((0, 4)))
    assert (rendered(write_svg(nothing)) == 255).all()


def test_degenerate_strokes_are_written():
    strokes = Strokes(
        [[5, 5], [5, 5], [9, 9], [20, 9]], [0, 0, 0, 0], [0, 2, 4], [0, 0], [False, False]
    )
    flat = Drawing(strokes, (40, 30), np.tile([0, 0, 0, 1.0], (2, 1)))
    assert "nan" not in write_svg(flat) and (rendered(write_svg(flat)) == 255).all()
    strip = Texture(np.full((8, 4, 4), 255, np.uint8), [0, 4, 8], 0.0)
    assert "nan" not in write_svg(replace(flat, texture=strip))


def test_path_data_is_short_and_exact():
    ring = np.array(
        [[[0, 0], [1, 0], [1.5, 0.5], [2, 1]], [[2, 1], [2.25, 0.5], [1, 0.004], [0, 0]]], float
    )
    assert rings_path([ring]) == "M0 0c1 0 1.5 .5 2 1 .25-.5-1-1-2-1z"
    assert polyline_path(np.array([[1, 2], [1.5, 2], [1.5, 0.25]])) == "M1 2l.5 0 0-1.75"
    assert (
        polyline_path(np.array([[0, 0], [4, 0], [4, 4], [0, 0.0]]), closed=True) == "M0 0l4 0 0 4z"
    )


def test_plain_curves_by_kind():
    lines = [np.array([[10, 10], [50, 10.0]]), np.array([[10, 30], [50, 30], [30, 40], [10, 30.0]])]
    text = plain_svg(
        Curves.from_list(lines, [KINDS.index("contour"), KINDS.index("ridge")]),
        (60, 50),
        title="x & y",
    )
    root = ET.fromstring(text)
    assert [g.get(f"{INKSCAPE}label") for g in root.findall(f"{SVG}g")] == ["ridge", "contour"]
    picture = rendered(text)
    assert picture[9:11, 30].sum() == pytest.approx(3 * 255, abs=12) and picture[30, 8].min() > 200
    assert plain_svg(Curves.empty(), (60, 50))


def test_hidden_curves_lie_dashed_beneath():
    seen, hidden = (Curves.from_list([np.array([[5, y], [55, y]])], [0]) for y in (10.0, 30.0))
    text = plain_svg(seen, (60, 50), hidden=hidden)
    below, above = ET.fromstring(text).findall(f"{SVG}g")
    assert (below.get(f"{INKSCAPE}label"), above.get(f"{INKSCAPE}label")) == (
        "hidden-contour",
        "contour",
    )
    assert below.get("data-ss-hidden") == "1" and len({e.get("id") for e in (*below, *above)}) == 2
    picture = rendered(text)
    assert (
        picture[10, 8:52, 0].max() < 150
        and picture[30, 8:52, 0].max() == 255 > picture[30, 8:52, 0].min()
    )
    assert plain_svg(seen, (60, 50), hidden=Curves.empty()) == plain_svg(seen, (60, 50))


def test_text_that_xml_cannot_hold_is_left_out():
    assert printable("a\x00\x0bb\ud800c\ufffe\n\U0001f58c") == "abc\n\U0001f58c"


# -------------------------------------------------------------------------------------------- parts


def groups(element, depth=0):
    """[(depth, id, label)] of the layers in an element, and that no two ids in it are the same."""
    found = []
    for child in element:
        if child.get(f"{INKSCAPE}groupmode") == "layer":
            found += [
                (depth, child.get("id"), child.get(f"{INKSCAPE}label")),
                *groups(child, depth + 1),
            ]
    return found


def in_parts(names=("cup", "handle"), texture=None):
    """Strokes of `drawing` in parts by turns, and some in none."""
    made = drawing(texture=texture)
    return replace(made, parts=Parts(names, np.arange(len(made.strokes)) % (len(names) + 1) - 1))


def test_a_group_for_every_part_in_the_layer_of_every_kind():
    text = write_svg(in_parts())
    root = ET.fromstring(text)
    kinds, inner = ("valley", "crease", "contour"), ("cup", "handle")
    expected = [
        row
        for kind in kinds
        for row in (
            (0, f"layer-{kind}", kind),
            *((1, f"layer-{kind}-{part}", part) for part in inner),
        )
    ]
    assert groups(root) == expected and root.get("data-ss-parts") == "cup handle"
    for layer in root.findall(f"{SVG}g"):
        loose = [e for e in layer if e.get("class") == "stroke"]
        assert layer[: len(loose)] == loose and not any(e.get("data-ss-part") for e in loose)
        for group in layer[len(loose) :]:
            label = group.get(f"{INKSCAPE}label")
            assert {e.get("data-ss-part") for e in group} == {label} and group.get(
                "data-ss-class"
            ) == layer.get("class")
    assert len([e for e in root.iter() if e.get("class") == "stroke"]) == 12


def test_a_layer_for_every_part_and_in_it_one_for_every_kind():
    root = ET.fromstring(write_svg(in_parts(), layers="part"))
    kinds = ("valley", "crease", "contour")
    loose = [(0, f"layer-{kind}", kind) for kind in kinds]
    inner = {
        part: [(1, f"layer-{kind}-{part}", kind) for kind in kinds] for part in ("cup", "handle")
    }
    assert groups(root) == [
        *loose, (0, "part-cup", "cup"), *inner["cup"],
        (0, "part-handle", "handle"), *inner["handle"],
    ]  # fmt: skip
    flat = ET.fromstring(write_svg(in_parts(), layers="none"))
    assert not groups(flat) and sum(e.get("data-ss-part") is not None for e in flat) == 8


@pytest.mark.parametrize("layers", ["kind", "part", "none"])
def test_what_lies_on_top_is_the_same_in_the_file_and_in_the_raster(layers):
    made = in_parts(("near", "far"))
    thick = replace(made.strokes, thickness=2 * made.strokes.thickness)
    made = replace(
        made, strokes=thick, color=np.c_[np.eye(3)[made.parts.index], np.ones(12)]
    )  # a colour a part
    picture = rendered(write_svg(made, layers=layers))
    error, other = (
        np.abs(picture - rasterise(made, 1.0, (1, 1, 1), layers=by)).mean()
        for by in ((layers, "kind") if layers == "part" else ("kind", "part"))
    )
    assert error < 0.5 and other > 4 * error


def test_one_part_or_none_changes_nothing_but_its_attribute():
    plain = write_svg(drawing())
    assert "part" not in plain and plain == write_svg(drawing(), layers="kind")
    nameless = Parts(("a",), np.full(12, -1))
    assert write_svg(replace(drawing(), parts=nameless)) == plain
    assert groups(ET.fromstring(write_svg(drawing(), layers="part"))) == groups(
        ET.fromstring(plain)
    )


NAMES = (
    '"><script>alert(1)</script>',
    "\u65e5\u672c",
    "\u672c\u65e5",
    "a b",
    "a-b",
    "A b",
    "layer contour",
    "ridge",
    99 * "&",
)
CLASHING = ["part-a-b", "layer-contour-a-b", "layer-valley-ridge"] + [""] * 9  # ids of strokes


@pytest.mark.parametrize("layers", ["kind", "part", "none"])
@pytest.mark.parametrize(
    "options", [{}, {"texture": "none"}, {"plotter": True}, {"inkscape_lpe": True}]
)
def test_any_name_is_escaped_and_has_an_id_of_its_own(options, layers):
    made = in_parts(NAMES, None if options else "grain")
    text = write_svg(made, layers=layers, ids=CLASHING, **options)
    root = ET.fromstring(text)
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids)) and all(
        re.fullmatch(r"[A-Za-z_][\w.-]*", name, re.ASCII) for name in ids
    )
    assert not any(e.tag.endswith("script") for e in root.iter())
    labels = {e.get(f"{INKSCAPE}label") for e in root.iter()} - {None}
    if layers == "part" and options.get("plotter"):
        labels = {re.sub(r"^\d+ ", "", label) for label in labels}
    assert layers == "none" or set(NAMES) <= labels
    if not options.get("plotter"):
        assert {e.get("data-ss-part") for e in root.iter()} - {None} == set(NAMES)
    assert text == write_svg(made, layers=layers, ids=CLASHING, **options)


def test_plain_curves_by_kind_and_part(tmp_path):
    lines = [np.array([[5, y], [55, y]]) for y in (10.0, 20.0, 30.0, 40.0)]
    seen, parts = Curves.from_list(lines, [0, 0, 4, 0]), Parts(("left ridge", "b"), [1, 0, 1, -1])
    hidden = Curves.from_list(lines[:2], [0, 2])
    text = plain_svg(seen, (60, 50), parts=parts, hidden=hidden, hidden_parts=parts.take([0, 1]))
    assert groups(ET.fromstring(text)) == [
        (0, "layer-hidden-crease", "hidden-crease"),
        (1, "layer-hidden-crease-left-ridge", "left ridge"),
        (0, "layer-hidden-contour", "hidden-contour"), (1, "layer-hidden-contour-b", "b"),
        (0, "layer-ridge", "ridge"), (1, "layer-ridge-b", "b"),
        (0, "layer-contour", "contour"), (1, "layer-contour-left-ridge", "left ridge"),
        (1, "layer-contour-b", "b"),
    ]  # fmt: skip
    with_parts, without = rendered(text), rendered(plain_svg(seen, (60, 50), hidden=hidden))
    assert np.array_equal(with_parts, without)
    (tmp_path / "lines.svg").write_text(
        text
    )  # what they are is said by the kind's layer, not by the part's name
    assert sorted(load_curves(tmp_path / "lines.svg", (60, 50)).kind) == [0, 0, 0, 4]


@pytest.mark.parametrize("decimals", range(7))
def test_whole_numbers_of_units_are_told_as_the_numbers_that_they_are(decimals):
    values = [0, 1, -1, 9, 10, -10, 99, 100, 12345, -12300, 10**6, 7 * 10**8, -(10**9) + 1]
    values += np.random.default_rng(0).integers(-20_000, 20_000, 400).tolist()
    told = markup.numbers(np.array(values), decimals)
    assert told == [markup.number(value / 10**decimals, decimals) for value in values]


@pytest.mark.parametrize("texture", ["vector", "image"])
@pytest.mark.parametrize("kind", ["grain", "colours"])
def test_as_many_threads_as_there_are_write_the_same_bytes(monkeypatch, texture, kind):
    for name, size in (
        ("svg.tones.CACHED_TEXELS", 200),
        ("svg.tones.CACHED", 50),  # points
        ("svg.ink.CACHED_TEXELS", 200),
        ("geometry.curves.CACHED", 50),
        ("drawing.raster.BATCH", 1000.0),
    ):
        monkeypatch.setattr(f"strokestyle.{name}", size)
    texts = set()
    for threads in ("1", "4", "4"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        texts.add(write_svg(drawing(texture=kind), texture=texture))
    assert len(texts) == 1
