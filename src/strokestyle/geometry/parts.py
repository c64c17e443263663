"""The named parts of a shape, and which of them points of curves, and then strokes, belong to."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

import numpy as np

from .curves import counting, owner, runs

MAX_NAME = 100  # characters
# px that a line runs on a part before it is cut there; a shorter stretch goes with its neighbours
MIN_PIECE = 24.0
_UNFIT = re.compile("[\x00-\x1f\ud800-\udfff\ufffe\uffff]")  # what XML 1.0 cannot hold


@dataclass(frozen=True)
class Parts:
    """Which named part each of n things belongs to.

    Parameters
    ----------
    names : the parts, from the one painted first, the farthest, to the one painted last; each as
        `part_name` gives it, none twice, none empty
    index : (n,) int32, into names; -1: of no named part

    Raises
    ------
    ValueError
        on a name that is empty, repeated or not as `part_name` gives it, or an index that names
        no part.
    """

    names: tuple[str, ...]
    index: np.ndarray

    def __post_init__(self) -> None:
        names, index = tuple(map(str, self.names)), np.asarray(self.index, np.int32)
        if len(set(names)) != len(names) or any(
            not name or name != part_name(name) for name in names
        ):
            raise ValueError(
                "Parts.names must be different, not empty and without control characters"
            )
        if index.ndim != 1 or (len(index) and not (-1 <= index.min() and index.max() < len(names))):
            raise ValueError(f"Parts.index must have shape (n,) and lie in -1..{len(names) - 1}")
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "index", index)

    @classmethod
    def of_names(cls, each: list[str], order: tuple[str, ...] = ()) -> Parts | None:
        """Sort things by the names of their parts; None where all are of none.

        Names alike, or alike as `part_name` has them, are one part.

        Parameters
        ----------
        each : the name of each thing's part, "" for none
        order : names in the order that they shall have; those that are not in it come behind them
        """
        given = {name: part_name(name) for name in dict.fromkeys([*order, *each])}
        used = {given[name] for name in each} - {""}
        names = [name for name in dict.fromkeys(given.values()) if name in used]
        number = {name: i for i, name in enumerate(names)} | {"": -1}
        index = np.array([number[given[name]] for name in each], np.int32)
        return cls(tuple(names), index) if names else None

    def __len__(self) -> int:
        return len(self.index)

    def name(self, i: int) -> str:
        """Name the part of thing i, "" for none."""
        return self.names[self.index[i]] if self.index[i] >= 0 else ""

    def take(self, rows: np.ndarray) -> Parts:
        """Select the things of an index or mask, in that order."""
        return Parts(self.names, self.index[rows])

    def vote(self, offsets: np.ndarray) -> Parts:
        """Find the part of each piece of things: the one that most of them are of.

        `offsets` : (P+1,) int, piece i is things offsets[i]:offsets[i+1], at least one
        """
        count = len(self.names) + 1
        pair, votes = np.unique(owner(offsets) * count + self.index + 1, return_counts=True)
        piece, part = np.divmod(pair, count)
        order = np.lexsort((part, -votes, piece))
        return Parts(self.names, part[order[runs(piece)[:-1]]] - 1)

    def cut(self, offsets: np.ndarray, along: np.ndarray, least: float = MIN_PIECE) -> Pieces:
        """Cut lines where they run from one part into another, `least` px or more in either.

        Parameters
        ----------
        offsets : (C+1,) int, of the lines whose points these things are
        along : (n,) px along the line, rising; by how much, not from where, is what counts
        """
        line = owner(offsets)
        run = runs(self.index, line)
        start, end = run[:-1], run[1:]
        long = np.flatnonzero(along[end - 1] - along[start] >= least)
        a, b = long[:-1], long[1:]
        meet = (line[start[a]] == line[start[b]]) & (self.index[start[a]] != self.index[start[b]])
        cuts = (end[a[meet]] + start[b[meet]]) // 2
        begin = np.sort(np.r_[offsets[:-1], cuts])
        stop = np.r_[begin[1:], len(line)][: len(begin)]
        count = stop + np.isin(stop, cuts) - begin  # a point at a cut is of both pieces
        new = np.r_[0, np.cumsum(count)]
        rows = counting(count) + np.repeat(begin, count)
        return Pieces(rows, new, line[begin], self.take(rows).vote(new))


@dataclass(frozen=True)
class Pieces:
    """What lines are cut into.

    rows : (M,) int, the points of the pieces, one piece after the other
    offsets : (P+1,) int, of the pieces
    line : (P,) int, the line that each is of
    parts : the part that each is of
    """

    rows: np.ndarray
    offsets: np.ndarray
    line: np.ndarray
    parts: Parts

    @property
    def whole(self) -> np.ndarray:
        """(P,) bool, a line that was not cut."""
        return np.bincount(self.line)[self.line] == 1 if len(self.line) else np.zeros(0, bool)


def part_name(text: str) -> str:
    """Make a part's name as drawings and files have it: one line that XML can hold.

    One of more than MAX_NAME characters is cut and ends in a digest of the whole, so that names
    that differ go on to do so.
    """
    name = " ".join(_UNFIT.sub("", " ".join(text.split())).split())
    if len(name) <= MAX_NAME:
        return name
    return (
        name[: MAX_NAME - 9].rstrip()
        + "~"
        + hashlib.blake2b(name.encode(), digest_size=4).hexdigest()
    )
