"""What is one place, one face, one crack: and what is fine detail that must stay."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.mesh import weld
from strokestyle.mesh.surface import make_surface
from strokestyle.mesh.triangles import Edges


def of(solid):
    return make_surface(solid.vertices, solid.faces, polygon=solid.polygon)


def soup(shape):
    """Each face with vertices of its own."""
    corners = shape.vertices[shape.faces].reshape(-1, 3)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def test_places_are_found_by_their_bits():
    rng = np.random.default_rng(0)
    points = rng.integers(-2, 3, (500, 3)) * 0.1
    points[rng.random(500) < 0.3] *= -1.0  # and -0.0
    first = weld.first_at_place(points)
    expected = [np.flatnonzero((points == one).all(axis=1))[0] for one in points]
    assert np.array_equal(first, expected)


def test_places_of_one_hash_are_told_apart(monkeypatch):
    monkeypatch.setattr(weld, "MIX", np.uint64(1 << 57))  # leaves some 100 hashes
    points = np.random.default_rng(1).random((2000, 3))
    assert np.array_equal(weld.first_at_place(points), np.arange(2000))


@pytest.mark.parametrize("amount", [1e-7, 3e-6, 1e-5])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_cracks_are_closed(amount, kind):
    """Corners of a soup, each rounded for itself by up to 1e-5 of the size."""
    shape = shapes.sphere(3)
    rng = np.random.default_rng(2)
    points, faces = soup(shape)
    points = points + 2.0 * amount * rng.uniform(-1, 1, points.shape)
    surface = make_surface(points.astype(kind), faces)
    assert len(surface.vertices) == len(shape.vertices) and surface.closed_faces.all()
    assert (surface.edge_face_count == 2).all()


def test_a_crack_wider_than_the_mesh_is_fine_is_none():
    """A strip of 1e-5 of the size on an open sheet: its sides are no crack, nor are its rungs."""
    n, wide = 400, 1e-5
    x = np.linspace(0, 0.4, n)
    strip = np.vstack(
        [np.column_stack([x, 0 * x, 0 * x]), np.column_stack([x, wide + 0 * x, 0 * x])]
    )
    sheet = np.array([[0, -1, 0], [1, -1, 0], [1, -0.5, 0], [0, -0.5, 0.0]])
    faces = np.vstack([shapes.grid(2, n), np.array([[0, 1, 2], [0, 2, 3]]) + 2 * n])
    surface = make_surface(np.vstack([strip, sheet]), faces)
    assert len(surface.vertices) == 2 * n + 4 and len(surface.faces) == len(faces)


def test_detail_far_finer_than_the_whole_stays():
    """A house at UTM coordinates, a triangle at their origin: its chimney is of 0.7 m."""
    east, north = 352000.0, 5411000.0
    house = solids.box((east, 0, north), (east + 8, 3, north + 6))
    chimney = solids.box((east + 5, 2, north + 3), (east + 5.7, 4, north + 3.7))
    stray = solids.Solid(np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]), [(0, 1, 2)])
    points, faces = solids.together(house, chimney, stray).soup
    assert len(np.unique(weld.first_at_place(points))) == 8 + 8 + 3
    both = solids.together(house, chimney)
    surface = of(both)
    assert len(np.unique(surface.weld)) == 16
    back = surface.original(surface.vertices[:16])
    assert np.abs(back - both.vertices).max() < 1e-8


@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-5])
def test_bodies_that_touch_stay_two(gap):
    """Where neither has a boundary nothing is to be closed."""
    pair = solids.together(solids.box(), solids.box((1 + gap, 0, 0), (2, 1, 1)))
    for mesh in ((pair.vertices, pair.faces), pair.soup):
        surface = make_surface(*mesh)
        assert surface.closed_faces.all() and (surface.edge_face_count == 2).all()
        if gap > 0.0 and mesh[0] is pair.vertices:
            assert len(np.unique(surface.component)) == 2


def test_a_card_given_from_both_sides_is_one():
    card = shapes.plane(4)
    for back in (card.faces[:, ::-1], card.faces):
        surface = make_surface(card.vertices, np.vstack([card.faces, back]))
        assert len(surface.faces) == len(card.faces)
        assert (surface.edge_face_count == 1).sum() == 12


def test_a_body_given_twice_is_one():
    shape = shapes.sphere(2)
    for again in (shape.faces, shape.faces[:, ::-1], shape.faces[:, [2, 0, 1]]):
        surface = make_surface(
            np.vstack([shape.vertices, shape.vertices]),
            np.vstack([shape.faces, again + len(shape.vertices)]),
        )
        assert len(surface.faces) == len(shape.faces) and surface.closed_faces.all()


def test_a_wall_between_two_bodies_is_of_both():
    """Two, three, and two by two boxes side by side."""
    for many in ((2, 1), (3, 1), (2, 2)):
        row = [
            solids.box((i, j, 0), (i + 1, j + 1, 1)) for i in range(many[0]) for j in range(many[1])
        ]
        wall = solids.together(*row)
        surface = of(wall)
        assert len(surface.faces) == 12 * len(row) and surface.closed_faces.all()
        assert len(np.unique(surface.component)) == len(row)


def test_faces_that_are_none_go():
    """A vertex named twice, three times; a corner that is not a number, but named by no face."""
    cube = solids.box()
    vertices = np.vstack([cube.vertices, [[np.nan, 0, 0]]])
    faces = np.vstack([cube.faces, [[0, 0, 1], [3, 3, 3]]])
    surface = make_surface(vertices, faces)
    assert len(surface.faces) == 12 and surface.closed_faces.all()
    with pytest.raises(ValueError, match="area"):
        make_surface(cube.vertices, [[0, 0, 1], [3, 3, 3]])
    vertices[0] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        make_surface(vertices, faces)


def test_shortest_sides():
    rng = np.random.default_rng(4)
    points, faces = rng.random((40, 3)), rng.integers(0, 30, (50, 3))
    faces = faces[(np.diff(np.sort(faces, axis=1)) > 0).all(axis=1)]
    ends = Edges.of(faces, 40).ends
    length = np.linalg.norm(np.diff(points[ends], axis=1)[:, 0], axis=1)
    expected = [length[(ends == v).any(axis=1)].min(initial=np.inf) for v in range(40)]
    assert np.allclose(weld.shortest_sides(points, ends), expected)
