"""Thickness scaled in the file itself: what it changes, and what it leaves to the letter."""

import io
import re

import numpy as np
import pytest
from PIL import Image
from small_drawings import drawing
from svg_programs import GOLDEN, small

from strokestyle.drawing.edit import thicken
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.curves import KINDS
from strokestyle.svg import rescale
from strokestyle.svg.path_data import parse_path
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.rescale import thickened_svg
from strokestyle.svg.write import png_from_svg, write_svg

TEXT = write_svg(small("grain"), texture="vector", title="a")


def all_by(factor):
    return lambda kinds, parts: np.full(len(kinds), factor)


def scaled(text, factor):
    made = thickened_svg(text.encode(), all_by(factor))
    assert made is not None
    return made[0]


def pixels(text):
    picture = Image.open(io.BytesIO(png_from_svg(text, 2.0)))
    return np.asarray(picture.convert("L"), np.float64)


def test_a_factor_of_one_changes_no_letter():
    assert thickened_svg(TEXT.encode(), all_by(1.0)) == (TEXT, 5)
    wide = write_svg(drawing(texture="grain"), texture="vector")
    assert scaled(wide, 1.0) == wide


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.25, 1.5])
def test_widths_are_multiplied_and_lines_stay(factor):
    was, got = read_svg(TEXT), read_svg_file(scaled(TEXT, factor))
    assert np.array_equal(got.drawing.strokes.xy, was.strokes.xy)
    assert got.drawing.strokes.thickness == pytest.approx(factor * was.strokes.thickness, abs=0.001)
    assert got.drawing.texture.margin == pytest.approx(factor * was.texture.margin)
    assert len(got.kept) == 5 and np.array_equal(got.drawing.color, was.color)


def test_it_looks_like_the_edit_of_the_drawing():
    edited = write_svg(thicken(read_svg(TEXT), 1.25), texture="vector")
    pictures = [pixels(text) for text in (scaled(TEXT, 1.25), edited, TEXT)]
    ours, theirs, before = pictures
    assert (255 - ours).mean() == pytest.approx((255 - theirs).mean(), rel=0.12)
    assert (255 - ours).mean() > 1.15 * (255 - before).mean()


def test_a_tree_finds_the_places_that_all_pairs_find(monkeypatch):
    random = np.random.default_rng(0)
    lines = [random.uniform(0, 100, (n, 2)) for n in (40, 1, 7, 300)]
    of = np.repeat([0, 2, 3], 50)  # a stroke may have no points
    points = random.uniform(0, 100, (len(of), 2))
    by_pairs = rescale._nearest(points, of, lines)
    monkeypatch.setattr(rescale, "AT_ONCE", 1000)
    assert np.array_equal(rescale._nearest(points, of, lines), by_pairs)
    monkeypatch.setattr(rescale, "MAX_PAIRS", 0)
    assert np.array_equal(rescale._nearest(points, of, lines), by_pairs)
    begin = np.cumsum([0, *map(len, lines)])
    assert (begin[of] <= by_pairs).all() and (by_pairs < begin[of + 1]).all()


def test_there_and_back_eight_times_wears_nothing():
    text = TEXT
    for _ in range(8):
        text = scaled(scaled(text, 1.25), 0.8)
    ends = [pixels(each) for each in (TEXT, text)]
    assert np.abs(ends[0] - ends[1]).mean() < 0.5
    assert len(text) == pytest.approx(len(TEXT), rel=0.01)
    assert scaled(scaled(text, 1.25), 0.8) == text  # as often as one likes


def test_each_point_of_a_tone_goes_away_from_the_line_by_the_factor():
    """A straight stroke along y = 50, whose tones' places are read off their path data."""
    line = Strokes([[20.0, 50], [90, 50]], [12.0, 12], [0, 2], [0], [False])
    strip = np.zeros((140, 16, 4), np.uint8)
    strip[30:110, 3:13, 3] = 200
    text = write_svg(
        Drawing(line, (110, 100), [[0, 0, 0, 1]], Texture(strip, [0, 140], 2.0)), texture="vector"
    )
    (was, x), (now, new_x) = (heights(each) for each in (text, scaled(text, 1.5)))
    assert np.ptp(was) > 8 and now - 50 == pytest.approx(1.5 * (was - 50), abs=0.16)
    assert new_x == pytest.approx(x, abs=0.16)


def heights(text):
    """How low and how high tones reach, and from where to where, px, of the tones' curves."""
    d = [parse_path(path) for path in re.findall(' d="([^"]*)"', text)]
    xy = 0.15 * np.concatenate([np.array(ring).reshape(-1, 2) for path in d for ring in path])
    middle = xy[(xy[:, 0] > 22) & (xy[:, 0] < 88)]
    return np.array([middle[:, 1].min(), middle[:, 1].max()]), np.sort(middle[:, 0])[[0, -1]]


@pytest.mark.parametrize(
    "change",
    [
        ("</svg>", '<path d="M0 0h9"/></svg>'),
        ('d="M', 'd="M1 '),
        ('transform="scale(.15)"', 'transform="scale(.3)"'),
        ("texture=vector", "texture=image"),
        ('<path class="tone"', '<image width="9" height="9"/><path class="tone"'),
        ("<desc>valley</desc>", '<desc d="M0 0h9">valley</desc>'),
        (' data-ss-width="', " data-ss-width='1' data-ss-was=\""),
    ],
)
def test_what_a_hand_worked_on_is_read_as_a_drawing(change):
    text = TEXT.replace(*change, 1)
    assert text != TEXT and thickened_svg(text.encode(), all_by(1.25)) is None


@pytest.mark.parametrize("factor", [0.0, 0.4, 3.0, 100.0])
def test_large_factors_are_drawn_anew(factor):
    assert thickened_svg(TEXT.encode(), all_by(factor)) is None


@pytest.mark.parametrize("texture", [None, "colours"])
def test_other_encodings_are_read_as_drawings(texture):
    assert thickened_svg(write_svg(small(texture)).encode(), all_by(1.25)) is None


@pytest.mark.parametrize("program", ["inkscape", "inkscape-plain", "scour", "svgo"])
def test_a_file_that_another_program_saved_is_scaled_as_ours_is(program):
    texts = [(GOLDEN / f"vector{name}.svg").read_text() for name in ("", f"-{program}")]
    ours, theirs = (scaled(text, 1.25) for text in texts)
    for name in ("d", "data-ss-width", "data-ss-margin", "data-ss-at"):
        pattern = rf'\s{name}="([^"]*)"'
        got, want = (re.findall(pattern, text) for text in (theirs, ours))
        if name == "d":  # svgo loses rings that enclose nothing; nobody sees them
            got, want = ([d.count("z") > 0 for d in each] for each in (got, want))
        assert got == want != []
    assert np.abs(pixels(theirs) - pixels(ours)).mean() < 0.35  # scour rounds the page
    assert ("sodipodi:namedview" in theirs) == (program == "inkscape")


@pytest.mark.parametrize(
    "change",
    [
        ('class="stroke"', 'class="stroke" transform="translate(9 4) rotate(20) scale(.8)"'),
        ('<g id="layer-contour"', '<g id="layer-contour" transform="scale(1 .5)"'),
        ('<g id="layer-contour"', '<g id="layer-contour" opacity=".5"'),
        ('viewBox="0 0 120', 'viewBox="0 0 90'),
        ("<title", "<style>.stroke{fill:#a33}</style><title"),
    ],
)
def test_strokes_that_a_hand_moved_or_faded_are_scaled_where_they_are(change):
    text = TEXT.replace(*change, 1)
    made = scaled(text, 1.25)
    assert text != TEXT and made == scaled(TEXT, 1.25).replace(*change, 1)
    was, got = read_svg(text), read_svg(made)
    assert got.strokes.thickness == pytest.approx(1.25 * was.strokes.thickness, abs=0.001)


def test_tones_that_were_moved_one_by_one_are_scaled_where_they_are():
    """As after Ungroup and Group in Inkscape: each shape is turned, and its data are not."""
    turned = "rotate(20)translate(6 2)"
    group = TEXT.replace('class="stroke"', f'class="stroke" transform="{turned}"')
    each = TEXT.replace('transform="scale(.15)"', f'transform="{turned}scale(.15)"')
    made = scaled(each, 1.25)
    assert made.replace(turned + "scale", "scale") == scaled(TEXT, 1.25)
    assert np.abs(pixels(made) - pixels(scaled(group, 1.25))).mean() < 0.01


def test_strokes_of_factor_one_stay_to_the_letter():
    """Of two kinds; what a hand did to the others does not matter."""
    text = TEXT.replace('id="s000" class="stroke"', 'id="s000" class="stroke" opacity=".5"', 1)
    assert text != TEXT

    def contours(kinds, parts):
        assert parts is None
        return np.where(kinds == KINDS.index("contour"), 1.25, 1.0)

    made = thickened_svg(text.encode(), contours)
    assert made is not None
    layers = [re.split('(?=<g id="layer)', each) for each in (text, made[0])]
    assert [a == b for a, b in zip(*layers, strict=True)] == [True, True, True, True, False]
    seen = []
    for _ in range(3):
        back = thickened_svg(made[0].encode(), lambda *lines: 1 / contours(*lines))
        assert back is not None
        made = thickened_svg(back[0].encode(), contours)
        assert made is not None
        seen.append(made[0])
    assert seen[1] == seen[2]  # as often as one likes
