"""Drop specks, and what is more often noise than form."""

from __future__ import annotations

import numpy as np

from ..geometry.near import count_near
from .tidy_lines import SOFT, STEP, Lines, Numbers, loose_creases, near_others, short_creases

# px
ATTACHED = 6.0  # an end this near to another line is attached
ONE_END = 1.4  # x attached, of a line with one end attached
CLUTTER_LENGTH, CLUTTER_RADIUS = 30.0, 24.0  # lines shorter than this count, this near


def drop(lines: Lines, options: Numbers) -> Lines:
    """Drop specks and noise."""
    if not len(lines):
        return lines
    length = lines.length
    attached = near_others(lines, ATTACHED).reshape(-1, 2).sum(axis=1) * ~lines.closed
    crease = short_creases(lines, options)
    soft = SOFT[lines.kind] | loose_creases(lines, options, crease)
    noise = (length < CLUTTER_LENGTH * options.growth) & (SOFT[lines.kind] | crease)
    around = _clutter(lines, noise, soft, options) / max(options.clutter * options.growth, 1e-9)
    need = options.soft * options.growth * (1.0 + around)
    least = np.array([options.isolated, options.attached * ONE_END, options.attached])[attached]
    enough = np.where(soft, length * lines.mean_strength() >= need, length >= least)
    return lines.take(enough & (length >= options.speck))


def _clutter(lines: Lines, short: np.ndarray, asked: np.ndarray, options: Numbers) -> np.ndarray:
    """Measure the length of other `short` lines around each `asked` line, (C,) px.

    That is the length within CLUTTER_RADIUS of a point of the line, on average over its points.
    `short` and `asked` are (C,) bool.
    """
    of, radius = lines.of, CLUTTER_RADIUS * options.growth
    rows, probe = np.flatnonzero(short[of]), np.flatnonzero(asked[of])[:: 3 * options.steps]
    count = count_near(lines.xy[rows], lines.xy[probe], radius) * STEP
    hits = np.bincount(of[probe], minlength=len(lines))
    mean = np.bincount(of[probe], count, len(lines)) / np.maximum(hits, 1)
    own = np.where(short, np.minimum(lines.length, radius), 0.0)
    return np.maximum(mean - own, 0.0)
