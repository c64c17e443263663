"""The camera in closed form, and camera files."""

import json

import numpy as np
import pytest

from strokestyle.extract import camera as camera_module
from strokestyle.extract.camera import MARGIN, NAMED_VIEWS, Camera, fit_camera, parse_view, swept


def front(width=200, height=100, fov=90.0, distance=2.0):
    return Camera([0, 0, distance], [0, 0, 0], [0, 1, 0], fov, width, height)


def test_pixels_of_known_points():
    camera = front()  # fov 90 deg: half the height is as far as the eye, so focal = 50 px
    xy, depth = camera.project([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    assert np.allclose(depth, [2, 2, 2, 1])
    assert np.allclose(xy, [[100, 50], [125, 50], [100, 25], [100, 50]])  # x right, y down


def test_top_left_pixel_centre_is_half_half():
    assert np.allclose(front().pixel_centres()[[0, 1, 200]], [[0.5, 0.5], [1.5, 0.5], [0.5, 1.5]])


def test_ray_through_a_pixel_hits_the_point_that_projects_there():
    rng = np.random.default_rng(0)
    camera = Camera([1.0, 2.0, 3.0], [0.1, 0, 0], [0, 1, 0.2], 33.0, 640, 480)
    points = rng.normal(size=(50, 3)) * 0.5
    xy, _ = camera.project(points)
    reach = np.linalg.norm(points - camera.eye, axis=1)
    assert np.allclose(camera.eye + camera.rays(xy) * reach[:, None], points)


@pytest.mark.parametrize("view", [*NAMED_VIEWS, "33,-20"])
@pytest.mark.parametrize("size", [(768, 768), (400, 200), (200, 400)])
@pytest.mark.parametrize("up", ["y", "z"])
def test_a_fitted_shape_fills_the_canvas_to_the_margin(view, size, up):
    vertices = np.random.default_rng(1).normal(size=(300, 3)) * [1.0, 0.5, 0.3]
    camera = fit_camera(vertices, view, 30.0, *size, up=up)
    xy, depth = camera.project(vertices)
    low, high = xy.min(axis=0), xy.max(axis=0)
    assert (depth > 0).all()
    assert np.allclose(0.5 * (low + high), 0.5 * np.array(size), atol=1.0)
    assert np.isclose(((high - low) / np.array(size)).max(), 1 - 2 * MARGIN, atol=0.005)


def test_named_views_look_from_where_they_say():
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    assert np.allclose(fit_camera(box, "front").axes[2], [0, 0, -1])
    assert np.allclose(fit_camera(box, "side").axes[2], [-1, 0, 0])
    assert fit_camera(box, "top").axes[2][1] < -0.99
    assert np.allclose(
        fit_camera(box, "front", up="z").axes[2], [0, 1, 0]
    )  # the front of a z-up shape faces -y


@pytest.mark.parametrize("up", ["y", "z"])
def test_turning_is_the_azimuth_of_a_view(up):
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    assert np.allclose(
        fit_camera(box, "0,20", up=up).turned(90.0).axes, fit_camera(box, "90,20", up=up).axes
    )
    assert np.allclose(front().turned(360.0).eye, front().eye)


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_swept_shape_stays_inside_however_it_is_turned(up):
    vertices = np.random.default_rng(2).normal(size=(500, 3)) * [1.0, 0.6, 0.2] + [0.5, 0, 1]
    camera = fit_camera(swept(vertices, up), "20,15", up=up)
    seen = np.concatenate([camera.turned(turn).project(vertices)[0] for turn in range(0, 360, 15)])
    room = MARGIN * 768
    assert seen.min() > room - 2 and seen.max() < 768 - room + 2
    assert np.ptp(seen, axis=0).max() > 0.95 * (768 - 2 * room)


def test_a_single_point_still_gives_a_camera():
    assert np.isfinite(fit_camera(np.zeros((1, 3))).eye).all()


def test_file_round_trip(tmp_path):
    camera = Camera([1.0, 2.0, 3.0], [0.1, 0, 0], [0, 0, 1], 33.0, 640, 480)
    path = tmp_path / "camera.json"
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):  # with a mark of the byte order, or without
        path.write_text(json.dumps({"camera": camera.to_dict()}), encoding)
        assert Camera.load(path).to_dict() == camera.to_dict()


@pytest.mark.parametrize(
    "text, word",
    [
        ("", "JSON"),
        ("[1, 2]", "JSON object"),
        ('{"eye": [0, 0, 1]}', "no target, fov_y_deg, size"),
        (
            '{"eye": [0, 0, 1], "target": [0, 0, 1], "fov_y_deg": 30, "size": [64, 64]}',
            "same point",
        ),
        (
            '{"eye": [0, 9, 0], "target": [0, 0, 0], "fov_y_deg": 30, "size": [64, 64]}',
            "up points along",
        ),
        ('{"eye": [0, 0, "x"], "target": [0, 0, 0], "fov_y_deg": 30, "size": [64, 64]}', "eye"),
        ('{"eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_deg": 300, "size": [64, 64]}', "fov_y"),
        ('{"eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_deg": 30, "size": [64]}', "unpack"),
        (
            '{"eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_deg": 30, "size": [64, 1000000]}',
            "height",
        ),
    ],
)
def test_bad_camera_files_are_named(tmp_path, text, word):
    path = tmp_path / "camera.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=word) as error:
        Camera.load(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("view", ["sideways", "1", "1,2,3", "0,100", "nan,0"])
def test_views_that_are_none(view):
    with pytest.raises(ValueError, match="view"):
        parse_view(view)


@pytest.mark.parametrize(
    "view, wrong", [("nan,0", "azimuth"), ("inf,0", "azimuth"), ("0,nan", "elevation")]
)
def test_which_angle_of_a_view_is_wrong(view, wrong):
    with pytest.raises(ValueError, match=f"the {wrong} "):
        parse_view(view)


@pytest.mark.parametrize("seed", range(20))
def test_a_shape_is_centred_by_its_outermost_points_as_by_all(seed, monkeypatch):
    random = np.random.default_rng(seed)
    points = random.normal(size=(random.choice([3, 8, 2000]), 3)) * random.uniform(0.05, 1.0, 3)
    camera = fit_camera(points, "30,20", fov_y=100.0, width=500)
    monkeypatch.setattr(camera_module, "STEPS_OF_ALL", camera_module.STEPS)
    plain = fit_camera(points, "30,20", fov_y=100.0, width=500)
    np.testing.assert_array_equal(camera.eye, plain.eye)
    np.testing.assert_array_equal(camera.target, plain.target)
