"""Strokes as Inkscape's PowerStrokes: a skeleton, and half widths along it for a hand to edit.

Other programs show the outline that we wrote. Inkscape makes its own of skeleton and half widths as
soon as the stroke is touched, so these must draw the same. Its effect fails as a whole, and leaves
the skeleton filled, where a join of type round meets a node whose directions differ by less than a
degree (its ellipse has no radius), and where a skeleton has no length. Here joins are of type
spiro: arcs as well, and they bear any turn.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..drawing.strokes import Strokes, merge_coincident_points
from ..geometry.bezier import fit_lines
from ..geometry.curves import arc, simplify
from .centre_lines import line_path
from .format import LIMITS, SvgOptions
from .landmarks import FINE, fine_line
from .markup import Element, numbers, units
from .path_data import parse_path

LINE_SLACK = 0.05  # px between a centre line and its skeleton
WIDTH_SLACK = 0.1  # px between a width and Inkscape's, which interpolates between few of them
THIN = 0.04  # of a thin stroke's width, that it may be off likewise
TIP = 0.04  # px between the two nodes at which a skeleton turns back, and of a dot from end to end
BACK = -0.7  # the cosine of a turn that is divided among two nodes
MAX_TEXT = LIMITS["path_characters"].value
NODE = 0.01  # of a curve: what is nearer to a node is at it
SIDE_STEP = 0.25  # px between the places at which a side is looked at
MAX_SIDES = 8000
EFFECT = "lpe-"  # and the stroke's id: the id of its path effect


class PowerStroke(NamedTuple):
    """A stroke as Inkscape's PowerStroke has it.

    Parameters
    ----------
    d : path data of its skeleton
    line : (n, 2), that skeleton as a fine polyline, px
    offset_points : "t,w | ...": t counts the skeleton's curves, w is half the width, px
    """

    d: str
    line: np.ndarray
    offset_points: str


def power_strokes(strokes: Strokes, options: SvgOptions, index: Iterable[int]) -> list[PowerStroke]:
    """Give strokes `index` as PowerStrokes that draw what their outlines do."""
    spines = [_spine(strokes, i) for i in index]
    offsets = np.cumsum([0] + [len(spine.xy) for spine in spines])
    xy = np.concatenate([np.zeros((0, 2)), *(spine.xy for spine in spines)])
    decimals = max(options.decimals, 2)  # a dot, and a turn, are but a few hundredths
    made = []
    for spine, (cubics, rows) in zip(spines, fit_lines(xy, offsets, LINE_SLACK), strict=True):
        d = line_path(cubics, decimals, spine.closed)
        line = fine_line(parse_path(d)[0][: len(cubics)])  # without what closes it
        made.append(PowerStroke(d, line, _offset_points(spine, line, rows)))
    return made


def effect(name: str, offset_points: str) -> Element:
    """Give Inkscape's path effect of the stroke of an id."""
    return Element(
        "inkscape:path-effect",
        {
            "effect": "powerstroke", "id": EFFECT + name, "is_visible": "true", "lpeversion": "1.3",
            "scale_width": "1", "interpolator_type": "Linear", "interpolator_beta": "0.2",
            "start_linecap_type": "round", "end_linecap_type": "round", "linejoin_type": "spiro",
            "miter_limit": "4", "sort_points": "true", "not_jump": "false",
            "offset_points": offset_points,
        },
    )  # fmt: skip


def swell(offset_points: str) -> float:
    """Sum half widths, each times 1 + t: where it is another, somebody edited them.

    Raises ValueError where they cannot be read.
    """
    t, half = _read_offset_points(offset_points)
    return float((1.0 + t) @ half)


def read_power_stroke(d: str, offset_points: str) -> tuple[np.ndarray, np.ndarray]:
    """Read the centre line (n, 2) and the widths (n,) that Inkscape shows of a PowerStroke.

    Parameters
    ----------
    d : path data of its skeleton, of which the first subpath counts
    offset_points : as `PowerStroke` has them; between them widths are interpolated linearly

    Raises
    ------
    ValueError
        where they cannot be read, or draw nothing.
    """
    match = re.match("[^MmZz]*[Mm][^MmZz]*[Zz]?", d)
    subpaths = parse_path(match[0] if match else "")
    if not subpaths:
        raise ValueError("a skeleton that draws nothing")
    cubics = np.array(subpaths[0]).reshape(-1, 4, 2)
    count = len(cubics)
    t, half = _read_offset_points(offset_points)
    at = np.union1d(np.arange(FINE * count + 1) / FINE, t[(t >= 0) & (t <= count)])
    k = np.minimum(at.astype(np.int64), count - 1)
    s = (at - k)[:, None]
    p = cubics[k]
    xy = (1 - s) ** 3 * p[:, 0] + 3 * s * (1 - s) ** 2 * p[:, 1]
    xy += 3 * s**2 * (1 - s) * p[:, 2] + s**3 * p[:, 3]
    closed = match is not None and match[0][-1] in "Zz"
    return xy, 2.0 * np.interp(at, t, half, period=count if closed else None)


def _read_offset_points(text: str) -> tuple[np.ndarray, np.ndarray]:
    """The places and half widths, both (n,), of offset points, by their places."""
    if len(text) > MAX_TEXT:
        raise ValueError(f"more than {MAX_TEXT} characters of offset points")
    pairs = np.array([pair.split(",")[:2] for pair in text.split("|")], np.float64)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
        raise ValueError("offset points are pairs of numbers")
    t, half = pairs[np.argsort(pairs[:, 0], kind="stable")].T
    return t, np.abs(half)


class _Spine(NamedTuple):
    """A centre line (n, 2) as a skeleton follows it, with half widths (n,), px.

    A closed one repeats its first point as its last.
    """

    xy: np.ndarray
    half: np.ndarray
    closed: bool


def _spine(strokes: Strokes, i: int) -> _Spine:
    """The centre line of stroke i without what a PowerStroke cannot draw."""
    rows = strokes.rows(i)
    xy, half = merge_coincident_points(strokes.xy[rows], 0.5 * strokes.thickness[rows])
    closed = bool(strokes.closed[i]) and len(xy) > 3  # as outlines have it
    if closed:
        xy, half = _begun_amid_a_piece(xy, half)
    else:
        ends = _bare_ends(xy, half)
        xy, half = xy[ends], half[ends]
    if len(xy) == 1:
        return _Spine(xy + [[-0.5 * TIP, 0.0], [0.5 * TIP, 0.0]], half.repeat(2), False)
    return _Spine(*_turned_in_two_steps(xy, half), closed)


def _begun_amid_a_piece(xy: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed line from the middle of its longest piece on: where it begins it has no join."""
    k = int(np.hypot(*np.diff(xy, axis=0).T).argmax())
    both = np.column_stack([xy, half])
    middle = 0.5 * (both[k : k + 1] + both[k + 1 : k + 2])
    both = np.concatenate([middle, both[k + 1 :], both[1 : k + 1], middle])
    return both[:, :2], both[:, 2]


def _bare_ends(xy: np.ndarray, half: np.ndarray) -> slice:
    """The points of a line but for those at its ends whose discs the next one holds.

    A cap there would stick out of that.
    """
    length, grows = np.hypot(*np.diff(xy, axis=0).T), np.diff(half)
    bare_first, bare_last = np.r_[grows < length, True], np.r_[True, -grows < length]
    return slice(int(bare_first.argmax()), len(xy) - int(bare_last[::-1].argmax()))


def _turned_in_two_steps(xy: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A line whose turns back are two turns, TIP apart: no join goes half a circle round."""
    step = np.diff(xy, axis=0)
    step /= np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-12)[:, None]
    back = np.flatnonzero((step[:-1] * step[1:]).sum(axis=1) < BACK) + 1
    side = step[back - 1] + step[back]
    size = np.hypot(side[:, 0], side[:, 1])
    straight = np.stack([-step[back, 1], step[back, 0]], axis=1)
    far = (size > 1e-6)[:, None]
    side = 0.5 * TIP * np.where(far, side / np.maximum(size, 1e-12)[:, None], straight)
    at = np.sort(np.r_[np.arange(len(xy)), back])
    first = np.searchsorted(at, back)
    xy = xy[at]
    xy[first] -= side
    xy[first + 1] += side
    return xy, half[at]


def _offset_points(spine: _Spine, line: np.ndarray, rows: np.ndarray) -> str:
    """Half widths along a skeleton whose curves begin and end at the spine's points `rows`.

    There is one at every node: where a piece of Inkscape's widths runs across a node, lib2geom
    finds the node's place on it twice, and if the two differ by a rounding the effect fails.

    `line` : the skeleton, FINE pieces a curve
    """
    along, far = arc(spine.xy), arc(line)
    place, half = _sides(spine, along)
    nodes = along[rows]
    t = np.interp(np.interp(place, nodes, far[::FINE]), far, np.arange(len(line)) / FINE)
    # what is off is looked at across: Inkscape interpolates widths by t, whatever its scale
    slack = min(0.5 * WIDTH_SLACK, THIN * float(half.max()))
    knots = simplify(np.stack([1e3 * t, half], axis=1), slack)
    knots = knots[np.abs(t[knots] - np.rint(t[knots])) > NODE]
    t = np.r_[np.arange(len(nodes)), t[knots]]
    half = np.r_[np.interp(nodes, place, half), half[knots]]
    order = np.argsort(t)[: -1 if spine.closed else None]  # a closed one's last is the first
    pairs = zip(numbers(units(t[order], 4), 4), numbers(units(half[order], 3), 3), strict=True)
    return " | ".join(f"{a},{w}" for a, w in pairs)


def _sides(spine: _Spine, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (m,) along a spine, evenly spaced, and how far its discs reach across it there, px.

    A PowerStroke's sides are that far from the skeleton, while a disc of radius r reaches
    sqrt(r^2 - d^2) at the distance d along it: more than the radius there where widths change.
    """
    from scipy import ndimage

    count = int(min(np.ceil(along[-1] / SIDE_STEP), MAX_SIDES)) + 1
    place, step = np.linspace(0.0, along[-1], count, retstep=True)
    square = np.square(np.interp(place, along, spine.half))
    reach = min(int(np.sqrt(square.max()) / step), count)
    disc = -np.square(step * np.arange(-reach, reach + 1))
    if spine.closed:
        across = ndimage.grey_dilation(square[:-1], structure=disc, mode="wrap")
        return place, np.sqrt(np.r_[across, across[:1]])
    across = ndimage.grey_dilation(square, structure=disc, mode="nearest")
    across[[0, -1]] = square[[0, -1]]  # of which Inkscape makes caps
    return place, np.sqrt(across)
