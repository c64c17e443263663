"""A fit that was stopped and went on ends with the weights of one that was not."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from small_views import TINY, a_drawing, a_view

from strokestyle import cli
from strokestyle.cli.progress import ProgressDisplay
from strokestyle.extract.view import View
from strokestyle.files import read_model
from strokestyle.fit import progress as fit_progress
from strokestyle.fit import trace as fit_trace
from strokestyle.fit import train as fit_module
from strokestyle.fit.checkpoint import Checkpoint, digest
from strokestyle.fit.trace import TRACE_STEPS
from strokestyle.fit.train import PRESETS, fit_style
from strokestyle.render.style_file import save_style

QUICK = replace(PRESETS["quick"], steps=12, trace_steps=12)
PAPER = replace(TINY, geometry_decay=2)  # 3 steps, then 2


@pytest.fixture(autouse=True)
def all_steps_are_told(monkeypatch):
    """Progress is told a few times a second; here at every step."""
    monkeypatch.setattr(fit_progress, "REPORT_INTERVAL", 0.0)


def stop_at(stage, step):
    def progress(event):
        if (event.stage, event.step) == (stage, step):
            raise KeyboardInterrupt

    return progress


def learn(tmp_path, config, name="model", **options):
    """The bytes of the model learned."""
    view = a_view()
    options = {"seed": 3, "device": "cpu"} | options
    save_style(tmp_path / f"{name}.pt", fit_style(view, a_drawing(view), config, **options))
    return (tmp_path / f"{name}.pt").read_bytes()


@pytest.mark.parametrize(
    "config, stops",
    [
        (PAPER, [("geometry", 2), ("texture", 1)]),
        (QUICK, [("trace", 1), ("trace", 7)]),
        (QUICK, [("trace", 12), ("texture", 0)]),
        (QUICK, [("trace", 3), ("thickness", 5), ("texture", 1)]),
    ],
)
def test_interrupted_and_resumed_is_uninterrupted_bit_for_bit(tmp_path, config, stops):
    whole = learn(tmp_path, config)
    path = tmp_path / "fit.checkpoint"
    for stop in stops:
        with pytest.raises(KeyboardInterrupt):
            learn(
                tmp_path, config, checkpoint=Checkpoint(path, resume=True), progress=stop_at(*stop)
            )
        assert path.exists()
    seen = []
    assert (
        learn(tmp_path, config, checkpoint=Checkpoint(path, resume=True), progress=seen.append)
        == whole
    )
    last, step = stops[-1]
    long = [
        event.step
        for event in seen
        if event.stage == last and last != "texture" or event.stage == "trace"
    ]
    assert not long or min(long) > step  # it did go on, not begin again


def test_a_fit_with_a_checkpoint_is_one_without(tmp_path):
    often = Checkpoint(tmp_path / "c", every=0.0)
    assert learn(tmp_path, QUICK) == learn(tmp_path, QUICK, checkpoint=often)
    assert often.path.exists()
    often.remove()
    often.remove()
    assert [p.name for p in tmp_path.iterdir()] == ["model.pt"]


def test_a_kill_leaves_the_last_checkpoint_in_time(tmp_path):
    """Any other exception than Ctrl-C may come in the middle of a step.

    What counts is what was written before.
    """

    def fail(event):
        if (event.stage, event.step) == ("trace", 5):
            raise RuntimeError("killed")

    path = tmp_path / "c"
    with pytest.raises(RuntimeError):
        learn(tmp_path, QUICK, checkpoint=Checkpoint(path, every=-1e9), progress=fail)
    assert read_model(path)["stages"]["trace"]["step"] >= 1
    assert learn(tmp_path, QUICK, checkpoint=Checkpoint(path, resume=True)) == learn(
        tmp_path, QUICK
    )


@pytest.fixture
def interruptible():
    """A process started in the background ignores SIGINT; tests of it need Python's own handler."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_waits_for_the_end_of_a_step_and_a_second_one_does_not(tmp_path, interruptible):
    checkpoint, x = Checkpoint(tmp_path / "c"), torch.zeros(1)
    checkpoint.begin({})
    before = signal.getsignal(signal.SIGINT)
    with (
        pytest.raises(KeyboardInterrupt),
        checkpoint.watch("s", 10, {"x": x}, {}) as (remaining, passed),
    ):
        for step in remaining:
            if step == 3:
                os.kill(os.getpid(), signal.SIGINT)
            x += 1
            passed()
    assert x == 3 and checkpoint.load("s")["step"] == 3
    with (
        pytest.raises(KeyboardInterrupt),
        checkpoint.watch("s", 10, {"x": x}, {}) as (remaining, passed),
    ):
        for step in remaining:
            x += 1
            if step == 5:
                os.kill(os.getpid(), signal.SIGINT)
                os.kill(os.getpid(), signal.SIGINT)
            passed()
    again = Checkpoint(tmp_path / "c", resume=True)
    again.begin({})
    assert (
        again.load("s")["step"] == 3 and again.load("s")["learned"]["x"] == 3
    )  # half a step is not kept
    assert signal.getsignal(signal.SIGINT) is before


def test_a_polite_kill_is_as_good_as_ctrl_c(tmp_path):
    checkpoint, x = Checkpoint(tmp_path / "c"), torch.zeros(1)
    checkpoint.begin({})
    with (
        pytest.raises(KeyboardInterrupt),
        checkpoint.watch("s", 10, {"x": x}, {}) as (remaining, passed),
    ):
        for step in remaining:
            if step == 4:
                os.kill(os.getpid(), signal.SIGTERM)
            x += 1
            passed()
    again = Checkpoint(tmp_path / "c", resume=True)
    again.begin({})
    assert again.load("s")["step"] == 4 and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_the_checkpoint_of_another_fit_is_refused(tmp_path):
    path, view = tmp_path / "c", a_view()
    drawing = a_drawing(view)
    with pytest.raises(KeyboardInterrupt):
        fit_style(
            view, drawing, QUICK, seed=3, checkpoint=Checkpoint(path), progress=stop_at("trace", 2)
        )
    kept = path.read_bytes()
    moved = View(view.camera, replace(view.curves, xy=view.curves.xy + 0.5), view.maps)
    for other, what in (
        ((view, drawing, QUICK, 4), "seed 3, not 4"),
        ((view, a_drawing(view, 6.0), QUICK, 3), "another drawing"),
        ((moved, drawing, QUICK, 3), "another shape, view or lines"),
        ((view, drawing, PAPER, 3), "preset quick, not paper"),
        ((view, drawing, replace(QUICK, roughness=0.2), 3), "another setting of the preset"),
    ):
        with pytest.raises(ValueError) as error:
            fit_style(
                *other[:3], seed=other[3], device="cpu", checkpoint=Checkpoint(path, resume=True)
            )
        assert (
            str(path) in str(error.value)
            and what in str(error.value)
            and "\n" not in str(error.value)
        )
    assert path.read_bytes() == kept
    fit_style(
        view, drawing, QUICK, seed=4, device="cpu", checkpoint=Checkpoint(path)
    )  # without resume it is not looked at


@pytest.mark.parametrize("cut", [0, 10, 1000, -30])
def test_a_damaged_checkpoint_is_one_line(tmp_path, cut):
    checkpoint = Checkpoint(tmp_path / "c", resume=True)
    checkpoint.begin({"seed": "1"})
    checkpoint.save("s", {"x": np.zeros(1000)})
    checkpoint.path.write_bytes(checkpoint.path.read_bytes()[:cut])
    with pytest.raises(ValueError, match=r"c: a damaged checkpoint.*start afresh$"):
        checkpoint.begin({"seed": "1"})
    torch.save([1, 2], checkpoint.path)
    with pytest.raises(ValueError, match="a damaged checkpoint"):
        checkpoint.begin({"seed": "1"})


def test_without_a_file_nothing_is_kept_and_all_begins_anew(tmp_path):
    for checkpoint in (Checkpoint(), Checkpoint(tmp_path / "none", resume=True)):
        checkpoint.begin({"seed": "1"})
        assert checkpoint.load("s") is None
    nowhere = Checkpoint()
    nowhere.save("s", {"x": 1})
    nowhere.remove()
    assert not list(tmp_path.iterdir())


def test_digests_tell_values_shapes_and_types():
    a = np.arange(6)
    assert digest(a) == digest(a.copy()) and digest(np.zeros(0)) == digest(np.zeros(0))
    others = [a + 1, a.reshape(2, 3), a.astype(np.int32), a[:0], a[::-1]]
    assert len({digest(a), *map(digest, others)}) == 6


@pytest.mark.parametrize("config, stage", [(QUICK, "trace"), (PAPER, "geometry")])
def test_a_budget_chooses_the_steps_and_a_resumed_fit_keeps_them(
    tmp_path, config, stage, monkeypatch
):
    monkeypatch.setattr(fit_trace, "TRACE_STEPS", (14, 17))
    path, seen = tmp_path / "c", []

    def progress(event):
        seen.append(event)
        if (event.stage, event.step) == (stage, 1):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn(tmp_path, config, checkpoint=Checkpoint(path), minutes=0.003, progress=progress)
    chosen = {event.steps for event in seen if event.stage == stage}
    learn(
        tmp_path, config, checkpoint=Checkpoint(path, resume=True), minutes=60, progress=seen.append
    )
    assert {event.steps for event in seen if event.stage == stage} == chosen and len(chosen) == 1
    assert 14 <= chosen.pop() <= 17 if config is QUICK else chosen.pop() <= 3
    assert TRACE_STEPS[0] >= 20  # below, a one-cycle schedule has no room


@pytest.mark.parametrize("minutes, steps", [(1e-4, [1, 1]), (60, [3, 2])])
def test_the_papers_schedule_shrinks_with_the_budget_and_never_grows(tmp_path, minutes, steps):
    seen = []
    learn(tmp_path, PAPER, minutes=minutes, progress=seen.append)
    assert [
        max(e.steps for e in seen if e.stage == stage) for stage in ("geometry", "texture")
    ] == steps


def test_the_command_says_how_to_go_on_and_does(tmp_path, monkeypatch):
    """Ctrl-C: one line and 130; --resume ends with the same file, and the checkpoint is gone."""
    monkeypatch.setitem(fit_module.PRESETS, "quick", QUICK)
    monkeypatch.chdir(tmp_path)
    from PIL import Image

    from strokestyle.extract.view_file import save_view

    view = a_view()
    save_view("view.npz", view)
    Image.fromarray((a_drawing(view).rgb * 255).astype(np.uint8)).save("drawing.png")
    command = ["fit", "drawing.png", "view.npz", "--preset", "quick", "--device", "cpu", "-o"]
    run = CliRunner().invoke
    assert run(cli.main, [*command, "whole.pt"]).exit_code == 0
    with monkeypatch.context() as patch:
        patch.setattr(ProgressDisplay, "__call__", lambda self, event: stop_at("trace", 3)(event))
        done = run(cli.main, [*command, "model.pt"])
    assert done.exit_code == 130 and done.output.splitlines()[-1].endswith(
        "interrupted; go on with --resume"
    )
    assert "Traceback" not in done.output and (tmp_path / "model.pt.checkpoint").exists()
    done = run(cli.main, [*command, "model.pt", "--resume"])
    assert done.exit_code == 0 and not (tmp_path / "model.pt.checkpoint").exists()
    assert (tmp_path / "model.pt").read_bytes() == (tmp_path / "whole.pt").read_bytes()
    done = run(cli.main, [*command, "model.pt", "--resume"])
    assert (
        done.exit_code == 0
        and "model.pt.checkpoint: no checkpoint there; starting from the beginning" in done.output
    )
