"""docs/edits.png: the paper's figure of edits on a drawing of our own, each made by one command. A
minute, of a fit.

python examples/edits_picture.py
"""

from __future__ import annotations

from demo import DRAWINGS, GREY, HERE, INK, MODEL_SHAPE, SHAPES, run
from PIL import Image, ImageDraw, ImageFont

from strokestyle.drawing.strokes import lengths
from strokestyle.svg.read import read_svg_file

EDITS = {  # what it is called: the command's words; FINGER is the id of the forefinger's stroke
    "thicker": ("--thickness", "1.8"),
    "wiggly": ("--wiggle", "5,36"),
    "a point moved": ("--move", "FINGER:0.5:70,-40"),
}


def forefinger(file) -> str:
    """The id of the long stroke whose middle lies farthest to the upper right: it runs round the
    tip of a finger."""
    found = read_svg_file(file)
    strokes, length = found.drawing.strokes, lengths(found.drawing)
    middle = strokes.xy[(strokes.offsets[:-1] + strokes.offsets[1:]) // 2]
    score = middle @ [1.0, -1.0] - 1e6 * (length < 300)
    return found.ids[int(score.argmax())]


def main(tile: int = 440, wide: int = 330) -> None:
    out = HERE.parent / "out" / "edits"
    out.mkdir(parents=True, exist_ok=True)
    model, drawing = out / "charcoal.pt", out / "hand.svg"
    if not model.exists():
        run("fit", DRAWINGS / "charcoal.png", MODEL_SHAPE, "-o", model, "--preset", "quick")
    run("render", model, SHAPES / "hand.ply", "-o", drawing, "--png")
    finger, files = forefinger(drawing), [drawing]
    for name, words in EDITS.items():
        files.append(out / f"{name.split()[-1]}.svg")
        run(
            "edit",
            drawing,
            "-o",
            files[-1],
            "--png",
            *(word.replace("FINGER", finger) for word in words),
        )
    font, small = ImageFont.load_default(19), ImageFont.load_default(15)
    sheet = Image.new("RGB", (len(files) * wide, tile + 52), "white")
    draw = ImageDraw.Draw(sheet)
    said = {"as rendered": ("render",)} | EDITS
    for k, (file, (name, words)) in enumerate(zip(files, said.items(), strict=True)):
        picture = Image.open(file.with_suffix(".png")).convert("RGB")
        picture = picture.crop((150, 20, 640, 740)).resize(
            (round(tile * 490 / 720), tile), Image.Resampling.LANCZOS
        )
        sheet.paste(picture, (k * wide + (wide - picture.width) // 2, 52))
        draw.text((k * wide + wide // 2, 8), name, INK, font, anchor="ma")
        draw.text(
            (k * wide + wide // 2, 32),
            " ".join(words).replace("FINGER", finger),
            GREY,
            small,
            anchor="ma",
        )
    target = HERE.parent / "docs" / "edits.png"
    sheet.convert("L").quantize(32, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"{target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
