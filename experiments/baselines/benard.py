"""Stylizing Animation By Example, for stills (Benard, Cole, Kass, Mordatch, Hegarty, Senn,
Fleischer, Pesare, Breeden, ACM Transactions on Graphics 32(4), SIGGRAPH 2013), with the PatchMatch
search of Barnes, Shechtman, Finkelstein, Goldman, SIGGRAPH 2009.

Pixels of the artist's drawing are copied to the test drawing. Each pixel p of the test has a match,
a place s in the drawing, and a patch around it, turned by the orientation field of either image
(here: the lines'), that minimises, as in Image Analogies (Hertzmann et al. 2001),

    E(p, s) = appearance + guides + histogram

appearance: what is synthesised so far against the drawing, and the distance to the lines against
that of the lesson, over the patch. guides: rendered channels at its centre; the surface's normal on
the screen, depth, whether the shape is there, how far the end of the line is. histogram: a place of
the drawing that is copied more often than the average costs, else blank patches spread. Coarse to
fine; at each level matches are searched, and patches vote on pixels (Wexler, Shechtman, Irani, CVPR
2004) by turns; at last each pixel is copied from its match. The term that holds frames of an
animation together has nothing to do in a still.

The paper says that its parameters are style specific, and Neural Strokes tuned them by hand for
each style. Here one setting serves all styles; only the reach of the ink is taken from the drawing.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from dataset import Lesson, Sheet
from methods import Method, Painter
from scipy.ndimage import distance_transform_edt, gaussian_filter, zoom
from scipy.spatial import cKDTree

INK = 0.1  # of the way from the ground to the darkest colour: less is the ground's own grain
END = 16.0  # px of 256: a line's end is felt from no farther
FINE = 3  # the drawing is looked up on a grid this much finer than its pixels
SIZE = 256.0  # px, of the canvas that lengths are stated for


@dataclass(frozen=True)
class Settings:
    """How matches are found and what is dear.

    radius : of a patch, px
    levels : of the pyramid, each half the size of the one below it
    rounds : of searching and voting, from the coarsest level to the finest
    searches : PatchMatch iterations in a round
    distance : weight of a px (at 256) of difference in distance to the line, squared
    normal, depth, cover, end : weights of guides, of a whole unit squared
    histogram : what a place costs that is used twice as often as the average
    """

    radius: int = 2
    levels: int = 3
    rounds: tuple[int, ...] = (6, 4, 3)
    searches: int = 3
    distance: float = 0.06
    normal: float = 0.05
    depth: float = 0.1
    cover: float = 0.1
    end: float = 0.1
    histogram: float = 0.01


@dataclass(frozen=True)
class Field:
    """What is known of each pixel of a sheet before anything is drawn on it.

    distance : (H, W) to the nearest line, px of a canvas of 256
    angle : (H, W) of that line, radians
    guides : (H, W, 5): normal x, normal y, depth, cover, end
    """

    distance: np.ndarray
    angle: np.ndarray
    guides: np.ndarray


@dataclass(frozen=True)
class Source:
    """The drawing at one level, on a grid that is FINE times finer than its pixels.

    pixels : (h, w, 4): red, green, blue, distance to the line
    angle : (h, w)
    guides : (h, w, 5)
    places : (n, 2) x, y, px of the level, near enough to lines to be copied
    """

    pixels: np.ndarray
    angle: np.ndarray
    guides: np.ndarray
    places: np.ndarray

    def cells(self, at: np.ndarray) -> np.ndarray:
        """Find the flat indices of cells at (..., 2) places; beyond the edge, those of the edge."""
        high, wide = self.angle.shape
        x = np.clip((at[..., 0] * FINE).astype(np.int32), 0, wide - 1)
        y = np.clip((at[..., 1] * FINE).astype(np.int32), 0, high - 1)
        return y * wide + x


@dataclass(frozen=True)
class Band:
    """The pixels of the test that are synthesised at one level; all others stay ground.

    yx : (n, 2) int
    number : (H, W) int, which of them a pixel is, -1 elsewhere
    distance : (H, W), to the lines, in the guides' unit
    angle : (n,) of the lines, radians
    guides : (n, 5)
    """

    yx: np.ndarray
    number: np.ndarray
    distance: np.ndarray
    angle: np.ndarray
    guides: np.ndarray

    @property
    def centres(self) -> np.ndarray:
        """Pixel centres, (n, 2) x, y."""
        return self.yx[:, ::-1] + 0.5


@dataclass
class Matches:
    """Where each pixel of a band is copied from, and how it is turned.

    place : (n, 2) float32 x, y, px of the level
    turn : (n,) float32, radians, from the test's frame to the drawing's
    cost : (n,) float32
    """

    place: np.ndarray
    turn: np.ndarray
    cost: np.ndarray

    def take(self, other: "Matches") -> None:
        """Take what is cheaper in another."""
        better = other.cost < self.cost
        self.place[better], self.turn[better] = other.place[better], other.turn[better]
        self.cost[better] = other.cost[better]


def field_of(sheet: Sheet) -> Field:
    """Work out the guides of a sheet."""
    wide, high = sheet.size
    unit = SIZE / max(wide, high)
    curves, maps = sheet.view.curves, sheet.view.maps
    points, angles, ends = _fine_points(curves)
    rows, columns = np.mgrid[:high, :wide] + 0.5
    far, nearest = cKDTree(points).query(np.stack([columns, rows], -1))
    far = np.minimum(far, wide + high)  # where there are no lines
    cover = maps.covered.astype(np.float32)
    if cover.any():  # beyond the shape, what is nearest on it
        inside = tuple(
            distance_transform_edt(cover == 0, return_distances=False, return_indices=True)
        )
    else:
        inside = tuple(np.indices((high, wide)))
    depth = maps["depth"][inside]
    depth = (depth - depth.min()) / max(float(np.ptp(depth)), 1e-6)
    end = np.minimum(ends[nearest] * unit, END) / END
    normals = [maps["normal_x"][inside], maps["normal_y"][inside]]
    guides = np.stack([*normals, depth, cover, end], -1).astype(np.float32)
    return Field((far * unit).astype(np.float32), angles[nearest].astype(np.float32), guides)


def _fine_points(curves) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of all curves, half a px apart, their tangents' angles, and arc length to an end."""
    points, angles, ends = [], [], []
    for i in range(len(curves)):
        xy = curves.xy[curves.offsets[i] : curves.offsets[i + 1]]
        step = np.linalg.norm(np.diff(xy, axis=0), axis=1)
        length = np.concatenate([[0.0], np.cumsum(step)])
        s = np.linspace(0, length[-1], max(int(2 * length[-1]), 2))
        slope = np.gradient(xy, np.maximum(length, np.arange(len(xy)) * 1e-9), axis=0)
        fine = [np.interp(s, length, column) for column in (*xy.T, *slope.T)]
        points.append(np.stack(fine[:2], -1))
        angles.append(np.arctan2(fine[3], fine[2]))
        ends.append(np.full(len(s), np.inf) if curves.closed[i] else np.minimum(s, length[-1] - s))
    if not len(curves):
        return np.full((1, 2), 1e9), np.zeros(1), np.zeros(1)
    return np.concatenate(points), np.concatenate(angles), np.concatenate(ends)


def reach_of(drawing: np.ndarray, distance: np.ndarray) -> float:
    """How far from the lines there is ink (all but 1/200 of it), px of 256, and a px more."""
    ink = np.abs(drawing - ground_of(drawing)).max(-1)
    marked = ink > INK * max(float(ink.max()), 1e-6)
    if not marked.any():
        return 2.0
    return float(np.clip(np.quantile(distance[marked], 0.995) + 1.0, 2.0, SIZE))


def ground_of(drawing: np.ndarray) -> np.ndarray:
    """The colour of the paper: the median of the border's pixels, (3,)."""
    border = np.concatenate([drawing[0], drawing[-1], drawing[:, 0], drawing[:, -1]])
    return np.median(border, 0)


def coarse(image: np.ndarray, k: int) -> np.ndarray:
    """Average (H, W, C) over blocks of k x k pixels, the edge repeated."""
    high, wide, channels = image.shape
    image = np.pad(image, ((0, -high % k), (0, -wide % k), (0, 0)), "edge")
    return image.reshape(len(image) // k, k, -1, k, channels).mean((1, 3))


def fine(image: np.ndarray, order: int) -> np.ndarray:
    """Sample (H, W[, C]) on a grid that is FINE times finer."""
    factor = (FINE, FINE, 1)[: image.ndim]
    return zoom(image, factor, order=order, mode="nearest", grid_mode=True)


class Search:
    """Matches between a band and a source at one level, and what they cost.

    image : (H, W, 3), what is synthesised so far
    """

    def __init__(self, source: Source, band: Band, image: np.ndarray, settings: Settings, rng):
        self.source, self.band, self.settings, self.rng = source, band, settings, rng
        self.offsets = _offsets(settings.radius)
        self.image = image
        self.usage = np.zeros(len(source.angle.ravel()), np.float32)
        self.pixels = source.pixels.reshape(-1, 4)
        self.frames = source.angle.ravel()
        self.marks = source.guides.reshape(-1, source.guides.shape[-1])
        self.look()

    def look(self) -> None:
        """See the patches of the image as it is now."""
        r = self.settings.radius
        layers = np.concatenate([self.image, self.band.distance[..., None]], -1)
        layers = np.pad(layers, ((r, r), (r, r), (0, 0)), "edge")
        y, x = self.band.yx.T[..., None] + r
        across, down = self.offsets.astype(int).T
        self.patches = layers[y + down, x + across].astype(np.float32)

    def matches(self, place: np.ndarray, near: np.ndarray) -> Matches:
        """Match places, of both ways along the line that which is nearer to a turn."""
        cells = self.source.cells(place)
        turn = self.frames[cells] - self.band.angle
        turn += np.pi * np.round((near - turn) / np.pi)
        seen = self.pixels[self.source.cells(self.corners(place, turn))]
        cost = np.einsum("npc->n", (seen - self.patches) ** 2) / len(self.offsets)
        cost += ((self.marks[cells] - self.band.guides) ** 2).sum(-1) + self.usage[cells]
        return Matches(place, turn, cost)

    def corners(self, place: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Where in the drawing the pixels of patches are, (n, p, 2)."""
        return place[:, None] + _turned(turn[:, None], self.offsets[None])

    def count(self, found: Matches) -> None:
        """Make dear what is used more often than the average."""
        high, wide = self.source.angle.shape
        used = np.bincount(self.source.cells(found.place), minlength=high * wide)
        used = gaussian_filter(used.reshape(high, wide).astype(np.float32), FINE, mode="constant")
        average = len(found.place) / (len(self.source.places) * FINE**2)
        excess = np.maximum(used.ravel() / average - 1, 0)
        self.usage = self.settings.histogram * excess.astype(np.float32)

    def improve(self, found: Matches) -> None:
        """Do one PatchMatch iteration: matches of neighbours, then random ones ever nearer."""
        self.count(found)
        found.take(self.matches(found.place, found.turn))
        for step in (4, 2, 1):
            for x, y in ((step, 0), (-step, 0), (0, step), (0, -step)):
                found.take(self.neighbours(found, x, y))
        self.scatter(found)

    def neighbours(self, found: Matches, x: int, y: int) -> Matches:
        """Shift the matches of the pixels at (-x, -y) to here."""
        high, wide = self.band.number.shape
        row, column = self.band.yx.T - np.array([[y], [x]])
        inside = (row >= 0) & (row < high) & (column >= 0) & (column < wide)
        other = np.where(inside, self.band.number[row % high, column % wide], -1)
        other = np.where(other < 0, np.arange(len(other)), other)
        turn = found.turn[other]
        apart = (self.band.yx - self.band.yx[other])[:, ::-1].astype(np.float32)
        return self.matches(found.place[other] + _turned(turn, apart), turn)

    def scatter(self, found: Matches) -> None:
        """Try places at random: anywhere, then around the match, in circles halved each time."""
        count = len(found.cost)
        anywhere = self.source.places[self.rng.integers(len(self.source.places), size=count)]
        found.take(self.matches(anywhere, self.rng.uniform(0, 2 * np.pi, count)))
        radius = max(self.source.angle.shape) / FINE / 2
        while radius > 0.3:
            shift = self.rng.uniform(-radius, radius, (count, 2)).astype(np.float32)
            half = np.pi * self.rng.integers(2, size=count)
            found.take(self.matches(found.place + shift, found.turn + half))
            radius /= 2

    def settle(self, found: Matches, rounds: int) -> Matches:
        """Search and vote by turns."""
        for _ in range(rounds):
            self.image = self.vote(found)
            self.look()
            found = self.matches(found.place, found.turn)
            for _ in range(self.settings.searches):
                self.improve(found)
        return found

    def copied(self, found: Matches) -> np.ndarray:
        """Copy each pixel from its match, (H, W, 3)."""
        image = self.image.copy()
        image[tuple(self.band.yx.T)] = self.pixels[self.source.cells(found.place), :3]
        return image

    def vote(self, found: Matches) -> np.ndarray:
        """Average what all patches around a pixel want of it, (H, W, 3)."""
        radius = self.settings.radius
        high, wide = self.band.number.shape
        total = np.zeros((high + 2 * radius, wide + 2 * radius, 4), np.float32)
        colours = self.pixels[self.source.cells(self.corners(found.place, found.turn)), :3]
        trust = np.exp(-found.cost / max(2 * float(np.quantile(found.cost, 0.75)), 1e-9))
        for i, (x, y) in enumerate(self.offsets.astype(int)):
            row, column = self.band.yx.T + radius + np.array([[y], [x]])
            weight = trust[:, None]
            total[row, column] += np.concatenate([weight * colours[:, i], weight], -1)
        row, column = self.band.yx.T
        image = self.image.copy()
        voted = total[row + radius, column + radius]
        image[row, column] = voted[:, :3] / np.maximum(voted[:, 3:], 1e-12)
        return image


def _offsets(radius: int) -> np.ndarray:
    """The pixels of a patch, (p, 2) float32 x, y."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return np.stack([x.ravel(), y.ravel()], -1).astype(np.float32)


def _turned(angle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Turn (..., 2) vectors by (...) angles."""
    cos, sin = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], -1)


def level_of(field: Field, k: int, settings: Settings) -> Field:
    """A field at 1/k of its size, its channels multiplied by the roots of their weights."""
    turning = np.stack([np.cos(2 * field.angle), np.sin(2 * field.angle)], -1)
    layers = np.concatenate([field.distance[..., None], turning, field.guides], -1)
    layers = coarse(layers, k).astype(np.float32)
    s = settings
    weights = np.array([s.normal, s.normal, s.depth, s.cover, s.end], np.float32)
    angle = 0.5 * np.arctan2(layers[..., 2], layers[..., 1])
    return Field(np.sqrt(s.distance) * layers[..., 0], angle, np.sqrt(weights) * layers[..., 3:])


def source_of(drawing: np.ndarray, field: Field, near: float) -> Source:
    """The drawing at a level, ready to be looked up; places are no farther than `near`."""
    pixels = np.concatenate([drawing, field.distance[..., None]], -1)
    turning = [fine(f(2 * field.angle), 1) for f in (np.cos, np.sin)]
    places = np.argwhere(field.distance <= near)[:, ::-1].astype(np.float32) + 0.5
    angle = 0.5 * np.arctan2(turning[1], turning[0])
    return Source(fine(pixels, 1), angle.astype(np.float32), fine(field.guides, 0), places)


def band_of(field: Field, near: float) -> Band:
    """The pixels of a level that are no farther from the lines than `near`."""
    yx = np.argwhere(field.distance <= near)
    number = np.full(field.distance.shape, -1)
    rows = tuple(yx.T)
    number[rows] = np.arange(len(yx))
    return Band(yx, number, field.distance, field.angle[rows], field.guides[rows])


def synthesise(
    drawing: np.ndarray, source: Field, target: Field, settings: Settings, seed: int
) -> np.ndarray:
    """Draw the target as the source is drawn, (H, W, 3) float32."""
    rng = np.random.default_rng(seed)
    reach = reach_of(drawing, source.distance) * np.sqrt(settings.distance)
    ground = ground_of(drawing).astype(np.float32)
    image = np.tile(ground, (*target.distance.shape, 1))
    guess = None
    for level, rounds in zip(range(settings.levels)[::-1], settings.rounds, strict=True):
        k = 2**level
        here, there = level_of(target, k, settings), level_of(source, k, settings)
        band = band_of(here, reach)
        lesson = source_of(coarse(drawing, k).astype(np.float32), there, reach)
        if not len(band.yx) or not len(lesson.places):
            continue
        blank = np.tile(ground, (*here.distance.shape, 1))
        search = Search(lesson, band, blank, settings, rng)
        found = search.settle(_first_matches(search, guess), rounds)
        image, guess = search.copied(found), (band, found)
    return image


def _first_matches(search: Search, guess: tuple[Band, Matches] | None) -> Matches:
    """The matches of the coarser level, or random ones improved by guides alone."""
    count = len(search.band.yx)
    if guess is None:
        places = search.source.places[search.rng.integers(len(search.source.places), size=count)]
        turn = search.rng.uniform(0, 2 * np.pi, count)
        return search.matches(places, turn.astype(np.float32))
    band, found = guess
    nearest = cKDTree(band.centres).query(search.band.centres / 2)[1]
    apart = (search.band.centres - 2 * band.centres[nearest]).astype(np.float32)
    turn = found.turn[nearest]
    return search.matches(2 * found.place[nearest] + _turned(turn, apart), turn)


def learn(lesson: Lesson, settings: Settings, seed: int, device: str) -> Painter:
    """Keep the drawing and its guides: nothing is trained. The device is not used."""
    return partial(_paint, lesson, field_of(lesson.sheet), settings)


def _paint(lesson: Lesson, source: Field, settings: Settings, sheet: Sheet, seed: int):
    image = synthesise(lesson.drawing, source, field_of(sheet), settings, seed)
    return np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)


METHODS = {
    "benard": Method(
        "Benard 2013",
        "Benard et al., Stylizing Animation By Example, SIGGRAPH 2013",
        learn,
        Settings(),
        replace(Settings(), radius=3, levels=4, rounds=(8, 6, 5, 4), searches=5),
    )
}
