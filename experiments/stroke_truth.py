"""Learned thickness and centre lines against what the artist's hand did on the drawing that was
learned from.

    python experiments/stroke_truth.py SHARED [--shape spot] [--styles a,b] [--preset standard]

SHARED (or STROKESTYLE_SHARED) holds shapes/<shape>/{mesh.obj,camera.json,curves.json} and
styles/<style>/<shape>/{drawing.png,truth.json}. Over all points of the truth that lie on a curve:

thickness    Pearson's correlation of thickness with the width of the nearest truth point, and with
its ink (coverage
             across the stroke), which is what media led by opacity vary
displacement median distance from the drawn centre line to ours, and to the curves as they were
given ("plain")

"style" is what the style means to draw there, "traced" the strokes that the fit found in the
drawing itself."""

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from strokestyle.extract.camera import Camera
from strokestyle.extract.pipeline import view_of_curves
from strokestyle.fit.exemplar import load_exemplar
from strokestyle.fit.learn import fit_quick
from strokestyle.fit.train import PRESETS
from strokestyle.geometry.curves import resample
from strokestyle.mesh.surface import load_surface
from strokestyle.render.curve_file import load_curves

NEAR = 8.0  # px; where ours is farther off, no stroke of ours stands for the drawn one
STEP = 0.25  # px between the points that stand for a line
INK_LED = (
    "brushpen_swell",
    "comic_outline",
    "dip_pen_nervous",
    "pen_shadow_side",
)  # width is pressure, not opacity


def truth_points(path: Path):
    """What was drawn where there is a curve to it: centre (n, 2) px, width (n,) px, ink (n,) px."""
    columns = []
    for stroke in json.loads(path.read_text())["strokes"]:
        on_curve = np.array([source is not None for source in stroke["src"]])
        rows = zip(stroke["xy"], stroke["width"], stroke["ink"], strict=True)
        columns += [
            [*xy, w, k]
            for (xy, w, k), here in zip(rows, on_curve, strict=True)
            if here and w is not None
        ]
    table = np.array(columns, float)
    return table[:, :2], table[:, 2], table[:, 3]


def nearest(lines, points):
    """Distance (n,) px from points to polylines (xy, offsets), and where along the rows the nearest
    lies."""
    xy, _, (row,) = resample(lines.xy, lines.offsets, STEP, np.arange(len(lines.xy), dtype=float))
    distance, index = cKDTree(xy).query(points)
    return distance, row[index]


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "shared", type=Path, nargs="?", default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("--shape", default="spot")
    parser.add_argument("--styles", help="comma-separated; all by default")
    parser.add_argument("--preset", choices=("quick", "standard"), default="standard")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give SHARED or set STROKESTYLE_SHARED")
    folder = Path(args.shared) / "shapes" / args.shape
    camera = Camera.load(folder / "camera.json")
    curves = load_curves(folder / "curves.json", (camera.width, camera.height))
    view = view_of_curves(load_surface(folder / "mesh.obj"), camera, curves)
    styles = Path(args.shared) / "styles"
    names = args.styles.split(",") if args.styles else sorted(p.name for p in styles.iterdir())
    config = replace(PRESETS[args.preset], texture=False)
    print(f"{'':22s} |    width: r    |     ink: r     | distance to the drawn line, px")
    print(f"{'on ' + args.shape:22s} |  style  traced |  style  traced |  plain  style traced")
    for name in names:
        drawing, truth = (
            styles / name / args.shape / "drawing.png",
            styles / name / args.shape / "truth.json",
        )
        xy, width, ink = truth_points(truth)
        exemplar, _ = load_exemplar(drawing, camera.width, camera.height, curves.xy)
        learned = fit_quick(view, exemplar, config)
        style, traced = learned.style, learned.strokes
        meant = replace(style, residuals=None).lay_strokes(view).strokes
        numbers = {"width": [], "ink": [], "distance": [np.median(nearest(curves, xy)[0])]}
        for strokes in (meant, traced):
            off, row = nearest(strokes, xy)
            thickness = np.interp(row, np.arange(len(strokes.xy)), strokes.thickness)
            near = off < NEAR
            numbers["width"].append(np.corrcoef(thickness[near], width[near])[0, 1])
            numbers["ink"].append(np.corrcoef(thickness[near], ink[near])[0, 1])
            numbers["distance"].append(np.median(off))
        cells = [" ".join(f"{value:7.3f}" for value in numbers[key]) for key in ("width", "ink")]
        cells.append(" ".join(f"{value:6.2f}" for value in numbers["distance"]))
        print(
            f"{name:22s} |{' |'.join(cells)}   {'ink-led' if name in INK_LED else ''}", flush=True
        )


if __name__ == "__main__":
    main()
