"""Read a stroke of ours: its centre line, widths, ink and texture, and where others moved it to."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .. import files as limits
from ..drawing.ribbon import ribbon
from ..drawing.strokes import MAX_MARGIN, Strokes, signed_distance
from ..files import quoted
from ..geometry.affine import (
    IDENTITY,
    MAX_NUMBER,
    Affine,
    compose,
    determinant,
    inverse,
    transformed,
)
from ..geometry.bezier import flatten
from ..geometry.curves import KINDS, arc, arc_length, kind_named
from ..geometry.parts import part_name
from .format import (
    INKSCAPE_NAMESPACE,
    LIMITS,
    TONE_LOOK,
    TONE_UNIT,
    TRACK_NAME,
    Data,
    usual_rings,
)
from .kept import DrawnStroke
from .landmarks import ROUNDING, enclosed, fine_line, first_line, landmarks, recover_transform
from .markup import Element, hex_color, number
from .path_data import parse_numbers, parse_path, parse_share
from .power_stroke import EFFECT, read_power_stroke, swell
from .read_elements import StrokeElement
from .read_texture import (
    CHORD,
    Budget,
    Shape,
    decoded,
    drawn_strip,
    from_base64,
    has_external_image,
    image_box,
    image_link,
    rgb,
    rgba,
)
from .strip_image import read_strip
from .stroke_data import edge_at
from .tone_path import moved_tone, tone_path

MAX_PATH = LIMITS["path_characters"].value
MAX_PLACE = LIMITS["place"].value
MOVED_SIZES = (0.6, 1.7)  # by which tones may be scaled that are not drawn anew
SWELL_SLACK = 1e-5  # of the sum of widths, that is another program's rounding
MAX_COPIES = 100  # of a stroke that are merged with it
PROBES = 100  # places on a tone's edge
STRAY = 1.0  # px beyond a stroke's texture, where the edges of tones are of another
TONE_SCALE: Affine = (TONE_UNIT, 0.0, 0.0, TONE_UNIT, 0.0, 0.0)
PATH_EFFECT = INKSCAPE_NAMESPACE + "}path-effect"
ORIGINAL_PATH = INKSCAPE_NAMESPACE + "}original-d"

# what a stroke's element may hold besides the look that is read: data, as they stand in the file
_KEPT_NAMES = (
    Data.CLASS, Data.PATH, Data.WIDTH, Data.CLOSED, Data.TEXTURE, Data.MARGIN,
    Data.AT, Data.RINGS, Data.SPINE, Data.SWELL, Data.OPACITY,
)  # fmt: skip
_PATH_LETTERS = re.compile(r"[\sMmLlHhVvCcSsQqTtAaZz0-9eE+.,-]*")
_IMAGE = re.compile(r"data:image/png;base64,[\w+/=]*")
_BOX = re.compile(r"[0-9eE+.-]{1,30}")

# a centre line as we write it
_NUMBERS = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_POLYLINE = re.compile(r"\s*M([^A-Za-z]*)l([^A-Za-z]*)")


@dataclass
class ReadStroke:
    """A stroke as read: all that Drawing wants of it.

    Parameters
    ----------
    xy : (n, 2) px, n >= 2
    width : (n,) px
    closed : its last point is its first
    kind : index into KINDS
    color : (4,) straight RGBA in [0, 1]
    strip : (m, A, 4) uint8, texels as `Texture` has them; None for flat ink
    margin : px that the strip reaches beyond half the width
    part, track : "" for none
    drawn : how it was drawn; without data where it was moved since
    """

    xy: np.ndarray
    width: np.ndarray
    closed: bool
    kind: int
    color: np.ndarray
    strip: np.ndarray | None
    margin: float
    part: str
    track: str
    drawn: DrawnStroke | None


def read_strokes(
    element: StrokeElement,
    origin: tuple[float, float],
    budget: Budget,
    offset_points: Mapping[str, str],
) -> list[ReadStroke]:
    """Read an element as a stroke, and copies of it that are merged with it.

    Tones that merely come behind it in the file are taken from the element's shapes.

    Parameters
    ----------
    origin : of the canvas, in the file's user units
    budget : what is left for textures
    offset_points : of the file's PowerStrokes, by the ids of their path effects

    Raises
    ------
    ValueError
        on an attribute that cannot be read, and on what is too large or too far away.
    """
    attributes, state = element.attributes, element.state
    closed = attributes.get(Data.CLOSED, "") == "1"
    xy, width = read_widths(
        read_centre_line(attributes[Data.PATH], closed), attributes.get(Data.WIDTH, "1")
    )
    baked = baked_transforms(element, closed)
    edited = _edited_power_stroke(element, offset_points)
    if edited is not None:
        (xy, width), baked = edited, [IDENTITY]
        closed = closed and bool(np.hypot(*(xy[0] - xy[-1])) < CHORD)
        xy[-1] = xy[0] if closed else xy[-1]
    margin = _margin(attributes[Data.MARGIN]) if Data.MARGIN in attributes else 0.0
    kind = kind_named(attributes.get(Data.CLASS, ""))
    stroke = ReadStroke(
        xy, width, closed,
        kind=KINDS.index("other") if kind is None else kind,
        color=_color(element),
        strip=None,
        margin=margin,
        part=part_name(attributes.get(Data.PART, "")),
        track=_track(attributes.get(Data.TRACK, "")),
        drawn=None,
    )  # fmt: skip
    if element.loose:
        element.shapes = _own_shapes(element.shapes, stroke, baked[0])
    stroke.strip = _strip(element, stroke, baked[0], budget)
    if element.loose and stroke.strip is not None:
        stroke.color[:3] = _mean_ink(stroke.strip)
    home = compose((1.0, 0.0, 0.0, 1.0, -origin[0], -origin[1]), state.matrix)
    if edited is None and state.opacity == 1.0:
        stands = home == IDENTITY and baked == [IDENTITY]
        stroke.drawn = (
            drawn_stroke(element, stroke.color, offset_points)
            if stands
            else moved_stroke(element, stroke.color, home, baked[0])
        )
    return [_transformed_stroke(stroke, compose(home, transform)) for transform in baked]


def _track(text: str) -> str:
    """What a stroke's track is called; "" where that is no name."""
    return text if TRACK_NAME.fullmatch(text) else ""


def _color(element: StrokeElement) -> np.ndarray:
    """The flat ink of a stroke, (4,) RGBA."""
    state = element.state
    color = rgba(state.fill)
    color[3] *= state.fill_opacity * state.opacity * _fade(element)
    color[3] *= parse_share(element.attributes.get(Data.OPACITY, ""), 1.0)
    return color


def _mean_ink(strip: np.ndarray) -> np.ndarray:
    """The colour (3,) in [0, 1] of what a strip (n, A, 4) shows, on the whole; black of nothing."""
    opacity = strip[..., 3:] / 255.0
    shown = (strip[..., :3] * opacity).sum(axis=(0, 1)) / max(255.0 * opacity.sum(), 1e-9)
    return np.minimum(shown, 1.0)  # rounding may lead beyond


def _fade(element: StrokeElement) -> float:
    """The `opacity` that a hand gave the shapes of a stroke rather than the stroke."""
    return element.shapes[0].opacity if element.of_shapes and element.shapes else 1.0


def _told_ink(element: StrokeElement, color: np.ndarray, budget: Budget) -> np.ndarray:
    """The ink (3,) of a strip that is told: that of what is drawn, which a hand may recolour.

    `color` (4,) of the stroke, where nothing is drawn.
    """
    if not element.shapes or has_external_image(element.shapes[:1]):
        return color[:3]
    first = element.shapes[0]
    if first.tag == "path":
        return rgb(first.fill)
    return _mean_ink(np.asarray(decoded(first.attributes, budget).convert("RGBA")))


def _own_shapes(shapes: list[Shape], stroke: ReadStroke, baked: Affine) -> list[Shape]:
    """The shapes that lie on a stroke, its first and most of the others' edges each.

    In no group of their own, a stroke's tones stand behind its first shape as those of another do
    whose own first shape was deleted, or that were put elsewhere. `stroke` and `baked` are as in
    `_strip`.
    """
    half = 0.5 * stroke.width + stroke.margin

    def is_near(shape: Shape) -> bool:
        try:
            edge = first_line(shape.attributes.get("d", ""))
        except ValueError:  # it draws nothing, or what is wrong is said where it is drawn
            return True
        few = edge[:: 1 + len(edge) // PROBES]
        at = transformed(compose(inverse(baked), shape.matrix), few)
        return bool(np.median(signed_distance(stroke.xy, half, at)) <= STRAY)

    return shapes[:1] + [shape for shape in shapes[1:] if is_near(shape)]


def _margin(text: str) -> float:
    values = parse_numbers(text, Data.MARGIN)
    if len(values) != 1 or not 0 <= values[0] <= MAX_MARGIN:
        raise ValueError(
            f'bad {Data.MARGIN} "{quoted(text)}": expected a number between 0 and {MAX_MARGIN:g}'
        )
    return values[0]


def _strip(
    element: StrokeElement, stroke: ReadStroke, baked: Affine, budget: Budget
) -> np.ndarray | None:
    """The strip (n, A, 4) of a stroke, told or read off what is drawn; None for flat ink.

    `stroke` : what is known of it, before it is moved
    `baked` : from there to where it is drawn
    """
    attributes, opacity = element.attributes, element.state.opacity
    if Data.TEXTURE in attributes:
        opacity *= _fade(element)
        strip = read_strip(
            from_base64(attributes[Data.TEXTURE].split(",", 1)[-1], "texture"),
            _told_ink(element, stroke.color, budget),
            min(budget.texels, LIMITS["strip_texels"].value),
        )
        budget.spend("texels", strip[..., 0].size)
    elif Data.MARGIN in attributes and not has_external_image(element.shapes):
        one = Strokes(
            stroke.xy,
            stroke.width,
            np.array([0, len(stroke.xy)]),
            np.array([0]),
            np.array([stroke.closed]),
        )
        strip = drawn_strip(element.shapes, ribbon(one, 0, stroke.margin), baked, budget)
    else:
        return None
    if opacity < 1:
        alpha = np.rint(strip[..., 3:] * opacity).astype(np.uint8)
        strip = np.concatenate([strip[..., :3], alpha], axis=2)
    return strip


def _transformed_stroke(stroke: ReadStroke, matrix: Affine) -> ReadStroke:
    """The stroke where a transform takes it. Raises ValueError where that is no place for one."""
    xy = stroke.xy if matrix == IDENTITY else transformed(matrix, stroke.xy)
    det = determinant(matrix)
    scale = 1.0 if abs(abs(det) - 1.0) < 1e-12 else math.sqrt(abs(det))
    width, margin = stroke.width * scale, min(stroke.margin * scale, MAX_MARGIN)
    if not np.abs(xy).max() <= MAX_PLACE:
        raise ValueError(
            f"a point {np.abs(xy).max():.3g} px away is too far to be a place in a drawing"
        )
    if not width.max() <= MAX_PLACE:
        raise ValueError(f"a width of {width.max():.3g} px is too large")
    strip = stroke.strip
    if strip is not None and det < 0:
        strip = strip[:, ::-1]
    return replace(stroke, xy=xy, width=width, margin=margin, strip=strip)


# ------------------------------------------------------------------------- the line and its widths


def read_centre_line(path: str, closed: bool) -> np.ndarray:
    """Read the points (n, 2) of a centre line, n >= 2; a closed one ends where it begins.

    Raises ValueError on bad path data, and where they are not one line in a drawing.
    """
    if len(path) > MAX_PATH:
        raise ValueError(f"{Data.PATH} has more than {MAX_PATH} characters")
    match = _POLYLINE.fullmatch(path)
    if match and not re.sub(r"[\s,]+", "", _NUMBERS.sub("", match[1] + " " + match[2])):
        xy = _polyline_points(match[1], match[2])
    else:
        xy = _path_points(path)
    if len(xy) > limits.MAX_POINTS or not (np.abs(xy) <= MAX_NUMBER).all():
        raise ValueError(f"{Data.PATH} leads too far to be a line in a drawing")
    if closed and len(xy) > 1 and (xy[0] != xy[-1]).any():
        near = np.abs(xy[0] - xy[-1]).max() < 1e-6
        xy = np.concatenate([xy[:-1] if near else xy, xy[:1]])
    return np.concatenate([xy, xy]) if len(xy) == 1 else xy


def _polyline_points(begin: str, steps: str) -> np.ndarray:
    """The points of a line as we write it, a place and steps from there: much the faster way."""
    first, rest = (np.array(_NUMBERS.findall(part), np.float64) for part in (begin, steps))
    if len(first) != 2 or len(rest) % 2:
        raise ValueError(f"{Data.PATH} has half a point")
    return np.cumsum(np.concatenate([first[None], rest.reshape(-1, 2)]), axis=0).round(9)


def _path_points(path: str) -> np.ndarray:
    """The points of a line of any path data; curves are flattened."""
    subpaths = parse_path(path, name=Data.PATH)
    if len(subpaths) > 1:
        raise ValueError(f"{Data.PATH} has {len(subpaths)} pieces; a stroke has one")
    if not subpaths:
        raise ValueError(f"{Data.PATH} draws nothing")
    cubics = np.array(subpaths[0]).reshape(-1, 4, 2)
    third = (cubics[:, 3] - cubics[:, 0]) / 3
    leaves, arrives = cubics[:, 1] - cubics[:, 0] - third, cubics[:, 3] - cubics[:, 2] - third
    if np.abs(leaves).max() + np.abs(arrives).max() < 1e-6:  # straight pieces
        return np.concatenate([cubics[:1, 0], cubics[:, 3]])
    return flatten(cubics, np.array([0, len(cubics)]), CHORD)[0]


def read_widths(xy: np.ndarray, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Read the width at each point of a line (n, 2): the points, and (n,) widths.

    Where widths are told by arc length, points are added that hold them. Raises ValueError.
    """
    if len(text) > MAX_PATH:
        raise ValueError(f"{Data.WIDTH} has more than {MAX_PATH} characters")
    pairs = "," in text
    rows = [row.split(",") for row in text.split()] if pairs else text.split()
    try:
        numbers = np.array(rows, np.float64)
    except ValueError:
        numbers = np.zeros((0, 0))
    if numbers.shape[1:] != ((2,) if pairs else ()):
        raise ValueError(f'bad {Data.WIDTH} "{quoted(text)}": expected numbers, or pairs t,w')
    if pairs:
        xy, width = _widths_by_length(xy, numbers[:, 0], numbers[:, 1])
    else:
        width = _widths_by_point(xy, numbers)
    if not (np.isfinite(width).all() and width.min() >= 0):
        raise ValueError(f"{Data.WIDTH} holds a width that is none")
    return xy, width


def _widths_by_point(xy: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """One width for all points, or one for each; a ring's may leave out the point it repeats."""
    if len(widths) == 1:
        return np.repeat(widths, len(xy))
    if len(widths) == len(xy) - 1 and (xy[0] == xy[-1]).all():
        return np.r_[widths, widths[:1]]
    if len(widths) != len(xy):
        raise ValueError(f"{Data.WIDTH} has {len(widths)} widths for {len(xy)} points")
    return widths


def _widths_by_length(
    xy: np.ndarray, t: np.ndarray, widths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points and the width at each, from widths at shares `t` of a line's length."""
    if not ((np.diff(t) >= 0).all() and t[0] >= 0 and t[-1] <= 1):
        raise ValueError(f"{Data.WIDTH}: places must rise from 0 to 1")
    along = arc_length(xy, np.array([0, len(xy)]))
    if along[-1] <= 0:
        return xy, np.full(len(xy), widths.max())
    along = along / along[-1]
    new = t[:0]  # where a point is wanted and none is near, as long as that can be looked up
    if len(t) * len(along) < 4e6:
        new = t[np.abs(t[:, None] - along[None]).min(axis=1) > 1e-4]
    place = np.sort(np.r_[along, new], kind="stable")
    xy = np.stack([np.interp(place, along, column) for column in xy.T], axis=1)
    return xy, np.interp(place, t, widths)


# ------------------------------------------------------- transforms baked into the coordinates


def baked_transforms(element: StrokeElement, closed: bool) -> list[Affine]:
    """Find the transforms that other programs baked into the coordinates of a stroke's first shape.

    One; more where svgo merged a stroke of flat ink with its moved copies, whose attributes are the
    same.
    """
    if Data.AT not in element.attributes or not element.shapes:
        return [IDENTITY]
    first = element.shapes[0]
    try:
        if first.attributes.get(ORIGINAL_PATH) and Data.SPINE in first.attributes:
            return [_baked_into_spine(first)]
        *places, area = element.attributes[Data.AT].split()
        if "," in area:  # of an image, or written before an area was
            places, area = [*places, area], "nan"
        then = _landmarks(places)
        if first.tag == "image":
            return [_baked_into_image(first, then)]
        merged = first.attributes is element.attributes and not element.of_shapes
        rings = _rings(element.attributes.get(Data.RINGS, ""), closed)
        return _baked_into_path(first, then, float(area), rings if merged else 0)
    except ValueError:
        return [IDENTITY]


def _edited_power_stroke(
    element: StrokeElement, offset_points: Mapping[str, str]
) -> tuple[np.ndarray, np.ndarray] | None:
    """The centre line and widths of a PowerStroke whose skeleton or widths Inkscape edited.

    None of any other, and of one that was but moved.
    """
    attributes = element.attributes
    name = attributes.get(PATH_EFFECT, "").split(";")[0].removeprefix("#")
    original, points = attributes.get(ORIGINAL_PATH, ""), offset_points.get(name, "")
    if not (original and points and {Data.SPINE, Data.SWELL} <= attributes.keys()):
        return None
    try:
        line = first_line(original)
        then = _landmarks(attributes[Data.SPINE].split())
        moved = recover_transform(then, landmarks(line), line)
        if moved is not None:
            was = float(attributes[Data.SWELL]) * math.sqrt(abs(determinant(moved)))
            if abs(swell(points) - was) <= SWELL_SLACK * was + ROUNDING:
                return None
        return read_power_stroke(original, points)
    except ValueError:
        return None


def _rings(text: str, closed: bool) -> int:
    """How many rings an outline has, as told or as is usual."""
    return int(text) if re.fullmatch("[1-9][0-9]{0,3}", text) else usual_rings(closed)


def _baked_into_spine(shape: Shape) -> Affine:
    """The transform of a PowerStroke's line, whose outline Inkscape draws anew."""
    line = transformed(shape.matrix, first_line(shape.attributes[ORIGINAL_PATH]))
    then = _landmarks(shape.attributes[Data.SPINE].split())
    return recover_transform(then, landmarks(line), line) or IDENTITY


def _baked_into_image(shape: Shape, then: np.ndarray) -> Affine:
    """The transform of an image, by its corners."""
    x, y, w, h = image_box(shape.attributes)
    now = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    return recover_transform(then, transformed(shape.matrix, now)) or IDENTITY


def _baked_into_path(shape: Shape, then: np.ndarray, area: float, rings: int) -> list[Affine]:
    """The transforms of a path, and of its copies that are merged into it.

    `then`, `area` : the landmarks of its first subpath, and what that enclosed; NaN: not told
    `rings` : subpaths of each copy; 0 where there can be none
    """
    d = shape.attributes.get("d", "")
    if rings and rings < len(re.findall("[Mm]", d)) <= MAX_COPIES * rings:
        lines = [fine_line(subpath) for subpath in parse_path(d)[::rings]]
    else:
        lines = [first_line(d)]
    lines = [transformed(shape.matrix, line) for line in lines]
    found = [
        _unless_edited(recover_transform(then, landmarks(line), line), area, line) for line in lines
    ]
    if None in found:  # what is merged with it is no copy of it
        found = found[:1]
    return [transform or IDENTITY for transform in found]


def _landmarks(pairs: list[str]) -> np.ndarray:
    """Read landmarks (4, 2) of "x,y" texts. Raises ValueError."""
    at = np.array([pair.split(",") for pair in pairs], np.float64)
    if at.shape != (4, 2) or not (np.abs(at) <= MAX_PLACE).all():
        raise ValueError("bad landmarks")
    return at


def _unless_edited(transform: Affine | None, area: float, line: np.ndarray) -> Affine | None:
    """A shape's transform, if it takes its area to that within a line: few landmarks fit many.

    Rounding may move an edge by ROUNDING px, or its area by a thousandth.
    """
    if transform is None or transform == IDENTITY or np.isnan(area):
        return transform
    area *= abs(determinant(transform))
    slack = ROUNDING * arc(line)[-1] + 1e-3 * area
    return transform if abs(enclosed(line) - area) <= slack else None


# ----------------------------------------------------------------------------- as it was written


def drawn_stroke(
    element: StrokeElement, color: np.ndarray, offset_points: Mapping[str, str]
) -> DrawnStroke | None:
    """Give a stroke as it is drawn, in our words, if all of its look can be said in them.

    Other programs say it in others: svgo and scour give a fill to the layer that all of its strokes
    have, drop what is so anyway and spell path data anew. Nothing of an element that is not looked
    at is passed on. It is without id, class, part, track and path effect.

    Parameters
    ----------
    color : (4,) RGBA in [0, 1], the stroke's flat ink
    offset_points : of the file's PowerStrokes, by the ids of their path effects
    """
    attributes = element.attributes
    given = {name: attributes[name] for name in _KEPT_NAMES if name in attributes}
    given["fill"] = hex_color(color[:3])
    if Data.MARGIN in attributes:
        if color[3] < 0.9995:
            given[Data.OPACITY] = number(color[3], 3)
        children = [_own_child(shape, given["fill"]) for shape in element.shapes]
        drawn = tuple(child for child in children if child is not None)
        return DrawnStroke(Element("g", given, drawn)) if len(drawn) == len(children) else None
    if not _is_outline(element):
        return None
    if color[3] < 0.9995:
        given["fill-opacity"] = number(color[3], 3)
    rule = attributes.get("fill-rule", "")
    given |= {"fill-rule": "evenodd" if rule == "evenodd" else "nonzero", "d": attributes["d"]}
    points = ""
    if ORIGINAL_PATH in attributes:
        points = offset_points.get(EFFECT + element.id, "")
        ours = attributes.get(PATH_EFFECT) == f"#{EFFECT}{element.id}"
        # those of an older version have no swell: Inkscape may fail to draw them
        if not (ours and Data.SWELL in attributes and re.fullmatch("[0-9., |-]+", points)):
            return None
        given["inkscape:original-d"] = attributes[ORIGINAL_PATH]
    return DrawnStroke(Element("path", given), points)


def moved_stroke(
    element: StrokeElement, color: np.ndarray, home: Affine, baked: Affine
) -> DrawnStroke | None:
    """Give a stroke in tones as it is drawn where a hand moved it, in our words, without data.

    None of any other, and where it was made much larger or smaller, or is told by a strip and was
    turned over.

    Parameters
    ----------
    color : (4,) RGBA in [0, 1], the stroke's flat ink
    home, baked : from its coordinates in the file to the drawing's, and from its data to those
    """
    matrix = compose(home, baked)
    sizes = np.linalg.svd(np.reshape(matrix[:4], (2, 2)), compute_uv=False)
    told = element.attributes.get(Data.TEXTURE)
    if not element.shapes or not MOVED_SIZES[0] < sizes[1] <= sizes[0] < MOVED_SIZES[1]:
        return None
    if told is not None and determinant(matrix) < 0:
        return None
    given = {"fill": hex_color(color[:3])} | ({} if told is None else {Data.TEXTURE: told})
    children: list[Element] = []
    for shape in element.shapes:
        whole = compose(home, shape.matrix)
        tone = moved_tone(shape.attributes.get("d", ""), whole) if shape.tag == "path" else None
        child = _own_child(replace(shape, matrix=TONE_SCALE), given["fill"])
        if tone is None or child is None:
            return None
        if not children:
            given[Data.AT] = edge_at(tone.edge)
        children.append(replace(child, attributes=child.attributes | {"d": tone.d}))
    return DrawnStroke(Element("g", given, tuple(children)))


def _is_outline(element: StrokeElement) -> bool:
    """Whether a stroke is one path, whose data are its own."""
    attributes = element.attributes
    return (
        len(element.shapes) == 1
        and element.shapes[0].attributes is attributes
        and element.shapes[0].tag == "path"
        and all(_PATH_LETTERS.fullmatch(attributes.get(name, "")) for name in ("d", ORIGINAL_PATH))
        and "d" in attributes
    )


def _own_child(shape: Shape, ink: str) -> Element | None:
    """A path or an image of a stroke in our words; None where it is none of ours.

    `ink` is the fill of the stroke.
    """
    attributes = shape.attributes
    if shape.tag == "path":
        d = attributes.get("d", "")
        if shape.matrix != TONE_SCALE or shape.opacity < 1.0 or not _PATH_LETTERS.fullmatch(d):
            return None
        fill = hex_color(rgb(shape.fill))
        look = {} if fill == ink else {"fill": fill}
        look["fill-opacity"] = number(shape.fill_opacity, 3)
        return Element("path", look | TONE_LOOK | {"d": tone_path(d) or d})
    href = re.sub(r"\s+", "", image_link(attributes))
    box = {name: attributes.get(name, "0") for name in ("x", "y", "width", "height")}
    if shape.matrix != IDENTITY or shape.opacity < 1.0 or not _IMAGE.fullmatch(href):
        return None
    if not all(map(_BOX.fullmatch, box.values())):
        return None
    return Element("image", box | {"preserveAspectRatio": "none", "xlink:href": href})
