"""The pinhole camera: world <-> pixels, named views, camera.json."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# azimuth, elevation in degrees: where the eye stands, 0 = in front (+z), azimuth towards +x
NAMED_VIEWS = {
    "front": (0.0, 0.0),
    "three-quarter": (-30.0, 15.0),
    "side": (90.0, 0.0),
    "back": (180.0, 0.0),
    "top": (0.0, 89.0),
}

DEFAULT_FOV = 30.0
DEFAULT_SIZE = 768
MARGIN = 0.08  # of the canvas, left free on each side of a fitted shape


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with square pixels.

    Parameters
    ----------
    eye, target, up : (3,) float, world units
    fov_y : float, degrees, the angle that the image height subtends
    width, height : int, pixels

    Raises
    ------
    ValueError
        where the camera could not see anything: eye at the target, up along the view, a bad
        angle or size.
    """

    eye: np.ndarray
    target: np.ndarray
    up: np.ndarray
    fov_y: float
    width: int
    height: int

    def __post_init__(self):
        for name in ("eye", "target", "up"):
            try:
                value = np.array(getattr(self, name), dtype=np.float64)
            except (TypeError, ValueError):
                value = np.zeros(0)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(
                    f"camera {name} must be three finite numbers, got {getattr(self, name)!r}"
                )
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if not 1.0 <= float(self.fov_y) <= 150.0:
            raise ValueError(f"camera fov_y must lie between 1 and 150 degrees, got {self.fov_y}")
        for name in ("width", "height"):
            value = getattr(self, name)
            if int(value) != value or not 16 <= value <= 16384:
                raise ValueError(
                    f"camera {name} must be a whole number of pixels from 16 to 16384, got {value}"
                )
            object.__setattr__(self, name, int(value))
        object.__setattr__(self, "fov_y", float(self.fov_y))
        forward = self.target - self.eye
        if np.linalg.norm(forward) < 1e-9:
            raise ValueError("camera eye and target are the same point")
        if np.linalg.norm(np.cross(forward, self.up)) < 1e-9 * np.linalg.norm(forward):
            raise ValueError("camera up points along the view direction: give another up vector")

    @property
    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find unit vectors (right, down, forward) of the image, in world coordinates, each
        (3,)."""
        forward = self.target - self.eye
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right = right / np.linalg.norm(right)
        return right, np.cross(forward, right), forward

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return 0.5 * self.height / np.tan(0.5 * np.radians(self.fov_y))

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project world points (N, 3) to pixels (N, 2) and depth along the view axis (N,).

        Points at or behind the eye have depth <= 0; their pixels are meaningless but finite.
        """
        right, down, forward = self.axes
        rel = np.asarray(points, np.float64) - self.eye
        depth = rel @ forward
        scale = self.focal / np.where(np.abs(depth) < 1e-12, 1e-12, depth)
        xy = np.stack(
            [rel @ right * scale + 0.5 * self.width, rel @ down * scale + 0.5 * self.height], axis=1
        )
        return xy, depth

    def rays(self, xy: np.ndarray) -> np.ndarray:
        """Cast pixels (N, 2) as unit directions (N, 3) from the eye."""
        right, down, forward = self.axes
        xy = np.asarray(xy, np.float64)
        direction = (
            (xy[:, :1] - 0.5 * self.width) * right
            + (xy[:, 1:] - 0.5 * self.height) * down
            + self.focal * forward
        )
        return direction / np.linalg.norm(direction, axis=1, keepdims=True)

    def pixel_centres(self) -> np.ndarray:
        """List the centres of all pixels, row by row, (H*W, 2)."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def turned(self, degrees: float) -> Camera:
        """Turn the eye about the upright axis through the target, anticlockwise seen from above."""
        if not degrees:
            return self
        a, k = np.radians(degrees), self.up / np.linalg.norm(self.up)
        r = self.eye - self.target
        r = (
            r * np.cos(a) + np.cross(k, r) * np.sin(a) + k * (k @ r) * (1.0 - np.cos(a))
        )  # Rodrigues
        return Camera(self.target + r, self.target, self.up, self.fov_y, self.width, self.height)

    def to_dict(self) -> dict:
        """Describe the camera in numbers and lists, as camera.json holds it."""
        return {
            "eye": self.eye.tolist(),
            "target": self.target.tolist(),
            "up": self.up.tolist(),
            "fov_y_deg": self.fov_y,
            "size": [self.width, self.height],
        }

    @classmethod
    def from_dict(cls, data: dict, where: str = "camera") -> Camera:
        """Make the camera that `to_dict` describes.

        Raises
        ------
        ValueError
            naming `where`, on a missing or malformed entry.
        """
        if not isinstance(data, dict):
            raise ValueError(
                f"{where}: expected a JSON object with eye, target, up, fov_y_deg and size"
            )
        missing = [key for key in ("eye", "target", "fov_y_deg", "size") if key not in data]
        if missing:
            raise ValueError(
                f"{where}: no {', '.join(missing)} in it; a camera needs eye, target, fov_y_deg "
                "and size"
            )
        try:
            width, height = data["size"]
            return cls(
                data["eye"],
                data["target"],
                data.get("up", [0, 1, 0]),
                data["fov_y_deg"],
                width,
                height,
            )
        except (TypeError, ValueError) as error:
            raise ValueError(f"{where}: {error}") from None

    @classmethod
    def load(cls, path: str | Path) -> Camera:
        """Read a camera.json, or a .json written by `strokestyle extract` (its "camera" entry)."""
        path = Path(path)
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
        except (UnicodeDecodeError, json.JSONDecodeError) as error:
            raise ValueError(f"{path}: not a camera file (JSON expected: {error})") from None
        if isinstance(data, dict) and isinstance(data.get("camera"), dict):
            data = data["camera"]
        return cls.from_dict(data, str(path))


def parse_view(text: str) -> tuple[float, float]:
    """Read a named view or "AZ,EL" as (azimuth, elevation), degrees. Raises ValueError."""
    if text in NAMED_VIEWS:
        return NAMED_VIEWS[text]
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(
            f"view {text!r} is neither one of {', '.join(NAMED_VIEWS)} nor AZIMUTH,ELEVATION in "
            "degrees"
        ) from None
    if not (np.isfinite(azimuth) and -90.0 <= elevation <= 90.0):
        raise ValueError(f"view {text!r}: the elevation must lie between -90 and 90 degrees")
    return azimuth, float(np.clip(elevation, -89.9, 89.9))


def fit_camera(
    vertices: np.ndarray,
    view: str = "three-quarter",
    fov_y: float = DEFAULT_FOV,
    width: int = DEFAULT_SIZE,
    height: int = DEFAULT_SIZE,
    up: str = "y",
) -> Camera:
    """Place the camera of a named view so that all `vertices` (V, 3) fill the canvas.

    The picture of the shape is centred, MARGIN of the canvas from the nearest sides: target is the
    point of the view axis through that centre, not the centroid.

    Parameters
    ----------
    vertices : (V, 3), world units
    view : one of NAMED_VIEWS, or "AZIMUTH,ELEVATION" in degrees
    fov_y : degrees that the image height subtends
    width, height : pixels
    up : "y" or "z", the world axis that points up in the picture; with "z" a shape's front faces -y

    Raises
    ------
    ValueError
        on an unknown view or up axis, or a field of view outside 1 to 150 degrees.
    """
    out, up_axis = _eye_direction(view, up)
    if not 1.0 <= fov_y <= 150.0:
        raise ValueError(f"the field of view must lie between 1 and 150 degrees, got {fov_y:g}")
    vertices = np.asarray(vertices, np.float64)
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    radius = max(float(np.linalg.norm(vertices - centre, axis=1).max()), 1e-6)
    right, down, forward = Camera(centre + out, centre, up_axis, fov_y, width, height).axes
    rel = vertices - centre
    across, depth = np.stack([rel @ right, rel @ down]), rel @ forward
    slope = (1.0 - 2.0 * MARGIN) * np.tan(0.5 * np.radians(fov_y)) * np.array([width / height, 1.0])
    distance, shift = _fit_pyramid(across, depth, slope, 0.05 * radius)
    target = centre + shift[0] * right + shift[1] * down
    return Camera(target + distance * out, target, up_axis, fov_y, width, height)


def _eye_direction(view: str, up: str) -> tuple[np.ndarray, np.ndarray]:
    """Find the unit vector (3,) from the shape to a view's eye, and the axis (3,) that is up."""
    azimuth, elevation = np.radians(parse_view(view))
    out = np.array(
        [
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
            np.cos(elevation) * np.cos(azimuth),
        ]
    )
    if up == "y":
        return out, np.array([0.0, 1.0, 0.0])
    if up == "z":
        return np.array([out[0], -out[2], out[1]]), np.array([0.0, 0.0, 1.0])
    raise ValueError(f"up must be y or z, got {up!r}")


def _fit_pyramid(
    across: np.ndarray, depth: np.ndarray, slope: np.ndarray, clearance: float
) -> tuple[float, np.ndarray]:
    """Find how far back the eye must stand, and how far aside (2,), to see all points closely.

    The four planes through the eye and the margins touch the shape: |x - shift| <= slope (depth +
    distance), for both axes of the image.

    Parameters
    ----------
    across : (2, V), places to the right and down, world units
    depth : (V,), places along the view
    slope : (2,), half the width and height of the picture at depth 1
    clearance : least distance from the eye to the nearest point
    """
    high = (across - slope[:, None] * depth).max(axis=1)
    low = (-across - slope[:, None] * depth).max(axis=1)
    distance = max(float(((high + low) / (2.0 * slope)).max()), clearance - float(depth.min()))
    shift = 0.5 * (high - low)
    for _ in range(20):  # the looser axis is not yet centred in perspective; this contracts quickly
        seen = (across - shift[:, None]) / (depth + distance)
        shift = shift + 0.5 * (seen.max(axis=1) + seen.min(axis=1)) * distance
    return distance, shift


def swept(vertices: np.ndarray, up: str = "y", steps: int = 72) -> np.ndarray:
    """Bound `vertices` (V, 3), however they are turned about the upright axis, by points (M, 3).

    The axis goes through the centre of their box; the points lie on `steps` half planes through it.
    """
    vertices = np.asarray(vertices, np.float64)
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    axis = "xyz".index(up)
    flat = [i for i in range(3) if i != axis]
    radius = np.hypot(*(vertices - centre)[:, flat].T)
    profile = _swept_profile(radius, vertices[:, axis])
    angle = np.linspace(0, 2 * np.pi, steps, endpoint=False)
    out = np.empty((len(profile), steps, 3))
    out[..., flat[0]] = centre[flat[0]] + profile[:, :1] * np.cos(angle)
    out[..., flat[1]] = centre[flat[1]] + profile[:, :1] * np.sin(angle)
    out[..., axis] = profile[:, 1:]
    return out.reshape(-1, 3)


def _swept_profile(radius: np.ndarray, height: np.ndarray, slices: int = 128) -> np.ndarray:
    """Bound points by a profile (M, 2) of radius and height: each slice's widest, low and high."""
    in_slice = np.digitize(height, np.linspace(height.min(), height.max(), slices + 1)[1:-1])
    widest = np.zeros(slices)
    np.maximum.at(widest, in_slice, radius)
    low, high = np.full(slices, np.inf), np.full(slices, -np.inf)
    np.minimum.at(low, in_slice, height)
    np.maximum.at(high, in_slice, height)
    held = np.isfinite(low)
    return np.concatenate([np.stack([widest, low], 1)[held], np.stack([widest, high], 1)[held]])
