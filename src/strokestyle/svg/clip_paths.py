"""Read clip paths as the regions that they leave, after SVG 1.1, 14.3."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from .. import files as limits
from ..geometry.affine import Affine, Box, compose, inverse, is_flat, transformed
from ..geometry.bezier import flatten
from .clip import ClipShape, Region
from .nodes import SHAPES, Node, subpaths
from .path_data import length, own_transform
from .xml import SaxReader, placed

CLIP, RULE = "clip-path", "clip-rule"
IN_BOX = "objectBoundingBox"
MAX_CLIPS = 30  # one in the other
View = tuple[float, float]  # (width, height) that percentages are of
_REFERENCE = re.compile(r"""url\(\s*["']?#([^"')]*?)["']?\s*\)""", re.IGNORECASE)


def box_of(cubics: np.ndarray) -> Box:
    """Give the box around cubics (S, 4, 2), of which there is one at least."""
    p, q, r, s = np.moveaxis(cubics, 1, 0)
    # where they turn: the roots of a t^2 + 2 b t + c, a third of the derivative
    a, b, c = s - 3 * r + 3 * q - p, r - 2 * q + p, q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        big = -(b + np.copysign(np.sqrt(b * b - a * c), b))
        turns = np.nan_to_num(np.stack([big / a, c / big]), posinf=0.0, neginf=0.0)
    t = np.clip(np.concatenate([[p * 0, p * 0 + 1], turns]), 0.0, 1.0)
    u = 1.0 - t
    points = u * u * u * p + 3 * u * t * (u * q + t * r) + t * t * t * s
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    (x, y), (width, height) = low.tolist(), (high - low).tolist()
    return x, y, width, height


class ClipPaths:
    """Reads a document's clip paths.

    Parameters
    ----------
    by_id : the document's elements
    given : the CSS properties of an element
    tolerance : px between an outline and its chords
    """

    def __init__(
        self,
        by_id: Mapping[str, Node],
        given: Callable[[Node], dict[str, str]],
        tolerance: float,
    ):
        self.by_id, self.given, self.tolerance = by_id, given, tolerance
        self._ready: dict[tuple[int, Affine, View, Box | None], Region | None] = {}
        self._left = limits.MAX_POINTS  # segments of clip paths that may still be read
        self._inside: list[int] = []  # numbers of the clip paths that are being read

    def named(self, value: str) -> Node | None:
        """Find the clip path that a property names; None: none, or none in the document."""
        match = _REFERENCE.match(value)
        found = self.by_id.get(match[1]) if match else None
        return found if found is not None and found.name == "clipPath" else None

    def needs_box(self, clip: Node) -> bool:
        """Tell whether numbers of a clip path, or of those around it, are shares of a box.

        That is the box of what it clips.
        """
        found: Node | None = clip
        for _ in range(MAX_CLIPS):
            if found is None:
                return False
            if _in_box(found):
                return True
            found = self.named(self.given(found).get(CLIP, ""))
        return False

    def region(
        self, clip: Node, matrix: Affine, view: View, box: Box | None = None
    ) -> Region | None:
        """Read the region that a clip path leaves, in px of the canvas.

        None where it is all, or cannot be told: of letters, or of a box that has no sides.

        Parameters
        ----------
        matrix : from the coordinates of what is clipped to the canvas
        view : (width, height) that percentages are of
        box : of what is clipped, in its coordinates, where `needs_box`

        Raises
        ------
        ValueError
            on a damaged one, one that clips itself, and on too many.
        """
        key = (clip.number, matrix, view, box)
        if key not in self._ready:
            itself = clip.number in self._inside
            if itself or len(self._inside) >= MAX_CLIPS:
                what = "it clips itself" if itself else f"more than {MAX_CLIPS} in one another"
                where = placed(clip.line, clip.tag, clip.attributes)
                raise ValueError(f"{where}: {what}: take it out")
            self._inside.append(clip.number)
            self._ready[key] = self._read(clip, matrix, view, box)
            self._inside.pop()
        return self._ready[key]

    def _read(self, clip: Node, matrix: Affine, view: View, box: Box | None) -> Region | None:
        given = self.given(clip)
        inner, inner_view = matrix, view
        if _in_box(clip):
            if box is None or min(box[2:]) <= 0:
                return None
            inner = compose(matrix, (box[2], 0.0, 0.0, box[3], box[0], box[1]))
            inner_view = (1.0, 1.0)
        inner = compose(inner, own_transform(given, clip.attributes, inner_view))
        around = self.named(given.get(CLIP, ""))
        within = None if around is None else self.region(around, matrix, view, box)
        rule, shapes = given.get(RULE, "nonzero"), list[ClipShape]()
        for child in clip.children:
            if child.name == "text":  # its letters are of a font
                return None
            shape = self._shape(child, inner, inner_view, rule)
            shapes += [] if shape is None else [shape]
        return Region(tuple(shapes), within)

    def _shape(self, node: Node, matrix: Affine, view: View, rule: str) -> ClipShape | None:
        """Read an element in a clip path; None where it is no shape, or hidden."""
        given = self.given(node)
        hidden = given.get("visibility", "visible") not in ("visible", "inherit")
        if given.get("display") == "none" or (hidden and node.name in SHAPES):
            return None
        matrix = compose(matrix, own_transform(given, node.attributes, view))
        rule = given.get(RULE, rule)
        if node.name == "use":
            target = self.by_id.get(node.href[1:]) if node.href[:1] == "#" else None
            if target is None or target.name not in SHAPES:
                return None
            x, y = (
                length(node.attributes.get(k, "0"), k, whole)
                for k, whole in zip("xy", view, strict=True)
            )
            matrix = compose(matrix, (1.0, 0.0, 0.0, 1.0, x, y))
            shape = self._shape(target, matrix, view, rule)
        elif node.name in SHAPES:
            shape = self._rings(node, matrix, view, rule)
        else:
            return None
        clip = self.named(given.get(CLIP, ""))
        if shape is None or clip is None:
            return shape
        box = None
        if self.needs_box(clip):  # of polygons, as fine as they are drawn
            rings = transformed(inverse(matrix), shape.rings)
            box = box_of(np.repeat(rings[:, None], 4, axis=1))
        within = self.region(clip, matrix, view, box)
        if within is None or shape.within is None:
            return replace(shape, within=within or shape.within)
        return replace(shape, within=Region((shape,), within))  # of a `use`, and of what it draws

    def _rings(self, node: Node, matrix: Affine, view: View, rule: str) -> ClipShape | None:
        chains = subpaths(node.name, node.attributes, view)
        counts = [len(chain) for chain in chains]
        self._left -= sum(counts)
        if self._left < 0:
            raise ValueError(f"more than {limits.MAX_POINTS} points of clip paths: simplify them")
        if not chains or is_flat(matrix):
            return None
        cubics = transformed(matrix, np.concatenate([np.reshape(c, (-1, 4, 2)) for c in chains]))
        rings, offsets = flatten(cubics, np.cumsum([0, *counts]), self.tolerance)
        return ClipShape(rings, offsets, rule == "evenodd")


def _in_box(clip: Node) -> bool:
    return clip.attributes.get("clipPathUnits", "").strip() == IN_BOX


def count_clips_of_letters(data: bytes) -> int:
    """Count the clip paths with letters in them, which are not obeyed.

    Raises ValueError where the document is damaged, unsafe or too large.
    """
    if b"clipPath" not in data or b"text" not in data:
        return 0
    lettered: list[bool] = []
    opened: list[str] = []

    def start(_: str, tag: str, __: dict[str, str]) -> None:
        if tag == "clipPath":
            lettered.append(False)
        elif tag == "text" and opened[-1] == "clipPath":
            lettered[-1] = True
        opened.append(tag)

    def end() -> None:
        opened.pop()

    SaxReader(start, end).walk(data)
    return sum(lettered)
