"""Read the meshes of simulations (gmsh, VTK, Abaqus, Nastran, ...) with meshio."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .messages import NotSupported, counted, silence, warn
from .pieces import Piece, check_corners, together
from .polygons import cut_polygons
from .triangles import Triangles

# What meshio 5.3.5 reads of faces in space, and what other package it needs for that.
FORMATS = {
    ".msh": "", ".vtk": "", ".vtu": "", ".inp": "", ".bdf": "", ".nas": "", ".fem": "",
    ".mesh": "", ".meshb": "", ".su2": "", ".vol": "", ".avs": "", ".xdmf": "h5py", ".xmf": "h5py",
    ".mdpa": "", ".tec": "", ".post": "", ".dato": "", ".f3grid": "", ".med": "h5py",
    ".h5m": "h5py", ".e": "netCDF4", ".exo": "netCDF4", ".ex2": "netCDF4",
}  # fmt: skip
_FLAT = {"triangle": 3, "quad": 4}  # how many of a cell's nodes are corners
# The faces of solid cells, in meshio's (VTK's) order of corners; from outside, counter-clockwise.
_SOLID: dict[str, list[list[int]]] = {
    "tetra": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    "pyramid": [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    "wedge": [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "hexahedron": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                   [3, 0, 4, 7]],
}  # fmt: skip
_NO_FACES = ("vertex", "line")


def read_with_meshio(path: Path) -> Triangles:
    """Read the surface of a mesh for simulation: its faces, and where its solid cells end.

    A face between two solid cells is inside and left out. Physical groups of gmsh are parts.

    Raises
    ------
    OSError
        where it cannot be opened
    ValueError
        where it is damaged; NotSupported where meshio or what it needs is not there
    """
    mesh = _loaded(path)
    points = np.asarray(mesh.points, np.float64)
    if points.ndim != 2:
        raise ValueError(f"its points are of shape {points.shape}")
    points = np.pad(points, ((0, 0), (0, max(0, 3 - points.shape[1]))))[:, :3]
    flat, solid = _faces(mesh)
    pieces = list(_pieces(points, flat, solid))
    if not pieces:
        kinds = Counter({block.type: len(block.data) for block in mesh.cells})
        only = ", ".join(f"{count} cells of {kind}" for kind, count in kinds.items())
        raise NotSupported(f"no faces in it, only {only or f'{len(points)} points'}")
    return together(pieces)


def _loaded(path: Path) -> Any:
    """Read the file: meshio's own mesh."""
    suffix = path.suffix.lower()
    _check_dataset(path)
    try:
        import meshio
    except ImportError:
        raise _lacks(suffix, f"meshio {FORMATS[suffix]}".strip()) from None
    try:
        with silence():
            return meshio.read(path)
    except ImportError as error:
        raise _lacks(suffix, f"meshio {error.name or FORMATS[suffix]}".strip()) from None
    except OSError:
        raise
    except (Exception, SystemExit) as error:  # where no reader works it ends the process
        what = "" if isinstance(error, SystemExit) else " ".join(str(error).split())
        raise NotSupported(
            f"meshio cannot read it{f' ({what[:80]})' if what else ''}: damaged, or of a kind that "
            f"it does not know; save it as .vtu, .ply or .stl from the program that made it"
        ) from None


def _check_dataset(path: Path) -> None:
    """Raise NotSupported for a VTK file of a kind that meshio does not read."""
    with open(path, "rb") as file:
        head = file.read(1000).upper()
    if path.suffix.lower() == ".vtk" and b"DATASET POLYDATA" in head:
        raise NotSupported(
            "VTK of the kind POLYDATA is not read: save it as .ply (in ParaView: File > Save Data)"
        )


def _lacks(suffix: str, packages: str) -> NotSupported:
    return NotSupported(f"reading {suffix} files needs another package: pip install {packages}")


def _faces(mesh: Any) -> tuple[list[tuple[np.ndarray, str]], list[tuple[np.ndarray, str]]]:
    """Collect faces (F, N) of N corners and the name of their group, of flat and of solid cells."""
    flat: list[tuple[np.ndarray, str]] = []
    solid: list[tuple[np.ndarray, str]] = []
    left_out: Counter[str] = Counter()
    for number, block in enumerate(mesh.cells):
        kind = block.type.rstrip("0123456789")
        for rows, name in _by_group(mesh, number):
            cells = block.data[rows]
            if kind in _FLAT:
                flat.append((np.asarray(cells)[:, : _FLAT[kind]], name))
            elif kind == "polygon":
                flat.append((np.asarray(cells), name))
            elif kind in _SOLID:
                solid += [(np.asarray(cells)[:, face], name) for face in _SOLID[kind]]
            elif kind not in _NO_FACES:
                left_out[kind] += len(cells)
    if left_out:
        warn(f"left out: cells of the kinds {counted(left_out)}")
    return flat, solid


def _by_group(mesh: Any, number: int) -> Iterator[tuple[np.ndarray, str]]:
    """Give the rows of a block of cells that are of each physical group, and its name."""
    count = len(mesh.cells[number].data)
    tags = mesh.cell_data.get("gmsh:physical")
    if tags is None or len(np.ravel(tags[number])) != count:
        yield np.arange(count), ""
        return
    dimension = mesh.cells[number].dim
    names = {int(tag): name for name, (tag, dim) in mesh.field_data.items() if dim == dimension}
    of_cell = np.ravel(tags[number]).astype(np.int64)
    for tag in np.unique(of_cell).tolist():
        yield np.flatnonzero(of_cell == tag), names.get(tag, "")


def _pieces(
    points: np.ndarray, flat: list[tuple[np.ndarray, str]], solid: list[tuple[np.ndarray, str]]
) -> Iterator[Piece]:
    """Keep the faces of one solid cell only, and flat cells that are no face of a solid one."""
    kept = solid + flat
    for corners, _ in kept:
        check_corners(corners, len(points), "")
    once = _used_once([corners for corners, _ in kept], len(solid))
    of_name: dict[str, list[np.ndarray]] = {}
    for (corners, name), outer in zip(kept, once, strict=True):
        of_name.setdefault(name, []).append(corners[outer].astype(np.int64))
    for name, blocks in of_name.items():
        corner = np.concatenate([block.ravel() for block in blocks])
        count = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks])
        used, corner = np.unique(corner, return_inverse=True)
        faces, polygon = cut_polygons(points[used], corner.ravel(), count)
        if len(faces):
            yield Piece(points[used], faces, name, "", polygon)


def _used_once(blocks: list[np.ndarray], solids: int) -> list[np.ndarray]:
    """Tell which faces to keep, a mask for each block (F, N); the first `solids` are of cells."""
    keys = [_key(block) for block in blocks]
    if not solids:
        return [np.ones(len(key), bool) for key in keys]
    known, count = np.unique(np.concatenate(keys[:solids]), axis=0, return_counts=True)
    masks = []
    for number, key in enumerate(keys):
        at = _places(known, key)
        inside = at >= 0
        masks.append(count[at] == 1 if number < solids else ~inside)
    return masks


def _key(block: np.ndarray) -> np.ndarray:
    """Sort the corners of faces (F, N) into rows that are equal for the same face, (F, 4)."""
    rows = np.sort(block, axis=1)[:, -4:].astype(np.int64)
    return np.pad(rows, ((0, 0), (4 - rows.shape[1], 0)), constant_values=-1)


def _places(known: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Find rows (F, 4) in sorted, different ones (K, 4): places (F,), -1 for none."""
    whole = np.concatenate([known, rows])
    _, first, of_row = np.unique(whole, axis=0, return_index=True, return_inverse=True)
    at = first[of_row.ravel()[len(known) :]]
    return np.where(at < len(known), at, -1)
