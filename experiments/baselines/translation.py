"""What networks that translate plain curves to a drawing have in common: inputs, outputs, luck."""

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from dataset import Sheet
from torch import Tensor
from torch.nn import functional as F

from strokestyle.fit.neural_strokes import PatchSampler, falling_rate
from strokestyle.fit.patches import patch_corners, patch_sizes


@contextmanager
def luck(seed: int, device: torch.device) -> Iterator[np.random.Generator]:
    """Give a generator, and let torch draw from the same seed; its own luck is as before after."""
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(seed)
        yield np.random.default_rng(seed)


def images(image: np.ndarray, device: torch.device) -> Tensor:
    """(1, 3, H, W) of an image (H, W, 3), or (H, W), which becomes grey."""
    tensor = torch.tensor(image, dtype=torch.float32, device=device)
    return (tensor.permute(2, 0, 1) if tensor.ndim == 3 else tensor.expand(3, -1, -1))[None]


def shown(sheet: Sheet, device: torch.device) -> tuple[Tensor, Tensor]:
    """The plain curves (1, 3, H, W) and the geometry maps (1, 8, H, W); all ground is 1."""
    return images(sheet.plain, device), torch.tensor(sheet.maps, device=device)[None]


def picture(rgb: Tensor) -> np.ndarray:
    """(H, W, 3) uint8 of an image (1, 3, H, W) in [0, 1]."""
    return (255 * rgb[0].clamp(0, 1)).round().byte().permute(1, 2, 0).cpu().numpy()


def places(sheet: Sheet, size: int) -> PatchSampler:
    """Where patches of `size` px, or the largest that fit, hold a curve, be it at their borders."""
    (size,) = patch_sizes(sheet.view, (size,))
    return PatchSampler({size: patch_corners(sheet.view, size, centre=1.0)})


class Descent:
    """Adam with a rate that is constant for the first half of all steps and falls to 0 after."""

    def __init__(
        self, network: torch.nn.Module, rate: float, betas: tuple[float, float], steps: int
    ):
        self.optimiser = torch.optim.Adam(network.parameters(), rate, betas=betas)
        self.schedule = falling_rate(self.optimiser, steps, steps // 2, 1.0)[1]

    def step(self, loss: Tensor) -> None:
        """Take one step down a loss."""
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self.optimiser.step()
        self.schedule.step()


# a network after each step of its training, and its losses there
Training = Iterator[tuple[torch.nn.Module, dict[str, Tensor]]]


def trained(training: Training) -> torch.nn.Module:
    """The network after all steps."""
    return deque(training, maxlen=1).pop()[0].eval()


def widened(image: Tensor, left: int, right: int, top: int, bottom: int) -> Tensor:
    """Images (B, K, H, W) with more ground around, px."""
    return F.pad(image, (left, right, top, bottom), value=1.0)
