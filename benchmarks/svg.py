"""SVG of 303 strokes of grain on a 768 canvas: size, seconds, and agreement with the direct raster. Prints two tables.

    python benchmarks/svg.py

Error is the mean absolute difference, of 255, between the SVG rendered by resvg and `painting.rasterise`.
"""

import gzip
import io
import time
from dataclasses import replace

import numpy as np
from PIL import Image
from scipy import ndimage

from strokestyle.exemplar import separate
from strokestyle.outlines import outlines
from strokestyle.painting import rasterise
from strokestyle.strokes import Drawing, Strokes
from strokestyle.svg import png_from_svg, write_svg
from strokestyle.texture import learn_texture, synthesise

SIZE, COUNT, POINTS = 768, 303, 62


def strokes(count, seed, thickness=6.0):
    """Smooth open strokes, tapered at both ends, points 3 px apart."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, POINTS)
    taper = np.minimum(1, 4 * np.minimum(t, 1 - t) + 0.1)
    xy, width = [], []
    for _ in range(count):
        heading = rng.uniform(0, 6.3) + np.cumsum(ndimage.gaussian_filter1d(rng.normal(0, 0.25, POINTS), 4))
        line = np.cumsum(3.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        xy.append(line - line.mean(axis=0) + rng.uniform(0.15, 0.85, 2) * SIZE)
        width.append(thickness * taper * rng.uniform(0.5, 1.0))
    offsets = POINTS * np.arange(count + 1)
    return Strokes(np.concatenate(xy), np.concatenate(width), offsets, np.zeros(count), np.zeros(count, bool))


def charcoal(lines, seed):
    """A drawing of the strokes in grainy black on white, as an exemplar."""
    rng = np.random.default_rng(seed)
    flat = rasterise(Drawing(lines, (SIZE, SIZE), np.tile([0.1, 0.1, 0.1, 1.0], (len(lines), 1)))) / 255.0
    tooth = ndimage.gaussian_filter(rng.random((SIZE, SIZE)), 0.8)
    flat[..., 3] *= np.clip(0.5 + 9 * (tooth - 0.5), 0, 1)
    return separate(np.where(flat[..., 3:] > 0, flat, [1, 1, 1, 0]).astype(np.float32), transparent=True)


def rendered(text, scale):
    return np.asarray(Image.open(io.BytesIO(png_from_svg(text, scale))).convert("RGB")).astype(float)


def seconds(call):
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def main():
    few, many = strokes(30, 1), strokes(COUNT, 2, 5.2)
    learning, bank = seconds(lambda: learn_texture(few, few.thickness[:, None], charcoal(few, 3), 0))
    laying, (texture, color) = seconds(lambda: synthesise(bank, many, many.thickness[:, None], 0))
    drawing = Drawing(many, (SIZE, SIZE), color, texture)
    outlining, rings = seconds(lambda: outlines(many))
    print(f"{len(many)} strokes, {len(many.xy)} points, mean thickness {many.thickness.mean():.1f} px")
    print(f"{'stage':34s} {'seconds':>8s}")
    print(f"{'outlines, tolerance 0.1 px':34s} {outlining:8.2f}   {sum(len(r) for s in rings for r in s)} nodes")
    print(f"{'raster, flat':34s} {seconds(lambda: rasterise(drawing, texture=False))[0]:8.2f}")
    print(f"{'raster, textured':34s} {seconds(lambda: rasterise(drawing))[0]:8.2f}")
    print(f"{'texture: learn from 30 strokes':34s} {learning:8.2f}")
    print(f"{'texture: lay along 303':34s} {laying:8.2f}")
    print()
    print(f"{'encoding':22s} {'write s':>8s} {'kB':>6s} {'gz kB':>6s} {'error 1x':>9s} {'4x':>6s} {'resvg 4x s':>11s}")
    kinds = [("none", {"texture": "none"}), ("image", {"texture": "image"})]
    kinds += [("image, 1 px a px", {"texture": "image", "texture_res": 1.0})]
    for name, options in kinds:
        drawn = replace(drawing, texture=None) if name == "none" else drawing
        writing, text = seconds(lambda drawn=drawn, options=options: write_svg(drawn, **options))
        error = [np.abs(rendered(text, k) - rasterise(drawn, k, (1, 1, 1))).mean() for k in (1.0, 4.0)]
        opening, _ = seconds(lambda text=text: png_from_svg(text, 4.0))
        size, packed = len(text) / 1000, len(gzip.compress(text.encode(), 9)) / 1000
        print(f"{name:22s} {writing:8.2f} {size:6.0f} {packed:6.0f} {error[0]:9.2f} {error[1]:6.2f} {opening:11.2f}")


if __name__ == "__main__":
    main()
