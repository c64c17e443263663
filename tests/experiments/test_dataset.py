"""A data set is built, described by lot, and everything wrong with one is told."""

import argparse
import json
import shutil

import numpy as np
import pytest
from build_dataset import add_shape, aimed_camera, centroid, describe, problems
from dataset import DataSet, data_of
from PIL import Image
from solids import box

from strokestyle.mesh.surface import load_surface, make_surface

SIZE = 128


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two blocks, and a style of both whose drawings are their templates."""
    root = tmp_path_factory.mktemp("data")
    for name, high in (("tall", (1.0, 3.0, 1.5)), ("flat", (4.0, 1.0, 2.0))):
        solid = box(high=high)
        lines = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in solid.faces + 1]
        (root / f"{name}.obj").write_text("\n".join(lines))
        add_shape(root / "shapes" / name, root / f"{name}.obj", "three-quarter", SIZE)
        (root / "styles" / "plain" / name).mkdir(parents=True)
        template = root / "shapes" / name / "template.png"
        shutil.copy(template, root / "styles" / "plain" / name / "drawing.png")
        (root / f"{name}.obj").unlink()
    (root / "dataset.json").write_text(json.dumps(describe(root, None, 0, "two blocks")))
    return root


@pytest.fixture
def copied(made, tmp_path):
    return shutil.copytree(made, tmp_path / "set")


def redescribe(root, **changed):
    about = describe(root, None, 0, "") | changed
    (root / "dataset.json").write_text(json.dumps(about))


def test_a_set_that_was_built_is_sound_and_as_the_paper_has_it(made):
    assert list(problems(made)) == []
    surface = load_surface(made / "shapes" / "tall" / "mesh.obj")
    assert np.ptp(surface.vertices, axis=0).max() == pytest.approx(1.0, abs=1e-5)
    view = DataSet(made, "flat").sheet("tall").view
    assert view.camera.up.tolist() == [0, 1, 0]
    middle, _ = view.camera.project(centroid(surface)[None])
    assert np.allclose(middle, SIZE / 2)
    assert len(view.curves)


def test_the_centroid_is_that_of_the_area_not_of_the_vertices():
    # a long face cut into ten has more vertices at its far end
    solid = box(high=(1.0, 1.0, 1.0))
    surface = make_surface(solid.vertices, solid.faces)
    cut = surface.vertices[surface.faces].mean(axis=1)
    extra = np.arange(len(surface.vertices), len(surface.vertices) + 1)
    a, b, c = surface.faces[0]
    faces = np.r_[surface.faces[1:], [[a, b, extra[0]], [b, c, extra[0]], [c, a, extra[0]]]]
    finer = make_surface(np.r_[surface.vertices, cut[:1]], faces)
    assert np.allclose(centroid(finer), 0, atol=1e-9)


@pytest.mark.parametrize("view", ["front", "three-quarter", "120,-35"])
def test_the_camera_sees_the_whole_shape_and_no_more_than_it_must(view):
    solid = box(high=(0.3, 1.0, 0.2))
    surface = make_surface(solid.vertices, solid.faces)
    xy, _ = aimed_camera(surface, view, 200).project(surface.vertices)
    reach = np.abs(xy - 100).max()
    assert reach == pytest.approx(100 - 0.08 * 200)


def test_the_lot_is_drawn_for_each_style_by_its_seed(made):
    lots = {describe(made, None, seed, "")["train"]["plain"] for seed in range(20)}
    assert lots == {"tall", "flat"}
    assert describe(made, None, 3, "") == describe(made, None, 3, "")
    options = argparse.Namespace(data=made, train=None, size=64)
    data = data_of(options)
    assert data.styles() == ["plain"]
    assert sorted([data.train_of("plain"), *data.tests("plain")]) == ["flat", "tall"]


def test_all_images_of_a_lesson_have_the_size_that_was_asked_for(made):
    lesson = DataSet(made, "tall", 64).lesson("plain")
    assert lesson.drawing.shape == (64, 64, 3)
    assert lesson.sheet.plain.shape == (64, 64) and lesson.sheet.maps.shape == (8, 64, 64)
    assert lesson.sheet.plain.min() < 0.5 < lesson.sheet.plain[0, 0]
    assert lesson.exemplar().mask.shape == (64, 64)
    # the drawing lies on the curves
    assert lesson.drawing[lesson.sheet.plain < 0.3].mean() < 0.6


def test_a_small_drawing_is_read_on_a_larger_canvas_and_no_better_than_it_is(made):
    lesson = DataSet(made, "tall", 32).lesson("plain")
    large, whole = lesson.sheet.at(SIZE), lesson.at(SIZE)
    assert large.size == (SIZE, SIZE) and large.at(SIZE) is large
    enlarged, sharp = lesson.exemplar(large), whole.exemplar()
    assert enlarged.mask.shape == sharp.mask.shape == (SIZE, SIZE)
    # what 32 px cannot hold is not there: lines of 1 px of 128 are spread over several
    lines = large.plain < 0.1
    assert sharp.alpha[lines].mean() > 1.5 * enlarged.alpha[lines].mean() > 0.1


def test_without_a_description_the_training_shape_must_be_named(copied):
    (copied / "dataset.json").unlink()
    with pytest.raises(ValueError, match="which of flat, tall are styles learned from"):
        data_of(argparse.Namespace(data=copied, train=None, size=64))
    assert any("missing" in line for line in problems(copied))


@pytest.mark.parametrize("text", ["{", "{}", "[]"])
def test_a_description_that_is_none_is_named(copied, text):
    (copied / "dataset.json").write_text(text)
    with pytest.raises(ValueError, match=r"dataset\.json: not a description"):
        data_of(argparse.Namespace(data=copied, train=None, size=64))


def test_styles_are_those_that_can_be_tested_and_others_are_told(copied, capsys):
    shutil.copytree(copied / "styles" / "plain" / "tall", copied / "styles" / "lone" / "tall")
    data = DataSet(copied, "tall", 64)
    assert data.chosen_styles(None) == data.chosen_styles("plain") == ["plain"]
    assert "left out, no drawing to test on: lone" in capsys.readouterr().err
    with pytest.raises(ValueError, match="no drawing to test lone on"):
        data.chosen_styles("plain,lone")
    with pytest.raises(ValueError, match="no style plane; .* there are lone, plain"):
        data.chosen_styles("plain,plane")
    with pytest.raises(ValueError, match="training on cow, there are none"):
        DataSet(copied, "cow", 64).chosen_styles(None)


def test_a_shape_is_not_laid_over_another_and_a_bad_mesh_leaves_nothing(copied):
    there = copied / "shapes" / "tall"
    before = (there / "camera.json").read_bytes()
    with pytest.raises(ValueError, match="there already"):
        add_shape(there, there / "mesh.obj", "front", SIZE)
    assert (there / "camera.json").read_bytes() == before
    with pytest.raises((OSError, ValueError)):
        add_shape(copied / "shapes" / "new", copied / "none.obj", "front", SIZE)
    assert not (copied / "shapes" / "new").exists()


def moved_mesh(root):
    path = root / "shapes" / "tall" / "mesh.obj"
    lines = path.read_text().splitlines()
    moved = [
        "v " + " ".join(f"{2 * float(x) + 1}" for x in line.split()[1:]) if line[0] == "v" else line
        for line in lines
    ]
    path.write_text("\n".join(moved))


def tilted_camera(root):
    path = root / "shapes" / "tall" / "camera.json"
    camera = json.loads(path.read_text())
    path.write_text(json.dumps(camera | {"up": [0.2, 1, 0]}))


def averted_camera(root):
    path = root / "shapes" / "tall" / "camera.json"
    camera = json.loads(path.read_text())
    path.write_text(json.dumps(camera | {"target": [2, 0, 0]}))


def paint(root, shape, image):
    Image.fromarray(image).save(root / "styles" / "plain" / shape / "drawing.png")


BLANK = np.full((SIZE, SIZE), 255, np.uint8)
CORNER = BLANK.copy()
CORNER[:20, :20] = 0
BROKEN = {
    "mesh moved": (moved_mesh, "longest side 2"),
    "camera tilted": (tilted_camera, "wanted the upright axis"),
    "camera averted": (averted_camera, "past the shape's centroid"),
    "blank drawing": (lambda root: paint(root, "flat", BLANK), "no ink"),
    "drawing of something else": (lambda root: paint(root, "flat", CORNER), "far from every curve"),
    "drawing of other proportions": (lambda root: paint(root, "flat", BLANK[:90]), "128 x 90 px"),
    "no drawing to test on": (
        lambda root: shutil.rmtree(root / "styles" / "plain" / "flat"),
        "no drawing",
    ),
    "shape is missing": (
        lambda root: shutil.rmtree(root / "shapes" / "flat"),
        "not among the shapes",
    ),
    "not a mesh": (
        lambda root: (root / "shapes" / "tall" / "mesh.obj").write_text("v 0 0"),
        "mesh.obj",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_wrong_with_a_set_is_told(copied, case):
    spoil, told = BROKEN[case]
    spoil(copied)
    redescribe(copied)
    found = list(problems(copied))
    assert any(told in line for line in found), found
    assert not any("not the file that was described" in line for line in found)


def test_a_file_that_was_changed_since_or_is_gone_is_told(copied):
    template = copied / "shapes" / "tall" / "template.png"
    template.write_bytes(template.read_bytes() + b" ")
    (copied / "shapes" / "flat" / "template.png").unlink()
    assert [line.split(": ")[1] for line in problems(copied)] == [
        "described, but missing",
        "not the file that was described",
    ]
