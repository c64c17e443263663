"""Parts that pass through one another, against closed form and against all pairs of faces."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.intersections import crossings, overlapping_boxes
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import feature_curves
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.rays import Bvh
from strokestyle.extract.segments import intersection_segments
from strokestyle.extract.visible import look_along
from strokestyle.geometry.curves import KINDS
from strokestyle.mesh.surface import make_surface

ONLY = LineOptions(("intersection",))
WITHOUT = LineOptions(("contour", "boundary", "crease"))


def together(*parts):
    """(vertices, faces) of several, and the part of each face."""
    vertices, faces, group, count = [], [], [], 0
    for i, (v, f) in enumerate(parts):
        vertices.append(v)
        faces.append(np.asarray(f) + count)
        group.append(np.full(len(f), i))
        count += len(v)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(group)


def scatter(count, seed=0, size=0.7):
    """Triangles anywhere, each a part of its own."""
    rng = np.random.default_rng(seed)
    vertices = (rng.random((count, 1, 3)) + size * rng.random((count, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * count).reshape(-1, 3), np.arange(count)


def by_signs(vertices, faces, i, j):
    """Do faces i and j cross? A side of one goes through the other: signs of volumes of
    tetrahedra."""
    for a, b in ((i, j), (j, i)):
        p, (q0, q1, q2) = vertices[faces[a]], vertices[faces[b]]
        volume = lambda *t: np.sign(np.linalg.det(np.array(t[:3]) - t[3]))  # noqa: E731
        for k in range(3):
            s, e = p[k], p[(k + 1) % 3]
            if volume(q0, q1, q2, s) != volume(q0, q1, q2, e):
                round_ = {volume(s, e, q0, q1), volume(s, e, q1, q2), volume(s, e, q2, q0)}
                if len(round_) == 1:
                    return True
    return False


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 65])
def test_boxes_overlap_as_all_pairs_say(count):
    rng = np.random.default_rng(count)
    low = rng.random((count, 3))
    high = low + 0.4 * rng.random((count, 3))
    group = rng.integers(0, 3, count)
    found = list(overlapping_boxes(low, high, group))
    found = np.concatenate(found) if found else np.zeros((0, 2), int)
    i, j = np.triu_indices(count, 1)
    meet = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1) & (group[i] != group[j])
    assert sorted(map(tuple, found)) == sorted(zip(i[meet], j[meet], strict=True))


def test_faces_cross_as_their_sides_say():
    vertices, faces, group = scatter(60)
    found = crossings(vertices, faces, group)
    expected = [
        (i, j) for i in range(60) for j in range(i + 1, 60) if by_signs(vertices, faces, i, j)
    ]
    assert len(expected) > 40 and list(map(tuple, found.face)) == expected
    for k in range(len(found)):  # both ends lie on both faces
        for end in range(2):
            p = found.points[k, end]
            for face in found.face[k]:
                q = vertices[faces[face]]
                weight = np.linalg.lstsq(np.vstack([q.T, np.ones(3)]), np.r_[p, 1], rcond=None)[0]
                assert np.abs(weight @ q - p).max() < 1e-9 and weight.min() > -1e-9


@pytest.mark.parametrize("degrees, found", [(0.0, 0), (0.5, 0), (3.0, 1), (90.0, 1)])
def test_faces_that_nearly_lie_on_each_other_do_not_cross(degrees, found):
    t = np.radians(degrees)
    flat = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.0, 0.5, 0.0]])
    turned = flat @ np.array([[np.cos(t), 0, np.sin(t)], [0, 1, 0], [-np.sin(t), 0, np.cos(t)]])
    assert (
        len(crossings(np.vstack([flat, turned]), np.arange(6).reshape(2, 3), np.arange(2))) == found
    )


def test_two_spheres_meet_in_a_circle():
    offset = np.array([0.9, 0.1, 0.2])
    error = []
    for level in (3, 4):
        big, small = shapes.sphere(level), shapes.sphere(level + 1, 0.7)
        surface = make_surface(*together(big, (small.vertices + offset, small.faces))[:2])
        curves = feature_curves(surface, fit_camera(surface.vertices, "30,20"), ONLY)
        assert len(curves) == 1 and curves.closed.all() and KINDS[curves.kind[0]] == "intersection"
        points = surface.original(curves.points(surface))
        far = np.linalg.norm(offset)
        height = (far**2 + 1.0 - 0.49) / (2.0 * far)
        along = points @ offset / far
        aside = np.linalg.norm(points - along[:, None] * offset / far, axis=1)
        error.append(
            max(np.abs(along - height).max(), np.abs(aside - np.sqrt(1.0 - height**2)).max())
        )
    assert error[1] < 0.4 * error[0] and error[1] < 2e-3


def test_a_circle_is_seen_where_it_faces_the_eye():
    big, small = shapes.sphere(4), shapes.sphere(4, 0.7)
    surface = make_surface(*together(big, (small.vertices + [0.9, 0.0, 0.0], small.faces))[:2])
    scene = Bvh(surface)
    size = 0.5 * np.ptp(surface.vertices[:, 1])  # of the large sphere
    circle = 2 * np.pi * np.sqrt(1 - ((0.81 + 1 - 0.49) / 1.8) ** 2) * size
    share = []
    for eye in ((60.0, 0.0, 0.0), (-60.0, 0.0, 0.0), (0.0, 0.0, 60.0)):
        camera = Camera(eye, (0, 0, 0), (0, 1, 0), 1.5, 512, 512)
        lines = feature_curves(surface, camera, ONLY)
        curves = look_along(surface, camera, lines, scene).fragments().curves
        share.append(curves.lengths().sum() * 60.0 / camera.focal / circle)
    # from the small sphere's side half of it would be seen at the rim; here it is behind the small
    # sphere's widest part
    assert share[0] < 0.01 and share[1] < 0.01
    assert abs(share[2] - 1.0 / np.pi) < 0.01  # edge on: a line as long as the circle is wide


def test_a_cube_through_a_cube():
    cube = shapes.cube(3)
    surface = make_surface(*together(cube, (cube.vertices + [0.5, 0.3, 0.2], cube.faces))[:2])
    curves = feature_curves(surface, fit_camera(surface.vertices, "30,20"), ONLY)
    assert len(curves) == 1 and curves.closed[0]
    points = surface.original(curves.points(surface))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert length == pytest.approx(
        2 * (0.5 + 0.7 + 0.8)
    )  # of the box that both share, the edges of two corners
    for middle in (np.zeros(3), [0.5, 0.3, 0.2]):
        assert (np.abs(points - middle).max(axis=1) < 0.5 + 1e-6).all()


def test_a_part_of_a_drawing():
    """A ball on a board: without the line where they meet it would float."""
    board, ball = shapes.cube(9), shapes.sphere(4, 0.4)
    surface = make_surface(
        *together(
            (board.vertices * [2, 0.2, 2], board.faces), (ball.vertices + [0, 0.2, 0], ball.faces)
        )[:2]
    )
    camera = fit_camera(surface.vertices, "20,35")
    circle = (
        2 * np.pi * 0.4 / 4 * camera.focal / np.linalg.norm(camera.eye)
    )  # px, seen from straight above
    length = [
        extract_view(surface, camera, options).curves.lengths().sum() for options in (None, WITHOUT)
    ]
    assert 0.4 * circle < length[0] - length[1] < 0.8 * circle


def same(v, f, **_):
    return [(v, f), (v, f)]


def nearly(v, f, **_):
    return [(v, f), (v + [0.0, 0.0, 1e-5], f)]


def beside(v, f, **_):
    return [(v, f), (v + [1.0, 0.2, 0.1], f)]


def resting(v, f, **_):
    return [(v, f), (0.5 * v + [0.0, 0.75, 0.0], f)]


@pytest.mark.parametrize("lay", [same, nearly, beside, resting])
def test_skins_that_touch_draw_no_lines(lay):
    for shape in (shapes.cube(4), shapes.sphere(3)):
        if (lay in (beside, resting)) != (len(shape.faces) < 200) and lay != same:
            continue  # balls do not rest on faces, and cubes have edges that cross
        surface = make_surface(*together(*lay(*shape))[:2])
        assert len(intersection_segments(surface, LineOptions())) == 0


def test_a_heap_of_faces_has_none():
    vertices, faces, group = scatter(400, size=2.0)
    assert len(crossings(vertices, faces, group)) == 0
    assert len(crossings(*scatter(20, size=2.0))) > 0


def test_nothing_much_is_no_trouble():
    for shape in (shapes.plane(), shapes.cube(2), shapes.moebius()):
        surface = make_surface(*shape)
        assert len(crossings(surface.vertices, surface.faces, surface.component)) == 0
    flat = together(shapes.plane(), shapes.plane(4))
    surface = make_surface(*flat[:2])
    assert len(feature_curves(surface, fit_camera(surface.vertices), ONLY)) == 0
    vertices, faces, _ = scatter(300, seed=1)
    surface = make_surface(vertices, faces)
    curves = feature_curves(surface, fit_camera(surface.vertices), ONLY)
    assert len(curves) > 100 and np.isfinite(curves.points(surface)).all()


def test_the_order_of_faces_does_not_matter():
    big, small = shapes.sphere(3), shapes.torus(0.9, 0.3, 48, 24)
    vertices, faces, _ = together(big, (small.vertices + [0.5, 0.1, 0.2], small.faces))
    shuffled = np.random.default_rng(0).permutation(len(faces))
    length = []
    for order in (np.arange(len(faces)), shuffled):
        surface = make_surface(vertices, faces[order])
        curves = feature_curves(surface, fit_camera(surface.vertices, "30,20"), ONLY)
        assert curves.closed.all()
        length.append(np.linalg.norm(np.diff(curves.points(surface), axis=0), axis=1).sum())
    assert length[0] == pytest.approx(length[1], rel=0.05)


@pytest.mark.parametrize("sides", [8, 12, 20, 48])
def test_two_pipes_of_one_radius_cross_in_an_x_without_a_gap(sides):
    # at the middle of the X both touch, and the angle between them falls to nothing
    pipe = solids.prism(sides, 3.0, 0.2).moved((0.0, -1.5, 0.0))
    both = solids.together(pipe, pipe.turned(90.0, axis=2))
    surface = make_surface(both.vertices, both.faces, polygon=both.polygon)
    node = intersection_segments(surface, LineOptions()).node
    _, degree = np.unique(node, return_counts=True)
    assert sorted(np.unique(degree)) == [2, 4]  # no loose end
    assert (degree == 4).sum() == 2
