"""Define the networks of the paper: its three, and its discriminator.

The paper is Liu, Fisher, Hertzmann, Kalogerakis: Neural Strokes, ICCV 2021; its networks stand here
layer by layer. Instance normalisation has no parameters of its own and every convolution has a
bias, as in the authors' program. Points of curves come flat, (N, P), with the offsets that cut them
into curves; no curve sees another.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F


class OnePad2d(nn.ConstantPad2d):
    """Pad with 1, what the feature maps hold in the background."""

    def __init__(self, padding: int):
        super().__init__(padding, 1.0)


def _conv(
    channels_in: int, channels_out: int, kernel: int, stride: int = 1, padding: int = 0
) -> list[nn.Module]:
    """A convolution, normalised and rectified."""
    layer = nn.Conv2d(channels_in, channels_out, kernel, stride, padding)
    return [layer, nn.InstanceNorm2d(channels_out), nn.ReLU()]


def _up(channels_in: int, channels_out: int) -> list[nn.Module]:
    """The same, transposed: it doubles height and width."""
    layer = nn.ConvTranspose2d(channels_in, channels_out, 3, stride=2, padding=1, output_padding=1)
    return [layer, nn.InstanceNorm2d(channels_out), nn.ReLU()]


class ResidualBlock(nn.Module):
    """Add to maps (B, K, H, W) what two convolutions make of them (He et al. 2016)."""

    def __init__(self, channels: int):
        super().__init__()
        self.body = nn.Sequential(
            nn.ReflectionPad2d(1),
            *_conv(channels, channels, 3),
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
        )

    def forward(self, x: Tensor) -> Tensor:  # (B, K, H, W)
        return x + self.body(x)


class SurfaceNet(nn.Module):
    """f: make deep features (B, 40, H, W) of feature maps (B, 9, H, W); H, W multiples of 4.

    The paper's appendix, first table.
    """

    def __init__(self, maps: int = 9):
        super().__init__()
        self.body = nn.Sequential(
            OnePad2d(3),
            *_conv(maps, 10, 7),
            *_conv(10, 20, 3, stride=2, padding=1),
            *_conv(20, 40, 3, stride=2, padding=1),
            *(ResidualBlock(40) for _ in range(4)),
            *_up(40, 40),
            *_up(40, 40),
            *_conv(40, 40, 1),
        )

    def forward(self, maps: Tensor) -> Tensor:
        return self.body(maps)


class PathNet(nn.Module):
    """h: make displacement x, y and raw thickness, px, (N, 3), of point features (N, 45).

    The paper's appendix, second table.
    """

    def __init__(self, features: int = 45):
        super().__init__()
        self.layers = nn.ModuleList(
            [nn.Conv1d(features, 40, 3), nn.Conv1d(40, 40, 3), nn.Conv1d(40, 3, 3)]
        )

    def forward(self, points: Tensor, offsets: Tensor) -> Tensor:
        rows, total = gapped(offsets, 1)
        x = points.new_zeros(total, points.shape[1]).index_copy(0, rows, points).T[None]
        inside = points.new_zeros(total).index_fill(0, rows, 1.0)
        for i, module in enumerate(self.layers):  # x is (1, P, total)
            layer = cast(nn.Conv1d, module)
            x = F.conv1d(x, layer.weight, layer.bias, padding=1)
            x = (F.relu(x) if i < 2 else x) * inside
        return x[0].T[rows]


class TextureNet(nn.Module):
    """g: make RGB (B, 3, H, W) in [0, 1] of eight geometry maps and the stroke mask (B, 9, H, W).

    The paper's appendix, third table. `width` is the channels of its first layer, `blocks` how many
    are residual.
    """

    def __init__(self, maps: int = 9, width: int = 64, blocks: int = 6):
        super().__init__()
        self.body = nn.Sequential(
            nn.ReflectionPad2d(3),
            *_conv(maps, width, 7),
            *_conv(width, 2 * width, 3, stride=2, padding=1),
            *_conv(2 * width, 4 * width, 3, stride=2, padding=1),
            *(ResidualBlock(4 * width) for _ in range(blocks)),
            *_up(4 * width, 2 * width),
            *_up(2 * width, width),
            nn.ReflectionPad2d(3),
            nn.Conv2d(width, 3, 7),
            nn.Sigmoid(),
        )

    def forward(self, maps: Tensor) -> Tensor:
        return self.body(maps)


class PatchDiscriminator(nn.Module):
    """D: judge RGB (B, 3, H, W), each value of (B, 1, h, w) a patch of 70 x 70 px.

    Isola et al. 2017. `width` is the channels of its first layer.
    """

    def __init__(self, width: int = 64) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(3, width, 4, 2, 1), nn.LeakyReLU(0.2)]
        for step, stride in enumerate((2, 2, 1)):
            a, b = width << step, width << step + 1
            layers += [nn.Conv2d(a, b, 4, stride, 1), nn.InstanceNorm2d(b), nn.LeakyReLU(0.2)]
        self.body = nn.Sequential(*layers, nn.Conv2d(8 * width, 1, 4, 1, 1))

    def forward(self, rgb: Tensor) -> Tensor:
        return self.body(rgb)


def gapped(offsets: Tensor, gap: int) -> tuple[Tensor, int]:
    """Lay curves in one sequence with `gap` zeros around each.

    Returns
    -------
    the row of each point in it (N,), and its length
    """
    counts = offsets.diff()
    owner = torch.repeat_interleave(torch.arange(len(counts), device=offsets.device), counts)
    rows = torch.arange(len(owner), device=offsets.device) + gap * (owner + 1)
    return rows, len(owner) + gap * (len(counts) + 1)
