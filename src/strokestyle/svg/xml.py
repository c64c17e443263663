"""Walk an XML document from anywhere, within limits, with the place of every error."""

from __future__ import annotations

import re
from collections.abc import Callable
from xml.parsers import expat

from .. import files as limits
from ..files import quoted

SVG_NAMESPACE = "http://www.w3.org/2000/svg"
INKSCAPE_NAMESPACE = "http://www.inkscape.org/namespaces/inkscape"
UNSAFE = (
    'its document type has declarations of its own ("<!DOCTYPE svg [...]>"); '
    "save it as plain SVG, or take them out"
)


class SaxReader:
    """Walks through a document as expat reads it; no tree is built.

    `start(namespace, tag, attributes)` is called at the beginning of every element and `end()` at its end; attributes
    of other namespaces have names such as "http://www.w3.org/1999/xlink}href". A ValueError of `start` is raised with
    the element's place before it. `words(text)` is called with text between elements, in pieces.
    """

    def __init__(self, start: Callable, end: Callable, words: Callable | None = None):
        self.start, self.end = start, end
        self.elements = self.depth = 0
        self.parser = expat.ParserCreate(namespace_separator="}")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.EntityDeclHandler = self._refuse
        if words is not None:
            self.parser.CharacterDataHandler = words

    def walk(self, data: bytes) -> None:
        """Raises ValueError on what is no SVG file, or is damaged, unsafe or too large."""
        # every other byte of UTF-16 is NUL; the parser's own handlers refuse what this first look may not see
        if b"<!entity" in (data.replace(b"\0", b"") if b"\0" in data else data).lower():
            raise ValueError(UNSAFE)
        if data.count(b"<") > 2 * limits.MAX_ELEMENTS + 100:
            raise ValueError(
                f"more than {limits.MAX_ELEMENTS} elements: simplify the drawing first"
            )
        if (
            data.count(b"=") > 5 * limits.MAX_ELEMENTS
        ):  # the parser hands over an element whole, however many it has
            raise ValueError(
                f"more than {5 * limits.MAX_ELEMENTS} attributes: simplify the drawing first"
            )
        try:
            self.parser.Parse(data, True)
        except expat.ExpatError as error:
            raise ValueError(f"not an SVG file (XML expected: {error})") from None
        except LookupError as error:  # an encoding that Python does not know
            raise ValueError(f"not an SVG file ({error}); save it as UTF-8") from None

    def _start(self, name: str, attributes: dict[str, str]):
        self.elements += 1
        if self.elements > limits.MAX_ELEMENTS or self.depth >= limits.MAX_DEPTH:
            raise ValueError(
                f"more than {limits.MAX_ELEMENTS} elements, or {limits.MAX_DEPTH} inside one another: simplify it first"
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
            which = f' id="{quoted(attributes["id"])}"' if "id" in attributes else ""
            raise ValueError(
                f"line {self.parser.CurrentLineNumber}, <{tag}{which}>: {error}"
            ) from None

    def _end(self, _):
        self.depth -= 1
        self.end()

    def _doctype(self, name, system, public, has_subset):
        """Old files name SVG's document type, which is not fetched; one with declarations of its own is refused."""
        if has_subset:
            self._refuse()

    def _refuse(self, *_):
        raise ValueError(UNSAFE)


def css_property(name: str, style: str, attributes: dict[str, str]) -> str:
    """A CSS property of the style attribute, else the attribute of that name, else ""."""
    found = re.findall(rf"(?:^|;)\s*{name}\s*:([^;!]*)", style[:10_000]) if name in style else ()
    return (found[-1] if found else attributes.get(name, "")).strip().lower()
