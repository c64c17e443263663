"""Where `svg` and `symbol` elements lay what is in them, as SVG 1.1 says in 7.9 and 7.10."""

from __future__ import annotations

from collections.abc import Mapping

from ..geometry.affine import MAX_NUMBER, Affine, Box, fit_box
from .path_data import length, parse_numbers

SIDES = ("x", "y", "width", "height")
DEFAULTS = {"x": "0", "y": "0", "width": "100%", "height": "100%"}


def view_box(attributes: Mapping[str, str]) -> Box | None:
    """Read a viewBox; None where there is none. Raises ValueError."""
    if "viewBox" not in attributes:
        return None
    numbers = parse_numbers(attributes["viewBox"], "viewBox")
    if len(numbers) != 4 or min(numbers[2:]) < 1 / MAX_NUMBER:
        raise ValueError("viewBox must be four numbers, x y width height, the last two above 0")
    x, y, width, height = numbers
    return x, y, width, height


def nested_box(attributes: Mapping[str, str], view: tuple[float, float]) -> Box | None:
    """Read where an svg or symbol element lies in what is around it; None: it is not drawn.

    `view` : (width, height) that percentages are of
    Raises ValueError.
    """
    given = {name: attributes.get(name, "auto").strip() for name in SIDES}
    x, y, width, height = (
        length(DEFAULTS[name] if text == "auto" else text, name, whole)
        for (name, text), whole in zip(given.items(), view * 2, strict=True)
    )
    if min(width, height) < 0:
        raise ValueError(f"a width or height below 0, {min(width, height):g}")
    return (x, y, width, height) if min(width, height) >= 1 / MAX_NUMBER else None


def inner_matrix(attributes: Mapping[str, str], into: Box) -> tuple[Affine, tuple[float, float]]:
    """Find the matrix of what is in an element that lies in a box, and its view.

    The view, (width, height), is what percentages in it are of. Raises ValueError.
    """
    box = view_box(attributes)
    if box is None:
        return (1.0, 0.0, 0.0, 1.0, into[0], into[1]), into[2:]
    return fit_box(box, into, attributes.get("preserveAspectRatio", "")), box[2:]
