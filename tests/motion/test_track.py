"""Lines that are followed through frames: closed forms of solids that turn, and odd animations."""

from dataclasses import replace

import numpy as np
import pytest

from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.turntable import fit_turntable_camera
from strokestyle.geometry.kinds import KINDS
from strokestyle.mesh.surface import make_surface
from strokestyle.motion.frames import Shot
from strokestyle.motion.track import track_frames
from tests.shapes import cube, sphere
from tests.small_styles import plain_style

SIZE = 256


def surface_of(vertices, faces, **options):
    return make_surface(vertices, faces, **options)


def turned(surface, angles, size=SIZE, view="three-quarter"):
    camera = fit_turntable_camera(surface.vertices, view, width=size, height=size)
    return [Shot(surface, camera.turned(angle)) for angle in angles]


def tracked(shots, size=SIZE, **options):
    return track_frames(shots, plain_style(size), **options)


def lines(frame):
    """Of each track the points of its line, and their places."""
    planned, out = frame.planned, {}
    for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
        on = planned.on_curve[a:b]
        out[int(frame.track[i])] = (planned.xy[a:b][on], frame.place[a:b][on])
    return out


@pytest.fixture(scope="module")
def ball():
    return surface_of(*sphere(4))


@pytest.fixture(scope="module")
def box():
    return surface_of(*cube(6))


def test_the_outline_of_a_sphere_is_one_stroke_in_all_frames(ball):
    frames = tracked(turned(ball, np.arange(0, 60, 10)), options=LineOptions(kinds=("contour",)))
    assert [len(frame.planned) for frame in frames] == [1] * 6
    assert {int(frame.track[0]) for frame in frames} == {int(frames[0].track[0])}
    starts = []
    for frame in frames:
        ((xy, place),) = lines(frame).values()
        assert np.abs(xy[0] - xy[-1]).max() < 4.0  # all the way round
        assert (np.diff(place) > 0).all() and abs(np.ptp(place) / 3.0 - len(xy) + 1) < 12
        starts.append(xy[0])
    assert np.ptp(starts, axis=0).max() < 12.0  # and it begins where it began
