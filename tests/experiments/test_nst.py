"""NST: losses in closed form, and that they fall, with a network of few channels at random."""

import numpy as np
import pytest
import torch
from baselines import nst


@pytest.fixture(scope="module")
def network():
    """VGG16's 13 convolutions with 4 channels in each block instead of 64 to 512."""
    draw = torch.Generator().manual_seed(0)
    inward = [3] + [4] * 12
    return [
        (torch.randn(4, count, 3, 3, generator=draw) * (2 / (9 * count)) ** 0.5, torch.zeros(4))
        for count in inward
    ]


@pytest.fixture(scope="module")
def pictures():
    """A style, dark stripes, and a content, one pale line: (1, 3, 32, 32)."""
    style, content = torch.ones(1, 3, 32, 32), torch.ones(1, 3, 32, 32)
    style[:, :, ::3] = 0.2
    content[:, :, :, 16] = 0.6
    return style, content


def test_gram_matrix():
    layer = torch.tensor([[1.0, 2.0, 3.0], [0.0, 1.0, -1.0]])
    wanted = [[14 / 3, -1 / 3], [-1 / 3, 2 / 3]]
    assert np.allclose(nst.gram(layer), wanted)


def test_layers_have_their_sizes(network):
    seen = nst.features(torch.rand(1, 3, 32, 48), network)
    pixels = {name: layer.shape[1] for name, layer in seen.items()}
    assert pixels == {f"conv{i}_1": 32 * 48 // 4 ** (i - 1) for i in range(1, 6)} | {"conv4_2": 24}


def test_losses_are_the_papers():
    """With N channels and M positions: eq. 1, and eq. 4 with its 1 / (4 N^2 M^2)."""
    draw = torch.Generator().manual_seed(1)
    ours, theirs = torch.rand(2, 5, 6, generator=draw)
    by_hand = ((ours @ ours.T - theirs @ theirs.T) ** 2).sum() / (4 * 5**2 * 6**2)
    assert float(nst.gram_loss(ours, nst.gram(theirs))) == pytest.approx(float(by_hand), rel=1e-5)
    targets = nst.Targets({}, {}, theirs, alpha=4.0)
    content = float(targets.content_loss({"conv4_2": ours}))
    assert content == pytest.approx(4 * 0.5 * float(((ours - theirs) ** 2).sum()), rel=1e-5)


def test_a_style_is_its_own_style_at_any_size(network, pictures):
    """Gram matrices do not ask where things are, nor how much of them there is."""
    style, content = pictures
    targets = nst.targets_of(style, content, network, 1.0)
    assert float(targets.style_loss(nst.features(style, network))) == 0
    other = float(targets.style_loss(nst.features(content, network)))
    tiled = float(targets.style_loss(nst.features(style.repeat(1, 1, 1, 3), network)))
    assert tiled < 0.05 * other


def test_blank_paper_is_the_unit_of_both_losses(network, pictures):
    targets = nst.targets_of(*pictures, network, 0.3)
    blank = nst.features(torch.ones(1, 3, 32, 32), network)
    assert float(targets.style_loss(blank)) == pytest.approx(1, rel=1e-4)
    assert float(targets.content_loss(blank)) == pytest.approx(0.3, rel=1e-4)


def test_style_comes_and_content_stays(network, pictures):
    _, content = pictures
    left = []
    for ratio, steps in ((0.0, 20), (1e4, 8)):
        targets = nst.targets_of(*pictures, network, ratio)
        image, losses = nst.transfer(content, targets, network, steps)
        again, _ = nst.transfer(content, targets, network, steps)
        assert torch.equal(image, again) and 0 <= float(image.min()) <= float(image.max()) <= 1
        left.append((image - content).abs().mean())
        if not ratio:
            assert losses[-1] < 0.6 * losses[0]
    assert left[1] < 0.5 * left[0]


def test_sizes_halve():
    sizes = nst.sizes_of(torch.full((1, 3, 33, 20), 0.3), 3)
    assert [tuple(i.shape[2:]) for i in sizes] == [(9, 5), (17, 10), (33, 20)]
    assert all(torch.allclose(i, torch.tensor(0.3)) for i in sizes)
