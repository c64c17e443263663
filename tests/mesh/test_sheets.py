"""Edges of more than two faces: which of them go on as each other."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.mesh.surface import make_surface


def of(solid, soup=False):
    return make_surface(*solid.soup) if soup else make_surface(solid.vertices, solid.faces)


def bodies(surface):
    return len(np.unique(surface.component))


@pytest.mark.parametrize("soup", [False, True])
def test_boxes_that_share_an_edge_are_two(soup):
    """As on a chessboard; also where all vertices are shared in the file."""
    both = solids.together(solids.box(), solids.box((1, 1, 0), (2, 2, 1)))
    surface = of(both, soup)
    assert bodies(surface) == 2 and surface.closed_faces.all()
    unique, index = np.unique(both.vertices, axis=0, return_inverse=True)
    surface = make_surface(unique, index.ravel()[both.faces])
    assert bodies(surface) == 2 and surface.closed_faces.all()
    outward = np.einsum(
        "fi,fi->f",
        surface.face_normals,
        surface.original(surface.vertices[surface.faces].mean(axis=1))
        - np.where(surface.component == surface.component[0], 0.5, 1.5)[:, None] * [1, 1, 0]
        - [0, 0, 0.5],
    )
    assert (outward > 0.4).all()


def test_winding_does_not_matter_where_each_hangs_together():
    both = solids.together(solids.box(), solids.box((1, 1, 0), (2, 2, 1)))
    faces = both.faces
    faces[12:] = faces[12:, ::-1]
    unique, index = np.unique(both.vertices, axis=0, return_inverse=True)
    surface = make_surface(unique, index.ravel()[faces])
    assert bodies(surface) == 2 and surface.closed_faces.all()


@pytest.mark.parametrize("soup", [False, True])
@pytest.mark.parametrize("many", [(2, 1), (4, 1), (2, 2)])
def test_no_edge_of_abutting_boxes_has_more_than_two_faces(soup, many):
    surface = of(solids.boxes(*many), soup)
    assert (surface.edge_face_count == 2).all() and surface.closed_faces.all()


def test_a_wall_welded_in_once():
    """Two boxes that share a wall of two faces: one closed box, and the wall by itself."""
    both = solids.together(solids.box(), solids.box((1, 0, 0), (2, 1, 1)))
    unique, index = np.unique(both.vertices, axis=0, return_inverse=True)
    faces = index.ravel()[both.faces]
    once = faces[np.sort(np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1])]
    assert len(once) == 22
    surface = make_surface(unique, once)
    assert surface.edge_face_count.max() == 2 and bodies(surface) == 2
    assert surface.closed_faces.sum() == 20


def test_planes_go_on_through_each_other():
    """Two squares that cross in an edge which both have."""
    v = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 1], [-1, 0, 0], [-1, 0, 1]], float)
    w = v[:, [1, 0, 2]]
    quads = [(0, 2, 3, 1), (4, 0, 1, 5)]
    surface = of(solids.together(solids.Solid(v, quads), solids.Solid(w, quads)))
    assert bodies(surface) == 2
    for body in np.unique(surface.component):
        flat = surface.face_normals[surface.component == body]
        assert np.allclose(np.abs(flat @ flat[0]), 1.0)


@pytest.mark.parametrize("pages", [3, 5, 40, 100])
def test_a_book(pages):
    """Many pages at one spine: each is in a sheet of its own, or goes on as one other."""
    at = np.linspace(0, 2 * np.pi, pages, endpoint=False)
    out = np.column_stack([np.cos(at), np.sin(at), 0 * at])
    points = np.vstack([[[0, 0, 0], [0, 0, 1]], out, out + [0, 0, 1]])
    k = np.arange(pages)
    faces = np.vstack(
        [
            np.column_stack([0 * k, k + 2, k + 2 + pages]),
            np.column_stack([0 * k, k + 2 + pages, 0 * k + 1]),
        ]
    )
    surface = make_surface(points, faces)
    assert surface.edge_face_count.max() <= 2 and len(surface.faces) == 2 * pages


@pytest.mark.parametrize("soup", [False, True])
def test_a_sphere_twice_cut_along_other_diagonals(soup):
    n, m = 12, 24
    polar, around = np.pi * np.arange(1, n) / n, 2 * np.pi * np.arange(m) / m
    ring = np.stack(
        [np.sin(polar)[:, None] * np.cos(around), np.cos(polar)[:, None] + 0 * around,
         np.sin(polar)[:, None] * np.sin(around)], axis=2)  # fmt: skip
    vertices = np.vstack([ring.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n - 2), np.arange(m), indexing="ij"))
    quad = np.column_stack(
        [i * m + j, i * m + (j + 1) % m, (i + 1) * m + (j + 1) % m, (i + 1) * m + j]
    )
    k, top = np.arange(m), (n - 2) * m
    caps = [np.column_stack([k, 0 * k + (n - 1) * m, (k + 1) % m])]
    caps.append(np.column_stack([top + k, top + (k + 1) % m, 0 * k + (n - 1) * m + 1]))
    one = np.vstack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]], *caps])
    two = np.vstack([quad[:, [0, 1, 3]], quad[:, [1, 2, 3]], *caps])
    points, faces = np.vstack([vertices, vertices]), np.vstack([one, two + len(vertices)])
    if soup:
        points, faces = points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    surface = make_surface(points, faces)
    assert surface.closed_faces.all() and (surface.edge_face_count == 2).all()
    assert np.einsum("ij,ij->i", surface.normals, surface.vertices).min() > 0.45  # all outward


def test_cones_tip_to_tip():
    """One vertex of two bodies: two bodies, and a tip of each."""
    k = np.arange(12)
    ring = np.column_stack([np.cos(k * np.pi / 6), 0 * k + 1.0, np.sin(k * np.pi / 6)])
    points = np.vstack([[[0, 0, 0]], ring, ring * [1, -1, 1]])
    after = (k + 1) % 12
    side = np.column_stack([0 * k, k + 1, after + 1])
    lid = np.column_stack([0 * k[1:-1] + 1, after[1:-1] + 1, k[1:-1] + 1])
    cone = np.vstack([side, lid])
    other = np.where(cone > 0, cone + 12, 0)[:, ::-1]
    surface = make_surface(points, np.vstack([cone, other]))
    assert bodies(surface) == 2 and surface.closed_faces.all()
    middle = surface.vertices[surface.faces].mean(axis=1)
    inside = np.sign(middle[:, 1:2]) * [0, 0.3, 0]
    assert np.einsum("fi,fi->f", surface.face_normals, middle - inside).min() > 0.0


def test_a_klein_bottle_and_a_moebius_strip():
    a, b = np.meshgrid(np.arange(24), np.arange(12), indexing="ij")
    u, v = a.ravel() * np.pi / 12, b.ravel() * np.pi / 6
    r = 2 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    points = np.column_stack(
        [r * np.cos(u), r * np.sin(u), np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)]
    )
    i, j = a.ravel(), b.ravel()
    over = i == 23
    jn = (j + 1) % 12

    def at(i, j):
        return np.where(i == 24, (-j) % 12, i * 12 + j)

    quads = np.column_stack([at(i, j), at(i + 1, j), at(i + 1, jn), at(i, jn)])
    assert over.any()
    surface = make_surface(points, np.vstack([quads[:, :3], quads[:, [0, 2, 3]]]))
    assert np.isfinite(surface.normals).all() and (surface.edge_face_count == 2).all()
    assert len(make_surface(*shapes.moebius()).faces) == len(shapes.moebius().faces)
