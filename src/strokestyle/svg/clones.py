"""Strokes that a file draws again by `use`, as Inkscape's clones are: written out each alone."""

from __future__ import annotations

import bisect
import re
from collections.abc import Mapping
from typing import NamedTuple

from .. import files as limits
from ..files import quoted
from ..geometry.affine import IDENTITY, Affine
from .format import Data
from .path_data import length
from .viewport import SIDES, inner_matrix, nested_box
from .xml import ATTRIBUTE, NAME, START_TAG, SVG_NAMESPACE, SaxReader, placed

XLINK_HREF = "http://www.w3.org/1999/xlink}href"
MAX_CLONES = 60  # one of the other
UNSEEN = ("defs", "symbol", "clipPath", "mask", "pattern", "marker")
NOT_DRAWN = ("svg", *(tag for tag in UNSEEN if tag != "symbol"), "")
_USE = re.compile(rb"<(?:[\w.-]+:)?use\b")
# of a `use`: what it draws and where is not what it hands on
_PLACE = re.compile(rb"x|y|width|height|(?:[\w.-]+:)?href")
View = tuple[float, float]  # (width, height) that percentages are of


class _Element(NamedTuple):
    """An element's place in the file.

    `begin`, `inside` : its first byte, and the first behind its start tag
    `body_end`, `end` : where its end tag begins, and the byte behind; of an empty element, `inside`
    `unseen` : where the innermost element around it begins that is not drawn by itself; -1: none
    """

    tag: str
    attributes: dict[str, str]
    line: int
    begin: int
    inside: int
    body_end: int
    end: int
    unseen: int


class _Finder:
    """Finds the elements that have an id, and those of `use`, in the order of their beginnings."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.named: dict[str, _Element] = {}
        self.uses: list[_Element] = []
        self.root: dict[str, str] = {}
        self._open: list[tuple[str, dict[str, str], int, int]] = []
        self._unseen = [-1]  # where the open elements of UNSEEN begin
        self._xml = SaxReader(self._start, self._end)
        self._xml.walk(data)
        self.uses.sort(key=lambda use: use.begin)

    def _start(self, namespace: str, tag: str, attributes: dict[str, str]) -> None:
        tag = tag if namespace in ("", SVG_NAMESPACE) else ""
        self.root = self.root if self._open else attributes
        self._open.append((tag, attributes, self._xml.line, self._xml.place))
        if tag in UNSEEN:
            self._unseen.append(self._xml.place)

    def _end(self) -> None:
        tag, attributes, line, begin = self._open.pop()
        if tag in UNSEEN:
            self._unseen.pop()
        if tag != "use" and "id" not in attributes:
            return
        tag_end = START_TAG.match(self.data, begin)
        inside = tag_end.end() if tag_end else begin
        empty = self.data.endswith(b"/>", begin, inside)
        body_end = inside if empty else self._xml.place
        end = inside if empty else self.data.find(b">", body_end) + 1
        place = (line, begin, inside, body_end, end, self._unseen[-1])
        element = _Element(tag, attributes, *place)
        if "id" in attributes:
            self.named.setdefault(attributes["id"], element)
        if tag == "use":
            self.uses.append(element)


def write_out_clones(data: bytes) -> bytes:
    """Put copies into each `use` of strokes of ours, moved as it moves them.

    Such a `use` refers to nothing any more, and is a group of what it draws. A `use` that draws no
    stroke is left as it is. Raises ValueError where one draws itself, where the document is damaged
    or unsafe, or would become too large.
    """
    if not _USE.search(data) or Data.PATH.encode() not in data:
        return data
    found = _Finder(data)
    writer = _Writer(data, found)
    return writer.text(0, len(data), _view(found.root))


def _view(root: dict[str, str]) -> View:
    into = nested_box({k: v for k, v in root.items() if k in SIDES}, (0.0, 0.0))
    return inner_matrix(root, into or (0.0, 0.0, 0.0, 0.0))[1]


class _Writer:
    """Writes parts of a file with the clones in them."""

    def __init__(self, data: bytes, found: _Finder) -> None:
        self.data, self.found = data, found
        self._begins = [use.begin for use in found.uses]
        self._drawing: list[int] = []  # where the elements begin that are being drawn again
        self._ready: dict[tuple[int, View], bytes | None] = {}
        self._left = limits.MAX_BYTES  # bytes that may still be made

    def text(self, begin: int, end: int, view: View) -> bytes:
        """Write a part of the file; `view` is that of what the part is drawn in."""
        made, at = [], begin
        first, last = (bisect.bisect_left(self._begins, place) for place in (begin, end))
        for use in self.found.uses[first:last]:
            if use.begin < at or use.unseen >= begin:  # in another one, or not drawn
                continue
            copy = self._copy(use, view)
            if copy is not None:
                # what is behind stays on its line, for messages
                lines = self.data.count(b"\n", use.begin, use.end)
                made += [self.data[at : use.begin], copy, b"\n" * lines]
                at = use.end
        made.append(self.data[at:end])
        self._left -= sum(map(len, made))
        if self._left < 0:
            raise ValueError(
                f"with what <use> draws again it is larger than {limits.MAX_BYTES // 2**20} MB: "
                "unlink some clones, or take them out"
            )
        return b"".join(made)

    def _copy(self, use: _Element, view: View) -> bytes | None:
        """Write a `use` with what it draws; None where that is no stroke of ours."""
        given = use.attributes
        href = given.get("href", given.get(XLINK_HREF, "")).strip()
        target = self.found.named.get(href[1:]) if href[:1] == "#" else None
        if target is None or Data.PATH in given or target.tag in NOT_DRAWN:
            return None
        is_symbol = target.tag == "symbol"
        where = placed(use.line, "use", given)
        if target.begin in self._drawing:
            raise ValueError(f'{where}: "{quoted(href)}" draws itself: take it out')
        if len(self._drawing) >= MAX_CLONES:
            raise ValueError(f"{where}: more than {MAX_CLONES} clones of clones: unlink some")
        try:
            x, y = (
                length(given.get(k, "0"), k, whole) for k, whole in zip("xy", view, strict=True)
            )
            found = _viewport(target, given, view) if is_symbol else (IDENTITY, view)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        if found is None:
            return None
        matrix, inner_view = found
        part = (target.inside, target.body_end) if is_symbol else (target.begin, target.end)
        self._drawing.append(target.begin)
        drawn = self._again(*part, inner_view)
        self._drawing.pop()
        if drawn is None:
            return None
        if is_symbol:
            tag = self.data[target.begin : target.inside]
            drawn = _group(b"g", _others(tag), _group(b"g", _matrix(matrix), drawn))
        tag = self.data[use.begin : use.inside]
        name = NAME.match(tag)
        moved = _group(b"g", _matrix((1.0, 0.0, 0.0, 1.0, x, y)), drawn)
        return _group(name[0][1:] if name else b"g", _others(tag), moved)

    def _again(self, begin: int, end: int, view: View) -> bytes | None:
        """Write a part of the file that is drawn again; None where no stroke of ours is in it."""
        key = (begin, view)
        if key not in self._ready:
            text = self.text(begin, end, view).replace(b"\n", b" ")
            self._ready[key] = text if Data.PATH.encode() in text else None
        return self._ready[key]


def _viewport(symbol: _Element, use: Mapping[str, str], view: View) -> tuple[Affine, View] | None:
    """Find the matrix of what is in a symbol, as a `use` draws it, and its view; None: undrawn.

    Raises ValueError.
    """
    sides = {k: v for k, v in use.items() if k in ("width", "height")}
    attributes = symbol.attributes | sides
    into = nested_box(attributes, view)
    return None if into is None else inner_matrix(attributes, into)


def _others(tag: bytes) -> bytes:
    """Give the attributes of a start tag, a space before each, but those that place it."""
    return b"".join(
        b" %s=%s" % (name, value)
        for name, value in ATTRIBUTE.findall(tag)
        if not _PLACE.fullmatch(name)
    )


def _matrix(matrix: Affine) -> bytes:
    return b' transform="matrix(%s)"' % " ".join(map(repr, matrix)).encode()


def _group(name: bytes, attributes: bytes, content: bytes) -> bytes:
    return b"<%s%s>%s</%s>" % (name, attributes, content, name)
