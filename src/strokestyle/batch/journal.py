"""The journal of a folder of drawings: a line for each, what became of it; written by the parent.

A line is written in one piece and is on the disk before the next shape's is. What a kill cut short
is no line, and goes when the next run opens the journal.
"""

from __future__ import annotations

import codecs
import contextlib
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from .keys import content_digest
from .outcome import Outcome

NAME = "batch.jsonl"


class Journal:
    """The journal of a folder, open for more lines.

    A line stays until its drawing is made anew: `keep` says of which drawings lines go. So the
    journal tells of every drawing in the folder, once, however many runs made them; and several
    runs at the same time may write to it.

    Parameters
    ----------
    folder : that of the drawings
    keep : whether a line that is there stays

    Raises OSError where it cannot be written, ValueError where a file of that name is no journal.
    """

    def __init__(self, folder: str, keep: Callable[[Outcome], bool]):
        self.folder, self.path = folder, os.path.join(folder, NAME)
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        try:
            with _locked(self._file), _named(self.path):
                old = _read_all(self._file)
                kept = [one for one in _parse_journal(old, folder) if keep(one)]
                new = b"".join(self._line(one) for one in kept)
                if new != old:
                    # In this order a kill in between leaves old lines, none torn but the first.
                    _write_at(self._file, new, 0)
                    os.ftruncate(self._file, len(new))
                    os.fsync(self._file)
                self._end = len(new)
        except BaseException:
            self.close()
            raise

    def add(self, outcome: Outcome) -> None:
        """Append a line, on the disk when this returns. Raises OSError where there is no room.

        What another run has written of the same drawing meanwhile goes.
        """
        line = self._line(outcome)
        with _locked(self._file), _named(self.path):
            end = os.lseek(self._file, 0, os.SEEK_END)
            if end != self._end:  # another run writes too
                end = self._without_output(line, end)
            if end and _read_at(self._file, end - 1, 1) != b"\n":  # another run was killed at it
                line = b"\n" + line
            _write_at(self._file, line, end)
            os.fsync(self._file)
            self._end = end + len(line)

    def _without_output(self, line: bytes, end: int) -> int:
        """Take out the lines of what `line` is of; gives where the file ends then."""
        output = json.dumps({"output": json.loads(line)["output"]})[1:-1].encode()
        old = _read_at(self._file, 0, end)
        if output in old:
            lines = old.splitlines(keepends=True)
            new = b"".join(one for one in lines if output not in one)
            _write_at(self._file, new, 0)
            os.ftruncate(self._file, len(new))
            end = len(new)
        return end

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)

    def _line(self, outcome: Outcome) -> bytes:
        return outcome.to_json(self.folder).encode() + b"\n"


def read_journal(folder: str | Path) -> list[Outcome]:
    """Read the journal of a folder of drawings, a line for each drawing, in the order of the file.

    Their `output` and `files` are joined to the folder. Lines cut short by a kill are passed over.

    Raises
    ------
    FileNotFoundError
        where there is none.
    ValueError
        where the file holds lines, and none is of a journal.
    OSError
        where it cannot be read.
    """
    return _parse_journal((Path(folder) / NAME).read_bytes(), str(folder))


def _parse_journal(data: bytes, folder: str) -> list[Outcome]:
    found = parse_lines(data, folder)
    if data.strip() and not found and b"\n" in data:
        path = os.path.join(folder, NAME)
        raise ValueError(
            f"{path}: no journal of a batch, which `strokestyle render` writes; move it elsewhere"
        )
    return found


def parse_lines(data: bytes, folder: str) -> list[Outcome]:
    """Parse a journal's text; of two lines of one output the later holds."""
    last: dict[str, Outcome] = {}
    for line in data.removeprefix(codecs.BOM_UTF8).split(b"\n"):  # of an editor's
        with contextlib.suppress(ValueError):
            outcome = Outcome.from_json(line, folder)
            last.pop(outcome.output, None)
            last[outcome.output] = outcome
    return list(last.values())


def is_whole(outcome: Outcome) -> bool:
    """Whether all that was written of a shape is there, as it was written."""
    try:
        return outcome.drawn and outcome.digest == content_digest(outcome.files)
    except OSError:
        return False


@contextlib.contextmanager
def _named(path: str) -> Iterator[None]:
    """Have errors of the system name the file."""
    try:
        yield
    except OSError as error:
        error.filename = path
        raise


@contextlib.contextmanager
def _locked(file: int) -> Iterator[None]:
    """Hold other runs off the file; where the system or the disk has no locks, do without."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    held = False
    with contextlib.suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_EX)
        held = True
    try:
        yield
    finally:
        if held:
            fcntl.flock(file, fcntl.LOCK_UN)


def _read_all(file: int) -> bytes:
    return _read_at(file, 0, os.fstat(file).st_size)


def _read_at(file: int, start: int, count: int) -> bytes:
    os.lseek(file, start, os.SEEK_SET)
    parts = []
    while count > 0 and (data := os.read(file, count)):
        parts.append(data)
        count -= len(data)
    return b"".join(parts)


def _write_at(file: int, data: bytes, start: int) -> None:
    os.lseek(file, start, os.SEEK_SET)
    while data:
        data = data[os.write(file, data) :]
