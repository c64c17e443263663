"""The frames of a mesh that deforms: the same faces in one frame of space, however they are
mended."""

import numpy as np
import pytest
from shapes import cube, sphere, torus

from strokestyle.mesh.sequence import load_sequence
from strokestyle.mesh.surface import load_surface, make_surface


def write_obj(path, vertices, faces):
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*v) for v in np.asarray(vertices)]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def frames(folder, shapes, faces):
    return [write_obj(folder / f"{i}.obj", v, faces) for i, v in enumerate(shapes)]


def test_frames_share_faces_and_one_frame_of_space(tmp_path):
    vertices, faces = sphere(2)
    shapes = [vertices * 3 + 5, vertices * [3, 6, 3] + [5, 8, 5], vertices * 3 + [5, 5, 905]]
    found = load_sequence(frames(tmp_path, shapes, faces))
    for surface, given in zip(found, shapes, strict=True):
        assert np.array_equal(surface.faces, found[0].faces)
        assert surface.scale == found[0].scale and np.array_equal(surface.centre, found[0].centre)
        assert np.allclose(surface.original(surface.vertices), given, atol=1e-6)
    assert np.ptp(found[0].vertices, axis=0).max() == pytest.approx(1)
    assert np.ptp(found[1].vertices, axis=0)[1] == pytest.approx(2)


def test_the_first_frame_alone_is_what_load_surface_makes_of_it(tmp_path):
    paths = frames(tmp_path, [cube(4).vertices, 1.5 * cube(4).vertices], cube(4).faces)
    alone, (first, second) = load_surface(paths[0]), load_sequence(paths)
    names = ("vertices", "faces", "normals", "k1", "k2", "pdir1", "dcurv", "weld", "turned", "part")
    for name in names:
        assert np.array_equal(getattr(alone, name), getattr(first, name)), name
    assert np.allclose(second.vertices, 1.5 * first.vertices)
    assert np.allclose(second.normals, first.normals)
    assert len(load_sequence(paths[:1])) == 1


def test_a_frame_is_measured_as_if_it_were_alone(tmp_path):
    """Two roads to curvature: of a frame, and of its mesh by itself."""
    vertices, faces = torus(around=32, across=16)
    bent = vertices * [1, 1, 1.3]
    second = load_sequence(frames(tmp_path, [vertices, bent], faces))[1]
    alone = make_surface(bent, faces)
    size = alone.scale / second.scale
    assert np.allclose(second.k1, alone.k1 / size, rtol=1e-5, atol=1e-5)
    assert np.allclose(second.normals, alone.normals, atol=1e-6)


def test_creases_of_the_first_frame_are_those_of_all(tmp_path):
    vertices, faces = cube(3)
    round_ = vertices / np.linalg.norm(vertices, axis=1, keepdims=True).clip(1e-9)
    found = load_sequence(frames(tmp_path, [vertices, round_], faces))
    assert len(found[1].vertices) == len(found[0].vertices) > len(vertices)
    assert np.array_equal(found[1].weld, found[0].weld)


def lips(gap):
    """Two quads that meet along an edge, or stand a gap apart; each has corners of its own."""
    return [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0),
            (0, 1 + gap, gap), (2, 1 + gap, gap), (2, 2, 0), (0, 2, 0)]  # fmt: skip


LIPS = [(0, 1, 2, 3), (4, 5, 6, 7)]


def test_what_touches_at_first_and_parts_later_is_not_joined(tmp_path):
    closed, open_ = lips(0), lips(0.4)
    stays = load_sequence(frames(tmp_path, [closed, closed], LIPS))
    assert [len(s.vertices) for s in stays] == [6, 6]
    parts = load_sequence(frames(tmp_path, [closed, lips(0.01), open_], LIPS))
    assert [len(s.vertices) for s in parts] == [8, 8, 8]
    for surface, given in zip(parts, (closed, lips(0.01), open_), strict=True):
        at = surface.original(surface.vertices)
        assert all(np.abs(at - place).max(axis=1).min() < 1e-5 for place in np.array(given))


def test_sheets_that_lie_on_each_other_at_first_part_later(tmp_path):
    sheet = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    faces = [(0, 1, 2), (0, 2, 3), (6, 5, 4), (7, 6, 4)]
    for shapes, left in (([(0, 0), (0, 0)], 2), ([(0, 0), (0, 0.5)], 4)):
        made = [np.concatenate([sheet + [0, 0, a], sheet + [0, 0, b]]) for a, b in shapes]
        found = load_sequence(frames(tmp_path, made, faces))
        assert [len(s.faces) for s in found] == [left, left]


def test_quads_are_cut_as_in_the_first_frame(tmp_path):
    """A quad's shorter diagonal is another where it is sheared the other way."""
    quad, faces = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float), [(0, 1, 2, 3)]
    shear = np.array([(1, 0.5, 0), (0, 1, 0), (0, 0, 1)])
    shapes = [quad @ shear, quad @ (2 * np.eye(3) - shear)]
    paths = frames(tmp_path, shapes, faces)
    assert not np.array_equal(load_surface(paths[0]).faces, load_surface(paths[1]).faces)
    first, second = load_sequence(paths)
    assert np.array_equal(first.faces, second.faces)


def test_a_soup_of_triangles_is_joined_by_its_first_frame(tmp_path):
    """Faces of their own corners each, as STL has them."""
    import trimesh

    vertices, faces = sphere(2)
    paths = []
    for i, scale in enumerate((1.0, 1.2)):
        paths.append(tmp_path / f"{i}.stl")
        trimesh.Trimesh(vertices * [1, scale, 1], faces, process=False).export(paths[-1])
    first, second = load_sequence(paths)
    assert len(first.vertices) == len(vertices)
    assert np.allclose(second.vertices, first.vertices * [1, 1.2, 1], atol=1e-6)


def test_a_frame_in_which_faces_collapse_is_measured(tmp_path):
    vertices, faces = sphere(2)
    flat = np.where(vertices[:, 1:2] > 0.5, [0, 0.5, 0], vertices)
    found = load_sequence(frames(tmp_path, [vertices, flat, vertices * [1, 0, 1]], faces))
    for surface in found:
        assert np.isfinite(surface.normals).all() and np.isfinite(surface.k1).all()


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda v, f: (v, f[:-1]), "has 19 faces, the first frame"),
        (lambda v, f: (np.vstack([v, v[:1]]), f), "has 13 vertices, the first frame"),
        (lambda v, f: (v, f[::-1]), "its faces join other vertices"),
        (lambda v, f: (0 * v + 2, f), "1.obj: all its points coincide"),
        (lambda v, f: (np.where(np.arange(12)[:, None] == 3, np.nan, v), f), "1.obj: 1 of its"),
    ],
)
def test_another_mesh_is_refused_by_its_name(tmp_path, change, words):
    vertices, faces = sphere(0)
    first = write_obj(tmp_path / "0.obj", vertices, faces)
    second = write_obj(tmp_path / "1.obj", *change(vertices, faces))
    with pytest.raises(ValueError) as error:
        load_sequence([first, second])
    text = str(error.value)
    assert text.startswith(str(second)) and words in text and "\n" not in text


def test_no_frames_and_missing_ones_are_refused(tmp_path):
    with pytest.raises(ValueError, match="1 frame or more"):
        load_sequence([])
    first = write_obj(tmp_path / "0.obj", *sphere(0))
    with pytest.raises(OSError, match="1.obj: no such file"):
        load_sequence([first, tmp_path / "1.obj"])
    point = write_obj(tmp_path / "2.obj", 0 * sphere(0).vertices, sphere(0).faces)
    with pytest.raises(ValueError, match="2.obj: all its points coincide"):
        load_sequence([point, first])
