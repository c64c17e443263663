"""PowerStrokes: skeletons and half widths of which Inkscape draws what we do, or a hand edits."""

import io
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.geometry.bezier import flatten
from strokestyle.svg.format import SvgOptions
from strokestyle.svg.path_data import parse_path
from strokestyle.svg.power_stroke import power_strokes
from strokestyle.svg.read import read_svg, read_svg_file
from strokestyle.svg.write import png_from_svg, write_svg

SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
MOVE = 16  # px
SIZE = (400, 320)


def line(*corners, step=3.0):
    """A polyline through corners, its points `step` px apart."""
    parts = [np.array(corners[:1], float)]
    for a, b in zip(corners[:-1], corners[1:], strict=True):
        count = max(int(np.hypot(b[0] - a[0], b[1] - a[1]) / step), 1)
        parts.append(np.linspace(a, b, count + 1)[1:])
    return np.concatenate(parts)


def circle(x, y, radius, begin=0.0, end=2 * np.pi, count=40):
    angle = np.linspace(begin, end, count)
    return np.array([x, y]) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def zoo():
    """Lines, their widths, and whether they are closed, by name."""
    t = np.linspace(0, 2 * np.pi, 80)
    rng = np.random.default_rng(3)
    bumpy = line((20, 300), (200, 300), step=1.5)
    bumpy[:, 1] += rng.normal(0, 0.6, len(bumpy))
    turns = {f"corner {turn}": turn for turn in (10, 60, 90, 120, 150, 170, 180)}
    made = {
        name: (line((20 + 50 * k, 20), (20 + 50 * k, 50), _turned(20 + 50 * k, turn)), 8, False)
        for k, (name, turn) in enumerate(turns.items())
    }
    return made | {
        "circle": (circle(40, 120, 25), 6, True),
        "swelling circle": (circle(110, 120, 25), 3 + 2 * np.sin(t[::2]), True),
        "corner where it closes": (line((160, 100), (200, 100), (180, 140), (160, 100)), 6, True),
        "eight": (np.stack([250 + 30 * np.sin(t), 120 + 25 * np.sin(2 * t)], axis=1), 6, True),
        "spiral": (
            np.stack([330 + 4 * t * np.cos(3 * t), 120 + 4 * t * np.sin(3 * t)], axis=1), 5, False),
        "fork back": (np.array([[370, 60], [385, 60], [370, 60]]), 6, True),
        "dot": (np.array([[20, 180], [20, 180]]), 10, False),
        "tiny dot": (np.array([[40, 180], [40, 180]]), 1, False),
        "short": (np.array([[60, 180], [61, 180]]), 4, False),
        "no width": (line((80, 180), (110, 180)), 0, False),
        "tapered": (line((120, 180), (190, 180)), np.linspace(0, 8, 24), False),
        "pinched": (line((200, 180), (260, 190)), 8 * np.abs(np.cos(t[:21] * 2)), False),
        "swallowed ends": (np.array([[285, 180], [289, 180], [293, 180]]), [2, 16, 3], False),
        "step": (line((310, 180), (380, 180)), np.repeat([2, 10], [12, 12]), False),
        "hairpin": (_hairpin(20, 220, 3), 10, False),
        "wide hairpin": (_hairpin(70, 220, 9), 10, False),
        "hair": (line((120, 220), (140, 220), (140, 250)), 0.6, False),
        "zigzag": (line(*[(170 + 6 * k, 230 + 9 * (-1) ** k) for k in range(16)]), 5, False),
        "loop": (np.concatenate([circle(300, 240, 12, -3, 3), [(330, 225), (350, 225)]]), 7, False),
        "ring without a hole": (circle(375, 290, 2, count=12), 20, True),
        "bumpy": (bumpy, 4 + np.clip(rng.normal(0, 0.7, len(bumpy)), -2, 2), False),
    }  # fmt: skip


def _turned(x, turn):
    return x + 30 * np.sin(np.radians(turn)), 50 + 30 * np.cos(np.radians(turn))


def _hairpin(x, y, radius):
    bend = circle(x + radius, y + 30, radius, np.pi, 0, 16)
    ends = line((x, y), (x, y + 30)), line((x + 2 * radius, y + 30), (x + 2 * radius, y))
    return np.concatenate([ends[0], bend[1:-1], ends[1]])


def drawn(strokes):
    """A drawing of lines, widths and whether they are closed."""
    xy, width, closed = zip(*strokes, strict=True)
    offsets = np.cumsum([0] + [len(points) for points in xy])
    widths = [np.broadcast_to(w, len(points)) for w, points in zip(width, xy, strict=True)]
    count = len(xy)
    lines = Strokes(np.concatenate(xy), np.concatenate(widths), offsets, np.zeros(count), closed)
    return Drawing(lines, SIZE, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))


def only(xy, width, closed=False):
    """One stroke's PowerStroke: its skeleton's cubics (K, 4, 2), and t and half widths (n, 2)."""
    made = power_strokes(drawn([(np.asarray(xy, float), width, closed)]).strokes, SvgOptions(), [0])
    pairs = np.array([pair.split(",") for pair in made[0].offset_points.split(" | ")], float)
    cubics = np.array(parse_path(made[0].d)[0]).reshape(-1, 4, 2)
    return cubics[np.ptp(cubics, axis=1).max(axis=1) > 1e-6], pairs  # without what z adds


def test_straight_pieces_are_lines():
    nearly = line((20, 20), (200, 80))
    nearly += np.random.default_rng(1).normal(0, 0.01, nearly.shape)
    made = power_strokes(drawn([(nearly, 4, False)]).strokes, SvgOptions(), [0])[0]
    assert set(re.findall("[a-zA-Z]", made.d)) == {"M", "l"}
    bent = power_strokes(drawn([(circle(60, 60, 30), 4, True)]).strokes, SvgOptions(), [0])[0]
    assert set(re.findall("[a-z]", bent.d)) == {"c", "z"}


def test_every_node_has_a_width():
    for xy, width, closed in zoo().values():
        cubics, pairs = only(xy, width, closed)
        t, ring = pairs[:, 0], closed and len(xy) > 3
        assert set(range(len(cubics) + (not ring))) <= set(t.tolist())
        between = t[t % 1 > 0]
        assert (np.abs(between - np.rint(between)) > 0.009).all() and (np.diff(t) > 0).all()


def test_a_skeleton_has_a_length_and_no_sharper_turn_than_a_right_angle():
    for xy, width, closed in zoo().values():
        cubics, _ = only(xy, width, closed)
        xy, _ = flatten(cubics, np.array([0, len(cubics)]), 0.01)
        assert np.hypot(*np.diff(xy, axis=0).T).sum() >= 0.019
    back, _ = only([(0, 0), (10, 0), (0, 0)], 4)
    step = np.diff(np.concatenate([back[:, 0], back[-1:, 3]]), axis=0)
    assert np.allclose(step, [(10, 0), (0, 0), (-10, 0)], atol=0.05) and step[1].any()


def test_sides_are_those_of_discs():
    cubics, pairs = only([(0, 0), (28, 0), (32, 0), (60, 0)], [4, 4, 11, 11])  # 7/8 px a px
    x = np.interp(pairs[:, 0], np.arange(len(cubics) + 1), np.r_[cubics[:, 0, 0], cubics[-1, 3, 0]])
    at = np.linspace(0, 60, 500)
    disc = np.linspace(0, 60, 2000)
    radius = np.interp(disc, [28, 32], [2, 5.5])
    want = np.sqrt(np.maximum(radius**2 - (at[:, None] - disc) ** 2, 0).max(axis=1))
    assert np.abs(np.interp(at, x, pairs[:, 1]) - want).max() < 0.1


def inkscape(source, actions):
    """Run Inkscape's actions on a file, or skip."""
    if not shutil.which("inkscape"):
        pytest.skip("no program: inkscape is not installed")
    command = ["inkscape", "--batch-process", f"--actions={actions}", source]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    if done.returncode:
        pytest.skip("no program: inkscape does not run")
    return done.stderr


def test_inkscape_draws_the_same_of_strokes_that_are_moved(tmp_path):
    names, strokes = zip(*zoo().items(), strict=True)
    drawing = drawn(strokes)
    ids = [name.replace(" ", "-") for name in names]
    text = write_svg(drawing, inkscape_lpe=True, ids=ids)
    (tmp_path / "a.svg").write_text(text)
    move = f"select-all;transform-translate:{MOVE},0;export-filename:{tmp_path / 'b.svg'};export-do"
    said = inkscape(tmp_path / "a.svg", move)
    assert "xception" not in said
    moved = {e.get("id"): e for e in ET.parse(tmp_path / "b.svg").iter(f"{SVG}path")}
    wrong = []
    for element in ET.fromstring(text).iter(f"{SVG}path"):
        name, ours = element.get("id"), ink(element.get("d"), 0)
        theirs = ink(moved[name].get("d"), -MOVE)
        if np.abs(theirs - ours).sum() > 0.06 * ours.sum() + 3 * 255:
            wrong.append(name)
    assert not wrong


def ink(d, shift):
    """How dark the pixels are of path data, moved by `shift` px along x."""
    path = f'<path fill-rule="nonzero" transform="translate({shift})" d="{d}"/>'
    width, height = SIZE
    size = f'width="{width}" height="{height}"'
    png = png_from_svg(f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{path}</svg>')
    return 255.0 - np.asarray(Image.open(io.BytesIO(png)).convert("L"))


def test_widths_that_a_hand_edited_are_read():
    ring, open_line = zoo()["circle"], zoo()["tapered"]
    drawing = drawn([open_line, ring])
    text = write_svg(drawing, inkscape_lpe=True, ids=["a", "b"])
    assert read_svg(text).strokes.thickness[:2] == pytest.approx([0, 8])

    def thicker(match):  # each half width 1 px more, as Inkscape writes numbers
        pairs = [pair.split(",") for pair in match[1].split(" | ")]
        return 'offset_points="' + " | ".join(f"{t},{float(w) + 1:.9g}" for t, w in pairs) + '"'

    edited = read_svg_file(re.sub('offset_points="([^"]*)"', thicker, text))
    strokes = edited.drawing.strokes
    rows = strokes.rows(0)
    along = strokes.xy[rows][:, 0]
    want = np.interp(along, open_line[0][:, 0], open_line[1]) + 2
    assert np.abs(strokes.thickness[rows] - want).max() < 0.25
    assert strokes.thickness[strokes.rows(1)] == pytest.approx(8, abs=0.02) and strokes.closed[1]
    again = write_svg(edited.drawing, edited.options, kept=edited.kept)
    grown = read_svg(again).strokes
    assert np.allclose(grown.thickness[grown.rows(1)], 8, atol=0.05)


def test_power_strokes_of_older_versions_are_drawn_anew():
    text = write_svg(drawn([zoo()["corner 90"]]), inkscape_lpe=True)
    older = re.sub(' data-ss-swell="[^"]*"', "", text)
    older = re.sub('offset_points="[^"]*"', 'offset_points="0,4"', older)
    file = read_svg_file(older)
    again = write_svg(file.drawing, file.options, kept=file.kept)
    assert 'offset_points="0,4 | ' in again and "data-ss-swell" in again


def test_a_skeleton_that_a_hand_edited_is_read():
    drawing = drawn([(line((20, 20), (80, 20)), 6, False)])
    text = write_svg(drawing, inkscape_lpe=True)
    bent = re.sub('original-d="[^"]*"', 'original-d="M20 20c20 0 40 20 60 60"', text)
    strokes = read_svg(bent).strokes
    assert strokes.xy[-1] == pytest.approx([80, 80]) and strokes.thickness == pytest.approx(6.0)


def test_what_inkscape_moved_turned_and_scaled_is_read(tmp_path):
    drawing = drawn([zoo()["tapered"], zoo()["circle"]])
    (tmp_path / "a.svg").write_text(write_svg(drawing, inkscape_lpe=True))
    act = "select-all;transform-translate:20,10;transform-rotate:30;transform-scale:20"
    inkscape(tmp_path / "a.svg", f"{act};export-filename:{tmp_path / 'b.svg'};export-do")
    was, now = drawing.strokes, read_svg(tmp_path / "b.svg").strokes
    ratio = [np.ptp(s.xy[s.rows(1)], axis=0).mean() for s in (now, was)]
    scale = ratio[0] / ratio[1]
    assert scale > 1.05
    for i in (0, 1):
        most = [s.thickness[s.rows(i)].max() for s in (now, was)]
        assert most[0] == pytest.approx(scale * most[1], rel=0.02)
