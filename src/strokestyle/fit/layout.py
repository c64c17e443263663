"""Lay a drawing's file on a view: whole, cut to it, stretched, or by the sheet that it shows.

The pixels of the file are resampled once, by layout, sheet and registration together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image
from scipy import ndimage

from .image_file import Scan
from .registration import Homography
from .sheet import Sheet

SAME_PROPORTIONS = 0.005  # logarithm of width by height
NEAR_PROPORTIONS = 0.06  # the same of a sheet, which was measured in perspective
SHEET_EDGE = 0.012  # of its sides: what lies nearer to its edge is shade and torn fibres
PAPER_SIGMA = 6.0  # px, of the paper that is laid where the sheet ends
MAX_FINER = 3  # times the view's pixels that are made and averaged, where the file has more


@dataclass(frozen=True)
class Placing:
    """One way to lay a file on a view.

    Parameters
    ----------
    name : for the user
    map : from pixels of `Scan.rgba` to the view's
    sheet : (4, 2), the sheet's corners in the scan, beyond which is no paper; None: all is paper
    """

    name: str
    map: Homography
    sheet: np.ndarray | None = None


def whole_placings(file: Scan, width: int, height: int) -> list[Placing]:
    """Ways to lay a whole file on a view: one where the proportions agree to half a per cent."""
    h, w = file.rgba.shape[:2]
    out = []
    for name in _layouts(file.width / file.height, width, height, SAME_PROPORTIONS):
        (scale_x, scale_y), (x, y) = _scaling(w, h, width, height, name)
        matrix = np.array([[scale_x, 0, x], [0, scale_y, y], [0, 0, 1.0]])
        out.append(Placing(name, Homography(matrix, (width, height))))
    return out


def sheet_placings(sheet: Sheet, width: int, height: int, turns: int = 0) -> list[Placing]:
    """Ways to lay a sheet that lies in a photograph on a view, turned by quarters of a circle."""
    corners = np.roll(sheet.corners, turns, axis=0)
    proportion = 1 / sheet.proportion if turns % 2 else sheet.proportion
    out = []
    for name in _layouts(proportion, width, height, NEAR_PROPORTIONS):
        (scale_x, scale_y), (x, y) = _scaling(proportion, 1.0, width, height, name)
        x1, y1 = x + scale_x * proportion, y + scale_y
        target = np.array([[x, y], [x1, y], [x1, y1], [x, y1]])
        out.append(
            Placing(name, Homography.of_points(corners, target, (width, height)), sheet.corners)
        )
    return out


def _layouts(proportion: float, width: int, height: int, same: float) -> tuple[str, ...]:
    if abs(np.log(proportion * height / width)) < same:
        return ("scaled",)
    return ("fitted", "cropped", "stretched")


def _scaling(
    w: float, h: float, width: int, height: int, layout: str
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Factors and shift that lay w x h on a view: about its centre, where they are alike."""
    scale = width / w, height / h
    if layout in ("fitted", "cropped"):
        scale = ((min if layout == "fitted" else max)(scale),) * 2
    return scale, (0.5 * (width - scale[0] * w), 0.5 * (height - scale[1] * h))


def lay(file: Scan, placing: Placing) -> np.ndarray:
    """Resample a file's pixels onto the view: (height, width, 4) straight RGBA in [0, 1].

    This is done premultiplied, so that clear pixels bleed no colour. Beyond the file and the sheet
    lies the paper that is nearest.
    """
    width, height = (round(side) for side in placing.map.size)
    h, w = file.rgba.shape[:2]
    matrix = placing.map.matrix
    if (w, h) == (width, height) and np.allclose(matrix, np.eye(3), atol=1e-9):
        return file.rgba
    clear = bool(file.rgba[..., 3].min() < 1.0)
    rgba = _premultiplied(file.rgba) if clear else file.rgba
    planes = [rgba[..., k] for k in range(4 if clear else 3)]
    upright = np.allclose(matrix[[0, 1, 2, 2], [1, 0, 0, 1]], 0.0, atol=1e-12)
    if upright and placing.sheet is None:
        laid = _scaled(planes, placing.map)
    else:
        laid = _warped(planes, placing.map)
    out = np.ones((height, width, 4), np.float32)
    out[..., : len(planes)] = laid.clip(0, 1)
    if placing.sheet is not None:
        out = _within(out, placing.map(placing.sheet))
    return _straight(out) if clear else out


def _scaled(planes: list[np.ndarray], to_view: Homography) -> np.ndarray:
    """Resample planes (h, w) by a map that scales and shifts alone: (height, width, K)."""
    width, height = (round(side) for side in to_view.size)
    h, w = planes[0].shape
    corners = np.array([[0.0, 0.0], [w, h]])
    first, last = np.rint(to_view(corners)).astype(int)
    first, last = np.maximum(first, 0), np.minimum(last, [width, height])
    (x0, y0), (x1, y1) = to_view.back(np.stack([first, last]).astype(float))
    box = max(x0, 0.0), max(y0, 0.0), min(x1, float(w)), min(y1, float(h))
    size = (int(last[0] - first[0]), int(last[1] - first[1]))
    inner = np.stack([_resized(plane, size, box) for plane in planes], axis=-1)
    if size == (width, height):
        return inner
    edge = np.median(np.concatenate([inner[0], inner[-1], inner[:, 0], inner[:, -1]]), axis=0)
    full = np.broadcast_to(edge, (height, width, len(planes))).copy()
    full[first[1] : last[1], first[0] : last[0]] = inner
    return full


def _warped(planes: list[np.ndarray], to_view: Homography) -> np.ndarray:
    """Resample planes (h, w) by any map: (height, width, K)."""
    width, height = (round(side) for side in to_view.size)
    back = Homography(np.linalg.inv(to_view.matrix), to_view.size)
    finer = int(np.clip(round(back.scale), 1, MAX_FINER))
    stack = np.stack([np.pad(plane, 1, mode="edge") for plane in planes], axis=-1)
    fine = Homography(
        np.diag([finer, finer, 1.0])
        @ to_view.matrix
        @ np.array([[1, 0, -1], [0, 1, -1], [0, 0, 1]]),
        (width * finer, height * finer),
    ).warp(stack)
    if finer == 1:
        return fine
    box = (0.0, 0.0, float(width * finer), float(height * finer))
    return np.stack(
        [_resized(plane, (width, height), box) for plane in np.moveaxis(fine, -1, 0)], -1
    )


def _resized(
    plane: np.ndarray, size: tuple[int, int], box: tuple[float, float, float, float]
) -> np.ndarray:
    image = Image.fromarray(np.ascontiguousarray(plane, np.float32))
    return np.asarray(image.resize(size, Image.Resampling.LANCZOS, box=box))


def _within(image: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """An image (H, W, K) with the paper of a sheet, of these corners (4, 2), gone on beyond it."""
    y, x = np.mgrid[: image.shape[0], : image.shape[1]] + 0.5
    inside = np.ones(image.shape[:2], bool)
    edge = SHEET_EDGE * np.sqrt(np.ptp(corners, axis=0).prod())
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (b - a) / np.linalg.norm(b - a)
        inside &= along[0] * (y - a[1]) - along[1] * (x - a[0]) > edge
    if inside.all() or not inside.any():
        return image
    weight = ndimage.gaussian_filter(inside.astype(np.float32), PAPER_SIGMA)
    nearest = ndimage.distance_transform_edt(~inside, return_distances=False, return_indices=True)
    out = image.copy()
    for k in range(image.shape[2]):
        paper = ndimage.gaussian_filter(image[..., k] * inside, PAPER_SIGMA) / np.maximum(
            weight, 1e-6
        )
        out[..., k] = np.where(inside, image[..., k], paper[tuple(nearest)])
    return out


def _premultiplied(rgba: np.ndarray) -> np.ndarray:
    return np.concatenate([rgba[..., :3] * rgba[..., 3:], rgba[..., 3:]], axis=-1)


def _straight(premultiplied: np.ndarray) -> np.ndarray:
    alpha = premultiplied[..., 3:]
    rgb = np.where(alpha > 1e-3, premultiplied[..., :3] / np.maximum(alpha, 1e-3), 1.0).clip(0, 1)
    return np.concatenate([rgb, alpha], axis=-1).astype(np.float32)
