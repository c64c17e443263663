"""Read a geometry of a COLLADA file: its triangles, strips, fans and polygons.

Chapters are those of the COLLADA 1.4.1 and 1.5.0 specifications, Khronos Group and Sony.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from ..files import quoted
from .messages import warn
from .pieces import check_corners, label
from .polygons import cut_polygons

Element = ElementTree.Element
_LEFT_OUT = {"lines": "lines", "linestrips": "lines"}


class Part(NamedTuple):
    """Triangles of one material, as in pieces.Piece; the symbol of the material."""

    vertices: np.ndarray
    faces: np.ndarray
    polygon: np.ndarray | None
    material: str


class Geometry(NamedTuple):
    """What there is of triangles, and how often what else is left out."""

    parts: list[Part]
    left_out: Counter[str]


def read_geometry(geometry: Element, sources: dict[str, np.ndarray]) -> Geometry:
    """Read a geometry (5, geometry): what is a mesh, convex or not.

    Raises ValueError where numbers are missing, are none, or name a vertex that does not exist.

    `sources` : positions (N, 3) by the ids of the elements that have them
    """
    found = Geometry([], Counter())
    mesh = geometry.find("mesh")
    if mesh is None:
        mesh = geometry.find("convex_mesh")
    if mesh is None:
        kind = next((child.tag for child in geometry if child.tag not in ("asset", "extra")), "")
        found.left_out[f"geometries of {quoted(kind or 'nothing')}"] += 1
        return found
    name = geometry.get("name") or geometry.get("id") or ""
    for primitive in mesh:
        if primitive.tag in _READERS:
            part = _read_part(primitive, sources, name)
            if len(part.faces):
                found.parts.append(part)
        elif primitive.tag in _LEFT_OUT:
            found.left_out[_LEFT_OUT[primitive.tag]] += int(primitive.get("count", 1))
    return found


def sources_of(geometry: Element) -> dict[str, np.ndarray]:
    """Read the positions (N, 3) of a geometry, by the ids of <source> and of <vertices>."""
    elements = {child.get("id", ""): child for child in geometry.iter() if child.get("id")}
    wanted: dict[str, str] = {}
    for vertices in geometry.iter("vertices"):
        for given in vertices.findall("input"):
            if given.get("semantic") == "POSITION":
                wanted[vertices.get("id", "")] = given.get("source", "").lstrip("#")
    for given in geometry.iter("input"):
        if given.get("semantic") == "POSITION":
            number = given.get("source", "").lstrip("#")
            wanted[number] = number
    read: dict[str, np.ndarray] = {}
    for number in set(wanted.values()):
        if number not in elements:
            raise ValueError(f"positions are to be in {quoted(number)!r}, and there is none")
        read[number] = _positions(elements[number], elements)
    return {key: read[number] for key, number in wanted.items()}


def _positions(source: Element, elements: dict[str, Element]) -> np.ndarray:
    """Read the positions of a <source>, as its accessor says (5, accessor): (N, 3) float64."""
    accessor = source.find("technique_common/accessor")
    array = source.find("float_array")
    if accessor is not None:
        array = elements.get(accessor.get("source", "").lstrip("#"), array)
    if array is None:
        raise ValueError(f"no numbers in {quoted(source.get('id', ''))!r}")
    values = numbers_of(array)
    if accessor is None:
        return values[: len(values) // 3 * 3].reshape(-1, 3)
    columns = [i for i, param in enumerate(accessor.findall("param")) if param.get("name")][:3]
    named = {param.get("name", "").upper(): i for i, param in enumerate(accessor.findall("param"))}
    if {"X", "Y", "Z"} <= set(named):
        columns = [named[axis] for axis in "XYZ"]
    if len(columns) < 3:
        columns = [0, 1, 2]
    stride, offset = int(accessor.get("stride", 1)), int(accessor.get("offset", 0))
    count = int(accessor.get("count", 0))
    if stride <= max(columns) or offset < 0 or count < 0:
        raise ValueError(f"positions of {stride} numbers each in {quoted(source.get('id', ''))!r}")
    rows = values[offset : offset + stride * count]
    if len(rows) < stride * (count - 1) + max(columns) + 1 and count:
        raise ValueError(f"cut short: {len(rows)} numbers of {stride * count} positions")
    rows = np.pad(rows, (0, stride * count - len(rows)))
    return rows.reshape(count, stride)[:, columns]


def _read_part(primitive: Element, sources: dict[str, np.ndarray], name: str) -> Part:
    """Read <triangles>, <polylist>, ... (5)."""
    inputs = primitive.findall("input")
    if not inputs:
        return Part(np.zeros((0, 3)), np.zeros((0, 3), np.int64), None, "")
    stride = 1 + max(int(given.get("offset", 0)) for given in inputs)
    place = {given.get("semantic"): given for given in inputs}
    given = place.get("VERTEX", place.get("POSITION"))
    number = "" if given is None else given.get("source", "").lstrip("#")
    if given is None or number not in sources:
        raise ValueError(f"the {quoted(primitive.tag)} of {label(name)} are without positions")
    vertices = sources[number]
    offset = int(given.get("offset", 0))
    faces, polygon = _READERS[primitive.tag](primitive, (stride, offset), vertices, name)
    return Part(vertices, faces, polygon, primitive.get("material", ""))


_Faces = tuple[np.ndarray, "np.ndarray | None"]
_Layout = tuple[int, int]  # numbers that each corner has, and which of them is the vertex


def _corners(element: Element | None, layout: _Layout) -> np.ndarray:
    """Read the vertices (N,) int64 that a list of indices names."""
    if element is None:
        return np.zeros(0, np.int64)
    numbers = numbers_of(element, kind=np.int64)
    stride, offset = layout
    return numbers[: len(numbers) // stride * stride].reshape(-1, stride)[:, offset]


def _triangles(primitive: Element, layout: _Layout, vertices: np.ndarray, name: str) -> _Faces:
    rows = [_corners(p, layout) for p in primitive.findall("p")]
    spare = sum(len(corners) % 3 for corners in rows)
    if spare:
        warn(f"left out: corners that make no triangle ({spare})")
    faces = [corners[: len(corners) // 3 * 3].reshape(-1, 3) for corners in rows]
    found = np.concatenate([np.zeros((0, 3), np.int64), *faces])
    check_corners(found, len(vertices), name)
    return found, None


def _strips(primitive: Element, layout: _Layout, vertices: np.ndarray, name: str) -> _Faces:
    """Read strips; every second triangle is turned about."""
    return _rows(primitive, layout, vertices, name, lambda k: (k, k + 1 + k % 2, k + 2 - k % 2))


def _fans(primitive: Element, layout: _Layout, vertices: np.ndarray, name: str) -> _Faces:
    """Read fans, all of whose triangles have the first corner."""
    return _rows(primitive, layout, vertices, name, lambda k: (0 * k, k + 1, k + 2))


def _rows(
    primitive: Element,
    layout: _Layout,
    vertices: np.ndarray,
    name: str,
    triangle: Callable[[np.ndarray], tuple[np.ndarray, ...]],
) -> _Faces:
    """Read rows of corners; `triangle` tells which three of a row its triangle k has."""
    faces = [np.zeros((0, 3), np.int64)]
    for p in primitive.findall("p"):
        corners = _corners(p, layout)
        k = np.arange(max(len(corners) - 2, 0))
        faces.append(corners[np.stack(triangle(k), axis=1)])
    found = np.concatenate(faces)
    check_corners(found, len(vertices), name)
    return found, None


def _polylist(primitive: Element, layout: _Layout, vertices: np.ndarray, name: str) -> _Faces:
    """Read polygons whose numbers of corners stand in a list by themselves."""
    vcount = primitive.find("vcount")
    count = np.zeros(0, np.int64) if vcount is None else numbers_of(vcount, kind=np.int64)
    corners = _corners(primitive.find("p"), layout)
    if count.min(initial=0) < 0 or count.sum() > len(corners):
        raise ValueError(
            f"cut short: the polygons of {label(name)} have {count.sum()} corners, and "
            f"{len(corners)} are there"
        )
    return _cut(vertices, corners[: count.sum()], count, name)


def _polygons(primitive: Element, layout: _Layout, vertices: np.ndarray, name: str) -> _Faces:
    """Read polygons one by one; a seam joins a hole to what is around it."""
    rings = []
    for child in primitive:
        if child.tag == "p":
            rings.append(_corners(child, layout))
        elif child.tag == "ph":
            ring = _corners(child.find("p"), layout)
            holes = [_corners(hole, layout) for hole in child.findall("h")]
            check_corners(np.concatenate([ring, *holes]), len(vertices), name)
            rings.append(_with_holes(vertices, ring, [hole for hole in holes if len(hole)]))
    count = np.array([len(ring) for ring in rings], np.int64)
    return _cut(vertices, np.concatenate([np.zeros(0, np.int64), *rings]), count, name)


def _with_holes(vertices: np.ndarray, ring: np.ndarray, holes: list[np.ndarray]) -> np.ndarray:
    """Join holes to a polygon by seams, each passed twice.

    A seam runs between nearest corners, to the nearest of the holes that are left: it crosses none.
    """
    holes = list(holes) if len(ring) else []
    while holes:
        apart = [np.linalg.norm(vertices[ring][:, None] - vertices[hole], axis=2) for hole in holes]
        nearest = int(np.argmin([rows.min() for rows in apart]))
        at, to = np.unravel_index(apart[nearest].argmin(), apart[nearest].shape)
        hole = np.roll(holes.pop(nearest), -to)
        if np.dot(_area(vertices[ring]), _area(vertices[hole])) > 0:
            hole = np.roll(hole[::-1], 1)  # it must run the other way round, from the same corner
        ring = np.concatenate([ring[: at + 1], hole, hole[:1], ring[at:]])
    return ring


def _area(points: np.ndarray) -> np.ndarray:
    """Measure twice the vector area (3,) of a polygon (N, 3)."""
    return np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)


def _cut(vertices: np.ndarray, corners: np.ndarray, count: np.ndarray, name: str) -> _Faces:
    check_corners(corners, len(vertices), name)
    return cut_polygons(vertices, corners, count)


_READERS = {
    "triangles": _triangles,
    "trifans": _fans,
    "tristrips": _strips,
    "polylist": _polylist,
    "polygons": _polygons,
}


def _no_number(text: str) -> str:
    """Find the first word of a text that is no number."""
    for word in text.split():
        try:
            float(word)
        except ValueError:
            return quoted(word[:20])
    return quoted(text.split()[0][:20])


def numbers_of(element: Element, count: int = -1, kind: type = np.float64) -> np.ndarray:
    """Read the numbers of an element's text, of which there must be `count` unless that is -1."""
    text = element.text or ""
    if not text.strip():  # numpy makes one number of an empty text
        values: np.ndarray = np.zeros(0, kind)
    else:
        with warnings.catch_warnings():
            # at a word that is no number some versions of numpy stop and warn, others raise
            warnings.simplefilter("error")
            try:
                values = np.fromstring(text, kind, sep=" ")
            except (ValueError, DeprecationWarning):
                raise ValueError(f"{_no_number(text)!r} in <{element.tag}> is no number") from None
    if count not in (-1, len(values)):
        raise ValueError(f"<{element.tag}> has {len(values)} numbers for {count}")
    return values
