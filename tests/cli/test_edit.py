"""`strokestyle edit`: edits as text, and the command that makes them."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from svg_programs import GOLDEN, NAMES, small, with_parts

from strokestyle.cli import main
from strokestyle.cli.edit_text import NamedDrawing, parse_edit, strokes_named
from strokestyle.drawing.strokes import lengths
from strokestyle.geometry.curves import KINDS
from strokestyle.geometry.parts import Parts
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.write import png_from_svg, save_svg, write_svg

CONTOUR = KINDS.index("contour")


def points(drawing, i):
    return drawing.strokes.xy[drawing.strokes.offsets[i] : drawing.strokes.offsets[i + 1]]


# ----------------------------------------------------------------------------------------- as text


def named_drawing(texture=None):
    file = read_svg_file(write_svg(small(texture)))
    return NamedDrawing(file.drawing, file.ids)


@pytest.mark.parametrize(
    "name, text, left",
    [
        ("drop", "<88", ["s001"]),
        ("drop", "contour", ["s003", "s004"]),
        ("drop", "valley,contour<90", []),
        ("drop", ">1000", []),
    ],
)
def test_strokes_are_dropped_by_length_and_kind(name, text, left):
    before = named_drawing("grain")
    long = lengths(before.drawing)
    after = parse_edit(name, text)(before, 0)
    gone = [n for n in before.ids if n not in after.ids]
    expected = {
        "<88": [n for n, length in zip(before.ids, long, strict=True) if length < 88],
        "contour": ["s003", "s004"],
        "valley,contour<90": [
            n for n, s in zip(before.ids, long, strict=True) if s < 90 and n not in ("s001", "s002")
        ],
        ">1000": [],
    }[text]
    assert gone == expected and len(after.drawing.strokes) == len(after.ids)


def test_an_edit_for_some_kinds():
    thick = parse_edit("thickness", "contour,valley=2")(named_drawing(), 0).drawing
    ratio = [
        thick.strokes.thickness[a] / named_drawing().drawing.strokes.thickness[a]
        for a in thick.strokes.offsets[:-1]
    ]
    assert ratio == pytest.approx([2, 1, 1, 2, 2])


def drawing_of_parts():
    file = read_svg_file(write_svg(with_parts(small("grain"))))
    return NamedDrawing(file.drawing, file.ids)


@pytest.mark.parametrize(
    "which, meant",
    [
        ("left ridge", [1]),
        (NAMES[0], [0]),
        (f"left ridge, {NAMES[0]} ,crease", [0, 1, 2]),
        (NAMES[1], [3]),  # a comma in it
        (" left   ridge,", [1]),
        (NAMES[3], [4]),
        (500 * "x", [4]),
        ("contour", [3, 4]),
    ],
)
def test_an_edit_for_some_parts(which, meant):
    named = drawing_of_parts()
    red = parse_edit("recolor", f"{which}=#ff0000")(named, 0).drawing
    assert np.flatnonzero((red.color[:, :3] == [1, 0, 0]).all(axis=1)).tolist() == meant
    left = parse_edit("drop", which)(named, 0)
    assert left.ids == tuple(f"s00{i}" for i in range(5) if i not in meant)
    assert [left.drawing.parts.name(i) for i in range(len(left.ids))] == [
        named.drawing.parts.name(i) for i in range(5) if i not in meant
    ]
    none = parse_edit("drop", f"{which}<1")(named, 0)
    assert none.ids == named.ids and read_svg(write_svg(left.drawing)).parts.index.shape == (
        5 - len(meant),
    )


def test_a_part_may_be_called_as_a_length_is():
    drawing = replace(small(None), parts=Parts(("a<20", "b"), [0, 1, 1, 0, 1]))
    named = NamedDrawing(drawing, ("",) * 5)
    assert len(parse_edit("drop", "a<20")(named, 0).ids) == 3
    assert len(parse_edit("drop", "b<20")(named, 0).ids) == 5  # none of b is so short


def test_a_name_of_a_kind_and_a_part_is_the_kind():
    drawing = replace(small(None), parts=Parts(("contour", "x"), [1, 0, 1, 0, 0]))
    assert strokes_named(drawing, "contour").tolist() == (drawing.strokes.kind == CONTOUR).tolist()
    assert strokes_named(drawing, "x").tolist() == [True, False, True, False, False]


@pytest.mark.parametrize("text", ["arm=2", "arm, crease=2", " ,=2", "contours=2", "=2=2"])
def test_a_name_that_is_none_is_told_with_those_that_are(text):
    for drawing_of, words in (
        (named_drawing, "no named parts"),
        (drawing_of_parts, "the parts .*left ridge"),
    ):
        with pytest.raises(
            ValueError, match=f"no such kind of line or part; .*contour, boundary.* {words}"
        ):
            parse_edit("thickness", text)(drawing_of(), 0)


@pytest.mark.parametrize(
    "name, text, found",
    [
        ("thickness", "x", "takes a number"),
        ("thickness", "-1", "between"),
        ("thickness", "nan", "takes a number"),
        ("thickness", "arm=x", "takes a number"),
        ("wiggle", "3", "two numbers"),
        ("wiggle", "3,0", "wavelength"),
        ("smooth", "-1", "between"),
        ("move", "s1:0.5", "STROKE:POINT:DX,DY"),
        ("move", "s1:2:1,1", "between 0 and 1"),
        ("drop", "", "a length such as"),
        ("recolor", "hue", "--recolor takes a colour"),
        ("taper", "", "takes a number"),
    ],
)
def test_bad_edits_are_named(name, text, found):
    with pytest.raises(ValueError, match=found):
        parse_edit(name, text)


def test_a_stroke_is_named_by_id_or_number():
    for name in ("s003", "3"):
        moved = parse_edit("move", f"{name}:0.5:0,9")(named_drawing(), 0).drawing
        assert [
            np.array_equal(points(moved, i), points(named_drawing().drawing, i)) for i in range(5)
        ] == [
            1,
            1,
            1,
            0,
            1,
        ]
    with pytest.raises(ValueError, match="s000, s001, s002, ..."):
        parse_edit("move", "s9:0.5:0,9")(named_drawing(), 0)


# ------------------------------------------------------------------------------------- the command


def run(*args, **options):
    return CliRunner().invoke(main, ["edit", *map(str, args)], **options)


@pytest.fixture
def drawn(tmp_path):
    save_svg(tmp_path / "in.svg", small("grain"), title="a", page_size="A4")
    return tmp_path / "in.svg"


def test_edits_are_made_in_the_order_given(drawn, tmp_path):
    results = []
    for order in (
        ["--thickness", "3", "--drop", "<1", "--thickness=contour=0.5"],
        ["--taper", "9", "--smooth", "4", "--taper=9"],
    ):
        result = run(drawn, "-o", tmp_path / "out.svg", *order, "-v")
        assert result.exit_code == 0, result.stderr
        results.append([line.split(":")[0].strip() for line in result.stderr.splitlines()[1:-2]])
    assert results == [["thickness", "drop", "thickness"], ["taper", "smooth", "taper"]]
    a, b = tmp_path / "a.svg", tmp_path / "b.svg"
    run(drawn, "-o", a, "--smooth", "5", "--wiggle", "3,20")
    run(drawn, "-o", b, "--wiggle", "3,20", "--smooth", "5")
    assert (
        np.ptp(read_svg(a).strokes.xy - read_svg(a).strokes.xy.mean(axis=0))
        and a.read_text() != b.read_text()
    )


def test_no_edit_gives_the_same_file_and_options_change_it(drawn, tmp_path):
    out = tmp_path / "out.svg"
    assert run(drawn, "-o", out).exit_code == 0 and out.read_bytes() == drawn.read_bytes()
    assert (
        run(drawn, "-o", out, "--texture", "none", "--layers", "none", "--title", "b").exit_code
        == 0
    )
    file = read_svg_file(out)
    assert (file.options.texture, file.options.layers, file.options.title) == ("none", "none", "b")
    assert file.options.page_size == "A4" and "<image" not in out.read_text()


def test_powerstrokes_are_flat_whatever_the_texture_was(drawn, tmp_path):
    save_svg(drawn, small("grain"), texture="vector")
    result = run(drawn, "-o", tmp_path / "out.svg", "--inkscape-lpe")
    assert result.exit_code == 0, result.stderr
    assert read_svg_file(tmp_path / "out.svg").options.texture == "none"


def test_a_pipe_of_edits(drawn):
    first = run("-", "-o", "-", "--wiggle", "2,20", input=drawn.read_bytes())
    second = run("-", "-o", "-", "--recolor", "#ff0000", input=first.stdout_bytes)
    assert second.exit_code == 0 and read_svg(second.stdout).color[0, :3].tolist() == [1, 0, 0]
    assert "5 strokes -> -" in second.stderr


@pytest.mark.parametrize("edit", [("--thickness", "1.2"), ("--wiggle", "1,9")])
def test_rules_that_are_not_understood_are_told(drawn, tmp_path, edit):
    save_svg(drawn, small("grain"), texture="vector")
    sheet = "<style>g:has(a){fill:red} path:lang(en){fill:blue}</style>"
    drawn.write_text(drawn.read_text().replace("<g ", sheet + "<g ", 1))
    result = run(drawn, "-o", tmp_path / "o.svg", *edit)
    assert result.exit_code == 0
    told = "rules of style sheets that are not understood, so that strokes may look otherwise: "
    assert f"{told}g:has(a), path:lang(en)\n" in result.stderr


@pytest.mark.parametrize(
    ("added", "told"),
    [
        ('stroke="red"', 1),
        ('style="stroke:#f00;stroke-width:2mm"', 1),
        ('style="fill:none;stroke:rgb(0 0 255 / 50%)"', 1),
        ('stroke="red" stroke-width="0"', 0),
        ('stroke="red" style="stroke-width:0.0px"', 0),
        ('stroke="rgba(9, 9, 9, 0)"', 0),
        ('stroke="none" stroke-width="9"', 0),
    ],
)
def test_outlines_that_a_hand_gave_to_strokes_are_told(drawn, tmp_path, added, told):
    drawn.write_text(drawn.read_text().replace('class="stroke"', f'class="stroke" {added}', 1))
    result = run(drawn, "-o", tmp_path / "o.svg", "--wiggle", "1,9")
    assert result.exit_code == 0
    assert ("; left out: outlines of strokes 1\n" in result.stderr) == bool(told)


def test_outlines_that_a_layer_hands_on_are_told(drawn, tmp_path):
    text = drawn.read_text().replace('inkscape:groupmode="layer"', 'stroke="red"')
    drawn.write_text(text.replace('class="stroke"', 'class="stroke" style="stroke:none"', 1))
    result = run(drawn, "-o", tmp_path / "o.svg", "--wiggle", "1,9")
    assert "; left out: outlines of strokes 4\n" in result.stderr


def test_a_preview_and_what_is_left_out(drawn, tmp_path):
    text = drawn.read_text().replace("</svg>", "<text>mine</text></svg>")
    drawn.write_text(text.replace('class="stroke"', 'class="stroke" clip-path="url(#c)"', 2))
    result = run(drawn, "-o", tmp_path / "o.svgz", "--png", "--thickness", "2")
    assert (
        result.exit_code == 0
        and "; left out: shapes 1, clips, gradients, filters 2" in result.stderr
    )
    picture = Image.open(io.BytesIO((tmp_path / "o.png").read_bytes()))
    assert picture.size == (1123, 794)  # A4 at 96 px an inch, lying as the canvas does


@pytest.mark.parametrize(
    "args, code, words",
    [
        (["in.svg", "-o", "in.svg"], 1, "is the input"),
        (["no.svg", "-o", "o.svg"], 1, "no such file"),
        (["in.svg", "-o", "o.bmp"], 2, "drawings are .svg"),
        (["in.svg", "-o", "-", "--png"], 2, "no --png"),
        (["in.svg", "-o", "o.svg", "--thickness", "x"], 2, "takes a number"),
        (["in.svg", "-o", "o.svg", "--thickness", "arm=2"], 1, "no such kind of line or part"),
        (["in.svg", "-o", "o.svg", "--drop", "arm"], 1, "no such kind of line or part"),
        (["in.svg", "-o", "o.svg", "--move", "x:0:1,1"], 1, "no stroke 'x'"),
        (["in.svg", "-o", "o.svg", "--page-size", "A99"], 2, "page size"),
        (["other.svg", "-o", "o.svg"], 1, "no strokes in it that strokestyle wrote"),
        (["other.svg", "-o", "o.svg"], 1, "render --curves"),
        (["in.svg", "-o", "o.svg", "--drop", "<9999"], 1, "takes out all 5 strokes"),
        (["bare.svg", "-o", "o.svg"], 1, "lack what strokestyle wrote"),
        (["hidden.svg", "-o", "o.svg"], 1, "all its strokes, 5, are hidden"),
        (["hidden3.svg", "-o", "o.svg"], 1, "all its strokes, 5, are hidden"),
        (["empty.svg", "-o", "o.svg"], 1, "an empty drawing"),
    ],
)
def test_wrong_use_is_one_line(drawn, tmp_path, monkeypatch, args, code, words):
    (tmp_path / "other.svg").write_text('<svg><path d="M0 0h9"/></svg>')
    text = drawn.read_text()
    (tmp_path / "bare.svg").write_text(re.sub(' data-ss-path="[^"]*"', "", text))
    for name, made in (("hidden", text), ("hidden3", (GOLDEN / "format3.svg").read_text())):
        (tmp_path / f"{name}.svg").write_text(made.replace('id="layer', 'display="none" id="layer'))
    (tmp_path / "empty.svg").write_text('<svg data-ss-format="4" data-ss-size="9 9"/>')
    monkeypatch.chdir(tmp_path)
    result = run(*args)
    assert result.exit_code == code and words in result.stderr and not (tmp_path / "o.svg").exists()
    assert "Traceback" not in result.stderr


def edited(data, *args):
    result = run("-", "-o", "-", *args, input=data)
    assert result.exit_code == 0, result.stderr
    return result.stdout_bytes


@pytest.mark.parametrize("texture", ["grain", "colours"])
@pytest.mark.parametrize("there, back", [("1.5", ".67"), (".8", "1.25"), ("4", ".25")])
def test_thickness_of_images_there_and_back_is_the_file_that_was(texture, there, back):
    first = data = write_svg(small(texture), texture="image").encode()
    for _ in range(3):
        thick = edited(data, "--thickness", there)
        data = edited(thick, "--thickness", back)
    assert thick != first and data == first
    twice = edited(edited(first, "--thickness", "2"), "--thickness", "1.4")
    once = edited(first, "--thickness", "2.8")
    assert read_svg(twice).texture.rgba.tobytes() == read_svg(once).texture.rgba.tobytes()
    width = read_svg(first).strokes.thickness
    assert read_svg(twice).strokes.thickness == pytest.approx(2.8 * width, abs=0.002)


def test_what_was_changed_since_is_not_taken_back():
    first = write_svg(small("colours"), texture="image").encode()
    thick = edited(first, "--thickness", "1.5")
    hand = thick.replace(b'id="s001"', b'id="mine"')
    back = edited(hand, "--thickness", ".67")
    assert b'id="mine"' in back and b"data-ss-was" in back and back.count(b"data-ss-was") == 1
    assert edited(back, "--thickness", "1.5") != hand  # of what the hand left
    assert edited(edited(hand, "--thickness", "2"), "--thickness", ".5") == hand.replace(
        re.search(b' data-ss-was="[^"]*"', hand)[0], b""
    )
    other = edited(thick, "--recolor", "red")
    assert b"data-ss-was" not in other


@pytest.mark.parametrize("texture", ["vector", "none"])
def test_thickness_of_paths_keeps_no_other_file(texture):
    first = write_svg(small("grain"), texture=texture).encode()
    thick = edited(first, "--thickness", "1.5")
    assert b"data-ss-was" not in thick and len(thick) < 1.2 * len(first)


def test_thickness_there_and_back_wears_little_of_tones():
    data = write_svg(small("grain"), texture="vector").encode()
    size, margin = len(data), read_svg(data).texture.margin
    for factor, whole in (("1.25", 1.25), ("0.8", 1.0)) * 4:
        data = edited(data, "--thickness", factor)
        assert read_svg(data).texture.margin == pytest.approx(whole * margin, abs=0.01)
    assert len(data) == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize("program", ["", "-svgo", "-scour", "-inkscape-plain"])
@pytest.mark.parametrize("edits", [["--recolor", "#336"], ["--drop", "other", "--recolor", "#336"]])
def test_edits_of_tones_wear_nothing_whoever_saved_them(program, edits):
    """Thickness and colour there and back, by themselves and at once."""
    first = data = edited((GOLDEN / f"vector{program}.svg").read_bytes(), "--recolor", "#1a284d")
    for _ in range(3):
        blue = edited(data, *edits, "--thickness", "1.25")
        data = edited(edited(blue, "--thickness", ".8"), "--recolor", "#1a284d")
    assert b"data-ss-was" not in blue and b"#333366" in blue and b"#1a284d" not in blue
    assert len(data) == pytest.approx(len(first), rel=0.02)
    was, got = (read_svg(each) for each in (first, data))
    assert got.strokes.thickness == pytest.approx(was.strokes.thickness, abs=0.002)
    assert np.abs(pixels(data) - pixels(first)).mean() < 0.5
    thick = edited(first, *edits, "--thickness", "1.25")
    again = edited(edited(first, *edits), "--thickness", "1.25")
    assert thick == again


def pixels(data):
    picture = Image.open(io.BytesIO(png_from_svg(data.decode(), 2.0)))
    return np.asarray(picture.convert("L"), np.float64)


def test_a_file_of_which_one_stroke_cannot_be_scaled_keeps_what_it_was():
    first = write_svg(small("grain"), texture="vector").encode()
    odd = first.replace(b"opacity:1", b"opacity:.9", 1)
    thick = edited(odd, "--thickness", "1.25")
    assert b"data-ss-was" not in thick  # in the file itself
    moved = odd.replace(b"scale(.15)", b"scale(.15)skewX(9)", 1)
    thick = edited(moved, "--thickness", "1.25")
    assert b"data-ss-was" in thick and edited(thick, "--thickness", ".8") == moved


@pytest.mark.parametrize("texture", ["image", "vector"])
def test_thickness_of_some_strokes_there_and_back_wears_nothing(texture):
    first = data = write_svg(with_parts(small("grain")), texture=texture).encode()
    for _ in range(3):
        thick = edited(data, "--thickness", "contour=1.5", "--thickness", "crease,contour=1.2")
        data = edited(
            thick, "--thickness", "crease,contour=.8333333", "--thickness", "contour=.6666667"
        )
    assert thick != first
    if texture == "image":
        assert data == first
    was, got = read_svg(first), read_svg(data)
    assert got.strokes.thickness == pytest.approx(was.strokes.thickness, abs=0.003)
    assert len(data) == pytest.approx(len(first), rel=0.01)
    ratio = read_svg(thick).strokes.thickness / was.strokes.thickness
    assert sorted(set(np.round(ratio, 1).tolist())) == [1.0, 1.2, 1.8]
