"""Drawing needs no torch: what it computes is what the network of the fit computes."""

import numpy as np
import torch

from strokestyle.model import AdditiveNet
from strokestyle.style import SumOfCurves


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
