"""Closed-form surfaces: triangles, and the quantities that they approximate, in the shape's own
units."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Shape:
    """vertices (V, 3), faces (F, 3) counter-clockwise from outside; at each vertex: unit normal (V,
    3), principal curvatures k1, k2 (V,) (convex positive, |k1| >= |k2|), direction of k1 (V, 3)
    where it is defined."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    k1: np.ndarray | None = None
    k2: np.ndarray | None = None
    pdir1: np.ndarray | None = None

    def __iter__(self):
        return iter((self.vertices, self.faces))


def grid(rows, columns, close_rows=False, close_columns=False):
    """Faces of a rows x columns grid of vertices, row by row; diagonals alternate."""
    i, j = np.meshgrid(
        np.arange(rows - (not close_rows)), np.arange(columns - (not close_columns)), indexing="ij"
    )
    i, j = i.ravel(), j.ravel()
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + (j + 1) % columns, (i + 1) % rows * columns + j
    even = (i + j) % 2 == 0
    first = np.where(even[:, None], np.stack([a, d, c], 1), np.stack([a, d, b], 1))
    second = np.where(even[:, None], np.stack([a, c, b], 1), np.stack([b, d, c], 1))
    return np.concatenate([first, second])


def sphere(level=3, radius=1.0):
    """An icosahedron, each face cut in four `level` times: 20 * 4**level faces."""
    g = 0.5 * (1.0 + np.sqrt(5.0))
    v = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0],
                  [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
                  [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]])  # fmt: skip
    f = np.array([[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
                  [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
                  [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
                  [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]])  # fmt: skip
    for _ in range(level):
        pairs = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
        unique, middle = np.unique(pairs, axis=0, return_inverse=True)
        ab, bc, ca = len(v) + middle.reshape(3, -1)
        v = np.concatenate([v, v[unique].sum(axis=1)])
        a, b, c = f.T
        f = np.concatenate(
            [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
        v = v / np.linalg.norm(v, axis=1, keepdims=True)
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    k = np.full(len(v), 1.0 / radius)
    return Shape(radius * v, f, v, k, k)


def torus(big=1.0, small=0.4, around=96, across=48):
    """About the y axis. The larger curvature, 1 / small, runs round the tube."""
    a, t = np.meshgrid(
        np.arange(around) / around * 2 * np.pi,
        np.arange(across) / across * 2 * np.pi,
        indexing="ij",
    )
    a, t = a.ravel(), t.ravel()
    outward = np.stack([np.cos(a), np.zeros_like(a), np.sin(a)], 1)
    up = np.array([0.0, 1.0, 0.0])
    normals = np.cos(t)[:, None] * outward + np.sin(t)[:, None] * up
    vertices = big * outward + small * normals
    tube = -np.sin(t)[:, None] * outward + np.cos(t)[:, None] * up
    faces = grid(around, across, True, True)[:, ::-1]
    return Shape(
        vertices,
        faces,
        normals,
        np.full(len(a), 1 / small),
        np.cos(t) / (big + small * np.cos(t)),
        tube,
    )


def cylinder(radius=0.5, height=2.0, around=64, rows=33):
    """Open, about the y axis."""
    a, y = np.meshgrid(
        np.arange(around) / around * 2 * np.pi, np.linspace(-0.5, 0.5, rows) * height
    )
    a, y = a.ravel(), y.ravel()
    normals = np.stack([np.cos(a), np.zeros_like(a), np.sin(a)], 1)
    vertices = radius * normals + np.stack([0 * y, y, 0 * y], 1)
    along = np.stack([-np.sin(a), 0 * a, np.cos(a)], 1)
    faces = grid(rows, around, False, True)
    return Shape(vertices, faces, normals, np.full(len(a), 1 / radius), np.zeros(len(a)), along)


def height_field(z, first, second, size=1.0, n=41):
    """z(x, y) over a square, seen from +z. `first`: (z_x, z_y); `second`: (z_xx, z_xy, z_yy),
    functions of x, y."""
    y, x = np.meshgrid(np.linspace(-size, size, n), np.linspace(-size, size, n), indexing="ij")
    x, y = x.ravel(), y.ravel()
    (p, q), (r, s, t) = first(x, y), second(x, y)
    w = np.sqrt(1.0 + p * p + q * q)
    one = np.zeros((len(x), 2, 2))
    one[:, 0, 0], one[:, 0, 1], one[:, 1, 0], one[:, 1, 1] = 1 + p * p, p * q, p * q, 1 + q * q
    two = (
        -np.stack([np.stack([r, s], 1), np.stack([s, t], 1)], 1) / w[:, None, None]
    )  # convex towards +z: positive
    k, directions = np.linalg.eig(np.linalg.solve(one, two))
    k, directions = k.real, directions.real
    order = np.argsort(-np.abs(k), axis=1)
    k = np.take_along_axis(k, order, 1)
    d = np.take_along_axis(directions, order[:, None, :1], 2)[:, :, 0]
    d = np.stack([d[:, 0], d[:, 1], p * d[:, 0] + q * d[:, 1]], 1)
    normals = np.stack([-p / w, -q / w, 1 / w], 1)
    return Shape(
        np.stack([x, y, z(x, y)], 1), grid(n, n)[:, ::-1], normals, k[:, 0], k[:, 1],
        d / np.linalg.norm(d, axis=1, keepdims=True),
    )  # fmt: skip


def saddle(n=41):
    """z = (x^2 - 1.5 y^2) / 2."""
    return height_field(
        lambda x, y: 0.5 * (x * x - 1.5 * y * y), lambda x, y: (x, -1.5 * y),
        lambda x, y: (np.ones_like(x), np.zeros_like(x), np.full_like(x, -1.5)), n=n,
    )  # fmt: skip


def ridge(n=61, width=0.3, height=0.2):
    """A rounded ridge along the line x = 0.2 y: z = height exp(-(u / width)^2 / 2) with u the
    distance to it."""
    c, s = 1 / np.hypot(1, 0.2), -0.2 / np.hypot(1, 0.2)  # u = c x + s y

    def parts(x, y):
        u = (c * x + s * y) / width
        e = height * np.exp(-0.5 * u * u)
        return e, -u * e / width, (u * u - 1) * e / width**2

    return height_field(
        lambda x, y: parts(x, y)[0],
        lambda x, y: (c * parts(x, y)[1], s * parts(x, y)[1]),
        lambda x, y: (c * c * parts(x, y)[2], c * s * parts(x, y)[2], s * s * parts(x, y)[2]),
        n=n,
    )  # fmt: skip


def plane(n=5):
    flat = lambda x, y: np.zeros_like(x)  # noqa: E731
    return height_field(flat, lambda x, y: (0 * x, 0 * x), lambda x, y: (0 * x, 0 * x, 0 * x), n=n)


def cube(n=2):
    """Unit cube, n x n vertices a side, welded."""
    points, faces = [], []
    t = np.linspace(-0.5, 0.5, n)
    a, b = (m.ravel() for m in np.meshgrid(t, t, indexing="ij"))
    for axis in range(3):
        for sign in (-0.5, 0.5):
            side = np.empty((n * n, 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = sign, a, b
            order = grid(n, n)
            faces.append((order if sign > 0 else order[:, ::-1]) + len(points) * n * n)
            points.append(side)
    points, faces = np.concatenate(points), np.concatenate(faces)
    unique, index = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    return Shape(unique, index.ravel()[faces])


def moebius(around=40, across=5):
    """Not orientable."""
    a, t = np.meshgrid(
        np.arange(around) / around * 2 * np.pi, np.linspace(-0.3, 0.3, across), indexing="ij"
    )
    r = 1 + t * np.cos(a / 2)
    vertices = np.stack([r * np.cos(a), r * np.sin(a), t * np.sin(a / 2)], -1).reshape(-1, 3)
    faces = grid(around, across)
    last, first = (around - 1) * across + np.arange(across), np.arange(across)[::-1]
    a, b, c, d = last[:-1], last[1:], first[1:], first[:-1]
    return Shape(vertices, np.concatenate([faces, np.stack([a, d, c], 1), np.stack([a, c, b], 1)]))


def wheel(spokes=5):
    """A wheel in the plane z = 0, of parts that touch: {"tire": Shape, "hub": ..., "spoke 1":
    ...}."""
    turned = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]).T  # the y axis to z
    parts = {"tire": torus(1.0, 0.14, 64, 16), "hub": sphere(2, 0.25)}
    for k in range(spokes):
        rod, a = cylinder(0.05, 0.7, 12, 9), 2 * np.pi * k / spokes
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        parts[f"spoke {k + 1}"] = Shape((rod.vertices + [0, 0.55, 0]) @ turn.T, rod.faces)
    return {
        name: Shape(s.vertices @ turned if name == "tire" else s.vertices, s.faces)
        for name, s in parts.items()
    }


def obj_text(parts):
    """{name: Shape} as a Wavefront OBJ file, an object each; "" is none, which can be but the
    first."""
    lines, done = [], 1
    for name, shape in parts.items():
        lines += [f"o {name}"] * bool(name) + [
            "v {:.6f} {:.6f} {:.6f}".format(*v) for v in shape.vertices
        ]
        lines += ["f {} {} {}".format(*(f + done)) for f in shape.faces]
        done += len(shape.vertices)
    return "\n".join(lines) + "\n"
