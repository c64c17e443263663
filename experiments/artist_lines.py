"""Our own feature curves in the form that the artist of the shared data draws from: the most that a
style can score.

    python experiments/artist_lines.py SHARED OUT [--shapes bunny,cow,fandisk] [--seed 4242]

Extracts the lines of SHARED/shapes/<shape>/mesh.obj as seen by camera.json, writes them with the
surface's fields along them to OUT/curves/<shape>.json, and has SHARED/artist/artist.py draw them in
each of its styles to OUT/drawings/<style>/<shape>.png, to be scored like drawings of ours. Says of
every shape how much of the length of the given curves lies within NEAR px of ours, and the other
way round."""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from strokestyle.extract.camera import Camera
from strokestyle.extract.pipeline import extract_view
from strokestyle.geometry.curves import KINDS, resample
from strokestyle.mesh.surface import load_surface
from strokestyle.render.curve_file import load_curves
from strokestyle.render.features import surface_at

NEAR = 2.0  # px
FIELDS = ("depth", "ndotv", "curvature", "nx", "ny")  # the artist's names for style.SURFACE
KIND = dict.fromkeys(KINDS, "crease") | {"contour": "contour"}
KIND |= dict.fromkeys(("suggestive", "valley", "ridge", "apparent"), "valley")


def for_artist(view, spacing=3.0) -> dict:
    """Curves and fields as in the artist's curves.json."""
    curves, surface = view.curves, surface_at(view, spacing)
    parts = [slice(a, b) for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True)]
    return {
        "size": [view.camera.width, view.camera.height],
        "step": spacing,
        "curves": [curves.xy[part].round(2).tolist() for part in parts],
        "kinds": [KIND[KINDS[k]] for k in curves.kind],
        "fields": {
            n: [c[part].round(5).tolist() for part in parts]
            for n, c in zip(FIELDS, surface.T, strict=True)
        },
    }


def found(these, those) -> float:
    """Part of the length of these curves within NEAR px of those."""
    a, b = (resample(c.xy, c.offsets, 1.0, np.zeros(len(c.xy)))[0] for c in (these, those))
    return float((cKDTree(b).query(a)[0] < NEAR).mean())


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "shared", type=Path, nargs="?", default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--shapes", default="bunny,cow,fandisk")
    parser.add_argument("--seed", type=int, default=4242)
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give SHARED or set STROKESTYLE_SHARED")
    shared, lines = Path(args.shared), args.out / "curves"
    lines.mkdir(parents=True, exist_ok=True)
    for shape in args.shapes.split(","):
        folder = shared / "shapes" / shape
        camera = Camera.load(folder / "camera.json")
        view = extract_view(load_surface(folder / "mesh.obj"), camera)
        given = load_curves(folder / "curves.json", (camera.width, camera.height))
        there, here = found(given, view.curves), found(view.curves, given)
        print(
            f"{shape}: {there:.0%} of the given lines are among ours, {here:.0%} of ours among "
            f"them",
            flush=True,
        )
        (lines / f"{shape}.json").write_text(json.dumps(for_artist(view)))
    artist = shared / "artist"
    for style in json.loads((artist / "styles.json").read_text()):
        for path in sorted(lines.glob("*.json")):
            target = args.out / "drawings" / style / f"{path.stem}.png"
            target.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=args.out) as made:
                command = [
                    sys.executable,
                    artist / "artist.py",
                    path,
                    f"{artist}/styles.json:{style}",
                    made,
                ]
                subprocess.run(
                    [*command, "--seed", str(args.seed)], check=True, stdout=subprocess.DEVNULL
                )
                (Path(made) / "drawing.png").replace(target)


if __name__ == "__main__":
    main()
