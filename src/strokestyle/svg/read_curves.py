"""Curves that another program drew, laid on the canvas: the .json of `strokestyle extract`, or any .svg or .svgz.

Files come from anywhere, so nothing in them is followed or expanded: no entity, no reference, no style sheet; what is
too large, too deep or of too many points is refused.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

from ..geometry.curves import KINDS, Curves, owner
from . import path_data as limits
from .path_data import (
    IDENTITY,
    INKSCAPE_NAMESPACE,
    MAX_NUMBER,
    SPACE,
    SVG_NAMESPACE,
    Affine,
    Segment,
    Walker,
    compose,
    css_property,
    fit_box,
    flatten,
    length,
    limited,
    page_length,
    parse_numbers,
    parse_path,
    parse_transform,
    shape_path,
    transformed,
)

MAX_CURVES = 50_000
SAME_POINT = 1e-6  # px; nearer points are one
BORDER = 0.5  # px; a frame this near the page's edge is the paper, not a line


def load_curves(path: str | Path, size: tuple[int, int], tolerance: float = 0.1) -> Curves:
    """Curves of a .json or .svg file on a canvas of `size` (width, height) pixels.

    The file's page is scaled to the canvas without distortion, and centred where their proportions differ. Curves are
    neither resampled nor clipped. Curves without two distinct points are left out, and so is an SVG's paper: a closed
    shape that runs along the page's edge. A curve is closed where its last point is its first.

    A .json file has "curves" [[[x, y], ...], ...] and perhaps "kinds" [name, ...], "closed" [true, ...] and "size"
    [width, height]; without a size its coordinates are the canvas's pixels. In an .svg file every subpath of path,
    line, polyline, polygon, rect, circle and ellipse is a curve, of the kind that its own or its nearest ancestor's
    label, id or class names; of one of our own strokes it is the centre line. Definitions and hidden elements are
    skipped, and so are our own layers of hidden lines; `use` is not followed.

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
        data = file.read(limits.MAX_BYTES + 1)
    try:
        if suffix == ".json":
            return _read_json(limited(data), size)
        return _read_svg(limited(data), size, tolerance)
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
    if data.count(b"[") > 8 * limits.MAX_POINTS:  # before millions of lists are made of them
        raise ValueError(f"more than {8 * limits.MAX_POINTS} lists: simplify the curves first")
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
    if counts.sum() > limits.MAX_POINTS:
        raise ValueError(f"{counts.sum()} points are more than {limits.MAX_POINTS}: simplify the curves first")
    a, _, _, d, e, f = fit_box((0.0, 0.0, *_json_size(content.get("size"), size)), (0.0, 0.0, *size))
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

LABEL = INKSCAPE_NAMESPACE + "}label"
SHAPES = ("path", "line", "polyline", "polygon", "rect", "circle", "ellipse")
GROUPS = ("svg", "g", "a", "switch")  # what is in any other element is not drawn, or is no line


def _read_svg(data: bytes, size: tuple[int, int], tolerance: float) -> Curves:
    reader = _SvgReader(size)
    Walker(reader.start, reader.end).walk(data)
    if not reader.kinds:
        raise ValueError(f"no usable curve in it: no visible {', '.join(SHAPES[:-1])} or {SHAPES[-1]}")
    cubics, offsets, kinds = reader.cubics()
    xy, offsets = flatten(cubics, offsets, tolerance)
    return _finish(xy, offsets, kinds)


class _SvgReader:
    """Collects the shapes of a document as a Walker comes by them.

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
        # of each open element: matrix to the canvas, kind, visible?, (width, height) that percentages refer to;
        # None where nothing inside is drawn
        self.stack: list[tuple[Affine, int, bool, tuple[float, float]] | None] = []

    def end(self):
        self.stack.pop()

    def start(self, namespace: str, tag: str, attributes: dict[str, str]):
        drawn = namespace in ("", SVG_NAMESPACE)
        inside = not self.stack or self.stack[-1] is not None
        self.stack.append(self.enter(tag, attributes) if drawn and inside else None)

    def enter(self, tag: str, attributes: dict[str, str]):
        """The stack's entry for an element; the curves of a shape are added."""
        root = not self.stack
        shape = tag in SHAPES or "data-ss-path" in attributes
        style = attributes.get("style", "")
        if css_property("display", style, attributes) == "none" or not (shape or tag in GROUPS):
            return None
        if "data-ss-hidden" in attributes:  # a layer of ours, of what is behind the shape
            return None
        matrix, kind, visible, view = (IDENTITY, KINDS.index("other"), True, (0.0, 0.0)) if root else self.stack[-1]
        visibility = css_property("visibility", style, attributes)
        visible = visible if visibility in ("", "inherit") else visibility == "visible"
        for key in ("data-ss-class", LABEL, "id", "class"):
            if key in attributes and (named := kind_named(attributes[key])) is not None:
                kind = named
                break
        if "transform" in attributes:
            matrix = compose(matrix, parse_transform(attributes["transform"]))
        if shape:
            if visible:
                self.add(tag, attributes, matrix, kind, view)
            return None
        if tag == "svg":
            matrix, view = self.viewport(attributes, matrix, view, root)
        return matrix, kind, visible, view

    def viewport(self, attributes, matrix: Affine, view: tuple[float, float], root: bool):
        """Matrix of what is inside an svg element, and the (width, height) that its percentages refer to."""
        box = parse_numbers(attributes["viewBox"], "viewBox") if "viewBox" in attributes else None
        if box is not None and (len(box) != 4 or min(box[2:]) < 1 / MAX_NUMBER):
            raise ValueError("viewBox must be four numbers, x y width height, the last two above 0")
        if root:
            width, height = page_length(attributes, "width"), page_length(attributes, "height")
            if width is None or height is None:  # as the 100% that browsers are given
                width, height = self.canvas[2:]
            x, y = 0.0, 0.0
            matrix = compose(fit_box((0.0, 0.0, width, height), self.canvas), matrix)  # the page on the canvas
        else:
            x, y, width, height = (
                length(attributes.get(key, default), key, whole)
                for key, default, whole in zip(
                    ("x", "y", "width", "height"), "0 0 100% 100%".split(), view * 2, strict=True
                )
            )
            if min(width, height) < 1 / MAX_NUMBER:
                raise ValueError("the width and height of an svg element must be above 0")
        align = attributes.get("preserveAspectRatio", "")
        inner = fit_box(box, (x, y, width, height), align) if box else (1.0, 0.0, 0.0, 1.0, x, y)
        matrix = compose(matrix, inner)
        if root:
            left, top, across, down = box or (0.0, 0.0, width, height)
            (x0, y0), (x1, y1) = transformed(matrix, np.array([[left, top], [left + across, top + down]])).tolist()
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
            subpaths = parse_path(shape_path(tag, attributes, view))
        for segments in subpaths:
            self.segments += segments
            self.counts.append(len(segments))
            self.matrices.append(matrix)
            self.kinds.append(kind)
        if len(self.segments) > limits.MAX_POINTS or len(self.kinds) > MAX_CURVES:
            raise ValueError(f"more than {limits.MAX_POINTS} points or {MAX_CURVES} curves: simplify the drawing first")

    def cubics(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cubics (S, 4, 2) in pixels of the canvas, the offsets (C+1,) of their chains and the chains' kinds (C,).

        The paper is left out: a closed shape none of whose segments comes inside the page is the background, or the
        bounding box that some programs export.
        """
        counts, kinds = np.array(self.counts), np.array(self.kinds)
        matrices = np.repeat(np.array(self.matrices), counts, axis=0)[:, :, None]
        cubics = transformed(matrices.transpose(1, 0, 2), np.array(self.segments).reshape(-1, 4, 2))
        end = np.cumsum(counts)
        low = np.array(self.page[:2])
        high = low + self.page[2:]
        outside = (cubics <= low + BORDER).all(axis=1) | (cubics >= high - BORDER).all(axis=1)  # (S, 2)
        paper = np.logical_and.reduceat(outside.any(axis=1), end - counts)
        paper &= (np.abs(cubics[end - counts, 0] - cubics[end - 1, 3]) <= SAME_POINT).all(axis=1)
        return cubics[np.repeat(~paper, counts)], np.r_[0, np.cumsum(counts[~paper])], kinds[~paper]
