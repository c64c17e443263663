"""Edges of tones that cross themselves right behind a cusp are found, and are parted."""

from __future__ import annotations

import numpy as np
import pytest

from strokestyle.svg import crossings
from strokestyle.svg.crossings import Groups, crossing_groups, separated_groups


def polygons(*rings):
    ends = np.cumsum([0, *map(len, rings)])
    return Groups(np.concatenate(rings), ends, np.arange(len(rings)))


def crosses_soon(d, e, f, pieces=400):
    """Two pieces of a spline that meet in the middle of side e, as polylines: do they cross?"""
    t = np.linspace(0, 1, pieces)[1:, None]
    one, two = -t * e + t * t * (e - d) / 2, t * e + t * t * (f - e) / 2
    a, b, c, g = one[:-1, None], one[1:, None], two[None, :-1], two[None, 1:]

    def side(p, q, r):
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )

    hit = (side(a, b, c) * side(a, b, g) < 0) & (side(c, g, a) * side(c, g, b) < 0)
    return bool(hit.any())


def test_pieces_cross_where_polylines_do():
    rng = np.random.default_rng(4)
    hits = 0
    for _ in range(150):
        e, turn, back = rng.normal(size=2), rng.uniform(2.0, np.pi), rng.uniform(2.0, np.pi)
        d, f = (
            rng.uniform(0.3, 3.0) * np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) @ e
            for a in (turn, -back)
        )
        ring = np.cumsum([[0, 0], d, e, f], axis=0)
        got = bool(crossings._meets_next(polygons(ring))[1])  # of the side from point 1 to 2
        assert got == crosses_soon(d, e, f)
        hits += got
    assert 20 < hits < 130


PLAIN = [[200, 80], [60, 190], [-90, 120]]
CUSP = np.array([[0, 0], [-28, -53], [-29, -48], [-15, -100], *PLAIN])
LINE = np.array([[0, 0], [-28, -56], [-27, -54], [-45, -90], *PLAIN])  # out, back, and out


@pytest.mark.parametrize("ring", [CUSP, LINE, CUSP[::-1], LINE[::-1]])
def test_a_cusp_that_crosses_itself_is_parted(ring):
    given = polygons(ring)
    assert crossing_groups(given)[0].tolist() == [0]
    parted = separated_groups(given)
    assert len(parted.points) > 3 and not len(crossing_groups(parted)[0])
    assert not len(crossing_groups(polygons(np.array([[0, 0], *PLAIN])))[0])


def test_a_polyline_alone_would_not_show_it(monkeypatch):
    monkeypatch.setattr(crossings, "_meets_next", lambda given: np.zeros(len(given.points), bool))
    assert not len(crossing_groups(polygons(CUSP))[0])
    monkeypatch.setattr(crossings, "FINE", 64)
    assert crossing_groups(polygons(CUSP))[0].tolist() == [0]
