"""What the user is told on stderr: results, how long stages took, and one line for an error."""

from __future__ import annotations

import contextlib
import time
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from ..geometry.curves import Curves

VERBOSITY = "strokestyle.verbosity"  # in click's `meta`: -1 with -q, 1 with -v


def verbosity() -> int:
    """How much the user wants to hear: -1 errors only, 0 results too, 1 the stages' times too."""
    context = click.get_current_context(silent=True)
    return context.meta.get(VERBOSITY, 0) if context else 0


_heard: list[tuple[int, str]] | None = None
_aloud = True


def say(text: str = "", level: int = 0) -> None:
    """Tell the user on stderr; `level` 1 only with -v, and nothing with -q but what has -1."""
    if _heard is not None:
        _heard.append((level, text))
    if _aloud and verbosity() >= level:
        with contextlib.suppress(OSError):  # a full disk under a log stops no work
            click.echo(text, err=True)


@contextlib.contextmanager
def listening(aloud: bool = True) -> Iterator[list[tuple[int, str]]]:
    """Give what is said within, and its levels; not `aloud`, it is left to another to say."""
    global _heard, _aloud
    before = _heard, _aloud
    heard: list[tuple[int, str]] = []
    _heard, _aloud = heard, aloud and _aloud
    try:
        yield heard
    finally:
        _heard, _aloud = before
        if _heard is not None:
            _heard += heard


def is_aloud() -> bool:
    """Whether what is said now reaches the person at once."""
    return _aloud


class timed:
    """`with timed("lines"):` says with -v how long that took."""

    def __init__(self, name: str):
        self.name = name

    def __enter__(self) -> None:
        self.start = time.perf_counter()

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            say(f"  {self.name}: {time.perf_counter() - self.start:.2f} s", level=1)


@contextlib.contextmanager
def told_warnings() -> Iterator[None]:
    """Tell the user, a line each, what the library warns of within: what a mesh is drawn without.

    After an error nothing but the error is told. What Python itself and numpy warn of is dropped.
    """
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", UserWarning)
        yield
    ours = [str(one.message) for one in found if issubclass(one.category, UserWarning)]
    for text in dict.fromkeys(ours):
        say(f"warning: {' '.join(text.split())}")


def describe(error: BaseException) -> str:
    """An error of the library or the system as one line for the person."""
    if isinstance(error, MemoryError):
        return "out of memory: try a smaller --size or a simplified mesh"
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        text = f"{error.filename}: {error.strerror[0].lower()}{error.strerror[1:]}"
    else:
        text = str(error) or type(error).__name__
    return " ".join(text.split())


def count_curves(curves: Curves, total: int | None = None) -> str:
    """Number, length and kinds of curves: "41 curves, 5312 px (contour 20, valley 21)".

    Where they are the pieces left of another number of curves, `total`, it is told: "41 curves of
    50 ...".
    """
    import numpy as np

    from ..geometry.kinds import KINDS

    if not len(curves):
        return "no curves"
    counts = np.bincount(curves.kind, minlength=len(KINDS))
    kinds = ", ".join(f"{name} {n}" for name, n in zip(KINDS, counts, strict=True) if n)
    plural = "s" if len(curves) > 1 else ""
    of = "" if total in (None, len(curves)) else f" of {total}"
    return f"{len(curves)} curve{plural}{of}, {curves.lengths().sum():.0f} px ({kinds})"
