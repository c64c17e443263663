"""Where the hand sets the pen down and lifts it, as a drawing shows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..geometry.curves import arc
from ..render.plan import HEADING_SPAN, Planned, heading
from ..render.style import MIN_VISIBLE
from .observe import INK_LEVEL, sample_image

# A probe runs on from the end of a line, or beside it, straight on or nearly so
PROBE_STEP = 1.5  # px along it
PROBE_SIDES = np.array([0.0, -1.5, 1.5, -3.0, 3.0])  # px
PROBE_TURNS = np.array([0.0, -3.0, 3.0, -6.0, 6.0, -9.0, 9.0, -12.0, 12.0])  # degrees
SIDE_COST, TURN_COST = 0.5, 0.3  # px of ink that a px aside, and a degree, must bring at least
LINE_MARGIN = 2.0  # px around lines, as thick as they are drawn, where ink is taken for theirs
FEWEST_SAMPLES = 3  # of clear ink that make an overshoot
CLEAR_REACH = 30.0  # px past an end within which it must be seen whether the line runs on

END_LEVEL = 0.5  # of the thickness just before: a line that falls below this ends
CAP = 0.4  # of the thickness: where a round end is END_LEVEL of it, and where a square one ends
JUST_BEFORE = 2  # points
BLANK = 2  # invisible points in a row end a stroke
MAX_SHORT = 24.0  # px: a stroke that cannot be seen for longer than this before its end is faint
NO_OVERSHOOT = 1.5  # px, half a point's spacing: ends nearer to their curve's lie on it
BEYOND = np.array([3.0, 5.0, 7.0])  # px past an end, where other ink would hide where it lies
HIDING_INK = 0.5  # of the mask


@dataclass(frozen=True)
class Probes:
    """How far the ink runs on past the ends of lines, and which way.

    Parameters
    ----------
    past : (C, 2) px past both ends of C lines, 0 where the ink ends with them
    clear : (C, 2) bool, whether that can be told: where nothing but other lines' ink lies it cannot
    origin : (C, 2, 2) px, where the ink leaves the ends
    direction : (C, 2, 2), unit, in which it does
    """

    past: np.ndarray
    clear: np.ndarray
    origin: np.ndarray
    direction: np.ndarray

    def laid(self, planned: Planned, xy: np.ndarray) -> np.ndarray:
        """Lay the points of strokes that run past their ends on the ink there: (N, 2) px.

        `xy` (N, 2) px is where all points lie without.
        """
        out = xy.copy()
        for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
            over, inner = planned.overshoot[a:b], np.flatnonzero(planned.on_curve[a:b])
            for k, rows in enumerate((slice(0, inner[0]), slice(inner[-1] + 1, None))):
                if self.past[i, k] > 0:
                    out[a:b][rows] = self.origin[i, k] + over[rows, None] * self.direction[i, k]
        return out

    def drawn(self, planned: Planned) -> np.ndarray:
        """Where (N,) bool points past the ends of their curves lie on ink."""
        out = np.zeros(len(planned.xy), bool)
        for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
            over, inner = planned.overshoot[a:b], np.flatnonzero(planned.on_curve[a:b])
            out[a : a + inner[0]] = over[: inner[0]] <= self.past[i, 0]
            out[a + inner[-1] + 1 : b] = over[inner[-1] + 1 :] <= self.past[i, 1]
        return out


def probe_ends(
    lines: list[np.ndarray],
    mask: np.ndarray,
    thickness: float,
    reach: float,
    spacing: float,
    others: list[np.ndarray] | None = None,
) -> Probes:
    """Follow the ink past the ends of lines, straight on or nearly so, where no other line lies.

    Parameters
    ----------
    lines : C of them, (n, 2) px, two points at least
    mask : (H, W) of the drawing
    thickness : px, of the lines as they are drawn
    reach : px past the ends as far as which is looked
    spacing : px between the points of lines
    others : further lines, whose ink is theirs
    """
    if not lines:
        none = np.zeros((0, 2))
        return Probes(none, none.astype(bool), np.zeros((0, 2, 2)), np.zeros((0, 2, 2)))
    span = max(1, round(HEADING_SPAN / spacing))
    ends = [end for line in lines for end in (line[::-1], line)]
    at = np.array([line[-1] for line in ends])
    ahead = np.array([heading(line, span) for line in ends])
    turns = np.radians(np.repeat(PROBE_TURNS, len(PROBE_SIDES)))
    sides = np.tile(PROBE_SIDES, len(PROBE_TURNS))
    cost = SIDE_COST * np.abs(sides) + TURN_COST * np.degrees(np.abs(turns))
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    origin = at[:, None] + sides[:, None] * across[:, None]  # (2 C, rays, 2)
    direction = np.cos(turns)[:, None] * ahead[:, None] + np.sin(turns)[:, None] * across[:, None]
    along = np.arange(1, int(reach / PROBE_STEP) + 1) * PROBE_STEP
    samples = origin[:, :, None] + along[:, None] * direction[:, :, None]
    ink = sample_image(mask, samples) > INK_LEVEL
    apart = sample_image(_distance_to(lines + (others or []), mask.shape), samples)
    clear = apart > 0.5 * thickness + LINE_MARGIN
    on_ink = clear & ink & _before_blank(clear & ~ink)
    found = on_ink.sum(axis=2)
    best = (found * PROBE_STEP - cost).argmax(axis=1)
    each = np.arange(len(best))
    enough = found[each, best] >= FEWEST_SAMPLES
    past = np.where(enough, (on_ink[each, best] * along).max(axis=1), 0.0)
    seen = (clear[:, 0] & (along < CLEAR_REACH)).any(axis=1)  # the first ray runs straight on
    shape = (len(lines), 2)
    return Probes(
        past.reshape(shape), (seen | enough).reshape(shape),
        origin[each, best].reshape(*shape, 2), direction[each, best].reshape(*shape, 2),
    )  # fmt: skip


def _before_blank(blank: np.ndarray) -> np.ndarray:
    """Where (..., K) bool no two successive samples before are blank."""
    twice = blank.copy()
    twice[..., 1:] &= blank[..., :-1]
    twice[..., :1] = False
    return np.cumsum(twice, axis=-1) == 0


def _distance_to(lines: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """The distance (H, W), px, from every pixel to the nearest line."""
    free = np.ones(shape, bool)
    for line in lines:
        steps = np.arange(0, len(line) - 1 + 1e-9, 0.2)
        row = np.arange(len(line))
        x, y = (np.interp(steps, row, line[:, k]).astype(int) for k in (0, 1))
        inside = (x >= 0) & (y >= 0) & (x < shape[1]) & (y < shape[0])
        free[y[inside], x[inside]] = False
    return ndimage.distance_transform_edt(free)


def pen_ends(
    planned: Planned, thickness: np.ndarray, xy: np.ndarray, mask: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find where traced strokes begin and end.

    Parameters
    ----------
    planned : C strokes, N points, that run on as far as they may
    thickness : (N,) px, as traced: none where they are not drawn
    xy : (N, 2) px, where the points were traced
    mask : (H, W) of the drawing
    spacing : px between points

    Returns how far the strokes run past the ends of their curves, (C, 2) px, negative where they
    fall short; and where (C, 2) bool no other ink hides it.
    """
    past = np.zeros((len(planned), 2))
    shown = np.zeros((len(planned), 2), bool)
    span = max(1, round(HEADING_SPAN / spacing))
    for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
        for k, rows in enumerate((np.arange(b - 1, a - 1, -1), np.arange(a, b))):
            over, line = planned.overshoot[rows], xy[rows]
            past[i, k] = _past_end(thickness[rows], over == 0, arc(planned.xy[rows]))
            tip = line[over <= max(past[i, k], 0.0) + 0.5 * spacing]
            beyond = tip[-1] + BEYOND[:, None] * heading(tip, span)
            shown[i, k] = sample_image(mask, beyond).min() < HIDING_INK
    past[np.abs(past) < NO_OVERSHOOT] = 0.0
    return past, shown


def _past_end(thickness: np.ndarray, on_curve: np.ndarray, along: np.ndarray) -> float:
    """How far a stroke (n,) runs past the last point of its curve, px."""
    visible = thickness >= MIN_VISIBLE
    inner = np.flatnonzero(on_curve)
    seen = inner[visible[inner]]
    end = along[inner[-1]]
    if not len(seen) or end - along[seen[-1]] > min(MAX_SHORT, 0.3 * (end - along[inner[0]])):
        return 0.0  # it fades, which is a matter of its thickness
    k = int(seen[-1])
    while k + 1 < len(visible) and visible[k + 1 : k + 1 + BLANK].any():
        k += 1
    before = float(thickness[max(k - JUST_BEFORE, 0) : k + 1].max())
    level = max(MIN_VISIBLE, END_LEVEL * before)
    while k > 0 and thickness[k] < level:
        k -= 1
    ink_end = float(along[k])
    if k + 1 < len(along):
        drop = max(thickness[k] - thickness[k + 1], 1e-9)
        ink_end += float((thickness[k] - level) / drop * (along[k + 1] - along[k]))
    past = ink_end - float(end)
    # a pen's ink reaches farther than the pen, by about half its width
    if past > 0:
        return max(past - CAP * before, 0.0)
    return past - CAP * before if past < -NO_OVERSHOOT else 0.0
