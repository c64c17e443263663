"""PowerStrokes that Inkscape moved, and outlines that Blender cut into triangles, against what was
written: tables of the strokes that differ, and of the ink that is lost.

    python benchmarks/inkscape.py [--blender PYTHON] [DRAWING.svg ...]

Drawings that `render` wrote are read and written anew; without any, ten are made: smooth, nervous
and folded lines, pens of 1 to 12 px, widths that swell and jump. Inkscape selects all, moves it by
32 px and saves; a stroke differs where more than 6 % of its area does, by more than the edge of a
pixel at 4 pixels a pixel. "off" is the whole share, of which 0.1 px is the outline's own. With
the Python of Blender (that can `import bpy`) each drawing is imported there too, flat and in three
tones where it has a texture, and the area of its meshes is compared with that of the paths."""

import argparse
import io
import json
import re
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage
from svg import strokes

from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.svg.format import SvgOptions
from strokestyle.svg.path_data import parse_path
from strokestyle.svg.read import read_svg
from strokestyle.svg.write import png_from_svg, write_svg

SVG = "{http://www.w3.org/2000/svg}"
SIZE, COUNT, MOVE = 768, 30, 32
DIFFERS = 0.06
FINE = 4  # pixels a pixel, of strokes below LARGE px; 2 of larger ones
LARGE = 500
IN_BLENDER = """
import bpy, json, sys
areas = {}
for name in sys.argv[1:]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_curve.svg(filepath=name)
    graph = bpy.context.evaluated_depsgraph_get()
    meshes = [o.evaluated_get(graph).to_mesh() for o in bpy.data.objects if o.type == "CURVE"]
    areas[name] = sum(face.area for mesh in meshes for face in mesh.polygons)
print("areas " + json.dumps(areas))
"""


def made(seed):
    """A drawing of its own kind of line, by its number."""
    rng = np.random.default_rng(seed)
    smooth = strokes(COUNT, seed, (1.0, 3.0, 6.0, 9.0, 12.0)[seed % 5])
    xy, width = smooth.xy.copy(), smooth.thickness.copy()
    if seed >= 3:  # nervous
        xy += rng.normal(0, 0.5, xy.shape)
        width = np.maximum(width * rng.uniform(0.6, 1.4, len(width)), 0.0)
    if seed >= 6:  # folded: back over itself, and a corner
        for i in range(0, COUNT, 2):
            rows = np.arange(*smooth.offsets[i : i + 2])
            xy[rows[len(rows) // 2 :]] = xy[rows[: len(rows) - len(rows) // 2]][::-1] + seed - 6
    if seed >= 8:  # widths jump
        width *= np.where(np.arange(len(width)) // 9 % 2, 0.3, 1.0)
    lines = Strokes(xy, width, smooth.offsets, smooth.kind, smooth.closed)
    return Drawing(lines, (SIZE, SIZE), np.tile([0.0, 0.0, 0.0, 1.0], (COUNT, 1)))


def paths(text):
    """The path data of a document, and the scale of each, by id or number."""
    found = {}
    for k, element in enumerate(ET.fromstring(text).iter(SVG + "path")):
        scale = re.match(r"scale\(([.0-9]+)\)", element.get("transform", ""))
        found[element.get("id", k)] = (element.get("d", ""), float(scale[1]) if scale else 1.0)
    return found


def covered(d, corner, size, scale=1.0, shift=0.0):
    """How much of each pixel path data covers, its box from `corner`, and pixels a pixel."""
    zoom = FINE if max(size) * scale < LARGE else FINE / 2
    width, height = size
    path = f'<path fill-rule="nonzero" transform="translate({shift})" d="{d or "M0 0"}"/>'
    box = f'viewBox="{corner[0]} {corner[1]} {width} {height}"'
    text = f'<svg xmlns="{SVG[1:-1]}" width="{width * scale}" height="{height * scale}" {box}>'
    png = png_from_svg(f"{text}{path}</svg>", zoom)
    return 1 - np.asarray(Image.open(io.BytesIO(png)).convert("L")) / 255.0, zoom


def box_of(d):
    points = np.concatenate([np.array(ring).reshape(-1, 2) for ring in parse_path(d)])
    corner = np.floor(points.min(axis=0)) - 8
    return corner, np.ceil(points.max(axis=0) - corner) + 16


def moved(text, folder):
    """A document as Inkscape saves it once everything was moved, and what it said."""
    (folder / "a.svg").write_text(text)
    act = f"select-all;transform-translate:{MOVE},0;export-filename:{folder / 'b.svg'};export-do"
    command = ["inkscape", "--batch-process", f"--actions={act}", str(folder / "a.svg")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    return (folder / "b.svg").read_text(), done.stderr


def differing(text, after):
    """The shares of each stroke's area, (2, C), that differ by more than an edge, and at all."""
    was, now, shares = paths(text), paths(after), []
    for name, (d, _) in was.items():
        corner, size = box_of(d)
        ours, theirs = (
            covered(path, corner, size, shift=shift)[0]
            for path, shift in ((d, 0), (now.get(name, ("", 1))[0], -MOVE))
        )
        off = np.abs(ours - theirs)
        deep = ndimage.minimum_filter(off, 2) > 0.5
        shares.append(np.array([deep.sum(), off.sum()]) / max(ours.sum(), 1e-9))
    return np.array(shares).T


def in_blender(python, texts, folder):
    """The share of the ink of documents that Blender loses."""
    names = []
    for k, text in enumerate(texts):
        names.append(str(folder / f"{k}.svg"))
        Path(names[-1]).write_text(text)
    done = subprocess.run([python, "-c", IN_BLENDER, *names], capture_output=True, text=True)
    areas = json.loads(re.search("^areas (.*)$", done.stdout, re.MULTILINE)[1])
    lost = []
    for name, text in zip(names, texts, strict=True):
        root = ET.fromstring(text)
        unit = float(root.get("width")[:-2]) / float(root.get("viewBox").split()[2]) / 1000  # m
        ink = 0.0
        for d, scale in paths(text).values():
            if d:
                cover, zoom = covered(d, *box_of(d), scale)
                ink += cover.sum() / zoom**2
        lost.append(1 - areas[name] / unit**2 / ink)
    return lost


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("drawings", nargs="*", type=Path)
    parser.add_argument("--blender", help="a Python that has bpy")
    given = parser.parse_args()
    drawings = {path.stem: read_svg(path) for path in given.drawings}
    drawings = drawings or {f"made {seed}": made(seed) for seed in range(10)}
    flat = SvgOptions(texture="none", layers="none")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("| drawing | strokes moved | fail | differ | worst | off, median |")
        print("| --- | ---: | ---: | ---: | ---: | ---: |")
        for title, drawing in drawings.items():
            text = write_svg(drawing, replace(flat, inkscape_lpe=True))
            after, said = moved(text, folder)
            deep, off = differing(text, after)
            failed, differ = said.count("xception:"), (deep > DIFFERS).sum()
            worst = f"{100 * deep.max():.1f} % | {100 * np.median(off):.1f} %"
            print(f"| {title} | {len(deep)} | {failed} | {differ} | {worst} |")
        if given.blender:
            print("\n| drawing | outlines lose | tones lose |\n| --- | ---: | ---: |")
            for title, drawing in drawings.items():
                textures = ["none"] + ["vector"] * (drawing.texture is not None)
                texts = [write_svg(drawing, replace(flat, texture=name)) for name in textures]
                lost = in_blender(given.blender, texts, folder)
                cells = [f"{100 * share:.2f} %" for share in lost] + ["-"] * (2 - len(lost))
                print(f"| {title} | {cells[0]} | {cells[1]} |")


if __name__ == "__main__":
    main()
