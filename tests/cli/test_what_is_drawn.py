"""--projection, --hide and --section at the command line: what is written, and what is refused."""

import json
import re

import numpy as np
import pytest
import trimesh
from command import run

from strokestyle.extract.view_file import load_view
from strokestyle.geometry.curves import KINDS


@pytest.fixture
def cart(tmp_path):
    """Two boxes as the objects of an OBJ: "body", and behind it "wheel, left"."""
    path, box = tmp_path / "cart.obj", trimesh.creation.box((1, 0.4, 0.2))
    lines = []
    for i, (name, shift) in enumerate((("body", 0.0), ("wheel, left", -1.0))):
        lines.append(f"o {name}")
        lines += ["v {} {} {}".format(*(v + [0, 0, shift])) for v in box.vertices]
        lines += ["f {} {} {}".format(*(f + 1 + 8 * i)) for f in box.faces]
    path.write_text("\n".join(lines))
    return path


def test_all_three_together_reach_every_output(cart, tmp_path):
    outputs = [tmp_path / f"out.{suffix}" for suffix in ("svg", "json", "npz", "png")]
    words = [word for output in outputs for word in ("-o", output)]
    done = run("extract", cart, *words, "--view", "isometric", "--section", "x:50%", "--hidden",
               "--hide", "body", "--size", "128")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert "section" in done.stderr
    svg = outputs[0].read_text()
    assert 'id="layer-section"' in svg and "body" not in svg
    found = json.loads(outputs[1].read_text())
    assert found["camera"]["projection"] == "parallel" and "section" in found["kinds"]
    assert set(found.get("parts", ["wheel, left"])) == {"wheel, left"}
    view = load_view(outputs[2])
    assert view.camera.projection == "parallel" and KINDS.index("section") in view.curves.kind
    # the same camera as without: pictures lie on each other
    run("extract", cart, "-o", tmp_path / "whole.json", "--view", "isometric", "--size", "128")
    whole = json.loads((tmp_path / "whole.json").read_text())
    assert whole["camera"] == found["camera"]
    # and once more from the camera that was written
    done = run("extract", cart, "-o", tmp_path / "again.json", "--camera", outputs[1])
    assert json.loads((tmp_path / "again.json").read_text())["curves"] == whole["curves"]


def test_what_was_hidden_behind_is_seen(cart, tmp_path):
    lengths = []
    for words in ([], ["--hide", "body"], ["--hide", "wheel, left"]):
        output = tmp_path / "v.npz"
        run("extract", cart, "-o", output, "--view", "front", "--projection", "parallel", *words)
        lengths.append(load_view(output).curves.lengths().sum())
    assert np.allclose(lengths, lengths[0], rtol=0.01)  # one rectangle behind the other


@pytest.mark.parametrize(
    "words, said",
    [
        (
            ["--hide", "bdoy"],
            r"cart.obj: no part named 'bdoy' to hide; did you mean 'body'\? There",
        ),
        (["--hide", "body", "--hide", "wheel, left"], "all its parts are hidden"),
        (["--section", "x:9"], r"cart.obj: the section x:9 misses it: .* x = -0.5 to 0.5"),
        (["--section", "z:40%", "--section", "+z:60%"], "misses it"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(cart, tmp_path, words, said):
    output = tmp_path / "out.svg"
    done = run("extract", cart, "-o", output, *words)
    assert done.exit_code == 1 and not output.exists()
    assert len(done.stderr.strip().splitlines()) == 1 and re.search(said, done.stderr)


@pytest.mark.parametrize(
    "words, said",
    [
        (["--section", "50%"], "is no AXIS:OFFSET"),
        (["--projection", "oblique"], "perspective"),
        (["--view", "isometric", "--fov", "20"], "leave out --fov"),
        (["--view", "sideways"], "isometric, dimetric"),
    ],
)
def test_what_no_one_can_mean_is_a_usage_error(cart, tmp_path, words, said):
    done = run("extract", cart, "-o", tmp_path / "out.svg", *words)
    assert done.exit_code == 2 and said in " ".join(done.stderr.split())


def test_a_bad_camera_file_is_named(cart, tmp_path):
    camera = tmp_path / "camera.json"
    camera.write_text('{"projection": "fisheye", "eye": [0, 0, 1], "target": [0, 0, 0]}')
    done = run("extract", cart, "-o", tmp_path / "out.svg", "--camera", camera)
    assert done.exit_code == 1 and "projection is 'fisheye'" in done.stderr


def test_where_no_cap_can_be_is_said(tmp_path):
    ball = trimesh.creation.icosphere(3)
    path = tmp_path / "bowl.ply"
    trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 1] < 0.3]).export(path)
    done = run("extract", path, "-o", tmp_path / "out.svg", "--section", "x:0")
    assert done.exit_code == 0
    warning = done.stderr.splitlines()[0]
    assert warning.startswith("warning: ") and "bowl.ply: it is open where it is cut" in warning
