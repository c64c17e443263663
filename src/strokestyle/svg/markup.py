"""Elements of a document, and the numbers and path data in their attributes as text."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

KEPT = 1024  # whole numbers below it, whose texts are kept


@dataclass(frozen=True)
class Element:
    """An element of an SVG document: its tag and attributes, and the elements or text in it."""

    tag: str
    attributes: dict[str, str]
    children: tuple[Element, ...] = ()
    text: str = ""


def printable(text: str) -> str:
    """Leave out what XML 1.0 cannot hold.

    Markup characters are escaped where text is made of a tree.
    """
    return "".join(
        c
        for c in text
        if c in "\t\n" or " " <= c < "\ud800" or "\ue000" <= c <= "\ufffd" or c > "\uffff"
    )


# ------------------------------------------------------------------------------------------ numbers


def number(value: float, decimals: int) -> str:
    """The shortest text of a number with at most so many decimals."""
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if text.startswith("0."):
        return text[1:]
    return "-" + text[2:] if text.startswith("-0.") else "0" if text == "-0" else text


def units(values: np.ndarray, decimals: int) -> np.ndarray:
    """Values in whole numbers of 10^-decimals."""
    return np.rint(np.asarray(values) * 10**decimals).astype(np.int64)


def numbers(values: np.ndarray, decimals: int) -> list[str]:
    """Whole numbers of 10^-decimals -> text, flat."""
    return list(map(_texts(decimals).__getitem__, values.ravel().tolist()))


class _Texts(dict[int, str]):
    """The texts that `number` gives of whole numbers of 10^-decimals.

    Those of small ones are kept: most numbers of a path are steps from point to point.
    """

    def __init__(self, decimals: int) -> None:
        self.decimals = decimals

    def __missing__(self, value: int) -> str:
        text = _units_text(value, self.decimals)
        if abs(value) < KEPT:
            self[value] = text
        return text


@functools.cache  # there are a few numbers of decimals
def _texts(decimals: int) -> _Texts:
    return _Texts(decimals)


def _units_text(value: int, decimals: int) -> str:
    """The text that `number` gives of value 10^-decimals, at half its cost."""
    digits = str(abs(value))
    if decimals:
        whole, part = digits[:-decimals], digits[-decimals:].zfill(decimals).rstrip("0")
        digits = f"{whole}.{part}" if part else whole or "0"
    return digits if value >= 0 else "-" + digits


# -------------------------------------------------------------------------------------------- paths


def rings_path(rings: list[np.ndarray], decimals: int = 2) -> str:
    """Rings of cubics [(K, 4, 2), ...] as path data with relative coordinates."""
    parts = []
    for ring in rings:
        points = units(ring, decimals)
        begin = points[:, :1]
        steps = numbers(points[:, 1:] - begin, decimals)
        head = numbers(points[0, 0], decimals)
        parts.append(f"M{head[0]} {head[1]}c{' '.join(steps)}z")
    return "".join(parts).replace(" -", "-")


def polyline_path(xy: np.ndarray, decimals: int = 2, closed: bool = False) -> str:
    """A polyline (n, 2) as path data with relative coordinates.

    A closed one repeats its first point, which z draws.
    """
    points = units(xy[:-1] if closed and len(xy) > 2 else xy, decimals)
    head, steps = numbers(points[0], decimals), numbers(np.diff(points, axis=0), decimals)
    return f"M{head[0]} {head[1]}l{' '.join(steps)}{'z' if closed else ''}".replace(" -", "-")


def hex_color(color) -> str:
    """(r, g, b) in [0, 1] as #rrggbb."""
    return "#" + np.rint(np.clip(color, 0, 1) * 255).astype(np.uint8).tobytes().hex()
