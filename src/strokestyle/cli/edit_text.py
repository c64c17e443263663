"""Edits as the command line says them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..drawing.edit import (
    check_range,
    keep,
    move,
    recolor,
    simplify,
    smooth,
    taper,
    thicken,
    wiggle,
)
from ..drawing.strokes import Drawing, Strokes, lengths
from ..geometry.curves import KINDS
from ..geometry.parts import part_name


@dataclass(frozen=True)
class NamedDrawing:
    """A drawing with names for its strokes: what an edit takes and gives.

    Parameters
    ----------
    drawing : Drawing
    ids : (C,) names, as `--move` knows the strokes by; "" is none
    """

    drawing: Drawing
    ids: tuple[str, ...]


Edit = Callable[[NamedDrawing, int], NamedDrawing]  # (sheet, seed)


def parse_edit(name: str, text: str) -> Edit:
    """An edit as the command line says it: "thickness", "contour=1.5". Raises ValueError on what is none.

    What stands before "=" are kinds of line and names of parts, with commas between. Whether the drawing has such a
    part is not known before the edit is made; it raises ValueError then.
    """
    if name == "move":
        return _parse_move(text)
    if name == "drop":
        return _parse_drop(text)
    which, _, value = text.rpartition("=")
    which = which or None
    if name == "recolor":
        color = _color(value)
        return _on(which, lambda drawing, only, seed: recolor(drawing, color, only))
    numbers = _numbers(value, f"--{name}", 2 if name == "wiggle" else 1)
    edit = {
        "thickness": lambda drawing, only, seed: thicken(drawing, *numbers, only),
        "wiggle": lambda drawing, only, seed: wiggle(drawing, *numbers, seed, only),
        "smooth": lambda drawing, only, seed: smooth(drawing, *numbers, only),
        "simplify": lambda drawing, only, seed: simplify(drawing, *numbers, only),
        "taper": lambda drawing, only, seed: taper(drawing, *numbers, only),
    }[name]
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (1, 1), np.zeros((0, 4)))
    edit(nothing, None, 0)  # so that bad numbers are refused before any work
    return _on(which, edit)


def _on(which: str | None, edit) -> Edit:
    def apply(sheet: NamedDrawing, seed: int) -> NamedDrawing:
        only = None if which is None else strokes_named(sheet.drawing, which)
        return NamedDrawing(edit(sheet.drawing, only, seed), sheet.ids)

    return apply


def strokes_named(drawing: Drawing, which: str) -> np.ndarray:
    """The strokes (C,) bool of kinds and parts, as "contour,wheel" names them; where a name is both, it is the kind.

    Raises ValueError on a name that is neither, telling those that there are.
    """
    parts = () if drawing.parts is None else drawing.parts.names
    each = [
        part_name(name) for name in ([which] if part_name(which) in parts else which.split(","))
    ]
    wanted = [name for name in each if name]
    unknown = [name for name in wanted if name not in (*KINDS, *parts)]
    if unknown or not wanted:
        few = ", ".join(sorted(parts)[:20]) + ", ..." * (len(parts) > 20)
        some = f"the parts {few}" if parts else "no named parts"
        raise ValueError(
            f"{', '.join(map(repr, unknown)) or 'nothing'}: no such kind of line or part; there are the kinds "
            f"{', '.join(KINDS)} and {some}"
        )
    chosen = np.isin(drawing.strokes.kind, [KINDS.index(name) for name in wanted if name in KINDS])
    for name in wanted:
        if name not in KINDS:
            chosen |= drawing.parts.index == parts.index(name)
    return chosen


def _parse_move(text: str) -> Edit:
    parts = text.rsplit(":", 2)
    if len(parts) != 3 or not parts[0]:
        raise ValueError(
            f"--move is STROKE:POINT:DX,DY, for instance s004:0.5:20,-10, got {text!r}"
        )
    (point,), by = (
        _numbers(parts[1], "the point of --move", 1),
        _numbers(parts[2], "the way of --move", 2),
    )
    check_range("the point of --move", point, 0.0, 1.0)

    def apply(sheet: NamedDrawing, seed: int) -> NamedDrawing:
        return NamedDrawing(move(sheet.drawing, _stroke(sheet, parts[0]), point, by), sheet.ids)

    return apply


def _stroke(sheet: NamedDrawing, name: str) -> int:
    if name in sheet.ids:
        return sheet.ids.index(name)
    if name.isdigit() and int(name) < len(sheet.ids):
        return int(name)
    some = ", ".join(sheet.ids[:3] + (("...",) if len(sheet.ids) > 3 else ()))
    raise ValueError(f"--move: there is no stroke {name!r}; there are {some or 'none'}")


def _parse_drop(text: str) -> Edit:
    match = re.fullmatch(r"(.*?)(?:([<>])\s*([0-9]*\.?[0-9]+)\s*(?:px)?)?\s*", text, re.DOTALL)
    which = match[1].strip() or None
    if not (which or match[2]):
        raise ValueError(
            f"--drop is a length such as '<20', kinds or parts such as valley,ridge, or both: 'valley<20'; got {text!r}"
        )

    def apply(sheet: NamedDrawing, seed: int) -> NamedDrawing:
        parts = sheet.drawing.parts
        whole = parts is not None and part_name(text) in parts.names  # a part may be called "a<20"
        asked = text if whole else which
        gone = (
            np.ones(len(sheet.drawing.strokes), bool)
            if asked is None
            else strokes_named(sheet.drawing, asked)
        )
        if match[2] and not whole:
            long = lengths(sheet.drawing)
            gone &= long < float(match[3]) if match[2] == "<" else long > float(match[3])
        ids = tuple(name for name, out in zip(sheet.ids, gone.tolist(), strict=True) if not out)
        return NamedDrawing(keep(sheet.drawing, ~gone), ids)

    return apply


def _numbers(text: str, what: str, count: int) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(
            f"{what} takes {'a number' if count == 1 else 'two numbers, such as 4,30'}, got {text!r}"
        )
    return values


def _color(text: str) -> tuple[float, ...]:
    from PIL import ImageColor

    try:
        return tuple(value / 255.0 for value in ImageColor.getrgb(text[:60])[:3])
    except ValueError:
        raise ValueError(f"a colour is #rrggbb or a name such as navy, got {text!r}") from None
