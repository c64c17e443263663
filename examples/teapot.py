"""Martin Newell's teapot of 1975, from its Bezier control points; spout and handle are joined to the pot.

The 32 bicubic patches and their 306 control points are facts published in M. E. Newell, "The Utilization of
Procedure Models in Digital Image Synthesis", PhD thesis, University of Utah, 1975, with the bottom added since by
F. Crow, "The Origins of the Teapot", IEEE CG&A 7(1), 1987; the same numbers are in every graphics library. 24 of the
patches are turned: their control points are (r, 0), (r, 0.56 r), (0.56 r, r), (0, r) at heights z, quarter by quarter,
so that a row of numbers (r, z) stands for four patches. The other 8 are mirrored in y.
"""

from __future__ import annotations

import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]  # vertices (V, 3) float, faces (F, 3) int, counter-clockwise from outside

POT = [  # (r, z): rim, upper wall, lower wall, bottom; each curve starts where the one before ended
    [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
    [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
]
LID = [  # knob, lid
    [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
]
# One row of numbers for each row of control points (x0, 0, z0), (x0, -w, z0), (x1, -w, z1), (x1, 0, z1), from the end
# in the pot outwards: x0, z0, x1, z1, w. Patches share the row at which they meet.
HANDLE = [
    (-1.6, 2.025, -1.5, 2.25, 0.3),
    (-2.3, 2.025, -2.5, 2.25, 0.3),
    (-2.7, 2.025, -3.0, 2.25, 0.3),
    (-2.7, 1.8, -3.0, 1.8, 0.3),
    (-2.7, 1.575, -3.0, 1.35, 0.3),
    (-2.5, 1.125, -2.65, 0.9375, 0.3),
    (-2.0, 0.9, -1.9, 0.6, 0.3),
]
SPOUT = [
    (1.7, 1.425, 1.7, 0.6, 0.66),
    (2.6, 1.425, 3.1, 0.825, 0.66),
    (2.3, 2.1, 2.4, 2.025, 0.25),
    (2.7, 2.4, 3.3, 2.4, 0.25),
    (2.8, 2.475, 3.525, 2.49375, 0.25),
    (2.9, 2.475, 3.45, 2.5125, 0.15),
    (2.8, 2.4, 3.2, 2.4, 0.15),
]


def bernstein(t) -> np.ndarray:
    """The four cubic Bernstein polynomials at t (n,): (n, 4)."""
    s = 1.0 - t
    return np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=-1)


def quarter(n: int) -> np.ndarray:
    """Newell's circle of radius 1 (4n, 2), counter-clockwise: four cubics, out by at most 0.5 %."""
    arc = bernstein(np.arange(n) / n) @ np.array([(1.0, 0.0), (1.0, 0.56), (0.56, 1.0), (0.0, 1.0)])
    return np.concatenate([arc, np.stack([-arc[:, 1], arc[:, 0]], 1), -arc, np.stack([arc[:, 1], -arc[:, 0]], 1)])


def profile(curves, steps) -> np.ndarray:
    """The curves' points (n, 2), `steps` of them to a curve."""
    parts = [bernstein(np.arange(n) / n) @ np.array(c) for c, n in zip(curves, steps, strict=True)]
    return np.concatenate([*parts, [curves[-1][-1]]])


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles (2 (rows-1) columns, 3) of a grid of vertices whose rows are rings."""
    i, j = (v.ravel() for v in np.mgrid[: rows - 1, :columns])
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    even = ((i + j) % 2 == 0)[:, None]  # diagonals to and fro, for no lean
    first = np.where(even, np.stack([a, c, d], 1), np.stack([a, c, b], 1))
    second = np.where(even, np.stack([a, d, b], 1), np.stack([b, c, d], 1))
    return np.concatenate([first, second])


def turned(curves, steps, n: int) -> Mesh:
    """The profile turned about z, 4n points to a ring; faces look to the left of a profile that runs down."""
    r, z = profile(curves, steps).T
    ring = quarter(n)
    vertices = np.concatenate([r[:, None, None] * ring, np.broadcast_to(z[:, None, None], (len(r), 4 * n, 1))], 2)
    return weld((vertices.reshape(-1, 3), grid_faces(len(r), 4 * n)))


def weld(mesh: Mesh) -> Mesh:
    """One vertex for all at the same place, faces without area dropped, unused vertices too."""
    vertices, faces = mesh
    _, first, to = np.unique(np.round(vertices, 7), axis=0, return_index=True, return_inverse=True)
    faces = first[to.ravel()][faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def tube(rows, u, n: int) -> np.ndarray:
    """Points of handle or spout: u (m, 2n) in 0..2, one column a line along the tube; (m, 2n, 3)."""
    x0, z0, x1, z1, w = np.array(rows).T
    o = np.zeros(len(rows))
    net = np.stack([[x0, o, z0], [x0, -w, z0], [x1, -w, z1], [x1, o, z1]]).transpose(2, 0, 1)  # (7, 4, 3)
    across = bernstein(np.linspace(0.0, 1.0, n + 1))
    side = np.einsum("vj,ijc->ivc", across, net)  # (7, n+1, 3)
    net = np.concatenate([side, side[:, -2:0:-1] * (1, -1, 1)], axis=1)  # (7, 2n, 3)
    piece = (u >= 1.0).astype(int)
    b = bernstein(u - piece)
    return sum(b[..., k, None] * net[3 * piece + k, np.arange(2 * n)] for k in range(4))


def outside(points) -> np.ndarray:
    """How far points (..., 3) lie outside the pot's wall, along the radius."""
    wall = profile(POT[1:3], (400, 400))[::-1]
    circle = np.concatenate([quarter(200), [(1.0, 0.0)]])
    angle = np.unwrap(np.arctan2(circle[:, 1], circle[:, 0]))
    x, y, z = np.moveaxis(points, -1, 0)
    scale = np.interp(np.arctan2(y, x) % (2 * np.pi), angle, np.linalg.norm(circle, axis=1))
    return np.hypot(x, y) - scale * np.interp(z, wall[:, 1], wall[:, 0])


def meet(rows, n: int, inner: float, outer: float) -> np.ndarray:
    """Where each line of the tube meets the pot: u (2n,), between one in the pot and one outside it."""
    low, high = np.full((1, 2 * n), inner), np.full((1, 2 * n), outer)
    for _ in range(40):
        u = 0.5 * (low + high)
        inside = outside(tube(rows, u, n)) < 0.0
        low, high = np.where(inside, u, low), np.where(inside, high, u)
    return low[0]


def join(pot: Mesh, ring: np.ndarray, toward: float) -> Mesh:
    """Cut a hole into the pot on its side x > 0 or x < 0 (the sign of `toward`), sewn to the ring (n, 3): the ring's
    vertices come last, in order of the angle in the yz plane."""
    vertices, faces = pot
    centre = ring[:, 1:].mean(axis=0)

    def polar(p):
        y, z = (p[:, 1:] - centre).T
        return np.arctan2(z, y), np.hypot(y, z)

    angle, radius = polar(ring)
    order = np.argsort(angle)
    ring, angle, radius = ring[order], angle[order], radius[order]
    a, r = polar(vertices)
    near = (toward * vertices[:, 0] > 1.0) & (r < 1.05 * np.interp(a, angle, radius, period=2 * np.pi) + 0.03)
    cut = near[faces].any(axis=1)
    edges = np.stack([faces[cut], np.roll(faces[cut], -1, axis=1)], axis=2).reshape(-1, 2)
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    loop = edges[index[count == 1], 0]
    loop = loop[np.argsort(polar(vertices[loop])[0])]

    # Zip the two loops: the next triangle stands on the loop whose next point comes first by angle.
    loop_angle, n, m = polar(vertices[loop])[0], len(loop), len(ring)
    steps = np.argsort(np.concatenate([loop_angle, angle]), kind="stable")
    on_loop = steps < n
    at_loop = (np.cumsum(on_loop) - 1) % n
    at_ring = (np.cumsum(~on_loop) - 1) % m
    outer, inner = loop[at_loop], at_ring + len(vertices)
    before = np.where(on_loop, loop[(at_loop - 1) % n], (at_ring - 1) % m + len(vertices))
    sewn = np.stack([before, np.where(on_loop, outer, inner), np.where(on_loop, inner, outer)], axis=1)
    if toward < 0:
        sewn = sewn[:, ::-1]
    sewn[~on_loop] = sewn[~on_loop][:, ::-1]
    return np.concatenate([vertices, ring]), np.concatenate([faces[~cut], sewn])


def teapot() -> Mesh:
    """The teapot, y up, spout towards +x: pot with spout and handle in one piece, and its lid."""
    pot = turned(POT, (8, 18, 16, 9), 17)
    spout_n, handle_n = 14, 10
    pieces = []
    for rows, n, ends, steps in (
        (SPOUT, spout_n, [(0.0, 0.95)], 26),
        (HANDLE, handle_n, [(0.0, 0.9), (2.15, 1.5)], 40),
    ):
        u = [meet(rows, n, *end) for end in ends]
        start, stop = u[0], u[1] if len(u) > 1 else np.full(2 * n, 2.0)
        t = np.linspace(0.0, 1.0, steps + 1)[:, None]
        points = tube(rows, start + t * (stop - start), n)
        for end in range(len(u)):
            pot = join(pot, points[-end], 1.0 if rows is SPOUT else -1.0)
        pieces.append((points.reshape(-1, 3), grid_faces(steps + 1, 2 * n)))
    pieces += [pot, turned(LID, (14, 12), 17)]
    start = np.cumsum([0] + [len(v) for v, _ in pieces])
    vertices = np.concatenate([v for v, _ in pieces])
    faces = np.concatenate([f + s for (_, f), s in zip(pieces, start)])
    x, y, z = vertices.T
    return weld((np.stack([x, z, -y], axis=1), faces))
