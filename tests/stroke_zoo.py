"""Strokes that go wrong where anything can: the zoo that outlines, ribbons and rasters are tested
on."""

import numpy as np

from strokestyle.drawing.strokes import Strokes, Texture
from strokestyle.geometry.curves import KINDS

CONTOUR, VALLEY = KINDS.index("contour"), KINDS.index("valley")


def stroke(xy, thickness, closed=False, kind=CONTOUR):
    xy = np.asarray(xy, float)
    thickness = np.broadcast_to(np.asarray(thickness, float), (len(xy),))
    return Strokes(xy, thickness, [0, len(xy)], [kind], [closed])


def together(*parts):
    return Strokes(
        np.concatenate([p.xy for p in parts]),
        np.concatenate([p.thickness for p in parts]),
        np.cumsum([0] + [len(p.xy) for p in parts]),
        np.concatenate([p.kind for p in parts]),
        np.concatenate([p.closed for p in parts]),
    )


def zoo():
    t = np.linspace(0, 1, 40)
    ring = np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)], axis=1)
    ring[-1] = ring[0]
    rng = np.random.default_rng(0)
    wobble = np.stack([20 + 100 * t, 60 + 3 * rng.standard_normal(40)], axis=1)
    there_and_back = np.concatenate(
        [np.stack([20 + 80 * t, 40 + 0 * t], 1), np.stack([100 - 80 * t, 46 + 0 * t], 1)]
    )
    eight = np.stack([70 + 50 * np.sin(2 * np.pi * t), 70 + 40 * np.sin(4 * np.pi * t)], axis=1)
    eight[-1] = eight[0]
    return {
        "tapered line": stroke(
            np.stack([20 + 100 * t, 30 + 20 * t], 1), 10 * np.abs(np.sin(np.pi * t))
        ),
        "sharp bend": stroke([[20, 20], [100, 20], [40, 90]], 14),
        "narrow hairpin": stroke(there_and_back, 14),
        "exact hairpin": stroke([[20, 40], [100, 40], [20, 40]], [4, 10, 14]),
        "closed": stroke(60 + 40 * ring, 6 + 4 * ring[:, 0], True),
        "closed, tighter than wide": stroke(60 + 5 * ring, 16, True),
        "half circle, tighter than wide": stroke(60 + 5 * ring[:25], 16),
        "eight": stroke(eight, 8, True),
        "pigtails": stroke(
            np.stack(
                [20 + 100 * t + 30 * np.sin(4 * np.pi * t), 60 + 30 * np.cos(4 * np.pi * t)], 1
            ),
            9,
        ),
        "nervous": stroke(wobble, 12),
        "nervous and uneven": stroke(wobble, 12 * rng.random(40)),
        "coincident points": stroke([[20, 20], [20, 20], [60, 30], [60, 30]], [3, 8, 2, 2]),
        "one point": stroke([[20, 20], [20, 20], [20, 20]], [3, 8, 2]),
        "tapered to nothing": stroke([[20, 20], [60, 30], [100, 20]], [0, 12, 0]),
        "one disc in another": stroke([[20, 40], [25, 40], [60, 45]], [30, 4, 20]),
        "spiral": stroke(
            np.stack([70 + 50 * t * np.cos(14 * t), 70 + 50 * t * np.sin(14 * t)], 1), 3 + 10 * t
        ),
        "a hair": stroke(wobble, 0.02),
        "hairpin tapered to nothing": stroke(
            there_and_back, 12 * np.abs(np.sin(np.pi * np.linspace(0, 1, 80)))
        ),
        "closed and self-crossing": stroke(
            np.concatenate([eight, eight[1:] + [4, 3], eight[:1]]), 7, True
        ),
        "zigzag": stroke(np.stack([20 + 100 * t, 60 + 8.0 * (np.arange(40) % 2)], 1), 10),
    }


def uv_texture(line, margin=3.0, rows=64, columns=16):
    """Red = u, green = v, opaque."""
    u = (np.arange(rows) + 0.5) / rows
    v = (np.arange(columns) + 0.5) / columns
    strip = np.zeros((rows, columns, 4), np.uint8)
    strip[..., 0], strip[..., 1], strip[..., 3] = 255 * u[:, None], 255 * v, 255
    count = len(line)
    return Texture(np.concatenate([strip] * count), np.arange(count + 1) * rows, margin)
