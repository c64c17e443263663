"""In which order, direction and from which point a pen draws lines, so that it travels little.

What is made short is the way of the lifted pen: the chords from where a line ends to where the next
begins. Lines come in groups (the layers of a file), one group after the other; within its group a
line is free. Between groups the pen may be changed, or the hand be called: that way counts little,
and decides where all else is equal.

A route begins with the shortest edges between lines' ends, or at a corner with the nearest line,
then that nearest to it and so on (greedy and nearest neighbour in Bentley, Fast Algorithms for
Geometric Traveling Salesman Problems, ORSA Journal on Computing 4, 1992): the second leaves far
edges to the end, and goes through hatching as one does with a plough. Each is improved by 2-opt
moves, which turn a stretch of it round, and Or-opt moves, which put up to three lines elsewhere,
both among near ends only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NEIGHBOURS = 8  # of a line's end: no move is tried that brings none of them next to it
FEW = 8  # nearest ends that are looked up at once, to find one that is left
BETWEEN = 0.05  # as what part of its length the way from group to group counts
MOVED = 3  # lines at most that an Or-opt move puts elsewhere
KICKS = 100  # how often the best route is disturbed
STRETCH = 25  # lines at most of a stretch that a kick moves
ROUNDS = 4  # at most, of ordering lines and then turning the closed ones
LEAST = 1e-9  # of the lines' extent; a move that saves less is rounding

Ends = np.ndarray | int  # as many at once as one likes


class Route(NamedTuple):
    """How to draw C lines one after the other.

    Parameters
    ----------
    order : (C,) int, lines from the first to the last
    turned : (C,) bool, whether each line is drawn from its last point to its first
    start : (C,) int, which of its points each line is drawn from: 0 of an open one
    """

    order: np.ndarray
    turned: np.ndarray
    start: np.ndarray

    def drawn(self, xy: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the lines `xy` (N, 2), `offsets` (C+1,) one after the other as they are drawn."""
        rows = []
        for i in self.order.tolist():
            row = np.arange(offsets[i], offsets[i + 1])
            if self.start[i] > 0:  # the first point is the last, too
                row = np.r_[row[self.start[i] : -1], row[: self.start[i] + 1]]
            rows.append(row[::-1] if self.turned[i] else row)
        return xy[np.concatenate([np.zeros(0, int), *rows])], np.r_[0, np.cumsum([*map(len, rows)])]


def short_route(
    xy: np.ndarray, offsets: np.ndarray, closed: np.ndarray, group: np.ndarray
) -> Route:
    """Order lines so that a lifted pen travels little; the same lines give the same route.

    Parameters
    ----------
    xy : (N, 2)
    offsets : (C+1,) int, line i is rows offsets[i]:offsets[i+1], at least two
    closed : (C,) bool; a closed line repeats its first point as its last, and may begin anywhere
    group : (C,) int; lines are drawn from the lowest group to the highest. Of one group alone, the
        direction of the whole is that which begins nearer the origin
    """
    start = np.zeros(len(offsets) - 1, np.int64)
    if len(start) < 2:
        return Route(np.arange(len(start)), start > 0, start)
    points = xy[:, 0] + 1j * xy[:, 1]
    ends = points[np.stack([offsets[:-1], offsets[1:] - 1], axis=1)].ravel()
    loops = {i: points[offsets[i] : offsets[i + 1]] for i in np.flatnonzero(closed).tolist()}
    searches = [
        _Search(ends, group, _one_after_the_other(ends, begin(ends, group)))
        for begin in (_nearest_next, _greedy)
    ]
    tour = min(searches, key=lambda search: search.settled()).found()
    for _ in range(ROUNDS):
        tour = _Search(ends, group, tour).kicked()
        if not _turn_loops(loops, start, ends, group, tour):
            break
    if group.min() == group.max() and abs(ends[tour[-1] ^ 1]) < abs(ends[tour[0]]):
        tour = tour[::-1] ^ 1
    turned = np.zeros(len(start), bool)
    turned[tour >> 1] = tour & 1
    return Route(tour >> 1, turned & ~closed, start)


# Line i has the ends 2 i and 2 i + 1, points of the complex plane; e ^ 1 is the other end of e's
# line. A tour is the ends (C,) at which the pen comes to the lines.


def _near_pairs(ends: np.ndarray, group: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Pair (M, 2) each end in `of` with the nearest of them of other lines of its group."""
    from scipy.spatial import cKDTree  # takes .25 s to import, and only plotters need routes

    points = np.stack([ends[of].real, ends[of].imag], axis=1)
    apart = 4 * np.ptp(points, axis=0).max() + 1.0  # one group lies above the other
    points = np.column_stack([points, apart * group[of >> 1]])
    few = min(NEIGHBOURS + 2, len(of))  # with itself and its line's other end
    near = of[cKDTree(points).query(points, k=np.arange(1, few + 1))[1]].ravel()
    pairs = np.stack([np.repeat(of, few), near], axis=1)
    lines = pairs >> 1
    fit = (lines[:, 0] != lines[:, 1]) & (group[lines[:, 0]] == group[lines[:, 1]])
    return pairs[fit]


def _greedy(ends: np.ndarray, group: np.ndarray) -> list[np.ndarray]:
    """Join the lines of each group by the shortest edges between their ends: a tour a group."""
    link = [-1] * len(ends)
    chain = list(range(len(group)))  # of a line, towards one that stands for all that it is with

    def leader(line: int) -> int:
        while chain[line] != line:
            chain[line] = chain[chain[line]]
            line = chain[line]
        return line

    free, joined = np.arange(len(ends)), True
    while joined:
        joined, pairs = False, _near_pairs(ends, group, free)
        length = np.abs(ends[pairs[:, 0]] - ends[pairs[:, 1]])
        for a, b in pairs[np.argsort(length, kind="stable")].tolist():
            if link[a] < 0 and link[b] < 0 and (one := leader(a >> 1)) != (other := leader(b >> 1)):
                link[a], link[b], chain[one], joined = b, a, other, True
        free = np.flatnonzero(np.array(link) < 0)
    heads = {int(group[end >> 1]): end for end in reversed(free.tolist())}
    return [_followed(link, heads[i]) for i in sorted(heads)]


def _nearest_next(ends: np.ndarray, group: np.ndarray) -> list[np.ndarray]:
    """Go from each group's corner to the nearest line that is left, and so on: a tour a group."""
    return [
        _nearest_tour(ends, np.flatnonzero(np.repeat(group == one, 2))) for one in np.unique(group)
    ]


def _nearest_tour(ends: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Visit the lines whose ends are `of`, the nearest always next."""
    from scipy.spatial import cKDTree

    points, drawn = np.stack([ends.real, ends.imag], axis=1), np.zeros(len(ends), bool)
    corner = points[of].min(axis=0)
    tour = [int(of[np.linalg.norm(points[of] - corner, axis=1).argmin()])]
    left, tree, few = of, cKDTree(points[of]), FEW
    while 2 * len(tour) < len(of):
        drawn[[tour[-1], tour[-1] ^ 1]] = True
        if few > 8 * FEW or 2 * (len(of) - 2 * len(tour)) < len(left):
            left = left[~drawn[left]]
            tree = cKDTree(points[left])
        few, free = FEW // 2, left[:0]
        while not len(free):
            few = min(2 * few, len(left))
            near = left[tree.query(points[tour[-1] ^ 1], k=np.arange(1, few + 1))[1]]
            free = near[~drawn[near]]
        tour.append(int(free[0]))
    return np.array(tour)


def _followed(link: list[int], end: int) -> np.ndarray:
    """Give the tour from an end along the links between ends."""
    tour = []
    while end >= 0:
        tour.append(end)
        end = link[end ^ 1]
    return np.array(tour)


def _one_after_the_other(ends: np.ndarray, tours: list[np.ndarray]) -> np.ndarray:
    """Join tours in their order, each in the direction that makes the ways between them short."""
    ways = [[tours[0]], [tours[0][::-1] ^ 1]]  # the best that ends with the last so and so
    lengths = [0.0, 0.0]
    for tour in tours[1:]:
        grown, found = [], []
        for way in (tour, tour[::-1] ^ 1):
            far = [
                length + abs(ends[before[-1][-1] ^ 1] - ends[way[0]])
                for length, before in zip(lengths, ways, strict=True)
            ]
            best = int(far[1] < far[0])
            grown.append([*ways[best], way])
            found.append(far[best])
        ways, lengths = grown, found
    return np.concatenate(ways[int(lengths[1] < lengths[0])])


class _Search:
    """A tour that moves make shorter, until none of those between near ends does.

    `tour` begins with one place more than the lines and ends with MOVED more, which hold an end of
    no line: what lies beyond a tour. The place of line i in it is `place[i]`.
    """

    def __init__(self, ends: np.ndarray, group: np.ndarray, tour: np.ndarray):
        self.pairs = _near_pairs(ends, group, np.arange(len(ends)))
        self.least = LEAST * np.abs(ends - ends[0]).max()
        nothing = self.beyond = len(ends)
        self.ends = np.r_[ends, 0, 0]
        self.real = np.r_[np.ones(nothing), 0.0, 0.0]
        self.group = np.r_[group, group.max() + 1]
        self.tour = np.r_[nothing, tour, [nothing] * MOVED]
        self.place = np.empty(len(group), np.int64)
        self.place[tour >> 1] = np.arange(1, len(group) + 1)

    def found(self) -> np.ndarray:
        """The tour as it is now."""
        return self.tour[1:-MOVED].copy()

    def settled(self) -> float:
        """Make moves until none saves anything; how far the pen travels then."""
        self.settle(np.ones(len(self.place), bool))
        return self.length()

    def kicked(self) -> np.ndarray:
        """Swap stretches by chance and see whether moves make more of that (Martin, Otto and
        Felten, Complex Systems 5, 1991): the best tour so found."""
        rng, length = np.random.default_rng(0), self.settled()  # no chance that a user may choose
        for _ in range(KICKS):
            tour, place = self.tour.copy(), self.place.copy()
            self.settle(self.kick(rng))
            if (now := self.length()) < length - self.least:
                length = now
            else:
                self.tour, self.place = tour, place
        return self.found()

    def length(self) -> float:
        """How far the lifted pen travels, as it counts."""
        return float(self.way(self.tour[:-1] ^ 1, self.tour[1:]).sum())

    def kick(self, rng: np.random.Generator) -> np.ndarray:
        """Swap two neighbouring stretches of one group, each turned round or not.

        Returns which lines (C,) have other neighbours now.
        """
        stirred = np.zeros(len(self.place), bool)
        first = int(rng.integers(1, len(self.place)))
        group = self.group[self.tour >> 1]
        rest = group[first : first + 2 * STRETCH] == group[first]
        count = len(rest) if rest.all() else int(rest.argmin())
        if count > 1:
            cut, last = np.sort(rng.choice(count, 2, replace=False) + 1)
            one, other = self.tour[first : first + cut], self.tour[first + cut : first + last]
            one, other = (part[::-1] ^ 1 if rng.random() < 0.5 else part for part in (one, other))
            self.put(slice(first, first + last), np.r_[other, one], stirred)
            stirred[[other[-1] >> 1, one[0] >> 1]] = True
        return stirred

    def put(self, where: slice, new: np.ndarray, stirred: np.ndarray) -> None:
        """Put ends at places of the tour, and note the lines there and next to them."""
        self.tour[where] = new
        self.place[new >> 1] = np.arange(where.start, where.stop)
        near = self.tour[where.start - 1 : where.stop + 1]
        if len(near) > 2 * MOVED + 4:  # what lies inside has its neighbours yet
            near = np.r_[near[: MOVED + 2], near[-MOVED - 2 :]]
        stirred[near[near < self.beyond] >> 1] = True

    def settle(self, stirred: np.ndarray) -> None:
        """Make moves near lines that have other neighbours now, `stirred` (C,), and go on so."""
        while stirred.any():
            moves = self.promising(self.pairs[stirred[self.pairs >> 1].any(axis=1)])
            stirred[:] = False
            for kind, u, v in moves:
                self.make(kind, u, v, stirred)

    def promising(self, pairs: np.ndarray) -> list[list[int]]:
        """Find the moves (kind, u, v) that would save something by themselves, the best first."""
        u, v = pairs.T
        saved = [self.turn(u, v)[0]] + [self.shift(u, v, more)[0] for more in range(MOVED)]
        kind, index = np.nonzero(np.array(saved) > self.least)
        best = np.argsort(-np.array(saved)[kind, index], kind="stable")
        return np.stack([kind, u[index], v[index]], axis=1)[best].tolist()

    def way(self, a: Ends, b: Ends) -> np.ndarray:
        """Measure from ends to ends, as it counts; what is no line's is nowhere far."""
        between = self.group[a >> 1] != self.group[b >> 1]
        counts = self.real[a] * self.real[b] * (1 - (1 - BETWEEN) * between)
        return np.abs(self.ends[a] - self.ends[b]) * counts

    def turn(self, u: Ends, v: Ends) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What it saves to turn round the stretch that brings u next to v, and the places of its
        first line and its last.

        Both are where the pen comes to their lines, or both where it leaves them; else 0.
        """
        p, q = self.place[u >> 1], self.place[v >> 1]
        out = self.tour[p] != u
        first, last = np.minimum(p, q) + out, np.maximum(p, q) - 1 + out
        a, b = self.tour[first - 1] ^ 1, self.tour[first]
        c, d = self.tour[last] ^ 1, self.tour[last + 1]
        saved = self.way(a, b) + self.way(c, d) - self.way(a, c) - self.way(b, d)
        return saved * (out == (self.tour[q] != v)), first, last

    def shift(
        self, u: Ends, v: Ends, more: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What it saves to put the line of u, and the `more` that its other end leads to, so that u
        is next to v; the places of the first and the last of them, and that which they go before.
        """
        p, q = self.place[u >> 1], self.place[v >> 1]
        out, beside = self.tour[p] != u, self.tour[q] != v
        first = p - more * out
        last, goal = first + more, q + beside
        far = self.tour[p + more * (1 - 2 * out)] ^ ~out
        beyond = self.tour[q - 1 + 2 * beside] ^ ~beside
        before, after = self.tour[first - 1] ^ 1, self.tour[last + 1]
        leaves = self.way(before, self.tour[first]) + self.way(self.tour[last] ^ 1, after)
        comes = self.way(u, v) + self.way(far, beyond) - self.way(v, beyond)
        group = self.group[u >> 1]
        fit = (self.group[self.tour[first] >> 1] == group) & ((goal < first) | (goal > last + 1))
        fit &= self.group[self.tour[last] >> 1] == group
        return (leaves - self.way(before, after) - comes) * fit, first, last, goal

    def make(self, kind: int, u: int, v: int, stirred: np.ndarray) -> None:
        """Make a move if it still saves anything."""
        line = self.tour
        if kind == 0:
            saved, first, last = self.turn(u, v)
            where, new = slice(first, last + 1), line[first : last + 1][::-1] ^ 1
        else:
            saved, first, last, goal = self.shift(u, v, kind - 1)
            moved = line[first : last + 1]
            if (line[self.place[u >> 1]] == u) == (line[self.place[v >> 1]] == v):
                moved = moved[::-1] ^ 1
            if goal > last:
                where, new = slice(first, goal), np.r_[line[last + 1 : goal], moved]
            else:
                where, new = slice(goal, last + 1), np.r_[moved, line[goal:first]]
        if saved > self.least:
            self.put(where, new, stirred)


def _turn_loops(
    loops: dict[int, np.ndarray],
    start: np.ndarray,
    ends: np.ndarray,
    group: np.ndarray,
    tour: np.ndarray,
) -> bool:
    """Begin closed lines where the way from the line before to the one after is shortest.

    `loops` are their points. `start` and `ends` are changed; returns whether they were.
    """
    changed, place = False, {line: p for p, line in enumerate((tour >> 1).tolist())}
    for line, points in loops.items():
        p, far = place[line], np.zeros(len(points))
        beside = [tour[p - 1] ^ 1] if p > 0 else []
        for end in [*beside, *tour[p + 1 : p + 2]]:
            counts = 1.0 if group[end >> 1] == group[line] else BETWEEN
            far += counts * np.abs(points - ends[end])
        best = int(far.argmin())
        if far[best] < far[start[line]] * (1 - LEAST):
            start[line], changed = best, True
            ends[2 * line] = ends[2 * line + 1] = points[best]
    return changed
