"""T-junctions, low faces that hide them, and sides of two resolutions: as the clean mesh."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.segments import crease_edges
from strokestyle.mesh import stitch as module
from strokestyle.mesh.soup import Soup
from strokestyle.mesh.surface import make_surface
from strokestyle.mesh.triangles import Edges


def creased(surface, angle=40.0):
    """Length of the creases, in the file's units."""
    length = np.linalg.norm(np.diff(surface.vertices[surface.edges], axis=1)[:, 0], axis=1)
    return length[crease_edges(surface, angle)].sum() * surface.scale


def bounded(surface):
    """Length of the boundaries, in the file's units."""
    length = np.linalg.norm(np.diff(surface.vertices[surface.edges], axis=1)[:, 0], axis=1)
    return length[surface.edge_face_count == 1].sum() * surface.scale


def drawn(surface, view="30,30"):
    """Length of what is drawn of it, px."""
    curves = extract_view(surface, fit_camera(surface.vertices, view)).curves
    return sum(float(np.hypot(*np.diff(curves[i], axis=0).T).sum()) for i in range(len(curves)))


def tiles(xs, ys, flip=False):
    """Rectangles over a unit square, each a polygon with vertices of its own."""
    corners, polygons = [], []
    for (x0, x1), (y0, y1) in zip(xs, ys, strict=True):
        quad = [(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)]
        polygons.append(tuple(len(corners) + np.arange(4)))
        corners += quad[::-1] if flip else quad
    return solids.Solid(np.array(corners, float), polygons)


def uneven(n, rows, seed):
    """A unit square of rows of rectangles, each row cut elsewhere."""
    rng = np.random.default_rng(seed)
    xs, ys = [], []
    for j in range(rows):
        at = np.r_[0.0, np.sort(rng.random(n - 1)), 1.0] if n > 1 else np.array([0.0, 1.0])
        xs += list(zip(at[:-1], at[1:], strict=True))
        ys += [(j / rows, (j + 1) / rows)] * n
    return tiles(xs, ys)


def cube_of_tiles(n=5, rows=4):
    """A unit cube whose sides are tiled each in a way of its own: T-junctions all over."""
    sides = []
    for k, (turn, axis) in enumerate([(0, 0), (90, 0), (180, 0), (270, 0), (90, 1), (-90, 1)]):
        side = uneven(n, rows, k).moved((-0.5, -0.5, 0.5))
        sides.append(side.turned(turn, axis))
    return solids.together(*sides)


def test_a_cube_of_tiles_has_twelve_edges():
    solid = cube_of_tiles()
    for decimals in (16, 7, 5):
        surface = make_surface(np.round(solid.vertices, decimals), solid.faces)
        assert surface.closed_faces.all() and (surface.edge_face_count == 2).all()
        assert creased(surface) == pytest.approx(12.0, rel=1e-4)
        assert drawn(surface) == pytest.approx(drawn(make_surface(*shapes.cube(2))), rel=2e-3)


def test_a_flat_wall_of_bricks_has_its_outline():
    wall = uneven(7, 9, 3)
    surface = make_surface(wall.vertices, wall.faces, polygon=wall.polygon)
    assert bounded(surface) == pytest.approx(4.0) and creased(surface) == 0.0
    assert len(np.unique(surface.component)) == 1


def test_faces_keep_part_and_polygon():
    wall = uneven(4, 3, 5)
    part = np.arange(len(wall.faces)) // 2 % 3
    surface = make_surface(
        wall.vertices, wall.faces, part=part, part_names=("a", "b", "c"), polygon=wall.polygon
    )
    centre = surface.original(surface.vertices[surface.faces].mean(axis=1))
    low, high = (
        f(axis=1) for f in (wall.vertices[wall.polygons].min, wall.vertices[wall.polygons].max)
    )
    assert len(surface.faces) > len(wall.faces)
    own = surface.polygon
    assert (centre[:, :2] > low[own, :2]).all() and (centre[:, :2] < high[own, :2]).all()
    assert np.array_equal(surface.part, own % 3)
    area = 0.5 * np.linalg.norm(
        np.cross(*np.moveaxis(np.diff(surface.vertices[surface.faces], axis=1), 1, 0)), axis=1
    )
    assert area.sum() * surface.scale**2 == pytest.approx(1.0) and area.min() > 1e-5


@pytest.mark.parametrize("bump", [0.0, 1e-9, 1e-6, -1e-6])
def test_low_faces_that_close_a_T_junction_are_none(bump):
    """A house whose hips have corners of their own on one side, with low faces between."""
    v = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1], [-1, 2, 1], [1, 2, 1], [1, 2, -1]]
    v += [[-1, 2, -1], [0, 3, 0]]
    quads = [(0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    roof = [(4, 5, 8), (6, 7, 8)]
    clean = solids.Solid(np.array(v, float), [*quads, *roof, (5, 6, 8), (7, 4, 8)])
    middle = [[-0.5, 2.5 + bump, 0.5], [0.5, 2.5, 0.5 + bump], [0.5 + bump, 2.5, -0.5]]
    middle += [[-0.5, 2.5, -0.5 - bump]]
    fans = [(5, 6, 10), (6, 11, 10), (11, 8, 10), (7, 4, 12), (4, 9, 12), (9, 8, 12)]
    low = [(5, 10, 8), (6, 8, 11), (4, 8, 9), (7, 12, 8)]
    dirty = solids.Solid(np.array(v + middle), [*quads, *roof, *fans, *low])
    one, two = (make_surface(s.vertices, s.faces, polygon=s.polygon) for s in (clean, dirty))
    assert two.closed_faces.all() and len(np.unique(two.component)) == 1
    assert creased(two) == pytest.approx(creased(one), rel=1e-5)
    assert drawn(two, "three-quarter") == pytest.approx(drawn(one, "three-quarter"), rel=1e-3)


@pytest.mark.parametrize("coarse, fine", [(24, 48), (12, 36), (16, 64), (24, 24), (48, 24)])
def test_rings_of_two_resolutions(coarse, fine):
    """A tube whose upper half has other sides: nothing is drawn where they meet."""

    def tube(sides, low, high):
        prism = solids.prism(sides, high - low)
        return solids.Solid(prism.vertices + [0, low, 0], prism.polygons[:-2])

    both = solids.together(tube(coarse, 0, 1), tube(fine, 1, 2))
    surface = make_surface(both.vertices, both.faces, polygon=both.polygon)
    rims = [n * 2 * 0.5 * np.sin(np.pi / n) for n in (coarse, fine)]
    assert bounded(surface) == pytest.approx(sum(rims)) and creased(surface) == 0.0
    assert len(np.unique(surface.component)) == 1


@pytest.mark.parametrize("wide", [0.3, 0.02, 1e-3])
def test_a_slit_stays_open(wide):
    """A long hole with square ends, and a pointed one."""
    outer = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    low, high = 0.5 - wide / 2, 0.5 + wide / 2
    slit = np.array([[0.1, low, 0], [0.9, low, 0], [0.9, high, 0], [0.1, high, 0]])
    ring = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)]
    solid = solids.Solid(np.vstack([outer, slit]), ring)
    surface = make_surface(solid.vertices, solid.faces)
    assert bounded(surface) == pytest.approx(4.0 + 1.6 + 2.0 * wide)


def test_a_triangle_is_no_gap():
    """Thin triangles alone and side by side keep their outline; so does a pointed hole."""
    for high in (0.1, 0.05, 0.3):
        one = np.array([[0, 0, 0], [1, 0, 0], [0.5, high, 0.0]])
        assert bounded(make_surface(one, [[0, 1, 2]])) == pytest.approx(1 + 2 * np.hypot(0.5, high))
    ring = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.8, 0.0]])
    inner = 0.5 * ring + [0.25, 0.15, 0]
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    surface = make_surface(np.vstack([ring, inner]), faces)
    assert bounded(surface) == pytest.approx(1.5 * (1 + 2 * np.hypot(0.5, 0.8)))


def test_a_fence_round_a_thin_triangle_is_not_bent():
    foot = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.1, 0.0]])
    fence = solids.Solid(
        np.vstack([foot, foot + [0, 0, 0.5]]), [(0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
    )
    surface = make_surface(fence.vertices, fence.faces)
    assert len(surface.faces) == 6 and bounded(surface) == pytest.approx(2 + 4 * np.hypot(0.5, 0.1))


def test_cards_that_touch_keep_their_outlines():
    """A card's corner on another's side, and its side along half of the other's: that is a seam
    where they are of one plane and share all of the side, a T-junction else."""
    a = tiles([(0, 1)], [(0, 1)])
    corner = a.turned(45, 2)
    corner = corner.moved(
        [
            1.0 - corner.vertices[:, 0].min(),
            0.5 - corner.vertices[corner.vertices[:, 0].argmin(), 1],
            0,
        ]
    )
    both = solids.together(a, corner)
    assert bounded(make_surface(both.vertices, both.faces)) == pytest.approx(8.0)
    surface = make_surface(both.vertices, both.faces)
    assert len(surface.faces) == 4  # nothing is cut where they only touch
    beside = solids.together(a, tiles([(1, 2)], [(0.25, 0.75)]))
    surface = make_surface(beside.vertices, beside.faces)
    assert bounded(surface) == pytest.approx(4.0 + 3.0 - 2 * 0.5)


def test_a_clean_mesh_is_left_alone():
    for shape in (shapes.sphere(3), shapes.plane(9), shapes.cylinder(), shapes.moebius()):
        soup = Soup(shape.vertices * 0.3, shape.faces, np.arange(len(shape.faces)))
        assert module.stitch(soup) is soup


@pytest.mark.parametrize("long", [False, True])
def test_few_are_asked_about_each_other(long):
    """Loose strips, and one long side beside thousands of short ones: pairs grow with the edges."""
    rng, counts = np.random.default_rng(0), []
    for n in (1000, 8000):
        start = rng.random((n, 3))
        step = rng.normal(size=(n, 3)) * 0.3 / np.cbrt(n)
        points = np.vstack([start, start + step])
        ends = np.column_stack([np.arange(n), np.arange(n) + n])
        if long:
            points = np.vstack([points, [[0, 0, 0], [1, 1, 1], [0, 1, 0], [1, 0, 1]]])
            ends = np.vstack([ends, [[2 * n, 2 * n + 1], [2 * n + 2, 2 * n + 3]]])
        counts.append(sum(len(row) for row, _ in module._near(points, ends, np.unique(ends))) / n)
    assert counts[1] < 1.5 * counts[0] and counts[1] < 20


def test_a_heap_of_long_edges_is_looked_at_piece_by_piece():
    rng, counts = np.random.default_rng(0), []
    for n in (500, 8000):
        points = rng.random((2 * n, 3))  # edges as long as the heap: each is near thousands of ends
        ends = np.arange(2 * n).reshape(n, 2)
        counts.append(sum(len(row) for row, _ in module._near(points, ends, np.unique(ends))) / n)
    assert counts[1] < 8.0 * counts[0] and counts[1] < 500  # of all pairs, 16 times as many


def test_soups_are_no_trouble():
    rng = np.random.default_rng(7)
    for _ in range(20):
        points, faces = rng.integers(0, 4, (60, 3)) / 3.0, rng.integers(0, 60, (80, 3))
        surface = make_surface(points, faces)
        assert np.isfinite(surface.normals).all()
        assert Edges.of(surface.faces, len(surface.vertices)).uses.max() <= 4


def folded_grid(folds, n=8):
    """A flat grid of triangles, some inner vertices moved over the side of a face beyond them."""
    x, z = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    points = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [np.stack([a, a + n + 1, a + 1], 1), np.stack([a + 1, a + n + 1, a + n + 2], 1)]
    )
    for i, j in folds:
        points[i * (n + 1) + j] += [0.75, 0.0, 0.75]  # over the diagonal of the cell beyond it
    return points, faces


def turned_over(surface):
    """How many faces look the other way than most."""
    up = surface.face_normals[:, 1]
    return int(min((up > 0).sum(), (up < 0).sum()))


@pytest.mark.parametrize("folds", [[(2, 2)], [(2, 2), (2, 5), (5, 3)], [(3, 3), (4, 4)]])
def test_faces_folded_back_are_laid_flat(folds, monkeypatch):
    points, faces = folded_grid(folds)
    surface = make_surface(points, faces)
    area = np.cross(
        *(
            surface.vertices[surface.faces[:, k]] - surface.vertices[surface.faces[:, 0]]
            for k in (1, 2)
        )
    )
    assert turned_over(surface) == 0 and creased(surface) == 0
    assert bounded(surface) == pytest.approx(32)
    assert np.linalg.norm(area, axis=1).sum() / 2 * surface.scale**2 == pytest.approx(64)
    monkeypatch.setattr(module, "LESS", 0.0)  # without the cure there are folds
    assert turned_over(make_surface(points, faces)) > 0


@pytest.mark.parametrize("height", [0.05, 0.2, 0.5])
def test_the_floor_of_a_flat_tent_is_no_fold(height):
    points = np.array([[0, 0, 0], [3, 0, 0], [0, 0, 3], [1, height, 1.0]], float)
    surface = make_surface(points, np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]))
    assert len(surface.faces) == 4 and len(surface.vertices[np.unique(surface.weld)]) == 4
    height_found = np.ptp(surface.vertices[:, 1]) * surface.scale
    assert height_found == pytest.approx(height)
