"""Tell hollows and rooms: closed bodies wound the other way round than those in or around them."""

from __future__ import annotations

import numpy as np

from .surface import Surface
from .triangles import row_dot


def with_hollows(surface: Surface) -> tuple[Surface, np.ndarray, np.ndarray]:
    """Turn the hollows of bodies so that their normals point out of the solid, into the hollow.

    All closed components of a surface are wound outward, as most files mean it. Where a file winds
    one the other way round than the smallest that it lies in, as the inner skin of a thick wall is,
    it bounds a hollow of that. But where the file winds the outer one inward, that is a room, with
    things in it: a shell, and nothing solid.

    Returns
    -------
    the surface; the body (F,) of each face, its component or that which it is a hollow in; and
    whether it is of the shell of a room, (F,) bool
    """
    body = surface.component
    votes = np.bincount(body, np.where(surface.turned, 1.0, -1.0))
    closed, room = np.zeros(len(votes), bool), np.zeros(len(votes), bool)
    closed[body] = surface.closed_faces
    inward = votes > 0.0
    if len(np.unique(inward[closed])) < 2:
        return surface, body, room[body]
    turned, target = np.zeros(len(votes), bool), np.arange(len(votes))
    for a, b in _containers(surface, np.flatnonzero(closed), inward):  # from the outside in
        room[b] |= inward[b] and not turned[b]
        if not room[b]:
            turned[a], target[a] = not turned[b], target[b]
    faces = turned[body]
    whole = surface.turned_over(faces) if faces.any() else surface
    return whole, target[body], room[body]


def _containers(surface: Surface, closed: np.ndarray, inward: np.ndarray) -> list[tuple[int, int]]:
    """Pair closed components (M,) with the smallest that they lie in, where its winding differs.

    The largest come first.
    """
    corner = surface.vertices[surface.faces]
    order = np.argsort(surface.component, kind="stable")
    start = np.searchsorted(surface.component[order], np.arange(len(inward) + 1))
    faces = {int(c): order[start[c] : start[c + 1]] for c in closed}
    low = {c: corner[rows].min(axis=(0, 1)) for c, rows in faces.items()}
    high = {c: corner[rows].max(axis=(0, 1)) for c, rows in faces.items()}
    size = np.array([np.prod(high[c] - low[c]) for c in faces])
    names = closed[np.argsort(-size, kind="stable")]
    lows, highs = (np.array([box[int(c)] for c in names]) for box in (low, high))
    found = []
    for i, a in enumerate(names.tolist()):
        around = (lows[:i] <= lows[i]).all(axis=1) & (highs[:i] >= highs[i]).all(axis=1)
        outside = names[:i][around]
        if not (inward[outside] != inward[a]).any():
            continue
        point = corner[faces[a][0], 0]
        for b in outside[::-1].tolist():  # the smallest first
            if winds_round(corner[faces[b]], point):
                if inward[a] != inward[b]:
                    found.append((a, b))
                break
    return found


def winds_round(corner: np.ndarray, point: np.ndarray) -> bool:
    """Tell whether closed faces, with corners (M, 3, 3), wind round a point (3,).

    Solid angles after Van Oosterom and Strackee 1983.
    """
    a, b, c = (corner[:, i] - point for i in range(3))
    x, y, z = (np.sqrt(row_dot(p, p)) for p in (a, b, c))
    volume = row_dot(a, np.cross(b, c))
    rest = x * y * z + row_dot(a, b) * z + row_dot(b, c) * x + row_dot(c, a) * y
    return bool(abs(np.arctan2(volume, rest).sum()) > np.pi)
