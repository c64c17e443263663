"""A batch at two workers of a Dask scheduler against --jobs 2, on this machine: shapes a second.

    python benchmarks/cluster.py [--shapes 60] [--rounds 2] [--model model.pt]

Both draw the same generated meshes of 2,000 to 50,000 faces, in turns, whole commands with imports;
what they write is compared byte by byte. The scheduler and its workers are started before, as on a
cluster; their CPU is that which the batch costs them.
"""

import argparse
import filecmp
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT / "tests")]

from dask_cluster import Cluster

EXAMPLES = ROOT / "examples"


def make_shapes(folder, count):
    """Balls with bumps: 2,000 to 50,000 faces, no two alike."""
    rng = np.random.default_rng(0)
    for k in range(count):
        rings = int(np.sqrt(np.geomspace(2_000, 50_000, count)[k] / 4))
        ball = trimesh.creation.uv_sphere(count=[rings, 2 * rings])
        bumps = sum(np.sin(ball.vertices @ rng.normal(0, 4, 3) + rng.random()) for _ in range(4))
        ball.vertices *= 1 + 0.08 * bumps[:, None]
        ball.export(folder / f"ball-{k:04d}.ply")


def strokestyle(*words):
    """Wall seconds of a command."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "strokestyle", *map(str, words), "-q"], check=True)
    return time.perf_counter() - start


def cpu(process):
    """CPU seconds of a process and of its children that have ended; Linux alone."""
    with open(f"/proc/{process.pid}/stat") as file:
        return sum(map(int, file.read().rsplit(")", 1)[1].split()[11:15])) / os.sysconf(
            "SC_CLK_TCK"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shapes", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--model", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "in").mkdir()
        make_shapes(folder / "in", args.shapes)
        model = args.model or folder / "model.pt"
        if not args.model:
            elephant = EXAMPLES / "shapes" / "elephant.ply"
            drawing = EXAMPLES / "drawings" / "charcoal.png"
            strokestyle("fit", drawing, elephant, "-o", model, "--preset", "quick")
        words = ("render", model, folder / "in", "-o")
        here, there = [], []
        with Cluster(folder, workers=2) as cluster:
            for k in range(args.rounds):
                here.append(strokestyle(*words, folder / f"here-{k}", "--jobs", 2))
                far = ("--scheduler", cluster.address)
                there.append(strokestyle(*words, folder / f"there-{k}", *far))
            if sys.platform == "linux":
                spent = cpu(cluster.scheduler) / args.rounds / args.shapes
                print(f"scheduler: {1000 * spent:.1f} ms of CPU a shape")
        names = [path.name for path in (folder / "here-0").glob("*.svg")]
        same, other, missing = filecmp.cmpfiles(folder / "here-0", folder / "there-0", names, False)
        print(f"{len(same)} of {len(names)} drawings alike")
        for label, times in (("--jobs 2", here), ("two workers", there)):
            print(f"{label:12s} {args.shapes / statistics.median(times):6.2f} shapes a second")
        print(f"{'ratio':12s} {statistics.median(here) / statistics.median(there):6.2f}")


if __name__ == "__main__":
    main()
