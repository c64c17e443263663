"""The default lines of a folder of meshes, from two sides each, on one sheet:
docs/contact-sheet.png.

python docs/contact_sheet.py MESHES [-o OUT.png] [--columns 5]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from strokestyle.extract.camera import DEFAULT_SIZE, fit_camera
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.pipeline import extract_view
from strokestyle.geometry.curves import Curves
from strokestyle.mesh.surface import load_surface

VIEWS = ("three-quarter", "side")
# meshes that do not look towards the front, or lie down: two views that show what they are
FACING = {
    "cat": ("210,20", "three-quarter"),
    "fish": ("30,15", "side"),
    "hammer": ("30,15", "-150,30"),
    "hand": ("front", "60,20"),
    "human": ("three-quarter", "200,10"),
    "spot": ("150,15", "60,20"),
    "wingnut": ("three-quarter", "70,25"),
}
CELL = 384  # px of each drawing on the sheet
TITLE = 26  # px above it
INK = 1.1  # px, width of a line on the sheet
OVERSAMPLING = 4
LEVELS = 16  # of grey in the file


def drawing(curves: Curves) -> Image.Image:
    """Black lines on white, CELL px."""
    scale = CELL * OVERSAMPLING / DEFAULT_SIZE
    image = Image.new("L", (CELL * OVERSAMPLING,) * 2, 255)
    draw = ImageDraw.Draw(image)
    for i in range(len(curves)):
        draw.line(
            [tuple(point) for point in curves[i] * scale], 0, round(INK * OVERSAMPLING), "curve"
        )
    return image.reduce(OVERSAMPLING)


def sheet(paths: list[Path], columns: int) -> Image.Image:
    """The two views of a mesh below each other, several meshes in a row."""
    rows = -(-len(paths) // columns)
    out = Image.new("L", (columns * CELL, rows * len(VIEWS) * CELL + rows * TITLE), 255)
    draw, font = ImageDraw.Draw(out), ImageFont.load_default(15)
    for i, path in enumerate(paths):
        left, top = i % columns * CELL, i // columns * (len(VIEWS) * CELL + TITLE)
        surface = load_surface(path)
        lines = SurfaceLines(surface)
        draw.text((left + 10, top + 6), f"{path.stem}, {len(surface.faces):,} faces", 90, font)
        for k, view in enumerate(FACING.get(path.stem, VIEWS)):
            curves = extract_view(surface, fit_camera(surface.vertices, view), lines=lines).curves
            out.paste(drawing(curves), (left, top + TITLE + k * CELL))
            print(f"{path.stem} {view}: {len(curves)} strokes")
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", type=Path)
    parser.add_argument(
        "-o", "--output", type=Path, default=Path(__file__).parent / "contact-sheet.png"
    )
    parser.add_argument("--columns", type=int, default=5)
    args = parser.parse_args()
    paths = sorted(
        path
        for path in args.meshes.iterdir()
        if path.suffix in (".obj", ".ply", ".stl", ".off", ".glb")
    )
    if not paths:
        parser.error(f"{args.meshes}: no meshes in it")
    picture = sheet(paths, args.columns).quantize(LEVELS, dither=Image.Dither.NONE)
    picture.save(args.output, optimize=True)
    print(
        f"{args.output}: {picture.width} x {picture.height} px, "
        f"{args.output.stat().st_size / 1000:.0f} kB"
    )


if __name__ == "__main__":
    main()
