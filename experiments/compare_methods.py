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
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

import numpy as np
from common_options import carry_out, comparing
from dataset import data_of
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


def outcomes(jobs: list[Job], at_once: int) -> Iterator[tuple[Job, dict | str]]:
    """Do jobs, each in a process of its own, and tell what each cost, or what went wrong.

    A process that is killed, for its memory say, is told of as well: a pool would wait for ever.
    """
    spawn, waiting = multiprocessing.get_context("spawn"), list(reversed(jobs))
    running: dict[Connection, tuple[Job, SpawnProcess]] = {}
    while waiting or running:
        while waiting and len(running) < at_once:
            job, (ours, theirs) = waiting.pop(), spawn.Pipe(duplex=False)
            process = spawn.Process(target=_report, args=(job, theirs))
            process.start()
            theirs.close()
            running[ours] = job, process
        for ended in wait(list(running)):
            assert isinstance(ended, Connection)
            job, process = running.pop(ended)
            try:
                row = ended.recv()
            except EOFError:
                row = None
            process.join()
            yield job, row or f"its process ended with {process.exitcode}: out of memory?"


def _report(job: Job, to: Connection) -> None:
    try:
        to.send(_draw_style(job))
    except Exception:  # the others go on; this one is told of at the end
        to.send(traceback.format_exc())


def run(options: argparse.Namespace) -> None:
    """Draw what the options name, and exit with 1 if any of it failed. Raises as `jobs_to_do`."""
    to_do, failed = jobs_to_do(chosen_methods(options.methods), options), 0
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    for job, row in outcomes(to_do, options.jobs):
        if isinstance(row, str):
            failed += 1
            print(f"{job.method}, {job.style}: {row}", file=sys.stderr, flush=True)
            continue
        print(job.method, json.dumps(row), flush=True)
        with open(job.folder / "times.jsonl", "a") as file:
            file.write(json.dumps(row) + "\n")
    if failed:
        sys.exit(f"{failed} of {len(to_do)} failed; run again to try these once more")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not 1 or more")
    return int(text)


class _List(argparse.Action):
    """Names the methods, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        for name, method in all_methods().items():
            print(f"{name:28s} {method.label}; {method.source}")
        parser.exit()


def main() -> None:
    parser = comparing(__doc__)
    parser.add_argument("--full", action="store_true", help="settings as published")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=_count, default=1, help="styles learned at the same time")
    parser.add_argument("--list", nargs=0, action=_List, help="name the methods, and end")
    carry_out(run, parser)


if __name__ == "__main__":
    main()
