"""Read a drawing from an SVG file of ours, whatever other programs and hands did to it.

docs/svg-format.md says what a file may hold.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from .. import files as limits
from ..drawing.ribbon import ribbon, strip_points
from ..drawing.strip import wider
from ..drawing.strokes import Drawing, Strokes, Texture, signed_distance
from ..files import limited, quoted
from ..geometry.parts import Parts
from .clones import write_out_clones
from .format import LICENSES, LIMITS, Data, SvgOptions
from .kept import DrawnStroke, Kept, keep_strokes
from .path_data import NUMBER, page_length, parse_numbers
from .read_elements import MAX_STROKES, ElementReader
from .read_stroke import MAX_PLACE, ReadStroke, read_strokes
from .read_texture import Budget
from .stroke_data import Knots, knots_of, stroke_data
from .style_sheet import write_out_rules

MAX_TEXELS = LIMITS["texels"].value
MAX_PARTS = LIMITS["parts_characters"].value


class NoStrokesError(ValueError):
    """A file holds no stroke that this program wrote."""


@dataclass(frozen=True)
class SvgFile:
    """What a file of ours says.

    Parameters
    ----------
    drawing : Drawing, its strokes in the order in which the file paints them
    ids : (C,) the strokes' ids, "" where one has none; they may repeat
    options : how it was written
    kept : its strokes as they were drawn in it: with them `write_svg` writes what was not changed
        as it was
    hidden : number of strokes that are hidden in the file, and are not in the drawing
    foreign_shapes : number of visible shapes in the file that are no strokes of ours
    lost_tones : how many of those are of a stroke's texture whose first shape, which has the
        stroke's data, is not there
    effects : number of gradients, clip paths, masks and filters on strokes, which a Drawing does
        not have
    outlines : number of strokes with an SVG stroke besides, which is not read
    unread_rules : selectors and other rules of its style sheets that are not understood
    """

    drawing: Drawing
    ids: tuple[str, ...]
    options: SvgOptions
    kept: Kept = field(default_factory=dict, repr=False, compare=False)
    hidden: int = 0
    foreign_shapes: int = 0
    lost_tones: int = 0
    effects: int = 0
    outlines: int = 0
    unread_rules: tuple[str, ...] = ()


def read_svg(source: str | bytes | Path) -> Drawing:
    """Read the drawing in an SVG file that this program wrote and others may have changed.

    Parameters
    ----------
    source : the name of an .svg or .svgz file, or the file's content, as text or bytes

    Raises
    ------
    ValueError
        on what is no SVG file, has no strokes of ours in it (NoStrokesError), or is damaged, unsafe
        or too large.
    OSError
        where the file cannot be read.
    """
    return read_svg_file(source).drawing


def read_svg_file(source: str | bytes | Path) -> SvgFile:
    """Read what `read_svg` does, with what is not of the drawing: ids, how the file was written.

    Takes and raises what `read_svg` does.
    """
    if isinstance(source, bytes):
        return _read(source)
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return _read(source.encode("utf-8", "surrogatepass"))
    with open(source, "rb") as file:
        data = file.read(limits.MAX_BYTES + 1)
    try:
        return _read(data)
    except ValueError as error:
        sort = NoStrokesError if isinstance(error, NoStrokesError) else ValueError
        raise sort(f"{source}: {error}") from None


def _read(data: bytes) -> SvgFile:
    data, unread = write_out_rules(limited(data))
    data = write_out_clones(data)
    found = ElementReader()
    found.read(data, ruled=True)
    if not (found.strokes or found.hidden):
        _check_emptiness(found)
    size, origin = _canvas(found.root)
    strokes, ids = _strokes(found, origin)
    options = _options(found, any(stroke.strip is not None for stroke in strokes))
    drawing = _drawing(strokes, size, _parts(found.root, strokes))
    kept = keep_strokes(drawing, _told(drawing, strokes, options.decimals), options)
    return SvgFile(
        drawing, tuple(ids), options, kept,
        found.hidden, found.foreign_shapes, found.lost_tones, found.effects,
        sum(stroke.outlined for stroke in found.strokes), unread,
    )  # fmt: skip


def _told(
    drawing: Drawing, strokes: Sequence[ReadStroke], decimals: int
) -> Iterator[DrawnStroke | None]:
    """The strokes as they are drawn, with data where they stand now."""
    knots: Knots | None = None
    for i, stroke in enumerate(strokes):
        drawn = stroke.drawn
        if drawn is not None and Data.PATH not in drawn.element.attributes:
            knots = knots or knots_of(drawing.strokes)
            data = stroke_data(drawing, i, decimals, knots, True)
            element = replace(drawn.element, attributes=data | drawn.element.attributes)
            drawn = DrawnStroke(element)
        yield drawn


def _check_emptiness(found: ElementReader) -> None:
    """Raise NoStrokesError unless a document without strokes is an empty drawing of ours."""
    ours = Data.SIZE in found.root or Data.FORMAT in found.root or found.lost_tones
    if not ours:
        raise NoStrokesError(
            "no strokes in it that strokestyle wrote; curves of other programs can be rendered, "
            "not edited or viewed"
        )
    if found.foreign_shapes:
        raise NoStrokesError(
            f"no strokes in it: its shapes, {found.foreign_shapes}, lack what strokestyle wrote of "
            f"strokes ({Data.PATH}). Ungroup in Inkscape takes it from textures of version 0.2 and "
            "before, Combine and cleaning programs from any: go back to the file before that; "
            "outlines can be rendered"
        )


def _strokes(
    found: ElementReader, origin: tuple[float, float]
) -> tuple[list[ReadStroke], list[str]]:
    """All strokes of a file, and the id of each. Raises ValueError with the place of a bad one."""
    strokes: list[ReadStroke] = []
    ids: list[str] = []
    budget = Budget()
    for element in found.strokes:
        try:
            shapes = len(element.shapes)
            copies = read_strokes(element, origin, budget, found.offset_points)
            found.lose_tones(shapes - len(element.shapes))
        except ValueError as error:
            which = f' id="{quoted(element.id)}"' if element.id else ""
            raise ValueError(f"line {element.line}, stroke{which}: {error}") from None
        strokes += copies
        ids += [element.id] * len(copies)
    return strokes, ids


def _canvas(root: Mapping[str, str]) -> tuple[tuple[int, int], tuple[float, float]]:
    """Size of the canvas and where it begins in user units.

    They are as written, or what somebody made of the document's page since.
    """
    size = parse_numbers(root[Data.SIZE], Data.SIZE) if Data.SIZE in root else None
    if size is not None and len(size) != 2:
        raise ValueError(f'{Data.SIZE}="{quoted(root[Data.SIZE])}" is no width and height')
    box = parse_numbers(root["viewBox"], "viewBox") if "viewBox" in root else None
    if box is not None and (len(box) != 4 or min(box[2:]) <= 0):
        raise ValueError("viewBox must be four numbers, x y width height, the last two above 0")
    written = parse_numbers(root[Data.PAGE], Data.PAGE) if Data.PAGE in root else None
    same = box is None or written is None or _is_rounded(root["viewBox"], box, written)
    if size is not None and same:
        box = [0.0, 0.0, *size]
    elif box is None:
        box = [0.0, 0.0, *((page_length(root, name) or 100.0) for name in ("width", "height"))]
    if not (max(np.abs(box)) <= MAX_PLACE and min(box[2:]) > 0):
        raise ValueError(f"its canvas of {box[2]:g} x {box[3]:g} px is none to draw on")
    return (math.ceil(box[2] - 1e-6), math.ceil(box[3] - 1e-6)), (box[0], box[1])


def _is_rounded(text: str, box: Sequence[float], written: Sequence[float]) -> bool:
    """Whether the numbers of a `text` are those written, rounded to as many digits as they have.

    scour rounds to five digits, or as many as it is told: those that are 0 at a number's end count
    as such beyond the third.
    """
    digits = (Decimal(number).normalize() for number in re.findall(NUMBER, text))
    last = [min(float(n.as_tuple().exponent), max(n.adjusted() - 2, 0)) for n in digits]
    slack = 0.5 * 10.0 ** np.array(last) + 1e-3
    return len(box) == len(written) and bool((np.abs(np.subtract(box, written)) <= slack).all())


def _parts(root: Mapping[str, str], strokes: Sequence[ReadStroke]) -> Parts | None:
    """The parts that strokes name, in the file's order; those from other files lie on top."""
    names = root.get(Data.PARTS, "")[:MAX_PARTS].split()[:MAX_STROKES]
    return Parts.of_names([stroke.part for stroke in strokes], tuple(map(unquote, names)))


def _options(found: ElementReader, textured: bool) -> SvgOptions:
    words = {name: text.strip() for name, text in found.metadata.words.items() if text.strip()}
    if "license" in words:
        urls = {url: name for name, url in LICENSES.items()}
        words["license"] = urls.get(words["license"], words["license"])
    options = SvgOptions.from_text(found.root.get(Data.OPTIONS, ""), **words)
    if options.texture == "auto" or not textured:
        options = SvgOptions(**{**vars(options), "texture": "image" if textured else "none"})
    return options


def _drawing(strokes: Sequence[ReadStroke], size: tuple[int, int], parts: Parts | None) -> Drawing:
    """The drawing of strokes. Raises ValueError where they are too many, or their texels."""
    offsets = np.cumsum([0] + [len(stroke.xy) for stroke in strokes])
    if offsets[-1] > limits.MAX_POINTS:
        raise ValueError(f"more than {limits.MAX_POINTS} points: simplify the drawing first")
    lines = Strokes(
        np.concatenate([np.zeros((0, 2)), *(stroke.xy for stroke in strokes)]),
        np.concatenate([np.zeros(0), *(stroke.width for stroke in strokes)]),
        offsets,
        np.array([stroke.kind for stroke in strokes], np.int8),
        np.array([stroke.closed for stroke in strokes], bool),
    )
    color = np.array([stroke.color for stroke in strokes]).reshape(-1, 4)
    track = tuple(stroke.track for stroke in strokes)
    texture = _texture(strokes, lines, color)
    return Drawing(lines, size, color, texture, parts, track if any(track) else None)


def _texture(strokes: Sequence[ReadStroke], lines: Strokes, color: np.ndarray) -> Texture | None:
    """The texture of all strokes, as wide as the widest strip; None where no stroke has one."""
    told = [stroke.strip for stroke in strokes if stroke.strip is not None]
    if not told:
        return None
    columns = max(strip.shape[1] for strip in told)
    if sum(map(len, told)) * columns > MAX_TEXELS:
        raise ValueError(f"more than {MAX_TEXELS} texels of texture: simplify the drawing first")
    strips = [
        _flat_strip(lines, i, color[i], columns)
        if stroke.strip is None
        else wider(stroke.strip, columns)
        for i, stroke in enumerate(strokes)
    ]
    margin = np.array([1.0 if stroke.strip is None else stroke.margin for stroke in strokes])
    return Texture(
        np.concatenate(strips), np.cumsum([0] + [len(strip) for strip in strips]), margin
    )


def _flat_strip(strokes: Strokes, i: int, color: np.ndarray, columns: int) -> np.ndarray:
    """The strip of a stroke of flat ink, in a drawing where others have a texture."""
    band = ribbon(strokes, i, 1.0)
    rows = int(np.clip(np.ceil(2 * band.length), 2, MAX_TEXELS // 100 // columns))
    at = strip_points(band, rows, columns)
    part = strokes.rows(i)
    depth = signed_distance(
        strokes.xy[part], 0.5 * strokes.thickness[part], at.reshape(-1, 2)
    ).reshape(rows, columns)
    strip = np.empty((rows, columns, 4))
    strip[...] = color
    strip[..., 3] *= np.clip(0.5 - depth, 0, 1)
    return np.rint(255 * strip).astype(np.uint8)
