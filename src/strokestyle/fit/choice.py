"""Find which of the lines of a view an artist drew, and how far along."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ..extract.view import View
from ..geometry.curves import Curves, arc_length, owner, tangents
from ..geometry.threads import each
from ..render.choice import ALL_DRAWN, LineChoice, chosen_points, learn_choice, without_short_runs
from ..render.config import StyleConfig
from .align import aligned_curves
from .observe import sample_image

REFERENCE = 768.0  # px, the longer side of the canvas that lengths are given for
MIN_SCALE = 0.6  # of them, on a small canvas: pens are not made as small
REACH, REACH_STEP = 20.0, 1.0  # px to either side within which a line's ink is sought
# Directions of ink: px of the Gaussian that gradients are taken of, and, in median half widths of
# the ink, of that over which they are gathered
GRADIENT_SIGMA, GATHER_HALF_WIDTHS, MIN_GATHER = 0.8, 0.7, 2.0
ALONG, ACROSS = 20.0, 50.0  # degrees between ink and line: surely one way, surely crossing
# Evidence of one point, as log odds: of no ink, of ink at its best; the ink that is worth nothing
BARE, INKED, NO_EVIDENCE = -1.4, 1.4, 0.4
OFFSET_SPREADS = 7.0, 2.5  # px: what a hand is off at first, and at least once it is measured
SWITCH = 7.0  # log odds that a change from drawn to not drawn must be worth
SLIP = 0.7  # log odds a px by which the ink's offset changes from point to point
SAME_INK, SAME_WAY = 3.0, 30.0  # px and degrees: nearer claims are of one stroke
CLAIM_SPAN = 20.0  # px along a line over which its offset from the ink is averaged
FAINT = 45.0  # px of line without ink, where all else says that there was a stroke
MIN_DRAWN = 0.05  # share of the points of lines; of less no choice is learned
NEARER = 1.5  # px, by which a line must lie nearer to ink than another for it to be its alone


@dataclass(frozen=True)
class InkField:
    """Where a mask holds the middle of strokes, and which way these run.

    Parameters
    ----------
    middle : (H, W) in 0..1, 1 in the middle of a stroke, falling to 0 at its edges
    double_angle : (H, W, 2), coherence times cosine and sine of twice the strokes' angle
    """

    middle: np.ndarray
    double_angle: np.ndarray

    @classmethod
    def of(cls, mask: np.ndarray) -> InkField:
        """Read the field off a mask (H, W), 1 = ink."""
        depth = ndimage.distance_transform_edt(np.pad(mask > 0.5, 1))[1:-1, 1:-1]
        depth = depth + np.where(mask > 0.5, 0.0, mask)
        ridge = (depth >= ndimage.maximum_filter(depth, 3)) & (depth >= 1.0)
        half = float(np.median(depth[ridge])) if ridge.any() else 1.0
        size = 2 * int(np.ceil(half)) + 1
        peak = np.maximum(ndimage.maximum_filter(depth, size), 1.0)
        middle = np.clip(depth / peak, 0.0, 1.0) * np.clip(mask / 0.5, 0.0, 1.0)
        gather = max(MIN_GATHER, GATHER_HALF_WIDTHS * half)
        gx, gy = each(
            lambda order: ndimage.gaussian_filter(mask, GRADIENT_SIGMA, order=order),
            ((0, 1), (1, 0)),
        )
        xx, yy, xy = each(
            lambda part: ndimage.gaussian_filter(part, gather), (gx * gx, gy * gy, gx * gy)
        )
        # strokes run at right angles to the gradient
        turned = np.stack([yy - xx, -2.0 * xy], axis=-1)
        return cls(middle, turned / np.maximum(xx + yy, 1e-9)[..., None])

    def evidence(self, xy: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Tell how far ink at points (..., 2) runs along `tangent` (..., 2), (...) in 0..1."""
        middle = sample_image(self.middle, xy)
        c, s = (sample_image(self.double_angle[..., k], xy) for k in (0, 1))
        coherence = np.hypot(c, s)
        tx, ty = tangent[..., 0], tangent[..., 1]
        agree = c * (tx * tx - ty * ty) + s * 2.0 * tx * ty  # coherence * cos(2 angle)
        cosine = np.where(coherence > 1e-6, agree / np.maximum(coherence, 1e-6), 1.0)
        low, high = np.cos(np.radians([2 * ACROSS, 2 * ALONG]))
        along = np.clip((cosine - low) / (high - low), 0.0, 1.0)
        return middle * (1.0 - np.clip(coherence, 0.0, 1.0) * (1.0 - along))


@dataclass(frozen=True)
class DrawnLines:
    """What an artist drew of the lines of a view.

    Parameters
    ----------
    view : the lines that were drawn, as far as they were
    choice : which lines the artist chooses, or None where all were drawn, or too few to tell
    about : for a model's provenance: "lines_drawn" of "lines", and "share_drawn" of their length
    """

    view: View
    choice: LineChoice | None
    about: dict[str, int | float]


def learn_lines(view: View, mask: np.ndarray) -> DrawnLines:
    """Find the lines that a drawing has, and learn how they were chosen.

    Parameters
    ----------
    view : the shape as it was drawn, with the lines that could have been drawn
    mask : (H, W) float, the drawing's ink, 1 = stroke; of the view's size
    """
    curves, expected = view.curves, view.required
    there = aligned_curves(view, mask, StyleConfig(size=max(mask.shape)))
    drawn = find_drawn(there, mask, ~expected)
    if not drawn.any() or drawn.mean() < MIN_DRAWN:
        # where hardly anything lies on a line, that is no choice of lines
        taken = replace(view.only(expected), optional=None)
        return DrawnLines(taken, None, _counted(curves, drawn & expected, expected))
    if (expected & drawn).sum() >= ALL_DRAWN * expected.sum():
        drawn = drawn | expected
    choice = learn_choice(view, drawn)
    meant = expected if choice is None else chosen_points(view, choice)
    drawn = _without_accidents(view, drawn, meant)
    choice = learn_choice(view, drawn)
    # who has no use for optional lines was not offered any; ink on them is that of others
    offered = np.ones_like(expected)
    if choice is None or choice.optional is None:
        offered, drawn = expected, drawn & expected
    return DrawnLines(
        replace(view.only(drawn), optional=None), choice, _counted(curves, drawn, offered)
    )


def _counted(curves: Curves, drawn: np.ndarray, offered: np.ndarray) -> dict[str, int | float]:
    """Count the lines drawn of those offered, both by their points (N,) bool."""
    if not len(curves):
        return {"lines_drawn": 0, "lines": 0, "share_drawn": 1.0}
    points, drawn_points = (
        np.add.reduceat(1.0 * of, curves.offsets[:-1]) for of in (offered, drawn & offered)
    )
    return {
        "lines_drawn": int((drawn_points > 0.5 * points).sum()),
        "lines": int((points > 0).sum()),
        "share_drawn": round(float(drawn_points.sum() / points.sum()), 4),
    }


def _without_accidents(view: View, drawn: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Take short gaps in lines, and ends, for drawn where no law leaves them out: ink was faint."""
    line = owner(view.curves.offsets)
    along = arc_length(view.curves.xy, view.curves.offsets)
    gap = FAINT * max(view.camera.width, view.camera.height) / REFERENCE
    return drawn | (expected & without_short_runs(drawn, line, along, False, gap))


def find_drawn(curves: Curves, mask: np.ndarray, doubtful: np.ndarray | None = None) -> np.ndarray:
    """Tell which points of curves a drawing has ink for, (N,) bool.

    Ink speaks for a line where it lies within REACH and runs the same way, so that strokes that
    cross it do not; where several lines could have been meant by one stroke, it is that of the
    nearest. Along a line this is decided at once, by the best path through its offsets and a state
    of not being drawn (Viterbi 1967), so that neither a gap of a few pixels nor a blot counts.

    Parameters
    ----------
    curves : candidates, in pixels of the mask, points evenly spaced
    mask : (H, W) float, 1 = ink
    doubtful : (N,) bool, points that have no ink which others could have; by default none
    """
    if not len(curves):
        return np.zeros(0, bool)
    scale = max(max(mask.shape) / REFERENCE, MIN_SCALE)
    tangent = tangents(curves.xy, curves.offsets, curves.closed)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    q = np.arange(-REACH, REACH + 0.5 * REACH_STEP, REACH_STEP) * scale
    probes = curves.xy[:, None] + q[None, :, None] * normal[:, None]
    ink = InkField.of(mask).evidence(probes, np.broadcast_to(tangent[:, None], probes.shape))
    gain = np.where(
        ink < NO_EVIDENCE,
        BARE * (1.0 - ink / NO_EVIDENCE),
        INKED * (ink - NO_EVIDENCE) / (1.0 - NO_EVIDENCE),
    )
    spread = OFFSET_SPREADS[0] * scale
    offset = _best_offsets(curves, gain, q, spread, scale)
    known = np.isfinite(offset)
    if known.any():
        spread = np.clip(2.0 * np.median(np.abs(offset[known])), OFFSET_SPREADS[1] * scale, spread)
        offset = _best_offsets(curves, gain, q, float(spread), scale)
    handicap = 0.0 if doubtful is None else 2.0 * NEARER * scale * doubtful
    taken = _taken(curves, offset, tangent, normal, scale, handicap)
    if taken.any():
        gain[taken] = np.minimum(gain[taken], BARE)
        offset = _best_offsets(curves, gain, q, float(spread), scale)
    return np.isfinite(offset)


def _best_offsets(
    curves: Curves, gain: np.ndarray, q: np.ndarray, spread: float, scale: float
) -> np.ndarray:
    """Find the offset (N,) px of the ink of each point, nan where it was not drawn.

    Parameters
    ----------
    gain : (N, Q) log odds of having been drawn, with the ink at offset q
    q : (Q,) px
    spread : px, standard deviation of the offsets
    scale : px that a px of the reference canvas is
    """
    gain = gain - 0.5 * np.square(q / spread) * (INKED / 4.0)
    slip = SLIP * np.abs(q[:, None] - q[None, :]) / scale
    out = np.full(len(gain), np.nan)
    for a, b in zip(curves.offsets[:-1], curves.offsets[1:], strict=True):
        path = _best_path(gain[a:b], slip)
        out[a:b] = np.where(path < len(q), q[np.minimum(path, len(q) - 1)], np.nan)
    return out


def _best_path(gain: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Find the best state of each point of a line (n,): an offset 0..Q-1, or Q, not drawn."""
    count, width = gain.shape
    score, back = np.r_[gain[0], 0.0], np.zeros((count, width + 1), np.int64)
    for i in range(1, count):
        stay = score[:width, None] - slip
        best = stay.argmax(axis=0)
        inside = stay[best, np.arange(width)]
        start = score[width] - SWITCH
        back[i, :width] = np.where(inside >= start, best, width)
        end = int(score[:width].argmax())
        leave = score[end] - SWITCH
        back[i, width] = width if score[width] >= leave else end
        score = np.r_[np.maximum(inside, start) + gain[i], max(score[width], leave)]
    path = np.empty(count, np.int64)
    path[-1] = score.argmax()
    for i in range(count - 1, 0, -1):
        path[i - 1] = back[i, path[i]]
    return path


def _taken(
    curves: Curves,
    offset: np.ndarray,
    tangent: np.ndarray,
    normal: np.ndarray,
    scale: float,
    handicap: np.ndarray | float,
) -> np.ndarray:
    """Tell which points claim ink that belongs to another line, which lies nearer to it, (N,).

    Parameters
    ----------
    offset : (N,) px, of the ink that each point claims, nan where it claims none
    tangent, normal : (N, 2) unit
    scale : px that a px of the reference canvas is
    handicap : (N,) px, by which points count as farther from it than they are
    """
    claims = np.flatnonzero(np.isfinite(offset))
    out = np.zeros(len(offset), bool)
    if len(claims) < 2:
        return out
    line = owner(curves.offsets)
    along = arc_length(curves.xy, curves.offsets)
    mean = _mean_along(np.abs(offset), along, line, CLAIM_SPAN * scale)
    mean = mean + handicap
    at = curves.xy[claims] + offset[claims, None] * normal[claims]
    # points of two lines may lie half a step apart along them
    step = np.hypot(*np.diff(curves.xy[:2], axis=0)[0])
    near = np.hypot(SAME_INK * scale, 0.5 * step)
    pairs = cKDTree(at).query_pairs(near, output_type="ndarray").reshape(-1, 2)
    a, b = claims[pairs.T]
    cosine = np.abs((tangent[a] * tangent[b]).sum(axis=1))
    rival = (line[a] != line[b]) & (cosine > np.cos(np.radians(SAME_WAY)))
    a, b = a[rival], b[rival]
    out[a[mean[a] > mean[b] + NEARER * scale]] = True
    out[b[mean[b] > mean[a] + NEARER * scale]] = True
    return out


def _mean_along(values: np.ndarray, along: np.ndarray, line: np.ndarray, span: float) -> np.ndarray:
    """Average finite values (N,) over `span` px to either side of each point along its line."""
    known = np.isfinite(values)
    total = np.r_[0.0, np.cumsum(np.where(known, values, 0.0))]
    count = np.r_[0, np.cumsum(known)]
    # lines laid end to end, farther apart than the span
    place = along + line * (along.max() + 2.0 * span + 1.0)
    first = np.searchsorted(place, place - span, "left")
    last = np.searchsorted(place, place + span, "right")
    return (total[last] - total[first]) / np.maximum(count[last] - count[first], 1)
