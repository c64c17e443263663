"""Curves from .json and .svg: against closed forms, and against another program's picture of the same file."""

import gzip
import io
import json

import numpy as np
import pytest
from PIL import Image

from strokestyle.curve_files import load_curves
from strokestyle.curves import KINDS
from strokestyle.svg import plain_svg, png_from_svg

SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" {}>{}</svg>'


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


def test_arcs_lie_on_their_circle(tmp_path):
    for flags, centre in (("0 0", (50, 50)), ("0 1", (80, 80)), ("1 0", (80, 80)), ("1 1", (50, 50))):
        line = load(tmp_path, f'<path d="M50 80A30 30 0 {flags} 80 50"/>')[0]
        if flags in ("0 0", "1 1"):
            assert np.allclose(line[[0, -1]], [[50, 80], [80, 50]])
        radius = np.linalg.norm(line - centre, axis=1)
        assert np.abs(radius - 30).max() < 0.1, flags


def test_pictures_agree_with_another_renderer(tmp_path):
    body = """<g transform="translate(60 50) rotate(30) scale(1.5 .8)" fill="none" stroke="black" stroke-width="1.5"
      stroke-linejoin="round">
      <path d="M-30 0c10 -40 20 40 40 0s10 30 20 10q5-20 10 0t4 4"/>
      <g transform="skewX(20)"><path d="M-20 20a20 10 40 1 0 30 5z"/></g>
      <polygon transform="matrix(1 .2 -.3 1 4 5)" points="0,0 20,0 10 15"/>
      <g transform="rotate(45 10 10)skewY(10)"><line x1="0" y1="0" x2="30" y2="3"/></g>
      <svg x="5" y="-30" width="20" height="20" viewBox="0 0 10 5"><polyline points="0 0 10 0 5 5 1 4"/></svg>
    </g>"""
    attributes = 'viewBox="-10 5 120 100" width="400" height="300"'
    svg = SVG.format(attributes, body)
    theirs = np.asarray(Image.open(io.BytesIO(png_from_svg(svg))).convert("L"), float)
    curves = load(tmp_path, body, attributes, (400, 300))
    assert len(curves) == 5
    ours = np.asarray(Image.open(io.BytesIO(png_from_svg(plain_svg(curves, (400, 300)))))).astype(float)[..., 0]
    assert theirs.shape == ours.shape == (300, 400)
    # their strokes are a few pixels wide, ours one: ours must lie within theirs, and reach everywhere along them
    assert (theirs[ours < 100] < 200).all()
    from scipy.ndimage import distance_transform_edt

    assert distance_transform_edt(ours > 150)[theirs < 100].max() < 5


def test_a_box_of_another_shape_is_fitted_and_centred(tmp_path):
    line = '<path d="M0 0L10 10"/>'
    assert np.allclose(load(tmp_path, line, 'viewBox="0 0 10 10"', (200, 100))[0], [[50, 0], [150, 100]])
    stretched = load(tmp_path, line, 'viewBox="0 0 10 10" preserveAspectRatio="none"', (200, 100))
    assert np.allclose(stretched[0], [[0, 0], [200, 100]])
    assert np.allclose(load(tmp_path, line, 'width="20mm" height="20mm"', (96, 96))[0][1], 10 / (20 / 25.4))
    assert np.allclose(load(tmp_path, line, "", (96, 96))[0], [[0, 0], [10, 10]])


def test_kinds_come_from_labels_ids_and_classes(tmp_path):
    curves = load(
        tmp_path,
        """<g inkscape:label="Contours"><path d="M0 0L9 9"/><path id="ridge" d="M0 0L9 9"/></g>
        <g id="layer-valley"><g id="g3"><path class="curve" d="M0 0L9 9"/></g></g>
        <g inkscape:label="Suggestive contours"><line x2="9" y2="9"/></g><path d="M0 0L9 9"/>""",
    )
    assert names(curves) == ["contour", "ridge", "valley", "suggestive", "other"]


def test_closed_and_repeated_subpaths(tmp_path):
    curves = load(tmp_path, '<path d="M0 0H9V9z m20 20h9v9h-9zM50 50L60 60"/><polygon points="0 0 9 0 9 9"/>')
    assert curves.closed.tolist() == [True, True, False, True]
    assert np.allclose(curves[1][0], [20, 20])
    assert all(np.array_equal(curves[i][0], curves[i][-1]) for i in (0, 1, 3))


def test_what_is_hidden_is_no_line(tmp_path):
    line = '<path d="M0 0L9 9"/>'
    hidden = f"""<defs>{line}</defs><g display="none">{line}</g><clipPath>{line}</clipPath>
    <g style="display: none">{line}</g><path d=""/><path d="M3 3"/><polyline/>{line}"""
    assert len(load(tmp_path, hidden)) == 1


def test_plain_drawings_come_back(tmp_path):
    from strokestyle.curves import Curves

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


def test_json(tmp_path):
    path = tmp_path / "c.json"
    data = {"size": [50, 50], "curves": [[[0, 0], [10, 10]], [[5, 5]], [[0, 0], [9, 0], [9, 9]]],
            "kinds": ["Crease", "valley", "hand-drawn"], "closed": [False, False, True]}  # fmt: skip
    path.write_text(json.dumps(data))
    curves = load_curves(path, (100, 100))
    assert names(curves) == ["crease", "other"] and curves.closed.tolist() == [False, True]
    assert np.allclose(curves[0], [[0, 0], [20, 20]]) and len(curves[1]) == 4
    path.write_text(json.dumps({"curves": [[[0, 0], [10, 10]]]}))
    assert np.allclose(load_curves(path, (100, 100))[0], [[0, 0], [10, 10]])


BOMB = '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><svg><path d="&b;"/></svg>'
OUTSIDE = '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/hostname">]><svg><title>&x;</title><path d="M0 0L9 9"/></svg>'
BAD = {
    "empty.svg": "",
    "text.svg": "hello",
    "html.svg": "<html><path d='M0 0L9 9'/></html>",
    "cut.svg": "<svg><path d='M0 0",
    "none.svg": "<svg/>",
    "bomb.svg": BOMB,
    "outside.svg": OUTSIDE,
    "path.svg": "<svg><path d='M0 0 L banana'/></svg>",
    "start.svg": "<svg><path d='L9 9'/></svg>",
    "afterz.svg": "<svg><path d='M0 0L9 9z 4'/></svg>",
    "number.svg": "<svg><path d='M0 0L1e400 0'/></svg>",
    "huge.svg": "<svg><path d='M0 0L1e200 0'/></svg>",
    "transform.svg": "<svg><path transform='matrix(1 2)' d='M0 0L9 9'/></svg>",
    "words.svg": "<svg><path transform='flip(1)' d='M0 0L9 9'/></svg>",
    "box.svg": "<svg viewBox='0 0 0 0'><path d='M0 0L9 9'/></svg>",
    "points.svg": "<svg><polyline points='1 2 x 4'/></svg>",
    "list.json": "[]",
    "cut.json": '{"curves": [[[1, 2], [3',
    "deep.json": "[" * 100000,
    "flat.json": '{"curves": [[1, 2]]}',
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
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_damaged_gzip_missing_files_and_folders(tmp_path):
    (tmp_path / "c.svgz").write_bytes(gzip.compress(b"<svg/>" * 1000)[:-20])
    with pytest.raises(ValueError, match="gzip"):
        load_curves(tmp_path / "c.svgz", (9, 9))
    with pytest.raises(FileNotFoundError):
        load_curves(tmp_path / "no.svg", (9, 9))
    (tmp_path / "d.svg").mkdir()
    with pytest.raises(IsADirectoryError):
        load_curves(tmp_path / "d.svg", (9, 9))


def test_a_plain_doctype_is_harmless(tmp_path):
    doctype = '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">'
    (tmp_path / "c.svg").write_text(doctype + "<svg><path d='M0 0L9 9'/></svg>")
    assert len(load_curves(tmp_path / "c.svg", (9, 9))) == 1


def test_random_damage_never_surprises(tmp_path):
    rng = np.random.default_rng(0)
    body = '<g transform="rotate(9)"><path d="M1 1c1 2 3 4 5 6a3 2 0 1 0 2 2z"/></g>'
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
