"""Model files: a zip of .npy arrays and one JSON. Reading one runs no code and needs no torch, whose import costs more
than all the drawing."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path

import numpy as np

from .files import replace_file

VALUES = "model.json"


def write_model(path: str | Path, payload: dict) -> None:
    """Write nested dicts of arrays and JSON values. Same payload, same bytes; whole or not at all."""
    arrays, values = {}, {}
    _flatten(payload, "", arrays, values)

    def write(name):
        with zipfile.ZipFile(name, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr(_entry(VALUES), json.dumps(values, indent=1, allow_nan=False))
            for key, value in arrays.items():
                with file.open(_entry(key + ".npy"), "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, np.asarray(value, order="C"), allow_pickle=False)

    replace_file(path, write)


def read_model(path: str | Path) -> dict:
    """Read what `write_model` wrote, with the same nesting.

    Raises ValueError, naming the file, where it is no model, is cut short or damaged; OSError where unreadable.
    """
    path = Path(path)
    if path.is_dir():
        raise ValueError(f"{path}: a folder; expected a model written by `strokestyle fit`")
    with open(path, "rb") as file:
        head = file.read(4)
    if not head.startswith(b"PK"):
        raise ValueError(f"{path}: not a strokestyle model; expected a file written by `strokestyle fit`")
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path}: the model file is cut short; write it again with `strokestyle fit`")
    try:
        with zipfile.ZipFile(path) as file:
            names = file.namelist()
            if VALUES not in names:
                raise ValueError(f"{path}: not a strokestyle model; expected a file written by `strokestyle fit`")
            payload = {}
            for key, value in json.loads(file.read(VALUES)).items():
                _put(payload, key, value)
            for name in names:
                if name.endswith(".npy"):
                    with file.open(name) as stream:
                        _put(payload, name[:-4], np.lib.format.read_array(stream, allow_pickle=False))
    except (
        zipfile.BadZipFile, zlib.error, json.JSONDecodeError, UnicodeDecodeError, EOFError, LookupError, TypeError,
        AttributeError, NotImplementedError, MemoryError,
    ):  # fmt: skip
        raise _damaged(path) from None
    except ValueError as error:
        if str(path) in str(error):
            raise
        raise _damaged(path) from None
    return payload


def _damaged(path: Path) -> ValueError:
    return ValueError(f"{path}: a damaged strokestyle model; write it again with `strokestyle fit`")


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)  # dated 1980: the same bytes at any time
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _flatten(value, key: str, arrays: dict, values: dict) -> None:
    if isinstance(value, dict) and value:
        for name, part in value.items():
            _flatten(part, f"{key}/{name}" if key else name, arrays, values)
    elif isinstance(value, np.ndarray):
        arrays[key] = value
    else:
        values[key] = value


def _put(tree: dict, key: str, value) -> None:
    *parents, last = key.split("/")
    for name in parents:
        tree = tree.setdefault(name, {})
    tree[last] = value
