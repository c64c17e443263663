"""Parallel projection in closed form, and against a perspective from far away."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from shapes import sphere, torus

from strokestyle.extract.camera import (
    MARGIN,
    NAMED_VIEWS,
    PARALLEL_VIEWS,
    Camera,
    fit_camera,
    projection_of,
)
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.pipeline import extract_view, view_of_curves
from strokestyle.extract.turntable import fit_turntable_camera, turntable
from strokestyle.extract.view_file import load_view, save_view, view_to_json
from strokestyle.geometry.curves import KINDS, owner
from strokestyle.mesh.surface import make_surface

CUBE = trimesh.creation.box((1.0, 1.0, 1.0))
SIZE = 400


def surface_of(mesh):
    return (
        make_surface(*mesh) if isinstance(mesh, tuple) else make_surface(mesh.vertices, mesh.faces)
    )


def parallel(width=200, height=100, extent=4.0, eye=(0, 0, 2.0)):
    return Camera(eye, [0, 0, 0], [0, 1, 0], None, width, height, extent)


# ------------------------------------------------------------------------------------- the camera


def test_pixels_do_not_depend_on_depth():
    camera = parallel()  # 4 units are 100 px high: 25 px a unit
    xy, depth = camera.project([[0, 0, 0], [1, 0, 0], [1, 0, -7], [0, 1, 1.5], [0, 0, 50]])
    assert np.allclose(xy, [[100, 50], [125, 50], [125, 50], [100, 25], [100, 50]])
    assert np.allclose(depth, [2, 2, 9, 0.5, -48])
    assert camera.focal == 25.0 and camera.shows(depth).all()


def test_rays_are_one_and_begin_where_their_pixel_is():
    camera = Camera([1.0, 2.0, 3.0], [0.1, 0, 0], [0, 1, 0.2], None, 640, 480, 2.5)
    points = np.random.default_rng(0).normal(size=(50, 3))
    xy, depth = camera.project(points)
    assert np.allclose(camera.origins(xy) + depth[:, None] * camera.rays(xy), points)
    assert np.ptp(camera.rays(xy), axis=0).max() == 0.0
    assert np.allclose(camera.viewpoint, [*-camera.axes[2], 0.0])


@pytest.mark.parametrize("view", [*NAMED_VIEWS, "33,-20", "12,90"])
@pytest.mark.parametrize("size", [(768, 768), (400, 200), (200, 400)])
@pytest.mark.parametrize("up", ["y", "z"])
def test_a_fitted_shape_reaches_the_margin_exactly(view, size, up):
    vertices = np.random.default_rng(1).normal(size=(300, 3)) * [1.0, 0.5, 0.3]
    camera = fit_camera(vertices, view, 30.0, *size, up=up, projection="parallel")
    xy, depth = camera.project(vertices)
    low, high = xy.min(axis=0), xy.max(axis=0)
    assert np.allclose(0.5 * (low + high), 0.5 * np.array(size), atol=1e-9)
    assert np.isclose(((high - low) / np.array(size)).max(), 1 - 2 * MARGIN, atol=1e-12)
    # depths are those of the same view in perspective
    pinhole = fit_camera(vertices, view, 30.0, *size, up=up, projection="perspective")
    assert np.allclose(depth, pinhole.project(vertices)[1])


@pytest.mark.parametrize("up", ["y", "z"])
def test_top_and_bottom_look_exactly_along_the_upright_axis(up):
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    upright, front = ([0, 1, 0], [0, 0, 1]) if up == "y" else ([0, 0, 1], [0, -1, 0])
    top, bottom = (fit_camera(box, view, up=up) for view in ("top", "bottom"))
    assert np.array_equal(-top.axes[2], upright) and np.array_equal(bottom.axes[2], upright)
    # the front is at the bottom of the picture from above, at its top from below; right is right
    assert np.allclose(top.axes[1], front) and np.allclose(-bottom.axes[1], front)
    assert np.allclose(top.axes[0], [1, 0, 0]) and np.allclose(bottom.axes[0], [1, 0, 0])
    # and it is the limit of the views beside it, whatever the azimuth
    for elevation in (90.0, -90.0):
        near = fit_camera(box, f"25,{elevation * (1 - 1e-5)}", up=up).axes
        assert np.allclose(fit_camera(box, f"25,{elevation}", up=up).axes, near, atol=1e-4)


def test_the_axes_of_a_drawing_are_foreshortened_as_the_standard_says():
    for view, ratio, angles in (
        ("isometric", [1, 1, 1], [30.0, 30.0]),
        ("dimetric", [1, 1, 0.5], [7.0, 42.0]),
    ):
        camera = fit_camera(CUBE.vertices, view)
        axes, _ = camera.project(np.vstack([np.zeros(3), np.eye(3)]))
        axes = axes[1:] - axes[0]
        length = np.hypot(*axes.T)
        assert np.allclose(length / length[0], ratio)
        rise = np.degrees(np.arctan2(np.abs(axes[[0, 2], 1]), np.abs(axes[[0, 2], 0])))
        assert np.allclose(rise, angles, atol=0.6)  # rounded in the standard
        assert camera.projection == "parallel" and projection_of(view) == "parallel"
        assert fit_camera(CUBE.vertices, view, projection="perspective").fov_y == 30.0
    assert set(PARALLEL_VIEWS) == {"isometric", "dimetric"}
    assert fit_camera(CUBE.vertices, "top").projection == "perspective"


def test_files_hold_the_projection_and_those_of_older_versions_are_perspectives(tmp_path):
    path = tmp_path / "camera.json"
    for camera in (parallel(), fit_camera(CUBE.vertices), fit_camera(CUBE.vertices, "isometric")):
        path.write_text(json.dumps(camera.to_dict()))
        assert Camera.load(path).to_dict() == camera.to_dict()
    data = fit_camera(CUBE.vertices).to_dict()
    assert data.pop("projection") == "perspective"
    path.write_text(json.dumps(data))
    assert Camera.load(path).projection == "perspective"


@pytest.mark.parametrize(
    "change, words",
    [
        ({"projection": "fisheye"}, "projection is 'fisheye'; it must be perspective or parallel"),
        ({"projection": None}, "projection is None"),
        ({"projection": ["parallel"]}, "projection is"),
        ({"extent": 0.0}, "extent must be a length above 0"),
        ({"extent": float("inf")}, "extent must be a length"),
        ({"extent": "wide"}, "wide"),
        ({"extent": ...}, "no extent in it; a camera in parallel projection needs"),
    ],
)
def test_bad_parallel_cameras_are_named(tmp_path, change, words):
    data = {k: v for k, v in (parallel().to_dict() | change).items() if v is not ...}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match=words) as error:
        Camera.load(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_camera_has_one_projection_and_fit_camera_knows_only_two():
    with pytest.raises(ValueError, match="either fov_y"):
        Camera([0, 0, 1], [0, 0, 0], [0, 1, 0], 30.0, 64, 64, 1.0)
    with pytest.raises(ValueError, match="either fov_y"):
        Camera([0, 0, 1], [0, 0, 0], [0, 1, 0], None, 64, 64)
    with pytest.raises(ValueError, match="projection must be"):
        fit_camera(CUBE.vertices, projection="oblique")


# ------------------------------------------------------------------------------------ the drawing


def test_an_isometric_cube_is_three_equal_rhombi_in_a_regular_hexagon():
    view = extract_view(surface_of(CUBE), fit_camera(CUBE.vertices, "isometric", 30.0, SIZE, SIZE))
    side = (1 - 2 * MARGIN) * SIZE / 2  # twice a side high
    outline = view.curves.kind == KINDS.index("contour")
    lengths = view.curves.lengths()
    assert np.isclose(lengths[outline].sum(), 6 * side, rtol=0.01)
    assert np.isclose(lengths[~outline].sum(), 3 * side, rtol=0.01)
    middle = np.array([SIZE, SIZE]) / 2
    angle = np.radians(30 + 60 * np.arange(6))
    corners = middle + side * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = view.curves.xy[outline[owner(view.curves.offsets)]]
    normal = np.radians(60 * np.arange(6))
    heights = (points - middle) @ np.stack([np.cos(normal), np.sin(normal)])
    assert np.abs(heights.max(axis=1) - side * np.cos(np.pi / 6)).max() < 0.5
    assert all(np.hypot(*(points - corner).T).min() < 4.0 for corner in corners)
    # each face covers a rhombus of one size: told apart by their normals on the screen
    seen = view.maps.covered
    normals = np.stack([view.maps["normal_x"][seen], view.maps["normal_y"][seen]], axis=1)
    faces, area = np.unique(np.round(normals, 2), axis=0, return_counts=True)
    assert len(faces) == 3
    assert np.allclose(area, side * side * np.sin(np.radians(60)), rtol=0.01)


def test_parallel_lines_stay_parallel_and_a_pinhole_makes_them_meet():
    surface = surface_of(trimesh.creation.box((1.0, 0.6, 3.0)))
    for projection, spread in (("parallel", 0.0), ("perspective", 2.0)):
        camera = fit_camera(surface.vertices, "-25,20", 30.0, SIZE, SIZE, projection=projection)
        ends, _ = camera.project(surface.vertices)
        edges = surface.edges[(np.ptp(surface.vertices[surface.edges], axis=1) > 0).sum(1) == 1]
        way = ends[edges[:, 1]] - ends[edges[:, 0]]
        axis = np.ptp(surface.vertices[edges], axis=1).argmax(axis=1)
        heading = np.degrees(np.arctan2(way[:, 1], way[:, 0])) % 180.0
        found = max(np.ptp(heading[axis == i]) for i in range(3))
        assert found < 1e-6 if not spread else found > spread


@pytest.mark.parametrize("view", ["top", "bottom", "front", "left", "30,90"])
def test_walls_along_the_view_do_not_show(view):
    """A box seen along its edges is one rectangle, its outline a contour, nothing behind it."""
    surface = surface_of(trimesh.creation.box((1.0, 0.7, 0.4)))
    camera = fit_camera(surface.vertices, view, 30.0, SIZE, SIZE, projection="parallel")
    drawn = extract_view(surface, camera, hidden=True)
    assert {KINDS[kind] for kind in drawn.curves.kind} == {"contour"}
    xy, _ = camera.project(surface.vertices)
    corners = np.unique(np.round(xy, 6), axis=0)
    assert len(corners) == 4
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    assert np.isclose(drawn.curves.lengths().sum(), hull.area, rtol=0.01)  # its perimeter
    assert np.isclose(drawn.maps.covered.sum(), hull.volume, rtol=0.02)
    assert not len(drawn.hidden)
    assert np.allclose(drawn.maps["n_dot_v"][drawn.maps.covered], 1.0, atol=1e-3)


def test_the_outline_of_a_sphere_is_the_circle_of_its_radius():
    surface = surface_of(tuple(sphere(5)))
    camera = Camera([0.3, 0.4, 0.5], [0, 0, 0], [0, 1, 0], None, SIZE, SIZE, 1.25)
    view = extract_view(surface, camera)
    assert [KINDS[kind] for kind in view.curves.kind] == ["contour"] and view.curves.closed.all()
    away = np.hypot(*(view.curves.xy - SIZE / 2).T)
    assert np.allclose(away, 0.5 / 1.25 * SIZE, atol=0.3)


def test_feature_maps_are_exact_on_a_sphere():
    surface = surface_of(tuple(sphere(5)))
    camera = fit_camera(surface.vertices, "20,10", 30.0, 160, 120, projection="parallel")
    maps = extract_view(surface, camera).maps
    xy = camera.pixel_centres()[maps.covered.ravel()]
    origins, ray = camera.origins(xy), camera.rays(xy)
    along = -(origins * ray).sum(1)
    near = along - np.sqrt(np.maximum(0.25 - ((origins + along[:, None] * ray) ** 2).sum(1), 0))
    place = origins + near[:, None] * ray
    inner = np.hypot(*(xy - [80, 60]).T) < 45.0  # of a radius of 50
    scale = dict(zip(maps.names, maps.scale, strict=True))
    found = {name: maps[name][maps.covered] * scale[name] for name in ("depth", "n_dot_v")}
    assert np.allclose(found["depth"][inner], near[inner], atol=2e-3)
    assert np.allclose(found["n_dot_v"][inner], -2.0 * (place * ray).sum(1)[inner], atol=4e-3)
    assert np.allclose(maps["normal_x"][maps.covered][inner], 2 * (place @ camera.axes[0])[inner],
                       atol=4e-3)  # fmt: skip


@pytest.mark.parametrize(
    "mesh", [tuple(torus(48, 24)), tuple(sphere(3)), trimesh.creation.annulus(0.3, 0.5, 0.4)]
)
def test_it_is_what_a_pinhole_sees_from_far_away(mesh):
    surface = surface_of(mesh)
    camera = fit_camera(surface.vertices, "25,35", 30.0, SIZE, SIZE, projection="parallel")
    reach = 0.5 * camera.extent / np.tan(np.radians(0.5))
    far = Camera(camera.target - reach * camera.axes[2], camera.target, camera.up, 1.0, SIZE, SIZE)
    ours, theirs = (extract_view(surface, c, hidden=True) for c in (camera, far))
    for a, b in ((ours.curves, theirs.curves), (ours.hidden, theirs.hidden)):
        assert np.isclose(a.lengths().sum(), b.lengths().sum(), rtol=0.03, atol=8.0)
    assert np.isclose(ours.maps.covered.sum(), theirs.maps.covered.sum(), rtol=0.01)


@pytest.mark.parametrize("view", ["25,35", "isometric", "side"])
def test_feature_maps_of_both_projections_are_of_one_measure(view):
    """A style that was learned in one is used in the other."""
    surface = surface_of(tuple(torus(96, 48)))
    maps = [
        extract_view(surface, fit_camera(surface.vertices, view, 30.0, 160, 160, projection=p)).maps
        for p in ("parallel", "perspective")
    ]
    for name in ("depth", "n_dot_v", "max_curvature"):
        a, b = (np.quantile(m[name][m.covered], [0.1, 0.5, 0.9]) for m in maps)
        assert np.allclose(a, b, atol=0.06), name
    near = [m["depth"][m.covered].min() for m in maps]
    assert 0.6 < min(near) and max(near) < 1.0


@pytest.mark.parametrize("shift", [-0.9, -0.2, 3.0])
def test_only_the_direction_of_the_eye_counts(shift):
    """An eye within or behind the shape sees all of it, and the maps are as from before it."""
    surface = surface_of(tuple(torus(48, 24)))
    camera = fit_camera(surface.vertices, "25,35", 30.0, 160, 160, projection="parallel")
    out = camera.eye - camera.target
    moved = replace(camera, eye=camera.target + out * (1.0 + shift))
    a, b = (extract_view(surface, c, hidden=True) for c in (camera, moved))
    # float32 rays start elsewhere: to a hundredth of a pixel
    assert np.allclose(a.curves.lengths().sum(), b.curves.lengths().sum(), rtol=1e-3)
    assert np.array_equal(a.maps.covered, b.maps.covered)
    assert (b.maps["depth"] > 0.0).all() and b.camera is moved
    behind = replace(camera, eye=camera.target + 0.01 * out, target=camera.target - out)
    assert np.array_equal(extract_view(surface, behind).maps.covered, a.maps.covered)


def test_parts_lie_before_one_another_as_in_the_picture():
    """Curves from elsewhere belong to the part whose surface is nearest along the view."""
    boxes = [trimesh.creation.box((1, 1, 0.2)), trimesh.creation.box((0.4, 0.4, 0.2))]
    boxes[1].apply_translation([0, 0, 1.0])
    vertices = np.concatenate([box.vertices for box in boxes])
    faces = np.concatenate([boxes[0].faces, boxes[1].faces + len(boxes[0].vertices)])
    part = np.repeat([0, 1], 12)
    surface = make_surface(vertices, faces, part=part, part_names=("wall", "block"))
    camera = fit_camera(surface.vertices, "front", 30.0, SIZE, SIZE, projection="parallel")
    drawn = extract_view(surface, camera)
    assert drawn.curve_parts.names == ("wall", "block")
    again = view_of_curves(surface, camera, drawn.curves)
    assert np.array_equal(again.curve_parts.index, drawn.curve_parts.index)
    assert sorted(set(again.curve_parts.index)) == [0, 1]


def test_views_of_older_versions_are_perspectives(tmp_path):
    surface = surface_of(CUBE)
    view = extract_view(surface, fit_camera(surface.vertices, "front", 30.0, 64, 64))
    save_view(tmp_path / "v.npz", view)
    with np.load(tmp_path / "v.npz") as file:
        arrays = dict(file)
    camera = json.loads(str(arrays["camera"]))
    del camera["projection"]
    np.savez(tmp_path / "old.npz", **arrays | {"camera": np.array(json.dumps(camera))})
    assert load_view(tmp_path / "old.npz").camera.to_dict() == view.camera.to_dict()
    camera["projection"] = "fisheye"
    np.savez(tmp_path / "bad.npz", **arrays | {"camera": np.array(json.dumps(camera))})
    with pytest.raises(ValueError, match="bad.npz: .*projection is 'fisheye'"):
        load_view(tmp_path / "bad.npz")


def test_views_in_files_keep_the_projection(tmp_path):
    surface = surface_of(CUBE)
    view = extract_view(surface, fit_camera(surface.vertices, "isometric", 30.0, 64, 64))
    save_view(tmp_path / "v.npz", view)
    assert load_view(tmp_path / "v.npz").camera.to_dict() == view.camera.to_dict()
    (tmp_path / "v.json").write_text(json.dumps(view_to_json(view)))
    assert Camera.load(tmp_path / "v.json").to_dict() == view.camera.to_dict()


@pytest.mark.parametrize("view", ["isometric", "top", "20,10"])
def test_a_turntable_goes_round_the_upright_axis_at_one_size(view):
    surface = surface_of(trimesh.creation.box((3.0, 1.0, 0.5)))
    vertices, axis = surface.vertices, np.array([0.0, 1.0, 0.0])
    camera = fit_turntable_camera(vertices, view, width=120, height=120, projection="parallel")
    views = list(turntable(surface, camera, 4, axis=axis))
    height = [v.camera.eye[1] for v in views]
    assert np.allclose(height, height[0]) and {v.camera.extent for v in views} == {camera.extent}
    for v in views:
        xy, _ = v.camera.project(vertices)
        assert xy.min() > 0.6 * MARGIN * 120 and xy.max() < 120 - 0.6 * MARGIN * 120
    quarter = views[1].camera.axes
    x, y, z = np.array(camera.axes).T
    assert np.allclose(np.array(quarter).T, [z, y, -x])


@pytest.mark.parametrize("view", ["top", "37,90", "bottom"])
def test_what_is_seen_along_itself_is_turned_away_on_fine_meshes_too(view):
    """The outline lies on the near side, all of it a contour, however the walls are meshed."""
    fine = trimesh.creation.cylinder(0.5, 1.0, sections=64).subdivide().subdivide()
    box = trimesh.creation.box((1.0, 0.7, 0.4)).subdivide().subdivide().subdivide()
    for mesh in (fine, box):
        surface = surface_of(mesh)
        camera = fit_camera(surface.vertices, view, up="z", projection="parallel")
        found = SurfaceLines(surface).seen_from(camera)
        assert {KINDS[kind] for kind in found.kind} == {"contour"}
        side = 1.0 if view != "bottom" else -1.0
        assert np.allclose(side * found.points(surface)[:, 2], surface.vertices[:, 2].max())
