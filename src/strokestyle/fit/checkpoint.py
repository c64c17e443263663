"""Keep the state of a long fit on disk as it goes.

One that was stopped goes on from there, and ends with the same weights as one that was not.
"""

from __future__ import annotations

import hashlib
import json
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..files import read_model, write_model
from .adam import OneCycleAdam

if TYPE_CHECKING:
    import torch

    Learned = np.ndarray | torch.nn.Module | torch.Tensor
    Training = OneCycleAdam | torch.optim.Optimizer | torch.optim.lr_scheduler.LRScheduler

FORMAT = 3
DAMAGE = LookupError, ValueError, TypeError, AttributeError
WRITING = 50  # times as long as a write took is at least waited until the next one


class Checkpoint:
    """The state of one fit, in one file.

    Parameters
    ----------
    path : the file; None keeps nothing
    every : seconds between two writes; longer where writing takes more than a fiftieth of that
    resume : go on from the file where there is one; otherwise begin anew, and write over it
    """

    def __init__(self, path: str | Path | None = None, every: float = 20.0, resume: bool = False):
        self.path = None if path is None else Path(path)
        self.every, self.resume = every, resume
        self._key: dict[str, str] = {}
        self._choices: dict[str, float] = {}
        self._stages: dict[str, dict] = {}
        self._written, self._took = time.monotonic(), 0.0

    def begin(self, key: dict[str, str]) -> None:
        """Name the work, {what: value}, and read what is there of it.

        Raises ValueError, naming the file, where it is damaged or belongs to other work.
        """
        self._key, self._choices, self._stages = dict(key), {}, {}
        self._written = time.monotonic()
        if not self.resume or self.path is None or not self.path.exists():
            return
        try:
            payload = read_model(self.path)
            form, found = payload["format"], dict(payload["key"])
            choices, stages = dict(payload["choices"]), dict(payload["stages"])
        except DAMAGE:
            raise ValueError(
                f"{self.path}: a damaged checkpoint, or none at all: remove it, or start afresh"
            ) from None
        changed = [
            _difference(name, found.get(name), key[name])
            for name in key
            if found.get(name) != key[name]
        ]
        if form != FORMAT:
            changed.insert(0, "another version of strokestyle")
        if changed:
            raise ValueError(
                f"{self.path}: the checkpoint of another fit ({', '.join(changed)}): "
                "repeat what was given then, or start afresh"
            )
        self._choices, self._stages = choices, stages

    def chosen(self, name: str, choose: Callable[[], float]) -> float:
        """What an earlier part of this fit chose, or else `choose()`, kept for later parts."""
        if name not in self._choices:
            self._choices[name] = choose()
        return self._choices[name]

    def load(self, stage: str) -> dict | None:
        """The last state of a stage, or None."""
        return self._stages.get(stage)

    def save(self, stage: str, state: dict) -> None:
        """Keep a state: arrays, numbers and strings, lists of the last two, and dicts of all.

        The file is replaced whole.
        """
        if self.path is None:
            return
        start = time.monotonic()
        self._stages[stage] = state
        kept = {"key": self._key, "choices": self._choices, "stages": self._stages}
        write_model(self.path, {"format": FORMAT, **kept}, compressed=False)
        self._written = time.monotonic()
        self._took = self._written - start

    def remove(self) -> None:
        """When the model is written, this has done its work."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    @contextmanager
    def watch(
        self,
        stage: str,
        steps: int,
        learned: Mapping[str, Learned],
        training: Mapping[str, Training],
        rng: np.random.Generator | None = None,
    ) -> Iterator[tuple[Iterator[int], Callable[[], None]]]:
        """Put a stage of `steps` steps back to where it stood.

        Yields the steps still to do, and what to call after each. That call is where the state is
        kept when due. Ctrl-C and SIGTERM wait for it, and then are a KeyboardInterrupt (a second
        one does not wait), so that what is left on disk is always a state that an undisturbed fit
        passes through.

        Parameters
        ----------
        learned : arrays, modules and tensors by name
        training : optimisers and schedules by name, not needed once the stage is over
        rng : the generator that the steps draw from
        """
        state = _Stage(steps, learned, training, rng)
        known = self.load(stage)
        if known is not None:
            state.restore(known)

        def passed() -> None:
            state.step_done()
            if stop.asked:
                raise KeyboardInterrupt
            if time.monotonic() - self._written > max(self.every, WRITING * self._took):
                self.save(stage, state.kept())

        before = state.done
        with _Stop(self.path is not None) as stop:
            try:
                yield state.remaining(), passed
            except KeyboardInterrupt:
                if state.whole:
                    self.save(stage, state.kept())
                raise
        if state.done > before:
            self.save(stage, state.kept())


class _Stage:
    """How far a stage is, and what it learns; `whole` between two steps, False within one."""

    def __init__(
        self,
        steps: int,
        learned: Mapping[str, Learned],
        training: Mapping[str, Training],
        rng: np.random.Generator | None,
    ):
        self.steps, self.learned, self.training, self.rng = steps, learned, training, rng
        self.done, self.whole = 0, False

    def restore(self, known: dict) -> None:
        """Put everything back to a state that `kept` returned."""
        self.done = known["step"]
        for name, part in self.learned.items():
            _restore(part, known["learned"][name])
        if self.done < self.steps:
            for name, optimiser in self.training.items():
                state = known["training"][name]
                ours = isinstance(optimiser, OneCycleAdam)
                optimiser.load_state_dict(state if ours else _tensors(state))
        if self.rng is not None:
            self.rng.bit_generator.state = json.loads(known["rng"])

    def kept(self) -> dict:
        """The state; what only training needs is left out once the stage is over."""
        training = self.training.items() if self.done < self.steps else ()
        return {
            "step": self.done,
            "learned": {name: _state(part) for name, part in self.learned.items()},
            "training": {name: _arrays(part.state_dict()) for name, part in training},
            "rng": None if self.rng is None else json.dumps(self.rng.bit_generator.state),
        }

    def remaining(self) -> Iterator[int]:
        """The steps still to do, from 1."""
        for step in range(self.done + 1, self.steps + 1):
            self.whole = False
            yield step

    def step_done(self) -> None:
        self.done, self.whole = self.done + 1, True


class _Stop:
    """Within it the first Ctrl-C, or SIGTERM, only sets `asked`.

    Where these are not ours to change, all stays.
    """

    def __init__(self, wanted: bool):
        main = threading.current_thread() is threading.main_thread()
        plain = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
        self.before = {
            number: it
            for number, it in plain.items()
            if wanted and main and signal.getsignal(number) == it
        }
        self.asked = False

    def __enter__(self) -> _Stop:
        for number in self.before:
            signal.signal(number, self._ask)
        return self

    def __exit__(self, *error) -> None:
        for number, handler in self.before.items():
            signal.signal(number, handler)

    def _ask(self, number, frame) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


def digest(*arrays: np.ndarray) -> str:
    """The same for the same arrays, in values, types and shapes."""
    total = hashlib.sha256()
    for array in arrays:
        array = np.ascontiguousarray(array)
        total.update(f"{array.dtype.str}{array.shape}".encode())
        total.update(array.data if array.size else b"")
    return total.hexdigest()


def _difference(name: str, found: str | None, wanted: str) -> str:
    short = found is not None and max(len(found), len(wanted)) < 24
    return f"{name} {found}, not {wanted}" if short else f"another {name}"


def _state(part: Learned) -> Any:
    if isinstance(part, np.ndarray):
        return part.copy()
    return _arrays(part.state_dict() if hasattr(part, "state_dict") else part)


def _restore(part: Learned, state: Any) -> None:
    if isinstance(part, np.ndarray):
        part[...] = state
    elif hasattr(part, "state_dict"):
        cast("torch.nn.Module", part).load_state_dict(_tensors(state))
    else:
        part.data.copy_(_tensors(state))


def _arrays(state: Any) -> Any:
    """A state with arrays in place of torch's tensors, and strings of the numbers that name some.

    torch is not imported for that: where it was not, there are no tensors.
    """
    if isinstance(state, dict):
        return {str(name): _arrays(value) for name, value in state.items()}
    if isinstance(state, (list, tuple)):
        return [_arrays(value) for value in state]
    return state.detach().cpu().numpy().copy() if hasattr(state, "detach") else state


def _tensors(state: Any) -> Any:
    """What `_arrays` was made of."""
    import torch

    if isinstance(state, dict):
        return {
            int(name) if name.isdigit() else name: _tensors(value) for name, value in state.items()
        }
    return torch.from_numpy(state.copy()) if isinstance(state, np.ndarray) else state
