"""Small drawings of wavy strokes, and the picture of an SVG."""

import io

import numpy as np
from PIL import Image

from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.curves import KINDS
from strokestyle.svg.write import png_from_svg


def drawing(count=12, texture=None, seed=0):
    """Wavy tapered strokes of three kinds on 160 x 120; texture None, "grain" (one ink) or
    "colours"."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 24)
    xy, width, rows = [], [], []
    for _ in range(count):
        begin, end = rng.uniform(15, 105, (2, 2))
        line = begin + t[:, None] * (end - begin) * [1.3, 1]
        line += rng.uniform(2, 6) * np.sin(6 * t + rng.uniform(0, 6))[:, None] * [0.3, 1]
        xy.append(line)
        width.append(rng.uniform(2, 9) * np.sin(np.pi * np.clip(t, 0.02, 0.98)) ** 0.5)
        n = 2 * int(np.hypot(*np.diff(line, axis=0).T).sum() + 10)
        strip = (
            rng.random((n, 20, 4))
            if texture == "colours"
            else np.tile([0.1, 0.1, 0.3, 1.0], (n, 20, 1))
        )
        noise = rng.random((n // 6 + 1, 5)).repeat(6, 0)[:n].repeat(4, 1)
        strip[..., 3] = noise * (np.abs((2 * np.arange(20) + 1) / 20 - 1) < 0.7)
        if texture == "colours":
            strip[..., :3] = (
                strip[:1, :1, :3] * 0.5 + 0.5 * t[np.arange(n) * 23 // n][:, None, None]
            )
        rows.append(np.rint(255 * strip).astype(np.uint8))
    offsets = 24 * np.arange(count + 1)
    kind = rng.choice([KINDS.index(k) for k in ("contour", "valley", "crease")], count)
    strokes = Strokes(
        np.concatenate(xy), np.concatenate(width), offsets, kind, np.zeros(count, bool)
    )
    color = np.concatenate([rng.random((count, 3)), rng.uniform(0.4, 1, (count, 1))], axis=1)
    strips = (
        Texture(np.concatenate(rows), np.cumsum([0] + [len(r) for r in rows]), 2.0)
        if texture
        else None
    )
    return Drawing(strokes, (160, 120), color, strips)


def strokes_of(*lines, thickness=8.0):
    """Straight strokes through points, evenly wide."""
    fine = [
        np.stack([np.linspace(a, b, 30) for a, b in zip(line[0], line[-1], strict=True)], axis=1)
        for line in lines
    ]
    count = len(fine)
    return Strokes(
        np.concatenate(fine),
        np.full(30 * count, thickness),
        30 * np.arange(count + 1),
        np.zeros(count),
        np.zeros(count, bool),
    )


def rendered(text, scale=1.0):
    return np.asarray(Image.open(io.BytesIO(png_from_svg(text, scale))).convert("RGB")).astype(
        float
    )
