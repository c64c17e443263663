"""Clip paths: what of a drawing's curves is left, by closed forms and as another program has it."""

import io

import numpy as np
import pytest
from PIL import Image

from strokestyle import files
from strokestyle.svg import clip
from strokestyle.svg.clip import NEAR, ClipShape, Region, cut_lines
from strokestyle.svg.read_curves import read_curves_svg
from strokestyle.svg.write import plain_svg, png_from_svg

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
BOX = '<clipPath id="c" {}><rect x="20" y="30" width="50" height="40"/></clipPath>'
IN_BOX = (
    '<clipPath id="c" clipPathUnits="objectBoundingBox"><rect x=".5" width="1" height="1"/>'
    "</clipPath>"
)
RING = "M10 10h80v80h-80zM30 30h40v40h-40z"
AWAY = '<path d="M1 99h4"/>'  # a drawing of nothing is refused


def read(body, size=(100, 100)):
    return read_curves_svg((HEAD + body + AWAY + "</svg>").encode(), size, 0.01)


def ends(body):
    """The ends of all pieces but AWAY, sorted."""
    curves = read(body)
    made = [(*curves[i][0], *curves[i][-1]) for i in range(len(curves))]
    return sorted(end for end in made if end != (1, 99, 5, 99))


@pytest.mark.parametrize(
    "body, left",
    [
        (BOX + '<path clip-path="url(#c)" d="M0 50h100"/>', [(20, 50, 70, 50)]),
        (BOX + '<path clip-path="url(#c)" d="M0 10h100"/>', []),
        (BOX + '<path clip-path="url(#c)" d="M30 40h10"/>', [(30, 40, 40, 40)]),
        (BOX + '<path style="clip-path:url(\'#c\')" d="M30 0v100"/>', [(30, 30, 30, 70)]),
        (BOX + '<style>path{clip-path:url("#c")}</style><path d="M30 50v99"/>',
         [(30, 50, 30, 70)]),
        (BOX + '<path clip-path="none" d="M0 50h9"/>', [(0, 50, 9, 50)]),
        (BOX + '<path clip-path="url(#nobody)" d="M0 50h9"/>', [(0, 50, 9, 50)]),
        ('<clipPath id="c"/><path clip-path="url(#c)" d="M0 50h9"/>', []),
        ('<clipPath id="c"><text>a</text></clipPath><path clip-path="url(#c)" d="M0 5h9"/>',
         [(0, 5, 9, 5)]),
        # along an outline: seen by half of its thickness
        (BOX + '<path clip-path="url(#c)" d="M0 30h100"/>', [(20, 30, 70, 30)]),
        (BOX + '<path clip-path="url(#c)" d="M0 30H50V0"/>', [(20, 30, 50, 30)]),
        (BOX + '<rect clip-path="url(#c)" x="20" y="30" width="50" height="40"/>',
         [(20, 30, 20, 30)]),
        # two pieces, and one across the place where the outline begins
        (BOX + '<path clip-path="url(#c)" d="M30 0V100H40V0"/>',
         [(30, 30, 30, 70), (40, 70, 40, 30)]),
        (BOX + '<rect clip-path="url(#c)" x="30" y="40" width="90" height="10"/>',
         [(70, 50, 70, 40)]),
        # transforms of the clip path, of what it clips, and of a shape in it
        (BOX.format('transform="translate(5 0)"') + '<path clip-path="url(#c)" d="M0 50h100"/>',
         [(25, 50, 75, 50)]),
        (BOX + '<path clip-path="url(#c)" transform="scale(.5)" d="M0 50h100"/>',
         [(10, 25, 35, 25)]),
        ('<clipPath id="c"><rect transform="rotate(90)" y="-50" width="99" height="9"/></clipPath>'
         '<path clip-path="url(#c)" d="M0 50h100"/>', [(41, 50, 50, 50)]),
        # of groups, `use`, one in the other
        (BOX + '<g clip-path="url(#c)" transform="translate(0 9)"><path d="M0 50h100"/></g>',
         [(20, 59, 70, 59)]),
        (BOX + '<path id="p" d="M0 9h99"/><use href="#p" y="41" clip-path="url(#c)"/>',
         [(0, 9, 99, 9), (20, 50, 70, 50)]),
        (BOX + '<clipPath id="d"><rect width="40" height="99"/></clipPath><g clip-path="url(#c)">'
         '<path clip-path="url(#d)" d="M0 50h100"/></g>', [(20, 50, 40, 50)]),
        (BOX.format('clip-path="url(#d)"') + '<clipPath id="d"><rect width="40" height="99"/>'
         '</clipPath><path clip-path="url(#c)" d="M0 50h100"/>', [(20, 50, 40, 50)]),
        ('<clipPath id="d"><rect width="40" height="99"/></clipPath><clipPath id="c"><rect '
         'clip-path="url(#d)" x="9" width="40" height="99"/><rect x="60" width="9" height="99"/>'
         '</clipPath><path clip-path="url(#c)" d="M0 50h100"/>',
         [(9, 50, 40, 50), (60, 50, 69, 50)]),
        # two shapes are one region, where they overlap and where they touch
        ('<clipPath id="c"><rect width="40" height="99"/><rect x="30" width="20" height="99"/>'
         '<rect x="50" width="9" height="99"/></clipPath><path clip-path="url(#c)" d="M9 5h99"/>',
         [(9, 5, 59, 5)]),
        ('<clipPath id="c"><use href="#s" x="7"/></clipPath><rect id="s" width="20" height="99" '
         'display="inline" stroke-width="0" fill="none"/><path clip-path="url(#c)" d="M0 5h99"/>',
         [(7, 5, 27, 5)]),
        ('<clipPath id="c"><rect width="9" height="9" display="none"/><rect width="9" height="9" '
         'visibility="hidden"/></clipPath><path clip-path="url(#c)" d="M0 5h99"/>', []),
        # rules of filling
        (f'<clipPath id="c"><path d="{RING}"/></clipPath><path clip-path="url(#c)" d="M0 50h100"/>',
         [(10, 50, 90, 50)]),
        (f'<clipPath id="c"><path clip-rule="evenodd" d="{RING}"/></clipPath>'
         '<path clip-path="url(#c)" d="M0 50h100"/>', [(10, 50, 30, 50), (70, 50, 90, 50)]),
        (f'<clipPath id="c" style="clip-rule:evenodd"><path d="{RING}"/></clipPath>'
         '<path clip-path="url(#c)" d="M0 50h100"/>', [(10, 50, 30, 50), (70, 50, 90, 50)]),
        # shares of the box of what is clipped
        (IN_BOX + '<path clip-path="url(#c)" d="M0 0L40 40"/>', [(20, 20, 40, 40)]),
        (IN_BOX + '<path clip-path="url(#c)" d="M0 50h40"/>', [(0, 50, 40, 50)]),  # of no height
        (IN_BOX + '<g clip-path="url(#c)"><path d="M0 0h10"/><path transform="scale(2)" '
         'd="M5 9h25"/></g>', [(30, 18, 60, 18)]),
        (IN_BOX + '<path transform="translate(9)" clip-path="url(#c)" d="M0 0Q40 80 80 0"/>',
         [(49, 40, 89, 0)]),
        (IN_BOX.replace('Box">', 'Box" clip-path="url(#d)">') + '<clipPath id="d"><rect '
         'width="30" height="99"/></clipPath><path clip-path="url(#c)" d="M0 0L40 40"/>',
         [(20, 20, 30, 30)]),
        ('<clipPath id="d" clip-path="url(#c)"><rect width="30" height="99"/></clipPath>' + IN_BOX
         + '<path clip-path="url(#d)" d="M0 0L40 40"/>', [(20, 20, 30, 30)]),
        # what svg and symbol elements do not show
        ('<svg x="5" width="50" height="50"><path d="M-9 9h99"/></svg>', [(5, 9, 55, 9)]),
        ('<svg width="50" height="50" overflow="visible"><path d="M0 9h99"/></svg>',
         [(0, 9, 99, 9)]),
        ('<symbol id="y" viewBox="0 0 9 9"><path d="M-9 3h30"/></symbol>'
         '<use href="#y" width="30" height="30"/>', [(0, 10, 30, 10)]),
        ('<symbol id="y" style="overflow:visible"><path d="M-9 3h30"/></symbol><use href="#y"/>',
         [(-9, 3, 21, 3)]),
    ],
)  # fmt: skip
def test_curves_are_cut_at_clip_paths(body, left):
    assert np.allclose(ends(body.replace(" {}", "")), left, atol=2e-3)


def test_pictures_of_clipped_drawings_agree_with_another_renderer():
    body = """<clipPath id="a"><circle cx="40" cy="45" r="30"/><path clip-rule="evenodd"
    d="M50 50l40 -10 5 50 -60 -30 60 -5z"/></clipPath>
    <clipPath id="b" transform="rotate(20)" clip-path="url(#a)"><rect x="10" width="70" height="60"
    rx="9"/></clipPath><clipPath id="d" clipPathUnits="objectBoundingBox"><ellipse cx=".5" cy=".5"
    rx=".4" ry=".5"/></clipPath><g fill="none" stroke="black" stroke-width=".6">
    <g clip-path="url(#b)" transform="skewX(-9)">{}</g>
    <g clip-path="url(#d)"><g transform="translate(55 5) scale(.4)">{}</g></g></g>"""
    waves = "".join(
        f'<path d="M0 {y}q10 {30 - y / 3} 20 0t20 0 20 3 20 0 20 9"/>' for y in range(2, 99, 8)
    )
    svg = (HEAD + body + "</svg>").format(waves, waves)
    svg = svg.replace("<svg ", '<svg width="500" height="500" ')
    theirs = np.asarray(Image.open(io.BytesIO(png_from_svg(svg))).convert("L"), float)
    curves = read_curves_svg(svg.encode(), (500, 500), 0.05)
    picture = png_from_svg(plain_svg(curves, (500, 500)))
    ours = np.asarray(Image.open(io.BytesIO(picture)).convert("L"), float)
    from scipy.ndimage import distance_transform_edt

    # within half of their strokes' thickness, of 3 px
    assert (ours < 200).sum() > 5_000
    assert distance_transform_edt(theirs > 150)[ours < 100].max() < 2.5
    assert distance_transform_edt(ours > 150)[theirs < 100].max() < 3


def square(low, high):
    rings = np.array([[low, low], [high, low], [high, high], [low, high]], float)
    return Region((ClipShape(rings, np.array([0, 4])),))


def test_what_is_left_adds_up_to_what_lies_inside():
    rng = np.random.default_rng(3)
    lines = [rng.uniform(0, 10, (40, 2)) for _ in range(20)]
    lines[0][-1] = lines[0][0]
    region = square(2.0, 7.0)
    xy, offsets = np.concatenate(lines), np.cumsum([0, *map(len, lines)])
    got, ends, whose = cut_lines(xy, offsets, [(region,)] * 19 + [()])
    assert (got[ends[-2] :] == lines[19]).all() and (np.diff(whose) >= 0).all()
    for i, line in enumerate(lines[:19]):
        step = np.diff(line, axis=0)[:, None] / 2000
        fine = line[:-1, None] + (np.arange(2000) + 0.5)[:, None] * step
        inside, about = (((fine > 2 - d) & (fine < 7 + d)).all(axis=2) for d in (0, 2 * NEAR))
        long = np.hypot(step[..., 0], step[..., 1])
        mine = [got[ends[k] : ends[k + 1]] for k in np.flatnonzero(whose == i)]
        total = sum(np.hypot(*np.diff(piece, axis=0).T).sum() for piece in mine)
        assert (inside * long).sum() - 0.05 < total < (about * long).sum() + 0.05
        assert all(((p > 2 - 2 * NEAR) & (p < 7 + 2 * NEAR)).all() for p in mine)
    # closed: where it begins inside, it is not cut there
    loop = np.array([[3.0, 3], [9, 3], [9, 4], [3, 4], [3, 3]])
    got, ends, _ = cut_lines(loop, np.array([0, 5]), [(region,)])
    assert got == pytest.approx(np.array([[7, 4], [3, 4], [3, 3], [7, 3]]))
    assert ends.tolist() == [0, 4]
    same, ends, _ = cut_lines(loop, np.array([0, 5]), [(square(0.0, 10.0), square(-5.0, 20.0))])
    assert (same == loop).all()


@pytest.mark.parametrize(
    "body",
    [
        '<clipPath id="c" clip-path="url(#c)"><rect/></clipPath>'
        '<path clip-path="url(#c)" d="M0 0h9"/>',
        '<clipPath id="c"><rect clip-path="url(#c)" width="9" height="9"/></clipPath>'
        '<path clip-path="url(#c)" d="M0 0h9"/>',
    ],
)
def test_clip_paths_of_themselves_are_refused(body):
    with pytest.raises(ValueError, match='<clipPath id="c">: it clips itself: take it out$'):
        read(body)


def test_bombs_are_refused(monkeypatch):
    waves = "M0 0" + "l9 99 1 -99" * 60
    body = f'<clipPath id="c"><path d="{waves}"/></clipPath>'
    body += '<path clip-path="url(#c)" d="M0 50' + "h3000v.1h-3000v.1" * 60 + '"/>'
    with monkeypatch.context() as patch:
        patch.setattr(clip, "MAX_PAIRS", 10_000)
        with pytest.raises(ValueError, match="its clip paths are too intricate"):
            read(body)
    with monkeypatch.context() as patch:
        patch.setattr(files, "MAX_CURVES", 1_000)
        with pytest.raises(ValueError, match="once cut at clip paths: simplify"):
            read(body)
    with monkeypatch.context() as patch:
        patch.setattr(files, "MAX_POINTS", 500)
        each = '<g transform="translate({})"><path clip-path="url(#c)" d="M0 0h9"/></g>'
        many = f'<clipPath id="c"><path d="{waves}"/></clipPath>' + each * 9
        with pytest.raises(ValueError, match="more than 500 points of clip paths"):
            read(many.format(*range(9)))
    deep = "".join(
        f'<clipPath id="c{k}" clip-path="url(#c{k + 1})"><rect/></clipPath>' for k in range(99)
    )
    with pytest.raises(ValueError, match="more than 30 in one another"):
        read(deep + '<path clip-path="url(#c0)" d="M0 0h9"/>')
    nothing = '<clipPath id="c"/><path clip-path="url(#c)" d="M0 0h9"/>'
    with pytest.raises(ValueError, match="no usable curve in it: its clip paths leave none"):
        read_curves_svg((HEAD + nothing + "</svg>").encode(), (100, 100), 0.1)
