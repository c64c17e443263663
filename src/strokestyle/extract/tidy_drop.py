"""Dropping: specks, and what is more often noise than form."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .tidy_lines import SOFT, STEP, Lines, TidyOptions, near_others, short_creases

# px
ATTACHED = 6.0  # an end this near to another line is attached
LOOSE = 2.5  # a short crease's end farther from any line is loose: the edges of a true solid meet
ONE_END = 1.4  # x attached, of a line with one end attached
CLUTTER_LENGTH, CLUTTER_RADIUS = 30.0, 24.0  # lines shorter than this count, this near


def drop(lines: Lines, options: TidyOptions) -> Lines:
    """Drop specks and noise."""
    if not len(lines):
        return lines
    length = lines.length
    attached = near_others(lines, ATTACHED).reshape(-1, 2).sum(axis=1) * ~lines.closed
    crease = short_creases(lines, options)
    loose = crease & ~near_others(lines, LOOSE).reshape(-1, 2).all(axis=1)
    soft = SOFT[lines.kind] | loose
    noise = (length < CLUTTER_LENGTH) & (SOFT[lines.kind] | crease)
    need = options.soft * (1.0 + _clutter(lines, noise, soft) / max(options.clutter, 1e-9))
    least = np.array([options.isolated, options.attached * ONE_END, options.attached])[attached]
    enough = np.where(soft, length * lines.mean_strength() >= need, length >= least)
    return lines.take(enough & (length >= options.speck))


def _clutter(lines: Lines, short: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Measure the length of other `short` lines around each `asked` line, (C,) px.

    That is the length within CLUTTER_RADIUS of a point of the line, on average over its points.
    `short` and `asked` are (C,) bool.
    """
    of = lines.of
    rows, probe = np.flatnonzero(short[of]), np.flatnonzero(asked[of])[::3]
    if not len(rows) or not len(probe):
        return np.zeros(len(lines))
    tree = cKDTree(lines.xy[rows])
    count = tree.query_ball_point(lines.xy[probe], CLUTTER_RADIUS, return_length=True) * STEP
    hits = np.bincount(of[probe], minlength=len(lines))
    mean = np.bincount(of[probe], count, len(lines)) / np.maximum(hits, 1)
    own = np.where(short, np.minimum(lines.length, CLUTTER_RADIUS), 0.0)
    return np.maximum(mean - own, 0.0)
