"""The runner: every style by every method, what is there is kept, what fails is told."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import methods
import numpy as np
import pytest
from build_dataset import add_shape, describe
from pictures import side_by_side, wrapped
from PIL import Image, ImageFont
from solids import box

EXPERIMENTS = Path(__file__).parent.parent.parent / "experiments"
STUB = """
import compare_methods, methods, numpy as np, os
from methods import Method

def learn(lesson, settings, seed, device):
    if lesson.style == settings:
        raise RuntimeError("cannot learn this")
    if settings == "killed by " + lesson.style:
        os.kill(os.getpid(), 9)
    ink = lesson.drawing.min(axis=(0, 1))
    def paint(sheet, seed):
        line = (sheet.plain < 0.5)[..., None]
        return (255 * np.where(line, ink, 1.0)).astype(np.uint8)
    return paint

def all_methods():
    return {"trace": Method("trace", "", learn, SETTINGS, None)}

methods.all_methods = compare_methods.all_methods = all_methods
if __name__ == "__main__":
    compare_methods.main()
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    root = tmp_path_factory.mktemp("data")
    for name, high in (("tall", (1.0, 3.0, 1.5)), ("flat", (4.0, 1.0, 2.0))):
        solid, mesh = box(high=high), root / "mesh.obj"
        lines = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in solid.faces + 1]
        mesh.write_text("\n".join(lines))
        add_shape(root / "shapes" / name, mesh, "three-quarter", 64)
        mesh.unlink()
        for style in ("red", "blue"):
            lines = np.asarray(Image.open(root / "shapes" / name / "template.png"))[..., None]
            color = np.array([255, 0, 0] if style == "red" else [0, 0, 255])
            image = (lines / 255 * 255 + (1 - lines / 255) * color).astype(np.uint8)
            (root / "styles" / style / name).mkdir(parents=True)
            Image.fromarray(image).save(root / "styles" / style / name / "drawing.png")
    (root / "dataset.json").write_text(json.dumps(describe(root, "tall", 0, "")))
    return root


def run(tmp_path, data, *more, settings="None"):
    script = tmp_path / "stub.py"
    script.write_text(
        f"import sys; sys.path.insert(0, {str(EXPERIMENTS)!r})\nSETTINGS = {settings}\n"
    )
    script.write_text(script.read_text() + STUB)
    out = tmp_path / "out"
    command = [sys.executable, script, out, "--data", data, "--size", "64", *more]
    return out, subprocess.run(command, capture_output=True, text=True)


def test_styles_are_learned_and_drawn_once(tmp_path, data):
    out, ran = run(tmp_path, data)
    assert ran.returncode == 0, ran.stderr
    red = np.asarray(Image.open(out / "trace" / "red" / "flat.png"))
    assert red.shape == (64, 64, 3) and (red.min(axis=(0, 1)) <= [255, 40, 40]).all()
    assert not (out / "trace" / "red" / "tall.png").exists()  # it was learned from
    rows = [json.loads(line) for line in (out / "trace" / "times.jsonl").read_text().splitlines()]
    assert {row["style"] for row in rows} == {"red", "blue"}
    assert all(set(row) == {"style", "learn s", "draw s", "peak MB"} for row in rows)
    # again: only what is missing
    shutil.rmtree(out / "trace" / "blue")
    (out / "trace" / "red" / "flat.png").write_bytes(b"kept")
    _, again = run(tmp_path, data)
    assert again.returncode == 0 and "blue" in again.stdout and "red" not in again.stdout
    assert (out / "trace" / "red" / "flat.png").read_bytes() == b"kept"
    # with other settings it is another method
    _, other = run(tmp_path, data, "--seed", "5")
    assert other.returncode == 1 and "drawn with other settings" in other.stderr
    assert "Traceback" not in other.stderr


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ('"blue"', "cannot learn this"),
        ('"killed by blue"', "trace, blue: its process ended with -9"),
    ],
)
def test_a_style_that_fails_is_told_and_the_others_are_drawn(tmp_path, data, settings, told):
    out, ran = run(tmp_path, data, settings=settings)
    assert ran.returncode == 1
    assert told in ran.stderr and "1 of 2 failed" in ran.stderr
    assert (out / "trace" / "red" / "flat.png").exists()


def test_a_style_that_is_not_there_is_told_and_nothing_is_written(tmp_path, data):
    out, ran = run(tmp_path, data, "--styles", "green")
    assert ran.returncode == 1 and "no style green" in ran.stderr
    assert "Traceback" not in ran.stderr and not out.exists()


def test_methods_are_chosen_by_name_in_the_order_asked_for(monkeypatch):
    monkeypatch.setattr(methods, "all_methods", lambda: {"a": 1, "b": 2, "c": 3})
    assert methods.chosen_methods(None) == {"a": 1, "b": 2, "c": 3}
    assert list(methods.chosen_methods("c,a")) == ["c", "a"]
    with pytest.raises(ValueError, match="no method d, e; there are a, b, c"):
        methods.chosen_methods("a,e,d")


def test_pictures_stand_under_their_labels():
    red, blue = (np.full((20, 30, 3), color, np.float32) for color in ((1, 0, 0), (0, 0, 1)))
    sheet = np.asarray(side_by_side([[red, blue], [None, red]], ["a", "b"]))
    is_red = (sheet == [255, 0, 0]).all(axis=2)
    is_blue = (sheet == [0, 0, 255]).all(axis=2)
    assert is_red.sum() == 2 * 600 and is_blue.sum() == 600
    rows, columns = np.nonzero(is_blue)
    assert columns.min() > sheet.shape[1] / 2 - 10 and rows.max() < sheet.shape[0] - 20
    # shapes of other proportions do not cover one another
    wide = np.full((10, 50, 3), (0, 0, 1), np.float32)
    sheet = np.asarray(side_by_side([[red, red], [wide, wide]], ["a", "b"]))
    assert (sheet == [0, 0, 255]).all(axis=2).sum() == 2 * 500


def test_labels_are_broken_between_words():
    font = ImageFont.load_default(14)
    lines = wrapped("the texture network in place of texture by example", font, 100)
    assert " ".join(lines) == "the texture network in place of texture by example"
    assert len(lines) > 2 and all(font.getlength(line) <= 100 for line in lines)
    assert wrapped("Gesamtkunstwerkstilvergleich", font, 20) == ["Gesamtkunstwerkstilvergleich"]
