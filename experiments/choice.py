"""How well the choice of lines is learned from a drawing that lacks some of them, by a law.

    python experiments/choice.py SHARED OUT [--styles a,b] [--laws contours,lower]

Cuts SHARED/shapes/spot/curves.json by each law, has SHARED/artist/artist.py draw what is left to
OUT/<style>/<law>.png, finds what was drawn of all the curves, learns, and compares what is chosen
on the other shapes with what the law itself leaves there: F1 of length. Only the choice is
learned."""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from strokestyle.extract.camera import Camera
from strokestyle.extract.pipeline import view_of_curves
from strokestyle.fit.choice import learn_lines
from strokestyle.fit.exemplar import load_exemplar
from strokestyle.geometry.curves import Curves, owner
from strokestyle.mesh.surface import load_surface
from strokestyle.render.choice import choose_lines
from strokestyle.render.curve_file import load_curves

SHAPES = ("spot", "bunny", "cow", "fandisk")  # the first is learned from
LIGHT, LIGHT_BEFORE = (-0.6, -0.8, 0.0), (-0.6, -0.7, 0.4)


def lit(light):
    return lambda at: at["nx"] * light[0] + at["ny"] * light[1] + at["ndotv"] * light[2] >= 0


LAWS = {  # of what lies at all points of the curves
    "none": lambda at: at["length"] > 0,
    "contours": lambda at: at["kind"] == "contour",
    "valleys": lambda at: (at["kind"] != "valley") | (at["length"] >= 100),
    "long": lambda at: at["length"] >= 150,
    "light": lit(LIGHT),
    "light_before": lit(LIGHT_BEFORE),
    "lower": lambda at: at["y"] >= 0.5 * (at["y"].min() + at["y"].max()),
    "upper": lambda at: at["y"] < 0.5 * (at["y"].min() + at["y"].max()),
    "near": lambda at: at["depth"] < 0.5 * (at["depth"].min() + at["depth"].max()),
}


def columns(content) -> dict[str, np.ndarray]:
    """What a law may ask of the points of a file of curves."""
    lines = [np.array(line) for line in content["curves"]]
    counts = [len(line) for line in lines]
    lengths = [np.hypot(*np.diff(line, axis=0).T).sum() for line in lines]
    fields = {name: np.concatenate(values) for name, values in content["fields"].items()}
    return fields | {
        "y": np.concatenate(lines)[:, 1],
        "kind": np.repeat(content["kinds"], counts),
        "length": np.repeat(lengths, counts),
    }


def cut(content, keep) -> dict:
    """The curves less what is not kept, for the artist."""
    counts = [len(line) for line in content["curves"]]
    out = {**content, "curves": [], "kinds": [], "fields": {k: [] for k in content["fields"]}}
    out.pop("points3d", None)
    for i, part in enumerate(np.split(keep, np.cumsum(counts)[:-1])):
        edge = np.flatnonzero(np.diff(np.r_[0, part.astype(int), 0]))
        for a, b in zip(edge[::2], edge[1::2], strict=True):
            if b - a >= 3:
                out["curves"].append(content["curves"][i][a:b])
                out["kinds"].append(content["kinds"][i])
                for name, values in content["fields"].items():
                    out["fields"][name].append(values[i][a:b])
    return out


def draw(shared, style, curves, target):
    if target.exists():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        given = Path(made) / "curves.json"
        given.write_text(json.dumps(curves))
        artist = shared / "artist"
        command = [sys.executable, artist / "artist.py", given, f"{artist}/styles.json:{style}"]
        subprocess.run([*command, made, "--seed", "11"], check=True, stdout=subprocess.DEVNULL)
        shutil.copy(Path(made) / "drawing.png", target)


def kept_points(view, content, keep) -> np.ndarray:
    """The law at the view's points (N,), from that at the file's."""
    counts = [len(line) for line in content["curves"]]
    of, xy = np.repeat(np.arange(len(counts)), counts), np.concatenate(content["curves"])
    line, out = owner(view.curves.offsets), np.zeros(len(view.curves.xy), bool)
    for i in range(len(view.curves)):
        _, nearest = cKDTree(xy[of == i]).query(view.curves.xy[line == i])
        out[line == i] = keep[of == i][nearest]
    return out


def f1(drawn: Curves, view, wanted) -> float:
    """F1 of points drawn, which are points of the view, against those wanted (N,) bool."""
    have = cKDTree(drawn.xy).query(view.curves.xy)[0] < 1e-6
    return 2 * (have & wanted).sum() / max(have.sum() + wanted.sum(), 1)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "shared", type=Path, nargs="?", default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--styles", help="comma-separated; all by default")
    parser.add_argument("--laws", default=",".join(LAWS))
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give SHARED or set STROKESTYLE_SHARED")
    shared = Path(args.shared)
    styles = (
        args.styles.split(",")
        if args.styles
        else sorted(json.loads((shared / "artist/styles.json").read_text()))
    )
    views, contents = {}, {}
    for shape in SHAPES:
        folder = shared / "shapes" / shape
        camera = Camera.load(folder / "camera.json")
        given = load_curves(folder / "curves.json", (camera.width, camera.height))
        views[shape] = view_of_curves(load_surface(folder / "mesh.obj"), camera, given)
        contents[shape] = json.loads((folder / "curves.json").read_text())
    first = views[SHAPES[0]]
    size = first.camera.width, first.camera.height
    print(f"{'law':14s} {'':6s}" + "".join(f"{shape:>10s}" for shape in SHAPES[1:]))
    for law in args.laws.split(","):
        keep = {shape: LAWS[law](columns(contents[shape])) for shape in SHAPES}
        wanted = {s: kept_points(views[s], contents[s], keep[s]) for s in SHAPES}
        curves, scores = cut(contents[SHAPES[0]], keep[SHAPES[0]]), []
        for style in styles:
            target = args.out / style / f"{law}.png"
            draw(shared, style, curves, target)
            exemplar, _ = load_exemplar(target, *size, first.curves.xy)
            choice = learn_lines(first, exemplar.mask).choice
            chosen = {s: choose_lines(views[s], choice).curves for s in SHAPES[1:]}
            scores.append([f1(chosen[s], views[s], wanted[s]) for s in SHAPES[1:]])
        plain = [f1(views[s].curves, views[s], wanted[s]) for s in SHAPES[1:]]
        for name, row in (
            ("all", plain),
            ("mean", np.mean(scores, axis=0)),
            ("least", np.min(scores, axis=0)),
        ):
            print(f"{law:14s} {name:6s}" + "".join(f"{x:10.2f}" for x in row), flush=True)


if __name__ == "__main__":
    main()
