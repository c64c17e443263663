"""Edits as the command line says them: text such as "contour=1.5" -> what changes a drawing."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..drawing.edit import (
    keep,
    move,
    recolor,
    scale_across,
    simplify,
    smooth,
    taper,
    thicken,
    wiggle,
)
from ..drawing.strokes import Drawing, Strokes, lengths
from ..geometry.curves import is_kind
from ..geometry.kinds import KINDS
from ..geometry.parts import Parts, part_name
from .model import read_style

if TYPE_CHECKING:
    from ..svg.kept import Kept


@dataclass(frozen=True)
class NamedDrawing:
    """A drawing with names for its strokes: what an edit takes and gives.

    Parameters
    ----------
    drawing : Drawing
    ids : (C,) names, as `--move` knows the strokes by; "" is none
    kept : strokes as they are drawn in their file, or are to be: what nobody changes is not drawn
        anew
    """

    drawing: Drawing
    ids: tuple[str, ...]
    kept: Kept = field(default_factory=dict)

    def with_drawing(self, drawing: Drawing) -> NamedDrawing:
        """Another drawing of as many strokes, with their names."""
        return replace(self, drawing=drawing)


Edit = Callable[[NamedDrawing, int], NamedDrawing]  # (drawing, seed) -> the edited drawing


class NumericEdit(NamedTuple):
    """An edit of the library that takes numbers.

    Parameters
    ----------
    function : called as function(drawing, numbers by name, only=(C,) bool or None)
    spoken : what the command line calls each number, by the name of the function's argument, in the
        order of the option's text
    random : whether the function takes a seed too
    """

    function: Callable[..., Drawing]
    spoken: dict[str, str]
    random: bool = False


NUMERIC = {
    "thickness": NumericEdit(thicken, {"factor": "--thickness"}),
    "wiggle": NumericEdit(
        wiggle,
        {"amplitude": "the amplitude of --wiggle", "wavelength": "the wavelength of --wiggle"},
        random=True,
    ),
    "smooth": NumericEdit(smooth, {"sigma": "--smooth"}),
    "simplify": NumericEdit(simplify, {"tolerance": "--simplify"}),
    "taper": NumericEdit(taper, {"length": "--taper"}),
}
MOVE_SPOKEN = {"point": "the point of --move", "by": "the way of --move"}

# One stroke of a pixel: what an edit is tried on, so that bad numbers are refused before any work.
PROBE = Drawing(
    Strokes(
        xy=np.array([[0.0, 0.0], [1.0, 0.0]]),
        thickness=np.ones(2),
        offsets=np.array([0, 2]),
        kind=np.zeros(1, np.int8),
        closed=np.zeros(1, bool),
    ),
    size=(1, 1),
    color=np.ones((1, 4)),
)


def parse_edit(name: str, text: str) -> Edit:
    """Parse the text of an edit option: "thickness", "contour=1.5".

    What stands before "=" are kinds of line and names of parts, with commas between. Whether the
    drawing has such a part is not known before the edit is made; it raises ValueError then.

    Parameters
    ----------
    name : of the option, without its dashes
    text : its value

    Raises
    ------
    ValueError
        on what is no such edit; the sentence names the option.
    """
    if name == "move":
        return _parse_move(text)
    if name == "drop":
        return _parse_drop(text)
    if name == "restyle":
        return _restyle_with(text)
    names, _, value = text.rpartition("=")
    if name == "recolor":
        return _recolor_to(_color(value), names)
    edit = _on_named(names, _parse_numeric(name, value))
    if name == "thickness":
        return Thickness(_numbers(value, "--thickness", 1)[0], names)
    return edit


@dataclass(frozen=True)
class Thickness:
    """The edit that multiplies the thickness of strokes by a factor, of all where no name is given.

    `names` are of kinds and parts, as the command line has them.
    """

    factor: float
    names: str

    def __call__(self, named: NamedDrawing, seed: int) -> NamedDrawing:
        """Make the edit."""
        return thicker(named, factors_of([self], named.drawing.strokes.kind, named.drawing.parts))


def factors_of(changes: Sequence[Thickness], kind: np.ndarray, parts: Parts | None) -> np.ndarray:
    """Tell by what changes multiply the thickness of strokes (C,) of kinds (C,) and parts.

    Raises ValueError on a name that is neither a kind nor one of the parts.
    """
    factor = np.ones(len(kind))
    for change in changes:
        only = lines_named(kind, parts, change.names) if change.names else slice(None)
        factor[only] *= change.factor
    return factor


def thicker(named: NamedDrawing, factor: np.ndarray) -> NamedDrawing:
    """The drawing with thicknesses multiplied, (C,); a little, texture is drawn out across."""
    from ..svg.kept import carried
    from ..svg.rescale import FACTORS, thicker_strokes

    drawing = named.drawing
    for each in sorted({*factor.tolist()} - {1.0}):
        within = FACTORS[0] <= each <= FACTORS[1]
        drawing = (scale_across if within else thicken)(drawing, each, factor == each)
    kept = carried(named.kept, named.drawing, drawing, lambda drawn: thicker_strokes(drawn, factor))
    return NamedDrawing(drawing, named.ids, kept)


# -------------------------------------------------------------------------- edits of named strokes

StrokesEdit = Callable[[Drawing, "np.ndarray | None", int], Drawing]  # (drawing, only, seed)


def _on_named(names: str, edit: StrokesEdit) -> Edit:
    """The edit made of the strokes of these kinds and parts; of all where `names` is empty."""

    def apply(named: NamedDrawing, seed: int) -> NamedDrawing:
        only = strokes_named(named.drawing, names) if names else None
        return named.with_drawing(edit(named.drawing, only, seed))

    return apply


def strokes_named(drawing: Drawing, names: str) -> np.ndarray:
    """Find the strokes (C,) bool of a drawing as `lines_named` does."""
    return lines_named(drawing.strokes.kind, drawing.parts, names)


def lines_named(kind: np.ndarray, of_parts: Parts | None, names: str) -> np.ndarray:
    """Find the lines (C,) bool of kinds and parts, as "contour,wheel" names them.

    Where a name is both, it is the kind. Raises ValueError on a name that is neither, telling those
    that there are.
    """
    parts = () if of_parts is None else of_parts.names
    whole = part_name(names) in parts  # a part's name may hold commas
    each = [names] if whole else names.split(",")
    wanted = [name for name in map(part_name, each) if name]
    unknown = [name for name in wanted if name not in (*KINDS, *parts)]
    if unknown or not wanted:
        few = ", ".join(sorted(parts)[:20]) + ", ..." * (len(parts) > 20)
        raise ValueError(
            f"{', '.join(map(repr, unknown)) or 'nothing'}: no such kind of line or part; "
            f"there are the kinds {', '.join(KINDS)} and "
            f"{f'the parts {few}' if parts else 'no named parts'}"
        )
    chosen = is_kind(kind, tuple(name for name in wanted if name in KINDS))
    if of_parts is not None:
        index = [parts.index(name) for name in wanted if name not in KINDS]
        chosen |= np.isin(of_parts.index, index)
    return chosen


def _parse_numeric(name: str, text: str) -> StrokesEdit:
    function, spoken, random = NUMERIC[name]
    numbers = dict(zip(spoken, _numbers(text, f"--{name}", len(spoken)), strict=True))

    def edit(drawing: Drawing, only: np.ndarray | None, seed: int) -> Drawing:
        return function(drawing, **numbers, only=only, **({"seed": seed} if random else {}))

    _try(lambda: edit(PROBE, None, 0), spoken)
    return edit


def _try(edit: Callable[[], Drawing], spoken: Mapping[str, str]) -> None:
    """Make an edit once; where it raises ValueError, name the option in place of the argument."""
    try:
        edit()
    except ValueError as error:
        argument, _, found = str(error).partition(" ")
        raise ValueError(f"{spoken.get(argument, argument)} {found}") from None


# ------------------------------------------------------------------------------------- other edits


def _parse_move(text: str) -> Edit:
    stroke, *rest = text.rsplit(":", 2)
    if len(rest) != 2 or not stroke:
        raise ValueError(
            f"--move is STROKE:POINT:DX,DY, for instance s004:0.5:20,-10, got {text!r}"
        )
    (point,) = _numbers(rest[0], "the point of --move", 1)
    dx, dy = _numbers(rest[1], "the way of --move", 2)
    _try(lambda: move(PROBE, 0, point, (dx, dy)), MOVE_SPOKEN)

    def apply(named: NamedDrawing, seed: int) -> NamedDrawing:
        moved = move(named.drawing, _stroke(named, stroke), point, (dx, dy))
        return named.with_drawing(moved)

    return apply


def _stroke(named: NamedDrawing, name: str) -> int:
    """The index of the stroke with this id, or with this number where no id is so."""
    if name in named.ids:
        return named.ids.index(name)
    if name.isdigit() and int(name) < len(named.ids):
        return int(name)
    some = ", ".join(named.ids[:3] + (("...",) if len(named.ids) > 3 else ()))
    raise ValueError(f"--move: there is no stroke {name!r}; there are {some or 'none'}")


DROP = re.compile(r"(.*?)(?:([<>])\s*([0-9]*\.?[0-9]+)\s*(?:px)?)?\s*", re.DOTALL)


def _parse_drop(text: str) -> Edit:
    match = DROP.fullmatch(text)
    assert match  # as whatever there is may be names
    names, compare = match[1].strip(), match[2]
    if not (names or compare):
        raise ValueError(
            "--drop is a length such as '<20', kinds or parts such as valley,ridge, or both: "
            f"'valley<20'; got {text!r}"
        )
    limit = float(match[3]) if compare else 0.0

    def apply(named: NamedDrawing, seed: int) -> NamedDrawing:
        drawing, parts = named.drawing, named.drawing.parts
        if parts is not None and part_name(text) in parts.names:  # a part may be called "a<20"
            gone = strokes_named(drawing, text)
        else:
            gone = strokes_named(drawing, names) if names else np.ones(len(drawing.strokes), bool)
            if compare:
                length = lengths(drawing)
                gone &= length < limit if compare == "<" else length > limit
        ids = tuple(np.array(named.ids, object)[~gone])
        return NamedDrawing(keep(drawing, ~gone), ids, named.kept)

    return apply


def _recolor_to(color: tuple[float, float, float], names: str) -> Edit:
    def apply(named: NamedDrawing, seed: int) -> NamedDrawing:
        from ..svg.kept import carried
        from ..svg.recolor import recolored_strokes

        before = named.drawing
        only = strokes_named(before, names) if names else np.ones(len(before.strokes), bool)
        after = recolor(before, color, only)
        index = np.flatnonzero(only).tolist()
        kept = carried(
            named.kept, before, after, lambda drawn: recolored_strokes(drawn, before, color, index)
        )
        return NamedDrawing(after, named.ids, kept)

    return apply


def _restyle_with(model: str) -> Edit:
    def apply(named: NamedDrawing, seed: int) -> NamedDrawing:
        from ..render.restyle import restyle  # no other edit needs what extracts lines

        drawing = restyle(named.drawing, read_style(model), seed)
        return NamedDrawing(drawing, ("",) * len(drawing.strokes))

    return apply


# ----------------------------------------------------------------------------- numbers and colours


def _numbers(text: str, what: str, count: int) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not np.isfinite(values).all():
        wanted = "a number" if count == 1 else "two numbers, such as 4,30"
        raise ValueError(f"{what} takes {wanted}, got {text!r}")
    return values


def _color(text: str) -> tuple[float, float, float]:
    from PIL import ImageColor

    try:
        red, green, blue = ImageColor.getrgb(text[:60])[:3]
    except ValueError:
        raise ValueError(
            f"--recolor takes a colour, #rrggbb or a name such as navy, got {text!r}"
        ) from None
    return red / 255.0, green / 255.0, blue / 255.0
