"""An A4 drawing at 600 dpi, as every kind of file: time and memory to read it. Prints a table.

    python benchmarks/drawing_files.py

Seconds are of one processor, from the file to `read_image`'s pixels and to the end of
`load_exemplar`; MB is the most that the whole process had resident. Each file is read in a process
of its own. A star marks what misses its target: 3 s and 700 MB.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SIZE, VIEW = (4960, 7016), (768, 768)
SECONDS, MEGABYTES = 3.0, 700.0
KINDS = {
    "L": ["png", "tif", "lzw.tif", "jpg"],
    "RGB": ["png", "tif", "lzw.tif", "jpg"],
    "RGBA": ["png", "tif", "lzw.tif"],
    "I;16": ["png", "tif"],
}


def rings():
    """Points (n, 2) of three closed curves on the view."""
    t = np.linspace(0, 2 * np.pi, 400)
    return [
        np.stack([384 + r * np.cos(t + p) * (1 + 0.2 * np.sin(3 * t)), 384 + r * np.sin(t)], axis=1)
        for r, p in ((300, 0), (200, 0.3), (120, 0.5))
    ]


def draw(folder):
    """Write the drawing in every kind; yields their paths."""
    from PIL import Image, ImageDraw

    ink = Image.new("L", SIZE, 0)
    scale = SIZE[0] / VIEW[0]
    for ring in rings():
        points = ring * scale + [0, (SIZE[1] - SIZE[0]) / 2]
        ImageDraw.Draw(ink).line([tuple(p) for p in points], fill=220, width=40, joint="curve")
    grain = np.random.default_rng(0).integers(-2, 3, ink.size[::-1], np.int16)
    paper = (np.asarray(ink, np.int16) * -1 + 245 + grain).clip(0, 255).astype(np.uint8)
    grey = Image.fromarray(paper)
    whole = {"L": grey, "RGB": Image.merge("RGB", [grey, grey, grey.point(lambda v: v * 0.9)])}
    whole["RGBA"] = Image.merge("RGBA", [grey.point(lambda v: v // 4)] * 3 + [ink])
    whole["I;16"] = Image.fromarray(paper.astype(np.uint16) * 257)
    for mode, suffixes in KINDS.items():
        for suffix in suffixes:
            path = Path(folder) / f"{mode.replace(';', '')}.{suffix}"
            options = {"compress_level": 3} if suffix == "png" else {}
            options |= {"compression": "tiff_lzw"} if suffix == "lzw.tif" else {}
            whole[mode].save(path, **options)
            yield path


def measure(what, path):
    """Read one file in this process; prints its times and memory as JSON."""
    from strokestyle.fit.exemplar import load_exemplar
    from strokestyle.fit.image_file import read_image

    if what == "read":
        began = time.process_time()
        read_image(path, VIEW)
    else:
        points = np.concatenate(rings())
        began = time.process_time()
        load_exemplar(path, *VIEW, points)
    took = time.process_time() - began
    print(json.dumps([took, peak()]))


def peak():
    """The most that this process had resident, MB; getrusage counts its parent's in."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(one for one in status.read_text().splitlines() if one.startswith("VmHWM"))
        return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def in_a_child(what, path):
    done = subprocess.run(
        [sys.executable, __file__, what, str(path)], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def main():
    print(f"{'file':14}{'MB':>7}{'read, s':>10}{'all, s':>9}{'memory, MB':>12}")
    with tempfile.TemporaryDirectory() as folder:
        for path in draw(folder):
            read, _ = in_a_child("read", path)
            whole, memory = in_a_child("load", path)
            star = "*" if whole > SECONDS or memory > MEGABYTES else ""
            size = path.stat().st_size / 1e6
            print(f"{path.name:14}{size:7.1f}{read:10.2f}{whole:9.2f}{memory:12.0f} {star}")
            path.unlink()


if __name__ == "__main__":
    if len(sys.argv) == 3:
        measure(*sys.argv[1:])
    else:
        main()
