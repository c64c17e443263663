"""The page of `strokestyle view` with 303 strokes of grain, in headless Chromium: is it fluid? Prints a table.

    python benchmarks/page.py

A mouse drags sliders and a stroke's point and turns the wheel for two seconds each, at 1280 x 800; a frame counts when
its picture is painted. Headless Chromium paints without a GPU; the page does not need one. Where the machine is busy,
the CPU time of a frame tells more than the frames a second.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from svg import COUNT, POINTS, drawing

from strokestyle.page import page_html
from strokestyle.svg import write_svg

SECONDS = 2.0
FLUID = 30.0  # frames a second

# counts the pictures shown, and remembers how fine they were
COUNTER = """
window.frames_ = [];
const count = () => frames_.push([performance.now(), shown.canvas.width / (stage.clientWidth * devicePixelRatio)]);
for (const name of ["showCanvas", "paintPart"]) {
  const plain = window[name];
  window[name] = (...all) => {
    const done = plain(...all);
    if (done !== false) count();
    return done;
  };
}
"""


def middle(browser, selector):
    box = f"document.querySelector({selector!r}).getBoundingClientRect()"
    return browser.run(f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({box})")


def cpu(browser):
    """Seconds of CPU that the page's main thread has taken."""
    return next(m["value"] for m in browser.send("Performance.getMetrics")["metrics"] if m["name"] == "TaskDuration")


def measured(browser, begin, step):
    """Frames a second, their median fineness and CPU milliseconds while `step(t)` is called, t the seconds so far."""
    begin()
    browser.run("frames_.length = 0")
    before = cpu(browser)
    start = time.perf_counter()
    while (t := time.perf_counter() - start) < SECONDS:
        step(t)
    frames = browser.run("frames_")
    took = (frames[-1][0] - frames[0][0]) / 1000.0
    fine = sorted(frame[1] for frame in frames)[len(frames) // 2]
    return (len(frames) - 1) / took, fine, 1000.0 * (cpu(browser) - before) / len(frames)


def main():
    sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
    from browser import WHY_NOT, Browser

    if WHY_NOT:
        print(f"skipped: {WHY_NOT}")
        return
    text = write_svg(drawing("grain", POINTS))
    page = page_html([("bench.svg", text)])
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        path = Path(folder, "page.html")
        path.write_text(page, encoding="utf-8")
        start = time.perf_counter()
        browser.open(path)
        ready = time.perf_counter() - start
        print(f"{COUNT} strokes: SVG {len(text) / 1000:.0f} kB, page {len(page) / 1000:.0f} kB, shown in {ready:.2f} s")
        print(f"load of the machine while measuring: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
        browser.run(COUNTER)
        browser.send("Performance.enable", timeDomain="threadTicks")
        columns = f"{'what is moved':22s} {'frames/s':>9s} {'CPU ms a frame':>15s} {'pixels a pixel':>15s}"
        print(f"{columns}   target {FLUID:.0f} frames/s")

        def slider(name):
            x, y = middle(browser, name)
            left = x - 60

            def begin():
                browser.mouse("mouseMoved", left, y)
                browser.mouse("mousePressed", left, y)

            return begin, lambda t: browser.mouse("mouseMoved", left + 60 * t, y, down=True)

        def point():
            browser.run("select(150)")
            browser.frame()
            x, y = middle(browser, "#handles g:nth-child(3)")

            def begin():
                browser.mouse("mouseMoved", x, y)
                browser.mouse("mousePressed", x, y)

            return begin, lambda t: browser.mouse("mouseMoved", x + 30 * t, y + 20 * t, down=True)

        def wheel():
            x, y = middle(browser, "#stage")
            return lambda: None, lambda t: browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=-12 if t < 1 else 12)

        for name, hand in (
            ("thickness", lambda: slider("#thickness")),
            ("wiggle", lambda: slider("#wiggle")),
            ("a point of a stroke", point),
            ("the wheel: zoom", wheel),
        ):
            begin, step = hand()
            rate, fine, work = measured(browser, begin, step)
            x, y = middle(browser, "#stage")
            browser.mouse("mouseReleased", x, y)
            browser.run("fit()")
            time.sleep(1.0)
            print(f"{name:22s} {rate:9.0f} {work:15.0f} {fine:15.2f}   {'met' if rate >= FLUID else 'MISSED'}")
        start = time.perf_counter()
        edited = browser.run("savedText(current)")
        took = time.perf_counter() - start
        print(f"saving all {COUNT} strokes changed: {took:.1f} s, {len(edited) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
