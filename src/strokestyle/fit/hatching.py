"""Sort a drawing's ink: lines on the curves, hatching, blots, and what is none of these.

A curve explains one line, which runs along it; the direction of ink is that of the structure tensor
(Bigun and Granlund 1987). Hatching is many short strokes of like direction side by side that lie on
no curve: of every piece of ink that goes straight on, the strokes beside it are counted. A blot is
ink much wider than the lines, as where hair or a shadow is filled in. Neither says how the artist
draws a line along a curve, so neither is trained on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from ..drawing.strokes import Strokes
from ..geometry.threads import each
from ..render.plan import Planned
from .observe import Observation
from .own_ink import nearest_strokes

# Set by hand on drawings with and without hatching; no ablation is kept.
INK, EDGE = 0.5, 0.25  # of the mask: what is ink, and what may be its soft edge
GRADIENT_SIGMA, TENSOR_SIGMA = 0.7, 1.8  # px, of the structure tensor
STEADY = 0.2  # coherence, from 0 to 1, from which ink has a direction
ALONG = np.cos(np.radians(30.0))  # of the angle between a curve and the ink that is drawn on it

# the lines on the curves
STEADY_POINTS = 7  # points of a stroke over whose median its ink's place is taken
SPARE = 1.5  # px to either side of a line's ink that may still be its own
SIDES = 0.35  # of the thickness, from the middle to where ink shows its direction
UNKNOWN_THICKNESS = 3.0  # px, where nothing was measured
CLEARANCE = 5.0  # px between a line and ink taken off, or what is seen there is not believed
SPECK = 6.0  # px of area: less ink beside all lines is none

# hatching; lengths are px of a canvas of 768, on which pens are not made smaller than on one of 460
REFERENCE, MIN_SCALE = 768.0, 0.6
DIRECTIONS = 16  # that are told apart
SHORTEST, LONG_ENOUGH = 11.0, 20.0  # a stroke goes on for so long, or for
SLENDER = 3.0  # times its width between the two
STRAIGHT = 0.85  # of which so much is ink
SOLID = 0.6  # of all directions: ink that goes on in so many has none
GAP, WIDTH = 14.0, 4.0  # px of paper between two neighbours, and of ink in one
LOOK = 40.0  # to either side within which neighbours are counted
STROKES, OUTERMOST = 4, 2  # side by side; and how many more at either edge have too few beside them
LONGEST = 0.35  # of the canvas: longer lines are ruled paper, or the drawing's own
MOST = 0.4  # of a patch of ink: where so much is hatching, all of it is

# blots
FAT, FAT_SPARE = 1.0, 1.0  # thickness, and px: half as wide ink is no line
WIDE_LINES = 0.8  # quantile of the thickness measured, which is that of the broadest lines
MIN_BLOT = 5.0  # thicknesses squared: a smaller blot is where lines meet


@dataclass(frozen=True)
class SortedInk:
    """A drawing's ink by what it is for; all (H, W).

    Parameters
    ----------
    lines : float32, the mask without hatching and blots
    hatching : bool
    blots : bool
    on_curves : bool, within reach of the ink that lies on curves
    """

    lines: np.ndarray
    hatching: np.ndarray
    blots: np.ndarray
    on_curves: np.ndarray

    @property
    def taken_off(self) -> np.ndarray:
        """(H, W) bool, hatching and blots."""
        return self.hatching | self.blots

    def believed(self, seen: Observation, xy: np.ndarray) -> Observation:
        """What was `seen` at points (N, 2) px, without those that ink taken off lies beside."""
        if not self.taken_off.any():
            return seen
        away = ndimage.distance_transform_edt(~self.taken_off)[_pixels(xy, self.lines.shape)]
        clear = away > 0.5 * seen.thickness + np.abs(seen.offset) + CLEARANCE
        return replace(seen, confidence=seen.confidence * clear)


def sort_ink(
    mask: np.ndarray, planned: Planned, normals: np.ndarray, measured: Observation
) -> SortedInk:
    """Sort the ink of a mask (H, W), given strokes on the curves and what lies across them.

    Parameters
    ----------
    mask : 1 = ink
    planned : strokes on the curves, N points
    normals : (N, 2) unit
    measured : at their points
    """
    field = ink_directions(mask)
    drawn = measured.confidence > 0
    drawn[drawn] = _drawn_along(field, planned, normals, measured, drawn)
    known = measured.thickness[drawn]
    broad = float(np.quantile(known, WIDE_LINES)) if len(known) else UNKNOWN_THICKNESS
    blots = find_blots(mask > INK, broad)
    drawn &= ~blots[_pixels(planned.xy + measured.offset[:, None] * normals, mask.shape)]
    lines = lines_on_curves(field, planned, normals, measured, drawn)
    rest = _without_specks((mask > INK) & ~lines, SPECK)
    blots &= rest
    hatching = find_hatching(rest & ~blots)
    off = ndimage.binary_dilation(hatching | blots, iterations=2) & ~lines
    return SortedInk(np.where(off, 0, mask).astype(np.float32), hatching, blots, lines)


class Directions(NamedTuple):
    """The direction of lines: unit vectors (H, W, 2), x and y, and their coherence (H, W)."""

    along: np.ndarray
    coherence: np.ndarray

    def agree(self, at: tuple[np.ndarray, np.ndarray], along: np.ndarray) -> np.ndarray:
        """|cosine| of the angle between the lines at pixels (y, x) and `along` (..., 2)."""
        return np.abs((self.along[at] * along).sum(axis=-1))


def ink_directions(mask: np.ndarray) -> Directions:
    """Find the direction of ink (H, W) by its structure tensor.

    The eigenvector of the lesser eigenvalue, and the difference of both by their sum.
    """
    gx, gy = each(
        lambda order: ndimage.gaussian_filter(mask, GRADIENT_SIGMA, order=order), ((0, 1), (1, 0))
    )
    xx, xy, yy = each(
        lambda part: ndimage.gaussian_filter(part, TENSOR_SIGMA), (gx * gx, gx * gy, gy * gy)
    )
    across = 0.5 * np.arctan2(2 * xy, xx - yy)
    coherence = np.hypot(xx - yy, 2 * xy) / np.maximum(xx + yy, 1e-9)
    return Directions(np.stack([-np.sin(across), np.cos(across)], axis=-1), coherence)


# ------------------------------------------------------------------------------ lines on the curves


def lines_on_curves(
    field: Directions,
    planned: Planned,
    normals: np.ndarray,
    measured: Observation,
    drawn: np.ndarray,
) -> np.ndarray:
    """Find the ink that lies on curves, (H, W) bool: one line for each, and SPARE px beside it.

    Where a point's ink is not `drawn` (N,) along its curve, it is taken to go on from the next that
    is.
    """
    known = measured.thickness[drawn]
    usual = float(np.median(known)) if len(known) else UNKNOWN_THICKNESS
    offset, thickness = np.zeros(len(planned.xy)), np.full(len(planned.xy), usual)
    for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
        at = np.flatnonzero(drawn[a:b])
        if not len(at):
            continue
        for values, out in ((measured.offset, offset), (measured.thickness, thickness)):
            steady = ndimage.median_filter(values[a:b][at], STEADY_POINTS, mode="nearest")
            out[a:b] = np.interp(np.arange(b - a), at, steady)
    thickness[~planned.on_curve & ~_runs_past(field, planned, offset, normals)] = -2 * SPARE
    placed = Strokes(
        planned.xy + offset[:, None] * normals,
        thickness + 2 * SPARE,
        planned.offsets,
        planned.kind,
        np.zeros(len(planned), bool),
    )
    return nearest_strokes(placed, field.coherence.shape[::-1], reach=1.0).distance < 0


def _drawn_along(
    field: Directions,
    planned: Planned,
    normals: np.ndarray,
    measured: Observation,
    rows: np.ndarray,
) -> np.ndarray:
    """Whether the ink measured at `rows` (N,) bool runs along its curve: (rows.sum(),) bool.

    It must to both sides of its middle, where a broad line may have no direction.
    """
    normal, thickness = normals[rows], measured.thickness[rows]
    along = np.stack([normal[:, 1], -normal[:, 0]], axis=1)
    out = np.ones(len(normal), bool)
    for share in (-SIDES, 0.0, SIDES):
        aside = measured.offset[rows] + share * thickness
        at = _pixels(planned.xy[rows] + aside[:, None] * normal, field.coherence.shape)
        agrees = field.agree(at, along) > ALONG
        out &= agrees | (field.coherence[at] < STEADY) if share == 0 else agrees
    return out


def _runs_past(
    field: Directions, planned: Planned, offset: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Whether lines go on where points lie past a curve's end: (N,) bool."""
    along = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    at = _pixels(planned.xy + offset[:, None] * normals, field.coherence.shape)
    return (field.agree(at, along) > ALONG) & (field.coherence[at] > STEADY)


def _pixels(xy: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels in which points (..., 2) px lie, or the nearest to them."""
    x, y = np.floor(xy[..., 0]).astype(int), np.floor(xy[..., 1]).astype(int)
    return np.clip(y, 0, shape[0] - 1), np.clip(x, 0, shape[1] - 1)


def _without_specks(ink: np.ndarray, least: float) -> np.ndarray:
    """Ink (H, W) bool without patches of less than `least` px of area."""
    label, _ = ndimage.label(ink, np.ones((3, 3)))
    area = np.bincount(label.ravel())
    area[0] = 0
    return (area >= least)[label]


# ------------------------------------------------------------------------------------------- blots


def find_blots(ink: np.ndarray, thickness: float) -> np.ndarray:
    """Find where `ink` (H, W) bool is far wider than lines of `thickness` px: (H, W) bool."""
    reach = FAT * thickness + FAT_SPARE
    core = ndimage.distance_transform_edt(ink) > reach
    if not core.any():
        return core
    grown = ndimage.distance_transform_edt(~core) <= reach + 1.0
    return _without_specks(grown & ink, MIN_BLOT * thickness**2)


# ---------------------------------------------------------------------------------------- hatching


def find_hatching(ink: np.ndarray) -> np.ndarray:
    """Find the hatching in ink (H, W) bool that lies on no curve, crossed hatching too."""
    scale = max(max(ink.shape) / REFERENCE, MIN_SCALE)
    if not ink.any():
        return ink
    # the mean of what is farthest from the edge by w / 2 is w / 4
    width = 4.0 * float(ndimage.distance_transform_edt(ink)[ink].mean())
    shortest = min(max(SHORTEST * scale, SLENDER * width), LONG_ENOUGH * scale)
    runs = _straight_runs(ink, shortest)
    core = np.zeros((len(runs), *ink.shape), bool)
    for k, run in enumerate(runs):
        points = np.nonzero(run)
        if not len(points[0]):
            continue
        like = run | runs[k - 1] | runs[(k + 1) % DIRECTIONS]
        beside = _beside(like, ink, points, k, GAP * scale, LOOK * scale)
        ruled = _runs_on(ink, points, k, LONGEST * max(ink.shape))
        core[k][points] = (beside + 1 >= STROKES) & ~ruled
    for _ in range(OUTERMOST):
        core = _with_outermost(core, runs, ink, GAP * scale)
    whole = _whole_strokes(np.asarray(core.any(axis=0)), ink, GAP * scale)
    return _large_patches(whole, GAP * scale, STROKES * shortest * width)


def _way(k: int) -> np.ndarray:
    """The unit vector (2,), x and y, of direction k of DIRECTIONS."""
    angle = np.pi * k / DIRECTIONS
    return np.array([np.cos(angle), np.sin(angle)])


def _shifted(
    points: tuple[np.ndarray, ...], by: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (y, x) moved by a vector (2,), x and y, and kept on the canvas."""
    y, x = points[0] + int(np.rint(by[1])), points[1] + int(np.rint(by[0]))
    return np.clip(y, 0, shape[0] - 1), np.clip(x, 0, shape[1] - 1)


def _straight_runs(ink: np.ndarray, length: float) -> np.ndarray:
    """Where ink goes straight on for `length` px in each direction: (DIRECTIONS, H, W) bool.

    The opening of the ink by segments. Ink that goes on in most directions is solid, and none.
    """
    points = np.nonzero(ink)
    steps = np.arange(-np.floor(length / 2), np.floor(length / 2) + 1)
    filled = np.zeros((DIRECTIONS, len(points[0])))
    for k in range(DIRECTIONS):
        for step in steps:
            filled[k] += ink[_shifted(points, step * _way(k), ink.shape)]
    straight = filled >= STRAIGHT * len(steps)
    straight &= straight.mean(axis=0) < SOLID
    out = np.zeros((DIRECTIONS, *ink.shape), bool)
    for k in range(DIRECTIONS):
        middle = points[0][straight[k]], points[1][straight[k]]
        for step in steps:
            out[k][_shifted(middle, step * _way(k), ink.shape)] = True
    return out & ink


def _beside(
    like: np.ndarray,
    ink: np.ndarray,
    points: tuple[np.ndarray, ...],
    k: int,
    gap: float,
    look: float,
) -> np.ndarray:
    """Count the strokes beside pixels (y, x) of direction k, to both sides of them: (n,).

    Each is at most `gap` px from the one before, and none farther than `look` px. Strokes are
    where `ink` (H, W) bool holds some `like` (H, W) bool.
    """
    normal = _way(k)[::-1] * [-1.0, 1.0]
    count = np.zeros(len(points[0]), int)
    for side in (1.0, -1.0):
        paper = np.zeros(len(count))  # px since the last ink
        inside = np.ones(len(count), bool)  # of a stroke that was counted
        for step in np.arange(1.0, look + 1.0):
            at = _shifted(points, side * step * normal, ink.shape)
            dark, new = ink[at], like[at] & ~inside & (paper <= gap)
            count += new
            inside = dark & (inside | new)
            paper = np.where(dark & (paper <= gap), 0.0, paper + 1.0)
    return count


def _runs_on(ink: np.ndarray, points: tuple[np.ndarray, ...], k: int, length: float) -> np.ndarray:
    """Whether ink goes on through pixels (y, x) in direction k for `length` px: (n,) bool."""
    filled = np.zeros(len(points[0]))
    for side in (1.0, -1.0):
        inked = np.ones(len(filled), bool)
        for step in np.arange(0.0, length, 2.0):
            inked &= ink[_shifted(points, side * step * _way(k), ink.shape)]
            if not inked.any():
                break
            filled += inked
    return filled * 2.0 >= length


def _with_outermost(core: np.ndarray, runs: np.ndarray, ink: np.ndarray, gap: float) -> np.ndarray:
    """Hatching (DIRECTIONS, H, W) bool and the strokes of like direction next to it.

    The first and the last few strokes have too few beside them to be sure alone.
    """
    out = core.copy()
    for k, run in enumerate(runs):
        points = np.nonzero(run & ~core[k])
        near = core[k] | core[k - 1] | core[(k + 1) % DIRECTIONS]
        if len(points[0]) and near.any():
            out[k][points] = _beside(near, ink, points, k, gap, gap + WIDTH) > 0
    return out


def _large_patches(found: np.ndarray, gap: float, least: float) -> np.ndarray:
    """Hatching (H, W) bool whose strokes have `least` px of area with those within `gap` px."""
    if not found.any():
        return found
    label, _ = ndimage.label(ndimage.distance_transform_edt(~found) <= 0.5 * gap, np.ones((3, 3)))
    return found & (np.bincount(label.ravel(), found.ravel()) >= least)[label]


def _whole_strokes(core: np.ndarray, ink: np.ndarray, gap: float) -> np.ndarray:
    """Whole strokes of hatching (H, W) bool, from what is sure of them."""
    if not core.any():
        return core
    label, _ = ndimage.label(ink, np.ones((3, 3)))
    share = np.bincount(label.ravel(), core.ravel()) / np.maximum(np.bincount(label.ravel()), 1)
    share[0] = 0.0
    near = ndimage.distance_transform_edt(~core) <= 0.5 * gap
    return (share > MOST)[label] | core | (ink & near)
