"""A small drawing of our own, and what other programs make of its file.

    python tests/svg_programs.py

writes tests/golden/svg anew, with the programs that are installed: Inkscape, scour and svgo. Those
called format2 and format3 stay: version 2 of the format had every stroke's texture in an attribute,
version 3 all data on a stroke's group."""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.curves import KINDS
from strokestyle.geometry.parts import Parts, part_name
from strokestyle.svg.write import write_svg

GOLDEN = Path(__file__).parent / "golden" / "svg"
KIND = ("contour", "valley", "contour", "crease", "suggestive")
# valley is s000, the closed suggestive stroke s001, the crease s002, the contours s003 and s004
BY_HAND = (
    "select-by-id:s000;transform-translate:7,-3;select-clear;select-by-id:s001;"
    "transform-rotate:30;select-clear;"
    "select-by-id:s002;duplicate;transform-translate:0,15;select-clear;select-by-id:s003;"
    "delete;select-clear;"
    "select-by-id:s004;transform-scale:1.5;select-clear;select-by-id:layer-valley;"
    "transform-translate:1,2;select-clear;"
    "select-by-id:s001;selection-group;export-filename:{};export-do"
)
# layers are no groups to it: each stroke's shapes lie in its layer
UNGROUP = (
    "select-all:no-layers;selection-ungroup;select-clear;select-by-id:layer-valley;"
    "transform-translate:1,2;export-filename:{};export-do"
)
SAVES = {
    "inkscape": "inkscape {0} --export-type=svg --export-filename={1}",
    "inkscape-plain": "inkscape {0} --export-plain-svg --export-type=svg --export-filename={1}",
    "scour": "scour -q --enable-viewboxing --enable-id-stripping --shorten-ids --indent=none "
    "-i {0} -o {1}",
    "svgo": "svgo {0} -o {1}",
}


def small(texture: str | None) -> Drawing:
    """Five strokes on 120 x 100, one of them closed; texture None, "grain" or "colours"."""
    t, rng = np.linspace(0, 1, 12), np.random.default_rng(5)
    lines, widths = [], []
    for k in range(4):
        lines.append(np.stack([10 + 90 * t, 15 + 18 * k + 6 * np.sin(5 * t + k)], axis=1))
        widths.append(1 + 4 * np.sin(np.pi * t))
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.stack([80 + 14 * np.cos(angle), 45 + 10 * np.sin(angle)], axis=1)
    ring[-1] = ring[0]
    lines.append(ring)
    widths.append(2 + np.cos(angle))
    offsets = np.cumsum([0] + [len(line) for line in lines])
    kind = [KINDS.index(name) for name in KIND]
    strokes = Strokes(
        np.concatenate(lines), np.concatenate(widths), offsets, kind, [False] * 4 + [True]
    )
    color = np.tile([26 / 255, 40 / 255, 77 / 255, 0.8], (5, 1))
    if texture is None:
        return Drawing(strokes, (120, 100), color)
    rgba = np.zeros((300, 10, 4), np.uint8)
    rgba[..., :3] = [26, 40, 77]
    rgba[..., 3] = rng.integers(0, 256, (60, 5)).repeat(5, axis=0).repeat(2, axis=1)
    rgba[:, [0, -1], 3] = 0
    if texture == "colours":
        rgba[..., 0] = np.tile(np.linspace(0, 255, 60), 5)[:, None]
    return Drawing(strokes, (120, 100), color, Texture(rgba, 60 * np.arange(6), 1.5))


NAMES = tuple(
    part_name(name)
    for name in ("\"><script>&amp;'", "Räder, \u65e5\u672c \U0001f58c", "left ridge", 500 * "x")
)


def with_parts(drawing: Drawing) -> Drawing:
    """The strokes of `small` in four parts with names of all sorts, and one stroke in none."""
    return replace(drawing, parts=Parts(NAMES, [3, 0, 1, -1, 2]))


def run(command: str, source: Path, target: Path) -> bool:
    """Whether the program did it."""
    words = command.format(source, target).split()
    if not shutil.which(words[0]):
        return False
    done = subprocess.run(words, capture_output=True, timeout=120)
    return done.returncode == 0 and target.exists()


def by_hand(source: Path, target: Path, what: str = BY_HAND) -> bool:
    """What a hand does in Inkscape: strokes moved, turned, scaled, doubled, deleted, grouped; a
    layer moved. Or UNGROUP."""
    if not shutil.which("inkscape"):
        return False
    command = ["inkscape", str(source), f"--actions={what.format(target)}"]
    return (
        subprocess.run(command, capture_output=True, timeout=120).returncode == 0
        and target.exists()
    )


def main():
    GOLDEN.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or ("none", "vector", "image", "parts"):
        source, texture = GOLDEN / f"{name}.svg", "none" if name == "parts" else name
        drawing = small(None if texture == "none" else "grain")
        drawing = with_parts(drawing) if name == "parts" else drawing
        words = {"title": "Small & plain", "author": "Ann", "license": "CC-BY-4.0"}
        source.write_text(write_svg(drawing, texture=texture, **words), encoding="utf-8")
        for program, command in SAVES.items():
            print(name, program, run(command, source, GOLDEN / f"{name}-{program}.svg"))
        print(name, "by hand", by_hand(source, GOLDEN / f"{name}-moved.svg"))
        run(SAVES["svgo"], GOLDEN / f"{name}-moved.svg", GOLDEN / f"{name}-moved-svgo.svg")
        if texture != "none":
            print(name, "ungrouped", by_hand(source, GOLDEN / f"{name}-ungrouped.svg", UNGROUP))


if __name__ == "__main__":
    main()
