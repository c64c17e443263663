"""The rasteriser against near-exact coverage, and its speed. Prints two tables.

    python benchmarks/raster.py [ORACLES]

ORACLES is a folder of .npz scenes (points, thickness, offsets, canvas_hw, coverage,
target_coverage, fd_points, fd_thickness); without it only the speed is measured. `DiffVG` columns
are its figures at 2 x 2 samples a pixel. A star marks what misses its target, and more about it
follows."""

import os
import sys
import time
from pathlib import Path

# as strokestyle/render/__init__.py, for the reason given there, but before torch is imported here
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "30000")

import numpy as np
import torch

from strokestyle.render.coverage import coverage

DIFFVG_SECONDS = {
    64: 0.23,
    128: 1.1,
    192: 2.2,
    256: 3.7,
}  # forward + backward of 16 patches, 2 cores
POINTS = {64: 1785, 128: 4958, 192: 9429, 256: 15890}


def cosine(a, b):
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


def gradients(scene):
    """Coverage and the gradients of the scene's loss, mean |coverage - target|."""
    height, width = (int(n) for n in scene["canvas_hw"])
    xy = torch.tensor(scene["points"], dtype=torch.float32, requires_grad=True)
    thickness = torch.tensor(scene["thickness"], dtype=torch.float32, requires_grad=True)
    cover = coverage(xy, thickness, torch.tensor(scene["offsets"]), height, width)
    (cover - torch.tensor(scene["target_coverage"], dtype=torch.float32)).abs().mean().backward()
    return cover.detach().numpy(), xy.grad.numpy(), thickness.grad.numpy()


def differences(scene, step):
    """Central differences of the loss in every thickness, each moved by `step` px both ways.

    |.| has a kink where two edges nearly coincide; within this step of one, no gradient can agree
    with a difference.
    The stored ones move each half width by 0.2 px, so that their step is 0.4.
    """
    height, width = (int(n) for n in scene["canvas_hw"])
    xy, offsets = torch.tensor(scene["points"]), torch.tensor(scene["offsets"])
    target, out = torch.tensor(scene["target_coverage"]), []
    for i in range(len(xy)):
        loss = []
        for sign in (1, -1):
            thickness = torch.tensor(scene["thickness"])
            thickness[i] += sign * step
            loss.append(
                (coverage(xy, thickness, offsets, height, width) - target)
                .abs()
                .double()
                .mean()
                .item()
            )
        out.append((loss[0] - loss[1]) / (2 * step))
    return np.array(out)


def accuracy(folder: Path):
    print(
        "                          mean error            worst pixel        gradients: cosine "
        "with stored differences"
    )
    print(
        "                          ours     DiffVG       ours   DiffVG      points  DiffVG    "
        "  thickness  DiffVG"
    )
    print(
        "target                    < DiffVG              <= .25             >= .985           "
        "  >= .96"
    )
    missed = []
    for path in sorted(folder.glob("*.npz")):
        scene = np.load(path)
        cover, points, thickness = gradients(scene)
        error, theirs = (
            np.abs(cover - scene["coverage"]),
            np.abs(scene["diffvg_coverage_2x2"] - scene["coverage"]),
        )
        a, b = cosine(points, scene["fd_points"]), cosine(thickness, scene["fd_thickness"])
        c = cosine(scene["diffvg_grad_points_2x2"], scene["fd_points"])
        d = cosine(scene["diffvg_grad_thickness_2x2"], scene["fd_thickness"])
        met = (error.mean() < theirs.mean(), error.max() <= 0.25, a >= 0.985, b >= 0.96)
        marks = [" " if good else "*" for good in met]
        print(
            f"{path.stem:24s}  {error.mean():.5f}{marks[0]} {theirs.mean():.5f}      "
            f"{error.max():.3f}{marks[1]} "
            f"{theirs.max():.3f}       {a:.4f}{marks[2]} {c:.4f}      {b:.4f}{marks[3]}    {d:.4f}"
        )
        if not met[3]:
            missed.append((path.stem, scene, thickness))
    for name, scene, thickness in missed:
        print(f"\n* {name}: differences of our own coverage, by step (the stored ones: 0.4 px)")
        print("step, px  with the stored differences  with our gradient")
        for step in (0.4, 0.2, 0.1, 0.02, 0.005):
            ours = differences(scene, step)
            print(
                f"{step:8.3f}  {cosine(ours, scene['fd_thickness']):27.4f}  "
                f"{cosine(ours, thickness):17.4f}"
            )


def scribble(size, points, images, rng):
    """Smooth strokes of 40 points, 3 px apart, 2 to 10 px thick, in every image of a batch."""
    strokes = max(points // 40, images)
    counts = np.full(strokes, 40)
    counts[-1] += points - counts.sum()
    lines = []
    for n in counts:
        heading = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(0, 0.15, n))
        line = 3 * np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        lines.append(line - line[n // 2] + rng.uniform(0, size, 2))
    thickness = np.repeat(rng.uniform(2, 10, strokes), counts)
    return (
        torch.tensor(np.concatenate(lines), dtype=torch.float32),
        torch.tensor(thickness, dtype=torch.float32),
        torch.tensor(np.r_[0, np.cumsum(counts)]),
        torch.arange(strokes) % images,
    )


def speed(device):
    print(
        f"16 patches, forward + backward, {device}, the best\npatch  points  seconds  DiffVG  "
        f"ratio (target >= 20)"
    )
    for size, points in POINTS.items():
        xy, thickness, offsets, image = (
            a.to(device) for a in scribble(size, points, 16, np.random.default_rng(0))
        )
        xy.requires_grad_(), thickness.requires_grad_()
        best = np.inf
        until = time.perf_counter() + 1.5
        while time.perf_counter() < until:
            start = time.perf_counter()
            cover = coverage(xy, thickness, offsets, size, size, image, 16)
            cover.sum().backward()
            if device == "cuda":
                torch.cuda.synchronize()
            best = min(best, time.perf_counter() - start)
        print(
            f"{size:5d} {points:7d} {best:8.4f} {DIFFVG_SECONDS[size]:7.2f} "
            f"{DIFFVG_SECONDS[size] / best:6.1f}"
        )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        accuracy(Path(sys.argv[1]))
        print()
    speed("cuda" if torch.cuda.is_available() else "cpu")
