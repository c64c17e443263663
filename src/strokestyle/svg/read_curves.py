"""Read the curves of any SVG file.

Files come from anywhere, so nothing in them is followed or expanded: no entity, no reference, no
style sheet; what is too large, too deep or of too many points is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .. import files as limits
from ..geometry.affine import IDENTITY, MAX_NUMBER, Affine, Box, compose, fit_box, transformed
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

BORDER = 0.5  # px; a frame this near the page's edge is the background, not a line
LABEL = INKSCAPE_NAMESPACE + "}label"
SHAPES = ("path", "line", "polyline", "polygon", "rect", "circle", "ellipse")
GROUPS = ("svg", "g", "a", "switch")  # what is in any other element is not drawn, or is no line


def read_curves_svg(data: bytes, size: tuple[int, int], tolerance: float) -> Curves:
    """Read the visible lines and outlines of an SVG document as curves in pixels of a canvas.

    Parameters
    ----------
    data : the document
    size : (width, height) of the canvas in px, into which the document's page is fitted
    tolerance : px between a curve and its chords

    Raises
    ------
    ValueError
        where it is no SVG, shows no curve, or is damaged, unsafe or too large.
    """
    reader = _ShapeReader(size)
    SaxReader(reader.start, reader.end).walk(data)
    if not reader.kinds:
        raise ValueError(
            f"no usable curve in it: no visible {', '.join(SHAPES[:-1])} or {SHAPES[-1]}"
        )
    cubics, offsets, kinds = reader.cubics()
    xy, offsets = flatten(cubics, offsets, tolerance)
    return clean_curves(xy, offsets, kinds)


@dataclass(frozen=True)
class _State:
    """What an element hands on to those inside it.

    `matrix` : to the canvas
    `kind` : index into KINDS
    `view` : (width, height) that percentages refer to
    """

    matrix: Affine = IDENTITY
    kind: int = KINDS.index("other")
    visible: bool = True
    view: tuple[float, float] = (0.0, 0.0)


class _ShapeReader:
    """Collects the shapes of a document as a SaxReader comes by them.

    `segments` are those of all subpaths, as `parse_path` gives them; `counts`, `matrices` and
    `kinds` have one entry a subpath.
    """

    def __init__(self, size: tuple[int, int]):
        self.canvas: Box = (0.0, 0.0, float(size[0]), float(size[1]))
        self.page = self.canvas  # where the document's page lies on it
        self.segments: list[Segment] = []
        self.counts: list[int] = []
        self.matrices: list[Affine] = []
        self.kinds: list[int] = []
        self.states: list[_State | None] = []  # of the open elements; None: nothing inside is drawn

    def end(self) -> None:
        self.states.pop()

    def start(self, namespace: str, tag: str, attributes: dict[str, str]) -> None:
        above = self.states[-1] if self.states else _State()
        drawn = namespace in ("", SVG_NAMESPACE) and above is not None
        self.states.append(self.enter(above, tag, attributes) if drawn and above else None)

    def enter(self, above: _State, tag: str, attributes: dict[str, str]) -> _State | None:
        """Give the state of an element; add the curves of a shape."""
        shape = tag in SHAPES or Data.PATH in attributes
        style = attributes.get("style", "")
        if css_property("display", style, attributes) == "none" or not (shape or tag in GROUPS):
            return None
        if Data.HIDDEN in attributes:  # a layer of ours, of what is behind the shape
            return None
        visibility = css_property("visibility", style, attributes)
        visible = above.visible if visibility in ("", "inherit") else visibility == "visible"
        matrix, view = above.matrix, above.view
        if "transform" in attributes:
            matrix = compose(matrix, parse_transform(attributes["transform"]))
        state = _State(matrix, _kind(attributes, above.kind), visible, view)
        if shape:
            if visible:
                self.add(tag, attributes, state)
            return None
        if tag != "svg":
            return state
        matrix, view = self.viewport(attributes, state)
        return _State(matrix, state.kind, visible, view)

    def viewport(
        self, attributes: Mapping[str, str], state: _State
    ) -> tuple[Affine, tuple[float, float]]:
        """Find the matrix of what is inside an svg element, and the (width, height) of its view.

        Percentages are of the view.
        """
        root = not self.states
        view_box = _view_box(attributes)
        into = self.root_box(attributes) if root else _nested_box(attributes, state.view)
        matrix = state.matrix
        if root:  # the page on the canvas
            matrix = compose(fit_box(into, self.canvas), matrix)
        if view_box is None:
            inner = (1.0, 0.0, 0.0, 1.0, into[0], into[1])
        else:
            inner = fit_box(view_box, into, attributes.get("preserveAspectRatio", ""))
        matrix = compose(matrix, inner)
        if root:
            self.page = _transformed_box(matrix, view_box or into)
        return matrix, (view_box or into)[2:]

    def root_box(self, attributes: Mapping[str, str]) -> Box:
        """The document's page in CSS pixels; of no size, the canvas, as the 100% of browsers."""
        width, height = page_length(attributes, "width"), page_length(attributes, "height")
        if width is None or height is None:
            width, height = self.canvas[2:]
        return 0.0, 0.0, width, height

    def add(self, tag: str, attributes: Mapping[str, str], state: _State) -> None:
        """Add a shape's subpaths. Raises ValueError where there are too many, or on a bad one."""
        for segments in _subpaths(tag, attributes, state.view):
            self.segments += segments
            self.counts.append(len(segments))
            self.matrices.append(state.matrix)
            self.kinds.append(state.kind)
        if len(self.segments) > limits.MAX_POINTS or len(self.kinds) > limits.MAX_CURVES:
            raise ValueError(
                f"more than {limits.MAX_POINTS} points or {limits.MAX_CURVES} curves: "
                "simplify the drawing first"
            )

    def cubics(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cubics (S, 4, 2) in px of the canvas, their chains' offsets (C+1,) and kinds (C,).

        The background is left out: a closed shape none of whose segments comes inside the page, or
        the bounding box that some programs export.
        """
        counts, kinds = np.array(self.counts), np.array(self.kinds)
        # each segment's matrix, six columns (S, 1) for its four points
        a, b, c, d, e, f = np.repeat(np.array(self.matrices), counts, axis=0).T[:, :, None]
        points = np.array(self.segments).reshape(-1, 4, 2)
        x, y = points[..., 0], points[..., 1]
        cubics = np.stack([a * x + c * y + e, b * x + d * y + f], axis=-1)
        shown = ~self.background(cubics, counts)
        return cubics[np.repeat(shown, counts)], np.r_[0, np.cumsum(counts[shown])], kinds[shown]

    def background(self, cubics: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Which chains (C,) are closed and run along the page's border or outside it."""
        last = np.cumsum(counts) - 1
        first = last + 1 - counts
        low = np.array(self.page[:2])
        high = low + self.page[2:]
        beyond = (cubics <= low + BORDER).all(axis=1) | (cubics >= high - BORDER).all(axis=1)
        found = np.logical_and.reduceat(beyond.any(axis=1), first)
        return found & (np.abs(cubics[first, 0] - cubics[last, 3]) <= SAME_POINT).all(axis=1)


def _kind(attributes: Mapping[str, str], above: int) -> int:
    """The kind of line that an element's class, label or id names; else that of what it is in."""
    for key in (Data.CLASS, LABEL, "id", "class"):
        if key in attributes:
            kind = kind_named(attributes[key])
            if kind is not None:
                return kind
    return above


def _view_box(attributes: Mapping[str, str]) -> Box | None:
    if "viewBox" not in attributes:
        return None
    numbers = parse_numbers(attributes["viewBox"], "viewBox")
    if len(numbers) != 4 or min(numbers[2:]) < 1 / MAX_NUMBER:
        raise ValueError("viewBox must be four numbers, x y width height, the last two above 0")
    x, y, width, height = numbers
    return x, y, width, height


def _nested_box(attributes: Mapping[str, str], view: tuple[float, float]) -> Box:
    """Where an svg element lies in the one around it, of whose `view` percentages are."""
    x, y, width, height = (
        length(attributes.get(key, default), key, whole)
        for key, default, whole in zip(
            ("x", "y", "width", "height"), "0 0 100% 100%".split(), view * 2, strict=True
        )
    )
    if min(width, height) < 1 / MAX_NUMBER:
        raise ValueError("the width and height of an svg element must be above 0")
    return x, y, width, height


def _transformed_box(matrix: Affine, box: Box) -> Box:
    """The box around what a matrix makes of a box's corners, upper left and lower right."""
    left, top, width, height = box
    corners = transformed(matrix, np.array([[left, top], [left + width, top + height]]))
    (x0, y0), (x1, y1) = corners.tolist()
    return min(x0, x1), min(y0, y1), abs(x1 - x0), abs(y1 - y0)


def _subpaths(
    tag: str, attributes: Mapping[str, str], view: tuple[float, float]
) -> list[list[Segment]]:
    """The subpaths of a shape, in its own coordinates."""
    if Data.PATH in attributes:  # a stroke that we wrote: its outline is not its line
        return parse_path(attributes[Data.PATH], name=Data.PATH)
    if tag == "path":
        return parse_path(attributes.get("d", ""))
    if tag in ("polyline", "polygon"):
        points = attributes.get("points", "")
        close = "Z" if tag == "polygon" and points.strip(SPACE) else ""
        return parse_path(points + close, command="M", name="points")
    return parse_path(shape_path(tag, attributes, view))
