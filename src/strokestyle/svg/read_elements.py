"""Collect the strokes of a document, with all that its elements say of their look and place."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..geometry.affine import IDENTITY, Affine, compose, is_flat
from .format import FORMAT, LIMITS, PAPER_ID, RDF_NAMESPACES, STROKE_CLASS, TONE_CLASS, Data
from .path_data import own_transform, page_length, parse_numbers, parse_share
from .read_texture import Shape, rgba
from .style_sheet import Declared, ruled_style, styles_of
from .xml import SVG_NAMESPACE, SaxReader, css_property

MAX_STROKES = LIMITS["strokes"].value
MAX_WORDS = 10_000  # characters of a title, or of another of the document's texts
REFERENCES = ("fill", "clip-path", "mask", "filter")
_REFERENCE = re.compile(rf"(?:^|;)\s*(?:{'|'.join(REFERENCES)})\s*:\s*url\(")
_NO_WIDTH = re.compile(r"\s*[+-]?0*\.?0*\s*[a-z%]*\s*", re.IGNORECASE)
GROUPS = ("g", "a", "switch")  # what is in any other element is not drawn, or is no stroke
HREFS = {"href", "http://www.w3.org/1999/xlink}href"}  # a `use` without is a clone written out
SHAPES = (
    "path", "line", "polyline", "polygon", "rect", "circle", "ellipse", "image", "text", "use",
    "svg",
)  # fmt: skip
RDF, DC = RDF_NAMESPACES["xmlns:rdf"], RDF_NAMESPACES["xmlns:dc"]
CC = (RDF_NAMESPACES["xmlns:cc"], "http://web.resource.org/cc/")
TEXTS = {  # by the elements that they stand in
    ((SVG_NAMESPACE, "svg"), (SVG_NAMESPACE, "title")): "title",
    ((SVG_NAMESPACE, "svg"), (SVG_NAMESPACE, "desc")): "description",
}
AGENTS = {"creator": "author", "rights": "license"}  # by the element that a cc:Agent is in


@dataclass
class State:
    """What an element hands on to those inside it.

    Parameters
    ----------
    matrix : from its coordinates to the root's, without the root's viewBox; inside a stroke, to
        the stroke's
    fill, fill_opacity, opacity : CSS colour, and shares in [0, 1]; opacity is the product of all
    outline, outline_width : as `stroke` and `stroke-width` say
    visible : as `visibility` says, which an element inside may take back
    rendered : no `display: none`, and not pressed flat, which nothing inside can take back
    view : (width, height) that percentages refer to
    skipped : nothing inside is looked at
    stroke : the stroke that it is in
    group : of a stroke's own group, whose first shape has the data
    shapes_of : the stroke to whose look further shapes at this place belong
    """

    matrix: Affine = IDENTITY
    fill: str = "#000000"
    fill_opacity: float = 1.0
    opacity: float = 1.0
    outline: str = "none"
    outline_width: str = "1"
    visible: bool = True
    rendered: bool = True
    view: tuple[float, float] = (0.0, 0.0)
    skipped: bool = False
    stroke: StrokeElement | None = None
    group: StrokeGroup | None = None
    shapes_of: StrokeElement | None = None

    @property
    def shown(self) -> bool:
        return self.visible and self.rendered


@dataclass
class StrokeGroup:
    """The group that a textured stroke was written as, before a shape with its data is met in it.

    Parameters
    ----------
    id, line, begin : as of StrokeElement
    stroke : once it is met
    """

    id: str
    line: int
    begin: int
    stroke: StrokeElement | None = None


@dataclass
class StrokeElement:
    """A stroke as it stands in the file.

    Parameters
    ----------
    id : "" where it has none
    attributes : of the element that has its data: itself, or the first of its shapes
    state : of that element, its own attributes included; of a shape, that of what it is in
    line : of the file, where it begins
    begin, end : its bytes in the file; `end` is behind an empty element, else its end tag's begin
    of_shapes : its data stand on the first of its shapes
    loose : besides, these are in no group of their own, so that only they tell its ink
    shapes : what is drawn in it, or the element itself, from the lowest to the uppermost
    outlined : one of them has an outline besides, which no stroke of ours has
    """

    id: str
    attributes: dict[str, str]
    state: State
    line: int
    begin: int
    of_shapes: bool = False
    loose: bool = False
    shapes: list[Shape] = field(default_factory=list)
    outlined: bool = False
    end: int = 0


class Metadata:
    """Collects the words about a document: title, description, author and license."""

    def __init__(self) -> None:
        self.words: dict[str, str] = {}
        self._open: list[tuple[str, str]] = []  # (namespace, tag) of the elements around

    def start(self, namespace: str, tag: str, attributes: Mapping[str, str]) -> None:
        if self._open and tag == "license" and namespace in CC:
            self.words.setdefault("license", attributes.get(RDF + "}resource", ""))
        self._open.append((namespace, tag))

    def end(self) -> None:
        self._open.pop()

    def text(self, text: str) -> None:
        name = self._name()
        if name is not None and len(self.words.get(name, "")) < MAX_WORDS:
            self.words[name] = self.words.get(name, "") + text

    def _name(self) -> str | None:
        """Which words a text in the open elements is."""
        match self._open:
            case [root, element]:
                return TEXTS.get((root, element))
            case [*_, (_, above), (_, "Agent"), (namespace, "title")] if namespace == DC:
                return AGENTS.get(above)
        return None


class ElementReader:
    """Collects the strokes of a document as a SaxReader comes by its elements.


    Attributes
    ----------
    root : attributes of the first element
    strokes : those that are shown, in the order in which the file paints them
    metadata : words about the document
    offset_points : of PowerStrokes, by the ids of their path effects
    hidden : number of strokes that are not shown
    foreign_shapes : number of shapes that are shown and are no strokes of ours
    lost_tones : how many of those are of strokes of ours whose data are not there
    effects : number of gradients, clip paths, masks and filters on strokes
    unread_rules : selectors and other rules of style sheets that are not understood
    """

    def __init__(self) -> None:
        self.root: dict[str, str] = {}
        self.strokes: list[StrokeElement] = []
        self.metadata = Metadata()
        self.offset_points: dict[str, str] = {}
        self.hidden = self.foreign_shapes = self.lost_tones = self.effects = 0
        self._states: list[State] = []  # of the open elements
        self.unread_rules: tuple[str, ...] = ()
        self._rules: Mapping[int, Declared] = {}
        self._xml = SaxReader(self._start, self._end, self.metadata.text)

    def read(self, data: bytes, ruled: bool = False) -> None:
        """Read a document. Raises ValueError where it is damaged, unsafe, too large or too new.

        `ruled` : what its style sheets say is written where it holds, as `write_out_rules` does
        """
        styles = None if ruled else styles_of(data)
        if styles is not None:
            self._rules, self.unread_rules = styles.of, styles.unread
        self._xml.walk(data)
        shown = [stroke for stroke in self.strokes if stroke.shapes or not stroke.of_shapes]
        self.hidden += len(self.strokes) - len(shown)
        self.strokes = shown

    def _start(self, namespace: str, tag: str, attributes: dict[str, str]) -> None:
        self.metadata.start(namespace, tag, attributes)
        rules = self._rules.get(self._xml.elements - 1)
        if rules is not None:
            style = ruled_style(attributes.get("style", ""), rules)
            attributes = attributes | ({"style": style} if style else {})
        if not self._states:
            self.root = attributes
            _check_version(attributes)
            state = _inherit(State(view=_view(attributes)), attributes)
        else:
            if tag == "path-effect" and len(self.offset_points) < MAX_STROKES:
                self.offset_points[attributes.get("id", "")] = attributes.get("offset_points", "")
            state = self._enter(namespace, tag, attributes)
        self._states.append(state)

    def _end(self) -> None:
        self.metadata.end()
        state = self._states.pop()
        stroke = state.group.stroke if state.group is not None else state.stroke
        if stroke is not None and (not self._states or self._states[-1].stroke is None):
            stroke.end = self._xml.place

    def _enter(self, namespace: str, tag: str, attributes: dict[str, str]) -> State:
        """The state of an element inside the root; what it is gets collected."""
        above = self._states[-1]
        if above.skipped or namespace not in ("", SVG_NAMESPACE):
            return State(skipped=True)
        is_stroke = Data.PATH in attributes and tag in (*GROUPS, *SHAPES)
        is_group = tag in GROUPS or (tag == "use" and not HREFS & attributes.keys())
        if is_stroke or above.stroke is not None or is_group:
            self.effects += _count_effects(attributes)
        state = _inherit(above, attributes)
        if above.stroke is not None:  # what it looks like
            state.skipped, state.stroke = tag != "g", above.stroke
            _add_shape(above.stroke, tag, attributes, state)
            return state
        state.rendered &= not is_flat(state.matrix)
        if is_stroke and tag in ("path", "image") and Data.MARGIN in attributes:
            above.shapes_of = self._enter_shapes(tag, attributes, state)
            inside = self._enter_shape(tag, attributes)
            if tag == "image":  # tones behind it are of another
                above.shapes_of = None
            return inside
        if is_stroke and not state.shown:
            self.hidden += 1
            return State(skipped=True)
        if is_stroke:
            return self._enter_stroke(tag, attributes, state)
        if is_group:
            if STROKE_CLASS in attributes.get("class", "").split():
                state.group = StrokeGroup(attributes.get("id", ""), *self._place())
            return state
        if TONE_CLASS in attributes.get("class", "").split() and tag == "path":
            return self._enter_shape(tag, attributes)
        behind = attributes.get("id") == PAPER_ID or Data.HIDDEN in attributes
        self.foreign_shapes += tag in SHAPES and state.shown and not behind
        return State(skipped=True)

    def _place(self) -> tuple[int, int]:
        """Line and byte of what is being read."""
        return self._xml.line, self._xml.place

    def _enter_stroke(self, tag: str, attributes: dict[str, str], state: State) -> State:
        """A stroke whose data stand on its own element, which is its group or its outline."""
        place = self._place()
        stroke = self._add(StrokeElement(attributes.get("id", ""), attributes, state, *place))
        # what is inside is told from it, not from the page
        state = replace(state, matrix=IDENTITY, opacity=1.0, stroke=stroke)
        _add_shape(stroke, tag, attributes, state)
        return state

    def _enter_shapes(self, tag: str, attributes: dict[str, str], own: State) -> StrokeElement:
        """A stroke whose data stand on the first of its shapes, which is being read.

        Its own group may be gone: Inkscape's Ungroup leaves the shapes, with what they have; svgo
        gives what the group had to an image.
        """
        above = self._states[-1]
        group, name = above.group, attributes.get("id", "")
        if tag == "image":
            above = replace(above, fill=own.fill, fill_opacity=own.fill_opacity, group=None)
        if group is None or group.stroke is not None:
            place = self._place()
            return self._add(
                StrokeElement(name, attributes, above, *place, of_shapes=True, loose=tag != "image")
            )
        group.stroke = StrokeElement(
            group.id,
            attributes,
            above,
            group.line,
            group.begin,
            of_shapes=True,
        )
        return self._add(group.stroke)

    def _enter_shape(self, tag: str, attributes: dict[str, str]) -> State:
        """A shape of the stroke whose data stood on it, or on the last such shape beside it."""
        above = self._states[-1]
        stroke = above.shapes_of
        state = _inherit(replace(above, matrix=IDENTITY, opacity=1.0), attributes)
        if stroke is not None:
            _add_shape(stroke, tag, attributes, state)
        elif state.shown:
            self.lose_tones(1)
        return State(skipped=True)

    def lose_tones(self, number: int) -> None:
        """Count tones of ours whose stroke's data are not there."""
        self.foreign_shapes += number
        self.lost_tones += number

    def _add(self, stroke: StrokeElement) -> StrokeElement:
        if len(self.strokes) >= MAX_STROKES:
            raise ValueError(f"more than {MAX_STROKES} strokes: simplify the drawing first")
        self.strokes.append(stroke)
        return stroke


def _check_version(attributes: Mapping[str, str]) -> None:
    version = attributes.get(Data.FORMAT, "")
    if version.isdigit() and len(version) < 9 and int(version) > FORMAT:
        raise ValueError(
            f"written by a newer strokestyle (format {version}, this reads {FORMAT}): "
            "update strokestyle"
        )


def _inherit(above: State, attributes: dict[str, str]) -> State:
    """The state of an element inside another, of which no stroke is known yet."""
    style = attributes.get("style", "")

    def given(name: str, attributes: Mapping[str, str] = attributes) -> str:
        return css_property(name, style, attributes)

    matrix = above.matrix
    if "transform" in attributes or "transform" in style:
        css = {name: given(name, {}) for name in ("transform", "transform-origin")}
        css = {name: value for name, value in css.items() if value}
        matrix = compose(matrix, own_transform(css, attributes, above.view))
    visibility, fill = given("visibility"), given("fill")
    outline, width = given("stroke"), given("stroke-width")
    return State(
        matrix=matrix,
        fill=above.fill if fill in ("", "inherit") else fill,
        fill_opacity=parse_share(given("fill-opacity"), above.fill_opacity),
        opacity=above.opacity * parse_share(given("opacity"), 1.0),
        outline=above.outline if outline in ("", "inherit") else outline,
        outline_width=above.outline_width if width in ("", "inherit") else width,
        visible=above.visible if visibility in ("", "inherit") else visibility == "visible",
        rendered=above.rendered and given("display") != "none",
        view=above.view,
    )


def _view(root: Mapping[str, str]) -> tuple[float, float]:
    """Width and height of the page in user units."""
    box = parse_numbers(root.get("viewBox", ""), "viewBox")
    if len(box) == 4:
        return box[2], box[3]
    return page_length(root, "width") or 0.0, page_length(root, "height") or 0.0


def _count_effects(attributes: Mapping[str, str]) -> int:
    """How many properties of an element are defined elsewhere in its file.

    Those are gradients, clip paths, masks and filters.
    """
    return sum(
        len(_REFERENCE.findall(value)) if name == "style" else "url(" in value
        for name, value in attributes.items()
        if "url(" in value and name in ("style", *REFERENCES)
    )


def _add_shape(stroke: StrokeElement, tag: str, attributes: dict[str, str], state: State) -> None:
    """Add an element to the shapes of its stroke, if it is one that is shown."""
    if tag not in ("path", "image") or not state.shown:
        return
    share = state.fill_opacity * float(rgba(state.fill)[3])
    stroke.shapes.append(Shape(tag, attributes, state.matrix, state.fill, state.opacity, share))
    if tag == "path" and state.outline != "none" and not _NO_WIDTH.fullmatch(state.outline_width):
        stroke.outlined |= bool(rgba(state.outline)[3] > 0.0)
