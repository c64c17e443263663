"""Points near each other: as comparing all finds them; groups as a search of the graph does."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from strokestyle.geometry import near
from strokestyle.geometry.near import count_near, linked_groups, near_pairs, nearest_points

rng = np.random.default_rng(7)
GRID = np.stack(np.meshgrid(np.arange(9.0), np.arange(7.0)), axis=-1).reshape(-1, 2)
PLACES = {
    "scattered": rng.uniform(-40, 60, (300, 2)),
    "a walk": np.cumsum(rng.normal(0, 0.7, (400, 2)), axis=0),
    "a lattice": GRID,  # distances of exactly the reach
    "all at one place": np.full((20, 2), 3.5),
    "a line": np.stack([np.linspace(0, 1e6, 50), np.zeros(50)], axis=1),
    "one far away": np.r_[rng.uniform(0, 9, (40, 2)), [[1e15, -1e15]]],
    "one": np.array([[2.0, 3.0]]),
}


@pytest.mark.parametrize("many, few", [(near.MANY, near.FEW), (-1, near.FEW), (near.MANY, 0)])
@pytest.mark.parametrize("reach", [0.0, 1.0, 2.0**0.5, 11.0])
@pytest.mark.parametrize("name", PLACES)
def test_what_is_near_is_what_comparing_all_finds(name, reach, many, few, monkeypatch):
    monkeypatch.setattr(near, "MANY", many)
    monkeypatch.setattr(near, "FEW", few)
    points = PLACES[name]
    queries = np.r_[points[::3], points[:5] + 0.4, rng.uniform(-90, 90, (30, 2))]
    apart = np.square(points[:, None] - points).sum(axis=-1)
    wanted = np.argwhere(np.triu(apart <= reach * reach, 1))
    np.testing.assert_array_equal(near_pairs(points, reach), wanted)
    apart = np.square(queries[:, None] - points).sum(axis=-1)
    within = apart <= reach * reach
    np.testing.assert_array_equal(count_near(points, queries, reach), within.sum(axis=1))
    for most in (1, 4, 1000):
        query, point = nearest_points(points, queries, reach, most)
        found = apart[query, point]
        nearest = np.sort(apart, axis=1)[:, :most]
        assert found == pytest.approx(nearest[nearest < reach * reach])
        assert len(np.unique(query * len(points) + point)) == len(query)


def test_of_points_as_near_the_first_is_nearest():
    assert nearest_points(GRID, np.array([[0.5, 0.5], [99, 0]]), 2.0)[1].tolist() == [0]


def test_nothing_is_near_nothing():
    none = np.zeros((0, 2))
    for points, queries in ((none, GRID), (GRID, none), (none, none)):
        assert [len(x) for x in nearest_points(points, queries, 1.0)] == [0, 0]
        assert count_near(points, queries, 1.0).tolist() == [0] * len(queries)
    assert near_pairs(none, 1.0).shape == (0, 2)


STAR = np.stack([np.full(20, 20), np.arange(20)])  # roots that only the last thing joins
ZIGZAG = np.stack([np.r_[0:9, 1:10], np.r_[19:10:-1, 19:10:-1]])
GRAPHS = {
    "sparse": (rng.integers(0, 200, (2, 90)), 200),
    "dense": (rng.integers(0, 200, (2, 900)), 200),
    "a path, strewn": (rng.permutation(500)[np.stack([np.arange(499), np.arange(1, 500)])], 500),
    "a star": (STAR, 21),
    "a zigzag": (ZIGZAG, 20),
    "to itself": (np.array([[3, 3], [3, 1]]), 5),
    "no links": (np.zeros((2, 0), np.int64), 4),
    "nothing": (np.zeros((2, 0), np.int64), 0),
}


@pytest.mark.parametrize("name", GRAPHS)
def test_groups_are_those_of_a_search(name):
    links, count = GRAPHS[name]
    found = linked_groups(links, count)
    if not count:
        assert not len(found)
        return
    graph = coo_matrix((np.ones(links.shape[1]), links), shape=(count, count))
    np.testing.assert_array_equal(found, connected_components(graph, directed=False)[1])
