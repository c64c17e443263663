"""The losses of the paper (Liu et al. 2021, eqs. 2 to 5) and of its authors' code."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

# px: patches with no stroke in this centre do not count in the adversarial losses (the code)
JUDGED_CENTRE = 36


def smoothness_loss(displacement: Tensor, offsets: Tensor) -> Tensor:
    """Eq. 3: mean squared difference of neighbouring displacements (N, 2), over each path.

    `offsets` (C+1,) cuts the points into paths, which all count alike.
    """
    which = torch.repeat_interleave(
        torch.arange(len(offsets) - 1, device=offsets.device), offsets.diff()
    )
    within = which[1:] == which[:-1]
    change = displacement.diff(dim=0).square().sum(1)[within]
    weight = 1.0 / (offsets.diff() - 1).to(change.dtype)[which[1:][within]]
    return (change * weight).sum() / (len(offsets) - 1)


def holds_stroke(white: Tensor) -> Tensor:
    """(B,) 1 for patches (B, H, W), stroke dark on white, that hold stroke in their centre."""
    near = max(0, (white.shape[-1] - JUDGED_CENTRE) // 2)
    middle = white[:, near : white.shape[1] - near, near : white.shape[2] - near]
    return (middle.amin(dim=(1, 2)) < 0.9).to(white.dtype)


def lsgan_loss(verdict: Tensor, wanted: float, judged: Tensor) -> Tensor:
    """Mean squared distance of verdicts (B, 1, h, w) from `wanted`, over the patches `judged` (B,).

    Mao et al., Least Squares Generative Adversarial Networks, 2017.
    """
    each = (verdict - wanted).square().mean(dim=(1, 2, 3))
    return (each * judged).sum() / judged.sum().clamp(min=1.0)


def blur(image: Tensor, sigma: float = 2.0) -> Tensor:
    """Gaussian blur, `sigma` px, of images (B, 3, H, W)."""
    reach = int(3 * sigma)
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1, device=image.device) / sigma) ** 2)
    kernel = (kernel / kernel.sum()).expand(3, 1, 1, -1)
    image = F.conv2d(F.pad(image, (reach, reach, 0, 0), mode="replicate"), kernel, groups=3)
    return F.conv2d(
        F.pad(image, (0, 0, reach, reach), mode="replicate"), kernel.transpose(2, 3), groups=3
    )
