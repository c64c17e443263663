"""Views of wobbly blobs, and drawings of them by a law that is known: what a fit has to find."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.extract.camera import Camera
from strokestyle.extract.feature_maps import FeatureMaps
from strokestyle.extract.view import View
from strokestyle.fit.exemplar import separate
from strokestyle.geometry.curves import KINDS, Curves, simplify
from strokestyle.render.config import StyleConfig
from strokestyle.render.features import plan
from strokestyle.render.plan import Planned

SIZE = 360  # px, the canvas
SPACING = 3.0  # px between the points of curves and of planned strokes
BLOBS = 3  # to a side


def blobs(seed):
    """Nine wobbly blobs: contours of two thirds of a turn, and a crease across each.

    Depth grows to the right, and the normals of the surface point away from the blobs' centres.
    """
    rng = np.random.default_rng(seed)
    pitch = SIZE / BLOBS
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    centre = [(np.floor(v / pitch) + 0.5) * pitch for v in (x, y)]
    away = np.stack([x - centre[0], y - centre[1]])
    away /= np.maximum(np.hypot(*away), 1.0)
    lines, kinds = [], []
    for i in range(BLOBS * BLOBS):
        middle = (np.array([i % BLOBS, i // BLOBS]) + 0.5) * pitch
        first = rng.uniform(0, 2 * np.pi)
        angle = first + np.linspace(0, 1.4 * np.pi, 400)
        radius = rng.uniform(30, 38) + rng.uniform(2.0, 3.5) * np.cos(5 * angle + rng.uniform(0, 6))
        lines.append(middle + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        kinds.append(KINDS.index("contour"))
        turn = rng.uniform(0, np.pi)
        chord = np.linspace(-14, 14, 100)[:, None] * [np.cos(turn), np.sin(turn)]
        lines.append(middle + chord)
        kinds.append(KINDS.index("crease"))
    curves = Curves.from_list([evenly(line) for line in lines], kinds)
    names = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y", "plain")
    maps = np.stack([x / SIZE, 0 * x + 0.5, 0 * x, *away, 0 * x]).astype(np.float32)
    camera = Camera([0, 0, 3], [0, 0, 0], [0, 1, 0], 30, SIZE, SIZE)
    return View(camera, curves, FeatureMaps(names, maps, maps[0] >= 0))


def evenly(line):
    """The same line in points SPACING apart."""
    s = np.r_[0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]
    at = np.linspace(0, s[-1], round(s[-1] / SPACING) + 1)
    return np.stack([np.interp(at, s, line[:, k]) for k in (0, 1)], axis=1)


# ----------------------------------------------------------------------------------------- laws


@dataclass(frozen=True)
class Law:
    """How to draw a curve.

    inflate : px that contours are drawn outside of themselves
    smooth : px, Gaussian that rounds curves off
    cut : px, tolerance with which curves are drawn straight
    thickness : (arc length, length, xy) of a stroke -> px
    past : px by which strokes run on past both ends; of two, each end by its own between them
    jitter : px rms, of offsets with no memory longer than a few points
    """

    inflate: float = 0.0
    smooth: float = 0.0
    cut: float = 0.0
    thickness: object = 4.0
    past: float = 0.0
    jitter: float = 0.0

    def strokes(self, view, seed=0):
        """The strokes of a view by this law, its own strokes' curves and where these end."""
        rng = np.random.default_rng(seed)
        planned, lines, widths = plan(view, StyleConfig(size=SIZE)), [], []
        for i, (a, b) in enumerate(zip(planned.offsets[:-1], planned.offsets[1:], strict=True)):
            curve = planned.xy[a:b][on_curve(planned)[a:b]]
            line = self.moved(curve, contour=planned.kind[i] == KINDS.index("contour"))
            s = SPACING * np.arange(len(line))
            width = np.broadcast_to(
                self.thickness(s, s[-1], curve) if callable(self.thickness) else self.thickness,
                len(line),
            )
            if self.jitter:
                line = line + jitter(len(line), self.jitter, rng)[:, None] * normals(line)
            past = rng.uniform(*np.broadcast_to(self.past, 2), size=2)
            ends = [
                line[0] - heading(line[:4]) * past[0],
                line[-1] + heading(line[-4:]) * past[1],
            ]
            if self.past:
                line = np.concatenate([[ends[0]], line, [ends[1]]])
                width = np.r_[width[0], width, width[-1]]
            lines.append(line)
            widths.append(width)
        offsets = np.r_[0, np.cumsum([len(line) for line in lines])]
        none = np.zeros(len(lines), bool)
        return Strokes(np.concatenate(lines), np.concatenate(widths), offsets, planned.kind, none)

    def moved(self, curve, contour):
        out = curve
        if self.smooth:
            out = smoothed(curve, self.smooth)
        if self.cut:
            keep = simplify(curve, self.cut)
            row = np.arange(len(curve))
            out = np.stack([np.interp(row, keep, curve[keep, k]) for k in (0, 1)], axis=1)
        return out + self.inflate * outward(curve) if contour else out

    def exemplar(self, view):
        return exemplar_of(self.strokes(view))


def exemplar_of(strokes, ink=(0.1, 0.1, 0.1, 1.0)):
    drawing = Drawing(strokes, (SIZE, SIZE), np.tile(ink, (len(strokes), 1)))
    rgb = rasterise(drawing, 1.0, (1.0, 1.0, 1.0)).astype(np.float32) / 255
    return separate(np.dstack([rgb, np.ones(rgb.shape[:2], np.float32)]))


def taper(s, length, xy):
    """From 8 px at the start of a stroke to 3 px."""
    return 3.0 + 5.0 * np.exp(-s / min(40.0, 0.3 * length))


def deeper_is_wider(s, length, xy):
    """From 2 px at the left, where depth is least, to 8 px."""
    return 2.0 + 6.0 * xy[:, 0] / SIZE


# ------------------------------------------------------------------------------- planned strokes


def planned(*lines, past=0):
    """Strokes along polylines in steps of 3 px, whose first and last `past` points overshoot."""
    offsets = np.r_[0, np.cumsum([len(line) for line in lines])]
    beyond = np.zeros(offsets[-1])
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        for k in range(past):
            beyond[[a + past - 1 - k, b - past + k]] = 3.0 * (k + 1)
    rows = np.arange(offsets[-1])
    return Planned(
        np.concatenate(lines).astype(float),
        offsets,
        np.zeros(len(lines), np.int8),
        np.stack([rows, rows], axis=1),
        np.zeros(len(rows)),
        beyond,
    )


def level(y, first=20, last=280):
    x = np.arange(first, last, 3.0)
    return np.stack([x, np.full(len(x), float(y))], axis=1)


# -------------------------------------------------------------------------------------- geometry


def on_curve(planned):
    return planned.on_curve


def heading(points):
    step = points[-1] - points[0]
    return step / np.hypot(*step)


def normals(line):
    t = np.gradient(line, axis=0)
    t /= np.hypot(*t.T)[:, None]
    return np.stack([-t[:, 1], t[:, 0]], axis=1)


def outward(line):
    """Unit normals of part of a blob's outline, away from its centre."""
    middle = (np.floor(line.mean(axis=0) / (SIZE / BLOBS)) + 0.5) * (SIZE / BLOBS)
    n = normals(smoothed(line, 4.0))
    return n * np.sign((n * (line - middle)).sum(axis=1))[:, None]


def smoothed(line, sigma):
    """A Gaussian of `sigma` px along a line that is mirrored in its end points, which so stay."""
    n = len(line) - 1
    mirrored = np.concatenate([2 * line[0] - line[n:0:-1], line, 2 * line[-1] - line[-2::-1]])
    return ndimage.gaussian_filter1d(mirrored, sigma / SPACING, axis=0, mode="nearest")[
        n : 2 * n + 1
    ]


def jitter(count, rms, rng):
    """Noise of about 4 px correlation length and the given rms."""
    noise = ndimage.gaussian_filter1d(rng.normal(size=count + 40), 1.5)[20:-20]
    return rms * noise / 0.4337  # what the Gaussian leaves of white noise


# ------------------------------------------------------------------------------------ comparison


@dataclass(frozen=True)
class Comparison:
    """Drawn strokes against those of a law, at the law's points on contours (N,).

    outside : px by which the drawn line lies outside the law's
    apart : px between the lines
    thickness, wanted : px, drawn and by the law
    """

    outside: np.ndarray
    apart: np.ndarray
    thickness: np.ndarray
    wanted: np.ndarray


def compare(drawn, wanted, kind="contour"):
    """Compare drawn strokes with wanted ones of a kind, but for the ends of these."""
    lines = [evenly_with(drawn, i) for i in range(len(drawn))]
    at, width = (np.concatenate(part) for part in zip(*lines, strict=True))
    tree, rows = cKDTree(at), []
    for i in np.flatnonzero(wanted.kind == KINDS.index(kind)):
        a, b = wanted.offsets[i], wanted.offsets[i + 1]
        line = wanted.xy[a:b]
        _, nearest = tree.query(line)
        off = ((at[nearest] - line) * outward(line)).sum(axis=1)
        rows.append(np.stack([off, width[nearest], wanted.thickness[a:b]], axis=1)[5:-5])
    off, thickness, law = np.concatenate(rows).T
    return Comparison(off, np.abs(off), thickness, law)


def evenly_with(strokes, i):
    """Points of stroke i a quarter of a pixel apart, and the thickness there."""
    a, b = strokes.offsets[i], strokes.offsets[i + 1]
    line, width = strokes.xy[a:b], strokes.thickness[a:b]
    s = np.r_[0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]
    at = np.linspace(0, s[-1], int(4 * s[-1]) + 2)
    return np.stack([np.interp(at, s, c) for c in line.T], axis=1), np.interp(at, s, width)


def overshoots(drawn, view):
    """px that strokes run past both ends of their curves, until they are half as wide: (C, 2)."""
    planned, out = plan(view, StyleConfig(size=SIZE)), []
    middles = np.array([drawn.xy[a:b].mean(axis=0) for a, b in spans(drawn.offsets)])
    for a, b in spans(planned.offsets):
        curve = planned.xy[a:b][on_curve(planned)[a:b]]
        i = np.hypot(*(middles - curve.mean(axis=0)).T).argmin()
        line, width = evenly_with(drawn, i)
        out.append([past_end(line[::-1], width[::-1], curve[::-1]), past_end(line, width, curve)])
    return np.array(out)


def past_end(line, width, curve):
    """px from the end of a curve to where the end of a line over it is half as wide as there."""
    past = (line - curve[-1]) @ heading(curve[-4:])
    near = np.abs(past) + np.abs((line - curve[-1]) @ normals(curve[-4:])[-1]) < 40
    near[: len(near) // 2] = False
    half = 0.5 * width[near][np.abs(past[near]).argmin()]
    return past[near & (width > half)].max()


def spans(offsets):
    return zip(offsets[:-1], offsets[1:], strict=True)


def without_residuals(config, **changes):
    """A fit's settings that leave chance and texture out."""
    return replace(config, residuals=0.0, texture=False, **changes)
