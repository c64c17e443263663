"""Tell which sheet each stretch of a frame's planned strokes belongs to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.curves import arc, runs, tangents
from ..geometry.kinds import KINDS
from ..mesh.triangles import row_dot
from ..render.plan import PULL
from .candidates import Candidates
from .fit import fitted
from .sheets import FIXED, SOFT, Points, Run, alike_in_depth, extents

CONTOUR = KINDS.index("contour")
REACH = 10.0  # px of the style's canvas between a line and where the surface carried it
NEIGHBOURS = 16  # points of sheets that are looked at for each of a stroke
ANGLE = np.cos(np.radians(40.0))
FACING = 0.5  # cosine between normals on the picture of one contour
OTHER_CLASS = 0.4  # of REACH: what it costs that one of both is soft and the other not
NO_SHEET, NOT_NEAR = 0.8, 1.2  # cost of a point that is of no sheet, and of one that lies off it
SWITCH = 2.0  # cost of going over from sheet to sheet
BRIDGE = 40.0  # px of a stroke that lie off a sheet between stretches on it
AT_END = 15.0  # px from the end of a sheet within which a stroke goes on from it
SHORTEST = 6.0  # px of a sheet that begins
STRAIN_FIXED, STRAIN = (0.25, 4.0), (0.7, 1.4)  # of a line's mean slope
RELAX = 0.9
FOLD = 20.0  # px by which a stroke may run back along its sheet
OVERLAP = 8.0  # px, of two stretches of one sheet
APART = 1.0  # px, between two


class Matches(NamedTuple):
    """Points of strokes that lie on sheets, each sheet once a point.

    Parameters
    ----------
    row : (M,) int, the point, rising
    sheet : (M,) int
    cost : (M,) 0 where it lies just there, 1 at REACH
    along : (M,) where along the sheet
    """

    row: np.ndarray
    sheet: np.ndarray
    cost: np.ndarray
    along: np.ndarray


class _Piece(NamedTuple):
    """A stretch of one planned stroke, on one sheet or on none.

    Parameters
    ----------
    rows : (n,) int, the planned points
    sheet : int, -1 for none
    along : (n,) where along the sheet, NaN where it is not known
    closed : whether it is a closed curve as a whole
    """

    rows: np.ndarray
    sheet: int
    along: np.ndarray
    closed: bool = False

    @property
    def known(self) -> int:
        return int(np.isfinite(self.along).sum())

    def part(self, rows: slice) -> _Piece:
        return _Piece(self.rows[rows], self.sheet, self.along[rows])

    def off(self) -> _Piece:
        """Take it off its sheet."""
        return _Piece(self.rows, -1, np.full(len(self.rows), np.nan), self.closed)


def label_strokes(
    here: Candidates, old: Points, period: dict[int, float], begin: Callable[[float], int]
) -> list[Run]:
    """Cut a frame's planned strokes into runs of one sheet each, and begin sheets for the rest.

    Parameters
    ----------
    here : the strokes
    old : the points of sheets that may be seen, carried here
    period : of sheets that are closed
    begin : makes a sheet, told its length where it is closed and 0 where not
    """
    matches, extent = (
        find_matches(here, old),
        extents(old.take((old.age <= 1) | FIXED[old.kind])),
    )
    runs_found: list[Run] = []
    homeless: list[_Piece] = []
    claims: list[tuple[int, Run]] = []
    for a, b in zip(here.planned.offsets[:-1], here.planned.offsets[1:], strict=True):
        i, j = np.searchsorted(matches.row, [a, b])
        for piece in _pieces(here, a, b, Matches(*(column[i:j] for column in matches)), extent):
            if piece.sheet < 0:
                homeless.append(piece)
                continue
            for one in _one_way(here, piece, period.get(piece.sheet)):
                if one.sheet < 0:
                    homeless.append(one)
                else:
                    claims.append((one.known, _fitted(here, one)))
    for run in _without_overlaps(claims, homeless):
        runs_found.append(run)
    for piece in homeless:
        if arc(here.planned.xy[piece.rows])[-1] >= SHORTEST:
            runs_found.append(_born(here, piece, begin))
    return runs_found


def find_matches(here: Candidates, old: Points) -> Matches:
    """Find for the points of planned strokes (N,) the sheets that they lie on.

    A point lies on a sheet where one of its points was carried to within REACH, runs the same way,
    lies as deep, and, of contours, has the shape on the same side.
    """
    none = np.zeros(0)
    xy = here.planned.xy
    if not len(old) or not len(xy):
        return Matches(none.astype(int), none.astype(int), none, none)
    k = min(NEIGHBOURS, len(old))
    away, near = cKDTree(old.xy).query(xy, k=k, distance_upper_bound=REACH)
    away, near = away.reshape(len(xy), k), near.reshape(len(xy), k)
    row, column = np.nonzero(away < np.inf)
    at = near[row, column]
    heading, tangent = tangents(xy, here.planned.offsets)[row], old.tangents[at]
    step = xy[row] - old.xy[at]
    ahead = row_dot(step, tangent)
    aside = np.abs(step[:, 0] * tangent[:, 1] - step[:, 1] * tangent[:, 0])
    rate, gap = _rates(old)
    good = np.abs(row_dot(heading, tangent)) > ANGLE
    good &= np.abs(ahead) <= np.maximum(0.75 * gap[at], 2.0)
    good &= _alike(here, old, row, at)
    row, at, ahead, aside = row[good], at[good], ahead[good], aside[good]
    soft = SOFT[here.kind[row]] != SOFT[old.kind[at]]
    cost = aside / REACH + OTHER_CLASS * soft + 0.05 * np.minimum(old.age[at], 4)
    order = np.lexsort((cost + 0.05 * np.abs(ahead), old.sheet[at], row))
    first = runs(row[order], old.sheet[at][order])[:-1]
    best = order[first]
    along = old.along[at] + ahead * rate[at]
    return Matches(row[best], old.sheet[at][best], cost[best], along[best])


def _rates(old: Points) -> tuple[np.ndarray, np.ndarray]:
    """Measure how fast `along` rises per px at points (P,), and the px to the next points (P,)."""
    follows = old.follows
    step = np.r_[0.0, np.hypot(*np.diff(old.xy, axis=0).T)]
    rise = np.r_[0.0, np.diff(old.along)]
    step, rise = np.where(follows, step, 0.0), np.where(follows, rise, 0.0)
    after_step, after_rise = np.r_[step[1:], 0.0], np.r_[rise[1:], 0.0]
    total = step + after_step
    rate = np.where(total > 1e-6, (rise + after_rise) / np.maximum(total, 1e-6), 1.0)
    return np.clip(rate, 0.05, 20.0), np.maximum(step, after_step)


def _alike(here: Candidates, old: Points, row: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Tell which pairs of a planned point and one of a sheet may be one line, (M,) bool."""
    camera = here.shot.camera
    depth, was = (camera.project(p.points(here.shot))[1] for p in (here.places, old.places))
    fixed = FIXED[here.kind[row]] & FIXED[old.kind[at]]
    good = alike_in_depth(here, depth[row], was[at], fixed)
    right, down, _ = camera.axes
    screen = np.stack([right, down], axis=1)
    normal, before = (p.normals(here.shot) @ screen for p in (here.places, old.places))
    one, two = normal[row], before[at]
    size = np.maximum(np.hypot(*one.T) * np.hypot(*two.T), 1e-9)
    contour = (here.kind[row] == CONTOUR) & (old.kind[at] == CONTOUR)
    return good & (~contour | (row_dot(one, two) > FACING * size))


def _pieces(
    here: Candidates, a: int, b: int, matches: Matches, extent: dict[int, tuple[float, float]]
) -> list[_Piece]:
    """Cut the planned stroke of rows a to b into pieces of one sheet, or none, each."""
    rows = np.arange(a, b)
    closed = b - a > 3 and bool(np.abs(here.planned.xy[a] - here.planned.xy[b - 1]).max() < 1e-6)
    if not len(matches.row):
        return [_Piece(rows, -1, np.full(len(rows), np.nan), closed)]
    sheets, column = np.unique(matches.sheet, return_inverse=True)
    cost = np.full((len(rows), len(sheets) + 1), NOT_NEAR)
    along = np.full((len(rows), len(sheets) + 1), np.nan)
    cost[:, -1] = NO_SHEET
    cost[matches.row - a, column] = np.minimum(matches.cost, NOT_NEAR)
    along[matches.row - a, column] = matches.along
    if closed:  # begin where it goes over from sheet to sheet, or where its sheet begins
        turn = _beginning(cost, along)
        order = np.r_[np.arange(turn, len(rows) - 1), np.arange(turn + 1)]
        rows, cost, along = rows[order], cost[order], along[order]
    label = _smoothed_labels(cost)
    label = _taken_along(here.planned.xy[rows], label, along, sheets, extent)
    whole = closed and (label == label[0]).all()
    names = np.r_[sheets, -1]
    starts = runs(label)
    found = []
    for i, j in zip(starts[:-1], starts[1:], strict=True):
        k = label[i]
        # neighbours share the point between them
        part = slice(i, min(j + 1, len(rows)))
        found.append(_Piece(rows[part], int(names[k]), along[part, k], whole))
    return found


def _beginning(cost: np.ndarray, along: np.ndarray) -> int:
    """Choose the point at which a closed stroke begins, of costs and places (n, S + 1)."""
    label = cost.argmin(axis=1)
    most = int(np.bincount(label).argmax())
    known = np.flatnonzero(np.isfinite(along[:-1, most]))
    if len(known) > 1 and most < along.shape[1] - 1:
        q = along[known, most]
        jump = np.abs(np.diff(q, append=q[0]))
        if jump.max() > max(FOLD, 0.5 * np.ptp(q)):
            return int(known[(int(jump.argmax()) + 1) % len(known)])
    change = np.flatnonzero(label[1:] != label[:-1]) + 1
    if not len(change):
        return 0
    firm = ndimage.uniform_filter1d(cost.min(axis=1), 9, mode="wrap")[change]
    return int(change[firm.argmin()])


def _smoothed_labels(cost: np.ndarray) -> np.ndarray:
    """Choose a column for each point of a stroke, at least cost (n, S + 1) with SWITCH for changes.

    Changes are sought where the least cost of the points changes (Viterbi's algorithm over these
    runs).
    """
    nearest = cost.argmin(axis=1)
    starts = runs(nearest)
    if len(starts) == 2:
        return nearest
    total = np.add.reduceat(cost, starts[:-1], axis=0)
    back = np.zeros(total.shape, np.int64)
    reached = total[0]
    for i in range(1, len(total)):
        best = int(reached.argmin())
        stays = reached <= reached[best] + SWITCH
        back[i] = np.where(stays, np.arange(len(reached)), best)
        reached = np.minimum(reached, reached[best] + SWITCH) + total[i]
    label = np.zeros(len(total), np.int64)
    label[-1] = int(reached.argmin())
    for i in range(len(total) - 1, 0, -1):
        label[i - 1] = back[i][label[i]]
    return np.repeat(label, np.diff(starts))


def _taken_along(
    xy: np.ndarray,
    label: np.ndarray,
    along: np.ndarray,
    sheets: np.ndarray,
    extent: dict[int, tuple[float, float]],
) -> np.ndarray:
    """Give stretches of no sheet to the sheets before or after that end there, (n,) labels."""
    none, starts = len(sheets), runs(label)
    s = arc(xy)
    kind = label[starts[:-1]]
    out = label.copy()
    for r in np.flatnonzero(kind == none):
        i, j = starts[r], starts[r + 1]
        before = kind[r - 1] if r else none
        after = kind[r + 1] if r + 1 < len(kind) else none
        if before == after != none and s[j] - s[i - 1] <= BRIDGE:
            out[i:j] = before
        elif before != none and _ends(along[:i, before], extent.get(int(sheets[before])), -1):
            out[i:j] = before
        elif after != none and _ends(along[j:, after], extent.get(int(sheets[after])), 0):
            out[i:j] = after
    return out


def _ends(along: np.ndarray, extent: tuple[float, float] | None, side: int) -> bool:
    """Tell whether a sheet ends where a stretch of it (n,) does: with its last point, or first."""
    known = along[np.isfinite(along)]
    if len(known) < 2 or extent is None:
        return False
    rising = np.median(np.diff(known)) > 0
    outward = rising if side else not rising
    return bool(abs(known[side] - extent[int(outward)]) < AT_END)


def _one_way(here: Candidates, piece: _Piece, period: float | None) -> list[_Piece]:
    """Turn a piece so that it runs the way of its sheet, and cut it where it turns back on it."""
    if piece.closed:  # its last point is its first: to go round is not to turn back
        piece = piece._replace(along=np.append(piece.along[:-1], np.nan))
    known = np.flatnonzero(np.isfinite(piece.along))
    if len(known) < 2:
        return [piece.off()]
    step = np.diff(piece.along[known])
    if period is not None:
        wrapped = np.abs(step) > 0.5 * period
        if wrapped.any():
            at = int(known[np.flatnonzero(wrapped)[0]]) + 1
            parts = (piece.part(slice(0, at)), piece.part(slice(at, None)))
            return [one for part in parts for one in _one_way(here, part, period)]
    if np.sign(step).sum() < 0:
        piece = _Piece(piece.rows[::-1], piece.sheet, piece.along[::-1], piece.closed)
        known = np.flatnonzero(np.isfinite(piece.along))
        step = np.diff(piece.along[known])
    back = -np.minimum(step, 0.0).sum()
    if back > FOLD and back > 0.3 * np.maximum(step, 0.0).sum():
        return _unfolded(piece, known)
    return [piece]


def _unfolded(piece: _Piece, known: np.ndarray) -> list[_Piece]:
    """Cut a piece that runs along its sheet and back: the longer part stays on it."""
    q = piece.along[known]
    top, bottom = int(known[q.argmax()]), int(known[q.argmin()])
    cut = max((top, bottom), key=lambda at: min(at, len(piece.rows) - at))
    if min(cut, len(piece.rows) - cut) < 2:
        return [piece]
    parts = [piece.part(slice(0, cut + 1)), piece.part(slice(cut, None))]
    parts.sort(key=lambda part: -part.known)
    if np.nansum(np.sign(np.diff(parts[0].along))) < 0:
        parts[0] = _Piece(parts[0].rows[::-1], parts[0].sheet, parts[0].along[::-1])
    return [parts[0], parts[1].off()]


def _fitted(here: Candidates, piece: _Piece) -> Run:
    """Make a run of a piece: its points' coordinates are smoothed, and rise.

    On a line fixed on the surface they stay what they are, up to noise. On others they follow the
    surface no farther than STRAIN lets them, and RELAX towards an even rise: else points of the
    surface that turn away from a contour would heap up on it.
    """
    s, known = arc(here.planned.xy[piece.rows]), np.isfinite(piece.along)
    at, q = s[known], piece.along[known]
    span = max(float(at[-1] - at[0]), 1e-6)
    mean = float(np.clip((q.max() - q.min()) / span, 0.05, 20.0)) if span > FOLD else 1.0
    fixed = FIXED[here.kind[piece.rows]].mean() > 0.5
    strain, relax = (STRAIN_FIXED, 1.0) if fixed else (STRAIN, RELAX)
    along = fitted(s, piece.along, mean, strain, relax)
    return Run(piece.rows, piece.sheet, along, known)


def _without_overlaps(claims: list[tuple[int, Run]], homeless: list[_Piece]) -> list[Run]:
    """Keep the best of runs that claim one stretch of a sheet; the others become homeless.

    Runs that overlap but little are moved apart, or their points would come to lie in turns.
    """
    taken: dict[int, list[tuple[float, float]]] = {}
    out = []
    for _, run in sorted(claims, key=lambda pair: -pair[0]):
        low, high = float(run.along[0]), float(run.along[-1])
        least = min(OVERLAP, 0.3 * (high - low))
        others = taken.setdefault(run.sheet, [])
        shift, homes = 0.0, True
        for a, b in others:
            common = min(high, b) - max(low, a)
            homes = homes and common <= least
            if common > -APART:
                shift = max(common + APART, 0.0) * (1.0 if low + high > a + b else -1.0)
        if homes and shift:  # where that moves it onto a third, it is in the way as well
            homes = all(min(high + shift, b) - max(low + shift, a) <= 0.0 for a, b in others)
        if not homes:
            homeless.append(_Piece(run.rows, -1, np.full(len(run.rows), np.nan)))
            continue
        others.append((low + shift, high + shift))
        out.append(replace(run, along=run.along + shift))
    return out


def _born(here: Candidates, piece: _Piece, begin: Callable[[float], int]) -> Run:
    """Begin a sheet with a piece that lies on none, in the direction of an easy stroke."""
    xy, rows = here.planned.xy[piece.rows], piece.rows
    if not piece.closed and (xy[-1] - xy[0]) @ PULL < 0:
        rows, xy = rows[::-1], xy[::-1]
    along = arc(xy)
    sheet = begin(float(along[-1]) if piece.closed else 0.0)
    return Run(rows, sheet, along, np.zeros(len(rows), bool))
