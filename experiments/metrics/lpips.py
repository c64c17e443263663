"""LPIPS: how far apart two images look, to a network (lower is closer).

Source: Zhang, Isola, Efros, Shechtman & Wang, The unreasonable effectiveness of deep features as a
perceptual metric, CVPR 2018, eq. 1; version 0.1 of the weights ("lin")."""

from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F

from metrics.weights import load_convolutions, load_heads

SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)  # of images in [-1, 1]
# before which convolutions a pool stands, and after which ones features are taken
VGG16_POOLS, VGG16_TAPS = {2, 4, 7, 10}, {1, 3, 6, 9, 12}
ALEXNET_POOLS, ALEXNET_STRIDES, ALEXNET_PADS = {1, 2}, (4, 1, 1, 1, 1), (2, 2, 1, 1, 1)

Features = list[torch.Tensor]


class Lpips:
    """The distance through one network, "alexnet" or "vgg16".

    Raises `NoWeights`, from `metrics.weights`."""

    def __init__(self, network: str, device: str | torch.device = "cpu"):
        self.device = torch.device(device)
        self._convolutions = load_convolutions(network, device)
        self._heads = load_heads(network, device)
        self._layers: Callable[[torch.Tensor], Features] = {
            "alexnet": self._alexnet,
            "vgg16": self._vgg16,
        }[network]

    @torch.no_grad()
    def features(self, image: np.ndarray) -> Features:
        """Look at an image (H, W, 3) in [0, 1]: activations of five layers, each (1, C, h, w)."""
        x = torch.as_tensor(image, dtype=torch.float32, device=self.device)
        x = x.permute(2, 0, 1)[None] * 2 - 1
        shift, scale = (
            torch.tensor(v, device=self.device).view(1, 3, 1, 1) for v in (SHIFT, SCALE)
        )
        return self._layers((x - shift) / scale)

    def distance(self, a: np.ndarray, b: np.ndarray) -> float:
        """Measure the distance of two images of one size, (H, W, 3) in [0, 1].

        Raises ValueError if their shapes differ."""
        if a.shape != b.shape:
            raise ValueError(f"images of one size are compared, not of {a.shape} and {b.shape}")
        return self.between(self.features(a), self.features(b))

    @torch.no_grad()
    def between(self, a: Features, b: Features) -> float:
        """Measure the distance of two images by what `features` gave for them."""
        return sum(
            F.conv2d((_unit(x) - _unit(y)) ** 2, head).mean().item()
            for x, y, head in zip(a, b, self._heads, strict=True)
        )

    def _alexnet(self, x: torch.Tensor) -> Features:
        out = []
        for i, (weight, bias) in enumerate(self._convolutions):
            if i in ALEXNET_POOLS:
                x = F.max_pool2d(x, 3, 2)
            x = F.relu(F.conv2d(x, weight, bias, ALEXNET_STRIDES[i], ALEXNET_PADS[i]))
            out.append(x)
        return out

    def _vgg16(self, x: torch.Tensor) -> Features:
        out = []
        for i, (weight, bias) in enumerate(self._convolutions):
            if i in VGG16_POOLS:
                x = F.max_pool2d(x, 2)
            x = F.relu(F.conv2d(x, weight, bias, padding=1))
            if i in VGG16_TAPS:
                out.append(x)
        return out


def _unit(x: torch.Tensor) -> torch.Tensor:
    """Scale the channels of each place to length 1."""
    return x / (x.square().sum(1, keepdim=True).sqrt() + 1e-10)
