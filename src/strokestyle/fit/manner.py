"""Where the hand lifts the pen: at which corners, on which curves, as a drawing shows it.

A corner may be drawn through, or the pen be lifted there and set down anew. The drawing tells by
what the ends of its strokes look like where there can be no doubt: whether they run past the ends
of their curves, and how they taper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from ..extract.view import View
from ..geometry.curves import blurred, simplify
from ..geometry.threads import each
from ..render.config import StyleConfig
from ..render.displacement import CUTS, across_strokes
from ..render.features import plan
from ..render.plan import CUT_SIGMA, HEADING_SPAN, Planned, corners, turns
from .observe import INK_LEVEL, measure_across, sample_image
from .pen_ends import Probes, probe_ends

REACH = 72.0  # px past ends as far as which ink is followed
REACH_SHARE = 95  # percentile of the overshoots that strokes are planned to reach
REACH_MARGIN = 6.0  # px beyond it
SOFTEST_CORNER = 25.0  # degrees: a softer turn is no corner
CORNER_ANGLES = np.arange(SOFTEST_CORNER, 111.0, 5.0)  # degrees that may be the least
SURE_CORNER = 110.0  # degrees: at a sharper one a pen is lifted, whatever is seen

# What speaks for a lift is a logarithm of odds, as if every end told something of its own
FALSE_SHOT = 0.05  # chance that ink is followed where there is no end
HABITUAL, MOST_SHOTS = (
    0.35,
    0.9,
)  # chances of an overshoot at an end from, and up to, which it tells
NEAR, FAR = slice(2, 5), slice(6, 13)  # points from an end: the thickness here against there
MIN_TAPER_SPREAD = 0.15  # of its logarithm
FEWEST_TAPERS = 4
MOVED_SIGMA = 15.0  # px, Gaussian along a line of where it is moved to
LEAST_WIDTH, BARE_INK = 0.3, 0.2  # px, for where there is no ink; of the mask: there is none
CALM_TURN, CALM_STEP = 15.0, 4  # degrees; points between two looks at a calm line
MAX_EVIDENCE = 2.5  # of one thing at one corner
MIN_GAIN = 2.0  # of evidence, without which the setting stays
DOUBT = 0.1  # of evidence, for each degree that the least corner is away from the setting
CUT_DOUBT = 6.0  # of evidence, for lifts at the corners of a polyline
CUT_SHOTS = 0.6  # chance of an overshoot there
MOST_CORNERS = 0.5  # of a polyline's corners, that ink must run past
LEAST_COVERED = 0.6  # of its sides that ink lies on


def learn_manner(view: View, mask: np.ndarray, config: StyleConfig) -> StyleConfig:
    """Find at which corners of a view the pen was lifted, and how far strokes may run past ends.

    Parameters
    ----------
    view : the shape as it was drawn
    mask : (H, W) of the drawing
    config : what holds where the drawing tells nothing

    Returns `config` with its `corner_angle`, `cut_tolerance` and `max_overshoot` as learned.
    """
    whole = replace(config, max_overshoot=0.0, corner_angle=180.0, cut_tolerance=0.0)
    planned = plan(view, whole)
    if not len(planned):
        return config
    lines = _Lines.of(planned, mask, config.spacing)
    ends = lines.ends()
    corner_angle = _least_corner(ends, lines.through(), config.corner_angle)
    tolerance, past = _cut_tolerance(lines, corner_angle)
    past = np.r_[past, [end.past for end in ends if end.turn > corner_angle and end.clear]]
    habit = len(past) > 0 and np.mean(past > 0) >= HABITUAL
    reach = np.percentile(past, REACH_SHARE) + REACH_MARGIN if habit else 0.0
    return replace(
        config,
        corner_angle=config.corner_angle if tolerance else corner_angle,
        cut_tolerance=tolerance,
        max_overshoot=float(max(config.max_overshoot, np.ceil(reach))),
    )


class _End(NamedTuple):
    """What is seen where a stroke would end: at a corner, or with its line.

    Parameters
    ----------
    corner : index of the corner, -1 where the line ends
    turn : degrees, 180 where the line ends
    past : px by which ink runs on
    clear : whether that can be told
    taper : logarithm of the thickness near the end against that farther away; NaN = not known
    """

    corner: int
    turn: float
    past: float
    clear: bool
    taper: float

    @property
    def shot(self) -> bool:
        return self.past > 0


@dataclass(frozen=True)
class _Lines:
    """The lines of a view where a drawing has them, drawn through all corners.

    Parameters
    ----------
    planned : on the curves
    xy : (N, 2) px, moved onto the ink as a whole, not point by point
    log_width : (N,) of the ink there, NaN where it is not known
    mask : (H, W)
    spacing : px between points
    """

    planned: Planned
    xy: np.ndarray
    log_width: np.ndarray
    mask: np.ndarray
    spacing: float

    @classmethod
    def of(cls, planned: Planned, mask: np.ndarray, spacing: float) -> _Lines:
        across = across_strokes(planned.xy, planned.offsets, spacing)
        seen = measure_across(mask, planned, across)
        known = seen.confidence > 0
        xy = planned.xy.copy()
        for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
            weight = gaussian_filter1d(seen.confidence[a:b], MOVED_SIGMA / spacing, mode="nearest")
            pull = gaussian_filter1d(
                seen.confidence[a:b] * seen.offset[a:b], MOVED_SIGMA / spacing, mode="nearest"
            )
            xy[a:b] += (pull / np.maximum(weight, 0.05))[:, None] * across[a:b]
        log_width = np.where(known, np.log(np.maximum(seen.thickness, LEAST_WIDTH)), np.nan)
        bare = ~known & (sample_image(mask, xy) < BARE_INK)
        return cls(planned, xy, np.where(bare, np.log(LEAST_WIDTH), log_width), mask, spacing)

    @property
    def thickness(self) -> float:
        """The usual thickness, px."""
        known = self.log_width[np.isfinite(self.log_width)]
        return float(np.exp(np.median(known))) if len(known) else 0.0

    @property
    def span(self) -> int:
        return max(1, round(HEADING_SPAN / self.spacing))

    def rows(self) -> list[np.ndarray]:
        """The rows of each line."""
        offsets = self.planned.offsets
        return [np.arange(a, b) for a, b in zip(offsets[:-1], offsets[1:], strict=True)]

    def ends(self) -> list[_End]:
        """What is seen at the ends of the lines, and before and after all corners."""
        pieces, where, count = [], [], 0
        for rows in self.rows():
            line = self.planned.xy[rows]
            found = corners(line, SOFTEST_CORNER, self.span)
            turn = turns(line, self.span)[found] if len(found) else np.zeros(0)
            marks = np.r_[0, found, len(rows) - 1]
            number = [-1, *range(count, count + len(found)), -1]
            degrees = np.r_[180.0, turn, 180.0]
            for k in range(len(marks) - 1):
                pieces.append(rows[marks[k] : marks[k + 1] + 1])
                where.append([(number[j], degrees[j]) for j in (k, k + 1)])
            count += len(found)
        probes = probe_ends(
            [self.xy[rows] for rows in pieces], self.mask, self.thickness, REACH, self.spacing
        )
        ends = []
        for i, rows in enumerate(pieces):
            for k, inward in enumerate((rows, rows[::-1])):
                past, clear = probes.past[i, k], probes.clear[i, k]
                ends.append(_End(*where[i][k], past, clear, self.taper(inward)))
        return ends

    def taper(self, rows: np.ndarray) -> float:
        """How much thinner a line is near its end, the first of `rows`, than farther away."""
        near, far = (self.log_width[rows[part]] for part in (NEAR, FAR))
        if np.isfinite(near).sum() < 2 or np.isfinite(far).sum() < 2:
            return np.nan
        return float(np.nanmean(near) - np.nanmedian(far))

    def through(self) -> np.ndarray:
        """Tapers (K,) where the pen is not lifted for certain: amid lines, far from any corner."""
        found = []
        for rows in self.rows():
            if len(rows) < 2 * self.span + 1:
                continue
            bend = maximum_filter1d(turns(self.planned.xy[rows], self.span), 2 * FAR.stop)
            calm = np.flatnonzero(bend < CALM_TURN)
            calm = calm[(calm >= FAR.stop) & (calm < len(rows) - FAR.stop)]
            for row in calm[::CALM_STEP]:
                found += [self.taper(rows[row:]), self.taper(rows[row::-1])]
        return np.array(found)


# ------------------------------------------------------------------------------------------ corners


def _least_corner(ends: list[_End], through: np.ndarray, setting: float) -> float:
    """The least turn, degrees, at which the pen is lifted, as far as the drawing tells."""
    evidence, degrees = _evidence(ends, through)
    if not len(evidence):
        return setting
    gain = [
        evidence[degrees > angle].sum() - DOUBT * abs(angle - setting) for angle in CORNER_ANGLES
    ]
    kept = evidence[degrees > setting].sum()
    return float(CORNER_ANGLES[int(np.argmax(gain))]) if max(gain) > kept + MIN_GAIN else setting


def _evidence(ends: list[_End], through: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How much speaks for a lift at each corner (K,), and by how much it turns, degrees (K,)."""
    sure = [end for end in ends if end.turn > SURE_CORNER]
    told = [end.shot for end in sure if end.clear]
    chance = min((sum(told) + 1) / (len(told) + 2), MOST_SHOTS)
    shot, no_shot = np.log(chance / FALSE_SHOT), np.log((1 - chance) / (1 - FALSE_SHOT))
    if chance < HABITUAL:  # ink that is seen past a corner now and then is as likely another line's
        shot = no_shot = 0.0
    ended = _spread(np.array([end.taper for end in sure]))
    passed = _spread(through) or (0.0, MIN_TAPER_SPREAD)  # amid a line it is about as thick
    found: dict[int, float] = {}
    degrees: dict[int, float] = {}
    for end in ends:
        if end.corner < 0:
            continue
        degrees[end.corner] = end.turn
        for_lift = (shot if end.shot else no_shot) if end.clear else 0.0
        if np.isfinite(end.taper) and ended:
            # of one spread: what is far from both speaks for neither
            spread = max(ended[1], passed[1])
            off = np.array([end.taper - passed[0], end.taper - ended[0]]) / spread
            odds = 0.5 * (off[0] ** 2 - off[1] ** 2)
            for_lift += float(np.clip(odds, -MAX_EVIDENCE, MAX_EVIDENCE))
        found[end.corner] = found.get(end.corner, 0.0) + for_lift
    return np.array(list(found.values())), np.array(list(degrees.values()))


def _spread(values: np.ndarray) -> tuple[float, float] | None:
    """The median of what is known, and its spread; None where next to nothing is."""
    known = values[np.isfinite(values)]
    if len(known) < FEWEST_TAPERS:
        return None
    middle = float(np.median(known))
    return middle, max(1.4826 * float(np.median(np.abs(known - middle))), MIN_TAPER_SPREAD)


# ---------------------------------------------------------------------------------- straight pieces


def _cut_tolerance(lines: _Lines, least_corner: float) -> tuple[float, np.ndarray]:
    """The tolerance, px, of the polyline at whose corners the pen is lifted; 0 = at no such.

    Of several whose corners the ink runs past, it is that of the one that the ink lies on best.
    Returns also the overshoots (K,), px, that were seen at its corners.
    """
    best, found, past = 0.0, 0.0, np.zeros(0)
    others = [lines.xy[rows] for rows in lines.rows()]

    def cut(tolerance: float) -> tuple[list[np.ndarray], np.ndarray, Probes]:
        pieces, inner = _straight_pieces(lines, tolerance, least_corner)
        probes = probe_ends(pieces, lines.mask, lines.thickness, REACH, lines.spacing, others)
        return pieces, inner, probes

    for tolerance, (pieces, inner, probes) in zip(CUTS, each(cut, CUTS), strict=True):
        told = probes.clear & inner
        shot = probes.past[told] > 0
        if not shot.any() or shot.mean() < MOST_CORNERS:
            continue
        odds = np.where(shot, CUT_SHOTS / FALSE_SHOT, (1 - CUT_SHOTS) / (1 - FALSE_SHOT))
        covered = float((sample_image(lines.mask, np.concatenate(pieces)) > INK_LEVEL).mean())
        if np.log(odds).sum() > CUT_DOUBT and covered > max(best, LEAST_COVERED):
            best, found, past = covered, tolerance, probes.past[told]
    return found, past


def _straight_pieces(
    lines: _Lines, tolerance: float, least_corner: float
) -> tuple[list[np.ndarray], np.ndarray]:
    """Cut lines in straight pieces, each (n, 2) px.

    Returns also which of their ends (C, 2) lie at corners that only such a cut makes.
    """
    pieces, inner = [], []
    for rows in lines.rows():
        line = lines.planned.xy[rows]
        marks = simplify(blurred(line, CUT_SIGMA / lines.spacing), tolerance)
        soft = np.zeros(len(rows), bool)
        if len(rows) > 2 * lines.span:
            soft[marks[1:-1]] = turns(line, lines.span)[marks[1:-1]] < least_corner
        for a, b in zip(marks[:-1], marks[1:], strict=True):
            steps = np.linspace(0, 1, b - a + 1)[:, None]
            pieces.append(line[a] + steps * (line[b] - line[a]))
            inner.append([soft[a], soft[b]])
    return pieces, np.array(inner).reshape(-1, 2)
