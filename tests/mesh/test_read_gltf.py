"""glTF against closed forms: where every kind of node, number and primitive puts its triangles."""

import base64
import json
import struct
import sys
import tracemalloc
import warnings

import gltf_files
import numpy as np
import pytest
import shapes

from strokestyle.mesh.gltf_file import GltfFile
from strokestyle.mesh.gltf_nodes import compose, read_nodes
from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.read import read_mesh
from strokestyle.mesh.read_gltf import read_gltf

CUBE = shapes.cube()
SHEET = np.array([[x, 0.0, z] for z in range(3) for x in range(3)])
SHEET_FACES = shapes.grid(3, 3)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)


def read(gltf, folder, name="x.glb"):
    path = folder / name
    path.write_bytes(gltf.glb())
    return read_mesh(path)


def corners(found):
    return found.vertices[found.faces]


def box(found):
    """The two corners of the box around all faces."""
    points = corners(found).reshape(-1, 3)
    return points.min(axis=0).round(5).tolist(), points.max(axis=0).round(5).tolist()


def volume(found):
    a, b, c = corners(found).transpose(1, 0, 2)
    return np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6.0


def cube_file(node=None, **content):
    """A file of one cube of side 1 at one node."""
    gltf = gltf_files.Gltf(**content)
    gltf.node(gltf.mesh(gltf.shape(*CUBE)), **(node or {}))
    return gltf


SIDE = np.ptp(CUBE.vertices, axis=0)
LOW = CUBE.vertices.min(axis=0)


# ------------------------------------------------------------------------------ scenes and nodes


def test_transforms_of_nodes_are_applied_one_in_another(tmp_path):
    gltf = gltf_files.Gltf(scene=1, scenes=[{"nodes": [1]}, {"nodes": [0]}])
    matrix = np.eye(4)
    matrix[:3, 3] = 0, 0, 5
    half = np.sqrt(0.5)
    gltf.node(children=[1], matrix=matrix.T.ravel().tolist(), name="above")
    gltf.node(gltf.mesh(gltf.shape(*CUBE)), translation=[2, 0, 0], rotation=[0, 0, half, half],
              scale=[3, 1, 1])  # fmt: skip
    found = read(gltf, tmp_path)
    # a quarter turn about z: the three-fold x side stands along y
    x = [-(LOW[1] + SIDE[1]) + 2, LOW[0] * 3, LOW[2] + 5]
    assert np.allclose(box(found)[0], x)
    assert np.allclose(box(found)[1], np.add(x, [SIDE[1], 3 * SIDE[0], SIDE[2]]))
    assert found.part_names == ("above",) and volume(found) == pytest.approx(3 * SIDE.prod())


def test_a_mesh_may_stand_at_many_nodes_and_a_mirrored_one_keeps_its_outside(tmp_path):
    gltf = gltf_files.Gltf()
    mesh = gltf.mesh(gltf.shape(*CUBE))
    for x in range(4):
        gltf.node(mesh, translation=[5 * x, 0, 0], scale=[(-1) ** x, 1, 1])
    found = read(gltf, tmp_path)
    assert len(found.faces) == 4 * len(CUBE.faces)
    assert volume(found) == pytest.approx(4 * SIDE.prod())


@pytest.mark.parametrize("scenes", [{}, {"scenes": []}, {"scenes": [{"nodes": [0]}]}])
def test_without_a_default_scene_the_first_or_else_all_is_drawn(tmp_path, scenes):
    assert len(read(cube_file(**scenes), tmp_path).faces) == len(CUBE.faces)


def test_what_is_hidden_is_hidden_with_all_below_it(tmp_path):
    gltf = cube_file(scenes=[{"nodes": [0, 1]}])
    hidden = {"KHR_node_visibility": {"visible": False}}
    gltf.node(children=[2], extensions=hidden)
    gltf.node(0, translation=[9, 0, 0], extensions={"KHR_node_visibility": {"visible": True}})
    assert np.allclose(box(read(gltf, tmp_path)), [LOW, LOW + SIDE])
    gltf.content["nodes"][0]["extensions"] = hidden
    with pytest.raises(ValueError, match="all is hidden; meshes in all: 1"):
        read(gltf, tmp_path)


@pytest.mark.parametrize("kind, scale", [("f4", 1), ("i2", 32767), ("i1", 127)])
def test_instances(tmp_path, kind, scale):
    gltf = gltf_files.Gltf(extensionsRequired=["EXT_mesh_gpu_instancing"])
    half = np.sqrt(0.5)
    turn = np.array([[0, 0, 0, 1], [0, 0, half, half], [0, 0, 0, 1]])
    more = {"normalized": True} if scale > 1 else {}
    attributes = {
        "TRANSLATION": gltf.numbers([[0, 0, 0], [4, 0, 0], [8, 0, 0]]),
        "ROTATION": gltf.numbers(np.round(turn * scale) if scale > 1 else turn, kind, **more),
        "SCALE": gltf.numbers([[1, 1, 1], [2, 1, 1], [1, 1, -1]]),
        "_ID": gltf.numbers([0, 1, 2], "u1"),
    }
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    gltf.node(gltf.mesh(gltf.shape(*CUBE)), scale=[10, 10, 10], extensions=instancing)
    found = read(gltf, tmp_path)
    assert len(found.faces) == 3 * len(CUBE.faces)
    assert volume(found) == pytest.approx(1000 * 4 * SIDE.prod())
    middle = corners(found)[len(CUBE.faces) : 2 * len(CUBE.faces)].reshape(-1, 3)
    assert np.ptp(middle, axis=0) == pytest.approx(10 * SIDE * [1, 2, 1], rel=0.02)
    assert box(found)[1][0] == pytest.approx(10 * (8 + LOW[0] + SIDE[0]))


def test_names_of_parts(tmp_path):
    gltf = gltf_files.Gltf()
    mesh = gltf.mesh(gltf.shape(SQUARE, [0, 1, 2]), name="mesh")
    bare = gltf.mesh(gltf.shape(SQUARE, [0, 1, 2]))
    gltf.node(mesh, name=" node ")
    gltf.node(mesh)
    gltf.node(bare)
    gltf.node(children=[4], name="over")
    gltf.node(children=[5])
    gltf.node(bare)
    gltf.node(bare, name="node")
    found = read(gltf, tmp_path)
    assert [found.part_names[i] for i in found.part] == ["node", "mesh", "", "over", "node"]


def test_materials_are_parts_where_fewer_than_two_nodes_have_names(tmp_path):
    gltf = gltf_files.Gltf(materials=[{"name": "red"}, {"name": "blue"}, {}])
    pieces = [gltf.shape(SQUARE, [0, 1, 2], material=i) for i in range(3)]
    gltf.node(gltf.mesh(*pieces), name="one")
    found = read(gltf, tmp_path)
    assert [found.part_names[i] for i in found.part] == ["red", "blue", ""]
    gltf.node(gltf.mesh(pieces[0]), name="two")
    found = read(gltf, tmp_path)
    assert [found.part_names[i] for i in found.part] == ["one", "one", "one", "two"]
    single = gltf_files.Gltf(materials=[{"name": "red"}])
    single.node(single.mesh(single.shape(SQUARE, [0, 1, 2], material=0)), name="one")
    assert read(single, tmp_path).part_names == ("one",)


# ------------------------------------------------------------------------------- kinds of number


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2"])
@pytest.mark.parametrize("normalized", [False, True])
def test_quantised_positions(tmp_path, kind, normalized):
    """Rounded to steps, and undone by the node's scale; -128 is as low as -127."""
    whole = np.iinfo(kind).max if normalized else 1
    step = 1 if normalized else 100 / np.iinfo(kind).max
    low = 0 if kind[0] == "u" else -1
    points = np.array([[low, low, low], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    stored = points * (whole if normalized else np.iinfo(kind).max // 2 * 1)
    gltf = gltf_files.Gltf(extensionsRequired=["KHR_mesh_quantization"])
    flags = {"normalized": True} if normalized else {}
    attributes = {"POSITION": gltf.numbers(stored, kind, stride=8, **flags)}
    faces = gltf.numbers([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "u1")
    gltf.node(gltf.mesh({"attributes": attributes, "indices": faces}), scale=[step] * 3)
    expected = points if normalized else stored * step
    assert np.allclose(read(gltf, tmp_path).vertices, expected)


def test_signed_integers_end_at_minus_one(tmp_path):
    gltf = gltf_files.Gltf()
    number = gltf.numbers([[-128, 0, 0], [127, 0, 0], [0, 127, 0]], "i1", 4, normalized=True)
    gltf.node(gltf.mesh({"attributes": {"POSITION": number}}))
    assert box(read(gltf, tmp_path)) == ([-1, 0, 0], [1, 1, 0])


@pytest.mark.parametrize("kind", ["u1", "u2", "u4"])
@pytest.mark.parametrize("plain", [True, False])
def test_sparse_positions(tmp_path, kind, plain):
    gltf = gltf_files.Gltf()
    lifted = SHEET.copy()
    lifted[4, 1] = 3
    if plain:
        number = gltf.sparse(SHEET, [4], [lifted[4]], kind)
    else:
        number = gltf.sparse(SHEET, np.arange(9), lifted, kind, plain=False)
    faces = gltf.numbers(SHEET_FACES.ravel(), "u2")
    gltf.node(gltf.mesh({"attributes": {"POSITION": number}, "indices": faces}))
    assert np.allclose(read(gltf, tmp_path).vertices, lifted)


def test_sparse_indices_and_numbers_without_bytes(tmp_path):
    gltf = gltf_files.Gltf()
    number = gltf.numbers([0, 1, 2, 0, 0, 0], "u2")
    rows, values = gltf.view(bytes([4, 5])), gltf.view(np.array([2, 3], "<u2").tobytes())
    gltf.content["accessors"][number]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": rows, "componentType": 5121},
        "values": {"bufferView": values},
    }
    primitive = {"attributes": {"POSITION": gltf.numbers(SQUARE)}, "indices": number}
    gltf.node(gltf.mesh(primitive))
    assert read(gltf, tmp_path).faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    zeros = gltf.numbers(SQUARE, bufferView=None)
    gltf.content["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = zeros
    assert not read(gltf, tmp_path).vertices.any()


def test_vertices_that_a_primitive_does_not_use_are_not_repeated(tmp_path):
    gltf = gltf_files.Gltf()
    points = gltf.numbers(np.arange(3000).reshape(-1, 3))
    pieces = [{"attributes": {"POSITION": points}, "indices": gltf.numbers([i, i + 1, i + 2], "u2")}
              for i in range(0, 900, 3)]  # fmt: skip
    gltf.node(gltf.mesh(*pieces))
    found = read(gltf, tmp_path)
    assert len(found.vertices) == 900
    assert np.array_equal(corners(found).reshape(-1), np.arange(2700))


# ---------------------------------------------------------------------------------- primitives

FAN = [0, 1, 2, 3]
ROW = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]], float)


def up(found):
    """Twice the area, if all triangles are wound the same way round in the plane."""
    a, b, c = corners(found).transpose(1, 0, 2)
    return np.cross(b - a, c - a)[:, 2]


@pytest.mark.parametrize("indexed", [True, False])
def test_strips_and_fans_are_wound_as_lists_are(tmp_path, indexed):
    for mode, points, count in ((5, ROW, 4), (6, SQUARE, 2), (4, SQUARE[[0, 1, 2, 0, 2, 3]], 2)):
        gltf = gltf_files.Gltf()
        primitive = gltf.shape(points, np.arange(len(points)) if indexed else None, mode=mode)
        gltf.node(gltf.mesh(primitive))
        turn = up(read(gltf, tmp_path))
        assert len(turn) == count and np.all(turn == (-1 if mode == 5 else 1))


@pytest.mark.parametrize("kind", ["u1", "u2", "u4"])
def test_the_highest_index_begins_anew(tmp_path, kind):
    stop = np.iinfo(kind).max
    for mode, indices, faces in (
        (5, [0, 1, 2, stop, 2, 1, 3], [[0, 1, 2], [2, 1, 3]]),
        (5, [stop, 0, 1, 2, stop, stop, 3, 4], [[0, 1, 2]]),
        (6, [0, 1, 2, 3, stop, 3, 4, 5, stop], [[1, 2, 0], [2, 3, 0], [4, 5, 3]]),
        (4, [0, 1, 2, stop, 3, 4, 5], [[0, 1, 2], [3, 4, 5]]),
    ):
        gltf = gltf_files.Gltf()
        gltf.node(gltf.mesh(gltf.shape(ROW, indices, kind, mode=mode)))
        assert np.array_equal(corners(read(gltf, tmp_path)), ROW[faces])
    full = np.zeros((256, 3))
    full[255] = 1, 2, 3  # where there is such a vertex it is meant
    gltf = gltf_files.Gltf()
    gltf.node(gltf.mesh(gltf.shape(full, [0, 1, 255], "u1")))
    assert box(read(gltf, tmp_path))[1] == [1, 2, 3]


def test_a_cube_and_its_lid(tmp_path):
    gltf = cube_file()
    lid = SQUARE[:, [0, 2, 1]] + [0, 9, 0]
    gltf.content["meshes"][0]["primitives"].append(gltf.shape(lid, None, mode=6))
    found = read(gltf, tmp_path)
    assert len(found.faces) == len(CUBE.faces) + 2 and box(found)[1][1] == 9


def test_lines_and_points_are_left_out_and_named(tmp_path):
    gltf = cube_file()
    lines = [gltf.shape(SQUARE, [0, 1], mode=mode) for mode in (0, 1, 2, 3)]
    gltf.content["meshes"][0]["primitives"] += lines
    with pytest.warns(MeshWarning, match=r"x\.glb: left out: points \(1\), lines \(3\)"):
        assert len(read(gltf, tmp_path).faces) == len(CUBE.faces)
    gltf.content["meshes"][0]["primitives"] = lines[1:]
    with pytest.raises(ValueError, match=r"x\.glb: no triangles in it, only lines \(3\)"):
        read(gltf, tmp_path)


def test_corners_over_make_no_triangle(tmp_path):
    gltf = gltf_files.Gltf()
    gltf.node(gltf.mesh(gltf.shape(ROW, [0, 1, 2, 3, 4])))
    with pytest.warns(MeshWarning, match=r"left out: corners that make no triangle \(2\)"):
        assert len(read(gltf, tmp_path).faces) == 1


def test_polygons_that_were_cut_are_known(tmp_path):
    gltf = gltf_files.Gltf(extensionsUsed=["FB_ngon_encoding"])
    faces = [0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4, 1, 3, 5]
    gltf.node(
        gltf.mesh(
            gltf.shape(ROW, faces, extensions={"FB_ngon_encoding": {}}),
        )
    )
    gltf.node(0)
    assert read(gltf, tmp_path).polygon.tolist() == [0, 0, 2, 2, 4, 5, 5, 7, 7, 9]
    del gltf.content["meshes"][0]["primitives"][0]["extensions"]
    assert read(gltf, tmp_path).polygon is None


# ------------------------------------------------------------------------------ morphs and skins


def test_morph_targets_move_as_far_as_their_weights_say(tmp_path):
    gltf = gltf_files.Gltf()
    up = np.zeros_like(CUBE.vertices)
    up[:, 1] = 2 * CUBE.vertices[:, 1]
    aside = gltf.sparse(np.zeros_like(up), np.arange(len(up)), up[:, [1, 0, 2]] * 0 + [4, 0, 0],
                        plain=False)  # fmt: skip
    targets = [{"POSITION": gltf.numbers(up)}, {"NORMAL": 0}, {"POSITION": aside}]
    mesh = gltf.mesh(gltf.shape(*CUBE, targets=targets), weights=[1, 7, 0])
    gltf.node(mesh)
    gltf.node(mesh, weights=[0, 0, 0.5])
    found = read(gltf, tmp_path)
    tall, moved = np.split(corners(found), 2)
    size = CUBE.vertices[CUBE.faces]
    assert np.allclose(tall, size * [1, 3, 1]) and np.allclose(moved, size + [2, 0, 0])
    del gltf.content["meshes"][0]["weights"]
    assert np.allclose(np.split(corners(read(gltf, tmp_path)), 2)[0], size)


def arm(joints="u1", weights="f4", bind=True, sets=1):
    """A bar of height 2 under an armature of scale 100, its upper half bent by 90 degrees to -x;
    vertices below 1 hang on the hip, those above on the knee, those at 1 on both."""
    gltf = gltf_files.Gltf(scenes=[{"nodes": [0]}])
    points = np.array([[x, y, z] for y in (0, 1, 2) for x, z in ((0, 0), (0.2, 0), (0.2, 0.2))])
    faces = [[0, 1, 3], [1, 4, 3], [3, 4, 6], [4, 7, 6], [2, 5, 8]]
    lower = np.repeat([1, 0.5, 0], 3)
    joint, weight = np.zeros((9, 4), int), np.zeros((9, 4))
    joint[:, 1], weight[:, 0], weight[:, 1] = 1, lower, 1 - lower
    more = {"normalized": True} if weights != "f4" else {}
    whole = np.iinfo(weights).max if more else 1.0
    primitive = gltf.shape(points, faces)
    for number in range(sets):
        own = weight if sets == 1 else weight * (np.arange(4) == number)
        primitive["attributes"] |= {
            f"JOINTS_{number}": gltf.numbers(joint, joints),
            f"WEIGHTS_{number}": gltf.numbers(np.floor(own * whole) if more else own, weights,
                                              **more),
        }  # fmt: skip
    half = np.sqrt(0.5)
    gltf.node(children=[1, 3], scale=[100] * 3)
    gltf.node(children=[2], name="hip")
    gltf.node(translation=[0, 0.01, 0], rotation=[0, 0, half, half], name="knee")
    skin = {"joints": [1, 2]}
    if bind:
        inverse = [np.diag([0.01, 0.01, 0.01, 1]) for _ in range(2)]
        inverse[1][1, 3] = -0.01
        matrices = [matrix.T.ravel() for matrix in inverse]
        skin["inverseBindMatrices"] = gltf.numbers(matrices)
    # its own place must not matter
    gltf.node(gltf.mesh(primitive), skin=gltf.add("skins", skin), translation=[7, 7, 7])
    return gltf, points


@pytest.mark.parametrize("joints", ["u1", "u2"])
@pytest.mark.parametrize("weights, error", [("f4", 1e-6), ("u1", 0.01), ("u2", 1e-4)])
@pytest.mark.parametrize("sets", [1, 2])
def test_a_skin_stands_in_the_pose_of_the_file(tmp_path, joints, weights, error, sets):
    gltf, points = arm(joints, weights, sets=sets)
    found = read(gltf, tmp_path)
    bent = np.stack([-(points[:, 1] - 1), 1 + points[:, 0], points[:, 2]], axis=1)
    expected = np.where(points[:, 1:2] < 1, points, bent)
    expected[3:6] = 0.5 * (points + bent)[3:6]
    assert np.allclose(found.vertices, expected, atol=error)
    assert box(found)[1][1] == pytest.approx(1.2, abs=error)


def test_a_skin_without_bind_matrices(tmp_path):
    gltf, points = arm(bind=False)
    found = read(gltf, tmp_path)
    assert np.allclose(found.vertices[:3], 100 * points[:3])
    assert np.allclose(found.vertices[6], [-200, 1, 0])


def test_weights_of_nothing_hang_on_the_first_joint_and_joints_exist(tmp_path):
    gltf, points = arm()
    attributes = gltf.content["meshes"][0]["primitives"][0]["attributes"]
    weights = attributes["WEIGHTS_0"]
    attributes["WEIGHTS_0"] = gltf.numbers(np.zeros((9, 4)))
    assert np.allclose(read(gltf, tmp_path).vertices, points, atol=1e-6)
    attributes["WEIGHTS_0"] = weights
    attributes["JOINTS_0"] = gltf.numbers(np.full((9, 4), [0, 1, 9, 9]), "u1")
    read(gltf, tmp_path)  # of weight 0: names nothing
    attributes["JOINTS_0"] = gltf.numbers(np.full((9, 4), 9), "u1")
    with pytest.raises(ValueError, match="a vertex hangs on joint 9 of 2"):
        read(gltf, tmp_path)


def test_joints_turn_nothing_without_a_skin(tmp_path):
    gltf, points = arm()
    del gltf.content["nodes"][3]["skin"]
    assert np.allclose(read(gltf, tmp_path).vertices, 100 * (points + 7))


def test_quaternions_turn_as_a_known_rotation_does():
    turn = compose(None, np.array([[0, 0, 3, 3], [0, 0, 0, 0], [1, 0, 0, 0]]), None, 3)
    assert np.allclose(turn[0] @ [1, 0, 0, 1], [0, 1, 0, 1])
    assert np.allclose(turn[1], np.eye(4)) and np.allclose(np.diag(turn[2]), [1, -1, -1, 1])


# ------------------------------------------------------------------------------- where bytes lie


@pytest.mark.parametrize(
    "uri, name",
    [
        ("my%20model.bin", "my model.bin"),
        ("my model.bin", "my model.bin"),
        ("50%.bin", "50%.bin"),
        ("Model.BIN", "model.bin"),
        ("a%20b.bin", "a%20b.bin"),
        ("sub/deep/x.bin", "sub/deep/x.bin"),
        ("sub\\x.bin", "sub/x.bin"),
        ("./x.bin", "x.bin"),
        ("sub/../x.bin", "x.bin"),
        ("%C3%A9t%C3%A9.bin", "été.bin"),
    ],
)
def test_names_of_buffers(tmp_path, uri, name):
    gltf = cube_file()
    for folder in ("sub/deep", ""):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    (tmp_path / name).write_bytes(gltf.data)
    path = tmp_path / "my model.gltf"
    path.write_text(gltf.text(uri))
    assert len(read_mesh(path).faces) == len(CUBE.faces)


def test_data_uris(tmp_path):
    gltf, path = cube_file(), tmp_path / "x.gltf"
    path.write_bytes(b"\xef\xbb\xbf" + gltf.text().encode())  # with a byte order mark
    assert len(read_mesh(path).faces) == len(CUBE.faces)
    percent = "data:," + "".join(f"%{byte:02x}" for byte in gltf.data)
    path.write_text(gltf.text(percent))
    assert len(read_mesh(path).faces) == len(CUBE.faces)
    gltf.data += b"x" * (1 + -len(gltf.data) % 3)
    bare = base64.b64encode(gltf.data).decode().rstrip("=")
    path.write_text(gltf.text(f"data:application/gltf-buffer;base64,{bare[:40]}\n{bare[40:]}"))
    assert len(read_mesh(path).faces) == len(CUBE.faces)


def test_a_glb_is_known_by_its_first_bytes(tmp_path):
    path = tmp_path / "x.gltf"
    path.write_bytes(cube_file().glb() + b"more")
    assert len(read_mesh(path).faces) == len(CUBE.faces)
    path = tmp_path / "x.glb"
    path.write_text(cube_file().text())
    assert len(read_mesh(path).faces) == len(CUBE.faces)
    path = tmp_path / "x.VRM"
    path.write_bytes(cube_file().glb())
    assert len(read_mesh(path).faces) == len(CUBE.faces)


def test_a_chunk_filled_up_with_zeros_and_a_length_that_leaves_out_the_last(tmp_path):
    data = bytearray(cube_file().glb())
    size = struct.unpack_from("<I", data, 12)[0]
    text = bytes(data[20 : 20 + size]).rstrip()
    data[20 : 20 + size] = text.ljust(size, b"\0") + b"\0" * 4
    struct.pack_into("<II", data, 8, len(data) - 40, size + 4)
    path = tmp_path / "x.glb"
    path.write_bytes(data)
    assert len(read_mesh(path).faces) == len(CUBE.faces)


def test_a_material_that_is_not_there_has_no_name(tmp_path):
    gltf = cube_file()
    gltf.content["meshes"][0]["primitives"][0]["material"] = 7
    assert read(gltf, tmp_path).part_names == ("",)


def test_images_are_not_opened(tmp_path, monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("an image was opened")

    monkeypatch.setattr("PIL.Image.open", refuse)
    gltf = cube_file(images=[{"uri": "gone.png"}, {"bufferView": 0, "mimeType": "image/png"}],
                     textures=[{"source": 0}, {"source": 1}],
                     materials=[{"emissiveTexture": {"index": 1}}])  # fmt: skip
    gltf.content["meshes"][0]["primitives"][0]["material"] = 0
    gone = {"byteLength": 9, "uri": "gone.bin"}
    gltf.content["buffers"] = [{"byteLength": len(gltf.data)}, gone]
    assert len(read(gltf, tmp_path).faces) == len(CUBE.faces)


# ----------------------------------------------------------------------- compressed, and unknown


def draco(gltf, points, faces):
    """Make a primitive that Draco compressed."""
    encoder = pytest.importorskip("DracoPy", reason="DracoPy is not installed")
    data = encoder.encode(points, faces.astype(np.uint32), 16, preserve_order=True)
    primitive = gltf.shape(points, faces)
    for number in (primitive["attributes"]["POSITION"], primitive["indices"]):
        del gltf.content["accessors"][number]["bufferView"]
    compressed = {"bufferView": gltf.view(data), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": compressed}
    return primitive


def test_draco(tmp_path):
    gltf = gltf_files.Gltf(extensionsRequired=["KHR_draco_mesh_compression"])
    ball = shapes.sphere(2)
    gltf.node(gltf.mesh(draco(gltf, *ball)), translation=[5, 0, 0], name="ball")
    gltf.node(gltf.mesh(gltf.shape(*CUBE)), name="cube")
    found = read(gltf, tmp_path)
    assert len(found.faces) == len(ball.faces) + len(CUBE.faces)
    assert np.allclose(found.vertices[: len(ball.vertices)], ball.vertices + [5, 0, 0], atol=1e-4)


def test_draco_that_is_damaged(tmp_path):
    gltf = gltf_files.Gltf()
    primitive = draco(gltf, *shapes.sphere(2))
    gltf.node(gltf.mesh(primitive))
    view = primitive["extensions"]["KHR_draco_mesh_compression"]["bufferView"]
    gltf.content["bufferViews"][view]["byteLength"] //= 2
    with pytest.raises(ValueError, match="what Draco compressed cannot be decoded"):
        read(gltf, tmp_path)


@pytest.mark.parametrize("required", [True, False])
def test_without_dracopy_it_is_named_unless_the_numbers_are_there_plain(
    tmp_path, monkeypatch, required
):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    gltf = cube_file(**({"extensionsRequired": ["KHR_draco_mesh_compression"]} if required else {}))
    primitive = gltf.content["meshes"][0]["primitives"][0]
    compressed = {"bufferView": 0, "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": compressed}
    assert len(read(gltf, tmp_path).faces) == len(CUBE.faces)
    del gltf.content["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
    with pytest.raises(ValueError, match=r"x\.glb: compressed by Draco.*pip install DracoPy"):
        read(gltf, tmp_path)


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt_is_named_unless_the_bytes_are_there_plain(tmp_path, name):
    gltf = cube_file(extensionsRequired=[name])
    for view in gltf.content["bufferViews"]:
        view["extensions"] = {name: {**view, "count": 8, "mode": "ATTRIBUTES", "byteStride": 12}}
    assert len(read(gltf, tmp_path).faces) == len(CUBE.faces)
    size = {"byteLength": len(gltf.data)}
    gltf.content["buffers"] = [size, {**size, "extensions": {name: {"fallback": True}}}]
    for view in gltf.content["bufferViews"]:
        view["buffer"] = 1
    with pytest.raises(ValueError, match="by meshopt.*`npx @gltf-transform/cli copy IN OUT"):
        read(gltf, tmp_path)


def test_extensions_that_are_required_and_unknown_are_named(tmp_path):
    gltf = cube_file(extensionsUsed=["ANY_thing"])
    known = ["KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp"]
    gltf.content["extensionsRequired"] = known
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(gltf, tmp_path)
    gltf.content["extensionsRequired"] = [*known, "XYZ_bend"]
    with pytest.warns(MeshWarning, match="requires XYZ_bend, which is not read here"):
        read(gltf, tmp_path)


# ------------------------------------------------------------------------------------- damaged


def broken(change):
    """A cube whose JSON is changed."""
    gltf = cube_file(scenes=[{"nodes": [0]}])
    change(gltf.content)
    return gltf


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda c: c["accessors"][0].update(count=7),
         "a triangle of a mesh names a vertex that does not exist: 7, and they are 0 to 6"),
        (lambda c: c["accessors"][0].update(count=700), "cut short: an accessor of 700 elements"),
        (lambda c: c["accessors"][0].update(count=-1), "count is '-1'"),
        (lambda c: c["accessors"][0].update(count=10**13) or c["accessors"][0].pop("bufferView"),
         "10000000000000 elements without a buffer view"),
        (lambda c: c["accessors"][0].update(type="VEC5"), "'VEC5' is no accessor type"),
        (lambda c: c["accessors"][0].update(type="VEC2"), "not of three coordinates"),
        (lambda c: c["accessors"][0].update(type="VEC4", count=2), "not of three coordinates"),
        (lambda c: c["accessors"][0].update(componentType=7), "'7' is no component type"),
        (lambda c: c["accessors"][1].update(componentType=5126, count=3), "no whole numbers"),
        (lambda c: c["bufferViews"][0].update(byteLength=9999), "cut short: a buffer view"),
        (lambda c: c["bufferViews"][0].update(buffer=3), "names buffers 3, and there are 1"),
        (lambda c: c.update(buffers=[{"byteLength": 99999}]), "cut short: 1"),
        (lambda c: c.update(buffers=[{"byteLength": 9, "uri": "https://x.org/a.bin"}]),
         "x.glb: its buffer lies at 'https://x.org/a.bin', and nothing is fetched"),
        (lambda c: c.update(buffers=[{"byteLength": 9, "uri": "//x.org/a.bin"}]), "lies at"),
        (lambda c: c.update(buffers=[{"byteLength": 9, "uri": "data:text"}]), "without data"),
        (lambda c: c["nodes"].append({"children": [1]}), "node 1 hangs below itself"),
        (lambda c: c["nodes"].extend([{"children": [2], "name": "a"}, {"children": [1]}]),
         "node 'a' hangs below itself"),
        (lambda c: c["nodes"][0].update(children=[9]), "names nodes 9, and there are 1"),
        (lambda c: c["nodes"][0].update(children=["0"]), "names nodes 0"),
        (lambda c: c["nodes"][0].update(scale=[1, 2]), "2 numbers for 3"),
        (lambda c: c["nodes"][0].update(mesh=5), "names meshes 5"),
        (lambda c: c["nodes"][0].pop("mesh"), "x.glb: no triangles in its scene; meshes in all: 1"),
        (lambda c: c.update(scene=4), "names scenes 4"),
        (lambda c: c.update(meshes=[]), "names meshes 0"),
        (lambda c: c.update(meshes=[], nodes=[{}]), "x.glb: no mesh in it"),
        (lambda c: c.update(nodes={"a": 1}), "nodes is no list"),
        (lambda c: c["meshes"][0].pop("primitives"), "not built as glTF is: KeyError: 'prim"),
        (lambda c: c["asset"].update(version="1.0"), "x.glb: of glTF 1.0, and 2.0 is read"),
        (lambda c: c["meshes"][0]["primitives"][0].update(targets=[{"POSITION": 1}])
         or c["nodes"][0].update(weights=[1]), "36 targets of a mesh for 8 vertices"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_named(tmp_path, change, message):
    with pytest.raises(ValueError) as caught:
        read(broken(change), tmp_path)
    text = str(caught.value)
    assert message in text and text.startswith(str(tmp_path)) and "\n" not in text


def test_a_buffer_that_is_not_there_is_named(tmp_path):
    path = tmp_path / "x.gltf"
    path.write_text(cube_file().text("my%20model.bin"))
    with pytest.raises(FileNotFoundError, match=r"x\.gltf: the file 'my model\.bin' that it names"):
        read_mesh(path)
    for strange in ("x" * 5000, "a\0b", "."):
        path.write_text(cube_file().text(strange))
        with pytest.raises(FileNotFoundError, match="is not there: put it"):
            read_mesh(path)
    path.write_text(cube_file().text("my%20model.bin"))
    (tmp_path / "my model.bin").write_bytes(cube_file().data[:-1])
    with pytest.raises(ValueError, match=r"x\.gltf: .*cut short: \d+ of \d+ bytes of buffer 0"):
        read_mesh(path)


@pytest.mark.parametrize(
    "data, message",
    [
        (b"glTF" + struct.pack("<II", 2, 400), "cut short: a .glb begins with 20 bytes"),
        (b"glTF" + struct.pack("<II", 2, 400) + bytes(100), "cut short: 112 of 400 bytes"),
        (b"glTF" + struct.pack("<II", 1, 20) + bytes(8), "of glTF 1, and 2.0 is read"),
        (b"glTF" + struct.pack("<IIII", 2, 28, 8, 7) + bytes(8), "without a JSON chunk"),
        (b"glTF" + struct.pack("<IIII", 2, 28, 99, 7) + bytes(8), "a chunk reaches beyond"),
        (b"[" * 10**5, "JSON cannot be read"),
        (b"[]", "its JSON is no object"),
        (b'{"a": \xff}', "JSON cannot be read"),
        (b'{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}', "cut short: its JSON ends too"),
        (b'{"buffers": [{"uri": "data:application/octet-stream;base64,AAA', "cut short: its JSON"),
        (b'{"nodes": [1 2]}', "its JSON cannot be read (Expecting ',' delimiter"),
        ('{"asset": {"version": "2.0"}}'.encode("utf-16"), "UTF-16"),
        (b'{"asset": {"version": "1.0"}, "meshes": {}}', "of glTF 1.0"),
        (b'{"asset": 1}', "not built as glTF is"),
    ],
)
def test_bytes_that_are_no_gltf(tmp_path, data, message):
    path = tmp_path / "x.glb"
    path.write_bytes(data)
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_node_below_two_is_drawn_once(tmp_path):
    gltf = cube_file()
    gltf.node(children=[0], translation=[9, 0, 0])
    gltf.node(children=[0])
    with pytest.warns(MeshWarning, match="nodes below several others, .*: 1$"):
        assert len(read(gltf, tmp_path).faces) == len(CUBE.faces)


def test_deep_trees(tmp_path):
    gltf = cube_file()
    for index in range(5000):
        gltf.node(children=[index], translation=[1, 0, 0])
    assert box(read(gltf, tmp_path))[0][0] == pytest.approx(5000 + LOW[0])


def test_any_change_of_the_json_is_read_or_refused_in_one_line(tmp_path):
    rng = np.random.default_rng(3)
    gltf, _ = arm()
    gltf.content["nodes"][3]["weights"] = [0.5]
    gltf.content["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    text = json.dumps(gltf.content)
    strange = [-1, 3, 1e300, 10**30, None, "a", [], {}, True, [1, [2]]]

    def places(item, path=()):
        items = item.items() if isinstance(item, dict) else enumerate(item)
        for key, value in items:
            yield (*path, key)
            if isinstance(value, (dict, list)):
                yield from places(value, (*path, key))

    every = list(places(gltf.content))
    path = tmp_path / "x.glb"
    for _ in range(400):
        gltf.content = json.loads(text)
        place = every[rng.integers(len(every))]
        item = gltf.content
        for key in place[:-1]:
            item = item[key]
        item[place[-1]] = strange[rng.integers(len(strange))]
        path.write_bytes(gltf.glb())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MeshWarning)
            try:
                found = read_mesh(path)
            except (ValueError, OSError) as error:
                assert str(error).startswith(str(path)) and "\n" not in str(error)
            else:
                assert found.faces.max() < len(found.vertices)


def test_a_list_of_the_file_is_not_gone_through_for_each_of_it(tmp_path):
    """Every node names its children: to look at all nodes for each would take their square."""

    class Counted(list):
        times = 0

        def __iter__(self):
            Counted.times += 1
            return super().__iter__()

    gltf = cube_file(scenes=[{"nodes": [1]}])
    gltf.node(children=[0, *range(2, 300)])
    for _ in range(298):
        gltf.node(0)
    path = tmp_path / "x.glb"
    path.write_bytes(gltf.glb())
    file = GltfFile(path)
    file.content["nodes"] = Counted(file.content["nodes"])
    assert len(read_nodes(file).shown) == 300 and Counted.times < 10


def test_what_is_large_is_read_without_a_loop_over_faces(tmp_path):
    """The memory of a million faces: counted, not timed."""
    count = 500
    x, z = np.meshgrid(np.arange(count), np.arange(count))
    points = np.stack([x, 0 * x, z], axis=-1)
    gltf = gltf_files.Gltf()
    gltf.node(gltf.mesh(gltf.shape(points.reshape(-1, 3), shapes.grid(count, count), "u4")))
    path = tmp_path / "x.glb"
    path.write_bytes(gltf.glb())
    tracemalloc.start()
    found = read_gltf(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found.faces) == 2 * (count - 1) ** 2 and peak < 250 * len(found.faces)
