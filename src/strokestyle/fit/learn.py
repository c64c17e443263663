"""Learn displacement, thickness and residuals from one drawing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..drawing.strokes import Strokes
from ..extract.view import View
from ..geometry.curves import arc_length, owner
from ..geometry.threads import at_once
from ..render.choice import without_short_runs
from ..render.config import HAIR, StyleConfig
from ..render.displacement import Frame, across_strokes, displaced
from ..render.features import FeatureScaling, plan, point_features, surface_at
from ..render.overshoots import Overshoots
from ..render.plan import Planned, lift
from ..render.residuals import Residuals
from ..render.style import Style, SumOfCurves
from ..render.texture_bank import TextureBank
from .align import Alignment, align
from .checkpoint import Checkpoint
from .config import FitConfig
from .exemplar import Exemplar
from .hatching import SortedInk, sort_ink
from .manner import learn_manner
from .observe import Observation, measure_across, sample_image
from .pen_ends import pen_ends, probe_ends
from .progress import Report, Reporter
from .restate import Passes, find_passes
from .texture import learn_texture
from .thickness import learn_thickness
from .trace import MaskPyramid, Traced, affordable_steps, optimise_strokes

FEATURE_RANGE = 0.5, 99.5  # percentiles of the training strokes' features; what lies beyond is cut
MIN_SPREAD = 1e-3  # of a feature: one that hardly varies is not blown up
# px; a residual is kept where it is faster than these Gaussians, of offset and of log width
RESIDUAL_SIGMAS = (7.0, 14.0)
REJECTED_RUN = 6  # points; where trace and measure disagree for less, lines meet
# median deviations (4 standard ones) beyond which a residual is a slip of the trace, no manner
MOST_RESIDUAL = 6.0
MIN_AGREEING, MIN_AGREEING_SHARE = 4, 0.4  # points of a stroke whose residuals are kept

# The constants of the least squares and of the thickness curves were set by hand; no ablation of
# them is kept.
ROUNDS = 20  # of reweighting
OUTLIER = 0.5  # px of misfit beyond which an observation counts by its distance, not its square
MIN_DEFORMATION = 0.3  # px rms, below which a deformation is not scaled up to compare with others
TAKEN = 0.5  # of the mask, at a point that no ink was found for: what it holds is another stroke's
MEETING = 30.0  # px along a stroke, where it only meets another


def measure_scaling(raw: np.ndarray) -> FeatureScaling:
    """Measure the range of the training strokes' features (N, P)."""
    low, high = np.percentile(raw, FEATURE_RANGE, axis=0)
    clipped = np.clip(raw, low, high)
    spread = np.maximum(clipped.std(axis=0), MIN_SPREAD)
    return FeatureScaling(low, high, clipped.mean(axis=0), spread)


@dataclass(frozen=True)
class TrainingStrokes:
    """The strokes that a style would lay over the exemplar's curves, ready to learn from.

    Parameters
    ----------
    config : the style's
    planned : strokes on the curves
    frame : the same, and how they can be moved
    features : (N, P) float32, normalised by `scaling`
    scaling : of the features
    """

    config: StyleConfig
    planned: Planned
    frame: Frame
    features: np.ndarray
    scaling: FeatureScaling

    @classmethod
    def of(cls, view: View, config: StyleConfig) -> TrainingStrokes:
        """Plan the strokes of a view. Raises ValueError where there are none."""
        planned = plan(view, config)
        if not len(planned):
            raise ValueError(
                "no curves in this view are long enough to draw: nothing to learn from"
            )
        surface = planned.carry(surface_at(view, config.spacing))
        raw = point_features(planned, surface, config)
        scaling = measure_scaling(raw)
        frame = Frame.of(planned, surface, config.spacing)
        return cls(config, planned, frame, scaling(raw).astype(np.float32), scaling)

    def aligned(self, alignment: Alignment) -> TrainingStrokes:
        """Lay the strokes where the drawing has them; their features stay those of the curves."""
        planned = replace(self.planned, xy=self.planned.xy + alignment.shift)
        normals = across_strokes(planned.xy, planned.offsets, self.config.spacing)
        return replace(
            self, planned=planned, frame=replace(self.frame, xy=planned.xy, normals=normals)
        )

    @property
    def normals(self) -> np.ndarray:
        """(N, 2) float64, unit vectors across the strokes."""
        return self.frame.normals

    def repeated(self, passes: Passes) -> TrainingStrokes:
        """Lay a stroke for each pass of the lines that are gone over."""
        planned, rows = passes.planned, passes.rows
        frame = replace(self.frame.part(rows, planned.offsets, planned.on_curve), xy=planned.xy)
        return replace(self, planned=planned, frame=frame, features=self.features[rows])

    def lifted(
        self, view: View, past: np.ndarray, shift: np.ndarray
    ) -> tuple[TrainingStrokes, np.ndarray]:
        """Let the strokes begin and end `past` (C, 2) px past the ends of their curves.

        `shift` (N, 2) px is what they were aligned by, which their features do not tell of.
        Returns them, and which rows (n,) of these strokes they keep.
        """
        plain = replace(self.planned, xy=self.planned.xy - shift)
        planned, rows = lift(plain, past, self.config.spacing)
        surface = planned.carry(surface_at(view, self.config.spacing))
        raw = point_features(planned, surface, self.config)
        scaling = measure_scaling(raw)
        features = scaling(raw).astype(np.float32)
        frame = self.frame.part(rows, planned.offsets, planned.on_curve)
        aligned = replace(planned, xy=planned.xy + shift[rows])
        return TrainingStrokes(self.config, aligned, frame, features, scaling), rows

    def measured(self, mask: np.ndarray) -> Observation:
        """Measure a mask (H, W) across the strokes."""
        return measure_across(mask, self.planned, self.normals)

    def sorted_ink(self, mask: np.ndarray) -> SortedInk:
        """Take off a mask (H, W) what says nothing of lines on curves."""
        return sort_ink(mask, self.planned, self.normals, self.measured(mask))


@dataclass(frozen=True)
class StrokeLaw:
    """How strokes differ from their curves.

    Parameters
    ----------
    displacement : (M,) float32, how much of each of DEFORMATIONS
    thickness : features -> log(thickness + HAIR)
    """

    displacement: np.ndarray
    thickness: SumOfCurves

    def __call__(self, training: TrainingStrokes) -> Traced:
        """Draw the training strokes by the law."""
        xy = displaced(training.frame, self.displacement)
        return Traced(xy, self.thickness(training.features).astype(np.float64))


@dataclass(frozen=True)
class Learned:
    """What was learned from a drawing, and what of the drawing it was learned from.

    Parameters
    ----------
    style : what is kept of it
    strokes : those of the drawing, as traced
    ink : the drawing's, sorted by what it is for
    alignment : of the planned strokes, and what of it is manner
    rejected : (n, 2) px, where lines lie but the drawing was not believed
    """

    style: Style
    strokes: Strokes
    ink: SortedInk
    alignment: Alignment
    rejected: np.ndarray


@dataclass(frozen=True)
class _Seen:
    """Training strokes laid on a drawing, and what is seen of it there.

    Parameters
    ----------
    exemplar : the drawing, its mask closed over no gap between the passes of one line
    training : the strokes, N points, as many for a line as it has passes
    alignment : theirs
    ink : the drawing's, sorted by what it is for
    passes : over the lines, where they were gone over more than once
    measured : across the strokes
    shown : (N,) the mask at the points
    taken : (N,) bool, where that is another stroke's ink
    """

    exemplar: Exemplar
    training: TrainingStrokes
    alignment: Alignment
    ink: SortedInk
    passes: Passes | None
    measured: Observation
    shown: np.ndarray
    taken: np.ndarray


@dataclass(frozen=True)
class _Pulled:
    """Training strokes as the drawing has them, from where the pen is set down to its lift.

    Parameters
    ----------
    training : the strokes, N points
    traced : the same on the drawing
    found : what they teach
    agrees : (N,) bool, where trace and measure do
    overshoots : past the ends of the lines
    """

    training: TrainingStrokes
    traced: Traced
    found: Observation
    agrees: np.ndarray
    overshoots: Overshoots | None


def fit_quick(
    view: View,
    exemplar: Exemplar,
    config: FitConfig,
    seed: int = 0,
    report: Reporter | None = None,
    checkpoint: Checkpoint | None = None,
    until: float | None = None,
) -> Learned:
    """Learn the style of a drawing.

    `fit_style` says what the arguments mean; `until`, on the clock of time.monotonic(), is when
    the fit is to be over. Raises ValueError where there are no strokes to learn from.
    """
    checkpoint, report = checkpoint or Checkpoint(), report or Reporter(None, 1)
    style_config = replace(config.style, size=max(exemplar.mask.shape))
    style_config = learn_manner(view, exemplar.mask, style_config)
    seen = _seen(view, exemplar, style_config, config.alignment)
    # The law is learned twice. What is measured across the strokes is wrong where lines crowd, but
    # its law is a start from which the trace finds the right line; the law that is kept is
    # learned from the traced strokes.
    rough_law = learn_law(seen.training, seen.measured, seen.alignment.free, config, seed, report)
    traced = _traced(seen, rough_law, config, report, checkpoint, until)
    pulled = _pulled(view, seen, traced)
    strokes, rows = pulled.traced.strokes(pulled.training.planned)

    with_texture = config.texture and len(strokes) > 0

    def lawful() -> Style:
        law = learn_law(pulled.training, pulled.found, seen.alignment.free, config, seed, report)
        if with_texture:  # it is what is waited for now
            report("texture", 0, 1, {})
        return _style(seen, pulled, law, config)

    def textured() -> TextureBank | None:
        if not with_texture:
            return None
        features = pulled.training.features[rows].astype(np.float64)
        return learn_texture(strokes, features, seen.exemplar, seed)

    style, bank = at_once(lawful, textured)
    if bank is not None:
        style = replace(style, bank=bank)
        report("texture", 1, 1, {})
    planned = pulled.training.planned
    doubted = long_runs(planned.on_curve & ~pulled.agrees, planned.offsets, REJECTED_RUN)
    return Learned(style, strokes, seen.ink, seen.alignment, planned.xy[doubted])


def _seen(view: View, exemplar: Exemplar, config: StyleConfig, aligned: bool) -> _Seen:
    """Lay the strokes of a view on the drawing, and look what is there."""
    training = TrainingStrokes.of(view, config)
    planned, deformations = training.planned, training.frame.deformations
    if aligned:
        alignment = align(exemplar.mask, planned, deformations, config.spacing)
    else:
        alignment = Alignment.on_curves(len(planned.xy), deformations.shape[1])
    training = training.aligned(alignment)
    passes = find_passes(exemplar.alpha, training.planned, training.normals, config.spacing)
    if passes is not None:
        exemplar = passes.lines(exemplar)
    ink = training.sorted_ink(exemplar.mask)
    measured = ink.believed(training.measured(ink.lines), training.planned.xy)
    if passes is not None:
        off = passes.offset[:, None] * training.normals[passes.rows]
        alignment = alignment.part(passes.rows, off)
        training, measured = training.repeated(passes), passes.observed(measured.part(passes.rows))
    shown = sample_image(ink.lines, training.planned.xy)
    taken = taken_ink(training.planned, alignment.explained, shown)
    measured = disbelieved(measured, taken)
    return _Seen(exemplar, training, alignment, ink, passes, measured, shown, taken)


def _pulled(view: View, seen: _Seen, traced: Traced) -> _Pulled:
    """Begin and end the traced strokes where the pen does, and choose what they teach."""
    training, spacing = seen.training, seen.training.config.spacing
    found, agrees = traced.observed(training.frame, seen.measured, seen.shown)
    found = disbelieved(found if seen.passes is None else seen.passes.doubted(found), seen.taken)
    past, clear = pen_ends(training.planned, traced.thickness, traced.xy, seen.ink.lines, spacing)
    training, rows = training.lifted(view, past, seen.alignment.shift)
    overshoots = Overshoots.of(np.where(clear, past, np.nan))
    return _Pulled(training, traced.part(rows), found.part(rows), agrees[rows], overshoots)


def long_runs(flags: np.ndarray, offsets: np.ndarray, length: int) -> np.ndarray:
    """Keep flags (N,) bool only in runs of at least `length` points of one stroke."""
    pieces = [
        ndimage.binary_opening(flags[a:b], np.ones(length))
        for a, b in zip(offsets[:-1], offsets[1:], strict=True)
    ]
    return np.concatenate(pieces) if pieces else flags


def learn_law(
    training: TrainingStrokes,
    observed: Observation,
    free: np.ndarray,
    config: FitConfig,
    seed: int,
    report: Report,
) -> StrokeLaw:
    """Learn displacement and thickness from where a drawing has the training strokes.

    Only deformations that are `free` (M,) bool are used.
    """
    weights = learn_displacement(training.frame.deformations_across() * free, observed)
    thickness = learn_thickness(
        training.features, observed, config, training.config.hidden_units, seed, report
    )
    return StrokeLaw(weights.astype(np.float32), thickness)


def learn_displacement(basis: np.ndarray, observed: Observation, ridge: float = 1e-2) -> np.ndarray:
    """Find how much of each deformation explains the offsets best: (M,) float64.

    Least squares with a ridge, reweighted so that what lies far off counts by its distance only.

    Parameters
    ----------
    basis : (N, M) px, each deformation at full strength, along the normals
    observed : its offsets, weighed by its confidence
    ridge : of the summed confidence, on the weights in units of the deformations' rms
    """
    scale = np.maximum(np.sqrt((basis**2).mean(axis=0)), MIN_DEFORMATION)
    design, answer = basis / scale, np.zeros(basis.shape[1])
    penalty = ridge * max(observed.confidence.sum(), 1.0) * np.eye(len(answer))
    for _ in range(ROUNDS):
        misfit = np.abs(design @ answer - observed.offset)
        weighted = design * (observed.confidence / np.maximum(misfit, OUTLIER))[:, None]
        answer = np.linalg.solve(weighted.T @ design + penalty, weighted.T @ observed.offset)
    return answer / scale


def taken_ink(planned: Planned, explained: np.ndarray, ink: np.ndarray) -> np.ndarray:
    """Where strokes lie on the ink of others, (N,) bool, for longer than where they meet.

    Parameters
    ----------
    planned : strokes, N points
    explained : (N,) bool, where a point lies on ink of its own
    ink : (N,) the mask at the points
    """
    taken = planned.on_curve & ~explained & (ink > TAKEN)
    along = arc_length(planned.xy, planned.offsets)
    return without_short_runs(taken, owner(planned.offsets), along, True, MEETING)


def disbelieved(observed: Observation, where: np.ndarray) -> Observation:
    """The same observation, of which nothing is believed at points `where` (N,) bool."""
    return replace(observed, confidence=np.where(where, 0.0, observed.confidence))


def thin_start(start: Traced, where: np.ndarray) -> Traced:
    """Begin without width at points `where` (N,) bool, to grow where the drawing has ink."""
    return replace(start, log_width=np.where(where, np.log(HAIR), start.log_width))


def _traced(
    seen: _Seen,
    law: StrokeLaw,
    config: FitConfig,
    report: Reporter,
    checkpoint: Checkpoint,
    until: float | None,
) -> Traced:
    """Trace the drawing's strokes, beginning where the law has them, in as many steps as fit."""
    training, mask = seen.training, seen.ink.lines
    start = thin_start(begin_past_ends(training, law(training), mask), seen.taken)
    strokes = training.frame
    target = MaskPyramid.of(mask, training.planned.xy, config.levels)

    def affordable() -> int:
        if until is None:
            return config.trace_steps
        return affordable_steps(strokes, start, target, config, until)

    steps = int(checkpoint.chosen("trace_steps", affordable))
    config = replace(config, trace_steps=steps)
    report.total = 2 * config.steps + config.trace_steps
    return optimise_strokes(strokes, start, target, config, report, checkpoint)


def begin_past_ends(training: TrainingStrokes, drawn: Traced, mask: np.ndarray) -> Traced:
    """Let strokes begin with a width past their ends where ink runs on, and elsewhere with none."""
    planned, config = training.planned, training.config
    thickness, xy = drawn.thickness, drawn.xy
    lines = [
        xy[a:b][planned.on_curve[a:b]]
        for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True)
    ]
    usual = float(np.median(thickness[planned.on_curve]))
    probes = probe_ends(lines, mask, usual, config.max_overshoot, config.spacing)
    bare = ~planned.on_curve & ~probes.drawn(planned)
    return Traced(probes.laid(planned, xy), np.where(bare, np.log(HAIR), drawn.log_width))


def _residuals(training: TrainingStrokes, law: StrokeLaw, traced: Traced) -> np.ndarray:
    """What the traced strokes do beside the law, (N, 2): px across, and log width."""
    meant = law(training)
    across = training.frame.across(traced.xy - meant.xy)
    return np.stack([across, traced.log_width - meant.log_width], axis=1)


def learn_residuals(
    off: np.ndarray, planned: Planned, agrees: np.ndarray, spacing: float
) -> Residuals | None:
    """Cut what strokes do beside the law into sequences to draw with; None where there are none.

    A sequence runs from the first to the last point of a stroke that is sure, and is bridged
    between. Slow residuals are taken out: they cannot be told from what the law failed to learn,
    and would only spoil the shape.

    Parameters
    ----------
    off : (N, 2) float64, px across, and log width
    planned : the strokes; what lies past their ends is left out
    agrees : (N,) bool, where `off` is sure
    spacing : px between points
    """
    pieces = []
    for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
        inner = np.flatnonzero(planned.on_curve[a:b]) + a
        known = inner[agrees[inner]]
        if len(known) < max(MIN_AGREEING, MIN_AGREEING_SHARE * len(inner)):
            continue
        inner = inner[(inner >= known[0]) & (inner <= known[-1])]
        piece = np.stack([np.interp(inner, known, off[known, k]) for k in (0, 1)], axis=1)
        for k, sigma in enumerate(RESIDUAL_SIGMAS):
            piece[:, k] -= ndimage.gaussian_filter1d(piece[:, k], sigma / spacing, mode="nearest")
        pieces.append(piece)
    if not pieces:
        return None
    values = np.concatenate(pieces)
    most = MOST_RESIDUAL * np.median(np.abs(values), axis=0)
    return Residuals(
        np.clip(values, -most, most).astype(np.float32),
        np.r_[0, np.cumsum([len(p) for p in pieces])],
    )


def _style(seen: _Seen, pulled: _Pulled, law: StrokeLaw, config: FitConfig) -> Style:
    """Put what was learned together: a style of flat ink."""
    training, residuals = pulled.training, None
    if config.residuals > 0:
        off = config.residuals * _residuals(training, law, pulled.traced)
        spacing = training.config.spacing
        residuals = learn_residuals(off, training.planned, pulled.agrees, spacing)
    return Style(
        config=training.config,
        log_width=law.thickness,
        displacement=law.displacement,
        scaling=training.scaling,
        residuals=residuals,
        overshoots=pulled.overshoots,
        restating=None if seen.passes is None else seen.passes.restating,
        color=_flat_ink(replace(seen.exemplar, mask=seen.ink.lines)),
    )


def _flat_ink(exemplar: Exemplar) -> np.ndarray:
    """The ink of a flat drawing: mean colour and opacity (4,) where the mask holds ink."""
    weight = exemplar.mask * exemplar.alpha
    total = max(float(weight.sum()), 1e-6)
    rgb = (exemplar.ink * weight[..., None]).sum(axis=(0, 1)) / total
    alpha = float((exemplar.alpha * exemplar.mask).sum() / max(float(exemplar.mask.sum()), 1e-6))
    return np.clip(np.r_[rgb, alpha], 0, 1).astype(np.float64)
