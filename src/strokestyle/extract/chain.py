"""Chain segments across faces into the longest curves.

Every segment is two one-way walks: walk 2 s goes from the first end of segment s to its second,
walk 2 s + 1 goes back. So walk w starts at end w and stops at end w ^ 1, and w ^ 1 is also the same
segment walked the other way. The walk that follows w is the one that starts at the end joined to
w's last. Chains are found in all segments at once, by pointer doubling.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.curves import owner, runs
from ..mesh.surface import Surface
from .segments import Segments
from .surface_curves import SurfaceCurves

CORNER_COSINE = -0.5  # ends of a junction that bend by more than 60 degrees are not joined
FEW = 16  # ends of a junction of which all pairs are looked at
SAME_POINT = 1e-9  # in longest sides of the shape; points of a curve that are nearer are one


class Chains(NamedTuple):
    """Walks that follow each other, chain by chain.

    Parameters
    ----------
    walk : (W,) int, all walks of chain 0 in order, then those of chain 1, and so on
    offsets : (C+1,) int, chain i is rows offsets[i]:offsets[i+1] of `walk`
    closed : (C,) bool, whether a chain's last walk stops where its first one starts
    """

    walk: np.ndarray
    offsets: np.ndarray
    closed: np.ndarray


def chain_segments(
    surface: Surface, segments: Segments, up: np.ndarray, hysteresis: float = 0.0
) -> SurfaceCurves:
    """Join segments end to end into the longest polylines.

    At a junction of three or more ends, the straightest pair goes on and the others end there. Open
    curves keep the direction of most of their segments; closed ones start at their highest point.

    Parameters
    ----------
    segments : of one kind, in faces of `surface`
    up : (3,), the direction along which closed curves are highest where they start
    hysteresis : strength in 0..1 that a curve must reach somewhere; 0 keeps all curves
    """
    if not len(segments):
        return SurfaceCurves.empty()
    points = segments.points(surface)
    mate = _join_ends(segments.node.ravel(), points)
    ring_starts = _ring_starts(mate, points.reshape(-1, 3) @ up)
    _cut_before(ring_starts, mate)
    curves = _curves_of(segments, _chains(mate, ring_starts))
    curves = _drop_repeats(surface, curves)
    if hysteresis > 0.0 and len(curves):
        strongest = np.maximum.reduceat(curves.strength, curves.offsets[:-1])
        curves = curves.take(strongest >= hysteresis)
    return curves


def _join_ends(node: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Find for each end, named `node` (2S,), the end of a segment that goes on from it, or -1.

    `points` (S, 2, 3) are the ends in space.
    """
    order = np.argsort(node, kind="stable")
    start = runs(node[order])
    degree = np.diff(start)
    mate = np.full(len(node), -1)
    pair = start[:-1][degree == 2]
    a, b = order[pair], order[pair + 1]
    mate[a], mate[b] = b, a
    outward = _outward(points)
    for d in np.unique(degree[degree > 2]):
        junctions = order[start[:-1][degree == d][:, None] + np.arange(d)]
        if d <= FEW:
            _join_straightest(junctions, outward, mate)
        else:
            for ends in junctions:
                _join_many(ends, outward[ends], mate)
    return mate


def _outward(points: np.ndarray) -> np.ndarray:
    """Point from each end into its segment, by unit vectors (2S, 3); `points` are (S, 2, 3)."""
    direction = points[:, 1] - points[:, 0]
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-30)[:, None]
    return np.stack([direction, -direction], axis=1).reshape(-1, 3)


def _join_straightest(ends: np.ndarray, outward: np.ndarray, mate: np.ndarray) -> None:
    """Join the ends (J, d) of junctions in `mate`, straightest pairs first, down to a corner."""
    direction = outward[ends]
    cosine = np.einsum("jik,jlk->jil", direction, direction)
    degree = ends.shape[1]
    cosine[:, np.arange(degree), np.arange(degree)] = 1.0
    for _ in range(degree // 2):
        best = cosine.reshape(len(ends), -1).argmin(axis=1)
        i, j = best // degree, best % degree
        here = np.flatnonzero(cosine[np.arange(len(ends)), i, j] <= CORNER_COSINE)
        if not len(here):
            break
        i, j = i[here], j[here]
        mate[ends[here, i]], mate[ends[here, j]] = ends[here, j], ends[here, i]
        for k in (i, j):
            cosine[here, k] = cosine[here, :, k] = 1.0


def _join_many(ends: np.ndarray, direction: np.ndarray, mate: np.ndarray) -> None:
    """Join the many ends (E,) of one junction as `_join_straightest` does.

    Each is asked for the few that are straightest, not for all: E^2 would not do at the tip of a
    fan. `direction` (E, 3) points from each end into its segment.
    """
    from scipy.spatial import cKDTree  # takes .1 s to import

    free = np.arange(len(ends))
    while len(free) > 1:
        few = min(FEW, len(free))
        chord, other = cKDTree(direction[free]).query(-direction[free], k=few)
        cosine = 0.5 * np.square(chord) - 1.0
        i, k = np.nonzero((cosine <= CORNER_COSINE) & (other != np.arange(len(free))[:, None]))
        if not len(i):
            break
        by_angle = np.lexsort((other[i, k], i, cosine[i, k]))
        for a, b in zip(free[i[by_angle]], free[other[i, k][by_angle]], strict=True):
            if mate[ends[a]] < 0 and mate[ends[b]] < 0:
                mate[ends[a]], mate[ends[b]] = ends[b], ends[a]
        free = free[mate[ends[free]] < 0]


def _following(mate: np.ndarray) -> np.ndarray:
    """Tell which walk follows each walk, (2S,), -1 after the last one of a chain."""
    return mate[np.arange(len(mate)) ^ 1]


def _votes_forward(group: np.ndarray, walk: np.ndarray, size: int) -> np.ndarray:
    """Count in each of `size` groups the walks that run forward, less those that run back."""
    return np.bincount(group, weights=1.0 - 2.0 * (walk % 2), minlength=size)


def _ring_starts(mate: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Choose one walk for each ring (R,): from its highest point, the way most segments run.

    `height` (2S,) is that of each end.
    """
    following = _following(mate)
    on_ring = _to_last(following)[0] < 0
    if not on_ring.any():
        return np.zeros(0, np.int64)
    walks = np.arange(len(mate))
    order = np.lexsort((walks, -height))  # from the highest start down
    rank = np.empty(len(mate), np.int64)
    rank[order] = walks
    top = order[_least(following, rank)]  # for each walk of a ring, its highest start
    starts = np.unique(top[on_ring])
    forward = _votes_forward(top[on_ring], walks[on_ring], len(mate))[starts]
    # The two walks round a ring mirror each other: keep the one that runs forward, or at a tie
    # starts lower.
    opposite = top[starts ^ 1]
    return starts[(forward > 0) | ((forward == 0) & (starts < opposite))]


def _cut_before(walk: np.ndarray, mate: np.ndarray) -> None:
    """Part the ends from which some walks start from those that they are joined to, in `mate`."""
    other = mate[walk]
    mate[walk], mate[other] = -1, -1


def _chains(mate: np.ndarray, ring_starts: np.ndarray) -> Chains:
    """Put the walks of each chain in order, where rings are cut; one way of the two along each."""
    last, steps = _to_last(_following(mate))
    heads, tails, closed = _one_way(mate, last, ring_starts)
    label = np.full(len(mate), -1)  # chains are counted by their first walks
    label[tails] = np.argsort(np.argsort(heads))
    of_walk = label[last]
    used = np.flatnonzero(of_walk >= 0)
    used = used[np.lexsort((-steps[used], of_walk[used]))]
    lengths = np.bincount(of_walk[used], minlength=len(tails))
    closed_by_label = np.zeros(len(tails), bool)
    closed_by_label[label[tails]] = closed
    return Chains(used, np.r_[0, np.cumsum(lengths)], closed_by_label)


def _one_way(
    mate: np.ndarray, last: np.ndarray, ring_starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Choose for each chain the way along it: its first and its last walk, and if it was a ring.

    All are (C,). Of a chain and its mirror image the one goes that runs the way of most of its
    segments, or at a tie has the lower last walk; of a ring the one from its start.
    `last` (2S,) is the last walk of the chain of each walk, which all its walks share.
    """
    size = len(mate)
    forward = _votes_forward(last, np.arange(size), size)
    first_of = np.full(size, -1)
    begins = np.flatnonzero(mate < 0)  # nothing is joined to the end that such a walk starts from
    first_of[last[begins]] = begins
    tails = np.flatnonzero(first_of >= 0)
    heads = first_of[tails]
    mirror = heads ^ 1  # the mirrored chain ends with the head's segment walked back
    chosen = (forward[tails] > forward[mirror]) | (
        (forward[tails] == forward[mirror]) & (tails < mirror)
    )
    was_ring = np.zeros(size, bool)
    was_ring[ring_starts] = True
    chosen = was_ring[heads] | (chosen & ~was_ring[first_of[mirror]])
    return heads[chosen], tails[chosen], was_ring[heads[chosen]]


def _curves_of(segments: Segments, chains: Chains) -> SurfaceCurves:
    """Make curves of chains: where each walk starts, and last where the last walk of each stops."""
    count = len(chains.closed)
    offsets = chains.offsets + np.arange(count + 1)
    end = np.empty(offsets[-1], np.int64)
    end[np.arange(len(chains.walk)) + owner(chains.offsets)] = chains.walk
    end[offsets[1:] - 1] = chains.walk[chains.offsets[1:] - 1] ^ 1
    face = segments.face[end // 2]
    bary, strength = segments.bary.reshape(-1, 3)[end], segments.strength.ravel()[end]
    first, last = offsets[:-1][chains.closed], offsets[1:][chains.closed] - 1
    face[last], bary[last] = face[first], bary[first]
    kind = np.full(count, segments.kind)
    return SurfaceCurves(face, bary, offsets, kind, chains.closed, strength)


def _to_last(following: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the last walk of each walk's chain (-1 on rings), and the number of steps to it."""
    walks = np.arange(len(following))
    jump = np.where(following < 0, walks, following)
    steps = (following >= 0).astype(np.int64)
    for _ in range(int(len(following)).bit_length()):
        steps = steps + steps[jump]
        jump = jump[jump]
    return np.where(following[jump] < 0, jump, -1), steps


def _least(following: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Find the least `value` on each walk's ring."""
    walks = np.arange(len(following))
    jump = np.where(following < 0, walks, following)
    for _ in range(int(len(following)).bit_length()):
        value = np.minimum(value, value[jump])
        jump = jump[jump]
    return value


def _drop_repeats(surface: Surface, curves: SurfaceCurves) -> SurfaceCurves:
    """Leave out points that coincide with the next one, and curves of which nothing remains.

    Lines through a vertex cross several edges in one point. The earlier of two equal points goes:
    its segment has no length.
    """
    step = np.linalg.norm(np.diff(curves.points(surface), axis=0), axis=1)
    keep = np.r_[step > SAME_POINT, True]
    keep[curves.offsets[1:] - 1] = True
    curve = owner(curves.offsets)
    left = np.bincount(curve[keep], minlength=len(curves))
    good = left >= 2
    keep &= good[curve]
    return SurfaceCurves(
        curves.face[keep],
        curves.bary[keep],
        np.r_[0, np.cumsum(left[good])],
        curves.kind[good],
        curves.closed[good],
        curves.strength[keep],
    )
