"""Marks: whether the marks of two sets of drawings are of one kind (width, edge, grain, colour),
wherever they lie.

It is the Frechet distance of AlexNet's first three layers at cells that hold ink, pooled over the
drawings of a style, each feature in units of its spread, over their number. Cells are 16 px of a
drawing at 768 px, to which drawings are brought."""

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image

from metrics.frechet import frechet_distance
from metrics.lpips import Lpips

SIDE = 768  # px, the longer side at which drawings are looked at
INK = 0.15  # the least of 1 - min(R, G, B), somewhere in a cell


def marks_of(net: Lpips, image: np.ndarray) -> np.ndarray:
    """Look at the cells of a drawing (H, W, 3) in [0, 1] that hold ink: (N, 640) float32.

    net : of "alexnet"
    """
    image = enlarged(image)
    layers = net.features(image)[:3]
    size = layers[2].shape[2:]
    cells = torch.cat([F.adaptive_avg_pool2d(layer, size)[0] for layer in layers])
    ink = torch.as_tensor(1 - image.min(2), dtype=torch.float32, device=net.device)
    held = F.adaptive_max_pool2d(ink[None, None], size)[0, 0] > INK
    return cells[:, held].T.cpu().numpy()


def marks_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Measure how far the marks (N, 640) of two sets of drawings are apart; 0 at best.

    nan where either has fewer than two cells with ink."""
    if min(len(a), len(b)) < 2:
        return float("nan")
    a, b = a.astype(np.float64), b.astype(np.float64)
    spread = np.concatenate([a, b]).std(0) + 1e-6
    return frechet_distance(a / spread, b / spread) / a.shape[1]


def enlarged(image: np.ndarray) -> np.ndarray:
    """Bring a drawing (H, W, 3) in [0, 1] to 768 px, its longer side, by Lanczos' filter."""
    height, width = image.shape[:2]
    k = SIDE / max(height, width)
    if k == 1:
        return image
    pixels = Image.fromarray((255 * image).round().astype(np.uint8))
    size = round(k * width), round(k * height)
    return np.asarray(pixels.resize(size, Image.Resampling.LANCZOS), np.float32) / 255
