"""3MF packages: which objects stand where, of which file, and what they are called."""

import re
import warnings
import zipfile

import numpy as np
import pytest
import shapes
from damage import damaged, is_read_or_refused

from strokestyle.mesh import read_3mf as module
from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.read import read_mesh

CUBE = shapes.cube()
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
MODEL = "3D/3dmodel.model"
REL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"


def box_mesh(size=(1, 1, 1), flip=False):
    """<mesh> of a box from the origin to `size`."""
    low, high = CUBE.vertices.min(axis=0), CUBE.vertices.max(axis=0)
    points = (CUBE.vertices - low) / (high - low) * size
    vertices = "".join(f'<vertex x="{x:g}" y="{y:g}" z="{z:g}"/>' for x, y, z in points)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="9"/>' for a, b, c in CUBE.faces)
    return f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>"


def thing(number, content, **attributes):
    more = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f'<object id="{number}"{more}>{content}</object>'


def part(number, transform="", path=""):
    more = f' transform="{transform}"' if transform else ""
    more += f' p:path="{path}"' if path else ""
    return f'<component objectid="{number}"{more}/>'


def parts(*each):
    return f"<components>{''.join(each)}</components>"


def model(objects, items="", unit="millimeter", more=""):
    return (f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="{unit}" xmlns="{CORE}" '
            f'xmlns:p="{PRODUCTION}" {more}><metadata name="Title">t</metadata>'
            f"<resources>{objects}</resources><build>{items}</build></model>")  # fmt: skip


def item(number, transform="", **attributes):
    more = "".join(f' {key.replace("__", ":")}="{value}"' for key, value in attributes.items())
    more += f' transform="{transform}"' if transform else ""
    return f'<item objectid="{number}"{more}/>'


def read(folder, root, **files):
    """Read a package of a root model and other files."""
    path = folder / "x.3mf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("_rels/.rels", f'<Relationships xmlns="r"><Relationship Target="/{MODEL}" '
                         f'Id="a" Type="{REL}"/></Relationships>')  # fmt: skip
        package.writestr(MODEL, root)
        for name, text in files.items():
            package.writestr(name, text)
    return read_mesh(path)


def box(found, name=None):
    chosen = [name is None or found.part_names[i] == name for i in found.part]
    points = found.vertices[found.faces[chosen]].reshape(-1, 3)
    return points.min(axis=0).round(6).tolist(), points.max(axis=0).round(6).tolist()


def volume(found):
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6.0


def test_items_are_placed_by_rows_of_their_transforms(tmp_path):
    turned = "0 1 0 -1 0 0 0 0 2 10 20 30"  # x to y, y to -x, z twice as long, then moved
    found = read(tmp_path, model(thing(1, box_mesh((3, 1, 1))), item(1, turned)))
    assert box(found) == ([9, 20, 30], [10, 23, 32]) and volume(found) == pytest.approx(6)
    assert found.part_names == ("",)


def test_components_stand_one_in_another(tmp_path):
    inner = thing(1, box_mesh(), name="brick")
    pair = thing(2, parts(part(1), part(1, "1 0 0 0 1 0 0 0 1 5 0 0")), name="pair")
    four = thing(3, parts(part(2, "2 0 0 0 2 0 0 0 2 0 0 0"), part(2, "1 0 0 0 1 0 0 0 1 0 9 0")))
    found = read(tmp_path, model(inner + pair + four, item(3, "1 0 0 0 1 0 0 0 1 0 0 7")))
    assert len(found.faces) == 4 * 12 and volume(found) == pytest.approx(2 * 8 + 2)
    assert box(found) == ([0, 0, 7], [12, 10, 9]) and found.part_names == ("brick",)


def test_a_mirrored_item_keeps_its_outside(tmp_path):
    found = read(tmp_path, model(thing(1, box_mesh()), item(1, "-1 0 0 0 1 0 0 0 1 0 0 0")))
    assert volume(found) == pytest.approx(1) and box(found)[0] == [-1, 0, 0]


def test_an_unnamed_object_built_twice_is_two_bodies_without_a_name(tmp_path):
    found = read(
        tmp_path, model(thing(1, box_mesh()), item(1) + item(1, "1 0 0 0 1 0 0 0 1 4 0 0"))
    )
    assert len(found.faces) == 24 and len(found.vertices) == 16 and found.part_names == ("",)


def test_objects_of_one_number_in_several_files(tmp_path):
    """As Bambu Studio, OrcaSlicer and the production extension have them."""
    root = model(
        thing(2, parts(part(1, path="/3D/Objects/a.model")), name="tall")
        + thing(4, parts(part(1, path="/3D/Objects/b.model"))),
        item(2) + item(4, "1 0 0 0 1 0 0 0 1 40 0 0"), more='requiredextensions="p"',
    )  # fmt: skip
    files = {
        "3D/Objects/a.model": model(thing(1, box_mesh((1, 1, 3)))),
        "3D/Objects/B.model": model(thing(1, box_mesh((3, 2, 1)), name="flat"), item(1)),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read(tmp_path, root, **files)
    assert len(found.faces) == 24 and set(found.part_names) == {"tall", "flat"}
    assert box(found, "tall") == ([0, 0, 0], [1, 1, 3])
    assert box(found, "flat") == ([40, 0, 0], [43, 2, 1])


def test_an_item_may_name_a_file(tmp_path):
    root = model("", item(1, p__path="/3D/a.model"))
    assert len(read(tmp_path, root, **{"3D/a.model": model(thing(1, box_mesh()))}).faces) == 12


def test_every_file_has_its_own_unit(tmp_path):
    root = model(
        thing(1, box_mesh((1, 1, 1)), name="inch")
        + thing(2, parts(part(7, "1 0 0 0 1 0 0 0 1 2 0 0", "/a.model"))),
        item(1) + item(2), unit="inch",
    )  # fmt: skip
    child = thing(1, box_mesh((25.4, 25.4, 50.8)), name="millimetre")
    child += thing(7, parts(part(1, "1 0 0 0 1 0 0 0 1 0 254 0")))
    found = read(tmp_path, root, **{"a.model": model(child)})
    assert box(found, "inch") == ([0, 0, 0], [1, 1, 1])
    assert np.allclose(box(found, "millimetre"), ([2, 10, 0], [3, 11, 2]))


def test_what_is_not_of_the_shape_is_left_out_and_named(tmp_path):
    kinds = ["model", "surface", "support", "solidsupport", "other"]
    objects = "".join(thing(i, box_mesh(), type=kind, name=kind) for i, kind in enumerate(kinds))
    together = thing(9, parts(*map(part, range(5))))
    with pytest.warns(MeshWarning, match="objects of type 'support' .1., objects of type 'solids"):
        found = read(tmp_path, model(objects + together, item(9)))
    assert found.part_names == ("model", "surface")
    with pytest.raises(ValueError, match="no triangles in what it is to build, only objects of"):
        read(tmp_path, model(objects, item(4)))


def test_where_nothing_is_to_be_built_all_is_drawn_once(tmp_path):
    objects = thing(1, box_mesh()) + thing(2, parts(part(1), part(1)))
    assert len(read(tmp_path, model(objects)).faces) == 24


def test_names_of_volumes_by_bambu_studio(tmp_path):
    root = model(thing(8, parts(*(part(i, path="/a.model") for i in (1, 2, 3)))), item(8))
    child = model("".join(thing(i, box_mesh()) for i in (1, 2, 3)))

    def volume(number, name, kind="normal_part"):
        return (f'<part id="{number}" subtype="{kind}"><metadata key="name" value="{name}"/>'
                f'<metadata key="source_file" value="a.stl"/></part>')  # fmt: skip

    config = (
        '<?xml version="1.0" encoding="UTF-8"?><config><object id="8">'
        '<metadata key="name" value="whole"/>'
        + volume(1, "lid") + volume(2, "hole", "negative_part") + volume(3, "")
        + '</object><plate><metadata key="plater_id" value="1"/></plate></config>'
    )  # fmt: skip
    files = {"a.model": child, "Metadata/model_settings.config": config}
    with pytest.warns(MeshWarning, match=r"left out: modifiers \(1\)"):
        found = read(tmp_path, root, **files)
    assert [found.part_names[i] for i in found.part] == ["lid"] * 12 + ["whole"] * 12


def test_names_of_volumes_by_prusaslicer(tmp_path):
    def volume(first, last, name, kind):
        return (f'<volume firstid="{first}" lastid="{last}"><metadata type="volume" key="name" '
                f'value="{name}"/><metadata type="volume" key="volume_type" value="{kind}"/>'
                "</volume>")  # fmt: skip

    config = (
        '<?xml version="1.0" encoding="UTF-8"?><config><object id="1" instances_count="1">'
        '<metadata type="object" key="name" value="whole"/>'
        + volume(0, 3, "top", "ModelPart") + volume(4, 9, "rest", "ModelPart")
        + volume(10, 11, "grid", "ParameterModifier") + "</object></config>"
    )  # fmt: skip
    root = model(thing(1, box_mesh()), item(1))
    with pytest.warns(MeshWarning, match=r"left out: modifiers \(1\)"):
        found = read(tmp_path, root, **{"Metadata/Slic3r_PE_model.config": config})
    assert [found.part_names[i] for i in found.part] == ["top"] * 4 + ["rest"] * 6


def test_part_numbers_are_names_where_there_are_no_others(tmp_path):
    objects = thing(1, box_mesh(), partnumber="P-1") + thing(2, box_mesh())
    found = read(tmp_path, model(objects, item(1) + item(2, partnumber="P-2")))
    assert found.part_names == ("P-1", "P-2")


def test_geometry_of_extensions_is_named(tmp_path):
    lattice = (
        '<b:beamlattice xmlns:b="b"><b:beams><b:beam v1="0" v2="1"/></b:beams></b:beamlattice>'
    )
    beams = box_mesh().replace("</mesh>", lattice + "</mesh>")
    with pytest.warns(MeshWarning, match=r"left out: beams \(1\)"):
        assert len(read(tmp_path, model(thing(1, beams), item(1))).faces) == 12
    only = beams[: beams.index("<triangles>")] + "<triangles/>" + lattice + "</mesh>"
    with pytest.raises(ValueError, match=r"to build, only beams \(1\)"):
        read(tmp_path, model(thing(1, only), item(1)))
    slices = '<s:slicestack xmlns:s="s" id="5"><s:slice><s:vertices><s:vertex x="0" y="0"/>'
    slices += "</s:vertices></s:slice></s:slicestack>"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(tmp_path, model(slices + thing(1, box_mesh()), item(1)))
    with pytest.raises(ValueError, match="to build, only slices .1."):
        read(tmp_path, model(slices + thing(1, "", slicestackid="5"), item(1)))


def test_an_extension_that_is_required_and_unknown_is_named(tmp_path):
    more = 'requiredextensions="p q" xmlns:q="http://example.org/bend"'
    with pytest.warns(MeshWarning, match="it requires http://example.org/bend, which is not read"):
        read(tmp_path, model(thing(1, box_mesh()), item(1), more=more))


BAD_FACE = re.sub('v1="."', 'v1="8"', box_mesh(), count=1)


@pytest.mark.parametrize(
    "root, message",
    [
        (model(thing(1, BAD_FACE, name="a"), item(1)),
         "a triangle of 'a' names a vertex that does not exist: 8, and they are 0 to 7"),
        (model(thing(1, BAD_FACE.replace('"8"', '"-1"')), item(1)), "does not exist: -1"),
        (model(thing(1, BAD_FACE.replace('"8"', '"x"')), item(1)), "line 2: invalid literal"),
        (model(thing(1, box_mesh().replace(' z="0"', "", 1)), item(1)), "line 2: no 'z'"),
        (model(thing(1, box_mesh()), item(7)), "names object 7 of 3d/3dmodel.model, and there"),
        (model(thing(1, box_mesh()), item(1, "1 0 0")), "a transform of 3 numbers for 12"),
        (model(thing(1, parts(part(1))), item(1)), "object 1 is a component of itself"),
        (model(thing(1, parts(part(2))) + thing(2, parts(part(1))), item(1)), "of itself"),
        (model(thing(1, parts(part(2, path="/gone.model"))), item(1)), "no 'gone.model' in it"),
        (model(thing(1, box_mesh()), item(1), unit="parsec"), "'parsec' is no unit"),
        (model(thing(1, box_mesh()), item(1))[:-30], "cut short: its XML ends too early"),
        (model(thing(1, "<mesh></object>"), item(1)), "its XML cannot be read (mismatched tag"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><model/>", "a document type"),
        (model("", ""), "no triangles in what it is to build"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_named(tmp_path, root, message):
    with pytest.raises(ValueError) as caught:
        read(tmp_path, root)
    text = str(caught.value)
    assert message in text and text.startswith(str(tmp_path / "x.3mf")) and "\n" not in text


def test_few_components_may_not_ask_for_billions(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MAX_USES", 1000)
    objects = thing(1, box_mesh())
    objects += "".join(thing(i, parts(part(i - 1), part(i - 1))) for i in range(2, 40))
    with pytest.raises(ValueError, match="more than 1000 objects"):
        read(tmp_path, model(objects, item(39)))


def test_a_package_that_is_none(tmp_path):
    path = tmp_path / "x.3mf"
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("readme.txt", "hi")
    with pytest.raises(ValueError, match="there is no model in it"):
        read_mesh(path)
    whole = path.read_bytes()
    for end in (whole[:-30], whole[:40]):
        path.write_bytes(end)
        with pytest.raises(ValueError, match="cut short: the end of its zip archive is not there"):
            read_mesh(path)
    path.write_bytes(b"no archive at all, " * 9)
    with pytest.raises(ValueError, match="its zip archive cannot be read: File is not a zip file"):
        read_mesh(path)
    path.write_bytes(whole.replace(b"hi", b"ho").replace(b"readme.txt", b"read.model"))
    with pytest.raises(ValueError, match="its zip archive cannot be read: Bad CRC"):
        read_mesh(path)


def test_without_relations_the_usual_name_is_found(tmp_path):
    path = tmp_path / "x.3mf"
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("3D/a.model", model(""))
        package.writestr("3D/3DModel.model", model(thing(1, box_mesh()), item(1)))
    assert len(read_mesh(path).faces) == 12


def test_any_change_of_the_text_is_read_or_refused_in_one_line(tmp_path):
    twice = parts(part(1), part(1, "1 0 0 0 1 0 0 0 1 5 0 0"))
    text = model(thing(1, box_mesh(), name="a") + thing(2, twice), item(2))
    path, rng = tmp_path / "x.3mf", np.random.default_rng(5)
    good = 0
    for _ in range(200):
        with zipfile.ZipFile(path, "w") as package:
            package.writestr(MODEL, damaged(text.encode(), rng))
        good += is_read_or_refused(read_mesh, path)
    assert 0 < good < 100
