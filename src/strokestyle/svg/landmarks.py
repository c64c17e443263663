"""Find out what another program did to a shape, by landmarks on its edge."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ..geometry.affine import IDENTITY, Affine
from ..geometry.bezier import Segment
from ..geometry.curves import arc
from .path_data import SPACE, parse_path

# px that a shape's points may be off after another program's rounding, however small it was made
ROUNDING = 0.01
# of a path's length, that its landmarks may be off after svgo rounded every piece of it
SLIP = 1e-4
FINE = 8  # pieces of a fine polyline for each cubic


def first_line(d: str) -> np.ndarray:
    """Read path data's first subpath as a fine polyline (n, 2).

    Raises ValueError where it draws nothing, or as `parse_path` does.
    """
    match = re.match(rf"[{SPACE}]*[Mm][^MmZz]*[Zz]?", d)
    subpaths = parse_path(match[0] if match else "")
    if not subpaths:
        raise ValueError("a path that draws nothing")
    return fine_line(subpaths[0])


def fine_line(segments: Sequence[Segment] | np.ndarray) -> np.ndarray:
    """Flatten the cubics of a subpath, (K, 8) or (K, 4, 2), to a polyline (FINE K + 1, 2)."""
    p = np.array(segments).reshape(-1, 1, 4, 2)
    t = (np.arange(FINE) + 1)[:, None] / FINE
    s = 1 - t
    xy = (
        s**3 * p[:, :, 0]
        + 3 * s**2 * t * p[:, :, 1]
        + 3 * s * t**2 * p[:, :, 2]
        + t**3 * p[:, :, 3]
    )
    return np.concatenate([p[0, :, 0], xy.reshape(-1, 2)])


def landmarks(line: np.ndarray, measured: np.ndarray | None = None) -> np.ndarray:
    """Find the points (4, 2) at 0, 1/4, 1/2 and 3/4 of a polyline's length.

    Parameters
    ----------
    line : (n, 2)
    measured : (n, 2), a polyline by whose length the same places are found instead
    """
    along = arc(line if measured is None else measured)
    at = along[-1] * np.array([0.0, 0.25, 0.5, 0.75])
    return np.stack([np.interp(at, along, column) for column in line.T], axis=1)


def enclosed(line: np.ndarray) -> float:
    """Measure the area that a polyline (n, 2) goes round, by the shoelace formula."""
    x, y = line.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def recover_transform(
    then: np.ndarray, now: np.ndarray, line: np.ndarray | None = None, slack: float = 0.05
) -> Affine | None:
    """Find the transform that took a shape from where its landmarks were to where they are.

    The simplest that explains them: none, a translation, a similarity, any affine map. The last
    does not keep a line's proportions, so its landmarks are those of the `line` measured where it
    came from. Along a long line they slip by a SLIP of its length, as it is rounded.

    Parameters
    ----------
    then, now : landmarks (4, 2), as `landmarks` finds them
    line : the shape's outline (n, 2) as it is now; None where its landmarks are points of it, such
        as the corners of an image
    slack : px that landmarks may be off

    Returns
    -------
    None where no transform explains them: the shape was edited.
    """
    slip = 0.0 if line is None else SLIP * float(arc(line)[-1])
    if np.abs(now - then).max() <= slack + slip:
        return IDENTITY
    shift = (now - then).mean(axis=0)
    if np.abs(now - then - shift).max() <= slack + slip:
        return (1.0, 0.0, 0.0, 1.0, *shift.tolist())
    return _similarity(then, now, slack, slip) or _affine_map(then, now, line, slack, slip)


def _similarity(then: np.ndarray, now: np.ndarray, slack: float, slip: float) -> Affine | None:
    """The similarity, or mirrored one, by least squares, if it explains the landmarks (4, 2).

    Points are complex numbers, whose product turns and scales.
    """
    a, b = (values[:, 0] + 1j * values[:, 1] for values in (then, now))
    for source, mirror in ((a, 1.0), (a.conj(), -1.0)):
        spread = np.square(np.abs(source - source.mean())).sum()
        turn = ((b - b.mean()) * (source - source.mean()).conj()).sum() / max(spread, 1e-12)
        place = b.mean() - turn * source.mean()
        if np.abs(turn * source + place - b).max() <= max(slack * abs(turn), ROUNDING) + slip:
            x, y = turn.real, turn.imag
            return (x, y, -y * mirror, x * mirror, place.real, place.imag)
    return None


def _affine_map(
    then: np.ndarray, now: np.ndarray, line: np.ndarray | None, slack: float, slip: float
) -> Affine | None:
    """The affine map by least squares, if it explains the landmarks (4, 2).

    With a `line`, it and the landmarks that follow from it are found in turns.
    """
    full = np.concatenate([then, np.ones((4, 1))], axis=1)
    for _ in range(60):
        solved = np.linalg.lstsq(full, now, rcond=None)[0]  # (3, 2)
        if abs(np.linalg.det(solved[:2])) < 1e-9:
            return None
        if line is None:
            break
        before, now = now, landmarks(line, (line - solved[2]) @ np.linalg.inv(solved[:2]))
        if np.abs(now - before).max() < 1e-3:
            break
    # a map that shrinks must be met the better: else any small shape would do as what became of a
    # large one
    small, large = np.linalg.svd(solved[:2], compute_uv=False)[[1, 0]]
    close = max(slack * (large if small >= 1.0 else small), ROUNDING) + slip
    if np.abs(full @ solved - now).max() > close:
        return None
    (a, b), (c, d), (e, f) = solved.tolist()
    return a, b, c, d, e, f
