"""Drawing needs no torch: what it computes is what the network of the fit computes."""

from dataclasses import fields

import numpy as np
import pytest
import torch

from strokestyle.model import AdditiveNet
from strokestyle.model_file import read_model, write_model
from strokestyle.style import FEATURES, Style, StyleConfig, SumOfCurves, load_style, save_style
from strokestyle.texture import TextureBank


def test_a_sum_of_curves_is_the_network_that_was_trained():
    torch.manual_seed(0)
    network = AdditiveNet(5, 8)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter)
    points = np.random.default_rng(0).normal(size=(40, 5))
    ours = SumOfCurves(**{name: value.numpy() for name, value in network.state_dict().items()})
    with torch.no_grad():
        theirs = network(torch.tensor(points, dtype=torch.float32)).numpy()
    np.testing.assert_allclose(ours(points), theirs, atol=2e-5)


def test_a_model_without_a_part_of_its_texture_is_refused(tmp_path):
    count, path = len(FEATURES), tmp_path / "model.pt"
    network = {name: value.numpy() for name, value in AdditiveNet(count, 8).state_dict().items()}
    bank = TextureBank(**{f.name: np.zeros(1, np.float32) for f in fields(TextureBank)})
    each = np.zeros(count)
    save_style(path, Style(StyleConfig(), SumOfCurves(**network), np.zeros(8), each, each, each, each, bank=bank))
    assert load_style(path).bank is not None
    stored = read_model(path)
    del stored["texture"]["look"]
    write_model(path, stored)
    with pytest.raises(ValueError, match="model.pt.*look"):
        load_style(path)
