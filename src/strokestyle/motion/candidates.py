"""The strokes that a style would draw of one shot, were it the only one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..extract.line_options import LineOptions
from ..extract.lines import SurfaceLines
from ..extract.pipeline import SeenLines, see_lines
from ..extract.rays import Bvh
from ..extract.visible import Fragments
from ..geometry.curves import stretches, tangents
from ..render.choice import drawn_points
from ..render.plan import Planned, plan_strokes
from ..render.style import Style
from .frames import Shot
from .places import Places

TRACE = 3  # samples of lines, which lie about a px apart


@dataclass(frozen=True)
class Traces:
    """Points of all lines seen, about TRACE px apart, before strokes were made of them.

    Parameters
    ----------
    xy, along : (n, 2), pixels of the canvas, and unit tangents there
    face : (n,) int
    point : (n, 3), where in space they lie
    """

    xy: np.ndarray
    along: np.ndarray
    face: np.ndarray
    point: np.ndarray

    @classmethod
    def of(cls, fragments: Fragments) -> Traces:
        """Take every so many of the points of what is seen of lines."""
        assert fragments.point is not None  # of lines that a camera saw
        curves = fragments.curves
        rows = np.arange(0, len(curves.xy), TRACE)
        along = tangents(curves.xy, curves.offsets)[rows]
        return cls(curves.xy[rows], along, fragments.face[rows], fragments.point[rows])


@dataclass(frozen=True)
class Candidates:
    """The strokes that a style would draw of one shot.

    Parameters
    ----------
    shot : what is seen
    bvh : of its surface, all that is kept of what its lines were found with
    planned : strokes of N points, px of the style's canvas, that end where their curves do
    places : of their points
    kind : (N,) int8, of the line that each point comes from
    part_face : (N,) int, the face whose part each point belongs to, or None where all is one part
    traces : what is seen of all lines, those included of which no stroke was made
    scale : how many px of the canvas one of the style's is
    """

    shot: Shot
    bvh: Bvh
    planned: Planned
    places: Places
    kind: np.ndarray
    part_face: np.ndarray | None
    traces: Traces
    scale: float


def candidates(
    shots: Iterable[Shot],
    style: Style,
    options: LineOptions | None,
    spacing: float,
    optional: bool,
) -> Iterator[Candidates]:
    """Plan the strokes of shots one by one; arguments are those of `track_frames`."""
    lines = None
    for shot in shots:
        if lines is None or lines.surface is not shot.surface:
            lines = SurfaceLines(shot.surface, options or LineOptions())
        yield _plan(shot, lines, style, see_lines(lines, shot.camera, spacing, optional))


def _plan(shot: Shot, lines: SurfaceLines, style: Style, seen: SeenLines) -> Candidates:
    config = style.config
    scale = max(shot.camera.width, shot.camera.height) / config.size
    curves, rows, _ = stretches(seen.curves, _drawn(shot, lines, style, seen, scale))
    planned = plan_strokes(
        replace(curves, xy=curves.xy / scale),
        config.spacing,
        config.join_gap,
        config.corner_angle,
        cut_tolerance=config.cut_tolerance,
    )
    near = planned.source[np.arange(len(planned.xy)), (planned.mix >= 0.5).astype(int)]
    row = rows[near]
    places = Places.of(shot, seen.face[row], seen.point[row], planned.xy * scale)
    part_face = None if seen.part_face is None else seen.part_face[row]
    traces = Traces.of(seen.fragments)
    return Candidates(shot, lines.bvh, planned, places, seen.kind[row], part_face, traces, scale)


def _drawn(
    shot: Shot, lines: SurfaceLines, style: Style, seen: SeenLines, scale: float
) -> np.ndarray:
    """Tell which points of the lines seen the style would draw, (N,) bool."""
    if style.choice is None:
        return np.repeat(~seen.optional, np.diff(seen.curves.offsets))
    return drawn_points(seen.view(lines, shot.camera), style.choice, scale)
