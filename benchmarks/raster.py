"""The rasteriser against near-exact coverage, and its speed. Prints two tables.

    python benchmarks/raster.py [ORACLES]

ORACLES is a folder of .npz scenes (points, thickness, offsets, canvas_hw, coverage, target_coverage, fd_points,
fd_thickness); without it only the speed is measured. `DiffVG` columns are its figures at 2 x 2 samples a pixel.
"""

import sys
import time
from pathlib import Path

import numpy as np
import torch

from strokestyle.raster import coverage

DIFFVG_SECONDS = {64: 0.23, 128: 1.1, 192: 2.2, 256: 3.7}  # forward + backward of 16 patches, 2 cores
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


def differences(scene, step=0.4):
    """Central differences of the loss in every thickness, as stored: each half width moved by 0.2 px both ways.

    |.| has a kink where two edges nearly coincide; within this step of one, no gradient can agree with a difference.
    """
    height, width = (int(n) for n in scene["canvas_hw"])
    xy, offsets = torch.tensor(scene["points"]), torch.tensor(scene["offsets"])
    target, out = torch.tensor(scene["target_coverage"]), []
    for i in range(len(xy)):
        loss = []
        for sign in (1, -1):
            thickness = torch.tensor(scene["thickness"])
            thickness[i] += sign * step
            loss.append((coverage(xy, thickness, offsets, height, width) - target).abs().double().mean().item())
        out.append((loss[0] - loss[1]) / (2 * step))
    return np.array(out)


def accuracy(folder: Path):
    print("                         mean error         worst pixel      cosine of gradients")
    print(
        "                         ours    DiffVG     ours   DiffVG    points  DiffVG  thickness DiffVG  our differences"
    )
    for path in sorted(folder.glob("*.npz")):
        scene = np.load(path)
        cover, points, thickness = gradients(scene)
        error, theirs = np.abs(cover - scene["coverage"]), np.abs(scene["diffvg_coverage_2x2"] - scene["coverage"])
        figures = (
            cosine(points, scene["fd_points"]),
            cosine(scene["diffvg_grad_points_2x2"], scene["fd_points"]),
            cosine(thickness, scene["fd_thickness"]),
            cosine(scene["diffvg_grad_thickness_2x2"], scene["fd_thickness"]),
            cosine(differences(scene), scene["fd_thickness"]),
        )
        print(
            f"{path.stem:24s} {error.mean():.5f} {theirs.mean():.5f}    {error.max():.3f}  {theirs.max():.3f}     "
            + "  ".join(f"{figure:.4f}" for figure in figures)
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
    print(f"16 patches, forward + backward, {device}\npatch  points  seconds  DiffVG  ratio")
    for size, points in POINTS.items():
        xy, thickness, offsets, image = (a.to(device) for a in scribble(size, points, 16, np.random.default_rng(0)))
        xy.requires_grad_(), thickness.requires_grad_()
        best = np.inf
        for _ in range(7):
            start = time.perf_counter()
            cover = coverage(xy, thickness, offsets, size, size, image, 16)
            cover.sum().backward()
            if device == "cuda":
                torch.cuda.synchronize()
            best = min(best, time.perf_counter() - start)
        print(f"{size:5d} {points:7d} {best:8.4f} {DIFFVG_SECONDS[size]:7.2f} {DIFFVG_SECONDS[size] / best:6.1f}")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        accuracy(Path(sys.argv[1]))
        print()
    speed("cuda" if torch.cuda.is_available() else "cpu")
