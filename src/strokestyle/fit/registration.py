"""Register a drawing with the curves it was drawn over.

Found is the small shift, turn and scale that a scanner or camera adds, coarse to fine: blurred ink
and blurred curves are correlated over all shifts for a grid of angles and scales; the best start is
refined by matching ink to the nearest curve, across it (iterative closest points: Besl and McKay
1992; point to line: Chen and Medioni 1992), trusting near ink more and more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage
from scipy.spatial import cKDTree

# what is looked for: of the canvas, degrees, of size
MAX_SHIFT, MAX_ANGLE, MAX_SCALE = 0.07, 7.0, 0.07
COARSE = 192  # px, longer side of the images that are correlated
GRID_STEPS, BLUR = 9, 2.1  # angles, and scales, of the grid; px of these images
CLEARLY_BETTER = 1.003  # times the correlation of a smaller change, for a larger one to be tried
REACHES = (32.0, 16.0, 10.0, 7.0, 5.0, 4.0)  # px at 768; matches farther than this lose their say
ROUNDS = 6  # of matching for each
NORMAL_REACH = 7.0  # px at 768, between curve points that a normal is taken from
PRIOR = 1e-3  # of the mean diagonal of the normal equations, against any change
MAX_INK_POINTS = 6000  # pixels of ink that are matched
MIN_INK_POINTS, MIN_CURVE_POINTS = 50, 20  # below, nothing can be said
FIT = 14.0  # px at 768, beyond which a distance counts as no match, where fits are compared

# Share of the misfit that may be left for a shift, a turn, a scale to be taken. Forty drawings by
# ten simulated hands that lay right were left .90, .98 and .70 at least; 3 px or a degree of wrong
# leave .87 and .89 at most. A sheet that lies turned was scanned or photographed, and so may well
# be scaled.
ALLOWED_MISFIT, ALLOWED_MISFIT_TURNED = (0.88, 0.92, 0.65), 0.85
MIN_MOVE = 2.0  # px at 768 that a tenth of the ink must move by


@dataclass(frozen=True)
class Similarity:
    """p -> centre + scale * R(angle) (p - centre) + shift.

    Parameters
    ----------
    scale : factor
    angle : radians, from x towards y (clockwise on screen)
    shift, centre : px, x and y
    """

    scale: float
    angle: float
    shift: tuple[float, float]
    centre: tuple[float, float]

    @property
    def matrix(self) -> np.ndarray:
        """scale * R(angle), (2, 2)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return self.scale * np.array([[c, -s], [s, c]])

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Move points (..., 2) of the drawing to where they lie on the canvas."""
        return (xy - self.centre) @ self.matrix.T + self.centre + self.shift

    def back(self, xy: np.ndarray) -> np.ndarray:
        """Move points (..., 2) of the canvas to where they lie on the drawing."""
        return (xy - self.centre - np.array(self.shift)) @ np.linalg.inv(
            self.matrix
        ).T + self.centre

    def warp(self, image: np.ndarray) -> np.ndarray:
        """Move an image (H, W, K). What comes in from outside is its own edge, its paper."""
        height, width, depth = image.shape
        grid = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        x, y = np.moveaxis(self.back(grid) - 0.5, -1, 0)
        planes = [
            ndimage.map_coordinates(image[..., k], [y, x], order=3, mode="nearest")
            for k in range(depth)
        ]
        return np.stack(planes, axis=-1).astype(image.dtype)

    def __str__(self) -> str:
        parts = [f"moved {self.shift[0]:+.1f}, {self.shift[1]:+.1f} px"]
        parts += [f"turned {np.degrees(self.angle):+.1f} degrees"] if self.angle else []
        parts += [f"scaled by {self.scale:.3f}"] if self.scale != 1 else []
        return ", ".join(parts)


def register(mask: np.ndarray, curve_points: np.ndarray) -> Similarity | None:
    """Find how a drawing must be moved to lie on its curves; None where that helps little.

    A hand has its own way of drawing beside the line, above all of drawing larger, and that is not
    to be taken away: of a shift, a shift and turn, and these with a scale, each is taken only where
    it fits much better than the simpler.

    Parameters
    ----------
    mask : (H, W) float, 1 = ink
    curve_points : (N, 2) px, points of the curves a few px apart
    """
    ink, scale = _ink_points(mask), max(mask.shape) / 768.0
    if len(ink) < MIN_INK_POINTS or len(curve_points) < MIN_CURVE_POINTS:
        return None
    found, least = None, misfit(ink, curve_points, FIT * scale)
    starts = _coarse_starts(ink, curve_points, mask.shape)
    for free, start, allowed in zip((2, 3, 4), starts, ALLOWED_MISFIT, strict=True):
        tried = _refine(start, ink, curve_points, scale, free)
        left = misfit(tried(ink), curve_points, FIT * scale)
        if left < (ALLOWED_MISFIT_TURNED if found and found.angle else allowed) * least:
            found, least = tried, left
    if found is None:
        return None
    moved = np.hypot(*(found(ink) - ink).T)
    return found if np.quantile(moved, 0.9) > MIN_MOVE * scale else None


def misfit(ink: np.ndarray, curve_points: np.ndarray, far: float) -> float:
    """Mean distance from ink (M, 2) to curves (N, 2) and back, in units of `far`, where it ends.

    0 to 1.
    """
    there, _ = cKDTree(curve_points).query(ink, distance_upper_bound=far)
    back, _ = cKDTree(ink).query(curve_points, distance_upper_bound=far)
    return 0.5 * float(np.minimum(there, far).mean() + np.minimum(back, far).mean()) / far


def _ink_points(mask: np.ndarray) -> np.ndarray:
    """The middle of the ink, (M, 2) px, so that thick lines are as exact as thin ones."""
    inside = mask > 0.5
    depth = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    depth = np.pad(ndimage.gaussian_filter(depth, 1.0), 1)
    here = depth[1:-1, 1:-1]
    ridge = (here >= depth[:-2, 1:-1]) & (here >= depth[2:, 1:-1])
    ridge |= (here >= depth[1:-1, :-2]) & (here >= depth[1:-1, 2:])
    y, x = np.nonzero(inside & ridge)
    every = max(1, len(x) // MAX_INK_POINTS)
    return np.stack([x, y], axis=1)[::every] + 0.5


class _Correlator:
    """Correlates points with curves, blurred, over all shifts at once by the Fourier transform."""

    def __init__(self, curve_points: np.ndarray, shape: tuple[int, ...]):
        self.step = max(shape) / COARSE  # px a cell
        self.reach = int(MAX_SHIFT * COARSE)  # cells
        self.padded = [
            fft.next_fast_len(int(np.ceil(n / self.step)) + 2 * self.reach) for n in shape
        ]
        rows, columns = self.padded
        frequency = np.square(np.fft.fftfreq(rows))[:, None] + np.square(np.fft.rfftfreq(columns))
        blur = np.exp(-2 * np.square(np.pi * BLUR) * frequency)
        self.curves = np.conj(self._transformed(curve_points)[0]) * blur.astype(np.float32)

    def _transformed(self, xy: np.ndarray) -> tuple[np.ndarray, float]:
        """The transform of the cells that hold points, and the root of their number."""
        cells = np.zeros(self.padded, np.float32)
        cell = np.floor(xy / self.step).astype(int) + self.reach
        cell = cell[((cell >= 0) & (cell < self.padded[::-1])).all(axis=1)]
        cells[cell[:, 1], cell[:, 0]] = 1.0  # lines count by their length, whatever their thickness
        return fft.rfft2(cells), np.sqrt(cells.sum() + 1e-9)

    def best_shift(self, xy: np.ndarray) -> tuple[float, tuple[float, float]]:
        """The highest correlation of points (M, 2) with the curves, and the shift, px, to it."""
        points, size = self._transformed(xy)
        agreement = fft.irfft2(points * self.curves, self.padded) / size
        reach, window = self.reach, 2 * self.reach + 1
        near = np.roll(agreement, (reach, reach), (0, 1))[:window, :window]
        dy, dx = np.unravel_index(near.argmax(), near.shape)
        return near[dy, dx], ((reach - dx) * self.step, (reach - dy) * self.step)


def _coarse_starts(
    ink: np.ndarray, curve_points: np.ndarray, shape: tuple[int, ...]
) -> list[Similarity]:
    """The best shift, shift and turn, and similarity, of a grid."""
    correlator, centre = _Correlator(curve_points, shape), (0.5 * shape[1], 0.5 * shape[0])
    angles = np.radians(np.linspace(-MAX_ANGLE, MAX_ANGLE, GRID_STEPS)).tolist()
    scales = np.exp(np.linspace(-MAX_SCALE, MAX_SCALE, GRID_STEPS)).tolist()
    grid = [(angle, scale) for angle in angles for scale in scales]
    best, starts = [-np.inf] * 3, [Similarity(1.0, 0.0, (0.0, 0.0), centre)] * 3
    # small changes first, and larger ones only where they are better: a circle is not to be turned
    for angle, scale in sorted(grid, key=lambda one: abs(one[0]) + abs(np.log(one[1]))):
        agreement, shift = correlator.best_shift(Similarity(scale, angle, (0.0, 0.0), centre)(ink))
        for k, allowed in enumerate((scale == 1 and angle == 0, scale == 1, True)):
            if allowed and agreement > CLEARLY_BETTER * best[k]:
                best[k], starts[k] = agreement, Similarity(scale, angle, shift, centre)
    return starts


def _refine(
    start: Similarity, ink: np.ndarray, curve_points: np.ndarray, scale: float, free: int
) -> Similarity:
    """Match ink to the nearest curve, across it, by reweighted least squares.

    `free`: 2 for a shift, 3 for a turn too, 4 for a scale too.
    """
    tree = cKDTree(curve_points)
    normals = _normals(curve_points, tree, NORMAL_REACH * scale)
    centre = np.array(start.centre)
    linear, shift = start.matrix, np.array(start.shift)
    size = np.ptp(ink, axis=0).max() + 1.0
    for reach in np.repeat(REACHES, ROUNDS) * scale:
        at = (ink - centre) @ linear.T + shift  # from the centre
        far, index = tree.query(at + centre, distance_upper_bound=3 * reach)
        good = np.flatnonzero(np.isfinite(far))
        if len(good) < MIN_INK_POINTS:
            continue
        curve, at = index[good], at[good]
        step, move = _step(at, curve_points[curve] - centre - at, normals[curve], reach, size, free)
        linear, shift = step @ linear, step @ shift + move
    angle = float(np.arctan2(linear[1, 0], linear[0, 0])) if free > 2 else 0.0
    grown = float(np.hypot(*linear[:, 0])) if free > 3 else 1.0
    x, y = shift.tolist()
    return Similarity(grown, angle, (x, y), start.centre)


def _step(
    at: np.ndarray, to: np.ndarray, normal: np.ndarray, reach: float, size: float, free: int
) -> tuple[np.ndarray, np.ndarray]:
    """One step of matching: the matrix (2, 2) and the shift (2,) that bring points to their curves.

    Parameters
    ----------
    at : (n, 2) px, ink from the centre
    to : (n, 2) px, from there to the nearest curve point
    normal : (n, 2), of the curve there
    reach : px at which a match has lost most of its say
    size : px, of the ink, by which turn and growth are made comparable with a shift
    free : as in `_refine`
    """
    away = (to * normal).sum(axis=1)
    weight = 1.0 / (1.0 + (away / reach) ** 2) ** 2  # Geman and McClure
    turn = normal[:, 1] * at[:, 0] - normal[:, 0] * at[:, 1]
    grow = (at * normal).sum(axis=1)
    design = np.stack([*normal.T, turn / size, grow / size], axis=1)[:, :free]
    gram = (design * weight[:, None]).T @ design
    # what the curves do not tell, such as how far a circle is turned, stays as it is
    gram += PRIOR * np.trace(gram) / free * np.eye(free)
    change = np.zeros(4)
    change[:free] = np.linalg.solve(gram, (design * weight[:, None]).T @ away)
    by, growth = change[2:] / size
    matrix = np.array([[1 + growth, -by], [by, 1 + growth]])
    return matrix / (1.0 if free == 4 else np.hypot(1, by)), change[:2]


def _normals(points: np.ndarray, tree: cKDTree, reach: float) -> np.ndarray:
    """Unit directions (N, 2) across the line that the points within `reach` of each lie on."""
    _, index = tree.query(points, k=5, distance_upper_bound=reach)
    near = points[np.where(index < len(points), index, index[:, :1])]
    d = near - near.mean(axis=1, keepdims=True)
    xx, yy, xy = (d[..., 0] ** 2).sum(1), (d[..., 1] ** 2).sum(1), (d[..., 0] * d[..., 1]).sum(1)
    along = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.stack([-np.sin(along), np.cos(along)], axis=1)
