"""`strokestyle fit`: what it writes beside the model, and the progress that it shows."""

import io
import sys
from dataclasses import replace

import click
import numpy as np
import painted_files
import pytest
from command import refused, run
from PIL import Image
from small_views import SIZE, a_drawing, a_view

from strokestyle import cli
from strokestyle.cli.messages import VERBOSITY
from strokestyle.cli.progress import ProgressDisplay
from strokestyle.extract.view_file import save_view
from strokestyle.fit import train
from strokestyle.fit.progress import Progress


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder to work in, with charcoal.png and view.npz; the quick preset takes no time."""
    monkeypatch.chdir(tmp_path)
    quick = replace(train.PRESETS["quick"], steps=6, trace_steps=6)
    monkeypatch.setitem(train.PRESETS, "quick", quick)
    view = a_view()
    save_view("view.npz", view)
    drawn = (a_drawing(view).rgb * 255).astype(np.uint8)
    Image.fromarray(drawn).save("charcoal.png")
    return tmp_path


def test_a_model_may_have_the_name_of_its_drawing(desk):
    drawing = (desk / "charcoal.png").read_bytes()
    done = run("fit", "charcoal.png", "view.npz", "-o", "charcoal.pt", "--preset", "quick")
    assert done.exit_code == 0, done.stderr
    assert done.stderr.splitlines()[-1].endswith("-> charcoal.pt, charcoal.fit.png")
    assert sorted(path.name for path in desk.iterdir()) == [
        "charcoal.fit.png",
        "charcoal.png",
        "charcoal.pt",
        "view.npz",
    ]
    assert (desk / "charcoal.png").read_bytes() == drawing
    assert Image.open("charcoal.fit.png").size == (4 * SIZE, SIZE)


@pytest.mark.parametrize(
    "output, picture",
    [("m.pt", "m.fit.png"), ("m", "m.fit.png"), ("a.b.pt", "a.b.fit.png")],
)
def test_an_input_is_not_overwritten_by_the_picture(desk, output, picture):
    (desk / "charcoal.png").rename(desk / picture)
    words = [picture, "is the input"]
    refused("fit", picture, "view.npz", "-o", output, "--preset", "quick", words=words)
    assert not (desk / output).exists()


def test_a_layer_is_named(desk):
    drawn = np.asarray(Image.open("charcoal.png"))
    ink = np.dstack([np.zeros_like(drawn), 255 - drawn[..., 1]])
    layers = [("Ink", ink, 0, 0), ("Ruler", 255 - ink // 255 * 255, 0, 0)]
    blank = np.full_like(drawn, 255)
    (desk / "d.ora").write_bytes(painted_files.ora((SIZE, SIZE), layers, blank))
    options = ["view.npz", "-o", "m.pt", "--preset", "quick"]
    done = run("fit", "d.ora", *options, "--layer", "Ink")
    assert done.exit_code == 0 and "d.ora: learned" in done.stderr, done.stderr
    (desk / "m.pt").unlink()
    refused("fit", "d.ora", *options, words=["d.ora: no strokes found"])
    words = ["d.ora: no layer is named 'ink'; it has 'Ink', 'Ruler'"]
    refused("fit", "d.ora", *options, "--layer", "ink", words=words)
    words = ["charcoal.png: has no layers, so none named 'Ink'"]
    refused("fit", "charcoal.png", *options, "--layer", "Ink", words=words)
    assert not (desk / "m.pt").exists()


def test_what_of_a_file_is_not_honoured_is_told(desk):
    Image.open("charcoal.png").save("d.png", icc_profile=b"none")
    done = run("fit", "d.png", "view.npz", "-o", "m.pt", "--preset", "quick")
    lines = done.stderr.splitlines()
    assert lines[0] == "warning: d.png: its colour profile is damaged, and left out"


# ---------------------------------------------------------------------------------------- progress

EVENTS = [
    Progress("thickness", 5, 10, {"error": 0.5}, 31.4),
    Progress("thickness", 10, 10, {"error": 0.25}, 20.0),
    Progress("texture", 3, 40, {"grain": 0.125, "edge": 2.0}, 12.3),
]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(monkeypatch, stderr, verbosity=0):
    """What the progress of EVENTS leaves on stderr."""
    monkeypatch.setattr(sys, "stderr", stderr)
    with click.Context(cli.main) as context:
        context.meta[VERBOSITY] = verbosity
        with ProgressDisplay() as progress:
            for event in EVENTS:
                progress(event)
    return stderr.getvalue()


def test_a_terminal_shows_stage_losses_and_time_left(monkeypatch):
    for name, value in {"TERM": "xterm", "COLUMNS": "120", "NO_COLOR": "1"}.items():
        monkeypatch.setenv(name, value)
    text = shown(monkeypatch, Terminal())
    first, second = text[text.rindex("thickness") :].splitlines()[:2]
    for words in ("thickness", "10/10", "error 0.2500", "20 s left"):
        assert words in first
    for words in ("texture", "3/40", "grain 0.1250 edge 2.0000", "12 s left"):
        assert words in second
    assert "\x1b[" in text  # lines are drawn over


def test_elsewhere_a_line_tells_of_each_stage_that_is_done(monkeypatch):
    assert shown(monkeypatch, io.StringIO()) == "  thickness: 10 steps error 0.2500\n"


@pytest.mark.parametrize("stderr", [io.StringIO, Terminal])
def test_quiet_is_quiet(monkeypatch, stderr):
    assert shown(monkeypatch, stderr(), verbosity=-1) == ""


def test_lines_that_were_not_drawn_are_told_and_left_out(desk):
    view = a_view()
    first = np.arange(len(view.curves.xy)) < view.curves.offsets[1]
    drawn = (a_drawing(view.only(first)).rgb * 255).astype(np.uint8)
    Image.fromarray(drawn).save("first.png")
    done = run("fit", "first.png", "view.npz", "-o", "first.pt", "--preset", "quick")
    assert "first.png: drew 1 of 2 lines (5" in done.stderr
    done = run("fit", "charcoal.png", "view.npz", "-o", "both.pt", "--preset", "quick")
    assert "charcoal.png: drew all 2 lines\n" in done.stderr
    for model, choice, counted in (
        ("first.pt", "learned", "1 curve of 2"),
        ("first.pt", "all", "2 curves,"),
        ("both.pt", "learned", "2 curves,"),
    ):
        done = run("render", model, "view.npz", "-o", "out.svg", "--choice", choice)
        assert done.stderr.startswith(f"view.npz: {counted}"), done.stderr
        svg = (desk / "out.svg").read_text()
        assert ("crease" in svg) == (counted[0] == "2")
