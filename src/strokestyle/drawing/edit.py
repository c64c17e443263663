"""Edits of a drawing: each takes a Drawing and gives another, and the texture follows the strokes.

The paper's figure of edits: thickness rescaled, wiggliness added, control points moved. `only`
(C,) bool, of every function that has it, says which strokes are meant; None: all. A stroke that an
edit leaves as it is stays so to the last bit. Every edit raises ValueError, by the name of the
argument, where a number is out of its range.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.curves import arc, blurred, counting, take_ragged, tangents
from ..geometry.curves import simplify as kept_points
from ..geometry.parts import Pieces
from .strip import carried_strip, strip_columns, strip_of_piece, wider
from .strokes import MAX_MARGIN, Drawing, Strokes, Texture

STEP = 3.0  # px between the points of a line that is drawn anew
CORNER = 50.0  # degrees; where a simplified line turns by more, it keeps its corner
MAX_LENGTH = 1_000_000  # px of a stroke's length that edits resample
NEAR_INK = 24.0  # of 255: a mean colour less far than this from a stroke's own is about that
EVEN_INK = 3.0  # of 255: a colour that varies by less, root mean square, is one colour


@dataclass(frozen=True)
class _Line:
    """A stroke that is being edited.

    Parameters
    ----------
    index : of the stroke
    xy : (n, 2) px
    thickness : (n,) px
    was : (n,) float, which point of the old stroke each point is: 2.5 lies half-way between points
        2 and 3; it rises
    closed : bool
    """

    index: int
    xy: np.ndarray
    thickness: np.ndarray
    was: np.ndarray
    closed: bool

    def moved(self, xy: np.ndarray) -> _Line:
        """The line with its points at `xy` (n, 2), a closed one still closed."""
        if self.closed:
            xy[-1] = xy[0]
        return replace(self, xy=xy)


_Edit = Callable[[_Line], "_Line | None"]  # None: the stroke stays as it is


# ----------------------------------------------------------------------------------- the edits


def thicken(drawing: Drawing, factor: float, only: np.ndarray | None = None) -> Drawing:
    """Multiply every thickness by `factor`."""
    check_range("factor", factor, 0.0, 1000.0)
    if factor == 1.0:
        return drawing
    return _reshape(drawing, lambda line: replace(line, thickness=line.thickness * factor), only)


def scale_across(drawing: Drawing, factor: float, only: np.ndarray | None = None) -> Drawing:
    """Multiply every thickness and margin by `factor`; strips stay as they are to the last texel.

    Grain is drawn out across strokes by the factor, where `thicken` would resample it, and so a
    factor and its inverse give what there was, as often as one likes.
    """
    check_range("factor", factor, 0.0, 1000.0)
    strokes, texture = drawing.strokes, drawing.texture
    each = np.full(len(strokes), factor) if only is None else np.where(only, factor, 1.0)
    if texture is not None:
        margin = np.minimum(each * texture.margin, MAX_MARGIN)
        texture = replace(texture, margin=margin)
    thickness = each.repeat(np.diff(strokes.offsets)) * strokes.thickness
    return replace(drawing, strokes=replace(strokes, thickness=thickness), texture=texture)


def wiggle(
    drawing: Drawing,
    amplitude: float,
    wavelength: float,
    seed: int = 0,
    only: np.ndarray | None = None,
) -> Drawing:
    """Displace points across their stroke by smooth noise; the ends of an open stroke stay.

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

    def edit(line: _Line) -> _Line:
        line = _densified(line, min(STEP, wavelength / 8))
        s = arc(line.xy)
        noise = _noise(s, wavelength, line, seed)
        if not line.closed:  # nothing at the ends, in full from a third of a wave on
            from_end = np.minimum(s, s[-1] - s)
            noise *= _smoothstep(np.clip(from_end / min(wavelength / 3, s[-1] / 2), 0, 1))
        course = _smoothed(line.xy, s, wavelength / 8, line.closed)
        t = tangents(course, np.array([0, len(s)]), np.array([line.closed]))
        normal = np.stack([-t[:, 1], t[:, 0]], axis=1)
        return line.moved(line.xy + amplitude * noise[:, None] * normal)

    return _reshape(drawing, edit, only)


def smooth(drawing: Drawing, sigma: float, only: np.ndarray | None = None) -> Drawing:
    """Smooth lines by a Gaussian of `sigma` px along them; the ends of an open stroke stay."""
    check_range("sigma", sigma, 0.0, 1e4)
    if sigma == 0.0:
        return drawing

    def edit(line: _Line) -> _Line:
        line = _densified(line, min(STEP, max(sigma / 2, 0.25)))
        return line.moved(_smoothed(line.xy, arc(line.xy), sigma, line.closed))

    return _reshape(drawing, edit, only)


def simplify(drawing: Drawing, tolerance: float, only: np.ndarray | None = None) -> Drawing:
    """Draw lines through as few of their points as keep them within `tolerance` px.

    Those are the points of Ramer-Douglas-Peucker; between them the lines are centripetal
    Catmull-Rom splines, with corners where they turn by more than CORNER.
    """
    check_range("tolerance", tolerance, 0.0, 1e4)
    if tolerance == 0.0:
        return drawing

    def edit(line: _Line) -> _Line:
        kept, last = kept_points(line.xy, tolerance), len(line.xy) - 1
        if line.closed and len(kept) < 4:  # a ring keeps its inside
            kept = np.unique(np.r_[0, (last + 1) // 3, 2 * (last + 1) // 3, last])
        curve, place = _catmull_rom(line.xy[kept], line.closed)
        along = np.interp(place, np.arange(len(kept)), kept)
        thickness, was = (
            np.interp(along, np.arange(last + 1), field) for field in (line.thickness, line.was)
        )
        return _Line(line.index, curve, thickness, was, line.closed).moved(curve)

    return _reshape(drawing, edit, only)


def move(
    drawing: Drawing, stroke: int, point: float, by: tuple[float, float], reach: float | None = None
) -> Drawing:
    """Move a point of a stroke, and its neighbours less the farther along the stroke they are.

    Parameters
    ----------
    stroke : index of the stroke
    point : where, as the share of the stroke's length: 0 its beginning, 1 its end
    by : px
    reach : px of arc length at which nothing moves any more; None: half the stroke's length, or as
        far as the point is moved

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

    def edit(line: _Line) -> _Line:
        line = _densified(line, STEP)
        s = arc(line.xy)
        far = max(0.5 * s[-1], float(np.hypot(*by))) if reach is None else reach
        away = np.abs(s - point * s[-1])
        if line.closed:
            far, away = min(far, 0.5 * s[-1]), np.minimum(away, s[-1] - away)
        share = _smoothstep(np.clip(1 - away / max(far, 1e-9), 0, 1))
        return line.moved(line.xy + share[:, None] * np.asarray(by, np.float64))

    return _reshape(drawing, edit, np.arange(len(drawing.strokes)) == stroke)


def taper(drawing: Drawing, length: float, only: np.ndarray | None = None) -> Drawing:
    """Bring open strokes to a point over `length` px from either end, or over half the stroke."""
    check_range("length", length, 0.0, 1e5)
    if length == 0.0:
        return drawing

    def edit(line: _Line) -> _Line | None:
        if line.closed:
            return None
        line = _densified(line, STEP)
        s = arc(line.xy)
        rise = np.clip(np.minimum(s, s[-1] - s) / max(min(length, 0.5 * s[-1]), 1e-9), 0, 1)
        return replace(line, thickness=line.thickness * np.sin(0.5 * np.pi * rise))

    return _reshape(drawing, edit, only)


def recolor(
    drawing: Drawing, color: tuple[float, float, float], only: np.ndarray | None = None
) -> Drawing:
    """Change the ink's colour to `color`, (r, g, b) in [0, 1], in texture too; opacity stays.

    An ink that varies goes on varying by as much, about the new colour.
    """
    only = np.ones(len(drawing.strokes), bool) if only is None else only
    wanted = np.asarray(color, np.float64)
    ink = drawing.color.copy()
    ink[only, :3] = wanted
    texture = drawing.texture
    if texture is not None:
        rgba = texture.rgba.copy()
        for i in np.flatnonzero(only).tolist():
            rows = slice(texture.offsets[i], texture.offsets[i + 1])
            new = recoloring(drawing, i, color)
            rgba[rows, :, :3] = new(rgba[rows, :, :3])
        texture = Texture(rgba, texture.offsets, texture.margin)
    return replace(drawing, color=ink, texture=texture)


def recoloring(
    drawing: Drawing, i: int, color: tuple[float, float, float]
) -> Callable[[np.ndarray], np.ndarray]:
    """Give how `recolor` changes each colour in the texture of stroke i.

    They move as one, so that the ink about which they vary becomes `color`. That is the stroke's
    own where their mean is near it: so one colour and the other again give what there was.

    Returns
    -------
    a function of colours (..., 3) uint8, which gives the new ones likewise
    """
    assert drawing.texture is not None  # asked of drawings with one
    strip = drawing.texture.strip(i).astype(np.float64)
    rgb, alpha = strip[..., :3], strip[..., 3:]
    weight = alpha.sum()
    mean = (rgb * alpha).sum(axis=(0, 1)) / max(weight, 1.0)
    even = np.square((rgb - mean) * alpha / 255).sum() < EVEN_INK**2 * weight / 255
    own = 255 * drawing.color[i, :3]
    ink = own if np.abs(own - mean).max() < NEAR_INK else mean
    wanted = 255 * np.asarray(color, np.float64)

    def new(colors: np.ndarray) -> np.ndarray:
        moved = np.broadcast_to(wanted, colors.shape) if even else colors + (wanted - ink)
        return np.rint(np.clip(moved, 0, 255)).astype(np.uint8)

    return new


def cut_at_parts(drawing: Drawing, pieces: Pieces) -> Drawing:
    """Cut strokes into pieces, each of one part of the shape; it looks as if they were whole."""
    old, of, texture = drawing.strokes, pieces.line, drawing.texture
    strokes = Strokes(
        old.xy[pieces.rows],
        old.thickness[pieces.rows],
        pieces.offsets,
        old.kind[of],
        old.closed[of] & pieces.whole,
    )
    if texture is not None and not pieces.whole.all():
        ends = pieces.rows[np.stack([pieces.offsets[:-1], pieces.offsets[1:] - 1], axis=1)]
        ends -= old.offsets[of, None]
        strips = [
            texture.strip(i)
            if pieces.whole[k]
            else strip_of_piece(old, texture, i, strokes, k, *ends[k].tolist())
            for k, i in enumerate(of.tolist())
        ]
        levels = None if texture.opacities is None else texture.opacities[of]
        texture = replace(_stacked(strips, texture.margin[of]), opacities=levels)
    return replace(
        drawing,
        strokes=strokes,
        color=drawing.color[of],
        texture=texture,
        parts=pieces.parts,
        track=_names_of_pieces(drawing.track, of),
    )


def _names_of_pieces(track: tuple[str, ...] | None, of: np.ndarray) -> tuple[str, ...] | None:
    """The tracks of pieces of strokes `of` (P,): "12", and the pieces after it "12.1", "12.2"."""
    if track is None:
        return None
    first = np.searchsorted(of, of)
    return tuple(
        track[i] if k == a or not track[i] else f"{track[i]}.{k - a}"
        for k, (i, a) in enumerate(zip(of.tolist(), first.tolist(), strict=True))
    )


def keep(drawing: Drawing, index: np.ndarray) -> Drawing:
    """Keep only the strokes of an index, or of a mask (C,)."""
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
        levels = None if texture.opacities is None else texture.opacities[index]
        texture = Texture(texture.rgba[rows], offsets, texture.margin[index], levels)
    parts = None if drawing.parts is None else drawing.parts.take(index)
    track = None if drawing.track is None else tuple(drawing.track[i] for i in index.tolist())
    return replace(
        drawing,
        strokes=kept,
        color=drawing.color[index],
        texture=texture,
        parts=parts,
        track=track,
    )


def check_range(what: str, value: float, low: float, high: float) -> None:
    """Raise ValueError, by the name `what`, where a value does not lie in [low, high]."""
    if not low <= value <= high:
        raise ValueError(f"{what} must lie between {low:g} and {high:g}, got {value:g}")


# --------------------------------------------------------------------------------- lines, anew


def _smoothstep(x: np.ndarray) -> np.ndarray:
    """3 x^2 - 2 x^3: from 0 to 1, level at both."""
    return x * x * (3 - 2 * x)


def _densified(line: _Line, spacing: float) -> _Line:
    """The line with points added so that none are more than `spacing` apart; its own stay."""
    step = np.hypot(*np.diff(line.xy, axis=0).T)
    if step.sum() > MAX_LENGTH:
        raise ValueError(f"a stroke {step.sum():.3g} px long is too long to be edited")
    pieces = np.maximum(np.ceil(step / spacing - 1e-9), 1).astype(np.int64)
    k = np.repeat(np.arange(len(step)), pieces)
    at = np.r_[k + counting(pieces) / pieces[k], len(step)]
    index = np.arange(len(line.xy))
    x, y, thickness, was = (
        np.interp(at, index, field) for field in (*line.xy.T, line.thickness, line.was)
    )
    return _Line(line.index, np.stack([x, y], axis=1), thickness, was, line.closed)


def _smoothed(xy: np.ndarray, s: np.ndarray, sigma: float, closed: bool) -> np.ndarray:
    """Points (n, 2) at arc lengths s (n,) under a Gaussian of sigma px; open lines keep ends."""
    if s[-1] < 1e-9:
        return xy.copy()
    count = int(np.clip(np.ceil(s[-1] / max(sigma / 4, 1e-3)), 8, 20_000))
    at = np.linspace(0.0, s[-1], count + 1)
    even = np.stack([np.interp(at, s, column) for column in xy.T], axis=1)
    even = blurred(even, sigma * count / s[-1], closed)
    return np.stack([np.interp(s, at, column) for column in even.T], axis=1)


def hash_noise(seed: int, stroke: int, count: int) -> np.ndarray:
    """Make numbers in [0, 1), (count,), that depend on a seed and a stroke's number only.

    A counter goes through the finaliser of MurmurHash3, which the viewer computes as well, so that
    both wiggle alike.
    """

    def mixed(h: np.ndarray) -> np.ndarray:
        h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
        h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
        return h ^ (h >> np.uint32(16))

    with np.errstate(over="ignore"):
        start = mixed(mixed(np.array([seed & 0xFFFFFFFF], np.uint32)) ^ np.uint32(stroke))
        counter = np.arange(1, count + 1, dtype=np.uint32) * np.uint32(0x9E3779B9)
        return mixed(start + counter) / 2.0**32


def _noise(s: np.ndarray, wavelength: float, line: _Line, seed: int) -> np.ndarray:
    """Smooth noise in [-1, 1] at arc lengths s (n,) of a line.

    It joins random heights of alternating sign, half a wavelength apart.
    """
    count = max(2 if line.closed else 1, round(2 * s[-1] / wavelength))
    if line.closed:
        count += count % 2
    *heights, sign, shift = hash_noise(seed, line.index, count + 5)
    crest = (0.45 + 0.55 * np.array(heights)) * np.where(np.arange(count + 3) % 2, 1, -1)
    crest *= -1 if sign < 0.5 else 1
    shift = 0.25 + 0.5 * shift  # so that crests are not all as far from the ends
    if line.closed:
        crest[-3:] = crest[:3]
        shift = 0.5
    place = s / max(s[-1], 1e-9) * count + shift
    k = np.minimum(place.astype(np.int64), count + 1)
    f = place - k
    return crest[k] + (crest[k + 1] - crest[k]) * f * f * (3 - 2 * f)


def _catmull_rom(xy: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """A curve through points (n, 2): its points about STEP apart, and where each lies, in points.

    Catmull and Rom 1974, centripetal (Yuksel et al. 2011) so that it neither loops nor overshoots.
    """
    pieces = np.maximum(np.ceil(np.hypot(*np.diff(xy, axis=0).T) / STEP), 1).astype(np.int64)
    if len(xy) < 3:
        t = np.linspace(0, 1, int(pieces[0]) + 1)
        return xy[0] + t[:, None] * (xy[-1] - xy[0]), t * (len(xy) - 1)
    gap, leave, arrive = _spline_slopes(xy, closed)
    k = np.repeat(np.arange(len(pieces)), pieces)
    f = counting(pieces) / pieces[k]
    t, h = f[:, None], gap[k]
    curve = (
        (2 * t**3 - 3 * t**2 + 1) * xy[k]
        + (t**3 - 2 * t**2 + t) * h * leave[k]
        + (3 * t**2 - 2 * t**3) * xy[k + 1]
        + (t**3 - t**2) * h * arrive[k]
    )
    return np.concatenate([curve, xy[-1:]]), np.r_[k + f, len(xy) - 1]


def _spline_slopes(xy: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The spline's parameter step (n - 1, 1), and its slope at both ends of each (n - 1, 2)."""
    if closed:
        before, after = xy[-2:-1], xy[1:2]
    else:
        before, after = 2 * xy[:1] - xy[1:2], 2 * xy[-1:] - xy[-2:-1]
    d = np.diff(np.concatenate([before, xy, after]), axis=0)
    gap = np.sqrt(np.maximum(np.hypot(*d.T), 1e-9))[:, None]
    slope = d / gap
    tangent = (slope[:-1] * gap[1:] + slope[1:] * gap[:-1]) / (gap[:-1] + gap[1:])  # at each of xy
    heading = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
    corner = (np.abs(np.diff(heading)) > np.radians(CORNER))[:, None]
    leave, arrive = np.where(corner, slope[1:], tangent), np.where(corner, slope[:-1], tangent)
    return gap[1:-1], leave[:-1], arrive[1:]


# ---------------------------------------------------------------------------- texture, carried


def _reshape(drawing: Drawing, edit: _Edit, only: np.ndarray | None) -> Drawing:
    """The drawing with an edit made to each stroke of `only`; where it gives None, that stays."""
    strokes = drawing.strokes
    only = np.ones(len(strokes), bool) if only is None else only
    lines = [_line(strokes, i) for i in range(len(strokes))]
    edited = {
        line.index: edit(line)
        for line in lines
        if only[line.index] and np.ptp(line.xy, axis=0).max() > 1e-6
    }
    was = {i: line.was for i, line in edited.items() if line is not None}
    lines = [edited.get(line.index) or line for line in lines]
    new = Strokes(
        np.concatenate([np.zeros((0, 2)), *(line.xy for line in lines)]),
        np.concatenate([np.zeros(0), *(line.thickness for line in lines)]),
        np.cumsum([0] + [len(line.xy) for line in lines]),
        strokes.kind,
        strokes.closed,
    )
    texture = drawing.texture
    if texture is not None and lines:
        texture = _carried(strokes, texture, new, was)
    return replace(drawing, strokes=new, texture=texture)


def _line(strokes: Strokes, i: int) -> _Line:
    rows = strokes.rows(i)
    xy = strokes.xy[rows]
    was = np.arange(len(xy), dtype=np.float64)
    return _Line(i, xy, strokes.thickness[rows], was, bool(strokes.closed[i]))


def _carried(old: Strokes, texture: Texture, new: Strokes, was: dict[int, np.ndarray]) -> Texture:
    """The texture on new strokes; `was` as in `_Line`, of those that changed."""
    columns = strip_columns(old, texture, new, list(was))
    strips = [
        carried_strip(old, texture, new, i, was[i], columns)
        if i in was
        else wider(texture.strip(i), columns)
        for i in range(len(old))
    ]
    return _stacked(strips, texture.margin)


def _stacked(strips: list[np.ndarray], margin: np.ndarray) -> Texture:
    """Strips (n, A, 4) of one width as a texture."""
    return Texture(np.concatenate(strips), np.cumsum([0] + [len(s) for s in strips]), margin)
