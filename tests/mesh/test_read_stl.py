"""STL files, binary and text, of all dialects."""

import warnings

import numpy as np
import pytest
import shapes
import trimesh

from strokestyle.mesh.messages import MeshWarning
from strokestyle.mesh.read import read_mesh
from strokestyle.mesh.read_stl import HEAD, read_stl
from strokestyle.mesh.read_with_trimesh import read_with_trimesh
from strokestyle.mesh.surface import load_surface

FACE = """  facet normal 0 0 1
    outer loop
      vertex 0 0 0
      vertex {} 0 0
      vertex 0 1.5e0 -2.5E-1
    endloop
  endfacet
"""
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1.5, -0.25]]
TEXT = "solid a part of it\n" + FACE.format("1") + FACE.format("+2.") + "endsolid a part of it\n"


def binary(corners, header=b"", count=None):
    """A binary file of faces (F, 3, 3)."""
    table = np.zeros(len(corners), [("n", "<f4", 3), ("corner", "<f4", (3, 3)), ("c", "<u2")])
    table["corner"] = corners
    table["n"] = np.nan
    count = len(corners) if count is None else count
    return header.ljust(80, b"\0") + np.array(count, "<u4").tobytes() + table.tobytes()


def sphere():
    shape = shapes.sphere(1)
    return shape.vertices[shape.faces].astype(np.float32)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_the_same_as_by_trimesh(tmp_path, kind):
    data = trimesh.Trimesh(*shapes.torus(1, 0.4, 12, 8), process=False).export(file_type=kind)
    path = tmp_path / "x.stl"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    ours, theirs = read_mesh(path), read_with_trimesh(path)
    assert np.array_equal(ours.vertices[ours.faces], theirs.vertices[theirs.faces])
    assert not ours.part.any()


@pytest.mark.parametrize("header", [b"", b"solid", b"solid made of facets, all binary", b"x" * 80,
                                    b"solid\nfacet"])  # fmt: skip
@pytest.mark.parametrize("behind", [0, 1, 2, 49])
def test_binary_files_whatever_their_header(header, behind):
    found = read_stl(binary(sphere(), header) + b"\1" * behind)
    assert np.array_equal(found.vertices[found.faces], sphere())
    assert found.vertices.dtype == np.float64 and found.part_names == ("",)


def test_binary_files_whose_count_is_wrong():
    for left in range(1, 60):
        with pytest.raises(ValueError, match=f"cut short: {79 - (left - 1) // 50} of its 80 tri"):
            read_stl(binary(sphere(), b"\0")[:-left])
    with pytest.warns(MeshWarning, match="it says that it has no triangles, and has 80"):
        assert len(read_stl(binary(sphere(), count=0)).faces) == 80
    with pytest.warns(MeshWarning, match="left out: 100 bytes behind the 78 triangles"):
        assert len(read_stl(binary(sphere(), count=78)).faces) == 78
    with pytest.raises(ValueError, match="80 of its 4294967295 triangles"):
        read_stl(binary(sphere(), count=2**32 - 1))
    assert len(read_stl(binary(sphere()[:0])).faces) == 0


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text,
        lambda text: text.replace("\n", "\r"),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.upper(),
        lambda text: text.replace("endsolid a part of it\n", ""),
        lambda text: text.replace("endsolid a part of it\n", "endsolid"),
        lambda text: "\ufeff" + text,
        lambda text: "\n \n" + text.replace("  ", "\t"),
        lambda text: "# outer loop\n; vertex\n" + text.replace("endloop\n", "endloop\n# x\n"),
        lambda text: text.replace("normal 0 0 1", "normal nan() - -1.#IND"),
        lambda text: text.replace("normal 0 0 1", ""),
        lambda text: text.replace("facet normal", "solid a part of it\nfacet normal"),
        lambda text: text.replace("normal 0 0 1", "normal 0 0 1 vertex"),
        lambda text: text.replace("outer loop", "outerloop").replace("vertex ", "vertex   "),
        lambda text: text.replace("\n", " ").replace("of it ", "of it\n"),
        lambda text: text.replace("solid a part of it\n", "solid a part of it \n\n\n", 1),
    ],
)  # fmt: skip
def test_dialects_of_text(change):
    found = read_stl(change(TEXT).encode())
    corners = found.vertices[found.faces]
    assert np.array_equal(corners[0], CORNERS) and corners.shape == (2, 3, 3)
    assert corners[1, 1].tolist() == [2, 0, 0]
    assert [name.lower() for name in found.part_names] == ["a part of it"]


def test_solids_are_parts():
    face = FACE.format("1")
    loops = read_stl(f"solid loop\n{face}endsolid loop\nsolid vertex outer loop\n{face}".encode())
    assert len(loops.faces) == 2 and set(loops.part_names) == {"loop", "vertex outer loop"}
    text = (
        f"solid body\n{face}{face}endsolid body\nsolid\n{face}endsolid\nsolid my solid state\n"
        f"{face}endsolid my solid state\nsolid empty\nendsolid empty\nsolid body\n{face}"
    )
    found = read_stl(text.encode())
    names = [found.part_names[i] for i in found.part]
    assert names == ["body", "body", "", "my solid state", "body"]
    assert set(found.part_names) == {"body", "", "my solid state"}
    one_line = read_stl(text.replace("\n", " ").encode())  # no name can be told from what follows
    assert len(one_line.faces) == 5
    assert read_stl(("solid caf\u00e9\n" + face).encode("latin-1")).part_names == ("caf\ufffd",)


@pytest.mark.parametrize(
    "data, message",
    [
        (TEXT[:-100], "cut short: it ends within triangle 2"),
        (TEXT[: TEXT.index("endloop")], "cut short: it ends within triangle 1"),
        (TEXT.replace("vertex 0 0 0", "vertex 0 0 zero"), "line 4: 'zero' is not a number"),
        (TEXT.replace("vertex +2. 0 0", "vertex 2,5 0 0"), "line 12: '2,5' is not a number"),
        (TEXT.replace("vertex 0 0 0", "vertex 0 0", 1), "6 vertices have 17 numbers"),
        (TEXT.replace("vertex 0 0 0\n", "", 1), "2 triangles have 5 vertices, not three each"),
        ("solid nothing\nendsolid nothing\n", "no faces in it"),
        ("<html>not found</html>" * 20, "a web page, not a mesh: download the mesh itself"),
        (TEXT[: TEXT.rindex("outer")], "cut short: it ends within triangle 2"),
        ("\x89PNG", "neither"),
        (TEXT.encode("utf-16"), "UTF-16"),
        (TEXT.encode("utf-16-le"), "UTF-16"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, data, message):
    path = tmp_path / "x.stl"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_text_without_an_end_may_be_cut_short():
    whole = TEXT[: TEXT.rindex("endsolid")]
    for text in (whole, whole + "endso", TEXT[: TEXT.rindex("endloop") + 7]):
        with pytest.warns(MeshWarning, match="perhaps cut short: no 'endsolid' behind its 2 tri"):
            assert len(read_stl(text.encode()).faces) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for text in (TEXT, TEXT.upper(), whole + "end solid", whole + "endsolid a facet of it"):
            assert len(read_stl(text.encode()).faces) == 2


def test_cut_anywhere_is_an_error_or_all_whole_triangles():
    for data in (binary(sphere()[:2]), TEXT.encode()):
        for end in range(len(data)):
            try:
                found = read_stl(data[:end])
            except ValueError:
                continue
            assert len(found.faces) in (0, 1, 2)
            if data[:5] == b"solid":
                assert len(found.faces) == data[:end].count(b"endloop")


def test_damage_anywhere_is_an_error_or_a_mesh():
    rng = np.random.default_rng(0)
    for whole in (binary(sphere()[:3]), TEXT.encode()):
        data = np.frombuffer(whole, np.uint8)
        for _ in range(300):
            bad = data.copy()
            at = rng.integers(0, len(bad), rng.integers(1, 4))
            bad[at] = rng.choice([rng.integers(0, 256), 32, 10, 57, 255])
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    warnings.simplefilter("ignore", MeshWarning)
                    found = read_stl(bad.tobytes())
            except ValueError:
                continue
            assert found.vertices.shape == (3 * len(found.faces), 3)


def test_a_text_and_a_binary_file_of_one_shape_are_one_surface(tmp_path):
    corners = sphere()
    lines = ["solid x"]
    for face in corners:
        rows = ["vertex {:.9g} {:.9g} {:.9g}".format(*corner) for corner in face]
        lines += ["facet normal 0 0 0", "outer loop", *rows, "endloop", "endfacet"]
    (tmp_path / "text.stl").write_text("\r".join([*lines, "endsolid"]))
    (tmp_path / "binary.stl").write_bytes(binary(corners) + b"\n")
    text, bytes_ = (load_surface(tmp_path / f"{name}.stl") for name in ("text", "binary"))
    assert np.allclose(text.vertices, bytes_.vertices, atol=1e-7)
    assert (text.edge_face_count == 2).all() and len(text.faces) == 80 and HEAD == 84
