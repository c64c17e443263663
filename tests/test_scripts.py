"""The shell scripts of examples/, as they stand: with names that have spaces, with shapes that
cannot be drawn, and where a program is missing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh
from quick_command import QuickCommand
from small_styles import plain_style

from strokestyle.batch.journal import read_journal
from strokestyle.render.style_file import save_style

if sys.platform == "win32":
    pytest.skip("no program: no sh on this system", allow_module_level=True)

EXAMPLES = Path(__file__).parent.parent / "examples"
SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.sh"))
SIZE = ("--size", "96")
# what stands in for a program: it does to the curves what it is asked for, seen by its log
STAND_IN = """#!{python} -IS
import shutil, sys
with open(sys.argv[0] + ".log", "a") as log:
    print(*sys.argv[1:], sep="\\n", file=log)
{body}
"""
VPYPE = 'shutil.copy(sys.argv[sys.argv.index("read") + 1], sys.argv[-1])'


@pytest.fixture(scope="module")
def command():
    with QuickCommand() as quick:
        yield quick.folder


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with models and shapes."""
    folder = tmp_path_factory.mktemp("the scripts")
    for name in ("my models/a b.pt", "my models/c.pt", "my shapes/a box.ply", "my shapes/b/c.ply"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if name.endswith(".pt"):
            save_style(folder / name, plain_style(96))
        else:
            trimesh.creation.box((1, 2, 1)).export(folder / name)
    return folder


@pytest.fixture
def run(command, place, tmp_path):
    """Run a script in `place`; programs of `tmp_path` stand before the system's."""

    def run_script(name, *words, path=None, **environment):
        found = os.pathsep.join([str(tmp_path), command, os.environ["PATH"]])
        return subprocess.run(
            ["sh", EXAMPLES / name, *map(str, words)],
            cwd=place,
            env={**os.environ, "PATH": path or found, **environment},
            capture_output=True,
            text=True,
        )

    return run_script


def stand_in(folder, name, body=""):
    (folder / name).write_text(STAND_IN.format(python=sys.executable, body=body))
    (folder / name).chmod(0o755)
    return folder / f"{name}.log"


@pytest.mark.parametrize("name", SCRIPTS)
def test_how_it_is_called_and_what_it_needs_is_one_line(name, run, tmp_path):
    text = (EXAMPLES / name).read_text()
    usage = next(line for line in text.splitlines() if line.startswith(f"#     {name} "))
    assert text.startswith("#!/bin/sh\n# ") and "\nset -eu\n" in text
    assert os.access(EXAMPLES / name, os.X_OK)
    asked = run(name, "model.pt")
    assert (asked.returncode, asked.stderr) == (2, f"{name}: usage: {usage[6:]}\n")
    for tool in ("sh", "cat"):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    bare = run(name, "a", "b", "c", path=str(tmp_path))
    assert bare.returncode == 1 and bare.stderr.startswith(f"{name}: there is no strokestyle here")
    if name in ("inkscape.sh", "vpype.sh"):
        stand_in(tmp_path, "strokestyle")
        bare = run(name, "a", "b", "c", path=str(tmp_path))
        program = name.removesuffix(".sh")
        assert bare.returncode == 1 and bare.stderr.startswith(
            f"{name}: there is no {program} here"
        )


def test_batch(run, place):
    words = ("batch.sh", "my models/c.pt", "my shapes", "drawn here", *SIZE)
    done = run(*words, JOBS="1")
    assert done.returncode == 0, done.stderr
    assert "a%20box.svg" in (place / "drawn here" / "report.html").read_text()
    (place / "my shapes" / "bad.obj").write_text("dear diary")
    done = run(*words)
    (place / "my shapes" / "bad.obj").unlink()
    assert done.returncode == 1 and "1 of 2 shapes are drawn already" in done.stderr
    assert "1 failed" in (place / "drawn here" / "report.html").read_text()
    assert run("batch.sh", "my models/c.pt", "none", "out").stderr == (
        "batch.sh: none: no such folder of shapes\n"
    )


def test_every_style(run, place):
    done = run("every_style.sh", "my models", "my shapes/a box.ply", "styles of it", *SIZE)
    assert done.returncode == 0, done.stderr
    made = sorted(path.name for path in (place / "styles of it").iterdir())
    assert made == ["a b.svg", "c.svg", "styles.html"]
    assert "<title>a box.ply</title>" in (place / "styles of it" / "styles.html").read_text()
    failed = run("every_style.sh", "my shapes", "my shapes/a box.ply", "nothing")
    assert failed.returncode == 1 and "no model (.pt) in this folder" in failed.stderr


def test_turntable(run, place):
    done = run("turntable.sh", "my models/c.pt", "my shapes/a box.ply", "a turn.gif", FRAMES="3",
               SIZE="96")  # fmt: skip
    assert done.returncode == 0, done.stderr
    from PIL import Image

    with Image.open(place / "a turn.gif") as film:
        assert film.size == (96, 96) and film.n_frames == 3


def test_xargs(run, place):
    done = run("xargs.sh", "my models/c.pt", "my shapes", "by xargs", *SIZE, EACH="1", JOBS="2")
    assert done.returncode == 0, done.stderr
    assert {Path(one.output).name for one in read_journal(place / "by xargs")} == {
        "a box.svg",
        "c.svg",
    }
    (place / "my shapes" / "b" / "a box.obj").write_text("")
    twice = run("xargs.sh", "my models/c.pt", "my shapes", "by xargs")
    (place / "my shapes" / "b" / "a box.obj").unlink()
    assert twice.returncode == 1 and "xargs.sh: two shapes are called a box" in twice.stderr


def test_inkscape(run, place, tmp_path):
    """By the program itself, or by one that leaves the curves as they are."""
    log = None if shutil.which("inkscape") else stand_in(tmp_path, "inkscape")
    words = ("inkscape.sh", "my models/c.pt", "my shapes/a box.ply", "by hand.svg", *SIZE)
    done = run(*words, ACTIONS="select-all;path-simplify")
    assert done.returncode == 0, done.stderr
    assert {"by hand.svg", "by hand-curves.svg"} <= set(os.listdir(place))
    if log:
        curves, actions = log.read_text().splitlines()
        assert curves == "by hand-curves.svg" and "select-all;path-simplify;export-f" in actions


def test_vpype(run, place, tmp_path):
    """By the program itself, or by one that copies the curves."""
    if not shutil.which("vpype"):
        stand_in(tmp_path, "vpype", VPYPE)
    done = run("vpype.sh", "my models/c.pt", "my shapes/a box.ply", "joined.svg", *SIZE)
    assert done.returncode == 0, done.stderr
    assert (place / "joined.svg").stat().st_size > 500 and "crease 2" in done.stderr.splitlines()[
        -1
    ]
