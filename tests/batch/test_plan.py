"""Which file each drawing of a batch is written to; nothing is overwritten that should not be."""

import os

import pytest

from strokestyle.batch.plan import (
    STANDARD_OUTPUT,
    Job,
    UnclearOutput,
    find_shapes,
    numbered_output,
    picture_suffix,
    plan_outputs,
    split_list,
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with two meshes, a view and a text in `in/`, which is the current one."""
    (tmp_path / "in").mkdir()
    for name in ("b.ply", "a.OBJ", "c.npz", "notes.txt"):
        (tmp_path / "in" / name).write_text("shape")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_one_shape_goes_to_the_file_that_is_named(here):
    for output in ("out.svg", "out.svgz", "out.SVG", STANDARD_OUTPUT):
        assert plan_outputs(["in/b.ply"], output) == [Job("in/b.ply", output)]
    assert sorted(os.listdir(here)) == ["in"]  # nothing is made but folders


@pytest.mark.parametrize("output", ["new/", "new/deep/", "new", "in"])
def test_a_folder_gets_one_file_a_shape(here, output):
    jobs = plan_outputs(["in/b.ply", "elsewhere/x.y.obj"], output)
    folder = output.rstrip("/")
    assert jobs == [("in/b.ply", f"{folder}/b.svg"), ("elsewhere/x.y.obj", f"{folder}/x.y.svg")]
    assert (here / folder).is_dir()


def test_a_folder_of_shapes_stands_for_the_meshes_and_views_in_it(here):
    inside = [os.path.join("in", name) for name in ("a.OBJ", "b.ply", "c.npz")]
    assert find_shapes(["x.stl", "in"]) == ["x.stl", *inside]
    assert [job.shape for job in plan_outputs(["in"], "out/")] == inside


def test_a_folder_without_shapes_is_named(here):
    (here / "none").mkdir()
    with pytest.raises(ValueError, match="none: no mesh and no view") as error:
        plan_outputs(["none"], "out/")
    assert not isinstance(error.value, UnclearOutput) and not (here / "out").exists()


@pytest.mark.parametrize(
    "shapes, output, words",
    [
        (["in"], "out.svg", "3 shapes need a folder to go to, such as drawings/, not out.svg"),
        (["a.obj", "b.obj"], "-", "2 shapes need a folder"),
        (["a.obj"], "out.bmp", "out.bmp: drawings are .svg, .svgz, .pdf, .png"),
        (["p/a.obj", "q/a.ply"], "out/", "p/a.obj and q/a.ply would both be written to out/a.svg"),
    ],
)
def test_what_does_not_go_together_is_refused_without_a_trace(here, shapes, output, words):
    with pytest.raises(UnclearOutput, match=words):
        plan_outputs(shapes, output)
    assert sorted(os.listdir(here)) == ["in"]


def test_folders_are_mirrored(here):
    for name in ("a/x.obj", "b/c/x.obj", "b/x.ply"):
        path = here / "deep" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("shape")
    out = [("deep/a/x.obj", "out/a/x.svg"), ("deep/b/c/x.obj", "out/b/c/x.svg"),
           ("deep/b/x.ply", "out/b/x.svg")]  # fmt: skip
    assert plan_outputs(["deep"], "out", mirror=True) == out
    assert plan_outputs([shape for shape, _ in out], "out/", mirror=True) == out
    assert plan_outputs(["deep/b", "in/b.ply"], "n/", mirror=True)[-1] == ("in/b.ply", "n/b.svg")
    assert sorted(os.listdir(here / "out" / "b")) == ["c"]
    with pytest.raises(UnclearOutput, match="mirrored in a folder"):
        plan_outputs(["deep/b/x.ply"], "x.svg", mirror=True)
    (here / "deep/b/x.obj").write_text("shape")
    with pytest.raises(UnclearOutput, match="x.obj and deep/b/x.ply would both be written"):
        plan_outputs(["deep"], "out/", mirror=True)


@pytest.mark.parametrize(
    "data, names",
    [
        (b"a.obj\nb c.obj\n", ["a.obj", "b c.obj"]),
        (b"a.obj\r\n\r\n \t\r\n b .obj \r\n", ["a.obj", " b .obj "]),
        (b"\xef\xbb\xbfa.obj", ["a.obj"]),
        (b"\xef\xbb\xbfa.obj\0b.obj", ["a.obj", "b.obj"]),
        ("\ufeffa.obj\r\n\u00e4.obj\r\n".encode("utf-16-le"), ["a.obj", "\u00e4.obj"]),
        (b"a\nb.obj\0\0c.obj", ["a\nb.obj", "c.obj"]),
        (b"\xff.obj\n", [os.fsdecode(b"\xff.obj")]),
        (b"", []),
        (b"\n\r\n\0", []),
    ],
)
def test_a_list_has_a_file_a_line_or_nuls_in_between(data, names):
    assert split_list(data) == names


def test_an_input_is_not_overwritten_and_a_missing_folder_is_named(here):
    (here / "drawn.svg").write_text("<svg/>")
    os.link(here / "drawn.svg", here / "same.svg")
    with pytest.raises(ValueError, match="same.svg: is the input"):
        plan_outputs(["drawn.svg"], "same.svg")
    with pytest.raises(FileNotFoundError, match="missing"):
        plan_outputs(["in/b.ply"], "missing/out.svg")


def test_pictures_are_numbered_with_the_digits_that_the_last_one_needs():
    assert numbered_output("spin/a.b.svgz", 7, 24) == os.path.join("spin", "a.b-007.svgz")
    assert [picture_suffix(i, 1000) for i in (0, 999)] == ["-000", "-999"]
    assert picture_suffix(5, 1001) == "-0005" and picture_suffix(1000, 1001) == "-1000"
