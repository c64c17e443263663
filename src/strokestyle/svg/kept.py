"""Strokes as a file draws them, and those that are written again as they were."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ..drawing.strokes import Drawing
from .format import SvgOptions
from .markup import Element

ROUNDING = 2.0  # levels of 255, of opacity and of colour that it weighs, however often interpolated


@dataclass(frozen=True)
class DrawnStroke:
    """A stroke as a file draws it, without what places it there: its id, its class and its part.

    Parameters
    ----------
    element : a path, or a group of paths or of an image
    offset_points : of a PowerStroke, as Inkscape has them; "" of any other
    """

    element: Element
    offset_points: str = ""


@dataclass(frozen=True)
class KeptStroke:
    """A stroke that was read, and all that its drawn form depends on but what its digest tells.

    Parameters
    ----------
    drawn : the stroke in its file
    options : those of the file that shape it (`shaping_options`)
    strip : (n, A, 4) uint8, its texture, or None
    """

    drawn: DrawnStroke
    options: tuple
    strip: np.ndarray | None = field(repr=False, compare=False)


Kept = Mapping[bytes, tuple[KeptStroke, ...]]  # by the digest of the stroke
Change = Callable[[dict[int, DrawnStroke]], Mapping[int, DrawnStroke]]


def shaping_options(options: SvgOptions) -> tuple:
    """The options on which the drawn form of a stroke depends."""
    o = options
    return o.texture, o.tones, o.texture_res, o.tolerance, o.decimals, o.inkscape_lpe


def stroke_digest(drawing: Drawing, i: int) -> bytes:
    """Give a digest of stroke i: line, widths, colour, kind, margin, and texels along it."""
    strokes, texture = drawing.strokes, drawing.texture
    rows = strokes.rows(i)
    texels, margin = -1, 0.0
    if texture is not None:
        texels, margin = len(texture.strip(i)), float(texture.margin[i])
    facts = (int(strokes.kind[i]), bool(strokes.closed[i]), texels, margin)
    made = hashlib.blake2b(repr(facts).encode(), digest_size=16)
    for part in (strokes.xy[rows], strokes.thickness[rows], drawing.color[i]):
        made.update(repr(part.shape).encode() + np.ascontiguousarray(part).tobytes())
    return made.digest()


def keep_strokes(
    drawing: Drawing, drawn: Iterable[DrawnStroke | None], options: SvgOptions
) -> dict[bytes, tuple[KeptStroke, ...]]:
    """What `kept_strokes` needs of a drawing that was read.

    `drawn` has None for a stroke to be drawn anew.
    """
    kept: dict[bytes, tuple[KeptStroke, ...]] = {}
    by = shaping_options(options)
    for i, stroke in enumerate(drawn):
        if stroke is not None:
            key = stroke_digest(drawing, i)
            kept[key] = (*kept.get(key, ()), KeptStroke(stroke, by, _strip(drawing, i)))
    return kept


def kept_strokes(drawing: Drawing, options: SvgOptions, kept: Kept) -> dict[int, DrawnStroke]:
    """Strokes that nobody changed since they were read, and that the same options would draw."""
    by = shaping_options(options)
    found = _found(drawing, kept).items()
    return {i: stroke.drawn for i, stroke in found if stroke.options == by}


def carried(kept: Kept, before: Drawing, after: Drawing, change: Change) -> Kept:
    """Keep besides strokes that an edit changes in a way that can be done to them as drawn.

    Parameters
    ----------
    before, after : the drawing and what the edit made of it, with the same strokes in one order
    change : told the strokes that are kept by their index, gives as they are to be drawn now those
        that it can
    """
    found = _found(before, kept)
    made = dict(kept)
    for i, drawn in change({i: stroke.drawn for i, stroke in found.items()}).items():
        key = stroke_digest(after, i)
        new = KeptStroke(drawn, found[i].options, _strip(after, i))
        made[key] = (new, *made.get(key, ()))
    return made


def _found(drawing: Drawing, kept: Kept) -> dict[int, KeptStroke]:
    """The strokes of a drawing that are kept, by index."""
    found: dict[int, KeptStroke] = {}
    for i in range(len(drawing.strokes) if kept else 0):
        strip = _strip(drawing, i)
        for stroke in kept.get(stroke_digest(drawing, i), ()):
            if _is_same_strip(strip, stroke.strip):
                found[i] = stroke
                break
    return found


def _strip(drawing: Drawing, i: int) -> np.ndarray | None:
    texture = drawing.texture
    return None if texture is None else texture.strip(i)


def _is_same_strip(strip: np.ndarray | None, was: np.ndarray | None) -> bool:
    """Whether a strip is the one that it was, on as many columns or on more.

    Where an edit of other strokes needs more columns, all strips are interpolated on these, perhaps
    more than once: then each texel lies between those that are around its place in the strip that
    it was.
    """
    if strip is None or was is None:
        return strip is was
    columns, before = strip.shape[1], was.shape[1]
    if len(strip) != len(was) or columns < before:
        return False
    if columns == before:
        return np.array_equal(strip, was)
    from scipy import ndimage

    now, then = (_premultiplied(texels) for texels in (strip, was))
    place = np.clip((np.arange(columns) + 0.5) / columns * before, 0, before - 1).astype(np.int64)
    low, high = (
        around(then, size=(1, 5, 1), mode="nearest")[:, place]
        for around in (ndimage.minimum_filter, ndimage.maximum_filter)
    )
    return bool(((now >= low - ROUNDING) & (now <= high + ROUNDING)).all())


def _premultiplied(texels: np.ndarray) -> np.ndarray:
    opacity = texels[..., 3:].astype(np.float32)
    return np.concatenate([texels[..., :3] * (opacity / 255.0), opacity], axis=2)
