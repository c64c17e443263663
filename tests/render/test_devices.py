"""What would break on a GPU, looked for without one.

That is tensors made without saying where, and arrays taken from there.
"""

import sys
from dataclasses import replace

import pytest
import torch
from small_views import TINY, a_drawing, a_view
from torch.overrides import TorchFunctionMode

from strokestyle.fit.train import PRESETS, fit_style
from strokestyle.render.coverage import coverage
from strokestyle.render.devices import pick_device, repeatable

MAKERS = {
    torch.arange, torch.as_tensor, torch.empty, torch.eye, torch.full, torch.linspace, torch.ones,
    torch.rand, torch.randn, torch.tensor, torch.zeros,
}  # fmt: skip


class OnAnotherDevice(TorchFunctionMode):
    """Stops where strokestyle makes a tensor on the default device, or takes an array from another.

    Another device is one that is not the host.
    """

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        caller = sys._getframe(1)
        if caller.f_globals.get("__name__", "").startswith("strokestyle"):
            place = f"{caller.f_code.co_filename}:{caller.f_lineno}"
            # networks are made on the host and moved, so that a seed gives them the same start
            # everywhere
            makes = caller.f_code.co_name, caller.f_globals["__name__"]
            network = makes == ("__init__", "strokestyle.render.networks")
            if func in MAKERS and kwargs.get("device") is None and not network:
                raise AssertionError(f"{place}: a tensor is made without saying on which device")
            if func in (torch.Tensor.numpy, torch.Tensor.__array__) and not hasattr(
                args[0], "on_host"
            ):
                raise AssertionError(
                    f"{place}: an array is taken from a tensor that was not brought to the host"
                )
        out = func(*args, **kwargs)
        if func is torch.Tensor.cpu:
            out = out.clone()
            out.on_host = True
        return out


@pytest.mark.parametrize(
    "config", [replace(PRESETS["quick"], steps=4, trace_steps=4), TINY], ids=["quick", "paper"]
)
def test_a_fit_says_where_each_tensor_is(config):
    view = a_view()
    drawing = a_drawing(view)
    with OnAnotherDevice():
        style = fit_style(view, drawing, config, device="cpu", minutes=0.002)
        style.draw(view)


def test_coverage_says_where_each_tensor_is():
    xy = torch.tensor([[3.0, 4.0], [3.0, 4.0], [20.0, 9.0], [11.0, 11.0]], requires_grad=True)
    thickness = torch.tensor([3.0, 2.0, 4.0, 5.0], requires_grad=True)
    offsets, image = torch.tensor([0, 3, 4]), torch.tensor([0, 1])
    with OnAnotherDevice():
        coverage(xy, thickness, offsets, 16, 24, image, 2).sum().backward()
        coverage(xy[:0], thickness[:0], offsets[:1], 16, 24)


def test_the_watch_sees_what_it_is_for():
    def at_home(body):
        exec(
            compile(body, "made_up.py", "exec"), {"__name__": "strokestyle.made_up", "torch": torch}
        )

    for wrong in ("torch.zeros(3)", "torch.tensor([1.0], device='cpu').numpy()"):
        with OnAnotherDevice(), pytest.raises(AssertionError, match="made_up.py:1"):
            at_home(wrong)
    with OnAnotherDevice():
        at_home("torch.zeros(3, device='cpu').cpu().numpy()")


def test_a_device_that_is_not_there_is_named():
    assert pick_device("cpu") == torch.device("cpu")
    with pytest.raises(ValueError, match="auto, cpu or cuda"):
        pick_device("tpu")
    if not torch.cuda.is_available():
        assert pick_device("auto") == torch.device("cpu")
        with pytest.raises(ValueError, match="choose cpu"):
            pick_device("cuda")


def test_a_gpu_is_asked_to_repeat_itself_and_only_then(monkeypatch):
    monkeypatch.setenv("CUBLAS_WORKSPACE_CONFIG", "")
    with repeatable(torch.device("cpu")):
        assert not torch.are_deterministic_algorithms_enabled()
    with pytest.raises(KeyError), repeatable(torch.device("cuda")):
        assert (
            torch.are_deterministic_algorithms_enabled()
            and torch.is_deterministic_algorithms_warn_only_enabled()
        )
        raise KeyError
    assert not torch.are_deterministic_algorithms_enabled()
