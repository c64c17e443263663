"""Writing files so that nothing is ever half-written: to a temporary file beside the target, then renamed over it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path


def replace_file(path: str | Path, write: Callable[[str], None]) -> None:
    """Call `write(name)` with the name of a temporary file in the folder of `path`, then rename it to `path`.

    Whatever goes wrong, an older file at `path` stays as it was and nothing is left beside it.
    Raises OSError, naming `path`, where its folder is missing or cannot be written.
    """
    path = Path(path)
    check_writable(path)
    handle, name = tempfile.mkstemp(prefix=f".{path.name[:40]}.", suffix=".part", dir=path.parent)
    os.close(handle)
    try:
        write(name)
        os.chmod(name, (path.stat().st_mode if path.exists() else 0o666 & ~_umask()) & 0o777)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""

    def write(name):
        with open(name, "wb") as file:
            file.write(data)

    replace_file(path, write)


def check_writable(path: str | Path) -> None:
    """Raise OSError, naming `path`, unless a file can be written there. Asked before long work, not only after it."""
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path}: is a folder; give the name of a file")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: the folder {path.parent} cannot be written")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
