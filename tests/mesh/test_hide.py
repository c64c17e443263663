"""Parts left out of a surface."""

import numpy as np
import pytest
import trimesh

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.pipeline import extract_view
from strokestyle.geometry.curves import KINDS
from strokestyle.mesh.hide import hide_parts
from strokestyle.mesh.surface import make_surface

NAMES = ("wall", "ball", "", "nut, left", "wall")


def scene():
    """A wall before a ball, and two small boxes beside; names given twice, empty, with a comma."""
    ball = trimesh.creation.icosphere(3, 0.4)
    meshes = [trimesh.creation.box((1, 1, 0.1)), ball, *[trimesh.creation.box((0.1,) * 3)] * 3]
    where = [(0, 0, 1), (0, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0)]
    vertices = [m.vertices + p for m, p in zip(meshes, where, strict=True)]
    start = np.cumsum([0, *map(len, vertices)])
    faces = [m.faces + s for m, s in zip(meshes, start, strict=False)]
    part = np.repeat(np.arange(5), [len(f) for f in faces])
    return make_surface(
        np.concatenate(vertices), np.concatenate(faces), part=part, part_names=NAMES
    )


def test_the_rest_keeps_its_place_and_all_that_was_measured():
    surface = scene()
    left = hide_parts(surface, ["wall"])
    keep = ~np.isin(surface.part, [0, 4])
    for name in ("vertices", "normals", "k1", "dcurv"):
        whole, rest = getattr(surface, name), getattr(left, name)
        assert np.array_equal(whole[surface.faces[keep]], rest[left.faces])
    assert np.array_equal(surface.part[keep], left.part) and left.part_names == NAMES
    assert np.array_equal(left.weld[left.weld], left.weld) and left.closed_faces.all()
    assert np.array_equal(left.vertices[left.weld], left.vertices)
    assert left.centre is not None and left.scale == surface.scale
    assert hide_parts(surface, []) is surface


def test_what_lay_behind_is_seen_by_the_same_camera():
    surface = scene()
    camera = fit_camera(surface.vertices, "front", width=400, height=400)
    whole, left = (extract_view(s, camera) for s in (surface, hide_parts(surface, ["wall"])))
    for view, names in ((whole, {"wall", "ball", "nut, left"}), (left, {"ball", "nut, left"})):
        seen = {view.curve_parts.name(i) for i in range(len(view.curves))} - {""}
        assert seen == names - ({"ball"} if view is whole else set())
    assert left.curves.closed.any() and not whole.curves.closed[whole.curves.kind == 0].any()


@pytest.mark.parametrize(
    "wanted, parts",
    [
        (["ball"], [0, 2, 3, 4]),
        (["ball,wall"], [2, 3]),
        (["ball", " wall "], [2, 3]),
        (["nut, left"], [0, 1, 2, 4]),
        (['ball, "nut, left"'], [0, 2, 4]),
        (['"nut, left",ball', "wall"], [2]),
    ],
)
def test_names_as_they_are_given(wanted, parts):
    assert np.unique(hide_parts(scene(), wanted).part).tolist() == parts


@pytest.mark.parametrize(
    "wanted, words",
    [
        (["Wal"], "no part named 'Wal' to hide; did you mean 'wall'[?] There are wall, ball, nut"),
        (["nut", "zzz"], "no part named 'nut', 'zzz' to hide"),
        (["wheel"], r"'wheel' to hide. There are|did you mean"),
    ],
)
def test_names_that_no_part_has(wanted, words):
    with pytest.raises(ValueError, match=words) as error:
        hide_parts(scene(), wanted)
    assert "\n" not in str(error.value)


def test_nothing_left_and_nothing_named():
    box = trimesh.creation.box()
    plain = make_surface(box.vertices, box.faces)
    with pytest.raises(ValueError, match="it has no named parts"):
        hide_parts(plain, ["a"])
    named = make_surface(box.vertices, box.faces, part=np.zeros(12, int), part_names=("a", "b"))
    with pytest.raises(ValueError, match="all its parts are hidden"):
        hide_parts(named, ["a"])
    with pytest.raises(ValueError, match="no part named 'b' to hide"):  # no face is of it
        hide_parts(named, ["b"])


def test_a_part_within_one_body_leaves_a_boundary():
    """Materials are parts of one body: without the lid one looks into the box."""
    box = trimesh.creation.box()
    lid = (box.face_normals[:, 2] > 0.5).astype(int)
    surface = make_surface(box.vertices, box.faces, part=lid, part_names=("sides", "lid"))
    left = hide_parts(surface, ["lid"])
    assert not left.closed_faces.any()
    view = extract_view(left, fit_camera(surface.vertices, "25,20"))
    length = np.bincount(view.curves.kind, view.curves.lengths(), len(KINDS))
    assert length[KINDS.index("boundary")] > 0.3 * length.sum()
