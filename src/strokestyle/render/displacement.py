"""How a stroke is moved off its curve: a basis of displacements, and their weighted sum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import owner, simplify, tangents
from .features import HEADING_SIGMA, along_strokes
from .plan import CUT_SIGMA, HEADING_SPAN, Planned

SMOOTHINGS = (3.0, 6.0, 12.0, 24.0)  # px, Gaussians under which a curve may be rounded off
CUTS = (3.0, 6.0, 12.0)  # px, tolerances with which a curve may be cut straight
INFLATE_SIGMA = 12.0  # px, Gaussian along the stroke of the normals that it is inflated along
DEFORMATIONS = (
    *(f"smooth_{n:.0f}" for n in SMOOTHINGS),
    *(f"cut_{n:.0f}" for n in CUTS),
    "inflate",
)


@dataclass(frozen=True)
class Frame:
    """Planned strokes, and how each of their points can be moved.

    Parameters
    ----------
    xy : (N, 2) float64, px
    normals : (N, 2) float64, unit, (-t_y, t_x) of the tangent t of the smoothed stroke: with y
        down, to the right of one who walks along it
    deformations : (N, M, 2) float64, px, what each of DEFORMATIONS at full strength does to a point
    offsets : (C+1,) int64, stroke i is rows offsets[i]:offsets[i+1]
    on_curve : (N,) bool, False where a point lies past the end of its curve
    """

    xy: np.ndarray
    normals: np.ndarray
    deformations: np.ndarray
    offsets: np.ndarray
    on_curve: np.ndarray

    @classmethod
    def of(
        cls,
        planned: Planned,
        surface: np.ndarray,
        spacing: float,
        weights: np.ndarray | None = None,
    ) -> Frame:
        """Measure planned strokes.

        Parameters
        ----------
        surface : (N, 5), SURFACE at their points
        spacing : px between two of them
        weights : (M,), for `displaced`: what has none is left at 0
        """
        normals = across_strokes(planned.xy, planned.offsets, spacing)
        deformations = deformations_of(planned, surface[:, 3:], spacing, weights)
        return cls(planned.xy, normals, deformations, planned.offsets, planned.on_curve)

    def part(self, rows: np.ndarray, offsets: np.ndarray, on_curve: np.ndarray) -> Frame:
        """Keep some rows (n,), which `offsets` cut into strokes, `on_curve` (n,) where they are."""
        deformations = self.deformations[rows]
        return Frame(self.xy[rows], self.normals[rows], deformations, offsets, on_curve)

    def across(self, vectors: np.ndarray) -> np.ndarray:
        """Measure vectors (N, 2) along the normals: (N,)."""
        return (vectors * self.normals).sum(axis=1)

    def deformations_across(self) -> np.ndarray:
        """Measure the deformations along the normals: (N, M) px."""
        return (self.deformations * self.normals[:, None]).sum(axis=2)


def across_strokes(xy: np.ndarray, offsets: np.ndarray, spacing: float) -> np.ndarray:
    """Unit normals (N, 2) of smoothed strokes, (-t_y, t_x) of their tangents."""
    t = tangents(along_strokes(xy, offsets, HEADING_SIGMA, spacing, pin=True), offsets)
    return np.stack([-t[:, 1], t[:, 0]], axis=1)


def deformations_of(
    planned: Planned, normals: np.ndarray, spacing: float, weights: np.ndarray | None = None
) -> np.ndarray:
    """The displacement (N, M, 2), px, of each of DEFORMATIONS at full strength.

    smooth_S moves a point to where a Gaussian of S px takes its curve, whose ends stay; cut_T to
    the polyline that stays within T px of the curve; inflate by 1 px along the surface's normal.
    Points past an end lie straight on from where the curve's end is moved to, as its heading turns.
    A stroke that lies past its curve altogether, lifted shorter than that is, stays where it is.

    Parameters
    ----------
    planned : the strokes
    normals : (N, 2), the surface's normals in the image
    spacing : px between two points
    weights : (M,); a deformation of weight 0 is not measured, and left at 0. None: all are
    """
    wanted = np.ones(len(DEFORMATIONS), bool) if weights is None else np.asarray(weights) != 0
    out = np.zeros((len(planned.xy), len(DEFORMATIONS), 2))
    inner = np.flatnonzero(planned.on_curve)
    stroke = owner(planned.offsets)[inner]
    curves = np.searchsorted(stroke, np.arange(len(planned) + 1))
    whole = np.unique(curves)  # without those that no point lies on
    out[inner] = _deformations_of_curves(planned.xy[inner], normals[inner], whole, spacing, wanted)
    for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
        if curves[i] == curves[i + 1]:
            continue
        first, end = inner[curves[i]], inner[curves[i + 1] - 1] + 1
        span = min(max(1, round(HEADING_SPAN / spacing)), end - first - 1)
        over = planned.overshoot[:, None, None] / max(span * spacing, 1e-9)
        out[a:first] = out[first] + over[a:first] * (out[first] - out[first + span])
        out[end:b] = out[end - 1] + over[end:b] * (out[end - 1] - out[end - 1 - span])
    return out


def _deformations_of_curves(
    xy: np.ndarray, normals: np.ndarray, offsets: np.ndarray, spacing: float, wanted: np.ndarray
) -> np.ndarray:
    """The displacement (N, M, 2) of curves' points (N, 2) by each `wanted` of DEFORMATIONS."""
    moved = np.zeros((len(xy), len(DEFORMATIONS), 2))
    cuts = len(SMOOTHINGS)
    for k in np.flatnonzero(wanted).tolist():
        if k < cuts:
            moved[:, k] = along_strokes(xy, offsets, SMOOTHINGS[k], spacing, pin=True) - xy
        elif k < cuts + len(CUTS):
            smooth = along_strokes(xy, offsets, CUT_SIGMA, spacing, pin=True)
            moved[:, k] = _cut_straight(smooth, offsets, CUTS[k - cuts]) - xy
        else:
            moved[:, k] = along_strokes(normals, offsets, INFLATE_SIGMA, spacing)
    return moved


def _cut_straight(xy: np.ndarray, offsets: np.ndarray, tolerance: float) -> np.ndarray:
    """Lay points of curves (N, 2) on the chords that stay within `tolerance` px of them."""
    out = np.empty_like(xy)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        keep = a + simplify(xy[a:b], tolerance)
        for axis in (0, 1):
            out[a:b, axis] = np.interp(np.arange(a, b), keep, xy[keep, axis])
    return out


def displaced(frame: Frame, weights: np.ndarray) -> np.ndarray:
    """Move the points of strokes by `weights` (M,) of the deformations: (N, 2) px."""
    return frame.xy + (frame.deformations * weights[:, None]).sum(1)
