"""Workers die, hang and grow too large, and their parent dies: that shape alone is lost."""

import os
import signal
import subprocess
import sys
import time

import fake_drawing
import pytest

from strokestyle.batch import pool as pool_module
from strokestyle.batch.memory import MB, can_be_watched, installed, resident
from strokestyle.batch.plan import Job
from strokestyle.batch.pool import (
    ATTEMPTS,
    Limits,
    NoWorkers,
    Pool,
    draw_in_workers,
    fitting_workers,
)

needs_posix = pytest.mark.skipif(os.name == "nt", reason="signals")


def jobs_in(folder, *names):
    return [Job(f"{name}.obj", str(folder / f"{name}.svg")) for name in names]


@pytest.mark.parametrize(
    "cores, gigabytes, sizes, workers",
    [
        (2, 16, [1000] * 9, 2),  # as many as cores
        (4, 16, [1000] * 3, 3),  # as shapes
        (64, 256, [1000] * 99, 8),  # not all of a large machine
        (4, 1, [1000] * 9, 2),  # half of its memory holds two
        (4, 16, [1000, 80 * MB], 2),
        (4, 16, [80 * MB] * 4, 3),  # 2.5 GB each, of 8
        (4, 16, [2000 * MB] * 4, 1),
        (4, None, [2000 * MB] * 4, 4),  # nobody tells how much there is
        (1, 16, [], 1),
    ],
)
def test_as_many_workers_as_cores_shapes_and_memory_allow(
    monkeypatch, cores, gigabytes, sizes, workers
):
    monkeypatch.setattr(pool_module, "cores", lambda: cores)
    memory = None if gigabytes is None else gigabytes * 1024 * MB
    monkeypatch.setattr(pool_module, "installed", lambda: memory)
    assert fitting_workers(sizes) == workers


@pytest.mark.skipif(os.name == "nt", reason="nobody tells")
def test_a_machine_has_more_memory_than_a_process_of_it_takes():
    assert resident(os.getpid()) < installed() < 2**50


def parts_in(folder):
    return [name for name in os.listdir(folder) if name.endswith(".part")]


@needs_posix
@pytest.mark.skipif(not can_be_watched(), reason="nobody tells the memory of a process")
def test_what_goes_wrong_costs_its_shape_alone(tmp_path):
    jobs = jobs_in(tmp_path, "a", "killed", "hang", "doomed", "fat", "b", "c")
    limits = Limits(seconds=1.0, memory=200 * MB)
    outcomes = {one.shape: one for one in draw_in_workers(fake_drawing.prepare, jobs, 3, limits)}
    assert set(outcomes) == {job.shape for job in jobs}
    lost = {one.shape: one.failure for one in outcomes.values() if not one.drawn}
    assert lost == {"hang.obj": "timeout", "doomed.obj": "killed", "fat.obj": "memory"}
    assert outcomes["killed.obj"].attempts == 2 and outcomes["doomed.obj"].attempts == ATTEMPTS
    assert "hang.obj: not drawn in 1 s" in outcomes["hang.obj"].error
    assert "fat.obj: needs more than 200 MB" in outcomes["fat.obj"].error
    assert "died 3 times (killed" in outcomes["doomed.obj"].error
    assert 1.0 <= outcomes["hang.obj"].seconds < 2.5
    for name in ("a", "b", "c", "killed"):
        assert (tmp_path / f"{name}.svg").read_text() == f"{name}.obj"
    assert not parts_in(tmp_path)


@needs_posix
def test_workers_stop_when_the_caller_leaves_off(tmp_path):
    outcomes = draw_in_workers(fake_drawing.prepare, jobs_in(tmp_path, "a", "hang"), 2)
    worker = int(next(outcomes).worker)
    start = time.monotonic()
    outcomes.close()
    assert time.monotonic() - start < 5
    assert resident(worker) is None and not parts_in(tmp_path)


@needs_posix
def test_workers_that_are_abandoned_are_no_more(tmp_path):
    pool = Pool(fake_drawing.prepare, 1, Limits())
    worker = int(pool.draw(jobs_in(tmp_path, "a")[0]).worker)
    pool.abandon()
    end = time.monotonic() + 5
    with pytest.raises(ProcessLookupError):  # a zombie is still found
        while time.monotonic() < end:
            os.kill(worker, 0)
            time.sleep(0.02)
    pool.stop()


@needs_posix
def test_workers_stop_when_their_parent_is_killed(tmp_path):
    code = (
        "import sys, fake_drawing; from test_pool import *; from pathlib import Path\n"
        "jobs = jobs_in(Path(sys.argv[1]), 'a', 'hang')\n"
        "for one in draw_in_workers(fake_drawing.prepare, jobs, 1): print(one.worker, flush=True)"
    )
    path = os.pathsep.join([os.path.dirname(__file__), *sys.path])
    parent = subprocess.Popen(
        [sys.executable, "-c", code, tmp_path],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
    )
    worker = int(parent.stdout.readline())
    end = time.monotonic() + 10
    while not parts_in(tmp_path) and time.monotonic() < end:  # it is at the second one
        time.sleep(0.02)
    assert parts_in(tmp_path) and resident(worker)
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    while resident(worker) and time.monotonic() < end:
        time.sleep(0.02)
    assert not resident(worker) and not parts_in(tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["a.svg"]


def test_what_no_worker_can_do_ends_the_batch(tmp_path):
    jobs = jobs_in(tmp_path, "a", "b")
    with pytest.raises(ValueError, match="m.pt: no model"):
        list(draw_in_workers(fake_drawing.refuse, jobs, 1))
    with pytest.raises(NoWorkers, match="died before they could begin .exit code 3"):
        list(draw_in_workers(fake_drawing.die, jobs, 1))
    if can_be_watched():
        with pytest.raises(ValueError, match="before it draws anything, more than the 1 MB"):
            list(draw_in_workers(fake_drawing.prepare, jobs, 1, Limits(memory=MB)))
    assert os.listdir(tmp_path) == []
