"""SVG -> Drawing: our own files read back, whatever other programs and hands did to them. See docs/svg-format.md."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from .. import files as limits
from ..drawing.ribbon import ribbon, strip_points
from ..drawing.strip import wider
from ..drawing.strokes import MAX_MARGIN, Drawing, Strokes, Texture, signed_distance
from ..files import limited, quoted
from ..geometry.affine import IDENTITY, MAX_NUMBER, Affine, compose, transformed
from ..geometry.bezier import flatten
from ..geometry.curves import KINDS, arc, arc_length, kind_named
from ..geometry.parts import Parts, part_name
from .centre_lines import EFFECT
from .format import FORMAT, LICENSES, LIMITS, STROKE_CLASS, Data, SvgOptions
from .kept import DrawnStroke, Kept, keep_strokes
from .landmarks import ROUNDING, enclosed, fine_line, first_line, landmarks, recover_transform
from .markup import Element
from .path_data import page_length, parse_numbers, parse_path, parse_transform
from .read_texture import (
    CHORD,
    Budget,
    Shape,
    drawn_strip,
    from_base64,
    has_external_image,
    image_box,
    rgb,
)
from .strip_image import read_strip
from .xml import INKSCAPE_NAMESPACE, SVG_NAMESPACE, SaxReader, css_property

MAX_STROKES = LIMITS["strokes"].value
MAX_TEXELS = LIMITS["texels"].value
MAX_PATH = LIMITS["path_characters"].value
MAX_PARTS = LIMITS["parts_characters"].value
MAX_PLACE = LIMITS["place"].value
REFERENCES = ("fill", "clip-path", "mask", "filter")
_REFERENCE = re.compile(rf"(?:^|;)\s*(?:{'|'.join(REFERENCES)})\s*:\s*url\(")
GROUPS = ("g", "a", "switch")  # what is in any other element is not drawn, or is no stroke
SHAPES = (
    "path",
    "line",
    "polyline",
    "polygon",
    "rect",
    "circle",
    "ellipse",
    "image",
    "text",
    "use",
    "svg",
)
RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
DC = "http://purl.org/dc/elements/1.1/"
PATH_EFFECT = INKSCAPE_NAMESPACE + "}path-effect"
CC = ("http://creativecommons.org/ns#", "http://web.resource.org/cc/")

# A stroke exactly as we write it: whatever is in it, it is markup that cannot run or load anything.
_VALUE = r'="[^"<&]*"'
_PAIR = re.compile(r" ([a-z:-]+)=\"([^\"<&]*)\"", re.IGNORECASE)
_CHILD = (
    rf"<(path)((?: (?:d|fill|fill-opacity|transform){_VALUE})+) ?/>"
    rf"|<(image)((?: (?:x|y|width|height|preserveAspectRatio|xlink:href){_VALUE})+) ?/>"
)
_CHILDREN = re.compile(_CHILD)
_STROKE = re.compile(
    rf'<(path|g)((?: {Data.PART}="[^"<]*"| [a-z:-]+{_VALUE})*)'
    rf"(?: ?/>|>((?:\s*(?:{_CHILD}))*)\s*</\1>)"
)
_IMAGE = re.compile(r"data:image/png;base64,[\w+/=]*")
_KEPT_NAMES = {
    Data.CLASS, Data.PATH, Data.WIDTH, Data.CLOSED, Data.TEXTURE, Data.MARGIN,
    Data.AT, Data.SPINE, Data.OPACITY, "fill", "fill-opacity", "fill-rule", "d",
    "inkscape:original-d",
}  # fmt: skip


@dataclass(frozen=True)
class SvgFile:
    """What a file of ours says.

    Parameters
    ----------
    drawing : Drawing, its strokes in the order in which the file paints them
    ids : (C,) the strokes' ids, "" where one has none; they may repeat
    options : how it was written
    kept : its strokes as they were drawn in it: with them `write_svg` writes what was not changed as it was
    hidden : number of strokes that are hidden in the file, and are not in the drawing
    others : number of visible shapes in the file that are no strokes of ours
    effects : number of gradients, clip paths, masks and filters on strokes, which a Drawing does not have
    """

    drawing: Drawing
    ids: tuple[str, ...]
    options: SvgOptions
    kept: Kept = field(default_factory=dict, repr=False, compare=False)
    hidden: int = 0
    others: int = 0
    effects: int = 0


def read_svg(source: str | bytes | Path) -> Drawing:
    """The drawing in an SVG file that this program wrote and others may have changed.

    Parameters
    ----------
    source : the name of an .svg or .svgz file, or the file's content, as text or bytes

    Raises
    ------
    ValueError
        on what is no SVG file, has no strokes of ours in it, or is damaged, unsafe or too large.
    OSError
        where the file cannot be read.
    """
    return read_svg_file(source).drawing


def read_svg_file(source: str | bytes | Path) -> SvgFile:
    """As `read_svg`, with what is not of the drawing: ids, and how the file was written."""
    if isinstance(source, bytes) or (
        isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<")
    ):
        return _read(source.encode("utf-8", "surrogatepass") if isinstance(source, str) else source)
    with open(source, "rb") as file:
        data = file.read(limits.MAX_BYTES + 1)
    try:
        return _read(data)
    except ValueError as error:
        raise ValueError(f"{source}: {error}") from None


def _read(data: bytes) -> SvgFile:
    data = limited(data)
    reader = _Reader(data)
    walker = SaxReader(reader.start, reader.end, reader.text)
    reader.parser = walker.parser
    walker.walk(data)
    return reader.file()


# ------------------------------------------------------------------------------------------------------ the document


@dataclass
class _State:
    """What an element hands on to those inside it. `drawn` False: nothing inside is drawn."""

    matrix: Affine = IDENTITY
    fill: str = "#000000"
    fill_opacity: float = 1.0
    opacity: float = 1.0
    visible: bool = True
    gone: bool = False  # by display: none, which nothing inside can take back
    drawn: bool = True
    stroke: _Found | None = None


@dataclass
class _Found:
    """A stroke's element: its attributes and where it stands; `shapes` are it or what is drawn in it, first to last."""

    name: str
    attributes: dict[str, str]
    state: _State
    line: int
    begin: int
    alone: bool
    shapes: list[Shape] = field(default_factory=list)
    end: int = 0


@dataclass
class _Line:
    """A stroke as read: all that Drawing wants of it, and how it was drawn where every letter of that is ours."""

    xy: np.ndarray
    width: np.ndarray
    closed: bool
    kind: int
    color: np.ndarray
    strip: np.ndarray | None
    margin: float
    part: str
    drawn: DrawnStroke | None


class _Reader:
    def __init__(self, data: bytes):
        self.data = data
        self.root: dict[str, str] = {}
        self.stack: list[_State] = []
        self.tags: list[tuple[str, str]] = []
        self.strokes: list[_Found] = []
        self.words: dict[str, str] = {}
        self.power_strokes: dict[str, str] = {}  # their offset points, by id
        self.hidden = self.others = self.effects = 0
        self.parser = None

    def start(self, namespace: str, tag: str, attributes: dict[str, str]):
        self.tags.append((namespace, tag))
        if not self.stack:
            self.root = attributes
            self._check_version(attributes)
            self.stack.append(self._inner(_State(), attributes))
            return
        above = self.stack[-1]
        if tag == "path-effect" and len(self.power_strokes) < MAX_STROKES:
            self.power_strokes[attributes.get("id", "")] = attributes.get("offset_points", "")
        if (namespace, tag) == (CC[0], "license") or (namespace, tag) == (CC[1], "license"):
            self.words.setdefault("license", attributes.get(RDF + "}resource", ""))
        drawn = above.drawn and namespace in ("", SVG_NAMESPACE)
        if not drawn:
            self.stack.append(_State(drawn=False))
            return
        ours = Data.PATH in attributes and tag in (*GROUPS, *SHAPES)
        if ours or above.stroke is not None or tag in GROUPS:
            self.effects += _effects(attributes)
        if above.stroke is not None:  # inside a stroke: what it looks like
            state = self._inner(above, attributes)
            state.drawn, state.stroke = tag == "g", above.stroke
            _add_shape(tag, attributes, state)
            self.stack.append(state)
            return
        state = self._inner(above, attributes)
        a, b, c, d = state.matrix[:4]
        state.gone |= abs(a * d - b * c) < 1e-12  # pressed flat: nothing of it is drawn
        if ours and state.visible and not state.gone:
            if len(self.strokes) >= MAX_STROKES:
                raise ValueError(f"more than {MAX_STROKES} strokes: simplify the drawing first")
            alone = above.matrix == IDENTITY and above.opacity == above.fill_opacity == 1.0
            found = _Found(
                attributes.get("id", ""),
                attributes,
                state,
                self.parser.CurrentLineNumber,
                self.parser.CurrentByteIndex,
                alone,
            )
            self.strokes.append(found)
            # what is inside is told from it, not from the page
            state = replace(state, matrix=IDENTITY, opacity=1.0, stroke=found)
            _add_shape(tag, attributes, state)
        elif ours:
            self.hidden += 1
            state.drawn = False
        elif tag not in GROUPS:
            paper = attributes.get("id") == "paper" or Data.HIDDEN in attributes
            if tag in SHAPES and state.visible and not (state.gone or paper):
                self.others += 1
            state.drawn = False
        self.stack.append(state)

    def end(self):
        state, _ = self.stack.pop(), self.tags.pop()
        if state.stroke is not None and (not self.stack or self.stack[-1].stroke is None):
            state.stroke.end = self.parser.CurrentByteIndex

    def text(self, text: str):
        names = {
            ((SVG_NAMESPACE, "svg"), (SVG_NAMESPACE, "title")): "title",
            ((SVG_NAMESPACE, "svg"), (SVG_NAMESPACE, "desc")): "description",
        }
        key = names.get(tuple(self.tags)) if len(self.tags) == 2 else None
        if (
            key is None
            and self.tags[-2:]
            and self.tags[-1] == (DC, "title")
            and self.tags[-2][1] == "Agent"
        ):
            key = {"creator": "author", "rights": "license"}.get(self.tags[-3][1])
        if key is not None and len(self.words.get(key, "")) < 10_000:
            self.words[key] = self.words.get(key, "") + text

    def _check_version(self, attributes):
        version = attributes.get(Data.FORMAT, "")
        if version.isdigit() and len(version) < 9 and int(version) > FORMAT:
            raise ValueError(
                f"written by a newer strokestyle (format {version}, this reads {FORMAT}): update strokestyle"
            )

    def _inner(self, above: _State, attributes) -> _State:
        style = attributes.get("style", "")

        def given(name):
            return css_property(name, style, attributes)

        matrix = above.matrix
        if "transform" in attributes:
            matrix = compose(matrix, parse_transform(attributes["transform"]))
        visibility = given("visibility")
        fill = given("fill")
        return _State(
            matrix=matrix,
            fill=above.fill if fill in ("", "inherit") else fill,
            fill_opacity=_share(given("fill-opacity"), above.fill_opacity),
            opacity=above.opacity * _share(given("opacity"), 1.0),
            visible=above.visible if visibility in ("", "inherit") else visibility == "visible",
            gone=above.gone or given("display") == "none",
        )

    # ------------------------------------------------------------------------------------------------ the drawing

    def file(self) -> SvgFile:
        if not self.strokes and not (Data.SIZE in self.root or self.hidden):
            raise ValueError(
                "no strokes in it that strokestyle wrote: edit and view take what render writes; "
                "other programs' curves are drawn with --curves"
            )
        size, origin = self._canvas()
        lines, names, budget = [], [], Budget()
        for found in self.strokes:
            try:
                lines += _lines(found, origin, self._drawn(found), budget)
                names += [found.name] * (len(lines) - len(names))
            except ValueError as error:
                which = f' id="{quoted(found.name)}"' if found.name else ""
                raise ValueError(f"line {found.line}, stroke{which}: {error}") from None
        options = self._options(any(line.strip is not None for line in lines))
        drawing = _drawing(lines, size, self._parts(lines))
        kept = keep_strokes(drawing, (line.drawn for line in lines), options)
        return SvgFile(drawing, tuple(names), options, kept, self.hidden, self.others, self.effects)

    def _drawn(self, found: _Found) -> DrawnStroke | None:
        """The stroke as it was drawn, if every letter of its element, and of its path effect, is ours."""
        drawn = _drawn_stroke(self.data, found)
        effect = found.attributes.get(PATH_EFFECT)
        if drawn is None or effect is None:
            return drawn
        points = self.power_strokes.get(EFFECT + found.name, "")
        ours = effect == f"#{EFFECT}{found.name}" and re.fullmatch("[0-9., |-]+", points)
        return replace(drawn, offset_points=points) if ours else None

    def _canvas(self) -> tuple[tuple[int, int], tuple[float, float]]:
        """Size of the canvas and where it begins in user units: as written, or what somebody made of the page since."""
        root = self.root
        size = parse_numbers(root[Data.SIZE], Data.SIZE) if Data.SIZE in root else None
        if size is not None and len(size) != 2:
            raise ValueError(
                f"{Data.SIZE} must be a width and a height, got {quoted(root['{Data.SIZE}'])!r}"
            )
        box = parse_numbers(root["viewBox"], "viewBox") if "viewBox" in root else None
        if box is not None and (len(box) != 4 or min(box[2:]) <= 0):
            raise ValueError("viewBox must be four numbers, x y width height, the last two above 0")
        written = parse_numbers(root[Data.PAGE], Data.PAGE) if Data.PAGE in root else None
        same = box is None or written is None or np.allclose(box, written, atol=1e-3)
        if size is not None and same:
            box = [0.0, 0.0, *size]
        elif box is None:
            box = [0.0, 0.0, *((page_length(root, name) or 100.0) for name in ("width", "height"))]
        if not (max(np.abs(box)) <= MAX_PLACE and min(box[2:]) > 0):
            raise ValueError(f"its canvas of {box[2]:g} x {box[3]:g} px is none to draw on")
        return (math.ceil(box[2] - 1e-6), math.ceil(box[3] - 1e-6)), (box[0], box[1])

    def _parts(self, lines: list[_Line]) -> Parts | None:
        """The parts that strokes name, in the order that the file has for them; those from other files lie on top."""
        order = tuple(
            unquote(name)
            for name in self.root.get(Data.PARTS, "")[:MAX_PARTS].split()[:MAX_STROKES]
        )
        return Parts.of_names([line.part for line in lines], order)

    def _options(self, textured: bool) -> SvgOptions:
        words = {name: text.strip() for name, text in self.words.items() if text.strip()}
        if "license" in words:
            urls = {url: name for name, url in LICENSES.items()}
            words["license"] = urls.get(words["license"], words["license"])
        options = SvgOptions.from_text(self.root.get(Data.OPTIONS, ""), **words)
        if options.texture == "auto" or not textured:
            options = SvgOptions(**{**vars(options), "texture": "image" if textured else "none"})
        return options


# --------------------------------------------------------------------------------------------------------- a stroke


def _lines(
    found: _Found, origin: tuple[float, float], drawn: DrawnStroke | None, budget: Budget
) -> list[_Line]:
    """The stroke, and copies of it that are merged with it."""
    attributes, state = found.attributes, found.state
    closed = attributes.get(Data.CLOSED, "") == "1"
    xy = _centre(attributes[Data.PATH], closed)
    xy, width = _widths(xy, attributes.get(Data.WIDTH, "1"))
    color = np.array([*rgb(state.fill), state.fill_opacity * state.opacity])
    color[3] *= _share(attributes.get(Data.OPACITY, ""), 1.0)
    if state.fill == "none":
        color[3] = 0.0
    kind = kind_named(attributes.get(Data.CLASS, ""))
    moves = _baked(found, closed)
    strip, margin = None, 0.0
    if Data.MARGIN in attributes:
        margin = _margin(attributes[Data.MARGIN])
    if Data.TEXTURE in attributes:
        strip = read_strip(
            from_base64(attributes[Data.TEXTURE].split(",", 1)[-1], "texture"),
            color[:3],
            min(budget.texels, LIMITS["strip_texels"].value),
        )
        budget.spend("texels", strip[..., 0].size)
    elif Data.MARGIN in attributes and not has_external_image(
        found.shapes
    ):  # else flat ink is left
        strip = drawn_strip(
            found.shapes, ribbon(_alone(xy, width, closed), 0, margin), moves[0], budget
        )
    if strip is not None and state.opacity < 1:
        strip = np.concatenate(
            [strip[..., :3], np.rint(strip[..., 3:] * state.opacity).astype(np.uint8)], axis=2
        )
    still = state.matrix == IDENTITY and state.opacity == 1.0 and moves == [IDENTITY]
    if not (found.alone and still):
        drawn = None
    kind, part = (
        KINDS.index("other") if kind is None else kind,
        part_name(attributes.get(Data.PART, "")),
    )
    line = _Line(xy, width, closed, kind, color, strip, margin, part, drawn)
    home = compose((1.0, 0.0, 0.0, 1.0, -origin[0], -origin[1]), state.matrix)
    return [_moved(line, compose(home, move)) for move in moves]


def _alone(xy: np.ndarray, width: np.ndarray, closed: bool) -> Strokes:
    return Strokes(xy, width, [0, len(xy)], [0], [closed])


def _effects(attributes: dict[str, str]) -> int:
    """How many of an element's properties are defined elsewhere in its file: gradients, clip paths, masks, filters."""
    return sum(
        len(_REFERENCE.findall(value)) if name == "style" else "url(" in value
        for name, value in attributes.items()
        if "url(" in value and name in ("style", *REFERENCES)
    )


def _add_shape(tag: str, attributes: dict[str, str], state: _State) -> None:
    if tag in ("path", "image") and state.visible and not state.gone:
        opacity = state.opacity * (
            state.fill_opacity if tag == "path" and state.fill != "none" else tag == "image"
        )
        state.stroke.shapes.append(Shape(tag, attributes, state.matrix, state.fill, opacity))


def _moved(line: _Line, matrix: Affine) -> _Line:
    """The stroke where a transform takes it. Raises ValueError where that is no place in a drawing."""
    xy = line.xy if matrix == IDENTITY else transformed(matrix, line.xy)
    det = matrix[0] * matrix[3] - matrix[1] * matrix[2]
    scale = 1.0 if abs(abs(det) - 1.0) < 1e-12 else math.sqrt(abs(det))
    width, margin = line.width * scale, min(line.margin * scale, MAX_MARGIN)
    if not np.abs(xy).max() <= MAX_PLACE:
        raise ValueError(
            f"a point {np.abs(xy).max():.3g} px away is too far to be a place in a drawing"
        )
    if not width.max() <= MAX_PLACE:
        raise ValueError(f"a width of {width.max():.3g} px is too large")
    strip = line.strip if line.strip is None or det >= 0 else line.strip[:, ::-1]
    return replace(line, xy=xy, width=width, margin=margin, strip=strip)


_NUMBERS = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_POLYLINE = re.compile(r"\s*M([^A-Za-z]*)l([^A-Za-z]*)")


def _centre(path: str, closed: bool) -> np.ndarray:
    """The points (n, 2) of a centre line, n >= 2; a closed one ends where it begins."""
    if len(path) > MAX_PATH:
        raise ValueError(f"{Data.PATH} has more than {MAX_PATH} characters")
    match = _POLYLINE.fullmatch(path)
    if match and not re.sub(
        r"[\s,]+", "", _NUMBERS.sub("", match[1] + " " + match[2])
    ):  # as we write it
        head, steps = (np.array(_NUMBERS.findall(part), np.float64) for part in match.groups())
        if len(head) != 2 or len(steps) % 2:
            raise ValueError(f"{Data.PATH} has half a point")
        xy = np.cumsum(np.concatenate([head[None], steps.reshape(-1, 2)]), axis=0).round(9)
    else:
        subpaths = parse_path(path, name=Data.PATH)
        if len(subpaths) > 1:
            raise ValueError(f"{Data.PATH} has {len(subpaths)} pieces; a stroke has one")
        if not subpaths:
            raise ValueError(f"{Data.PATH} draws nothing")
        cubics = np.array(subpaths[0]).reshape(-1, 4, 2)
        third = (cubics[:, 3] - cubics[:, 0]) / 3
        if (
            np.abs(cubics[:, 1] - cubics[:, 0] - third).max()
            + np.abs(cubics[:, 3] - cubics[:, 2] - third).max()
            < 1e-6
        ):
            xy = np.concatenate([cubics[:1, 0], cubics[:, 3]])
        else:
            xy, _ = flatten(cubics, np.array([0, len(cubics)]), CHORD)
    if len(xy) > limits.MAX_POINTS or not (np.abs(xy) <= MAX_NUMBER).all():
        raise ValueError(f"{Data.PATH} leads too far to be a line in a drawing")
    if closed and len(xy) > 1 and (xy[0] != xy[-1]).any():
        near = np.abs(xy[0] - xy[-1]).max() < 1e-6
        xy = np.concatenate([xy[:-1] if near else xy, xy[:1]])
    return np.concatenate([xy, xy]) if len(xy) == 1 else xy


def _widths(xy: np.ndarray, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Points and the width at each; where widths are given by arc length, points are added that hold them."""
    if len(text) > MAX_PATH:
        raise ValueError(f"{Data.WIDTH} has more than {MAX_PATH} characters")
    try:
        if "," not in text:
            width = np.array(text.split(), np.float64)
            if len(width) == 1:
                width = np.repeat(width, len(xy))
            if (
                len(width) == len(xy) - 1 and (xy[0] == xy[-1]).all()
            ):  # of a ring, without the point it repeats
                width = np.r_[width, width[:1]]
            if len(width) != len(xy):
                raise ValueError(f"{Data.WIDTH} has {len(width)} widths for {len(xy)} points")
        else:
            t, knots = np.array([pair.split(",") for pair in text.split()], np.float64).T
            if not ((np.diff(t) >= 0).all() and t[0] >= 0 and t[-1] <= 1):
                raise ValueError(f"{Data.WIDTH}: places must rise from 0 to 1")
            xy, width = _at_knots(xy, t, knots)
    except ValueError as error:
        if Data.WIDTH in str(error):
            raise
        raise ValueError(
            f'bad {Data.WIDTH} "{quoted(text)}": expected numbers, or pairs t,w'
        ) from None
    if not (np.isfinite(width).all() and width.min() >= 0):
        raise ValueError(f"{Data.WIDTH} holds a width that is none")
    return xy, width


def _at_knots(xy, t, knots):
    along = arc_length(xy, np.array([0, len(xy)]))
    if along[-1] <= 0:
        return xy, np.full(len(xy), knots.max())
    along = along / along[-1]
    new = (
        t[np.abs(t[:, None] - along[None]).min(axis=1) > 1e-4]
        if len(t) * len(along) < 4e6
        else t[:0]
    )
    place = np.sort(np.r_[along, new], kind="stable")
    xy = np.stack([np.interp(place, along, column) for column in xy.T], axis=1)
    return xy, np.interp(place, t, knots)


def _baked(found: _Found, closed: bool) -> list[Affine]:
    """The transforms that other programs wrote into the coordinates of a stroke's first shape.

    One; more where svgo merged a stroke of flat ink with its moved copies, whose attributes are the same.
    """
    if Data.AT not in found.attributes or not found.shapes:
        return [IDENTITY]
    first = found.shapes[0]
    attributes = first.attributes
    try:
        spine = attributes.get(INKSCAPE_NAMESPACE + "}original-d", "")
        if spine and Data.SPINE in attributes:  # a PowerStroke, whose outline Inkscape draws anew
            line = transformed(first.matrix, first_line(spine))
            return [
                recover_transform(_landmarks(attributes[Data.SPINE].split()), landmarks(line), line)
                or IDENTITY
            ]
        *places, within = found.attributes[Data.AT].split()
        if "," in within:  # of an image, or written before an area was
            places, within = [*places, within], "nan"
        then = _landmarks(places)
        if first.tag == "image":
            x, y, w, h = image_box(attributes)
            now = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
            return [recover_transform(then, transformed(first.matrix, now)) or IDENTITY]
        d, rings = attributes.get("d", ""), 2 if closed else 1  # in an outline
        if attributes is found.attributes and rings < len(re.findall("[Mm]", d)) <= 100 * rings:
            lines = [fine_line(subpath) for subpath in parse_path(d)[::rings]]
        else:
            lines = [first_line(d)]
        lines = [transformed(first.matrix, line) for line in lines]
        moves = [
            _unless_edited(recover_transform(then, landmarks(line), line), float(within), line)
            for line in lines
        ]
        if len(moves) > 1 and None in moves:
            moves = moves[:1]
        return [move or IDENTITY for move in moves]
    except ValueError:
        return [IDENTITY]


def _landmarks(pairs: list[str]) -> np.ndarray:
    """(4, 2) of "x,y" texts. Raises ValueError."""
    at = np.array([pair.split(",") for pair in pairs], np.float64)
    if at.shape != (4, 2) or not (np.abs(at) <= MAX_PLACE).all():
        raise ValueError("bad landmarks")
    return at


def _unless_edited(move: Affine | None, within: float, line: np.ndarray) -> Affine | None:
    """A transform of a shape, if it takes the area `within` to that within a line; few landmarks fit many a shape.

    Rounding may move an edge by ROUNDING px, or its area by a thousandth.
    """
    if move is None or move == IDENTITY or np.isnan(within):
        return move
    within *= abs(move[0] * move[3] - move[1] * move[2])
    slack = ROUNDING * arc(line)[-1] + 1e-3 * within
    return move if abs(enclosed(line) - within) <= slack else None


def _drawn_stroke(data: bytes, found: _Found) -> DrawnStroke | None:
    """A stroke's element, but for its id, class, part and path effect, if every letter of it is ours."""
    # of an end tag, expat gives where it begins; of an empty element, the place behind it
    empty = data.endswith(b"/>", 0, found.end) and (
        not found.shapes or found.shapes[0].attributes is found.attributes
    )
    end = found.end if empty else data.find(b">", found.end) + 1
    match = _STROKE.fullmatch(data[found.begin : end].decode("ascii", "replace"))
    if match is None:
        return None
    attributes = dict(_PAIR.findall(match[2]))
    ours = attributes.pop("class", "") == STROKE_CLASS
    for name in ("id", Data.PART, "inkscape:path-effect"):
        attributes.pop(name, None)
    if not ours or "fill" not in attributes or not set(attributes) <= _KEPT_NAMES:
        return None
    children = []
    for path, of_path, image, of_image in _CHILDREN.findall(match[3] or ""):
        inside = dict(_PAIR.findall(of_path or of_image))
        if image and not _IMAGE.fullmatch(inside.get("xlink:href", "")):
            return None
        children.append(Element(path or image, inside))
    return DrawnStroke(Element(match[1], attributes, tuple(children)))


def _drawing(lines: list[_Line], size: tuple[int, int], parts: Parts | None) -> Drawing:
    offsets = np.cumsum([0] + [len(line.xy) for line in lines])
    if offsets[-1] > limits.MAX_POINTS:
        raise ValueError(f"more than {limits.MAX_POINTS} points: simplify the drawing first")
    strokes = Strokes(
        np.concatenate([np.zeros((0, 2)), *(line.xy for line in lines)]),
        np.concatenate([np.zeros(0), *(line.width for line in lines)]),
        offsets,
        [line.kind for line in lines],
        [line.closed for line in lines],
    )
    color = np.array([line.color for line in lines]).reshape(-1, 4)
    columns = max((line.strip.shape[1] for line in lines if line.strip is not None), default=0)
    if not columns:
        return Drawing(strokes, size, color, None, parts)
    if (
        sum(len(line.strip) if line.strip is not None else 0 for line in lines) * columns
        > MAX_TEXELS
    ):
        raise ValueError(f"more than {MAX_TEXELS} texels of texture: simplify the drawing first")
    margin = np.array([line.margin if line.strip is not None else 1.0 for line in lines])
    strips = [
        wider(line.strip, columns)
        if line.strip is not None
        else _flat_strip(strokes, i, color[i], columns)
        for i, line in enumerate(lines)
    ]
    texture = Texture(
        np.concatenate(strips), np.cumsum([0] + [len(strip) for strip in strips]), margin
    )
    return Drawing(strokes, size, color, texture, parts)


def _flat_strip(strokes: Strokes, i: int, color: np.ndarray, columns: int) -> np.ndarray:
    """The strip of a stroke of flat ink, in a drawing where others have a texture."""
    band = ribbon(strokes, i, 1.0)
    rows = int(np.clip(np.ceil(2 * band.length), 2, MAX_TEXELS // 100 // columns))
    at = strip_points(band, rows, columns)
    part = slice(strokes.offsets[i], strokes.offsets[i + 1])
    depth = signed_distance(
        strokes.xy[part], 0.5 * strokes.thickness[part], at.reshape(-1, 2)
    ).reshape(rows, columns)
    strip = np.empty((rows, columns, 4))
    strip[...] = color
    strip[..., 3] *= np.clip(0.5 - depth, 0, 1)
    return np.rint(255 * strip).astype(np.uint8)


# ----------------------------------------------------------------------------------------------------------- values


def _share(text: str, default: float) -> float:
    """An opacity, in [0, 1]."""
    match = re.fullmatch(r"([+-]?[0-9]*\.?[0-9]+(?:e[+-]?[0-9]{1,3})?)(%?)", text[:40])
    if not match:
        return default
    return min(max(float(match[1]) / (100.0 if match[2] else 1.0), 0.0), 1.0)


def _margin(text: str) -> float:
    values = parse_numbers(text, Data.MARGIN)
    if len(values) != 1 or not 0 <= values[0] <= MAX_MARGIN:
        raise ValueError(
            f'bad {Data.MARGIN} "{quoted(text)}": expected a number between 0 and {MAX_MARGIN:g}'
        )
    return values[0]
