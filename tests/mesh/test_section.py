"""Cutting surfaces open, in closed form: volumes, caps, rims, and what must not be a crash."""

import numpy as np
import pytest
import trimesh
from shapes import moebius, sphere, torus

from strokestyle.mesh.curvature import differential_geometry
from strokestyle.mesh.cut_mesh import FIELDS
from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.planes import SectionPlane, parse_section
from strokestyle.mesh.section import _cubic, _form, cut_open
from strokestyle.mesh.surface import make_surface

pytestmark = pytest.mark.filterwarnings("ignore::strokestyle.mesh.messages.MeshWarning")

EYE = np.array([1.0, 2.0, 3.0, 0.0])  # at infinity: the nearer side is that of the axes' tips
BOX = trimesh.creation.box((1, 1, 1))


def surface_of(*meshes, inward=(), parts=False):
    """One surface of several meshes; `inward` ones are wound the other way round."""
    faces, start = [], 0
    for i, mesh in enumerate(meshes):
        turned = mesh.faces[:, ::-1] if i in inward else mesh.faces
        faces.append(turned + start)
        start += len(mesh.vertices)
    part = np.repeat(np.arange(len(meshes)), [len(f) for f in faces])
    names = tuple(f"body {i}" for i in range(len(meshes)))
    return make_surface(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(faces),
        **({"part": part, "part_names": names} if parts else {}),
    )


def moved(mesh, *shift):
    return mesh.copy().apply_translation(shift)


def cut(surface, *texts):
    return cut_open(surface, [parse_section(text) for text in texts], EYE)


def measures(surface):
    """Volume, area of the caps and length of the rim, in the file's units."""
    corner = surface.original(surface.vertices.reshape(-1, 3))[surface.faces]
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    volume = (np.cross(a, b) * c).sum() / 6.0
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)[surface.section.source < 0].sum()
    ends = surface.original(surface.vertices)[surface.edges[surface.section.rim]]
    return volume, area, np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()


def ell():
    """An L of thickness 1 in x and y, 2 wide and 2 high, 1 deep: a step at y = 1."""
    corners = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], float)
    points = np.concatenate([np.c_[corners, np.zeros(6)], np.c_[corners, np.ones(6)]])
    flat = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 4], [0, 4, 5]])
    i = np.arange(6)
    j = (i + 1) % 6
    walls = np.concatenate([np.stack([i, j, j + 6], 1), np.stack([i, j + 6, i + 6], 1)])
    return trimesh.Trimesh(points, np.concatenate([flat[:, ::-1], flat + 6, walls]), process=False)


@pytest.mark.parametrize(
    "texts, volume, area, rim",
    [
        (["x:0"], 0.5, 1.0, 4.0),
        (["x:25%"], 0.25, 1.0, 4.0),
        (["-x:25%"], 0.75, 1.0, 4.0),
        (["+y:0.3"], 0.8, 1.0, 4.0),
        (["z:0.1", "x:0.2"], 0.6 * 0.7, 0.7 + 0.6, 2 * (1 + 0.7) + 2 * (1 + 0.6) - 1),
        (["x:0", "y:0", "z:0"], 0.125, 0.75, 4.5),
    ],
)
def test_a_cut_box(texts, volume, area, rim):
    left = cut(surface_of(BOX), *texts)
    assert np.allclose(measures(left), (volume, area, rim))
    assert left.closed_faces.all() and not left.clashing_edges.any()
    assert len(left.section.planes) == len(texts)


def test_a_cap_lies_in_its_plane_looks_beyond_it_and_is_flat():
    left = cut(surface_of(trimesh.creation.icosphere(3)), "-y:0.25")
    cap = np.unique(left.faces[left.section.source < 0])
    assert np.ptp(left.original(left.vertices[cap])[:, 1]) < 1e-12
    assert np.array_equal(left.normals[cap], np.tile([0.0, -1.0, 0.0], (len(cap), 1)))
    assert not left.k1[cap].any() and not left.dcurv[cap].any()
    assert np.allclose(np.cross(left.pdir1, left.pdir2), left.normals)
    faces = left.face_normals[left.section.source < 0]
    assert np.allclose(faces, [0, -1, 0])


def test_walls_show_their_thickness_and_holes_stay_holes():
    ring = surface_of(trimesh.creation.annulus(0.3, 0.5, 0.4, sections=256))
    _, area, rim = measures(cut(ring, "z:0"))
    assert np.isclose(area, np.pi * (0.25 - 0.09), rtol=1e-3)
    assert np.isclose(rim, np.pi * (1.0 + 0.6), rtol=1e-3)
    _, area, rim = measures(cut(ring, "x:0"))
    assert np.isclose(area, 2 * 0.2 * 0.4) and np.isclose(rim, 2 * 2 * (0.2 + 0.4))


BALLS = [trimesh.creation.icosphere(4, radius) for radius in (1.0, 0.6, 0.3)]


def test_a_body_wound_the_other_way_than_the_one_around_it_is_a_hollow():
    """And a body within the hollow is solid."""
    whole = surface_of(*BALLS, inward=[1])
    left = cut(whole, "x:0.1")
    flat = [np.pi * (r * r - 0.01) for r in (1.0, 0.6, 0.3)]
    assert np.isclose(measures(left)[1], flat[0] - flat[1] + flat[2], rtol=0.01)
    assert left.closed_faces.all() and not left.clashing_edges.any()
    # the hollow's normals point into it, with all that is measured along them
    before = whole.component == whole.component[-len(BALLS[2].faces) - 1]
    hollow = left.section.whole.faces[before]
    assert (left.section.whole.k1[hollow] < 0).all() and (whole.k1[whole.faces[before]] > 0).all()
    out = left.section.whole
    assert np.allclose(np.cross(out.pdir1, out.pdir2), out.normals)


@pytest.mark.filterwarnings("error")  # a room is meant to be open
def test_a_body_wound_inward_round_others_is_a_room_and_alone_it_is_solid():
    left = cut(surface_of(*BALLS[:2], inward=[0]), "x:0.1")
    assert np.isclose(measures(left)[1], np.pi * 0.35, rtol=0.01)  # of what stands in it
    cap = left.section.source < 0
    room = left.component == left.component[0]
    assert not (room & cap).any() and not left.closed_faces[room].any()
    assert np.isclose(measures(left)[2], 2 * np.pi * (np.sqrt(0.99) + np.sqrt(0.35)), rtol=0.01)
    for inward in ([0], [0, 1]):  # a file that is inside out altogether
        left = cut(surface_of(*BALLS[: len(inward)], inward=inward), "x:0.1")
        assert left.closed_faces.all()


def test_bodies_wound_alike_are_solid_each_and_of_their_own_part():
    left = cut(surface_of(*BALLS[:2], parts=True), "x:0.1")
    flat = [np.pi * (r * r - 0.01) for r in (1.0, 0.6)]
    assert np.isclose(measures(left)[1], sum(flat), rtol=0.01)
    cap = left.section.source < 0
    for part in (0, 1):
        only = cut(surface_of(BALLS[part]), "x:0.1")
        assert (cap & (left.part == part)).sum() == (only.section.source < 0).sum()
    assert left.part_names == ("body 0", "body 1")


def test_overlapping_and_separate_bodies_are_cut_each_for_itself():
    left = cut(surface_of(BOX, moved(BOX, 0.5, 0.5, 0.1), moved(BOX, 0, 0, 2)), "z:0.05")
    volume, area, rim = measures(left)
    assert np.allclose((volume, area, rim), (0.55 + 0.45, 2.0, 8.0))
    assert left.component.max() == 1  # the third is gone


@pytest.mark.parametrize(
    "texts, volume, area",
    [
        (["y:1"], 2.0, 1.0),  # through the step: its tread stays, only what is cut is capped
        (["-y:1"], 1.0, 1.0),
        (["x:1"], 2.0, 1.0),
        (["-x:1"], 1.0, 1.0),
        (["y:1.5"], 2.5, 1.0),
        (["z:0.5"], 1.5, 3.0),
        (["y:1", "z:0.5"], 1.0, 2.0 + 0.5),
    ],
)
def test_planes_through_faces_edges_and_vertices(texts, volume, area):
    left = cut(surface_of(ell()), *texts)
    assert np.allclose(measures(left)[:2], (volume, area))
    assert left.closed_faces.all() and not left.clashing_edges.any()


def test_the_rim_of_a_step_is_that_of_what_is_cut():
    assert np.isclose(measures(cut(surface_of(ell()), "y:1"))[2], 4.0)


def test_a_plane_through_vertices_alone():
    octahedron = trimesh.Trimesh(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
    )
    for axis in "xyz":
        volume, area, rim = measures(cut(surface_of(octahedron), f"{axis}:0"))
        assert np.allclose((volume, area, rim), (2 / 3, 2.0, 4 * np.sqrt(2)))
    # two that touch at a point, and a third whose tip only touches the plane from below
    pair = surface_of(octahedron, moved(octahedron, 2, 0, 0), moved(octahedron, 0, 5, -1))
    volume, area, _ = measures(cut(pair, "z:0"))
    assert np.allclose((volume, area), (2 * 2 / 3 + 4 / 3, 4.0))


def test_open_surfaces_are_cut_without_a_cap():
    bowl = trimesh.creation.icosphere(4)
    bowl = trimesh.Trimesh(bowl.vertices, bowl.faces[bowl.triangles_center[:, 1] < 0.2])
    with pytest.warns(MeshWarning, match="open where it is cut"):
        left = cut(surface_of(bowl), "x:0")
    assert (left.section.source >= 0).all() and not left.closed_faces.any()
    _, _, rim = measures(left)
    assert np.isclose(rim, np.pi + 2 * np.arcsin(0.2), atol=0.05)
    # a sheet that ends in the plane was not cut there
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    both = surface_of(sheet, moved(sheet, 0.5, 0, 1))
    left = cut(both, "x:1")
    rim = left.original(left.vertices)[left.edges[left.section.rim]]
    assert len(rim) == 2 and np.allclose(rim[..., 2], 1.0)  # two faces of the other sheet


def test_normals_and_curvatures_stay_and_are_those_of_the_surface_at_the_cut():
    shape = trimesh.creation.torus(1.0, 0.4, 64, 32)
    whole = surface_of(shape)
    left = cut(whole, "x:0.123", "y:0.05")
    old = left.section.origin >= 0
    for name in ("vertices", "normals", "k1", "k2", "dcurv"):
        assert np.array_equal(
            getattr(left, name)[old], getattr(whole, name)[left.section.origin[old]]
        )
    new = np.setdiff1d(np.flatnonzero(~old), left.faces[left.section.source < 0])
    assert len(new) > 40
    place = left.original(left.vertices[new])
    ring = np.hypot(place[:, 0], place[:, 1])
    centre = place * [1, 1, 0] / ring[:, None]
    normal = (place - centre) / np.linalg.norm(place - centre, axis=1)[:, None]
    assert ((left.normals[new] * normal).sum(axis=1) > 0.998).all()
    round_axis = (normal * centre).sum(axis=1) / ring  # a torus in closed form; 1 / 0.4 the other
    found = np.sort(np.stack([left.k1[new], left.k2[new]]) / left.scale, axis=0)
    assert np.allclose(found, np.sort([np.full(len(new), 2.5), round_axis], axis=0), atol=0.12)
    assert (np.abs(left.k1) >= np.abs(left.k2) - 1e-9).all()
    assert np.allclose(np.cross(left.pdir1, left.pdir2), left.normals, atol=1e-9)


def test_the_larger_curvature_comes_first_whatever_its_sign():
    whole = surface_of(trimesh.creation.torus(1.0, 0.4, 64, 32))
    inside_out = whole.turned_over(np.ones(len(whole.faces), bool))
    for surface in (whole, inside_out):
        left = cut(surface, "x:0.123")
        assert (np.abs(left.k1) >= np.abs(left.k2) - 1e-9).all()
        assert np.allclose(np.cross(left.pdir1, left.pdir2), left.normals, atol=1e-9)


def test_a_surface_turned_over_is_what_is_measured_on_its_faces_turned_over():
    """Tensors in space: principal directions have no sign of their own."""
    vertices, faces = torus(48, 24)
    surface = make_surface(vertices + 0.05 * np.sin(5 * vertices[:, ::-1]), faces)
    turned = surface.turned_over(np.ones(len(faces), bool))
    measured = differential_geometry(turned.vertices, turned.faces)._asdict()
    ours = {name: getattr(turned, name) for name in FIELDS}
    assert np.allclose(ours["normals"], measured["normals"])
    assert np.allclose(np.cross(turned.pdir1, turned.pdir2), turned.normals)
    for tensor in (_form, _cubic):
        assert np.allclose(tensor(ours), tensor(measured), atol=1e-6)
        assert np.abs(tensor(ours)).max() > 1.0
    assert turned.turned.all() and np.array_equal(turned.faces, surface.faces[:, ::-1])


@pytest.mark.parametrize("seed", range(8))
def test_triangle_soups_of_all_kinds_never_crash(seed):
    """Edges of many faces, clashing windings, slivers, coplanar and repeated faces."""
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 4, (24, 3)).astype(float)  # on a grid: planes run through vertices
    faces = rng.integers(0, 24, (60, 3))
    boxes = [moved(BOX, *rng.integers(0, 3, 3)) for _ in range(4)]  # share faces, edges, corners
    vertices = np.concatenate([points, *[box.vertices + 0.5 for box in boxes]])
    start = 24 + 8 * np.arange(4)
    faces = np.concatenate([faces, *[b.faces + s for b, s in zip(boxes, start, strict=True)]])
    for soup in (faces, faces[60:]):
        surface = make_surface(vertices, soup)
        for texts in (["x:1"], ["y:2", "x:2"], ["z:1.5"], ["-x:1", "-y:1", "-z:1"]):
            try:
                left = cut(surface, *texts)
            except ValueError as error:
                assert "misses it" in str(error)
                continue
            reach = left.original(left.vertices)[left.faces].reshape(-1, 3)
            for plane in left.section.planes:
                assert (plane.height(left.vertices[left.faces].reshape(-1, 3)) <= 0.0).all()
            assert np.isfinite(reach).all()


def test_a_band_of_one_side_is_cut_without_a_cap():
    band = moebius()
    left = cut(make_surface(*band), "x:10%")
    assert (left.section.source >= 0).all() and len(left.section.rim)


def test_cutting_again_cuts_the_caps_too():
    left = cut(surface_of(trimesh.Trimesh(*tuple(sphere(4)))), "x:0", "y:0", "z:0")
    volume, area, rim = measures(left)
    assert np.isclose(volume, np.pi / 6, rtol=0.01)
    assert np.isclose(area, 3 * np.pi / 4, rtol=0.01)
    assert np.isclose(rim, 3 * np.pi / 2 + 3, rtol=0.01)


def test_the_side_nearer_to_the_eye_goes_unless_the_sign_says_which():
    surface = surface_of(BOX)
    for eye, below in (
        ([0, 0, 5.0], True),
        ([0, 0, -5.0], False),
        ([0, 0, 0.1], False),  # between the plane and the middle
        ([0.0, 0.0, 1.0, 0.0], True),
        ([0.0, 0.0, -1.0, 0.0], False),
    ):
        left = cut_open(surface, [SectionPlane(2, 0.2)], np.array(eye))
        assert np.isclose(measures(left)[0], 0.7 if below else 0.3)
    for side, volume in ((1, 0.7), (-1, 0.3)):
        left = cut_open(surface, [SectionPlane(2, 0.2, side=side)], np.array([0, 0, 5.0]))
        assert np.isclose(measures(left)[0], volume)


def test_percents_are_of_the_whole_whatever_is_left_of_it():
    whole = surface_of(BOX, moved(BOX, 3, 0, 0))
    one = whole.with_faces(whole.component == 0)
    left = cut_open(one, [SectionPlane(0, 12.5, percent=True)], EYE, whole)
    assert np.isclose(measures(left)[0], 0.5)


@pytest.mark.parametrize(
    "text, plane",
    [
        ("x:12.5", (0, 12.5, False, 0)),
        (" -Y : 50% ", (1, 50.0, True, -1)),
        ("+z:-1e-3", (2, -1e-3, False, 1)),
    ],
)
def test_planes_as_they_are_given(text, plane):
    assert parse_section(text) == SectionPlane(*plane)
    assert parse_section(str(SectionPlane(*plane))) == SectionPlane(*plane)


@pytest.mark.parametrize("text", ["", "x", "w:1", "x:", "x:a", "x:nan", "x:inf%", "x:1 2", "xy:1"])
def test_what_is_no_plane(text):
    with pytest.raises(ValueError, match="AXIS:OFFSET: give one such as"):
        parse_section(text)


@pytest.mark.parametrize("text", ["x:7", "x:-7", "x:0.5", "-x:-0.5", "x:0%", "+x:100%"])
def test_a_plane_that_misses_is_told_the_extent(text):
    with pytest.raises(ValueError, match=r"misses it: it reaches from x = -0.5 to 0.5") as error:
        cut(surface_of(BOX), text)
    assert "\n" not in str(error.value) and f"section {text}" in str(error.value)
    if "%" in text:
        assert "(x = " in str(error.value)


def test_the_second_plane_may_miss_what_the_first_left():
    with pytest.raises(ValueError, match=r"z:0.3 misses it: it reaches from z = -0.5 to 0.2"):
        cut(surface_of(BOX), "z:0.2", "z:0.3")


@pytest.mark.parametrize("text, area", [("+z:0", 2.0), ("-z:0", 2.0), ("+z:0.001", 2.0)])
def test_loops_that_touch_at_a_saddle(text, area):
    """A block whose top is x^2 - y^2: in the plane through the saddle two triangles touch."""
    n = 9
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    top, floor = np.c_[x, y, x * x - y * y], np.c_[x, y, np.full(n * n, -2.0)]
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (block.ravel() for block in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    sheet = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    ring = np.r_[i[0, :-1], i[:-1, -1], i[-1, :0:-1], i[:0:-1, 0]]
    after = np.roll(ring, -1)
    walls = np.concatenate(
        [np.c_[ring, after + n * n, after], np.c_[ring, ring + n * n, after + n * n]]
    )
    block = trimesh.Trimesh(
        np.concatenate([top, floor]), np.concatenate([sheet, sheet[:, ::-1] + n * n, walls]),
        process=False,
    )  # fmt: skip
    assert block.is_watertight and block.volume > 0
    left = cut(surface_of(block), text)
    assert np.isclose(measures(left)[1], area, atol=0.01)
    assert left.closed_faces.all() and not left.clashing_edges.any()


def test_a_bottle_without_an_inside_is_cut_without_a_cap():
    """Klein's: closed, but no winding agrees; what bounds the cut leads nowhere."""
    n, m = 24, 16
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    ring = 3.0 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    height = np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), height], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))

    def at(i, j):  # once round, v runs the other way
        return (i % n) * m + np.where(i == n, -j, j) % m

    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    surface = make_surface(points, np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]))
    assert surface.closed_faces.all() and surface.clashing_edges.any()
    for text in ("x:0", "y:0.3", "z:0.1", "x:3"):
        left = cut(surface, text)
        assert len(left.section.rim) and np.isfinite(left.vertices).all()
        # where the cut runs over the seam, it is no loop that could be closed
        assert (left.section.source >= 0).all() == (text in ("z:0.1", "x:3")), text
