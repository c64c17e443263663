"""COLLADA: which way is up, where nodes stand, and how polygons of every kind are cut."""

import warnings
import zipfile

import numpy as np
import pytest
import shapes
from damage import damaged, is_read_or_refused

from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.read import read_mesh

CUBE = shapes.cube()
ROW = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]], float)
# the corners of a letter L in the plane, notch at its fourth
ELL = np.array([[0, 0, 0], [3, 0, 0], [3, 1, 0], [1, 1, 0], [1, 3, 0], [0, 3, 0]], float)


def words(values):
    return " ".join(f"{value:g}" for value in np.ravel(values))


def source(points, number="s", params="XYZ", stride=3):
    names = "".join(f'<param name="{x}" type="float"/>' if x else "<param/>" for x in params)
    return (
        f'<source id="{number}"><float_array id="{number}-a" count="{np.size(points)}">'
        f"{words(points)}</float_array><technique_common>"
        f'<accessor source="#{number}-a" count="{len(points)}" stride="{stride}">{names}'
        "</accessor></technique_common></source>"
        f'<vertices id="{number}-v"><input semantic="POSITION" source="#{number}"/></vertices>'
    )


VERTEX = '<input semantic="VERTEX" source="#s-v" offset="0"/>'
NORMAL = '<input semantic="NORMAL" source="#n" offset="1"/>'


def triangles(faces, inputs=VERTEX, **more):
    given = "".join(f' {key}="{value}"' for key, value in more.items())
    return f"<triangles{given}>{inputs}<p>{words(faces)}</p></triangles>"


def geometry(content, number="g", **more):
    given = "".join(f' {key}="{value}"' for key, value in more.items())
    return f'<geometry id="{number}"{given}><mesh>{content}</mesh></geometry>'


def node(content, **more):
    given = "".join(f' {key}="{value}"' for key, value in more.items())
    return f"<node{given}>{content}</node>"


def use(number="g", content=""):
    return f'<instance_geometry url="#{number}">{content}</instance_geometry>'


def document(geometries, nodes=None, up="", more=""):
    axis = f"<up_axis>{up}</up_axis>" if up else ""
    scene = f'<library_visual_scenes><visual_scene id="vs">{nodes}</visual_scene>'
    scene += '</library_visual_scenes><scene><instance_visual_scene url="#vs"/></scene>'
    return ('<?xml version="1.0" encoding="utf-8"?>\n<COLLADA xmlns="http://www.collada.org/2005/'
            f'11/COLLADASchema" version="1.4.1"><asset><unit meter="0.01"/>{axis}</asset>'
            f"<library_geometries>{geometries}</library_geometries>{more}"
            f"{scene if nodes is not None else ''}</COLLADA>")  # fmt: skip


def read(folder, text):
    path = folder / "x.dae"
    path.write_text(text)
    return read_mesh(path)


BRICK = geometry(source((CUBE.vertices - CUBE.vertices.min(axis=0)) * [1, 2, 3])
                 + triangles(CUBE.faces), name="brick")  # fmt: skip
SIZE = np.ptp(CUBE.vertices, axis=0) * [1, 2, 3]


def box(found):
    points = found.vertices[found.faces].reshape(-1, 3)
    return points.min(axis=0), points.max(axis=0)


def volume(found):
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6.0


def up_area(found):
    """The area of faces in the plane z = 0, less that of those turned away."""
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return 0.5 * np.cross(b - a, c - a)[:, 2]


@pytest.mark.parametrize(
    "up, axes, signs",
    [("", "xyz", [1, 1, 1]), ("Y_UP", "xyz", [1, 1, 1]), ("Z_UP", "xzy", [1, 1, -1]),
     ("X_UP", "yxz", [-1, 1, 1])],
)  # fmt: skip
def test_up_is_y(tmp_path, up, axes, signs):
    found = read(tmp_path, document(BRICK, node(use(), name="Box"), up))
    far = SIZE[["xyz".index(axis) for axis in axes]] * signs
    assert np.allclose(box(found), [np.minimum(far, 0), np.maximum(far, 0)])
    assert volume(found) == pytest.approx(SIZE.prod()) and found.part_names == ("Box",)


def test_transforms_follow_one_another(tmp_path):
    inner = node("<scale>2 1 1</scale>" + use())
    turned = '<translate sid="t">10 0 0</translate><rotate>0 0 2 90</rotate>'
    moved = "<matrix>1 0 0 0 0 1 0 0 0 0 1 5 0 0 0 1</matrix>"
    found = read(tmp_path, document(BRICK, node(turned + moved + inner)))
    # twice as long in x, up by 5, turned x to y and y to -x, moved by 10
    low = [10 - SIZE[1], 0, 5]
    assert np.allclose(box(found), [low, np.add(low, SIZE[[1, 0, 2]] * [1, 2, 1])])
    mirrored = read(tmp_path, document(BRICK, node("<scale>1 -1 1</scale>" + use())))
    assert volume(mirrored) == pytest.approx(SIZE.prod())


def test_rare_transforms(tmp_path):
    looks = node("<lookat>5 0 0 0 0 0 0 1 0</lookat>" + use())
    # its -z looks at the origin: z goes to x, x to -z
    found = read(tmp_path, document(BRICK, looks))
    assert np.allclose(box(found), [[5, 0, -SIZE[0]], [5 + SIZE[2], SIZE[1], 0]])
    skewed = node("<skew>45 0 1 0 1 0 0</skew>" + use())  # along x by what is in y
    found = read(tmp_path, document(BRICK, skewed))
    assert np.allclose(box(found)[1], SIZE + [SIZE[1], 0, 0])
    assert volume(found) == pytest.approx(SIZE.prod())


def test_nodes_of_the_library_stand_as_often_as_they_are_named(tmp_path):
    library = f"<library_nodes>{node(use(), id='n', name='brick in wall')}</library_nodes>"
    at = "".join(node(f"<translate>{9 * i} 0 0</translate><instance_node url='#n'/>", name="wall")
                 for i in range(3))  # fmt: skip
    found = read(tmp_path, document(BRICK, at, more=library))
    assert len(found.faces) == 36 and volume(found) == pytest.approx(3 * SIZE.prod())
    assert found.part_names == ("brick in wall",)


def test_names_of_parts(tmp_path):
    bare = geometry(source(ROW) + triangles([0, 1, 2]), "bare")
    nodes = node(use(), name=" a ") + node(use()) + node(use("bare"), id="n5")
    nodes += node(node(use("bare")), name="over")
    found = read(tmp_path, document(BRICK + bare, nodes))
    assert [found.part_names[i] for i in found.part[[0, 12, 24, 25]]] == ["a", "brick", "", "over"]


def test_materials_are_parts_where_fewer_than_two_nodes_have_names(tmp_path):
    both = triangles([0, 1, 2], material="s1") + triangles([2, 1, 3], material="s2")
    both += triangles([2, 3, 4], material="s3") + triangles([4, 3, 5])
    bound = (
        '<instance_material symbol="s1" target="#m1"/><instance_material symbol="s2" target="#m2"/>'
    )
    bound = f"<bind_material><technique_common>{bound}</technique_common></bind_material>"
    library = (
        '<library_materials><material id="m1" name="red"/><material id="m2"/></library_materials>'
    )
    shape = geometry(source(ROW) + both)
    found = read(tmp_path, document(shape, node(use(content=bound), name="a"), more=library))
    assert [found.part_names[i] for i in found.part] == ["red", "m2", "s3", ""]
    twice = node(use(content=bound), name="a") + node(use(), name="b")
    assert read(tmp_path, document(shape, twice, more=library)).part_names == ("a", "b")


@pytest.mark.parametrize("scene", [None, ""])
def test_without_a_scene_all_geometries_are_drawn(tmp_path, scene):
    if scene is None:
        assert len(read(tmp_path, document(BRICK)).faces) == 12
    else:
        with pytest.raises(ValueError, match="no triangles or polygons in its scene"):
            read(tmp_path, document(BRICK, scene))


# ------------------------------------------------------------------------------------ primitives


def flat(content, points=ROW, **more):
    return document(geometry(source(points, **more) + content), node(use()))


@pytest.mark.parametrize(
    "content, faces",
    [
        (triangles([0, 1, 2, 2, 1, 3]), [[0, 1, 2], [2, 1, 3]]),
        (triangles([0, 9, 1, 9, 2, 9], VERTEX + NORMAL), [[0, 1, 2]]),
        (triangles([9, 0, 9, 1, 9, 2], VERTEX.replace('"0"', '"1"') + NORMAL.replace('"1"', '"0"')),
         [[0, 1, 2]]),
        (triangles([0, 1, 2, 3]), [[0, 1, 2]]),
        (f"<tristrips>{VERTEX}<p>0 1 2 3 4</p><p>5 3 4</p></tristrips>",
         [[0, 1, 2], [1, 3, 2], [2, 3, 4], [5, 3, 4]]),
        (f"<trifans>{VERTEX}<p>0 2 3 1</p><p>0 1</p></trifans>", [[0, 2, 3], [0, 3, 1]]),
        (triangles([0, 1, 2], VERTEX.replace("VERTEX", "POSITION").replace("s-v", "s")),
         [[0, 1, 2]]),
    ],
)  # fmt: skip
def test_lists_strips_and_fans(tmp_path, content, faces):
    found = read(tmp_path, flat(content))
    assert [np.roll(f, -f.argmin()).tolist() for f in found.faces] == [
        np.roll(f, -np.argmin(f)).tolist() for f in faces
    ]


@pytest.mark.parametrize("turn", [1, -1])
def test_polygons_with_notches_are_cut_at_their_ears(tmp_path, turn):
    ring = np.arange(6)[::turn]
    for start in range(6):
        corners = words(np.roll(ring, start))
        for content in (
            f"<polylist>{VERTEX}<vcount>6 4</vcount><p>{corners} 0 1 2 3</p></polylist>",
            f"<polygons>{VERTEX}<p>{corners}</p><p>0 1 2 3</p></polygons>",
        ):
            found = read(tmp_path, flat(content, ELL))
            area = up_area(found)
            assert len(found.faces) == 4 + 2 and np.all(turn * area[:4] > 0)
            assert area[:4].sum() == pytest.approx(turn * 5)
            assert found.polygon.tolist() == [0] * 4 + [1] * 2


@pytest.mark.parametrize("turn", [1, -1])
def test_a_hole_is_cut_out(tmp_path, turn):
    ring = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], float)
    points = np.concatenate([ring, 1 + 0.5 * ring, 0.25 + 0.1 * ring])
    hole = words((np.arange(4) + 4)[::turn])
    content = f"<polygons>{VERTEX}<ph><p>0 1 2 3</p><h>{hole}</h><h>8 9 10 11</h></ph></polygons>"
    area = up_area(read(tmp_path, flat(content, points)))
    assert np.all(area >= 0) and area.sum() == pytest.approx(16 - 4 - 0.16)


def test_positions_as_accessors_say(tmp_path):
    padded = np.column_stack([np.full(6, 7), ROW])
    for params in (["", "X", "Y", "Z"], ["W", "x", "y", "z"]):
        content = flat(triangles([0, 1, 2]), padded, params=params, stride=4)
        assert np.allclose(read(tmp_path, content).vertices, ROW)
    swapped = flat(triangles([0, 1, 2]), ROW[:, [1, 0, 2]], params="YXZ")
    assert np.allclose(read(tmp_path, swapped).vertices, ROW)
    unnamed = flat(triangles([0, 1, 2]), ROW, params=["", "", ""])
    assert np.allclose(read(tmp_path, unnamed).vertices, ROW)


def test_lines_and_splines_are_left_out_and_named(tmp_path):
    lines = f'<lines count="3">{VERTEX}<p>0 1 1 2 2 3</p></lines>'
    with pytest.warns(MeshWarning, match=r"x\.dae: left out: lines \(3\)"):
        assert len(read(tmp_path, flat(lines + triangles([0, 1, 2]))).faces) == 1
    with pytest.raises(ValueError, match=r"x\.dae: no triangles or polygons.*only lines .3."):
        read(tmp_path, flat(lines))
    spline = '<geometry id="g"><spline/></geometry>'
    with pytest.raises(ValueError, match="only geometries of spline .1."):
        read(tmp_path, document(spline, node(use())))
    elsewhere = node('<instance_geometry url="b.dae#g"/>' + use())
    with pytest.warns(MeshWarning, match="things in other files .1."):
        assert len(read(tmp_path, document(BRICK, elsewhere)).faces) == 12


def test_a_zae_is_an_archive_of_a_document(tmp_path):
    path = tmp_path / "x.zae"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other.dae", "<COLLADA/>")
        archive.writestr("a b.dae", document(BRICK, node(use())))
        archive.writestr("manifest.xml", "<dae_root>./a%20b.dae</dae_root>")
    assert len(read_mesh(path).faces) == 12
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("picture.png", "x")
    with pytest.raises(ValueError, match="no .dae in the archive"):
        read_mesh(path)


def test_images_are_not_opened(tmp_path, monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("an image was opened")

    monkeypatch.setattr("PIL.Image.open", refuse)
    images = (
        '<library_images><image id="i"><init_from>gone.png</init_from></image></library_images>'
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read(tmp_path, document(BRICK, node(use()), more=images)).faces) == 12


@pytest.mark.parametrize(
    "text, message",
    [
        (flat(triangles([0, 1, 9])), "names a vertex that does not exist: 9, and they are 0 to 5"),
        (flat(triangles([0, 1, -1])), "does not exist: -1"),
        (flat(f"<polylist>{VERTEX}<vcount>3 3</vcount><p>0 1 2 3</p></polylist>"),
         "cut short: the polygons of 'g' have 6 corners, and 4 are there"),
        (flat(f"<polygons>{VERTEX}<p>0 1 2 77</p></polygons>"), "does not exist: 77"),
        (flat(f"<triangles>{VERTEX}<p>0 a 2</p></triangles>"), "'a' in <p> is no number"),
        (flat(triangles([0, 1, 2], VERTEX.replace("#s-v", "#q"))), "triangles of 'g' are without"),
        (flat(triangles([0, 1, 2])).replace('count="6"', 'count="9"'), "cut short: 18 numbers of"),
        (flat(triangles([0, 1, 2])).replace('stride="3"', 'stride="1"'), "positions of 1 numbers"),
        (document(BRICK, node(use("h"))), "it names #h, and there is none"),
        (document(BRICK, node("<matrix>1 2</matrix>" + use())), "<matrix> has 2 numbers for 16"),
        (document(BRICK, node('<instance_node url="#n"/>', id="n")), "'n' hangs below itself"),
        (document(BRICK, node(use()))[:-20], "cut short: its XML ends too early"),
        (document(BRICK, node(use())).replace("</p>", ""), "its XML cannot be read"),
        ("<svg/>", "its XML is of 'svg', not COLLADA"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_named(tmp_path, text, message):
    with pytest.raises(ValueError) as caught:
        read(tmp_path, text)
    found = str(caught.value)
    assert message in found and found.startswith(str(tmp_path / "x.dae")) and "\n" not in found


# ------------------------------------------------------------------------------- skins and morphs


def names_source(number, names, tag="Name_array"):
    return f'<source id="{number}"><{tag} count="{len(names)}">{" ".join(names)}</{tag}></source>'


def floats_source(number, values):
    return f'<source id="{number}"><float_array>{words(values)}</float_array></source>'


# a strip of height 2: what is below 1 hangs on the hip, what is above on the knee, at 1 on both
STRIP = np.array([[x, y, 0] for y in (0, 1, 2) for x in (0, 1)], float)
STRIP_SHAPE = geometry(source(STRIP) + triangles([0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5]))
HIP = np.diag([0.1, 0.1, 0.1, 1.0])  # under an armature ten times as large
KNEE = HIP - np.eye(4)[:, 3:] @ [[0, 0, 0, 0]]
KNEE[1, 3] = -0.1


def skin(
    of="g", pairs="0 1 0 1 0 0 1 0 0 0 1 0 1 1 1 1", counts="1 1 2 2 1 1", tag="Name_array", more=""
):
    return (
        f'<controller id="c"><skin source="#{of}">{more}'
        + names_source("j", ["hip", "knee"], tag) + floats_source("b", [HIP, KNEE])
        + floats_source("w", [0.5, 1])
        + '<joints><input semantic="JOINT" source="#j"/>'
        '<input semantic="INV_BIND_MATRIX" source="#b"/></joints><vertex_weights count="6">'
        '<input semantic="JOINT" source="#j" offset="0"/>'
        f'<input semantic="WEIGHT" source="#w" offset="1"/><vcount>{counts}</vcount>'
        f"<v>{pairs}</v></vertex_weights></skin></controller>"
    )  # fmt: skip


def armature(key="sid"):
    knee = node("<translate>0 0.1 0</translate><rotate>0 0 1 90</rotate>", type="JOINT",
                **{key: "knee"})  # fmt: skip
    hip = node(knee, type="JOINT", **{key: "hip"})
    return node(f"<scale>10 10 10</scale>{hip}", id="root")


def with_skin(controllers, key="sid", up=""):
    used = '<instance_controller url="#c"><skeleton>#root</skeleton></instance_controller>'
    # the place of what is skinned does not matter
    nodes = armature(key) + node(f"<translate>7 7 7</translate>{used}", name="body")
    library = f"<library_controllers>{controllers}</library_controllers>"
    return document(STRIP_SHAPE, nodes, up, library)


def bent():
    upper = np.stack([-(STRIP[:, 1] - 1), 1 + STRIP[:, 0], STRIP[:, 2]], axis=1)
    expected = np.where(STRIP[:, 1:2] < 1, STRIP, upper)
    expected[2:4] = 0.5 * (STRIP + upper)[2:4]
    return expected


@pytest.mark.parametrize("key, tag", [("sid", "Name_array"), ("id", "IDREF_array")])
def test_a_skin_stands_in_the_pose_of_the_file(tmp_path, key, tag):
    found = read(tmp_path, with_skin(skin(tag=tag), key))
    assert np.allclose(found.vertices, bent()) and found.part_names == ("body",)
    upright = read(tmp_path, with_skin(skin(tag=tag), key, "Z_UP"))
    assert np.allclose(upright.vertices, bent()[:, [0, 2, 1]] * [1, 1, -1])


def test_what_a_skin_is_bound_in_comes_first(tmp_path):
    bound = "<bind_shape_matrix>1 0 0 0 0 1 0 0.5 0 0 1 0 0 0 0 1</bind_shape_matrix>"
    found = read(tmp_path, with_skin(skin(more=bound)))
    assert np.allclose(found.vertices[:2], STRIP[:2] + [0, 0.5, 0])


def test_weights_are_scaled_to_1_and_what_has_none_stays(tmp_path):
    pairs = "-1 1 0 0 0 0 1 0 0 0 1 0 1 1"
    found = read(tmp_path, with_skin(skin(pairs=pairs, counts="1 1 2 2 1 0")))
    expected = bent()
    expected[5] = STRIP[5]
    assert np.allclose(found.vertices, expected)


def morph(weight, method=""):
    method = f' method="{method}"' if method else ""
    return (
        f'<controller id="m"><morph source="#g"{method}>' + names_source("t", ["h"], "IDREF_array")
        + floats_source("a", [weight]) + '<targets><input semantic="MORPH_TARGET" source="#t"/>'
        '<input semantic="MORPH_WEIGHT" source="#a"/></targets></morph></controller>'
    )  # fmt: skip


def test_morphs_and_skins_of_morphs(tmp_path):
    wide = geometry(source(STRIP * [3, 1, 1], "s2"), "h")
    for weight, method, factor in ((0, "", 1), (0.5, "", 2), (0.5, "RELATIVE", 2.5)):
        library = f"<library_controllers>{morph(weight, method)}</library_controllers>"
        used = '<instance_controller url="#m"/>'
        found = read(tmp_path, document(STRIP_SHAPE + wide, node(used), more=library))
        assert np.allclose(found.vertices[:, 0], factor * STRIP[:, 0])
    both = with_skin(skin(of="m") + morph(0.5)).replace(
        "<library_geometries>", "<library_geometries>" + wide
    )
    assert np.allclose(read(tmp_path, both).vertices[:2], STRIP[:2] * [2, 1, 1])


@pytest.mark.parametrize(
    "text, message",
    [
        (with_skin(skin(counts="1 1 2")), "cut short: weights of 3 vertices for 6"),
        (with_skin(skin(pairs="9 1" + " 0 1" * 7)), "a vertex hangs on joint 9 of 2"),
        (with_skin(skin(pairs="0 9" + " 0 1" * 7)), "a vertex has weight 9 of 2"),
        (with_skin(skin()).replace('sid="knee"', 'sid="elbow"'), "joint 'knee', and there is none"),
        (with_skin(skin(of="c")), "a controller where a geometry is to be"),
        (with_skin('<controller id="c"/>'), "neither skin nor morph"),
    ],
)
def test_controllers_that_are_damaged_are_named(tmp_path, text, message):
    with pytest.raises(ValueError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_any_change_of_the_text_is_read_or_refused_in_one_line(tmp_path):
    wide = geometry(source(STRIP * [3, 1, 1], "s2"), "h")
    text = with_skin(skin(of="m") + morph(0.5)).replace(STRIP_SHAPE, STRIP_SHAPE + wide)
    path, rng = tmp_path / "x.dae", np.random.default_rng(4)
    good = 0
    for _ in range(200):
        path.write_bytes(damaged(text.encode(), rng))
        good += is_read_or_refused(read_mesh, path)
    assert 0 < good < 100
