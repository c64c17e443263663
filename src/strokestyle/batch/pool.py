"""Worker processes on one machine, any of which may die, hang or grow too large."""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..files import clear_parts
from ..geometry.threads import cores
from .memory import MB, installed, resident
from .outcome import Outcome
from .plan import Job
from .worker import PATIENCE, READY, REFUSED, command

Prepare = Callable[[], Callable[[Job], Outcome]]

ATTEMPTS = 3  # at a shape over which workers die
STARTS = 3  # workers one after the other that die before they can begin
LOOK = 0.05  # seconds from one look at the workers' memory to the next
REST = 0.5  # seconds that the parent waits at the most, so that it hears of Ctrl-C on Windows
MOST_WORKERS = 8  # where nobody says how many: of a larger machine others may want a share
WORKER_ROOM = 200 * MB  # what a worker takes with a small shape: libraries, style and drawing
ROOM_A_BYTE = 30  # bytes that a worker takes for each of a shape's file: of binary PLY 25, OBJ 13


@dataclass(frozen=True)
class Limits:
    """What one shape may cost.

    Parameters
    ----------
    seconds : how long it may take, by the clock; None for any time
    memory : bytes that its worker may have resident; None for any
    """

    seconds: float | None = None
    memory: int | None = None


def fitting_workers(sizes: Sequence[int]) -> int:
    """Choose how many workers draw shapes whose files have these bytes, where nobody says it.

    As many as there are cores and shapes, but no more than MOST_WORKERS, nor than half of this
    machine's memory holds at the largest shape.
    """
    most = min(MOST_WORKERS, cores(), len(sizes))
    memory = installed()
    if memory is not None:
        each = WORKER_ROOM + ROOM_A_BYTE * max(sizes, default=0)
        most = min(most, memory // 2 // each)
    return max(1, most)


class NoWorkers(OSError):
    """Workers die before they can begin."""


def draw_in_workers(
    prepare: Prepare,
    jobs: Sequence[Job],
    workers: int,
    limits: Limits | None = None,
    folders: Sequence[str] = (),
) -> Iterator[Outcome]:
    """Draw shapes in worker processes; yields what became of each as it is done, in any order.

    A shape whose worker dies is tried again, ATTEMPTS times in all, and another worker takes the
    place of the dead one. One that takes too long or too much memory costs its worker, and is not
    tried again; but too much memory in a worker that has drawn others, which may have left some,
    counts only in a new one. When the caller leaves off, or dies, the workers stop at once.

    Parameters
    ----------
    prepare : what a worker does first, once; gives what draws a shape. A function that pickle finds
        by its name.
    jobs : what is drawn, in the order of their beginning
    workers : how many processes at the same time
    limits : what a shape may cost
    folders : where they write besides the folders of the jobs' outputs: after a worker's death its
        half-written files are removed there

    Raises
    ------
    ValueError, OSError, MemoryError
        what `prepare` raised, and where it alone takes more memory than the limit.
    NoWorkers
        where none can be started.
    """
    pool = Pool(prepare, workers, limits or Limits(), folders, jobs)
    try:
        yield from pool.outcomes()
    finally:
        pool.stop()


class _Worker:
    """A process, what it is at, and a thread that hears what it says."""

    def __init__(self, prepare: Prepare, environment: dict[str, str], heard: queue.SimpleQueue):
        self.process = subprocess.Popen(
            command(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
        )
        self.task: _Task | None = None
        self.since = 0.0
        self.ready = False
        self.drawn = 0
        self.excess: str | None = None
        threading.Thread(target=self._hear, args=(heard,), daemon=True).start()
        self.send(prepare)

    def send(self, message: Any) -> None:
        """Send an order. A dead worker is not noticed here, but when its last word is heard."""
        assert self.process.stdin is not None
        try:
            pickle.dump(message, self.process.stdin)
            self.process.stdin.flush()
        except OSError:
            pass

    def begin(self, task: _Task) -> None:
        """Send a shape."""
        task.attempts += 1
        self.task, self.since = task, time.monotonic()
        self.send(task.job)

    def _hear(self, heard: queue.SimpleQueue) -> None:
        assert self.process.stdout is not None
        try:
            while True:
                heard.put((self, pickle.load(self.process.stdout)))
        except (EOFError, OSError, pickle.UnpicklingError):
            heard.put((self, None))
        self.process.stdout.close()
        self.process.wait()  # else one that nobody waits for stays as a zombie

    def close(self) -> None:
        """Send no more: a worker that lives stops."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.close()
        except OSError:  # what was still to be sent
            pass


@dataclass
class _Task:
    job: Job
    attempts: int = 0
    wants_new: bool = False  # a worker that has drawn nothing yet


class Pool:
    """The workers of `draw_in_workers`, which takes the same; they start as there is work."""

    def __init__(
        self,
        prepare: Prepare,
        workers: int,
        limits: Limits,
        folders: Sequence[str] = (),
        jobs: Sequence[Job] = (),
    ):
        self.prepare, self.limits, self.size, self.folders = prepare, limits, workers, folders
        self.todo = deque(_Task(job) for job in jobs)
        self.workers: set[_Worker] = set()
        self.heard: queue.SimpleQueue[tuple[_Worker, Any]] = queue.SimpleQueue()
        self.failed_starts = 0
        self.abandoned = False
        self.environment = _environment(workers)

    def draw(self, job: Job) -> Outcome:
        """Draw one more shape, where nothing else is drawn. Raises what `draw_in_workers` does."""
        self.todo.append(_Task(job))
        try:
            for outcome in self.outcomes():
                return outcome
        finally:
            self.todo.clear()
        raise NoWorkers("they were stopped")

    def abandon(self) -> None:
        """Kill all workers from another thread, for good: what is drawn comes to nothing."""
        self.abandoned = True
        for worker in list(self.workers):
            worker.process.kill()

    def outcomes(self) -> Iterator[Outcome]:
        """What became of each shape, as it is done."""
        while not self.abandoned and (self.todo or any(one.task for one in self.workers)):
            self._fill()
            try:
                worker, message = self.heard.get(timeout=self._rest())
            except queue.Empty:
                self._look()
                continue
            outcome = self._lost(worker) if message is None else self._answered(worker, message)
            self._look()
            if outcome:
                self._fill()  # none is idle while the caller is at it
                yield outcome

    def stop(self) -> None:
        """Stop all workers: soon by themselves, else by force."""
        for worker in self.workers:
            worker.close()
        end = time.monotonic() + 2 * PATIENCE
        for worker in self.workers:
            try:
                worker.process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                worker.process.kill()
                worker.process.wait()
            self._clear_after(worker)
        self.workers.clear()

    def _fill(self) -> None:
        """Begin a shape with every worker that is idle; start those that are wanting."""
        for worker in list(self.workers):
            if worker.ready and not worker.task and not worker.excess and self.todo:
                if task := self._task_for(worker):
                    worker.begin(task)
                else:
                    self._retire(worker)
        starting = sum(not worker.ready for worker in self.workers)
        while len(self.workers) < self.size and starting < len(self.todo):
            self.workers.add(_Worker(self.prepare, self.environment, self.heard))
            starting += 1

    def _task_for(self, worker: _Worker) -> _Task | None:
        for task in self.todo:
            if not (task.wants_new and worker.drawn):
                self.todo.remove(task)
                return task
        return None

    def _retire(self, worker: _Worker) -> None:
        worker.close()
        self.workers.discard(worker)

    def _answered(self, worker: _Worker, message: Any) -> Outcome | None:
        first, second = message
        if first == REFUSED:
            raise second
        if first == READY:
            worker.ready, self.failed_starts = True, 0
            self._check_room(second or 0)
            return None
        task, worker.task = worker.task, None
        worker.drawn += 1
        assert task is not None
        return replace(first, attempts=task.attempts)

    def _check_room(self, taken: int) -> None:
        if self.limits.memory and taken > self.limits.memory:
            raise ValueError(
                f"a worker takes {_size(taken)} before it draws anything, more than the "
                f"{_size(self.limits.memory)} that it may have"
            )

    def _lost(self, worker: _Worker) -> Outcome | None:
        """A worker is dead: its shape goes to the next one, or is given up."""
        worker.close()
        code = worker.process.wait()
        if worker not in self.workers:  # retired
            return None
        self.workers.discard(worker)
        self._clear_after(worker)
        task = worker.task
        if task is None:
            self.failed_starts += not worker.ready
            if self.failed_starts >= STARTS:
                raise NoWorkers(f"{STARTS} workers died before they could begin ({_cause(code)})")
            return None
        grown = worker.excess == "memory" and worker.drawn > 0
        if grown or (not worker.excess and task.attempts < ATTEMPTS):
            task.wants_new |= grown
            self.todo.appendleft(task)
            return None
        return self._given_up(worker, task, code)

    def _given_up(self, worker: _Worker, task: _Task, code: int) -> Outcome:
        why, failure = {
            "timeout": (f"not drawn in {self.limits.seconds or 0:g} s", "timeout"),
            "memory": (f"needs more than {_size(self.limits.memory)} of memory", "memory"),
            None: (f"its worker died {task.attempts} times ({_cause(code)})", "killed"),
        }[worker.excess]
        return Outcome(
            task.job.shape,
            task.job.output,
            seconds=time.monotonic() - worker.since,
            error=f"{task.job.shape}: {why}",
            failure=failure,
            attempts=task.attempts,
            worker=str(worker.process.pid),
        )

    def _clear_after(self, worker: _Worker) -> None:
        if worker.task:
            for folder in {os.path.dirname(worker.task.job.output) or ".", *self.folders}:
                clear_parts(folder, worker.process.pid)

    def _rest(self) -> float:
        """How long nothing need be looked at."""
        if self.limits.memory:
            return LOOK
        if self.limits.seconds is None:
            return REST
        ends = [worker.since + self.limits.seconds for worker in self.workers if worker.task]
        return max(0.0, min(REST, min(ends, default=REST + time.monotonic()) - time.monotonic()))

    def _look(self) -> None:
        """Kill the workers that have had too much. What comes of it is heard as of any death."""
        for worker in self.workers:
            if worker.task and not worker.excess and (excess := self._excess(worker)):
                worker.excess = excess
                worker.process.kill()

    def _excess(self, worker: _Worker) -> str | None:
        limits = self.limits
        if limits.seconds is not None and time.monotonic() - worker.since > limits.seconds:
            return "timeout"
        if limits.memory and (resident(worker.process.pid) or 0) > limits.memory:
            return "memory"
        return None


def _environment(workers: int) -> dict[str, str]:
    """Share the cores among the workers, unless the person says how many threads they may have."""
    threads = str(max(1, cores() // max(1, workers)))
    return {"OMP_NUM_THREADS": threads, **os.environ}


def _cause(code: int) -> str:
    if code == -getattr(signal, "SIGKILL", 0):
        return "killed, perhaps for want of memory"
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def _size(memory: int | None) -> str:
    size = memory or 0
    return f"{size / MB:.0f} MB" if size >= MB else f"{size / 1024:.0f} kB"
