"""SVG of 303 strokes in three styles, in every encoding: size, seconds, and agreement with the
direct raster.

    python benchmarks/svg.py [--dense] [--renderers resvg,chromium,rsvg-convert,inkscape] [--scales
    1,4]
                             [--styles grain,soft,coloured] [DRAWING.svg ...]

Drawings that `render` wrote take the styles' place: they are read, and written in every encoding.
Error is the mean absolute difference, of 255, between the SVG as a program renders it and
`painting.rasterise`. Strokes of the styles are 30 to 183 px long; with --dense all are 183 px
(18.8k points), and cover three times as much of the page as drawings of shapes do. Programs that
are not installed are left out, and named."""

import argparse
import gzip
import io
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from strokestyle.drawing.outline import outlines
from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.fit.exemplar import separate
from strokestyle.fit.texture import learn_texture
from strokestyle.render.quilt import synthesise
from strokestyle.svg.format import SvgOptions
from strokestyle.svg.ink import inks
from strokestyle.svg.read import read_svg
from strokestyle.svg.write import png_from_svg, resolve_texture, write_svg

SIZE, COUNT, POINTS = 768, 303, 62
STYLES = ("grain", "soft", "coloured")
TARGETS = {"none": (2.0, None), "vector": (2.0, 750), "image": (1.5, 900)}  # error, kB
WRITE, OPEN = 1.5, 3.0  # seconds


def strokes(count, seed, thickness=6.0, shortest=POINTS):
    """Smooth open strokes, tapered at both ends, points 3 px apart."""
    rng = np.random.default_rng(seed)
    xy, width, offsets = [], [], [0]
    for _ in range(count):
        n = int(rng.integers(shortest, POINTS + 1))
        t = np.linspace(0, 1, n)
        heading = rng.uniform(0, 6.3) + np.cumsum(
            ndimage.gaussian_filter1d(rng.normal(0, 0.25, n), 4)
        )
        line = np.cumsum(3.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        xy.append(line - line.mean(axis=0) + rng.uniform(0.15, 0.85, 2) * SIZE)
        width.append(
            thickness * np.minimum(1, 4 * np.minimum(t, 1 - t) + 0.1) * rng.uniform(0.5, 1.0)
        )
        offsets.append(offsets[-1] + n)
    return Strokes(
        np.concatenate(xy), np.concatenate(width), offsets, np.zeros(count), np.zeros(count, bool)
    )


def exemplar(style, lines, seed):
    """A drawing of the strokes on white: charcoal, a wash with soft edges, or chalk of changing
    hue."""
    rng = np.random.default_rng(seed)
    ink = {"grain": [0.1, 0.1, 0.1], "soft": [0.2, 0.35, 0.55], "coloured": [0.6, 0.2, 0.1]}[style]
    flat = rasterise(Drawing(lines, (SIZE, SIZE), np.tile([*ink, 1.0], (len(lines), 1)))) / 255.0

    def noise(sigma):
        field = ndimage.gaussian_filter(rng.random((SIZE, SIZE)), sigma)
        return (field - field.mean()) / field.std()

    if style == "soft":
        flat[..., 3] = ndimage.gaussian_filter(flat[..., 3], 1.0) * np.clip(
            0.6 + 0.12 * noise(6.0), 0, 1
        )
        flat[..., :3] = ink
    else:
        flat[..., 3] *= np.clip(0.5 + 0.6 * noise(1.2), 0, 1)
    if style == "coloured":
        flat[..., :3] = np.clip(
            flat[..., :3] + 0.12 * np.stack([noise(8.0), noise(9.0), noise(10.0)], axis=-1), 0, 1
        )
    return separate(
        np.where(flat[..., 3:] > 0, flat, [1, 1, 1, 0]).astype(np.float32), transparent=True
    )


def drawing(style, shortest):
    few, many = strokes(30, 1), strokes(COUNT, 2, 5.2, shortest)
    bank = learn_texture(few, few.thickness[:, None], exemplar(style, few, 3), 0)
    texture, color = synthesise(bank, many, many.thickness[:, None], 0)
    return Drawing(many, (SIZE, SIZE), color, texture)


# ------------------------------------------------------------------------------------- the programs


def by_program(command):
    def render(text, scale, size):
        with tempfile.TemporaryDirectory() as folder:
            source, target = Path(folder) / "a.svg", Path(folder) / "a.png"
            source.write_text(text)
            names = {
                "source": source,
                "target": target,
                "scale": scale,
                "side": round(size[0] * scale),
            }
            words = [word.format(**names, width=size[0], height=size[1]) for word in command]
            subprocess.run(words, capture_output=True, timeout=300, check=False, cwd=folder)
            return target.read_bytes()

    return render


RENDERERS = {
    "resvg": lambda text, scale, size: png_from_svg(text, scale),
    "chromium": by_program(
        [
            "chromium",
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--screenshot={target}",
        ]
        + [
            "--window-size={width},{height}",
            "--force-device-scale-factor={scale}",
            "file://{source}",
        ]
    ),
    "rsvg-convert": by_program(
        ["rsvg-convert", "-w", "{side}", "-b", "white", "-o", "{target}", "{source}"]
    ),
    "inkscape": by_program(
        ["inkscape", "{source}", "-o", "{target}", "-w", "{side}", "-b", "white", "-y", "1"]
    ),
}


def seconds(call):
    """Of this process and its children: (processor seconds, what it gives)."""
    before, result = sum(Timing.now()), call()
    return sum(Timing.now()) - before, result


class Timing:
    @staticmethod
    def now():
        import resource

        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN):
            usage = resource.getrusage(who)
            yield usage.ru_utime + usage.ru_stime


def judged(value, target):
    return f"{value:.2f}" + ("" if target is None or value <= target else "!")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("drawings", nargs="*")
    parser.add_argument("--dense", action="store_true")
    parser.add_argument("--renderers", default=",".join(RENDERERS))
    parser.add_argument("--scales", default="1,4")
    parser.add_argument("--styles", default=",".join(STYLES))
    given = parser.parse_args()
    programs = [
        name for name in given.renderers.split(",") if name == "resvg" or shutil.which(name)
    ]
    for name in set(given.renderers.split(",")) - set(programs):
        print(f"{name} is not installed: left out")
    scales = [float(scale) for scale in given.scales.split(",")]
    print(
        "processor seconds; ! misses its target: write 1.5 s, open at 4x 3 s, 750 kB and "
        "error 2 for vector, 900 kB"
    )
    print("and 1.5 for image")
    heads = "".join(
        f" {f'{name} {scale:g}x: error, s':>26s}" for name in programs for scale in scales
    )
    print(f"{'style':9s} {'encoding':14s} {'write':>6s} {'kB':>6s} {'gz':>5s}{heads}")
    for style in given.drawings or given.styles.split(","):
        if given.drawings:
            made, style = read_svg(style), Path(style).stem[-9:]
        else:
            made = drawing(style, POINTS if given.dense else 10)
        chosen = resolve_texture(made, SvgOptions()).texture
        wanted = {scale: rasterise(made, scale, (1, 1, 1)).astype(float) for scale in scales}
        flat = {
            scale: rasterise(made, scale, (1, 1, 1), texture=False).astype(float)
            for scale in scales
        }
        cases = [
            ("none", {}),
            ("vector", {"tones": 1}),
            ("vector", {"tones": 2}),
            ("vector", {}),
            ("image", {}),
        ]
        cases += [("image", {"texture_res": 2.0})]
        for texture, options in cases:
            took, text = seconds(
                lambda made=made, o=options, t=texture: write_svg(made, texture=t, **o)
            )
            most, size = TARGETS[texture]
            kb, packed = len(text) / 1000, len(gzip.compress(text.encode(), 9)) / 1000
            name = texture + "".join(f" {k.split('_')[-1]} {v:g}" for k, v in options.items())
            name += " *" if texture == chosen and not options else ""
            much = "!" if size and kb > size else " "
            line = f"{style:9s} {name:14s} {judged(took, WRITE):>6s} {kb:5.0f}{much} {packed:5.0f}"
            for program in programs:
                for scale in scales:
                    cost, png = seconds(
                        lambda p=program, s=scale, t=text, d=made: RENDERERS[p](t, s, d.size)
                    )
                    seen = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(float)
                    off = np.abs(seen - (flat if texture == "none" else wanted)[scale]).mean()
                    line += f" {judged(off, most) + ', ' + judged(cost, OPEN):>26s}"
            print(line, flush=True)
        look, took = inks(made.texture), seconds(lambda made=made: outlines(made.strokes))[0]
        print(
            f"{'':9s} darkness {255 - wanted[scales[0]].mean():.1f}; grain "
            f"{look.grain.mean():.2f}; * taken by auto;"
        )
        print(
            f"{'':9s} {len(made.strokes)} strokes, {len(made.strokes.xy)} points; outlines "
            f"alone {took:.2f} s"
        )


if __name__ == "__main__":
    main()
