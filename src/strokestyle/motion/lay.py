"""Lay the planned strokes of a frame as a style draws them, each by the chance of its track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ..drawing.strokes import Strokes
from ..geometry.curves import owner, take_ragged
from ..geometry.parts import Parts, Pieces
from ..render import displacement
from ..render.config import HAIR
from ..render.features import ViewRange, point_features
from ..render.overshoots import curve_lengths
from ..render.plan import Planned, lift
from ..render.restating import repeated_strokes
from ..render.style import MIN_VISIBLE, THINNEST, Style, pieces_by_part
from .chance import TrackChance
from .frames import Frame

CUT_FRAMES = 1.5  # frames over which the corners of lines that are cut straight are smoothed
IS_CUT = np.array([name.startswith("cut") for name in displacement.DEFORMATIONS])
RANGE_SIGMA = 4.0  # frames over which what lines lie between is smoothed


@dataclass(frozen=True)
class Laid:
    """The strokes of a frame before they are given texture, sorted by track.

    Parameters
    ----------
    strokes : C strokes of N points, in px of the style's canvas
    place : (N,) px along their tracks
    presence : (N,) in [0, 1], what their thickness was multiplied by
    features : (N, P), normalised
    name : (C, 2) int64, track and pass of each
    pieces : of one named part each, which they are to be cut into; None where nothing is named
    """

    strokes: Strokes
    place: np.ndarray
    presence: np.ndarray
    features: np.ndarray
    name: np.ndarray
    pieces: Pieces | None


@dataclass(frozen=True)
class _Points:
    """What is known of the points of strokes beside where they are; rows as those of a Planned."""

    surface: np.ndarray
    place: np.ndarray
    presence: np.ndarray
    part: Parts | None

    def take(self, rows: np.ndarray) -> _Points:
        part = None if self.part is None else self.part.take(rows)
        return _Points(self.surface[rows], self.place[rows], self.presence[rows], part)


@dataclass(frozen=True)
class Lifted:
    """The strokes of a frame where the pen is set down and lifted, still on their curves.

    Parameters
    ----------
    planned : C strokes of N points, sorted by track
    points : of them
    name : (C, 2) int64, track and pass of each
    off : (N, 2) px by which passes over a line lie off it
    """

    planned: Planned
    points: _Points
    name: np.ndarray
    off: np.ndarray


# ------------------------------------------------------------------------------- of all frames


def steady_ranges(
    frames: Sequence[Frame], spacing: float, loop: bool = False
) -> list[ViewRange | None]:
    """What the lines of each frame lie between, smoothed over RANGE_SIGMA frames.

    So a line that appears at the top, or far behind, does not change all others at once. None where
    no frame has a line. `loop`: the last frame goes over into the first.
    """
    some = [i for i, frame in enumerate(frames) if len(frame.planned)]
    if not some:
        return [None] * len(frames)
    found = [ViewRange.of(frames[i].planned, frames[i].surface, spacing) for i in some]
    every = np.arange(len(frames))
    period = len(frames) if loop else None
    filled = np.stack(
        [np.interp(every, some, column, period=period) for column in np.array(found).T], axis=1
    )
    smooth = gaussian_filter1d(filled, RANGE_SIGMA, axis=0, mode="wrap" if loop else "nearest")
    return [ViewRange(*row) for row in smooth.tolist()]


def kinds_of_tracks(frames: Sequence[Frame]) -> dict[int, int]:
    """The kind of each track: that of most of its points, so that no stroke changes its layer."""
    tracks = np.concatenate([np.zeros(0, np.int64), *(frame.track for frame in frames)])
    kinds = np.concatenate([np.zeros(0, np.int64), *(frame.planned.kind for frame in frames)])
    points = [np.diff(frame.planned.offsets) for frame in frames]
    pairs, which = np.unique(np.stack([tracks, kinds], axis=1), axis=0, return_inverse=True)
    votes = np.bincount(which.ravel(), np.concatenate([np.zeros(0), *points]), len(pairs))
    order = np.argsort(votes, kind="stable")  # the last word is with the most points
    return dict(pairs[order].tolist())


def steady_cuts(style: Style, frames: Sequence[Lifted], loop: bool = False) -> list[np.ndarray]:
    """How far a style that draws straight moves the points of each frame, (N, 2) px, smoothed.

    The corners of the polyline that stays near a curve (Ramer-Douglas-Peucker) spring to and fro
    when the curve moves a little. So each point goes where it would on average over CUT_FRAMES
    frames, at its place of the track. `loop`: the last frame goes over into the first.
    """
    weights = np.where(IS_CUT, style.displacement, 0.0)
    if not weights.any():
        return [np.zeros_like(one.off) for one in frames]
    local, across = [], []
    for one in frames:
        moved = displacement.Frame.of(
            one.planned, one.points.surface, style.config.spacing, weights
        )
        by = displacement.displaced(moved, weights) - one.planned.xy
        along = moved.normals[:, ::-1] * (1.0, -1.0)
        local.append(np.stack([(by * moved.normals).sum(1), (by * along).sum(1)], axis=1))
        across.append((moved.normals, along))
    smooth = _averaged(frames, local, len(frames) if loop else 0)
    return [
        by[:, :1] * normals + by[:, 1:] * along
        for by, (normals, along) in zip(smooth, across, strict=True)
    ]


def _averaged(frames: Sequence[Lifted], values: list[np.ndarray], period: int) -> list[np.ndarray]:
    """The mean of values (N, 2) of the frames about each, at the same places of the same tracks.

    `period` : frames of a loop, or 0
    """
    where: dict[tuple[int, int], list[tuple[int, slice]]] = {}
    for number, one in enumerate(frames):
        bounds = zip(one.planned.offsets[:-1], one.planned.offsets[1:], strict=True)
        for name, (a, b) in zip(one.name.tolist(), bounds, strict=True):
            where.setdefault((name[0], name[1]), []).append((number, slice(a, b)))
    out = [np.zeros_like(some) for some in values]
    for seen in where.values():
        for number, rows in seen:
            place, total = frames[number].points.place[rows], 0.0
            for other, theirs in seen:
                apart = abs(other - number)
                away = min(apart, abs(period - apart) if period else apart) / CUT_FRAMES
                if away > 3:
                    continue
                weight, total = np.exp(-0.5 * away**2), total + np.exp(-0.5 * away**2)
                known = frames[other].points.place[theirs]
                for k in (0, 1):
                    out[number][rows, k] += weight * np.interp(
                        place, known, values[other][theirs, k]
                    )
            out[number][rows] /= total
    return out


# -------------------------------------------------------------------------------- of one frame


def lift_frame(
    style: Style, frame: Frame, number: int, kinds: dict[int, int], chance: TrackChance
) -> Lifted:
    """Repeat the planned strokes of frame `number` that are gone over, and end all of them.

    Parameters
    ----------
    style : lengths are px of its canvas
    kinds : of `kinds_of_tracks`
    chance : of the animation
    """
    planned, points, name = _in_order(frame, kinds)
    off = np.zeros((len(planned.xy), 2))
    if style.restating is not None:
        planned, points, name = _repeated(style, planned, points, name, chance)
        off = _deviation(style, planned, points.place, name, number, chance)
    if style.overshoots is None or not len(planned):
        return Lifted(planned, points, name, off)
    past = [
        chance.overshoots(style.overshoots, (track, turn), length, number)
        for (track, turn), length in zip(
            name.tolist(), curve_lengths(planned).tolist(), strict=True
        )
    ]
    lifted, rows = lift(planned, np.stack(past), style.config.spacing)
    place = _moved_places(planned, points.place, lifted, rows)
    return Lifted(lifted, replace(points.take(rows), place=place), name, off[rows])


def lay_frame(
    style: Style,
    lifted: Lifted,
    number: int,
    within: ViewRange | None,
    cut: np.ndarray,
    chance: TrackChance,
) -> Laid:
    """Move the strokes of frame `number` off their curves, and give them thickness.

    Parameters
    ----------
    lifted : of `lift_frame`
    within : of `steady_ranges`
    cut : of `steady_cuts`
    chance : of the animation
    """
    planned, points = lifted.planned, lifted.points
    features = style.scaling(
        point_features(planned, points.surface, style.config, style.scaling.names, within)
    )
    if not len(planned):
        none = np.zeros(0)
        return Laid(Strokes.empty(), none, none, features, lifted.name, None)
    weights = np.where(IS_CUT, 0.0, style.displacement)
    moved = displacement.Frame.of(planned, points.surface, style.config.spacing, weights)
    xy = displacement.displaced(moved, weights) + cut + lifted.off
    residuals = _residuals(style, lifted, number, chance)
    xy = xy + residuals[:, :1] * moved.normals
    thickness = np.maximum(np.exp(style.log_width(features) + residuals[:, 1]) - HAIR, 0.0)
    thickness = _softly_without_hairs(thickness, planned) * points.presence
    at, offsets, kept = visible_stretches(thickness, planned.offsets)
    strokes = Strokes(
        between(xy, at), between(thickness, at), offsets, planned.kind[kept],
        np.zeros(len(kept), bool),
    )  # fmt: skip
    nearest = np.rint(at).astype(np.int64)
    part = None if points.part is None else points.part.take(nearest)
    return Laid(
        strokes, between(points.place, at), between(points.presence, at), between(features, at),
        lifted.name[kept], pieces_by_part(part, planned.on_curve[nearest], strokes),
    )  # fmt: skip


def _residuals(style: Style, lifted: Lifted, number: int, chance: TrackChance) -> np.ndarray:
    """What strokes do at random, (N, 2): px across them, and of the logarithm of thickness."""
    out = np.zeros((len(lifted.planned.xy), 2))
    if style.residuals is not None:
        offsets, place = lifted.planned.offsets, lifted.points.place
        for i, (track, turn) in enumerate(lifted.name.tolist()):
            rows = slice(offsets[i], offsets[i + 1])
            out[rows] = chance.residuals(style.residuals, (track, turn), place[rows], number)
    return out


def _in_order(frame: Frame, kinds: dict[int, int]) -> tuple[Planned, _Points, np.ndarray]:
    """The strokes of a frame by track, each of its track's kind; and track and pass of each."""
    order = np.argsort(frame.track, kind="stable")
    rows, offsets = take_ragged(frame.planned.offsets, order)
    track = frame.track[order]
    old = frame.planned
    planned = Planned(
        old.xy[rows], offsets, np.array([kinds[t] for t in track.tolist()], np.int8),
        old.source[rows], old.mix[rows], old.overshoot[rows], old.lifted,
    )  # fmt: skip
    points = _Points(frame.surface, frame.place, frame.presence, frame.parts).take(rows)
    return planned, points, np.stack([track, np.zeros_like(track)], axis=1)


def _repeated(
    style: Style, planned: Planned, points: _Points, name: np.ndarray, chance: TrackChance
) -> tuple[Planned, _Points, np.ndarray]:
    """The strokes that are gone over, one pass after the other."""
    assert style.restating is not None
    counts = np.array(
        [
            chance.passes(style.restating, track, kind)
            for track, kind in zip(name[:, 0].tolist(), planned.kind.tolist(), strict=True)
        ],
        np.int64,
    )
    planned, rows = repeated_strokes(planned, counts)
    turn = np.concatenate([np.zeros(0, np.int64), *(np.arange(n) for n in counts)])
    return planned, points.take(rows), np.stack([np.repeat(name[:, 0], counts), turn], axis=1)


def _deviation(
    style: Style,
    planned: Planned,
    place: np.ndarray,
    name: np.ndarray,
    number: int,
    chance: TrackChance,
) -> np.ndarray:
    """How far points of strokes that are gone over lie off their line, (N, 2) px; of others, 0."""
    assert style.restating is not None
    out = np.zeros((len(planned.xy), 2))
    over = np.isin(name[:, 0], name[name[:, 1] > 0, 0])
    for i in np.flatnonzero(over).tolist():
        rows = slice(planned.offsets[i], planned.offsets[i + 1])
        track, turn = name[i].tolist()
        out[rows] = chance.deviation(style.restating, track, turn, place[rows], number)
    return out


def _moved_places(
    planned: Planned, place: np.ndarray, lifted: Planned, rows: np.ndarray
) -> np.ndarray:
    """The places of lifted strokes, whose first and last points were moved along them.

    `rows` of `planned` are what each point of `lifted` was made of.
    """
    moved = place[rows].copy()
    stroke = owner(planned.offsets)
    ends = np.concatenate([lifted.offsets[:-1], lifted.offsets[1:] - 1])
    row = rows[ends]
    before = np.maximum(row - 1, planned.offsets[:-1][stroke[row]])
    after = np.minimum(row + 1, planned.offsets[1:][stroke[row]] - 1)
    way = planned.xy[after] - planned.xy[before]
    slope = (place[after] - place[before]) / np.maximum(np.square(way).sum(axis=1), 1e-9)
    moved[ends] += slope * ((lifted.xy[ends] - planned.xy[row]) * way).sum(axis=1)
    return moved


def _softly_without_hairs(thickness: np.ndarray, planned: Planned) -> np.ndarray:
    """As `style.without_hairs`, but what is too thin past the end of a curve goes gradually.

    What grows a little from one frame to the next must not spring up.
    """
    fullest = np.maximum.reduceat(thickness, planned.offsets[:-1])[owner(planned.offsets)]
    share = np.clip(thickness / np.maximum(THINNEST * fullest, 1e-9) - 1.0, 0.0, 1.0)
    return np.where(planned.on_curve, thickness, thickness * share)


def visible_stretches(
    thickness: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leave out the ends of strokes that are too thin to see, but for one step at each end.

    As `style.trim_invisible_ends`, but between two points, so that an end moves and does not spring
    from one point to the next.

    Parameters
    ----------
    thickness : (N,) px
    offsets : (C+1,)

    Returns
    -------
    Places (n,) float64 in rows, their offsets (c+1,), and the strokes (c,) that these are of.
    """
    places, counts, kept = [np.zeros(0)], [0], []
    for i, (a, b) in enumerate(zip(offsets[:-1], offsets[1:], strict=True)):
        seen = np.flatnonzero(thickness[a:b] >= MIN_VISIBLE) + a
        if len(seen) < 2:
            continue
        first = max(_crossing(thickness, seen[0], -1, a) - 1.0, float(a))
        last = min(_crossing(thickness, seen[-1], 1, b - 1) + 1.0, float(b - 1))
        inner = np.arange(np.floor(first) + 1, np.ceil(last))
        places.append(np.r_[first, inner, last])
        counts.append(len(inner) + 2)
        kept.append(i)
    return np.concatenate(places), np.cumsum(counts), np.array(kept, np.int64)


def _crossing(thickness: np.ndarray, seen: int, way: int, end: int) -> float:
    """Where, from the row `seen` on, thickness falls below what can be seen; `end` at most."""
    if seen == end:
        return float(end)
    here, there = thickness[seen], thickness[seen + way]
    return seen + way * float((here - MIN_VISIBLE) / max(here - there, 1e-9))


def between(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate values (N,) or (N, k) at places (n,) in rows."""
    row = np.minimum(at.astype(np.int64), max(len(values) - 2, 0))
    part = (at - row).reshape(-1, *[1] * (values.ndim - 1))
    after = np.minimum(row + 1, len(values) - 1)
    return np.where(part > 0, values[row] * (1 - part) + values[after] * part, values[row])
