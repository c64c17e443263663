"""Draw the frames of an animation: chance and texture belong to tracks, not to frames.

What differs from one drawing to the next is what has changed in what is seen, and nothing else,
but for what `boil` asks for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..drawing.edit import cut_at_parts
from ..drawing.strokes import Drawing
from ..geometry.curves import owner
from ..geometry.parts import Pieces
from ..render.style import Style, scaled
from ..render.texture_bank import TextureBank, solid_ink
from .chance import Luck, TrackChance
from .frames import Frame
from .lay import Laid, kinds_of_tracks, lay_frame, lift_frame, steady_cuts, steady_ranges
from .survey import INK, WIDTH, Name, Points, names_of, points_of, turned_tracks
from .texture import TrackTextures

INK_FRAMES = 3.0  # frames over which the ink of a track is smoothed


def draw_frames(
    style: Style,
    frames: Sequence[Frame],
    seed: int = 0,
    boil: float = 0.0,
    loop: bool = False,
) -> Iterator[Drawing]:
    """Draw the frames of an animation one after the other.

    Residuals, overshoots and the passes of lines that are gone over are chosen once for each track,
    by the place along it, and so is texture (`TrackTextures`). Strokes lie in the order of their
    tracks in all frames. The same arguments give the same drawings.

    Parameters
    ----------
    style : as `load_style` or `fit_style` return it
    frames : of `track_frames`; each is drawn on its camera's canvas
    seed : another one gives other residuals, overshoots and texture
    boil : in [0, 1], the part of chance that every drawing has of its own, as drawings that follow
        each other in a film drawn by hand have; 0: none, 1: all of it
    loop : the last frame goes over into the first, as `track_frames` was told

    Returns
    -------
    The drawings, each made when it is asked for; their `track` says which stroke is which.

    Raises
    ------
    ValueError
        where `boil` does not lie in [0, 1].
    """
    if not 0.0 <= boil <= 1.0:
        raise ValueError(f"boil must lie between 0 and 1, got {boil:g}")
    return _drawn(style, frames, Luck(seed, boil), loop)


def _drawn(style: Style, frames: Sequence[Frame], luck: Luck, loop: bool) -> Iterator[Drawing]:
    laid = _laid(style, frames, luck, loop)
    bank = style.bank
    colors = [np.tile(style.color, (len(one.strokes), 1)) for one in laid]
    textures, points = None, []
    if bank is not None:
        turned = turned_tracks(laid)
        points = [points_of(bank, one, turned) for one in laid]
        named = [(names_of(one), some) for one, some in zip(laid, points, strict=True)]
        colors = steady_inks([(names, _inks(bank, some)) for names, some in named], loop)
        if not bank.flat and any(names for names, _ in named):
            textures = TrackTextures(bank, turned, named, luck)
    pieces = _PieceNames()
    laid.reverse()
    for number, frame in enumerate(frames):
        one, strips = laid.pop(), None  # what was drawn is forgotten
        if textures is not None and len(one.strokes):
            strips = textures.strips(one, points[number], number)
        size = (frame.camera.width, frame.camera.height)
        strokes, texture = scaled(one.strokes, strips, max(size) / style.config.size)
        names = tuple(map(track_name, names_of(one)))
        drawing = Drawing(strokes, size, colors[number], texture, track=names)
        if one.pieces is not None:
            drawing = cut_at_parts(drawing, one.pieces)
            drawing = replace(drawing, track=pieces.named(names, one.pieces))
        yield drawing


def _laid(style: Style, frames: Sequence[Frame], luck: Luck, loop: bool) -> list[Laid]:
    kinds = kinds_of_tracks(frames)
    ranges = steady_ranges(frames, style.config.spacing, loop)
    chance = TrackChance(luck, style.config.spacing)
    lifted = [lift_frame(style, frame, i, kinds, chance) for i, frame in enumerate(frames)]
    cuts = steady_cuts(style, lifted, loop)
    return [lay_frame(style, one, i, ranges[i], cuts[i], chance) for i, one in enumerate(lifted)]


def track_name(name: Name) -> str:
    """What the stroke of a pass of a track is called: "12", and the passes over it "12-2" ..."""
    track, turn = name
    return str(track) if not turn else f"{track}-{turn + 1}"


class _PieceNames:
    """Names of the pieces that strokes are cut into, by part: "12", then "12.1" and so on."""

    def __init__(self) -> None:
        self.known: dict[str, dict[tuple[str, int], int]] = {}

    def named(self, names: Sequence[str], pieces: Pieces) -> tuple[str, ...]:
        """The names of pieces; that on one part keeps its name from frame to frame."""
        made: list[str] = []
        met: dict[tuple[str, str], int] = {}
        for k, line in enumerate(pieces.line.tolist()):
            key = names[line], pieces.parts.name(k)
            met[key] = met.get(key, -1) + 1
            known = self.known.setdefault(names[line], {})
            number = known.setdefault((key[1], met[key]), len(known))
            made.append(f"{names[line]}.{number}" if number else names[line])
        return tuple(made)


# -------------------------------------------------------------------------------------------- ink


def _inks(bank: TextureBank, points: Points) -> np.ndarray:
    """The flat ink of each stroke, (C, 4) straight RGBA in [0, 1]."""
    count, own = len(points.offsets) - 1, owner(points.offsets)
    ink, weight = points.wanted[:, INK], points.wanted[:, WIDTH] + 0.1
    if bank.flat:
        ink = solid_ink(ink, bank)
    total = np.bincount(own, weight, count)
    mean = [np.bincount(own, weight * column, count) / total for column in ink.T]
    return np.clip(np.stack(mean, axis=1)[:, [1, 2, 3, 0]], 0, 1)


def steady_inks(
    frames: Sequence[tuple[list[Name], np.ndarray]], loop: bool = False
) -> list[np.ndarray]:
    """Smooth the inks (C, 4) of the strokes of each name over INK_FRAMES frames.

    `loop` : the last frame goes over into the first
    """
    seen: dict[Name, list[tuple[int, int]]] = {}
    for number, (names, _) in enumerate(frames):
        for i, name in enumerate(names):
            seen.setdefault(name, []).append((number, i))
    out = [inks.copy() for _, inks in frames]
    for where in seen.values():
        whole = loop and len(where) == len(frames)
        if loop and not whole:  # from where it appears on, beyond the end of the loop
            gaps = [b - a for (a, _), (b, _) in zip(where, where[1:], strict=False)]
            if gaps and max(gaps) > where[0][0] + len(frames) - where[-1][0]:
                start = int(np.argmax(gaps)) + 1
                where = where[start:] + where[:start]
        inks = np.stack([frames[number][1][i] for number, i in where])
        smooth = gaussian_filter1d(inks, INK_FRAMES, axis=0, mode="wrap" if whole else "nearest")
        for (number, i), ink in zip(where, smooth, strict=True):
            out[number][i] = ink
    return out
