"""docs/page.png: the page of `strokestyle view`, with a fingertip being dragged. Needs chromium;
two minutes, of fits.

python examples/page_picture.py
"""

from __future__ import annotations

import io
import sys
import time

from demo import DRAWINGS, HERE, MODEL_SHAPE, SHAPES, run
from PIL import Image

TASKS = {
    "watercolour": "hand",
    "charcoal": "elephant",
    "brush": "teapot",
}  # drawing: the shape drawn in that hand


def main() -> None:
    sys.path.insert(0, str(HERE.parent / "tests"))
    from browser import NO_BROWSER, Browser

    if NO_BROWSER:
        sys.exit(NO_BROWSER)
    out = HERE.parent / "out" / "page"
    out.mkdir(parents=True, exist_ok=True)
    files = []
    for drawing, shape in TASKS.items():
        model, file = out / f"{drawing}.pt", out / f"{shape}-{drawing}.svg"
        if not model.exists():
            run("fit", DRAWINGS / f"{drawing}.png", MODEL_SHAPE, "-o", model, "--preset", "quick")
        run("render", model, SHAPES / f"{shape}.ply", "-o", file)
        files.append(file)
    run("view", *files, "-o", out / "page.html")
    with Browser() as browser:
        browser.open(out / "page.html")
        # the longest stroke, bent at the handle that lies highest
        browser.run(
            "select(current.drawing.strokes.reduce((best, stroke) => stroke.line.x.length > "
            "best.line.x.length ?"
            " stroke : best).number)"
        )
        browser.frame()
        places = browser.run(
            "[...document.querySelectorAll('#handles g')].map((g) => g.getBoundingClientRect())"
            ".map(({x, y, width, height}) => [x + width / 2, y + height / 2])"
        )
        x, y = min(places, key=lambda place: place[1])
        browser.drag((x, y), (x - 55, y - 40))
        browser.mouse("mouseMoved", 900, 500)
        time.sleep(1.5)  # until the page has painted it at its best
        picture = Image.open(io.BytesIO(browser.screenshot())).convert("RGB")
    small = picture.quantize(160, dither=Image.Dither.NONE)
    target = HERE.parent / "docs" / "page.png"
    small.save(target, optimize=True)
    print(f"{target}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
