"""Edits of a drawing: each takes a Drawing and gives another, and the texture follows the strokes.

The paper's figure of edits: thickness rescaled, wiggliness added, control points moved. `only` (C,) bool, of every
function that has it, says which strokes are meant; None: all. A stroke that an edit leaves as it is stays so to the
last bit.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..geometry.curves import KINDS, arc_length, blurred, counting, simplify, take_ragged, tangents
from ..geometry.parts import Pieces, part_name
from .ribbon import half_widths
from .strip import wider
from .strokes import Drawing, Strokes, Texture

STEP = 3.0  # px between the points of a line that is drawn anew
SHARP = 50.0  # degrees; where a simplified line turns by more, it keeps its corner
OVERLAP = 0.25  # px by which the pieces of a stroke that was cut lie over each other
MAX_LENGTH = 1_000_000  # px of a stroke's length that edits resample
MAX_COLUMNS = 256  # texels across a strip
STRETCH = 1.3  # the most by which grain is stretched
GRAIN = 15.0  # px along a stroke, blur that tells tone from grain
TONES = 24  # levels of tone


@dataclass(frozen=True)
class Reshaped:
    """A stroke after an edit: xy (n, 2), thickness (n,), and which point of the old stroke each point was, (n,) float:
    2.5 lies half-way between points 2 and 3. It rises."""

    xy: np.ndarray
    thickness: np.ndarray
    was: np.ndarray


# -------------------------------------------------------------------------------------------------------- the edits


def thicken(drawing: Drawing, factor: float, only: np.ndarray | None = None) -> Drawing:
    """Every thickness multiplied by `factor`."""
    _check("--thickness", factor, 0.0, 1000.0)
    if factor == 1.0:
        return drawing
    return _reshape(drawing, lambda line: Reshaped(line.xy, line.thickness * factor, line.was), only)


def wiggle(
    drawing: Drawing, amplitude: float, wavelength: float, seed: int = 0, only: np.ndarray | None = None
) -> Drawing:
    """Points displaced across their stroke by smooth noise; the ends of an open stroke stay where they are.

    Parameters
    ----------
    amplitude : px, the most by which a point strays
    wavelength : px of arc length from crest to crest, on average
    seed : the same seed and order of strokes give the same noise
    """
    _check("the amplitude of --wiggle", amplitude, 0.0, 1e4)
    _check("the wavelength of --wiggle", wavelength, 0.5, 1e5)
    if amplitude == 0.0:
        return drawing

    def edit(line):
        line = _evenly(line, min(STEP, wavelength / 8))
        s = arc_length(line.xy, np.array([0, len(line.xy)]))
        noise = _noise(s, wavelength, line.closed, seed, line.index)
        if not line.closed:  # nothing at the ends, in full from a third of the way between crests on
            rise = np.clip(np.minimum(s, s[-1] - s) / min(wavelength / 3, s[-1] / 2), 0, 1)
            noise *= rise * rise * (3 - 2 * rise)
        t = tangents(_smoothed(line.xy, s, wavelength / 8, line.closed), *_one(line.xy, line.closed))
        xy = line.xy + amplitude * noise[:, None] * np.stack([-t[:, 1], t[:, 0]], axis=1)
        return Reshaped(_shut(xy, line.closed), line.thickness, line.was)

    return _reshape(drawing, edit, only)


def smooth(drawing: Drawing, sigma: float, only: np.ndarray | None = None) -> Drawing:
    """Lines smoothed by a Gaussian of `sigma` px along them; the ends of an open stroke stay where they are."""
    _check("--smooth", sigma, 0.0, 1e4)
    if sigma == 0.0:
        return drawing

    def edit(line):
        line = _evenly(line, min(STEP, max(sigma / 2, 0.25)))
        s = arc_length(line.xy, np.array([0, len(line.xy)]))
        return Reshaped(_shut(_smoothed(line.xy, s, sigma, line.closed), line.closed), line.thickness, line.was)

    return _reshape(drawing, edit, only)


def simplified(drawing: Drawing, tolerance: float, only: np.ndarray | None = None) -> Drawing:
    """Lines drawn through as few of their points as keep them within `tolerance` px, curved between these.

    They pass through the points of Ramer-Douglas-Peucker as a centripetal Catmull-Rom spline, with corners where the
    line turns by more than SHARP.
    """
    _check("--simplify", tolerance, 0.0, 1e4)
    if tolerance == 0.0:
        return drawing

    def edit(line):
        keep = simplify(line.xy, tolerance)
        if line.closed and len(keep) < 4:  # a ring keeps its inside
            keep = np.unique(np.r_[0, len(line.xy) // 3, 2 * len(line.xy) // 3, len(line.xy) - 1])
        curve, place = _through(line.xy[keep], line.closed)
        along = np.interp(place, np.arange(len(keep)), keep)
        width = np.interp(along, np.arange(len(line.xy)), line.thickness)
        was = np.interp(along, np.arange(len(line.xy)), line.was)
        return Reshaped(_shut(curve, line.closed), width, was)

    return _reshape(drawing, edit, only)


def move(drawing: Drawing, stroke: int, point: float, by: tuple[float, float], reach: float | None = None) -> Drawing:
    """A point of a stroke moved, and its neighbours with it, less the farther along the stroke they are.

    Parameters
    ----------
    stroke : index of the stroke
    point : where, as the share of the stroke's length: 0 its beginning, 1 its end
    by : px
    reach : px of arc length at which nothing moves any more; None: half the stroke's length, or as far as it is moved

    Raises
    ------
    ValueError
        where there is no such stroke or point.
    """
    if not 0 <= stroke < len(drawing.strokes):
        raise ValueError(f"--move: there is no stroke {stroke}; the drawing has {len(drawing.strokes)}")
    _check("the point of --move", point, 0.0, 1.0)
    for value in by:
        _check("the way of --move", value, -1e6, 1e6)
    if tuple(by) == (0.0, 0.0):
        return drawing

    def edit(line):
        line = _evenly(line, STEP)
        s = arc_length(line.xy, np.array([0, len(line.xy)]))
        far = max(0.5 * s[-1], float(np.hypot(*by))) if reach is None else reach
        away = np.abs(s - point * s[-1])
        if line.closed:
            far, away = min(far, 0.5 * s[-1]), np.minimum(away, s[-1] - away)
        near = np.clip(1 - away / max(far, 1e-9), 0, 1)
        moved = line.xy + (near * near * (3 - 2 * near))[:, None] * np.asarray(by, np.float64)
        return Reshaped(_shut(moved, line.closed), line.thickness, line.was)

    return _reshape(drawing, edit, np.arange(len(drawing.strokes)) == stroke)


def taper(drawing: Drawing, length: float, only: np.ndarray | None = None) -> Drawing:
    """Open strokes brought to a point over `length` px from either end, or half the stroke where it is shorter."""
    _check("--taper", length, 0.0, 1e5)
    if length == 0.0:
        return drawing

    def edit(line):
        if line.closed:
            return None
        line = _evenly(line, STEP)
        s = arc_length(line.xy, np.array([0, len(line.xy)]))
        rise = np.clip(np.minimum(s, s[-1] - s) / max(min(length, 0.5 * s[-1]), 1e-9), 0, 1)
        return Reshaped(line.xy, line.thickness * np.sin(0.5 * np.pi * rise), line.was)

    return _reshape(drawing, edit, only)


def recolor(drawing: Drawing, color: tuple[float, float, float], only: np.ndarray | None = None) -> Drawing:
    """The ink's colour changed to `color`, (r, g, b) in [0, 1], in texture too; opacity stays.

    An ink that varies goes on varying by as much, about the new colour.
    """
    only = np.ones(len(drawing.strokes), bool) if only is None else only
    color = np.asarray(color, np.float64)
    ink = drawing.color.copy()
    ink[only, :3] = color
    texture = drawing.texture
    if texture is not None:
        rgba = texture.rgba.copy()
        for i in np.flatnonzero(only).tolist():
            rows = slice(texture.offsets[i], texture.offsets[i + 1])
            strip = rgba[rows].astype(np.float64)
            weight = strip[..., 3:].sum()
            mean = (strip[..., :3] * strip[..., 3:]).sum(axis=(0, 1)) / max(weight, 1.0)
            even = np.square((strip[..., :3] - mean) * strip[..., 3:] / 255).sum() < 9.0 * weight / 255
            shift = 0.0 if even else strip[..., :3] - mean
            rgba[rows, :, :3] = np.rint(np.clip(255 * color + shift, 0, 255))
        texture = Texture(rgba, texture.offsets, texture.margin)
    return replace(drawing, color=ink, texture=texture)


def cut_at_parts(drawing: Drawing, pieces: Pieces) -> Drawing:
    """Strokes cut into pieces, each of one part of the shape; it looks as if they were whole."""
    old, of, texture = drawing.strokes, pieces.line, drawing.texture
    xy, thickness = old.xy[pieces.rows], old.thickness[pieces.rows]
    strokes = Strokes(xy, thickness, pieces.offsets, old.kind[of], old.closed[of] & pieces.whole)
    if texture is not None and not pieces.whole.all():
        ends = pieces.rows[np.stack([pieces.offsets[:-1], pieces.offsets[1:] - 1], axis=1)] - old.offsets[of, None]
        strips = [
            texture.rgba[texture.offsets[i] : texture.offsets[i + 1]]
            if pieces.whole[k]
            else _strip_of_piece(drawing, i, strokes, k, *ends[k].tolist())
            for k, i in enumerate(of.tolist())
        ]
        texture = Texture(np.concatenate(strips), np.cumsum([0] + [len(s) for s in strips]), texture.margin[of])
    return replace(drawing, strokes=strokes, color=drawing.color[of], texture=texture, parts=pieces.parts)


def keep(drawing: Drawing, index: np.ndarray) -> Drawing:
    """Only the strokes of an index or mask over C."""
    strokes, texture = drawing.strokes, drawing.texture
    index = np.arange(len(strokes))[np.asarray(index)]
    rows, offsets = take_ragged(strokes.offsets, index)
    kept = Strokes(strokes.xy[rows], strokes.thickness[rows], offsets, strokes.kind[index], strokes.closed[index])
    if texture is not None:
        rows, offsets = take_ragged(texture.offsets, index)
        texture = Texture(texture.rgba[rows], offsets, texture.margin[index])
    parts = None if drawing.parts is None else drawing.parts.take(index)
    return replace(drawing, strokes=kept, color=drawing.color[index], texture=texture, parts=parts)


def lengths(drawing: Drawing) -> np.ndarray:
    """Arc length of each stroke, (C,) px."""
    strokes = drawing.strokes
    return arc_length(strokes.xy, strokes.offsets)[strokes.offsets[1:] - 1] if len(strokes) else np.zeros(0)


# ---------------------------------------------------------------------------------------------------- edits as text


@dataclass(frozen=True)
class Sheet:
    """A drawing with names for its strokes: what an edit takes and gives.

    Parameters
    ----------
    drawing : Drawing
    ids : (C,) names, as `--move` knows the strokes by; "" is none
    """

    drawing: Drawing
    ids: tuple[str, ...]


Edit = Callable[[Sheet, int], Sheet]  # (sheet, seed)


def parse_edit(name: str, text: str) -> Edit:
    """An edit as the command line says it: "thickness", "contour=1.5". Raises ValueError on what is none.

    What stands before "=" are kinds of line and names of parts, with commas between. Whether the drawing has such a
    part is not known before the edit is made; it raises ValueError then.
    """
    if name == "move":
        return _parse_move(text)
    if name == "drop":
        return _parse_drop(text)
    which, _, value = text.rpartition("=")
    which = which or None
    if name == "recolor":
        color = _color(value)
        return _on(which, lambda drawing, only, seed: recolor(drawing, color, only))
    numbers = _numbers(value, f"--{name}", 2 if name == "wiggle" else 1)
    edit = {
        "thickness": lambda drawing, only, seed: thicken(drawing, *numbers, only),
        "wiggle": lambda drawing, only, seed: wiggle(drawing, *numbers, seed, only),
        "smooth": lambda drawing, only, seed: smooth(drawing, *numbers, only),
        "simplify": lambda drawing, only, seed: simplified(drawing, *numbers, only),
        "taper": lambda drawing, only, seed: taper(drawing, *numbers, only),
    }[name]
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (1, 1), np.zeros((0, 4)))
    edit(nothing, None, 0)  # so that bad numbers are refused before any work
    return _on(which, edit)


def _on(which: str | None, edit) -> Edit:
    def apply(sheet: Sheet, seed: int) -> Sheet:
        only = None if which is None else named(sheet.drawing, which)
        return Sheet(edit(sheet.drawing, only, seed), sheet.ids)

    return apply


def named(drawing: Drawing, which: str) -> np.ndarray:
    """The strokes (C,) bool of kinds and parts, as "contour,wheel" names them; where a name is both, it is the kind.

    Raises ValueError on a name that is neither, telling those that there are.
    """
    parts = () if drawing.parts is None else drawing.parts.names
    each = [part_name(name) for name in ([which] if part_name(which) in parts else which.split(","))]
    wanted = [name for name in each if name]
    unknown = [name for name in wanted if name not in (*KINDS, *parts)]
    if unknown or not wanted:
        few = ", ".join(sorted(parts)[:20]) + ", ..." * (len(parts) > 20)
        some = f"the parts {few}" if parts else "no named parts"
        raise ValueError(
            f"{', '.join(map(repr, unknown)) or 'nothing'}: no such kind of line or part; there are the kinds "
            f"{', '.join(KINDS)} and {some}"
        )
    chosen = np.isin(drawing.strokes.kind, [KINDS.index(name) for name in wanted if name in KINDS])
    for name in wanted:
        if name not in KINDS:
            chosen |= drawing.parts.index == parts.index(name)
    return chosen


def _parse_move(text: str) -> Edit:
    parts = text.rsplit(":", 2)
    if len(parts) != 3 or not parts[0]:
        raise ValueError(f"--move is STROKE:POINT:DX,DY, for instance s004:0.5:20,-10, got {text!r}")
    (point,), by = _numbers(parts[1], "the point of --move", 1), _numbers(parts[2], "the way of --move", 2)
    _check("the point of --move", point, 0.0, 1.0)

    def apply(sheet: Sheet, seed: int) -> Sheet:
        return Sheet(move(sheet.drawing, _stroke(sheet, parts[0]), point, by), sheet.ids)

    return apply


def _stroke(sheet: Sheet, name: str) -> int:
    if name in sheet.ids:
        return sheet.ids.index(name)
    if name.isdigit() and int(name) < len(sheet.ids):
        return int(name)
    some = ", ".join(sheet.ids[:3] + (("...",) if len(sheet.ids) > 3 else ()))
    raise ValueError(f"--move: there is no stroke {name!r}; there are {some or 'none'}")


def _parse_drop(text: str) -> Edit:
    match = re.fullmatch(r"(.*?)(?:([<>])\s*([0-9]*\.?[0-9]+)\s*(?:px)?)?\s*", text, re.DOTALL)
    which = match[1].strip() or None
    if not (which or match[2]):
        raise ValueError(
            f"--drop is a length such as '<20', kinds or parts such as valley,ridge, or both: 'valley<20'; got {text!r}"
        )

    def apply(sheet: Sheet, seed: int) -> Sheet:
        parts = sheet.drawing.parts
        whole = parts is not None and part_name(text) in parts.names  # a part may be called "a<20"
        asked = text if whole else which
        gone = np.ones(len(sheet.drawing.strokes), bool) if asked is None else named(sheet.drawing, asked)
        if match[2] and not whole:
            long = lengths(sheet.drawing)
            gone &= long < float(match[3]) if match[2] == "<" else long > float(match[3])
        ids = tuple(name for name, out in zip(sheet.ids, gone.tolist(), strict=True) if not out)
        return Sheet(keep(sheet.drawing, ~gone), ids)

    return apply


def _numbers(text: str, what: str, count: int) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"{what} takes {'a number' if count == 1 else 'two numbers, such as 4,30'}, got {text!r}")
    return values


def _color(text: str) -> tuple[float, ...]:
    from PIL import ImageColor

    try:
        return tuple(value / 255.0 for value in ImageColor.getrgb(text[:60])[:3])
    except ValueError:
        raise ValueError(f"a colour is #rrggbb or a name such as navy, got {text!r}") from None


# ------------------------------------------------------------------------------------------------------ lines, anew


@dataclass(frozen=True)
class _Line:
    """A stroke that is being edited; `was` as in Reshaped."""

    index: int
    xy: np.ndarray
    thickness: np.ndarray
    was: np.ndarray
    closed: bool


def _check(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{what} must lie between {low:g} and {high:g}, got {value:g}")


def _one(xy, closed):
    """Offsets and `closed` of a single curve."""
    return np.array([0, len(xy)]), np.array([closed])


def _shut(xy, closed):
    if closed:
        xy[-1] = xy[0]
    return xy


def _evenly(line: _Line, spacing: float) -> _Line:
    """The line with points added so that none are farther apart than `spacing`; its own points stay."""
    step = np.hypot(*np.diff(line.xy, axis=0).T)
    if step.sum() > MAX_LENGTH:
        raise ValueError(f"a stroke {step.sum():.3g} px long is too long to be edited")
    pieces = np.maximum(np.ceil(step / spacing - 1e-9), 1).astype(np.int64)
    k = np.repeat(np.arange(len(step)), pieces)
    at = np.r_[k + counting(pieces) / pieces[k], len(step)]
    index = np.arange(len(line.xy))
    xy = np.stack([np.interp(at, index, column) for column in line.xy.T], axis=1)
    return _Line(line.index, xy, np.interp(at, index, line.thickness), np.interp(at, index, line.was), line.closed)


def _smoothed(xy, s, sigma, closed):
    """Points (n, 2) at arc lengths s, smoothed by a Gaussian of sigma px; open lines keep their ends."""
    if s[-1] < 1e-9:
        return xy.copy()
    count = int(np.clip(np.ceil(s[-1] / max(sigma / 4, 1e-3)), 8, 20_000))
    at = np.linspace(0.0, s[-1], count + 1)
    even = np.stack([np.interp(at, s, column) for column in xy.T], axis=1)
    even = blurred(even, sigma * count / s[-1], closed)
    return np.stack([np.interp(s, at, column) for column in even.T], axis=1)


def chances(seed: int, stroke: int, count: int) -> np.ndarray:
    """Numbers in [0, 1), (count,), that depend on a seed and a stroke's number only, and that the page draws as well:
    a counter through the finaliser of MurmurHash3."""

    def mixed(h):
        h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
        h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
        return h ^ (h >> np.uint32(16))

    with np.errstate(over="ignore"):
        start = mixed(mixed(np.array([seed & 0xFFFFFFFF], np.uint32)) ^ np.uint32(stroke))
        return mixed(start + np.arange(1, count + 1, dtype=np.uint32) * np.uint32(0x9E3779B9)) / 2.0**32


def _noise(s, wavelength, closed, seed, stroke):
    """Smooth noise in [-1, 1] at arc lengths s: random heights of alternating sign, half a wavelength apart."""
    count = max(2 if closed else 1, round(2 * s[-1] / wavelength))
    if closed:
        count += count % 2
    *heights, sign, shift = chances(seed, stroke, count + 5)
    height = (0.45 + 0.55 * np.array(heights)) * np.where(np.arange(count + 3) % 2, 1, -1) * (-1 if sign < 0.5 else 1)
    shift = 0.25 + 0.5 * shift  # so that crests are not all as far from the ends
    if closed:
        height[-3:] = height[:3]
        shift = 0.5
    place = s / max(s[-1], 1e-9) * count + shift
    k = np.minimum(place.astype(np.int64), count + 1)
    f = place - k
    return height[k] + (height[k + 1] - height[k]) * f * f * (3 - 2 * f)


def _through(xy, closed):
    """A curve through points (n, 2): its points about STEP apart, and where each lies, in points of `xy`.

    Catmull and Rom 1974, centripetal (Yuksel et al. 2011) so that it neither loops nor overshoots.
    """
    if len(xy) < 3:
        pieces = max(1, int(np.ceil(np.hypot(*(xy[-1] - xy[0])) / STEP)))
        t = np.linspace(0, 1, pieces + 1)
        return xy[0] + t[:, None] * (xy[-1] - xy[0]), t * (len(xy) - 1)
    before, after = (xy[-2:-1], xy[1:2]) if closed else (2 * xy[:1] - xy[1:2], 2 * xy[-1:] - xy[-2:-1])
    p = np.concatenate([before, xy, after])
    gap = np.sqrt(np.maximum(np.hypot(*np.diff(p, axis=0).T), 1e-9))[:, None]
    slope = np.diff(p, axis=0) / gap
    tangent = (slope[:-1] * gap[1:] + slope[1:] * gap[:-1]) / (gap[:-1] + gap[1:])  # at each of xy
    heading = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
    sharp = (np.abs(np.diff(heading)) > np.radians(SHARP))[:, None]
    leave, arrive = np.where(sharp, slope[1:], tangent)[:-1], np.where(sharp, slope[:-1], tangent)[1:]
    pieces = np.maximum(np.ceil(np.hypot(*np.diff(xy, axis=0).T) / STEP), 1).astype(np.int64)
    k = np.repeat(np.arange(len(pieces)), pieces)
    f = counting(pieces) / pieces[k]
    t, h = f[:, None], gap[1:-1][k]
    curve = (
        (2 * t**3 - 3 * t**2 + 1) * xy[k]
        + (t**3 - 2 * t**2 + t) * h * leave[k]
        + (3 * t**2 - 2 * t**3) * xy[k + 1]
        + (t**3 - t**2) * h * arrive[k]
    )
    return np.concatenate([curve, xy[-1:]]), np.r_[k + f, len(xy) - 1]


# ------------------------------------------------------------------------------------------------ texture, carried


def _reshape(drawing: Drawing, edit: Callable[[_Line], Reshaped | None], only: np.ndarray | None) -> Drawing:
    """The drawing with an edit made to each stroke of `only`; a stroke for which it gives None stays."""
    strokes, texture = drawing.strokes, drawing.texture
    only = np.ones(len(strokes), bool) if only is None else only
    lines, was = [], {}
    for i in range(len(strokes)):
        rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
        xy, width = strokes.xy[rows], strokes.thickness[rows]
        moving = only[i] and np.ptp(xy, axis=0).max() > 1e-6
        line = _Line(i, xy, width, np.arange(len(xy), dtype=np.float64), bool(strokes.closed[i]))
        made = edit(line) if moving else None
        if made is not None:
            was[i] = made.was
        lines.append((xy, width) if made is None else (made.xy, made.thickness))
    offsets = np.cumsum([0] + [len(xy) for xy, _ in lines])
    new = Strokes(
        np.concatenate([np.zeros((0, 2)), *(xy for xy, _ in lines)]),
        np.concatenate([np.zeros(0), *(width for _, width in lines)]),
        offsets,
        strokes.kind,
        strokes.closed,
    )
    if texture is not None:
        columns = _columns(drawing, new, was)
        strips = [
            _carried(drawing, new, i, was[i], columns)
            if i in was
            else wider(texture.rgba[texture.offsets[i] : texture.offsets[i + 1]], columns)
            for i in range(len(strokes))
        ]
        ends = np.cumsum([0] + [len(strip) for strip in strips])
        texture = Texture(np.concatenate(strips), ends, texture.margin) if strips else texture
    made = replace(drawing, strokes=new, texture=texture)
    # what was not edited is written as it was, even where its strip has more columns now
    kept = {made.digest(i): drawing.art.get(drawing.digest(i)) for i in range(len(new)) if drawing.art and i not in was}
    return replace(made, art={key: stroke for key, stroke in kept.items() if stroke})


def _strip_of_piece(drawing: Drawing, i: int, new: Strokes, k: int, first: int, last: int) -> np.ndarray:
    """The strip of stroke k of `new`, points `first` to `last` of stroke i: what lay there, nothing past the cuts."""
    texture, margin, closed = drawing.texture, float(drawing.texture.margin[i]), bool(drawing.strokes.closed[i])
    strip = texture.rgba[texture.offsets[i] : texture.offsets[i + 1]]
    s, half, _ = _profile(drawing.strokes, i, margin)
    before, after = (0.0, 0.0) if closed else half[[0, -1]]
    rate = len(strip) / max(s[-1] + before + after, 1e-6)  # rows a px
    caps = np.rint((_profile(new, k, margin)[1][[0, -1]] - OVERLAP) * rate).astype(np.int64)
    begin, end = np.rint((before + s[[first, last]] + [-OVERLAP, OVERLAP]) * rate).astype(np.int64)
    if first == 0 and not closed:
        begin, caps[0] = 0, 0
    if last == len(s) - 1 and not closed:
        end, caps[1] = len(strip), 0
    kept = strip[max(begin, 0) : max(end, begin + 2)]
    blank = kept * np.array([1, 1, 1, 0], np.uint8)
    return np.concatenate([blank[:1].repeat(max(caps[0], 0), 0), kept, blank[-1:].repeat(max(caps[1], 0), 0)])


def _columns(drawing: Drawing, new: Strokes, changed) -> int:
    """How many texels lie across the new strips: more, where strokes became so much thicker that theirs would show."""
    columns, most = drawing.texture.rgba.shape[1], 1.0
    for i in changed:
        old_half, new_half = (
            _profile(strokes, i, float(drawing.texture.margin[i]))[1] for strokes in (drawing.strokes, new)
        )
        most = max(most, new_half.max() / max(old_half.max(), 1e-9))
    return columns if most < 1.3 else min(int(np.ceil(columns * most)), MAX_COLUMNS)


def _carried(drawing: Drawing, new: Strokes, i: int, was: np.ndarray, columns: int) -> np.ndarray:
    """The strip of stroke i on the stroke that was made of it.

    Along, tone and ink lie by the point where they lay; across, they are stretched with the thickness, but for the soft
    edge beyond it. Grain keeps its own scale: where it would be stretched by more than STRETCH, it is laid anew.
    """
    old, texture = drawing.strokes, drawing.texture
    margin = float(texture.margin[i])
    strip = texture.rgba[texture.offsets[i] : texture.offsets[i + 1]].astype(np.float64) / 255.0
    n, a = strip.shape[:2]
    old_s, old_half, old_width = _profile(old, i, margin)
    new_s, new_half, new_width = _profile(new, i, margin)
    closed = bool(old.closed[i])
    old_caps, new_caps = ((0.0, 0.0), (0.0, 0.0)) if closed else (old_half[[0, -1]], new_half[[0, -1]])
    old_length, new_length = max(old_s[-1] + sum(old_caps), 1e-6), max(new_s[-1] + sum(new_caps), 1e-6)
    rows = max(2, round(n * new_length / old_length))
    u = (np.arange(rows) + 0.5) / rows * new_length - new_caps[0]  # px from the new stroke's beginning
    # along: the same point; in a cap, the same share of it
    before = np.interp(np.interp(u, new_s, was), np.arange(len(old_s)), old_s)
    before = np.where(u < 0, u / max(new_caps[0], 1e-9) * old_caps[0], before)
    past = (u - new_s[-1]) / max(new_caps[1], 1e-9) * old_caps[1]
    before = np.where(u > new_s[-1], old_s[-1] + past, before)
    row = (before + old_caps[0]) / old_length * n - 0.5
    # across: ink stretched by how much thicker the stroke became, its soft edge as wide as it was
    w_old, w_new = np.interp(before, old_s, old_width), np.interp(u, new_s, new_width)
    ratio = np.where(w_old > 1e-6, w_new / np.maximum(w_old, 1e-6), 1.0)[:, None]
    h_old, h_new = np.interp(before, old_s, old_half)[:, None], np.interp(u, new_s, new_half)[:, None]
    v = (2.0 * np.arange(columns) + 1.0) / columns - 1.0
    away = np.abs(v) * h_new
    core = np.maximum(h_old - margin, 0.0)
    source = np.where(away <= core * ratio, away / np.maximum(ratio, 1e-9), core + away - core * ratio)
    seen = np.clip(h_old - source + h_old / a, 0, 1)  # past the old ribbon's edge there is nothing
    seen = seen * np.clip(w_new / np.maximum(np.minimum(w_old, 1.0), 1e-6), 0, 1)[:, None]
    column = (np.sign(v) * source / np.maximum(h_old, 1e-9) + 1) * 0.5 * a - 0.5
    row = np.broadcast_to(row[:, None], column.shape)
    strip[..., :3] *= strip[..., 3:]
    mode = "grid-wrap" if closed else "nearest"

    def look(layer, at_row=row, at_column=column, order=1):
        places = [np.clip(at_row, 0, n - 1) if not closed else at_row, np.clip(at_column, 0, a - 1)]
        return ndimage.map_coordinates(layer, places, order=order, mode=mode)

    made = np.stack([look(strip[..., k]) for k in range(4)], axis=-1)
    rate = np.gradient(row[:, 0]) * (new_length / rows) ** -1 * (old_length / n) if rows > 2 else np.ones(rows)
    stretched = np.array([rate.min(), rate.max(), *(1 / np.clip(ratio[w_old > 0.5], 0.05, 20)).T.ravel(), 1.0])
    if stretched.min() < 1 / STRETCH or stretched.max() > STRETCH:
        along = np.cumsum(np.clip(rate, 1 / STRETCH, STRETCH)) * (new_length / rows) / (old_length / n)
        across = np.sign(v) * away / np.clip(ratio, 1 / STRETCH, STRETCH)
        across = (across / np.maximum(h_old, 1e-9) + 1) * 0.5 * a - 0.5
        sigma = (GRAIN * n / old_length, 1.0)  # across, opacity has a shape: what is uneven there is no grain
        made[..., 3] = _regrained(strip[..., 3], sigma, mode, look, along[:, None], across)
        # grain may come to lie where there was no ink: its colour is that of the ink around
        near = ndimage.gaussian_filter(strip, (2.0 * n / old_length, 1.0, 0)) + 1e-4 * strip.mean(axis=(0, 1))
        ink = np.stack([look(near[..., k] / np.maximum(near[..., 3], 1e-9)) for k in range(3)], axis=-1)
        made[..., :3] = ink * made[..., 3:]
    made *= seen[..., None]
    made[..., :3] /= np.maximum(made[..., 3:], 1e-6)
    return np.rint(np.clip(made, 0, 1) * 255).astype(np.uint8)


def _regrained(alpha: np.ndarray, sigma, mode: str, look, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Opacity of stretched tone with grain that is not stretched.

    A texel's grain is its rank among the texels of about its tone, tone the mean opacity along the stroke around it.
    Where the tone goes to, the grain of another place is given the opacity that its rank has there.
    """
    tone = ndimage.gaussian_filter(alpha, sigma, mode=("wrap" if mode == "grid-wrap" else "nearest", "constant"))
    level = np.minimum((tone * TONES).astype(np.int64), TONES - 1).ravel()
    order = np.lexsort((alpha.ravel(), level))
    count = np.bincount(level, minlength=TONES)
    first = np.cumsum(count) - count
    rank = np.empty(len(order))
    rank[order] = (np.arange(len(order)) - first[level[order]] + 0.5) / count[level[order]]
    ranked = alpha.ravel()[order]
    n, a = alpha.shape
    # mirrored at the strip's edges, as often as it takes
    rows = (n - 1) - np.abs((along + 0 * across) % (2 * (n - 1)) - (n - 1)) if n > 1 else 0 * across
    columns = (a - 1) - np.abs(across % (2 * (a - 1)) - (a - 1)) if a > 1 else 0 * across
    grain = look(rank.reshape(n, a), rows, columns, 0)
    # between two levels of tone, texels take one or the other: a blend of two grains is grey
    place = np.clip(look(tone) * TONES - 0.5, 0, TONES - 1)
    which = np.minimum(place + (grain * 7919.0) % 1.0, TONES - 1).astype(np.int64)
    filled = np.flatnonzero(count)
    which = filled[np.abs(filled[None] - np.arange(TONES)[:, None]).argmin(axis=1)][which]
    return ranked[first[which] + np.minimum((grain * count[which]).astype(np.int64), count[which] - 1)]


def _profile(strokes: Strokes, i: int, margin: float):
    """Arc length, half width of the ribbon and thickness at the points of stroke i, each (n,)."""
    rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
    xy = strokes.xy[rows]
    return arc_length(xy, np.array([0, len(xy)])), half_widths(strokes, i, margin), strokes.thickness[rows]
