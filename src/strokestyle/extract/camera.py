"""The camera, in perspective or parallel projection: world <-> pixels, named views, camera.json."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..mesh.triangles import bounds, distances

# azimuth, elevation in degrees: where the eye stands, 0 = in front (+z), azimuth towards +x
NAMED_VIEWS = {
    "front": (0.0, 0.0),
    "three-quarter": (-30.0, 15.0),
    "side": (90.0, 0.0),
    "back": (180.0, 0.0),
    "left": (-90.0, 0.0),
    "right": (90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
    # ISO 5456-3:1996, axonometric representations. Isometric: all three axes are foreshortened
    # alike. Dimetric: the one towards the eye half as much as the two others, 1 : 1 : 1/2, which
    # the standard rounds to axes at 7 and 42 degrees; exactly they lie at 7.18 and 41.41.
    "isometric": (45.0, float(np.degrees(np.arcsin(1.0 / np.sqrt(3.0))))),
    "dimetric": (
        float(np.degrees(np.arcsin(1.0 / np.sqrt(8.0)))),
        float(np.degrees(np.arcsin(1.0 / 3.0))),
    ),
}
PARALLEL_VIEWS = ("isometric", "dimetric")  # drawn in parallel projection unless told otherwise
PROJECTIONS = ("perspective", "parallel")

DEFAULT_FOV = 30.0
DEFAULT_SIZE = 768
MARGIN = 0.08  # of the canvas, left free on each side of a fitted shape
# Steps that centre a shape on the canvas, and how many of all its points; then of those outermost.
STEPS, STEPS_OF_ALL = 20, 3
TINY_MOVE = 1e-9  # of a shape of size 1: far above rounding


@dataclass(frozen=True)
class Camera:
    """A camera with square pixels: a pinhole, or, with its eye at infinity, parallel projection.

    Parameters
    ----------
    eye, target, up : (3,) float, world units; in parallel projection the eye tells a direction, and
        the plane from which depth is measured
    fov_y : float, degrees, the angle that the image height subtends; None in parallel projection
    width, height : int, pixels
    extent : float, world units that the image height spans in parallel projection; None in
        perspective

    Raises
    ------
    ValueError
        where the camera could not see anything: eye at the target, up along the view, a bad
        angle, extent or size.
    """

    eye: np.ndarray
    target: np.ndarray
    up: np.ndarray
    fov_y: float | None
    width: int
    height: int
    extent: float | None = None

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
        self._check_projection()
        for name in ("width", "height"):
            value = getattr(self, name)
            if int(value) != value or not 16 <= value <= 16384:
                raise ValueError(
                    f"camera {name} must be a whole number of pixels from 16 to 16384, got {value}"
                )
            object.__setattr__(self, name, int(value))
        forward = self.target - self.eye
        if np.linalg.norm(forward) < 1e-9:
            raise ValueError("camera eye and target are the same point")
        if np.linalg.norm(np.cross(forward, self.up)) < 1e-9 * np.linalg.norm(forward):
            raise ValueError("camera up points along the view direction: give another up vector")

    def _check_projection(self) -> None:
        """Raise ValueError unless there is either a good angle or a good extent."""
        if (self.fov_y is None) == (self.extent is None):
            raise ValueError("a camera has either fov_y (perspective) or extent (parallel)")
        if self.extent is None:
            fov_y = float(self.fov_y)  # type: ignore[arg-type]
            if not 1.0 <= fov_y <= 150.0:
                raise ValueError(f"camera fov_y must lie between 1 and 150 degrees, got {fov_y}")
            object.__setattr__(self, "fov_y", fov_y)
            return
        extent = float(self.extent)
        if not (np.isfinite(extent) and extent > 0.0):
            raise ValueError(f"camera extent must be a length above 0, world units, got {extent}")
        object.__setattr__(self, "extent", extent)

    @property
    def projection(self) -> str:
        """Name the projection, one of PROJECTIONS."""
        return PROJECTIONS[self.extent is not None]

    @property
    def viewpoint(self) -> np.ndarray:
        """The eye in homogeneous coordinates, (4,).

        A point and 1; or 0 and, before it, the unit vector to the eye that is at infinity.
        """
        if self.extent is None:
            return np.r_[self.eye, 1.0]
        return np.r_[-self.axes[2], 0.0]

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
        """Pixels per world unit: at depth 1, the focal length; everywhere in parallel."""
        if self.extent is not None:
            return self.height / self.extent
        assert self.fov_y is not None  # one of both is there
        return float(0.5 * self.height / np.tan(0.5 * np.radians(self.fov_y)))

    def homogeneous(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find x, y, w (N,) of world points (N, 3), linear functions of their place.

        Pixels from the middle of the image are x / w and y / w. In perspective w is the depth, in
        parallel projection 1.
        """
        right, down, forward = self.axes
        rel = np.asarray(points, np.float64) - self.eye
        w = rel @ forward if self.extent is None else np.ones(len(rel))
        return rel @ right * self.focal, rel @ down * self.focal, w

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project world points (N, 3) to pixels (N, 2) and depth along the view axis (N,).

        In perspective, points at or behind the eye have depth <= 0; their pixels are meaningless
        but finite.
        """
        x, y, w = self.homogeneous(points)
        depth = w if self.extent is None else self.depth(points)
        w = np.where(np.abs(w) < 1e-12, 1e-12, w)
        return np.stack([x / w + 0.5 * self.width, y / w + 0.5 * self.height], axis=1), depth

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Measure the depth along the view axis of world points (N, 3), (N,), as `project` does."""
        return (np.asarray(points, np.float64) - self.eye) @ self.axes[2]

    def shows(self, depth: np.ndarray) -> np.ndarray:
        """Tell which depths (N,) lie before the eye: all where it is at infinity, (N,) bool."""
        return np.ones(np.shape(depth), bool) if self.extent is not None else depth > 0.0

    def rays(self, xy: np.ndarray) -> np.ndarray:
        """Cast pixels (..., 2) as unit directions (..., 3), away from the eye."""
        right, down, forward = self.axes
        x, y = np.moveaxis(np.asarray(xy, np.float64), -1, 0)
        if self.extent is not None:
            return np.broadcast_to(forward, (*x.shape, 3)).copy()
        direction = (
            (x - 0.5 * self.width)[..., None] * right
            + (y - 0.5 * self.height)[..., None] * down
            + self.focal * forward
        )
        return direction / np.linalg.norm(direction, axis=-1, keepdims=True)

    def origins(self, xy: np.ndarray) -> np.ndarray:
        """Tell where the rays of pixels (..., 2) begin, (..., 3).

        That is the eye; in parallel projection, a point of the plane through it.
        """
        x, y = np.moveaxis(np.asarray(xy, np.float64), -1, 0)
        if self.extent is None:
            return np.broadcast_to(self.eye, (*x.shape, 3))
        right, down, _ = self.axes
        x, y = (x - 0.5 * self.width) / self.focal, (y - 0.5 * self.height) / self.focal
        return self.eye + x[..., None] * right + y[..., None] * down

    def clear_of(self, points: np.ndarray) -> Camera:
        """Move the eye of parallel projection back along its axis, before all points (N, 3).

        Nothing changes in the picture. The camera itself where they lie before the eye's plane
        already, and in perspective.
        """
        if self.extent is None:
            return self
        depth = self.depth(points)
        room = 0.05 * max(float(np.ptp(depth)), self.extent)
        if depth.min() >= room:
            return self
        return replace(self, eye=self.eye + (depth.min() - room) * self.axes[2])

    def pixel_centres(self) -> np.ndarray:
        """List the centres of all pixels, row by row, (H*W, 2)."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def turned(self, degrees: float, axis: np.ndarray | None = None) -> Camera:
        """Turn the camera about an axis (3,) through the target, anticlockwise seen from its tip.

        By default that is the camera's own up.
        """
        if not degrees:
            return self
        axis = self.up if axis is None else np.asarray(axis, np.float64)
        a, k = np.radians(degrees), axis / np.linalg.norm(axis)

        def turn(r: np.ndarray) -> np.ndarray:  # Rodrigues
            return r * np.cos(a) + np.cross(k, r) * np.sin(a) + k * (k @ r) * (1.0 - np.cos(a))

        return replace(self, eye=self.target + turn(self.eye - self.target), up=turn(self.up))

    def to_dict(self) -> dict:
        """Describe the camera in numbers and lists, as camera.json holds it."""
        parallel = self.extent is not None
        return {
            "projection": self.projection,
            "eye": self.eye.tolist(),
            "target": self.target.tolist(),
            "up": self.up.tolist(),
            **({"extent": self.extent} if parallel else {"fov_y_deg": self.fov_y}),
            "size": [self.width, self.height],
        }

    @classmethod
    def from_dict(cls, data: dict, where: str = "camera") -> Camera:
        """Make the camera that `to_dict` describes; where it names no projection, a perspective.

        Raises
        ------
        ValueError
            naming `where`, on a missing or malformed entry.
        """
        if not isinstance(data, dict):
            raise ValueError(
                f"{where}: expected a JSON object with eye, target, up, fov_y_deg and size"
            )
        projection = data.get("projection", "perspective")
        if projection not in PROJECTIONS:
            raise ValueError(
                f"{where}: projection is {projection!r}; it must be {' or '.join(PROJECTIONS)}"
            )
        angle = "extent" if projection == "parallel" else "fov_y_deg"
        missing = [key for key in ("eye", "target", angle, "size") if key not in data]
        if missing:
            raise ValueError(
                f"{where}: no {', '.join(missing)} in it; a camera in {projection} projection "
                f"needs eye, target, {angle} and size"
            )
        try:
            width, height = data["size"]
            return cls(
                data["eye"],
                data["target"],
                data.get("up", [0, 1, 0]),
                None if projection == "parallel" else float(data["fov_y_deg"]),
                width,
                height,
                float(data["extent"]) if projection == "parallel" else None,
            )
        except (TypeError, ValueError) as error:
            raise ValueError(f"{where}: {error}") from None

    @classmethod
    def load(cls, path: str | Path) -> Camera:
        """Read a camera.json, or a .json written by `strokestyle extract` (its "camera" entry)."""
        path = Path(path)
        try:
            data = json.loads(path.read_bytes())  # by its first bytes: in UTF-8, -16 or -32
        except (ValueError, RecursionError) as error:
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
    if not np.isfinite(azimuth):
        raise ValueError(f"view {text!r}: the azimuth is no number of degrees")
    if not -90.0 <= elevation <= 90.0:
        raise ValueError(f"view {text!r}: the elevation must lie between -90 and 90 degrees")
    return azimuth, elevation


def projection_of(view: str) -> str:
    """Tell the projection that a view is drawn in unless told otherwise, one of PROJECTIONS."""
    return PROJECTIONS[view in PARALLEL_VIEWS]


def fit_camera(
    vertices: np.ndarray,
    view: str = "three-quarter",
    fov_y: float = DEFAULT_FOV,
    width: int = DEFAULT_SIZE,
    height: int = DEFAULT_SIZE,
    up: str = "y",
    projection: str | None = None,
) -> Camera:
    """Place the camera of a named view so that all `vertices` (V, 3) fill the canvas.

    The picture of the shape is centred, MARGIN of the canvas from the nearest sides: target is the
    point of the view axis through that centre, not the centroid.

    Parameters
    ----------
    vertices : (V, 3), world units
    view : one of NAMED_VIEWS, or "AZIMUTH,ELEVATION" in degrees
    fov_y : degrees that the image height subtends, in perspective. In parallel projection the eye
        is put where it would stand in perspective, so that depths are alike.
    width, height : pixels
    up : "y" or "z", the world axis that points up in the picture; with "z" a shape's front faces -y
    projection : one of PROJECTIONS; by default parallel for PARALLEL_VIEWS, else perspective

    Raises
    ------
    ValueError
        on an unknown view, up axis or projection, or a field of view outside 1 to 150 degrees.
    """
    out, picture_up = _eye_direction(view, up)
    projection = projection or projection_of(view)
    if projection not in PROJECTIONS:
        raise ValueError(f"projection must be {' or '.join(PROJECTIONS)}, got {projection!r}")
    if not 1.0 <= fov_y <= 150.0:
        raise ValueError(f"the field of view must lie between 1 and 150 degrees, got {fov_y:g}")
    vertices = np.asarray(vertices, np.float64)
    low, high = bounds(vertices)
    centre = 0.5 * (low + high)
    radius = max(float(distances(vertices, centre).max()), 1e-6)
    right, down, forward = Camera(centre + out, centre, picture_up, fov_y, width, height).axes
    rel = vertices - centre
    across, depth = np.stack([rel @ right, rel @ down]), rel @ forward
    slope = (1.0 - 2.0 * MARGIN) * np.tan(0.5 * np.radians(fov_y)) * np.array([width / height, 1.0])
    distance, shift = _fit_pyramid(across, depth, slope, 0.05 * radius)
    if projection == "perspective":
        target = centre + shift[0] * right + shift[1] * down
        return Camera(target + distance * out, target, picture_up, fov_y, width, height)
    extent, shift = _fit_box(across, width / height)
    target = centre + shift[0] * right + shift[1] * down
    return Camera(target + distance * out, target, picture_up, None, width, height, extent)


def up_axis(up: str) -> np.ndarray:
    """Find the axis of the world (3,) that an option "y" or "z" means. Raises ValueError."""
    if up not in ("y", "z"):
        raise ValueError(f"up must be y or z, got {up!r}")
    return np.array([0.0, 1.0, 0.0]) if up == "y" else np.array([0.0, 0.0, 1.0])


def _eye_direction(view: str, up: str) -> tuple[np.ndarray, np.ndarray]:
    """Find the unit vector (3,) from the shape to a view's eye, and the picture's up (3,).

    Up is the upright axis. Seen along that, it is where the axis pointed to just before: from above
    the front is at the bottom of the picture, from below at its top.
    """
    degrees = parse_view(view)
    (sine, cosine), (high, flat) = (_sine_and_cosine(angle) for angle in degrees)
    out, upright = np.array([flat * sine, high, flat * cosine]), up_axis("y")
    if flat < 1e-6:
        upright = -np.sign(high) * np.array([sine, 0.0, cosine])
    if up_axis(up)[1]:
        return out, upright
    return np.array([out[0], -out[2], out[1]]), np.array([upright[0], -upright[2], upright[1]])


def _sine_and_cosine(degrees: float) -> tuple[float, float]:
    """Work out sine and cosine of an angle, exactly 0 and +-1 at multiples of 90 degrees."""
    if degrees % 90.0 == 0.0:
        quarter = int(degrees // 90.0) % 4
        return (0.0, 1.0, 0.0, -1.0)[quarter], (1.0, 0.0, -1.0, 0.0)[quarter]
    return float(np.sin(np.radians(degrees))), float(np.cos(np.radians(degrees)))


def _fit_box(across: np.ndarray, aspect: float) -> tuple[float, np.ndarray]:
    """Find the height of the picture, world units, that holds places (2, V), and its middle (2,).

    `aspect` : width by height of the picture
    """
    low, high = across.min(axis=1), across.max(axis=1)
    span = (high - low) / np.array([aspect, 1.0])
    return max(float(span.max()), 1e-6) / (1.0 - 2.0 * MARGIN), 0.5 * (low + high)


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
    reach, shift = depth + distance, 0.5 * (high - low)
    # the looser axis is not yet centred in perspective; this contracts quickly
    for _ in range(STEPS_OF_ALL):
        shift = shift + _middle_seen(across, reach, shift) * distance
    aside = _middle_seen(across, reach, shift) * distance
    room, start = 2.0 * np.abs(aside) + TINY_MOVE, shift
    outer = _outermost(across, reach, start, room)
    some = across[:, outer], reach[outer]
    for _ in range(STEPS - STEPS_OF_ALL):
        shift = shift + aside
        if (np.abs(shift - start) > room).any():
            some = across, reach
        aside = _middle_seen(*some, shift) * distance
    return distance, shift


def _middle_seen(across: np.ndarray, reach: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Find the middle (2,) of what an eye moved aside by `shift` sees of places (2, V), at depth 1.

    `reach` : (V,), their depths from the eye
    """
    seen = (across - shift[:, None]) / reach
    return 0.5 * (seen.max(axis=1) + seen.min(axis=1))


def _outermost(
    across: np.ndarray, reach: np.ndarray, shift: np.ndarray, room: np.ndarray
) -> np.ndarray:
    """Find the places (n,) int that an eye within `room` (2,) of `shift` may see outermost.

    The others are as of `_middle_seen`.
    """
    outer = np.zeros(len(reach), bool)
    for place, middle, most in zip(across, shift, room, strict=True):
        near, far = (place - middle - most) / reach, (place - middle + most) / reach
        outer |= (far >= near.max()) | (near <= far.min())
    return np.flatnonzero(outer)


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
