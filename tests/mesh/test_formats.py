"""Formats that other packages read, archives, and what would do with all else; nothing of it all
reaches the terminal but our own one line."""

import logging
import os
import subprocess
import sys
import warnings
import zipfile

import gltf_files
import numpy as np
import pytest
import shapes
from damage import damaged, is_read_or_refused

from strokestyle.mesh import archive
from strokestyle.mesh.formats import what_would_do
from strokestyle.mesh.messages import MeshWarning, silence, warn
from strokestyle.mesh.read import READERS, SCENES, read_mesh
from strokestyle.mesh.read_with_meshio import FORMATS

CUBE = shapes.cube()
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0],
                    [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)  # fmt: skip
QUADS = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                  [3, 0, 4, 7]])  # fmt: skip


def volume(found):
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6.0


# --------------------------------------------------------------------------------- all other files


@pytest.mark.parametrize(
    "name, message",
    [
        ("a.blend", ".blend is read by Blender alone: there, File > Export > glTF 2.0"),
        ("a.FBX", ".fbx is not read here: in Blender, File > Import"),
        ("a.usdz", "`assimp export IN OUT.glb`"),
        ("a.sldprt", "export it as STEP"),
        ("a.ifc", "`IfcConvert IN.ifc OUT.glb`"),
        ("a.scad", "`openscad -o OUT.stl IN.scad`"),
        ("a.ctm", "in MeshLab, File > Export Mesh As"),
        ("a.xyz", "a point cloud, which cannot be drawn: mesh it first"),
        ("a.dxf", "lines, not faces"),
        ("a.png", "a picture, not a mesh"),
        ("a.tar.gz", "an archive: unpack it first"),
        ("a.txt", ".txt is not a mesh format; use obj, ply, stl, off, glb, 3mf, dae or step"),
        ("a", "no suffix to tell the mesh format by; use obj"),
    ],
)
def test_what_would_do_is_said_of_files_that_are_not_read(tmp_path, name, message):
    path = tmp_path / name
    path.write_bytes(b"BLENDER")
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ") and message in text and "\n" not in text


@pytest.mark.parametrize("suffix", sorted({*READERS, *SCENES, ".zip"}))
def test_what_sites_give_in_place_of_a_mesh_is_said(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    path.write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    with pytest.raises(ValueError, match="a pointer to the mesh, of Git LFS: `git lfs pull`"):
        read_mesh(path)
    for page in (b"\n<!DOCTYPE html>\n<html>", b"<!-- x --><HTML lang=en>", b"<html>"):
        path.write_bytes(page)
        with pytest.raises(ValueError) as caught:
            read_mesh(path)
        assert str(caught.value) == f"{path}: a web page, not a mesh: download the mesh itself"


def test_no_advice_is_given_on_what_is_read():
    for suffix in {*READERS, *SCENES, ".zip"}:
        assert "not a mesh format" in what_would_do(suffix)


@pytest.mark.parametrize("name, package", [("a.step", "cascadio"), ("a.igs", "cascadio"),
                                           ("a.msh", "meshio"), ("a.med", "meshio h5py"),
                                           ("a.exo", "meshio netCDF4")])  # fmt: skip
def test_the_package_that_helps_is_named(tmp_path, monkeypatch, name, package):
    monkeypatch.setitem(sys.modules, package.split()[0], None)
    path = tmp_path / name
    path.write_text("$MeshFormat")
    with pytest.raises(ValueError) as caught:
        read_mesh(path)
    suffix = path.suffix
    assert str(caught.value) == (
        f"{path}: reading {suffix} files needs another package: pip install {package}"
    )


# ------------------------------------------------------------------------------------------- STEP


def step(name):
    """A STEP file of one block of 10 x 20 x 30 mm, by the planes of its faces."""
    lines = [
        "APPLICATION_CONTEXT('automotive design')",
        "APPLICATION_PROTOCOL_DEFINITION('','automotive_design',2000,#1)",
        "PRODUCT_CONTEXT('',#1,'mechanical')",
        f"PRODUCT('{name}','{name}','',(#3))",
        "PRODUCT_DEFINITION_FORMATION('','',#4)",
        "PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design')",
        "PRODUCT_DEFINITION('design','',#5,#6)",
        "PRODUCT_DEFINITION_SHAPE('','',#7)",
        "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))",
        "(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))",
        "(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())",
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#9,#10,#11))"
        "REPRESENTATION_CONTEXT('',''))",
    ]

    def add(text):
        lines.append(text)
        return f"#{len(lines)}"

    def triple(kind, values):
        return add(f"{kind}('',({','.join(f'{value:.6f}' for value in values)}))")

    points = [triple("CARTESIAN_POINT", point) for point in CORNERS * [10, 20, 30]]
    faces = []
    for ring in (
        [0, 3, 2, 1],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ):
        along = CORNERS[ring[1]] - CORNERS[ring[0]]
        normal = np.cross(along, CORNERS[ring[2]] - CORNERS[ring[1]])
        axes = triple("DIRECTION", normal), triple("DIRECTION", along)
        axes = add(f"AXIS2_PLACEMENT_3D('',{points[ring[0]]},{','.join(axes)})")
        plane = add(f"PLANE('',{axes})")
        loop = add(f"POLY_LOOP('',({','.join(points[i] for i in ring)}))")
        bound = add(f"FACE_OUTER_BOUND('',{loop},.T.)")
        faces.append(add(f"FACE_SURFACE('',({bound}),{plane},.T.)"))
    shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
    body = add(f"FACETED_BREP('',{shell})")
    shape = add(f"FACETED_BREP_SHAPE_REPRESENTATION('{name}',({body}),#12)")
    add(f"SHAPE_DEFINITION_REPRESENTATION(#8,{shape})")
    data = "".join(f"#{i}={line};\n" for i, line in enumerate(lines, 1))
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('x','',(''),(''),'','',"
        f"'');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n{data}ENDSEC;\n"
        "END-ISO-10303-21;\n"
    )


def test_step(tmp_path, capfd):
    pytest.importorskip("cascadio", reason="cascadio is not installed")
    path = tmp_path / "x.stp"
    path.write_text(step("bracket"))
    found = read_mesh(path)
    assert len(found.faces) == 12 and found.part_names == ("bracket",)
    size = np.ptp(found.vertices, axis=0)
    assert np.allclose(size / size[0], [1, 2, 3]) and volume(found) > 0
    path.write_text(step("bracket")[:400])
    with pytest.raises(ValueError, match=r"x\.stp: damaged, or not in stp format"):
        read_mesh(path)
    assert capfd.readouterr() == ("", "")


# ------------------------------------------------------------------------------------------ meshio

TETRA = np.array([[0, 1, 2, 5], [0, 2, 7, 5], [0, 2, 3, 7], [0, 5, 7, 4], [2, 7, 5, 6]])


@pytest.mark.parametrize("suffix", [suffix for suffix, more in FORMATS.items() if not more])
def test_meshes_of_simulations(tmp_path, suffix):
    """Solid cells end at the cube's surface, whatever they are; each suffix is one that is read."""
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    path = tmp_path / f"x{suffix}"
    with silence():
        meshio.write(path, meshio.Mesh(CORNERS, [("tetra", TETRA)]))
    found = read_mesh(path)
    assert len(found.faces) == 12 and abs(volume(found)) == pytest.approx(1)


def test_faces_inside_a_solid_are_left_out_and_flat_cells_on_it_are_not_doubled(tmp_path):
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    two = np.concatenate([CORNERS, CORNERS[4:] + [0, 0, 1], CORNERS[:4] + [9, 0, 0]])
    cells = [("hexahedron", [[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11]]),
             ("triangle", [[0, 2, 1], [0, 3, 2]]), ("quad", [[0, 3, 2, 1], [12, 13, 14, 15]]),
             ("line", [[0, 1]]), ("vertex", [[0]])]  # fmt: skip
    path = tmp_path / "x.vtu"
    with silence():
        meshio.write(path, meshio.Mesh(two, cells))
    found = read_mesh(path)
    # ten sides of the two cubes, the two triangles over the diagonal of one, and the far quad
    assert len(found.faces) == 2 * 10 + 2 + 2
    assert found.polygon is not None and len(np.unique(found.polygon)) == 10 + 2 + 1


def test_the_middles_of_sides_of_curved_cells_are_no_corners(tmp_path):
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    points = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    path = tmp_path / "x.vtu"
    with silence():
        meshio.write(path, meshio.Mesh(points, [("triangle6", [[0, 1, 2, 3, 4, 5]])]))
    assert read_mesh(path).faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    "kind, cells, faces",
    [
        ("wedge", [[0, 1, 2, 4, 5, 6]], 2 + 3 * 2),
        ("pyramid", [[0, 1, 2, 3, 4]], 2 + 4),
        ("hexahedron", [[0, 1, 2, 3, 4, 5, 6, 7]], 12),
    ],
)
def test_solid_cells_are_closed_and_wound_outward(tmp_path, kind, cells, faces):
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    path = tmp_path / "x.vtu"
    with silence():
        meshio.write(path, meshio.Mesh(CORNERS, [(kind, cells)]))
    found = read_mesh(path)
    sides = found.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert len(found.faces) == faces and volume(found) > 0.1
    assert {tuple(side) for side in sides.tolist()} == {tuple(s) for s in sides[:, ::-1].tolist()}


def gmsh(groups):
    """A gmsh file of version 2.2: the cube's quads, in physical groups by their names."""
    names = "".join(f'2 {i + 1} "{name}"\n' for i, name in enumerate(groups) if name)
    nodes = "".join(f"{i + 1} {x:g} {y:g} {z:g}\n" for i, (x, y, z) in enumerate(CORNERS))
    number, quads = 0, ""
    for group, rows in enumerate(groups.values(), 1):
        for row in rows:
            number += 1
            quads += f"{number} 3 2 {group} 1 {' '.join(str(i + 1) for i in QUADS[row])}\n"
    return (
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{names.count(chr(10))}\n{names}"
        f"$EndPhysicalNames\n$Nodes\n8\n{nodes}$EndNodes\n$Elements\n{number}\n{quads}$EndElements\n"
    )


def test_physical_groups_of_gmsh_are_parts(tmp_path, capfd):
    pytest.importorskip("meshio", reason="meshio is not installed")
    path = tmp_path / "x.msh"
    path.write_text(gmsh({"floor": [0], "walls": [2, 3, 4, 5], "lid": [1]}))
    found = read_mesh(path)
    assert volume(found) == pytest.approx(1)
    assert [found.part_names[i] for i in found.part] == ["floor"] * 2 + ["walls"] * 8 + ["lid"] * 2
    path.write_text(gmsh({"floor": []}))
    with pytest.raises(ValueError, match=r"x\.msh: no faces in it, only 8 points"):
        read_mesh(path)
    path.write_text("hello")
    with pytest.raises(ValueError, match=r"x\.msh: meshio cannot read it.*save it as \.vtu"):
        read_mesh(path)
    assert capfd.readouterr() == ("", "")


def test_any_change_of_a_gmsh_file_is_read_or_refused_in_one_line(tmp_path):
    pytest.importorskip("meshio", reason="meshio is not installed")
    text = gmsh({"floor": [0], "walls": [2, 3, 4, 5], "lid": [1]})
    path, rng = tmp_path / "x.msh", np.random.default_rng(6)
    good = 0
    for _ in range(200):
        path.write_bytes(damaged(text.encode(), rng))
        good += is_read_or_refused(read_mesh, path)
    assert 0 < good < 100


def test_vtk_of_the_kind_that_meshio_does_not_read_is_named_before_it_is_asked_for(
    tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "meshio", None)
    path = tmp_path / "x.vtk"
    path.write_text("# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 0 float\n")
    with pytest.raises(ValueError, match="POLYDATA is not read: save it as .ply"):
        read_mesh(path)


# ---------------------------------------------------------------------------------------- archives


def plate():
    gltf = gltf_files.Gltf()
    gltf.node(gltf.mesh(gltf.shape(*CUBE)), name="cube")
    return gltf


def zipped(path, **files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        for name, data in files.items():
            package.writestr(name, data)
    return path


def test_the_mesh_of_an_archive_is_read_with_the_files_beside_it(tmp_path):
    gltf = plate()
    files = {
        "a/scene.gltf": gltf.text("scene%20x.bin"),
        "a/scene x.bin": gltf.data,
        "a/textures/t.png": b"no picture",
        "__MACOSX/a/._scene.gltf": b"",
        "a/.x.obj": b"",
    }
    found = read_mesh(zipped(tmp_path / "x.zip", **files))
    assert len(found.faces) == 12 and found.part_names == ("cube",)
    assert [name for name in os.listdir(tmp_path)] == ["x.zip"]


def test_what_is_wrong_with_an_archive_is_named(tmp_path, monkeypatch):
    path = tmp_path / "x.zip"
    with pytest.raises(ValueError, match=r"x\.zip: 2 meshes in it \(a\.obj, b\.glb\.\.\.\)"):
        read_mesh(zipped(path, **{"a.obj": "", "b.glb": "", "c.txt": ""}))
    with pytest.raises(ValueError, match=r"x\.zip: no mesh in the archive, only a\.fbx"):
        read_mesh(zipped(path, **{"a.fbx": ""}))
    inner = zipped(path, **{"d/a.gltf": plate().text("gone.bin")})
    with pytest.raises(ValueError) as caught:
        read_mesh(inner)
    assert str(caught.value).startswith(f"{path}: 'd/a.gltf' in it: the file 'gone.bin'")
    inner = zipped(path, **{"a.obj": "f 1 2 9"})
    with pytest.raises(ValueError, match=r"x\.zip: 'a\.obj' in it: damaged, or not in obj format"):
        read_mesh(inner)
    monkeypatch.setattr(archive, "MAX_UNPACKED", 5)
    with pytest.raises(ValueError, match=r"x\.zip: larger than"):
        read_mesh(inner)
    path.write_bytes(inner.read_bytes()[:-20])
    with pytest.raises(ValueError, match=r"x\.zip: .*cut short: the end of its zip archive"):
        read_mesh(path)


# ---------------------------------------------------------------------------------------- silence

NOISE = """
import logging, os, sys, warnings
import numpy as np
from strokestyle.mesh.messages import silence, warn
with silence():
    print("printed"); print("printed", file=sys.stderr)
    os.write(1, b"by C"); os.write(2, b"by C")
    logging.getLogger("trimesh.util").error("logged")
    logging.getLogger("another").critical("logged")
    warnings.warn("warned")
    np.zeros(1) / 0
print("after"); print("after", file=sys.stderr)
logging.getLogger("trimesh.util").error("logged after")
"""


def test_nothing_of_other_libraries_reaches_the_terminal():
    done = subprocess.run([sys.executable, "-c", NOISE], capture_output=True, text=True, check=True)
    assert done.stdout == "after\n" and done.stderr == "after\nlogged after\n"


def test_our_own_warnings_pass_through_the_silence():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("ignore")
        with silence():
            warn("left out")
            warnings.warn("another's", UserWarning, stacklevel=1)
    assert [one.category for one in found] == [MeshWarning]


def test_a_log_that_goes_elsewhere_is_silent_too(caplog):
    with silence():
        logging.getLogger("trimesh.util").critical("logged")
    logging.getLogger("trimesh.util").critical("after")
    assert caplog.messages == ["after"]


def test_silence_ends_with_an_error():
    with pytest.raises(KeyError), silence():
        raise KeyError
    assert logging.root.manager.disable == logging.NOTSET
    assert os.fstat(1).st_dev  # still open
