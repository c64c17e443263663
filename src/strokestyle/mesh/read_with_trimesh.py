"""Read mesh files with trimesh: those of a kind that no reader of ours takes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from .formats import what_would_do
from .messages import silence
from .triangles import Triangles

_NEEDED = {".xaml": "lxml"}  # what trimesh needs on top of itself to read a format
_FORMATS = (".obj", ".ply", ".stl", ".off", ".xaml")
_MADE_UP = r"((geometry|GLTF|world)(_\d+)?|\d+)?"  # trimesh's own names of parts


def read_with_trimesh(path: Path) -> Triangles:
    """Read all parts of a scene, its transforms applied; of a file without faces, its points.

    trimesh is imported here, as slow to import: `benchmarks/mesh_files.py` tells how slow.

    Raises
    ------
    OSError
        where the file cannot be opened
    ValueError
        where trimesh cannot read it, or lacks a package for that; for another format, with what
        would do
    """
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(f"{path}: {what_would_do(suffix)}")
    import trimesh

    try:
        with silence():
            # materials would be textures, and those pictures
            scene = trimesh.load_scene(str(path), process=False, skip_materials=True)
            above = scene.graph.transforms.parents
            pieces = [piece for piece in scene.dump() if len(getattr(piece, "vertices", ()))]
    except OSError as error:
        raise type(error)(f"{path}: cannot be read ({one_line(error)})") from None
    except ImportError as error:
        extra = _NEEDED.get(suffix) or error.name or "the package it names"
        raise ValueError(
            f"{path}: reading {suffix} files needs another package: pip install {extra}"
        ) from None
    except Exception as error:  # a damaged file can fail anywhere inside a parser, in any way
        raise ValueError(
            f"{path}: damaged, or not in {suffix[1:]} format ({one_line(error)})"
        ) from None
    meshes = [piece for piece in pieces if isinstance(piece, trimesh.Trimesh) and len(piece.faces)]
    if not meshes:
        return Triangles(_points(pieces), np.zeros((0, 3), np.int64), np.zeros(0, np.int64), ())
    return _together(meshes, tuple(_part_name(mesh.metadata, above, path) for mesh in meshes))


def _points(pieces: list) -> np.ndarray:
    """Gather the points (N, 3) of pieces without faces; those of the plane have height 0."""
    points = [np.zeros((0, 3))]
    for piece in pieces:
        own = np.asarray(piece.vertices, np.float64)
        points.append(np.pad(own, ((0, 0), (0, 3 - own.shape[1]))))
    return np.concatenate(points)


def _together(meshes: list, names: tuple[str, ...]) -> Triangles:
    """Lay trimesh's meshes one after the other, each a part."""
    offset = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return Triangles(
        np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes]),
        np.concatenate(
            [np.asarray(m.faces, np.int64) + at for m, at in zip(meshes, offset, strict=True)]
        ),
        np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes]),
        names,
    )


def _part_name(metadata: dict, above: dict[str, str], path: Path) -> str:
    """Find the name that the file gives a part, "" where trimesh made one up.

    `above` : the node over each node of the scene
    """
    node, name = str(metadata.get("node") or ""), str(metadata.get("name") or "")
    parent = str(above.get(node) or "")
    if parent and re.fullmatch(re.escape(parent) + "_[0-9a-f]{6}", node):
        node = parent  # one of several pieces of a mesh, such as those of different materials
    given = (
        text for text in (node, name) if text != path.name and not re.fullmatch(_MADE_UP, text)
    )
    return next(given, "")


def one_line(error: Exception) -> str:
    """Say what an error of another library says, in at most 120 characters of one line."""
    text = " ".join(str(error).split())
    return text[:120] if text else type(error).__name__
