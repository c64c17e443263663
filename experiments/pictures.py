"""All methods side by side: one picture a style, and a page of them all.

    python experiments/pictures.py OUT [--data DATA] [--size 256] [--methods a,b] [--styles a,b]

Reads what compare_methods.py wrote, and writes OUT/pictures/<style>.png, a row for each test shape:
the artist's drawing, the plain curves, each method's drawing; before them the drawing that was
learned from. OUT/pictures/index.html shows them all. A drawing that is missing stays empty."""

import argparse
import html
import io
from pathlib import Path

import numpy as np
from common_options import carry_out, comparing
from dataset import DataSet, data_of, read_image
from methods import chosen_methods
from PIL import Image, ImageDraw, ImageFont

from strokestyle.files import write_bytes

GAP, LINE, FONT = 8, 18, 14  # px
PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Methods side by side</title>
<style>body{{font:16px/1.4 system-ui,sans-serif;margin:1rem}}img{{max-width:none}}
figure{{margin:0 0 2rem;overflow-x:auto}}</style>
<h1>Methods side by side</h1>
{figures}
</html>
"""


def side_by_side(rows: list[list[np.ndarray | None]], labels: list[str]) -> Image.Image:
    """Lay images (H, W, 3) out in rows, under labels; None stays empty."""
    font = ImageFont.load_default(FONT)
    height, width = np.max([x.shape[:2] for row in rows for x in row if x is not None], axis=0)
    across, down = width + GAP, height + GAP
    lines = [wrapped(label, font, width) for label in labels]
    head = LINE * max(map(len, lines)) + GAP
    size = len(labels) * across + GAP, head + len(rows) * down
    sheet = Image.new("RGB", size, (225, 225, 225))
    pen = ImageDraw.Draw(sheet)
    for j, label in enumerate(lines):
        for i, line in enumerate(label):
            pen.text((GAP + j * across, 3 + i * LINE), line, "black", font)
        for i, row in enumerate(rows):
            image = row[j]
            if image is not None:
                where = GAP + j * across, head + i * down
                sheet.paste(Image.fromarray((255 * image).round().astype(np.uint8)), where)
    return sheet


def wrapped(text: str, font: ImageFont.FreeTypeFont, width: int) -> list[str]:
    """Break a text into lines of at most `width` px, between words."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def style_sheet(data: DataSet, out: Path, style: str, methods: dict[str, str]) -> Image.Image:
    """The picture of one style; `methods` are names and labels."""
    lesson, rows = data.lesson(style), []
    for i, shape in enumerate(data.tests(style)):
        sheet = data.sheet(shape)
        artist = read_image(data.drawing_path(style, shape), sheet.size)
        row = [lesson.drawing if i == 0 else None, artist, np.repeat(sheet.plain[..., None], 3, 2)]
        for name in methods:
            path = out / name / style / f"{shape}.png"
            row.append(read_image(path, sheet.size) if path.exists() else None)
        rows.append(row)
    return side_by_side(rows, ["learned from", "the artist", "plain curves", *methods.values()])


def run(args: argparse.Namespace) -> None:
    """Write the pictures that the options name. Raises OSError and ValueError."""
    data, methods = data_of(args), chosen_methods(args.methods)
    labels = {n: m.label for n, m in methods.items() if args.methods or (args.out / n).exists()}
    figures = []
    for style in data.chosen_styles(args.styles):
        file = io.BytesIO()
        style_sheet(data, args.out, style, labels).save(file, "PNG", optimize=True)
        write_bytes(_folder(args.out) / f"{style}.png", file.getvalue())
        name = html.escape(style)
        figures.append(f'<figure><h2>{name}</h2><img src="{name}.png" alt="{name}"></figure>')
    write_bytes(_folder(args.out) / "index.html", PAGE.format(figures="\n".join(figures)).encode())


def _folder(out: Path) -> Path:
    folder = out / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


if __name__ == "__main__":
    carry_out(run, comparing(__doc__))
