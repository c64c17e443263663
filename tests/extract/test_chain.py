"""Junctions of many lines: who goes on to whom."""

import tracemalloc

import numpy as np
import pytest

from strokestyle.extract import chain


def star(count, seed=0):
    """Segments from one node, in random directions: names of their ends, and the ends."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    node = np.stack([np.zeros(count, int), 1 + np.arange(count)], axis=1)
    flip = rng.random(count) < 0.5
    points = np.stack([np.zeros((count, 3)), direction], axis=1)
    points[flip], node[flip] = points[flip, ::-1], node[flip, ::-1]
    return node.ravel(), points, direction


def greedy(direction):
    """The plain way: of all pairs the straightest, until the straightest is a corner."""
    cosine = direction @ direction.T
    np.fill_diagonal(cosine, 1.0)
    pairs = set()
    while cosine.min() <= chain.CORNER_COSINE:
        i, j = np.unravel_index(cosine.argmin(), cosine.shape)
        pairs.add((min(i, j), max(i, j)))
        cosine[[i, j]] = cosine[:, [i, j]] = 1.0
    return pairs


def joined(mate):
    a = np.flatnonzero(mate >= 0)
    assert np.array_equal(mate[mate[a]], a)
    return {(min(i, j) // 2, max(i, j) // 2) for i, j in zip(a, mate[a], strict=True)}


@pytest.mark.parametrize("count", [3, 4, 5, 9, 16])
@pytest.mark.parametrize("few", [2, chain.FEW])
def test_the_straightest_pairs_go_on_at_a_junction(monkeypatch, count, few):
    for seed in range(10):
        node, points, direction = star(count, seed)
        monkeypatch.setattr(chain, "FEW", few)
        pairs = joined(chain._join_ends(node, points))
        if few == chain.FEW or count <= few:
            assert pairs == greedy(direction)
        left = np.setdiff1d(np.arange(count), [i for pair in pairs for i in pair])
        rest = direction[left] @ direction[left].T
        assert (rest > chain.CORNER_COSINE).all()  # none is left that goes on


def test_a_junction_of_many_lines_takes_no_square_of_memory():
    node, points, _ = star(3000)
    points = np.concatenate([points, -points])
    node = np.where(np.r_[node, node] == 0, 0, np.arange(2 * len(node)) + 1)
    tracemalloc.start()
    mate = chain._join_ends(node, points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40e6
    assert joined(mate) == {(i, i + 3000) for i in range(3000)}  # each with its opposite
