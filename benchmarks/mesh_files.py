"""Who reads a mesh file rightly, and how fast: read_mesh beside trimesh alone; the tables of
docs/meshes.md.

    python benchmarks/mesh_files.py [--style MODEL] [--runs 9]

Every file is made here of a torus whose faces, area and names are known. Times are processor time,
the least of several runs; of whole commands, imports included (`render` with a style, `extract`
without)."""

import argparse
import logging
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strokestyle.mesh.read import READERS, read_mesh
from strokestyle.mesh.read_with_trimesh import read_with_trimesh

EXAMPLES = Path(__file__).parent.parent / "examples"
LARGE = (300, 160)  # quads about a torus and through it, to be timed
SMALL = (12, 8)  # and to be right or wrong about


class Case(NamedTuple):
    """A file, and what a reader must find in it; `faces` None: it must be refused."""

    name: str
    data: bytes
    faces: int | None
    vertices: int = 0
    part_names: tuple[str, ...] = ("",)


def torus(around, through):
    """Vertices (V, 3) and quads (F, 4) of a torus."""
    u, v = np.meshgrid(*(np.arange(n) * (2 * np.pi / n) for n in (around, through)), indexing="ij")
    r = 1.0 + 0.4 * np.cos(v)
    vertices = np.stack([r * np.cos(u), r * np.sin(u), 0.4 * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = (grid.ravel() for grid in np.indices((around, through)))
    a, b = (i + 1) % around * through, i * through
    k = (j + 1) % through
    return vertices.astype(np.float32).astype(float), np.stack([b + j, a + j, a + k, b + k], axis=1)


def triangles(quads):
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def half_cut(quads):
    """The first half of the quads as two triangles each, the others whole."""
    half = len(quads) // 2
    return [*triangles(quads[:half]).tolist(), *quads[half:].tolist()]


def area(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


# ------------------------------------------------------------------------------------------- files


def obj(vertices, polygons, corner="{}", before=None):
    """An OBJ file; `before` has lines to put before the polygon of that number."""
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*point) for point in vertices]
    for i, polygon in enumerate(polygons):
        lines += [before[i]] if before and i in before else []
        lines.append("f " + " ".join(corner.format(k + 1) for k in polygon))
    return ("\n".join(lines) + "\n").encode()


def ply(vertices, polygons, form="ascii"):
    header = f"ply\nformat {form} 1.0\nelement vertex {len(vertices)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += f"element face {len(polygons)}\nproperty list uchar int vertex_indices\nend_header\n"
    if form == "ascii":
        rows = [" ".join(f"{x:.9g}" for x in point) for point in vertices]
        rows += [" ".join(map(str, [len(polygon), *polygon])) for polygon in polygons]
        return (header + "\n".join(rows) + "\n").encode()
    order = ">" if "big" in form else "<"
    body = [np.asarray(vertices, order + "f4").tobytes()]
    body += [bytes([len(p)]) + np.asarray(p, order + "i4").tobytes() for p in polygons]
    return header.encode() + b"".join(body)


def stl(vertices, faces):
    table = np.zeros(len(faces), [("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("c", "<u2")])
    table["corner"] = vertices[faces]
    return b" " * 80 + np.array(len(faces), "<u4").tobytes() + table.tobytes()


def stl_text(vertices, faces):
    lines = ["solid x"]
    for face in faces:
        corners = ["vertex {:.9g} {:.9g} {:.9g}".format(*vertices[k]) for k in face]
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid x", ""]).encode()


def off(vertices, faces, colour=""):
    rows = [" ".join(f"{x:.9g}" for x in point) for point in vertices]
    rows += [" ".join(map(str, [len(face), *face])) + colour for face in faces]
    return (f"OFF\n{len(vertices)} {len(faces)} 0\n" + "\n".join(rows) + "\n").encode()


def obj_with_seams(vertices, faces):
    """Every corner with a place of its own in the texture, as at a seam."""
    places = "vt 0 0\n" * (3 * len(faces))
    rows = [" ".join(f"{k + 1}/{3 * i + c + 1}" for c, k in enumerate(face)) for i, face in
            enumerate(faces)]  # fmt: skip
    return obj(vertices, []) + (places + "".join(f"f {row}\n" for row in rows)).encode()


def ply_of_strips(vertices):
    """The torus SMALL, a strip of triangles around each of its rings, all in one list."""
    around, through = SMALL
    strip = []
    for i in range(around):
        one, two = ((i + k) % around * through + np.arange(through) for k in (0, 1))
        pairs = np.stack([two, one], axis=1).ravel().tolist()
        strip += [*pairs, *pairs[:2], -1]
    data = ply(vertices, [strip])
    return data.replace(b"element face", b"element tristrips").replace(b"uchar int", b"int int")


def block_letter():
    """A letter U: vertices and polygons, two of them with eight corners."""
    front = [(2, 3), (2, 1), (1, 1), (1, 3), (0, 3), (0, 0), (3, 0), (3, 3)]
    points = np.array([(x, y, z) for z in (0, -1) for x, y in front], float)
    sides = [[i, i + 8, (i + 1) % 8 + 8, (i + 1) % 8] for i in range(8)]
    return points, [list(range(8)), list(range(15, 7, -1)), *sides]


LETTER_AREA = 30.0


def cases():
    """Name of a format, its files."""
    points, quads = torus(*SMALL)
    letter = block_letter()
    faces, n = triangles(quads), len(points)
    count = len(faces)
    plain = obj(points, faces)
    mixed = half_cut(quads)
    objects = {0: "o body", count // 2: "o wheel"}
    groups = {0: "g body", count // 2: "g wheel"}
    materials = {0: "usemtl red", count // 2: "usemtl blue"}
    continued = plain.replace(b"f 1 ", b"f 1 \\\n ", 1)
    binary = stl(points, faces)
    return {
        "obj": [
            Case("triangles", plain, count, n),
            Case("quads", obj(points, quads), count, n),
            Case("two objects", obj(points, faces, "{}", objects), count, n, ("body", "wheel")),
            Case("two groups", obj(points, faces, "{}", groups), count, n, ("body", "wheel")),
            Case("two materials", obj(points, faces, "{}", materials), count, n, ("red", "blue")),
            Case("seams of a texture", obj_with_seams(points, faces), count, n),
            Case("a line that goes on in the next", continued, count, n),
            Case("a face without its vertex", plain + b"f 1 2 9999\n", None),
            Case("a vertex of two numbers", b"v 0 0\n" + plain, None),
            Case("a concave polygon", obj(*letter), 28),
            Case("lines alone", obj(points, []) + b"l 1 2 3\n", None),
        ],
        "ply": [
            Case("text", ply(points, faces), count, n),
            Case("binary", ply(points, faces, "binary_little_endian"), count, n),
            Case("binary, big end first", ply(points, quads, "binary_big_endian"), count, n),
            Case("text, triangles and quads", ply(points, mixed), count, n),
            Case("binary, triangles and quads", ply(points, mixed, "binary_little_endian"),
                 count, n),
            Case("text, cut short", ply(points, faces)[:-400], None),
            Case("a concave polygon", ply(*letter), 28),
            Case("text, lines end in CR", ply(points, faces).replace(b"\n", b"\r"), count, n),
            Case("strips of triangles", ply_of_strips(points), count, n),
        ],
        "stl": [
            Case("binary", binary, count),
            Case("text", stl_text(points, faces), count, 0, ("x",)),
            Case("binary, two bytes too many", binary + b"\0\0", count),
            Case("text, lines end in CR", stl_text(points, faces).replace(b"\n", b"\r"),
                 count, 0, ("x",)),
        ],
        "off": [
            Case("triangles", off(points, faces), count, n),
            Case("a concave polygon", off(*letter), 28),
            Case("comments", off(points, faces).replace(b"\n", b" # x\n# y\n"), count, n),
            Case("a number a line", off(points, faces).replace(b" ", b"\n"), count, n),
            Case("colours of faces", off(points, faces, " 255 0 0"), count, n),
            Case("cut short", off(points, faces)[:-400], None),
            Case("binary", b"OFF BINARY\n" + bytes(200), None),
        ],
    }  # fmt: skip


# ---------------------------------------------------------------------------------- right or wrong


def verdict(read, path, case):
    """ "right", or what is wrong."""
    try:
        found = read(path)
    except (ValueError, OSError):
        return "right" if case.faces is None else "refused"
    if not len(found.faces):
        return "right" if case.faces is None else "refused"
    if case.faces is None:
        return "read in silence"
    if len(found.faces) != case.faces:
        return f"{len(found.faces)} faces of {case.faces}"
    points, quads = torus(*SMALL)
    true = {2 * len(quads): area(points, triangles(quads)), 28: LETTER_AREA}.get(case.faces)
    if true and abs(area(found.vertices, found.faces) / true - 1.0) > 1e-5:
        return "wrong area"
    if set(found.part_names) != set(case.part_names):
        return "parts: " + ", ".join(f"'{name}'" for name in found.part_names)
    if case.vertices and len(found.vertices) != case.vertices:
        return f"{len(found.vertices)} vertices of {case.vertices}"
    return "right"


def print_verdicts(folder):
    print("| file | read_mesh | trimesh alone |\n| --- | --- | --- |")
    for form, files in cases().items():
        for case in files:
            path = folder / f"x.{form}"
            path.write_bytes(case.data)
            ours, theirs = (verdict(read, path, case) for read in (read_mesh, read_with_trimesh))
            print(f"| {form}: {case.name} | {ours} | {theirs} |")


# -------------------------------------------------------------------------------------------- time


def least(work, runs):
    """Processor milliseconds."""
    best = np.inf
    for _ in range(runs):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return 1e3 * best


def print_times(folder, runs):
    points, quads = torus(*LARGE)
    faces = triangles(quads)
    files = {
        "obj": obj(points, faces),
        "obj, quads": obj(points, quads),
        "ply, text": ply(points, faces),
        "ply, binary": ply(points, faces, "binary_little_endian"),
        "ply, triangles and quads": ply(points, half_cut(quads), "binary_little_endian"),
        "stl, binary": stl(points, faces),
        "stl, text": stl_text(points, faces),
        "off": off(points, faces),
    }
    print(f"\n| {len(faces)} triangles | read_mesh | trimesh alone | ratio |")
    print("| --- | --- | --- | --- |")
    for name, data in files.items():
        path = folder / f"large.{name[:3]}"
        path.write_bytes(data)
        ours = least(lambda: read_mesh(path), runs)  # noqa: B023
        try:
            theirs = least(lambda: read_with_trimesh(path), runs)  # noqa: B023
        except ValueError:
            print(f"| {name} | {ours:.1f} ms | refused | |")
            continue
        print(f"| {name} | {ours:.1f} ms | {theirs:.1f} ms | {theirs / ours:.1f} |")


WHOLE = """
import sys
import strokestyle.mesh.read as read
if sys.argv.pop(1) == "trimesh":
    read.READERS.clear()
from strokestyle.cli import main
main()
"""
IMPORT = """
import time
import strokestyle.mesh.surface, strokestyle.extract.pipeline, strokestyle.svg.write
start = time.process_time()
import trimesh
print(time.process_time() - start)
"""


def processor_time(*command):
    """Processor seconds of a process, imports included."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", *map(str, command)], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def print_imports(folder, runs, style):
    times = [subprocess.run([sys.executable, "-c", IMPORT], check=True, capture_output=True).stdout
             for _ in range(runs)]  # fmt: skip
    print(f"\nimport trimesh, in a process that draws: {1e3 * min(map(float, times)):.0f} ms")
    shape = EXAMPLES / "shapes" / "teapot.ply"
    words = ("render", style, shape) if style else ("extract", shape)
    found = {"ours": [], "trimesh": []}
    for _ in range(runs):
        for who, seconds in found.items():
            seconds.append(processor_time(WHOLE, who, *words, "-o", folder / "x.svg", "-q"))
    ours, theirs = (min(seconds) for seconds in found.values())
    print(f"{words[0]} {shape.name}, whole process: {ours:.2f} s; read by trimesh: {theirs:.2f} s, "
          f"{theirs / ours:.2f} times as long")  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--style", help="a model that `strokestyle fit` wrote: render is timed")
    parser.add_argument("--runs", type=int, default=9)
    args = parser.parse_args()
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    import trimesh

    print(f"trimesh {trimesh.__version__}; ours: {', '.join(READERS)}\n")
    with tempfile.TemporaryDirectory() as folder:
        print_verdicts(Path(folder))
        print_times(Path(folder), args.runs)
        print_imports(Path(folder), args.runs, args.style)


if __name__ == "__main__":
    main()
