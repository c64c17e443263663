"""Read what SVG says in attributes: numbers, lengths, transforms, path data, basic shapes."""

from __future__ import annotations

import math
import re

from .. import files as limits
from ..files import quoted
from ..geometry.affine import IDENTITY, MAX_NUMBER, Affine, compose
from ..geometry.bezier import Segment

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
}
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_SPACES = re.compile(rf"[{SPACE}]*")
_NEXT_NUMBER = re.compile(rf"[{SPACE}]*(?:,[{SPACE}]*)?({_NUMBER})")
_NEXT_FLAG = re.compile(rf"[{SPACE}]*(?:,[{SPACE}]*)?([01])")
_LENGTH = re.compile(rf"({_NUMBER})([a-zA-Z]*|%)")
_FUNCTION = re.compile(rf"[{SPACE},]*([a-zA-Z]+)[{SPACE}]*\(([^()]*)\)")


def parse_number(text: str) -> float:
    value = float(text)
    if not abs(value) <= MAX_NUMBER:
        raise ValueError(f"the number {quoted(text)} is too large to be a place in a drawing")
    return value


def parse_numbers(text: str, name: str) -> list[float]:
    """The numbers, at most eight, of an attribute."""
    text, values, at = text.rstrip(SPACE), [], 0
    while at < len(text):
        match = _NEXT_NUMBER.match(text, at)
        if not match or len(values) >= 8:
            raise ValueError(f'bad {name} "{quoted(text)}": expected numbers')
        values.append(parse_number(match[1]))
        at = match.end()
    return values


def length(text: str, name: str, whole: float) -> float:
    """A length in CSS pixels; a percentage is of `whole`."""
    match = _LENGTH.fullmatch(text.strip(SPACE))
    if match and match[2] == "%":
        return parse_number(match[1]) * whole / 100.0
    if not match or match[2].lower() not in UNITS:
        raise ValueError(
            f'{name}="{quoted(text)}" is no length; use a number, or one in px, mm, cm, in, pt or %'
        )
    return parse_number(match[1]) * UNITS[match[2].lower()]


def page_length(attributes, name: str) -> float | None:
    """Width or height of the page, CSS pixels; None where it depends on the viewer's window."""
    text = attributes.get(name, "auto").strip(SPACE)
    if text == "auto" or text.endswith("%"):
        return None
    value = length(text, name, 0.0)
    if value < 1 / MAX_NUMBER:
        raise ValueError(f'{name}="{quoted(text)}": the page needs a width and height above 0')
    return value


def parse_transform(text: str) -> Affine:
    """An SVG transform list as one matrix (a, b, c, d, e, f). Raises ValueError."""
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


def _function(name: str, v: list[float]) -> Affine:
    match name, len(v):
        case "matrix", 6:
            return tuple(v)
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
        f"transform {quoted(name)} with {len(v)} numbers: expected matrix (6), translate (1 or 2), scale (1 or 2), "
        "rotate (1 or 3), skewX (1) or skewY (1)"
    )


ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}


def parse_path(data: str, command: str = "", name: str = "d") -> list[list[Segment]]:
    """SVG path data as cubics, one list a subpath: all commands, all of the number syntax.

    A line is a cubic with evenly spaced controls. Subpaths that draw nothing are left out; "Z" adds the segment home.

    Parameters
    ----------
    command : the command in force before the first; "M" reads a list of points
    name : of the attribute, for the message

    Raises
    ------
    ValueError
        on bad syntax, with the place.
    """
    if len(data) > limits.MAX_TEXT:
        raise ValueError(
            f"{name} has more than {limits.MAX_TEXT} characters: simplify the drawing first"
        )
    data = data.rstrip(SPACE)
    if data.lstrip(SPACE) == "none":
        return []
    subpaths: list[list[Segment]] = []
    cubics: list[Segment] = []  # of the current subpath
    x = y = begin_x = begin_y = 0.0
    control = (
        None  # what S or T reflects: the commands that it follows, and their last control point
    )
    at, end, total = 0, len(data), 0

    def bad(expected):
        place = len(data) - len(data[at:].lstrip(SPACE))
        return ValueError(
            f'bad {name} at character {place + 1}, "{quoted(data[place : place + 20])}": expected {expected}'
        )

    while True:
        at = _SPACES.match(data, at).end()
        if at >= end:
            break
        total += 1
        if total > limits.MAX_POINTS:
            raise ValueError(f"more than {limits.MAX_POINTS} segments: simplify the drawing first")
        if data[at].upper() in ARGUMENTS:
            if not command and data[at] not in "Mm":
                raise bad("M or m first")
            command = data[at]
            at += 1
        elif command in ("", "Z", "z"):
            raise bad("a command" if command else "M or m first")
        letter, relative = command.upper(), command.islower()
        v = []
        for i in range(ARGUMENTS[letter]):
            flag = letter == "A" and i in (3, 4)
            match = (_NEXT_FLAG if flag else _NEXT_NUMBER).match(data, at)
            if not match:
                raise bad(f"a flag of {command}, 0 or 1" if flag else f"a number of {command}")
            v.append(parse_number(match[1]))
            at = match.end()
        if relative and v:
            if letter == "A":
                v[5:] = v[5] + x, v[6] + y
            else:
                odd = 0 if letter == "V" else 1
                v = [value + (x if i % 2 != odd else y) for i, value in enumerate(v)]

        if letter == "M":
            if cubics:
                subpaths.append(cubics)
                cubics = []
            x, y = begin_x, begin_y = v
            command, control = ("l" if relative else "L"), None
            continue
        reflect, control = control, None
        u, w = v[-2:] if len(v) > 1 else (begin_x, begin_y)
        if letter == "H":
            u, w = v[0], y
        elif letter == "V":
            u, w = x, v[0]
        if letter in "CS":
            x1, y1 = v[:2] if letter == "C" else _reflected(reflect, "C", x, y)
            control = ("C", *v[-4:-2])
            cubics.append((x, y, x1, y1, *v[-4:]))
        elif letter in "QT":
            qx, qy = v[:2] if letter == "Q" else _reflected(reflect, "Q", x, y)
            control = ("Q", qx, qy)
            x1, y1 = x + (qx - x) * 2 / 3, y + (qy - y) * 2 / 3
            cubics.append((x, y, x1, y1, u + (qx - u) * 2 / 3, w + (qy - w) * 2 / 3, u, w))
        elif letter == "A" and (arc := _arc(x, y, *v)) is not None:
            cubics += arc
        elif letter != "Z" or (x, y) != (u, w):
            dx, dy = (u - x) / 3, (w - y) / 3
            cubics.append((x, y, x + dx, y + dy, u - dx, w - dy, u, w))
        x, y = u, w
        if abs(x) + abs(y) > MAX_NUMBER**2:
            raise ValueError("its relative coordinates lead too far to be a place in a drawing")
        if letter == "Z" and cubics:
            subpaths.append(cubics)
            cubics = []
    if cubics:
        subpaths.append(cubics)
    return subpaths


def _reflected(control, command: str, x: float, y: float) -> tuple[float, float]:
    """The control point of a smooth continuation: the current point where no curve of its sort went before."""
    if control is None or control[0] != command:
        return x, y
    return 2 * x - control[1], 2 * y - control[2]


def _arc(x, y, rx, ry, degrees, large, sweep, u, v) -> list[Segment] | None:
    """SVG's elliptical arc from (x, y) to (u, v) as cubics of at most 45 degrees, off by 4e-6 of the radius.

    None where it is a straight line. SVG 1.1, appendix F.6.
    """
    if (x, y) == (u, v):
        return []
    rx, ry = abs(rx), abs(ry)
    if min(rx, ry) < 1 / MAX_NUMBER:
        return None
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    # half the chord in the ellipse's own frame, where it is the unit circle
    px, py = (cos * (x - u) + sin * (y - v)) / 2 / rx, (cos * (y - v) - sin * (x - u)) / 2 / ry
    half = px * px + py * py
    if not 1 / MAX_NUMBER**2 < half < MAX_NUMBER**2:
        return None
    grow = max(math.sqrt(half), 1.0)  # radii too small to reach are scaled up
    rx, ry, px, py, half = rx * grow, ry * grow, px / grow, py / grow, half / grow**2
    away = math.sqrt(max(0.0, 1 / half - 1)) * (-1 if large == sweep else 1)
    cx, cy = away * py, -away * px
    first = math.atan2(py - cy, px - cx)
    turn = math.atan2(-py - cy, -px - cx) - first
    if sweep and turn < 0:
        turn += 2 * math.pi
    elif not sweep and turn > 0:
        turn -= 2 * math.pi
    pieces = max(1, math.ceil(abs(turn) / (math.pi / 4) - 1e-9))
    step = turn / pieces
    handle = 4 / 3 * math.tan(step / 4)
    middle_x, middle_y = (x + u) / 2, (y + v) / 2

    def place(a, b):
        a, b = (a + cx) * rx, (b + cy) * ry
        return cos * a - sin * b + middle_x, sin * a + cos * b + middle_y

    cubics, here = [], (x, y)
    for i in range(pieces):
        a, b = first + i * step, first + (i + 1) * step
        one = place(math.cos(a) - handle * math.sin(a), math.sin(a) + handle * math.cos(a))
        two = place(math.cos(b) + handle * math.sin(b), math.sin(b) - handle * math.cos(b))
        there = place(math.cos(b), math.sin(b)) if i < pieces - 1 else (u, v)
        cubics.append((*here, *one, *two, *there))
        here = there
    return cubics


def shape_path(tag: str, attributes, view: tuple[float, float]) -> str:
    """Path data of a line, rect, circle or ellipse; "" where it draws nothing."""
    width, height = view

    def get(name, whole):
        return length(attributes.get(name, "0"), name, whole)

    if tag == "line":
        return f"M{get('x1', width)} {get('y1', height)}L{get('x2', width)} {get('y2', height)}"
    if tag == "circle":
        rx = ry = get("r", math.hypot(width, height) / math.sqrt(2))
    else:  # a radius that is not given is the other one
        rx, ry = attributes.get("rx", "auto"), attributes.get("ry", "auto")
        rx, ry = (ry if rx == "auto" else rx), (rx if ry == "auto" else ry)
        rx, ry = (0.0, 0.0) if rx == "auto" else (length(rx, "rx", width), length(ry, "ry", height))
    arc = f"A{rx} {ry} 0 0 1"
    if tag != "rect":
        x, y = get("cx", width), get("cy", height)
        return f"M{x + rx} {y}{arc} {x - rx} {y}{arc} {x + rx} {y}Z" if min(rx, ry) > 0 else ""
    x, y, w, h = get("x", width), get("y", height), get("width", width), get("height", height)
    if min(w, h) <= 0:
        return ""
    rx, ry = min(rx, w / 2), min(ry, h / 2)
    if min(rx, ry) <= 0:
        return f"M{x} {y}H{x + w}V{y + h}H{x}Z"
    arc = f"A{rx} {ry} 0 0 1"
    return (
        f"M{x + rx} {y}H{x + w - rx}{arc} {x + w} {y + ry}V{y + h - ry}{arc} {x + w - rx} {y + h}"
        f"H{x + rx}{arc} {x} {y + h - ry}V{y + ry}{arc} {x + rx} {y}Z"
    )
