"""Show how biased FID of a few drawings is: FID, KID and patch FID of subsets of growing size.

    python experiments/fid_bias.py OUT [--data DATA] [--size 256] [--train spot] [--methods a,b]
        [--repeats 20] [--seed 0] [--plot FILE.svg]

Of the artist's test drawings, N are drawn at random, and compared with the second takes of the same
N, with the second takes of N others (as FID is meant: sets that have nothing in common but where
they are from), with the plain curves, and with each method in OUT. Mean of the repeats and 95 % of
them. The artist is as far from herself at any N; what FID says more at a small N is bias.

The last column is what FID would be of endless drawings: it is linear in 1 / N to first order, and
the line through the larger N's means is followed to 1 / N = 0 (Chong & Forsyth, Effectively
unbiased FID and Inception Score and where to find them, CVPR 2020, sec. 3). With fewer drawings
than features even that is rough. KID (times 1000) needs no such help."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common_options import carry_out, comparing
from dataset import data_of
from measure import SECOND, Row, contestants, drawn_methods, number, read_drawings, table
from metrics.frechet import frechet_distance
from metrics.kid import PairedKid, kid
from metrics.looks import Looks

from strokestyle.files import write_bytes

Features = list[np.ndarray]  # (2048,) of each drawing, or (N, 2048) of its patches
Measure = Callable[[np.ndarray, np.ndarray], float]  # which drawings of the one set, of the other
COLOURS = ("#222", "#c33", "#27c", "#2a2", "#a3a", "#d80", "#088", "#885", "#f6a", "#555")


def subsets(count: int, n: int, repeats: int, rng: np.random.Generator, apart: bool):
    """Draw N of `count` drawings, and the same or N others, so often."""
    for _ in range(repeats):
        order = rng.permutation(count)
        yield order[:n], order[n : 2 * n] if apart else order[:n]


def sizes_of(count: int, apart: bool) -> list[int]:
    """Sizes of subsets, up to all drawings or half of them."""
    return [n for n in (3, 5, 8, 10, 15, 20, 30, 50, 100) if n <= (count // 2 if apart else count)]


def extrapolated(sizes: list[int], means: list[float]) -> float:
    """Follow the line through (1 / N, mean) to 1 / N = 0, of N from a third of the largest on."""
    held = [k for k, n in enumerate(sizes) if 3 * n >= max(sizes)]
    if len(held) < 2:
        return float("nan")
    n, y = (np.array(values)[held] for values in (sizes, means))
    return float(np.polynomial.polynomial.polyfit(1 / n, y, 1)[0])


def fid_of(a: Features, b: Features) -> Measure:
    """FID of some drawings of a and some of b."""
    return lambda i, j: frechet_distance(
        np.concatenate([np.atleast_2d(a[k]) for k in i]),
        np.concatenate([np.atleast_2d(b[k]) for k in j]),
    )


def kid_of(a: Features, b: Features, apart: bool) -> Measure:
    """KID, times 1000; of pairs unless they are apart."""

    def measure(i: np.ndarray, j: np.ndarray) -> float:
        if apart:
            return 1000 * kid(np.stack([a[k] for k in i]), np.stack([b[k] for k in j]))
        return 1000 * PairedKid([a[k][None] for k in i], [b[k][None] for k in j]).distance()

    return measure


def grown(measure: Measure, count: int, options: argparse.Namespace, apart: bool) -> dict:
    """Measure subsets of growing size: N -> values of all repeats."""
    rng, found = np.random.default_rng(options.seed), {}
    for n in sizes_of(count, apart):
        repeats = 1 if n == count else options.repeats
        found[n] = [measure(i, j) for i, j in subsets(count, n, repeats, rng, apart)]
    return found


def cells_of(found: dict, sizes: list[int], digits: int) -> list[str]:
    """The mean and 95 % of the repeats for each size."""
    cells = []
    for n in sizes:
        values = found.get(n, [])
        if not values:
            cells.append("–")
            continue
        low, high = np.percentile(values, [2.5, 97.5])
        spread = f" ({number(low, digits)} .. {number(high, digits)})" if len(values) > 1 else ""
        cells.append(number(float(np.mean(values)), digits) + spread)
    return cells


def lines_of(
    label: str, looks: Looks, pairs: list, options: argparse.Namespace, apart: bool
) -> dict[str, dict]:
    """Grow one comparison: the line's name -> N -> values."""
    whole = [[looks.whole(pair[side]) for pair in pairs] for side in (0, 1)]
    patch = [[looks.patches(pair[side]) for pair in pairs] for side in (0, 1)]
    count = len(pairs)
    return {
        f"FID, {label}": grown(fid_of(*whole), count, options, apart),
        f"KID x 1000, {label}": grown(kid_of(*whole, apart), count, options, apart),
        f"patch FID, {label}": grown(fid_of(*patch), count, options, apart),
    }


def plot(found: dict[str, dict]) -> str:
    """Draw FID against 1 / N as SVG, each line followed to 1 / N = 0."""
    lines = {name[5:]: line for name, line in found.items() if name.startswith("FID, ") and line}
    most = max(max(map(np.mean, line.values())) for line in lines.values())
    width, height, left, foot = 640, 400, 60, 40

    def at(x: float, y: float) -> str:
        return f"{left + x * (width - left - 20) * 3:.1f},{height - foot - y / most * 320:.1f}"

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" ']
    parts.append('font-family="sans-serif" font-size="13"><rect width="100%" height="100%" ')
    parts.append(f'fill="#fff"/><path d="M{at(0, most)} L{at(0, 0)} L{at(1 / 3, 0)}" ')
    parts.append('fill="none" stroke="#888"/>')
    for y in np.linspace(0, most, 5):
        x0, y0 = at(0, y).split(",")
        parts.append(f'<text x="{float(x0) - 6}" y="{y0}" text-anchor="end">{y:.0f}</text>')
    sizes = sorted({n for line in lines.values() for n in line})
    for n in sizes:
        x0, y0 = at(1 / n, 0).split(",")
        parts.append(f'<text x="{x0}" y="{float(y0) + 18}" text-anchor="middle">{n}</text>')
    parts.append(f'<text x="{width - 20}" y="{height - 6}" text-anchor="end">drawings, N</text>')
    for k, (name, line) in enumerate(lines.items()):
        colour, means = COLOURS[k % len(COLOURS)], [float(np.mean(v)) for v in line.values()]
        points = [at(1 / n, y) for n, y in zip(line, means, strict=True)]
        parts.append(f'<polyline points="{" ".join(points)}" fill="none" stroke="{colour}"/>')
        end = extrapolated(list(line), means)
        if np.isfinite(end):
            parts.append(f'<path d="M{points[-1]} L{at(0, max(end, 0))}" stroke="{colour}" ')
            parts.append('stroke-dasharray="4 3"/>')
        parts += [f'<circle cx="{p.replace(",", chr(34) + " cy=" + chr(34))}" r="3" '
                  f'fill="{colour}"/>' for p in points]  # fmt: skip
        parts.append(f'<text x="{left + 12}" y="{20 + 17 * k}" fill="{colour}">{name}</text>')
    return "".join([*parts, "</svg>\n"])


def run(options: argparse.Namespace) -> None:
    """Measure and print. Raises OSError and ValueError."""
    data = data_of(options)
    styles = data.chosen_styles(options.styles)
    keys = [(style, shape) for style in styles for shape in data.tests(style)]
    methods = drawn_methods(options.out, options.methods)
    artist = read_drawings(data, keys, data.drawing_path)
    looks, found = Looks(options.out / ".looks"), {}
    rows = {row.label: row for row in contestants(data, list(artist), options.out, methods)}

    def pairs_of(row: Row) -> list:
        return [(artist[key], row.images[key]) for key in artist if key in row.images]

    if SECOND in rows:
        second = pairs_of(rows.pop(SECOND))
        found |= lines_of("second take", looks, second, options, False)
        found |= lines_of("second take of others", looks, second, options, True)
    else:
        print(f"{data.root}: no second takes (take2.png), so no lines of them", file=sys.stderr)
    for label, row in rows.items():
        found |= lines_of(label, looks, pairs_of(row), options, False)
    sizes = sorted({n for line in found.values() for n in line})
    lines = []
    for name, line in sorted(found.items()):
        end = extrapolated(list(line), [float(np.mean(values)) for values in line.values()])
        ended = "–" if name.startswith("KID") else number(end, 1)
        lines.append([name, *cells_of(line, sizes, 1), ended])
    print(table(["drawings, N", *map(str, sizes), "N without end"], lines))
    if options.plot:
        write_bytes(options.plot, plot(found).encode())


def svg_file(name: str) -> Path:
    """The file of a plot, which is an SVG."""
    if Path(name).suffix.lower() != ".svg":
        raise argparse.ArgumentTypeError(f"{name}: plots are drawn as SVG: name it .svg")
    return Path(name)


def main() -> None:
    parser = comparing(__doc__)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plot", type=svg_file, metavar="FILE.svg", help="FID over 1/N")
    carry_out(run, parser)


if __name__ == "__main__":
    main()
