"""The elements of an SVG document as a tree, and the shapes among them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from .. import files as limits
from ..geometry.bezier import Segment
from .path_data import NUMBER, SPACE, parse_path, shape_path
from .xml import SVG_NAMESPACE, SaxReader

SHAPES = ("path", "line", "polyline", "polygon", "rect", "circle", "ellipse")
XLINK_HREF = "http://www.w3.org/1999/xlink}href"


class Node(NamedTuple):
    """An element of a document, and those in it."""

    namespace: str
    tag: str
    attributes: dict[str, str]
    children: list[Node]
    line: int
    number: int  # of the elements of the document, in order

    @property
    def name(self) -> str:
        """Its tag, where it is an element of SVG; else ""."""
        return self.tag if self.namespace in ("", SVG_NAMESPACE) else ""

    @property
    def href(self) -> str:
        """What it refers to, "" for nothing."""
        return self.attributes.get("href", self.attributes.get(XLINK_HREF, "")).strip()


class TreeReader:
    """Builds the tree of a document, and finds what `use` refers to."""

    def __init__(self) -> None:
        self.by_id: dict[str, Node] = {}
        self._open: list[Node] = []
        self._xml = SaxReader(self._start, self._end)

    def read(self, data: bytes) -> Node:
        """Read a document; its first element. Raises ValueError."""
        self._xml.walk(data)
        return self._root

    def _start(self, namespace: str, tag: str, attributes: dict[str, str]) -> None:
        node = Node(namespace, tag, attributes, [], self._xml.line, self._xml.elements - 1)
        if self._open:
            self._open[-1].children.append(node)
        else:
            self._root = node
        self.by_id.setdefault(attributes.get("id", ""), node)
        self._open.append(node)

    def _end(self) -> None:
        self._open.pop()


def subpaths(
    tag: str, attributes: Mapping[str, str], view: tuple[float, float]
) -> list[list[Segment]]:
    """Read the subpaths of a shape, in its own coordinates. Raises ValueError.

    `view` : (width, height) that percentages are of
    """
    if tag == "path":
        return parse_path(attributes.get("d", ""))
    if tag in ("polyline", "polygon"):
        points = attributes.get("points", "")
        close = "Z" if tag == "polygon" and points.strip(SPACE) else ""
        return parse_path(_whole_points(points) + close, command="M", name="points")
    return parse_path(shape_path(tag, attributes, view))


def _whole_points(points: str) -> str:
    """A list of points without a last coordinate that has no other, as SVG 2 draws it."""
    numbers = list(re.finditer(NUMBER, points[: limits.MAX_TEXT]))
    return points[: numbers[-1].start()].rstrip(f"{SPACE},") if len(numbers) % 2 else points
