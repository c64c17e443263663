"""Chain segments across faces into the longest curves."""

from __future__ import annotations

import numpy as np

from ..mesh.surface import Surface
from .segments import Segments
from .surface_curves import SurfaceCurves


def chain_segments(
    surface: Surface, segments: Segments, up: np.ndarray, hysteresis: float = 0.0
) -> SurfaceCurves:
    """Join segments end to end into the longest polylines.

    At a junction of three or more ends, the straightest pair goes on and the others end there. Open curves keep the
    direction of most of their segments; closed ones start at their highest point along `up`.

    Every segment is two one-way walks, 2 s from its first end to its second and 2 s + 1 back; walk w starts at end w
    and stops at end w ^ 1. The next walk is the one that starts at the end joined to that.
    """
    count = len(segments)
    if not count:
        return SurfaceCurves.empty()
    points = segments.points(surface)
    mate = _join(segments.node.ravel(), points)
    walks = np.arange(2 * count)

    def following(mate):
        return mate[walks ^ 1]

    # break closed chains at their highest point, in the direction in which most of their segments run
    ring = _last(following(mate)) < 0
    closed_start = np.zeros(0, np.int64)
    if ring.any():
        height = points.reshape(-1, 3) @ up
        rank = np.empty(2 * count, np.int64)
        rank[np.lexsort((walks, -height))] = walks  # 0 = highest
        order = np.argsort(rank)
        top = order[_least(following(mate), rank)]  # for each walk of a ring, its highest start
        starts = np.unique(top[ring])
        forward = np.bincount(
            top[ring], weights=1.0 - 2.0 * (walks[ring] % 2), minlength=2 * count
        )[starts]
        # the two walks round a ring mirror each other: keep the one that runs forward, or at a tie starts lower
        opposite = top[starts ^ 1]
        keep = (forward > 0) | ((forward == 0) & (starts < opposite))
        closed_start = starts[keep]
        other = mate[closed_start]
        mate[closed_start], mate[other] = -1, -1

    last, steps = _rank(following(mate))
    # walks of one chain share their last walk; of a chain and its mirror image keep one
    forward = np.bincount(last, weights=1.0 - 2.0 * (walks % 2), minlength=2 * count)
    first_of = np.full(2 * count, -1)
    begins = mate < 0  # nothing joined to the end that walk w starts from
    first_of[last[begins]] = walks[begins]
    tails = np.flatnonzero(first_of >= 0)
    heads = first_of[tails]
    mirror = heads ^ 1  # the mirrored chain ends with the head's segment walked back
    chosen = (forward[tails] > forward[mirror]) | (
        (forward[tails] == forward[mirror]) & (tails < mirror)
    )
    is_closed = np.zeros(2 * count, bool)
    is_closed[closed_start] = True
    chosen = np.where(is_closed[heads], True, np.where(is_closed[first_of[mirror]], False, chosen))
    tails, heads = tails[chosen], heads[chosen]

    label = np.full(2 * count, -1)
    label[tails] = np.argsort(np.argsort(heads))
    of_walk = label[last]
    used = np.flatnonzero(of_walk >= 0)
    used = used[np.lexsort((-steps[used], of_walk[used]))]
    curve = of_walk[used]
    lengths = np.bincount(curve, minlength=len(tails))
    closed = np.zeros(len(tails), bool)
    closed[label[tails]] = is_closed[heads]

    # rows: the start of every walk, then the end of the curve's last walk
    offsets = np.r_[0, np.cumsum(lengths + 1)]
    start_row = np.arange(len(used)) + curve
    final = used[np.cumsum(lengths) - 1]
    face = np.empty(offsets[-1], np.int64)
    bary, strength = np.empty((offsets[-1], 3)), np.empty(offsets[-1])
    flat_bary, flat_strength = segments.bary.reshape(-1, 3), segments.strength.ravel()
    for rows, end in ((start_row, used), (offsets[1:] - 1, final ^ 1)):
        face[rows], bary[rows], strength[rows] = (
            segments.face[end // 2],
            flat_bary[end],
            flat_strength[end],
        )
    face[offsets[1:][closed] - 1] = face[offsets[:-1][closed]]
    bary[offsets[1:][closed] - 1] = bary[offsets[:-1][closed]]
    curves = SurfaceCurves(
        face, bary, offsets, np.full(len(tails), segments.kind), closed, strength
    )
    curves = _drop_repeats(surface, curves)
    if hysteresis > 0.0 and len(curves):
        curves = curves.take(
            np.maximum.reduceat(curves.strength, curves.offsets[:-1]) >= hysteresis
        )
    return curves


def _join(node: np.ndarray, points: np.ndarray) -> np.ndarray:
    """For each end (2S,), the end of another segment that goes on from it, or -1."""
    order = np.argsort(node, kind="stable")
    name = node[order]
    first = np.flatnonzero(np.r_[True, name[1:] != name[:-1]])
    degree = np.diff(np.r_[first, len(name)])
    mate = np.full(len(node), -1)
    pair = first[degree == 2]
    a, b = order[pair], order[pair + 1]
    mate[a], mate[b] = b, a
    direction = points[:, 1] - points[:, 0]
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-30)[:, None]
    outward = np.stack([direction, -direction], axis=1).reshape(
        -1, 3
    )  # away from each end into its segment
    for start, size in zip(
        first[degree > 2], degree[degree > 2], strict=True
    ):  # few: forks and corners
        ends = order[start : start + size]
        cosine = outward[ends] @ outward[ends].T
        np.fill_diagonal(cosine, 1.0)
        while True:
            i, j = np.unravel_index(cosine.argmin(), cosine.shape)
            if cosine[i, j] > -0.5:  # a bend of more than 60 degrees is a corner
                break
            mate[ends[i]], mate[ends[j]] = ends[j], ends[i]
            cosine[[i, j]] = cosine[:, [i, j]] = 1.0
    return mate


def _last(following: np.ndarray) -> np.ndarray:
    """The last walk of each walk's chain, -1 on rings: pointer doubling."""
    return _rank(following)[0]


def _rank(following: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each walk the last walk of its chain (-1 on rings) and the number of steps to it."""
    walks = np.arange(len(following))
    jump = np.where(following < 0, walks, following)
    steps = (following >= 0).astype(np.int64)
    for _ in range(int(len(following)).bit_length()):
        steps = steps + steps[jump]
        jump = jump[jump]
    return np.where(following[jump] < 0, jump, -1), steps


def _least(following: np.ndarray, value: np.ndarray) -> np.ndarray:
    """The least value on each walk's ring."""
    walks = np.arange(len(following))
    jump = np.where(following < 0, walks, following)
    for _ in range(int(len(following)).bit_length()):
        value = np.minimum(value, value[jump])
        jump = jump[jump]
    return value


def _drop_repeats(surface: Surface, curves: SurfaceCurves) -> SurfaceCurves:
    """Leave out points that coincide with the one before, and curves of which nothing remains.

    Lines through a vertex cross several edges in one point.
    """
    points = curves.points(surface)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    keep = np.r_[
        step > 1e-9, True
    ]  # drop the earlier of two equal points: its segment has no length
    last = curves.offsets[1:] - 1
    keep[last] = True
    curve = np.repeat(np.arange(len(curves)), np.diff(curves.offsets))
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
