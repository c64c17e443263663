"""A data set of shapes and of drawings of them, in the paper's protocol (Liu et al. 2021, sec. 5):
each style is learned from one drawing, and tested on the others that its artist made.

DATA/shapes/<shape>/{mesh.obj,camera.json[,curves.json]}
DATA/styles/<style>/<shape>/drawing.png[,take2.png]

Where there is a curves.json, its curves are what was drawn over, and what methods get; else our own
feature curves are extracted. take2.png is the same artist's second drawing of the same shape."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

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
    """A shape from its camera: what every method gets to draw on."""

    shape: str
    view: View

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

    def exemplar(self) -> Exemplar:
        """The drawing as `strokestyle fit` reads it: ink, opacity, mask."""
        view = self.sheet.view
        return load_exemplar(self.path, *self.sheet.size, view.curves.xy[view.required])[0]


class DataSet:
    """The drawings and shapes of a folder, at one size.

    root : DATA
    size : px, the longer side of all images; None = as the cameras have it
    train : the shape that styles are learned from
    """

    def __init__(self, root: Path, train: str, size: int | None = None):
        self.root, self.train, self.size = Path(root), train, size
        self._sheets: dict[str, Sheet] = {}

    def styles(self) -> list[str]:
        """Names of all styles that have a drawing of the training shape."""
        drawings = self.root.glob(f"styles/*/{self.train}/drawing.png")
        return sorted(path.parent.parent.name for path in drawings)

    def tests(self, style: str) -> list[str]:
        """Names of the shapes that a style is tested on."""
        drawings = self.root.glob(f"styles/{style}/*/drawing.png")
        return sorted({path.parent.name for path in drawings} - {self.train})

    def sheet(self, shape: str) -> Sheet:
        """The sheet of a shape; made once."""
        if shape not in self._sheets:
            self._sheets[shape] = Sheet(shape, self._view(self.root / "shapes" / shape))
        return self._sheets[shape]

    def lesson(self, style: str) -> Lesson:
        """The drawing that a style is learned from."""
        path = self.drawing_path(style, self.train)
        sheet = self.sheet(self.train)
        return Lesson(style, sheet, read_image(path, sheet.size), path)

    def drawing_path(self, style: str, shape: str) -> Path:
        """Where the artist's drawing is."""
        return self.root / "styles" / style / shape / "drawing.png"

    def _view(self, folder: Path) -> View:
        surface, camera = load_surface(folder / "mesh.obj"), Camera.load(folder / "camera.json")
        if self.size is not None:
            camera = resized(camera, self.size)
        if not (folder / "curves.json").exists():
            return extract_view(surface, camera)
        curves = load_curves(folder / "curves.json", (camera.width, camera.height))
        return view_of_curves(surface, camera, curves)


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
