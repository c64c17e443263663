"""Read the curves of any SVG file.

Files come from anywhere: of what they refer to, only what `use` draws of the same document is
followed, in bounds; there are no entities, and what is too large, too deep or of too many points is
refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .. import files as limits
from ..files import quoted
from ..geometry.affine import (
    IDENTITY,
    Affine,
    Box,
    compose,
    fit_box,
    inverse,
    is_flat,
    transformed,
)
from ..geometry.bezier import Segment, flatten
from ..geometry.curves import KINDS, SAME_POINT, Curves, clean_curves, kind_named
from .clip import ClipShape, Region, cut_lines
from .clip_paths import CLIP, RULE, ClipPaths, box_of
from .format import INKSCAPE_NAMESPACE, TONE_CLASS, Data
from .nodes import SHAPES, Node, TreeReader, subpaths
from .path_data import length, own_transform, page_length, parse_path, parse_share
from .style_sheet import NOTHING, declarations, styles_of
from .viewport import inner_matrix, nested_box, view_box
from .xml import placed

BORDER = 0.5  # px; a frame this near the page's edge is the background, not a line
LABEL = INKSCAPE_NAMESPACE + "}label"
GROUPS = ("svg", "g", "a", "switch", "use")  # what any other element has is not drawn, or no line
OF_STROKES = ("path", "image")  # what textured strokes of ours are drawn with
LOOKS = (  # CSS properties that are attributes
    "display", "visibility", "opacity", "fill", "fill-opacity",
    "stroke", "stroke-opacity", "stroke-width", "overflow", RULE,
)  # fmt: skip
_NOTHING = re.compile("(?:0+[.]?0*|[.]0+)(?![0-9.])")  # a width of no line
_CLEAR = re.compile(  # a colour of no opacity
    "none|transparent|#(?:...0|.{6}00)"
    r"|(?:rgb|hsl)a?\((?:[^,]*,[^,]*,[^,]*,|[^/]*/)\s*[0.]+%?\s*\)"
)


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
    reader = _ShapeReader(size, tolerance)
    reader.read(data)
    if not reader.kinds:
        raise ValueError(
            f"no usable curve in it: no visible {', '.join(SHAPES[:-1])} or {SHAPES[-1]}"
        )
    xy, offsets, kinds = reader.lines()
    if not len(kinds):
        raise ValueError("no usable curve in it: its clip paths leave none")
    return clean_curves(xy, offsets, kinds)


@dataclass(frozen=True)
class _State:
    """What an element hands on to those inside it.

    `matrix` : to the canvas
    `kind` : index into KINDS
    `view` : (width, height) that percentages refer to
    `fill`, `stroke` : colours, "none" where that is what they are
    `fill_opacity`, `stroke_opacity` : shares in [0, 1]
    `stroke_width` : as written
    `depth` : how many elements are around
    `used` : ids of what `use` elements around it draw
    `clips` : numbers of the clip paths around
    """

    matrix: Affine = IDENTITY
    kind: int = KINDS.index("other")
    visible: bool = True
    view: tuple[float, float] = (0.0, 0.0)
    fill: str = "black"
    stroke: str = "none"
    fill_opacity: float = 1.0
    stroke_opacity: float = 1.0
    stroke_width: str = "1"
    depth: int = 0
    used: tuple[str, ...] = ()
    clips: tuple[int, ...] = ()

    @property
    def filled(self) -> bool:
        return self.fill_opacity > 0 and not _CLEAR.fullmatch(self.fill)

    @property
    def stroked(self) -> bool:
        return (
            self.stroke_opacity > 0
            and not _NOTHING.match(self.stroke_width)
            and not _CLEAR.fullmatch(self.stroke)
        )


class _Boxed(NamedTuple):
    """A clip path whose numbers are shares of the box of what it clips.

    `number` : of its region
    `first` : the first subpath that it clips
    `matrix` : from the coordinates of what it clips to the canvas
    """

    number: int
    first: int
    clip: Node
    matrix: Affine
    view: tuple[float, float]


class _ShapeReader:
    """Collects the shapes of a document.

    `segments` are those of all subpaths, as `parse_path` gives them; `counts`, `matrices`, `kinds`
    and `clips`, numbers of `regions`, have one entry a subpath.
    """

    def __init__(self, size: tuple[int, int], tolerance: float):
        self.tolerance = tolerance
        self.canvas: Box = (0.0, 0.0, float(size[0]), float(size[1]))
        self.page = self.canvas  # where the document's page lies on it
        self.segments: list[Segment] = []
        self.counts: list[int] = []
        self.matrices: list[Affine] = []
        self.kinds: list[int] = []
        self.clips: list[tuple[int, ...]] = []
        self.regions: list[Region | None] = []  # of clip paths; None: all
        self.boxed: list[_Boxed] = []
        self.boxed_segments = 0  # whose box was found, those in groups in groups each time
        self.elements = 0  # that were drawn, those too that `use` draws again

    def read(self, data: bytes) -> None:
        """Read a document. Raises ValueError."""
        tree = TreeReader()
        root = tree.read(data)
        self.by_id, styles = tree.by_id, styles_of(data)
        self.rules = styles.of if styles is not None else {}
        self.clip_paths = ClipPaths(tree.by_id, self.given, self.tolerance)
        self.draw(root, _State())

    def draw(self, node: Node, above: _State, size: Mapping[str, str] | None = None) -> None:
        """Add the curves of an element and of what is in it.

        `size` : width and height of the `use` that draws it
        """
        self.elements += 1
        if self.elements > limits.MAX_ELEMENTS or above.depth >= limits.MAX_DEPTH:
            raise ValueError(
                f"more than {limits.MAX_ELEMENTS} elements, or {limits.MAX_DEPTH} inside one "
                "another, with what `use` draws: simplify it first"
            )
        boxed = len(self.boxed)
        try:
            state = self.enter(above, node, size)
        except ValueError as error:
            raise ValueError(f"{placed(node.line, node.tag, node.attributes)}: {error}") from None
        if state is not None:
            self.draw_inside(node, state)
        for each in self.boxed[boxed:]:
            self.settle(each)
        del self.boxed[boxed:]

    def draw_inside(self, node: Node, state: _State) -> None:
        """Add the curves of what is in an element."""
        if node.tag == "use":
            self.draw_used(node, state)
        elif node.tag == "switch":
            for child in [child for child in node.children if _is_chosen(child)][:1]:
                self.draw(child, state)
        else:
            for child in node.children:
                self.draw(child, state)

    def draw_used(self, node: Node, state: _State) -> None:
        """Draw what a `use` refers to in its own document. Raises ValueError on a cycle."""
        href = node.href
        target = self.by_id.get(href[1:]) if href[:1] == "#" else None
        if target is None or not href[1:]:
            return
        if href in state.used:
            raise ValueError(f'line {node.line}, <use>: "{quoted(href)}" draws itself')
        x, y = (
            length(node.attributes.get(name, "0"), name, whole)
            for name, whole in zip("xy", state.view, strict=True)
        )
        matrix = compose(state.matrix, (1.0, 0.0, 0.0, 1.0, x, y))
        size = {k: v for k, v in node.attributes.items() if k in ("width", "height")}
        self.draw(target, replace(state, matrix=matrix, used=(*state.used, href)), size)

    def enter(self, above: _State, node: Node, size: Mapping[str, str] | None) -> _State | None:
        """Give the state of an element; add the curves of a shape. None: nothing in it is drawn."""
        tag, attributes = node.name, node.attributes
        shape = tag in SHAPES or (Data.PATH in attributes and tag)
        if not (shape or tag in GROUPS or (tag == "symbol" and size is not None)):
            return None
        if Data.HIDDEN in attributes:  # a layer of ours, of what is behind the shape
            return None
        given = self.given(node)
        if given.get("display") == "none" or parse_share(given.get("opacity", ""), 1.0) == 0.0:
            return None
        if (
            tag == "path" and TONE_CLASS in attributes.get("class", "").split()
        ):  # of a stroke of ours
            return None
        state = _State(
            _own_matrix(above, node, given),
            _kind(attributes, above.kind),
            _visible(given.get("visibility", ""), above.visible),
            above.view,
            _paint(given.get("fill", ""), above.fill),
            _paint(given.get("stroke", ""), above.stroke),
            parse_share(given.get("fill-opacity", ""), above.fill_opacity),
            parse_share(given.get("stroke-opacity", ""), above.stroke_opacity),
            _paint(given.get("stroke-width", ""), above.stroke_width),
            above.depth + 1,
            above.used,
            above.clips,
        )
        state = self.clipped(state, node, given)
        if shape:
            # a line has no inside; one without a stroke was meant to be seen
            inked = state.stroke == "none" if tag == "line" else state.filled
            if state.visible and (inked or state.stroked):
                self.add(tag, attributes, state)
            return None
        if tag not in ("svg", "symbol"):
            return state
        sides = {**attributes, **(size or {})}
        found = self.viewport(sides, state, not above.depth)
        if found is None:
            return None
        if above.depth and given.get("overflow", "hidden") not in ("visible", "auto"):
            state = self.windowed(state, sides)
        return replace(state, matrix=found[0], view=found[1])

    def given(self, node: Node) -> dict[str, str]:
        """Give the CSS properties of an element."""
        attributes = node.attributes
        given = {name: attributes[name].strip().lower() for name in LOOKS if name in attributes}
        if CLIP in attributes:  # names keep their letters
            given[CLIP] = attributes[CLIP].strip()
        if "style" in attributes or node.number in self.rules:
            own = declarations(attributes.get("style", ""))
            given |= own.over(self.rules.get(node.number, NOTHING))
        return given

    def clipped(self, state: _State, node: Node, given: Mapping[str, str]) -> _State:
        """The state within an element's clip path, if it has one."""
        clip = self.clip_paths.named(given.get(CLIP, ""))
        if clip is None or is_flat(state.matrix):
            return state
        if self.clip_paths.needs_box(clip):  # of what is drawn in it: that is known once it is
            number, first = len(self.regions), len(self.kinds)
            self.boxed.append(_Boxed(number, first, clip, state.matrix, state.view))
            self.regions.append(None)
        else:
            self.regions.append(self.clip_paths.region(clip, state.matrix, state.view))
        return replace(state, clips=(*state.clips, len(self.regions) - 1))

    def windowed(self, state: _State, attributes: Mapping[str, str]) -> _State:
        """The state within the box of an svg or symbol element, beyond which nothing is seen."""
        box = nested_box(attributes, state.view)
        if box is None or is_flat(state.matrix):
            return state
        x, y, width, height = box
        corners = np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])
        shape = ClipShape(transformed(state.matrix, corners), np.array([0, 4]))
        self.regions.append(Region((shape,)))
        return replace(state, clips=(*state.clips, len(self.regions) - 1))

    def settle(self, boxed: _Boxed) -> None:
        """Lay a clip path on the box of what was drawn since it was met."""
        counts = np.array(self.counts[boxed.first :], np.int64)
        if not len(counts):
            return
        self.boxed_segments += int(counts.sum())
        if self.boxed_segments > 4 * limits.MAX_POINTS:
            raise ValueError("too many clip paths of the boxes of groups in groups: simplify it")
        into = inverse(boxed.matrix)
        matrices = [compose(into, matrix) for matrix in self.matrices[boxed.first :]]
        cubics = np.array(self.segments[-counts.sum() :]).reshape(-1, 4, 2)
        box = box_of(_moved(cubics, matrices, counts))
        self.regions[boxed.number] = self.clip_paths.region(
            boxed.clip, boxed.matrix, boxed.view, box
        )

    def viewport(
        self, attributes: Mapping[str, str], state: _State, root: bool
    ) -> tuple[Affine, tuple[float, float]] | None:
        """Find the matrix of what is inside an svg or symbol, and the (width, height) of its view.

        Percentages are of the view. None where it has no size, and is not drawn.
        """
        into = self.root_box(attributes) if root else nested_box(attributes, state.view)
        if into is None:
            return None
        inner, view = inner_matrix(attributes, into)
        outer = compose(fit_box(into, self.canvas), state.matrix) if root else state.matrix
        matrix = compose(outer, inner)
        if root:
            self.page = _transformed_box(matrix, view_box(attributes) or into)
        return matrix, view

    def root_box(self, attributes: Mapping[str, str]) -> Box:
        """The document's page in CSS pixels; of no size, the canvas, as the 100% of browsers."""
        width, height = page_length(attributes, "width"), page_length(attributes, "height")
        if width is None or height is None:
            width, height = self.canvas[2:]
        return 0.0, 0.0, width, height

    def add(self, tag: str, attributes: Mapping[str, str], state: _State) -> None:
        """Add a shape's subpaths. Raises ValueError where there are too many, or on a bad one."""
        if Data.PATH in attributes:  # a stroke that we wrote: its outline is not its line
            drawn = parse_path(attributes[Data.PATH], name=Data.PATH)
        else:
            drawn = subpaths(tag, attributes, state.view)
        for segments in drawn:
            self.segments += segments
            self.counts.append(len(segments))
            self.matrices.append(state.matrix)
            self.kinds.append(state.kind)
            self.clips.append(state.clips)
        if len(self.segments) > limits.MAX_POINTS or len(self.kinds) > limits.MAX_CURVES:
            raise ValueError(
                f"more than {limits.MAX_POINTS} points or {limits.MAX_CURVES} curves: "
                "simplify the drawing first"
            )

    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Polylines (n, 2) in px of the canvas, their offsets (C+1,) and kinds (C,).

        The background is left out: a closed shape none of whose segments comes inside the page, or
        the bounding box that some programs export. Lines are cut at clip paths.
        """
        counts = np.array(self.counts)
        cubics = _moved(np.array(self.segments).reshape(-1, 4, 2), self.matrices, counts)
        shown = ~self.background(cubics, counts)
        offsets = np.r_[0, np.cumsum(counts[shown])]
        xy, offsets = flatten(cubics[np.repeat(shown, counts)], offsets, self.tolerance)
        kinds, which = np.array(self.kinds)[shown], np.flatnonzero(shown)
        regions = [[self.regions[k] for k in self.clips[i]] for i in which]
        within = [tuple(region for region in each if region is not None) for each in regions]
        if not any(within):
            return xy, offsets, kinds
        xy, offsets, whose = cut_lines(xy, offsets, within)
        return xy, offsets, kinds[whose]

    def background(self, cubics: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Which chains (C,) are closed and run along the page's border or outside it."""
        last = np.cumsum(counts) - 1
        first = last + 1 - counts
        low = np.array(self.page[:2])
        high = low + self.page[2:]
        beyond = (cubics <= low + BORDER).all(axis=1) | (cubics >= high - BORDER).all(axis=1)
        found = np.logical_and.reduceat(beyond.any(axis=1), first)
        return found & (np.abs(cubics[first, 0] - cubics[last, 3]) <= SAME_POINT).all(axis=1)


def _moved(points: np.ndarray, matrices: Sequence[Affine], counts: np.ndarray) -> np.ndarray:
    """Chains of cubics (S, 4, 2), the i-th of counts[i], each moved by its matrix."""
    # each segment's matrix, six columns (S, 1) for its four points
    a, b, c, d, e, f = np.repeat(np.array(matrices), counts, axis=0).T[:, :, None]
    x, y = points[..., 0], points[..., 1]
    return np.stack([a * x + c * y + e, b * x + d * y + f], axis=-1)


def _is_chosen(node: Node) -> bool:
    """Whether a switch may draw an element: the first such is drawn."""
    language = node.attributes.get("systemLanguage", "en")
    wanted = any(name.strip().lower().split("-")[0] == "en" for name in language.split(","))
    return bool(node.name) and wanted and not node.attributes.get("requiredExtensions")


def _own_matrix(above: _State, node: Node, given: Mapping[str, str]) -> Affine:
    """From the coordinates of an element to the canvas; `given` are its CSS properties.

    The data of a textured stroke of ours are told in those of the group around its shape.
    """
    if Data.PATH in node.attributes and Data.MARGIN in node.attributes and node.tag in OF_STROKES:
        return above.matrix
    return compose(above.matrix, own_transform(given, node.attributes, above.view))


def _visible(given: str, above: bool) -> bool:
    return above if given in ("", "inherit") else given == "visible"


def _paint(given: str, above: str) -> str:
    return above if given in ("", "inherit") else given


def _kind(attributes: Mapping[str, str], above: int) -> int:
    """The kind of line that an element's class, label or id names; else that of what it is in."""
    for key in (Data.CLASS, LABEL, "id", "class"):
        if key in attributes:
            kind = kind_named(attributes[key])
            if kind is not None:
                return kind
    return above


def _transformed_box(matrix: Affine, box: Box) -> Box:
    """The box around what a matrix makes of a box's corners, upper left and lower right."""
    left, top, width, height = box
    corners = transformed(matrix, np.array([[left, top], [left + width, top + height]]))
    (x0, y0), (x1, y1) = corners.tolist()
    return min(x0, x1), min(y0, y1), abs(x1 - x0), abs(y1 - y0)
