"""Page sizes, metadata, options kept in the file; plotter files and PowerStrokes.

The Nu checker where it is found.
"""

import io
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree
from svg_programs import small

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.geometry.bezier import fit_lines
from strokestyle.geometry.curves import Curves
from strokestyle.geometry.parts import Parts
from strokestyle.render.curve_file import load_curves
from strokestyle.svg.document import Page, document
from strokestyle.svg.format import SvgOptions, page_size_mm
from strokestyle.svg.markup import Element
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.write import png_from_svg, write_svg

SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
HOSTILE = "</title><script>alert(1)</script>&\"'\x00]]>"


def rendered(text, scale=1.0):
    return np.asarray(Image.open(io.BytesIO(png_from_svg(text, scale))).convert("L")).astype(float)


@pytest.mark.parametrize(
    "name, size, page",
    [
        (None, (9, 9), None),
        ("A4", (100, 120), (210, 297)),
        ("a4", (120, 100), (297, 210)),
        ("letter", (1, 1), (215.9, 279.4)),
        ("100x50mm", (1, 9), (100, 50)),
        ("10x5cm", (1, 9), (100, 50)),
        ("2x1in", (1, 9), (50.8, 25.4)),
    ],
)
def test_paper_sizes(name, size, page):
    assert page_size_mm(name, size) == (page if page is None else pytest.approx(page))


def test_the_canvas_is_fitted_into_the_page_and_read_back_from_it():
    text = write_svg(small(None), page_size="A4")  # 120 x 100 on 297 x 210
    root = ET.fromstring(text)
    assert (root.get("width"), root.get("height")) == ("297mm", "210mm")
    x, y, w, h = map(float, root.get("viewBox").split())
    assert (
        (y, h) == (0, 100)
        and w == pytest.approx(100 * 297 / 210, abs=1e-3)
        and x == pytest.approx(60 - w / 2, abs=1e-3)
    )
    plain = read_svg(write_svg(small(None)))
    assert np.array_equal(read_svg(text).strokes.xy, plain.strokes.xy) and read_svg(text).size == (
        120,
        100,
    )
    paper = ET.fromstring(write_svg(small(None), page_size="A4", background="#eee")).find(
        f"{SVG}rect"
    )
    assert [float(paper.get(n)) for n in ("x", "y", "width", "height")] == pytest.approx(
        [x, y, w, h]
    )


@pytest.mark.parametrize(
    "options, found",
    [
        ({"page_size": "A99"}, "page size"),
        ({"page_size": "0x9mm"}, "page size"),
        ({"page_size": "1e9x9mm"}, "page size"),
        ({"background": "url(http://x)"}, "colour"),
        ({"background": 'red" onload="'}, "colour"),
        ({"layers": "parts"}, "layers"),
        ({"inkscape_lpe": True, "texture": "image"}, "PowerStrokes are flat"),
    ],
)
def test_bad_options_are_named(options, found):
    with pytest.raises(ValueError, match=found):
        write_svg(small(None), **options)


@pytest.mark.parametrize(
    "license",
    ["CC-BY-NC-4.0", "CC0-1.0", "https://example.org/terms?a=1&b=2", "All rights <reserved>"],
)
def test_licence_author_title_and_description_come_back(license):
    options = SvgOptions(
        texture="none", title="A <b>", description="c & d", author='E "F"', license=license
    )
    text = write_svg(small(None), options)
    assert read_svg_file(text).options == options
    assert ("creativecommons.org/licenses/by-nc/4.0/" in text) == license.startswith("CC-BY")


def test_every_element_begins_a_line_that_its_id_leads():
    text = write_svg(small("grain"), title="a", author="b", background="ivory")
    lines = text.splitlines()
    assert lines[0].startswith("<?xml") and lines[-1] == "</svg>" and text.endswith("</svg>\n")
    assert all(re.match(r"<[^/]", line) for line in lines[:-1])
    assert text.count("\n") == len(list(ET.fromstring(text).iter())) + 2
    assert [line[:8] for line in lines].count('<g id="s') == 5


def test_what_svgwrite_adds_and_nobody_needs_is_left_out():
    root = write_svg(small(None)).splitlines()[1]
    assert "xmlns:ev" not in root and "baseProfile" not in root and "<defs" not in root


def test_a_document_has_only_elements_that_are_known():
    page = Page.of_canvas((9, 9), SvgOptions())
    with pytest.raises(ValueError, match="script"):
        document([Element("script", {})], page, SvgOptions())


def test_no_name_gets_out_of_its_place():
    text = write_svg(
        small(None),
        title=HOSTILE,
        description=HOSTILE,
        author=HOSTILE,
        license=HOSTILE,
        ids=[HOSTILE] * 5,
    )
    root = ET.fromstring(text)
    assert root.find(f"{SVG}title").text == HOSTILE.replace("\x00", "")
    assert not [e for e in root.iter() if e.tag.endswith("script")]
    assert read_svg_file(text).options.author == HOSTILE.replace("\x00", "")


def test_options_that_a_file_keeps_are_those_it_was_written_with_and_no_others():
    options = SvgOptions(
        texture="none",
        decimals=4,
        tolerance=0.25,
        layers="none",
        page_size="100x80mm",
        background="ivory",
    )
    assert SvgOptions.from_text(options.to_text()) == options
    assert SvgOptions.from_text(
        "decimals=99 title=x colour=1 texture=none tolerance=nan ="
    ) == SvgOptions(texture="none")


# --------------------------------------------------------------------------------------- lines only


def test_lines_are_fitted_within_the_tolerance_and_keep_ends_and_corners():
    t = np.linspace(0, 6, 200)
    wave = np.stack([40 * t, 30 * np.sin(t)], axis=1)
    corner = np.array([[0.0, 0], [30, 0], [30, 30]])
    dot = np.array([[5.0, 5], [5, 5]])
    xy, offsets = np.concatenate([wave, corner, dot]), np.array([0, 200, 203, 205])
    lines = fit_lines(xy, offsets, 0.1)
    assert [len(cubics) for cubics, _ in lines[1:]] == [2, 1] and len(lines[0][0]) < 20
    s = np.linspace(0, 1, 300)[:, None, None]
    for k, (cubics, rows) in enumerate(lines):
        line = xy[offsets[k] : offsets[k + 1]]
        curve = (1 - s) ** 3 * cubics[:, 0] + 3 * s * (1 - s) ** 2 * cubics[:, 1]
        curve = curve + 3 * s**2 * (1 - s) * cubics[:, 2] + s**3 * cubics[:, 3]
        away = np.linalg.norm(line[:, None] - curve.reshape(-1, 2)[None], axis=2).min(axis=1)
        assert away.max() < 0.2
        assert np.array_equal(cubics[[0, -1], [0, 3]], line[[0, -1]]) and np.array_equal(
            cubics[1:, 0], cubics[:-1, 3]
        )
        assert (
            rows[0] == 0
            and rows[-1] == len(line) - 1
            and np.array_equal(line[rows[:-1]], cubics[:, 0])
        )


def test_a_plotter_gets_lines_in_mm(tmp_path):
    text = write_svg(small("grain"), plotter=True, page_size="A5", title="p")
    root = ET.fromstring(text)
    assert root.get("viewBox") == "0 0 210 148" and root.get("width") == "210mm"
    assert {e.tag.replace(SVG, "") for e in root.iter()} == {"svg", "title", "g", "path"}
    layers = [e for e in root if e.tag == f"{SVG}g"]
    labels = [e.get(f"{INKSCAPE}label") for e in layers]
    assert labels == ["1 valley", "2 suggestive", "3 crease", "4 contour"]
    assert all(e.get("fill") == "none" for e in layers) and len(text) < 4500
    (tmp_path / "p.svg").write_text(text)
    lines = load_curves(tmp_path / "p.svg", (120, 100))  # the A5 page fitted into the canvas
    assert len(lines) == 5 and lines.closed.sum() == 1
    scale = 120 / 210
    want = small(None).strokes
    length = Curves(want.xy, want.offsets, want.kind, want.closed).lengths() * 148 / 100
    assert sorted(lines.lengths() / scale) == pytest.approx(sorted(length), rel=0.01)
    with pytest.raises(ValueError, match="no strokes in it"):
        read_svg(text)


def test_a_plotter_s_straight_lines_are_lines_and_dots_are_kept():
    lines = Curves.from_list([np.array([[9.0, 9], [90, 60]]), np.full((2, 2), 50.0)], np.zeros(2))
    strokes = Strokes(lines.xy, np.ones(4), lines.offsets, lines.kind, lines.closed)
    text = write_svg(Drawing(strokes, (100, 100), np.ones((2, 4))), plotter=True)
    d = sorted(e.get("d") for e in ET.fromstring(text).iter(f"{SVG}path"))
    # vpype cuts cubics into moves, and leaves out lines, not cubics, without a length
    assert [re.sub("[-0-9. ]+", "", path) for path in d] == ["Mc", "Ml"]


@pytest.mark.parametrize("layers", ["kind", "part", "none"])
def test_a_plotter_draws_a_layer_with_little_travel(tmp_path, layers):
    rng = np.random.default_rng(2)
    middle = rng.uniform(10, 290, (90, 1, 2))
    kind, part = rng.integers(0, 2, 90), rng.integers(-1, 2, 90)
    lines = Curves.from_list(list(middle + rng.normal(0, 3, (1, 2, 2)) * [[[1], [-1]]]), kind)
    strokes = Strokes(lines.xy, np.ones(180), lines.offsets, kind, np.zeros(90, bool))
    parts = Parts(("valley", "b"), part)  # the first has the name of a kind
    made = Drawing(strokes, (300, 300), np.ones((90, 4)), parts=parts)
    text = write_svg(made, plotter=True, layers=layers)
    groups = [group for group in ET.fromstring(text) if group.tag == f"{SVG}g"]
    paths = [path for group in groups for path in group]
    assert all(path.tag == f"{SVG}path" for path in paths)
    (tmp_path / "p.svg").write_text(text)
    read = load_curves(tmp_path / "p.svg", (300, 300))
    centre = lines.xy.reshape(90, 2, 2).mean(axis=1)
    order = cKDTree(centre).query(read.xy.reshape(90, 2, 2).mean(axis=1))[1]
    assert sorted(order) == list(range(90)) and np.array_equal(kind[order], read.kind)
    names = [("valley", "b", None)[i] for i in part[order]]
    assert [path.get(f"{INKSCAPE}label") for path in paths] == names
    layer = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    was = {"kind": kind, "part": np.where(part < 0, kind - 9, part), "none": 0 * kind}[layers]
    pairs = set(zip(layer.tolist(), was[order].tolist(), strict=True))
    assert len(pairs) == len(groups) == len(set(was.tolist()))

    def travel(xy, key):
        return np.linalg.norm(xy[2::2] - xy[1:-1:2], axis=1)[key[1:] == key[:-1]].sum()

    painted = np.argsort(was, kind="stable")
    before = travel(lines.xy.reshape(90, 4)[painted].reshape(-1, 2), was[painted])
    assert travel(read.xy, layer) < 0.3 * before
    assert text == write_svg(made, plotter=True, layers=layers)


def test_power_strokes_have_skeleton_and_widths():
    drawing = small(None)
    text = write_svg(drawing, inkscape_lpe=True)
    file = read_svg_file(text)
    assert (
        file.options.inkscape_lpe and write_svg(file.drawing, file.options, kept=file.kept) == text
    )
    assert np.abs(rendered(text) - rendered(write_svg(drawing))).max() == 0
    root = ET.fromstring(text)
    effects = {e.get("id"): e for e in root.iter(f"{INKSCAPE}path-effect")}
    paths = [e for e in root.iter(f"{SVG}path")]
    assert len(effects) == len(paths) == 5
    for path in paths:
        effect = effects[path.get(f"{INKSCAPE}path-effect")[1:]]
        assert effect.get("effect") == "powerstroke" and effect.get("id") == "lpe-" + path.get("id")
        pairs = np.array([p.split(",") for p in effect.get("offset_points").split(" | ")], float)
        assert (np.diff(pairs[:, 0]) > 0).all() and 1 <= pairs[:, 1].max() <= 3.5
        nodes = len(re.findall(r"-?[\d.]+", path.get(f"{INKSCAPE}original-d"))) // 6 + 1
        nodes -= path.get("data-ss-closed") == "1"
        assert set(range(nodes)) <= set(pairs[:, 0].tolist()) and pairs[-1, 0] <= nodes
    assert "lpe" not in write_svg(drawing)


def test_a_power_stroke_that_inkscape_moved_is_read_where_it_went():
    drawing = small(None)
    text = write_svg(drawing, inkscape_lpe=True)

    def moved(match):  # Inkscape moves the skeleton, and begins the outline elsewhere
        x, y = map(float, re.findall("-?[0-9.]+", match[1]))
        return f' inkscape:original-d="M{x + 30:.9g} {y - 20:.9g}'

    new = re.sub(r' inkscape:original-d="M([-0-9. ]+)', moved, text)
    new = re.sub(' d="M[^"]*"', ' d="M1 2l9 9z"', new)
    got = read_svg(new).strokes
    assert np.abs(got.xy - read_svg(text).strokes.xy - [30, -20]).max() < 0.01
    assert np.array_equal(got.thickness, read_svg(text).strokes.thickness)


def test_lines_of_nothing():
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (40, 30), np.zeros((0, 4)))
    for options in ({"plotter": True}, {"inkscape_lpe": True}):
        ET.fromstring(write_svg(nothing, **options))
    dots = Strokes(
        [[5, 5], [5, 5], [9, 9], [9, 9], [9, 9.0]], np.ones(5), [0, 2, 5], [0, 1], [False, True]
    )
    for options in ({"plotter": True}, {"inkscape_lpe": True}):
        assert "nan" not in write_svg(Drawing(dots, (20, 20), np.ones((2, 4))), **options)


def test_the_nu_checker_finds_no_error(tmp_path):
    jar = os.environ.get("VNU_JAR", "")
    if not (Path(jar).is_file() and shutil.which("java")):
        pytest.skip("no program: java is not installed, or VNU_JAR does not name vnu.jar")
    options = SvgOptions(
        title="a < b", author="c", license="CC-BY-4.0", background="#fff", page_size="A4"
    )
    files = []
    for texture in (None, "grain", "colours"):
        for name, change in {
            "a": {},
            "b": {"layers": "none"},
            "c": {"inkscape_lpe": True},
            "d": {"plotter": True},
        }.items():
            files.append(tmp_path / f"{texture}-{name}.svg")
            files[-1].write_text(write_svg(small(texture), replace(options, **change)))
    done = subprocess.run(
        ["java", "-jar", jar, "--svg", "--errors-only", *files], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "attributes, drawn",
    [
        ('viewBox="0 0 20 10"', (0, 5, 20, 15)),  # amid its page, as SVG has it
        ('viewBox="0 0 20 10" preserveAspectRatio="xMidYMin"', (0, 0, 20, 10)),
        ('viewBox="0 0 20 10" preserveAspectRatio="none"', (0, 0, 20, 20)),
        ('viewBox="0 0 20.004 20"', (0, 0, 20, 20)),  # sides that another program rounded
    ],
)
def test_pngs_lay_the_view_box_on_the_page_as_it_says(attributes, drawn):
    height = 10 if "20 10" in attributes else 20
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="20" height="20" {attributes}>'
    svg += f'<path d="M0 0H20.004V{height}H0Z"/></svg>'
    rows, columns = np.nonzero(rendered(svg) < 128)
    assert (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1) == drawn
