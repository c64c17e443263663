"""Routes of a pen: against every route there is, and as they must be for any lines."""

from itertools import pairwise, permutations, product

import numpy as np
import pytest

from strokestyle.geometry.travel import BETWEEN, short_route


def route(lines, closed=None, group=None):
    """The route of polylines, and the lines as it draws them."""
    xy, offsets = np.concatenate(lines), np.cumsum([0] + [len(line) for line in lines])
    closed = np.zeros(len(lines), bool) if closed is None else np.asarray(closed)
    group = np.zeros(len(lines), int) if group is None else np.asarray(group)
    found = short_route(xy, offsets, closed, group)
    drawn, ends = found.drawn(xy, offsets)
    return found, np.split(drawn, ends[1:-1])


def travel(lines, groups):
    """How far the pen travels, as it counts."""
    return sum(
        (1.0 if p == q else BETWEEN) * np.linalg.norm(b[0] - a[-1])
        for (a, p), (b, q) in pairwise(zip(lines, groups, strict=True))
    )


def test_short_routes_are_the_shortest_or_nearly():
    over = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        lines, group = list(rng.random((5, 2, 2))), np.sort(rng.integers(0, 2, 5))
        found, drawn = route(lines, group=group)
        best = min(
            travel([lines[i][:: 1 - 2 * t] for i, t in zip(order, turned, strict=True)], group)
            for order in permutations(range(5))
            if (np.diff(group[list(order)]) >= 0).all()
            for turned in product((0, 1), repeat=5)
        )
        over.append(travel(drawn, group[found.order]) / best)
    assert min(over) >= 1 - 1e-9 and np.median(over) < 1 + 1e-9 and np.mean(over) < 1.03


def test_a_row_of_lines_is_drawn_from_side_to_side():
    n = 400  # hatching, as a field is ploughed; the lines come in an order of chance
    order = np.random.default_rng(0).permutation(n)
    lines = [np.array([[0.0, k], [50.0, k]]) for k in order]
    found, drawn = route(lines)
    assert travel(drawn, [0] * n) == pytest.approx(n - 1)
    assert np.array_equal(np.abs(np.diff(order[found.order])), np.ones(n - 1))
    assert np.array_equal(drawn[0][0], [0, 0])  # the end that is nearer the origin
    again, _ = route(lines)
    assert all(np.array_equal(a, b) for a, b in zip(found, again, strict=True))


def test_every_line_is_drawn_once_and_groups_stay_in_their_order():
    rng = np.random.default_rng(3)
    middle = rng.random((300, 1, 2)) * 500
    lines = list(middle + rng.normal(0, 9, (300, 4, 2)))
    closed, group = rng.random(300) < 0.3, rng.integers(-2, 3, 300) * 7
    for i in np.flatnonzero(closed):
        lines[i][-1] = lines[i][0]
    found, drawn = route(lines, closed, group)
    assert sorted(found.order) == list(range(300)) and (np.diff(group[found.order]) >= 0).all()
    assert not found.start[~closed].any() and found.start[closed].any()
    for i, line in zip(found.order, drawn, strict=True):
        if closed[i]:
            assert np.array_equal(line[0], line[-1]) and len(line) == 4
            line, was = line[:-1], lines[i][:-1]
            first = int(found.start[i])
            assert np.array_equal(line, np.roll(was, -first, axis=0))
        else:
            assert np.array_equal(line, lines[i][:: -1 if found.turned[i] else 1])
    nearest = []  # the next line is the nearest one left, as vpype has it
    for k in np.unique(group):
        left = [lines[i] for i in np.flatnonzero(group == k)]
        way = [left.pop(0)]
        while left:
            ends = np.array([[line[0], line[-1]] for line in left]) - way[-1][-1]
            i, end = np.unravel_index(np.linalg.norm(ends, axis=2).argmin(), (len(left), 2))
            way.append(left.pop(i)[:: 1 - 2 * int(end)])
        nearest += way
    groups = np.sort(group)
    assert travel(drawn, groups) < 0.85 * travel(nearest, groups)


def test_a_closed_line_begins_where_it_is_passed():
    turn = np.linspace(0, 2 * np.pi, 33)
    ring = 10 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ring[-1] = ring[0]
    left, right = np.array([[-99.0, 0], [-12, 0]]), np.array([[0, 12.0], [0, 99]])
    _, drawn = route([left, ring, right], [False, True, False])
    there = [travel(drawn, [0] * 3), *sorted(map(len, drawn))]
    best = min(np.linalg.norm(p - left[1]) + np.linalg.norm(p - right[0]) for p in ring)
    assert there == [pytest.approx(best), 2, 2, 33]


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_lines_that_are_one_point(count):
    offsets = 2 * np.arange(count + 1)
    for closed in (False, True):
        found = short_route(
            np.ones((2 * count, 2)), offsets, np.full(count, closed), np.arange(count) % 3
        )
        assert sorted(found.order) == list(range(count)) and not found.start.any()
        assert len(found.drawn(np.ones((2 * count, 2)), offsets)[0]) == 2 * count
