"""Strokes that a file draws again by `use`, as Inkscape's clones are: written out each alone."""

from __future__ import annotations

import re
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from .. import files as limits
from .format import Data
from .path_data import length
from .xml import SVG_NAMESPACE, SaxReader

XLINK_HREF = "http://www.w3.org/1999/xlink}href"
# of a `use`: where it stands, what it draws and what it is called are not what it hands on
OWN = re.compile(
    rb"""\s(?:x|y|width|height|id|transform|href|[\w-]+:[\w-]+)\s*=\s*("[^"]*"|'[^']*')"""
)
UNSEEN = ("defs", "symbol", "clipPath", "mask", "pattern", "marker")
_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")  # a value may hold ">"


@dataclass(frozen=True)
class _Element:
    """An element's bytes in the file: of its start tag, and of all of it."""

    begin: int
    inside: int
    end: int


class _Finder:
    """Finds the elements that have an id, and those of `use`."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.named: dict[str, _Element] = {}
        self.uses: list[tuple[_Element, dict[str, str]]] = []
        self._open: list[tuple[str, dict[str, str], int]] = []
        self._unseen = 0
        self._xml = SaxReader(self._start, self._end)
        self._xml.walk(data)

    def _start(self, namespace: str, tag: str, attributes: dict[str, str]) -> None:
        tag = tag if namespace == SVG_NAMESPACE else ""
        self._unseen += tag in UNSEEN
        self._open.append((tag, attributes, self._xml.place))

    def _end(self) -> None:
        tag, attributes, begin = self._open.pop()
        tag_end = _TAG.match(self.data, begin)
        inside = tag_end.end() if tag_end else begin
        empty = self.data.endswith(b"/>", begin, inside)
        end = inside if empty else self.data.find(b">", self._xml.place) + 1
        element = _Element(begin, inside, end)
        if "id" in attributes:
            self.named.setdefault(attributes["id"], element)
        if tag == "use" and not self._unseen:
            self.uses.append((element, attributes))
        self._unseen -= tag in UNSEEN


def write_out_clones(data: bytes) -> bytes:
    """Put copies in the place of each `use` of strokes of ours, moved as it moves them.

    Those that draw anything else, or a `use` in turn, are left as they are. Raises ValueError where
    the document is damaged or unsafe, or would become too large.
    """
    if b"<use" not in data or b"\0" in data:
        return data
    found = _Finder(data)
    made, at, size = [], 0, len(data)
    for element, attributes in found.uses:
        href = attributes.get(XLINK_HREF, attributes.get("href", ""))
        drawn = found.named.get(href.removeprefix("#")) if href.startswith("#") else None
        copy = b"" if drawn is None else data[drawn.begin : drawn.end]
        if Data.PATH.encode() not in copy or b"<use" in copy or element.begin < at:
            continue
        text = _start_tag(data[element.begin : element.inside], attributes) + copy + b"</g>"
        size += len(text)
        if size > limits.MAX_BYTES:
            raise ValueError(
                f"with what <use> draws again it is larger than {limits.MAX_BYTES // 2**20} MB: "
                "unlink some clones, or take them out"
            )
        made += [data[at : element.begin], text]
        at = element.end
    return b"".join([*made, data[at:]])


def _start_tag(tag: bytes, attributes: dict[str, str]) -> bytes:
    """Make a group that moves and shows its content as a `use` does, whose start tag is given."""
    x, y = (length(attributes.get(name, "0"), name, 0.0) for name in ("x", "y"))
    moved = f"{attributes.get('transform', '')} translate({x:g} {y:g})".strip()
    others = OWN.sub(b"", tag.removeprefix(b"<")).rstrip(b"/> \t\r\n")
    others = others.partition(b" ")[2]  # without the name
    return b"<g transform=%s %s>" % (quoteattr(moved).encode(), others)
