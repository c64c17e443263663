"""Read what SVG says in attributes: numbers, lengths, transforms, path data, basic shapes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from .. import files as limits
from ..files import quoted
from ..geometry.affine import IDENTITY, MAX_NUMBER, Affine, compose
from ..geometry.bezier import Segment

CSS_AXES = {  # functions of CSS along one axis: SVG's name, the axis, and what the other one has
    "translatex": ("translate", "x", 0.0),
    "translatey": ("translate", "y", 0.0),
    "scalex": ("scale", "x", 1.0),
    "scaley": ("scale", "y", 1.0),
}
CSS_ANGLES = {"deg": 1.0, "rad": math.degrees(1.0), "grad": 0.9, "turn": 360.0}
ORIGINS = {"left": "0", "top": "0", "center": "50%", "right": "100%", "bottom": "100%"}
SPACE = " \t\r\n\f"
UNITS = {
    "": 1.0,
    "px": 1.0,
    "in": 96.0,
    "cm": 96 / 2.54,
    "mm": 96 / 25.4,
    "q": 96 / 101.6,
    "pt": 96 / 72,
    "pc": 16.0,
    **{"em": 16.0, "rem": 16.0, "ex": 8.0, "ch": 8.0},  # of the font of browsers, if none is told
}
NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_SPACES = re.compile(rf"[{SPACE}]*")
_NEXT_NUMBER = re.compile(rf"[{SPACE}]*(?:,[{SPACE}]*)?({NUMBER})")
_NEXT_FLAG = re.compile(rf"[{SPACE}]*(?:,[{SPACE}]*)?([01])")
_LENGTH = re.compile(rf"({NUMBER})([a-zA-Z]*|%)")
_FUNCTION = re.compile(rf"[{SPACE},]*([a-zA-Z]+)[{SPACE}]*\(([^()]*)\)")


def parse_number(text: str) -> float:
    """Read a number. Raises ValueError where it is too large to be a place in a drawing."""
    value = float(text)
    if not abs(value) <= MAX_NUMBER:
        raise ValueError(f"the number {quoted(text)} is too large to be a place in a drawing")
    return value


def parse_numbers(text: str, name: str) -> list[float]:
    """Read the numbers, at most eight, of an attribute. Raises ValueError, which has its name."""
    values: list[float] = []
    text, at = text.rstrip(SPACE), 0
    while at < len(text):
        match = _NEXT_NUMBER.match(text, at)
        if not match or len(values) >= 8:
            raise ValueError(f'bad {name} "{quoted(text)}": expected numbers')
        values.append(parse_number(match[1]))
        at = match.end()
    return values


def length(text: str, name: str, whole: float) -> float:
    """Read a length, in CSS pixels; a percentage is of `whole`. Raises ValueError."""
    match = _LENGTH.fullmatch(text.strip(SPACE))
    if match and match[2] == "%":
        return parse_number(match[1]) * whole / 100.0
    if not match or match[2].lower() not in UNITS:
        raise ValueError(
            f'{name}="{quoted(text)}" is no length; use a number, or one in px, mm, in, pt, em or %'
        )
    return parse_number(match[1]) * UNITS[match[2].lower()]


def page_length(attributes: Mapping[str, str], name: str) -> float | None:
    """Read the width or height of the document, in CSS pixels.

    None where it depends on the viewer's window. Raises ValueError.
    """
    text = attributes.get(name, "auto").strip(SPACE)
    if text == "auto" or text.endswith("%"):
        return None
    value = length(text, name, 0.0)
    if value < 1 / MAX_NUMBER:
        raise ValueError(f'{name}="{quoted(text)}": the page needs a width and height above 0')
    return value


def parse_transform(text: str) -> Affine:
    """Read an SVG transform list as one matrix (a, b, c, d, e, f). Raises ValueError."""
    if len(text) > 10_000:
        raise ValueError(f"a transform of {len(text)} characters is too long")
    matrix, text, at = IDENTITY, text.rstrip(SPACE), 0
    while at < len(text):
        match = _FUNCTION.match(text, at)
        if not match:
            raise ValueError(f'bad transform at character {at + 1}, "{quoted(text[at : at + 20])}"')
        at = match.end()
        matrix = compose(matrix, _function(match[1], parse_numbers(match[2], "transform")))
    return matrix


def parse_share(text: str, default: float) -> float:
    """Read an opacity, in [0, 1]; `default` where the text is none."""
    match = re.fullmatch(r"([+-]?[0-9]*\.?[0-9]+(?:e[+-]?[0-9]{1,3})?)(%?)", text[:40])
    if not match:
        return default
    return min(max(float(match[1]) / (100.0 if match[2] else 1.0), 0.0), 1.0)


def parse_css_transform(text: str) -> Affine:
    """Read the transform property of CSS as one matrix: functions with units, of one axis too.

    The origin is that of SVG's attribute. Raises ValueError.
    """
    written = []
    for name, arguments in re.findall(r"([a-z]+)\s*\(([^()]*)\)", text[:10_000].lower()):
        values = [_css_number(value) for value in re.split(r"[\s,]+", arguments.strip())]
        axis = CSS_AXES.get(name)
        if axis is not None and len(values) == 1:
            name, other = axis[0], axis[2]
            values = [values[0], other] if axis[1] == "x" else [other, values[0]]
        elif name == "skew":  # both at once: no two functions of SVG's
            x, y = (math.tan(math.radians(v)) for v in (values + [0.0])[:2])
            name, values = "matrix", [1.0, y, x, 1.0, 0.0, 0.0]
        name = {"skewx": "skewX", "skewy": "skewY"}.get(name, name)
        written.append(f"{name}({' '.join(repr(value) for value in values)})")
    return parse_transform(" ".join(written))


def own_transform(
    given: Mapping[str, str], attributes: Mapping[str, str], view: tuple[float, float]
) -> Affine:
    """Give the matrix from an element's coordinates to those around it. Raises ValueError.

    Parameters
    ----------
    given : CSS properties of the element, by name; where these have no transform, the attribute has
    attributes : of the element
    view : (width, height) of the viewport, of which percentages of the origin are
    """
    if given.get("transform", "none") != "none":
        matrix = parse_css_transform(given["transform"])
    else:
        matrix = parse_transform(attributes.get("transform", ""))
    origin = given.get("transform-origin", attributes.get("transform-origin", ""))
    if not origin or matrix == IDENTITY:
        return matrix
    x, y = _transform_origin(origin.strip(SPACE).lower(), view)
    return compose(compose((1.0, 0.0, 0.0, 1.0, x, y), matrix), (1.0, 0.0, 0.0, 1.0, -x, -y))


def _transform_origin(text: str, view: tuple[float, float]) -> tuple[float, float]:
    """The place about which an element is transformed. Raises ValueError where it is no place."""
    words = [*re.split(r"[\s,]+", text[:1_000]), "center"][:2]
    if words[0] in ("top", "bottom") or words[1] in ("left", "right"):
        words.reverse()
    x, y = (
        length(ORIGINS.get(word, word), "transform-origin", whole)
        for word, whole in zip(words, view, strict=True)
    )
    return x, y


def _css_number(text: str) -> float:
    """A number, an angle in degrees, or a length in pixels, as CSS writes them."""
    match = re.fullmatch(rf"({NUMBER})(deg|rad|grad|turn)", text)
    if match:
        return parse_number(match[1]) * CSS_ANGLES[match[2]]
    return length(text, "transform", 0.0)


def _function(name: str, v: list[float]) -> Affine:
    match name, len(v):
        case "matrix", 6:
            a, b, c, d, e, f = v
            return a, b, c, d, e, f
        case "translate", 1 | 2:
            return (1.0, 0.0, 0.0, 1.0, v[0], v[1] if len(v) == 2 else 0.0)
        case "scale", 1 | 2:
            return (v[0], 0.0, 0.0, v[-1], 0.0, 0.0)
        case "rotate", 1 | 3:
            cos, sin = math.cos(math.radians(v[0])), math.sin(math.radians(v[0]))
            x, y = v[1:] or (0.0, 0.0)
            return (cos, sin, -sin, cos, x - cos * x + sin * y, y - sin * x - cos * y)
        case "skewX", 1:
            return (1.0, 0.0, math.tan(math.radians(v[0])), 1.0, 0.0, 0.0)
        case "skewY", 1:
            return (1.0, math.tan(math.radians(v[0])), 0.0, 1.0, 0.0, 0.0)
    raise ValueError(
        f"transform {quoted(name)} with {len(v)} numbers: expected matrix (6), "
        "translate (1 or 2), scale (1 or 2), rotate (1 or 3), skewX (1) or skewY (1)"
    )


# what follows a command's letter: n a number, f a flag
ARGUMENTS = {
    "M": "nn", "L": "nn", "H": "n", "V": "n", "C": "nnnnnn", "S": "nnnn", "Q": "nnnn", "T": "nn",
    "A": "nnnffnn", "Z": "",
}  # fmt: skip
_SYNTAX = {
    letter: tuple(_NEXT_FLAG if sort == "f" else _NEXT_NUMBER for sort in sorts)
    for upper, sorts in ARGUMENTS.items()
    for letter in (upper, upper.lower())
}
_IMPLICIT = {"M": "L", "m": "l"}  # numbers that go on after a jump are lines

Point = tuple[float, float]
Token = tuple[str, list[float]]  # a command's letter, and its numbers as they are written
Control = tuple[str, float, float]  # a curve's sort, C or Q, and its last control point


def parse_path(data: str, command: str = "", name: str = "d") -> list[list[Segment]]:
    """Read SVG path data as cubics, one list a subpath: all commands, all of the number syntax.

    A line is a cubic with evenly spaced controls. Subpaths that draw nothing are left out; "Z"
    adds the segment home.

    Parameters
    ----------
    command : the command in force before the first; "M" reads a list of points
    name : of the attribute, for the message

    Raises
    ------
    ValueError
        on bad syntax, with the place; on too many characters or segments, and places too far away.
    """
    if len(data) > limits.MAX_TEXT:
        raise ValueError(
            f"{name} has more than {limits.MAX_TEXT} characters: simplify the drawing first"
        )
    data = data.rstrip(SPACE)
    if data.lstrip(SPACE) == "none":
        return []
    return draw(tokens(data, command, name))


def tokens(data: str, command: str = "", name: str = "d") -> Iterator[Token]:
    """Split path data, without space at its end, into commands with their numbers.

    Every command has its letter, those too that the data leave out. Takes and raises what
    `parse_path` does.
    """
    at, count = 0, 0
    while (at := _end_of_space(data, at)) < len(data):
        count += 1
        if count > limits.MAX_POINTS:
            raise ValueError(f"more than {limits.MAX_POINTS} segments: simplify the drawing first")
        if data[at] in _SYNTAX:
            if not command and data[at] not in "Mm":
                raise _unexpected(data, at, name, "M or m first")
            command = data[at]
            at += 1
        elif command in ("", "Z", "z"):
            raise _unexpected(data, at, name, "a command" if command else "M or m first")
        numbers = []
        for pattern in _SYNTAX[command]:
            match = pattern.match(data, at)
            if not match:
                flag = pattern is _NEXT_FLAG
                what = f"a flag of {command}, 0 or 1" if flag else f"a number of {command}"
                raise _unexpected(data, at, name, what)
            numbers.append(parse_number(match[1]))
            at = match.end()
        yield command, numbers
        command = _IMPLICIT.get(command, command)


def _end_of_space(data: str, at: int) -> int:
    match = _SPACES.match(data, at)
    assert match is not None  # no space at all matches too
    return match.end()


def _unexpected(data: str, at: int, name: str, expected: str) -> ValueError:
    """The error of what stands at a place of path data, behind space, instead of the expected."""
    place = _end_of_space(data, at)
    found = quoted(data[place : place + 20])
    return ValueError(f'bad {name} at character {place + 1}, "{found}": expected {expected}')


def draw(commands: Iterable[Token]) -> list[list[Segment]]:
    """Draw commands, as `tokens` gives them: the cubics of each subpath that draws something.

    Raises ValueError where relative coordinates lead too far.
    """
    subpaths: list[list[Segment]] = []
    cubics: list[Segment] = []  # of the current subpath
    here = begin = (0.0, 0.0)
    control: Control | None = None  # what S or T reflects
    for command, numbers in commands:
        letter = command.upper()
        if letter != command:
            numbers = _absolute(letter, numbers, here)
        if letter == "M":
            here = begin = (numbers[0], numbers[1])
            control = None
        else:
            end = _end(letter, numbers, here, begin)
            segments, control = _segments(letter, numbers, here, end, control)
            cubics += segments
            here = end
            if abs(here[0]) + abs(here[1]) > MAX_NUMBER**2:
                raise ValueError("its relative coordinates lead too far to be a place in a drawing")
        if letter in "MZ" and cubics:
            subpaths.append(cubics)
            cubics = []
    if cubics:
        subpaths.append(cubics)
    return subpaths


def _absolute(letter: str, numbers: list[float], here: Point) -> list[float]:
    """A command's numbers where they are measured from the current point."""
    x, y = here
    if letter == "A":
        return [*numbers[:5], numbers[5] + x, numbers[6] + y]
    if letter == "V":
        return [numbers[0] + y]
    return [number + (y if i % 2 else x) for i, number in enumerate(numbers)]


def _end(letter: str, numbers: list[float], here: Point, begin: Point) -> Point:
    """Where a command, in absolute numbers, ends; its subpath begins at `begin`."""
    if letter == "Z":
        return begin
    if letter == "H":
        return numbers[0], here[1]
    if letter == "V":
        return here[0], numbers[0]
    return numbers[-2], numbers[-1]


def _segments(
    letter: str, numbers: list[float], here: Point, end: Point, control: Control | None
) -> tuple[list[Segment], Control | None]:
    """The cubics of a command, in absolute numbers, and what a smooth one after it reflects.

    `control` : that of the command before it
    """
    (x, y), (u, w) = here, end
    if letter in "CS":
        x1, y1 = numbers[:2] if letter == "C" else _reflected(control, "C", here)
        x2, y2 = numbers[-4:-2]
        return [(x, y, x1, y1, x2, y2, u, w)], ("C", x2, y2)
    if letter in "QT":
        qx, qy = numbers[:2] if letter == "Q" else _reflected(control, "Q", here)
        x1, y1 = x + (qx - x) * 2 / 3, y + (qy - y) * 2 / 3
        x2, y2 = u + (qx - u) * 2 / 3, w + (qy - w) * 2 / 3
        return [(x, y, x1, y1, x2, y2, u, w)], ("Q", qx, qy)
    if letter == "A":
        cubics = _arc(here, numbers, end)
        if cubics is not None:
            return cubics, None
    if letter == "Z" and here == end:
        return [], None
    dx, dy = (u - x) / 3, (w - y) / 3
    return [(x, y, x + dx, y + dy, u - dx, w - dy, u, w)], None


def _reflected(control: Control | None, sort: str, here: Point) -> Point:
    """The first control point of a smooth continuation.

    It is the current point where no curve of its sort went before.
    """
    if control is None or control[0] != sort:
        return here
    return 2 * here[0] - control[1], 2 * here[1] - control[2]


class _EllipticArc(NamedTuple):
    """A piece of an ellipse, told on the unit circle that its own frame makes of it."""

    radii: Point
    cos: float  # of the angle between the ellipse's own x axis and the drawing's
    sin: float
    centre: Point  # of the circle, about the middle of the chord
    first: float  # the angle, in radians, where it begins
    turn: float  # how far it goes round, with its sign


def _arc(here: Point, numbers: list[float], end: Point) -> list[Segment] | None:
    """SVG's elliptical arc as cubics of at most 45 degrees, off by 4e-6 of the radius.

    None where it is a straight line.
    """
    if here == end:
        return []
    arc = _centre_of_arc(here, numbers, end)
    if arc is None:
        return None
    pieces = max(1, math.ceil(abs(arc.turn) / (math.pi / 4) - 1e-9))
    step = arc.turn / pieces
    handle = 4 / 3 * math.tan(step / 4)
    middle = (here[0] + end[0]) / 2, (here[1] + end[1]) / 2
    cubics: list[Segment] = []
    before = here
    for i in range(pieces):
        a, b = arc.first + i * step, arc.first + (i + 1) * step
        ahead = math.cos(a) - handle * math.sin(a), math.sin(a) + handle * math.cos(a)
        back = math.cos(b) + handle * math.sin(b), math.sin(b) - handle * math.cos(b)
        there = end
        if i < pieces - 1:
            there = _on_ellipse(arc, (math.cos(b), math.sin(b)), middle)
        one, two = _on_ellipse(arc, ahead, middle), _on_ellipse(arc, back, middle)
        cubics.append((*before, *one, *two, *there))
        before = there
    return cubics


def _centre_of_arc(here: Point, numbers: list[float], end: Point) -> _EllipticArc | None:
    """An arc by its centre instead of its ends: SVG 1.1, appendix F.6. None: a straight line."""
    rx, ry, degrees, large, sweep = numbers[:5]
    rx, ry = abs(rx), abs(ry)
    if min(rx, ry) < 1 / MAX_NUMBER:
        return None
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    # half the chord in the ellipse's own frame, where it is the unit circle
    dx, dy = here[0] - end[0], here[1] - end[1]
    px, py = (cos * dx + sin * dy) / 2 / rx, (cos * dy - sin * dx) / 2 / ry
    half = px * px + py * py
    if not 1 / MAX_NUMBER**2 < half < MAX_NUMBER**2:
        return None
    grow = max(math.sqrt(half), 1.0)  # radii too small to reach are scaled up
    px, py, half = px / grow, py / grow, half / grow**2
    away = math.sqrt(max(0.0, 1 / half - 1)) * (-1 if large == sweep else 1)
    cx, cy = away * py, -away * px
    first = math.atan2(py - cy, px - cx)
    turn = math.atan2(-py - cy, -px - cx) - first
    if sweep and turn < 0:
        turn += 2 * math.pi
    elif not sweep and turn > 0:
        turn -= 2 * math.pi
    return _EllipticArc((rx * grow, ry * grow), cos, sin, (cx, cy), first, turn)


def _on_ellipse(arc: _EllipticArc, at: Point, middle: Point) -> Point:
    """Where a point of the unit circle's frame lies in the drawing; `middle` of the arc's chord."""
    a, b = (at[0] + arc.centre[0]) * arc.radii[0], (at[1] + arc.centre[1]) * arc.radii[1]
    return arc.cos * a - arc.sin * b + middle[0], arc.sin * a + arc.cos * b + middle[1]


def shape_path(tag: str, attributes: Mapping[str, str], view: Point) -> str:
    """Path data of a line, rect, circle or ellipse; "" where it draws nothing.

    `view` : (width, height) in px that percentages refer to. Raises ValueError on a bad length.
    """
    width, height = view

    def given(name: str, whole: float) -> float:
        return length(attributes.get(name, "0"), name, whole)

    if tag == "line":
        begin = f"{given('x1', width)} {given('y1', height)}"
        return f"M{begin}L{given('x2', width)} {given('y2', height)}"
    if tag == "rect":
        radii = _radii(attributes, view)
        left, top = given("x", width), given("y", height)
        sides = given("width", width), given("height", height)
        return _rect_path((left, top), sides, radii) if min(sides) > 0 else ""
    if tag == "circle":
        radius = given("r", math.hypot(width, height) / math.sqrt(2))
        radii = (radius, radius)
    else:
        radii = _radii(attributes, view)
    return _ellipse_path((given("cx", width), given("cy", height)), radii)


def _radii(attributes: Mapping[str, str], view: Point) -> Point:
    """Those of an ellipse or of a rectangle's corners: one that is not given is the other one."""
    rx, ry = attributes.get("rx", "auto"), attributes.get("ry", "auto")
    rx, ry = (ry if rx == "auto" else rx), (rx if ry == "auto" else ry)
    if rx == "auto":
        return 0.0, 0.0
    return length(rx, "rx", view[0]), length(ry, "ry", view[1])


def _ellipse_path(centre: Point, radii: Point) -> str:
    (x, y), (rx, ry) = centre, radii
    if min(radii) <= 0:
        return ""
    arc = f"A{rx} {ry} 0 0 1"
    return f"M{x + rx} {y}{arc} {x - rx} {y}{arc} {x + rx} {y}Z"


def _rect_path(corner: Point, sides: Point, radii: Point) -> str:
    """A rectangle from its upper left corner, with rounded corners where both radii are above 0."""
    (x, y), (w, h) = corner, sides
    rx, ry = min(radii[0], w / 2), min(radii[1], h / 2)
    if min(rx, ry) <= 0:
        return f"M{x} {y}H{x + w}V{y + h}H{x}Z"
    arc = f"A{rx} {ry} 0 0 1"
    return (
        f"M{x + rx} {y}H{x + w - rx}{arc} {x + w} {y + ry}V{y + h - ry}{arc} {x + w - rx} {y + h}"
        f"H{x + rx}{arc} {x} {y + h - ry}V{y + ry}{arc} {x + rx} {y}Z"
    )
