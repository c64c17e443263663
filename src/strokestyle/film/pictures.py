"""The pictures of a film, waiting on the disk until all are there."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator

import numpy as np
from PIL import Image


class Pictures:
    """Pictures of one size, in the order in which they are shown, each with how long it is held.

    Memory holds one of them at a time: they lie as PNGs in a file without a name, which is gone
    with this object. Used as a context.

    Attributes
    ----------
    held : for how many frames each picture is shown
    size : (width, height), pixels; (0, 0) where there are none
    """

    def __init__(self) -> None:
        self.held: list[int] = []
        self.size = (0, 0)
        self._ends = [0]
        self._file = tempfile.TemporaryFile(prefix="strokestyle-film-")

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def __len__(self) -> int:
        return len(self.held)

    def add(self, png: bytes, held: int = 1) -> None:
        """Put a picture at the end, shown for so many frames.

        Raises ValueError where it is of another size than the first.
        """
        with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
            size = image.size
        if self.held and size != self.size:
            raise ValueError(f"a picture of {size}, the first is of {self.size} pixels")
        self.size = size
        self._file.seek(self._ends[-1])
        self._file.write(png)
        self._ends.append(self._ends[-1] + len(png))
        self.held.append(held)

    def pngs(self) -> Iterator[bytes]:
        """Give all pictures again, as they were given."""
        for start, end in zip(self._ends, self._ends[1:], strict=False):
            self._file.seek(start)
            yield self._file.read(end - start)

    def arrays(self, mode: str = "RGB") -> Iterator[np.ndarray]:
        """Give all pictures again as uint8 arrays: (h, w, 3) in mode "RGB", (h, w, 4) in "RGBA"."""
        for png in self.pngs():
            with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
                yield np.asarray(image.convert(mode))
