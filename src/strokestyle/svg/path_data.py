"""SVG's syntax: XML that is safe to read from anyone, attributes, lengths, transforms and path data.

Files come from anywhere, so nothing in them is followed or expanded: no entity, no reference, no style sheet; what is
too large, too deep or of too many points is refused.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable
from xml.parsers import expat

import numpy as np

from ..geometry.curves import arc

MAX_BYTES = 64 * 2**20  # of a file, an .svgz's once decompressed
MAX_POINTS = 500_000
MAX_ELEMENTS = 100_000
MAX_DEPTH = 256  # of elements inside one another
MAX_TEXT = 16 * 2**20  # characters of one path
MAX_NUMBER = 1e12  # larger ones are mistakes, and their products leave the range of a float
SVG_NAMESPACE = "http://www.w3.org/2000/svg"
INKSCAPE_NAMESPACE = "http://www.inkscape.org/namespaces/inkscape"
UNSAFE = (
    'its document type has declarations of its own ("<!DOCTYPE svg [...]>"); save it as plain SVG, or take them out'
)

Affine = tuple[float, float, float, float, float, float]  # SVG's matrix: x' = a x + c y + e, y' = b x + d y + f
IDENTITY: Affine = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


# ----------------------------------------------------------------------------------------------------------- XML


def limited(data: bytes) -> bytes:
    """The bytes of a file, gunzipped where they are gzip data. Raises ValueError on too many, or on damage."""
    if len(data) <= MAX_BYTES and data[:2] == b"\x1f\x8b":
        data = _unzip(data)
    if len(data) > MAX_BYTES:
        raise ValueError(
            f"larger than {MAX_BYTES // 2**20} MB: simplify the curves, or take images out, and save again"
        )
    return data


def _unzip(data: bytes) -> bytes:
    unpack = zlib.decompressobj(wbits=31)
    try:
        text = unpack.decompress(data, MAX_BYTES + 1)
    except zlib.error as error:
        raise ValueError(f"damaged gzip data ({error}); save it again, as .svg") from None
    if len(text) <= MAX_BYTES and not unpack.eof:
        raise ValueError("its gzip data end early: the file is cut short; save it again, as .svg")
    return text


class Walker:
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
        if data.count(b"<") > 2 * MAX_ELEMENTS + 100:
            raise ValueError(f"more than {MAX_ELEMENTS} elements: simplify the drawing first")
        if data.count(b"=") > 5 * MAX_ELEMENTS:  # the parser hands over an element whole, however many it has
            raise ValueError(f"more than {5 * MAX_ELEMENTS} attributes: simplify the drawing first")
        try:
            self.parser.Parse(data, True)
        except expat.ExpatError as error:
            raise ValueError(f"not an SVG file (XML expected: {error})") from None
        except LookupError as error:  # an encoding that Python does not know
            raise ValueError(f"not an SVG file ({error}); save it as UTF-8") from None

    def _start(self, name: str, attributes: dict[str, str]):
        self.elements += 1
        if self.elements > MAX_ELEMENTS or self.depth >= MAX_DEPTH:
            raise ValueError(f"more than {MAX_ELEMENTS} elements, or {MAX_DEPTH} inside one another: simplify it first")
        namespace, _, tag = name.rpartition("}")
        if not self.depth and not (namespace in ("", SVG_NAMESPACE) and tag == "svg"):
            raise ValueError(f"not an SVG file: its first element is <{quoted(tag)}>; save the drawing as .svg")
        self.depth += 1
        try:
            self.start(namespace, tag, attributes)
        except ValueError as error:
            which = f' id="{quoted(attributes["id"])}"' if "id" in attributes else ""
            raise ValueError(f"line {self.parser.CurrentLineNumber}, <{tag}{which}>: {error}") from None

    def _end(self, _):
        self.depth -= 1
        self.end()

    def _doctype(self, name, system, public, has_subset):
        """Old files name SVG's document type, which is not fetched; one with declarations of its own is refused."""
        if has_subset:
            self._refuse()

    def _refuse(self, *_):
        raise ValueError(UNSAFE)


def quoted(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text[:40])


def css_property(name: str, style: str, attributes: dict[str, str]) -> str:
    """A CSS property of the style attribute, else the attribute of that name, else ""."""
    found = re.findall(rf"(?:^|;)\s*{name}\s*:([^;!]*)", style[:10_000]) if name in style else ()
    return (found[-1] if found else attributes.get(name, "")).strip().lower()


# ---------------------------------------------------------------------------------------- lengths and transforms

ROUNDING = 0.01  # px that a shape's points may be off after another program's rounding, however small it was made
SLIP = 1e-4  # of a path's length, that its landmarks may be off after svgo rounded every piece of it
SPACE = " \t\r\n\f"
UNITS = {"": 1.0, "px": 1.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6, "pt": 96 / 72, "pc": 16.0}
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
        raise ValueError(f'{name}="{quoted(text)}" is no length; use a number, or one in px, mm, cm, in, pt or %')
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


def fit_box(box, into, align: str = "") -> Affine:
    """The box (x, y, width, height) laid into another, after SVG's preserveAspectRatio; default: whole and centred."""
    (x, y, width, height), (to_x, to_y, to_width, to_height) = box, into
    sx, sy = to_width / width, to_height / height
    words = align.split() or ["xMidYMid"]
    if words[0] == "none":
        return (sx, 0.0, 0.0, sy, to_x - sx * x, to_y - sy * y)
    match = re.fullmatch("x(Min|Mid|Max)Y(Min|Mid|Max)", words[0])
    if not match:
        raise ValueError(f'bad preserveAspectRatio "{quoted(align)}": expected none, or for instance xMidYMid meet')
    scale = max(sx, sy) if words[1:] == ["slice"] else min(sx, sy)
    share_x, share_y = ({"Min": 0.0, "Mid": 0.5, "Max": 1.0}[word] for word in match.groups())
    left, top = to_x + share_x * (to_width - scale * width), to_y + share_y * (to_height - scale * height)
    return (scale, 0.0, 0.0, scale, left - scale * x, top - scale * y)


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


def compose(outer: Affine, inner: Affine) -> Affine:
    """The matrix that applies `inner`, then `outer`."""
    a, b, c, d, e, f = outer
    p, q, r, s, t, u = inner
    made = (a * p + c * q, b * p + d * q, a * r + c * s, b * r + d * s, a * t + c * u + e, b * t + d * u + f)
    if not all(abs(value) <= MAX_NUMBER**2 for value in made):
        raise ValueError("its transforms together are too large to be a place in a drawing")
    return made


def transformed(matrix: Affine, points: np.ndarray) -> np.ndarray:
    # element by element, not by a matrix product: equal points stay equal to the last bit, so that loops stay closed
    a, b, c, d, e, f = matrix
    x, y = points[..., 0], points[..., 1]
    return np.stack([a * x + c * y + e, b * x + d * y + f], axis=-1)


# ------------------------------------------------------------------------------------------------------ path data

Segment = tuple[float, float, float, float, float, float, float, float]  # a cubic's four points, x and y in turn
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
    if len(data) > MAX_TEXT:
        raise ValueError(f"{name} has more than {MAX_TEXT} characters: simplify the drawing first")
    data = data.rstrip(SPACE)
    if data.lstrip(SPACE) == "none":
        return []
    subpaths: list[list[Segment]] = []
    cubics: list[Segment] = []  # of the current subpath
    x = y = begin_x = begin_y = 0.0
    control = None  # what S or T reflects: the commands that it follows, and their last control point
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
        if total > MAX_POINTS:
            raise ValueError(f"more than {MAX_POINTS} segments: simplify the drawing first")
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


def first_line(d: str) -> np.ndarray:
    """Path data's first subpath as a fine polyline (n, 2). Raises ValueError where it draws nothing."""
    match = re.match(rf"[{SPACE}]*[Mm][^MmZz]*[Zz]?", d)
    subpaths = parse_path(match[0] if match else "")
    if not subpaths:
        raise ValueError("a path that draws nothing")
    return fine_line(subpaths[0])


def fine_line(segments: list[Segment]) -> np.ndarray:
    """A subpath as a polyline (n, 2) of eight pieces a segment."""
    p = np.array(segments).reshape(-1, 1, 4, 2)
    t = (np.arange(8) + 1)[:, None] / 8
    s = 1 - t
    xy = s**3 * p[:, :, 0] + 3 * s**2 * t * p[:, :, 1] + 3 * s * t**2 * p[:, :, 2] + t**3 * p[:, :, 3]
    return np.concatenate([p[0, :, 0], xy.reshape(-1, 2)])


def landmarks(line: np.ndarray, measured: np.ndarray | None = None) -> np.ndarray:
    """The points (4, 2) at 0, 1/4, 1/2 and 3/4 of a polyline's length; of the length of another one, `measured`."""
    along = arc(line if measured is None else measured)
    at = along[-1] * np.array([0.0, 0.25, 0.5, 0.75])
    return np.stack([np.interp(at, along, column) for column in line.T], axis=1)


def enclosed(line: np.ndarray) -> float:
    """The area that a polyline (n, 2) goes round, by the shoelace formula."""
    x, y = line.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def moved_by(then: np.ndarray, now: np.ndarray, line: np.ndarray | None = None, slack: float = 0.05) -> Affine | None:
    """The transform that took a shape from where its landmarks (4, 2) were to where they are; None: it was edited.

    The simplest that explains them within `slack` px: none, a translation, a similarity, any affine map. The last does
    not keep a line's proportions, so its landmarks are those of the `line` (n, 2) measured where it came from. Along a
    long line they slip by a SLIP of its length, as it is rounded.
    """
    slip = 0.0 if line is None else SLIP * float(arc(line)[-1])
    if np.abs(now - then).max() <= slack + slip:
        return IDENTITY
    shift = (now - then).mean(axis=0)
    if np.abs(now - then - shift).max() <= slack + slip:
        return (1.0, 0.0, 0.0, 1.0, *shift.tolist())
    a, b = (values[:, 0] + 1j * values[:, 1] for values in (then, now))
    for source, mirror in ((a, 1.0), (a.conj(), -1.0)):
        spread = np.square(np.abs(source - source.mean())).sum()
        turn = ((b - b.mean()) * (source - source.mean()).conj()).sum() / max(spread, 1e-12)
        place = b.mean() - turn * source.mean()
        if np.abs(turn * source + place - b).max() <= max(slack * abs(turn), ROUNDING) + slip:
            x, y = turn.real, turn.imag
            return (x, y, -y * mirror, x * mirror, place.real, place.imag)
    full = np.concatenate([then, np.ones((4, 1))], axis=1)
    for _ in range(60):
        solved = np.linalg.lstsq(full, now, rcond=None)[0]  # (3, 2)
        if abs(np.linalg.det(solved[:2])) < 1e-9:
            return None
        if line is None:
            break
        before, now = now, landmarks(line, (line - solved[2]) @ np.linalg.inv(solved[:2]))
        if np.abs(now - before).max() < 1e-3:
            break
    # a map that shrinks must be met the better: else any small shape would do as what became of a large one
    small, large = np.linalg.svd(solved[:2], compute_uv=False)[[1, 0]]
    if np.abs(full @ solved - now).max() > max(slack * (large if small >= 1.0 else small), ROUNDING) + slip:
        return None
    return tuple(float(v) for v in (*solved[0], *solved[1], *solved[2]))


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


def flatten(cubics: np.ndarray, offsets: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Chains of cubics (S, 4, 2), the i-th in rows offsets[i]:offsets[i+1], as polylines xy (N, 2) and their offsets.

    Chords keep within `tolerance` of the curve: n of them are off by at most max |B''| / 8 n^2.
    """
    bend = np.linalg.norm(cubics[:, :-2] - 2 * cubics[:, 1:-1] + cubics[:, 2:], axis=2).max(axis=1)
    wanted = np.maximum(np.ceil(np.sqrt(6 * bend / (8 * tolerance))), 1.0)
    if wanted.sum() > MAX_POINTS:
        raise ValueError(f"its curves need more than {MAX_POINTS} points on this canvas: simplify the drawing first")
    count = wanted.astype(np.int64)
    which = np.repeat(np.arange(len(cubics)), count)
    before = np.cumsum(count) - count
    t = ((np.arange(len(which)) - before[which] + 1) / count[which])[:, None]
    s = 1 - t
    p = cubics[which]
    along = s**3 * p[:, 0] + 3 * s**2 * t * p[:, 1] + 3 * s * t**2 * p[:, 2] + t**3 * p[:, 3]
    new = np.r_[0, np.cumsum(count)][offsets] + np.arange(len(offsets))  # every chain has its start besides
    xy = np.empty((new[-1], 2))
    start = np.zeros(len(xy), bool)
    start[new[:-1]] = True
    xy[start], xy[~start] = cubics[offsets[:-1], 0], along
    return xy, new
