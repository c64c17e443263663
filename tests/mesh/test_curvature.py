"""Normals on boundaries: what they are fitted to, and how much is looked at."""

import numpy as np
import pytest
import shapes

from strokestyle.mesh import curvature
from strokestyle.mesh.surface import make_surface
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
        found = curvature._two_rings(faces, rim, 2 * count + 1)
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
    monkeypatch.setattr(curvature, "RING_PAIRS", 40)  # in many goes
    chosen = np.array([0, 3, 8, 40, 80])
    found = {
        (int(some[i]), int(face))
        for some, row, rings in curvature._two_rings(faces, chosen, k * k)
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
    edges, normals = Edges.of(faces, len(points)), curvature.vertex_normals(points, faces)
    whole = curvature._extrapolate_boundary_normals(points, faces, normals, edges.rim)
    monkeypatch.setattr(curvature, "RING_PAIRS", 7)
    parts = curvature._extrapolate_boundary_normals(points, faces, normals, edges.rim)
    assert not np.allclose(whole, normals)
    np.testing.assert_allclose(parts, whole, atol=1e-12)


def test_curvature_is_worked_out_when_it_is_asked_for(monkeypatch):
    surface = make_surface(*shapes.sphere(2))
    smooth = surface.smoothed(1.0)
    assert not {"k1", "dcurv", "feature_size"} & set(vars(surface)) | set(vars(smooth)) & {"k1"}
    whole = curvature.differential_geometry(surface.vertices, surface.faces)
    for name, value in whole._asdict().items():
        assert np.array_equal(getattr(surface, name), value), name
    with pytest.raises(ValueError):
        surface.k1[0] = 0.0  # read-only
    with pytest.raises(AttributeError, match="no attribute 'k3'"):
        surface.k3  # noqa: B018
    assert np.array_equal(surface.with_faces(np.ones(len(surface.faces), bool)).k1, surface.k1)


def test_the_derivative_is_worked_out_where_it_is_asked_for(monkeypatch):
    shape = shapes.torus(1, 0.4, 40, 30)
    whole = make_surface(shape.vertices, shape.faces).smoothed(1.0).dcurv
    counted, derivatives = [], curvature._derivatives

    def count(frame, mean, deviator):
        counted.append(mean.shape[1])
        return derivatives(frame, mean, deviator)

    monkeypatch.setattr(curvature, "_derivatives", count)
    monkeypatch.setattr(curvature, "MAX_KEPT", 0)
    surface = make_surface(shape.vertices, shape.faces).smoothed(1.0)
    few, more = np.arange(30, 90), np.arange(60, 200)
    for vertex in (few, more, few):
        np.testing.assert_allclose(surface.dcurv_at(vertex), whole[vertex], atol=1e-9)
    assert sum(counted) < 0.3 * len(shape.faces)  # what is known is not asked again
    np.testing.assert_allclose(surface.dcurv, whole, atol=1e-9)
    assert np.array_equal(surface.dcurv_at(few), surface.dcurv[few])
    assert sum(counted) < 1.2 * len(shape.faces)


def test_curvature_of_many_faces_is_summed_chunk_by_chunk(monkeypatch):
    """Nor does it matter whether the frames of faces are kept."""
    shape = shapes.torus(1, 0.4, 40, 30)
    whole = curvature.differential_geometry(shape.vertices, shape.faces, 1.0)
    monkeypatch.setattr(curvature, "CHUNK", 700)
    monkeypatch.setattr(curvature, "MAX_KEPT", 0)
    parts = curvature.differential_geometry(shape.vertices, shape.faces, 1.0)
    for one, two in zip(whole, parts, strict=True):  # a direction may turn by half
        np.testing.assert_allclose(np.abs(one), np.abs(two), atol=1e-9)


def test_curvature_of_some_vertices_is_worked_out_there_alone(monkeypatch):
    shape = shapes.torus(1, 0.4, 40, 30)
    one, two = (make_surface(shape.vertices, shape.faces) for _ in range(2))
    vertex = np.array([17, 3, 400, 401, 3])
    seen = []
    forms = curvature._vertex_forms
    monkeypatch.setattr(
        curvature,
        "_vertex_forms",
        lambda mesh, rtsc: seen.append(len(mesh.faces)) or forms(mesh, rtsc),
    )
    some = one.curvature_at(vertex)
    assert seen[0] <= 6 * len(vertex) and "k1" not in vars(one)
    names = ("k1", "k2", "pdir1", "pdir2")
    for name, found in zip(names, some, strict=True):
        assert np.array_equal(found, getattr(two, name)[vertex]), name
    seen.clear()
    for name, found in zip(names, two.curvature_at(vertex), strict=True):  # all are known there
        assert np.array_equal(found, getattr(two, name)[vertex]), name
    smooth = one.smoothed(1.0)  # over what lies farther round them: of all
    assert np.array_equal(smooth.curvature_at(vertex)[0], smooth.k1[vertex])
    assert seen == [len(one.faces)]
    assert one.curvature_at(np.zeros(0, int))[2].shape == (0, 3)
