"""Build, describe and check a data set that the experiments run on; dataset.py says how it lies.

    python experiments/build_dataset.py add DATA mesh.obj ... [--view three-quarter] [--size 768]
    python experiments/build_dataset.py describe DATA [--train SHAPE] [--seed 0] [--about TEXT]
    python experiments/build_dataset.py check DATA

`add` lays meshes of any kind into DATA/shapes: normalised (longest side 1, centred), with a camera
that keeps the upright axis upright and looks at the shape's centroid, as the paper has it (Liu et
al. 2021, sec. 5), our plain curves, and for the artist template.png, the curves to draw over. Have
the drawings made over it, and put them into DATA/styles/<style>/<shape>/drawing.png. `describe`
then draws by lot, of each style's drawings, the one to learn from (`--train` says which), and
writes DATA/dataset.json with the SHA-256 of every file. `check` tells everything that is wrong
with a set, a line each, and exits with 1 if anything is."""

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from dataset import DataSet, read_image
from PIL import Image
from scipy.ndimage import distance_transform_edt

from strokestyle.extract.camera import Camera, fit_camera
from strokestyle.extract.feature_maps import plain_raster
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.view_file import view_to_json
from strokestyle.files import write_bytes
from strokestyle.mesh.surface import Surface, load_surface

MARGIN = 0.08  # of the canvas, left free on each side
CLOSE = 1e-3  # of the longest side: what a normalised mesh may be off by
TILT = 1e-6  # how far the camera's up may be from +y
NEAR = 12  # px at 768: ink farther than this from every curve was not drawn over them
FAR_INK = 0.25  # of a drawing's ink, that may lie so far


# -------------------------------------------------------------------------------------------- add


def centroid(surface: Surface) -> np.ndarray:
    """The middle of a surface's area, (3,)."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return (area[:, None] * (a + b + c) / 3).sum(axis=0) / area.sum()


def aimed_camera(surface: Surface, view: str, size: int) -> Camera:
    """The nearest camera of a direction that looks at the centroid and sees the whole shape."""
    fitted = fit_camera(surface.vertices, view, width=size, height=size, projection="perspective")
    middle, away = centroid(surface), -fitted.axes[2]
    at_one = Camera(middle + away, middle, fitted.up, fitted.fov_y, size, size)
    right, down, forward = at_one.axes
    rel = surface.vertices - middle
    # |x| <= slope (depth + distance) for all points, so the largest of |x| / slope - depth
    slope = (1 - 2 * MARGIN) * 0.5 * size / at_one.focal
    reach = np.maximum(np.abs(rel @ right), np.abs(rel @ down)) / slope - rel @ forward
    return Camera(middle + reach.max() * away, middle, fitted.up, fitted.fov_y, size, size)


def obj_text(surface: Surface) -> str:
    """A surface in Wavefront's format; points that lie at one place are one."""
    used, index = np.unique(surface.weld[surface.faces], return_inverse=True)
    lines = ["# normalised: longest side 1, centred, +y up"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in surface.vertices[used]]
    lines += [f"f {a} {b} {c}" for a, b, c in index.reshape(-1, 3) + 1]
    return "\n".join(lines) + "\n"


def add_shape(folder: Path, mesh: Path, view: str, size: int) -> None:
    """Lay a mesh into the folder of its shape. Raises ValueError where there is one already."""
    if (folder / "mesh.obj").exists():
        raise ValueError(f"{folder}: there already; remove it, or rename {mesh}")
    text = obj_text(load_surface(mesh))
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / "mesh.obj", text.encode())
    surface = load_surface(folder / "mesh.obj")
    seen = extract_view(surface, aimed_camera(surface, view, size))
    write_bytes(folder / "camera.json", _json(seen.camera.to_dict()))
    write_bytes(folder / "curves.json", _json(view_to_json(seen)))
    lines = 255 * (1 - plain_raster(seen.curves, size, size))
    with open(folder / "template.png", "wb") as file:
        Image.fromarray(lines.round().astype(np.uint8)).save(file)


# --------------------------------------------------------------------------------------- describe


def describe(root: Path, train: str | None, seed: int, about: str) -> dict:
    """What dataset.json holds: the lot that was drawn, and what every file was at that time."""
    rng = np.random.default_rng(seed)
    drawn = {}
    for style in sorted(path for path in (root / "styles").iterdir() if path.is_dir()):
        shapes = sorted(path.parent.name for path in style.glob("*/drawing.png"))
        if not shapes:
            raise ValueError(f"{style}: no drawing.png in it")
        drawn[style.name] = train or str(rng.choice(shapes))
    files = sorted(p for p in root.rglob("*") if p.is_file() and p.name != "dataset.json")
    sums = {p.relative_to(root).as_posix(): _sha256(p) for p in files}
    return {"about": about, "train": train or drawn, "seed": seed, "sha256": sums}


# ------------------------------------------------------------------------------------------ check


def problems(root: Path) -> Iterator[str]:
    """Everything that is wrong with a data set, one line each."""
    described = root / "dataset.json"
    if not described.exists():
        yield f"{described}: missing; write it with build_dataset.py describe"
        return
    try:
        about = json.loads(described.read_text())
        sums, train = dict(about["sha256"]), about["train"]
    except (ValueError, KeyError, TypeError) as error:
        yield f"{described}: not a description: {error!r}"
        return
    for name, digest in sums.items():
        if not (root / name).exists():
            yield f"{root / name}: described, but missing"
        elif _sha256(root / name) != digest:
            yield f"{root / name}: not the file that was described"
    data = DataSet(root, train)
    styles = sorted(path.name for path in (root / "styles").glob("*") if path.is_dir())
    if not styles:
        yield f"{root / 'styles'}: no styles"
    for shape in sorted((root / "shapes").glob("*")):
        yield from _shape_problems(shape)
    for style in styles:
        yield from _style_problems(data, style)


def _shape_problems(folder: Path) -> Iterator[str]:
    try:
        surface, camera = load_surface(folder / "mesh.obj"), Camera.load(folder / "camera.json")
    except (OSError, ValueError) as error:
        yield str(error)
        return
    if abs(surface.scale - 1) > CLOSE or np.abs(surface.centre).max() > CLOSE:
        yield (
            f"{folder / 'mesh.obj'}: longest side {surface.scale:.4g}, its middle at "
            f"{np.round(surface.centre, 4).tolist()}; wanted 1, and the origin"
        )
    if np.abs(camera.up - [0, 1, 0]).max() > TILT:
        yield f"{folder / 'camera.json'}: up is {camera.up.tolist()}; wanted the upright axis, +y"
    aim = camera.rays(np.array([[camera.width / 2, camera.height / 2]]))[0]
    to = centroid(surface) - camera.eye
    off = np.degrees(np.arccos(np.clip(aim @ to / np.linalg.norm(to), -1, 1)))
    if off > 0.1 * (camera.fov_y or 30.0):
        yield f"{folder / 'camera.json'}: looks {off:.1f} degrees past the shape's centroid"
    xy, _ = camera.project(surface.vertices)
    if (xy < 0).any() or (xy > [camera.width, camera.height]).any():
        yield f"{folder / 'camera.json'}: the shape does not lie within the canvas"


def _style_problems(data: DataSet, style: str) -> Iterator[str]:
    folder = data.root / "styles" / style
    shapes = sorted(path.parent.name for path in folder.glob("*/drawing.png"))
    try:
        train = data.train_of(style)
    except KeyError:
        yield f"{folder}: the description does not say which shape it is learned from"
        return
    if train not in shapes:
        yield f"{folder}: no drawing of {train}, which it is to be learned from"
    if not set(shapes) - {train}:
        yield f"{folder}: no drawing to test it on"
    for shape in shapes:
        path = data.drawing_path(style, shape)
        if not (data.root / "shapes" / shape / "mesh.obj").exists():
            yield f"{path}: of a shape that is not among the shapes"
            continue
        try:
            yield from _drawing_problems(data, path, shape)
        except (OSError, ValueError) as error:
            yield f"{path}: {error}"


def _drawing_problems(data: DataSet, path: Path, shape: str) -> Iterator[str]:
    sheet = data.sheet(shape)
    with Image.open(path) as image:
        size = image.size
    if size[0] * sheet.size[1] != size[1] * sheet.size[0]:
        yield f"{path}: {size[0]} x {size[1]} px, its camera {sheet.size[0]} x {sheet.size[1]}"
        return
    ink = 1 - read_image(path, sheet.size).min(axis=2)
    if ink.max() < 0.2:
        yield f"{path}: no ink"
        return
    far = distance_transform_edt(sheet.plain > 0.5) > NEAR * max(sheet.size) / 768
    if ink[far].sum() > FAR_INK * ink.sum():
        share = 100 * ink[far].sum() / ink.sum()
        yield f"{path}: {share:.0f} % of its ink lies far from every curve of {shape}"


# ------------------------------------------------------------------------------------------ parts


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _json(value: dict) -> bytes:
    return (json.dumps(value) + "\n").encode()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    steps = parser.add_subparsers(dest="step", required=True)
    add = steps.add_parser("add", help="lay meshes into a set")
    add.add_argument("data", type=Path)
    add.add_argument("meshes", type=Path, nargs="+")
    add.add_argument("--view", default="three-quarter", help='a name, or "AZIMUTH,ELEVATION"')
    add.add_argument("--size", type=int, default=768)
    told = steps.add_parser("describe", help="draw the lot, and write dataset.json")
    told.add_argument("data", type=Path)
    told.add_argument("--train")
    told.add_argument("--seed", type=int, default=0)
    told.add_argument("--about", default="", help="whose shapes and drawings, and their licences")
    steps.add_parser("check", help="tell what is wrong").add_argument("data", type=Path)
    args = parser.parse_args()
    try:
        if args.step == "add":
            for mesh in args.meshes:
                add_shape(args.data / "shapes" / mesh.stem, mesh, args.view, args.size)
        elif args.step == "describe":
            about = describe(args.data, args.train, args.seed, args.about)
            write_bytes(args.data / "dataset.json", (json.dumps(about, indent=1) + "\n").encode())
        elif found := list(problems(args.data)):
            sys.exit("\n".join(found))
    except (OSError, ValueError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
