"""Lines drawn on a plate that is seen from in front: sheets and strokes made by hand."""

from dataclasses import replace

import numpy as np

from strokestyle.extract.camera import Camera
from strokestyle.extract.rays import Bvh
from strokestyle.geometry.curves import Curves
from strokestyle.geometry.kinds import KINDS
from strokestyle.mesh.surface import make_surface
from strokestyle.motion.candidates import Candidates, Traces
from strokestyle.motion.frames import Shot
from strokestyle.motion.places import Places
from strokestyle.motion.sheets import PLANNED, Points
from strokestyle.render.plan import Planned

SIZE = 200
VALLEY = KINDS.index("valley")
CORNERS = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
SURFACE = make_surface(CORNERS, np.array([[0, 1, 2], [0, 2, 3]]))
CAMERA = Camera([0, 0, 2], [0, 0, 0], [0, 1, 0], None, SIZE, SIZE, 1.0)
SHOT = Shot(SURFACE, CAMERA)
BVH = Bvh(SURFACE)


def places_of(xy):
    """The places of the plate that are seen at pixels (n, 2)."""
    point = np.column_stack([xy[:, 0] / SIZE - 0.5, 0.5 - xy[:, 1] / SIZE, np.zeros(len(xy))])
    below = point[:, 1] <= point[:, 0]
    first = {tuple(np.round(v, 6)): i for i, v in enumerate(SURFACE.vertices)}
    lower = [f for f in range(2) if first[(0.5, -0.5, 0.0)] in SURFACE.faces[f]][0]
    return Places.of(SHOT, np.where(below, lower, 1 - lower), point, xy)


def planned(strokes):
    """A frame whose planned strokes are polylines [(n, 2), ...], valleys of the plate."""
    curves = Curves.from_list(strokes)
    count = len(curves.xy)
    nothing = np.zeros((count, 2), np.int64)
    kind = np.full(len(strokes), VALLEY, np.int8)
    none = np.zeros(count)
    plan = Planned(curves.xy, curves.offsets, kind, nothing, none, none)
    traces = Traces(np.zeros((0, 2)), np.zeros((0, 2)), nothing[:0, 0], np.zeros((0, 3)))
    kinds = np.full(count, VALLEY)
    return Candidates(SHOT, BVH, plan, places_of(curves.xy), kinds, None, traces, 1.0)


def sheet(number, xy, along=None):
    """A sheet's points (n, 2), one of them a stroke's, where it is `along` (n,); else from 0 on."""
    count = len(xy)
    if along is None:
        along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(xy, axis=0).T))]
    no, yes = np.zeros(count, bool), np.ones(count, bool)
    numbers = np.arange(count)
    return Points(
        np.full(count, number), np.asarray(along, float), places_of(xy), xy,
        np.full(count, VALLEY), np.full(count, PLANNED), yes, no, no,
        np.zeros(count, np.int64), np.zeros(count, np.int64), 1000 * number + numbers,
    )  # fmt: skip


def line(start, stop, spacing=3.0):
    """Evenly spaced points on a straight line, (n, 2)."""
    start, stop = np.array(start, float), np.array(stop, float)
    count = int(np.hypot(*(stop - start)) / spacing) + 1
    return start + np.linspace(0, 1, count)[:, None] * (stop - start)


def loose(points, rows, support):
    """The same points, some of which are not a planned stroke's."""
    kept, number = points.support.copy(), points.row.copy()
    kept[rows], number[rows] = support, -1
    return replace(points, support=kept, row=number)
