"""Where a drawing lies on the curves it was drawn over: the small shift, turn and scale that a scanner or camera adds.

Found coarse to fine: blurred ink and blurred curves are correlated over all shifts for a grid of angles and scales;
the best start is refined by matching ink to the nearest curve, across it (iterative closest points: Besl and McKay
1992; point to line: Chen and Medioni 1992), trusting near ink more and more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage
from scipy.spatial import cKDTree

MOST_SHIFT, MOST_ANGLE, MOST_SCALE = (
    0.07,
    7.0,
    0.07,
)  # of the canvas, degrees, of size: what is looked for
COARSE = 192  # px, longer side of the images that are correlated
STEPS, BLUR = 9, 2.1  # angles, and scales, of the grid; px of these images
REACHES = (32.0, 16.0, 10.0, 7.0, 5.0, 4.0)  # px at 768; matches farther than this lose their say
TURNS = 6  # rounds of matching for each
INK = 6000  # pixels of ink that are matched
LEAST_INK, LEAST_POINTS = 50, 20  # below, nothing can be said
FIT = 14.0  # px at 768, beyond which a distance counts as no match, where fits are compared

# Share of the misfit that may be left for a shift, a turn, a scale to be taken. Forty drawings by ten simulated hands
# that lay right were left .90, .98 and .70 at least; 3 px or a degree of wrong leave .87 and .89 at most. A sheet that
# lies turned was scanned or photographed, and so may well be scaled.
HELPS, HELPS_TURNED = (0.88, 0.92, 0.65), 0.85
MOVES = 2.0  # px at 768 that a tenth of the ink must move by


@dataclass(frozen=True)
class Similarity:
    """p -> centre + scale * R(angle) (p - centre) + shift; angle in radians, from x towards y (clockwise on screen)."""

    scale: float
    angle: float
    shift: tuple[float, float]
    centre: tuple[float, float]

    @property
    def matrix(self) -> np.ndarray:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return self.scale * np.array([[c, -s], [s, c]])

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Points (..., 2) of the drawing -> where they lie on the canvas."""
        return (xy - self.centre) @ self.matrix.T + self.centre + self.shift

    def back(self, xy: np.ndarray) -> np.ndarray:
        """Points (..., 2) of the canvas -> where they lie on the drawing."""
        return (xy - self.centre - np.array(self.shift)) @ np.linalg.inv(
            self.matrix
        ).T + self.centre

    def warp(self, image: np.ndarray) -> np.ndarray:
        """The image (H, W, K) moved. What comes in from outside is the image's own edge, its paper."""
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
    """How a drawing must be moved to lie on its curves, or None where that would not clearly help.

    A hand has its own way of drawing beside the line, above all of drawing larger, and that is not to be taken away: of
    a shift, a shift and turn, and these with a scale, each is taken only where it fits much better than the simpler.

    Parameters
    ----------
    mask : (H, W) float, 1 = ink
    curve_points : (N, 2) px, points of the curves a few px apart
    """
    ink, scale = _ink(mask), max(mask.shape) / 768.0
    if len(ink) < LEAST_INK or len(curve_points) < LEAST_POINTS:
        return None
    found, least = None, misfit(ink, curve_points, FIT * scale)
    for free, start, share in zip(
        (2, 3, 4), _coarse(ink, curve_points, mask.shape), HELPS, strict=True
    ):
        tried = _refine(start, ink, curve_points, scale, free)
        left = misfit(tried(ink), curve_points, FIT * scale)
        if left < (HELPS_TURNED if found and found.angle else share) * least:
            found, least = tried, left
    moved = np.hypot(*(found(ink) - ink).T) if found else np.zeros(1)
    return found if np.quantile(moved, 0.9) > MOVES * scale else None


def misfit(ink: np.ndarray, curve_points: np.ndarray, far: float) -> float:
    """Mean distance from ink to curves and from curves to ink, in units of `far`, where it ends. 0 to 1."""
    there, _ = cKDTree(curve_points).query(ink, distance_upper_bound=far)
    back, _ = cKDTree(ink).query(curve_points, distance_upper_bound=far)
    return 0.5 * float(np.minimum(there, far).mean() + np.minimum(back, far).mean()) / far


def _ink(mask: np.ndarray) -> np.ndarray:
    """The middle of the ink, (M, 2) px, so that thick lines are as exact as thin ones."""
    inside = mask > 0.5
    depth = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    depth = np.pad(ndimage.gaussian_filter(depth, 1.0), 1)
    here = depth[1:-1, 1:-1]
    ridge = (here >= depth[:-2, 1:-1]) & (here >= depth[2:, 1:-1])
    ridge |= (here >= depth[1:-1, :-2]) & (here >= depth[1:-1, 2:])
    y, x = np.nonzero(inside & ridge)
    every = max(1, len(x) // INK)
    return np.stack([x, y], axis=1)[::every] + 0.5


def _coarse(ink: np.ndarray, curve_points: np.ndarray, shape: tuple[int, int]) -> list[Similarity]:
    """The best shift, shift and turn, and similarity, of a grid; all shifts at once by the Fourier transform."""
    step = max(shape) / COARSE
    reach = int(MOST_SHIFT * COARSE)
    padded = [fft.next_fast_len(int(np.ceil(n / step)) + 2 * reach) for n in shape]
    centre = (0.5 * shape[1], 0.5 * shape[0])

    def transformed(xy):
        out = np.zeros(padded, np.float32)
        cell = np.floor(xy / step).astype(int) + reach
        cell = cell[((cell >= 0) & (cell < padded[::-1])).all(axis=1)]
        out[cell[:, 1], cell[:, 0]] = 1.0  # lines count by their length, whatever their thickness
        return fft.rfft2(out), np.sqrt(out.sum() + 1e-9)

    frequency = np.square(np.fft.fftfreq(padded[0]))[:, None] + np.square(
        np.fft.rfftfreq(padded[1])
    )
    blur = np.exp(-2 * np.square(np.pi * BLUR) * frequency)
    curves = np.conj(transformed(curve_points)[0]) * blur.astype(np.float32)
    angles = np.radians(np.linspace(-MOST_ANGLE, MOST_ANGLE, STEPS)).tolist()
    scales = np.exp(np.linspace(-MOST_SCALE, MOST_SCALE, STEPS)).tolist()
    grid = [(angle, scale) for angle in angles for scale in scales]
    best, starts = [-np.inf] * 3, [None] * 3
    # small changes first, and larger ones only where they are better: a circle is not to be turned
    for angle, scale in sorted(grid, key=lambda one: abs(one[0]) + abs(np.log(one[1]))):
        turned, size = transformed(Similarity(scale, angle, (0.0, 0.0), centre)(ink))
        agreement = fft.irfft2(turned * curves, padded) / size
        near = np.roll(agreement, (reach, reach), (0, 1))[: 2 * reach + 1, : 2 * reach + 1]
        dy, dx = np.unravel_index(near.argmax(), near.shape)
        here = Similarity(scale, angle, ((reach - dx) * step, (reach - dy) * step), centre)
        for k, allowed in enumerate((scale == 1 and angle == 0, scale == 1, True)):
            if allowed and near[dy, dx] > 1.003 * best[k]:
                best[k], starts[k] = near[dy, dx], here
    return starts


def _refine(
    start: Similarity, ink: np.ndarray, curve_points: np.ndarray, scale: float, free: int
) -> Similarity:
    """Ink to the nearest curve, across it, by reweighted least squares. `free`: 2 shift, 3 and turn, 4 and scale."""
    tree = cKDTree(curve_points)
    normal = _normals(curve_points, tree, 7.0 * scale)
    centre = np.array(start.centre)
    linear, shift = start.matrix, np.array(start.shift)
    size = np.ptp(ink, axis=0).max() + 1.0
    for reach in np.repeat(REACHES, TURNS) * scale:
        at = (ink - centre) @ linear.T + shift  # from the centre
        far, index = tree.query(at + centre, distance_upper_bound=3 * reach)
        good = np.flatnonzero(np.isfinite(far))
        if len(good) < LEAST_INK:
            continue
        p, n = at[good], normal[index[good]]
        away = ((curve_points[index[good]] - centre - p) * n).sum(axis=1)
        weight = 1.0 / (1.0 + (away / reach) ** 2) ** 2  # Geman and McClure
        turn, grow = n[:, 1] * p[:, 0] - n[:, 0] * p[:, 1], (p * n).sum(axis=1)
        design = np.stack([*n.T, turn / size, grow / size], axis=1)[:, :free]
        gram = (design * weight[:, None]).T @ design
        # what the curves do not tell, such as how far a circle is turned, stays as it is
        gram += 1e-3 * np.trace(gram) / free * np.eye(free)
        change = np.zeros(4)
        change[:free] = np.linalg.solve(gram, (design * weight[:, None]).T @ away)
        turn, grow = change[2:] / size
        step = np.array([[1 + grow, -turn], [turn, 1 + grow]]) / (
            1.0 if free == 4 else np.hypot(1, turn)
        )
        linear, shift = step @ linear, step @ shift + change[:2]
    angle = float(np.arctan2(linear[1, 0], linear[0, 0])) if free > 2 else 0.0
    size = float(np.hypot(*linear[:, 0])) if free > 3 else 1.0
    return Similarity(size, angle, tuple(shift.tolist()), start.centre)


def _normals(points: np.ndarray, tree: cKDTree, reach: float) -> np.ndarray:
    """Unit directions (N, 2) across the line that the points within `reach` of each lie on."""
    _, index = tree.query(points, k=5, distance_upper_bound=reach)
    near = points[np.where(index < len(points), index, index[:, :1])]
    d = near - near.mean(axis=1, keepdims=True)
    xx, yy, xy = (d[..., 0] ** 2).sum(1), (d[..., 1] ** 2).sum(1), (d[..., 0] * d[..., 1]).sum(1)
    along = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.stack([-np.sin(along), np.cos(along)], axis=1)
