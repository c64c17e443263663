"""Cut strokes out of what is drawn of sheets, join them end to end, and give them names that last.

Where one planned stroke runs from sheet to sheet, or is cut between them, it does so by thresholds,
which lines pass from frame to frame. So whether two ends that meet are drawn in one stroke is
decided over time, like what is drawn: against the least of the plans, where a change costs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.curves import arc
from ..mesh.triangles import row_dot
from ..render.plan import heading
from .persist import Fate
from .sheets import GAP, PLANNED, Points

SHORTEST = 8.0  # px of a stroke
MEETING = 18.0  # px between ends that may be drawn through
BEND = np.cos(np.radians(50.0))  # between the headings of such ends, where no plan says so
SPAN = 4  # points over which a heading is measured
HOOK = 6  # points, at most, of what is left out where a stroke turns back
REPEATED = 0.5  # px; nearer points of a stroke are one


@dataclass(frozen=True)
class Stroke:
    """One stroke of one frame.

    Parameters
    ----------
    track : int, its name
    rows : (n,) int, its points among those of the frame, in the order in which it is drawn
    sheet, along : (n,), where on which sheet they lie
    """

    track: int
    rows: np.ndarray
    sheet: np.ndarray
    along: np.ndarray

    def turned(self) -> Stroke:
        """Draw it the other way round."""
        return replace(self, rows=self.rows[::-1], sheet=self.sheet[::-1], along=self.along[::-1])

    def stretches(self) -> dict[int, tuple[float, float, int]]:
        """List its sheets: from where to where it lies on each, and 1 or -1 as that rises."""
        out = {}
        for sheet in dict.fromkeys(self.sheet.tolist()):
            along = self.along[self.sheet == sheet]
            out[sheet] = (along.min(), along.max(), 1 if along[-1] >= along[0] else -1)
        return out


class _End(NamedTuple):
    """An end of a stretch: which stretch, and 0 for its beginning or -1."""

    stretch: int
    side: int


class _Meeting(NamedTuple):
    """Two ends of stretches of one frame that meet.

    Parameters
    ----------
    one, two : the ends
    key : what is the same of the meeting in all frames: sheets and sides of both
    plan : 1 where a planned stroke runs from one to the other, -1 where planned strokes end there,
        0 where nothing tells
    gap : px between them
    """

    one: _End
    two: _End
    key: tuple[int, int, int, int]
    plan: int
    gap: float


def name_strokes(frames: list[Points], fates: list[Fate]) -> list[list[Stroke]]:
    """Cut the strokes of all frames, and name each as what it continues.

    A stroke continues the one with which it has most of its sheets in common, of the frame before
    or else of the last in which there was one.
    """
    cut = [list(_cut(points, fate.drawn)) for points, fate in zip(frames, fates, strict=True)]
    meetings = [_meetings(points, some) for points, some in zip(frames, cut, strict=True)]
    there = [
        {int(points.sheet[rows[0]]) for rows in some}
        for points, some in zip(frames, cut, strict=True)
    ]
    joined = _decide(meetings, there)
    names = _Names()
    out: list[list[Stroke]] = []
    for points, some, met, through in zip(frames, cut, meetings, joined, strict=True):
        chains = _chained(len(some), [m for m, yes in zip(met, through, strict=True) if yes])
        strokes = [_stroke(points, some, chain) for chain in chains]
        long = [s for s in strokes if arc(points.xy[s.rows])[-1] >= SHORTEST]
        out.append(names.named(long, out[-1] if out else []))
    return out


def _cut(points: Points, drawn: np.ndarray) -> Iterator[np.ndarray]:
    """Cut out stretches of sheets that are drawn and hang together: their points (n,) int."""
    row = np.flatnonzero(drawn)
    if not len(row):
        return
    step = np.hypot(*np.diff(points.xy[row], axis=0).T)
    apart = (np.diff(points.sheet[row]) != 0) | (step > GAP)
    start = np.r_[0, np.flatnonzero(apart) + 1, len(row)]
    for a, b in zip(start[:-1], start[1:], strict=True):
        if b - a >= 2:
            yield row[a:b]


def _meetings(points: Points, cut: list[np.ndarray]) -> list[_Meeting]:
    """Find the ends of stretches of one frame that meet."""
    ends = [_End(i, side) for i in range(len(cut)) for side in (0, -1)]
    if len(ends) < 3:
        return []
    row = np.array([cut[end.stretch][end.side] for end in ends])
    out = np.array(
        [heading(points.xy[cut[e.stretch]][:: -1 if e.side == 0 else 1], SPAN) for e in ends]
    )
    pairs = cKDTree(points.xy[row]).query_pairs(MEETING, output_type="ndarray").reshape(-1, 2)
    found = []
    for i, j in pairs.tolist():
        one, two = ends[i], ends[j]
        if one.stretch == two.stretch:
            continue
        plan = _planned_through(points, int(row[i]), int(row[j]))
        if plan < 1 and -(out[i] @ out[j]) < BEND:
            continue
        sheets = (int(points.sheet[row[i]]), int(points.sheet[row[j]]))
        key = min(
            (sheets[0], one.side, sheets[1], two.side), (sheets[1], two.side, sheets[0], one.side)
        )
        gap = float(np.hypot(*(points.xy[row[i]] - points.xy[row[j]])))
        found.append(_Meeting(one, two, key, plan, gap))
    return found


def _planned_through(points: Points, i: int, j: int) -> int:
    """Tell what the plan says of two ends: one stroke 1, two -1, nothing 0."""
    a, b = int(points.row[i]), int(points.row[j])
    if a < 0 or b < 0:
        return 1 if points.sheet[i] == points.sheet[j] else 0
    return 1 if abs(a - b) <= 1 else -1


def _decide(frames: list[list[_Meeting]], there: list[set[int]]) -> list[list[bool]]:
    """Decide which meetings of all frames are drawn through: by the plans, with few changes.

    Where both sheets are drawn and their ends do not meet, they are drawn apart as if planned so:
    what parts soon, or has just met, is not one stroke. `there` are the sheets drawn in each frame.
    """
    seen: dict[tuple[int, int, int, int], dict[int, list[tuple[int, int]]]] = {}
    for t, meetings in enumerate(frames):
        for k, meeting in enumerate(meetings):
            seen.setdefault(meeting.key, {}).setdefault(t, []).append((k, meeting.plan))
    out = [[False] * len(meetings) for meetings in frames]
    for key, times in seen.items():
        for some in _episodes(times, {key[0], key[2]}, there):
            plans = [max((plan for _, plan in times.get(t, [(0, -1)])), default=0) for t in some]
            if key[0] == key[2] or sum(plans) > 0:
                for t in some:
                    for k, _ in times.get(t, []):
                        out[t][k] = True
    return out


def _episodes(
    times: dict[int, list[tuple[int, int]]], sheets: set[int], there: list[set[int]]
) -> Iterator[list[int]]:
    """List the frames, without a break, in which both sheets of a meeting are drawn."""
    left = sorted(times)
    while left:
        first = last = left[0]
        while first > 0 and sheets <= there[first - 1]:
            first -= 1
        while last + 1 < len(there) and sheets <= there[last + 1]:
            last += 1
        yield list(range(first, last + 1))
        left = [t for t in left if t > last]


def _chained(count: int, meetings: list[_Meeting]) -> list[list[tuple[int, bool]]]:
    """Chain stretches whose ends are drawn through: of each chain the stretches, and if turned.

    Planned meetings go first, then the nearest; no chain closes on itself.
    """
    mate: dict[_End, _End] = {}
    chain = np.arange(count)
    for meeting in sorted(meetings, key=lambda m: (-m.plan, m.gap)):
        one, two = meeting.one, meeting.two
        if one in mate or two in mate or chain[one.stretch] == chain[two.stretch]:
            continue
        mate[one], mate[two] = two, one
        chain[chain == chain[two.stretch]] = chain[one.stretch]
    out: list[list[tuple[int, bool]]] = []
    done: set[int] = set()
    for i in range(count):
        if i in done:
            continue
        end = _End(i, 0)
        while end in mate:  # to the beginning of the chain
            end = _other(mate[end])
        links = []
        while True:
            links.append((end.stretch, end.side == -1))
            done.add(end.stretch)
            if _other(end) not in mate:
                break
            end = mate[_other(end)]
        out.append(links)
    return out


def _other(end: _End) -> _End:
    return _End(end.stretch, -1 - end.side)


def _stroke(points: Points, cut: list[np.ndarray], chain: list[tuple[int, bool]]) -> Stroke:
    """Put a stroke together of stretches one after the other, the longest as its sheet rises."""
    longest = max(chain, key=lambda link: len(cut[link[0]]))
    if longest[1]:
        chain = [(i, not turned) for i, turned in chain[::-1]]
    rows = np.concatenate([cut[i][::-1] if turned else cut[i] for i, turned in chain])
    rows = _apart(points, _without_hooks(points, _apart(points, rows)))
    return Stroke(-1, rows, points.sheet[rows], points.along[rows])


def _apart(points: Points, rows: np.ndarray) -> np.ndarray:
    """Leave out points that lie where the one before them does."""
    step = np.hypot(*np.diff(points.xy[rows], axis=0).T)
    return rows[np.r_[True, step > REPEATED]]


def _without_hooks(points: Points, rows: np.ndarray) -> np.ndarray:
    """Leave out points at which a stroke turns back where pieces of it meet, not where planned."""
    for _ in range(HOOK):
        step = np.diff(points.xy[rows], axis=0)
        back = row_dot(step[:-1], step[1:]) < 0.0
        plan = points.row[rows]
        back &= (np.abs(np.diff(plan)[:-1]) != 1) | (np.abs(np.diff(plan)[1:]) != 1)
        if not back.any():
            break
        drop = np.zeros(len(rows), bool)
        drop[1:-1] = back
        loose = points.support[rows] != PLANNED  # rather than the planned ones beside them
        beside = np.zeros(len(rows), bool)
        beside[:-1] |= drop[1:]
        beside[1:] |= drop[:-1]
        free = loose & beside
        free[[0, -1]] = False
        rows = rows[~np.where(free.any(), (drop & loose) | free, drop)]
    return rows


class _Names:
    """Hands out names, and remembers where on which sheets each was last."""

    def __init__(self) -> None:
        self.count = 0
        self.last: dict[int, dict[int, tuple[float, float, int]]] = {}
        self.on_sheet: dict[int, set[int]] = {}

    def named(self, strokes: list[Stroke], before: list[Stroke]) -> list[Stroke]:
        """Name the strokes of a frame after those of the frame before, and direct them alike."""
        recent = {stroke.track for stroke in before}
        named: dict[int, int] = {}
        stretches = [stroke.stretches() for stroke in strokes]
        for names in (recent, set(self.last) - recent):
            pairs = sorted(self._pairs(stretches, names), reverse=True)
            for _, i, track in pairs:
                if i not in named and track not in named.values():
                    named[i] = track
        out = []
        for i, stroke in enumerate(strokes):
            if i not in named:
                named[i], self.count = self.count, self.count + 1
            out.append(self._directed(replace(stroke, track=named[i])))
        return out

    def _pairs(
        self, stretches: list[dict[int, tuple[float, float, int]]], names: set[int]
    ) -> Iterator[tuple[float, int, int]]:
        """Measure how much of their sheets strokes share with some names: px, stroke, name."""
        for i, own in enumerate(stretches):
            common: dict[int, float] = {}
            for sheet, (low, high, _) in own.items():
                for track in self.on_sheet.get(sheet, set()) & names:
                    there = self.last[track].get(sheet)
                    if there is not None:
                        share = min(high, there[1]) - max(low, there[0])
                        if share > 0.0:
                            common[track] = common.get(track, 0.0) + float(share)
            for track, share in common.items():
                yield share, i, track

    def _directed(self, stroke: Stroke) -> Stroke:
        """Direct a stroke as it was before, and remember it."""
        before, votes = self.last.get(stroke.track, {}), 0.0
        for sheet, (low, high, sign) in stroke.stretches().items():
            if sheet in before:
                votes += sign * before[sheet][2] * (high - low)
        if votes < 0.0:
            stroke = stroke.turned()
        self.last[stroke.track] = stroke.stretches()
        for sheet in self.last[stroke.track]:
            self.on_sheet.setdefault(sheet, set()).add(stroke.track)
        return stroke
