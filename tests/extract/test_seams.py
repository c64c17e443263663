"""Bodies that touch: only what the eye sees as a fold or an outline is a line there."""

import numpy as np
import pytest
import shapes
import solids

from strokestyle.extract import seams
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.visible import look_along
from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.surface import make_surface


def of(solid, soup=False):
    if soup:
        return make_surface(*solid.soup)
    return make_surface(solid.vertices, solid.faces, polygon=solid.polygon)


def on_surface(surface, view="30,30", **options):
    """Length in the file's units of all hard lines from a side, hidden ones too."""
    lines = SurfaceLines(surface, LineOptions(kinds=("contour", "boundary", "crease"), **options))
    return stretches(surface, lines.seen_from(fit_camera(surface.vertices, view)))[1].sum()


def stretches(surface, curves):
    """Middles (n, 3) and lengths (n,) of the pieces of lines, in the file's units."""
    points = surface.original(curves.points(surface))
    inner = np.ones(len(points) - 1, bool)
    inner[curves.offsets[1:-1] - 1] = False
    ends = np.stack([points[:-1], points[1:]])[:, inner]
    return ends.mean(axis=0), np.linalg.norm(ends[1] - ends[0], axis=1)


def drawn(surface, view="30,30", size=768):
    curves = extract_view(
        surface, fit_camera(surface.vertices, view, width=size, height=size)
    ).curves
    return sum(float(np.hypot(*np.diff(curves[i], axis=0).T).sum()) for i in range(len(curves)))


VIEWS = ("30,30", "-60,20", "200,-35", "three-quarter")


@pytest.mark.parametrize("soup", [False, True])
@pytest.mark.parametrize("many", [(2, 1), (4, 1), (2, 2), (3, 3)])
def test_boxes_side_by_side_draw_as_one(many, soup):
    wall, one = solids.boxes(*many), solids.box((0, 0, 0), (*many, 1))
    for view in VIEWS:
        assert drawn(of(wall, soup), view) == pytest.approx(drawn(of(one, soup), view), rel=3e-3)


def test_a_stack_of_27_boxes():
    cube = solids.together(
        *(
            solids.box((i, j, k), (i + 1, j + 1, k + 1))
            for i in range(3)
            for j in range(3)
            for k in range(3)
        )
    )
    for view in VIEWS:
        assert drawn(of(cube), view) == pytest.approx(
            drawn(make_surface(*shapes.cube()), view), rel=3e-3
        )


@pytest.mark.parametrize("apart", [0.0, 1e-7, 3e-6])
def test_a_small_box_flush_on_the_side_of_a_big_one(apart):
    """Tops in one plane: the line ends where the small one stands, on either side of it. What is
    drawn is the union's: the big box's edges less 0.5 of one, the small one's less 0.5."""
    big, small = solids.box(), solids.box((1 + apart, 0.3, 0.25), (1.6, 1, 0.75))
    surface = of(solids.together(big, small))
    lines = SurfaceLines(surface, LineOptions(kinds=("crease",)))
    middle, length = stretches(surface, lines.seen_from(fit_camera(surface.vertices, "40,40")))
    seam = (np.abs(middle[:, 0] - 1) < 1e-4) & (np.abs(middle[:, 1] - 1) < 1e-4)
    assert length[seam].sum() == pytest.approx(0.5, abs=1e-4)
    on_seam = seam & (middle[:, 2] > 0.25) & (middle[:, 2] < 0.75)
    assert not on_seam.any()
    # where it stands on the side, below, there is a fold
    foot = (np.abs(middle[:, 0] - 1) < 1e-4) & (np.abs(middle[:, 1] - 0.3) < 1e-4)
    assert length[foot].sum() == pytest.approx(0.5, abs=1e-4)


def test_a_box_on_a_plate_has_a_line_of_contact():
    """Also one whose bottom is cut otherwise, and one in a corner of the plate, flush with it."""
    plate = solids.box((-2, -0.2, -2), (2, 0, 2))
    alone = drawn(of(plate), "30,40")
    for low in ((-0.5, 0, -0.5), (-0.3, 0, 0.2)):
        box = solids.box(low, np.add(low, 1))
        surface = of(solids.together(plate, box))
        contact = surface.original(surface.vertices[surface.edges].mean(axis=1))
        assert (np.abs(contact[:, 1]) < 1e-9).sum() >= 8
        camera = fit_camera(surface.vertices, "30,40")
        curves = extract_view(surface, camera).curves
        foot = np.array([[low[0], 0, low[2] + 1], [low[0] + 1, 0, low[2] + 1]])
        middle = camera.project((foot.mean(axis=0) - surface.centre)[None] / surface.scale)[0]
        assert np.hypot(*(curves.xy - middle).T).min() < 2.0
        assert drawn(surface, "30,40") > alone


@pytest.mark.parametrize("view", VIEWS)
def test_steps_of_boxes_side_by_side(view):
    """A stair of four boxes as the stair of one outline."""
    boxes = solids.together(*(solids.box((i, 0, 0), (i + 1, 1 + i, 2)) for i in range(4)))
    profile = [(0, 0), (4, 0), (4, 4), (3, 4), (3, 3), (2, 3), (2, 2), (1, 2), (1, 1), (0, 1)]
    front = np.array([(x, y, 2) for x, y in profile], float)
    n = len(profile)
    sides = [((i + 1) % n, i, n + i, n + (i + 1) % n) for i in range(n)]
    # the front as the four boxes have it, welded by T-junctions
    quads = [[(i, 0), (i + 1, 0), (i + 1, i + 1), (i, i + 1)] for i in range(4)]
    corner = np.array([(x, y, 2) for quad in quads for x, y in quad], float)
    ends = [tuple(2 * n + 4 * i + np.arange(4)) for i in range(4)]
    back = [tuple(2 * n + 16 + 4 * i + np.arange(4)[::-1]) for i in range(4)]
    vertices = np.vstack([front, front - [0, 0, 2], corner, corner - [0, 0, 2]])
    stair = solids.Solid(vertices, [*sides, *ends, *back])
    whole = of(stair)
    assert whole.closed_faces.all()
    assert drawn(of(boxes), view) == pytest.approx(drawn(whole, view), rel=5e-3)


def test_halves_of_a_ball():
    """Two closed hemispheres: the rim is no line, but where it is the outline."""
    n, m = 12, 48
    polar, around = 0.5 * np.pi * np.arange(1, n + 1) / n, 2 * np.pi * np.arange(m) / m
    ring = [
        np.sin(p) * np.column_stack([np.cos(around), around * 0, np.sin(around)]) for p in polar
    ]
    points = np.vstack([r + [0, np.cos(p), 0] for r, p in zip(ring, polar, strict=True)])
    points = np.vstack([points, [[0, 1, 0], [0, 0, 0]]])
    points[np.abs(points) < 1e-12] = 0.0
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n - 1), np.arange(m), indexing="ij"))
    a, b, k = i * m + j, i * m + (j + 1) % m, np.arange(m)
    after, last = (k + 1) % m, (n - 1) * m
    side = [np.column_stack([a, b, b + m]), np.column_stack([a, b + m, a + m])]
    side.append(np.column_stack([0 * k + n * m, after, k]))
    lid = np.column_stack([0 * k + n * m + 1, last + k, last + after])
    half = np.vstack([*side, lid])
    both = np.vstack([points, points * [1, -1, 1]])
    surface = make_surface(both, np.vstack([half, half[:, ::-1] + len(points)]))
    skin = np.vstack(side)
    whole = make_surface(both, np.vstack([skin, skin[:, ::-1] + len(points)]))
    assert surface.closed_faces.all() and whole.closed_faces.all()
    for view in ("30,40", "10,-20", "0,0"):
        assert drawn(surface, view) == pytest.approx(drawn(whole, view), rel=1e-2)


def test_a_solid_twice_is_drawn_once():
    """The same prism with its quads cut along the other diagonals; more sides than are merged."""
    one = solids.prism(20, 1.0)
    two = solids.Solid(one.vertices, [p[1:] + p[:1] for p in one.polygons])
    both, alone = of(solids.together(one, two)), of(one)
    assert len(np.unique(both.component)) == 2
    for view in VIEWS:
        assert on_surface(both, view) == pytest.approx(on_surface(alone, view), rel=1e-6)


def test_a_wall_welded_in_once_is_no_line():
    both = solids.boxes(2)
    unique, index = np.unique(both.vertices, axis=0, return_inverse=True)
    faces = index.ravel()[both.faces]
    once = faces[np.sort(np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1])]
    box = solids.box((0, 0, 0), (2, 1, 1))
    for view in VIEWS:
        assert drawn(make_surface(unique, once), view) == pytest.approx(
            drawn(of(box), view), rel=3e-3
        )


@pytest.mark.parametrize("angle, line", [(90, True), (50, True), (30, False), (0, False)])
def test_open_sheets_that_meet_without_sharing_a_vertex(angle, line):
    """Two squares, one cut in two, folded by an angle at their common side."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    one = solids.Solid(np.array([[-1, 0, 0], [0, 0, 0], [0, 0, 1], [-1, 0, 1.0]]), [(3, 2, 1, 0)])
    two = [
        [0, 0, 0],
        [c, -s, 0],
        [c, -s, 0.5],
        [0, 0, 0.5],
        [0, 0, 0.5],
        [c, -s, 0.5],
        [c, -s, 1],
        [0, 0, 1],
    ]
    two = solids.Solid(np.array(two, float), [(3, 2, 1, 0), (7, 6, 5, 4)])
    surface = of(solids.together(one, two))
    found = on_surface(surface, "45,60")
    assert found == pytest.approx(6.0 + (1.0 if line else 0.0), rel=1e-3)


def test_a_fin_and_a_flat_sheet():
    """A wall on a sheet: its foot is a line; a sheet that lies on another has one round it."""
    sheet = solids.Solid(
        np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1.0]]), [(3, 2, 1, 0)]
    )
    wall = solids.Solid(
        np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]), [(0, 1, 2, 3)]
    )
    assert on_surface(of(solids.together(sheet, wall))) == pytest.approx(8 + 3, rel=1e-3)


def test_edges_of_more_than_two_faces_need_a_fold():
    """Three sheets at an edge: two of one plane and one between: seen from the plane's other side
    there is no line; from the third's side there is."""
    v = np.array(
        [[-1, 0, 0], [-1, 0, 1], [0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 1], [0, 1, 0], [0, 1, 1]],
        float,
    )
    sheets = solids.Solid(v, [(0, 1, 3, 2), (2, 3, 5, 4), (2, 6, 7, 3)])
    surface = make_surface(v, sheets.faces)
    outline = 2 * (2 + 1) + (2 + 1)  # of the sheet, and of the fin but its foot
    assert on_surface(surface, "20,40") == pytest.approx(outline + 1)
    assert on_surface(surface, "20,-40") == pytest.approx(outline)


def test_the_angle_counts_at_seams():
    """Two wedges side by side whose tops are folded by 50 degrees."""
    drop = np.tan(np.radians(25))
    left = solids.box((-1, -2, 0), (0, 0, 1))
    left.vertices[(left.vertices[:, 0] < 0) & (left.vertices[:, 1] == 0), 1] = -drop
    right = solids.Solid(left.vertices * [-1, 1, 1], [p[::-1] for p in left.polygons])
    surface = of(solids.together(left, right))
    for crease, line in ((45, 1.0), (55, 0.0)):
        lines = SurfaceLines(surface, LineOptions(kinds=("crease",), crease=crease))
        curves = lines.seen_from(fit_camera(surface.vertices, "0,60"))
        middle, length = stretches(surface, curves)
        top = np.abs(middle)[:, :2].max(axis=1) < 1e-9
        assert length[top].sum() == pytest.approx(2.0 * line)  # of both, laid on each other


def test_seams_are_found_from_any_body_and_in_parallel_projection():
    wall = of(solids.boxes(3))
    camera = fit_camera(wall.vertices, "30,30", projection="parallel")
    whole = of(solids.box((0, 0, 0), (3, 1, 1)))
    one, two = (extract_view(s, camera).curves for s in (wall, whole))
    length = [
        sum(np.hypot(*np.diff(c[i], axis=0).T).sum() for i in range(len(c))) for c in (one, two)
    ]
    assert length[0] == pytest.approx(length[1], rel=3e-3)


def test_hidden_lines_too():
    wall, whole = of(solids.boxes(2)), of(solids.box((0, 0, 0), (2, 1, 1)))
    camera = fit_camera(wall.vertices, "30,30")
    one, two = (extract_view(s, camera, hidden=True).hidden for s in (wall, whole))
    length = [
        sum(np.hypot(*np.diff(c[i], axis=0).T).sum() for i in range(len(c))) for c in (one, two)
    ]
    assert length[0] == pytest.approx(length[1], rel=1e-2)


def test_what_touches_nothing_has_no_seams():
    for shape in (shapes.sphere(2), shapes.cube(), shapes.plane(), shapes.moebius()):
        assert len(SurfaceLines(make_surface(*shape)).seams) == 0
    apart = solids.together(solids.box(), solids.box((2, 0, 0), (3, 1, 1)))
    assert len(SurfaceLines(of(apart)).seams) == 0
    near = solids.together(solids.box(), solids.box((1.001, 0, 0), (2, 1, 1)))
    assert len(SurfaceLines(of(near)).seams) == 0


def test_few_are_asked_about_each_other(monkeypatch):
    """What is looked at grows with the bodies that touch, not with their square."""
    counts, plain = [], seams._touching
    for many in (8, 32):
        seen = []

        def counted(frame, row, *faces, seen=seen):
            seen.append(len(row))
            return plain(frame, row, *faces)

        monkeypatch.setattr(seams, "_touching", counted)
        len(SurfaceLines(of(solids.boxes(many))).seams)
        counts.append(sum(seen) / many)
    assert counts[1] < 1.3 * counts[0]


def test_an_eye_in_every_direction_sees_the_same_solid():
    """A seam on the outline of both boxes stays, whichever side the eye is on. Before tidying."""
    wall, whole = of(solids.boxes(2)), of(solids.box((0, 0, 0), (2, 1, 1)))
    lines = [SurfaceLines(s) for s in (wall, whole)]
    for around in range(0, 360, 24):
        for up in (-70, -5, 0.0, 40):
            camera = fit_camera(wall.vertices, f"{around},{up}", width=256, height=256)
            found = [
                look_along(own.surface, camera, own.seen_from(camera), own.bvh).fragments().curves
                for own in lines
            ]
            one, two = (curves.lengths().sum() for curves in found)
            assert one == pytest.approx(two, rel=5e-3), (around, up)


def test_in_a_heap_of_faces_few_are_asked_what_they_touch(monkeypatch):
    rng, asked = np.random.default_rng(0), []
    surface = make_surface(rng.normal(size=(900, 3)), np.arange(900).reshape(-1, 3))
    edge = np.flatnonzero(surface.edge_face_count == 1)
    touching = seams._touching
    monkeypatch.setattr(
        seams,
        "_touching",
        lambda frame, row, *rest: asked.append(len(row)) or touching(frame, row, *rest),
    )
    seams._contacts(surface, edge)
    assert sum(asked) > 0
    asked.clear()
    monkeypatch.setattr(seams, "NEAR_FLOOR", 0)
    monkeypatch.setattr(seams, "MAX_NEAR", 4)
    with pytest.warns(MeshWarning, match="seams of bodies that touch are drawn as edges"):
        assert not len(seams._contacts(surface, edge).row)
    assert not sum(asked)
