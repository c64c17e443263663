"""From a view to numbers: planned strokes, and the features of their points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..extract.view import View
from ..geometry.curves import Curves, arc_length, gaussian, is_kind, owner, tangents
from ..geometry.kinds import KIND_TABLE
from .config import StyleConfig
from .plan import Planned, plan_strokes

PROMINENCE = np.array([kind.prominence for kind in KIND_TABLE])
END_SCALES = (10.0, 40.0, 120.0)  # px, decay lengths of what is felt of a stroke's ends
MAX_END_SCALE = 0.3  # of a stroke's length: on a stroke too short for them, tapers shrink with it
# px: scale on which a bend is measured, and the radius at which its feature is half of its most
BEND_SCALES = ((6.0, 20.0), (14.0, 45.0))
OVERSHOOT_UNIT = 24.0  # px past an end that count as 1
LENGTH_UNIT = 100.0  # px, length of a stroke whose logarithm counts as 0
SURFACE_SIGMA = 6.0  # px, Gaussian along a stroke of what is read off the surface
HEADING_SIGMA = 4.0  # px, Gaussian of a stroke before its tangents are taken
OUTWARD_SIGMA = 10.0  # px along a contour over which the side of the shape is decided
DEPTH_RANGE = (3, 97)  # percentiles of the view's depth that count as 0 and 1
FACING_SOFTNESS = 0.04  # added to a normal's squared length: where it is short, no way is faced
# degrees from x towards y: directions that a nib is held in, half as far apart as the lobes of the
# features are wide, so that a nib held in any other is a sum of two neighbours
NIB_ANGLES = (0.0, 22.5, 45.0, 67.5)
BOTH_SIDES = (-1.5, 0.0, 1.5)  # px across a line at which the surface is read
SURFACE = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y")  # read off the maps
FEATURES = (
    *(f"start_{n:.0f}" for n in END_SCALES),
    *(f"end_{n:.0f}" for n in END_SCALES),
    *("before", "after", "past_start", "past_end", "along", "log_length"),
    *(f"bend_{n:.0f}" for n, _ in BEND_SCALES),
    *(f"turn_{n:.0f}" for n, _ in BEND_SCALES),
    *("depth", "n_dot_v", "view_curvature", "facing_x", "facing_y"),
    *("height", "tangent_x", "tangent_y", "prominence"),
    *(f"nib_{n:.0f}" for n in NIB_ANGLES),
)


class ViewRange(NamedTuple):
    """Between what a view's lines lie: the depths that count as 0 and 1, and its top and bottom."""

    near: float
    far: float
    top: float
    bottom: float

    @classmethod
    def of(cls, planned: Planned, surface: np.ndarray, spacing: float) -> ViewRange:
        """Measure planned strokes, at least one; `surface` (N, 5) is SURFACE at their points."""
        on_curve = planned.on_curve
        depth = along_strokes(surface[:, :1], planned.offsets, SURFACE_SIGMA, spacing)[:, 0]
        near, far = np.percentile(depth[on_curve], DEPTH_RANGE)
        y = planned.xy[on_curve, 1]
        return cls(float(near), float(far), float(y.min()), float(y.max()))


@dataclass(frozen=True)
class FeatureScaling:
    """Cut features to the range of the training strokes, centre and scale them.

    Parameters
    ----------
    low, high, centre, spread : (P,) float64
    names : (P,), of FEATURES, in their order; an older style lacks those that came later
    """

    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    spread: np.ndarray
    names: tuple[str, ...] = FEATURES

    def __call__(self, features: np.ndarray) -> np.ndarray:
        """Normalise features (N, P)."""
        return (np.clip(features, self.low, self.high) - self.centre) / self.spread


def plan(view: View, config: StyleConfig, scale: float = 1.0) -> Planned:
    """Plan the strokes of a view, in px of the style's canvas.

    `scale` is how many px of the view one of the style's canvas is.
    """
    curves = view.curves
    if scale != 1.0:
        curves = Curves(curves.xy / scale, curves.offsets, curves.kind, curves.closed)
    return plan_strokes(
        curves,
        config.spacing,
        config.join_gap,
        config.corner_angle,
        config.max_overshoot,
        cut_tolerance=config.cut_tolerance,
    )


def point_features(
    planned: Planned,
    surface: np.ndarray,
    config: StyleConfig,
    names: tuple[str, ...] = FEATURES,
    within: ViewRange | None = None,
) -> np.ndarray:
    """Measure features at every point of planned strokes, (N, P) float64.

    Arc length, tangent and the features of the surface are the paper's; those of a stroke's ends,
    its overshoot, bends, prominence and the nib are ours.

    Parameters
    ----------
    planned : strokes, N points
    surface : (N, 5), SURFACE where the points lie
    config : its spacing is used
    names : of FEATURES, in the order of the columns
    within : what depth and height are measured by; None: what these strokes lie between
    """
    if not len(planned):
        return np.zeros((0, len(names)))
    within = within or ViewRange.of(planned, surface, config.spacing)
    columns = (
        _end_features(planned)
        | _bend_features(planned, config.spacing)
        | _surface_features(planned, surface, config.spacing, within)
        | _place_features(planned, config.spacing, within)
    )
    return np.stack([columns[name] for name in names], axis=1)


def _end_features(planned: Planned) -> dict[str, np.ndarray]:
    """Where a point lies between the ends of its curve, or past them; of its stroke, if lifted."""
    stroke = owner(planned.offsets)
    on_curve = planned.on_curve | planned.lifted
    along = arc_length(planned.xy, planned.offsets)
    begin, end = np.full(len(planned), np.inf), np.full(len(planned), -np.inf)
    np.minimum.at(begin, stroke[on_curve], along[on_curve])
    np.maximum.at(end, stroke[on_curve], along[on_curve])
    from_start, to_end = along - begin[stroke], end[stroke] - along
    length = np.maximum(end - begin, 1e-6)[stroke]
    columns = {
        "before": np.maximum(-from_start, 0) / OVERSHOOT_UNIT,
        "after": np.maximum(-to_end, 0) / OVERSHOOT_UNIT,
        "past_start": from_start < 0,
        "past_end": to_end < 0,
        "along": np.clip(from_start / length, 0, 1),
        "log_length": np.log(length / LENGTH_UNIT),
    }
    for side, distance in (("start", from_start), ("end", to_end)):
        for n in END_SCALES:
            scale = np.minimum(n, MAX_END_SCALE * length)
            columns[f"{side}_{n:.0f}"] = np.exp(-np.maximum(distance, 0) / scale)
    return columns


def _bend_features(planned: Planned, spacing: float) -> dict[str, np.ndarray]:
    """How sharply a stroke bends, in [0, 1), and which way, in (-1, 1), on several scales."""
    columns = {}
    for sigma, radius in BEND_SCALES:
        turn = curvature(planned, sigma, spacing) * radius
        columns[f"bend_{sigma:.0f}"] = turn**2 / (1 + turn**2)
        columns[f"turn_{sigma:.0f}"] = turn / np.sqrt(1 + turn**2)
    return columns


def _surface_features(
    planned: Planned, surface: np.ndarray, spacing: float, within: ViewRange
) -> dict[str, np.ndarray]:
    """What is seen of the surface: its depth within the view, and how it faces the eye."""
    maps = along_strokes(surface, planned.offsets, SURFACE_SIGMA, spacing)
    depth, normal = maps[:, 0], maps[:, 3:]
    near, far = within.near, within.far
    facing = normal / np.sqrt((normal**2).sum(axis=1, keepdims=True) + FACING_SOFTNESS)
    return {
        "depth": np.clip((depth - near) / max(far - near, 1e-6), 0, 1),
        "n_dot_v": maps[:, 1],
        "view_curvature": maps[:, 2],
        "facing_x": facing[:, 0],
        "facing_y": facing[:, 1],
    }


def _place_features(planned: Planned, spacing: float, within: ViewRange) -> dict[str, np.ndarray]:
    """Where on the drawing a stroke lies, which way it runs, and of what kind it is."""
    y, top, bottom = planned.xy[:, 1], within.top, within.bottom
    smooth = along_strokes(planned.xy, planned.offsets, HEADING_SIGMA, spacing, pin=True)
    tangent = tangents(smooth, planned.offsets)
    return nib_features(tangent) | {
        "height": np.clip((y - top) / max(bottom - top, 1e-6), 0, 1),
        "tangent_x": tangent[:, 0],
        "tangent_y": tangent[:, 1],
        "prominence": PROMINENCE[planned.kind][owner(planned.offsets)],
    }


def nib_features(tangent: np.ndarray) -> dict[str, np.ndarray]:
    """How far a stroke of unit tangents (N, 2) runs along a nib: cos 2 (heading - nib's angle).

    A flat nib draws the same line forth and back, so that its width has the period of half a turn,
    which no sum of a curve of t_x and a curve of t_y has; four directions of it have all of them.
    """
    double = 2 * np.arctan2(tangent[:, 1], tangent[:, 0])
    return {f"nib_{n:.0f}": np.cos(double - 2 * np.radians(n)) for n in NIB_ANGLES}


def surface_at(view: View, spacing: float) -> np.ndarray:
    """Read SURFACE at the points of a view's curves, (N, 5) float64.

    It is the mean of a line's two sides, for a crease has two normals. On an occluding contour the
    normal is known better than a pixel can show it: n.v is 0, and the normal in the image lies at
    right angles to the line, out of the shape.
    """
    curves = view.curves
    t = tangents(curves.xy, curves.offsets, curves.closed)
    across = np.stack([-t[:, 1], t[:, 0]], axis=1)
    probes = np.concatenate([curves.xy + k * across for k in BOTH_SIDES])
    read = view.at_curves(SURFACE, probes).reshape(len(BOTH_SIDES), len(across), len(SURFACE))
    out = read.mean(axis=0, dtype=np.float64)
    outward = (out[:, 3:] * across).sum(axis=1)
    side = np.where(along_strokes(outward, curves.offsets, OUTWARD_SIGMA, spacing) < 0, -1.0, 1.0)
    contour = is_kind(curves.kind, ("contour",))[owner(curves.offsets)]
    out[contour, 1] = 0.0
    out[contour, 3:] = (side[:, None] * across)[contour]
    return out


def along_strokes(
    values: np.ndarray, offsets: np.ndarray, sigma: float, spacing: float, pin: bool = False
) -> np.ndarray:
    """Blur values (N,) or (N, k) along every stroke by a Gaussian of `sigma` px.

    Parameters
    ----------
    offsets : (C+1,), stroke i is rows offsets[i]:offsets[i+1]
    spacing : px between two points
    pin : reflect through the end points, so that they stay; otherwise they are repeated
    """
    sigma = sigma / spacing
    count = np.diff(offsets)
    radius = int(4 * sigma + 0.5)  # of the filter's kernel
    # all strokes at once, each run on by the radius to either side
    stroke = np.repeat(np.arange(len(count)), count + 2 * radius)
    first = (np.asarray(offsets[:-1]) + 2 * radius * np.arange(len(count)))[stroke]
    place, last = np.arange(len(stroke)) - first - radius, count[stroke] - 1
    if pin:  # as `curves.blurred` does
        reach = np.minimum(int(4 * sigma) + 1, last)
        place = np.clip(place, -reach, last + reach)
    inside = np.clip(place, 0, last)
    begin = np.asarray(offsets[:-1])[stroke]
    longer = values[begin + inside]
    if pin:
        outside = np.flatnonzero(place != inside)
        mirrored = values[(begin + 2 * inside - place)[outside]]
        longer[outside] = 2 * longer[outside] - mirrored
    smooth = gaussian(longer, sigma)
    own = (np.arange(len(stroke)) - first >= radius) & (
        np.arange(len(stroke)) - first < radius + count[stroke]
    )
    return smooth[own]


def curvature(planned: Planned, sigma: float, spacing: float) -> np.ndarray:
    """Signed curvature (N,), 1/px, of strokes under a Gaussian of `sigma` px.

    It is positive where a stroke turns towards its normal (-t_y, t_x): clockwise on the picture.
    """
    smooth = along_strokes(planned.xy, planned.offsets, sigma, spacing, pin=True)
    heading = tangents(smooth, planned.offsets)
    first, last = planned.offsets[:-1], planned.offsets[1:] - 1
    before, after = np.arange(len(heading)) - 1, np.arange(len(heading)) + 1
    before[first], after[last] = first, last
    a, b = heading[before], heading[after]
    turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return turn / (spacing * np.maximum(after - before, 1))
