"""How well strokes keep together from frame to frame, measured on the frames' SVG files alone.

    python experiments/coherence.py MODEL MESH --frames 36 [--still] [--json] [-- render's options]
    python experiments/coherence.py MESH [MESH ...] --svg DIR [--path CAMERAS.json] [--json]

The first draws a turntable through the command line and measures it; the second measures frames
that are there already: of a turntable, of a list of cameras, or of a mesh for each frame. Nothing
of `strokestyle.motion` is used. Every stroke's points are put on the lines that the surface has
there, as seen from the frame's camera, and carried to the next frame: with the surface where a line
lies still on it, and through SUBSTEPS cameras between the two where a line moves over it, so far as
it can be followed. What is visible there is what the next frame could show; its strokes are
compared with that.

lost       strokes of which most could be shown, and strokes lie along less than half of that
split      strokes that several strokes go on, each with a good share of what could be shown
begin      strokes that begin elsewhere: BEGIN px or more from where the surface took the beginning,
           what was hidden in one of the two frames not counted; and those drawn the other way round
length     strokes that are longer or shorter by half than what could be shown of them
persist    share of the length that could be shown over which a stroke of the same kind lies, by
           kind, and in brackets one of any kind. For contours and suggestive contours, what could
           be shown is what can be followed
pops       strokes that are there all at once, or gone: more than half of the thickness and of the
           length that they have within AHEAD frames, at a place that was visible before; a frame
jitter     px rms by which a stroke's distance from its line changes
swim       px by which the texture slides along a stroke over the surface, mean of windows that can
           be recognised, and `known`, the share that can
stretch    |log2| of the texture's local change of length, beside that of the line, 90th percentile
missing    tracks that are absent in a frame between two in which they are drawn
moved      strokes that lie elsewhere in the next frame than under their own track
renamed    strokes that go on, under another track

With --against DIR, frames of the same cameras that were drawn one by one: how much of their lines
these frames draw, and how much of what these draw is not on lines of theirs."""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from strokestyle.drawing.ribbon import ribbon
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.extract.camera import DEFAULT_SIZE, Camera, fit_camera, up_axis
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.rays import Bvh
from strokestyle.extract.surface_curves import barycentric
from strokestyle.extract.turntable import fit_turntable_camera
from strokestyle.geometry.curves import KINDS, arc
from strokestyle.geometry.kinds import KIND_TABLE
from strokestyle.mesh.sequence import load_sequence
from strokestyle.mesh.surface import Surface, load_surface
from strokestyle.svg.read import read_svg

SUBSTEPS = 10
STEP = 2.0  # px between the points that stand for a stroke
FINE = 1.5  # px between those that stand for a line of the surface
NEAR = 14.0  # px from its line at which a stroke may be drawn
SAME = 4.0  # px between two places that are one place of one line
FOLLOW = (
    3.0  # px that a line is found off from one substep to the next, in the picture and in depth
)
OTHER_KIND = 0.8  # what going on as another kind of line is worth beside going on as the same
PARALLEL = 0.6  # least cosine between strokes along each other
MOST, GOOD = 0.5, 0.2  # shares of a stroke
BEGIN = 10.0  # px
AHEAD = 6  # frames
WINDOW, SHIFT = 48, 16  # px of texture that is recognised, and of how far it is looked for

MOVES = np.array([kind.follows_camera and kind.name != "crease" for kind in KIND_TABLE])
SHARP = np.array([kind.sharp for kind in KIND_TABLE])
SHOWN = ("contour", "suggestive", "crease", "valley", "ridge")


# ----------------------------------------------------------------------------------- what is shown


@dataclass(frozen=True)
class Look:
    """The visible lines of a surface from one camera, as points FINE px apart or less.

    `xy` (n, 2) px, `place` (n, 3), `face`, `kind` (n,), `along` (n, 2): unit direction
    """

    xy: np.ndarray
    place: np.ndarray
    face: np.ndarray
    kind: np.ndarray
    along: np.ndarray

    def tree(self, only: np.ndarray | None = None) -> tuple[cKDTree, np.ndarray]:
        rows = np.arange(len(self.xy)) if only is None else np.flatnonzero(only)
        return cKDTree(self.xy[rows] if len(rows) else np.full((1, 2), 1e9)), rows


class Scene:
    """A surface and a camera at every moment t, in frames; looks are worked out once."""

    def __init__(self, shots: Callable[[float], tuple[Surface, Camera]], count: int, loop: bool):
        self.shots, self.count, self.loop = shots, count, loop
        self._lines: dict[int, SurfaceLines] = {}
        self._looks: dict[float, Look] = {}

    def lines(self, surface: Surface) -> SurfaceLines:
        if id(surface) not in self._lines:
            if len(self._lines) > 4:  # of a shape that deforms, the last few
                self._lines.pop(next(iter(self._lines)))
            self._lines[id(surface)] = SurfaceLines(surface, LineOptions())
        return self._lines[id(surface)]

    def look(self, t: float) -> Look:
        key = round(t % self.count if self.loop else t, 6)
        if key not in self._looks:
            if len(self._looks) > 40:
                self._looks.pop(next(iter(self._looks)))
            surface, camera = self.shots(key)
            self._looks[key] = look(self.lines(surface), camera)
        return self._looks[key]

    def bvh(self, surface: Surface) -> Bvh:
        return self.lines(surface).bvh


def look(lines: SurfaceLines, camera: Camera) -> Look:
    surface, found = lines.surface, lines.seen_from(camera)
    points = found.points(surface)
    first = np.setdiff1d(np.arange(len(points)), found.offsets[1:] - 1)
    ends = [camera.project(points[first + k])[0] for k in (0, 1)]
    along = ends[1] - ends[0] if len(first) else np.zeros((0, 2))
    size = np.hypot(*along.T)
    count = np.maximum(np.ceil(size / FINE), 1).astype(int)
    row = np.repeat(np.arange(len(first)), count)
    t = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[row]
    place = points[first[row]] + t[:, None] * (points[first + 1] - points[first])[row]
    kind = np.repeat(found.kind, np.diff(found.offsets))[first[row]]
    face = found.face[first[row]]
    xy = camera.project(place)[0]
    seen = lines.bvh.seen(camera.viewpoint, face, place, SHARP[kind])
    seen &= ((xy > 0) & (xy < [camera.width, camera.height])).all(axis=1)
    unit = (along / np.maximum(size, 1e-9)[:, None])[row]
    return Look(xy[seen], place[seen], face[seen], kind[seen], unit[seen])


# -------------------------------------------------------------------------------- what was drawn


@dataclass(frozen=True)
class Marks:
    """The strokes of one frame as n points STEP px apart, and the places of lines they stand for.

    `xy` where it is drawn and `heading` whither; `at` where its line is, and `off` px from there to
    the left; `place`, `face` on the surface; `known`: there is such a place; `stroke`, `s`: which
    stroke, and px along it
    """

    drawing: Drawing
    track: np.ndarray | None
    xy: np.ndarray
    heading: np.ndarray
    stroke: np.ndarray
    s: np.ndarray
    kind: np.ndarray
    at: np.ndarray
    off: np.ndarray
    place: np.ndarray
    face: np.ndarray
    known: np.ndarray
    length: np.ndarray
    rows: list[np.ndarray] = field(default_factory=list)


def sampled(strokes: Strokes) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points of strokes STEP px apart: where, on which stroke, px along it; and all lengths."""
    xy, stroke, s, length = [np.zeros((0, 2))], [], [], np.zeros(len(strokes))
    for i in range(len(strokes)):
        points = strokes.xy[strokes.rows(i)]
        along = arc(points)
        length[i] = along[-1]
        at = np.linspace(0.0, along[-1], max(2, round(along[-1] / STEP) + 1))
        xy.append(np.stack([np.interp(at, along, column) for column in points.T], axis=1))
        stroke.append(np.full(len(at), i))
        s.append(at)
    none = [np.zeros(0)]
    return (
        np.concatenate(xy),
        np.concatenate(stroke or none).astype(int),
        np.concatenate(s or none),
        length,
    )


def put_on_lines(drawing: Drawing, scene: Scene, t: int) -> Marks:
    surface, camera = scene.shots(t)
    look = scene.look(t)
    xy, stroke, s, length = sampled(drawing.strokes)
    kind = drawing.strokes.kind[stroke].astype(int)
    heading = np.zeros_like(xy)
    rows = [np.flatnonzero(stroke == i) for i in range(len(length))]
    for of in rows:
        step = np.gradient(xy[of], axis=0)
        heading[of] = step / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    found = np.full(len(xy), -1)
    for only in (*np.unique(kind), None):  # a line of its own kind, or else of any
        ask = np.flatnonzero((found < 0) & ((kind == only) if only is not None else True))
        tree, of = look.tree(None if only is None else look.kind == only)
        away, near = tree.query(xy[ask], k=1, distance_upper_bound=NEAR)
        hit = np.flatnonzero(np.isfinite(away))
        pick = of[near[hit]] if len(of) else np.zeros(0, int)
        parallel = np.abs((look.along[pick] * heading[ask[hit]]).sum(axis=1)) > PARALLEL
        found[ask[hit[parallel]]] = pick[parallel]
    known = found >= 0
    at, place, face = xy.copy(), np.zeros((len(xy), 3)), np.full(len(xy), -1)
    at[known], place[known], face[known] = (
        a[found[known]] for a in (look.xy, look.place, look.face)
    )
    # where a stroke stands for no line that is known, it is painted on the surface
    for of in rows:
        if known[of].mean() < 0.5:
            ask = of[~known[of]]
            hits = scene.bvh(surface).first_hit(
                camera.origins(xy[ask]), camera.rays(xy[ask]).astype(np.float32)
            )
            on = hits.face >= 0
            corner = surface.vertices[surface.faces[hits.face[on]]]
            place[ask[on]] = np.einsum("ni,nik->nk", hits.bary[on], corner)
            face[ask[on]], known[ask[on]] = hits.face[on], True
    left = np.stack([heading[:, 1], -heading[:, 0]], axis=1)
    off = ((xy - at) * left).sum(axis=1)
    return Marks(
        drawing,
        getattr(drawing, "track", None),
        xy,
        heading,
        *(stroke, s, kind, at, off, place, face, known, length, rows),
    )


# ------------------------------------------------------------------------------------ and carried


def carried(marks: Marks, scene: Scene, t: int, to: int) -> tuple[np.ndarray, np.ndarray]:
    """Carry the places of marks at frame t to the frame `to` beside it.

    Returns where they are there (n, 2) px, and whether they are visible there (n,) bool; of lines
    that move over the surface, whether they can be followed up to there.
    """
    (here, _), (there, camera) = scene.shots(t), scene.shots(to)
    place = marks.place.copy()
    if there is not here and marks.known.any():
        of = np.flatnonzero(marks.known)
        bary = barycentric(here.vertices[here.faces[marks.face[of]]], place[of][:, None])[:, 0]
        place[of] = np.einsum("ni,nik->nk", bary, there.vertices[there.faces[marks.face[of]]])
    xy = np.where(marks.known[:, None], camera.project(place)[0], -1e6)
    seen = np.zeros(len(xy), bool)
    ask = np.flatnonzero(marks.known & ~MOVES[marks.kind])
    seen[ask] = scene.bvh(there).seen(
        camera.viewpoint, marks.face[ask], place[ask], SHARP[marks.kind[ask]]
    )
    seen &= ((xy > 0) & (xy < [camera.width, camera.height])).all(axis=1)
    ask = np.flatnonzero(marks.known & MOVES[marks.kind])
    if len(ask):
        xy[ask], seen[ask] = followed(marks.place[ask], marks.face[ask], scene, t, to)
    return xy, seen


def followed(
    place: np.ndarray, face: np.ndarray, scene: Scene, t: int, to: int
) -> tuple[np.ndarray, np.ndarray]:
    """Follow places (n, 3) of moving lines through SUBSTEPS cameras."""
    alive = np.ones(len(place), bool)
    place, face, surface = place.copy(), face.copy(), scene.shots(t)[0]
    xy = np.zeros((len(place), 2))
    for k in range(1, SUBSTEPS + 1):
        moment = t + (to - t) * k / SUBSTEPS
        moment = moment % scene.count if scene.loop else moment
        now, camera = scene.shots(round(moment, 6))
        if now is not surface:
            bary = barycentric(surface.vertices[surface.faces[face]], place[:, None])[:, 0]
            place, surface = np.einsum("ni,nik->nk", bary, now.vertices[now.faces[face]]), now
        look = scene.look(moment)
        tree, of = look.tree(MOVES[look.kind])
        guess, depth = camera.project(place)
        away, near = tree.query(guess, distance_upper_bound=FOLLOW)
        hit = np.isfinite(away) & (len(of) > 0)
        pick = of[np.where(hit, near, 0)] if len(of) else np.zeros(len(place), int)
        if len(of):
            scale = (
                camera.focal / np.maximum(depth, 1e-9) if camera.extent is None else camera.focal
            )
            deep = np.abs(camera.project(look.place[pick])[1] - depth) * scale
            hit &= deep < 8 * FOLLOW
        alive &= hit
        place[hit], face[hit], xy[hit] = (
            look.place[pick][hit],
            look.face[pick][hit],
            look.xy[pick][hit],
        )
    return xy, alive


@dataclass(frozen=True)
class Link:
    """What of the marks of one frame goes on in another.

    `at` (n, 2) and `seen` (n,) as `carried`; `heir` (n,) the stroke that each visible point lies on
    there, the main one of its stroke where it can be, -1 for none, and `mark` (n,) its nearest
    point; `share` (C,) of each stroke's length that is seen; `main` (C,) its main heir or -1;
    `kept` (C,) share of what is seen on any heir; `many` (C,) heirs with a good share
    """

    at: np.ndarray
    seen: np.ndarray
    heir: np.ndarray
    mark: np.ndarray
    share: np.ndarray
    main: np.ndarray
    kept: np.ndarray
    many: np.ndarray


def link(one: Marks, two: Marks, at: np.ndarray, seen: np.ndarray) -> Link:
    count = len(one.length)
    heir, mark = np.full(len(at), -1), np.full(len(at), -1)
    share, kept = np.zeros(count), np.zeros(count)
    main, many = np.full(count, -1), np.zeros(count, int)
    trees = [cKDTree(two.at[rows]) for rows in two.rows]
    tree = cKDTree(two.at) if len(two.at) else None
    for i, rows in enumerate(one.rows):
        told = one.known[rows]
        share[i] = seen[rows].sum() / max(told.sum(), 1)
        ask = rows[seen[rows]]
        if not len(ask) or tree is None:
            continue
        close = {j for near in tree.query_ball_point(at[ask], SAME) for j in two.stroke[near]}
        open_ = np.ones(len(ask), bool)
        spans = {}
        for j in close:
            away, near = trees[j].query(at[ask])
            turn = (one.heading[ask] * two.heading[two.rows[j][near]]).sum(axis=1)
            spans[j] = np.where(np.abs(turn) > PARALLEL, away, np.inf), near
        own = int(one.drawing.strokes.kind[i])
        # the stroke that takes the most of what is left, again; of two side by side the nearer one
        while open_.any() and spans:
            worth = {
                j: float(np.maximum(1 - away[open_] / SAME, 0).sum())
                * (1.0 if two.drawing.strokes.kind[j] == own else OTHER_KIND)
                for j, (away, _) in spans.items()
            }
            best = max(worth, key=lambda j: (worth[j], -j))
            away, near = spans.pop(best)
            got = open_ & (away < SAME)
            if not got.any():
                break
            heir[ask[got]], mark[ask[got]] = best, two.rows[best][near[got]]
            open_ &= ~got
            main[i] = best if main[i] < 0 else main[i]
            many[i] += got.sum() >= GOOD * len(ask) and got.sum() * STEP > BEGIN
        kept[i] = 1 - open_.mean()
    return Link(at, seen, heir, mark, share, main, kept, many)


def begins_elsewhere(one: Marks, two: Marks, on: Link, back: Link, i: int) -> bool:
    """Tell whether stroke i's main heir begins elsewhere than the surface took i's beginning."""
    j = on.main[i]
    rows, theirs = one.rows[i], two.rows[j]
    mine = rows[on.heir[rows] == j]
    if len(mine) < 3:
        return False
    s = two.s[on.mark[mine]]
    closed = one.drawing.strokes.closed[i] and two.drawing.strokes.closed[j]
    if closed:
        turn = np.diff(s)
        turn = turn[np.abs(turn) < 0.5 * two.length[j]]
        if turn.sum() < 0:
            return True
        first = s[0] - one.s[mine[0]]
        return bool(min(first % two.length[j], -first % two.length[j]) > BEGIN)
    if np.median(np.diff(s)) < 0 or s[-1] < s[0]:
        return True
    # what of mine could be shown before the heir begins, and what of the heir was hidden before me
    before = rows[one.s[rows] < one.s[mine[0]] - 0.5]
    gone = on.seen[before].sum() * STEP
    ahead = theirs[two.s[theirs] < s[0] - 0.5]
    new = back.seen[ahead].sum() * STEP
    return bool(max(gone, new) > BEGIN)


def changes_length(one: Marks, two: Marks, on: Link, back: Link, i: int) -> bool:
    """Tell whether the main heir is longer or shorter by half than what could be shown of i."""
    j = on.main[i]
    due = path_length(on.at[one.rows[i]], on.seen[one.rows[i]])
    theirs = two.rows[j]
    told = max(int(two.known[theirs].sum()), 1)
    drawn = path_length(
        two.at[theirs],
        back.seen[theirs] if back.seen[theirs].sum() > 0.1 * told else two.known[theirs],
    )
    return bool(abs(drawn - due) > MOST * due)


def path_length(at: np.ndarray, use: np.ndarray) -> float:
    """Length, px, of the steps between neighbours that are both in use, smoothed over noise."""
    if use.sum() < 2:
        return 0.0
    step = np.hypot(*np.diff(at, axis=0).T)
    both = use[1:] & use[:-1]
    return float(np.minimum(step[both], 3 * STEP).sum())


# ----------------------------------------------------------------------------------- the texture


def profile(drawing: Drawing, i: int, s: np.ndarray, lanes: int = 6) -> np.ndarray:
    """Opacity of stroke i's strip at places s (m,) px along its centre line, (m, lanes)."""
    texture = drawing.texture
    assert texture is not None
    strip = texture.rgba[texture.offsets[i] : texture.offsets[i + 1], :, 3].astype(float) / 255
    margin = float(np.broadcast_to(texture.margin, len(drawing.strokes))[i])
    band = ribbon(drawing.strokes, i, margin)
    lead = 0.0 if band.closed else float(band.half[0])
    length = arc(drawing.strokes.xy[drawing.strokes.rows(i)])[-1]
    share = lead + s / max(length, 1e-9) * (
        band.length - (0 if band.closed else lead + band.half[-1])
    )
    row = share / max(band.length, 1e-9) * len(strip) - 0.5
    edges = np.linspace(0, strip.shape[1], lanes + 1)
    parts = [
        strip[:, int(a) : max(int(b), int(a) + 1)].mean(axis=1)
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]
    return np.stack([np.interp(row, np.arange(len(strip)), part) for part in parts], axis=1)


def texture_slides(one: Marks, two: Marks, on: Link) -> tuple[list[float], list[float], int]:
    """Find how far texture slides over the surface in windows along all strokes.

    Returns the slides of windows that are recognised, px, the |log2| stretches between neighbours
    of those, and how many windows there are.
    """
    slides: list[float] = []
    stretches: list[float] = []
    windows = 0
    if one.drawing.texture is None or two.drawing.texture is None:
        return slides, stretches, windows
    for i, j in enumerate(on.main):
        mine = one.rows[i][on.heir[one.rows[i]] == j] if j >= 0 else []
        if len(mine) * STEP < WINDOW + 8:
            continue
        s, theirs = one.s[mine], two.s[on.mark[mine]]
        keep = np.r_[True, np.diff(np.maximum.accumulate(theirs)) > 0]
        if keep.sum() < 8 or theirs[-1] < theirs[0]:
            continue
        s, theirs = s[keep], smooth(theirs[keep])
        grid = np.arange(s[0], s[-1], 1.0)
        to = np.interp(grid, s, theirs)
        here = profile(one.drawing, i, grid)
        there = [profile(two.drawing, j, to + d) for d in range(-SHIFT, SHIFT + 1)]
        last = None
        for a in range(0, len(grid) - WINDOW + 1, WINDOW // 2):
            rows = slice(a, a + WINDOW)
            match = np.array([likeness(here[rows], other[rows]) for other in there])
            if match.max() < -1:
                continue
            windows += 1
            best = int(match.argmax())
            if match[best] < 0.6:
                last = None
                continue
            shift = best - SHIFT + peak(match, best)
            slides.append(abs(shift))
            if last is not None:
                stretches.append(abs(np.log2(max(1 + (shift - last) / (WINDOW / 2), 0.1))))
            last = shift
    return slides, stretches, windows


def smooth(values: np.ndarray) -> np.ndarray:
    """Running mean over 7 points, the ends kept."""
    padded = np.r_[
        [2 * values[0] - v for v in values[3:0:-1]],
        values,
        [2 * values[-1] - v for v in values[-2:-5:-1]],
    ]
    return np.convolve(padded, np.full(7, 1 / 7), "valid")


def peak(match: np.ndarray, best: int) -> float:
    """Vertex of the parabola through the best value and its neighbours, relative to it."""
    if not 0 < best < len(match) - 1:
        return 0.0
    a, b, c = match[best - 1 : best + 2]
    return float(0.5 * (a - c) / min(a - 2 * b + c, -1e-9))


def likeness(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation of two windows less their own lanes' means; -2 where one has no grain."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    power = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / power) if min(a.std(), b.std()) > 0.02 else -2.0


# --------------------------------------------------------------------------------- all in numbers


def measure(drawings: Sequence[Drawing], scene: Scene) -> dict:
    """All figures of an animation, and the events behind them."""
    marks = [put_on_lines(drawing, scene, t) for t, drawing in enumerate(drawings)]
    count = len(marks)
    pairs = [(t, t + 1) for t in range(count - 1)] + ([(count - 1, count)] if scene.loop else [])
    links = []
    rows = []
    for t, to in pairs:
        one, two = marks[t], marks[to % count]
        on = link(one, two, *carried(one, scene, t, to))
        back = link(two, one, *carried(two, scene, to % count, to % count - 1))
        links.append((on, back))
        rows.append(pair_row(one, two, on, back, t))
    find_pops(marks, links, rows, scene.loop)
    events = [event for row in rows for event in row.pop("events")]
    report = {"frames": count, **total(rows), "events": events}
    if scene.loop:
        report["seam"] = total(rows[-1:])
    report["strokes"] = float(np.mean([len(m.length) for m in marks]))
    report["drawn_px"] = float(np.mean([m.length.sum() for m in marks]))
    if marks[0].track is not None:
        report |= of_tracks(marks, links, scene.loop, events)
    return report


def pair_row(one: Marks, two: Marks, on: Link, back: Link, t: int) -> dict:
    """What is counted between two frames."""
    due = (on.share >= MOST) & (one.length > BEGIN)
    lost = due & (on.kept < MOST)
    split = due & (on.many > 1)
    heirs = np.flatnonzero(due & (on.main >= 0) & (on.kept >= MOST))
    begin = [i for i in heirs if begins_elsewhere(one, two, on, back, i)]
    length = [i for i in heirs if changes_length(one, two, on, back, i)]
    row: dict = {"due": int(due.sum()), "heirs": len(heirs), "events": []}
    for name, which in (
        ("lost", np.flatnonzero(lost)),
        ("split", np.flatnonzero(split)),
        ("begin", begin),
        ("length", length),
    ):
        row[name] = len(which)
        row["events"] += [
            (
                name,
                t,
                int(i),
                None if one.track is None else int(one.track[i]),
                *map(int, one.xy[one.rows[i][0]]),
            )
            for i in which
        ]
    for k in SHOWN:
        here = (one.kind == KINDS.index(k)) & on.seen
        goes_on = here & (on.heir >= 0)
        row[f"seen {k}"], row[f"any {k}"] = int(here.sum()), int(goes_on.sum())
        row[f"kept {k}"] = int((two.drawing.strokes.kind[on.heir[goes_on]] == KINDS.index(k)).sum())
    with_heir = np.flatnonzero((on.heir >= 0) & (on.heir == on.main[one.stroke]))
    change = one.off[with_heir] - two.off[on.mark[with_heir]]
    row["jitter"], row["jitters"] = float((change**2).sum()), len(change)
    row["slides"], row["stretches"], row["windows"] = texture_slides(one, two, on)
    return row


def find_pops(
    marks: list[Marks], links: list[tuple[Link, Link]], rows: list[dict], loop: bool
) -> None:
    """Count in each pair's row the strokes that are there all at once, and those that are gone."""
    count = len(marks)
    size = []
    for m in marks:
        thick = m.drawing.strokes.thickness * np.repeat(
            m.drawing.color[:, 3] > 0, np.diff(m.drawing.strokes.offsets)
        )
        size.append(
            [
                (float(np.median(thick[m.drawing.strokes.rows(i)])), m.length[i])
                for i in range(len(m.length))
            ]
        )
    for k, row in enumerate(rows):
        row["born"] = row["gone"] = 0
        for name, forward in (("born", True), ("gone", False)):
            on, back = links[k]
            new, frame = (back, (k + 1) % count) if forward else (on, k)
            for i in np.flatnonzero(
                (new.share >= MOST) & (new.kept < GOOD) & (marks[frame].length > BEGIN)
            ):
                life, f, j = [size[frame][i]], frame, int(i)
                for _ in range(AHEAD):
                    step = f if forward else f - 1
                    if not (loop or 0 <= step < len(links)):
                        break
                    j = int(links[step % len(links)][0 if forward else 1].main[j])
                    f = (f + (1 if forward else -1)) % count
                    if j < 0:
                        break
                    life.append(size[f][j])
                thick, long = np.array(life).T
                if thick[0] > MOST * thick.max() and long[0] > MOST * long.max():
                    row[name] += 1
                    track = marks[frame].track
                    row["events"].append(
                        (
                            name,
                            frame,
                            int(i),
                            None if track is None else int(track[i]),
                            *map(int, marks[frame].xy[marks[frame].rows[i][0]]),
                        )
                    )


def total(rows: list[dict]) -> dict:
    """Figures of some pairs of frames together."""

    def add(name: str) -> float:
        return float(sum(row[name] for row in rows))

    due, heirs = max(add("due"), 1), max(add("heirs"), 1)
    out = {
        name: add(name) / (due if name in ("lost", "split") else heirs)
        for name in ("lost", "split", "begin", "length")
    }
    shown = [k for k in SHOWN if add(f"seen {k}") * STEP > 200]
    for name, counted in (("persist", "kept"), ("persist_any", "any")):
        out[name] = {k: add(f"{counted} {k}") / add(f"seen {k}") for k in shown}
    out["born"], out["gone"] = add("born") / len(rows), add("gone") / len(rows)
    out["jitter"] = float(np.sqrt(add("jitter") / max(add("jitters"), 1)))
    slides, stretches = (
        np.concatenate([row[name] for row in rows] or [[]]) for name in ("slides", "stretches")
    )
    out["windows"] = int(add("windows"))
    if add("windows"):
        out["known"] = len(slides) / add("windows")
        out["swim"] = float(slides.mean()) if len(slides) else None
        out["stretch"] = float(np.percentile(stretches, 90)) if len(stretches) else None
    return out


def of_tracks(marks: list[Marks], links: list[tuple[Link, Link]], loop: bool, events: list) -> dict:
    """What the tracks that a file names say: how many, how long they last, where they break."""
    count = len(marks)
    told = [np.asarray(m.track) for m in marks]
    missing = 0
    for f in range(0 if loop else 1, count if loop else count - 1):
        away = np.setdiff1d(np.intersect1d(told[f - 1], told[(f + 1) % count]), told[f])
        missing += len(away)
        events += [("missing", f, -1, int(track), 0, 0) for track in away]
    same = moved = renamed = due = 0
    for k, (on, _) in enumerate(links):
        one, two = marks[k], marks[(k + 1) % count]
        where = {int(track): j for j, track in enumerate(told[(k + 1) % count])}
        for i, track in enumerate(told[k]):
            rows = one.rows[i][on.seen[one.rows[i]]]
            if len(rows) * STEP < 2 * BEGIN:
                continue
            j = where.get(int(track))
            due += 1
            if j is None:
                renamed += bool(on.kept[i] >= MOST)
                if on.kept[i] >= MOST:
                    events.append(("renamed", k, i, int(track), *map(int, one.xy[one.rows[i][0]])))
                continue
            same += 1
            away = cKDTree(two.at[two.rows[j]]).query(on.at[rows])[0]
            if (away < SAME).mean() < MOST:
                moved += 1
                events.append(("moved", k, i, int(track), *map(int, one.xy[one.rows[i][0]])))
    lives = (
        np.bincount(np.unique(np.concatenate(told), return_inverse=True)[1])
        if count
        else np.zeros(0)
    )
    return {"tracks": len(lives), "life": float(np.mean(lives)), "missing": missing / count,
            "moved": moved / max(same, 1), "renamed": renamed / max(due, 1)}  # fmt: skip


def beside(drawings: Sequence[Drawing], others: Sequence[Drawing], scene: Scene) -> dict:
    """Compare the lines that frames draw with those of other drawings of the same shots."""
    length, met, other_length, other_met = [], [], [], []
    for t, pair in enumerate(zip(drawings, others, strict=True)):
        one, two = (put_on_lines(drawing, scene, t) for drawing in pair)
        for a, b, size, along in ((one, two, length, met), (two, one, other_length, other_met)):
            near = cKDTree(b.at).query_ball_point(a.at, 1.5 * SAME)
            parallel = [
                bool((np.abs(b.heading[k] @ heading) > PARALLEL).any()) if k else False
                for k, heading in zip(near, a.heading, strict=True)
            ]
            size.append(len(a.at) * STEP)
            along.append(sum(parallel) * STEP)
    share = np.array(other_met) / np.maximum(other_length, 1)
    extra = 1 - np.array(met) / np.maximum(length, 1)
    return {
        "drawn": sum(other_met) / sum(other_length), "drawn_least": float(share.min()),
        "extra": 1 - sum(met) / sum(length), "extra_most": float(extra.max()),
        "length": sum(length) / sum(other_length),
    }  # fmt: skip


# ------------------------------------------------------------------------------------------ input


def turntable_scene(surface: Surface, count: int, size: tuple[int, int]) -> Scene:
    camera, axis = (
        fit_turntable_camera(surface.vertices, width=size[0], height=size[1]),
        up_axis("y"),
    )
    return Scene(lambda t: (surface, camera.turned(360.0 * t / count, axis)), count, True)


def path_scene(surface: Surface, cameras: Sequence[Camera]) -> Scene:
    """A list of cameras; between two of them eye, target and up go straight."""

    def shot(t: float) -> tuple[Surface, Camera]:
        a = min(int(t), len(cameras) - 1)
        one, two = cameras[a], cameras[min(a + 1, len(cameras) - 1)]
        share = t - a
        return surface, replace(
            one,
            **{
                n: getattr(one, n) * (1 - share) + getattr(two, n) * share
                for n in ("eye", "target", "up")
            },
        )

    return Scene(shot, len(cameras), False)


def sequence_scene(surfaces: Sequence[Surface], camera: Camera) -> Scene:
    """A mesh for each frame; between two of them its vertices go straight."""
    made: dict[float, Surface] = dict(enumerate(surfaces))

    def shot(t: float) -> tuple[Surface, Camera]:
        if t not in made:
            a = int(t)
            if len(made) > len(surfaces) + 2 * SUBSTEPS:
                made.pop(next(key for key in made if key % 1))
            made[t] = between(surfaces[a], surfaces[a + 1], t - a)
        return made[t], camera

    return Scene(shot, len(surfaces), False)


def between(one: Surface, two: Surface, share: float) -> Surface:
    """A surface on the straight way from one to another; its curvatures are those of the nearer."""
    mixed = [
        getattr(one, n) * (1 - share) + getattr(two, n) * share for n in ("vertices", "normals")
    ]
    vertices, normals = mixed
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-9)[:, None]
    return replace(one if share < 0.5 else two, vertices=vertices, normals=normals)


def read_frames(folder: Path) -> list[Drawing]:
    files = sorted(folder.glob("*.svg"), key=lambda p: [int(n) for n in re.findall(r"\d+", p.stem)])
    return [read_svg(file) for file in files]


def drawn(
    model: str, mesh: str, count: int, still: bool, folder: Path, more: Sequence[str]
) -> None:
    """Draw a turntable as a user would."""
    command = [
        sys.executable,
        "-m",
        "strokestyle",
        "render",
        model,
        mesh,
        "-o",
        f"{folder}/",
        "--turntable",
        str(count),
    ]
    subprocess.run(
        [*command, *(["--still"] if still else []), *more], check=True, stdout=sys.stderr
    )


# ----------------------------------------------------------------------------------------- output


def lines_of(report: dict) -> list[str]:
    """A report as lines for a reader."""

    def row(name: str, part: dict) -> str:
        share = [f"{100 * part[k]:5.1f} %" for k in ("lost", "split", "begin", "length")]
        kept = ", ".join(
            f"{k} {100 * v:.0f} ({100 * part['persist_any'][k]:.0f}) %"
            for k, v in part["persist"].items()
        )
        texture = ""
        if part.get("windows"):
            swim, stretch = (
                f"{part[k]:.2f}" if part[k] is not None else "-" for k in ("swim", "stretch")
            )
            texture = f"  swim {swim} px, stretch {stretch}, known {100 * part['known']:.0f} %"
        counts = f"{part['born']:.2f} / {part['gone']:.2f}  {part['jitter']:.2f} px"
        return f"{name:8} {' '.join(share)}  {counts}{texture}  {kept}"

    out = [
        f"{report['frames']} frames of {report['strokes']:.0f} strokes, "
        f"{report['drawn_px']:.0f} px",
        "            lost   split   begin  length  born / gone a frame, jitter, texture, persist",
        row("all", report),
    ]
    if "seam" in report:
        out.append(row("seam", report["seam"]))
    if "tracks" in report:
        out.append(
            f"tracks   {report['tracks']}, {report['life']:.1f} frames each; "
            f"missing {report['missing']:.2f} a frame, moved {100 * report['moved']:.1f} %, "
            f"renamed {100 * report['renamed']:.1f} %"
        )
    if "against" in report:
        share = {name: f"{100 * value:.0f} %" for name, value in report["against"].items()}
        out.append(
            f"against  {share['drawn']} of their lines drawn, {share['drawn_least']} in the worst "
            f"frame; {share['extra']} are others, {share['extra_most']} in the worst; "
            f"{share['length']} of their length"
        )
    return out


# --------------------------------------------------------------------------------------- command


def scene_of(options: argparse.Namespace, meshes: Sequence[str], count: int) -> Scene:
    size = tuple(int(n) for n in options.size.split("x"))
    surfaces = load_sequence(meshes) if len(meshes) > 1 else [load_surface(meshes[0])]
    if options.path:
        told = json.loads(Path(options.path).read_text())
        told = told["cameras"] if isinstance(told, dict) else told
        return path_scene(surfaces[0], [Camera.from_dict(one.get("camera", one)) for one in told])
    if len(surfaces) > 1:
        camera = Camera.load(options.camera) if options.camera else None
        all_of = np.concatenate([surface.vertices for surface in surfaces])
        return sequence_scene(surfaces, camera or fit_camera(all_of, width=size[0], height=size[1]))
    return turntable_scene(surfaces[0], count, (size[0], size[1]))


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("inputs", nargs="+", help="MODEL MESH; with --svg, MESH or meshes")
    parser.add_argument("--frames", type=int, default=36)
    parser.add_argument("--still", action="store_true", help="draw each frame as a still")
    parser.add_argument("--svg", type=Path, help="folder with the frames, drawn already")
    parser.add_argument("--path", help="cameras.json that the frames were drawn from")
    parser.add_argument("--camera", help="camera.json of a sequence of meshes")
    parser.add_argument("--size", default=f"{DEFAULT_SIZE}x{DEFAULT_SIZE}")
    parser.add_argument("--keep", type=Path, help="folder in which the frames drawn are kept")
    parser.add_argument("--against", type=Path, help="folder with stills of the same cameras")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--events", action="store_true", help="print each event: what, frame, "
                        "stroke, track, x, y")  # fmt: skip
    options, more = parser.parse_known_args(argv)
    if options.svg:
        drawings = read_frames(options.svg)
        scene = scene_of(options, options.inputs, len(drawings))
    else:
        model, mesh = options.inputs
        with tempfile.TemporaryDirectory() as made:
            folder = options.keep or Path(made)
            drawn(model, mesh, options.frames, options.still, folder, more)
            drawings = read_frames(folder)
        scene = scene_of(options, [mesh], len(drawings))
    report = measure(drawings, scene)
    events = report.pop("events")
    if options.against:
        report["against"] = beside(drawings, read_frames(options.against), scene)
    print(json.dumps({**report, "events": events}) if options.json else "\n".join(lines_of(report)))
    if options.events:
        print(*(" ".join(map(str, event)) for event in sorted(events)), sep="\n")


if __name__ == "__main__":
    main()
