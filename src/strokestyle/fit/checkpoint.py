"""Keep the state of a long fit on disk as it goes.

One that was stopped goes on from there, and ends with the same weights as one that was not.
"""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import signal
import threading
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch

from ..files import write_bytes
from .adam import OneCycleAdam

FORMAT = 2
# what torch.load and the reading of what it returns raise on files that are no checkpoints
DAMAGE = (
    RuntimeError, pickle.UnpicklingError, EOFError, LookupError, ValueError, TypeError,
    AttributeError, OverflowError, zipfile.BadZipFile,
)  # fmt: skip
WRITING = 50  # times as long as a write took is at least waited until the next one

Learned = torch.nn.Module | torch.Tensor
Training = torch.optim.Optimizer | torch.optim.lr_scheduler.LRScheduler | OneCycleAdam


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
        data = self.path.read_bytes()
        try:
            payload = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
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
        """Keep a state: tensors, numbers, strings, and dicts and lists of them.

        The file is replaced whole.
        """
        if self.path is None:
            return
        start = time.monotonic()
        self._stages[stage] = state
        buffer = io.BytesIO()
        torch.save(
            {"format": FORMAT, "key": self._key, "choices": self._choices, "stages": self._stages},
            buffer,
        )
        write_bytes(self.path, buffer.getvalue())
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
        learned : modules and tensors by name
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
                optimiser.load_state_dict(known["training"][name])
        if self.rng is not None:
            self.rng.bit_generator.state = json.loads(known["rng"])

    def kept(self) -> dict:
        """The state; what only training needs is left out once the stage is over."""
        training = self.training.items() if self.done < self.steps else ()
        return {
            "step": self.done,
            "learned": {name: _state(part) for name, part in self.learned.items()},
            "training": {name: part.state_dict() for name, part in training},
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


def _state(part: Learned) -> torch.Tensor | dict:
    return part.detach() if isinstance(part, torch.Tensor) else part.state_dict()


def _restore(part: Learned, state) -> None:
    if isinstance(part, torch.Tensor):
        part.data.copy_(state)
    else:
        part.load_state_dict(state)
