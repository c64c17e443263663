"""What is asked of a track's texture: its width and ink along it, over all frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..drawing.ribbon import slope_limited_half_widths
from ..geometry.curves import arc, owner
from ..render.plan import PULL
from ..render.quilt import NODE, predicted_ink
from ..render.texture_bank import END, ROWS, Rows, TextureBank
from .lay import Laid

Name = tuple[int, int]  # track and pass
TIP = 12.0  # px from the end of a stroke within which texture moves with the end
SEAM = 4.0  # px over which the seam between a tip and the rest wanders
INK, WIDTH = slice(0, 4), 4  # columns of a survey


@dataclass(frozen=True)
class Points:
    """The points of strokes, and one more in the cap at each end, as their texture sees them.

    Parameters
    ----------
    offsets : (C+1,), stroke i is rows offsets[i]:offsets[i+1]
    place : (N,) px along the track
    ends : (N, 2) px from the stroke's first point and from its last; negative in the caps
    wanted : (N, 5), the ink that the features ask for, and px of width without margins
    weight : (N,), how much they count for the track
    """

    offsets: np.ndarray
    place: np.ndarray
    ends: np.ndarray
    wanted: np.ndarray
    weight: np.ndarray

    def of(self, i: int) -> Points:
        """The points of stroke i."""
        part = slice(self.offsets[i], self.offsets[i + 1])
        offsets = np.array([0, part.stop - part.start])
        return Points(
            offsets, self.place[part], self.ends[part], self.wanted[part], self.weight[part]
        )


def names_of(laid: Laid) -> list[Name]:
    """Track and pass of each stroke."""
    return [(track, turn) for track, turn in laid.name.tolist()]


def turned_tracks(frames: Sequence[Laid]) -> dict[Name, bool]:
    """Whether a hand would pull each track against its places: in most of all frames.

    A stroke that turns past the direction of the pull must not be laid anew.
    """
    pull: dict[Name, float] = {}
    for laid in frames:
        xy, offsets = laid.strokes.xy, laid.strokes.offsets
        chord = (xy[offsets[1:] - 1] - xy[offsets[:-1]]) @ PULL
        for name, along in zip(names_of(laid), chord.tolist(), strict=True):
            pull[name] = pull.get(name, 0.0) + along
    return {name: total < 0 for name, total in pull.items()}


def points_of(bank: TextureBank, laid: Laid, turned: dict[Name, bool]) -> Points:
    """See the strokes of a frame as their texture does."""
    strokes = laid.strokes
    rows, ends, half = [np.zeros(0, np.int64)], [np.zeros((0, 2))], [np.zeros(0)]
    for i in range(len(strokes)):
        part = strokes.rows(i)
        wide = slope_limited_half_widths(strokes, i, bank.margin)
        along = arc(strokes.xy[part])
        along = np.r_[-wide[0], along, along[-1] + wide[-1]]
        rows.append(np.r_[part.start, np.arange(part.start, part.stop), part.stop - 1])
        ends.append(np.stack([along, along[-2] - along], axis=1))
        half.append(np.r_[wide[0], wide, wide[-1]])
    offsets = np.cumsum([len(some) for some in rows]).astype(np.int64)
    row, end = np.concatenate(rows), np.concatenate(ends)
    width = 2.0 * (np.concatenate(half) - bank.margin)
    against = np.array([turned[name] for name in names_of(laid)], bool)[owner(offsets)]
    pulled = np.minimum(np.where(against[:, None], end[:, ::-1], end), END)
    none = np.zeros(len(strokes), bool)
    ink = predicted_ink(bank, Rows(offsets, width, width, pulled, laid.features[row], none, none))
    place = laid.place[row] + np.minimum(end[:, 0], 0.0) - np.minimum(end[:, 1], 0.0)
    wanted = np.concatenate([ink, width[:, None]], axis=1)
    return Points(offsets, place, end, wanted, np.maximum(laid.presence[row], 1e-3))


# ----------------------------------------------------------------------------------- over frames


@dataclass(frozen=True)
class Survey:
    """Rows of texture to be laid, ROWS a px, in the direction of the track.

    Parameters
    ----------
    low : px, where the first row begins: a place along the track, or a distance from an end
    wanted : (R, 5), ink and width
    ends : (R, 2) px from the ends of the stroke, END at most
    """

    low: float
    wanted: np.ndarray
    ends: np.ndarray

    def part(self, low: float, high: float) -> Survey:
        """What lies between two places."""
        a = int(np.clip((low - self.low) * ROWS, 0, len(self.wanted) - 1))
        b = int(np.clip(np.ceil((high - self.low) * ROWS), a + 1, len(self.wanted)))
        return Survey(self.low + a / ROWS, self.wanted[a:b], self.ends[a:b])


@dataclass(frozen=True)
class TrackSurvey:
    """What a track's texture is asked for: along its places, and about either end."""

    body: Survey
    first: Survey
    last: Survey


def survey_tracks(
    frames: Sequence[tuple[list[Name], Points]], margin: float
) -> dict[Name, TrackSurvey]:
    """Gather what all frames ask of each track: the mean at each place, by presence.

    `margin` is px that texture reaches beyond half the width.
    """
    seen: dict[Name, list[Points]] = {}
    for names, points in frames:
        for i, name in enumerate(names):
            seen.setdefault(name, []).append(points.of(i))
    return {name: _survey(_together(some), margin) for name, some in seen.items()}


def _together(some: list[Points]) -> Points:
    offsets = np.cumsum([0] + [len(points.place) for points in some])
    return Points(
        offsets,
        *(
            np.concatenate([getattr(points, field) for points in some])
            for field in ("place", "ends", "wanted", "weight")
        ),
    )


def _survey(points: Points, margin: float) -> TrackSurvey:
    low, high = float(np.floor(points.place.min())), float(points.place.max())
    # Beside an end other texture is laid than in the midst of a stroke. Where ends come and go it
    # is that of neither; but for the tips, nothing lies on an end.
    asked = np.concatenate([points.wanted, np.clip(points.ends, TIP, END)], axis=1)
    body = _means(points.place, asked, points.weight, low, high)
    return TrackSurvey(
        Survey(low, body[:, :-2], body[:, -2:]), _survey_of_tip(points, 0, margin),
        _survey_of_tip(points, 1, margin),
    )  # fmt: skip


def _survey_of_tip(points: Points, k: int, margin: float) -> Survey:
    """What the first tip (k = 0) or the last one of a track's strokes is asked for.

    Rows lie in the direction of the track; `low` is the distance from the end of the outermost.
    """
    distance = points.ends[:, k]
    cap = distance < 0
    half = np.average(points.wanted[cap, WIDTH], weights=points.weight[cap]) / 2 + margin
    near = np.flatnonzero(distance < TIP + SEAM + NODE)
    wanted = _means(
        np.maximum(distance[near], 0.0), points.wanted[near], points.weight[near], 0.0, TIP + SEAM
    )
    beyond = int(np.ceil(half * ROWS))
    wanted = np.concatenate([np.repeat(wanted[:1], beyond, axis=0), wanted])
    ends = np.full((len(wanted), 2), END)
    ends[:, k] = (np.arange(len(wanted)) + 0.5 - beyond) / ROWS
    back = slice(None, None, -1 if k else 1)
    return Survey(-beyond / ROWS, wanted[back], ends[back])


def _means(
    at: np.ndarray, values: np.ndarray, weight: np.ndarray, low: float, high: float
) -> np.ndarray:
    """The weighted means (R, k) of values (N, k) at px `at` (N,), at rows from `low` to `high` px.

    They are taken in cells of NODE px; between these, and where nothing is known, interpolated.
    """
    cells = max(1, int(np.ceil((high - low) / NODE)))
    cell = np.clip(((at - low) / NODE).astype(np.int64), 0, cells - 1)
    total = np.bincount(cell, weight, cells)
    sums = [np.bincount(cell, weight * column, cells) for column in values.T]
    some = np.flatnonzero(total > 0)
    middle = low + (some + 0.5) * NODE
    row = low + (np.arange(max(2, int(np.ceil((high - low) * ROWS)))) + 0.5) / ROWS
    return np.stack([np.interp(row, middle, column[some] / total[some]) for column in sums], axis=1)
