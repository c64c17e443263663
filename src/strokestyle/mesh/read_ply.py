"""Read the common kinds of PLY files."""

from __future__ import annotations

import re
import warnings
from typing import NamedTuple

import numpy as np

from .triangles import LeftToTrimesh, Triangles

MAX_CORNERS = 100  # of a polygon; more are a sign of a damaged file
MAX_HEADER = 100_000  # bytes
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


class _Header(NamedTuple):
    """What the header says: the form, the numbers of vertices and faces, and how they are written.

    columns : type and name of each number of a vertex
    count_type, corner_type : of a face's number of corners, and of each of them
    """

    form: str
    vertices: int
    faces: int
    columns: list[tuple[str, str]]
    count_type: str
    corner_type: str


def read_ply(data: bytes) -> Triangles:
    """Read a PLY file of vertices and then faces, all with the same number of corners.

    The body may be text or binary, in either order of bytes. Polygons are cut into fans about
    their first corner. A PLY file has no parts. Raises LeftToTrimesh on any other, damaged or not.
    """
    try:
        header, body = _read_header(data)
        read = _read_text if header.form == "ascii" else _read_binary
        vertices, count, polygons = read(header, body)
        corners = polygons.shape[1]
        _expect(corners >= 3 and (count == corners).all())
        _expect(polygons.min() >= 0 and polygons.max() < header.vertices)
    except (ValueError, KeyError, IndexError, OverflowError):
        raise LeftToTrimesh("not a common kind of PLY file") from None
    fans = [polygons[:, [0, k, k + 1]] for k in range(1, corners - 1)]
    faces = np.stack(fans, axis=1).reshape(-1, 3)
    polygon = np.repeat(np.arange(len(polygons)), corners - 2)
    return Triangles(vertices, faces, np.zeros(len(faces), np.int64), ("",), polygon)


def _expect(common: bool | np.bool_) -> None:
    if not common:
        raise ValueError("not of the common kind")


def _read_header(data: bytes) -> tuple[_Header, bytes]:
    """Read the header; the file's other bytes are its body."""
    header = re.match(rb"ply\r?\n(.*?)end_header *\r?\n", data[:MAX_HEADER], re.DOTALL)
    if header is None:
        raise ValueError("no header")
    form = ""
    elements: list[tuple[str, int, list[list[str]]]] = []
    for words in (line.split() for line in header[1].decode("latin-1").splitlines()):
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    (vertex, vertices, columns), (face, faces, lists) = elements[:2]
    _expect((vertex, face) == ("vertex", "face") and vertices > 0 and faces > 0)
    _expect(len(lists) == 1 and len(lists[0]) == 4)
    names = [column[-1] for column in columns]
    _expect(all(len(column) == 2 for column in columns) and len(set(names)) == len(names))
    typed = [(kind, name) for kind, name in columns]
    return _Header(form, vertices, faces, typed, *lists[0][1:3]), data[header.end() :]


def _read_text(header: _Header, body: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read vertices (V, 3), how many corners each face says it has (F,), and the corners (F, n)."""
    with warnings.catch_warnings():
        # at a word that is no number some versions of numpy stop and warn, others raise
        warnings.simplefilter("ignore")
        numbers = np.fromstring(body, sep=" ")
    names = [name for _, name in header.columns]
    values, table = np.split(numbers, [header.vertices * len(names)])
    vertices = values.reshape(header.vertices, -1)[:, [names.index(axis) for axis in "xyz"]]
    corners = int(table[0])
    table = table[: header.faces * (corners + 1)].reshape(header.faces, corners + 1)
    return vertices, table[:, 0], table[:, 1:].astype(np.int64)


def _read_binary(header: _Header, body: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read what `_read_text` does, from either order of bytes."""
    order = _ORDERS[header.form]
    row = np.dtype([(name, order + _TYPES[kind]) for kind, name in header.columns])
    table = np.frombuffer(body, row, header.vertices)
    vertices = np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float64)
    many, one = order + _TYPES[header.count_type], order + _TYPES[header.corner_type]
    begin = header.vertices * row.itemsize
    corners = int(np.frombuffer(body, many, 1, begin)[0])
    _expect(corners < MAX_CORNERS)
    face = np.dtype([("count", many), ("corner", one, (corners,))])
    table = np.frombuffer(body, face, header.faces, begin)
    return vertices, table["count"], table["corner"].astype(np.int64)
