"""Edges of meshes: against slow roads, on soups where many faces share one."""

import numpy as np
import pytest
import shapes

from strokestyle.mesh.surface import make_surface
from strokestyle.mesh.triangles import (
    Edges,
    FaceShapes,
    all_corners,
    any_corner,
    column_cross,
    column_dot,
    columns,
    dots_at,
    pair_key,
    row_dot,
)


def soup(seed):
    """Faces over few vertices, so that edges have one to many faces; none twice, none without
    area."""
    rng = np.random.default_rng(seed)
    faces = np.array([rng.permutation(9)[:3] for _ in range(40)])
    return faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]


MESHES = [
    (shapes.torus(1, 0.4, 12, 8).faces, 96),
    (shapes.cylinder(around=8, rows=4).faces, 32),
    (soup(0), 9),
    (soup(1), 9),
]


@pytest.mark.parametrize("faces, count", MESHES)
def test_every_side_finds_its_edge_and_back(faces, count):
    edges = Edges.of(faces, count)
    sides = {}
    for f, face in enumerate(faces):
        for i in range(3):
            a, b = int(face[i]), int(face[(i + 1) % 3])
            sides.setdefault((min(a, b), max(a, b)), []).append(3 * f + i)
    assert edges.ends.tolist() == [list(ends) for ends in sorted(sides)] and len(edges) == len(
        sides
    )
    for e, ends in enumerate(sorted(sides)):
        found = sides[ends]
        assert edges.uses[e] == len(found)
        assert edges.sides[e].tolist() == (found + [-1])[:2]
        assert edges.faces[e].tolist() == [
            side // 3 if side >= 0 else -1 for side in edges.sides[e]
        ]
        assert all(edges.of_side.ravel()[side] == e for side in found)
        beyond = [edges.beyond.ravel()[side] for side in found]
        assert beyond == (found[::-1] if len(found) == 2 else [-1] * len(found))


@pytest.mark.parametrize("faces, count", MESHES)
def test_turned_faces_have_the_edges_of_turned_faces(faces, count):
    turn = np.random.default_rng(2).random(len(faces)) < 0.5
    ours = Edges.of(faces, count).turned(turn)
    theirs = Edges.of(np.where(turn[:, None], faces[:, ::-1], faces), count)
    for name in ("ends", "of_side", "uses", "sides"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name


@pytest.mark.parametrize("faces, count", MESHES)
def test_components_are_those_of_shared_edges(faces, count):
    far = np.vstack(
        [
            faces,
            faces + count,
            [[2 * count, 2 * count + 1, 2 * count + 2]],
            [[0, 2 * count + 3, 2 * count + 4]],
        ]
    )
    found = Edges.of(far, 2 * count + 5).component
    label = np.arange(len(far))
    pairs = [[set(a[[i, i - 1]].tolist()) for i in range(3)] for a in far]
    for _ in range(len(far)):  # to the least label of any neighbour, until nothing changes
        new = [
            min(label[g] for g in range(len(far)) if any(p in pairs[g] for p in pairs[f]))
            for f in range(len(far))
        ]
        if np.array_equal(new, label):
            break
        label = np.array(new)
    assert np.array_equal(found, np.unique(label, return_inverse=True)[1])


def test_corners():
    rng = np.random.default_rng(3)
    faces, flag = rng.integers(0, 50, (200, 3)), rng.random(50) < 0.5
    assert np.array_equal(any_corner(faces, flag), flag[faces].any(axis=1))
    assert np.array_equal(all_corners(faces, flag), flag[faces].all(axis=1))
    edges = Edges.of(MESHES[0][0], 96)
    flag = rng.random(len(edges)) < 0.2
    assert np.array_equal(edges.at_face(flag), flag[edges.of_side].any(axis=1))


def test_columns_are_multiplied_as_rows_are():
    """To the last digit: numpy sums the products of rows of three in an order of its own."""
    rng = np.random.default_rng(5)
    u, v = rng.normal(size=(2, 1000, 3))
    assert np.array_equal(column_dot(columns(u), columns(v)), row_dot(u, v))
    assert np.array_equal(column_cross(columns(u), columns(v)).T, np.cross(u, v))
    one, two = rng.integers(0, 1000, (2, 50))
    assert np.array_equal(dots_at(columns(u), one, two), row_dot(u[one], u[two]))


def test_shapes_of_faces():
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 3, 0], [8, 0, 0.0]])
    shape = FaceShapes.of(points, np.array([[0, 1, 2], [0, 1, 3]]))
    assert shape.cross.T.tolist() == [[0, 0, 12], [0, 0, 0]] and shape.size.tolist() == [12, 0]
    assert shape.square[:, 0].tolist() == [25, 9, 16]  # opposite the corners
    assert shape.longest.tolist() == [25, 64] and shape.has_area.tolist() == [True, False]


@pytest.mark.parametrize("name", ["cube", "moebius", "saddle"])
def test_edges_of_a_mesh_cut_open_are_those_of_its_sides(name):
    """Two roads: from the edges of the welded mesh, and by sorting all sides."""
    surface = make_surface(*getattr(shapes, name)())
    mesh = surface.connectivity
    assert name == "saddle" or len(mesh.cut_edges)
    ends, rim = mesh.own_ends
    own = Edges.of(mesh.faces, len(mesh.vertices))
    assert sorted(map(tuple, np.sort(ends, axis=1))) == sorted(map(tuple, own.ends))
    assert ends.dtype == np.int32
    assert np.array_equal(rim, own.rim)


def test_keys_of_edges_do_not_overflow():
    """Edges name vertices in 32 bits; so many vertices are too many for those of a pair."""
    count, pair = 70_000, np.array([[69_998, 69_999], [0, 69_999]], np.int32)
    assert pair_key(count, *pair.T).tolist() == [69_998 * count + 69_999, 69_999]
