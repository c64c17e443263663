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

from .. import files as limits
from ..files import limited
from .format import Data

# a factor nearer to 1 than this is meant to be 1: 1.5 and .67 make 1.005
BACK = 0.006
MAX_KEPT = 9_000_000  # characters: libxml2, as other programs use it, reads no more than 10 million
FACTORS = (1e-3, 1e3)  # by which a file may be thicker than its original
_ROOT = re.compile(rb"<svg(?=\s)")
_KEPT = re.compile(rb' %s="([0-9.e+-]{1,30}) ([0-9a-f]{32}) ([\w+/]+=*)"' % Data.WAS.encode())


class Original(NamedTuple):
    """A file, and the factor by which another has all its thicknesses."""

    data: bytes
    factor: float


def keep_original(text: str, original: Original) -> str:
    """Put a file into that which was made of it; the text as it is where it would be too large."""
    data, was = text.encode("utf-8"), _KEPT.sub(b"", limited(original.data), count=1)
    root = _ROOT.search(data)
    if root is None or len(was) > limits.MAX_TEXT or not _is_possible(original.factor):
        return text
    packed = base64.b64encode(zlib.compress(was)).decode("ascii")
    kept = f' {Data.WAS}="{original.factor!r} {_digest(data)} {packed}"'.encode("ascii")
    if len(kept) > MAX_KEPT or len(data) + len(kept) > limits.MAX_BYTES:
        return text
    return (data[: root.end()] + kept + data[root.end() :]).decode("utf-8")


def original_of(data: bytes, factor: float = 1.0) -> Original | None:
    """Take the original out of a file, whose thicknesses are to be multiplied by `factor` besides.

    None where there is none, or the file was changed since; or where both factors together would be
    out of range. Raises ValueError where the file is too large.
    """
    data = limited(data)
    found = _KEPT.search(data)
    if found is None or _digest(data[: found.start()] + data[found.end() :]) != found[2].decode():
        return None
    try:
        unpack = zlib.decompressobj()
        was = unpack.decompress(base64.b64decode(found[3], validate=True), limits.MAX_TEXT + 1)
        factor *= float(found[1])
    except (ValueError, zlib.error):
        return None
    if not (unpack.eof and len(was) <= limits.MAX_TEXT and _is_possible(factor)):
        return None
    return Original(was, 1.0 if abs(factor - 1.0) <= BACK else factor)


def _is_possible(factor: float) -> bool:
    return FACTORS[0] <= factor <= FACTORS[1]


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:32]
