"""Two trees of this project side by side: seconds, CPU seconds and peak memory, old and new.

    python benchmarks/compare.py OLD NEW [--rows render fit ...] [--runs 3]

OLD and NEW are folders that hold src/strokestyle, or revisions of this repository, which are
checked out for as long as this runs. Both run in this Python, on the same files, in turn; each
number is the median of its runs. Each tree learns its model for itself. Wall seconds are what a
person waits, on an idle machine; while others compute, CPU seconds are the fairer measure.

Meshes are closed forms, made here. With STROKESTYLE_SHARED set, a folder with meshes/hammer.obj,
meshes/nefertiti.obj, shapes/spot/ and styles/charcoal_loose/, they and that drawing are taken, and
the largest are nefertiti with each face cut into four.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("STROKESTYLE_SHARED", "/nonexistent"))
CANVAS = 768  # px
MESHES = 10  # of one process that draws several
VIEWS = 5  # further ones of a mesh
UNIT = 1 if sys.platform == "darwin" else 1024  # bytes of ru_maxrss
COMMAND = "from strokestyle.cli import main; main()"  # it is there in every layout

CLOCK = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
wall = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([wall, used.ru_utime, used.ru_stime, used.ru_maxrss]))
sys.exit(code)
"""  # runs a command, and prints what it took

Measured = dict[str, float]  # by measure: "wall s", "CPU s", "MB"


class Row(NamedTuple):
    """What is compared.

    measure : what one run of a tree takes
    ratio : by measure, the most that NEW may take of what OLD takes
    most : by measure, the most that NEW may take
    """

    title: str
    measure: Callable[[Tree, Path], Measured]
    ratio: Measured = {}
    most: Measured = {}


class Tree(NamedTuple):
    """One of both trees, and the folder where what it makes goes."""

    source: Path
    folder: Path

    @property
    def model(self) -> Path:
        """What it learned of the drawing with the quick preset."""
        path = self.folder / "model.pt"
        if not path.exists():
            fit(self, "quick")
        return path

    def run(self, *words: Any) -> Measured:
        """Run a command, imports included."""
        return measured(self.source, "-c", COMMAND, *words, "-q")

    def child(self, name: str, *words: Any) -> Measured:
        """Run a function of this script in a process that imports this tree."""
        command = [sys.executable, __file__, "--child", name, *map(str, words)]
        done = subprocess.run(
            command, env=environment(self.source), stdout=subprocess.PIPE, check=True
        )
        return json.loads(done.stdout)


def environment(source: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(source)}


def measured(source: Path, *words: Any) -> Measured:
    """Run Python with these words, as the child of a small process.

    A process begins with the peak memory of the one that it was forked from (Linux), and this one's
    is large.
    """
    command = [sys.executable, "-c", CLOCK, sys.executable, *map(str, words)]
    done = subprocess.run(command, env=environment(source), stdout=subprocess.PIPE, check=False)
    if done.returncode:
        sys.exit(f"{source}: {' '.join(map(str, words))} failed")
    wall, user, system, most = json.loads(done.stdout)
    return {"wall s": wall, "CPU s": user + system, "MB": most * UNIT / 1e6}


@contextlib.contextmanager
def tree(name: str, folder: Path) -> Iterator[Tree]:
    """A tree by its folder or revision; a revision's is removed at the end."""
    folder.mkdir()
    if (Path(name) / "src" / "strokestyle").is_dir():
        yield Tree(Path(name).resolve() / "src", folder)
        return
    place, git = folder / "tree", ["git", "-C", str(ROOT), "worktree"]
    subprocess.run([*git, "add", "--quiet", "--detach", str(place), name], check=True)
    try:
        yield Tree(place / "src", folder)
    finally:
        subprocess.run([*git, "remove", "--force", str(place)], check=True)


# ------------------------------------------------------------------------------------ what is drawn


def mesh(files: Path, faces: int) -> Path:
    """A mesh of about so many faces."""
    path = files / f"{faces}.obj"
    known = {60_000: "hammer", 70_000: "nefertiti"}
    if SHARED.is_dir() and faces in known:
        return SHARED / "meshes" / f"{known[faces]}.obj"
    if not path.exists() and SHARED.is_dir():
        vertices, triangles = read_obj(mesh(files, faces // 4))
        write_obj(path, *subdivide(vertices, triangles))
    elif not path.exists():
        write_obj(path, *blob(faces, 0.0))
    return path


def several(files: Path) -> list[Path]:
    """MESHES meshes of 60,000 faces, which are as costly as one another."""
    paths = [files / f"mesh-{i}.obj" for i in range(MESHES)]
    for path in paths:
        if not path.exists():
            path.write_bytes(mesh(files, 60_000).read_bytes())
    return paths


def blob(faces: int, phase: float) -> tuple[np.ndarray, np.ndarray]:
    """A sphere with waves on it: vertices (V, 3) and triangles (F, 3)."""
    n = max(round(np.sqrt(faces / 4)), 8)  # meridians are twice as many as parallels
    polar = np.linspace(0, np.pi, n + 1)[1:-1, None]
    around = np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)
    waves = np.sin(5 * around + phase) * np.sin(polar) ** 5 + np.sin(7 * polar)
    radius = 1 + 0.12 * waves
    x, y, z = np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar), np.cos(polar)
    ball = np.stack(np.broadcast_arrays(x, y, z), axis=2) * radius[..., None]
    poles = [[0, 0, 1.0], [0, 0, -1.0]]
    index = np.arange(ball[..., 0].size).reshape(n - 1, 2 * n)
    right = np.roll(index, -1, axis=1)
    a, b, c, d = index[:-1], index[1:], right[1:], right[:-1]
    quads = [np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]
    north, south = np.full(2 * n, index.size), np.full(2 * n, index.size + 1)
    caps = [np.stack([north, index[0], right[0]], 1), np.stack([south, right[-1], index[-1]], 1)]
    triangles = np.vstack([*(part.reshape(-1, 3) for part in quads), *caps])
    return np.vstack([ball.reshape(-1, 3), poles]), triangles


def subdivide(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut each triangle into four, at the middles of its sides."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, edge = np.unique(sides, axis=0, return_inverse=True)
    middle = len(vertices) + edge.reshape(-1, 3)
    corners = [np.stack([triangles[:, i], middle[:, i], middle[:, i - 1]], 1) for i in range(3)]
    return np.vstack([vertices, vertices[edges].mean(axis=1)]), np.vstack([*corners, middle])


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    lines = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([words[1:4] for words in lines if words[:1] == ["v"]], float)
    faces = [[w.split("/")[0] for w in words[1:4]] for words in lines if words[:1] == ["f"]]
    return vertices, np.array(faces, int) - 1


def write_obj(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    with open(path, "w") as file:
        np.savetxt(file, vertices, "v %.8f %.8f %.8f")
        np.savetxt(file, triangles + 1, "f %d %d %d")


def curve_file(files: Path, count: int) -> Path:
    """A file of arcs on the canvas, of 20 to 200 px, each a stroke."""
    path = files / f"{count}.json"
    if not path.exists():
        random = np.random.default_rng(0)
        arcs = []
        for _ in range(count):
            radius, angle = random.uniform(40, 200), random.uniform(0, 2 * np.pi)
            length = random.uniform(20, min(200, 2 * radius))
            t = angle + np.linspace(0, length / radius, 40)
            arc = radius * np.stack([np.cos(t), np.sin(t)], axis=1)
            low, high = arc.min(axis=0), arc.max(axis=0)
            arcs.append(arc - low + random.uniform(10, CANVAS - 10 - (high - low)))
        path.write_text(
            json.dumps({"size": [CANVAS, CANVAS], "curves": [arc.tolist() for arc in arcs]})
        )
    return path


# ----------------------------------------------------------------------------------------- commands


def fit(tree: Tree, preset: str) -> Measured:
    words = [ROOT / "examples/drawings/charcoal.png", ROOT / "examples/shapes/elephant.ply"]
    if SHARED.is_dir():
        spot = SHARED / "shapes/spot"
        drawing = SHARED / "styles/charcoal_loose/spot/drawing.png"
        words = [drawing, spot / "mesh.obj", "--camera", spot / "camera.json"]
    model = tree.folder / ("model.pt" if preset == "quick" else f"{preset}.pt")
    return tree.run("fit", *words, "-o", model, "--preset", preset)


def first_mesh(tree: Tree, files: Path) -> Measured:
    return tree.run("render", tree.model, several(files)[0], "-o", tree.folder / "x.svg")


def further_mesh(tree: Tree, files: Path) -> Measured:
    one = tree.run("render", tree.model, several(files)[0], "-o", tree.folder / "x.svg")
    every = tree.run("render", tree.model, *several(files), "-o", tree.folder / "all")
    further = {name: (every[name] - one[name]) / (MESHES - 1) for name in ("wall s", "CPU s")}
    return further | {"MB": every["MB"]}


def extract(tree: Tree, files: Path) -> Measured:
    return tree.run("extract", mesh(files, 1_120_000), "-o", tree.folder / "x.svg")


def thickness(tree: Tree, files: Path) -> Measured:
    drawn, edited = tree.folder / "264.svg", tree.folder / "edited.svg"
    if not drawn.exists():
        words = ("--curves", curve_file(files, 264), "--texture", "vector", "-o", drawn)
        tree.run("render", tree.model, ROOT / "examples/shapes/teapot.ply", *words)
    return tree.run("edit", drawn, "-o", edited, "--thickness", "1.5")


# ----------------------------------------------------------------------------------- in one process


class Library(NamedTuple):
    """What is called here of either tree, whose modules have other names."""

    load_surface: Callable
    fit_camera: Callable
    extract_view: Callable
    view_of_curves: Callable
    load_curves: Callable
    load_style: Callable
    write_svg: Callable

    @classmethod
    def of_this_process(cls) -> Library:
        try:
            import strokestyle.extract.pipeline
        except ModuleNotFoundError:
            return cls._before_packages()
        import strokestyle as s

        return cls(
            s.load_surface, s.fit_camera, s.extract_view, s.view_of_curves, s.load_curves,
            s.load_style, s.write_svg,
        )  # fmt: skip

    @classmethod
    def _before_packages(cls) -> Library:
        from strokestyle.camera import fit_camera  # type: ignore
        from strokestyle.curve_files import load_curves  # type: ignore
        from strokestyle.style import load_style  # type: ignore
        from strokestyle.surface import load_surface  # type: ignore
        from strokestyle.view import extract, view_of  # type: ignore

        from strokestyle.svg import write_svg

        return cls(load_surface, fit_camera, extract, view_of, load_curves, load_style, write_svg)


def clocked(work: Callable[[], Any]) -> tuple[Any, Measured]:
    wall, cpu = time.perf_counter(), time.process_time()
    made = work()
    return made, {"wall s": time.perf_counter() - wall, "CPU s": time.process_time() - cpu}


def child_views(path: str, small: str) -> list[Measured]:
    """The first view of a mesh, which is read for it, and the median of VIEWS further ones.

    All with their feature maps, which a tree may not work out before they are asked for; then
    further views alone. A small mesh before them takes what is done once a process.
    """
    library = Library.of_this_process()

    def look(surface: Any, i: int) -> Any:
        camera = library.fit_camera(surface.vertices, f"{25 + 10 * i},{15 + 5 * i}")
        return library.extract_view(surface, camera)

    def look_whole(surface: Any, i: int) -> Any:
        return look(surface, i).maps.values

    def first(path: str) -> Any:
        surface = library.load_surface(path)
        look_whole(surface, 0)
        return surface

    first(small)
    surface, begun = clocked(lambda: first(path))
    views = [begun]
    for way in (look_whole, look):
        more = [clocked(lambda way=way, i=i: way(surface, i + 1))[1] for i in range(VIEWS)]
        views.append({name: median(one[name] for one in more) for name in begun})
    return views


def child_write_svg(model: str, shape: str, curves: str) -> Measured:
    """Write a drawing of arcs as vectors."""
    library = Library.of_this_process()
    surface = library.load_surface(shape)
    camera = library.fit_camera(surface.vertices)
    lines = library.load_curves(curves, (camera.width, camera.height))
    drawing = library.load_style(model).draw(library.view_of_curves(surface, camera, lines))
    return clocked(lambda: library.write_svg(drawing, texture="vector"))[1]


def views(tree: Tree, files: Path, faces: int) -> list[Measured]:
    return tree.child("views", mesh(files, faces), ROOT / "examples/shapes/teapot.ply")


def write_svg(tree: Tree, files: Path) -> Measured:
    shape = ROOT / "examples/shapes/teapot.ply"
    return tree.child("write_svg", tree.model, shape, curve_file(files, 300))


# ----------------------------------------------------------------------------------------- compared

ROWS = {
    "render": Row("render, first mesh of 60k faces, whole process", first_mesh, {"wall s": 0.6}),
    "further": Row("render, each further mesh", further_mesh, {"wall s": 0.5}),
    "first-view": Row(
        "first view of 280k faces, in a process: read, lines, maps",
        lambda tree, files: views(tree, files, 280_000)[0],
        {"CPU s": 0.4},
    ),
    "extract": Row(
        "extract, 1,120,000 faces, whole process", extract, {"CPU s": 0.33}, {"MB": 700}
    ),
    "further-maps": Row(
        "further view of 70k faces, in a process, with its maps",
        lambda tree, files: views(tree, files, 70_000)[1],
    ),
    "further-view": Row(
        "further view of 70k faces, in a process",
        lambda tree, files: views(tree, files, 70_000)[2],
        {"CPU s": 0.4},
    ),
    "quick": Row("fit --preset quick", lambda tree, files: fit(tree, "quick"), {"wall s": 0.6}),
    "standard": Row(
        "fit --preset standard", lambda tree, files: fit(tree, "standard"), {"wall s": 0.6}
    ),
    "write": Row("write_svg, 300 strokes, vector", write_svg, {"wall s": 0.5}),
    "edit": Row("edit --thickness, 264 strokes, vector", thickness, most={"wall s": 1.0}),
}


def compare(row: Row, old: Tree, new: Tree, files: Path, runs: int) -> None:
    """Print a line for each measure of a row."""
    made: dict[Tree, list[Measured]] = {old: [], new: []}
    for _ in range(runs):
        for tree in made:
            made[tree].append(row.measure(tree, files))
    title = row.title
    for name in made[old][0]:
        a, b = (median(one[name] for one in made[tree]) for tree in (old, new))
        limits = [f"<= {row.ratio[name]:g} of old"] if name in row.ratio else []
        limits += [f"<= {row.most[name]:g} {name}"] if name in row.most else []
        digits = 0 if name == "MB" else 2
        print(
            f"{title:57s} {name:>6s} {a:8.{digits}f} {b:8.{digits}f} {b / a:6.2f}  "
            + ", ".join(limits),
            flush=True,
        )
        title = ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", metavar="OLD", help="a folder with src/strokestyle, or a revision")
    parser.add_argument("new", metavar="NEW")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--runs", type=int, default=3)
    args = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} when begun, {args.runs} runs")
    print(f"{'':57s} {'':>6s} {'old':>8s} {'new':>8s} {'ratio':>6s}  wanted")
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        old, new = (
            stack.enter_context(tree(getattr(args, name), Path(folder, name)))
            for name in ("old", "new")
        )
        files = Path(folder, "files")
        files.mkdir()
        # modules are compiled once, as where they are installed
        os.environ["PYTHONPYCACHEPREFIX"] = str(Path(folder, "compiled"))
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        for each in (old, new):
            each.run("extract", ROOT / "examples/shapes/teapot.ply", "-o", each.folder / "x.svg")
        for name in args.rows:
            compare(ROWS[name], old, new, files, args.runs)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        json.dump(globals()[f"child_{sys.argv[2]}"](*sys.argv[3:]), sys.stdout)
    else:
        main()
