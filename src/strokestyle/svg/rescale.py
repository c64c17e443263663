"""Scale the thickness of a drawing in its file: textures in tones are moved, not drawn anew.

A texture that is read off its tones and contoured again loses a little of its grain each time. Here
each point of a tone goes away from its stroke's centre line by the factor, so that a factor and its
inverse give what there was, and what the file holds besides stays to the letter.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..drawing.strokes import MAX_MARGIN
from ..files import limited
from ..geometry.affine import transformed
from ..geometry.curves import KINDS, counting, kind_named, owner
from ..geometry.parts import Parts, part_name
from .format import MARGIN_DECIMALS, TONE_UNIT, WIDTH_DECIMALS, Data, SvgOptions
from .kept import DrawnStroke
from .markup import Element, number, numbers, units
from .read_elements import ElementReader, StrokeElement
from .read_stroke import baked_transforms, read_centre_line, read_widths
from .read_texture import MAX_RINGS, TONES, Shape
from .stroke_data import edge_at
from .tone_path import tone_path
from .tones import Tones, tone_shapes

FACTORS = (0.5, 1.6)  # beyond, grain would be drawn out across strokes too much
SPACING = 1.0  # px between places on centre lines among which the nearest is looked up
MOVED = 0.06  # px that tones may lie beside their data
APART = 1e7  # between strokes where places are looked up, more than any two of one stroke
MAX_PAIRS = 1 << 27  # of a point and a place on its centre line, that are looked at one by one
AT_ONCE = 1 << 18  # of these pairs
_LETTERS = str.maketrans("Mmqt", "    ")


Factors = Callable[[np.ndarray, "Parts | None"], np.ndarray]  # (kinds, parts) -> of each stroke


class _Rings(NamedTuple):
    """Rings of tones as polygons, like those of `Tones`, and whose they are."""

    points: np.ndarray
    offsets: np.ndarray
    stroke: np.ndarray
    tone: np.ndarray


def thickened_svg(data: bytes, factors: Factors) -> tuple[str, int] | None:
    """Multiply thicknesses in a file of ours: its text, and its number of strokes.

    What other programs wrote anew in it, or moved, stays as they left it. None where the file has
    to be read as a drawing: where a stroke that changes is not in tones in a group of its own, or a
    factor is not within FACTORS. Raises ValueError as `read_svg` does.

    Parameters
    ----------
    data : the file
    factors : told the kinds (C,) and parts of its strokes, gives the factor (C,) of each; what has
        1 stays to the letter
    """
    data = limited(data)
    found = ElementReader()
    found.read(data)
    others = found.hidden + found.foreign_shapes + found.effects
    options = SvgOptions.from_text(found.root.get(Data.OPTIONS, ""))
    if others or found.unread_rules or not found.strokes or options.texture != "vector":
        return None
    every = factors(*kinds_and_parts(found))
    if not FACTORS[0] <= every.min() <= every.max() <= FACTORS[1]:
        return None
    changed = np.flatnonzero(every != 1.0)
    strokes, factor = [found.strokes[i] for i in changed.tolist()], every[changed]
    if not all(map(_is_in_own_space, strokes)):
        return None
    toned = [_toned(stroke.attributes, stroke.shapes) for stroke in strokes]
    drawn = _thicker_tones(toned, factor)
    if drawn is None:
        return None
    made, at = [], 0
    for stroke, then in zip(strokes, drawn, strict=True):
        end = data.find(b">", stroke.end) + 1
        text = _replaced(data[stroke.begin : end], stroke, then)
        if text is None:
            return None
        made += [data[at : stroke.begin], text]
        at = end
    return b"".join([*made, data[at:]]).decode("utf-8"), len(found.strokes)


def thicker_strokes(drawn: Mapping[int, DrawnStroke], factor: np.ndarray) -> dict[int, DrawnStroke]:
    """Multiply thicknesses of strokes that were drawn in tones: those of the others are left out.

    `factor` (C,) is that of each stroke, by its key; where it is 1 or beyond FACTORS, a stroke is
    left out too.
    """
    within = (factor != 1.0) & (factor >= FACTORS[0]) & (factor <= FACTORS[1])
    made = {}
    for i, stroke in drawn.items():
        element = stroke.element
        if not (within[i] and Data.MARGIN in element.attributes and element.children):
            continue
        toned = _toned(element.attributes, element.children)
        thicker = _thicker_tones([toned], factor[i : i + 1])
        if thicker is not None:
            (after,) = thicker
            paths = [
                replace(path, attributes=path.attributes | {"d": d})
                for path, d in zip(element.children, after.paths, strict=True)
            ]
            data = element.attributes | after.data
            made[i] = DrawnStroke(replace(element, attributes=data, children=tuple(paths)))
    return made


class _Toned(NamedTuple):
    """A stroke in tones: its data, and the path data of its tones, in units of TONE_UNIT."""

    data: dict[str, str]
    paths: list[str]


def _toned(data: dict[str, str], shapes: Iterable[Shape | Element]) -> _Toned:
    paths = [shape.attributes.get("d", "") for shape in shapes]
    return _Toned(data, [tone_path(d) or d for d in paths])


def kinds_and_parts(found: ElementReader) -> tuple[np.ndarray, Parts | None]:
    """Tell the kinds (C,) and the parts of the strokes of a file."""
    kinds = [kind_named(stroke.attributes.get(Data.CLASS, "")) for stroke in found.strokes]
    kinds = [KINDS.index("other") if kind is None else kind for kind in kinds]
    names = [part_name(stroke.attributes.get(Data.PART, "")) for stroke in found.strokes]
    return np.array(kinds, np.int8), Parts.of_names(names)


def _thicker_tones(strokes: Sequence[_Toned], factor: np.ndarray) -> list[_Toned] | None:
    """Strokes with their thicknesses multiplied (C,), and but the data that change.

    None where the tones of one are not as `tone_shapes` writes them.
    """
    if not strokes:
        return []
    rings = _rings([stroke.paths for stroke in strokes])
    if rings is None:
        return None
    points = rings.points + _steps_away([stroke.data for stroke in strokes], rings, factor)
    depth = 1 + int(rings.tone.max())
    shown = np.zeros((len(strokes), depth))
    regions = Tones(
        shown, np.zeros((*shown.shape, 3)), points, rings.offsets, rings.stroke, rings.tone
    )
    return [
        _Toned(_data(stroke.data, k) | {Data.AT: edge_at(shapes[0].edge)}, [s.d for s in shapes])
        for stroke, shapes, k in zip(strokes, tone_shapes(regions), factor.tolist(), strict=True)
    ]


def _is_in_own_space(stroke: StrokeElement) -> bool:
    """Whether a stroke is drawn in tones where its data are, however both were moved together."""
    if not stroke.of_shapes or stroke.loose:
        return False
    (baked,) = baked_transforms(stroke, False)
    line = read_centre_line(stroke.attributes[Data.PATH], False)
    there = transformed(baked, line)
    return all(
        shape.tag == "path"
        and np.abs(transformed(shape.matrix, line / TONE_UNIT) - there).max() < MOVED
        for shape in stroke.shapes
    )


def _rings(paths: Sequence[Sequence[str]]) -> _Rings | None:
    """The polygons of the tones of strokes, from their path data; None where these are not ours."""
    if not all(paths):
        return None
    texts, stroke, tone = [], [], []
    for i, tones in enumerate(paths):
        for k, d in enumerate(tones):
            if not TONES.fullmatch(d) or re.search("[0-9]{7}", d) or d.count("z") > MAX_RINGS:
                return None
            split = d.replace("-", " -").translate(_LETTERS).split("z")[:-1]
            texts += split
            stroke += [i] * len(split)
            tone += [k] * len(split)
    count = np.array([len(text.split()) for text in texts])
    if not len(count) or (count % 2).any() or count.min() < 10:
        return None
    pairs = np.array(" ".join(texts).split(), np.int64).reshape(-1, 2)
    whose, of = np.array(stroke), np.array(tone)
    points, offsets = _polygons(pairs, np.r_[0, np.cumsum(count // 2)], 1000 * whose + of)
    return _Rings(points, offsets, whose, of)


def _polygons(
    pairs: np.ndarray, offsets: np.ndarray, path: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points of polygons and their offsets, from the numbers of rings as `tone_shapes` writes them.

    Parameters
    ----------
    pairs : (n, 2) of each ring where it begins, of the ring before it; the first control point, of
        there; then where each piece ends, of where it begins
    path : (R,) which rings are of one path
    """
    jump = pairs[offsets[:-1]]
    begin = _running(jump, np.r_[np.flatnonzero(np.diff(path, prepend=-1)), len(path)])
    keep = np.ones(len(pairs), bool)
    keep[offsets[:-1]] = keep[offsets[:-1] + 1] = False
    pieces = offsets - 2 * np.arange(len(offsets))
    own = owner(pieces)
    end = begin[own] + _running(pairs[keep], pieces)
    sign = np.where(counting(np.diff(pieces)) % 2, -1, 1)[:, None]
    turned = -2 * np.roll(sign * end, 1, axis=0)
    turned[pieces[:-1]] = begin + pairs[offsets[:-1] + 1]
    return sign * _running(turned, pieces) // 2, pieces


def _running(values: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Running sums of rows (n, 2) within groups."""
    total = np.cumsum(values, axis=0)
    before = np.concatenate([np.zeros((1, 2), values.dtype), total])[offsets[:-1]]
    return total - np.repeat(before, np.diff(offsets), axis=0)


def _steps_away(
    strokes: Sequence[Mapping[str, str]], rings: _Rings, factor: np.ndarray
) -> np.ndarray:
    """By how many units (n, 2) the rings' points go away from the centre lines of their strokes.

    `strokes` are the data of each, `factor` (C,) is by stroke.
    """
    lines = [_dense(data) for data in strokes]
    xy = np.concatenate(lines)
    whose = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    points = rings.points * (2 * TONE_UNIT)
    of = np.repeat(rings.stroke, np.diff(rings.offsets))
    near = _nearest(points, of, lines)
    away = points - xy[near]
    for step in (-1, 1):  # to the pieces before and behind that place
        other = np.clip(near + step, 0, len(xy) - 1)
        along = np.where((whose[other] == of)[:, None], xy[other] - xy[near], 0.0)
        square = np.maximum((along * along).sum(axis=1), 1e-12)
        share = np.clip(((points - xy[near]) * along).sum(axis=1) / square, 0.0, 1.0)
        beside = points - xy[near] - share[:, None] * along
        closer = np.hypot(*beside.T) < np.hypot(*away.T)
        away = np.where(closer[:, None], beside, away)
    more = (factor - 1.0)[of, None]
    return np.rint(more * away / (2 * TONE_UNIT)).astype(np.int64)


def _nearest(points: np.ndarray, of: np.ndarray, lines: list[np.ndarray]) -> np.ndarray:
    """The row (n,) of the stacked lines [(m, 2), ...] that is nearest to each point (n, 2).

    Of its own line only: `of` (n,), in order.
    """
    begin = np.cumsum([0] + [len(line) for line in lines])
    first = np.searchsorted(of, np.arange(len(lines) + 1))
    if (np.diff(first) * np.diff(begin)).sum() > MAX_PAIRS:
        from scipy.spatial import cKDTree  # takes .25 s to import, as long as so many pairs

        whose = np.repeat(np.arange(len(lines)), np.diff(begin))
        tree = cKDTree(np.column_stack([np.concatenate(lines), APART * whose]))
        return tree.query(np.column_stack([points, APART * of]))[1]
    near = np.zeros(len(points), np.int64)
    for i, line in enumerate(lines):
        middle = line.mean(axis=0)
        places, step = line - middle, max(1, AT_ONCE // len(line))
        size = np.square(places).sum(axis=1)
        for a in range(first[i], first[i + 1], step):
            rows = slice(a, min(a + step, first[i + 1]))
            square = size - 2.0 * (points[rows] - middle) @ places.T
            near[rows] = begin[i] + square.argmin(axis=1)
    return near


def _dense(data: Mapping[str, str]) -> np.ndarray:
    """The centre line of a stroke (n, 2) with points SPACING apart, px."""
    xy = read_centre_line(data[Data.PATH], Data.CLOSED in data)
    length = np.r_[0.0, np.cumsum(np.hypot(*np.diff(xy, axis=0).T))]
    at = np.union1d(length, np.linspace(0.0, length[-1], 2 + int(length[-1] / SPACING)))
    return np.column_stack([np.interp(at, length, column) for column in xy.T])


def _data(data: Mapping[str, str], factor: float) -> dict[str, str]:
    """Widths and margin of a stroke, times a factor. Raises ValueError on those that are none."""
    text = data.get(Data.WIDTH, "1")
    read_widths(read_centre_line(data[Data.PATH], False), text)
    pairs = [word.rpartition(",") for word in text.split()]
    scaled = units(factor * np.array([float(width) for *_, width in pairs]), WIDTH_DECIMALS)
    widths = zip(pairs, numbers(scaled, WIDTH_DECIMALS), strict=True)
    margin = min(factor * float(data[Data.MARGIN]), MAX_MARGIN)
    return {
        Data.WIDTH: " ".join(f"{t}{comma}{width}" for (t, comma, _), width in widths),
        Data.MARGIN: number(margin, MARGIN_DECIMALS),
    }


def _replaced(text: bytes, stroke: StrokeElement, after: _Toned) -> bytes | None:
    """A stroke's text with other path data, one after the other, and other values of attributes.

    None where it is not so plain that these are what the attributes' names stand before.
    """
    told = re.findall(rb'\sd="([^"]*)"', text)
    if told != [shape.attributes.get("d", "").encode() for shape in stroke.shapes]:
        return None
    left = iter(after.paths)
    made = re.sub(rb'(\sd=)"[^"]*"', lambda d: d[1] + f'"{next(left)}"'.encode(), text)
    for name, value in after.data.items():
        places = list(re.finditer(rb'\s%s="([^"]*)"' % name.encode(), made))
        was = stroke.attributes.get(name)
        if [place[1] for place in places] != ([] if was is None else [was.encode()]):
            return None
        if places:
            made = made[: places[0].start(1)] + value.encode() + made[places[0].end(1) :]
        elif name != Data.AT:
            return None
    return made
