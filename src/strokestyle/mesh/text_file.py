"""Text of mesh files: its encoding, and the numbers in it."""

from __future__ import annotations

import re
import warnings
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from .messages import NotSupported

_ENDS = {expat.errors.codes[name] for name in (expat.errors.XML_ERROR_NO_ELEMENTS,
         expat.errors.XML_ERROR_UNCLOSED_TOKEN, expat.errors.XML_ERROR_PARTIAL_CHAR,
         expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION)}  # fmt: skip
_MARK = b"\xef\xbb\xbf"  # of UTF-8, at the beginning
_SAMPLE = 512  # bytes that tell an encoding without a mark
_ZEROS = 0.1  # share of zeros, at least, in one half of wide letters
PIECE = 1 << 18  # letters that are looked at in one go: they stay in the processor's cache
DIGITS = 15  # that a whole number has at most, for all to be exact as float64
_MORE = 8  # times as many zeros as in the other half


class CutShort(ValueError):
    """A file ends before all that it says it holds; says how much is there."""

    def __init__(self, there: int, said: int, what: str):
        super().__init__(f"cut short: {there} of its {said} {what} are there")


def xml_problem(error: expat.ExpatError | ElementTree.ParseError) -> ValueError:
    """Make the error for XML that cannot be read, or that ends before its elements do."""
    what = "cut short: its XML ends too early" if error.code in _ENDS else "its XML cannot be read"
    return ValueError(f"{what} ({error})")


def one_byte_text(data: bytes) -> bytes:
    """Take the mark of UTF-8 off text. Raises NotSupported where it is in UTF-16 or UTF-32."""
    if data.startswith(_MARK):
        return data[len(_MARK) :]
    marked = data.startswith((b"\xff\xfe", b"\xfe\xff", b"\0\0\xfe\xff"))
    if marked or _is_utf16(data[:_SAMPLE]) or _is_utf32(data[:_SAMPLE]):
        raise NotSupported("its text is in UTF-16 or UTF-32: save it as plain text, in UTF-8")
    return data


def _is_utf16(start: bytes) -> bool:
    """Tell wide letters without a mark by zeros in one half of them, some being of other scripts.

    Binary files have zeros in either half.
    """
    low, high = (start[i::2] for i in (0, 1))
    few, many = sorted((low.count(0), high.count(0)))
    return many > 1 and many >= max(_ZEROS * len(high), _MORE * few)


def _is_utf32(start: bytes) -> bool:
    """Tell letters of four bytes without a mark: one that is not zero, three that are."""
    columns = [start[i::4] for i in range(4)]
    letters = [all(column) for column in columns]
    return len(start) >= 8 and sum(letters) == 1 and sum(map(any, columns)) == 1


def read_numbers(text: bytes, line: int = 1) -> tuple[np.ndarray, str]:
    """Read the numbers (N,) float64 of a text up to the first word that is none, if there is one.

    Returns them, and "" or what that word is: "line 7: 'x' is not a number".
    `line` : the number of the text's first line
    """
    if not text.strip():
        return np.zeros(0), ""  # numpy makes one number of an empty text
    values, stopped = _parse(text)
    if not stopped:
        return values, ""
    for word in re.finditer(rb"\S+", text):
        if not _is_number(word[0]):
            line += len(re.findall(rb"\r\n|\r|\n", text[: word.start()]))
            what = f"line {line}: {word[0][:20].decode('utf-8', 'replace')!r} is not a number"
            return read_numbers(text[: word.start()])[0], what
    return values, "numbers that cannot be read"


def places(text: bytes, letter: str) -> np.ndarray:
    """Find where a letter stands in a text: ascending, int64."""
    code, data = ord(letter), np.frombuffer(text, np.uint8)
    found = [np.flatnonzero(data[a : a + PIECE] == code) + a for a in range(0, len(data), PIECE)]
    return np.concatenate([np.zeros(0, np.int64), *found])


def word_places(text: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Find where the words of a text begin, and where they have ended: (N,) int64 each."""
    data, found = np.frombuffer(text, np.uint8), [np.zeros(0, np.int64)]
    for start in range(0, len(data), PIECE):
        word = data[max(start - 1, 0) : start + PIECE] > ord(" ")
        if not start:
            word = np.concatenate([[False], word])
        found.append(np.flatnonzero(word[1:] != word[:-1]) + start)
    if len(data) and data[-1] > ord(" "):
        found.append(np.array([len(data)]))
    change = np.concatenate(found)
    return change[::2], change[1::2]


def plain_decimals(text: bytes, first: np.ndarray, behind: np.ndarray) -> np.ndarray | None:
    """Read the numbers (N,) float64 of a text in which none has an exponent.

    To the last digit, in half of the time that numpy takes: each is a whole number and a power of
    ten, both exact as float64, so that their quotient is rounded but once (Clinger 1990). -0.0 is
    read as 0.0. None where anything else is in the text, or a number of more than DIGITS digits.

    `first`, `behind` : its `word_places`
    """
    point = places(text, ".")
    if not len(first) or (behind - first).max() > DIGITS + 1:
        return None
    every = len(point) == len(first)
    of = np.arange(len(first)) if every else np.searchsorted(behind, point, "right")
    if (point < first[of]).any() or (point >= behind[of]).any() or (of[1:] == of[:-1]).any():
        return None  # some with several points
    signs = np.frombuffer(b"+-", np.uint8)[:, None]
    after = np.frombuffer(text, np.uint8).take(point + 1, mode="clip")
    if (after == signs).any() or not text[first[-1] : behind[-1]].strip(b"+-."):
        return None  # .-5 would be -.05, and numpy takes a sign that ends the text for 0
    digits = np.zeros(len(first), np.int64)  # behind the point
    digits[of] = behind[of] - point - 1
    with warnings.catch_warnings():
        # at a word that is no number some versions of numpy stop and warn, others raise
        warnings.simplefilter("ignore")
        try:
            whole = np.fromstring(text.translate(None, b"."), np.int64, sep=" ")
        except ValueError:
            return None
    if len(whole) != len(first):
        return None
    return whole / (10.0 ** np.arange(DIGITS + 1)).take(digits)


def _parse(text: bytes) -> tuple[np.ndarray, bool]:
    """Read numbers (N,), and tell whether that stopped before the end."""
    plain = plain_decimals(text, *word_places(text))
    if plain is not None:
        return plain, False
    with warnings.catch_warnings(record=True) as found:
        # at a word that is no number some versions of numpy stop and warn, others raise
        warnings.simplefilter("always")
        try:
            return np.fromstring(text, np.float64, sep=" "), bool(found)
        except ValueError:
            return np.zeros(0), True


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return not _parse(word)[1]  # numpy reads more, such as nan(ind)
    return b"_" not in word  # and Python more than numpy
