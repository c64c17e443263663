"""Lines that an artist may draw besides those of the detail asked for: optional ones.

Of the lines that tell of the same form from two sides only the better one is drawn by default, and
weak lines are not. Which of them an artist draws is told by a drawing; here all are found.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..geometry.curves import Curves, is_kind, owner, resample_with_source
from ..geometry.kinds import SOFT_KINDS
from .camera import Camera
from .line_options import LineOptions
from .lines import SurfaceLines
from .tidy import subtract_parallel, tidy_with_source
from .visible import Fragments, look_along

FULLER = 2.0  # times the detail asked for: that of optional lines
# Kinds that are tidied apart, so that they do not compete
FAMILIES = (("suggestive", "apparent"), ("ridge", "valley"))
MIN_LENGTH = 12.0  # px at 768; of less, nobody can tell whether it was drawn


class OptionalLines(NamedTuple):
    """Lines that may be drawn besides.

    Parameters
    ----------
    curves : evenly spaced, N points
    strength : (N,) in 0..1, by the thresholds of the fuller detail
    face : (N,) int, the face that each point lies on
    point : (N, 3), where in space each lies
    """

    curves: Curves
    strength: np.ndarray
    face: np.ndarray
    point: np.ndarray

    @classmethod
    def none(cls) -> OptionalLines:
        """Make no lines."""
        return cls(Curves.empty(), np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 3)))


def optional_lines(
    lines: SurfaceLines,
    camera: Camera,
    found: Fragments,
    drawn: Curves,
    spacing: float,
) -> OptionalLines:
    """Find lines of a fuller detail that run along none of those that are drawn.

    Parameters
    ----------
    lines : those that are drawn; soft kinds that are not among them are no optional ones
    found : what is seen of the lines that are drawn, before it was tidied
    drawn : the same, tidied
    spacing : px between the points of the result
    """
    size, parts = (camera.width, camera.height), [OptionalLines.none()]
    hard = found.take(~is_kind(found.curves.kind, SOFT_KINDS))
    soft = tuple(kind for kind in lines.options.kinds if kind in SOFT_KINDS)
    weaker = lines.alike(fuller(replace(lines.options, kinds=soft)))
    seen = look_along(lines.surface, camera, weaker.seen_from(camera), lines.bvh).fragments()
    for family in FAMILIES:
        both = Fragments.concatenate(hard, seen.take(is_kind(seen.curves.kind, family)))
        strokes = tidy_with_source(both.curves, both.strength, size)
        rest, row = subtract_parallel(strokes.curves, drawn, size)
        parts.append(_of_family(both, rest, strokes.source[row], spacing, max(size) / 768.0))
    return _joined(parts)


def fuller(options: LineOptions) -> LineOptions:
    """Change options for lines FULLER times as detailed, of a surface smoothed as before."""
    return replace(options.detailed(FULLER), smooth=options.smooth)


def _of_family(
    fragments: Fragments, rest: Curves, source: np.ndarray, spacing: float, scale: float
) -> OptionalLines:
    """Space the points of curves evenly and name their kind, that of most of their points."""
    if not len(rest):
        return OptionalLines.none()
    kind = fragments.curves.kind[owner(fragments.curves.offsets)][source]
    pieces = zip(rest.offsets[:-1], rest.offsets[1:], strict=True)
    rest = replace(rest, kind=np.array([np.bincount(kind[a:b]).argmax() for a, b in pieces]))
    soft = is_kind(rest.kind, SOFT_KINDS) & (rest.lengths() >= MIN_LENGTH * scale)
    source = source[soft[owner(rest.offsets)]]
    curves, of_rest = resample_with_source(rest.take(soft), spacing)
    row = source[of_rest] if len(source) else np.zeros(0, np.int64)
    assert fragments.point is not None  # they are those that `look_along` has seen
    strength = np.clip(fragments.strength[row], 0.0, 1.0)
    return OptionalLines(curves, strength, fragments.face[row], fragments.point[row])


def _joined(parts: list[OptionalLines]) -> OptionalLines:
    return OptionalLines(
        Curves.concatenate([part.curves for part in parts]),
        np.concatenate([part.strength for part in parts]),
        np.concatenate([part.face for part in parts]),
        np.concatenate([part.point for part in parts]),
    )
