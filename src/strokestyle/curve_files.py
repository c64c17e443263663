"""Curves drawn by another program, or by hand: .json and .svg files -> Curves. Nothing else is ever read."""

from __future__ import annotations

import gzip
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

import numpy as np

from .curves import KINDS, Curves

LARGEST = 32 * 2**20  # bytes of text, unpacked
FARTHEST = 1e6  # px: a point beyond is a mistake
TOLERANCE = 0.05  # px between a Bezier curve and its polyline
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_UNITS = {"": 1.0, "px": 1.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0, "pt": 96 / 72, "pc": 16.0, "%": np.nan}
_HIDDEN = {"defs", "clipPath", "mask", "marker", "pattern", "symbol", "metadata"}
_NUMBER = re.compile(r"[\s,]*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
_FLAG = re.compile(r"[\s,]*([01])")
_COMMAND = re.compile(r"[\s,]*([MmLlHhVvCcSsQqTtAaZz])")
_TRANSFORM = re.compile(r"[\s,]*(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^()]*)\)")
_ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}


def load_curves(path: str | Path, size: tuple[int, int]) -> Curves:
    """Read the curves of a .json, .svg or .svgz file onto a canvas of `size` = (width, height) pixels.

    JSON: {"size": [w, h], "curves": [[[x, y], ...], ...], "kinds": [name, ...], "closed": [true, ...]}, pixels, of
    which only "curves" must be there; `strokestyle extract -o FILE.json` writes it. SVG: path, polyline, polygon and
    line elements that are not hidden, under the transforms of their groups. The kind of a line is named by its own id,
    Inkscape label or class, or that of a group around it; else it is "other". A file of another size than the canvas is
    scaled evenly to fit and centred, as an SVG viewer does.

    Raises OSError where the file cannot be read, ValueError, naming it, where it holds no such curves.
    """
    path = Path(path)
    read = {".json": _from_json, ".svg": _from_svg, ".svgz": _from_svg}.get(path.suffix.lower())
    if read is None:
        raise ValueError(f"{path}: curves are read from .json and .svg files, not from {path.suffix or 'this'}")
    if path.is_dir():
        raise IsADirectoryError(f"{path}: a folder, not a file of curves")
    try:
        text = _contents(path)
        lines, kinds, closed, box, stretch = read(text)
        if box is not None:
            matrix = _fit(box, size, stretch)
            lines = [_apply(matrix, line) for line in lines]
        return _curves(lines, kinds, closed)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _contents(path: Path) -> bytes:
    with open(path, "rb") as file:
        data = file.read(LARGEST + 1)
    if data[:2] == b"\x1f\x8b":
        try:
            with gzip.open(path) as file:
                data = file.read(LARGEST + 1)
        except (EOFError, OSError) as error:
            raise ValueError(f"damaged gzip data ({error})") from None
    if len(data) > LARGEST:
        raise ValueError(f"more than {LARGEST // 2**20} MB: too much for a file of curves")
    if not data.strip():
        raise ValueError("the file is empty")
    return data


def _curves(lines, kinds, closed) -> Curves:
    kept = [i for i, line in enumerate(lines) if len(line) > 1 and np.ptp(line, axis=0).max() > 1e-9]
    if not kept:
        raise ValueError("no curves in it")
    out = []
    for i in kept:
        line = lines[i]
        if not np.isfinite(line).all() or np.abs(line).max() > FARTHEST:
            raise ValueError(f"curve {i + 1} has a point more than {FARTHEST:g} px away, or none that is a number")
        ring = closed[i] and len(line) > 2
        out.append(np.concatenate([line, line[:1]]) if ring and not np.array_equal(line[0], line[-1]) else line)
    rings = [closed[i] and len(line) > 3 for i, line in zip(kept, out, strict=True)]
    return Curves.from_list(out, [KINDS.index(kinds[i]) for i in kept], rings)


def _kind(name) -> str | None:
    """ "layer-contour", "Contours" and "contour" -> "contour"; None for what is not a kind."""
    name = str(name).strip().lower().removeprefix("layer-").replace(" contour", "").replace(" ridge", "")
    return next((kind for kind in KINDS if name in (kind, kind + "s")), {"valleys": "valley"}.get(name))


def _fit(box, size, stretch: bool = False) -> np.ndarray:
    """The affine map (2, 3) of a box (x, y, w, h) into the canvas."""
    scale = np.array([size[0] / box[2], size[1] / box[3]])
    if not stretch:
        scale[:] = scale.min()
    shift = 0.5 * np.array(size) - scale * (np.array(box[:2]) + 0.5 * np.array(box[2:]))
    return np.array([[scale[0], 0.0, shift[0]], [0.0, scale[1], shift[1]]])


def _apply(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ matrix[:, :2].T + matrix[:, 2]


# ----------------------------------------------------------------------------------------------------------- JSON


def _from_json(text: bytes):
    try:
        data = json.loads(text.decode("utf-8-sig"))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise ValueError(f"not JSON ({error})") from None
    if not isinstance(data, dict) or not isinstance(data.get("curves"), list):
        raise ValueError('expected a JSON object with "curves": [[[x, y], ...], ...]')
    lines = []
    for i, line in enumerate(data["curves"]):
        try:
            points = np.array(line, np.float64)
        except (TypeError, ValueError, OverflowError):
            points = np.zeros(0)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"curve {i + 1} is not a list of [x, y] points")
        lines.append(points)
    kinds, closed = data.get("kinds"), data.get("closed")
    for name, value in (("kinds", kinds), ("closed", closed)):
        if value is not None and not (isinstance(value, list) and len(value) == len(lines)):
            raise ValueError(f'"{name}" must be a list as long as "curves" ({len(lines)})')
    kinds = [_kind(name) or "other" for name in kinds] if kinds else ["other"] * len(lines)
    if closed is None:
        closed = [len(line) > 3 and np.array_equal(line[0], line[-1]) for line in lines]
    size = data.get("size")
    if size is None:
        return lines, kinds, closed, None, False
    try:
        box = (0.0, 0.0, *(float(value) for value in size))
    except (TypeError, ValueError):
        box = ()
    if len(box) != 4 or not (np.isfinite(box).all() and min(box[2:]) > 0):
        raise ValueError(f'"size" must be [width, height] in pixels, got {str(size)[:40]}')
    return lines, kinds, closed, box, False


# ------------------------------------------------------------------------------------------------------------ SVG


def _from_svg(text: bytes):
    _refuse_entities(text)
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ValueError(f"not SVG ({error})") from None
    if _tag(root) != "svg":
        raise ValueError(f"not SVG: the document is a <{_tag(root)[:40]}>")
    lines, kinds, closed = [], [], []
    identity = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    box = _view_box(root)
    stretch = root.get("preserveAspectRatio", "").strip().startswith("none")
    stack = [(root, identity, "other")]
    while stack:
        element, matrix, kind = stack.pop()
        name = _tag(element)
        style = element.get("style", "").replace(" ", "")
        if name in _HIDDEN or element.get("display") == "none" or "display:none" in style:
            continue
        names = [element.get("id", ""), element.get(INKSCAPE + "label", ""), *element.get("class", "").split()]
        kind = next((found for found in map(_kind, names) if found), kind)
        if name == "svg" and element is not root:
            matrix = _compose(matrix, _nested(element))
        if element.get("transform"):
            matrix = _compose(matrix, _transform(element.get("transform")))
        for points, ring in _element_lines(name, element, matrix):
            lines.append(points)
            kinds.append(kind)
            closed.append(ring)
        stack.extend((child, matrix, kind) for child in reversed(element))
    return lines, kinds, closed, box, stretch


def _refuse_entities(text: bytes) -> None:
    """A plain DOCTYPE is harmless; one that declares entities is how small files grow without end."""

    def refuse(*_):
        raise ValueError("it declares XML entities, which are not read; save it as plain SVG")

    parser = expat.ParserCreate()
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(f"not SVG ({error})") from None


def _tag(element) -> str:
    return element.tag.rsplit("}", 1)[-1] if isinstance(element.tag, str) else ""


def _length(text: str | None) -> float | None:
    """A length in px; None where there is none, or it is relative."""
    match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(px|mm|cm|in|pt|pc|%|)\s*", text or "")
    if match is None:
        return None
    value = float(match[1]) * _UNITS[match[2]]
    return value if np.isfinite(value) else None


def _numbers(text: str, what: str) -> list[float]:
    values, at = [], 0
    while match := _NUMBER.match(text, at):
        values.append(float(match[1]))
        at = match.end()
    if text[at:].strip(" \t\r\n,"):
        raise ValueError(f"{what}: {text[at : at + 20].strip()!r} is not a number")
    return values


def _view_box(element) -> tuple[float, float, float, float] | None:
    if element.get("viewBox"):
        box = _numbers(element.get("viewBox"), "viewBox")
        if len(box) != 4 or not min(box[2:]) > 0:
            raise ValueError(f"viewBox must be four numbers with a size, got {element.get('viewBox')[:40]!r}")
        return tuple(box)
    width, height = _length(element.get("width")), _length(element.get("height"))
    return (0.0, 0.0, width, height) if width and height and min(width, height) > 0 else None


def _nested(element) -> np.ndarray:
    """The map of an <svg> inside an <svg>."""
    x, y = _length(element.get("x")) or 0.0, _length(element.get("y")) or 0.0
    shift = np.array([[1.0, 0.0, x], [0.0, 1.0, y]])
    width, height = _length(element.get("width")), _length(element.get("height"))
    if element.get("viewBox") and width and height and min(width, height) > 0:
        stretch = element.get("preserveAspectRatio", "").strip().startswith("none")
        return _compose(shift, _fit(_view_box(element), (width, height), stretch))
    return shift


def _compose(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    return np.concatenate([outer[:, :2] @ inner[:, :2], (outer[:, :2] @ inner[:, 2] + outer[:, 2])[:, None]], axis=1)


def _transform(text: str) -> np.ndarray:
    matrix, at = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), 0
    while match := _TRANSFORM.match(text, at):
        at = match.end()
        name, a = match[1], _numbers(match[2], f"transform {match[1]}")
        allowed = {"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3), "skewX": (1,), "skewY": (1,)}
        if len(a) not in allowed[name]:
            raise ValueError(f"transform {name} takes {' or '.join(map(str, allowed[name]))} numbers, got {len(a)}")
        if name == "matrix":
            step = np.array([[a[0], a[2], a[4]], [a[1], a[3], a[5]]])
        elif name == "translate":
            step = np.array([[1.0, 0.0, a[0]], [0.0, 1.0, a[1] if len(a) > 1 else 0.0]])
        elif name == "scale":
            step = np.array([[a[0], 0.0, 0.0], [0.0, a[-1], 0.0]])
        elif name == "rotate":
            c, s = np.cos(np.radians(a[0])), np.sin(np.radians(a[0]))
            x, y = a[1:] if len(a) > 1 else (0.0, 0.0)
            step = np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y]])
        else:
            t = np.tan(np.radians(a[0]))
            step = np.array([[1.0, t, 0.0], [0.0, 1.0, 0.0]] if name == "skewX" else [[1.0, 0.0, 0.0], [t, 1.0, 0.0]])
        matrix = _compose(matrix, step)
    if text[at:].strip(" \t\r\n,") not in ("", "none"):
        raise ValueError(f"transform {text[at : at + 30].strip()!r} is not understood")
    return matrix


def _element_lines(name: str, element, matrix: np.ndarray):
    """[(points (n, 2), closed), ...] of one element, in the coordinates of the page."""
    if name == "path":
        return [(_flatten(_apply(matrix, beziers)), ring) for beziers, ring in _path(element.get("d", ""))]
    if name == "line":
        ends = [_length(element.get(key, "0")) or 0.0 for key in ("x1", "y1", "x2", "y2")]
        return [(_apply(matrix, np.array(ends).reshape(2, 2)), False)]
    if name in ("polyline", "polygon"):
        values = _numbers(element.get("points", ""), name)
        points = np.array(values[: len(values) // 2 * 2]).reshape(-1, 2)
        ring = name == "polygon" or (len(points) > 3 and np.array_equal(points[0], points[-1]))
        return [(_apply(matrix, points), ring)] if len(points) else []
    return []


def _path(d: str) -> list[tuple[np.ndarray, bool]]:
    """Path data -> [(control points (1 + 3 n, 2) of n cubic Beziers, closed), ...], one per subpath (SVG 2, ch. 9)."""
    done, current = [], []
    start = here = np.zeros(2)
    control, before, command, at = here, "", "", 0

    def finish(ring):
        if len(current) > 1:
            done.append((np.array(current), ring))
        current.clear()

    def cubic(*points):
        if not current:
            current.append(here)
        current.extend(points)

    while True:
        if match := _COMMAND.match(d, at):
            command, at = match[1], match.end()
            if not before and command not in "Mm":
                raise ValueError(f"path data must begin with M, got {d[:20].strip()!r}")
        elif not d[at:].strip(" \t\r\n,"):
            break
        elif command in ("", "Z", "z"):
            raise ValueError(f"path data {d[at : at + 20].strip()!r} is not understood")
        upper, relative = command.upper(), command.islower()
        a = []
        for i in range(_ARGUMENTS[upper]):
            match = (_FLAG if upper == "A" and i in (3, 4) else _NUMBER).match(d, at)
            if match is None:
                raise ValueError(f"path data: {command} lacks a number before {d[at : at + 20].strip()!r}")
            a.append(float(match[1]))
            at = match.end()
        if a and not max(map(abs, a)) < 1e12:
            raise ValueError(f"path data: a number of {command} is too large")
        origin = here if relative else np.zeros(2)
        points = [np.array(a[i : i + 2]) + origin for i in range(0, len(a) - 1, 2)] if upper in "MLCSQT" else []
        if upper == "Z":
            if current and not np.array_equal(here, start):
                cubic(here, start, start)
            finish(True)
            end = start
        elif upper == "M":
            finish(False)
            start = end = points[0]
            command = "l" if relative else "L"  # further pairs are lines
        elif upper in "LHV":
            if upper == "L":
                end = points[0]
            else:
                axis = 0 if upper == "H" else 1
                end = here.copy()
                end[axis] = a[0] + origin[axis]
            cubic(here, end, end)
        elif upper in "CS":
            first = points[0] if upper == "C" else (2 * here - control if before in ("C", "S") else here)
            control, end = points[-2:]
            cubic(first, control, end)
        elif upper in "QT":
            control = points[0] if upper == "Q" else (2 * here - control if before in ("Q", "T") else here)
            end = points[-1]
            cubic(here + 2 / 3 * (control - here), end + 2 / 3 * (control - end), end)
        else:
            end = np.array(a[5:7]) + origin
            for piece in _arc(here, end, *a[:5]):
                cubic(*piece)
        here, before = end, upper
    finish(False)
    return [(points, ring or (len(points) > 7 and np.array_equal(points[0], points[-1]))) for points, ring in done]


def _arc(start, end, rx, ry, angle, large, sweep) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """An elliptical arc as cubic Beziers of at most 90 degrees (SVG 2, appendix B.2.4)."""
    rx, ry = abs(rx), abs(ry)
    if np.array_equal(start, end):
        return []
    if rx < 1e-12 or ry < 1e-12:
        return [(start, end, end)]
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[c, -s], [s, c]])
    x, y = turn.T @ (0.5 * (start - end)) / (rx, ry)  # half the chord, on the unit circle
    half = x * x + y * y
    if half > 1.0:  # radii too small: enlarged until they just reach
        grow = np.sqrt(half)
        rx, ry, x, y, half = rx * grow, ry * grow, x / grow, y / grow, 1.0
    offset = np.sqrt(max(1.0 / half - 1.0, 0.0)) * (-1.0 if large == sweep else 1.0)
    centre = np.array([offset * y, -offset * x])
    first = np.arctan2(y - centre[1], x - centre[0])
    sweep_angle = (np.arctan2(-y - centre[1], -x - centre[0]) - first) % (2 * np.pi)
    if not sweep:
        sweep_angle -= 2 * np.pi
    count = max(int(np.ceil(abs(sweep_angle) / (0.5 * np.pi) - 1e-9)), 1)
    middle = 0.5 * (start + end) + turn @ (centre * (rx, ry))
    at = first + sweep_angle * np.arange(count + 1) / count
    on = np.stack([np.cos(at), np.sin(at)], axis=1)
    tangent = np.stack([-np.sin(at), np.cos(at)], axis=1) * (4 / 3 * np.tan(0.25 * sweep_angle / count))
    out = []
    for i in range(count):
        unit = (on[i] + tangent[i], on[i + 1] - tangent[i + 1], on[i + 1])
        out.append(tuple(middle + turn @ (p * (rx, ry)) for p in unit))
    out[-1] = (*out[-1][:2], end)
    return out


def _flatten(beziers: np.ndarray) -> np.ndarray:
    """Control points (1 + 3 n, 2) of joined cubic Beziers -> a polyline within TOLERANCE."""
    p0, p1, p2, p3 = beziers[:-1:3], beziers[1::3], beziers[2::3], beziers[3::3]
    bend = np.maximum(np.linalg.norm(p0 - 2 * p1 + p2, axis=1), np.linalg.norm(p1 - 2 * p2 + p3, axis=1))
    # a line was written with its first control point at its start and its second at its end
    straight = (np.abs(p1 - p0).max(axis=1) < 1e-12) & (np.abs(p2 - p3).max(axis=1) < 1e-12)
    bend = np.where(straight | ~np.isfinite(bend), 0.0, bend)
    count = np.clip(np.ceil(np.sqrt(0.75 * bend / TOLERANCE)), 1, 500).astype(np.int64)
    piece = np.repeat(np.arange(len(count)), count)
    t = ((np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)) + 1.0) / count[piece]
    s, t = 1.0 - t[:, None], t[:, None]
    points = s**3 * p0[piece] + 3 * s * s * t * p1[piece] + 3 * s * t * t * p2[piece] + t**3 * p3[piece]
    points[np.cumsum(count) - 1] = p3
    return np.concatenate([beziers[:1], points])
