"""Edits of a drawing: each takes a Drawing and gives another, and the texture follows the strokes.

The paper's figure of edits: thickness rescaled, wiggliness added, control points moved. `only` (C,) bool, of every
function that has it, says which strokes are meant; None: all. A stroke that an edit leaves as it is stays so to the
last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.curves import arc_length, blurred, counting, take_ragged, tangents
from ..geometry.curves import simplify as kept_points
from ..geometry.parts import Pieces
from .strip import carried_strip, strip_columns, strip_of_piece, wider
from .strokes import Drawing, Strokes, Texture

STEP = 3.0  # px between the points of a line that is drawn anew
SHARP = 50.0  # degrees; where a simplified line turns by more, it keeps its corner
MAX_LENGTH = 1_000_000  # px of a stroke's length that edits resample


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
    check_range("factor", factor, 0.0, 1000.0)
    if factor == 1.0:
        return drawing
    return _reshape(
        drawing, lambda line: Reshaped(line.xy, line.thickness * factor, line.was), only
    )


def wiggle(
    drawing: Drawing,
    amplitude: float,
    wavelength: float,
    seed: int = 0,
    only: np.ndarray | None = None,
) -> Drawing:
    """Points displaced across their stroke by smooth noise; the ends of an open stroke stay where they are.

    Parameters
    ----------
    amplitude : px, the most by which a point strays
    wavelength : px of arc length from crest to crest, on average
    seed : the same seed and order of strokes give the same noise
    """
    check_range("amplitude", amplitude, 0.0, 1e4)
    check_range("wavelength", wavelength, 0.5, 1e5)
    if amplitude == 0.0:
        return drawing

    def edit(line):
        line = _evenly(line, min(STEP, wavelength / 8))
        s = arc_length(line.xy, np.array([0, len(line.xy)]))
        noise = _noise(s, wavelength, line.closed, seed, line.index)
        if (
            not line.closed
        ):  # nothing at the ends, in full from a third of the way between crests on
            rise = np.clip(np.minimum(s, s[-1] - s) / min(wavelength / 3, s[-1] / 2), 0, 1)
            noise *= rise * rise * (3 - 2 * rise)
        t = tangents(
            _smoothed(line.xy, s, wavelength / 8, line.closed), *_one(line.xy, line.closed)
        )
        xy = line.xy + amplitude * noise[:, None] * np.stack([-t[:, 1], t[:, 0]], axis=1)
        return Reshaped(_shut(xy, line.closed), line.thickness, line.was)

    return _reshape(drawing, edit, only)


def smooth(drawing: Drawing, sigma: float, only: np.ndarray | None = None) -> Drawing:
    """Lines smoothed by a Gaussian of `sigma` px along them; the ends of an open stroke stay where they are."""
    check_range("sigma", sigma, 0.0, 1e4)
    if sigma == 0.0:
        return drawing

    def edit(line):
        line = _evenly(line, min(STEP, max(sigma / 2, 0.25)))
        s = arc_length(line.xy, np.array([0, len(line.xy)]))
        return Reshaped(
            _shut(_smoothed(line.xy, s, sigma, line.closed), line.closed), line.thickness, line.was
        )

    return _reshape(drawing, edit, only)


def simplify(drawing: Drawing, tolerance: float, only: np.ndarray | None = None) -> Drawing:
    """Lines drawn through as few of their points as keep them within `tolerance` px, curved between these.

    They pass through the points of Ramer-Douglas-Peucker as a centripetal Catmull-Rom spline, with corners where the
    line turns by more than SHARP.
    """
    check_range("tolerance", tolerance, 0.0, 1e4)
    if tolerance == 0.0:
        return drawing

    def edit(line):
        keep = kept_points(line.xy, tolerance)
        if line.closed and len(keep) < 4:  # a ring keeps its inside
            keep = np.unique(np.r_[0, len(line.xy) // 3, 2 * len(line.xy) // 3, len(line.xy) - 1])
        curve, place = _through(line.xy[keep], line.closed)
        along = np.interp(place, np.arange(len(keep)), keep)
        width = np.interp(along, np.arange(len(line.xy)), line.thickness)
        was = np.interp(along, np.arange(len(line.xy)), line.was)
        return Reshaped(_shut(curve, line.closed), width, was)

    return _reshape(drawing, edit, only)


def move(
    drawing: Drawing, stroke: int, point: float, by: tuple[float, float], reach: float | None = None
) -> Drawing:
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
        raise ValueError(f"there is no stroke {stroke}; the drawing has {len(drawing.strokes)}")
    check_range("point", point, 0.0, 1.0)
    for value in by:
        check_range("by", value, -1e6, 1e6)
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
    check_range("length", length, 0.0, 1e5)
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


def recolor(
    drawing: Drawing, color: tuple[float, float, float], only: np.ndarray | None = None
) -> Drawing:
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
            even = (
                np.square((strip[..., :3] - mean) * strip[..., 3:] / 255).sum() < 9.0 * weight / 255
            )
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
        ends = (
            pieces.rows[np.stack([pieces.offsets[:-1], pieces.offsets[1:] - 1], axis=1)]
            - old.offsets[of, None]
        )
        strips = [
            texture.rgba[texture.offsets[i] : texture.offsets[i + 1]]
            if pieces.whole[k]
            else strip_of_piece(drawing, i, strokes, k, *ends[k].tolist())
            for k, i in enumerate(of.tolist())
        ]
        texture = Texture(
            np.concatenate(strips), np.cumsum([0] + [len(s) for s in strips]), texture.margin[of]
        )
    return replace(
        drawing, strokes=strokes, color=drawing.color[of], texture=texture, parts=pieces.parts
    )


def keep(drawing: Drawing, index: np.ndarray) -> Drawing:
    """Only the strokes of an index or mask over C."""
    strokes, texture = drawing.strokes, drawing.texture
    index = np.arange(len(strokes))[np.asarray(index)]
    rows, offsets = take_ragged(strokes.offsets, index)
    kept = Strokes(
        strokes.xy[rows],
        strokes.thickness[rows],
        offsets,
        strokes.kind[index],
        strokes.closed[index],
    )
    if texture is not None:
        rows, offsets = take_ragged(texture.offsets, index)
        texture = Texture(texture.rgba[rows], offsets, texture.margin[index])
    parts = None if drawing.parts is None else drawing.parts.take(index)
    return replace(drawing, strokes=kept, color=drawing.color[index], texture=texture, parts=parts)


# ------------------------------------------------------------------------------------------------------ lines, anew


@dataclass(frozen=True)
class _Line:
    """A stroke that is being edited; `was` as in Reshaped."""

    index: int
    xy: np.ndarray
    thickness: np.ndarray
    was: np.ndarray
    closed: bool


def check_range(what: str, value: float, low: float, high: float) -> None:
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
    return _Line(
        line.index,
        xy,
        np.interp(at, index, line.thickness),
        np.interp(at, index, line.was),
        line.closed,
    )


def _smoothed(xy, s, sigma, closed):
    """Points (n, 2) at arc lengths s, smoothed by a Gaussian of sigma px; open lines keep their ends."""
    if s[-1] < 1e-9:
        return xy.copy()
    count = int(np.clip(np.ceil(s[-1] / max(sigma / 4, 1e-3)), 8, 20_000))
    at = np.linspace(0.0, s[-1], count + 1)
    even = np.stack([np.interp(at, s, column) for column in xy.T], axis=1)
    even = blurred(even, sigma * count / s[-1], closed)
    return np.stack([np.interp(s, at, column) for column in even.T], axis=1)


def hash_noise(seed: int, stroke: int, count: int) -> np.ndarray:
    """Numbers in [0, 1), (count,), that depend on a seed and a stroke's number only, and that the page draws as well:
    a counter through the finaliser of MurmurHash3."""

    def mixed(h):
        h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
        h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
        return h ^ (h >> np.uint32(16))

    with np.errstate(over="ignore"):
        start = mixed(mixed(np.array([seed & 0xFFFFFFFF], np.uint32)) ^ np.uint32(stroke))
        return (
            mixed(start + np.arange(1, count + 1, dtype=np.uint32) * np.uint32(0x9E3779B9))
            / 2.0**32
        )


def _noise(s, wavelength, closed, seed, stroke):
    """Smooth noise in [-1, 1] at arc lengths s: random heights of alternating sign, half a wavelength apart."""
    count = max(2 if closed else 1, round(2 * s[-1] / wavelength))
    if closed:
        count += count % 2
    *heights, sign, shift = hash_noise(seed, stroke, count + 5)
    height = (
        (0.45 + 0.55 * np.array(heights))
        * np.where(np.arange(count + 3) % 2, 1, -1)
        * (-1 if sign < 0.5 else 1)
    )
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
    before, after = (
        (xy[-2:-1], xy[1:2]) if closed else (2 * xy[:1] - xy[1:2], 2 * xy[-1:] - xy[-2:-1])
    )
    p = np.concatenate([before, xy, after])
    gap = np.sqrt(np.maximum(np.hypot(*np.diff(p, axis=0).T), 1e-9))[:, None]
    slope = np.diff(p, axis=0) / gap
    tangent = (slope[:-1] * gap[1:] + slope[1:] * gap[:-1]) / (gap[:-1] + gap[1:])  # at each of xy
    heading = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
    sharp = (np.abs(np.diff(heading)) > np.radians(SHARP))[:, None]
    leave, arrive = (
        np.where(sharp, slope[1:], tangent)[:-1],
        np.where(sharp, slope[:-1], tangent)[1:],
    )
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


def _reshape(
    drawing: Drawing, edit: Callable[[_Line], Reshaped | None], only: np.ndarray | None
) -> Drawing:
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
        columns = strip_columns(drawing, new, was)
        strips = [
            carried_strip(drawing, new, i, was[i], columns)
            if i in was
            else wider(texture.rgba[texture.offsets[i] : texture.offsets[i + 1]], columns)
            for i in range(len(strokes))
        ]
        ends = np.cumsum([0] + [len(strip) for strip in strips])
        texture = Texture(np.concatenate(strips), ends, texture.margin) if strips else texture
    made = replace(drawing, strokes=new, texture=texture)
    # what was not edited is written as it was, even where its strip has more columns now
    kept = {
        made.digest(i): drawing.art.get(drawing.digest(i))
        for i in range(len(new))
        if drawing.art and i not in was
    }
    return replace(made, art={key: stroke for key, stroke in kept.items() if stroke})
