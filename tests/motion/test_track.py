"""Lines that are followed through frames: closed forms of solids that turn, and odd animations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.turntable import fit_turntable_camera
from strokestyle.mesh.surface import make_surface
from strokestyle.motion.frames import Shot
from strokestyle.motion.track import track_frames
from tests.shapes import cube, grid, sphere
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


def edge_points():
    """Points on the twelve edges of a cube of side 1, (n, 3)."""
    t, out = np.linspace(-0.5, 0.5, 200), []
    for axis in range(3):
        for corner in ((-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)):
            out.append(np.insert(np.tile(corner, (len(t), 1)), axis, t, axis=1))
    return np.concatenate(out)


def test_each_edge_of_a_turning_cube_keeps_its_stroke_and_its_places(box):
    shots = turned(box, np.arange(0, 16, 4))
    frames = tracked(shots, options=LineOptions(kinds=("crease",)))
    seen = [lines(frame) for frame in frames]
    assert all(set(one) == set(seen[0]) for one in seen) and len(seen[0]) >= 5
    marks = [shot.camera.project(edge_points())[0] for shot in shots]
    for k in range(1, len(shots)):
        for track, (xy, place) in seen[k].items():
            was, there = seen[k - 1][track]
            assert np.hypot(*(xy[0] - was[0])) < 0.1 * SIZE  # it is not drawn the other way
            rise = np.diff(place) / np.hypot(*np.diff(xy, axis=0).T)
            assert rise.min() > 0.85 and np.quantile(rise, 0.95) < 1.17  # more only at corners
            # the same points of the cube have the same places on the whole
            found = [cKDTree(p).query(m) for p, m in ((was, marks[k - 1]), (xy, marks[k]))]
            both = (found[0][0] < 2.0) & (found[1][0] < 2.0)
            assert abs(np.mean(place[found[1][1]][both] - there[found[0][1]][both])) < 2.0


def behind_a_wall(shift):
    """A sheet that is folded once, and before it a wall, moved to the right by `shift`."""
    n = 21
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    sheet = np.stack([x, y, -0.8 * np.abs(x)], axis=-1).reshape(-1, 3)
    wall = np.array([[-0.25, -2, 0.5], [0.25, -2, 0.5], [0.25, 2, 0.5], [-0.25, 2, 0.5]])
    faces = np.concatenate([grid(n, n), n * n + np.array([[0, 1, 2], [0, 2, 3]])])
    vertices = np.concatenate([sheet, wall + [shift, 0, 0], [[-4, 0, 0], [4, 0, 0]]])
    return make_surface(vertices, faces)


def test_what_is_hidden_and_seen_again_is_the_same_stroke_at_the_same_places():
    camera = Camera([0, 0, 2], [0, 0, 0], [0, 1, 0], 30.0, SIZE, SIZE)
    shots = [Shot(behind_a_wall(shift), camera) for shift in np.linspace(-0.6, 0.6, 9)]
    frames = tracked(shots, options=LineOptions(kinds=("crease",)))
    drawn = [len(frame.planned) for frame in frames]
    assert drawn == [1, 1, 0, 0, 0, 0, 0, 1, 1] or drawn == [1, 1, 1, 0, 0, 0, 1, 1, 1]
    (first,), (last,) = lines(frames[0]).items(), lines(frames[-1]).items()
    assert first[0] == last[0]
    assert np.allclose(first[1][1], last[1][1], atol=1.0)
    assert np.allclose(first[1][0], last[1][0], atol=1.0)


def test_no_shots_make_no_frames():
    assert tracked([]) == [] and tracked([], loop=True) == []


@pytest.mark.parametrize("loop", [False, True])
def test_one_shot_makes_the_strokes_of_a_still(box, loop):
    (frame,) = tracked(turned(box, [0.0]), loop=loop)
    assert len(frame.planned) >= 5 and (frame.presence == 1.0).all()


@pytest.mark.parametrize("projection", ["perspective", "parallel"])
def test_a_shape_may_leave_the_canvas_and_come_back(box, projection):
    camera = fit_camera(box.vertices, "front", width=SIZE, height=SIZE, projection=projection)
    shots = []
    for aside in (0.0, 1.0, 4.0, 1.0, 0.0):
        move = np.array([aside, 0.0, 0.0])
        moved = replace(camera, eye=camera.eye + move, target=camera.target + move)
        shots.append(Shot(box, moved))
    frames = tracked(shots)
    counts = [len(frame.planned) for frame in frames]
    assert counts[2] == 0 and counts[0] and counts[-1]
    for frame in frames:
        on = frame.planned.xy[frame.planned.on_curve]
        assert ((on > -3.0) & (on < SIZE + 3.0)).all()


def test_behind_a_cut_all_is_new_and_nothing_grows(box):
    shots = turned(box, [0.0, 2.0])
    far = fit_camera(box.vertices, "top", width=SIZE, height=SIZE)
    shots += [Shot(box, replace(far, target=far.target + [0.3, 0, 0.3])), shots[0]]
    frames = tracked(shots[:2] + [shots[2], shots[2]])
    assert all((frame.presence == 1.0).all() for frame in frames)
    assert not set(frames[1].track) & set(frames[2].track)
    assert set(frames[2].track) == set(frames[3].track)


def test_a_shape_that_bends_keeps_its_strokes(box):
    vertices, faces = cube(6)
    shots = []
    camera = fit_camera(box.vertices, width=SIZE, height=SIZE)
    for bend in np.linspace(0.0, 0.15, 4):
        x, y, z = vertices.T
        bent = np.stack([x + bend * y * y, y, z], axis=1)
        shots.append(Shot(make_surface(bent, faces), camera))
    frames = tracked(shots, options=LineOptions(kinds=("crease", "contour")))
    assert all(set(frame.track) == set(frames[0].track) for frame in frames)


def test_a_turn_closes(ball):
    """The outline of an ellipsoid that goes once round swells and shrinks, and is one stroke."""
    vertices, faces = sphere(3)
    egg = make_surface(vertices * [1.0, 0.8, 0.6], faces)
    count = 24
    shots = turned(egg, 360.0 / count * np.arange(count))
    frames = tracked(shots, options=LineOptions(kinds=("contour",)), loop=True)
    assert {int(t) for frame in frames for t in frame.track} == {int(frames[0].track[0])}
    places = [next(iter(lines(frame).values()))[1] for frame in frames]
    middle = np.array([place.mean() for place in places])
    step = np.abs(np.diff(np.r_[middle, middle[0]]))
    assert step[-1] <= 2.0 * max(step[:-1].max(), 3.0)  # the seam is a step like others
