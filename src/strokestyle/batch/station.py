"""A worker elsewhere: files come as bytes, drawings go as bytes; in between it is as at home.

It unpacks a shape into a folder of its own, lets a process of `pool` draw it there, so that time
and memory are limited as on one machine, and takes what was written back.
"""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from .outcome import Outcome
from .plan import Job
from .pool import Limits, NoWorkers, Pool, Prepare

IDLE = 60.0  # seconds after which a process that has nothing to draw is ended


class Errand(NamedTuple):
    """How the shapes of a batch are drawn elsewhere.

    Parameters
    ----------
    prepare : given where `inputs` and `folders` lie there, what a worker process does first, as
        `draw_in_workers` takes it. A function that pickle finds by its name.
    inputs : files that are read besides the shapes: model, camera, curves
    folders : where files are written besides the folders of the jobs' outputs
    limits : what a shape may cost
    """

    prepare: Callable[[Mapping[str, str]], Prepare]
    inputs: tuple[str, ...]
    folders: tuple[str, ...] = ()
    limits: Limits = Limits()


class Parcel(NamedTuple):
    """A shape on its way to a worker.

    Parameters
    ----------
    job : as it is called at home
    shape : which of `files` is the shape
    output : name of its drawing, without its folder
    home : folders at home, each with its separator at the end: the shape's, the output's
    files : the shape and what lies beside it: bytes by their names relative to one folder, with /
    """

    job: Job
    shape: str
    output: str
    home: tuple[str, str]
    files: Mapping[str, bytes]


class Result(NamedTuple):
    """What comes back.

    Parameters
    ----------
    outcome : with the files' names at home; None where the batch cannot be drawn at all
    files : (which of the folders: 0 the output's, then those of the errand; name, bytes) of each
    refused : why it cannot be drawn at all
    """

    outcome: Outcome | None
    files: tuple[tuple[int, str, bytes], ...] = ()
    refused: BaseException | None = None


class Station:
    """Draws shapes of one batch at a worker, as many at a time as it is asked to.

    Parameters
    ----------
    errand : how
    inputs : the bytes of `errand.inputs`
    folder : where folders for its files are made
    """

    def __init__(self, errand: Errand, inputs: tuple[bytes, ...], folder: str):
        self.errand = errand
        self.folder = Path(tempfile.mkdtemp(prefix="strokestyle-", dir=folder))
        self.placed: dict[str, str] = {}
        for k, (name, data) in enumerate(zip(errand.inputs, inputs, strict=True)):
            there = self.folder / f"input-{k}" / os.path.basename(name)
            there.parent.mkdir()
            there.write_bytes(data)
            self.placed[name] = str(there)
        self._lock = threading.Lock()
        self._free: list[_Desk] = []
        self._desks: list[_Desk] = []
        self._closed = False

    def draw(self, parcel: Parcel) -> Result:
        """Draw a shape. Raises OSError where there is no room for its files."""
        desk = self._take_desk()
        try:
            return desk.draw(parcel)
        finally:
            with self._lock:
                self._free.append(desk)

    def close(self) -> None:
        """Stop all processes, and remove all files."""
        with self._lock:
            self._closed = True
            desks = list(self._desks)
        for desk in desks:
            desk.stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _take_desk(self) -> _Desk:
        with self._lock:
            if self._closed:
                raise RuntimeError("the batch is over")
            if not self._free:
                folder = self.folder / f"desk-{len(self._desks)}"
                self._free.append(_Desk(self.errand, self.placed, folder))
                self._desks.append(self._free[0])
            return self._free.pop()


class _Desk:
    """Where one shape at a time is drawn: a process, and folders that it reads and writes."""

    def __init__(self, errand: Errand, placed: Mapping[str, str], folder: Path):
        self.shape = folder / "shape"
        self.outputs = [folder / f"output-{k}" for k in range(1 + len(errand.folders))]
        places = dict(zip(errand.folders, map(str, self.outputs[1:]), strict=True))
        self.homes = {f"{there}{os.sep}": _with_end(home) for home, there in places.items()}
        self.homes |= {there: home for home, there in {**placed, **places}.items()}
        prepare = errand.prepare({**placed, **places})
        self.pool = Pool(prepare, 1, errand.limits, list(places.values()))
        self._busy = threading.Lock()
        self._alarm: threading.Timer | None = None

    def draw(self, parcel: Parcel) -> Result:
        """Draw a shape; what prevents all from being drawn is told, not raised."""
        if self._alarm:
            self._alarm.cancel()
        with self._busy:
            homes = {f"{self.outputs[0]}{os.sep}": parcel.home[1]}
            try:
                job = self._unpack(parcel)
                homes |= {f"{Path(job.shape).parent}{os.sep}": parcel.home[0]}
                homes |= {job.shape: parcel.job.shape, job.output: parcel.job.output}
                outcome = self.pool.draw(job)
                files = tuple(self._written(name) for name in outcome.files)
                return Result(_at_home(outcome, parcel.job, {**self.homes, **homes}), files)
            except (NoWorkers, ValueError, MemoryError) as error:  # what `prepare` raised
                told = _called(str(error), self.homes)
                return Result(None, refused=type(error)(told))
            finally:
                self._clear()
                self._alarm = threading.Timer(IDLE, self._sleep)
                self._alarm.daemon = True
                self._alarm.start()

    def stop(self) -> None:
        """Stop the process, whatever it is at."""
        if self._alarm:
            self._alarm.cancel()
        self.pool.abandon()

    def _sleep(self) -> None:
        if self._busy.acquire(blocking=False):
            try:
                self.pool.stop()
            finally:
                self._busy.release()

    def _unpack(self, parcel: Parcel) -> Job:
        for folder in (self.shape, *self.outputs):
            folder.mkdir(parents=True)
        for name, data in parcel.files.items():
            there = self.shape / name
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(data)
        output = self.outputs[0] / parcel.output
        return parcel.job._replace(shape=str(self.shape / parcel.shape), output=str(output))

    def _written(self, name: str) -> tuple[int, str, bytes]:
        path = Path(name)
        return self.outputs.index(path.parent), path.name, path.read_bytes()

    def _clear(self) -> None:
        for folder in (self.shape, *self.outputs):
            shutil.rmtree(folder, ignore_errors=True)


def _with_end(folder: str) -> str:
    return "" if folder == os.curdir else os.path.join(folder, "")


def _at_home(outcome: Outcome, job: Job, homes: Mapping[str, str]) -> Outcome:
    """Name files as they are called where the batch comes from."""
    return replace(
        outcome,
        shape=job.shape,
        output=job.output,
        files=tuple(_called(name, homes) for name in outcome.files),
        warnings=tuple(_called(text, homes) for text in outcome.warnings),
        error=None if outcome.error is None else _called(outcome.error, homes),
        told=tuple((level, _called(text, homes)) for level, text in outcome.told),
        worker=f"{platform.node()}:{outcome.worker}",
    )


def _called(text: str, homes: Mapping[str, str]) -> str:
    for there in sorted(homes, key=len, reverse=True):
        text = text.replace(there, homes[there])
    return text
