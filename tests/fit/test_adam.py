"""Adam on one cycle is torch's own."""

import pytest
import torch

from strokestyle.fit.adam import OneCycleAdam


def pulled(point):
    """The gradients of a slope with a kink."""
    ((point**4).sum() + (point - 1).abs().sum()).backward()


@pytest.mark.parametrize("steps, warm_up", [(60, 0.2), (25, 0.1), (6, 0.1), (1, 0.1)])
def test_it_steps_as_torch_does(steps, warm_up):
    rates = [0.3, 0.02]
    ours = [torch.linspace(-2, 2, 9).requires_grad_() for _ in rates]
    other = [point.detach().clone().requires_grad_() for point in ours]
    adam = OneCycleAdam(ours, rates, steps, warm_up)
    torchs = torch.optim.Adam([{"params": [point]} for point in other], lr=0.1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        torchs, rates, total_steps=steps, pct_start=warm_up
    )
    for step in range(steps):
        for point in (*ours, *other):
            pulled(point)
        adam.step()
        torchs.step()
        torchs.zero_grad()
        if step + 1 < steps:
            schedule.step()
    for a, b in zip(ours, other, strict=True):
        assert torch.equal(a, b) and a.grad is None


def test_it_goes_on_from_what_was_kept():
    ends = []
    for stop in (None, 7):
        point = torch.linspace(-2, 2, 9).requires_grad_()
        adam = OneCycleAdam([point], [0.1], 20, 0.2)
        for step in range(20):
            if step == stop:
                kept = adam.state_dict()
                adam = OneCycleAdam([point], [0.1], 20, 0.2)
                adam.load_state_dict(kept)
            pulled(point)
            adam.step()
        ends.append(point.detach())
    assert torch.equal(*ends)
