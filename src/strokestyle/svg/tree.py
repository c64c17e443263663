"""SVG documents made with svgwrite: no other module knows it, or makes the text of a file."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable
from xml.etree import ElementTree

import svgwrite
from svgwrite.base import BaseElement

from .format import INKSCAPE_NAMESPACE, LICENSES, PAPER_ID, RDF_NAMESPACES, SvgOptions
from .markup import Element, printable

UNUSED = (
    "xmlns:ev",
    "baseProfile",
)  # of the root, by svgwrite: nothing in our files refers to them
LEADING = ("id", "class")  # attributes that an element's line begins with; others are in order


def _rdf(options: SvgOptions) -> ElementTree.Element:
    """Author and licence as Creative Commons has them in RDF, where Inkscape looks for them."""
    rdf = ElementTree.Element("rdf:RDF", RDF_NAMESPACES)
    work = ElementTree.SubElement(rdf, "cc:Work", {"rdf:about": ""})
    _add_words(work, "dc:format", "image/svg+xml")
    if options.title:
        _add_words(work, "dc:title", options.title)
    if options.author:
        _add_agent(work, "dc:creator", options.author)
    url = LICENSES.get(options.license.upper(), options.license)
    if re.fullmatch(r"https?://\S+", url):
        ElementTree.SubElement(work, "cc:license", {"rdf:resource": printable(url)})
    elif options.license:
        _add_agent(work, "dc:rights", options.license)
    return rdf


def _add_words(parent: ElementTree.Element, tag: str, text: str) -> None:
    ElementTree.SubElement(parent, tag).text = printable(text)


def _add_agent(parent: ElementTree.Element, tag: str, name: str) -> None:
    agent = ElementTree.SubElement(ElementTree.SubElement(parent, tag), "cc:Agent")
    _add_words(agent, "dc:title", name)


class PathEffect(BaseElement):
    """An Inkscape path effect, an element that SVG does not have."""

    elementname = "inkscape:path-effect"


TAGS = ("g", "path", "image", "desc")


class _Ready:
    """An element with all that is in it; of a Document's elements svgwrite asks but their trees."""

    def __init__(self, element: Element):
        self.element = element

    def get_xml(self) -> ElementTree.Element:
        return _tree(self.element)


def _tree(element: Element) -> ElementTree.Element:
    """An element as svgwrite has it: attributes in order, and none that are empty."""
    if element.tag not in TAGS:
        raise ValueError(f"documents of ours have no <{element.tag}>")
    given = {name: value for name, value in sorted(element.attributes.items()) if value}
    made = ElementTree.Element(element.tag, given)
    made.text = element.text or None
    made.extend(map(_tree, element.children))
    return made


class Document(svgwrite.Drawing):
    """A document in the making: words about it and elements, in the order in which they are added.

    Parameters
    ----------
    attributes : of the root
    """

    def __init__(self, attributes: dict[str, str]):
        super().__init__(size=(attributes["width"], attributes["height"]), debug=False)
        self.elements.remove(self.defs)  # empty as yet: it is added with what it holds
        self["xmlns:inkscape"] = INKSCAPE_NAMESPACE
        _set(self, attributes)

    def describe(self, options: SvgOptions) -> None:
        """Add the words about a document: its title and description, author and licence."""
        self.set_desc(*(printable(t) or None for t in (options.title, options.description)))
        if options.license or options.author:
            self.set_metadata(_rdf(options))

    def add_paper(self, box: str, fill: str) -> None:
        """Add a rectangle behind everything; `box` is "x y width height"."""
        x, y, width, height = box.split()
        self.add(self.rect(insert=(x, y), size=(width, height), id=PAPER_ID, fill=fill))

    def add_effects(self, effects: Iterable[Element]) -> None:
        """Add Inkscape's path effects."""
        for effect in effects:
            made = PathEffect(factory=self)
            _set(made, effect.attributes)
            self.defs.add(made)
        if self.defs.elements:
            self.add(self.defs)

    def add_element(self, element: Element) -> None:
        """Add a group, a path or an image and all that is in it."""
        self.add(_Ready(element))

    def get_xml(self) -> ElementTree.Element:
        """The whole as a tree, an element a line: such files go under version control."""
        root = super().get_xml()
        for name in UNUSED:
            del root.attrib[name]
        for element in root.iter():
            if "id" in element.attrib:
                leading = {name: element.attrib[name] for name in LEADING if name in element.attrib}
                element.attrib = leading | element.attrib
            if len(element):
                element.text = "\n"
                for child in element[:-1]:
                    child.tail = "\n"
        root.tail = "\n"
        if len(root):
            root[-1].tail = "\n"
        return root

    def text(self) -> str:
        """The document as a file holds it."""
        file = io.StringIO()
        self.write(file)
        return file.getvalue()


def _set(element: BaseElement, attributes: dict[str, str]) -> None:
    """Set attributes by their own names: svgwrite's keyword arguments would turn "_" into "-"."""
    for name, value in attributes.items():
        element[name] = value
