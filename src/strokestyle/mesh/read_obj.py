"""Read Wavefront OBJ files."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass

import numpy as np

from .messages import NotSupported, only_lines, warn
from .polygons import cut_polygons
from .text_file import one_byte_text, places, plain_decimals, word_places
from .triangles import Triangles

_SPACES = bytes.maketrans(b"\t\v\f\r", b"   \n")
_UNNAMED = {"o": (), "g": ("default",), "usemtl": ("None", "(null)")}  # what programs make up
_NO_KEYWORDS = bytes.maketrans(b"vfVF", b"    ")
_OF_CORNERS = np.isin(np.arange(256), list(b"-+/0123456789"))  # letters of corners' numbers
_SMALL = 0x20  # the bit that makes small letters of capitals


def read_obj(data: bytes) -> Triangles:
    """Read the faces of a Wavefront OBJ file, polygons cut into triangles.

    Objects (`o`) are parts. Where they make fewer than two, groups (`g`) are, and where those do,
    materials (`usemtl`). Everything that shape does not need is skipped: texture coordinates,
    normals, colours. Lines and free-form curves and surfaces are left out, and warned of. Where no
    vertex has a third coordinate, it is 0.

    Raises
    ------
    ValueError
        naming the line, where a vertex or a face cannot be read or a face names no vertex
    NotSupported
        on lines, curves or surfaces without faces, or text in UTF-16
    """
    lines = _Lines.of(one_byte_text(data))
    vertices = _read_vertices(lines)
    faces, line = _read_faces(lines, vertices)
    _tell_what_is_left_out(lines, len(faces))
    part, names = _read_parts(lines, line)
    return Triangles(vertices, faces, part, names, line)  # a polygon a line


@dataclass(frozen=True)
class _Lines:
    """The lines of a file, those that go on in the next one joined.

    Parameters
    ----------
    data : bytes, one space between words at least, line feeds at the ends of lines
    start : (L+1,) int, where each line begins in `data`, and an empty one after the last
    first : (L+1,) uint8, the first byte of each line, capitals as small letters
    spaced : (L+1,) bool, the second one is a space
    """

    data: bytes
    start: np.ndarray
    first: np.ndarray
    spaced: np.ndarray

    @classmethod
    def of(cls, data: bytes) -> _Lines:
        # one letter is sought ten times faster than two
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n")
        if any(byte in data for byte in b"\t\v\f\r"):
            data = data.translate(_SPACES)
        data = b"\n" + data + b"\n\n\n"
        if b"\\" in data:
            data = data.replace(b"\\\n", b" ")
        text, start = np.frombuffer(data, np.uint8), places(data, "\n")[:-2] + 1
        if (text[start] == ord(" ")).any():
            data = re.sub(rb"\n +", b"\n", data)
            text, start = np.frombuffer(data, np.uint8), places(data, "\n")[:-2] + 1
        return cls(data, start, text[start] | _SMALL, text[start + 1] == ord(" "))

    def have(self, keyword: str) -> np.ndarray:
        """Tell which lines begin with a keyword, in letters of either case, (L+1,) bool."""
        if len(keyword) == 1:
            return self.spaced & (self.first == ord(keyword))
        found = self.first == ord(keyword[0])
        if found.any():
            text = np.frombuffer(self.data, np.uint8)
            for i, letter in enumerate(keyword + " "):
                at = np.minimum(self.start[found] + i, len(text) - 1)
                found[found] = text[at] | _SMALL == ord(letter)
        return found

    def text(self, line: int) -> str:
        return self.data[self.start[line] : self.start[line + 1] - 1].decode("utf-8", "replace")

    def error(self, line: int, what: str) -> ValueError:
        """Make the error that says what is wrong with a line."""
        text = " ".join(self.text(line).split())
        return ValueError(f"line {line + 1}, {text[:40]!r}: {what}")

    def bodies(self, which: np.ndarray) -> bytes:
        """Join the lines `which` (rising), without keyword and comments."""
        run = np.flatnonzero(np.diff(which, prepend=-2) != 1)
        if not len(run):
            return b""
        low = self.start[which[run]].tolist()
        high = self.start[which[np.r_[run[1:], len(which)] - 1] + 1].tolist()
        bodies = b"".join([self.data[a:b] for a, b in zip(low, high, strict=True)])
        if b"#" in bodies:
            bodies = re.sub(rb"#[^\n]*", b"", bodies)
        return bodies.translate(_NO_KEYWORDS)

    def numbers(self, bodies: bytes, kind: type, which: np.ndarray) -> tuple[np.ndarray, ...]:
        """Read the numbers in bodies of lines `which` (M,): all, and how many (M,) each holds."""
        (first, behind), last = word_places(bodies), places(bodies, "\n")
        dtype = np.int64 if kind is int else np.float64
        count = _words_of_lines(first, last)
        if not len(first):  # numpy makes one number of an empty text
            return np.zeros(0, dtype), count
        plain = plain_decimals(bodies, first, behind) if kind is float else None
        if plain is not None:
            return plain, count
        with warnings.catch_warnings():
            # at a word that is no number some versions of numpy stop and warn, others raise
            warnings.simplefilter("ignore")
            try:
                values = np.fromstring(bodies, dtype, sep=" ")
            except ValueError:
                values = np.zeros(0, dtype)
        if len(values) != len(first):
            words = enumerate(bodies.split())
            bad = next((i for i, word in words if not _reads_as(kind, word)), len(first) - 1)
            at = which[np.searchsorted(np.cumsum(count), bad, side="right")]
            raise self.error(int(at), "not a number")
        return values, count


def _words_of_lines(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Count the words, that begin at `first` (N,), of lines that end at `last` (M,): (M,)."""
    if len(first) == 3 * len(last) and len(last):
        own = first.reshape(-1, 3)
        if (own[:, 2] < last).all() and (own[1:, 0] > last[:-1]).all():  # as a rule
            return np.full(len(last), 3)
    return np.diff(np.searchsorted(first, last), prepend=0)


def _reads_as(kind: type, word: bytes) -> bool:
    try:
        kind(word)
    except ValueError:
        return False
    return True


def _read_vertices(lines: _Lines) -> np.ndarray:
    """Read the vertices (V, 3) float64; weights and colours behind the coordinates are dropped."""
    which = np.flatnonzero(lines.have("v"))
    values, count = lines.numbers(lines.bodies(which), float, which)
    if len(count) and (count == 2).all():  # a drawing in the plane
        return np.pad(values.reshape(-1, 2), ((0, 0), (0, 1)))
    if (count < 3).any():
        raise lines.error(int(which[np.argmax(count < 3)]), "a vertex has three coordinates")
    if (count == 3).all():
        return values.reshape(-1, 3)
    begin = np.cumsum(count) - count
    return values[begin[:, None] + np.arange(3)]


def _read_faces(lines: _Lines, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Read the polygons over vertices (V, 3), cut into triangles.

    Returns faces (F, 3) int64, and the line (F,) int of each.
    """
    which = np.flatnonzero(lines.have("f"))
    bodies = lines.bodies(which)
    if b"/" in bodies:
        bodies = _without_slashes(bodies)
    corner, count = lines.numbers(bodies, int, which)
    line = np.repeat(which, count)
    back = corner < 0
    corner -= 1
    if back.any():  # of the vertices before the face: -1 is the last
        corner[back] += 1 + np.cumsum(lines.have("v"))[line[back]]
    lost = (corner < 0) | (corner >= len(vertices))
    if lost.any():
        what = f"it names a vertex that does not exist: there are {len(vertices)}, from 1"
        raise lines.error(int(line[np.argmax(lost)]), what)
    faces, polygon = cut_polygons(vertices, corner, count)
    return faces, which[polygon]


def _without_slashes(bodies: bytes) -> bytes:
    """Blank what follows slashes in the words of faces, numbers of texture coordinates and normals.

    Where anything else follows one, it stays, to be told of.
    """
    text = np.frombuffer(bodies, np.uint8)
    turn = np.flatnonzero((text <= ord(" ")) | (text == ord("/")))
    behind = text[turn[0] :].copy()
    blank = np.repeat(text[turn] == ord("/"), np.diff(turn, append=len(text)))
    if not _OF_CORNERS[behind[blank]].all():
        return re.sub(rb"/[-+/0-9]*", b"", bodies)
    behind[blank] = ord(" ")
    return bodies[: turn[0]] + behind.tobytes()


def _tell_what_is_left_out(lines: _Lines, faces: int) -> None:
    """Warn of lines, curves and surfaces; raise NotSupported where there is nothing else."""
    straight = int(lines.have("l").sum())
    curves, surfaces = (int(lines.have(word).sum()) for word in ("curv", "surf"))
    found = ((straight, "line"), (curves, "free-form curve"), (surfaces, "free-form surface"))
    what = ", ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in found if count)
    if faces and what:
        warn(f"left out: {what}; only faces are drawn")
    elif curves or surfaces:
        raise NotSupported(f"no faces in it ({what}): export it as a mesh")
    elif straight and not faces:
        raise only_lines(straight)


def _read_parts(lines: _Lines, line: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Read the parts of faces in lines `line` (F,): by objects, groups or materials.

    Returns part (F,) int64, index into the second result, the parts' names. Of one part only, the
    name is that of the object, else of the group, else of the material.
    """
    ways = [_parts_by(keyword, lines, line) for keyword in ("o", "g", "usemtl")]
    several = (way for way in ways if len(way[1]) > 1)
    named = (way for way in ways if any(way[1]))
    return next(several, next(named, ways[0]))


def _parts_by(keyword: str, lines: _Lines, line: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Read the parts that lines of a keyword open: what `_read_parts` returns."""
    opens = lines.have(keyword)
    if not opens.any():
        return np.zeros(len(line), np.int64), ("",) * (len(line) > 0)
    names = [""]
    for at in np.flatnonzero(opens).tolist():
        name = " ".join(lines.text(at)[len(keyword) + 1 :].split())
        names.append("" if name in _UNNAMED[keyword] else name)
    number = {name: i for i, name in enumerate(names)}  # those of one name are one part
    of_opening = np.array([number[name] for name in names])
    present, part = np.unique(of_opening[np.cumsum(opens)[line]], return_inverse=True)
    return part.ravel(), tuple(names[i] for i in present)
