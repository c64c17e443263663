"""Zip archives of a mesh and the files beside it, as they are downloaded."""

from __future__ import annotations

import contextlib
import tempfile
import zipfile
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path, PurePosixPath

from ..files import quoted
from .messages import NotSupported

MAX_UNPACKED = 2**31  # bytes


@contextlib.contextmanager
def unpacked(path: Path, suffixes: Collection[str]) -> Iterator[Path]:
    """Unpack a zip archive for as long as the one mesh file in it is read.

    `suffixes` : those of mesh files

    Raises
    ------
    ValueError
        where it is damaged; NotSupported where it has no mesh file or several, or is too large
    """
    try:
        with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
            name = _the_mesh(archive, suffixes)
            if sum(entry.file_size for entry in archive.infolist()) > MAX_UNPACKED:
                raise NotSupported(f"larger than {MAX_UNPACKED // 2**30} GB unpacked: unpack it")
            archive.extractall(folder)
            inner = Path(folder) / name
            try:
                yield inner
            except (ValueError, OSError) as error:
                text = str(error).replace(f"{inner}: ", "")
                raise NotSupported(f"{quoted(name)!r} in it: {text}") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise zip_problem(path, error) from None
    except RuntimeError as error:  # zipfile's word for a password
        raise NotSupported(f"it is encrypted ({error}): unpack it first") from None


def zip_problem(path: Path, error: Exception) -> ValueError:
    """Make the error for a zip archive that cannot be read; its list of files is at its end."""
    with open(path, "rb") as file:
        begins = file.read(4) == b"PK\3\4"
    if begins and not zipfile.is_zipfile(path):
        return ValueError("cut short: the end of its zip archive is not there")
    return ValueError(f"its zip archive cannot be read: {error}")


def _the_mesh(archive: zipfile.ZipFile, suffixes: Collection[str]) -> str:
    """Find the one mesh file of an archive."""
    names = [
        name
        for name in archive.namelist()
        if not PurePosixPath(name).name.startswith(".")  # as of macOS, beside each file
    ]
    meshes = [name for name in names if PurePosixPath(name).suffix.lower() in suffixes]
    if len(meshes) > 1:
        few = ", ".join(quoted(name) for name in meshes[:3])
        raise NotSupported(f"{len(meshes)} meshes in it ({few}...): unpack it and name one")
    if not meshes:
        few = ", ".join(quoted(name) for name in names[:3])
        raise NotSupported(f"no mesh in the archive, only {few or 'nothing'}")
    return meshes[0]
