"""Give the page's scripts the constants that they share with Python, so that neither can drift."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from ..drawing import edit, outline, ribbon, strip
from ..svg import ink, tones
from ..svg.format import DEFAULTS, FORMAT_CONSTANTS


def shared_constants() -> dict[str, dict[str, Any]]:
    """Collect the constants by the module that says what they mean.

    `options` are the defaults of numbers that `data-ss-options` leaves out.
    """
    return {
        "format": FORMAT_CONSTANTS,
        "options": {
            name: DEFAULTS[name] for name in ("decimals", "tolerance", "tones", "texture_res")
        },
        "ribbon": _named(ribbon, "STIFFNESS", "MAX_SPACING", "NARROWING"),
        "edit": _named(edit, "STEP"),
        "outline": _named(outline, "FIT_STEP"),
        "strip": _named(strip, "MAX_COLUMNS", "MAX_STRETCH", "TONE_BLUR", "TONE_LEVELS"),
        "ink": _named(ink, "GRAIN"),
        "tones": _named(tones, "SLACK", "MAX_POINTS", "MAX_SLACK", "HELD", "SPECK", "FOLD",
                        "COARSE_BINS", "CLEAR"),
    }  # fmt: skip


def _named(module: ModuleType, *names: str) -> dict[str, Any]:
    return {name: getattr(module, name) for name in names}
