"""What rays hit and what is seen: closed forms, an exact slow road, and shapes that are nothing
much."""

from types import SimpleNamespace

import numpy as np
import pytest

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import feature_curves
from strokestyle.extract.rays import LIFT, NEAR, Bvh
from strokestyle.geometry.curves import owner
from strokestyle.mesh.surface import make_surface


def grid(rows, columns, wrap_rows=True):
    """Triangles of a rows x columns grid whose columns, and perhaps rows, wrap round."""
    i, j = np.meshgrid(
        np.arange(rows if wrap_rows else rows - 1), np.arange(columns), indexing="ij"
    )
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
    return np.concatenate(
        [np.stack([a, c, b], 2).reshape(-1, 3), np.stack([b, c, d], 2).reshape(-1, 3)]
    )


def sphere(rows=40, columns=80, radius=lambda direction: 0.5):
    polar = np.pi * (np.arange(rows) + 0.5) / rows
    around = 2 * np.pi * np.arange(columns) / columns
    d = np.stack([np.outer(np.sin(polar), np.sin(around)),
                  np.outer(np.cos(polar), np.ones(columns)),
                  np.outer(np.sin(polar), np.cos(around))], axis=2).reshape(-1, 3)  # fmt: skip
    d = np.concatenate([d, [[0, 1, 0], [0, -1, 0]]])
    k, n = np.arange(columns), len(d)
    top = np.stack([k, np.roll(k, -1), np.full(columns, n - 2)], 1)
    bottom = np.stack([np.roll(k, -1), k, np.full(columns, n - 1)], 1) + [
        [n - 2 - columns, n - 2 - columns, 0]
    ]
    faces = np.concatenate([grid(rows, columns, wrap_rows=False), top, bottom])
    return make_surface(d * np.broadcast_to(radius(d), len(d))[:, None], faces)


def torus(rows=120, columns=60, thick=0.16):
    a, b = np.meshgrid(
        2 * np.pi * np.arange(rows) / rows, 2 * np.pi * np.arange(columns) / columns, indexing="ij"
    )
    ring = 0.5 - thick + thick * np.cos(b)
    return make_surface(
        np.stack([ring * np.cos(a), thick * np.sin(b), ring * np.sin(a)], 2).reshape(-1, 3),
        grid(rows, columns),
    )


CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
     [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def middles(surface, camera, kinds):
    """Middles of all segments of the lines of a surface: position, face, length, kind."""
    lines = feature_curves(surface, camera, LineOptions(kinds=kinds))
    points, which = lines.points(surface), owner(lines.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    length = np.linalg.norm(points[first + 1] - points[first], axis=1)
    return (
        0.5 * (points[first] + points[first + 1]),
        lines.face[first],
        length,
        lines.kind[which[first]],
    )


def shares(seen, truth, length):
    """Recall and false share of the seen length."""
    return (length * (seen & truth)).sum() / (length * truth).sum(), (
        length * (seen & ~truth)
    ).sum() / length.sum()


def width(surface):
    """Mean edge of each face, at most three times the mean height of the faces at a corner."""
    corner = surface.vertices[surface.faces]
    side = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    height, at = area / side.max(axis=1), [[] for _ in surface.vertices]
    for face, high in zip(surface.faces, height, strict=True):
        for vertex in face:
            at[vertex].append(high)
    around = [max(np.mean(at[vertex]) for vertex in face) for face in surface.faces]
    return np.minimum(side.mean(axis=1), 3 * np.array(around))


def brute_force(surface, eye, position, face):
    """`Bvh.seen` for smooth lines in double precision: all triangles against all rays."""
    corner = surface.vertices[surface.faces]
    edges = width(surface)
    normal = surface.normals[surface.faces[face]].sum(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    target = position + LIFT * edges[face, None] * normal
    a, e1, e2 = corner[:, 0], corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    q = np.cross(eye - a, e1)
    seen = np.ones(len(target), bool)
    for i, end in enumerate(target):
        ray = end - eye
        h = np.cross(ray, e2)
        with np.errstate(divide="ignore", invalid="ignore"):
            f = 1.0 / np.einsum("ij,ij->i", e1, h)
            u, v, t = (
                f * np.einsum("ij,ij->i", eye - a, h),
                f * (q @ ray),
                f * np.einsum("ij,ij->i", e2, q),
            )
        hit = np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1 - 1e-9))
        own = np.isin(surface.faces[hit], surface.faces[face[i]]).any(axis=1)
        gap = (1 - t[hit]) * np.linalg.norm(ray)
        seen[i] = (own & (gap < NEAR * edges[face[i]])).all()
    return seen


# --------------------------------------------------------------------------------------------- hits


def test_hits_on_a_sphere():
    surface = sphere(100, 200)
    rng = np.random.default_rng(0)
    eye = np.array([1.0, 0.7, 2.0])
    direction = -eye + 0.6 * rng.normal(size=(2000, 3))
    hits = Bvh(surface).first_hit(eye, direction)
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    b = unit @ eye
    inside = b * b - eye @ eye + 0.25
    expected = np.where(inside > 0, -b - np.sqrt(np.maximum(inside, 0)), np.inf)
    clear = np.abs(inside) > 0.01  # away from the rim, where a mesh differs from a sphere
    assert np.array_equal((hits.face >= 0)[clear], (inside > 0)[clear])
    both = clear & (inside > 0)
    assert np.abs(hits.distance[both] - expected[both]).max() < 0.002
    assert np.isinf(hits.distance[hits.face < 0]).all() and not hits.bary[hits.face < 0].any()
    # the place in the face is where the ray ends
    place = np.einsum("ni,nik->nk", hits.bary, surface.vertices[surface.faces[hits.face]])
    assert np.abs(place - (eye + hits.distance[:, None] * unit))[both].max() < 2e-6


def test_units_and_places_do_not_matter():
    surface = sphere()
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(500, 3)) - [0, 0, 3]
    reference = Bvh(surface).first_hit([0, 0, 2.0], direction)
    for scale, shift in ((1e-5, 0.0), (1e5, 0.0), (1.0, 1e4), (300.0, -1e6)):
        moved = SimpleNamespace(
            vertices=surface.vertices * scale + shift, faces=surface.faces, normals=surface.normals
        )
        hits = Bvh(moved).first_hit(np.array([0, 0, 2.0]) * scale + shift, direction)
        assert (hits.face == reference.face).mean() > 0.99
        same = (hits.face == reference.face) & (hits.face >= 0)
        assert np.allclose(hits.distance[same] / scale, reference.distance[same], rtol=1e-4)


# --------------------------------------------------------------------------------------------- seen


def test_the_front_of_a_sphere_is_seen():
    surface = sphere()
    camera = fit_camera(surface.vertices)
    face = np.arange(len(surface.faces))
    place = surface.vertices[surface.faces].mean(axis=1)
    to_eye = camera.eye - place
    facing = np.einsum("ij,ij->i", surface.face_normals, to_eye) / np.linalg.norm(to_eye, axis=1)
    for sharp in (False, True):
        seen = Bvh(surface).seen(camera.eye, face, place, np.full(len(face), sharp))
        assert seen[facing > 0.01].all() and not seen[facing < -0.3].any()


def test_contours_of_a_torus_against_the_torus_itself():
    """Recall >= .998, false <= .003 of the length, where the torus's formula says what is
    hidden."""
    surface = torus()
    scene = Bvh(surface)
    t = np.linspace(0, 1, 4000)[:, None]
    results = []
    for view in ("three-quarter", "20,40", "0,25"):
        camera = fit_camera(surface.vertices, view)
        position, face, length, _ = middles(surface, camera, ("contour",))
        seen = scene.seen(camera.eye, face, position, np.zeros(len(face), bool))
        truth = np.ones(len(face), bool)
        for i, end in enumerate(position):
            ray = camera.eye + t * (end - camera.eye)
            outside = np.hypot(np.hypot(ray[:, 0], ray[:, 2]) - 0.34, ray[:, 1]) - 0.16
            truth[i] = outside.min() > -0.0015  # the mesh's contour lies this near to the torus
        assert 0.05 < (length * ~truth).sum() / length.sum() < 0.9 or view == "20,40"
        results.append((seen, truth, length))
    seen, truth, length = (np.concatenate(part) for part in zip(*results, strict=True))
    recall, false = shares(seen, truth, length)
    assert recall >= 0.998 and false <= 0.003


def bumpy(d):
    return 0.4 + 0.1 * np.sin(7 * d[:, 0]) * np.sin(6 * d[:, 1]) * np.sin(5 * d[:, 2] + 1)


@pytest.mark.parametrize("kind", ["contour", "suggestive", "ridge", "valley", "apparent"])
def test_embree_agrees_with_brute_force(kind):
    surface = sphere(36, 72, bumpy)
    camera = fit_camera(surface.vertices, "three-quarter")
    options = LineOptions(
        kinds=(kind,), suggestive=0.001, ridge=0.02, valley=0.02, apparent=0.02, hysteresis=0.0
    )
    lines = feature_curves(surface, camera, options)
    points, which = lines.points(surface), owner(lines.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])[::2]
    position, face = 0.5 * (points[first] + points[first + 1]), lines.face[first]
    length = np.linalg.norm(points[first + 1] - points[first], axis=1)
    assert len(first) > 50
    truth = brute_force(surface, camera.eye, position, face)
    seen = Bvh(surface).seen(camera.eye, face, position, np.zeros(len(face), bool))
    recall, false = shares(seen, truth, length)
    assert recall >= 0.998 and false <= 0.003
    assert kind != "contour" or 0.02 < 1 - truth.mean() < 0.9


def test_naive_rays_would_fail():
    """The rules earn their keep: without them about half of a visible contour is lost."""
    surface = sphere(60, 120, bumpy)  # so fine that no face is a facet
    camera = fit_camera(surface.vertices, "three-quarter")
    position, face, length, _ = middles(surface, camera, ("contour",))
    scene = Bvh(surface)
    ruled = scene.seen(camera.eye, face, position, np.zeros(len(face), bool))
    naive = scene.seen(camera.eye, face, position, np.ones(len(face), bool))
    assert shares(naive, ruled, length)[0] < 0.8


@pytest.mark.parametrize(
    "view, expected", [("three-quarter", 9), ("40,20", 9), ("10,-30", 7), ("front", 4)]
)
def test_edges_of_a_cube(view, expected):
    surface = make_surface(CUBE, CUBE_FACES)
    camera = fit_camera(surface.vertices, view)
    lines = feature_curves(surface, camera, LineOptions(kinds=("crease",)))
    ends, which = lines.points(surface), owner(lines.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    for t in (0.02, 0.3, 0.98):
        place = ends[first] + t * (ends[first + 1] - ends[first])
        seen = Bvh(surface).seen(camera.eye, lines.face[first], place, np.ones(len(first), bool))
        # the cube is convex: an edge is seen where one of its two sides, x = 0.5 say, has the eye
        # before it
        facing = ((np.abs(place) > 0.4999) & (camera.eye * np.sign(place) > 0.5)).any(axis=1)
        assert np.array_equal(seen, facing) and seen.sum() == expected


def test_open_surfaces_are_seen_from_both_sides():
    i, j = np.meshgrid(np.arange(9), np.arange(9), indexing="ij")
    plane = np.stack([i.ravel() / 8 - 0.5, j.ravel() / 8 - 0.5, np.zeros(81)], axis=1)
    a = (i[:-1, :-1] * 9 + j[:-1, :-1]).ravel()
    surface = make_surface(
        plane, np.concatenate([np.stack([a, a + 9, a + 1], 1), np.stack([a + 1, a + 9, a + 10], 1)])
    )
    place, face = surface.vertices[surface.faces].mean(axis=1), np.arange(len(surface.faces))
    for z in (2.0, -2.0):
        for sharp in (False, True):
            assert (
                Bvh(surface)
                .seen(np.array([0.3, 0.2, z]), face, place, np.full(len(face), sharp))
                .all()
            )


def test_what_stands_before_hides():
    ball = sphere(20, 40)
    vertices = np.concatenate([ball.vertices, ball.vertices * 0.2 + [0, 0, -2.0]])
    both = make_surface(vertices, np.concatenate([ball.faces, ball.faces + len(ball.vertices)]))
    small = np.arange(len(ball.faces), 2 * len(ball.faces))
    place = both.vertices[both.faces[small]].mean(axis=1)
    scene = Bvh(both)
    for sharp in (False, True):
        flags = np.full(len(small), sharp)
        front = np.array([0, 0, 5.0])
        assert not scene.seen(front, small, place, flags).any()
        assert 0.3 < scene.seen(-front, small, place, flags).mean() < 0.7


def test_the_lift_does_not_show_one_body_through_another():
    ball = sphere(12, 24)
    both = make_surface(
        np.concatenate([ball.vertices, 0.985 * ball.vertices]),
        np.concatenate([ball.faces, ball.faces + len(ball.vertices)]),
        smooth=0.0,
    )
    camera = fit_camera(both.vertices, "20,30")
    lines = feature_curves(both, camera, LineOptions(kinds=("contour",)))
    points = np.einsum("ni,nij->nj", lines.bary, both.vertices[both.faces[lines.face]])
    body = both.component[lines.face]
    assert (
        set(body.tolist()) == {0, 1} and 0.015 * 0.5 < LIFT * np.pi / 24
    )  # the inner one is within the lift
    seen = Bvh(both).seen(camera.eye, lines.face, points, np.zeros(len(points), bool))
    assert seen[body == body[np.linalg.norm(points, axis=1).argmax()]].mean() > 0.95
    assert not seen[body == body[np.linalg.norm(points, axis=1).argmin()]].any()


@pytest.mark.parametrize("turn", [0.0, 0.05])
def test_two_bodies_of_one_shape_do_not_hide_each_others_rims(turn):
    ball = sphere(24, 48)
    cos, sin = np.cos(turn), np.sin(turn)
    shell = 1.0001 * ball.vertices @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    both = make_surface(
        np.concatenate([ball.vertices, shell]),
        np.concatenate([ball.faces, ball.faces + len(ball.vertices)]),
        smooth=0.0,
    )
    camera = fit_camera(both.vertices, "20,30")
    lines = feature_curves(both, camera, LineOptions(kinds=("contour",)))
    points = np.einsum("ni,nij->nj", lines.bary, both.vertices[both.faces[lines.face]])
    seen = Bvh(both).seen(camera.eye, lines.face, points, np.zeros(len(points), bool))
    assert (
        seen[np.linalg.norm(points, axis=1) > np.linalg.norm(points, axis=1).mean()].mean() > 0.97
    )


def test_nothing_much_is_no_trouble():
    single = make_surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    scene = Bvh(single)
    none = scene.seen(np.array([0, 0, 2.0]), np.zeros(0, int), np.zeros((0, 3)), np.zeros(0, bool))
    assert none.shape == (0,)
    hits = scene.first_hit(np.zeros(3), np.zeros((0, 3)))
    assert hits.face.shape == (0,) and hits.bary.shape == (0, 3)
    middle = single.vertices.mean(axis=0)[None]
    assert scene.seen(np.array([0, 0, 2.0]), [0], middle, [False]).all()
    # an eye on the very point, and in the very plane
    for eye in (middle[0], np.array([3.0, 0, 0]) + middle[0]):
        assert scene.seen(eye, [0], middle, [True]).shape == (1,)
    empty = Bvh(
        SimpleNamespace(vertices=np.zeros((0, 3)), faces=np.zeros((0, 3)), normals=np.zeros((0, 3)))
    )
    assert (empty.first_hit(np.zeros(3), np.eye(3)).face == -1).all()
