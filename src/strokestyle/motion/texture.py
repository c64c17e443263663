"""Texture that is anchored to the place along a track: it neither swims nor stretches.

Kalnins et al. 2003 and Benard et al. 2010, 2012 weigh two wishes against each other: that texture
keeps its scale on the picture, and that it stays where it is on the line. Here what a track's
texture is at a place is chosen once, a row of texels for each 1 / ROWS px of place, and every frame
lays the rows of the places that its stroke has. So it is the place alone that decides between those
wishes: where it follows px along the stroke both are met. The ends of strokes (TIP px, and what
lies beyond) look like ends, and move with them: each has rows of its own, laid over the others
along a seam that stays what it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..drawing.ribbon import ribbon
from ..drawing.strokes import Strokes, Texture
from ..geometry.curves import owner, take_ragged
from ..render.quilt import FEATHER, STEP, choose_runs, lay_rows, stretched, texels, with_ink
from ..render.texture_bank import ROWS, Rows, TextureBank, bank_columns
from ..svg.ink import inks
from .chance import Luck, Stage, spline_weights
from .lay import Laid
from .survey import (
    INK,
    SEAM,
    TIP,
    WIDTH,
    Name,
    Points,
    Survey,
    TrackSurvey,
    names_of,
    survey_tracks,
)

OFFERED = 2 * ROWS  # each so-manieth row of the bank may begin a run
CHUNK = 2048  # rows that are laid at a time
MOVED_ON = 37  # sources by which the chance of a node differs from that of the one before
TIP_SHARE = 0.4  # of a stroke's length: on a short one tips are no longer than this


@dataclass(frozen=True)
class _Strip:
    """Rows of a sheet, from one on, that lie along a track or beside an end of its strokes.

    Parameters
    ----------
    rows : of the sheet
    low : px, where the first begins; of a tip, the distance of the outermost from the end
    """

    rows: slice
    low: float


@dataclass(frozen=True)
class _TrackStrips:
    body: _Strip
    tips: tuple[_Strip, _Strip]
    seam: np.ndarray  # (2, A) px by which a seam lies nearer to the end than it may


@dataclass(frozen=True)
class _Sheet:
    """The texture of tracks, laid once.

    Parameters
    ----------
    tracks : which rows are whose
    layer : (R, A, K) uint8, premultiplied colours, or opacity alone where K is 1; in the direction
        of the tracks
    wanted : (R, 5), ink that was predicted, and width
    ink : (R, 4), the ink that rows have
    """

    tracks: dict[Name, _TrackStrips]
    layer: np.ndarray
    wanted: np.ndarray
    ink: np.ndarray


@dataclass(frozen=True)
class _Seen:
    """The rows of a stroke in a frame.

    Parameters
    ----------
    place : (n,) px along the track
    ends : (n, 2) px from the stroke's ends
    half : (2,) px that the ribbon reaches past either end
    wanted : (n, 5), ink that is predicted, and width
    """

    place: np.ndarray
    ends: np.ndarray
    half: np.ndarray
    wanted: np.ndarray

    def take(self, rows: np.ndarray) -> _Seen:
        return _Seen(self.place[rows], self.ends[rows], self.half, self.wanted[rows])


class TrackTextures:
    """The texture of the tracks of an animation.

    Parameters
    ----------
    bank : of the medium
    turned : which tracks a hand pulls against their places
    frames : the names of strokes, and their points, of all frames
    luck : decides between sources that cost about the same
    """

    def __init__(
        self,
        bank: TextureBank,
        turned: dict[Name, bool],
        frames: Sequence[tuple[list[Name], Points]],
        luck: Luck,
    ):
        self.bank, self.turned, self.luck = bank, turned, luck
        self.surveys = survey_tracks(frames, bank.margin)
        widest = [track.body.wanted[:, WIDTH].max() for track in self.surveys.values()]
        none = np.zeros(0)
        rows = Rows(none, np.array(widest), none, none, none, none, none)
        self.columns = bank_columns(rows, bank.margin)
        self.opacity = _is_of_one_ink(bank)
        self.sheet = self._laid(self.surveys, {name: self._luck_of(name) for name in self.surveys})

    def strips(self, laid: Laid, points: Points, number: int) -> Texture:
        """The texture of the strokes of frame `number`."""
        margin, names = self.bank.margin, names_of(laid)
        seen = [_seen(laid.strokes, i, points.of(i), margin) for i in range(len(names))]
        offsets = np.cumsum([0] + [len(one.place) for one in seen])
        rgba = np.empty((offsets[-1], self.columns, 4), np.uint8)
        own = self._of_drawing(names, points, number)
        anew = np.array([own is not None and name in own.tracks for name in names])
        for sheet, some in ((self.sheet, ~anew), (own, anew)):
            index = np.flatnonzero(some)
            if sheet is not None and len(index):
                rows, _ = take_ragged(offsets, index)
                strokes = [(sheet.tracks[names[i]], seen[i]) for i in index.tolist()]
                rgba[rows] = self._strips(sheet, strokes)
        levels = np.stack([self.opacities[name] for name in names])
        return Texture(rgba, offsets, np.full(len(names), margin), levels)

    @cached_property
    def opacities(self) -> dict[Name, np.ndarray]:
        """How often each level of opacity, (256,), occurs along each track."""
        return {
            name: np.bincount(self.sheet.layer[track.body.rows, :, -1].ravel(), minlength=256)
            for name, track in self.sheet.tracks.items()
        }

    # ---------------------------------------------------------------------------------- laying

    def _luck_of(self, name: Name) -> np.random.Generator:
        return self.luck.of_track(Stage.TEXTURE, *name)

    def _of_drawing(self, names: list[Name], points: Points, number: int) -> _Sheet | None:
        """Texture that is chosen anew for this drawing, for a share of its strokes."""
        chance = [self.luck.of_drawing(Stage.TEXTURE, number, *name).random() for name in names]
        anew = {}
        for i in np.flatnonzero(np.array(chance) < self.luck.boil).tolist():
            survey, place = self.surveys[names[i]], points.of(i).place
            body = survey.body.part(float(place.min()), float(place.max()))
            anew[names[i]] = TrackSurvey(body, survey.first, survey.last)
        if not anew:
            return None
        chances = {name: self.luck.of_drawing(Stage.TEXTURE, number, *name, 1) for name in anew}
        return self._laid(anew, chances)

    def _laid(
        self, surveys: dict[Name, TrackSurvey], chances: dict[Name, np.random.Generator]
    ) -> _Sheet:
        """Choose texture for tracks, and lay it."""
        made: list[Survey] = []
        for track in surveys.values():
            made += [track.body, track.first, track.last]
        against = np.repeat([self.turned[name] for name in surveys], 3)
        offsets = np.cumsum([0] + [len(one.wanted) for one in made])
        wanted = np.concatenate([one.wanted for one in made])
        ends = np.concatenate([one.ends for one in made])
        back = _reversed_rows(offsets, against)
        swap = against[owner(offsets)]
        ends = np.where(swap[:, None], ends[:, ::-1], ends)[back]
        pulled, none = wanted[back], np.zeros(len(made), bool)
        rows = Rows(offsets, pulled[:, WIDTH], pulled[:, WIDTH], ends, wanted[:, :0], none, none)
        nodes = -(-np.diff(offsets) // STEP).reshape(-1, 3).sum(axis=1)
        chance = _ChanceOfTracks(list(chances.values()), nodes)
        runs = choose_runs(self.bank, rows, pulled[:, INK], chance, every=OFFERED)
        laid = lay_rows(
            self.bank, rows, runs, pulled[:, INK], self.columns, np.arange(len(made)) // 3,
            self.opacity,
        )  # fmt: skip
        layer = np.rint(np.clip(laid.layer, 0, 1) * 255).astype(np.uint8)[back]
        layer[swap] = layer[swap][:, ::-1]
        strips = [
            _Strip(slice(a, b), one.low)
            for a, b, one in zip(offsets[:-1].tolist(), offsets[1:].tolist(), made, strict=True)
        ]
        tracks = {
            name: _TrackStrips(strips[3 * i], (strips[3 * i + 1], strips[3 * i + 2]), seam)
            for i, (name, seam) in enumerate(
                (name, _seams(self.columns, chances[name])) for name in surveys
            )
        }
        return _Sheet(tracks, layer, wanted, laid.ink[back])

    # -------------------------------------------------------------------------------- one frame

    def _strips(self, sheet: _Sheet, strokes: list[tuple[_TrackStrips, _Seen]]) -> np.ndarray:
        """The rows (R, A, 4) uint8 of strokes, straight, one stroke after the other."""
        asked = [_asked(track.body, seen, seen.place - track.body.low) for track, seen in strokes]
        out, ink = self._rows(sheet, _Asked(*map(np.concatenate, zip(*asked, strict=True))))
        begin = np.cumsum([0] + [len(seen.place) for _, seen in strokes])
        for k in (0, 1):
            tips, rows, away = [], [], []
            for (track, seen), first in zip(strokes, begin.tolist(), strict=False):
                reach = min(TIP, TIP_SHARE * (seen.ends[0, 0] + seen.ends[0, 1]))
                near = np.flatnonzero(seen.ends[:, k] < reach + 2.0)
                tips.append(_asked_of_tip(track.tips[k], seen.take(near), k))
                rows.append(first + near)
                away.append((reach - seen.ends[near, k])[:, None] - track.seam[k])
            over, _ = self._rows(sheet, _Asked(*map(np.concatenate, zip(*tips, strict=True))))
            at = np.concatenate(rows)
            weight = np.clip(np.concatenate(away) * (ROWS / FEATHER) + 0.5, 0.0, 1.0)
            weight = weight[..., None].astype(np.float32)
            out[at] = out[at] * (1 - weight) + over * weight
        return _with_color(out, ink) if self.opacity else texels(out)

    def _rows(self, sheet: _Sheet, asked: _Asked) -> tuple[np.ndarray, np.ndarray]:
        """Rows of a sheet (n, A, K), premultiplied, and their ink, (n, 4)."""
        here = np.rint(asked.at).astype(np.int64)
        had, ink = sheet.wanted[here], sheet.ink[here]
        wanted = ink + asked.wanted[:, INK] - had[:, INK]
        width = asked.wanted[:, WIDTH].astype(np.float32)
        out = np.empty((len(here), *sheet.layer.shape[1:]), np.float32)
        for a in range(0, len(here), CHUNK):
            part = slice(a, a + CHUNK)
            layer = _between_rows(sheet.layer, asked, part)
            layer = stretched(layer, had[part, WIDTH], width[part], self.bank.margin, self.columns)
            layer = np.clip(layer, 0.0, 1.0, out=layer)
            out[part] = with_ink(layer, ink[part], wanted[part])
        return out, wanted


class _Asked(NamedTuple):
    """Rows that are asked for.

    `at` (n,) float are rows of a sheet, between `low` and `high` (n,); `wanted` (n, 5) is ink and
    width that they shall have.
    """

    at: np.ndarray
    low: np.ndarray
    high: np.ndarray
    wanted: np.ndarray


def _asked(strip: _Strip, seen: _Seen, px: np.ndarray) -> _Asked:
    """Ask for the rows of a strip at px (n,) from where it begins."""
    low, high = strip.rows.start, strip.rows.stop - 1
    at = np.clip(px * ROWS - 0.5 + low, low, high)
    return _Asked(at, np.full(len(px), low), np.full(len(px), high), seen.wanted)


def _asked_of_tip(tip: _Strip, seen: _Seen, k: int) -> _Asked:
    """Ask for the rows of a first tip (k = 0) or a last one, as far from the end as is seen.

    What lies past the end is as long as the stroke is wide.
    """
    distance = seen.ends[:, k]
    px = np.where(distance < 0, distance * (-tip.low / seen.half[k]), distance) - tip.low
    return _asked(tip, seen, (tip.rows.stop - tip.rows.start) / ROWS - px if k else px)


def _between_rows(layer: np.ndarray, asked: _Asked, part: slice) -> np.ndarray:
    """Interpolate rows of a layer (R, A, K) uint8: (n, A, K) float32, about in [0, 1]."""
    at, low, high = asked.at[part], asked.low[part], asked.high[part]
    row = at.astype(np.int64)
    weights = (spline_weights(at - row) / 255.0).astype(np.float32)[..., None, None]
    out = weights[:, 0] * layer[np.maximum(row - 1, low)]
    for k in (1, 2, 3):
        out += weights[:, k] * layer[np.minimum(row + k - 1, high)]
    return out


class _ChanceOfTracks:
    """Chance for `choose_runs`, each track's its own, whatever other tracks there are.

    Each node of a track has the numbers of the one before moved on by some sources: so a track
    draws hardly more of them than there are sources.

    Parameters
    ----------
    chances : one a track
    nodes : how many each track has, in this order
    """

    def __init__(self, chances: list[np.random.Generator], nodes: np.ndarray):
        self.chances, self.first = chances, np.r_[0, np.cumsum(nodes)]
        self.drawn = 0
        self.tables: dict[int, np.ndarray] = {}

    def standard_exponential(self, size: tuple[int, int], dtype: type) -> np.ndarray:
        """Numbers of mean 1 for the next nodes, and all sources."""
        node = np.arange(self.drawn, self.drawn + size[0])
        self.drawn += size[0]
        of = np.searchsorted(self.first, node, side="right") - 1
        out: np.ndarray = np.empty(size, dtype)
        for row, (k, track) in enumerate(zip(node.tolist(), of.tolist(), strict=True)):
            at = MOVED_ON * int(k - self.first[track])
            out[row] = self._table(track, size[1])[at : at + size[1]]
        return out

    def _table(self, track: int, sources: int) -> np.ndarray:
        if track not in self.tables:
            nodes = int(self.first[track + 1] - self.first[track])
            count = sources + MOVED_ON * nodes
            self.tables[track] = self.chances[track].standard_exponential(count, np.float32)
        return self.tables[track]


def _is_of_one_ink(bank: TextureBank) -> bool:
    """Whether the opacity of a medium is all that its texture tells: each row has one colour."""
    return bool(inks(Texture(bank.rgba, bank.offsets, np.array(bank.margin))).plain.all())


def _with_color(opacity: np.ndarray, ink: np.ndarray) -> np.ndarray:
    """Opacity (n, A, 1) in [0, 1] in the colours of ink (n, 4), as straight texels uint8."""
    color = np.zeros((len(ink), 4), np.uint8)
    color[:, :3] = np.rint(np.clip(ink[:, 1:], 0, 1) * 255)
    level = np.rint(opacity[..., 0] * 255).astype("<u4")  # texels as wholes: half the time
    return ((level << 24) | color.view("<u4")).view(np.uint8).reshape(*level.shape, 4)


def _reversed_rows(offsets: np.ndarray, against: np.ndarray) -> np.ndarray:
    """Rows (R,) in which the strips that are `against` (C,) the pull are turned about."""
    own = owner(offsets)
    row = np.arange(offsets[-1])
    return np.where(against[own], offsets[own] + offsets[own + 1] - 1 - row, row)


def _seams(columns: int, rng: np.random.Generator) -> np.ndarray:
    """How the seams (2, A) at both ends wander across a stroke, px in [0, SEAM]."""
    steps = rng.standard_normal((2, columns)).cumsum(axis=1)
    low, high = steps.min(axis=1, keepdims=True), steps.max(axis=1, keepdims=True)
    return SEAM * (steps - low) / np.maximum(high - low, 1e-9)


def _seen(strokes: Strokes, i: int, points: Points, margin: float) -> _Seen:
    """Rows at equal steps along the ribbon of stroke i, whose points are given."""
    band = ribbon(strokes, i, margin)
    n = max(2, round(ROWS * band.length))
    u = (np.arange(n) + 0.5) / n * band.length
    half = band.half[[0, -1]]
    inner = band.length - half.sum()
    # the ribbon's centre line is smoother than the stroke's: points are found by their share
    along = points.ends[1:-1, 0]
    at = np.r_[0.0, half[0] + along * (inner / max(along[-1], 1e-9)), band.length]
    wanted = np.stack([np.interp(u, at, column) for column in points.wanted.T], axis=1)
    wanted[:, WIDTH] = 2.0 * (np.interp(u, band.along, band.half) - margin)
    ends = np.stack([u - half[0], band.length - half[1] - u], axis=1)
    return _Seen(np.interp(u, at, points.place), ends, half, wanted)
