"""Style sheets of SVG documents: what `<style>` says of elements by tag, class and id."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .xml import SVG_NAMESPACE, SaxReader

MAX_CHARACTERS = 1_000_000  # of style sheets that are looked at
MAX_RULES = 10_000
MAX_COMPOUNDS = 8  # of a selector: "g .a > path" has three
_COMMENT = re.compile(r"/\*.*?\*/|<!--|-->", re.DOTALL)
_RULE = re.compile(r"([^{}]*)\{([^{}]*)\}")
_COMPOUND = re.compile(r"(\*|[a-zA-Z][\w-]*)?((?:[.#][\w-]+)*)")
_STYLE = re.compile(rb"<(?:[\w.-]+:)?style\b")
_SHOWN_MEDIA = re.compile(r"\s*@media\s+(?:all|screen)\s*")


class Named(NamedTuple):
    """An element as selectors see it."""

    tag: str
    id: str
    classes: frozenset[str]

    @classmethod
    def of(cls, tag: str, attributes: Mapping[str, str]) -> Named:
        """The element of a tag and attributes."""
        return cls(tag, attributes.get("id", ""), frozenset(attributes.get("class", "").split()))


class _Compound(NamedTuple):
    """Part of a selector that one element is to meet: "path.a#b"; "" and none ask nothing."""

    tag: str
    id: str
    classes: frozenset[str]
    child: bool  # it is to stand directly in what the part before names

    def meets(self, element: Named) -> bool:
        return (
            self.tag in ("", element.tag)
            and self.id in ("", element.id)
            and self.classes <= element.classes
        )


class _Rule(NamedTuple):
    weight: tuple[int, int, int, int]  # ids, classes, tags, and its place among the rules
    selector: tuple[_Compound, ...]
    properties: dict[str, str]


class StyleSheet:
    """The rules of a document's style sheets.

    Of selectors, tags, classes and ids, one inside the other or directly so, are looked at; rules
    with others, and those for print, are left out. Nothing is fetched.

    Parameters
    ----------
    text : of all style elements
    """

    def __init__(self, text: str):
        self._by_key: dict[str, list[_Rule]] = {}
        count = 0
        for selectors, body in _RULE.findall(_plain(text[:MAX_CHARACTERS])):
            for selector in map(_selector, selectors.split(",")):
                if selector is None or count >= MAX_RULES:
                    continue
                count += 1
                weight = (
                    sum(bool(part.id) for part in selector),
                    sum(len(part.classes) for part in selector),
                    sum(bool(part.tag) for part in selector),
                    count,
                )
                rule = _Rule(weight, selector, declarations(body))
                self._by_key.setdefault(_key(selector[-1]), []).append(rule)

    def properties(self, elements: Sequence[Named]) -> dict[str, str]:
        """What the rules say of the last of elements that stand in one another."""
        if not self._by_key:
            return {}
        element = elements[-1]
        keys = ["", element.tag, f"#{element.id}", *(f".{name}" for name in element.classes)]
        rules = [
            rule
            for key in keys
            for rule in self._by_key.get(key, ())
            if _matches(rule.selector, elements)
        ]
        found: dict[str, str] = {}
        for rule in sorted(rules):
            found |= rule.properties
        return found


def is_for_screens(attributes: Mapping[str, str]) -> bool:
    """Tell whether a style element with these attributes is of CSS, and not for print alone."""
    media = attributes.get("media", "").lower()
    sort = attributes.get("type", "text/css").strip().lower()
    return sort in ("", "text/css") and (not media or "all" in media or "screen" in media)


def sheet_of(data: bytes) -> StyleSheet | None:
    """Read the style sheets of a document; None where it has none.

    Raises ValueError where it is damaged, unsafe or too large.
    """
    plain = data.replace(b"\0", b"") if b"\0" in data else data
    if not _STYLE.search(plain):
        return None
    text: list[str] = []
    shown: list[bool] = []  # of the open elements: whether it is a style sheet

    def start(namespace: str, tag: str, attributes: dict[str, str]) -> None:
        ours = tag == "style" and namespace in ("", SVG_NAMESPACE)
        shown.append(ours and is_for_screens(attributes))

    def end() -> None:
        shown.pop()

    def add(words: str) -> None:
        if shown and shown[-1]:
            text.append(words)

    SaxReader(start, end, add).walk(data)
    return StyleSheet("".join(text))


def declarations(text: str) -> dict[str, str]:
    """Read "name: value; ..." as values by name, in lower case; "!important" is left out."""
    pairs = (part.partition(":") for part in text[:10_000].split(";"))
    return {
        name.strip().lower(): value.partition("!")[0].strip().lower()
        for name, colon, value in pairs
        if colon
    }


def _plain(text: str) -> str:
    """Rules only: no comments, no at-rules but what is in those for screens."""
    text, made, at = _COMMENT.sub(" ", text), [], 0
    for match in re.finditer(r"@[^{;]*(?:;|\{)", text):
        if match.start() < at:
            continue
        made.append(text[at : match.start()])
        at = match.end()
        if match[0].endswith("{"):
            depth = 1
            while at < len(text) and depth:
                depth += {"{": 1, "}": -1}.get(text[at], 0)
                at += 1
            if _SHOWN_MEDIA.fullmatch(match[0][:-1]):
                made.append(text[match.end() : at - 1])
    return "".join([*made, text[at:]])


def _selector(text: str) -> tuple[_Compound, ...] | None:
    """The parts of a selector; None where it has any that are not looked at."""
    words, parts, child = text.replace(">", " > ").split(), [], False
    for word in words:
        if word == ">":
            child = True
            continue
        match = _COMPOUND.fullmatch(word)
        if match is None:
            return None
        names = re.findall(r"([.#])([\w-]+)", match[2])
        ids = [name for mark, name in names if mark == "#"]
        classes = frozenset(name for mark, name in names if mark == ".")
        tag = "" if match[1] in (None, "*") else match[1]
        parts.append(_Compound(tag, ids[0] if ids else "", classes, child))
        child = False
    return tuple(parts) if 0 < len(parts) <= MAX_COMPOUNDS else None


def _key(part: _Compound) -> str:
    """By which of an element's names rules for it are found."""
    if part.id:
        return f"#{part.id}"
    return f".{min(part.classes)}" if part.classes else part.tag


def _matches(selector: Sequence[_Compound], elements: Sequence[Named]) -> bool:
    """Whether a selector names the last of elements that stand in one another."""
    *before, last = selector
    if not elements or not last.meets(elements[-1]):
        return False
    if not before:
        return True
    around = range(len(elements) - 1, 0, -1) if not last.child else [len(elements) - 1]
    return any(_matches(before, elements[:end]) for end in around)
