"""Blender's Line Art against `extract`: seconds of whole processes, from a mesh file to lines.

    python benchmarks/line_art.py BPY_PYTHON MESH.obj [--runs 5]

BPY_PYTHON is a Python that has Blender as a module (`pip install bpy`, 5.0 or newer). Its process
imports Blender, reads the mesh, looks at it with a camera, and evaluates Line Art's modifier, which
draws contours, creases, borders and intersections. Ours is `strokestyle extract` to an SVG, once of
the lines that Line Art has and once of all. They run in turn; each number is the median.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

HARD = "contour,boundary,crease,intersection"
LINE_ART = """
import sys
import bpy
from mathutils import Vector

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.obj_import(filepath=sys.argv[1])
shape = next(one for one in bpy.context.scene.objects if one.type == "MESH")
corners = [shape.matrix_world @ Vector(corner) for corner in shape.bound_box]
middle, size = sum(corners, Vector()) / 8, max(shape.dimensions)
eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
bpy.context.scene.collection.objects.link(eye)
eye.location = middle + size * Vector((1.5, -1.5, 1.0))
eye.rotation_euler = (middle - eye.location).to_track_quat("-Z", "Y").to_euler()
bpy.context.scene.camera = eye
bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 768
bpy.ops.object.grease_pencil_add(type="LINEART_SCENE")
lines = next(one for one in bpy.context.scene.objects if one.type == "GREASEPENCIL")
graph = bpy.context.evaluated_depsgraph_get()
graph.update()
drawn = lines.evaluated_get(graph).data.layers[0].frames[0].drawing.strokes
sys.exit(0 if len(drawn) else "no lines")
"""


def clocked(command: list[str]) -> tuple[float, float]:
    """Wall and CPU seconds of a command."""
    used, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    wall, now = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("bpy_python")
    parser.add_argument("mesh")
    parser.add_argument("--runs", type=int, default=5)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder, "x.svg"))
        ours = [sys.executable, "-m", "strokestyle", "extract", args.mesh, "-o", out, "-q"]
        commands = {
            "Blender's Line Art": [args.bpy_python, "-c", LINE_ART, args.mesh],
            "extract, its lines": [*ours, "--lines", HARD],
            "extract, all lines": ours,
        }
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
        for _ in range(args.runs):
            for name, command in commands.items():
                found[name].append(clocked(command))
    for name, each in found.items():
        wall, cpu = (median(values) for values in zip(*each, strict=True))
        print(f"{name:20} {wall:6.2f} s, CPU {cpu:6.2f} s")


if __name__ == "__main__":
    main()
