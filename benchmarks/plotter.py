"""How far a plotter's pen travels between strokes: our order against vpype's. Prints a table.

    python benchmarks/plotter.py [FILE.svg ...]

Ten drawings of the project's shapes, hatching, and random strokes and rings up to 10,000; or
plotter files, whose strokes are ordered anew. vpype (`pip install vpype`) measures all, in pixels:
`within` is what its `stat` calls the pen-up length, `all` counts the way from one layer to the next
as well. It sorts the strokes as they are painted, which is where ours come from. Seconds are CPU;
vpype's are those of its command less those of reading and measuring alone. Ratios are ours to
vpype's; the target is of `within`."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest import mock

import numpy as np

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.pipeline import extract_view
from strokestyle.geometry.curves import Curves
from strokestyle.geometry.travel import Route, short_route
from strokestyle.mesh.surface import load_surface
from strokestyle.render.curve_file import load_curves
from strokestyle.svg import centre_lines
from strokestyle.svg.write import write_svg

SHAPES = Path(__file__).parent.parent / "examples" / "shapes"
SIZE = (768, 768)
TARGET = 1.05  # of vpype's


def drawing(curves):
    """Curves as strokes of one ink."""
    strokes = Strokes(
        curves.xy, np.ones(len(curves.xy)), curves.offsets, curves.kind, curves.closed
    )
    return Drawing(strokes, SIZE, np.tile([0.0, 0.0, 0.0, 1.0], (len(strokes), 1)))


def of_shapes():
    """The lines of each of the project's shapes from two sides."""
    for path in sorted(SHAPES.glob("*.ply")):
        surface = load_surface(path)
        for view in ("three-quarter", "back"):
            view_of = extract_view(surface, fit_camera(surface.vertices, view))
            yield f"{path.stem}, {view}", drawing(view_of.curves)


def random_lines(count, layers, rings):
    """Lines of 2 points 60 px long, or rings of 24 of them, anywhere, in that many layers."""
    rng = np.random.default_rng(count)
    turn = np.linspace(0, 2 * np.pi, 25) if rings else np.array([0, np.pi])
    angle = turn + rng.uniform(0, 2 * np.pi, (count, 1))
    radius = rng.uniform(3, 30, (count, 1))
    xy = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=2)
    xy = xy + rng.uniform(30, SIZE[0] - 30, (count, 1, 2))
    if rings:
        xy[:, -1] = xy[:, 0]
    kind = rng.integers(0, layers, count)
    return drawing(Curves.from_list(list(xy), kind, np.full(count, rings)))


def hatching():
    """Two layers of parallel lines, cut by a disc, in an order of chance."""
    rng, lines = np.random.default_rng(1), []
    for across in (np.array([1.0, 1.0]), np.array([1.0, -1.0])):
        along, across = np.array([across[1], -across[0]]) / 2**0.5, across / 2**0.5
        for d in np.arange(-340, 340, 2.0):
            half = (342.0**2 - d * d) ** 0.5
            for t in np.arange(-half, half - 20, 110):
                ends = np.array([[t], [min(t + 100, half)]])
                lines.append(384 + d * across + ends * along)
    order = rng.permutation(len(lines))
    half = len(lines) // 2
    return drawing(Curves.from_list([lines[i] for i in order], (order >= half).astype(int)))


def cases(files):
    for path in files:
        yield Path(path).name, drawing(load_curves(path, SIZE))
    if not files:
        yield from of_shapes()
        yield "hatching", hatching()
        for count in (10, 100, 1000, 10000):
            yield f"{count} strokes, one layer", random_lines(count, 1, False)
            yield f"{count} strokes, four layers", random_lines(count, 4, False)
        yield "300 rings, one layer", random_lines(300, 1, True)


def as_painted(xy, offsets, closed, group):
    """Stands in for `short_route`: what a plotter file was before."""
    order = np.argsort(group, kind="stable")
    return Route(order, np.zeros(len(order), bool), np.zeros(len(order), np.int64))


def vpype(path, *commands):
    """(pen-up length in all layers after the commands, CPU seconds)."""
    before = os.times()
    words = ["vpype", "read", str(path), *commands, "stat"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    after = os.times()
    took = after.children_user - before.children_user
    return float(re.findall(r"Pen-up length: ([\d.]+)", done.stdout)[-1]), took


def row(name, made, folder):
    """Print the figures of one drawing; whether the target is met."""
    plain, ours = folder / "plain.svg", folder / "ours.svg"
    with mock.patch.object(centre_lines, "short_route", as_painted):
        plain.write_text(write_svg(made, plotter=True))
    ours.write_text(write_svg(made, plotter=True))
    begin, strokes = time.process_time(), made.strokes
    short_route(strokes.xy, strokes.offsets, strokes.closed, strokes.kind.astype(int))
    seconds = time.process_time() - begin
    together = ("lmove", "all", "1")
    painted, reading = vpype(plain)
    theirs, sorting = vpype(plain, "linesort")
    pairs = [
        (vpype(ours)[0], theirs),
        (vpype(ours, *together)[0], vpype(plain, "linesort", *together)[0]),
    ]
    within, total = (a / b if b else 1.0 for a, b in pairs)
    figures = f"{len(strokes):7d} {painted:9.0f} {theirs:9.0f} {pairs[0][0]:9.0f}"
    verdict = "met" if within <= TARGET else "MISSED"
    times = f"{seconds:8.2f} {sorting - reading:8.2f}"
    print(f"{name:28s} {figures} {within:7.2f} {total:6.2f} {times}   {verdict}", flush=True)


def main():
    if not shutil.which("vpype"):
        print("skipped: vpype is not installed")
        return
    columns = "strokes   painted     vpype      ours  within    all   ours s  vpype s"
    print(f"{'drawing':28s} {columns}   target {TARGET}")
    with tempfile.TemporaryDirectory() as folder:
        for name, made in cases(sys.argv[1:]):
            row(name, made, Path(folder))


if __name__ == "__main__":
    main()
