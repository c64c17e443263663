"""Draw in a style as the paper has it: a surface network, a path network, and a texture network.

Liu, Fisher, Hertzmann, Kalogerakis: Neural Strokes, ICCV 2021. Section 3.2 is `StrokeGeometry`,
section 3.3 the texture network, which sees the whole canvas, and `look_up`. Images in here are
white = 1, stroke = 0, as in the paper: what lies outside the canvas is then background.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor, nn
from torch.nn import functional as F

from ..drawing.edit import cut_at_parts
from ..drawing.ribbon import Ribbon, across, ribbon, strip_points
from ..drawing.strokes import Drawing, Strokes, Texture
from ..extract.feature_maps import NEURAL_STROKES_MAPS
from ..extract.view import View
from ..geometry.curves import arc_length, owner, tangents
from .choice import LineChoice, choose_lines, leaves_nothing
from .coverage import coverage
from .networks import PathNet, SurfaceNet, TextureNet

MIN_THICKNESS = 0.1  # px, so that no stroke is stuck at zero (the authors' code)
LEAK = 0.01  # slope of the thickness where the network's output is below 0 (the authors' code)
ROWS_A_PX = 2  # texels of a strip along its stroke
COLUMNS = 24  # texels across it
MARGIN = 2.0  # px beyond the half thickness that a strip reaches
MIDDLE = 0.5  # of a strip's width, where the opacity of the flat ink is measured


class Paths(NamedTuple):
    """Curves, or pieces of them, over the images of a batch.

    points : (N, 7) of `curve_features`, in px of their image
    offsets : (C+1,) int64, path i is rows offsets[i]:offsets[i+1]
    image : (N,) int64, the image of the batch that a point lies on
    """

    points: Tensor
    offsets: Tensor
    image: Tensor

    @classmethod
    def of(cls, view: View, device: torch.device | str = "cpu") -> Paths:
        """Take all curves of a view, over one image."""
        points = curve_features(view, device)
        offsets = torch.tensor(view.curves.offsets, device=device)
        return cls(points, offsets, torch.zeros(len(points), dtype=torch.int64, device=device))

    def drawn(self, xy: Tensor, thickness: Tensor, maps: Tensor) -> Tensor:
        """Draw the paths, moved to `xy` (N, 2), on the images of maps (B, K, H, W): (B, H, W)."""
        images, _, height, width = maps.shape
        owners = self.image[self.offsets[:-1]]
        return 1.0 - coverage(xy, thickness, self.offsets, height, width, owners, images)


class StrokeGeometry(nn.Module):
    """Make strokes of curves: the paper's section 3.2, surface and path geometry module.

    Parameters
    ----------
    surface : SurfaceNet, f
    path : PathNet, h
    """

    def __init__(self, surface: nn.Module, path: nn.Module):
        super().__init__()
        self.surface, self.path = surface, path

    def forward(self, maps: Tensor, paths: Paths) -> tuple[Tensor, Tensor]:
        """Predict where strokes go and how thick they are: eq. 1, [t, d] = avg(h(P), h(P')).

        P' are the features of the points with the curve's direction turned round. `maps` are V,
        (B, 9, H, W). Returns what `moved` does.
        """
        here = nearest(padded(self.surface, maps), paths)
        direction, along = paths.points[:, 2:6], paths.points[:, 6:]
        there, back = (
            self.path(torch.cat([here, sign * direction, along], dim=1), paths.offsets)
            for sign in (1.0, -1.0)
        )
        return moved(paths, (there + back) / 2.0)

    def draw(self, maps: Tensor, paths: Paths) -> tuple[Tensor, Tensor]:
        """Draw the strokes, (B, H, W); also gives the displacement (N, 2) of the paths' points."""
        xy, thickness = self(maps, paths)
        return paths.drawn(xy, thickness, maps), xy - paths.points[:, :2]


@dataclass(frozen=True)
class NeuralStrokesStyle:
    """The three networks after training.

    Their unit is the pixel of the canvas that they saw: draw on one of its size.

    Parameters
    ----------
    geometry : f and h in the paper
    texture : TextureNet, g
    about : provenance: strokestyle version, preset, seed, exemplar
    choice : which lines are drawn, or None for all; that is ours, not the paper's
    """

    geometry: StrokeGeometry
    texture: nn.Module
    about: dict = field(default_factory=dict)
    choice: LineChoice | None = None

    def choose(self, view: View) -> View:
        """Leave out of a view the lines, and parts of lines, that the artist would not draw."""
        return choose_lines(view, self.choice)

    def leaves_nothing(self, view: View) -> bool:
        """Tell whether the artist would draw no line of a view, so that `choose` keeps all."""
        return leaves_nothing(view, self.choice)

    def draw(self, view: View, seed: int = 0, choice: str = "learned") -> Drawing:
        """Draw a view, in its pixels. There is no chance in this style: `seed` changes nothing.

        `choice` is as `Style.draw` takes it.
        """
        view = choose_lines(view, self.choice if choice == "learned" else None)
        size = (view.camera.width, view.camera.height)
        if not len(view.curves):
            return Drawing(Strokes.empty(), size, np.zeros((0, 4)))
        strokes, image = self._translate(view)
        texture, color = look_up(strokes, image)
        drawing = Drawing(strokes, size, color, texture)
        if view.parts is None:
            return drawing
        along = arc_length(view.curves.xy, view.curves.offsets)
        return cut_at_parts(drawing, view.parts.cut(view.curves.offsets, along))

    def _translate(self, view: View) -> tuple[Strokes, np.ndarray]:
        """The strokes of a view, and the image of them as the texture network has it (H, W, 3)."""
        device = next(self.geometry.parameters()).device
        with torch.no_grad():
            maps, paths = view_maps(view, device), Paths.of(view, device)
            xy, thickness = self.geometry(maps, paths)
            image = painted(self.texture, maps, paths.drawn(xy, thickness, maps)[0])
        return Strokes(
            xy.double().cpu().numpy(),
            thickness.clamp(min=0).double().cpu().numpy(),
            view.curves.offsets,
            view.curves.kind,
            view.curves.closed,
        ), image

    def state(self) -> dict:
        """Give the networks' weights as arrays, for the model file: {network: {weight: array}}."""
        nets = {
            "surface": self.geometry.surface,
            "path": self.geometry.path,
            "texture": self.texture,
        }
        return {
            name: {key: value.cpu().numpy() for key, value in net.state_dict().items()}
            for name, net in nets.items()
        }

    @classmethod
    def from_state(cls, state: dict, about: dict, device: torch.device) -> NeuralStrokesStyle:
        """Make a style of what `state` gave.

        Raises KeyError or RuntimeError where that is not the state of the paper's networks.
        """
        with torch.random.fork_rng(devices=[]):
            nets = {"surface": SurfaceNet(), "path": PathNet(), "texture": TextureNet()}
        for name, net in nets.items():
            net.load_state_dict(
                {key: torch.from_numpy(value) for key, value in state[name].items()}
            )
            net.to(device).eval()
        return cls(StrokeGeometry(nets["surface"], nets["path"]), nets["texture"], about)


def view_maps(view: View, device: torch.device | str = "cpu") -> Tensor:
    """Stack V in the paper: eight geometry maps and the plain raster, (1, 9, H, W).

    Background and white are 1.
    """
    values = np.stack(
        [*(view.maps[name] for name in NEURAL_STROKES_MAPS), 1.0 - view.maps["plain"]]
    )
    return torch.tensor(values, dtype=torch.float32, device=device)[None]


def curve_features(view: View, device: torch.device | str = "cpu") -> Tensor:
    """Measure curve points, (N, 7): x, y in px; tangent; normal; normalised arc length.

    The paper's section 3.2, "Path geometry module".
    """
    curves = view.curves
    t = tangents(curves.xy, curves.offsets, curves.closed)
    along = arc_length(curves.xy, curves.offsets)
    length = np.maximum(curves.lengths(), 1e-6)[owner(curves.offsets)]
    columns = [curves.xy, t, np.stack([-t[:, 1], t[:, 0]], axis=1), (along / length)[:, None]]
    return torch.tensor(np.concatenate(columns, axis=1), dtype=torch.float32, device=device)


def nearest(deep: Tensor, paths: Paths) -> Tensor:
    """Look up deep features (B, K, H, W) at the pixel nearest to each point: (N, K)."""
    height, width = deep.shape[2:]
    column = paths.points[:, 0].floor().long().clamp(0, width - 1)
    row = paths.points[:, 1].floor().long().clamp(0, height - 1)
    return deep[paths.image, :, row, column]


def moved(paths: Paths, out: Tensor) -> tuple[Tensor, Tensor]:
    """Move paths and give them thickness by what networks make for their points (N, 3).

    Returns
    -------
    displaced points (N, 2) and thickness (N,), px; a strongly negative output leaves the thickness
    below 0, with a gradient
    """
    return paths.points[:, :2] + out[:, :2], F.leaky_relu(out[:, 2], LEAK) + MIN_THICKNESS


def painted(texture: nn.Module, maps: Tensor, mask: Tensor) -> np.ndarray:
    """Paint strokes with g on U: the maps without the plain raster, and the strokes' mask.

    Parameters
    ----------
    texture : TextureNet, g
    maps : (1, 9, H, W) of `view_maps`
    mask : (H, W), white 1

    Returns (H, W, 3), white beyond the strokes.
    """
    with torch.no_grad():
        rgb = padded(texture, torch.cat([maps[:, :-1], mask[None, None]], dim=1))[0]
    return outside_white(rgb.cpu().numpy().transpose(1, 2, 0), mask.cpu().numpy())


def padded(network: nn.Module, maps: Tensor) -> Tensor:
    """Run a network that halves twice on maps (1, K, H, W) of any size.

    Background is added to the right and below, and what is made of it is left out.
    """
    height, width = maps.shape[2:]
    maps = F.pad(maps, (0, -width % 4, 0, -height % 4), value=1.0)
    return network(maps)[..., :height, :width]


def outside_white(rgb: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Set RGB (H, W, 3) to white beyond the mask (H, W, 0 = stroke), grown by 2 px.

    As the authors' code does.
    """
    near = ndimage.binary_dilation(mask < 0.999, np.ones((5, 5)))
    return np.where(near[..., None], rgb, 1.0)


def look_up(strokes: Strokes, image: np.ndarray) -> tuple[Texture, np.ndarray]:
    """Read the u-v texture of each stroke from the translated image (H, W, 3).

    Section 3.3, last paragraph. Ink and opacity are told apart as on white paper: the opacity is
    the least that gives the colour.

    Returns
    -------
    the texture, and the mean ink of every stroke, straight RGBA (C, 4), its opacity that of the
    middle of its strip
    """
    strips = [_strip_of(image, ribbon(strokes, i, MARGIN)) for i in range(len(strokes))]
    offsets = np.cumsum([0] + [len(strip) for strip in strips])
    colors = [_mean_ink(strip) for strip in strips]
    rgba = (np.concatenate(strips).clip(0, 1) * 255.0 + 0.5).astype(np.uint8)
    margin = np.full(len(strips), MARGIN)
    return Texture(rgba, offsets, margin), np.clip(colors, 0, 1)


def _strip_of(image: np.ndarray, band: Ribbon) -> np.ndarray:
    """The strip (n, COLUMNS, 4), straight alpha, that a ribbon has on an image (H, W, 3)."""
    at = strip_points(band, max(2, round(ROWS_A_PX * band.length)), COLUMNS)
    place = [at[..., 1] - 0.5, at[..., 0] - 0.5]
    rgb = np.stack(
        [ndimage.map_coordinates(image[..., k], place, order=1, cval=1.0) for k in range(3)],
        axis=-1,
    )
    alpha = 1.0 - rgb.min(axis=-1, keepdims=True)
    ink = np.where(alpha > 1e-3, 1.0 - (1.0 - rgb) / np.maximum(alpha, 1e-3), 0.0)
    return np.concatenate([ink, alpha], axis=-1)


def _mean_ink(strip: np.ndarray) -> list[float]:
    """Mean colour of the ink of a strip (n, COLUMNS, 4), and the opacity of its middle."""
    ink, alpha = strip[..., :3], strip[..., 3]
    middle = np.abs(across(COLUMNS)) < MIDDLE
    color = (ink * alpha[..., None]).sum((0, 1)) / (alpha.sum() + 1e-9)
    return [*color.tolist(), float(alpha[:, middle].mean())]
