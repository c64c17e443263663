"""Read PLY files."""

from __future__ import annotations

import re

import numpy as np

from .messages import only_lines
from .ply_body import ORDERS, TYPES, Body, Element, Lists, Property
from .polygons import checked_corners, cut_polygons
from .text_file import one_byte_text
from .triangles import Triangles

MAX_HEADER = 1_000_000  # bytes
_CORNERS = ("vertex_indices", "vertex_index", "vertex_indexes")


def read_ply(data: bytes) -> Triangles:
    """Read the faces and the strips of triangles of a PLY file, text or binary.

    Elements and their properties may come in any order and be of any name: what is no vertex, face
    or strip (`tristrips`) is passed over, and nothing but coordinates and corners is taken; where
    there is no z it is 0. Strips begin anew at a corner of -1. Polygons are cut into triangles. A
    PLY file has no parts.

    Raises
    ------
    ValueError
        where the header or the body is damaged or cut short, or a face names no vertex
    NotSupported
        on lines without faces, or text in UTF-16
    """
    elements, body = _read_header(one_byte_text(data))
    columns: dict[str, list] = {}
    left = [bool(element.rows and _wanted(element)) for element in elements]
    for i, element in enumerate(elements):
        if any(left[i:]):
            columns.setdefault(element.name, body.read(element, _wanted(element)))
    vertices = _vertices(columns.get("vertex", []))
    polygons = _corners(columns.get("face", []), len(vertices))
    strips = _strips(columns.get("tristrips", []), len(vertices))
    faces, polygon = cut_polygons(vertices, *polygons)
    more = _cut_strips(strips)
    if not len(faces) + len(more):
        _refuse_lines(elements)
    polygon = np.r_[polygon, len(polygons.length) + np.arange(len(more))]
    faces = np.concatenate([faces, more])
    return Triangles(vertices, faces, np.zeros(len(faces), np.int64), ("",), polygon)


def _wanted(element: Element) -> list[str]:
    """Name the properties that are read: coordinates, or the corners of polygons or strips."""
    if element.name == "vertex":
        names = [one.name for one in element.properties if not one.count_kind]
        if element.rows and not {"x", "y"} <= set(names):
            raise ValueError("its vertices have no x and y")
        return [axis for axis in "xyz" if axis in names]
    lists = [
        one.name
        for one in element.properties
        if one.count_kind and (one.kind[0] != "f" or one.name in _CORNERS)
    ]
    if element.name not in ("face", "tristrips"):
        return []
    if element.rows and not lists:
        raise ValueError(f"its {element.name} element has no list of corners")
    return [name for name in (*_CORNERS, *lists) if name in lists][:1]


def _cut_strips(strips: Lists) -> np.ndarray:
    """Cut strips of triangles into faces (F, 3), turned alike."""
    corner, length = strips
    number = np.arange(len(corner)) - np.repeat(np.cumsum(length) - length, length)
    last = np.flatnonzero(number >= 2)
    faces = np.stack([corner[last - 2], corner[last - 1], corner[last]], axis=1)
    odd = number[last] % 2 == 1
    faces[odd] = faces[odd][:, [1, 0, 2]]
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]  # others only lead the strip on


def _refuse_lines(elements: list[Element]) -> None:
    lines = sum(element.rows for element in elements if element.name == "edge")
    if lines:
        raise only_lines(lines)


def _vertices(columns: list) -> np.ndarray:
    """Gather the vertices (V, 3) float64; those of a plane have height 0."""
    if not columns:
        return np.zeros((0, 3))
    if len(columns) < 3:
        columns = [*columns, *[np.zeros(len(columns[0]))] * (3 - len(columns))]
    with np.errstate(invalid="ignore"):  # some of what is no number complains
        return np.stack(columns, axis=1).astype(np.float64)


def _corners(columns: list, vertices: int) -> Lists:
    """Take the corners of all polygons as int64, once they are known to be vertices."""
    if not columns:
        return Lists(np.zeros(0, np.int64), np.zeros(0, np.int64))
    values, length = columns[0]
    return Lists(checked_corners(values, length, vertices), length)


def _strips(columns: list, vertices: int) -> Lists:
    """Take the strips, each up to a corner of -1 as one of its own."""
    if not columns:
        return Lists(np.zeros(0, np.int64), np.zeros(0, np.int64))
    values, length = columns[0]
    # -1 reads as the largest number there is, where there are no negative ones
    new = values == (np.iinfo(values.dtype).max if values.dtype.kind == "u" else -1)
    strip = np.repeat(np.arange(len(length)), length) + np.cumsum(new)
    length = np.bincount(strip[~new])
    return Lists(checked_corners(values[~new], length, vertices, "strip"), length)


# -------------------------------------------------------------------------------------- the header


def _read_header(data: bytes) -> tuple[list[Element], Body]:
    """Read the header; the file's other bytes are its body."""
    first = re.match(rb"ply[ \t]*(\r\n|\r|\n)", data[:99], re.IGNORECASE)
    if first is None:
        raise ValueError("does not begin with 'ply'")
    # a line ends as the first one did: in a file of CR alone, an LF behind it is of the body
    end = rb"\r?\n" if first[1] == b"\n" else first[1]
    header = re.match(
        rb"(.*?[\r\n])\s*end_header[ \t]*(?:" + end + rb"|$)", data[:MAX_HEADER], re.S
    )
    if header is None:
        raise ValueError("cut short: its header has no end")
    form = ""
    elements: list[Element] = []
    for words in (line.split() for line in header[1].decode("latin-1").splitlines()):
        match words:
            case ["format", form, *_]:
                pass
            case ["element", name, rows]:
                elements.append(Element(name.lower(), _rows(rows), []))
            case ["property", *column]:
                if not elements:
                    raise ValueError("a property stands before all elements in its header")
                elements[-1].properties.append(_read_property(column))
    if form not in ORDERS:
        raise ValueError(f"its format is {form!r}, not one of {', '.join(ORDERS)}")
    line = len(re.findall(rb"\r\n|\r|\n", header[0])) + 1
    return elements, Body(data[header.end() :], form, line)


def _rows(word: str) -> int:
    if not word.isdecimal():
        raise ValueError(f"an element of {word!r} rows in its header")
    return int(word)


def _read_property(words: list[str]) -> Property:
    match words:
        case ["list", count_kind, kind, name] if count_kind in TYPES and kind in TYPES:
            # a length is never negative, whatever its type: 200 corners may stand in a char
            unsigned = TYPES[count_kind].replace("i1", "u1")
            return Property(name.lower(), TYPES[kind], unsigned)
        case [kind, name] if kind in TYPES:
            return Property(name.lower(), TYPES[kind])
    raise ValueError(f"'property {' '.join(words)[:60]}' in its header")
