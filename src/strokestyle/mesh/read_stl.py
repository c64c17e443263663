"""Read STL files, binary and text."""

from __future__ import annotations

import re

import numpy as np

from .messages import warn
from .text_file import CutShort, one_byte_text, read_numbers
from .triangles import Triangles

HEAD = 84  # bytes before the first face: a text of 80, and the number of faces
_FACE = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("colour", "<u2")])
_SAMPLE = 2000  # bytes in which a text has its first face
# all that stands between the corners of two faces, and that is no coordinate
_BETWEEN = re.compile(rb"endloop.*?outer\s*loop", re.DOTALL)
_LOOP = re.compile(rb"outer\s*loop")
_FACET = re.compile(rb"(?<!end)(?<!end )facet\b")
_SOLID_ENDS = re.compile(rb"end\s*solid")
_COMMENT = re.compile(rb"^[ \t]*(?:#|//|;)[^\n]*", re.MULTILINE)
_SOLID = re.compile(rb"solid(?!\S)([^\n]*?)(?=\bfacet\b|\n|\Z)")


def read_stl(data: bytes) -> Triangles:
    """Read an STL file: three vertices of its own for each face.

    The solids of a text are parts, those of one name the same one; a binary file has none. Normals
    are passed over, and so are bytes behind the last face of a binary file.

    Raises
    ------
    ValueError
        where the file is neither, ends too early, or a coordinate is no number
    NotSupported
        on text in UTF-16
    """
    faces = int.from_bytes(data[80:HEAD], "little")
    if len(data) != HEAD + _FACE.itemsize * faces and _is_text(one_byte_text(data)):
        return _read_text(one_byte_text(data))
    return _read_binary(data, faces)


def _is_text(data: bytes) -> bool:
    start = data[:_SAMPLE].lower()
    word = re.match(rb"\s*(?:(?:#|//|;)[^\r\n]*\s*)*(solid|facet)\b", start)
    return (
        word is not None
        and b"\0" not in start
        and (word[1] == b"facet" or b"facet" in start or len(data) < _SAMPLE)
    )


def _read_binary(data: bytes, faces: int) -> Triangles:
    """Read a binary file that says it has so many faces."""
    there, left = divmod(len(data) - HEAD, _FACE.itemsize)
    if there < 0 or (there < faces and not any(byte < 9 for byte in data[:HEAD])):
        raise ValueError("neither text that begins with 'solid' nor binary")
    if not faces and there and not left:
        warn(f"it says that it has no triangles, and has {there}")
        faces = there
    if there < faces:
        raise CutShort(there, faces, "triangles")
    if there > faces:
        warn(
            f"left out: {len(data) - HEAD - _FACE.itemsize * faces} bytes behind the {faces} "
            "triangles that it says it has"
        )
    table = np.frombuffer(data, _FACE, faces, HEAD)
    with np.errstate(invalid="ignore"):  # some of what is no number complains
        return _soup(table["corner"].reshape(-1, 3).astype(np.float64))


def _soup(corners: np.ndarray) -> Triangles:
    """Make faces of corners (3 F, 3), all of one part."""
    faces = np.arange(len(corners)).reshape(-1, 3)
    return Triangles(corners, faces, np.zeros(len(faces), np.int64), ("",))


def _read_text(data: bytes) -> Triangles:
    """Read the faces of a text, its solids as parts."""
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if any(sign in data for sign in (b"#", b"//", b";")):
        data = _COMMENT.sub(b"", data)
    lower, names, begin = _take_names(data)
    loops = lower.count(b"endloop")
    first = _LOOP.search(lower)
    _check_end(lower[max(lower.rfind(b"endloop"), 0) :], loops)
    if first is None:
        return _soup(np.zeros((0, 3)))
    text = lower[first.end() : lower.rindex(b"endloop")]
    pieces = text.split(b"loop")
    if len(pieces) == 2 * loops - 1:  # the same as below, several times as fast
        corners = b" ".join(pieces[::2]).replace(b"end", b" ")
    else:
        corners = _BETWEEN.sub(b" ", text)
    vertices = corners.count(b"vertex")
    if vertices != 3 * loops:
        raise ValueError(f"its {loops} triangles have {vertices} vertices, not three each")
    numbers, problem = read_numbers(corners.replace(b"vertex", b" "))
    if problem:  # in which line?
        lines = _BETWEEN.sub(_only_line_ends, text).replace(b"vertex", b" ")
        raise ValueError(read_numbers(lines, 1 + lower.count(b"\n", 0, first.end()))[1])
    if len(numbers) != 3 * vertices:
        raise ValueError(f"its {vertices} vertices have {len(numbers)} numbers, not three each")
    found = _soup(numbers.reshape(-1, 3))
    part, part_names = _parts(names, np.diff(np.append(begin, loops)))
    return found._replace(part=part, part_names=part_names)


def _check_end(rest: bytes, loops: int) -> None:
    """Refuse a text that begins another triangle behind its last whole one; warn of no end."""
    end = _SOLID_ENDS.search(rest)  # and a name, which may say anything
    more = rest[: end.start()] if end else rest
    if _LOOP.search(rest) or _FACET.search(more):
        raise ValueError(f"cut short: it ends within triangle {loops + 1}")
    if loops and not end:
        warn(f"perhaps cut short: no 'endsolid' behind its {loops} triangles")


def _only_line_ends(match: re.Match[bytes]) -> bytes:
    return b" " + b"\n" * match[0].count(b"\n")


def _take_names(data: bytes) -> tuple[bytes, list[str], list[int]]:
    """Take the names of solids out of a text, which may say anything.

    Returns the rest in lower case, the names, "" first, and how many faces there are before each.
    """
    lower = data.lower()
    rest, names, begin, at, faces = [], [""], [0], 0, 0
    for solid in _SOLID.finditer(lower):
        ends = lower.endswith(b"end", 0, solid.start())
        if not ends and lower[solid.start() - 1 : solid.start()].strip():
            continue  # some longer word
        rest.append(lower[at : solid.start(1)])
        faces += rest[-1].count(b"endloop")
        if not ends:
            begin.append(faces)
            names.append(data[solid.start(1) : solid.end(1)].decode("utf-8", "replace").strip())
        at = solid.end(1)
    return b"".join([*rest, lower[at:]]), names, begin


def _parts(names: list[str], faces: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Lay out the parts of so many faces each: index (F,) int64 into the second result."""
    number = {name: i for i, name in enumerate(names)}  # solids of one name are one part
    part = np.repeat([number[name] for name in names], faces)
    present, part = np.unique(part, return_inverse=True)
    return part.ravel(), tuple(names[i] for i in present)
