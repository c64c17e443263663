"""Affine maps of the plane, as SVG writes them."""

from __future__ import annotations

import re

import numpy as np

from ..files import quoted

MAX_NUMBER = 1e12  # larger ones are mistakes, and their products leave the range of a float

# SVG's matrix: x' = a x + c y + e, y' = b x + d y + f
Affine = tuple[float, float, float, float, float, float]
Box = tuple[float, float, float, float]  # x, y, width, height

IDENTITY: Affine = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)


def compose(outer: Affine, inner: Affine) -> Affine:
    """Multiply two matrices: the result applies `inner`, then `outer`.

    Raises ValueError where a number of it is too large to be a place in a drawing.
    """
    a, b, c, d, e, f = outer
    p, q, r, s, t, u = inner
    made = (
        a * p + c * q,
        b * p + d * q,
        a * r + c * s,
        b * r + d * s,
        a * t + c * u + e,
        b * t + d * u + f,
    )
    if not all(abs(value) <= MAX_NUMBER**2 for value in made):
        raise ValueError("its transforms together are too large to be a place in a drawing")
    return made


def determinant(matrix: Affine) -> float:
    """Give the factor by which a matrix changes areas, below 0 where it mirrors."""
    a, b, c, d, _, _ = matrix
    return a * d - b * c


def is_flat(matrix: Affine) -> bool:
    """Tell whether a matrix presses the plane onto a line, or nearly."""
    return abs(determinant(matrix)) < 1e-12


def inverse(matrix: Affine) -> Affine:
    """Invert a matrix that is not flat."""
    a, b, c, d, e, f = matrix
    det = determinant(matrix)
    return (d / det, -b / det, -c / det, a / det, (c * f - d * e) / det, (b * e - a * f) / det)


def transformed(matrix: Affine, points: np.ndarray) -> np.ndarray:
    """Apply a matrix to points (..., 2)."""
    # element by element, not by a matrix product: equal points stay equal to the last bit, so that
    # loops stay closed
    a, b, c, d, e, f = matrix
    x, y = points[..., 0], points[..., 1]
    return np.stack([a * x + c * y + e, b * x + d * y + f], axis=-1)


def fit_box(box: Box, into: Box, align: str = "") -> Affine:
    """Find the matrix that lays a box into another, after SVG's preserveAspectRatio.

    `align` : the attribute's value; without one, the box is seen whole, and centred
    Raises ValueError on a value that is none.
    """
    (x, y, width, height), (to_x, to_y, to_width, to_height) = box, into
    sx, sy = to_width / width, to_height / height
    words = align.split() or ["xMidYMid"]
    if words[0] == "none":
        return (sx, 0.0, 0.0, sy, to_x - sx * x, to_y - sy * y)
    share_x, share_y = _shares(words[0], align)
    scale = max(sx, sy) if words[1:] == ["slice"] else min(sx, sy)
    left = to_x + share_x * (to_width - scale * width)
    top = to_y + share_y * (to_height - scale * height)
    return (scale, 0.0, 0.0, scale, left - scale * x, top - scale * y)


def _shares(word: str, align: str) -> tuple[float, float]:
    """Read how much of the spare room lies to the left and above: 0, 1/2 or 1."""
    match = re.fullmatch("x(Min|Mid|Max)Y(Min|Mid|Max)", word)
    if not match:
        raise ValueError(
            f'bad preserveAspectRatio "{quoted(align)}": expected none, or for instance '
            "xMidYMid meet"
        )
    shares = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
    return shares[match[1]], shares[match[2]]
