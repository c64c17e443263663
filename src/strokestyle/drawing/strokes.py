"""Strokes and Drawing: centre lines with thickness, the u-v texture that fills them, and their distance function."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

import numpy as np

from ..geometry.curves import KINDS, arc_length, check_offsets
from ..geometry.parts import Parts


def lengths(drawing: Drawing) -> np.ndarray:
    """Arc length of each stroke, (C,) px."""
    strokes = drawing.strokes
    return (
        arc_length(strokes.xy, strokes.offsets)[strokes.offsets[1:] - 1]
        if len(strokes)
        else np.zeros(0)
    )


MAX_MARGIN = 1000.0  # px


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

    def __post_init__(self):
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
                f"Strokes.kind and .closed must have shape ({count},), got {kind.shape} and {closed.shape}"
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


@dataclass(frozen=True)
class Texture:
    """One strip of colours per stroke, in the stroke's own u-v space.

    Parameters
    ----------
    rgba : (T, A, 4) uint8, straight alpha. Strip i is rows offsets[i]:offsets[i+1]; its row r of n lies at the
        normalised arc length u = (r + 1/2) / n of the ribbon: the centre line, run straight on past both ends of an
        open stroke by its half width there, so that its caps are texture like the rest. Column a of A lies across it at
        v = (2 a + 1) / A - 1, that is v times the ribbon's half width along the normal (-t_y, t_x) of the tangent t.
        That half width is `half_widths`: half the thickness, kept from narrowing abruptly, plus margin.
    offsets : (C+1,) int64
    margin : (C,) float64, or one for all: pixels beyond the half thickness that each strip reaches, so that soft edges
        are not cut
    """

    rgba: np.ndarray
    offsets: np.ndarray
    margin: np.ndarray

    def __post_init__(self):
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
        object.__setattr__(self, "rgba", rgba)
        object.__setattr__(self, "offsets", offsets)
        object.__setattr__(self, "margin", np.broadcast_to(margin, (len(offsets) - 1,)))


@dataclass(frozen=True)
class Drawing:
    """What `render` writes: strokes in painting order, the flat ink of each, and perhaps a texture.

    Parameters
    ----------
    strokes : Strokes
    size : (width, height), pixels
    color : (C, 4) float64 in [0, 1], straight RGBA: what a stroke looks like where no texture is wanted
    texture : Texture with one strip per stroke, or None
    parts : the named part of the shape that each stroke belongs to, or None where it has but one
    art : how the strokes of a file were drawn in it, and by which options, by their digests: what is read and not
        changed is written as it was
    """

    strokes: Strokes
    size: tuple[int, int]
    color: np.ndarray
    texture: Texture | None = None
    parts: Parts | None = None
    art: dict = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self):
        color = np.asarray(self.color, np.float64)
        if color.shape != (len(self.strokes), 4):
            raise ValueError(
                f"Drawing.color must have shape ({len(self.strokes)}, 4), got {color.shape}"
            )
        if color.size and not (np.isfinite(color).all() and color.min() >= 0 and color.max() <= 1):
            raise ValueError("Drawing.color must lie between 0 and 1")
        if self.texture is not None and len(self.texture.offsets) != len(self.strokes) + 1:
            raise ValueError(
                f"Drawing.texture has {len(self.texture.offsets) - 1} strips for {len(self.strokes)} strokes"
            )
        if self.parts is not None and len(self.parts) != len(self.strokes):
            raise ValueError(
                f"Drawing.parts must name the part of {len(self.strokes)} strokes, not {len(self.parts)}"
            )
        object.__setattr__(self, "color", color)
        object.__setattr__(self, "size", (int(self.size[0]), int(self.size[1])))

    def digest(self, i: int) -> bytes:
        """What stroke i is, by which `art` is kept."""
        strokes, texture = self.strokes, self.texture
        rows = slice(strokes.offsets[i], strokes.offsets[i + 1])
        parts = [strokes.xy[rows], strokes.thickness[rows], self.color[i]]
        if texture is not None:
            parts += [texture.rgba[texture.offsets[i] : texture.offsets[i + 1]], texture.margin[i]]
        made = hashlib.blake2b(
            repr((int(strokes.kind[i]), bool(strokes.closed[i]))).encode(), digest_size=16
        )
        for part in parts:
            made.update(repr(part.shape).encode() + np.ascontiguousarray(part).tobytes())
        return made.digest()


def paint_order(drawing: Drawing, layers: str = "kind") -> np.ndarray:
    """Indices (C,) from the first stroke painted to the last, as `rasterise` paints and the SVG's layers lie.

    Kinds come from the least to the most important, so that contours lie on top; of one kind the parts, those without
    a name beneath; of one part strokes as given. `layers` "part": parts first, then their kinds.
    """
    kind = -drawing.strokes.kind.astype(np.int64)
    part = np.zeros(len(kind)) if drawing.parts is None else drawing.parts.index
    return np.lexsort((kind, part) if layers == "part" else (part, kind))


def merge_coincident_points(xy: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A centre line (n, 2) and its radii (n,) without points that coincide; the widest of each heap stays."""
    step = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    heap = np.r_[0, np.cumsum(step > 1e-6)]
    widest = np.zeros(heap[-1] + 1)
    np.maximum.at(widest, heap, radius)
    return xy[np.r_[True, step > 1e-6]], widest


def signed_distance(xy: np.ndarray, radius: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distance (M,) from points (M, 2) to a stroke of centre line xy (n, 2) and radii (n,): negative inside.

    A stroke is the union of the discs along its centre line, radius linear along each segment; a segment is then a
    round cone, the convex hull of its two end discs. The reference: all points against all segments.
    """
    xy, radius = merge_coincident_points(np.asarray(xy, np.float64), np.asarray(radius, np.float64))
    if len(xy) == 1:
        return np.linalg.norm(points - xy[0], axis=1) - radius[0]
    nearest = np.full(len(points), np.inf)
    block = max(1, 2_000_000 // len(xy))
    index = np.arange(len(xy) - 1)
    for a in range(0, len(points), block):
        rel = points[a : a + block, None] - xy[None, :-1]
        nearest[a : a + block] = round_cone_distance(rel, *stroke_segments(xy, radius, index)).min(
            axis=1
        )
    return nearest


def stroke_segments(xy, radius, k):
    """Length, direction, first radius and slope of the radius of the segments k."""
    d = xy[k + 1] - xy[k]
    length = np.hypot(d[..., 0], d[..., 1])
    return length, d / length[..., None], radius[k], (radius[k] - radius[k + 1]) / length


def round_cone_distance(rel, length, direction, radius, slope):
    """Signed distance to round cones from points `rel` (..., 2) relative to the cones' first centres.

    The distance to the disc at s along the axis, sqrt((x - s)^2 + y^2) - radius + slope s, is convex in s and
    smallest at x - s = y slope / sqrt(1 - slope^2); a slope beyond 1 means that one end disc holds the other.
    """
    x = rel[..., 0] * direction[..., 0] + rel[..., 1] * direction[..., 1]
    y = np.abs(rel[..., 1] * direction[..., 0] - rel[..., 0] * direction[..., 1])
    tilt = np.clip(slope, -1 + 1e-12, 1 - 1e-12)
    s = np.clip(x - y * (tilt / np.sqrt(1 - tilt * tilt)), 0.0, length)
    s = np.where(np.abs(slope) < 1, s, np.where(slope > 0, 0.0, length))  # on the axis too
    return np.hypot(x - s, y) - radius + slope * s
