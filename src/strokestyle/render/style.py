"""Style: what was learned from one drawing, and how it draws a view.

Lengths inside a style are px of the canvas that it was learned on; `Style.draw` scales the finished
strokes to the canvas of the view. No torch in here: what drawing takes of it is a sum of tanh, and
its import costs more than all the rest of a drawing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..drawing.edit import cut_at_parts
from ..drawing.strokes import Drawing, Strokes, Texture
from ..extract.view import View
from ..geometry.curves import arc_length, owner
from ..geometry.parts import Parts, Pieces
from .choice import LineChoice, choose_lines, leaves_nothing
from .config import HAIR, StyleConfig
from .displacement import Frame, displaced
from .features import FeatureScaling, plan, point_features, surface_at
from .overshoots import Overshoots
from .plan import Planned, lift
from .quilt import synthesise
from .residuals import Residuals, sample_residuals
from .restating import Restating
from .texture_bank import TextureBank

THINNEST = 0.12  # of a stroke's greatest thickness: what overshoots and is thinner is none of it
MIN_VISIBLE = 0.5  # px of thickness; a stroke's ends are trimmed to where it is thicker


@dataclass(frozen=True)
class SumOfCurves:
    """A curve of each feature, summed: a sparse additive model (Ravikumar et al. 2009).

    Features (N, P) -> (N,). The sum is read as a logarithm, where influences that scale each other
    add.

    Parameters
    ----------
    slope, shift, weight : (P, h) float32
    line : (P,) float32
    base : () float32
    """

    slope: np.ndarray
    shift: np.ndarray
    weight: np.ndarray
    line: np.ndarray
    base: np.ndarray

    def __call__(self, features: np.ndarray) -> np.ndarray:
        curves = np.tanh(features[:, :, None] * self.slope + self.shift) * self.weight
        return curves.sum(axis=(1, 2)) + features @ self.line + self.base


@dataclass(frozen=True)
class LaidStrokes:
    """Strokes as a style lays them over a view, before they are given texture.

    Parameters
    ----------
    strokes : in px of the style's canvas
    features : (N, P) float64, normalised, at their points
    pieces : of one named part each, which they are to be cut into; None where nothing is named
    """

    strokes: Strokes
    features: np.ndarray
    pieces: Pieces | None


@dataclass(frozen=True)
class Style:
    """A learned style.

    Parameters
    ----------
    config : how strokes are planned
    log_width : features (N, P) -> log(thickness + HAIR) (N,), thickness in px
    displacement : (M,) float32, how much of each of DEFORMATIONS strokes are moved by
    scaling : of its features, to what `log_width` and `bank` expect
    residuals : what strokes do beside that, or None
    bank : the medium, or None for flat ink
    color : (4,) float64 straight RGBA in [0, 1], the flat ink where there is no texture
    about : provenance: strokestyle version, preset, seed, exemplar
    choice : which lines are drawn, or None for all
    overshoots : how far strokes run past their ends; None where their thickness says so, as in
        models of format 3
    restating : how lines are gone over, or None where each is one stroke
    """

    config: StyleConfig
    log_width: SumOfCurves
    displacement: np.ndarray
    scaling: FeatureScaling
    residuals: Residuals | None = None
    bank: TextureBank | None = None
    color: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    about: dict = field(default_factory=dict)
    choice: LineChoice | None = None
    overshoots: Overshoots | None = None
    restating: Restating | None = None

    def choose(self, view: View) -> View:
        """Leave out of a view the lines, and parts of lines, that the artist would not draw."""
        return choose_lines(view, self.choice, self._scale(view))

    def leaves_nothing(self, view: View) -> bool:
        """Tell whether the artist would draw no line of a view, so that `choose` keeps all."""
        return leaves_nothing(view, self.choice, self._scale(view))

    def draw(self, view: View, seed: int = 0, choice: str = "learned") -> Drawing:
        """Draw a view: strokes in its pixels, with texture.

        Drawn are the lines that the artist would choose, or with `choice` "all" all of them. The
        same seed gives the same drawing; another one gives other residuals and other joints of
        the texture. A view whose longer side is k times the style's canvas is drawn k times as
        large: thickness and displacement are scaled with it.
        """
        scale = self._scale(view)
        view = choose_lines(view, self.choice if choice == "learned" else None, scale)
        laid = self.lay_strokes(view, seed)
        strokes, color, texture = laid.strokes, np.tile(self.color, (len(laid.strokes), 1)), None
        if self.bank is not None and len(strokes):
            texture, color = synthesise(self.bank, strokes, laid.features, _child_seed(seed, 1))
        strokes, texture = scaled(strokes, texture, scale)
        drawing = Drawing(strokes, (view.camera.width, view.camera.height), color, texture)
        return drawing if laid.pieces is None else cut_at_parts(drawing, laid.pieces)

    def _scale(self, view: View) -> float:
        """How many px of the view one of the style's canvas is."""
        return max(view.camera.width, view.camera.height) / self.config.size

    def lay_strokes(self, view: View, seed: int = 0) -> LaidStrokes:
        """Plan the strokes of a view, move them off their curves, and give them thickness."""
        planned = plan(view, self.config, self._scale(view))
        off = np.zeros((len(planned.xy), 2))
        if self.restating is not None:
            rng = np.random.default_rng(_child_seed(seed, 3))
            planned, over = self.restating.repeat(planned, rng)
            off = self.restating.deviation(planned, over, self.config.spacing, rng)
        if self.overshoots is not None:
            past = self.overshoots.sample(planned, np.random.default_rng(_child_seed(seed, 2)))
            planned, rows = lift(planned, past, self.config.spacing)
            off = off[rows]
        surface = planned.carry(surface_at(view, self.config.spacing))
        names = self.scaling.names
        features = self.scaling(point_features(planned, surface, self.config, names))
        if not len(planned):
            return LaidStrokes(_no_strokes(), features, None)
        frame = Frame.of(planned, surface, self.config.spacing, self.displacement)
        xy, log_width = displaced(frame, self.displacement) + off, self.log_width(features)
        if self.residuals is not None:
            rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
            residuals = sample_residuals(self.residuals, planned.offsets, rng)
            xy, log_width = xy + residuals[:, :1] * frame.normals, log_width + residuals[:, 1]
        thickness = without_hairs(np.maximum(np.exp(log_width) - HAIR, 0.0), planned)
        rows, offsets, kept = trim_invisible_ends(thickness, planned.offsets)
        open_ended = np.zeros(len(kept), bool)
        strokes = Strokes(xy[rows], thickness[rows], offsets, planned.kind[kept], open_ended)
        part = None if view.parts is None else view.parts.take(planned.source[rows, 0])
        pieces = pieces_by_part(part, planned.on_curve[rows], strokes)
        return LaidStrokes(strokes, features[rows], pieces)


def _no_strokes() -> Strokes:
    none = np.zeros(0)
    return Strokes(np.zeros((0, 2)), none, np.zeros(1), none, none)


def _child_seed(seed: int, stage: int) -> int:
    """A seed of its own for a stage of drawing."""
    return int(np.random.SeedSequence([seed, stage]).generate_state(1)[0])


def scaled(
    strokes: Strokes, texture: Texture | None, scale: float
) -> tuple[Strokes, Texture | None]:
    """The same drawing `scale` times as large."""
    if scale == 1.0:
        return strokes, texture
    strokes = replace(strokes, xy=strokes.xy * scale, thickness=strokes.thickness * scale)
    if texture is not None:
        texture = replace(texture, margin=texture.margin * scale)
    return strokes, texture


def pieces_by_part(part: Parts | None, on_curve: np.ndarray, strokes: Strokes) -> Pieces | None:
    """The pieces of strokes that lie on one named part each; None where nothing is named.

    `part` is that of each of their points, and `on_curve` (N,) bool says which of these do not run
    past the end of a curve: what does lies on no part, so its length does not count.
    """
    if part is None:
        return None
    step = np.diff(arc_length(strokes.xy, strokes.offsets), prepend=0.0)
    step[strokes.offsets[:-1]] = 0.0
    step[~on_curve] = 0.0
    return part.cut(strokes.offsets, np.cumsum(step))


def without_hairs(thickness: np.ndarray, planned: Planned) -> np.ndarray:
    """Leave out of thickness (N,) px, past the ends of curves, what is too thin to be a stroke's.

    What is learned to stop with its curve does so by a curve of thickness, which may leave a little
    past it: beside a thick stroke that shows as a hair.
    """
    fullest = np.maximum.reduceat(thickness, planned.offsets[:-1])[owner(planned.offsets)]
    return np.where(planned.on_curve | (thickness > THINNEST * fullest), thickness, 0.0)


def trim_invisible_ends(
    thickness: np.ndarray, offsets: np.ndarray, min_visible: float = MIN_VISIBLE
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leave out the ends of strokes that are too thin to see, but for one point at each end.

    Strokes of which fewer than two points can be seen are left out whole.

    Parameters
    ----------
    thickness : (N,) px
    offsets : (C+1,), stroke i is rows offsets[i]:offsets[i+1]
    min_visible : px

    Returns
    -------
    The rows (n,) that are kept, their offsets (c+1,), and the strokes (c,) that these are of.
    """
    rows, counts, kept = [], [0], []
    for i, (a, b) in enumerate(zip(offsets[:-1], offsets[1:], strict=True)):
        seen = np.flatnonzero(thickness[a:b] >= min_visible)
        if len(seen) < 2:
            continue
        first, last = max(seen[0] - 1, 0), min(seen[-1] + 1, b - a - 1)
        rows.append(np.arange(a + first, a + last + 1))
        counts.append(len(rows[-1]))
        kept.append(i)
    all_rows = np.concatenate(rows) if rows else np.zeros(0, np.int64)
    return all_rows, np.cumsum(counts), np.array(kept, np.int64)
