"""Close a loop: the last frame of a turn goes over into its first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow
from scipy.spatial import cKDTree

from .compose import Composed

SAME = 4.0  # px between points of one stroke as it is before the turn, and after it
MOST = 0.5  # of a stroke's points
LEAST = 0.3  # of the points of the shorter of two strokes, that these go over together
MARGIN = 2  # frames at either end of all in which no stroke goes over
APART = 20.0  # px between ends, above which it does not matter how far
UNITS = 10  # of a cost a px
SOON = 5  # units that it costs for each frame from the turn's own end


def close(frames: list[list[Composed]], first: int, count: int) -> list[list[Composed]]:
    """Choose the frames of one turn out of more, and let tracks go on over its end.

    What lies before the turn is its end once more, and what lies behind it its beginning, with
    strokes that have another past. Each stroke goes over from what follows the end to what follows
    the beginning in a frame in which both are alike, if there is one: the cut through all frames
    that goes through what is most alike (as Kwatra et al. 2003 choose the seams of textures).
    Strokes that go over keep their names and their places; what a track that lives all the turn has
    gained in it is taken off bit by bit.

    Parameters
    ----------
    frames : strokes of the frames before the turn, of the turn, and of those that follow it
    first, count : the first frame of the turn, and how many it has
    """
    if first + count >= len(frames):
        return [list(strokes) for strokes in frames[first : first + count]]
    reach = min(first, len(frames) - first - count - 1, (count - 1) // 2) - MARGIN
    window = range(-reach, reach + 1) if reach > 0 else range(-1, 1)
    frames = _parted(frames, first, count, window)
    seam = [_Meeting.of(frames[first + count + k], frames[first + k]) for k in window]
    late = _cut(seam)
    turn = [list(strokes) for strokes in frames[first : first + count]]
    for k, meeting, ends in zip(window, seam, late, strict=True):
        turn[k % count] = meeting.drawn(ends)
    for at, own, name, shift in _going_over(window, seam, late):
        _joined(turn, at, own, name, shift)
    return turn


class _Meeting(NamedTuple):
    """One frame of the turn as it follows the end, and as it follows the beginning.

    Parameters
    ----------
    end, beginning : its strokes, n and m
    group : (n + m,) int, of either: those of a group cover one another
    cost : (n + m,), by how much each differs from the other side's, in UNITS
    """

    end: list[Composed]
    beginning: list[Composed]
    group: np.ndarray
    cost: np.ndarray

    @classmethod
    def of(cls, end: list[Composed], beginning: list[Composed]) -> _Meeting:
        n, size = len(end), len(end) + len(beginning)
        cost = np.full(size, 2 * APART * UNITS)
        links = [(i, i) for i in range(size)]
        for i, j, _ in _alike(end, beginning):
            links.append((i, n + j))
            ends = end[i].xy[[0, -1]] - beginning[j].xy[[0, -1]]
            away = UNITS * np.minimum(np.hypot(*ends.T), APART).sum()
            cost[[i, n + j]] = np.minimum(cost[[i, n + j]], away)
        named = {stroke.track: i for i, stroke in enumerate(end)}
        links += [(named[s.track], n + j) for j, s in enumerate(beginning) if s.track in named]
        graph = coo_array((np.ones(len(links)), np.array(links).reshape(-1, 2).T), (size, size))
        return cls(end, beginning, connected_components(graph, directed=False)[1], cost)

    def names(self) -> list[tuple[bool, int]]:
        """Of all strokes, whether they follow the end, and their tracks."""
        return [(True, s.track) for s in self.end] + [(False, s.track) for s in self.beginning]

    def drawn(self, late: np.ndarray) -> list[Composed]:
        """The strokes that are drawn where `late` (G,) groups still follow the end."""
        strokes, n = self.end + self.beginning, len(self.end)
        return [s for i, s in enumerate(strokes) if late[self.group[i]] == (i < n)]


def _cut(seam: list[_Meeting]) -> list[np.ndarray]:
    """Tell of the groups (G,) of each frame whether they still follow the end, at least cost.

    All do so in the first frame, and none in the last; none does so after one that did not.
    """
    sizes = [int(meeting.group.max(initial=-1)) + 1 for meeting in seam]
    base = np.cumsum([0, *sizes])
    source, sink = int(base[-1]), int(base[-1]) + 1
    capacity: dict[tuple[int, int], float] = {}
    never = 1_000_000_000
    for k, (one, two) in enumerate(zip(seam[:-1], seam[1:], strict=True)):
        was = {name: int(base[k] + g) for name, g in zip(one.names(), one.group, strict=True)}
        for name, g, cost in zip(two.names(), two.group, two.cost, strict=True):
            if name in was:
                edge = was[name], int(base[k + 1] + g)
                soon = SOON * abs(k + 1 - len(seam) // 2)
                capacity[edge] = capacity.get(edge, 0.0) + cost + soon
                capacity[edge[::-1]] = never
    ends = {(source, g): never for g in range(sizes[0])}
    ends |= {(int(base[-2]) + g, sink): never for g in range(sizes[-1])}
    edges = np.array(list((capacity | ends).keys())).reshape(-1, 2)
    weight = np.rint(list((capacity | ends).values())).astype(np.int32)
    graph = coo_array((weight, edges.T), (sink + 1, sink + 1)).tocsr()
    flow = maximum_flow(graph, source, sink).flow
    left = graph - flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    reached = np.zeros(sink + 1, bool)
    reached[breadth_first_order(left, source, return_predecessors=False)] = True
    return [reached[a:b] for a, b in zip(base[:-1], base[1:], strict=True)]


def _going_over(
    window: range, seam: list[_Meeting], late: list[np.ndarray]
) -> Iterator[tuple[int, int, int, float]]:
    """List the tracks that go over: in which frame, their name, the name before, px of place."""
    for k in range(1, len(seam)):
        before = {s.track for s in seam[k - 1].drawn(late[k - 1])}
        now = {s.track for s in seam[k].drawn(late[k])}
        for one, two, shift in _matched(seam[k].end, seam[k].beginning):
            if one.track in before and two.track in now and one.track not in now - {two.track}:
                yield window[k], two.track, one.track, shift


def _parted(
    frames: list[list[Composed]], first: int, count: int, window: range
) -> list[list[Composed]]:
    """Name tracks anew that are there at the beginning of a turn and at its end, not in between."""
    alive = [{stroke.track for stroke in some} for some in frames]
    fresh = max((track for some in alive for track in some), default=0) + 1
    early = set().union(*(alive[first + k] for k in window))
    names: dict[int, tuple[int, int]] = {}  # from which frame on, and how it is called then
    middle = range(first + window[-1] + 1, first + count + window[0])
    for track in sorted(early):
        absent = [t for t in middle if track not in alive[t]]
        if absent and any(track in alive[first + count + k] for k in window):
            names[track] = absent[-1], fresh
            fresh += 1
    return [
        [
            replace(s, track=names[s.track][1]) if s.track in names and t > names[s.track][0] else s
            for s in some
        ]
        for t, some in enumerate(frames)
    ]


def _joined(turn: list[list[Composed]], at: int, own: int, name: int, shift: float) -> None:
    """Let a track go on under the name that it had before frame `at` of a turn."""
    count = len(turn)
    order = [(at + t) % count for t in range(count)]
    lives = [any(s.track == own for s in turn[t]) for t in order]
    if own != name:
        if not any({own, name} <= {s.track for s in some} for some in turn):
            for t in range(count):
                turn[t] = [_moved(s, -shift, own, name) for s in turn[t]]
    elif all(lives):
        for i, t in enumerate(order):
            turn[t] = [_moved(s, shift * i / count, own, own) for s in turn[t]]
            # at the first frame nothing, at the end all: shift is what the turn lost
    else:
        for t in order[: lives.index(False)]:
            turn[t] = [_moved(s, -shift, own, own) for s in turn[t]]


def _moved(stroke: Composed, shift: float, track: int, name: int) -> Composed:
    """Move the places of a stroke, and name it anew, if it is of a track."""
    if stroke.track != track:
        return stroke
    return replace(stroke, track=name, place=stroke.place + shift)


def _alike(here: list[Composed], again: list[Composed]) -> Iterator[tuple[int, int, int]]:
    """List the strokes of one frame, i and j, that cover one another, and how many points do."""
    if not here or not again:
        return
    of = np.repeat(np.arange(len(again)), [len(stroke.xy) for stroke in again])
    tree = cKDTree(np.concatenate([stroke.xy for stroke in again]))
    for i, stroke in enumerate(here):
        away, row = tree.query(stroke.xy, distance_upper_bound=SAME)
        near = of[row[away < np.inf]]
        for j, count in enumerate(np.bincount(near, minlength=len(again)).tolist()):
            if count > LEAST * min(len(stroke.xy), len(again[j].xy)):
                yield i, j, count


def _matched(
    here: list[Composed], again: list[Composed]
) -> Iterator[tuple[Composed, Composed, float]]:
    """Pair strokes of one frame, each once; with each, px by which the second's places are above.

    The pairs are of those that most of the shorter one's points are common to.
    """
    done: tuple[set[int], set[int]] = set(), set()
    for i, j, count in sorted(_alike(here, again), key=lambda pair: -pair[2]):
        one, two = here[i], again[j]
        if i in done[0] or j in done[1] or count <= MOST * min(len(one.xy), len(two.xy)):
            continue
        done[0].add(i)
        done[1].add(j)
        away, row = cKDTree(one.xy).query(two.xy, distance_upper_bound=SAME)
        near = away < np.inf
        if near.any():
            yield one, two, float(np.mean(two.place[near] - one.place[row[near]]))
