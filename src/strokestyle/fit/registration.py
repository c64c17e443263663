"""Register a drawing with the curves it was drawn over.

Found is what a scanner or camera adds, from a small shift to the homography of a sheet that was not
photographed from straight above, coarse to fine: blurred ink and blurred curves are correlated over
all shifts for a grid of angles, scales and tilts; the best start is refined by matching ink to the
nearest curve of its direction, across it (iterative closest points: Besl and McKay 1992; point to
line: Chen and Medioni 1992), trusting near ink more and more. A homography is built up from the
eight one-parameter groups that generate it (as in Szeliski, Computer Vision, 2.1.1 and 8.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy import fft, ndimage
from scipy.spatial import cKDTree

from ..geometry.threads import each

# what is looked for: of the canvas, degrees, of size, of size from one side to the other
MAX_SHIFT, MAX_ANGLE, MAX_SCALE, MAX_TILT = 0.07, 7.0, 0.07, 0.08
LARGER = 1.5  # times that, at most, after refinement
COARSE = 192  # px, longer side of the images that are correlated
GRID_STEPS, TILT_STEPS, BLUR = 9, 5, 2.1  # of the grid; px of these images
CLEARLY_BETTER = 1.003  # times the correlation of a smaller change, for a larger one to be tried
REACHES = (32.0, 16.0, 10.0, 7.0, 5.0, 4.0)  # px at 768; matches farther than this lose their say
ROUNDS = 6  # of matching for each, at most
SETTLED = 0.02  # px at 768: where a round moves no corner of the canvas by more, the next reach
NORMAL_REACH = 7.0  # px at 768, between curve points that a normal is taken from
DIRECTION = 10.0  # px at 768 that a line across counts as farther than one along
GRADIENT_SIGMA, TENSOR_SIGMA = 1.5, 3.0  # px at 768, of the ink's direction
OUTLINE_CELL, OUTLINE_CLOSED = (
    6.0,
    3,
)  # px at 768, and cells, that gaps of the outline are closed by
OUTLINE_SLOPE = 0.1  # of what is outside, per cell: less, and both sides are
HABIT_REACH = 7.0  # px at 768, from which on it is asked how much too large the outline is drawn
PRIOR = 1e-3  # of the mean diagonal of the normal equations, against any change
MAX_INK_POINTS = 6000  # pixels of ink that are matched
MIN_INK_POINTS, MIN_CURVE_POINTS = 50, 20  # below, nothing can be said
FIT = 14.0  # px at 768, beyond which a distance counts as no match, where fits are compared

# Of the eight parameters of a homography, those that are free: shift x, y, turn, growth, stretch,
# shear, tilt x, y.
Free: TypeAlias = tuple[int, ...]
SHIFT: Free = (0, 1)
TURN: Free = (0, 1, 2)
SCALE: Free = (0, 1, 2, 3)
KEYSTONE: Free = (0, 1, 2, 6, 7)
ALL: Free = tuple(range(8))
# Share of the misfit that may be left for a map to be taken. Forty drawings by ten simulated hands
# that lay right were left .93, .92, .74 of a smaller one by a shift, a turn, a scale, and .87 by a
# tilt; 3 px or a degree of wrong leave .87 and .89 at most, a tilt of 4 % leaves .78. A sheet that
# lies turned or tilted was scanned or photographed, and so may well be scaled.
ALLOWED_MISFIT = {SHIFT: 0.88, TURN: 0.92, SCALE: 0.65}
ALLOWED_MISFIT_TILTED, ALLOWED_MISFIT_TURNED, ALLOWED_MISFIT_BOTH = 0.86, 0.85, 0.93
MIN_MOVE = 2.0  # px at 768 that a tenth of the ink must move by


@dataclass(frozen=True)
class Homography:
    """A projective map of the plane onto itself.

    Parameters
    ----------
    matrix : (3, 3), of homogeneous coordinates, px
    size : px, width and height of the canvas that `str` speaks about
    """

    matrix: np.ndarray
    size: tuple[float, float]

    def __post_init__(self):
        matrix = np.asarray(self.matrix, float)
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or matrix[2, 2] == 0:
            raise ValueError(f"Homography.matrix must be finite, (3, 3), got {matrix.tolist()}")
        object.__setattr__(self, "matrix", matrix / matrix[2, 2])

    @classmethod
    def similarity(
        cls, scale: float, angle: float, shift: tuple[float, float], size: tuple[float, float]
    ) -> Homography:
        """Make p -> centre + scale * R(angle) (p - centre) + shift.

        Parameters
        ----------
        scale : factor
        angle : radians, from x towards y (clockwise on screen)
        shift : px, x and y
        size : of the canvas whose centre this is about
        """
        c, s = scale * np.cos(angle), scale * np.sin(angle)
        return cls.about_centre(np.array([[c, -s, shift[0]], [s, c, shift[1]], [0, 0, 1]]), size)

    @classmethod
    def about_centre(cls, matrix: np.ndarray, size: tuple[float, float]) -> Homography:
        """Make it from a matrix (3, 3) in coordinates that begin at the canvas's centre."""
        to_centre = _shift(-0.5 * size[0], -0.5 * size[1])
        return cls(np.linalg.inv(to_centre) @ matrix @ to_centre, size)

    @classmethod
    def of_points(
        cls, points: np.ndarray, targets: np.ndarray, size: tuple[float, float]
    ) -> Homography:
        """Make the one that takes four points (4, 2) to four others, no three on a line."""
        rows, right = [], []
        for (x, y), (u, v) in zip(points, targets, strict=True):
            rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
            right += [u, v]
        return cls(np.append(np.linalg.solve(rows, right), 1.0).reshape(3, 3), size)

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Move points (..., 2) of the drawing to where they lie on the canvas."""
        return _projected(self.matrix, xy)

    def back(self, xy: np.ndarray) -> np.ndarray:
        """Move points (..., 2) of the canvas to where they lie on the drawing."""
        return _projected(np.linalg.inv(self.matrix), xy)

    def after(self, first: Homography) -> Homography:
        """The map that does `first` and then this one."""
        return Homography(self.matrix @ first.matrix, self.size)

    def warp(self, image: np.ndarray) -> np.ndarray:
        """Move an image (h, w, K) onto the canvas: (height, width, K).

        What comes in from outside is the image's own edge, its paper.
        """
        width, height = round(self.size[0]), round(self.size[1])
        grid = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        x, y = np.moveaxis(self.back(grid) - 0.5, -1, 0)
        planes = [
            ndimage.map_coordinates(image[..., k], [y, x], order=3, mode="nearest")
            for k in range(image.shape[2])
        ]
        return np.stack(planes, axis=-1).astype(image.dtype)

    @property
    def corners(self) -> np.ndarray:
        """The canvas's corners (4, 2), clockwise from the top left."""
        return np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * np.array(self.size, float)

    @property
    def farthest(self) -> float:
        """How far a corner of the canvas is moved at most, px."""
        return float(np.hypot(*(self(self.corners) - self.corners).T).max())

    @property
    def linear(self) -> np.ndarray:
        """What it does around the canvas's centre, (2, 2): its derivative there."""
        x, y, w = self.matrix @ [0.5 * self.size[0], 0.5 * self.size[1], 1.0]
        return (self.matrix[:2, :2] - np.outer([x / w, y / w], self.matrix[2, :2])) / w

    @property
    def shift(self) -> tuple[float, float]:
        """Where the canvas's centre is moved to, from where it was, px."""
        centre = 0.5 * np.array(self.size)
        x, y = (self(centre) - centre).tolist()
        return x, y

    @property
    def angle(self) -> float:
        """How far it turns around the centre, radians, clockwise on screen."""
        (a, b), (c, d) = self.linear
        return float(np.arctan2(c - b, a + d))

    @property
    def scale(self) -> float:
        """How much it grows areas around the centre, as the factor of a length."""
        return float(np.sqrt(abs(np.linalg.det(self.linear))))

    @property
    def beyond_similarity(self) -> float:
        """How far a corner of the canvas lies from where shift, turn and scale take it, px."""
        plain = Homography.similarity(self.scale, self.angle, self.shift, self.size)
        return float(np.hypot(*(self(self.corners) - plain(self.corners)).T).max())

    def __str__(self) -> str:
        parts = [f"moved {self.shift[0]:+.1f}, {self.shift[1]:+.1f} px"]
        if abs(self.angle) > np.radians(0.05):
            parts.append(f"turned {np.degrees(self.angle):+.1f} degrees")
        if abs(self.scale - 1) > 5e-4:
            parts.append(f"scaled by {self.scale:.3f}")
        if self.beyond_similarity > 0.05:
            parts.append(f"straightened by {self.beyond_similarity:.1f} px at a corner")
        return ", ".join(parts)


@dataclass(frozen=True)
class Registration:
    """How a drawing was laid on its curves.

    Parameters
    ----------
    moved : the map from where the layout put it to where it lies; None where it stayed
    off_before, off : px, median distance of the ink from the nearest curve, of the ink that has
        one within reach, before and after
    """

    moved: Homography | None
    off_before: float
    off: float

    def __str__(self) -> str:
        return (
            f"{self.moved} ({self.moved.farthest:.0f} px at the worst corner); the ink lies "
            f"{self.off:.1f} px off, {self.off_before:.1f} px before"
            if self.moved is not None
            else f"where it is; the ink lies {self.off:.1f} px off"
        )


def _shift(x: float, y: float) -> np.ndarray:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _projected(matrix: np.ndarray, xy: np.ndarray) -> np.ndarray:
    xy = np.asarray(xy, float)
    return (xy @ matrix[:2, :2].T + matrix[:2, 2]) / (xy @ matrix[2, :2, None] + matrix[2, 2])


def register(mask: np.ndarray, curve_points: np.ndarray) -> Registration:
    """Find how a drawing must be moved to lie on its curves.

    A hand has its own way of drawing beside the line, above all of drawing larger, and that is not
    to be taken away: of a shift, a shift and turn, these with a scale, an affine map and a
    homography, each is taken only where it fits much better than the simpler. Lines that were not
    drawn and ink that is on no line have no say.

    Parameters
    ----------
    mask : (H, W) float, 1 = ink
    curve_points : (N, 2) px, points of the curves a few px apart
    """
    scale = max(mask.shape) / 768.0
    ink = _ink_points(mask, scale)
    if len(ink.xy) < MIN_INK_POINTS or len(curve_points) < MIN_CURVE_POINTS:
        return Registration(None, np.nan, np.nan)
    matcher = _Matcher(ink, _Directed.of_points(curve_points, NORMAL_REACH * scale), scale)
    size = float(mask.shape[1]), float(mask.shape[0])
    stay = found = Homography(np.eye(3), size)
    starts = _coarse_starts(ink.xy, curve_points, size)
    families = (ALL, KEYSTONE, SCALE, TURN, SHIFT)  # the slowest first
    refined = each(lambda free: matcher.refined(starts[free], free), families)
    best = dict(zip(families, refined, strict=True))
    for free in (SHIFT, TURN, SCALE):
        tried = best[free]
        # a sheet that lies turned was scanned or photographed, and so may well be scaled
        scaled = free == SCALE and found.angle
        allowed = ALLOWED_MISFIT_TURNED if scaled else ALLOWED_MISFIT[free]
        if matcher.misfit_left(tried, found) < allowed:
            found = tried
    found = matcher.tilted(found, best)
    moved = np.quantile(np.hypot(*(found(ink.xy) - ink.xy).T), 0.9) > MIN_MOVE * scale
    return Registration(
        found if moved else None, matcher.off(stay), matcher.off(found if moved else stay)
    )


@dataclass(frozen=True)
class _Directed:
    """Points (N, 2) px on lines, and the lines' unit normals (N, 2) there."""

    xy: np.ndarray
    normal: np.ndarray

    @classmethod
    def of_points(cls, xy: np.ndarray, reach: float) -> _Directed:
        """Take each point's normal from those within `reach` of it."""
        return cls(xy, _normals(xy, cKDTree(xy), reach))

    def moved(self, by: Homography) -> _Directed:
        """Move the points, and turn the normals as the map does at the canvas's centre."""
        along = np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1) @ by.linear.T
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        return _Directed(by(self.xy), np.stack([along[:, 1], -along[:, 0]], axis=1))

    def embedded(self, turn: float) -> np.ndarray:
        """(N, 4): points of like place and direction are near; across is 2 `turn` px away."""
        x, y = self.normal.T
        return np.column_stack([self.xy, turn * (x * x - y * y), turn * 2 * x * y])


class _Matcher:
    """Ink and curves that are to be brought together."""

    def __init__(self, ink: _Directed, curves: _Directed, scale: float):
        self.ink, self.curves, self.scale = ink, curves, scale
        self.turn, self.far = 0.5 * DIRECTION * scale, FIT * scale
        self.tree = cKDTree(curves.embedded(self.turn))
        self.outward = _outward(curves, scale)

    def distances(self, by: Homography) -> tuple[np.ndarray, np.ndarray]:
        """Distances, at most `far`, from moved ink to curves (M,) and from curves to it (N,)."""
        ink = self.ink.moved(by).embedded(self.turn)
        there, _ = self.tree.query(ink, distance_upper_bound=self.far)
        back, _ = cKDTree(ink).query(self.tree.data, distance_upper_bound=self.far)
        return np.minimum(there, self.far), np.minimum(back, self.far)

    def misfit_left(self, tried: Homography, found: Homography) -> float:
        """The misfit with `tried`, as a share of that with `found`.

        Only what has a match with one of them counts.
        """
        new, old = self.distances(tried), self.distances(found)
        totals = np.zeros(2)
        for a, b in zip(new, old, strict=True):
            matched = np.minimum(a, b) < self.far
            if matched.any():
                totals += a[matched].mean(), b[matched].mean()
        return float(totals[0] / totals[1]) if totals[1] > 0 else 1.0

    def off(self, by: Homography) -> float:
        """Median distance, px, of the moved ink across the nearest curve, of that which has one."""
        ink = self.ink.moved(by)
        there, index = self.tree.query(ink.embedded(self.turn), distance_upper_bound=self.far)
        matched = np.isfinite(there)
        if not matched.any():
            return np.nan
        index = index[matched]
        away = ((self.curves.xy[index] - ink.xy[matched]) * self.curves.normal[index]).sum(axis=1)
        return float(np.median(np.abs(away)))

    def tilted(self, found: Homography, best: dict[Free, Homography]) -> Homography:
        """Take a homography of the `best` instead of what was found where it is clearly better.

        One that keeps the scale is preferred, as a hand that draws larger scales its drawing.
        """
        keystone, every = best[KEYSTONE], best[ALL]
        left = min(self.misfit_left(keystone, best[TURN]), self.misfit_left(every, best[SCALE]))
        moved = not np.array_equal(found.matrix, np.eye(3))
        allowed = ALLOWED_MISFIT_BOTH if moved else ALLOWED_MISFIT_TILTED
        if left > allowed:
            return found
        if self.misfit_left(every, keystone) < ALLOWED_MISFIT_BOTH:
            keystone = every
        return keystone if self.misfit_left(keystone, found) < allowed else found

    def refined(self, start: Homography, free: Free) -> Homography:
        """Match ink to the nearest curve, across it, by reweighted least squares.

        `free`: which of the parameters SHIFT to ALL name.
        """
        size = np.ptp(self.ink.xy, axis=0).max() + 1.0
        centre, found = 0.5 * np.array(start.size), start
        settled = np.nan  # reach
        for reach in np.repeat(REACHES, ROUNDS) * self.scale:
            if reach == settled:
                continue
            ink = self.ink.moved(found)
            far, index = self.tree.query(ink.embedded(self.turn), distance_upper_bound=3 * reach)
            good = np.flatnonzero(np.isfinite(far))
            if len(good) < MIN_INK_POINTS:
                continue
            at, normal = ink.xy[good], self.curves.normal[index[good]]
            away = ((self.curves.xy[index[good]] - at) * normal).sum(axis=1)
            # a habit is told from a move once they lie near
            habit = (self.outward[index[good]] * normal).sum(axis=1)
            habit = habit * (reach <= HABIT_REACH * self.scale)
            step = _step((at - centre) / size, away / size, normal, habit, reach / size, free)
            step = np.diag([size, size, 1]) @ step @ np.diag([1 / size, 1 / size, 1])
            moved = Homography.about_centre(step, start.size).after(found)
            if not _plausible(moved):
                break  # a circle fits one of any size
            if _farthest_apart(moved, found) < SETTLED * self.scale:
                settled = reach
            found = moved
        return found


def _farthest_apart(one: Homography, other: Homography) -> float:
    """How far two maps take a corner of the canvas apart at most, px."""
    return float(np.hypot(*(one(one.corners) - other(one.corners)).T).max())


def _plausible(moved: Homography) -> bool:
    """Whether a map is no larger than a half more than what is looked for."""
    long, short = np.linalg.svd(moved.linear, compute_uv=False)
    turn, grown = np.radians(MAX_ANGLE), np.log([long, short])
    tilt = np.abs(moved.matrix[2, :2]).max() * 0.5 * max(moved.size)
    found = (
        np.hypot(*moved.shift) / (MAX_SHIFT * max(moved.size)),
        abs(moved.angle) / turn,
        np.abs(grown).max() / MAX_SCALE,
        tilt / MAX_TILT,
    )
    return max(found) < LARGER


def _outward(curves: _Directed, scale: float) -> np.ndarray:
    """Unit directions (N, 2) out of the shape at points on its outline; 0 at all others."""
    cell = OUTLINE_CELL * scale
    at = np.floor((curves.xy - curves.xy.min(axis=0)) / cell).astype(int) + 2 * OUTLINE_CLOSED
    drawn = np.zeros(at.max(axis=0) + 2 * OUTLINE_CLOSED + 1, bool)
    drawn[tuple(at.T)] = True
    closed = ndimage.binary_closing(drawn, iterations=OUTLINE_CLOSED)
    outside = ndimage.label(~closed)[0]
    outside = (outside == outside[0, 0]).astype(float)
    slope = np.stack(np.gradient(ndimage.gaussian_filter(outside, 1.0)), axis=-1)[tuple(at.T)]
    on_outline = ndimage.maximum_filter(outside, 3)[tuple(at.T)] > 0
    across = (slope * curves.normal).sum(axis=1)
    side = np.sign(across) * (on_outline & (np.abs(across) > OUTLINE_SLOPE))
    return side[:, None] * curves.normal


def _ink_points(mask: np.ndarray, scale: float) -> _Directed:
    """The middle of the ink, so that thick lines are as exact as thin ones, and its direction."""
    inside = mask > 0.5
    depth = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    depth = np.pad(ndimage.gaussian_filter(depth, 1.0), 1)
    here = depth[1:-1, 1:-1]
    ridge = (here >= depth[:-2, 1:-1]) & (here >= depth[2:, 1:-1])
    ridge |= (here >= depth[1:-1, :-2]) & (here >= depth[1:-1, 2:])
    y, x = np.nonzero(inside & ridge)
    every = max(1, len(x) // MAX_INK_POINTS)
    y, x = y[::every], x[::every]
    return _Directed(np.stack([x, y], axis=1) + 0.5, _gradient_directions(mask, scale)[y, x])


def _gradient_directions(mask: np.ndarray, scale: float) -> np.ndarray:
    """Unit directions (H, W, 2) in which a mask changes most (structure tensor)."""
    mask = np.asarray(mask, np.float32)
    dx = ndimage.gaussian_filter(mask, GRADIENT_SIGMA * scale, order=(0, 1))
    dy = ndimage.gaussian_filter(mask, GRADIENT_SIGMA * scale, order=(1, 0))
    even, odd = (
        ndimage.gaussian_filter(product, TENSOR_SIGMA * scale)
        for product in (dx * dx - dy * dy, 2 * dx * dy)
    )
    across = 0.5 * np.arctan2(odd, even)
    return np.stack([np.cos(across), np.sin(across)], axis=-1)


class _Correlator:
    """Correlates points with curves, blurred, over all shifts at once by the Fourier transform."""

    def __init__(self, curve_points: np.ndarray, shape: Free):
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


_Starts = dict[Free, Homography]


def _coarse_starts(ink: np.ndarray, curve_points: np.ndarray, size: tuple[float, float]) -> _Starts:
    """The best start of a grid for each set of free parameters."""
    correlator = _Correlator(curve_points, (round(size[1]), round(size[0])))

    def best(grid: list[tuple[float, float, float, float]]) -> tuple[float, ...]:
        """Smaller changes go first, larger are only taken where better: no turn of a circle."""
        highest, chosen = -np.inf, grid[0]
        for one in sorted(grid, key=lambda one: abs(np.log(one[0])) + np.abs(one[1:]).sum()):
            agreement, _ = correlator.best_shift(_placed(one, size)(ink))
            if agreement > CLEARLY_BETTER * highest:
                highest, chosen = agreement, one
        return chosen

    angles = np.radians(np.linspace(-MAX_ANGLE, MAX_ANGLE, GRID_STEPS)).tolist()
    scales = np.exp(np.linspace(-MAX_SCALE, MAX_SCALE, GRID_STEPS)).tolist()
    tilts = np.linspace(-MAX_TILT, MAX_TILT, TILT_STEPS).tolist()
    still = (1.0, 0.0, 0.0, 0.0)
    turned = best([(1.0, angle, 0.0, 0.0) for angle in angles])
    scaled = best([(scale, angle, 0.0, 0.0) for angle in angles for scale in scales])
    chosen = {SHIFT: still, TURN: turned, SCALE: scaled}
    for free, one in ((KEYSTONE, turned), (ALL, scaled)):
        chosen[free] = best([(*one[:2], x, y) for x in tilts for y in tilts])
    starts = {}
    for free, one in chosen.items():
        placed = _placed(one, size)
        _, shift = correlator.best_shift(placed(ink))
        starts[free] = Homography(_shift(*shift) @ placed.matrix, size)
    return starts


def _placed(change: tuple[float, ...], size: tuple[float, float]) -> Homography:
    """The map that scales, turns and tilts about the canvas's centre."""
    scale, angle, *tilt = change
    return _tilt(tilt, size).after(Homography.similarity(scale, angle, (0.0, 0.0), size))


def _tilt(tilt: Sequence[float], size: tuple[float, float]) -> Homography:
    """Grow what lies half a canvas to the right or below by `tilt`, of its size."""
    matrix = np.eye(3)
    matrix[2, :2] = -2 * np.array(tilt) / max(size)
    return Homography.about_centre(matrix, size)


def _step(
    at: np.ndarray,
    away: np.ndarray,
    normal: np.ndarray,
    habit: np.ndarray,
    reach: float,
    free: Free,
) -> np.ndarray:
    """One step of matching: the matrix (3, 3) that brings points to their curves.

    Lengths are in units of the ink's size, from the centre, so that all parameters compare.

    Parameters
    ----------
    at : (n, 2), ink
    away : (n,), from there across to the nearest curve
    normal : (n, 2), of the curve there
    habit : (n,), how much of what a hand draws too large lies along the normal
    reach : at which a match has lost most of its say
    free : as in `_Matcher.refined`
    """
    weight = 1.0 / (1.0 + (away / reach) ** 2) ** 2  # Geman and McClure
    (x, y), (nx, ny) = at.T, normal.T
    grow = nx * x + ny * y
    design = np.stack(
        [nx, ny, ny * x - nx * y, grow, nx * x - ny * y, nx * y + ny * x, x * grow, y * grow],
        axis=1,
    )[:, free]
    # how much too large the outline is drawn is found alongside, for the map to leave it alone
    design = np.column_stack([design, habit])
    gram = (design * weight[:, None]).T @ design
    # what the curves do not tell, such as how far a circle is turned, stays as it is
    gram += PRIOR * np.trace(gram) / len(gram) * np.eye(len(gram))
    change = np.zeros(8)
    change[list(free)] = np.linalg.solve(gram, (design * weight[:, None]).T @ away)[:-1]
    dx, dy, turn, growth, stretch, shear, tilt_x, tilt_y = change
    step = np.array(
        [
            [1 + growth + stretch, shear - turn, dx],
            [shear + turn, 1 + growth - stretch, dy],
            [-tilt_x, -tilt_y, 1.0],
        ]
    )
    step[:2, :2] /= np.hypot(1, turn) if SCALE[-1] not in free else 1.0
    return step


def _normals(points: np.ndarray, tree: cKDTree, reach: float) -> np.ndarray:
    """Unit directions (N, 2) across the line that the points within `reach` of each lie on."""
    between = np.median(tree.query(points, k=3)[0][:, 2]) if len(points) > 2 else 0.0
    reach = max(reach, 1.5 * float(between))  # two neighbours at least, however far apart
    _, index = tree.query(points, k=5, distance_upper_bound=reach)
    near = points[np.where(index < len(points), index, index[:, :1])]
    d = near - near.mean(axis=1, keepdims=True)
    xx, yy, xy = (d[..., 0] ** 2).sum(1), (d[..., 1] ** 2).sum(1), (d[..., 0] * d[..., 1]).sum(1)
    along = 0.5 * np.arctan2(2 * xy, xx - yy)
    return np.stack([-np.sin(along), np.cos(along)], axis=1)
