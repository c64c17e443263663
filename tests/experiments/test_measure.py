"""The tables of measure.py and fid_bias.py, with networks that see only colours."""

import json
from argparse import Namespace
from types import SimpleNamespace

import fid_bias
import measure
import numpy as np
import pytest
from metrics import looks as kept
from metrics.looks import Looks
from PIL import Image

SIZE = 32


class Colours:
    """In place of every network: an image is its mean colour, an LPIPS the distance of two."""

    made = 0

    def __init__(self, *_):
        Colours.made += 1

    def features(self, images, side=299):
        if images.ndim == 3:  # marks ask of one image
            return []
        return 100 * images.mean((1, 2)).reshape(-1, 3)

    def distance(self, a, b):
        return float(np.abs(a - b).mean())


class Data:
    """Three styles of three shapes, drawn in colours; every second take is a little darker."""

    def __init__(self, root):
        self.root = root
        rng = np.random.default_rng(0)
        for style in self.styles():
            for shape in self.tests(style):
                colour = rng.integers(60, 160, 3)
                self.draw(self.drawing_path(style, shape), colour)
                self.draw(self.drawing_path(style, shape).with_name("take2.png"), colour - 5)
                self.draw(root / "out" / "near" / style / f"{shape}.png", colour + 10)
                self.draw(root / "out" / "far" / style / f"{shape}.png", colour + 60)

    def draw(self, path, colour):
        path.parent.mkdir(parents=True, exist_ok=True)
        image = np.full((SIZE, SIZE, 3), 255, np.uint8)
        image[8:24, 8:24] = colour
        Image.fromarray(image).save(path)

    def styles(self):
        return ["a", "b", "c"]

    def chosen_styles(self, names):
        return names.split(",") if names else self.styles()

    def tests(self, style):
        return ["x", "y", "z"]

    def drawing_path(self, style, shape):
        return self.root / "styles" / style / shape / "drawing.png"

    def sheet(self, shape):
        plain = np.ones((SIZE, SIZE), np.float32)
        plain[8, 8:24] = 0
        return SimpleNamespace(size=(SIZE, SIZE), plain=plain)


@pytest.fixture
def data(tmp_path, monkeypatch):
    made = Data(tmp_path)
    for module in (measure, fid_bias):
        monkeypatch.setattr(module, "data_of", lambda options: made)
    monkeypatch.setattr(kept, "Inception", Colours)
    monkeypatch.setattr(kept, "Lpips", Colours)
    monkeypatch.setattr(kept, "marks_of", lambda net, image: image.reshape(-1, 3)[::7])
    return made


def options(data, **more):
    out = data.root / "out"
    more = {"methods": None, "styles": None, "resamples": 20, "repeats": 3, "plot": None} | more
    return Namespace(out=out, seed=0, device="cpu", **more)


def cells(text):
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line[:5] != "| ---"]
    return {line[0]: dict(zip(lines[0], line, strict=False)) for line in lines[1:] if line[0]}


def value(cell):
    return float(cell.split()[0])


def test_methods_stand_between_the_plain_curves_and_the_second_take(data, capsys):
    costs = {"style": "a", "learn s": 4.0, "draw s": 0.5, "peak MB": 300}
    rows = [{**costs, "learn s": 99}, costs, {**costs, "style": "b", "learn s": 5, "peak MB": 310}]
    text = "\n".join(json.dumps(row) for row in rows)  # the first was made anew
    (data.root / "out" / "near" / "times.jsonl").write_text(text)
    measure.run(options(data))
    said = capsys.readouterr()
    found = cells(said.out.split("\n\n")[0])
    assert list(found) == ["plain curves", "far", "near", "the artist's second take"]
    for column in ("LPIPS, Alex", "FID", "patch FID", "marks"):
        figures = [value(row[column]) for row in found.values()]
        assert figures == sorted(figures, reverse=True), column
    assert value(found["near"]["LPIPS, Alex"]) == pytest.approx(10 / 255 / 4, abs=1e-4)
    assert [found["near"][c] for c in ("learn, s", "draw, s", "MB")] == ["4.5", "0.50", "310"]
    assert found["far"]["MB"] == "–"
    closest = cells(said.out.split("\n\n")[1])["near"]
    assert closest["and"] == "far" and closest["closer in"] == "9 of 9"
    assert "missing" not in said.err


def test_what_was_seen_is_kept_and_seen_anew_when_a_drawing_changes(data, capsys):
    measure.run(options(data))
    first, made = capsys.readouterr().out, Colours.made
    measure.run(options(data))
    assert capsys.readouterr().out == first and Colours.made == made
    data.draw(data.root / "out" / "near" / "a" / "x.png", [10, 250, 10])
    measure.run(options(data))
    again = capsys.readouterr().out
    assert Colours.made > made
    same = [x == y for x, y in zip(first.splitlines(), again.splitlines(), strict=True)]
    assert same[2:6] == [True, True, False, True]  # plain, far, near, the second take


def test_a_missing_drawing_is_said_and_left_out_on_both_sides(data, capsys):
    (data.root / "out" / "near" / "a" / "x.png").unlink()
    for path in data.root.glob("out/far/*/*.png"):
        if path.parent.name != "a" or path.stem != "x":
            path.unlink()
    measure.run(options(data))
    said = capsys.readouterr()
    assert "near: missing a/x\n" in said.err and "far: missing a/y, a/z, b/x" in said.err
    found = cells(said.out.split("\n\n")[0])
    assert found["near"]["drawings"] == "8" and found["far"]["drawings"] == "1"
    assert value(found["near"]["LPIPS, Alex"]) == pytest.approx(10 / 255 / 4, abs=1e-4)
    assert found["far"]["FID"] == "–"


def test_fid_of_fewer_drawings_is_larger(data, capsys):
    plot = data.root / "plot.svg"
    fid_bias.run(options(data, methods="near", plot=plot, repeats=30))
    found = cells(capsys.readouterr().out)
    row = found["FID, second take of others"]
    assert row["5"] == "–"  # 9 drawings have no two fives apart
    small, all_of_them = (value(found["FID, second take"][n]) for n in ("3", "8"))
    assert value(row["3"]) > 2 * small  # sets that are not of the same things are farther apart
    assert value(found["FID, near"]["3"]) > small and all_of_them < 5
    assert plot.read_text().startswith("<svg") and "near" in plot.read_text()


def test_a_plot_is_an_svg(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["fid_bias.py", "out", "--plot", "bias.png"])
    with pytest.raises(SystemExit) as left:
        fid_bias.main()
    assert left.value.code == 2 and "bias.png: plots are drawn as SVG" in capsys.readouterr().err


def test_a_set_without_second_takes_is_measured_without_them(data, capsys):
    for path in data.root.glob("styles/*/*/take2.png"):
        path.unlink()
    fid_bias.run(options(data, methods="near"))
    said = capsys.readouterr()
    assert "FID, near" in cells(said.out) and "second take" not in said.out
    assert "no second takes" in said.err
    measure.run(options(data))
    assert list(cells(capsys.readouterr().out.split("\n\n")[0])) == ["plain curves", "far", "near"]


@pytest.mark.parametrize("module", [measure, fid_bias])
def test_a_method_that_drew_nothing_is_told(data, module):
    with pytest.raises(ValueError, match="no drawings by nearer; there are those by far, near"):
        module.run(options(data, methods="near,nearer"))


def test_looks_are_of_what_is_in_an_image(tmp_path, data):
    looks = Looks(tmp_path / "looks")
    white = np.ones((16, 16, 3), np.float32)
    assert looks.whole(white).tolist() == [100, 100, 100]
    assert looks.whole(white * 0.5).tolist() == [50, 50, 50]
    assert looks.patches(white).shape == (0, 3)
