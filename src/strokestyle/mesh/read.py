"""Mesh files -> triangles. OBJ and the common kinds of PLY and STL are read here, all else by trimesh, whose import
alone takes as long as drawing a mesh."""

from __future__ import annotations

import contextlib
import logging
import re
import warnings
from pathlib import Path

import numpy as np

# What trimesh needs on top of itself to read a format.
_EXTRA_PACKAGES = {
    ".3mf": "lxml networkx",
    ".xaml": "lxml",
    ".dae": "pycollada",
    ".zae": "pycollada",
    ".step": "cascadio",
    ".stp": "cascadio",
    ".ctm": "python-openctm",
    ".dxf": "ezdxf",
    ".msh": "gmsh",
}

_MADE_UP = r"((geometry|GLTF|world)(_\d+)?|\d+)?"  # trimesh's own names of parts
_SPACES = bytes.maketrans(b"\t\v\f\r", b"   \n")
_NO_KEYWORDS = bytes.maketrans(b"vf", b"  ")

Triangles = tuple[np.ndarray, np.ndarray, np.ndarray, tuple[str, ...]]


def read_mesh(path: Path) -> Triangles:
    """All parts of a mesh file, a scene's transforms applied.

    Returns
    -------
    vertices (V, 3) float64, faces (F, 3) int64 naming vertices that exist, the part of each face (F,), the parts' names

    Raises OSError where the file cannot be opened, ValueError where it holds no faces; either names the file.
    """
    suffix = path.suffix.lower()
    found = None
    if suffix in (".obj", ".ply", ".stl"):
        try:
            data = path.read_bytes()
        except OSError as error:
            raise type(error)(f"{path}: cannot be read ({_line(error)})") from None
        if suffix == ".obj":
            try:
                found = read_obj(data)
            except ValueError as error:
                raise ValueError(f"{path}: damaged, or not in obj format ({error})") from None
        else:
            with contextlib.suppress(
                ValueError, KeyError, IndexError, OverflowError
            ):  # not of the common kind
                found = read_ply(data) if suffix == ".ply" else read_stl(data)
    if found:
        vertices, faces, part, names = found
        points = len(vertices)
    else:
        vertices, faces, part, names, points = _read_with_trimesh(path, suffix)
    if not len(faces):
        if points:
            raise ValueError(
                f"{path}: no faces in it ({points} points): a point cloud cannot be drawn; mesh it first"
            )
        raise ValueError(f"{path}: no faces in it: damaged, or not in {suffix[1:]} format")
    return vertices, faces, part, names


# -------------------------------------------------------------------------------------------------------------- obj


def read_obj(data: bytes) -> Triangles:
    """The faces of a Wavefront OBJ file; polygons are cut into fans, each object (`o`) is a part.

    Where there are no objects, groups (`g`) are parts; "default" is no name of one. Everything that shape does not need
    is skipped: texture coordinates, normals, colours, materials, curves.
    Raises ValueError, naming the line, where a vertex or a face cannot be read or a face names no vertex.
    """
    if b"\r\n" in data:
        data = data.replace(b"\r\n", b"\n")
    if any(byte in data for byte in b"\t\v\f\r"):
        data = data.translate(_SPACES)
    data = b"\n" + data + b"\n\n\n"
    if b"\\\n" in data:
        data = data.replace(b"\\\n", b" ")
    if b"\n " in data:
        data = re.sub(rb"\n +", b"\n", data)
    text = np.frombuffer(data, np.uint8)
    start = (
        np.flatnonzero(text == ord("\n"))[:-2] + 1
    )  # of every line, and of an empty one after the last
    first, spaced = text[start], text[start + 1] == ord(" ")
    is_vertex, is_face, is_object = (spaced & (first == ord(letter)) for letter in "vfo")
    grouped = not is_object.any()
    if grouped:
        is_object = spaced & (first == ord("g"))

    vertex, face = np.flatnonzero(is_vertex), np.flatnonzero(is_face)
    values, count = _numbers(_lines(data, start, vertex), float, start, vertex, data)
    if (count < 3).any():
        raise ValueError(
            _at(data, start, vertex[np.argmax(count < 3)]) + "a vertex has three coordinates"
        )
    begin = np.cumsum(count) - count
    vertices = (
        values[begin[:, None] + np.arange(3)] if (count != 3).any() else values.reshape(-1, 3)
    )

    corners = _lines(data, start, face)
    if b"/" in corners:
        corners = re.sub(rb"/[-+/0-9]*", b"", corners)
    corner, count = _numbers(corners, np.int64, start, face, data)
    line = np.repeat(face, count)
    known = np.cumsum(is_vertex)[line]  # vertices before the face: -1 is the last of them
    corner = np.where(corner < 0, corner + known, corner - 1)
    lost = (corner < 0) | (corner >= len(vertices))
    if lost.any():
        at = line[np.argmax(lost)]
        raise ValueError(
            _at(data, start, at) + f"a face names a vertex that is none of the {len(vertices)}"
        )
    fan = np.maximum(count - 2, 0)  # triangles of each polygon
    polygon = np.repeat(np.arange(len(face)), fan)
    k = np.arange(len(polygon)) - np.repeat(np.cumsum(fan) - fan, fan)
    begin = (np.cumsum(count) - count)[polygon]
    faces = corner[np.stack([begin, begin + k + 1, begin + k + 2], axis=1)]

    names = [""] + [_text(data, start, at)[2:].strip() for at in np.flatnonzero(is_object)]
    if grouped:
        names = ["" if name == "default" else name for name in names]
    number = {name: i for i, name in enumerate(names)}  # objects of one name are one part
    of_object = np.array([number[name] for name in names])
    present, part = np.unique(of_object[np.cumsum(is_object)[face[polygon]]], return_inverse=True)
    return vertices, faces, part.ravel(), tuple(names[i] for i in present)


def _lines(data: bytes, start: np.ndarray, which: np.ndarray) -> bytes:
    """Lines `which` (rising indices into `start`), one after the other, without keyword and comments."""
    run = np.flatnonzero(np.diff(which, prepend=-2) != 1)
    low, high = (
        start[which[run]],
        start[which[np.r_[run[1:], len(which)] - 1] + 1] if len(which) else run,
    )
    lines = b"".join([data[a:b] for a, b in zip(low.tolist(), high.tolist(), strict=True)])
    if b"#" in lines:
        lines = re.sub(rb"#[^\n]*", b"", lines)
    return lines.translate(_NO_KEYWORDS) if lines else b""


def _numbers(lines: bytes, dtype, start, which, data) -> tuple[np.ndarray, np.ndarray]:
    """All numbers of some lines, and how many each of them holds."""
    text = np.frombuffer(lines, np.uint8)
    word = text > ord(" ")
    first = np.flatnonzero(word & ~np.r_[False, word[:-1]])
    last = np.flatnonzero(text == ord("\n"))
    count = np.diff(np.searchsorted(first, last), prepend=0)
    if not len(first):  # of which numpy makes a number
        return np.zeros(0, dtype), count
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # some versions of numpy warn of what is no number, and stop there
        try:
            values = np.fromstring(lines, dtype, sep=" ")
        except ValueError:
            values = np.zeros(0, dtype)
    if len(values) != len(first):
        kind = int if dtype is np.int64 else float
        bad = next(
            (i for i, word in enumerate(lines.split()) if not _reads_as(kind, word)), len(first) - 1
        )
        at = which[np.searchsorted(np.cumsum(count), bad, side="right")]
        raise ValueError(_at(data, start, at) + "not a number")
    return values, count


def _reads_as(kind: type, word: bytes) -> bool:
    try:
        kind(word)
    except ValueError:
        return False
    return True


def _text(data: bytes, start: np.ndarray, line: int) -> str:
    return data[start[line] : start[line + 1] - 1].decode("utf-8", "replace")


def _at(data: bytes, start: np.ndarray, line: int) -> str:
    text = " ".join(_text(data, start, line).split())
    return f"line {line + 1}, {text[:40]!r}: "


# ---------------------------------------------------------------------------------------------------------- ply, stl

_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
              "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
              "float32": "f4", "float64": "f8"}  # fmt: skip


def read_ply(data: bytes) -> Triangles:
    """The faces of a PLY file, text or binary, of vertices and then faces, all with the same number of corners.

    Raises ValueError, KeyError, IndexError or OverflowError on any other, damaged or not.
    """
    header = re.match(rb"ply\r?\n(.*?)end_header *\r?\n", data[:100_000], re.DOTALL)
    _expect(header)
    elements, form = [], ""
    for words in (line.split() for line in header[1].decode("latin-1").splitlines()):
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    (vertex, count, columns), (face, rows, lists) = elements[:2]
    names = [column[-1] for column in columns]
    _expect(
        (vertex, face) == ("vertex", "face")
        and count > 0
        and rows > 0
        and len(lists) == 1
        and len(lists[0]) == 4
    )
    _expect(all(len(column) == 2 for column in columns) and len(set(names)) == len(names))
    body = data[header.end() :]
    if form == "ascii":
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # some versions of numpy warn of what is no number, and stop there
            numbers = np.fromstring(body, sep=" ")
        values, table = np.split(numbers, [count * len(names)])
        vertices = values.reshape(count, -1)[:, [names.index(axis) for axis in "xyz"]]
        corners = int(table[0])
        table = table[: rows * (corners + 1)].reshape(rows, corners + 1)
        counts, polygons = table[:, 0], table[:, 1:].astype(np.int64)
    else:
        order = {"binary_little_endian": "<", "binary_big_endian": ">"}[form]
        row = np.dtype([(name, order + _PLY_TYPES[kind]) for kind, name in columns])
        table = np.frombuffer(body, row, count)
        vertices = np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float64)
        many, one = (order + _PLY_TYPES[kind] for kind in lists[0][1:3])
        begin = count * row.itemsize
        corners = int(np.frombuffer(body, many, 1, begin)[0])
        _expect(corners < 100)
        table = np.frombuffer(body, [("count", many), ("corner", one, (corners,))], rows, begin)
        counts, polygons = table["count"], table["corner"].astype(np.int64)
    _expect(
        corners >= 3
        and (counts == corners).all()
        and polygons.min() >= 0
        and polygons.max() < count
    )
    faces = np.stack([polygons[:, [0, k, k + 1]] for k in range(1, corners - 1)], axis=1).reshape(
        -1, 3
    )
    return vertices, faces, np.zeros(len(faces), np.int64), ("",)


def read_stl(data: bytes) -> Triangles:
    """The faces of a binary STL file. Raises ValueError on any other, damaged or not."""
    _expect(len(data) > 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"))
    table = np.frombuffer(
        data, [("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("colour", "<u2")], offset=84
    )
    vertices = table["corner"].reshape(-1, 3).astype(np.float64)
    return vertices, np.arange(len(vertices)).reshape(-1, 3), np.zeros(len(table), np.int64), ("",)


def _expect(common) -> None:
    if not common:
        raise ValueError("not of the common kind")


# ---------------------------------------------------------------------------------------------------------- trimesh


def _read_with_trimesh(
    path: Path, suffix: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[str, ...], int]:
    """What `read_mesh` returns, and the number of points in the file, with or without faces."""
    import trimesh

    known = trimesh.available_formats()
    if suffix.lstrip(".") not in known:
        extra = _EXTRA_PACKAGES.get(suffix)
        if extra:
            raise ValueError(
                f"{path}: reading {suffix} files needs another package: pip install {extra}"
            )
        what = (
            f"{suffix} is not a mesh format" if suffix else "no suffix to tell the mesh format by"
        )
        raise ValueError(f"{path}: {what}; use obj, ply, stl, off or glb")
    try:
        with _silence():
            scene = trimesh.load_scene(str(path), process=False)
            above = scene.graph.transforms.parents
            parts = [
                geometry for geometry in scene.dump() if len(getattr(geometry, "vertices", ()))
            ]
    except OSError as error:
        raise type(error)(f"{path}: cannot be read ({_line(error)})") from None
    except ImportError as error:
        extra = (
            _EXTRA_PACKAGES.get(suffix) or getattr(error, "name", None) or "the package it names"
        )
        raise ValueError(
            f"{path}: reading {suffix} files needs another package: pip install {extra}"
        ) from None
    except Exception as error:  # a damaged file can fail anywhere inside a parser, in any way
        raise ValueError(
            f"{path}: damaged, or not in {suffix[1:]} format ({_line(error)})"
        ) from None
    meshes = [
        geometry
        for geometry in parts
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces)
    ]
    points = sum(len(geometry.vertices) for geometry in parts)
    if not meshes:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros(0, np.int64), (), points
    offset = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    vertices = np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes])
    faces = np.concatenate(
        [np.asarray(mesh.faces, np.int64) + at for mesh, at in zip(meshes, offset, strict=False)]
    )
    part = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    return (
        vertices,
        faces,
        part,
        tuple(_part_name(mesh.metadata, above, path) for mesh in meshes),
        points,
    )


def _part_name(metadata: dict, above: dict[str, str], path: Path) -> str:
    """The name that the file gives a part, "" where trimesh made one up; `above` has the node over each node."""
    node, name = str(metadata.get("node") or ""), str(metadata.get("name") or "")
    parent = str(above.get(node) or "")
    if parent and re.fullmatch(re.escape(parent) + "_[0-9a-f]{6}", node):
        node = parent  # one of several pieces of a mesh, such as those of different materials
    given = (
        text for text in (node, name) if text != path.name and not re.fullmatch(_MADE_UP, text)
    )
    return next(given, "")


def _line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text[:120] if text else type(error).__name__


@contextlib.contextmanager
def _silence():
    """Keep a reader's log, warnings and floating-point complaints from the user's terminal."""
    logger = logging.getLogger("trimesh")
    before = logger.disabled
    logger.disabled = True
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = before
