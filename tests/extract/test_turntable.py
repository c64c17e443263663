"""A turntable: the same shape seen once round, of one size on all pictures."""

import numpy as np
import pytest
import trimesh

from strokestyle.extract.camera import MARGIN
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.turntable import fit_turntable_camera, turntable
from strokestyle.mesh.surface import make_surface

BAR = trimesh.creation.box((3.0, 1.0, 0.5))


def test_views_go_round_in_equal_steps_and_the_first_is_the_cameras_own():
    surface = make_surface(BAR.vertices, BAR.faces)
    camera = fit_turntable_camera(surface.vertices, "20,10", 30.0, 160, 120)
    views = list(turntable(surface, camera, 4))
    assert views[0].camera == camera
    eyes = np.array([view.camera.eye - camera.target for view in views])
    x, y, z = eyes[0]
    # a quarter turn anticlockwise seen from above takes +z to +x
    np.testing.assert_allclose(
        eyes, [[x, y, z], [z, y, -x], [-x, y, -z], [-z, y, x]], atol=1e-9 * np.abs(eyes).max()
    )
    alone = extract_view(surface, views[1].camera)
    assert np.array_equal(alone.curves.xy, views[1].curves.xy)
    assert len({len(view.curves.xy) for view in views}) > 1  # it is another picture


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_shape_fits_however_it_is_turned(up):
    vertices = np.asarray(BAR.vertices)
    camera = fit_turntable_camera(vertices, "three-quarter", 40.0, 200, 200, up)
    seen = []
    for degrees in range(0, 360, 5):
        xy, depth = camera.turned(degrees).project(vertices)
        assert (depth > 0).all()
        seen.append([xy.min(), xy.max()])
    # the target lies a little beside the shape's own axis, so up to a third of the margin is used
    margin = MARGIN * 200
    assert np.min(seen) > 0.6 * margin and np.max(seen) < 200 - 0.6 * margin
    assert np.max(seen) - np.min(seen) > 200 - 2.2 * margin  # and no smaller than need be


def test_pictures_are_made_one_at_a_time_and_there_is_at_least_one():
    surface = make_surface(BAR.vertices, BAR.faces)
    camera = fit_turntable_camera(surface.vertices, width=64, height=64)
    assert next(turntable(surface, camera, 3000)).camera.width == 64
    with pytest.raises(ValueError, match="got 0"):
        turntable(surface, camera, 0)
