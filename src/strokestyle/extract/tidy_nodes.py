"""Find nodes: the points where lines must end, or pass, exactly."""

from __future__ import annotations

import numpy as np

from ..geometry.curves import Curves, arc_length, owner
from .tidy_lines import SOFT

SAME_PLACE = 1e-4  # px; vertices of the mesh are projected once a line, and agree to rounding
CRISP = 10.0  # degrees, by which a line turns in one point that is a corner of its own
ARM = 6.0  # px before and behind a crisp corner, over which the line runs straight
STRAIGHT = 1.005  # x as long as its chord


def find_nodes(curves: Curves) -> np.ndarray:
    """Find the points of hard curves at which others end, and those of their crisp corners.

    Returns
    -------
    (N,) bool. Ends of two curves, or the end of one and a point of another, are a node where they
    are the same point. A crisp corner turns by CRISP degrees or more between straight sides.
    """
    hard = ~SOFT[curves.kind][owner(curves.offsets)]
    node = np.zeros(len(curves.xy), bool)
    rows = np.flatnonzero(hard)
    if len(rows):
        node[rows] = _is_shared(curves, rows)
        node |= hard & _is_crisp(curves)
    return node


def _is_shared(curves: Curves, rows: np.ndarray) -> np.ndarray:
    """Tell of which `rows` (M,) another curve ends in the same place, (M,) bool."""
    end = np.zeros(len(curves.xy), bool)
    open_ = ~curves.closed
    end[curves.offsets[:-1][open_]] = end[curves.offsets[1:][open_] - 1] = True
    place = np.rint(curves.xy[rows] / SAME_PLACE + 0.377).astype(np.int64)
    order = np.lexsort((place[:, 1], place[:, 0]))
    change = np.r_[True, (np.diff(place[order], axis=0) != 0).any(axis=1)]
    start = np.flatnonzero(change)
    of = owner(curves.offsets)[rows[order]]
    several = np.maximum.reduceat(of, start) > np.minimum.reduceat(of, start)
    ends = np.add.reduceat(end[rows[order]], start, dtype=np.int64)
    shared = np.zeros(len(rows), bool)
    shared[order] = (several & (ends > 0))[np.cumsum(change) - 1]
    return shared


def _is_crisp(curves: Curves) -> np.ndarray:
    """Tell at which points (N,) a curve turns at once, between straight sides, (N,) bool."""
    xy, offsets = curves.xy, curves.offsets
    crisp = np.zeros(len(xy), bool)
    turn = turns_at(curves)
    here = np.flatnonzero(turn > CRISP)
    if not len(here):
        return crisp
    of = owner(offsets)[here]
    along = arc_length(xy, offsets)
    # arc length over all curves, so that a place along one is found by a bisection
    apart = along[offsets[1:] - 1] + 1.0
    place = along + np.repeat(np.cumsum(apart) - apart, np.diff(offsets))
    good = np.ones(len(here), bool)
    ends = offsets[:-1][of], offsets[1:][of] - 1
    for sign, start, stop in ((-1, *ends), (1, *ends[::-1])):
        near = np.where(here == start, stop, here)  # round a closed curve
        far = np.searchsorted(place, place[near] + sign * ARM)
        far = np.clip(far, *ends)
        arc = np.abs(place[far] - place[near])
        chord = np.linalg.norm(xy[far] - xy[near], axis=1)
        good &= (arc <= STRAIGHT * chord) & (arc > 0.5 * ARM)
    crisp[here] = good
    return crisp


def turns_at(curves: Curves) -> np.ndarray:
    """Measure the angle (N,) between the steps to and from each point, degrees; 0 at open ends."""
    xy, first, last = curves.xy, curves.offsets[:-1], curves.offsets[1:] - 1
    step = np.diff(xy, axis=0, append=xy[-1:])
    to, away = np.roll(step, 1, axis=0), step.copy()
    to[first], away[last] = to[last], step[first]
    cross = to[:, 0] * away[:, 1] - to[:, 1] * away[:, 0]
    turn = np.degrees(np.abs(np.arctan2(cross, np.einsum("ij,ij->i", to, away))))
    ends = np.stack([first, last])[:, ~curves.closed]
    turn[ends.ravel()] = 0.0
    return turn
