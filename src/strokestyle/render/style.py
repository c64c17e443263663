"""Style: what was learned from one drawing, and how it draws a view.

Lengths inside a style are pixels of the canvas it was learned on; `draw` scales them to the canvas it is given.
No torch in here: what drawing takes of it is a sum of tanh, and its import costs more than all the rest of a drawing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..drawing.edit import cut_at_parts
from ..drawing.strokes import Drawing, Strokes
from ..extract.view import View
from ..geometry.curves import arc_length
from ..geometry.parts import Pieces
from .config import HAIR, StyleConfig
from .displacement import Frame, displaced
from .features import plan, point_features, surface_at
from .quilt import synthesise
from .residuals import Residuals, sample_residuals
from .texture_bank import TextureBank


@dataclass(frozen=True)
class SumOfCurves:
    """What a `model.AdditiveNet` has learned, features (N, P) -> (N,).

    slope, shift, weight (P, h) float32, line (P,) float32, base () float32
    """

    slope: np.ndarray
    shift: np.ndarray
    weight: np.ndarray
    line: np.ndarray
    base: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        curves = np.tanh(points[:, :, None] * self.slope + self.shift) * self.weight
        return curves.sum(axis=(1, 2)) + points @ self.line + self.base


@dataclass(frozen=True)
class Style:
    """A learned style.

    Parameters
    ----------
    config : StyleConfig
    network : SumOfCurves, features -> log(thickness + HAIR)
    moves : (M,) float32, how much of each of MOVES the hand makes
    centre, spread, low, high : (P,) float64, of FEATURES over the training strokes
    hand : Hand or None
    bank : the medium, or None for flat ink
    color : (4,) float64, the flat ink where there is no texture
    about : provenance: strokestyle version, preset, seed, exemplar
    """

    config: StyleConfig
    network: SumOfCurves
    moves: np.ndarray
    centre: np.ndarray
    spread: np.ndarray
    low: np.ndarray
    high: np.ndarray
    hand: Residuals | None = None
    bank: TextureBank | None = None
    color: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    about: dict = field(default_factory=dict)

    def normalise(self, features: np.ndarray) -> np.ndarray:
        """Features (N, P) -> within the range seen in training, centred and scaled."""
        return (np.clip(features, self.low, self.high) - self.centre) / self.spread

    def draw(self, view: View, seed: int = 0) -> Drawing:
        """Draw a view. The same seed gives the same drawing; another one, another hand's luck."""
        size = (view.camera.width, view.camera.height)
        strokes, features, scale, pieces = self.strokes(view, seed)
        rng_seed = int(np.random.SeedSequence([seed, 1]).generate_state(1)[0])
        color, texture = np.tile(self.color, (len(strokes), 1)), None
        if self.bank is not None and len(strokes):
            texture, color = synthesise(self.bank, strokes, features, rng_seed)
        if scale != 1.0:
            strokes = replace(strokes, xy=strokes.xy * scale, thickness=strokes.thickness * scale)
            if texture is not None:
                texture = replace(texture, margin=texture.margin * scale)
        drawing = Drawing(strokes, size, color, texture)
        return drawing if pieces is None else cut_at_parts(drawing, pieces)

    def strokes(
        self, view: View, seed: int = 0
    ) -> tuple[Strokes, np.ndarray, float, Pieces | None]:
        """Strokes in px of the style's own canvas, their normalised features (N, P), the view's px per such px, and the
        pieces of one part each that they are to be cut into."""
        scale = max(view.camera.width, view.camera.height) / self.config.size
        planned = plan(view, self.config, scale)
        surface = planned.carry(surface_at(view, self.config.spacing))
        features = self.normalise(point_features(planned, surface, self.config))
        if not len(planned):
            return Strokes(np.zeros((0, 2)), [], [0], [], []), features, scale, None
        frame = Frame.of(planned, surface, self.config.spacing)
        xy, swell = displaced(frame, self.moves), self.network(features)
        if self.hand is not None:
            stray = sample_residuals(
                self.hand, planned.offsets, np.random.default_rng(np.random.SeedSequence([seed, 0]))
            )
            xy, swell = xy + stray[:, :1] * frame.across, swell + stray[:, 1]
        thickness = np.maximum(np.exp(swell) - HAIR, 0.0)
        rows, offsets, kept = trim_invisible_ends(thickness, planned.offsets)
        strokes = Strokes(
            xy[rows], thickness[rows], offsets, planned.kind[kept], np.zeros(len(kept), bool)
        )
        pieces = None
        if view.parts is not None:
            step = np.diff(arc_length(xy[rows], offsets), prepend=0.0)
            step[offsets[:-1]] = step[planned.beyond[rows] > 0] = (
                0.0  # what runs past an end lies on nothing
            )
            pieces = view.parts.take(planned.source[rows, 0]).cut(offsets, np.cumsum(step))
        return strokes, features[rows], scale, pieces


def trim_invisible_ends(
    thickness: np.ndarray, offsets: np.ndarray, least: float = 0.5
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leave out the ends that are too thin to see: rows kept, their offsets, and the strokes kept."""
    rows, counts, kept = [], [0], []
    for i, (a, b) in enumerate(zip(offsets[:-1], offsets[1:], strict=True)):
        seen = np.flatnonzero(thickness[a:b] >= least)
        if len(seen) < 2:
            continue
        first, last = max(seen[0] - 1, 0), min(seen[-1] + 1, b - a - 1)
        rows.append(np.arange(a + first, a + last + 1))
        counts.append(len(rows[-1]))
        kept.append(i)
    rows = np.concatenate(rows) if rows else np.zeros(0, np.int64)
    return rows, np.cumsum(counts), np.array(kept, np.int64)
