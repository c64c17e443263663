"""What learning and drawing cost, against what they may cost.

    python benchmarks/fit.py [SHARED] [--sections fit render paper]
                             [--drawings charcoal ...] [--presets quick standard]

Prints tables `what | target | measured`. Drawings and shapes are the project's own. With SHARED (or
STROKESTYLE_SHARED), a folder of meshes/*.obj, `render` draws those of 15,000 to 25,000 faces.
Seconds are wall time; on a machine that does other work as well, CPU time (in brackets, user and
system, of all threads) is the fairer figure. Each measurement has a process of its own.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from commands import EXAMPLES, measure

PROCESS = Path(__file__).resolve()
SHAPE = EXAMPLES / "shapes" / "elephant.ply"
MOST = {"quick": 30, "standard": 180}  # s
FACES = 15_000, 25_000


def row(what, target, measured):
    print(f"{what:58s} | {target:>9s} | {measured}", flush=True)


def head(title):
    print(
        f"\n{title}\n{'what':58s} | {'target':>9s} | measured\n{'-' * 58} | {'-' * 9} | {'-' * 8}"
    )


def child(*words):
    """What a function of this script, run in a new process, returns."""
    done = subprocess.run(
        [sys.executable, PROCESS, "--child", *map(str, words)], stdout=subprocess.PIPE, check=True
    )
    return json.loads(done.stdout)


# ---------------------------------------------------------------------------------------------- fit


def fit_stages(drawing, preset):
    """Seconds, steps of each stage of a fit in this process."""
    from strokestyle.fit import progress as fit_progress
    from strokestyle.fit import train as fitting
    from strokestyle.fit.exemplar import load_exemplar

    fit_progress.REPORT_INTERVAL = 0.0
    view = example_view(SHAPE)
    exemplar, _ = load_exemplar(drawing, view.camera.width, view.camera.height, view.curves.xy)
    begin, stages, last = time.perf_counter(), {}, [time.perf_counter()]

    def progress(event):
        now = time.perf_counter()
        if event.step:
            seconds, steps = stages.get(event.stage, (0.0, 0))
            stages[event.stage] = (seconds + now - last[0], steps + 1)
        last[0] = now

    fitting.fit_style(view, exemplar, fitting.PRESETS[preset], device="cpu", progress=progress)
    return {"total": time.perf_counter() - begin, "stages": stages}


def example_view(shape):
    from strokestyle.extract.camera import fit_camera
    from strokestyle.extract.pipeline import extract_view
    from strokestyle.mesh.surface import load_surface

    surface = load_surface(shape)
    return extract_view(surface, fit_camera(surface.vertices, "three-quarter"))


def fits(drawings, presets, folder):
    head("fit, 768 x 768 px, whole processes")
    for preset in presets:
        for name in drawings:
            drawing = EXAMPLES / "drawings" / f"{name}.png"
            wall, cpu, peak = measure(
                "fit", drawing, SHAPE, "-o", folder / f"{name}.pt", "--preset", preset
            )
            row(
                f"fit {name} --preset {preset}", f"<= {MOST[preset]} s", f"{wall:.1f} s ({cpu:.1f})"
            )
            row(f"fit {name} --preset {preset}, peak memory", "<= 3 GB", f"{peak / 1024:.2f} GB")
        done = child("fit_stages", EXAMPLES / "drawings" / f"{drawings[0]}.png", preset)
        for stage, (seconds, steps) in done["stages"].items():
            row(
                f"  {preset}, {stage}: {steps} steps",
                "",
                f"{1000 * seconds / steps:.1f} ms a step, {seconds:.1f} s",
            )


# ------------------------------------------------------------------------------------------- render

STAGES = ("import", "load the model", "read the mesh", "curves", "maps", "draw", "write")


def render_stages(model, *meshes):
    """(wall, CPU) seconds of each of STAGES for each mesh; import and model count for the first."""
    table, clock = [], [time.perf_counter(), time.process_time()]

    def lap():
        now = [time.perf_counter(), time.process_time()]
        table[-1].append([b - a for a, b in zip(clock, now, strict=True)])
        clock[:] = now

    table.append([])
    from strokestyle.extract.camera import fit_camera
    from strokestyle.extract.feature_maps import feature_maps
    from strokestyle.extract.lines import feature_curves
    from strokestyle.extract.rays import Bvh
    from strokestyle.extract.tidy import tidy
    from strokestyle.extract.view import View
    from strokestyle.extract.visible import look_along
    from strokestyle.geometry.curves import DEFAULT_SPACING, resample_curves
    from strokestyle.mesh.surface import load_surface
    from strokestyle.render.style_file import load_style
    from strokestyle.svg.write import write_svg

    lap()
    style = load_style(model)
    lap()
    for i, mesh in enumerate(meshes):
        if i:
            table.append([[0.0, 0.0], [0.0, 0.0]])
        surface = load_surface(mesh)
        lap()
        camera, scene = fit_camera(surface.vertices, "three-quarter"), Bvh(surface)
        seen = look_along(surface, camera, feature_curves(surface, camera), scene).fragments()
        size = (camera.width, camera.height)
        curves = resample_curves(tidy(seen.curves, seen.strength, size=size), DEFAULT_SPACING)
        lap()
        view = View(camera, curves, feature_maps(surface, camera, curves, scene))
        lap()
        drawing = style.draw(view)
        lap()
        write_svg(drawing)
        lap()
    return table


def renders(meshes, folder, drawing):
    model = folder / f"{drawing}.pt"
    if not model.exists():
        measure(
            "fit", EXAMPLES / "drawings" / f"{drawing}.png", SHAPE, "-o", model, "--preset", "quick"
        )
    head(
        f"render in the style of {drawing}, textured, 768 x 768 px: "
        "the first mesh of a process, and a further one"
    )
    alone = [measure("render", model, mesh, "-o", folder / "x.svg")[:2] for mesh in meshes]
    for mesh, (wall, cpu) in zip(meshes, alone, strict=True):
        row(f"render {mesh.stem}, whole process", "<= 3 s", f"{wall:.2f} s ({cpu:.2f})")
    if len(meshes) > 1:
        wall, cpu, peak = measure("render", model, *meshes, "-o", folder / "all")
        more = [
            (total - first) / (len(meshes) - 1)
            for total, first in zip((wall, cpu), alone[0], strict=True)
        ]
        row(
            f"each further of {len(meshes)}, one process",
            "<= 1.5 s",
            f"{more[0]:.2f} s ({more[1]:.2f})",
        )
        row("peak memory", "<= 3 GB", f"{peak / 1024:.2f} GB")
    table = child("render_stages", model, *meshes)
    print(f"\n{'seconds (CPU)':16s}" + "".join(f"{mesh.stem:>16s}" for mesh in meshes))
    for k, stage in enumerate(STAGES):
        print(f"{stage:16s}" + "".join(f"{each[k][0]:8.2f} ({each[k][1]:.2f}) " for each in table))
    sums = [[sum(part[i] for part in each) for i in (0, 1)] for each in table]
    print(f"{'together':16s}" + "".join(f"{wall:8.2f} ({cpu:.2f}) " for wall, cpu in sums))


def meshes_of(shared):
    """Meshes of about 20,000 faces, or the project's own shapes."""
    found = []
    for path in sorted(shared.glob("meshes/*.obj")) if shared else []:
        with open(path, "rb") as file:
            if FACES[0] <= sum(line.startswith(b"f ") for line in file) <= FACES[1]:
                found.append(path)
    return found or sorted((EXAMPLES / "shapes").glob("*.ply"))


# -------------------------------------------------------------------------------------------- paper


def paper_steps(size):
    """Seconds a step of both stages of the paper on patches of one size.

    The first step, which warms up, is left out.
    """
    from strokestyle.fit import progress as fit_progress
    from strokestyle.fit import train as fitting
    from strokestyle.fit.exemplar import load_exemplar

    fit_progress.REPORT_INTERVAL, clock = 0.0, {"geometry": [], "texture": []}
    view = example_view(SHAPE)
    drawing = EXAMPLES / "drawings" / "charcoal.png"
    exemplar, _ = load_exemplar(drawing, view.camera.width, view.camera.height, view.curves.xy)
    config = replace(
        fitting.PRESETS["paper"], patches=(int(size),), geometry_steps=4,
        geometry_decay=1, texture_steps=2, texture_decay=1,
    )  # fmt: skip
    fitting.fit_style(
        view,
        exemplar,
        config,
        device="cpu",
        progress=lambda event: clock[event.stage].append(time.perf_counter()),
    )
    seconds = {stage: (times[-1] - times[0]) / (len(times) - 1) for stage, times in clock.items()}
    return seconds | {"peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def paper():
    from strokestyle.fit.neural_strokes import NeuralStrokesConfig

    config = NeuralStrokesConfig()
    head(
        f"fit --preset paper, 768 x 768 px, batches of {config.batch} patches, "
        "on this machine's CPU"
    )
    each = {size: child("paper_steps", size) for size in config.patches}
    for stage, steps in (("geometry", config.geometry_steps), ("texture", config.texture_steps)):
        for size in config.patches:
            row(f"{stage}, patches of {size} px", "", f"{each[size][stage]:.2f} s a step")
        mean = sum(one[stage] for one in each.values()) / len(each)
        hours = mean * steps / 3600
        row(
            f"{stage}, all {steps:,} steps (extrapolated)",
            "",
            f"{mean:.2f} s a step, {hours:.0f} h",
        )
    row("peak memory", "", f"{max(one['peak'] for one in each.values()) / 1024:.2f} GB")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "shared", nargs="?", type=Path, default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("--sections", nargs="+", default=["fit", "render", "paper"])
    parser.add_argument("--drawings", nargs="+", default=["charcoal"])
    parser.add_argument("--presets", nargs="+", default=["quick", "standard"])
    args = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} when begun; seconds: wall (CPU)")
    with tempfile.TemporaryDirectory() as folder:
        if "fit" in args.sections:
            fits(args.drawings, args.presets, Path(folder))
        if "render" in args.sections:
            renders(meshes_of(args.shared and Path(args.shared)), Path(folder), args.drawings[0])
        if "paper" in args.sections:
            paper()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        print(json.dumps(globals()[sys.argv[2]](*sys.argv[3:])))
    else:
        main()
