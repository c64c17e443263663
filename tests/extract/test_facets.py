"""Meshes of few and large triangles: drawn as the same shapes cut into many small ones."""

import numpy as np
import pytest
import shapes
from scipy.spatial import ConvexHull, cKDTree

from strokestyle.extract import segments as lines_of_kinds
from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import feature_curves, flat_folds
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.rays import Bvh
from strokestyle.extract.segments import coarse_faces
from strokestyle.extract.view_curvature import closed_from
from strokestyle.extract.visible import look_along
from strokestyle.geometry.curves import KINDS, resample
from strokestyle.mesh.surface import make_surface

HARD = LineOptions(kinds=("contour", "crease", "boundary"))
VIEWS = ("30,30", "-70,45", "200,-25")


def lathe(profile, around, turn=0.05):
    """A body of revolution about y from (radius, height) upwards; radius 0 is one vertex."""
    angle = turn + np.arange(around) * (2 * np.pi / around)
    vertices, rings = [], []
    for radius, height in profile:
        count = around if radius else 1
        rings.append(np.arange(count) + len(vertices))
        at = angle[:count]
        vertices += list(
            np.stack([radius * np.sin(at), np.full(count, height), radius * np.cos(at)], axis=1)
        )
    faces, i = [], np.arange(around)
    for low, high in zip(rings, rings[1:], strict=False):
        a, b = low[i % len(low)], low[(i + 1) % around % len(low)]
        c, d = high[i % len(high)], high[(i + 1) % around % len(high)]
        faces += [np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]
    faces = np.concatenate(faces)
    good = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return np.array(vertices), faces[good]


def box(low, high):
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[s[0], s[i], s[i + 1]] for s in sides for i in (1, 2)])
    return np.array(low) + corner * (np.array(high) - np.array(low)), faces


def joined(*bodies):
    start = np.cumsum([0, *(len(v) for v, _ in bodies)])
    return (
        np.concatenate([v for v, _ in bodies]),
        np.concatenate([f + at for (_, f), at in zip(bodies, start, strict=False)]),
    )


def moved(body, by):
    return body[0] + np.array(by, float), body[1]


def subdivided(vertices, faces, longest):
    """Cut every face flatly into four until no edge is longer than `longest` of the shape."""
    limit = longest * np.ptp(vertices, axis=0).max()
    while True:
        pairs = np.sort(
            np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1
        )
        if np.linalg.norm(np.diff(vertices[pairs], axis=1), axis=2).max() <= limit:
            return vertices, faces
        unique, middle = np.unique(pairs, axis=0, return_inverse=True)
        ab, bc, ca = len(vertices) + middle.reshape(3, -1)
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        a, b, c = faces.T
        faces = np.concatenate(
            [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )


def plate_with_pins():
    pins = [box((x, -0.4, z), (x + 0.2, 2.4, z + 0.2)) for x in (0.3, 1.3, 2.3) for z in (0.3, 0.9)]
    return joined(box((0, 0, 0), (3, 0.5, 1.4)), *pins)


def standing_cans():
    can = lathe([(0, 0), (0.2, 0), (0.2, 2.5), (0, 2.5)], 20)
    cans = [moved(can, (x, 0.3, z)) for x in (0.3, 0.9, 1.5) for z in (0.3, 0.9)]
    return joined(box((0, 0, 0), (1.8, 0.3, 1.2)), *cans)


def shelves():
    boards = [box((0.1, y, 0), (1.9, y + 0.06, 1)) for y in (0.1, 1.3, 2.6, 3.9)]
    return joined(box((0, 0, 0), (0.1, 4, 1)), box((1.9, 0, 0), (2, 4, 1)), *boards)


def rounded_box(radius=0.3, steps=3):
    """A cube of side 2, all edges and corners rounded by facets of 30 degrees."""
    t = np.linspace(0, np.pi / 2, steps + 1)
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    points = []
    for sign in signs:
        for u in t:
            for v in t:
                round_ = np.array([np.cos(u) * np.cos(v), np.sin(u), np.cos(u) * np.sin(v)])
                points.append(np.array(sign) * (1 - radius + radius * round_))
    hull = ConvexHull(np.array(points))
    return np.array(points), hull.simplices


SHAFT = [(0, 0), (0.7, 0), (0.7, 2.6), (1, 2.6), (1, 3), (0.5, 3), (0.5, 4), (0, 4)]
SOLIDS = {
    "pins": plate_with_pins,
    "cans": standing_cans,
    "shelves": shelves,
    "can of 16": lambda: lathe([(0, 0), (0.5, 0), (0.5, 1), (0, 1)], 16),
    "can of 64": lambda: lathe([(0, 0), (0.5, 0), (0.5, 1), (0, 1)], 64),
    "cone": lambda: lathe([(0, 0), (0.5, 0), (0, 1)], 16),
    "shaft": lambda: lathe(SHAFT, 20),
    "ball of 80 faces": lambda: tuple(shapes.sphere(1)),
    "rounded box": rounded_box,
}


def drawn(mesh, camera, options=HARD):
    return extract_view(make_surface(*mesh), camera, options).curves


@pytest.mark.parametrize("name", SOLIDS)
def test_a_coarse_mesh_is_drawn_as_its_subdivided_self(name):
    mesh, longest = SOLIDS[name](), 0.06 if "ball" in name else 0.1
    for view in VIEWS:
        camera = fit_camera(make_surface(*mesh).vertices, view, width=500, height=500)
        coarse, fine = drawn(mesh, camera), drawn(subdivided(*mesh, longest), camera)
        # of the shelves tidying merges lines 4 px apart farther along in one than in the other
        near = 0.015 if name == "shelves" else 0.01
        assert coarse.lengths().sum() == pytest.approx(fine.lengths().sum(), rel=near), view
        one, two = (resample(c.xy, c.offsets, 1.0)[0] for c in (coarse, fine))
        for a, b in ((one, two), (two, one)):
            assert (cKDTree(b).query(a)[0] > 2.5).mean() < 0.005, view


@pytest.mark.parametrize("around", [9, 16, 40])
def test_the_sides_of_a_can_are_straight_and_end_at_its_rims(around):
    mesh = SOLIDS["can of 16"]() if around == 16 else lathe(SHAFT[:3] + [(0, 2.6)], around)
    surface = make_surface(*mesh)
    camera = fit_camera(surface.vertices, "30,30")
    lines = feature_curves(surface, camera, LineOptions(kinds=("contour",)))
    corners = lines.bary.max(axis=1) == 1.0
    assert len(lines) == 1 and lines.closed.all() and corners.all()


def test_a_facet_is_judged_by_its_own_body():
    can = lathe([(0, 0), (0.5, 0), (0.5, 1), (0, 1)], 16)
    ball = tuple(shapes.sphere(1))
    for body in (can, ball):
        side = np.abs(make_surface(*body).face_normals[:, 1]) < 0.99
        far = (body[0] * 0.01 + 50.0, body[1])
        assert coarse_faces(make_surface(*body))[side].all()
        assert coarse_faces(make_surface(*joined(body, far)))[np.r_[side, side]].all()
    assert not coarse_faces(make_surface(*shapes.sphere(4))).any()
    assert not coarse_faces(make_surface(*shapes.torus())).any()


def test_a_contour_holds_together_where_facets_meet_smooth_faces():
    """Untrimmed contours of a closed surface are closed, whichever faces are facets."""
    ball = shapes.sphere(3)
    vertices = ball.vertices * (1.0 + 0.15 * np.sin(4 * ball.vertices[:, :1]))
    surface = make_surface(vertices, ball.faces)
    facets = coarse_faces(surface)
    assert 0.01 < facets.mean() < 0.99
    options = LineOptions(kinds=("contour",), trim=False)
    for eye in ((0.9, 0.5, 2.0), (-2.0, 1.0, 0.3)):
        camera = Camera(np.array(eye), np.zeros(3), np.array([0, 1.0, 0]), 30.0, 300, 300)
        lines = feature_curves(surface, camera, options)
        points = lines.points(surface)
        ends = np.concatenate([points[lines.offsets[:-1]], points[lines.offsets[1:] - 1]])
        open_ = ends[np.r_[~lines.closed, ~lines.closed]]
        # whatever ends meets another line's end
        apart = cKDTree(open_).query(open_, k=2)[0][:, 1] if len(open_) else np.zeros(0)
        assert len(lines) and (apart < 1e-9).all()


@pytest.mark.parametrize("longest, some", [(0.2, False), (0.1, False), (0.07, True), (0.04, False)])
def test_an_outline_is_whole_where_facets_end(longest, some, monkeypatch):
    """A ball of 80 plane faces, cut ever finer: at some size a part of the faces are facets."""
    mesh = subdivided(*shapes.sphere(1), longest)
    surface = make_surface(*mesh)
    if some:  # as near the threshold as can be
        monkeypatch.setattr(lines_of_kinds, "SAG", 1e-3)
        assert 0.1 < coarse_faces(surface).mean() < 0.9
    for view in VIEWS:
        camera = fit_camera(surface.vertices, view, width=400, height=400)
        curves = extract_view(surface, camera, HARD).curves
        corner, _ = camera.project(surface.vertices)
        around = ConvexHull(corner)
        assert len(curves) == 1
        assert curves.lengths().sum() == pytest.approx(around.area, rel=0.01)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("steps", [2, 4])
def test_an_open_surface_may_be_wound_either_way(closed, steps):
    """A ball, or one with a hole below: its outline is one circle, inward or outward."""
    ball = shapes.sphere(steps)
    keep = ball.faces if closed else ball.faces[(ball.vertices[ball.faces, 1] > -0.9).all(axis=1)]
    lengths = []
    for faces in (keep, keep[:, ::-1]):
        surface = make_surface(ball.vertices, faces)
        camera = fit_camera(surface.vertices, "20,30")
        curves = extract_view(surface, camera, LineOptions(kinds=("contour",))).curves
        assert len(curves) == 1
        lengths.append(curves.lengths().sum())
    assert lengths[0] == pytest.approx(lengths[1], rel=0.01)


def test_the_inside_of_an_open_bowl_is_no_outline():
    ball = shapes.sphere(4)
    for turned in (1, -1):
        faces = ball.faces[(ball.vertices[ball.faces, 1] < 0.3).all(axis=1)][:, ::turned]
        surface = make_surface(ball.vertices, faces)
        camera = fit_camera(surface.vertices, "0,50")
        lines = feature_curves(surface, camera, LineOptions(kinds=("contour",)))
        seen = look_along(surface, camera, lines, Bvh(surface)).fragments().curves
        xy, _ = camera.project(lines.points(surface))
        assert seen.lengths().sum() == pytest.approx(
            np.hypot(*np.diff(xy, axis=0).T).sum(), rel=0.02
        )  # the outline below the rim, all of which is seen


def room(thick):
    """A room of 4 x 2.6 x 3 with a table; where `thick`, its walls have an outside as well."""
    inside = box((0, 0, 0), (4, 2.6, 3)), box((1, 0, 1), (2.2, 0.75, 1.8))
    return joined(*inside, *([box((-0.3, -0.3, -0.3), (4.3, 2.9, 3.3))] if thick else []))


@pytest.mark.parametrize("thick", [False, True])
def test_an_eye_in_a_room_sees_its_edges(thick):
    surface = make_surface(*room(thick))

    def own(p):
        return (np.array(p) - surface.centre) / surface.scale

    eye, target = own((3.6, 1.6, 2.7)), own((1.2, 0.9, 0.9))
    camera = Camera(eye, target, np.array([0, 1.0, 0]), 75.0, 600, 600)
    closed = closed_from(surface, camera.viewpoint)
    body = surface.component
    assert [closed[body == b].all() for b in range(body.max() + 1)] == [False, True, False][
        : body.max() + 1
    ]
    found = extract_view(surface, camera, LineOptions(kinds=("contour", "crease"))).curves
    corner, _ = camera.project(own((0, 2.6, 0))[None])
    three = [own(p) for p in ((0.5, 2.6, 0), (0, 2.0, 0), (0, 2.6, 0.5))]
    for p in three:  # along each of the three edges that meet in the far corner
        xy, _ = camera.project(p[None])
        for t in (0.2, 0.6, 1.0):
            at = corner + t * (xy - corner)
            assert np.linalg.norm(found.xy - at, axis=1).min() < 4.0
    again = extract_view(surface, camera, LineOptions(kinds=("contour", "crease")), hidden=True)
    assert np.array_equal(again.curves.xy, found.xy)


def test_edges_are_seen_along_the_faces_that_hold_them():
    """At a grazing angle float32 places a plane before its own edge; from afar it loses digits."""
    plate = make_surface(*box((-1, -0.001, -1), (1, 0.001, 1)))
    top = np.flatnonzero(plate.face_normals[:, 1] > 0.9)
    corner = plate.vertices[plate.faces[top]]
    face = np.repeat(top, 9)
    t = np.linspace(0.1, 0.9, 9)[None, :, None]
    # the side of each of the two faces that is a true edge
    edge = [
        (a, b)
        for c in corner
        for a, b in zip(c, np.roll(c, -1, axis=0), strict=True)
        if np.isclose(np.linalg.norm(a - b), 1.0)
    ][::2]
    place = np.concatenate([(a + t[0] * (b - a)) for a, b in edge])
    bvh = Bvh(plate)
    for distance in (1.5, 50.0, 5000.0):
        for angle in (2.0, 0.1, 5e-3):
            height = plate.vertices[:, 1].max() + distance * np.sin(np.radians(angle))
            eye = np.array([0.3 * distance, height, distance])
            assert bvh.seen(eye, face, place, np.ones(len(face), bool)).all(), (distance, angle)
    below = place * [1, -1, 1]
    other = np.flatnonzero(plate.face_normals[:, 1] < -0.9)
    back = below[:, 2] < -0.49
    for distance in (1.5, 50.0, 5000.0):  # and a thin plate is never looked through
        eye = np.array([0.1, 0.2, 1.0]) * distance
        seen = bvh.seen(eye, np.repeat(other, 9), below, np.ones(18, bool))
        assert not seen[back].any()


def test_small_details_of_a_large_scene_hide_each_other():
    """A can of 1e-3 of the ground that it stands on is drawn as it is alone."""
    can = lathe([(0, 0), (0.5, 0), (0.5, 1), (0, 1)], 16)
    ground = box((-500, -1, -500), (500, 0, 500))
    alone, both = make_surface(*can), make_surface(*joined(can, ground))
    eye, size = np.array([1.5, 1.6, 2.0]), []
    for surface in (alone, both):
        centre = (np.array([0, 0.5, 0]) - surface.centre) / surface.scale
        camera = Camera(centre + eye / surface.scale, centre, np.array([0, 1.0, 0]), 40.0, 500, 500)
        curves = extract_view(surface, camera, HARD).curves
        near = np.abs(curves.xy - 250).max(axis=1) < 200
        size.append(curves.xy[near])
    assert (cKDTree(size[0]).query(size[1])[0] < 1.5).all()
    assert (cKDTree(size[1]).query(size[0])[0] < 1.5).all()


@pytest.mark.parametrize("name", ["can of 16", "cone", "shaft", "cans", "rounded box"])
def test_seen_and_hidden_make_up_every_fold(name):
    """No edge of a coarse solid is lost between contours and creases: all of it is told once."""
    surface = make_surface(*SOLIDS[name]())
    camera = fit_camera(surface.vertices, "30,30")
    view = extract_view(surface, camera, HARD, hidden=True)
    lines = feature_curves(surface, camera, LineOptions(kinds=("contour", "crease")))
    xy, _ = camera.project(lines.points(surface))
    drawn_xy = np.concatenate([view.curves.xy, view.hidden.xy])
    assert np.percentile(cKDTree(drawn_xy).query(xy)[0], 98) < 4.0
    assert {KINDS[k] for k in view.hidden.kind} <= {"contour", "crease"}


def test_one_triangle_and_needles():
    for vertices in ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [1, 0, 0], [0.5, 1e-4, 0]]):
        surface = make_surface(np.array(vertices, float), np.array([[0, 1, 2]]))
        for view in ("front", "40,20", "180,0"):
            curves = extract_view(surface, fit_camera(surface.vertices, view)).curves
            assert {KINDS[k] for k in curves.kind} <= {"boundary"} and len(curves)


@pytest.mark.parametrize("around", [12, 24])
def test_the_facets_of_a_can_are_no_soft_lines_however_finely_cut(around):
    can = lathe([(0, 0), (0.5, 0), (0.5, 1), (0, 1)], around)
    for mesh in (can, subdivided(*can, 0.04)):
        surface = make_surface(*mesh)
        camera = fit_camera(surface.vertices, "30,30", width=300, height=300)
        curves = extract_view(surface, camera).curves
        assert {KINDS[kind] for kind in curves.kind} <= {"contour", "crease"}


def test_flat_folds_are_no_samples_of_a_smooth_surface():
    fine = make_surface(*subdivided(*lathe([(0, 0), (0.5, 0), (0.5, 1), (0, 1)], 24), 0.03))
    fold = flat_folds(fine)
    upright = np.ptp(fine.vertices[fine.edges[fold], 1], axis=1) > 0
    assert set(np.round(np.degrees(fine.edge_bends[fold])).tolist()) == {15.0, 90.0}
    assert np.allclose(np.degrees(fine.edge_bends[fold][upright]), 15.0)
    for shape in (shapes.sphere(2), shapes.sphere(4), shapes.torus(1.0, 0.4, 32, 16)):
        assert not len(flat_folds(make_surface(*shape)))


def test_a_lift_is_as_wide_as_faces_are_not_as_long():
    """Smooth points on long thin faces do not rise over a wall that stands close before them."""
    rod = lathe([(0.1, -2), (0.1, 2)], 48)
    wall = box((0.13, -2, -0.5), (0.14, 2, 0.5))
    surface = make_surface(*joined(rod, wall))
    face = np.flatnonzero(surface.component == surface.component[0])
    # one body, as in a mesh that is not told apart
    one = type("One", (), {n: getattr(surface, n) for n in ("vertices", "faces", "normals")})
    place = surface.vertices[surface.faces[face]].mean(axis=1)
    eye = np.array([3.0, 0.0, 0.0])
    assert not Bvh(one).seen(eye, face, place, np.zeros(len(face), bool)).any()
