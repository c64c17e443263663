"""A data set of shapes and of drawings of them, in the paper's protocol (Liu et al. 2021, sec. 5):
each style is learned from one drawing, and tested on the others that its artist made.

DATA/shapes/<shape>/{mesh.obj,camera.json[,curves.json]}
DATA/styles/<style>/<shape>/drawing.png[,take2.png]

Where there is a curves.json, its curves are what was drawn over, and what methods get; else our own
feature curves are extracted. take2.png is the same artist's second drawing of the same shape.
DATA/dataset.json describes the set (build_dataset.py writes and checks it); its "train" is the
training shape where none is given."""

import argparse
import json
import sys
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from strokestyle.extract.camera import Camera
from strokestyle.extract.feature_maps import NEURAL_STROKES_MAPS
from strokestyle.extract.pipeline import extract_view, view_of_curves
from strokestyle.extract.view import View
from strokestyle.fit.exemplar import Exemplar, load_exemplar
from strokestyle.mesh.surface import load_surface
from strokestyle.render.curve_file import load_curves


@dataclass(frozen=True)
class Sheet:
    """A shape from its camera: what every method gets to draw on.

    folder : of the shape's files, for the same picture at another size
    """

    shape: str
    view: View
    folder: Path | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.view.camera.width, self.view.camera.height

    @cached_property
    def plain(self) -> np.ndarray:
        """The plain curves (H, W) float32: ground 1, a line of 1 px 0."""
        return 1.0 - self.view.maps["plain"]

    @cached_property
    def maps(self) -> np.ndarray:
        """The paper's geometry maps (8, H, W) float32, in [0, 1] on the shape, ground 1."""
        return np.stack([self.view.maps[name] for name in NEURAL_STROKES_MAPS])

    def at(self, size: int) -> "Sheet":
        """The same picture with a longer side of `size` px."""
        if size == max(self.size):
            return self
        if self.folder is None:
            raise ValueError(f"{self.shape}: without its files it has one size alone")
        return Sheet(self.shape, _view(self.folder, size), self.folder)


@dataclass(frozen=True)
class Lesson:
    """The one drawing that a style is learned from, over the sheet that it was drawn on.

    drawing : (H, W, 3) float32 in [0, 1], on white, at the sheet's size
    path : of the drawing's file
    """

    style: str
    sheet: Sheet
    drawing: np.ndarray
    path: Path

    def exemplar(self, sheet: Sheet | None = None) -> Exemplar:
        """What `strokestyle fit` reads in the drawing: ink, opacity, mask.

        `sheet` is the same at another size: the drawing, as it is here, is enlarged to it, as `fit`
        does with a drawing that is smaller than its canvas.
        """
        if sheet is None:
            return _on(self.path, self.sheet)
        with TemporaryDirectory() as folder:
            path = Path(folder) / self.path.name
            Image.fromarray((255 * self.drawing).round().astype(np.uint8)).save(path)
            return _on(path, sheet)

    def at(self, size: int) -> "Lesson":
        """The same drawing, as its file has it, with a longer side of `size` px."""
        sheet = self.sheet.at(size)
        return Lesson(self.style, sheet, read_image(self.path, sheet.size), self.path)


class DataSet:
    """The drawings and shapes of a folder, at one size.

    root : DATA
    train : the shape that styles are learned from, or that of each style
    size : px, the longer side of all images; None = as the cameras have it
    """

    def __init__(self, root: Path, train: str | dict[str, str], size: int | None = None):
        self.root, self.train, self.size = Path(root), train, size
        self._sheets: dict[str, Sheet] = {}

    def styles(self) -> list[str]:
        """Names of all styles that have a drawing of their training shape."""
        there = {path.parent.parent.name for path in self.root.glob("styles/*/*/drawing.png")}
        if isinstance(self.train, dict):
            there &= set(self.train)
        return sorted(s for s in there if self.drawing_path(s, self.train_of(s)).exists())

    def chosen_styles(self, names: str | None) -> list[str]:
        """The styles of a comma-separated list, or all, that have a drawing to be tested on.

        Raises ValueError where one of the list is not there, or there is none."""
        there = self.styles()
        unknown = sorted(set(names.split(",")) - set(there)) if names else []
        if unknown or not there:
            raise ValueError(
                f"{self.root}: no style {', '.join(unknown) or 'with a drawing to learn from'}; "
                f"training on {self.train}, there are {', '.join(there) or 'none'}"
            )
        chosen = names.split(",") if names else there
        untested = [style for style in chosen if not self.tests(style)]
        if untested and (names or untested == there):
            raise ValueError(f"{self.root}: no drawing to test {', '.join(untested)} on")
        if untested:
            print(f"left out, no drawing to test on: {', '.join(untested)}", file=sys.stderr)
        return [style for style in chosen if style not in untested]

    def train_of(self, style: str) -> str:
        """The shape that a style is learned from."""
        return self.train[style] if isinstance(self.train, dict) else self.train

    def tests(self, style: str) -> list[str]:
        """Names of the shapes that a style is tested on."""
        drawings = self.root.glob(f"styles/{style}/*/drawing.png")
        return sorted({path.parent.name for path in drawings} - {self.train_of(style)})

    def sheet(self, shape: str) -> Sheet:
        """The sheet of a shape; made once."""
        if shape not in self._sheets:
            folder = self.root / "shapes" / shape
            self._sheets[shape] = Sheet(shape, _view(folder, self.size), folder)
        return self._sheets[shape]

    def lesson(self, style: str) -> Lesson:
        """The drawing that a style is learned from."""
        shape = self.train_of(style)
        path, sheet = self.drawing_path(style, shape), self.sheet(shape)
        return Lesson(style, sheet, read_image(path, sheet.size), path)

    def drawing_path(self, style: str, shape: str) -> Path:
        """Where the artist's drawing is."""
        return self.root / "styles" / style / shape / "drawing.png"


def _view(folder: Path, size: int | None) -> View:
    surface, camera = load_surface(folder / "mesh.obj"), Camera.load(folder / "camera.json")
    if size is not None:
        camera = resized(camera, size)
    if not (folder / "curves.json").exists():
        return extract_view(surface, camera)
    curves = load_curves(folder / "curves.json", (camera.width, camera.height))
    return view_of_curves(surface, camera, curves)


def _on(drawing: Path, sheet: Sheet) -> Exemplar:
    return load_exemplar(drawing, *sheet.size, sheet.view.curves.xy[sheet.view.required])[0]


def resized(camera: Camera, size: int) -> Camera:
    """The same picture with a longer side of `size` px."""
    k = size / max(camera.width, camera.height)
    return replace(camera, width=round(k * camera.width), height=round(k * camera.height))


def read_image(path: Path, size: tuple[int, int]) -> np.ndarray:
    """Read an image, on white, resampled to `size` (width, height): (H, W, 3) float32 in [0, 1]."""
    with Image.open(path) as image:
        layer = image.convert("RGBA")
    paper = Image.alpha_composite(Image.new("RGBA", layer.size, "white"), layer).convert("RGB")
    if paper.size != size:
        paper = paper.resize(size, Image.Resampling.LANCZOS)
    return np.asarray(paper, np.float32) / 255


def data_of(options: argparse.Namespace) -> DataSet:
    """The data set of a script's options. Raises ValueError, saying what is missing."""
    if options.size < 16:
        raise ValueError(f"--size {options.size}: images have 16 px or more")
    if options.data is None:
        raise ValueError("give --data DATA, or set STROKESTYLE_SHARED")
    return DataSet(Path(options.data), options.train or described_train(options.data), options.size)


def described_train(root: Path) -> str | dict[str, str]:
    """The training shape, or that of each style, as a data set is described. Raises ValueError."""
    described = Path(root) / "dataset.json"
    if described.exists():
        try:
            return json.loads(described.read_text())["train"]
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{described}: not a description: {error!r}") from None
    shapes = sorted({path.parent.name for path in Path(root).glob("styles/*/*/drawing.png")})
    raise ValueError(
        f"{root}: which of {', '.join(shapes) or 'no shapes'} are styles learned from? "
        "give --train, or write dataset.json with build_dataset.py describe"
    )
