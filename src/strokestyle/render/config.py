"""What a style knows beside its weights."""

from __future__ import annotations

from dataclasses import dataclass

HAIR = 0.5  # px; thickness is learned as log(thickness + HAIR), where a habit is a factor and nothing is not infinite


@dataclass(frozen=True)
class StyleConfig:
    """What a style needs to know beside its weights. Lengths in px of a canvas whose longer side is `size`.

    Defaults: spacing as in the authors' code; the others measured on drawings by hand-like simulation (DESIGN.md).
    """

    size: int = 768
    spacing: float = 3.0
    join: float = 10.0
    corner: float = 65.0
    extend: float = 24.0
    hidden: int = 8
