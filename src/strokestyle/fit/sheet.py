"""Find a sheet of paper that lies on a table, in a photograph of both.

The photograph is made small and its strokes are taken out by a median; what is left of edges votes
for lines, each with the side that it is the brighter of (Hough transform, with the gradient's
direction: O'Gorman and Clowes 1976). Of four lines that may be a sheet's sides, those are taken
along which inside and outside differ most steadily, and go on differing farther out: a line that
somebody drew has the same paper on both of its sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from PIL import Image
from scipy import ndimage

# The numbers below were set by hand; no ablation of them is kept. Lengths are pixels of the small
# photograph.
SMALL = 320  # longer side
STROKE = 9  # side of the median: strokes of half of it are gone
EDGE = 0.02  # change of a colour a pixel that votes with half a voice
ANGLES = 180  # directions that are told apart
SPREAD = 4.0  # degrees by which the gradient's direction errs
LINES = 14  # that sides are sought among
APART = (8.0, 6.0)  # degrees and pixels that two of them differ by
OPPOSITE, BESIDE = 30.0, 40.0  # degrees that opposite sides, and adjacent ones, are off 180 and 90
OUTSIDE = (3.0, 6.0, 10.0, 15.0)  # where the table is looked at, beside a side
INSIDE, DEEPER = 4.0, 14.0  # where the sheet is, and still is
DIFFERENT = 0.035  # colours of sheet and table
MIN_SUPPORT = 0.75  # share of each side along which they differ
MIN_AREA = 0.15  # of the photograph
MIN_SEEN = 0.25  # of a side's length that lies in the photograph, for it to be one
MIN_DRAWN = 2  # sides that are seen
MAX_FORESHORTENING = 0.45  # length of a side by that of the opposite one, at least
NEARBY = 6.0  # how far a side may lie from the line that was voted for


@dataclass(frozen=True)
class Sheet:
    """A sheet of paper in a photograph.

    Parameters
    ----------
    corners : (4, 2) px, clockwise on screen from the one nearest to the top left; some may lie
        outside the photograph
    share : of the photograph that it fills
    """

    corners: np.ndarray
    share: float

    @property
    def proportion(self) -> float:
        """Width by height, by the mean lengths of opposite sides."""
        side = np.linalg.norm(np.roll(self.corners, -1, axis=0) - self.corners, axis=1)
        return float((side[0] + side[2]) / (side[1] + side[3]))


@dataclass(frozen=True)
class _Line:
    """x cos(angle) + y sin(angle) = offset; the brighter side lies towards `angle`, radians."""

    angle: float
    offset: float
    votes: float
    drawn: bool = True  # False: a side of the photograph, where a sheet may end too

    @property
    def normal(self) -> np.ndarray:
        return np.array([np.cos(self.angle), np.sin(self.angle)])


def find_sheet(rgb: np.ndarray) -> Sheet | None:
    """Find the sheet of paper in a photograph (h, w, 3) in [0, 1]; None where no edge is seen."""
    h, w = rgb.shape[:2]
    factor = max(h, w) / SMALL
    size = max(16, round(w / factor)), max(16, round(h / factor))
    small = np.stack(
        [
            np.asarray(
                Image.fromarray(np.ascontiguousarray(plane)).resize(size, Image.Resampling.BOX)
            )
            for plane in np.moveaxis(np.asarray(rgb, np.float32), -1, 0)
        ],
        axis=-1,
    )
    calm = ndimage.median_filter(small, size=(STROKE, STROKE, 1), mode="nearest")
    lines = _lines(calm)
    best: np.ndarray | None = None
    sides: tuple[_Line, ...] = ()
    highest = 0.0
    for four in _quadrilaterals(lines, calm.shape):
        corners = _corners(four, calm.shape)
        if corners is None:
            continue
        score = _support(corners, four, calm)
        if score > highest:
            best, highest, sides = corners, score, four
    if best is None:
        return None
    best = _settled(best, sides, calm)
    share = _area(_clipped(best, calm.shape)) / (calm.shape[0] * calm.shape[1])
    return Sheet(best * [w / size[0], h / size[1]], float(share))


def _lines(calm: np.ndarray) -> list[_Line]:
    """The straightest, longest edges of an image (h, w, 3), by their votes."""
    dy, dx = (
        np.stack([ndimage.gaussian_filter(calm[..., k], 1.0, order=o) for k in range(3)], axis=-1)
        for o in ((1, 0), (0, 1))
    )
    strongest = np.abs(dx) + np.abs(dy)
    channel = strongest.argmax(axis=-1)[..., None]
    gx, gy = (np.take_along_axis(d, channel, axis=-1)[..., 0] for d in (dx, dy))
    size = np.hypot(gx, gy)
    y, x = np.nonzero(size > 0.25 * EDGE)
    weight = size[y, x] / (size[y, x] + EDGE)
    angle = np.arctan2(gy[y, x], gx[y, x])
    reach = int(np.ceil(np.hypot(*calm.shape[:2])))
    votes = np.zeros((2 * ANGLES, 2 * reach + 1))
    step = np.pi / ANGLES
    for off in np.radians(np.arange(-SPREAD, SPREAD + 0.1)):
        at = np.rint((angle + off) / step).astype(int) % (2 * ANGLES)
        rho = (x + 0.5) * np.cos(at * step) + (y + 0.5) * np.sin(at * step)
        np.add.at(votes, (at, np.rint(rho).astype(int) + reach), weight)
    votes = ndimage.gaussian_filter(votes, 0.7, mode=("wrap", "constant"))
    found: list[_Line] = []
    near_angle, near_offset = round(np.radians(APART[0]) / step), round(APART[1])
    for _ in range(LINES):
        at, rho = np.unravel_index(votes.argmax(), votes.shape)
        if votes[at, rho] <= 0:
            break
        found.append(_Line(at * step, float(rho - reach), float(votes[at, rho])))
        rows = np.arange(at - near_angle, at + near_angle + 1) % (2 * ANGLES)
        votes[rows, max(0, rho - near_offset) : rho + near_offset + 1] = 0
    return found


def _quadrilaterals(lines: list[_Line], shape: tuple[int, ...]) -> Iterator[tuple[_Line, ...]]:
    """Fours of lines whose brighter, or darker, sides face each other: (a, b, c, d) in turn."""
    h, w = shape[:2]
    for flip in (0.0, np.pi):
        # what faces inwards is the brighter side, or the darker
        turned = [
            _Line((one.angle + flip) % (2 * np.pi), one.offset * (-1 if flip else 1), one.votes)
            for one in lines
        ]
        frame = [
            _Line(angle, offset, 0.0, drawn=False)
            for angle, offset in ((0.0, 0.0), (np.pi / 2, 0.0), (np.pi, -w), (1.5 * np.pi, -h))
        ]
        every = turned + frame
        pairs = [
            (a, c)
            for a, c in combinations(every, 2)
            if abs(_between(a, c) - np.pi) < np.radians(OPPOSITE)
        ]
        for (a, c), (b, d) in combinations(pairs, 2):
            if a.drawn + b.drawn + c.drawn + d.drawn < MIN_DRAWN:
                continue
            if abs(_between(a, b) - np.pi / 2) < np.radians(BESIDE):
                yield a, b, c, d


def _between(a: _Line, b: _Line) -> float:
    """The angle between two lines' normals, 0 to pi."""
    return float(np.arccos(np.clip(a.normal @ b.normal, -1, 1)))


def _corners(four: tuple[_Line, ...], shape: tuple[int, ...]) -> np.ndarray | None:
    """Where neighbouring sides meet, (4, 2), clockwise from the top left; None: no sheet."""
    normal = np.array([one.normal for one in four])
    offset = np.array([one.offset for one in four])
    around = [1, 2, 3, 0]
    (x, y), (u, v), far = normal.T, normal[around].T, offset[around]
    determinant = x * v - y * u  # of each side's normal and the next one's
    if np.abs(determinant).min() < 0.3:
        return None
    xy = np.stack([offset * v - far * y, far * x - offset * u], axis=1) / determinant[:, None]
    middle = xy.mean(axis=0)
    if (normal @ middle <= offset).any():
        return None  # the sides face outwards
    turn = np.roll(xy, -1, axis=0) - xy
    cross = turn[:, 0] * np.roll(turn[:, 1], -1) - turn[:, 1] * np.roll(turn[:, 0], -1)
    if not ((cross > 0).all() or (cross < 0).all()):
        return None
    xy = xy if cross[0] > 0 else xy[::-1]
    clipped = _clipped(xy, shape)
    if len(clipped) < 3 or _area(clipped) < MIN_AREA * shape[0] * shape[1]:
        return None
    if _area(clipped) < 0.6 * _area(xy):
        return None
    side = np.linalg.norm(turn, axis=1)
    if (
        min(side[:2] / side[2:]) < MAX_FORESHORTENING
        or min(side[2:] / side[:2]) < MAX_FORESHORTENING
    ):
        return None
    first = np.argmin((xy - middle).sum(axis=1))
    return np.roll(xy, -first, axis=0)


def _support(corners: np.ndarray, four: tuple[_Line, ...], calm: np.ndarray) -> float:
    """How well sheet and table are told apart along the sides; 0 where this is no sheet.

    The length of the sides along which they are, less what of them is not there.
    """
    told = 0.0
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if not _side(a, b, four).drawn:
            continue
        at, inward, share_seen = _along(a, b, calm.shape)
        if share_seen < MIN_SEEN or len(at) < 8:
            return 0.0
        inside = _sampled(calm, at + INSIDE * inward)
        off = np.stack([_sampled(calm, at - far * inward) - inside for far in OUTSIDE])
        deeper = np.abs(_sampled(calm, at + DEEPER * inward) - inside).max(axis=-1)
        # a drawn line ends, and paper goes on: outside, or inside where its own edge was taken
        beyond = (np.abs(off).max(axis=-1) > DIFFERENT) | np.isnan(off[..., 0])
        near = np.nan_to_num(np.abs(off[:2]).max(axis=-1)).max(axis=0)
        share = float((beyond.all(axis=0) & (near > DIFFERENT) & (deeper < 0.5 * near)).mean())
        if share < MIN_SUPPORT:
            return 0.0
        told += share * len(at)
    return told


def _side(a: np.ndarray, b: np.ndarray, four: tuple[_Line, ...]) -> _Line:
    """The line that two neighbouring corners lie on."""
    return min(four, key=lambda one: abs(one.normal @ (a + b) / 2 - one.offset))


def _along(
    a: np.ndarray, b: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, float]:
    """Points (n, 2) on a side within an image, the unit vector to their right, and their share."""
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    at = a + along * np.arange(3.0, max(length - 3.0, 4.0), 2.0)[:, None]
    seen = ((at > 3) & (at < [shape[1] - 3, shape[0] - 3])).all(axis=1)
    return at[seen], np.array([-along[1], along[0]]), float(seen.mean())


def _settled(corners: np.ndarray, four: tuple[_Line, ...], calm: np.ndarray) -> np.ndarray:
    """The corners once their sides are laid on the steepest change of colour nearby."""
    lines, reach = [], np.arange(-NEARBY, NEARBY + 0.1, 0.5)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        at, inward, _ = _along(a, b, calm.shape)
        ends = np.stack([a, b])
        if _side(a, b, four).drawn and len(at) >= 8:
            across = at[:, None] + reach[:, None] * inward
            y, x = across[..., 1] - 0.5, across[..., 0] - 0.5
            colour = np.stack(
                [
                    ndimage.map_coordinates(calm[..., k], [y, x], order=1, mode="nearest")
                    for k in range(3)
                ],
                axis=-1,
            )
            toward = np.median(colour[:, -1] - colour[:, 0], axis=0)
            slope = ndimage.gaussian_filter1d(colour @ toward, 1.5, axis=1, order=1)
            off, place = reach[slope.argmax(axis=1)], (at - a) @ (b - a) / ((b - a) @ (b - a))
            line = np.polyfit(place, off, 1)
            for _ in range(5):
                misfit = np.abs(off - np.polyval(line, place))
                line = np.polyfit(place, off, 1, w=1 / np.sqrt(1 + (misfit / 0.5) ** 2))
            ends = ends + np.polyval(line, [0.0, 1.0])[:, None] * inward
        lines.append(ends)
    return np.array([_crossing(lines[k - 1], lines[k]) for k in range(4)])


def _crossing(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Where two lines, of two points (2, 2) each, cross."""
    along, across = one[1] - one[0], other[1] - other[0]
    t = np.linalg.solve(np.stack([along, -across], axis=1), other[0] - one[0])[0]
    return one[0] + t * along


def _sampled(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Colours (n, 3) at points (n, 2); NaN outside."""
    x, y = np.floor(at).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < image.shape[1]) & (y < image.shape[0])
    out = np.full((len(at), 3), np.nan)
    out[inside] = image[y[inside], x[inside]]
    return out


def _area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _clipped(polygon: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A convex polygon (n, 2) cut to an image (Sutherland and Hodgman 1974)."""
    h, w = shape[:2]
    for axis, limit, keep in ((0, 0.0, 1), (0, float(w), -1), (1, 0.0, 1), (1, float(h), -1)):
        out: list[np.ndarray] = []
        for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            inside, goes = keep * (p[axis] - limit) >= 0, keep * (q[axis] - limit) >= 0
            if inside:
                out.append(p)
            if inside != goes:
                t = (limit - p[axis]) / (q[axis] - p[axis])
                out.append(p + t * (q - p))
        polygon = np.array(out).reshape(-1, 2)
        if not len(polygon):
            break
    return polygon
