"""PLY files of all kinds, written here byte by byte."""

import warnings

import numpy as np
import pytest
import shapes
import trimesh

from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.read import read_mesh
from strokestyle.mesh.read_ply import read_ply
from strokestyle.mesh.read_with_trimesh import read_with_trimesh
from strokestyle.mesh.surface import load_surface

FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
         "float": "f4", "double": "f8", "uint8": "u1", "int32": "i4", "float64": "f8",
         "int64": "i8"}  # fmt: skip
POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 2.5), (1, 0, 2)]
MIXED = [[0, 1, 2, 3], [0, 1, 5, 4], [0, 3, 4], [2, 1, 5], [0, 1, 2], [0, 1, 5, 4]]


def ply(form, *elements, comments=(), ends="\n", body_ends="\n"):
    """A PLY file of elements (name, columns, rows); a column is "float x" or "list uchar int v"."""
    header = ["ply", f"format {form} 1.0", *comments]
    body = b""
    order = ">" if "big" in form else "<"
    for name, columns, rows in elements:
        header += [f"element {name} {len(rows)}", *(f"property {column}" for column in columns)]
        for row in rows:
            words = []
            for column, value in zip(columns, row, strict=True):
                kinds = column.split()
                lists = kinds[0] == "list"
                if lists:
                    words.append((kinds[1], [len(value)]))
                words.append((kinds[-2], value if lists else [value]))
            if form == "ascii":
                body += " ".join(f"{x:.9g}" for _, many in words for x in many).encode()
                body += body_ends.encode()
            else:
                for kind, many in words:
                    body += np.array(many).astype(order + TYPES[kind]).tobytes()
    return ends.join([*header, "end_header", ""]).encode() + body


def vertex(points=POINTS, kind="float"):
    return "vertex", [f"{kind} {axis}" for axis in "xyz"], points


def face(polygons, count="uchar", corner="int", name="vertex_indices"):
    return "face", [f"list {count} {corner} {name}"], [(polygon,) for polygon in polygons]


def sides(found):
    """The directed sides of all polygons: those of the triangles, less those that cancel."""
    a = found.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()
    return sorted(side for side in a if a.count(side) > a.count(side[::-1]))


def area(found):
    a, b, c = (found.vertices[found.faces[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("number", ["float", "double", "float64"])
@pytest.mark.parametrize("count, corner", [("uchar", "int"), ("char", "uint"), ("uint8", "ushort"),
                                           ("int", "uchar"), ("ushort", "int64")])  # fmt: skip
@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index", "corners"])
@pytest.mark.parametrize("polygons", [MIXED, MIXED[:2], MIXED[2:4]])
def test_polygons(form, number, count, corner, name, polygons):
    found = read_ply(ply(form, vertex(kind=number), face(polygons, count, corner, name)))
    assert np.array_equal(found.vertices, POINTS) and found.vertices.dtype == np.float64
    assert found.faces.dtype == np.int64 and not found.part.any() and found.part_names == ("",)
    assert np.bincount(found.polygon).tolist() == [len(polygon) - 2 for polygon in polygons]
    for i, polygon in enumerate(polygons):
        assert set(found.faces[found.polygon == i].ravel()) == set(polygon)
        turned = [polygon.index(corner) for corner in found.faces[found.polygon == i][0]]
        assert np.argmin(turned) in (0, 1, 2) and turned != sorted(turned, reverse=True)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("polygons", [MIXED, MIXED[:2]])
@pytest.mark.parametrize("faces_first", [False, True])
def test_what_else_stands_in_a_file_is_passed_over(form, polygons, faces_first):
    """Single numbers and lists before and behind, in vertices too, and other elements."""
    rows = [(7, x, [1, 2, 3][: i % 4], y, 9, z, [], 5) for i, (x, y, z) in enumerate(POINTS)]
    columns = ["uchar red", "float x", "list uchar short weights", "float y", "short s", "float z",
               "list int double none", "double q"]  # fmt: skip
    places = ["char flag", "list uchar float texcoord", "list uchar int vertex_indices", "short n",
              "list char int more"]  # fmt: skip
    faces = [(1, [0.5] * (2 * len(p)), p, -3, [4] * (i % 2)) for i, p in enumerate(polygons)]
    elements = [("vertex", columns, rows), ("face", places, faces)]
    if faces_first:
        elements.reverse()
    other = "material", ["uchar r", "list uchar char name"], [(1, [2, 3]), (4, [])]
    edge = "edge", ["int vertex1", "int vertex2"], [(0, 1)]
    nothing = "empty", [], []
    found = read_ply(ply(form, other, nothing, elements[0], other, elements[1], edge))
    plain = read_ply(ply(form, vertex(), face(polygons)))
    assert np.array_equal(found.vertices, plain.vertices)
    assert np.array_equal(found.faces, plain.faces)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_ends_of_lines(form, ends):
    comments = ["comment element face 99", "obj_info made by hand", "comment TextureFile no.png"]
    points = [(2.6393635e-18, y, z) for _, y, z in POINTS]  # floats whose bytes may be CR or LF
    points[0] = (np.frombuffer(b"\n\r\n\r", "<f4")[0], *points[0][1:])
    points[1] = (np.frombuffer(b"\n\r\n\r", ">f4")[0], *points[1][1:])
    data = ply(form, vertex(points), face(MIXED), comments=comments, ends=ends, body_ends=ends)
    found = read_ply(data)
    assert np.allclose(found.vertices, points, rtol=1e-6) and len(found.faces) == 9


def test_corners_written_as_floats():
    for form in FORMS:
        found = read_ply(ply(form, vertex(), face(MIXED, corner="float")))
        assert len(found.faces) == 9 and found.faces.dtype == np.int64


def strips_of(form, strips, kind="int", points=POINTS):
    return ply(form, vertex(points), ("tristrips", [f"list int {kind} vertex_indices"],
                                      [(strip,) for strip in strips]))  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_strips_of_triangles(form):
    found = read_ply(strips_of(form, [[0, 1, 3, 2, -1, 4, 5, 0], [1, 2], [], [3, 3, 0, 4]]))
    assert found.faces.tolist() == [[0, 1, 3], [3, 1, 2], [4, 5, 0], [0, 3, 4]]
    assert found.polygon.tolist() == [0, 1, 2, 3]
    one = read_ply(strips_of(form, [[0, 1, 3, 2, -1, 0, 1, 4]], "uint"))
    assert one.faces.tolist() == [[0, 1, 3], [3, 1, 2], [0, 1, 4]]
    many = np.random.default_rng(0).normal(size=(200, 3))
    bytes_ = read_ply(strips_of(form, [[198, 199, 130, -1, 0, 1, 2]], "uchar", many))
    if form != "ascii":  # 255 is -1
        assert bytes_.faces.tolist() == [[198, 199, 130], [0, 1, 2]]


def test_a_strip_of_a_torus_is_closed_and_turned_alike(tmp_path):
    shape = shapes.torus(1, 0.4, 12, 8)
    rows = [(np.arange(8) + 8 * i) % 96 for i in range(13)]
    strip = []
    for one, two in zip(rows[:-1], rows[1:], strict=True):
        pairs = np.stack([two, one], axis=1).ravel().tolist()
        strip += [*pairs, *pairs[:2], -1]
    path = tmp_path / "x.ply"
    path.write_bytes(strips_of("binary_little_endian", [strip], points=shape.vertices))
    surface = load_surface(path)
    assert len(surface.faces) == 192 and (surface.edge_face_count == 2).all()
    found = read_mesh(path)
    assert len(sides(found)) == 0


@pytest.mark.parametrize("form", FORMS)
def test_faces_and_strips_together(form):
    strips = "tristrips", ["list int int vertex_indices"], [([3, 2, 4],)]
    found = read_ply(ply(form, strips, face(MIXED[:1]), vertex()))
    assert len(found.faces) == 3 and found.faces[2].tolist() == [3, 2, 4]
    assert found.polygon.tolist() == [0, 0, 1]


def test_many_corners_in_a_char():
    t = np.arange(200) * (2 * np.pi / 200)
    circle = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    data = ply("binary_little_endian", vertex(circle), face([range(200), [0, 1, 2]], "uchar"))
    found = read_ply(data.replace(b"list uchar", b"list char"))
    assert len(found.faces) == 199 and area(found) == pytest.approx(100 * np.sin(np.pi / 100), 1e-3)


def test_faces_of_a_plane_and_concave_ones():
    letter = [(2, 3), (2, 1), (1, 1), (1, 3), (0, 3), (0, 0), (3, 0), (3, 3)]
    for form in FORMS:
        data = ply(form, ("vertex", ["float x", "float y"], letter), face([range(8)]))
        found = read_ply(data)
        assert not found.vertices[:, 2].any() and area(found) == pytest.approx(7)


@pytest.mark.parametrize("form", FORMS)
def test_faces_of_few_corners_are_left_out_and_warned_of(form):
    with pytest.warns(MeshWarning, match="left out: 3 of its 4 faces"):
        found = read_ply(ply(form, vertex(), face([[0, 1], [], [0, 1, 2], [3]])))
    assert found.faces.tolist() == [[0, 1, 2]]


def test_the_same_as_by_trimesh(tmp_path):
    data = trimesh.Trimesh(*shapes.torus(1, 0.4, 12, 8), process=False).export(file_type="ply")
    path = tmp_path / "x.ply"
    path.write_bytes(data)
    ours, theirs = read_ply(data), read_with_trimesh(path)
    assert np.array_equal(ours.vertices[ours.faces], theirs.vertices[theirs.faces])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("polygons, name", [(MIXED, "face"), (MIXED[:2], "face"), ([], "vertex")])
def test_cut_short(tmp_path, form, polygons, name):
    """Cut behind each byte of the body: refused, and it says how many are there."""
    whole = ply(form, vertex(), face(polygons) if polygons else face(MIXED))
    if not polygons:
        whole = whole[: whole.index(b"end_header\n") + 11 + (60 if form == "ascii" else 72)]
    path = tmp_path / "x.ply"
    said = set()
    body = whole.index(b"end_header\n") + 11
    for end in range(body, len(whole) - 2):
        path.write_bytes(whole[:end])
        with pytest.raises(ValueError) as caught:
            read_mesh(path)
        assert str(caught.value).startswith(f"{path}: ") and "cut short: " in str(caught.value)
        said.add(str(caught.value).split("cut short: ")[1])
    if name == "face":
        assert {f"{k} of its {len(polygons)} faces are there)" for k in range(len(polygons))} < said
    assert {f"{k} of its 6 vertices are there)" for k in range(6)} <= said


def header(*lines):
    return "\n".join(["ply", *lines, "end_header", ""]).encode()


XYZ = "property float x\nproperty float y\nproperty float z"
LIST = "property list uchar int vertex_indices"


@pytest.mark.parametrize(
    "data, message",
    [
        (b"solid", "does not begin with 'ply'"),
        (b"plywood\nformat ascii 1.0", "does not begin with 'ply'"),
        (b"ply\nformat ascii 1.0\nelement vertex 3\n", "its header has no end"),
        (header("element vertex 0"), "its format is ''"),
        (header("format gzip 1.0"), "its format is 'gzip'"),
        (header("format ascii 1.0", "element vertex x"), "an element of 'x' rows"),
        (header("format ascii 1.0", "element vertex -3"), "an element of '-3' rows"),
        (header("format ascii 1.0", "property float x"), "before all elements"),
        (header("format ascii 1.0", "element vertex 1", "property quad x"), "'property quad x'"),
        (header("format ascii 1.0", "element vertex 1", "property x"), "'property x'"),
        (header("format ascii 1.0", "element vertex 1", "property float y") + b"1\n", "no x and y"),
        (header("format ascii 1.0", "element vertex 1", XYZ, "element face 1",
                "property float v") + b"1 2 3 0\n", "no list of corners"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 x 0\n3 0 1 2\n", "line 12: 'x' is not a number"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 x\n", "line 13: 'x' is not a number"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n", "face 1 has a list of length -3"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\nnan 0 1 2\n", "face 1 has a list of length nan"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n2.5 0 1 2\n", "face 1 has a list of length 2.5"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 2", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\ninf 0 1 2\n", "face 2 has a list of length inf"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 2", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n",
         "face 2 of 2 names vertex 3, which does not exist: there are 3"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "face 1 of 1 names vertex -1"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 4294967295\n", "names vertex 4294967295, which"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element face 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 0.5\n", "face 1 of 1 names vertex 0.5"),
        (header("format ascii 1.0", "element vertex 3", XYZ, "element tristrips 1", LIST)
         + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "strip 1 of 1 names vertex 7"),
        (header("format ascii 1.0", "element vertex 2", XYZ, "element edge 12",
                "property int vertex1", "property int vertex2") + b"0 0 0\n1 0 0\n" + b"0 1\n" * 12,
         "no faces in it (12 lines): lines cannot be drawn"),
        (header("format ascii 1.0", "element vertex 2", XYZ) + b"0 0 0\n1 0 0\n",
         "no faces in it (2 points): a point cloud"),
        (header("format ascii 1.0", "element vertex 0", XYZ), "no faces in it: damaged"),
        (header("format binary_little_endian 1.0", f"element vertex {10**15}", XYZ),
         "0 of its 1000000000000000 vertices"),
        (header("format binary_little_endian 1.0", "element vertex 0", XYZ,
                f"element face {10**15}", LIST) + b"\0" * 9, "9 of its 1000000000000000 faces"),
        ("ply\nformat ascii 1.0\n".encode("utf-16"), "UTF-16"),
        ("ply\nformat ascii 1.0\n".encode("utf-16-be"), "UTF-16"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(tmp_path, data, message):
    path = tmp_path / "x.ply"
    path.write_bytes(data)
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_words_behind_the_last_number_and_a_mark_before_the_first():
    data = ply("ascii", vertex(), face(MIXED))
    assert len(read_ply(b"\xef\xbb\xbf" + data + b"end of file\n").faces) == 9


def test_damage_anywhere_is_an_error_or_a_mesh():
    """Bytes changed at random: never another exception, a warning of numpy's, or a bad face."""
    rng = np.random.default_rng(0)
    strips = "tristrips", ["list int short vertex_indices"], [([3, 2, 4, -1, 0, 1, 2],)]
    for form in FORMS:
        data = np.frombuffer(ply(form, vertex(), face(MIXED), strips), np.uint8)
        for _ in range(300):
            bad = data.copy()
            at = rng.integers(0, len(bad), rng.integers(1, 4))
            bad[at] = rng.choice([rng.integers(0, 256), 32, 48, 57, 45, 255])
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    warnings.simplefilter("ignore", MeshWarning)
                    found = read_ply(bad.tobytes())
            except ValueError:
                continue
            assert found.faces.size == 0 or found.faces.max() < len(found.vertices)
