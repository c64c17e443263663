"""Marching squares: areas and turning in closed form, grids that wrap, saddles."""

import numpy as np
import pytest

from strokestyle.geometry.polygons import cycles, isolines


def area(points):
    x, y = points.T
    return 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()


def rings(field, level=0.0, wraps=False):
    points, offsets, grid = isolines(
        np.asarray(field, float), np.array([0, len(field)]), np.array([wraps]), np.array([level])
    )
    assert (grid == 0).all()
    return [points[a:b] for a, b in zip(offsets[:-1], offsets[1:], strict=True)]


def test_a_ring_has_two_polygons_that_turn_opposite_ways():
    y, x = np.mgrid[0:60, 0:70]
    r = np.hypot(x - 33.3, y - 30.1)
    found = sorted(rings(5.0 - np.abs(r - 18.0)), key=lambda ring: abs(area(ring)))
    assert len(found) == 2
    assert abs(area(found[0])) == pytest.approx(np.pi * 13**2, rel=0.01)
    assert abs(area(found[1])) == pytest.approx(np.pi * 23**2, rel=0.01)
    assert area(found[0]) * area(found[1]) < 0
    for ring, radius in zip(found, (13, 23), strict=True):
        assert np.hypot(ring[:, 0] - 30.1, ring[:, 1] - 33.3) == pytest.approx(
            np.full(len(ring), radius), abs=0.05
        )
        assert (
            np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).max() < 1.5
        )  # neighbours are neighbours


def test_noise_is_enclosed_exactly():
    rng = np.random.default_rng(0)
    field = np.pad(rng.normal(size=(40, 30)), 1, constant_values=-1.0)
    found = rings(field)
    # every grid point is inside as often as the field says: count rings by a ray along its row
    for r in range(1, 41):
        for c in range(1, 31, 3):
            turns = 0
            for ring in found:
                a, b = ring, np.roll(ring, -1, axis=0)
                up = (a[:, 0] <= r) != (b[:, 0] <= r)
                at = a[:, 1] + (r - a[:, 0]) / np.where(up, b[:, 0] - a[:, 0], 1) * (
                    b[:, 1] - a[:, 1]
                )
                turns += (up & (at > c)).sum()
            assert turns % 2 == (field[r, c] > 0)


def test_opposite_corners_are_joined_where_the_middle_is_inside():
    field = np.full((4, 4), -1.0)
    field[1, 1] = field[2, 2] = 0.5
    assert len(rings(field)) == 2
    field[1, 1] = field[2, 2] = 1.5
    assert len(rings(field)) == 1


def test_a_grid_that_wraps_has_its_polygon_across_the_seam():
    field = np.full((20, 9), -1.0)
    field[[0, 1, 18], 3:6] = 1.0
    field[19] = field[0]
    (ring,) = rings(field, wraps=True)
    assert ring[:, 0].min() == 0.0 and ring[:, 0].max() < 19
    (low, high) = (ring[ring[:, 0] < 10], ring[ring[:, 0] > 10])
    assert len(low) and len(high) and low[:, 0].max() == 1.5 and high[:, 0].min() == 17.5
    band = np.full((20, 9), -1.0)
    band[:, 3:6] = 1.0
    assert sorted(len(ring) for ring in rings(band, wraps=True)) == [19, 19]  # two lines all round


def test_grids_have_their_own_levels_and_do_not_touch():
    field = np.zeros((12, 5))
    field[[1, 4, 7, 10], 2] = 1.0
    offsets, level = np.array([0, 3, 6, 12]), np.array([0.5, 2.0, 0.25])
    points, rings, grid = isolines(field, offsets, np.zeros(3, bool), level)
    assert grid.tolist() == [0, 2, 2] and len(points) == 12 and rings.tolist() == [0, 4, 8, 12]
    assert (
        np.ptp(points[:4], axis=0) == pytest.approx([1.0, 1.0])
        and np.ptp(points[4:8], axis=0).max() == 1.5
    )
    nothing = isolines(field, offsets, np.zeros(3, bool), np.full(3, 9.0))
    assert len(nothing[0]) == 0 and nothing[1].tolist() == [0] and len(nothing[2]) == 0


def test_cycles_of_a_permutation():
    after = np.array([3, 1, 0, 2, 5, 4])
    walked, offsets = cycles(after)
    assert walked.tolist() == [0, 3, 2, 1, 4, 5] and offsets.tolist() == [0, 3, 4, 6]
    after = np.random.default_rng(1).permutation(1000)
    walked, offsets = cycles(after)
    ends = np.roll(walked, -1)
    ends[offsets[1:] - 1] = walked[offsets[:-1]]
    assert np.array_equal(after[walked], ends) and sorted(walked) == list(range(1000))
