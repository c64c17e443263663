"""Bytes that wait on the disk until all are there."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator


class Spool:
    """A list of bytes, in a file without a name that is gone with this object.

    Memory holds no more than one item at a time. Used as a context.
    """

    def __init__(self) -> None:
        self._ends = [0]
        self._file = tempfile.TemporaryFile(prefix="strokestyle-")

    def __len__(self) -> int:
        return len(self._ends) - 1

    def add(self, item: bytes) -> None:
        """Put an item at the end."""
        self._file.seek(self._ends[-1])
        self._file.write(item)
        self._ends.append(self._ends[-1] + len(item))

    def __iter__(self) -> Iterator[bytes]:
        for start, end in zip(self._ends, self._ends[1:], strict=False):
            self._file.seek(start)
            yield self._file.read(end - start)

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()
