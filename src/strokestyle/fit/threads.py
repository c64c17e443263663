"""Do independent pieces of work at once.

Most of a fit is spent in calls of numpy and scipy that let go of the interpreter's lock, so that
threads keep more than one core busy without anything being copied. What is done does not depend on
how many threads do it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

A = TypeVar("A")
B = TypeVar("B")


def at_once(one: Callable[[], A], other: Callable[[], B]) -> tuple[A, B]:
    """Do two pieces of work at once, the first in the caller's own thread.

    Returns what both return. Raises what the first raises, or else the second, once both are over.
    """
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(other)
        return one(), waiting.result()


def each_at_once(work: Callable[[A], B], items: Iterable[A]) -> list[B]:
    """Do the same work for all items, as many at once as there are cores; results in order."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return list(pool.map(work, items))
