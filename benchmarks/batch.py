"""A batch of generated meshes of 2,000 to 50,000 faces: one job against two, the memory of the
workers, and kill -9 of workers and of the parent.

    python benchmarks/batch.py [--meshes 100] [--model m.pt] [--kill-every 20] [--folder DIR]

Without a model, one is learned from examples/ first. Printed are
  time      of --jobs 1 and of --jobs 2, from start to end, and the one over the other;
  memory    resident in a worker, MB, at two looks a second: the mean of each tenth of the meshes,
            and the mean and the largest after the 50th mesh over those of the ten before it;
  kills     a batch whose workers are killed one after the other, and whose parent is killed twice
            and goes on with --resume: drawings that differ from the undisturbed ones, are missing
            or half-written, and processes that are left a moment later.
The machine should be idle; a shape's name is its seed."""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import trimesh

from strokestyle.batch.journal import NAME, read_journal
from strokestyle.batch.memory import MB, resident

EXAMPLES = Path(__file__).parent.parent / "examples"
FACES = (2_000, 50_000)
FIRST = 50  # meshes, after which memory is to be flat


def generate(folder: Path, count: int) -> None:
    """Write spheres with dents and bumps; as many small ones as large ones, by the logarithm."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(count):
        path = folder / f"{seed:04d}.ply"
        if path.exists():
            continue
        chance = np.random.default_rng(seed)
        rows = int(np.sqrt(np.exp(chance.uniform(*np.log(FACES))) / 4))
        sphere = trimesh.creation.uv_sphere(count=[rows, 2 * rows])
        radius = np.ones(len(sphere.vertices))
        for _ in range(8):
            way = chance.normal(size=3)
            near = sphere.vertices @ (way / np.linalg.norm(way)) - 1
            radius += chance.uniform(-0.35, 0.45) * np.exp(near * chance.uniform(2, 25))
        vertices = sphere.vertices * radius[:, None] * chance.uniform(0.6, 1.4, 3)
        trimesh.Trimesh(vertices, sphere.faces, process=False).export(path)


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "strokestyle", *map(str, words)]


def learn(folder: Path) -> Path:
    """A style, learned from the charcoal drawing of the examples."""
    model = folder / "model.pt"
    if not model.exists():
        drawing, shape = EXAMPLES / "drawings/charcoal.png", EXAMPLES / "shapes/elephant.ply"
        args = (drawing, shape, "-o", model)
        subprocess.run(command("fit", *args, "--preset", "quick", "-q"), check=True)
    return model


def children(process: int) -> list[int]:
    """The processes that a process has started."""
    told = subprocess.run(["pgrep", "-P", str(process)], capture_output=True, text=True)
    return [int(line) for line in told.stdout.split()]


def drawn_so_far(out: Path) -> int:
    """Lines in the journal."""
    return (out / NAME).read_bytes().count(b"\n") if (out / NAME).exists() else 0


class Watch(threading.Thread):
    """Looks at the memory of a batch's workers: (meshes drawn, bytes) at every look."""

    def __init__(self, process: int, out: Path):
        super().__init__(daemon=True)
        self.process, self.out, self.seen = process, out, []
        self.start()

    def run(self) -> None:
        while resident(self.process):
            for worker in children(self.process):
                self.seen.append((drawn_so_far(self.out), (resident(worker) or 0) / MB))
            time.sleep(0.5)


def undisturbed(render: list[str], out: Path, jobs: int) -> tuple[float, np.ndarray]:
    """Seconds that a batch takes, and what its workers' memory was: (meshes drawn, MB)."""
    start = time.perf_counter()
    running = subprocess.Popen([*render, "-o", str(out), "--jobs", str(jobs)])
    watch = Watch(running.pid, out)
    if running.wait():
        sys.exit(f"a batch failed: {out}")
    return time.perf_counter() - start, np.array(watch.seen)


def tell_memory(seen: np.ndarray, count: int) -> None:
    """Print the memory of each tenth of the meshes, and whether it grows after the FIRST."""
    tenths = np.array_split(np.arange(count), 10)
    means = [seen[np.isin(seen[:, 0], tenth), 1] for tenth in tenths]
    print("memory   MB  ", " ".join(f"{one.mean():4.0f}" if len(one) else "   -" for one in means))
    done = seen[:, 0]
    before, after = seen[(done >= FIRST - 10) & (done < FIRST), 1], seen[done >= FIRST, 1]
    if len(before) and len(after):
        half = np.median(done[done >= FIRST])
        last = seen[done >= half, 1]
        print(
            f"memory   after mesh {FIRST}: mean {last.mean() / before.mean():.3f}, largest "
            f"{last.max() / before.max():.3f} of that of the ten before it (second half)"
        )


def disturbed(render: list[str], out: Path, every: float, parents: list[int]) -> dict[str, int]:
    """Run a batch, kill a worker every so often, and the parent at so many meshes."""
    chance, kills = random.Random(0), {"workers": 0, "parents": 0, "left": 0}
    stops = list(parents)
    while True:
        running = subprocess.Popen([*render, "-o", str(out), "--jobs", "2", "--resume"])
        at = time.monotonic() + every
        while running.poll() is None:
            time.sleep(0.1)
            if stops and drawn_so_far(out) >= stops[0]:
                stops.pop(0)
                workers = children(running.pid)
                os.kill(running.pid, signal.SIGKILL)
                running.wait()
                time.sleep(3)
                kills["parents"] += 1
                kills["left"] += sum(bool(resident(worker)) for worker in workers)
            elif time.monotonic() > at and (workers := children(running.pid)):
                os.kill(chance.choice(workers), signal.SIGKILL)
                kills["workers"] += 1
                at += every
        if running.returncode >= 0:
            return kills | {"code": running.returncode}


def compare(one: Path, other: Path, meshes: int) -> str:
    """What of two batches is not alike."""
    first, second = ({p.name: p.read_bytes() for p in out.glob("*.svg")} for out in (one, other))
    differ = sum(first[name] != second.get(name) for name in first)
    parts = sum(p.name.endswith(".part") for p in other.iterdir())
    lines, failed = read_journal(other), sum(not line.drawn for line in read_journal(other))
    return (
        f"{len(second)} of {meshes} drawings, {differ} that differ, {parts} half-written, "
        f"{len(lines)} lines in the journal, {failed} failures"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--meshes", type=int, default=100)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--kill-every", type=float, default=20.0, metavar="SECONDS")
    parser.add_argument("--folder", type=Path, default=Path("out/batch"))
    args = parser.parse_args()
    meshes = args.folder / f"meshes-{args.meshes}"
    generate(meshes, args.meshes)
    render = command("render", args.model or learn(args.folder), meshes, "-q")
    stamp = time.strftime("%H%M%S")
    outs = {name: args.folder / f"{name}-{stamp}" for name in ("one", "two", "killed")}

    one, seen = undisturbed(render, outs["one"], 1)
    two, both = undisturbed(render, outs["two"], 2)
    print(f"time     --jobs 1 {one:.1f} s, --jobs 2 {two:.1f} s: {one / two:.2f} times")
    print(f"         {compare(outs['one'], outs['two'], args.meshes)}")
    for name, watched in (("1", seen), ("2", both)):
        print(f"--jobs {name}")
        tell_memory(watched, args.meshes)
    thirds = [args.meshes // 3, 2 * args.meshes // 3]
    kills = disturbed(render, outs["killed"], args.kill_every, thirds)
    print(f"kills    {', '.join(f'{name} {n}' for name, n in kills.items())}")
    print(f"         {compare(outs['one'], outs['killed'], args.meshes)}")


if __name__ == "__main__":
    main()
