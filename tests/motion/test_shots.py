"""Shots: a turn round a shape, a path of cameras, a mesh that deforms."""

import json

import numpy as np
import pytest
from shapes import sphere

from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.turntable import turntable
from strokestyle.mesh.surface import make_surface
from strokestyle.motion.shots import (
    load_cameras,
    path_shots,
    shots_between,
    turntable_shots,
    views_of_shots,
)

CAMERA = Camera([0, 1, 3], [0, 0, 0], [0, 1, 0], 30, 64, 48)


@pytest.fixture(scope="module")
def ball():
    return make_surface(*sphere(2))


def test_a_turntable_shows_what_the_extractors_does(ball):
    shots = turntable_shots(ball, CAMERA, 3, np.array([0.0, 1.0, 0.0]))
    views = list(turntable(ball, CAMERA, 3, axis=np.array([0.0, 1.0, 0.0])))
    for shot, view, again in zip(shots, views, views_of_shots(shots), strict=True):
        assert shot.surface is ball and shot.camera.to_dict() == view.camera.to_dict()
        assert np.array_equal(again.curves.xy, view.curves.xy)
        assert np.array_equal(again.maps.values, view.maps.values)


def test_between_the_frames_of_a_turntable_are_shots_where_they_are_few(ball):
    assert [shots_between(n) for n in (1, 4, 6, 23, 24, 25, 36, 3600)] == [24, 6, 4, 2, 1, 1, 1, 1]
    fine = turntable_shots(ball, CAMERA, 4 * shots_between(4))
    for shot, close in zip(
        turntable_shots(ball, CAMERA, 4), fine[:: shots_between(4)], strict=True
    ):
        assert np.allclose(shot.camera.eye, close.camera.eye)


def test_frames_of_a_shape_turn_with_it(ball):
    other = make_surface(sphere(2).vertices * [1, 2, 1], sphere(2).faces)
    shots = turntable_shots([ball, other], CAMERA)
    assert [s.surface for s in shots] == [ball, other]
    assert np.allclose(shots[1].camera.eye, [0, 1, -3])
    with pytest.raises(ValueError, match="3 cameras for 2 frames"):
        turntable_shots([ball, other], CAMERA, 3)
    for wrong in (lambda: turntable_shots(ball, CAMERA), lambda: turntable_shots([], CAMERA)):
        with pytest.raises(ValueError, match="1 picture or more"):
            wrong()


def test_views_of_other_surfaces_are_their_own(ball):
    wide = make_surface(sphere(2).vertices * [2, 1, 1], sphere(2).faces)
    first, second = views_of_shots(path_shots([ball, wide], [CAMERA, CAMERA]))
    assert np.ptp(first.curves.xy[:, 1]) > 1.5 * np.ptp(second.curves.xy[:, 1])


def test_a_path_needs_a_camera_for_each_frame(ball):
    assert len(path_shots(ball, [CAMERA] * 4)) == 4
    with pytest.raises(ValueError, match="1 camera for 2 frames|1 cameras for 2 frames"):
        path_shots([ball, ball], [CAMERA])
    with pytest.raises(ValueError, match="1 camera or more"):
        path_shots(ball, [])
    small = fit_camera(ball.vertices, width=32, height=48)
    with pytest.raises(ValueError, match="camera 1: of 32 x 48 px, the first of 64 x 48"):
        path_shots(ball, [CAMERA, small])


def cameras_file(path, data):
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


@pytest.mark.parametrize("wrap", [list, lambda c: {"cameras": c}])
def test_cameras_are_read_as_camera_files_are(tmp_path, wrap):
    other = Camera([2, 1, 3], [0, 0, 0], [0, 1, 0], None, 64, 48, 2.0)
    data = wrap([CAMERA.to_dict(), {"camera": other.to_dict()}])
    found = load_cameras(cameras_file(tmp_path / "c.json", data))
    assert [c.to_dict() for c in found] == [CAMERA.to_dict(), other.to_dict()]


ONE = CAMERA.to_dict()


@pytest.mark.parametrize(
    "data, words",
    [
        ("", "not a list of cameras"),
        ("[1, 2", "not a list of cameras"),
        ("[" * 100000, "not a list of cameras"),
        (ONE, "one camera: a path is a JSON list"),
        ("3", "expected a JSON list of cameras"),
        ([], "no cameras in it"),
        ([ONE, 3], "camera 1: expected a JSON object"),
        ([ONE, ONE, {"eye": [0, 0, 1]}], "camera 2: no target, fov_y_deg, size in it"),
        ([{**ONE, "eye": ONE["target"]}], "camera 0: camera eye and target are the same point"),
        ([{**ONE, "fov_y_deg": "wide"}], "camera 0: "),
        ([ONE, {**ONE, "size": [64, 64]}], "camera 1: of 64 x 64 px, the first of 64 x 48"),
        ([ONE, {**ONE, "projection": "oblique"}], "camera 1: projection is 'oblique'"),
    ],
)
def test_a_wrong_path_is_one_line_that_names_file_and_place(tmp_path, data, words):
    path = cameras_file(tmp_path / "c.json", data)
    with pytest.raises(ValueError) as error:
        load_cameras(path)
    text = str(error.value)
    assert text.startswith(str(path)) and words in text and "\n" not in text


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "c.json").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ValueError, match="not a list of cameras"):
        load_cameras(tmp_path / "c.json")
    with pytest.raises(OSError):
        load_cameras(tmp_path / "none.json")


@pytest.mark.parametrize("wrap", [lambda c: c, lambda c: {"camera": c}])
def test_one_camera_is_not_a_path(tmp_path, wrap):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(wrap(CAMERA.to_dict())))
    with pytest.raises(ValueError, match=r"camera\.json: one camera: .*--camera"):
        load_cameras(path)
