"""Find where the pixels of a canvas see a surface, by one ray through the centre of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..mesh.surface import Surface
from ..mesh.triangles import bounds
from .camera import Camera
from .rays import Bvh

SIDE = 4  # px, the square of pixels whose rays are traced together


class PixelHits(NamedTuple):
    """Where the surface is seen, at P pixels, square by square.

    Parameters
    ----------
    pixel : (P,) int32, the number of each pixel of the canvas
    vertex : (n,) int, the vertices of all faces seen, ascending
    corner : (3, P) int32, rows of `vertex`: the corners of the face seen
    bary : (3, P) float32, their weights
    """

    pixel: np.ndarray
    vertex: np.ndarray
    corner: np.ndarray
    bary: np.ndarray


def first_faces(surface: Surface, camera: Camera, bvh: Bvh) -> PixelHits:
    """Find what the rays of pixels hit first.

    `camera` : its eye lies before all of the surface, in parallel projection
    """
    columns, rows = _window(surface, camera)
    x, y = _squares(columns, rows)
    found = bvh.first_faces(*_rays(camera, x, y))
    inside = (x < columns[1]) & (y < rows[1])  # squares reach over the canvas
    hit = np.flatnonzero((found.face >= 0) & inside.ravel())
    pixel = (y.astype(np.int32) * camera.width + x.astype(np.int32)).ravel().take(hit)
    vertex, corner = _corners(surface, found.face.take(hit))
    u, v = found.u.take(hit), found.v.take(hit)
    return PixelHits(pixel, vertex, corner, np.stack([1.0 - u - v, u, v]))


def _squares(columns: tuple[int, int], rows: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Number columns and rows of pixels in squares that cover a window, row by row of squares.

    Their shapes are (1, across, 1, SIDE) and (down, 1, SIDE, 1) int; together those of the pixels.
    """
    (left, right), (top, bottom) = columns, rows
    across, down = -(-(right - left) // SIDE), -(-(bottom - top) // SIDE)
    x, y = left + np.arange(across * SIDE), top + np.arange(down * SIDE)
    return x.reshape(1, across, 1, SIDE), y.reshape(down, 1, SIDE, 1)


def _rays(camera: Camera, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cast rays through the centres of pixels in columns x and rows y, of `_squares`.

    Rays are traced several at a time, and squares of them hit the same. Origins, and directions
    (squares, SIDE * SIDE, 3) float32 of no set length; origins are one for each, or in perspective
    one in all, the eye.
    """
    right, down, forward = camera.axes
    x, y = x + (0.5 - 0.5 * camera.width), y + (0.5 - 0.5 * camera.height)
    shape = (y.shape[0], x.shape[1], 3, SIDE, SIDE)  # in the order of embree's packets
    if camera.extent is None:
        rays = np.empty(shape, np.float32)
        for k in range(3):
            np.add(x * right[k], y * down[k] + camera.focal * forward[k], out=rays[:, :, k])
        return camera.eye, _rows(rays)
    origins = np.empty(shape)
    for k in range(3):
        across, along = x * right[k] / camera.focal, y * down[k] / camera.focal
        np.add(across, along + camera.eye[k], out=origins[:, :, k])
    origins = _rows(origins)
    return origins, np.broadcast_to(forward.astype(np.float32), origins.shape)


def _rows(packets: np.ndarray) -> np.ndarray:
    """View vectors (down, across, 3, SIDE, SIDE) as (squares, SIDE * SIDE, 3)."""
    return packets.reshape(-1, 3, SIDE * SIDE).swapaxes(1, 2)


def _window(surface: Surface, camera: Camera) -> tuple[tuple[int, int], tuple[int, int]]:
    """Bound the pixels whose rays can hit: first column and behind the last, rows alike."""
    size = np.array([camera.width, camera.height])
    xy, depth = camera.project(surface.vertices)
    if (
        camera.extent is None and depth.min() <= 1e-6
    ):  # some of it beside or behind the eye: its pixels mean nothing
        return (0, camera.width), (0, camera.height)
    low, high = bounds(xy)
    left, top = (int(v) for v in np.clip(np.floor(low) - 1, 0, size))
    right, bottom = (int(v) for v in np.clip(np.ceil(high) + 1, 0, size))
    return (left, right), (top, bottom)


def _corners(surface: Surface, face: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the vertices of faces (P,), and the corners of each, (3, P), as rows of that list."""
    corners = [surface.faces[:, i].take(face) for i in range(3)]
    seen = np.zeros(len(surface.vertices), bool)
    for corner in corners:
        seen[corner] = True
    vertex = np.flatnonzero(seen)
    number = np.empty(len(seen), np.int32)
    number[vertex] = np.arange(len(vertex), dtype=np.int32)
    return vertex, np.stack([number.take(corner) for corner in corners])
