"""Learn styles from one drawing each by many methods, and draw the test shapes.

    python experiments/compare_methods.py OUT [--data DATA] [--methods a,b] [--styles a,b]
        [--size 256] [--full] [--jobs 1]

DATA is a data set (dataset.py says how it lies); the environment's STROKESTYLE_SHARED by default.
Writes OUT/<method>/<style>/<shape>.png and, a line a style, OUT/<method>/times.jsonl: CPU seconds
to learn and to draw one shape, peak memory in MB. Every style of a method has a process of its own
with one thread, so that neither seconds nor memory are another's. What is there already is not made
again, so that a run may be stopped and started. `--list` says which methods there are, `--full`
takes their settings as published, for a GPU."""

import argparse
import io
import json
import multiprocessing
import os
import resource
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from dataset import add_data_options, data_of
from methods import Method, all_methods, chosen_methods
from PIL import Image

from strokestyle.files import write_bytes


@dataclass(frozen=True)
class Job:
    """One style, to be learned by one method and drawn."""

    method: str
    style: str
    folder: Path
    options: argparse.Namespace


def settings_of(method: Method, options: argparse.Namespace):
    """What the method runs with."""
    return method.full if options.full else method.reduced


def png(image: np.ndarray) -> bytes:
    """Encode (H, W, 3) uint8."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", optimize=True)
    return file.getvalue()


def draw_style(job: Job) -> tuple[Job, dict | str]:
    """Learn one style and draw its test shapes: what it cost, or what went wrong."""
    try:
        return job, _draw_style(job)
    except Exception:  # the others go on; this one is told of at the end
        return job, traceback.format_exc()


def _draw_style(job: Job) -> dict:
    data, method = data_of(job.options), all_methods()[job.method]
    lesson, seed = data.lesson(job.style), job.options.seed
    tests = [data.sheet(shape) for shape in data.tests(job.style)]
    for sheet in (lesson.sheet, *tests):  # what all methods share is nobody's time
        _ = sheet.maps, sheet.plain
    start = time.process_time()
    paint = method.learn(lesson, settings_of(method, job.options), seed, job.options.device)
    learned = time.process_time()
    images = {sheet.shape: paint(sheet, seed) for sheet in tests}
    drawn = time.process_time()
    for sheet in tests:
        image = images[sheet.shape]
        if image.shape != (*sheet.size[::-1], 3) or image.dtype != np.uint8:
            raise ValueError(f"{job.method} drew {image.shape} {image.dtype} of {sheet.shape}")
        write_bytes(job.folder / job.style / f"{sheet.shape}.png", png(image))
    return {
        "style": job.style,
        "learn s": round(learned - start, 2),
        "draw s": round((drawn - learned) / len(tests), 2),
        "peak MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }


def jobs_to_do(methods: dict[str, Method], options: argparse.Namespace) -> list[Job]:
    """What is not there yet. Raises ValueError where what is there has other settings."""
    data = data_of(options)
    styles = data.chosen_styles(options.styles)
    to_do = []
    for name, method in methods.items():
        folder = options.out / name
        about = {
            "settings": repr(settings_of(method, options)),
            "size": data.size,
            "train": data.train,
            "seed": options.seed,
        }
        kept = folder / "settings.json"
        if kept.exists() and json.loads(kept.read_text()) != about:
            raise ValueError(
                f"{kept}: drawn with other settings; remove {folder}, or give another OUT"
            )
        folder.mkdir(parents=True, exist_ok=True)
        write_bytes(kept, json.dumps(about, indent=1).encode())
        for style in styles:
            (folder / style).mkdir(exist_ok=True)
            there = {path.stem for path in (folder / style).glob("*.png")}
            if set(data.tests(style)) - there:
                to_do.append(Job(name, style, folder, options))
    return to_do


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, nargs="?")
    add_data_options(parser)
    parser.add_argument("--methods", help="comma-separated; all by default")
    parser.add_argument("--styles", help="comma-separated; all by default")
    parser.add_argument("--full", action="store_true", help="settings as published")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="styles learned at the same time")
    parser.add_argument("--list", action="store_true", help="name the methods, and do nothing")
    options = parser.parse_args()
    if options.jobs < 1:
        parser.error("--jobs is 1 or more")
    try:
        methods = chosen_methods(options.methods)
        if options.list:
            for name, method in methods.items():
                print(f"{name:28s} {method.label}; {method.source}")
            return
        if options.out is None:
            parser.error("give OUT")
        to_do = jobs_to_do(methods, options)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    failed = 0
    with multiprocessing.get_context("spawn").Pool(options.jobs, maxtasksperchild=1) as pool:
        for job, row in pool.imap(draw_style, to_do, chunksize=1):
            if isinstance(row, str):
                failed += 1
                print(f"{job.method}, {job.style}: {row}", file=sys.stderr, flush=True)
                continue
            print(job.method, json.dumps(row), flush=True)
            with open(job.folder / "times.jsonl", "a") as file:
                file.write(json.dumps(row) + "\n")
    if failed:
        sys.exit(f"{failed} of {len(to_do)} failed; run again to try these once more")


if __name__ == "__main__":
    main()
