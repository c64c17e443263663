"""Selectors of style sheets, as far as a document at rest can meet them.

They are those of Selectors Level 4 without namespaces, escapes, :has() and the like.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple, Protocol

MAX_SELECTOR = 1_000  # characters
MAX_COMPOUNDS = 30  # of a selector: "g .a > path" has three
# what no shape at rest is, or no shape is drawn by
NEVER = (
    "hover", "active", "focus", "focus-within", "focus-visible", "visited", "target", "before",
    "after", "first-line", "first-letter",
)  # fmt: skip
PLACES = {  # by which of an element's places, and the terms of An+B where they are no argument
    "first-child": (0, "1"), "last-child": (1, "1"), "nth-child": (0, ""),
    "nth-last-child": (1, ""), "first-of-type": (2, "1"), "last-of-type": (3, "1"),
    "nth-of-type": (2, ""), "nth-last-of-type": (3, ""),
}  # fmt: skip
_STRING = r"""\s*(?:"([^"]*)"|'([^']*)'|([\w-]+))"""
_SIMPLE = re.compile(
    r"(?P<tag>\*|[^\W\d][\w-]*)|\#(?P<id>[\w-]+)|\.(?P<class>[\w-]+)"
    rf"|\[\s*(?P<name>[\w-]+)\s*(?:(?P<sign>[~|^$*]?=){_STRING}\s*(?P<fold>[isIS]?)\s*)?\]"
    r"""|(?P<colons>::?)(?P<pseudo>[\w-]+)(?:\((?P<of>(?:[^()"']|"[^"]*"|'[^']*'|\([^()]*\))*)\))?"""
)
_COMBINATOR = re.compile(r"\s*([>+~])\s*|\s+")
_NTH = re.compile(r"\s*(?:([+-]?\d{0,9})n\s*(?:([+-])\s*(\d{1,9}))?|([+-]?\d{1,9}))\s*")
_PIECE = re.compile(r""""[^"]*"|'[^']*'|[,()\[\]]|[^"'(),\[\]]+|["']""")

Weight = tuple[int, int, int]  # ids; classes, attributes and pseudo-classes; tags


class Named(NamedTuple):
    """An element as selectors see it.

    `places` : from 1, among its siblings, from their last, and likewise among those of its tag
    `depth` : 0 is the root's
    """

    tag: str
    attributes: Mapping[str, str]
    id: str
    classes: frozenset[str]
    places: tuple[int, int, int, int]
    depth: int


class _Test(Protocol):
    def meets(self, element: Named) -> bool: ...


class _Attribute(NamedTuple):
    name: str
    sign: str
    value: str
    fold: bool

    def meets(self, element: Named) -> bool:
        if self.name not in element.attributes:
            return False
        has, value = element.attributes[self.name], self.value
        if self.fold:
            has, value = has.lower(), value.lower()
        match self.sign:
            case "=":
                return has == value
            case "~=":
                return value in has.split()
            case "|=":
                return has == value or has.startswith(value + "-")
            case "^=":
                return bool(value) and has.startswith(value)
            case "$=":
                return bool(value) and has.endswith(value)
            case "*=":
                return bool(value) and value in has
        return True


class _Place(NamedTuple):
    """An+B, of one of an element's places."""

    which: int
    step: int
    first: int

    def meets(self, element: Named) -> bool:
        beyond = element.places[self.which] - self.first
        return beyond == 0 if not self.step else beyond % self.step == 0 <= beyond // self.step


class _Root(NamedTuple):
    def meets(self, element: Named) -> bool:
        return element.depth == 0


class _AnyOf(NamedTuple):
    compounds: tuple[Compound, ...]
    negated: bool

    def meets(self, element: Named) -> bool:
        return self.negated != any(compound.meets(element) for compound in self.compounds)


class Compound(NamedTuple):
    """Part of a selector that one element is to meet: "path.a#b"; "" and none ask nothing.

    `combinator` : how it stands to the part before: " ", ">", "+" or "~"; "" without one
    """

    combinator: str
    tag: str
    ids: frozenset[str]
    classes: frozenset[str]
    tests: tuple[_Test, ...]
    weight: Weight

    def meets(self, element: Named) -> bool:
        """Tell whether an element is what this part alone names."""
        return (
            self.tag in ("", element.tag)
            and (not self.ids or self.ids == {element.id})
            and self.classes <= element.classes
            and all(test.meets(element) for test in self.tests)
        )

    @property
    def key(self) -> str:
        """By which of an element's names rules for it are found."""
        if self.ids:
            return f"#{min(self.ids)}"
        return f".{min(self.classes)}" if self.classes else self.tag


def parse_selector(text: str) -> tuple[Compound, ...]:
    """Read a selector as its parts, of which there is one at least.

    Raises ValueError on one that is not understood.
    """
    text, parts, at, combinator = text.strip(), list[Compound](), 0, ""
    while len(text) <= MAX_SELECTOR and len(parts) < MAX_COMPOUNDS:
        compound, at = _compound(text, at, combinator)
        parts.append(compound)
        if at == len(text):
            return tuple(parts)
        match = _COMBINATOR.match(text, at)
        if match is None:
            break
        combinator, at = match[1] or " ", match.end()
    raise ValueError(f"a selector that is not understood: {text[:MAX_SELECTOR]}")


def split_list(text: str) -> list[str]:
    """Split a list at its commas, but those within brackets and strings."""
    items, depth = [list[str]()], 0
    for piece in _PIECE.findall(text):
        depth += (piece in "([") - (piece in ")]")
        if piece == "," and depth <= 0:
            items.append([])
        else:
            items[-1].append(piece)
    return ["".join(item) for item in items]


def weight_of(selector: tuple[Compound, ...]) -> Weight:
    """Add up the weights of a selector's parts: its specificity."""
    return _sum(part.weight for part in selector)


def _compound(text: str, at: int, combinator: str) -> tuple[Compound, int]:
    """Read the part that begins at a place, and where it ends. Raises ValueError."""
    tag, ids, classes, tests = "", list[str](), list[str](), list[_Test]()
    weights, begin = [(0, 0, 0)], at
    while (match := _SIMPLE.match(text, at)) is not None:
        if match["tag"]:
            if at > begin:
                break
            tag = "" if match["tag"] == "*" else match["tag"]
            more = (0, 0, int(bool(tag)))
        elif match["id"]:
            ids.append(match["id"])
            more = (1, 0, 0)
        elif match["class"]:
            classes.append(match["class"])
            more = (0, 1, 0)
        elif match["name"]:
            value = next((match[k] for k in (6, 7, 8) if match[k] is not None), "")
            fold = (match["fold"] or "").lower() == "i"
            tests.append(_Attribute(match["name"], match["sign"] or "", value, fold))
            more = (0, 1, 0)
        else:
            test, more = _pseudo(match)
            tests.append(test)
        weights.append(more)
        at = match.end()
    if at == begin:
        raise ValueError("no selector")
    names = frozenset(ids), frozenset(classes)
    return Compound(combinator, tag, *names, tuple(tests), _sum(weights)), at


def _sum(weights: Iterable[Weight]) -> Weight:
    ids, classes, tags = map(sum, zip(*weights, strict=True))
    return ids, classes, tags


def _pseudo(match: re.Match[str]) -> tuple[_Test, Weight]:
    """Read a pseudo-class, and its weight. Raises ValueError on one that is not understood."""
    name, argument = match["pseudo"].lower(), match["of"]
    if match["colons"] == "::" or (name in NEVER and argument is None):
        return _AnyOf((), False), (0, 1, 0)
    if name in ("not", "is", "where") and argument is not None:
        parsed = [parse_selector(item) for item in split_list(argument)]
        if any(len(parts) > 1 for parts in parsed):
            raise ValueError(f"a selector of several parts in :{name}()")
        compounds = tuple(parts[0] for parts in parsed)
        heaviest = max(compound.weight for compound in compounds)
        return _AnyOf(compounds, name == "not"), (0, 0, 0) if name == "where" else heaviest
    if name == "root" and argument is None:
        return _Root(), (0, 1, 0)
    if name in ("only-child", "only-of-type") and argument is None:
        # not what is after another, or before one
        which = PLACES["first-child" if name == "only-child" else "first-of-type"][0]
        ends = [Compound("", "", frozenset(), frozenset(), (_Place(which + k, 1, 2),), (0, 0, 0))
                for k in (0, 1)]  # fmt: skip
        return _AnyOf(tuple(ends), True), (0, 1, 0)
    if name in PLACES and (argument is None) == bool(PLACES[name][1]):
        which, terms = PLACES[name]
        return _nth(which, terms or argument or ""), (0, 1, 0)
    raise ValueError(f":{name} is not understood")


def _nth(which: int, text: str) -> _Place:
    """Read An+B. Raises ValueError."""
    words = {"odd": "2n+1", "even": "2n"}
    match = _NTH.fullmatch(words.get(text.strip().lower(), text.lower()))
    if match is None:
        raise ValueError(f'"{text}" is no An+B')
    if match[4] is not None:
        return _Place(which, 0, int(match[4]))
    step = match[1] + "1" if match[1] in ("", "+", "-") else match[1]
    return _Place(which, int(step), int((match[2] or "") + (match[3] or "0")))
