"""The instruments that measure lines, on things whose measure is known."""

import sys
from pathlib import Path

import numpy as np
import pytest
import shapes

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.rays import Bvh
from strokestyle.geometry.curves import Curves
from strokestyle.mesh.read import read_mesh
from strokestyle.mesh.read_with_trimesh import read_with_trimesh
from strokestyle.mesh.surface import make_surface

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "docs")]

import coarse
import compare
import contact_sheet
import lines
import mesh_files
import meshes
import sight

T = np.linspace(0.0, 100.0, 60)[:, None]
LINE = np.hstack([T, 0 * T]) + 50.0


@pytest.mark.parametrize(
    "other, length",
    [
        (LINE + [0, 1], 100),
        (LINE[::-1] + [0, 1], 100),
        (LINE[:30] + [0, 1], 50),
        (LINE[:4] + [0, 1], 0),
        (LINE + [0, 3], 0),
        (np.hstack([0 * T, T]) + [100, 0], 0),
    ],
)
def test_doubled_length(other, length):
    assert lines.doubled(Curves.from_list([LINE, other])) == pytest.approx(length, abs=2)


def test_a_fold_is_doubled_and_a_ring_is_not():
    fold = np.vstack([LINE, LINE[::-1][:-20] + [0, 0.8]])
    assert lines.doubled(Curves.from_list([fold])) == pytest.approx(57, abs=3)
    t = np.linspace(0, 2 * np.pi, 100)
    ring = 100 + 40 * np.stack([np.cos(t), np.sin(t)], axis=1)
    ring[-1] = ring[0]
    assert lines.doubled(Curves.from_list([ring])) == 0


def test_covered_length():
    segment = np.array([[[0.0, 0, 0], [0.1, 0, 0]]])
    assert (
        lines.covered(segment, segment + [0, 9e-5, 0]) == 1
        and lines.covered(segment, segment + [0, 2e-4, 0]) == 0
    )
    assert lines.covered(segment, 0.5 * segment) == pytest.approx(0.5, abs=0.01)
    assert lines.covered(0.5 * segment, segment) == 1 and lines.covered(segment[:0], segment) == 1


def test_a_derivative_tensor_turned_is_the_same_tensor():
    rng = np.random.default_rng(0)
    tensor, angle = rng.normal(size=(20, 4)), rng.uniform(0, 6, 20)
    turned = lines._turn(tensor, np.cos(angle), np.sin(angle))

    def along(tensor, direction):  # C(w, w, w)
        p, q, r, s = tensor.T
        x, y = np.cos(direction), np.sin(direction)
        return p * x**3 + 3 * q * x * x * y + 3 * r * x * y * y + s * y**3

    assert np.allclose(along(turned, 0.7), along(tensor, 0.7 + angle))


def test_crossings_against_every_triangle():
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(150, 1, 3)) + 0.5 * rng.normal(size=(150, 3, 3))
    eye, targets = np.array([1.0, 2.0, 12.0]), rng.normal(size=(120, 3))
    found = sight.crossings(corners, eye, targets)
    expected = {}
    for i, target in enumerate(targets):
        for j, (a, b, c) in enumerate(corners):
            matrix = np.stack([b - a, c - a, eye - target], axis=1)
            u, v, t = np.linalg.solve(matrix, eye - a)
            if u >= 0 and v >= 0 and u + v <= 1 and 0 < t < 1:
                expected[i, j] = (1 - t) * np.linalg.norm(target - eye)
    assert len(expected) > 50
    assert dict(
        zip(
            zip(found.target.tolist(), found.triangle.tolist(), strict=True), found.gap, strict=True
        )
    ) == (pytest.approx(expected))


@pytest.mark.parametrize("road", [sight.by_rule, sight.by_curved_faces, sight.by_mesh])
def test_roads_agree_on_a_ball_behind_a_ball(road):
    ball = shapes.sphere(3)
    points = np.vstack([ball.vertices, 0.5 * ball.vertices + [0.5, 0, 3.0]])
    surface = make_surface(points, np.vstack([ball.faces, ball.faces + len(ball.vertices)]))
    camera = fit_camera(surface.vertices, "back")
    where = lines.places(surface, camera, LineOptions(kinds=("contour",)))
    truth, position = road(surface, camera.eye, where), where.on(surface, surface.vertices)
    small = surface.component[where.face] == surface.component[-1]
    assert not truth[small].any() and truth[~small].mean() > 0.9 - 0.6 * (road is sight.by_mesh)
    seen = Bvh(surface).seen(camera.eye, where.face, position, where.sharp)
    tally = lines.Tally()
    tally.add(where, seen, truth)
    assert tally.figures("ridge") is None
    if road is not sight.by_mesh:
        assert tally.figures("contour") == "1.0000 / 0.0000"
    eye, position = surface.original(camera.eye[None])[0], surface.original(position)

    def height(at):
        return np.minimum(
            np.linalg.norm(at, axis=1) - 1, np.linalg.norm(at - [0.5, 0, 3.0], axis=1) - 0.5
        )

    assert np.array_equal(sight.by_formula(height, eye, position, 0.02), seen)


def test_a_contact_sheet():
    picture = contact_sheet.sheet([ROOT / "examples" / "shapes" / "teapot.ply"], 1)
    assert picture.size == (contact_sheet.CELL, 2 * contact_sheet.CELL + contact_sheet.TITLE)
    ink = (np.asarray(picture) < 128)[contact_sheet.TITLE :]
    assert all(0.002 < half.mean() < 0.05 for half in np.split(ink, 2))


@pytest.mark.parametrize("form", mesh_files.cases())
def test_mesh_files_are_read_at_least_as_well_as_by_trimesh(tmp_path, form):
    wrong = {"ours": set(), "theirs": set()}
    for case in mesh_files.cases()[form]:
        path = tmp_path / f"x.{form}"
        path.write_bytes(case.data)
        for who, read in (("ours", read_mesh), ("theirs", read_with_trimesh)):
            if mesh_files.verdict(read, path, case) != "right":
                wrong[who].add(case.name)
    assert wrong["ours"] <= wrong["theirs"]
    if form == "obj":  # the reason why there is a reader of our own
        assert not wrong["ours"] and {"two objects", "seams of a texture"} <= wrong["theirs"]


def signed_volume(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0


def test_the_coarse_solids_are_closed_and_turned_outward():
    assert len(coarse.SOLIDS) == 20
    for name, make in coarse.SOLIDS.items():
        vertices, faces = make()
        place = np.unique(vertices.round(9), axis=0, return_inverse=True)[1].ravel()
        faces = place[faces] if name == "tube of 24" else faces  # its profile ends where it starts
        sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
        forth, back = ({tuple(side) for side in pairs} for pairs in (sides, sides[:, ::-1]))
        assert len(forth) == len(sides) and forth == back, name
        assert signed_volume(vertices, make()[1]) > 0, name


def test_a_solid_cut_finely_is_the_same_solid():
    vertices, faces = coarse.SOLIDS["frame"]()
    fine = coarse.subdivided(vertices, faces)
    assert signed_volume(*fine) == pytest.approx((3 * 2 - 1 * 1) * 0.4)
    corner = fine[0][fine[1]]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max()
    assert 0.5 < longest / (coarse.FINE * 3.0) <= 1.0


def test_length_of_which_the_other_has_nothing():
    t = np.linspace(0, 100, 101)[:, None]
    line = np.hstack([t, 0 * t])
    whole, half = Curves.from_list([line]), Curves.from_list([line[:51] + [0, 1.5]])
    assert coarse.apart(half, whole) == 0 and coarse.apart(whole, half) == pytest.approx(49, abs=2)
    assert coarse.apart(whole, Curves.empty()) == pytest.approx(100, abs=2)


CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"


@pytest.mark.parametrize(
    "name, text, verdict",
    [
        ("tetrahedron.obj", CORNERS + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n", "drawn"),
        ("nothing.obj", CORNERS, "refused"),
    ],
)
def test_what_became_of_a_mesh(tmp_path, name, text, verdict):
    (tmp_path / name).write_text(text)
    (tmp_path / "readme.md").write_text("no mesh")
    assert [path.name for path in meshes.meshes(tmp_path)] == [name]
    outcome = meshes.draw(tmp_path / name, "--size 100", 60, 2.0)
    assert outcome.verdict == verdict and outcome.memory > 1e7
    assert bool(outcome.curves) == (verdict == "drawn")
    assert meshes.sheets([outcome], tmp_path / "sheets")[0].stat().st_size > 100


def test_a_process_that_leaves_its_limits_failed(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert meshes.draw(path, "", 0.05, 2.0).why == "ended after 0.05 s"
    code, text, _, _ = meshes.run(
        [sys.executable, "-c", "x = bytearray(10**9)"], seconds=60, memory=0.5
    )
    assert code == 1 and "MemoryError" in text


def test_meshes_that_are_compared_are_closed_and_of_the_size_asked_for(tmp_path):
    vertices, triangles = compare.blob(5000, 0.0)
    finer = compare.subdivide(vertices, triangles)
    assert 4500 < len(triangles) < 5500 and len(finer[1]) == 4 * len(triangles)
    compare.write_obj(tmp_path / "blob.obj", *finer)
    assert np.array_equal(compare.read_obj(tmp_path / "blob.obj")[1], finer[1])
    for points, faces in ((vertices, triangles), finer):
        corners = points[faces]
        volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        assert volume.sum() > 0  # the outside is outside
        sides = np.concatenate([faces[:, [i, i - 2]] for i in range(3)])
        one_way = {tuple(side) for side in sides.tolist()}
        assert len(one_way) == len(sides) and {(b, a) for a, b in one_way} == one_way
