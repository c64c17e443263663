"""NST: losses in closed form, and that they fall, with a network of few channels at random."""

import numpy as np
import pytest
import torch
from baselines import nst
from metrics.weights import NoWeights, load_vgg16


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
    targets = nst.Targets({"conv1_1": 1.0, "conv4_2": 2.0}, {"conv1_1": nst.gram(theirs)})
    by_hand = ((ours @ ours.T - theirs @ theirs.T) ** 2).sum() / (4 * 5**2 * 6**2)
    assert float(targets.style_loss({"conv1_1": ours})) == pytest.approx(float(by_hand), rel=1e-5)
    content = targets.content_loss({"conv4_2": ours}, theirs)
    assert float(content) == pytest.approx(4 * 0.5 * float(((ours - theirs) ** 2).sum()), rel=1e-5)


def test_a_style_is_its_own_style_at_any_size(network, pictures):
    """Gram matrices do not ask where things are, nor how much of them there is."""
    style, content = pictures
    targets = nst.targets_of(style, network)
    assert float(targets.style_loss(nst.features(style, network))) == 0
    other = float(targets.style_loss(nst.features(content, network)))
    tiled = float(targets.style_loss(nst.features(style.repeat(1, 1, 1, 3), network)))
    assert tiled < 0.05 * other


def test_style_comes_and_content_stays(network, pictures):
    style, content = pictures
    targets = nst.targets_of(style, network)
    image, losses = nst.transfer(content, content, targets, network, 1e-6, 20)
    assert losses[-1] < 0.2 * losses[0]
    with torch.no_grad():
        seen = nst.features(image, network)
        wanted = nst.features(content, network)["conv4_2"]
        assert float(targets.style_loss(seen)) < 0.6 * losses[0]
    kept, _ = nst.transfer(content, content, targets, network, 1e3, 10)
    near, far = (
        float(targets.content_loss(nst.features(i, network), wanted)) for i in (kept, image)
    )
    assert near < 0.1 * far


def test_sizes_halve():
    sizes = nst.sizes_of(torch.full((1, 3, 33, 20), 0.3), 3)
    assert [tuple(i.shape[2:]) for i in sizes] == [(9, 5), (17, 10), (33, 20)]
    assert all(torch.allclose(i, torch.tensor(0.3)) for i in sizes)


def test_the_real_network():
    """The weights fit the layers that are looked at."""
    try:
        convolutions = load_vgg16()
    except NoWeights as missing:
        pytest.skip(str(missing))
    with torch.no_grad():
        seen = nst.features(
            torch.from_numpy(np.full((1, 3, 32, 32), 0.5, np.float32)), convolutions
        )
    assert [len(seen[name]) for name in nst.STYLE] == [64, 128, 256, 512, 512]
