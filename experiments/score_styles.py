"""Learn styles from one drawing each and draw other shapes, to be compared with the artist's own
drawings of them.

    python experiments/score_styles.py SHARED OUT [--preset quick] [--styles a,b] [--own-lines]
    [--seed 0]

SHARED holds shapes/<shape>/{mesh.obj,camera.json,curves.json} and
styles/<style>/<shape>/drawing.png; without it the environment's STROKESTYLE_SHARED is used. Every
style is learned from `--train` and drawn on the other shapes to OUT/<style>/<shape>.png, rasterised
by resvg from the SVG beside it. What is there already is not made again, so that a run may be
stopped and started; OUT/times.jsonl gets a line of seconds for each thing made."""

import argparse
import json
import os
import resource
import time
from pathlib import Path

from strokestyle.extract.camera import Camera
from strokestyle.extract.pipeline import extract_view, view_of_curves
from strokestyle.files import write_bytes
from strokestyle.fit.exemplar import load_exemplar
from strokestyle.fit.train import PRESETS, fit_style
from strokestyle.mesh.surface import load_surface
from strokestyle.render.curve_file import load_curves
from strokestyle.render.style_file import load_style, save_style
from strokestyle.svg.write import png_from_svg, write_svg, write_text


def shape_view(folder: Path, own_lines: bool):
    surface, camera = load_surface(folder / "mesh.obj"), Camera.load(folder / "camera.json")
    if own_lines:
        return extract_view(surface, camera, optional=True)
    return view_of_curves(
        surface, camera, load_curves(folder / "curves.json", (camera.width, camera.height))
    )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "shared", type=Path, nargs="?", default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--preset", choices=list(PRESETS), default="standard")
    parser.add_argument("--styles", help="comma-separated; all by default")
    parser.add_argument("--train", default="spot")
    parser.add_argument(
        "--drawings",
        type=Path,
        help="folder of <style>/<train>/drawing.jpg, of photograph.py, to learn from instead",
    )
    parser.add_argument(
        "--own-lines", action="store_true", help="our own feature curves instead of curves.json"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="auto")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give SHARED or set STROKESTYLE_SHARED")
    shared = Path(args.shared)
    names = (
        args.styles.split(",")
        if args.styles
        else sorted(p.name for p in (shared / "styles").iterdir())
    )
    views = {}

    def view(shape):
        if shape not in views:
            views[shape] = shape_view(shared / "shapes" / shape, args.own_lines)
        return views[shape]

    for name in names:
        folder = args.out / name
        folder.mkdir(parents=True, exist_ok=True)
        model = folder / "model.pt"
        row = {"style": name, "preset": args.preset}
        if not model.exists():
            train = view(args.train)
            source = shared / "styles" / name / args.train / "drawing.png"
            if args.drawings:
                source = args.drawings / name / args.train / "drawing.jpg"
            exemplar, _ = load_exemplar(
                source,
                train.camera.width,
                train.camera.height,
                train.curves.xy[train.required],
            )
            start = time.perf_counter()
            style = fit_style(
                train,
                exemplar,
                PRESETS[args.preset],
                seed=args.seed,
                device=args.device,
                source=name,
            )
            row["fit"] = round(time.perf_counter() - start, 2)
            save_style(model, style)
        style = load_style(model, args.device)
        for shape in sorted(p.name for p in (shared / "styles" / name).iterdir()):
            target = folder / f"{shape}.png"
            if target.exists():
                continue
            plain = view(shape)
            start = time.perf_counter()
            drawing = style.draw(plain, seed=args.seed)
            row[f"draw {shape}"] = round(time.perf_counter() - start, 2)
            text = write_svg(drawing, title=shape)
            row[f"svg {shape}"] = round(time.perf_counter() - start - row[f"draw {shape}"], 2)
            write_text(target.with_suffix(".svg"), text)
            write_bytes(target, png_from_svg(text))
        if len(row) > 2:
            row["peak MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
            print(json.dumps(row), flush=True)
            with open(args.out / "times.jsonl", "a") as file:
                file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
