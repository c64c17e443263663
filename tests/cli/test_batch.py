"""Batches at the command line: journal, --resume, limits, lists, --json, mirrored folders."""

import functools
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from command import refused, run
from small_styles import plain_style

from strokestyle import cli
from strokestyle.batch.journal import NAME, read_journal
from strokestyle.cli.messages import say
from strokestyle.render.style_file import save_style

SMALL = ("--size", "96")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A model, three boxes, a bad mesh, and the drawing of each box by itself in `alone/`."""
    folder = tmp_path_factory.mktemp("batch")
    save_style(folder / "m.pt", plain_style(96))
    for name in ("in", "alone"):
        (folder / name).mkdir()
    for k in range(3):
        trimesh.creation.box((1, 1 + 0.3 * k, 1)).export(folder / "in" / f"box {k}.ply")
        alone = folder / "alone" / f"box {k}.svg"
        assert run("render", folder / "m.pt", folder / "in" / f"box {k}.ply", "-o", alone,
                   *SMALL).exit_code == 0  # fmt: skip
    (folder / "in" / "bad.obj").write_text("dear diary\n")
    return folder


def drawings(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.svg")}


def hanging(folder):
    """A shape that is never read to its end: a pipe that nobody writes to."""
    os.mkfifo(folder / "pipe.npz")
    return folder / "pipe.npz"


def fed(text, *args):
    """Run a command that reads `text` on its standard input."""
    return CliRunner().invoke(cli.main, [str(arg) for arg in args], input=text)


@pytest.mark.parametrize("words, workers", [((), 3), (("--jobs", "1"), 1), (("--jobs", "9"), 4)])
def test_shapes_are_drawn_at_once_unless_told(place, tmp_path, monkeypatch, words, workers):
    asked = []

    def count(prepare, jobs, workers, *rest):
        asked.append(workers)
        return iter(())

    monkeypatch.setattr("strokestyle.batch.pool.draw_in_workers", count)
    monkeypatch.setattr("strokestyle.batch.pool.cores", lambda: 3)
    run("render", place / "m.pt", place / "in", "-o", tmp_path / "out", *SMALL, *words)
    assert asked == [workers]


def test_a_batch_stops_is_resumed_and_draws_what_is_drawn_alone(place, tmp_path):
    out, args = tmp_path / "out", ("render", place / "m.pt", place / "in", *SMALL, "--jobs", "2")
    result = run(*args, "-o", out, "--json")
    assert result.exit_code == 1 and "3 of 4 shapes drawn" in result.stderr
    assert "bad.obj" in result.stderr and "batch.jsonl" not in result.stderr
    assert drawings(out) == drawings(place / "alone")
    told = [json.loads(line) for line in result.stdout.splitlines()]
    written = [json.loads(line) for line in (out / NAME).read_text().splitlines()]
    assert len(told) == 4 and [one["shape"] for one in told] == [one["shape"] for one in written]
    for one, line in zip(told, written, strict=True):
        assert [os.path.join(out, file) for file in line["files"]] == one["files"]
        assert (one["failure"] == "error") == ("bad.obj" in one["shape"]) == (not one["files"])
        assert one["seconds"] > 0 and (one["error"] or one["strokes"] >= one["lines"] > 0)

    # One cut short, one not in the journal but for a torn line, one as it was; and a lost worker's.
    (out / "box 0.svg").write_bytes(drawings(out)["box 0.svg"][:100])
    kept = [line for line in written if "box 1" not in line["shape"]]
    torn = json.dumps(next(line for line in written if "box 1" in line["shape"]))[:-9]
    (out / NAME).write_text("".join(json.dumps(line) + "\n" for line in kept) + torn)
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    from strokestyle.files import _writer

    (out / f".box 1.svg.{_writer(dead.pid)}-x_1.part").write_text("half")
    (out / f".box 1.svg.{_writer(os.getpid())}-x_1.part").write_text("of one that lives")
    stamp = (out / "box 2.svg").stat().st_mtime_ns
    again = run(*args, "-o", out, "--resume", "--json")
    assert again.exit_code == 1 and "1 of 4 shapes are drawn already" in again.stderr
    assert again.stderr.count(" -> ") == 2 and len(again.stdout.splitlines()) == 4
    assert (out / "box 2.svg").stat().st_mtime_ns == stamp
    assert drawings(out) == drawings(place / "alone")
    assert sorted(one.shape for one in read_journal(out)) == sorted(one["shape"] for one in told)
    assert [name for name in os.listdir(out) if name.endswith(".part")] == [
        f".box 1.svg.{_writer(os.getpid())}-x_1.part"
    ]


def test_what_is_drawn_otherwise_is_drawn_anew(place, tmp_path):
    model, shape, out = tmp_path / "m.pt", tmp_path / "in" / "box.ply", tmp_path / "out"
    (tmp_path / "in").mkdir()
    model.write_bytes((place / "m.pt").read_bytes())
    shape.write_bytes((place / "in" / "box 0.ply").read_bytes())

    def drawn(*options):
        result = run("render", model, tmp_path / "in", "-o", out, "--resume", *SMALL, *options)
        assert result.exit_code == 0, result.stderr
        return " -> " in result.stderr

    assert drawn() and not drawn() and not drawn("--timeout", "60", "--jobs", "2")
    save_style(model, plain_style(96, thin_above=True))
    assert drawn("--png") and not drawn("--png")
    (out / "box.png").unlink()
    shape.write_bytes((place / "in" / "box 1.ply").read_bytes())
    assert drawn("--png") and len(read_journal(out)) == 1 and (out / "box.png").exists()


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_stopped_says_how_to_go_on(place, tmp_path, number):
    """Its second shape hangs: it is stopped when the first is drawn."""
    out = tmp_path / "out"
    command = [sys.executable, "-m", "strokestyle", "render", place / "m.pt",
               place / "in" / "box 0.ply", hanging(tmp_path), "-o", out]  # fmt: skip
    # what a shell starts in the background ignores SIGINT, and so does all that it starts
    interruptible = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=interruptible)
    end = time.monotonic() + 60
    while not ((out / NAME).exists() and (out / NAME).read_text()) and time.monotonic() < end:
        time.sleep(0.02)
    time.sleep(0.3)
    running.send_signal(number)
    try:
        _, said = running.communicate(
            timeout=30
        )  # not before the worker is gone, which writes to it
    finally:
        running.kill()
    assert running.returncode == (130 if number == signal.SIGINT else -signal.SIGKILL)
    if number == signal.SIGINT:
        last = "strokestyle: stopped: 1 of 2 shapes are drawn; the same command with --resume"
        assert said.splitlines()[-1].startswith(last), said
    assert sorted(os.listdir(out)) == [NAME, "box 0.svg"]
    if number == signal.SIGINT:
        again = run(*command[3:], "--resume", "--timeout", "3")
        assert again.exit_code == 1 and "1 of 2 shapes are drawn already" in again.stderr
        assert "pipe.npz: not drawn in 3 s" in again.stderr
        assert [one.failure for one in read_journal(out)] == [None, "timeout"]


@pytest.mark.parametrize("text", ["", "\n \n", "\0", "\ufeff"])
def test_an_empty_list_is_told(place, tmp_path, text):
    result = fed(text, "render", place / "m.pt", "-", "-o", tmp_path / "out")
    assert result.exit_code == 1 and len(result.stderr.splitlines()) == 1
    assert "standard input: no shapes in this list" in result.stderr
    assert not (tmp_path / "out").exists()


def test_one_shape_has_no_journal_but_may_be_told_as_json(place, tmp_path):
    shape, out = place / "in" / "box 0.ply", tmp_path / "out"
    result = run("render", place / "m.pt", shape, "-o", f"{out}/", "--json", *SMALL)
    told = json.loads(result.stdout)
    assert (told["files"], told["error"]) == ([str(out / "box 0.svg")], None)
    assert os.listdir(out) == ["box 0.svg"]
    none = run("render", place / "m.pt", tmp_path / "none.obj", "-o", out / "x.svg", "--json")
    assert none.exit_code == 1 and "none.obj" in json.loads(none.stdout)["error"]


def test_extract_tells_its_curves_as_json(place, tmp_path):
    shape, out = place / "in" / "box 0.ply", tmp_path / "x.svg"
    told = json.loads(run("extract", shape, "-o", out, "--json", *SMALL).stdout)
    assert told["files"] == [str(out)] and told["lines"] > 0 and told["length_px"] > 96
    refused("extract", shape, "-o", "-", "--json", words=["one of both"], code=2)


def test_listed_shapes_of_one_name_go_to_folders_that_mirror_theirs(place, tmp_path, monkeypatch):
    for folder in ("a", "b/deep"):
        (tmp_path / "in" / folder).mkdir(parents=True)
        mesh = (place / "in" / "box 0.ply").read_bytes()
        (tmp_path / "in" / folder / "box 0.ply").write_bytes(mesh)
    args = ("render", place / "m.pt", tmp_path / "in", "-o", tmp_path / "none", *SMALL)
    assert "no mesh and no view" in refused(*args)
    monkeypatch.chdir(tmp_path)
    listed = "in/a/box 0.ply\n\n  \nin/b/deep/box 0.ply\n"
    result = fed(listed, "render", place / "m.pt", "-", "-o", "out", "--mirror", *SMALL, "-q")
    assert (result.exit_code, result.output) == (0, "")
    for folder in ("a", "b/deep"):
        drawn = drawings(tmp_path / "out" / folder)
        assert drawn == {"box 0.svg": drawings(place / "alone")["box 0.svg"]}
    shapes = sorted(one.shape for one in read_journal("out"))  # as they were done
    assert shapes == ["in/a/box 0.ply", "in/b/deep/box 0.ply"]


@pytest.mark.parametrize(
    "args, words",
    [
        (["a.obj", "-o", "-", "--json"], ["-o - takes one SVG", "--json"]),
        (["a.obj", "-o", "-", "--timeout", "3"], ["--timeout"]),
        (["a.obj", "-o", "a.svg", "--resume"], ["--resume", "folder"]),
        (["a.obj", "-o", "a.svg", "--mirror"], ["a.svg"]),
        (["a.obj", "-o", "a.svg", "--memory", "2"], ["'2'", "2G"]),
        (["a.obj", "-o", "a.svg", "--memory", "0G"], ["'0G'", "800M"]),
        (["a.obj", "-o", "a.svg", "--timeout", "0"], ["--timeout"]),
        (["p/a.obj", "q/a.ply", "-o", "out/"], ["p/a.obj and q/a.ply", "mirror"]),
    ],
)
def test_usage_errors_leave_nothing(tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    refused("render", "m.pt", *args, words=words, code=2)
    assert os.listdir(tmp_path) == []


def test_a_model_that_cannot_be_read_is_told_once(place, tmp_path):
    (tmp_path / "m.pt").write_text("no model")
    args = ("render", tmp_path / "m.pt", place / "in", "-o", tmp_path / "out", *SMALL)
    refused(*args, words=["m.pt: not a strokestyle model"])
    assert os.listdir(tmp_path / "out") == [NAME]


def test_memory_is_told_in_units():
    from strokestyle.cli.options import MemorySize

    convert = MemorySize().convert
    told = [convert(text, None, None) for text in ("2G", "1.5g", "800MB", "1 GiB", "64K")]
    assert told == [2 << 30, 3 << 29, 800 << 20, 1 << 30, 64 << 10]


@pytest.mark.skipif(os.name == "nt", reason="a shell that closes streams")
def test_a_batch_is_drawn_where_a_daemon_has_closed_the_standard_streams(place, tmp_path):
    out = tmp_path / "out"

    def closed(streams, shapes):
        command = [sys.executable, "-m", "strokestyle", "render", place / "m.pt", shapes, "-o", out]
        shell = ["sh", "-c", f'exec "$@" {streams}', "sh", *command, *SMALL]
        return subprocess.run(list(map(str, shell)), stderr=subprocess.PIPE, text=True)

    assert closed("<&- >&- 2>&-", place / "in").returncode == 1  # one of them is bad
    assert drawings(out) == drawings(place / "alone")
    assert len(read_journal(out)) == 4  # nothing that is said is written into another file
    told = closed("<&-", "-").stderr
    assert told.startswith("strokestyle: standard input: no shapes") and told.count("\n") == 1


def test_a_saved_view_among_shapes_costs_itself_alone(place, tmp_path):
    box = place / "in" / "box 0.ply"
    named = tmp_path / "two\nlines.ply"
    named.write_bytes(box.read_bytes())
    assert run("extract", box, "-o", tmp_path / "v.npz", *SMALL).exit_code == 0
    result = run("render", place / "m.pt", tmp_path, "-o", tmp_path / "out", *SMALL)
    assert result.exit_code == 1 and "v.npz is a saved view" in result.stderr
    assert "leave out --size" in result.stderr and "2 of 2" not in result.stderr
    assert [path.name for path in (tmp_path / "out").glob("*.svg")] == ["two\nlines.svg"]
    assert "two\\nlines.ply: " in result.stderr and "two\nlines" not in result.stderr
    refused("render", place / "m.pt", tmp_path / "v.npz", "-o", tmp_path / "out", *SMALL,
            words=["v.npz is a saved view"], code=2)  # fmt: skip


def test_a_full_disk_under_what_is_said_stops_no_work(monkeypatch):
    def full(*args, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("click.echo", full)
    say("all is well")


def test_where_an_artist_would_draw_hardly_a_line_that_is_told(place, tmp_path, monkeypatch):
    """The laws are asked again only where no line was left out."""
    from strokestyle.render.style import Style

    monkeypatch.setattr(Style, "leaves_nothing", lambda *_: True)
    args = ("render", place / "m.pt", place / "in" / "box 0.ply", "-o", tmp_path / "x.svg", *SMALL)
    assert "hardly one of its lines" in run(*args).stderr
    choose = Style.choose
    monkeypatch.setattr(Style, "choose", lambda style, view: choose(style, first_half(view)))
    assert "hardly" not in run(*args).stderr


def first_half(view):
    return view.only(np.arange(len(view.curves.xy)) < len(view.curves.xy) // 2)
