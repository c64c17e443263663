"""Make drawings in ten further styles of the simulated artist, to try what no style was tuned to.

    python experiments/new_styles.py SHARED OUT [--styles a,b]

SHARED (or STROKESTYLE_SHARED) holds artist/artist.py and shapes/<shape>/curves.json. OUT gets
styles/<style>/<shape>/{drawing.png,take2.png,truth.json} and shapes, a link to those of SHARED:
`score_styles.py OUT PREDICTIONS` and `SHARED/tools/score.py PREDICTIONS --styles OUT/styles` take
it as they take SHARED. What is there already is not made again."""

import argparse
import json
import os
import sys
from pathlib import Path

SHAPES = ("spot", "bunny", "cow", "fandisk")  # the first is learned from
LINER_RESPONSE = {"radius_logarithmic": {"pressure": [[0, -2.2], [1, 0.0]]}}


def ink(preset, thin, thick, **more):
    """A brush whose width follows the pressure, between two widths in px."""
    return {"preset": preset, "width_px": [thin, thick], **more}


# One line each: what a person would say of the hand. The laws are those of artist.py.
STYLES = {
    # a hard pencil held lightly, hardly darker than the sheet; creases and valleys fainter still
    "faint_pencil": {
        "brush": {"preset": "deevad/2B_pencil", "width_px": 3.5, "speed": 420},
        "plan": {"join_px": 8, "corner_deg": 60, "max_len": 240},
        "pressure": {
            "min": 0.2,
            "max": 0.6,
            "terms": [
                {"law": "kind", "contour": 0.8, "crease": 0.6, "valley": 0.4},
                {"law": "taper", "in": 30, "out": 50, "floor": 0.2},
                {"law": "per_stroke", "mean": 0.85, "sd": 0.1},
            ],
        },
        "displace": [{"law": "smooth", "sigma": 7}],
        "hand": {"drift": 0.8, "wavelength": 100},
        "color": {"law": "constant", "ink": "#55565c", "vary": 0.03},
        "seed": 31,
    },
    # a fineliner that leaves the line and finds it again
    "dashed_liner": {
        "brush": ink("deevad/liner", 0.8, 4.0, speed=320, response=LINER_RESPONSE),
        "plan": {"join_px": 8, "corner_deg": 70},
        "pressure": {
            "max": 1.0,
            "tremor": 0.02,
            "terms": [
                {"law": "lost", "corr": 30, "keep": 0.5},
                {"law": "taper", "in": 12, "out": 20, "floor": 0.2},
            ],
        },
        "displace": [{"law": "smooth", "sigma": 4}],
        "hand": {"drift": 0.5, "wavelength": 120},
        "color": {"law": "constant", "ink": "#1d1d1d"},
        "seed": 32,
    },
    # a broad marker, nearly of one width, each stroke as full as it happens to be
    "fat_marker": {
        "brush": {"preset": "tanda/marker-05", "width_px": 20, "speed": 300},
        "plan": {"join_px": 12, "corner_deg": 65},
        "pressure": {
            "min": 0.6,
            "max": 0.95,
            "terms": [{"law": "per_stroke", "mean": 0.75, "sd": 0.15}],
        },
        "displace": [{"law": "smooth", "sigma": 12}],
        "hand": {"drift": 1.2, "wavelength": 160},
        "color": {"law": "constant", "ink": "#c2401c"},
        "seed": 33,
    },
    # a brush that starts full and runs out, pulled in either direction
    "two_way_brush": {
        "brush": ink("classic/kabura", 1.5, 10, speed=420),
        "plan": {"join_px": 8, "corner_deg": 65, "max_len": 260, "direction": "mixed"},
        "pressure": {
            "max": 0.9,
            "terms": [
                {"law": "taper", "in": 8, "out": 120, "floor": 0.05},
                {"law": "kind", "contour": 1.0, "crease": 0.8, "valley": 0.6},
            ],
        },
        "displace": [{"law": "smooth", "sigma": 6}],
        "hand": {"drift": 0.8, "wavelength": 100},
        "color": {"law": "constant", "ink": "#161216"},
        "seed": 34,
    },
    # a pen with three inkwells: outlines black, edges brown, hollows blue
    "kind_ink": {
        "brush": ink("deevad/soft-dip-pen", 1.2, 5.0, speed=300),
        "plan": {"join_px": 8, "corner_deg": 65},
        "pressure": {
            "max": 0.9,
            "terms": [
                {"law": "depth", "power": 1.0, "floor": 0.3},
                {"law": "taper", "in": 20, "out": 40, "floor": 0.15},
            ],
        },
        "displace": [{"law": "smooth", "sigma": 5}],
        "hand": {"drift": 0.6, "wavelength": 110},
        "color": {
            "law": "kind",
            "default": "#202020",
            "contour": "#141414",
            "crease": "#8a4b20",
            "valley": "#2d5f9a",
        },
        "seed": 35,
    },
    # felt pens of four colours, taken up as they lie
    "palette_felt": {
        "brush": {"preset": "tanda/marker-05", "width_px": 7, "speed": 380},
        "plan": {"join_px": 6, "corner_deg": 60, "max_len": 220},
        "pressure": {
            "min": 0.5,
            "max": 0.9,
            "terms": [
                {"law": "kind", "contour": 1.0, "crease": 0.85, "valley": 0.7},
                {"law": "random_walk", "corr": 60, "amount": 0.5, "floor": 0.4},
            ],
        },
        "displace": [{"law": "smooth", "sigma": 5}, {"law": "bow", "amount": 0.01}],
        "hand": {"drift": 0.6, "wavelength": 110},
        "color": {"law": "palette", "inks": ["#b3282d", "#1d6f8c", "#d08a1e", "#3c3c3c"]},
        "seed": 36,
    },
    # a brush lifted short of where lines meet, heavy below
    "trimmed_brush": {
        "brush": ink("deevad/brush", 1.5, 9, speed=400),
        "plan": {"join_px": 8, "corner_deg": 60, "trim": 12},
        "pressure": {
            "max": 0.8,
            "terms": [
                {"law": "facing", "angle": 90, "power": 1.2, "floor": 0.15},
                {"law": "belly", "peak": 0.5, "power": 0.6, "floor": 0.1},
            ],
        },
        "displace": [{"law": "smooth", "sigma": 8}],
        "hand": {"drift": 0.7, "wavelength": 130},
        "color": {"law": "constant", "ink": "#24160f"},
        "seed": 37,
    },
    # a soft pencil that goes over every outline again, a little beside itself
    "gone_over": {
        "brush": {"preset": "classic/pencil", "width_px": 4.0, "speed": 450},
        "plan": {"join_px": 8, "corner_deg": 60, "max_len": 280, "restate": 2},
        "pressure": {
            "min": 0.25,
            "max": 0.9,
            "terms": [
                {"law": "per_stroke", "mean": 0.7, "sd": 0.15},
                {"law": "taper", "in": 25, "out": 60, "floor": 0.15},
            ],
        },
        "displace": [
            {"law": "smooth", "sigma": 6},
            {"law": "offset_rotate", "offset": 1.3, "angle": 1.0},
        ],
        "hand": {"drift": 0.9, "wavelength": 90},
        "color": {"law": "constant", "ink": "#33302e"},
        "seed": 38,
    },
    # a broad nib held at 40 degrees
    "chisel_pen": {
        "brush": ink(
            "deevad/liner",
            3.0,
            7.0,
            speed=300,
            response=LINER_RESPONSE,
            settings={
                "elliptical_dab_ratio": 4.5,
                "elliptical_dab_angle": 40.0,
                "dabs_per_actual_radius": 8.0,
                "anti_aliasing": 1.0,
            },
        ),
        "plan": {"join_px": 8, "corner_deg": 70},
        "pressure": {
            "max": 1.0,
            "tremor": 0.02,
            "terms": [{"law": "taper", "in": 10, "out": 14, "floor": 0.5}],
        },
        "displace": [{"law": "smooth", "sigma": 5}],
        "hand": {"drift": 0.5, "wavelength": 130},
        "color": {"law": "constant", "ink": "#1b2440"},
        "seed": 39,
    },
    # ruled-looking straight cuts that run well past every corner
    "long_ends": {
        "brush": ink("deevad/liner", 1.0, 3.2, speed=500, response=LINER_RESPONSE),
        "plan": {"join_px": 6, "straighten": 7, "corner_deg": 45},
        "pressure": {
            "max": 1.0,
            "tremor": 0.02,
            "terms": [
                {"law": "kind", "contour": 1.0, "crease": 0.7, "valley": 0.5},
                {"law": "taper", "in": 30, "out": 45, "floor": 0.15},
            ],
        },
        "displace": [
            {"law": "straighten", "tolerance": 7},
            {"law": "overshoot", "length": 22, "jitter": 0.4, "bend": 0.0},
        ],
        "hand": {"drift": 0.3, "wavelength": 160},
        "color": {"law": "constant", "ink": "#2b2b33"},
        "seed": 40,
    },
}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "shared", type=Path, nargs="?", default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--styles", help="comma-separated; all by default")
    args = parser.parse_args()
    if args.shared is None:
        parser.error("give SHARED or set STROKESTYLE_SHARED")
    shared = args.shared.resolve()
    sys.path.insert(0, str(shared / "artist"))
    import artist

    args.out.mkdir(parents=True, exist_ok=True)
    shapes = args.out / "shapes"
    if not shapes.exists():
        shapes.symlink_to(shared / "shapes")
    for name in args.styles.split(",") if args.styles else STYLES:
        spec = {"name": name, **STYLES[name]}
        for number, shape in enumerate(SHAPES):
            folder = args.out / "styles" / name / shape
            if (folder / "take2.png").exists():
                continue
            curves = json.loads((shapes / shape / "curves.json").read_text())
            seed = 1000 * spec["seed"] + number
            artist.save(folder, *artist.draw(curves, spec, seed))
            again, _, _ = artist.draw(curves, spec, seed + 500)
            artist.Image.fromarray(again).save(folder / "take2.png", optimize=True)
        print(name, flush=True)


if __name__ == "__main__":
    main()
