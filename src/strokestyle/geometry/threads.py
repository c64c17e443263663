"""Work that is shared by threads, where most of it is numpy's or zlib's, which let others run."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Made = TypeVar("Made")
Other = TypeVar("Other")


def each(function: Callable[[Item], Made], items: Iterable[Item]) -> list[Made]:
    """Call a function on each of some items, in as many threads as `threads` says.

    What it gives lies in the order of the items, so how many threads there are changes nothing.
    Raises what the function raises.
    """
    items = list(items)
    return list(in_turn(function, items) if len(items) > 1 else map(function, items))


def in_turn(function: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[Made]:
    """Yield what `each` gives, one after the other; no more is made ahead than there are threads.

    Items are taken in the caller's thread.
    """
    count = threads()
    if count < 2:
        yield from map(function, items)
        return
    with ThreadPoolExecutor(count) as pool:
        ahead: deque[Future[Made]] = deque()
        for item in items:
            ahead.append(pool.submit(function, item))
            if len(ahead) > count:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


def at_once(one: Callable[[], Made], other: Callable[[], Other]) -> tuple[Made, Other]:
    """Do two pieces of work at once, or one after the other where `threads` says 1.

    The first is done in the caller's own thread. Returns what both return. Raises what the first
    raises, or else the second, once both are over.
    """
    if threads() < 2:
        return one(), other()
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(other)
        return one(), waiting.result()


def threads() -> int:
    """Say how many threads may compute at a time: OMP_NUM_THREADS where it is set, else `cores`.

    The workers of a batch have it set, so that they share the cores.
    """
    said = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    return max(1, int(said)) if said.isdecimal() else cores()


def cores() -> int:
    """Count the cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS, Windows
        return os.cpu_count() or 1
