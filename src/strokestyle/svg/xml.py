"""Walk an XML document from anywhere, within limits, with the place of every error."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from xml.parsers import expat

from .. import files as limits
from ..files import quoted

SVG_NAMESPACE = "http://www.w3.org/2000/svg"
# as bytes of a file: a start tag, whose values may hold ">", the name in it, and its attributes
START_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
NAME = re.compile(rb"<[^\s/>]+")
ATTRIBUTE = re.compile(rb"""\s+([^\s=>/]+)\s*=\s*("[^"]*"|'[^']*')""")
UNSAFE = (
    'its document type has declarations of its own ("<!DOCTYPE svg [...]>"); '
    "save it as plain SVG, or take them out"
)


class SaxReader:
    """Walks through a document as expat reads it; no tree is built.

    Parameters
    ----------
    start : called with (namespace, tag, attributes) at the beginning of every element. Attributes
        of other namespaces have names such as "http://www.w3.org/1999/xlink}href". A ValueError of
        it is raised with the element's place before it.
    end : called at the end of every element
    text : called with text between elements, in pieces
    """

    def __init__(
        self,
        start: Callable[[str, str, dict[str, str]], None],
        end: Callable[[], None],
        text: Callable[[str], None] | None = None,
    ):
        self.start, self.end = start, end
        self.elements = self.depth = 0
        self.parser = expat.ParserCreate(namespace_separator="}")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.EntityDeclHandler = self._refuse
        if text is not None:
            self.parser.CharacterDataHandler = text

    @property
    def line(self) -> int:
        """The line, from 1, where what is being read begins."""
        return self.parser.CurrentLineNumber

    @property
    def place(self) -> int:
        """The byte, from 0, where what is being read begins; behind an empty element at its end."""
        return self.parser.CurrentByteIndex

    def walk(self, data: bytes) -> None:
        """Read a document. Raises ValueError where it is no SVG, damaged, unsafe or too large."""
        # every other byte of UTF-16 is NUL; the parser's own handlers refuse what this first look
        # may not see
        plain = data.replace(b"\0", b"") if b"\0" in data else data
        if b"<!entity" in plain.lower():
            raise ValueError(UNSAFE)
        if data.count(b"<") > 2 * limits.MAX_ELEMENTS + 100:
            raise ValueError(
                f"more than {limits.MAX_ELEMENTS} elements: simplify the drawing first"
            )
        # the parser hands over an element whole, however many attributes it has
        if data.count(b"=") > limits.MAX_ATTRIBUTES:
            raise ValueError(
                f"more than {limits.MAX_ATTRIBUTES} attributes: simplify the drawing first"
            )
        try:
            self.parser.Parse(data, True)
        except expat.ExpatError as error:
            raise ValueError(f"not an SVG file (XML expected: {error})") from None
        except LookupError as error:  # an encoding that Python does not know
            raise ValueError(f"not an SVG file ({error}); save it as UTF-8") from None

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self.elements += 1
        if self.elements > limits.MAX_ELEMENTS or self.depth >= limits.MAX_DEPTH:
            raise ValueError(
                f"more than {limits.MAX_ELEMENTS} elements, or {limits.MAX_DEPTH} inside one "
                "another: simplify it first"
            )
        namespace, _, tag = name.rpartition("}")
        if not self.depth and not (namespace in ("", SVG_NAMESPACE) and tag == "svg"):
            raise ValueError(
                f"not an SVG file: its first element is <{quoted(tag)}>; save the drawing as .svg"
            )
        self.depth += 1
        try:
            self.start(namespace, tag, attributes)
        except ValueError as error:
            raise ValueError(f"{placed(self.line, tag, attributes)}: {error}") from None

    def _end(self, _: str) -> None:
        self.depth -= 1
        self.end()

    def _doctype(self, *declaration: object) -> None:
        """Refuse declarations of a file's own; that of old files is not fetched."""
        if declaration[-1]:  # it has an internal subset
            self._refuse()

    def _refuse(self, *_: object) -> None:
        raise ValueError(UNSAFE)


def placed(line: int, tag: str, attributes: dict[str, str]) -> str:
    """Name an element for a message: by its line, its tag and its id."""
    which = f' id="{quoted(attributes["id"])}"' if "id" in attributes else ""
    return f"line {line}, <{tag}{which}>"


def as_utf8(data: bytes) -> bytes:
    """Give a document in UTF-16 in UTF-8, without its XML declaration; another is the same."""
    if b"\0" not in data[:4]:
        return data
    encoding = {b"<\0": "utf-16-le", b"\0<": "utf-16-be"}.get(data[:2], "utf-16")
    try:
        text = data.decode(encoding, "surrogatepass").removeprefix("\ufeff")
    except UnicodeDecodeError:
        return data
    if text.startswith("<?xml"):
        text = text.partition("?>")[2]
    return text.encode("utf-8", "surrogatepass")


def css_property(name: str, style: str, attributes: Mapping[str, str]) -> str:
    """Look up a CSS property: in the style attribute, else the attribute of that name, else ""."""
    found = re.findall(rf"(?:^|;)\s*{name}\s*:([^;!]*)", style[:10_000]) if name in style else ()
    return (found[-1] if found else attributes.get(name, "")).strip().lower()
