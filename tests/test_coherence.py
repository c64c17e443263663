"""The measuring rule of experiments/coherence.py, on frames of which the answers are known: the
edges of a block, each one stroke with grain that lies still on it."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapes import sphere
from solids import box

from strokestyle.drawing.ribbon import ribbon
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.pipeline import extract_view
from strokestyle.geometry.curves import KINDS
from strokestyle.mesh.surface import make_surface

SIZE, FRAMES = 256, 7
# corners of the block as box() numbers them; the nine edges that are seen from the right above
EDGES = [(2, 6), (3, 7), (1, 5), (2, 3), (6, 7), (1, 3), (5, 7), (4, 6), (4, 5)]


@pytest.fixture(scope="module")
def rule():
    path = Path(__file__).parent.parent / "experiments" / "coherence.py"
    spec = importlib.util.spec_from_file_location("coherence", path)
    sys.modules["coherence"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def block():
    solid = box(high=(1.0, 0.8, 0.9))
    return make_surface(solid.vertices, solid.faces, polygon=solid.polygon)


@pytest.fixture(scope="module")
def scene(rule, block):
    camera = fit_camera(block.vertices, "40,25", width=SIZE, height=SIZE)
    return rule.Scene(lambda t: (block, camera.turned(1.5 * t)), FRAMES, False)


@pytest.fixture(scope="module")
def frames(scene, block):
    return [frame_of(block, scene.shots(t)[1]) for t in range(FRAMES)]


def grain(i, place):
    """Opacity of edge i's grain at places px along it, whatever the picture."""
    knots = np.random.default_rng(i).uniform(0.2, 1.0, 400)
    return np.interp(place / 4.0 + 30, np.arange(400), knots)


def frame_of(block, camera, slide=0.0):
    ends = camera.project(block.vertices)[0]
    lines = [np.linspace(ends[a], ends[b], 25) for a, b in EDGES]
    return drawing_of(lines, [np.linspace(0, 100, 300) + slide] * len(EDGES))


def drawing_of(lines, places):
    """Strokes 3 px thick whose grain runs from places[i][0] to places[i][-1] between their ends."""
    count = len(lines)
    offsets = np.cumsum([0, *map(len, lines)])
    xy = np.concatenate(lines)
    kind = np.full(count, KINDS.index("crease"))
    strokes = Strokes(xy, np.full(len(xy), 3.0), offsets, kind, np.zeros(count, bool))
    strips = []
    for i in range(count):
        band = ribbon(strokes, i, 1.0)
        row = (np.arange(300) + 0.5) / 300 * band.length - band.half[0]
        inside = band.length - 2 * band.half[0]
        place = places[i][0] + row / inside * (places[i][-1] - places[i][0])
        strip = np.zeros((300, 4, 4), np.uint8)
        strip[..., 3] = np.rint(255 * grain(i, place))[:, None]
        strips.append(strip)
    texture = Texture(np.concatenate(strips), 300 * np.arange(count + 1), np.array(1.0))
    return Drawing(strokes, (SIZE, SIZE), np.tile([0.0, 0, 0, 1], (count, 1)), texture)


def lines_of(drawing):
    return [drawing.strokes.xy[drawing.strokes.rows(i)] for i in range(len(drawing.strokes))]


def changed(frames, change, at=3):
    lines = lines_of(frames[at])
    change(lines)
    return [*frames[:at], drawing_of(lines, [np.linspace(0, 100, 300)] * 99), *frames[at + 1 :]]


def counted(rule, scene, frames):
    found = [event[0] for event in rule.measure(frames, scene)["events"]]
    return {name: found.count(name) for name in found}


def test_of_strokes_that_stay_on_their_lines_nothing_is_lost(rule, scene, frames):
    report = rule.measure(frames, scene)
    assert report["events"] == []
    assert report["lost"] == report["split"] == report["begin"] == report["length"] == 0
    assert report["persist_any"]["crease"] > 0.99
    assert report["jitter"] < 0.3
    assert report["known"] > 0.9 and report["swim"] < 0.3 and report["stretch"] < 0.05


@pytest.mark.parametrize(
    "change, events",
    [
        (lambda lines: lines.pop(6), {"lost": 1, "gone": 1, "born": 1}),
        (lambda lines: lines.append(split_off(lines, 4)), {"split": 1, "begin": 1}),
        (lambda lines: lines.__setitem__(4, lines[4][::-1]), {"begin": 2}),
        (
            lambda lines: lines.__setitem__(4, lines[4][: len(lines[4]) * 2 // 5]),
            {"lost": 1, "length": 1},
        ),
    ],
    ids=["left out", "in two", "the other way round", "cut short"],
)
def test_one_stroke_that_is_drawn_otherwise_in_one_frame_is_found(
    rule, scene, frames, change, events
):
    found = counted(rule, scene, changed(frames, change))
    assert {name: found.get(name, 0) for name in events} == events


def split_off(lines, i):
    """Cut line i a little before its middle, and give what is left of it."""
    cut = len(lines[i]) * 3 // 5
    rest, lines[i] = lines[i][cut:], lines[i][: cut + 1]
    return rest


def test_strokes_that_shift_by_known_steps_jitter_by_that(rule, scene, frames):
    shifted = [
        replace(f, strokes=replace(f.strokes, xy=f.strokes.xy + [0, 2.0 * (k % 2)]))
        for k, f in enumerate(frames)
    ]
    level = 0.9  # of most edges: they are seen aslant
    assert 2.0 * level / 2 < rule.measure(shifted, scene)["jitter"] < 2.0


def test_grain_that_slides_by_a_known_step_swims_by_that(rule, scene, block):
    # 100 places on a stroke of about as many px: each frame the grain moves on by 3 of them
    frames = [frame_of(block, scene.shots(t)[1], 3.0 * t) for t in range(FRAMES)]
    scale = np.mean([np.hypot(*(line[-1] - line[0])) for f in frames for line in lines_of(f)]) / 100
    assert rule.measure(frames, scene)["swim"] == pytest.approx(3.0 * scale, rel=0.15)


def test_a_track_that_is_absent_for_a_frame_or_lies_elsewhere_is_found(rule, scene, frames):
    tracks = [np.arange(9) for _ in frames]
    tracks[2] = np.array([0, 1, 2, 3, 4, 5, 6, 7, 99])  # 8 is missing once, and called otherwise
    tracks[4] = np.array([1, 0, *range(2, 9)])  # 0 and 1 change places, there and back
    marks = [rule.put_on_lines(f, scene, t) for t, f in enumerate(frames)]
    marks = [replace(m, track=track) for m, track in zip(marks, tracks, strict=True)]
    links = []
    for t in range(FRAMES - 1):
        one, two = marks[t], marks[t + 1]
        on = rule.link(one, two, *rule.carried(one, scene, t, t + 1))
        links.append((on, rule.link(two, one, *rule.carried(two, scene, t + 1, t))))
    events = []
    report = rule.of_tracks(marks, links, False, events)
    names = [event[0] for event in events]
    assert names.count("missing") == 1 and names.count("moved") == 4 and names.count("renamed") == 2
    assert report["tracks"] == 10


def test_lines_that_stills_draw_and_an_animation_does_not_are_told_by_their_length(
    rule, scene, frames
):
    fewer = changed(frames, lambda lines: lines.pop(6), at=0)[:1]
    lengths = [np.hypot(*(line[-1] - line[0])) for line in lines_of(frames[0])]
    found = rule.beside(fewer, frames[:1], scene)
    away = lengths[6] / sum(lengths)
    assert found["length"] == pytest.approx(1 - away, abs=0.01)
    assert found["drawn"] == pytest.approx(1 - away, abs=0.02) and found["extra"] == 0
    found = rule.beside(frames[:1], fewer, scene)
    assert found["extra"] == pytest.approx(away, abs=0.02) and found["drawn"] == 1


def outline_of(surface, camera, begins):
    """An egg's outline as one stroke that begins where it reaches farthest towards `begins`."""
    xy = extract_view(surface, camera).curves.xy[:-1]
    first = int((xy @ begins).argmax())
    xy = np.concatenate([xy[first:], xy[: first + 1]])
    strokes = Strokes(xy, np.full(len(xy), 3.0), np.array([0, len(xy)]), np.zeros(1), np.ones(1))
    return Drawing(strokes, (SIZE, SIZE), np.array([[0.0, 0, 0, 1]]))


def test_an_outline_that_moves_over_the_surface_is_followed(rule):
    ball = sphere()
    egg = make_surface(ball.vertices * [1.0, 1.3, 0.7], ball.faces)
    camera = fit_camera(egg.vertices, "20,10", width=SIZE, height=SIZE)
    scene = rule.Scene(lambda t: (egg, camera.turned(10.0 * t)), 4, False)
    up, down = np.array([0.0, -1.0]), np.array([0.0, 1.0])
    frames = [outline_of(egg, scene.shots(t)[1], up) for t in range(4)]
    report = rule.measure(frames, scene)
    assert report["events"] == [] and report["persist"]["contour"] == 1
    frames[2] = outline_of(egg, scene.shots(2)[1], down)
    assert [event[0] for event in rule.measure(frames, scene)["events"]] == ["begin", "begin"]
