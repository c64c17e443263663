"""The file that one of another thickness was made of, kept in it, so that back is what there was.

A texture that is read off images, or off tones, and drawn anew is softer each time. So a file whose
thickness was changed holds the one that it comes from, and the next thickness is made of that.
"""

from __future__ import annotations

import base64
import hashlib
import re
import zlib
from typing import NamedTuple

import numpy as np

from .. import files as limits
from ..files import limited
from .format import Data

# a factor nearer to 1 than this is meant to be 1: 1.5 and .67 make 1.005
BACK = 0.006
MAX_KEPT = 9_000_000  # characters: libxml2, as other programs use it, reads no more than 10 million
FACTORS = (1e-3, 1e3)  # by which a file may be thicker than its original
_ROOT = re.compile(rb"<svg(?=\s)")
_KEPT = re.compile(rb' %s="([0-9.e+,-]+) ([0-9a-f]{32}) ([\w+/]+=*)"' % Data.WAS.encode())


class Original(NamedTuple):
    """A file, and by what another has its thicknesses multiplied.

    `factor` is (1,), of all its strokes, or (C,), of each.
    """

    data: bytes
    factor: np.ndarray

    def times(self, factor: np.ndarray) -> np.ndarray | None:
        """Multiply by further factors (C,), to (C,); what is meant to be 1 is.

        None where they are of another number of strokes, or one would be out of range.
        """
        if len(self.factor) not in (1, len(factor)):
            return None
        made = self.factor * factor
        made = np.where(np.abs(made - 1.0) <= BACK, 1.0, made)
        return made if _are_possible(made) else None


def keep_original(text: str, original: Original) -> str:
    """Put a file into that which was made of it; the text as it is where it would be too large."""
    data, was = text.encode("utf-8"), _KEPT.sub(b"", limited(original.data), count=1)
    root = _ROOT.search(data)
    if root is None or len(was) > limits.MAX_TEXT or not _are_possible(original.factor):
        return text
    each = original.factor[:1] if np.ptp(original.factor) == 0 else original.factor
    factors = ",".join(map(repr, each.tolist()))
    packed = base64.b64encode(zlib.compress(was)).decode("ascii")
    kept = f' {Data.WAS}="{factors} {_digest(data)} {packed}"'.encode("ascii")
    if len(kept) > MAX_KEPT or len(data) + len(kept) > limits.MAX_BYTES:
        return text
    return (data[: root.end()] + kept + data[root.end() :]).decode("utf-8")


def original_of(data: bytes) -> Original | None:
    """Take the original out of a file; None where there is none, or the file was changed since.

    Raises ValueError where the file is too large.
    """
    data = limited(data)
    found = _KEPT.search(data)
    if found is None or _digest(data[: found.start()] + data[found.end() :]) != found[2].decode():
        return None
    try:
        unpack = zlib.decompressobj()
        was = unpack.decompress(base64.b64decode(found[3], validate=True), limits.MAX_TEXT + 1)
        factor = np.array(found[1].split(b","), np.float64)
    except (ValueError, zlib.error):
        return None
    if not (unpack.eof and len(was) <= limits.MAX_TEXT and _are_possible(factor)):
        return None
    return Original(was, factor)


def _are_possible(factor: np.ndarray) -> bool:
    return len(factor) > 0 and bool(FACTORS[0] <= factor.min() <= factor.max() <= FACTORS[1])


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:32]
