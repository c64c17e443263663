"""Curves of any SVG file.

Files come from anywhere, so nothing in them is followed or expanded: no entity, no reference, no style sheet; what is
too large, too deep or of too many points is refused.
"""

from __future__ import annotations

import numpy as np

from .. import files as limits
from ..geometry.affine import IDENTITY, MAX_NUMBER, Affine, compose, fit_box, transformed
from ..geometry.bezier import Segment, flatten
from ..geometry.curves import KINDS, SAME_POINT, Curves, clean_curves, kind_named
from .format import INKSCAPE_NAMESPACE, Data
from .path_data import (
    SPACE,
    length,
    page_length,
    parse_numbers,
    parse_path,
    parse_transform,
    shape_path,
)
from .xml import SVG_NAMESPACE, SaxReader, css_property

BORDER = 0.5  # px; a frame this near the page's edge is the paper, not a line
LABEL = INKSCAPE_NAMESPACE + "}label"
SHAPES = ("path", "line", "polyline", "polygon", "rect", "circle", "ellipse")
GROUPS = ("svg", "g", "a", "switch")  # what is in any other element is not drawn, or is no line


def read_curves_svg(data: bytes, size: tuple[int, int], tolerance: float) -> Curves:
    reader = _SvgReader(size)
    SaxReader(reader.start, reader.end).walk(data)
    if not reader.kinds:
        raise ValueError(
            f"no usable curve in it: no visible {', '.join(SHAPES[:-1])} or {SHAPES[-1]}"
        )
    cubics, offsets, kinds = reader.cubics()
    xy, offsets = flatten(cubics, offsets, tolerance)
    return clean_curves(xy, offsets, kinds)


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
        shape = tag in SHAPES or Data.PATH in attributes
        style = attributes.get("style", "")
        if css_property("display", style, attributes) == "none" or not (shape or tag in GROUPS):
            return None
        if Data.HIDDEN in attributes:  # a layer of ours, of what is behind the shape
            return None
        matrix, kind, visible, view = (
            (IDENTITY, KINDS.index("other"), True, (0.0, 0.0)) if root else self.stack[-1]
        )
        visibility = css_property("visibility", style, attributes)
        visible = visible if visibility in ("", "inherit") else visibility == "visible"
        for key in (Data.CLASS, LABEL, "id", "class"):
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
            matrix = compose(
                fit_box((0.0, 0.0, width, height), self.canvas), matrix
            )  # the page on the canvas
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
            (x0, y0), (x1, y1) = transformed(
                matrix, np.array([[left, top], [left + across, top + down]])
            ).tolist()
            self.page = (min(x0, x1), min(y0, y1), abs(x1 - x0), abs(y1 - y0))
        return matrix, tuple(box[2:]) if box else (width, height)

    def add(self, tag: str, attributes, matrix: Affine, kind: int, view: tuple[float, float]):
        if Data.PATH in attributes:  # a stroke that we wrote: its outline is not its line
            subpaths = parse_path(attributes[Data.PATH], name=Data.PATH)
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
        if len(self.segments) > limits.MAX_POINTS or len(self.kinds) > limits.MAX_CURVES:
            raise ValueError(
                f"more than {limits.MAX_POINTS} points or {limits.MAX_CURVES} curves: simplify the drawing first"
            )

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
        outside = (cubics <= low + BORDER).all(axis=1) | (cubics >= high - BORDER).all(
            axis=1
        )  # (S, 2)
        paper = np.logical_and.reduceat(outside.any(axis=1), end - counts)
        paper &= (np.abs(cubics[end - counts, 0] - cubics[end - 1, 3]) <= SAME_POINT).all(axis=1)
        return cubics[np.repeat(~paper, counts)], np.r_[0, np.cumsum(counts[~paper])], kinds[~paper]
