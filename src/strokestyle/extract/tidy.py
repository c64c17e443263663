"""From visible fragments of lines to the fewest, longest natural strokes.

A line is *hard* where it must be drawn to understand the shape (contour, boundary, crease,
intersection, section, other) and *soft* where it describes the form between those (suggestive
contour, ridge, valley, apparent ridge).

Lengths are those of a printed line, in pixels, so that a larger canvas shows what a smaller one had
no room for. Two things bound that. What tells noise from form grows with a canvas of more than 768
px on its longer side: all lengths that are asked of soft lines, the length up to which creases are
in doubt, the swarms that they come in, and the gaps between free ends of contours. Noise is as
large in the picture as the picture is. And below 768 px all lengths shrink with the canvas, so that
a small picture holds what it can, but to no less than UNIT[0] times. UNIT[0] was chosen
by eye from a boot, a bust and a pin header at 256 px, of three values: at .33, as the canvas would
have it, each pin is a bundle of lines 1 px apart, and at 1 the bust has no eyes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.curves import Curves
from .tidy_drop import drop
from .tidy_join import join
from .tidy_lines import STEP, Numbers, TidyOptions, chords, evenly, flip_short
from .tidy_merge import MIN_REMAIN, merge
from .tidy_nodes import find_nodes, turns_at
from .tidy_split import smooth, split, trim_hooks

__all__ = ["Strokes", "TidyOptions", "subtract_parallel", "tidy", "tidy_with_source"]

REFERENCE = 768.0  # px, the longer side of a canvas on which nothing shrinks or grows
UNIT = (0.6, 1.0)  # px of the canvas that a px here stands for, at least and at most
STRAIGHT_ON = 0.2  # degrees; a stroke that turns by less at a node runs on through it
HAIRPIN = 110.0  # degrees: a line that turns back on itself is two lines


def tidy(
    fragments: Curves,
    strength: np.ndarray,
    size: tuple[int, int] = (768, 768),
    options: TidyOptions | None = None,
) -> Curves:
    """Make the strokes that an illustrator would start from, of visible pieces of feature lines.

    0. **Nodes** are found: where a hard line ends on another, as the edges of a solid do at its
       corners, and where one turns at once between straight sides. They stay where they are, and
       lines end at them or pass through them exactly.
    1. **Cut** where a line turns back on itself (110 degrees within 6 px), as contours do at cusps.
    2. **Merged**: the part of a curve that runs beside a better one goes: within `merge` px and
       `merge_angle` degrees, if it is soft within `merge_soft` px, or beside a contour
       `merge_contour` px and 0.4 `merge_angle`; and since suggestive contours and lines of other
       kinds tell of the same form from two sides, of these two within `merge_suggestive` px and 0.7
       `merge_angle`. Better is, among hard lines of 8 px and more, the kind earlier in PRIORITY,
       then the longer; a hard line before a soft one; among soft ones the greater length x
       strength. A crease shorter than `long_crease` px is more often noise than form and competes
       as a soft line, with twice its length. Of what is left, stretches shorter than 6 px go too;
       what would go over less than 4 px stays. Lines that cross are not parallel, so they stay. A
       hard line that comes up to a better one, or leaves it, goes on for up to 12 px until the two
       touch, or for up to 30 px to the node where it ends.
    3. **Joined**, before and after steps 2 and 4: ends at most 4 px apart at first, then `gap` px
       (`contour_gap` between contours), but not farther than the shorter piece is long. Both must
       head for each other within `angle` degrees (1.4 times that for contours), or overlap side by
       side by at most 6 px; ends within 2 px may bend by 60 degrees, and two free ends of contours
       by 90. Straightest and nearest pairs first, the same kind before others, never across a third
       hard line. A joined stroke has the kind of its longest part, of the hard ones where these
       make up a third of it. Ends of one curve that meet close it.
    4. **Dropped**: hard lines shorter than `isolated` px; 1.4 `attached` px with one end,
       `attached` px with both within 6 px of another line. Soft lines, and short creases with an
       end more than 2.5 px from any line, of less length x strength than `soft` px, and once more
       as much for every `clutter` px of other lines shorter than 30 px within 24 px: noise comes in
       swarms. Anything shorter than `speck` px.
    5. **Split** at corners of more than `corner` degrees within 6 px either side that are no
       zig-zag (0.75 times that over 12 px), 11 px or more from the ends and from each other. What
       turns as much within the last 8 px is a hook, and goes, unless it ends at a node. A closed
       curve with no corner starts at its topmost point (the leftmost of these); one with corners
       starts and ends at one and is open.
    6. **Smoothed** along the stroke, by no more than `smooth` px, soft lines `smooth_soft` px; ends
       and nodes stay.

    Parameters
    ----------
    fragments : visible polylines, in pixels, points at any spacing
    strength : (N,) in 0..1, per point; only that of soft lines counts
    size : (width, height) of the canvas, pixels; see the head of this module
    options : the numbers above

    Returns
    -------
    Curves with a point about every pixel, in KINDS order, the longest of a kind first

    Raises
    ------
    ValueError
        where `strength` does not fit the fragments, or the canvas has no size.
    """
    return tidy_with_source(fragments, strength, size, options).curves


class Strokes(NamedTuple):
    """Curves of `tidy`, and of each of their M points what it comes from.

    Parameters
    ----------
    curves : C curves
    source : (M,) int, the row of the given points that it comes from: a point of a bridge from the
        end that is nearest, a smoothed one from where it was
    corner : (M,) bool, whether the stroke turns there at a node, and must pass it exactly
    """

    curves: Curves
    source: np.ndarray
    corner: np.ndarray


def tidy_with_source(
    fragments: Curves,
    strength: np.ndarray,
    size: tuple[int, int] = (768, 768),
    options: TidyOptions | None = None,
) -> Strokes:
    """Tidy as `tidy` does, and say where each point of the result comes from."""
    strength = np.asarray(strength, np.float64)
    if strength.shape != (len(fragments.xy),) or not np.isfinite(strength).all():
        raise ValueError(
            f"strength must be {len(fragments.xy)} finite numbers, one per point, "
            f"got {strength.shape}"
        )
    if min(size) <= 0:
        raise ValueError(f"the canvas must have a size, got {size[0]} x {size[1]}")
    unit, numbers = _on_canvas(size, options or TidyOptions())
    lines = evenly(fragments, unit, strength, find_nodes(fragments))
    lines = split(lines, HAIRPIN, reach=3, apart=2, steady=False, options=numbers)
    lines = join(lines, numbers, near=True)
    lines = merge(lines, numbers)
    lines = join(lines, numbers, near=True)
    lines = drop(lines, numbers)
    lines = join(lines, numbers, near=False)
    lines = merge(lines, numbers)
    lines = drop(lines, numbers)
    lines = join(lines, numbers, near=False)
    lines = split(lines, numbers.corner, reach=6, apart=11, steady=True, options=numbers)
    lines = trim_hooks(lines, numbers)
    lines = smooth(lines, numbers)
    order = np.lexsort((-lines.length, lines.kind))
    lines = lines.take(order)
    xy = lines.xy * unit
    if len(xy):  # nor does rounding take a line over the edge of the canvas
        xy = np.clip(xy, fragments.xy.min(axis=0), fragments.xy.max(axis=0))
    curves = Curves(xy, lines.offsets, lines.kind, lines.closed)
    return Strokes(curves, lines.source, lines.node & (turns_at(curves) > STRAIGHT_ON))


def _on_canvas(size: tuple[int, int], options: TidyOptions) -> tuple[float, Numbers]:
    """Choose how many px of a canvas stand for one px of the options, and how much noise grows."""
    scale = max(size) / REFERENCE
    unit = float(np.clip(scale, *UNIT))
    growth = max(scale / unit, 1.0)
    return unit, Numbers(**vars(options), growth=growth)


def subtract_parallel(
    curves: Curves, others: Curves, size: tuple[int, int] = (768, 768)
) -> tuple[Curves, np.ndarray]:
    """Take from curves the parts that run along one of `others`.

    That is within 2.5 px of it and 25 degrees of its direction. Gaps and remains of less than 6 px
    are closed and dropped. On a canvas of less than 768 px lengths shrink, as in `tidy`.

    Returns
    -------
    what is left, and of each of its points (M,) the row of `curves` that it comes from
    """
    unit, options = _on_canvas(size, TidyOptions())
    if not len(curves) or not len(others):
        return curves, np.arange(len(curves.xy))
    lines, drawn = (evenly(c, unit, np.ones(len(c.xy)), find_nodes(c)) for c in (curves, others))
    if len(lines) and len(drawn):
        from scipy.spatial import cKDTree  # takes .1 s to import

        distance, nearest = cKDTree(drawn.xy).query(lines.xy, distance_upper_bound=options.merge)
        near = distance < np.inf
        nearest = np.where(near, nearest, 0)
        cosine = np.abs(np.einsum("ij,ij->i", chords(lines), chords(drawn)[nearest]))
        covered = near & (cosine > np.cos(np.radians(options.merge_angle)))
        for value in (False, True):
            covered = flip_short(covered, lines.offsets, value, MIN_REMAIN / STEP)
        lines = lines.stretches(~covered)
    return Curves(lines.xy * unit, lines.offsets, lines.kind, lines.closed), lines.source
