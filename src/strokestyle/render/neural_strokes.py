"""A style as the paper has it: a surface network, a path network, and a texture network over the whole canvas.

Liu, Fisher, Hertzmann, Kalogerakis: Neural Strokes, ICCV 2021. Section 3.2 is `stroke_geometry`, section 3.3 `texture`.
Images in here are white = 1, stroke = 0, as in the paper: what lies outside the canvas is then background.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor, nn
from torch.nn import functional as F

from ..drawing.edit import cut_at_parts
from ..drawing.ribbon import ribbon, strip_points
from ..drawing.strokes import Drawing, Strokes, Texture
from ..extract.feature_maps import NEURAL_STROKES_MAPS
from ..extract.view import View
from ..geometry.curves import arc_length, owner, tangents
from .coverage import coverage
from .networks import PathNet, SurfaceNet, TextureNet

LEAST_THICKNESS = (
    0.1  # px, and a leaky slope, so that no stroke is stuck at zero (the authors' code)
)
LEAK = 0.01
ROWS, COLUMNS, MARGIN = (
    2,
    24,
    2.0,
)  # texels a px along a strip, across it, and px beyond the half thickness


@dataclass(frozen=True)
class NeuralStrokesStyle:
    """The three networks after training. Their unit is the pixel of the canvas that they saw: draw on one of its size.

    Parameters
    ----------
    surface : SurfaceNet, f in the paper
    path : PathNet, h
    texture : TextureNet, g
    about : provenance: strokestyle version, preset, seed, exemplar
    """

    surface: nn.Module
    path: nn.Module
    texture: nn.Module
    about: dict = field(default_factory=dict)

    def draw(self, view: View, seed: int = 0) -> Drawing:
        """Draw a view. The paper's style has no chance in it: `seed` changes nothing."""
        size = (view.camera.width, view.camera.height)
        curves = view.curves
        if not len(curves):
            empty = Strokes(np.zeros((0, 2)), np.zeros(0), [0], [], [])
            return Drawing(empty, size, np.zeros((0, 4)))
        device = next(self.path.parameters()).device
        with torch.no_grad():
            maps, points = view_maps(view, device), curve_features(view, device)
            offsets = torch.tensor(curves.offsets, device=device)
            deep = padded(self.surface, maps)
            xy, thickness = stroke_geometry(self.path, deep, points, offsets)
            mask = 1.0 - coverage(xy, thickness, offsets, size[1], size[0])
            rgb = padded(self.texture, torch.cat([maps[:, :-1], mask[None, None]], dim=1))[0]
        strokes = Strokes(
            xy.double().cpu().numpy(),
            thickness.clamp(min=0).double().cpu().numpy(),
            curves.offsets,
            curves.kind,
            curves.closed,
        )
        image = outside_white(rgb.cpu().numpy().transpose(1, 2, 0), mask.cpu().numpy())
        texture, color = look_up(strokes, image)
        drawing = Drawing(strokes, size, color, texture)
        if view.parts is None:
            return drawing
        return cut_at_parts(
            drawing, view.parts.cut(curves.offsets, arc_length(curves.xy, curves.offsets))
        )

    def state(self) -> dict:
        """The networks' weights as arrays, for the model file."""
        nets = {name: getattr(self, name).state_dict() for name in ("surface", "path", "texture")}
        return {
            name: {key: value.cpu().numpy() for key, value in net.items()}
            for name, net in nets.items()
        }

    @classmethod
    def from_state(cls, state: dict, about: dict, device: torch.device) -> NeuralStrokesStyle:
        """Raises KeyError or RuntimeError where the state is not that of the paper's networks."""
        with torch.random.fork_rng(devices=[]):
            nets = {"surface": SurfaceNet(), "path": PathNet(), "texture": TextureNet()}
        for name, net in nets.items():
            net.load_state_dict(
                {key: torch.from_numpy(value) for key, value in state[name].items()}
            )
            net.to(device).eval()
        return cls(**nets, about=about)


def view_maps(view: View, device: torch.device | str = "cpu") -> Tensor:
    """V in the paper: eight geometry maps and the plain raster, (1, 9, H, W); background and white are 1."""
    values = np.stack(
        [*(view.maps[name] for name in NEURAL_STROKES_MAPS), 1.0 - view.maps["plain"]]
    )
    return torch.tensor(values, dtype=torch.float32, device=device)[None]


def curve_features(view: View, device: torch.device | str = "cpu") -> Tensor:
    """Per curve point (N, 7): x, y; tangent; normal; normalised arc length (sec. 3.2, "Path geometry module")."""
    curves = view.curves
    t = tangents(curves.xy, curves.offsets, curves.closed)
    along = arc_length(curves.xy, curves.offsets)
    length = np.maximum(curves.lengths(), 1e-6)[owner(curves.offsets)]
    columns = [curves.xy, t, np.stack([-t[:, 1], t[:, 0]], axis=1), (along / length)[:, None]]
    return torch.tensor(np.concatenate(columns, axis=1), dtype=torch.float32, device=device)


def stroke_geometry(
    path: nn.Module, deep: Tensor, points: Tensor, offsets: Tensor, image: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Eq. 1: [t, d] = avg(h(P), h(P')), P' with the curve's direction turned round.

    Parameters
    ----------
    deep : (B, 40, H, W), F = f(V)
    points : (N, 7) of `curve_features`, in pixels of `deep`
    offsets : (C+1,) cuts points into curves
    image : (N,) int, the image of the batch that a point lies on; None = the first

    Returns
    -------
    displaced points (N, 2) and thickness (N,), px; a strongly negative output leaves it below 0, with a gradient
    """
    height, width = deep.shape[2:]
    column = points[:, 0].floor().long().clamp(0, width - 1)
    row = points[:, 1].floor().long().clamp(0, height - 1)
    image = torch.zeros_like(row) if image is None else image
    here = deep[image, :, row, column]  # (N, 40), nearest pixel
    direction, arc = points[:, 2:6], points[:, 6:]
    out = (
        sum(path(torch.cat([here, sign * direction, arc], dim=1), offsets) for sign in (1.0, -1.0))
        / 2.0
    )
    return points[:, :2] + out[:, :2], F.leaky_relu(out[:, 2], LEAK) + LEAST_THICKNESS


def padded(network: nn.Module, maps: Tensor) -> Tensor:
    """Run a network that halves twice on maps (1, K, H, W) of any size: background is added to the right and below."""
    height, width = maps.shape[2:]
    maps = F.pad(maps, (0, -width % 4, 0, -height % 4), value=1.0)
    return network(maps)[..., :height, :width]


def outside_white(rgb: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """RGB (H, W, 3) with everything beyond the mask (H, W, 0 = stroke), grown by 2 px, set to white (the code)."""
    near = ndimage.binary_dilation(mask < 0.999, np.ones((5, 5)))
    return np.where(near[..., None], rgb, 1.0)


def look_up(strokes: Strokes, image: np.ndarray) -> tuple[Texture, np.ndarray]:
    """Sec. 3.3, last paragraph: the u-v texture of each stroke is read from the translated image (H, W, 3).

    Ink and opacity are told apart on white paper: the least opacity that gives the colour.
    Returns the texture and the mean ink of every stroke (C, 4).
    """
    strips, counts, colors = [], [], []
    for i in range(len(strokes)):
        band = ribbon(strokes, i, MARGIN)
        rows = max(2, round(ROWS * band.length))
        at = strip_points(band, rows, COLUMNS)
        place = [at[..., 1] - 0.5, at[..., 0] - 0.5]
        rgb = np.stack(
            [ndimage.map_coordinates(image[..., k], place, order=1, cval=1.0) for k in range(3)],
            axis=-1,
        )
        alpha = 1.0 - rgb.min(axis=-1)
        ink = np.where(
            alpha[..., None] > 1e-3, 1.0 - (1.0 - rgb) / np.maximum(alpha, 1e-3)[..., None], 0.0
        )
        strips.append(np.concatenate([ink, alpha[..., None]], axis=-1).clip(0, 1))
        counts.append(rows)
        weight = alpha.sum() + 1e-9
        middle = np.abs(np.arange(COLUMNS) - 0.5 * (COLUMNS - 1)) < 0.25 * COLUMNS
        colors.append([*(ink * alpha[..., None]).sum((0, 1)) / weight, alpha[:, middle].mean()])
    rgba = (np.concatenate(strips) * 255.0 + 0.5).astype(np.uint8)
    return Texture(rgba, np.r_[0, np.cumsum(counts)], MARGIN), np.clip(colors, 0, 1)
