"""What became of one shape of a batch: a line of its journal, and of `--json`."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

# Why a shape was not drawn: it cannot be; more memory or time than it was given; its worker died.
FAILURES = ("error", "memory", "timeout", "killed")
MOST = 2**53  # of any figure: whole numbers to there are exact for every reader of JSON


class Drawn(NamedTuple):
    """What was made of a shape.

    Parameters
    ----------
    told : what the person reads of it
    files : all that was written
    lines, strokes : how many were drawn, of all sides
    """

    told: str
    files: list[str]
    lines: int
    strokes: int


@dataclass(frozen=True)
class Outcome:
    """What became of one shape.

    Parameters
    ----------
    shape : its file, as the command line has it
    output : where its drawing goes, likewise
    files : all that was written, likewise: drawing, preview, stages; none where it failed
    seconds, cpu_seconds : how long that took, by the clock and by the processor
    lines : how many lines were drawn, of all sides
    strokes : how many strokes they became
    warnings : what it was drawn without, a line each
    error : why it could not be drawn, in one line; None where it was
    failure : which of FAILURES that is; None where it was drawn
    attempts : how often it was begun: more than once where workers died over it
    memory_mb : the most memory, MB, that its worker had resident by the time that it was done; None
        where the system does not tell
    worker : which worker drew it; "" where the batch has none
    key : digest of all that decides the drawing's bytes: version, model, options, the shape's
        content; "" where the shape could not be read
    digest : digest of the content of `files`
    told : what the person reads of it, a line each, and how much the person must want to hear for
        it (-1 with -q too, 1 with -v); no part of the journal

    Raises
    ------
    ValueError
        where `failure` is none of FAILURES, or stands without an error.
    """

    shape: str
    output: str
    files: tuple[str, ...] = ()
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    lines: int = 0
    strokes: int = 0
    warnings: tuple[str, ...] = ()
    error: str | None = None
    failure: str | None = None
    attempts: int = 1
    memory_mb: float | None = None
    worker: str = ""
    key: str = ""
    digest: str = ""
    told: tuple[tuple[int, str], ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if (self.failure is None) != (self.error is None):
            raise ValueError("Outcome.failure and Outcome.error go together")
        if self.failure is not None and self.failure not in FAILURES:
            raise ValueError(f"Outcome.failure must be one of {FAILURES}, got {self.failure!r}")

    @property
    def drawn(self) -> bool:
        """Whether the shape was drawn."""
        return self.error is None

    def to_json(self, folder: str = "") -> str:
        """Write it as one line of JSON, without its line end.

        `folder` : where given, `output` and `files` stand relative to it, so that the folder of a
            batch may be moved together with its journal
        """
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "told"}
        if folder:
            values["output"] = _relative(self.output, folder)
            values["files"] = [_relative(file, folder) for file in self.files]
        for name in ("seconds", "cpu_seconds", "memory_mb"):
            values[name] = None if values[name] is None else round(values[name], 3)
        return json.dumps(values, allow_nan=False)

    @classmethod
    def from_json(cls, line: str | bytes, folder: str = "") -> Outcome:
        """Read what `to_json` wrote; fields that a later version added are passed over.

        `folder` : as `to_json` took it: `output` and `files` are joined to it

        Raises ValueError where the line is no outcome: cut short, or of another program.
        """
        known = {one.name for one in fields(cls)} - {"told"}
        try:
            values: dict[str, Any] = {k: v for k, v in json.loads(line).items() if k in known}
            for name in ("files", "warnings"):
                if not isinstance(values.setdefault(name, []), list):
                    raise TypeError
                values[name] = tuple(values[name])
            outcome = cls(**values)
            if not outcome._is_written():
                raise TypeError
            return outcome._joined(folder) if folder else outcome
        except (TypeError, AttributeError, ValueError, RecursionError):
            raise ValueError("no line of a batch's journal") from None

    def _is_written(self) -> bool:
        """Whether these are values that `to_json` writes: a journal comes from anywhere."""
        texts = [self.shape, self.output, self.worker, self.key, self.digest, *self.warnings]
        texts += [*self.files, self.error or "", self.failure or ""]
        counts = (self.lines, self.strokes, self.attempts)
        memory = 0.0 if self.memory_mb is None else self.memory_mb
        measures = (self.seconds, self.cpu_seconds, memory)
        return (
            all(type(one) is str for one in texts)
            and not any("\0" in name for name in (self.shape, self.output, *self.files))
            and all(type(one) is int and 0 <= one < MOST for one in counts)
            and all(type(one) in (int, float) and 0 <= one < MOST for one in measures)
        )

    def _joined(self, folder: str) -> Outcome:
        files = tuple(os.path.normpath(os.path.join(folder, file)) for file in self.files)
        output = os.path.normpath(os.path.join(folder, self.output))
        return replace(self, output=output, files=files)


def _relative(path: str, folder: str) -> str:
    try:
        return os.path.relpath(path, folder)
    except ValueError:  # on another drive
        return os.path.abspath(path)
