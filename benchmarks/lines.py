"""The lines of `extract` measured: geometry, segments, visibility, strokes, speed. Prints `what |
target | measured`.

    python benchmarks/lines.py [SHARED] [--only geometry segments visibility strokes speed]
    [--details]

SHARED (or $STROKESTYLE_SHARED) is a folder with `meshes/*.obj` and rtsc's numbers in
`oracles/rtsc/*.npz`; without it the shapes of `examples/` and closed-form surfaces are measured,
and the rows that need more are left out. CPU seconds are of one process, all threads; every size is
measured in a process of its own."""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

import shapes
import sight

from strokestyle.extract import segments as lines
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.feature_maps import feature_maps
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.lines import SurfaceLines, feature_curves
from strokestyle.extract.pipeline import extract_view
from strokestyle.extract.rays import Bvh
from strokestyle.extract.view_curvature import ViewFields
from strokestyle.geometry.curves import KINDS, Curves, arc_length, owner, resample, tangents
from strokestyle.geometry.kinds import SHARP_KINDS, SURFACE_KINDS
from strokestyle.mesh.surface import load_surface, make_surface

VIEWS = ("three-quarter", "side")
RTSC = {
    "suggestive": 0.01,
    "ridge": 0.1,
    "valley": 0.1,
    "apparent": 0.1,
    "sharpness": 0.0,
}  # its thresholds
SECTIONS = ("geometry", "segments", "visibility", "strokes", "speed")


def row(what: str, target: str, measured: str) -> None:
    print(f"{what:66s} | {target:16s} | {measured}", flush=True)


# ----------------------------------------------------------------------------------------- geometry


def oracle_errors(theirs) -> dict[str, np.ndarray]:
    """Errors of curvatures and derivatives relative to max(|value|, the mesh's median |k1|), per
    vertex."""
    ours = make_surface(theirs["vertices"], theirs["faces"], crease=180, rtsc=True)
    least = np.median(np.abs(theirs["curv1"]))
    # Derivatives are compared in rtsc's own frame, turned there as tensors: where k1 = k2 the
    # frames differ freely.
    x = np.einsum("ij,ij->i", theirs["pdir1"], ours.pdir1)
    y = np.einsum("ij,ij->i", theirs["pdir1"], ours.pdir2)
    size = np.maximum(np.hypot(x, y), 1e-12)
    turned = _turn(ours.dcurv, x / size, y / size)
    mirrored = np.einsum("ij,ij->i", np.cross(theirs["pdir1"], theirs["pdir2"]), ours.normals) < 0
    turned[mirrored] *= [1, -1, 1, -1]

    def relative(found, true):
        return np.abs(found - true) / np.maximum(np.abs(true), least)

    return {
        "k1": relative(ours.k1, theirs["curv1"]),
        "k2": relative(ours.k2, theirs["curv2"]),
        "dcurv": relative(turned, theirs["dcurv"]).ravel(),
    }


def _turn(tensor: np.ndarray, c: np.ndarray, s: np.ndarray) -> np.ndarray:
    """A symmetric derivative tensor (V, 4) in the frame turned by the angle of cosine c and sine
    s."""
    p, q, r, t = tensor.T
    full = np.stack([p, q, q, r, q, r, r, t], axis=1).reshape(-1, 2, 2, 2)
    axes = np.stack([np.stack([c, s], 1), np.stack([-s, c], 1)], axis=1)
    out = np.einsum("vijk,vai,vbj,vck->vabc", full, axes, axes, axes)
    return np.stack([out[:, 0, 0, 0], out[:, 0, 0, 1], out[:, 0, 1, 1], out[:, 1, 1, 1]], axis=1)


def closed_form_errors(shape) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the larger and the smaller curvature relative to the shape's largest: of vertices
    farther than two edges from any boundary, and of the others."""
    surface = make_surface(*shape)
    found = np.sort(np.stack([surface.k1, surface.k2]), axis=0) / surface.scale
    true = np.sort(np.stack([shape.k1, shape.k2]), axis=0)
    error = np.abs(found - true).max(axis=0) / np.abs(true).max()
    near = np.zeros(len(surface.vertices), bool)
    near[surface.edges[surface.edge_face_count == 1]] = True
    near[surface.faces[near[surface.faces].any(axis=1)]] = True
    return error[~near], error[near]


def geometry(shared: Path | None) -> None:
    for path in oracles(shared):
        for name, error in oracle_errors(np.load(path)).items():
            figures = (
                f"median {np.median(error):.1e}, 99th percentile {np.percentile(error, 99):.1e}"
            )
            row(f"{name} against rtsc, {path.stem}", "1e-3, 1e-2", figures)
    makers = {
        "sphere": lambda n: shapes.sphere({20: 2, 40: 3, 80: 4}[n]),
        "cylinder": lambda n: shapes.cylinder(around=n, rows=n // 2 + 1),
        "torus": lambda n: shapes.torus(1.0, 0.4, 2 * n, n),
        "saddle": lambda n: shapes.saddle(n + 1),
    }
    for name, make in makers.items():
        errors = [closed_form_errors(make(n)) for n in (20, 40, 80)]
        for part, where in enumerate(("inside", "within two edges of a boundary")):
            if len(errors[0][part]):
                mean = [error[part].mean() for error in errors]
                order = f"order {np.log2(mean[1] / mean[2]):.2f}" if mean[2] > 1e-12 else "exact"
                figures = "mean " + ", ".join(f"{m:.1e}" for m in mean)
                figures += f"; worst {errors[2][part].max():.1e}; {order}"
                target = "" if part else "second order"
                row(f"curvatures of a {name}, {where}, edge 1, 1/2, 1/4", target, figures)


# ----------------------------------------------------------------------------------------- segments


def oracles(shared: Path | None) -> list[Path]:
    return sorted((shared / "oracles" / "rtsc").glob("*.npz")) if shared else []


def covered(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-4) -> float:
    """Share of the length of segments a (S, 2, 3) that lies within `tolerance` of segments b."""
    if not len(a) or not len(b):
        return float(not len(a))

    def sample(segments, step):
        length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
        count = np.maximum(np.ceil(length / step), 1).astype(int)
        which = np.repeat(np.arange(len(segments)), count)
        t = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[
            which
        ]
        return segments[which, 0] + t[:, None] * (segments[which, 1] - segments[which, 0]), (
            length / count
        )[which]

    step = tolerance / 4
    (p, weight), (q, _) = sample(a, 4 * step), sample(b, step)
    near = (
        cKDTree(q).query(p, distance_upper_bound=tolerance + 0.5 * step)[0]
        <= tolerance + 0.5 * step
    )
    return weight[near].sum() / weight.sum()


def segments(shared: Path | None) -> None:
    for path in oracles(shared):
        theirs = np.load(path)
        surface = make_surface(theirs["vertices"], theirs["faces"], crease=180, rtsc=True)
        view = ViewFields.of(surface, theirs["eye"])
        front = (view.n_dot_v > 0)[surface.faces].any(axis=1)  # rtsc draws ridges on these only
        whole, trimmed = LineOptions(**RTSC, trim=False), LineOptions(**RTSC)
        found = {
            "contour": lines.contour_segments(surface, view, trimmed).shown,
            "contour_untrimmed": lines.contour_segments(surface, view, whole).shown,
            "suggestive": lines.suggestive_segments(surface, view, trimmed),
            "apparent": lines.apparent_segments(surface, view, whole),
            "ridge": lines.ridge_segments(surface, trimmed),
            "valley": lines.valley_segments(surface, trimmed),
            "boundary": lines.boundary_segments(surface, trimmed),
        }
        for kind, ours in found.items():
            if kind in ("ridge", "valley"):
                ours = ours.take(front[ours.face])
            expected = theirs[f"{kind}_seg"].astype(float)
            good = np.isfinite(expected).all(axis=(1, 2))
            if not good.any() and not len(ours):
                continue
            points = ours.points(surface)
            figures = f"ours in theirs {covered(points, expected[good]):.4f}, theirs in ours "
            figures += (
                f"{covered(expected[good], points):.4f} ({len(ours)} and {good.sum()} segments)"
            )
            row(f"{kind} segments against rtsc, {path.stem}", ">= .99 both", figures)


# --------------------------------------------------------------------------------------- visibility


def places(surface, camera, options: LineOptions) -> sight.Places:
    """The middle of every straight piece of the lines of a surface, hidden ones included."""
    curves = feature_curves(surface, camera, options)
    point, which = curves.points(surface), owner(curves.offsets)
    first = np.flatnonzero(which[:-1] == which[1:])
    face, middle = curves.face[first], 0.5 * (point[first] + point[first + 1])
    a, b, c = (surface.vertices[surface.faces[face, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)
    weight = [
        np.einsum("ij,ij->i", np.cross(q - p, middle - p), normal) / square
        for p, q in ((b, c), (c, a))
    ]
    bary = np.stack([*weight, 1.0 - weight[0] - weight[1]], axis=1).clip(0.0, 1.0)
    kind = curves.kind[which[first]]
    sharp = np.isin(kind, [KINDS.index(name) for name in SHARP_KINDS])
    length = np.linalg.norm(point[first + 1] - point[first], axis=1)
    return sight.Places(face, bary / bary.sum(axis=1, keepdims=True), length, kind, sharp)


class Tally:
    """Length seen and falsely seen, per kind of line, over several drawings of equal weight."""

    def __init__(self):
        self.sums = np.zeros((len(KINDS), 4))  # truly seen, of that found, found, of that false

    def add(self, where: sight.Places, seen: np.ndarray, truth: np.ndarray) -> None:
        length = where.length / max(where.length.sum(), 1e-12)
        for column, mask in enumerate((truth, truth & seen, seen, seen & ~truth)):
            self.sums[:, column] += np.bincount(
                where.kind[mask], length[mask], minlength=len(KINDS)
            )

    def figures(self, kind: str) -> str | None:
        true, found, seen, false = self.sums[KINDS.index(kind)]
        return (
            f"{found / max(true, 1e-12):.4f} / {false / max(seen, 1e-12):.4f}"
            if seen + true
            else None
        )


def drawings(shared: Path | None):
    """(path, surface, camera) of the shared meshes and the examples, two views each."""
    paths = sorted((shared / "meshes").glob("*.obj")) if shared else []
    for path in paths + sorted((ROOT / "examples" / "shapes").glob("*.ply")):
        surface = load_surface(path)
        for view in VIEWS:
            yield path, view, surface, fit_camera(surface.vertices, view)


SHARP, SMOOTH = SHARP_KINDS, tuple(kind for kind in SURFACE_KINDS if kind not in SHARP_KINDS)
ROADS = {  # what seen and hidden is measured against, and for which kinds that is a truth
    "its own rule in double precision": (sight.by_rule, SURFACE_KINDS),
    "the smooth surface of the normals": (sight.by_curved_faces, SMOOTH),
    "every other facet of the mesh": (sight.by_mesh, ("contour",)),
}


def visibility(shared: Path | None, details: bool = False) -> None:
    options = LineOptions(kinds=SURFACE_KINDS)
    tallies = {name: Tally() for name in ROADS}
    for path, view, surface, camera in drawings(shared):
        where = places(surface, camera, options)
        seen = Bvh(surface).seen(
            camera.eye, where.face, where.on(surface, surface.vertices), where.sharp
        )
        for name, (road, kinds) in ROADS.items():
            truth = road(surface, camera.eye, where)
            tallies[name].add(where, seen, truth)
            if details:
                single = Tally()
                single.add(where, seen, truth)
                figures = "  ".join(
                    f"{kind} {single.figures(kind)}" for kind in kinds if single.figures(kind)
                )
                print(f"    {path.stem} {view}, {name}: {figures}")
    for name, tally in tallies.items():
        target = "" if "facet" in name else ">= .998 / <= .003"
        for kind in ROADS[name][1]:
            if tally.figures(kind):
                row(f"{kind} seen: recall / false, against {name}", target, tally.figures(kind))
    closed_form_visibility()


def torus_height(points):
    return np.hypot(np.hypot(points[:, 0], points[:, 2]) - 0.34, points[:, 1]) - 0.16


def bumpy_radius(direction):
    x, y, z = direction.T
    return 0.4 + 0.08 * np.sin(7 * x) * np.sin(6 * y) * np.sin(5 * z + 1)


def bumpy_height(points):
    distance = np.linalg.norm(points, axis=1)
    return distance - bumpy_radius(points / np.maximum(distance, 1e-12)[:, None])


def closed_form_visibility() -> None:
    torus = shapes.torus(0.34, 0.16, 240, 120)
    ball = shapes.sphere(6)
    bumpy = ball.vertices * bumpy_radius(ball.vertices)[:, None]
    for name, mesh, height, slack in (
        ("torus", (torus.vertices, torus.faces), torus_height, 4e-4),
        ("bumpy ball", (bumpy, ball.faces), bumpy_height, 4e-4),
    ):
        surface = make_surface(*mesh)
        tally = Tally()
        for view in ("three-quarter", "20,40", "0,25"):
            camera = fit_camera(surface.vertices, view)
            where = places(surface, camera, LineOptions(kinds=SURFACE_KINDS, smooth=0.0))
            position = where.on(surface, surface.vertices)
            seen = Bvh(surface).seen(camera.eye, where.face, position, where.sharp)
            eye, position = surface.original(camera.eye[None])[0], surface.original(position)
            tally.add(where, seen, sight.by_formula(height, eye, position, slack))
        for kind in SURFACE_KINDS:
            if tally.figures(kind):
                row(
                    f"{kind} seen: recall / false, against the formula of a {name}",
                    ">= .998 / <= .003",
                    tally.figures(kind),
                )


# ------------------------------------------------------------------------------------------ strokes


def doubled(curves: Curves, near: float = 1.5, over: float = 10.0, angle: float = 20.0) -> float:
    """Length that is drawn twice: stretches of more than `over` px within `near` px of another
    stroke, or of the same stroke 20 px away along it, in the same direction; of the two, one
    counts."""
    xy, offsets, _ = resample(curves.xy, curves.offsets, 1.0)
    if not len(xy):
        return 0.0
    which, along, direction = (
        owner(offsets),
        arc_length(xy, offsets),
        tangents(xy, offsets, curves.closed),
    )
    a, b = cKDTree(xy).query_pairs(near, output_type="ndarray").T
    apart = np.abs(along[a] - along[b])
    length = along[offsets[1:] - 1][which[a]]
    apart = np.where(curves.closed[which[a]], np.minimum(apart, length - apart), apart)
    twice = (which[a] != which[b]) | (apart > 20.0)
    twice &= np.abs(np.einsum("ij,ij->i", direction[a], direction[b])) > np.cos(np.radians(angle))
    marked = np.zeros(len(xy), bool)
    marked[np.maximum(a, b)[twice]] = True
    new = np.flatnonzero(np.r_[True, (marked[1:] != marked[:-1]) | (which[1:] != which[:-1])])
    count = np.diff(np.r_[new, len(xy)])
    return float(count[marked[new] & (count > over)].sum())


def strokes(shared: Path | None, details: bool = False) -> None:
    contours, everything = np.zeros(4), np.zeros(4)
    for path, view, surface, camera in drawings(shared):
        contour = extract_view(surface, camera, LineOptions(kinds=("contour",)))
        length = contour.curves.lengths()
        contours += np.array(
            [(length < 5).sum(), len(length), length[length > 50].sum(), length.sum()]
        )
        curves = extract_view(surface, camera).curves
        length = curves.lengths()
        single = np.array([(length < 8).sum(), len(length), doubled(curves), length.sum()])
        everything += single
        if details:
            print(
                f"    {path.stem} {view}: {len(length)} strokes, under 8 px {single[0]:.0f}, "
                f"doubled {single[2]:.0f} px"
            )
    row(
        "visible contours: share of strokes under 5 px",
        "<= .08",
        f"{contours[0] / contours[1]:.3f}",
    )
    row(
        "visible contours: share of the length in strokes over 50 px",
        ">= .92",
        f"{contours[2] / contours[3]:.3f}",
    )
    row(
        "default kinds: share of strokes under 8 px",
        "<= .05",
        f"{everything[0] / everything[1]:.3f}",
    )
    row("default kinds: doubled length", "<= .01", f"{everything[2] / everything[3]:.4f}")


# -------------------------------------------------------------------------------------------- speed


def bumpy_torus(around: int, across: int):
    shape = shapes.torus(1.0, 0.4, around, across)
    x, y, _ = shape.vertices.T
    return shape.vertices * (1.0 + 0.03 * np.sin(20 * x) * np.cos(25 * y))[:, None], shape.faces


def measure(path: str) -> None:
    """Draw one mesh file and print a JSON object of CPU seconds and peak memory; run in a process
    of its own."""
    import trimesh  # noqa: F401  what loading imports is not its speed

    clock = time.process_time
    out = {}
    start = clock()
    surface = load_surface(path)
    out["load"] = clock() - start
    start = clock()
    make_surface(np.array(surface.original(surface.vertices)), surface.faces)
    out["of it geometry"] = clock() - start
    options = LineOptions(kinds=SURFACE_KINDS)
    start = clock()
    lines = SurfaceLines(surface, options)
    view = extract_view(surface, fit_camera(surface.vertices, "three-quarter"), lines=lines)
    out["first view"] = clock() - start
    further = []
    for turn in ("10,20", "35,10", "80,5"):
        camera = fit_camera(surface.vertices, turn)
        start = clock()
        extract_view(surface, camera, lines=lines)
        further.append(clock() - start)
    start = clock()
    _ = feature_maps(surface, camera, view.curves, lines.bvh).values
    out["maps"] = clock() - start
    out["further view"] = float(np.median(further))
    out["faces"] = len(surface.faces)
    out["MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(out))


def speed(shared: Path | None) -> None:
    import trimesh

    with tempfile.TemporaryDirectory() as folder:
        files = []
        for name, size in (("69k", (262, 132)), ("346k", (588, 294)), ("1M", (1000, 500))):
            mesh = trimesh.Trimesh(*bumpy_torus(*size), process=False)
            for suffix in ("ply", "obj") if name == "1M" else ("obj",):
                files.append(Path(folder) / f"bumpy-torus.{suffix}")
                mesh.export(files[-1])
                report(files[-1], name)
        if shared and (path := shared / "meshes" / "nefertiti.obj").exists():
            report(path, "69k")


def report(path: Path, name: str) -> None:
    command = [sys.executable, __file__, "--measure", str(path)]
    got = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    what = f"{path.name}, {got['faces']} faces: "
    targets = {"69k": ("<= 1.2", "<= 0.3", "<= 0.5"), "346k": ("<= 5", "", ""), "1M": ("", "", "")}[
        name
    ]
    row(
        what + "load, and of that geometry, CPU s",
        "",
        f"{got['load']:.2f}, {got['of it geometry']:.2f}",
    )
    for part, target in zip(("first view", "further view", "maps"), targets, strict=True):
        row(
            what + part + (" with every kind" if part != "maps" else " 768 x 768") + ", CPU s",
            target,
            f"{got[part]:.2f}",
        )
    total = got["load"] + got["first view"] + got["maps"]
    row(what + "load, first view, maps, CPU s", "<= 20" if name == "1M" else "", f"{total:.2f}")
    row(what + "peak memory, GB", "<= 4" if name == "1M" else "", f"{got['MB'] / 1024:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "shared", nargs="?", type=Path, default=os.environ.get("STROKESTYLE_SHARED")
    )
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=SECTIONS)
    parser.add_argument(
        "--details", action="store_true", help="figures of every mesh and view, too"
    )
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.measure:
        return measure(args.measure)
    shared = Path(args.shared) if args.shared else None
    if shared and not (shared / "meshes").is_dir():
        parser.error(f"{shared}: no folder meshes in it")
    if not shared:
        print("no SHARED folder: without rtsc's numbers and the ten meshes")
    row("what", "target", "measured")
    for name, section in {
        "geometry": geometry,
        "segments": segments,
        "visibility": partial(visibility, details=args.details),
        "strokes": partial(strokes, details=args.details),
        "speed": speed,
    }.items():
        if name in args.only:
            section(shared)


if __name__ == "__main__":
    main()
