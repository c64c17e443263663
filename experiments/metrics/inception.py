"""The Inception network of FID, up to its last pool: images -> 2048 features each.

Source: Heusel et al., GANs trained by a two time-scale update rule converge to a local Nash
equilibrium, NeurIPS 2017, who took TensorFlow's inception-2015-12-05 (Szegedy et al., Rethinking
the Inception architecture for computer vision, CVPR 2016). It differs from the network of that
paper, and from torchvision's, in how it pools: averages count no padding, and the last block takes
the maximum."""

from functools import lru_cache

import numpy as np
import torch
import torch.nn.functional as F

from metrics.weights import load_arrays

SIDE = 299  # px, what the network was trained on
EPSILON = 1e-3  # of its batch normalisation
FEATURES = 2048


class Inception:
    """The network, its batch normalisation folded into its convolutions.

    Raises `NoWeights`, from `metrics.weights`."""

    def __init__(self, device: str | torch.device = "cpu"):
        self.device = torch.device(device)
        self._convolutions: dict[str, tuple[torch.Tensor, torch.Tensor]] = {}
        arrays = load_arrays("inception")
        for name in arrays:
            if name.endswith("/weight"):
                stem = name.removesuffix("/weight")
                deviation = np.sqrt(arrays[f"{stem}/var"] + EPSILON)
                weight = arrays[name] / deviation[:, None, None, None]
                bias = arrays[f"{stem}/beta"] - arrays[f"{stem}/mean"] / deviation
                self._convolutions[stem.removeprefix("net/layers/")] = (
                    torch.tensor(weight, device=self.device),
                    torch.tensor(bias, device=self.device),
                )

    @torch.no_grad()
    def features(self, images: np.ndarray, side: int = SIDE, batch: int = 8) -> np.ndarray:
        """Look at images (N, H, W, 3) in [0, 1] of any size: (N, 2048) float32, `pool3`.

        They are brought to (255 v - 128) / 128, and to squares as TensorFlow 1 does, `resized`.

        side : px, of those squares; FID is of 299
        """
        found = [np.empty((0, FEATURES), np.float32)]
        for start in range(0, len(images), batch):
            x = torch.as_tensor(images[start : start + batch], dtype=torch.float32)
            x = resized(x.to(self.device).permute(0, 3, 1, 2) * 255, side)
            found.append(self.last_maps((x - 128) / 128).mean((2, 3)).cpu().numpy())
        return np.concatenate(found)

    def first_maps(self, x: torch.Tensor) -> torch.Tensor:
        """Run the first three convolutions and the pool: (N, 3, h, w) in [-1, 1) -> (N, 64, ..)."""
        x = self._convolve(x, "conv", stride=2, padded=False)
        x = self._convolve(x, "conv_1", padded=False)
        return F.max_pool2d(self._convolve(x, "conv_2"), 3, 2)

    def last_maps(self, x: torch.Tensor) -> torch.Tensor:
        """Run all: (N, 3, 299, 299) in [-1, 1) -> (N, 2048, 8, 8)."""
        x = self._convolve(self.first_maps(x), "conv_3")
        x = F.max_pool2d(self._convolve(x, "conv_4", padded=False), 3, 2)
        for name in ("mixed", "mixed_1", "mixed_2"):
            x = self._mix(x, name)
        x = self._shrink(x, "mixed_3", ["conv", "tower"])
        for name in ("mixed_4", "mixed_5", "mixed_6", "mixed_7"):
            x = self._mix(x, name)
        x = self._shrink(x, "mixed_8", ["tower", "tower_1"])
        x = self._fork(x, "mixed_9", _mean_around(x))
        return self._fork(x, "mixed_10", F.max_pool2d(x, 3, 1, 1))

    def _convolve(
        self, x: torch.Tensor, name: str, stride: int = 1, padded: bool = True
    ) -> torch.Tensor:
        weight, bias = self._convolutions[name]
        padding = [k // 2 if padded else 0 for k in weight.shape[2:]]
        return F.relu(F.conv2d(x, weight, bias, stride, padding))

    def _tower(self, x: torch.Tensor, name: str, shrinks: bool = False) -> torch.Tensor:
        """Run the convolutions of a tower; the last of one that shrinks halves the size."""
        names = [n for n in self._convolutions if n == name or n.startswith(f"{name}/")]
        for n in names[: -1 if shrinks else None]:
            x = self._convolve(x, n)
        return self._convolve(x, names[-1], stride=2, padded=False) if shrinks else x

    def _mix(self, x: torch.Tensor, name: str) -> torch.Tensor:
        """Run a block of towers side by side (figures 5 and 6 of Szegedy et al.)."""
        towers = [self._tower(x, f"{name}/{tower}") for tower in ("conv", "tower", "tower_1")]
        return torch.cat([*towers, self._tower(_mean_around(x), f"{name}/tower_2")], 1)

    def _shrink(self, x: torch.Tensor, name: str, towers: list[str]) -> torch.Tensor:
        """Run a block that halves the size (figure 10)."""
        shrunk = [self._tower(x, f"{name}/{tower}", shrinks=True) for tower in towers]
        return torch.cat([*shrunk, F.max_pool2d(x, 3, 2)], 1)

    def _fork(self, x: torch.Tensor, name: str, pooled: torch.Tensor) -> torch.Tensor:
        """Run a block whose towers fork at their ends (figure 7)."""
        a = self._convolve(x, f"{name}/tower_conv")
        b = self._convolve(self._convolve(x, f"{name}/tower_1_conv"), f"{name}/tower_1_conv_1")
        parts = [self._convolve(x, f"{name}/conv")]
        for stem, y in (("tower", a), ("tower_1", b)):
            parts += [self._convolve(y, f"{name}/{stem}_mixed_conv{i}") for i in ("", "_1")]
        return torch.cat([*parts, self._convolve(pooled, f"{name}/tower_2_conv")], 1)


def _mean_around(x: torch.Tensor) -> torch.Tensor:
    """Average 3 x 3 px, padding not counted."""
    return F.avg_pool2d(x, 3, 1, 1, count_include_pad=False)


def resized(x: torch.Tensor, side: int) -> torch.Tensor:
    """Bring images (N, C, H, W) to a square as TensorFlow 1's ResizeBilinear does.

    Pixel i of the output is at i * in / out of the input, the edge held; there is no antialias."""
    rows, columns = (_bilinear(n, side).to(x.device) for n in x.shape[2:])
    return torch.einsum("ih,nchw,jw->ncij", rows, x, columns)


@lru_cache(maxsize=16)
def _bilinear(n: int, out: int) -> torch.Tensor:
    """The matrix (out, n) of one axis."""
    at = torch.arange(out, dtype=torch.float64) * n / out
    low = at.floor().long().clamp(max=n - 1)
    weight, rows = at - low, torch.arange(out)
    matrix = torch.zeros(out, n, dtype=torch.float64)
    matrix[rows, low] += 1 - weight
    matrix[rows, (low + 1).clamp(max=n - 1)] += weight
    return matrix.float()
