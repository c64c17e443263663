"""Style sheets of SVG documents: what `<style>` says of elements.

Selectors are met part by part from the root down, each element once, as many at a time as stand
in its way: a sheet of "g g g g g g x" costs libraries that try all ancestors, for each, a minute.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from ..files import quoted
from .selectors import Compound, Named, Weight, parse_selector, split_list, weight_of
from .xml import ATTRIBUTE, NAME, START_TAG, SVG_NAMESPACE, SaxReader, as_utf8

MAX_CHARACTERS = 1_000_000  # of style sheets that are looked at
MAX_RULES = 10_000  # parts of selectors, at most
MAX_LOOKS = 10_000_000  # at an element for a part of a selector
INK = (  # properties of strokes of ours that are looked at
    "display", "visibility", "opacity", "fill", "fill-opacity", "transform", "transform-origin",
    "clip-path", "mask", "filter",
)  # fmt: skip
LINES = ("stroke", "stroke-opacity", "stroke-width", "clip-rule", "overflow")  # of others, besides
# at-rules that say nothing of shapes at rest, seen on a screen as it is
_IDLE = re.compile(
    r"@(?:charset|namespace|page|property|counter-style|font-[\w-]+|(?:-[a-z]+-)?keyframes"
    r"|media\s+(?:only\s+)?(?:print|speech)|media[^{]*prefers-)\b",
    re.IGNORECASE,
)
_SHOWN_MEDIA = re.compile(r"@media\s+(?:all|screen)\s*", re.IGNORECASE)
_STYLE = re.compile(rb"<(?:[\w.-]+:)?style\b")
_ENDS = re.compile(r"[{;]")
_BRACES = re.compile(r"[{}]")

Properties = dict[str, str]


class Declared(NamedTuple):
    """Values of properties by name, and those that are important."""

    usual: Properties
    important: Properties

    def over(self, rules: Declared) -> Properties:
        """What holds where these are an element's own, and others those of rules for it."""
        return rules.usual | self.usual | rules.important | self.important


NOTHING = Declared({}, {})


@dataclass(frozen=True)
class Styles:
    """What a document's style sheets say.

    Parameters
    ----------
    of : what rules say of each element, by its number in the document, where they say anything
    unread : selectors and other rules that are not understood, in order
    """

    of: Mapping[int, Declared]
    unread: tuple[str, ...]


class _Step(NamedTuple):
    """A part of a selector; `after` and `bit` are of sets of parts met, the one before's and its.

    `rule` : place of the rule that is met with this part; -1: there are more
    """

    compound: Compound
    after: int
    bit: int
    rule: int


class _Rule(NamedTuple):
    weight: tuple[Weight, int]  # and its place among the rules
    declared: Declared


@dataclass
class _Open:
    """The parts of selectors that an open element met, and others to it, as sets of bits.

    `own` : it; `above` : it, or one that it is in
    `last`, `before` : the last of its children as yet, and any of them
    """

    own: int = 0
    above: int = 0
    last: int = 0
    before: int = 0

    def met(self, combinator: str) -> int:
        """What was met by those that a combinator leads to from a child that is to come."""
        return {" ": self.above, ">": self.own, "+": self.last, "~": self.before}[combinator]


class StyleSheet:
    """The rules of a document's style sheets. Nothing is fetched.

    Parameters
    ----------
    text : of all style elements

    Attributes
    ----------
    unread : selectors and other rules that are not understood
    """

    def __init__(self, text: str):
        self.unread: list[str] = []
        self._by_key: dict[str, list[_Step]] = {}
        self._rules: list[_Rule] = []
        self._bits = 0
        for selectors, body in self._blocks(_without_comments(text[:MAX_CHARACTERS])):
            declared = declarations(body)
            if not {*INK, *LINES} & {*declared.usual, *declared.important}:
                continue
            for selector in split_list(selectors):
                try:
                    self._add(parse_selector(selector), declared)
                except ValueError:
                    self.unread.append(" ".join(selector.split()))

    def _add(self, selector: tuple[Compound, ...], declared: Declared) -> None:
        if self._bits + len(selector) > MAX_RULES:
            raise ValueError(f"more than {MAX_RULES} rules")
        self._rules.append(_Rule((weight_of(selector), len(self._rules)), declared))
        after, last = 0, len(selector) - 1
        for k, compound in enumerate(selector):
            bit = 1 << self._bits
            rule = len(self._rules) - 1 if k == last else -1
            self._by_key.setdefault(compound.key, []).append(_Step(compound, after, bit, rule))
            self._bits += 1
            after = bit

    def _blocks(self, text: str) -> Iterator[tuple[str, str]]:
        """Selectors and declarations of rules, those in at-rules for screens too."""
        at = 0
        while (match := _ENDS.search(text, at)) is not None:
            head, begin = text[at : match.start()].strip(), match.end()
            at = begin if match[0] == ";" else _block_end(text, begin)
            if at < 0:  # not closed: no rule
                return
            if head.startswith("@"):
                if match[0] == "{" and _SHOWN_MEDIA.fullmatch(head):
                    yield from self._blocks(text[begin : at - 1])
                elif not _IDLE.match(head):
                    self.unread.append(" ".join(head.split()))
            elif match[0] == "{":
                yield head, text[begin : at - 1]

    def match(self, elements: Sequence[Named]) -> dict[int, Declared]:
        """What rules say of each element, by its place, where they say anything.

        `elements` : of a document, in its order
        Raises ValueError where that would take too long.
        """
        found: dict[int, Declared] = {}
        opened, left = [_Open()], MAX_LOOKS
        for i, element in enumerate(elements if self._rules else ()):
            del opened[element.depth + 1 :]
            above, own, rules = opened[-1], 0, []
            steps = self._steps(element)
            left -= len(steps)
            if left < 0:
                raise ValueError("its style sheets are too intricate: simplify it first")
            for step in steps:
                if step.after and not step.after & above.met(step.compound.combinator):
                    continue
                if step.compound.meets(element):
                    own |= step.bit
                    rules += [self._rules[step.rule]] if step.rule >= 0 else []
            above.last = own
            above.before |= own
            opened.append(_Open(own, own | above.above))
            if rules:
                found[i] = _together(rules)
        return found

    def _steps(self, element: Named) -> list[_Step]:
        """The parts of selectors that an element may meet."""
        keys = {"", element.tag, f"#{element.id}", *(f".{name}" for name in element.classes)}
        return [step for key in keys for step in self._by_key.get(key, ())]


def _together(rules: list[_Rule]) -> Declared:
    """What rules for one element say: the heaviest last, of two as heavy the later."""
    usual: Properties = {}
    important: Properties = {}
    for rule in sorted(rules, key=lambda rule: rule.weight):
        usual |= rule.declared.usual
        important |= rule.declared.important
    return Declared(usual, important)


@dataclass
class _Document:
    """The elements of a document, and the text of its style sheets."""

    elements: list[tuple[str, dict[str, str], int]] = field(default_factory=list)  # and depth
    places: list[int] = field(default_factory=list)  # the byte where each begins
    text: list[str] = field(default_factory=list)
    shown: list[bool] = field(default_factory=list)  # of the open elements: is a style sheet

    def read(self, data: bytes) -> None:
        """Read a document. Raises ValueError where it is damaged, unsafe or too large."""
        self.xml = SaxReader(self._start, self._end, self._text)
        self.xml.walk(data)

    def _start(self, namespace: str, tag: str, attributes: dict[str, str]) -> None:
        svg = namespace in ("", SVG_NAMESPACE)
        self.elements.append((tag, attributes, len(self.shown)))
        self.places.append(self.xml.place)
        self.shown.append(svg and tag == "style" and is_for_screens(attributes))

    def _end(self) -> None:
        self.shown.pop()

    def _text(self, text: str) -> None:
        if self.shown and self.shown[-1]:
            self.text.append(text)

    def named(self) -> list[Named]:
        """The elements as selectors see them."""
        nth: list[tuple[tuple[int, str], int]] = []  # by siblings: all, those of its tag, in turn
        count: dict[tuple[int, str], int] = {}
        path = [-1]  # the open elements
        for i, (tag, _, depth) in enumerate(self.elements):
            del path[depth + 1 :]
            for key in ((path[-1], ""), (path[-1], tag)):
                count[key] = count.get(key, 0) + 1
                nth.append((key, count[key]))
            path.append(i)
        made = []
        for i, (tag, attributes, depth) in enumerate(self.elements):
            (all_, n), (same, m) = nth[2 * i : 2 * i + 2]
            places = (n, count[all_] + 1 - n, m, count[same] + 1 - m)
            classes = frozenset(attributes.get("class", "").split())
            made.append(Named(tag, attributes, attributes.get("id", ""), classes, places, depth))
        return made


def is_for_screens(attributes: Mapping[str, str]) -> bool:
    """Tell whether a style element with these attributes is of CSS, and not for print alone."""
    media = attributes.get("media", "").lower()
    sort = attributes.get("type", "text/css").strip().lower()
    return sort in ("", "text/css") and (not media or "all" in media or "screen" in media)


def styles_of(data: bytes) -> Styles | None:
    """Read what the style sheets of a document say of its elements; None where it has none.

    Raises ValueError where it is damaged, unsafe or too large.
    """
    read = _read(data)
    return None if read is None else read[1]


def name_rules(unread: Sequence[str]) -> str:
    """Name rules that are not understood, for a message: the first three, and how many more."""
    named = ", ".join(quoted(rule) for rule in unread[:3])
    return f"{named} and {len(unread) - 3} more" if len(unread) > 3 else named


def write_out_rules(data: bytes) -> tuple[bytes, tuple[str, ...]]:
    """Put what style sheets say of elements' ink into their own `style`.

    The document, in UTF-8 where it was in UTF-16, and what of the sheets is not understood. Where
    they say nothing the document is the same. Raises ValueError as `styles_of` does.
    """
    data = as_utf8(data)
    read = _read(data)
    if read is None:
        return data, ()
    document, styles = read
    made, at = [], 0
    for i, rules in sorted(styles.of.items()):
        if not {*INK} & {*rules.usual, *rules.important}:
            continue
        own, begin = document.elements[i][1].get("style", ""), document.places[i]
        tag = START_TAG.match(data, begin)
        if tag is None:
            raise ValueError("not an SVG file of plain letters; save it as UTF-8")
        made += [data[at:begin], _with_style(tag[0], ruled_style(own, rules))]
        at = tag.end()
    return b"".join([*made, data[at:]]), styles.unread


def _read(data: bytes) -> tuple[_Document, Styles] | None:
    if not _STYLE.search(data.replace(b"\0", b"") if b"\0" in data else data):
        return None
    document = _Document()
    document.read(data)
    sheet = StyleSheet("".join(document.text))
    return document, Styles(sheet.match(document.named()), tuple(sheet.unread))


def ruled_style(own: str, rules: Declared) -> str:
    """Give the `style` of an element: what rules say of its ink, and over it what itself says."""
    usual, important = (
        {name: value for name, value in each.items() if name in INK} for each in rules
    )
    if important:
        important |= declarations(own).important
    return ";".join(filter(None, (_listed(usual), own, _listed(important))))


def _with_style(tag: bytes, style: str) -> bytes:
    """A start tag with another style."""
    value = quoteattr(style).encode("ascii", "xmlcharrefreplace")
    for match in ATTRIBUTE.finditer(tag):
        if match[1] == b"style":
            return tag[: match.start(2)] + value + tag[match.end(2) :]
    name = NAME.match(tag)
    end = name.end() if name else 1
    return tag[:end] + b" style=" + value + tag[end:]


def _listed(properties: Properties) -> str:
    return ";".join(f"{name}:{value}" for name, value in properties.items())


def declarations(text: str) -> Declared:
    """Read "name: value; ...", all in lower case but references."""
    found = Declared({}, {})
    for part in text[:10_000].split(";"):
        name, colon, value = part.partition(":")
        value, mark, _ = value.partition("!")
        if colon:
            value = value.strip() if "url(" in value else value.strip().lower()
            (found.important if mark else found.usual)[name.strip().lower()] = value
    return found


def _without_comments(text: str) -> str:
    for mark in ("<!--", "-->"):
        text = text.replace(mark, " ")
    first, *others = text.split("/*")
    return " ".join([first, *(part.partition("*/")[2] for part in others)])


def _block_end(text: str, at: int) -> int:
    """The place behind the brace that closes a block, which begins here; -1: there is none."""
    depth = 1
    while (match := _BRACES.search(text, at)) is not None:
        depth += 1 if match[0] == "{" else -1
        at = match.end()
        if not depth:
            return at
    return -1
