"""OBJ files of all dialects, against trimesh and closed forms, and what is wrong with the
others."""

import json
import re
import struct
import warnings

import numpy as np
import pytest
import shapes
import trimesh

from strokestyle.mesh import read_obj as read_obj_module
from strokestyle.mesh.read import read_mesh
from strokestyle.mesh.read_obj import read_obj
from strokestyle.mesh.surface import load_surface, make_surface

SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def area(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_the_same_triangles_as_trimesh(tmp_path):
    rng = np.random.default_rng(0)
    shape = shapes.torus(1, 0.4, 12, 8)
    lines = [f"v {x} {y} {z}" for x, y, z in shape.vertices] + ["vt 0 0", "vn 0 0 1"]
    for face in shape.faces[rng.permutation(len(shape.faces))] + 1:
        form = rng.choice(["{}", "{}/1", "{}//1", "{}/1/1"])
        lines.append("f " + " ".join(form.format(corner) for corner in face))
    path = tmp_path / "x.obj"
    path.write_text("\n".join(lines))
    vertices, faces, part, names, _ = read_mesh(path)
    theirs = trimesh.load(path, process=False)
    corners = [np.sort(np.round(p[f], 12).reshape(-1, 9), axis=0) for p, f in
               ((vertices, faces), (theirs.vertices, theirs.faces))]  # fmt: skip
    assert np.array_equal(*corners)
    assert not part.any() and names == ("",) and faces.dtype == np.int64


@pytest.mark.parametrize(
    "faces",
    [
        b"f 1 2 3 4",
        b"f 1/1 2/1 3/1 4/1 # a comment",
        b"  f\t1//7   2//8 3//9\t4//6  ",
        b"f 1/2/3 2/3/4 3/4/5 4/5/6\r\ng side\rusemtl red\r\n# end",
        b"f -4 -3 -2 -1\nv 7 7 7\nv 8 8 8",
        b"f 1 2 \\\n 3 4",
        b"f 1 2 3\ns off\nf 1 3 4\np 1\nl 1 2",
        b"f 1 2 3\nf 1 2\nf 1\nf 1 3 4\nfo 1 2 3",
        b"f 1//3 2//3 3//3 4//3",
        b"f 1/ 2/ 3/ 4/",
        b"F 1/1/1 2//2 3 4",
        b"VN 0 0 1\nVT 1 1\nf 1 2 3\nF 1 3 4\nL 1 2",
    ],
)
def test_dialects_of_a_square(faces):
    vertices, faces, part, names, _ = read_obj(SQUARE + faces)
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]] and not part.any() and names == ("",)
    assert vertices[:4].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_polygons_are_fans():
    t = np.arange(7) / 7 * 2 * np.pi
    points = "".join(f"v {x:.9f} {y:.9f} 0\n" for x, y in zip(np.cos(t), np.sin(t), strict=True))
    vertices, faces, _, _, _ = read_obj((points + "f 1 2 3\nf 1 3 4 5 6 7\n").encode())
    assert faces[:, 0].tolist() == [0] * 5 and faces[:, 1:].tolist() == [
        [i, i + 1] for i in range(1, 6)
    ]
    assert area(vertices, faces) == pytest.approx(3.5 * np.sin(2 * np.pi / 7))


def test_a_letter_keeps_its_notch(tmp_path):
    """The front and back of a block U, two polygons of eight corners, and its eight sides."""
    front = [(2, 3), (2, 1), (1, 1), (1, 3), (0, 3), (0, 0), (3, 0), (3, 3)]
    points = [f"v {x} {y} {z}" for z in (0, -1) for x, y in front]
    sides = [f"f {i + 1} {i + 9} {(i + 1) % 8 + 9} {(i + 1) % 8 + 1}" for i in range(8)]
    path = tmp_path / "u.obj"
    path.write_text("\n".join([*points, "f 1 2 3 4 5 6 7 8", "f 16 15 14 13 12 11 10 9", *sides]))
    surface = load_surface(path)
    vertices = surface.original(surface.vertices)
    assert area(vertices, surface.faces) == pytest.approx(2 * 7 + 16)
    a, b, c = (vertices[surface.faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(7)
    assert (surface.edge_face_count == 2).all() and not surface.clashing_edges.any()


def test_triangles_know_their_polygon(tmp_path):
    path = tmp_path / "x.obj"
    more = b"v 2 2 2\nv 0 0 5\nv 2 0 5\nv 2 2 5\nv 1 1 5\nv 0 2 5\n"
    path.write_bytes(SQUARE + more + b"f 1 2 3 4\nf 1 2\nf 2 3 5\nf 6 7 8 9 10\n")
    polygon = read_mesh(path).polygon
    assert polygon[0] == polygon[1] and len(set(polygon)) == 3 and np.ptp(polygon[3:]) == 0
    surface = load_surface(path)
    assert np.unique(surface.polygon, return_counts=True)[1].tolist() == [2, 1, 3]
    plain = make_surface(read_mesh(path).vertices, read_mesh(path).faces)
    assert np.array_equal(plain.polygon, np.arange(len(plain.faces)))
    with pytest.raises(ValueError, match="polygon must have shape"):
        make_surface(np.eye(3), [[0, 1, 2]], polygon=[1, 2])


def test_vertices_may_carry_weights_and_colours():
    text = b"v 0 0 0 0.5 0.5 0.5\nv 1 0 0\nv 0 1e0 0 1 # w\nf 1 2 3\n"
    assert read_obj(text)[0].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert read_obj(b"v 0 0 0 1\nv 1 0 0 1\nv 0 1 -2.5E-1 1\nf 1 2 3")[0][2].tolist() == [
        0,
        1,
        -0.25,
    ]


def test_keywords_may_be_capitals():
    text = SQUARE + b"o Lid\ng Rim\nusemtl Red\nf 1 2 3\no Base\nf 1 3 4\n"
    capitals = text.replace(b"o L", b"O L").replace(b"g R", b"G R").replace(b"usemtl", b"USEMTL")
    for ours, theirs in zip(read_obj(text), read_obj(capitals.replace(b"v ", b"V ")), strict=True):
        assert np.array_equal(ours, theirs)


def test_objects_are_parts():
    text = (
        b"f 1 2 3\no body of it\nf 1 3 4\no wheel\nv 0 0 1\no unused\no body of it\nf 1 2 5\n"
        b"o wh\xe4el\nf 2 3 5 4"
    )
    _, faces, part, names, _ = read_obj(SQUARE + text)
    assert [names[i] for i in part] == ["", "body of it", "body of it", "wh\ufffdel", "wh\ufffdel"]
    assert len(names) == 3


def test_groups_are_parts_where_there_are_no_objects():
    text = b"f 1 2 3\ng default\nf 1 3 4\ng left arm\nf 1 2 3\ng hat\nf 1 3 4\ng left arm\nf 1 2 4"
    _, faces, part, names, _ = read_obj(SQUARE + text)
    assert [names[i] for i in part] == ["", "", "left arm", "hat", "left arm"] and len(names) == 3
    # an object that is everything tells nothing; two do
    assert set(read_obj(SQUARE + b"o all\n" + text)[3]) == {"", "left arm", "hat"}
    assert read_obj(SQUARE + b"o all\n" + text + b"\no one\nf 2 3 4")[3] == ("all", "one")


MATERIALS = b"usemtl red\nf 1 2 3\nusemtl\tblue  sky\nf 1 3 4\nusemtl red\nf 1 2 4\n"


@pytest.mark.parametrize(
    "before, names",
    [
        (b"", ["red", "blue sky", "red"]),
        (b"o all\n", ["red", "blue sky", "red"]),
        (b"g all of it\n", ["red", "blue sky", "red"]),
        (b"o all\ng default\n", ["red", "blue sky", "red"]),
        (b"mtllib no.mtl\n#usemtl green\n", ["red", "blue sky", "red"]),
        (b"o one\nf 2 3 4\no two\n", ["one", "two", "two", "two"]),
        (b"o all\ng one\nf 2 3 4\ng two\n", ["one", "two", "two", "two"]),
        (b"g one\nf 2 3 4\ng two big\n", ["one", "two big", "two big", "two big"]),
        (b"o all\nf 2 3 4\n", ["", "red", "blue sky", "red"]),
    ],
)
def test_materials_are_parts_where_objects_and_groups_make_fewer_than_two(before, names):
    found = read_obj(SQUARE + before + MATERIALS)
    assert [found.part_names[i] for i in found.part] == names
    assert len(found.part_names) == len(set(names))


def test_of_one_part_the_name_is_the_objects_else_the_groups_else_the_materials():
    for text, name in [
        (b"o a\ng b\nusemtl c\n", "a"), (b"g b\nusemtl c\n", "b"), (b"usemtl c\n", "c"),
        (b"g default\nusemtl c\n", "c"), (b"usemtl None\n", ""),
        (b"usemtl (null)\ng default\n", ""), (b"usemtlc\n", ""), (b"usemtl\n", ""), (b"o\ng\n", ""),
    ]:  # fmt: skip
        assert read_obj(SQUARE + text + b"f 1 2 3\nf 1 3 4\n").part_names == (name,)
    assert read_obj(SQUARE + b"f 1 2 3\nusemtl").part_names == ("",)


def test_a_drawing_in_the_plane():
    for text in (b"v 0 0\nv 1 0\nv 1 1\nv 0 1\nf 1 2 3 4", b"v 0 0 # no z\nv 1 0\nv 1 1\nf 1 2 3"):
        found = read_obj(text)
        assert found.vertices[:3].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
        assert len(found.faces) == text.count(b"v ") - 2


@pytest.mark.parametrize(
    "text, message",
    [
        (b"l 1 2", "left out: 1 line; only faces are drawn"),
        (
            b"l 1 2 3 4\nl 1/1 2/2\nsurf 0 1 0 1 1 2 3",
            "left out: 2 lines, 1 free-form surface; only",
        ),
        (b"f 1 2", "left out: 1 of its 2 faces, which have fewer than three corners"),
        (b"cstype bspline\ndeg 3\ncurv 0 1 1 2 3 4\ncurv 0 1 1 2 3 4", "2 free-form curves; only"),
        (b"lx 1 2\n#l 1 2\nsurface 3\ncurv2 1 2", ""),
    ],
)
def test_what_is_left_out_is_warned_of_by_name(tmp_path, text, message):
    path = tmp_path / "x.obj"
    path.write_bytes(SQUARE + b"f 1 2 3 4\n" + text)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        assert len(read_mesh(path).faces) == 2
    said = [str(one.message) for one in found]
    assert len(said) == bool(message)
    assert not message or (said[0].startswith(f"{path}: ") and message in said[0])


@pytest.mark.parametrize(
    "text, message",
    [
        (b"l 1 2 3", "no faces in it (1 line): lines cannot be drawn"),
        (b"o wire\n" + b"l 1 2\n" * 12, "no faces in it (12 lines): lines cannot be drawn"),
        (b"p 1 2 3", "no faces in it (4 points): a point cloud"),
        (b"", "no faces in it (4 points): a point cloud"),
        (b"cstype bezier\ncurv 0 1 1 2 3 4", "no faces in it (1 free-form curve): export it as a"),
        (
            b"l 1 2\n" + b"surf 0 1 0 1 1 2 3 4\n" * 3,
            "(1 line, 3 free-form surfaces): export it as",
        ),
    ],
)
def test_what_has_no_faces_is_named(tmp_path, text, message):
    path = tmp_path / "x.obj"
    path.write_bytes(SQUARE + text)
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ") and message in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le"])
def test_text_of_two_bytes_a_letter_is_said(tmp_path, encoding):
    path = tmp_path / "x.obj"
    path.write_bytes((SQUARE + b"f 1 2 3 4\n").decode().encode(encoding))
    with pytest.raises(ValueError, match="in UTF-16 or UTF-32: save it as plain text, in UTF-8"):
        read_mesh(path)
    if "utf-16" in encoding:  # letters of other scripts, which have no zeros
        text = "# \u6b63\u65b9\u5f62 \u3000 Gr\u00f6\u00dfe\n" + SQUARE.decode()
        path.write_bytes(text.encode(encoding))
        with pytest.raises(ValueError, match="in UTF-16 or UTF-32"):
            read_mesh(path)
    path.write_bytes(b"\xef\xbb\xbf" + SQUARE + b"f 1 2 3 4\n")
    assert len(read_mesh(path).faces) == 2  # a mark alone does no harm


def glb(nodes, meshes):
    """A binary glTF file of square plates: nodes as in the file, and of each mesh how many pieces
    it has."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4").tobytes()
    blob = corners + np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
    piece = {"attributes": {"POSITION": 0}, "indices": 1}
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 12},
    ]
    content = {
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
        "meshes": [{**mesh, "primitives": [piece] * mesh["primitives"]} for mesh in meshes],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }  # fmt: skip
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A)
        + text
        + struct.pack("<II", len(blob), 0x004E4942)
        + blob
    )
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def test_parts_of_a_scene_have_the_names_of_nodes_then_of_meshes_and_none_that_were_made_up(
    tmp_path,
):
    nodes = [
        {"name": "body", "mesh": 0}, {"name": "body_part", "mesh": 1, "translation": [2, 0, 0]},
        {"mesh": 1, "translation": [4, 0, 0]}, {"mesh": 2, "translation": [6, 0, 0]},
    ]  # fmt: skip
    path = tmp_path / "scene.glb"
    path.write_bytes(
        glb(
            nodes,
            [
                {"name": "two", "primitives": 2},
                {"name": "plate", "primitives": 1},
                {"primitives": 1},
            ],
        )
    )
    vertices, faces, part, names, _ = read_mesh(path)
    left = vertices[faces].min(axis=(1, 2), where=[True, False, False], initial=9)
    assert {(names[p], round(x)) for p, x in zip(part, left, strict=True)} == {
        ("body", 0), ("body_part", 2), ("plate", 4), ("", 6),
    }  # fmt: skip


@pytest.mark.parametrize(
    "text, message",
    [
        (b"v 0 0 0\nv 1 0\nf 1 2 1", "line 2, 'v 1 0': a vertex has three coordinates"),
        (
            SQUARE + b"\r\n# no\r\nf 1 2 9",
            "line 7, 'f 1 2 9': it names a vertex that does not exist: there are 4, from 1",
        ),
        (SQUARE + b"f 1 2 0", "line 5, 'f 1 2 0'"),
        (SQUARE + b"f -5 1 2", "does not exist: there are 4"),
        (b"v 1 2 3\nvn 0 0 1\nv 1 x 3\nf 1 2 1", "line 3, 'v 1 x 3': not a number"),
        (SQUARE + b"f 1 2 3\nf 1 2.5 3", "line 6, 'f 1 2.5 3': not a number"),
    ],
)
def test_errors_name_the_line(text, message):
    with pytest.raises(ValueError) as caught:
        read_obj(text)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\n",
        "v",
        "f",
        "f ",
        "f#",
        "o",
        "o \n",
        "\\\n",
        "\\",
        " ",
        "\0",
        "v 1 2 3",
        "v 1 2 3\nf 1",
    ],
)
def test_next_to_nothing(text):
    vertices, faces, part, names, _ = read_obj(text.encode())
    assert len(vertices) == text.count("v ") and len(faces) == len(part) == len(names) == 0
    assert vertices.shape[1:] == faces.shape[1:] == (3,)


def test_huge_numbers_are_refused_not_wrapped():
    for index in (b"9999999999999999999999", b"-9999999999999999999999", b"9223372036854775807"):
        with pytest.raises(ValueError):
            read_obj(SQUARE + b"f 1 2 " + index)


@pytest.mark.parametrize("seed", range(50))
def test_what_follows_slashes_is_blanked_as_an_expression_would(seed):
    letters = ["1", "23", "/", "/", "-", "+", " ", "\n", *["x"] * (seed % 2)]
    body = b" 1/2" + "".join(np.random.default_rng(seed).choice(letters, 40)).encode()
    plain = re.sub(rb"/[-+/0-9]*", b"", body)
    found = read_obj_module._without_slashes(body)
    assert [line.split() for line in found.split(b"\n")] == [
        line.split() for line in plain.split(b"\n")
    ]
