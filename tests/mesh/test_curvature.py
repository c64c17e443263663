"""Curvature: in closed form, in parts, and where it is asked for."""

import numpy as np
import pytest
import shapes

from strokestyle.mesh import curvature, triangles
from strokestyle.mesh.surface import make_surface


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

    def count(flat, frame, mean, deviator):
        counted.append(mean.shape[1])
        return derivatives(flat, frame, mean, deviator)

    monkeypatch.setattr(curvature, "_derivatives", count)
    surface = make_surface(shape.vertices, shape.faces).smoothed(1.0)
    few, more = np.arange(30, 90), np.arange(60, 200)
    for vertex in (few, more, few):
        np.testing.assert_allclose(surface.dcurv_at(vertex), whole[vertex], atol=1e-9)
    assert sum(counted) < 0.3 * len(shape.faces)  # what is known is not asked again
    np.testing.assert_allclose(surface.dcurv, whole, atol=1e-9)
    assert np.array_equal(surface.dcurv_at(few), surface.dcurv[few])
    assert sum(counted) < 1.2 * len(shape.faces)


def test_curvature_of_many_faces_is_summed_chunk_by_chunk(monkeypatch):
    shape = shapes.torus(1, 0.4, 40, 30)
    whole = curvature.differential_geometry(shape.vertices, shape.faces, 1.0)
    monkeypatch.setattr(triangles, "CHUNK", 700)
    parts = curvature.differential_geometry(shape.vertices, shape.faces, 1.0)
    for one, two in zip(whole, parts, strict=True):  # a direction may turn by half
        np.testing.assert_allclose(np.abs(one), np.abs(two), atol=1e-9)


def test_curvature_of_some_vertices_is_worked_out_there_alone(monkeypatch):
    shape = shapes.torus(1, 0.4, 40, 30)
    one, two = (make_surface(shape.vertices, shape.faces) for _ in range(2))
    vertex = np.array([17, 3, 400, 401, 3])
    seen = []
    forms = curvature._forms
    monkeypatch.setattr(
        curvature,
        "_forms",
        lambda flat, *args: seen.append(len(flat.u)) or forms(flat, *args),
    )
    some = one.curvature_at(vertex)
    assert sum(seen) <= 6 * len(vertex) and "k1" not in vars(one)
    names = ("k1", "k2", "pdir1", "pdir2")
    for name, found in zip(names, some, strict=True):
        assert np.array_equal(found, getattr(two, name)[vertex]), name
    seen.clear()
    for surface in (one, two):  # what is known is not asked again
        for name, found in zip(names, surface.curvature_at(vertex), strict=True):
            assert np.array_equal(found, getattr(two, name)[vertex]), name
    assert not seen
    smooth = one.smoothed(1.0)  # over what lies farther round them: of all
    assert np.array_equal(smooth.curvature_at(vertex)[0], smooth.k1[vertex])
    assert sum(seen) == len(one.faces)
    assert one.curvature_at(np.zeros(0, int))[2].shape == (0, 3)


@pytest.mark.parametrize("smooth", [0.0, 1.5])
@pytest.mark.parametrize("worn", [False, True])
def test_single_precision_will_do(monkeypatch, smooth, worn):
    """Also where there are a needle and a sliver, which spoil what is round them in either."""
    shape = shapes.torus(1, 0.4, 160, 120)
    points, good = shape.vertices.copy(), np.ones(len(shape.vertices), bool)
    if worn:
        a, b, _ = shape.faces[77]
        points[a] = points[b] + 1e-7 * (points[a] - points[b])
        points[shape.faces[900, 2]] = points[shape.faces[900]].mean(axis=0)
        good = np.linalg.norm(points - points[a], axis=1) > 0.4
    double = curvature.differential_geometry(points, shape.faces, smooth)
    monkeypatch.setattr(curvature, "MANY", 0)
    single = curvature.differential_geometry(points, shape.faces, smooth)
    assert not np.array_equal(single.k1, double.k1)
    for name, error in {"k1": 1e-6, "k2": 1e-6, "dcurv": 1e-4}.items():
        one, two = (np.abs(getattr(found, name)) for found in (single, double))
        assert np.isfinite(one).all()
        assert np.abs(one - two)[good].max() < error * np.abs(two[good]).max(), name


def test_directions_lie_at_half_the_angle():
    angle = np.r_[np.linspace(-np.pi, np.pi, 41)[1:], 1e-9, -1e-9, np.pi - 1e-9]
    for size in (1e-30, 1.0, 1e30):
        number = size * np.exp(1j * angle)
        np.testing.assert_allclose(curvature._half_angle(number), np.exp(0.5j * angle), atol=1e-15)
    assert curvature._half_angle(np.zeros(1, complex)) == 1.0
    assert curvature._half_angle(np.array([complex(-2.0, 0.0)])) == 1j
    assert curvature._half_angle(np.array([complex(-2.0, -0.0)])) == -1j


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_corners_of_slivers_share_their_area(precision):
    random = np.random.default_rng(0)
    corner = random.normal(size=(3, 3000, 3))
    tall = 10.0 ** random.uniform(-16.0, -2.0, (3000, 1))
    # two corners in nearly one place, or the third near to the line through them
    corner[1, ::2] = corner[0, ::2] + tall[::2] * corner[1, ::2]
    corner[2, 1::2] = 0.3 * corner[0, 1::2] + 0.7 * corner[1, 1::2] + tall[1::2] * corner[2, 1::2]
    flat = curvature._FlatFaces.of(list(np.moveaxis(corner, 2, 0)), np.dtype(precision))
    area, areas = 0.5 * flat.along * flat.v, flat.areas()
    slack = 1e-6 * area
    assert (areas >= -slack).all() and (areas <= area + slack).all()
    assert np.abs(areas.sum(axis=0) - area).max() <= 2e-6 * area.max()


def test_poles_of_many_faces_are_as_round_as_the_rest(monkeypatch):
    """Slivers between points of a pole that rounding keeps apart count for nothing there."""
    polar, azimuth = np.linspace(0.0, np.pi, 24), np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    t, a = np.meshgrid(polar, azimuth, indexing="ij")
    sphere = np.stack([np.sin(t) * np.cos(a), np.cos(t), np.sin(t) * np.sin(a)], axis=2)
    ring, step = np.divmod(np.arange(23 * 48), 48)
    one, two = 48 * ring + step, 48 * ring + (step + 1) % 48
    faces = np.concatenate(
        [np.stack([one, one + 48, two + 48], 1), np.stack([one, two + 48, two], 1)]
    )
    points, some = 0.2 * sphere.reshape(-1, 3), np.arange(8)
    points = np.concatenate(points + np.random.default_rng(0).normal(size=(len(some), 1, 3)))
    monkeypatch.setattr(curvature, "MANY", 0)
    surface = make_surface(points, np.concatenate(faces + 24 * 48 * some[:, None, None]))
    radius = np.median(surface.k1)
    assert np.abs(surface.k1 / radius - 1.0).max() < 0.1
    assert np.abs(surface.dcurv).max() < 0.5 * radius**2
