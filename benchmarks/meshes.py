"""Every mesh of some folders drawn by `extract`, each in a process of its own with a limit of time
and memory, two at a time: what was drawn, refused, failed or slow, and contact sheets.

    python benchmarks/meshes.py [FOLDER ...] [-o SHEETS] [--with 'NAME=OPTIONS' ...]
        [--seconds 60] [--memory 2] [--details]

`--with 'pins4=--view 30,30'` draws the files of that stem with other options; a path in OPTIONS
that is not there is looked for beside the file. Without a folder the shapes of examples/ are
drawn.

drawn: exit code 0, and lines. refused: exit code 1 and one line on the terminal. failed: all else,
among it an empty drawing, a traceback, or a process that ran out of its limits. Linux and macOS."""

from __future__ import annotations

import argparse
import json
import os
import resource
import shlex
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).parent.parent
# What lies beside meshes and is none; all else is tried, whatever its suffix.
NO_MESHES = {
    ".md", ".txt", ".json", ".bin", ".mtl", ".png", ".jpg", ".jpeg", ".svg", ".csv", ".py", ".npz",
}  # fmt: skip
OUT_OF_MEMORY = "out of memory"
SLOW = 10.0  # s of wall time
AT_ONCE = 2
CELL, TITLE, COLUMNS, ROWS = 320, 22, 6, 5  # px, px, and cells of a sheet
OVERSAMPLING = 3
BYTES_PER_KIB, BYTES_PER_GB = 1024, 1e9


class Outcome(NamedTuple):
    """What became of a file.

    verdict : "drawn", "refused" or "failed"
    why : the one line of a refusal; what went wrong
    seconds, memory : of the process: wall time, and peak resident bytes
    size, curves : of the drawing: (width, height), and a list of (N, 2) pixels
    """

    path: Path
    verdict: str
    why: str
    seconds: float
    memory: float
    size: tuple[int, int] = (1, 1)
    curves: list = []


def draw(path: Path, options: str, seconds: float, memory: float) -> Outcome:
    """Draw one file in a process of its own, which is ended after `seconds`."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "lines.json"
        words = [_beside(path, word) for word in shlex.split(options)]
        command = [sys.executable, "-m", "strokestyle", "extract", str(path), "-o", str(out)]
        code, text, wall, peak = run([*command, *words], seconds, memory)
        drawn = json.loads(out.read_text()) if code == 0 and out.is_file() else None
    lines = text.strip().splitlines()
    last = lines[-1] if lines else ""
    if drawn is not None and drawn["curves"]:
        curves = [np.array(curve) for curve in drawn["curves"]]
        return Outcome(path, "drawn", last, wall, peak, tuple(drawn["size"]), curves)
    if drawn is not None:
        return Outcome(path, "failed", "drew nothing", wall, peak)
    if code == 1 and len(lines) == 1 and OUT_OF_MEMORY not in last:
        return Outcome(path, "refused", last, wall, peak)
    why = f"ended after {seconds:g} s" if code is None else f"exit code {code}: {last[-300:]}"
    return Outcome(path, "failed", why, wall, peak)


def _beside(path: Path, word: str) -> str:
    """Find a file that an option names beside the mesh, where it is not here."""
    other = path.parent / word
    return str(other) if not Path(word).exists() and other.is_file() else word


def run(command: list[str], seconds: float, memory: float) -> tuple[int | None, str, float, float]:
    """Run a command within limits: exit code (None: ended), terminal, wall seconds, peak bytes."""

    def limit() -> None:
        most = int(memory * BYTES_PER_GB)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))

    start = time.perf_counter()
    with tempfile.TemporaryFile() as terminal:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=terminal,
            stderr=subprocess.STDOUT,
            preexec_fn=limit,
            # a thread's stack and arena count as its process's memory
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        ended = threading.Event()

        def end() -> None:
            ended.set()
            process.kill()

        timer = threading.Timer(seconds, end)
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        terminal.seek(0)
        text = terminal.read().decode("utf-8", "replace")
    unit = 1 if sys.platform == "darwin" else BYTES_PER_KIB
    code = None if ended.is_set() else process.returncode
    return code, text, time.perf_counter() - start, float(usage.ru_maxrss * unit)


def sheets(outcomes: list[Outcome], folder: Path) -> list[Path]:
    """Put drawings on sheets of COLUMNS x ROWS; what was not drawn is named on them."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for first in range(0, len(outcomes), COLUMNS * ROWS):
        page = outcomes[first : first + COLUMNS * ROWS]
        rows = -(-len(page) // COLUMNS)
        sheet = Image.new("L", (COLUMNS * CELL, rows * (CELL + TITLE)), 255)
        pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
        for i, outcome in enumerate(page):
            x, y = i % COLUMNS * CELL, i // COLUMNS * (CELL + TITLE)
            label = outcome.path.name if outcome.verdict == "drawn" else f"({outcome.path.name})"
            pen.text((x + 6, y + 4), label, 90, font)
            sheet.paste(picture(outcome), (x, y + TITLE))
        paths.append(folder / f"sheet-{len(paths) + 1}.png")
        sheet.save(paths[-1], optimize=True)
    return paths


def picture(outcome: Outcome) -> Image.Image:
    """Draw the curves of an outcome, black on white, CELL px; the words of one without."""
    image = Image.new("L", (CELL * OVERSAMPLING,) * 2, 255)
    pen = ImageDraw.Draw(image)
    scale = CELL * OVERSAMPLING / max(outcome.size)
    for curve in outcome.curves:
        pen.line([tuple(point) for point in curve * scale], 0, OVERSAMPLING, "curve")
    image = image.reduce(OVERSAMPLING)
    if not outcome.curves:
        words = outcome.why.replace(str(outcome.path), "").strip(": ")
        lines = [words[i : i + 42] for i in range(0, min(len(words), 300), 42)]
        text = "\n".join([outcome.verdict, *lines])
        ImageDraw.Draw(image).text((8, 8), text, 120, ImageFont.load_default(13))
    return image


def meshes(folder: Path) -> list[Path]:
    """List the files of a folder and of those in it that may be meshes."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in files if path.suffix.lower() not in NO_MESHES)


def report(title: str, outcomes: list[Outcome], details: bool) -> None:
    """Print the row of a folder, and a line for each file that was not simply drawn."""
    count = {v: sum(o.verdict == v for o in outcomes) for v in ("drawn", "refused", "failed")}
    slow = sum(o.seconds > SLOW for o in outcomes)
    slowest = max(o.seconds for o in outcomes)
    worst = max(o.memory for o in outcomes) / 1e6
    print(
        f"| {title} | {len(outcomes)} | {count['drawn']} | {count['refused']} | {count['failed']} "
        f"| {slow} | {slowest:.1f} s | {worst:.0f} MB |"
    )
    for outcome in outcomes:
        if details or outcome.verdict != "drawn" or outcome.seconds > SLOW:
            cost = f"{outcome.seconds:.1f} s, {outcome.memory / 1e6:.0f} MB"
            print(f"  {outcome.verdict}: {outcome.path.name} ({cost}) {outcome.why}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="*", default=[ROOT / "examples" / "shapes"])
    parser.add_argument("-o", "--sheets", type=Path, help="folder for the contact sheets")
    parser.add_argument("--with", dest="special", action="append", default=[], metavar="NAME=OPT")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--memory", type=float, default=2.0, help="GB")
    parser.add_argument("--details", action="store_true", help="a line for each file")
    args = parser.parse_args()
    special = dict(text.split("=", 1) for text in args.special)
    print(
        f"| folder | files | drawn | refused | failed | over {SLOW:g} s | slowest | most memory |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for folder in args.folders:
        paths = meshes(folder)
        if not paths:
            parser.error(f"{folder}: no meshes in it")
        with ThreadPoolExecutor(AT_ONCE) as pool:
            jobs = [
                pool.submit(draw, path, special.get(path.stem, ""), args.seconds, args.memory)
                for path in paths
            ]
            outcomes = [job.result() for job in jobs]
        report(folder.name, outcomes, args.details)
        if args.sheets:
            name = folder.resolve().parent.name + "-" + folder.name
            for path in sheets(outcomes, args.sheets / name):
                print(f"  {path}")


if __name__ == "__main__":
    main()
