"""The SHAPE argument: what its options ask the library for, and which do not go together."""

import click
import numpy as np
import pytest
import trimesh

from strokestyle.cli.messages import told_warnings
from strokestyle.cli.shape import Shape
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.line_options import LineOptions
from strokestyle.extract.turntable import fit_turntable_camera
from strokestyle.geometry.kinds import KINDS
from strokestyle.mesh.messages import warn


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("shape") / "box.ply"
    trimesh.creation.box((1, 0.4, 0.2)).export(path)
    return str(path)


def eyes(cameras):
    return np.array([camera.eye for camera in cameras])


def test_without_options_it_is_the_default_view(box):
    shape = Shape(box, {})
    assert shape.camera().to_dict() == fit_camera(shape.surface.vertices).to_dict()
    assert shape.line_options() == LineOptions() and shape.spacing() == 3.0
    views = list(shape.views())
    assert len(views) == 1 and len(views[0].curves) and not len(views[0].hidden)


def test_options_of_view_and_lines_reach_the_library(box):
    options = {
        "view": "10,20",
        "fov": 50.0,
        "up": "z",
        "size": (96, 64),
        "kinds": ("crease", "valley"),
        "valley": 0.3,
        "detail": (0.5, 2.0),
        "spacing": 5.0,
    }
    shape = Shape(box, options)
    asked = fit_camera(shape.surface.vertices, "10,20", 50.0, 96, 64, "z")
    assert shape.camera().to_dict() == asked.to_dict()
    lines = LineOptions(kinds=("crease", "valley"), valley=0.3).detailed(0.5, 2.0)
    assert shape.line_options() == lines and shape.spacing() == 5.0


def test_a_turntable_is_the_librarys(box):
    shape = Shape(box, {"turntable": 3, "size": (64, 64), "kinds": ("crease",)})
    first = fit_turntable_camera(shape.surface.vertices, width=64, height=64)
    views = list(shape.views())
    cameras = [view.camera for view in views]
    assert np.allclose(eyes(cameras), eyes([first.turned(120.0 * i) for i in range(3)]))
    kinds = {KINDS[kind] for view in views for kind in view.curves.kind}
    assert kinds == {"crease"} and shape.surface is shape.surface


@pytest.mark.parametrize(
    "path, options, words",
    [
        ("box", {"camera": "c.json", "fov": 30.0, "size": (64, 64)}, "leave out --fov, --size"),
        ("box", {"projection": "parallel", "fov": 30.0}, "parallel has no field of view: .* --fov"),
        ("box", {"view": "isometric", "fov": 30.0}, "--view isometric has no field of view"),
        ("box", {"camera": "c.json", "projection": "parallel"}, "leave out --projection"),
        ("v.npz", {"projection": "parallel"}, "saved view, .* leave out --projection"),
        ("box", {"hidden": True, "curves": "c.svg"}, "--hidden needs a mesh and its own curves"),
        ("v.npz", {"hidden": True}, "--hidden needs a mesh and its own curves"),
        ("v.npz", {"kinds": ("crease",), "up": "z"}, "v.npz is a saved view, .*out --lines, --up"),
        ("v.npz", {"turntable": 3}, "--turntable needs a mesh and its own curves"),
        ("box", {"turntable": 3, "curves": "c.svg"}, "--turntable needs a mesh and its own curves"),
    ],
)
def test_options_that_do_not_go_together(box, path, options, words):
    with pytest.raises(click.UsageError, match=words):
        Shape(box if path == "box" else path, options)


def test_what_the_library_warns_of_is_one_line_on_stderr(capfd):
    with told_warnings():
        warn("two\nlines are  left out")
        warn("two\nlines are  left out")
    assert capfd.readouterr() == ("", "warning: two lines are left out\n")
    with pytest.raises(ValueError), told_warnings():
        warn("a line")
        raise ValueError
    assert capfd.readouterr() == ("", "")


def test_the_projection_is_the_views_own_unless_told(box):
    for options, projection in (
        ({}, "perspective"),
        ({"view": "isometric"}, "parallel"),
        ({"view": "isometric", "projection": "perspective", "fov": 20.0}, "perspective"),
        ({"view": "top", "projection": "parallel"}, "parallel"),
        ({"view": "top", "projection": "parallel", "turntable": 3}, "parallel"),
    ):
        shape = Shape(box, options)
        fit = fit_turntable_camera if "turntable" in options else fit_camera
        asked = fit(
            shape.surface.vertices,
            options.get("view", "three-quarter"),
            options.get("fov", 30.0),
            projection=projection,
        )
        assert shape.camera().to_dict() == asked.to_dict()
        assert shape.camera().projection == projection


def test_a_turntable_seen_from_above_goes_round_the_upright_axis(box):
    options = {"view": "top", "turntable": 4, "size": (64, 64), "up": "z"}
    eyes_up = [view.camera.axes[2] for view in Shape(box, options).views()]
    assert np.allclose(eyes_up, [0, 0, -1])


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    path = tmp_path_factory.mktemp("parts") / "cart.obj"
    box = trimesh.creation.box((1, 0.4, 0.2))
    lines = []
    for name, shift in (("body", 0), ("wheel", 3)):
        lines.append(f"o {name}")
        lines += ["v {} {} {}".format(*(v + [shift, 0, 0])) for v in box.vertices]
        offset = 1 if name == "body" else 9
        lines += ["f {} {} {}".format(*(f + offset)) for f in box.faces]
    path.write_text("\n".join(lines))
    return str(path)


def test_hidden_parts_are_left_out_and_the_camera_stays(wheel):
    whole, less = Shape(wheel, {}), Shape(wheel, {"hide": ("wheel",)})
    assert whole.camera().to_dict() == less.camera().to_dict()
    a, b = (next(shape.views()) for shape in (whole, less))
    assert 0 < len(b.curves) < len(a.curves)
    turned = list(Shape(wheel, {"hide": ("wheel",), "turntable": 2, "size": (96, 96)}).views())
    assert all(len(view.curves) for view in turned)
    with pytest.raises(ValueError, match=r"cart.obj: no part named 'weel'.*mean 'wheel'.*body"):
        Shape(wheel, {"hide": ("weel",)}).view()
    with pytest.raises(click.UsageError, match="leave out --hide"):
        Shape("v.npz", {"hide": ("wheel",)})


def test_a_section_is_cut_after_parts_are_hidden_and_the_camera_stays(wheel):
    whole = Shape(wheel, {})
    cut = Shape(wheel, {"section": ("x:90%", "+y:0"), "hide": ("body",)})
    assert whole.camera().to_dict() == cut.camera().to_dict()
    assert [plane.axis for plane in cut.shown.section.planes] == [0, 1]
    drawn = {KINDS[kind] for kind in next(cut.views()).curves.kind}
    assert "section" in drawn
    turned = list(Shape(wheel, {"section": ("x:50%",), "turntable": 3, "size": (96, 96)}).views())
    assert len(turned) == 3
    with pytest.raises(ValueError, match=r"cart.obj: the section x:9 misses it"):
        Shape(wheel, {"section": ("x:9",)}).view()
    with pytest.raises(click.UsageError, match="leave out --section"):
        Shape("v.npz", {"section": ("x:1",)})
