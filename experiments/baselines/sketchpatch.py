"""SketchPatch: a network translates patches of plain curves to patches of the drawing, paired.

Fish, Perry, Bermano, Cohen-Or: SketchPatch: Sketch Stylization via Seamless Patch-level Synthesis,
ACM Transactions on Graphics 39(6) (SIGGRAPH Asia), 2020.

The generator sees hybrids: patches whose borders are partly styled already, the rest plain. So a
canvas is drawn patch by patch, overlapping, each going on with what its neighbours have.
As Liu et al. (Neural Strokes, 2021, sec. 5) compare it, it gets the geometry maps as further
channels; and, in two steps (their appendix 3), one network draws the strokes' mask, grey, from the
plain curves, and a second one the drawing from that mask.

Sizes, weights and schedule are those of its authors' program (facts, not text): patches of 64 px,
nine residual blocks, 64 channels; all weights 1 in images of [-1, 1], so 2 for L1 in [0, 1]; the
blur a Gaussian of deviation 10 px cut to 10 px, whose own deviation is 2.85 px; hybrids in half of
all patches, each side styled with probability 1/2 over 1/16 to 1/2 of the patch; 100 + 100 epochs
of some 100,000 patches in batches of 64, turned by any angle and mirrored.
"""

from dataclasses import dataclass, replace
from functools import partial

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
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from torch import Tensor, nn
from torch.nn import functional as F

from strokestyle.fit.losses import blur, lsgan_loss
from strokestyle.fit.neural_strokes import PatchSampler, initialise
from strokestyle.fit.patches import turned_patches
from strokestyle.render.networks import PatchDiscriminator, TextureNet

BLUR = 2.85  # px, deviation
PLAIN_SHARE = 0.5  # of patches that have nothing styled in their input
MIRRORED_SHARE = 2 / 3


@dataclass(frozen=True)
class SketchPatchConfig:
    """How SketchPatch is trained.

    width, blocks : of the generator; channels of its first layer, residual blocks
    judge_width : of the discriminator
    patch : px
    batch, steps : the rate is constant for half of the steps, and falls to 0 after
    rate : of Adam
    color, blurred, adversarial : weights of the losses, for images in [0, 1]
    """

    width: int = 64
    blocks: int = 9
    judge_width: int = 64
    patch: int = 64
    batch: int = 64
    steps: int = 312_500
    rate: float = 2e-4
    color: float = 2.0
    blurred: float = 2.0
    adversarial: float = 1.0


# ------------------------------------------------------------------------------------------- learn


@dataclass(frozen=True)
class Pairs:
    """What is learned from: all of one canvas, ground 1.

    plain, styled : (1, 3, H, W)
    maps : (1, K, H, W), K 8 or 0
    """

    plain: Tensor
    styled: Tensor
    maps: Tensor


def train(pairs: Pairs, where: PatchSampler, config: SketchPatchConfig, seed: int) -> Training:
    """Train a generator; yields it, and the losses, after each step."""
    device = pairs.plain.device
    with luck(seed, device) as rng:
        channels = 3 + pairs.maps.shape[1]
        generator = TextureNet(channels, config.width, config.blocks).to(device)
        judge = PatchDiscriminator(config.judge_width).to(device)
        initialise(generator)
        initialise(judge)
        learn = Descent(generator, config.rate, (0.5, 0.999), config.steps)
        learn_judge = Descent(judge, config.rate, (0.5, 0.999), config.steps)
        everyone = torch.ones(config.batch, device=device)
        for _ in range(config.steps):
            some, real = _patches(pairs, where, config.batch, rng)
            kept = torch.tensor(styled_borders(config.batch, some.plain.shape[-1], rng))
            hybrid = torch.where(kept.to(device), some.styled, some.plain)
            fake = generator(torch.cat([hybrid, some.maps], dim=1))
            color = F.l1_loss(fake, some.styled)
            blurred = F.l1_loss(blur(fake, BLUR), blur(some.styled, BLUR))
            judged = lsgan_loss(judge(fake), 1.0, everyone)
            learn.step(
                config.color * color + config.blurred * blurred + config.adversarial * judged
            )
            loss_fake = lsgan_loss(judge(fake.detach()), 0.0, everyone)
            learn_judge.step(0.5 * (loss_fake + lsgan_loss(judge(real), 1.0, everyone)))
            yield generator, {"color": color.detach(), "adversarial": judged.detach()}


def _patches(
    pairs: Pairs, where: PatchSampler, batch: int, rng: np.random.Generator
) -> tuple[Pairs, Tensor]:
    """A batch of patches, turned and mirrored; and the drawing (B, 3, h, w) at other places."""
    size, corners = where.draw(rng, 2 * batch)
    stack = torch.cat([pairs.plain, pairs.styled, pairs.maps], dim=1)
    turned = turned_patches(stack, corners, size, rng.uniform(0, 2 * np.pi, len(corners)))
    mirrored = torch.tensor(rng.uniform(size=len(corners)) < MIRRORED_SHARE, device=stack.device)
    turned = torch.where(mirrored[:, None, None, None], turned.flip(3), turned)
    some = turned[:batch]
    return Pairs(some[:, :3], some[:, 3:6], some[:, 6:]), turned[batch:, 3:6]


def styled_borders(batch: int, size: int, rng: np.random.Generator) -> np.ndarray:
    """Which pixels (B, 1, size, size) of hybrids are styled: strips along some of the sides."""
    styled = np.zeros((batch, 4, size, size), bool)
    hybrid = rng.uniform(size=batch) >= PLAIN_SHARE
    widths = rng.integers(size // 16, size // 2 + 1, (batch, 4))
    widths *= hybrid[:, None] & (rng.uniform(size=(batch, 4)) < 0.5)
    near = np.arange(size)
    from_start = near < widths[:, :, None]
    from_end = from_start[:, :, ::-1]
    styled[:, 0], styled[:, 1] = from_start[:, 0, :, None], from_end[:, 1, :, None]
    styled[:, 2], styled[:, 3] = from_start[:, 2, None], from_end[:, 3, None]
    return styled.any(axis=1, keepdims=True)


# -------------------------------------------------------------------------------------------- draw


@dataclass(frozen=True)
class Grid:
    """Overlapping patches that cover a canvas, row by row.

    corners : (P, 2) x, y of the widened canvas
    size, context : px, of a patch and of its overlap with the next
    columns : patches in a row
    """

    corners: np.ndarray
    size: int
    context: int
    columns: int

    @classmethod
    def of(cls, height: int, width: int, size: int) -> "Grid":
        """The grid of a canvas, px, widened by a quarter of a patch on its left and above."""
        context = size // 4
        y, x = (np.arange(0, n + context, size - context) for n in (height, width))
        corners = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return cls(corners, size, context, len(x))

    def widened(self, image: Tensor) -> Tensor:
        """Images (B, K, H, W) with ground around, so that all patches lie within."""
        right, bottom = self.corners[-1] + self.size - self.context
        height, width = image.shape[2:]
        return widened(image, self.context, right - width, self.context, bottom - height)

    def neighbours(self) -> np.ndarray:
        """Pairs (E, 2) of patches that lie side by side or one above the other."""
        number = np.arange(len(self.corners)).reshape(-1, self.columns)
        beside = np.stack([number[:, :-1], number[:, 1:]], axis=-1).reshape(-1, 2)
        below = np.stack([number[:-1], number[1:]], axis=-1).reshape(-1, 2)
        return np.concatenate([beside, below])

    def cut(self, patch: int) -> tuple[slice, slice]:
        """Rows and columns of a patch."""
        x, y = self.corners[patch]
        return slice(y, y + self.size), slice(x, x + self.size)


def order(grid: Grid, ink: np.ndarray, rng: np.random.Generator) -> list[int]:
    """All patches with ink, along the curves: from one of each connected set, breadth first over
    the tree of the neighbours that share the most ink. `ink` (H, W) is the widened canvas's."""
    pairs = grid.neighbours()
    shared = np.array([_overlap(grid, ink, a, b) for a, b in pairs])
    linked = shared > 0
    cost = ink.size + 1 - shared[linked]  # the tree of the least cost has the most ink
    count = len(grid.corners)
    graph = coo_matrix((cost, tuple(pairs[linked].T)), (count, count))
    tree = minimum_spanning_tree(graph)
    _, belongs = connected_components(tree, directed=False)
    inked = np.array([ink[grid.cut(i)].any() for i in range(count)])
    found: list[int] = []
    for which in np.unique(belongs[inked]):
        start = rng.choice(np.flatnonzero(inked & (belongs == which)))
        found.extend(breadth_first_order(tree, start, directed=False)[0].tolist())
    return found


def _overlap(grid: Grid, ink: np.ndarray, a: int, b: int) -> int:
    """Ink, px, in what two patches share."""
    (x, y), (right, bottom) = grid.corners[b], grid.corners[a] + grid.size
    return int(ink[y:bottom, x:right].sum())


def stylise(
    generator: nn.Module,
    curves: Tensor,
    source: Tensor,
    maps: Tensor,
    patch: int,
    rng: np.random.Generator,
) -> Tensor:
    """Draw over a source (1, 3, H, W) patch by patch, each from what of it is drawn already.

    Patches are those that hold a pixel of the plain curves (1, 3, H, W), as in training; of these,
    unlike the source, the ground is exactly 1. Overlaps are blended. A patch whose curves lie in
    overlaps alone, all drawn already, is drawn too: they are 1 px wide, strokes reach further.
    """
    height, width = source.shape[2:]
    grid = Grid.of(height, width, patch)
    canvas, maps = grid.widened(source).clone(), grid.widened(maps)
    ink = (grid.widened(curves)[0].amin(0) < 1).cpu().numpy()
    drawn = np.zeros(len(grid.corners), bool)
    for i in order(grid, ink, rng):
        rows, columns = grid.cut(i)
        here = canvas[:, :, rows, columns]
        with torch.no_grad():
            made = generator(torch.cat([here, maps[:, :, rows, columns]], dim=1))
        share = torch.tensor(_share(grid, i, drawn), dtype=made.dtype, device=made.device)
        canvas[:, :, rows, columns] = torch.lerp(here, made, share)
        drawn[i] = True
    return canvas[:, :, grid.context :, grid.context :][:, :, :height, :width]


def _share(grid: Grid, patch: int, drawn: np.ndarray) -> np.ndarray:
    """How much (size, size) of a patch is new: 1, but rising from 0 where a drawn one overlaps."""
    ramp = 1 / (1 + np.exp(-np.linspace(-1, 1, grid.context)))
    ramp = (ramp - ramp[0]) / (ramp[-1] - ramp[0])
    start = np.r_[ramp, np.ones(grid.size - grid.context)]
    column, columns = patch % grid.columns, grid.columns

    def has(neighbour: int, exists: bool) -> bool:
        return exists and bool(drawn[neighbour])

    across, down = np.ones(grid.size), np.ones(grid.size)
    across *= start if has(patch - 1, column > 0) else 1
    across *= start[::-1] if has(patch + 1, column < columns - 1) else 1
    down *= start if has(patch - columns, patch >= columns) else 1
    down *= start[::-1] if has(patch + columns, patch + columns < len(drawn)) else 1
    return down[:, None] * across


# ----------------------------------------------------------------------------------------- methods


def learn(lesson: Lesson, config: SketchPatchConfig, seed: int, device: str, maps: bool) -> Painter:
    """Train one network, plain curves to drawing; with the geometry maps or without."""
    where = places(lesson.sheet, config.patch)
    kind = torch.device(device)
    plain, geometry = shown(lesson.sheet, kind)
    pairs = Pairs(plain, images(lesson.drawing, kind), geometry[:, : 8 if maps else 0])
    generator = trained(train(pairs, where, config, seed))

    def paint(sheet: Sheet, seed: int) -> np.ndarray:
        plain, geometry = shown(sheet, kind)
        rng = np.random.default_rng(seed)
        geometry = geometry[:, : pairs.maps.shape[1]]
        return picture(stylise(generator, plain, plain, geometry, config.patch, rng))

    return paint


def learn_two_steps(lesson: Lesson, config: SketchPatchConfig, seed: int, device: str) -> Painter:
    """Train two networks with maps: plain curves to the artist's mask, then what the first one
    draws of the training shape to the drawing."""
    where = places(lesson.sheet, config.patch)
    kind = torch.device(device)
    plain, maps = shown(lesson.sheet, kind)
    mask = images(1.0 - lesson.exemplar().mask, kind)
    geometry = trained(train(Pairs(plain, mask, maps), where, config, seed))

    def strokes(plain: Tensor, maps: Tensor, seed: int) -> Tensor:
        drawn = stylise(geometry, plain, plain, maps, config.patch, np.random.default_rng(seed))
        return drawn.mean(dim=1, keepdim=True).expand(-1, 3, -1, -1)

    pairs = Pairs(strokes(plain, maps, seed), images(lesson.drawing, kind), maps)
    texture = trained(train(pairs, where, config, seed))

    def paint(sheet: Sheet, seed: int) -> np.ndarray:
        plain, maps = shown(sheet, kind)
        drawn = strokes(plain, maps, seed)
        rng = np.random.default_rng(seed)
        return picture(stylise(texture, plain, drawn, maps, config.patch, rng))

    return paint


SOURCE = "Fish, Perry, Bermano, Cohen-Or: SketchPatch, SIGGRAPH Asia 2020"
# a quarter of the channels, 6 blocks for 9, 1/16 of the batch, 1/400 of the steps at 5 x the rate
REDUCED = SketchPatchConfig(
    width=16, blocks=6, judge_width=16, patch=64, batch=4, steps=750, rate=1e-3
)
TWO_STEP_REDUCED = replace(REDUCED, steps=600)  # each
FULL = SketchPatchConfig()

METHODS = {
    "sketchpatch": Method("SketchPatch", SOURCE, partial(learn, maps=True), REDUCED, FULL),
    "sketchpatch_no_maps": Method(
        "SketchPatch, no maps", SOURCE, partial(learn, maps=False), REDUCED, FULL
    ),
    "sketchpatch_two_step": Method(
        "SketchPatch, two steps", SOURCE, learn_two_steps, TWO_STEP_REDUCED, FULL
    ),
}
