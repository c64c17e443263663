"""What an animation shows: a turn round a shape, a camera that moves, a mesh that deforms."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..extract.camera import Camera
from ..extract.line_options import LineOptions
from ..extract.lines import SurfaceLines
from ..extract.pipeline import extract_view
from ..extract.view import View
from ..geometry.curves import DEFAULT_SPACING
from ..mesh.surface import Surface
from .frames import Shot

MAX_TURN = 15.0  # degrees between shots over which lines are known again


def shots_between(count: int) -> int:
    """Tell into how many steps each of a turntable's `count` is to be cut to follow its lines."""
    return int(np.ceil(360.0 / count / MAX_TURN - 1e-9))


def turntable_shots(
    surfaces: Surface | Sequence[Surface],
    camera: Camera,
    count: int | None = None,
    axis: np.ndarray | None = None,
) -> list[Shot]:
    """Go once round a shape: shot i is seen from `camera` carried 360 i / count degrees.

    Parameters
    ----------
    surfaces : the shape, or its frames where it deforms while it turns
    camera : for pictures of one size, that of `fit_turntable_camera`
    count : how many shots; by default as many as there are frames of the shape
    axis : (3,), the upright axis; by default the camera's up

    Raises
    ------
    ValueError
        where `count` is less than 1, or not that of the frames.
    """
    count = count or (len(surfaces) if not isinstance(surfaces, Surface) else 0)
    if count < 1:
        raise ValueError(f"a turntable has 1 picture or more, got {count}")
    cameras = [camera.turned(360.0 * i / count, axis) for i in range(count)]
    return path_shots(surfaces, cameras)


def path_shots(surfaces: Surface | Sequence[Surface], cameras: Sequence[Camera]) -> list[Shot]:
    """Put a shape, or its frames, before cameras: shot i is frame i seen from camera i.

    Raises
    ------
    ValueError
        where there are no cameras, other than one for each frame, or of several sizes.
    """
    if isinstance(surfaces, Surface):
        surfaces = [surfaces] * len(cameras)
    if not cameras:
        raise ValueError("an animation has 1 camera or more")
    if len(surfaces) != len(cameras):
        raise ValueError(
            f"{len(cameras)} cameras for {len(surfaces)} frames: give one camera for each frame"
        )
    check_sizes(cameras)
    return [Shot(*pair) for pair in zip(surfaces, cameras, strict=True)]


def check_sizes(cameras: Sequence[Camera], where: str = "camera") -> None:
    """Raise ValueError, naming `where` and the camera, unless all are of one size."""
    size = cameras[0].width, cameras[0].height
    for i, camera in enumerate(cameras):
        if (camera.width, camera.height) != size:
            raise ValueError(
                f"{where} {i}: of {camera.width} x {camera.height} px, the first of "
                f"{size[0]} x {size[1]}: all frames have one size"
            )


def load_cameras(path: str | Path) -> list[Camera]:
    """Read a path of cameras: a JSON list of what camera.json files hold, one for each frame.

    Raises
    ------
    OSError
        where the file cannot be read
    ValueError
        naming the file and the camera's place in the list, from 0: where it is no list, or a
        camera is malformed or of another size than the first.
    """
    try:
        data = json.loads(Path(path).read_bytes())  # by its first bytes: in UTF-8, -16 or -32
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not a list of cameras (JSON expected: {error})") from None
    if isinstance(data, dict) and isinstance(data.get("cameras"), list):
        data = data["cameras"]
    if isinstance(data, dict) and {"eye", "target"} & {*data, *_inner(data)}:
        raise ValueError(
            f"{path}: one camera: a path is a JSON list of them, one for each frame; --camera "
            "takes a single one"
        )
    if not isinstance(data, list):
        raise ValueError(
            f"{path}: expected a JSON list of cameras, each with eye, target, up, fov_y_deg and "
            "size"
        )
    if not data:
        raise ValueError(f"{path}: no cameras in it")
    cameras = []
    for i, one in enumerate(data):
        inner = _inner(one) if isinstance(one, dict) else one
        cameras.append(Camera.from_dict(inner, f"{path}: camera {i}"))
    check_sizes(cameras, f"{path}: camera")
    return cameras


def _inner(data: dict[str, Any]) -> dict[str, Any]:
    """The camera in what holds one under that name, else what is given."""
    inner = data.get("camera")
    return inner if isinstance(inner, dict) else data


def views_of_shots(
    shots: Sequence[Shot],
    options: LineOptions | None = None,
    spacing: float = DEFAULT_SPACING,
    optional: bool = False,
) -> Iterator[View]:
    """Extract what each shot shows, one at a time, each on its own.

    Arguments are those of `extract_view`. What no camera changes is found once for shots of one
    surface that follow each other.
    """
    options, lines = options or LineOptions(), None
    for shot in shots:
        if lines is None or lines.surface is not shot.surface:
            lines = SurfaceLines(shot.surface, options)
        yield extract_view(
            shot.surface, shot.camera, options, spacing, lines=lines, optional=optional
        )


def held(shots: Sequence[Shot], exposure: int) -> list[Shot]:
    """Take the shots that are drawn where each drawing is held for `exposure` frames."""
    return list(shots[::exposure])
