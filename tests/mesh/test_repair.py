"""What is told quickly of most meshes, against the slow roads."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.mesh import repair, weld
from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.soup import Soup
from strokestyle.mesh.surface import make_surface
from strokestyle.mesh.triangles import Edges

BALL = shapes.sphere(3)


def _soup(faces, count=None):
    count = int(faces.max()) + 1 if count is None else count
    points = np.random.default_rng(0).random((count, 3))
    return Soup(points, faces, np.arange(len(faces)))


@pytest.mark.parametrize("away", [1.0, 30.0, 1e5])
def test_what_is_told_quickly_to_lie_far_off_is_what_is_measured(away, monkeypatch):
    """One small face, nearer and farther, beside a ball."""
    vertices = np.vstack([BALL.vertices, 0.3 * BALL.vertices[BALL.faces[0]] + away])
    faces = np.vstack([BALL.faces, np.arange(3) + len(BALL.vertices)])
    box = vertices.min(axis=0), vertices.max(axis=0)
    assert repair._fills_its_box(vertices, faces, *box) == (away == 1.0)
    if away > 1.0:
        with pytest.warns(MeshWarning, match="1 of its"):
            quick = repair.left_out(vertices, faces)
    else:
        quick = repair.left_out(vertices, faces)
        monkeypatch.setattr(repair, "_fills_its_box", lambda *_: False)
        assert repair.left_out(vertices, faces) is None
    assert (quick is not None) == (away == 1e5)


def test_a_mesh_that_fills_its_box_has_nothing_far_off():
    rng = np.random.default_rng(1)
    told = 0
    for _ in range(200):
        points = rng.normal(size=(60, 3)) * np.exp(rng.normal(size=(60, 1)) * rng.random() * 4)
        faces = rng.integers(0, 60, (400, 3))
        used = points[np.unique(faces)]
        box = used.min(axis=0), used.max(axis=0)
        corner = points[faces]
        area = np.linalg.norm(
            np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
        )
        size = (box[1] - box[0]).max()
        for share, limit in ((repair.LONE, repair.LOST), (repair.STRAY, repair.SMALL)):
            far, rest = repair._far_from_most(corner, area, share)
            if far.any() and rest < limit * size:
                assert not repair._fills_its_box(points, faces, *box)
        told += repair._fills_its_box(points, faces, *box)
    assert told > 20


def test_vertices_of_several_fans_are_found():
    """Two balls and a third that have one vertex in common; a fan too large to be gone round."""
    count = len(BALL.vertices)
    second = np.where(BALL.faces == 0, 0, BALL.faces + count)
    third = np.where(BALL.faces == 5, 0, BALL.faces + 2 * count)
    ring = 3 * count + np.arange(100)
    hub, pole = 3 * count + 100, 3 * count + 101
    after = np.roll(ring, -1)
    disc = np.stack([np.full(100, hub), ring, after], axis=1)
    under = np.stack([np.full(100, pole), after, ring], axis=1)
    faces = np.concatenate([BALL.faces, second, third, disc, under])
    edges = Edges.of(faces, pole + 1)
    known = np.zeros(pole + 1, bool)
    assert np.flatnonzero(repair._pinched(faces, edges, known)).tolist() == [0, hub, pole]
    known[[0, hub]] = True
    assert np.flatnonzero(repair._pinched(faces, edges, known)).tolist() == [pole]


def test_bodies_that_touch_in_a_vertex_are_split_there():
    """Once anything is sharp at all; smooth ones stay joined, as nothing tells them apart."""
    boxes = solids.together(solids.box(), solids.box((1, 1, 1), (2, 2, 2)))
    surface = make_surface(boxes.vertices, boxes.faces, polygon=boxes.polygon)
    assert len(surface.vertices) == 2 * 8 * 3 and len(np.unique(surface.weld)) == 15


@pytest.mark.parametrize("seed", range(6))
def test_faces_given_twice_are_found_by_what_lies_beyond_their_sides(seed):
    rng = np.random.default_rng(seed)
    faces = np.array([rng.permutation(8)[:3] for _ in range(30)])
    if seed % 2:
        faces = np.concatenate([BALL.faces + 8, faces, BALL.faces[:20, ::-1] + 8])
    few = weld._maybe_repeated(Edges.of(faces, int(faces.max()) + 1))
    key, first, many = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    again = np.flatnonzero(many[first.ravel()] > 1)
    assert len(again) and np.isin(again, few).all() and len(few) < len(faces)
    left = weld.drop_repeated_faces(_soup(faces))
    assert len(np.unique(np.sort(left.faces, axis=1), axis=0)) == len(key)


def test_a_soup_that_is_fine_is_passed_on():
    soup = _soup(BALL.faces)
    assert weld.drop_repeated_faces(soup) is soup and soup.compact() is soup
    more = Soup(np.vstack([soup.points, soup.points]), soup.faces + len(soup.points), soup.kept)
    fewer = more.compact()
    assert np.array_equal(fewer.faces, soup.faces) and np.array_equal(fewer.points, soup.points)
    assert np.array_equal(fewer.edges.ends, soup.edges.ends)
