"""Path data of a tone as another program spells it, or moved, in our words again."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..geometry.affine import Affine, transformed
from ..geometry.bezier import Segment
from .format import TONE_UNIT
from .path_data import parse_path
from .read_texture import TONES
from .tones import Tones, ToneShape, tone_shapes, without_spikes

STRAIGHT = 1e-6  # units squared: a piece that encloses less between its two sides is a line
EXACT = 1e-6  # units that other programs' whole numbers may be off


def tone_path(d: str) -> str | None:
    """Spell path data of a tone as `tone_shapes` does; None where it is not such a spline.

    svgo leaves out the way home, and makes lines of pieces that are straight: where these have
    their control points follows from their neighbours.
    """
    if TONES.fullmatch(d):
        return "M" + d[1:]
    shape = _shape(d, lambda ring: ring)
    return None if shape is None else shape.d


def moved_tone(d: str, matrix: Affine) -> ToneShape | None:
    """Move a tone: None where its path data are no such spline, or nothing is left of it.

    `matrix` takes units of the path data to px. Points lie on the grid of TONE_UNIT again: what
    they move by besides is less than that.
    """

    def moved(ring: np.ndarray) -> np.ndarray:
        at = transformed(matrix, 2.0 * ring) / (2 * TONE_UNIT)
        made, _ = without_spikes(np.rint(at).astype(np.int64), np.array([0, len(at)]))
        return made if len(made) > 2 else made[:0]

    return _shape(d, moved)


def _shape(d: str, change: Callable[[np.ndarray], np.ndarray]) -> ToneShape | None:
    """The tone of path data whose polygons are changed; None where they are no such spline."""
    try:
        found = [_polygon(subpath) for subpath in parse_path(d)]
    except ValueError:
        return None
    rings = [change(ring) for ring in found if ring is not None and len(ring)]
    rings = [ring for ring in rings if len(ring)]
    if not rings or any(ring is None for ring in found):
        return None
    offsets = np.cumsum([0, *map(len, rings)])
    one = np.zeros(len(rings), np.int64)
    shown = np.zeros((1, 1))
    regions = Tones(shown, np.zeros((1, 1, 3)), np.concatenate(rings), offsets, one, one)
    return tone_shapes(regions)[0][0]


def _polygon(subpath: Sequence[Segment]) -> np.ndarray | None:
    """The polygon (n, 2) of a closed B-spline as `Tones` has it, from its pieces as cubics.

    None where they are no such spline; without points where they enclose nothing.
    """
    pieces = np.array(subpath).reshape(-1, 4, 2)
    begin, end = pieces[:, 0], pieces[:, 3]
    control = 1.5 * pieces[:, 1] - 0.5 * begin  # of a parabola that is written as a cubic
    out, chord = control - begin, end - begin
    bulge = np.abs(out[:, 0] * chord[:, 1] - out[:, 1] * chord[:, 0])
    if bulge.max() < STRAIGHT:
        return np.zeros((0, 2), np.int64)
    # each is the one before it, reflected about the piece's end
    first = int(bulge.argmax())
    turned = np.roll(end, -first, axis=0)
    made = [control[first]]
    for place in turned:
        made.append(2.0 * place - made[-1])
    home = np.abs(made.pop() - made[0]).max() < EXACT
    polygon = 0.5 * np.roll(made, first, axis=0)
    whole = np.rint(polygon).astype(np.int64)
    bent = bulge >= STRAIGHT
    same = np.abs(2 * whole - control)[bent].max() < EXACT
    return whole if home and same and np.abs(end[-1] - begin[0]).max() < EXACT else None
