"""Normals on boundaries: what they are fitted to, and how much is looked at."""

import numpy as np
import pytest

from strokestyle.mesh import normals
from strokestyle.mesh.triangles import Edges


def _fan(count, closed):
    """A disc cut as a fan, or a rosette of triangles that share but its middle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 2 * count, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), 0.1 * np.cos(3.0 * angle)], axis=1)
    first = np.arange(1, 2 * count + 1, 1 if closed else 2)
    after = first % (2 * count) + 1
    faces = np.stack([np.zeros_like(first), first, after], axis=1)
    return np.concatenate([np.zeros((1, 3)), rim]), faces


@pytest.mark.parametrize("closed", [True, False])
def test_a_fan_is_looked_at_once(closed):
    def pairs(count):
        _, faces = _fan(count, closed)
        edges = Edges.of(faces, 2 * count + 1)
        rim = np.unique(edges.ends[edges.uses == 1])
        found = normals._two_rings(faces, rim, 2 * count + 1)
        return sum(len(face) for _, _, face in found)

    assert pairs(20_000) <= 10.1 * pairs(2_000)
    assert pairs(20_000) <= 10 * 40_000


def test_two_rings_are_those_of_a_search(monkeypatch):
    k = 9
    x, y = np.meshgrid(np.arange(k), np.arange(k), indexing="ij")
    corner = (x * k + y)[:-1, :-1].ravel()
    one = np.stack([corner, corner + k, corner + k + 1], axis=1)
    two = np.stack([corner, corner + k + 1, corner + 1], axis=1)
    faces = np.concatenate([one, two])
    monkeypatch.setattr(normals, "RING_PAIRS", 40)  # in many goes
    chosen = np.array([0, 3, 8, 40, 80])
    found = {
        (int(some[i]), int(face))
        for some, row, rings in normals._two_rings(faces, chosen, k * k)
        for i, face in zip(row, rings, strict=True)
    }
    expected = set()
    for vertex in chosen:
        near = np.unique(faces[(faces == vertex).any(axis=1)])
        expected |= {
            (int(vertex), int(f)) for f in np.flatnonzero(np.isin(faces, near).any(axis=1))
        }
    assert found == expected


def test_normals_are_the_same_in_many_goes(monkeypatch):
    points, faces = _fan(20, True)
    edges, averaged = Edges.of(faces, len(points)), normals.vertex_normals(points, faces)
    whole = normals._extrapolate_boundary_normals(points, faces, averaged, edges.rim)
    monkeypatch.setattr(normals, "RING_PAIRS", 7)
    parts = normals._extrapolate_boundary_normals(points, faces, averaged, edges.rim)
    assert not np.allclose(whole, averaged)
    np.testing.assert_allclose(parts, whole, atol=1e-12)
