"""A turntable: views of a surface once round its upright axis, all at one size."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..geometry.curves import DEFAULT_SPACING
from ..mesh.surface import Surface
from .camera import DEFAULT_FOV, DEFAULT_SIZE, Camera, fit_camera, swept
from .line_options import LineOptions
from .lines import SurfaceLines
from .pipeline import extract_view
from .view import View


def fit_turntable_camera(
    vertices: np.ndarray,
    view: str = "three-quarter",
    fov_y: float = DEFAULT_FOV,
    width: int = DEFAULT_SIZE,
    height: int = DEFAULT_SIZE,
    up: str = "y",
    projection: str | None = None,
) -> Camera:
    """Place a named view's camera where all `vertices` (V, 3) are seen however they are turned.

    The distance is one for all pictures of the turn, so that the shape does not change its size.
    Arguments and errors are those of `fit_camera`.
    """
    return fit_camera(swept(vertices, up), view, fov_y, width, height, up, projection)


def turntable(
    surface: Surface,
    camera: Camera,
    count: int,
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    lines: SurfaceLines | None = None,
    axis: np.ndarray | None = None,
    optional: bool = False,
) -> Iterator[View]:
    """Extract `count` views while the camera goes once round the surface, one at a time.

    View i is seen from `camera` carried 360 i / count degrees round an axis through its target,
    anticlockwise seen from above; the first is seen from `camera` itself.

    Parameters
    ----------
    surface : the shape
    camera : for pictures of one size, that of `fit_turntable_camera`
    options : which lines; those of `extract_view`
    spacing : px between the points of the curves
    lines : the lines of this surface and these options, where there are some already
    axis : (3,), the upright axis; by default the camera's up, which is another where it looks
        straight down
    optional : as `extract_view` takes it

    Raises
    ------
    ValueError
        where `count` is less than 1.
    """
    if count < 1:
        raise ValueError(f"a turntable has 1 picture or more, got {count}")
    lines = lines or SurfaceLines(surface, options or LineOptions())
    return (
        extract_view(
            surface,
            camera.turned(360.0 * i / count, axis),
            options,
            spacing,
            lines=lines,
            optional=optional,
        )
        for i in range(count)
    )
