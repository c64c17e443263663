"""Curves that another program drew, laid on the canvas: the .json of `strokestyle extract`, or any .svg or .svgz.

Files come from anywhere, so nothing in them is followed or expanded: no entity, no reference, no style sheet; what is
too large, too deep or of too many points is refused.
"""

from __future__ import annotations

import json
import math
import re
import zlib
from pathlib import Path
from xml.parsers import expat

import numpy as np

from .curves import KINDS, Curves, owner

MAX_BYTES = 64 * 2**20  # of a file, an .svgz's once decompressed
MAX_POINTS = 500_000
MAX_CURVES = 50_000
MAX_ELEMENTS = 200_000
MAX_DEPTH = 256  # of elements inside one another
MAX_TEXT = 16 * 2**20  # characters of one path
MAX_NUMBER = 1e12  # larger ones are mistakes, and their products leave the range of a float
SAME_POINT = 1e-6  # px; nearer points are one
BORDER = 0.5  # px; a frame this near the page's edge is the paper, not a line

Affine = tuple[float, float, float, float, float, float]  # SVG's matrix: x' = a x + c y + e, y' = b x + d y + f
IDENTITY: Affine = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


def load_curves(path: str | Path, size: tuple[int, int], tolerance: float = 0.1) -> Curves:
    """Curves of a .json or .svg file on a canvas of `size` (width, height) pixels.

    The file's page is scaled to the canvas without distortion, and centred where their proportions differ. Curves are
    neither resampled nor clipped. Curves without two distinct points are left out, and so is an SVG's paper: a closed
    shape that runs along the page's edge. A curve is closed where its last point is its first.

    A .json file has "curves" [[[x, y], ...], ...] and perhaps "kinds" [name, ...], "closed" [true, ...] and "size"
    [width, height]; without a size its coordinates are the canvas's pixels. In an .svg file every subpath of path,
    line, polyline, polygon, rect, circle and ellipse is a curve, of the kind that its own or its nearest ancestor's
    label, id or class names; of one of our own strokes it is the centre line. Definitions and hidden elements are
    skipped, and `use` is not followed.

    Parameters
    ----------
    size : (width, height) of the canvas, pixels
    tolerance : pixels of the canvas between a curve and its chords

    Raises
    ------
    ValueError
        on a file that is neither, is damaged, too large or unsafe, or has no usable curve.
    OSError
        where the file cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".json", ".svg", ".svgz"):
        found = f"not from {suffix}" if suffix else "and this name has no such ending"
        raise ValueError(f"{path}: curves are read from a .json or .svg file, {found}")
    with open(path, "rb") as file:
        data = file.read(MAX_BYTES + 1)
    try:
        if suffix == ".json":
            return _read_json(_limited(data), size)
        return _read_svg(_limited(_unzip(data) if data[:2] == b"\x1f\x8b" else data), size, tolerance)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def kind_named(name: str) -> int | None:
    """Index into KINDS of the kind that a name holds as a word of its own ("layer-contour", "Creases"), or None.

    "suggestive contours" are suggestive: the words that qualify another kind are sought first.
    """
    words = [word.lower() for word in re.findall("[A-Z]?[a-z]+|[A-Z]+", name[:200])]
    singular = {re.sub("s$", "", re.sub("ies$", "y", word)) for word in words}
    for kind in ("suggestive", "apparent", *KINDS):
        if kind in singular:
            return KINDS.index(kind)
    return None


def _limited(data: bytes) -> bytes:
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


def _finish(xy: np.ndarray, offsets: np.ndarray, kind: np.ndarray, closed: np.ndarray | None = None) -> Curves:
    """Curves without repeated points and without those that are but a point; `closed` None: where the ends meet."""
    which = owner(offsets)
    keep = np.ones(len(xy), bool)
    keep[1:] = (np.abs(np.diff(xy, axis=0)) > SAME_POINT).any(axis=1) | (which[1:] != which[:-1])
    count = np.bincount(which[keep], minlength=len(offsets) - 1)
    keep &= (count >= 2)[which]
    usable = np.flatnonzero(count >= 2)
    if not len(usable):
        raise ValueError(f"no usable curve in it: none of {len(count)} has two distinct points")
    xy, offsets = xy[keep], np.r_[0, np.cumsum(count[usable])]
    start, end = offsets[:-1], offsets[1:] - 1
    meet = (np.abs(xy[start] - xy[end]) <= SAME_POINT).all(axis=1) & (end - start >= 3)
    if closed is not None:
        meet &= closed[usable]
    xy[end[meet]] = xy[start[meet]]
    return Curves(xy, offsets, kind[usable], meet)


# ---------------------------------------------------------------------------------------------------------- JSON


def _read_json(data: bytes, size: tuple[int, int]) -> Curves:
    wanted = '"curves": [[[x, y], ...], ...]'
    if data.count(b"[") > 8 * MAX_POINTS:  # before millions of lists are made of them
        raise ValueError(f"more than {8 * MAX_POINTS} lists: simplify the curves first")
    try:
        content = json.loads(data)
    except RecursionError:
        raise ValueError(f"its lists are nested too deep; a file of curves is a JSON object with {wanted}") from None
    except ValueError as error:  # JSONDecodeError, UnicodeDecodeError, a number of too many digits
        raise ValueError(f"not a file of curves (JSON expected: {error})") from None
    if not isinstance(content, dict) or "curves" not in content:
        found = _keys(content) if isinstance(content, dict) else _a(content)
        raise ValueError(f"no curves in it, but {found}; a file of curves is a JSON object with {wanted}")
    lines = content["curves"]
    if not isinstance(lines, list):
        raise ValueError(f'"curves" must be a list of lists of points, {wanted}; got {_a(lines)}')
    if len(lines) > MAX_CURVES:
        raise ValueError(f"{len(lines)} curves are more than {MAX_CURVES}: simplify them first")
    lines = [_points(line, i) for i, line in enumerate(lines)]

    kinds = content.get("kinds")
    if kinds is None:
        kinds = ["other"] * len(lines)
    if not isinstance(kinds, list) or len(kinds) != len(lines) or not all(isinstance(kind, str) for kind in kinds):
        found = f"a list of {len(kinds)}" if isinstance(kinds, list) else _a(kinds)
        raise ValueError(f'"kinds" must be a list of names, one for each of the {len(lines)} curves; got {found}')
    other = KINDS.index("other")
    kind = np.array([other if (k := kind_named(name)) is None else k for name in kinds], np.int64)

    closed = content.get("closed")
    if closed is not None:
        if not isinstance(closed, list) or len(closed) != len(lines) or not all(isinstance(c, bool) for c in closed):
            raise ValueError(f'"closed" must be a list of true and false, one for each of the {len(lines)} curves')
        # other programs leave out the point that closes a curve: it is our convention that repeats it
        lines = [
            np.concatenate([line, line[:1]]) if c and len(line) > 2 and (line[0] != line[-1]).any() else line
            for line, c in zip(lines, closed, strict=True)
        ]
        closed = np.array(closed, bool)

    counts = np.array([len(line) for line in lines], np.int64)
    if counts.sum() > MAX_POINTS:
        raise ValueError(f"{counts.sum()} points are more than {MAX_POINTS}: simplify the curves first")
    a, _, _, d, e, f = _fit((0.0, 0.0, *_json_size(content.get("size"), size)), (0.0, 0.0, *size))
    xy = np.concatenate([np.zeros((0, 2)), *lines]) * (a, d) + (e, f)
    return _finish(xy, np.r_[0, np.cumsum(counts)], kind, closed)


def _points(line, i: int) -> np.ndarray:
    """One curve of a JSON file, (n, 2)."""
    try:
        points = np.asarray(line)
    except (ValueError, OverflowError):  # ragged
        points = np.zeros(0, object)
    if isinstance(line, list) and not line:
        return np.zeros((0, 2))
    if points.dtype.kind not in "iuf" or points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"curve {i} must be a list of points [x, y], each two numbers in pixels")
    points = points.astype(np.float64)
    bad = ~(np.abs(points) <= MAX_NUMBER).all(axis=1)
    if bad.any():
        k = int(bad.argmax())
        raise ValueError(f"curve {i}, point {k} is {points[k].tolist()}: coordinates must be finite, in pixels")
    return points


def _json_size(found, canvas: tuple[int, int]) -> tuple[float, float]:
    if found is None:
        return canvas
    numbers = isinstance(found, list) and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in found)
    if not (numbers and len(found) == 2 and all(1 / MAX_NUMBER <= v <= MAX_NUMBER for v in found)):
        raise ValueError(f'"size" must be [width, height] in pixels, both above 0; got {json.dumps(found)[:60]}')
    return float(found[0]), float(found[1])


def _a(value) -> str:
    names = {dict: "an object", list: "a list", str: "a text", bool: "true or false", type(None): "null"}
    return names.get(type(value), "a number")


def _keys(content: dict) -> str:
    names = ", ".join(json.dumps(key)[:30] for key in list(content)[:4])
    return "an empty object" if not content else f"an object with {names}{', ...' * (len(content) > 4)}"


# ----------------------------------------------------------------------------------------------------------- SVG

SVG_NAMESPACE = "http://www.w3.org/2000/svg"
LABEL = "http://www.inkscape.org/namespaces/inkscape}label"
SHAPES = ("path", "line", "polyline", "polygon", "rect", "circle", "ellipse")
GROUPS = ("svg", "g", "a", "switch")  # what is in any other element is not drawn, or is no line
UNSAFE = (
    'its document type has declarations of its own ("<!DOCTYPE svg [...]>"); save it as plain SVG, or take them out'
)


def _read_svg(data: bytes, size: tuple[int, int], tolerance: float) -> Curves:
    # every other byte of UTF-16 is NUL; the parser's own handlers refuse what this first look may not see
    if b"<!entity" in (data.replace(b"\0", b"") if b"\0" in data else data).lower():
        raise ValueError(UNSAFE)
    if data.count(b"=") > 5 * MAX_ELEMENTS:  # the parser hands over an element whole, however many it has
        raise ValueError(f"more than {5 * MAX_ELEMENTS} attributes: simplify the drawing first")
    reader = _SvgReader(size)
    try:
        reader.parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ValueError(f"not an SVG file (XML expected: {error})") from None
    except LookupError as error:  # an encoding that Python does not know
        raise ValueError(f"not an SVG file ({error}); save it as UTF-8") from None
    if not reader.kinds:
        raise ValueError(f"no usable curve in it: no visible {', '.join(SHAPES[:-1])} or {SHAPES[-1]}")
    cubics, offsets, kinds = reader.cubics()
    xy, offsets = flatten(cubics, offsets, tolerance)
    return _finish(xy, offsets, kinds)


class _SvgReader:
    """Collects the shapes of a document as expat walks it; no tree is built.

    `segments` are those of all subpaths, as `parse_path` gives them; `counts`, `matrices` and `kinds` have one entry
    a subpath.
    """

    def __init__(self, size: tuple[int, int]):
        self.canvas = (0.0, 0.0, float(size[0]), float(size[1]))
        self.page = self.canvas
        self.segments: list[Segment] = []
        self.counts: list[int] = []
        self.matrices: list[Affine] = []
        self.kinds: list[int] = []
        self.elements = 0
        # of each open element: matrix to the canvas, kind, visible?, (width, height) that percentages refer to;
        # None where nothing inside is drawn
        self.stack: list[tuple[Affine, int, bool, tuple[float, float]] | None] = []
        self.parser = expat.ParserCreate(namespace_separator="}")
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.StartDoctypeDeclHandler = self.doctype
        self.parser.EntityDeclHandler = self.refuse

    def doctype(self, name, system, public, has_subset):
        """Old files name SVG's document type, which is not fetched; one with declarations of its own is refused."""
        if has_subset:
            self.refuse()

    def refuse(self, *_):
        raise ValueError(UNSAFE)

    def end(self, _):
        self.stack.pop()

    def start(self, name: str, attributes: dict[str, str]):
        self.elements += 1
        if self.elements > MAX_ELEMENTS or len(self.stack) >= MAX_DEPTH:
            raise ValueError(f"more than {MAX_ELEMENTS} elements, or {MAX_DEPTH} inside one another: simplify it first")
        namespace, _, tag = name.rpartition("}")
        drawn = namespace in ("", SVG_NAMESPACE)
        if not self.stack and not (drawn and tag == "svg"):
            raise ValueError(f"not an SVG file: its first element is <{_quoted(tag)}>; save the drawing as .svg")
        if not drawn or (self.stack and self.stack[-1] is None):
            self.stack.append(None)
            return
        try:
            self.stack.append(self.enter(tag, attributes))
        except ValueError as error:
            which = f' id="{_quoted(attributes["id"])}"' if "id" in attributes else ""
            raise ValueError(f"line {self.parser.CurrentLineNumber}, <{tag}{which}>: {error}") from None

    def enter(self, tag: str, attributes: dict[str, str]):
        """The stack's entry for an element; the curves of a shape are added."""
        root = not self.stack
        shape = tag in SHAPES or "data-ss-path" in attributes
        style = attributes.get("style", "")
        if _property("display", style, attributes) == "none" or not (shape or tag in GROUPS):
            return None
        matrix, kind, visible, view = (IDENTITY, KINDS.index("other"), True, (0.0, 0.0)) if root else self.stack[-1]
        visibility = _property("visibility", style, attributes)
        visible = visible if visibility in ("", "inherit") else visibility == "visible"
        for key in ("data-ss-class", LABEL, "id", "class"):
            if key in attributes and (named := kind_named(attributes[key])) is not None:
                kind = named
                break
        if "transform" in attributes:
            matrix = _compose(matrix, parse_transform(attributes["transform"]))
        if shape:
            if visible:
                self.add(tag, attributes, matrix, kind, view)
            return None
        if tag == "svg":
            matrix, view = self.viewport(attributes, matrix, view, root)
        return matrix, kind, visible, view

    def viewport(self, attributes, matrix: Affine, view: tuple[float, float], root: bool):
        """Matrix of what is inside an svg element, and the (width, height) that its percentages refer to."""
        box = _numbers(attributes["viewBox"], "viewBox") if "viewBox" in attributes else None
        if box is not None and (len(box) != 4 or min(box[2:]) < 1 / MAX_NUMBER):
            raise ValueError("viewBox must be four numbers, x y width height, the last two above 0")
        if root:
            width, height = _page_length(attributes, "width"), _page_length(attributes, "height")
            if width is None or height is None:  # as the 100% that browsers are given
                width, height = self.canvas[2:]
            x, y = 0.0, 0.0
            matrix = _compose(_fit((0.0, 0.0, width, height), self.canvas), matrix)  # the page on the canvas
        else:
            x, y, width, height = (
                _length(attributes.get(key, default), key, whole)
                for key, default, whole in zip(
                    ("x", "y", "width", "height"), "0 0 100% 100%".split(), view * 2, strict=True
                )
            )
            if min(width, height) < 1 / MAX_NUMBER:
                raise ValueError("the width and height of an svg element must be above 0")
        align = attributes.get("preserveAspectRatio", "")
        inner = _fit(box, (x, y, width, height), align) if box else (1.0, 0.0, 0.0, 1.0, x, y)
        matrix = _compose(matrix, inner)
        if root:
            left, top, across, down = box or (0.0, 0.0, width, height)
            (x0, y0), (x1, y1) = _transform(matrix, np.array([[left, top], [left + across, top + down]])).tolist()
            self.page = (min(x0, x1), min(y0, y1), abs(x1 - x0), abs(y1 - y0))
        return matrix, tuple(box[2:]) if box else (width, height)

    def add(self, tag: str, attributes, matrix: Affine, kind: int, view: tuple[float, float]):
        if "data-ss-path" in attributes:  # a stroke that we wrote: its outline is not its line
            subpaths = parse_path(attributes["data-ss-path"], name="data-ss-path")
        elif tag == "path":
            subpaths = parse_path(attributes.get("d", ""))
        elif tag in ("polyline", "polygon"):
            points = attributes.get("points", "")
            close = "Z" if tag == "polygon" and points.strip(SPACE) else ""
            subpaths = parse_path(points + close, command="M", name="points")
        else:
            subpaths = parse_path(_shape_path(tag, attributes, view))
        for segments in subpaths:
            self.segments += segments
            self.counts.append(len(segments))
            self.matrices.append(matrix)
            self.kinds.append(kind)
        if len(self.segments) > MAX_POINTS or len(self.kinds) > MAX_CURVES:
            raise ValueError(f"more than {MAX_POINTS} points or {MAX_CURVES} curves: simplify the drawing first")

    def cubics(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cubics (S, 4, 2) in pixels of the canvas, the offsets (C+1,) of their chains and the chains' kinds (C,).

        The paper is left out: a closed shape none of whose segments comes inside the page is the background, or the
        bounding box that some programs export.
        """
        counts, kinds = np.array(self.counts), np.array(self.kinds)
        matrices = np.repeat(np.array(self.matrices), counts, axis=0)[:, :, None]
        cubics = _transform(matrices.transpose(1, 0, 2), np.array(self.segments).reshape(-1, 4, 2))
        end = np.cumsum(counts)
        low = np.array(self.page[:2])
        high = low + self.page[2:]
        outside = (cubics <= low + BORDER).all(axis=1) | (cubics >= high - BORDER).all(axis=1)  # (S, 2)
        paper = np.logical_and.reduceat(outside.any(axis=1), end - counts)
        paper &= (np.abs(cubics[end - counts, 0] - cubics[end - 1, 3]) <= SAME_POINT).all(axis=1)
        return cubics[np.repeat(~paper, counts)], np.r_[0, np.cumsum(counts[~paper])], kinds[~paper]


def _quoted(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text[:40])


def _property(name: str, style: str, attributes: dict[str, str]) -> str:
    """A CSS property of the style attribute, else the attribute of that name, else ""."""
    found = re.findall(rf"(?:^|;)\s*{name}\s*:([^;!]*)", style[:10_000]) if name in style else ()
    return (found[-1] if found else attributes.get(name, "")).strip().lower()


# ---------------------------------------------------------------------------------------- lengths and transforms

SPACE = " \t\r\n\f"
UNITS = {"": 1.0, "px": 1.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6, "pt": 96 / 72, "pc": 16.0}
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_SPACES = re.compile(rf"[{SPACE}]*")
_NEXT_NUMBER = re.compile(rf"[{SPACE}]*(?:,[{SPACE}]*)?({_NUMBER})")
_NEXT_FLAG = re.compile(rf"[{SPACE}]*(?:,[{SPACE}]*)?([01])")
_LENGTH = re.compile(rf"({_NUMBER})([a-zA-Z]*|%)")
_FUNCTION = re.compile(rf"[{SPACE},]*([a-zA-Z]+)[{SPACE}]*\(([^()]*)\)")


def _number(text: str) -> float:
    value = float(text)
    if not abs(value) <= MAX_NUMBER:
        raise ValueError(f"the number {_quoted(text)} is too large to be a place in a drawing")
    return value


def _numbers(text: str, name: str) -> list[float]:
    """The numbers, at most eight, of an attribute."""
    text, values, at = text.rstrip(SPACE), [], 0
    while at < len(text):
        match = _NEXT_NUMBER.match(text, at)
        if not match or len(values) >= 8:
            raise ValueError(f'bad {name} "{_quoted(text)}": expected numbers')
        values.append(_number(match[1]))
        at = match.end()
    return values


def _length(text: str, name: str, whole: float) -> float:
    """A length in CSS pixels; a percentage is of `whole`."""
    match = _LENGTH.fullmatch(text.strip(SPACE))
    if match and match[2] == "%":
        return _number(match[1]) * whole / 100.0
    if not match or match[2].lower() not in UNITS:
        raise ValueError(f'{name}="{_quoted(text)}" is no length; use a number, or one in px, mm, cm, in, pt or %')
    return _number(match[1]) * UNITS[match[2].lower()]


def _page_length(attributes, name: str) -> float | None:
    """Width or height of the page, CSS pixels; None where it depends on the viewer's window."""
    text = attributes.get(name, "auto").strip(SPACE)
    if text == "auto" or text.endswith("%"):
        return None
    value = _length(text, name, 0.0)
    if value < 1 / MAX_NUMBER:
        raise ValueError(f'{name}="{_quoted(text)}": the page needs a width and height above 0')
    return value


def _fit(box, into, align: str = "") -> Affine:
    """The box (x, y, width, height) laid into another, after SVG's preserveAspectRatio; default: whole and centred."""
    (x, y, width, height), (to_x, to_y, to_width, to_height) = box, into
    sx, sy = to_width / width, to_height / height
    words = align.split() or ["xMidYMid"]
    if words[0] == "none":
        return (sx, 0.0, 0.0, sy, to_x - sx * x, to_y - sy * y)
    match = re.fullmatch("x(Min|Mid|Max)Y(Min|Mid|Max)", words[0])
    if not match:
        raise ValueError(f'bad preserveAspectRatio "{_quoted(align)}": expected none, or for instance xMidYMid meet')
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
            raise ValueError(f'bad transform at character {at + 1}, "{_quoted(text[at : at + 20])}"')
        at = match.end()
        matrix = _compose(matrix, _function(match[1], _numbers(match[2], "transform")))
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
        f"transform {_quoted(name)} with {len(v)} numbers: expected matrix (6), translate (1 or 2), scale (1 or 2), "
        "rotate (1 or 3), skewX (1) or skewY (1)"
    )


def _compose(outer: Affine, inner: Affine) -> Affine:
    """The matrix that applies `inner`, then `outer`."""
    a, b, c, d, e, f = outer
    p, q, r, s, t, u = inner
    made = (a * p + c * q, b * p + d * q, a * r + c * s, b * r + d * s, a * t + c * u + e, b * t + d * u + f)
    if not all(abs(value) <= MAX_NUMBER**2 for value in made):
        raise ValueError("its transforms together are too large to be a place in a drawing")
    return made


def _transform(matrix: Affine, points: np.ndarray) -> np.ndarray:
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
            f'bad {name} at character {place + 1}, "{_quoted(data[place : place + 20])}": expected {expected}'
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
            v.append(_number(match[1]))
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


def _shape_path(tag: str, attributes, view: tuple[float, float]) -> str:
    """Path data of a line, rect, circle or ellipse; "" where it draws nothing."""
    width, height = view

    def get(name, whole):
        return _length(attributes.get(name, "0"), name, whole)

    if tag == "line":
        return f"M{get('x1', width)} {get('y1', height)}L{get('x2', width)} {get('y2', height)}"
    if tag == "circle":
        rx = ry = get("r", math.hypot(width, height) / math.sqrt(2))
    else:  # a radius that is not given is the other one
        rx, ry = attributes.get("rx", "auto"), attributes.get("ry", "auto")
        rx, ry = (ry if rx == "auto" else rx), (rx if ry == "auto" else ry)
        rx, ry = (0.0, 0.0) if rx == "auto" else (_length(rx, "rx", width), _length(ry, "ry", height))
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
