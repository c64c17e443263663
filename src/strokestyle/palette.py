"""Rasters of few colours: a palette for an image, and the PNG that holds it."""

from __future__ import annotations

import struct
import zlib

import numpy as np

ONE_INK = 0.02  # colours that differ less than this (rms, of 1) are one ink: its PNG needs alphas only
GRAIN = 0.12  # of the opacity, per texel: what changes more is grain
GRAIN_ALPHAS, SOFT_ALPHAS, COLORS = 10, 64, 64  # palette sizes of a stroke's PNG


def palette_png(layer: np.ndarray) -> bytes:
    """Premultiplied RGBA (h, w, 4) in [0, 1] -> PNG with a palette: one ink at some alphas, or 64 colours with alpha.

    Grain hides coarse steps of alpha and costs many bytes, soft tone shows them and costs few.
    """
    flat = layer.reshape(-1, 4)
    alpha = flat[:, 3]
    ink = flat[:, :3].sum(axis=0) / alpha.sum()
    spread = np.square(flat[:, :3] - alpha[:, None] * ink).sum() / max(np.square(alpha).sum(), 1e-9)
    if np.sqrt(spread) < ONE_INK:
        grain = np.abs(np.diff(layer[..., 3], axis=1)).sum() / alpha.sum()
        count = GRAIN_ALPHAS if grain > GRAIN else SOFT_ALPHAS
        index = np.rint(alpha * (count - 1)).astype(np.uint8)
        palette = np.concatenate([np.tile(ink, (count, 1)), np.arange(count)[:, None] / (count - 1)], axis=1)
    else:
        index, palette = quantise(flat, COLORS)
    palette = np.rint(np.clip(palette, 0, 1) * 255).astype(np.uint8)
    return encode_png(index.reshape(layer.shape[:2]), palette)


def encode_png(index: np.ndarray, palette: np.ndarray) -> bytes:
    """Palette indices (h, w) uint8 and straight RGBA colours (n, 4) uint8 -> PNG.

    Unfiltered, run lengths only, 4 bits where they do: smaller for grain than what pillow writes, and ten times faster.
    """
    height, width = index.shape
    bits = 4 if len(palette) <= 16 else 8
    if bits == 4:
        even = np.pad(index, ((0, 0), (0, width % 2)))
        index = (even[:, ::2] << 4) | even[:, 1::2]
    lines = np.concatenate([np.zeros((height, 1), np.uint8), index], axis=1)
    packer = zlib.compressobj(9, zlib.DEFLATED, 15, 9, zlib.Z_RLE)
    data = packer.compress(lines.tobytes()) + packer.flush()

    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    header = struct.pack(">IIBBBBB", width, height, bits, 3, 0, 0, 0)
    parts = [(b"IHDR", header), (b"PLTE", palette[:, :3].tobytes()), (b"tRNS", palette[:, 3].tobytes())]
    parts += [(b"IDAT", data), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


def quantise(flat, count):
    """At most `count` straight RGBA colours for premultiplied pixels (M, 4), and each pixel's: weighted k-means."""
    grid = np.rint(flat * 63).astype(np.int64)
    code = ((grid[:, 0] * 64 + grid[:, 1]) * 64 + grid[:, 2]) * 64 + grid[:, 3]
    cell, where, weight = np.unique(code, return_inverse=True, return_counts=True)
    where = where.ravel()
    sums = np.stack([np.bincount(where, flat[:, k]) for k in range(4)], axis=1)
    colors = sums / weight[:, None]
    clear = colors[:, 3] < 1 / 255
    weight = np.where(clear, 0, weight).astype(np.float64)
    if not weight.any():  # a breath of ink, less than a level of alpha everywhere
        return np.zeros(len(flat), np.uint8), np.zeros((1, 4))
    # the first centres: evenly spread over the cells, along the axis on which they differ most
    mean = (weight[:, None] * colors).sum(axis=0) / weight.sum()
    spread = (colors - mean) * np.sqrt(weight)[:, None]
    axis = np.linalg.eigh(spread.T @ spread)[1][:, -1]
    order = np.argsort(colors @ axis, kind="stable")
    heap = np.cumsum(np.sqrt(weight[order]))
    first = np.searchsorted(heap, (np.arange(count - 1) + 0.5) / (count - 1) * heap[-1])
    centres = np.concatenate([np.zeros((1, 4)), np.unique(colors[order[np.minimum(first, len(order) - 1)]], axis=0)])
    for _ in range(6):
        near = np.square(colors[:, None] - centres[None]).sum(axis=2).argmin(axis=1)
        total = np.bincount(near, weight, len(centres))
        moved = np.stack([np.bincount(near, weight * colors[:, k], len(centres)) for k in range(4)], axis=1)
        centres = np.where(total[:, None] > 0, moved / np.maximum(total, 1e-9)[:, None], centres)
    near = np.square(colors[:, None] - centres[None]).sum(axis=2).argmin(axis=1)
    straight = np.concatenate([centres[:, :3] / np.maximum(centres[:, 3:], 1e-6), centres[:, 3:]], axis=1)
    return near[where].astype(np.uint8), straight
