"""Write GIFs: one palette for all pictures, no dithering, and times that do not drift."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from PIL import GifImagePlugin, Image
from scipy.spatial import cKDTree

from .changes import changed_box
from .pictures import Pictures
from .timing import NoSuchRate, durations

UNIT = 100  # GIF tells times in 1/100 s
SHORTEST = 2  # of them: players show what is shorter for 10
FASTEST = UNIT // SHORTEST  # pictures a second
COLOURS = 64  # of the palette, and one for what does not change
TRANSPARENT = 0  # its place in the palette
SOLID = 128  # of alpha: from here on a pixel is painted
KEEP, CLEAR = 1, 2  # what is done with a picture before the next


def check_rate(rate: Fraction) -> None:
    """Raise NoSuchRate where GIF cannot show so many frames a second."""
    if rate > FASTEST:
        raise NoSuchRate(
            f"a GIF shows at most {FASTEST} frames a second, not {float(rate):g}: WebP, APNG and "
            "MP4 show more"
        )


def write_gif(path: str, pictures: Pictures, rate: Fraction, transparent: bool = False) -> None:
    """Write pictures as a GIF that begins anew at its end, for ever.

    GIF89a (CompuServe 1990), with the NETSCAPE2.0 block. Colours are the same in all pictures: as
    they are where there are few, else those that stand for most of the pixels. Pictures hold only
    what changes, but for transparent ones.

    Parameters
    ----------
    rate : frames a second; up to FASTEST pictures
    transparent : leave out what is transparent in the pictures; else they are opaque

    Raises
    ------
    NoSuchRate
        where there are too many a second; where only the last picture is shown too shortly, it is
        shown for longer, with a UserWarning.
    """
    check_rate(rate / pictures.held[0])  # the last one may be held for less than the others
    palette = Palette.of(pictures, transparent)
    times = durations(pictures.held, rate, UNIT, SHORTEST)
    _warn_of_more(sum(times), float(sum(pictures.held) * UNIT / rate))
    with open(path, "wb") as file:
        file.write(_head(pictures.size, palette.colours))
        for part, time in zip(_parts(pictures, palette, transparent), times, strict=True):
            image = Image.fromarray(part.pixels, "L")
            file.write(_control(time, part.disposal))
            data = GifImagePlugin.getdata(image, part.corner, interlace=0)
            file.write(b"".join(data))
        file.write(b";")


def _warn_of_more(time: int, meant: float) -> None:
    """Say where a GIF lasts longer than it was meant to, 1/100 s: pictures are too short for it."""
    if time > meant + 0.5001:
        warnings.warn(
            f"a GIF shows no picture for less than {SHORTEST}/{UNIT} s: the last is shown longer, "
            f"and all last {time / UNIT:g} s, not {meant / UNIT:g}",
            stacklevel=2,
        )


@dataclass(frozen=True)
class Palette:
    """The colours of all pictures of a film.

    Parameters
    ----------
    colours : (n, 3) uint8, n at most 255; the first stands for what is not painted
    """

    colours: np.ndarray

    @classmethod
    def of(cls, pictures: Pictures, transparent: bool) -> Palette:
        """Choose the colours for pictures."""
        found, count = np.zeros(0, np.int64), np.zeros(0, np.int64)
        for picture in pictures.arrays("RGBA"):
            keys = _keys(picture)
            if transparent:
                keys = keys[picture[..., 3] >= SOLID]
            keys, n = np.unique(keys, return_counts=True)
            both = np.concatenate([found, keys])
            found, place = np.unique(both, return_inverse=True)
            count = np.bincount(place, np.concatenate([count, n]), len(found))
        colours = np.stack([found >> 16, found >> 8 & 255, found & 255], axis=1)
        if len(colours) > COLOURS:
            colours = reduced(colours, count, COLOURS)
        return cls(np.concatenate([np.zeros((1, 3)), colours]).astype(np.uint8))

    def index(self, picture: np.ndarray, transparent: bool) -> np.ndarray:
        """Find the colour of each pixel of a picture (h, w, 4): (h, w) uint8."""
        keys, place = np.unique(_keys(picture), return_inverse=True)
        colours = np.stack([keys >> 16, keys >> 8 & 255, keys & 255], axis=1)
        nearest = cKDTree(self.colours[1:].astype(float)).query(colours)[1] + 1
        index = nearest[place].reshape(picture.shape[:2]).astype(np.uint8)
        if transparent:
            index[picture[..., 3] < SOLID] = TRANSPARENT
        return index


def _keys(picture: np.ndarray) -> np.ndarray:
    rgb = picture[..., :3].astype(np.int64)
    return (rgb[..., 0] << 16) | (rgb[..., 1] << 8) | rgb[..., 2]


def reduced(colours: np.ndarray, count: np.ndarray, most: int) -> np.ndarray:
    """Choose at most `most` colours (n, 3) that stand for colours (N, 3) seen `count` times (N,).

    Boxes of colours are cut where that takes most of their variance (Wu 1991 likewise), and then
    moved to the middle of the pixels that are nearest to them (Lloyd 1982). The most frequent
    colour, the background's as a rule, stays as it is.
    """
    points, weight = colours.astype(np.float64), np.sqrt(count.astype(np.float64))
    boxes = [np.arange(len(points))]
    while len(boxes) < most - 1:
        spread = [_spread(points[box], weight[box]) for box in boxes]
        worst = int(np.argmax([total for total, _ in spread]))
        total, axis = spread[worst]
        if total <= 0.0:
            break
        boxes += _cut(boxes.pop(worst), points[:, axis], weight)
    middle = np.array([np.average(points[box], axis=0, weights=weight[box]) for box in boxes])
    for _ in range(8):
        nearest = cKDTree(middle).query(points)[1]
        share = np.bincount(nearest, weight, len(middle))[:, None]
        moved = np.stack([np.bincount(nearest, weight * c, len(middle)) for c in points.T], axis=1)
        middle = np.where(share > 0, moved / np.maximum(share, 1e-9), middle)
    kept = points[count.argmax()]
    return np.unique(np.rint(np.concatenate([kept[None], middle])), axis=0)


def _spread(points: np.ndarray, weight: np.ndarray) -> tuple[float, int]:
    """The greatest weighted sum of squares along an axis, and the axis."""
    middle = np.average(points, axis=0, weights=weight)
    squares = (weight[:, None] * (points - middle) ** 2).sum(axis=0)
    return float(squares.max()), int(squares.argmax())


def _cut(box: np.ndarray, value: np.ndarray, weight: np.ndarray) -> list[np.ndarray]:
    """Cut a box of points in two at the mean of their values."""
    inside = value[box]
    low = inside <= np.average(inside, weights=weight[box])
    return [box[low], box[~low]]


class _Part(NamedTuple):
    """What is painted of a picture: colours (h, w), where, and what is done with it after."""

    pixels: np.ndarray
    corner: tuple[int, int]
    disposal: int


def _parts(pictures: Pictures, palette: Palette, transparent: bool) -> Iterator[_Part]:
    before: np.ndarray | None = None
    for picture in pictures.arrays("RGBA"):
        index = palette.index(picture, transparent)
        if transparent:
            yield _Part(index, (0, 0), CLEAR)
        elif before is None:
            yield _Part(index, (0, 0), KEEP)
        else:
            left, top, right, bottom = changed_box(before, index)
            new, old = (a[top:bottom, left:right] for a in (index, before))
            yield _Part(np.where(new == old, TRANSPARENT, new), (left, top), KEEP)
        before = index


def _head(size: tuple[int, int], colours: np.ndarray) -> bytes:
    """The screen, the palette, and that the film begins anew for ever."""
    bits = max(2, int(np.ceil(np.log2(max(len(colours), 2)))))
    table = np.zeros((2**bits, 3), np.uint8)
    table[: len(colours)] = colours
    screen = struct.pack("<HHBBB", *size, 0x80 | 0x70 | (bits - 1), TRANSPARENT, 0)
    loop = b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
    return b"GIF89a" + screen + table.tobytes() + loop


def _control(time: int, disposal: int) -> bytes:
    """How long a picture is shown, 1/100 s, and that one of its colours is none."""
    return b"!\xf9\x04" + struct.pack("<BHBB", disposal << 2 | 1, time, TRANSPARENT, 0)
