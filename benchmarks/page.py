"""The page of `strokestyle view` with 303 strokes in three styles, in a headless browser: is it
fluid? Prints a table.

    python benchmarks/page.py [--firefox] [FILE.svg ...]

A mouse drags sliders and a stroke's point and turns the wheel for two seconds each, at 1280 x 800;
a frame counts when its picture is shown; pixels a pixel of the screen say how fine it is. The
browser, Chromium or Firefox, has no head and paints without a GPU; the page does not need one.
Where the machine is busy, the CPU ms of a frame, of all the browser's processes, tell more."""

import os
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

from svg import POINTS, STYLES, drawing

from strokestyle.svg.write import write_svg
from strokestyle.viewer.page import page_html

SECONDS = 2.0
WAIT = 3.0  # between two hands, until the picture is at its best and the painters are ready
FLUID = 30.0  # frames a second

# counts the pictures shown, and remembers how fine they were
COUNTER = """
window.frames_ = [];
const plain = window.showCanvas;
window.showCanvas = (...all) => {
  plain(...all);
  frames_.push([performance.now(), shown.canvas.width / (stage.clientWidth * devicePixelRatio)]);
};
"""


def middle(browser, selector):
    box = f"document.querySelector({selector!r}).getBoundingClientRect()"
    return browser.run(f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({box})")


def slider(name):
    def hand(browser):
        x, y = middle(browser, name)
        left = x - 60

        def begin():
            browser.mouse("mouseMoved", left, y)
            browser.mouse("mousePressed", left, y)

        return begin, lambda t: browser.mouse("mouseMoved", left + 60 * t, y, down=True)

    return hand


def point(browser):
    browser.run("select(Math.floor(current.strokes.length / 2))")
    browser.frame()
    x, y = middle(browser, "#handles g:nth-child(2)")

    def begin():
        browser.mouse("mouseMoved", x, y)
        browser.mouse("mousePressed", x, y)

    return begin, lambda t: browser.mouse("mouseMoved", x + 30 * t, y + 20 * t, down=True)


def wheel(browser):
    x, y = middle(browser, "#stage")
    return lambda: None, lambda t: browser.mouse(
        "mouseWheel", x, y, deltaX=0, deltaY=-12 if t < 1 else 12
    )


HANDS = {
    "thickness": slider("#thickness"),
    "wiggle": slider("#wiggle"),
    "a point of a stroke": point,
    "the wheel: zoom": wheel,
}


def cpu(browser):
    """Seconds of CPU that all of the browser's processes have taken."""
    ticks, group = 0, os.getpgid(browser.process.pid)
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:  # it has ended
            continue
        if int(fields[2]) == group:
            ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def measured(browser, begin, step):
    """(frames a second, median and slowest ms a frame, CPU ms a frame, pixels a pixel) while
    `step(t)` is called, t the seconds so far."""
    begin()
    browser.run("frames_.length = 0")
    before = cpu(browser)
    start = time.perf_counter()
    while (t := time.perf_counter() - start) < SECONDS:
        step(t)
    took, work = time.perf_counter() - start, cpu(browser) - before
    frames = browser.run("frames_")
    gaps = sorted(b[0] - a[0] for a, b in pairwise(frames)) or [float("inf")]
    fine = sorted(frame[1] for frame in frames)[len(frames) // 2] if frames else 0
    return (
        len(frames) / took,
        gaps[len(gaps) // 2],
        gaps[-1],
        1000.0 * work / max(len(frames), 1),
        fine,
    )


def drawings(files):
    """(name, SVG text) of the files, or of 303 strokes in three styles."""
    if files:
        return [(Path(file).name, Path(file).read_text()) for file in files]
    return [(style, write_svg(drawing(style, POINTS), strips=True)) for style in STYLES]


def main():
    sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
    from browsers import KINDS

    files = [word for word in sys.argv[1:] if word != "--firefox"]
    browser_of, reason = KINDS["firefox" if "--firefox" in sys.argv else "chromium"]
    if reason:
        print(f"skipped: {reason}")
        return
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    columns = f"{'median':>8s} {'slowest':>8s} {'CPU ms':>7s} {'px a px':>8s}"
    print(f"{'what is moved':22s} {'frames/s':>9s} {columns}   target {FLUID:.0f} frames/s")
    for name, text in drawings(files):
        page = page_html([(name, text)])
        with tempfile.TemporaryDirectory() as folder, browser_of() as browser:
            path = Path(folder, "page.html")
            path.write_text(page, encoding="utf-8")
            start = time.perf_counter()
            browser.open(path)
            ready = time.perf_counter() - start
            count = browser.run("current.strokes.length")
            print(
                f"{name}: {count} strokes, SVG {len(text) / 1000:.0f} kB, page "
                f"{len(page) / 1000:.0f} kB, {ready:.2f} s"
            )
            browser.run(COUNTER)
            time.sleep(WAIT)
            for what, hand in HANDS.items():
                begin, step = hand(browser)
                rate, median, slowest, work, fine = measured(browser, begin, step)
                browser.mouse("mouseReleased", *middle(browser, "#stage"))
                browser.run("fit()")
                time.sleep(WAIT)
                found = f"{rate:9.0f} {median:8.0f} {slowest:8.0f} {work:7.0f} {fine:8.2f}"
                print(f"{what:22s} {found}   {'met' if rate >= FLUID else 'MISSED'}", flush=True)
            start = time.perf_counter()
            edited = browser.run("savedText(current)")
            took = time.perf_counter() - start
            print(f"saving all {count} strokes changed: {took:.1f} s, {len(edited) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
