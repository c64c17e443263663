"""Adam on one cycle is torch's own."""

import numpy as np
import pytest
import torch

from strokestyle.fit.adam import OneCycleAdam


def slope(point):
    """Of a curve with a kink."""
    return 4 * point**3 + np.sign(point - 1)


@pytest.mark.parametrize("steps, warm_up", [(60, 0.2), (25, 0.1), (6, 0.1), (1, 0.1)])
def test_it_steps_as_torch_does(steps, warm_up):
    rates = [0.3, 0.02]
    ours = [np.linspace(-2, 2, 9) for _ in rates]
    other = [torch.tensor(point) for point in ours]
    adam = OneCycleAdam(ours, rates, steps, warm_up)
    torchs = torch.optim.Adam([{"params": [point]} for point in other], lr=0.1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        torchs, rates, total_steps=steps, pct_start=warm_up
    )
    for step in range(steps):
        adam.step([slope(point) for point in ours])
        for point in other:
            point.grad = torch.tensor(slope(point.numpy()))
        torchs.step()
        if step + 1 < steps:
            schedule.step()
    for a, b in zip(ours, other, strict=True):
        assert a == pytest.approx(b.numpy(), abs=1e-9)


def test_it_goes_on_from_what_was_kept():
    ends = []
    for stop in (None, 7):
        point = np.linspace(-2, 2, 9)
        adam = OneCycleAdam([point], [0.1], 20, 0.2)
        for step in range(20):
            if step == stop:
                kept = adam.state_dict()
                adam = OneCycleAdam([point], [0.1], 20, 0.2)
                adam.load_state_dict(kept)
            adam.step([slope(point)])
        ends.append(point)
    assert np.array_equal(*ends)
