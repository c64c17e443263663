import pytest
import torch

from strokestyle.render.networks import (
    PatchDiscriminator,
    PathNet,
    SurfaceNet,
    TextureNet,
)


def shapes(network):
    return [tuple(p.shape) for name, p in network.named_parameters() if name.endswith("weight")]


def parameters(network):
    return sum(p.numel() for p in network.parameters())


def test_the_papers_networks_have_its_parameters():
    assert parameters(SurfaceNet()) + parameters(PathNet()) == 170_163
    assert parameters(TextureNet()) == 7_856_515
    assert parameters(PatchDiscriminator()) == 2_764_737


def test_the_papers_networks_have_its_layers_in_order():
    assert shapes(SurfaceNet()) == (
        [(10, 9, 7, 7), (20, 10, 3, 3), (40, 20, 3, 3)] + [(40, 40, 3, 3)] * 10 + [(40, 40, 1, 1)]
    )
    assert shapes(PathNet()) == [(40, 45, 3), (40, 40, 3), (3, 40, 3)]
    assert shapes(TextureNet()) == (
        [(64, 9, 7, 7), (128, 64, 3, 3), (256, 128, 3, 3)]
        + [(256, 256, 3, 3)] * 12
        + [(256, 128, 3, 3), (128, 64, 3, 3), (3, 64, 7, 7)]
    )
    assert shapes(PatchDiscriminator()) == [
        (64, 3, 4, 4), (128, 64, 4, 4), (256, 128, 4, 4), (512, 256, 4, 4), (1, 512, 4, 4)
    ]  # fmt: skip


@pytest.mark.parametrize("size", [64, 96])
def test_image_networks_keep_the_size(size):
    maps = torch.rand(2, 9, size, size + 4)
    assert SurfaceNet()(maps).shape == (2, 40, size, size + 4)
    rgb = TextureNet()(maps[:1])
    assert rgb.shape == (1, 3, size, size + 4)
    assert 0 <= rgb.min() and rgb.max() <= 1


def test_the_discriminator_sees_70_pixels():
    # without normalisation, which sees the whole image
    network = PatchDiscriminator()
    body = torch.nn.Sequential(
        *(m for m in network.body if not isinstance(m, torch.nn.InstanceNorm2d))
    )
    image = torch.zeros(1, 3, 256, 256, requires_grad=True)
    out = body(image)
    out[0, 0, 15, 15].backward()
    seen = torch.nonzero(image.grad.abs().sum((0, 1)))
    assert (seen.max(0)[0] - seen.min(0)[0] + 1).tolist() == [70, 70]


def test_paths_do_not_see_one_another():
    torch.manual_seed(0)
    network = PathNet()
    points, offsets = torch.randn(19, 45), torch.tensor([0, 2, 9, 19])
    together = network(points, offsets)
    assert together.shape == (19, 3)
    for a, b in zip(offsets[:-1], offsets[1:], strict=True):
        torch.testing.assert_close(together[a:b], network(points[a:b], torch.tensor([0, b - a])))


def test_a_path_is_a_plain_zero_padded_convolution():
    torch.manual_seed(0)
    network, x = PathNet(), torch.randn(7, 45)
    want = x.T[None]
    for i, layer in enumerate(network.layers):
        want = torch.nn.functional.conv1d(want, layer.weight, layer.bias, padding=1)
        want = want.relu() if i < 2 else want
    torch.testing.assert_close(network(x, torch.tensor([0, 7])), want[0].T)


def test_no_curves_give_no_points():
    assert PathNet()(torch.zeros(0, 45), torch.tensor([0])).shape == (0, 3)
