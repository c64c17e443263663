"""Strokes, Texture and Drawing: centre lines with thickness, and what fills them.

Also the order in which strokes are painted, and the signed distance to a stroke.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..geometry.curves import CACHED, KINDS, arc_length, check_offsets
from ..geometry.kinds import PRIORITY
from ..geometry.parts import Parts

MAX_MARGIN = 1000.0  # px
SAME_POINT = 1e-6  # px; nearer neighbours on a centre line are one point


@dataclass(frozen=True)
class Strokes:
    """Centre lines with a thickness at every point.

    Parameters
    ----------
    xy : (N, 2) float64, pixels
    thickness : (N,) float64, full width in pixels, >= 0
    offsets : (C+1,) int64, stroke i is rows offsets[i]:offsets[i+1], at least two
    kind : (C,) int8, index into curves.KINDS
    closed : (C,) bool; a closed stroke repeats its first point as its last

    Raises
    ------
    ValueError
        on a wrong shape, a value that is not finite, or a negative thickness.
    """

    xy: np.ndarray
    thickness: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    closed: np.ndarray

    def __post_init__(self) -> None:
        xy = np.asarray(self.xy, np.float64)
        thickness = np.asarray(self.thickness, np.float64)
        offsets = np.asarray(self.offsets, np.int64)
        kind, closed = np.asarray(self.kind, np.int8), np.asarray(self.closed, bool)
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise ValueError(f"Strokes.xy must have shape (N, 2), got {xy.shape}")
        if thickness.shape != (len(xy),):
            raise ValueError(
                f"Strokes.thickness must have shape ({len(xy)},), got {thickness.shape}"
            )
        if not (np.isfinite(xy).all() and np.isfinite(thickness).all()):
            raise ValueError("Strokes holds values that are not finite")
        if len(thickness) and thickness.min() < 0:
            raise ValueError(f"Strokes.thickness must not be negative, got {thickness.min():g}")
        check_offsets(offsets, len(xy), 2, "Strokes")
        count = len(offsets) - 1
        if kind.shape != (count,) or closed.shape != (count,):
            raise ValueError(
                f"Strokes.kind and .closed must have shape ({count},), "
                f"got {kind.shape} and {closed.shape}"
            )
        if count and not (0 <= kind.min() and kind.max() < len(KINDS)):
            raise ValueError(f"Strokes.kind must lie in 0..{len(KINDS) - 1}")
        for name, value in zip(
            ("xy", "thickness", "offsets", "kind", "closed"),
            (xy, thickness, offsets, kind, closed),
            strict=True,
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def rows(self, i: int) -> slice:
        """The rows of `xy` and `thickness` that are stroke i."""
        return slice(self.offsets[i], self.offsets[i + 1])

    @cached_property
    def ribbons(self) -> dict[tuple[int, float], Any]:
        """The ribbons that `ribbon.ribbon` has made, by stroke and margin."""
        return {}

    @classmethod
    def empty(cls) -> Strokes:
        """No strokes at all."""
        none = np.zeros(0)
        return cls(np.zeros((0, 2)), none, np.zeros(1, np.int64), none, none)


@dataclass(frozen=True)
class Texture:
    """One strip of colours per stroke, in the stroke's own u-v space.

    Row r of a strip of n lies at u = (r + 1/2) / n, the normalised arc length of the stroke's
    ribbon: its centre line, run straight on past both ends of an open stroke by the half width
    there, so that caps are texture like the rest. Column a of A lies across the ribbon at
    v = (2 a + 1) / A - 1, which is v times the half width along the normal (-t_y, t_x) of the
    tangent t. That half width is `ribbon.slope_limited_half_widths`: half the thickness, kept from
    narrowing abruptly, plus the margin.

    Parameters
    ----------
    rgba : (T, A, 4) uint8, straight alpha; strip i is rows offsets[i]:offsets[i+1]
    offsets : (C+1,) int64
    margin : (C,) float64, or one for all: pixels beyond the half thickness that each strip
        reaches, so that soft edges are not cut
    opacities : (C, 256), how often each level of opacity occurs in what the tones of a stroke are
        chosen for: its track in all frames of an animation; None: its own strip

    Raises
    ------
    ValueError
        on a wrong shape or type, or a margin that is negative or above MAX_MARGIN.
    """

    rgba: np.ndarray
    offsets: np.ndarray
    margin: np.ndarray
    opacities: np.ndarray | None = None

    def __post_init__(self) -> None:
        rgba, offsets = np.asarray(self.rgba), np.asarray(self.offsets, np.int64)
        if rgba.ndim != 3 or rgba.shape[2] != 4 or rgba.dtype != np.uint8 or rgba.shape[1] < 1:
            raise ValueError(
                f"Texture.rgba must be uint8 of shape (T, A, 4), got {rgba.dtype} {rgba.shape}"
            )
        check_offsets(offsets, len(rgba), 1, "Texture")
        margin = np.asarray(self.margin, np.float64)
        if margin.shape not in ((), (len(offsets) - 1,)):
            raise ValueError(
                f"Texture.margin must have shape ({len(offsets) - 1},), got {margin.shape}"
            )
        if not ((margin >= 0) & (margin <= MAX_MARGIN)).all():
            worst = margin.flat[np.abs(margin - 0.5 * MAX_MARGIN).argmax()]
            raise ValueError(
                f"Texture.margin must lie between 0 and {MAX_MARGIN:g} px, got {worst:g}"
            )
        if self.opacities is not None and self.opacities.shape != (len(offsets) - 1, 256):
            raise ValueError(
                f"Texture.opacities must have shape ({len(offsets) - 1}, 256), "
                f"got {self.opacities.shape}"
            )
        object.__setattr__(self, "rgba", rgba)
        object.__setattr__(self, "offsets", offsets)
        object.__setattr__(self, "margin", np.broadcast_to(margin, (len(offsets) - 1,)))

    def strip(self, i: int) -> np.ndarray:
        """The strip of stroke i, (n, A, 4) uint8."""
        return self.rgba[self.offsets[i] : self.offsets[i + 1]]


@dataclass(frozen=True)
class Drawing:
    """What `render` writes: strokes, the flat ink of each, and perhaps a texture.

    Raises ValueError on shapes that do not agree, and on colours outside [0, 1].

    Parameters
    ----------
    strokes : Strokes
    size : (width, height), pixels
    color : (C, 4) float64 in [0, 1], straight RGBA: the ink of a stroke where no texture is wanted
    texture : Texture with one strip per stroke, or None
    parts : the named part of the shape that each stroke belongs to, or None where it has but one
    track : what each stroke is called in all drawings of an animation, "" for one that is in no
        other; None where the drawing is of none
    """

    strokes: Strokes
    size: tuple[int, int]
    color: np.ndarray
    texture: Texture | None = None
    parts: Parts | None = None
    track: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        color = np.asarray(self.color, np.float64)
        if color.shape != (len(self.strokes), 4):
            raise ValueError(
                f"Drawing.color must have shape ({len(self.strokes)}, 4), got {color.shape}"
            )
        if color.size and not (np.isfinite(color).all() and color.min() >= 0 and color.max() <= 1):
            raise ValueError("Drawing.color must lie between 0 and 1")
        if self.texture is not None and len(self.texture.offsets) != len(self.strokes) + 1:
            raise ValueError(
                f"Drawing.texture has {len(self.texture.offsets) - 1} strips "
                f"for {len(self.strokes)} strokes"
            )
        if self.parts is not None and len(self.parts) != len(self.strokes):
            raise ValueError(
                f"Drawing.parts must name the part of {len(self.strokes)} strokes, "
                f"not {len(self.parts)}"
            )
        if self.track is not None and len(self.track) != len(self.strokes):
            raise ValueError(
                f"Drawing.track must name the track of {len(self.strokes)} strokes, "
                f"not {len(self.track)}"
            )
        object.__setattr__(self, "color", color)
        object.__setattr__(self, "size", (int(self.size[0]), int(self.size[1])))


def lengths(drawing: Drawing) -> np.ndarray:
    """Arc length of each stroke, (C,) px."""
    strokes = drawing.strokes
    if not len(strokes):
        return np.zeros(0)
    return arc_length(strokes.xy, strokes.offsets)[strokes.offsets[1:] - 1]


def paint_order(drawing: Drawing, layers: str = "kind") -> np.ndarray:
    """Sort the strokes into the order of painting: indices (C,) from the first to the last.

    `rasterise` paints in this order, and the layers of an SVG lie in it. Kinds come from the least
    to the most important, so that contours lie on top; within a kind parts come in their order,
    what has no part's name beneath them; within a part strokes keep the order they are given in.
    With `layers` "part", parts come first, then the kinds within each.
    """
    return order_of_kinds(drawing.strokes.kind, drawing.parts, layers)


def order_of_kinds(kind: np.ndarray, parts: Parts | None, layers: str = "kind") -> np.ndarray:
    """Sort lines of the given kinds (C,) and parts into the order of painting, as `paint_order`."""
    rank = -np.array([PRIORITY.index(name) for name in KINDS])[kind]
    part = np.zeros(len(rank)) if parts is None else parts.index
    return np.lexsort((rank, part) if layers == "part" else (part, rank))


def merge_coincident_points(xy: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge neighbours on a centre line (n, 2) that coincide, with the largest of their radii (n,).

    Returns
    -------
    the first point of each cluster (m, 2), and the radii (m,)
    """
    apart = np.linalg.norm(np.diff(xy, axis=0), axis=1) > SAME_POINT
    if apart.all():
        return xy, np.maximum(radius, 0.0)
    cluster = np.r_[0, np.cumsum(apart)]
    largest = np.zeros(cluster[-1] + 1)
    np.maximum.at(largest, cluster, radius)
    return xy[np.r_[True, apart]], largest


def signed_distance(xy: np.ndarray, radius: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Measure the signed distance, (M,) px, from points (M, 2) to one stroke: negative inside.

    A stroke is the union of the discs along its centre line, with the radius linear along each
    segment; a segment is then a round cone, the convex hull of its two end discs. Every point is
    compared with every segment that may be nearest: this is the reference that faster ways are
    tested against.

    Parameters
    ----------
    xy : (n, 2) centre line, px
    radius : (n,) px, half the thickness
    points : (M, 2) px
    """
    xy, radius = merge_coincident_points(np.asarray(xy, np.float64), np.asarray(radius, np.float64))
    if len(xy) == 1:
        return np.linalg.norm(points - xy[0], axis=1) - radius[0]
    block = max(1, CACHED // len(xy))
    parts = [points[a : a + block] for a in range(0, len(points), block)]
    return np.concatenate([np.zeros(0), *(_block_distance(xy, radius, part) for part in parts)])


def _block_distance(xy: np.ndarray, radius: np.ndarray, points: np.ndarray) -> np.ndarray:
    """`signed_distance` of a few points (M, 2), from the segments that may be nearest to each."""
    at = xy - xy.mean(axis=0)
    middle, rel = 0.5 * (at[1:] + at[:-1]), points - xy.mean(axis=0)
    square = np.square(middle).sum(axis=1) - 2.0 * rel @ middle.T
    square += np.square(rel).sum(axis=1, keepdims=True)
    # the disc in the middle of a segment is in it, and no disc of it reaches farther than `more`
    away = np.sqrt(np.maximum(square, 0.0, out=square), out=square)
    away -= 0.5 * (radius[1:] + radius[:-1])
    more = 0.5 * np.hypot(*np.diff(xy, axis=0).T) + 0.5 * np.abs(np.diff(radius))
    most = away.min(axis=1, keepdims=True) + 1e-6 * max(np.abs(rel).max(), np.abs(at).max())
    point, segment = np.divmod(np.flatnonzero(away - more <= most), len(more))
    cones = stroke_segments(xy, radius, segment)
    distance = round_cone_distance(points[point] - xy[segment], *cones)
    return np.minimum.reduceat(distance, np.searchsorted(point, np.arange(len(points))))


def stroke_segments(
    xy: np.ndarray, radius: np.ndarray, k: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Describe segments k of a centre line as `round_cone_distance` takes them.

    Returns
    -------
    length (K,) px, unit direction (K, 2), radius at the first end (K,) px, and slope (K,): by how
    much the radius falls a px
    """
    d = xy[k + 1] - xy[k]
    length = np.hypot(d[..., 0], d[..., 1])
    return length, d / length[..., None], radius[k], (radius[k] - radius[k + 1]) / length


def round_cone_distance(
    rel: np.ndarray,
    length: np.ndarray,
    direction: np.ndarray,
    radius: np.ndarray,
    slope: np.ndarray,
) -> np.ndarray:
    """Measure the signed distance to round cones from points relative to the cones' first centres.

    The shape is Quilez's round cone. Its distance is the least over all discs along the axis: that
    to the disc at s, sqrt((x - s)^2 + y^2) - radius + slope s, is convex in s and smallest at
    x - s = y slope / sqrt(1 - slope^2). A slope beyond 1 means that one end disc holds the other.

    Parameters
    ----------
    rel : (..., 2) px
    length, direction, radius, slope : of `stroke_segments`, broadcast against `rel`

    Returns
    -------
    (...), px, negative inside
    """
    x = rel[..., 0] * direction[..., 0] + rel[..., 1] * direction[..., 1]
    y = np.abs(rel[..., 1] * direction[..., 0] - rel[..., 0] * direction[..., 1])
    tilt = np.clip(slope, -1 + 1e-12, 1 - 1e-12)
    s = np.clip(x - y * (tilt / np.sqrt(1 - tilt * tilt)), 0.0, length)
    s = np.where(np.abs(slope) < 1, s, np.where(slope > 0, 0.0, length))  # on the axis too
    return np.hypot(x - s, y) - radius + slope * s
