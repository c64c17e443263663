"""What is compared: the methods of the paper's tables, and ours, all behind one signature."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from dataset import Lesson, Sheet

MODULES = (  # each with METHODS: {name: Method}
    "ablations",
    "baselines.sketchpatch",
    "baselines.sincut",
    "baselines.benard",
    "baselines.nst",
)

# draws a sheet: (H, W, 3) uint8 on white; the same seed, the same image
Painter = Callable[[Sheet, int], np.ndarray]


@dataclass(frozen=True)
class Method:
    """A way to learn a style from one drawing.

    label : its name in tables
    source : the paper that it is from
    learn : (lesson, settings, seed, device) -> Painter
    reduced : its settings for a CPU, which tables state
    full : its settings as published, for a GPU
    """

    label: str
    source: str
    learn: Callable[[Lesson, Any, int, str], Painter]
    reduced: Any
    full: Any


def all_methods() -> dict[str, Method]:
    """Every method there is, by name, in the order of the tables."""
    found: dict[str, Method] = {}
    for module in MODULES:
        found |= import_module(module).METHODS
    return found


def chosen_methods(names: str | None) -> dict[str, Method]:
    """The methods of a comma-separated list, in its order. Raises ValueError on another name."""
    there = all_methods()
    if names is None:
        return there
    unknown = sorted(set(names.split(",")) - set(there))
    if unknown:
        raise ValueError(f"no method {', '.join(unknown)}; there are {', '.join(there)}")
    return {name: there[name] for name in names.split(",")}
