"""Curvature against closed forms and rtsc; reading and cleaning against everything that users'
files are."""

import json
import os
import struct
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapes
import solids
import trimesh

from strokestyle.mesh.curvature import bounding_radius, corner_areas
from strokestyle.mesh.surface import Surface, load_surface, make_surface
from strokestyle.mesh.triangles import Edges

SHARED = os.environ.get("STROKESTYLE_SHARED")
needs_oracles = pytest.mark.skipif(
    not SHARED, reason="STROKESTYLE_SHARED is not set: no numbers of rtsc"
)
TRIANGLE = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def inside(surface, rings=2):
    """Vertices at least `rings` edges from any boundary."""
    near = np.zeros(len(surface.vertices), bool)
    near[surface.edges[surface.edge_face_count == 1]] = True
    for _ in range(rings - 1):
        near[surface.faces[near[surface.faces].any(axis=1)]] = True
    return ~near


def errors(shape, surface):
    """Errors of the larger and the smaller curvature (V,), relative to the shape's largest."""
    found = np.sort(np.stack([surface.k1, surface.k2]), axis=0) / surface.scale
    true = np.sort(np.stack([shape.k1, shape.k2]), axis=0)
    return np.abs(found - true).max(axis=0) / np.abs(true).max()


# -------------------------------------------------------------------------------------- closed form


def test_sphere_and_cylinder_are_exact():
    for shape in (shapes.sphere(3, radius=2.5), shapes.cylinder()):
        surface = make_surface(*shape)
        inner = inside(surface)
        assert errors(shape, surface)[inner].max() < 1e-12
        assert np.abs(surface.normals - shape.normals)[inner].max() < 1e-12
        assert np.abs(surface.dcurv[inside(surface, 3)]).max() < 1e-9
    assert np.abs(np.einsum("ij,ij->i", surface.pdir1, shape.pdir1))[inner].min() > 1 - 1e-12


def test_an_irregular_sphere_is_exact_too():
    rng = np.random.default_rng(0)
    shape = shapes.sphere(3)
    points = shape.vertices + 0.03 * rng.normal(size=shape.vertices.shape)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    surface = make_surface(points, shape.faces)
    assert np.abs(surface.k1 / surface.scale - 1).max() < 1e-9
    assert np.abs(surface.k2 / surface.scale - 1).max() < 1e-9


@pytest.mark.parametrize(
    "make", [lambda n: shapes.torus(1, 0.4, 2 * n, n), lambda n: shapes.saddle(n + 1)]
)
def test_error_falls_with_the_square_of_the_edge(make):
    mean = []
    for n in (20, 40, 80):
        shape = make(n)
        surface = make_surface(*shape)
        inner = np.abs(surface.vertices).max(axis=1) < (
            0.35 if not surface.closed_faces.all() else 1
        )
        mean.append(errors(shape, surface)[inner].mean())
    assert mean[-1] < 2e-3
    assert mean[0] / mean[2] > 10  # two halvings


def test_derivatives_on_a_torus():
    """Along the tube, k2 = cos t / (R + r cos t) changes: uvv = dk2/ds, and the other three are
    0."""
    big, small = 1.0, 0.4
    shape = shapes.torus(big, small, 192, 96)
    surface = make_surface(*shape)
    t = np.arctan2(shape.vertices[:, 1], np.hypot(*shape.vertices[:, [0, 2]].T) - big)
    slope = -big * np.sin(t) / (big + small * np.cos(t)) ** 2 / small
    forward = np.einsum("ij,ij->i", surface.pdir1, shape.pdir1)
    found = surface.dcurv * np.sign(forward)[:, None] / surface.scale**2
    expected = np.stack([0 * t, 0 * t, slope, 0 * t], axis=1)
    assert np.abs(found - expected).max() < 0.02 * np.abs(slope).max()


def test_derivatives_of_a_cubic():
    """z = -(2 x^2 + y^2) / 2 - (a x^3 + 3 b x^2 y + 3 c x y^2 + d y^3) / 6: at 0 the tensor is a,
    b, c, d."""
    tensor = np.array([1.0, -2.0, 3.0, 1.5])
    a, b, c, d = tensor
    shape = shapes.height_field(
        lambda x, y: (
            -x * x - y * y / 2
            - (a * x**3 + 3 * b * x * x * y + 3 * c * x * y * y + d * y**3) / 6
        ),
        lambda x, y: (-2 * x - (a * x * x + 2 * b * x * y + c * y * y) / 2,
                      -y - (b * x * x + 2 * c * x * y + d * y * y) / 2),
        lambda x, y: (-2 - a * x - b * y, -b * x - c * y, -1 - c * x - d * y),
        size=0.2, n=41,
    )  # fmt: skip
    surface = make_surface(*shape)
    middle = np.argmin(np.abs(shape.vertices[:, :2]).sum(axis=1))
    found = surface.dcurv[middle] / surface.scale**2 * np.sign(surface.pdir1[middle, 0])
    assert surface.k1[middle] / surface.scale == pytest.approx(2, rel=1e-2)
    assert np.allclose(found, tensor, atol=0.05)


def test_frames_are_orthonormal_and_right_handed():
    surface = make_surface(*shapes.torus())
    frame = np.stack([surface.pdir1, surface.pdir2, surface.normals], axis=1)
    assert np.abs(frame @ frame.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    assert np.linalg.det(frame).min() > 0
    assert (np.abs(surface.k1) >= np.abs(surface.k2)).all()


def test_curvature_holds_up_to_the_border():
    shape = shapes.height_field(
        lambda x, y: 0.5 * np.cos(x) * np.cos(y),
        lambda x, y: (-0.5 * np.sin(x) * np.cos(y), -0.5 * np.cos(x) * np.sin(y)),
        lambda x, y: (
            -0.5 * np.cos(x) * np.cos(y), 0.5 * np.sin(x) * np.sin(y), -0.5 * np.cos(x) * np.cos(y)
        ),
        n=61,
    )  # fmt: skip
    surface = make_surface(*shape)
    assert errors(shape, surface).max() < 0.12
    assert np.degrees(np.arccos(np.einsum("ij,ij->i", surface.normals, shape.normals).min())) < 0.3


def test_a_hollow_is_negative():
    shape = shapes.height_field(
        lambda x, y: x * x + 0.5 * y * y,
        lambda x, y: (2 * x, y),
        lambda x, y: (0 * x + 2, 0 * x, 0 * x + 1),
    )
    surface = make_surface(*shape)
    middle = np.argmin(np.abs(shape.vertices[:, :2]).sum(axis=1))
    assert surface.k1[middle] / surface.scale == pytest.approx(-2, rel=0.02)
    assert surface.k2[middle] / surface.scale == pytest.approx(-1, rel=0.02)


def test_corner_areas_share_each_face():
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(600, 3))
    faces = np.arange(600).reshape(-1, 3)
    areas = corner_areas(vertices, faces)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    assert np.allclose(areas.sum(axis=1), 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
    assert areas.min() > 0
    # points strewn over each face belong to the nearest corner, in acute faces
    side = np.stack([((b - c) ** 2).sum(1), ((c - a) ** 2).sum(1), ((a - b) ** 2).sum(1)], 1)
    acute = 2 * side.max(axis=1) < side.sum(axis=1)
    w = rng.dirichlet([1, 1, 1], size=20000)
    for f in np.flatnonzero(acute)[:3]:
        p = w @ vertices[faces[f]]
        nearest = np.linalg.norm(p[:, None] - vertices[faces[f]], axis=2).argmin(axis=1)
        assert np.allclose(
            np.bincount(nearest, minlength=3) / len(p), areas[f] / areas[f].sum(), atol=0.02
        )


def test_bounding_radius():
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(500, 3))
    on_sphere = 3 * directions / np.linalg.norm(directions, axis=1, keepdims=True) + [1, 2, 3]
    assert bounding_radius(on_sphere) == pytest.approx(3, rel=1e-2)
    assert bounding_radius(
        np.array([[-2.0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 0.5]])
    ) == pytest.approx(2)
    assert bounding_radius(shapes.cube(3).vertices) == pytest.approx(np.sqrt(3) / 2)


# ---------------------------------------------------------------------------------------- two roads


def test_place_size_turn_and_corner_order_do_not_matter():
    shape = shapes.torus(1, 0.4, 30, 20)
    rng = np.random.default_rng(3)
    plain = make_surface(*shape)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    rolled = np.stack([np.roll(face, rng.integers(3)) for face in shape.faces])
    moved = make_surface(1e3 * shape.vertices @ turn.T + [5e3, 0, 1e4], rolled)
    unit = moved.scale / plain.scale / 1e3  # the turned box has another longest side
    assert np.allclose(moved.k1 / unit, plain.k1, atol=1e-6)
    assert np.allclose(moved.k2 / unit, plain.k2, atol=1e-6)
    assert np.allclose(moved.normals, plain.normals @ turn.T, atol=1e-9)
    assert np.allclose(
        np.linalg.norm(moved.dcurv, axis=1) / unit**2,
        np.linalg.norm(plain.dcurv, axis=1),
        atol=1e-4,
    )
    assert np.allclose(
        moved.original(moved.vertices), 1e3 * shape.vertices @ turn.T + [5e3, 0, 1e4], atol=1e-6
    )


def test_smoothing_takes_noise_away():
    shape = shapes.sphere(4)
    rng = np.random.default_rng(4)
    noisy = shape.vertices * (1 + 0.002 * rng.normal(size=(len(shape.vertices), 1)))
    spread = [np.std(make_surface(noisy, shape.faces, smooth=s).k1) for s in (0, 1, 2)]
    assert spread[1] < 0.5 * spread[0] and spread[2] < 0.15 * spread[0]
    smooth = make_surface(*shape, smooth=2.0)
    assert np.abs(smooth.k1 / smooth.scale - 1).max() < 0.1


@needs_oracles
@pytest.mark.parametrize("name", ["spot", "woman", "fandisk"])
def test_rtsc(name):
    """Its numbers to the last digit, with its solver's slip; and without it, no farther from them
    than the slip."""
    theirs = np.load(Path(SHARED) / "oracles" / "rtsc" / f"{name}.npz")
    ours = make_surface(theirs["vertices"], theirs["faces"], crease=180, rtsc=True)
    unit = np.median(np.abs(theirs["curv1"]))
    cosine = np.einsum("ij,ij->i", ours.pdir1, theirs["pdir1"])
    same_frame = np.abs(cosine) > 0.999  # where k1 = +-k2 directions mean nothing
    assert same_frame.mean() > 0.78
    for found, true, where in (
        (ours.k1, theirs["curv1"], slice(None)),
        (ours.k2, theirs["curv2"], slice(None)),
        ((ours.dcurv * np.sign(cosine)[:, None]), theirs["dcurv"], same_frame),
    ):
        error = (np.abs(found - true) / np.maximum(np.abs(true), unit))[where]
        assert np.median(error) < 1e-4
        assert np.percentile(error, 99) < 1e-2
    assert ours.feature_size == pytest.approx(float(theirs["feature_size"]), rel=1e-4)
    paper = make_surface(theirs["vertices"], theirs["faces"], crease=180)
    assert (
        np.median(np.abs(paper.k1 - theirs["curv1"]) / np.maximum(np.abs(theirs["curv1"]), unit))
        < 0.02
    )
    assert paper.feature_size == pytest.approx(float(theirs["feature_size"]), rel=0.1)


def test_rtscs_slip_depends_on_corner_order():
    """Why it is not the default."""
    rng = np.random.default_rng(5)
    shape = shapes.saddle(21)
    rolled = np.roll(shape.faces, 1, axis=1)
    points = shape.vertices + 0.01 * rng.normal(size=shape.vertices.shape)
    slip = [
        make_surface(points, faces, crease=180, rtsc=True).k1 for faces in (shape.faces, rolled)
    ]
    ours = [make_surface(points, faces).k1 for faces in (shape.faces, rolled)]
    assert np.allclose(*ours, atol=1e-6)
    assert not np.allclose(*slip, rtol=0.05)


# ----------------------------------------------------------------------------------------- cleaning


def test_seams_are_welded():
    shape = shapes.torus(1, 0.4, 24, 16)
    soup = shape.vertices[shape.faces].reshape(-1, 3)
    rng = np.random.default_rng(6)
    for points in (soup, soup.astype(np.float32), soup + 2e-7 * rng.uniform(-1, 1, soup.shape)):
        surface = make_surface(points, np.arange(len(soup)).reshape(-1, 3))
        assert len(surface.vertices) == len(shape.vertices)
        assert surface.closed_faces.all()


def test_what_is_no_surface_goes():
    shape = shapes.sphere(2)
    count = len(shape.vertices)
    vertices = np.vstack([shape.vertices, [[9, 9, 9]], [[np.nan] * 3]])  # used by no face
    extra = [[0, 0, 1], [1, 1, 1], shape.faces[0], shape.faces[1][::-1], shape.faces[2][[1, 2, 0]]]
    surface = make_surface(vertices, np.vstack([shape.faces, extra]))
    assert len(surface.faces) == len(shape.faces) and len(surface.vertices) == count
    assert np.array_equal(surface.faces, shape.faces)  # nothing else is touched
    middle = 0.5 * (shape.vertices[shape.faces[0, 0]] + shape.vertices[shape.faces[0, 1]])
    needle = make_surface(
        np.vstack([shape.vertices, middle]), np.vstack([shape.faces, [*shape.faces[0, :2], count]])
    )
    assert len(needle.faces) == len(shape.faces)


def test_thin_faces_make_no_creases():
    """A flat strip meets two halves in a T-junction closed by a face of three points in a row,
    rounded or exact."""
    for bump in (0.0, 1e-6, -1e-6):
        points = np.array(
            [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 0, bump], [0, -1, 0], [2, -1, 0]],
            float,
        )
        faces = [[0, 1, 2], [0, 2, 3], [0, 4, 1], [0, 5, 4], [4, 5, 6], [4, 6, 1]]
        surface = make_surface(points, faces)
        assert len(surface.faces) == 6 and (surface.edge_face_count == 1).sum() == 6
        assert np.allclose(np.abs(surface.face_normals[:, 2]), 1, atol=1e-5)
        assert len(surface.vertices) == 7 and np.allclose(
            surface.normals[:, 2], surface.normals[0, 2], atol=1e-5
        )


def test_winding_is_unified_and_outward():
    shape = shapes.torus(1, 0.4, 24, 16)
    rng = np.random.default_rng(7)
    for turned in (np.ones(len(shape.faces), bool), rng.random(len(shape.faces)) < 0.5):
        surface = make_surface(
            shape.vertices, np.where(turned[:, None], shape.faces[:, ::-1], shape.faces)
        )
        assert np.einsum("ij,ij->i", surface.normals, shape.normals).min() > 0.9
        assert surface.k1.min() > 0


def test_each_closed_part_faces_outward():
    """Also the small one within: each by its own volume, wherever it lies."""
    shape = shapes.sphere(2)
    vertices = np.concatenate([shape.vertices, 0.3 * shape.vertices, shape.vertices + [5, 0, 0]])
    n = len(shape.vertices)
    inward = shape.faces[:, ::-1]
    surface = make_surface(vertices, np.concatenate([shape.faces, inward + n, inward + 2 * n]))
    assert len(np.unique(surface.component)) == 3
    assert (surface.k1 > 0).all()


def test_open_surfaces_keep_the_side_of_most_faces():
    shape = shapes.cylinder()
    rng = np.random.default_rng(8)
    for share in (0.3, 0.7):
        turned = rng.random(len(shape.faces)) < share
        surface = make_surface(
            shape.vertices, np.where(turned[:, None], shape.faces[:, ::-1], shape.faces)
        )
        outward = np.sign(np.einsum("ij,ij->i", surface.normals, shape.normals))
        assert (outward == (1 if share < 0.5 else -1)).all()
        assert not surface.closed_faces.any()


@pytest.mark.parametrize("high", [0.98, 0.9])
def test_open_but_nearly_closed_bodies_face_outward(high):
    """A ball with a hole, wound inward, and two, one of them with some faces turned."""
    ball = shapes.sphere(3)
    left = ball.vertices[ball.faces].mean(axis=1)[:, 1] < high
    faces, n = ball.faces[left], len(ball.vertices)
    mixed = np.where(np.arange(len(faces))[:, None] % 3 == 0, faces, faces[:, ::-1])
    points = np.vstack([ball.vertices, ball.vertices + [3, 0, 0]])
    surface = make_surface(points, np.vstack([faces[:, ::-1], mixed + n]))
    assert not surface.closed_faces.any()
    middle = surface.original(surface.vertices[surface.faces].mean(axis=1))
    middle[surface.component == surface.component[-1]] -= [3, 0, 0]
    assert np.einsum("fi,fi->f", surface.face_normals, middle).min() > 0.9


@pytest.mark.parametrize(
    "away, leg, left, said",
    [
        (5e6, 0.1, 24, 1),
        (50.0, 0.1, 25, 1),
        (3.0, 0.1, 25, 0),
        (2e3, 1.5, 24, 1),  # .6 % of the area
        (50.0, 1.5, 25, 0),
        (2e3, 4.0, 25, 0),  # 4 %
    ],
)
def test_a_stray_face_far_off(away, leg, left, said):
    """It is left out where all else would be a dot, and warned of where that is small."""
    house, chimney = solids.box((0, 0, 0), (8, 3, 6)), solids.box((5, 2, 3), (5.7, 4, 3.7))
    stray = solids.Solid(leg * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), [(0, 1, 2)])
    all_ = solids.together(house, chimney, stray.moved((-8 * away, 0, 0)))
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        surface = make_surface(
            all_.vertices, all_.faces, part=np.arange(25), part_names=("x",) * 25
        )
    assert len(surface.faces) == left and len(found) == said
    assert np.array_equal(surface.part, np.arange(left))
    assert all("1 of its 25 faces" in str(one.message) for one in found)


def test_a_surface_that_has_no_sides():
    surface = make_surface(*shapes.moebius())
    assert len(surface.faces) == len(shapes.moebius().faces)
    assert not surface.closed_faces.any()
    # where no winding agrees the normals end, instead of cancelling
    corner = surface.normals[surface.faces]
    assert np.einsum("fci,fi->fc", corner, surface.face_normals).min() > 0.9


def test_fins_and_touching_parts():
    """Three faces at one edge, and two tetrahedra that share only an edge, or a vertex."""
    fin = make_surface(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0.1], [0, 0, 1]],
        [[0, 1, 2], [1, 0, 3], [0, 1, 4]],
    )
    assert fin.edge_face_count.max() == 2 and len(np.unique(fin.component)) == 2
    flat = fin.component == fin.component[0]  # the fin stands on the two that are nearly flat
    assert np.array_equal(np.abs(fin.face_normals[~flat]), [[0, 1, 0]]) and flat.sum() == 2
    tetra = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1.0], [-1, 0, 0]]
    )
    by_edge = make_surface(points[:6], np.vstack([tetra, np.array([0, 4, 1, 5])[tetra]]))
    by_vertex = make_surface(points, np.vstack([tetra, np.array([0, 6, 4, 5])[tetra]]))
    assert len(by_edge.faces) == len(by_vertex.faces) == 8
    assert by_vertex.closed_faces.all() and by_edge.closed_faces.all()
    assert len(np.unique(by_edge.component)) == len(np.unique(by_vertex.component)) == 2


@pytest.mark.parametrize("size", [1e-30, 1e-3, 1.0, 1e30])
def test_any_unit(size):
    shape = shapes.torus(1, 0.4, 24, 16)
    surface = make_surface(size * shape.vertices, shape.faces)
    assert np.ptp(surface.vertices, axis=0).max() == pytest.approx(1)
    assert np.allclose(surface.vertices.min(axis=0), -surface.vertices.max(axis=0))
    assert np.allclose(
        surface.original(surface.vertices), size * shape.vertices, rtol=1e-6, atol=1e-9 * size
    )


def test_a_cube_has_six_flat_sides():
    surface = make_surface(*shapes.cube(4))
    assert np.array_equal(np.sort(np.abs(surface.normals), axis=1), np.tile([0, 0, 1], (6 * 16, 1)))
    assert not surface.k1.any() and not surface.dcurv.any()
    assert len(np.unique(surface.weld)) == 56 and np.array_equal(
        surface.vertices, surface.vertices[surface.weld]
    )
    assert len(surface.cut_edges) == 12 * 3
    assert (
        surface.closed_faces.all() and (surface.edge_face_count == 2).all()
    )  # it is still one closed surface
    assert len(make_surface(*shapes.cube(4), crease=95).vertices) == 56


def test_only_what_creases_part_is_parted():
    """A cylinder with lids: its rims are cut, its side stays smooth and round; a cone's tip has a
    normal per face."""
    side = shapes.cylinder(around=32, rows=3)
    n = len(side.vertices)
    rim = np.arange(32)

    def fan(ring, tip):
        return np.stack([ring, np.roll(ring, -1), np.full(len(ring), tip)], 1)

    lids = [fan(rim, n), fan(n - 32 + rim, n + 1)]
    points = np.vstack([side.vertices, [[0, -1, 0], [0, 1, 0]]])
    surface = make_surface(points, np.vstack([side.faces, *lids]))
    assert len(surface.vertices) == n + 2 + 64 and surface.closed_faces.all()
    for normal in surface.normals:  # either along the axis or across it
        assert min(np.abs(normal[1]), np.hypot(normal[0], normal[2])) < 1e-9
    round_ = np.abs(surface.normals[:, 1]) < 0.5
    assert np.allclose(surface.k1[round_] / surface.scale, 2) and not surface.k1[~round_].any()
    cone = make_surface(points[2 * 32 :], np.vstack([fan(rim, 33), fan(rim[::-1], 32)]))
    assert (cone.weld == cone.weld[32]).sum() == 32


def test_noise_cuts_nothing():
    shape = shapes.sphere(6)
    points = shape.vertices.copy()
    points[np.arange(0, len(points), 700)] *= 1.02  # spikes of one vertex, sharp all round
    surface = make_surface(points, shape.faces)
    angle = np.einsum("ij,ij->i", *surface.face_normals[surface.edge_faces.T])
    assert angle.min() < np.cos(np.radians(40))
    assert np.array_equal(surface.weld, np.arange(len(points)))


def zoo():
    yield "one triangle", TRIANGLE
    yield "plane", shapes.plane()
    yield "cube", shapes.cube()
    yield (
        "back to back",
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-3]], [[0, 1, 2], [0, 2, 1], [0, 3, 1]]),
    )
    yield (
        "slivers",
        ([[0, 0, 0], [1, 0, 0], [0.5, 1e-8, 0], [0.5, 1, 0]], [[0, 1, 2], [0, 2, 3], [2, 1, 3]]),
    )
    spike = shapes.sphere(1).vertices.copy()
    spike[0] *= 1e4
    yield "spike", (spike, shapes.sphere(1).faces)
    rng = np.random.default_rng(9)
    yield "soup", (rng.normal(size=(90, 3)), rng.integers(0, 90, size=(300, 3)))
    yield "islands", (rng.normal(size=(300, 3)), np.arange(300).reshape(-1, 3))


@pytest.mark.parametrize(
    "name, mesh", list(zoo()), ids=lambda value: value if isinstance(value, str) else ""
)
@pytest.mark.parametrize("smooth", [0.0, 1.5])
def test_everything_is_finite(name, mesh, smooth):
    surface = make_surface(*mesh, smooth=smooth)  # Surface itself refuses what is not finite
    assert np.allclose(np.linalg.norm(surface.normals, axis=1), 1)
    assert 0 < surface.feature_size <= 0.05
    assert surface.mean_edge > 0 and surface.face_normals.shape == surface.faces.shape


def test_flat_faces_have_no_curvature():
    surface = make_surface(*shapes.plane())
    assert not surface.k1.any() and not surface.dcurv.any()


def test_edges():
    surface = make_surface(*shapes.sphere(2))
    assert len(surface.vertices) - len(surface.edges) + len(surface.faces) == 2
    start = surface.faces[:, [0, 1, 2]]
    end = surface.faces[:, [1, 2, 0]]
    assert np.array_equal(
        surface.edges[surface.face_edges], np.sort(np.stack([start, end], axis=2), axis=2)
    )
    assert (surface.edge_face_count == 2).all()
    for face in surface.edge_faces.T:
        assert (
            (surface.face_edges[face] == np.arange(len(surface.edges))[:, None]).any(axis=1).all()
        )
    lone = Edges.of(np.array([[2, 0, 1]]), 3)
    assert lone.ends.tolist() == [[0, 1], [0, 2], [1, 2]] and lone.of_side.tolist() == [[1, 0, 2]]


# ------------------------------------------------------------------------------------------ reading

QUADS = """# a box with a five-sided front, seams, and a comment in Latin-1: \xe9
mtllib none.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0.5 1.5 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0.5 1.5 1\nv 0 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl red
f 6/1 7/2 8/3 9/4 10/1
f 5 4 3 2 1
usemtl blue
f -10/4 -9/3 -4/2 -5/1
f 2/1 3/2 8/3 7/4
f 3 4 9 8\nf 4 5 10 9\nf 5 1 6 10
"""


def test_polygons_seams_materials_and_negative_indices(tmp_path):
    path = tmp_path / "house.obj"
    path.write_bytes(QUADS.encode("latin-1"))
    surface = load_surface(path)
    assert (len(np.unique(surface.weld)), len(surface.faces)) == (10, 16)
    assert surface.closed_faces.all()
    assert surface.part_names == ("red", "blue") and surface.part.sum() == 2 + 2 + 2 * 3
    assert surface.scale == 1.5 and surface.centre.tolist() == [0.5, 0.75, 0.5]


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "glb", "stl_ascii"])
def test_formats_agree(tmp_path, kind):
    shape = shapes.torus(3, 1, 16, 12)
    data = trimesh.Trimesh(*shape, process=False).export(file_type=kind)
    path = tmp_path / f"torus.{kind[:3]}"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    surface = load_surface(path)
    assert (len(surface.vertices), len(surface.faces)) == (192, 384)
    assert surface.closed_faces.all() and surface.scale == pytest.approx(8, rel=1e-6)
    assert np.median(surface.k1) == pytest.approx(8, rel=0.1)


def test_scenes_are_merged_with_transforms_and_names(tmp_path):
    scene, box = trimesh.Scene(), trimesh.Trimesh(*shapes.cube(), process=False)
    scene.add_geometry(box, node_name="body")
    scene.add_geometry(
        box, node_name="wheel", transform=trimesh.transformations.translation_matrix([4, 0, 0])
    )
    path = tmp_path / "scene.glb"
    path.write_bytes(scene.export(file_type="glb"))
    surface = load_surface(path)
    assert surface.scale == pytest.approx(5)
    names = np.array(surface.part_names)[surface.part]
    middle = surface.original(surface.vertices)[surface.faces].mean(axis=1)[:, 0]
    assert set(names) == {"body", "wheel"}
    assert np.array_equal(names == "wheel", middle > 2)


def test_objects_of_an_obj_are_parts(tmp_path):
    path = tmp_path / "two.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no left\nf 1 2 3\no right\nf 1 4 2\n")
    surface = load_surface(path)
    assert sorted(surface.part_names) == ["left", "right"] and len(surface.faces) == 2


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
BAD = [
    ("cloud.obj", OBJ, "no faces in it (3 points): a point cloud cannot be drawn; mesh it first"),
    ("words.obj", "hello\n", "no faces"),
    ("nan.obj", OBJ + "v nan 0 0\nf 1 2 4\n", "not finite"),
    ("huge.obj", OBJ + "v 1e400 0 0\nf 1 2 4\n", "not finite"),
    ("index.obj", OBJ + "f 1 2 9\n", "damaged"),
    ("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none of its 1 faces has any area"),
    ("point.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "coincide"),
    ("empty.obj", "", "empty"),
    ("picture.obj", b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "no faces"),
    ("short.stl", b"\0" * 80 + struct.pack("<I", 100) + b"\0" * 120, "damaged"),
    ("short.glb", b"glTF" + struct.pack("<II", 2, 400), "damaged"),
    ("bad.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "bad.ply"),
    ("notes.txt", "hi", "not a mesh format"),
    ("suffixless", "hi", "no suffix"),
    ("shape.blend", b"BLENDER", "File > Export > glTF 2.0"),
    ("part.step", "ISO-10303-21;", "part.step"),
]


@pytest.mark.parametrize("name, content, message", BAD, ids=[row[0] for row in BAD])
def test_bad_files_are_named(tmp_path, capfd, name, content, message):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError) as caught:
        load_surface(path)
    text = str(caught.value)
    assert text.startswith(str(path)) and message in text and "\n" not in text
    assert capfd.readouterr() == ("", "")


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(OSError, match=r"nowhere\.obj: no such file"):
        load_surface(tmp_path / "nowhere.obj")
    with pytest.raises(OSError, match="a folder"):
        load_surface(tmp_path)


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "glb"])
def test_damaged_files_raise_nothing_else(tmp_path, kind):
    data = trimesh.Trimesh(*shapes.sphere(1), process=False).export(file_type=kind)
    data = data if isinstance(data, bytes) else data.encode()
    rng = np.random.default_rng(10)
    path = tmp_path / f"x.{kind}"
    for _ in range(40):
        broken = bytearray(data[: rng.integers(1, len(data))] if rng.random() < 0.5 else data)
        for place in rng.integers(0, len(broken), rng.integers(0, 20)):
            broken[place] = rng.integers(256)
        path.write_bytes(bytes(broken))
        try:
            load_surface(path)
        except (ValueError, OSError) as error:
            assert str(error).startswith(str(path))


# --------------------------------------------------------------------------------------- validation


@pytest.mark.parametrize(
    "vertices, faces, message",
    [
        (np.zeros((3, 2)), [[0, 1, 2]], r"\(V, 3\), got \(3, 2\)"),
        (np.eye(3), [[0, 1, 2, 0]], r"\(F, 3\)"),
        (np.eye(3), np.zeros((0, 3)), "at least one face"),
        (np.eye(3), [[0, 1, 3]], "vertex 3 of 3"),
        (np.eye(3), [[0, 1, -1]], "vertex -1"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "1 of 3 vertices"),
    ],
)
def test_arrays_that_are_no_mesh(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        make_surface(vertices, faces)


@pytest.mark.parametrize("smooth", [-1.0, np.nan, 1e9])
def test_smooth_must_make_sense(smooth):
    with pytest.raises(ValueError, match="smooth must lie between"):
        make_surface(*TRIANGLE, smooth=smooth)


@pytest.mark.parametrize("crease", [0.0, -5.0, 181.0, np.nan])
def test_crease_must_be_an_angle(crease):
    with pytest.raises(ValueError, match="crease must be an angle"):
        make_surface(*TRIANGLE, crease=crease)


def test_a_surface_refuses_what_does_not_fit():
    good = make_surface(*shapes.sphere(1))
    values = {name: getattr(good, name) for name in Surface.__dataclass_fields__}
    for name, value, message in (
        ("k1", good.k1[:-1], r"Surface.k1 must have shape \(42,\), got \(41,\)"),
        ("dcurv", good.dcurv[:, :3], "Surface.dcurv"),
        ("normals", np.where(good.normals > 0.9, np.nan, good.normals), "not finite"),
        ("faces", good.faces + 1, r"0\.\.41"),
        ("feature_size", 0.0, "feature_size"),
        ("weld", np.arange(42) + 1, "Surface.weld"),
        ("part", good.faces[:, 0], "Surface.part"),
    ):
        with pytest.raises(ValueError, match=message):
            Surface(**{**values, name: value})
    with pytest.raises(ValueError):
        good.vertices[0] = 1.0  # read-only


def test_reading_says_nothing(tmp_path, capfd):
    path = tmp_path / "a.gltf"
    path.write_text(
        json.dumps({"asset": {"version": "2.0"}, "meshes": [], "buffers": [{"uri": "gone.bin"}]})
    )
    with pytest.raises((ValueError, OSError), match=r"a\.gltf"):
        load_surface(path)
    assert capfd.readouterr() == ("", "")


def test_what_follows_from_the_triangles_alone_is_shared_by_smoothed_surfaces():
    surface = make_surface(*shapes.cube())
    smooth = surface.smoothed(1.0)
    assert smooth.connectivity is surface.connectivity
    assert smooth.cut_edges is surface.cut_edges
    moved = replace(surface, vertices=surface.vertices * 0.5)
    assert moved.connectivity is not surface.connectivity
    assert moved.mean_edge == pytest.approx(0.5 * surface.mean_edge)
    assert "connectivity" not in repr(surface)
