"""Solids of few and large triangles drawn beside the same solids cut into many small ones: 20 of
the kind that CAD and Blender make, from 6 sides each.

    python benchmarks/coarse.py [--solids NAME ...] [--size 768] [--sheet OUT.png] [--details]

Each face is cut flatly into four, until no edge is longer than FINE of the solid, so that both are
the very same shape. Printed are the visible length of the one over the other, and the share of
either one's length with no line of the other within NEAR px: missing (drawn on the fine mesh only)
and extra (on the coarse one only)."""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from manifold3d import triangulate
from PIL import Image, ImageDraw
from scipy.spatial import cKDTree

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.pipeline import extract_view
from strokestyle.geometry.curves import Curves, resample
from strokestyle.mesh.surface import make_surface

VIEWS = ("three-quarter", "front", "30,30", "120,20", "-70,45", "200,-25")
FINE = 0.04  # of the longest side
NEAR = 2.0  # px
CELL = 300

Mesh = tuple[np.ndarray, np.ndarray]  # vertices (V, 3), faces (F, 3)


def extrude(profile, low: float, high: float, hole=None) -> Mesh:
    """A prism over a polygon (N, 2) in x and z, from height low to high; with a hole through it."""
    rings = [np.asarray(ring, float) for ring in (profile, hole) if ring is not None]
    # around a hole the other way than around the outside
    rings = [ring[::-1] if (area(ring) < 0) == (k == 0) else ring for k, ring in enumerate(rings)]
    flat = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings])
    cap = np.asarray(triangulate(rings), np.int64)[:, ::-1]  # up: clockwise in (x, z)
    count = len(flat)
    floor, roof = (np.insert(flat, 1, height, axis=1) for height in (low, high))
    faces = [cap + count, cap[:, ::-1]]
    for start, ring in zip((0, *ends), rings, strict=False):
        j = start + np.arange(len(ring))
        i = np.roll(j, -1)
        faces += [np.stack([i, j, j + count], 1), np.stack([i, j + count, i + count], 1)]
    return np.concatenate([floor, roof]), np.concatenate(faces)


def area(ring: np.ndarray) -> float:
    """Measure a polygon (N, 2): positive where it runs from x to z."""
    x, z = ring.T
    return float(0.5 * (x * np.roll(z, -1) - np.roll(x, -1) * z).sum())


def lathe(profile, around: int) -> Mesh:
    """A body of revolution about y: profile (N, 2) of radius and height, from top to bottom."""
    profile = np.asarray(profile, float)
    t = np.arange(around) * (2 * np.pi / around)
    rings = [
        np.stack([r * np.cos(t), np.full(around, y), r * np.sin(t)], 1)[: 1 if r == 0.0 else None]
        for r, y in profile
    ]
    start = np.cumsum([0, *(len(ring) for ring in rings)])
    i = np.arange(around)
    j, faces = (i + 1) % around, []
    for k in range(len(rings) - 1):
        a, b = start[k], start[k + 1]
        if len(rings[k + 1]) > 1:
            top = (i if len(rings[k]) > 1 else 0 * i) + a
            faces.append(np.stack([top, b + j, b + i], 1))
        if len(rings[k]) > 1:
            bottom = (j if len(rings[k + 1]) > 1 else 0 * j) + b
            faces.append(np.stack([a + i, a + j, bottom], 1))
    return np.concatenate(rings), np.concatenate(faces)


def box(low, high) -> Mesh:
    (x0, y0, z0), (x1, y1, z1) = low, high
    return extrude(rectangle(x0, z0, x1, z1), y0, y1)


def rectangle(x0, z0, x1, z1) -> list:
    return [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]


def joined(*bodies: Mesh) -> Mesh:
    offset = np.cumsum([0, *(len(v) for v, _ in bodies)])
    vertices = np.concatenate([v for v, _ in bodies])
    return vertices, np.concatenate([f + at for (_, f), at in zip(bodies, offset, strict=False)])


def moved(body: Mesh, by) -> Mesh:
    return body[0] + np.asarray(by, float), body[1]


def polygon(count: int, radius: float = 1.0, inner: float | None = None) -> np.ndarray:
    """A regular polygon, or a star where `inner` is the radius of every second corner."""
    t = np.arange(count) * (2 * np.pi / count) + 0.1
    r = np.where(np.arange(count) % 2, radius if inner is None else inner, radius)
    return np.stack([r * np.cos(t), r * np.sin(t)], 1)


def gear(teeth: int) -> np.ndarray:
    t = (np.arange(teeth)[:, None] + [0.0, 0.12, 0.38, 0.5]).ravel() * (2 * np.pi / teeth)
    r = np.tile([0.8, 1.0, 1.0, 0.8], teeth)
    return np.stack([r * np.cos(t), r * np.sin(t)], 1)


def rounded_box(radius: float, steps: int) -> Mesh:
    """A prism whose four upright edges are filleted."""
    t = np.linspace(0, np.pi / 2, steps + 1)
    corner = [(1, 1, 0), (-1, 1, 90), (-1, -1, 180), (1, -1, 270)]
    turn = [(x * (1 - radius), z * (1 - radius), np.radians(a)) for x, z, a in corner]
    profile = [
        (x + radius * np.cos(a + u), z + radius * np.sin(a + u)) for x, z, a in turn for u in t
    ]
    return extrude(profile, 0.0, 1.2)


L, U = [(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2)], [
    (0, 0), (3, 0), (3, 2), (2.3, 2), (2.3, 0.7), (0.7, 0.7), (0.7, 2), (0, 2),
]  # fmt: skip
STAIRS = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 2), (1, 2), (1, 1), (0, 1)]


def frame() -> Mesh:
    outer, hole = ((x, z, 3 - x, 2 - z) for x, z in ((0.0, 0.0), (1.0, 0.5)))
    return extrude(rectangle(*outer), 0, 0.4, rectangle(*hole))


def shelves() -> Mesh:
    sides = [box((x, 0, 0), (x + 0.1, 4, 1)) for x in (0, 1.9)]
    boards = [box((0.1, y, 0), (1.9, y + 0.08, 1)) for y in (0.1, 1.0, 1.9, 2.8, 3.9)]
    return joined(*sides, *boards)


def pins() -> Mesh:
    places = [(x, z) for x in (0.3, 1.3, 2.3, 3.3) for z in (0.3, 1.0)]
    pins = [box((x, -0.5, z), (x + 0.25, 3, z + 0.25)) for x, z in places]
    return joined(box((0, 0, 0), (4, 0.6, 1.6)), *pins)


def table() -> Mesh:
    places = [(x, z) for x in (0.1, 2.7) for z in (0.1, 1.7)]
    legs = [box((x, 0, z), (x + 0.2, 1.5, z + 0.2)) for x, z in places]
    return joined(box((0, 1.5, 0), (3, 1.65, 2)), *legs)


def bolts() -> Mesh:
    head = extrude(polygon(6, 0.25), 0.3, 0.5)
    tip = lathe([(0, 0.9), (0.12, 0.9), (0.12, 0.5), (0, 0.5)], 12)
    places = [(x, 0, z) for x in (0.6, 2.0, 3.4) for z in (0.6, 2.4)]
    return joined(box((0, 0, 0), (4, 0.3, 3)), *(moved(joined(head, tip), at) for at in places))


def house() -> Mesh:
    vertices, faces = extrude(GABLE, 0, 4)
    lying = vertices[:, [0, 2, 1]] * [1, 1, -1], faces
    return joined(lying, box((0.5, 2, -2.0), (0.9, 3.4, -1.6)))


L = [(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2)]
U = [(0, 0), (3, 0), (3, 2), (2.3, 2), (2.3, 0.7), (0.7, 0.7), (0.7, 2), (0, 2)]
STAIRS = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 2), (1, 2), (1, 1), (0, 1)]
GABLE = [(0, 0), (3, 0), (3, 2), (1.5, 3.2), (0, 2)]
TUBE = [(0.7, 0), (0.7, 2), (1, 2), (1, 0), (0.7, 0)]
SHAFT = [(0, 4), (0.5, 4), (0.5, 3), (1, 3), (1, 2.6), (0.7, 2.6), (0.7, 0), (0, 0)]

SOLIDS: dict[str, Callable[[], Mesh]] = {
    "box": lambda: box((0, 0, 0), (2, 1, 1.4)),
    "L": lambda: extrude(L, 0, 3),
    "U": lambda: extrude(U, 0, 1),
    "stairs": lambda: extrude(STAIRS, 0, 2),
    "frame": frame,
    "hexagonal prism": lambda: extrude(polygon(6), 0, 3),
    "star": lambda: extrude(polygon(10, 1.0, 0.5), 0, 0.6),
    "gear": lambda: extrude(gear(14), 0, 0.4, polygon(24, 0.3)),
    "cylinder of 12": lambda: lathe([(0, 2), (1, 2), (1, 0), (0, 0)], 12),
    "cylinder of 32": lambda: lathe([(0, 3), (1, 3), (1, 0), (0, 0)], 32),
    "tube of 24": lambda: lathe(TUBE, 24),
    "cone of 16": lambda: lathe([(0, 2), (1, 0), (0, 0)], 16),
    "stepped shaft": lambda: lathe(SHAFT, 20),
    "pyramid": lambda: lathe([(0, 1.5), (1, 0), (0, 0)], 4),
    "rounded box": lambda: rounded_box(0.3, 3),
    "shelves": shelves,
    "pins on a plate": pins,
    "table": table,
    "bolts on a plate": bolts,
    "house": house,
}


def subdivided(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Cut every face flatly into four, until no edge is longer than FINE of the longest side."""
    longest = FINE * np.ptp(vertices, axis=0).max()
    while True:
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        edges, of = np.unique(ends, axis=0, return_inverse=True)
        if np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1).max() <= longest:
            return vertices, faces
        a, b, c = faces.T
        ab, bc, ca = (of.reshape(-1, 3) + len(vertices)).T
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(part, axis=1) for part in parts])


def visible(mesh: Mesh, camera) -> Curves:
    return extract_view(make_surface(*mesh), camera).curves


def apart(curves: Curves, others: Curves) -> float:
    """Measure the length of curves that has no point of others within NEAR px, px."""
    if not len(curves):
        return 0.0
    xy = resample(curves.xy, curves.offsets, 1.0)[0]
    if not len(others):
        return float(len(xy))
    tree = cKDTree(resample(others.xy, others.offsets, 1.0)[0])
    return float((tree.query(xy)[0] > NEAR).sum())


def compare(name: str, size: int) -> list[tuple[str, Curves, Curves]]:
    """Draw a solid coarse and fine, from every side: view, coarse curves, fine curves."""
    coarse = SOLIDS[name]()
    fine = subdivided(*coarse)
    vertices = make_surface(*coarse).vertices
    found = []
    for view in VIEWS:
        camera = fit_camera(vertices, view, width=size, height=size)
        found.append((view, visible(coarse, camera), visible(fine, camera)))
    return found


def sheet(rows: list[list[tuple[str, Curves, Curves]]], size: int) -> Image.Image:
    """Draw the fine lines pale and wide, the coarse ones dark over them."""
    image = Image.new("RGB", (len(VIEWS) * CELL * 2, len(rows) * CELL * 2), "white")
    pen, scale = ImageDraw.Draw(image), 2.0 * CELL / size
    for i, row in enumerate(rows):
        for k, (_, coarse, fine) in enumerate(row):
            at = np.array([k, i]) * 2 * CELL
            for curves, colour, width in ((fine, "#f5a8a0", 7), (coarse, "#104080", 2)):
                for c in range(len(curves)):
                    pen.line([tuple(p) for p in curves[c] * scale + at], colour, width)
    return image.reduce(2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--solids", nargs="*", default=list(SOLIDS))
    parser.add_argument("--size", type=int, default=768)
    parser.add_argument("--sheet")
    parser.add_argument("--details", action="store_true", help="a line for each view")
    args = parser.parse_args()
    print("| solid | visible length, coarse to fine, worst of 6 | missing | extra |")
    print("| --- | --- | --- | --- |")
    rows, ratios = [], []
    for name in args.solids:
        rows.append(compare(name, args.size))
        lengths = np.array([[c.lengths().sum(), f.lengths().sum()] for _, c, f in rows[-1]])
        missing = [apart(f, c) for _, c, f in rows[-1]]
        extra = [apart(c, f) for _, c, f in rows[-1]]
        ratio = lengths[:, 0] / np.maximum(lengths[:, 1], 1e-9)
        ratios += ratio.tolist()
        worst = ratio[np.abs(ratio - 1).argmax()]
        gone, more = sum(missing) / lengths[:, 1].sum(), sum(extra) / lengths[:, 0].sum()
        print(f"| {name} | {worst:.3f} | {gone:.2%} | {more:.2%} |", flush=True)
        if args.details:
            for k, view in enumerate(VIEWS):
                print(
                    f"  {view}: {ratio[k]:.3f}, missing {missing[k]:.0f}, extra {extra[k]:.0f} px"
                )
    off = np.abs(np.array(ratios) - 1.0)
    print(f"| within 1 % | {(off <= 0.01).sum()} of {len(off)} | worst {off.max():.1%} | |")
    if args.sheet:
        sheet(rows, args.size).save(args.sheet)


if __name__ == "__main__":
    main()
