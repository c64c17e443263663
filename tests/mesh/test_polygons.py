"""Polygons cut into triangles: their area kept, every triangle turned as its polygon."""

import warnings

import numpy as np
import pytest

from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.polygons import cut_polygons
from strokestyle.mesh.triangles import Edges

U = [(2, 3), (2, 1), (1, 1), (1, 3), (0, 3), (0, 0), (3, 0), (3, 3)]
ARROW = [(1, 0.3), (2, 0), (1, 2), (0, 0)]
# a square with a square hole, and a seam that is passed twice
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
TWO_HOLES = [
    (0, 0), (7, 0), (7, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 2), (4, 2), (4, 3), (6, 3),
    (6, 1), (4, 1), (4, 2), (3, 2), (3, 1), (1, 1),
]  # fmt: skip
FLAT_CORNERS = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 3), (2, 1), (1.5, 1), (1, 1), (0, 3)]
FLAT_SQUARE = [(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2), (0, 1)]
TEE = [(0, 0), (1, 0), (2, 0), (1, 2)]  # a triangle with a corner of its neighbour
REPEATED = [(0, 0), (4, 0), (4, 0), (4, 4), (2, 1), (2, 1), (0, 4)]
NEARLY = [(0, 0), (4, 0), (4, 1e-9), (4, 4), (2, 1), (2 - 1e-8, 1), (0, 4)]
TOUCHES_ITS_SIDE = [(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)]
PINCHED = [(0, 0), (2, 1), (4, 0), (4, 2), (2, 1), (0, 2)]
SPIKE = [(0, 0), (4, 0), (4, 2), (6, 2), (4, 2), (4, 4), (0, 4)]  # there and back


def gear(corners):
    t = np.arange(corners) * (2 * np.pi / corners)
    radius = np.where(np.arange(corners) // 2 % 2, 1.0, 0.7)
    return np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1)


def spiral(corners):
    t = np.linspace(0, 6 * np.pi, corners)
    way = np.stack([np.cos(t), np.sin(t)], axis=1)
    return np.concatenate([(t + 1)[:, None] * way, ((t + 2.5)[:, None] * way)[::-1]])[::-1]


ZOO = {
    "U": U,
    "arrow": ARROW,
    "keyhole": KEYHOLE,
    "two holes": TWO_HOLES,
    "flat corners": FLAT_CORNERS,
    "flat square": FLAT_SQUARE,
    "tee": TEE,
    "repeated": REPEATED,
    "nearly": NEARLY,
    "touches its side": TOUCHES_ITS_SIDE,
    "pinched": PINCHED,
    "spike": SPIKE,
    "gear": gear(24),
    "large gear": gear(4000),
    "spiral": spiral(40),
    "circle": np.stack([np.cos(np.arange(64) / 32 * np.pi), np.sin(np.arange(64) / 32 * np.pi)], 1),
}


def cut(*polygons):
    """Polygons (n, 3), each with vertices of its own: faces as points (F, 3, 3), their polygons."""
    points = np.concatenate(polygons)
    count = np.array([len(polygon) for polygon in polygons])
    faces, polygon = cut_polygons(points, np.arange(len(points)), count)
    return points[faces], polygon


def plane_area(polygon):
    x, y = np.asarray(polygon, float).T
    return 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()


def turned(rng):
    """A random rotation (3, 3)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def vector_areas(faces):
    a, b, c = np.moveaxis(faces, 1, 0)
    return 0.5 * np.cross(b - a, c - a)


@pytest.mark.parametrize("name", ZOO)
@pytest.mark.parametrize("scale, offset", [(1, 0), (1e-6, 0), (1e5, 0), (1, 1e4)])
def test_area_and_winding_are_kept(name, scale, offset):
    rng = np.random.default_rng(0)
    flat = np.asarray(ZOO[name], float)
    for start in rng.permutation(len(flat))[:6]:
        for way in (1, -1):
            rotation = turned(rng)
            points = np.pad(np.roll(flat, start, axis=0)[::way], ((0, 0), (0, 1)))
            faces, _ = cut(scale * points @ rotation.T + offset)
            areas = vector_areas(faces) @ (rotation[:, 2] * way * np.sign(plane_area(flat)))
            whole = scale**2 * abs(plane_area(flat))
            assert len(faces) == len(flat) - 2
            assert areas.sum() == pytest.approx(whole, rel=1e-6)
            assert areas.min() > -1e-7 * whole


@pytest.mark.parametrize("name", ZOO)
def test_every_side_has_one_triangle_and_every_diagonal_two(name):
    """No corner is left out, however flat: else a neighbour's edge would end at nothing."""
    n = len(ZOO[name])
    faces, _ = cut_polygons(np.pad(ZOO[name], ((0, 0), (0, 1))), np.arange(n), np.array([n]))
    edges = Edges.of(faces, n)
    ends = {tuple(end) for end in edges.ends[edges.uses == 1].tolist()}
    assert ends == {(i, i + 1) for i in range(n - 1)} | {(0, n - 1)}
    assert (edges.uses <= 2).all()


def test_flat_corners_make_no_triangles_without_area():
    for polygon in (FLAT_CORNERS, FLAT_SQUARE, TEE, np.roll(TEE, 1, axis=0)):
        faces, _ = cut(np.pad(polygon, ((0, 0), (0, 1))))
        assert vector_areas(faces)[:, 2].min() > 0.1


def test_convex_polygons_are_fans_and_need_no_ears(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "manifold3d", None)
    t = np.arange(7) / 7 * 2 * np.pi
    ring = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    rng = np.random.default_rng(1)
    polygons = [ring[:n] @ turned(rng).T for n in (3, 5, 7, 4, 6)]
    faces, polygon = cut(*polygons)
    fans = [p[[0, k, k + 1]] for p in polygons for k in range(1, len(p) - 1)]
    quad = slice(9, 11)
    assert np.delete(faces, quad, 0).tolist() == np.delete(fans, quad, 0).tolist()
    assert polygon.tolist() == [0] + [1] * 3 + [2] * 5 + [3] * 2 + [4] * 4
    with pytest.raises(ImportError):
        cut(np.pad(U, ((0, 0), (0, 1))))


@pytest.mark.parametrize(
    "quad, diagonal",
    [
        ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], 0),  # as the first corner has it, at a tie
        ([(0, 0, 0), (2, 0, 0), (3, 1, 0), (1, 1, 0)], 1),  # sheared: the shorter one
        ([(0, 0, 0), (2, 0, 0), (1, 1, 0), (-1, 1, 0)], 0),
        ([(0, 0, 1), (1, 0, 0), (1, 1, 1), (0, 1, 0)], 0),  # a saddle: at a tie
        ([(0, 0, 1), (1, 0, 0), (1, 1, 0), (0, 1, 0)], 1),  # warped: the shorter one
        ([(1, 0.3, 0), (2, 0, 0), (1, 2, 0), (0, 0, 0)], 0),  # concave at the first corner
        ([(0, 0, 0), (1, 0.3, 0), (2, 0, 0), (1, 2, 0)], 1),  # at the second
        ([(0, 0, 0), (0, 0, 0), (1, 0, 0), (0, 1, 0)], 0),  # either way one has no area
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 2, 0)], 1),  # flat at the second
        ([(1, 2, 0), (0, 0, 0), (1, 0, 0), (2, 0, 0)], 0),  # at the third
    ],
)
def test_diagonals_of_quads(quad, diagonal):
    for move in (np.eye(3), turned(np.random.default_rng(2))):
        points = np.array(quad, float) @ move.T
        faces, _ = cut_polygons(points, np.arange(4), np.array([4]))
        shared = set(faces[0]) & set(faces[1])
        assert shared == ({1, 3} if diagonal else {0, 2})


def test_the_shorter_diagonal_of_a_warped_quad_folds_less():
    rng = np.random.default_rng(3)
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    less = 0
    for _ in range(200):
        quad = square + 0.2 * rng.normal(size=(4, 3))
        fold = []
        for corners in ([(0, 1, 2), (0, 2, 3)], [(0, 1, 3), (1, 2, 3)]):
            one, two = vector_areas(quad[np.array(corners)])
            fold.append(one @ two / np.linalg.norm(one) / np.linalg.norm(two))
        chosen = cut_polygons(quad, np.arange(4), np.array([4]))[0]
        less += fold[1 in set(chosen[0]) & set(chosen[1])] >= max(fold)
    assert less > 150


def test_polygons_that_do_not_lie_in_a_plane():
    rng = np.random.default_rng(4)
    for polygon in (U, KEYHOLE, FLAT_CORNERS, gear(40)):
        points = np.pad(np.asarray(polygon, float), ((0, 0), (0, 1)))
        points[:, 2] = 0.2 * rng.normal(size=len(points))
        faces, _ = cut(points)
        areas = vector_areas(faces)
        whole = areas.sum(axis=0)
        around = 0.5 * np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
        assert np.allclose(whole, around)  # any cut has the polygon's vector area
        assert (areas @ whole > -1e-9).all()


def test_many_at_once_are_as_each_alone():
    rng = np.random.default_rng(5)
    polygons = [np.pad(np.asarray(p, float), ((0, 0), (0, 1))) for p in ZOO.values()]
    polygons = [polygons[i] @ turned(rng).T for i in rng.permutation(np.arange(len(ZOO)).repeat(3))]
    faces, polygon = cut(*polygons)
    alone = np.concatenate([cut(p)[0] for p in polygons])
    assert np.array_equal(faces, alone)
    assert np.array_equal(np.bincount(polygon), [len(p) - 2 for p in polygons])


@pytest.mark.parametrize("n", [3, 4, 5, 9])
@pytest.mark.parametrize("what", ["point", "line", "nan", "inf", "huge", "eight", "small"])
def test_polygons_without_a_plane_are_fans_or_better(n, what):
    points = np.random.default_rng(6).normal(size=(n, 3))
    if what == "point":
        points[:] = 3.0
    elif what == "line":
        points = np.arange(n)[:, None] * np.array([1.0, 2.0, -1.0])
    elif what in ("nan", "inf"):
        points[n // 2, 1] = float(what)
    elif what == "huge":
        points *= 1e300
    elif what == "small":
        points *= 1e-300
    else:
        points[:, 2] = 0
        points = np.concatenate([points, points[::-1]])
    faces, polygon = cut_polygons(points, np.arange(len(points)), np.array([len(points)]))
    assert faces.shape == (len(points) - 2, 3) and not polygon.any()
    assert set(faces.ravel()) <= set(range(len(points)))


@pytest.mark.parametrize("corners, times", [(5, 2), (7, 3), (16, 2)])
def test_polygons_that_cross_themselves_are_warned_of(corners, times):
    t = np.arange(corners) * times * (2 * np.pi / corners)
    star = (np.stack([np.cos(t), np.sin(t), 0 * t]) * (1 + 0.01 * np.arange(corners))).T
    eight = np.array([(0, 0, 0), (4, 3, 0), (4, 1, 0), (0, 3, 0), (0, 1, 0)])
    with pytest.warns(MeshWarning, match="2 of its faces cross themselves"):
        cut(np.pad(U, ((0, 0), (0, 1))), star, eight)


BOWS = [
    [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)],  # the vector area is 0
    [(0, 0, 0), (3, 0, 0), (0.2, 1, 0), (1, 1, 0)],
]
NO_BOWS = [
    np.pad(ARROW, ((0, 0), (0, 1))),
    np.pad(TEE, ((0, 0), (0, 1))),
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 0, 0)],  # there and back
    [(0, 0, 0), (1, 0, 0.4), (0, 1, 0), (1, 1, -0.4)],  # in no plane
    [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)],
    [(0, 0, 0), (0, 0, 0), (1, 0, 0), (0, 1, 0)],
    [(0, 0, 0), (4, 0, 0), (2, 1e-9, 0), (2, 4, 0)],
    [(0, 0, 0), (1, 0, 0), (1, 1, np.nan), (0, 1, 0)],
]


def test_quads_that_cross_themselves_are_warned_of():
    rng = np.random.default_rng(5)
    bows = [
        scale * np.roll(bow, first, axis=0)[::way] @ turned(rng).T + rng.normal(size=3)
        for bow in BOWS
        for scale, first, way in [(1, 0, 1), (1e-3, 1, -1), (1e3, 2, 1), (1, 3, -1)]
    ]
    with pytest.warns(MeshWarning, match="^8 of its faces cross themselves"):
        cut(*bows, *(np.array(quad, float) for quad in NO_BOWS))
    star = 1.0 * np.array([(0, 0, 0), (4, 3, 0), (4, 1, 0), (0, 3, 0), (0, 1, 0)])
    with pytest.warns(MeshWarning, match="^9 of its faces cross themselves"):
        cut(*bows, star)


def test_quads_that_do_not_cross_themselves_are_not():
    rng = np.random.default_rng(6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for quad in NO_BOWS:
            for first in range(4):
                cut(np.roll(np.array(quad, float), first, axis=0) @ turned(rng).T)


def test_polygons_that_touch_themselves_are_not():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cut(*(np.pad(polygon, ((0, 0), (0, 1))) for polygon in ZOO.values()))


@pytest.mark.parametrize("scale", [1e-200, 1e-12, 1e12, 1e200])
def test_diagonals_of_quads_of_any_size(scale):
    for first in range(4):
        quad = scale * np.pad(np.roll(ARROW, first, axis=0), ((0, 0), (0, 1)))
        faces, _ = cut_polygons(quad, np.arange(4), np.array([4]))
        assert {first, (first + 2) % 4} == set(faces[0]) & set(faces[1])


def test_next_to_nothing():
    for count in ([], [0], [1, 2], [2, 0, 1]):
        faces, polygon = cut_polygons(np.eye(3), np.arange(sum(count)) % 3, np.array(count, int))
        assert faces.shape == (0, 3) and polygon.shape == (0,)
    faces, polygon = cut_polygons(np.eye(3), np.array([0, 1, 0, 1, 2, 2]), np.array([2, 3, 1]))
    assert faces.tolist() == [[0, 1, 2]] and polygon.tolist() == [1]
    assert faces.dtype == polygon.dtype == np.int64


@pytest.mark.parametrize("name", ["keyhole", "two holes", "pinched", "spike"])
def test_a_seam_between_shared_vertices_is_an_edge_of_two_faces(name):
    points, corner = np.unique(np.array(ZOO[name], float), axis=0, return_inverse=True)
    corner, n = corner.ravel(), len(ZOO[name])
    faces, _ = cut_polygons(np.pad(points, ((0, 0), (0, 1))), corner, np.array([n]))
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    edges = Edges.of(faces, len(points))
    sides = np.sort(np.stack([corner, np.roll(corner, -1)], axis=1), axis=1)
    once, times = np.unique(sides, axis=0, return_counts=True)
    rim = {tuple(side) for side in once[times == 1].tolist()}
    assert {tuple(end) for end in edges.ends[edges.uses == 1].tolist()} == rim
    assert (edges.uses <= 2).all()
