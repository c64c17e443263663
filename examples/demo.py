"""The demo: learn two hands from two drawings of the elephant and draw other shapes in them, into
out/demo.

python examples/demo.py            needs `strokestyle` installed beside this python; `make demo`
sees to that
python examples/demo.py --docs     also store the overview as docs/overview.png
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

from PIL import Image, ImageChops, ImageDraw, ImageFont

HERE = Path(__file__).resolve().parent
SHAPES, DRAWINGS = HERE / "shapes", HERE / "drawings"
MODEL_SHAPE = SHAPES / "elephant.ply"  # what the drawings show
TASKS = {
    "brush": ("teapot", "cloth"),
    "charcoal": ("hand", "bracket"),
}  # drawing: shapes to draw in that hand
INK, GREY = (30, 30, 30), (120, 120, 120)


def run(*words: str | Path) -> None:
    """One `strokestyle` command, shown as a user would type it; a failure ends the demo."""
    command = [str(word) for word in words]
    print("$ strokestyle " + " ".join(_short(word) for word in command), flush=True)
    program = Path(sysconfig.get_path("scripts")) / (
        "strokestyle.exe" if sys.platform == "win32" else "strokestyle"
    )
    done = subprocess.run([str(program), *command], check=False)
    if done.returncode:
        sys.exit(done.returncode)


def _short(word: str) -> str:
    """A path below the current folder, relative to it."""
    try:
        return str(Path(word).relative_to(Path.cwd())) if Path(word).is_absolute() else word
    except ValueError:
        return word


def overview(out: Path, tile: int = 460) -> Image.Image:
    """One row a hand: the drawing it was learned from, then curves and result of each shape."""
    titles = ["learned from one drawing", "curves", "result", "curves", "result"]
    head, gap = 34, 10
    rows = []
    for name, shapes in TASKS.items():
        files = [DRAWINGS / f"{name}.png"]
        for shape in shapes:
            files += [out / "curves" / f"{shape}.png", out / name / f"{shape}.png"]
        rows.append(_trimmed([_on_white(file, tile) for file in files], margin=12))
    width = gap + len(titles) * (tile + gap)
    sheet = Image.new("RGB", (width, head + sum(row[0].height for row in rows)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(18)
    for i, title in enumerate(titles):
        centre = gap + i * (tile + gap) + tile / 2
        draw.text((centre, head / 2), title, GREY if title == "curves" else INK, font, anchor="mm")
    y = head
    for row in rows:
        for i, picture in enumerate(row):
            sheet.paste(picture, (gap + i * (tile + gap), y))
        y += row[0].height
    x = gap + tile + gap // 2
    draw.line([(x, 8), (x, sheet.height - 8)], (210, 210, 210), 1)
    return sheet


def _trimmed(row: list[Image.Image], margin: int) -> list[Image.Image]:
    """The pictures without the white above and below them all."""
    boxes = [
        ImageChops.invert(picture.convert("L")).point(lambda v: 255 * (v > 24)).getbbox()
        for picture in row
    ]
    low = max(0, min(box[1] for box in boxes if box) - margin)
    high = min(row[0].height, max(box[3] for box in boxes if box) + margin)
    return [picture.crop((0, low, picture.width, high)) for picture in row]


def _on_white(file: Path, tile: int) -> Image.Image:
    """The picture on white paper; thin lines stay dark when it is made smaller."""
    with Image.open(file) as image:
        image = image.convert("RGBA")
    paper = Image.new("RGBA", image.size, "white")
    return (
        Image.alpha_composite(paper, image)
        .convert("RGB")
        .resize((tile, tile), Image.Resampling.LANCZOS)
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--out", type=Path, default=Path("out/demo"), help="folder to write to (%(default)s)"
    )
    parser.add_argument("--docs", action="store_true", help="also write docs/overview.png")
    arguments = parser.parse_args()
    out, started = arguments.out, time.monotonic()
    for folder in ("curves", *TASKS):
        (out / folder).mkdir(parents=True, exist_ok=True)

    print("The sheet that an artist draws over, and the curves of the other shapes:", flush=True)
    for name in ("elephant", *(shape for shapes in TASKS.values() for shape in shapes)):
        run("extract", SHAPES / f"{name}.ply", "-o", out / "curves" / f"{name}.png")
    for name, shapes in TASKS.items():
        print(f"\nThe hand of {_short(str(DRAWINGS / name))}.png:", flush=True)
        model = out / f"{name}.pt"
        run("fit", DRAWINGS / f"{name}.png", MODEL_SHAPE, "-o", model, "--preset", "quick")
        run(
            "render", model, *(SHAPES / f"{s}.ply" for s in shapes), "-o", f"{out / name}/", "--png"
        )

    picture = overview(out)
    picture.save(out / "overview.png", optimize=True)
    if arguments.docs:
        docs = HERE.parent / "docs" / "overview.png"
        docs.parent.mkdir(exist_ok=True)
        picture.quantize(128, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(
            docs, optimize=True
        )
        print(f"\n{_short(str(docs))}")

    print(
        f"\nDone in {time.monotonic() - started:.0f} s. Drawings, as SVG to edit and PNG to "
        f"look at:"
    )
    for name, shapes in TASKS.items():
        for shape in shapes:
            print(f"  {out / name / shape}.svg   {out / name / shape}.png")
    print(f"Models:   {', '.join(str(out / f'{name}.pt') for name in TASKS)}")
    print(f"Overview: {out / 'overview.png'}")


if __name__ == "__main__":
    main()
