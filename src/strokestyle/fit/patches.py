"""Cut square patches out of a view: images, curves, and the places worth looking at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from ..extract.view import View

CENTRE = 30 / 64  # of a patch's side: where it must hold a stroke pixel (the authors' code)


def patch_sizes(view: View, sizes: tuple[int, ...]) -> list[int]:
    """Keep the sizes, px, that fit the canvas, or else the largest multiple of 4 that does."""
    largest = min(view.camera.width, view.camera.height) // 4 * 4
    return sorted({min(size, largest) for size in sizes})


def patch_corners(view: View, size: int, centre: float = CENTRE) -> np.ndarray:
    """Find all patches with a pixel of the plain curves in their centre: corners (P, 2), x, y.

    `centre` is that of a patch's side. Raises ValueError where there is none.
    """
    line = (view.maps["plain"] > 0.5).astype(np.int64)
    total = np.pad(line.cumsum(0).cumsum(1), ((1, 0), (1, 0)))  # summed area table
    inner = max(1, round(size * centre))
    near = (size - inner) // 2
    height, width = line.shape
    y, x = np.mgrid[: height - size + 1, : width - size + 1]
    top, bottom, left, right = y + near, y + near + inner, x + near, x + near + inner
    held = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left] > 0
    if not held.any():
        raise ValueError(
            f"no {size} px patch of this view holds a curve in its centre: nothing to learn from"
        )
    return np.stack([x[held], y[held]], axis=1)


def crop(image: Tensor, corners: np.ndarray, size: int) -> Tensor:
    """Patches (B, K, size, size) of an image (K, H, W) with their corners at (B, 2)."""
    return torch.stack([image[:, y : y + size, x : x + size] for x, y in corners.tolist()])


def turned_patches(image: Tensor, corners: np.ndarray, size: int, angle: np.ndarray) -> Tensor:
    """Patches (B, K, size, size) of (1, K, H, W), turned about their centres by angles (B,).

    Angles are in radians, from x towards y. Beyond the canvas all is 1.
    """
    height, width = image.shape[2:]
    place = (torch.arange(size, device=image.device) + 0.5) - size / 2
    y, x = torch.meshgrid(place, place, indexing="ij")
    c, s = (
        torch.tensor(f(angle), dtype=image.dtype, device=image.device)[:, None, None]
        for f in (np.cos, np.sin)
    )
    centre = torch.tensor(corners + size / 2, dtype=image.dtype, device=image.device)
    centre = centre[:, :, None, None]
    px, py = centre[:, 0] + c * x - s * y, centre[:, 1] + s * x + c * y
    grid = torch.stack([2 * px / width - 1, 2 * py / height - 1], dim=-1)
    images = (image - 1.0).expand(len(corners), -1, -1, -1)
    return 1.0 + F.grid_sample(images, grid, align_corners=False)


class CurveRuns(NamedTuple):
    """Runs of curve points inside patches.

    rows : (R,) int64 of the points
    offsets : (S+1,) int64, run i is rows offsets[i]:offsets[i+1]
    patch : (R,) int64, which patch each row lies in
    """

    rows: np.ndarray
    offsets: np.ndarray
    patch: np.ndarray


def cut_curves(xy: np.ndarray, curve: np.ndarray, corners: np.ndarray, size: int) -> CurveRuns:
    """Cut curves at the borders of patches.

    Runs of a single point are left out: a path has at least two.

    Parameters
    ----------
    xy, curve : (N, 2) px, (N,) the curve of each point
    corners : (B, 2) px, x, y
    size : px
    """
    inside = ((xy[None] >= corners[:, None]) & (xy[None] < corners[:, None] + size)).all(axis=2)
    patch, rows = np.nonzero(inside)  # of (B, N)
    new = (np.diff(rows) != 1) | (np.diff(patch) != 0) | (np.diff(curve[rows]) != 0)
    run = np.cumsum(np.r_[True, new][: len(rows)]) - 1
    keep = np.bincount(run)[run] >= 2 if len(run) else np.zeros(0, bool)
    count = np.unique(run[keep], return_counts=True)[1]
    return CurveRuns(rows[keep], np.r_[0, np.cumsum(count)], patch[keep])
