"""Digests: whether a drawing that is there is the one that would be made."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..mesh.beside import files_beside

LENGTH = 16  # bytes of a digest
CHUNK = 2**20


def settings_key(settings: Mapping[str, Any]) -> str:
    """Digest of how the shapes of a batch are drawn.

    A text that is the name of a file (the model, a camera, curves) counts by the file's content:
    one that has changed makes another key, one that was moved the same.

    Raises OSError where such a file cannot be read.
    """
    return _digest([json.dumps(_settled(settings), sort_keys=True, default=str).encode()])


def shape_key(settings: str, shape: str) -> str:
    """Digest of all that decides the bytes of a shape's drawing; "" where that is no regular file.

    By content: a mesh that was only touched, copied or checked out anew has the same. The name
    counts without its folder, since it is the drawing's title.

    Raises OSError where the shape cannot be read.

    `settings` : what `settings_key` gave
    """
    content = content_digest([shape, *map(str, files_beside(shape))])
    if not content:
        return ""
    name = Path(shape).name.encode("utf-8", "surrogateescape")
    return _digest([settings.encode(), name, content.encode()])


def content_digest(files: Iterable[str]) -> str:
    """Digest of the contents of files, one after the other; "" where one is no regular file.

    A pipe or a device is not opened: it could be read but once, or would wait for ever.

    Raises OSError where one cannot be read.
    """
    whole = []
    for name in files:
        if not stat.S_ISREG(os.stat(name).st_mode):
            return ""
        one = hashlib.blake2b(digest_size=LENGTH)
        with open(name, "rb") as file:
            while data := file.read(CHUNK):
                one.update(data)
        whole.append(one.digest())
    return _digest(whole)


def _settled(value: Any) -> Any:
    """Values of JSON for settings; a file's digest in place of its name."""
    if isinstance(value, Mapping):
        return {str(name): _settled(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_settled(one) for one in value]
    if isinstance(value, str) and os.path.isfile(value):
        return content_digest([value])
    return value


def _digest(parts: Iterable[bytes]) -> str:
    whole = hashlib.blake2b(digest_size=LENGTH)
    for part in parts:
        whole.update(len(part).to_bytes(8, "little") + part)
    return whole.hexdigest()
