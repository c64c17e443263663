"""Animations at the command line: what moves, in which order, and what is written of it."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from command import refused, run
from PIL import Image, ImageSequence
from shapes import obj_text, sphere, torus
from small_styles import plain_style

from strokestyle.cli.animation import common_name, in_order, natural_key, plan_animation
from strokestyle.cli.shape import Shape
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.view_file import save_view
from strokestyle.render.style_file import load_style, save_style
from strokestyle.svg.read import read_svg
from strokestyle.svg.write import write_svg

SIZE = ("--size", "64")


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """A model m.pt, a ring ring.obj, and walk/w1.obj ... w12.obj: a ball, ever taller."""
    folder = tmp_path_factory.mktemp("studio")
    save_style(folder / "m.pt", plain_style(64))
    ring = torus(around=24, across=10)
    (folder / "ring.obj").write_text(obj_text({"": ring}))
    (folder / "walk").mkdir()
    ball = sphere(2)
    for i in range(1, 13):
        taller = ball.__class__(ball.vertices * [1, 1 + 0.1 * i, 1], ball.faces)
        (folder / "walk" / f"w{i}.obj").write_text(obj_text({"": taller}))
    return folder


def draw(studio, *args, shape="ring.obj"):
    shapes = [shape] if isinstance(shape, str) else shape
    result = run("render", studio / "m.pt", *[studio / s for s in shapes], *SIZE, *args)
    assert result.exit_code == 0, result.stderr
    return result


def wrong(studio, *args, shape="ring.obj", words=(), code=2):
    shapes = [shape] if isinstance(shape, str) else shape
    return refused(
        "render", studio / "m.pt", *[studio / s for s in shapes], *SIZE, *args,
        words=words, code=code,
    )  # fmt: skip


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def times(path):
    with Image.open(path) as film:
        return [frame.convert("RGB") and frame.info["duration"] for frame in
                ImageSequence.Iterator(film)]  # fmt: skip


# ---------------------------------------------------------------------------------------- outputs


def test_frames_and_films_of_one_turn(studio, tmp_path):
    films = ("a.gif", "a.png", "a.webp", "a.html")
    outputs = [x for film in films for x in ("-o", tmp_path / film)]
    turn = ("--turntable", "5", "--still", "--png")
    result = draw(studio, *turn, "-o", tmp_path / "spin/", *outputs)
    frames = [f"ring-{i:03d}" for i in range(5)]
    assert names(tmp_path / "spin") == sorted(
        f + suffix for f in frames for suffix in (".png", ".svg")
    )
    assert names(tmp_path) == sorted([*films, "spin"])
    assert "ring.obj: 5 frames" in result.stderr and "a.html" in result.stderr
    for film, unit in (("a.gif", 10), ("a.webp", 1), ("a.png", 1e-3)):
        found = times(tmp_path / film)
        assert len(found) == 5 and sum(found) == pytest.approx(5000 / 12, abs=unit / 2)
    with Image.open(tmp_path / "a.png") as film:
        assert film.size == (64, 64) and film.info["loop"] == 0
        film.seek(3)
        shown = np.asarray(film.convert("RGB")).astype(int)
    still = np.asarray(Image.open(tmp_path / "spin" / "ring-003.png").convert("RGB"))
    assert np.array_equal(shown, still)


def test_strokes_are_named_in_all_frames_unless_still(studio, tmp_path):
    draw(studio, "--turntable", "3", "-o", tmp_path / "a.svg")
    draw(studio, "--turntable", "3", "-o", tmp_path / "b.svg", "--still")
    assert names(tmp_path) == [f"{n}-{i:03d}.svg" for n in "ab" for i in range(3)]
    tracks = [
        set(re.findall(r'data-ss-track="([^"]+)"', (tmp_path / f"a-{i:03d}.svg").read_text()))
        for i in range(3)
    ]
    assert tracks[0] & tracks[1] & tracks[2]
    assert "data-ss-track" not in (tmp_path / "b-001.svg").read_text()


def test_still_frames_are_the_styles_drawings_of_the_turns_views(studio, tmp_path):
    draw(studio, "--turntable", "3", "-o", tmp_path / "t.svg", "--still", "--seed", "5")
    options = {"turntable": 3, "size": (64, 64)}
    style = load_style(studio / "m.pt")
    views = Shape(str(studio / "ring.obj"), options).views()
    about = {"title": "ring", "description": f"Drawn by strokestyle {_version()}"}
    for i, view in enumerate(views):
        text = write_svg(style.draw(view, seed=5), **about)
        assert (tmp_path / f"t-{i:03d}.svg").read_text() == text


def _version():
    from strokestyle import __version__

    return __version__


def test_on_twos_each_drawing_is_held(studio, tmp_path):
    draw(studio, "--turntable", "5", "--on-twos", "-o", tmp_path / "f/", "-o", tmp_path / "a.gif",
         "-o", tmp_path / "a.html")  # fmt: skip
    texts = [(tmp_path / "f" / f"ring-{i:03d}.svg").read_bytes() for i in range(5)]
    assert texts[0] == texts[1] != texts[2] == texts[3] != texts[4]
    assert times(tmp_path / "a.gif") == [170, 160, 90]
    data = json.loads(re.search(r'id="data">(.*?)</script>', (tmp_path / "a.html").read_text())[1])
    assert data["held"] == [2, 2, 1] and len(data["frames"]) == 3 and data["fps"] == 12


def test_scale_rate_and_background_of_films(studio, tmp_path):
    common = ("--turntable", "2", "--still", "--fps", "25", "--png-scale", "1.5")
    draw(studio, *common, "-o", tmp_path / "a.webp", "-o", tmp_path / "a.gif", "--background",
         "#ffeecc")  # fmt: skip
    for film in ("a.webp", "a.gif"):
        with Image.open(tmp_path / film) as image:
            assert image.size == (96, 96) and image.convert("RGB").getpixel((1, 1)) == (
                255, 238, 204,
            )  # fmt: skip
    assert times(tmp_path / "a.gif") == [40, 40]
    draw(
        studio, *common, "-o", tmp_path / "b.png", "-o", tmp_path / "b.svg", "--background", "none"
    )
    with Image.open(tmp_path / "b.png") as image:
        assert image.convert("RGBA").getpixel((1, 1))[3] == 0
    assert 'id="paper"' not in (tmp_path / "b-000.svg").read_text()
    draw(studio, "-o", tmp_path / "c.svg", "--background", "none")
    assert 'id="paper"' not in (tmp_path / "c.svg").read_text()


@pytest.mark.parametrize(
    "args, words",
    [
        (["-o", "a.gif"], ["a.gif: a film has several frames: give --turntable N", ".pdf"]),
        (["-o", "a.svg", "-o", "b/"], ["b/: several -o are files of one drawing"]),
        (["-o", "a.svg", "-o", "a.svg"], ["a.svg is given twice"]),
        (["-o", "a.svg", "-o", "-"], ["standard output takes one SVG"]),
        (["-o", "a.svg", "--format", "pdf"], ["-o FOLDER/"]),
        (["-o", "b/", "--turntable", "2", "--format", "png"], ["--png writes PNGs beside"]),
        (["-o", "a.png", "--dpi", "300", "--png-scale", "2"], ["give one"]),
        (["-o", "a.svg", "--fps", "12"], ["--fps: of an animation: give --turntable N"]),
        (["-o", "a.svg", "--still", "--on-twos"], ["--still, --on-twos: of an animation"]),
        (["-o", "a.svg", "-o", "b/", "--turntable", "2"], ["frames go to one place"]),
        (["-o", "a.gif", "-o", "a.gif", "--turntable", "2"], ["a.gif is given twice"]),
        (["-o", "a.gif", "-o", "b/../a.gif", "--turntable", "2"], ["b/../a.gif is given twice"]),
        (["-o", "a.gif", "--turntable", "2", "--fps", "nan"], ["--fps", "nan is not a number"]),
        (["-o", "a.gif", "--turntable", "2", "--boil", "nan"], ["--boil", "nan is not a number"]),
        (["-o", "-", "--turntable", "2"], ["standard output takes one SVG"]),
        (["-o", "a.bmp", "--turntable", "2"], ["a.bmp: drawings are .svg"]),
        (["--turntable", "2"], ["nothing to write"]),
        (["-o", "a.gif", "--path", "c.json", "--view", "side"], ["leave out --view"]),
        (["-o", "a.gif", "--path", "c.json", "--turntable", "3"], ["leave out --turntable"]),
        (["-o", "a.gif", "--turntable", "2", "--still", "--boil", "1"], ["--boil", "--still"]),
        (["-o", "a.gif", "--sequence", "--section", "x:50%"], ["--section", "--still"]),
        (["-o", "a.gif", "--turntable", "2", "--curves", "c.svg"], ["--turntable needs", "curves"]),
        (["-o", "s/", "--path", "c.json", "--stages", "s"], ["--stages goes with --turntable"]),
        (["-o", "a.gif", "--turntable", "2", "--boil", "2"], ["--boil"]),
    ],
)
def test_what_does_not_go_together_is_a_usage_error(studio, tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    if "--path" in args:  # it says where the eye stands, and how large the canvas is
        refused("render", studio / "m.pt", studio / "ring.obj", *args, words=words, code=2)
    else:
        wrong(studio, *args, words=words)
    assert not [p for p in tmp_path.iterdir() if p.is_file()]


def test_what_cannot_be_written_is_said_before_anything_is_drawn(studio, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    turn = ("--turntable", "3", "-o", "f/")
    wrong(studio, *turn, "-o", "a.mp4", words=["a.mp4: MP4 needs ffmpeg"], code=1)
    wrong(studio, *turn, "-o", "a.gif", "--fps", "60", words=["a.gif: a GIF shows at most"])
    wrong(studio, *turn, "-o", "no/a.gif", words=["no/a.gif: there is no folder no"], code=1)
    wrong(studio, *turn, "-o", "a.gif", shape=["ring.obj", "walk/w1.obj"],
          words=["a film is of one shape, not of 2", "--sequence"])  # fmt: skip
    wrong(studio, *turn, "-o", "n" * 300 + ".gif", words=["name too long"], code=1)
    assert not list(tmp_path.iterdir())
    twos = ("--fps", "60", "--on-twos", "--still")  # 30 drawings a second
    draw(studio, *turn, "-o", "f/a.gif", *twos)  # into the frames' folder, which is made


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no folder that root cannot write to")
def test_a_place_that_takes_no_file_is_said_before_anything_is_drawn(tmp_path):
    for output in ("/proc/a.gif", "/proc/a.svg"):
        refused("render", tmp_path / "m.pt", tmp_path / "no.obj", "--turntable", "2", "-o", output,
                words=[f"{output}: no file can be made there"], code=1)  # fmt: skip


@pytest.mark.parametrize(
    "outputs", [["F-001.png", "F.svg", "--png"], ["f/ring-000.png", "f/", "--png"]]
)
def test_a_film_is_not_where_a_preview_goes(studio, tmp_path, monkeypatch, outputs):
    monkeypatch.chdir(tmp_path)
    film, frames, png = outputs
    wrong(studio, "--turntable", "2", "-o", film, "-o", frames, png,
          words=[f"-o {film} is also where a frame goes"])  # fmt: skip


def test_a_video_is_not_transparent_and_that_is_said(studio, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("strokestyle.film.films.check_encoder", lambda suffix: None)
    films, options = [tmp_path / "a.mp4"], {"turntable": 2, "background": "none"}
    plan_animation([str(studio / "ring.obj")], None, films, False, options)
    assert "a.mp4: a video has no transparency" in capsys.readouterr().err


def test_several_shapes_turn_into_a_folder(studio, tmp_path):
    shapes = [str(studio / "ring.obj"), str(studio / "walk" / "w1.obj")]
    jobs, sequence = plan_animation(shapes, f"{tmp_path}/f/", [], False, {"turntable": 2})
    assert [(job.shape, job.output) for job in jobs] == [
        (shapes[0], f"{tmp_path}/f/ring.svg"), (shapes[1], f"{tmp_path}/f/w1.svg"),
    ]  # fmt: skip
    assert sequence == ()


# ------------------------------------------------------------------------------------- what moves


def heights(folder, count, name="w"):
    """How tall each frame's drawing is, px."""
    found = []
    for i in range(count):
        xy = read_svg(folder / f"{name}-{i:03d}.svg").strokes.xy
        found.append(np.ptp(xy[:, 1]))
    return found


def test_a_folder_is_a_sequence_by_the_numbers_in_its_names(studio, tmp_path):
    draw(studio, "--sequence", "-o", tmp_path / "f/", "--view", "side", shape="walk")
    tall = heights(tmp_path / "f", 12)
    assert (np.diff(tall) > 0).all()  # one camera and one scale for all: 2 before 10
    assert names(tmp_path / "f") == [f"w-{i:03d}.svg" for i in range(12)]
    shell = sorted(str(path) for path in (studio / "walk").iterdir())
    assert [os.path.basename(p) for p in in_order(shell, shell)] == [
        f"w{i}.obj" for i in range(1, 13)
    ]


def test_an_order_of_ones_own_stays(studio, tmp_path):
    given = ["walk/w9.obj", "walk/w1.obj", "walk/w10.obj", "walk/w1.obj"]
    draw(studio, "--sequence", "-o", tmp_path / "f/", "--view", "side", "--still", shape=given)
    a, b, c, d = heights(tmp_path / "f", 4)
    assert b == d < a < c


def test_order_by_numbers():
    shell = ["f1.obj", "f10.obj", "f2.obj"]
    assert in_order(shell, shell) == ("f1.obj", "f2.obj", "f10.obj")
    assert in_order([], ["f2.obj", "f10.obj", "f1.obj"]) == ("f2.obj", "f10.obj", "f1.obj")
    assert sorted(["a10b2", "A10b11", "a9", "b", "7"], key=natural_key) == [
        "7", "a9", "a10b2", "A10b11", "b",
    ]  # fmt: skip
    assert [common_name([f"x/{n}.obj"]) for n in ("walk-001", "walk", "0001", "run_2")] == [
        "walk", "walk", "x", "run",
    ]  # fmt: skip


def test_a_sequence_may_turn_or_be_seen_along_a_path(studio, tmp_path):
    few = [f"walk/w{i}.obj" for i in (1, 2, 3)]
    draw(studio, "--sequence", "--turntable", "3", "-o", tmp_path / "t/", shape=few)
    assert len(names(tmp_path / "t")) == 3
    camera = fit_camera(np.array([[-1.0, -1, -1], [1, 1, 1]]), width=64, height=64)
    path = tmp_path / "c.json"
    path.write_text(json.dumps([camera.turned(a).to_dict() for a in (0, 5, 10)]))
    args = ("render", studio / "m.pt", *[studio / f for f in few], "--sequence", "--path", path)
    assert run(*args, "-o", tmp_path / "p/").exit_code == 0
    assert len(names(tmp_path / "p")) == 3
    refused(*args, studio / "ring.obj", "-o", tmp_path / "q.gif",
            words=["c.json: has 3 cameras, the sequence 4", "give as many"], code=2)  # fmt: skip
    wrong(studio, "--sequence", "--turntable", "4", "-o", tmp_path / "q.gif", shape=few,
          words=["--turntable 4 has 4 frames, the sequence 3"])  # fmt: skip
    path.write_text("[{}]")
    refused(*args, "-o", tmp_path / "q.gif", words=["c.json: camera 0: no eye"])
    assert not (tmp_path / "q.gif").exists()


def test_a_path_alone_moves_the_camera(studio, tmp_path):
    camera = fit_camera(np.array([[-1.0, -1, -1], [1, 1, 1]]), width=64, height=48)
    text = json.dumps([camera.turned(a).to_dict() for a in (0, 10)])
    (tmp_path / "c.json").write_text(text, "utf-8-sig")  # as editors on Windows save it
    args = ("render", studio / "m.pt", studio / "ring.obj", "--path", tmp_path / "c.json")
    assert run(*args, "-o", tmp_path / "p.svg", "-o", tmp_path / "p.gif").exit_code == 0
    assert names(tmp_path) == ["c.json", "p-000.svg", "p-001.svg", "p.gif"]
    with Image.open(tmp_path / "p.gif") as film:
        assert film.size == (64, 48)
    refused(*args[:3], "--path", tmp_path / "no.json", "-o", tmp_path / "q.gif",
            words=["no.json: no such file"])  # fmt: skip


def test_frames_that_are_no_frames_are_refused_by_name(studio, tmp_path):
    (tmp_path / "tetra.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\n")
    args = ("--sequence", "-o", tmp_path / "a.gif")
    wrong(studio, *args, shape=["ring.obj", tmp_path / "tetra.obj"], code=1,
          words=["tetra.obj: has 2 faces, the first frame"])  # fmt: skip
    wrong(studio, *args, shape=["ring.obj", "gone.obj"], words=["gone.obj: no such file"], code=1)
    view = Shape(str(studio / "ring.obj"), {"size": (64, 64)}).view()
    save_view(tmp_path / "v.npz", view)
    wrong(studio, *args, shape=["ring.obj", tmp_path / "v.npz"], words=["v.npz is a saved view"])
    (tmp_path / "empty").mkdir()
    wrong(studio, *args, shape=[tmp_path / "empty"], words=["no mesh and no view"], code=1)
    assert not (tmp_path / "a.gif").exists()


def test_one_frame_is_an_animation(studio, tmp_path):
    result = draw(studio, "--sequence", "-o", tmp_path / "a/", "-o", tmp_path / "a.gif")
    assert names(tmp_path / "a") == ["ring-000.svg"] and "1 frame," in result.stderr
    assert times(tmp_path / "a.gif") == [80]


def test_hidden_parts_are_left_out_of_all_frames(tmp_path, studio):
    ring = torus(around=24, across=10)
    for i in (0, 1):
        parts = {n: ring.__class__(ring.vertices * [1, 1 + i, 1] + [0, y, 0], ring.faces)
                 for n, y in (("low", 0.0), ("high", 2.0))}  # fmt: skip
        (tmp_path / f"{i}.obj").write_text(obj_text(parts))
    both = [tmp_path / "0.obj", tmp_path / "1.obj"]
    draw(studio, "--sequence", "-o", tmp_path / "all/", shape=both)
    draw(studio, "--sequence", "--hide", "high", "-o", tmp_path / "low/", shape=both)
    name = common_name([str(both[0])])
    tall, low = heights(tmp_path / "all", 2, name), heights(tmp_path / "low", 2, name)
    assert low[0] < 0.7 * tall[0] and low[1] < 0.7 * tall[1]
    wrong(studio, "--sequence", "--hide", "none", "-o", tmp_path / "x.gif", shape=both, code=1,
          words=["0.obj: no part named 'none'"])  # fmt: skip


def test_the_papers_networks_draw_frame_by_frame_and_that_is_said(studio, tmp_path, monkeypatch):
    from strokestyle.cli import render as command

    class Alone:
        """A style that is none of ours, and draws."""

        choice = None

        def __init__(self, style):
            self.style = style

        def __getattr__(self, name):
            return getattr(self.style, name)

    style = Alone(load_style(studio / "m.pt"))
    monkeypatch.setattr(command, "read_style", lambda *_: style)
    result = draw(studio, "--turntable", "2", "-o", tmp_path / "a.svg")
    assert "draw each frame on its own, as with --still" in result.stderr
    assert "data-ss-track" not in (tmp_path / "a-001.svg").read_text()


def test_stages_are_of_frames_on_their_own(studio, tmp_path):
    result = draw(studio, "--turntable", "2", "--stages", tmp_path / "s", "-o", tmp_path / "o/")
    assert "--stages: each frame is drawn on its own" in result.stderr
    assert "ring-001-sheet.png" in names(tmp_path / "s")
    assert names(tmp_path / "o") == ["ring-000.svg", "ring-001.svg"]


# --------------------------------------------------------------------------------------- stopped


@pytest.mark.skipif(sys.platform == "win32", reason="no program: no SIGKILL on Windows")
def test_a_film_that_is_killed_in_the_middle_is_not_there(studio, tmp_path):
    args = [sys.executable, "-m", "strokestyle", "render", studio / "m.pt", studio / "ring.obj",
            "--turntable", "3000", "-o", tmp_path / "f/", "-o", tmp_path / "a.gif",
            "-o", tmp_path / "a.html", "--still", *SIZE]  # fmt: skip
    env = {**os.environ, "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(list(map(str, args)), stderr=subprocess.DEVNULL, env=env)
    try:
        end = time.monotonic() + 60
        while not (tmp_path / "f" / "ring-0002.svg").exists() and time.monotonic() < end:
            assert process.poll() is None
            time.sleep(0.02)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert names(tmp_path) == ["f"]
    for path in (tmp_path / "f").glob("*.svg"):
        assert path.read_text().rstrip().endswith("</svg>")


def test_an_animation_of_nothing_says_so(studio, tmp_path):
    away = {**fit_camera(sphere(2).vertices).to_dict(), "eye": [0, 0, 3], "target": [0, 0, 9]}
    path = tmp_path / "away.json"
    path.write_text(json.dumps([away] * 2))
    result = run(
        "render", studio / "m.pt", studio / "ring.obj", "--path", path, "-o", tmp_path / "a.gif"
    )
    assert result.exit_code == 0 and "an empty animation" in result.stderr


def test_frames_a_second_of_drawings_are_said_to_be_none(studio, tmp_path):
    said = draw(studio, "--turntable", "1", "--fps", "24", "-o", f"{tmp_path}/a/").stderr
    assert "--fps is of films" in said
    said = draw(studio, "--turntable", "1", "--fps", "24", "-o", tmp_path / "a.gif").stderr
    assert "--fps" not in said


def test_a_background_is_a_colour(studio, tmp_path):
    film = tmp_path / "a.gif"
    args = ("--turntable", "1", "-o", film, "--background")
    wrong(studio, *args, "nonsense", words=["a colour is #rrggbb", "'nonsense'"])
    assert not film.exists()
    draw(studio, *args, "LightYellow")
