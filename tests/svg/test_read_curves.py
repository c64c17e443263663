"""Curves from .json and .svg.

They are held against closed forms, two ways to write one drawing, and another program's picture.
"""

import gzip
import io
import json

import numpy as np
import pytest
from PIL import Image
from svg_programs import small

from strokestyle import files
from strokestyle.geometry.bezier import flatten
from strokestyle.geometry.curves import KINDS, Curves, kind_named
from strokestyle.render.curve_file import load_curves, unread_properties
from strokestyle.svg import xml
from strokestyle.svg.path_data import draw, parse_path, parse_transform, tokens
from strokestyle.svg.write import plain_svg, png_from_svg, write_svg

SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" '
    'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" {}>{}</svg>'
)


def load(tmp_path, body, attributes='viewBox="0 0 100 100"', size=(100, 100)):
    path = tmp_path / "c.svg"
    path.write_text(SVG.format(attributes, body))
    return load_curves(path, size)


def names(curves):
    return [KINDS[k] for k in curves.kind]


@pytest.mark.parametrize(
    "d, end",
    [
        ("M10 10 L 50 20", (50, 20)),
        ("M10,10 50,20", (50, 20)),
        ("m10 10 l40 10", (50, 20)),
        ("M10 10H50V20", (50, 20)),
        ("M10 10h40v10", (50, 20)),
        ("M10-10l40,30", (50, 20)),
        ("M10 10C20 10 40 20 50 20", (50, 20)),
        ("M10 10c1e1 0 30 10 4.0e1 10", (50, 20)),
        ("M10 10S40 20 50 20", (50, 20)),
        ("M0 0M10 10q20 0 40 10", (50, 20)),
        ("M10 10Q20 0 30 15T50 20", (50, 20)),
        ("M10 10a30 30 0 0140 10", (50, 20)),
        ("M10 10A30 30 0 0 1 50 20", (50, 20)),
        ("M10.5.5L50 20", (50, 20)),
    ],
)
def test_every_command_ends_where_it_says(tmp_path, d, end):
    curves = load(tmp_path, f'<path d="{d}"/>')
    assert len(curves) == 1 and not curves.closed[0]
    assert np.allclose(curves[0][-1], end)


K = 0.5522847498307936  # handles of the quarter circle as one cubic, off by 2.7e-4 of the radius


@pytest.mark.parametrize(
    "body",
    [
        '<circle cx="50" cy="40" r="30"/>',
        '<ellipse cx="50%" cy="40" rx="30"/>',
        '<path d="M80 40A30 30 0 0 1 20 40 30 30 0 0 1 80 40"/>',
        '<path d="m80 40a30 30 0 10-60 0a30 30 0 1060 0z"/>',
        '<path d="M20 40a30 30 77 1 1 0 1e-6z"/>',
        '<path d="M20 40a3 3 0 0 1 60 0a.1.1 0 0 1-60 0"/>',  # radii too small reach all the same
        '<path transform="translate(50 40)scale(30)" '
        f'd="M1 0C1 {K} {K} 1 0 1S-1 {K}-1 0-{K}-1 0-1 1-{K} 1 0z"/>',
        '<rect x="20" y="10" width="60" height="60" rx="30"/>',
    ],
)
def test_circles_are_round(tmp_path, body):
    curves = load(tmp_path, body, size=(400, 400))
    assert curves.closed.tolist() == [True]
    radius = np.linalg.norm(curves[0] - [200, 160], axis=1)
    assert np.abs(radius - 120).max() < 0.04
    middles = np.linalg.norm((curves[0][1:] + curves[0][:-1]) / 2 - [200, 160], axis=1)
    assert np.abs(middles - 120).max() < 0.1
    assert np.isclose(curves.lengths()[0], 2 * np.pi * 120, rtol=1e-3)


def test_arcs_take_the_side_that_their_flags_say(tmp_path):
    for flags, centre, quarters in (
        ("0 0", (50, 50), 1),
        ("0 1", (80, 80), 1),
        ("1 0", (80, 80), 3),
        ("1 1", (50, 50), 3),
    ):
        curves = load(tmp_path, f'<path d="M50 80A30 30 0 {flags} 80 50"/>')
        assert np.allclose(curves[0][[0, -1]], [[50, 80], [80, 50]])
        assert np.abs(np.linalg.norm(curves[0] - centre, axis=1) - 30).max() < 0.01, flags
        assert np.isclose(curves.lengths()[0], quarters * 15 * np.pi, rtol=5e-3)


def test_a_rounded_rect_has_its_perimeter(tmp_path):
    curves = load(
        tmp_path,
        '<rect x="5" y="10" width="60" height="40" ry="8"/>'
        '<rect x="2" y="2" width="9" height="5"/>',
    )
    assert np.isclose(curves.lengths()[0], 200 - 8 * 8 + 2 * np.pi * 8, rtol=2e-3)
    assert np.allclose([curves[0].min(axis=0), curves[0].max(axis=0)], [[5, 10], [65, 50]])
    assert np.allclose(curves[1], [[2, 2], [11, 2], [11, 7], [2, 7], [2, 2]])
    pill = load(tmp_path, '<rect x="5" y="10" width="20" height="40" rx="90" ry="10"/>')
    assert np.isclose(pill.lengths()[0], 40 + 20 * np.pi, rtol=5e-3)


@pytest.mark.parametrize("tolerance", [1.0, 0.1, 0.01])
def test_chords_keep_within_the_tolerance_and_are_few(tolerance):
    cubic = np.array([[[0.0, 0], [300, 0], [-100, 200], [200, 200]]])
    xy, offsets = flatten(cubic, np.array([0, 1]), tolerance)
    fine, _ = flatten(cubic, np.array([0, 1]), 1e-5)
    ab = xy[1:] - xy[:-1]
    along = np.clip(((fine[:, None] - xy[:-1]) * ab).sum(-1) / (ab**2).sum(-1), 0, 1)
    off = np.linalg.norm(fine[:, None] - xy[:-1] - along[..., None] * ab, axis=-1).min(axis=1).max()
    assert tolerance / 8 < off < tolerance and offsets.tolist() == [0, len(xy)]


def test_lengths_in_units_of_a_font_are_of_one_of_16_px(tmp_path):
    curves = load(tmp_path, '<rect x="1em" y="2rem" width="2EM" height="1ex"/>')
    assert np.allclose([curves[0].min(axis=0), curves[0].max(axis=0)], [[16, 32], [48, 40]])


def test_what_is_not_looked_at_is_counted(tmp_path):
    load(
        tmp_path,
        '<clipPath id="c"><rect/><text>a</text></clipPath><mask id="m"/>'
        '<path clip-path="url(#c)" d="M0 0h9"/><clipPath/><text/>'
        "<g style=\"clip-path : url(#c);mask:none;transform-box:fill-box\" mask='url(#m)'/>"
        "<style>g{clip-path:circle(9px)} a{clip-path:url('#c')} b{clip-path:url(x.svg#c)}</style>",
    )
    want = {"clip-path": 2, "clipPath of letters": 1, "mask": 1, "transform-box": 1}
    assert unread_properties(tmp_path / "c.svg") == want
    (tmp_path / "c.svgz").write_bytes(gzip.compress((tmp_path / "c.svg").read_bytes()))
    assert unread_properties(tmp_path / "c.svgz") == want
    load(tmp_path, '<path d="M0 0h9" clip-path="none"/>')
    assert unread_properties(tmp_path / "c.svg") == {} == unread_properties("c.json")


# ---------------------------------------------------------------------------------------- two roads


def shape(d):
    subpaths = parse_path(d)
    cubics = np.concatenate(subpaths).reshape(-1, 4, 2)
    return flatten(cubics, np.r_[0, np.cumsum([len(s) for s in subpaths])], 0.1)


@pytest.mark.parametrize(
    "one, other",
    [
        ("M10 20 L30 5 H50 V60 Z", "m10 20 l20-15 h20 v55 z"),
        ("M10 20C30 5 50 60 70 30S90 10 5 5", "m10 20c20-15 40 40 60 10s20-20-65-25"),
        ("M10 20Q30 5 50 60T90 10T1 1", "m10 20q20-15 40 40t40-50t-89-9"),
        ("M10 20A30 12 25 1 0 50 60", "m10 20a30 12 25 1 0 40 40"),
        ("M10 20L30 5ZL40 40M70 70L80 80", "m10 20l20-15zl30 20m30 30l10 10"),
        ("M10 20C30 5 50 60 70 30S90 10 5 5", "M10 20C30 5 50 60 70 30C90 0 90 10 5 5"),
        ("M10 20S50 60 70 30", "M10 20C10 20 50 60 70 30"),
        ("M10 20Q30 5 50 60S90 10 5 5", "M10 20Q30 5 50 60C50 60 90 10 5 5"),
        ("M10 20Q30 5 50 60T90 10T1 1", "M10 20Q30 5 50 60Q70 115 90 10Q110 -95 1 1"),
        ("M10 20T50 60", "M10 20Q10 20 50 60"),
        ("M10 20C30 5 50 60 70 30T90 10", "M10 20C30 5 50 60 70 30Q70 30 90 10"),
        ("M10 20Q30 5 50 60", "M10 20C23.3333333333333 10 36.6666666666667 23.3333333333333 50 60"),
        ("M10-5.5.5 7", "M10 -5.5 L0.5 7"),
        ("M1e1,2E+1-3e-1.4L5.,+6", "M10 20 L-0.3 0.4 L5 6"),
        ("M10 20 30 40 50 10", "M10 20L30 40L50 10"),
        ("m10 20 30 40 50 10", "M10 20l30 40l50 10"),
        ("M0 0a5 4 9 0150 8 5 4 9 1010 3", "M0 0a5 4 9 0 1 50 8a5 4 9 1 0 10 3"),
        ("M0 0a5 4 9 01.5.5", "M0 0a5 4 9 0 1 0.5 0.5"),
        ("\n M 0 , 0\tL\r9\f9 ", "M0 0L9 9"),
        ("M10 20A0 5 0 0 1 50 60", "M10 20L50 60"),
        ("M10 20A5 5 0 0 1 10 20L50 60", "M10 20L50 60"),
        ("M10 20A-30 30 0 0 1 50 60", "M10 20A30 30 0 0 1 50 60"),
        ("M1 1M2 2L3 3M4 4", "M2 2L3 3"),
        ("M0 0L9 0 9 9z", "M0 0L9 0L9 9L0 0"),
        ("M0 0L9 0 9 9L0 0z", "M0 0L9 0L9 9L0 0"),
    ],
)
def test_two_ways_to_write_one_path(one, other):
    (xy, offsets), (same, same_offsets) = shape(one), shape(other)
    assert offsets.tolist() == same_offsets.tolist()
    assert np.abs(xy - same).max() < 1e-9


def test_path_data_are_split_into_commands_that_are_all_named():
    found = list(tokens("m1,2 3-4H.5 6a1 1 0 015 6z"))
    assert found == [
        ("m", [1.0, 2.0]),
        ("l", [3.0, -4.0]),
        ("H", [0.5]),
        ("H", [6.0]),
        ("a", [1.0, 1.0, 0.0, 0.0, 1.0, 5.0, 6.0]),
        ("z", []),
    ]
    assert list(tokens("1 2 3 4", "M")) == [("M", [1.0, 2.0]), ("L", [3.0, 4.0])]
    assert draw([("M", [3.0, 0.0]), ("h", [3.0])]) == [[(3, 0, 4, 0, 5, 0, 6, 0)]]


def test_transforms_are_composed_from_the_outside_in(tmp_path):
    turn, lean = np.radians(30), np.tan(np.radians(20))
    by_hand = (
        np.array([[1, 0, 5], [0, 1, 7], [0, 0, 1]])
        @ np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        @ np.array([[2, 0, 0], [0, 3, 0], [0, 0, 1]])
        @ np.array([[1, lean, 0], [0, 1, 0], [0, 0, 1]])
        @ np.array([[1, 0, 0], [lean, 1, 0], [0, 0, 1]])
        @ np.array([[1, 3, 5], [2, 4, 6], [0, 0, 1]])
    )
    body = """<g transform="translate(5,7) rotate(30)"><a transform="scale(2 3)"><g
    transform="skewX(20)skewY( 20 )">
      <polyline transform="matrix(1 2 3 4 5 6)" points="1 2 3 5 4-2"/></g></a></g>"""
    got = load(tmp_path, body)[0]
    assert np.allclose(got, (np.array([[1, 2, 1], [3, 5, 1], [4, -2, 1]]) @ by_hand.T)[:, :2])
    assert np.allclose(
        parse_transform("rotate(40 3 4)"),
        parse_transform("translate(3 4) rotate(40),translate(-3-4)"),
    )
    assert parse_transform("scale(2)translate(3)") == (2, 0, 0, 2, 6, 0)


def test_pictures_agree_with_another_renderer(tmp_path):
    body = """<g transform="translate(60 50) rotate(30) scale(1.5 .8)" fill="none" stroke="black"
    stroke-width="1.5"
      stroke-linejoin="round">
      <path d="M-30 0c10 -40 20 40 40 0s10 30 20 10q5-20 10 0t4 4"/>
      <g transform="skewX(20)"><path d="M-20 20a20 10 40 1 0 30 5z"/></g>
      <polygon transform="matrix(1 .2 -.3 1 4 5)" points="0,0 20,0 10 15"/>
      <g transform="rotate(45 10 10)skewY(10)"><line x1="0" y1="0" x2="30" y2="3"/></g>
      <svg x="5" y="-30" width="20" height="20" viewBox="0 0 10 5"><polyline points="0 0 10 0 5 5 1
      4"/></svg> <rect x="-35" y="15" width="15" height="12" rx="5" ry="3"/><ellipse cx="25" cy="25"
      rx="4" ry="9"/>
    </g>"""
    attributes = 'viewBox="-10 5 120 100" width="400" height="300"'
    svg = SVG.format(attributes, body)
    theirs = np.asarray(Image.open(io.BytesIO(png_from_svg(svg))).convert("L"), float)
    curves = load(tmp_path, body, attributes, (400, 300))
    assert len(curves) == 7
    ours = np.asarray(Image.open(io.BytesIO(png_from_svg(plain_svg(curves, (400, 300)))))).astype(
        float
    )[..., 0]
    assert theirs.shape == ours.shape == (300, 400)
    # their strokes are a few pixels wide, ours one: ours must lie within theirs, and reach
    # everywhere along them
    assert (theirs[ours < 100] < 200).all()
    from scipy.ndimage import distance_transform_edt

    assert distance_transform_edt(ours > 150)[theirs < 100].max() < 5


@pytest.mark.parametrize(
    "attributes, ends",
    [
        ('viewBox="0 0 10 10"', [[50, 0], [150, 100]]),
        ('viewBox="0,0,10,10" width="100%" height="100%"', [[50, 0], [150, 100]]),
        ('viewBox="0 0 10 10" preserveAspectRatio="none"', [[0, 0], [200, 100]]),
        ('viewBox="0 0 10 10" preserveAspectRatio="xMinYMid meet"', [[0, 0], [100, 100]]),
        ('viewBox="0 0 10 10" preserveAspectRatio="xMidYMax slice"', [[0, -100], [200, 100]]),
        ('viewBox="-10 -10 40 20"', [[50, 50], [100, 100]]),
        ('viewBox="0 0 10 10" width="20mm" height="1cm"', [[50, 0], [150, 100]]),
        ('viewBox="0 0 10 10" width="9in" height="9in"', [[50, 0], [150, 100]]),
        ('width="20" height="10px"', [[0, 0], [100, 100]]),
        ('width="15pt" height="7.5pt"', [[0, 0], [100, 100]]),
        ("", [[0, 0], [10, 10]]),
    ],
)
def test_the_page_is_laid_on_the_canvas(tmp_path, attributes, ends):
    assert np.allclose(load(tmp_path, '<path d="M0 0L10 10"/>', attributes, (200, 100))[0], ends)


def test_a_nested_page_has_its_own_coordinates(tmp_path):
    body = """<svg x="10%" y="20" width="50" height="25%" viewBox="100 0 10 10"><line x1="100"
    x2="110" y2="100%"/>
      </svg>
      <svg x="3" y="4"><line x2="7" y2="9"/></svg>"""
    curves = load(tmp_path, body)
    assert np.allclose(curves[0], [[22.5, 20], [47.5, 45]])
    assert np.allclose(curves[1], [[3, 4], [10, 13]])


def test_the_paper_is_no_line_but_a_frame_inside_it_is(tmp_path):
    line = '<path d="M1 1L9 9"/>'
    for paper in (
        '<rect width="100%" height="100%"/>',
        '<path d="M-5-5H200V105H-5z"/>',
        '<rect x=".3" width="100" height="100"/>',
    ):
        assert len(load(tmp_path, paper + line)) == 1
        assert len(load(tmp_path, paper + line, size=(300, 100))) == 1
    assert len(load(tmp_path, f'<rect x="2" y="2" width="96" height="96"/>{line}')) == 2
    assert len(load(tmp_path, f'<path d="M0 50L50-20 120 50 50 120z"/>{line}')) == 2
    assert len(load(tmp_path, f'<path d="M0 0H100V100"/>{line}')) == 2


def test_kinds_come_from_labels_ids_and_classes(tmp_path):
    curves = load(
        tmp_path,
        """<g inkscape:label="Contours"><path d="M0 0L9 9"/><path id="ridge" d="M0 0L9 9"/></g>
        <g id="layer-valley"><g id="g3"><path class="curve" d="M0 0L9 9"/></g></g>
        <g inkscape:label="Suggestive contours"><line x2="9" y2="9"/></g><path d="M0 0L9 9"/>""",
    )
    assert names(curves) == ["contour", "ridge", "valley", "suggestive", "other"]


@pytest.mark.parametrize(
    "name, kind",
    [
        ("layer-contour", "contour"),
        ("Boundaries", "boundary"),
        ("CREASES 2", "crease"),
        ("suggestive_contours", "suggestive"),
        ("apparentRidges", "apparent"),
        ("valley1", "valley"),
        ("contoured", None),
        ("abridged", None),
        ("another", None),
        ("", None),
    ],
)
def test_names_of_kinds(name, kind):
    assert kind_named(name) == (None if kind is None else KINDS.index(kind))


def test_closed_and_repeated_subpaths(tmp_path):
    curves = load(
        tmp_path, '<path d="M0 0H9V9z m20 20h9v9h-9zM50 50L60 60"/><polygon points="0 0 9 0 9 9"/>'
    )
    assert curves.closed.tolist() == [True, True, False, True]
    assert np.allclose(curves[1][0], [20, 20])
    assert all(np.array_equal(curves[i][0], curves[i][-1]) for i in (0, 1, 3))


def test_rounding_does_not_open_a_curve(tmp_path):
    curves = load(
        tmp_path,
        '<path d="m5.3 5.1l.1.2.2.1.1-.2-.4-.1"/><path d="m5.3 5.1l.1.2.2.1.1-.2-.4-.09"/>',
    )
    assert curves.closed.tolist() == [True, False] and np.array_equal(curves[0][0], curves[0][-1])


def test_what_is_hidden_is_no_line(tmp_path):
    line = '<path d="M0 0L9 9"/>'
    hidden = f"""<defs>{line}</defs><g display="none">{line}</g><clipPath>{line}</clipPath>
    <g style="fill:none; display: none !important">{line}</g><symbol>{line}</symbol>
    <mask><g>{line}</g></mask><pattern>{line}</pattern><marker>{line}</marker>
    <g visibility="hidden">{line}</g><path d="none"/><path/>
    <g style="visibility:hidden">{line}</g><foo:path xmlns:foo="urn:foo" d="M0 0L9 9"/>
    <text>{line}</text><path d=""/><line/><rect width="5"/><circle cx="4"/>
    <ellipse rx="0" ry="4"/><path d="M4 4L4 4z"/><polygon points=" "/>
    <path d="M3 3"/><polyline/>{line}
    <path fill="transparent" d="M0 9h9v9"/><path fill-opacity="0" d="M0 9h9v9"/>
    <g fill="none" stroke="red" stroke-width="0.0px"><path d="M0 9h9"/></g>
    <g style="stroke-opacity:0%;fill:none"><path stroke="red" d="M0 9h9"/></g>
    <path fill="#abc0" stroke="rgb(9 9 9 / 0%)" d="M0 9h9"/><line stroke="#ffffff00" x2="9"/>
    <path fill="rgba(9,9,9,0)" stroke="hsla(9, 9%, 9%, 0.0)" d="M0 9h9"/>"""
    faint = '<path fill="rgba(0,0,0,0.01)" d="M0 9h9v9"/><path stroke="#0001" d="M0 3h9"/>'
    faint += '<path fill="none" stroke="rgb(0,0,0)" stroke-width="0.05" d="M0 4h9"/><line y2="9"/>'
    assert len(load(tmp_path, faint + '<line stroke="#000" stroke-width="05" x2="9"/>')) == 5
    assert len(load(tmp_path, hidden)) == 1
    assert (
        len(load(tmp_path, f'<g visibility="hidden"><g visibility="visible">{line}</g></g>')) == 1
    )


USED = '<defs><path id="l" d="M0 0h10"/><g id="g"><use href="#l" y="2"/></g></defs>'
SYMBOL = '<symbol id="s" viewBox="0 0 10 10"><path d="M0 5h10"/></symbol>'


@pytest.mark.parametrize(
    "body, ends",
    [  # of the lines that are drawn, each (x0, y0, x1, y1)
        (USED, []),
        (USED + '<use href="#l" x="5" y="6"/>', [(5, 6, 15, 6)]),
        (USED + '<use xlink:href="#l" transform="scale(2)" x="5"/>', [(10, 0, 30, 0)]),
        (USED + '<use href="#g" x="1" transform="translate(0 9)"/>', [(1, 11, 11, 11)]),
        ('<use href="#z" x="4"/><path id="z" d="M0 1h1"/>', [(4, 1, 5, 1), (0, 1, 1, 1)]),
        (SYMBOL, []),
        (SYMBOL + '<use href="#s" x="20" width="40" height="40"/>', [(20, 20, 60, 20)]),
        (SYMBOL + '<use href="#s"/>', [(0, 50, 100, 50)]),
        (SYMBOL + '<use href="#s" width="50%" height="10"/>', [(20, 5, 30, 5)]),
        ('<g display="none"><path id="h" d="M0 1h1"/></g><use href="#h"/>', [(0, 1, 1, 1)]),
        (USED + '<use href="#none"/><use href="x.svg#l"/><use href="#"/>', []),
        ('<path style="transform:translate(5px,1in)rotate(90deg)" d="M0 0h4"/>', [(5, 96, 5, 100)]),
        ('<path style="transform:translateX(5px)scaleY(3)" d="M0 2h9"/>', [(5, 6, 14, 6)]),
        ('<path style="transform:rotate(.25turn)skewX(45deg)" d="M0 4h1"/>', [(-4, 4, -4, 5)]),
        ('<path transform="rotate(90)" transform-origin="4 2" d="M4 2h4"/>', [(4, 2, 4, 6)]),
        ('<path transform="scale(2)" style="transform-origin:bottom 10%" d="M9 90h1"/>',
         [(8, 80, 10, 80)]),
        ('<path style="transform:scale(2);transform-origin:center" d="M50 40h1"/>',
         [(50, 30, 52, 30)]),
        ('<path transform-origin="center" d="M5 4h1"/>', [(5, 4, 6, 4)]),
        ('<switch><g systemLanguage="xx"><path d="M0 1h1"/></g><path d="M0 2h1"/><path d="M0 3h1"/>'
         "</switch>", [(0, 2, 1, 2)]),
        ('<polyline points="1 2 3 4 5"/>', [(1, 2, 3, 4)]),
        ('<polyline points="1.5.5-3e-2-4"/>', [(1.5, 0.5, -0.03, -4)]),
        ('<path d="M1.5.5l-3e-2-.5"/>', [(1.5, 0.5, 1.47, 0)]),
        ('<path d="M0 0a1 1 0 01.5.5a1 1 0 10.5.5"/>', [(0, 0, 1, 1)]),
    ],
)  # fmt: skip
def test_what_is_drawn_again_and_where(tmp_path, body, ends):
    always = '<path d="M7 77h7"/>'  # a drawing of nothing is refused
    root = 'xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 100 100"'
    curves = load(tmp_path, body + always, root)
    got = [(*curves[i][0], *curves[i][-1]) for i in range(len(curves))]
    assert np.allclose(sorted(got), sorted([*ends, (7, 77, 14, 77)]), atol=1e-6)


LINE = '<g class="a b"><path id="p" class="c" d="M0 1h1"/></g>'


@pytest.mark.parametrize(
    "sheet, attributes, shown",
    [
        ("", "", True),
        (".c{display:none}", "", False),
        ("path.c, x {display : none !important}", "", False),
        (".a .c{display:none}", "", False),
        (".a>.c{display:none}", "", False),
        ("svg > .c{display:none}", "", True),
        ("#p{display:none}", "", False),
        ("#q{display:none}", "", True),
        (".b{visibility:hidden}", "", False),
        (".b{visibility:hidden}.c{visibility:visible}", "", True),
        (".b{opacity:0}", "", False),
        (".c{opacity:.5}", "", True),
        (".c{display:inline}path{display:none}", "", True),  # a class weighs more than a tag
        (".c{display:none}.c{display:inline}", "", True),
        ("#p{display:none}", 'style="display:inline"', True),
        (".c{display:inline}", 'display="none"', True),  # an attribute weighs less than any rule
        ("/* .c{ */ .c{display:none} /* } */", "", False),
        ("@media print{.c{display:none}}", "", True),
        ("@media screen{.c{display:none}}", "", False),
        ("@import url(x.css); .c{display:none}", "", False),
        ("@font-face{font-family:x}.c:hover{display:none}", "", True),
        ("*{fill:none}", "", False),
        (".a{fill:none;stroke:#000}", "", True),
        (".a{fill:none;stroke:#000}", 'stroke="none"', False),
        (".b{display:none", "", True),  # not closed: no rule
        ("</style><style media='print'>.c{display:none}", "", True),
        ("</style><style media='screen'>.c{display:none}", "", False),
        ("</style><style type='text/less'>.c{display:none}", "", True),
    ],
)
def test_style_sheets_hide_and_show(tmp_path, sheet, attributes, shown):
    sheet = sheet.replace(".a>", ".a&gt;").replace("> ", "&gt; ")
    body = f"<style>{sheet}</style>" + LINE.replace(" d=", f" {attributes} d=")
    always = '<line style="display:inline;visibility:visible" x1="7" y1="7" x2="9" y2="9"/>'
    assert len(load(tmp_path, body + always)) == 1 + shown


def test_use_that_multiplies_is_bounded(tmp_path):
    body = '<path id="a0" d="M0 0h1"/>'
    for k in range(40):
        body += f'<g id="a{k + 1}"><use href="#a{k}"/><use href="#a{k}"/></g>'
    with pytest.raises(ValueError, match="simplify it first"):
        load(tmp_path, f"<defs>{body}</defs><use href='#a40'/>")


def test_our_textured_strokes_are_their_centre_lines(tmp_path):
    for texture in ("vector", "image"):
        (tmp_path / "d.svg").write_text(write_svg(small("grain"), texture=texture, decimals=4))
        curves = load_curves(tmp_path / "d.svg", (120, 100))
        want = small("grain").strokes
        whole = Curves(want.xy, want.offsets, want.kind, want.closed).lengths()
        assert sorted(curves.lengths()) == pytest.approx(sorted(whole), rel=0.01)


def test_plain_drawings_come_back(tmp_path):
    ring = np.stack([50 + 30 * np.cos(t := np.linspace(0, 2 * np.pi, 40)), 50 + 30 * np.sin(t)], 1)
    ring[-1] = ring[0]
    curves = Curves.from_list([ring, np.array([[1.0, 2], [3, 4], [9, 4]])], [0, 5])
    for name, data in (("c.svg", plain_svg(curves, (100, 100)).encode()), ("c.svgz", None)):
        data = data or gzip.compress(plain_svg(curves, (100, 100)).encode())
        (tmp_path / name).write_bytes(data)
        got = load_curves(tmp_path / name, (100, 100))
        assert sorted(names(got)) == ["contour", "valley"]
        i = names(got).index("contour")
        assert got.closed[i] and len(got[i]) == 40 and np.abs(got[i] - ring).max() < 0.01


def test_our_hidden_lines_are_not_read_as_lines(tmp_path):
    seen, hidden = (Curves.from_list([np.array([[1.0, y], [30, y]])], [0]) for y in (10, 20))
    (tmp_path / "c.svg").write_text(plain_svg(seen, (100, 100), hidden=hidden))
    got = load_curves(tmp_path / "c.svg", (100, 100))
    assert len(got) == 1 and np.abs(got.xy - seen.xy).max() < 0.01


def test_json(tmp_path):
    path = tmp_path / "c.json"
    data = {"size": [50, 50], "curves": [[[0, 0], [10, 10]], [[5, 5]], [[0, 0], [9, 0], [9, 9]]],
             "kinds": ["Crease", "valley", "hand-drawn"],
             "closed": [False, False, True]}  # fmt: skip
    path.write_text(json.dumps(data))
    curves = load_curves(path, (100, 100))
    assert names(curves) == ["crease", "other"] and curves.closed.tolist() == [False, True]
    assert np.allclose(curves[0], [[0, 0], [20, 20]]) and len(curves[1]) == 4
    path.write_text(json.dumps({"curves": [[[0, 0], [10, 10]]]}))
    assert np.allclose(load_curves(path, (100, 100))[0], [[0, 0], [10, 10]])


def test_a_json_comes_back_as_it_was(tmp_path):
    rng = np.random.default_rng(3)
    lines = [np.round(rng.uniform(0, 768, (n, 2)), 2) for n in (2, 30, 7)]
    lines[1][-1] = lines[1][0]
    data = {
        "format": "strokestyle-curves-1",
        "size": [768, 512],
        "curves": [line.tolist() for line in lines],
    }
    path = tmp_path / "c.json"
    path.write_text(
        json.dumps(
            {**data, "kinds": ["contour", "apparent", "valley"], "closed": [False, True, False]}
        )
    )
    curves = load_curves(path, (768, 512))
    assert np.array_equal(curves.xy, np.concatenate(lines)) and curves.closed.tolist() == [
        False,
        True,
        False,
    ]
    assert names(curves) == ["contour", "apparent", "valley"]
    for encoding in ("utf-8-sig", "utf-16"):
        path.write_text(json.dumps(data), encoding=encoding)
        assert load_curves(path, (768, 512)).closed.tolist() == [False, True, False]
    assert np.allclose(load_curves(path, (1536, 2048)).xy, np.concatenate(lines) * 2 + [0, 512])


def test_an_open_curve_whose_ends_meet_stays_open_where_the_json_says_so(tmp_path):
    path = tmp_path / "c.json"
    path.write_text('{"curves": [[[0, 0], [9, 0], [9, 9], [0, 0]]], "closed": [false]}')
    assert not load_curves(path, (9, 9)).closed[0]


def test_our_own_strokes_give_their_centre_lines(tmp_path):
    body = """<g id="layer-valley"><path data-ss-class="contour" data-ss-path="M2 2l50 9" d="M0
    0h9v9z"/>
      <g class="stroke" data-ss-path="M5 5l7 7"><path d="M0 0h9v9z"/></g></g>"""
    curves = load(tmp_path, body)
    assert names(curves) == ["contour", "valley"]
    assert np.allclose(curves.xy, [[2, 2], [52, 11], [5, 5], [12, 12]])


# ---------------------------------------------------------------------------- bad and hostile files

DOCTYPE = '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://127.0.0.1:9/svg11.dtd">'
SUBSET = '<!DOCTYPE svg PUBLIC "-//a" "a>b" [<!ATTLIST path d CDATA "M0 0L1 1">]>'
BOMB = '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><svg><path d="&b;"/></svg>'
OUTSIDE = (
    '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/hostname">]>'
    '<svg><title>&x;</title><path d="M0 0L9 9"/></svg>'
)
BAD = {
    "empty.svg": "",
    "text.svg": "hello",
    "html.svg": "<html><path d='M0 0L9 9'/></html>",
    "cut.svg": "<svg><path d='M0 0",
    "none.svg": "<svg/>",
    "bomb.svg": BOMB,
    "outside.svg": OUTSIDE,
    "doctype.svg": SUBSET + "<svg><path d='M0 0L9 9'/></svg>",
    "lower.svg": "<svg><!doctype x><path d='M0 0L9 9'/></svg>",
    "deep.svg": "<svg>" + "<g>" * 100_000,
    "pixels.svg": "<svg width='0'><path d='M0 0L9 9'/></svg>",
    "unit.svg": "<svg><rect width='9ells' height='9'/></svg>",
    "shrunk.svg": "<svg><path transform='matrix(0 0 0 0 5 5)' d='M0 0L9 9'/></svg>",
    "grown.svg": "<svg><g transform='" + "scale(1e9)" * 9 + "'><path d='M0 0L9 9'/></g></svg>",
    "blown.svg": "<svg viewBox='0 0 1e-9 1e-9'><path d='M0 0C1e9 1e9 -1e9 1e9 9 9'/></svg>",
    "odd.svg": "<svg><polyline points='1 2 3'/></svg>",
    "flag.svg": "<svg><path d='M0 0A1 1 0 2 0 9 9'/></svg>",
    "comma.svg": "<svg><path d='M0 0,,9 9'/></svg>",
    "digits.svg": "<svg><path d='M0 0L" + "9" * 100_000 + " 0'/></svg>",
    "spaces.svg": "<svg><path d='M0 0L" + " " * 100_000 + ";'/></svg>",
    "encoding.svg": "<?xml version='1.0' encoding='klingon'?><svg/>",
    "only-hidden.svg": "<svg><defs><path d='M0 0L9 9'/></defs></svg>",
    "object.json": '{"curves": {"a": 1}}',
    "keys.json": '{"lines": []}',
    "third.json": '{"curves": [[[1, 2, 3], [4, 5, 6]]]}',
    "number.json": '{"curves": [[[1' + "0" * 9000 + ", 2]]]}",
    "points.json": '{"curves": [[[1, 2], [1, 2]]]}',
    "names.json": '{"curves": [[[1, 2], [3, 4]]], "kinds": [7]}',
    "closed.json": '{"curves": [[[1, 2], [3, 4]]], "closed": [1]}',
    "nan-size.json": '{"curves": [[[1, 2], [3, 4]]], "size": [NaN, 5]}',
    "noending": "x",
    "path.svg": "<svg><path d='M0 0 L banana'/></svg>",
    "start.svg": "<svg><path d='L9 9'/></svg>",
    "afterz.svg": "<svg><path d='M0 0L9 9z 4'/></svg>",
    "number.svg": "<svg><path d='M0 0L1e400 0'/></svg>",
    "huge.svg": "<svg><path d='M0 0L1e200 0'/></svg>",
    "sum.svg": "<svg><path d='m0 0" + "l1e12 1e12" * 99 + "'/><path d='M0 0L1 banana'/></svg>",
    "transform.svg": "<svg><path transform='matrix(1 2)' d='M0 0L9 9'/></svg>",
    "words.svg": "<svg><path transform='flip(1)' d='M0 0L9 9'/></svg>",
    "box.svg": "<svg viewBox='0 0 0 0'><path d='M0 0L9 9'/></svg>",
    "points.svg": "<svg><polyline points='1 2 x 4'/></svg>",
    "list.json": "[]",
    "cut.json": '{"curves": [[[1, 2], [3',
    "deep.json": "[" * 100000,
    "flat.json": '{"curves": [[1, 2]]}',
    "texts.json": '{"curves": [[["1", "2"], ["3", "4"]]]}',
    "truths.json": '{"curves": [[[true, false], [false, true]]]}',
    "words.json": '{"curves": [[["a", 2], [3, 4]]]}',
    "ragged.json": '{"curves": [[[1, 2], [3]]]}',
    "nan.json": '{"curves": [[[NaN, 2], [3, 4]]]}',
    "big.json": '{"curves": [[[1e308, 2], [3, 4]]]}',
    "integer.json": '{"curves": [[[1' + "0" * 400 + ", 2], [3, 4]]]}",
    "nothing.json": '{"curves": []}',
    "kinds.json": '{"curves": [[[1, 2], [3, 4]]], "kinds": []}',
    "fewer.json": '{"curves": [[[1, 2], [3, 4]]], "kinds": ["valley", "ridge"]}',
    "size.json": '{"curves": [[[1, 2], [3, 4]]], "size": [0, 5]}',
    "sizes.json": '{"curves": [[[1, 2], [3, 4]]], "size": "big"}',
    "picture.png": "x",
}


@pytest.mark.parametrize("name", list(BAD))
def test_bad_files_are_refused_in_one_line(tmp_path, name):
    path = tmp_path / name
    path.write_text(BAD[name])
    with pytest.raises(ValueError) as error:
        load_curves(path, (100, 100))
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)
    assert len(str(error.value)) - len(str(path)) < 250


@pytest.mark.parametrize(
    "body, place",
    [
        (
            '<g>\n<path id="p1" d="M0 0 L9 banana"/></g>',
            'line 2, <path id="p1">: bad d at character 9, "banana"',
        ),
        ('<path id="a\nb" d="9 9"/>', 'bad d at character 1, "9 9": expected M or m first'),
        ('<polygon points="1 2 3 x 5"/>', "bad points at character 7"),
        ('<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>', "draws itself"),
        ('<use id="u" href="#u"/>', "draws itself"),
        ('<path d="M0 0A5 5 0 2 0 9 9"/>', "expected a flag of A, 0 or 1"),
        ('<g transform="rotate(1 2)"/>', "transform rotate with 2 numbers"),
        ('<g transform="scale(2) x"/>', 'bad transform at character 9, " x"'),
        ('<line x1="1lightyear"/>', "1lightyear"),
    ],
)
def test_a_bad_drawing_is_refused_with_its_place(tmp_path, body, place):
    with pytest.raises(ValueError) as error:
        load(tmp_path, body)
    assert place in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_declarations_are_refused_in_every_encoding(tmp_path, encoding):
    for declared in (BOMB, OUTSIDE, SUBSET + "<svg/>"):
        (tmp_path / "c.svg").write_text(declared, encoding=encoding)
        with pytest.raises(
            ValueError, match="DOCTYPE" if "ENTITY" in declared else "DOCTYPE|not an SVG file"
        ):
            load_curves(tmp_path / "c.svg", (9, 9))


def test_the_parser_itself_refuses_declarations():
    for declared in (BOMB, SUBSET + "<svg/>"):
        with pytest.raises(ValueError, match="DOCTYPE"):
            xml.SaxReader(print, print).parser.Parse(declared, True)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_document_type_that_only_names_svg_is_let_through_and_not_fetched(tmp_path, encoding):
    declared = (
        DOCTYPE
        + "\n<!-- Created with an old program -->\n"
        + "<svg><path d='M0 0L9 9'/><text>&unknown;</text></svg>"
    )
    (tmp_path / "c.svg").write_text(
        f'<?xml version="1.0" standalone="no"?>{declared}', encoding=encoding
    )
    assert len(load_curves(tmp_path / "c.svg", (9, 9))) == 1


def test_utf_16_is_read(tmp_path):
    (tmp_path / "c.svg").write_text("<svg><path d='M0 0L9 9'/></svg>", encoding="utf-16")
    assert len(load_curves(tmp_path / "c.svg", (9, 9))) == 1


def test_references_are_not_followed(tmp_path):
    body = """<use href="http://127.0.0.1:9/a.svg#x"/><image
    href="file:///etc/hostname"/><style>@import "file:///x"</style>
      <path d="M0 0L9 9"/>"""
    assert len(load(tmp_path, body)) == 1


@pytest.mark.parametrize(
    "limit, value, found",
    [
        ("MAX_POINTS", 5, "than 5"),
        ("MAX_CURVES", 1, "curves"),
        ("MAX_ELEMENTS", 3, "than (3 elements|15 attributes)"),
        ("MAX_BYTES", 99, "MB"),
        ("MAX_TEXT", 10, "than 10"),
    ],
)
def test_large_files_are_refused(tmp_path, monkeypatch, limit, value, found):
    monkeypatch.setattr(files, limit, value)
    body = '<path d="M1 1h1h1h1h1h1"/><path d="M2 2h1"/><path d="M2 2h1"/>'
    with pytest.raises(ValueError, match=found):
        load(tmp_path, body)
    with pytest.raises(ValueError, match=found):
        load(tmp_path, '<path d="M1 1C99 1 1 99 99 99"/>' * 3, size=(900, 900))
    if limit not in ("MAX_ELEMENTS", "MAX_TEXT"):
        path = tmp_path / "c.json"
        path.write_text(json.dumps({"curves": [[[i, i] for i in range(4)]] * 3}))
        with pytest.raises(ValueError, match=found):
            load_curves(path, (9, 9))


def test_crowds_are_refused_before_they_are_parsed(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MAX_ATTRIBUTES", 15)
    with pytest.raises(ValueError, match="15 attributes"):
        load(tmp_path, "<g " + " ".join(f'a{i}="1"' for i in range(20)) + "/>")
    monkeypatch.setattr(files, "MAX_POINTS", 3)
    (tmp_path / "c.json").write_text('{"curves": [' + "[]," * 30 + "[]]}")
    with pytest.raises(ValueError, match="24 lists"):
        load_curves(tmp_path / "c.json", (9, 9))


def test_depth_is_limited(tmp_path):
    line = '<path d="M0 0L9 9"/>'
    assert len(load(tmp_path, "<g>" * 200 + line + "</g>" * 200)) == 1
    with pytest.raises(ValueError, match="256 inside one another"):
        load(tmp_path, "<g>" * 300 + line + "</g>" * 300)


def test_an_svgz_is_limited_by_what_it_unpacks_to(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MAX_BYTES", 10_000)
    path = tmp_path / "c.svgz"
    path.write_bytes(gzip.compress(b"<svg>" + b" " * 10**6 + b"<path d='M0 0L9 9'/></svg>"))
    assert path.stat().st_size < 5_000
    with pytest.raises(ValueError, match="larger than"):
        load_curves(path, (9, 9))


def test_damaged_gzip_missing_files_and_folders(tmp_path):
    whole = gzip.compress(b"<svg><path d='M0 0L9 9'/></svg>")
    (tmp_path / "c.svgz").write_bytes(whole[:-4])
    with pytest.raises(ValueError, match="cut short"):
        load_curves(tmp_path / "c.svgz", (9, 9))
    (tmp_path / "c.svgz").write_bytes(whole[:20] + b"??" + whole[22:])
    with pytest.raises(ValueError, match="damaged gzip data"):
        load_curves(tmp_path / "c.svgz", (9, 9))
    with pytest.raises(FileNotFoundError):
        load_curves(tmp_path / "no.svg", (9, 9))
    (tmp_path / "d.svg").mkdir()
    with pytest.raises(IsADirectoryError):
        load_curves(tmp_path / "d.svg", (9, 9))


def test_random_damage_never_surprises(tmp_path):
    rng = np.random.default_rng(0)
    body = (
        '<g transform="rotate(9)"><path d="M1 1c1 2 3 4 5 6a3 2 0 1 0 2 2z"/><circle r="5%"/></g>'
    )
    whole = SVG.format('viewBox="0 0 9 9"', body).encode()
    path = tmp_path / "c.svg"
    for _ in range(300):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), rng.integers(1, 4)):
            data[at] = rng.integers(32, 127)
        path.write_bytes(bytes(data))
        try:
            curves = load_curves(path, (90, 90))
        except ValueError as error:
            assert "\n" not in str(error)
        else:
            assert np.isfinite(curves.xy).all()
