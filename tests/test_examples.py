"""The committed shapes and drawings are what the README says, and the script that made them still
makes them."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from strokestyle.extract.camera import DEFAULT_SIZE, fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.pipeline import extract_view
from strokestyle.fit.exemplar import agree, load_exemplar
from strokestyle.mesh.surface import load_surface

EXAMPLES = Path(__file__).parent.parent / "examples"
SHAPES = ("elephant", "hand", "bracket", "teapot", "cloth")
WATERTIGHT = ("elephant", "hand", "bracket")
DRAWINGS = ("brush", "charcoal", "watercolour")


def script(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


make_shapes = script("make_shapes")


def read(name):
    return trimesh.load(EXAMPLES / "shapes" / f"{name}.ply", process=False)


# ------------------------------------------------------------------------------------------- shapes


def test_every_shape_of_the_script_is_committed_and_no_other():
    assert (
        set(make_shapes.SHAPES)
        == set(SHAPES)
        == {path.stem for path in (EXAMPLES / "shapes").iterdir()}
    )


@pytest.mark.parametrize("name", SHAPES)
def test_shape_is_compact_centred_and_clean(name):
    assert (EXAMPLES / "shapes" / f"{name}.ply").stat().st_size < 500_000
    surface = load_surface(EXAMPLES / "shapes" / f"{name}.ply")
    assert 8_000 <= len(surface.faces) <= 30_000
    corners = surface.vertices[surface.faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert area.min() > 0.0
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    assert (high - low).max() == pytest.approx(1.0, abs=1e-4)
    assert np.abs(low + high).max() < 1e-4
    mesh = read(name)
    assert len(surface.faces) == len(mesh.faces), "cleaning takes nothing away"
    assert mesh.is_winding_consistent
    assert mesh.is_watertight == (name in WATERTIGHT)
    if name in WATERTIGHT:
        assert mesh.volume > 0.0, "faces look outward"


def test_teapot_is_a_closed_pot_with_open_handle_and_spout():
    parts = sorted(read("teapot").split(only_watertight=False), key=lambda part: -len(part.faces))
    assert [part.is_watertight for part in parts] == [True, False, False]
    assert parts[0].volume > 0.0


def test_cloth_is_one_sheet_with_one_rim():
    mesh = read("cloth")
    assert mesh.euler_number == 1 and mesh.body_count == 1


def test_script_makes_the_committed_teapot(tmp_path):
    make_shapes.write_ply(tmp_path / "teapot.ply", make_shapes.teapot())
    again, committed = trimesh.load(tmp_path / "teapot.ply", process=False), read("teapot")
    assert np.array_equal(again.faces, committed.faces)
    assert np.abs(again.vertices - committed.vertices).max() < 2e-5


# --------------------------------------------------------------------- the parts they are made from


def sphere(p):
    return np.linalg.norm(p, axis=1) - 0.7


def box(p):
    return (np.abs(p) - [0.6, 0.5, 0.4]).max(axis=1)


def test_polygons_of_a_sphere():
    vertices, faces = make_shapes.polygonise(sphere, [-1.01, -1.02, -1.03], [1, 1, 1], 0.1)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert np.abs(sphere(vertices)).max() < 1e-6
    assert mesh.is_watertight and mesh.euler_number == 2
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=0.02)
    assert np.degrees(mesh.face_angles).min() > 25.0


def test_sharp_polygons_have_all_edges_and_corners_of_a_box():
    vertices, faces = make_shapes.surface_nets(
        box, [-0.93, -0.94, -0.91], [1, 1, 1], 0.077, sharp=True
    )
    mesh = trimesh.Trimesh(*make_shapes.weld((vertices, faces), 0.01), process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(8 * 0.6 * 0.5 * 0.4, rel=1e-4)
    for corner in np.array(np.meshgrid([-0.6, 0.6], [-0.5, 0.5], [-0.4, 0.4])).reshape(3, -1).T:
        assert np.linalg.norm(mesh.vertices - corner, axis=1).min() < 1e-6


def test_blend_is_a_union_outside_its_band_and_smooth_inside():
    a, b = np.linspace(-1.0, 1.0, 2001), np.zeros(2001)
    out = make_shapes.blend(a, b, k=0.3)
    assert np.array_equal(out[np.abs(a) > 0.3], np.minimum(a, b)[np.abs(a) > 0.3])
    assert out[1000] == pytest.approx(-0.05)
    assert np.abs(np.diff(out, 3)).max() < 1e-6  # no jump of the second derivative


def test_tube_is_exact_along_a_straight_line():
    p = np.random.default_rng(0).normal(size=(500, 3))
    ends = np.array([[-0.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    near = p - np.clip(p @ [1.0, 0.0, 0.0], -0.5, 0.5)[:, None] * [1.0, 0.0, 0.0]
    assert make_shapes.tube(p, ends, [0.2, 0.2, 0.2]) == pytest.approx(
        np.linalg.norm(near, axis=1) - 0.2, abs=1e-6
    )


def test_refining_keeps_a_mesh_closed():
    mesh = make_shapes.surface_nets(sphere, [-1.01, -1.02, -1.03], [1, 1, 1], 0.3)
    vertices, faces = make_shapes.refine(sphere, mesh, degrees=20.0, least=0.05)
    assert len(faces) > len(mesh[1])
    fine = trimesh.Trimesh(vertices, faces, process=False)
    assert fine.is_watertight and fine.is_winding_consistent
    again = trimesh.Trimesh(*make_shapes.even_valence((vertices, faces)), process=False)
    assert again.is_watertight and again.is_winding_consistent and len(again.faces) == len(faces)


# ----------------------------------------------------------------------------------------- drawings


@pytest.fixture(scope="module")
def elephant_view():
    surface = load_surface(EXAMPLES / "shapes" / "elephant.ply")
    return extract_view(surface, fit_camera(surface.vertices, "three-quarter"), LineOptions())


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawing_is_a_small_rgb_picture_of_the_default_canvas(name):
    path = EXAMPLES / "drawings" / f"{name}.png"
    assert path.stat().st_size < 200_000
    with Image.open(path) as image:
        assert (image.format, image.mode, image.size) == (
            "PNG",
            "RGB",
            (DEFAULT_SIZE, DEFAULT_SIZE),
        )
        assert "icc_profile" not in image.info and not image.getexif()


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawing_lies_on_the_curves_of_the_default_view(name, elephant_view):
    points = elephant_view.curves.xy
    exemplar, note = load_exemplar(
        EXAMPLES / "drawings" / f"{name}.png", DEFAULT_SIZE, DEFAULT_SIZE, points
    )
    found = agree(exemplar, points)
    assert note == ""
    assert found.far_ink < 0.02 and found.bare_curve < 0.05
