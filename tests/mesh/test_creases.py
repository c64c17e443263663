"""Which sharp edges are creases: lines on solids and seams, not the noise of scans."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.extract.segments import crease_edges
from strokestyle.mesh import creases as module
from strokestyle.mesh.surface import make_surface


def drawn(surface, angle=40.0):
    """Length of the edges that are creases, and of those that are merely sharp."""
    length = np.linalg.norm(np.diff(surface.vertices[surface.edges], axis=1)[:, 0], axis=1)
    sharp = surface.edge_bends > np.radians(angle)
    return length[crease_edges(surface, angle)].sum(), length[sharp].sum()


def tent(angle, turn=0.0, n=12, zigzag=0.0):
    """A ridge of n edges between two flanks that meet at `angle` degrees, turning by `turn` at each
    vertex, or to and fro by `zigzag`."""
    heading = np.radians(np.cumsum(np.full(n, turn) + zigzag * (-1.0) ** np.arange(n)))
    path = np.vstack(
        [np.zeros(2), np.cumsum(np.stack([np.cos(heading), np.sin(heading)], 1), axis=0)]
    )
    out = np.stack([-np.sin(np.r_[heading[0], heading]), np.cos(np.r_[heading[0], heading])], 1)
    drop = np.tan(np.radians(0.5 * angle))
    top = np.column_stack([path[:, 0], np.zeros(n + 1), path[:, 1]])
    sides = [
        top + np.column_stack([s * out[:, 0], np.full(n + 1, -drop), s * out[:, 1]]) * 0.5
        for s in (1, -1)
    ]
    faces = [shapes.grid(2, n + 1), shapes.grid(2, n + 1)[:, ::-1] + (n + 1)]
    faces[1] = np.where(faces[1] < 2 * (n + 1), faces[1] - (n + 1), faces[1])
    return np.vstack([top, *sides]), np.concatenate(faces)


@pytest.mark.parametrize("angle, found", [(35.0, False), (45.0, True), (90.0, True)])
def test_an_edge_is_a_crease_from_the_angle_on(angle, found):
    all_, sharp = drawn(make_surface(*tent(angle)))
    assert (all_ > 0) == found and all_ == pytest.approx(sharp)


def test_a_crease_ends_where_it_weakens():
    """A ridge whose flanks open from 60 to 20 degrees: none of it under the angle is a crease."""
    n = 20
    drop = 0.5 * np.tan(np.radians(np.linspace(30, 10, n + 1)))
    x = np.linspace(0, 2, n + 1)
    rows = [np.column_stack([x, 0 * x, 0 * x])] + [
        np.column_stack([x, -drop, 0 * x + z]) for z in (0.5, -0.5)
    ]
    other = shapes.grid(2, n + 1)[:, ::-1]
    faces = np.concatenate([shapes.grid(2, n + 1), np.where(other > n, other + n + 1, other)])
    surface = make_surface(np.vstack(rows), faces)
    for angle, length in ((41.0, 0.95), (31.0, 1.45), (56.0, 0.2)):
        found, sharp = drawn(surface, angle)
        assert found == sharp and found * surface.scale == pytest.approx(length, abs=0.15)


@pytest.mark.parametrize("sides", [5, 6, 8, 12, 24])
def test_no_fold_under_the_angle_is_a_crease(sides):
    """A prism of n sides is folded by 360 / n degrees, and by 90 at its rims."""
    solid, fold = solids.prism(sides, height=3.0), 360.0 / sides
    surface = make_surface(solid.vertices, solid.faces, polygon=solid.polygon)
    rims = 2 * sides * 2 * 0.5 * np.sin(np.pi / sides)
    for angle in (fold - 0.1, fold, fold + 0.1):
        expected = rims + (3.0 * sides if angle < fold else 0.0)
        assert drawn(surface, angle)[0] * surface.scale == pytest.approx(expected)


@pytest.mark.parametrize("angle", [30.0, 45.0, 60.0, 90.0])
@pytest.mark.parametrize("decimals", [6, 5])
def test_a_fold_of_just_the_angle_is_none_however_the_file_rounds(angle, decimals):
    """Coordinates of 6 or 5 places, in any position, put a fold a few 1e-4 degrees off."""
    rng, (vertices, faces) = np.random.default_rng(1), tent(angle)
    for _ in range(5):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        rounded = np.round(vertices @ turn + rng.random(3), decimals)
        assert drawn(make_surface(rounded, faces), angle)[0] == 0.0
        assert drawn(make_surface(rounded, faces), angle - 0.1)[0] > 0.0


def test_a_warped_quad_is_one_face():
    """A square column turned by 90 degrees on its way up: its quads' diagonals are folded by up to
    47 degrees, and no edges of the shape. Those are the rims and the four edges that wind up."""
    solid = solids.prism(4, height=2.0, radius=1.0, layers=12, twist=7.5)
    surface = make_surface(solid.vertices, solid.faces, polygon=solid.polygon)
    corner = solid.vertices.reshape(13, 4, 3)
    winding = np.linalg.norm(np.diff(corner, axis=0), axis=2).sum()
    assert drawn(surface)[0] * surface.scale == pytest.approx(winding + 8 * np.sqrt(2.0))
    assert drawn(make_surface(solid.vertices, solid.faces))[0] > 1.5 * drawn(surface)[0]
    inside = surface.polygon[surface.edge_faces]
    within = (surface.edge_face_count == 2) & (inside[:, 0] == inside[:, 1])
    assert within.sum() == 48 + 2 and not within[surface.cut_edges].any()


def test_a_polygon_folded_on_itself_keeps_its_faces():
    """Two squares at right angles, said to be one polygon, and a box beside them."""
    fold = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0.01], [1, 0, 0.01]], float)
    solid = solids.together(solids.Solid(fold, [(0, 1, 2, 3)]), solids.box((2, 0, 0), (3, 1, 1)))
    polygon = solid.polygon
    faces = np.vstack([solid.faces, [[0, 4, 5], [0, 5, 1]]])
    polygon = np.r_[polygon, [0, 0]]
    surface = make_surface(solid.vertices, faces, polygon=polygon)
    assert drawn(surface)[0] * surface.scale == pytest.approx(12.0)


@pytest.mark.parametrize("n", [2, 3, 5, 9])
def test_all_edges_of_a_cube_are_creases(n):
    all_, sharp = drawn(make_surface(*shapes.cube(n)))
    assert all_ == sharp == pytest.approx(12.0)


@pytest.mark.parametrize("size", [0.2, 0.02, 0.002, 2e-4])
def test_a_small_box_has_creases(size):
    """Flat sides tell a crease however short, as on the details of a machine."""
    box = shapes.cube(3)
    block = shapes.cube(2).vertices
    vertices, faces = (
        np.vstack([block, size * box.vertices + 0.9]),
        np.vstack([shapes.cube(2).faces, box.faces + 8]),
    )
    surface = make_surface(vertices, faces)
    length = np.linalg.norm(np.diff(surface.vertices[surface.edges], axis=1)[:, 0], axis=1)
    small = np.isin(np.arange(len(length)), crease_edges(surface, 40.0)) & (length < 0.4)
    assert length[small].sum() == pytest.approx(12.0 * size / surface.scale)


@pytest.mark.parametrize("sides", [4, 6, 8])
def test_creases_do_not_know_what_else_the_mesh_holds(sides):
    """Bolts on a rod 1000 times as long; a far triangle."""
    bolt = solids.prism(sides, 0.3, 0.2, layers=3)
    alone = make_surface(bolt.vertices, bolt.faces)
    expected = drawn(alone)[0] * alone.scale
    rod = solids.box((-500, -1, -0.2), (500, -0.5, 0.2))
    stray = solids.Solid(np.array([[0, 4e3, 0], [0.1, 4e3, 0], [0, 4e3, 0.1]]), [(0, 1, 2)])
    for other, own in ((rod, 4 * (1000 + 0.5 + 0.4)), (stray, 0.0)):
        both = solids.together(bolt, other)
        surface = make_surface(both.vertices, both.faces)
        assert drawn(surface)[0] * surface.scale - own == pytest.approx(expected, rel=1e-6)


def recess(around, radius=0.05, deep=0.02):
    """A square of wall with a hole of `around` sides and a floor."""
    at = 2 * np.pi * (np.arange(around) + 0.5) / around
    ring = np.column_stack([radius * np.cos(at), radius * np.sin(at), 0 * at])
    corner = 0.5 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    i, quarter = np.arange(around), around // 4
    j, own = (i + 1) % around, 2 * around + i // quarter
    walls = [(i, j, around + j), (i, around + j, around + i), (j, i, own)]
    last = i % quarter == quarter - 1  # of a corner's sides; a face leads to the next corner
    between = np.column_stack([j, own, 2 * around + (i // quarter + 1) % 4])[last]
    floor = [(around, around + k - 1, around + k) for k in range(2, around)]
    faces = np.vstack([*(np.column_stack(wall) for wall in walls), between, floor])
    return np.vstack([ring, ring - [0, 0, deep], corner]), faces


@pytest.mark.parametrize("around", [4, 8, 64])
def test_windows_in_a_long_wall(around):
    """Recesses are of one body with the wall: their two rims, and the edges between them where
    these are folded enough."""
    count, (vertices, faces) = 60, recess(around)
    wall = np.vstack([vertices + [k, 0, 0] for k in range(count)])
    faces = np.vstack([faces + k * len(vertices) for k in range(count)])
    surface = make_surface(wall, faces)
    assert len(np.unique(surface.component)) == 1
    rim = around * 2 * 0.05 * np.sin(np.pi / around)
    expected = count * (2 * rim + (around * 0.02 if around < 9 else 0.0))
    assert drawn(surface)[0] * surface.scale == pytest.approx(expected)


@pytest.mark.parametrize("sides", [4, 6])
def test_studs_on_a_long_plate(sides):
    """Pyramids, whose sides are single triangles, of one body with a plate: all their edges."""
    at = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    foot = 0.05 * np.column_stack([np.cos(at), np.sin(at), 0 * at])
    corner = 0.5 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    tip, outer = sides, sides + 1
    nearest = np.arange(sides) * 4 // sides
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [(i, j, tip), (j, i, outer + nearest[i])]
        for k in range((nearest[j] - nearest[i]) % 4):
            faces.append((j, outer + (nearest[i] + k) % 4, outer + (nearest[i] + k + 1) % 4))
    one, count = np.vstack([foot, [[0, 0, 0.06]], corner]), 60
    vertices = np.vstack([one + [k, 0, 0] for k in range(count)])
    surface = make_surface(
        vertices, np.vstack([np.array(faces) + k * len(one) for k in range(count)])
    )
    hips, rim = sides * np.hypot(0.05, 0.06), sides * 0.1 * np.sin(np.pi / sides)
    assert drawn(surface)[0] * surface.scale == pytest.approx(count * (hips + rim))


def test_small_round_rims_are_creases():
    """A low can on a large block: the rim turns by 30 degrees from edge to edge."""
    can = shapes.cylinder(radius=0.03, height=0.05, around=12, rows=2)
    rim = np.arange(12, 24)
    fan = np.stack([rim, np.roll(rim, -1), np.full(12, 24)], 1)[:, ::-1]
    n = len(can.vertices)
    vertices = np.vstack([can.vertices, [[0, 0.025, 0]], shapes.cube(2).vertices + [0, -0.55, 0]])
    surface = make_surface(vertices, np.vstack([can.faces, fan, shapes.cube(2).faces + n + 1]))
    top = surface.vertices[surface.edges][:, :, 1].min(axis=1) > 0.499
    assert (
        np.isin(
            np.flatnonzero(top & (surface.edge_face_count == 2)), crease_edges(surface, 40.0)
        ).sum()
        == 12
    )


def test_bumps_too_fine_for_the_mesh_are_no_creases():
    """Hair of a scan: sharp edges all over, that lead nowhere."""
    ball = shapes.sphere(5)
    height = np.random.default_rng(0).normal(size=len(ball.vertices))
    surface = make_surface(ball.vertices * (1.0 + 0.02 * height)[:, None], ball.faces)
    kept, sharp = drawn(surface)
    assert sharp > 20.0 and kept < 0.25 * sharp


@pytest.mark.parametrize("zigzag, chains", [(0.0, 1), (20.0, 1), (30.0, 12)])
def test_a_chain_may_waver_but_not_zigzag(zigzag, chains):
    heading = np.radians(zigzag * (-1.0) ** np.arange(12))
    along = np.stack([np.cos(heading), np.sin(heading), np.zeros(12)], 1)
    ends = np.stack([np.arange(12), np.arange(1, 13)], 1)
    assert len(np.unique(module.chains(ends, along))) == chains
    turned = (
        np.random.default_rng(0).random(12) < 0.5
    )  # which end of an edge comes first does not matter
    ends[turned], along[turned] = ends[turned, ::-1], -along[turned]
    assert len(np.unique(module.chains(ends, along))) == chains


def test_the_straightest_go_on_at_a_crossing():
    heading = np.radians(
        [0, 5, 90, 95, 130]
    )  # into the vertex, out of it, in, out, and one more out
    along = np.stack([np.cos(heading), np.sin(heading), np.zeros(5)], 1)
    ends = np.array([[1, 0], [0, 2], [3, 0], [0, 4], [0, 5]])
    chain = module.chains(ends, along)
    assert chain[0] == chain[1] != chain[2] == chain[3] and chain[4] not in chain[:4]


def test_low_poly_shapes_keep_their_edges():
    kept, sharp = drawn(make_surface(*shapes.sphere(0)))
    assert kept == sharp > 0


@pytest.mark.parametrize("width, found", [(0.5, True), (0.05, False)])
def test_a_face_folded_over_is_a_crease_only_where_it_is_long(width, found):
    """A flap folded back over a square, from a part of its edge."""
    vertices = [[0, 0, 0], [width, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    flap = [[0, 0.02, 0.001], [width, 0.02, 0.001]]
    faces = np.array([[4, 0, 1], [4, 1, 2], [4, 2, 3], [1, 0, 5], [1, 5, 6]])
    surface = make_surface(np.array(vertices + flap), faces)
    kept, sharp = drawn(surface)
    assert kept == pytest.approx(width if found else 0.0) and sharp == pytest.approx(width)


def test_nothing_much_is_no_trouble():
    for shape in (shapes.plane(), shapes.moebius(), shapes.sphere(2)):
        surface = make_surface(*shape)
        assert drawn(surface)[0] == 0.0
    rng = np.random.default_rng(3)
    soup = make_surface(rng.random((300, 3)), rng.integers(0, 300, (900, 3)))
    assert np.isfinite(drawn(soup)).all()
    star = np.vstack(
        [[0, 0, 0], shapes.sphere(2).vertices]
    )  # hundreds of sharp edges at one vertex
    ring = rng.integers(1, len(star), (400, 2))
    make_surface(star, np.column_stack([np.zeros(400, int), ring])[ring[:, 0] != ring[:, 1]])
