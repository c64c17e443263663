"""Which sharp edges are creases: lines on solids and seams, not the noise of scans."""

import numpy as np
import pytest
import shapes

from strokestyle.extract.segments import crease_edges
from strokestyle.mesh import creases as module
from strokestyle.mesh.surface import make_surface
from strokestyle.mesh.triangles import bends


def drawn(surface, angle=40.0):
    """Length of the edges that are creases, and of those that are merely sharp."""
    length = np.linalg.norm(np.diff(surface.vertices[surface.edges], axis=1)[:, 0], axis=1)
    bend = bends(
        surface.face_normals, surface.edge_faces, surface.edge_face_count, surface.clashing_edges
    )
    return length[crease_edges(surface, angle)].sum(), length[bend > np.radians(angle)].sum()


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


def test_a_crease_is_followed_where_it_weakens():
    """A ridge whose flanks open from 60 to 20 degrees: from 40 on it is a crease, and down to 28
    where that is half."""
    n = 20
    drop = 0.5 * np.tan(np.radians(np.linspace(30, 10, n + 1)))
    x = np.linspace(0, 2, n + 1)
    rows = [np.column_stack([x, 0 * x, 0 * x])] + [
        np.column_stack([x, -drop, 0 * x + z]) for z in (0.5, -0.5)
    ]
    other = shapes.grid(2, n + 1)[:, ::-1]
    faces = np.concatenate([shapes.grid(2, n + 1), np.where(other > n, other + n + 1, other)])
    surface = make_surface(np.vstack(rows), faces)
    assert drawn(surface)[1] * surface.scale == pytest.approx(1.0, abs=0.15)
    assert drawn(surface)[0] * surface.scale == pytest.approx(1.6, abs=0.15)
    assert drawn(surface, 55.0)[0] * surface.scale == pytest.approx(
        0.25, abs=0.15
    )  # weak for longer than strong


@pytest.mark.parametrize("n", [2, 3, 5, 9])
def test_all_edges_of_a_cube_are_creases(n):
    all_, sharp = drawn(make_surface(*shapes.cube(n)))
    assert all_ == sharp == pytest.approx(12.0)


@pytest.mark.parametrize("size", [0.2, 0.02, 0.008])
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
    expected = 12.0 * size / surface.scale
    assert length[small].sum() == pytest.approx(expected if size > 0.01 else 0.0)


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
    """A flap on a square: its outer edge bends by nearly 180 degrees."""
    square = shapes.plane(2)
    flap = [
        [0, 0, 0],
        [width, 0, 0],
        [width, 0.02, 0.001],
        [0, 0.02, 0.001],
        [0, 0, 0.002],
        [width, 0, 0.002],
    ]
    faces = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]])
    surface = make_surface(np.vstack([square.vertices, flap]), np.vstack([square.faces, faces + 4]))
    assert (drawn(surface)[0] > 0) == found and drawn(surface)[1] > 0


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
