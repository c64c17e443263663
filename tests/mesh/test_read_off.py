"""OFF files of all dialects, and what is wrong with the others."""

import warnings

import numpy as np
import pytest
import shapes
import trimesh

from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.read import read_mesh
from strokestyle.mesh.read_off import read_off
from strokestyle.mesh.read_with_trimesh import read_with_trimesh
from strokestyle.mesh.surface import load_surface

POINTS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
ROWS = [" ".join(map(str, point)) for point in POINTS]
FACES = ["4 " + " ".join(map(str, quad)) for quad in QUADS]


def off(head="OFF", counts="8 6 12", rows=ROWS, faces=FACES, ends="\n"):
    return ends.join([head, counts, *rows, *faces, ""]).encode()


def behind(lines, *words):
    return [f"{line} {words[i % len(words)]}" for i, line in enumerate(lines)]


def commented(lines):
    return [text for line in lines for text in ("# x 1 2", "", f"{line} # 3 4")]


def broken(data):
    """Each number on a line of its own."""
    return b"\n".join(data.split())


CUBES = {
    "plain": off(),
    "no edges": off(counts="8 6"),
    "no edges, colours of faces": off(counts="8 6", faces=behind(FACES, "255 0 0")),
    "counts on lines of their own": off(counts="8\n6\n12", faces=behind(FACES, "255 0 0")),
    "edges on a line of their own": off(counts="8 6\n12", rows=behind(ROWS, "1 0 0"),
                                        faces=behind(FACES, "255 0 0")),
    "wrong edges": off(counts="8 6 99999"),
    "counts on the header line": off("OFF 8 6 12", ""),
    "counts in the header's word": off("OFF8 6 0", ""),
    "no header": off(""),
    "lower case": off("off"),
    "comments": b"# made by hand\n" + off("OFF # header", "8 6 12 # counts", commented(ROWS),
                                          commented(FACES)),
    "CR": off(ends="\r"),
    "CRLF": off(ends="\r\n"),
    "a mark": b"\xef\xbb\xbf" + off(),
    "blank lines and tabs": off(ends="\n\n \t\n").replace(b" ", b"\t "),
    "a number a line": broken(off()),
    "a number a line, no edges": broken(off(counts="8 6")),
    "a face a number a line": off(faces=" ".join(FACES).split()),
    "a vertex a number a line": off(rows=" ".join(ROWS).split()),
    "all on one line": off(ends=" "),
    "two on a line": off(rows=[" ".join(ROWS[i : i + 2]) for i in range(0, 8, 2)],
                         faces=[" ".join(FACES[i : i + 2]) for i in range(0, 6, 2)]),
    "all faces on one line": off(faces=[" ".join(FACES)]),
    "colours of faces": off(faces=behind(FACES, "255 0 0", "0.5 0.5 0.5 1", "7", "")),
    "the same colour of faces": off(faces=behind(FACES, "3 0 1 2")),
    "COFF": off("COFF", rows=behind(ROWS, "255 0 0 255")),
    "COFF of three": off("COFF", rows=behind(ROWS, "0.1 0.2 0.3"), faces=behind(FACES, "1 0 0")),
    "NOFF": off("NOFF", rows=behind(ROWS, "0 0 -1.5")),
    "STCNOFF": off("STCNOFF", rows=behind(ROWS, "0 0 1 1 0 0 1 0.5 0.5")),
    "COFF, broken": broken(off("COFF", rows=behind(ROWS, "255 0 0 255"))),
    "NOFF, faces broken": off("NOFF", rows=behind(ROWS, "0 0 1"), faces=" ".join(FACES).split()),
    "colours without saying so": off(rows=behind(ROWS, "255 0 0 255")),
    "colours of some": off(rows=behind(ROWS, "255 0 0 255", ""), faces=behind(FACES, "9", "")),
    "exponents": off(rows=[row.replace("1", "1.0E+00") for row in ROWS]),
    "words behind all": off() + b"the end\n",
}  # fmt: skip


@pytest.mark.parametrize("name", CUBES)
def test_dialects_of_a_cube(tmp_path, name):
    found = read_off(CUBES[name])
    assert np.array_equal(found.vertices, POINTS)
    assert found.faces.dtype == np.int64 and found.vertices.dtype == np.float64
    assert [sorted(set(found.faces[found.polygon == i].ravel())) for i in range(6)] == [
        sorted(quad) for quad in QUADS
    ]
    assert found.part_names == ("",) and not found.part.any() and len(found.faces) == 12
    path = tmp_path / "x.off"
    path.write_bytes(CUBES[name])
    surface = load_surface(path)
    assert (surface.edge_face_count == 2).all() and len(surface.faces) == 12


def test_polygons_of_many_corners_and_concave_ones():
    letter = [(2, 3), (2, 1), (1, 1), (1, 3), (0, 3), (0, 0), (3, 0), (3, 3)]
    rows = [f"{x} {y} {z}" for z in (0, 1) for x, y in letter]
    faces = ["8 " + " ".join(map(str, range(8))), "8 " + " ".join(map(str, range(15, 7, -1)))]
    faces += [f"4 {i} {i + 8} {(i + 1) % 8 + 8} {(i + 1) % 8}" for i in range(8)]
    for data in (off("OFF", "16 10 0", rows, faces), broken(off("OFF", "16 10 0", rows, faces))):
        found = read_off(data)
        a, b, c = (found.vertices[found.faces[:, i]] for i in range(3))
        assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(30)
        assert abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6) == pytest.approx(7)


def test_the_same_as_by_trimesh(tmp_path):
    data = trimesh.Trimesh(*shapes.torus(1, 0.4, 12, 8), process=False).export(file_type="off")
    path = tmp_path / "x.off"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    ours, theirs = read_mesh(path), read_with_trimesh(path)
    assert np.array_equal(ours.vertices[ours.faces], theirs.vertices[theirs.faces])


def test_what_is_left_out_is_warned_of():
    with pytest.warns(MeshWarning, match="left out: 2 of its 6 faces, which have fewer than three"):
        found = read_off(off(faces=["1 0", "2 0 1", *FACES[2:]]))
    assert len(found.faces) == 8
    with pytest.warns(MeshWarning, match="left out: 2 lines behind the 4 faces"):
        assert len(read_off(off(counts="8 4 0")).faces) == 8


@pytest.mark.parametrize(
    "data, message",
    [
        (off()[:-9], "cut short: 5 of its 6 faces are there"),
        (off(faces=FACES[:2]), "cut short: 2 of its 6 faces are there"),
        (off(faces=behind(FACES[:3], "255 0 0 1")), "cut short: 3 of its 6 faces are there"),
        (broken(off())[:-8], "cut short: 5 of its 6 faces are there"),
        (off(rows=ROWS[:5], faces=[]), "cut short: 5 of its 8 vertices are there"),
        (broken(off(rows=ROWS[:5], faces=[]))[:-2], "cut short: 4 of its 8 vertices are there"),
        (off("OFF", "", [], []), "how many vertices and faces it has is not there"),
        (off("OFF", "8", [], []), "how many vertices and faces it has is not there"),
        (off("OFF BINARY"), "binary OFF is not read: save it as text"),
        (b"OFF BINARY\n" + b"\0\0\0\x08\0\0\0\x06\0\0\0\x0c" + b"\x3f\x80\0\0" * 40, "binary OFF"),
        (off("4OFF", rows=behind(ROWS, "1")), "more than x, y and z"),
        (off("nOFF\n3"), "more than x, y and z"),
        (off("STCN4nOFF\n3"), "more than x, y and z"),
        (off(counts="8 -6 0"), "it has -6 faces"),
        (off(counts="8.5 6 0"), "it has 8.5 vertices"),
        (off(counts="nan 6 0"), "it has nan vertices"),
        (off(counts="8 1e300 0"), "it has 1e+300 faces"),
        (off(counts="8 x 0"), "line 2: 'x' is not a number"),
        (off(rows=[*ROWS[:3], "0 one 2", *ROWS[4:]]), "line 6: 'one' is not a number"),
        (off(faces=[*FACES[:5], "4 1 5 7 8"]), "face 6 of 6 names vertex 8, which does not exist"),
        (off(faces=[*FACES[:5], "4 1 5 7 -1"]), "face 6 of 6 names vertex -1"),
        (off(faces=[*FACES[:5], "4 1 5 7 1.5"]), "face 6 of 6 names vertex 1.5"),
        (off(counts="8 0 0", faces=[]), "no faces in it (8 points): a point cloud"),
        (off(counts="0 0 0", rows=[], faces=[]), "no faces in it: damaged"),
        (b"PK\3\4" + b"\0" * 50, "is not a number"),
        (off().decode().encode("utf-16"), "UTF-16"),
        (off().decode().encode("utf-16-be"), "UTF-16"),
        (off().decode().encode("utf-32"), "UTF-32"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, data, message):
    path = tmp_path / "x.off"
    path.write_bytes(data)
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["plain", "all on one line", "COFF", "a number a line"])
def test_damage_anywhere_is_an_error_or_a_mesh(name):
    rng = np.random.default_rng(0)
    data = np.frombuffer(CUBES[name], np.uint8)
    for _ in range(300):
        bad = data.copy()
        at = rng.integers(0, len(bad), rng.integers(1, 4))
        bad[at] = rng.choice([rng.integers(0, 256), 32, 10, 57, 45])
        bad = bad[: rng.integers(1, len(bad))] if rng.random() < 0.3 else bad
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", MeshWarning)
                found = read_off(bad.tobytes())
        except ValueError:
            continue
        assert found.faces.size == 0 or found.faces.max() < len(found.vertices)
