"""A stroke's texture strip: resampled, cut, and carried along when the stroke is edited."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import arc
from .ribbon import across, slope_limited_half_widths
from .strokes import Strokes, Texture

OVERLAP = 0.25  # px by which the pieces of a stroke that was cut lie over each other
MAX_COLUMNS = 256  # texels across a strip
MAX_STRETCH = 1.3  # the most by which texels, and the grain in them, are stretched
MAX_RATIO = 20.0  # a stroke that grew or shrank by more times counts as by so many
TONE_BLUR = 15.0  # px along a stroke: sigma of the blur that tells tone from grain
TONE_LEVELS = 24  # levels of tone, each with a grain of its own


def premultiplied(rgba: np.ndarray, full: float = 1.0) -> np.ndarray:
    """Multiply colours (..., 4) of straight alpha by it; an alpha of `full` is opaque."""
    out = rgba.copy()
    out[..., :3] *= rgba[..., 3:] / full
    return out


def straight(rgba: np.ndarray, full: float = 1.0, least: float = 1e-6) -> np.ndarray:
    """Divide premultiplied colours (..., 4) by their alpha, the inverse of `premultiplied`.

    An alpha below `least`, as a share of `full`, counts as `least`: its colour means nothing.
    """
    out = rgba.copy()
    out[..., :3] /= np.maximum(rgba[..., 3:] / full, least)
    return out


def wider(strip: np.ndarray, columns: int) -> np.ndarray:
    """Resample a strip (n, A, 4) uint8 bilinearly to more columns: (n, columns, 4) uint8."""
    if strip.shape[1] == columns:
        return strip
    if strip.shape[1] == 1:
        return np.repeat(strip, columns, axis=1)
    flat = premultiplied(strip.astype(np.float64), 255.0)
    low, fraction = texel_places(columns, strip.shape[1])
    flat = flat[:, low] * (1 - fraction)[:, None] + flat[:, low + 1] * fraction[:, None]
    return np.rint(np.clip(straight(flat, 255.0), 0, 255)).astype(np.uint8)


def texel_places(fine: int, coarse: int) -> tuple[np.ndarray, np.ndarray]:
    """Find between which two of `coarse` texels each of `fine` lies, both rows being equally long.

    Returns
    -------
    the lower of the two (fine,) int, and how far it is to the upper (fine,) in [0, 1]
    """
    at = np.clip((np.arange(fine) + 0.5) / fine * coarse - 0.5, 0, coarse - 1)
    low = np.minimum(at.astype(np.int64), coarse - 2)
    return low, at - low


@dataclass(frozen=True)
class _Profile:
    """A stroke as its strip sees it; arrays are at the points of its centre line.

    Parameters
    ----------
    along : (n,) px of arc length
    half : (n,) px, half width of the ribbon
    thickness : (n,) px
    closed : bool
    """

    along: np.ndarray
    half: np.ndarray
    thickness: np.ndarray
    closed: bool

    @classmethod
    def of(cls, strokes: Strokes, i: int, margin: float) -> _Profile:
        rows = strokes.rows(i)
        half = slope_limited_half_widths(strokes, i, margin)
        return cls(arc(strokes.xy[rows]), half, strokes.thickness[rows], bool(strokes.closed[i]))

    @property
    def caps(self) -> tuple[float, float]:
        """How far the ribbon runs on past the first and the last point, px."""
        return (0.0, 0.0) if self.closed else (float(self.half[0]), float(self.half[-1]))

    @property
    def length(self) -> float:
        """Of the ribbon, px; above 0."""
        return max(float(self.along[-1]) + sum(self.caps), 1e-6)


def strip_of_piece(
    old: Strokes, texture: Texture, i: int, new: Strokes, k: int, first: int, last: int
) -> np.ndarray:
    """Cut the strip of a piece from that of its stroke: what lay there, nothing past the cuts.

    Parameters
    ----------
    old, texture, i : the stroke that was cut, and its texture
    new, k : the piece, a stroke of its own
    first, last : the points of stroke i that the piece begins and ends with

    Returns
    -------
    (n, A, 4) uint8
    """
    margin, strip = float(texture.margin[i]), texture.strip(i)
    whole, piece = _Profile.of(old, i, margin), _Profile.of(new, k, margin)
    rate = len(strip) / whole.length  # rows a px
    ends = whole.caps[0] + whole.along[[first, last]] + [-OVERLAP, OVERLAP]
    begin, end = np.rint(ends * rate).astype(np.int64)
    caps = np.rint((piece.half[[0, -1]] - OVERLAP) * rate).astype(np.int64)
    if first == 0 and not whole.closed:
        begin, caps[0] = 0, 0
    if last == len(whole.along) - 1 and not whole.closed:
        end, caps[1] = len(strip), 0
    kept = strip[max(begin, 0) : max(end, begin + 2)]
    clear = kept * np.array([1, 1, 1, 0], np.uint8)
    before, after = np.maximum(caps, 0).tolist()
    return np.concatenate([clear[:1].repeat(before, 0), kept, clear[-1:].repeat(after, 0)])


def strip_columns(old: Strokes, texture: Texture, new: Strokes, changed: list[int]) -> int:
    """Count the texels that must lie across new strips, whose strokes are `changed` old ones.

    More than before where a stroke became so much thicker that its texels would show.
    """
    columns, most = texture.rgba.shape[1], 1.0
    for i in changed:
        before, after = (
            slope_limited_half_widths(strokes, i, float(texture.margin[i])).max()
            for strokes in (old, new)
        )
        most = max(most, after / max(before, 1e-9))
    return columns if most < MAX_STRETCH else min(int(np.ceil(columns * most)), MAX_COLUMNS)


# ------------------------------------------------------------------------------- carried along


def carried_strip(
    old: Strokes, texture: Texture, new: Strokes, i: int, was: np.ndarray, columns: int
) -> np.ndarray:
    """Lay the strip of a stroke on the stroke that was made of it.

    Along the stroke, tone and ink lie by the point where they lay; across it, they are stretched
    with the thickness, but for the soft edge beyond it. Grain keeps its own scale: where it would
    be stretched by more than MAX_STRETCH, it is laid anew.

    Parameters
    ----------
    old, texture, new : strokes before and after, and the texture of those before
    i : index of the stroke in both
    was : (n,) float, which point of the old stroke each point of the new one was, rising
    columns : texels across the new strip

    Returns
    -------
    (rows, columns, 4) uint8, with as many rows a px as the old strip has
    """
    margin = float(texture.margin[i])
    strip = premultiplied(texture.strip(i) / 255.0)
    before, after = _Profile.of(old, i, margin), _Profile.of(new, i, margin)
    carry = _Carry.between(before, after, was, strip.shape[0])
    away = np.abs(across(columns)) * carry.new_half
    was_away = carry.distance_before(away, margin)
    look = _LookUp(strip.shape[0], strip.shape[1], before.closed)
    side = np.sign(across(columns))
    column = look.column(side * was_away, carry.old_half)
    made = look.at_all(strip, carry.row, column)
    if carry.is_stretched():
        # grain may come to lie where there was no ink: its colour is that of the ink around
        ink = look.at_all(_ink_around(strip, carry), carry.row, column)
        grained = look.column(side * away / _mild(carry.ratio), carry.old_half)
        made[..., 3] = _alpha_with_own_grain(strip[..., 3], carry, look, column, grained)
        made[..., :3] = ink * made[..., 3:]
    made *= carry.share_seen(was_away, strip.shape[1])[..., None]
    return np.rint(np.clip(straight(made), 0, 1) * 255).astype(np.uint8)


def _mild(ratio: np.ndarray) -> np.ndarray:
    return np.clip(ratio, 1 / MAX_STRETCH, MAX_STRETCH)


@dataclass(frozen=True)
class _Carry:
    """Where the rows R of a new strip come from in the old one, and how the stroke changed there.

    Parameters
    ----------
    row : (R,) row of the old strip, as a float
    old_half, new_half : (R, 1) px, half widths of the ribbons
    old_width, new_width : (R,) px, thickness
    old_rows : how many the old strip has
    old_length, new_length : px, of the ribbons
    """

    row: np.ndarray
    old_half: np.ndarray
    new_half: np.ndarray
    old_width: np.ndarray
    new_width: np.ndarray
    old_rows: int
    old_length: float
    new_length: float

    @classmethod
    def between(cls, old: _Profile, new: _Profile, was: np.ndarray, old_rows: int) -> _Carry:
        """`was` (n,) says which point of the old stroke each point of the new one was."""
        rows = max(2, round(old_rows * new.length / old.length))
        at = (np.arange(rows) + 0.5) / rows * new.length - new.caps[0]  # px from the first point
        # the same point of the stroke; in a cap, the same share of it
        place = np.interp(np.interp(at, new.along, was), np.arange(len(old.along)), old.along)
        place = np.where(at < 0, at / max(new.caps[0], 1e-9) * old.caps[0], place)
        past = (at - new.along[-1]) / max(new.caps[1], 1e-9) * old.caps[1]
        place = np.where(at > new.along[-1], old.along[-1] + past, place)
        return cls(
            row=(place + old.caps[0]) / old.length * old_rows - 0.5,
            old_half=np.interp(place, old.along, old.half)[:, None],
            new_half=np.interp(at, new.along, new.half)[:, None],
            old_width=np.interp(place, old.along, old.thickness),
            new_width=np.interp(at, new.along, new.thickness),
            old_rows=old_rows,
            old_length=old.length,
            new_length=new.length,
        )

    @property
    def ratio(self) -> np.ndarray:
        """How many times as thick the stroke became, (R, 1)."""
        old, new = self.old_width, self.new_width
        return np.where(old > 1e-6, new / np.maximum(old, 1e-6), 1.0)[:, None]

    @property
    def rate(self) -> np.ndarray:
        """Px of the old stroke a px of the new one, (R,)."""
        rows = len(self.row)
        if rows < 3:
            return np.ones(rows)
        a_px = np.gradient(self.row) * (self.new_length / rows) ** -1  # rows of the old strip
        return a_px * (self.old_length / self.old_rows)

    def distance_before(self, away: np.ndarray, margin: float) -> np.ndarray:
        """How far from the old centre line lay what is `away` px from the new one, (R, columns).

        Ink is stretched by how much thicker the stroke became; its soft edge stays as wide.
        """
        ratio, core = self.ratio, np.maximum(self.old_half - margin, 0.0)
        stretched = away / np.maximum(ratio, 1e-9)
        return np.where(away <= core * ratio, stretched, core + away - core * ratio)

    def share_seen(self, was_away: np.ndarray, old_columns: int) -> np.ndarray:
        """The part of each texel that there is, (R, columns): nothing past the old ribbon's edge.

        A stroke that is brought to nothing fades over its last px of thickness.
        """
        within = np.clip(self.old_half - was_away + self.old_half / old_columns, 0, 1)
        whole = np.maximum(np.minimum(self.old_width, 1.0), 1e-6)
        return within * np.clip(self.new_width / whole, 0, 1)[:, None]

    def is_stretched(self) -> bool:
        """Whether grain would be stretched by more than MAX_STRETCH somewhere, either way."""
        ratio = np.clip(self.ratio[self.old_width > 0.5], 1 / MAX_RATIO, MAX_RATIO)
        by = np.r_[self.rate, 1 / ratio[:, 0], 1.0]
        return bool(by.min() < 1 / MAX_STRETCH or by.max() > MAX_STRETCH)


@dataclass(frozen=True)
class _LookUp:
    """Values of an old strip's layers between its texels.

    Parameters
    ----------
    rows, columns : of the strip
    wraps : its last row is followed by its first
    """

    rows: int
    columns: int
    wraps: bool

    def column(self, away: np.ndarray, half: np.ndarray) -> np.ndarray:
        """The column, as a float, of what lies `away` px from the centre line of a ribbon."""
        return (away / np.maximum(half, 1e-9) + 1) * 0.5 * self.columns - 0.5

    def at(
        self, layer: np.ndarray, row: np.ndarray, column: np.ndarray, order: int = 1
    ) -> np.ndarray:
        """A layer (rows, columns) at places of one shape; by the nearest texel where order is 0."""
        from scipy import ndimage

        row = row if self.wraps else np.clip(row, 0, self.rows - 1)
        places = [row, np.clip(column, 0, self.columns - 1)]
        mode = "grid-wrap" if self.wraps else "nearest"
        return ndimage.map_coordinates(layer, places, order=order, mode=mode)

    def at_all(self, layers: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Layers (rows, columns, L) at rows (R,) and columns (R, A): (R, A, L)."""
        row = np.broadcast_to(row[:, None], column.shape)
        made = [self.at(layers[..., k], row, column) for k in range(layers.shape[-1])]
        return np.stack(made, axis=-1)


def _ink_around(strip: np.ndarray, carry: _Carry) -> np.ndarray:
    """Colour of the ink (rows, columns, 3) about each texel of a premultiplied strip."""
    from scipy import ndimage

    sigma = (2.0 * carry.old_rows / carry.old_length, 1.0, 0)
    near = ndimage.gaussian_filter(strip, sigma) + 1e-4 * strip.mean(axis=(0, 1))
    return straight(near, least=1e-9)[..., :3]


def _alpha_with_own_grain(
    alpha: np.ndarray, carry: _Carry, look: _LookUp, column: np.ndarray, grained: np.ndarray
) -> np.ndarray:
    """Opacity (R, columns) of stretched tone with grain that is not stretched.

    A texel's grain is its rank among the texels of about its tone, tone the mean opacity along the
    stroke around it. Where the tone goes to, the grain of another place is given the opacity that
    its rank has there.

    Parameters
    ----------
    alpha : (n, A) opacity of the old strip
    column : (R, columns) where its tone is read
    grained : (R, columns) where its grain is read across the stroke, stretched but a little
    """
    from scipy import ndimage

    # across, opacity has a shape: what is uneven there is no grain
    sigma = (TONE_BLUR * carry.old_rows / carry.old_length, 1.0)
    tone = ndimage.gaussian_filter(
        alpha, sigma, mode=("wrap" if look.wraps else "nearest", "constant")
    )
    ranks = _Ranks.of(alpha, tone)
    new_pitch, old_pitch = carry.new_length / len(carry.row), carry.old_length / carry.old_rows
    along = np.cumsum(_mild(carry.rate)) * new_pitch / old_pitch
    rows = _mirrored(along[:, None] + 0 * grained, look.rows)
    grain = look.at(ranks.rank, rows, _mirrored(grained, look.columns), 0)
    tone = look.at(tone, np.broadcast_to(carry.row[:, None], column.shape), column)
    return ranks.alpha_of(tone, grain)


def _mirrored(at: np.ndarray, count: int) -> np.ndarray:
    """Places beyond a row of `count` texels, mirrored at its ends as often as it takes."""
    last = count - 1
    return last - np.abs(at % (2 * last) - last) if last else 0 * at


@dataclass(frozen=True)
class _Ranks:
    """The opacities of a strip sorted within each of TONE_LEVELS levels of tone.

    Parameters
    ----------
    rank : (n, A) in (0, 1), the place of each texel in its level
    alpha : (n A,) opacities by level, then rising
    first, count : (TONE_LEVELS,) where each level begins in `alpha`, and how many it holds
    """

    rank: np.ndarray
    alpha: np.ndarray
    first: np.ndarray
    count: np.ndarray

    @classmethod
    def of(cls, alpha: np.ndarray, tone: np.ndarray) -> _Ranks:
        level = np.minimum((tone * TONE_LEVELS).astype(np.int64), TONE_LEVELS - 1).ravel()
        order = np.lexsort((alpha.ravel(), level))
        count = np.bincount(level, minlength=TONE_LEVELS)
        first = np.cumsum(count) - count
        own = level[order]
        rank = np.empty(len(order))
        rank[order] = (np.arange(len(order)) - first[own] + 0.5) / count[own]
        return cls(rank.reshape(alpha.shape), alpha.ravel()[order], first, count)

    def alpha_of(self, tone: np.ndarray, grain: np.ndarray) -> np.ndarray:
        """The opacities that grain, a rank, has at a tone; at a level without texels, at the next.

        Between two levels of tone texels take one or the other, by a number that depends on their
        grain alone: a blend of two grains would be grey.
        """
        place = np.clip(tone * TONE_LEVELS - 0.5, 0, TONE_LEVELS - 1)
        level = np.minimum(place + (grain * 7919.0) % 1.0, TONE_LEVELS - 1).astype(np.int64)
        filled = np.flatnonzero(self.count)
        nearest = np.abs(filled[None] - np.arange(TONE_LEVELS)[:, None]).argmin(axis=1)
        level = filled[nearest][level]
        step = (grain * self.count[level]).astype(np.int64)
        return self.alpha[self.first[level] + np.minimum(step, self.count[level] - 1)]
