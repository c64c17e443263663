"""Draw a batch on many machines, those of a Dask cluster.

Dask finds the workers, sends them tasks, and gives the tasks of a lost one to another. A task is
the bytes of a shape, and its result those of the drawing: no folder is shared. The model goes to
each worker once, as a plugin that Dask gives to those that come later as well.

What is sent there before we know that strokestyle is installed, a plugin and a function, goes by
value; the scheduler unpickles none of the rest and needs no strokestyle.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import queue
import sys
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import dask.config
from distributed import Client, Future, KilledWorker, WorkerPlugin, get_worker

from .. import __version__
from ..files import write_bytes
from ..mesh.beside import files_beside
from .outcome import Outcome
from .plan import Job
from .pool import NoWorkers
from .station import Errand, Parcel, Result

PATIENCE = 10  # seconds for the scheduler to answer
AHEAD = 2  # shapes under way for each of the workers' threads: one is drawn, one waits
MOST_BYTES = 256 * 2**20  # of shapes under way
LOOK = 2.0  # seconds between looks at which workers there are
TRIES = 2  # more of them, where a worker's disk is full and the like

Sent = TypeVar("Sent")


def by_value(thing: Sent) -> Sent:
    """Have a class or a function pickled as a whole, as those of a script are."""
    thing.__module__ = "__main__"
    return thing


def draw_on_cluster(
    errand: Errand, jobs: Sequence[Job], address: str, tell: Callable[[str], None]
) -> Iterator[Outcome]:
    """Draw shapes at the workers of a Dask scheduler; yields what became of each, in any order.

    Drawings are written here, whole or not at all, before their outcome is yielded. A shape whose
    worker is lost goes to another, as often as the scheduler's `allowed-failures` says. When the
    caller leaves off, the workers stop.

    Parameters
    ----------
    errand : how they are drawn
    jobs : what is drawn, in the order of their beginning
    address : of the scheduler, "tcp://host:8786"; Dask's configuration says what else it takes to
        reach it, such as the certificates of "tls://host:8786"
    tell : is called with what the person should know meanwhile, such as that there are no workers

    Raises
    ------
    OSError
        where the scheduler cannot be reached, or is lost; where a worker has no strokestyle, or
        another version of it, or of Python; where an input cannot be read.
    ValueError, MemoryError
        what `errand.prepare` raised there.
    """
    inputs = tuple(Path(name).read_bytes() for name in errand.inputs)
    with _quiet(), _connected(address) as client:
        run = f"strokestyle-{uuid.uuid4().hex}"
        _check_python(client)
        plugin = _Plugin(__version__, pickle.dumps((errand, inputs)))
        client.register_plugin(plugin, name=run)
        try:
            _check_plugin(client, run)
            yield from _Batch(client, run, errand, jobs, tell).outcomes()
        finally:
            with contextlib.suppress(Exception):  # the scheduler may be gone
                client.unsubscribe_topic(run)
                client.unregister_worker_plugin(run)


# ------------------------------------------------------------------------------ what goes by value


@by_value
class _Plugin(WorkerPlugin):
    """Has a station at each worker while the batch is drawn."""

    def __init__(self, version: str, packed: bytes):
        self.version, self.packed = version, packed
        self.station: Any = None
        self.refusal = ""

    def setup(self, worker: Any) -> None:
        try:
            import strokestyle
        except ImportError:
            self.refusal = f"has no strokestyle: install {self.version} of it there"
            return
        if strokestyle.__version__ != self.version:
            self.refusal = (
                f"has strokestyle {strokestyle.__version__}, and this is {self.version}: install "
                "the same there"
            )
            return
        try:
            from strokestyle.batch.station import Station

            errand, inputs = pickle.loads(self.packed)
            self.station = Station(errand, inputs, worker.local_directory)
        except Exception as error:
            self.refusal = f"cannot begin: {' '.join(f'{type(error).__name__}: {error}'.split())}"

    def teardown(self, worker: Any) -> None:
        if self.station:
            self.station.close()


@by_value
def _refusals(run: str, dask_worker: Any = None) -> str:
    """Why a worker cannot take part; "" where it can."""
    plugin = dask_worker.plugins.get(run)
    return plugin.refusal if plugin else "does not take plugins"


@by_value
def _draw_there(run: str, number: int, parcel: bytes) -> Any:
    """Draw a shape at the worker; a text says why that can draw none."""
    worker = get_worker()
    worker.log_event(run, number)
    plugin: Any = worker.plugins.get(run)
    if plugin is None or plugin.station is None:
        why = plugin.refusal if plugin else "does not take plugins"
        return f"the worker {worker.address} {why}"
    return plugin.station.draw(pickle.loads(parcel))


# ------------------------------------------------------------------------------------ the scheduler


class _Client(Client):
    def __del__(self) -> None:
        """Do nothing: one that never was connected would wait 20 s here for its own end."""


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Client]:
    file = address.endswith(".json")
    end = time.monotonic() + PATIENCE
    while file and not os.path.isfile(address):  # the scheduler may be starting
        if time.monotonic() > end:
            raise OSError(f"{address}: no such file; `dask scheduler --scheduler-file` writes it")
        time.sleep(0.05)
    where = {"scheduler_file" if file else "address": address}
    try:
        client = _Client(**where, timeout=PATIENCE, set_as_default=False, name="strokestyle")
    except Exception as error:  # Dask has many for it
        why = " ".join(str(error).split()) or type(error).__name__
        raise OSError(
            f"{address}: no Dask scheduler answers there ({why[:200]}); `dask scheduler` starts one"
        ) from None
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):
            client.close(timeout=PATIENCE)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep to ourselves what Dask logs; what matters of it becomes an error of ours."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {name: logging.getLogger(name).level for name in ("distributed", *names)}
    for name in levels:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}):
            yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _check_python(client: Client) -> None:
    """Raise OSError where a worker's Python is another: what goes by value is bytecode."""
    own = sys.version_info[:2]
    versions: Any = client.get_versions()
    for address, found in versions["workers"].items():
        python = str(found["host"]["python"]) if isinstance(found, dict) else ""
        if python and tuple(map(int, python.split(".")[:2])) != own:
            raise OSError(
                f"the worker {address} has Python {'.'.join(python.split('.')[:3])}, and this is "
                f"{own[0]}.{own[1]}: use the same"
            )


def _check_plugin(client: Client, run: str) -> None:
    for address, why in client.run(_refusals, run).items():
        if why:
            raise OSError(f"the worker {address} {why}")


# ---------------------------------------------------------------------------------------- the batch


class _Batch:
    """Shapes on their way: not all at once, or the scheduler would hold the bytes of all."""

    def __init__(
        self,
        client: Client,
        run: str,
        errand: Errand,
        jobs: Sequence[Job],
        tell: Callable[[str], None],
    ):
        self.client, self.run, self.errand, self.tell = client, run, errand, tell
        self.todo = deque(enumerate(jobs))
        self.failed: deque[Outcome] = deque()
        self.under_way: dict[int, tuple[Job, int, Future]] = {}
        self.begun: Counter[int] = Counter()
        self.done: queue.SimpleQueue[int] = queue.SimpleQueue()
        self.threads = 0
        self.told_of_none = False
        client.subscribe_topic(run, self._began)

    def outcomes(self) -> Iterator[Outcome]:
        """What became of each shape, as it is done."""
        self._look()
        while self.todo or self.under_way or self.failed:
            self._send()
            if self.failed:
                yield self.failed.popleft()
                continue
            try:
                number = self.done.get(timeout=LOOK)
            except queue.Empty:
                self._look()
                continue
            job, _, future = self.under_way.pop(number)
            self._send()  # none is idle while the caller is at it
            yield self._outcome(number, job, future)

    def _began(self, event: tuple[float, Any]) -> None:
        self.begun[event[1]] += 1

    def _look(self) -> None:
        """See how many workers there are."""
        if self.client.status != "running":
            raise _lost()
        self.threads = sum(self.client.nthreads().values())
        if not self.threads and not self.told_of_none:
            self.tell("no workers at the scheduler: waiting for some (`dask worker` starts one)")
        self.told_of_none = not self.threads

    def _send(self) -> None:
        most = max(1, AHEAD * self.threads)
        while self.todo and len(self.under_way) < most:
            number, job = self.todo[0]
            if self.under_way and self._bytes() + _size(job.shape) > MOST_BYTES:
                return
            self.todo.popleft()
            try:
                parcel = pickle.dumps(pack(job))
            except OSError as error:
                what = f"{job.shape}: {error.strerror or error}"
                self.failed.append(Outcome(job.shape, job.output, error=what, failure="error"))
                continue
            key = f"{self.run}-{number}"
            future = self.client.submit(
                _draw_there, self.run, number, parcel, key=key, pure=False, retries=TRIES
            )
            self.under_way[number] = job, len(parcel), future
            future.add_done_callback(lambda _, number=number: self.done.put(number))

    def _bytes(self) -> int:
        return sum(size for _, size, _ in self.under_way.values())

    def _outcome(self, number: int, job: Job, future: Future) -> Outcome:
        attempts = max(1, self.begun.pop(number, 1))
        try:
            result = future.result()
        except KilledWorker as error:
            attempts = error.allowed_failures + 1
            what = f"{job.shape}: its worker died {attempts} times"
            return Outcome(job.shape, job.output, error=what, failure="killed", attempts=attempts)
        except Exception as error:
            if future.status in ("cancelled", "lost") or self.client.status != "running":
                raise _lost() from None
            what = f"{job.shape}: {' '.join(f'{type(error).__name__}: {error}'.split())}"
            return Outcome(job.shape, job.output, error=what, failure="error", attempts=attempts)
        return self._arrived(job, result, attempts)

    def _arrived(self, job: Job, result: Result | str, attempts: int) -> Outcome:
        """Write what came back."""
        if isinstance(result, str):
            raise OSError(result)
        if isinstance(result.refused, NoWorkers):
            raise OSError(f"at a worker of the scheduler {result.refused}: its log says why")
        if result.refused:
            raise result.refused
        assert result.outcome is not None
        folders = (os.path.dirname(job.output), *self.errand.folders)
        try:
            for folder, name, data in result.files:
                write_bytes(os.path.join(folders[folder], name), data)
        except OSError as error:
            what = f"{error.filename}: {error.strerror}" if error.filename else str(error)
            return Outcome(job.shape, job.output, error=what, failure="error", attempts=attempts)
        return replace(result.outcome, attempts=max(attempts, result.outcome.attempts))


def _lost() -> OSError:
    return OSError("the scheduler is gone: start it again; the same command with --resume goes on")


def pack(job: Job) -> Parcel:
    """Read a shape and what lies beside it. Raises OSError where that cannot be done.

    A shape that is not there is sent as none: drawing it says so.
    """
    shape = Path(job.shape)
    paths = [shape, *files_beside(shape)] if shape.exists() else [shape]
    absolute = [os.path.abspath(path) for path in paths]
    root = os.path.commonpath([os.path.dirname(path) for path in absolute])
    names = [os.path.relpath(path, root).replace(os.sep, "/") for path in absolute]
    return Parcel(
        job,
        names[0],
        os.path.basename(job.output),
        (_folder(job.shape), _folder(job.output)),
        {name: path.read_bytes() for name, path in zip(names, paths, strict=True) if path.exists()},
    )


def _folder(path: str) -> str:
    """The folder of a file, with its separator at the end, as it is written before the name."""
    return path[: len(path) - len(os.path.basename(path))]


def _size(shape: str) -> int:
    try:
        return os.path.getsize(shape)
    except OSError:
        return 0
