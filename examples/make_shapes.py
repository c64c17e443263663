"""Make the shapes of `examples/shapes/` from nothing: `python examples/make_shapes.py [NAME ...]`.

    elephant   a young elephant: ellipsoids, tubes and flaps, blended and polygonised
    hand       an open hand, from the same parts
    bracket    a mechanical bracket: exact distances, sharp edges, fillets, round holes
    teapot     Martin Newell's teapot of 1975, from its Bezier control points
    cloth      a square cloth let fall over a ball, simulated (an open surface)

Every shape is y up and faces +z or thereabouts. Numpy only, no randomness: the same script writes
the same bytes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

Field = Callable[
    [np.ndarray], np.ndarray
]  # points (N, 3) -> signed distance or nearly (N,), negative inside
Mesh = tuple[
    np.ndarray, np.ndarray
]  # vertices (V, 3) float, faces (F, 3) int, counter-clockwise from outside


# ---------------------------------------------------------------------------------------- distances


def ellipsoid(p, centre, radii, turn=None):
    """Nearly the distance to an ellipsoid (or ellipse); `turn` (3, 3) takes world directions to its
    axes."""
    q = p - centre
    if turn is not None:
        q = q @ turn.T
    radii = np.asarray(radii, float)
    k0, k1 = np.linalg.norm(q / radii, axis=1), np.linalg.norm(q / radii**2, axis=1)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-12)


def spline(points) -> np.ndarray:
    """The natural cubic spline through the points (n, d): coefficients (n-1, 4, d) of 1, t, t^2,
    t^3."""
    points = np.asarray(points, float)
    n = len(points)
    a = 4.0 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)
    a[0, 0] = a[-1, -1] = 2.0
    ends = np.clip(np.arange(n)[:, None] + [-1, 1], 0, n - 1)
    slope = np.linalg.solve(a, 3.0 * (points[ends[:, 1]] - points[ends[:, 0]]))
    step = np.diff(points, axis=0)
    return np.stack(
        [
            points[:-1],
            slope[:-1],
            3 * step - 2 * slope[:-1] - slope[1:],
            slope[:-1] + slope[1:] - 2 * step,
        ],
        axis=1,
    )


def tube(p, points, radii):
    """A round rod along the smooth curve through the points, its radius passing smoothly through
    the radii."""
    c = spline(np.column_stack([points, radii]))
    t = np.linspace(0.0, len(c), 6 * len(c) + 1)
    trial = at(c, t)[0][:, :3]
    t = t[np.argmin((trial**2).sum(1) - 2.0 * p @ trial.T, axis=1)]
    low, high = np.maximum(t - 1 / 6, 0.0), np.minimum(t + 1 / 6, len(c))
    for _ in range(3):  # the nearest point of the curve
        x, dx, ddx = (v[:, :3] for v in at(c, t))
        off = x - p
        slope, bend = (off * dx).sum(1), (dx * dx).sum(1)
        t = np.clip(t - slope / np.maximum(bend + (off * ddx).sum(1), 0.3 * bend), low, high)
    x = at(c, t)[0]
    return np.linalg.norm(p - x[:, :3], axis=1) - x[:, 3]


def at(c, t):
    """The spline `c` (n, 4, d) at t in 0..n: values and two derivatives, each (N, d)."""
    piece = np.minimum(t.astype(int), len(c) - 1)
    t = (t - piece)[:, None]
    a, b, c, d = np.moveaxis(c[piece], 1, 0)
    return a + t * (b + t * (c + t * d)), b + t * (2 * c + t * 3 * d), 2 * c + t * 6 * d


def near(p, centre, radius, part: Field):
    """`part`, worked out only in a ball that holds it; outside, the distance to the ball, which is
    less."""
    far = np.linalg.norm(p - centre, axis=1) - radius
    out = far + 0.08
    inside = far < 0.0
    out[inside] = part(p[inside])
    return out


def blend(*distances, k):
    """Smooth union: a cubic in the band |a - b| < k, so that curvature stays continuous."""
    out = distances[0]
    for d in distances[1:]:
        h = np.maximum(k - np.abs(out - d), 0.0) / k
        out = np.minimum(out, d) - h**3 * (k / 6.0)
    return out


def carve(d, tool, k):
    """Smooth difference: `d` without `tool`."""
    return -blend(-d, tool, k=k)


def turn(axis: str, degrees: float) -> np.ndarray:
    """World directions -> the axes of a thing turned by that much about x, y or z (3, 3)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    m = np.eye(3)
    m[i, i], m[i, j], m[j, i], m[j, j] = c, s, -s, c
    return m


# ----------------------------------------------------------------------------------------- polygons


def normal(f: Field, p: np.ndarray, step=1e-5) -> tuple[np.ndarray, np.ndarray]:
    """Values (N,) and gradients (N, 3)."""
    value = f(p)
    return value, np.stack([f(p + e) - value for e in step * np.eye(3)], axis=1) / step


def project(f: Field, p: np.ndarray, steps=3) -> np.ndarray:
    """Newton steps onto the surface f = 0."""
    for _ in range(steps):
        value, g = normal(f, p)
        p = p - (value / np.maximum((g * g).sum(1), 0.1))[:, None] * g
    return p


def sample(f: Field, low, high, h) -> tuple[np.ndarray, np.ndarray]:
    """Values on a grid of spacing h; away from the surface only the sign is right. Returns values,
    origin."""
    shape = 4 * np.ceil((np.asarray(high, float) - low) / (4 * h)).astype(int)
    corners = np.indices(shape // 4).reshape(3, -1).T * 4
    coarse = f(low + h * (corners + 1.5))
    values = coarse.reshape(shape // 4).repeat(4, 0).repeat(4, 1).repeat(4, 2)
    near = np.abs(values) < 6 * h
    values[near] = f(low + h * np.argwhere(near))
    return settle(values), np.asarray(low, float)


def settle(values) -> np.ndarray:
    """Change signs next to the surface until no face of the grid has + - + - round it, where meshes
    would pinch."""
    while True:
        doubtful = []
        inside = values < 0
        for i, j in ((0, 1), (1, 2), (2, 0)):
            a, c = inside, np.roll(inside, (-1, -1), (i, j))
            b, d = np.roll(inside, -1, i), np.roll(inside, -1, j)
            for corner in np.argwhere((a == c) & (b == d) & (a != b)):
                e = np.eye(3, dtype=int)
                doubtful.append(corner + np.stack([0 * e[i], e[i], e[j], e[i] + e[j]]))
        if not doubtful:
            return values
        doubtful = np.array(doubtful)
        least = np.abs(values[tuple(np.moveaxis(doubtful, 2, 0))]).argmin(axis=1)
        flip = np.unique(doubtful[np.arange(len(doubtful)), least], axis=0)
        values[tuple(flip.T)] = -1e-3 * np.sign(values[tuple(flip.T)] + 1e-300)


def surface_nets(f: Field, low, high, h, sharp=False) -> Mesh:
    """The surface f = 0 in the box, by dual polygons: a vertex in every cell of the grid that the
    surface crosses, a quad round every grid edge that it crosses, cut along the diagonal that lies
    nearer to the surface.

    With `sharp`, vertices look for the edges and corners of the surface.
    """
    values, origin = sample(f, low, high, h)
    crossings, quads = [], []
    for axis in range(3):
        along, u, v = np.roll(np.eye(3, dtype=int), -axis, axis=0)
        start, end = (
            np.take(values, r, axis)
            for r in (range(values.shape[axis] - 1), range(1, values.shape[axis]))
        )
        at = np.argwhere((start < 0) != (end < 0))
        a, b = start[tuple(at.T)], end[tuple(at.T)]
        crossings.append(origin + h * (at + (a / (a - b))[:, None] * along))
        cells = np.stack(
            [at, at - u, at - u - v, at - v], axis=1
        )  # counter-clockwise about the axis
        cells[b < a] = cells[b < a][:, ::-1]
        quads.append(
            np.ravel_multi_index(tuple(cells.reshape(-1, 3).T), values.shape).reshape(-1, 4)
        )
    quads = np.unique(np.concatenate(quads), return_inverse=True)[1].reshape(-1, 4)
    points = np.concatenate(crossings)
    if sharp:
        vertices = sharpen(f, points, quads, h)
    else:
        vertices = np.stack([np.bincount(quads.ravel(), c.repeat(4)) for c in points.T], axis=1)
        vertices = project(f, vertices / np.bincount(quads.ravel())[:, None])
    return vertices, cut_quads(f, vertices, quads)


def sharpen(f: Field, points, quads, h) -> np.ndarray:
    """Vertices (V, 3) on the surface, and on its edges and corners in the cells that hold one (dual
    contouring).

    `points` (Q, 3) are where the grid edge of each quad meets the surface. A vertex goes where the
    planes there meet, then slides towards the mean of its neighbours in what directions the planes
    leave open: two, one on an edge, none in a corner."""
    around = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    around = (
        0.15 * h * around * [1.0, 0.87, 0.93]
    )  # no cube: its corners would fall between two faces
    count = np.bincount(quads.ravel())

    def total(v):
        return np.stack([np.bincount(quads.ravel(), c.repeat(4)) for c in v.T], axis=1)

    vertices = total(points) / count[:, None]
    n = normal(f, points)[1]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    height = (n * points).sum(1)
    square = total((n[:, :, None] * n[:, None]).reshape(-1, 9)).reshape(-1, 3, 3)
    pull = total(height[:, None] * n) - np.einsum("vij,vj->vi", square, vertices)
    vertices = vertices + meet(square, pull)[0]
    for step in range(24):
        reach = (
            2.0 if step == 0 else 1.0
        )  # the first look takes in edges that pass a cell between its grid edges
        seen = (vertices[:, None] + reach * around).reshape(-1, 3)
        value, n = normal(f, seen)
        n = (n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-9)).reshape(
            -1, len(around), 3
        )
        offset = value.reshape(-1, len(around)) - reach * (n * around).sum(
            2
        )  # n.x + offset = 0 for x from the vertex
        move, free = meet(np.einsum("vai,vaj->vij", n, n), np.einsum("vai,va->vi", n, -offset))
        dimension = np.round(np.trace(free, axis1=1, axis2=2))
        slide = 0.5 * (neighbours_mean(quads, vertices, dimension) - vertices)
        vertices = vertices + move + (np.einsum("vij,vj->vi", free, slide) if step < 20 else 0.0)
    return vertices


def meet(square, pull) -> tuple[np.ndarray, np.ndarray]:
    """The least x (V, 3) with square x = pull, and the projection (V, 3, 3) onto what the squares
    leave open."""
    size, way = np.linalg.eigh(square)
    held = size > 0.08 * size[:, 2:]
    inverse = np.where(held, 1.0 / np.maximum(size, 1e-12), 0.0)
    x = np.einsum("vij,vj,vkj,vk->vi", way, inverse, way, pull)
    return x, np.einsum("vij,vj,vkj->vik", way, ~held, way)


def cut_quads(f: Field, vertices, quads) -> np.ndarray:
    """Quads (Q, 4) -> triangles (2Q, 3), along the diagonal nearer to the surface that leaves fair
    triangles."""
    cost = []
    for i in (0, 1):
        a, b, c, d = (vertices[quads[:, (i + k) % 4]] for k in range(4))
        length = np.linalg.norm(c - a, axis=1)
        area = np.minimum(*(np.linalg.norm(np.cross(c - a, x - a), axis=1) for x in (b, d)))
        height = area / np.maximum(length, 1e-12)
        away = np.abs(f(0.5 * (a + c)))
        cost.append(away + 0.02 * length + np.maximum(0.3 * length - height, 0.0))
    quads = np.where((cost[1] < cost[0])[:, None], np.roll(quads, -1, axis=1), quads)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def weld(mesh: Mesh, length: float) -> Mesh:
    """Collapse the edges that are shorter than `length`, and drop what has no area left."""
    vertices, faces = mesh
    i, j = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    near = np.linalg.norm(vertices[i] - vertices[j], axis=1) < length
    to = np.arange(len(vertices))
    for a, b in zip(i[near], j[near], strict=True):
        to[to == max(to[a], to[b])] = min(to[a], to[b])
    faces = to[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def neighbours_mean(faces, vertices, dimension=None) -> np.ndarray:
    """The mean of each vertex's neighbours (V, 3), on a closed mesh; for a vertex on an edge, of
    those on edges."""
    i, j = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    if dimension is not None:
        keep = (dimension[i] > 1) | (dimension[j] <= 1)
        i, j = i[keep], j[keep]
    total = np.stack([np.bincount(i, vertices[j, k], len(vertices)) for k in range(3)], axis=1)
    count = np.bincount(i, minlength=len(vertices))[:, None]
    return np.where(count > 0, total / np.maximum(count, 1), vertices)


def relax(f: Field, mesh: Mesh, steps=8) -> Mesh:
    """Even out the triangles: vertices slide along the surface towards the mean of their
    neighbours."""
    vertices, faces = mesh
    for _ in range(steps):
        value, g = normal(f, vertices)
        g /= np.maximum(np.linalg.norm(g, axis=1, keepdims=True), 1e-9)
        move = 0.5 * (neighbours_mean(faces, vertices) - vertices)
        vertices = vertices + move - ((move * g).sum(1) + value)[:, None] * g
    return project(f, vertices, 2), faces


def refine(f: Field, mesh: Mesh, degrees: float, least: float) -> Mesh:
    """Halve every edge along which the surface turns by more than that, unless it is shorter than
    `least`."""
    vertices, faces = mesh
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, edge_of = np.unique(pairs, axis=0, return_inverse=True)
    edge_of = edge_of.reshape(-1, 3)
    g = normal(f, vertices)[1]
    g /= np.maximum(np.linalg.norm(g, axis=1, keepdims=True), 1e-9)
    bent = (g[edges[:, 0]] * g[edges[:, 1]]).sum(1) < np.cos(np.radians(degrees))
    long = bent & (np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1) > least)
    new = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)[
        edge_of
    ]  # (F, 3), the vertex on each edge, or -1
    vertices = np.concatenate([vertices, project(f, vertices[edges[long]].mean(axis=1))])
    count = (new >= 0).sum(axis=1)
    out = [faces[count == 0]]
    first = np.where(count == 1, (new >= 0).argmax(1), (np.argmin(new >= 0, axis=1) + 1) % 3)
    roll = (first[:, None] + np.arange(3)) % 3  # one: the cut edge first; two: the uncut edge last
    faces, new = np.take_along_axis(faces, roll, 1), np.take_along_axis(new, roll, 1)
    (a, b, c), (ab, bc, ca) = faces[count == 1].T, new[count == 1].T
    out += [np.stack([a, ab, c], 1), np.stack([ab, b, c], 1)]
    (a, b, c), (ab, bc, ca) = faces[count == 2].T, new[count == 2].T
    out += [np.stack([ab, b, bc], 1), np.stack([a, ab, bc], 1), np.stack([a, bc, c], 1)]
    (a, b, c), (ab, bc, ca) = faces[count == 3].T, new[count == 3].T
    out += [
        np.stack([a, ab, ca], 1),
        np.stack([ab, b, bc], 1),
        np.stack([ca, bc, c], 1),
        np.stack([ab, bc, ca], 1),
    ]
    return vertices, np.concatenate(out)


def polygonise(f: Field, low, high, h, degrees=30.0) -> Mesh:
    """The smooth surface f = 0 in the box: triangles of size h, smaller where the surface turns
    quickly."""
    mesh = relax(f, even_valence(surface_nets(f, low, high, h)), 4)
    for least in (0.5 * h, 0.3 * h):
        mesh = relax(f, even_valence(refine(f, mesh, degrees, least)), 3)
    return relax(f, even_valence(mesh), 4)


def even_valence(mesh: Mesh, rounds=4) -> Mesh:
    """Flip edges where that brings the valences of the four vertices round it nearer to six."""
    vertices, faces = mesh
    for _ in range(rounds):
        a, b, c, d, twin = corners(faces)
        valence = np.bincount(faces.ravel(), minlength=len(vertices))
        before = sum(np.abs(valence[x] - 6) for x in (a, b, c, d))
        after = sum(np.abs(valence[x] + s - 6) for x, s in ((a, -1), (b, -1), (c, 1), (d, 1)))
        cross = np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])
        area = np.linalg.norm(cross, axis=1)
        flat = (cross * cross[twin]).sum(1) > 0.9 * area * area[twin]
        across = vertices[d] - vertices[c]
        two = np.stack(
            [
                np.cross(vertices[a] - vertices[c], across),
                np.cross(across, vertices[b] - vertices[c]),
            ]
        )
        convex = ((two * cross).sum(2) > 0.1 * (cross * cross).sum(1)).all(axis=0)
        faces = flip(faces, np.where(flat & convex, before - after, 0.0))
    return vertices, faces


def open_needles(f: Field, mesh: Mesh, degrees=8.0, rounds=6) -> Mesh:
    """Flip edges to open the triangles whose least angle is below that, where the new edge stays on
    the surface."""
    vertices, faces = mesh

    def least(i, j, k):
        x, y, z = (vertices[n] for n in (i, j, k))
        u, v, w = (
            e / np.maximum(np.linalg.norm(e, axis=1, keepdims=True), 1e-12)
            for e in (y - x, z - y, x - z)
        )
        return np.degrees(
            np.arccos(np.clip(-np.stack([u * v, v * w, w * u]).sum(2), -1.0, 1.0))
        ).min(axis=0)

    for _ in range(rounds):
        a, b, c, d, _ = corners(faces)
        before = np.minimum(least(a, b, c), least(b, a, d))
        after = np.minimum(least(c, d, b), least(d, c, a))
        away = np.abs(f(0.5 * (vertices[c] + vertices[d]))) / np.linalg.norm(
            vertices[c] - vertices[d], axis=1
        )
        wish = (before < degrees) & (after > 1.5 * before) & (away < 0.05)
        faces = flip(faces, np.where(wish, after - before, 0.0))
    return vertices, faces


def corners(faces) -> tuple:
    """For every half-edge a -> b (3F,): a, b, the corner c opposite it, the corner d across it, and
    its twin b -> a."""
    a, b, c = faces.ravel(), np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    size = faces.max() + 1
    order = np.argsort(a * size + b)
    twin = order[np.searchsorted((a * size + b)[order], b * size + a)]
    return a, b, c, c[twin], twin


def flip(faces, gain) -> np.ndarray:
    """Turn the edges a-b with a positive `gain` (3F,) into c-d, best first, no two that share a
    vertex."""
    a, b, c, d, twin = corners(faces)
    size = faces.max() + 1
    known = np.isin(np.minimum(c, d) * size + np.maximum(c, d), (a * size + b)[a < b])
    wish = np.flatnonzero((gain > 0.0) & (a < b) & ~known)
    wish = wish[np.argsort(-gain[wish], kind="stable")]
    best = np.full(size, len(wish))
    for x in (a, b, c, d):
        np.minimum.at(best, x[wish], np.arange(len(wish)))
    go = wish[(np.stack([best[x[wish]] for x in (a, b, c, d)]) == np.arange(len(wish))).all(axis=0)]
    faces = faces.copy()
    faces[go // 3] = np.stack([c[go], d[go], b[go]], axis=1)
    faces[twin[go] // 3] = np.stack([d[go], c[go], a[go]], axis=1)
    return faces


# --------------------------------------------------------------------------------------- the shapes


def sides(p):
    """Points folded onto the +x side, for what comes in pairs."""
    return np.abs(p * [1.0, 0.0, 0.0]) + p * [0.0, 1.0, 1.0]


def elephant() -> Mesh:
    """A young elephant walking towards +z, its head turned a little, its trunk up."""
    nod = turn("y", -24) @ turn("x", -4)
    neck, size = np.array([0.0, 0.72, 0.25]), 1.12

    path = np.array(
        [
            (0, 0.06, 0.22),
            (0, -0.01, 0.34),
            (0, -0.12, 0.42),
            (0, -0.25, 0.475),
            (0, -0.35, 0.55),
            (0, -0.37, 0.66),
            (0, -0.29, 0.74),
            (0, -0.18, 0.74),
            (0, -0.10, 0.70),
        ]
    )  # of the trunk
    girth = np.array([0.115, 0.105, 0.088, 0.074, 0.063, 0.056, 0.05, 0.046, 0.046])
    folds = []  # across the front of the trunk
    for t, wide in ((1.55, 48), (2.05, 62), (2.55, 50), (3.05, 66), (3.6, 52)):
        (x, y, z, r), (_, dy, dz, _) = (
            v[0] for v in at(spline(np.column_stack([path, girth])), np.array([t]))[:2]
        )
        front = np.array([0.0, dz, -dy]) / np.hypot(dy, dz)
        a = np.radians(np.linspace(-wide, wide, 7) + 14 * np.sin(9 * t))[:, None]
        folds.append([x, y, z] + (r + 0.003) * (np.cos(a) * front + np.sin(a) * [1.0, 0.0, 0.0]))

    eye, out, up = (
        np.array([0.162, 0.074, 0.238]),
        np.array([0.80, 0.10, 0.59]),
        np.array([-0.08, 1.0, -0.06]),
    )
    a = np.radians(np.linspace(15, 150, 7))[:, None]
    brow = eye - 0.004 * out + 0.054 * (np.cos(a) * np.cross(up, out) + np.sin(a) * up)

    def groove(p, line, r):
        return near(p, line.mean(axis=0), 0.18, lambda q: tube(q, line, np.full(len(line), r)))

    def head(p):  # in the head's own frame: the neck at the origin, z forward
        s = sides(p)
        skull = blend(
            ellipsoid(p, [0.0, 0.08, 0.12], [0.185, 0.20, 0.19]),
            ellipsoid(s, [0.06, 0.17, 0.13], [0.105, 0.11, 0.13]),
            ellipsoid(s, [0.09, -0.03, 0.17], [0.085, 0.10, 0.11]),
            k=0.08,
        )
        lip = ellipsoid(p, [0.0, -0.14, 0.24], [0.062, 0.05, 0.12], turn("x", 32))
        trunk = tube(p, path, girth)
        for fold in folds:
            trunk = carve(trunk, groove(p, fold, 0.011), k=0.012)
        q = (s - [0.15, 0.10, 0.03]) @ (turn("y", 20) @ turn("z", -10)).T
        q = q + np.array([0.0, 0.0, 1.0]) * (
            0.5 * q[:, 1:2] ** 2 - 0.9 * (q[:, :1] - 0.06) ** 2
        )  # hollow in front
        outline = blend(
            ellipsoid(q[:, :2], [0.14, 0.04], [0.16, 0.165]),
            ellipsoid(q[:, :2], [0.11, -0.13], [0.085, 0.12]),
            k=0.08,
        )
        ear = np.hypot(np.maximum(outline + 0.03, 0.0), q[:, 2]) - 0.027
        out = blend(skull, lip, k=0.07)
        out = blend(out, trunk, k=0.09)
        out = blend(out, ear, k=0.035)
        out = carve(out, groove(s, brow, 0.019), k=0.012)
        return blend(out, ellipsoid(s, eye, [0.027, 0.027, 0.027]), k=0.006)

    def f(p):
        s = sides(p)
        body = blend(
            ellipsoid(p, [0.0, 0.60, -0.06], [0.255, 0.265, 0.36]),
            ellipsoid(p, [0.0, 0.64, -0.22], [0.225, 0.235, 0.22]),
            ellipsoid(s, [0.05, 0.67, 0.14], [0.165, 0.215, 0.17]),
            k=0.14,
        )
        legs = []
        for x, z, lift, swing in (
            (-0.14, 0.16, 0.0, 0.07),
            (0.14, 0.16, 0.05, -0.05),
            (-0.14, -0.27, 0.0, -0.08),
            (0.14, -0.26, 0.0, 0.08),
        ):
            foot = np.array([1.04 * x, lift, z + swing])
            top, knee = (
                np.array([0.9 * x, 0.50, z]),
                np.array([1.03 * x, 0.27 + lift, z + 0.5 * swing + 0.015]),
            )
            leg = tube(
                p,
                [top, knee, foot + [0, 0.11, 0], foot + [0, 0.02, 0]],
                [0.14, 0.108, 0.095, 0.106],
            )
            leg = carve(leg, p[:, 1] - foot[1], k=0.03)  # a flat sole
            toes = [
                ellipsoid(p, foot + [0.1 * np.sin(a), 0.036, 0.1 * np.cos(a)], [0.03, 0.034, 0.022])
                for a in np.radians([-48, 0, 48])
            ]
            legs.append(blend(leg, *toes, k=0.006))
        tail = tube(
            p,
            [
                (0, 0.72, -0.40),
                (-0.01, 0.70, -0.50),
                (-0.03, 0.60, -0.575),
                (-0.06, 0.48, -0.60),
                (-0.08, 0.42, -0.625),
            ],
            [0.045, 0.03, 0.022, 0.018, 0.016],
        )
        tuft = tube(
            p,
            [(-0.075, 0.44, -0.615), (-0.10, 0.37, -0.655), (-0.11, 0.29, -0.71)],
            [0.014, 0.04, 0.008],
        )
        out = blend(body, legs[0], legs[1], k=0.07)
        out = blend(out, legs[2], legs[3], k=0.07)
        out = blend(out, blend(tail, tuft, k=0.015), k=0.04)
        return blend(
            out, size * near((p - neck) @ nod.T / size, [0.0, 0.0, 0.3], 0.72, head), k=0.06
        )

    vertices, faces = polygonise(f, [-0.75, -0.03, -0.78], [0.75, 1.2, 1.25], 0.025, degrees=25)
    return vertices @ turn("y", 28), faces


def hand() -> Mesh:
    """A right hand held up, its palm to the front, the fingers a little spread and bent."""

    def f(p):
        palm = blend(
            ellipsoid(p, [-0.02, 0.02, 0.0], [0.20, 0.25, 0.075], turn("z", 4)),
            ellipsoid(
                p, [0.095, -0.06, 0.03], [0.085, 0.155, 0.065], turn("z", 20)
            ),  # the ball of the thumb
            ellipsoid(p, [-0.115, -0.05, 0.025], [0.07, 0.17, 0.058]),
            ellipsoid(
                p, [0.0, 0.17, 0.02], [0.185, 0.06, 0.055], turn("z", 6)
            ),  # the pads below the fingers
            k=0.07,
        )
        wrist = tube(
            p,
            [(0.0, -0.10, -0.01), (0.0, -0.28, -0.02), (-0.01, -0.50, -0.03)],
            [0.105, 0.092, 0.098],
        )
        out = blend(
            palm,
            blend(wrist, ellipsoid(p, [0.0, -0.27, -0.02], [0.135, 0.22, 0.075]), k=0.08),
            k=0.14,
        )
        fingers = []
        for root, lean, curl, length, r in (
            ((0.135, 0.20), 9.0, 24.0, 0.36, 0.051),
            ((0.045, 0.235), 1.0, 18.0, 0.40, 0.053),
            ((-0.050, 0.225), -6.0, 30.0, 0.37, 0.050),
            ((-0.140, 0.175), -17.0, 36.0, 0.30, 0.044),
        ):
            x = np.array([root[0], root[1] - 0.06, 0.0])
            points, way = [x], np.array([np.sin(np.radians(lean)), np.cos(np.radians(lean))])
            for joint, part in enumerate((0.06, 0.40 * length, 0.33 * length, 0.27 * length)):
                a = np.radians(curl * (0.0, 0.25, 1.0, 1.7)[joint])
                x = x + part * np.array([way[0] * np.cos(a), way[1] * np.cos(a), np.sin(a)])
                points.append(x)
            fingers.append(tube(p, points, r * np.array([1.0, 1.06, 1.0, 0.92, 0.78])))
        thumb = tube(
            p,
            [
                (0.07, -0.15, 0.03),
                (0.17, -0.03, 0.055),
                (0.262, 0.075, 0.075),
                (0.318, 0.175, 0.075),
            ],
            [0.06, 0.064, 0.056, 0.043],
        )
        out = blend(out, thumb, k=0.05)
        web = fingers[0]
        for finger in fingers[1:]:
            web = blend(web, finger, k=0.012)
        return carve(blend(out, web, k=0.035), p[:, 1] + 0.46, k=0.02)  # cut off at the wrist

    vertices, faces = polygonise(f, [-0.40, -0.52, -0.2], [0.45, 0.72, 0.42], 0.0145, degrees=40)
    return vertices @ turn("y", -12), faces


def bracket() -> Mesh:
    """A cast bracket: base with bolt holes and a slot, upright with a bored boss, two ribs, fillets
    between them."""

    def rectangle(a, b, half, r):
        q = np.stack([np.abs(a) - half[0] + r, np.abs(b) - half[1] + r])
        return np.minimum(q.max(axis=0), 0.0) + np.hypot(*np.maximum(q, 0.0)) - r

    def slot(a, b, reach, r):  # a stadium along a
        return np.hypot(np.maximum(np.abs(a) - reach, 0.0), b) - r

    def fillet(a, b, r):  # union with a circular fillet of radius r
        return np.maximum(np.minimum(a, b), r) - np.hypot(
            np.maximum(r - a, 0.0), np.maximum(r - b, 0.0)
        )

    def f(p):
        x, y, z = p.T
        bore = np.hypot(x, y - 0.53)
        base = np.maximum(rectangle(x, z - 0.05, (0.6, 0.4), 0.13), y - 0.10)
        upright = np.maximum(np.hypot(x, np.maximum(y - 0.53, 0.0)) - 0.30, z + 0.24)
        upright = np.where(y < 0.53, np.maximum(np.abs(x) - 0.30, z + 0.24), upright)
        boss = np.maximum(bore - 0.20, z + 0.12)
        slope = (0.46 * (y - 0.10) + 0.28 * (z + 0.24) - 0.46 * 0.28) / np.hypot(0.46, 0.28)
        ribs = np.maximum(np.maximum(np.abs(np.abs(x) - 0.19) - 0.04, slope), -0.32 - z)
        out = fillet(fillet(fillet(base, upright, 0.07), ribs, 0.045), boss, 0.045)
        out = np.maximum(out, np.maximum(-0.35 - z, -y))  # flat at the back and below
        holes = np.minimum(
            bore - 0.115, np.maximum((bore - 0.115 - z - 0.145) * np.sqrt(0.5), z + 0.10)
        )  # chamfered
        bolt = np.hypot(np.abs(x) - 0.45, z - 0.17)
        holes = np.minimum(
            holes, np.minimum(bolt - 0.055, np.maximum(bolt - 0.095, 0.07 - y))
        )  # counterbored
        return np.maximum(out, -np.minimum(holes, slot(x, z - 0.30, 0.10, 0.045)))

    mesh = surface_nets(f, [-0.6513, -0.0531, -0.3987], [0.65, 0.9, 0.50], 0.0197, sharp=True)
    return open_needles(f, weld(mesh, 0.005))


def teapot() -> Mesh:
    """Martin Newell's teapot in Blinn's proportions.

    The numbers are those of his control points as they have been passed on since 1975 (M. E.
    Newell, The Utilization of Procedure Models in Digital Image Synthesis, Ph.D. thesis, University
    of Utah; GLUT's and S. J. Baker's listings agree). Rim, body, lid and bottom repeat one quarter
    four times; handle and spout are halves and mirror images. Two liberties: the lid is widened by
    1.4/1.3 so that it closes the pot, and handle and spout begin where they leave the body."""
    fit = 1.4 / 1.3
    # per cubic: radius, height of four control points, from the knob's top to the middle of the
    # bottom
    profile = [
        [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
        [(0.2, 2.7), (0.4 * fit, 2.55), (1.3 * fit, 2.55), (1.3 * fit, 2.4)],
        [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
        [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
        [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
        [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
    ]
    handle = [  # rows of half a tube: x, y, z of four control points
        [
            [(-1.6, 0, 2.025), (-1.6, -0.3, 2.025), (-1.5, -0.3, 2.25), (-1.5, 0, 2.25)],
            [(-2.3, 0, 2.025), (-2.3, -0.3, 2.025), (-2.5, -0.3, 2.25), (-2.5, 0, 2.25)],
            [(-2.7, 0, 2.025), (-2.7, -0.3, 2.025), (-3.0, -0.3, 2.25), (-3.0, 0, 2.25)],
            [(-2.7, 0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0, 1.8)],
        ],
        [
            [(-2.7, 0, 1.8), (-2.7, -0.3, 1.8), (-3.0, -0.3, 1.8), (-3.0, 0, 1.8)],
            [(-2.7, 0, 1.575), (-2.7, -0.3, 1.575), (-3.0, -0.3, 1.35), (-3.0, 0, 1.35)],
            [(-2.5, 0, 1.125), (-2.5, -0.3, 1.125), (-2.65, -0.3, 0.9375), (-2.65, 0, 0.9375)],
            [(-2.0, 0, 0.9), (-2.0, -0.3, 0.9), (-1.9, -0.3, 0.6), (-1.9, 0, 0.6)],
        ],
    ]
    spout = [
        [
            [(1.7, 0, 1.425), (1.7, -0.66, 1.425), (1.7, -0.66, 0.6), (1.7, 0, 0.6)],
            [(2.6, 0, 1.425), (2.6, -0.66, 1.425), (3.1, -0.66, 0.825), (3.1, 0, 0.825)],
            [(2.3, 0, 2.1), (2.3, -0.25, 2.1), (2.4, -0.25, 2.025), (2.4, 0, 2.025)],
            [(2.7, 0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0, 2.4)],
        ],
        [
            [(2.7, 0, 2.4), (2.7, -0.25, 2.4), (3.3, -0.25, 2.4), (3.3, 0, 2.4)],
            [(2.8, 0, 2.475), (2.8, -0.25, 2.475), (3.525, -0.25, 2.49375), (3.525, 0, 2.49375)],
            [(2.9, 0, 2.475), (2.9, -0.15, 2.475), (3.45, -0.15, 2.5125), (3.45, 0, 2.5125)],
            [(2.8, 0, 2.4), (2.8, -0.15, 2.4), (3.2, -0.15, 2.4), (3.2, 0, 2.4)],
        ],
    ]
    profile = np.array(profile)

    def bernstein(t):
        t = np.asarray(t, float)[..., None]
        return np.concatenate(
            [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=-1
        )

    def arc(
        turns,
    ):  # the quarter of a circle as the control points draw it: radius 1 only at its ends
        quarter, t = np.divmod(4.0 * turns, 1.0)
        x, y = (bernstein(t) @ np.array([[1.0, 0.0], [1.0, 0.56], [0.56, 1.0], [0.0, 1.0]])).T
        c, s = np.round(np.cos(0.5 * np.pi * quarter)), np.round(np.sin(0.5 * np.pi * quarter))
        return np.stack([c * x - s * y, s * x + c * y], axis=1)

    def tube_at(rows, u, v):  # u along the tube in 0..2, v round it in 0..1
        piece = np.minimum(u.astype(int), 1)
        half = np.where(v < 0.5, 2.0 * v, 2.0 - 2.0 * v)
        p = np.einsum(
            "na,nabk,nb->nk", bernstein(u - piece), np.array(rows, float)[piece], bernstein(half)
        )
        p[v > 0.5, 1] *= -1.0
        return p

    fine = np.concatenate([bernstein(np.linspace(0, 1, 200)) @ c for c in profile[3:5]])[::-1]

    def outside(p):  # of the body, in its radius at that height
        turns = np.arctan2(p[:, 1], p[:, 0]) / (2 * np.pi) % 1.0
        return np.hypot(p[:, 0], p[:, 1]) / np.hypot(*arc(turns).T) - np.interp(
            p[:, 2], fine[:, 1], fine[:, 0]
        )

    def body() -> Mesh:
        size = 0.105
        line = [profile[0][0]]
        for c in profile:
            length = np.linalg.norm(
                np.diff(bernstein(np.linspace(0, 1, 50)) @ c, axis=0), axis=1
            ).sum()
            count = max(int(round(length / size)), 5)
            line += list(bernstein(np.arange(1, count + 1) / count) @ c)
        rings = []
        for r, z in line:
            sides = (
                4 * max(int(2 ** np.round(np.log2(2 * np.pi * r / size / 4))), 1) if r > 1e-9 else 1
            )
            rings.append(np.column_stack([r * arc(np.arange(sides) / sides), np.full(sides, z)]))
        return loft(rings)

    def rod(rows, around, along) -> Mesh:
        v = np.arange(around) / around
        low, high = np.zeros(around), np.full(around, 1.0)
        for _ in range(40):  # where each line along the tube leaves the body
            middle = 0.5 * (low + high)
            hidden = outside(tube_at(rows, middle, v)) < 0.004
            low, high = np.where(hidden, middle, low), np.where(hidden, high, middle)
        steps = [tube_at(rows, high + (2.0 - high) * t, v) for t in np.linspace(0, 1, along + 1)]
        vertices, faces = loft(steps)
        return vertices, faces[:, ::-1]

    vertices, faces = body()
    for part, part_faces in (rod(handle, 24, 56), rod(spout, 40, 44)):
        faces = np.concatenate([faces, part_faces + len(vertices)])
        vertices = np.concatenate([vertices, part])
    return vertices[:, [0, 2, 1]] * [1, 1, -1], faces


def loft(rings: list[np.ndarray]) -> Mesh:
    """A skin over closed rings (n, 3) that run counter-clockwise seen from the first: n the same,
    half or double."""
    faces, start = [], 0
    for a, b in zip(rings[:-1], rings[1:], strict=True):
        n, m = len(a), len(b)
        k = np.arange(max(n, m))
        ia, ib = start + k * n // max(n, m), start + n + k * m // max(n, m)
        ja, jb = start + (k + 1) * n // max(n, m) % n, start + n + (k + 1) * m // max(n, m) % m
        if n == m:  # along the shorter diagonal
            short = np.linalg.norm(a - np.roll(b, -1, axis=0), axis=1) <= np.linalg.norm(
                np.roll(a, -1, 0) - b, axis=1
            )
            faces += [
                np.where(short[:, None], np.stack([ia, ib, jb], 1), np.stack([ia, ib, ja], 1))
            ]
            faces += [
                np.where(short[:, None], np.stack([ia, jb, ja], 1), np.stack([ja, ib, jb], 1))
            ]
        else:
            both = np.concatenate([np.stack([ia, ib, jb], 1), np.stack([ia, jb, ja], 1)])
            faces.append(both[(both != np.roll(both, 1, axis=1)).all(axis=1)])
        start += n
    return np.concatenate(rings), np.concatenate(faces)


def cloth() -> Mesh:
    """A square cloth let fall over a ball: masses held at their distances, gravity, friction; then
    a smooth spline."""
    n, side, radius = 45, 2.3, 0.55
    ball = np.array([0.0, -radius, 0.0])
    u = np.linspace(-0.5, 0.5, n) * side
    grid = np.stack([*np.meshgrid(u, u, indexing="ij")], axis=-1)
    c, s = np.cos(0.35), np.sin(0.35)
    x = np.stack(
        [
            c * grid[..., 0] - s * grid[..., 1] + 0.10,
            np.full((n, n), 0.02),
            s * grid[..., 0] + c * grid[..., 1] + 0.05,
        ],
        axis=-1,
    )
    x[..., 1] += 0.01 * np.sin(3.0 * grid[..., 0] + 1.0) * np.cos(2.0 * grid[..., 1])
    speed, dt, edge = np.zeros_like(x), 1 / 60, side / (n - 1)
    links = []  # (rows a, rows b, length, stiffness), in groups that share no mass
    for di, dj, stiff in (
        (1, 0, 1.0),
        (0, 1, 1.0),
        (1, 1, 0.35),
        (1, -1, 0.35),
        (2, 0, 0.12),
        (0, 2, 0.12),
    ):
        i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
        inside = (i + di < n) & (0 <= j + dj) & (j + dj < n)
        i, j = i[inside], j[inside]
        colour = (i // di if di else j // dj) % 2
        for k in (0, 1):
            a, b = (i * n + j)[colour == k], ((i + di) * n + j + dj)[colour == k]
            links.append((a, b, edge * np.hypot(di, dj), stiff))
    flat = x.reshape(-1, 3)
    for _ in range(260):
        old = flat.copy()
        speed = 0.985 * speed.reshape(-1, 3) - [0.0, 9.8 * dt, 0.0]
        flat = flat + dt * speed
        for _ in range(12):
            for a, b, length, stiff in links:
                d = flat[b] - flat[a]
                gap = np.sqrt((d * d).sum(1))
                d *= (0.5 * stiff * (gap - length) / gap)[:, None]
                flat[a] += d
                flat[b] -= d
            off = flat - ball
            far = np.sqrt((off * off).sum(1))
            touch = far < radius + 0.02
            flat[touch] = ball + off[touch] * ((radius + 0.02) / far[touch])[:, None]
            flat[touch] = 0.7 * flat[touch] + 0.3 * old[touch]  # friction
        speed = (flat - old) / dt
    fine = spline_surface(flat.reshape(n, n, 3), 105)
    k = np.arange(105 * 105).reshape(105, 105)
    a, b, c_, d = (q.ravel() for q in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    return fine.reshape(-1, 3), np.concatenate([np.stack([a, c_, b], 1), np.stack([a, d, c_], 1)])


def spline_surface(net: np.ndarray, count: int) -> np.ndarray:
    """Points (count, count, 3) of the uniform bicubic B-spline over a net of control points (n, n,
    3)."""

    def weights(n):
        t = np.linspace(0.0, n - 1.0, count)
        i = np.minimum(t.astype(int), n - 2)
        t = t - i
        w = np.zeros((count, n + 2))  # the net is continued straight past its edges
        for k, b in enumerate(
            [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 3 * (t + t * t - t**3) + 1, t**3]
        ):
            w[np.arange(count), i + k] = b / 6
        w[:, 1] += 2 * w[:, 0]
        w[:, 2] -= w[:, 0]
        w[:, -2] += 2 * w[:, -1]
        w[:, -3] -= w[:, -1]
        return w[:, 1:-1]

    return np.einsum("ai,ijk,bj->abk", weights(len(net)), net, weights(net.shape[1]))


def write_ply(path: Path, mesh: Mesh) -> None:
    """Binary PLY: centred, longest side 1, vertices rounded to 1e-5 so that the last bits of a libm
    do not show."""
    vertices, faces = mesh
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = np.round((vertices - 0.5 * (low + high)) / (high - low).max(), 5) + 0.0
    index = "<u2" if len(vertices) < 65536 else "<i4"
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("v", index, 3)])
    rows["n"], rows["v"] = 3, faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar "
        f"{'ushort' if index == '<u2' else 'int'} vertex_indices\n"
        "end_header\n"
    )
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


SHAPES = {"elephant": elephant, "hand": hand, "bracket": bracket, "teapot": teapot, "cloth": cloth}


def main(names: list[str]) -> None:
    folder = Path(__file__).parent / "shapes"
    folder.mkdir(exist_ok=True)
    for name in names or SHAPES:
        mesh = SHAPES[name]()
        write_ply(folder / f"{name}.ply", mesh)
        size = (folder / f"{name}.ply").stat().st_size
        print(f"{name}: {len(mesh[0])} vertices, {len(mesh[1])} faces, {size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
