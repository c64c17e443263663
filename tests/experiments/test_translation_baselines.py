"""SketchPatch and SinCUT: closed forms, the canvas drawn patch by patch, and that they learn."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from baselines import sincut, sketchpatch
from baselines.translation import images, luck, places, shown
from dataset import Lesson, Sheet
from PIL import Image
from small_views import a_view
from torch.nn import functional as F

SKETCHPATCH = sketchpatch.SketchPatchConfig(
    width=4, blocks=1, judge_width=4, patch=32, batch=4, steps=30, rate=5e-3
)
SINCUT = sincut.SinCutConfig(
    width=4, judge_width=2, projection=8, crop=32, zoom=1.0, batch=4, spots=8, steps=20, rate=5e-3
)
CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def sheet():
    return Sheet("waves", a_view())


@pytest.fixture(scope="module")
def lesson(sheet, tmp_path_factory):
    """Red lines, 3 px thick, in place of the plain ones."""
    thick = -F.max_pool2d(-torch.tensor(sheet.plain)[None], 3, 1, 1)[0].numpy()
    drawing = np.stack([np.ones_like(thick), thick, thick], axis=-1)
    path = tmp_path_factory.mktemp("red") / "drawing.png"
    Image.fromarray((255 * drawing).astype(np.uint8)).save(path)
    return Lesson("red", sheet, drawing, path)


def mean_losses(training, name):
    """Of the first five and of the last five steps."""
    losses = [each[name].item() for _, each in training]
    return np.mean(losses[:5]), np.mean(losses[-5:])


def test_hybrids_are_styled_along_some_sides():
    size, batch = 32, 4000
    styled = sketchpatch.styled_borders(batch, size, np.random.default_rng(0))[:, 0]
    hybrid = styled.any(axis=(1, 2))
    assert abs(hybrid.mean() - 0.5 * 15 / 16) < 0.03  # half of them, if any side is chosen
    middle = styled[:, size // 2 - 1 : size // 2 + 1, size // 2 - 1 : size // 2 + 1]
    assert middle.any(axis=(1, 2)).mean() < 0.2  # only the widest strips, half a patch, get there
    for side in (styled[:, :, 0], styled[:, :, -1], styled[:, 0], styled[:, -1]):
        whole = side.all(axis=1)  # this side was chosen, or two wide ones meet
        assert 0.2 < whole.mean() < 0.3
        assert side.any(axis=1)[~hybrid].sum() == 0
    left = styled[:, size // 2, :].sum(axis=1)
    assert set(left[left > 0]) >= set(range(size // 16, size // 2 + 1))


def test_patches_follow_the_curves(sheet):
    plain, _ = shown(sheet, CPU)
    grid = sketchpatch.Grid.of(96, 96, 32)
    ink = (grid.widened(plain)[0].amin(0) < 1).numpy()
    order = sketchpatch.order(grid, ink, np.random.default_rng(0))
    inked = [i for i in range(len(grid.corners)) if ink[grid.cut(i)].any()]
    assert sorted(order) == inked
    pairs = {frozenset(pair) for pair in grid.neighbours().tolist()}
    alone = [i for k, i in enumerate(order) if not any({i, j} in pairs for j in order[:k])]
    assert len(alone) == 2  # one start a line


def test_patches_follow_the_most_ink():
    """Four patches around a ring, whose weakest link, of 0 and 1, is left out."""
    grid = sketchpatch.Grid.of(40, 40, 32)
    ink = np.zeros((56, 56), bool)
    ink[10, 28] = ink[45, 25:30] = ink[25:30, 10] = ink[25:30, 45] = True
    ways = {tuple(sketchpatch.order(grid, ink, np.random.default_rng(k))) for k in range(12)}
    assert {way for way in ways if way[0] < 2} == {(0, 2, 3, 1), (1, 3, 2, 0)}


def test_a_canvas_of_patches_has_no_seams(sheet):
    """Generators of which the whole canvas is known: one recolours each pixel, one paints what a
    map says. Both draw exactly that, whatever the order and the overlaps."""
    plain, _ = shown(sheet, CPU)
    thick = -F.max_pool2d(-plain[:, :1], 7, 1, 3)

    def red(x):
        return torch.cat([torch.ones_like(x[:, :1]), x[:, 1:3]], dim=1)

    def told(x):
        return x[:, 3:].expand(-1, 3, -1, -1)

    for seed in range(3):
        rng = np.random.default_rng(seed)
        drawn = sketchpatch.stylise(red, plain, plain, thick, 32, rng)
        assert torch.allclose(drawn, red(plain), atol=1e-6)
        drawn = sketchpatch.stylise(told, plain, plain, thick, 32, rng)
        assert drawn.shape == plain.shape
        assert (drawn - thick).abs().max() < 1 / 255


def test_ground_that_is_not_quite_white_is_left_alone(sheet):
    """What a first network draws has no ground of exactly 1: patches without a curve stay."""
    plain, _ = shown(sheet, CPU)
    source = 0.99 * torch.ones_like(plain)
    rng = np.random.default_rng(0)
    drawn = sketchpatch.stylise(lambda x: 0 * x, plain, source, plain[:, :0], 32, rng)
    assert (drawn[0, 0, 70] < 0.01)[10:86].all()  # along a curve
    assert (drawn[0, :, :8] == source[0, :, :8]).all()  # far above all of them


def test_overlaps_are_blended():
    """Patches that are black and white in turn, along one line: grey rises and falls by the ramp,
    a sigmoid over 8 px, never by more than its steepest step."""
    plain = torch.ones(1, 3, 96, 96)
    plain[:, :, 32] = 0
    calls = []

    def checkered(x):
        calls.append(x)
        return torch.full_like(x[:, :3], len(calls) % 2)

    maps = torch.ones(1, 0, 96, 96)
    row = sketchpatch.stylise(checkered, plain, plain, maps, 32, np.random.default_rng(0))[0, 0, 32]
    assert row.max() == 1 and row.min() == 0
    assert 0.1 < row.diff().abs().max() < 0.16


def test_sketchpatch_learns(lesson):
    plain, maps = shown(lesson.sheet, CPU)
    pairs = sketchpatch.Pairs(plain, images(lesson.drawing, CPU), maps)
    training = sketchpatch.train(pairs, places(lesson.sheet, 32), SKETCHPATCH, 0)
    first, last = mean_losses(training, "color")
    assert last < 0.6 * first


@pytest.mark.parametrize("method", ["sketchpatch", "sketchpatch_no_maps", "sketchpatch_two_step"])
def test_the_same_seed_draws_the_same_patches(method, lesson):
    learn, config = sketchpatch.METHODS[method].learn, replace(SKETCHPATCH, steps=2)
    first, again, other = (learn(lesson, config, k, "cpu")(lesson.sheet, 1) for k in (3, 3, 4))
    assert first.shape == (96, 96, 3) and first.dtype == np.uint8
    assert (first == again).all() and (first != other).any()


def test_only_sketchpatch_without_maps_is_blind_to_maps(lesson):
    other = Sheet("waves", lesson.sheet.view)
    other.__dict__["maps"] = lesson.sheet.maps * 0.3
    for method, blind in (("sketchpatch", False), ("sketchpatch_no_maps", True)):
        config = replace(SKETCHPATCH, steps=2)
        paint = sketchpatch.METHODS[method].learn(lesson, config, 0, "cpu")
        assert (paint(lesson.sheet, 0) == paint(other, 0)).all() == blind


def test_contrast_in_closed_form():
    unit = torch.eye(5)
    found = sincut.nce_loss(unit, unit)
    assert torch.isclose(found, torch.log(1 + 4 * torch.exp(torch.tensor(-1 / 0.07))), atol=1e-7)
    assert torch.isclose(sincut.nce_loss(unit[:1].expand(5, -1), unit[:1].expand(5, -1)).exp(),
                         torch.tensor(5.0))  # fmt: skip
    assert sincut.nce_loss(unit, unit.roll(1, 0)) > 10  # each most like another's key


def test_penalty_in_closed_form():
    real = torch.rand(4, 3, 8, 8, requires_grad=True)
    weight = torch.randn(3 * 8 * 8)
    penalty = sincut.r1_penalty(real.flatten(1) @ weight[:, None], real)
    assert torch.isclose(penalty, 0.5 * weight.square().sum())


def test_parts_keep_size_and_variance():
    with luck(0, CPU):
        x = torch.randn(8, 16, 32, 32)
        assert 0.9 < sincut.Conv(16, 16, 3)(x).std() < 1.1
        assert sincut.Block(16, 8, down=True)(x).shape == (8, 8, 16, 16)
        assert sincut.Up(16, 4)(x).shape == (8, 4, 64, 64)
        assert sincut.Generator(11, 4)(torch.ones(1, 11, 34, 46)).shape == (1, 3, 34, 46)
        assert sincut.Judge(64, 2)(torch.ones(2, 3, 64, 64)).shape == (2, 1)
    assert torch.allclose(sincut.smoothed(torch.ones(1, 2, 9, 9), 0), torch.tensor(1.0))


def test_contrast_does_not_see_the_maps():
    with luck(0, CPU):
        networks = sincut.Networks(8, SINCUT)
        made, image, maps = (
            torch.rand(2, 3, 32, 32),
            torch.rand(2, 3, 32, 32),
            torch.rand(2, 8, 32, 32),
        )
    losses = []
    for k in (1.0, 0.1):
        with luck(0, CPU):
            losses.append(networks.nce(made, sincut.Crops(image, k * maps), SINCUT).item())
    assert losses[0] == losses[1]


def test_sincut_learns(lesson):
    plain, maps = shown(lesson.sheet, CPU)
    where = places(lesson.sheet, SINCUT.crop)
    drawing = images(lesson.drawing, CPU)
    losses = list(sincut.train(plain, drawing, maps, where, SINCUT, 0))
    first, last = mean_losses(losses, "identity")
    assert last < 0.6 * first
    first, last = mean_losses(losses, "nce")
    assert last < first - 0.01


def test_the_same_seed_draws_the_same_canvas(lesson):
    learn = sincut.METHODS["sincut"].learn
    short = replace(SINCUT, steps=2, zoom=1.5)
    first, again, other = (learn(lesson, short, k, "cpu")(lesson.sheet, 1) for k in (3, 3, 4))
    assert first.shape == (96, 96, 3) and first.dtype == np.uint8
    assert (first == again).all() and (first != other).any()
