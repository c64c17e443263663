"""The one door to mesh files: `read_mesh`, and which reader stands behind it for each format."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from .archive import unpacked
from .formats import what_was_saved
from .messages import NotSupported, naming
from .read_with_meshio import FORMATS
from .read_with_trimesh import one_line, read_with_trimesh
from .triangles import Triangles

# The reader of each format: a module, and its function of that name. They are imported when a file
# is theirs: all of them take as long as to read a mesh of 5,000 faces.
READERS = {".obj": "read_obj", ".off": "read_off", ".ply": "read_ply", ".stl": "read_stl"}
# formats of several files, or with some beside them: their readers are given the path
SCENES = {".gltf": "read_gltf", ".glb": "read_gltf", ".vrm": "read_gltf", ".3mf": "read_3mf"}
SCENES |= {".dae": "read_dae", ".zae": "read_dae"}
SCENES |= dict.fromkeys((".step", ".stp", ".iges", ".igs"), "read_step")
SCENES |= dict.fromkeys(FORMATS, "read_with_meshio")
_HEAD = 1000  # bytes that tell a web page
# what a damaged file makes a reader of ours, or the library behind it, fail with
_DAMAGE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError)


def read_mesh(path: str | Path) -> Triangles:
    """Read all parts of a mesh file, a scene's transforms applied.

    docs/meshes.md says who reads which format, and why; benchmarks/mesh_files.py prints its figures
    again.

    Raises
    ------
    OSError
        where the file cannot be opened
    ValueError
        where it is empty, damaged or holds no faces. Either is one line that names the file.

    Warns of what is left out (MeshWarning), in one line that names the file.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path}: a folder, not a mesh file")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.stat().st_size:
        raise ValueError(f"{path}: the file is empty")
    with naming(path):
        found = _read(path)
    if not len(found.faces):
        if len(found.vertices):
            raise ValueError(
                f"{path}: no faces in it ({len(found.vertices)} points): a point cloud cannot be "
                "drawn; mesh it first"
            )
        raise ValueError(
            f"{path}: no faces in it: damaged, or not in {path.suffix.lower()[1:]} format"
        )
    return found


def _read(path: Path) -> Triangles:
    """What is in a file, with or without faces."""
    suffix = path.suffix.lower()
    if suffix not in READERS and suffix not in SCENES and suffix != ".zip":
        return read_with_trimesh(path)
    try:
        with open(path, "rb") as file:
            other = what_was_saved(file.read(_HEAD))
        if other:
            raise NotSupported(other)
        if suffix == ".zip":
            with unpacked(path, {*READERS, *SCENES}) as inner:
                return _read(inner)
        if suffix in SCENES:
            return _reader(SCENES[suffix])(path)
        return _reader(READERS[suffix])(path.read_bytes())
    except OSError as error:
        if str(error).startswith(str(path)):
            raise
        raise type(error)(f"{path}: cannot be read ({one_line(error)})") from None
    except NotSupported as error:
        raise ValueError(f"{path}: {error}") from None
    except _DAMAGE as error:
        text = " ".join(str(error).split())
        if not isinstance(error, ValueError):
            text = f"{type(error).__name__}: {one_line(error)}"
        what = f"damaged, or not in {suffix[1:]} format"
        raise ValueError(f"{path}: {what} ({text})") from None


def _reader(name: str) -> Callable[[Any], Triangles]:
    """Import the reader of that name."""
    return getattr(import_module(f".{name}", __package__), name)
