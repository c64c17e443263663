"""From a view to numbers: planned strokes and their point features."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..extract.view import View
from ..geometry.curves import KINDS, Curves, arc_length, blurred, owner, tangents
from ..geometry.kinds import KIND_TABLE
from .config import StyleConfig
from .plan import Planned, plan_strokes

PROMINENCE = np.array([kind.prominence for kind in KIND_TABLE])
ENDS = (10.0, 40.0, 120.0)  # px, scales on which a stroke's ends are felt
SHORT = 0.3  # of a stroke's length, and never a longer scale than this
BENDS = (
    (6.0, 20.0),
    (14.0, 45.0),
)  # px, scale of measuring a bend and the radius at which it counts half
SURFACE = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y")  # read off the maps
FEATURES = (
    *(f"start_{n:.0f}" for n in ENDS), *(f"end_{n:.0f}" for n in ENDS),
    "before", "after", "past_start", "past_end", "along", "log_length",
    *(f"bend_{n:.0f}" for n, _ in BENDS), *(f"turn_{n:.0f}" for n, _ in BENDS),
    "depth", "n_dot_v", "view_curvature", "facing_x", "facing_y", "height", "tangent_x", "tangent_y", "prominence",
)  # fmt: skip


def plan(view: View, config: StyleConfig, scale: float = 1.0) -> Planned:
    """The strokes to be drawn, in px of the style's canvas."""
    curves = view.curves
    if scale != 1.0:
        curves = Curves(curves.xy / scale, curves.offsets, curves.kind, curves.closed)
    return plan_strokes(curves, config.spacing, config.join, config.corner, config.extend)


def point_features(planned: Planned, surface: np.ndarray, config: StyleConfig) -> np.ndarray:
    """FEATURES at every point of planned strokes, (N, P) float64. Curve features as in the paper (arc length, tangent)
    and those of the stroke's making; surface features as in the paper, SURFACE (N, 5) where the curve lies."""
    if not len(planned):
        return np.zeros((0, len(FEATURES)))
    maps = along_strokes(surface, planned.offsets, 6.0, config.spacing)
    which, within = owner(planned.offsets), planned.beyond == 0
    along = arc_length(planned.xy, planned.offsets)
    begin = np.full(len(planned), np.inf)
    end = np.full(len(planned), -np.inf)
    np.minimum.at(begin, which[within], along[within])
    np.maximum.at(end, which[within], along[within])
    from_start, to_end, length = (
        along - begin[which],
        end[which] - along,
        np.maximum(end - begin, 1e-6)[which],
    )
    before, after = np.maximum(-from_start, 0), np.maximum(-to_end, 0)
    # on a stroke too short for them, tapers shrink with it
    columns = [np.exp(-np.maximum(from_start, 0) / np.minimum(n, SHORT * length)) for n in ENDS]
    columns += [np.exp(-np.maximum(to_end, 0) / np.minimum(n, SHORT * length)) for n in ENDS]
    columns += [
        before / 24.0,
        after / 24.0,
        from_start < 0,
        to_end < 0,
        np.clip(from_start / length, 0, 1),
        np.log(length / 100.0),
    ]
    turns = [curvature(planned, sigma, config.spacing) * radius for sigma, radius in BENDS]
    columns += [turn**2 / (1 + turn**2) for turn in turns]
    columns += [turn / np.sqrt(1 + turn**2) for turn in turns]
    depth = maps[:, 0]
    near, far = np.percentile(depth[within], [3, 97])
    columns += [np.clip((depth - near) / max(far - near, 1e-6), 0, 1), maps[:, 1], maps[:, 2]]
    columns += list((maps[:, 3:] / np.sqrt((maps[:, 3:] ** 2).sum(axis=1, keepdims=True) + 0.04)).T)
    y = planned.xy[:, 1]
    top, bottom = y[within].min(), y[within].max()
    columns += [np.clip((y - top) / max(bottom - top, 1e-6), 0, 1)]
    smooth = along_strokes(planned.xy, planned.offsets, 4.0, config.spacing, pin=True)
    columns += list(tangents(smooth, planned.offsets).T)
    columns += [PROMINENCE[planned.kind][which]]
    return np.stack(columns, axis=1)


def surface_at(view: View, spacing: float) -> np.ndarray:
    """SURFACE at the curves' points (M, 5): the mean of both sides of a line, for a crease has two normals.

    On an occluding contour the normal is known better than a pixel can show it: at right angles to the line and to the
    view, out of the shape.
    """
    curves = view.curves
    t = tangents(curves.xy, curves.offsets, curves.closed)
    across = np.stack([-t[:, 1], t[:, 0]], axis=1)
    three = np.concatenate([curves.xy + k * across for k in (-1.5, 0, 1.5)])
    out = (
        view.at_curves(SURFACE, three)
        .reshape(3, len(across), len(SURFACE))
        .mean(axis=0, dtype=np.float64)
    )
    outward = along_strokes((out[:, 3:] * across).sum(axis=1), curves.offsets, 10.0, spacing)
    contour = (curves.kind == KINDS.index("contour"))[owner(curves.offsets)]
    out[contour, 1] = 0.0
    out[contour, 3:] = (np.where(outward < 0, -1.0, 1.0)[:, None] * across)[contour]
    return out


def along_strokes(
    values: np.ndarray, offsets: np.ndarray, sigma: float, spacing: float, pin: bool = False
) -> np.ndarray:
    """Gaussian of `sigma` px along every stroke. `pin` reflects through the end points, so that these stay."""
    out = np.empty_like(values)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        if pin:
            out[a:b] = blurred(values[a:b], sigma / spacing)
        else:
            out[a:b] = ndimage.gaussian_filter1d(
                values[a:b], sigma / spacing, axis=0, mode="nearest"
            )
    return out


def curvature(planned: Planned, sigma: float, spacing: float) -> np.ndarray:
    """Signed curvature (N,), 1/px, of the strokes smoothed by `sigma` px; positive where turning to (-t_y, t_x)."""
    heading = tangents(
        along_strokes(planned.xy, planned.offsets, sigma, spacing, pin=True), planned.offsets
    )
    first, last = planned.offsets[:-1], planned.offsets[1:] - 1
    before, after = np.arange(len(heading)) - 1, np.arange(len(heading)) + 1
    before[first], after[last] = first, last
    a, b = heading[before], heading[after]
    turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    return turn / (spacing * np.maximum(after - before, 1))
