"""The whole walk through the command line: a drawing and a mesh in, another mesh drawn so."""

import io
import json
import pickle
import re
import xml.etree.ElementTree as ET
import zipfile

import numpy as np
import pytest
import shapes
import trimesh
from command import refused, run
from PIL import Image, ImageDraw

from strokestyle.extract.view_file import load_view
from strokestyle.files import read_model, write_model

VIEW = ("--size", "256", "--view", "25,35")


def draw_over(view, width, color, paper=(255, 255, 255)):
    """A drawing made by a fat round pen going over the curves of a view."""
    scale = 4
    image = Image.new("RGB", (view.camera.width * scale, view.camera.height * scale), paper)
    pen = ImageDraw.Draw(image)
    r = width * scale / 2
    for i in range(len(view.curves)):
        points = view.curves[i] * scale
        pen.line(points.ravel().tolist(), fill=color, width=int(2 * r))
        for x, y in points:
            pen.ellipse([x - r, y - r, x + r, y + r], fill=color)
    return image.reduce(scale)


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """Two meshes, the view of one, a drawing over it, dark red and 6 px wide, and its style."""
    folder = tmp_path_factory.mktemp("studio")
    trimesh.creation.torus(1.0, 0.4, 96, 48).export(folder / "torus.obj")
    trimesh.creation.icosphere(subdivisions=4).export(folder / "ball.ply")
    assert run("extract", folder / "torus.obj", "-o", folder / "view.npz", *VIEW).exit_code == 0
    draw_over(load_view(folder / "view.npz"), 6, (150, 20, 30)).save(folder / "drawing.png")
    result = run(
        "fit",
        folder / "drawing.png",
        folder / "torus.obj",
        "-o",
        folder / "m.pt",
        "--preset",
        "quick",
        "--json",
        *VIEW,
    )
    assert result.exit_code == 0, result.stderr
    assert "m.pt" in result.stderr and "m.fit.png" in result.stderr
    told = json.loads(result.stdout)
    assert told["files"] == [str(folder / "m.pt"), str(folder / "m.fit.png")]
    assert 0 < told["lines_drawn"] <= told["lines"] and told["preset"] == "quick"
    return folder


def labels(text):
    """The labels of the layers in an SVG, in their order."""
    key = "{http://www.inkscape.org/namespaces/inkscape}label"
    return [element.get(key) for element in ET.fromstring(text).iter() if key in element.keys()]


def parts_of(text):
    """{part: colours of its strokes} in an SVG."""
    found = {}
    for element in ET.fromstring(text).iter():
        if element.get("class") == "stroke":
            found.setdefault(element.get("data-ss-part"), set()).add(element.get("fill"))
    return found


def strokes_of(path):
    """[(kind, widths)] of the strokes in an SVG."""
    out = []
    for element in ET.parse(path).iter():
        if element.get("class") == "stroke":
            widths = [float(pair.split(",")[-1]) for pair in element.get("data-ss-width").split()]
            out.append((element.get("data-ss-class"), np.array(widths)))
    return out


def test_fit_leaves_a_sheet_to_look_at(studio):
    sheet = Image.open(studio / "m.fit.png")
    assert sheet.size == (4 * 256, 256)
    drawn, mask, drawn_mask, textured = np.split(
        np.asarray(sheet.convert("RGB"), float) / 255, 4, axis=1
    )
    assert (drawn_mask < 0.5).mean() > 0.02  # ink is shown in grey, what was drawn in black
    assert ((mask < 0.9) != (drawn_mask < 0.5)).mean() < 0.02
    assert np.abs(drawn - textured).mean() < 0.02
    assert np.abs(drawn - 1).mean() > 0.02


def test_a_learned_pen_draws_another_shape(studio, tmp_path):
    out = tmp_path / "ball.svg"
    result = run("render", studio / "m.pt", studio / "ball.ply", "-o", out, "--png", *VIEW)
    assert result.exit_code == 0, result.stderr
    strokes = strokes_of(out)
    assert {kind for kind, _ in strokes} == {"contour"}
    widths = np.concatenate([w for _, w in strokes])
    assert abs(np.median(widths) - 6) < 1
    picture = np.asarray(Image.open(tmp_path / "ball.png").convert("RGB"), float)
    assert picture.shape == (256, 256, 3)
    ink = picture[picture.min(axis=2) < 60]
    assert np.abs(np.median(ink, axis=0) - [150, 20, 30]).max() < 12
    covered = (picture[..., 1] < 128).sum()
    assert (
        0.8 < covered / (np.pi * 0.84 * 256 * 6) < 1.2
    )  # a circle of the fitted radius, 6 px wide


def test_the_same_seed_gives_the_same_bytes(studio, tmp_path):
    args = ("--preset", "quick", "--seed", "3", *VIEW)
    for name in ("a", "b"):
        assert (
            run(
                "fit",
                studio / "drawing.png",
                studio / "torus.obj",
                "-o",
                tmp_path / f"{name}.pt",
                *args,
            ).exit_code
            == 0
        )
        done = run(
            "render",
            tmp_path / f"{name}.pt",
            studio / "ball.ply",
            "-o",
            tmp_path / f"{name}.svg",
            "--seed",
            "5",
            *VIEW,
        )
        assert done.exit_code == 0, done.stderr
    assert (tmp_path / "a.pt").read_bytes() == (tmp_path / "b.pt").read_bytes()
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_textures_backgrounds_and_standard_output(studio, tmp_path):
    plain = run(
        "render", studio / "m.pt", studio / "ball.ply", "-o", "-", "--texture", "none", *VIEW
    ).stdout
    assert "<image" not in plain and plain.rstrip().endswith("</svg>")
    image = run(
        "render", studio / "m.pt", studio / "ball.ply", "-o", "-", "--background", "#f0e8d8", *VIEW
    ).stdout
    assert "#f0e8d8" in image
    assert (
        run(
            "render", studio / "m.pt", studio / "ball.ply", "-o", tmp_path / "x.svgz", "-q", *VIEW
        ).stderr
        == ""
    )
    assert (tmp_path / "x.svgz").read_bytes()[:2] == b"\x1f\x8b"


def test_many_shapes_go_to_a_folder_and_one_bad_one_does_not_stop_them(studio, tmp_path):
    meshes, out = tmp_path / "meshes", tmp_path / "out"
    meshes.mkdir()
    for name in ("a.ply", "c.ply"):
        (meshes / name).write_bytes((studio / "ball.ply").read_bytes())
    (meshes / "b.obj").write_text("not a mesh")
    result = run("render", studio / "m.pt", meshes, "-o", f"{out}/", *VIEW)
    assert result.exit_code == 1
    assert "b.obj" in result.stderr and "2 of 3 shapes drawn" in result.stderr
    assert sorted(p.name for p in out.iterdir()) == ["a.svg", "batch.jsonl", "c.svg"]
    jobs = run(
        "render",
        studio / "m.pt",
        meshes / "a.ply",
        meshes / "c.ply",
        "-o",
        tmp_path / "two/",
        "--jobs",
        "2",
        *VIEW,
    )
    assert jobs.exit_code == 0, jobs.stderr
    for name in ("a.svg", "c.svg"):
        assert (tmp_path / "two" / name).read_bytes() == (out / name).read_bytes()


def test_two_shapes_of_one_name_are_refused(studio, tmp_path):
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "ball.obj").write_text("")
    refused(
        "render",
        studio / "m.pt",
        studio / "ball.ply",
        tmp_path / "x" / "ball.obj",
        "-o",
        tmp_path,
        words=["ball.svg"],
        code=2,
    )


def test_turntable(studio, tmp_path):
    result = run(
        "render",
        studio / "m.pt",
        studio / "torus.obj",
        "-o",
        tmp_path / "t.svg",
        "--turntable",
        "3",
        *VIEW,
    )
    assert result.exit_code == 0, result.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["t-000.svg", "t-001.svg", "t-002.svg"]


def test_stages_of_several_shapes(studio, tmp_path):
    args = (
        "render",
        studio / "m.pt",
        studio / "torus.obj",
        studio / "ball.ply",
        "--stages",
        tmp_path / "s",
        *VIEW,
    )
    assert run(*args).exit_code == 0
    parts = ("1-curves", "2-displaced", "3-strokes", "4-textured")
    names = {f"{part}.{suffix}" for part in parts for suffix in ("svg", "png")} | {"sheet.png"}
    wanted = {f"{shape}-{name}" for shape in ("torus", "ball") for name in names}
    assert {p.name for p in (tmp_path / "s").iterdir()} == wanted | {"batch.jsonl"}
    beside = run(*args, "-o", tmp_path / "out/")
    assert beside.exit_code == 0 and sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "ball.svg",
        "batch.jsonl",
        "torus.svg",
    ]
    assert [kind for kind, _ in strokes_of(tmp_path / "s" / "torus-4-textured.svg")] == [
        kind for kind, _ in strokes_of(tmp_path / "out" / "torus.svg")
    ]
    refused(
        "render",
        studio / "m.pt",
        studio / "ball.ply",
        words=["-o OUT.svg, or --stages DIR"],
        code=2,
    )


def test_a_saved_view_is_drawn_like_its_mesh(studio, tmp_path):
    assert (
        run(
            "render", studio / "m.pt", studio / "torus.obj", "-o", tmp_path / "a.svg", *VIEW
        ).exit_code
        == 0
    )
    assert (
        run("render", studio / "m.pt", studio / "view.npz", "-o", tmp_path / "b.svg").exit_code == 0
    )
    strip = [
        re.sub("<title>.*?</title>", "", (tmp_path / name).read_text())
        for name in ("a.svg", "b.svg")
    ]
    assert strip[0] == strip[1]


def test_an_empty_view_is_an_empty_drawing(studio, tmp_path):
    (tmp_path / "c.json").write_text(
        '{"eye": [0, 0, 3], "target": [0, 0, 9], "fov_y_deg": 30, "size": [128, 128]}'
    )
    result = run(
        "render",
        studio / "m.pt",
        studio / "ball.ply",
        "-o",
        tmp_path / "x.svg",
        "--camera",
        tmp_path / "c.json",
    )
    assert result.exit_code == 0 and "no visible curves" in result.stderr
    assert strokes_of(tmp_path / "x.svg") == []


# ---------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Image.new("RGB", (256, 256), "white"), ["all white"]),
        (lambda: Image.new("RGB", (256, 256), "black"), ["all black"]),
        (lambda: Image.effect_noise((256, 256), 200), ["picture rather"]),
        (lambda: Image.new("RGB", (4, 4), "white"), ["too small"]),
    ],
    ids=["white", "black", "noise", "tiny"],
)
def test_bad_drawings(studio, tmp_path, make, words):
    make().save(tmp_path / "d.png")
    model = tmp_path / "m.pt"
    model.write_text("an older model")
    refused(
        "fit",
        tmp_path / "d.png",
        studio / "torus.obj",
        "-o",
        model,
        *VIEW,
        words=[str(tmp_path / "d.png"), *words],
    )
    assert model.read_text() == "an older model"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["d.png", "m.pt"]


def test_a_drawing_of_something_else(studio, tmp_path):
    image = Image.new("RGB", (256, 256), "white")
    ImageDraw.Draw(image).line([20, 20, 60, 240, 10, 240], fill=0, width=5)
    image.save(tmp_path / "d.png")
    line = refused("fit", tmp_path / "d.png", studio / "torus.obj", "-o", tmp_path / "m.pt", *VIEW)
    assert re.search(r"\d+ % of its ink lies farther than", line) and "extract" in line


def test_drawings_that_are_no_images(studio, tmp_path):
    refused(
        "fit",
        tmp_path / "no.png",
        studio / "torus.obj",
        "-o",
        tmp_path / "m.pt",
        *VIEW,
        words=["no.png"],
    )
    (tmp_path / "d.png").write_bytes((studio / "drawing.png").read_bytes()[:300])
    refused(
        "fit",
        tmp_path / "d.png",
        studio / "torus.obj",
        "-o",
        tmp_path / "m.pt",
        *VIEW,
        words=["not a readable image"],
    )
    refused(
        "fit", tmp_path, studio / "torus.obj", "-o", tmp_path / "m.pt", *VIEW, words=["a folder"]
    )


def test_a_shape_without_visible_lines_cannot_be_learned_from(studio, tmp_path):
    (tmp_path / "c.json").write_text(
        '{"eye": [0, 0, 3], "target": [0, 0, 9], "fov_y_deg": 30, "size": [256, 256]}'
    )
    camera = ("--camera", tmp_path / "c.json")
    refused("fit", studio / "drawing.png", studio / "torus.obj", *camera, "-o", tmp_path / "m.pt",
            words=["no visible curves"])  # fmt: skip


def test_bad_models(studio, tmp_path):
    model, whole = tmp_path / "m.pt", (studio / "m.pt").read_bytes()

    class Evil:
        def __reduce__(self):
            return (open, (str(tmp_path / "owned"), "w"))

    for content in (
        b"",
        b"not a model",
        whole[: len(whole) // 2],
        whole[:-40],
        pickle.dumps(Evil()),
        pickle.dumps([1, 2]),
    ):
        model.write_bytes(content)
        refused("render", model, studio / "ball.ply", "-o", tmp_path / "x.svg", words=["m.pt"])
    evil = io.BytesIO()
    np.lib.format.write_array(evil, np.array([Evil()], object))
    array = next(name for name in zipfile.ZipFile(studio / "m.pt").namelist() if "weight" in name)
    for damaged, damage in (
        (array, lambda data: evil.getvalue()),
        (array, lambda data: data[:-9]),
        ("model.json", lambda data: b"{}"),
    ):
        with zipfile.ZipFile(studio / "m.pt") as old, zipfile.ZipFile(model, "w") as new:
            for name in old.namelist():
                new.writestr(name, damage(old.read(name)) if name == damaged else old.read(name))
        refused("render", model, studio / "ball.ply", "-o", tmp_path / "x.svg", words=["m.pt"])
    refused(
        "render", tmp_path / "no.pt", studio / "ball.ply", "-o", tmp_path / "x.svg", words=["no.pt"]
    )
    refused(
        "render",
        studio / "drawing.png",
        studio / "ball.ply",
        "-o",
        tmp_path / "x.svg",
        words=["drawing.png"],
    )
    assert not (tmp_path / "owned").exists() and not (tmp_path / "x.svg").exists()


def test_a_model_from_a_newer_version(studio, tmp_path):
    write_model(tmp_path / "m.pt", read_model(studio / "m.pt") | {"format": 999})
    refused(
        "render",
        tmp_path / "m.pt",
        studio / "ball.ply",
        "-o",
        tmp_path / "x.svg",
        words=["m.pt", "newer"],
    )


def test_outputs_that_cannot_be_written(studio, tmp_path):
    refused(
        "fit",
        studio / "drawing.png",
        studio / "torus.obj",
        "-o",
        tmp_path / "no" / "m.pt",
        *VIEW,
        words=["no folder"],
    )
    refused(
        "render",
        studio / "m.pt",
        studio / "ball.ply",
        "-o",
        tmp_path / "no" / "x.svg",
        words=["no folder"],
    )
    (tmp_path / "file").write_text("x")
    refused(
        "render",
        studio / "m.pt",
        studio / "ball.ply",
        "-o",
        tmp_path / "file" / "sub/",
        words=["file"],
    )


def test_lines_of_a_drawing_in_a_learned_hand(studio, tmp_path):
    drawn, out = tmp_path / "a.svg", tmp_path / "b.svg"
    assert run("render", studio / "m.pt", studio / "ball.ply", "-o", drawn, *VIEW).exit_code == 0
    result = run(
        "edit",
        drawn,
        "-o",
        out,
        "--recolor",
        "#00ff00",
        "--restyle",
        studio / "m.pt",
        "--drop",
        "<5",
    )
    assert result.exit_code == 0, result.stderr
    before, after = strokes_of(drawn), strokes_of(out)
    assert after and sum(len(widths) for _, widths in after) > 0.5 * sum(
        len(widths) for _, widths in before
    )
    assert "#00ff00" not in out.read_text()  # the ink is the model's


def test_named_parts_from_the_mesh_to_the_edit(studio, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    parts = shapes.wheel(3)
    (tmp_path / "wheel.obj").write_text(shapes.obj_text(parts))
    scene = trimesh.Scene()
    for name, shape in parts.items():
        scene.add_geometry(trimesh.Trimesh(*shape, process=False), node_name=name)
    scene.export(tmp_path / "wheel.glb")
    model = ("render", studio / "m.pt")
    options = ("--texture", "none", "--seed", "3")
    drawn = run(*model, "wheel.obj", "-o", "-", *options, *VIEW).stdout
    inner = [label for label in labels(drawn) if label != "contour"]
    assert sorted(inner) == sorted(parts) and set(parts_of(drawn)) == set(parts)
    of_scene = run(*model, "wheel.glb", "-o", "-", *options, *VIEW).stdout
    assert set(parts_of(of_scene)) == set(parts)
    # a saved view, and lines from another program
    for output in ("wheel.npz", "lines.svg", "wheel.json"):
        assert run("extract", "wheel.obj", "-o", output, *VIEW).exit_code == 0
    saved = run(*model, "wheel.npz", "-o", "-", *options).stdout
    assert labels(saved) == labels(drawn) and parts_of(saved) == parts_of(drawn)
    assert set(labels((tmp_path / "lines.svg").read_text())) >= set(parts)
    for lines in ("lines.svg", "wheel.json"):
        foreign = run(*model, "wheel.obj", "-o", "-", "--curves", lines, *options, *VIEW).stdout
        assert set(parts_of(foreign)) == set(parts)
        assert set(labels(foreign)) == set(labels(drawn))  # kinds, too, come back from the groups
    # the file turned inside out, edited and drawn in another hand
    (tmp_path / "wheel.svg").write_text(drawn)
    edit = (
        "edit",
        "wheel.svg",
        "-o",
        "-",
        "--layers",
        "part",
        "--recolor",
        "tire,hub=#00ff00",
        "--drop",
        "spoke 1",
    )
    edited = run(*edit).stdout
    colors = parts_of(edited)
    assert (
        colors["tire"] == colors["hub"] == {"#00ff00"} != colors["spoke 2"]
        and "spoke 1" not in colors
    )
    assert [label for label in labels(edited) if label != "contour"] == [
        n for n in inner if n != "spoke 1"
    ]
    again = run("edit", "wheel.svg", "-o", "-", "--restyle", studio / "m.pt").stdout
    assert set(parts_of(again)) == set(parts)
    refused(
        "edit",
        "wheel.svg",
        "-o",
        "no.svg",
        "--drop",
        "spok",
        words=["'spok'", "contour", "hub, spoke 1"],
    )
    stages = run(*model, "wheel.obj", "--stages", "figure", *VIEW)
    assert stages.exit_code == 0
    for name in ("1-curves", "2-displaced", "4-textured"):
        assert set(labels((tmp_path / "figure" / f"wheel-{name}.svg").read_text())) >= set(parts)
