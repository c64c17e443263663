"""SinCUT: unpaired translation of plain curves to the drawing, held together by contrast.

Park, Efros, Zhang, Zhu: Contrastive Learning for Unpaired Image-to-Image Translation, ECCV 2020,
its single-image variant (fig. 9): generator and discriminator of StyleGAN2's parts
(Karras et al. 2020), crops of one image of each domain at random scales, a penalty on the
discriminator's gradient (R1, Mescheder et al. 2018), PatchNCE whose negatives come from the whole
batch, and both an identity NCE and an L1 identity loss.

As Liu et al. (Neural Strokes, 2021, sec. 5) compare it, crops are taken where there are curves, and
the generator gets the geometry maps as further channels; the drawing, which lies on the same shape,
gets its own where it is to be left as it is. The PatchNCE encodes images with blank maps: with the
same maps in both, places would be told by their maps alone, whatever is drawn there.

Sizes, weights and schedule are those of its authors' program (facts, not text): weights 4 for the
NCE and 1 for the others, temperature 0.07, one spot a crop and layer, Adam at 0.002, 8 + 8 epochs
of 100,000 crops in batches of 16.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from baselines.translation import (
    Descent,
    Training,
    images,
    luck,
    picture,
    places,
    shown,
    trained,
    widened,
)
from dataset import Lesson, Sheet
from methods import Method, Painter
from torch import Tensor, nn
from torch.nn import functional as F

from strokestyle.fit.neural_strokes import PatchSampler
from strokestyle.fit.patches import crop

FIR = (1.0, 3.0, 3.0, 1.0)
NCE_LAYERS = (0, 2, 4)  # of the encoder: its input, half size, the second block after
TEMPERATURE = 0.07
BEYOND = 32  # px around a canvas, more than the generator sees


@dataclass(frozen=True)
class SinCutConfig:
    """How SinCUT is trained.

    width : of the generator at full size, channels; twice as many at half size
    judge_width : of the discriminator at 64 px, channels
    projection : length of the features that the NCE compares
    crop : px, a power of 2
    zoom : crops are of the image shrunk by up to this, each axis by its own
    batch, steps : the rate is constant for half of the steps, and falls to 0 after
    rate : of Adam
    spots : of each crop and layer that the NCE compares
    nce, identity, r1 : weights of the losses, for images in [-1, 1]
    """

    width: int = 80
    judge_width: int = 32
    projection: int = 256
    crop: int = 64
    zoom: float = 3.0
    batch: int = 16
    steps: int = 100_000
    rate: float = 2e-3
    spots: int = 1
    nce: float = 4.0
    identity: float = 1.0
    r1: float = 1.0


# ---------------------------------------------------------------------------------------- networks


def smoothed(x: Tensor, padding: int, gain: float = 1.0) -> Tensor:
    """(B, K, H, W) through a binomial filter of 4 px."""
    kernel = torch.tensor(FIR, dtype=x.dtype, device=x.device)
    kernel = gain * kernel[:, None] * kernel / kernel.sum() ** 2
    kernel = kernel.expand(x.shape[1], 1, -1, -1)
    return F.conv2d(x, kernel, padding=padding, groups=x.shape[1])


class Activation(nn.Module):
    """Add a bias, rectify, and keep the variance."""

    def __init__(self, channels: int):
        super().__init__()
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        shape = (-1, *[1] * (x.ndim - 2))
        return F.leaky_relu(x + self.bias.view(shape), 0.2) * math.sqrt(2)


class Conv(nn.Module):
    """A convolution at an equalised rate: weights of variance 1, scaled when they are used."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int, down: bool = False):
        super().__init__()
        self.weight = nn.Parameter(torch.randn(channels_out, channels_in, kernel, kernel))
        self.down = down

    def forward(self, x: Tensor) -> Tensor:
        reach = self.weight.shape[-1] // 2
        weight = self.weight / math.sqrt(self.weight[0].numel())
        if self.down:
            return F.conv2d(smoothed(x, 1 + reach), weight, stride=2)
        return F.conv2d(x, weight, padding=reach)


class Linear(nn.Module):
    """A matrix at an equalised rate."""

    def __init__(self, channels_in: int, channels_out: int):
        super().__init__()
        self.weight = nn.Parameter(torch.randn(channels_out, channels_in))

    def forward(self, x: Tensor) -> Tensor:
        return F.linear(x, self.weight / math.sqrt(x.shape[1]))


class Block(nn.Module):
    """Two convolutions and a way past them, at full or half size."""

    def __init__(self, channels_in: int, channels_out: int, down: bool = False):
        super().__init__()
        self.body = nn.Sequential(
            Conv(channels_in, channels_in, 3),
            Activation(channels_in),
            Conv(channels_in, channels_out, 3, down),
            Activation(channels_out),
        )
        past = Conv(channels_in, channels_out, 1, down)
        self.past = past if down or channels_in != channels_out else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        return (self.body(x) + self.past(x)) / math.sqrt(2)


class Up(nn.Module):
    """A convolution to twice the size with weights of norm 1, and noise of a learned strength."""

    def __init__(self, channels_in: int, channels_out: int):
        super().__init__()
        self.weight = nn.Parameter(torch.randn(channels_in, channels_out, 3, 3))
        self.strength = nn.Parameter(torch.zeros(1))
        self.activation = Activation(channels_out)

    def forward(self, x: Tensor) -> Tensor:
        norm = self.weight.square().sum(dim=(0, 2, 3), keepdim=True).add(1e-8).sqrt()
        x = smoothed(F.conv_transpose2d(x, self.weight / norm, stride=2), 1, gain=4.0)
        noise = torch.randn(len(x), 1, *x.shape[2:], dtype=x.dtype, device=x.device)
        return self.activation(x + self.strength * noise)


class Generator(nn.Module):
    """Make images (B, 3, H, W) of images with maps (B, 3 + 8, H, W); H and W are even."""

    def __init__(self, channels: int, width: int):
        super().__init__()
        self.encoder = nn.ModuleList(
            [
                nn.Identity(),
                nn.Sequential(Conv(channels, width, 1), Activation(width)),
                Block(width, 2 * width, down=True),
                *(Block(2 * width, 2 * width) for _ in range(3)),
            ]
        )
        self.decoder = nn.Sequential(
            *(Block(2 * width, 2 * width) for _ in range(3)),
            Up(2 * width, width),
            Conv(width, 3, 1),
            Activation(3),
        )

    def encode(self, x: Tensor, layers: int | None = None) -> list[Tensor]:
        """What each layer of the encoder makes of x, or the first `layers`."""
        found = []
        for layer in self.encoder[:layers]:
            x = layer(x)
            found.append(x)
        return found

    def forward(self, x: Tensor) -> Tensor:
        return self.decoder(self.encode(x)[-1])


class Judge(nn.Module):
    """Judge crops (B, 3, S, S) as a whole: (B, 1)."""

    def __init__(self, size: int, width: int):
        super().__init__()
        sizes = [size >> k for k in range(size.bit_length() - 2)]  # down to 4 px
        channels = [min(12 * width, 64 * width // each) for each in sizes]
        self.body = nn.Sequential(
            Conv(3, channels[0], 1),
            Activation(channels[0]),
            *(Block(a, b, down=True) for a, b in zip(channels, channels[1:], strict=False)),
            Conv(channels[-1], channels[-1], 3),
            Activation(channels[-1]),
            nn.Flatten(),
            Linear(16 * channels[-1], channels[-1]),
            Activation(channels[-1]),
            Linear(channels[-1], 1),
        )
        self.bias = nn.Parameter(torch.zeros(1))

    def forward(self, rgb: Tensor) -> Tensor:
        return self.body(rgb) + self.bias


class Projection(nn.Module):
    """Features of some spots of each layer, projected to the unit sphere."""

    def __init__(self, channels: list[int], length: int):
        super().__init__()
        self.heads = nn.ModuleList(
            nn.Sequential(nn.Linear(each, length), nn.ReLU(), nn.Linear(length, length))
            for each in channels
        )
        for head in self.heads.modules():
            if isinstance(head, nn.Linear):
                nn.init.xavier_normal_(head.weight, 0.02)
                nn.init.zeros_(head.bias)

    def forward(self, layers: list[Tensor], spots: list[Tensor]) -> list[Tensor]:
        """(B S, length) of layers (B, K, h, w), at spots (S,), counted row by row."""
        return [
            F.normalize(head(x.flatten(2)[:, :, spot].movedim(1, 2).flatten(0, 1)), dim=1)
            for head, x, spot in zip(self.heads, layers, spots, strict=True)
        ]


# ------------------------------------------------------------------------------------------ losses


def nce_loss(queries: Tensor, keys: Tensor) -> Tensor:
    """PatchNCE: each of the unit vectors (N, L) is to be most like its own key
    (N, L), and unlike those of all others."""
    likeness = queries @ keys.detach().T / TEMPERATURE
    return F.cross_entropy(likeness, torch.arange(len(queries), device=queries.device))


def r1_penalty(verdict: Tensor, real: Tensor) -> Tensor:
    """Half the mean squared gradient of verdicts (B, 1) by the images (B, K, H, W)."""
    (gradient,) = torch.autograd.grad(verdict.sum(), real, create_graph=True)
    return 0.5 * gradient.square().sum(dim=(1, 2, 3)).mean()


# ------------------------------------------------------------------------------------------- learn


@dataclass(frozen=True)
class Crops:
    """A batch of crops.

    image : (B, 3, S, S) in [-1, 1]
    maps : (B, K, S, S)
    """

    image: Tensor
    maps: Tensor

    def input(self) -> Tensor:
        """What the generator sees."""
        return torch.cat([self.image, self.maps], dim=1)


class Networks(nn.Module):
    """Generator, discriminator and projection, untrained."""

    def __init__(self, maps: int, config: SinCutConfig):
        super().__init__()
        self.generator = Generator(3 + maps, config.width)
        self.judge = Judge(config.crop, config.judge_width)
        self.projection = Projection([3 + maps, *2 * [2 * config.width]], config.projection)

    def nce(self, made: Tensor, source: Crops, config: SinCutConfig) -> Tensor:
        """Mean over the layers of the NCE between images made and their sources."""
        blank = torch.ones_like(source.maps)
        with torch.no_grad():
            keys = self._layers(torch.cat([source.image, blank], dim=1))
        queries = self._layers(torch.cat([made, blank], dim=1))
        spots = [torch.randperm(x[0, 0].numel(), device=x.device)[: config.spots] for x in queries]
        projected = (self.projection(layers, spots) for layers in (queries, keys))
        return torch.stack([nce_loss(*pair) for pair in zip(*projected, strict=True)]).mean()

    def _layers(self, x: Tensor) -> list[Tensor]:
        found = self.generator.encode(x, NCE_LAYERS[-1] + 1)
        return [found[i] for i in NCE_LAYERS]


def train(
    plain: Tensor,
    drawing: Tensor,
    maps: Tensor,
    where: PatchSampler,
    config: SinCutConfig,
    seed: int,
) -> Training:
    """Train a generator on one sheet: plain and drawing (1, 3, H, W) in [0, 1], maps (1, K, H, W).

    Yields it, and the losses, after each step.
    """
    with luck(seed, plain.device) as rng:
        networks = Networks(maps.shape[1], config).to(plain.device)
        generator, judge = networks.generator, networks.judge
        both = nn.ModuleList([generator, networks.projection])
        learn = Descent(both, config.rate, (0.0, 0.99), config.steps)
        learn_judge = Descent(judge, config.rate, (0.0, 0.99), config.steps)
        for _ in range(config.steps):
            source = _crops(plain, maps, where, config, rng)
            target = _crops(drawing, maps, where, config, rng)
            made, same = generator(torch.cat([source.input(), target.input()])).chunk(2)
            real = target.image.clone().requires_grad_()
            verdict = judge(real)
            loss_judge = 0.5 * (F.softplus(judge(made.detach())) + F.softplus(-verdict)).mean()
            learn_judge.step(loss_judge + config.r1 * r1_penalty(verdict, real))
            adversarial = F.softplus(-judge(made)).mean()
            nce = 0.5 * (networks.nce(made, source, config) + networks.nce(same, target, config))
            identity = F.l1_loss(same, target.image)
            learn.step(adversarial + config.nce * nce + config.identity * identity)
            losses = {"adversarial": adversarial, "nce": nce, "identity": identity}
            yield generator, {name: loss.detach() for name, loss in losses.items()}


def _crops(
    image: Tensor, maps: Tensor, where: PatchSampler, config: SinCutConfig, rng: np.random.Generator
) -> Crops:
    """Crops of an image and its maps, shrunk alike, where there are curves; some mirrored."""
    stack = torch.cat([2 * image - 1, maps], dim=1)
    shape = np.array(stack.shape[2:])
    shrunk = np.maximum(config.crop, shape * rng.uniform(1 / config.zoom, 1, 2)).round().astype(int)
    if config.zoom > 1:
        stack = F.interpolate(stack, size=tuple(shrunk), mode="bilinear", antialias=True)
    size, corners = where.draw(rng, config.batch)
    scale = (shrunk / shape)[::-1]  # corners are x, y
    moved = ((corners + size / 2) * scale - config.crop / 2).round().astype(int)
    found = crop(stack[0], moved.clip(0, shrunk[::-1] - config.crop), config.crop)
    mirrored = torch.tensor(rng.uniform(size=config.batch) < 0.5, device=found.device)
    found = torch.where(mirrored[:, None, None, None], found.flip(3), found)
    return Crops(found[:, :3], found[:, 3:])


def learn(lesson: Lesson, config: SinCutConfig, seed: int, device: str) -> Painter:
    """Train the generator on the lesson's sheet, with geometry maps; it draws whole canvases."""
    kind = torch.device(device)
    plain, maps = shown(lesson.sheet, kind)
    where = places(lesson.sheet, config.crop)
    drawing = images(lesson.drawing, kind)
    generator = trained(train(plain, drawing, maps, where, config, seed))

    def paint(sheet: Sheet, seed: int) -> np.ndarray:
        plain, maps = shown(sheet, kind)
        height, width = plain.shape[2:]
        # ground around: what lies beyond a crop is 0, neither ground nor ink
        right, bottom = BEYOND + width % 2, BEYOND + height % 2
        canvas = widened(torch.cat([2 * plain - 1, maps], dim=1), BEYOND, right, BEYOND, bottom)
        with torch.no_grad(), luck(seed, kind):
            drawn = generator(canvas)[:, :, BEYOND:, BEYOND:][:, :, :height, :width]
        return picture((drawn + 1) / 2)

    return paint


SOURCE = "Park, Efros, Zhang, Zhu: Contrastive Learning for Unpaired Translation, ECCV 2020"
# a tenth of the channels (a quarter in the judge), half the crop's side and the batch, 1/180 of the
# steps, twice the rate; no zoom, as strokes are 2 to 5 px wide at 256 px; 8 spots for fewer crops
REDUCED = SinCutConfig(
    width=8, judge_width=8, projection=64, crop=32, zoom=1.0, batch=8, spots=8, steps=550, rate=4e-3
)

METHODS = {"sincut": Method("SinCUT", SOURCE, learn, REDUCED, SinCutConfig())}
