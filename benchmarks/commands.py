"""Whole commands as a user runs them: seconds, CPU seconds and peak memory of every process.

    python benchmarks/commands.py [--presets quick standard]

Imports are part of it. The drawings and the shapes are the project's own; with STROKESTYLE_SHARED
set, its largest meshes are drawn as well.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXAMPLES = Path(__file__).parent.parent / "examples"


def measure(*command):
    """(wall seconds, CPU seconds, peak resident MiB) of `strokestyle *command`."""
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "strokestyle", *map(str, command)])
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"strokestyle {' '.join(map(str, command))} failed")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def row(label, *command):
    wall, cpu, memory = measure(*command)
    print(f"{label:44s} {wall:8.1f} {cpu:8.2f} {memory:9.0f}", flush=True)


def fit_rows(folder, presets):
    """Learn every drawing of the project with every preset; the models go to `folder`."""
    shape = EXAMPLES / "shapes" / "elephant.ply"
    for preset in presets:
        for drawing in sorted((EXAMPLES / "drawings").glob("*.png")):
            model = folder / f"{drawing.stem}.pt"
            words = ("fit", drawing, shape, "-o", model, "--preset", preset, "-q")
            row(f"fit {drawing.stem} --preset {preset}", *words)


def shape_rows(folder, shapes):
    """Extract and draw every shape, and then draw all in one process, with a model of `folder`."""
    model = folder / "charcoal.pt"
    outputs = [folder / f"x.{suffix}" for suffix in ("png", "svg", "npz", "json")]
    files = [word for output in outputs for word in ("-o", output)]
    for shape in shapes:
        row(f"extract {shape.stem} (all four files)", "extract", shape, *files, "-q")
        row(f"render {shape.stem}", "render", model, shape, "-o", folder / "x.svg", "-q")
    words = ("render", model, *shapes, "-o", folder / "all", "-q")
    row(f"render {len(shapes)} shapes, one process", *words)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presets", nargs="*", default=["quick"])
    args = parser.parse_args()
    shapes = sorted((EXAMPLES / "shapes").glob("*.*"))
    shared = Path(os.environ.get("STROKESTYLE_SHARED", "/nonexistent")) / "meshes"
    shapes += [shared / name for name in ("spot.obj", "nefertiti.obj") if (shared / name).exists()]
    print(f"{os.cpu_count()} cores\n{'command':44s} {'wall s':>8s} {'CPU s':>8s} {'peak MiB':>9s}")
    with tempfile.TemporaryDirectory() as folder:
        row("--version, which imports no library", "--version")
        fit_rows(Path(folder), args.presets)
        shape_rows(Path(folder), shapes)


if __name__ == "__main__":
    main()
