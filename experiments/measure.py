"""Measure the drawings of all methods against the artist's: one table.

    python experiments/measure.py OUT [--data DATA] [--size 256] [--train spot] [--methods a,b]
        [--styles a,b] [--resamples 200] [--seed 0] [--device cpu]

Reads what compare_methods.py wrote, OUT/<method>/<style>/<shape>.png and OUT/<method>/times.jsonl,
and the artist's drawings of the same shapes. Prints markdown: a row a method, between the plain
curves (as bad as doing nothing) and the artist's second drawing (take2.png: as good as can be
asked). All columns are lower = closer:

LPIPS   of each drawing and the artist's of the same shape, averaged; through AlexNet and VGG16
FID     of all drawings together, over all styles, as the paper has it; biased upwards for so few
        (fid_bias.py says how much)
KID     likewise, times 1000; unbiased. A drawing is not compared with its own counterpart
patch FID   the same of patches that hold ink (metrics/patches.py)
patch KID   likewise, times 1000, of each style, averaged
marks   metrics/marks.py, of each style, averaged
s, MB   CPU seconds to learn a style, and to draw a shape; peak memory; averages, and its maximum

+- is half the 95 % interval over drawings drawn anew (bootstrap, the same for all methods). The
second table compares methods drawing by drawing. What networks saw is kept in OUT/.looks, so that
a run may be stopped and started. A drawing that is missing is said, and left out on both sides."""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from common_options import carry_out, comparing
from dataset import DataSet, data_of, read_image
from metrics.bootstrap import Interval, interval
from metrics.frechet import frechet_distance
from metrics.kid import PairedKid
from metrics.looks import Looks

PLAIN, SECOND = "plain curves", "the artist's second take"
Key = tuple[str, str]  # style, shape
Images = dict[Key, np.ndarray]


@dataclass
class Row:
    """One contestant: its drawings, what they cost, and LPIPS of each, once it is measured."""

    label: str
    images: Images
    costs: list[dict] = field(default_factory=list)
    lpips: dict[Key, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Chance:
    """How intervals are drawn: resamples, and their seed."""

    times: int
    seed: int

    def interval(
        self, measure: Callable[[np.ndarray], float], count: int, shifted: bool
    ) -> Interval:
        """The interval of a measure over `count` drawings."""
        return interval(measure, count, self.times, self.seed, shifted)


def read_drawings(data: DataSet, keys: list[Key], path_of: Callable[[str, str], Path]) -> Images:
    """Read the drawings that are there, at the size of their sheets."""
    there = [(key, path_of(*key)) for key in keys if path_of(*key).exists()]
    return {key: read_image(path, data.sheet(key[1]).size) for key, path in there}


def contestants(data: DataSet, keys: list[Key], out: Path, methods: list[str]) -> list[Row]:
    """The plain curves, the methods, and the artist's second take."""
    plain = {key: np.repeat(data.sheet(key[1]).plain[..., None], 3, 2) for key in keys}
    rows = [Row(PLAIN, plain)]
    for name in methods:
        drawn = read_drawings(data, keys, lambda s, x, name=name: out / name / s / f"{x}.png")
        rows.append(Row(name, drawn, read_costs(out / name / "times.jsonl")))
    second = read_drawings(data, keys, lambda s, x: data.drawing_path(s, x).with_name("take2.png"))
    return [*rows, Row(SECOND, second)] if second else rows


def read_costs(path: Path) -> list[dict]:
    """Read what each style cost; of one that was made twice, the last."""
    if not path.exists():
        return []
    lines = [json.loads(line) for line in path.read_text().splitlines() if line.strip()]
    return list({line["style"]: line for line in lines}.values())


def drawn_methods(out: Path, names: str | None) -> list[str]:
    """The methods of a comma-separated list, or all, by name, that drew something.

    Raises ValueError where one of the list drew nothing."""
    there = sorted({path.parts[-3] for path in out.glob("*/*/*.png")})
    absent = sorted(set(names.split(",")) - set(there)) if names else []
    if absent:
        told = ", ".join(there) or "none"
        raise ValueError(f"{out}: no drawings by {', '.join(absent)}; there are those by {told}")
    return names.split(",") if names else there


def measure_row(row: Row, artist: Images, looks: Looks, chance: Chance) -> list[str]:
    """Measure one contestant: the cells of its line. Fills in its `lpips`."""
    keys = [key for key in artist if key in row.images]
    pairs = [(artist[key], row.images[key]) for key in keys]
    cells = [row.label, str(len(pairs))]
    if len(pairs) < 2:
        return cells + ["–"] * 7 + cost_cells(row.costs)
    alex, vgg = ([looks.lpips(net, *pair) for pair in pairs] for net in ("alexnet", "vgg16"))
    row.lpips = dict(zip(keys, alex, strict=True))
    cells += [plus_minus(mean_interval(values, chance), 4) for values in (alex, vgg)]
    cells += whole_cells([[looks.whole(image) for image in pair] for pair in pairs], chance)
    styles = by_style(keys)
    cells += patch_cells(
        [[looks.patches(image) for image in pair] for pair in pairs], styles, chance
    )
    marks = [looks.marks(*zip(*(pairs[i] for i in style), strict=True)) for style in styles]
    looks.save()
    return [*cells, number(float(np.mean(marks)), 3), *cost_cells(row.costs)]


def by_style(keys: list[Key]) -> list[list[int]]:
    """Group keys by style: their numbers."""
    styles = sorted({style for style, _ in keys})
    return [[i for i, key in enumerate(keys) if key[0] == style] for style in styles]


def mean_interval(values: list[float], chance: Chance) -> Interval:
    """The mean of values and its interval."""
    return chance.interval(lambda w: float(np.average(values, weights=w)), len(values), False)


def whole_cells(pairs: list[list[np.ndarray]], chance: Chance) -> list[str]:
    """FID and KID of whole drawings, pairs of (2048,)."""
    a, b = (np.stack(side) for side in zip(*pairs, strict=True))
    kernels = PairedKid(a[:, None], b[:, None])
    fid = chance.interval(lambda w: frechet_distance(a, b, w, w), len(a), True)
    kid = chance.interval(lambda w: 1000 * kernels.distance(w), len(a), True)
    return [plus_minus(fid, 1), plus_minus(kid, 1)]


def patch_cells(
    pairs: list[list[np.ndarray]], styles: list[list[int]], chance: Chance
) -> list[str]:
    """FID of all patches and KID of each style's, averaged; pairs of (N, 2048)."""
    sides = list(zip(*pairs, strict=True))
    a, b = (np.concatenate(side) for side in sides)
    of_a, of_b = (np.repeat(np.arange(len(side)), [len(x) for x in side]) for side in sides)
    if min(len(a), len(b)) < 2:  # blank sheets
        return ["–", "–"]
    kernels = [PairedKid(*([side[i] for i in style] for side in sides)) for style in styles]

    def patch_kid(w: np.ndarray) -> float:
        found = [k.distance(w[style]) for k, style in zip(kernels, styles, strict=True)]
        held = [value for value in found if np.isfinite(value)]
        return 1000 * float(np.mean(held)) if held else float("nan")

    fid = chance.interval(lambda w: frechet_distance(a, b, w[of_a], w[of_b]), len(pairs), True)
    return [plus_minus(fid, 1), plus_minus(chance.interval(patch_kid, len(pairs), True), 1)]


def cost_cells(costs: list[dict]) -> list[str]:
    """Seconds to learn a style and to draw a shape, on average, and the most memory."""
    if not costs:
        return ["–"] * 3
    learn, draw = (float(np.mean([cost[name] for cost in costs])) for name in ("learn s", "draw s"))
    return [number(learn, 1), number(draw, 2), f"{max(cost['peak MB'] for cost in costs):.0f}"]


def number(value: float, digits: int) -> str:
    """Write a number; a dash where there is none."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "–"


def plus_minus(found: Interval, digits: int) -> str:
    """Write a figure and half its interval."""
    return f"{number(found.value, digits)} ± {number(found.half, digits)}"


def compared(rows: list[Row], chance: Chance) -> list[list[str]]:
    """Compare methods with the closest of them, drawing by drawing, by LPIPS."""
    rows = sorted((row for row in rows if row.lpips), key=lambda row: _mean(row.lpips.values()))
    lines = []
    for row in rows[1:]:
        keys = [key for key in rows[0].lpips if key in row.lpips]
        gaps = [row.lpips[key] - rows[0].lpips[key] for key in keys]
        if gaps:
            gap = mean_interval(gaps, chance)
            spread = f"{number(gap.low, 4)} .. {number(gap.high, 4)}"
            won = f"{sum(g > 0 for g in gaps)} of {len(gaps)}"
            lines.append([rows[0].label, row.label, number(gap.value, 4), spread, won])
    return lines


def _mean(values) -> float:
    return float(np.mean(list(values)))


def table(head: list[str], lines: list[list[str]]) -> str:
    """Lay cells out as markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in [head, ["---"] * len(head), *lines])


HEAD = ["method", "drawings", "LPIPS, Alex", "LPIPS, VGG", "FID", "KID x 1000", "patch FID"]
HEAD += ["patch KID x 1000", "marks", "learn, s", "draw, s", "MB"]
COMPARED = ["closest", "and", "LPIPS farther by", "95 %", "closer in"]


def run(options: argparse.Namespace) -> None:
    """Measure what the options name. Raises OSError and ValueError."""
    data = data_of(options)
    chance = Chance(options.resamples, options.seed)
    styles = data.chosen_styles(options.styles)
    keys = [(style, shape) for style in styles for shape in data.tests(style)]
    methods = drawn_methods(options.out, options.methods)
    artist = read_drawings(data, keys, data.drawing_path)
    if len(artist) < 2:
        raise ValueError(f"{data.root}: fewer than two drawings to compare with")
    rows, looks, lines = contestants(data, list(artist), options.out, methods), None, []
    looks = Looks(options.out / ".looks", options.device)
    for row in rows:
        if missing := [
            f"{style}/{shape}" for style, shape in artist if (style, shape) not in row.images
        ]:
            print(f"{row.label}: missing {', '.join(missing)}", file=sys.stderr)
        print(f"{row.label}: {len(row.images)} drawings", file=sys.stderr, flush=True)
        lines.append(measure_row(row, artist, looks, chance))
    print(table(HEAD, lines))
    if pairs := compared([row for row in rows if row.label not in (PLAIN, SECOND)], chance):
        print(f"\n{table(COMPARED, pairs)}")


def main() -> None:
    parser = comparing(__doc__)
    parser.add_argument("--resamples", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    carry_out(run, parser)


if __name__ == "__main__":
    main()
