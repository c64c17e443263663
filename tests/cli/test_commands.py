"""Help, options, and one line for everything that is wrong, as a user meets them."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from command import refused, run
from PIL import Image

from strokestyle import __version__, cli
from strokestyle.cli import options
from strokestyle.cli.view import short_names
from strokestyle.geometry.kinds import SURFACE_KINDS

TETRA = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def sphere(tmp_path):
    import trimesh

    path = tmp_path / "sphere.obj"
    trimesh.creation.icosphere(subdivisions=4).export(path)
    return path


# -------------------------------------------------------------------------------- help and options


@pytest.mark.parametrize("command", [[], ["extract"], ["fit"], ["render"]])
def test_help_has_examples(command):
    result = run(*command, "--help")
    assert result.exit_code == 0
    assert result.output.count("strokestyle ") >= 3
    assert run(*command, "-h").output == result.output


def test_version():
    assert run("--version").output.split() == ["strokestyle,", "version", __version__]


def test_help_imports_nothing_heavy():
    heavy = {"torch", "numpy", "scipy", "trimesh", "PIL", "rich", "svgwrite", "resvg_py"}
    code = (
        "import sys\n"
        "from strokestyle.cli import main\n"
        "for command in ([], *([name] for name in main.commands)):\n"
        "    main([*command, '--help'], standalone_mode=False)\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.count("Usage: ") == 7 and not heavy & set(done.stderr.split())


def test_numpy_multiplies_in_one_thread_unless_the_person_says(monkeypatch):
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    for said in ({}, {"OMP_NUM_THREADS": "3"}, {"OPENBLAS_NUM_THREADS": "2"}):
        for name in names:
            monkeypatch.setenv(name, "")  # so that it is put back as it was
            monkeypatch.delenv(name)
        for name, value in said.items():
            monkeypatch.setenv(name, value)
        assert run("--version").exit_code == 0
        found = {name: os.environ[name] for name in names if name in os.environ}
        assert found == (said or {"OPENBLAS_NUM_THREADS": "1"})


def test_what_help_says_is_what_the_library_does():
    from strokestyle.cli.animation import DEFAULT_RATE
    from strokestyle.extract.camera import DEFAULT_FOV, DEFAULT_SIZE, NAMED_VIEWS, PROJECTIONS
    from strokestyle.extract.line_options import LineOptions
    from strokestyle.fit.train import PRESETS
    from strokestyle.geometry.curves import DEFAULT_SPACING
    from strokestyle.svg.format import LAYERS, TEXTURES, SvgOptions

    commands = cli.main.commands
    defaults = {
        **vars(LineOptions()),
        **vars(SvgOptions()),
        "fov": DEFAULT_FOV,
        "size": DEFAULT_SIZE,
        "spacing": DEFAULT_SPACING,
        "fps": DEFAULT_RATE,
        "png_scale": 1.0,
    }
    told = {}
    for option in (*commands["extract"].params, *commands["render"].params):
        if match := re.search(r"\[default: ([\w.]+)\]$", getattr(option, "help", "") or ""):
            told[option.name] = match[1]
    assert {
        name: f"{defaults[name]:g}" for name in told if name not in ("up", "layers", "formats")
    } == {name: value for name, value in told.items() if name not in ("up", "layers", "formats")}
    assert {"crease", "suggestive", "spacing", "fov", "tones", "decimals"} <= set(told)
    assert told["layers"] == SvgOptions().layers

    assert options.VIEWS.split(", ") == list(NAMED_VIEWS)
    assert options.PROJECTIONS == PROJECTIONS
    assert set(options.PRESET_NAMES) == set(PRESETS)
    assert LineOptions().kinds == tuple(kind for kind in SURFACE_KINDS if kind != "apparent")
    assert options.TEXTURES == TEXTURES
    choices = {option.name: option.type for option in commands["render"].params}
    assert tuple(choices["layers"].choices) == LAYERS


def test_option_groups_hand_over_what_the_library_takes():
    from dataclasses import fields

    from strokestyle.extract.line_options import LineOptions
    from strokestyle.svg.format import SvgOptions

    assert set(options.line_options.flags) <= {field.name for field in fields(LineOptions)}
    assert set(options.file_options.flags) <= {field.name for field in fields(SvgOptions)}
    assert options.line_options.flags["kinds"] == "--lines"
    assert options.common_options.flags["quiet"] == "--quiet"
    assert options.Kinds().convert("all", None, None) == SURFACE_KINDS
    assert options.file_options.given({"page_size": "A4", "tones": None, "seed": 3}) == {
        "page_size": "A4"
    }


@pytest.mark.parametrize(
    "args, words",
    [
        (["extract"], ["SHAPE"]),
        (["extract", "x.obj"], ["--output"]),
        (["extract", "x.obj", "-o", "x.bmp"], ["x.bmp", ".png, .svg, .pdf, .npz or .json"]),
        (["extract", "x.obj", "-o", "x.png", "--view", "sideways"], ["sideways", "three-quarter"]),
        (["extract", "x.obj", "-o", "x.png", "--size", "12"], ["12", "64 to 8192"]),
        (
            ["extract", "x.obj", "-o", "x.png", "--lines", "contour,wrinkle"],
            ["wrinkle", "suggestive"],
        ),
        (["extract", "x.obj", "-o", "x.png", "--detail", "lots"], ["'lots'", "0.5..2"]),
        (
            ["extract", "x.obj", "-o", "x.png", "--detail", "0.5..nan"],
            ["0.5..nan", "between 0.1 and 10"],
        ),
        (["extract", "x.obj", "-o", "x.png", "--detail", "1..20"], ["1..20", "between 0.1 and 10"]),
        (["extract", "x.obj", "-o", "x.png", "--detail", "2..1"], ["LOW to HIGH: 1..2"]),
        (
            ["extract", "x.obj", "-o", "x.png", "--camera", "c.json", "--fov", "30"],
            ["--camera", "--fov"],
        ),
        (["extract", "x.npz", "-o", "x.png", "--fov", "30"], ["saved view", "--fov"]),
        (["fit", "a.png"], ["SHAPE"]),
        (["fit", "a.png", "b.obj", "--preset", "slow"], ["quick", "standard", "paper"]),
        (["render", "m.pt", "a.obj"], ["nothing to write", "-o OUT.svg", "--stages"]),
        (["render", "m.pt", "a.obj", "b.obj", "-o", "out.svg"], ["2 shapes need a folder"]),
        (["render", "m.pt", "a.obj", "-o", "out.bmp"], [".svg"]),
        (["render", "m.pt", "a.obj", "-o", "-", "--png"], ["standard output"]),
    ],
)
def test_usage_errors_exit_with_2(tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    refused(*args, words=words, code=2)
    assert list(tmp_path.iterdir()) == []


# -------------------------------------------------------------------------------------- bad shapes

BAD_MESHES = {
    "empty.obj": (b"", ["empty"]),
    "notes.obj": (b"dear diary, today I drew a cow\n", []),
    "noise.ply": (bytes(range(256)) * 4, []),
    "noise.stl": (b"solid \xff\xfe" * 10, []),
    "truncated.ply": (
        b"ply\nformat ascii 1.0\nelement vertex 4\n"
        b"property float x\nproperty float y\nproperty float z\n"
        b"element face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n",
        [],
    ),
    "truncated.glb": (b"glTF\x02\x00\x00\x00\xff\x00\x00\x00", []),
    "points.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", ["no faces"]),
    "nan.obj": (TETRA.replace("v 0 0 1", "v 0 0 nan").encode(), []),
    "inf.obj": (TETRA.replace("v 0 0 1", "v 0 0 inf").encode(), []),
    "flat.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", []),
    "point.obj": (b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", []),
    "index.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", []),
    "shape.txt": (TETRA.encode(), [".txt"]),
    "shape": (TETRA.encode(), []),
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_bad_meshes_get_one_line(tmp_path, name):
    content, words = BAD_MESHES[name]
    path, out = tmp_path / name, tmp_path / "out.svg"
    path.write_bytes(content)
    out.write_text("older drawing")
    refused("extract", path, "-o", out, words=[str(path), *words])
    assert out.read_text() == "older drawing"
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "out.svg"])


def test_a_missing_mesh_and_a_folder(tmp_path):
    refused(
        "extract", tmp_path / "no.obj", "-o", tmp_path / "x.svg", words=["no.obj", "no such file"]
    )
    refused("extract", tmp_path, "-o", tmp_path / "x.svg", words=[str(tmp_path)])


ODD_MESHES = {
    "one triangle": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "huge": "v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nv 0 0 1e30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "tiny": "v 0 0 0\nv 1e-20 0 0\nv 0 1e-20 0\nv 0 0 1e-20\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "far away": "v 1e6 0 0\nv 1000001 0 0\nv 1e6 1 0\nv 1e6 0 1\n"
    "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "duplicate faces": TETRA + "f 1 3 2\nf 3 2 1\nf 2 3 1\n",
    "degenerate faces": TETRA + "f 1 1 2\nf 2 2 2\n",
    "inverted": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n",
    "mixed winding": TETRA.replace("f 1 3 2", "f 1 2 3"),
    "non-manifold": TETRA + "v 1 1 1\nf 1 2 5\n",
    "open": TETRA.replace("f 2 3 4\n", ""),
    "components": TETRA + "v 0 5 0\nv 1 5 0\nv 0 5 1\nf 5 6 7\n",
    "quads": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
    "pentagon": "v 0 0 0\nv 1 0 0\nv 1.5 1 0\nv 0.5 2 0\nv -0.5 1 0\nf 1 2 3 4 5\n",
    "unreferenced vertex": "v 9 9 9\n" + "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\n",
}  # fmt: skip


@pytest.mark.parametrize("name", ODD_MESHES)
def test_odd_meshes_are_drawn(tmp_path, name):
    path = tmp_path / "odd.obj"
    path.write_text(ODD_MESHES[name])
    result = run(
        "extract", path, "-o", tmp_path / "out.json", "-o", tmp_path / "out.png", "--size", "128"
    )
    assert result.exit_code == 0, result.stderr
    got = json.loads((tmp_path / "out.json").read_text())
    xy = np.concatenate([np.array(line) for line in got["curves"]])
    assert (
        np.isfinite(xy).all() and np.ptp(xy, axis=0).max() > 40
    )  # it fills the canvas, whatever its units


# ----------------------------------------------------------------------------------------- extract


def test_extract_writes_every_kind_of_file(tmp_path, sphere):
    outs = [tmp_path / f"out.{suffix}" for suffix in ("png", "svg", "npz", "json")]
    result = run(
        "extract", sphere, *[word for out in outs for word in ("-o", out)], "--size", "256x192"
    )
    assert result.exit_code == 0
    assert "contour 1" in result.stderr and str(outs[0]) in result.stderr
    assert Image.open(outs[0]).size == (256, 192)
    ink = np.asarray(Image.open(outs[0]).convert("L")) < 128
    assert 300 < ink.sum() < 1500
    got = json.loads(outs[3].read_text())
    assert got["size"] == [256, 192] and set(got["kinds"]) == {"contour"}
    # the contour of a sphere, seen in perspective, is a circle
    line = np.array(got["curves"][0])
    radius = np.linalg.norm(line - [128, 96], axis=1)
    assert np.ptp(radius) < 1.5 and abs(radius.mean() - 0.42 * 192) < 1.5
    assert "<svg" in outs[1].read_text()


def test_a_saved_view_gives_the_same_drawing(tmp_path, sphere):
    view, a, b = tmp_path / "v.npz", tmp_path / "a.json", tmp_path / "b.json"
    assert run("extract", sphere, "-o", view, "-o", a, "--size", "128").exit_code == 0
    assert run("extract", view, "-o", b).exit_code == 0
    assert a.read_bytes() == b.read_bytes()


def test_standard_output_and_quiet(tmp_path, sphere):
    result = run("extract", sphere, "-o", "-", "-q", "--size", "128")
    assert result.stdout.startswith(("<svg", "<?xml")) and result.stderr == ""
    assert "curves: " in run("extract", sphere, "-o", "-", "-v", "--size", "128").stderr


def test_cameras_agree_with_named_views(tmp_path, sphere):
    a, b = tmp_path / "a.json", tmp_path / "b.json"
    assert run("extract", sphere, "-o", a, "--size", "128", "--view", "10,20").exit_code == 0
    assert run("extract", sphere, "-o", b, "--camera", a).exit_code == 0
    assert json.loads(a.read_text())["curves"] == json.loads(b.read_text())["curves"]


def test_more_detail_is_more_lines(tmp_path):
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=5)
    x, y, z = mesh.vertices.T
    mesh.vertices *= (1 + 0.08 * np.sin(5 * x) * np.sin(4 * y) * np.cos(3 * z))[:, None]
    mesh.export(tmp_path / "bumpy.ply")
    length = {}
    for detail in ("0.3", "0.3..5", "1", "5", "5..5"):
        assert (
            run(
                "extract", tmp_path / "bumpy.ply", "-o", tmp_path / "a.json", "--detail", detail
            ).exit_code
            == 0
        )
        got = json.loads((tmp_path / "a.json").read_text())
        length[detail] = sum(len(line) for line in got["curves"])
    assert length["0.3"] <= length["0.3..5"] < length["5"] == length["5..5"]
    assert length["0.3"] <= length["1"] < length["5"]


def test_hidden_lines(tmp_path):
    import trimesh

    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.ply")
    result = run(
        "extract",
        tmp_path / "box.ply",
        "-o",
        tmp_path / "a.svg",
        "-o",
        tmp_path / "a.json",
        "--hidden",
    )
    assert result.exit_code == 0 and "; hidden: " in result.stderr
    text = (tmp_path / "a.svg").read_text()
    assert 'inkscape:label="hidden-crease"' in text and "stroke-dasharray" in text
    assert set(json.loads((tmp_path / "a.json").read_text())["hidden"]["kinds"]) == {"crease"}
    refused("extract", "a.npz", "-o", "b.svg", "--hidden", words=["--hidden needs a mesh"], code=2)


def test_outside_curves(tmp_path, sphere):
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 128 128">'
    sheet = "<style>g:has(a),g{fill:red}</style>"
    drawn = f'{head}{sheet}<path clip-path="circle(9px)" d="M10 10L90 90"/></svg>'
    (tmp_path / "c.svg").write_text(drawn)
    result = run(
        "extract",
        sphere,
        "-o",
        tmp_path / "a.json",
        "--curves",
        tmp_path / "c.svg",
        "--size",
        "128",
    )
    assert result.exit_code == 0, result.stderr
    assert "not looked at" in result.stderr and "clip-path 1" in result.stderr
    assert "rules of style sheets (g:has(a)) 1\n" in result.stderr
    assert len(json.loads((tmp_path / "a.json").read_text())["curves"]) == 1


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"curves": [[1, 2]]}', '{"curves": [[["a", 2], [3, 4]]]}']
)
def test_bad_outside_curves(tmp_path, sphere, content):
    (tmp_path / "c.json").write_text(content)
    refused(
        "extract",
        sphere,
        "-o",
        tmp_path / "a.json",
        "--curves",
        tmp_path / "c.json",
        words=["c.json"],
    )


SAME_POINT = '{"eye": [0, 0, 0], "target": [0, 0, 0], "fov_y_deg": 3, "size": [64, 64]}'


@pytest.mark.parametrize("content", ["", "{}", "junk", SAME_POINT])
def test_bad_cameras(tmp_path, sphere, content):
    (tmp_path / "c.json").write_text(content)
    refused(
        "extract",
        sphere,
        "-o",
        tmp_path / "a.json",
        "--camera",
        tmp_path / "c.json",
        words=["c.json"],
    )


def test_bad_views(tmp_path, sphere):
    view = tmp_path / "v.npz"
    assert run("extract", sphere, "-o", view, "--size", "64").exit_code == 0
    whole = view.read_bytes()
    for content in (b"", b"PK nonsense", whole[: len(whole) // 2], whole[:-30]):
        view.write_bytes(content)
        refused("extract", view, "-o", tmp_path / "a.svg", words=["v.npz"])
    np.savez(view, something=np.zeros(3))
    refused("extract", view, "-o", tmp_path / "a.svg", words=["v.npz"])
    np.savez(view, something=np.array([{}], dtype=object))  # a pickle inside: must not be loaded
    refused("extract", view, "-o", tmp_path / "a.svg", words=["v.npz"])


# ----------------------------------------------------------------------------------------- outputs


def test_outputs_that_cannot_be_written(tmp_path, sphere):
    refused("extract", sphere, "-o", tmp_path / "no" / "a.svg", words=["no folder"])
    (tmp_path / "dir.svg").mkdir()
    refused("extract", sphere, "-o", tmp_path / "dir.svg", words=["is a folder"])
    before = sphere.read_bytes()
    refused(
        "extract",
        tmp_path / "sphere.obj",
        "-o",
        tmp_path / "sub.npz" / "x.npz",
        words=["no folder"],
    )
    assert sphere.read_bytes() == before


def test_an_input_is_not_overwritten(tmp_path, sphere):
    view = tmp_path / "v.npz"
    assert run("extract", sphere, "-o", view, "--size", "64").exit_code == 0
    refused("extract", view, "-o", view, words=["is the input"])


def test_files_of_a_page_go_by_their_names_where_these_differ():
    assert short_names(["a/x.svg", "b/y.svg", "-"]) == ["x.svg", "y.svg", "drawing.svg"]
    assert short_names(["a/x.svg", "b/x.svg"]) == ["a/x.svg", "b/x.svg"]
