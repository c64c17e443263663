"""Files: whole or not at all, within limits; and zips of arrays."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import re
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

# What a file from anywhere may hold.
MAX_BYTES = 64 * 2**20  # an .svgz's once decompressed
MAX_POINTS = 500_000
MAX_CURVES = 50_000
MAX_ELEMENTS = 100_000
MAX_ATTRIBUTES = 500_000
MAX_DEPTH = 256  # of elements inside one another
MAX_TEXT = 16 * 2**20  # characters of one path


def replace_file(path: str | Path, write: Callable[[str], None]) -> None:
    """Write a file whole or not at all: under a temporary name beside it, renamed at the end.

    Whatever goes wrong, an older file at `path` stays as it was and nothing is left beside it.
    Raises OSError, naming `path`, where its folder is missing or cannot be written.

    `write` : called with the temporary name
    """
    path = Path(path)
    check_writable(path)
    prefix = f".{path.name[:40]}.{_writer(os.getpid())}-"
    name = None
    try:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=".part", dir=path.parent)
        os.close(handle)
        write(name)
        os.chmod(name, (path.stat().st_mode if path.exists() else 0o666 & ~_umask()) & 0o777)
        os.replace(name, path)
    except BaseException as error:
        if name:
            Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError) and error.strerror:
            if not name or error.filename in (None, name):  # a full disk: no name, or not the one
                raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def clear_parts(folder: str | Path, process: int | None = None) -> None:
    """Remove what killed processes left half-written in a folder, under its temporary names.

    Files of other computers, which may share the folder, and of processes that live stay. What
    cannot be removed stays as well.

    `process` : where given, the number of a process that is no more: only its files go
    """
    try:
        names = os.listdir(folder)
    except OSError:
        return
    for name in names:
        if found := _PART.fullmatch(name):
            host, writer = found[1], int(found[2])
            gone = writer == process if process is not None else not _lives(writer)
            if host == _host() and gone:
                with contextlib.suppress(OSError):
                    os.unlink(os.path.join(folder, name))


_PART = re.compile(r"\..*\.([0-9a-f]{8})-([0-9]+)-[^.]*\.part", re.DOTALL)


def _writer(process: int) -> str:
    return f"{_host()}-{process}"


def _host() -> str:
    return f"{zlib.crc32(platform.node().encode('utf-8', 'replace')):08x}"


def _lives(process: int) -> bool:
    """Whether a process of this computer lives; where the system does not tell, it does."""
    if os.name == "nt":  # there, signal 0 would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""

    def write(name: str) -> None:
        with open(name, "wb") as file:
            file.write(data)

    replace_file(path, write)


def check_writable(path: str | Path) -> None:
    """Raise OSError, naming `path`, unless a file can be written there. Ask before long work."""
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path}: is a folder; give the name of a file")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"{path}: the folder {path.parent} cannot be written")


def check_output(path: str | Path, inputs: Iterable[str | Path] = ()) -> None:
    """Check that a file can be written and that none of the inputs is overwritten by it.

    Raises OSError where it cannot be written, ValueError where it is an input; either names `path`.
    """
    check_writable(path)
    with contextlib.suppress(FileNotFoundError):
        os.lstat(path)  # there are names that no file can have
    try:
        with tempfile.TemporaryFile(dir=Path(path).parent):  # more than the rights tell
            pass
    except OSError as error:
        raise OSError(
            error.errno, f"no file can be made there ({error.strerror})", str(path)
        ) from None
    for source in inputs:
        if Path(path).exists() and Path(source).exists() and os.path.samefile(path, source):
            raise ValueError(f"{path}: is the input; give the output another name")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


VALUES = "model.json"


def write_arrays(
    path: str | Path,
    arrays: dict[str, np.ndarray],
    texts: dict[str, str] | None = None,
    compressed: bool = True,
) -> None:
    """Write arrays as numpy's .npz has them, whole or not at all; `texts` lie before them.

    The same arrays make the same bytes. np.savez_compressed takes four times as long, and writes
    the time of day.
    """

    def write(name: str) -> None:
        method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
        with zipfile.ZipFile(name, "w") as file:
            for key, text in (texts or {}).items():
                file.writestr(_entry(key, method), text)
            for key, value in arrays.items():
                entry = _entry(key + ".npy", method)
                with file.open(entry, "w", force_zip64=True) as stream:
                    np.lib.format.write_array(
                        stream, np.asarray(value, order="C"), allow_pickle=False
                    )

    replace_file(path, write)


def write_model(path: str | Path, payload: dict[str, Any], compressed: bool = True) -> None:
    """Write nested dicts of arrays and JSON values, whole or not at all.

    The same values make the same bytes.
    """
    arrays: dict[str, np.ndarray] = {}
    values: dict[str, Any] = {}
    _flatten(payload, "", arrays, values)
    write_arrays(path, arrays, {VALUES: json.dumps(values, indent=1, allow_nan=False)}, compressed)


def read_model(path: str | Path) -> dict[str, Any]:
    """Read what `write_model` wrote, with the same nesting.

    Raises
    ------
    ValueError
        naming the file, where it is no model, is cut short or damaged
    OSError
        where it cannot be read
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: a folder; expected a model written by `strokestyle fit`")
    with open(path, "rb") as file:
        head = file.read(4)
    if not head.startswith(b"PK"):
        raise _no_model(path)
    if not zipfile.is_zipfile(path):
        raise ValueError(
            f"{path}: the model file is cut short; write it again with `strokestyle fit`"
        )
    try:
        with zipfile.ZipFile(path) as archive:
            if VALUES in archive.namelist():
                return _payload(archive)
    except (
        zipfile.BadZipFile, zlib.error, EOFError, LookupError, TypeError, ValueError,
        AttributeError, NotImplementedError, MemoryError,
    ):  # fmt: skip
        raise ValueError(
            f"{path}: a damaged strokestyle model; write it again with `strokestyle fit`"
        ) from None
    raise _no_model(path)


def _payload(archive: zipfile.ZipFile) -> dict[str, Any]:
    """Put the values and the arrays of a zip together again."""
    payload: dict[str, Any] = {}
    for key, value in json.loads(archive.read(VALUES)).items():
        _put(payload, key, value)
    for name in archive.namelist():
        if name.endswith(".npy"):
            with archive.open(name) as stream:
                array = np.lib.format.read_array(stream, allow_pickle=False)
            _put(payload, name[:-4], array)
    return payload


def _no_model(path: Path) -> ValueError:
    return ValueError(
        f"{path}: not a strokestyle model; expected a file written by `strokestyle fit`"
    )


def _entry(name: str, method: int) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)  # dated 1980: the same bytes at any time
    entry.compress_type = method
    return entry


def _flatten(value: Any, key: str, arrays: dict[str, np.ndarray], values: dict[str, Any]) -> None:
    """Take nested dicts apart: arrays and other values by their path, "a/b"."""
    if isinstance(value, dict) and value:
        for name, part in value.items():
            _flatten(part, f"{key}/{name}" if key else name, arrays, values)
    elif isinstance(value, np.ndarray):
        arrays[key] = value
    else:
        values[key] = value


def _put(tree: dict[str, Any], key: str, value: Any) -> None:
    """Put a value where its path says, what `_flatten` took apart."""
    *parents, last = key.split("/")
    for name in parents:
        tree = tree.setdefault(name, {})
    tree[last] = value


def limited(data: bytes) -> bytes:
    """Unpack the bytes of a file where they are gzip data.

    Raises ValueError on more than MAX_BYTES, or on damage.
    """
    if len(data) <= MAX_BYTES and data[:2] == b"\x1f\x8b":
        data = _unzip(data)
    if len(data) > MAX_BYTES:
        raise ValueError(
            f"larger than {MAX_BYTES // 2**20} MB: simplify the curves, or take images out, and "
            "save again"
        )
    return data


def _unzip(data: bytes) -> bytes:
    unpack = zlib.decompressobj(wbits=31)
    try:
        text = unpack.decompress(data, MAX_BYTES + 1)
    except zlib.error as error:
        raise ValueError(f"damaged gzip data ({error}); save it again, as .svg") from None
    if len(text) <= MAX_BYTES and not unpack.eof:
        raise ValueError("its gzip data end early: the file is cut short; save it again, as .svg")
    return text


def quoted(text: str) -> str:
    """Cut a file's text to what an error may quote: 40 characters, all of them printable."""
    return "".join(c if c.isprintable() else "?" for c in text[:40])
