"""The lines of a shape that is cut open: what is left of the whole's, and the cut."""

import numpy as np
import pytest
import trimesh
from shapes import sphere, torus

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.pipeline import extract_view, view_of_curves
from strokestyle.extract.section_lines import cut_curves
from strokestyle.extract.surface_curves import SurfaceCurves
from strokestyle.extract.turntable import turntable
from strokestyle.extract.view_file import load_view, read_curves_json, save_view, view_to_json
from strokestyle.geometry.curves import KINDS, owner
from strokestyle.geometry.kinds import PRIORITY, SURFACE_KINDS
from strokestyle.mesh.planes import parse_section
from strokestyle.mesh.section import cut_open
from strokestyle.mesh.surface import make_surface

SECTION = KINDS.index("section")
BOX = trimesh.creation.box((1, 1, 1))
SIZE = 400


def surface_of(*meshes, inward=(), parts=False):
    faces, start = [], 0
    for i, mesh in enumerate(meshes):
        faces.append((mesh.faces[:, ::-1] if i in inward else mesh.faces) + start)
        start += len(mesh.vertices)
    part = np.repeat(np.arange(len(meshes)), [len(f) for f in faces])
    names = tuple(f"body {i}" for i in range(len(meshes)))
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    named = {"part": part, "part_names": names} if parts else {}
    return make_surface(vertices, np.concatenate(faces), **named)


def drawn(surface, *texts, view="isometric", hidden=False, options=None):
    camera = fit_camera(surface.vertices, view, 30.0, SIZE, SIZE)
    planes = [parse_section(text) for text in texts]
    left = cut_open(surface, planes, camera.viewpoint) if planes else surface
    return extract_view(left, camera, options, hidden=hidden)


def length(curves, *kinds):
    of = np.isin(curves.kind, [KINDS.index(kind) for kind in kinds])
    return curves.lengths()[of].sum()


def test_half_a_cube_in_isometric_projection():
    """The cut face is a rhombus of the side; each of its four sides is one line, a section."""
    side = (1 - 2 * 0.08) * SIZE / 2
    view = drawn(surface_of(BOX), "x:0", hidden=True)
    assert np.isclose(length(view.curves, "section"), 4 * side, rtol=0.01)
    # three long edges: one of the top's, one of the front's, and the inner one; and half ones
    rest = length(view.curves, "contour", "crease")
    assert np.isclose(rest, (2 + 3 * 0.5) * side, rtol=0.02)
    assert np.isclose(view.curves.lengths().sum(), rest + 4 * side, rtol=0.01)
    # the other way: the cut looks away, and its far sides are hidden
    view = drawn(surface_of(BOX), "-x:0", hidden=True)
    assert np.isclose(length(view.curves, "section"), 2 * side, rtol=0.02)
    assert np.isclose(length(view.hidden, "section"), 2 * side, rtol=0.02)


def test_the_cut_of_a_ball_is_a_circle_and_hides_what_lies_behind():
    ball = trimesh.Trimesh(*tuple(sphere(5)), process=False)
    surface = surface_of(ball, BOX.copy().apply_scale(0.2))  # a box within: it is not seen
    view = drawn(surface, "z:0.3", view="front")
    camera = view.camera
    assert {KINDS[kind] for kind in view.curves.kind} <= {"section", "contour"}
    cut = view.curves.take(view.curves.kind == SECTION)
    assert len(cut) == 1 and cut.closed.all()
    radius = np.sqrt(1.0 - 0.09) / surface.scale
    depth = camera.eye[2] - 0.3 / surface.scale
    away = np.hypot(*(cut.xy - SIZE / 2).T)
    assert np.allclose(away, radius * camera.focal / depth, atol=0.5)
    view = drawn(surface, "z:0", view="front")  # through the box: solid, each of its own
    assert (view.curves.kind == SECTION).sum() > 1


def test_one_looks_into_a_hollow_and_a_hole():
    hollow = surface_of(BOX, BOX.copy().apply_scale(0.6), inward=[1])
    solid = surface_of(BOX, BOX.copy().apply_scale(0.6))
    inside, filled = (drawn(s, "x:0", view="60,20") for s in (hollow, solid))
    assert np.isclose(length(inside.curves, "section"), length(filled.curves, "section"), rtol=0.01)
    # the far corners of the hollow are creases that are seen
    assert length(inside.curves, "crease") > length(filled.curves, "crease") + 200.0
    ring = drawn(surface_of(trimesh.creation.annulus(0.3, 0.5, 0.4)), "x:0", view="80,10")
    assert len({int(i) for i in np.flatnonzero(ring.curves.kind == SECTION)}) >= 2


def test_one_looks_into_a_room():
    """Its far corners are drawn, and what stands in it is solid."""
    room = BOX.copy().apply_scale(4.0)
    surface = surface_of(room, BOX.copy().apply_translation((-1, -1.5, -1)), inward=[0])
    view = drawn(surface, "+x:1.5", "+y:1.5", "+z:1.5", hidden=True)
    unit = (1 - 2 * 0.08) * SIZE / 2 / 4
    # three inner edges less what the box covers, and nine of the box itself
    assert np.isclose(length(view.curves, "section"), 6 * 3.5 * unit, rtol=0.01)
    inner = length(view.curves, "contour", "crease", "boundary")
    assert np.isclose(inner, (3 * 3.5 + 9.0 - 1.0) * unit, atol=1.6 * unit)
    assert length(view.hidden, "crease", "contour") < 6.0 * unit


def test_lines_of_the_whole_stay_what_they_are_as_far_as_they_are_left():
    """All kinds, raw: each point left lies on a line of the whole, and none is lost below."""
    vertices, faces = torus(64, 32)
    surface = make_surface(vertices + 0.03 * np.sin(7 * vertices[:, ::-1]), faces)
    camera = fit_camera(surface.vertices, "30,30", 30.0, SIZE, SIZE)
    options = LineOptions(SURFACE_KINDS)
    whole = SurfaceLines(surface, options).seen_from(camera)
    planes = [parse_section("x:0.05"), parse_section("-y:-0.1")]
    left = cut_open(surface, planes, camera.viewpoint)
    found = SurfaceLines(left, options).seen_from(camera)
    lines = found.take(found.kind != SECTION)
    points, before = lines.points(left), whole.points(surface)
    from scipy.spatial import cKDTree

    under = np.all([plane.height(before) < 0 for plane in left.section.planes], axis=0)
    assert cKDTree(points).query(before[under])[0].max() < 1e-9
    on_plane = np.any([plane.height(points) == 0 for plane in left.section.planes], axis=0)
    assert cKDTree(before).query(points[~on_plane])[0].max() < 1e-9
    assert np.all([plane.height(points) <= 0 for plane in left.section.planes])

    def total(curves, place):
        step = np.linalg.norm(np.diff(place, axis=0), axis=1)
        same = np.diff(owner(curves.offsets)) == 0
        return np.bincount(curves.kind[owner(curves.offsets)][:-1][same], step[same], len(KINDS))

    # and no length is lost or made: sample the whole densely and count what lies below
    t = (np.arange(64) + 0.5) / 64
    row = np.flatnonzero(np.diff(owner(whole.offsets)) == 0)
    step = before[row + 1] - before[row]
    dense = before[row, None] + t[:, None] * step[:, None]
    share = np.all([plane.height(dense.reshape(-1, 3)) < 0 for plane in left.section.planes], 0)
    weight = np.linalg.norm(step, axis=1) * share.reshape(len(row), -1).mean(axis=1)
    expected = np.bincount(whole.kind[owner(whole.offsets)][row], weight, len(KINDS))
    assert np.allclose(total(lines, points), expected, atol=2e-3)
    assert (expected > 0).sum() >= 3


def test_an_edge_in_the_plane_is_drawn_once():
    """Two bodies that share a plane: the cut takes one away, and nothing of the other."""
    low = trimesh.creation.box((2, 1, 1))
    high = trimesh.creation.box((1, 1, 1)).apply_translation((-0.5, 1, 0))
    vertices = np.concatenate([low.vertices, high.vertices])
    surface = make_surface(vertices, np.concatenate([low.faces, high.faces + 8]))
    camera = fit_camera(surface.vertices, "isometric", 30.0, SIZE, SIZE)
    left = cut_open(surface, [parse_section("y:0.5")], camera.viewpoint)
    assert len(left.faces) == 12 and not len(left.section.rim)
    view = extract_view(left, camera)
    assert {KINDS[kind] for kind in view.curves.kind} == {"contour", "crease"}
    alone = extract_view(surface.with_faces(np.arange(24) < 12), camera)
    assert np.isclose(view.curves.lengths().sum(), alone.curves.lengths().sum(), rtol=0.01)


def test_lines_that_run_on_through_a_vertex_in_the_plane_end_there():
    octahedron = trimesh.Trimesh(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
        process=False,
    )
    surface = surface_of(octahedron)
    camera = fit_camera(surface.vertices, "30,30")
    left = cut_open(surface, [parse_section("+z:0")], camera.viewpoint)
    found = SurfaceLines(left, LineOptions(("crease", "section"))).seen_from(camera)
    place, step = found.points(left), np.diff(owner(found.offsets)) == 0
    length = np.linalg.norm(np.diff(place, axis=0), axis=1)[step] * surface.scale
    kind = found.kind[owner(found.offsets)][:-1][step]
    for name in ("crease", "section"):
        assert np.isclose(length[kind == KINDS.index(name)].sum(), 4 * np.sqrt(2))
    assert place[:, 2].max() < 1e-9
    # and where the face of a line's last point is that of the piece which went
    here = surface.vertices[surface.faces]
    upper = int(np.flatnonzero((here[..., 0].max(1) > 0) & (here[..., 2].max(1) > 0))[0])
    lower = int(np.flatnonzero((here[..., 0].max(1) > 0) & (here[..., 2].min(1) < 0))[0])
    corner = np.eye(3)[
        [here[lower, :, 2].argmin(), here[upper, :, 0].argmax(), here[upper, :, 2].argmax()]
    ]
    line = SurfaceCurves([lower, upper, upper], corner, [0, 3], [0], [False], np.ones(3))
    ends = surface.original(cut_curves(left, line).points(left))
    assert np.allclose(ends, [[0, 0, -1], [1, 0, 0]])


@pytest.mark.parametrize("offset", ["0.5", "0.2"])
def test_one_l_shaped_body_cut_at_its_step(offset):
    corners = np.array([(0, 0), (1, 0), (1, 0.5), (0.5, 0.5), (0.5, 1), (0, 1)], float)
    points = np.concatenate([np.c_[corners, np.zeros(6)], np.c_[corners, np.ones(6)]])
    flat = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 4], [0, 4, 5]])
    i, j = np.arange(6), (np.arange(6) + 1) % 6
    walls = np.concatenate([np.stack([i, j, j + 6], 1), np.stack([i, j + 6, i + 6], 1)])
    surface = make_surface(points, np.concatenate([flat[:, ::-1], flat + 6, walls]))
    view = drawn(surface, f"y:{offset}")
    unit = np.hypot(*(view.camera.project(np.array([[0, 0, 0], [0, 1.0, 0]]))[0][1] - SIZE / 2))
    unit = view.camera.focal / surface.scale * np.sqrt(2 / 3)
    wide = 0.5 if offset == "0.5" else 1.0  # at the step only what is cut has a rim
    assert np.isclose(length(view.curves, "section"), 2 * (wide + 1.0) * unit, rtol=0.02)
    # where the riser stood there is the rim, and no crease any more
    left = cut_open(surface, [parse_section(f"y:{offset}")], view.camera.viewpoint)
    found = SurfaceLines(left).seen_from(view.camera)
    found = found.take(found.kind != SECTION)
    place = surface.original(found.points(left))
    inner = np.abs(place[:, :2] - 0.5).max(axis=1) < 1e-9
    assert not (inner[1:] & inner[:-1] & (np.diff(owner(found.offsets)) == 0)).any()


def test_the_camera_and_what_is_drawn_where_nothing_was_cut_stay():
    surface = surface_of(BOX, BOX.copy().apply_translation((3, 0, 0)), parts=True)
    whole, left = drawn(surface, view="front"), drawn(surface, "+x:3", view="front")
    assert whole.camera.to_dict() == left.camera.to_dict()
    parts = [view.curve_parts for view in (whole, left)]
    assert set(parts[0].names) == set(parts[1].names)
    first = [
        view.curves.lengths()[view.curve_parts.index == view.curve_parts.names.index("body 0")]
        for view in (whole, left)
    ]
    assert np.allclose(np.sort(first[0]), np.sort(first[1]))
    at = left.curve_parts.names.index("body 1")
    assert (left.curve_parts.index[left.curves.kind == SECTION] == at).all()


def test_turntables_curves_of_others_and_files(tmp_path):
    surface = surface_of(BOX)
    camera = fit_camera(surface.vertices, "isometric", 30.0, 128, 128)
    left = cut_open(surface, [parse_section("x:0")], camera.viewpoint)
    views = list(turntable(left, camera, 3))
    assert all((view.curves.kind == SECTION).any() for view in views[:1])
    again = view_of_curves(left, camera, views[0].curves)
    assert again.maps.covered.sum() == views[0].maps.covered.sum()
    save_view(tmp_path / "v.npz", views[0])
    assert np.array_equal(load_view(tmp_path / "v.npz").curves.kind, views[0].curves.kind)
    import json

    text = json.dumps(view_to_json(views[0])).encode()
    assert "section" in view_to_json(views[0])["kinds"]
    assert np.array_equal(read_curves_json(text, (128, 128)).kind, views[0].curves.kind)


def test_the_kind_may_be_left_out_or_be_alone():
    surface = surface_of(BOX)
    only = drawn(surface, "x:0", options=LineOptions(("section",)))
    assert {KINDS[kind] for kind in only.curves.kind} == {"section"}
    none = drawn(surface, "x:0", options=LineOptions(("contour", "crease")))
    assert SECTION not in none.curves.kind and len(none.curves)
    assert PRIORITY[0] == "section" and set(PRIORITY) == set(KINDS)


def test_no_lines_are_no_lines():
    surface = surface_of(BOX)
    left = cut_open(surface, [parse_section("x:0")], np.array([0, 0, 1.0, 0.0]))
    empty = SurfaceLines(surface, LineOptions(())).seen_from(fit_camera(surface.vertices))
    assert not len(cut_curves(left, empty))
    assert not len(SurfaceLines(left, LineOptions(())).seen_from(fit_camera(surface.vertices)))
