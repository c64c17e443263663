"""Leave named parts out of a surface: what lay behind them is seen."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from difflib import get_close_matches

import numpy as np

from ..geometry.parts import part_name
from .surface import Surface

FEW = 20  # names of parts that an error lists


def hide_parts(surface: Surface, wanted: Sequence[str]) -> Surface:
    """Leave parts out of a surface.

    The rest keeps its place, normals and curvatures; where it was joined to what is left out, it
    has a boundary.

    Parameters
    ----------
    wanted : texts such as 'wheel,saddle'; a name that holds commas is given alone, or in double
        quotes: 'wheel,"nut, left"'

    Raises
    ------
    ValueError
        on a name that no part has, naming those that there are, and where nothing is left.
    """
    names = np.array([part_name(name) for name in surface.part_names])
    used = names[np.unique(surface.part)].tolist()
    there = [name for name in dict.fromkeys(used) if name]
    hidden = {name for text in wanted for name in _split(text, there)}
    unknown = [name for name in dict.fromkeys(hidden) if name not in there]
    if unknown:
        raise ValueError(_unknown(sorted(unknown), there))
    keep = ~np.isin(names, list(hidden))[surface.part]
    if not keep.any():
        raise ValueError("all its parts are hidden: nothing is left to draw")
    return surface if keep.all() else surface.with_faces(keep)


def _split(text: str, there: list[str]) -> list[str]:
    """Read the names in a text: one that holds commas, or a line of them as CSV has it."""
    if part_name(text) in there:
        return [part_name(text)]
    cells = next(csv.reader([" ".join(text.split())], skipinitialspace=True), [])
    return [part_name(cell) for cell in cells if cell.strip()]


def _unknown(unknown: list[str], there: list[str]) -> str:
    """Say in one line which names no part has, what may have been meant, and what there is."""
    if not there:
        return f"no part named {_quoted(unknown)} to hide: it has no named parts"
    low = {name.lower(): name for name in there}
    meant = [m for name in unknown for m in get_close_matches(name.lower(), low, 1)]
    guess = f"; did you mean {_quoted([low[name] for name in meant])}?" if meant else "."
    few = ", ".join(there[:FEW]) + ", ..." * (len(there) > FEW)
    return f"no part named {_quoted(unknown)} to hide{guess} There are {few}"


def _quoted(names: list[str]) -> str:
    return ", ".join(map(repr, names))
