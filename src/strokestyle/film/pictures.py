"""The pictures of a film, waiting on the disk until all are there."""

from __future__ import annotations

import io
from collections.abc import Iterator

import numpy as np
from PIL import Image

from .spool import Spool


class Pictures:
    """Pictures of one size, in the order in which they are shown, each with how long it is held.

    Memory holds no more than one of them at a time. Used as a context.

    Attributes
    ----------
    held : for how many frames each picture is shown
    size : (width, height), pixels; (0, 0) where there are none
    pngs : the pictures as they were given
    """

    def __init__(self) -> None:
        self.held: list[int] = []
        self.size = (0, 0)
        self.pngs = Spool()

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *error: object) -> None:
        self.pngs.__exit__(*error)

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
        self.pngs.add(png)
        self.held.append(held)

    def arrays(self, mode: str = "RGB") -> Iterator[np.ndarray]:
        """Give all pictures again as uint8 arrays: (h, w, 3) in mode "RGB", (h, w, 4) in "RGBA"."""
        for png in self.pngs:
            with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
                yield np.asarray(image.convert(mode))
