"""Whole commands as a user runs them: wall and CPU seconds and peak memory of every process, imports included.

    python benchmarks/commands.py [--presets quick standard]

The drawing and the shapes are the project's own; with STROKESTYLE_SHARED set, its largest meshes are drawn as well.
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
    process = subprocess.Popen([sys.executable, "-m", "strokestyle", *map(str, command), "-q"])
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"strokestyle {' '.join(map(str, command))} failed")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def row(label, *command):
    wall, cpu, memory = measure(*command)
    print(f"{label:44s} {wall:8.1f} {cpu:8.1f} {memory:9.0f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presets", nargs="*", default=["quick"])
    args = parser.parse_args()
    drawings = sorted((EXAMPLES / "drawings").glob("*.png"))
    drawn_over = EXAMPLES / "shapes" / "elephant.ply"
    shapes = sorted((EXAMPLES / "shapes").glob("*.*"))
    shared = Path(os.environ.get("STROKESTYLE_SHARED", "/nonexistent")) / "meshes"
    shapes += [shared / name for name in ("spot.obj", "nefertiti.obj") if (shared / name).exists()]
    print(f"{os.cpu_count()} cores\n{'command':44s} {'wall s':>8s} {'CPU s':>8s} {'peak MiB':>9s}")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for preset in args.presets:
            for drawing in drawings:
                words = (
                    "fit",
                    drawing,
                    drawn_over,
                    "-o",
                    folder / f"{drawing.stem}.pt",
                    "--preset",
                    preset,
                )
                row(f"fit {drawing.stem} --preset {preset}", *words)
        model = folder / "charcoal.pt"
        for shape in shapes:
            files = [
                word
                for suffix in ("png", "svg", "npz", "json")
                for word in ("-o", folder / f"x.{suffix}")
            ]
            row(f"extract {shape.stem} (all four files)", "extract", shape, *files)
            row(f"render {shape.stem}", "render", model, shape, "-o", folder / "x.svg")
        row(
            f"render {len(shapes)} shapes, one process",
            "render",
            model,
            *shapes,
            "-o",
            folder / "all",
        )


if __name__ == "__main__":
    main()
