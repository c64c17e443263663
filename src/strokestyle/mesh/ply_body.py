"""The body of a PLY file: tables whose rows may hold lists, in text or in binary."""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np

from .text_file import CutShort, read_numbers

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_LETTERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q",
            "f4": "f", "f8": "d"}  # fmt: skip
_PLURALS = {"vertex": "vertices", "face": "faces", "tristrips": "strips"}


class Property(NamedTuple):
    """A column of an element: a number, or a list of numbers where `count_kind` is not ""."""

    name: str
    kind: str
    count_kind: str = ""


class Element(NamedTuple):
    """A table of so many rows."""

    name: str
    rows: int
    properties: list[Property]


class Lists(NamedTuple):
    """A list of numbers a row: all of them, one after the other, and how many (rows,) each has."""

    values: np.ndarray
    length: np.ndarray


class _Layout(NamedTuple):
    """Where the numbers of a row stand: some single ones, a list, some more, and so on.

    single : of each single number, how many lists stand before it, how far behind them it stands,
        and how it is written
    width : bytes of the single numbers before each list, and behind the last one
    lists : of each list, how its length and how its numbers are written
    names : of the lists
    """

    single: dict[str, tuple[int, int, np.dtype]]
    width: list[int]
    lists: list[tuple[np.dtype, np.dtype]]
    names: list[str]


class Body:
    """The rows of all elements, to be read one element after the other.

    Text is read as if it were binary, of numbers of eight bytes each.

    Parameters
    ----------
    data : bytes
    form : the format's name in the header
    line : the number of the line that the body begins in
    """

    def __init__(self, data: bytes, form: str, line: int):
        self.order = ORDERS[form]
        self.at = 0
        self.problem = ""
        if self.order:
            self.bytes = np.frombuffer(data, np.uint8)
        else:
            numbers, self.problem = read_numbers(data, line)
            self.bytes = numbers.view(np.uint8)

    def read(self, element: Element, wanted: list[str]) -> list:
        """Read the next element: its columns `wanted`, each an array (rows,) or Lists.

        Raises ValueError where the body ends before, or a list has no length.
        """
        if not element.rows or not element.properties:
            return []
        layout = self._layout(element)
        begin, count, end = self._walk(element, layout, 1)
        size = end - self.at
        there = (len(self.bytes) - self.at) // size
        if not layout.lists and there < element.rows:
            raise self._ends(element, there)
        if there >= element.rows and self._all_like_first(element.rows, layout, begin, count, size):
            found = self._even_columns(element.rows, layout, begin[0], count[0], size, wanted)
            end = self.at + size * element.rows
        else:
            begin, count, end = self._walk(element, layout, element.rows)
            found = self._uneven_columns(layout, begin, count, wanted)
        self.at = end
        return found

    def _kind(self, name: str) -> np.dtype:
        return np.dtype(self.order + name if self.order else np.float64)

    def _layout(self, element: Element) -> _Layout:
        layout = _Layout({}, [0], [], [])
        for one in element.properties:
            kind = self._kind(one.kind)
            if one.count_kind:
                layout.lists.append((self._kind(one.count_kind), kind))
                layout.names.append(one.name)
                layout.width.append(0)
            else:
                layout.single[one.name] = len(layout.lists), layout.width[-1], kind
                layout.width[-1] += kind.itemsize
        return layout

    def _walk(
        self, element: Element, layout: _Layout, rows: int
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Find the lists of the next rows: where each begins, (rows, L), and its length, (rows, L).

        Each row must be looked at to know where the next one is. Returns the end of them, too.
        """
        begin, count, at = [], [], self.at
        steps = [
            (width, struct.Struct((self.order or "=") + _letter(own)), own.itemsize, one.itemsize)
            for width, (own, one) in zip(layout.width, layout.lists, strict=False)
        ]
        data, end = self.bytes.data, len(self.bytes)
        for row in range(rows):
            for width, number, own, one in steps:
                at += width
                if at + own > end:
                    raise self._ends(element, row)
                length = number.unpack_from(data, at)[0]
                if not (length >= 0 and length % 1 == 0):
                    raise ValueError(f"{element.name} {row + 1} has a list of length {length:g}")
                begin.append(at + own)
                count.append(length)
                if length > end:  # may be too many for an integer
                    raise self._ends(element, row)
                at += own + int(length) * one
            at += layout.width[-1]
            if at > end:
                raise self._ends(element, row)
        shape = rows, len(steps)
        return np.array(begin, np.int64).reshape(shape), np.array(count, int).reshape(shape), at

    def _ends(self, element: Element, there: int) -> ValueError:
        """Make the error for a body that ends within an element."""
        if self.problem:
            return ValueError(self.problem)
        return CutShort(there, element.rows, _PLURALS.get(element.name, f"{element.name} elements"))

    def _all_like_first(
        self, rows: int, layout: _Layout, begin: np.ndarray, count: np.ndarray, size: int
    ) -> bool:
        """Tell whether all lists of so many rows have the lengths of those in the first row."""
        return all(
            (self._column(rows, start - own.itemsize, own, size) == length).all()
            for (own, _), start, length in zip(layout.lists, begin[0], count[0], strict=True)
        )

    def _column(self, rows: int, at: int, kind: np.dtype, size: int) -> np.ndarray:
        """View numbers (rows,) that stand `size` bytes apart."""
        return np.ndarray((rows,), kind, self.bytes, int(at), (size,))

    def _even_columns(
        self,
        rows: int,
        layout: _Layout,
        begin: np.ndarray,
        count: np.ndarray,
        size: int,
        wanted: list[str],
    ) -> list:
        """Take columns of rows that are all of one size."""
        behind = self._behind_lists(layout, np.array([self.at]), begin[None], count[None])
        found: list = []
        for name in wanted:
            if name in layout.single:
                lists, offset, kind = layout.single[name]
                found.append(self._column(rows, behind[lists][0] + offset, kind, size))
                continue
            i = layout.names.index(name)
            kind = layout.lists[i][1]
            shape, steps = (rows, int(count[i])), (size, kind.itemsize)
            values = np.ndarray(shape, kind, self.bytes, int(begin[i]), steps)
            found.append(Lists(values.ravel(), np.full(rows, count[i])))
        return found

    def _uneven_columns(
        self, layout: _Layout, begin: np.ndarray, count: np.ndarray, wanted: list[str]
    ) -> list:
        """Take columns of rows whose lists begin at `begin` and have `count` numbers, (rows, L)."""
        first = begin[:, 0] - layout.lists[0][0].itemsize - layout.width[0]
        behind = self._behind_lists(layout, first, begin, count)
        found: list = []
        for name in wanted:
            if name in layout.single:
                lists, offset, kind = layout.single[name]
                found.append(self._gathered(behind[lists] + offset, kind))
                continue
            i = layout.names.index(name)
            kind, length = layout.lists[i][1], count[:, i]
            number = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
            at = np.repeat(begin[:, i], length) + number * kind.itemsize
            found.append(Lists(self._gathered(at, kind), length))
        return found

    def _behind_lists(
        self, layout: _Layout, first: np.ndarray, begin: np.ndarray, count: np.ndarray
    ) -> list[np.ndarray]:
        """Find where the single numbers before all lists, behind one, two, ... begin in each row.

        `first` : (rows,) int, where the rows begin
        """
        lists = enumerate(layout.lists)
        return [first, *(begin[:, i] + count[:, i] * kind.itemsize for i, (_, kind) in lists)]

    def _gathered(self, at: np.ndarray, kind: np.dtype) -> np.ndarray:
        """Take numbers (N,) that begin at bytes `at` (N,)."""
        size = kind.itemsize
        if not (at % size).any():
            return self.bytes[: len(self.bytes) // size * size].view(kind)[at // size]
        return self.bytes[at[:, None] + np.arange(size)].view(kind).ravel()


def _letter(kind: np.dtype) -> str:
    return _LETTERS[kind.str[1:]]
