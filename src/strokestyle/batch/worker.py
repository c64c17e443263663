"""A worker process: it is told once how to draw, and then draws the shapes that it is sent.

It talks with its parent over the pipes that were its standard input and output. When its input
ends, its parent is no more, or wants it to stop: it stops at once, whatever it is at.
"""

from __future__ import annotations

import _thread
import os
import pickle
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import FrameType
from typing import Any, BinaryIO

from .memory import forget_peak, give_back, peak, resident
from .outcome import Outcome
from .plan import Job

# What a worker says first: that it can begin, or why no worker ever could.
READY, REFUSED = "ready", "refused"
PATIENCE = 1.0  # seconds for what it is at to be undone, when it stops


def command() -> list[str]:
    """The command line of a worker: this Python, which finds modules where this one does."""
    code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import main; main()"
    return [sys.executable, "-c", code]


def main() -> None:
    """Work until the parent closes the pipe."""
    orders, answers = _take_pipes()
    stopping = threading.Event()

    def interrupt(number: int, frame: FrameType | None) -> None:
        if stopping.is_set():  # else the terminal's, which the parent has got as well
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    _volunteer()
    inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(orders, inbox, stopping), daemon=True).start()
    try:
        _work(inbox, answers)
    except (KeyboardInterrupt, BrokenPipeError):
        pass
    os._exit(0)  # what is still to be freed goes with the process


def _work(inbox: queue.SimpleQueue[Any], answers: BinaryIO) -> None:
    prepare: Callable[[], Callable[[Job], Outcome]] | None = inbox.get()
    if prepare is None:
        return
    try:
        draw = prepare()
    except (ValueError, OSError, MemoryError) as error:
        _send(answers, (REFUSED, error))
        return
    _send(answers, (READY, resident(os.getpid())))
    while (job := inbox.get()) is not None:
        forget_peak()
        outcome = draw(job)
        outcome = replace(outcome, memory_mb=peak(), worker=str(os.getpid()))
        give_back()
        _send(answers, (outcome, None))


def _take_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Keep the pipes to ourselves: what libraries print goes to standard error."""
    orders, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return orders, answers


def _receive(orders: BinaryIO, inbox: queue.SimpleQueue[Any], stopping: threading.Event) -> None:
    """Pass on what the parent sends. When it sends no more, end this process."""
    try:
        while True:
            inbox.put(pickle.load(orders))
    except (EOFError, OSError, pickle.UnpicklingError):
        stopping.set()
        inbox.put(None)
        _interrupt_main()  # half-written files are removed on the way out
        time.sleep(PATIENCE)
        os._exit(1)


def _interrupt_main() -> None:
    if hasattr(signal, "pthread_kill"):  # a system call that waits is interrupted as well
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        _thread.interrupt_main()


def _send(answers: BinaryIO, message: Any) -> None:
    pickle.dump(message, answers)
    answers.flush()


def _volunteer() -> None:
    """Where the system runs out of memory, a worker is to go before its parent, or a shell."""
    try:
        with open("/proc/self/oom_score_adj", "w") as file:
            file.write("500")
    except OSError:
        pass
