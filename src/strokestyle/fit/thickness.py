"""Learn how thick strokes are by what is known of their points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..render.config import HAIR
from ..render.style import SumOfCurves
from .adam import OneCycleAdam
from .config import FitConfig
from .observe import Observation
from .progress import Report

# Set by hand; no ablation of them is kept.
WIDTH_OUTLIER = 0.2  # of log width of misfit, beyond which a point counts by that, not its square
WARM_UP = 0.2  # of the steps, until the one-cycle schedule is at its top
CURVE_DECAY = 1e-3  # weight of the curves' squared weights
UNSEEN_THICKNESS = 3.0  # px (with HAIR) to begin with where nothing is known
LEAST_SIZE = 1e-6  # of a feature's squared weights: their size has a slope where they are 0


def learn_thickness(
    features: np.ndarray,
    observed: Observation,
    config: FitConfig,
    hidden: int,
    seed: int,
    report: Report,
) -> SumOfCurves:
    """Learn the sparse sum of curves that explains the thickness best.

    Parameters
    ----------
    features : (N, P) float32, normalised
    observed : its thickness, weighed by its confidence
    config : its `steps`, `rate` and `sparsity` are used
    hidden : units of each feature's curve
    seed : of the curves' first weights
    report : told of every step, as "thickness"
    """
    loss = ThicknessLoss.of(features, observed, config.sparsity)
    shape = features.shape[1], hidden
    random = np.random.default_rng(seed)
    slope, shift = (random.standard_normal(shape, np.float32) for _ in range(2))
    curves = SumOfCurves(
        slope, shift, np.zeros(shape, np.float32), np.zeros(shape[0], np.float32), loss.base()
    )
    parameters = [curves.slope, curves.shift, curves.weight, curves.line, curves.base]
    adam = OneCycleAdam(parameters, [config.rate] * len(parameters), config.steps, WARM_UP)
    for step in range(config.steps):
        error, gradients = loss(curves)
        adam.step(gradients)
        report("thickness", step + 1, config.steps, {"error": error})
    return curves


@dataclass(frozen=True)
class ThicknessLoss:
    """What learning makes small: the error of log width, and the size of each feature's weights.

    Parameters
    ----------
    features : (N, P) float32
    log_width : (N,) float32, log(thickness + HAIR)
    confidence : (N,) float32, of it
    sparsity : weight of the group lasso (Yuan and Lin 2006): one drawing holds a dozen or two
        strokes, so most of what tells strokes apart has been seen a dozen times. A network that may
        combine features freely learns these strokes by heart; a sum of curves that leaves out the
        features it can do without does not
    """

    features: np.ndarray
    log_width: np.ndarray
    confidence: np.ndarray
    sparsity: float

    @classmethod
    def of(cls, features: np.ndarray, observed: Observation, sparsity: float) -> ThicknessLoss:
        """Measure by what a drawing shows at points with features (N, P)."""
        log_width = np.log(np.maximum(observed.thickness, 0.0) + HAIR).astype(np.float32)
        return cls(features, log_width, observed.confidence.astype(np.float32), sparsity)

    def base(self) -> np.ndarray:
        """The mean log width () of what is known."""
        known = self.confidence.sum()
        mean = (self.confidence * self.log_width).sum() / known if known > 0 else None
        return np.array(np.log(UNSEEN_THICKNESS) if mean is None else mean, np.float32)

    def __call__(self, curves: SumOfCurves) -> tuple[float, list[np.ndarray]]:
        """Measure the error alone, and derivatives of the whole loss by each of curves' arrays."""
        features, (kinds, hidden) = self.features, curves.slope.shape
        count = len(features)
        bent = np.tanh(features[:, :, None] * curves.slope + curves.shift)
        flat = bent.reshape(count, -1)
        off = flat @ curves.weight.ravel() + features @ curves.line + curves.base - self.log_width
        share = self.confidence / max(float(self.confidence.sum()), 1.0)
        size = np.abs(off)
        near = np.minimum(size, WIDTH_OUTLIER)
        # Huber 1964, in units in which far off it counts by its distance
        error = float((share * (size - near + 0.5 * near**2 / WIDTH_OUTLIER)).sum())
        pull = share * np.clip(off / WIDTH_OUTLIER, -1, 1)
        norm = np.sqrt((curves.weight**2).sum(axis=1) + curves.line**2 + LEAST_SIZE)
        lasso = self.sparsity / norm
        by_weight = (pull @ flat).reshape(kinds, hidden)
        by_weight = by_weight + (lasso[:, None] + 2 * CURVE_DECAY) * curves.weight
        steep = 1 - np.square(bent, out=bent)
        by_shift = (pull @ steep.reshape(count, -1)).reshape(kinds, hidden) * curves.weight
        tilted = (features * pull[:, None]).T[:, None]  # (P, 1, N)
        by_slope = (tilted @ steep.transpose(1, 0, 2))[:, 0] * curves.weight
        by_line = pull @ features + lasso * curves.line
        return error, [by_slope, by_shift, by_weight, by_line, np.float32(pull.sum())]
