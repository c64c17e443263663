"""Read binary STL files."""

from __future__ import annotations

import numpy as np

from .triangles import LeftToTrimesh, Triangles

HEAD = 84  # bytes before the first face: a text of 80, and the number of faces
_FACE = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("colour", "<u2")])


def read_stl(data: bytes) -> Triangles:
    """Read a binary STL file: three vertices of its own for each face, and no parts.

    Raises LeftToTrimesh on any other, damaged or not.
    """
    faces = int.from_bytes(data[80:HEAD], "little")
    if not (len(data) > HEAD and len(data) == HEAD + _FACE.itemsize * faces):
        raise LeftToTrimesh("not a binary STL file")
    table = np.frombuffer(data, _FACE, offset=HEAD)
    vertices = table["corner"].reshape(-1, 3).astype(np.float64)
    corners = np.arange(len(vertices)).reshape(-1, 3)
    return Triangles(vertices, corners, np.zeros(len(table), np.int64), ("",))
