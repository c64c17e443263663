"""What a long fit leaves on disk as it goes, so that one that was stopped goes on and ends with the same weights."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import signal
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch

from ..files import write_bytes

FORMAT = 2


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
        except (
            RuntimeError, pickle.UnpicklingError, EOFError, LookupError, ValueError, TypeError, AttributeError,
            OverflowError, zipfile.BadZipFile,
        ):  # fmt: skip
            raise ValueError(
                f"{self.path}: a damaged checkpoint, or none at all: remove it, or start afresh without --resume"
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
                "repeat what was given then, or start afresh without --resume"
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
        """Keep a state: tensors, numbers, strings, and dicts and lists of them. The file is replaced whole."""
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
        learned: dict,
        training: dict,
        rng: np.random.Generator | None = None,
    ) -> Iterator[tuple[Iterator[int], Callable[[], None]]]:
        """A stage of `steps` steps, put back to where it stood: the steps still to do, and what to call after each.

        That call is where the state is kept when due. Ctrl-C and SIGTERM wait for it, and then are a KeyboardInterrupt
        (a second one does not wait), so that what is left on disk is always a state that an undisturbed fit passes
        through.

        Parameters
        ----------
        learned : modules and tensors by name
        training : optimisers and schedules by name, not needed once the stage is over
        rng : the generator that the steps draw from
        """
        known = self.load(stage)
        done = 0
        if known is not None:
            done = known["step"]
            for name, part in learned.items():
                _restore(part, known["learned"][name])
            for name, part in training.items() if done < steps else ():
                part.load_state_dict(known["training"][name])
            if rng is not None:
                rng.bit_generator.state = json.loads(known["rng"])

        def keep() -> None:
            state = {
                "step": done,
                "learned": {name: _state(part) for name, part in learned.items()},
            }
            state["training"] = (
                {name: part.state_dict() for name, part in training.items()} if done < steps else {}
            )
            state["rng"] = None if rng is None else json.dumps(rng.bit_generator.state)
            self.save(stage, state)

        def remaining() -> Iterator[int]:
            nonlocal whole
            for step in range(done + 1, steps + 1):
                whole = False
                yield step

        def passed() -> None:
            nonlocal done, whole
            done, whole = done + 1, True
            if stop.asked:
                raise KeyboardInterrupt
            if time.monotonic() - self._written > max(self.every, 50 * self._took):
                keep()

        before, whole = done, False
        with _Stop(self.path is not None) as stop:
            try:
                yield remaining(), passed
            except KeyboardInterrupt:
                if whole:
                    keep()
                raise
        if done > before:
            keep()


class _Stop:
    """Within it the first Ctrl-C, or SIGTERM, only sets `asked`; where these are not ours to change, all stays."""

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


def _state(part):
    return part.detach() if isinstance(part, torch.Tensor) else part.state_dict()


def _restore(part, state) -> None:
    if isinstance(part, torch.Tensor):
        part.data.copy_(state)
    else:
        part.load_state_dict(state)
