"""Views: feature maps in closed form, what curves read off them, hidden lines removed, files."""

import copy
import gc
import io
import json
import pickle
import weakref
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree
from shapes import cube, torus, wheel

from strokestyle.extract import visible
from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.feature_maps import (
    CLIP,
    NEURAL_STROKES_MAPS,
    NORMAL_MAPS,
    FeatureMaps,
    feature_maps,
    plain_raster,
)
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import SurfaceLines, feature_curves
from strokestyle.extract.pipeline import extract_view, faces_of, view_of_curves, view_of_lines
from strokestyle.extract.rays import Bvh
from strokestyle.extract.seen_surface import percentile
from strokestyle.extract.view import View, _nearest_covered
from strokestyle.extract.view_file import load_view, save_view, view_to_json
from strokestyle.extract.visible import Fragments, look_along
from strokestyle.geometry.curves import KINDS, Curves, arc_length, clip, is_kind
from strokestyle.geometry.kinds import SOFT_KINDS
from strokestyle.geometry.parts import Parts, part_name
from strokestyle.mesh.surface import make_surface
from strokestyle.svg.write import plain_svg, png_from_svg

RADIUS = 0.5
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
     [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def ball(level=5):
    """An octahedron, each triangle cut in four `level` times, on the sphere: vertices, faces."""
    vertices = np.array(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], float
    )
    faces = np.array(
        [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    )
    for _ in range(level):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        pairs, index = np.unique(sides, axis=0, return_inverse=True)
        middle = vertices[pairs].mean(axis=1)
        m = index.reshape(-1, 3) + len(vertices)
        a, b, c = faces.T
        ab, bc, ca = m.T
        faces = np.concatenate(
            [np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
        )
        vertices = np.concatenate(
            [vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)]
        )
    return vertices * RADIUS, faces


@pytest.fixture(scope="module")
def sphere():
    return make_surface(*ball())


@pytest.fixture(scope="module")
def view(sphere):
    return extract_view(sphere, fit_camera(sphere.vertices, width=200, height=160))


def two_balls():
    """A small ball before the left half of a large one, seen from +z."""
    vertices, faces = ball(4)
    small = vertices * 0.4 + [-0.15, 0.0, 0.9]
    surface = make_surface(
        np.concatenate([vertices, small]), np.concatenate([faces, faces + len(vertices)])
    )
    return surface, fit_camera(surface.vertices, "front", width=256, height=256)


# -------------------------------------------------------------------------------------- maps


def test_maps_of_a_sphere(sphere):
    camera = fit_camera(sphere.vertices, "25,35", width=240, height=180)
    maps = feature_maps(sphere, camera, Curves.empty(), Bvh(sphere))
    assert maps.names == (*NEURAL_STROKES_MAPS, *NORMAL_MAPS, "plain")
    assert maps.values.shape == (11, 180, 240) and maps.values.dtype == np.float32
    ray = camera.rays(camera.pixel_centres())
    to_centre = (
        sphere.original(np.zeros((1, 3)))[0] * 0 - camera.eye
    )  # the sphere is centred at the origin
    b = ray @ to_centre
    inside = b * b - to_centre @ to_centre + RADIUS**2
    distance = b - np.sqrt(np.maximum(inside, 0))
    place = camera.eye + distance[:, None] * ray
    normal = place / RADIUS
    facing = np.abs(np.einsum("ij,ij->i", normal, ray)).reshape(180, 240)
    normal = normal.reshape(180, 240, 3)
    inside = inside.reshape(180, 240)
    assert np.array_equal(
        maps.covered[np.abs(inside) > 0.005], (inside > 0)[np.abs(inside) > 0.005]
    )
    clear = inside > 0.02
    right, down, forward = camera.axes
    raw = {name: (maps[name] * maps.scale[i]) for i, name in enumerate(maps.names)}
    depth = ((place - camera.eye) @ forward).reshape(180, 240)
    for name, expected, error in (
        ("depth", depth, 0.003),
        ("n_dot_v", facing, 0.005),
        ("normal_x", normal @ right, 0.005),
        ("normal_y", normal @ down, 0.005),
        ("max_curvature", 1 / RADIUS, 0.02),
        ("min_curvature", 1 / RADIUS, 0.02),
        ("radial_curvature_positive", 1 / RADIUS, 0.02),
        ("radial_curvature_negative", 0.0, 0.001),
        ("radial_curvature_derivative", 0.0, 0.6),
        ("view_curvature", (RADIUS * facing.clip(0.3)) ** -2, np.where(facing > 0.5, 1.5, np.inf)),
    ):
        assert (np.abs(raw[name] - expected) < error)[clear].all(), name
    background = ~maps.covered
    assert background.mean() > 0.3
    for name in maps.names:
        assert (maps[name][background] == (1.0 if name in NEURAL_STROKES_MAPS else 0.0)).all()


def test_maps_are_scaled_by_their_90th_percentile_and_cut(view):
    maps = view.maps
    for name in ("depth", "max_curvature", "view_curvature", "n_dot_v"):
        assert abs(np.percentile(np.abs(maps[name][maps.covered]), 90) - 1) < 2e-3
    assert np.abs(maps.values).max() <= CLIP
    assert np.array_equal(maps.values, maps.values.astype(np.float16))


def test_maps_of_a_plane_and_a_cube_are_finite():
    plane = make_surface(
        np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    for surface in (plane, make_surface(CUBE, CUBE_FACES)):
        camera = fit_camera(surface.vertices, width=64, height=48)
        maps = feature_maps(surface, camera, Curves.empty(), Bvh(surface))
        assert np.isfinite(maps.values).all() and maps.covered.any()
    assert (
        np.abs(feature_maps(plane, camera, Curves.empty(), Bvh(plane))["max_curvature"]).max() <= 1
    )


def test_a_surface_seen_from_behind_faces_the_eye():
    plane = make_surface(
        np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    for view in ("10,10", "170,10"):
        camera = fit_camera(plane.vertices, view, width=64, height=64)
        maps = feature_maps(plane, camera, Curves.empty(), Bvh(plane))
        assert (maps["n_dot_v"][maps.covered] > 0).all()


def test_an_eye_among_the_parts_sees_what_is_before_it():
    vertices, faces = ball(3)
    shapes = [vertices * 0.3 + [0, 0, z] for z in (-1.0, 1.0)]
    surface = make_surface(np.concatenate(shapes), np.concatenate([faces, faces + len(vertices)]))
    camera = Camera([0, 0, 0], [0, 0, -1], [0, 1, 0], 40, 64, 64)
    maps = feature_maps(surface, camera, Curves.empty(), Bvh(surface))
    assert maps.covered[32, 32] and not maps.covered[0, 0]
    curves = extract_view(surface, camera, LineOptions(kinds=("contour",))).curves
    assert len(curves) == 1


# ----------------------------------------------------------------------------- at the curves


def test_contours_read_the_part_in_front():
    surface, camera = two_balls()
    view = extract_view(surface, camera, LineOptions(kinds=("contour",)))
    assert len(view.curves) >= 2
    depth = view.at_curves(("depth",))[:, 0] * view.maps.scale[0]
    shift = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
    assert np.abs(shift).max() < 1e-9
    scale = surface.scale
    small, large = (np.array(c) / scale for c in ([-0.15, 0, 0.9], [0, 0, 0]))
    offset = -surface.centre / scale
    centre, _ = camera.project(np.array([small + offset, large + offset]))
    near, far = (camera.eye[2] - (c + offset)[2] for c in (small, large))
    on_small = (
        np.abs(
            np.linalg.norm(view.curves.xy - centre[0], axis=1) - 0.2 / scale * camera.focal / near
        )
        < 3
    )
    on_large = (
        np.abs(
            np.linalg.norm(view.curves.xy - centre[1], axis=1) - 0.5 / scale * camera.focal / far
        )
        < 5
    )
    assert on_small.sum() > 20 and on_large.sum() > 40
    assert np.abs(depth[on_small & ~on_large] - near).max() < 0.15  # where they meet, either
    assert np.abs(depth[on_large & ~on_small] - far).max() < 0.25
    # read off its own pixel, much of the contour would be background, or the ball behind
    column, row = np.floor(view.curves.xy.T).astype(int)
    naive = view.maps["depth"][row, column] * view.maps.scale[0]
    assert (np.abs(naive - depth) > 0.1).mean() > 0.1


def test_at_curves_far_from_the_shape_and_without_one(view):
    names = ("depth", "normal_x", "n_dot_v")
    values = view.at_curves(names, np.array([[0.0, 0.0], [199.9, 159.9], [1e9, -1e9]]))
    assert values.shape == (3, 3) and values.dtype == np.float32 and np.isfinite(values).all()
    assert (values[:, 2] < 0.6).all()  # the rim, the nearest thing there is
    nothing = replace(view.maps, covered=np.zeros_like(view.maps.covered))
    values = View(view.camera, view.curves, nothing).at_curves(names)
    assert (values == [1, 0, 1]).all()
    assert view.at_curves(names, np.zeros((0, 2))).shape == (0, 3)


@pytest.mark.parametrize("share", [0.0003, 0.03, 0.5])
def test_the_nearest_covered_pixel_is_that_of_a_distance_transform(share):
    covered = np.random.default_rng(5).random((60, 70)) < share
    covered[50, 20] = True
    row, column = np.nonzero(~covered)
    found = _nearest_covered(covered, row, column)
    _, every = distance_transform_edt(~covered, return_indices=True)
    np.testing.assert_array_equal(found, every[:, row, column])


def test_at_curves_rounds_to_the_pixel_under_the_point(view):
    x, y = 101, 77
    values = view.at_curves(("normal_x",), np.array([[x + 0.01, y + 0.99]]))
    assert values[0, 0] == view.maps["normal_x"][y, x]


# ------------------------------------------------------------------------------------- lines


def test_a_sphere_is_one_closed_stroke(view):
    assert (
        len(view.curves) == 1 and view.curves.closed[0] and KINDS[view.curves.kind[0]] == "contour"
    )
    step = np.diff(arc_length(view.curves.xy, view.curves.offsets))
    assert np.abs(step - 3.0).max() < 0.3
    radius = np.linalg.norm(view.curves.xy - [100, 80], axis=1)
    assert np.ptp(radius) < 1.0


def test_a_cube_shows_nine_edges():
    surface = make_surface(CUBE, CUBE_FACES)
    camera = fit_camera(surface.vertices, width=300, height=300)
    lines = feature_curves(surface, camera, LineOptions(kinds=("crease",)))
    seen = look_along(surface, camera, lines, Bvh(surface)).fragments()
    fragments, strength = seen.curves, seen.strength
    assert strength.shape == (len(fragments.xy),) and (strength == 1).all()
    corners, _ = camera.project(surface.vertices)
    edges = np.argwhere(np.triu(np.linalg.norm(CUBE[:, None] - CUBE, axis=2) < 1.01, 1))
    nearest = (
        ((CUBE - camera.eye) ** 2).sum(axis=1).argmax()
    )  # the corner behind, whose three edges are hidden
    expected = sum(
        np.linalg.norm(corners[i] - corners[j]) for i, j in edges if nearest not in (i, j)
    )
    assert abs(fragments.lengths().sum() - expected) < 0.01 * expected


def bent_beam(n=8):
    """The surface of an L-shaped beam of n^3 boxes a unit, bent: 18 creases, one concave,
    beside curved sides.
    """
    full = np.zeros((2 * n + 2, 2 * n + 2, 3 * n + 2), bool)
    full[1:-1, 1:-1, 1:-1] = True
    full[n + 1 :, n + 1 :] = False
    quads = []
    for axis in range(3):
        a, b, c = np.roll(np.eye(3, dtype=int), -axis, axis=0)
        for side in (0, 1):
            base = np.argwhere(full & ~np.roll(full, 1 - 2 * side, axis)) + side * a
            quad = np.stack([base, base + b, base + b + c, base + c], axis=1)
            quads.append(quad if side else quad[:, ::-1])
    points, index = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    index, p = index.reshape(-1, 4), points / n
    angle, radius = 0.25 * p[:, 2], 3 + p[:, 0]
    vertices = np.stack([radius * np.cos(angle), p[:, 1], radius * np.sin(angle)], axis=1)
    return make_surface(vertices, np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]]))


def test_creases_are_not_drawn_twice():
    """Vertex normals mix the two sides of a crease, and suggestive contours and valleys would
    run beside it.
    """
    surface = bent_beam()
    lines = feature_curves(surface, fit_camera(surface.vertices), LineOptions(kinds=("crease",)))
    assert len(lines) == 18
    for view in ("three-quarter", "50,30", "100,20"):
        curves = extract_view(surface, fit_camera(surface.vertices, view)).curves
        assert {KINDS[k] for k in curves.kind} == {"contour", "crease"}


def test_lines_end_at_the_edge_of_the_canvas():
    surface = make_surface(CUBE, CUBE_FACES)
    whole = fit_camera(surface.vertices, "20,20", width=200, height=200)
    for zoom in (8.0, 25.0):
        camera = replace(whole, fov_y=whole.fov_y / zoom, target=surface.vertices[7])
        lines = feature_curves(surface, camera, LineOptions(kinds=("crease",)))
        fragments = look_along(surface, camera, lines, Bvh(surface)).fragments().curves
        assert fragments.xy.min() >= 0 and fragments.xy.max() <= 200
        ends = np.concatenate(
            [fragments.xy[fragments.offsets[:-1]], fragments.xy[fragments.offsets[1:] - 1]]
        )
        on_edge = (np.minimum(ends, 200 - ends) < 1e-3).any(axis=1)
        corner = np.linalg.norm(ends - 100, axis=1) < 1e-6
        assert len(fragments) == 3 and corner.sum() == 3 and on_edge.sum() == 3
        view = extract_view(surface, camera)
        assert view.curves.xy.min() >= 0 and view.curves.xy.max() <= 200


def test_an_eye_close_by_asks_for_no_more_points():
    surface = make_surface(CUBE, CUBE_FACES)
    eye = np.array([0.0, 0.0, 0.50001])
    camera = Camera(
        eye, eye + [0.3, 0.2, -1e-6], [0, 1, 0], 90, 200, 200
    )  # along the face, a hair above it
    lines = feature_curves(surface, camera, LineOptions(kinds=("crease",)))
    fragments = look_along(surface, camera, lines, Bvh(surface)).fragments().curves
    assert len(fragments.xy) < 5000 and np.isfinite(fragments.xy).all()


def test_no_lines_at_all():
    surface = make_surface(CUBE, CUBE_FACES)
    away = Camera([0, 0, 5], [0, 0, 9], [0, 1, 0], 30, 64, 64)
    view = extract_view(surface, away)
    assert len(view.curves) == 0 and not view.maps.covered.any()
    assert view.at_curves(("depth",)).shape == (0, 1)
    assert view_to_json(view)["curves"] == []


def test_hidden_parts_of_a_line_are_cut_away():
    surface, camera = two_balls()
    curves = extract_view(surface, camera, LineOptions(kinds=("contour",))).curves
    scale, offset = surface.scale, -surface.centre / surface.scale
    small = np.array([-0.15, 0, 0.9]) / scale + offset
    centre, depth = camera.project(small[None])
    radius = 0.2 / scale * camera.focal / depth[0]
    inside = np.linalg.norm(curves.xy - centre, axis=1) < radius - 2
    assert not inside.any()


def test_a_cube_hides_three_edges():
    surface = make_surface(CUBE, CUBE_FACES)
    camera = fit_camera(surface.vertices, "25,20", width=300, height=300)
    view = extract_view(surface, camera, hidden=True)
    assert {KINDS[kind] for kind in view.hidden.kind} == {"crease"}
    corners, _ = camera.project(surface.vertices)
    behind = ((CUBE - camera.eye) ** 2).sum(axis=1).argmax()
    ends = [i for i in range(8) if np.isclose(np.linalg.norm(CUBE[i] - CUBE[behind]), 1.0)]
    expected = np.linalg.norm(corners[ends] - corners[behind], axis=1).sum()
    assert (
        0.95 * expected < view.hidden.lengths().sum() < expected + 1.0
    )  # less what runs along the outline at the ends
    assert min(np.linalg.norm(view.hidden.xy - corners[behind], axis=1)) < 1.0
    assert len(extract_view(surface, camera).hidden) == 0


def test_hidden_parts_complete_the_visible_ones():
    """The large ball's outline goes on behind the small one; soft lines are not asked behind."""
    surface, camera = two_balls()
    camera = replace(camera, eye=camera.eye + np.array([-1.0, 0.0, 0.0]))
    options = LineOptions(kinds=("contour", "suggestive"))
    view = extract_view(surface, camera, options, hidden=True)
    assert {KINDS[kind] for kind in view.hidden.kind} == {"contour"}
    lines = feature_curves(surface, camera, options)
    fragments = look_along(surface, camera, lines, Bvh(surface)).fragments().curves
    whole = feature_curves(surface, camera, LineOptions(kinds=("contour",)))
    xy, _ = camera.project(whole.points(surface))
    total = arc_length(xy, whole.offsets)[whole.offsets[1:] - 1].sum()
    behind = view.hidden.lengths().sum()
    assert behind > 30.0 and abs(fragments.lengths().sum() + behind - total) < 10.0
    assert (
        len(
            extract_view(
                surface, camera, LineOptions(kinds=("ridge", "valley")), hidden=True
            ).hidden
        )
        == 0
    )


# --------------------------------------------------------------------- curves from elsewhere


def test_curves_from_elsewhere_are_clipped_and_spaced(sphere, view):
    given = Curves.from_list([[[-50, 80], [250, 80]], [[20, 20], [20, 25], [20.5, 25]]], [5, 0])
    got = view_of_curves(sphere, view.camera, given)
    assert np.array_equal(got.curves.kind, [5, 0])
    assert np.allclose(got.curves[0][[0, -1]], [[0, 80], [200, 80]])
    assert np.abs(np.diff(got.curves[0][:, 0]) - 3).max() < 0.1
    assert np.array_equal(got.maps.values[:-1], view.maps.values[:-1])
    assert got.maps["plain"][80, 100] > 0.4


@pytest.mark.parametrize(
    "line, expected",
    [
        ([[10, 10], [20, 20]], [[[10, 10], [20, 20]]]),
        ([[-10, 10], [20, 10]], [[[0, 10], [20, 10]]]),
        ([[50, -20], [50, 120]], [[[50, 0], [50, 100]]]),
        (
            [[-9, 5], [50, 5], [120, 5], [120, 6], [50, 6]],
            [[[0, 5], [50, 5], [100, 5]], [[100, 6], [50, 6]]],
        ),
        ([[-10, -10], [-5, 110]], []),
        ([[200, 50], [300, 50]], []),
        ([[-10, 5], [5, -10]], []),
        ([[-30, 10], [10, -30], [50, 50]], [[[25, 0], [50, 50]]]),
        ([[0, 0], [100, 0]], [[[0, 0], [100, 0]]]),
        ([[5, 5], [5, 5]], []),
    ],
)
def test_clip(line, expected):
    got = clip(Curves.from_list([line]), 100, 100)
    assert len(got) == len(expected)
    for i, points in enumerate(expected):
        assert np.allclose(got[i], points)


def test_a_closed_curve_stays_closed_only_while_whole():
    square = np.array([[10, 10], [50, 10], [50, 50], [10, 50], [10, 10]], float)
    assert clip(Curves.from_list([square]), 100, 100).closed.all()
    assert not clip(Curves.from_list([square + [60, 0]]), 100, 100).closed.any()
    assert len(clip(Curves.empty(), 100, 100)) == 0


def test_plain_raster():
    row = plain_raster(Curves.from_list([[[10, 20.5], [40, 20.5]]]), 64, 48)
    assert row.shape == (48, 64) and (row[20, 10:40] == 1).all()
    assert not row[19].any() and not row[21].any()
    between = plain_raster(Curves.from_list([[[10, 20], [40, 20]]]), 64, 48)
    assert np.allclose(between[19:21, 11:39], 0.5)
    rng = np.random.default_rng(0)
    curves = Curves.from_list([rng.uniform(3, 92, (4, 2)) for _ in range(8)])
    ours = plain_raster(curves, 96, 100)
    theirs = (
        1
        - np.asarray(
            Image.open(io.BytesIO(png_from_svg(plain_svg(curves, (96, 100))))).convert("L")
        )
        / 255.0
    )
    assert np.abs(ours - theirs).mean() < 0.04 and np.abs(ours - theirs).max() < 0.5
    assert not plain_raster(Curves.empty(), 16, 16).any()
    assert not plain_raster(Curves.from_list([[[1e6, 1e6], [1e6 + 9, 1e6]]]), 16, 16).any()
    assert plain_raster(Curves.from_list([[[8.5, 8.5], [8.5, 8.5]]]), 16, 16)[8, 8] == 1


# ------------------------------------------------------------------------------------- files


def same(a, b):
    return (
        a.camera.to_dict() == b.camera.to_dict()
        and all(
            np.array_equal(getattr(a.curves, n), getattr(b.curves, n))
            for n in ("xy", "offsets", "kind", "closed")
        )
        and a.maps.names == b.maps.names
        and np.array_equal(a.strength, b.strength)
        and np.array_equal(a.optional, b.optional)
        and all(
            np.array_equal(getattr(a.maps, n), getattr(b.maps, n))
            for n in ("values", "covered", "scale")
        )
    )


def test_a_view_comes_back_exactly(view, tmp_path):
    save_view(tmp_path / "v.npz", view)
    assert same(load_view(tmp_path / "v.npz"), view)
    first = (tmp_path / "v.npz").read_bytes()
    save_view(tmp_path / "v.npz", view)
    assert (tmp_path / "v.npz").read_bytes() == first
    assert [p.name for p in tmp_path.iterdir()] == ["v.npz"]
    told = replace(view, optional=np.arange(len(view.curves)) % 2 == 1)
    save_view(tmp_path / "o.npz", told)
    assert same(load_view(tmp_path / "o.npz"), told)
    (tmp_path / "o.npz").unlink()
    empty = View(view.camera, Curves.empty(), view.maps)
    save_view(tmp_path / "e.npz", empty)
    assert same(load_view(tmp_path / "e.npz"), empty)
    assert load_view(tmp_path / "e.npz").strength is None  # curves from elsewhere have none
    both = replace(view, hidden=Curves.from_list([[[1, 2], [3, 4.5]]], [2]))
    save_view(tmp_path / "h.npz", both)
    back = load_view(tmp_path / "h.npz")
    assert same(back, view) and same(
        replace(back, curves=back.hidden, strength=None),
        replace(view, curves=both.hidden, strength=None),
    )
    assert len(load_view(tmp_path / "v.npz").hidden) == 0


def test_a_folder_that_is_not_there(view, tmp_path):
    with pytest.raises(OSError, match="no/v.npz"):
        save_view(tmp_path / "no" / "v.npz", view)


def test_files_that_are_no_views(view, tmp_path):
    path = tmp_path / "v.npz"
    save_view(path, view)
    whole = path.read_bytes()
    cases = [
        b"",
        b"hello",
        b"PK\x03\x04 nonsense",
        *(whole[: len(whole) * k // 7] for k in range(1, 7)),
        whole[:-1],
    ]
    for at in range(40, len(whole), len(whole) // 40):
        cases.append(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
    refused = 0
    for data in cases:
        path.write_bytes(data)
        try:
            load_view(path)  # a byte that nobody reads, a date say, may change
        except ValueError as error:
            refused += 1
            assert "v.npz" in str(error) and "\n" not in str(error)
    assert refused >= len(cases) - 4
    np.save(tmp_path / "a.npy", np.zeros(3))
    (tmp_path / "a.npy").rename(path)
    with pytest.raises(ValueError, match="not a view"):
        load_view(path)
    np.savez(path, a=np.zeros(3))
    with pytest.raises(ValueError, match="not a view"):
        load_view(path)
    np.savez(path, strokestyle_view=np.array([object()]))
    with pytest.raises(ValueError, match="v.npz"):
        load_view(path)
    with pytest.raises(FileNotFoundError):
        load_view(tmp_path / "no.npz")


def rewritten(path, **changes):
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(path, **{**arrays, **changes})


@pytest.mark.parametrize(
    "changes, word",
    [
        ({"strokestyle_view": np.array(99)}, "newer"),
        ({"camera": np.array("{}")}, "camera"),
        ({"camera": np.array("{")}, "v.npz"),
        ({"xy": np.zeros((3, 2))}, "offsets"),
        ({"values": np.full((11, 160, 200), np.nan, np.float16)}, "finite"),
        ({"values": np.zeros((11, 3, 3), np.float16)}, "shape"),
        ({"covered": np.zeros(3, np.uint8)}, "v.npz"),
        ({"covered": np.zeros(4000)}, "v.npz"),
        ({"names": np.array(["depth"])}, "shape"),
        ({"scale": np.zeros(2)}, "scale"),
        ({"kind": np.array([77], np.int8)}, "kind"),
    ],
)
def test_views_with_something_wrong(view, tmp_path, changes, word):
    path = tmp_path / "v.npz"
    save_view(path, view)
    rewritten(path, **changes)
    with pytest.raises(ValueError, match=word) as error:
        load_view(path)
    assert "v.npz" in str(error.value) and "\n" not in str(error.value)


def test_a_view_lacking_a_part(view, tmp_path):
    path = tmp_path / "v.npz"
    save_view(path, view)
    with zipfile.ZipFile(path) as file:
        parts = {
            name: file.read(name) for name in file.namelist() if not name.startswith("offsets")
        }
    with zipfile.ZipFile(path, "w") as file:
        for name, data in parts.items():
            file.writestr(name, data)
    with pytest.raises(ValueError, match="v.npz.*offsets"):
        load_view(path)


def test_json_for_other_programs(view, tmp_path):
    data = json.loads(json.dumps(view_to_json(view), allow_nan=False))
    assert set(data) == {"format", "camera", "size", "step", "curves", "kinds", "closed", "fields"}
    assert data["size"] == [200, 160] and data["kinds"] == ["contour"] and data["closed"] == [True]
    assert abs(data["step"] - 3) < 0.2
    assert set(data["fields"]) == {"depth", "ndotv", "curvature", "nx", "ny"}
    for values in data["fields"].values():
        assert [len(v) for v in values] == [len(c) for c in data["curves"]]
    assert np.abs(np.concatenate(data["curves"]) - view.curves.xy).max() <= 0.0051
    # true units: the distance to the rim of the sphere, the cosine there, a unit normal
    distance = np.linalg.norm(view.camera.eye)
    depth, facing, nx, ny = (
        np.concatenate(data["fields"][k]) for k in ("depth", "ndotv", "nx", "ny")
    )
    assert np.abs(depth - (distance - RADIUS**2 / distance)).max() < 0.15
    assert (facing < 0.3).all() and (np.hypot(nx, ny) > 0.85).all()
    outward = (view.curves.xy - [100, 80]) / np.linalg.norm(view.curves.xy - [100, 80], axis=1)[
        :, None
    ]
    assert (outward[:, 0] * nx + outward[:, 1] * ny > 0.85).all()
    behind = Curves.from_list([[[1, 2], [3, 4.5]]], [2])
    got = view_to_json(replace(view, hidden=behind))
    assert got.pop("hidden") == {
        "curves": [[[1, 2], [3, 4.5]]],
        "kinds": ["crease"],
        "closed": [False],
    }
    assert got == data
    (tmp_path / "c.json").write_text(json.dumps(data))
    assert Camera.load(tmp_path / "c.json").to_dict() == view.camera.to_dict()


# --------------------------------------------------------------------------- what is refused


def test_bad_shapes_are_refused(view):
    good = view.maps
    with pytest.raises(ValueError, match="shape"):
        FeatureMaps(good.names[:3], good.values, good.covered)
    with pytest.raises(ValueError, match="shape"):
        FeatureMaps(good.names, good.values, good.covered[:5])
    with pytest.raises(ValueError, match="finite"):
        FeatureMaps(good.names, np.where(good.values > 1, np.nan, good.values), good.covered)
    with pytest.raises(ValueError, match="scale"):
        FeatureMaps(good.names, good.values, good.covered, np.ones(3))
    with pytest.raises(ValueError, match="camera"):
        View(replace(view.camera, width=99), view.curves, good)


# ------------------------------------------------------------------------------------- parts


def wheel_surface(names=None):
    """tests/shapes.wheel as a surface with named parts."""
    parts = wheel()
    count = np.cumsum([0] + [len(shape.vertices) for shape in parts.values()])
    faces = [shape.faces + at for shape, at in zip(parts.values(), count, strict=False)]
    part = np.repeat(np.arange(len(parts)), [len(f) for f in faces])
    vertices = np.concatenate([shape.vertices for shape in parts.values()])
    return make_surface(
        vertices, np.concatenate(faces), part=part, part_names=tuple(names or parts)
    )


@pytest.fixture(scope="module")
def wheel_view():
    surface = wheel_surface()
    camera = fit_camera(surface.vertices, "25,20", width=300, height=300)
    return surface, camera, extract_view(surface, camera, hidden=True)


def distance_to_parts(surface, camera, xy):
    """From pixels (N, 2) to the nearest vertex of each part, (N, parts), px."""
    return np.stack(
        [
            cKDTree(
                camera.project(surface.vertices[surface.faces[surface.part == k].ravel()])[0]
            ).query(xy)[0]
            for k in range(len(surface.part_names))
        ],
        axis=1,
    )


def test_every_point_of_a_curve_is_of_a_part_that_lies_there(wheel_view):
    surface, camera, view = wheel_view
    for parts, curves in ((view.parts, view.curves), (view.hidden_parts, view.hidden)):
        assert sorted(parts.names) == sorted(surface.part_names) and len(curves) > 5
        own = np.array([surface.part_names.index(parts.name(i)) for i in range(len(parts))])
        away = distance_to_parts(surface, camera, curves.xy)
        assert away[np.arange(len(own)), own].max() < 12  # px, which vertices are apart
        assert (np.bincount(own, minlength=len(parts.names)) > 0).all()
    # on the outer rim there is but the tire
    rim = np.linalg.norm(camera.project(np.zeros((1, 3)))[0] - view.curves.xy, axis=1) > 115
    assert rim.sum() > 100 and {view.parts.names[i] for i in view.parts.index[rim]} == {"tire"}


def test_curves_of_its_own_and_from_elsewhere_are_of_the_same_parts(wheel_view):
    """Two roads: by the face that a line was found on, and by rays."""
    surface, camera, view = wheel_view
    other = view_of_curves(surface, camera, view.curves)
    ours, theirs = view.curve_parts, other.curve_parts
    assert len(other.curves) == len(view.curves)
    assert [ours.name(i) for i in range(len(ours))] == [theirs.name(i) for i in range(len(theirs))]
    away = Curves.from_list(
        [[[2, 2], [40, 2]], *(view.curves[i] + [0.7, -0.7] for i in range(len(view.curves)))]
    )
    shifted = view_of_curves(surface, camera, away).curve_parts
    assert shifted.name(0) == "" and [shifted.name(i + 1) for i in range(len(ours))] == [
        ours.name(i) for i in range(len(ours))
    ]


def test_a_point_belongs_to_the_face_that_its_source_lies_on():
    surface = wheel_surface()
    line = np.stack([np.arange(40.0), np.full(40, 10.0)], axis=1)
    face = np.repeat([4, 5, 6], 40)
    beside = Curves.from_list([line, line + [0, 2], line + [0, 20]], [0, 2, 2])
    source = np.array([3, 50, 100, 0])
    curves = Curves.from_list([line[:4]], [0])
    assert faces_of(
        surface, curves, Fragments(beside, np.ones(len(face)), face), source
    ).tolist() == [4, 5, 6, 4]
    none = faces_of(
        surface, Curves.empty(), Fragments(beside, np.ones(len(face)), face), np.zeros(0, np.int64)
    )
    assert none.shape == (0,)


def test_a_short_stretch_of_an_intersection_goes_with_what_it_is_chained_to():
    surface = wheel_surface()
    line = np.stack([np.arange(40.0), np.full(40, 10.0)], axis=1)
    face = np.repeat([4, 5, 6], 40)
    crossing = Curves.from_list([line, line + [40, 0], line + [0, 20]], [0, 7, 7])
    chain, rows = np.concatenate([line[::3], line[::3] + [40, 0]]), np.r_[0:40:3, 40:80:3]
    both = Curves.from_list([chain, line + [0, 20], line + [40, 0], chain[::-1]], [0, 7, 7, 0])
    source = np.concatenate([rows, np.arange(80, 120), np.arange(40, 80), rows[::-1]])
    found = faces_of(surface, both, Fragments(crossing, np.ones(len(face)), face), source)
    each = [set(found[a:b]) for a, b in zip(both.offsets[:-1], both.offsets[1:], strict=True)]
    assert each == [{4}, {6}, {5}, {4}]  # alone, it keeps its own face
    long = np.stack([np.arange(40.0, 100.0), np.full(60, 10.0)], axis=1)
    one = Curves.from_list([np.concatenate([line, long])], [0])
    pieces, face = Curves.from_list([line, long], [0, 7]), np.repeat([4, 5], [40, 60])
    found = faces_of(surface, one, Fragments(pieces, np.ones(len(face)), face), np.arange(100))
    assert set(found[:40]) == {4} and set(found[40:]) == {5}


def test_nearer_parts_are_painted_later():
    vertices, faces = cube()
    both = np.concatenate([vertices * [1, 1, 0.1] + [0, 0, z] for z in (0.0, 1.0)])
    both_faces = np.concatenate([faces, faces + len(vertices)])
    part = np.repeat([0, 1], len(faces))
    for azimuth, order in (("20,10", ("back", "front")), ("200,10", ("front", "back"))):
        surface = make_surface(both, both_faces, part=part, part_names=("back", "front"))
        view = extract_view(surface, fit_camera(surface.vertices, azimuth, width=128, height=128))
        assert view.parts.names == order


@pytest.mark.parametrize(
    "names, found",
    [
        (("",) * 7, None),
        (("a",) * 7, None),
        (("a", "a ", "\ta", "a\x00", "a", "a", "a"), None),
        (("", "hub", *("",) * 5), {"", "hub"}),
        (("wheel", "wheel", *("spoke",) * 5), {"wheel", "spoke"}),
        (("a\n" * 300, "b", *("c",) * 5), {"b", "c", part_name("a\n" * 300)}),
    ],
)
def test_parts_of_one_name_are_one_and_without_names_there_are_none(names, found, wheel_view):
    _, camera, whole = wheel_view
    view = extract_view(wheel_surface(names), camera)
    assert np.array_equal(view.curves.xy, whole.curves.xy)  # names change no line
    got = None if view.parts is None else {view.parts.name(i) for i in range(len(view.parts))}
    assert got == found and (view.curve_parts is None) == (found is None)


def test_curves_are_cut_where_the_part_changes():
    """A ball of two halves, the seam at right angles to its outline."""
    vertices, faces = ball(4)
    left = vertices[faces].mean(axis=1)[:, 0] < 0
    surface = make_surface(vertices, faces, part=left.astype(int), part_names=("right", "left"))
    view = extract_view(
        surface, fit_camera(vertices, "0,0", width=200, height=200), LineOptions(kinds=("contour",))
    )
    assert len(view.curves) == 1 and view.curves.closed[0]
    curves, parts = view.pieces_by_part()
    assert len(curves) >= 2 and not curves.closed.any()
    for i in range(len(curves)):
        side = curves[i][:, 0] - 100
        assert (
            side * (-1 if parts.name(i) == "left" else 1)
        ).min() > -4  # px, where the seam is found
    assert curves.lengths().sum() == pytest.approx(view.curves.lengths().sum())
    assert view.pieces_by_part(hidden=True) == (view.hidden, None)


def test_parts_are_saved_and_told(wheel_view, tmp_path):
    _, _, view = wheel_view
    save_view(tmp_path / "v.npz", view)
    back = load_view(tmp_path / "v.npz")
    for name in ("parts", "hidden_parts"):
        assert getattr(back, name).names == getattr(view, name).names
        assert np.array_equal(getattr(back, name).index, getattr(view, name).index)
    content = view_to_json(view)
    assert len(content["parts"]) == len(view.curves) and len(content["hidden"]["parts"]) == len(
        view.hidden
    )
    assert set(content["parts"]) <= set(view.parts.names)
    plain = replace(view, parts=None, hidden_parts=None)
    save_view(tmp_path / "p.npz", plain)
    assert load_view(tmp_path / "p.npz").parts is None and "parts" not in view_to_json(plain)
    with pytest.raises(ValueError, match="View.parts"):
        replace(view, parts=view.parts.take([0]))


def test_lines_without_a_shape_keep_their_parts():
    lines = Curves.from_list(
        [[[-9, 5], [-2, 5]], [[-9, 15], [50, 15]], [[5, 25], [20, 25]], [[0, 30], [9, 30]]]
    )
    view = view_of_lines(lines, 40, 40, parts=Parts(("a", "b"), [0, 1, 0, -1]))
    assert (
        view.curve_parts.index.tolist() == [1, 0, -1] and view_of_lines(lines, 40, 40).parts is None
    )


def test_lines_are_asked_some_at_a_time(monkeypatch):
    surface = make_surface(*cube())
    camera = fit_camera(surface.vertices, "20,10", width=512, height=512)
    lines = SurfaceLines(surface)
    found, asked = lines.seen_from(camera), []
    whole = look_along(surface, camera, found, lines.bvh)

    class Counted:
        def seen(self, eye, face, *rest):
            asked.append(len(face))
            return lines.bvh.seen(eye, face, *rest)

    monkeypatch.setattr(visible, "CHUNK", 100)
    parts = look_along(surface, camera, found, Counted())
    assert max(asked) <= 100 < sum(asked)
    for name in ("xy", "strength", "face", "line", "inside", "seen"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name)), name


def test_optional_lines_leave_the_others_as_they_are():
    vertices, faces = ball(4)
    x, y, z = vertices.T
    bump = 1 + 0.3 * np.sin(7 * x) * np.sin(6 * y + 1) * np.cos(6 * z)
    surface = make_surface(vertices * bump[:, None], faces)
    camera = fit_camera(surface.vertices, "three-quarter", 30.0, 400, 400)
    plain, more = extract_view(surface, camera), extract_view(surface, camera, optional=True)
    assert plain.optional is None and len(more.curves) > len(plain.curves)
    first = len(plain.curves)
    assert np.array_equal(more.optional, np.arange(len(more.curves)) >= first)
    assert np.array_equal(more.curves.xy[: len(plain.curves.xy)], plain.curves.xy)
    assert np.array_equal(more.strength[more.required], plain.strength)
    assert np.array_equal(more.maps.values, plain.maps.values)
    assert is_kind(more.curves.kind[first:], SOFT_KINDS).all()
    back = more.only(more.required)
    assert np.array_equal(back.curves.xy, plain.curves.xy)


def test_a_surface_keeps_what_its_last_view_found():
    surface = make_surface(*torus())
    camera = fit_camera(surface.vertices, "30,40", width=200, height=200)
    one = extract_view(surface, camera)
    fresh = extract_view(make_surface(*torus()), camera.turned(40.0))
    again = extract_view(surface, camera.turned(40.0))
    np.testing.assert_array_equal(again.curves.xy, fresh.curves.xy)
    np.testing.assert_array_equal(again.maps.values, fresh.maps.values)
    few = LineOptions(kinds=("contour",))
    assert set(extract_view(surface, camera, few).curves.kind) == {KINDS.index("contour")}
    np.testing.assert_array_equal(extract_view(surface, camera).curves.xy, one.curves.xy)


@pytest.mark.parametrize("smooth", [0.0, 0.01])
def test_what_a_surface_keeps_goes_with_it(smooth):
    """Without a circle: a batch of large meshes would hold several of them at a time."""
    gc.disable()
    try:
        surface = make_surface(*cube(2))
        camera = fit_camera(surface.vertices, width=64, height=64)
        extract_view(surface, camera, LineOptions(smooth=smooth))
        gone = weakref.ref(surface)
        del surface
        assert gone() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("count", [1, 2, 9, 10, 11, 1000])
def test_a_percentile_is_the_value_of_that_rank(count):
    rng = np.random.default_rng(count)
    values = np.exp(rng.normal(0.0, 20.0, count)).astype(np.float32)
    values[rng.random(count) < 0.3] = 0.0
    for some in (values, np.round(values), np.full(count, 3.0, np.float32)):
        assert percentile(some, 0.9) == np.sort(some)[int(0.9 * (count - 1))]


def test_maps_are_worked_out_when_asked_for():
    """One alone is what it is among all, and lines ask for none: no ray and no curvature."""
    surface = wheel_surface()
    camera = fit_camera(surface.vertices, "three-quarter", 30.0, 96, 90)
    bvh, curves = Bvh(surface), Curves.from_list([[[8.0, 8.5], [60.0, 40.5]]])
    traced: list[int] = []
    trace, bvh._run = bvh._run, lambda *rays: traced.append(1) or trace(*rays)
    one, some, every = (feature_maps(surface, camera, curves, bvh) for _ in range(3))
    assert one.size == (90, 96) and not traced
    assert every.values.shape == (11, 90, 96) and len(traced) == 1
    row, column = np.nonzero(every.covered)
    assert len(row) > 1000
    for i, name in enumerate(every.names):
        assert np.array_equal(one[name], every.values[i]), name
        assert one.scale_of(name) == every.scale_of(name) == every.scale[i]
        read = some.read([name], row, column)
        assert np.array_equal(read, every.read([name], row, column)) and read.shape == (len(row), 1)
        assert np.array_equal(read[:, 0], every.values[i, row, column])
    assert len(traced) == 3
    left = one.with_curves(Curves.empty())
    assert not left["plain"].any() and one["plain"].any()
    assert np.array_equal(left.values[:-1], every.values[:-1]) and len(traced) == 3


def test_maps_not_yet_worked_out_are_copied_whole():
    surface = wheel_surface()
    camera = fit_camera(surface.vertices, "three-quarter", 30.0, 96, 90)
    views = [extract_view(surface, camera) for _ in range(4)]
    packed = pickle.dumps(views[0].maps)
    assert len(packed) < 1.1 * (11 * 96 * 90 * 4 + 96 * 90)  # not the surface and its hierarchy
    whole = views[3].maps.values
    moved = replace(views[2].maps, covered=views[2].maps.covered)
    for maps in (pickle.loads(packed), copy.deepcopy(views[1].maps), moved):
        assert maps.names == views[3].maps.names and np.array_equal(maps.values, whole)
        assert np.array_equal(maps.covered, views[3].maps.covered)
        assert np.array_equal(maps.scale, views[3].maps.scale)
    with pytest.raises(AttributeError, match="'FeatureMaps' object has no attribute 'value'"):
        _ = extract_view(surface, camera).maps.value
    with pytest.raises(ValueError, match="no feature map is named 'normal_z'"):
        _ = extract_view(surface, camera).maps["normal_z"]


def test_lines_alone_take_no_curvature():
    surface = make_surface(*ball(4))
    view = extract_view(surface, fit_camera(surface.vertices, "front", 30.0, 96, 96))
    assert len(view.curves) and "dcurv" not in vars(surface)
