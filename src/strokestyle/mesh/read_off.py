"""Read OFF files, Geomview's object file format."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..geometry.curves import runs
from .messages import NotSupported, warn
from .polygons import checked_corners, cut_polygons
from .text_file import CutShort, one_byte_text, read_numbers
from .triangles import Triangles

MAX_COUNT = 2**40
# places in a texture, colours, normals, a fourth coordinate, any number of coordinates
_HEADER = re.compile(rb"\s*(ST)?(C)?(N)?(4)?(n)?(?:OFF|off)(?![A-Za-z])([ \t]+BINARY)?")


class _Lines(NamedTuple):
    """The numbers of a file behind its header, and where its lines begin.

    values : (N,) float64
    first : (L+1,) int, the first number of each line that has any, and N
    more : how many numbers the header says are behind the coordinates of a vertex
    problem : what is no number, behind all these; "" where there is no such thing
    """

    values: np.ndarray
    first: np.ndarray
    more: int
    problem: str


class _Counts(NamedTuple):
    """How many vertices and faces a file says it has, and the number behind that."""

    vertices: int
    faces: int
    at: int


class _Tables(NamedTuple):
    """Vertices (V, 3), the corners of all faces (C,), and how many (F,) each has."""

    vertices: np.ndarray
    corner: np.ndarray
    corners: np.ndarray


def read_off(data: bytes) -> Triangles:
    """Read the polygons of an OFF file, cut into triangles; it has no parts.

    Comments may stand anywhere. Where each vertex and each face has a line of its own, what stands
    behind coordinates and corners is passed over: normals, colours, places in a texture. Otherwise
    numbers may be broken into lines in any way. The first line need not say OFF, nor count edges.

    Raises
    ------
    ValueError
        where a number cannot be read or is missing, or a face names no vertex
    NotSupported
        on binary files, vertices of four or n coordinates, or text in UTF-16
    """
    lines = _read_lines(one_byte_text(data))
    counts = _read_counts(lines)
    wrong = None
    for tables in _ways_to_read(lines, counts):
        try:
            corner = checked_corners(tables.corner, tables.corners, counts.vertices)
        except ValueError as error:
            wrong = wrong or error
            continue
        faces, polygon = cut_polygons(tables.vertices, corner, tables.corners)
        return Triangles(tables.vertices, faces, np.zeros(len(faces), np.int64), ("",), polygon)
    raise wrong or _too_short(lines, counts)


def _read_lines(data: bytes) -> _Lines:
    """Read the header and the numbers behind it."""
    data = re.sub(rb"#[^\r\n]*", b"", data)
    header = _HEADER.match(data)
    more, begin = 0, 0
    if header is not None:
        begin = header.end()
        place, colour, normal, four, dimensions, binary = header.groups()
        if binary:
            raise NotSupported("binary OFF is not read: save it as text, or as PLY")
        if four or dimensions:
            raise NotSupported("OFF whose vertices have more than x, y and z: save it without them")
        more = 2 * bool(place) + 4 * bool(colour) + 3 * bool(normal)
    line = 1 + len(re.findall(rb"\r\n|\r|\n", data[:begin]))
    values, problem = read_numbers(data[begin:], line)
    text = np.frombuffer(data, np.uint8)[begin:]
    word = text > ord(" ")
    start = np.flatnonzero(word & ~np.r_[False, word[:-1]])[: len(values)]
    line_of = np.cumsum((text == ord("\n")) | (text == ord("\r")))[start]
    first = runs(line_of) if len(values) else np.zeros(1, np.int64)
    return _Lines(values, first, more, problem)


def _read_counts(lines: _Lines) -> _Counts:
    """Read the numbers of vertices, faces and edges; the third one may be missing."""
    if len(lines.values) < 2:
        what = "cut short: how many vertices and faces it has is not there"
        raise ValueError(lines.problem or what)
    vertices, faces = lines.values[:2]
    for count, what in ((vertices, "vertices"), (faces, "faces")):
        if not (0 <= count < MAX_COUNT and count % 1 == 0):
            raise ValueError(f"it says that it has {count:g} {what}")
    return _Counts(int(vertices), int(faces), 2 if lines.first[1] == 2 else 3)


def _ways_to_read(lines: _Lines, counts: _Counts) -> Iterator[_Tables]:
    """Read all vertices and faces in each way that comes out even, the likeliest first."""
    for at in dict.fromkeys((counts.at, 3)):
        by_line = _read_by_line(lines, counts._replace(at=at))
        if by_line:
            yield by_line
    # without lines to tell: with edges or without, with what the header announces or without
    for at in dict.fromkeys((counts.at, 3, 2)):
        for width in dict.fromkeys((_common_width(lines, counts), 3 + lines.more, 3)):
            in_a_row = _read_in_a_row(lines, counts._replace(at=at), width) if width > 2 else None
            if in_a_row:
                yield in_a_row


def _read_by_line(lines: _Lines, counts: _Counts) -> _Tables | None:
    """Read vertices and faces with a line each; None where they have none."""
    line = int(np.searchsorted(lines.first, counts.at))
    all_faces = line + counts.vertices + counts.faces
    if len(lines.first) - 1 < all_faces or lines.first[line] != counts.at:
        return None
    width = np.diff(lines.first)
    length = lines.values[lines.first[:-1]]
    vertices, faces = slice(line, line + counts.vertices), slice(line + counts.vertices, all_faces)
    length = length[faces]
    if (width[vertices] < 3).any() or not _are_lengths(length, width[faces] - 1).all():
        return None
    left = len(width) - all_faces
    if left:
        behind = f"{left} line{'s' * (left != 1)}"
        warn(f"left out: {behind} behind the {counts.faces} faces that it says it has")
    length = length.astype(np.int64)
    within = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
    return _Tables(
        lines.values[lines.first[vertices, None] + np.arange(3)],
        lines.values[np.repeat(lines.first[faces] + 1, length) + within],
        length,
    )


def _are_lengths(values: np.ndarray, most: np.ndarray | int) -> np.ndarray:
    """Tell which values (N,) can be numbers of corners, up to `most`."""
    return (values >= 0) & (values <= most) & (values % 1 == 0)


def _common_width(lines: _Lines, counts: _Counts) -> int:
    """How many numbers the line of each vertex has; 0 where not all have as many, or too few."""
    line = int(np.searchsorted(lines.first, counts.at))
    width = np.diff(lines.first)[line : line + counts.vertices]
    if len(width) < max(counts.vertices, 1) or lines.first[line] != counts.at:
        return 0
    return int(width[0]) if width[0] >= 3 and (width == width[0]).all() else 0


def _read_in_a_row(lines: _Lines, counts: _Counts, width: int) -> _Tables | None:
    """Read vertices of so many numbers and then faces, whatever the lines; None unless that is
    all."""
    begin = counts.at + width * counts.vertices
    starts = _faces_in_a_row(lines, begin, counts.faces)
    at = np.array(starts, np.int64)
    if len(starts) < counts.faces:
        return None
    length = lines.values[at].astype(np.int64)
    if begin + len(length) + length.sum() != len(lines.values):
        return None
    corner = np.ones(len(lines.values), bool)
    corner[:begin] = False
    corner[at] = False
    vertices = lines.values[counts.at : begin].reshape(-1, width)[:, :3]
    return _Tables(vertices, lines.values[corner], length)


def _faces_in_a_row(lines: _Lines, at: int, faces: int) -> list[int]:
    """Find where the first faces begin, as many as are whole, up to `faces`."""
    values, end = lines.values[at:].tolist(), len(lines.values) - at
    starts: list[int] = []
    here = 0
    while len(starts) < faces and here < end:
        length = values[here]
        if not (0 <= length < end - here and length % 1 == 0):
            break
        starts.append(at + here)
        here += int(length) + 1
    return starts


def _too_short(lines: _Lines, counts: _Counts) -> ValueError:
    """Make the error for a file that does not hold what it says."""
    if lines.problem:
        return ValueError(lines.problem)
    width = _common_width(lines, counts) or 3 + lines.more
    begin = counts.at + width * counts.vertices
    if begin > len(lines.values):
        there = (len(lines.values) - counts.at) // width
        return CutShort(max(there, 0), counts.vertices, "vertices")
    line = int(np.searchsorted(lines.first, begin))
    first = lines.first[line:]
    whole = _are_lengths(lines.values[first[:-1]], np.diff(first) - 1)
    there = int(np.argmin(np.append(whole, False))) or len(
        _faces_in_a_row(lines, begin, counts.faces)
    )
    if there >= counts.faces:
        return ValueError(f"it holds more than its {counts.faces} faces, and not a line each")
    return CutShort(there, counts.faces, "faces")
