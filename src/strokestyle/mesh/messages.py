"""What a person is told about a mesh file: warnings, and errors that are whole sentences."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np


class MeshWarning(UserWarning):
    """What of a mesh file is not drawn, or not drawn as the file asks; one line."""


class NotSupported(ValueError):
    """A file is sound, but holds what is not read here; says what would do."""


def warn(text: str) -> None:
    """Warn of what is left out of a mesh; `naming` puts the file's name before it."""
    warnings.warn(text, MeshWarning, stacklevel=3)


def counted(found: Counter[str]) -> str:
    """List kinds of things in the plural, and how many there are: "lines (3), beams (1)"."""
    return ", ".join(f"{what} ({count})" for what, count in found.items())


def only_lines(lines: int) -> NotSupported:
    """Make the error for a file of so many lines and no faces."""
    return NotSupported(
        f"no faces in it ({lines} line{'s' * (lines != 1)}): lines cannot be drawn; make pipes or "
        "other faces of them, and export it again"
    )


@contextlib.contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Name a file in the MeshWarnings of what is done within; the same one is given once."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", MeshWarning)
        yield
    for text, category in dict.fromkeys((str(one.message), one.category) for one in found):
        if issubclass(category, MeshWarning) and not text.startswith(str(path)):
            text = f"{path}: {text}"
        warnings.warn(text, category, stacklevel=4)


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Keep what another library logs, warns of or prints from the terminal, C code's prints too.

    Only our own MeshWarnings pass.
    """
    logged = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), _nowhere():
            warnings.simplefilter("ignore")
            warnings.simplefilter("default", MeshWarning)
            yield
    finally:
        logging.disable(logged)


@contextlib.contextmanager
def _nowhere() -> Iterator[None]:
    """Send what is printed nowhere: by Python, and by C code, which writes to files 1 and 2."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):  # closed, or no stream
            stream.flush()
    with open(os.devnull, "w") as null, contextlib.ExitStack() as later:
        for number in (1, 2):
            with contextlib.suppress(OSError):  # closed
                before = os.dup(number)
                later.callback(os.close, before)
                later.callback(os.dup2, before, number)
                os.dup2(null.fileno(), number)
        with contextlib.redirect_stdout(null), contextlib.redirect_stderr(null):
            yield
