"""Which lines to draw, and from what strength on."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ..geometry.kinds import SOFT_KINDS, SURFACE_KINDS
from ..mesh.surface import DEFAULT_CREASE

MIN_DETAIL, MAX_DETAIL = 0.1, 10.0  # see LineOptions.detailed


@dataclass(frozen=True)
class LineOptions:
    """Which lines to draw, and from what strength on.

    Thresholds are in units of the feature size F, a length; see `Surface.feature_size`.

    Parameters
    ----------
    kinds : names out of SURFACE_KINDS
    suggestive : least derivative of radial curvature along the view over n.v, times F^2 (DeCarlo
        2003)
    ridge, valley : least principal curvature, times F (Ohtake 2004)
    apparent : least view-dependent curvature (Judd 2007), times F^2
    sharpness : least -k'' / k^3 across a ridge or valley: how fast its curvature falls off to
        either side. At the tip of a conic it is 3 times the squared eccentricity: less than 3 on a
        limb, whose section is an ellipse, more on a rounded edge between two flanks, a hyperbola.
        Lines fade from the given value to half of it.
    crease : least angle between the faces at a crease, degrees
    smooth : length, in longest sides of the shape, over which normals and curvatures are smoothed
        for the soft kinds (suggestive, ridge, valley, apparent); contours need the mesh's own
        normals, or they leave its silhouette
    hysteresis : strength (0..1) that a suggestive contour, ridge, valley or apparent ridge must
        reach somewhere; the rest of it may be as weak as its threshold. 0 keeps all.
    follow : such a line is followed on to where it falls below its threshold and sharpness divided
        by this; 1 or more
    trim : leave out contours and apparent ridges that cannot be seen because of how a closed
        surface faces there

    Raises
    ------
    ValueError
        on an unknown kind or a threshold out of range.
    """

    kinds: tuple[str, ...] = (
        "contour",
        "boundary",
        "crease",
        "suggestive",
        "ridge",
        "valley",
        "intersection",
        "section",
    )
    suggestive: float = 0.01
    ridge: float = 0.4
    valley: float = 0.1
    apparent: float = 0.1
    sharpness: float = 3.0
    crease: float = DEFAULT_CREASE
    smooth: float = 0.007
    hysteresis: float = 0.5
    follow: float = 1.0
    trim: bool = True

    def __post_init__(self):
        kinds = tuple(self.kinds)
        for kind in kinds:
            if kind not in SURFACE_KINDS:
                raise ValueError(f"line kind {kind!r} is none of {', '.join(SURFACE_KINDS)}")
        object.__setattr__(self, "kinds", tuple(kind for kind in SURFACE_KINDS if kind in kinds))
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(item.default, float) and not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"line option {item.name} must be a number from 0 on, got {value}")
        if self.hysteresis > 1.0:
            raise ValueError(
                f"line option hysteresis must lie between 0 and 1, got {self.hysteresis}"
            )
        if self.follow < 1.0:
            raise ValueError(f"line option follow must be a number from 1 on, got {self.follow}")
        if self.crease > 180.0:
            raise ValueError(
                f"line option crease must lie between 0 and 180 degrees, got {self.crease}"
            )

    def detailed(self, low: float, high: float | None = None) -> LineOptions:
        """Change these options for more (above 1) or fewer (below 1) soft lines.

        They give the lines of detail `low`, each followed as far as it would be drawn at detail
        `high`, by default the same. A detail divides all thresholds of soft lines, and the
        smoothing.

        Raises
        ------
        ValueError
            on a detail outside MIN_DETAIL..MAX_DETAIL, or `high` below `low`.
        """
        high = low if high is None else high
        for detail in (low, high):
            if not (np.isfinite(detail) and MIN_DETAIL <= detail <= MAX_DETAIL):
                raise ValueError(
                    f"detail must lie between {MIN_DETAIL:g} and {MAX_DETAIL:g} "
                    f"(1 for the thresholds as they are), got {detail}"
                )
        if high < low:
            raise ValueError(f"a range of detail runs from LOW to HIGH, got {low:g}..{high:g}")
        scaled = {name: getattr(self, name) / low for name in (*SOFT_KINDS, "sharpness", "smooth")}
        hysteresis = self.hysteresis**low  # 0 and 1 stay what they are
        return replace(self, **scaled, hysteresis=hysteresis, follow=self.follow * high / low)

    def followed(self) -> LineOptions:
        """Change these options to what the weakest part of a soft line that is followed must be."""
        weaker = {name: getattr(self, name) / self.follow for name in (*SOFT_KINDS, "sharpness")}
        return replace(self, **weaker, follow=1.0, hysteresis=0.0)
